"""Checker of a branch graph in 3D: every solution over an interval lies on curves, each given by boxes.

Records: a header ``{"format": "enumsol-proof", "version": 2, "kind": "graph", "problem": <fingerprint>, "interval":
[a, b], "p": p, "data": "problem", "force", "length", "steps"}`` with the steps of the coordinates (see AlphaProblem);
for every curve ``{"curve": n}`` with n boxes, and these as ``["w", centre, direction, border, radius, rho, half]``
between n + 1 boxes without length around the points that they share (see ``trusted.space.curve_chains``), and perhaps
how it is cut into arcs (see ``checker.curve_cuts``);
``{"tree": true}`` and the records of a tree (see ``checker.piece_tree``), whose boxes are numbered in the order of the
curves, points left out; at the end ``{"curves", "arcs", "leaves", "gaps"}``, arcs null where not all curves are cut. Of
a body that nothing holds the header has ``max_rigid_displacement``, too, and boxes have its rigid displacement.

What is checked: every curve is one, from end to end; no two have a point in common; the leaves of the tree cover all
solutions, and those of a leaf lie on one of the curves. An end inside the interval is a gap, as an open leaf is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.checker.curve_cuts import parts_of
from enumsol.checker.graph_checker import END, GraphChecker, interval_from
from enumsol.checker.piece_tree import PieceTreeChecker
from enumsol.checker.reports import GraphVerificationReport
from enumsol.condensation.data import exactly_at
from enumsol.condensation.enclosure import CondensedEnclosure
from enumsol.proof.curve_records import box_from
from enumsol.proof.reading import RefusedError, data_of, exponents_from, numbers_from, quoted, same
from enumsol.proof.records import Limits
from enumsol.trusted.space.curve_chains import apart, chain_of
from enumsol.trusted.space.curve_parts import arcs_over
from enumsol.trusted.space.curve_runs import KnownCurve
from enumsol.trusted.space.sector_rows import UNDECIDED
from enumsol.trusted.space.solution_curve import AlphaProblem

if TYPE_CHECKING:
    from collections.abc import Iterator
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.trusted.space.curve_chains import CurveChain

    Array = NDArray[np.float64]

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
        tree = PieceTreeChecker(enclosure, units, given, curves, self._fail)
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
                    self._fail("two curves may be the same")


def _units_and_steps(
    header: dict[str, Any], problem: ContactProblem3D, interval: tuple[Fraction, Fraction]
) -> tuple[tuple[Array, Array], Array]:
    """Units of forces and displacements, and steps of the coordinates."""
    force, length = (exponents_from(header.get(key), problem.p) for key in ("force", "length"))
    if len({a + b for a, b in zip(force, length, strict=True)}) != 1:
        raise ValueError("the units are no common scaling of energy")
    for pair in zip(problem.friction, problem.friction_slope, strict=True):
        if min(min(exactly_at(end, *pair)) for end in interval) < 0:
            raise ValueError("friction is negative in the interval")
    steps = numbers_from(header.get("steps"), 3 * problem.p + problem.modes.r)
    if not np.all(steps > 0):
        raise ValueError("a step is not positive")
    return (np.ldexp(1.0, np.array(force)), np.ldexp(1.0, np.array(length))), steps
