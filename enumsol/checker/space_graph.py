"""Checker of a branch graph in 3D: every solution over an interval lies on curves, each given by boxes.

Records: a header ``{"format": "enumsol-proof", "version": 2, "kind": "graph", "problem": <fingerprint>, "interval":
[a, b], "p": p, "data": "problem", "force", "length", "steps"}`` with the steps of the coordinates (see AlphaProblem);
for every curve ``{"curve": n}`` with n boxes, and these as ``["w", centre, direction, border, radius, rho, half]``
between n + 1 boxes without length around the points that they share (see ``trusted.space.curve_runs``), and perhaps
how it is cut into arcs (see below);
``{"tree": true}`` and the records of a tree of ``PieceTreeChecker``, whose boxes are numbered in the order of the
curves, points left out; at the end ``{"curves", "arcs", "leaves", "gaps"}``, arcs null where not all curves are cut. Of
a body that nothing holds the header has ``max_rigid_displacement``, too, and boxes have its rigid displacement.

What is checked: every curve is one, from end to end; no two have a point in common; the leaves of the tree cover all
solutions, and those of a leaf lie on one of the curves. An end inside the interval is a gap, as an open leaf is.

How a curve is cut into arcs (theory, section 12.10). Records of a curve: ``{"parts": true}``, then parts in the order
of a walk, those of every box between its two points: ``["s", box]`` (statuses stay and alpha goes one way), ``["f",
box, before, after]`` (statuses stay and alpha turns back once, between two places), ``["c", box, before, after, near]``
(nodes change their statuses between two places, each of them once; the parts before and behind follow), ``["h", box,
middle]`` (both halves follow) and ``["u", box]`` (open). Boxes and places are given as those of a curve are; the first
one may be null where a box is known, the last one of "c" where the part's own box serves.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.checker.graph_checker import END, GraphChecker, interval_from
from enumsol.checker.reports import GraphVerificationReport
from enumsol.condensation.data import exactly_at
from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.proof.curve_records import CurvePart, CutPiece, OnCurve, ThroughCurveBox, box_from
from enumsol.proof.leaves import Excluded, NoRoot, Unbalanced, UndecidedRecord, kind_of
from enumsol.proof.reading import RecordError, RefusedError, data_of, numbers_from, quoted, same, units_from
from enumsol.proof.records import Branching, Limits, Tree
from enumsol.trusted.space.curve_parts import CurveMotion, LinkParts, arcs_over, in_order, up_to_bound
from enumsol.trusted.space.curve_runs import KnownCurve, apart, chain_of
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.sector_rows import UNDECIDED, is_sector_covering
from enumsol.trusted.space.solution_curve import AlphaProblem, only_curve
from enumsol.trusted.space.space_uniqueness import is_complete

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.proof.curve_records import CurveBoxRecord
    from enumsol.proof.records import Record
    from enumsol.trusted.space.curve_parts import Place, Run, Turn
    from enumsol.trusted.space.curve_runs import CurveChain, CurveLink
    from enumsol.trusted.space.solution_curve import SolutionCurve

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


#: More boxes of one curve than this are no honest proof's.
_MOST_BOXES = 1 << 20


class SpaceGraphChecker(GraphChecker):
    """Checks the records of a graph's proof in 3D: see GraphChecker."""

    problem: ContactProblem3D  # type: ignore[assignment]

    def __init__(self, problem: ContactProblem3D, *given: Any) -> None:
        super().__init__(cast("Any", problem), *given)
        self.curves: list[CurveChain] = []
        self.arcs: int | None = 0
        self.gaps: list[tuple[Fraction, Fraction]] = []

    def _report(self) -> GraphVerificationReport:
        return GraphVerificationReport(pieces=1, arcs=self.arcs, open=len(self.gaps), curves=len(self.curves))

    def _check(self, records: Iterator[Any]) -> None:
        units, steps = self._read_units()
        # of a body that nothing holds that of the body on springs
        enclosure = replace(CondensedEnclosure.from_problem(self.problem.on_springs), problem=self.problem)
        given = AlphaProblem.of(enclosure, steps)
        record = next(records, None)
        while isinstance(record, dict) and record.keys() == {"curve"}:
            self._curve(given, record["curve"], records)
            record = self._cuts(given, next(records, None), records)
        self._compare()
        if record != {"tree": True}:
            raise RefusedError("the tree over alpha is missing")
        assert self.interval is not None
        curves = [KnownCurve(given, chain) for chain in self.curves]
        tree = PieceTreeChecker(enclosure, units, curves, self.fail)
        tree.run(*self.interval, records)
        self.leaves = tree.leaves
        self.gaps += [gap for chain in self.curves for gap in chain.gaps] + tree.gaps
        if self.progress is not None:
            self.progress(self.leaves)
        claim = {"curves": len(self.curves), "arcs": self.arcs, "leaves": self.leaves, "gaps": len(self.gaps)}
        self._check_end(next(records, END), claim, "records", records)

    def _read_units(self) -> tuple[tuple[Array, Array], Array]:
        """Read the header."""
        if data_of(self.header, cast("Any", self.problem), "graph") != "problem":
            raise RefusedError("a proof about a problem in 3D certifies the problem's own data only")
        try:
            self.interval = interval_from(self.header.get("interval"))
            return _units_and_steps(self.header, self.problem, self.interval)
        except ValueError as error:
            raise RefusedError(f"the header cannot be read: {error}") from None

    @property
    def _limits(self) -> Limits:
        """Limits of records about boxes around curves."""
        return Limits((UNDECIDED,) * self.problem.p, modes=self.problem.modes.r)

    def _curve(self, given: AlphaProblem, count: object, records: Iterator[Any]) -> None:
        number = len(self.curves) + 1
        if type(count) is not int or not 0 < count <= _MOST_BOXES:
            raise RefusedError(f"curve {number} has {quoted(count)} boxes")
        limits, found = self._limits, []
        for _ in range(2 * count + 1):
            try:
                said = box_from(next(records, None), limits)
            except ValueError as error:
                raise RefusedError(f"curve {number} cannot be read: {error}") from None
            found.append(said.box)
        assert self.interval is not None
        chain = chain_of(given, found[1::2], found[::2], self.interval)
        if chain is None:
            raise RefusedError(f"curve {number} is not proven to be one from end to end")
        self.curves.append(chain)

    def _cuts(self, given: AlphaProblem, record: object, records: Iterator[Any]) -> Any:
        """Read the arcs into which the last curve is cut, if its record says so; gives the record that follows."""
        if not same(record, {"parts": True}):
            self.arcs = None
            return record
        assert self.interval is not None
        chain = self.curves[-1]
        parts = parts_of(given, chain, records, self._limits)
        arcs, gaps = arcs_over(parts, self.interval, closed=chain.closed)
        self.arcs = None if self.arcs is None else self.arcs + arcs
        self.gaps += gaps
        return next(records, None)

    def _compare(self) -> None:
        """Refuse curves that may have a point in common, and so all that they have between the ends of one of them."""
        for k, one in enumerate(self.curves):
            for other in self.curves[:k]:
                if not apart(one, other):
                    self.fail("two curves may be the same")


def _units_and_steps(
    header: dict[str, Any], problem: ContactProblem3D, interval: tuple[Fraction, Fraction]
) -> tuple[tuple[Array, Array], Array]:
    """Units of forces and displacements, and steps of the coordinates."""
    units = units_from(header, problem.p, by_node=True)
    for pair in zip(problem.friction, problem.friction_slope, strict=True):
        if min(min(exactly_at(end, *pair)) for end in interval) < 0:
            raise ValueError("friction is negative in the interval")
    steps = numbers_from(header.get("steps"), 3 * problem.p + problem.modes.r)
    if not np.all(steps > 0):
        raise ValueError("a step is not positive")
    return units, steps


def parts_of(problem: AlphaProblem, chain: CurveChain, records: Iterator[Any], limits: Limits) -> list[Run | Turn]:
    """The runs and turns of a curve, each of them proven.

    Raises
    ------
    RefusedError
        A record is no part, or does not prove what it says.
    """
    joined = zip(chain.links, chain.joints[:-1], chain.joints[1:], strict=True)
    links = (up_to_bound(link, LinkCuts(problem, link, records, limits).parts(*ends)) for link, *ends in joined)
    found = in_order(links, closed=chain.closed)
    if found is None:
        raise RefusedError("a curve changes its statuses where two of its boxes meet")
    return found


class LinkCuts(LinkParts):
    """Reads the parts of a link.

    Parameters
    ----------
    problem : AlphaProblem
    link : CurveLink
    records : iterator
    limits : of the problem
    """

    def __init__(self, problem: AlphaProblem, link: CurveLink, records: Iterator[Any], limits: Limits) -> None:
        super().__init__(problem, link)
        self._records, self._limits = records, limits

    def parts(self, start: SolutionCurve, end: SolutionCurve) -> list[Run | Turn]:
        """From one joint to another one."""
        if None in start.statuses or None in end.statuses:
            raise RefusedError("at a point of a curve that is cut into arcs a status is not known")
        # parts that are cut more often than this are no honest proof's
        return self._read(self.curve, self.place(start), self.place(end), None, 64)

    def _read(
        self, curve: SolutionCurve | None, start: Place, end: Place, codes: Codes | None, deepest: int
    ) -> list[Run | Turn]:
        """Parts between two places; a curve that has both, and the statuses that hold, where they are known."""
        if not deepest:
            raise RefusedError("a curve is cut too often")
        try:
            part = CurvePart.read(next(self._records, None), self._limits)
        except RecordError as error:
            raise RefusedError(f"a part of a curve cannot be read: {error}") from None
        own, *boxes = part.boxes
        if own is not None:
            curve = self.curve_in(own.box, start, end)
            if curve is None:
                raise RefusedError("the box of a part of a curve is not proven to hold it")
        if part.kind == "u":
            return [self.left_open(curve, start, end)]
        motion = None if curve is None else CurveMotion(self.problem, curve)
        changing: Sequence[int] = ()
        if codes is None and motion is not None:
            codes, changing = self.statuses(motion, start, end)
        if part.kind == "h":
            return self._halves(start, self._place_in(boxes[0]), end, codes, deepest)
        if motion is None:
            raise RefusedError("a part of a curve has no box")
        if part.kind == "c":
            return self._changed(motion, (start, end), changing, boxes, deepest)
        return self._unchanged(part.kind, motion, (start, end), codes, boxes)

    def _halves(self, start: Place, middle: Place, end: Place, codes: Codes | None, deepest: int) -> list[Run | Turn]:
        if not self.is_between(start, middle, end):
            raise RefusedError("a curve is cut beside the part that is to be cut")
        first = self._read(None, start, middle, codes, deepest - 1)
        return [*first, *self._read(None, middle, end, codes, deepest - 1)]

    def _unchanged(
        self,
        kind: str,
        motion: CurveMotion,
        ends: tuple[Place, Place],
        codes: Codes | None,
        boxes: Sequence[CurveBoxRecord | None],
    ) -> list[Run | Turn]:
        """A run, or two with a fold between them."""
        found: Sequence[Run | Turn | None] | None = None
        if codes is not None and kind == "s":
            found = [self.run(motion, *ends, codes)]
        elif codes is not None:
            found = self.fold(motion, *ends, codes, (self._place_in(boxes[0]), self._place_in(boxes[1])))
        proven = [part for part in found or () if part is not None]
        if not proven:
            raise RefusedError("it is not proven which way alpha goes along a part of a curve")
        return proven

    def _changed(
        self,
        motion: CurveMotion,
        ends: tuple[Place, Place],
        changing: Sequence[int],
        boxes: Sequence[CurveBoxRecord | None],
        deepest: int,
    ) -> list[Run | Turn]:
        """A corner, with what is before and behind it."""
        before, after, near = self._place_in(boxes[0]), self._place_in(boxes[1]), boxes[2]
        if near is not None:
            curve = self.curve_in(near.box, before, after)
            if curve is None:
                raise RefusedError("the box between two places of a curve is not proven to hold them")
            motion = CurveMotion(self.problem, curve)
        turn = self.corner(motion, *ends, (before, after)) if changing else None
        if turn is None:
            raise RefusedError("it is not proven that a curve changes its statuses between two places")
        first = self._read(self.curve, ends[0], before, ends[0].codes, deepest - 1)
        return [*first, turn, *self._read(*self.behind(after, ends[1]), deepest - 1)]

    def _place_in(self, record: CurveBoxRecord | None) -> Place:
        """A proven place of the curve."""
        point = None if record is None else only_curve(self.problem, record.box)
        place = self.place_at(point)
        if place is None:
            raise RefusedError("a place is not proven to be on its curve")
        return place
