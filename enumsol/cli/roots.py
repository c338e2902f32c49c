"""``enumsol roots``: all solutions at one alpha."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from enumsol.cli import report
from enumsol.cli.common import (
    LIMITS,
    OUTPUT,
    Arithmetic,
    ExitStatus,
    JsonOption,
    ProblemArgument,
    finish,
    load_problem,
    note,
    parse_alpha,
    workers,
)
from enumsol.cli.output import check_outputs, check_writable, deliver, write_text
from enumsol.cli.progress import SearchDisplay
from enumsol.errors import EnumsolError, Interrupted, InvalidArgumentError, OutputError, WorkerError

if TYPE_CHECKING:
    from enumsol.checks import Alpha
    from enumsol.problem import ContactProblem
    from enumsol.roots.root_set import RootSet

Method = Literal["tree", "exhaustive"]


def roots(
    problem: ProblemArgument,
    alpha: Annotated[
        str,
        typer.Option(
            metavar="NUMBER",
            help="Parameter value: a decimal number, read as float64, or a fraction such as 8/3, taken exactly.",
            show_default=False,
        ),
    ],
    arithmetic: Annotated[
        Arithmetic,
        typer.Option(
            help="verified: rigorous error bounds, proven. fast: floats and a tolerance, never proven. "
            "exact: rationals throughout, proven, for small problems."
        ),
    ] = "verified",
    method: Annotated[
        Method, typer.Option(help="Pruned search; or all 4^p selections, fast or exact, for small p.")
    ] = "tree",
    stop_after: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Stop at N roots; 2 answers: is it unique?", rich_help_panel=LIMITS),
    ] = None,
    max_nodes: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Stop after N nodes of the tree.", rich_help_panel=LIMITS)
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Stop after so long.", rich_help_panel=LIMITS)
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=1, metavar="N", help="Processes to search with (tree).", rich_help_panel=LIMITS)
    ] = 1,
    proof_file: Annotated[
        str | None,
        typer.Option("--proof", metavar="FILE", help="Write the proof (verified).", rich_help_panel=OUTPUT),
    ] = None,
    json_file: JsonOption = None,
    csv_file: Annotated[
        str | None,
        typer.Option(
            "--csv", metavar="FILE", help="Write one row a root and contact node; - is stdout.", rich_help_panel=OUTPUT
        ),
    ] = None,
) -> None:
    """Find all solutions of PROBLEM at one ALPHA.

    Prints a table of the roots and whether it is complete; lambda_n and lambda_t are nodal forces, not pressures.

    Exit status: 0 when complete (in fast arithmetic, which proves nothing: when the search ran to its end with nothing
    undecided); 3 when something stayed undecided, a limit cut the search short, or the indices do not add up to +1;
    2 on bad input; 71 when a process of --jobs died, 130 on Ctrl-C, both after printing what was found so far; 74 when
    a result could not be written, 141 when nobody read it any more.
    """
    check_outputs(json=json_file, csv=csv_file)
    if proof_file == "-":
        raise InvalidArgumentError("--proof is -, but a proof is a binary file; expected the name of a file")
    if jobs > 1 and method != "tree":
        raise InvalidArgumentError(f"--jobs is {jobs} with the exhaustive method; expected 1 job, or the method tree")
    check_writable(proof_file, "--proof")
    value, body = parse_alpha(alpha), load_problem(problem)
    ended: EnumsolError | None = None
    try:
        found = _search(body, value, arithmetic, method, stop_after, max_nodes, time_limit, jobs, proof_file)
    except (Interrupted, WorkerError, OutputError) as error:
        ended, found = error, error.partial
    _output(found, problem, json_file, csv_file)
    finish(ended, _status(found))


def _search(
    problem: ContactProblem,
    alpha: Alpha,
    arithmetic: Arithmetic,
    method: Method,
    stop_after: int | None,
    max_nodes: int | None,
    time_limit: float | None,
    jobs: int,
    proof_file: str | None,
) -> RootSet:
    from enumsol.roots.enumerate import enumerate_roots  # numpy and scipy: not for --help

    with workers(jobs) as executor, SearchDisplay() as display:
        return enumerate_roots(
            problem,
            alpha,
            arithmetic,
            method,
            executor=executor,
            progress=display,
            stop_after=stop_after,
            max_nodes=max_nodes,
            time_limit=time_limit,
            proof_path=proof_file,
        )


def _status(found: RootSet) -> ExitStatus:
    if found.stopped is not None or found.undecided or found.index_sum not in (None, 1):
        return ExitStatus.INCOMPLETE
    return ExitStatus.DONE


def _output(found: RootSet, name: str, json_file: str | None, csv_file: str | None) -> None:
    deliver(
        None if "-" in (json_file, csv_file) else lambda: typer.echo(report.as_text(found)),
        None if json_file is None else lambda: write_text(json_file, report.as_json(found, name)),
        None if csv_file is None else lambda: write_text(csv_file, found.to_frame().to_csv(index=False)),
    )
    if csv_file is not None and found.families:
        note(f"the CSV holds the isolated roots only, --json the {len(found.families)} families too")
