"""Arguments and options that commands share, with their help texts."""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, signature
from os.path import isdir
from typing import Annotated, Any, Literal

import typer

from enumsol.cli.streams import set_quiet

#: Groups of options in the help of every command.
LIMITS, OUTPUT, PLOT, STEPS = "Limits", "Output", "Plot", "Steps"


def number(name: str, text: str) -> Any:
    """An option that takes a number, or a fraction where that is alpha."""
    return typer.Option(name, metavar="NUMBER", help=text, show_default=False)


def count(text: str, *, least: int = 1, panel: str | None = LIMITS, metavar: str = "N") -> Any:
    """An option that takes a whole number."""
    return typer.Option(min=least, metavar=metavar, help=text, rich_help_panel=panel)


def seconds(text: str) -> Any:
    """An option that takes a time."""
    return typer.Option(metavar="SECONDS", help=text, rich_help_panel=LIMITS)


def file(name: str, text: str, panel: str | None = OUTPUT, metavar: str = "FILE") -> Any:
    """An option that takes the name of a file to write; of one that is read with another ``metavar`` (cli.files)."""
    return typer.Option(name, metavar=metavar, help=text, rich_help_panel=panel)


def step(metavar: str | None, text: str) -> Any:
    """An option of the steps of a continuation."""
    return typer.Option(metavar=metavar, help=text, rich_help_panel=STEPS)


def node(name: str, metavar: str, text: str) -> Any:
    """An option that takes labels of contact nodes to draw."""
    return typer.Option(name, metavar=metavar, help=text, rich_help_panel=PLOT)


def axis(name: str, text: str) -> Any:
    """An option that takes what an axis of a figure shows."""
    return typer.Option(name, help=text, rich_help_panel=PLOT)


def csv(text: str) -> Any:
    """The option --csv; ``text`` says what there is one row per, and what the file is for."""
    return file("--csv", f"Write a table with one row per {text}; - is stdout.")


def with_options(*options: Parameter, after: int) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A decorator: these options take the place of a command's ``**named``, after so many arguments of its own."""

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        # typer reads both
        signed = signature(command, eval_str=True)
        *own, _ = signed.parameters.values()
        signed = signed.replace(parameters=[*own[:after], *options, *own[after:]])
        command.__signature__ = signed  # type: ignore[attr-defined]
        command.__annotations__ |= {option.name: option.annotation for option in options}
        return command

    return decorated


def problem_names(incomplete: str) -> list[str]:
    """Completions of an argument PROBLEM: problems of both lists, and files and directories that may hold one."""
    from glob import escape, glob  # for a shell that completes only

    from enumsol import collection, gallery
    from enumsol.cli.common import COLLECTION, GALLERY, TOML
    from enumsol.io import SUFFIXES

    kinds = (*SUFFIXES, TOML)
    files = [name for name in sorted(glob(escape(incomplete) + "*")) if isdir(name) or name.endswith(kinds)]
    # a shell that takes the colon for the end of a word asks for what follows it
    names = [f"{GALLERY}{name}" for name in gallery.GALLERY]
    names += [f"{COLLECTION}{name}" for name in collection.COLLECTION]
    return files + [name for name in (*names, *gallery.GALLERY) if incomplete and name.startswith(incomplete)]


ProblemArgument = Annotated[
    str,
    typer.Argument(
        metavar="PROBLEM",
        help="A file (.npz, .h5, .toml), a directory of MatrixMarket files, gallery:NAME or collection:NAME.",
        autocompletion=problem_names,
        show_default=False,
    ),
]
Arithmetic = Literal["verified", "fast", "exact"]
Quantity = Literal["lambda_n", "lambda_t", "u_n", "u_t"]
FirstAlpha = Annotated[str, number("--from", "First alpha: a number or a fraction.")]
LastAlpha = Annotated[str, number("--to", "Last alpha: a number or a fraction.")]
TimeLimit = Annotated[float | None, seconds("Stop after this time.")]
Jobs = Annotated[int, count("Number of processes that search.")]
MaxNodes = Annotated[int | None, count("Stop after N nodes of the tree.")]
Quiet = Annotated[
    bool,
    typer.Option(
        "--quiet",
        "-q",
        callback=set_quiet,
        help="Print no result, note or progress; files, JSON, errors and the exit status remain.",
        rich_help_panel=OUTPUT,
    ),
]
JsonFile = Annotated[str | None, file("--json", "Write the result as JSON; - is stdout.")]
VtuFile = Annotated[
    str | None,
    file("--vtu", "Write deformed bodies with forces and stresses for ParaView; of several roots FILE-0.vtu, ..."),
]
ReportFile = Annotated[str | None, file("--report", "Write an HTML page about the roots, with their deformed bodies.")]
Units = Annotated[
    str | None,
    typer.Option(
        metavar="FORCE,LENGTH", help="Units of what is printed and drawn, such as N,mm.", rich_help_panel=OUTPUT
    ),
]
Title = Annotated[
    str | None, typer.Option(metavar="TEXT", help="Heading of the page; default: PROBLEM.", rich_help_panel=OUTPUT)
]
PlotFile = Annotated[str | None, file("--plot", "Draw a figure: .png, .pdf, .svg.", PLOT)]
Overview = Literal["norm", "sum_n", "sum_t", "lambda_n", "lambda_t", "u_n", "u_t"]
DrawnQuantity = Annotated[Quantity, typer.Option(help="Quantity drawn against alpha.", rich_help_panel=PLOT)]
