"""Enumerate and account for every solution of a discrete contact problem with Coulomb friction."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enumsol import branches as branches
    from enumsol import certification as certification
    from enumsol import condensed as condensed
    from enumsol import continuation as continuation
    from enumsol import enumeration as enumeration
    from enumsol import errors as errors
    from enumsol import fem as fem
    from enumsol import gallery
    from enumsol import io as io
    from enumsol import problem as problem
    from enumsol import results as results
    from enumsol import selections as selections
    from enumsol.branches import BranchGraph, branch_graph, link_samples, multiplicity_table
    from enumsol.certification.checker import verify
    from enumsol.certification.proof import Proof, ProofFormatError
    from enumsol.certification.reports import VerificationReport
    from enumsol.continuation import (
        ContinuationOptions,
        NotConverged,
        Path,
        SmoothPath,
        audit,
        follow,
        follow_all,
        local_branch_test,
        newton,
    )
    from enumsol.enumeration import SearchProgress, enumerate_roots
    from enumsol.errors import (
        EnumsolError,
        IncompleteGraphError,
        Interrupted,
        InvalidArgumentError,
        InvalidProblemError,
        MissingDependencyError,
        OutputError,
        TooLargeError,
        WorkerError,
    )
    from enumsol.io import read_problem, write_problem
    from enumsol.problem import ContactProblem
    from enumsol.results import Enclosure, Polytope, Root, RootFamily, RootSet, SearchStats, Undecided
    from enumsol.selections import ContactStatus, PiecewiseSmoothEquation, sign_array

    __version__: str

#: Where the public names are at home. A module is loaded when a name of it is first used, so that a program loads what
#: it works with and no more: sparse matrices come with a problem, networkx and rational arithmetic with a branch graph.
_HOMES = {
    "enumsol.branches": ("BranchGraph", "branch_graph", "link_samples", "multiplicity_table"),
    "enumsol.certification.checker": ("verify",),
    "enumsol.certification.proof": ("Proof", "ProofFormatError"),
    "enumsol.certification.reports": ("VerificationReport",),
    "enumsol.continuation": (
        "ContinuationOptions",
        "NotConverged",
        "Path",
        "SmoothPath",
        "audit",
        "follow",
        "follow_all",
        "local_branch_test",
        "newton",
    ),
    "enumsol.enumeration": ("SearchProgress", "enumerate_roots"),
    "enumsol.errors": (
        "EnumsolError",
        "IncompleteGraphError",
        "Interrupted",
        "InvalidArgumentError",
        "InvalidProblemError",
        "MissingDependencyError",
        "OutputError",
        "TooLargeError",
        "WorkerError",
    ),
    "enumsol.io": ("read_problem", "write_problem"),
    "enumsol.problem": ("ContactProblem",),
    "enumsol.results": ("Enclosure", "Polytope", "Root", "RootFamily", "RootSet", "SearchStats", "Undecided"),
    "enumsol.selections": ("ContactStatus", "PiecewiseSmoothEquation", "sign_array"),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}
#: Modules that are reached as attributes without an import of their own.
_MODULES = frozenset(
    (
        "branches",
        "certification",
        "condensed",
        "continuation",
        "enumeration",
        "errors",
        "fem",
        "gallery",
        "io",
        "problem",
        "results",
        "selections",
    )
)

__all__ = [
    "BranchGraph",
    "ContactProblem",
    "ContactStatus",
    "ContinuationOptions",
    "Enclosure",
    "EnumsolError",
    "IncompleteGraphError",
    "Interrupted",
    "InvalidArgumentError",
    "InvalidProblemError",
    "MissingDependencyError",
    "NotConverged",
    "OutputError",
    "Path",
    "PiecewiseSmoothEquation",
    "Polytope",
    "Proof",
    "ProofFormatError",
    "Root",
    "RootFamily",
    "RootSet",
    "SearchProgress",
    "SearchStats",
    "SmoothPath",
    "TooLargeError",
    "Undecided",
    "VerificationReport",
    "WorkerError",
    "audit",
    "branch_graph",
    "enumerate_roots",
    "follow",
    "follow_all",
    "gallery",
    "link_samples",
    "local_branch_test",
    "multiplicity_table",
    "newton",
    "read_problem",
    "sign_array",
    "verify",
    "write_problem",
]


if not TYPE_CHECKING:  # or a type checker would take any name for one of ours

    def __getattr__(name: str) -> object:
        if name in _MODULES:
            return import_module(f"{__name__}.{name}")
        if name == "__version__":
            value = import_module(f"{__name__}._version").find_version()
        elif name in _HOME_OF:
            value = getattr(import_module(_HOME_OF[name]), name)
        else:
            raise AttributeError(f"module 'enumsol' has no attribute {name!r}")
        globals()[name] = value  # found without this detour from now on
        return value


def __dir__() -> list[str]:
    return __all__
