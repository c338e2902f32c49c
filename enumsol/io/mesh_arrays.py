"""The named arrays of the mesh of a problem in two or three dimensions (`enumsol.io`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.errors import InvalidProblemError
from enumsol.io.layouts import MESH, SURFACE
from enumsol.model.mesh import BodyMesh

if TYPE_CHECKING:
    from collections.abc import Mapping


def mesh_from_arrays(arrays: Mapping[str, Any]) -> BodyMesh | None:
    """The mesh made of arrays whose names have been checked, where there is one."""
    moves = "mesh_dofs" if "mesh_dofs" in arrays else "mesh_motion"
    required = (*MESH, moves)
    missing = [name for name in required if name not in arrays]
    extra = [name for name in SURFACE if name in arrays]
    if len(missing) == len(required) and not extra:
        return None
    if missing:
        raise InvalidProblemError(
            f"{', '.join(missing)} is missing (found {', '.join(sorted({*required, *extra} - {*missing}))}); "
            f"expected {', '.join(required)}, all or none"
        )
    if moves == "mesh_dofs" and "mesh_motion" in arrays:
        raise InvalidProblemError("mesh_dofs is given together with mesh_motion; expected one of them")
    make = BodyMesh if moves == "mesh_motion" else BodyMesh.of_dofs
    return make(*(arrays[name] for name in required), *(arrays.get(name) for name in SURFACE))


def arrays_of_mesh(mesh: BodyMesh | None) -> dict[str, Any]:
    """The arrays of a mesh, where there is one, by the names they have in files."""
    if mesh is None:
        return {}
    arrays = {"mesh_points": mesh.points, "mesh_cells": mesh.cells, "mesh_motion": mesh.motion}
    surface = zip(SURFACE, (mesh.offset, mesh.facets, mesh.rows, mesh.lame), strict=True)
    return arrays | {name: part for name, part in surface if part is not None}
