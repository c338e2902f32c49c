"""``enumsol collection``: problems with certified solutions, and a check of what other solvers find."""

from __future__ import annotations

from typing import Annotated

import typer

from enumsol.cli.common import ExitStatus
from enumsol.cli.files import FileCommand
from enumsol.cli.options import JsonFile, Quiet, csv
from enumsol.cli.output import deliver, list_entries, named_group
from enumsol.support.messages import counted

app = named_group("Problems with certified solutions, and a check of what other solvers find.")


@app.command("list", cls=FileCommand)
def list_(json_file: JsonFile = None) -> None:
    """List the problems, each with its dimension, its contact nodes and the number of its solutions."""
    from enumsol.collection import COLLECTION  # numpy: not for --help

    columns = ("NAME", "dimension", "nodes", "solutions", "what it shows")
    rows = [
        (entry.name, str(entry.dimension), str(entry.p), entry.solutions_in_words(), entry.summary)
        for entry in COLLECTION.values()
    ]
    hint = "Write them all to a folder: enumsol collection export FOLDER"
    list_entries(columns, rows, json_file=json_file, content=list(COLLECTION.values()), hint=hint)


@app.command(cls=FileCommand)
def export(
    folder: Annotated[
        str, typer.Argument(metavar="FOLDER", help="Folder to write to; it is made if need be.", show_default=False)
    ],
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help="Only these problems; default: all.", show_default=False),
    ] = None,
    json_file: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Write the problems as .npz and .h5 (fclib), with their certified solutions (JSON) and proofs, to FOLDER."""
    from enumsol import collection  # as above

    written = collection.export(folder, [name.removeprefix("collection:") for name in names] if names else None)
    deliver(
        json_file=json_file,
        text=lambda: (
            f"wrote {counted(len(written), 'problem')} to {folder}/problems, and their solutions and proofs to "
            f"{folder}/certified"
        ),
        content=lambda: {"folder": folder, "names": [entry.name for entry in written]},
    )


@app.command(cls=FileCommand)
def check(
    solutions: Annotated[
        str,
        typer.Argument(
            metavar="SOLUTIONS",
            help="A file NAME.npz, .json, .csv or .h5 (fclib) with what a solver found for the problem NAME, or a "
            "folder of such files.",
            show_default=False,
        ),
    ],
    tolerance: Annotated[
        float,
        typer.Option(metavar="NUMBER", help="Distance up to which an answer is a solution, as explained above."),
    ] = 1e-4,
    json_file: JsonFile = None,
    csv_file: Annotated[str | None, csv("answer")] = None,
    quiet: Quiet = False,
) -> None:
    """Say which solutions of the collection a solver found, which it missed, and which of its answers are spurious.

    A file holds one or several answers: lambda_n and lambda_t, the contact forces of the nodes in the order of the
    problem; or r, the same in the order of fclib; or u, the displacements. docs/collection.md describes the files.
    Problems without a file count as not tried.

    Tolerance: an answer is a solution if no contact force differs from that solution's by more than the tolerance times
    the largest contact force of all solutions of the problem, or, for u, no displacement by more than the tolerance
    times the largest one of that solution. All solutions are known, which is proven; so an answer that is close to none
    of them is spurious.

    Exit status: 0 if all solutions of every problem that was tried were found, and every answer is one; 3 if a solution
    was missed or an answer is spurious; 2 on bad input; 74 if a result could not be written; 141 if the program that
    read it has ended.
    """
    from enumsol import collection  # as above

    report = collection.check(solutions, tolerance)
    deliver(
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: repr(report),
        content=report.summary,
        frame=report.to_frame,
    )
    raise typer.Exit(ExitStatus.DONE if report.ok else ExitStatus.INCOMPLETE)
