"""Meshes of decks: what a deck describes as cells of a body and named parts, in the way files of meshio give them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.decks.faces import face_nodes
from enumsol.errors import InvalidArgumentError
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.decks.model import Deck, ElementBlock
    from enumsol.support.array_types import Floats, Integers, Mask, NDArray

#: Sections whose elements carry something.
_CARRYING = ("SOLID SECTION", "SHELL SECTION", "MEMBRANE SECTION", "BEAM SECTION")
#: Elements without a section that are left out wherever they lie: lines of meshes, and what has cards of its own.
_LEFT_OUT = ("trusses", "beams", "springs", "dashpots", "gap elements", "couplings", "point masses")
#: What meshio writes at the top of its decks, in which a type of elements stands for nothing but a shape.
_WRITTEN_BY_SHAPE = "written by meshio"


@dataclass(frozen=True, eq=False)
class CellBlock:
    """Cells of one kind: its name as meshio has it, nodes (m, k) in the order of VTK, and names in the deck."""

    type: str
    data: Integers
    labels: NDArray[Any]


@dataclass(eq=False)
class DeckMesh:
    """A deck as a mesh, with what a meshio.Mesh has, and the types and numbers of its elements.

    Attributes
    ----------
    points : (N, 3) array
    cells : list of CellBlock
        Cells of bodies, and facets of surfaces and of elements that only carry the name of a set.
    point_sets : dict of names to rows of points
    cell_sets : dict of names to lists of rows of cells, by blocks
    types : list of str
        Of the elements of bodies.
    node_labels : list of int or str
        Numbers of the nodes in the deck, behind the names of instances.
    """

    points: Floats
    cells: list[CellBlock] = field(default_factory=list)
    point_sets: dict[str, Integers] = field(default_factory=dict)
    cell_sets: dict[str, list[Integers]] = field(default_factory=dict)
    types: list[str] = field(default_factory=list)
    node_labels: list[int] | list[str] = field(default_factory=list)
    point_data: dict[str, Any] = field(default_factory=dict)
    cell_data: dict[str, Any] = field(default_factory=dict)
    field_data: dict[str, Any] = field(default_factory=dict)

    def add(self, kind: str, data: Integers, labels: NDArray[Any], names: dict[str, Integers]) -> None:
        """Add a block of cells, and which of its rows belong to which sets."""
        self.cells.append(CellBlock(kind, data, labels))
        for name, rows in names.items():
            own = self.cell_sets.setdefault(name, [])
            own += [np.zeros(0, dtype=np.int64)] * (len(self.cells) - 1 - len(own))
            own.append(rows)

    def labels(self, kinds: list[str]) -> NDArray[Any]:
        """Names of all cells of some kinds in the deck: numbers, behind those of instances if there are any."""
        return np.concatenate([block.labels for block in self.cells if block.type in kinds])

    def closed(self) -> DeckMesh:
        """Finished mesh, with all sets as long as the list of blocks."""
        for own in self.cell_sets.values():
            own.extend([np.zeros(0, dtype=np.int64)] * (len(self.cells) - len(own)))
        return self


def deck_mesh(deck: Deck, *, spelled: bool = False) -> DeckMesh:
    """Cells and named parts of a deck.

    Bodies are its solid elements, or its plane ones if there are no solid ones. Elements of one dimension less that
    have no section and lie on bodies only carry the names of sets, as programs of meshes write them: they are facets.

    Parameters
    ----------
    deck : Deck
    spelled : bool
        Take names as they are written, and not in upper case.

    Raises
    ------
    InvalidArgumentError
        There are no bodies, or elements of another kind that carry something, or of which something is lost.
    """
    refuse_carriers(deck)
    bodies, shapes = _bodies(deck)
    types = () if shapes else dict.fromkeys(deck.blocks[k].type.name for k in bodies)
    of = deck.spelled if spelled else {}
    made = DeckMesh(deck.points, types=list(types), node_labels=deck.node_names())
    firsts = np.cumsum([0, *(len(block.labels) for block in deck.blocks)])
    for k in bodies:
        _add_body(made, deck, k, int(firsts[k]), of)
    for name, faces in _facets(deck, bodies, firsts).items():
        for shape, nodes in face_nodes(deck, faces):
            sets = {of.get(name, name): np.arange(len(nodes))} if name else {}
            made.add(shape.name, nodes, np.zeros(len(nodes), dtype=np.int64), sets)
    made.point_sets = {of.get(name, name): rows for name, rows in deck.node_sets.items()}
    for name, surface in deck.surfaces.items():
        if surface.nodes is not None:
            other = made.point_sets.setdefault(of.get(name, name), surface.nodes)
            if not np.array_equal(other, surface.nodes):
                raise InvalidArgumentError(
                    f"{surface.place}: the surface {name} has other nodes than the set {name}; expected other names"
                )
    return made.closed()


def _facets(deck: Deck, bodies: list[int], firsts: Integers) -> dict[str, Integers]:
    """Faces (k, 2) of surfaces, and elements that only carry names, as in `Surface`, by the keys of their names.

    If no set names any of the elements that carry none, all of them are there without a name.
    """
    dimension = deck.blocks[bodies[0]].type.shape.dimension
    covered = _covered(deck, bodies)
    carriers = np.zeros(firsts[-1], dtype=bool)
    for k, block in enumerate(deck.blocks):
        if k not in bodies:
            own = np.all(covered[block.nodes], axis=1) & (block.type.shape.dimension == dimension - 1)
            carriers[firsts[k] : firsts[k + 1]] = own
    found = {name: _themselves(rows[carriers[rows]]) for name, rows in deck.element_sets.items()}
    found = {name: faces for name, faces in found.items() if len(faces)}
    if np.any(carriers) and not found:
        found = {"": _themselves(np.flatnonzero(carriers))}
    return found | {name: own.faces for name, own in deck.surfaces.items() if own.nodes is None}


def _covered(deck: Deck, bodies: list[int]) -> Mask:
    """Which nodes belong to some blocks."""
    covered = np.zeros(len(deck.points), dtype=bool)
    for k in bodies:
        covered[deck.blocks[k].nodes] = True
    return covered


def refuse_carriers(deck: Deck) -> None:
    """Refuse elements that are no bodies and carry something, such as shells, and decks without bodies.

    Raises
    ------
    InvalidArgumentError
        It names a type and a line.
    """
    bodies, _ = _bodies(deck)
    first, covered = 0, _covered(deck, bodies)
    for k, block in enumerate(deck.blocks):
        if k not in bodies:
            _check_carrier(deck, block, first, deck.blocks[bodies[0]].type.shape.dimension, covered)
        first += len(block.labels)


def _themselves(rows: Integers) -> Integers:
    """Elements as the faces that they are."""
    return np.column_stack([rows, np.full(len(rows), -1)])


def _bodies(deck: Deck) -> tuple[list[int], bool]:
    """Blocks of the bodies, and whether their types stand for shapes alone."""
    shapes = _WRITTEN_BY_SHAPE in deck.heading
    own = [k for k, block in enumerate(deck.blocks) if len(block.labels) and (block.type.is_body or shapes)]
    dimension = max((deck.blocks[k].type.shape.dimension for k in own), default=0)
    bodies = [k for k in own if deck.blocks[k].type.shape.dimension == dimension]
    if dimension < 2:
        other = next((block for block in deck.blocks if block.type.shape.dimension), None)
        found = "the deck has no elements of bodies"
        if other is not None:
            found = f"{other.place}: the cells of the body are elements of type {other.type.name}, which are "
            found += other.type.family
        raise InvalidArgumentError(
            f"{found}; expected solid ones (C3D8, C3D4 and the like), or plane ones (CPS4, CPE8, CAX6 and the like)"
        )
    return bodies, shapes


def _add_body(made: DeckMesh, deck: Deck, k: int, first: int, of: dict[str, str]) -> None:
    """Add the elements of a block."""
    block, sets = deck.blocks[k], {}
    for name, rows in deck.element_sets.items():
        own = rows[(rows >= first) & (rows < first + len(block.labels))] - first
        if len(own):
            sets[of.get(name, name)] = own
    shape = block.type.shape
    labels = block.labels
    if len(deck.instances) > 1:
        labels = np.array([deck.element_name(first + row) for row in range(len(labels))])
    made.add(shape.name, block.nodes[:, shape.to_vtk] if shape.to_vtk else block.nodes, labels, sets)


def _check_carrier(deck: Deck, block: ElementBlock, first: int, dimension: int, covered: Mask) -> None:
    """Refuse elements that are no bodies and carry something, or lie elsewhere."""
    kind = block.type
    within = np.arange(first, first + len(block.labels))
    for section in deck.sections:
        own = deck.element_sets.get(section.elements)
        if section.kind in _CARRYING and own is not None and np.any(np.isin(within, own)):
            raise InvalidArgumentError(
                f"{block.place}: elements of type {kind.name} are {kind.family} and carry something (*{section.kind}, "
                f"line {section.place.line}); expected solid or plane elements only, or --ignore {kind.name} to do "
                "without them"
            )
    lies_on_bodies = kind.shape.dimension < dimension and np.all(covered[block.nodes])
    if not lies_on_bodies and (kind.shape.dimension >= 2 or kind.family not in _LEFT_OUT):
        lost = counted(int(np.sum(~np.all(covered[block.nodes], axis=1))), "element")
        raise InvalidArgumentError(
            f"{block.place}: elements of type {kind.name} are {kind.family}, {lost} of which lie on no face of a solid "
            f"element; expected solid or plane elements only, or --ignore {kind.name} to do without them"
        )
