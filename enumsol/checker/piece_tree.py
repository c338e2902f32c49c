"""Checker of trees over alpha in 3D: all solutions over an interval lie on curves in boxes (theory, section 12.9).

A tree is given by its records in the order of a walk: ``["p", alpha]`` (the piece is cut there), ``["b", node, codes]``
(a status is split), and the leaves of ``proof.leaves.leaves_of`` over a piece: no solution; all of them on a curve, in
boxes of it or by one certificate; all of them on one arc, through a box; or nothing, which is a gap.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.data import exactly_at
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.proof.curve_records import CutPiece, OnCurve, ThroughCurveBox
from enumsol.proof.leaves import Excluded, NoRoot, Unbalanced, UndecidedRecord, kind_of
from enumsol.proof.reading import RecordError, RefusedError, quoted
from enumsol.proof.records import Branching, Limits, Tree
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.sector_rows import UNDECIDED, is_sector_covering
from enumsol.trusted.space.space_uniqueness import is_complete

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import CondensedEnclosure
    from enumsol.proof.records import Record
    from enumsol.trusted.space.curve_runs import KnownCurve

    Array = NDArray[np.float64]
    Codes = tuple[int, ...]


@dataclass
class PieceTreeChecker:
    """Checks one tree over an interval.

    Attributes
    ----------
    enclosure : CondensedEnclosure
    units : force and length, (p,) arrays of powers of two
    curves : sequence of KnownCurve
        Each is proven to be one. Their boxes are numbered in this order.
    fail : called with what a leaf does not prove
    leaves : int
    gaps : list of (low, high)
        Pieces of open leaves.
    """

    enclosure: CondensedEnclosure
    units: tuple[Array, Array]
    curves: Sequence[KnownCurve]
    fail: Callable[[str], object]
    leaves: int = 0
    gaps: list[tuple[Fraction, Fraction]] = field(default_factory=list)

    def run(self, low: Fraction, high: Fraction, records: Iterator[Any]) -> None:
        """Check the records of the tree over [low, high]; none is read after its last one.

        Raises
        ------
        RefusedError
            They are no tree.
        """
        problem, self._interval = self.enclosure.problem, (low, high)
        pairs = list(zip(problem.friction, problem.friction_slope, strict=True))
        ends = [[exactly_at(end, *pair) for end in (low, high)] for pair in pairs]
        occurs = [[max(values) > 0 for values in zip(*both, strict=True)] for both in ends]
        self._tangents = [one + other for one, other in zip(*occurs, strict=True)]
        #: The curve of every box, and which one of its links it is.
        self._boxes = [(known, k) for known in self.curves for k in range(len(known.chain.links))]
        waiting: list[tuple[Fraction, Fraction, Codes]] = [(low, high, (UNDECIDED,) * problem.p)]
        space = AlphaSpace(self.enclosure, (low + high) / 2, self.units)
        piece = AlphaPiece(space, low, high)
        while waiting:
            low, high, codes = waiting.pop()
            if (low, high) != (piece.low, piece.high):
                piece = AlphaPiece(space, low, high)
            record = next(records, None)
            if not isinstance(record, list):
                raise RefusedError("the tree over alpha ends before all of it is decided")
            try:
                waiting += self._below(piece, codes, record)[::-1]
            except ValueError as error:
                raise RefusedError(f"leaf {self.leaves + 1} of the tree over alpha: {error}") from None

    def _below(self, piece: AlphaPiece, codes: Codes, record: list[Any]) -> list[tuple[Fraction, Fraction, Codes]]:
        """Cells that a record leaves to those after it; none if it is a leaf, which is checked."""
        kind = record[0] if record else None
        if kind == CutPiece.kind:
            alpha = CutPiece.read(record, Limits(codes)).between(piece.low, piece.high)
            return [(piece.low, alpha, codes), (alpha, piece.high, codes)]
        if kind == Branching.kind:
            split = Branching.covering(record, codes, self._covers)
            return [(piece.low, piece.high, below) for below in split.below(codes)]
        tree = Tree.PIECE if self.enclosure.problem.held else Tree.FLOATING_PIECE
        known = kind_of(record, tree)
        if known is None:
            raise RecordError(f"unknown kind of record {quoted(kind)}")
        components, modes = len(codes) + sum(self._tangents), self.enclosure.problem.modes.r
        leaf = known.read(record, Limits(codes, tree, components=components, modes=modes, boxes=len(self._boxes)))
        self.leaves += 1
        if isinstance(leaf, UndecidedRecord):
            self.gaps.append((piece.low, piece.high))
        elif (why := self._wrong(piece, codes, leaf)) is not None:
            self.fail(f"leaf {self.leaves} of the tree over alpha: {why}")
        return []

    def _covers(self, node: int, code: int, children: list[int]) -> bool:
        return is_sector_covering(code, children, self._tangents[node])

    def _wrong(self, piece: AlphaPiece, codes: Codes, leaf: Record) -> str | None:
        """Sentence on what a leaf does not prove; None if all is proven."""
        if isinstance(leaf, Excluded):
            return None if leaf.holds(piece, codes) else "its multipliers do not exclude it"
        if isinstance(leaf, Unbalanced):
            return None if leaf.holds(piece, codes) else "forces may be in balance"
        by_form = isinstance(leaf, OnCurve) and leaf.numbers is not None
        if not by_form and not is_complete(piece.whole, codes):
            return "its statuses are not final"
        if isinstance(leaf, NoRoot):
            return None if piece.narrowed(codes)[1] is None else "it is not proven to hold no root"
        if isinstance(leaf, OnCurve):
            where = "it is not proven that all its solutions lie on its curve"
            where = where if by_form else "its roots are not proven to lie in its boxes"
            return None if leaf.holds(piece, codes, self._boxes) else where
        if isinstance(leaf, ThroughCurveBox):
            met = leaf.holds(piece, codes, self._boxes, self._interval)
            return None if met else "its roots are not proven to be an arc through its box"
        raise AssertionError(leaf)
