"""Continuation and the graph side by side: every branch followed, and audits of paths against the graph."""

from enumsol.auditing.audit_report import AuditedPoint, AuditReport, Jump, MissedArc
from enumsol.auditing.auditor import FollowAllResult, audit, follow_all, follow_arc
from enumsol.auditing.graph_map import PointRun, read_points
from enumsol.auditing.results import ResultComparison, compare_result

__all__ = [
    "AuditReport",
    "AuditedPoint",
    "FollowAllResult",
    "Jump",
    "MissedArc",
    "PointRun",
    "ResultComparison",
    "audit",
    "compare_result",
    "follow_all",
    "follow_arc",
    "read_points",
]
