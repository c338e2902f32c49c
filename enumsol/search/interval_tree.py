"""The tree search over one piece of the interval (theory, section 7.8).

Beside the relaxation over the piece that at its middle is solved. A partial assignment that is empty at the middle but
not proven empty over the whole piece fails for the length of the piece: it is left to the halves, unless a few nodes
more settle it. So no tree grows beyond a multiple of the tree at one alpha, and pieces are only as short as they must.

The roots of a tree are what was left by the tree over a longer piece. The search comes to them from what they have in
common, so that relaxations start from those of their ancestors, and an ancestor's multipliers may exclude many at once.
"""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.model.statuses import CONTACT, OPEN, UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine, IntervalSystem, PieceForm
from enumsol.search.nodes import Relaxations, ascended
from enumsol.search.splitting import ImposedRows, PlaneSplitting, branching_node
from enumsol.support.deadlines import Deadline, TimeOverError, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.relaxation.engine import Relaxation
    from enumsol.support.array_types import Codes, Floats, Indices

#: Nodes by which a partial assignment that is empty at the middle may be settled before it is left to the halves.
TRIED_AT_ONCE = 2
#: Nodes spent at the end on all that is to be left: without anything left there are no halves, which cost as much.
TRIED_AT_THE_END = 128
#: Nodes of one tree, after which the rest of it goes to further trees over the same piece.
LARGEST_TREE = 4096
#: A tree that leaves so many subtrees more than two for each of its roots is given up.
MOST_CUT = 192
#: Nodes of one tree, after which a form is tried in place of the energy.
FORM_AFTER = 2048


class EmptyLeaf(NamedTuple):
    """A partial assignment that holds no solution on a piece, with the multipliers that prove it.

    Attributes
    ----------
    codes : status codes, CONTACT and UNDECIDED included
    rows : int array, kind * p + node with the kinds of RowKind and IntervalRowKind
    values : float array, multipliers in the scaling of the piece's IntervalSystem
    form : (4, p) array or None
        Multipliers of the form whose bound they prove (theory, section 5.8); None for the energy.
    """

    codes: Codes
    rows: Indices
    values: Floats
    form: Floats | None = None


@dataclass(frozen=True, eq=False)
class PairedTerms:
    """The form (D lambda)'(S lambda - g) with D of (5.12), that does not depend on the piece.

    D maps (lambda_n, lambda_t) of a node to (mu lambda_n + nu lambda_t, delta lambda_n + s lambda_t). The form is at
    most zero at every solution for any friction F with |delta| <= F s.

    Attributes
    ----------
    terms : (4, p) array
        mu, nu, delta and s of every node.
    """

    terms: Floats

    @classmethod
    def of(cls, multipliers: Floats, F: Floats) -> PairedTerms:
        """The form of multipliers mu, nu, alpha and beta (theory, section 5.8) with coefficients F."""
        mu, nu, alpha, beta = multipliers
        return cls(np.stack([mu, nu, F * (beta - alpha), alpha + beta]))

    def multipliers(self, F: Floats) -> Floats:
        """mu, nu, alpha and beta with other coefficients, which are at least as large."""
        mu, nu, delta, s = self.terms
        return np.stack([mu, nu, np.maximum(0.5 * (s - delta / F), 0.0), np.maximum(0.5 * (s + delta / F), 0.0)])


@dataclass(frozen=True, slots=True)
class Subtree:
    """A partial assignment to be searched below.

    Attributes
    ----------
    codes : status codes
    left : int
        How many pieces in a row have left it to their halves.
    form : PairedTerms or None
        The form with which it was searched last.
    """

    codes: Codes
    left: int = 0
    form: PairedTerms | None = field(default=None, compare=False, repr=False)


@dataclass
class TreeResult:
    """Result of one tree over a piece; together its parts cover all selections below its roots.

    Attributes
    ----------
    empty : list of EmptyLeaf
    selections : list of codes
        Complete selections that were not excluded.
    cut : list of Subtree
        Left to the halves of the piece.
    rest : list of Subtree
        Not examined, since the tree reached its largest size or a limit.
    nodes : int
        Relaxations over the piece and at its middle.
    checkable : bool
        Whether a checker can repeat what was excluded.
    """

    empty: list[EmptyLeaf] = field(default_factory=list)
    selections: list[Codes] = field(default_factory=list)
    cut: list[Subtree] = field(default_factory=list)
    rest: list[Subtree] = field(default_factory=list)
    nodes: int = 0
    checkable: bool = True


def _program(system: IntervalSystem, form: PieceForm | None = None) -> Relaxations:
    """Relaxations over one piece, or at one alpha."""
    splitting = PlaneSplitting(system.F, least=system.F_lo)
    return Relaxations(ActiveSetEngine.over(system, form), splitting, system.p)


@dataclass(slots=True)
class _Item:
    """A node of the tree that waits to be examined.

    Attributes
    ----------
    codes : status codes
    over, middle : Relaxation or None
        Those of the parent, over the piece and at its middle.
    changed : contact nodes at which the codes differ from the parent's
    last : bool
        The last of its siblings: may take over the parent's states.
    roots : list of Subtree
        The roots of the tree at and below this node; at or below a root one only.
    above : bool
        The node is above its roots.
    forced : see TreeNode
    """

    codes: Codes
    over: Relaxation | None
    middle: Relaxation | None
    changed: tuple[int, ...]
    last: bool
    roots: list[Subtree]
    above: bool
    forced: tuple[int, ...] | None


class SubintervalTree:
    """Trees over one piece.

    Parameters
    ----------
    system : IntervalSystem
        Of the piece.
    middle : IntervalSystem or None
        At its middle; None for a piece that is not to be cut.
    excluded : callable
        Whether a leaf is proven empty on the whole piece.
    convex : callable or None
        Whether a form of these multipliers is proven convex on the piece; None: forms are not to be used.
    long : bool
        Trees over the piece may be given up.
    """

    def __init__(
        self,
        system: IntervalSystem,
        middle: IntervalSystem | None,
        excluded: Callable[[EmptyLeaf], bool],
        convex: Callable[[Floats], bool] | None = None,
        *,
        long: bool = False,
    ) -> None:
        self._system, self._at_middle, self._long = system, middle, long
        self._excluded, self._convex = excluded, convex
        self._result = TreeResult()
        self._form: PairedTerms | None = None
        self._multipliers: Floats | None = None
        self._over, self._middle = _program(system), None if middle is None else _program(middle)

    def run(self, roots: Sequence[Subtree], max_nodes: int, deadline: float | None = None) -> TreeResult:
        """Search below the roots, which are leaves of one tree, until a limit is reached."""
        self._result = result = TreeResult()
        self._use(roots[0].form)
        tried = self._convex is None
        stack = [_first(roots)]
        while stack:
            if not tried and result.nodes >= FORM_AFTER:
                tried = True
                if self._use(self._better_form(deadline)):
                    self._result = result = TreeResult(nodes=result.nodes)
                    stack = [_first(roots)]
            if result.nodes >= max_nodes or (deadline is not None and time.perf_counter() > deadline):
                for item in reversed(stack):
                    left = item.roots if item.above else [Subtree(item.codes, item.roots[0].left)]
                    result.rest += self._with_form(left)
                return result
            item = stack.pop()
            children = self._examine(item, self._middle)
            if children and children[0].middle is not None and children[0].middle.pruned and not item.above:
                # empty at the middle
                if not self._settled(children[::-1], TRIED_AT_ONCE):
                    result.cut.append(Subtree(item.codes, item.roots[0].left + 1, self._form))
                    if self._long and len(result.cut) > MOST_CUT + 2 * len(roots):
                        # the halves of the piece fare better from the beginning
                        return TreeResult(cut=self._with_form(roots), nodes=result.nodes)
                continue
            stack += children[::-1]
        self._try_again(max_nodes)
        return result

    def _better_form(self, deadline: float | None) -> PairedTerms | None:
        """A form that is tighter than the energy; None: there is none, or no time to find it."""
        try:
            with within(Deadline(deadline)):
                return better_form(self._system)
        except TimeOverError:
            return None

    def _with_form(self, roots: Sequence[Subtree]) -> list[Subtree]:
        return [Subtree(root.codes, root.left, self._form) for root in roots]

    def _use(self, form: PairedTerms | None) -> bool:
        """Solve relaxations with a form in place of the energy; whether it is convex."""
        if form is self._form:
            return form is not None
        middle = self._at_middle
        multipliers = over = at_middle = None
        if form is not None and self._convex is not None:
            multipliers = form.multipliers(self._system.F_lo)
            over = PieceForm.of(self._system, multipliers) if self._convex(multipliers) else None
        if form is None or over is None:
            form = multipliers = None
        elif middle is not None:
            at_middle = PieceForm.of(middle, form.multipliers(middle.F_lo))
        self._form, self._multipliers = form, multipliers
        self._over = _program(self._system, over)
        self._middle = None if middle is None else _program(middle, at_middle)
        return form is not None

    def _try_again(self, max_nodes: int) -> None:
        """A last attempt at what is to be left to the halves, if it is little."""
        tried, self._result.cut = self._result.cut, []
        for subtree in tried:
            # left so often in a row, some alpha may be an event of it: twice as many nodes every further time
            nodes = TRIED_AT_THE_END * 2 ** max(0, subtree.left - 2) // len(tried)
            nodes = min(nodes, max_nodes - self._result.nodes)
            if nodes < 4 * TRIED_AT_ONCE or not self._settled([_first([subtree])], nodes):
                self._result.cut.append(subtree)

    def _settled(self, stack: list[_Item], nodes: int) -> bool:
        """Search a stack of nodes to its end without looking at the middle; if that takes too many, nothing is kept."""
        result = self._result
        before, kept = result.nodes, (len(result.empty), len(result.selections))
        # every node that waits takes one at least
        while stack and result.nodes - before + len(stack) <= nodes + 1:
            stack += self._examine(stack.pop(), None)[::-1]
        if stack:
            del result.empty[kept[0] :], result.selections[kept[1] :]
        return not stack

    def _examine(self, item: _Item, middle: Relaxations | None) -> list[_Item]:
        """Settle one node of the tree, or give its children in the order in which they are examined."""
        result = self._result
        result.nodes += 1
        over: Relaxation | None = self._over.below(item.over, item.codes, item.changed, last=item.last)
        assert over is not None
        if over.pruned and self._empty(item, over):
            return []
        if over.pruned or over.stalled:
            # no other engine handles intervals: branched on without its minimiser
            over = None
        at_middle = None
        if middle is not None:
            at_middle = item.middle
            # what is empty at the middle is so with more statuses too
            if at_middle is None or not at_middle.pruned:
                result.nodes += 1
                at_middle = middle.below(at_middle, item.codes, item.changed, last=item.last)
                at_middle = None if at_middle.stalled else at_middle
        if item.above:
            return _towards_roots(item, over, at_middle)
        guide = over if at_middle is None or at_middle.pruned else at_middle
        node, forced = branching_node(item.codes, item.forced, guide)
        if node < 0:
            result.selections.append(item.codes)
            return []
        found, children = [], self._over.splitting.children(item.codes, node, guide)
        for k, code in enumerate(children):
            codes = (*item.codes[:node], code, *item.codes[node + 1 :])
            last = k + 1 == len(children)
            found.append(_Item(codes, over, at_middle, (node,), last, item.roots, above=False, forced=forced))
        return found

    def _empty(self, item: _Item, over: Relaxation) -> bool:
        """True if the relaxation proves the node empty, or all roots below it; roots that it does are taken out."""
        rows, values = over.multipliers()
        waiting = []
        for root in item.roots if item.above else [item]:
            leaf = EmptyLeaf(root.codes, rows, values, self._multipliers)
            if self._excluded(leaf):
                self._result.empty.append(leaf)
            else:
                waiting.append(root)
        if item.above:
            item.roots = [root for root in waiting if isinstance(root, Subtree)]
        return not waiting


def better_form(system: IntervalSystem) -> PairedTerms | None:
    """A form that is clearly tighter than the energy over the piece; None: there is none.

    It is sought for the load at the middle and the least friction of the piece, with which it is used. Where that is
    zero at some node none is sought.
    """
    if not np.all(system.F_lo > 0):
        return None
    scaled = replace(system.scaled, g=system.g, F=system.F_lo)
    enclosed = EnclosedSystem.as_computed(scaled.S, scaled.g, scaled.F, exactly=True)
    codes = (UNDECIDED,) * scaled.p
    rows = ImposedRows(PlaneSplitting(scaled.F), scaled.p).over(codes, range(scaled.p))
    engine = ActiveSetEngine(replace(scaled, F=system.F))
    found = ascended(scaled, enclosed, engine, codes, rows)
    return None if found is None else PairedTerms.of(found.multipliers, system.F_lo)


def _first(roots: Sequence[Subtree]) -> _Item:
    """The node from which the search comes to all roots."""
    roots = list(roots)
    codes = _common(roots)
    forced = () if set(codes) == {UNDECIDED} else None
    return _Item(codes, None, None, (), last=False, roots=roots, above=codes != roots[0].codes, forced=forced)


def _common(roots: Sequence[Subtree]) -> Codes:
    """The finest assignment that holds all of these."""
    first = roots[0].codes
    if len(roots) == 1:
        return first
    columns = zip(first, *(root.codes for root in roots[1:]), strict=True)
    return tuple(column[0] if column.count(column[0]) == len(column) else _coarse(column) for column in columns)


def _coarse(codes: Sequence[int]) -> int:
    return UNDECIDED if UNDECIDED in codes or OPEN in codes else CONTACT


def _towards_roots(item: _Item, over: Relaxation | None, middle: Relaxation | None) -> list[_Item]:
    """The children that hold the roots below a node."""
    found, groups = [], _parted(item)
    for k, roots in enumerate(groups):
        codes = _common(roots)
        changed = tuple(i for i, (mine, its) in enumerate(zip(item.codes, codes, strict=True)) if mine != its)
        last = k + 1 == len(groups)
        found.append(_Item(codes, over, middle, changed, last, roots, above=len(roots) > 1, forced=None))
    return found


def _parted(item: _Item) -> list[list[Subtree]]:
    """The roots below a node by their status at a contact node at which they differ and all are finer than it is."""
    columns = zip(item.codes, zip(*(root.codes for root in item.roots), strict=True), strict=True)
    for node, (code, column) in enumerate(columns):
        if code in column:
            continue
        groups = defaultdict(list)
        for root in item.roots:
            own = root.codes[node]
            groups[own if code == CONTACT or own == OPEN else CONTACT].append(root)
        if len(groups) > 1:
            return list(groups.values())
    return [[root] for root in item.roots]
