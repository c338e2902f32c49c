"""``enumsol verify``: check a proof."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from enumsol.cli.common import ExitStatus, load_any_problem
from enumsol.cli.options import ProblemArgument


def verify(
    problem: ProblemArgument,
    proof: Annotated[
        str,
        typer.Argument(
            metavar="PROOF", help="A file written by --proof of enumsol roots or graph.", show_default=False
        ),
    ],
) -> None:
    """Check that PROOF shows its list of roots of PROBLEM, or its list of selections of a graph, to be complete.

    The checker imports nothing of the search: it computes the condensed problem anew and checks every leaf of the
    search tree. It rests on the same rigorous bounds; python -m pydoc enumsol.checker lists what the two share.

    Exit status: 0 when the proof holds and nothing is undecided; 3 when it holds and leaves selections undecided;
    2 when it does not hold or cannot be read; 74 when the report could not be written, 141 when nobody read it any
    more.
    """
    # numpy and scipy: not for --help
    from enumsol.checker.verify import verify as check
    from enumsol.proof.proof_file import Proof

    report = check(load_any_problem(problem), Proof.load(proof), _show_progress if sys.stderr.isatty() else None)
    if sys.stderr.isatty():
        typer.echo("\r\033[K", nl=False, err=True)
    typer.echo(repr(report))
    if not report.ok:
        raise typer.Exit(ExitStatus.BAD_INPUT)
    raise typer.Exit(ExitStatus.DONE if report.complete else ExitStatus.INCOMPLETE)


def _show_progress(leaves: int) -> None:
    typer.echo(f"\r{leaves:,} leaves checked", nl=False, err=True)
