"""Connected bodies, what joins them, and how they can move as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from enumsol.errors import InvalidProblemError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.fem.meshes import PartedMesh
    from enumsol.fem.restrained import Supports
    from enumsol.support.array_types import Floats, Mask

#: What is smaller in a combination of rigid motions is rounding.
_ROUNDED = 1e-12
#: Of the energies of rigid motions in the supports, the least as a share of the largest that holds a body.
_HELD = 1e-10
#: Motions of axisymmetric bodies among those in the plane.
_ALONG_AXIS = slice(1, 2)
#: How many parts of a boundary are named to say which body it is.
_NAMED = 3


@dataclass(frozen=True)
class BodyPiece:
    """A connected body, or several that equations or springs join, or displacements of reference points alone.

    Attributes
    ----------
    nodes : (N,) bool array
        Which nodes are its own.
    name : str
        What messages call it: the names of parts of the body, or of the boundary, that it consists of.
    joined : tuple of (N,) bool arrays
        Nodes of the bodies that are joined; of a single body none.
    points : tuple of int
        Displacements of the reference points that join them.
    axisymmetric : bool
        The only rigid motion of each is along the axis.
    """

    nodes: Mask
    name: str
    joined: tuple[Mask, ...] = ()
    points: tuple[int, ...] = ()
    axisymmetric: bool = False

    def motions(self, points: Floats, count: int) -> Floats:
        """Rigid motions of its bodies, each on its own, and motions of reference points, (count, r)."""
        bodies = self.joined or ((self.nodes,) if np.any(self.nodes) else ())
        columns = [_rigid_motions(points, nodes) for nodes in bodies]
        if self.axisymmetric:
            columns = [own[:, _ALONG_AXIS] for own in columns]
        every = np.pad(
            np.hstack([np.zeros((points.size, 0)), *columns]), ((0, count - points.size), (0, len(self.points)))
        )
        every[list(self.points), every.shape[1] - len(self.points) + np.arange(len(self.points))] = 1.0
        return every

    def free_motions(self, points: Floats, hold: sp.csc_array) -> int:
        """Number of its rigid motions that nothing holds; ``hold`` is a stiffness of supports, joints and springs."""
        motions = self.motions(points, hold.shape[0])
        values = np.linalg.eigvalsh(motions.T @ (hold @ motions))
        return int(np.sum(values <= _HELD * max(values[-1], np.finfo(np.float64).tiny)))

    def free_modes(self, points: Floats, hold: sp.csc_array) -> Floats:
        """The rigid motions that nothing holds, (m, r): translations and rotations, in as simple a form as possible.

        Where supports or springs leave only some of them, they are combinations of a rotation and translations.
        """
        motions = self.motions(points, hold.shape[0])
        count = self.free_motions(points, hold)
        if count == motions.shape[1] and not self.joined:
            plain = rigid_motions(points)[:, _ALONG_AXIS] if self.axisymmetric else rigid_motions(points)
            whole = np.where(np.repeat(self.nodes, points.shape[1])[:, None], plain, 0.0)
            return np.pad(whole, ((0, hold.shape[0] - points.size), (0, 0)))
        _, vectors = np.linalg.eigh(motions.T @ (hold @ motions))
        # echelon form: what is a translation becomes one exactly
        table, row = vectors[:, :count].T.copy(), 0
        for place in range(table.shape[1]):
            best = row + int(np.argmax(np.abs(table[row:, place]))) if row < count else row
            if row == count or abs(table[best, place]) <= _ROUNDED:
                continue
            table[[row, best]] = table[[best, row]]
            table[row] /= table[row, place]
            others = np.arange(count) != row
            table[others] -= np.outer(table[others, place], table[row])
            table[np.abs(table) <= _ROUNDED] = 0.0
            row += 1
        return np.asarray(motions @ table.T)


def pieces_of(mesh: PartedMesh, axisymmetric: bool = False) -> list[BodyPiece]:
    """All connected bodies of a mesh."""
    points, cells = mesh.points, mesh.cells
    first = np.repeat(cells[:, :1], cells.shape[1] - 1, axis=1)
    links = (np.ones(first.size), (first.ravel(), cells[:, 1:].ravel()))
    count, piece_of = connected_components(sp.coo_array(links, shape=(len(points),) * 2), directed=False)
    masks = [piece_of == piece for piece in range(count)]
    names = ["the body" if count == 1 else _name_of(mesh, mask) for mask in masks]
    return [BodyPiece(mask, name, axisymmetric=axisymmetric) for mask, name in zip(masks, names, strict=True)]


def _name_of(mesh: PartedMesh, inside: Mask) -> str:
    """Name of one of several bodies."""
    names = [name for name, rows in mesh.bodies.items() if np.all(inside[mesh.cells[rows]])]
    if not names:
        sides = [name for name, rows in mesh.facets.items() if np.all(inside[rows])]
        more = ", ..." if len(sides) > _NAMED else ""
        names = [f"the body with the boundary {', '.join(sides[:_NAMED])}{more}"] if sides else []
    around = f"the part of the body around {mesh.points[np.argmax(inside)].tolist()}"
    return ", ".join(names) if names else around


def joined(pieces: Sequence[BodyPiece], mesh: PartedMesh, links: sp.csr_array) -> list[BodyPiece]:
    """Bodies that move on their own: rows of ``links`` (k, m), which are not zero in several, join these."""
    d, count = mesh.points.shape[1], len(pieces)
    of = np.append(
        np.repeat(np.argmax([piece.nodes for piece in pieces], axis=0), d),
        count + np.arange(links.shape[1] - mesh.points.size),
    )
    entries = links.tocoo()
    places = (entries.coords[0], of[entries.coords[1]])
    table = sp.csr_array((np.ones(len(places[0])), places), shape=(links.shape[0], int(np.max(of, initial=0)) + 1))
    number, group = connected_components(sp.csr_array(table.T @ table), directed=False)
    found = []
    for k in range(number):
        own = [piece for piece, of_piece in zip(pieces, group[:count], strict=True) if of_piece == k]
        points = tuple((mesh.points.size + np.flatnonzero(group[count:] == k)).tolist())
        if len(own) == 1 and not points:
            found.append(own[0])
            continue
        masks = tuple(piece.nodes for piece in own)
        name = " with ".join(piece.name for piece in own) or "a reference point"
        nodes = np.any([np.zeros(len(mesh.points), dtype=bool), *masks], axis=0)
        found.append(BodyPiece(nodes, name, masks, points, any(piece.axisymmetric for piece in own)))
    return found


def holding(supports: Supports, springs: sp.csc_array, rows: sp.csr_array | None = None) -> sp.csc_array:
    """A stiffness of supports, springs (m, m) and rows (k, m) of equations, the stiffest of each being about one."""
    largest = np.max(springs.diagonal(), initial=0.0)
    fixed = np.pad(supports.fixed.ravel().astype(np.float64), (0, springs.shape[0] - supports.fixed.size))
    hold = sp.csc_array(sp.diags_array(fixed))
    if rows is not None and rows.shape[0]:
        hold = sp.csc_array(hold + rows.T @ rows)
    return sp.csc_array(hold + springs / largest) if largest > 0 else hold


def check_held(pieces: Sequence[BodyPiece], points: Floats, hold: sp.csc_array) -> None:
    """Refuse bodies if one of them can move as a rigid body; ``hold`` is a stiffness of supports and springs.

    Raises
    ------
    InvalidProblemError
        One of them can; the message says which.
    """
    for piece in pieces:
        if piece.free_motions(points, hold):
            raise InvalidProblemError(
                f"{piece.name} is free to move as a rigid body; expected clamp, symmetry, displacement, spring or tie "
                "to hold it (contact alone does not); or max_rigid_displacement, if contact alone is to hold it"
            )


def rigid_modes_of(pieces: Sequence[BodyPiece], points: Floats, hold: sp.csc_array) -> Floats | None:
    """The rigid motions of bodies that nothing holds, (m, r); None if there are none."""
    modes = np.hstack([piece.free_modes(points, hold) for piece in pieces])
    return modes if modes.shape[1] else None


def _rigid_motions(points: Floats, inside: Mask) -> Floats:
    """Displacements (d N, 3) or (d N, 6) by translations and rotations of nodes, in units of their extent."""
    own = points[inside]
    places = (points - own.mean(axis=0)) / np.max(np.ptp(own, axis=0))
    return np.where(np.repeat(inside, points.shape[1])[:, None], rigid_motions(places), 0.0)


def rigid_motions(places: Floats) -> Floats:
    """Translations, and rotations about the origin, of nodes at these places (N, d): (d N, 3) or (d N, 6)."""
    count, dimension = places.shape
    motions = [np.tile(axis, (count, 1)) for axis in np.eye(dimension)]
    for one in range(dimension):
        for two in range(one):
            turned = np.zeros((count, dimension))
            turned[:, one], turned[:, two] = places[:, two], -places[:, one]
            motions.append(turned)
    return np.stack([motion.ravel() for motion in motions], axis=1)
