"""``enumsol audit`` and ``enumsol verify``: checks of points against the branch graph, and of proofs."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer

from enumsol.cli.common import ExitStatus, finish, load_problem, parse_alpha, parse_interval, scene_of, so_far
from enumsol.cli.decks import deck_named, is_deck, step_chosen
from enumsol.cli.graph import build, read_graph
from enumsol.cli.options import Argument, Arithmetic, Number, OutputFile, Problem, Quiet
from enumsol.cli.output import deliver
from enumsol.cli.progress import Display, search_display
from enumsol.errors import InvalidArgumentError
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.auditing import AuditReport, PointRun
    from enumsol.branches import BranchGraph
    from enumsol.checker.reports import AnyReport
    from enumsol.io.calculix import NodalResult
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha

#: Endings of results of CalculiX.
_RESULTS = (".frd", ".dat")
#: Times that differ by less than this part are the same: files have six digits.
_SAME_TIME = 1e-5
#: As of ``read_points``, which is not imported for --help.
Columns = Literal["auto", "rows", "labels"]


def audit(
    problem: Problem,
    points: Argument,
    first: Number | None = None,
    last: Number | None = None,
    graph_file: Annotated[str | None, typer.Option(metavar="GRAPH")] = None,
    arithmetic: Arithmetic = "verified",
    tolerance: Annotated[float | None, typer.Option(metavar="NUMBER")] = None,
    columns: Columns = "auto",
    alpha: Number | None = None,
    json_file: OutputFile | None = None,
    csv_file: OutputFile | None = None,
    quiet: Quiet = False,
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
    body = load_problem(problem)
    runs = _read_runs(points, body, columns)
    known = None if graph_file is None else read_graph(graph_file, body)
    found, ended = so_far(lambda: known or build(body, _interval(runs, first, last), arithmetic))
    report = check(runs, found, tolerance=tolerance)
    deliver(
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: _as_text(report, found),
        content=lambda: {"problem": problem, **report.summary(), "graph": found.summary()},
        frame=report.to_frame,
    )
    finish(ended, _status(report))


def _audit_result(
    name: str, file: str, alpha: str | None, tolerance: float | None, arithmetic: Arithmetic, json_file: str | None
) -> NoReturn:
    """Compare a result of CalculiX with all roots, and end the command."""
    from enumsol.auditing.results import TOLERANCE, compare_result
    from enumsol.io.calculix import converged_time, read_results
    from enumsol.roots.enumerate import enumerate_roots

    results, converged = read_results(file), converged_time(file)
    result, requested = _asked_for(name, results, converged)
    body, about = load_problem(name), scene_of(name)
    if body.mesh is None:
        raise InvalidArgumentError(f"{name} has no mesh; expected a problem made of one, to compare with {file}")
    plane = None if about is None else about.options.plane

    numbers = None if about is None else about.mesh.node_labels
    moved = result.on(body.mesh, numbers, axisymmetric=str(plane) == "axisymmetric")
    with search_display() as display:
        found, ended = so_far(
            lambda: enumerate_roots(body, parse_alpha(alpha or "0"), arithmetic=arithmetic, progress=display)
        )
    compared = compare_result(body, found, moved, tolerance=TOLERANCE if tolerance is None else tolerance)
    deliver(
        json_file=json_file,
        text=lambda: f"{file} at time {result.time:g}: {compared}{_broken_off(result.time, requested, converged)}",
        content=lambda: {
            **{"problem": name, "file": file, "time": result.time, "requested_time": requested},
            **compared.summary(),
        },
    )
    finish(ended, ExitStatus.INCOMPLETE if compared.found is None else ExitStatus.DONE)


def _asked_for(name: str, results: list[NodalResult], converged: float | None) -> tuple[NodalResult, float | None]:
    """The result at the end of the step of a deck, or else the last that converged, and the time that it should have.

    The time is None where it is not known: of a problem that is no deck, and of a run that went on for longer.
    """
    known = [result for result in results if converged is None or result.time <= converged * (1 + _SAME_TIME)]
    last = (known or results)[-1]
    times = deck_named(name).times if is_deck(name) else []
    if not times or max(results[-1].time, converged or 0.0) > times[-1] * (1 + _SAME_TIME):
        return last, None
    requested = times[(step_chosen() or len(times)) - 1]
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


def _status(report: AuditReport) -> ExitStatus:
    if report.not_compared:
        return ExitStatus.NOT_COMPARED
    passed = report.ok and report.all_visited and not report.graph_reasons
    return ExitStatus.DONE if passed else ExitStatus.INCOMPLETE


def _interval(runs: Sequence[PointRun], first: str | None, last: str | None) -> tuple[Alpha, Alpha]:
    if first is not None and last is not None:
        return parse_interval(first, last)
    low = min(float(run.alpha.min()) for run in runs) if first is None else parse_alpha(first, "--from")
    high = max(float(run.alpha.max()) for run in runs) if last is None else parse_alpha(last, "--to")
    if not low < high:
        raise InvalidArgumentError(
            f"alpha goes from {float(low):g} to {float(high):g}; expected an interval, by --from and --to"
        )
    return low, high


# -- proofs ----------------------------------------------------------------------------------------------------------

#: What the checker tells of itself, and which part of the bar is its: a root set has leaves, a graph an interval and
#: selections that were followed, a history a search for every start.
_STEPS = {
    "leaves": (0.0, 1.0),
    "per cent of the interval": (0.0, 0.5),
    "selections followed": (0.5, 1.0),
    "searches": (0.0, 1.0),
}


def verify(problem: Problem, proof: Argument, json_file: OutputFile | None = None, quiet: Quiet = False) -> None:
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

    body = load_problem(problem)
    with Display("checking", _STEPS):
        report = check(body, Proof.load(proof))
    about = {"problem": problem, "proof": proof, "fingerprint": body.fingerprint}
    deliver(
        json_file=json_file,
        text=lambda: repr(report),
        content=lambda: {**about, **_content(report)},
    )
    if not report.ok:
        raise typer.Exit(ExitStatus.BAD_INPUT)
    raise typer.Exit(ExitStatus.DONE if report.complete else ExitStatus.INCOMPLETE)


def _content(report: AnyReport) -> dict[str, Any]:
    """The report, for JSON; of a graph the number of its selections."""
    content = asdict(report) | {"complete": report.complete}
    if "selections" in content and not isinstance(content["selections"], int):
        content["selections"] = len(content["selections"])
    return content
