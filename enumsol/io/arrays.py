"""The named arrays of a problem, and the problem that they make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.io.layouts import LAYOUT_2D, LAYOUT_3D, Layout, constant_friction
from enumsol.io.mesh_arrays import arrays_of_mesh, mesh_from_arrays
from enumsol.model.problem import ContactProblem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from enumsol.model.problem3d import ContactProblem3D


def problem_from_arrays(arrays: Mapping[str, Any], layout: Layout) -> ContactProblem | ContactProblem3D:
    """The problem made of arrays whose names have been checked."""
    if layout is LAYOUT_3D:
        from enumsol.io.arrays3d import problem_from_arrays_3d  # not for problems in 2D

        return problem_from_arrays_3d(arrays)
    options: dict[str, Any] = {
        name: arrays[name] for name in ("gap", "load_slope", "slip_offset", "coordinates") if name in arrays
    }
    if "friction" in arrays:
        options["friction"] = (constant_friction(arrays["friction"], layout), 0.0)
    elif "friction0" in arrays or "friction1" in arrays:
        options["friction"] = (arrays.get("friction0", 0.0), arrays.get("friction1", 0.0))
    if "node_ids" in arrays:
        options["node_ids"] = arrays["node_ids"]
    options["mesh"] = mesh_from_arrays(arrays)
    return ContactProblem(*(arrays[name] for name in layout.required), **options)


def arrays_of(problem: ContactProblem | ContactProblem3D) -> dict[str, Any]:
    """All matrices and arrays of numbers of a problem, by the names they have in files."""
    if isinstance(problem, ContactProblem):
        return {name: getattr(problem, name) for name in LAYOUT_2D.contact} | _vectors_of(problem)
    from enumsol.io.arrays3d import arrays_of_3d  # not for problems in 2D

    return arrays_of_3d(problem)


def _vectors_of(problem: ContactProblem) -> dict[str, Any]:
    F0, F1 = problem.friction
    arrays: dict[str, Any] = {
        "f": problem.f,
        "gap": problem.gap,
        "friction0": F0,
        "friction1": F1,
        "slip_offset": problem.slip_offset,
    }
    if problem.load_slope is not None:
        arrays["load_slope"] = problem.load_slope
    if problem.coordinates is not None:
        arrays["coordinates"] = problem.coordinates
    return arrays | arrays_of_mesh(problem.mesh)
