"""Branches of solutions over alpha: arcs glued to a graph, multiplicity tables, linked samples (theory, section 7)."""

from enumsol.branches.build import branch_graph
from enumsol.branches.graph import BranchGraph, GraphStats
from enumsol.branches.parts import Arc, Branch, Component, Vertex
from enumsol.branches.samples import Missed, SampledGraph, link_samples
from enumsol.branches.table import multiplicity_table

__all__ = [
    "Arc",
    "Branch",
    "BranchGraph",
    "Component",
    "GraphStats",
    "Missed",
    "SampledGraph",
    "Vertex",
    "branch_graph",
    "link_samples",
    "multiplicity_table",
]
