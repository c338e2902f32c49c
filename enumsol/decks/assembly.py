"""Regions put together: nodes and elements of the deck and of its instances in one list each, sets by their rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enumsol.decks.cards import DeckPlace, key, shown
from enumsol.decks.faces import named_faces
from enumsol.decks.model import Account, Deck, DeckRegion, Members, Numbers, RigidProfile, Surface, by_block
from enumsol.decks.registry import Reading
from enumsol.decks.rigid import add_layers, add_profiles
from enumsol.errors import InvalidArgumentError
from enumsol.support.array_types import Floats, Integers
from enumsol.support.messages import counted, listed

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
        raise InvalidArgumentError(f"{reading.region.place}: {open_} does not end; expected *END {what}")
    for part in reading.parts.values():
        if not part.is_used and part.place is not None:
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
                raise InvalidArgumentError(
                    f"{block.place}: element {block.labels[k]} has the node {lost}, which is not in the deck; expected "
                    "its position in *NODE"
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
            self.deck.analysis.couplings.append(moved)
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
                raise InvalidArgumentError(
                    f"{members.place}: the set {members.spelled} contains itself; expected sets without circles"
                )
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
            raise InvalidArgumentError(f"{place}: the instance {inside} is not in the deck; expected one of {known}")
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
        raise InvalidArgumentError(f"{place}: there is no set of {words} named {shown(what)}; expected one of {known}")

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
            raise InvalidArgumentError(
                f"{place}: node {labels[moved[0]]} is given again, at another position; expected every node once"
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
        raise InvalidArgumentError(f"{place}: element {labels[again]} is given twice; expected every element once")
