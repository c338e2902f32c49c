"""Which equilibria run away: directional stability of roots (theory, section 15)."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.model.mesh import mass_fingerprint
from enumsol.model.statuses import ContactStatus
from enumsol.proof.proof_file import PROOF_VERSION
from enumsol.proof.stability_records import DOES_NOT, RUNS_AWAY, UNDECIDED, VERDICTS, certificate_record, root_record
from enumsol.proof.writer import ProofWriter
from enumsol.roots.local_branch import STATUS_CODES
from enumsol.search.stability import Proven, StabilitySearch
from enumsol.support.arguments import shown
from enumsol.support.immutable import Sealed
from enumsol.support.messages import counted
from enumsol.trusted.motions_of_body import BodyMotions, Setting, friction_directions, friction_over
from enumsol.trusted.running_away import left_open

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from enumsol.arithmetic.balls import Ball
    from enumsol.model.problem3d import AnyProblem
    from enumsol.proof.proof_file import Proof
    from enumsol.roots.root import Root
    from enumsol.support.array_types import ArrayLike, Floats

Verdict = Literal["runs away", "does not run away", "undecided"]


@dataclass(frozen=True)
class Stability(Sealed):
    """True if an equilibrium runs away (theory, section 15).

    It runs away if the body, left there, can leave along a straight line with a displacement that grows like exp(rho
    t): it cannot rest in it. If it does not run away, nothing more is said: a motion that slips to and fro may grow all
    the same.

    Attributes
    ----------
    verdict : "runs away", "does not run away" or "undecided"
        The first two are proven.
    growth_rates : tuple of float
        rho = sqrt(mu) of the motions that were found, the largest first [1 / time].
    motions : tuple of (n,) arrays
        Their directions, with a largest component of one.
    bounds : tuple of (float, float)
        Proven bounds of every growth rate.
    reason : str
        Why, in a sentence.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.get("taper-8").build()
    >>> [found.verdict for found in enumsol.enumerate_roots(problem, alpha=0.2).stability()]
    ['does not run away', 'runs away', 'does not run away']
    """

    verdict: Verdict
    growth_rates: tuple[float, ...]
    motions: tuple[Floats, ...] = field(repr=False)
    bounds: tuple[tuple[float, float], ...] = field(repr=False)
    reason: str


def stability(
    problem: AnyProblem, root: Root, *, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None
) -> Stability:
    """True if an equilibrium runs away: whether the body can leave it along a straight line, growing exponentially.

    The verdicts "runs away" and "does not run away" are proven, for the statuses of the root, in the linearized motion
    with Coulomb's law in terms of velocities and without damping (theory, section 15; in 3D to first order). One that
    does not run away may be unstable all the same.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root
        One of ``enumerate_roots(problem, alpha)``, in verified or exact arithmetic.
    mass : (n, n) array_like or sparse, optional
        Symmetric and positive semidefinite; by default ``problem.mass``, or that of the mesh with a uniform density
        [force time^2 / length].

    Returns
    -------
    Stability

    Raises
    ------
    InvalidArgumentError
        There is no mass, friction depends on the solution, or ``root`` is no isolated root of this problem.
    InvalidProblemError
        The mass cannot be used.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.get("taper-8").build()
    >>> sliding = enumsol.enumerate_roots(problem, alpha=0.2)[1]
    >>> found = enumsol.stability(problem, sliding)
    >>> found.verdict, len(found.growth_rates)
    ('runs away', 1)
    """
    asked = Stabilities(problem, mass)
    asked.check(root)
    return asked.of(root)


class Stabilities:
    """Verdicts on roots of one problem; parts that nothing connects are examined by themselves and only once.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    mass : (n, n) array_like or sparse, or None
        In place of ``problem.inertia``.
    known : dict, optional
        What was proven with this mass before.
    at_rest : bool
        Only the motions that may begin are asked for, at rates of the load, which takes no mass.

    Attributes
    ----------
    body : BodyMotions

    Raises
    ------
    InvalidProblemError
        The mass cannot be used.
    InvalidArgumentError
        There is none, or friction depends on the solution.
    """

    def __init__(
        self,
        problem: AnyProblem,
        mass: ArrayLike | sp.sparray | sp.spmatrix | None = None,
        known: dict[bytes, Proven] | None = None,
        *,
        at_rest: bool = False,
    ) -> None:
        self.problem, self.body = problem, BodyMotions(problem, mass, at_rest=at_rest)
        self.known = {} if known is None else known

    def check(self, root: Root) -> None:
        """Refuse what is no root of this problem."""
        if not hasattr(root, "enclosure"):
            family = "a family of solutions" if hasattr(root, "polytopes") else shown(root)
            raise InvalidArgumentError(f"root is {family}; expected an isolated root of enumerate_roots")
        if root.problem is not self.problem and root.problem.fingerprint != self.problem.fingerprint:
            raise InvalidArgumentError("root solves another problem; expected one of enumerate_roots(problem, alpha)")

    def not_known(self, root: Root) -> str | None:
        """Why the statuses of a root do not tell enough."""
        if root.enclosure is None:
            return "the root was found in floats, and its statuses are not proven"
        if any(ContactStatus.OPEN in root.active[i] for i in self._unsure(root)):
            return "a contact node may be open or touch, which the bounds of this root do not decide"
        rubs = np.any([F.mid > 0 for F in friction_over(self.problem, root.alpha, root.alpha)], axis=0)
        limits = {ContactStatus.SLIP_PLUS, ContactStatus.SLIP_MINUS}
        if any(rubs[i] and limits <= root.active[i] for i in self._unsure(root)):
            return "a contact node may be at either limit, which the bounds of this root do not decide"
        return None

    def settings(self, root: Root, *, every: bool = False) -> Iterator[Setting]:
        """Parts of the body with nodes at their limit, or all."""
        F = friction_over(self.problem, root.alpha, root.alpha)
        known = None if self.body.tangents == 1 else root.enclosure
        directions = None if known is None else friction_directions(known.lambda_t, F)
        return self.settings_of(root.active, F, directions, self._unsure(root), every=every)

    def settings_of(
        self,
        active: Sequence[frozenset[ContactStatus]],
        F: list[Ball],
        directions: Ball | None = None,
        unsure: tuple[int, ...] = (),
        *,
        every: bool = False,
    ) -> Iterator[Setting]:
        """Parts of the body for statuses that hold, coefficients by axis and, in 3D, directions of friction (p, 2)."""
        codes = [frozenset(STATUS_CODES[status] for status in statuses) for statuses in active]
        return self.body.settings(codes, F, directions, unsure, every=every)

    @staticmethod
    def _unsure(root: Root) -> tuple[int, ...]:
        """Nodes of which bounds alone say what they do, and leave more than one status."""
        if root.regular or root.exact_slips is not None:
            return ()
        return tuple(i for i, statuses in enumerate(root.active) if len(statuses) > 1)

    def of(self, root: Root) -> Stability:
        """The verdict on one root."""
        if (reason := self.not_known(root)) is not None:
            return Stability("undecided", (), (), (), reason)
        found: list[tuple[float, tuple[float, float], Floats]] = []
        gaps: list[tuple[float, float]] = []
        limits = 0
        for setting, proven in self.examined(root):
            limits += len(setting.limits)
            gaps += proven.gaps
            if not proven.growing and not proven.gaps and (ends := left_open(proven.leaves)) is not None:
                gaps.append(ends)
            for own, x in proven.growing:
                mu = 0.5 * (own.low + own.high)
                found.append((float(np.sqrt(mu)), rate_bounds(own.low, own.high), self._shape(setting, own.low, mu, x)))
        if found:
            found.sort(key=lambda item: -item[0])
            rates, bounds, shapes = zip(*found, strict=True)
            one = f"{len(found)} motions grow" if len(found) > 1 else "a motion grows"
            return Stability("runs away", rates, shapes, bounds, f"{one} along a straight line")
        if gaps:
            low, high = (float(np.sqrt(mu)) for mu in gaps[0])
            return Stability("undecided", (), (), (), f"growth rates from {low:.3g} to {high:.3g} are not excluded")
        if not limits:
            reason = "no contact node is at its limit of friction"
        else:
            reason = f"no motion grows with {counted(limits, 'contact node')} at the limit of friction"
        return Stability("does not run away", (), (), (), reason)

    def examined(self, root: Root) -> Iterator[tuple[Setting, Proven]]:
        """Parts of the body with nodes at their limit, and what is proven of them."""
        for setting in self.settings(root):
            yield setting, self._proven(setting)

    def _proven(self, setting: Setting) -> Proven:
        """Proofs about one part: the same for all roots with these nodes, friction and directions."""
        motions = setting.motions
        key = hashlib.sha256(repr((setting.rows, motions.unsure)).encode())
        for part in (motions.slopes, motions.moves, *(node.F for node in motions.touching)):
            key.update(part.mid.tobytes() + part.rad.tobytes())
        if key.digest() not in self.known:
            self.known[key.digest()] = StabilitySearch(setting.stiffness, motions).run()
        return self.known[key.digest()]

    def _shape(self, setting: Setting, low: float, mu: float, x: Ball) -> Floats:
        """Displacements of a motion that grows, (n,), in floats; mu is from ``low`` on."""
        K = setting.stiffness.at(low)
        assert K is not None
        forces = -(K.mid @ (setting.motions.moves.mid @ x.mid))
        v = displacement(setting, mu, np.zeros(len(setting.dofs)), forces)
        whole = np.zeros(self.problem.n)
        whole[setting.dofs] = v / np.max(np.abs(v))
        return whole


def rate_bounds(low: float, high: float) -> tuple[float, float]:
    """Bounds of a growth rate, from bounds of its square."""
    return float(np.sqrt(low) * (1 - 2.0**-50)), float(np.sqrt(high) * (1 + 2.0**-50))


def displacement(setting: Setting, mu: float, load: Floats, forces: Floats) -> Floats:
    """Displacements (A + mu M)^-1 (load - B'y) for forces y on the rows, (n',), in floats; of a body on springs."""
    from enumsol.condensation.factorization import Factorization  # scipy's solvers come with the first use

    stiffness = setting.stiffness
    A = stiffness.A + mu * stiffness.M
    if not mu and not stiffness.held:
        A = A + stiffness.springs
    return Factorization(sp.csc_array(A)).solve(load - stiffness.rows.T @ forces)


def write_proof(
    proof: Proof, roots: Iterable[Root], asked: Stabilities, found: Iterable[Stability], path: str | Path | None
) -> Proof:
    """The proof of verdicts ``found`` on roots, after the ``proof`` of these.

    Raises
    ------
    InvalidArgumentError
        The file cannot be written.
    """
    # the new proof may take the place of the file
    records, problem = list(proof.records()), asked.problem
    writer = ProofWriter(path)
    writer.write(
        {
            "format": "enumsol-proof",
            "version": PROOF_VERSION,
            "kind": "stability",
            "problem": problem.fingerprint,
            "p": problem.p,
            "mass": mass_fingerprint(asked.body.mass),
        }
    )
    for record in records:
        writer.write(record)
    counts: Counter[str] = Counter()
    for root, own in zip(roots, found, strict=True):
        verdict, certificates = _certified(asked, root, own)
        counts[verdict] += 1
        writer.write(root_record(np.concatenate([root.lambda_n, np.asarray(root.lambda_t).T.ravel()]), verdict))
        for record in certificates:
            writer.write(record)
    writer.write({"roots": counts.total(), **{verdict: counts[verdict] for verdict in VERDICTS}})
    written = writer.close()
    if writer.failure is not None:
        raise InvalidArgumentError(writer.failure)
    return written


def _certified(asked: Stabilities, root: Root, found: Stability) -> tuple[str, list[Any]]:
    """Verdict that follows from the proof of the roots alone, and the records of its certificates."""
    if found.verdict == UNDECIDED or not _strict(root):
        return UNDECIDED, []
    parts = list(asked.examined(root))
    if found.verdict == RUNS_AWAY:
        growing = ((k, proven.growing[0]) for k, (_, proven) in enumerate(parts) if proven.growing)
        k, (certificate, _) = max(growing, key=lambda item: item[1][0].low)
        return RUNS_AWAY, [certificate_record(k, certificate)]
    records = []
    for k, (_, proven) in enumerate(parts):
        records += [certificate_record(k, leaf) for leaf in dict.fromkeys(proven.leaves)]
    return DOES_NOT, records


def _strict(root: Root) -> bool:
    """True if every node with a choice has one status, and surely touches or not."""
    return all(len(held) == 1 or ContactStatus.OPEN not in held for held in root.active) and (
        root.regular or all(len(held) == 1 for held in root.active)
    )
