"""Named parts of a deck: those that it has, and those on which something acts, which get names of their own."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from enumsol.decks.faces import face_nodes, faces_of_nodes
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
    from enumsol.support.array_types import Floats, Integers, Mask


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
        own = self._deck.surfaces.get(name)
        if own is None:
            known = ", ".join(self._deck.surfaces) or "none"
            raise InvalidArgumentError(f"{place}: *{card} names {name}; expected a surface, one of {known}")
        if own.nodes is None:
            return
        rows = self.in_bodies(own.nodes)
        faces = faces_of_nodes(self._deck, rows)
        covered = [nodes.ravel() for _, nodes in face_nodes(self._deck, faces)]
        bare = np.setdiff1d(rows, np.concatenate([np.zeros(0, dtype=np.int64), *covered]))
        if not len(rows) or (len(bare) and faced):
            lost = f"node {self._deck.node_name(int(bare[0]))}" if len(bare) else "no node of a body"
            lacks = ", which belongs to no facet whose nodes are all in it" if len(bare) else ""
            raise InvalidArgumentError(
                f"{own.place}: *SURFACE {name} has {lost}{lacks}; expected "
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

    @cached_property
    def _is_used(self) -> Mask:
        found = np.zeros(len(self._deck.points), dtype=bool)
        found[self.used] = True
        return found

    def adjusted(self, scene: Scene) -> PartedMesh:
        """Mesh whose contact nodes are moved onto what they face where the deck says so."""
        points, first = scene.mesh.points.copy(), 0
        adjusts = {(pair.slave, pair.master): pair.adjust for pair in self._deck.analysis.pairs}
        for group, gaps in scene.gaps_of_groups:
            own = slice(first, first := first + group.count)
            adjust = None if group.pair is None else adjusts.get((group.pair.slave, group.pair.master))
            rows = scene.contacts.rows
            if isinstance(adjust, str):
                chosen = np.searchsorted(self.used, self.in_bodies(self._deck.node_sets[adjust]))
                near = np.isin(rows.nodes[own], chosen) & (gaps != 0)
            elif adjust is not None:
                near = (gaps <= adjust) & (gaps != 0)
            if adjust is not None:
                points[rows.nodes[own][near]] += gaps[near, None] * rows.normals[own][near]
        return replace(scene.mesh, points=points)
