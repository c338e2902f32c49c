"""Materials of bodies: moduli by cells from their constants, thermal strains, thickness, mass per volume."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.bases import COMPONENTS, isotropic
from enumsol.fem.conditions import by_part, names_of
from enumsol.fem.meshes import SAME, lame
from enumsol.support.arguments import finite_number, one_of, positive_number, shown
from enumsol.support.array_arguments import real_array, short_vector

if TYPE_CHECKING:
    from enumsol.fem.bases import NodalBasis
    from enumsol.fem.conditions import Options
    from enumsol.fem.meshes import PartedMesh
    from enumsol.support.array_types import Floats, Integers, Mask

T = TypeVar("T")

#: Names of the states of plane bodies, and the rows of strains in 3D that are theirs.
PLANES = {"strain": [0, 1, 3], "stress": [0, 1, 3], "axisymmetric": [0, 1, 2, 3]}
_AXISYMMETRIC = "axisymmetric"
#: Types of elements in decks that have incompatible modes.
WITH_MODES = ("C3D8I", "CPE4I", "CPS4I")
#: The laws of Lame coefficients in them.
_LAWS: dict[str, Literal["strain", "stress"]] = {"strain": "strain", "stress": "stress", "axisymmetric": "strain"}
#: Moduli that couple the plane with shear out of it below this part of the largest are rounding, as are right angles.
_COUPLED = 1e-9
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
    others = [own is None for own in nine] if isinstance(nine, list) else nine is None
    values: list[Any] = [
        _of_cells(mesh, options.young, "young", positive_number, others),
        _of_cells(mesh, options.poisson, "poisson", finite_number, others),
        _of_cells(mesh, plane, "plane", lambda value, name: one_of(value, name, tuple(PLANES))),
        0.0 if options.expansion is None else _of_cells(mesh, options.expansion, "expansion", finite_number),
        nine,
        axes,
    ]
    _refuse_both(len(mesh.cells), values[0], values[1], nine)
    one = not any(isinstance(value, list) for value in values)
    count = 1 if one else len(mesh.cells)
    each = list(zip(*(value if isinstance(value, list) else [value] * count for value in values), strict=True))
    known = {constants: _moduli(*constants, solid=solid) for constants in dict.fromkeys(each)}
    elasticity, coefficients, thermal = (np.array([known[constants][k] for constants in each]) for k in range(3))
    plain = others is True and not is_axisymmetric(mesh, options)
    return BodyMaterial(
        elasticity[0] if one else elasticity,
        (coefficients[0] if one else coefficients) if plain else None,
        np.broadcast_to(thermal, (len(mesh.cells), thermal.shape[1])) if options.expansion is not None else None,
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
    if np.max(np.abs(three[np.ix_(kept, [4, 5])])) > _COUPLED * np.max(three):
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


def _refuse_both(count: int, young: Any, poisson: Any, nine: Any) -> None:
    """Refuse constants of isotropic materials for orthotropic cells."""
    if nine is None:
        return
    both = [
        name
        for name, value in (("young", young), ("poisson", poisson))
        for own, other in zip(
            value if isinstance(value, list) else [value] * count,
            nine if isinstance(nine, list) else [nine] * count,
            strict=True,
        )
        if own is not None and other is not None
    ]
    if both:
        raise InvalidArgumentError(f"{both[0]} and orthotropic are given for the same cells; expected one of them")


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
    if not np.linalg.norm(third) > _COUPLED * np.linalg.norm(first) * np.linalg.norm(second):
        raise InvalidArgumentError(f"orientation is {shown(list(axes))}; expected two directions that are not parallel")
    rows = [row / np.linalg.norm(row) for row in (first, np.cross(third, first), third)]
    along, turned = np.array(rows), np.empty((6, 6))
    for column, (i, j) in enumerate(COMPONENTS[6]):
        # strains along the axes of the material of a strain along x, y and z
        strain = 0.5 * (np.outer(along[:, i], along[:, j]) + np.outer(along[:, j], along[:, i]))
        turned[:, column] = [strain[k, m] * (1.0 if k == m else 2.0) for k, m in COMPONENTS[6]]
    return np.asarray(turned.T @ own @ turned)


def _orthotropic(mesh: PartedMesh, value: object) -> Any:
    """Nine constants of all cells, or a list with those of each; None for isotropic ones."""
    if value is None:
        return None

    def read(given: Any, name: str) -> tuple[float, ...]:
        numbers = short_vector(given, name, 9)
        if np.min(numbers[[0, 1, 2, 6, 7, 8]]) <= 0:
            raise InvalidArgumentError(
                f"{name} is {shown(given)}; expected E1, E2, E3, nu12, nu13, nu23, G12, G13, G23, moduli > 0"
            )
        return tuple(numbers.tolist())

    return _of_cells(mesh, value, "orthotropic", read, needed=False)


def _orthotropic_axes(mesh: PartedMesh, options: Options) -> Any:
    """Two directions of all cells, or a list with those of each; None for x and y."""
    if options.orientation is None:
        return None
    if options.orthotropic is None:
        raise InvalidArgumentError("orientation is given without orthotropic; expected both")

    def read(given: Any, name: str) -> tuple[float, ...]:
        return tuple(short_vector(given, name, 6).tolist())

    return _of_cells(mesh, options.orientation, "orientation", read, needed=False)


@dataclass(frozen=True)
class Temperature:
    """Change of temperature, the sum of what is given for nodes and for cells.

    Attributes
    ----------
    nodes : (N,) array
    cells : (M,) array
    """

    nodes: Floats
    cells: Floats

    @classmethod
    def of(cls, mesh: PartedMesh, value: object, name: str) -> Temperature:
        """Change of temperature by one number, by a number for every node, or by names of parts.

        Raises
        ------
        InvalidArgumentError
            It is not that, a name does not exist, or parts of the body and of its nodes are both named.
        """
        made = cls(np.zeros(len(mesh.points)), np.zeros(len(mesh.cells)))
        if not isinstance(value, Mapping):
            array = real_array(value, name, error=InvalidArgumentError)
            if array.shape not in ((), made.nodes.shape):
                raise InvalidArgumentError(
                    f"{name} has shape {array.shape}; expected a number, {made.nodes.shape} for all nodes, or "
                    "names of parts with their values"
                )
            made.nodes[:] = array
            return made
        given = by_part(value, name)
        bodies = [part for part in given if part in mesh.bodies]
        if bodies and len(bodies) < len(given):
            other = next(part for part in given if part not in bodies)
            raise InvalidArgumentError(
                f"{name} is given for {bodies[0]}, a part of the body, and for {other}, a part of its nodes or "
                "boundary; expected parts of one kind"
            )
        for part, own in given.items():
            number = finite_number(own, f"{name} of {part}")
            if bodies:
                made.cells[mesh.body(part)] = number
            else:
                made.nodes[mesh.nodes(part)] = number
        return made


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
    change = Temperature.of(mesh, given, name)
    forces, stresses = body.stressed(-material.thermal, change.nodes, change.cells)
    return others + forces, stresses


def thickness_of(mesh: PartedMesh, value: object) -> Floats | None:
    """Thickness of every cell of a plane body, (M,); None for one [length].

    Raises
    ------
    InvalidArgumentError
        As `material_of`, or the body is not plane.
    """
    given = _of_cells(mesh, value, "thickness", positive_number)
    if given == 1:
        return None
    if mesh.points.shape[1] == 3:
        raise InvalidArgumentError("thickness is given for a body in 3D; expected it for plane meshes only")
    return np.broadcast_to(np.array(given, dtype=np.float64), len(mesh.cells))


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
    return np.asarray(np.broadcast_to(given, len(mesh.cells)) * (1.0 if thickness is None else thickness))


def _of_cells(
    mesh: PartedMesh, value: object, name: str, read: Callable[[Any, str], T], needed: bool | list[bool] = True
) -> Any:
    """A value of all cells, or a list of one for each if it is given by names of parts of the body.

    ``needed`` says which cells need one; others may have None.
    """
    if value is None and not np.any(needed):
        return None
    if not isinstance(value, Mapping):
        return read(value, name)
    found: list[T | None] = [None] * len(mesh.cells)
    of_part: dict[int, str] = {}
    for part, given in by_part(value, name).items():
        own = read(given, f"{name} of {part}")
        for row in mesh.body(part).tolist():
            if found[row] is not None and found[row] != own:
                raise InvalidArgumentError(
                    f"{name} is given for {of_part[row]} and for {part}, which share cells; expected one value"
                )
            found[row], of_part[row] = own, part
    wanted = needed if isinstance(needed, list) else [needed] * len(found)
    each = [k for k, own in enumerate(found) if own is not None or not wanted[k]]
    if len(each) < len(found):
        first = next(k for k, own in enumerate(found) if own is None and wanted[k])
        others = [part for part, rows in mesh.bodies.items() if first in rows]
        raise InvalidArgumentError(
            f"{name} is not given for {len(found) - len(each)} of {len(found)} cells"
            f"{f', those of {others[0]}' if others else ', which belong to no named part'}; expected it for all"
        )
    return found
