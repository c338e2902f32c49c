"""The named arrays of a problem in two or three dimensions, and the problem that they make (see `enumsol.io`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidProblemError
from enumsol.io.layouts import LAYOUT_2D, LAYOUT_3D, MEAN, MESH, RIGID, SURFACE, TABLE, Layout
from enumsol.model.mesh import BodyMesh
from enumsol.model.problem import ContactProblem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from enumsol.model.problem3d import ContactProblem3D

#: Arguments of both problems that are arrays of the same names.
_SAME = ("gap", "load_slope", "slip_offset", "node_ids", "coordinates", "areas")
_FRICTION_SLOPE = ("friction_slope_1", "friction_slope_2")


def problem_from_arrays(arrays: Mapping[str, Any], layout: Layout) -> ContactProblem | ContactProblem3D:
    """The problem made of arrays whose names have been checked."""
    options: dict[str, Any] = {name: arrays[name] for name in _SAME if name in arrays}
    options |= _rigid(arrays)
    if layout is LAYOUT_2D:
        options |= _plane_friction(arrays)
        options["mesh"] = _mesh(arrays)
        return ContactProblem(*(arrays[name] for name in layout.required), **options)
    # not for problems in 2D
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.model.slip_mean import SlipMean

    for parts in (MEAN, TABLE):
        missing = [name for name in parts if name not in arrays]
        if 0 < len(missing) < len(parts):
            raise InvalidProblemError(f"{', '.join(missing)} is missing; expected {', '.join(parts)}, all or none")
    options |= _space_friction(arrays)
    options["friction_slope"] = tuple(arrays.get(name, 0.0) for name in _FRICTION_SLOPE)
    if MEAN[0] in arrays:
        options["slip_mean"] = SlipMean(*(arrays[name] for name in MEAN))
    options["mesh"] = _mesh(arrays)
    return ContactProblem3D(*(arrays[name] for name in layout.required), **options)


def arrays_of(problem: ContactProblem | ContactProblem3D) -> dict[str, Any]:
    """All matrices and arrays of numbers of a problem, by the names they have in files."""
    if isinstance(problem, ContactProblem):
        F0, F1 = problem.friction
        arrays: dict[str, Any] = {name: getattr(problem, name) for name in (*LAYOUT_2D.required, "gap")}
        arrays |= {"friction0": F0, "friction1": F1, "slip_offset": problem.slip_offset}
    else:
        arrays = {name: getattr(problem, name) for name in (*LAYOUT_3D.required, "gap", "slip_offset")}
        arrays |= _arrays_of_law(problem) | dict(zip(_FRICTION_SLOPE, problem.friction_slope, strict=True))
    more = {name: getattr(problem, name, None) for name in ("load_slope", "coordinates", "areas", "rigid_modes")}
    if problem.max_rigid_displacement is not None:
        more["max_rigid_displacement"] = np.array([problem.max_rigid_displacement])
    mean, mesh = getattr(problem, "slip_mean", None), problem.mesh
    if mesh is not None:
        more |= {"mesh_points": mesh.points, "mesh_cells": mesh.cells, "mesh_motion": mesh.motion}
        more |= dict(zip(SURFACE, (mesh.offset, mesh.facets, mesh.rows, mesh.lame), strict=True))
    if mean is not None:
        more |= dict(zip(MEAN, (mean.T1, mean.T2, mean.offset, mean.weights), strict=True))
    return arrays | {name: part for name, part in more.items() if part is not None}


def _rigid(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments about the rigid modes of a body that nothing holds."""
    found = {name: arrays[name] for name in RIGID if name in arrays}
    if RIGID[1] in found:
        bound = np.asarray(found[RIGID[1]])
        if bound.size != 1:
            raise InvalidProblemError(f"{RIGID[1]} has shape {bound.shape}; expected one number")
        found[RIGID[1]] = bound.item()
    return found


# -- friction ----------------------------------------------------------------------------------------------------------


def _plane_friction(arrays: Mapping[str, Any]) -> dict[str, Any]:
    if "friction" in arrays:
        return {"friction": (_constant(arrays["friction"], LAYOUT_2D), 0.0)}
    if "friction0" in arrays or "friction1" in arrays:
        return {"friction": (arrays.get("friction0", 0.0), arrays.get("friction1", 0.0))}
    return {}


def _space_friction(arrays: Mapping[str, Any]) -> dict[str, Any]:
    if "friction" in arrays:
        return {"friction": _constant(arrays["friction"], LAYOUT_3D)}
    given = [name for name in ("friction_1", "friction_2") if name in arrays]
    if len(given) == 1:
        raise InvalidProblemError(f"{given[0]} stands alone; expected friction_1 and friction_2, or friction")
    if given:
        return {"friction": (arrays["friction_1"], arrays["friction_2"])}
    if TABLE[0] in arrays:
        from enumsol.model.friction import FrictionTable  # not for problems in 2D

        slip, *columns = (np.asarray(arrays[name]) for name in TABLE)
        # one column of a MatrixMarket file is the table of all nodes
        columns = [F.ravel() if F.ndim == 2 and F.shape[1] == 1 else F for F in columns]
        return {"friction": FrictionTable(slip, *columns)}
    return {}


def _constant(value: Any, layout: Layout) -> Any:
    """The array ``friction``, one number."""
    array = np.asarray(value)
    if array.ndim:
        choice = " and ".join(layout.frictions[1])
        raise InvalidProblemError(
            f"friction is an array of shape {array.shape}, which is ambiguous; expected one number, "
            f"or {choice}, each a number or an array of shape (p,)"
        )
    return array


def _arrays_of_law(problem: ContactProblem3D) -> dict[str, Any]:
    from enumsol.model.friction import ConstantFriction, FrictionTable  # not for problems in 2D

    law = problem.law
    if isinstance(law, ConstantFriction):
        return {"friction_1": law.values[:, 0], "friction_2": law.values[:, 1]}
    if isinstance(law, FrictionTable):
        return dict(zip(TABLE, (law.slip, law.F1, law.F2), strict=True))
    raise InvalidProblemError(f"friction is {law}, which no file can hold; expected constants or a FrictionTable")


# -- meshes ------------------------------------------------------------------------------------------------------------


def _mesh(arrays: Mapping[str, Any]) -> BodyMesh | None:
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
