"""Contents of mesh files, counted without meshio and compared with what it read of them.

Formats of lines of text are counted here, in which meshio passes over what it does not know.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.support.array_types import Integers

if TYPE_CHECKING:
    import meshio

#: Files may include others to this depth.
_DEEPEST = 20
#: Function of the entries of a line of data and the place of the first comment before it in its block.
Taker = Callable[[list[str], str], None]
#: Keywords of decks that make or move nodes and cells.
_MAKERS = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM")
#: Cards of Nastran that are cells of bodies and facets; CTRIAX and the like are written with a longer name.
_CARDS = ("CTRI", "CTRAX", "CQUAD", "CTETRA", "CHEXA", "CPENTA", "CPYRA", "CPLST", "CSHEAR")
#: Types of elements whose formulation is taken as it is: plane stress or strain, or solid; and their variants.
_PLAIN, _VARIANT = re.compile(r"(CPS|CPE|C3D)\d+"), re.compile(r"((?:CPS|CPE|C3D)\d+)[A-Z]+")
_STRANGE = {"S": "shells", "R": "rigid", "M": "membranes", "C": "no plane elements"}
#: Messages of meshio about cells that it leaves out.
_LEFT_OUT = re.compile(
    r"meshio doesn't know (?:Gmf)?(?:Edges|Tri|Quad|Tetra|Hexa|Prism|Pyramid)\w*|could not parse line"
    r"|\$(?:Nodes|Elements) not closed|End-of-file reached before"
)


@dataclass
class Elements:
    """A block of elements in a deck.

    Attributes
    ----------
    type : str
        As the deck calls it, "C3D8I" for example.
    line : str
        Where it begins, or where a comment interrupts it.
    data : list of int
        The number of every element, followed by its nodes.
    numbers : list of int
        Those of the elements, once the number of their nodes is known.
    """

    type: str
    line: str
    data: list[int] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)


@dataclass
class _Set:
    """Members of a set in a deck: ranges of numbers, and names of other sets."""

    line: str
    ranges: list[range] = field(default_factory=list)
    others: list[str] = field(default_factory=list)


@dataclass
class Deck:
    """Contents of a deck of Abaqus or CalculiX (`.inp`).

    Attributes
    ----------
    nodes : list of int
        Numbers of all nodes, in the order of the file.
    blocks : list of Elements
    sets : mapping of ("NSET" or "ELSET", name) to _Set
    of_blocks : mapping of names to lists of int
        Sets that blocks of elements name, by the places of these blocks.
    carrier : bool
        Whether types of elements mean nothing: meshio writes one for each shape of cells.
    torn : bool
        Whether nodes are in several blocks, or go on after a comment; ``node_line`` is where.
    instances : int
        How many parts are put together.
    """

    nodes: list[int] = field(default_factory=list)
    blocks: list[Elements] = field(default_factory=list)
    sets: dict[tuple[str, str], _Set] = field(default_factory=dict)
    of_blocks: dict[str, list[int]] = field(default_factory=dict)
    carrier: bool = False
    node_line: str = ""
    torn: bool = False
    instances: int = 0

    @classmethod
    def read(cls, place: Path) -> Deck:
        """Contents of a deck and of the files that it includes.

        Raises
        ------
        InvalidArgumentError
            It makes or moves nodes or cells by keywords that meshio does not know.
        """
        deck = cls()
        add: Taker | None = None
        comment = ""
        for where, text in _lines(place, place, 0):
            if text.startswith("**"):
                comment = comment or where
            elif text.startswith("*"):
                add, comment = deck._begin(where, text), ""
            elif add is not None and text:
                add([entry for entry in map(str.strip, text.split(",")) if entry], comment)
            elif "written by meshio" in text:
                deck.carrier = True
        return deck

    def _begin(self, where: str, text: str) -> Taker | None:
        """Function that takes the lines of data after a keyword; None if they are not of the mesh."""
        word, *pairs = text[1:].split(",")
        keyword = " ".join(word.upper().split())
        options = {name.strip().upper(): value.strip() for name, _, value in (pair.partition("=") for pair in pairs)}
        if keyword in _MAKERS:
            raise InvalidArgumentError(
                f"*{keyword} at {where} makes or moves nodes or cells, which is not read; expected all of them "
                "written out"
            )
        if keyword == "INSTANCE":
            self.instances += 1
            return lambda _, __: self._refuse_instances(where)
        if keyword == "NODE":
            if self.nodes and not self.torn:
                self.torn, self.node_line = True, where
            if "NSET" in options:
                self._set("NSET", options["NSET"], where)
            name = _key(options["NSET"]) if "NSET" in options else None
            return lambda entries, after: self._node(entries, after, name)
        if keyword == "ELEMENT":
            block = Elements(options.get("TYPE", ""), where)
            if "ELSET" in options:
                self.of_blocks.setdefault(_key(options["ELSET"]), []).append(len(self.blocks))
            self.blocks.append(block)
            return lambda entries, after: _element(block, entries, after)
        if keyword in ("NSET", "ELSET") and keyword in options:
            own = self._set(keyword, options[keyword], where)
            generated = "GENERATE" in options
            if other := options.get("ELSET") if keyword == "NSET" else None:
                own.others.append(f"the nodes of {other}")
            return lambda entries, after: _members(own, entries, after, generated)
        return None

    def _set(self, kind: str, name: str, where: str) -> _Set:
        own = self.sets.setdefault((kind, _key(name)), _Set(where))
        if own.ranges or own.others:
            own.line = where
        return own

    def _node(self, entries: list[str], after: str, name: str | None) -> None:
        number = int(entries[0])
        self.nodes.append(number)
        if after and not self.torn:
            self.torn, self.node_line = True, after
        if name is not None:
            self.sets["NSET", name].ranges.append(range(number, number + 1))

    def _refuse_instances(self, where: str) -> None:
        raise InvalidArgumentError(
            f"*INSTANCE at {where} moves a part, which is not read; expected one mesh without parts and instances"
        )

    def members(self, kind: str, name: str, places: Mapping[int, int], above: tuple[str, ...] = ()) -> set[int | str]:
        """Places of the members of a set; names stand for sets that are not known."""
        found: set[int | str] = set()
        blocks = self.of_blocks.get(name, []) if kind == "ELSET" else []
        for k in blocks:
            found.update(places[number] for number in self.blocks[k].numbers)
        known = self.sets.get((kind, name))
        if known is None or name in above:
            return found if blocks else {name}
        for part in known.ranges:
            few, many = (part, places) if len(part) < len(places) else (places, part)
            found.update(places[number] for number in few if number in many)
        for other in known.others:
            found |= self.members(kind, other, places, (*above, name))
        return found

    def types(self, kinds: Sequence[str], mesh: meshio.Mesh) -> tuple[str, ...]:
        """Types of the elements of the body, which are of these kinds of meshio.

        Raises
        ------
        InvalidArgumentError
            They are shells, rigid or axisymmetric.
        """
        if self.carrier:
            return ()
        types = [own.type for own, read in zip(self.blocks, mesh.cells, strict=True) if read.type in kinds]
        for name in types:
            if not _PLAIN.match(name):
                what = _STRANGE.get(name[:1], "others")
                raise InvalidArgumentError(
                    f"the cells of the body are elements of type {name}, which are {what}; expected solid "
                    "ones (C3D8, C3D4 and the like), or plane ones (CPS4 or CPS3, with the option plane), or a file "
                    "of another format if they only carry a plane mesh"
                )
        return tuple(dict.fromkeys(types))

    def labels(self, kinds: Sequence[str], mesh: meshio.Mesh) -> Integers:
        """Numbers (M,) of the elements of the body, which are of these kinds of meshio."""
        blocks = zip(self.blocks, mesh.cells, strict=True)
        return np.array([number for own, read in blocks if read.type in kinds for number in own.numbers])


def taken_as(types: Sequence[str]) -> list[str]:
    """Notes on elements of other formulations than those that take their place."""
    return [
        f"elements of type {name} are taken as {plain.group(1)}, with full integration and without incompatible modes, "
        "hybrid or modified formulations, which can be stiffer in bending than the program of the file has them"
        for name in types
        if (plain := _VARIANT.fullmatch(name))
    ]


def _key(name: str) -> str:
    """Name as it is compared: upper and lower case differ only in quotes."""
    return name.strip('"') if name.startswith('"') else name.upper()


def _element(block: Elements, entries: list[str], after: str) -> None:
    block.data += map(int, entries)
    if after:
        block.line = after


def _members(own: _Set, entries: list[str], after: str, generated: bool) -> None:
    if after:
        own.line = after
    if generated:
        first, last, step = (*map(int, entries), 1)[:3]
        own.ranges.append(range(first, last + 1, step))
        return
    for entry in entries:
        if entry.lstrip("-").isdigit():
            own.ranges.append(range(int(entry), int(entry) + 1))
        else:
            own.others.append(_key(entry))


def _lines(place: Path, first: Path, depth: int) -> Iterator[tuple[str, str]]:
    """Lines of a file and of those that it includes, each with where it is."""
    of = "" if place == first else f" of {place.name}"
    with place.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            text = line.strip()
            word, _, more = text.partition(",")
            if word.upper().replace(" ", "") == "*INCLUDE" and depth < _DEEPEST:
                name = Path(more.split("=")[-1].strip())
                yield from _lines(name if name.exists() else place.parent / name, first, depth + 1)
            else:
                yield f"line {number}{of}", text


def deck_of(place: Path, mesh: meshio.Mesh | None) -> Deck:
    """Contents of a deck, if meshio has read all of it.

    Parameters
    ----------
    place : Path
    mesh : meshio.Mesh or None
        Mesh that meshio read; None if it could not, which may have the same reasons.

    Raises
    ------
    InvalidArgumentError
        Nodes, cells or members of a set are lost; it says how many and where.
    """
    deck = Deck.read(place)
    if deck.instances > 1:
        raise InvalidArgumentError(
            f"the deck has {deck.instances} instances of parts, which are not put together here; expected one mesh "
            "without parts and instances"
        )
    if deck.torn if mesh is None else len(mesh.points) != len(deck.nodes):
        raise InvalidArgumentError(
            f"{'not all' if mesh is None else len(mesh.points)} of {len(deck.nodes)} nodes are read, for *NODE begins "
            f"again or goes on after a comment at {deck.node_line}; expected one block *NODE without comments"
        )
    if mesh is None:
        return deck
    blocks = [np.asarray(block.data) for block in mesh.cells]
    if len(blocks) != len(deck.blocks):
        raise InvalidArgumentError(
            f"{len(blocks)} of {len(deck.blocks)} blocks *ELEMENT are read; expected one file, without *INCLUDE"
        )
    for own, read in zip(deck.blocks, blocks, strict=True):
        width = 1 + read.shape[1] if read.ndim == 2 else len(own.data)
        own.numbers = own.data[:: max(width, 1)]
        if len(own.numbers) != len(read):
            raise InvalidArgumentError(
                f"{len(read)} of {len(own.numbers)} cells of a block *ELEMENT are read, for it goes on after a "
                f"comment at {own.line}; expected blocks without comments inside"
            )
    _check_sets(deck, mesh)
    return deck


def _check_sets(deck: Deck, mesh: meshio.Mesh) -> None:
    """Compare the members of all sets that were read with those in the deck."""
    nodes = {number: place for place, number in enumerate(deck.nodes)}
    cells = {number: place for place, number in enumerate(n for block in deck.blocks for n in block.numbers)}
    firsts = np.cumsum([0, *(len(block.numbers) for block in deck.blocks)])
    for name, rows in mesh.point_sets.items():
        _compare(deck, "NSET", name, nodes, set(np.ravel(rows).tolist()))
    for name, parts in mesh.cell_sets.items():
        read = {int(row) + int(first) for first, part in zip(firsts, parts, strict=False) for row in np.ravel(part)}
        _compare(deck, "ELSET", name, cells, read)


def _compare(deck: Deck, kind: str, name: str, places: Mapping[int, int], read: set[int]) -> None:
    wanted = deck.members(kind, _key(name), places)
    if wanted == read:
        return
    known = deck.sets.get((kind, _key(name)))
    line = known.line if known is not None else deck.blocks[deck.of_blocks[_key(name)][-1]].line
    what = "nodes" if kind == "NSET" else "cells"
    found = f"{len(wanted & read)} of its {len(wanted)} {what}" if wanted - read else f"{what} that do not belong to it"
    raise InvalidArgumentError(
        f"the set {name} is read with {found}, for it begins again, goes on after a comment or names other sets at "
        f"{line}; expected each set once, with numbers only and no comments inside"
    )


def refuse_partial(place: Path, mesh: meshio.Mesh, said: str) -> None:
    """Refuse an incomplete mesh that meshio read from a file of another format than decks.

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
