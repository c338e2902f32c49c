"""Figures of branch graphs: alpha against a quantity, the number of solutions as steps underneath."""

from __future__ import annotations

from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.figures.curves import Curve, Quantity, curves, cut_at, quantity_of, side_by_side, state_columns
from enumsol.branches.figures.panels import (
    GREY,
    MARKERS,
    STATUS_STYLES,
    VERDICT_STYLES,
    Panel,
    colour_of,
    draw_numbers,
    draw_open_ranges,
    draw_steps,
    drawn_range,
    family_range,
    handles,
    index_style,
    line_styles,
    narrow_changes,
    sheet_range,
)
from enumsol.branches.roots_at import roots_at
from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import alpha_interval, positive_number, shown
from enumsol.support.messages import counted
from enumsol.support.plotting import axes_or_none, checked_units, figure_of, in_units, kept, new_figure, plain_axes

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from enumsol.branches.elements import Arc
    from enumsol.branches.graph_data import GraphData
    from enumsol.support.array_types import Floats


#: A third of a pixel of a large panel: with more of it corners are seen, with less drawing takes longer.
_TOLERANCE = 5e-4


def plot_graph(
    graph: GraphData,
    quantity: str | None = None,
    nodes: Sequence[Any] | None = None,
    *,
    multiplicity: bool = True,
    zoom: bool | tuple[float, float] = True,
    units: tuple[str, str] | None = None,
    title: str | None = None,
    tolerance: float = _TOLERANCE,
    ax: Axes | None = None,
    file: str | Path | None = None,
    figsize: tuple[float, float] | None = None,
) -> Any:
    """A matplotlib figure of the branches: one panel of an overview, or one panel per node.

    Branches that coincide in the quantity shown are drawn side by side, which a note says. In overviews the line style
    tells the index, or, once ``stability`` was asked for, where an arc runs away (dashed), where it does not (solid),
    and where that is undecided (dotted); in panels of nodes it tells the status of the node.

    Parameters
    ----------
    quantity : {"norm", "sum_n", "sum_t", "lambda_n", "lambda_t", "u_n", "u_t"}, optional
        The first three are overviews: norm of all contact forces (the default), sums of normal and of tangential
        forces. The others are of single nodes; default "lambda_n" if nodes are named. In 3D tangential ones are the
        lengths of vectors.
    nodes : sequence of node labels, optional
        Default: all of up to three nodes, otherwise the three on which branches differ most.
    multiplicity : bool
        Draw the number of solutions as steps underneath.
    zoom : bool or (float, float)
        Panels beside the first for parts too narrow to be seen in which the number of solutions changes, up to two of
        them, or for the given interval of alpha.
    units : (str, str), optional
        Of forces and of lengths, for the axes.
    title : str, optional
        What the problem is; the figure adds the interval and whether the graph is complete.
    tolerance : float
        Distance of drawn curves from the branches, relative to a panel's width and height.
    ax : matplotlib Axes, optional
        Draw one panel there, without steps and zooms.
    file : path, optional
        Save the figure there.
    figsize : (float, float), optional
        Inches.

    Returns
    -------
    matplotlib.figure.Figure
        Notebooks show it.

    Raises
    ------
    InvalidArgumentError
        An unknown quantity or node, an interval that is none, nodes of an overview, or several panels and ``ax``.
    MissingDependencyError
        matplotlib is not installed.
    """
    chosen = quantity_of(("norm" if nodes is None else "lambda_n") if quantity is None else quantity)
    units = checked_units(units)
    # smaller ones cannot be seen
    tolerance = max(positive_number(tolerance, "tolerance"), 1e-6)
    rows = _rows(graph, chosen, nodes, one=axes_or_none(ax) is not None)
    windows = [] if ax is not None else _windows(graph, zoom)
    if ax is None:
        figure, axes = _grid(len(rows), multiplicity, len(windows), figsize)
    else:
        figure, axes = figure_of(ax), [[ax]]
    columns = [graph.interval, *windows]
    panels, others = [], set[str]()
    for column, window in zip(axes, columns, strict=True):
        drawn = _drawn(graph, chosen, tolerance, None if column is axes[0] else window)
        for axis, row in zip(column, rows, strict=False):
            panels.append(_panel(axis, graph, chosen, row, drawn, window))
            _dress(axis, graph.problem.node_ids[row], chosen, units, window)
        if multiplicity and ax is None and draw_steps(column[-1], graph.claims.steps(), window):
            others.add("dots")
        for axis in column:
            if draw_open_ranges(axis, graph.claims, window):
                others.add("open")
        column[-1].set_xlabel("alpha")
    _mark_windows(axes, windows)
    _words(figure, axes[0][0], graph, chosen, title, others, alone=ax is not None)
    draw_numbers(figure, panels, None if ax is None else ax)
    return kept(figure, file)


def _rows(graph: GraphData, quantity: Quantity, nodes: Sequence[Any] | None, *, one: bool) -> list[int]:
    """Columns of the values, one per panel: contact nodes, or the only column of an overview."""
    ids = list(graph.problem.node_ids)
    if nodes is not None:
        if not quantity.by_node:
            raise InvalidArgumentError(f"nodes are given with the quantity {quantity.name!r}; expected one of nodes")
        row = {label: k for k, label in enumerate(ids)}
        try:
            chosen = [row[node] for node in nodes]
        except (KeyError, TypeError):
            chosen = []
        if not chosen:
            raise InvalidArgumentError(f"nodes is {shown(nodes)}; expected labels among {shown(ids)}")
        if one and len(chosen) > 1:
            raise InvalidArgumentError(f"nodes is {shown(nodes)} with one ax; expected one label")
        return chosen
    if not quantity.by_node:
        return [0]
    most = 1 if one else 3
    if len(ids) <= most or not graph.arcs:
        return list(range(min(len(ids), most)))
    spread = drawn_range(graph.vertices, quantity)
    return sorted(np.argsort(-spread, kind="stable")[:most].tolist())


def _windows(graph: GraphData, zoom: bool | tuple[float, float]) -> list[tuple[float, float]]:
    if isinstance(zoom, (bool, np.bool_)):
        return narrow_changes(graph.claims.steps(), graph.interval) if zoom else []
    low, high = (float(end) for end in alpha_interval(zoom, "zoom"))
    a, b = graph.interval
    if high <= a or low >= b:
        raise InvalidArgumentError(f"zoom is {shown(zoom)}; expected an interval that overlaps [{a:g}, {b:g}]")
    return [(max(low, a), min(high, b))]


def _grid(
    rows: int, multiplicity: bool, zooms: int, figsize: tuple[float, float] | None
) -> tuple[Any, list[list[Any]]]:
    """A figure and its axes, column by column; those of the whole interval come first in figure.axes."""
    heights = [3.6 if rows == 1 else 2.7] * rows + [1.1] * int(multiplicity)
    size = figsize or (7.5 + 3.0 * zooms, sum(heights) + 1.0)
    figure = new_figure(figsize=size)
    grid = figure.add_gridspec(len(heights), 1 + zooms, height_ratios=heights, width_ratios=[7.0] + [3.6] * zooms)
    axes: list[list[Any]] = []
    for column in range(1 + zooms):
        axes.append([])
        for row in range(len(heights)):
            share = axes[-1][0] if row else None
            axis = figure.add_subplot(grid[row, column], sharex=share)
            if row + 1 < len(heights):
                axis.tick_params(labelbottom=False)
            axes[-1].append(axis)
    return figure, axes


def _drawn(
    graph: GraphData, quantity: Quantity, tolerance: float, window: tuple[float, float] | None
) -> dict[int, Curve]:
    lo, hi = window or graph.interval
    arcs = [arc for arc in graph.arcs if not arc.dimension]
    changing = [arc for arc in arcs if window is not None and (lo < arc.lo < hi or lo < arc.hi < hi)]
    # a zoom is as high as the arcs that end in it, so that these are drawn to a tolerance of their own
    parts = (changing, [arc for arc in arcs if arc not in changing])
    return {
        number: curve
        for part in parts
        for number, curve in curves(part, quantity.name, hi - lo, tolerance, window).items()
    }


def _panel(
    axis: Axes, graph: GraphData, quantity: Quantity, row: int, drawn: dict[int, Curve], window: tuple[float, float]
) -> Panel:
    """Draw one panel."""
    from matplotlib.transforms import ScaledTranslation

    height = None if window == graph.interval else _ending(graph, drawn, row, window)
    places = side_by_side(drawn, graph.branch_of, row, None if height is None else height[1] - height[0])
    for arc in graph.arcs:
        if arc.dimension:
            sides = graph.vertices[arc.tail], graph.vertices[arc.head]
            band = sheet_range(graph.problem, partial(roots_at, graph), arc, sides, quantity, row)
            if band is not None:
                axis.fill_between(*band, color=GREY, alpha=0.25, linewidth=0)
        elif arc.number in drawn:
            curve, place = drawn[arc.number], places[arc.number]
            colour = colour_of(graph.branch_of[arc.number])
            for line, alphas, values in _pieces(graph, arc, curve, quantity, row):
                (artist,) = axis.plot(alphas, values, linestyle=line, color=colour, linewidth=1.6)
                if place.among > 1:
                    # points between two, and no more for all of them
                    step = min(2.6, 6.0 / (place.among - 1))
                    away = (place.rank - (place.among - 1) / 2) * step / 72.0
                    moved = ScaledTranslation(-0.4 * away, away, axis.figure.dpi_scale_trans)
                    artist.set_transform(axis.transData + moved)
                    artist.set_linewidth(min(1.6, max(0.5, 0.8 * step)))
    for v in graph.vertices:
        if not window[0] <= v.alpha <= window[1]:
            continue
        if v.family is not None:
            ends = family_range(graph.problem, v, quantity, row)
            axis.plot([v.alpha] * 2, ends, color=GREY, linewidth=2.4, solid_capstyle="butt", zorder=3)
        if (mark := MARKERS.get(v.kind)) is not None:
            value = float(state_columns(quantity, v)[row])
            axis.plot([v.alpha], [value], marker=mark[0], ms=4.5, color=GREY, markerfacecolor=mark[1], zorder=4)
    axis.margins(y=0.12)
    if height is not None:
        axis.set_ylim(*height)
    return Panel(axis, drawn, places, graph.branch_of, row)


def _pieces(
    graph: GraphData, arc: Arc, curve: Curve, quantity: Quantity, row: int
) -> Iterator[tuple[Any, Floats, Floats]]:
    """Line styles, alphas and values of the parts of an arc that look different."""
    if quantity.by_node or graph.verdicts is None:
        line = STATUS_STYLES[arc.statuses[row]] if quantity.by_node else index_style(arc.index)
        yield line, curve.alphas, curve.values[:, row]
        return
    spans = graph.verdicts[arc.number]
    ends = [spans[0].low, *(span.high for span in spans)]
    for span, part in zip(spans, cut_at(curve, row, ends), strict=True):
        yield VERDICT_STYLES[span.verdict], *part


def _ending(
    graph: GraphData, drawn: dict[int, Curve], row: int, window: tuple[float, float]
) -> tuple[float, float] | None:
    """The range of the arcs that end inside a window, with room above and below; None where it has no height."""
    lo, hi = window
    inside = [drawn[arc.number] for arc in graph.arcs if arc.number in drawn and (lo < arc.lo < hi or lo < arc.hi < hi)]
    if not inside:
        return None
    values = np.concatenate([curve.values[:, row] for curve in inside])
    low, high = float(values.min()), float(values.max())
    room = 0.15 * (high - low)
    return (low - room, high + room) if room > 1e-12 * max(abs(low), abs(high)) else None


def _dress(
    axis: Axes, node: object, quantity: Quantity, units: tuple[str, str] | None, window: tuple[float, float]
) -> None:
    """Name the axes of a panel."""
    name = f"{quantity.name} of node {node}" if quantity.by_node else quantity.words
    axis.set_ylabel(in_units(name, quantity.dimension, units))
    axis.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4))
    plain_axes(axis)
    axis.set_xlim(*window)


def _mark_windows(axes: list[list[Any]], windows: list[tuple[float, float]]) -> None:
    """Name the parts that are drawn larger, in both places."""
    for letter, column, (lo, hi) in zip("AB", axes[1:], windows, strict=False):
        for axis in axes[0]:
            axis.axvspan(lo, hi, color="#f2c14e", alpha=0.45, linewidth=0.8, zorder=0.5)
        axes[0][0].annotate(
            letter, ((lo + hi) / 2, 0.99), xycoords=("data", "axes fraction"), fontsize=8, ha="center", va="top"
        )
        words = f"{letter}: alpha from {lo:.8g}, width {hi - lo:.3g};\nas high as the arcs that end here"
        column[0].set_title(words, fontsize=8, loc="left")
        column[-1].tick_params(axis="x", rotation=30)
        for axis in column:
            axis.xaxis.get_major_locator().set_params(nbins=4)


def _words(
    figure: Figure,
    first: Axes,
    graph: GraphData,
    quantity: Quantity,
    title: str | None,
    others: set[str],
    *,
    alone: bool,
) -> None:
    """The title and the legend."""
    problem, (a, b) = graph.problem, graph.interval
    name = counted(problem.p, "contact node") if title is None else title
    words = f"{name}, alpha in [{a:g}, {b:g}]; {graph.closing_line}"
    if (grid := first.get_gridspec()) is not None and not alone:
        # no wider than the panel below, beside which others have titles of their own
        widths = np.array(grid.get_width_ratios(), dtype=float)
        words = fill(words, max(int(13 * figure.get_figwidth() * widths[0] / np.sum(widths)), 20))  # letters an inch
    first.set_title(words, fontsize=9, loc="left", wrap=True)
    arcs = [arc for arc in graph.arcs if not arc.dimension]
    others |= {"continuum"} if any(v.family is not None for v in graph.vertices) else set()
    others |= {"sheet"} if len(arcs) < len(graph.arcs) and quantity.dimension == "force" else set()
    entries = handles({v.kind for v in graph.vertices}, line_styles(graph, by_node=quantity.by_node), others)
    if alone:
        first.legend(handles=entries, frameon=False, fontsize=7)
    else:
        rows = -(-len(entries) // (6 if graph.verdicts is None else 5)) or 1  # of longer words fewer
        across = -(-len(entries) // rows) or 1
        figure.legend(handles=entries, loc="outside upper center", ncols=across, frameon=False, fontsize=8)
