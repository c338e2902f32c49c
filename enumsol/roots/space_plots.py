"""A picture of a solution in 3D: statuses and slips on the contact surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import ContactStatus
from enumsol.roots.body_plots import draw_body
from enumsol.support.plotting import axes_or_none, figure_of, new_figure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.model.problem3d import ContactProblem3D

_MARKS = {
    ContactStatus.OPEN: ("o", "none"),
    ContactStatus.STICK: ("s", "tab:blue"),
    ContactStatus.SLIP: ("o", "tab:red"),
}


def draw_root(root: Any, problem: ContactProblem3D, ax: Any) -> Any:
    """See Root.plot."""
    if axes_or_none(ax) is not None or problem.mesh is None:
        return draw_slips(root, problem, ax)
    figure = new_figure(figsize=(11.0, 5.0))
    draw_body(root, problem, figure.add_subplot(121, projection="3d"))
    draw_slips(root, problem, figure.add_subplot(122))
    return figure


def draw_slips(root: Any, problem: ContactProblem3D, ax: Any) -> Any:
    """Statuses and directions of slip on the contact surface."""
    if problem.coordinates is None:
        raise InvalidArgumentError("the problem has no coordinates; expected a problem made with coordinates=")
    places = problem.coordinates
    # the two coordinate axes along which the contact surface extends most
    shown = np.sort(np.argsort(np.ptp(places, axis=0), kind="stable")[1:])
    moves = np.einsum("pk,pkc->pc", root.u_t, _axes(problem, shown))[:, shown]
    if axes_or_none(ax) is None:
        ax = new_figure(figsize=(6.4, 5.0)).subplots()
    for status, (marker, face) in _MARKS.items():
        at = places[[found is status for found in root.statuses]][:, shown]
        if len(at):
            ax.plot(*at.T, marker, mec="black", mfc=face, label=f"{status.value} ({len(at)})")
    size = np.linalg.norm(moves, axis=1)
    slides = np.array([found is ContactStatus.SLIP for found in root.statuses]) & (size > 0)
    if np.any(slides):
        d = moves[slides] / size[slides, None]
        colours = {"cmap": "viridis", "clim": (0.0, np.max(size[slides]))}  # equal slips in the same colour
        ax.quiver(*places[slides][:, shown].T, *d.T, size[slides], angles="xy", width=0.005, **colours)
    ax.set_aspect("equal", adjustable="box")
    ax.margins(0.15)
    ax.set_xlabel("xyz"[shown[0]])
    ax.set_ylabel("xyz"[shown[1]])
    ax.set_title(f"directions of slip at alpha = {float(root.alpha):g}, index {root.index:+d}")
    ax.legend()
    return figure_of(ax)


def _axes(problem: ContactProblem3D, shown: NDArray[np.intp]) -> NDArray[np.float64]:
    """The local axes t1, t2 of every contact row in global axes, (p, 2, 3); those shown where no mesh tells them."""
    if problem.mesh is None:
        return np.tile(np.eye(3)[shown], (problem.p, 1, 1))
    return np.stack([problem.mesh.directions(rows) for rows in (problem.Bt1, problem.Bt2)], axis=1)
