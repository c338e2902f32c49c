"""Subtrees that a search left because it was stopped."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

from enumsol.proof.writer import KeptRecords
from enumsol.search.certifiers.protocol import UndecidedPart
from enumsol.search.outcome import StopReason
from enumsol.support.deadlines import Deadline, TimeOverError, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.search.certifiers.protocol import Certifier
    from enumsol.search.outcome import SearchOutcome
    from enumsol.search.splitting import Splitting
    from enumsol.support.array_types import Codes
    from enumsol.support.deadlines import Limited


class Remainder:
    """Subtrees that were left, which stay undecided but for complete selections that are decided all the same.

    Parameters
    ----------
    certifier : Certifier
    splitting : Splitting
    outcome : SearchOutcome
    settle : callable
        Has the certifier decide a complete selection.
    known_root : callable, optional
        Gives the codes of a complete selection that is known to hold a root, or None.

    Attributes
    ----------
    continua : callable
        Gives the codes of complete selections that hold on continua of which solutions were found: a result lists whole
        families, its proof too.
    otherwise : str
        Advice if limits are reached, besides raising them.
    """

    def __init__(
        self,
        certifier: Certifier,
        splitting: Splitting,
        outcome: SearchOutcome,
        settle: Callable[[Codes], object],
        known_root: Callable[[], Codes | None] | None = None,
    ) -> None:
        self._certifier, self._splitting, self._outcome, self._settle = certifier, splitting, outcome, settle
        self._recorder, self._known_root, self.otherwise = certifier.recorder, known_root, ""
        self.continua: Callable[[], Sequence[Codes]] = list
        #: Subtrees, and the records that follow each of them.
        self._left: list[tuple[Codes, KeptRecords]] = []

    def add(self, codes: Codes) -> None:
        """Leave a subtree."""
        # which continua reach into it is known once everything is found, also what comes after it
        self._left.append((codes, KeptRecords(packed=True)))
        self._certifier.recorder = self._left[-1][1]

    def known(self, limits: Limited | None = None) -> Codes | None:
        """Codes of a selection that holds a root, if one is found within limits, by default in a second."""
        if self._known_root is None:
            return None
        try:
            with within(limits or Deadline.after(time.perf_counter(), 1.0)):
                return self._known_root()
        except TimeOverError:
            self._known_root = None
            return None

    def add_known(self) -> None:
        """Add the root that is known, in a search that was interrupted before it came there."""
        root = self.known()
        if root is not None and root not in self._certifier.certified.verified:
            self._settle(root)

    def finish(self) -> None:
        """Leave undecided what was left, except for complete selections, which are decided if there is time."""
        left, self._left = self._left, []
        if not left:
            return
        self._certifier.recorder = self._recorder
        selections = self._wanted()
        for codes, after in left:
            self._leave_but(codes, selections)
            after.release(self._recorder)
        self._outcome.count_unexamined()

    def _wanted(self) -> list[Codes]:
        """Complete selections that are decided although the search was stopped."""
        stopped, root = self._outcome.stopped, None
        if stopped is None or stopped.reason is not StopReason.ENOUGH_ROOTS:
            root = self.known()
        wanted = [] if root is None else [root]
        try:
            wanted += self.continua()
        except TimeOverError:
            self._outcome.late = True
        return wanted

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
