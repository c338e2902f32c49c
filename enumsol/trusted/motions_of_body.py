"""Motions that parts of a body may begin at an equilibrium, by what its contact nodes do (theory, section 15.2).

The search for growing motions and the checker of its proofs build the same motions here, from statuses that hold,
coefficients of friction and, in 3D, bounds of the tangential forces.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, hull, nearest
from enumsol.condensation.data import exactly_at
from enumsol.condensation.dynamic import DynamicStiffness
from enumsol.condensation.enclosure import NotEnclosedError, coefficients
from enumsol.errors import InvalidArgumentError
from enumsol.model.mesh import checked_mass
from enumsol.support.arguments import alpha_value
from enumsol.trusted.running_away import Motions, Touching
from enumsol.trusted.status_rows import OPEN, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import AlphaLike, ArrayLike, Floats, Integers


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
    limits, touching : lists of int
        Contact nodes at their limit and those that touch without force, in the order of ``motions``.
    """

    stiffness: DynamicStiffness
    motions: Motions
    dofs: Integers
    rows: list[int]
    limits: list[int]
    touching: list[int]


class BodyMotions:
    """The parts of one body, and how they may begin to move.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    mass : (n, n) array_like or sparse, or None
        In place of ``problem.inertia``.
    at_rest : bool
        Only K(0) is asked for, which takes no mass.

    Attributes
    ----------
    mass : (n, n) csc_array
    tangents : int
        Tangents of a node: 1 in 2D, 2 in 3D.

    Raises
    ------
    InvalidProblemError
        The mass cannot be used.
    InvalidArgumentError
        There is none, or friction depends on the solution.
    """

    def __init__(
        self, problem: AnyProblem, mass: ArrayLike | sp.sparray | sp.spmatrix | None = None, *, at_rest: bool = False
    ) -> None:
        self.problem = problem
        if getattr(problem, "depends_on_solution", False):
            raise InvalidArgumentError("friction depends on the solution; expected constant coefficients")
        if at_rest:
            self.mass = sp.csc_array((problem.n, problem.n))
        else:
            self.mass = problem.inertia if mass is None else checked_mass(mass, problem.A, problem.modes.N)
        A, rows = sp.csc_array(problem.A), sp.csr_array(problem.contact_rows)
        self.tangents = rows.shape[0] // problem.p - 1
        links = sp.csr_array(abs(A) + abs(self.mass))
        count, self._part = connected_components(links, directed=False)
        # a row that touches several parts connects them
        joins = sp.csr_array((np.ones(problem.n), (np.arange(problem.n), self._part)), shape=(problem.n, count))
        of_nodes = sum(abs(rows[k * problem.p : (k + 1) * problem.p]) for k in range(self.tangents + 1)) @ joins
        joined = sp.csr_array(of_nodes.T @ of_nodes)
        _, together = connected_components(joined, directed=False)
        self._part = together[self._part]
        first = np.array([of_nodes.indices[of_nodes.indptr[i]] for i in range(problem.p)])
        self._node_part = together[first]
        self._stiffness: dict[Any, DynamicStiffness] = {}
        # F0 and F1 of F0 + alpha F1, by node and axis
        parts = (np.asarray(part).reshape(problem.p, -1).tolist() for part in problem.affine_friction)
        self._friction = [
            [(Fraction(x), Fraction(y)) for x, y in zip(*pair, strict=True)] for pair in zip(*parts, strict=True)
        ]

    def settings(
        self,
        held: Sequence[Collection[int]],
        F: list[Ball],
        directions: Ball | None = None,
        unsure: tuple[int, ...] = (),
        *,
        every: bool = False,
    ) -> Iterator[Setting]:
        """Parts of the body with nodes at their limit, or all.

        Parameters
        ----------
        held : sequence of sets
            Per node the codes of the statuses that hold; in 3D any one but open and stick means slip.
        F : list of Balls (p,)
            Coefficients by axis.
        directions : Ball (p, 2), optional
            In 3D: lambda_t / F by axis, up to a positive factor for every node.
        unsure : tuple of int
            Nodes of which bounds leave open whether they are at their limit.
        """
        rubs = np.any([f.mid > 0 for f in F], axis=0)
        for part in np.unique(self._part):
            nodes = np.flatnonzero(self._node_part == part).tolist()
            kinds = {i: _kind(held[i], rubs[i]) for i in nodes}
            if every or "limit" in kinds.values():
                moves = {i: self._limit(held[i], F, i, directions) for i, kind in kinds.items() if kind == "limit"}
                yield self._setting(F, int(part), kinds, moves, unsure)

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
        rubbing = [(k * p, i) for k in range(self.tangents + 1) for i in kinds if not k or F[k - 1].mid[i] > 0]
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
        unloaded = [i for i, kind in kinds.items() if kind == "touching"]
        for i in unloaded:
            own = [(k + 1) * p + i for k in range(self.tangents) if (k + 1) * p + i in place]
            start = len(columns)
            columns.append(_column(len(rows), {place[i]: Ball.exact(np.array(-1.0))}))
            columns += [_column(len(rows), {place[row]: Ball.exact(np.array(1.0))}) for row in own]
            signed += [True, *(False for _ in own)]
            # along axes with friction
            smaller = min((f[i] for f in F), key=lambda f: float(f.low) if f.mid > 0 else np.inf)
            touching.append(Touching(start, tuple(range(start + 1, start + 1 + len(own))), smaller))
        motions = Motions(
            _stacked(columns, len(rows)),
            _stacked(slopes, len(rows)),
            np.array(signed, dtype=bool),
            tuple(touching),
            tuple(k for k, i in enumerate(moves) if i in unsure),
        )
        return Setting(self._stiffness_of(part, dofs, rows), motions, dofs, rows, list(moves), unloaded)

    def _limit(self, held: Collection[int], F: list[Ball], i: int, directions: Ball | None) -> tuple[list[Ball], Ball]:
        """Tangential move of a node at its limit, by axis, and by how much T_i sinks meanwhile (theory, (15.4))."""
        if len(F) == 1:
            sign = 1.0 if SLIP_PLUS in held else -1.0
            return [Ball.exact(np.array(sign))], F[0][i]
        assert directions is not None
        larger = max(range(len(F)), key=lambda k: float(F[k].mid[i]))
        d, length = direction(directions[i])
        return [d[k] * self._ratio(F, i, larger, k) for k in range(len(F))], F[larger][i] * length

    def _ratio(self, F: list[Ball], i: int, larger: int, k: int) -> Ball:
        """The larger coefficient over that along an axis; zero where there is no friction."""
        if k == larger:
            return Ball.exact(np.array(1.0))
        if F[k].mid[i] == 0:
            # no force is along that axis
            return Ball.exact(np.array(0.0))
        (above, rate), (below, other) = self._friction[i][larger], self._friction[i][k]
        if above * other != below * rate:
            return F[larger][i] * reciprocal(F[k][i])
        # for all alpha
        return nearest([above / below if below else rate / other])[0]

    def _stiffness_of(self, part: int, dofs: Integers, rows: list[int]) -> DynamicStiffness:
        """Stiffness of some rows of a part."""
        key, problem = (part, tuple(rows)), self.problem
        if key not in self._stiffness:
            modes = springs = rest = None
            if problem.held:
                # a search has enclosed S of all rows already
                with suppress(NotEnclosedError):
                    known = problem.enclosure
                    rest = Ball(known.S[np.ix_(rows, rows)], known.S_rad[np.ix_(rows, rows)])
            else:
                N = problem.modes.N[dofs]
                modes = N[:, np.any(N != 0, axis=0)]
                springs = sp.csc_array(problem.modes.springs())[dofs][:, dofs]
            A, M = (sp.csc_array(sp.csr_array(matrix)[dofs][:, dofs]) for matrix in (problem.A, self.mass))
            B = sp.csr_array(sp.csr_array(problem.contact_rows)[rows][:, dofs])
            self._stiffness[key] = DynamicStiffness(A, M, B, modes, springs, rest)
        return self._stiffness[key]


def friction_over(problem: AnyProblem, low: AlphaLike, high: AlphaLike) -> list[Ball]:
    """F along every axis for all alpha between two, as balls (p,)."""
    first, slope = (np.asarray(part).reshape(problem.p, -1) for part in problem.affine_friction)
    balls = []
    for k in range(first.shape[1]):
        ends = [exactly_at(Fraction(alpha_value(alpha)), first[:, k], slope[:, k]) for alpha in (low, high)]
        balls.append(hull([coefficients(end) for end in ends]))
    return balls


def friction_changes(setting: Setting, F: list[Ball], rates: Floats, forces: Floats) -> Ball:
    """Rates that changes of F add to r of the nodes at their limit of a part, (l,) (theory, section 15.5).

    Parameters
    ----------
    F : list of Balls (p,)
        Coefficients by axis.
    rates : (p, 1) or (p, 2) array
        Their derivatives.
    forces : (p, 1, 2) or (p, 2, 2) array
        Bounds of lambda_t.
    """
    p, place = len(forces), {row: at for at, row in enumerate(setting.rows)}
    found = []
    for k, i in enumerate(setting.limits):
        # r is F' times y_n - d'(y_t / F), F' the larger coefficient, and R has F' d / F
        total = Ball.exact(np.zeros(1))
        for axis, own in enumerate(F):
            if (row := place.get((axis + 1) * p + i)) is not None:
                force = hull([Ball.exact(end) for end in forces[i, axis]])
                share = setting.motions.moves[row, k : k + 1] * force * reciprocal(own[i])
                total = total + share * Ball.exact(rates[i, axis : axis + 1])
        found.append(total)
    return Ball.joined(*found)


def _kind(held: Collection[int], friction: bool) -> str:
    """The kind of a node: stay open or stuck, slide at its limit, or leave where it touches without force."""
    codes = set(held)
    if codes == {OPEN}:
        return "open"
    if OPEN in codes:
        return "touching"
    return "limit" if friction and codes != {STICK} else "stuck"


def friction_directions(forces: Floats, F: list[Ball]) -> Ball:
    """lambda_t / F by axis, (p, 2), from bounds of lambda_t, (p, 2, 2); zero along axes without friction."""
    found = hull([Ball.exact(forces[..., 0]), Ball.exact(forces[..., 1])])
    for k, f in enumerate(F):
        for i in range(len(found.mid)):
            found[i, k] = found[i, k] * reciprocal(f[i])
    return found


def direction(v: Ball) -> tuple[Ball, Ball]:
    """The directions of all vectors in a ball, (2,): vectors with a part of one along its middle, and their lengths."""
    length = float(np.hypot(*v.mid)) or TINY
    sine = float(np.hypot(*v.rad)) / length * SAFE
    x, y = v.mid / length
    if not sine < 0.99:
        # any unit vector
        return Ball(np.array([x, y]), np.full(2, 3.0)), Ball.exact(np.array(1.0))
    cosine = np.sqrt(1.0 - sine * sine)
    aside = np.abs([y, x]) * (sine / cosine * SAFE) + 8 * UNIT
    return Ball(np.array([x, y]), aside), Ball(np.array(1.0), np.array((1.0 / cosine - 1.0) * SAFE + 8 * UNIT))


def reciprocal(F: Ball) -> Ball:
    """1 / F for all F in a ball; of no friction at all zero, since no force is along that axis."""
    mid, rad = float(F.mid), float(F.rad)
    if mid == 0 and rad == 0:
        return Ball.exact(np.array(0.0))
    if not rad < mid:
        return Ball(np.array(0.0), np.array(np.inf))
    # 1 / (F - r) - 1 / F = (r / (F - r)) / F
    return Ball(np.array(1 / mid), np.array((rad / (mid - rad) * SAFE + 2 * UNIT) / mid * SAFE + TINY))


def _stacked(columns: list[Ball], size: int) -> Ball:
    """Columns beside each other, (size, k)."""
    if not columns:
        return Ball.exact(np.zeros((size, 0)))
    return Ball(np.stack([c.mid for c in columns], axis=1), np.stack([c.rad for c in columns], axis=1))


def _column(size: int, entries: dict[int, Ball]) -> Ball:
    """A column with some entries that are not zero."""
    column = Ball.exact(np.zeros(size))
    for at, value in entries.items():
        column[at] = value
    return column
