"""Arguments and options of commands: their kinds, how they come from signatures and docstrings, and files.

A parameter of a command is an option of its name, and its annotation one of the kinds below, which says what typer is
told of it. The help is in the docstring's last section, ``Parameters``, or in `_SHARED`. Files are checked
before a command does anything: outputs can be written where they are to go; none takes the place of an input, or of
another output of the same call.
"""

from __future__ import annotations

import os
import re
import types
from collections.abc import Callable
from copy import copy
from glob import escape
from importlib.util import find_spec
from inspect import Parameter, cleandoc, signature
from itertools import combinations
from os.path import exists, isdir, isfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin

import typer
from typer.core import TyperCommand

from enumsol.cli.common import DECK, TOML, with_decks
from enumsol.cli.progress import set_quiet
from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.support.files import check_replaceable

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Metavariables of what a command writes, and of what it reads.
_WRITTEN, _READ = ("FILE",), ("PROBLEM", "MESH", "POINTS", "PROOF", "SOLUTIONS", "GRAPH", "STEPS")
#: First bytes of the files that some options write, and the kinds of these files in words. In this table and below an
#: option of one command only has the command's name before its own.
_PAGE = (b"<!DOCTYPE html>", "an HTML page")
_BEGINNINGS = {
    "--proof": (b"enumsol-proof ", "a proof"),
    "--save": (b'{"format": "enumsol-', "a saved graph or history"),
    "--report": _PAGE,
    "report --output": _PAGE,
    "--graphml": (b"<?xml", "a GraphML file"),
}
#: Outputs that may be ``-``, at most one of a call; and those that may not, with a reason.
_TEXTS = ("--json", "--csv")
_NO_TEXTS = {
    **dict.fromkeys(("--proof", "--save", "--graphml", "--report", "report --output"), ""),
    **dict.fromkeys(("roots --proof", "solve --proof"), ", but a proof is a binary file"),
    **dict.fromkeys(("--npz", "--vtu"), ", but it is a binary file"),
    **dict.fromkeys(("--frd", "--start"), ""),
    "--plot": ", but a figure is a binary file",
}
#: Patterns by which meshes name files that belong to them: heavy data of XDMF, included files of Abaqus.
_REFERENCES = {".xdmf": rb"([^\s<>]+):/", ".inp": rb"(?i)input\s*=\s*([^,\r\n]+)"}
#: Files of a problem in a directory.
_MATRICES = ("*.mtx", "node_ids.json")


class FileCommand(TyperCommand):
    """A command that refuses, before it does anything, outputs that cannot be written or would replace other files.

    Raises
    ------
    InvalidArgumentError
        An output cannot be written, or not to stdout; it is an input, by whatever name, or another output, or an
        existing file of another kind than the option writes.
    MissingDependencyError
        What writes it is not installed.
    """

    def invoke(self, ctx: Any) -> Any:
        """Check the files, then run the command."""
        named = [(option.metavar, option.opts[0], option, ctx.params.get(option.name)) for option in self.params]
        given = [(metavar, name, value) for metavar, name, _, value in named if isinstance(value, str)]
        outputs = [(_called(name), value) for metavar, name, value in given if metavar in _WRITTEN]
        inputs = [(metavar, "/dev/stdin" if value == "-" else value) for metavar, _, value in given if metavar in _READ]
        check_files(inputs, [(name, value) for name, value in outputs if value != "-"])
        terminal = [name for name, value in outputs if value == "-" and name in _TEXTS]
        if len(terminal) > 1:
            raise InvalidArgumentError(f"{' and '.join(terminal)} are both -; expected one of them to be a file")
        for name, value in outputs:
            check_output(name, value, f"{ctx.info_name} {name}")
        return super().invoke(ctx)


def check_output(name: str, value: str, own: str) -> None:
    """Refuse an output that cannot be written, before a long search rather than after it.

    Parameters
    ----------
    name, value : str
        Of the option.
    own : str
        Name of the option after that of its command, under which tables may have it.

    Raises
    ------
    InvalidArgumentError, MissingDependencyError
        As `FileCommand`.
    """
    kind = own if own in _NO_TEXTS else name
    if kind not in _NO_TEXTS and kind not in _TEXTS:
        return  # a problem, which may be a directory
    ending = f".{name.removeprefix('--')}"
    if name in ("--vtu", "--frd") and value != "-" and not value.endswith(ending):
        raise InvalidArgumentError(f"{name} is {value!r}; expected a name that ends in {ending}")
    if name == "--plot":
        _need("matplotlib", name, "plots")
    if value != "-":
        _check_writable(value, name)
    elif kind in _NO_TEXTS:
        raise InvalidArgumentError(f"{name} is -{_NO_TEXTS[kind]}; expected the name of a file")
    if name in ("--vtu", "--frd"):
        _need("meshio", name, "meshes")
    if name == "--plot":
        _check_format(value)
    beginning = _BEGINNINGS.get(own, _BEGINNINGS.get(name))
    if beginning is not None and value != "-":
        check_replaceable(Path(value), name, *beginning)


def _need(module: str, option: str, extra: str) -> None:
    if find_spec(module) is None:
        raise MissingDependencyError(
            f'{option} needs {module}, which is not installed; install it with: pip install "enumsol[{extra}]"'
        )


def _check_writable(path: str, option: str) -> None:
    place = Path(path)
    if isdir(place):
        raise InvalidArgumentError(
            f"{option} is {path}, a directory; expected the name of a file, or - for the terminal"
        )
    if not isdir(place.parent) or not os.access(place if exists(place) else place.parent, os.W_OK):
        raise InvalidArgumentError(
            f"{option} is {path}, which cannot be written; expected a file in a writable directory"
        )


def _check_format(path: str) -> None:
    """Refuse a figure whose name has an ending for which there is no format."""
    from matplotlib.backend_bases import FigureCanvasBase  # takes a while

    if Path(path).suffix.removeprefix(".").lower() not in FigureCanvasBase.get_supported_filetypes():
        raise InvalidArgumentError(f"--plot is {path}; expected a file name that ends in .png, .pdf or .svg")


def _called(name: str) -> str:
    """Name of an option or an argument in messages."""
    return name if name.startswith("-") else name.upper()


def check_files(inputs: list[tuple[str, str]], outputs: list[tuple[str, str]]) -> None:
    """Refuse outputs that are inputs or one another; each has the name of its option and its own.

    Raises
    ------
    InvalidArgumentError
        Two are one file: by the same path, a link, or letters of another case where these make no difference.
    """
    for (name, value), (other, again) in combinations(outputs, 2):
        if any(_same(a, b) for a in _all_written(name, value) for b in _all_written(other, again)):
            raise InvalidArgumentError(f"{name} is {value}, and {other} is {again}, the same file; expected two files")
    existing = [(name, value, file) for name, value in outputs for file in _all_written(name, value) if exists(file)]
    if not existing:
        return
    for kind, given in inputs:
        for read in _all_read(kind, Path(given)):
            for name, value, file in existing:
                if _same(file, read):
                    what = kind if str(read) == given else f"a file of {kind} {given}"
                    raise InvalidArgumentError(
                        f"{name} is {value}, which would replace {read} ({what}), an input; expected another file"
                    )


def _all_written(name: str, value: str) -> Iterator[Path]:
    """The files that an output may become."""
    place = Path(value)
    if isdir(place):
        for pattern in _MATRICES:
            yield from place.glob(pattern)
        return
    yield place
    if name == "--vtu":
        yield place.with_suffix(".pvd")
        yield from place.parent.glob(f"{escape(place.stem)}-*.vtu")


def _all_read(kind: str, place: Path) -> Iterator[Path]:
    """The files that an input consists of, those among them that are named in others."""
    if isdir(place):
        for pattern in ("*",) if kind == "SOLUTIONS" else _MATRICES:
            yield from (file for file in place.glob(pattern) if isfile(file))
    waiting, seen = [place], set[Path]()
    while waiting:
        file = waiting.pop()
        if isfile(file) and file not in seen:
            yield file
            seen.add(file)
            waiting += [file.parent / name for name in _references(file)]


def _references(place: Path) -> list[str]:
    """Names of other files in a file of a problem or a mesh; what is wrong with it is said where it is read."""
    try:
        if place.suffix == TOML:
            from enumsol.support.saved import toml_from  # numpy: not for --help

            told = toml_from(place.read_bytes())
            named = [told.get("mesh"), told.get("steps")]
            if isinstance(named[0], dict):  # several meshes, some of them placed
                named += [mesh.get("mesh") if isinstance(mesh, dict) else mesh for mesh in named[0].values()]
            return [name for name in named if isinstance(name, str) and name]
        pattern = _REFERENCES.get(place.suffix.lower())
        found = [] if pattern is None else re.findall(pattern, place.read_bytes())
        return [os.fsdecode(name.strip().strip(b"\"'")) for name in found if b"\0" not in name]
    except (OSError, ValueError):
        return []


def _same(a: Path, b: Path) -> bool:
    """True if two names are those of one regular file, which may not be there yet."""
    try:
        return a.samefile(b) and a.is_file()
    except (OSError, ValueError):
        pass
    one, other = (Path(os.path.realpath(place)) for place in (a, b))
    if one == other:
        return True
    return one.parent == other.parent and one.name.casefold() == other.name.casefold() and _folds(one.parent)


def _folds(folder: Path) -> bool:
    """True if upper and lower case are the same in the names of a folder."""
    other = folder.with_name(folder.name.swapcase())
    return other != folder and other.exists() and other.samefile(folder)


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
#: Files to write; those that are read have other metavariables.
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
