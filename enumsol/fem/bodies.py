"""Connected bodies, what joins them, how they can move as a whole, and their materials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem.bases import COMPONENTS, isotropic
from enumsol.fem.conditions import by_part, names_of
from enumsol.fem.meshes import SAME, lame
from enumsol.fem.restrained import RIGHT_ANGLE
from enumsol.support.arguments import finite_number, one_of, positive_number, shown
from enumsol.support.array_arguments import real_array, short_vector

if TYPE_CHECKING:
    from enumsol.fem.bases import NodalBasis
    from enumsol.fem.conditions import Options
    from enumsol.fem.meshes import PartedMesh
    from enumsol.fem.restrained import Supports
    from enumsol.support.array_types import Floats, Integers, Mask

#: What is smaller in a combination of rigid motions is rounding.
_ROUNDED = 1e-12
#: Of the energies of rigid motions in the supports, the least as a share of the largest that holds a body.
_HELD = 1e-10
#: Motions of axisymmetric bodies among those in the plane.
_ALONG_AXIS = slice(1, 2)


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
        more = ", ..." if len(sides) > 3 else ""
        names = [f"the body with the boundary {', '.join(sides[:3])}{more}"] if sides else []
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


# -- materials ---------------------------------------------------------------------------------------------------------
# Materials of bodies: moduli by cells from their constants, thermal strains, thickness, mass per volume.


#: Names of the states of plane bodies, and the rows of strains in 3D that are theirs.
PLANES = {"strain": [0, 1, 3], "stress": [0, 1, 3], "axisymmetric": [0, 1, 2, 3]}
_AXISYMMETRIC = "axisymmetric"
#: Types of elements in decks that have incompatible modes.
WITH_MODES = ("C3D8I", "CPE4I", "CPS4I")
#: The laws of Lame coefficients in them.
_LAWS: dict[str, Literal["strain", "stress"]] = {"strain": "strain", "stress": "stress", "axisymmetric": "strain"}
#: Eigenvalues of compliances of unit diagonal below this are none.
_INDEFINITE = 1e-9


@dataclass(frozen=True)
class BodyMaterial:
    """Moduli of all cells, or of each.

    Attributes
    ----------
    elasticity : (s, s) or (M, s, s) array
        In the components that strains have (`enumsol.fem.bases.COMPONENTS`) [force / length^2].
    lame : (2,) or (M, 2) array or None
        Lame coefficients that give these moduli in the plane or in 3D, where there are such [force / length^2].
    thermal : (M, s) array or None
        Stresses that a warming by one degree causes where all is held [force / length^2 / temperature].
    """

    elasticity: Floats
    lame: Floats | None
    thermal: Floats | None = None


def is_axisymmetric(mesh: PartedMesh, options: Options) -> bool:
    """True if plane says so, for the whole body.

    Raises
    ------
    InvalidArgumentError
        It does so for a part only, or the mesh is not plane, reaches beyond the axis, or is given a thickness.
    """
    planes = [*options.plane.values()] if isinstance(options.plane, Mapping) else [options.plane]
    if _AXISYMMETRIC not in planes:
        return False
    if any(plane != _AXISYMMETRIC for plane in planes):
        raise InvalidArgumentError(
            f"plane is {shown(options.plane)}; expected axisymmetric for all parts of the body or for none"
        )
    if mesh.points.shape[1] == 3:
        raise InvalidArgumentError("plane is 'axisymmetric' of a body in 3D; expected it for plane meshes only")
    if np.min(mesh.points[:, 0]) < -SAME * float(np.max(np.abs(mesh.points))):
        raise InvalidArgumentError(
            f"plane is 'axisymmetric', and the mesh has a node at x = {np.min(mesh.points[:, 0]):g}; expected x >= 0, "
            "the distance from the axis"
        )
    if options.thickness != 1:
        raise InvalidArgumentError(
            "thickness is given for an axisymmetric body, whose forces are those of the whole circumference; expected "
            "none"
        )
    return True


def incompatible_of(mesh: PartedMesh, options: Options) -> Mask | None:
    """Cells that have incompatible modes, (M,); None for none.

    Raises
    ------
    InvalidArgumentError
        A part does not exist, or the body is axisymmetric.
    """
    given = options.incompatible
    if given is None:
        given = bool(mesh.types) and all(name in WITH_MODES for name in mesh.types)
    if not isinstance(given, bool) and not names_of(given, "incompatible"):
        return None
    if given is False:
        return None
    if is_axisymmetric(mesh, options):
        raise InvalidArgumentError("incompatible is given for an axisymmetric body; expected it in the plane or in 3D")
    found = np.zeros(len(mesh.cells), dtype=bool)
    for part in [] if isinstance(given, bool) else names_of(given, "incompatible"):
        found[mesh.body(part)] = True
    return np.ones_like(found) if given is True else found


def nodes_on_axis(points: Floats) -> Integers:
    """Nodes on the axis of an axisymmetric body."""
    return np.flatnonzero(points[:, 0] <= SAME * float(np.max(np.abs(points))))


def material_of(mesh: PartedMesh, options: Options) -> BodyMaterial:
    """Material of a body.

    Raises
    ------
    InvalidArgumentError
        A constant is not admissible, a name does not exist, or a cell has no value or several.
    """
    plane = options.plane
    solid = mesh.points.shape[1] == 3
    if solid and plane != "strain":
        raise InvalidArgumentError(f"plane is {plane!r} of a body in 3D; expected it for plane meshes only")
    nine, axes = _orthotropic(mesh, options.orthotropic), _orthotropic_axes(mesh, options)
    others = [own is None for own in nine]
    values = [
        _of_cells(mesh, options.young, "young", positive_number, others),
        _of_cells(mesh, options.poisson, "poisson", finite_number, others),
        _of_cells(mesh, plane, "plane", lambda value, name: one_of(value, name, tuple(PLANES))),
        _of_cells(mesh, 0.0 if options.expansion is None else options.expansion, "expansion", finite_number),
        nine,
        axes,
    ]
    for name, given in zip(("young", "poisson"), values, strict=False):
        if any(own is not None and not other for own, other in zip(given, others, strict=True)):
            raise InvalidArgumentError(f"{name} and orthotropic are given for the same cells; expected one of them")
    each = list(zip(*values, strict=True))
    known = {constants: _moduli(*constants, solid=solid) for constants in dict.fromkeys(each)}
    one = len(known) == 1
    elasticity, coefficients, thermal = (
        np.array([known[constants][k] for constants in (each[:1] if one else each)]) for k in range(3)
    )
    plain = all(others) and not is_axisymmetric(mesh, options)
    return BodyMaterial(
        elasticity[0] if one else elasticity,
        (coefficients[0] if one else coefficients) if plain else None,
        np.broadcast_to(thermal, (len(each), thermal.shape[1])) if options.expansion is not None else None,
    )


def _moduli(
    young: float, poisson: float, plane: str, expansion: float, nine: Any, axes: Any, *, solid: bool
) -> tuple[Floats, Floats, Floats]:
    """Moduli (s, s), Lame coefficients (2,), and stresses (s,) of a warming by one degree where all is held."""
    flat = np.zeros(2) if nine is not None else np.array(lame(young, poisson, _LAWS[plane]))
    three = isotropic(np.array(lame(young, poisson)), 6) if nine is None else orthotropic_moduli(nine, axes)
    warming = expansion * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    if solid:
        return three, flat, three @ warming
    kept = PLANES[plane]
    out = [4, 5] if plane == "axisymmetric" else [2, 4, 5]
    if np.max(np.abs(three[np.ix_(kept, [4, 5])])) > RIGHT_ANGLE * np.max(three):
        raise InvalidArgumentError(
            f"orientation is {shown(axes)}, with which strains in the plane cause shear out of it; expected a plane "
            "body in a plane of two of the axes of its material"
        )
    if plane != "stress":
        return three[np.ix_(kept, kept)], flat, (three @ warming)[kept]
    if nine is None:
        moduli = isotropic(flat, 3)
    else:
        across = three[np.ix_(kept, out)]
        moduli = three[np.ix_(kept, kept)] - across @ np.linalg.solve(three[np.ix_(out, out)], across.T)
    return moduli, flat, moduli @ warming[kept]


def orthotropic_moduli(constants: Sequence[float], axes: Sequence[float] | None = None) -> Floats:
    """Moduli (6, 6) of an orthotropic material in x, y and z, for strains xx, yy, zz, xy, xz, yz (shears are angles).

    Parameters
    ----------
    constants : (9,)
        E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 [force / length^2, -].
    axes : (6,) or None
        Direction of axis 1 and one in the plane of axes 1 and 2; None: x and y.

    Raises
    ------
    InvalidArgumentError
        The constants give no positive energy, or the directions are parallel.
    """
    E1, E2, E3, n12, n13, n23, *shear = constants
    compliance = np.zeros((6, 6))
    compliance[:3, :3] = [
        [1 / E1, -n12 / E1, -n13 / E1],
        [-n12 / E1, 1 / E2, -n23 / E2],
        [-n13 / E1, -n23 / E2, 1 / E3],
    ]
    compliance[[3, 4, 5], [3, 4, 5]] = [1 / G for G in shear]
    scale = np.sqrt(np.diag(compliance))
    if np.min(np.linalg.eigvalsh(compliance / np.outer(scale, scale))) <= _INDEFINITE:
        raise InvalidArgumentError(
            f"orthotropic is {shown(list(constants))}; expected constants with a positive energy for all strains"
        )
    own = np.asarray(np.linalg.inv(compliance), dtype=np.float64)
    if axes is None:
        return own
    first, second = np.split(np.asarray(axes, dtype=np.float64), 2)
    third = np.cross(first, second)
    if not np.linalg.norm(third) > RIGHT_ANGLE * np.linalg.norm(first) * np.linalg.norm(second):
        raise InvalidArgumentError(f"orientation is {shown(list(axes))}; expected two directions that are not parallel")
    rows = [row / np.linalg.norm(row) for row in (first, np.cross(third, first), third)]
    along, turned = np.array(rows), np.empty((6, 6))
    for column, (i, j) in enumerate(COMPONENTS[6]):
        # strains along the axes of the material of a strain along x, y and z
        strain = 0.5 * (np.outer(along[:, i], along[:, j]) + np.outer(along[:, j], along[:, i]))
        turned[:, column] = [strain[k, m] * (1.0 if k == m else 2.0) for k, m in COMPONENTS[6]]
    return np.asarray(turned.T @ own @ turned)


def _orthotropic(mesh: PartedMesh, value: object) -> list[Any]:
    """Nine constants of each cell; None of isotropic ones."""

    def read(given: Any, name: str) -> tuple[float, ...]:
        numbers = short_vector(given, name, 9)
        if np.min(numbers[[0, 1, 2, 6, 7, 8]]) <= 0:
            raise InvalidArgumentError(
                f"{name} is {shown(given)}; expected E1, E2, E3, nu12, nu13, nu23, G12, G13, G23, moduli > 0"
            )
        return tuple(numbers.tolist())

    return _of_cells(mesh, value, "orthotropic", read, [False] * len(mesh.cells))


def _orthotropic_axes(mesh: PartedMesh, options: Options) -> list[Any]:
    """Two directions of each cell; None for x and y."""
    if options.orientation is not None and options.orthotropic is None:
        raise InvalidArgumentError("orientation is given without orthotropic; expected both")

    def read(given: Any, name: str) -> tuple[float, ...]:
        return tuple(short_vector(given, name, 6).tolist())

    return _of_cells(mesh, options.orientation, "orientation", read, [False] * len(mesh.cells))


def temperature_of(mesh: PartedMesh, value: object, name: str) -> tuple[Floats, Floats]:
    """Change of temperature, by one number, by a number for every node, or by names of parts.

    Returns
    -------
    nodes : (N,) array
        Its part that is given by nodes, with the shape functions of the cells between them.
    cells : (M,) array
        Its part that is uniform in each cell; the change is the sum of both.

    Raises
    ------
    InvalidArgumentError
        It is none of these, or names parts of the body and others.
    """
    nodes, cells = np.zeros(len(mesh.points)), np.zeros(len(mesh.cells))
    if not isinstance(value, Mapping):
        array = real_array(value, name, error=InvalidArgumentError)
        if array.shape not in ((), nodes.shape):
            raise InvalidArgumentError(
                f"{name} has shape {array.shape}; expected a number, {nodes.shape} for all nodes, or names of parts "
                "with their values"
            )
        nodes[:] = array
        return nodes, cells
    given = by_part(value, name)
    bodies = [part for part in given if part in mesh.bodies]
    if bodies and len(bodies) < len(given):
        other = next(part for part in given if part not in bodies)
        raise InvalidArgumentError(
            f"{name} is given for {bodies[0]}, a part of the body, and for {other}, a part of its nodes or boundary; "
            "expected parts of one kind"
        )
    for part, own in given.items():
        target, rows = (cells, mesh.body(part)) if bodies else (nodes, mesh.nodes(part))
        target[rows] = finite_number(own, f"{name} of {part}")
    return nodes, cells


def thermal_forces(
    body: NodalBasis, mesh: PartedMesh, options: Options, material: BodyMaterial, others: Floats, slope: str = ""
) -> tuple[Floats, Floats | None]:
    """Nodal forces (N, d) of thermal strains and ``others``, and the stresses (M, s) of the body with no displacement.

    The stresses are means of cells, None without thermal strains; with ``slope`` "_slope" both are derivatives.

    Raises
    ------
    InvalidArgumentError
        temperature is given without expansion, or is not of its form.
    """
    name = f"temperature{slope}"
    given = getattr(options, name)
    if given is None:
        return others, None
    if material.thermal is None:
        raise InvalidArgumentError(f"{name} is given without expansion; expected both")
    forces, stresses = body.stressed(-material.thermal, *temperature_of(mesh, given, name))
    return others + forces, stresses


def thickness_of(mesh: PartedMesh, value: object) -> Floats | None:
    """Thickness of every cell of a plane body, (M,); None for one [length].

    Raises
    ------
    InvalidArgumentError
        As `material_of`, or the body is not plane.
    """
    given = np.array(_of_cells(mesh, value, "thickness", positive_number), dtype=np.float64)
    if np.all(given == 1):
        return None
    if mesh.points.shape[1] == 3:
        raise InvalidArgumentError("thickness is given for a body in 3D; expected it for plane meshes only")
    return given


def masses_of(mesh: PartedMesh, density: object, thickness: Floats | None) -> Floats | None:
    """Mass per volume, in 2D per area, of every cell, (M,); None where it is uniform and not given.

    Raises
    ------
    InvalidArgumentError
        As `material_of`.
    """
    if density is None:
        return None if thickness is None or np.ptp(thickness) == 0 else thickness
    given = np.array(_of_cells(mesh, density, "density", positive_number), dtype=np.float64)
    return np.asarray(given * (1.0 if thickness is None else thickness))


def _of_cells(
    mesh: PartedMesh, value: object, name: str, read: Callable[[Any, str], Any], needed: Sequence[bool] | None = None
) -> list[Any]:
    """A value of each cell, the same for all unless it is given by names of parts of the body.

    ``needed`` says which cells need one, by default all; others may have None.
    """
    wanted = [True] * len(mesh.cells) if needed is None else needed
    if value is None and not any(wanted):
        return [None] * len(wanted)
    if not isinstance(value, Mapping):
        return [read(value, name)] * len(wanted)
    found: list[Any] = [None] * len(wanted)
    of_part: dict[int, str] = {}
    for part, given in by_part(value, name).items():
        own = read(given, f"{name} of {part}")
        for row in mesh.body(part).tolist():
            if found[row] is not None and found[row] != own:
                raise InvalidArgumentError(
                    f"{name} is given for {of_part[row]} and for {part}, which share cells; expected one value"
                )
            found[row], of_part[row] = own, part
    each = [k for k, own in enumerate(found) if own is not None or not wanted[k]]
    if len(each) < len(found):
        first = next(k for k, own in enumerate(found) if own is None and wanted[k])
        others = [part for part, rows in mesh.bodies.items() if first in rows]
        raise InvalidArgumentError(
            f"{name} is not given for {len(found) - len(each)} of {len(found)} cells"
            f"{f', those of {others[0]}' if others else ', which belong to no named part'}; expected it for all"
        )
    return found
