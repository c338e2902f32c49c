"""The named arrays of problems in three dimensions; names and layout are described in `enumsol.io`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.array_checks import real_array, real_matrix
from enumsol.errors import InvalidProblemError
from enumsol.friction import ConstantFriction, FrictionTable
from enumsol.io.layouts import LAYOUT_3D, MEAN, MESH, SURFACE, TABLE, constant_friction
from enumsol.problem3d import BodyMesh, ContactProblem3D, SlipMean

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


def problem_from_arrays_3d(arrays: Mapping[str, Any]) -> ContactProblem3D:
    """The problem made of arrays whose names have been checked."""
    for parts in (MESH, MEAN, TABLE):
        missing = [name for name in parts if name not in arrays]
        if 0 < len(missing) < len(parts):
            raise InvalidProblemError(f"{', '.join(missing)} is missing; expected {', '.join(parts)}, all or none")
    names = ("gap", "load_slope", "slip_offset", "coordinates", "areas", "node_ids")
    options: dict[str, Any] = {name: arrays[name] for name in names if name in arrays}
    friction = _friction(arrays)
    if friction is not None:
        options["friction"] = friction
    options["friction_slope"] = tuple(arrays.get(f"friction_slope_{axis}", 0.0) for axis in (1, 2))
    if "mesh_points" in arrays:
        options["mesh"] = _mesh(arrays)
    elif extra := [name for name in SURFACE if name in arrays]:
        raise InvalidProblemError(f"{extra[0]} has no mesh; expected {', '.join(MESH)} as well")
    if "slip_mean_T1" in arrays:
        T1, T2, weights = (sp.csr_array(real_matrix(arrays[name], name)) for name in (MEAN[0], MEAN[1], MEAN[3]))
        options["slip_mean"] = SlipMean(T1, T2, real_array(arrays[MEAN[2]], MEAN[2]), weights)
    return ContactProblem3D(*(arrays[name] for name in LAYOUT_3D.required), **options)


def _friction(arrays: Mapping[str, Any]) -> Any:
    if "friction" in arrays:
        return constant_friction(arrays["friction"], LAYOUT_3D)
    given = [name for name in ("friction_1", "friction_2") if name in arrays]
    if len(given) == 1:
        raise InvalidProblemError(f"{given[0]} stands alone; expected friction_1 and friction_2, or friction")
    if given:
        return arrays["friction_1"], arrays["friction_2"]
    if "friction_table_slip" in arrays:
        slip, *columns = (np.asarray(arrays[name]) for name in TABLE)
        # one column of a MatrixMarket file is the table of all nodes
        return FrictionTable(slip, *(F.ravel() if F.ndim == 2 and F.shape[1] == 1 else F for F in columns))
    return None


def _mesh(arrays: Mapping[str, Any]) -> BodyMesh:
    nodes = real_array(arrays["mesh_points"], "mesh_points")
    if nodes.ndim != 2 or nodes.shape[1] != 3:
        raise InvalidProblemError(f"mesh_points has shape {nodes.shape}; expected (N, 3)")
    bodies = _numbers(arrays["mesh_cells"], "mesh_cells", len(nodes))
    if bodies.ndim != 2 or bodies.shape[1] not in (4, 8):
        raise InvalidProblemError(f"mesh_cells has shape {bodies.shape}; expected (M, 4) or (M, 8)")
    free = _numbers(arrays["mesh_dofs"], "mesh_dofs", nodes.size)
    if free.ndim != 1 or len(np.unique(free)) != len(free):
        raise InvalidProblemError(f"mesh_dofs has shape {free.shape} or repeats a number; expected (n,) distinct ones")
    facets = rows = None
    if "mesh_facets" in arrays:
        facets = _numbers(arrays["mesh_facets"], "mesh_facets", len(nodes))
        if facets.ndim != 2 or facets.shape[1] not in (3, 4):
            raise InvalidProblemError(f"mesh_facets has shape {facets.shape}; expected (k, 3) or (k, 4)")
    if "mesh_rows" in arrays:
        rows = _numbers(arrays["mesh_rows"], "mesh_rows", np.shape(arrays["Bn"])[0], least=-1)
        if facets is None or rows.shape != facets.shape[:1]:
            raise InvalidProblemError(f"mesh_rows has shape {rows.shape}; expected (k,), one for each of mesh_facets")
    return BodyMesh(nodes, bodies, free, facets, rows)


def _numbers(value: Any, name: str, count: int, least: int = 0) -> NDArray[np.int64]:
    array = real_array(value, name)
    if np.any(array != np.round(array)) or np.any(array < least) or np.any(array >= count):
        raise InvalidProblemError(
            f"{name} holds other numbers than {least} .. {count - 1}; expected whole ones in that range"
        )
    return array.astype(np.int64)


def arrays_of_3d(problem: ContactProblem3D) -> dict[str, Any]:
    """All matrices and arrays of numbers of a problem, by the names they have in files."""
    arrays: dict[str, Any] = {name: getattr(problem, name) for name in LAYOUT_3D.contact}
    arrays |= {"f": problem.f, "gap": problem.gap, "slip_offset": problem.slip_offset}
    law = problem.law
    if isinstance(law, ConstantFriction):
        arrays |= {"friction_1": law.values[:, 0], "friction_2": law.values[:, 1]}
    elif isinstance(law, FrictionTable):
        arrays |= dict(zip(TABLE, (law.slip, law.F1, law.F2), strict=True))
    else:
        raise InvalidProblemError(f"friction is {law}, which no file can hold; expected constants or a FrictionTable")
    arrays |= {f"friction_slope_{axis}": slope for axis, slope in zip((1, 2), problem.friction_slope, strict=True)}
    arrays |= {
        name: getattr(problem, name)
        for name in ("load_slope", "coordinates", "areas")
        if getattr(problem, name) is not None
    }
    if (mesh := problem.mesh) is not None:
        arrays |= dict(zip(MESH, (mesh.points, mesh.cells, mesh.dofs), strict=True))
        arrays |= {name: part for name, part in zip(SURFACE, (mesh.facets, mesh.rows), strict=True) if part is not None}
    if (mean := problem.slip_mean) is not None:
        arrays |= dict(zip(MEAN, (mean.T1, mean.T2, mean.offset, mean.weights), strict=True))
    return arrays
