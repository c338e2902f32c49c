"""Cards of meshes: nodes, elements, sets, surfaces, and parts that are put together."""

from __future__ import annotations

from functools import partial

import numpy as np

from enumsol.decks.cards import Card, is_number
from enumsol.decks.elements import element_type
from enumsol.decks.model import DeckRegion, ElementBlock, Members, RigidProfile
from enumsol.decks.registry import Reading, card, harmless, refused
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
    reading.part = given.needed("NAME")
    if reading.part in reading.parts:
        raise given.refused(f"is named {reading.part} like another one; expected names that differ")
    reading.parts[reading.part] = DeckRegion(given.place, given.options["NAME"])
    return f"part {reading.part}"


@mesh_card("END PART")
def end_part(reading: Reading, given: Card) -> None:
    """*END PART."""
    reading.part = ""


@mesh_card("ASSEMBLY", "NAME")
def assembly(reading: Reading, given: Card) -> None:
    """*ASSEMBLY: what follows belongs to the deck itself."""


@mesh_card("END ASSEMBLY")
def end_assembly(reading: Reading, given: Card) -> None:
    """*END ASSEMBLY."""


@mesh_card("INSTANCE", "NAME", "PART")
def instance(reading: Reading, given: Card) -> str:
    """*INSTANCE: a part that is moved, first by a vector and then about an axis."""
    name, of = given.needed("NAME"), given.needed("PART")
    _check_outside(reading, given)
    if of not in reading.parts:
        known = ", ".join(reading.parts) or "none"
        raise given.refused(f"is of the part {of}, which is not in the deck; expected one of {known}")
    if name in reading.instances:
        raise given.refused(f"is named {name} like another one; expected names that differ")
    reading.parts[of].is_used = True
    made = reading.parts[of].copied(given.place, given.options["NAME"].strip('"'))
    if len(given.data) > 2:
        raise given.refused(f"has {len(given.data)} lines of data; expected a translation and a rotation at most")
    if given.data:
        made.translation = np.array([*given.numbers(0, 0, 3), 0.0, 0.0, 0.0][:3])
    if len(given.data) > 1:
        values = np.array(given.numbers(1, 7, 7))
        if not np.any(values[3:6] - values[:3]):
            raise given.refused("turns about two points that are one; expected two points on an axis and degrees", 1)
        made.rotation = values
    reading.instance = name
    reading.instances[name] = made
    return f"instance {name} of part {of}"


@mesh_card("END INSTANCE")
def end_instance(reading: Reading, given: Card) -> None:
    """*END INSTANCE."""
    reading.instance = ""
