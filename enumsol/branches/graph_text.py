"""A branch graph as text and as tables of its arcs and vertices."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from enumsol.branches.elements import VertexKind
from enumsol.roots.root_set import by_axis
from enumsol.support.messages import counted, html_lines, html_table

if TYPE_CHECKING:
    import pandas as pd

    from enumsol.branches.elements import Branch
    from enumsol.branches.graph_data import GraphData


#: Branches that are printed one by one.
_PRINTED_BRANCHES = 20


def graph_text(data: GraphData) -> str:
    """Counts, a line a branch, and whether the graph is complete."""
    lines = [*_heading(data), *map(_branch_line, data.branches[:_PRINTED_BRANCHES])]
    if len(data.branches) > _PRINTED_BRANCHES:
        lines.append(f"  ... {len(data.branches) - _PRINTED_BRANCHES} more branches")
    return "\n".join([*lines, data.completeness()])


def graph_html(data: GraphData) -> str:
    """The same in a notebook."""
    rows = [
        (
            branch.number,
            _shape(branch),
            len(branch.arcs),
            *(f"{end:.6g}" for end in branch.interval),
            ", ".join(f"{v.alpha:.6g}" for v in branch.folds),
        )
        for branch in data.branches[:_PRINTED_BRANCHES]
    ]
    more = len(data.branches) - _PRINTED_BRANCHES
    table = html_table(("branch", "shape", "arcs", "alpha from", "to", "folds at"), rows) if rows else ""
    closing = [*([f"... {more} more branches"] if more > 0 else []), data.completeness()]
    return html_lines(_heading(data)) + table + html_lines(closing)


def _heading(data: GraphData) -> list[str]:
    kinds = Counter(v.kind for v in data.vertices)
    numbers = ", ".join(f"{kinds[kind]} {kind}" for kind in VertexKind if kinds[kind])
    a, b = data.interval
    found = "" if data.claims.whole else ", not complete; of what was found:"
    return [
        f"BranchGraph for alpha in [{a:g}, {b:g}] ({data.arithmetic}){found}",
        f"  components {len(data.components)}, branches {len(data.branches)}, arcs {len(data.arcs)}",
        f"  vertices {len(data.vertices)}" + (f": {numbers}" if numbers else ""),
    ]


def _branch_line(branch: Branch) -> str:
    lo, hi = branch.interval
    folds = ", ".join(f"{v.alpha:.6g}" for v in branch.folds)
    width = f", length {hi - lo:.3g}" if f"{lo:.6g}" == f"{hi:.6g}" else ""
    arcs = counted(len(branch.arcs), "arc")
    return f"  branch {branch.number}: {_shape(branch)}, {arcs}, alpha in [{lo:.6g}, {hi:.6g}]{width}" + (
        f", folds at {folds}" if folds else ""
    )


def _shape(branch: Branch) -> str:
    if branch.sheet:
        return "sheet"
    if branch.closed:
        return "closed"
    return "unfinished" if any(v.kind is VertexKind.UNSETTLED for v in branch.vertices) else "open"


def arcs_frame(data: GraphData) -> pd.DataFrame:
    """One row per arc: its branch, component, ends and their kinds, index, dimension and statuses (by node)."""
    import pandas as pd

    place = {arc.number: c.number for c in data.components for arc in c.arcs}
    rows = [
        {
            "arc": arc.number,
            "branch": data.branch_of[arc.number],
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
    """One row per vertex and contact node: alpha, kind, statuses that hold, and values."""
    import pandas as pd

    rows = [
        {
            "vertex": v.number,
            "alpha": v.alpha,
            "kind": v.kind.value,
            "node": node,
            "active": " ".join(sorted(s.value for s in v.active[i])),
            **{
                column: part[i]
                for name in ("lambda_n", "lambda_t", "u_n", "u_t")
                for column, part in by_axis(name, getattr(v, name))
            },
            "index_left": v.index_left,
            "index_right": v.index_right,
        }
        for v in data.vertices
        for i, node in enumerate(data.problem.node_ids)
    ]
    return pd.DataFrame(rows)
