"""The documents as a reader follows them: every block of a page, from top to bottom, in one folder."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import numpy as np

from enumsol import fem
from enumsol.cli import main

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
_BLOCK = re.compile(
    r"^```(\w+)\n((?:[^\n]*\n)*?)```$|^    (?:[^\n]* && )?((?:\.venv/bin/)?enumsol (?:[^\n]*\\\n)*[^\n]*)$",
    re.MULTILINE,
)
_FILE = re.compile(r"`([\w.]+\.(?:toml|inp))`")
#: Languages of blocks that are files, by the last name before them.
_OF_FILES = ("toml", "none")


def blocks(path):
    """Pairs (language, text) of a page in order; commands of enumsol, in indented blocks, are "command"."""
    text = path.read_text(encoding="utf-8")
    for found in _BLOCK.finditer(text):
        if found[3] is not None:
            yield "command", found[3].removeprefix(".venv/bin/")
        elif found[1] in _OF_FILES:
            # the last file that was named before
            yield found[1], (_FILE.findall(text[: found.start()])[-1], found[2])
        else:
            yield found[1], found[2]


def runs(path):
    """Whether something on the page is to be run."""
    return any(kind in ("python", "command") for kind, _ in blocks(path))


def follow(path, folder, names=None):
    """Do what a page says: run Python in one namespace, which is returned, and commands, whose outputs are in it.

    Every command must end with status 0; ``names["outputs"]`` are pairs of a command and what it printed.
    """
    names = {} if names is None else names
    names["outputs"] = []
    with contextlib.chdir(folder):
        for kind, text in blocks(path):
            if kind == "python":
                exec(compile(text, str(path), "exec"), names)
            elif kind in _OF_FILES:
                Path(text[0]).write_text(text[1], encoding="utf-8")
            elif kind == "command":
                names["outputs"].append((text, _output(text)))
    return names


def write_wedge(file):
    """A wedge as gmsh writes one, with physical groups tip, right, top and left."""
    import meshio

    mesh = fem.trapezoid(3, 3, bottom=1.0, top=1.8, height=1.0)
    sides = {"tip": mesh.bottom, "right": mesh.right, "top": mesh.top, "left": mesh.left}
    cells = [("triangle", mesh.triangles), *(("line", fem.edges_along(side)) for side in sides.values())]
    tags = [np.full(len(block[1]), k) for k, block in enumerate(cells)]
    body = meshio.Mesh(
        np.c_[mesh.points, np.zeros(len(mesh.points))],
        cells,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array([k + 1, 1]) for k, name in enumerate(sides)},
    )
    body.write(file, file_format="gmsh22", binary=False)


def _output(command):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(shlex.split(command.replace("\\\n", " "))[1:])
    assert status == 0, (command, status, out.getvalue(), err.getvalue())
    return out.getvalue()
