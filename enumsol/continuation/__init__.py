"""Piecewise smooth Newton and Moore-Penrose continuation (paper, Algorithm 5.1) and the local branch test."""

from enumsol.continuation.newton import NewtonIteration, NotConverged, newton
from enumsol.continuation.path import AmbiguousStart, Path, follow, start_tangents
from enumsol.continuation.path_data import ContinuationOptions, PathPoint, PathStats, Tangent, Transition
from enumsol.continuation.scaled_equation import SmoothPath
from enumsol.roots.local_branch import LocalBranchTest, local_branch_test

__all__ = [
    "AmbiguousStart",
    "ContinuationOptions",
    "LocalBranchTest",
    "NewtonIteration",
    "NotConverged",
    "Path",
    "PathPoint",
    "PathStats",
    "SmoothPath",
    "Tangent",
    "Transition",
    "follow",
    "local_branch_test",
    "newton",
    "start_tangents",
]
