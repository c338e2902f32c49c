"""Cards of contacts: which surfaces may touch or are joined, their friction, and the distances between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from enumsol.decks.cards import key
from enumsol.decks.registry import card
from enumsol.decks.steps import ContactPair, Interaction, Tie

if TYPE_CHECKING:
    from enumsol.decks.cards import Card
    from enumsol.decks.registry import Reading

#: Kinds of contact that differ from a hard one by the stiffness of a penalty.
_SOFT = ("LINEAR", "EXPONENTIAL", "TABULAR")
#: Laws of friction other than Coulomb's with one coefficient.
_OTHER_LAWS = ("ROUGH", "USER", "EXPONENTIAL DECAY", "TAUMAX", "ANISOTROPIC", "DEPENDENCIES", "SHEAR TRACTION SLOPE")
#: Ties that are none of two surfaces.
_OTHER_TIES = ("CYCLIC SYMMETRY", "MULTISTAGE", "FLUID PERIODIC")


@card("SURFACE INTERACTION", "NAME", "USER", unused=("PAD THICKNESS",))
def surface_interaction(reading: Reading, given: Card) -> str:
    """*SURFACE INTERACTION: the cards after it say what it is."""
    name = given.needed("NAME")
    if name in reading.analysis.interactions:
        raise given.refused(f"gives {name} again; expected each name once")
    if "USER" in given.options:
        raise given.refused("has USER; expected friction and hard contact")
    reading.analysis.interactions[name] = Interaction(given.place)
    reading.analysis.changing = name
    return f"contact properties {name}, without friction unless a card says so"


@card(
    *("SURFACE BEHAVIOR", "PRESSURE-OVERCLOSURE", "NO SEPARATION"),
    unused=("PENALTY", "DIRECT", "AUGMENTED LAGRANGE"),
)
def surface_behavior(reading: Reading, given: Card) -> str:
    """*SURFACE BEHAVIOR: contact is hard, or what touches stays joined."""
    own, later = _interaction(reading, given), bool(reading.analysis.steps)
    if later and not reading.analysis.steps[-1].is_softened:
        raise given.refused("stands in a step without *CHANGE SURFACE BEHAVIOR before it; expected that")
    if "NO SEPARATION" in given.options:
        raise given.refused("has NO SEPARATION; expected surfaces that may part")
    kind = given.name_of("PRESSURE-OVERCLOSURE") or "HARD"
    if kind == "TIED" and not later:
        own.tied = True
        return "surfaces that stay joined"
    if kind == "HARD":
        return "hard contact"
    if kind in _SOFT:
        return f"hard contact: the stiffness of the {kind.lower()} law is not used, and nothing penetrates"
    raise given.refused(f"has PRESSURE-OVERCLOSURE={kind}; expected HARD, {', '.join(_SOFT)} or TIED")


@card("FRICTION", *_OTHER_LAWS, unused=("SLIP TOLERANCE", "ELASTIC SLIP", "LAGRANGE"))
def friction(reading: Reading, given: Card) -> str:
    """*FRICTION: the coefficient; a stiffness of sticking is not used, since what sticks does not move."""
    other = next((name for name in _OTHER_LAWS if name in given.options), None)
    if other is not None:
        raise given.refused(f"has {other}; expected Coulomb's law with one coefficient")
    own = _interaction(reading, given)
    found = [(row, entries) for row, entries in given.rows() if entries]
    if len(found) != 1:
        raise given.refused(f"has {len(found)} lines of data; expected one coefficient")
    row, entries = found[0]
    value = given.number(entries[0], row)
    if value < 0:
        raise given.refused(f"has the coefficient {value:g}; expected it >= 0", row)
    if not reading.analysis.steps:
        own.friction = value
    elif reading.analysis.changing in reading.analysis.steps[-1].friction:
        reading.analysis.steps[-1].friction[reading.analysis.changing] = value
    else:
        raise given.refused("stands in a step without *CHANGE FRICTION before it; expected that")
    return f"friction {value:g}" + ("; the stiffness of sticking is not used" if any(entries[1:]) else "")


@card(
    *("CONTACT PAIR", "INTERACTION", "ADJUST", "TIED", "SMALL SLIDING"),
    unused=(
        *("TYPE", "TRACKING", "NO THICKNESS", "HCRIT", "EXTENSION ZONE", "SMOOTH", "SUPPLEMENTARY CONSTRAINTS"),
        *("MECHANICAL CONSTRAINT", "CPSET", "WEIGHT", "OP", "SLIDING TRANSITION", "MINIMUM DISTANCE"),
    ),
)
def contact_pair(reading: Reading, given: Card) -> str:
    """*CONTACT PAIR: the first surface has the contact nodes, the second one the facets that they face."""
    if reading.analysis.steps:
        raise given.refused("stands in a step; expected contacts before the first *STEP")
    chosen = given.name_of("ADJUST")
    distance: float | str | None = chosen
    if not chosen[:1].isalpha():
        distance = _length(given, "ADJUST", "the distance up to which nodes are moved, or the set of these nodes")
    name = given.name_of("INTERACTION")
    for row, entries in given.rows():
        slave, master = _two(given, row, entries)
        reading.analysis.pairs.append(
            ContactPair(given.at(row), slave, master, name, distance, tied="TIED" in given.options)
        )
    said = ["nodes of the first surface against facets of the second, with small sliding"]
    if distance is not None:
        said.append(f"gaps {f'of {distance}' if isinstance(distance, str) else f'up to {distance:g}'} are closed")
    return "; ".join(said)


@card("CONTACT", unused=("OP",))
def contact(reading: Reading, given: Card) -> str:
    """*CONTACT: the cards after it name the surfaces that may touch; without friction unless one says so."""
    if reading.analysis.steps:
        raise given.refused("stands in a step; expected contacts before the first *STEP")
    reading.analysis.interactions.setdefault("", Interaction(given.place))
    return "contacts of the pairs that cards after it name"


@card("CONTACT INCLUSIONS", "ALL EXTERIOR")
def contact_inclusions(reading: Reading, given: Card) -> str:
    """*CONTACT INCLUSIONS: pairs of surfaces; overlaps of the geometry are taken away first, as Abaqus does."""
    if "ALL EXTERIOR" in given.options or not given.data:
        raise given.refused("has ALL EXTERIOR; expected the surfaces that may touch, two in a line, as in 'UNDER, ON'")
    for row, entries in given.rows():
        slave, master = [*map(key, entries), "", ""][:2]
        if "" not in reading.analysis.interactions or not slave or not master or slave == master:
            raise given.refused(f"has {slave}:{master}; expected two named surfaces behind *CONTACT", row)
        reading.analysis.pairs.append(ContactPair(given.at(row), slave, master, "", 0.0, is_included=True))
    return "nodes of the first surface against facets of the second, with small sliding; overlaps are taken away"


@card("CONTACT PROPERTY ASSIGNMENT")
def contact_property_assignment(reading: Reading, given: Card) -> str:
    """*CONTACT PROPERTY ASSIGNMENT: the interaction of pairs of *CONTACT INCLUSIONS, of all or of one."""
    pairs = reading.analysis.pairs
    for row, entries in given.rows():
        one, two, name = [*map(key, entries), "", "", ""][:3]
        own = [
            k for k, pair in enumerate(pairs) if pair.is_included and {one, two} in ({""}, {pair.slave, pair.master})
        ]
        if not own or not name:
            raise given.refused(
                f"gives {name or 'nothing'} to {one}:{two}; expected a pair of *CONTACT INCLUSIONS", row
            )
        for k in own:
            pairs[k] = replace(pairs[k], interaction=name)
    return "contact properties of these pairs"


@card("CLEARANCE", "SLAVE", "MASTER", "VALUE", unused=("CPSET",))
def clearance(reading: Reading, given: Card) -> str:
    """*CLEARANCE: the distance of a pair, in place of that of the geometry."""
    slave, master = given.needed("SLAVE"), given.needed("MASTER")
    value = _length(given, "VALUE", "a distance")
    if value is None:
        raise given.refused("has no VALUE; expected a distance")
    pair = pair_named(reading, given, (slave, master))
    reading.analysis.pairs[reading.analysis.pairs.index(pair)] = replace(pair, clearance=value)
    return f"gap {value:g} of the pair {slave}:{master}"


@card("CHANGE SURFACE BEHAVIOR", "INTERACTION")
def change_surface_behavior(reading: Reading, given: Card) -> str:
    """*CHANGE SURFACE BEHAVIOR: the *SURFACE BEHAVIOR after it is that of an interaction from this step on."""
    name = given.needed("INTERACTION")
    if name not in reading.analysis.interactions or not reading.analysis.steps:
        known = ", ".join(reading.analysis.interactions) or "none"
        raise given.refused(f"names the interaction {name}; expected one of {known}, in a step")
    reading.analysis.changing, reading.analysis.steps[-1].is_softened = name, True
    return f"surfaces of {name} have another behavior"


@card("CONTACT INTERFERENCE", "SHRINK", "TYPE", "OP")
def contact_interference(reading: Reading, given: Card) -> str:
    """*CONTACT INTERFERENCE: how an overlap of the geometry is taken up within a step, at the end of which it is."""
    if given.name_of("TYPE") not in ("", "CONTACT PAIR"):
        raise given.refused(f"has TYPE={given.name_of('TYPE')}; expected contact pairs")
    for row, entries in given.rows():
        pair_named(reading, given, tuple(map(key, entries[:2])), row)
    return "overlaps are taken up in full at the end of the step, as they are without this card"


def pair_named(reading: Reading, given: Card, surfaces: tuple[str, ...], row: int | None = None) -> ContactPair:
    """Pair of contact of two surfaces, which was given before.

    Raises
    ------
    InvalidArgumentError
        There is none.
    """
    for pair in reading.analysis.pairs:
        if (pair.slave, pair.master) == surfaces:
            return pair
    known = ", ".join(f"{pair.slave}:{pair.master}" for pair in reading.analysis.pairs) or "none"
    raise given.refused(f"names the pair {':'.join(surfaces)}; expected one that was given before: {known}", row)


@card(
    *("TIE", "NAME", "ADJUST", "POSITION TOLERANCE", *_OTHER_TIES),
    unused=("TYPE", "NO ROTATION", "NO THICKNESS"),
)
def tie(reading: Reading, given: Card) -> str:
    """*TIE: two surfaces that are joined."""
    other = next((name for name in _OTHER_TIES if name in given.options), None)
    if other is not None:
        raise given.refused(f"has {other}; expected surfaces that are joined")
    tolerance = _length(given, "POSITION TOLERANCE", "a distance")
    adjusted = given.name_of("ADJUST") != "NO"
    for row, entries in given.rows():
        slave, master = _two(given, row, entries)
        reading.analysis.ties.append(Tie(given.at(row), given.name_of("NAME"), slave, master, tolerance, adjusted))
    return "nodes of the first surface move with the second"


def _length(given: Card, option: str, expected: str) -> float | None:
    """Number that an option gives, None without it."""
    text = given.options.get(option, "")
    if not text:
        return None
    try:
        return float(text)
    except ValueError:
        raise given.refused(f"has {option}={text}; expected {expected}") from None


def _two(given: Card, row: int, entries: list[str]) -> tuple[str, str]:
    """The two surfaces of a line."""
    names = [key(entry) for entry in entries if entry]
    if len(names) < 2:
        raise given.refused(f"names {', '.join(names) or 'nothing'}; expected two surfaces", row)
    return names[0], names[1]


def _interaction(reading: Reading, given: Card) -> Interaction:
    if reading.analysis.changing is None:
        raise given.refused("stands without *SURFACE INTERACTION before it; expected that")
    return reading.analysis.interactions[reading.analysis.changing]
