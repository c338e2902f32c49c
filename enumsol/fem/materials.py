"""What a body is made of: one material, or one for each of its named parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.conditions import by_part
from enumsol.fem.mesh_checks import lame
from enumsol.support.arguments import finite_number, one_of, positive_number
from enumsol.support.array_arguments import short_vector

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.fem.named_parts import PartedMesh
    from enumsol.support.array_types import Floats

T = TypeVar("T")


def lame_of(mesh: PartedMesh, young: Any, poisson: Any, plane: Any) -> Floats:
    """Lame coefficients of all cells, (2,), or of each where they differ, (M, 2).

    Raises
    ------
    InvalidArgumentError
        A constant is not admissible, a name does not exist, or a cell has no value or several.
    """
    if mesh.points.shape[1] == 3 and plane != "strain":
        raise InvalidArgumentError(f"plane is {plane!r} of a body in 3D; expected it for plane meshes only")
    values: list[Any] = [
        _of_cells(mesh, young, "young", positive_number),
        _of_cells(mesh, poisson, "poisson", finite_number),
        _of_cells(mesh, plane, "plane", lambda value, name: one_of(value, name, ("strain", "stress"))),
    ]
    if not any(isinstance(value, list) for value in values):
        return np.asarray(lame(*values))
    count = len(mesh.cells)
    each = list(zip(*(value if isinstance(value, list) else [value] * count for value in values), strict=True))
    known = {constants: lame(*constants) for constants in dict.fromkeys(each)}
    return np.array([known[constants] for constants in each])


def thickness_of(mesh: PartedMesh, value: Any) -> Floats | None:
    """Thickness of every cell of a plane body, (M,); None for one [length].

    Raises
    ------
    InvalidArgumentError
        As `lame_of`, or the body is not plane.
    """
    given = _of_cells(mesh, value, "thickness", positive_number)
    if given == 1:
        return None
    if mesh.points.shape[1] == 3:
        raise InvalidArgumentError("thickness is given for a body in 3D; expected it for plane meshes only")
    return np.broadcast_to(np.array(given, dtype=np.float64), len(mesh.cells))


def body_force_of(mesh: PartedMesh, value: Any) -> Floats:
    """Force per volume of every cell, (M, d); parts of the body without one have none [force / length^3].

    Raises
    ------
    InvalidArgumentError
        It is not that, or a name does not exist.
    """
    dimension = mesh.points.shape[1]
    if not isinstance(value, Mapping):
        return np.tile(short_vector(value, "body_force", dimension), (len(mesh.cells), 1))
    density = np.zeros((len(mesh.cells), dimension))
    for part, force in by_part(value, "body_force").items():
        density[mesh.body(part)] += short_vector(force, f"body_force of {part}", dimension)
    return density


def _of_cells(mesh: PartedMesh, value: Any, name: str, read: Callable[[Any, str], T]) -> T | list[T]:
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


def of_rows(value: Any, name: str, parts: Sequence[str], read: Callable[[Any, str], Any], other: Any = None) -> Floats:
    """A value of all contact nodes, or (p, ...) by the names of the parts of the boundary that they belong to.

    ``other`` is that of parts that are not named; None: all have to be.

    Raises
    ------
    InvalidArgumentError
        It is not that, or a name is none of the parts.
    """
    if not isinstance(value, Mapping):
        return np.array(read(value, name))
    given = {part: read(own, f"{name} of {part}") for part, own in by_part(value, name).items()}
    present = list(dict.fromkeys(parts))
    for part in given:
        if part not in present:
            raise InvalidArgumentError(
                f"{name} is given for {part}, which has no contact nodes; expected some of {', '.join(present)}"
            )
    missing = [part for part in present if part not in given]
    if missing and other is None:
        raise InvalidArgumentError(f"{name} is not given for {', '.join(missing)}; expected it for all contact parts")
    return np.array([given.get(part, other) for part in parts])
