"""The page of a report: words and tables in HTML, the graph's numbers, and the script that draws them."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches import BranchGraph
from enumsol.branches.claims import ranges_text
from enumsol.errors import InvalidArgumentError
from enumsol.loading.history import History
from enumsol.model.problem import ContactProblem
from enumsol.report.content import listed, report_content
from enumsol.report.history_page import history_page
from enumsol.report.parts import (
    CERTIFIED_DATA,
    DRAWING,
    Heading,
    Statement,
    filled_page,
    packed_plotly,
    proof_commands,
    span_words,
    table_text,
    with_unit,
)
from enumsol.report.roots_page import roots_page
from enumsol.roots.root_set import RootSet
from enumsol.support.arguments import file_path, instance_of
from enumsol.support.files import write_file
from enumsol.support.messages import counted
from enumsol.support.plotting import checked_units

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from enumsol.branches.elements import Branch, Vertex
    from enumsol.fem import Scene
    from enumsol.model.problem3d import ContactProblem3D


def write_report(
    solutions: BranchGraph | RootSet | History,
    file: str | os.PathLike[str],
    *,
    title: str = "Contact problem with Coulomb friction",
    units: tuple[str, str] | None = None,
    commands: Sequence[str] = (),
    scene: Scene | None = None,
) -> None:
    """Write all solutions over an interval of alpha, at one alpha, or after every load step, as one HTML page.

    It needs no network.

    The page of a graph, in 2D or 3D, has the branches against alpha (pointing shows values and statuses, a click on a
    branch its arcs), the number of solutions, a slider over alpha with the deformed bodies of all solutions, tables of
    branches, transitions and folds, and what is certified. It says "complete" only where ``graph.complete`` does; of a
    graph that was cut short it says what is missing.

    Bodies can be enlarged in their displacements one by one or all at once, and coloured by displacement or stress.
    Load, supports, springs and contact forces are drawn, the latter with a scale. In the plane bodies can be zoomed;
    the foundation is drawn, and the statuses along the boundary in a strip. In 3D they can be turned; directions of
    slip are drawn. Without a mesh there are bars of the forces and displacements of the contact nodes, and in 3D these
    nodes at their coordinates. Pages follow the light or dark setting of the browser and print on A4.

    The page of a RootSet, in 2D or 3D, has a card for each root with the deformed body, contact forces, statuses,
    directions of slip and a table over the contact nodes; tables of roots, continua and undecided parts; and what is
    certified.

    The page of a History has a table of the steps, the tree of the roots, figures of load, displacement and work of
    friction, the deformed bodies of all roots of a step that is chosen (with a mesh), and what is certified.

    Parameters
    ----------
    solutions : BranchGraph, RootSet or History
    file : str or path-like
        An existing file is replaced.
    title : str
        What the problem is.
    units : (str, str), optional
        Of forces and of lengths; the figures of a History have none.
    commands : sequence of str
        Lines of a shell by which a reader can check the proof.
    scene : fem.Scene, optional
        What the problem was made of, from `fem.mesh_scene` or `fem.read_mesh_scene`: material, supports, springs, loads
        and gaps are then told as they were given, with their units.

    Raises
    ------
    InvalidArgumentError
        There can be no such file, or an argument is not of that form.
    MissingDependencyError
        plotly is not installed, whose script draws diagrams and bodies in 3D in the page; for a History matplotlib.
    OutputError
        There is no room for the file.

    Examples
    --------
    >>> import enumsol, pathlib, tempfile
    >>> graph = enumsol.branch_graph(enumsol.gallery.two_node_square(), (0, 10))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     enumsol.write_report(graph, f"{folder}/square.html", title="Square in a corner")
    ...     "complete: yes (proven)" in pathlib.Path(folder, "square.html").read_text()
    True
    """
    given: object = solutions
    if not isinstance(given, (BranchGraph, RootSet, History)):
        raise InvalidArgumentError(
            f"solutions is a {type(given).__name__}; expected a BranchGraph, a RootSet or a History"
        )
    place = file_path(file, "file")
    heading = Heading(instance_of(title, str, "title"), checked_units(units), tuple(commands), _checked_scene(scene))
    if isinstance(solutions, BranchGraph):
        page = graph_page(solutions, heading)
    elif isinstance(solutions, RootSet):
        page = roots_page(solutions, heading)
    else:
        page = history_page(solutions, heading)
    write_file(place, page, "file")


def _checked_scene(scene: object) -> Scene | None:
    if scene is None:
        return None
    from enumsol.fem import Scene  # scikit-fem takes a while

    return instance_of(scene, Scene, "scene")


def graph_page(graph: BranchGraph, heading: Heading) -> str:
    """The text of the page."""
    where = f" for {ranges_text(graph.open_ranges)}, and only there" if graph.claims.partly else ""
    incomplete = (
        f"This graph is not complete. Everything shown is a solution, but solutions may be missing{where}: numbers of "
        "solutions are lower bounds. Why:"
    )
    said = Statement(
        incomplete if graph.reasons else "",
        graph.reasons,
        _facts(graph, heading.units),
        graph.claims.sentences(graph.uniqueness_bound),
        _certified(graph),
        graph.problem.fingerprint,
        proof_commands("graph", "--from A --to B", "; the proof's first record holds the same fingerprint."),
    )
    words = {"plotly": packed_plotly(), "branches": _branches(graph), "vertices": _vertices(graph)}
    content = report_content(graph, heading.scene) | {"units": heading.units}
    return filled_page("graph", graph, heading, said, (*DRAWING, "page.js", "page.solutions.js"), content, words)


def _facts(graph: BranchGraph, units: tuple[str, str] | None) -> list[tuple[str, str]]:
    problem, (a, b) = graph.problem, graph.interval
    load = "constant" if problem.load_slope is None else "f + alpha load_slope"
    branches, arcs = counted(len(graph.branches), "branch", "branches"), counted(len(graph.arcs), "arc")
    return [
        ("contact nodes", str(problem.p)),
        ("degrees of freedom", f"{problem.n:,}"),
        ("combinations of statuses", _combinations(problem)),
        ("friction", _friction(problem)),
        ("load", with_unit(f"{load}, max |f| = {np.max(np.abs(problem.f)):.4g}", units, 1, 0)),
        ("gap", with_unit(span_words(problem.gap), units, 0, 1)),
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
        return f"F = {span_words(problem.friction)} + alpha {span_words(problem.friction_slope)}"
    slopes = (f" + alpha {span_words(slope)}" if np.any(slope) else "" for slope in problem.friction_slope)
    pairs = enumerate(zip(problem.friction, slopes, strict=True), 1)
    return ", ".join(f"F{k} = {span_words(F)}{slope}" for k, (F, slope) in pairs)


def _branches(graph: BranchGraph) -> str:
    def shape(branch: Branch) -> str:
        if branch.sheet:
            return "sheet (a continuum over an interval)"
        if branch.closed:
            return "loop"
        return "unfinished" if any(v.kind.value == "unsettled" for v in branch.vertices) else "path"

    rows = []
    for branch in graph.branches:
        lo, hi = branch.interval
        folds = ", ".join(f"{v.alpha:.8g}" for v in branch.folds)
        indices = ", ".join(sorted({"?" if arc.index is None else f"{arc.index:+d}" for arc in branch.arcs}))
        cells = (str(branch.number), f"{lo:.8g}", f"{hi:.8g}", shape(branch), str(len(branch.arcs)), indices, folds)
        rows.append((f' data-branch="{branch.number}" tabindex="0"', cells))
    if not rows:
        return f"<p>None{'' if graph.complete else ' was found'}.</p>"
    return table_text("All branches", ("branch", "alpha from", "to", "shape", "arcs", "indices", "folds at"), rows)


def _vertices(graph: BranchGraph) -> str:
    found = listed(graph)
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
    return table_text("Critical alphas", ("alpha", "width of its bounds", "kind", "branches", "what happens"), rows)


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
    about = f"This is about {CERTIFIED_DATA[graph.certified_data]}."
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
