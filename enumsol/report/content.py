"""Contents of the page of a graph, as plain values that JSON can hold; the page's script draws them."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.elements import Arc, Vertex, VertexKind
from enumsol.branches.figures.curves import QUANTITIES, Curve, curves, side_by_side
from enumsol.branches.figures.marks import colour_of
from enumsol.branches.figures.panels import family_states
from enumsol.model.problem import ContactProblem
from enumsol.report.body import body_record
from enumsol.report.parts import STATUS_NAMES, status_codes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.branches import BranchGraph
    from enumsol.fem import Scene
    from enumsol.support.array_types import ArrayLike


def report_content(graph: BranchGraph, scene: Scene | None = None) -> dict[str, Any]:
    """Everything that the script needs: nodes, quantities, arcs with points along them, vertices, steps, the body.

    Statuses are texts of one digit per node, places in ``statuses``. ``f`` and ``w`` are forces and displacements of
    the contact nodes, all normal ones, then those along each tangent; of an arc at its points ``a``.
    """
    drawn, tolerance = _sampled(graph)
    steps, (body, missing) = graph.claims.steps(), body_record(graph.problem, scene)
    return {
        "interval": list(graph.interval),
        "complete": graph.complete,
        "exact_counts": steps.exact,
        "open_ranges": [[float(end) for end in ends] for ends in graph.open_ranges] if graph.claims.partly else [],
        "nodes": [str(label) for label in graph.problem.node_ids],
        "statuses": STATUS_NAMES,
        "tangents": 2 if _in_space(graph) else 1,
        "quantities": [item._asdict() for item in QUANTITIES.values()],
        "tolerance": tolerance,
        "arcs": [_arc(arc, graph.branch_of[arc.number], drawn.get(arc.number)) for arc in graph.arcs],
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


def rounded_list(values: ArrayLike) -> Any:
    """Numbers of an array to nine digits, as lists."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim:
        return [rounded_list(row) for row in array]
    number = float(f"{float(array):.9g}")
    return int(number) if number.is_integer() and abs(number) < 1e15 else number


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

    It is coarser until the page is small enough: a number takes about ten characters.
    """
    arcs = [arc for arc in graph.arcs if not arc.dimension]
    width, tolerance = graph.interval[1] - graph.interval[0], 1e-3
    while True:
        drawn = curves(arcs, tuple(QUANTITIES), width, tolerance, components=_in_space(graph))
        numbers = sum(curve.forces.size + curve.moves.size for curve in drawn.values())
        if numbers <= 250_000 or tolerance >= 2e-2:
            return drawn, tolerance
        tolerance *= 2


def _arc(arc: Arc, branch: int, curve: Curve | None) -> dict[str, Any]:
    record = {
        "number": arc.number,
        "branch": branch,
        "tail": arc.tail,
        "head": arc.head,
        "index": arc.index,
        "statuses": status_codes(arc.statuses),
        "dimension": arc.dimension,
        "grazing": arc.grazing,
        "lo": arc.lo,
        "hi": arc.hi,
    }
    if curve is not None:
        record |= {"a": curve.alphas.tolist(), "f": rounded_list(curve.forces), "w": rounded_list(curve.moves)}
    return record


def _vertex(v: Vertex, graph: BranchGraph) -> dict[str, Any]:
    record: dict[str, Any] = {
        "number": v.number,
        "alpha": v.alpha,
        "kind": v.kind.value,
        "border": v.border,
        "statuses": status_codes(v.statuses),
        "several": [k for k, holds in enumerate(v.active) if len(holds) > 1],
        "f": rounded_list(np.concatenate([v.lambda_n, v.lambda_t.ravel(order="F")])),
        "w": rounded_list(np.concatenate([v.u_n, v.u_t.ravel(order="F")])),
        "family": None,
    }
    if v.family is not None:
        forces, moves = family_states(graph.problem, v.alpha, v.family)
        record["family"] = {"f": rounded_list(forces), "w": rounded_list(moves), "dimension": v.family.dimension}
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


def listed(graph: BranchGraph) -> list[Vertex]:
    """Vertices worth a row in a table: all but the ends of the interval."""
    return [v for v in graph.vertices if v.kind is not VertexKind.END]
