"""``enumsol gallery``: the named problems, and files made of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from enumsol.cli.files import FileCommand
from enumsol.cli.options import JsonFile, Quiet
from enumsol.cli.output import deliver, list_entries, named_group

if TYPE_CHECKING:
    from enumsol.gallery import GalleryEntry

app = named_group("Named problems to experiment with.")


@app.command("list", cls=FileCommand)
def list_(json_file: JsonFile = None) -> None:
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


@app.command(cls=FileCommand)
def write(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name as in enumsol gallery list.", show_default=False)],
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="File to write: .npz, .h5 (fclib), or a directory for MatrixMarket files.",
            show_default=False,
        ),
    ],
    json_file: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Write the problem NAME to FILE, in a format that read_problem and the other commands accept."""
    from enumsol import gallery  # as above
    from enumsol.io import write_problem

    entry = gallery.get(name.removeprefix("gallery:"))
    problem = entry.build()
    write_problem(problem, file)
    command = "fixed-point" if entry.roots is None and entry.dimension == 3 else "roots"
    about = {"name": entry.name, "file": file, "alpha": entry.alpha, "fingerprint": problem.fingerprint}
    deliver(
        json_file=json_file,
        text=lambda: f"wrote {entry.name} to {file}; try: enumsol {command} {file} --alpha {entry.alpha:g}",
        content=lambda: about,
    )
