"""Contents of mesh files, counted without meshio and compared with what it read of them.

Formats of lines of text are counted here, in which meshio passes over what it does not know.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    import meshio

#: Cards of Nastran that are cells of bodies and facets; CTRIAX and the like are written with a longer name.
_CARDS = ("CTRI", "CTRAX", "CQUAD", "CTETRA", "CHEXA", "CPENTA", "CPYRA", "CPLST", "CSHEAR")
#: Messages of meshio about cells that it leaves out.
_LEFT_OUT = re.compile(
    r"meshio doesn't know (?:Gmf)?(?:Edges|Tri|Quad|Tetra|Hexa|Prism|Pyramid)\w*|could not parse line"
    r"|\$(?:Nodes|Elements) not closed|End-of-file reached before"
)


def refuse_partial(place: Path, mesh: meshio.Mesh, said: str) -> None:
    """Refuse an incomplete mesh that meshio read.

    Parameters
    ----------
    place : Path
    mesh : meshio.Mesh
        Mesh that meshio read.
    said : str
        Text that meshio printed meanwhile.

    Raises
    ------
    InvalidArgumentError
        It left cells or nodes out.
    """
    if left := _LEFT_OUT.search(said):
        raise InvalidArgumentError(
            f"meshio left out a part of it ({left.group()}); expected a format that it reads whole, .msh or .vtu for "
            "example"
        )
    counted = {".bdf": _nastran, ".fem": _nastran, ".nas": _nastran, ".msh": _gmsh}.get(place.suffix.lower())
    found = counted(place) if counted is not None else {}
    cells = sum(len(block.data) for block in mesh.cells if block.type not in ("vertex", "line"))
    every = sum(len(block.data) for block in mesh.cells)
    for what, read in (("nodes", len(mesh.points)), ("cells", every), ("cells of two or three dimensions", cells)):
        if what in found and found[what] != read:
            raise InvalidArgumentError(
                f"meshio reads {read} of {found[what]} {what}; expected a file that it reads whole, .msh in version "
                "4.1 or .vtu for example"
            )


def _nastran(place: Path) -> dict[str, int]:
    """Cards of nodes and of cells."""
    nodes = cells = 0
    with place.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            word = re.split(r"[,*\s]", line[:8].upper(), maxsplit=1)[0]
            nodes += word == "GRID"
            cells += word.startswith(_CARDS)
    return {"nodes": nodes, "cells of two or three dimensions": cells}


def _gmsh(place: Path) -> dict[str, int]:
    """Numbers of nodes and cells that the sections of a text file announce; empty for a binary file."""
    found: dict[str, int] = {}
    with place.open("rb") as file:
        if file.readline().strip() != b"$MeshFormat" or file.readline().split()[1:2] != [b"0"]:
            return {}
        for line in file:
            section = {b"$Nodes": "nodes", b"$Elements": "cells"}.get(line.strip())
            if section is not None:
                numbers = next(file, b"0").split()  # in version 4 behind the number of blocks
                found[section] = found.get(section, 0) + int(numbers[min(1, len(numbers) - 1)])
    return found
