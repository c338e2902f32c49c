"""``enumsol verify``: check a proof."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import typer

from enumsol.cli.common import ExitStatus, load_problem
from enumsol.cli.options import Argument, OutputFile, Problem, Quiet
from enumsol.cli.output import deliver
from enumsol.cli.progress import Display

if TYPE_CHECKING:
    from enumsol.checker.reports import GraphVerificationReport, HistoryVerificationReport, VerificationReport

#: What the checker tells of itself, and which part of the bar is its: a root set has leaves, a graph an interval and
#: selections that were followed, a history a search for every start.
_STEPS = {
    "leaves": (0.0, 1.0),
    "per cent of the interval": (0.0, 0.5),
    "selections followed": (0.5, 1.0),
    "searches": (0.0, 1.0),
}


def verify(problem: Problem, proof: Argument, json_file: OutputFile | None = None, quiet: Quiet = False) -> None:
    """Check the PROOF that a list of roots of PROBLEM, a branch graph or a history is complete.

    The checker imports nothing from the search: it computes the condensed problem anew and checks every leaf of the
    search tree. It uses the same rigorous bounds; python -m pydoc enumsol.checker lists what the two share.

    Exit status: 0 if the proof holds and nothing is undecided; 3 if it holds but leaves selections undecided or, for a
    graph, holds no arcs or leaves parts of them undecided; 2 if it does not hold or cannot be read; 74 if the report
    could not be written; 141 if the program that read it has ended.

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


def _content(report: VerificationReport | GraphVerificationReport | HistoryVerificationReport) -> dict[str, Any]:
    """The report, for JSON; of a graph the number of its selections."""
    content = asdict(report) | {"complete": report.complete}
    if "selections" in content and not isinstance(content["selections"], int):
        content["selections"] = len(content["selections"])
    return content
