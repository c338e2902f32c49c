"""Cards of meshes: nodes, elements, sets, surfaces, parts that are put together, and what is made from others."""

from __future__ import annotations

from functools import partial

import numpy as np

from enumsol.decks.cards import ROUNDED, Card, is_number, key
from enumsol.decks.elements import element_type
from enumsol.decks.model import DeckRegion, ElementBlock, Members, Numbers, RigidProfile, by_block
from enumsol.decks.registry import Reading, card, harmless, refused
from enumsol.support.array_types import Floats, Integers
from enumsol.support.messages import counted

harmless("it asks for output", *(
    "PREPRINT", "RESTART", "NODE PRINT", "EL PRINT", "NODE FILE", "EL FILE", "NODE OUTPUT", "ELEMENT OUTPUT", "OUTPUT",
    "CONTACT FILE", "CONTACT PRINT", "CONTACT OUTPUT", "FILE FORMAT", "MONITOR", "SECTION PRINT", "ENERGY FILE",
    "ENERGY PRINT", "ENERGY OUTPUT", "PRINT", "FILE OUTPUT", "INTEGRATED OUTPUT", "DIAGNOSTICS", "FACE PRINT",
))  # fmt: skip
mesh_card = partial(card, of_mesh=True)
refused("makes or moves nodes, which are to be written out", "to leave all nodes where they are", "NMAP", "SYSTEM",
        of_mesh=True)  # fmt: skip


@mesh_card("HEADING", "UNSYMMETRIC AXISYMMETRIC", "SPARSE")
def heading(reading: Reading, given: Card) -> str | None:
    """*HEADING: a title."""
    reading.deck.heading = reading.deck.heading or " ".join(given.data)
    return None


@mesh_card("NODE", "NSET", "SYSTEM")
def node(reading: Reading, given: Card) -> str:
    """*NODE: numbers and positions."""
    if (system := given.name_of("SYSTEM") or "R") != "R":
        raise given.refused(f"has positions in the system {system}; expected SYSTEM=R, rectangular ones")
    values = given.table(7)  # Abaqus: a direction behind the position
    labels = values[:, 0].astype(np.int64)
    if len(wrong := np.flatnonzero((labels != values[:, 0]) | (labels < 1) | (labels >= 2**53))):
        raise given.refused(
            "has a line that begins with no number of a node; expected an integer from 1", int(wrong[0])
        )
    region = reading.region
    region.nodes.append((given.place, labels, values[:, 1:4]))
    if name := given.options.get("NSET"):
        region.members("NSET", name, given.place).parts.append(("NSET", labels, "", given.place))
    return counted(len(labels), "node")


@mesh_card("ELEMENT", "TYPE", "ELSET")
def element(reading: Reading, given: Card) -> str | None:
    """*ELEMENT: numbers and nodes, by types."""
    name = given.needed("TYPE")
    if name in reading.ignore:
        reading.account(given, f"elements of type {name}, not used, as you say", used=False)
        if own := given.options.get("ELSET"):
            reading.region.members("ELSET", own, given.place)
        return None
    kind = element_type(name)
    if kind is None:
        raise given.refused(
            f"has elements of type {name}, which are not known; expected solid ones (C3D8, C3D10 and the like) or "
            f"plane ones (CPS4, CPE8, CAX6 and the like), or --ignore {name} to do without them"
        )
    values = given.integers(1 + kind.shape.nodes)
    block = ElementBlock(kind, values[:, 0], values[:, 1:], given.place)
    region = reading.region
    region.blocks.append(block)
    if own := given.options.get("ELSET"):
        region.members("ELSET", own, given.place).parts.append(("ELSET", block.labels, "", given.place))
    return f"{counted(len(values), 'element')} of type {name}"


@mesh_card("NSET", "NSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED", "ELSET", unused=("FREQUENCY",))
def nset(reading: Reading, given: Card) -> str:
    """*NSET: a set of nodes, or more nodes for one that exists."""
    members = _set(reading, given, "NSET")
    if elements := given.options.get("ELSET"):
        members.parts.append(("ELSET", elements, given.name_of("INSTANCE"), given.place))
    return f"set of nodes {members.spelled}"


@mesh_card("ELSET", "ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED")
def elset(reading: Reading, given: Card) -> str:
    """*ELSET: a set of elements, or more elements for one that exists."""
    return f"set of elements {_set(reading, given, 'ELSET').spelled}"


def _set(reading: Reading, given: Card, kind: str) -> Members:
    given.needed(kind)
    members = reading.region.members(kind, given.options[kind], given.place)
    instance = given.name_of("INSTANCE")
    if "GENERATE" in given.options:
        for row, entries in given.rows():
            if not 1 <= len(entries) <= 3:
                raise given.refused(f"has {len(entries)} numbers; expected first, last and step", row)
            first, last, step = (*(given.integer(entry, row) for entry in entries), 1)[:3] if len(entries) > 1 else (
                *[given.integer(entries[0], row)] * 2, 1)  # fmt: skip
            if step < 1 or last < first:
                raise given.refused(f"goes from {first} to {last} by {step}; expected a step of at least 1", row)
            members.parts.append((kind, range(first, last + 1, step), instance, given.at(row)))
        return members
    every = [entry.strip() for text in given.data for entry in text.split(",")]
    numbers = [int(entry) for entry in every if is_number(entry) and len(entry) <= 18]
    if any(is_number(entry) and len(entry) > 18 for entry in every):
        for row, entries in given.rows():
            for entry in entries:
                if is_number(entry):
                    given.integer(entry, row)  # says which one is too large
    if numbers:
        members.parts.append((kind, np.array(numbers, dtype=np.int64), instance, given.place))
    if len(numbers) < len(every):
        for row, entries in given.rows():
            for entry in entries:
                if entry and not is_number(entry):
                    members.parts.append((kind, entry, instance, given.at(row)))
    return members


@mesh_card("SURFACE", "NAME", "TYPE", "INTERNAL")
def surface(reading: Reading, given: Card) -> str:
    """*SURFACE: faces of elements, or nodes."""
    given.needed("NAME")
    kind = given.name_of("TYPE") or "ELEMENT"
    if kind in ("SEGMENTS", "CYLINDER"):
        reading.region.profiles[given.needed("NAME")] = _profile(given, kind == "CYLINDER")
        return f"rigid surface of lines {given.needed('NAME')}"
    if kind not in ("ELEMENT", "NODE"):
        raise given.refused(
            f"is of type {kind}, which is not read; expected ELEMENT or NODE, or SEGMENTS or CYLINDER of straight lines"
        )
    members = reading.region.members("SURFACE", given.options["NAME"], given.place)
    if members.parts and members.nodal != (kind == "NODE"):
        raise given.refused(
            f"gives {members.spelled} as nodes and as faces, also in {members.place}; expected two names"
        )
    members.nodal = kind == "NODE"
    numbers: dict[str, tuple[int, list[int]]] = {}
    for row, entries in given.rows():
        if not entries:
            continue
        first, label = entries[0], "" if members.nodal else "".join(entries[1:2]).upper()
        if is_number(first):
            numbers.setdefault(label, (row, []))[1].append(given.integer(first, row))
        else:
            members.parts.append((label, first, "", given.at(row)))
    for label, (row, every) in numbers.items():
        members.parts.append((label, np.array(every, dtype=np.int64), "", given.at(row)))
    return f"surface of {'nodes' if members.nodal else 'faces'} {members.spelled}"


def _profile(given: Card, swept: bool) -> RigidProfile:
    """Lines of a rigid surface, behind the axes of those that are swept: an origin, a point on x, and one on -z."""
    origin, axes, rows = np.zeros(3), np.eye(3), [*given.rows()]
    if swept and rows and not rows[0][1][0][:1].isalpha():
        values = np.array([*given.numbers(0, 6, 6), *given.numbers(1, 3, 3)]).reshape(3, 3)
        origin, (along, across) = values[0], values[1:] - values[0]
        third = np.cross(np.cross(along, -across), along)
        if not np.any(third):
            raise given.refused("has three points in line; expected an origin, a point on x and one across", 0)
        axes = np.array([own / np.linalg.norm(own) for own in (along, np.cross(third, along), third)])
        rows = rows[2:]
    corners = []
    for k, (row, entries) in enumerate(rows):
        word, expected = "".join(entries[:1]).upper(), "LINE" if k else "START"
        if word != expected or len(entries) != 3:
            raise given.refused(
                f"has {word or 'nothing'} with {counted(max(len(entries) - 1, 0), 'number')}; expected {expected} with "
                "two, as curves are not read (rigid elements are)", row
            )  # fmt: skip
        corners.append([given.number(entry, row) for entry in entries[1:]])
        if len(corners) > 1 and corners[-1] == corners[-2]:
            raise given.refused("has a line of no length; expected another point", row)
    if len(corners) < 2:
        raise given.refused("has no line; expected START and LINE")
    return RigidProfile(given.place, np.array(corners), origin, axes, swept)


def _check_outside(reading: Reading, given: Card) -> None:
    """Refuse parts and instances that begin within others."""
    if within := reading.part or reading.instance:
        what = "PART" if reading.part else "INSTANCE"
        raise given.refused(f"begins before {within} ends; expected *END {what} before it")


@mesh_card("PART", "NAME")
def part(reading: Reading, given: Card) -> str:
    """*PART: what follows belongs to the part."""
    _check_outside(reading, given)
    reading.part = given.new_name(reading.parts)
    reading.parts[reading.part] = DeckRegion(given.place, given.options["NAME"])
    return f"part {reading.part}"


@mesh_card("END PART")
def end_part(reading: Reading, given: Card) -> None:
    """*END PART."""
    reading.part = ""


@mesh_card("ASSEMBLY", "NAME")
@mesh_card("END ASSEMBLY")
def assembly(reading: Reading, given: Card) -> None:
    """*ASSEMBLY and *END ASSEMBLY: what is between them belongs to the deck itself."""


@mesh_card("INSTANCE", "NAME", "PART")
def instance(reading: Reading, given: Card) -> str:
    """*INSTANCE: a part that is moved, first by a vector and then about an axis."""
    name, of = given.new_name(reading.instances), given.needed("PART")
    _check_outside(reading, given)
    own = given.place.entry(reading.parts, of, f"*INSTANCE is of the part {of}, which is not in the deck")
    own.is_used = True
    made = own.copied(given.place, given.options["NAME"].strip('"'))
    if len(given.data) > 2:
        raise given.refused(f"has {len(given.data)} lines of data; expected a translation and a rotation at most")
    _move(made, given)
    reading.instance = name
    reading.instances[name] = made
    return f"instance {name} of part {of}"


def _move(region: DeckRegion, given: Card) -> None:
    """Move a region as the data of a card say: by a vector, and then about an axis; zeros leave it where it is."""
    if given.data:
        region.translation = np.array([*given.numbers(0, 0, 3), 0.0, 0.0, 0.0][:3])
    if len(given.data) > 1 and any(turn := given.numbers(1, 7, 7)):
        if not np.any(np.subtract(turn[3:6], turn[:3])):
            raise given.refused("turns about two points that are one; expected two points on an axis and degrees", 1)
        region.rotation = np.array(turn)


@mesh_card("END INSTANCE")
def end_instance(reading: Reading, given: Card) -> None:
    """*END INSTANCE."""
    reading.instance = ""


# -- making cards ------------------------------------------------------------------------------------------------------
# Cards that make nodes and elements from others: along lines, between sets, in rows, and as copies.

#: Nodes or elements that one line may make; no deck that is written by hand has more.
_MOST = 5_000_000


@mesh_card("NGEN", "NSET", "LINE", "SYSTEM")
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
    if abs(radius - other) > ROUNDED * radius or not np.any(across):
        raise given.refused(
            "has ends of an arc at different distances from its centre, or opposite; expected others", row
        )
    across = across / np.linalg.norm(across)
    aside = np.cross(across, one)
    angle = np.arctan2(two @ aside, two @ one) % (2 * np.pi)
    return np.asarray(centre + np.cos(shares * angle) * one + np.sin(shares * angle) * aside)


@mesh_card("NFILL", "NSET", "BIAS")
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


@mesh_card("NCOPY", "OLD SET", "NEW SET", "CHANGE NUMBER", "SHIFT")
def ncopy(reading: Reading, given: Card) -> str:
    """*NCOPY with SHIFT: nodes that are moved by a vector, and then about an axis."""
    if "SHIFT" not in given.options:
        raise given.refused("has no SHIFT; expected nodes that are moved")
    labels = _members(reading, given, "NSET", given.needed("OLD SET"), None)
    moved = DeckRegion()
    _move(moved, given)
    points = moved.moved(_places(reading.region, given, labels, None))
    own = labels + _shift(given, "CHANGE NUMBER")
    reading.region.nodes.append((given.place, own, points))
    return _made(reading, given, "NSET", "NEW SET", [own])


@mesh_card("ELGEN", "ELSET")
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


@mesh_card("ELCOPY", "ELEMENT SHIFT", "OLD SET", "NEW SET", "SHIFT NODES")
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


def _rows(given: Card, row: int | None, known: list[Integers], wanted: Integers, what: str, expected: str) -> Integers:
    """Places of numbers among those that stand before a card, in words: what they are, and what is expected."""
    rows, there = Numbers.of(np.concatenate([np.zeros(0, dtype=np.int64), *known]), 0).found(wanted)
    if not np.all(there):
        lost = wanted[np.argmin(there)]
        raise given.refused(f"names the {what} {lost}, which does not stand before it; expected {expected}", row)
    return rows


def _places(region: DeckRegion, given: Card, labels: Integers, row: int | None) -> Floats:
    """Positions (k, 3) of nodes that stand before a card."""
    points = np.concatenate([np.zeros((0, 3)), *(own for _, _, own in region.nodes)])
    known = [own for _, own, _ in region.nodes]
    return np.asarray(points[_rows(given, row, known, labels, "node", "its position in *NODE")])


def _elements(reading: Reading, given: Card, labels: Integers, row: int | None) -> list[tuple[ElementBlock, Integers]]:
    """Blocks and rows in them of elements that stand before a card."""
    blocks = reading.region.blocks
    rows = _rows(given, row, [block.labels for block in blocks], labels, "element", "it in *ELEMENT")
    return [(block, own) for _, block, own in by_block(blocks, rows)]
