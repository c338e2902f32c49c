"""The named arrays of a problem in two or three dimensions, and the problem that they make (see `enumsol.io`).

Names that do not fit are refused.
"""

from __future__ import annotations

import difflib
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidProblemError
from enumsol.model.mesh import BodyMesh
from enumsol.model.problem import ContactProblem
from enumsol.support.messages import listed, shortened

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from enumsol.model.problem3d import AnyProblem, ContactProblem3D


#: Version of the layout that is written, and the newest that can be read.
FORMAT_VERSION = 1


@dataclass(frozen=True)
class Layout:
    """Names of the arrays of problems in two or in three dimensions.

    Attributes
    ----------
    contact : the matrices A, Bn and the tangents, all required as f is
    matrices : every name that may be stored in sparse parts
    tables : arrays with two dimensions that are stored densely
    broadcast : read as vectors of which one entry may stand for all nodes
    optional : all other names
    frictions : those of them of which one kind must be chosen
    synonyms : names in use elsewhere for the same things, lower case and without underscores
    """

    contact: tuple[str, ...]
    matrices: tuple[str, ...]
    tables: tuple[str, ...]
    broadcast: tuple[str, ...]
    optional: tuple[str, ...]
    frictions: tuple[tuple[str, ...], ...]
    synonyms: Mapping[str, str]

    @property
    def required(self) -> tuple[str, ...]:
        """Names without which there is no problem."""
        return (*self.contact, "f")

    @property
    def known(self) -> tuple[str, ...]:
        """All names."""
        return (*self.required, *self.optional)


_SYNONYMS = {
    other: name
    for name, others in (
        ("A", "a k stiffness"),
        ("Bn", "bn n normal"),
        ("f", "f b rhs load force forces"),
        ("gap", "g gap0"),
        ("friction", "mu"),
        ("load_slope", "dload"),
        ("node_ids", "nodes labels"),
        ("coordinates", "points coords"),
    )
    for other in others.split()
}
_COMMON = ("gap", "friction", "load_slope", "slip_offset", "node_ids", "coordinates", "mass")
#: Names of the arrays of a BodyMesh: one of "mesh_motion" and "mesh_dofs" is required, and all of MESH.
MESH = ("mesh_points", "mesh_cells")
#: Of changes of temperature.
_STRESSES = ("mesh_stress", "mesh_stress_slope")
SURFACE = ("mesh_offset", "mesh_facets", "mesh_rows", "mesh_lame", "mesh_elasticity", *_STRESSES)
_MESH = (*MESH, "mesh_motion", "mesh_dofs", *SURFACE)
_MESH_TABLES = (*MESH, "mesh_offset", "mesh_facets", "mesh_lame", "mesh_elasticity", *_STRESSES)
#: Of a body that nothing holds.
RIGID = ("rigid_modes", "max_rigid_displacement")
LAYOUT_2D = Layout(
    contact=("A", "Bn", "Bt"),
    matrices=("A", "Bn", "Bt", "mass", "mesh_motion"),
    tables=("coordinates", *_MESH_TABLES, RIGID[0]),
    broadcast=("gap", "friction", "friction0", "friction1", "slip_offset", RIGID[1]),
    optional=(*_COMMON, "friction0", "friction1", *_MESH, *RIGID),
    frictions=(("friction",), ("friction0", "friction1")),
    synonyms=_SYNONYMS
    | {"bt": "Bt", "t": "Bt", "tangential": "Bt"}
    | {"f0": "friction0", "mu0": "friction0", "f1": "friction1", "mu1": "friction1"},
)
_TANGENTS = {"bt1": "Bt1", "t1": "Bt1", "tangential1": "Bt1", "bt2": "Bt2", "t2": "Bt2", "tangential2": "Bt2"}
#: Names of the arrays of a SlipMean and of a FrictionTable.
MEAN = ("slip_mean_T1", "slip_mean_T2", "slip_mean_offset", "slip_mean_weights")
TABLE = ("friction_table_slip", "friction_table_1", "friction_table_2")
_SLOPES = ("friction_slope_1", "friction_slope_2")
LAYOUT_3D = Layout(
    contact=("A", "Bn", "Bt1", "Bt2"),
    matrices=("A", "Bn", "Bt1", "Bt2", *MEAN[:2], MEAN[3], "mass", "mesh_motion"),
    tables=("coordinates", "slip_offset", *_MESH_TABLES, "slip_mean_offset", *TABLE[1:], RIGID[0]),
    broadcast=("gap", "friction", "friction_1", "friction_2", *_SLOPES, RIGID[1]),
    optional=(
        *_COMMON,
        *("friction_1", "friction_2", *_SLOPES, *TABLE, "areas", *_MESH, *MEAN, *RIGID),
    ),
    frictions=(("friction",), ("friction_1", "friction_2"), TABLE),
    synonyms=_SYNONYMS
    | _TANGENTS
    | {"f1": "friction_1", "mu1": "friction_1", "f2": "friction_2", "mu2": "friction_2"}
    | {"area": "areas", "cells": "mesh_cells", "dofs": "mesh_dofs"},
)


def layout_of(names: Iterable[str]) -> Layout:
    """The layout of arrays, or sparse parts, with these names: a second tangent means 3D."""
    second = any(_plain(name) in _TANGENTS or name.partition("_")[0] in ("Bt1", "Bt2") for name in names)
    return LAYOUT_3D if second else LAYOUT_2D


@contextmanager
def refusing(errors: tuple[type[Exception], ...], found: str, expected: str) -> Iterator[None]:
    """Turn errors of other packages on unusable files into one sentence: ``found (reason); expected ...``."""
    try:
        yield
    except InvalidProblemError:
        raise
    except errors as error:
        reason = str(error).strip().split("\n")[0].split(". ")[0].rstrip(" .:") or type(error).__name__
        raise InvalidProblemError(f"{found} ({shortened(reason)}); expected {expected}") from error


def check_names(found: Collection[str], layout: Layout, suffix: str = "") -> None:
    """Raise InvalidProblemError for arrays that are missing, unknown or contradict each other.

    Parameters
    ----------
    found : names of the arrays in the file, without the private ones
    suffix : what follows a name in messages: "" for arrays, ".mtx" for files
    """
    strangers = [name for name in found if name not in layout.known]
    missing = [name for name in layout.required if name not in found]
    if missing:
        meant = {name: _closest(name, strangers, layout) for name in missing}
        hints = "".join(f"; is {other}{suffix} meant as {name}{suffix}?" for name, other in meant.items() if other)
        raise InvalidProblemError(
            f"{listed(missing, suffix)} {'is' if len(missing) == 1 else 'are'} missing "
            f"(found {listed(found, suffix) or 'nothing'}{hints}); expected {listed(layout.required, suffix)}"
        )
    if strangers:
        close = _closest_known(strangers[0], layout)
        hint = f" (is {close}{suffix} meant?)" if close else ""
        raise InvalidProblemError(
            f"{strangers[0]}{suffix} is not known{hint}; expected {listed(layout.known)}, "
            "or a name that begins with an underscore for what enumsol should ignore"
        )
    kinds = [kind for kind in layout.frictions if any(name in found for name in kind)]
    if len(kinds) > 1:
        given = " or ".join(kinds[1])
        choice = " or ".join("by " + " and ".join(kind) for kind in layout.frictions)
        raise InvalidProblemError(
            f"{kinds[0][0]}{suffix} is given together with {given}; expected coefficients {choice}, not several"
        )


def _plain(name: str) -> str:
    return "".join(c for c in name.casefold() if c.isalnum())


def _closest(wanted: str, names: Iterable[str], layout: Layout) -> str | None:
    """The name among ``names`` that most likely means ``wanted``."""
    return next((name for name in names if _closest_known(name, layout) == wanted), None)


def _closest_known(name: str, layout: Layout) -> str | None:
    plain = _plain(name)
    if plain in layout.synonyms:
        return layout.synonyms[plain]
    known = {_plain(other): other for other in layout.known}
    close = difflib.get_close_matches(plain, known, n=1, cutoff=0.6)
    return known[close[0]] if close else None


#: Arguments of both problems that are arrays of the same names.
_SAME = ("gap", "load_slope", "slip_offset", "node_ids", "coordinates", "areas", "mass")
_FRICTION_SLOPE = ("friction_slope_1", "friction_slope_2")


def problem_from_arrays(arrays: Mapping[str, Any], layout: Layout) -> AnyProblem:
    """The problem made of arrays whose names have been checked."""
    options: dict[str, Any] = {name: arrays[name] for name in _SAME if name in arrays}
    options |= _rigid(arrays)
    if layout is LAYOUT_2D:
        options |= _plane_friction(arrays)
        options["mesh"] = _mesh(arrays)
        return ContactProblem(*(arrays[name] for name in layout.required), **options)
    # not for problems in 2D
    from enumsol.model.problem3d import ContactProblem3D, SlipMean

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


def arrays_of(problem: AnyProblem) -> dict[str, Any]:
    """All matrices and arrays of numbers of a problem, by the names they have in files."""
    if isinstance(problem, ContactProblem):
        F0, F1 = problem.affine_friction
        arrays: dict[str, Any] = {name: getattr(problem, name) for name in (*LAYOUT_2D.required, "gap")}
        arrays |= {"friction0": F0, "friction1": F1, "slip_offset": problem.slip_offset}
    else:
        arrays = {name: getattr(problem, name) for name in (*LAYOUT_3D.required, "gap", "slip_offset")}
        arrays |= _arrays_of_law(problem) | dict(zip(_FRICTION_SLOPE, problem.friction_slope, strict=True))
    more = {
        name: getattr(problem, name, None) for name in ("load_slope", "coordinates", "areas", "rigid_modes", "mass")
    }
    if problem.max_rigid_displacement is not None:
        more["max_rigid_displacement"] = np.array([problem.max_rigid_displacement])
    mean, mesh = getattr(problem, "slip_mean", None), problem.mesh
    if mesh is not None:
        more |= {"mesh_points": mesh.points, "mesh_cells": mesh.cells, "mesh_motion": mesh.motion}
        moduli = None if mesh.elasticity is None else mesh.elasticity.reshape(len(mesh.cells), -1)
        stresses = mesh.initial_stress, mesh.stress_slope
        kept = (mesh.offset, mesh.facets, mesh.rows, mesh.lame, moduli, *stresses)
        more |= dict(zip(SURFACE, kept, strict=True))
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
        return {"friction": _constant(arrays["friction"], LAYOUT_2D)}
    if "friction0" in arrays or "friction1" in arrays:
        coefficients = (np.asarray(arrays.get(name, 0.0)) for name in ("friction0", "friction1"))
        return dict(zip(("friction", "friction_slope"), coefficients, strict=True))
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
        from enumsol.model.problem3d import FrictionTable  # not for problems in 2D

        slip, *columns = (np.asarray(arrays[name]) for name in TABLE)
        # one column of a MatrixMarket file is the table of all nodes
        columns = [F.ravel() if F.ndim == 2 and F.shape[1] == 1 else F for F in columns]
        return {"friction": FrictionTable(slip, *columns)}
    return {}


def _constant(value: object, layout: Layout) -> Any:
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
    from enumsol.model.problem3d import ConstantFriction, FrictionTable  # not for problems in 2D

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
