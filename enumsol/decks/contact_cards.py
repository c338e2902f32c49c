"""Cards of contacts and constraints: surfaces that touch or are joined, equations, couplings, rigid bodies, springs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from enumsol.decks.cards import key, target_of
from enumsol.decks.model import SYSTEMS, ContactPair, Coupling, Interaction, NodalEquation, Orientation, Spring
from enumsol.decks.registry import card
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.decks.cards import Card
    from enumsol.decks.registry import Reading

#: Kinds of contact that differ from a hard one by the stiffness of a penalty.
_SOFT = ("LINEAR", "EXPONENTIAL", "TABULAR")
#: Laws of friction other than Coulomb's with one coefficient.
_OTHER_LAWS = dict.fromkeys(
    ("ROUGH", "USER", "EXPONENTIAL DECAY", "TAUMAX", "ANISOTROPIC", "DEPENDENCIES", "SHEAR TRACTION SLOPE"),
    "Coulomb's law with one coefficient",
)
#: Ties that are none of two surfaces.
_OTHER_TIES = dict.fromkeys(("CYCLIC SYMMETRY", "MULTISTAGE", "FLUID PERIODIC"), "surfaces that are joined")


@card("SURFACE INTERACTION", "NAME", unused=("PAD THICKNESS",), refuses={"USER": "friction and hard contact"})
def surface_interaction(reading: Reading, given: Card) -> str:
    """*SURFACE INTERACTION: the cards after it say what it is."""
    name = given.needed("NAME")
    if name in reading.deck.interactions:
        raise given.refused(f"gives {name} again; expected each name once")
    reading.deck.interactions[name] = Interaction(given.place)
    reading.changing = name
    return f"contact properties {name}, without friction unless a card says so"


@card(
    *("SURFACE BEHAVIOR", "PRESSURE-OVERCLOSURE"),
    unused=("PENALTY", "DIRECT", "AUGMENTED LAGRANGE"),
    refuses={"NO SEPARATION": "surfaces that may part"},
)
def surface_behavior(reading: Reading, given: Card) -> str:
    """*SURFACE BEHAVIOR: contact is hard, or what touches stays joined."""
    own, later = _interaction(reading, given), bool(reading.deck.steps)
    if later and not reading.deck.steps[-1].is_softened:
        raise given.refused("stands in a step without *CHANGE SURFACE BEHAVIOR before it; expected that")
    kind = given.name_of("PRESSURE-OVERCLOSURE") or "HARD"
    if kind == "TIED" and not later:
        own.tied = True
        return "surfaces that stay joined"
    if kind == "HARD":
        return "hard contact"
    if kind in _SOFT:
        return f"hard contact: the stiffness of the {kind.lower()} law is not used, and nothing penetrates"
    raise given.refused(f"has PRESSURE-OVERCLOSURE={kind}; expected HARD, {', '.join(_SOFT)} or TIED")


@card("FRICTION", unused=("SLIP TOLERANCE", "ELASTIC SLIP", "LAGRANGE"), refuses=_OTHER_LAWS)
def friction(reading: Reading, given: Card) -> str:
    """*FRICTION: the coefficient; a stiffness of sticking is not used, since what sticks does not move."""
    own = _interaction(reading, given)
    found = [(row, entries) for row, entries in given.rows() if entries]
    if len(found) != 1:
        raise given.refused(f"has {len(found)} lines of data; expected one coefficient")
    row, entries = found[0]
    value = given.number(entries[0], row)
    if value < 0:
        raise given.refused(f"has the coefficient {value:g}; expected it >= 0", row)
    if not reading.deck.steps:
        own.friction = value
    elif reading.changing in reading.deck.steps[-1].friction:
        reading.deck.steps[-1].friction[reading.changing] = value
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
    if reading.deck.steps:
        raise given.refused("stands in a step; expected contacts before the first *STEP")
    chosen = given.name_of("ADJUST")
    distance: float | str | None = chosen
    if not chosen[:1].isalpha():
        distance = _length(given, "ADJUST", "the distance up to which nodes are moved, or the set of these nodes")
    name = given.name_of("INTERACTION")
    for row, entries in given.rows():
        slave, master = _two(given, row, entries)
        reading.deck.pairs.append(
            ContactPair(given.at(row), slave, master, name, distance, tied="TIED" in given.options)
        )
    said = ["nodes of the first surface against facets of the second, with small sliding"]
    if distance is not None:
        said.append(f"gaps {f'of {distance}' if isinstance(distance, str) else f'up to {distance:g}'} are closed")
    return "; ".join(said)


@card("CONTACT", unused=("OP",))
def contact(reading: Reading, given: Card) -> str:
    """*CONTACT: the cards after it name the surfaces that may touch; without friction unless one says so."""
    if reading.deck.steps:
        raise given.refused("stands in a step; expected contacts before the first *STEP")
    reading.deck.interactions.setdefault("", Interaction(given.place))
    return "contacts of the pairs that cards after it name"


@card("CONTACT INCLUSIONS", "ALL EXTERIOR")
def contact_inclusions(reading: Reading, given: Card) -> str:
    """*CONTACT INCLUSIONS: pairs of surfaces; overlaps of the geometry are taken away first, as Abaqus does."""
    if "ALL EXTERIOR" in given.options or not given.data:
        raise given.refused("has ALL EXTERIOR; expected the surfaces that may touch, two in a line, as in 'UNDER, ON'")
    for row, entries in given.rows():
        slave, master = [*map(key, entries), "", ""][:2]
        if "" not in reading.deck.interactions or not slave or not master or slave == master:
            raise given.refused(f"has {slave}:{master}; expected two named surfaces behind *CONTACT", row)
        reading.deck.pairs.append(ContactPair(given.at(row), slave, master, "", 0.0, is_included=True))
    return "nodes of the first surface against facets of the second, with small sliding; overlaps are taken away"


@card("CONTACT PROPERTY ASSIGNMENT")
def contact_property_assignment(reading: Reading, given: Card) -> str:
    """*CONTACT PROPERTY ASSIGNMENT: the interaction of pairs of *CONTACT INCLUSIONS, of all or of one."""
    pairs = reading.deck.pairs
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
    reading.deck.pairs[reading.deck.pairs.index(pair)] = replace(pair, clearance=value)
    return f"gap {value:g} of the pair {slave}:{master}"


@card("CHANGE SURFACE BEHAVIOR", "INTERACTION")
def change_surface_behavior(reading: Reading, given: Card) -> str:
    """*CHANGE SURFACE BEHAVIOR: the *SURFACE BEHAVIOR after it is that of an interaction from this step on."""
    name = given.needed("INTERACTION")
    if name not in reading.deck.interactions or not reading.deck.steps:
        known = ", ".join(reading.deck.interactions) or "none"
        raise given.refused(f"names the interaction {name}; expected one of {known}, in a step")
    reading.changing, reading.deck.steps[-1].is_softened = name, True
    return f"surfaces of {name} have another behavior"


@card("CONTACT INTERFERENCE", "SHRINK", "TYPE", "OP")
def contact_interference(reading: Reading, given: Card) -> str:
    """*CONTACT INTERFERENCE: how an overlap of the geometry is taken up within a step, at the end of which it is."""
    given.choice("TYPE", ("", "CONTACT PAIR"), "contact pairs")
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
    for pair in reading.deck.pairs:
        if (pair.slave, pair.master) == surfaces:
            return pair
    known = ", ".join(f"{pair.slave}:{pair.master}" for pair in reading.deck.pairs) or "none"
    raise given.refused(f"names the pair {':'.join(surfaces)}; expected one that was given before: {known}", row)


@card(
    *("TIE", "NAME", "ADJUST", "POSITION TOLERANCE"),
    unused=("TYPE", "NO ROTATION", "NO THICKNESS"),
    refuses=_OTHER_TIES,
)
def tie(reading: Reading, given: Card) -> str:
    """*TIE: two surfaces that are joined."""
    tolerance = _length(given, "POSITION TOLERANCE", "a distance")
    for row, entries in given.rows():
        slave, master = _two(given, row, entries)
        reading.deck.ties.append(ContactPair(given.at(row), slave, master, "", tolerance, tied=True))
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
    if reading.changing is None:
        raise given.refused("stands without *SURFACE INTERACTION before it; expected that")
    return reading.deck.interactions[reading.changing]


# -- constraint cards --------------------------------------------------------------------------------------------------
# Cards of constraints: equations, couplings, rigid bodies, springs, and directions of components.


@card("EQUATION")
def equation(reading: Reading, given: Card) -> str:
    """*EQUATION: the number of terms, then a node, a component and a coefficient of each, several in a line."""
    rows, count, at = [*given.rows()], 0, 0
    while at < len(rows):
        row, entries = rows[at]
        wanted = given.integer(entries[0] if entries else "", row)
        terms: list[tuple[str, int, float]] = []
        at += 1
        while len(terms) < wanted:
            if at == len(rows):
                raise given.refused(f"has {len(terms)} of {wanted} terms; expected all of them", row)
            line, own = rows[at]
            if not own or len(own) % 3:
                raise given.refused(f"has {len(own)} entries in a line; expected 3 for each term", line)
            for node, component, coefficient in zip(own[::3], own[1::3], own[2::3], strict=True):
                terms.append((target_of(node), given.integer(component, line), given.number(coefficient, line)))
            at += 1
        if len(terms) != wanted or wanted < 1:
            raise given.refused(f"has {len(terms)} terms; expected {wanted}", row)
        reading.deck.equations.append(NodalEquation(given.at(row), tuple(terms)))
        count += 1
    return counted(count, "linear equation")


@card("MPC")
def mpc(reading: Reading, given: Card) -> str:
    """*MPC: those of Abaqus that say that nodes move together; others need large displacements."""
    for row, entries in given.rows():
        kind = key(entries[0]) if entries else ""
        if kind not in ("TIE", "PIN", "BEAM") or len(entries) != 3:
            raise given.refused(f"is of type {kind}; expected TIE, PIN or BEAM with two nodes, or *EQUATION", row)
        one, two = map(target_of, entries[1:])
        place = given.at(row)
        if kind == "BEAM":
            reading.deck.couplings.append(Coupling(place, given.name, one, two))
        else:
            reading.deck.equations += [
                NodalEquation(place, ((one, k, 1.0), (two, k, -1.0)), given.name) for k in (1, 2, 3)
            ]
    return "nodes that move together"


@card("RIGID BODY", "NSET", "ELSET", "TIE NSET", "PIN NSET", "REF NODE", "ROT NODE", "ANALYTICAL SURFACE")
def rigid_body(reading: Reading, given: Card) -> str:
    """*RIGID BODY: nodes or elements that move as one."""
    kinds = ("NSET", "ELSET", "TIE NSET", "PIN NSET", "ANALYTICAL SURFACE")
    target = next((name for option in kinds if (name := given.name_of(option))), "")
    if not target:
        raise given.refused("has no NSET, ELSET or ANALYTICAL SURFACE; expected one")
    reference = given.needed("REF NODE")
    rotation = given.name_of("ROT NODE") or None
    reading.region.couplings.append(Coupling(given.place, given.name, target, reference, rotation))
    return f"{target} moves as a rigid body with node {reference}"


@card(
    *("COUPLING", "CONSTRAINT NAME", "REF NODE", "SURFACE"),
    refuses={"ORIENTATION": "components along the axes"},
)
def coupling(reading: Reading, given: Card) -> str:
    """*COUPLING: the card after it says in which way."""
    reading.coupling = Coupling(given.place, given.name, given.needed("SURFACE"), given.needed("REF NODE"))
    return f"{reading.coupling.target} is coupled to node {reading.coupling.reference}"


@card("KINEMATIC")
@card("DISTRIBUTING", "WEIGHTING METHOD", unused=("COUPLING",))
def kinematic(reading: Reading, given: Card) -> str:
    """*KINEMATIC and *DISTRIBUTING: whether a surface moves with the reference node, or the node with its mean."""
    own = reading.coupling
    if own is None:
        raise given.refused("stands without *COUPLING before it; expected that")
    given.choice("WEIGHTING METHOD", ("", "UNIFORM"), "UNIFORM")
    found = [k for row, entries in given.rows() for k in given.components(row, entries[:2])]
    kind: Literal["kinematic", "distributing"] = "kinematic" if given.name == "KINEMATIC" else "distributing"
    every = tuple(dict.fromkeys(found)) or (1, 2, 3, 4, 5, 6)
    reading.deck.couplings.append(Coupling(own.place, own.card, own.target, own.reference, None, kind, every))
    reading.coupling = None
    return f"components {', '.join(map(str, every))}"


@card("SPRING", "ELSET", "NONLINEAR", "DEPENDENCIES", "ORIENTATION")
def spring(reading: Reading, given: Card) -> str:
    """*SPRING: the stiffness of spring elements."""
    elements, rows = given.needed("ELSET"), [*given.rows()]
    if given.options.keys() & {"NONLINEAR", "DEPENDENCIES", "ORIENTATION"}:
        raise given.refused("has NONLINEAR, DEPENDENCIES or ORIENTATION; expected one stiffness")
    if not 1 <= len(rows) <= 2:
        raise given.refused(f"has {len(rows)} lines of data; expected components of nodes, then a stiffness")
    first = rows[0][1] if len(rows) == 2 else []
    components = tuple(given.integer(entry, rows[0][0]) for entry in first if entry)
    row, entries = rows[-1]
    value = given.number(entries[0] if entries else "", row)
    if value < 0:
        raise given.refused(f"has the stiffness {value:g}; expected it >= 0", row)
    reading.deck.springs.append(Spring(given.place, elements, value, components))
    return f"springs of stiffness {value:g}"


@card("TRANSFORM", "NSET", "TYPE")
def transform(reading: Reading, given: Card) -> str:
    """*TRANSFORM: components of nodes along directions of their own."""
    system = SYSTEMS[given.choice("TYPE", ("", "R", "C"), "R or C")]
    if len(given.data) != 1:
        raise given.refused(f"has {len(given.data)} lines of data; expected six numbers")
    points = np.reshape(given.numbers(0, 6, 6), (2, 3))
    nodes = given.needed("NSET")
    reading.deck.transforms.append(Orientation(system, points, np.zeros(3), None, given.place, nodes))
    return f"components of {nodes} are {'cylindrical' if system == 'CYLINDRICAL' else 'along axes of their own'}"
