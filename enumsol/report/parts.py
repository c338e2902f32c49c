"""The frame of all pages of reports: the problem as given, its body, what is certified; tables and short texts."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import scipy.sparse as sp

from enumsol._version import find_version
from enumsol.errors import MissingDependencyError
from enumsol.model.cells import boundary, boundary_facets, edges_of, facet_outlines, outline_edges
from enumsol.model.shapes import (
    SIGNS,
    acting_nodes,
    body_mesh,
    first_view,
    row_frames,
    row_tangents,
    row_weights,
    signs,
)
from enumsol.model.statuses import ContactStatus

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.branches import BranchGraph
    from enumsol.fem import Scene
    from enumsol.loading.history import History
    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root_set import RootSet
    from enumsol.support.array_types import ArrayLike, Floats, Integers

#: Most numbers of displacements, and of contact forces in tables, about ten characters each; a mesh with more is drawn
#: by its boundary, or not at all.
MOST_NUMBERS = 150_000
#: Squares of directions below this are rounding, and directions.
_ROUNDING = 1e-9


def body_record(problem: AnyProblem, scene: Scene | None = None) -> tuple[dict[str, Any] | None, str]:
    """Drawing of a body of d dimensions and its motion; and the reason why a part is missing, else empty.

    Displacements of the nodes, d components in turn, are ``u0 + alpha u1 - sum_k f_k c[k]`` over the d p contact
    forces; a unit of force k acts on nodes as ``acts[k]``, each the node and d components. Of solids there are stresses
    ``s0 + alpha s1 - sum_k f_k s[k]`` of the cells at the facets of the surface, six each, if the page holds them.
    """
    if problem.mesh is None:
        body, why = bare_nodes(problem)
        if body is None:
            return None, why
        still = [0] * (3 * problem.p)
        return body | {"u0": still, "u1": still, "c": [[]] * len(still), "acts": [[]] * len(still)}, why
    if not problem.held:
        return None, "Nothing holds the body, and arcs do not say how far it moves as a whole; roots_at(alpha) does"
    mesh = problem.mesh
    d = mesh.points.shape[1]
    columns = d * problem.p + 2
    body, nodes = drawn_body(problem, columns, scene)
    if columns > most_fields(len(nodes), d):
        return None, (
            f"The mesh is too large to draw: the displacements of {len(nodes):,} nodes on its boundary by "
            f"{d * problem.p:,} contact forces and the load are {d * len(nodes) * columns:,} numbers, and a page holds "
            f"at most {MOST_NUMBERS:,}"
        )
    motion = sp.csr_array(mesh.motion[(d * nodes[:, None] + np.arange(d)).ravel()])
    solved = [problem.factorization.solve(np.asarray(column)) for column in _loads(problem)]
    moved = [motion @ column for column in solved]
    if mesh.offset is not None:
        moved[0] = moved[0] + mesh.offset[nodes].ravel()
    forces = -sp.csr_array(problem.contact_rows @ mesh.acting.T).toarray().reshape(d * problem.p, -1, d)
    return body | _stress_columns(problem, solved) | {
        "u0": short_list(moved[0]),
        "u1": short_list(moved[1]),
        "c": [short_list(column) for column in moved[2:]],
        "acts": [vectors(force, nodes) for force in forces],
    }, ""


def _stress_columns(problem: AnyProblem, solved: Sequence[Floats]) -> dict[str, Any]:
    """Stresses on the surface of a solid by columns, as displacements are given, if the page holds them."""
    of = surface_stresses(problem, len(solved))
    if of is None:
        return {}
    still = of(np.zeros(problem.n))
    first, *others = [short_list(of(column) - still * (k > 0)) for k, column in enumerate(solved)]
    return {"s0": first, "s1": others[0], "s": others[1:]}


def surface_stresses(problem: AnyProblem, columns: int) -> Callable[[Floats], Floats] | None:
    """The function from u to stresses of the cells at the facets of a solid's surface, xx, yy, zz, yz, zx, xy in turn.

    None for a plane body, for one of which no material is known, and where a page does not hold so many columns.
    """
    mesh = body_mesh(problem)
    if mesh.points.shape[1] != 3 or not mesh.has_material:
        return None
    _, cells = boundary(3, mesh.cells)
    if 6 * len(cells) * columns > MOST_NUMBERS:
        return None
    from enumsol.fem import cell_stresses  # scikit-fem takes a while

    return lambda u: np.asarray(cell_stresses(problem, u)[cells][:, [0, 1, 2, 1, 2, 0], [0, 1, 2, 2, 0, 1]]).ravel()


def most_fields(nodes: int, d: int) -> int:
    """Number of fields of displacements, of d components at so many nodes, that a page holds."""
    return MOST_NUMBERS // (d * nodes)


def drawn_body(problem: AnyProblem, columns: int, scene: Scene | None = None) -> tuple[dict[str, Any], Integers]:
    """Drawing of a body apart from any solution, and the numbers of the drawn nodes in its mesh.

    ``points`` are the drawn nodes; contact row i stands at the mean of nodes ``rows[i]``, pairs (node, weight). Of a
    plane body there are cells, or the edges of its boundary if ``columns`` numbers for every component of every node
    are more than the page holds, and what `surroundings` gives; of a solid triangles and edges of its surface, and the
    ``tangents`` of the contact rows, two vectors each, and a ``view``, the direction out of the body from which its
    contact surface is seen best. What `surroundings` gives is about a solid, too.
    """
    mesh = body_mesh(problem)
    cells, d, new = mesh.cells, mesh.points.shape[1], np.full(len(mesh.points), -1)
    touched = np.unique(sp.csr_array(problem.contact_rows @ mesh.acting.T).indices // d)
    if d == 3:
        faces = facet_outlines(boundary_facets(3, cells))
        nodes = np.union1d(faces, touched)
    else:
        cells = facet_outlines(cells)
        edges, nodes = boundary_edges(cells), np.arange(len(new))
        if columns > most_fields(len(new), d):
            nodes = np.union1d(edges, touched)
    new[nodes] = np.arange(len(nodes))
    body = {"points": short_list(mesh.points[nodes]), "rows": _rows(row_weights(problem), nodes), "size": mesh.size}
    if d == 3:
        more = surroundings(problem, new, edges_of(faces), scene) | {
            "tangents": short_list(row_tangents(problem)),
            "view": short_list(first_view(row_frames(problem)[:, 0])),
        }
        if mesh.lame is not None:
            more["mu"] = float(np.max(mesh.lame[:, 1]))
        return body | _surface(mesh, faces, new) | more, nodes
    whole = len(nodes) == len(new)
    return body | {
        "cells": new[cells].tolist() if whole else None,
        "lines": None if whole else new[edges].tolist(),
        "rim": new[edges].tolist(),
        **surroundings(problem, new, edges, scene),
        **_foundation(problem),
    }, nodes


def _surface(mesh: BodyMesh, faces: Integers, new: Integers) -> dict[str, Any]:
    """Triangles and edges of the surface of a solid."""
    outline = outline_edges(mesh.points, faces)
    fan = np.concatenate([faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)])
    fan = fan[fan[:, 1] != fan[:, 2]]  # outlines of fewer nodes than others repeat their last
    return {
        "triangles": new[fan].T.tolist(),
        # of many facets only the edges at which the surface bends
        "edges": new[edges_of(faces) if len(faces) <= 2_000 else outline].tolist(),
        "outline": new[outline].tolist(),
    }


def bare_nodes(problem: AnyProblem) -> tuple[dict[str, Any] | None, str]:
    """Drawing of a problem without a mesh: in 3D contact nodes at their coordinates; and what is not drawn."""
    places = problem.coordinates
    if not hasattr(problem, "Bt2"):
        return None, "The problem has no mesh, so no body is drawn"
    if places is None:
        return None, "The problem has no mesh and no coordinates, so no body is drawn"
    size = float(np.max(np.ptp(places, axis=0)))
    if not size > 0:
        return None, "The problem has no mesh, and all its contact nodes are at one place: no body is drawn"
    rows = [[[k, 1]] for k in range(len(places))]
    body = {"points": short_list(places), "rows": rows, "size": size, "triangles": None, "edges": [], "outline": []}
    return body, "The problem has no mesh: its contact nodes are drawn at their coordinates, without forces"


def surroundings(problem: AnyProblem, new: Integers, edges: Integers, scene: Scene | None = None) -> dict[str, Any]:
    """Load, supports and springs of a body, for the page: of many nodes side by side some stand for all.

    ``new`` is the number of every node among those that are drawn, -1 for others; ``edges`` are those of the boundary.
    ``load`` has a place, forces and their derivatives with respect to alpha, d numbers each, ``summed`` whether some
    of it is the sum over several nodes; ``held`` a node and a direction in which it cannot move, or zeros for several;
    ``springs`` nodes.
    """
    mesh = body_mesh(problem)
    motion, (count, d) = mesh.motion, mesh.points.shape
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    # what nothing is coupled with is held, or moved as alpha says
    coupled = np.diff(problem.A.indptr) > 1
    forces = np.hstack([(mesh.acting @ np.where(coupled, own, 0.0)).reshape(-1, d) for own in (problem.f, slope)])
    acting = acting_nodes(forces)
    if len(np.setdiff1d(acting, edges)) > SIGNS:  # a weight: its resultant
        weights = np.linalg.norm(forces[acting], axis=1)
        load = np.hstack([weights @ mesh.points[acting] / weights.sum(), forces.sum(axis=0)])[None, :]
        summed = True
    else:
        shown = signs(mesh.points, acting, edges)
        load = np.array([[*mesh.points[node], *forces[group].sum(axis=0)] for node, group in shown])
        summed = len(shown) < len(acting)
    axes = [motion[k::d] for k in range(d)]
    free = np.array([[np.asarray(a.multiply(b).sum(axis=1)).ravel() for a in axes] for b in axes])
    sizes, ways = np.linalg.eigh(free.transpose(2, 0, 1))
    fixed = np.sum(sizes < _ROUNDING, axis=1)
    across = np.where((fixed == 1)[:, None], ways[:, :, 0], 0.0) + 0.0
    across[np.abs(across) < _ROUNDING] = 0.0
    across *= np.where(across[np.arange(count), np.argmax(np.abs(across), axis=1)] < 0, -1.0, 1.0)[:, None]
    drawn = new >= 0
    held: list[Any] = []
    for kind in np.unique(across[(fixed > 0) & drawn].round(6), axis=0):
        alike = np.flatnonzero((fixed > 0) & drawn & np.all(across.round(6) == kind, axis=1))
        held += [[int(new[k]), *short_list(across[k])] for k, _ in signs(mesh.points, alike, edges)]
    sprung: Any = [] if scene is None else acting_nodes(scene.springs.diagonal()[: count * d].reshape(count, d))
    sprung = np.array([node for node in sprung if drawn[node]], dtype=int)
    springs = [int(new[node]) for node, _ in signs(mesh.points, sprung, edges)]
    return {"load": short_list(load), "summed": summed, "held": held, "springs": springs}


def _foundation(problem: AnyProblem) -> dict[str, Any]:
    """Foundation and material of a plane body.

    ``walls`` has (row, x, y, gap), normals of the rigid foundation; ``lame`` the coefficients of the cells, one pair if
    all are the same.
    """
    mesh = body_mesh(problem)
    normals = np.asarray(problem.Bn @ mesh.acting.T @ np.tile(np.eye(2), (len(mesh.points), 1)))
    walls = [
        [k, *short_list([*normal, problem.gap[k]])]
        for k, normal in enumerate(normals)
        if abs(normal @ normal - 1.0) < _ROUNDING  # rows of two bodies add up to nothing
    ]
    lame = mesh.lame
    if lame is not None and np.all(lame == lame[0]):
        lame = lame[:1]
    return {"walls": walls, "lame": None if lame is None else short_list(lame)}


def _loads(problem: AnyProblem) -> list[Floats]:
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    return [problem.f, slope, *problem.contact_rows.toarray()]


def _rows(weights: sp.csr_array, nodes: Integers) -> list[list[list[float]]]:
    """At which mean of drawn nodes every contact row stands: pairs (node, weight)."""
    weights = sp.csr_array(weights[:, nodes])
    parts = zip(weights.indptr[:-1], weights.indptr[1:], strict=True)
    return [
        [
            [int(node), float(f"{weight:.6g}")]
            for node, weight in zip(weights.indices[a:b], weights.data[a:b], strict=True)
        ]
        for a, b in parts
    ]


def vectors(forces: Floats, nodes: Integers) -> list[list[float]]:
    """Forces that are not zero on drawn nodes: node and components."""
    return [[int(k), *short_list(forces[nodes[k]])] for k in np.flatnonzero(np.any(forces[nodes] != 0, axis=1))]


def boundary_edges(outlines: Integers) -> Integers:
    """Edges that belong to one cell only, (k, 2)."""
    edges = np.concatenate([outlines[:, [k, (k + 1) % outlines.shape[1]]] for k in range(outlines.shape[1])])
    edges = edges[edges[:, 0] != edges[:, 1]]  # outlines of fewer nodes than others repeat their last
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(edges[first[count == 1]])


def short_list(values: ArrayLike, digits: int = 7) -> Any:
    """Numbers to so many digits, as lists; zeros lose their sign and integers their point."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim > 1:
        return [short_list(row, digits) for row in array]
    numbers = [float(f"{x:.{digits}g}") for x in array.tolist()]
    return [int(x) if x.is_integer() and abs(x) < 1e15 else x for x in numbers]


#: Scripts of pages with bodies, before those of one kind.
DRAWING = ("page.theme.js", "page.common.js", "page.body.js", "page.solid.js", "page.cards.js")
#: Of statuses, which pages keep as their places in this list.
STATUS_NAMES = [status.value for status in ContactStatus]


#: What is certified about a problem, by the data that the bounds belong to.
CERTIFIED_DATA = {
    "problem": "the matrices A, the contact rows and f as they were given",
    "condensed": "the condensed problem, S and g as computed",
}


class Heading(NamedTuple):
    """Arguments of `write_report` about any page: title, units, commands that check the proof, and the scene."""

    title: str
    units: tuple[str, str] | None
    commands: Sequence[str]
    scene: Scene | None


class Statement(NamedTuple):
    """Sentences of a page about its solutions: why they are incomplete, facts, answers, and what is certified.

    Attributes
    ----------
    incomplete, reasons : a sentence that the solutions are incomplete, empty where they are not, and why
    facts : names and values
    answers : sentences
    certified : paragraphs in HTML, without the solutions' closing line
    fingerprint : of the problem
    check : how to check the proof without commands of the user's, in HTML
    """

    incomplete: str
    reasons: Sequence[str]
    facts: Iterable[tuple[str, str]]
    answers: Iterable[str]
    certified: Iterable[str]
    fingerprint: str | None
    check: str


def proof_commands(command: str, place: str, more: str) -> str:
    """Commands that write a proof and check it, in HTML."""
    steps = (f"enumsol {command} PROBLEM {place} --proof FILE", "enumsol verify PROBLEM FILE")
    return ", then ".join(f"<code>{step}</code>" for step in steps) + more


def filled_page(
    kind: str,
    solutions: BranchGraph | RootSet | History,
    heading: Heading,
    said: Statement,
    scripts: Sequence[str],
    content: Mapping[str, Any],
    words: Mapping[str, str],
) -> str:
    """The text of a page: the frame of all pages around what one kind has, with words, scripts and what these draw."""
    certified = "".join(f"<p>{line}</p>" for line in (f"{escape(solutions.closing_line)}.", *said.certified))
    frame = {
        "title": escape(heading.title),
        "badge": "yes" if solutions.complete else "no",
        "completeness": escape(solutions.closing_line),
        "reasons": _warning_list(said.incomplete, said.reasons),
        "facts": fact_list(said.facts),
        "answers": "".join(f"<li>{escape(line)}</li>" for line in said.answers),
        "given": given_section(heading.scene, heading.units),
        "certified": certified + _proof_facts(said.fingerprint, heading.commands, said.check),
        "main": Template(_kept(f"page.{kind}.html")).substitute(words),
        "style": _kept("page.css"),
        "script": "\n".join(map(_kept, scripts)),
        # no "<" of a name may end the element
        "data": json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "version": escape(find_version()),
    }
    return Template(_kept("page.frame.html")).substitute({"plotly": "", **words, **frame})


def _kept(name: str) -> str:
    """A file of this package."""
    return (files("enumsol.report") / name).read_text(encoding="utf-8")


def status_codes(statuses: Iterable[ContactStatus]) -> str:
    """Statuses as a text of one digit per node."""
    return "".join(str(STATUS_NAMES.index(status.value)) for status in statuses)


def packed_plotly() -> str:
    """Plotly's script, compressed, in base64.

    Raises
    ------
    MissingDependencyError
        plotly is not installed.
    """
    script = MissingDependencyError.imported("plotly.offline", "reports", "report").get_plotlyjs()
    return base64.b64encode(gzip.compress(script.encode(), 9, mtime=0)).decode()


def span_words(values: Floats) -> str:
    """The range of numbers as text."""
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def fact_list(facts: Iterable[tuple[str, str]]) -> str:
    """Names and values, which are escaped here."""
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts)


def _proof_facts(fingerprint: str | None, commands: Sequence[str], otherwise: str) -> str:
    """The problem's fingerprint, and how to check the proof: by the commands given, or by words in HTML, if any."""
    lines = ""
    if fingerprint is not None:
        lines = f"<p>Fingerprint of the problem (SHA-256 of its data): <code>{escape(fingerprint)}</code></p>"
    if commands:
        shell = escape("\n".join(commands))
        lines += f"<p>To check it, with the problem and the proof at hand:</p><pre>{shell}</pre>"
    elif otherwise:
        lines += f"<p>To check it: {otherwise}</p>"
    return lines


def _warning_list(sentence: str, items: Sequence[str]) -> str:
    """A warning with its reasons, of many the first; empty without a sentence."""
    if not sentence:
        return ""
    lines = "".join(f"<li>{escape(item)}</li>" for item in items[:20])
    more = f"<li>and {len(items) - 20} more</li>" if len(items) > 20 else ""
    return f'<div class="warning" id="incomplete"><p>{escape(sentence)}</p><ul>{lines}{more}</ul></div>'


def table_text(caption: str, heads: Iterable[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """A table with a caption for screen readers; a row is its attributes and its cells, which are escaped here."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    body = "".join(
        f'<tr{kept}><th scope="row">{escape(cells[0])}</th>'
        + "".join(f"<td>{escape(c)}</td>" for c in cells[1:])
        + "</tr>"
        for kept, cells in rows
    )
    return scrolling(
        caption,
        f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>",
    )


def scrolling(caption: str, table: str) -> str:
    """A box with a table in it that can be scrolled, by the keyboard too."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">{table}</div>'


# -- the problem as its user gave it --------------------------------------------------------------------------------

#: Powers of force and of length in the unit of every option of `enumsol.fem.mesh_problem` that has one.
_POWERS = {
    **dict.fromkeys(("young", "load", "load_slope", "pressure", "pressure_slope"), (1, -2)),
    **dict.fromkeys(("spring", "body_force", "body_force_slope"), (1, -3)),
    **dict.fromkeys(("force", "force_slope"), (1, 0)),
    **dict.fromkeys(("moment", "moment_slope"), (1, 1)),
    "node_spring": (1, -1),
    **dict.fromkeys(
        ("thickness", "displacement", "displacement_slope", "reference", "gap", "obstacle", "max_rigid_displacement"),
        (0, 1),
    ),
}
#: Options that mean nothing in 3D.
_PLANE = ("plane", "thickness")
_RAISED = {1: "", 2: "\N{SUPERSCRIPT TWO}", 3: "\N{SUPERSCRIPT THREE}"}


def unit_text(units: tuple[str, str] | None, force: int, length: int) -> str:
    """The unit of a quantity, as in "N/mm²": powers of force, 0 or 1, and of length."""
    if units is None:
        return ""
    if length > 0:
        return f"{units[0]} {units[1]}" if force else units[1] + _RAISED[length]
    return units[0] if length == 0 else f"{units[0]}/{units[1]}{_RAISED[-length]}"


def with_unit(text: str, units: tuple[str, str] | None, force: int, length: int) -> str:
    """A number as text, with its unit if units are known."""
    return f"{text} {unit_text(units, force, length)}".rstrip()


def given_section(scene: Scene | None, units: tuple[str, str] | None) -> str:
    """A section of the page with the options of a scene and what they make; empty without one."""
    if scene is None:
        return ""
    rows = [
        ("", (name, _said(value), unit_text(units, *_POWERS[name]) if name in _POWERS else ""))
        for name, value in vars(scene.options).items()
        if value is not None and not (np.ndim(value) == 1 and len(value) == 0)
        if scene.dimension == 2 or name not in _PLANE
    ]
    about = fact_list((title, "; ".join(lines)) for title, lines in scene.sections.items() if lines)
    words = "" if units is not None else "<p>Numbers are in the user's own consistent units.</p>"
    table = table_text("The options of the problem", ("option", "as given", "unit"), rows)
    return (
        f'<section id="given"><h2>The problem as it was given</h2>{words}{table}'
        f'<h3>What this makes of the mesh</h3><dl class="facts">{about}</dl></section>'
    )


def _said(value: object) -> str:
    """The value of an option, in words."""
    if isinstance(value, Mapping):
        return "; ".join(f"{part}: {_said(own)}" for part, own in value.items())
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(_said(own) for own in value)
    return str(value) if isinstance(value, str) or value is None else f"{float(cast('float', value)):.10g}"
