"""The files that a command names, checked before it does anything.

Outputs can be written where they are to go; none takes the place of an input, or of another output of the same call.
"""

from __future__ import annotations

import os
import re
from glob import escape
from importlib.util import find_spec
from itertools import combinations
from os.path import exists, isdir, isfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer.core import TyperCommand

from enumsol.cli.common import TOML
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
