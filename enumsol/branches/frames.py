"""Tables of a branch graph's arcs and vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from enumsol.branches.elements import Component
    from enumsol.branches.graph_data import GraphData


def arcs_frame(data: GraphData, components: Sequence[Component], branch_of: Mapping[int, int]) -> pd.DataFrame:
    """One row an arc: its branch, component, ends and their kinds, index, dimension and statuses (node by node)."""
    import pandas as pd

    place = {arc.number: c.number for c in components for arc in c.arcs}
    rows = [
        {
            "arc": arc.number,
            "branch": branch_of[arc.number],
            "component": place[arc.number],
            "alpha_from": arc.lo,
            "alpha_to": arc.hi,
            "vertex_from": arc.tail,
            "vertex_to": arc.head,
            "kind_from": data.vertices[arc.tail].kind.value,
            "kind_to": data.vertices[arc.head].kind.value,
            "index": arc.index,
            "dimension": arc.dimension,
            "grazing": arc.grazing,
            "statuses": " ".join(s.value for s in arc.statuses),
        }
        for arc in data.arcs
    ]
    return pd.DataFrame(rows)


def vertices_frame(data: GraphData) -> pd.DataFrame:
    """One row a vertex and contact node: alpha, kind, statuses that hold, and values."""
    import pandas as pd

    rows = [
        {
            "vertex": v.number,
            "alpha": v.alpha,
            "kind": v.kind.value,
            "node": node,
            "active": " ".join(sorted(s.value for s in v.active[i])),
            "lambda_n": v.lambda_n[i],
            "lambda_t": v.lambda_t[i],
            "u_n": v.u_n[i],
            "u_t": v.u_t[i],
            "index_left": v.index_left,
            "index_right": v.index_right,
        }
        for v in data.vertices
        for i, node in enumerate(data.problem.node_ids)
    ]
    return pd.DataFrame(rows)
