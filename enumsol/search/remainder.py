"""Subtrees that a search left because it was stopped."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from enumsol.proof.writer import KeptRecords
from enumsol.search.certifiers.protocol import UndecidedPart
from enumsol.support.deadlines import TimeOverError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.search.outcome import SearchOutcome
    from enumsol.search.splitting import Splitting
    from enumsol.support.array_types import Codes


class Remainder:
    """Subtrees that were left, which stay undecided but for complete selections that are decided all the same.

    Parameters
    ----------
    certifier : Certifier
    splitting : Splitting
    outcome : SearchOutcome
    settle : callable
        Has the certifier decide a complete selection.

    Attributes
    ----------
    otherwise : str
        Advice if limits are reached, besides raising them.
    """

    def __init__(
        self,
        certifier: Certifier,
        splitting: Splitting,
        outcome: SearchOutcome,
        settle: Callable[[Codes], object],
    ) -> None:
        self._certifier, self._splitting, self._outcome, self._settle = certifier, splitting, outcome, settle
        self._recorder, self.otherwise = certifier.recorder, ""
        #: Subtrees, and the records that follow each of them.
        self._left: list[tuple[Codes, KeptRecords]] = []

    def add(self, codes: Codes) -> None:
        """Leave a subtree."""
        # which continua reach into it is known once everything is found, also what comes after it
        self._left.append((codes, KeptRecords(packed=True)))
        self._certifier.recorder = self._left[-1][1]

    def finish(self, wanted: Callable[[], Sequence[Codes]]) -> None:
        """Leave undecided what was left, except for complete selections, which are decided if there is time."""
        left, self._left = self._left, []
        if not left:
            return
        self._certifier.recorder = self._recorder
        selections = wanted()
        for codes, after in left:
            self._leave_but(codes, selections)
            after.release(self._recorder)
        self._outcome.count_unexamined()

    def _leave_but(self, codes: Codes, wanted: Sequence[Codes]) -> None:
        stack = [(codes, wanted)]
        while stack:
            codes, wanted = stack.pop()
            wanted = [final for final in wanted if all(map(self._splitting.holds, codes, final))]
            if not wanted:
                self._skip(codes)
                continue
            node = next((i for i, code in enumerate(codes) if code != wanted[0][i]), -1)
            if node < 0:
                self._decide(codes)
                continue
            final, before, after = wanted[0][node], codes[:node], codes[node + 1 :]
            # the one that holds the selection comes last: what is beside it is left behind at once
            children = self._splitting.towards(codes, node, final)
            children.sort(key=partial(self._splitting.holds, final=final))
            self._certifier.branching(node, children)
            stack += [((*before, code, *after), wanted) for code in reversed(children)]

    def _decide(self, codes: Codes) -> None:
        try:
            self._settle(codes)
        except TimeOverError:
            self._outcome.late = True
            self._skip(codes)

    def _skip(self, codes: Codes) -> None:
        stop = self._outcome.stopped
        assert stop is not None
        self._certifier.skipped(codes, str(stop))
        hint = f"{stop.remedy}, or {self.otherwise}" if stop.limited and self.otherwise else stop.remedy
        self._outcome.undecided.append(UndecidedPart(codes, "the search was stopped before it got here", hint))
