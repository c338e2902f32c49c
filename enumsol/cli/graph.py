"""``enumsol graph`` and ``enumsol report``: all solutions over an interval of alpha, and one HTML page of them."""

from __future__ import annotations

import shlex
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from enumsol.cli import common, options, output
from enumsol.cli.common import load_problem, node_row, parse_interval, so_far, title_of, units_of
from enumsol.cli.progress import Display
from enumsol.errors import Interrupted, InvalidArgumentError, MissingDependencyError

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.branches import BranchGraph
    from enumsol.errors import EnumsolError
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha


#: Quantities of a figure: overviews, and those of nodes.
Overview = Literal["norm", "sum_n", "sum_t", "lambda_n", "lambda_t", "u_n", "u_t"]

#: Asked for, refused, or neither.
Stability = Annotated[bool | None, typer.Option("--stability/--no-stability")]


def graph(
    problem: options.Problem,
    first: options.Number,
    last: options.Number,
    arithmetic: options.Arithmetic = "verified",
    max_nodes: options.Count | None = None,
    time_limit: options.Seconds | None = None,
    stability: Stability = None,
    jobs: options.Count = 1,
    save_file: options.OutputFile | None = None,
    json_file: options.OutputFile | None = None,
    csv_file: options.OutputFile | None = None,
    proof_file: options.OutputFile | None = None,
    graphml_file: options.OutputFile | None = None,
    plot_file: options.PlotFile | None = None,
    quantity: Annotated[Overview | None, typer.Option(rich_help_panel=options.PLOT)] = None,
    nodes: Annotated[str | None, typer.Option(metavar="LABELS", rich_help_panel=options.PLOT)] = None,
    units: options.Units | None = None,
    quiet: options.Quiet = False,
) -> None:
    """Find all solutions of PROBLEM for every alpha of an interval, as branches of arcs.

    Prints the branches, folds (where two solutions merge and vanish), bifurcations (where branches meet) and continua
    (connected families of solutions at one alpha), and whether the graph is complete.

    Exit status: 0 if the graph is complete (in fast arithmetic, which proves nothing: if the degrees balance at every
    vertex); 3 if the graph is known to be incomplete; 2 on bad input; 130 on Ctrl-C, after printing the graph so far;
    74 if a result could not be written; 141 if the program that read it has ended.

    Parameters
    ----------
    arithmetic : verified: rigorous error bounds, with proof. fast: the search trusts floats, never proven. exact:
        rationals throughout, with proof, slow beyond ten contact nodes.
    stability : Say which arcs run away, however long it takes; by default where PROBLEM has a mesh or a mass, if that
        takes less than about a tenth of the work on the graph.
    save_file : Write the graph, for enumsol audit and follow.
    csv_file : Write a table with one row per arc; - is stdout.
    proof_file : Write the proof (verified), for enumsol verify.
    graphml_file : Write GraphML for other programs.
    quantity : Quantity drawn against alpha: an overview (default: norm of the contact forces), or one of nodes.
    nodes : Contact nodes to draw, such as 0,3; default: up to three.
    """
    interval, body = parse_interval(first, last), load_problem(problem)
    chosen = None if nodes is None else [body.node_ids[node_row(body, label.strip())] for label in nodes.split(",")]
    drawn: dict[str, Any] = {
        "quantity": quantity,
        "nodes": chosen,
        "title": title_of(problem),
        "units": units_of(problem, units),
    }
    if chosen is not None and quantity in ("norm", "sum_n", "sum_t"):
        raise InvalidArgumentError(f"--nodes is given with --quantity {quantity}; expected a quantity of nodes")
    limits = {"max_nodes": max_nodes, "time_limit": time_limit}
    found, ended = _told(body, stability, lambda: build(body, interval, arithmetic, jobs, **limits))
    output.deliver(
        (proof_file, lambda path: write_proof(found, path)),
        (save_file, found.save),
        (graphml_file, found.write_graphml),
        (plot_file, lambda path: output.write_figure(path, found.plot(**drawn))),
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: graph_as_text(found),
        content=lambda: {"problem": problem, **as_content(found)},
        frame=found.to_frame,
    )
    common.finish(ended, common.ExitStatus.INCOMPLETE if found.reasons else common.ExitStatus.DONE)


def report(
    problem: options.Problem,
    first: options.Number,
    last: options.Number,
    page_file: Annotated[
        str, typer.Option("--output", "-o", metavar="FILE", rich_help_panel=options.OUTPUT)
    ] = "report.html",
    arithmetic: options.Arithmetic = "verified",
    max_nodes: options.Count | None = None,
    time_limit: options.Seconds | None = None,
    stability: Stability = None,
    jobs: options.Count = 1,
    title: options.Title | None = None,
    units: options.Units | None = None,
    proof_file: options.OutputFile | None = None,
    json_file: options.OutputFile | None = None,
    quiet: options.Quiet = False,
) -> None:
    """Find all solutions of PROBLEM for every alpha of an interval, and write one HTML page about them.

    The page needs no network. It shows an interactive diagram of the branches, the deformed body of every solution at
    any alpha, tables of folds and transitions, what is certified, and how to check it. Prints what enumsol graph
    prints.

    Exit status: as enumsol graph. If the graph is not complete, the page is written all the same and says so.

    Parameters
    ----------
    page_file : File of the page, .html.
    arithmetic : verified: rigorous error bounds, with proof. fast: the search trusts floats, never proven. exact:
        rationals throughout, with proof, slow beyond ten contact nodes.
    stability : As enumsol graph.
    proof_file : Write the proof (verified), to pass on with the page.
    """
    if find_spec("plotly") is None:
        raise MissingDependencyError.of("reports", "plotly", "report")
    interval, body, names = parse_interval(first, last), load_problem(problem), units_of(problem, units)
    limits = {"max_nodes": max_nodes, "time_limit": time_limit}
    found, ended = _told(body, stability, lambda: build(body, interval, arithmetic, jobs, **limits))

    def write(path: str) -> None:
        from enumsol.report import write_report  # numpy: not for --help

        # -1 would be read as an option
        place = f"--from={shlex.quote(first)} --to={shlex.quote(last)}"
        commands = output.checking_commands(found.proof is not None, problem, "graph", place, proof_file)
        heading = title_of(problem, title)
        write_report(found, path, title=heading, units=names, commands=commands, scene=common.scene_of(problem))

    output.deliver(
        (proof_file, lambda path: write_proof(found, path)),
        (page_file, write),
        json_file=json_file,
        text=lambda: graph_as_text(found),
        content=lambda: {"problem": problem, "report": page_file, **as_content(found)},
    )
    common.finish(ended, common.ExitStatus.INCOMPLETE if found.reasons else common.ExitStatus.DONE)


def write_proof(found: BranchGraph, path: str) -> None:
    """Write the proof of a graph, or say why there is none."""
    if found.proof is None:
        why = "only verified arithmetic gives one" if found.arithmetic != "verified" else "this search gave none"
        common.note(f"no proof was written, {why}")
        return
    found.proof.save(path)


#: What is said of the stages of branch_graph, and which part of the bar is theirs; arcs are joined, and the graph is
#: made of them, after the last one.
_STEPS = {
    "search": ("step 1 of 2, search", ("search", 0.0, 0.5)),
    "arcs": ("step 2 of 2, arcs", ("arcs", 0.5, 0.98)),
}


def build(
    problem: AnyProblem,
    interval: tuple[Alpha, Alpha],
    arithmetic: options.Arithmetic = "verified",
    jobs: int = 1,
    **limits: Any,
) -> BranchGraph:
    """The graph, with progress on stderr.

    Raises
    ------
    InvalidArgumentError
        As ``branch_graph``.
    """
    from enumsol.branches import branch_graph

    told = lambda stage, share: (share, *_STEPS[stage])  # noqa: E731
    with common.workers(jobs) as executor, Display("branch graph", told=told) as display:
        return branch_graph(problem, interval, arithmetic, progress=display, executor=executor, **limits)


#: Work on verdicts that nobody asked for, as a share of the work on the graph, both counted, so that no result depends
#: on the machine: an arc on which a node slides takes about as long as so many nodes of the tree, where friction and
#: directions are constant, and where they change (bodies of the gallery); with larger numbers less is said unasked.
_SHARE, _NODES_OF_AN_ARC = 0.1, (300, 5000)


def _told(
    problem: AnyProblem, stability: bool | None, search: Callable[[], BranchGraph]
) -> tuple[BranchGraph, EnumsolError | None]:
    """A graph with its verdicts: those that were asked for, or those that hardly take time; and what ended it."""
    from enumsol.branches.stability import ArcStabilities  # numpy: not for --help

    if stability:
        ArcStabilities(problem)  # refused before the search
    found, ended = so_far(search)
    if ended is not None or stability is False or not (stability or _has_mass(problem)):
        return found, ended
    if not stability and _work(problem, found) > _SHARE * found.stats.nodes:
        common.note("which arcs run away would take more than a tenth of the work on the graph; --stability finds it")
        return found, ended
    try:
        with Display("stability"):
            found.stability()
    except KeyboardInterrupt:
        ended = Interrupted("the search for verdicts was interrupted", found)
    return found, ended


def _work(problem: AnyProblem, found: BranchGraph) -> int:
    """An estimate of the work on verdicts, in nodes of the tree."""
    sliding = [arc for arc in found.arcs if any(status.value.startswith("slip") for status in arc.statuses)]
    slopes = problem.affine_friction[1]
    # in 3D directions of slip change along an arc
    if slopes.ndim > 1 or slopes.any():
        return _NODES_OF_AN_ARC[1] * len(sliding)
    return _NODES_OF_AN_ARC[0] * len({arc.statuses for arc in sliding})


def _has_mass(problem: AnyProblem) -> bool:
    """True if verdicts on arcs can be found without more data."""
    return problem.mass is not None or problem.mesh is not None


def read_graph(file: str, problem: AnyProblem) -> BranchGraph:
    """The graph in a file, which must be one of this problem.

    Raises
    ------
    InvalidArgumentError
        The file is not a saved graph, or one of another problem.
    """
    from enumsol.branches import BranchGraph

    found = BranchGraph.load(file)
    if found.problem.fingerprint != problem.fingerprint:
        raise InvalidArgumentError(f"--graph is {file}, a graph of another problem; expected one of PROBLEM")
    return found


def graph_as_text(found: BranchGraph) -> str:
    """The printed graph, and before its closing line the answers that users ask for."""
    *lines, closing = repr(found).splitlines()
    lines += found.claims.sentences(found.uniqueness_bound)
    if found.bifurcations:
        lines.append("bifurcations at alpha = " + ", ".join(f"{v.alpha:.8g}" for v in found.bifurcations[:8]))
    if found.jumps:
        lines.append("jumps with increasing alpha at " + ", ".join(f"{v.alpha:.8g}" for v in found.jumps[:8]))
    return "\n".join([*lines, closing])


def as_content(found: BranchGraph) -> dict[str, Any]:
    """Everything about a graph, for JSON."""
    branches = [
        {
            "branch": branch.number,
            "component": branch.component,
            "closed": branch.closed,
            "sheet": branch.sheet,
            "arcs": [arc.number for arc in branch.arcs],
            "vertices": [v.number for v in branch.vertices],
        }
        for branch in found.branches
    ]
    arcs, vertices = found.to_frame(), found.vertices_frame()
    return {
        **found.summary(),
        "completeness": found.closing_line,
        "branch_list": branches,
        "arc_list": arcs.to_dict("records"),
        "vertex_list": vertices.to_dict("records"),
    }
