"""Whether a load is at the limit of what contact forces can hold, as far as floats tell (theory, section 14.12)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha, Codes, Floats

#: A load this near to the limit, relative to itself, counts as one at it: where it is larger, loads for which balls
#: decide count, too; smaller ones are missed where data have been rounded, or directions of friction in 3D are sought.
LIMIT_TOLERANCE = 1e-9
#: Forces that work less than this share along a motion are on the border.
_ACTIVE = 1e-5
_OPTIONS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


@dataclass(frozen=True)
class LoadLimit:
    """A load that is at the limit of what contact forces can hold, up to rounding.

    Among the rigid displacements that no contact forces promote, the load works most along the motion at the limit.

    Attributes
    ----------
    beyond : float
        The work of the load along it, as a share of what the load on the body could do; what is positive, no contact
        forces hold.
    codes : tuple of int, or None
        In 2D the statuses at which nothing opposes this motion: a complete selection, of a family if there is one.
    """

    beyond: float
    codes: Codes | None


def load_limit(problem: AnyProblem, alpha: Alpha) -> LoadLimit | None:
    """The limit that the load of a body that nothing holds is at; None where it is not near one.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float or Fraction
    """
    modes, f, p = problem.modes, problem.load_at(alpha), problem.p
    N, f = modes.N / np.max(np.abs(modes.N), axis=0), f / max(float(np.max(np.abs(f))), np.finfo(float).tiny)
    load = N.T @ f
    if np.all(np.abs(load) <= LIMIT_TOLERANCE * (np.abs(N).T @ np.abs(f))):
        return None  # nothing presses the body against its contacts
    with np.errstate(over="ignore", invalid="ignore"):
        G, F = np.asarray(problem.contact_rows @ N).T, problem.friction_at(alpha).reshape(p, -1)
        normals, across = G[:, :p].T, G[:, p:].reshape(len(G), -1, p).transpose(2, 1, 0) * F[:, :, None]
        # how large forces are means nothing
        forces = np.maximum(np.max(np.abs(normals), axis=1), np.max(np.abs(across), axis=(1, 2)))
        unit = np.where(forces > 0, forces, 1.0)
        normals, across = normals / unit[:, None], across / unit[:, None, None]
    if not np.all(np.isfinite(forces)):
        return None
    z = _motion(load / np.max(np.abs(load)), normals, across)
    if z is None:
        return None
    moved = N @ z
    most = np.max(np.abs(moved))
    size = most * np.sum(np.abs(f[np.abs(moved) > LIMIT_TOLERANCE * most]))
    beyond = float(moved @ f / size) if size > 0 else 0.0
    if not abs(beyond) <= LIMIT_TOLERANCE:
        return None
    return LoadLimit(beyond, _codes(normals @ z, across[:, 0] @ z, F[:, 0]) if F.shape[1] == 1 else None)


def _codes(normal: Floats, across: Floats, F: Floats) -> Codes:
    """The statuses of nodes in 2D whose forces do not oppose a motion, by the work of these along it."""
    least = _ACTIVE * max(np.max(np.abs(normal)), np.max(np.abs(across)))
    sliding = np.where(np.abs(across) <= least, STICK, np.where(across > 0, SLIP_PLUS, SLIP_MINUS))
    touching = np.where(F > 0, sliding, FRICTIONLESS)
    return tuple(np.where(normal + np.abs(across) < -least, OPEN, touching).tolist())


def _motion(load: Floats, normals: Floats, across: Floats) -> Floats | None:
    """The motion that no contact forces promote along which the load works most, (r,); None where it is well inside.

    A node's forces are combinations of its row of ``normals``, (p, r), and up to as much in all of its directions of
    ``across``, (p, d, r).
    """
    from scipy.optimize import linprog  # only bodies that nothing holds need it

    _, d, r = across.shape
    angles = 0.25 * np.pi * np.arange(8)  # directions of friction at a node in 3D to begin with
    corners = np.array([[1.0], [-1.0]]) if d == 1 else np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rays = (normals[:, None] + np.einsum("kd,pdr->pkr", corners, across)).reshape(-1, r)
    pressing = normals.sum(axis=0) / max(float(np.max(np.abs(normals.sum(axis=0)))), np.finfo(float).tiny)
    for _ in range(40):
        found = linprog(-load, rays, np.zeros(len(rays)), pressing[None], [-1.0], (None, None), options=_OPTIONS)
        if found.status != 0:
            return None
        z = np.array(found.x)
        if load @ z < -1e-4 * np.max(np.abs(z)):
            return None  # well inside: it needs no other directions
        limits = _at_limit(z, normals, across)
        if d == 1 or not np.any(limits @ z > 1e-13 * np.max(np.abs(rays @ z))):
            break
        rays = np.vstack([rays, limits])
    for _ in range(4):  # the solver is content with seven digits
        limits = _at_limit(z, normals, across)
        work = limits @ z
        tight = np.vstack([limits[np.abs(work) <= _ACTIVE * np.max(np.abs(work))], pressing])
        rest = np.append(np.zeros(len(tight) - 1), -1.0) - tight @ z
        z += np.linalg.lstsq(tight, rest, rcond=1e-9)[0]
    return z


def _at_limit(z: Floats, normals: Floats, across: Floats) -> Floats:
    """Forces at the limit of friction that work most along a motion, (p, r)."""
    work = across @ z
    length = np.linalg.norm(work, axis=1)
    along = work / np.where(length > 0, length, 1.0)[:, None]
    return np.asarray(normals + np.einsum("pd,pdr->pr", along, across))
