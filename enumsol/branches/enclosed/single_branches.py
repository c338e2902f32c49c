"""Pieces of the interval that need no tree: their one branch of solutions is proven to be all (theory, section 7.15).

A branch is followed in floats, selection by selection, and the trusted core tests whether the root of each is the only
solution where it holds; of a body that nothing holds, below assignments that cover all (theory, section 14.16). Then
the selections are traced, and their arcs must join to one chain over the pieces.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from enumsol.branches.enclosed.joining import EventPlaceKind, Joined, join
from enumsol.proof.leaves import Excluded, OnlyReference, Unbalanced
from enumsol.search.certifiers.protocol import ERRORS
from enumsol.search.chains import Chains, Link, LoadedSystem, SelectionCurve
from enumsol.search.interval_tree import EmptyLeaf, Subtree
from enumsol.search.reduction import WeightSource
from enumsol.search.reference_closer import NUMBERS, Cover
from enumsol.search.solvers import Solvers
from enumsol.search.subintervals import ClosedPiece, IntervalWorker, Piece, Task, whole_pieces
from enumsol.selections.float_selections import SIGN_TOLERANCE
from enumsol.support.deadlines import look
from enumsol.trusted.arcs.only_branch import branch_references, only_roots
from enumsol.trusted.floating_bounds import motion_against, without_bound
from enumsol.trusted.over_interval import PieceNumbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.branches.enclosed.cutting import Trace
    from enumsol.branches.enclosed.following import TracedProblem
    from enumsol.support.array_types import Codes
    from enumsol.trusted.arcs.selection_balls import ArcSelection

    Span = tuple[ArcSelection, float, float]
    Record = OnlyReference | Unbalanced | Excluded
    Leaf = tuple[Codes, Record]
    Spans = list[tuple[Codes, float, float]]

#: Halvings of the interval, and of a piece some of whose arcs are not proven to hold all solutions.
_HALVINGS, _VAIN_HALVINGS = 14, 4
#: Alphas at which no numbers are found, after which they are sought no more: so many, and one for so many nodes.
_VAIN, _NODES_FOR_ONE = 2, 16
#: Pieces tried in vain after which none is halved any more: so many, and one for so many nodes. Trees of few nodes are
#: fast, and where there are several solutions nothing comes of smaller pieces.
_VAIN_TRIES = 3
#: The form must be definite by this, so that a checker that rounds otherwise agrees.
_MARGIN = 1e-9
#: Of theta along an arc of a body that nothing holds, one after the other.
_DEGREES = 1, 2, 4, 8
#: Of a tree below an assignment that nothing else excludes.
_MOST_NODES = 4096


@dataclass
class ClosedPieces:
    """Pieces that need no tree.

    Attributes
    ----------
    pieces : mapping of Piece to ClosedPiece
        In order, with the selections that hold somewhere in them.
    traces : list of Trace
        Of these selections, where they survive.
    """

    pieces: dict[Piece, ClosedPiece] = field(default_factory=dict)
    traces: list[Trace] = field(default_factory=list)

    def find(self, traced: TracedProblem, worker: IntervalWorker | None = None) -> None:
        """Find those of a problem, with a worker for what of a body that nothing holds needs a tree.

        Raises
        ------
        TimeOverError
            At the deadline; what was found by then is kept.
        """
        for whole in whole_pieces(*traced.interval, traced.origin):
            for stretch in _stretches(_Proposals(traced, whole, worker).run()):
                look()
                self._add_proven(traced, stretch)

    def _add_proven(self, traced: TracedProblem, stretch: list[_Proposed]) -> None:
        """Keep a stretch if the arcs of its selections are a chain over it, and were tested wherever they run."""
        where: dict[Codes, list[tuple[Fraction, Fraction]]] = {}
        for proposed in stretch:
            for codes, _, _ in proposed.spans:
                where.setdefault(codes, []).append((proposed.piece.a, proposed.piece.b))
        traces: list[Trace] = []
        traced.trace(where, traces)
        ends = stretch[0].piece.a, stretch[-1].piece.b
        origin = traced.origin if traced.origin in ends else None
        joined = join(traces, ends, origin, traced.sharpen, sparing=traced.sparing)
        if _is_chain(joined) and all(_was_tested(joined, proposed) for proposed in stretch):
            self.pieces |= {proposed.piece: proposed.closed for proposed in stretch}
            self.traces += traces


@dataclass
class _Proposed:
    """A piece, its selections and where each was tested."""

    piece: Piece
    numbers: PieceNumbers
    spans: Spans
    leaves: Sequence[Leaf] = ()
    bounded: bool = False

    @property
    def closed(self) -> ClosedPiece:
        """The part that is kept of it."""
        return ClosedPiece(self.numbers, [codes for codes, _, _ in self.spans], self.leaves, self.bounded)


def _stretches(proposals: Sequence[_Proposed]) -> list[list[_Proposed]]:
    """Proposed pieces that touch."""
    found: list[list[_Proposed]] = []
    for proposed in proposals:
        if found and found[-1][-1].piece.b == proposed.piece.a:
            found[-1].append(proposed)
        else:
            found.append([proposed])
    return found


def _is_chain(joined: Joined) -> bool:
    """True if the arcs follow each other from one end to the other."""
    doubtful = joined.reasons or joined.unordered or joined.open
    if doubtful or not joined.arcs or len(joined.places) != len(joined.arcs) + 1:
        return False
    ends = joined.arcs[0].tail.kind, joined.arcs[-1].head.kind
    inner = (one.head is other.tail and one.head.kind is EventPlaceKind.EVENT for one, other in pairwise(joined.arcs))
    return EventPlaceKind.EVENT not in ends and all(inner)


def _was_tested(joined: Joined, proposed: _Proposed) -> bool:
    """True if every arc was tested wherever it may run in a piece."""
    a, b = proposed.piece.a, proposed.piece.b
    spans = {codes: (low, high) for codes, low, high in proposed.spans}
    for arc in joined.arcs:
        low, high = max(a, arc.tail.low), min(b, arc.head.high)
        tested = spans.get(arc.codes)
        if low <= high and (tested is None or not tested[0] <= low <= high <= tested[1]):
            return False
    return True


class _Proposals:
    """Proposals for one side of an alpha at which g vanishes, or for the whole interval.

    Parameters
    ----------
    traced : TracedProblem
    whole : Piece
    worker : IntervalWorker or None
    """

    def __init__(self, traced: TracedProblem, whole: Piece, worker: IntervalWorker | None) -> None:
        self._traced, self._whole, self._worker = traced, whole, worker
        self._side = traced.spans([(whole.a, whole.b)])[0][2]
        held = traced.problem.held
        self._arcs = traced.system(self._side)
        self._system = LoadedSystem(self._arcs, traced.units, None if held else self._root)
        self._chains = Chains(self._system, float(whole.b))
        # how far around a link the test goes, by the length of the interval: its ends are known in floats only
        self._around = 1e-9 * float(whole.b - whole.a)
        ones = np.ones(self._system.p)
        self._numbers = [PieceNumbers(ones, ones, 0.0 * ones)]
        if not held:
            self._numbers = [PieceNumbers(mu * ones, ones, 0.0 * ones, balance, mu) for mu, balance in NUMBERS]
        self._vain = _VAIN + self._system.p // _NODES_FOR_ONE

    def run(self) -> list[_Proposed]:
        """Pieces in order."""
        waiting, found = [(self._whole, _HALVINGS, _VAIN_HALVINGS)], list[_Proposed]()
        tries = _VAIN_TRIES + self._system.p // _NODES_FOR_ONE
        while waiting:
            look()
            piece, halvings, vain = waiting.pop()
            links = self._chains.over(float(piece.a), float(piece.b))
            # selections of a piece: each is traced over the whole of it
            many = links is not None and len(links) > 6 and halvings > 0
            proposed, some = (None, True) if links is None or many else self._tried(piece, links)
            if proposed is not None:
                found.append(proposed)
                continue
            tries -= not many
            if halvings and (many or (vain and some and tries > 0)):
                halves = Piece(piece.a, piece.middle), Piece(piece.middle, piece.b)
                waiting += [(half, halvings - 1, vain if many else vain - 1) for half in halves[::-1]]
        return found

    def _tried(self, piece: Piece, links: Sequence[Link]) -> tuple[_Proposed | None, bool]:
        """A piece with numbers that serve all its arcs; or None, and whether they serve some of them."""
        ends = float(piece.a) - self._around, float(piece.b) + self._around
        spans = [
            (link.codes, max(link.low - self._around, ends[0]), min(link.high + self._around, ends[1]))
            for link in links
        ]
        asked = [(self._traced.selection(codes, self._side), low, high) for codes, low, high in spans]
        if not self._traced.problem.held:
            return self._covered(piece, spans, asked), True
        alone = list[bool]()
        for numbers in self._numbers:
            alone = self._only(asked, numbers)
            if all(alone):
                return _Proposed(piece, numbers, spans), True
        link, some = links[alone.index(False)], any(alone)
        low, high = max(link.low, ends[0]), min(link.high, ends[1])
        for alpha in (0.5 * (low + high), low, high):
            if self._vain == 0:
                break
            found = self._sought(link, alpha)
            self._vain -= found is None
            some = some or found is not None
            if found is not None and np.any(found.nu):
                self._numbers = [*self._numbers[:1], found]
                return (_Proposed(piece, found, spans) if all(self._only(asked, found)) else None), True
        beside = [(asked[0][0], ends[0], ends[0] + self._around), (asked[-1][0], ends[1] - self._around, ends[1])]
        return None, some or any(self._only(beside, self._numbers[0]))

    def _covered(self, piece: Piece, spans: Spans, asked: Sequence[Span]) -> _Proposed | None:
        """A piece of a body that nothing holds, with leaves that leave nothing beside its arcs; or None."""
        system, (low, high) = self._arcs, self._traced.spans([(piece.a, piece.b)])[0][:2]

        ends = system.at(low), system.at(high)

        def unbalanced(codes: Codes) -> Record | None:
            z = motion_against(ends[0], codes, ends[1])
            return Unbalanced(z) if system.unbalanced(codes, low, high, z) else None

        # if possible without the bound of the rigid displacement
        free = without_bound(system.at(low, high)).reach
        for degree in _DEGREES:
            tried = ((one, branch_references(asked, one, ERRORS)) for one in self._of_degree(degree))
            numbers, references = next(((one, found) for one, found in tried if found), (self._numbers[0], []))
            for reach in (free, system.reach) if references else ():
                leaves = Cover(references, reach).leaves(unbalanced, partial(self._searched, piece))
                if leaves is not None:
                    bounded = reach is system.reach or self._need_bound(piece, leaves)
                    return _Proposed(piece, numbers, spans, leaves, bounded)
        return None

    def _searched(self, piece: Piece, codes: Codes) -> list[tuple[Codes, Record]] | None:
        """The leaves of a tree below an assignment in which there is nothing; None where there may be something."""
        if self._worker is None:
            return None
        result = self._worker.run(Task(piece, (Subtree(codes),)), _MOST_NODES)
        if result.selections or result.cut or result.rest:
            return None
        return [(leaf.codes, Excluded(leaf.rows, leaf.values)) for leaf in result.empty]

    def _need_bound(self, piece: Piece, leaves: Sequence[Leaf]) -> bool:
        """True if a leaf of a tree rests on the bound of the rigid displacement."""
        empty = [EmptyLeaf(codes, *said.terms) for codes, said in leaves if isinstance(said, Excluded)]
        worker = self._worker
        needs = (worker is None or worker.leaves.needs_bound(piece, worker.system(piece), leaf) for leaf in empty)
        return any(needs)

    def _of_degree(self, degree: int) -> list[PieceNumbers]:
        return [replace(numbers, degree=degree) for numbers in self._numbers]

    def _root(self, alpha: float) -> Codes | None:
        """The selection of a root of a body that nothing holds."""
        return Solvers(self._traced.problem, Fraction(alpha), "verified", SIGN_TOLERANCE, None).known_root

    def _only(self, asked: Sequence[tuple[ArcSelection, float, float]], numbers: PieceNumbers) -> list[bool]:
        return only_roots(asked, numbers, ERRORS, _MARGIN)

    def _sought(self, link: Link, alpha: float) -> PieceNumbers | None:
        """Numbers that serve at one alpha."""
        p, system = self._system.p, self._system.at(alpha)
        force, w, *_ = SelectionCurve(self._system, link.codes).at(alpha)
        reduction = self._system.reduction(alpha)
        found = reduction.weights(
            force[reduction.places], w[reduction.places], exactly=False, sought=WeightSource.DESCENT
        )
        rubbing = np.flatnonzero(system.F > 0)
        if found is None or np.any(found[p + 3 * len(rubbing) :] > 0):
            return None
        kappa, nu = np.ones(p), np.zeros(p)
        kappa[rubbing], nu[rubbing] = found[p : p + 2 * len(rubbing)].reshape(2, -1)
        return PieceNumbers(found[:p], kappa, nu)
