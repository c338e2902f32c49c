"""Names of the arrays in problem files, in two and in three dimensions, and errors for names that do not fit."""

from __future__ import annotations

import difflib
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from enumsol.errors import InvalidProblemError
from enumsol.support.messages import listed, shortened

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

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
    "a": "A",
    "k": "A",
    "stiffness": "A",
    "bn": "Bn",
    "n": "Bn",
    "normal": "Bn",
    "f": "f",
    "b": "f",
    "rhs": "f",
    "load": "f",
    "force": "f",
    "forces": "f",
    "g": "gap",
    "gap0": "gap",
    "mu": "friction",
    "dload": "load_slope",
    "nodes": "node_ids",
    "labels": "node_ids",
    "points": "coordinates",
    "coords": "coordinates",
}
_COMMON = ("gap", "friction", "load_slope", "slip_offset", "node_ids", "coordinates")
#: Names of the arrays of a BodyMesh: one of "mesh_motion" and "mesh_dofs" is required, and all of MESH.
MESH, SURFACE = ("mesh_points", "mesh_cells"), ("mesh_offset", "mesh_facets", "mesh_rows", "mesh_lame")
_MESH = (*MESH, "mesh_motion", "mesh_dofs", *SURFACE)
_MESH_TABLES = (*MESH, "mesh_offset", "mesh_facets", "mesh_lame")
#: Of a body that nothing holds.
RIGID = ("rigid_modes", "max_rigid_displacement")
LAYOUT_2D = Layout(
    contact=("A", "Bn", "Bt"),
    matrices=("A", "Bn", "Bt", "mesh_motion"),
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
    matrices=("A", "Bn", "Bt1", "Bt2", *MEAN[:2], MEAN[3], "mesh_motion"),
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
