"""A search that resumes from the proof of an earlier one, which was stopped or killed.

The records are gone through in order. Each leaf is proven again by the certifier, which trusts nothing in the file, and
written to the new proof; what cannot be proven again, was left undecided, or is missing is searched.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from enumsol.proof import leaves, records
from enumsol.search.certifiers.protocol import NO_BOUND, RecordedBound
from enumsol.search.nodes import TreeNode
from enumsol.search.reduction import LoneProposal
from enumsol.search.tree import TreeSearch

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.writer import BegunProof
    from enumsol.search.certifiers.protocol import Bound
    from enumsol.support.array_types import Codes

#: Progress is reported after so many nodes.
_REPORT_EVERY = 64


class Reader:
    """Understands the records of one proof.

    Parameters
    ----------
    limits : Limits
        Of the root of its tree, without the forms that are declared.
    system : balls for the data, of which forms are made; None where there are none
    """

    def __init__(self, limits: records.Limits, system: EnclosedSystem | None) -> None:
        self._limits, self._system = limits, system
        self._declared: list[records.DeclaredForm] = []
        #: Forms that were used, the last one last.
        self._used: dict[records.DeclaredForm, Any] = {}

    def declare(self, record: list[Any]) -> None:
        """Take note of a form; ValueError where the record makes no sense."""
        said = records.DeclaredForm.read(record, self._limits)
        # parts of one search declare the same form
        self._declared.append(next((known for known in self._used if known.same(said)), said))

    def read(self, codes: Codes, record: list[Any]) -> Any:
        """A leaf; None or ValueError where the record makes no sense."""
        kind = leaves.kind_of(record, self._limits.tree)
        return kind and kind.read(record, replace(self._limits, codes=codes, declared=self._declared))

    def form_over(self, codes: Codes) -> Any:
        """The form that was used last of those that serve a partial assignment in place of the energy."""
        return next((form for said, form in reversed(self._used.items()) if said.serves(codes)), None)

    def bound(self, leaf: leaves.Excluded) -> Bound:
        """Bound that is said to exclude a partial assignment; ValueError where its form is not proven."""
        if not isinstance(leaf.by, int):
            return RecordedBound(leaf.rows, leaf.values)
        said = self._declared[-leaf.by]
        form = self._used.pop(said) if said in self._used else self._system and said.form(self._system)
        if form is None:
            raise ValueError("its form is not proven")
        self._used[said] = form
        return RecordedBound(leaf.rows, leaf.values, form)


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
        #: Whether the rule by which the file's tree was branched is still to be found out, from its first branchings.
        self._learning = search.forms is not None and search.lookahead.pays

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
        search, learning = self._search, self._learning
        self._learning = False
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
        except ValueError:
            stack.append(item)
            return False
        self._learning = learning and search.lookahead.learn(item.codes, split.node)
        search.certifier.branching(split.node, split.children)
        search.outcome.resumed += 1
        weight = item.weight / len(split.children)
        below = reversed(split.below(item.codes))
        stack += [TreeNode(None, codes, split.node, last=False, weight=weight) for codes in below]
        return True

    def _proven(self, item: TreeNode, record: list[Any]) -> bool:
        """True if a leaf is proven again, and written."""
        search = self._search
        try:
            leaf = self._reader.read(item.codes, record)
            if isinstance(leaf, leaves.Unbalanced):
                # the certifier finds a direction of its own
                return search.excluded(item, NO_BOUND)
            if isinstance(leaf, leaves.Excluded):
                return search.excluded(item, self._reader.bound(leaf))
            if isinstance(leaf, leaves.Alone) and leaf.strengths is not None and leaf.terms is not None:
                proposal = LoneProposal(leaf.selection, leaf.numbers, leaf.strengths)
                return search.alone(item, proposal, RecordedBound(*leaf.terms))
        except ValueError:
            return False
        if isinstance(leaf, leaves.OnlyReference):
            return search.closed(item, None, again=True)
        if isinstance(leaf, records.ClosingRecord):
            return search.closed(item, search.relaxations.energy(item.codes), again=True)
        return isinstance(leaf, leaves.Solved) and search.settled(item)
