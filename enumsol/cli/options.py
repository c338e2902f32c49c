"""Arguments and options of commands: their kinds, and how they come from signatures and docstrings.

A parameter of a command is an option of its name, and its annotation one of the kinds below, which says what typer is
told of it. The help is in the docstring's last section, ``Parameters``, or in `_SHARED`.
"""

from __future__ import annotations

import re
import types
from collections.abc import Callable
from copy import copy
from inspect import Parameter, cleandoc, signature
from os.path import isdir
from typing import Annotated, Literal, Union, get_args, get_origin

import typer

from enumsol.cli.decks import DECK, with_decks
from enumsol.cli.files import FileCommand
from enumsol.cli.streams import set_quiet

#: Groups of options in the help of every command.
LIMITS, OUTPUT, PLOT, STEPS = "Limits", "Output", "Plot", "Steps"

#: Help of parameters of several commands, where a command's docstring has none of its own.
_SHARED = {
    "problem": "A file (.npz, .h5, .toml, .inp), a directory of MatrixMarket files, gallery:NAME or collection:NAME.",
    "first": "First alpha: a number or a fraction.",
    "last": "Last alpha: a number or a fraction.",
    "max_nodes": "Stop after N nodes of the tree.",
    "time_limit": "Stop after this time.",
    "jobs": "Number of processes that search.",
    "json_file": "Write the result as JSON; - is stdout.",
    "frd_file": "Write deformed bodies with forces and stresses for CGX; every root is a step of the file.",
    "vtu_file": "Write deformed bodies with forces and stresses for ParaView; of several roots FILE-0.vtu, ...",
    "plot_file": "Draw a figure: .png, .pdf, .svg.",
    "units": "Units of what is printed and drawn, such as N,mm.",
    "title": "Heading of the page; default: PROBLEM.",
    "quiet": "Print no result, note or progress; files, JSON, errors and the exit status remain.",
}
#: Options that are not called as their parameters are.
_FLAGS = {"first": "--from", "last": "--to"}


def problem_names(incomplete: str) -> list[str]:
    """Completions of an argument PROBLEM: problems of both lists, and files and directories that may hold one."""
    from glob import escape, glob  # for a shell that completes only

    from enumsol import collection, gallery
    from enumsol.cli.common import COLLECTION, GALLERY, TOML
    from enumsol.io import SUFFIXES

    kinds = (*SUFFIXES, TOML, DECK)
    files = [name for name in sorted(glob(escape(incomplete) + "*")) if isdir(name) or name.endswith(kinds)]
    # a shell that takes the colon for the end of a word asks for what follows it
    names = [f"{GALLERY}{name}" for name in gallery.GALLERY]
    names += [f"{COLLECTION}{name}" for name in collection.COLLECTION]
    return files + [name for name in (*names, *gallery.GALLERY) if incomplete and name.startswith(incomplete)]


# -- kinds -------------------------------------------------------------------------------------------------------------

Argument = Annotated[str, typer.Argument(show_default=False)]
Problem = Annotated[str, typer.Argument(autocompletion=problem_names, show_default=False)]
#: A number or, where it is alpha, a fraction.
Number = Annotated[str, typer.Option(metavar="NUMBER", show_default=False)]
Count = Annotated[int, typer.Option(min=1, metavar="N", rich_help_panel=LIMITS)]
Seconds = Annotated[float, typer.Option(metavar="SECONDS", rich_help_panel=LIMITS)]
#: Files to write; those that are read have other metavariables (cli.files).
OutputFile = Annotated[str, typer.Option(metavar="FILE", rich_help_panel=OUTPUT)]
PlotFile = Annotated[str, typer.Option(metavar="FILE", rich_help_panel=PLOT)]
Units = Annotated[str, typer.Option(metavar="FORCE,LENGTH", rich_help_panel=OUTPUT)]
Title = Annotated[str, typer.Option(metavar="TEXT", rich_help_panel=OUTPUT)]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", callback=set_quiet, rich_help_panel=OUTPUT)]
OutputFlag = Annotated[bool, typer.Option(rich_help_panel=OUTPUT)]
Arithmetic = Literal["verified", "fast", "exact"]
Quantity = Annotated[Literal["lambda_n", "lambda_t", "u_n", "u_t"], typer.Option(rich_help_panel=PLOT)]


# -- from signatures and docstrings ------------------------------------------------------------------------------------


def add_command(app: typer.Typer, command: Callable[..., None], name: str | None = None) -> None:
    """Add a command, whose options are the parameters of a function and whose help is its docstring."""
    command, parameters = with_decks(command, options_of(command))
    # typer reads both
    command.__signature__ = signature(command).replace(parameters=parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {option.name: option.annotation for option in parameters}
    name = name or command.__name__.replace("_", "-")
    app.command(name, cls=FileCommand, help=_sections(command)[0])(command)


def options_of(command: Callable[..., object], *without: str) -> list[Parameter]:
    """Parameters of a function or a dataclass, but for some, annotated as typer reads them."""
    helps = _sections(command)[1]
    parameters = signature(command, eval_str=True).parameters.values()
    return [
        parameter if parameter.kind is Parameter.VAR_KEYWORD else _as_option(parameter, helps.get(parameter.name))
        for parameter in parameters
        if parameter.name not in without
    ]


def with_options(*options: Parameter, after: int) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A decorator: these options take the place of a command's ``**named``, after so many arguments of its own."""

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        signed = signature(command, eval_str=True)
        *own, _ = signed.parameters.values()
        more = [option.replace(kind=Parameter.KEYWORD_ONLY) for option in options]
        command.__signature__ = signed.replace(parameters=[*own[:after], *more, *own[after:]])  # type: ignore[attr-defined]
        return command

    return decorated


def _sections(command: Callable[..., object]) -> tuple[str, dict[str, str]]:
    """A docstring without its section about parameters, and what that says of each."""
    text, _, section = cleandoc(command.__doc__ or "").partition("\n\nParameters\n----------\n")
    parts = re.split(r"^(\w+) : ", section, flags=re.MULTILINE)[1:]
    return text, {name: " ".join(said.split()) for name, said in zip(parts[::2], parts[1::2], strict=True)}


def _as_option(parameter: Parameter, said: str | None) -> Parameter:
    """A parameter whose annotation tells typer what its kind, its name and its help are."""
    kind, found = parameter.annotation, None
    optional = get_origin(kind) in (Union, types.UnionType)
    for part in get_args(kind) if optional else (kind,):
        if get_origin(part) is Annotated:
            plain, found = get_args(part)
            kind = plain | None if optional else plain
    info = typer.Option() if found is None else copy(found)
    info.help = said or info.help or _SHARED.get(parameter.name)
    name = parameter.name
    if isinstance(info, typer.models.ArgumentInfo):
        info.metavar = info.metavar or name.upper()
    elif info.default is ... and not info.param_decls:  # it has no names yet
        info.param_decls = (_FLAGS.get(name, "--" + name.removesuffix("_file").replace("_", "-")),)
    return parameter.replace(annotation=Annotated[kind, info])
