"""Checker of a branch graph in 3D: every solution over an interval lies on curves, each given by boxes.

Records are those of docs/proof_format.md (8).

What is checked: every curve is one, from end to end; no two have a point in common; the leaves of the tree cover all
solutions, and those of a leaf lie on one of the curves. An end inside the interval is a gap, as an open leaf is.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.checker.graph_checker import GraphChecker, interval_from
from enumsol.checker.reports import GraphVerificationReport
from enumsol.checker.walk import TreeCell
from enumsol.condensation.data import exactly_at
from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.proof.curve_records import CurvePart, OnCurve, ThroughCurveBox, box_from
from enumsol.proof.leaves import Excluded, NoRoot, Unbalanced, UndecidedRecord
from enumsol.proof.reading import RecordError, RefusedError, data_of, numbers_from, quoted, same, units_from
from enumsol.proof.records import Limits, Tree
from enumsol.trusted.space.curve_parts import CurveMotion, LinkParts, arcs_over, in_order, up_to_bound
from enumsol.trusted.space.curve_runs import apart, chain_of
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.sector_rows import UNDECIDED, is_sector_covering
from enumsol.trusted.space.solution_curve import AlphaProblem, only_curve
from enumsol.trusted.space.space_uniqueness import is_complete

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.checker.walk import Test
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.proof.records import Record
    from enumsol.trusted.space.curve_parts import Place, Run, Turn
    from enumsol.trusted.space.curve_runs import CurveChain, CurveLink
    from enumsol.trusted.space.solution_curve import CurveBox, SolutionCurve

    Array = NDArray[np.float64]
    Codes = tuple[int, ...]


#: More boxes of one curve than this are no honest proof's.
_MOST_BOXES = 1 << 20
_NOT_FINAL = "its statuses are not final"


@dataclass
class SpaceGraphChecker(GraphChecker):
    """Checks the records of a graph's proof in 3D: curves, then a tree over the interval.

    Attributes
    ----------
    curves : list of CurveChain
        Each is proven to be one.
    arcs : int or None
    gaps : list of (low, high)
    """

    trees = Tree.PIECE, Tree.FLOATING_PIECE
    of_tree = " of the tree over alpha"

    curves: list[CurveChain] = field(default_factory=list)
    arcs: int | None = 0
    gaps: list[tuple[Fraction, Fraction]] = field(default_factory=list)
    #: The curve of every box, and which one of its links it is; the piece of the cell that is looked at.
    _boxes: list[tuple[CurveChain, int]] = field(default_factory=list)
    _over: AlphaPiece = field(init=False)

    def _report(self) -> GraphVerificationReport:
        return GraphVerificationReport(pieces=1, arcs=self.arcs, open=len(self.gaps), curves=len(self.curves))

    def _check(self, records: Iterator[Any]) -> None:
        units, steps = self._read_units()
        assert self.interval is not None
        # of a body that nothing holds that of the body on springs
        enclosure = replace(CondensedEnclosure.from_problem(self.problem.on_springs), problem=self.problem)
        given = AlphaProblem.of(enclosure, steps)
        record = next(records, None)
        while isinstance(record, dict) and record.keys() == {"curve"}:
            self._curve(given, record["curve"], records)
            record = self._cuts(next(records, None), records)
        self._compare()
        if not same(record, {"tree": True}):
            raise RefusedError("the tree over alpha is missing")
        low, high = self.interval
        # conditions of leaves and curves are those within the bound of the rigid displacement
        self.bounded = not self.problem.held
        self._boxes = [(chain, k) for chain in self.curves for k in range(len(chain.links))]
        self._over = AlphaPiece(AlphaSpace(enclosure, (low + high) / 2, units), low, high)
        self._walk(records, [TreeCell((UNDECIDED,) * self.problem.p, self.interval)])
        self.gaps += [gap for chain in self.curves for gap in chain.gaps]
        if self.progress is not None:
            self.progress(self.leaves)
        claim = {"curves": len(self.curves), "arcs": self.arcs, "leaves": self.leaves, "gaps": len(self.gaps)}
        self._check_counts(next(records, None), claim, "records", records)

    @cached_property
    def _tangents(self) -> list[int]:
        """Number of tangents with friction anywhere in the interval, node by node."""
        pairs = zip(self.problem.friction, self.problem.friction_slope, strict=True)
        ends = [[exactly_at(end, *pair) for end in self.interval or ()] for pair in pairs]
        occurs = [[max(values) > 0 for values in zip(*both, strict=True)] for both in ends]
        return [one + other for one, other in zip(*occurs, strict=True)]

    def _covers(self, node: int, code: int, children: list[int]) -> bool:
        return is_sector_covering(code, children, self._tangents[node])

    def _limits(self, codes: Codes, kind: type[Record] | None = None) -> Limits:
        components, boxes = len(codes) + sum(self._tangents), len(self._boxes)
        return Limits(codes, self.tree, components=components, modes=self.problem.modes.r, boxes=boxes)

    # -- the tree --------------------------------------------------------------------------------------------------

    def _declare(self, record: list[Any]) -> None:
        raise RefusedError(f"unknown kind of record {quoted(record[0])}")

    def _leaf(self, cell: TreeCell, record: list[Any]) -> str | None:
        if cell.piece is not None and cell.piece != (self._over.low, self._over.high):
            self._over = self._over.over(*cell.piece)
        return super()._leaf(cell, record)

    @cached_property
    def tests(self) -> dict[type[Record], Test]:
        """Tests of leaves, by their kinds."""
        return {
            Excluded: self._excluded,
            Unbalanced: self._unbalanced,
            NoRoot: self._no_root,
            OnCurve: self._on_curve,
            ThroughCurveBox: self._through_box,
            UndecidedRecord: self._undecided,
        }

    def _undecided(self, codes: Codes, said: UndecidedRecord) -> str | None:
        self.gaps.append((self._over.low, self._over.high))
        return None if isinstance(said.reason, str) else "its reason is not a text"

    def _excluded(self, codes: Codes, said: Excluded) -> str | None:
        return None if said.holds(self._over, codes) else "its multipliers do not exclude it"

    def _unbalanced(self, codes: Codes, said: Unbalanced) -> str | None:
        return None if said.holds(self._over, codes) else "forces may be in balance"

    def _no_root(self, codes: Codes, said: NoRoot) -> str | None:
        if not is_complete(self._over.whole, codes):
            return _NOT_FINAL
        return None if self._over.narrowed(codes)[1] is None else "it is not proven to hold no root"

    def _on_curve(self, codes: Codes, said: OnCurve) -> str | None:
        by_form = said.numbers is not None
        if not by_form and not is_complete(self._over.whole, codes):
            return _NOT_FINAL
        where = "it is not proven that all its solutions lie on its curve"
        where = where if by_form else "its roots are not proven to lie in its boxes"
        return None if said.holds(self._over, codes, self._boxes) else where

    def _through_box(self, codes: Codes, said: ThroughCurveBox) -> str | None:
        if not is_complete(self._over.whole, codes):
            return _NOT_FINAL
        met = self.interval is not None and said.holds(self._over, codes, self._boxes, self.interval)
        return None if met else "its roots are not proven to be an arc through its box"

    # -- header and curves -----------------------------------------------------------------------------------------

    def _read_units(self) -> tuple[tuple[Array, Array], Array]:
        """Read the header."""
        if data_of(self.header, cast("Any", self.problem), "graph") != "problem":
            raise RefusedError("a proof about a problem in 3D certifies the problem's own data only")
        try:
            self.interval = interval_from(self.header.get("interval"))
            return _units_and_steps(self.header, self.problem, self.interval)
        except ValueError as error:
            raise RefusedError(f"the header cannot be read: {error}") from None

    def _curve(self, given: AlphaProblem, count: object, records: Iterator[Any]) -> None:
        number = len(self.curves) + 1
        if type(count) is not int or not 0 < count <= _MOST_BOXES:
            raise RefusedError(f"curve {number} has {quoted(count)} boxes")
        limits, found = self._limits((UNDECIDED,) * self.problem.p), []
        for _ in range(2 * count + 1):
            try:
                found.append(box_from(next(records, None), limits))
            except ValueError as error:
                raise RefusedError(f"curve {number} cannot be read: {error}") from None
        assert self.interval is not None
        chain = chain_of(given, found[1::2], found[::2], self.interval)
        if chain is None:
            raise RefusedError(f"curve {number} is not proven to be one from end to end")
        self.curves.append(chain)

    def _cuts(self, record: object, records: Iterator[Any]) -> Any:
        """Read the arcs into which the last curve is cut, if its record says so; gives the record that follows."""
        if not same(record, {"parts": True}):
            self.arcs = None
            return record
        assert self.interval is not None
        chain = self.curves[-1]
        parts = parts_of(chain, records, self._limits((UNDECIDED,) * self.problem.p))
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


def parts_of(chain: CurveChain, records: Iterator[Any], limits: Limits) -> list[Run | Turn]:
    """The runs and turns of a curve, each of them proven.

    Raises
    ------
    RefusedError
        A record is no part, or does not prove what it says.
    """
    joined = zip(chain.links, chain.joints[:-1], chain.joints[1:], strict=True)
    links = (up_to_bound(link, LinkCuts(link, records, limits).parts(*ends)) for link, *ends in joined)
    found = in_order(links, closed=chain.closed)
    if found is None:
        raise RefusedError("a curve changes its statuses where two of its boxes meet")
    return found


class LinkCuts(LinkParts):
    """Reads the parts of a link.

    Parameters
    ----------
    link : CurveLink
    records : iterator
    limits : of the problem
    """

    def __init__(self, link: CurveLink, records: Iterator[Any], limits: Limits) -> None:
        super().__init__(link)
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
            curve = self.curve_in(own, start, end)
            if curve is None:
                raise RefusedError("the box of a part of a curve is not proven to hold it")
        if part.kind == "u":
            return [self.left_open(curve, start, end)]
        motion = None if curve is None else CurveMotion(curve)
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
        boxes: Sequence[CurveBox | None],
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
        boxes: Sequence[CurveBox | None],
        deepest: int,
    ) -> list[Run | Turn]:
        """A corner, with what is before and behind it."""
        before, after, near = self._place_in(boxes[0]), self._place_in(boxes[1]), boxes[2]
        if near is not None:
            curve = self.curve_in(near, before, after)
            if curve is None:
                raise RefusedError("the box between two places of a curve is not proven to hold them")
            motion = CurveMotion(curve)
        turn = self.corner(motion, *ends, (before, after)) if changing else None
        if turn is None:
            raise RefusedError("it is not proven that a curve changes its statuses between two places")
        first = self._read(self.curve, ends[0], before, ends[0].codes, deepest - 1)
        return [*first, turn, *self._read(*self.behind(after, ends[1]), deepest - 1)]

    def _place_in(self, box: CurveBox | None) -> Place:
        """A proven place of the curve."""
        point = None if box is None else only_curve(self.problem, box)
        place = self.place_at(point)
        if place is None:
            raise RefusedError("a place is not proven to be on its curve")
        return place
