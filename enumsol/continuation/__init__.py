"""Piecewise smooth Newton and Moore-Penrose continuation (paper, Algorithm 5.1), the local branch test and audits."""

from enumsol.continuation.audit.audit_report import AuditedPoint, AuditReport, Jump, MissedArc
from enumsol.continuation.audit.auditor import audit
from enumsol.continuation.audit.points import PointRun, read_points
from enumsol.continuation.continuation_options import ContinuationOptions
from enumsol.continuation.follow import follow, start_tangents
from enumsol.continuation.follow_all import FollowAllResult, follow_all, follow_arc
from enumsol.continuation.newton import newton
from enumsol.continuation.not_converged import AmbiguousStart, NewtonIteration, NotConverged
from enumsol.continuation.parameter_path import SmoothPath
from enumsol.continuation.path import Path
from enumsol.continuation.path_data import PathPoint, PathStats, Transition
from enumsol.continuation.tangents import Tangent
from enumsol.roots.local_branch import LocalBranchTest, local_branch_test

__all__ = [
    "AmbiguousStart",
    "AuditReport",
    "AuditedPoint",
    "ContinuationOptions",
    "FollowAllResult",
    "Jump",
    "LocalBranchTest",
    "MissedArc",
    "NewtonIteration",
    "NotConverged",
    "Path",
    "PathPoint",
    "PathStats",
    "PointRun",
    "SmoothPath",
    "Tangent",
    "Transition",
    "audit",
    "follow",
    "follow_all",
    "follow_arc",
    "local_branch_test",
    "newton",
    "read_points",
    "start_tangents",
]
