"""Cards of materials and of what is made of them."""

from __future__ import annotations

import numpy as np

from enumsol.decks.cards import Card
from enumsol.decks.model import SYSTEMS, Material, Orientation, Section
from enumsol.decks.registry import Reading, card
from enumsol.support.array_types import Floats
from enumsol.support.messages import counted

#: Constants of the kinds of *ELASTIC.
_CONSTANTS = {"ISO": 2, "ORTHO": 9, "ENGINEERING CONSTANTS": 9}
#: Entries of a line of data.
_WIDTH = 8


@card("MATERIAL", "NAME")
def material(reading: Reading, given: Card) -> str:
    """*MATERIAL: what follows belongs to it."""
    name = given.new_name(reading.deck.materials)
    made = reading.deck.materials[name] = reading.material = Material(name, given.place)
    return f"material {made.name}"


@card("ELASTIC", "TYPE")
def elastic(reading: Reading, given: Card) -> str:
    """*ELASTIC: isotropic or orthotropic, at one temperature."""
    own = _material(reading, given)
    kind = " ".join(given.name_of("TYPE").split()) or "ISO"
    kind = {"ISOTROPIC": "ISO", "ORTHOTROPIC": "ORTHO", "ENGINEERINGCONSTANTS": "ENGINEERING CONSTANTS"}.get(kind, kind)
    if kind not in _CONSTANTS:
        raise given.refused(f"is of type {kind}, which is not read; expected one of {', '.join(_CONSTANTS)}")
    own.elastic, own.constants, own.elastic_place = kind, _constants(given, _CONSTANTS[kind]), given.place
    if kind == "ISO" and not (own.constants[0] > 0 and -1 < own.constants[1] < 0.5):
        young, poisson = own.constants
        raise given.refused(
            f"has E = {young:g} and nu = {poisson:g}; expected Young's modulus > 0 and Poisson's ratio above -1 "
            "and below 0.5", 0
        )  # fmt: skip
    return f"elastic law of {own.name}: {kind.lower()}, {', '.join(f'{value:g}' for value in own.constants)}"


@card("DENSITY")
def density(reading: Reading, given: Card) -> str:
    """*DENSITY: mass by volume."""
    own = _material(reading, given)
    own.density = float(_constants(given, 1)[0])
    if own.density < 0:
        raise given.refused(f"is {own.density:g}; expected a density of at least 0", 0)
    return f"density of {own.name}: {own.density:g}"


@card("EXPANSION", "TYPE", "ZERO")
def expansion(reading: Reading, given: Card) -> str:
    """*EXPANSION: thermal, one coefficient or three."""
    own = _material(reading, given)
    kind = given.name_of("TYPE") or "ISO"
    if kind not in ("ISO", "ORTHO"):
        raise given.refused(f"is of type {kind}, which is not read; expected ISO or ORTHO")
    own.expansion, own.expansion_place = _constants(given, {"ISO": 1, "ORTHO": 3}[kind]), given.place
    own.zero = given.number(given.options.get("ZERO", ""), 0)
    return f"thermal expansion of {own.name}: {', '.join(f'{value:g}' for value in own.expansion)}"


def _material(reading: Reading, given: Card) -> Material:
    if reading.material is None:
        raise given.refused("belongs to no material; expected it behind *MATERIAL")
    return reading.material


def _constants(given: Card, count: int) -> Floats:
    """Constants of a law that is given at one temperature, or at several where it is the same."""
    lines = -(-count // _WIDTH)
    if not given.data or len(given.data) % lines:
        raise given.refused(f"has {counted(len(given.data), 'line')} of data; expected {count} numbers")
    tables = []
    for first in range(0, len(given.data), lines):
        entries = [value for row in range(first, first + lines) for value in given.numbers(row)]
        if not count <= len(entries) <= count + 1:
            raise given.refused(f"has {counted(len(entries), 'number')}; expected {count}, and a temperature", first)
        tables.append(entries[:count])
    if np.any(np.array(tables) != tables[0]):
        raise given.refused(
            f"depends on the temperature ({len(tables)} different lines); expected values at one temperature", 1
        )
    return np.array(tables[0])


@card("SOLID SECTION", "ELSET", "MATERIAL", "ORIENTATION", "CONTROLS", of_mesh=True)
def solid_section(reading: Reading, given: Card) -> str:
    """*SOLID SECTION: the material of a set of elements, and the thickness of plane ones."""
    elements, of = given.needed("ELSET"), given.needed("MATERIAL")
    thickness = given.numbers(0, 0)[:1] if given.data else []
    if thickness and thickness[0] < 0:
        raise given.refused(f"has the thickness {thickness[0]:g}; expected one > 0", 0)
    value = thickness[0] if thickness and thickness[0] else None
    turned = given.name_of("ORIENTATION")
    reading.region.sections.append(Section(given.name, elements, of, value, turned, given.place))
    return f"elements of {elements} are of {of}" + (f", {value:g} thick" if value is not None else "")


@card("SHELL SECTION", "ELSET", "MATERIAL", "ORIENTATION", "OFFSET", "NODAL THICKNESS", "COMPOSITE", of_mesh=True)
@card("MEMBRANE SECTION", "ELSET", "MATERIAL", "ORIENTATION", "OFFSET", "NODAL THICKNESS", of_mesh=True)
@card("BEAM SECTION", "ELSET", "MATERIAL", "SECTION", "ORIENTATION", "OFFSET1", "OFFSET2", of_mesh=True)
@card("SURFACE SECTION", "ELSET", "DENSITY", of_mesh=True)
def other_section(reading: Reading, given: Card) -> str:
    """Sections of shells and the like, whose elements carry something."""
    elements = given.needed("ELSET")
    reading.region.sections.append(Section(given.name, elements, given.name_of("MATERIAL"), None, "", given.place))
    return f"section of {elements}"


@card("ORIENTATION", "NAME", "SYSTEM", of_mesh=True)
def orientation(reading: Reading, given: Card) -> str:
    """*ORIENTATION: local directions, by two points and an origin."""
    name = given.needed("NAME")
    named = given.name_of("SYSTEM")
    system = SYSTEMS.get(named, named)
    if system not in SYSTEMS.values():
        raise given.refused(f"has the system {system}, which is not read; expected RECTANGULAR or CYLINDRICAL")
    if not 1 <= len(given.data) <= 2:
        raise given.refused(f"has {len(given.data)} lines of data; expected two points, and a rotation")
    values = np.array([*given.numbers(0, 6, 9), 0.0, 0.0, 0.0][:9]).reshape(3, 3)
    first, second = (values[k] - values[2] for k in (0, 1)) if system == "RECTANGULAR" else (values[1] - values[0],) * 2
    flat = not np.any(first) or (system == "RECTANGULAR" and not np.any(np.cross(first, second)))
    if flat:
        raise given.refused("has points that give no directions; expected two points that are not in line", 0)
    turned = None
    if len(given.data) > 1:
        axis, angle = (*given.numbers(1, 1, 2), 0.0)[:2]
        if axis not in (1, 2, 3):
            raise given.refused(f"turns about the axis {axis:g}; expected 1, 2 or 3", 1)
        turned = (int(axis), angle)
    reading.region.orientations[name] = Orientation(system, values[:2], values[2], turned, given.place)
    return f"local directions {name}"
