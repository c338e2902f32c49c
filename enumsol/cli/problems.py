"""``enumsol gallery`` and ``enumsol collection``: named problems, those with certified solutions, and files of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from enumsol.cli.common import COLLECTION, GALLERY, ExitStatus
from enumsol.cli.options import Argument, OutputFile, Quiet, add_command
from enumsol.cli.output import deliver, list_entries, named_group
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.gallery import GalleryEntry

gallery_app = named_group("Named problems to experiment with.")
collection_app = named_group("Problems with certified solutions, and a check of what other solvers find.")


def list_gallery(json_file: OutputFile | None = None) -> None:
    """List the problems, each with an alpha of interest and the number of its roots there."""
    from enumsol import gallery  # numpy and scipy: not for --help

    entries = list(gallery.GALLERY.values())
    rows = [(entry.name, f"{entry.alpha:g}", _count(entry), entry.summary) for entry in entries]
    hint = "Try one: enumsol roots gallery:NAME --alpha ALPHA"
    list_entries(("NAME", "alpha", "roots", "what it shows"), rows, json_file=json_file, content=entries, hint=hint)


def _count(entry: GalleryEntry) -> str:
    if entry.roots is None:
        return "family" if entry.dimension == 2 else "-"  # of a large body in 3D the number is not known
    return str(entry.roots)


def write(name: Argument, file: Argument, json_file: OutputFile | None = None, quiet: Quiet = False) -> None:
    """Write the problem NAME to FILE, in a format that read_problem and the other commands accept.

    Parameters
    ----------
    name : Name as in enumsol gallery list.
    file : File to write: .npz, .h5 (fclib), or a directory for MatrixMarket files.
    """
    from enumsol import gallery  # as above
    from enumsol.io import write_problem

    entry = gallery.get(name.removeprefix(GALLERY))
    problem = entry.build()
    write_problem(problem, file)
    command = "fixed-point" if entry.roots is None and entry.dimension == 3 else "roots"
    about = {"name": entry.name, "file": file, "alpha": entry.alpha, "fingerprint": problem.fingerprint}
    deliver(
        json_file=json_file,
        text=lambda: f"wrote {entry.name} to {file}; try: enumsol {command} {file} --alpha {entry.alpha:g}",
        content=lambda: about,
    )


def list_collection(json_file: OutputFile | None = None) -> None:
    """List the problems, each with its dimension, its contact nodes and the number of its solutions."""
    from enumsol import collection  # numpy: not for --help

    columns = ("NAME", "dimension", "nodes", "solutions", "what it shows")
    rows = [
        (entry.name, str(entry.dimension), str(entry.p), entry.solutions_in_words(), entry.summary)
        for entry in collection.COLLECTION.values()
    ]
    hint = "Write them all to a folder: enumsol collection export FOLDER"
    list_entries(columns, rows, json_file=json_file, content=list(collection.COLLECTION.values()), hint=hint)


def export(
    folder: Argument,
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]...", show_default=False)] = None,
    json_file: OutputFile | None = None,
    quiet: Quiet = False,
) -> None:
    """Write the problems as .npz and .h5 (fclib), with their certified solutions (JSON) and proofs, to FOLDER.

    Parameters
    ----------
    folder : Folder to write to; it is made if need be.
    names : Only these problems; default: all.
    """
    from enumsol import collection  # as above

    written = collection.export(folder, [name.removeprefix(COLLECTION) for name in names] if names else None)
    deliver(
        json_file=json_file,
        text=lambda: (
            f"wrote {counted(len(written), 'problem')} to {folder}/problems, and their solutions and proofs to "
            f"{folder}/certified"
        ),
        content=lambda: {"folder": folder, "names": [entry.name for entry in written]},
    )


def check(
    solutions: Argument,
    tolerance: Annotated[float, typer.Option(metavar="NUMBER")] = 1e-4,
    json_file: OutputFile | None = None,
    csv_file: OutputFile | None = None,
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

    Parameters
    ----------
    solutions : A file NAME.npz, .json, .csv or .h5 (fclib) with what a solver found for the problem NAME, or a folder
        of such files.
    tolerance : Distance up to which an answer is a solution, as explained above.
    csv_file : Write a table with one row per answer; - is stdout.
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


for _app, _command, _name in (
    (gallery_app, list_gallery, "list"),
    (gallery_app, write, "write"),
    (collection_app, list_collection, "list"),
    (collection_app, export, "export"),
    (collection_app, check, "check"),
):
    add_command(_app, _command, _name)
