"""Which equilibria run away: directional stability of roots (theory, section 15)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, hull
from enumsol.condensation.data import exactly_at
from enumsol.condensation.dynamic import DynamicStiffness
from enumsol.condensation.enclosure import nearest_floats
from enumsol.errors import InvalidArgumentError
from enumsol.model.mass import checked_mass
from enumsol.model.statuses import ContactStatus
from enumsol.search.stability import Proven, StabilitySearch
from enumsol.support.arguments import alpha_value, shown
from enumsol.support.immutable import Sealed
from enumsol.support.messages import counted
from enumsol.trusted.running_away import Motion, Motions, Touching, everywhere

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root
    from enumsol.support.array_types import AlphaLike, ArrayLike, Floats, Integers

Verdict = Literal["runs away", "does not run away", "undecided"]
_OPEN, _STICK, _PLUS = ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP_PLUS
_MINUS = ContactStatus.SLIP_MINUS


@dataclass(frozen=True)
class Stability(Sealed):
    """Whether an equilibrium runs away (theory, section 15).

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
    """Whether an equilibrium runs away: whether the body can leave it along a straight line, growing exponentially.

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
        There is no mass, friction depends on the solution, or ``root`` is no root of this problem.
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


@dataclass(frozen=True, eq=False)
class Setting:
    """A part of the body that nothing connects with others, at an equilibrium.

    Attributes
    ----------
    stiffness : DynamicStiffness
        Of its rows in contact.
    motions : Motions
    dofs : (n',) int array
        Its degrees of freedom.
    rows : list of int
        Those rows among all contact rows.
    limits : list of int
        Contact nodes at their limit, in the order of ``motions``.
    """

    stiffness: DynamicStiffness
    motions: Motions
    dofs: Integers
    rows: list[int]
    limits: list[int]

    def displacement(self, mu: float, load: Floats, forces: Floats) -> Floats:
        """Displacements (A + mu M)^-1 (load - B'y) for forces y on the rows, (n',), in floats; of a body on springs."""
        from enumsol.condensation.factorization import Factorization  # scipy's solvers come with the first use

        stiffness = self.stiffness
        A = stiffness.A + mu * stiffness.M
        if not mu and not stiffness.held:
            A = A + stiffness.springs
        return Factorization(sp.csc_array(A)).solve(load - stiffness.rows.T @ forces)


class Stabilities:
    """Verdicts on roots of one problem; parts that nothing connects are examined by themselves and only once.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    mass : (n, n) array_like or sparse, or None
        In place of ``problem.inertia``.

    Raises
    ------
    InvalidProblemError
        The mass cannot be used.
    InvalidArgumentError
        There is none, or friction depends on the solution.
    """

    def __init__(self, problem: AnyProblem, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None) -> None:
        self.problem = problem
        if getattr(problem, "depends_on_solution", False):
            raise InvalidArgumentError("friction depends on the solution; expected constant coefficients")
        self._mass = problem.inertia if mass is None else checked_mass(mass, problem.A, problem.modes.N)
        A, rows = sp.csc_array(problem.A), sp.csr_array(problem.contact_rows)
        self._tangents = rows.shape[0] // problem.p - 1
        links = sp.csr_array(abs(A) + abs(self._mass))
        count, self._part = connected_components(links, directed=False)
        # a row that touches several parts connects them
        joins = sp.csr_array((np.ones(problem.n), (np.arange(problem.n), self._part)), shape=(problem.n, count))
        of_nodes = sum(abs(rows[k * problem.p : (k + 1) * problem.p]) for k in range(self._tangents + 1)) @ joins
        joined = sp.csr_array(of_nodes.T @ of_nodes)
        _, together = connected_components(joined, directed=False)
        self._part = together[self._part]
        first = np.array([of_nodes.indices[of_nodes.indptr[i]] for i in range(problem.p)])
        self._node_part = together[first]
        self._known: dict[Any, Proven] = {}
        self._stiffness: dict[Any, DynamicStiffness] = {}

    def check(self, root: Root) -> None:
        """Refuse what is no root of this problem."""
        if not hasattr(root, "enclosure"):
            raise InvalidArgumentError(
                f"root is {shown(root)}; expected a root of enumerate_roots, not a family of them"
            )
        if root.problem is not self.problem and root.problem.fingerprint != self.problem.fingerprint:
            raise InvalidArgumentError("root solves another problem; expected one of enumerate_roots(problem, alpha)")

    def of(self, root: Root) -> Stability:
        """The verdict on one root."""
        if (reason := self.not_known(root)) is not None:
            return Stability("undecided", (), (), (), reason)
        found: list[tuple[float, tuple[float, float], Floats]] = []
        gaps: list[tuple[float, float]] = []
        limits = 0
        for setting in self.settings(root):
            limits += len(setting.limits)
            proven = self._proven(root, setting)
            gaps += proven.gaps
            if not (proven.growing or proven.gaps or everywhere(proven.ranges)):
                gaps.append((0.0, np.inf))
            for _, motion in proven.growing:
                found.append((*_growth(motion.mu), self._shape(setting, motion)))
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

    def not_known(self, root: Root) -> str | None:
        """Why the statuses of a root do not tell enough."""
        if root.enclosure is None:
            return "the root was found in floats, and its statuses are not proven"
        if any(_OPEN in root.active[i] for i in self._unsure(root)):
            return "a contact node may be open or touch, which the bounds of this root do not decide"
        rubs = np.any([F.mid > 0 for F in friction_over(self.problem, root.alpha, root.alpha)], axis=0)
        if any(rubs[i] and {_PLUS, _MINUS} <= root.active[i] for i in self._unsure(root)):
            return "a contact node may be at either limit, which the bounds of this root do not decide"
        return None

    def settings(self, root: Root, *, every: bool = False) -> Iterator[Setting]:
        """Parts of the body with nodes at their limit, or all."""
        forces = None if root.enclosure is None or self._tangents == 1 else root.enclosure.lambda_t
        F = friction_over(self.problem, root.alpha, root.alpha)
        return self.settings_of(root.active, F, forces, self._unsure(root), every=every)

    def settings_of(
        self,
        active: Sequence[frozenset[ContactStatus]],
        F: list[Ball],
        forces: Floats | None = None,
        unsure: tuple[int, ...] = (),
        *,
        every: bool = False,
    ) -> Iterator[Setting]:
        """Parts of the body for statuses that hold, coefficients by axis and, in 3D, bounds of lambda_t (p, 2, 2)."""
        rubs = np.any([f.mid > 0 for f in F], axis=0)
        for part in np.unique(self._part):
            nodes = np.flatnonzero(self._node_part == part).tolist()
            kinds = {i: _kind(active[i], rubs[i]) for i in nodes}
            if every or "limit" in kinds.values():
                moves = {i: _limit(active[i], F, i, forces) for i, kind in kinds.items() if kind == "limit"}
                yield self._setting(F, int(part), kinds, moves, unsure)

    def _proven(self, root: Root, setting: Setting) -> Proven:
        """What is proven of one part; in 2D the same for all roots with these nodes and friction."""
        if self._tangents > 1:
            return StabilitySearch(setting.stiffness, setting.motions).run()
        F, moves = setting.motions.slopes, setting.motions.moves
        leaning = tuple((float(node.F.mid), float(node.F.rad)) for node in setting.motions.touching)
        arrays = (part.tobytes() for part in (F.mid, F.rad, moves.mid))
        key = (tuple(setting.rows), setting.motions.unsure, leaning, *arrays)
        if key not in self._known:
            self._known[key] = StabilitySearch(setting.stiffness, setting.motions).run()
        return self._known[key]

    @staticmethod
    def _unsure(root: Root) -> tuple[int, ...]:
        """Nodes of which bounds alone say what they do, and leave more than one status."""
        if root.regular or root.exact_slips is not None:
            return ()
        return tuple(i for i, statuses in enumerate(root.active) if len(statuses) > 1)

    def _setting(
        self,
        F: list[Ball],
        part: int,
        kinds: dict[int, str],
        moves: dict[int, tuple[list[Ball], Ball]],
        unsure: tuple[int, ...],
    ) -> Setting:
        """A part with nodes that are open, stuck, at their limit or touch."""
        p = self.problem.p
        rubbing = [(k * p, i) for k in range(self._tangents + 1) for i in kinds if not k or F[k - 1].mid[i] > 0]
        rows = [first + i for first, i in rubbing if kinds[i] != "open"]
        place = {row: at for at, row in enumerate(rows)}
        dofs = np.flatnonzero(self._part == part)
        columns: list[Ball] = []
        slopes: list[Ball] = []
        for i, (move, sinking) in moves.items():
            along = {place[(k + 1) * p + i]: x for k, x in enumerate(move) if (k + 1) * p + i in place}
            columns.append(_column(len(rows), along))
            slopes.append(_column(len(rows), along | {place[i]: -sinking}))
        touching: list[Touching] = []
        signed = [True] * len(moves)
        for i in (i for i, kind in kinds.items() if kind == "touching"):
            own = [(k + 1) * p + i for k in range(self._tangents) if (k + 1) * p + i in place]
            start = len(columns)
            columns.append(_column(len(rows), {place[i]: Ball.exact(np.array(-1.0))}))
            columns += [_column(len(rows), {place[row]: Ball.exact(np.array(1.0))}) for row in own]
            signed += [True, *(False for _ in own)]
            # along axes with friction
            smaller = min((f[i] for f in F), key=lambda f: float(f.mid) or np.inf)
            touching.append(Touching(start, tuple(range(start + 1, start + 1 + len(own))), smaller))
        motions = Motions(
            _stacked(columns, len(rows)),
            _stacked(slopes, len(rows)),
            np.array(signed, dtype=bool),
            tuple(touching),
            tuple(k for k, i in enumerate(moves) if i in unsure),
        )
        return Setting(self._stiffness_of(part, dofs, rows), motions, dofs, rows, list(moves))

    def _stiffness_of(self, part: int, dofs: Integers, rows: list[int]) -> DynamicStiffness:
        """Stiffness of some rows of a part."""
        key, problem = (part, tuple(rows)), self.problem
        if key not in self._stiffness:
            modes = springs = None
            if not problem.held:
                N = problem.modes.N[dofs]
                modes = N[:, np.any(N != 0, axis=0)]
                springs = sp.csc_array(problem.modes.springs())[dofs][:, dofs]
            A, M = (sp.csc_array(sp.csr_array(matrix)[dofs][:, dofs]) for matrix in (problem.A, self._mass))
            B = sp.csr_array(sp.csr_array(problem.contact_rows)[rows][:, dofs])
            self._stiffness[key] = DynamicStiffness(A, M, B, modes, springs)
        return self._stiffness[key]

    def _shape(self, setting: Setting, motion: Motion) -> Floats:
        """Displacements of a motion that grows, (n,), in floats."""
        K = setting.stiffness.at(motion.mu[0])
        assert K is not None
        forces = -(K.mid @ (setting.motions.moves.mid @ motion.x.mid))
        v = setting.displacement(0.5 * sum(motion.mu), np.zeros(len(setting.dofs)), forces)
        whole = np.zeros(self.problem.n)
        whole[setting.dofs] = v / np.max(np.abs(v))
        return whole


def _growth(mu: tuple[float, float]) -> tuple[float, tuple[float, float]]:
    """A growth rate, and its bounds, from bounds of its square."""
    low, high = np.sqrt(mu[0]) * (1 - 2.0**-50), np.sqrt(mu[1]) * (1 + 2.0**-50)
    return float(np.sqrt(0.5 * (mu[0] + mu[1]))), (float(low), float(high))


def _column(size: int, entries: dict[int, Ball]) -> Ball:
    """A column with some entries that are not zero."""
    column = Ball.exact(np.zeros(size))
    for at, value in entries.items():
        column[at] = value
    return column


def _kind(active: frozenset[ContactStatus], friction: bool) -> str:
    """What a node may do: stay open or stuck, slide at its limit, or leave where it touches without force."""
    if active == {_OPEN}:
        return "open"
    if _OPEN in active:
        return "touching"
    return "limit" if friction and active != {_STICK} else "stuck"


def friction_over(problem: AnyProblem, low: AlphaLike, high: AlphaLike) -> list[Ball]:
    """F along every axis for all alpha between two, as balls (p,)."""
    first, slope = (np.asarray(part).reshape(problem.p, -1) for part in problem.affine_friction)
    balls = []
    for k in range(first.shape[1]):
        ends = []
        for alpha in (low, high):
            F, inexact = nearest_floats(exactly_at(Fraction(alpha_value(alpha)), first[:, k], slope[:, k]))
            ends.append(Ball(F, np.where(inexact, 2 * UNIT * F + TINY, 0.0)))
        balls.append(hull(ends))
    return balls


def _limit(active: frozenset[ContactStatus], F: list[Ball], i: int, forces: Floats | None) -> tuple[list[Ball], Ball]:
    """Tangential move of a node at its limit, by axis, and by how much T_i sinks meanwhile (theory, (15.3))."""
    if len(F) == 1:
        sign = 1.0 if _PLUS in active else -1.0
        return [Ball.exact(np.array(sign))], F[0][i]
    assert forces is not None
    inverse = [_inverse(f[i]) for f in F]
    force = [Ball(0.5 * (low + high), 0.5 * (high - low) * SAFE + TINY) for low, high in forces[i]]
    shares = [x * y for x, y in zip(force, inverse, strict=True)]
    length = float(np.hypot(*(x.mid for x in shares))) or TINY
    # |v / |v| - m / |m|| <= 2 |v - m| / |m|
    off = 2.0 * float(np.hypot(*(x.rad for x in shares))) / length * SAFE + 8 * UNIT
    typical = max(float(f.mid[i]) for f in F)
    moves = [
        Ball(np.array(typical * float(x.mid) / length), np.array(typical * off * SAFE)) * y
        for x, y in zip(shares, inverse, strict=True)
    ]
    return moves, Ball.exact(np.array(typical))


def _inverse(F: Ball) -> Ball:
    """1 / F; of no friction at all zero, since no force is along that axis."""
    mid = float(F.mid)
    return (
        Ball.exact(np.array(0.0))
        if mid == 0
        else Ball(np.array(1 / mid), np.array((2 * float(F.rad) / mid + 2 * UNIT) / mid))
    )


def _stacked(columns: list[Ball], size: int) -> Ball:
    """Columns beside each other, (size, k)."""
    if not columns:
        return Ball.exact(np.zeros((size, 0)))
    return Ball(np.stack([c.mid for c in columns], axis=1), np.stack([c.rad for c in columns], axis=1))
