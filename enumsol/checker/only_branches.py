"""Pieces of a graph's proof that hold no tree: the arcs through them are tested to hold all solutions.

Record ``["m", mu, kappa, nu]`` of a piece (docs/proof_format.md, under Pieces): numbers of the form of theory, (6.9).
At every alpha of the piece some arc has a root, and the form is definite with what serves this root (theory,
section 7.15).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.proof.reading import numbers_from
from enumsol.trusted.arcs.only_branch import only_roots
from enumsol.trusted.arcs.selection_balls import ArcSelection
from enumsol.trusted.piece_form import PieceNumbers

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.trusted.arcs.selection_balls import ArcSystem

#: Entries of the record.
_ENTRIES = 4


@dataclass(eq=False)
class ClaimedEvent:
    """A point at which one condition of a selection vanishes."""

    codes: tuple[int, ...]
    side: int
    condition: tuple[int, int]
    part: tuple[Fraction, Fraction]
    zero: tuple[Fraction, Fraction]
    rising: bool
    index: int
    partners: list[ClaimedEvent]


@dataclass(eq=False)
class ClaimedArc:
    """Where a trace shows a root of its selection at every alpha.

    Attributes
    ----------
    codes : status codes
    side : int
        Of the alpha at which g vanishes.
    low, high : Fraction
        It holds from here to there at least.
    tail, head : ClaimedEvent or None
        Where it begins, and where it ends.
    """

    codes: tuple[int, ...]
    side: int
    low: Fraction
    high: Fraction
    tail: ClaimedEvent | None = None
    head: ClaimedEvent | None = None


@dataclass(frozen=True)
class ClosedPiece:
    """A piece whose solutions are said to lie on the arcs through it."""

    a: Fraction
    b: Fraction
    numbers: PieceNumbers

    @classmethod
    def read(cls, a: Fraction, b: Fraction, record: list[Any], p: int) -> ClosedPiece:
        """From its record."""
        if len(record) != _ENTRIES:
            raise ValueError(f"a record of kind 'm' has {len(record)} entries; expected {_ENTRIES}")
        numbers = PieceNumbers(*(numbers_from(values, p) for values in record[1:]))
        if not numbers.usable:
            raise ValueError("a number mu or kappa is not positive")
        return cls(a, b, numbers)

    def failure(self, arcs: Sequence[ClaimedArc], systems: dict[int, ArcSystem], origin: Fraction | None) -> str | None:
        """Why the arcs are not shown to hold all its solutions, or None. Events have their partners."""
        side = 0 if origin is None else 1 if self.b > origin else -1
        chain = self._chain([arc for arc in arcs if arc.side == side])
        if chain is None:
            return "no arcs lead through it"
        spans = []
        for arc in chain:
            low = self.a if arc.tail is None else max(self.a, arc.tail.zero[0])
            high = self.b if arc.head is None else min(self.b, arc.head.zero[1])
            spans.append((ArcSelection(systems[side], arc.codes), _below(low), -_below(-high)))
        return None if all(only_roots(spans, self.numbers)) else "its arcs are not proven to hold all its solutions"

    def _chain(self, arcs: Sequence[ClaimedArc]) -> list[ClaimedArc] | None:
        """Arcs one after another, of which one holds at every alpha of the piece."""
        begins = {arc.tail: arc for arc in arcs if arc.tail is not None}
        arc = next((arc for arc in arcs if arc.low <= self.a and self.a <= _end(arc)), None)
        found = []
        while arc is not None:
            found.append(arc)
            if arc.high >= self.b:
                return found
            partners = [] if arc.head is None else arc.head.partners
            goes_on = len(partners) == 1 and partners[0].rising
            arc = begins.get(partners[0]) if goes_on else None
        return None


def _end(arc: ClaimedArc) -> Fraction:
    return arc.high if arc.head is None else arc.head.zero[1]


def _below(alpha: Fraction) -> float:
    """The largest float that is not larger."""
    value = float(alpha)
    return value if value <= alpha else float(np.nextafter(value, -np.inf))
