"""The named arrays of problems in three dimensions; names and layout are described in `enumsol.io`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidProblemError
from enumsol.io.layouts import LAYOUT_3D, MEAN, TABLE, constant_friction
from enumsol.io.mesh_arrays import arrays_of_mesh, mesh_from_arrays
from enumsol.model.friction import ConstantFriction, FrictionTable
from enumsol.model.problem3d import ContactProblem3D
from enumsol.model.slip_mean import SlipMean

if TYPE_CHECKING:
    from collections.abc import Mapping


def problem_from_arrays_3d(arrays: Mapping[str, Any]) -> ContactProblem3D:
    """The problem made of arrays whose names have been checked."""
    for parts in (MEAN, TABLE):
        missing = [name for name in parts if name not in arrays]
        if 0 < len(missing) < len(parts):
            raise InvalidProblemError(f"{', '.join(missing)} is missing; expected {', '.join(parts)}, all or none")
    names = ("gap", "load_slope", "slip_offset", "coordinates", "areas", "node_ids")
    options: dict[str, Any] = {name: arrays[name] for name in names if name in arrays}
    friction = _friction(arrays)
    if friction is not None:
        options["friction"] = friction
    options["friction_slope"] = tuple(arrays.get(f"friction_slope_{axis}", 0.0) for axis in (1, 2))
    if "slip_mean_T1" in arrays:
        options["slip_mean"] = SlipMean(*(arrays[name] for name in MEAN))
    options["mesh"] = mesh_from_arrays(arrays)
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
    arrays |= arrays_of_mesh(problem.mesh)
    if (mean := problem.slip_mean) is not None:
        arrays |= dict(zip(MEAN, (mean.T1, mean.T2, mean.offset, mean.weights), strict=True))
    return arrays
