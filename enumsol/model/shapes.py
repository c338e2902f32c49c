"""The deformed body of a solution: nodes, their displacements, contact forces on them, places of contact rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import ContactStatus
from enumsol.support.array_types import Floats, Integers

#: Displacements are drawn so that the largest takes this part of the body's size, and forces likewise.
_MOVED, _LONGEST = 0.08, 0.16
#: Length of an arrow along a slip, whatever the slip, as a part of the body's size.
SLIP_ARROW = 0.12
#: Bodies whose largest displacements differ by more than this factor are each drawn with an enlargement of their own.
_ALIKE = 8.0
#: Nodal forces below this part of the largest are rounding.
_LEAST_FORCE = 1e-9
#: Displacements below this part of those without contact forces are what rounding leaves where forces cancel the load;
#: larger, it would hide how a stiff body on very weak springs is deformed.
_LEAST_MOVED = 1e-12


@dataclass(frozen=True)
class BodyShape:
    """What a picture of a problem with a mesh needs, whatever the solution.

    Attributes
    ----------
    points : (N, d) array
        Nodes, d = 2 or 3 [length].
    cells : (M, k) array of int
    motion : sparse (d N, n)
        Displacements of the nodes from u.
    offset : (N, d) array
        Prescribed displacements [length].
    weights : sparse (p, N)
        How much every contact row belongs to every node, rows adding up to 1.
    """

    points: Floats
    cells: Integers
    motion: sp.csr_array
    offset: Floats
    weights: sp.csr_array

    @property
    def size(self) -> float:
        """The largest extent of the body [length]."""
        return float(np.max(np.ptp(self.points, axis=0)))

    def displacements(self, u: Floats) -> Floats:
        """Of all nodes, (N, d) [length]."""
        return np.asarray(self.motion @ u).reshape(self.points.shape) + self.offset

    def moves(self, root: Any) -> Floats:
        """Displacements of all nodes at a root, (N, d) [length]: zero for a body at rest, where only rounding is left.

        What rounding is is measured by the displacements without contact forces, or, if nothing holds the body, by its
        size.
        """
        problem, found, free = root.problem, self.displacements(root.u), self.size
        if problem.modes is None:
            none = np.zeros(problem.contact_rows.shape[0])
            free = largest_length(self.displacements(problem.condensed.displacement(root.alpha, none)))
        return found if largest_length(found) > _LEAST_MOVED * free else np.zeros_like(found)

    def contact_forces(self, problem: Any, lambda_n: Floats, lambda_t: Floats) -> Floats:
        """Contact forces on all nodes of the body in global axes, (N, d) [force]."""
        rows = np.concatenate([lambda_n, lambda_t.ravel(order="F")])
        forces = -np.asarray(self.motion @ (problem.contact_rows.T @ rows)).reshape(self.points.shape)
        size = np.linalg.norm(forces, axis=1, keepdims=True)
        return np.asarray(np.where(size > _LEAST_FORCE * np.max(size, initial=0.0), forces, 0.0))

    def at_rows(self, values: Floats) -> Floats:
        """Values of nodes (N, d) at the contact rows, (p, d)."""
        return np.asarray(self.weights @ values)


def largest_length(vectors: Floats) -> float:
    """The length of the longest of some vectors."""
    return float(np.max(np.linalg.norm(vectors, axis=1), initial=0.0))


def body_shape(problem: Any) -> BodyShape:
    """The shape of a problem in 2D or 3D.

    Raises
    ------
    InvalidArgumentError
        The problem has no mesh.
    """
    mesh = problem.mesh
    if mesh is None:
        raise InvalidArgumentError("the problem has no mesh; expected one made by enumsol.fem, or with mesh=")
    points, motion = mesh.points, mesh.motion
    offset = np.zeros_like(points) if mesh.offset is None else mesh.offset
    by_node = sp.csr_array(abs(problem.Bn) @ abs(motion).T)
    dimension = points.shape[1]
    gather = sp.kron(sp.eye_array(len(points)), np.ones((dimension, 1)))
    weights = sp.csr_array(by_node @ gather)
    scale = 1.0 / np.asarray(weights.sum(axis=1)).ravel()
    return BodyShape(points, mesh.cells, motion, offset, sp.csr_array(sp.diags_array(scale) @ weights))


def round_scale(largest: float, size: float, share: float = _MOVED) -> float:
    """A factor of the form 1, 2 or 5 times a power of ten by which ``largest`` takes about that share of the size."""
    if not largest > 0:
        return 1.0
    wanted = share * size / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted * (1 + 1e-12)))


def own_scales(largest: Sequence[float], size: float) -> tuple[float, ...]:
    """Factors of bodies that are compared: the same for all, or of each its own if they move by very different amounts.

    Bodies that do not move at all have the factor of the others.
    """
    moved = [value for value in largest if value > 0]
    common = round_scale(max(largest), size)
    if not moved or max(moved) <= _ALIKE * min(moved):
        return (common,) * len(largest)
    return tuple(round_scale(value, size) if value > 0 else common for value in largest)


def row_frames(problem: Any) -> Floats:
    """Unit vectors of the contact rows in global axes, (p, d, d): the normals and the tangents; zero if not known."""
    rows = [problem.Bn, *([problem.Bt] if hasattr(problem, "Bt") else [problem.Bt1, problem.Bt2])]
    sums = np.stack([problem.mesh.directions(matrix) for matrix in rows], axis=1)
    lengths = np.linalg.norm(sums, axis=2, keepdims=True)
    return np.asarray(np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0))


def row_tangents(problem: Any) -> Floats:
    """Both tangents of the contact rows in 3D, summed over the nodes of a row, in global axes, (p, 2, 3)."""
    return np.stack([problem.mesh.directions(rows) for rows in (problem.Bt1, problem.Bt2)], axis=1)


def slip_directions(problem: Any, root: Any) -> tuple[Integers, Floats]:
    """Contact rows in 3D that slip, (k,), and the unit vectors in global axes along which they do, (k, 3)."""
    moves = np.einsum("pk,pkc->pc", root.u_t, row_tangents(problem))
    size = np.linalg.norm(moves, axis=1)
    slips = np.array([status is ContactStatus.SLIP for status in root.statuses])
    slides = np.flatnonzero(slips & (size > 0))
    return slides, moves[slides] / size[slides, None]


def arrow_scale(largest: float, size: float) -> float:
    """Length of an arrow for a unit of force."""
    return _LONGEST * size / largest if largest > 0 else 0.0
