"""Where the names are at home."""

from .construction import branch_graph as branch_graph
from .elements import Arc as Arc, Branch as Branch, Component as Component, Vertex as Vertex
from .graph import BranchGraph as BranchGraph
from .graph_data import GraphStats as GraphStats
from .samples import (
    Missed as Missed,
    SampledGraph as SampledGraph,
    link_samples as link_samples,
    multiplicity_table as multiplicity_table,
)
from .stability import Span as Span
