"""The checker of histories: every search of one step from one start, and that every root's end is a start."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.checker.reports import MAX_FAILURES, HistoryVerificationReport
from enumsol.checker.walk import ProofChecker
from enumsol.condensation.enclosure import enclosure_of
from enumsol.model.restart import SlipStart, afresh, restarted
from enumsol.proof.reading import RefusedError, check_header, numbers_from, quoted, rational_from, same
from enumsol.support.deadlines import heard_by, tell, tell_part
from enumsol.trusted.positions import tangential_positions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from fractions import Fraction

    from enumsol.arithmetic.balls import Ball
    from enumsol.checker.walk import Located
    from enumsol.support.array_types import Floats


@dataclass(frozen=True)
class _DeclaredStep:
    """A step, as a header describes it."""

    alpha: Fraction
    load: Floats | None
    friction: Floats | None


@dataclass
class _Stage:
    """A search of one step from one start, as its record says and as it was checked."""

    step: int
    start: SlipStart
    following: list[int]
    roots: int = 0
    complete: bool = False
    #: The bound of rigid displacements that it rests on.
    within: float | None = None
    #: Balls in which every root leaves the nodes, one for each of the leaves that hold it.
    ends: list[list[Ball]] = field(default_factory=list)


class HistoryChecker(ProofChecker):
    """Checks the proof of a history.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    header : the first record
    checker : type
        Of the checker of root sets that fits the problem.
    progress : callable or None
        Called with the number of leaves checked in a search.
    """

    def __init__(self, problem: Any, header: Any, checker: Any, progress: Callable[[int], object] | None) -> None:
        super().__init__()
        self.problem, self.header, self.checker, self.progress = afresh(problem), header, checker, progress
        self.steps: list[_DeclaredStep] = []
        self.stages: list[_Stage] = []
        self.bases: dict[int, Any] = {}

    def run(self, records: Iterator[Any]) -> HistoryVerificationReport:
        """Check all records after the header.

        Raises
        ------
        ProofFormatError
            The content is not a sequence of records.
        """
        complete, unique, within = False, 0, None
        with self.refusing():
            count = self._read_header()
            _ = self.problem.on_springs.enclosure  # made once, for all searches
            for number in range(count):
                self._stage(number, count, records)
            if not same(next(records, None), {"stages": count}):
                raise RefusedError("the end of the proof is missing")
            self.check_end(records)
            complete, unique, within = self._conclusions()
        ok = not self.failures
        numbers = range(1, len(self.steps) + 1)
        stages = tuple(sum(stage.step == k for stage in self.stages) for k in numbers)
        roots = tuple(sum(stage.roots for stage in self.stages if stage.step == k) for k in numbers)
        failures = tuple(self.failures)
        return HistoryVerificationReport(
            ok, failures, len(self.steps), stages, roots, ok and complete, unique if ok else 0, within if ok else None
        )

    # -- records ---------------------------------------------------------------------------------------------------

    def _read_header(self) -> int:
        """Read the steps; the number of searches."""
        header = self.header
        check_header(header, self.problem, "history", {"steps", "stages"})
        if not isinstance(header["steps"], list) or not header["steps"] or type(header["stages"]) is not int:
            raise RefusedError("the header has no steps")
        try:
            self.steps = [self._step(said) for said in header["steps"]]
        except (ValueError, TypeError) as error:
            raise RefusedError(f"the header cannot be read: {error}") from None
        return int(header["stages"])

    def _step(self, said: Any) -> _DeclaredStep:
        alpha, load, friction = said
        shape = self.problem.slip_offset.shape
        size = int(np.prod(shape))
        given = None if load is None else numbers_from(load, self.problem.n)
        coefficients = None if friction is None else numbers_from(friction, size).reshape(shape)
        if coefficients is not None and np.any(coefficients < 0):
            raise ValueError("a coefficient of friction is negative")
        return _DeclaredStep(rational_from(alpha), given, coefficients)

    def _stage(self, number: int, count: int, records: Iterator[Any]) -> None:
        stage = self._said(number, count, next(records, None))
        self.stages.append(stage)
        step = self.steps[stage.step - 1]
        problem = restarted(self._base(stage.step), stage.start)
        checker = self.checker(problem, self.progress)
        checker.enclosure, checker.located = enclosure_of(problem), {}
        tell("searches", number, count)
        with heard_by(tell_part(f"of search {number + 1}")):
            report = checker.run(search_records(records))
        where = f"search {number} (step {stage.step})"
        self.failures += [f"{where}: {failure}" for failure in report.failures]
        if len(self.failures) >= MAX_FAILURES:
            raise RefusedError(f"the check ends after {MAX_FAILURES} failures")
        if report.failures:
            return
        if report.alpha != step.alpha:
            raise RefusedError(f"{where} is about another alpha than its step")
        if report.data != "problem" and stage.step < len(self.steps):
            return  # nothing is known of where its roots are
        checker.locate_rational_roots()
        stage.roots, stage.complete = report.roots, report.complete and not report.families
        stage.within = report.within

        def end(leaf: Located) -> Ball:
            about = problem, step.alpha, leaf.forces, leaf.still, stage.start.ball, leaf.codes
            return tangential_positions(*about, rigid=leaf.rigid, among=leaf.among, share=0.5)

        stage.ends = [[end(leaf) for leaf in leaves] for leaves in checker.located_roots()]

    def _said(self, number: int, count: int, record: Any) -> _Stage:
        """Stage that a record describes."""
        shape = self.problem.slip_offset.shape
        size = int(np.prod(shape))
        try:
            kind, step, mid, rad, following = record
            offset = numbers_from(mid, size).reshape(shape)
            radius = None if rad is None else numbers_from(rad, size).reshape(shape)
        except (ValueError, TypeError) as error:
            raise RefusedError(f"search {number} cannot be read: {quoted(record)} ({error})") from None
        later = isinstance(following, list) and all(type(k) is int and number < k < count for k in following)
        exists = kind == "s" and type(step) is int and 1 <= step <= len(self.steps)
        if not later or not exists or (radius is not None and not np.all(radius >= 0)):
            raise RefusedError(f"search {number} has a step, a radius or a list of what follows that cannot be")
        return _Stage(step, SlipStart(offset, radius), following)

    def _base(self, number: int) -> Any:
        """The problem with the load and the friction of a step."""
        if number not in self.bases:
            step = self.steps[number - 1]
            start = SlipStart.of(self.problem)
            self.bases = {number: restarted(self.problem, start, step.load, step.friction)}
        return self.bases[number]

    # -- what follows ----------------------------------------------------------------------------------------------

    def _conclusions(self) -> tuple[bool, int, float | None]:
        """True if these are all histories, up to which step there is one only, and within which rigid displacements."""
        first = [stage for stage in self.stages if stage.step == 1]
        if len(first) != 1 or first[0].start.key != SlipStart.of(self.problem).key:
            raise RefusedError("the first step does not start from the problem's own slip offset")
        for number, stage in enumerate(self.stages):
            if any(self.stages[k].step != stage.step + 1 for k in stage.following):
                raise RefusedError(f"search {number} is followed by one of another step than the next")
        last, reached = len(self.steps), list(self._reached(first[0]))
        complete = all(stage.complete and (stage.step == last or self._all_followed(stage)) for stage in reached)
        # the least of the bounds: within it no step lacks a root
        within = min((stage.within for stage in reached if stage.within is not None), default=None)
        unique, stage = 0, first[0]
        while stage.complete and stage.roots == 1:
            unique += 1
            if stage.step == last or len(stage.following) != 1 or not self._all_followed(stage):
                break
            stage = self.stages[stage.following[0]]
        return complete, unique, within

    def _reached(self, first: _Stage) -> Iterator[_Stage]:
        """The stages that histories come to."""
        pending, seen = [self.stages.index(first)], set()
        while pending:
            number = pending.pop()
            if number not in seen:
                seen.add(number)
                pending += self.stages[number].following
                yield self.stages[number]

    def _all_followed(self, stage: _Stage) -> bool:
        """True if every root of a stage leaves the nodes in the ball of a start that follows.

        All leaves that hold a root have its end in their balls, so that any of these balls shows it.
        """
        starts = [self.stages[k].start for k in stage.following]
        return len(stage.ends) >= stage.roots and all(
            any(start.holds(ball) for start in starts for ball in balls) for balls in stage.ends
        )


def search_records(records: Iterator[Any]) -> Callable[[], Iterator[Any]]:
    """Reader of the records of the next search: up to the object that ends it."""
    lines: list[Any] = []
    for record in records:
        lines.append(record)
        if isinstance(record, dict) and len(lines) > 1:
            return lambda: iter(lines)
    raise RefusedError("the proof breaks off within a search")
