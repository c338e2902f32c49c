"""Figures of histories: one quantity of the roots against another."""

from __future__ import annotations

from textwrap import fill, shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.loading.history_data import START, HistoryData, Node
from enumsol.roots.root import summary
from enumsol.support.arguments import shown
from enumsol.support.plotting import axes_of, figure_of, in_units, line_entry

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes
    from matplotlib.text import Annotation

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
_DIMENSIONS = {"displacement": "length", "lambda_n": "force", "lambda_t": "force", "dissipated": "work"}
#: Histories that have a colour of their own.
_COLOURED = 10
#: Where a name may stand beside the end of a history, in points, best first; points on a line that it should not hide.
_BESIDE = [(side * 6, up) for far in (4, 14, 24, 34, 44) for side in (1, -1) for up in (far, -far - 6)]
_ALONG = np.linspace(0.0, 1.0, 16)
_SHARED = "#555555"


def draw_history(data: HistoryData, x: object, y: object, place: object, units: tuple[str, str] | None = None) -> Any:
    """A figure; see History.plot."""
    ax = axes_of(place, (8.4, 4.6))
    across, up = _values(data, x, "x"), _values(data, y, "y")
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
    for axis in [axis for quantity, axis in ((x, ax.xaxis), (y, ax.yaxis)) if quantity == "step"]:
        axis.get_major_locator().set_params(integer=True)
    _legend(data, colours, ax)
    ax.set_xlabel(_label(x, units))
    ax.set_ylabel(_label(y, units))
    about = f"{_label(y, None)} over {_label(x, None)}" if _label(x, None) and _label(y, None) else "histories"
    ax.set_title(fill(f"{about[0].upper()}{about[1:]}", 70) + f"\n{data.closing_line}", fontsize=9)
    ax.margins(0.07)
    _name_ends(data, across, up, ax)
    return figure_of(ax)


def _label(quantity: object, units: tuple[str, str] | None) -> str:
    if not isinstance(quantity, str):
        return getattr(quantity, "__name__", "")
    return in_units(LABELS[quantity], _DIMENSIONS.get(quantity), units)


def _colours(data: HistoryData) -> dict[tuple[Node, Node], str]:
    """Colour of every edge: that of the one history it belongs to, grey where there are several or too many."""
    ways = _ways(data)
    colours: dict[tuple[Node, Node], str] = {}
    for number, path in enumerate(data.paths() if ways[START] <= _COLOURED else ()):
        for edge in zip((START, *path[:-1]), path, strict=True):
            colours[edge] = f"C{number}" if ways[edge[1]] == 1 else _SHARED
    return {edge: colours.get(edge, _SHARED) for edge in data.graph.edges}


def _ways(data: HistoryData) -> dict[Node, int]:
    """Number of histories that lead on from every node."""
    ways: dict[Node, int] = {}
    for node in reversed(list(data.graph)):
        ways[node] = sum(ways[other] for other in data.graph.successors(node)) or 1
    return ways


def _legend(data: HistoryData, colours: dict[tuple[Node, Node], str], ax: Axes) -> None:
    """Beside the drawing: where every history with a colour of its own goes, and what else there is to be seen."""
    handles = []
    for number, path in enumerate(data.paths() if _ways(data)[START] <= _COLOURED else ()):
        edges = zip((START, *path[:-1]), path, strict=True)
        own = [edge[1] for edge in edges if colours[edge] == f"C{number}"]
        if own:
            ends = " to ".join(f"{step}.{root}" for step, root in dict.fromkeys((own[0], path[-1])))
            statuses = summary(data.graph.nodes[path[-1]]["root"].statuses)
            text = shorten(f"{ends}: {statuses}", 34, placeholder=" ...")
            handles.append(line_entry(text, color=f"C{number}"))
    if _SHARED in colours.values():
        handles.append(line_entry("several histories", color=_SHARED))
    nodes = [(node, given["root"]) for node, given in data.graph.nodes(data=True) if given["root"] is not None]
    point = {"linestyle": "", "color": _SHARED, "markersize": 4}
    if any(not root.regular for _, root in nodes):
        handles.append(line_entry("root that is not regular", marker="D", markerfacecolor=_SHARED, **point))
    if any(node[0] < len(data.steps) and node not in data.followed for node, _ in nodes):
        handles.append(line_entry("not followed", marker="o", markerfacecolor="white", **point))
    if handles:
        look: dict[str, Any] = {"title": "histories", "fontsize": 8, "title_fontsize": 8, "frameon": False}
        ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), **look)


def _name_ends(data: HistoryData, across: dict[Node, float], up: dict[Node, float], ax: Axes) -> None:
    """Names beside the ends of histories, where they hide no other and few lines; ends at one place have one label."""
    places: dict[tuple[int, int], list[Node]] = {}
    spans = [max(values.values()) - min(values.values()) or 1.0 for values in (across, up)]
    for node, degree in data.graph.out_degree():
        if degree == 0 and node in across and node in up:
            place = round(50 * across[node] / spans[0]), round(50 * up[node] / spans[1])
            places.setdefault(place, []).append(node)
    figure_of(ax).draw_without_rendering()  # until then nothing has a place
    drawn = [
        np.outer(1.0 - _ALONG, [across[a], up[a]]) + np.outer(_ALONG, [across[b], up[b]])
        for a, b in data.graph.edges
        if all(node in across and node in up for node in (a, b))
    ]
    lines = ax.transData.transform(np.concatenate(drawn)) if drawn else np.empty((0, 2))
    names: list[Any] = []
    for nodes in list(places.values())[:24]:
        text = ", ".join(f"{step}.{number}" for step, number in nodes[:4]) + (", ..." if len(nodes) > 4 else "")
        label = ax.annotate(
            text, (across[nodes[0]], up[nodes[0]]), xytext=(0, 0), textcoords="offset points", fontsize=8
        )

        def cost(offset: tuple[int, int], label: Annotation = label) -> tuple[int, int]:
            label.set(ha="left" if offset[0] > 0 else "right", position=offset)
            box = label.get_window_extent()
            outside = box.x0 < ax.bbox.x0 or box.x1 > ax.bbox.x1 or box.y0 < ax.bbox.y0 or box.y1 > ax.bbox.y1
            return outside + sum(box.overlaps(other) for other in names), int(box.count_contains(lines))

        cost(min(_BESIDE, key=cost))
        names.append(label.get_window_extent())


def _values(data: HistoryData, quantity: object, name: str) -> dict[Node, float]:
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
