"""Traces of selections over intervals of alpha, by the polynomials of the trusted core (theory, section 7.14).

An interval is cut into boxes, on each of which the conditions are known with bounds of their errors, and the boxes into
parts: the selection holds throughout, or nowhere, or exactly one condition changes its sign. What is left stays open.
Many selections are followed side by side, so that the trusted core examines them together.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.enclosed.cutting import AlphaBox, ArcPart, ArcPartKind, Cutting, OpenCause, Trace, between
from enumsol.branches.enclosed.zeros import zeros_of
from enumsol.search.certifiers.protocol import ERRORS
from enumsol.support.deadlines import TimeOverError, look
from enumsol.trusted.arcs.over_parts import Expansion, OverInterval, expansions, over_parts

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence

    from enumsol.branches.enclosed.cutting import Interval, Number
    from enumsol.trusted.arcs.precise import PreciseSelection
    from enumsol.trusted.arcs.selection_balls import ArcSelection
    from enumsol.trusted.arcs.taylor import ShortExpansion

    #: Asks for expansions (a selection and both ends) or for what is known over parts (an expansion and both ends).
    Question = tuple[Any, Any, Any]
    Asking = Generator[list[Question], list[Any], Any]
    #: Gives a selection in balls of many digits, or None.
    Precise = Callable[[], PreciseSelection | None]

#: Boxes are not cut below so many units in the last place of alpha, or in many digits below this share of the interval.
_SMALLEST_UNITS, _SMALLEST_PRECISE = 64.0, 2.0**-60
#: Boxes shorter than this share of the interval are traced in many digits.
_PRECISE_BOX, _PRECISE_ANYWHERE = 2.0**-10, 2.0**-40
#: Boxes of one selection of which nothing is decided, beyond the number of the others, and these others, after which
#: what is left stays open.
_MOST_TRIES, _MOST_BOXES = 200, 900
#: Boxes of which nothing is decided after which it is looked whether the selection is singular at every alpha, and
#: singular values beside the largest that count as zero.
_VAIN_TRIES, _ZERO = 8, 2.0**-44


def trace(
    asked: Sequence[tuple[ArcSelection, float, float, Precise, float]], found: list[Trace], *, sharpened: bool = False
) -> None:
    """Cut intervals into boxes and parts, of every selection its own.

    Parameters
    ----------
    asked : sequence of (selection, low, high, precise, side)
        ``precise`` gives the same selection in balls of many digits, for short boxes, or None where there is none;
        ``side`` is that of the selection's system.
    found : list of Trace
        Takes the traces; where an error ends this, as that the time is over, those of the selections that are finished.
    sharpened : bounds of events will be made narrower
    """
    traces = [Trace(selection, low, high, side) for selection, low, high, _, side in asked]
    tracings = [_Tracing(one, part[3], sharpened=sharpened) for one, part in zip(traces, asked, strict=True)]
    try:
        _answer([tracing.run() for tracing in tracings])
    except (KeyboardInterrupt, MemoryError, TimeOverError):
        pairs = list(zip(traces, tracings, strict=True))
        waiting = {one.selection.rows.codes for one, tracing in pairs if not tracing.finished}
        found += [one for one in traces if one.selection.rows.codes not in waiting]
        raise
    found += traces


def _answer(running: list[Asking]) -> None:
    """Run generators side by side, answering all that they ask for together."""
    asking = [(one, questions) for one in running if (questions := next(one, None)) is not None]
    while asking:
        answers = iter(_answers([question for _, questions in asking for question in questions]))
        after = []
        for one, questions in asking:
            known = [next(answers) for _ in questions]
            with suppress(StopIteration):
                after.append((one, one.send(known)))
        asking = after


def _answers(questions: list[Question]) -> list[Any]:
    """Expansions of selections, and what is known of expansions."""
    found: list[Any] = [None] * len(questions)
    over = [k for k, (of, _, _) in enumerate(questions) if isinstance(of, Expansion)]
    for k, known in zip(over, over_parts([questions[k] for k in over]), strict=True):
        found[k] = known
    expand = [k for k, (of, _, _) in enumerate(questions) if not isinstance(of, Expansion)]
    for k, expansion in zip(expand, expansions([questions[k] for k in expand], ERRORS), strict=True):
        found[k] = expansion
    return found


class _Tracing:
    """A selection being traced."""

    def __init__(self, found: Trace, precise: Precise, *, sharpened: bool) -> None:
        self._sharpened = sharpened
        self._found, self._selection, self._precise = found, found.selection, precise
        self._length = found.high - found.low
        self._spacing = _SMALLEST_UNITS * float(np.spacing(max(abs(found.low), abs(found.high))))
        self._tries = 0
        #: Length of the last box that many digits decided, and one of a box that they did not.
        self._decided, self._too_long = 0.0, np.inf
        #: Boxes in a row that are open because of conditions that cannot be told from zero, and nothing else.
        self._level = 0
        #: The selection is singular at every alpha, as far as can be seen, and has a continuum or nothing.
        self._hopeless = False
        self.finished = False

    def run(self) -> Asking:
        """AlphaBox by box, from left to right."""
        waiting: list[Interval] = [(self._found.low, self._found.high)]
        while waiting:
            look()
            first, last = waiting.pop()
            rest = yield from self._box(_as_float(first), _as_float(last))
            waiting += reversed(rest)
        self._selection.forget()
        self.finished = True

    def _box(self, first: Number, last: Number) -> Generator[list[Question], list[Any], list[Interval]]:
        """Add a box, or as much of it as is decided; what is left."""
        length = float(last - first)
        share = length / self._length
        # short beside alpha too, or so short that this does not matter
        beside = length / max(abs(float(first)), abs(float(last)))
        # boxes on which a selection seems to be singular are not cut below this share
        short, tiny = (
            share < limit and (share < _PRECISE_ANYWHERE or beside < limit) for limit in (_PRECISE_BOX, 2.0**-26)
        )
        # many digits are tried, too, on a box that is at most so many times as long as the last one that they decided
        beside_decided = length <= 2.0 * self._decided and length < self._too_long
        # halving has as many boxes that were not decided as there are parts in the end
        boxes = len(self._found.boxes)
        if self._tries == _VAIN_TRIES and not boxes:
            self._hopeless = _always_singular(self._selection, self._found.low, self._found.high)
        exhausted = self._hopeless or self._tries - boxes >= _MOST_TRIES or boxes >= _MOST_BOXES
        precise = self._precise() if (short or beside_decided) and not exhausted else None
        smallest = share < _SMALLEST_PRECISE if precise is not None else length <= self._spacing
        whole = exhausted or smallest
        tried: list[tuple[AlphaBox, list[Interval]]] = []
        if not exhausted and isinstance(first, float) and isinstance(last, float):
            (expansion,) = yield [(self._selection, first, last)]
            if isinstance(expansion, OverInterval):
                nowhere = ArcPart(ArcPartKind.NONE, first, last)
                tried.append((AlphaBox(first, last, (nowhere,)), []))
            elif expansion is not None:
                # boxes shorter than this share of the interval are not cut because of a condition that cannot be told
                # from zero
                flat = short and share < 2.0**-12 and precise is None
                tried.append((yield from self._cut(expansion, whole=whole, flat=flat)))
        if precise is not None and not (tried and _decides(*tried[0])):
            found = precise.expansion(first, last)
            if found is not None:
                tried.insert(0, (yield from self._cut(found, whole=whole, flat=share < _PRECISE_BOX)))
                if _decides(*tried[0]):
                    # a length that they did not decide grows by this with every box that they do
                    self._decided, self._too_long = length, self._too_long * 1.1
                else:
                    self._too_long = length
        self._tries += not (tried and tried[0][0].parts)
        if tried:
            box, rest = tried[0]
            if box.parts:
                self._found.boxes.append(box)
                # they stay open because of one condition, or several
                causes = OpenCause.FLAT, OpenCause.TOGETHER
                self._level = self._level + 1 if all(part.cause in causes for part in box.parts) else 0
            return rest
        if whole or tiny:
            everywhere = frozenset(range(len(self._selection.rows.codes)))
            cause = OpenCause.BOXES if exhausted and not self._hopeless else OpenCause.SINGULAR
            part = ArcPart(ArcPartKind.OPEN, first, last, doubtful=everywhere, cause=cause)
            fine = not isinstance(first, float) or not isinstance(last, float)
            self._found.boxes.append(AlphaBox(first, last, (part,), fine))
            return []
        middle = between(first, last)
        return [(first, middle), (middle, last)]

    def _cut(
        self, expansion: Expansion | ShortExpansion, *, whole: bool, flat: bool
    ) -> Generator[list[Question], list[Any], tuple[AlphaBox, list[Interval]]]:
        """The box of an expansion, and what is left of it."""
        # after so many boxes in a row of which nothing else was left open, a flat condition vanishes everywhere
        level, sharpened = self._level >= 8, self._sharpened
        cutting = Cutting(
            self._selection.rows, zeros_of(expansion), whole=whole, flat=flat, level=level, sharpened=sharpened
        ).run()
        parts = next(cutting)
        while True:
            if isinstance(expansion, Expansion):
                known = yield [(expansion, *part) for part in parts]
            else:
                known = [expansion.over(*part) for part in parts]
            try:
                parts = cutting.send(known)
            except StopIteration as end:
                result: tuple[AlphaBox, list[Interval]] = end.value
                return result


def _decides(box: AlphaBox, rest: list[Interval]) -> bool:
    """True if nothing stays open."""
    return not rest and all(part.kind is not ArcPartKind.OPEN for part in box.parts)


def _always_singular(selection: ArcSelection, low: float, high: float) -> bool:
    """True if the rows [M, -g] seem to be dependent at several alphas; no claim rests on it."""
    size = len(selection.rows.unknown)
    for share in (0.1, 0.4, 0.8):
        H = selection.forms[0][:size] + (low + share * (high - low)) * selection.forms[1][:size]
        for axis in (0, 1, 0, 1):
            largest = np.max(np.abs(H), axis=axis, keepdims=True, initial=0.0)
            H = H / np.where(largest > 0, largest, 1.0)
        values = np.linalg.svd(H, compute_uv=False) if size and np.all(np.isfinite(H)) else np.ones(1)
        if values[-1] > _ZERO * values[0]:
            return False
    return True


def _as_float(alpha: Number) -> Number:
    """A float where the number is one."""
    value = float(alpha)
    return value if value == alpha else alpha
