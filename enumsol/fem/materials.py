"""Materials of bodies: moduli by cells from their constants, thermal strains, thickness, mass per volume."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.bases import isotropic
from enumsol.fem.conditions import by_part
from enumsol.fem.meshes import SAME, lame
from enumsol.support.arguments import finite_number, one_of, positive_number, shown
from enumsol.support.array_arguments import real_array

if TYPE_CHECKING:
    from enumsol.fem.bases import NodalBasis
    from enumsol.fem.conditions import Options
    from enumsol.fem.meshes import PartedMesh
    from enumsol.support.array_types import Floats, Integers

T = TypeVar("T")

#: Names of the states of plane bodies, and the rows of strains in 3D that are theirs.
PLANES = {"strain": [0, 1, 3], "stress": [0, 1, 3], "axisymmetric": [0, 1, 2, 3]}
_AXISYMMETRIC = "axisymmetric"


@dataclass(frozen=True)
class Material:
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


def nodes_on_axis(points: Floats) -> Integers:
    """Nodes on the axis of an axisymmetric body."""
    return np.flatnonzero(points[:, 0] <= SAME * float(np.max(np.abs(points))))


def material_of(mesh: PartedMesh, options: Options) -> Material:
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
    values: list[Any] = [
        _of_cells(mesh, options.young, "young", positive_number),
        _of_cells(mesh, options.poisson, "poisson", finite_number),
        _of_cells(mesh, plane, "plane", lambda value, name: one_of(value, name, tuple(PLANES))),
        0.0 if options.expansion is None else _of_cells(mesh, options.expansion, "expansion", finite_number),
    ]
    one = not any(isinstance(value, list) for value in values)
    count = 1 if one else len(mesh.cells)
    each = list(zip(*(value if isinstance(value, list) else [value] * count for value in values), strict=True))
    known = {constants: _moduli(*constants, solid=solid) for constants in dict.fromkeys(each)}
    elasticity, coefficients, thermal = (np.array([known[constants][k] for constants in each]) for k in range(3))
    return Material(
        elasticity[0] if one else elasticity,
        None if is_axisymmetric(mesh, options) else coefficients[0] if one else coefficients,
        np.broadcast_to(thermal, (len(mesh.cells), thermal.shape[1])) if options.expansion is not None else None,
    )


def _moduli(
    young: float, poisson: float, plane: str, expansion: float, *, solid: bool
) -> tuple[Floats, Floats, Floats]:
    """Moduli (s, s), Lame coefficients (2,), and stresses (s,) of a warming by one degree where all is held."""
    three = isotropic(np.array(lame(young, poisson)), 6)
    warming = expansion * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    if solid:
        return three, np.array(lame(young, poisson)), three @ warming
    kept = PLANES[plane]
    if plane == "stress":
        flat = np.array(lame(young, poisson, "stress"))
        moduli = isotropic(flat, 3)
        return moduli, flat, moduli @ warming[kept]
    moduli = three[np.ix_(kept, kept)]
    return moduli, np.array(lame(young, poisson)), (three @ warming)[kept]


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
    def of(cls, mesh: PartedMesh, value: object) -> Temperature:
        """Change of temperature by one number, by a number for every node, or by names of parts.

        Raises
        ------
        InvalidArgumentError
            It is not that, a name does not exist, or parts of the body and of its nodes are both named.
        """
        made = cls(np.zeros(len(mesh.points)), np.zeros(len(mesh.cells)))
        if not isinstance(value, Mapping):
            array = real_array(value, "temperature", error=InvalidArgumentError)
            if array.shape not in ((), made.nodes.shape):
                raise InvalidArgumentError(
                    f"temperature has shape {array.shape}; expected a number, {made.nodes.shape} for all nodes, or "
                    "names of parts with their values"
                )
            made.nodes[:] = array
            return made
        given = by_part(value, "temperature")
        bodies = [part for part in given if part in mesh.bodies]
        if bodies and len(bodies) < len(given):
            other = next(part for part in given if part not in bodies)
            raise InvalidArgumentError(
                f"temperature is given for {bodies[0]}, a part of the body, and for {other}, a part of its nodes or "
                "boundary; expected parts of one kind"
            )
        for part, own in given.items():
            number = finite_number(own, f"temperature of {part}")
            if bodies:
                made.cells[mesh.body(part)] = number
            else:
                made.nodes[mesh.nodes(part)] = number
        return made


def thermal_forces(body: NodalBasis, mesh: PartedMesh, options: Options, material: Material) -> tuple[Floats, Floats]:
    """Nodal forces (N, d) of thermal strains, and the mean stresses (M, s) that the body has with no displacement.

    Raises
    ------
    InvalidArgumentError
        temperature is given without expansion, or is not of its form.
    """
    if material.thermal is None:
        raise InvalidArgumentError("temperature is given without expansion; expected both")
    change = Temperature.of(mesh, options.temperature)
    return body.stressed(-material.thermal, change.nodes, change.cells)


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


def _of_cells(mesh: PartedMesh, value: object, name: str, read: Callable[[Any, str], T]) -> T | list[T]:
    """A value of all cells, or a list of one for each if it is given by names of parts of the body."""
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
    each = [own for own in found if own is not None]
    if len(each) < len(found):
        first = found.index(None)
        others = [part for part, rows in mesh.bodies.items() if first in rows]
        raise InvalidArgumentError(
            f"{name} is not given for {len(found) - len(each)} of {len(found)} cells"
            f"{f', those of {others[0]}' if others else ', which belong to no named part'}; expected it for all"
        )
    return each
