"""Results on stdout and in files: texts, JSON, figures.

What cannot be written after a search is an OutputError, and keeps no other result from being written; what is wrong
with the name of a file is said before (`enumsol.cli.options`).
"""

from __future__ import annotations

import json
import math
import shlex
import sys
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from enumsol.cli.common import options_said
from enumsol.cli.progress import is_quiet, pour, say
from enumsol.errors import InvalidArgumentError, MissingDependencyError, OutputError
from enumsol.support.files import write_file
from enumsol.support.messages import aligned

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas as pd
    from matplotlib.figure import Figure

    from enumsol.model.problem3d import AnyProblem

    #: Where a result goes, None where it is not asked for, and what writes it there.
    Output = tuple[str | None, Callable[[str], object]]


def write_text(path: str, text: str) -> None:
    """Write a result to a file, or to stdout for ``-``.

    Raises
    ------
    OutputError, InvalidArgumentError
        It cannot be written, see `writing`.
    """
    if path == "-":
        pour(text)
        return
    write_file(Path(path), text if text.endswith("\n") else text + "\n", "file")


def deliver(
    *more: Output,
    json_file: str | None,
    text: Callable[[], str],
    content: Callable[[], Any],
    csv_file: str | None = None,
    frame: Callable[[], pd.DataFrame] | None = None,
) -> None:
    """Write results: text on stdout, unless a file is to be written there or --quiet is given; JSON; a table; ``more``.

    ``content`` is what JSON holds, or its text.

    Raises
    ------
    OutputError
        Some could not be written, after all the others were.
    """
    outputs: tuple[Output, ...] = (
        (None if "-" in (json_file, csv_file) or is_quiet() else "-", lambda _: say(text())),
        (json_file, lambda path: write_text(path, as_json(content()))),
        (csv_file, lambda path: write_text(path, _csv(frame))),
        *more,
    )
    failures = []
    for path, write in outputs:
        try:
            if path is not None:
                write(path)
        except OutputError as error:
            failures.append(error)
        except InvalidArgumentError as error:
            if not isinstance(error.__cause__, OSError):
                raise
            failures.append(OutputError(str(error)))  # a place that was there before the search and is not any more
    if len(failures) == 1:
        raise failures[0]
    if failures:
        raise OutputError("; ".join(map(str, failures)))


def _csv(frame: Callable[[], pd.DataFrame] | None) -> str:
    return "" if frame is None else frame().to_csv(index=False)


def check_places(path: str | None, problem: AnyProblem, name: str) -> None:
    """Refuse files for ParaView of a problem that has no places, before the search.

    Raises
    ------
    InvalidArgumentError
        The problem, which is called ``name``, has neither mesh nor coordinates.
    """
    if path is not None and problem.mesh is None and problem.coordinates is None:
        raise InvalidArgumentError(f"--vtu is given, but {name} has neither mesh nor coordinates; expected one of them")


def check_mesh(path: str | None, problem: AnyProblem, name: str) -> None:
    """Refuse files for CGX of a problem that has no mesh, before the search.

    Raises
    ------
    InvalidArgumentError
        The problem, which is called ``name``, has no mesh.
    """
    if path is not None and problem.mesh is None:
        raise InvalidArgumentError(f"--frd is given, but {name} has no mesh; expected a problem made of one")


def check_scripts(path: str | None, problem: AnyProblem) -> None:
    """Refuse a page that plotly's script draws, before the search.

    Raises
    ------
    MissingDependencyError
        plotly is not installed, and the problem is one in 3D.
    """
    if path is not None and not hasattr(problem, "Bt") and find_spec("plotly") is None:
        raise MissingDependencyError.of("reports", "plotly", "report")


def checking_commands(proven: bool, source: str | None, command: str, place: str, proof: str | None) -> list[str]:
    """Commands by which the reader of a page checks the proof; none where there is none, or no file of the problem.

    ``command`` with the options ``place`` gives the proof again where it is in no file.
    """
    if not proven or source is None:
        return []
    problem, file = shlex.quote(source) + options_said(), f"{command}.proof" if proof is None else shlex.quote(proof)
    verify = f"enumsol verify {problem} {file}"
    return [verify] if proof is not None else [f"enumsol {command} {problem} {place} --proof {file}", verify]


def write_figure(path: str, figure: Figure) -> None:
    """Write a matplotlib figure.

    Raises
    ------
    OutputError, InvalidArgumentError
        The file cannot be written, see `kept`.
    """
    from enumsol.support.plotting import kept  # numpy: not for --help

    kept(figure, path)


def as_json(content: object) -> str:
    """JSON text of what `plain` takes; what is not finite is null. A text is JSON already."""
    return content if isinstance(content, str) else json.dumps(plain(content), indent=1)


def taken(of: object, *names: str) -> dict[str, Any]:
    """Attributes of a result by their names, for JSON."""
    return {name: getattr(of, name) for name in names}


def plain(value: object) -> Any:
    """Values that JSON can hold, of mappings, sequences, sets, arrays, numbers and members of enumerations."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, frozenset):
        return sorted(plain(item) for item in value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Fraction):
        return plain(float(value))
    if hasattr(value, "tolist"):  # arrays and numbers of numpy, which is not imported for --help
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def named_group(text: str) -> typer.Typer:
    """A group of commands that prints its help when none of them is asked for."""
    app = typer.Typer(help=text, no_args_is_help=False)

    @app.callback(invoke_without_command=True)
    def _group(context: typer.Context) -> None:
        if context.invoked_subcommand is None:
            say(context.get_help())

    return app


def list_entries(
    columns: Sequence[str], rows: Sequence[Sequence[str]], *, json_file: str | None, content: Sequence[Any], hint: str
) -> None:
    """Print a table of entries, whose last column is a text of any length, and write them as JSON.

    ``content`` are the entries, dataclasses; what cannot be printed (a function) is left out.
    """
    if json_file is not None:
        entries = [taken(entry, *(item.name for item in fields(entry) if item.repr)) for entry in content]
        write_text(json_file, as_json(entries))
        if json_file == "-":
            return
    if not sys.stdout.isatty():
        # for other programs: one line per problem, however long
        # written at once: nothing is left to write when a reader has read enough (| head)
        say("\n".join(aligned(rows, free=True)))
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
