"""Enumerate and account for every solution of a discrete contact problem with Coulomb friction."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enumsol import arithmetic as arithmetic
    from enumsol import branches as branches
    from enumsol import checker as checker
    from enumsol import condensation as condensation
    from enumsol import continuation as continuation
    from enumsol import errors as errors
    from enumsol import fem as fem
    from enumsol import fixed_points as fixed_points
    from enumsol import gallery
    from enumsol import io as io
    from enumsol import model as model
    from enumsol import proof as proof
    from enumsol import relaxation as relaxation
    from enumsol import roots as roots
    from enumsol import search as search
    from enumsol import selections as selections
    from enumsol import trusted as trusted
    from enumsol.branches import BranchGraph, branch_graph, link_samples, multiplicity_table
    from enumsol.checker.reports import VerificationReport
    from enumsol.checker.verify import verify
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
    from enumsol.continuation.equation import PiecewiseSmoothEquation
    from enumsol.errors import (
        EnumsolError,
        FrictionJumpWarning,
        IncompleteGraphError,
        Interrupted,
        InvalidArgumentError,
        InvalidProblemError,
        MissingDependencyError,
        OutputError,
        TooLargeError,
    )
    from enumsol.fixed_points import (
        FixedPoint,
        TrescaSolution,
        basin_table,
        is_fixed_point,
        lipschitz_estimate,
        solve_tresca,
        successive_approximations,
    )
    from enumsol.io import read_problem, write_problem
    from enumsol.io.vtu import write_vtu
    from enumsol.model.friction import FrictionTable
    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.model.slip_mean import SlipMean
    from enumsol.model.statuses import ContactStatus, sign_array
    from enumsol.proof.proof_file import Proof, ProofFormatError
    from enumsol.report import write_report
    from enumsol.roots.enumerate import enumerate_roots
    from enumsol.roots.root import Enclosure, Polytope, Root, RootFamily
    from enumsol.roots.root_set import RootSet, SearchStats, Undecided
    from enumsol.roots.unique import is_unique
    from enumsol.search.outcome import SearchProgress

    __version__: str

#: Where the public names are at home. A module is loaded when a name of it is first used, so that a program loads what
#: it works with and no more: sparse matrices come with a problem, networkx and rational arithmetic with a branch graph.
_HOMES = {
    "enumsol.branches": ("BranchGraph", "branch_graph", "link_samples", "multiplicity_table"),
    "enumsol.checker.verify": ("verify",),
    "enumsol.proof.proof_file": ("Proof", "ProofFormatError"),
    "enumsol.checker.reports": ("VerificationReport",),
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
    "enumsol.roots.enumerate": ("enumerate_roots",),
    "enumsol.roots.unique": ("is_unique",),
    "enumsol.search.outcome": ("SearchProgress",),
    "enumsol.errors": (
        "EnumsolError",
        "FrictionJumpWarning",
        "IncompleteGraphError",
        "Interrupted",
        "InvalidArgumentError",
        "InvalidProblemError",
        "MissingDependencyError",
        "OutputError",
        "TooLargeError",
    ),
    "enumsol.io": ("read_problem", "write_problem"),
    "enumsol.io.vtu": ("write_vtu",),
    "enumsol.fixed_points": (
        "FixedPoint",
        "TrescaSolution",
        "basin_table",
        "is_fixed_point",
        "lipschitz_estimate",
        "solve_tresca",
        "successive_approximations",
    ),
    "enumsol.model.friction": ("FrictionTable",),
    "enumsol.model.mesh": ("BodyMesh",),
    "enumsol.model.slip_mean": ("SlipMean",),
    "enumsol.report": ("write_report",),
    "enumsol.model.problem": ("ContactProblem",),
    "enumsol.model.problem3d": ("ContactProblem3D",),
    "enumsol.roots.root": ("Enclosure", "Polytope", "Root", "RootFamily"),
    "enumsol.roots.root_set": ("RootSet", "SearchStats", "Undecided"),
    "enumsol.continuation.equation": ("PiecewiseSmoothEquation",),
    "enumsol.model.statuses": ("ContactStatus", "sign_array"),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}
#: Modules that are reached as attributes without an import of their own.
_MODULES = frozenset(
    (
        "arithmetic",
        "branches",
        "checker",
        "condensation",
        "continuation",
        "errors",
        "fem",
        "fixed_points",
        "gallery",
        "io",
        "model",
        "proof",
        "relaxation",
        "roots",
        "search",
        "selections",
        "trusted",
    )
)

__all__ = [
    "BodyMesh",
    "BranchGraph",
    "ContactProblem",
    "ContactProblem3D",
    "ContactStatus",
    "ContinuationOptions",
    "Enclosure",
    "EnumsolError",
    "FixedPoint",
    "FrictionJumpWarning",
    "FrictionTable",
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
    "SlipMean",
    "SmoothPath",
    "TooLargeError",
    "TrescaSolution",
    "Undecided",
    "VerificationReport",
    "audit",
    "basin_table",
    "branch_graph",
    "enumerate_roots",
    "follow",
    "follow_all",
    "gallery",
    "is_fixed_point",
    "is_unique",
    "link_samples",
    "lipschitz_estimate",
    "local_branch_test",
    "multiplicity_table",
    "newton",
    "read_problem",
    "sign_array",
    "solve_tresca",
    "successive_approximations",
    "verify",
    "write_problem",
    "write_report",
    "write_vtu",
]


if not TYPE_CHECKING:  # with it a type checker would accept any name

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
