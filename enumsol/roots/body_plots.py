"""Pictures of deformed bodies: mesh, contact forces as arrows, contact nodes by status, in 2D and 3D."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.cells import KINDS, boundary_facets, facet_outlines
from enumsol.model.shapes import BodyShape, arrow_scale, body_shape, round_scale
from enumsol.model.statuses import ContactStatus
from enumsol.support.arguments import positive_number
from enumsol.support.plotting import axes_or_none, figure_of, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

#: Marker and colour of a contact node.
MARKS = {
    ContactStatus.OPEN: ("o", "white"),
    ContactStatus.STICK: ("s", "#1f5fa8"),
    ContactStatus.SLIP_PLUS: ("^", "#d9730d"),
    ContactStatus.SLIP_MINUS: ("v", "#2a8a4a"),
    ContactStatus.SLIP: ("D", "#c23b4b"),
}
_FORCE, _BODY, _EDGE = "#b3202c", "#dfe6ee", "#8796a8"
#: Bodies side by side, and how many are drawn at most.
_ACROSS, MOST_BODIES = 3, 12


def draw_body(root: Any, problem: Any, ax: Any = None, scale: float | None = None) -> Any:
    """A figure of one deformed body; see Root.plot_body."""
    axes_or_none(ax)
    shape = body_shape(problem)
    factors = _factors([root], problem, shape, scale)
    if ax is None:
        figure = new_figure(figsize=(6.4, 5.0))
        ax = _axes(figure, 111, shape)
    elif shape.points.shape[1] == 3 and not hasattr(ax, "set_zlim"):
        raise InvalidArgumentError("ax is plane and the body is not; expected Axes with projection '3d', or None")
    _draw(ax, root, problem, shape, factors)
    ax.set_title(f"alpha = {float(root.alpha):g}, {_index(root)}; {_scale_words(factors[0])}", fontsize=9)
    _legend(ax, [root])
    return figure_of(ax)


def draw_bodies(roots: Sequence[Any], scale: float | None = None) -> Any:
    """A figure of the deformed bodies of several roots side by side, in one scale; see RootSet.plot_bodies."""
    if not roots:
        raise InvalidArgumentError("there are no isolated roots to draw; expected at least one")
    problem = roots[0].problem
    shape = body_shape(problem)
    drawn = roots[:MOST_BODIES]
    factors = _factors(drawn, problem, shape, scale)
    across = min(_ACROSS, len(drawn))
    rows = -(-len(drawn) // across)
    figure = new_figure(figsize=(4.0 * across, 3.6 * rows + 0.8))
    for k, root in enumerate(drawn):
        ax = _axes(figure, (rows, across, k + 1), shape)
        _draw(ax, root, problem, shape, factors)
        ax.set_title(f"root {k}: {_index(root)}", fontsize=9)
    shown = f", the first {len(drawn)} of {len(roots)} roots" if len(drawn) < len(roots) else ""
    figure.suptitle(f"alpha = {float(drawn[0].alpha):g}, {_scale_words(factors[0])}{shown}", fontsize=10)
    _legend(figure, drawn)
    return figure


def _index(root: Any) -> str:
    return "index unknown" if root.index is None else f"index {root.index:+d}"


def _scale_words(scale: float) -> str:
    return f"displacements times {scale:g}"


def _factors(roots: Sequence[Any], problem: Any, shape: BodyShape, scale: float | None) -> tuple[float, float]:
    """By what displacements and forces are multiplied, the same for all roots."""
    forces = max(_largest(shape.contact_forces(problem, root.lambda_n, root.lambda_t)) for root in roots)
    if scale is not None:
        return positive_number(scale, "scale"), arrow_scale(forces, shape.size)
    moved = max(_largest(shape.displacements(root.u)) for root in roots)
    return round_scale(moved, shape.size), arrow_scale(forces, shape.size)


def _largest(vectors: Floats) -> float:
    return float(np.max(np.linalg.norm(vectors, axis=1), initial=0.0))


def _axes(figure: Any, place: Any, shape: BodyShape) -> Any:
    options = {"projection": "3d"} if shape.points.shape[1] == 3 else {}
    return figure.add_subplot(*place, **options) if isinstance(place, tuple) else figure.add_subplot(place, **options)


def _draw(ax: Any, root: Any, problem: Any, shape: BodyShape, factors: tuple[float, float]) -> None:
    scale, arrows = factors
    moves = scale * shape.displacements(root.u)
    points = shape.points + moves
    places = shape.at_rows(points)
    forces = arrows * shape.contact_forces(problem, root.lambda_n, root.lambda_t)
    pressed = np.flatnonzero(np.any(forces != 0, axis=1))
    if points.shape[1] == 2:
        _plane(ax, shape, points)
        if len(pressed):
            # the arrow ends at the node that it acts on
            options = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.006, "zorder": 4}
            ax.quiver(*(points - forces)[pressed].T, *forces[pressed].T, color=_FORCE, **options)
            ax.update_datalim((points - forces)[pressed])
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.08)
    else:
        _solid(ax, shape, points)
        if len(pressed):
            ax.quiver(*(points - forces)[pressed].T, *forces[pressed].T, color=_FORCE, arrow_length_ratio=0.25)
        ax.set_aspect("equal")
    for status, (marker, face) in MARKS.items():
        at = places[[found is status for found in root.statuses]]
        if len(at):
            ax.plot(*at.T, marker, markeredgecolor="black", markerfacecolor=face, markersize=5, zorder=5)


def _plane(ax: Any, shape: BodyShape, points: Floats) -> None:
    from matplotlib.collections import PolyCollection

    cells = shape.cells[:, KINDS[2, shape.cells.shape[1]].outline]
    ax.add_collection(
        PolyCollection(list(shape.points[cells]), facecolors="none", edgecolors="#dcdcdc", linewidths=0.5)
    )
    ax.add_collection(PolyCollection(list(points[cells]), facecolors=_BODY, edgecolors=_EDGE, linewidths=0.6))
    for positions in (shape.points, points):
        ax.update_datalim(positions)


def _solid(ax: Any, shape: BodyShape, points: Floats) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    faces = facet_outlines(boundary_facets(3, shape.cells))
    body = Poly3DCollection(list(points[faces]), facecolors=_BODY, edgecolors=_EDGE, linewidths=0.4, alpha=0.35)
    ax.add_collection3d(body)
    ax.auto_scale_xyz(*points.T)


def _legend(place: Any, roots: Sequence[Any]) -> None:
    from matplotlib.lines import Line2D

    found = {status for root in roots for status in root.statuses}
    handles = [
        Line2D([], [], linestyle="", marker=marker, markerfacecolor=face, markeredgecolor="black", label=status.value)
        for status, (marker, face) in MARKS.items()
        if status in found
    ]
    if any(np.any(root.lambda_n) for root in roots):
        handles.append(Line2D([], [], color=_FORCE, label="contact force on the body"))
    where = {"loc": "outside lower center", "ncols": 5} if hasattr(place, "add_subplot") else {"loc": "best"}
    place.legend(handles=handles, fontsize=8, frameon=False, **where)
