"""Named parts of a deck, those that it has and those on which something acts, and its mesh with all of these."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.decks.faces import face_nodes, faces_of_nodes
from enumsol.decks.model import Account, Surface
from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import ALL, FileMesh, completing
from enumsol.model.cells import padded
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.decks.cards import DeckPlace
    from enumsol.decks.elements import Shape
    from enumsol.decks.model import Deck, ElementBlock
    from enumsol.fem.meshes import PartedMesh
    from enumsol.support.array_types import Floats, Integers, Mask, NDArray


class DeckParts:
    """Named parts of a deck: those that it has, and those on which something acts, which get names of their own."""

    def __init__(self, deck: Deck) -> None:
        self._deck = deck
        self._names: dict[tuple[str, bytes], str] = {}
        self._exact: dict[str, Integers] = {}
        self._taken = {*deck.node_sets, *deck.element_sets, *deck.surfaces}

    def nodes(self, rows: Integers, wanted: str) -> str:
        """Name of a set of nodes, the one that is wanted if it has these."""
        return self._set("nodes", self._deck.node_sets, rows, wanted)

    def elements(self, rows: Integers, wanted: str) -> str:
        """Name of a set of elements."""
        return self._set("elements", self._deck.element_sets, rows, wanted)

    def faces(self, faces: Integers, wanted: str, place: DeckPlace) -> str:
        """Name of a surface of faces (k, 2)."""
        faces, known = np.unique(faces, axis=0), self._deck.surfaces.get(wanted)
        name = self._name("faces", faces, wanted, None if known is None else known.faces)
        self._deck.surfaces.setdefault(name, Surface(place, faces))
        return name

    def _set(self, kind: str, sets: dict[str, Integers], rows: Integers, wanted: str) -> str:
        rows = np.unique(rows)
        name = self._name(kind, rows, wanted, sets.get(wanted))
        sets.setdefault(name, rows)
        return name

    def _name(self, kind: str, rows: Integers, wanted: str, known: Integers | None) -> str:
        """Name of these rows: the one they have, or the one that is wanted if they are what is known by it, or new."""
        key, name, count = (kind, rows.tobytes()), wanted, 1
        if key not in self._names:
            is_known = known is not None and np.array_equal(known, rows)
            while name in self._taken and not (name == wanted and is_known):
                count += 1
                name = f"{wanted} ({count})"
            self._taken.add(name)
            self._names[key] = name
        return self._names[key]

    def check_surface(self, name: str, place: DeckPlace, card: str, *, faced: bool = False) -> None:
        """Refuse what is no surface of a card of contacts.

        A surface of nodes becomes the facets that have these. If some belong to no such facet, it stays one of nodes,
        unless it is ``faced``.

        Raises
        ------
        InvalidArgumentError
            There is none, it has no node of a body, or is one of nodes that others would face.
        """
        own = place.entry(self._deck.surfaces, name, f"*{card} names {name}", "a surface, one of")
        if own.nodes is None:
            return
        rows = self.in_bodies(own.nodes)
        faces = faces_of_nodes(self._deck, rows)
        covered = [nodes.ravel() for _, nodes in face_nodes(self._deck, faces)]
        bare = np.setdiff1d(rows, np.concatenate([np.zeros(0, dtype=np.int64), *covered]))
        if not len(rows) or (len(bare) and faced):
            lost = f"node {self._deck.node_name(int(bare[0]))}" if len(bare) else "no node of a body"
            lacks = ", which belongs to no facet whose nodes are all in it" if len(bare) else ""
            raise own.place.refused(
                f"*SURFACE {name} has {lost}{lacks}; expected "
                f"{'the nodes of whole facets, or TYPE=ELEMENT' if faced else 'nodes of bodies'}"
            )
        if len(bare):
            became = f"{counted(len(rows), 'node')} of {name} without facets: each has its forces, none has a pressure"
        else:
            self._deck.surfaces[name] = Surface(own.place, faces)
            became = f"nodes of {name} are those of {counted(len(faces), 'facet')}"
        entry = Account(own.place, "SURFACE", became)
        if entry not in self._deck.account:
            self._deck.account.append(entry)

    def in_bodies(self, rows: Integers) -> Integers:
        """Nodes among these that belong to bodies."""
        return rows[self._is_used[rows]]

    def exactly(self, rows: Integers, wanted: str) -> str:
        """Name of a set of these nodes alone, without nodes that elements of 20 nodes get in the middle of facets."""
        if not any(block.type.shape.nodes == 20 for block in self._deck.blocks):
            return self.nodes(rows, wanted)
        name = f"{wanted} (nodes)"
        self._exact[name] = np.unique(rows)
        return name

    def told_of_loose(self, rows: Integers, kind: str, place: DeckPlace) -> None:
        """Refuse forces on nodes of no body, and account for supports of such.

        Raises
        ------
        InvalidArgumentError
            A force acts on one.
        """
        loose = np.setdiff1d(rows, self.in_bodies(rows))
        if not len(loose):
            return
        if kind == "CLOAD":
            raise place.refused(
                f"*CLOAD loads node {self._deck.node_name(int(loose[0]))}, which belongs to no body and to no "
                "coupling; expected nodes of bodies, or reference nodes"
            )
        self.told(place, kind, f"{counted(len(loose), 'node')} of no body not used")

    def told(self, place: DeckPlace, kind: str, became: str) -> None:
        """Account for what is not used."""
        entry = Account(place, kind, became, used=False)
        if entry not in self._deck.account:
            self._deck.account.append(entry)

    def at_nodes(self, mesh: PartedMesh, values: Floats) -> Floats:
        """Values at all nodes of the mesh, of those at the nodes of the deck.

        Nodes that complete elements have what the shape functions of these give.
        """
        found = np.zeros(len(mesh.points))
        found[: len(self.used)] = values[self.used]
        for nodes, shares in completing(mesh.points.shape[1], mesh.cells, len(self.used)):
            found[nodes[:, 0]] = found[nodes[:, 1:]] @ shares
        return found

    def named_in(self, mesh: PartedMesh) -> PartedMesh:
        """Mesh of the deck with the sets of nodes that have no others."""
        exact = {name: np.searchsorted(self.used, rows) for name, rows in self._exact.items()}
        return replace(mesh, node_sets=MappingProxyType({**mesh.node_sets, **exact})) if exact else mesh

    @cached_property
    def used(self) -> Integers:
        """Rows of the nodes of bodies, in the order in which its mesh has them."""
        own = [block.nodes.ravel() for block in self._deck.blocks if self._deck.is_body(block)]
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *own]))

    @cached_property
    def _is_used(self) -> Mask:
        found = np.zeros(len(self._deck.points), dtype=bool)
        found[self.used] = True
        return found


# -- deck meshes -------------------------------------------------------------------------------------------------------
# Meshes of decks: what a deck describes as cells of a body and named parts, in the way files of meshio give them.

#: Sections whose elements carry something.
_CARRYING = ("SOLID SECTION", "SHELL SECTION", "MEMBRANE SECTION", "BEAM SECTION")
#: Elements without a section that are left out wherever they lie: lines of meshes, and what has cards of its own.
_LEFT_OUT = ("trusses", "beams", "springs", "dashpots", "gap elements", "couplings", "point masses")
#: Beginning of the names of sets of gmsh's own, which are no parts.
OF_GMSH = "gmsh:"
#: What meshio writes at the top of its decks, in which a type of elements stands for nothing but a shape.
_WRITTEN_BY_SHAPE = "written by meshio"


def deck_mesh(deck: Deck, *, spelled: bool = False) -> FileMesh:
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
    bodies, by_shape = _bodies(deck)
    blocks = [deck.blocks[k] for k in bodies]
    firsts, of = deck.firsts, deck.spelled if spelled else {}
    faces = [
        (of.get(name, name), shape, nodes)
        for name, own in _facets(deck, bodies).items()
        for shape, nodes in face_nodes(deck, own)
    ]
    labels: list[NDArray[Any]] = [block.labels for block in blocks]
    if len(deck.instances) > 1:
        labels = [np.array([deck.element_name(row) for row in range(firsts[k], firsts[k + 1])]) for k in bodies]
    shapes, node_sets = [block.type.shape for block in blocks], _node_sets(deck, of)
    return FileMesh(
        deck.points,
        list(dict.fromkeys(shape.name for shape in (*shapes, *(shape for _, shape, _ in faces)))),
        [block.nodes[:, block.type.shape.to_vtk or slice(None)] for block in blocks],
        _named_facets([own for own in faces if own[1].dimension == shapes[0].dimension - 1], bool(node_sets)),
        node_sets,
        _named_bodies(deck, bodies, of),
        np.concatenate(labels),
        () if by_shape else tuple(dict.fromkeys(block.type.name for block in blocks)),
        deck.node_names(),
    )


def _named_facets(faces: list[tuple[str, Shape, Integers]], named: bool) -> dict[str, Integers]:
    """Facets by their names; without any names, and if nothing else is ``named``, all of them."""
    width = max((nodes.shape[1] for _, _, nodes in faces), default=0)
    found: dict[str, list[Integers]] = {}
    for name, _, nodes in faces:
        if name and not name.startswith(OF_GMSH):
            found.setdefault(name, []).append(nodes)
    if faces and not found and not named:
        found[ALL] = [nodes for _, _, nodes in faces]
    return {name: padded(parts, width) for name, parts in found.items()}


def _named_bodies(deck: Deck, bodies: list[int], of: dict[str, str]) -> dict[str, Integers]:
    """Rows of the cells of sets, counted through the blocks of bodies alone."""
    found: dict[str, list[Integers]] = {}
    firsts, before = deck.firsts, 0
    for k in bodies:
        for key, rows in deck.element_sets.items():
            own, name = rows[(rows >= firsts[k]) & (rows < firsts[k + 1])], of.get(key, key)
            if len(own) and not name.startswith(OF_GMSH):
                found.setdefault(name, []).append(own - firsts[k] + before)
        before += firsts[k + 1] - firsts[k]
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _node_sets(deck: Deck, of: dict[str, str]) -> dict[str, Integers]:
    """Sets of nodes, and surfaces of nodes."""
    found = {of.get(name, name): rows for name, rows in deck.node_sets.items()}
    for name, surface in deck.surfaces.items():
        if surface.nodes is not None:
            other = found.setdefault(of.get(name, name), surface.nodes)
            if not np.array_equal(other, surface.nodes):
                raise surface.place.refused(
                    f"the surface {name} has other nodes than the set {name}; expected other names"
                )
    return found


def _facets(deck: Deck, bodies: list[int]) -> dict[str, Integers]:
    """Faces (k, 2) of surfaces, and elements that only carry names, as in `Surface`, by the keys of their names.

    If no set names any of the elements that carry none, all of them are there without a name.
    """
    dimension = deck.blocks[bodies[0]].type.shape.dimension
    covered = _covered(deck, bodies)
    carriers = np.zeros(deck.firsts[-1], dtype=bool)
    for k, (first, block) in enumerate(zip(deck.firsts, deck.blocks, strict=False)):
        if k not in bodies:
            own = np.all(covered[block.nodes], axis=1) & (block.type.shape.dimension == dimension - 1)
            carriers[first : first + len(own)] = own
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
    covered = _covered(deck, bodies)
    for k, (first, block) in enumerate(zip(deck.firsts, deck.blocks, strict=False)):
        if k not in bodies:
            _check_carrier(deck, block, first, deck.blocks[bodies[0]].type.shape.dimension, covered)


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


def _check_carrier(deck: Deck, block: ElementBlock, first: int, dimension: int, covered: Mask) -> None:
    """Refuse elements that are no bodies and carry something, or lie elsewhere."""
    kind = block.type
    within = np.arange(first, first + len(block.labels))
    for section in deck.sections:
        own = deck.element_sets.get(section.elements)
        if section.kind in _CARRYING and own is not None and np.any(np.isin(within, own)):
            raise block.place.refused(
                f"elements of type {kind.name} are {kind.family} and carry something (*{section.kind}, line "
                f"{section.place.line}); expected solid or plane elements only, or --ignore {kind.name} to do without "
                "them"
            )
    lies_on_bodies = kind.shape.dimension < dimension and np.all(covered[block.nodes])
    if not lies_on_bodies and (kind.shape.dimension >= 2 or kind.family not in _LEFT_OUT):
        lost = counted(int(np.sum(~np.all(covered[block.nodes], axis=1))), "element")
        raise block.place.refused(
            f"elements of type {kind.name} are {kind.family}, {lost} of which lie on no face of a solid element; "
            f"expected solid or plane elements only, or --ignore {kind.name} to do without them"
        )
