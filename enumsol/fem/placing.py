"""Several meshes in one scene, each placed where it belongs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.mesh_files import read_mesh
from enumsol.fem.meshes import PartedMesh, SolidMesh
from enumsol.model.cells import padded
from enumsol.support.arguments import file_path, shown
from enumsol.support.array_arguments import real_array, short_vector

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats, Integers

#: What may be said of a mesh that is placed.
_PLACING = {"mesh", "move", "turn"}


def mesh_of(source: object, groups: str | None = None) -> PartedMesh:
    """Mesh of what `mesh_problem` takes: a mesh, a file, or several by names, which begin the names of their parts.

    Raises
    ------
    InvalidArgumentError
        As `read_mesh`; or a mesh is not placed by ``move`` and ``turn``, or is plane beside one in 3D.
    """
    if isinstance(source, PartedMesh):
        return source
    if not isinstance(source, Mapping):
        return read_mesh(source, groups)
    if not len(source) or not all(isinstance(name, str) and name for name in source):
        raise InvalidArgumentError(f"mesh is {shown(source)}; expected names with their meshes")
    return _together({name: _placed(value, name, groups) for name, value in source.items()})


def in_folder(source: object, folder: Path) -> Any:
    """Description of a mesh by a file in this folder, with paths from the folder.

    Raises
    ------
    InvalidArgumentError
        It names no file.
    """
    if isinstance(source, Mapping):
        return {
            name: {**value, "mesh": in_folder(value.get("mesh"), folder)}
            if isinstance(value, Mapping)
            else in_folder(value, folder)
            for name, value in source.items()
        }
    return folder / file_path(source, "mesh", "the name of a mesh file in quotes")


def _placed(value: Any, name: str, groups: str | None) -> PartedMesh:
    """A mesh that is turned about the origin, then moved."""
    given = dict(value) if isinstance(value, Mapping) else {"mesh": value}
    if "mesh" not in given or given.keys() - _PLACING:
        raise InvalidArgumentError(f"mesh {name} is {shown(value)}; expected a mesh, and where wanted move and turn")
    mesh = mesh_of(given["mesh"], groups)
    d = mesh.points.shape[1]
    move = short_vector(given["move"], f"move of {name}", d) if "move" in given else np.zeros(d)
    points = mesh.points @ _rotation(given["turn"], name, d).T if "turn" in given else mesh.points
    return type(mesh)(points + move, mesh.cells, mesh.facets, mesh.node_sets, mesh.bodies, None, mesh.types)


def _rotation(value: object, name: str, dimension: int) -> Floats:
    """The rotation by an angle in degrees, in 3D about an axis through the origin: [x, y, z, degrees]."""
    numbers = np.atleast_1d(real_array(value, f"turn of {name}", error=InvalidArgumentError))
    if numbers.shape != (1 if dimension == 2 else 4,) or (dimension == 3 and not np.any(numbers[:3])):
        raise InvalidArgumentError(
            f"turn of {name} is {shown(value)}; expected an angle in degrees, in 3D after the x, y, z of an axis"
        )
    quarters = numbers[-1] / 90.0
    whole = quarters == np.round(quarters)  # exact where it can be
    c, s = (np.round(f(np.pi / 2 * quarters)) if whole else f(np.radians(numbers[-1])) for f in (np.cos, np.sin))
    if dimension == 2:
        return np.array([[c, -s], [s, c]])
    x, y, z = axis = numbers[:3] / np.linalg.norm(numbers[:3])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(c * np.eye(3) + s * cross + (1 - c) * np.outer(axis, axis))


def _together(meshes: Mapping[str, PartedMesh]) -> PartedMesh:
    """Several meshes as one: names of parts begin with those of the meshes, which are parts of the body as well."""
    dimensions = {mesh.points.shape[1] for mesh in meshes.values()}
    if len(dimensions) > 1:
        raise InvalidArgumentError("mesh has plane meshes and meshes in 3D; expected one or the other")
    nodes = np.cumsum([0, *(len(mesh.points) for mesh in meshes.values())])
    cells = np.cumsum([0, *(len(mesh.cells) for mesh in meshes.values())])

    def named(which: str, starts: Integers) -> dict[str, Integers]:
        return {
            f"{name}.{part}": rows + first
            for (name, mesh), first in zip(meshes.items(), starts[:-1], strict=True)
            for part, rows in getattr(mesh, which).items()
        }

    whole = {name: np.arange(*cells[k : k + 2]) for k, name in enumerate(meshes)}
    return (PartedMesh if dimensions == {2} else SolidMesh)(
        np.concatenate([mesh.points for mesh in meshes.values()]),
        padded([mesh.cells + first for mesh, first in zip(meshes.values(), nodes[:-1], strict=True)]),
        named("facets", nodes),
        named("node_sets", nodes),
        {**whole, **named("bodies", cells)},
        types=tuple(dict.fromkeys(kind for mesh in meshes.values() for kind in mesh.types)),
    )
