"""``enumsol report``: all solutions over an interval of alpha as one HTML page."""

from __future__ import annotations

import shlex
from importlib.util import find_spec
from typing import Annotated

import typer

from enumsol.cli import options
from enumsol.cli.common import ExitStatus, finish, load_problem, parse_interval, scene_of, so_far, title_of, units_of
from enumsol.cli.graph import HowExact, as_content, build, graph_as_text, write_proof
from enumsol.cli.output import checking_commands, deliver
from enumsol.errors import MissingDependencyError


def report(
    problem: options.ProblemArgument,
    first: options.FirstAlpha,
    last: options.LastAlpha,
    output: Annotated[
        str,
        typer.Option("--output", "-o", metavar="FILE", help="File of the page, .html.", rich_help_panel=options.OUTPUT),
    ] = "report.html",
    arithmetic: HowExact = "verified",
    max_nodes: options.MaxNodes = None,
    time_limit: options.TimeLimit = None,
    jobs: options.Jobs = 1,
    title: Annotated[
        str | None,
        typer.Option(metavar="TEXT", help="Heading of the page; default: PROBLEM.", rich_help_panel=options.OUTPUT),
    ] = None,
    units: options.Units = None,
    proof_file: Annotated[
        str | None, options.file("--proof", "Write the proof (verified), to pass on with the page.")
    ] = None,
    json_file: options.JsonFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Find all solutions of PROBLEM for every alpha of an interval, and write one HTML page about them.

    The page needs no network. It shows an interactive diagram of the branches, the deformed body of every solution at
    any alpha, tables of folds and transitions, what is certified, and how to check it. Prints what enumsol graph
    prints.

    Exit status: as enumsol graph. If the graph is not complete, the page is written all the same and says so.
    """
    if find_spec("plotly") is None:
        raise MissingDependencyError.of("reports", "plotly", "report")
    interval, body, names = parse_interval(first, last), load_problem(problem), units_of(problem, units)
    limits = {"max_nodes": max_nodes, "time_limit": time_limit}
    found, ended = so_far(lambda: build(body, interval, arithmetic, jobs, **limits))

    def write(path: str) -> None:
        from enumsol.report import write_report  # numpy: not for --help

        # -1 would be read as an option
        place = f"--from={shlex.quote(first)} --to={shlex.quote(last)}"
        commands = checking_commands(found.proof is not None, problem, "graph", place, proof_file)
        heading = title_of(problem, title)
        write_report(found, path, title=heading, units=names, commands=commands, scene=scene_of(problem))

    deliver(
        (proof_file, lambda path: write_proof(found, path)),
        (output, write),
        json_file=json_file,
        text=lambda: graph_as_text(found),
        content=lambda: {"problem": problem, "report": output, **as_content(found)},
    )
    finish(ended, ExitStatus.INCOMPLETE if found.reasons else ExitStatus.DONE)
