"""Enumerate and account for every solution of a discrete contact problem with Coulomb friction."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from enumsol import gallery
from enumsol.certification.checker import VerificationReport, verify
from enumsol.certification.proof import Proof, ProofFormatError
from enumsol.enumeration import SearchProgress, enumerate_roots
from enumsol.errors import (
    EnumsolError,
    Interrupted,
    InvalidArgumentError,
    InvalidProblemError,
    MissingDependencyError,
    TooLargeError,
)
from enumsol.io import read_problem, write_problem
from enumsol.problem import ContactProblem
from enumsol.results import Enclosure, Polytope, Root, RootFamily, RootSet, SearchStats, Undecided
from enumsol.selections import ContactStatus, PiecewiseSmoothEquation, sign_array

if TYPE_CHECKING:
    from enumsol.branches import BranchGraph, branch_graph, link_samples, multiplicity_table
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

#: Names that are imported when first used: they bring in networkx and rational arithmetic.
_LATER = {
    "BranchGraph": "enumsol.branches",
    "branch_graph": "enumsol.branches",
    "link_samples": "enumsol.branches",
    "multiplicity_table": "enumsol.branches",
    "ContinuationOptions": "enumsol.continuation",
    "NotConverged": "enumsol.continuation",
    "Path": "enumsol.continuation",
    "SmoothPath": "enumsol.continuation",
    "audit": "enumsol.continuation",
    "follow": "enumsol.continuation",
    "follow_all": "enumsol.continuation",
    "local_branch_test": "enumsol.continuation",
    "newton": "enumsol.continuation",
}

__all__ = [
    "BranchGraph",
    "ContactProblem",
    "ContactStatus",
    "ContinuationOptions",
    "Enclosure",
    "EnumsolError",
    "Interrupted",
    "InvalidArgumentError",
    "InvalidProblemError",
    "MissingDependencyError",
    "NotConverged",
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


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module 'enumsol' has no attribute {name!r}")
    return getattr(import_module(_LATER[name]), name)


def __dir__() -> list[str]:
    return __all__
