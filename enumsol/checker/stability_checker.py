"""The checker of proofs of stability: the roots by their own proof, then what grows or does not at each of them.

What a node does at a root is read off the balls of its forces and displacements, strictly; where these do not tell, the
root stays undecided whatever the proof says. From that trusted code makes the motions that the certificates are about.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.arithmetic.balls import SAFE
from enumsol.checker.history_checker import search_records
from enumsol.checker.reports import StabilityVerificationReport
from enumsol.checker.walk import ProofChecker
from enumsol.condensation.enclosure import enclosure_of
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.model.mesh import checked_mass, mass_fingerprint
from enumsol.proof.reading import RefusedError, check_header, quoted, same
from enumsol.proof.stability_records import (
    DOES_NOT,
    RUNS_AWAY,
    UNDECIDED,
    VERDICTS,
    certificate_from,
    is_certificate,
    part_of,
    root_from,
)
from enumsol.support.messages import counted
from enumsol.trusted.motions_of_body import BodyMotions, friction_directions, friction_over
from enumsol.trusted.running_away import Growing, NoMotion, left_open
from enumsol.trusted.status_rows import OPEN, STICK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.arithmetic.balls import Ball
    from enumsol.checker.reports import VerificationReport
    from enumsol.checker.walk import Located
    from enumsol.support.array_types import Floats
    from enumsol.trusted.motions_of_body import Setting

#: Certificates of one root: K(mu) is kept at the ends of all their ranges.
_MOST_CERTIFICATES = 2_000


@dataclass
class _Said:
    """Words of the proof on a root."""

    number: int
    point: Floats
    verdict: str
    certificates: list[list[Any]]


@dataclass(frozen=True, eq=False)
class _Root:
    """A root by its forces, near where it is, and what every node does there, with bounds of lambda_t in 3D."""

    forces: Floats
    known: tuple[list[int], Floats | None] | None


class StabilityChecker(ProofChecker):
    """Checks the proof of which roots run away.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    header : the first record
    checker : type
        Of the checker of root sets that fits the problem.
    progress : callable or None
        Called with the number of leaves checked.
    mass : (n, n) array_like or sparse, optional
        In place of that of the problem.
    """

    def __init__(
        self, problem: Any, header: Any, checker: Any, progress: Callable[[int], object] | None, mass: Any = None
    ) -> None:
        super().__init__()
        self.problem, self.header, self.checker = problem, header, checker(problem, progress)
        self.mass = None if mass is None else checked_mass(mass, problem.A, problem.modes.N)
        self.report: VerificationReport | None = None

    def run(self, records: Iterator[Any]) -> StabilityVerificationReport:
        """Check all records after the header.

        Raises
        ------
        ProofFormatError
            The content is not a sequence of records.
        """
        verdicts: list[str] = []
        bounds: list[tuple[float, float] | None] = []
        with self.refusing():
            self._read_header()
            roots = self._roots(records)
            said, footer = self._said(records)
            self._check_counts(footer, said, records)
            for own, root in zip(said, self._matched(said, roots), strict=True):
                verdict, growth = self._verdict(own, root)
                verdicts.append(verdict)
                bounds.append(growth)
        ok = not self.failures
        return StabilityVerificationReport(
            ok, tuple(self.failures), tuple(verdicts) if ok else (), tuple(bounds) if ok else (), self.report
        )

    # -- records ---------------------------------------------------------------------------------------------------

    def _read_header(self) -> None:
        check_header(self.header, self.problem, "stability", {"mass"})
        try:
            self.body = BodyMotions(self.problem, self.mass)
        except (InvalidArgumentError, InvalidProblemError) as error:
            raise RefusedError(str(error)) from None
        if self.header["mass"] != mass_fingerprint(self.body.mass):
            raise RefusedError("the proof belongs to another mass (its fingerprint is different)")

    def _roots(self, records: Iterator[Any]) -> list[_Root]:
        """The roots, by the proof that they are all."""
        checker = self.checker
        checker.enclosure, checker.located = enclosure_of(self.problem), {}
        self.report = report = checker.run(search_records(records))
        if report.failures:
            self.failures += [f"roots: {failure}" for failure in report.failures]
            raise RefusedError("the proof of the roots does not hold")
        if report.data != "problem":
            raise RefusedError("the roots are proven for S and g as computed only, which tells nothing of the body")
        checker.locate_rational_roots()
        self.F = friction_over(self.problem, checker.alpha, checker.alpha)
        return [self._root(leaves) for leaves in checker.located_roots()]

    def _root(self, leaves: list[Located]) -> _Root:
        """A root by any of the leaves that tells what every node does."""
        for leaf in leaves:
            if (known := self._statuses(leaf)) is not None:
                return _Root(leaf.forces.mid, known)
        return _Root(leaves[0].forces.mid, None)

    def _said(self, records: Iterator[Any]) -> tuple[list[_Said], Any]:
        """Claims on each root, and the record after them."""
        said: list[_Said] = []
        for record in records:
            if isinstance(record, dict):
                return said, record
            if is_certificate(record) and said:
                said[-1].certificates.append(record)
                if len(said[-1].certificates) > _MOST_CERTIFICATES:
                    raise RefusedError(f"root {said[-1].number} has more than {_MOST_CERTIFICATES} certificates")
                continue
            try:
                point, verdict = root_from(record, self.problem.p * (1 + self.body.tangents))
            except ValueError as error:
                raise RefusedError(str(error)) from None
            said.append(_Said(len(said), point, verdict, []))
            if self.report is not None and len(said) > self.report.roots:
                raise RefusedError(f"more is said than of the {self.report.roots} roots")
        raise RefusedError("the end of the proof is missing")

    def _check_counts(self, footer: Any, said: list[_Said], records: Iterator[Any]) -> None:
        counts = Counter(own.verdict for own in said)
        if not same(footer, {"roots": len(said), **{verdict: counts[verdict] for verdict in VERDICTS}}):
            raise RefusedError(f"the counts at the end, {quoted(footer)}, are not those of the records")
        self.check_end(records)

    def _matched(self, said: list[_Said], roots: list[_Root]) -> list[_Root]:
        """The root that every record is about: the one to whose forces its own are near.

        A degenerate root may be among ``roots`` more than once, and so may ends of families.
        """
        count = 0 if self.report is None else self.report.roots
        if len(said) != count:
            raise RefusedError(f"there are {counted(count, 'root')}, and something is said of {len(said)}")
        if not roots:
            return []
        forces = np.array([root.forces for root in roots])
        places = np.unique(forces, axis=0, return_inverse=True)[1].ravel()
        nearest: list[int] = []
        for own in said:
            with np.errstate(over="ignore"):
                away = np.max(np.abs(forces - own.point), axis=1)
            best = int(np.argmin(away))
            others = away[places != places[best]]
            if not np.all(2 * away[best] < others):
                raise RefusedError(f"the forces of record {own.number} do not tell which root it is about")
            nearest.append(best)
        found = {int(places[k]) for k in nearest}
        missing = {int(place) for place, root in zip(places, roots, strict=True) if root.known} - found
        if len(found) < count or missing:
            raise RefusedError("two records are about the same root")
        return [roots[k] for k in nearest]

    # -- roots -----------------------------------------------------------------------------------------------------

    def _verdict(self, said: _Said, root: _Root) -> tuple[str, tuple[float, float] | None]:
        """The proven verdict on a root, and bounds of the rate of a motion that grows."""
        if said.verdict == UNDECIDED or root.known is None:
            if said.verdict == UNDECIDED and said.certificates:
                self.fail(f"root {said.number} is said to be undecided and has certificates")
            return UNDECIDED, None
        codes, forces = root.known
        directions = None if forces is None else friction_directions(forces, self.F)
        parts = list(self.body.settings([{code} for code in codes], self.F, directions))
        given: list[list[Growing | NoMotion]] = [[] for _ in parts]
        try:
            for record in said.certificates:
                k = part_of(record, len(parts))
                given[k].append(certificate_from(record, len(parts[k].motions.signed)))
        except ValueError as error:
            self.fail(f"root {said.number}: {error}")
            return UNDECIDED, None
        if said.verdict == RUNS_AWAY:
            return self._runs_away(said, parts, given)
        for part, own in zip(parts, given, strict=True):
            if (reason := _something_may_grow(part, own)) is not None:
                self.fail(f"root {said.number}: {reason}")
                return UNDECIDED, None
        return DOES_NOT, None

    def _runs_away(
        self, said: _Said, parts: list[Setting], given: list[list[Growing | NoMotion]]
    ) -> tuple[str, tuple[float, float] | None]:
        named = [(part, own) for part, certificates in zip(parts, given, strict=True) for own in certificates]
        part, growing = named[0] if len(named) == 1 else (None, None)
        if part is None or not isinstance(growing, Growing):
            self.fail(f"root {said.number} is said to run away without one motion that grows")
            return UNDECIDED, None
        if growing.found(part.stiffness, part.motions) is None:
            self.fail(f"root {said.number}: no motion is proven to grow in the range that is named")
            return UNDECIDED, None
        return RUNS_AWAY, (math.sqrt(growing.low) / SAFE, math.sqrt(growing.high) * SAFE)

    def _statuses(self, leaf: Located) -> tuple[list[int], Floats | None] | None:
        """Statuses that hold strictly, and in 3D bounds of lambda_t; None where they are not certain."""
        p, forces = self.problem.p, leaf.forces
        sides = [forces[(k + 1) * p : (k + 2) * p] for k in range(self.body.tangents)]
        codes = []
        for i in range(p):
            pressure = float(forces.mid[i]) - float(forces.rad[i])
            axes = [(f, side) for f, side in zip(self.F, sides, strict=True) if f.mid[i] > 0]
            if leaf.open is not None and leaf.open[i]:
                codes.append(OPEN)
            elif not pressure > 0:
                return None
            elif not axes:
                codes.append(STICK)
            elif leaf.codes is not None and leaf.codes[i] not in (OPEN, STICK):
                codes.append(leaf.codes[i])
            elif _within(pressure, [(f[i], side[i]) for f, side in axes]):
                codes.append(STICK)
            else:
                return None
        if self.body.tangents == 1:
            return codes, None
        bounds = np.stack([np.stack([side.mid - side.rad, side.mid + side.rad], axis=1) for side in sides], axis=1)
        # subtractions and additions were rounded
        bounds[..., 0], bounds[..., 1] = np.nextafter(bounds[..., 0], -np.inf), np.nextafter(bounds[..., 1], np.inf)
        return codes, bounds


def _within(pressure: float, axes: list[tuple[Ball, Ball]]) -> bool:
    """True if a force is surely less than friction, lambda_n at least ``pressure`` and F > 0 along these axes."""
    shares = []
    for F, force in axes:
        least = (float(F.mid) - float(F.rad)) / SAFE
        if not least > 0:
            return False
        shares.append((abs(float(force.mid)) + float(force.rad)) / least)
    return math.hypot(*shares) * SAFE < pressure / SAFE


def _something_may_grow(part: Setting, given: list[Growing | NoMotion]) -> str | None:
    """Why certificates do not show that nothing grows in a part of the body, or None."""
    leaves = [leaf for leaf in given if isinstance(leaf, NoMotion)]
    if len(leaves) < len(given):
        return "a motion is named, and nothing is said to grow"
    if not all(leaf.holds(part.stiffness, part.motions) for leaf in leaves):
        return "a certificate does not exclude motions in its range"
    if (ends := left_open(leaves)) is not None:
        low, high = map(math.sqrt, ends)
        return f"motions with growth rates from {low:.3g} to {high:.3g} are not excluded"
    return None
