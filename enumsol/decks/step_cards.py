"""Cards of steps: what is held, moved, loaded and heated, and how that goes on over time."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from enumsol.decks.cards import key, target_of
from enumsol.decks.contact_cards import pair_named
from enumsol.decks.model import FIELDS, Act, Amplitude, DeckStep
from enumsol.decks.registry import card, compact, harmless, refused

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.decks.cards import Card
    from enumsol.decks.registry import Reading

#: Names of supports, and the components that they hold.
SUPPORTS = {
    "ENCASTRE": (1, 2, 3, 4, 5, 6),
    "PINNED": (1, 2, 3),
    "XSYMM": (1, 5, 6),
    "YSYMM": (2, 4, 6),
    "ZSYMM": (3, 4, 5),
    "XASYMM": (2, 3, 4),
    "YASYMM": (1, 3, 5),
    "ZASYMM": (1, 2, 6),
}
#: Loads that are forces per volume along an axis.
VOLUME = ("BX", "BY", "BZ")
#: Options of cards of loads and displacements that make them something else.
_OTHER = dict.fromkeys(
    ("SUBMODEL", "USER", "MASS FLOW", "BASE NAME", "FIXED", "SECTOR", "FILE", "BSTEP", "TIME DELAY", "LOAD CASE"),
    "values in the card itself",
)
#: Cards of other analyses than static ones.
_ANALYSES = (
    "FREQUENCY", "COMPLEX FREQUENCY", "BUCKLE", "DYNAMIC", "MODAL DYNAMIC", "STEADY STATE DYNAMICS", "HEAT TRANSFER",
    "COUPLED TEMPERATURE-DISPLACEMENT", "UNCOUPLED TEMPERATURE-DISPLACEMENT", "VISCO", "SENSITIVITY", "GREEN",
    "ELECTROMAGNETICS", "CRACK PROPAGATION", "CFD", "SUBSTRUCTURE GENERATE", "RESPONSE SPECTRUM", "RANDOM RESPONSE",
)  # fmt: skip
#: What each kind of act is.
_WORDS = {"BOUNDARY": "displacements", "CLOAD": "forces", "DLOAD": "loads", "TEMPERATURE": "temperatures"}


harmless("all equilibria at the end of a step are found, without increments", *(
    "CONTROLS", "CONTACT CONTROLS", "SOLVER CONTROLS", "TIME POINTS", "NO ANALYSIS", "ANALYSIS CONTROLS",
    "CONTACT STABILIZATION", "WAVEFRONT MINIMIZATION", "CONSTRAINT CONTROLS",
))  # fmt: skip
harmless("it asks for output", "FILTER")
harmless("the analysis is static", "DAMPING", "GLOBAL DAMPING", "MODAL DAMPING", "CONTACT DAMPING", "DASHPOT")
harmless("it is of reduced integration, in place of which elements are integrated in full", "SECTION CONTROLS")
refused("is another analysis than *STATIC", "to leave out its step as a whole", *_ANALYSES)
harmless("no heat is conducted", *(
    "CONDUCTIVITY", "SPECIFIC HEAT", "LATENT HEAT", "PHYSICAL CONSTANTS", "GAP CONDUCTANCE", "GAP HEAT GENERATION",
))  # fmt: skip


@card(
    *("STEP", "NAME", "NLGEOM", "PERTURBATION"),
    unused=("INC", "AMPLITUDE", "UNSYMM", "SOLVER", "CONVERT SDI", "EXTRAPOLATION"),
)
def step(reading: Reading, given: Card) -> str:
    """*STEP: what follows belongs to a new step."""
    if reading.deck.steps and not reading.deck.steps[-1].ended:
        raise given.refused("begins before the step before it has ended; expected *END STEP")
    large = "NLGEOM" in given.options and given.name_of("NLGEOM") != "NO"
    if large and "NLGEOM" not in reading.ignore:
        raise given.refused(
            'has NLGEOM, large displacements; expected small ones, or --ignore NLGEOM (in Python ignore=["NLGEOM"]) to '
            "take all displacements as small"
        )
    reading.deck.steps.append(DeckStep(given.place, about_a_state="PERTURBATION" in given.options))
    return f"step {len(reading.deck.steps)}" + ("; NLGEOM is ignored: displacements are small" if large else "")


@card("END STEP")
def end_step(reading: Reading, given: Card) -> str | None:
    """*END STEP: what the step lacks is refused; a step of an analysis that is left out is left out."""
    own = _step(reading, given)
    if own.analysis:
        own.ended = True
        return None
    if not {compact(name) for name in _ANALYSES} & set(reading.ignore):
        raise given.refused(f"ends step {len(reading.deck.steps)}, which has no *STATIC; expected a static step")
    reading.deck.steps.pop()
    return f"the step that begins in line {own.place.line} is left out as a whole, as you say"


@card("STATIC", unused=("SOLVER", "DIRECT", "EXPLICIT", "STABILIZE", "FACTOR", "ALLSDTOL", "CONTINUE"))
def static(reading: Reading, given: Card) -> str:
    """*STATIC: its time counts for amplitudes."""
    own = _step(reading, given)
    if own.about_a_state:
        raise given.refused("stands in a step with PERTURBATION, small changes about a state; expected a step without")
    own.analysis = given.name
    for row, entries in given.rows():
        if row == 0 and len(entries) > 1:
            own.period = given.number(entries[1], row) or 1.0
        if own.period < 0:
            raise given.refused(f"has the time {own.period:g}; expected a time > 0", row)
    return f"a static step of time {own.period:g}; increments are not used, as all equilibria at its end are sought"


@card("MODEL CHANGE", "TYPE", "ADD", "REMOVE")
def model_change(reading: Reading, given: Card) -> str:
    """*MODEL CHANGE: pairs that are in contact no more, or again, from this step on."""
    own = _step(reading, given)
    if given.name_of("TYPE") != "CONTACT PAIR" or ("ADD" in given.options) == ("REMOVE" in given.options):
        raise given.refused("changes other things than contacts; expected TYPE=CONTACT PAIR with either ADD or REMOVE")
    word = "again" if "ADD" in given.options else "no more"
    for row, entries in given.rows():
        pair = pair_named(reading, given, tuple(map(key, entries[:2])), row)
        own.contacts[pair.slave, pair.master] = word == "again"
    return f"in contact {word}: {_some(':'.join(pair) for pair in own.contacts)}"


@card("BOUNDARY", "OP", "AMPLITUDE", "TYPE", refuses=_OTHER)
def boundary(reading: Reading, given: Card) -> str:
    """*BOUNDARY: components of nodes that are held or moved."""
    given.choice("TYPE", ("", "DISPLACEMENT"), "displacements")
    acts = []
    for row, entries in given.rows():
        label = key(entries[1]) if len(entries) > 1 else ""
        value = 0.0
        if label in SUPPORTS:
            what = SUPPORTS[label]
        else:
            what = given.components(row, entries[1:3])
            value = given.number(entries[3], row) if len(entries) > 3 else 0.0
        acts.append(_act(given, row, entries, "", what, (value,)))
    return _given(reading, given, "BOUNDARY", acts)


@card("CLOAD", "OP", "AMPLITUDE", "FOLLOWER", refuses=_OTHER)
def cload(reading: Reading, given: Card) -> str:
    """*CLOAD: forces on nodes, and moments on reference nodes."""
    _without_following(given)
    acts = []
    for row, entries in given.rows():
        component = given.components(row, entries[1:2])
        acts.append(_act(given, row, entries, "", component, (_last(given, row, entries, 2),)))
    return _given(reading, given, "CLOAD", acts)


@card("DLOAD", "OP", "AMPLITUDE", "FOLLOWER", unused=("CONSTANT RESULTANT",), refuses=_OTHER)
@card("DSLOAD", "OP", "AMPLITUDE", "FOLLOWER", unused=("CONSTANT RESULTANT",), refuses=_OTHER)
def dload(reading: Reading, given: Card) -> str:
    """*DLOAD and *DSLOAD: pressures on faces of elements or on surfaces, forces per volume, gravity and rotation."""
    _without_following(given)
    acts = []
    for row, entries in given.rows():
        label = key(entries[1]) if len(entries) > 1 else ""
        of_face = label[:1] == "P" and (label[1:].isdigit() if given.name == "DLOAD" else label == "P")
        if label in FIELDS and given.name == "DLOAD":
            count = FIELDS[label]
            values = tuple(given.number(entry, row) for entry in (*entries[2:], *[""] * count)[:count])
            if not any(values[-3:]):
                size = "an acceleration" if label == "GRAV" else "the speed squared, a point on the axis"
                raise given.refused(f"has {label} without a direction; expected {size} and three numbers", row)
        elif of_face or (label in VOLUME and given.name == "DLOAD"):
            values = (_last(given, row, entries, 2),)
        else:
            expected = "P1, P2, ..., GRAV, CENTRIF, BX, BY or BZ" if given.name == "DLOAD" else "P, a pressure"
            raise given.refused(f"has the load {label or 'without a label'}; expected {expected}", row)
        acts.append(_act(given, row, entries, label, (), values))
    return _given(reading, given, "DLOAD", acts)


@card("TEMPERATURE", "OP", "AMPLITUDE", refuses=_OTHER)
def temperature(reading: Reading, given: Card) -> str:
    """*TEMPERATURE: temperatures of nodes at the end of the step."""
    acts = [_act(given, row, entries, "", (), (_last(given, row, entries, 1),)) for row, entries in given.rows()]
    return _given(reading, given, "TEMPERATURE", acts)


@card("INITIAL CONDITIONS", "TYPE", refuses=_OTHER)
def initial_conditions(reading: Reading, given: Card) -> str:
    """*INITIAL CONDITIONS: temperatures at which nothing is strained."""
    given.needed("TYPE")
    given.choice("TYPE", ("TEMPERATURE",), "TEMPERATURE")
    if reading.deck.steps:
        raise given.refused("stands behind a *STEP; expected it before the first one")
    reading.deck.initial.acts += [
        _act(given, row, entries, "", (), (_last(given, row, entries, 1),)) for row, entries in given.rows()
    ]
    return "temperatures at which nothing is strained"


@card("AMPLITUDE", "NAME", "TIME", "VALUE", "DEFINITION", "USER", "SHIFTX", "SHIFTY", unused=("SMOOTH",))
def amplitude(reading: Reading, given: Card) -> str:
    """*AMPLITUDE: factors over time, of which the one at the end of a step counts."""
    name = given.needed("NAME")
    kind = given.name_of("DEFINITION").replace(" ", "")
    if kind not in ("", "TABULAR", "SMOOTHSTEP") or given.name_of("VALUE") not in ("", "RELATIVE"):
        raise given.refused("is no table of factors; expected DEFINITION=TABULAR or SMOOTH STEP, and VALUE=RELATIVE")
    if given.options.keys() & {"USER", "SHIFTX", "SHIFTY"}:
        raise given.refused("has USER, SHIFTX or SHIFTY; expected a plain table of times and factors")
    numbers = [given.number(entry, row) for row, entries in given.rows() for entry in entries]
    times, factors = numbers[::2], numbers[1::2]
    if len(times) != len(factors) or not times or any(b < a for a, b in pairwise(times)):
        raise given.refused("has no pairs of rising times and factors; expected time, factor, time, factor, ...")
    total = given.name_of("TIME").replace(" ", "") == "TOTALTIME"
    reading.deck.amplitudes[name] = Amplitude(tuple(times), tuple(factors), total, kind == "SMOOTHSTEP")
    return f"factors of {'all steps' if total else 'a step'} up to time {times[-1]:g}, where it is {factors[-1]:g}"


@card("CHANGE FRICTION", "INTERACTION")
def change_friction(reading: Reading, given: Card) -> str:
    """*CHANGE FRICTION: the *FRICTION after it is that of an interaction from this step on."""
    name = given.needed("INTERACTION")
    own = _step(reading, given)
    known = given.place.entry(reading.deck.interactions, name, f"*{given.name} names the interaction {name}")
    own.friction[name] = known.friction
    reading.changing = name
    return f"friction of {name} changes in step {len(reading.deck.steps)}"


def _act(
    given: Card, row: int, entries: list[str], label: str, components: tuple[int, ...], values: tuple[float, ...]
) -> Act:
    """Act of one line."""
    named = entries[0] if entries else ""
    if not named and label not in FIELDS:  # which acts on all elements then
        raise given.refused("has a line without a node, an element or a set; expected one of them", row)
    return Act(
        given.name, given.at(row), target_of(named), label, components, values, given.name_of("AMPLITUDE") or None
    )


def _last(given: Card, row: int, entries: list[str], place: int) -> float:
    """The value that a line has at a place, which must be there."""
    if len(entries) <= place:
        raise given.refused(f"has {len(entries)} entries in a line; expected {place + 1}", row)
    return given.number(entries[place], row)


def _without_following(given: Card) -> None:
    if "FOLLOWER" in given.options and given.name_of("FOLLOWER") != "NO":
        raise given.refused("has FOLLOWER; expected loads that keep their direction")


def _step(reading: Reading, given: Card) -> DeckStep:
    """The step that a card is in."""
    if not reading.deck.steps or reading.deck.steps[-1].ended:
        raise given.refused("stands outside of steps; expected it between *STEP and *END STEP")
    return reading.deck.steps[-1]


def _given(reading: Reading, given: Card, kind: str, acts: list[Act]) -> str:
    """Add what a card gives to its step, or displacements to the model before the first one."""
    own = reading.deck.initial if not reading.deck.steps and kind == "BOUNDARY" else _step(reading, given)
    anew = given.name_of("OP") == "NEW" and all(act.card != given.name for act in own.acts)  # the first one counts
    if anew:
        own.fresh.add(given.name)
    own.acts.extend(acts)
    return f"{_WORDS[kind]} of {_some(act.target for act in acts)}" + (", in place of all before" if anew else "")


def _some(names: Iterator[str]) -> str:
    every = [name or "all elements" for name in dict.fromkeys(names)]
    return ", ".join(every[:3]) + (f" and {len(every) - 3} more" if len(every) > 3 else "") or "nothing"
