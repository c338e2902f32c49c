"""Branches of solutions over alpha: arcs glued to a graph, multiplicity tables, linked samples (theory, section 7)."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enumsol.branches.construction import branch_graph
    from enumsol.branches.elements import Arc, Branch, Component, Vertex
    from enumsol.branches.graph import BranchGraph
    from enumsol.branches.graph_data import GraphStats
    from enumsol.branches.samples import Missed, SampledGraph, link_samples
    from enumsol.branches.table import multiplicity_table

#: Modules of the public names, loaded when first used: a table needs neither networkx nor rational arithmetic.
_HOMES = {
    "construction": ("branch_graph",),
    "graph": ("BranchGraph",),
    "graph_data": ("GraphStats",),
    "elements": ("Arc", "Branch", "Component", "Vertex"),
    "samples": ("Missed", "SampledGraph", "link_samples"),
    "table": ("multiplicity_table",),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

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


if not TYPE_CHECKING:  # with it a type checker would accept any name

    def __getattr__(name: str) -> object:
        if name not in _HOME_OF:
            raise AttributeError(f"module 'enumsol.branches' has no attribute {name!r}")
        return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
