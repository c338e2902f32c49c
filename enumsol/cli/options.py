"""Arguments and options that commands share, with their texts of help."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import typer

#: Groups of options in the help of every command.
LIMITS, OUTPUT, PLOT, STEPS = "Limits", "Output", "Plot", "Steps"


def number(name: str, text: str) -> Any:
    """An option that takes a number, or a fraction where that is alpha."""
    return typer.Option(name, metavar="NUMBER", help=text, show_default=False)


def count(text: str, *, least: int = 1, panel: str = LIMITS) -> Any:
    """An option that takes a whole number."""
    return typer.Option(min=least, metavar="N", help=text, rich_help_panel=panel)


def seconds(text: str) -> Any:
    """An option that takes a time."""
    return typer.Option(metavar="SECONDS", help=text, rich_help_panel=LIMITS)


def file(name: str, text: str, panel: str | None = OUTPUT) -> Any:
    """An option that takes the name of a file."""
    return typer.Option(name, metavar="FILE", help=text, rich_help_panel=panel)


def step(metavar: str | None, text: str) -> Any:
    """An option of the steps of a continuation."""
    return typer.Option(metavar=metavar, help=text, rich_help_panel=STEPS)


def node(name: str, metavar: str, text: str) -> Any:
    """An option that takes labels of contact nodes to draw."""
    return typer.Option(name, metavar=metavar, help=text, rich_help_panel=PLOT)


def csv(text: str) -> Any:
    """The option --csv; ``text`` says what a row is, and what the file is for."""
    return file("--csv", f"Write one row {text}; - is stdout.")


ProblemArgument = Annotated[
    str,
    typer.Argument(
        metavar="PROBLEM",
        help="A file (.npz, .h5, .toml), a directory of MatrixMarket files, or gallery:NAME.",
        show_default=False,
    ),
]
Arithmetic = Literal["verified", "fast", "exact"]
Quantity = Literal["lambda_n", "lambda_t", "u_n", "u_t"]
FirstAlpha = Annotated[str, number("--from", "First alpha: a number or a fraction.")]
LastAlpha = Annotated[str, number("--to", "Last alpha: a number or a fraction.")]
MaxNodes = Annotated[int | None, count("Stop after N nodes of the tree.")]
JsonFile = Annotated[str | None, file("--json", "Write the result as JSON; - is stdout.")]
PlotFile = Annotated[str | None, file("--plot", "Draw a figure: .png, .pdf, .svg.", PLOT)]
DrawnQuantity = Annotated[Quantity, typer.Option(help="What is drawn against alpha.", rich_help_panel=PLOT)]
