"""Pictures of solutions: deformed bodies in 2D and 3D, and in 3D statuses and slips on the contact surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.cells import boundary_facets, facet_outlines, outline_edges
from enumsol.model.shapes import (
    SLIP_ARROW,
    arrow_scale,
    body_mesh,
    body_moves,
    contact_forces,
    first_view,
    largest_length,
    own_scales,
    row_frames,
    row_weights,
    slip_directions,
)
from enumsol.model.statuses import ContactStatus
from enumsol.support.arguments import positive_number
from enumsol.support.plotting import axes_of, axes_or_none, figure_of, in_units, line_entry, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.roots.local_branch import ContactState
    from enumsol.support.array_types import Floats, Indices


#: Marker and colour of a contact node.
MARKS = {
    ContactStatus.OPEN: ("o", "white"),
    ContactStatus.STICK: ("s", "#1f5fa8"),
    ContactStatus.SLIP_PLUS: ("^", "#d9730d"),
    ContactStatus.SLIP_MINUS: ("v", "#2a8a4a"),
    ContactStatus.SLIP: ("D", "#c23b4b"),
}
_FORCE, _SLIP, _BODY, _EDGE, _BEFORE = "#b3202c", "#0a7d7a", "#dfe6ee", "#8796a8", "#dcdcdc"
_BEFORE_IN_SPACE, _BEFORE_LINE = "#5b6672", {"linewidths": 0.8, "linestyles": "dashed"}
#: Arrows in the plane, by default as long as they are.
_ARROW: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.006, "zorder": 4}
#: Points between a title and what is below it, by dimension: seen from below, axes of a solid stand on top.
_PAD = {2: 6.0, 3: 18.0}


def draw_body(
    root: ContactState,
    problem: AnyProblem,
    place: object = None,
    scale: float | None = None,
    units: tuple[str, str] | None = None,
) -> Any:
    """A figure of one deformed body; see Root.plot_body."""
    ax = axes_or_none(place)
    mesh = body_mesh(problem)
    (factor,), arrows = _factors([root], problem, scale)
    if ax is None:
        figure = new_figure(figsize=(6.4, 5.0))
        ax = _axes(figure, (1, 1, 1), mesh)
    elif mesh.points.shape[1] == 3 and not hasattr(ax, "set_zlim"):
        raise InvalidArgumentError("ax is plane and the body is not; expected Axes with projection '3d', or None")
    _draw(ax, root, problem, factor, arrows)
    ax.set_title(
        f"alpha = {float(root.alpha):g}, {_index(root)}; {_scale_words(factor)}",
        fontsize=9,
        pad=_PAD[mesh.points.shape[1]],
    )
    _name_axes(ax, mesh.points.shape[1], units)
    _legend(ax, [root], _strongest([root], problem), units)
    return figure_of(ax)


def draw_bodies(roots: Sequence[Any], scale: float | None = None, units: tuple[str, str] | None = None) -> Any:
    """A figure of the deformed bodies of several roots side by side; see RootSet.plot_bodies."""
    if not roots:
        raise InvalidArgumentError("there are no isolated roots to draw; expected at least one")
    problem = roots[0].problem
    mesh = body_mesh(problem)
    drawn = roots[:12]
    factors, arrows = _factors(drawn, problem, scale)
    across = min(3, len(drawn))
    rows = -(-len(drawn) // across)
    figure = new_figure(figsize=(4.0 * across, 3.6 * rows + 0.8))
    one_scale = len(set(factors)) == 1
    for k, (root, factor) in enumerate(zip(drawn, factors, strict=True)):
        ax = _axes(figure, (rows, across, k + 1), mesh)
        _draw(ax, root, problem, factor, arrows)
        own = "" if one_scale else f"; {_scale_words(factor)}"
        ax.set_title(f"root {k}: {_index(root)}{own}", fontsize=9, pad=_PAD[mesh.points.shape[1]])
        _name_axes(ax, mesh.points.shape[1], units)
    if mesh.points.shape[1] == 3:
        _same_view(figure.axes)
    shown = f", the first {len(drawn)} of {len(roots)} roots" if len(drawn) < len(roots) else ""
    words = _scale_words(factors[0]) if one_scale else "every body with an enlargement of its own"
    figure.suptitle(f"alpha = {float(drawn[0].alpha):g}, {words}{shown}", fontsize=10)
    _legend(figure, drawn, _strongest(drawn, problem), units)
    return figure


def _index(root: Any) -> str:
    return "index unknown" if root.index is None else f"index {root.index:+d}"


def _scale_words(scale: float) -> str:
    return f"displacements times {scale:g}"


def _strongest(roots: Sequence[ContactState], problem: AnyProblem) -> float:
    """The largest nodal contact force of several roots [force]."""
    return max(largest_length(contact_forces(problem, root.lambda_n, root.lambda_t)) for root in roots)


def _factors(roots: Sequence[Any], problem: AnyProblem, scale: float | None) -> tuple[tuple[float, ...], float]:
    """Factors of the displacements of each root, and one of all forces."""
    size = body_mesh(problem).size
    arrows = arrow_scale(_strongest(roots, problem), size)
    if scale is not None:
        return (positive_number(scale, "scale"),) * len(roots), arrows
    moved = [largest_length(body_moves(root.problem, root.u, root.alpha)) for root in roots]
    return own_scales(moved, size), arrows


def _axes(figure: Figure, place: tuple[int, int, int], mesh: BodyMesh) -> Any:
    return figure.add_subplot(*place, projection="3d" if mesh.points.shape[1] == 3 else None)


def _draw(ax: Axes3D, root: Any, problem: AnyProblem, scale: float, arrows: float) -> None:
    mesh = body_mesh(problem)
    moves = scale * body_moves(root.problem, root.u, root.alpha)
    points = mesh.points + moves
    places = row_weights(problem) @ points
    forces = arrows * contact_forces(problem, root.lambda_n, root.lambda_t)
    pressed = np.flatnonzero(np.any(forces != 0, axis=1))
    plane = points.shape[1] == 2
    if len(pressed):
        # the arrow ends at the node that it acts on
        look = _ARROW if plane else {"linewidth": 1.8, "arrow_length_ratio": 0.3, "zorder": 4}
        ax.quiver(*(points - forces)[pressed].T, *forces[pressed].T, color=_FORCE, **look)
    if plane:
        _plane(ax, mesh, points)
        if len(pressed):
            ax.update_datalim((points - forces)[pressed])
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.08)
    else:
        _solid(ax, mesh, points)
        x, y, z = first_view(row_frames(problem)[:, 0])
        ax.view_init(elev=np.degrees(np.arcsin(z)), azim=np.degrees(np.arctan2(y, x)))
        slides, ways = slip_directions(problem, root.u_t, root.statuses)
        if len(slides):
            look = {"linewidth": 1.8, "arrow_length_ratio": 0.4, "zorder": 4}
            ax.quiver(*places[slides].T, *(SLIP_ARROW * mesh.size * ways).T, color=_SLIP, **look)
        ax.auto_scale_xyz(*np.concatenate([mesh.points, points, (points - forces)[pressed]]).T)
        ax.locator_params(nbins=4)
        ax.tick_params(labelsize=7, pad=0)
        ax.set_aspect("equal")
    for status, (marker, face) in MARKS.items():
        at = places[[found is status for found in root.statuses]]
        if len(at):
            ax.plot(*at.T, marker, markeredgecolor="black", markerfacecolor=face, markersize=5, zorder=5)


def _same_view(axes: Sequence[Any]) -> None:
    """Set the same limits for bodies that are compared."""
    for direction in "xyz":
        limits = [getattr(ax, f"get_{direction}lim")() for ax in axes]
        for ax in axes:
            getattr(ax, f"set_{direction}lim")(min(low for low, _ in limits), max(high for _, high in limits))
    for ax in axes:
        ax.set_aspect("equal")


def _plane(ax: Axes, mesh: BodyMesh, points: Floats) -> None:
    from matplotlib.collections import PolyCollection

    cells = facet_outlines(mesh.cells)
    ax.add_collection(PolyCollection(list(mesh.points[cells]), facecolors="none", edgecolors=_BEFORE, linewidths=0.5))
    ax.add_collection(PolyCollection(list(points[cells]), facecolors=_BODY, edgecolors=_EDGE, linewidths=0.6))
    for positions in (mesh.points, points):
        ax.update_datalim(positions)


def _solid(ax: Axes3D, mesh: BodyMesh, points: Floats) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    faces = facet_outlines(boundary_facets(3, mesh.cells))
    edges = mesh.points[outline_edges(mesh.points, faces)]
    ax.computed_zorder = False  # forces and marks are seen through the body
    look = {"facecolors": _BODY, "edgecolors": _EDGE, "linewidths": 0.4, "alpha": 0.35}
    ax.add_collection3d(Poly3DCollection(list(points[faces]), zorder=2, **look))
    ax.add_collection3d(Line3DCollection(list(edges), colors=_BEFORE_IN_SPACE, **_BEFORE_LINE, zorder=3))


def _name_axes(ax: object, dimension: int, units: tuple[str, str] | None) -> None:
    """Directions with the unit of lengths; without units a picture needs no names of axes."""
    for direction in "xyz"[: dimension if units is not None else 0]:
        getattr(ax, f"set_{direction}label")(in_units(direction, "length", units), fontsize=8)


def _legend(
    place: Axes | Figure, roots: Sequence[ContactState], strongest: float, units: tuple[str, str] | None
) -> None:
    found = {status for root in roots for status in root.statuses}
    handles = [
        line_entry(status.value, linestyle="", marker=marker, markerfacecolor=face, markeredgecolor="black")
        for status, (marker, face) in MARKS.items()
        if status in found
    ]
    if strongest > 0:
        most = "" if units is None else f", up to {strongest:.4g} {units[0]}"
        handles.append(line_entry(f"contact force on the body{most}", color=_FORCE))
    if ContactStatus.SLIP in found:
        handles.append(line_entry("direction of slip", color=_SLIP, linewidth=1.8))
    if roots[0].lambda_t.ndim == 2:
        handles.append(line_entry("undeformed", color=_BEFORE_IN_SPACE, linewidth=0.8, linestyle="dashed"))
    where: dict[str, Any] = {"loc": "best"}
    if hasattr(place, "add_subplot"):
        where = {"loc": "outside lower center", "ncols": 6}
    elif hasattr(place, "set_zlim"):
        where = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "ncols": 3}
    place.legend(handles=handles, fontsize=8, frameon=False, **where)


def draw_root(root: ContactState, problem: ContactProblem3D, ax: object, units: tuple[str, str] | None = None) -> Any:
    """See Root.plot."""
    if axes_or_none(ax) is not None or problem.mesh is None:
        return draw_slips(root, problem, ax, units)
    figure = new_figure(figsize=(12.5, 5.0))
    draw_body(root, problem, figure.add_subplot(121, projection="3d"), units=units)
    draw_slips(root, problem, figure.add_subplot(122), units)
    return figure


def draw_slips(
    root: ContactState, problem: ContactProblem3D, place: object, units: tuple[str, str] | None = None
) -> Any:
    """Statuses and directions of slip on the contact surface."""
    if problem.coordinates is None:
        raise InvalidArgumentError("the problem has no coordinates; expected a problem made with coordinates=")
    places = problem.coordinates
    # the two coordinate axes along which the contact surface extends most
    shown = np.sort(np.argsort(np.ptp(places, axis=0), kind="stable")[1:])
    moves = np.einsum("pk,pkc->pc", root.u_t, _tangents(problem, shown))[:, shown]
    ax = axes_of(place, (6.4, 5.0))
    for status, (marker, face) in MARKS.items():
        at = places[[found is status for found in root.statuses]][:, shown]
        if len(at):
            ax.plot(*at.T, marker, mec="black", mfc=face, label=f"{status.value} ({len(at)})")
    size = np.linalg.norm(moves, axis=1)
    slides = np.array([found is ContactStatus.SLIP for found in root.statuses]) & (size > 0)
    if np.any(slides):
        begin, d = places[slides][:, shown], moves[slides] / size[slides, None]
        # arrows of one length, whatever the slip
        length = 0.15 * float(np.max(np.ptp(places, axis=0))) or 1.0
        look = _ARROW | {"scale": 1 / length, "width": 0.009}
        low, high = np.min(size[slides]), np.max(size[slides])
        said = f"{low:.3g}" if np.isclose(low, high) else f"{low:.3g} to {high:.3g}"
        ax.quiver(*begin.T, *d.T, color=_SLIP, label=f"direction of slip ({said})", **look)
        ax.update_datalim(begin + length * d)
    ax.set_aspect("equal", adjustable="box")
    ax.margins(0.15)
    ax.set_xlabel(in_units("xyz"[shown[0]], "length", units))
    ax.set_ylabel(in_units("xyz"[shown[1]], "length", units))
    ax.set_title(f"directions of slip at alpha = {float(root.alpha):g}, {_index(root)}")
    ax.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), fontsize=8, frameon=False)
    return figure_of(ax)


def _tangents(problem: ContactProblem3D, shown: Indices) -> Floats:
    """The local axes t1, t2 of every contact row in global axes, (p, 2, 3); those shown where no mesh tells them."""
    if problem.mesh is None:
        return np.tile(np.eye(3)[shown], (problem.p, 1, 1))
    return np.stack([problem.mesh.directions(rows) for rows in (problem.Bt1, problem.Bt2)], axis=1)
