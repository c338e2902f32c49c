"""The page of a graph: words and tables in HTML, and what its script draws, as plain values that JSON can hold."""

from __future__ import annotations

from html import escape
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.claims import ranges_text
from enumsol.branches.elements import Arc, Vertex, VertexKind, shape_of
from enumsol.branches.figures.curves import QUANTITIES, Curve, curves, side_by_side
from enumsol.branches.figures.panels import colour_of, family_states
from enumsol.branches.graph_data import about_stability, branch_stability
from enumsol.model.problem import ContactProblem
from enumsol.report import parts
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.branches import BranchGraph
    from enumsol.fem import Scene
    from enumsol.model.problem3d import ContactProblem3D

#: Most numbers of forces and displacements along the arcs, about ten characters each.
_MOST_NUMBERS = 250_000


def graph_page(graph: BranchGraph, heading: parts.Heading) -> str:
    """The text of the page."""
    where = f" for {ranges_text(graph.open_ranges)}, and only there" if graph.claims.partly else ""
    incomplete = (
        f"This graph is not complete. Everything shown is a solution, but solutions may be missing{where}: numbers of "
        "solutions are lower bounds. Why:"
    )
    said = parts.Statement(
        incomplete if graph.reasons else "",
        graph.reasons,
        _facts(graph, heading.units),
        [
            *graph.claims.sentences(graph.uniqueness_bound),
            *([] if graph.verdicts is None else [f"{about_stability(graph).capitalize()}."]),
        ],
        _certified(graph),
        graph.problem.fingerprint,
        parts.proof_commands("graph", "--from A --to B", "; the proof's first record holds the same fingerprint."),
    )
    words = {"plotly": parts.packed_plotly(), "branches": _branches(graph), "vertices": _vertices(graph)}
    content = report_content(graph, heading.scene) | {"units": heading.units}
    return parts.filled_page(
        "graph", graph, heading, said, (*parts.DRAWING, "page.js", "page.solutions.js"), content, words
    )


def _facts(graph: BranchGraph, units: tuple[str, str] | None) -> list[tuple[str, str]]:
    problem, (a, b) = graph.problem, graph.interval
    load = "constant" if problem.load_slope is None else "f + alpha load_slope"
    branches, arcs = counted(len(graph.branches), "branch", "branches"), counted(len(graph.arcs), "arc")
    return [
        ("contact nodes", str(problem.p)),
        ("degrees of freedom", f"{problem.n:,}"),
        ("combinations of statuses", _combinations(problem)),
        ("friction", _friction(problem)),
        ("load", parts.with_unit(f"{load}, max |f| = {np.max(np.abs(problem.f)):.4g}", units, 1, 0)),
        ("gap", parts.with_unit(parts.span_words(problem.gap), units, 0, 1)),
        ("alpha", f"from {a:.10g} to {b:.10g}"),
        ("arithmetic", graph.arithmetic),
        ("found", f"{branches}, {arcs}, {counted(len(graph.folds), 'fold')}"),
    ]


def _combinations(problem: ContactProblem | ContactProblem3D) -> str:
    """4^p and its value, rounded where it is long, as far as a float holds it; in 3D 3^p, and what they do not tell."""
    base, p = (4 if isinstance(problem, ContactProblem) else 3), problem.p
    value = f" = {base**p:,}" if p <= 10 else f", about {base**p:.3g}" if p < 500 else ""
    return f"{base}^{p}{value}" + ("" if base == 4 else ", and a direction for every node that slips")


def _friction(problem: ContactProblem | ContactProblem3D) -> str:
    """The coefficients as functions of alpha."""
    if isinstance(problem, ContactProblem):
        return f"F = {parts.span_words(problem.friction)} + alpha {parts.span_words(problem.friction_slope)}"
    slopes = (f" + alpha {parts.span_words(slope)}" if np.any(slope) else "" for slope in problem.friction_slope)
    pairs = enumerate(zip(problem.friction, slopes, strict=True), 1)
    return ", ".join(f"F{k} = {parts.span_words(F)}{slope}" for k, (F, slope) in pairs)


def _branches(graph: BranchGraph) -> str:
    rows = []
    for branch in graph.branches:
        lo, hi = branch.interval
        folds = ", ".join(f"{v.alpha:.8g}" for v in branch.folds)
        indices = ", ".join(sorted({"?" if arc.index is None else f"{arc.index:+d}" for arc in branch.arcs}))
        shape = "sheet (a continuum over an interval)" if branch.sheet else shape_of(branch)
        cells = (str(branch.number), f"{lo:.8g}", f"{hi:.8g}", shape, str(len(branch.arcs)), indices, folds)
        more = () if graph.verdicts is None else (branch_stability(graph, branch),)
        rows.append((f' data-branch="{branch.number}" tabindex="0"', (*cells, *more)))
    if not rows:
        return f"<p>None{'' if graph.complete else ' was found'}.</p>"
    heads = ("branch", "alpha from", "to", "shape", "arcs", "indices", "folds at")
    return parts.table_text("All branches", heads if graph.verdicts is None else (*heads, "stability"), rows)


def _vertices(graph: BranchGraph) -> str:
    found = [v for v in graph.vertices if v.kind is not VertexKind.END]
    if not found:
        return f"<p>None{': no status changes inside the interval' if graph.complete else ' was found'}.</p>"
    meeting: dict[int, list[Any]] = {v.number: [] for v in found}
    for arc in graph.arcs:
        for end in (arc.tail, arc.head):
            if end in meeting:
                meeting[end].append(arc)
    rows = []
    for v in found:
        low, high = v.enclosure
        branches = sorted({graph.branch_of[arc.number] for arc in meeting[v.number]})
        error = "exact" if low == high else f"{float(high - low):.1e}"
        change = _change(graph, v, meeting[v.number])
        cells = (repr(v.alpha), error, v.kind.value, ", ".join(map(str, branches)), change)
        rows.append((f' data-alpha="{v.alpha!r}" tabindex="0"', cells))
    return parts.table_text(
        "Critical alphas", ("alpha", "width of its bounds", "kind", "branches", "what happens"), rows
    )


def _change(graph: BranchGraph, v: Vertex, arcs: Sequence[Any]) -> str:
    """Nodes whose status differs between the arcs that meet there."""
    if v.family is not None:
        return f"a continuum of solutions, dimension {v.family.dimension}"
    labels = graph.problem.node_ids
    parts = []
    for k, label in enumerate(labels):
        seen = list(dict.fromkeys(arc.statuses[k].value for arc in arcs))
        if len(seen) > 1:
            parts.append(f"node {label}: {' / '.join(seen)}")
    more = f" and {len(parts) - 6} more nodes" if len(parts) > 6 else ""
    return "; ".join(parts[:6]) + more


def _certified(graph: BranchGraph) -> list[str]:
    about = f"This is about {parts.CERTIFIED_DATA[graph.certified_data]}."
    if graph.complete:
        known = f"every solution for every alpha of the interval lies on the arcs shown here. {about}"
    elif graph.claims.partly:
        known = (
            "every solution lies on the arcs shown here, for every alpha of the interval but for "
            f"{escape(ranges_text(graph.open_ranges))}. {about}"
        )
    else:
        known = ""
    if known:
        known = f"It is proven that {known}"
    elif graph.reasons:
        known = "Nothing is claimed about solutions that are not shown here."
    else:
        known = "Nothing is proven: the result rests on floating-point arithmetic."
    picture = (
        "This page is a picture of the result and no proof. Curves are drawn between points on the arcs; how exactly "
        "critical alphas are known stands in their table."
    )
    return [known, picture]


# -- what the script draws ---------------------------------------------------------------------------------------------


def report_content(graph: BranchGraph, scene: Scene | None = None) -> dict[str, Any]:
    """Everything that the script needs: nodes, quantities, arcs with points along them, vertices, steps, the body.

    Statuses are texts of one digit per node, places in ``statuses``. ``f`` and ``w`` are forces and displacements of
    the contact nodes, all normal ones, then those along each tangent; of an arc at its points ``a``.
    """
    drawn, tolerance = _sampled(graph)
    steps, (body, missing) = graph.claims.steps(), parts.body_record(graph.problem, scene)
    return {
        "interval": list(graph.interval),
        "complete": graph.complete,
        "exact_counts": steps.exact,
        "open_ranges": [[float(end) for end in ends] for ends in graph.open_ranges] if graph.claims.partly else [],
        "nodes": [str(label) for label in graph.problem.node_ids],
        "statuses": parts.STATUS_NAMES,
        "tangents": 2 if _in_space(graph) else 1,
        "quantities": [item._asdict() for item in QUANTITIES.values()],
        "tolerance": tolerance,
        "arcs": [_arc(arc, graph, drawn.get(arc.number)) for arc in graph.arcs],
        "branches": [
            {"number": branch.number, "colour": colour_of(branch.number), "arcs": [arc.number for arc in branch.arcs]}
            for branch in graph.branches
        ],
        "vertices": [_vertex(v, graph) for v in graph.vertices],
        "steps": {
            "alphas": [float(alpha) for alpha in steps.alphas],
            "at": list(steps.at),
            "between": list(steps.between),
        },
        "beside": _beside(graph, drawn),
        "start": steps.busiest() if steps.alphas else graph.interval[0],
        "slider": slider_alphas([v.alpha for v in graph.vertices], graph.interval),
        "body": body,
        "no_body": missing,
    }


def slider_alphas(critical: Sequence[float], interval: tuple[float, float]) -> list[float]:
    """Positions of the slider: all critical alphas, and between neighbours enough to see what happens there."""
    marks = sorted({*critical, *interval})
    positions = 160  # over the whole interval
    # narrow steps have positions inside, however narrow they are
    few = 1 if len(marks) > positions else 3
    width = interval[1] - interval[0]
    found = [marks[0]]
    for low, high in pairwise(marks):
        count = max(few, round(positions * (high - low) / width))
        inside = [low + (high - low) * k / (count + 1) for k in range(1, count + 1)]
        found += [alpha for alpha in inside if low < alpha < high] + [high]
    return found


def _in_space(graph: BranchGraph) -> bool:
    return not isinstance(graph.problem, ContactProblem)


def _sampled(graph: BranchGraph) -> tuple[dict[int, Curve], float]:
    """Points along all arcs that are no sheets, and the tolerance to which they are near, relative to the picture.

    It is coarser until the page is small enough.
    """
    arcs = [arc for arc in graph.arcs if not arc.dimension]
    width, tolerance = graph.interval[1] - graph.interval[0], 1e-3
    while True:
        drawn = curves(arcs, tuple(QUANTITIES), width, tolerance, components=_in_space(graph))
        numbers = sum(curve.forces.size + curve.moves.size for curve in drawn.values())
        if numbers <= _MOST_NUMBERS or tolerance >= 2e-2:
            return drawn, tolerance
        tolerance *= 2


def _arc(arc: Arc, graph: BranchGraph, curve: Curve | None) -> dict[str, Any]:
    record: dict[str, Any] = {
        "number": arc.number,
        "branch": graph.branch_of[arc.number],
        "tail": arc.tail,
        "head": arc.head,
        "index": arc.index,
        "statuses": parts.status_codes(arc.statuses),
        "dimension": arc.dimension,
        "grazing": arc.grazing,
        "lo": arc.lo,
        "hi": arc.hi,
    }
    if graph.verdicts is not None:
        record["spans"] = [[span.low, span.high, span.verdict] for span in graph.verdicts[arc.number]]
    if curve is not None:
        record |= {
            "a": curve.alphas.tolist(),
            "f": parts.short_list(curve.forces, 9),
            "w": parts.short_list(curve.moves, 9),
        }
    return record


def _vertex(v: Vertex, graph: BranchGraph) -> dict[str, Any]:
    record: dict[str, Any] = {
        "number": v.number,
        "alpha": v.alpha,
        "kind": v.kind.value,
        "border": v.border,
        "statuses": parts.status_codes(v.statuses),
        "several": [k for k, holds in enumerate(v.active) if len(holds) > 1],
        "f": parts.short_list(np.concatenate([v.lambda_n, v.lambda_t.ravel(order="F")]), 9),
        "w": parts.short_list(np.concatenate([v.u_n, v.u_t.ravel(order="F")]), 9),
        "family": None,
    }
    if v.family is not None:
        forces, moves = family_states(graph.problem, v.alpha, v.family)
        record["family"] = {
            "f": parts.short_list(forces, 9),
            "w": parts.short_list(moves, 9),
            "dimension": v.family.dimension,
        }
    return record


def _beside(graph: BranchGraph, drawn: Mapping[int, Curve]) -> dict[str, dict[str, list[int]]]:
    """Arcs that coincide with others, by columns of the quantities: rank among them, and how many they are."""
    if not drawn:
        return {}
    overviews = sum(not item.by_node for item in QUANTITIES.values())
    columns = overviews + graph.problem.p * (len(QUANTITIES) - overviews)
    found = {}
    for column in range(columns if len(drawn) <= 300 else overviews):  # of more arcs, all columns take too long
        places = side_by_side(drawn, graph.branch_of, column)
        several = {str(arc): [place.rank, place.among] for arc, place in places.items() if place.among > 1}
        if several:
            found[str(column)] = several
    return found
