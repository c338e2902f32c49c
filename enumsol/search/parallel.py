"""A search of the tree at one alpha by the workers of an executor, its proof put together in the tree's order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from enumsol.proof.writer import KeptRecords
from enumsol.search.parts import Answer, Spread, TreePart
from enumsol.support.deadlines import within

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from concurrent.futures import Executor

    from enumsol.search.nodes import TreeNode
    from enumsol.search.setup import SearchSetup
    from enumsol.search.tree import TreeSearch

#: Nodes of a task, and those that are examined here before there are any.
NODES, FIRST = 512, 64


@dataclass(frozen=True)
class _TreeWorker:
    """Solvers in a worker; what follows ``remake`` is that of the search when they were sent."""

    remake: Callable[[], SearchSetup]
    form: Any
    sliding: dict[int, int]
    known: Any
    depth: int

    @cached_property
    def _solvers(self) -> SearchSetup:
        return self.remake()

    def examined(self, roots: Sequence[TreeNode], nodes: int) -> Answer:
        """Examine so many nodes, until the time is over."""
        solvers, records = self._solvers.fresh(), KeptRecords()
        certifier = solvers.certifier(records)
        certifier.sliding.update(self.sliding)
        search = solvers.search(certifier)
        search.closer.known, search.lookahead.depth = self.known, self.depth
        if search.forms is not None:
            search.forms.use(search.relaxations.engine, self.form)
        left = [item.sent() for item in search.examined(roots, nodes)]
        found = search.outcome, certifier.certified, records.part()
        return Answer(found, search.outcome.nodes, search.covered, left)


class SpreadSearch(Spread):
    """Searches a tree with the help of an executor; its `run` takes the place of the loop of a TreeSearch.

    Parameters
    ----------
    executor : Executor
    solvers : SearchSetup
    search : TreeSearch
    """

    def __init__(self, executor: Executor, solvers: SearchSetup, search: TreeSearch) -> None:
        super().__init__(executor, search, NODES, search.limits.remaining)
        self._search, self._remake = search, solvers.remake()
        self._sent: _TreeWorker | None = None

    def run(self, waiting: Iterable[Any], until: Callable[[], bool] | None = None) -> list[Any]:
        """Examine what waits, the last first; what still waits when it is time to stop."""
        with within(self._search.limits):
            stack = self._parts_of(list(waiting))
            if not self._examine(stack, until):
                self._leave(stack)
        return stack

    def _parts_of(self, waiting: list[Any]) -> list[TreePart]:
        """Parts of what waits, which are these already where the search goes on as before."""
        afresh = not all(isinstance(item, TreePart) for item in waiting)
        if not self._is_current(afresh=afresh):
            self._renew()
        elif not afresh:
            return waiting
        self.cancel()
        items: list[TreeNode] = []
        for item in waiting:
            items += item.roots if isinstance(item, TreePart) else [item]
        left = self._search.left
        return self._begin(self._search.examined(items, FIRST if left is None else min(FIRST, left)))

    def _worker(self) -> _TreeWorker:
        search = self._search
        form = None if search.forms is None else search.forms.form
        sliding, depth = dict(search.certifier.sliding), search.lookahead.depth
        self._sent = _TreeWorker(self._remake, form, sliding, search.closer.known, depth)
        return self._sent

    def _is_current(self, *, afresh: bool) -> bool:
        search, sent = self._search, self._sent
        form = None if search.forms is None else search.forms.form
        as_sent = sent is not None and sent.form is form and sent.depth == search.lookahead.depth
        return as_sent and sent is not None and not (afresh and sent.sliding != search.certifier.sliding)

    def cancel(self) -> None:
        """Cancel what has not begun."""
        self._search.outcome.redone = self._crew.redone
        super().cancel()
