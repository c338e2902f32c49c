"""Cards that make nodes and elements from others: along lines, between sets, in rows, and as copies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from enumsol.decks.cards import Card, key
from enumsol.decks.model import DeckRegion, ElementBlock, Numbers, by_block
from enumsol.decks.registry import Reading, card
from enumsol.support.array_types import Floats, Integers
from enumsol.support.messages import counted

#: Nodes or elements that one line may make; no deck that is written by hand has more.
_MOST = 5_000_000
#: Radii of the ends of an arc may differ by this share, by rounding.
_ROUND = 1e-3


@card("NGEN", "NSET", "LINE", "SYSTEM", of_mesh=True)
def ngen(reading: Reading, given: Card) -> str:
    """*NGEN: nodes on the line or the arc between two nodes, whose numbers go up by a step."""
    kind = given.name_of("LINE")
    if kind not in ("", "C") or given.name_of("SYSTEM") not in ("", "RC"):
        raise given.refused("makes nodes on other lines than straight ones and arcs (LINE=C); expected such nodes")
    labels: list[Integers] = []
    for row, entries in given.rows():
        first, last, step = [*(given.integer(entry, row) for entry in entries[:3] if entry), 1][:3]
        if step * (last - first) <= 0 or (last - first) % step or (last - first) // step > _MOST:
            raise given.refused(f"goes from {first} to {last} by {step}; expected numbers that lead there", row)
        own = np.arange(first, last + np.sign(step), step)
        ends, shares = _places(reading.region, given, own[[0, -1]], row), np.linspace(0, 1, len(own))[:, None]
        points = ends[0] + shares * (ends[1] - ends[0])
        if kind == "C":
            third = [given.number(entry, row) for entry in [*entries[4:10], *[""] * 6][:6]]
            centre = np.array(third[:3])
            if len(entries) > 3 and entries[3]:
                centre = _places(reading.region, given, np.array([given.integer(entries[3], row)]), row)[0]
            points = _arc(given, row, ends, centre, np.array(third[3:]), shares)
        if len(own) > 2:
            reading.region.nodes.append((given.at(row), own[1:-1], points[1:-1]))
        labels.append(own)
    return _made(reading, given, "NSET", "NSET", labels)


def _arc(given: Card, row: int, ends: Floats, centre: Floats, normal: Floats, shares: Floats) -> Floats:
    """Points of an arc about a centre, the shorter one unless a normal is given."""
    one, two = ends - centre
    radius, other = np.linalg.norm(one), np.linalg.norm(two)
    across = normal if np.any(normal) else np.cross(one, two)
    if abs(radius - other) > _ROUND * radius or not np.any(across):
        raise given.refused(
            "has ends of an arc at different distances from its centre, or opposite; expected others", row
        )
    across = across / np.linalg.norm(across)
    aside = np.cross(across, one)
    angle = np.arctan2(two @ aside, two @ one) % (2 * np.pi)
    return np.asarray(centre + np.cos(shares * angle) * one + np.sin(shares * angle) * aside)


@card("NFILL", "NSET", "BIAS", of_mesh=True)
def nfill(reading: Reading, given: Card) -> str:
    """*NFILL: nodes on the lines between the nodes of two sets."""
    bias = given.number(given.options.get("BIAS", "1"), 0)
    if bias <= 0:
        raise given.refused(f"has BIAS={bias:g}; expected it > 0")
    labels: list[Integers] = []
    for row, entries in given.rows():
        if len(entries) < 3:
            raise given.refused(f"has {len(entries)} entries in a line; expected two sets, intervals and a step", row)
        one, two = (_members(reading, given, "NSET", name, row) for name in entries[:2])
        count, step = [*(given.integer(entry, row) for entry in entries[2:4]), 1][:2]
        if len(one) != len(two) or not 1 <= count <= _MOST // len(one):
            raise given.refused(
                f"fills {count} intervals between {len(one)} and {len(two)} nodes; expected as many nodes in both", row
            )
        ends = [_places(reading.region, given, own, row) for own in (one, two)]
        lengths = np.cumsum(bias ** -np.arange(count, dtype=np.float64))
        for k in range(1, count):
            own, share = one + k * step, lengths[k - 1] / lengths[-1]
            reading.region.nodes.append((given.at(row), own, ends[0] + share * (ends[1] - ends[0])))
            labels.append(own)
        labels += [one, two]
    return _made(reading, given, "NSET", "NSET", labels)


@card("NCOPY", "OLD SET", "NEW SET", "CHANGE NUMBER", "SHIFT", of_mesh=True)
def ncopy(reading: Reading, given: Card) -> str:
    """*NCOPY with SHIFT: nodes that are moved by a vector, and then about an axis."""
    if "SHIFT" not in given.options:
        raise given.refused("has no SHIFT; expected nodes that are moved")
    labels = _members(reading, given, "NSET", given.needed("OLD SET"), None)
    moved = DeckRegion()
    if given.data:
        moved.translation = np.array([*given.numbers(0, 0, 3), 0.0, 0.0, 0.0][:3])
    if len(given.data) > 1 and any(turn := given.numbers(1, 7, 7)):
        if not np.any(np.subtract(turn[3:6], turn[:3])):
            raise given.refused("turns about two points that are one; expected two points on an axis and degrees", 1)
        moved.rotation = np.array(turn)
    points = moved.moved(_places(reading.region, given, labels, None))
    own = labels + _shift(given, "CHANGE NUMBER")
    reading.region.nodes.append((given.place, own, points))
    return _made(reading, given, "NSET", "NEW SET", [own])


@card("ELGEN", "ELSET", of_mesh=True)
def elgen(reading: Reading, given: Card) -> str:
    """*ELGEN: rows, rows of rows and layers of elements that are like one, with numbers that go up by steps."""
    labels: list[Integers] = []
    for row, entries in given.rows():
        values = [given.integer(entry, row) if entry else 1 for entry in [*entries, *[""] * 10][:10]]
        counts = values[1::3]
        if min(counts) < 1 or counts[0] * counts[1] * counts[2] > _MOST:
            raise given.refused(f"makes {' times '.join(map(str, counts))} elements; expected 1 or more of each", row)
        steps = np.array(np.unravel_index(np.arange(np.prod(counts)), counts[::-1])[::-1]).T
        block, rows = _elements(reading, given, np.array([values[0]]), row)[0]
        nodes, numbers = steps @ values[2::3], steps @ values[3::3]
        own = block.labels[rows] + numbers
        if len(own) > 1:
            more = block.nodes[rows] + nodes[1:, None]
            reading.region.blocks.append(ElementBlock(block.type, own[1:], more, given.at(row)))
        labels.append(own)
    return _made(reading, given, "ELSET", "ELSET", labels)


@card("ELCOPY", "ELEMENT SHIFT", "OLD SET", "NEW SET", "SHIFT NODES", of_mesh=True)
def elcopy(reading: Reading, given: Card) -> str:
    """*ELCOPY: elements like those of a set, with other numbers."""
    old = _members(reading, given, "ELSET", given.needed("OLD SET"), None)
    shift, of_nodes = _shift(given, "ELEMENT SHIFT"), _shift(given, "SHIFT NODES")
    found = _elements(reading, given, old, None)
    reading.region.blocks += [
        ElementBlock(block.type, block.labels[rows] + shift, block.nodes[rows] + of_nodes, given.place)
        for block, rows in found
    ]
    return _made(reading, given, "ELSET", "NEW SET", [old + shift])


def _shift(given: Card, option: str) -> int:
    given.needed(option)
    text = given.options[option]
    if not text.lstrip("-").isdecimal() or len(text) > 9 or not int(text):
        raise given.refused(f"has {option}={text}; expected what is added to the numbers")
    return int(text)


def _made(reading: Reading, given: Card, kind: str, option: str, labels: list[Integers]) -> str:
    """Put what was made into the set that the card names, and say how much it was."""
    every = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *labels]))
    if len(every) and every[0] < 1:
        raise given.refused(f"makes the number {every[0]}; expected numbers from 1")
    if name := given.options.get(option):
        reading.region.members(kind, name, given.place).parts.append((kind, every, "", given.place))
    return counted(len(every), "node" if kind == "NSET" else "element")


def _members(reading: Reading, given: Card, kind: str, name: str, row: int | None) -> Integers:
    """Numbers in a set of the region, in ascending order."""
    found: list[Integers] = []
    left, seen = [name], set[str]()
    while left:
        own = key(left.pop())
        if own in seen:
            continue
        seen.add(own)
        members = reading.region.sets.get((kind, own))
        if own.isdecimal():
            found.append(np.array([int(own)]))
        elif members is None:
            raise given.refused(f"names the set {own}, which does not stand before it; expected one that does", row)
        for of, what, _, _ in () if members is None else members.parts:
            if of != kind:
                raise given.refused(f"names the set {own}, of nodes of elements; expected one by numbers", row)
            if isinstance(what, str):
                left.append(what)
            elif len(what) <= _MOST:
                found.append(np.asarray(what, dtype=np.int64))
    labels = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *found]))
    if not len(labels):
        raise given.refused(f"names the set {key(name)}, which is empty; expected one with members", row)
    return labels


def _rows(known: Integers, wanted: Integers, lost: Callable[[int], Exception]) -> Integers:
    """Places of numbers among those that are known."""
    rows, there = Numbers.of(known, 0).found(wanted)
    if not np.all(there):
        raise lost(int(wanted[np.argmin(there)]))
    return rows


def _places(region: DeckRegion, given: Card, labels: Integers, row: int | None) -> Floats:
    """Positions (k, 3) of nodes that stand before a card."""
    known = np.concatenate([np.zeros(0, dtype=np.int64), *(own for _, own, _ in region.nodes)])
    points = np.concatenate([np.zeros((0, 3)), *(own for _, _, own in region.nodes)])
    expected = "which does not stand before it; expected its position in *NODE"
    return np.asarray(
        points[_rows(known, labels, lambda node: given.refused(f"names the node {node}, {expected}", row))]
    )


def _elements(reading: Reading, given: Card, labels: Integers, row: int | None) -> list[tuple[ElementBlock, Integers]]:
    """Blocks and rows in them of elements that stand before a card."""
    blocks = reading.region.blocks
    known = np.concatenate([np.zeros(0, dtype=np.int64), *(block.labels for block in blocks)])
    expected = "which does not stand before it; expected it in *ELEMENT"
    rows = _rows(known, labels, lambda element: given.refused(f"names the element {element}, {expected}", row))
    return [(block, own) for _, block, own in by_block(blocks, rows)]
