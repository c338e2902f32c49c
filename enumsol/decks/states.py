"""Loads, displacements and temperatures at the end of each step of a deck: its cards put into effect.

Displacements, loads and temperatures of a step stay in later ones (OP=MOD) unless a card of their kind begins anew
(OP=NEW) or gives them again. Within a step concentrated forces on one node add up, as the programs have it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from enumsol.decks.cards import ROUNDED
from enumsol.decks.model import FIELDS, by_block

if TYPE_CHECKING:
    from enumsol.decks.cards import DeckPlace
    from enumsol.decks.model import Act, Deck, DeckStep
    from enumsol.support.array_types import Integers

#: What a value is given to: the card's kind, the number of a node or an element, and a component, a face or a label.
Key = tuple[str, int | str, int | str]

#: What else than before a field may be given to a set.
_OTHER_FIELDS = {"GRAV": "gravity in another direction", "CENTRIF": "CENTRIF about another axis"}


@dataclass(frozen=True, eq=False)
class DeckState:
    """State at the end of a step, or before the first one: what is given then.

    Attributes
    ----------
    deck : Deck
    period, time : float
        Of the step, and from the beginning of the first one to its end.
    terms : dict of Key to list of (float, Act)
        Reference values of everything that is given, each with the line that gave it.
    """

    deck: Deck
    period: float = 0.0
    time: float = 0.0
    terms: dict[Key, list[tuple[float, Act]]] = field(default_factory=dict)

    @cached_property
    def values(self) -> dict[Key, float]:
        """Values of everything that is given.

        Displacements ("BOUNDARY", node, component), forces ("CLOAD", node, component), loads on elements ("DLOAD",
        element, label), fields ("GRAV", set, direction) or ("CENTRIF", set, axis), and temperatures ("TEMPERATURE",
        node, 0) or ("INITIAL CONDITIONS", node, 0).
        """
        return {key: sum(self._value(*term) for term in terms) for key, terms in self.terms.items()}

    def of(self, kind: str) -> dict[tuple[int | str, int | str], float]:
        """The values of one kind, by node or element and what is given to it."""
        return {(of, what): value for (own, of, what), value in self.values.items() if own == kind}

    def place(self, key: Key) -> DeckPlace:
        """The line that gave a value."""
        return self.terms[key][0][1].place

    def after(self, step: DeckStep) -> DeckState:
        """State at the end of the step that follows.

        Raises
        ------
        InvalidArgumentError
            A line contradicts another one of the step, or names what is not in the deck.
        """
        made = DeckState(self.deck, step.period, self.time + step.period, self._lasting(step))
        given: set[Key] = set()
        for act in step.acts:
            if act.amplitude is not None:
                said = f"*{act.card} names the amplitude {act.amplitude}"
                act.place.entry(self.deck.amplitudes, act.amplitude, said)
            for key, reference in _given_to(self.deck, act):
                made._give(key, reference, act, given)
        return made

    def _lasting(self, step: DeckStep) -> dict[Key, list[tuple[float, Act]]]:
        """Terms that a step leaves: with their last values, but for amplitudes over the time of all steps."""
        loads, kept = {"DLOAD", "DSLOAD"}, {}
        for key, terms in self.terms.items():
            card = terms[0][1].card
            if card in step.fresh:
                continue
            if card in loads and step.fresh & loads:
                raise step.place.refused(
                    f"*{min(step.fresh & loads)} with OP=NEW follows loads by *{card}, which programs keep or take "
                    "away; expected OP=NEW of both cards, or of none"
                )
            kept[key] = [
                (reference, act)
                if act.amplitude is not None and self.deck.amplitudes[act.amplitude].total
                else (self._value(reference, act), replace(act, amplitude=None))
                for reference, act in terms
            ]
        return kept

    def _give(self, key: Key, reference: float, act: Act, given: set[Key]) -> None:
        if key in given and key[0] == "CLOAD":
            self.terms[key].append((reference, act))
            return
        if key in given and key[0] in ("BOUNDARY", "DLOAD", *FIELDS):
            ((before, other),) = self.terms[key]
            if (before, other.amplitude) != (reference, act.amplitude):
                raise act.place.refused(
                    f"*{act.card} gives {self._named(key)} the value {reference:g}, and {other.place} gives it "
                    f"{before:g} in the same step; expected one value"
                )
        others = (own for own in self.terms if own[:2] == key[:2] and own != key and own not in given)
        if key[0] in FIELDS and (earlier := next(others, None)) is not None:
            raise act.place.refused(
                f"*DLOAD gives {key[1]} {_OTHER_FIELDS[key[0]]} than {self.place(earlier)}, to which programs add it "
                "or not; expected OP=NEW"
            )
        self.terms[key] = [(reference, act)]
        given.add(key)

    def _value(self, reference: float, act: Act) -> float:
        if act.amplitude is None:
            return reference
        amplitude = self.deck.amplitudes[act.amplitude]
        return reference * amplitude.at(self.time if amplitude.total else self.period)

    def _named(self, key: Key) -> str:
        kind, of, what = key
        if kind in ("BOUNDARY", "CLOAD"):
            return f"component {what} of node {self.deck.node_name(int(of))}"
        return f"{kind} of {of}" if kind in FIELDS else f"{what} of element {self.deck.element_name(int(of))}"


def states_of(deck: Deck) -> list[DeckState]:
    """The state at the end of every step.

    Raises
    ------
    InvalidArgumentError
        As `DeckState.after`.
    """
    begin = DeckState(deck, time=-deck.initial.period)  # what stands before the first step is one that ends at time 0
    return [*accumulate((deck.initial, *deck.steps), DeckState.after, initial=begin)][2:]


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
        if abs(length - 1.0) > ROUNDED:
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
