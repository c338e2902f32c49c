"""Named parts of a deck: those that it has, and those on which something acts, which get names of their own."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.decks.model import Account, Surface
from enumsol.errors import InvalidArgumentError
from enumsol.fem.cell_blocks import completing
from enumsol.fem.mesh_files import mesh_of_deck
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.decks.cards import DeckPlace
    from enumsol.decks.model import Deck
    from enumsol.fem.meshes import PartedMesh
    from enumsol.fem.scenes import Scene
    from enumsol.support.array_types import Floats, Integers


class DeckParts:
    """Named parts of a deck: those that it has, and those on which something acts, which get names of their own."""

    def __init__(self, deck: Deck) -> None:
        self._deck = deck
        self._names: dict[tuple[str, bytes], str] = {}
        self._exact: dict[str, Integers] = {}
        self._taken = {*deck.node_sets, *deck.element_sets, *deck.surfaces}

    def nodes(self, rows: Integers, wanted: str) -> str:
        """Name of a set of nodes, the one that is wanted if it has these."""
        return self._named("nodes", self._deck.node_sets, np.unique(rows), wanted, lambda own: own)

    def elements(self, rows: Integers, wanted: str) -> str:
        """Name of a set of elements."""
        return self._named("elements", self._deck.element_sets, np.unique(rows), wanted, lambda own: own)

    def faces(self, faces: Integers, wanted: str, place: DeckPlace) -> str:
        """Name of a surface of faces (k, 2)."""
        return self._named(
            "faces",
            self._deck.surfaces,
            np.unique(faces, axis=0),
            wanted,
            lambda own: Surface(place, own),
            lambda own: own.faces,
        )

    def _named(self, kind: str, sets: Any, rows: Integers, wanted: str, made: Any, of: Any = lambda own: own) -> str:
        key = (kind, rows.tobytes())
        if key in self._names:
            return self._names[key]
        name = wanted
        if not (name in sets and np.array_equal(np.sort(of(sets[name]), axis=0), rows)):
            count = 1
            while name in self._taken:
                count += 1
                name = f"{wanted} ({count})"
            sets[name] = made(rows)
            self._taken.add(name)
        self._names[key] = name
        return name

    def in_bodies(self, rows: Integers) -> Integers:
        """Nodes among these that belong to bodies."""
        return rows[np.isin(rows, self.used)]

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
            raise InvalidArgumentError(
                f"{place}: *CLOAD loads node {self._deck.node_name(int(loose[0]))}, which belongs to no body and to no "
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

    def mesh(self) -> PartedMesh:
        """Mesh of the deck with all of these."""
        mesh = mesh_of_deck(self._deck)
        exact = {name: np.searchsorted(self.used, rows) for name, rows in self._exact.items()}
        return replace(mesh, node_sets=MappingProxyType({**mesh.node_sets, **exact})) if exact else mesh

    @cached_property
    def used(self) -> Integers:
        """Rows of the nodes of bodies, in the order in which its mesh has them."""
        own = [block.nodes.ravel() for block in self._deck.blocks if self._deck.is_body(block)]
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *own]))

    def adjusted(self, scene: Scene) -> PartedMesh | None:
        """Mesh whose contact nodes are moved onto what they face where the deck says so; None if it moves none."""
        points, first = scene.mesh.points.copy(), 0
        distances = {(pair.slave, pair.master): pair.adjust for pair in self._deck.analysis.pairs}
        for group, gaps in scene.gaps_of_groups:
            own = slice(first, first := first + group.count)
            distance = None if group.pair is None else distances.get((group.pair.slave, group.pair.master))
            if distance is not None:
                near = (gaps <= distance) & (gaps != 0)
                rows = scene.contacts.rows
                points[rows.nodes[own][near]] += gaps[near, None] * rows.normals[own][near]
        return replace(scene.mesh, points=points) if np.any(points != scene.mesh.points) else None
