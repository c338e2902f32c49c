"""``enumsol audit``: points of a continuation code against the branch graph."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from enumsol.cli.common import (
    OUTPUT,
    Arithmetic,
    ExitStatus,
    GraphFileOption,
    JsonOption,
    ProblemArgument,
    load_problem,
    parse_alpha,
    parse_interval,
)
from enumsol.cli.graph import build, read_graph
from enumsol.cli.output import as_json, check_outputs, write_text
from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from enumsol.branches import BranchGraph
    from enumsol.checks import Alpha
    from enumsol.continuation import AuditReport


def audit(
    problem: ProblemArgument,
    points: Annotated[
        str,
        typer.Argument(
            metavar="POINTS",
            help="CSV with columns alpha, lambda_n_0, .., lambda_t_0, .. and, for several paths, path; - is stdin.",
            show_default=False,
        ),
    ],
    first: Annotated[
        str | None,
        typer.Option("--from", metavar="NUMBER", help="First alpha; default: that of the points.", show_default=False),
    ] = None,
    last: Annotated[
        str | None,
        typer.Option("--to", metavar="NUMBER", help="Last alpha; default: that of the points.", show_default=False),
    ] = None,
    graph_file: GraphFileOption = None,
    arithmetic: Annotated[Arithmetic, typer.Option(help="Of the graph, as in enumsol graph.")] = "verified",
    tolerance: Annotated[
        float,
        typer.Option(min=0.0, metavar="LENGTH", help="Distance from the graph beyond which a point is off it."),
    ] = 1e-5,
    json_file: JsonOption = None,
    csv_file: Annotated[
        str | None,
        typer.Option("--csv", metavar="FILE", help="Write one row a point; - is stdout.", rich_help_panel=OUTPUT),
    ] = None,
) -> None:
    """Check POINTS, from any continuation code, against all solutions of PROBLEM.

    Tells how far every point is from the nearest branch, where a path jumped from one branch to another, and which
    arcs in the interval no path visited.

    Exit status: 0 when every point is on the graph, nothing jumped and nothing was missed; 3 otherwise, or when the
    graph is known to be incomplete; 2 on bad input; 130 on Ctrl-C.
    """
    from enumsol.continuation import audit as check

    check_outputs(json=json_file, csv=csv_file)
    if graph_file is not None and (first is not None or last is not None):
        raise InvalidArgumentError("--graph and --from or --to are both given; a graph has its own interval")
    body = load_problem(problem)
    frame = _read(points)
    found = (
        build(body, _interval(frame, first, last), arithmetic) if graph_file is None else read_graph(graph_file, body)
    )
    report = check(frame, found, tolerance=tolerance)
    if "-" not in (json_file, csv_file):
        low, high = found.interval
        typer.echo(repr(report))
        typer.echo(f"graph for alpha in [{low:g}, {high:g}], {len(found.arcs)} arcs; {found.completeness()}")
    if json_file is not None:
        write_text(json_file, as_json({"problem": problem, **_content(report, found)}))
    if csv_file is not None:
        write_text(csv_file, report.to_frame().to_csv(index=False))
    passed = report.ok and report.complete and not found.reasons
    raise typer.Exit(ExitStatus.DONE if passed else ExitStatus.INCOMPLETE)


def _read(points: str) -> pd.DataFrame:
    import pandas as pd  # slow to import

    try:
        frame = pd.read_csv(sys.stdin if points == "-" else points)
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(f"{points}: {error}; expected a CSV file of points") from error
    if not len(frame):
        raise InvalidArgumentError(f"{points} holds no points; expected one row a point below the names of columns")
    return frame


def _interval(frame: pd.DataFrame, first: str | None, last: str | None) -> tuple[Alpha, Alpha]:
    if first is not None and last is not None:
        return parse_interval(first, last)
    if "alpha" not in frame.columns or not _is_number(frame["alpha"]):
        raise InvalidArgumentError("POINTS has no column 'alpha' of numbers; expected one, or --from and --to")
    low = float(frame["alpha"].min()) if first is None else parse_alpha(first)
    high = float(frame["alpha"].max()) if last is None else parse_alpha(last)
    if not low < high:
        raise InvalidArgumentError(
            f"alpha goes from {float(low):g} to {float(high):g}; expected an interval, by --from and --to"
        )
    return low, high


def _is_number(column: Any) -> bool:
    from pandas.api.types import is_numeric_dtype

    return bool(is_numeric_dtype(column))


def _content(report: AuditReport, found: BranchGraph) -> dict[str, Any]:
    return {
        "ok": report.ok,
        "complete": report.complete,
        "points": len(report.alpha),
        "tolerance": report.tolerance,
        "max_distance": report.max_distance,
        "off": report.off,
        "jumps": [vars(jump) for jump in report.jumps],
        "visited": sorted(report.visited),
        "missed": [{**vars(item), "statuses": [status.value for status in item.statuses]} for item in report.missed],
        "missed_families": report.missed_families,
        "graph": found.summary(),
    }
