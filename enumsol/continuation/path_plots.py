"""Paths drawn over branch graphs; matplotlib is imported when a path is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.continuation.path_data import PointKind
from enumsol.errors import InvalidArgumentError
from enumsol.support.arguments import one_of, row_number
from enumsol.support.plotting import axes_or_none, figure_of, new_figure

if TYPE_CHECKING:
    from enumsol.continuation.path_data import PathData

_QUANTITIES = ("lambda_n", "lambda_t", "u_n", "u_t")


def draw_path(
    path: PathData, graph: Any = None, *, node: int = 0, quantity: str = "lambda_n", ax: Any = None, **of_graph: Any
) -> Any:
    """A figure of the accepted steps as dots, transition points as circles, folds as squares, the start as a star.

    The spacing of the dots is the step control. With a graph its branches are drawn underneath.

    Parameters
    ----------
    graph : BranchGraph or None
        Drawn by its own ``plot`` in a new figure, whose options may be given too.
    node : int
        Contact node (row number).
    quantity : {"lambda_n", "lambda_t", "u_n", "u_t"}
        In 3D the tangential ones are drawn as their lengths.
    ax : matplotlib Axes or None
        Draw there, for example in ``figure.axes[0]`` of an earlier plot to add a path to it.

    Returns
    -------
    matplotlib.figure.Figure
        Notebooks show it.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    InvalidArgumentError
        An argument is not one of those above.
    """
    one_of(quantity, "quantity", _QUANTITIES)
    node = row_number(node, "node", path.lambda_n.shape[1])
    if graph is not None and ax is not None:
        raise InvalidArgumentError("graph and ax are both given; draw further paths with path.plot(ax=...) alone")
    if graph is not None:
        # the graph draws a figure of its own; its first panel is this node's, and no zoom shows the path
        ax = graph.plot(quantity, [path.node_ids[node]], **{"zoom": False, **of_graph}).axes[0]
    elif axes_or_none(ax) is None:
        ax = new_figure().subplots()
    values = getattr(path, quantity)[:, node]
    name = quantity
    if values.ndim == 2:
        values, name = np.linalg.norm(values, axis=1), f"|{quantity}|"
    dots = [k for k, kind in enumerate(path.kinds) if kind in (PointKind.STEP, PointKind.END)]
    ax.plot(path.alpha[dots], values[dots], ".", color="black", markersize=3, label="steps", zorder=3)
    folds = {item.point for item in path.folds}
    for marker, label, chosen in (
        ("o", "transitions", [item.point for item in path.transitions if item.point not in folds]),
        ("s", "folds", sorted(folds)),
    ):
        if chosen:
            ax.plot(
                path.alpha[chosen], values[chosen], marker, color="black", markerfacecolor="none", label=label, zorder=4
            )
    ax.plot(path.alpha[:1], values[:1], "*", color="tab:red", markersize=10, label="start", zorder=5)
    if not ax.get_ylabel():
        ax.set_xlabel("alpha")
        ax.set_ylabel(f"{name} of node {path.node_ids[node]}")
        ax.set_title(f"path for alpha in [{path.alpha.min():g}, {path.alpha.max():g}]: {path.status.value}", fontsize=9)
    named = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))  # of several paths once
    ax.legend(handles=list(named.values()), labels=list(named), fontsize=7, frameon=False)
    return figure_of(ax)
