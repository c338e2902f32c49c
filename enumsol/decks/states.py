"""Loads, displacements and temperatures at the end of each step of a deck: its cards put into effect.

Displacements, loads and temperatures of a step stay in later ones (OP=MOD) unless a card of their kind begins anew
(OP=NEW) or gives them again. Within a step concentrated forces on one node add up, as the programs have it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from enumsol.decks.model import FIELDS, by_block

if TYPE_CHECKING:
    from enumsol.decks.cards import DeckPlace
    from enumsol.decks.model import Act, Deck, DeckStep
    from enumsol.support.array_types import Integers

#: What a value is given to: the card's kind, the number of a node or an element, and a component, a face or a label.
Key = tuple[str, int | str, int | str]

#: Length of a direction may differ from one by this, by rounding of its components in the deck.
_ROUNDED = 1e-3
#: What else than before a field may be given to a set.
_OTHER_FIELDS = {"GRAV": "gravity in another direction", "CENTRIF": "CENTRIF about another axis"}


@dataclass
class DeckState:
    """State at the end of a step: what is given then.

    Attributes
    ----------
    values : dict of Key to float
        Displacements ("BOUNDARY", node, component), forces ("CLOAD", node, component), loads on elements ("DLOAD",
        element, label), fields ("GRAV", set, direction) or ("CENTRIF", set, axis), and temperatures ("TEMPERATURE",
        node, 0).
    places : dict of Key to DeckPlace
        The line that gave each.
    """

    values: dict[Key, float] = field(default_factory=dict)
    places: dict[Key, DeckPlace] = field(default_factory=dict)

    def of(self, kind: str) -> dict[tuple[int | str, int | str], float]:
        """The values of one kind, by node or element and what is given to it."""
        return {(of, what): value for (own, of, what), value in self.values.items() if own == kind}


def states_of(deck: Deck) -> list[DeckState]:
    """The state at the end of every step.

    Raises
    ------
    InvalidArgumentError
        A line contradicts another one of its step, or names what is not in the deck.
    """
    acting, time = _Acting(deck), 0.0
    acting.take(deck.initial, time)
    states = []
    for step in deck.steps:
        time += step.period
        acting.take(step, time)
        states.append(acting.state())
    return states


class _Acting:
    """Terms (reference value, amplitude) of every key, step by step."""

    def __init__(self, deck: Deck) -> None:
        self._deck, self._amplitudes = deck, deck.amplitudes
        self._terms: dict[Key, list[tuple[float, str | None]]] = {}
        self._places: dict[Key, DeckPlace] = {}
        self._cards: dict[Key, str] = {}
        self._period, self._time = 0.0, 0.0

    def take(self, step: DeckStep, time: float) -> None:
        """Put the cards of a step into effect, which ends at this time."""
        # what has ended keeps its last value, but for amplitudes over the time of all steps
        for key, terms in self._terms.items():
            self._terms[key] = [term if self._lasts(term[1]) else (self._value(term), None) for term in terms]
        self._period, self._time = step.period, time
        self._begin_anew(step)
        given: dict[Key, DeckPlace] = {}
        for act in step.acts:
            if act.amplitude is not None:
                said = f"*{act.card} names the amplitude {act.amplitude}"
                act.place.entry(self._amplitudes, act.amplitude, said)
            for key, reference in _given_to(self._deck, act):
                self._give(key, (reference, act.amplitude), act, given)

    def _begin_anew(self, step: DeckStep) -> None:
        """Take away what cards with OP=NEW replace."""
        loads = {"DLOAD", "DSLOAD"}
        for key, card in list(self._cards.items()):
            if card in step.fresh:
                del self._terms[key], self._places[key], self._cards[key]
            elif card in loads and step.fresh & loads:
                raise step.place.refused(
                    f"*{min(step.fresh & loads)} with OP=NEW follows loads by *{card}, which programs keep or take "
                    "away; expected OP=NEW of both cards, or of none"
                )

    def _give(self, key: Key, term: tuple[float, str | None], act: Act, given: dict[Key, DeckPlace]) -> None:
        if key in given and key[0] == "CLOAD":
            self._terms[key].append(term)
            return
        if key in given and key[0] in ("BOUNDARY", "DLOAD", *FIELDS) and self._terms[key] != [term]:
            raise act.place.refused(
                f"*{act.card} gives {self._named(key)} the value {term[0]:g}, and {given[key]} gives it "
                f"{self._terms[key][0][0]:g} in the same step; expected one value"
            )
        others = (own for own in self._terms if own[:2] == key[:2] and own != key and own not in given)
        if key[0] in FIELDS and (before := next(others, None)) is not None:
            raise act.place.refused(
                f"*DLOAD gives {key[1]} {_OTHER_FIELDS[key[0]]} than {self._places[before]}, to which programs add it "
                "or not; expected OP=NEW"
            )
        self._terms[key], self._places[key], given[key] = [term], act.place, act.place
        self._cards[key] = act.card

    def _lasts(self, amplitude: str | None) -> bool:
        return amplitude is not None and self._amplitudes[amplitude].total

    def _value(self, term: tuple[float, str | None]) -> float:
        reference, name = term
        if name is None:
            return reference
        amplitude = self._amplitudes[name]
        return reference * amplitude.at(self._time if amplitude.total else self._period)

    def state(self) -> DeckState:
        values = {key: sum(map(self._value, terms)) for key, terms in self._terms.items()}
        return DeckState(values, dict(self._places))

    def _named(self, key: Key) -> str:
        kind, of, what = key
        if kind in ("BOUNDARY", "CLOAD"):
            return f"component {what} of node {self._deck.node_name(int(of))}"
        return f"{kind} of {of}" if kind in FIELDS else f"{what} of element {self._deck.element_name(int(of))}"


def _given_to(deck: Deck, act: Act) -> list[tuple[Key, float]]:
    """Keys that an act gives values to, with reference values."""
    if act.card in ("BOUNDARY", "CLOAD"):
        rows = deck.nodes_of(act.target, act.place).tolist()
        return [((act.card, row, component), act.values[0]) for row in rows for component in act.components]
    if act.card in ("TEMPERATURE", "INITIAL CONDITIONS"):
        rows = deck.nodes_of(act.target, act.place).tolist()
        return [((act.card, row, 0), act.values[0]) for row in rows]
    if act.label in FIELDS:
        length = float(np.linalg.norm(act.values[-3:]))
        if abs(length - 1.0) > _ROUNDED:
            raise act.place.refused(
                f"*DLOAD has {act.label} with a direction of length {length:g}, which programs read differently; "
                "expected length one"
            )
        return [((act.label, act.target, " ".join(map(repr, act.values[1:]))), act.values[0])]
    if act.card == "DSLOAD":
        if act.target not in deck.surfaces or deck.surfaces[act.target].nodes is not None:
            raise act.place.refused(f"there is no surface of faces {act.target}; expected *SURFACE")
        faces = deck.surfaces[act.target].faces.tolist()
        return [(("DLOAD", element, f"P{face + 1}"), act.values[0]) for element, face in faces]
    rows = deck.elements_of(act.target, act.place)
    if act.label[:1] == "P":
        _check_face(deck, rows, act)
    return [(("DLOAD", row, act.label), act.values[0]) for row in rows.tolist()]


def _check_face(deck: Deck, rows: Integers, act: Act) -> None:
    """Refuse loads on faces that elements do not have."""
    for first, block, own in by_block(deck.blocks, rows):
        faces = len(block.type.shape.faces)
        if not 1 <= int(act.label[1:]) <= faces:
            has = f"has {faces} faces; expected one of these" if faces else "is no body; expected elements of bodies"
            raise act.place.refused(
                f"*DLOAD loads {act.label} of element {deck.element_name(first + int(own[0]))} of type "
                f"{block.type.name}, which {has}"
            )
