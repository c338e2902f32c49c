"""Lists of named problems, of the gallery and of the collection."""

from __future__ import annotations

import sys
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import typer

from enumsol.cli.output import as_json, write_text

if TYPE_CHECKING:
    from collections.abc import Sequence


def named_group(text: str) -> typer.Typer:
    """A group of commands that prints its help when none of them is asked for."""
    app = typer.Typer(help=text, no_args_is_help=False)

    @app.callback(invoke_without_command=True)
    def _group(context: typer.Context) -> None:
        if context.invoked_subcommand is None:
            typer.echo(context.get_help())

    return app


def list_entries(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    json_file: str | None,
    content: Sequence[Any],
    hint: str,
) -> None:
    """Print a table of entries, whose last column is a text of any length, and write them as JSON.

    ``content`` are the entries, dataclasses; what cannot be printed (a function) is left out.
    """
    if json_file is not None:
        entries = [{name: getattr(entry, name) for name in _shown(entry)} for entry in content]
        write_text(json_file, as_json(entries))
        if json_file == "-":
            return
    if not sys.stdout.isatty():
        # for other programs: one line per problem, however long
        widths = [max(len(row[k]) for row in rows) for k in range(len(columns) - 1)]
        # written at once: nothing is left to write when a reader has read enough (| head)
        typer.echo(
            "\n".join(
                "  ".join(
                    [
                        f"{row[0]:<{widths[0]}}",
                        *(f"{item:>{width}}" for item, width in zip(row[1:-1], widths[1:], strict=True)),
                        row[-1],
                    ]
                )
                for row in rows
            )
        )
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(columns[0], no_wrap=True)
    for name in columns[1:-1]:
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column(columns[-1])
    for row in rows:
        table.add_row(*row)
    console = Console(highlight=False)
    console.print(table, markup=False)
    console.print(f"\n{hint}", style="dim", markup=False)


def _shown(entry: Any) -> list[str]:
    return [item.name for item in fields(entry) if item.repr]
