"""The tree over alpha, statuses and sectors: all solutions lie in boxes around curves (theory, section 12.9)."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.rationals import simplest
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.model.sectors import DEEPEST, SECTORS, level_of, width_level
from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.proof.curve_records import OnCurve
from enumsol.proof.leaves import Excluded
from enumsol.proof.records import Branching, CutPiece
from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.search.certifiers.protocol import ERRORS
from enumsol.search.outcome import StopReason
from enumsol.search.parts import Answer, Spread
from enumsol.search.space.known_curves import Curves, CurveWantedError, around_curves, middle_of, settled, through
from enumsol.search.space.open_leaves import is_swept
from enumsol.search.space.piece_proposals import THETA, AlphaPoint, ExaminedPiece, Passage, exclusion, runs_over
from enumsol.search.space.space_fathoming import without_sectors
from enumsol.search.tree import depth_first
from enumsol.support.deadlines import TimeOverError, look, remaining
from enumsol.trusted.space.leaves import Open, SpaceRoot
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.sector_rows import sector_children

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from concurrent.futures import Executor

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.proof.records import Record
    from enumsol.relaxation.space_relaxation import SpaceRelaxation
    from enumsol.search.parts import TreePart
    from enumsol.support.array_types import Codes, Floats

    #: The record of a node, and its children.
    Done = tuple[Record | "OpenLeaf", list["PieceNode"]]

#: Pieces, and points with their relaxations, that are kept.
_KEPT = 256
#: Pieces are cut down to this share of the interval where only their length stands in the way of a certificate.
_ALONE = 2.0**-5
#: Pieces are cut so often at most between two branchings where multipliers fail at their ends only.
_CUTS = 2
#: Longer pieces are cut where statuses occur along one curve over a part of them.
_SHORT = 2.0**-6
#: Nodes that are examined before workers help, and those of a task of a worker.
NODES = 16


@dataclass(frozen=True)
class OpenLeaf:
    """A part of the tree that is not decided.

    Attributes
    ----------
    low, high : Fraction
        The piece of alpha.
    met : bool
        A solution at the middle of the piece lies in no box.
    """

    low: Fraction
    high: Fraction
    met: bool = False


@dataclass(frozen=True, slots=True)
class PieceNode:
    """A node of the tree: a subtree that waits.

    Attributes
    ----------
    low, high : Fraction
        The piece of alpha.
    codes : the partial assignment
    share : float
        Its share of the tree, every child of a node being as large as the others.
    parent : (AlphaPoint, SpaceRelaxation) or None
        The relaxation from which it goes on.
    changed : the contact node that is new in it, or -1
    last : the last of its siblings: may take over the parent's state
    cuts : how often its piece was cut since the last branching
    """

    low: Fraction
    high: Fraction
    codes: Codes
    share: float = 1.0
    parent: tuple[AlphaPoint, SpaceRelaxation] | None = None
    changed: int = -1
    last: bool = False
    cuts: int = 0

    def sent(self) -> PieceNode:
        """Node as it is sent to a worker, where it begins without its parent."""
        return replace(self, parent=None, changed=-1, last=False)


def _is_excluded(relaxation: SpaceRelaxation) -> bool:
    return relaxation.pruned and relaxation.bound > PRUNE_MARGIN


class PieceTree:
    """Covers all solutions over an interval of alpha by curves in boxes, as far as it can.

    Parameters
    ----------
    enclosure : CondensedEnclosure
        The problem's own.
    units : force and length, (p,) arrays of powers of two
    curves : Curves
        Those that are known over the interval. Where the search would go on with another one it comes back, and says so
        in ``wanted``.
    max_nodes : int, optional
    tick : callable, optional
        Called with the share of the tree that is done, every child of a node being as large as the others.
    smallest : pieces are cut down to this share of the interval

    Attributes
    ----------
    records : list
        Of the tree, in the order of a walk; what is open is an OpenLeaf.
    nodes : int
    covered : float
        The share of the tree that is done.
    settled : bool
        The records are those of the whole tree.
    stopped : StopReason or None
        Why the search ended early, if it did.
    waiting : list of PieceNode
        What is not examined yet, the first one last.
    wanted : CurveWantedError or None
        The curve with which the first node that waits is to be examined, if there is one.
    """

    def __init__(
        self,
        enclosure: CondensedEnclosure,
        units: tuple[Floats, Floats],
        curves: Curves,
        max_nodes: int | None = None,
        tick: Callable[[float], object] | None = None,
        smallest: float = 2.0**-30,
    ) -> None:
        interval = self.interval = curves.interval
        self.curves, self.units, self.smallest = curves, units, smallest
        self.space = AlphaSpace(enclosure, sum(interval, Fraction(0)) / 2, units)
        self._most, self._tick = max_nodes, tick
        self._least = Fraction(smallest) * (interval[1] - interval[0])
        self._examined = lru_cache(_KEPT)(lambda low, high: ExaminedPiece(AlphaPiece(self.space, low, high)))
        self._point = lru_cache(_KEPT)(partial(AlphaPoint, self.space))
        self.records: list[Record | OpenLeaf] = []
        self.nodes, self.covered, self.settled = 0, 0.0, False
        self.stopped: StopReason | None = None
        self.waiting = [PieceNode(*interval, (UNDECIDED,) * enclosure.problem.p)]
        self.wanted: CurveWantedError | None = None

    def run(self) -> None:
        """Search the tree, until a limit is reached or a curve is wanted."""
        self.examine(self.waiting, None)

    def end(self) -> None:
        """Leave open what waits."""
        self.leave(self.waiting)
        self.waiting, self.settled = [], True

    def examined(self, items: Sequence[PieceNode], nodes: int) -> list[PieceNode]:
        """Examine so many nodes of subtrees, the last first, or until a limit is reached; the rest still waits."""
        waiting = list(items)
        self.examine(waiting, nodes)
        return waiting

    def examine(self, waiting: list[PieceNode], most: int | None) -> None:
        """Examine so many nodes of what waits, in place: where a step raises an error, its node waits as before."""
        last, self.wanted = None if most is None else self.nodes + most, None
        try:
            depth_first(waiting, self._taken, lambda: self.nodes == last or self.must_stop())
        except TimeOverError:
            self.stop_for_time()
        except CurveWantedError as wanted:
            # it may have taken over its parent's state
            waiting[-1], self.wanted = waiting[-1].sent(), wanted

    def _taken(self, node: PieceNode) -> list[PieceNode]:
        """Examine one node and take note of it; gives its children, the first one last."""
        look()
        record, below = self._step(node)
        self.nodes += 1
        self.records.append(record)
        share = node.share / max(len(below), 1)
        waiting = [replace(child, share=share) for child in reversed(below)]
        self.report(0.0 if below else share)
        return waiting

    @property
    def left(self) -> int | None:
        """Number of nodes that may still be examined; None for any number."""
        return None if self._most is None else max(self._most - self.nodes, 0)

    def must_stop(self) -> bool:
        """Look at the limit of nodes."""
        if self.stopped is None and self.left == 0:
            self.stopped = StopReason.NODE_LIMIT
        return self.stopped is not None

    def stop_for_time(self) -> None:
        """Take note that the time is over."""
        self.stopped = StopReason.TIME_LIMIT

    def take(self, answer: Answer) -> None:
        """Take in what a worker found below some subtrees."""
        self.records += answer.found
        self.nodes += answer.nodes

    def leave(self, items: Sequence[PieceNode]) -> None:
        """Leave subtrees open."""
        self.records += [OpenLeaf(item.low, item.high) for item in reversed(items)]

    def report(self, share: float) -> None:
        """Note that this share of the tree is done."""
        self.covered += share
        if self._tick is not None:
            self._tick(min(self.covered, 1.0))

    def _step(self, node: PieceNode) -> Done:
        """The record of a node, and its children."""
        low, high, codes, cuts = node.low, node.high, node.codes, node.cuts
        at = self._examined(low, high)
        if (done := self._beside_ends(at, codes)) is not None:
            return done
        if node.parent is None:
            third = (high - low) / 3
            point = self._point(simplest(low + third, high - third))
            relaxation = point.root(codes)
        else:
            point, relaxation = node.parent
            if node.changed >= 0:
                rows = point.rows.of(node.changed, codes[node.changed])
                relaxation = relaxation.child(*rows, last=node.last)
        if _is_excluded(relaxation):
            return self._excluded(at, codes, (point, relaxation), cuts)
        if (done := self._certified(at, codes)) is not None:
            return done
        self.curves.sample()
        if self._is_due(codes):
            done = self._leaf(at, codes)
            if done is not None:
                return done
            if (parts := around_curves(at, codes, self.curves.known)) is not None:
                return self._branched(at, codes, parts[0], (point, relaxation), children=parts[1])
            split = self._widest(codes)
        else:
            split = self._promising(codes, relaxation)
        if split < 0:
            return self._leaf(at, codes) or self._halved(at, codes)
        return self._branched(at, codes, split, (point, relaxation))

    @staticmethod
    def _is_due(codes: Codes) -> bool:
        """True if a leaf is to be tested: where sectors are wide that is of no use."""
        levels = [width_level(code - SECTORS) for code in codes if code > SECTORS]
        final = not {CONTACT, UNDECIDED} & set(codes)
        # of wide sectors a test is of no use, the more so where more than two nodes slip
        return final and (not levels or min(levels) >= (5 if len(levels) > 2 else 3))

    def _excluded(self, at: ExaminedPiece, codes: Codes, parent: tuple[AlphaPoint, SpaceRelaxation], cuts: int) -> Done:
        """An assignment that one alpha excludes: over all of the piece, if possible, or it is cut or branched."""
        point, relaxation = parent
        rows, values = point.multipliers(relaxation)
        if at.piece.margin(codes, rows, (values, values), ERRORS) > 0:
            return Excluded(rows, np.stack([values, values])), []
        if (without := at.unbalanced(codes)) is not None:
            return without, []
        ends = self._ends(at, codes)
        possible = [(end, other) for end, other in ends if not _is_excluded(other)]
        if not possible:
            for end, other in ends:
                rows += end.multipliers(other)[0]
            found = exclusion(at.piece, codes, list(dict.fromkeys([*rows, *point.imposed(codes)])))
            if found is not None:
                return found, []
        if self._is_due(codes):
            record = settled(self.curves, at, codes, *at.piece.narrowed(codes))
            if record is not None:
                return record, []
        if cuts < _CUTS:
            return self._halved(at, codes, cuts=cuts + 1)
        for other_parent in possible:
            node = self._promising(codes, other_parent[1])
            if node >= 0:
                return self._branched(at, codes, node, other_parent)
        node = next((i for i, code in enumerate(codes) if code in (CONTACT, UNDECIDED)), self._widest(codes))
        return self._halved(at, codes, cuts=cuts + 1) if node < 0 else self._branched(at, codes, node, None)

    def _ends(self, at: ExaminedPiece, codes: Codes) -> list[tuple[AlphaPoint, SpaceRelaxation]]:
        """The relaxations of an assignment at the ends of a piece; not at one where friction vanishes."""
        ends = [self._point(alpha) for alpha in (at.piece.low, at.piece.high)]
        return [(end, end.root(codes)) for end in ends if np.array_equal(end.system.tau, self.space.fixed.tau)]

    def _promising(self, codes: Codes, relaxation: SpaceRelaxation) -> int:
        """The node that is to be split by a relaxation that is possible; -1 if there is none."""
        node = relaxation.most_promising(codes, relaxation.violations(codes))
        return self._widest(codes) if node < 0 else node

    @staticmethod
    def _widest(codes: Codes) -> int:
        """The node with the widest sector that can be halved; -1 if there is none."""
        sectors = [i for i, code in enumerate(codes) if code > SECTORS and level_of(code - SECTORS) < DEEPEST]
        return min(sectors, key=lambda i: width_level(codes[i] - SECTORS)) if sectors else -1

    def _is_wide(self, piece: AlphaPiece, codes: Codes) -> bool:
        """True if a sector is to be halved rather than the piece: those of short pieces may be narrow."""
        share = float((piece.high - piece.low) / (self.interval[1] - self.interval[0]))
        # wider sectors are halved rather than alpha; those of short pieces may be narrower, by so many levels less
        level = max(6, -np.log2(share) - 8)
        return any(code > SECTORS and width_level(code - SECTORS) < min(level, DEEPEST) for code in codes)

    def _branched(
        self,
        at: ExaminedPiece,
        codes: Codes,
        node: int,
        parent: tuple[AlphaPoint, SpaceRelaxation] | None,
        children: Sequence[int] | None = None,
    ) -> Done:
        """Children of a node, by default as the relaxation has them, which go on from that."""
        if children is None and parent is not None:
            children = parent[0].splitting.children(codes, node, parent[1])
        elif children is None:
            children = sector_children(codes[node], int(np.sum(self.space.fixed.tau[node] >= 0)))
        below = []
        for k, child in enumerate(children):
            there = (*codes[:node], child, *codes[node + 1 :])
            changed = -1 if parent is None else node
            last = k + 1 == len(children)
            below.append(PieceNode(at.piece.low, at.piece.high, there, parent=parent, changed=changed, last=last))
        return Branching(node, list(children)), below

    def _halved(self, at: ExaminedPiece, codes: Codes, cuts: int = 0) -> Done:
        if at.piece.high - at.piece.low <= self._least:
            return OpenLeaf(at.piece.low, at.piece.high), []
        return self._cut(at, codes, at.piece.middle, cuts)

    @staticmethod
    def _cut(at: ExaminedPiece, codes: Codes, alpha: Fraction, cuts: int = 0) -> Done:
        ends = at.piece.low, alpha, at.piece.high
        return CutPiece(str(alpha)), [PieceNode(*both, codes, cuts=cuts) for both in pairwise(ends)]

    def _beside_ends(self, at: ExaminedPiece, codes: Codes) -> Done | None:
        """A cut between places where curves end, which stay open, and what has to be searched; or None."""
        low, high = at.piece.low, at.piece.high
        for begin, end in self.curves.ends:
            if begin <= low and high <= end:
                return OpenLeaf(low, high), []
            alpha = next((alpha for alpha in (begin, end) if low < alpha < high), None)
            if alpha is not None:
                return self._cut(at, codes, alpha)
        return None

    def _certified(self, at: ExaminedPiece, codes: Codes) -> Done | None:
        """A certificate for all that is below an assignment, or a cut of a piece that is too long for one; or None.

        None of a body that nothing holds: the form says nothing about its rigid displacement.
        """
        if not self.space.fixed.held:
            return None
        piece, statuses = at.piece, without_sectors(codes)
        passages = [passage for passage in self._passages(at, statuses) if passage.parts.allowed(statuses)]
        whole = not passages and statuses == codes and self._is_longer(piece, _SHORT)
        if whole and at.ends_within(self.curves.known, statuses):
            return self._halved(at, codes)
        # where two curves have these statuses no form is definite
        if len(passages) != 1 or statuses in at.hopeless:
            return None
        (passage,) = passages
        known, run = self.curves.known[passage.curve], passage.run
        numbers = at.numbers(statuses, passage.parts)
        if numbers is not None and piece.lies_on(known, run, statuses, numbers, THETA):
            before = sum(len(other.links) for other in self.curves.known[: passage.curve])
            return OnCurve(before + run.first, before + run.last, numbers), []
        longer = self._is_longer(piece, _ALONE)
        if longer and at.is_hopeful(statuses, known.over(run, piece.middle, piece.middle)):
            # a leaf may be decided over a longer piece
            done = None if {CONTACT, UNDECIDED} & set(codes) else self._leaf(at, codes)
            return self._halved(at, codes) if done is None or isinstance(done[0], OpenLeaf) else done
        at.hopeless.add(statuses)
        return None

    def _is_longer(self, piece: AlphaPiece, share: float) -> bool:
        """Than a share of the interval."""
        return piece.high - piece.low > Fraction(share) * (self.interval[1] - self.interval[0])

    def _passages(self, at: ExaminedPiece, statuses: tuple[int, ...]) -> list[Passage]:
        """Runs of known curves that pass a piece; where no status is assigned and there are none, one is asked for."""
        low, high = at.piece.low, at.piece.high
        curves = self.curves.known
        for number in range(at.curves, len(curves)):
            known = curves[number]
            at.passages += [Passage(number, run, known.over(run, low, high)) for run in runs_over(known, low, high)]
        at.curves = len(curves)
        if not at.passages and set(statuses) == {UNDECIDED} and not self.curves.sought_enough:
            self.curves.seek(at.piece, self._point(at.piece.middle))
        return at.passages

    def _leaf(self, at: ExaminedPiece, codes: Codes) -> Done | None:
        """A leaf that is decided, or halved; None where statuses are to be split further."""
        piece = at.piece
        narrowed, found = piece.narrowed(codes)
        if (record := settled(self.curves, at, codes, narrowed, found)) is not None:
            return record, []
        if isinstance(found, Open) and not is_swept(found) and self._widest(codes) >= 0:
            return None
        there = piece.point.held(codes)
        if isinstance(there, SpaceRoot):
            number = self.curves.met(piece.point, codes, there)
            if number is None and not self.curves.is_known(middle_of(piece, there)):
                return OpenLeaf(piece.low, piece.high, met=True), []
            passed = found if narrowed.low <= piece.middle <= narrowed.high else None
            if number is not None and passed is not None and narrowed.arc(codes, 2.0, passed) is not None:
                passing = through(self.curves, narrowed, codes, passed, number, (piece.middle, codes, there))
                if passing is not None:
                    return passing, []
        elif self._is_wide(piece, codes) and (there is None or self.curves.box(piece.point, there) is None):
            return None
        return self._halved(at, codes)


@dataclass(frozen=True)
class PieceWorker:
    """All that the search of a subtree depends on where the curves are given.

    A task is a part of the tree. Where another curve is wanted it ends: the calling process looks for that when the
    walk through the tree comes to it, and what lies behind is searched again if a curve is found. So curves and proof
    depend neither on timing nor on the number of workers.

    Attributes
    ----------
    enclosure, units, smallest : as PieceTree takes them
    curves : Curves
        The curves that are known, and for what further ones were asked.
    """

    enclosure: CondensedEnclosure
    units: tuple[Floats, Floats]
    smallest: float
    curves: Curves

    def __call__(self, roots: Sequence[PieceNode], nodes: int) -> Answer:
        """Examine so many nodes, until the time is over or a curve is wanted."""
        # as they were sent, whatever was asked for in an earlier task
        curves = copy.copy(self.curves)
        curves.tried = set(curves.tried)
        tree = PieceTree(self.enclosure, self.units, curves, smallest=self.smallest)
        waiting = tree.examined(roots, nodes)
        rest = [item.sent() for item in waiting]
        return Answer(tree.records, tree.nodes, tree.covered, rest, tree.wanted is not None)


class SpreadPieces(Spread):
    """Searches a tree over alpha with the help of an executor.

    Parameters
    ----------
    executor : Executor
    tree : PieceTree
    """

    def __init__(self, executor: Executor, tree: PieceTree) -> None:
        super().__init__(executor, tree, NODES, remaining)
        self._pieces = tree
        self._stack: list[TreePart] | None = None

    def run(self) -> None:
        """Search the tree, until a limit is reached or a curve is wanted."""
        tree = self._pieces
        if self._stack is None:
            tree.examine(tree.waiting, max(NODES - tree.nodes, 0))
            if tree.wanted is not None or tree.stopped is not None or not tree.waiting:
                return
            self._renew()
            self._stack, tree.waiting = self._begin(tree.waiting), []
        tree.wanted = None
        self._examine(self._stack, lambda: tree.wanted is not None)

    def end(self) -> None:
        """Leave open what no worker has examined."""
        if self._stack is not None:
            self._leave(self._stack)
        self._pieces.end()

    def _worker(self) -> PieceWorker:
        self._sent = self._state
        tree = self._pieces
        return PieceWorker(tree.space.enclosure, tree.units, tree.smallest, tree.curves)

    def _is_current(self, *, afresh: bool) -> bool:
        del afresh
        return self._sent == self._state

    @property
    def _state(self) -> tuple[object, ...]:
        """Facts about the curves that workers are to know, and that change during a search."""
        curves = self._pieces.curves
        return len(curves.known), curves.sampled, curves.sought_enough, curves.final
