"""Figures of branch graphs: alpha against a quantity of chosen contact nodes, the multiplicity as steps underneath.

Line styles follow the field's habit: solid where the node is open, dashed where it sticks, dash-dotted where it slips.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from enumsol.branches.curves import curves as polygons
from enumsol.branches.elements import VertexKind
from enumsol.checks import one_of, positive_number, shown
from enumsol.errors import InvalidArgumentError
from enumsol.figures import new_figure
from enumsol.statuses import ContactStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.branches.claims import Claims
    from enumsol.branches.elements import Arc, Branch, Vertex
    from enumsol.problem import ContactProblem
    from enumsol.roots.root_set import RootSet


class DrawnGraph(Protocol):
    """What a figure shows of a BranchGraph."""

    problem: ContactProblem
    interval: tuple[float, float]
    vertices: tuple[Vertex, ...]
    arcs: tuple[Arc, ...]

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Paths and closed loops of arcs, and sheets."""

    @property
    def complete(self) -> bool:
        """Whether it is proven that no solution is missing."""

    @property
    def claims(self) -> Claims:
        """What is known about the number of solutions."""

    def completeness(self) -> str:
        """One sentence about it."""

    def roots_at(self, alpha: float) -> RootSet:
        """All solutions at one alpha."""


QUANTITIES = {
    "lambda_n": "normal force",
    "lambda_t": "tangential force",
    "u_n": "normal displacement",
    "u_t": "tangential displacement",
}
_STYLES: dict[ContactStatus, Any] = {
    ContactStatus.OPEN: "-",
    ContactStatus.STICK: (0, (5, 2.5)),
    ContactStatus.SLIP_PLUS: (0, (6, 1.6, 1.2, 1.6)),
    ContactStatus.SLIP_MINUS: (0, (6, 1.6, 1.2, 1.6)),
}
#: Blue, orange, green, violet, red, brown, teal, olive: distinct in print and to most readers.
_COLOURS = ("#1f5fa8", "#d9730d", "#2a8a4a", "#7a4fa3", "#c23b4b", "#7d5a3c", "#2a9aa0", "#8a8a2a")
_FAMILY = "#333333"
#: Panels drawn when no nodes are named.
_MAX_PANELS = 3
#: A third of a pixel of a large panel; and what no eye can tell from none.
_TOLERANCE, _LEAST_TOLERANCE = 5e-4, 1e-6


def plot_graph(
    graph: DrawnGraph,
    quantity: str = "lambda_n",
    nodes: Sequence[Any] | None = None,
    *,
    multiplicity: bool = True,
    tolerance: float = _TOLERANCE,
    file: Any = None,
    figsize: tuple[float, float] | None = None,
) -> Any:
    """A matplotlib figure of the branches, one panel a node.

    Parameters
    ----------
    graph : BranchGraph
    quantity : {"lambda_n", "lambda_t", "u_n", "u_t"}
    nodes : sequence of node labels, optional
        Default: all of up to three nodes, otherwise the three on which branches differ most.
    multiplicity : bool
        Draw the number of solutions as steps underneath.
    tolerance : float
        Distance of drawn curves from the branches, relative to a panel's width and height.
    file : path, optional
        Save the figure there and close it.
    figsize : (float, float), optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InvalidArgumentError
        An unknown quantity or node.
    MissingDependencyError
        matplotlib is not installed.
    """
    one_of(quantity, "quantity", QUANTITIES)
    tolerance = max(positive_number(tolerance, "tolerance"), _LEAST_TOLERANCE)
    a, b = graph.interval
    curves = polygons([arc for arc in graph.arcs if not arc.dimension], quantity, float(b) - float(a), tolerance)
    chosen = _nodes(graph, nodes, curves)
    rows = len(chosen) + int(multiplicity)
    height = 2.7 * len(chosen) + 1.3 * int(multiplicity) + 0.6
    figure = new_figure(figsize=figsize or (7.5, height))
    ratios = [2.7] * len(chosen) + [1.1] * int(multiplicity)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": ratios})[:, 0]
    for axis, node in zip(axes, chosen, strict=False):
        _panel(axis, graph, quantity, node, curves)
    if multiplicity:
        _steps(axes[-1], graph)
    for axis in axes:
        axis.grid(visible=True, color="#e4e4e4", linewidth=0.6)
        axis.set_axisbelow(True)
        for side in ("top", "right"):
            axis.spines[side].set_visible(False)
    axes[-1].set_xlabel("alpha")
    axes[-1].set_xlim(*graph.interval)
    _legend(figure, graph)
    if not graph.complete:
        axes[0].set_title(graph.completeness(), fontsize=8, color=_FAMILY, wrap=True)
    if file is not None:
        figure.savefig(file, dpi=150)
    return figure


def _nodes(graph: DrawnGraph, nodes: Sequence[Any] | None, curves: dict[int, Any]) -> list[int]:
    ids = list(graph.problem.node_ids)
    if nodes is not None:
        row = {label: k for k, label in enumerate(ids)}
        try:
            chosen = [row[node] for node in nodes]
        except (KeyError, TypeError):
            chosen = []
        if not chosen:
            raise InvalidArgumentError(f"nodes is {shown(nodes)}; expected labels among {shown(ids)}")
        return chosen
    if len(ids) <= _MAX_PANELS or not curves:
        return list(range(min(len(ids), _MAX_PANELS)))
    values = np.concatenate([values for _, values in curves.values()])
    spread = values.max(axis=0) - values.min(axis=0)
    return sorted(np.argsort(-spread, kind="stable")[:_MAX_PANELS].tolist())


def _panel(axis: Any, graph: DrawnGraph, quantity: str, node: int, curves: dict[int, Any]) -> None:
    for branch in graph.branches:
        colour = _COLOURS[branch.number % len(_COLOURS)]
        for arc in branch.arcs:
            if arc.dimension:
                _sheet(axis, graph, arc, quantity, node)
                continue
            alphas, values = curves[arc.number]
            axis.plot(alphas, values[:, node], linestyle=_STYLES[arc.statuses[node]], color=colour, linewidth=1.6)
        _number(axis, branch, node, curves, colour)
    for v in graph.vertices:
        if v.family is not None:
            ends = _family_range(graph, v, quantity, node)
            axis.plot([v.alpha] * 2, ends, color=_FAMILY, linewidth=2.4, solid_capstyle="butt", zorder=3)
        _marker(axis, v, float(getattr(v, quantity)[node]))
    axis.set_ylabel(f"{quantity} of node {graph.problem.node_ids[node]}")
    axis.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4))


_MARKERS = {
    VertexKind.TRANSITION: "o",
    VertexKind.TOUCH: "o",
    VertexKind.FOLD: "s",
    VertexKind.BIFURCATION: "D",
    VertexKind.POINT: "x",
    VertexKind.BROKEN: "X",
    VertexKind.UNSETTLED: "4",
}


def _marker(axis: Any, v: Vertex, value: float) -> None:
    marker = _MARKERS.get(v.kind)
    if marker is None:
        return
    filled = "#333333" if marker in "xX4" else "white"
    axis.plot([v.alpha], [value], marker=marker, markersize=4.5, color=_FAMILY, markerfacecolor=filled, zorder=4)


def _number(axis: Any, branch: Branch, node: int, curves: dict[int, Any], colour: str) -> None:
    """The branch's number beside the middle of its longest arc."""
    drawn = [arc for arc in branch.arcs if not arc.dimension]
    if not drawn:
        return
    alphas, values = curves[max(drawn, key=lambda arc: arc.length).number]
    middle = len(alphas) * 5 // 8
    axis.annotate(
        str(branch.number),
        (alphas[middle], values[middle, node]),
        textcoords="offset points",
        xytext=(0, 4),
        color=colour,
        fontsize=9,
        ha="center",
    )


def _family_range(graph: DrawnGraph, v: Vertex, quantity: str, node: int) -> tuple[float, float]:
    """Smallest and largest value of the quantity on a family."""
    family = v.family
    if family is None:
        raise AssertionError("the vertex has no family")
    if quantity.startswith("lambda"):
        values = family.vertices[:, node, 0 if quantity.endswith("_n") else 1]
    else:
        condensed, p = graph.problem.condensed, graph.problem.p
        forces = family.vertices.transpose(0, 2, 1).reshape(len(family.vertices), 2 * p)
        moves = condensed.g0 + v.alpha * condensed.g1 - forces @ condensed.S
        values = moves[:, node if quantity == "u_n" else p + node]
    return float(np.min(values)), float(np.max(values))


def _sheet(axis: Any, graph: DrawnGraph, arc: Arc, quantity: str, node: int) -> None:
    """The range of a sheet, shaded (forces only; displacements of a sheet are not drawn)."""
    if not quantity.startswith("lambda"):
        return
    alphas, low, high = arc.sampled(9)[1:-1], [], []
    for alpha in alphas:
        points = np.concatenate([family.vertices for family in graph.roots_at(float(alpha)).families])
        values = points[:, node, 0 if quantity.endswith("_n") else 1]
        low.append(values.min())
        high.append(values.max())
    axis.fill_between(alphas, low, high, color=_FAMILY, alpha=0.25, linewidth=0)


def _steps(axis: Any, graph: DrawnGraph) -> None:
    steps = graph.claims.steps()
    edges = [float(alpha) for alpha in steps.alphas]
    if steps.between:
        axis.stairs(steps.between, edges, color=_FAMILY, linewidth=1.4, baseline=None)
    special = [
        (x, n)
        for k, (x, n) in enumerate(zip(edges, steps.at, strict=True))
        if n not in steps.between[max(k - 1, 0) : k + 1]
    ]
    if special:
        axis.plot([x for x, _ in special], [n for _, n in special], ".", color=_FAMILY, markersize=5)
    axis.set_ylabel("solutions" if steps.exact else "solutions,\nat least")
    axis.set_ylim(0, max([*steps.between, *steps.at], default=1) + 0.8)
    axis.yaxis.get_major_locator().set_params(integer=True)


def _legend(figure: Any, graph: DrawnGraph) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color="#666666", linestyle=_STYLES[status], label=label)
        for status, label in (
            (ContactStatus.OPEN, "open"),
            (ContactStatus.STICK, "stick"),
            (ContactStatus.SLIP_PLUS, "slip"),
        )
    ]
    kinds = {v.kind for v in graph.vertices}
    for kind, label in (
        (VertexKind.TRANSITION, "transition"),
        (VertexKind.FOLD, "fold"),
        (VertexKind.BIFURCATION, "bifurcation"),
        (VertexKind.UNSETTLED, "not followed further"),
    ):
        if kind in kinds:
            filled = "#333333" if kind is VertexKind.UNSETTLED else "white"
            handles.append(
                Line2D([], [], linestyle="", marker=_MARKERS[kind], color=_FAMILY, markerfacecolor=filled, label=label)
            )
    if any(v.family is not None for v in graph.vertices):
        handles.append(Line2D([], [], color=_FAMILY, linewidth=2.4, label="continuum"))
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False, fontsize=8)
