"""Branch graphs as JSON files, read back to the last bit, and as GraphML for other programs."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, fields
from fractions import Fraction
from functools import cache, partial
from io import BytesIO
from typing import TYPE_CHECKING, Any, TypeVar

import networkx as nx
import numpy as np
import scipy.sparse as sp
from flint import fmpq, fmpz, fmpz_poly

from enumsol.arithmetic.algebraic import CriticalAlpha, EnclosedAlpha
from enumsol.branches.elements import Arc, ArcValues, Vertex, VertexKind
from enumsol.branches.enclosed.following import TracedArcValues, TracedProblem
from enumsol.branches.gluing import ExactArcValues
from enumsol.branches.graph_data import VERDICTS, GraphData, GraphStats, about_stability, verdict_words
from enumsol.condensation.enclosure import enclosure_of
from enumsol.condensation.exact import ExactCondensed
from enumsol.condensation.unloaded import vanishing_alpha
from enumsol.errors import InvalidArgumentError
from enumsol.model.mesh import BodyMesh
from enumsol.model.problem import ContactProblem
from enumsol.model.problem3d import ContactProblem3D
from enumsol.model.statuses import ContactStatus
from enumsol.roots.root import Polytope, RootFamily
from enumsol.support.arguments import file_path
from enumsol.support.files import reading, write_file
from enumsol.support.saved import Array, Maybe, check_kind, check_shape, is_fraction, is_label, is_number, json_from

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from enumsol.branches.stability import Span
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Codes, Floats

_Graph = TypeVar("_Graph", bound=GraphData)
FORMAT, VERSION = "enumsol-branch-graph", 3
#: Contact rows in 3D, and in 2D.
_ROWS = ("Bn", "Bt1", "Bt2"), ("Bn", "Bt")
#: Arrays of a vertex.
_VALUES = ("lambda_n", "lambda_t", "u_n", "u_t")
#: What the file holds of an arc as it is.
_OF_ARC = ("tail", "head", "index", "dimension", "grazing")
_WHOLE = re.compile(r"-?[0-9]{1,100000}", re.ASCII)
_STATUS = {status.value for status in ContactStatus}
_MATRIX = {"shape": (range(1 << 62),) * 2, "row": Array(None), "col": Array(None), "value": Array(None)}
#: Kinds of what the file holds of the problem; numbers and shapes of its arrays are checked where it is made of them.
_PROBLEM = {
    **dict.fromkeys(("A", "Bn"), _MATRIX),
    **dict.fromkeys(("Bt?", "Bt1?", "Bt2?"), _MATRIX),
    "f": Array(None),
    "node_ids": [is_label],
    "mass?": _MATRIX,
    "mesh?": Maybe({"motion": _MATRIX}),
    "max_rigid_displacement?": Maybe(float),
}


def save_graph(data: GraphData, file: str | Path) -> None:
    """Write the graph with its problem to a JSON file, all numbers to the last bit; ``load`` reads it."""
    record = {
        "format": FORMAT,
        "version": VERSION,
        "problem": _problem_record(data.problem),
        "arcs_by": data.arcs_by,
        "condensed_exactly": data.certified_data == "problem",
        "interval": [str(end) for end in data.exact_interval],
        "arithmetic": data.arithmetic,
        "reasons": list(data.undecided),
        **({} if data.left_open is None else {"left_open": [list(map(str, ends)) for ends in data.left_open]}),
        "stats": asdict(data.stats),
        "vertices": [_vertex_record(v) for v in data.vertices],
        "arcs": [_arc_record(arc, data.vertices) for arc in data.arcs],
        **({} if data.verdicts is None else {"verdicts": [list(map(asdict, spans)) for spans in data.verdicts]}),
    }
    write_file(file_path(file, "file"), json.dumps(record), "file")


def load_graph(kind: type[_Graph], file: str | Path) -> _Graph:
    """Read a graph that save_graph wrote as an object of that class (see BranchGraph.load).

    Raises
    ------
    InvalidArgumentError
        The file cannot be read or is not such a graph.
    """
    place = file_path(file, "file")
    with reading(place, "a graph", "BranchGraph.save"):
        content = place.read_bytes()
        record = json_from(content)
        if not isinstance(record, dict) or (record.get("format"), record.get("version")) != (FORMAT, VERSION):
            raise InvalidArgumentError(f"graph {file} has another format; expected {FORMAT}, version {VERSION}")
        return _from_record(kind, record, len(content))


def _from_record(kind: type[_Graph], record: dict[str, Any], size: int) -> _Graph:
    check_kind(record["problem"], _PROBLEM, "problem")
    problem = _problem(record["problem"], size)
    check_kind(record, _graph_kind(problem, record["vertices"]), "graph")
    first, last = (Fraction(end) for end in record["interval"])
    exact, values = _values(problem, record, (first, last))
    balls = exact is None
    vertices = tuple(_vertex(k, item, balls=balls) for k, item in enumerate(record["vertices"]))
    arcs = tuple(_arc(k, item, vertices, values(item)) for k, item in enumerate(record["arcs"]))
    reasons, stats = tuple(record["reasons"]), GraphStats(**record["stats"])
    left_open = None
    if "left_open" in record:
        left_open = tuple((Fraction(low), Fraction(high)) for low, high in record["left_open"])
    named = record["arithmetic"]
    graph = kind(problem, exact, (first, last), named, vertices, arcs, reasons, stats, left_open=left_open)
    if "verdicts" in record:
        graph._found["read"] = _verdicts(record["verdicts"], arcs)
    return graph


def _verdicts(record: list[Any], arcs: Sequence[Arc]) -> list[tuple[Span, ...]]:
    """Verdicts as a file has them, from end to end of every arc."""
    from enumsol.branches.stability import Span  # sparse graphs and solvers come with it

    found = []
    for arc, items in zip(arcs, record, strict=True):
        spans = []
        for item in items:
            growth = None if item["growth"] is None else (float(item["growth"][0]), float(item["growth"][1]))
            spans.append(Span(float(item["low"]), float(item["high"]), item["verdict"], growth))
        places = [arc.lo, *(place for span in spans for place in (span.low, span.high)), arc.hi]
        if not spans or places[::2] != places[1::2] or places != sorted(places):
            raise ValueError(f"the verdicts of arc {arc.number}")
        found.append(tuple(spans))
    return found


def _graph_kind(problem: AnyProblem, vertices: object) -> dict[str, Any]:
    """Kinds of what the file holds beside the problem."""
    plane, p = isinstance(problem, ContactProblem), problem.p
    statuses, vector = ({*_STATUS},) * p, Array(p)
    pair, tangent = (is_fraction,) * 2, vector if plane else Array(p, 2)
    selections = [(range(10 if plane else 1 << 62),) * p]
    family = {
        "statuses": statuses,
        "vertices": Array(None, p, 2),
        "dimension": range(3 * p + 7),
        "rigid_coordinates?": Array(None, problem.modes.r),
    }
    vertex = {
        **dict.fromkeys(("lo", "hi"), is_fraction),
        **{"alpha": float, "kind": {kind.value for kind in VertexKind}, "border": bool, "bounded?": bool},
        **{"polynomial": Maybe([_is_whole]), "statuses": statuses, "active": ([{*_STATUS}],) * p},
        **dict(zip(_VALUES, (vector, tangent) * 2, strict=True)),
        **{"family": Maybe([family]), "selections": selections},
        **dict.fromkeys(("family_index", "index_left", "index_right"), Maybe(int)),
    }
    ends = range(len(vertices) if isinstance(vertices, list) else 0)
    arc = {
        **{"statuses": statuses, "selections": selections, "sample": is_fraction, "from?": is_fraction},
        **{"to?": is_fraction, "tail": ends, "head": ends, "index": Maybe(int), "grazing": bool},
        **{"dimension": range(3 * p + 7)},
        **dict.fromkeys(("knots?", "borders?"), Array(None, _unknowns(problem) + 1)),
    }
    return {
        **{"interval": pair, "left_open?": [pair], "arithmetic": {"verified", "exact", "fast"}, "reasons": [str]},
        **{"arcs_by": {"exact", "balls"}, "condensed_exactly": bool, "vertices": [vertex], "arcs": [arc]},
        "verdicts?": [[{"low": float, "high": float, "verdict": {*VERDICTS}, "growth": Maybe((float, float))}]],
        "stats": dict.fromkeys((f"{item.name}?" for item in fields(GraphStats)), is_number),
    }


def _unknowns(problem: AnyProblem) -> int:
    """Number of forces in 3D, and of coordinates of a rigid displacement."""
    return 3 * problem.p + problem.modes.r


def _is_whole(value: object) -> bool:
    return type(value) is str and _WHOLE.fullmatch(value) is not None


def _values(
    problem: AnyProblem, record: dict[str, Any], interval: tuple[Fraction, Fraction]
) -> tuple[ExactCondensed | None, Callable[[dict[str, Any]], ArcValues]]:
    """The condensed problem in rationals, if arcs rest on it, and what gives the arc of a record its values."""
    if not isinstance(problem, ContactProblem):
        from enumsol.branches.space.make_curved import CurvedArcValues  # for graphs in 3D only
        from enumsol.trusted.space.solution_curve import AlphaProblem

        @cache
        def given() -> AlphaProblem:
            """Made for the first arc: a graph without any may be one of a problem that has no such form."""
            return AlphaProblem.of(enclosure_of(problem))

        def along(item: dict[str, Any]) -> ArcValues:
            codes, knots = tuple(item["selections"][0]), np.array(item["knots"], dtype=np.float64)
            borders = np.array(item["borders"], dtype=np.float64)
            size = _unknowns(problem) + 1
            if knots.shape != (len(borders) + 1, size) or borders.shape[1:] != (size,):
                raise ValueError("knots of an arc")
            return CurvedArcValues(given(), problem, codes, knots, borders)

        return None, along

    def of_selection(make: Callable[[Codes, Fraction], ArcValues], item: dict[str, Any]) -> ArcValues:
        return make(tuple(item["selections"][0]), Fraction(item["sample"]))

    if record["arcs_by"] == "balls":
        traced = cache(lambda: TracedProblem(problem, interval, vanishing_alpha(problem, "problem")))
        return None, partial(of_selection, lambda codes, sample: TracedArcValues(traced(), codes, sample))
    exactly = record["condensed_exactly"]
    exact = ExactCondensed.from_problem(problem) if exactly else ExactCondensed.from_condensed(problem)
    return exact, partial(of_selection, partial(ExactArcValues, exact))


# -- the problem -------------------------------------------------------------------------------------------------------


def _problem_record(problem: AnyProblem) -> dict[str, Any]:
    plane, mesh = isinstance(problem, ContactProblem), problem.mesh
    record = {
        **{name: _matrix_record(getattr(problem, name)) for name in (*_ROWS[plane], "A")},
        **{name: getattr(problem, name).tolist() for name in ("f", "gap", "slip_offset")},
        # of saved graphs in 2D, "friction" has F0 and F1 of F0 + alpha F1
        "friction": [part.tolist() for part in (problem.affine_friction if plane else problem.friction)],
        "load_slope": _listed(problem.load_slope),
        "node_ids": list(problem.node_ids),
        "coordinates": _listed(problem.coordinates),
        "mesh": None,
    }
    if not isinstance(problem, ContactProblem):
        record["friction_slope"] = [part.tolist() for part in problem.friction_slope]
        record["areas"] = _listed(problem.areas)
    if problem.rigid_modes is not None:
        record["rigid_modes"] = problem.rigid_modes.tolist()
        record["max_rigid_displacement"] = problem.max_rigid_displacement
    if problem.mass is not None:
        record["mass"] = _matrix_record(problem.mass)
    if mesh is not None:
        arrays = {name: _listed(getattr(mesh, name)) for name in ("points", "cells", "offset")}
        more = {name: own.tolist() for name in _MATERIAL if (own := getattr(mesh, name)) is not None}
        record["mesh"] = arrays | {"motion": _matrix_record(mesh.motion)} | more
    return record


#: Arrays of the material of a mesh.
_MATERIAL = ("lame", "elasticity", "initial_stress", "stress_slope")


def _listed(array: Floats | None) -> list[Any] | None:
    return None if array is None else array.tolist()


def _matrix_record(matrix: sp.sparray) -> dict[str, Any]:
    coo = sp.coo_array(matrix)
    rows, columns = coo.coords
    return {"shape": list(coo.shape), "row": rows.tolist(), "col": columns.tolist(), "value": coo.data.tolist()}


def _problem(record: dict[str, Any], size: int) -> AnyProblem:
    def matrix(item: dict[str, Any]) -> sp.csc_array:
        check_shape("a matrix", item["shape"], size)
        return sp.csc_array(sp.coo_array((item["value"], (item["row"], item["col"])), shape=tuple(item["shape"])))

    def pair(name: str) -> tuple[Any, Any]:
        one, other = (np.array(part, dtype=np.float64) for part in record[name])
        return one, other

    more: dict[str, Any] = {
        "gap": record["gap"],
        "friction": pair("friction"),
        "load_slope": record["load_slope"],
        "slip_offset": record["slip_offset"],
        "node_ids": record["node_ids"],
        "coordinates": record["coordinates"],
        "mesh": None
        if (mesh := record.get("mesh")) is None
        else BodyMesh(
            mesh["points"],
            mesh["cells"],
            matrix(mesh["motion"]),
            mesh["offset"],
            **{name: mesh[name] for name in _MATERIAL if name in mesh},
        ),
        "rigid_modes": record.get("rigid_modes"),
        "max_rigid_displacement": record.get("max_rigid_displacement"),
        "mass": matrix(record["mass"]) if "mass" in record else None,
    }
    plane = "Bt" in record
    matrices: Any = [matrix(record[name]) for name in ("A", *_ROWS[plane])]
    data: Any = (*matrices, record["f"])
    if plane:
        more["friction"], more["friction_slope"] = pair("friction")
        return ContactProblem(*data, **more)
    more |= {"friction_slope": pair("friction_slope"), "areas": record["areas"]}
    return ContactProblem3D(*data, **more)


# -- vertices and arcs -------------------------------------------------------------------------------------------------


def _names(statuses: Sequence[ContactStatus]) -> list[str]:
    return [status.value for status in statuses]


def _statuses(names: Sequence[str]) -> tuple[ContactStatus, ...]:
    return tuple(ContactStatus(name) for name in names)


def _vertex_record(v: Vertex) -> dict[str, Any]:
    lo, hi = v.enclosure
    family = None
    if v.family is not None:
        family = [
            {"statuses": _names(part.statuses), "vertices": part.vertices.tolist(), "dimension": part.dimension}
            | ({} if part.rigid_coordinates is None else {"rigid_coordinates": part.rigid_coordinates.tolist()})
            for part in v.family.polytopes
        ]
    return {
        "alpha": v.alpha,
        "lo": str(lo),
        "hi": str(hi),
        "polynomial": None if v.exact.poly is None else [str(c) for c in v.exact.poly.coeffs()],
        "kind": v.kind.value,
        "border": v.border,
        "statuses": _names(v.statuses),
        "active": [sorted(_names(tuple(names))) for names in v.active],
        **{name: getattr(v, name).tolist() for name in _VALUES},
        "family": family,
        "family_index": None if v.family is None else v.family.index,
        "index_left": v.index_left,
        "index_right": v.index_right,
        "selections": [list(codes) for codes in v.selections],
        **({"bounded": True} if v.bounded else {}),
    }


def _vertex(number: int, item: dict[str, Any], *, balls: bool) -> Vertex:
    lo, hi = (fmpq(*Fraction(item[end]).as_integer_ratio()) for end in ("lo", "hi"))
    coefficients = item["polynomial"]
    poly = None if coefficients is None else fmpz_poly([fmpz(c) for c in coefficients])
    if lo > hi or (poly is not None and poly(lo) * poly(hi) >= 0) or (poly is None and not balls and lo != hi):
        raise ValueError(f"the bounds of vertex {number}")
    family = None
    if item["family"] is not None:
        parts = [
            Polytope(
                _statuses(part["statuses"]),
                np.array(part["vertices"]),
                part["dimension"],
                np.array(part["rigid_coordinates"]) if "rigid_coordinates" in part else None,
            )
            for part in item["family"]
        ]
        family = RootFamily(item["alpha"], tuple(parts), item["family_index"], vertices_proven=True)
    return Vertex(
        number=number,
        alpha=item["alpha"],
        kind=VertexKind(item["kind"]),
        border=item["border"],
        statuses=_statuses(item["statuses"]),
        active=tuple(frozenset(_statuses(names)) for names in item["active"]),
        **{name: np.array(item[name]) for name in _VALUES},
        family=family,
        index_left=item["index_left"],
        index_right=item["index_right"],
        selections=tuple(tuple(codes) for codes in item["selections"]),
        exact=EnclosedAlpha(lo, hi) if balls else CriticalAlpha(poly, lo, hi),
        bounded=item.get("bounded", False),
    )


def _arc_record(arc: Arc, vertices: Sequence[Vertex]) -> dict[str, Any]:
    return {
        "statuses": _names(arc.statuses),
        **{name: getattr(arc, name) for name in _OF_ARC},
        "selections": [list(codes) for codes in arc.selections],
        "sample": str(arc.sample),
        **arc._values.record(),
        # beside a place that was left open; elsewhere an arc reaches up to its vertices
        **{
            name: str(end.enclosure()[0])
            for name, end, number in (("from", arc.begin, arc.tail), ("to", arc.end, arc.head))
            if end is not vertices[number].exact
        },
    }


def _arc(number: int, item: dict[str, Any], vertices: Sequence[Vertex], values: ArcValues) -> Arc:
    selections = tuple(tuple(codes) for codes in item["selections"])
    sample = Fraction(item["sample"])
    lo, begin = _arc_end(item.get("from"), vertices[item["tail"]])
    hi, end = _arc_end(item.get("to"), vertices[item["head"]])
    return Arc(
        number=number,
        statuses=_statuses(item["statuses"]),
        lo=lo,
        hi=hi,
        **{name: item[name] for name in _OF_ARC},
        selections=selections,
        begin=begin,
        end=end,
        sample=sample,
        _values=values,
    )


def _arc_end(known: str | None, vertex: Vertex) -> tuple[float, CriticalAlpha]:
    """End of an arc: at its vertex, or beside it as far as it is known to hold."""
    if known is None:
        return vertex.alpha, vertex.exact
    value = fmpq(*Fraction(known).as_integer_ratio())
    return float(Fraction(known)), EnclosedAlpha(value, value)


# -- other programs ----------------------------------------------------------------------------------------------------


def write_graphml(data: GraphData, file: str | Path) -> None:
    """Write vertices and arcs as GraphML for other graph programs (arrays at the vertices as text, no functions).

    In 3D the tangential arrays have both components of a node after each other.
    """
    words = verdict_words(data)
    told = {"stability": about_stability(data)} if words else {}
    plain = nx.MultiGraph(complete=data.complete, standing=data.claims.standing.value, **told)
    for v in data.vertices:
        plain.add_node(
            v.number,
            alpha=v.alpha,
            kind=v.kind.value,
            statuses=" ".join(_names(v.statuses)),
            **{name: " ".join(map(repr, np.ravel(getattr(v, name)).tolist())) for name in _VALUES},
        )
    for arc in data.arcs:
        plain.add_edge(
            arc.tail,
            arc.head,
            key=arc.number,
            alpha_from=arc.lo,
            alpha_to=arc.hi,
            statuses=" ".join(_names(arc.statuses)),
            index="" if arc.index is None else str(arc.index),
            dimension=arc.dimension,
            branch=data.branch_of[arc.number],
            **({"stability": words[arc.number]} if words else {}),
        )
    text = BytesIO()
    nx.write_graphml(plain, text)
    write_file(file_path(file, "file"), text.getvalue(), "file")
