"""Figures of histories: one quantity of the roots against another, every history a line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.loading.history_data import START
from enumsol.support.arguments import shown
from enumsol.support.plotting import axes_or_none, figure_of, new_figure

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.loading.history_data import HistoryData, Node
    from enumsol.roots.root import Root

#: Quantities by their names, with the labels of axes.
LABELS = {
    "step": "step",
    "alpha": "alpha",
    "displacement": "displacement in the direction of the load",
    "lambda_n": "sum of lambda_n",
    "lambda_t": "sum of lambda_t",
    "dissipated": "work of friction since the start",
}
#: Histories that have a colour of their own; ends that are labelled.
_COLOURED, _NAMED = 10, 24
_SHARED = "#555555"


def draw_history(data: HistoryData, x: Any, y: Any, ax: Any) -> Any:
    """A figure; see History.plot."""
    axes_or_none(ax)
    across, up = _values(data, x, "x"), _values(data, y, "y")
    if ax is None:
        ax = new_figure(figsize=(7.0, 4.6)).add_subplot()
    colours = _colours(data)
    for before, node in data.graph.edges:
        ends = [place for place in (before, node) if place in across and place in up]
        if len(ends) == 2:
            colour = colours[before, node]
            ax.plot([across[k] for k in ends], [up[k] for k in ends], "-", color=colour, linewidth=1.4, zorder=2)
    for node, given in data.graph.nodes(data=True):
        if node not in across or node not in up:
            continue
        dropped = node[0] < len(data.steps) and node not in data.followed and node != START
        edges = [colours[edge] for edge in data.graph.in_edges(node)]
        colour = edges[0] if edges else _SHARED
        regular = given["root"] is None or given["root"].regular
        marker = "o" if regular else "D"
        face = "white" if dropped else colour
        ax.plot(across[node], up[node], marker, markersize=4, color=colour, markerfacecolor=face, zorder=3)
    _name_ends(data, across, up, ax)
    ax.set_xlabel(_label(x))
    ax.set_ylabel(_label(y))
    ax.set_title(data.completeness(), fontsize=9)
    ax.margins(0.07)
    return figure_of(ax)


def _label(quantity: Any) -> str:
    return LABELS[quantity] if isinstance(quantity, str) else getattr(quantity, "__name__", "")


def _colours(data: HistoryData) -> dict[tuple[Node, Node], str]:
    """Of every edge: that of the one history it belongs to, grey where there are several or too many."""
    ways: dict[Node, int] = {}
    for node in reversed(list(data.graph)):
        following = list(data.graph.successors(node))
        ways[node] = sum(ways[other] for other in following) or 1
    colours: dict[tuple[Node, Node], str] = {}
    for number, path in enumerate(data.paths() if ways[START] <= _COLOURED else ()):
        for edge in zip((START, *path[:-1]), path, strict=True):
            colours[edge] = f"C{number}" if ways[edge[1]] == 1 else _SHARED
    return {edge: colours.get(edge, _SHARED) for edge in data.graph.edges}


def _name_ends(data: HistoryData, across: dict[Node, float], up: dict[Node, float], ax: Any) -> None:
    """Names beside the ends of histories; ends at one place have one label."""
    places: dict[tuple[int, int], list[Node]] = {}
    spans = [max(values.values()) - min(values.values()) or 1.0 for values in (across, up)]
    for node, degree in data.graph.out_degree():
        if degree == 0 and node in across and node in up:
            place = round(10 * across[node] / spans[0]), round(10 * up[node] / spans[1])
            places.setdefault(place, []).append(node)
    middle = min(across.values(), default=0.0) + 0.5 * spans[0]
    for nodes in list(places.values())[:_NAMED]:
        text = ", ".join(f"{step}.{number}" for step, number in nodes[:4]) + (", ..." if len(nodes) > 4 else "")
        a, b = across[nodes[0]], up[nodes[0]]
        side = {"xytext": (-6, 4), "ha": "right"} if a > middle else {"xytext": (6, 4), "ha": "left"}
        ax.annotate(text, (a, b), textcoords="offset points", fontsize=8, **side)


def _values(data: HistoryData, quantity: Any, name: str) -> dict[Node, float]:
    """The quantity at the nodes, and at the start where it is known there."""
    nodes = [node for node in data.graph if node != START]
    if quantity == "step":
        return {node: float(node[0]) for node in data.graph}
    if quantity == "dissipated":
        return {node: data.dissipated[node][0] for node in data.graph}
    if callable(quantity):
        return {node: float(quantity(data.graph.nodes[node]["root"])) for node in nodes}
    if not isinstance(quantity, str) or quantity not in LABELS:
        known = ", ".join(LABELS)
        raise InvalidArgumentError(f"{name} is {shown(quantity)}; expected one of {known}, or a function of a root")
    of = _displacement(data) if quantity == "displacement" else _OF_ROOTS[quantity]
    return {node: of(data.graph.nodes[node]["root"]) for node in nodes}


def _displacement(data: HistoryData) -> Callable[[Root], float]:
    """The displacement of the loaded degrees of freedom, weighted by how the load changes [length]."""
    problem = data.problem
    loads = [step.load if step.load is not None else problem.load_at(step.exact_alpha) for step in data.steps]
    changes = [load - loads[0] for load in loads]
    weights = max(changes, key=lambda change: float(np.max(np.abs(change))))
    weights = weights if np.any(weights) else loads[0]
    total = float(np.sum(np.abs(weights))) or 1.0
    return lambda root: float(weights @ root.u) / total


_OF_ROOTS: dict[str, Callable[[Root], float]] = {
    "alpha": lambda root: float(root.alpha),
    "lambda_n": lambda root: float(np.sum(root.lambda_n)),
    "lambda_t": lambda root: float(np.sum(root.lambda_t if root.lambda_t.ndim == 1 else root.lambda_t[:, 0])),
}
