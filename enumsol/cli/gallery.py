"""``enumsol gallery``: the named problems, and files made of them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from enumsol.cli.options import JsonFile, Quiet
from enumsol.cli.output import as_json, check_outputs, deliver, write_text

if TYPE_CHECKING:
    from enumsol.gallery import GalleryEntry

app = typer.Typer(help="Named problems to experiment with.", no_args_is_help=False)


@app.callback(invoke_without_command=True)
def _gallery(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command("list")
def list_(json_file: JsonFile = None) -> None:
    """List the problems, each with an alpha of interest and the number of its roots there."""
    from enumsol import gallery  # numpy and scipy: not for --help

    check_outputs(json=json_file)
    if json_file is not None:
        names = ("name", "summary", "alpha", "roots", "dimension")
        entries = [{name: getattr(entry, name) for name in names} for entry in gallery.GALLERY.values()]
        write_text(json_file, as_json(entries))
        if json_file == "-":
            return
    rows = [(entry.name, f"{entry.alpha:g}", _count(entry), entry.summary) for entry in gallery.GALLERY.values()]
    if not sys.stdout.isatty():
        # for other programs: one line per problem, however long
        widths = [max(len(row[k]) for row in rows) for k in range(3)]
        # written at once: nothing is left to write when a reader has read enough (| head)
        typer.echo(
            "\n".join(
                f"{name:<{widths[0]}}  {alpha:>{widths[1]}}  {roots:>{widths[2]}}  {summary}"
                for name, alpha, roots, summary in rows
            )
        )
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("NAME", no_wrap=True)
    table.add_column("alpha", justify="right", no_wrap=True)
    table.add_column("roots", justify="right", no_wrap=True)
    table.add_column("what it shows")
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False)
    console.print(table, markup=False)
    console.print("\nTry one: enumsol roots gallery:NAME --alpha ALPHA", style="dim", markup=False)


def _count(entry: GalleryEntry) -> str:
    if entry.roots is None:
        return "family" if entry.dimension == 2 else "-"  # of a large body in 3D the number is not known
    return str(entry.roots)


@app.command()
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

    check_outputs(json=json_file)
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
