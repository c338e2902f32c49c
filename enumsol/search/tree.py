"""The tree search: partial assignments, pruned by the energy-bounded relaxation (theory, section 5.4).

Every node of the tree is a partial assignment of statuses. Its relaxation is solved, warm-started from its parent; it
is pruned when the certifier accepts the multipliers as a proof that it holds no solution, branched on otherwise, and
handed to the certifier as a complete selection when every contact node is decided. The leaves cover all selections by
construction: an engine that fails, or whose multipliers the certifier does not accept, is replaced by the fallback, and
where that fails too the node is branched on.

Presolve comes first: contact nodes that one dual step proves open or in contact are branched on before all others, so
that everything below knows them. What is left when a search is stopped stays undecided, but for complete selections
that are decided all the same.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from enumsol.proof.writer import KeptRecords
from enumsol.search.certifiers.protocol import NO_BOUND, Bound, Certifier, Refine, UndecidedPart
from enumsol.search.nodes import Lookahead, Relaxations, TreeCloser, TreeNode
from enumsol.search.outcome import SearchLimits, SearchOutcome, SearchProgress, Stop, StopReason
from enumsol.search.splitting import branching_node
from enumsol.support.deadlines import Deadline, TimeOverError, over, tell, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.proof.leaves import Alone
    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.nodes import Forms
    from enumsol.search.parts import Answer
    from enumsol.support.array_types import Codes


class Remainder:
    """Subtrees that were left, which stay undecided but for complete selections that are decided all the same.

    Parameters
    ----------
    search : TreeSearch
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

    def __init__(self, search: TreeSearch, known_root: Callable[[], Codes | None] | None = None) -> None:
        self._search, self._certifier, self._outcome = search, search.certifier, search.outcome
        self._recorder, self._known_root, self.otherwise = search.certifier.recorder, known_root, ""
        self.continua: Callable[[], Sequence[Codes]] = list
        #: Subtrees, and the records that follow each of them.
        self._left: list[tuple[Codes, KeptRecords]] = []

    def add(self, codes: Codes) -> None:
        """Leave a subtree."""
        # which continua reach into it is known once everything is found, also what comes after it
        self._left.append((codes, KeptRecords(packed=True)))
        self._certifier.recorder = self._left[-1][1]

    def known(self, limits: Deadline | None = None) -> Codes | None:
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
            self._search.settled(TreeNode(None, root, -1, last=False, weight=0.0))

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
        splitting, stack = self._search.splitting, [(codes, wanted)]
        while stack:
            codes, wanted = stack.pop()
            wanted = [final for final in wanted if all(map(splitting.holds, codes, final))]
            if not wanted:
                self._skip(codes)
                continue
            node = next((i for i, code in enumerate(codes) if code != wanted[0][i]), -1)
            if node < 0:
                try:
                    self._search.settled(TreeNode(None, codes, -1, last=False, weight=0.0))
                except TimeOverError:
                    self._outcome.late = True
                    self._skip(codes)
                continue
            final, before, after = wanted[0][node], codes[:node], codes[node + 1 :]
            # the one that holds the selection comes last: what is beside it is left behind at once
            children = splitting.towards(codes, node, final)
            children.sort(key=partial(splitting.holds, final=final))
            self._certifier.branching(node, children)
            stack += [((*before, code, *after), wanted) for code in reversed(children)]

    def _skip(self, codes: Codes) -> None:
        stop = self._outcome.stopped
        assert stop is not None
        self._certifier.skipped(codes, str(stop))
        hint = f"{stop.remedy}, or {self.otherwise}" if stop.limited and self.otherwise else stop.remedy
        self._outcome.undecided.append(UndecidedPart(codes, "the search was stopped before it got here", hint))


#: Progress is reported and limits on time are looked at after this many nodes.
REPORT_EVERY = 64
#: Number of contact nodes from which a root is sought before the tree: of fewer the tree finds one sooner.
_MANY = 24


def depth_first(waiting: list[Any], examine: Callable[[Any], Sequence[Any]], ended: Callable[[], bool]) -> None:
    """Examine what waits, the last first, until that is all or the search has ended.

    Where ``examine`` raises an error, its item waits as before; otherwise what it gives takes the item's place.
    """
    while waiting and not ended():
        waiting[-1:] = examine(waiting[-1])


class TreeSearch:
    """Depth-first search over the statuses of the contact nodes.

    Parameters
    ----------
    relaxations : Relaxations
    certifier : Certifier
    limits : SearchLimits
    progress : called with a SearchProgress now and then
    closer : TreeCloser, optional
        Closes subtrees by their only possible solution.
    known_root : callable, optional
        Gives the codes of a complete selection that is known to hold a root, or None. Where the search is stopped
        before it came there, this root is proven by itself.
    """

    def __init__(
        self,
        relaxations: Relaxations,
        certifier: Certifier,
        *,
        limits: SearchLimits | None = None,
        progress: Callable[[SearchProgress], object] | None = None,
        closer: TreeCloser | None = None,
        known_root: Callable[[], Codes | None] | None = None,
    ) -> None:
        self.relaxations, self.certifier = relaxations, certifier
        self.splitting, self.forms = relaxations.splitting, relaxations.forms
        self.lookahead = Lookahead(relaxations)
        self.limits = limits or SearchLimits()
        self.progress = progress
        self.closer = closer or TreeCloser()
        self.closer.relaxed = relaxations.energy
        self._recorder = certifier.recorder
        self.outcome = SearchOutcome()
        self.rest = Remainder(self, known_root)
        #: Most nodes where the load is at the limit of what contact can hold: what stays undecided, rounding decides.
        self.at_limit: int | None = None
        self.covered = 0.0
        #: Examines what waits, the last first, until it is time to stop, and gives what still waits then; another one
        #: than this spreads it over workers.
        self.loop: Callable[[Sequence[Any], Callable[[], bool] | None], list[Any]] = self._run
        self._start = time.perf_counter()

    # -- the loop --------------------------------------------------------------------------------------------------

    def first(self) -> TreeNode:
        """The root of the tree: nothing decided."""
        return TreeNode(None, self.relaxations.nothing, -1, last=False, weight=1.0, forced=())

    def run(self) -> SearchOutcome:
        """Examine the whole tree."""
        start = [self.first()]
        if self._one(start[0]):
            return self.outcome
        if len(start[0].codes) >= _MANY:
            self.rest.known(self.limits)
        if self.forms is not None:
            held = self.certifier.recorder = KeptRecords()
            try:
                start = self._begin(start, held, self.forms)
            finally:
                self.certifier.recorder = self._recorder
                held.release(self._recorder)
        self.loop(start, None)
        self.finish()
        return self.outcome

    def _one(self, item: TreeNode) -> bool:
        """True if one certificate proves that the problem has one solution."""
        if self.limits.max_nodes == 0:
            return False
        found = None
        with suppress(TimeOverError), within(self.limits):
            found = self.closer.whole()
        if not self._close(item, found):
            return False
        self.outcome.nodes += 1
        self.report()
        return True

    def _begin(self, start: list[TreeNode], held: KeptRecords, forms: Forms) -> list[Any]:
        """Search until it is known how the search goes on: from the beginning, if that is better; what still waits."""

        def stops() -> bool:
            nodes = self.outcome.nodes
            return self.lookahead.due(nodes) or forms.due(nodes, self.covered) or self.closer.begins_again(nodes)

        stack = list[Any](start)
        while stack and (stack := self.loop(stack, stops)):
            if self.lookahead.due(self.outcome.nodes):
                # what was found is kept where few nodes are left to find it again
                share = self.covered if self.left is None or self.left >= self.outcome.nodes else 1.0
                stack = self._again(start, held) if self.lookahead.begins(share) else stack
            elif forms.due(self.outcome.nodes, self.covered):
                return self._again(start, held) if self._pays(forms) else stack
            else:
                stack = self._again(start, held)
                stack = [] if self._one(start[0]) else stack
        return stack

    def _pays(self, forms: Forms) -> bool:
        """True if a form is found that is better than the energy, before the time is over."""
        with suppress(TimeOverError), within(self.limits):
            if forms.pay(self.relaxations.engine, self.relaxations.nothing, self.relaxations.rows):
                self.lookahead.depth = -1
                return True
        return False

    def _again(self, start: list[TreeNode], held: KeptRecords) -> list[Any]:
        """Forget what was found and proven; where the search began."""
        held.drop()
        self.certifier.forget()
        self.outcome.forget()
        self.covered = 0.0
        return list(start)

    def below(self, items: Sequence[TreeNode], form: Any, *, trial: bool = False) -> None:
        """Examine subtrees, the last first, with a form that is known to hold for them; or on trial with a new one."""
        forms = self.forms
        if forms is not None:
            forms.use(self.relaxations.engine, form)
        if self.outcome.stopped is not None:
            self.leave(items)
            return
        stack: list[Any] = self.relaxations.planted(items)
        if forms is not None and trial and form is None:
            stack = self.loop(stack, lambda: forms.due(self.outcome.nodes, self.covered))
            if stack and self._pays(forms):
                # from here on without the parents' relaxations, which are the energy's
                stack = [replace(item, parent=None) if isinstance(item, TreeNode) else item for item in stack]
            elif stack and self.lookahead.due(self.outcome.nodes):
                self.lookahead.begins(self.covered)
        self.loop(stack, None)

    def examined(self, items: Sequence[TreeNode], nodes: int) -> list[TreeNode]:
        """Examine so many nodes of subtrees, the last first; what still waits then, or when the time is over."""
        stack, last = self.relaxations.planted(items), self.outcome.nodes + nodes
        with suppress(TimeOverError):
            depth_first(stack, self.examine, lambda: self.outcome.nodes >= last or over())
        return stack

    def _run(self, stack: Sequence[TreeNode], until: Callable[[], bool] | None) -> list[TreeNode]:
        """Examine what waits, depth first; what still waits when it is time to stop."""
        stack, stopping = list(stack), False

        def ended() -> bool:
            nonlocal stopping
            stopping = until is not None and self.is_time_to(until)
            return stopping or self.must_stop(len(stack))

        with within(self.limits):
            while stack and not stopping and self.outcome.stopped is None:
                try:
                    depth_first(stack, self.examine, ended)
                except TimeOverError:
                    continue  # what was examined waits again, and the limits are looked at
        if stopping:
            return stack
        self.leave(stack)
        return []

    @staticmethod
    def is_time_to(until: Callable[[], bool]) -> bool:
        """True if it is time to stop, as far as there is time to find out."""
        try:
            return until()
        except TimeOverError:
            return False

    # -- what a search spread over workers asks for -----------------------------------------------------------------

    @property
    def left(self) -> int | None:
        """Number of nodes that may still be examined; None for any number."""
        return None if self.limits.max_nodes is None else self.limits.max_nodes - self.outcome.nodes

    @property
    def stopped(self) -> StopReason | None:
        """Reason for an early end."""
        return None if self.outcome.stopped is None else self.outcome.stopped.reason

    def stop_for_time(self) -> None:
        """Take note that the time is over."""
        self.outcome.stopped = Stop(StopReason.TIME_LIMIT, unexamined=0)

    def take(self, answer: Answer) -> None:
        """Take in what a worker found below some subtrees."""
        outcome, certified, records = answer.found
        self.outcome.add(outcome)
        self.certifier.add(certified)
        if records is not None:
            self.certifier.recorder.add(records)

    # -- what is left when the search is stopped --------------------------------------------------------------------

    def leave(self, items: Sequence[TreeNode]) -> None:
        """Leave subtrees to `finish`, because the search was stopped."""
        for item in reversed(items):
            self.rest.add(item.codes)

    def finish(self) -> None:
        """Leave what was skipped undecided, except for the known root and the selections of continua in it."""
        with within(self.limits.extended(self._start)):
            self.rest.finish()

    def examine(self, item: TreeNode) -> list[TreeNode]:
        """Settle one node of the tree, or give its children, the one that is examined first last."""
        outcome = self.outcome
        outcome.nodes += 1
        codes = item.codes
        led = self.closer.led(codes)
        if isinstance(led, list):
            self._close(item, led)
            return []
        if led is not None:
            return self.split(item, None, *led)
        if self.closer.leads and item.parent is None and self.excluded(item, NO_BOUND):
            return []
        relaxation: Relaxation | None
        relaxation = solved = self.relax(item)
        if solved.pruned and self.excluded(item, solved):
            return []
        if solved.stalled or solved.pruned:
            # no answer, or none that is proven; the fallback costs more than a try
            if solved.stalled and self.closed(item, None):
                return []
            outcome.fallback_qps += solved.stalled
            relaxation = self.relaxations.fallen_back(codes, solved)
            if relaxation is not None and relaxation.pruned and self.excluded(item, relaxation):
                return []
        usable = relaxation if relaxation is not None and not relaxation.pruned else None
        if self.closed(item, usable):
            return []
        node, forced = branching_node(codes, item.forced, usable, self.closer.sliding, self.lookahead.choose)
        if node < 0:
            node = self._settle(item)
        if node < 0:
            return []
        children = self.splitting.children(codes, node, relaxation)
        outcome.presolved += forced is not None
        return self.split(item, usable, node, children, forced)

    def split(
        self,
        item: TreeNode,
        usable: Relaxation | None,
        node: int,
        children: list[int],
        forced: tuple[int, ...] | None = None,
    ) -> list[TreeNode]:
        """The children of a node of the tree, the one that is examined first last."""
        codes = item.codes
        self.certifier.branching(node, children)
        weight, before, after = item.weight / len(children), codes[:node], codes[node + 1 :]
        waiting = list[TreeNode]()
        for code in reversed(children):
            waiting.append(TreeNode(usable, (*before, code, *after), node, not waiting, weight, forced))
        return waiting

    def excluded(self, item: TreeNode, bound: Bound) -> bool:
        """True if the subtree is proven to hold no solution."""
        if not self.certifier.excluded(item.codes, bound):
            return False
        self.outcome.pruned += 1
        self.covered += item.weight
        return True

    def closed(self, item: TreeNode, relaxation: Relaxation | None, *, again: bool = False) -> bool:
        """True if the subtree is closed by its only possible solution; ``again``: it was, in an earlier search."""
        return self._close(item, (self.closer.again if again else self.closer.closed)(item.codes, relaxation))

    def alone(self, item: TreeNode, record: Alone) -> bool:
        """True if the subtree is closed by a root that is proven to be the only one."""
        return self._close(item, self.certifier.alone(item.codes, record))

    def _close(self, item: TreeNode, found: list[Any] | None) -> bool:
        if found is None:
            return False
        self.outcome.closed += 1
        self.outcome.solutions += found
        self.covered += item.weight
        return True

    def settled(self, item: TreeNode) -> bool:
        """True if the certifier decides a complete selection, or leaves it undecided for good."""
        return self._settle(item) < 0

    def _settle(self, item: TreeNode) -> int:
        """Have the certifier decide a complete selection; -1, or the node that it asks to have split further."""
        outcome = self.outcome
        outcome.selections += 1
        answer = self.certifier.selection(item.codes)
        self.closer.met(answer)
        if isinstance(answer, Refine):
            return answer.node
        if isinstance(answer, UndecidedPart):
            outcome.undecided.append(answer)
        elif answer is not None:
            outcome.solutions.append(answer)
        self.covered += item.weight
        return -1

    def must_stop(self, waiting: int = 0) -> bool:
        """Look at the limits and report progress."""
        outcome, limits = self.outcome, self.limits
        if limits.max_nodes is not None and outcome.nodes >= limits.max_nodes:
            outcome.stopped = Stop(StopReason.NODE_LIMIT, limits.max_nodes, unexamined=waiting)
        elif limits.enough is not None and limits.enough(outcome.solutions):
            outcome.stopped = Stop(StopReason.ENOUGH_ROOTS, unexamined=waiting)
        elif self.at_limit is not None and (
            outcome.undecided or (limits.max_nodes is None and outcome.nodes >= self.at_limit)
        ):
            outcome.stopped = Stop(StopReason.AT_LIMIT, outcome.nodes, unexamined=waiting)
        elif limits.over:
            outcome.stopped = Stop(StopReason.TIME_LIMIT, unexamined=waiting)
        elif outcome.nodes % REPORT_EVERY == 0:
            self.report()
        return outcome.stopped is not None

    def report(self, share: float = 0.0) -> None:
        """Tell that so much more of the tree is done, and how many nodes were examined."""
        outcome = self.outcome
        self.covered += share
        if self.progress is None:
            tell(f"{outcome.nodes:,} nodes")
        else:
            seconds = time.perf_counter() - self._start
            self.progress(SearchProgress(outcome.nodes, self.covered, len(outcome.solutions), seconds, outcome.resumed))

    def relax(self, item: TreeNode) -> Relaxation:
        """The relaxation, solved or stalled."""
        self.outcome.qps += 1
        return self.relaxations.of(item)
