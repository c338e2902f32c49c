"""All solutions over an interval of alpha, pages of them, and checks of points against them and of proofs."""

from __future__ import annotations

import shlex
import sys
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer

from enumsol.cli import common, options, output
from enumsol.cli.progress import Display, search_display
from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.auditing import AuditReport, PointRun
    from enumsol.branches import BranchGraph
    from enumsol.checker.reports import AnyReport
    from enumsol.errors import EnumsolError
    from enumsol.io.calculix import NodalResult
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
    interval, body = common.parse_interval(first, last), common.load_problem(problem)
    chosen = (
        None if nodes is None else [body.node_ids[common.node_row(body, label.strip())] for label in nodes.split(",")]
    )
    drawn: dict[str, Any] = {
        "quantity": quantity,
        "nodes": chosen,
        "title": common.title_of(problem),
        "units": common.units_of(problem, units),
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
    interval, body, names = (
        common.parse_interval(first, last),
        common.load_problem(problem),
        common.units_of(problem, units),
    )
    limits = {"max_nodes": max_nodes, "time_limit": time_limit}
    found, ended = _told(body, stability, lambda: build(body, interval, arithmetic, jobs, **limits))

    def write(path: str) -> None:
        from enumsol.report import write_report  # numpy: not for --help

        # -1 would be read as an option
        place = f"--from={shlex.quote(first)} --to={shlex.quote(last)}"
        commands = output.checking_commands(found.proof is not None, problem, "graph", place, proof_file)
        heading = common.title_of(problem, title)
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
    if stability:
        common.check_motions(problem)
    found, ended = common.so_far(search)
    if ended is not None or stability is False or not (stability or _has_mass(problem)):
        return found, ended
    if not stability and _work(problem, found) > _SHARE * found.stats.nodes:
        common.note("which arcs run away would take more than a tenth of the work on the graph; --stability finds it")
        return found, ended
    return common.so_far(lambda: common.judged(found, found.stability))


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


# -- audit -------------------------------------------------------------------------------------------------------------
# ``enumsol audit`` and ``enumsol verify``: checks of points against the branch graph, and of proofs.

#: Endings of results of CalculiX.
_RESULTS = (".frd", ".dat")
#: Times that differ by less than this part are the same: files have six digits.
_SAME_TIME = 1e-5
#: As of ``read_points``, which is not imported for --help.
Columns = Literal["auto", "rows", "labels"]


def audit(
    problem: options.Problem,
    points: options.Argument,
    first: options.Number | None = None,
    last: options.Number | None = None,
    graph_file: Annotated[str | None, typer.Option(metavar="GRAPH")] = None,
    arithmetic: options.Arithmetic = "verified",
    tolerance: Annotated[float | None, typer.Option(metavar="NUMBER")] = None,
    columns: Columns = "auto",
    alpha: options.Number | None = None,
    json_file: options.OutputFile | None = None,
    csv_file: options.OutputFile | None = None,
    quiet: options.Quiet = False,
) -> None:
    """Check POINTS, from any continuation code, or a RESULT of CalculiX against all solutions of PROBLEM.

    Reports how far every point is from the nearest arc of the branch graph, where a path jumped from one branch to
    another, which arcs in the interval no path visited, and which points could not be compared. Points are named by
    path and row; rows are counted from 0, which is the first one below the names of the columns.

    In 3D lambda_t1_X and lambda_t2_X take the place of lambda_t_X. The X of lambda_n_X is the row number of a contact
    node or its label, as in --node. A file that fits both is refused unless --columns states which is meant.

    Distance: sqrt(e^2 + a^2). e is the energy norm sqrt(d' S d) of the difference d of the contact forces, where S is
    the compliance of the contact nodes, relative to the load, that is to the largest sqrt(g' S^-1 g) in the interval;
    it is at most 1 for the forces of every solution. a is the difference of alpha in twentieths of the interval.

    Tolerance: the default suits paths of enumsol follow, which are corrected to a tenth of it. For points of another
    code, give ten times the relative error of its forces: 1e-3 if the solver stops at a relative error of 1e-4, or if
    the file has five digits. If it stops at a small residual, the error of the forces may be larger. Solutions that are
    closer to each other than the tolerance, and jumps between them, cannot be distinguished.

    Results: of a file .frd or .dat of CalculiX the displacements at the end of the step of a deck, or else those of its
    last increment (that converged, by the file .sta beside it, if there is one), are compared with those of all
    roots at one alpha, which is told which of them it is, and which ones it is not. The tolerance is then the largest
    difference of a displacement in parts of the largest displacement, by default 0.05; the result has to be nearer to
    the root than half way to any other. The exit status is 0 if it is one of the roots, else 3.

    Exit status: 0 if every point is on the graph, no path jumped and no arc was missed; 3 if not, or if the graph is
    known to be incomplete (in fast arithmetic, which proves nothing: if its degrees do not balance); 4 if points were
    not compared, whatever else was found, because their alpha is outside the interval of the graph, or because a graph
    that is known to be incomplete has no arc there; 2 on bad input; 130 on Ctrl-C; 74 if a result could not be written;
    141 if the program that read it has ended.

    Parameters
    ----------
    points : CSV with the columns alpha, lambda_n_X and lambda_t_X for every contact node X and, for several paths,
        path; - is stdin. Or a file .frd or .dat of CalculiX.
    first : First alpha; default: that of the points.
    last : Last alpha; default: that of the points.
    graph_file : A graph written by enumsol graph --save.
    arithmetic : Arithmetic of the graph, as in enumsol graph.
    tolerance : Distance beyond which a point is off the graph, or a result no root, as explained above; dimensionless.
    columns : Whether the X of lambda_n_X is the node's row number (from 0) or its label.
    alpha : Of a result, where friction or load depend on it; default: 0.
    csv_file : Write a table with one row per point; - is stdout.
    """
    from enumsol.auditing import audit as check  # numpy and scipy: not for --help
    from enumsol.auditing.auditor import POINT_TOLERANCE
    from enumsol.auditing.graph_map import checked_tolerance

    if Path(points).suffix.lower() in _RESULTS:
        if csv_file or graph_file or not first is last is None:
            raise InvalidArgumentError(f"{points} is a result; expected no --csv, --graph, --from or --to with it")
        _audit_result(problem, points, alpha, tolerance, arithmetic, json_file)
    if alpha is not None:
        raise InvalidArgumentError("--alpha is given, but points have their own; expected it with a result of CalculiX")
    tolerance = POINT_TOLERANCE if tolerance is None else tolerance
    checked_tolerance(tolerance)
    if graph_file is not None and (first is not None or last is not None):
        raise InvalidArgumentError("--graph and --from or --to are both given; a graph has its own interval")
    body = common.load_problem(problem)
    runs = _read_runs(points, body, columns)
    known = None if graph_file is None else read_graph(graph_file, body)
    found, ended = common.so_far(lambda: known or build(body, _interval(runs, first, last), arithmetic))
    report = check(runs, found, tolerance=tolerance)
    output.deliver(
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: _as_text(report, found),
        content=lambda: {"problem": problem, **report.summary(), "graph": found.summary()},
        frame=report.to_frame,
    )
    common.finish(ended, _status(report))


def _audit_result(
    name: str,
    file: str,
    alpha: str | None,
    tolerance: float | None,
    arithmetic: options.Arithmetic,
    json_file: str | None,
) -> NoReturn:
    """Compare a result of CalculiX with all roots, and end the command."""
    from enumsol.auditing.results import TOLERANCE, compare_result
    from enumsol.io.calculix import converged_time, read_results
    from enumsol.roots.enumerate import enumerate_roots

    results, converged = read_results(file), converged_time(file)
    result, requested = _asked_for(name, results, converged)
    body, about = common.load_problem(name), common.scene_of(name)
    if body.mesh is None:
        raise InvalidArgumentError(f"{name} has no mesh; expected a problem made of one, to compare with {file}")
    plane = None if about is None else about.options.plane

    numbers = None if about is None else about.mesh.node_labels
    moved = result.on(body.mesh, numbers, axisymmetric=str(plane) == "axisymmetric")
    with search_display() as display:
        found, ended = common.so_far(
            lambda: enumerate_roots(body, common.parse_alpha(alpha or "0"), arithmetic=arithmetic, progress=display)
        )
    compared = compare_result(body, found, moved, tolerance=TOLERANCE if tolerance is None else tolerance)
    output.deliver(
        json_file=json_file,
        text=lambda: f"{file} at time {result.time:g}: {compared}{_broken_off(result.time, requested, converged)}",
        content=lambda: {
            **{"problem": name, "file": file, "time": result.time, "requested_time": requested},
            **compared.summary(),
        },
    )
    common.finish(ended, common.ExitStatus.INCOMPLETE if compared.found is None else common.ExitStatus.DONE)


def _asked_for(name: str, results: list[NodalResult], converged: float | None) -> tuple[NodalResult, float | None]:
    """The result at the end of the step of a deck, or else the last that converged, and the time that it should have.

    The time is None where it is not known: of a problem that is no deck, and of a run that went on for longer.
    """
    known = [result for result in results if converged is None or result.time <= converged * (1 + _SAME_TIME)]
    last = (known or results)[-1]
    times = common.deck_named(name).times if common.is_deck(name) else []
    if not times or max(results[-1].time, converged or 0.0) > times[-1] * (1 + _SAME_TIME):
        return last, None
    requested = times[(common.step_chosen() or len(times)) - 1]
    at = [result for result in known if abs(result.time - requested) <= _SAME_TIME * requested]
    return (at[-1] if at else last), requested


def _broken_off(time: float, requested: float | None, converged: float | None) -> str:
    """A line on a run that was broken off."""
    if requested is not None and time < requested * (1 - _SAME_TIME):
        ended = "" if converged is None else f"; the last increment that converged ended at time {converged:g}"
        return f"\nthe run was broken off, or writes no end of its step: time {requested:g} was asked for{ended}"
    return ""


def _read_runs(points: str, problem: AnyProblem, columns: Columns) -> Sequence[PointRun]:
    from enumsol.auditing import read_points

    source, name = (sys.stdin, "stdin") if points == "-" else (points, points)
    runs = read_points(source, problem, columns=columns, name=name)
    if not runs:
        raise InvalidArgumentError(f"{name} holds no points; expected one row per point below the names of columns")
    return runs


def _as_text(report: AuditReport, found: BranchGraph) -> str:
    low, high = found.interval
    about = f"graph for alpha in [{low:g}, {high:g}], {counted(len(found.arcs), 'arc')}; {found.closing_line}"
    return f"{report!r}\n{about}"


def _status(report: AuditReport) -> common.ExitStatus:
    if report.not_compared:
        return common.ExitStatus.NOT_COMPARED
    passed = report.ok and report.all_visited and not report.graph_reasons
    return common.ExitStatus.DONE if passed else common.ExitStatus.INCOMPLETE


def _interval(runs: Sequence[PointRun], first: str | None, last: str | None) -> tuple[Alpha, Alpha]:
    if first is not None and last is not None:
        return common.parse_interval(first, last)
    low = min(float(run.alpha.min()) for run in runs) if first is None else common.parse_alpha(first, "--from")
    high = max(float(run.alpha.max()) for run in runs) if last is None else common.parse_alpha(last, "--to")
    if not low < high:
        raise InvalidArgumentError(
            f"alpha goes from {float(low):g} to {float(high):g}; expected an interval, by --from and --to"
        )
    return low, high


# -- proofs ----------------------------------------------------------------------------------------------------------

#: What the checker tells of itself, and which part of the bar is its: a root set has leaves, a graph an interval and
#: selections that were followed, a history a search for every start.
_CHECKS = {
    "leaves": (0.0, 1.0),
    "per cent of the interval": (0.0, 0.5),
    "selections followed": (0.5, 1.0),
    "searches": (0.0, 1.0),
}


def verify(
    problem: options.Problem,
    proof: options.Argument,
    json_file: options.OutputFile | None = None,
    quiet: options.Quiet = False,
) -> None:
    """Check the PROOF that a list of roots of PROBLEM, a graph or a history is complete, or which roots run away.

    The checker imports nothing from the search: it computes the condensed problem anew and checks every leaf of the
    search tree. It uses the same rigorous bounds; python -m pydoc enumsol.checker lists what the two share.

    Exit status: 0 if the proof holds and nothing is undecided; 3 if it holds but leaves selections or verdicts
    undecided or, for a graph, holds no arcs or leaves parts of them undecided; 2 if it does not hold or cannot be
    read; 74 if the report could not be written; 141 if the program that read it has ended.

    Parameters
    ----------
    proof : A file written by --proof of enumsol roots, graph or history.
    """
    # numpy and scipy: not for --help
    from enumsol.checker.verify import verify as check
    from enumsol.proof.proof_file import Proof

    body = common.load_problem(problem)
    with Display("checking", _CHECKS):
        report = check(body, Proof.load(proof))
    about = {"problem": problem, "proof": proof, "fingerprint": body.fingerprint}
    output.deliver(
        json_file=json_file,
        text=lambda: repr(report),
        content=lambda: {**about, **_content(report)},
    )
    if not report.ok:
        raise typer.Exit(common.ExitStatus.BAD_INPUT)
    raise typer.Exit(common.ExitStatus.DONE if report.complete else common.ExitStatus.INCOMPLETE)


def _content(report: AnyReport) -> dict[str, Any]:
    """The report, for JSON; of a graph the number of its selections."""
    content = asdict(report) | {"complete": report.complete}
    if "selections" in content and not isinstance(content["selections"], int):
        content["selections"] = len(content["selections"])
    return content
