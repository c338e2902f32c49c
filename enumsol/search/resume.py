"""A search that resumes from the proof of an earlier one, which was stopped or killed.

The records are gone through in order. Each leaf is proven again by the certifier, which trusts nothing in the file, and
written to the new proof; what cannot be proven again, was left undecided, or is missing is searched.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from enumsol.model.statuses import CONTACT, SLIDING, UNDECIDED
from enumsol.proof import records
from enumsol.search.certifiers.protocol import RecordedBound
from enumsol.search.fathoming_in_contact import LoneProposal
from enumsol.search.nodes import TreeNode
from enumsol.search.tree import TreeSearch
from enumsol.trusted.quadratic_forms import EnclosedForm

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.begun import BegunProof
    from enumsol.search.certifiers.protocol import Bound
    from enumsol.support.array_types import Codes

#: Progress is reported after so many nodes.
_REPORT_EVERY = 64


class Reader(Protocol):
    """Understands the records of one proof.

    Attributes
    ----------
    kinds : dict
        Its kinds of leaves, by their letters.
    """

    kinds: dict[str, type[Any]]

    def declare(self, record: list[Any]) -> None:
        """Take note of a form; ValueError where the record makes no sense."""

    def form_over(self, codes: Codes) -> Any:
        """The form that was used last of those that hold over a partial assignment."""

    def bound(self, codes: Codes, record: list[Any]) -> Bound:
        """What is said to exclude a partial assignment; ValueError where the record makes no sense."""

    def lone(self, codes: Codes, record: list[Any]) -> tuple[LoneProposal, Bound]:
        """What is said to show that a root is alone below it; ValueError where the record makes no sense."""


class PlaneReader:
    """Of proofs in 2D.

    Parameters
    ----------
    friction : whether each contact node has any
    enclosed : EnclosedSystem or None
        Balls for the system, by which forms are proven.
    """

    kinds = records.LEAVES

    def __init__(self, friction: Sequence[bool], enclosed: EnclosedSystem | None) -> None:
        self._friction, self._enclosed = friction, enclosed
        self._declared: list[records.DeclaredForm] = []
        #: Forms that were used, the last one last.
        self._used: dict[records.DeclaredForm, EnclosedForm] = {}

    def declare(self, record: list[Any]) -> None:
        """Take note of a form; ValueError where the record makes no sense."""
        said = records.DeclaredForm.read(record, records.Limits((UNDECIDED,) * len(self._friction)))
        # parts of one search declare the same form
        self._declared.append(next((known for known in self._used if known.same(said)), said))

    def form_over(self, codes: Codes) -> Any:
        """The form that was used last of those that hold over a partial assignment."""
        return next((form for said, form in reversed(self._used.items()) if said.holds(codes)), None)

    def bound(self, codes: Codes, record: list[Any]) -> Bound:
        """What is said to exclude a partial assignment; ValueError where the record makes no sense."""
        limits = records.Limits(codes, self._friction, self._declared)
        if record[0] != records.ExcludedByForm.kind:
            return RecordedBound(*records.Excluded.read(record, limits).terms)
        said = records.ExcludedByForm.read(record, limits)
        rows, values = said.terms
        return RecordedBound(rows, values, self._enclosed_form(self._declared[-said.back]))

    def lone(self, codes: Codes, record: list[Any]) -> tuple[LoneProposal, Bound]:
        """What is said to show that a root is alone below it; ValueError where the record makes no sense."""
        said = records.Alone.read(record, records.Limits(codes, self._friction))
        return LoneProposal(said.selection, said.weights, said.strengths), RecordedBound(*said.terms)

    def _enclosed_form(self, said: records.DeclaredForm) -> EnclosedForm:
        if self._enclosed is None:
            raise ValueError("there are no balls")
        if said not in self._used:
            with np.errstate(over="ignore", invalid="ignore"):
                self._used[said] = EnclosedForm.of(self._enclosed, said.codes, said.multipliers, said.weight)
        return self._used[said]


def resume(search: TreeSearch, reader: Reader, begun: BegunProof, passed: Callable[[], None]) -> None:
    """Go on with an earlier proof (for ``passed`` see Replay.run); a time limit is about what is searched anew."""
    limits, mark = search.limits, time.perf_counter()

    def below(*items: TreeNode, trial: bool = False) -> None:
        nonlocal mark
        if limits.deadline is not None:
            limits.deadline += time.perf_counter() - mark
        search.below(items, reader.form_over(items[-1].codes), trial=trial)
        mark = time.perf_counter()

    def through() -> None:
        search.finish()  # the file that is replaced holds what was written after the subtrees that were skipped
        passed()

    rest = Replay(search, reader, below).run(begun, through)
    if len({reader.form_over(item.codes) for item in rest}) > 1:
        while rest:
            below(rest.pop())
    elif rest:
        below(*rest, trial=search.forms is not None and not search.forms.tried(search.outcome.resumed))
    search.finish()


class Replay:
    """Goes through an earlier proof.

    Parameters
    ----------
    search : TreeSearch
        Its certifier proves and writes.
    reader : Reader
    below : callable
        Searches a subtree, in the place where its record is due.
    """

    def __init__(self, search: TreeSearch, reader: Reader, below: Callable[[TreeNode], None]) -> None:
        self._search, self._reader, self._below = search, reader, below

    def run(self, begun: BegunProof, passed: Callable[[], None]) -> list[TreeNode]:
        """Take over what holds; gives the subtrees that the file does not reach, the first one last.

        ``passed`` is called once all that is proven in the file, and can be followed, has been gone through.
        """
        outcome, extent = self._search.outcome, begun.extent()
        needed, outcome.held, outcome.held_open = extent
        stack = [self._search.first()]
        for number, record in enumerate(begun.records() if needed else (), start=1):
            if not stack or not isinstance(record, list) or not record or not self._take(stack, record):
                break
            if number == needed:
                break  # what follows is open, and all of it on the stack
            if outcome.resumed % _REPORT_EVERY == 0:
                self._search.report()
        passed()
        return stack

    def _take(self, stack: list[TreeNode], record: list[Any]) -> bool:
        """Take one record; False if it and what follows make no sense."""
        search = self._search
        if record[0] == records.DeclaredForm.kind:
            try:
                self._reader.declare(record)
            except ValueError:
                return False
            return True
        item = stack.pop()
        if record[0] != records.Branching.kind:
            if self._proven(item, record):
                search.outcome.resumed += 1
            else:
                self._below(item)
            return True
        try:
            split = records.Branching.covering(record, item.codes, search.splitting.covers)
        except records.RecordError:
            stack.append(item)
            return False
        search.certifier.branching(split.node, split.children)
        search.outcome.resumed += 1
        weight = item.weight / len(split.children)
        below = reversed(split.below(item.codes))
        stack += [TreeNode(None, codes, split.node, last=False, weight=weight) for codes in below]
        return True

    def _proven(self, item: TreeNode, record: list[Any]) -> bool:
        """Whether a leaf is proven again, and written."""
        kind, search = records.kind_of(record, self._reader.kinds) or records.Record, self._search
        if issubclass(kind, records.Exclusion):
            try:
                bound = self._reader.bound(item.codes, record)
            except ValueError:
                return False
            return search.excluded(item, bound)
        if issubclass(kind, records.Alone):
            try:
                return search.alone(item, *self._reader.lone(item.codes, record))
            except ValueError:
                return False
        if issubclass(kind, records.OnlyReference):
            return search.closed(item, None, again=True)
        if issubclass(kind, records.ClosingRecord):
            return search.closed(item, search.relaxations.energy(item.codes), again=True)
        partial = any(code in (CONTACT, UNDECIDED, *SLIDING) for code in item.codes)
        return issubclass(kind, records.Solved) and not partial and search.settled(item)
