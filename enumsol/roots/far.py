"""Notes on roots that move so far that displacements are not small, as the whole problem takes them to be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats

#: Rotations above this are not small [degrees]: their cosine differs from one by 1.5 percent.
LARGEST_TURN = 10.0


def far_notes(roots: Sequence[Any]) -> list[str]:
    """Notes on roots whose contact nodes move farther than the contact is wide, or turn by several degrees.

    Only bodies of a material in a mesh have notes, for their lengths mean something. A turn is the rotation that all
    contact nodes have in common; for pairs it is that of one side relative to the other.
    """
    problem = roots[0].problem if roots else None
    if problem is None or problem.coordinates is None or problem.mesh is None or problem.mesh.lame is None:
        return []
    places = np.asarray(problem.coordinates)
    places = places - places.mean(axis=0)
    width = float(np.max(np.ptp(places, axis=0)))
    if width == 0:
        return []
    axes = _axes(problem)
    far, turned = {}, {}
    for k, root in enumerate(roots):
        parts = np.column_stack([root.u_n + problem.gap, root.u_t + problem.slip_offset])
        far[k] = float(np.max(np.linalg.norm(parts, axis=1))) / width
        if axes is not None:
            turned[k] = _turn(places, np.einsum("pk,pkd->pd", parts, axes))
    notes = []
    if moved := [k for k, ratio in far.items() if ratio > 1.0]:
        most = max(moved, key=far.__getitem__)
        notes.append(
            f"{_of(moved)} contact nodes farther than the contact is wide, root {most} by {far[most] * width:.3g}, "
            f"which is {far[most]:.3g} times its width: displacements are taken to be small"
        )
    if rolled := [k for k, turn in turned.items() if turn > LARGEST_TURN]:
        most = max(rolled, key=turned.__getitem__)
        notes.append(
            f"{_of(rolled, 'turn')} the contact by more than {LARGEST_TURN:g} degrees, root {most} by "
            f"{turned[most]:.3g}: rotations are taken to be small"
        )
    return notes


def _of(roots: Sequence[int], verb: str = "move") -> str:
    return f"{counted(len(roots), 'root')} {verb}{'s' if len(roots) == 1 else ''}"


def _axes(problem: Any) -> Floats | None:
    """Normal and tangents (p, d, d) of the contact nodes in global axes; None where rows stand for patches."""
    if problem.mesh.rows is not None:
        return None
    rows = (problem.Bn, problem.Bt) if problem.mesh.points.shape[1] == 2 else (problem.Bn, problem.Bt1, problem.Bt2)
    return np.stack([problem.mesh.directions(row) for row in rows], axis=1)


def _turn(places: Floats, moved: Floats) -> float:
    """The rotation (degrees) that displacements (p, d) of places about their mean have in common, by least squares."""
    moved = moved - moved.mean(axis=0)
    if places.shape[1] == 2:
        moment = float(np.sum(places[:, 0] * moved[:, 1] - places[:, 1] * moved[:, 0]))
        return float(np.degrees(abs(moment) / np.sum(places**2)))
    inertia = np.sum(places**2) * np.eye(3) - places.T @ places
    moments = np.sum(np.cross(places, moved), axis=0)
    return float(np.degrees(np.linalg.norm(np.linalg.lstsq(inertia, moments, rcond=1e-9)[0])))
