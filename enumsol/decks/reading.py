"""Reading of decks: cards go to the functions that the table of cards has for them, and regions are put together."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

# the modules that fill the table of cards
from enumsol.decks import contact_cards, material_cards, mesh_cards, step_cards  # noqa: F401
from enumsol.decks.cards import DeckPlace, cards_of, key, shown
from enumsol.decks.elements import element_type
from enumsol.decks.faces import named_faces
from enumsol.decks.model import (
    Account,
    Deck,
    DeckRegion,
    ElementBlock,
    Members,
    Numbers,
    RigidProfile,
    Section,
    Surface,
    by_block,
)
from enumsol.decks.registry import Reading, compact
from enumsol.support.array_types import Floats, Integers
from enumsol.support.messages import counted, listed


def described(path: Path, *, ignore: Collection[str] = (), bare: bool = False) -> Deck:
    r"""Description of a deck.

    Parameters
    ----------
    path : Path
    ignore : collection of str
        Names of cards and of types of elements that are passed over.
    bare : bool
        Read the mesh alone: cards of loads, materials, contact and the like are not looked at.

    Raises
    ------
    InvalidArgumentError
        The deck cannot be read as a whole; it says why, with file and line.

    Examples
    --------
    >>> import pathlib
    >>> from enumsol.decks.reading import described
    >>> nodes = "1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n"
    >>> _ = pathlib.Path("corner.inp").write_text(f"*NODE\n{nodes}*ELEMENT, TYPE=CPS3, ELSET=ALL\n7, 1, 2, 3\n")
    >>> deck = described(pathlib.Path("corner.inp"))
    >>> deck.element_sets, [entry.became for entry in deck.account]
    ({'ALL': array([0])}, ['3 nodes', '1 element of type CPS3'])
    """
    reading = Reading(Deck(path), frozenset(map(compact, ignore)), bare)
    for each in cards_of(path):
        reading.read(each)
    return put_together(reading)


# -- assembly ----------------------------------------------------------------------------------------------------------
# Regions put together: nodes and elements of the deck and of its instances in one list each, sets by their rows.

_NONE = np.zeros(0, dtype=np.int64)


def put_together(reading: Reading) -> Deck:
    """The description with all nodes, elements, sets and surfaces.

    Raises
    ------
    InvalidArgumentError
        A number is given twice, a node or a set is not given, a set contains itself, or a face is none.
    """
    deck = reading.deck
    if open_ := reading.part or reading.instance:
        what = "PART" if reading.part else "INSTANCE"
        raise reading.region.place.refused(f"{open_} does not end; expected *END {what}")
    for part in reading.parts.values():
        if not part.is_used:
            said = f"part {part.spelled} not used: there is no *INSTANCE of it"
            deck.account.append(Account(part.place, "PART", said, used=False))
    whole = _Whole(deck)
    for instance, region in (("", reading.top), *reading.instances.items()):
        whole.add(instance, region)
    deck.points = np.concatenate([np.zeros((0, 3)), *whole.points])
    deck.node_labels = np.concatenate([_NONE, *whole.labels])
    for (kind, name), (members, instance) in whole.sets.items():
        if kind == "SURFACE":
            deck.surfaces[name] = whole.surface(name, members)
        else:
            rows = np.unique(whole.rows(kind, name))
            (deck.node_sets if kind == "NSET" else deck.element_sets)[name] = rows
        before = f"{reading.instances[instance].spelled}." if instance else ""
        deck.spelled.setdefault(name, before + members.spelled)
    if not reading.bare:
        add_profiles(deck, whole.profiles)
        add_layers(deck)
    empty = {name for name, rows in deck.element_sets.items() if not len(rows)}
    for section in deck.sections:
        if section.elements in empty:
            said = f"not used: there are no elements of {section.elements}"
            deck.account.append(Account(section.place, section.kind, said, used=False))
    deck.sections = [section for section in deck.sections if section.elements not in empty]
    return deck


class _Whole:
    """All regions together, while they are added."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self.points: list[Floats] = []
        self.labels: list[Integers] = []
        self.numbers: dict[tuple[str, str], Numbers] = {}
        self.sets: dict[tuple[str, str], tuple[Members, str]] = {}
        self.known: dict[tuple[str, str], Integers] = {}
        self.profiles: dict[str, RigidProfile] = {}
        self.nodes = self.elements = 0

    def add(self, instance: str, region: DeckRegion) -> None:
        """Add the nodes, elements and sets of a region."""
        labels, points = _distinct_nodes(region)
        numbers = self.numbers["NSET", instance] = Numbers.of(labels, self.nodes)
        self.points.append(region.moved(points))
        self.labels.append(labels)
        for block in region.blocks:
            rows, there = numbers.found(block.nodes.ravel())
            if not np.all(there):
                k = int(np.argmin(there.reshape(block.nodes.shape).all(axis=1)))
                lost = block.nodes.ravel()[np.argmin(there)]
                raise block.place.refused(
                    f"element {block.labels[k]} has the node {lost}, which is not in the deck; expected its position "
                    "in *NODE"
                )
            self.deck.blocks.append(replace(block, nodes=rows.reshape(block.nodes.shape)))
        own = np.concatenate([_NONE, *(block.labels for block in region.blocks)])
        _check_distinct(own, region)
        self.numbers["ELSET", instance] = Numbers.of(own, self.elements)
        before = f"{instance}." if instance else ""
        self.sets |= {(kind, before + name): (members, instance) for (kind, name), members in region.sets.items()}
        self.deck.orientations |= {
            before + name: replace(own, points=region.moved(own.points), origin=region.moved(own.origin[None])[0])
            for name, own in region.orientations.items()
        }
        self.profiles |= {before + name: own.moved(region) for name, own in region.profiles.items()}
        for coupling in region.couplings:
            target, reference = before + coupling.target, before + coupling.reference
            rotation = before + coupling.rotation if coupling.rotation else None
            moved = replace(coupling, target=target, reference=reference, rotation=rotation)
            self.deck.couplings.append(moved)
        for section in region.sections:
            turned = before + section.orientation if section.orientation else ""
            self.deck.sections.append(replace(section, elements=before + section.elements, orientation=turned))
        ends = self.nodes + len(labels), self.elements + len(own)
        self.deck.instances[instance] = (self.nodes, ends[0], self.elements, ends[1])
        self.nodes, self.elements = ends

    def rows(self, kind: str, name: str, above: tuple[str, ...] = ()) -> Integers:
        """Rows of the members of a set."""
        if (kind, name) not in self.known:
            members, instance = self.sets[kind, name]
            if name in above:
                raise members.place.refused(f"the set {members.spelled} contains itself; expected sets without circles")
            parts = [self._part(members, part, instance, kind, (*above, name)) for part in members.parts]
            self.known[kind, name] = np.concatenate([_NONE, *parts])
        return self.known[kind, name]

    def _part(
        self, members: Members, part: tuple[str, Integers | range | str, str, DeckPlace], instance: str, kind: str,
        above: tuple[str, ...],
    ) -> Integers:  # fmt: skip
        """Rows of one part of a set, of nodes of elements if it is a set of these."""
        of, what, named, place = part
        inside = named or instance
        if (of, inside) not in self.numbers:
            known = ", ".join(name for name in self.deck.instances if name) or "none"
            raise place.refused(f"the instance {inside} is not in the deck; expected one of {known}")
        if isinstance(what, range):
            rows, wanted = self.numbers[of, inside].within(what), len(what)
        elif isinstance(what, str):
            rows = self._named(of, what, inside, place, above if of == kind else ())
            wanted = len(rows)
        else:
            rows, there = self.numbers[of, inside].found(what)
            rows, wanted = rows[there], len(what)
        if len(rows) < wanted:
            words = "nodes" if of == "NSET" else "elements"
            lost = counted(wanted - len(rows), "number")
            if not isinstance(what, range | str):
                lost = listed(what[~there].tolist())
            said = f"set {members.spelled}: {lost} not used: there are no such {words}"
            self.deck.account.append(Account(place, kind, said, used=False))
        return self._nodes(rows) if of != kind else rows

    def _named(self, kind: str, what: str, instance: str, place: DeckPlace, above: tuple[str, ...]) -> Integers:
        """Rows of a set, or of a number of an instance, by name."""
        name = key(what)
        for each in (f"{instance}.{name}", name) if instance else (name,):
            if (kind, each) in self.sets:
                return self.rows(kind, each, above)
        of, _, number = what.rpartition(".")
        if number.isdigit() and (kind, key(of)) in self.numbers:
            rows, there = self.numbers[kind, key(of)].found(np.array([int(number)]))
            if there[0]:
                return rows
        words = {"NSET": "nodes", "ELSET": "elements"}[kind]
        known = listed(each for of_kind, each in self.sets if of_kind == kind) or "none"
        raise place.refused(f"there is no set of {words} named {shown(what)}; expected one of {known}")

    def _nodes(self, elements: Integers) -> Integers:
        """Rows of the nodes of elements."""
        found = [block.nodes[own].ravel() for _, block, own in by_block(self.deck.blocks, elements)]
        return np.unique(np.concatenate([_NONE, *found]))

    def surface(self, name: str, members: Members) -> Surface:
        """A surface by the rows of its elements or nodes."""
        instance = self.sets["SURFACE", name][1]
        if members.nodal:
            parts = [self._part(members, ("NSET", *part[1:]), instance, "NSET", ()) for part in members.parts]
            return Surface(members.place, np.zeros((0, 2), dtype=np.int64), np.unique(np.concatenate([_NONE, *parts])))
        faces = [np.zeros((0, 2), dtype=np.int64)]
        for part in members.parts:
            rows = np.unique(self._part(members, ("ELSET", *part[1:]), instance, "ELSET", ()))
            faces.append(named_faces(self.deck, rows, part[0], part[3]))
        return Surface(members.place, np.unique(np.concatenate(faces), axis=0))


def _distinct_nodes(region: DeckRegion) -> tuple[Integers, Floats]:
    """Numbers and positions of the nodes of a region; a node that is given again has to be where it was."""
    labels = np.concatenate([_NONE, *(own for _, own, _ in region.nodes)])
    points = np.concatenate([np.zeros((0, 3)), *(own for _, _, own in region.nodes)])
    kept, first, back = np.unique(labels, return_index=True, return_inverse=True)
    if len(kept) < len(labels):
        moved = np.flatnonzero(np.any(points != points[first[back]], axis=1))
        if len(moved):
            ends = np.cumsum([len(own) for _, own, _ in region.nodes])
            place = region.nodes[int(np.searchsorted(ends, moved[0], side="right"))][0]
            raise place.refused(
                f"node {labels[moved[0]]} is given again, at another position; expected every node once"
            )
        first = np.sort(first)
        labels, points = labels[first], points[first]
    return labels, points


def _check_distinct(labels: Integers, region: DeckRegion) -> None:
    """Refuse elements of one number."""
    kept, first = np.unique(labels, return_index=True)
    if len(kept) < len(labels):
        again = int(np.setdiff1d(np.arange(len(labels)), first)[0])
        ends = np.cumsum([len(block.labels) for block in region.blocks])
        place = region.blocks[int(np.searchsorted(ends, again, side="right"))].place
        raise place.refused(f"element {labels[again]} is given twice; expected every element once")


# -- rigid -------------------------------------------------------------------------------------------------------------
# Rigid surfaces of elements (R3D4, R2D2 and the like) or of lines that are swept: layers of cells that move as one.
#
# A rigid surface has no thickness in a deck. Here it gets one on the side that nothing touches, a share of its
# elements:
# what moves as a rigid body may have any elastic law.

#: Families of rigid elements.
_FAMILIES = ("rigid surfaces", "rigid lines")
#: Thickness of a layer, by the shortest of its edges: not so much that it folds where the surface bends.
_THIN = 0.1
#: Types of cells of layers by the number of their nodes in 3D, and in the plane by its family.
_SOLID = {6: "C3D6", 8: "C3D8"}
_PLANE = {"plane strain": "CPE4", "plane stress": "CPS4", "axisymmetric": "CAX4"}
#: Name of the material of layers.
_RIGID = "RIGID"


def add_profiles(deck: Deck, profiles: dict[str, RigidProfile]) -> None:
    """Add the elements of rigid surfaces that are given by lines: in 3D as long as the deck is, to both sides.

    Raises
    ------
    InvalidArgumentError
        A profile belongs to no rigid body, or one of the plane is given in 3D, or the other way round.
    """
    spatial = deck.dimension == 3
    far = float(np.linalg.norm(np.ptp(deck.points, axis=0))) if len(deck.points) else 1.0
    bodies = {coupling.target for coupling in deck.couplings if coupling.card == "RIGID BODY"}
    for name, profile in profiles.items():
        if name not in bodies:
            raise profile.place.refused(
                f"*SURFACE {name} is of no *RIGID BODY; expected one with ANALYTICAL SURFACE={name}"
            )
        if profile.is_swept != spatial:
            expected = "TYPE=CYLINDER" if spatial else "TYPE=SEGMENTS"
            raise profile.place.refused(f"*SURFACE {name} is not of the dimension of the bodies; expected {expected}")
        lines = profile.at(0.0) if not spatial else np.concatenate([profile.at(far), profile.at(-far)])
        first, count = len(deck.points), len(profile.corners)
        ends = first + np.column_stack([np.arange(count - 1), np.arange(1, count)])
        nodes = np.column_stack([ends, ends[:, ::-1] + count]) if spatial else ends
        last = max(deck.element_labels.tolist(), default=0)
        kind = element_type("R3D4" if spatial else "R2D2")
        assert kind is not None
        rows = len(deck.element_labels) + np.arange(len(nodes))
        deck.blocks.append(ElementBlock(kind, last + 1 + np.arange(len(nodes)), nodes, profile.place))
        deck.points = np.concatenate([deck.points, lines])
        deck.node_labels = np.concatenate([deck.node_labels, np.zeros(len(lines), dtype=np.int64)])
        deck.element_sets[name] = rows
        deck.surfaces[name] = Surface(profile.place, np.column_stack([rows, np.full(len(rows), -1)]))
        del deck.__dict__["element_labels"]


def add_layers(deck: Deck) -> None:
    """Make layers of cells of the elements of rigid bodies.

    Raises
    ------
    InvalidArgumentError
        Surfaces are on both sides of a rigid one.
    """
    rigid = np.zeros(len(deck.element_labels), dtype=bool)
    for coupling in deck.couplings:
        if coupling.card == "RIGID BODY" and coupling.target in deck.element_sets:
            rigid[deck.element_sets[coupling.target]] = True
    firsts = deck.firsts
    chosen = [
        k for k, block in enumerate(deck.blocks)
        if block.type.family in _FAMILIES and len(block.labels) and np.all(rigid[firsts[k] : firsts[k + 1]])
    ]  # fmt: skip
    bodies = [block for block in deck.blocks if block.type.is_body]
    if not chosen or not bodies:
        return
    faces = [(k, _outward(deck, k, firsts[k])) for k in chosen]
    behind = _behind(deck, [nodes for _, nodes in faces], bodies[0].type.family == "axisymmetric")
    rows = np.concatenate([np.arange(firsts[k], firsts[k + 1]) for k in chosen])
    for k, nodes in faces:
        back = behind[nodes]
        cells = np.column_stack([nodes[:, ::-1], back if deck.dimension == 2 else back[:, ::-1]])
        name = _PLANE[bodies[0].type.family] if deck.dimension == 2 else _SOLID[cells.shape[1]]
        kind = element_type(name)
        assert kind is not None
        said = f"{counted(len(nodes), 'rigid element')} of type {deck.blocks[k].type.name} with a layer behind them"
        deck.account.append(Account(deck.blocks[k].place, "ELEMENT", said))
        deck.blocks[k] = replace(deck.blocks[k], type=kind, nodes=cells)
    for name, surface in deck.surfaces.items():
        own = surface.faces.copy()
        own[np.isin(own[:, 0], rows), 1] = 0
        deck.surfaces[name] = replace(surface, faces=own)
    _give_material(deck, rows)


def _outward(deck: Deck, k: int, first: int) -> Integers:
    """Nodes of the elements of a block, turned so that their normals point to the side that surfaces are on."""
    block, turned = deck.blocks[k], np.zeros(len(deck.blocks[k].labels), dtype=bool)
    sides = np.concatenate([np.zeros((0, 2), dtype=np.int64), *(own.faces for own in deck.surfaces.values())])
    own = sides[(sides[:, 0] >= first) & (sides[:, 0] < first + len(turned))] - [first, 0]
    turned[own[own[:, 1] == -2, 0]] = True
    both = own[(own[:, 1] == -1) & turned[own[:, 0]], 0]
    if len(both):
        raise block.place.refused(
            f"element {block.labels[both[0]]} of type {block.type.name} has a surface on both of its sides; expected "
            "SPOS or SNEG"
        )
    return np.where(turned[:, None], block.nodes[:, ::-1], block.nodes)


def _behind(deck: Deck, faces: list[Integers], axisymmetric: bool) -> Integers:
    """Rows of new nodes behind those of faces, by the rows of these."""
    normals, shortest = np.zeros(deck.points.shape), np.inf
    for nodes in faces:
        places = deck.points[nodes]
        edges = np.roll(places, -1, axis=1) - places
        shortest = min(shortest, float(np.min(np.linalg.norm(edges, axis=2))))
        own = np.cross([0.0, 0.0, 1.0], edges[:, 0]) if deck.dimension == 2 else np.cross(edges[:, 0], edges[:, 1])
        own /= np.linalg.norm(own, axis=1)[:, None]
        np.add.at(normals, nodes.ravel(), np.repeat(own, nodes.shape[1], axis=0))
    used = np.unique(np.concatenate([nodes.ravel() for nodes in faces]))
    places = deck.points[used] - _THIN * shortest * _of_length_one(normals[used])
    if axisymmetric:  # the axis stays where it is
        places[:, 0] = np.where(deck.points[used, 0] == 0, 0.0, places[:, 0])
    behind = np.zeros(len(deck.points), dtype=np.int64)
    behind[used] = len(deck.points) + np.arange(len(used))
    deck.points = np.concatenate([deck.points, places])
    deck.node_labels = np.concatenate([deck.node_labels, np.zeros(len(used), dtype=np.int64)])
    return behind


def _of_length_one(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def _give_material(deck: Deck, rows: Integers) -> None:
    """Give layers the material and the thickness of a body."""
    laws = {name: own for name, own in deck.materials.items() if own.elastic}
    sections = [own for own in deck.sections if own.kind == "SOLID SECTION" and own.material in laws]
    if not sections:
        return  # what has no material is refused for all
    solid = min(sections, key=lambda own: float(laws[own.material].constants[0]))
    deck.materials[_RIGID] = replace(laws[solid.material], name=_RIGID)
    deck.element_sets[_RIGID] = rows
    deck.sections.append(Section("SOLID SECTION", _RIGID, _RIGID, solid.thickness, "", solid.place))
