"""A problem in rationals, condensed or not, as the checker computes it; the search has its own code for this.

All roots of a selection are an affine solution set cut by the conditions. A body that nothing holds is condensed with
the rows of its equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq, fmpq_mat

from enumsol.arithmetic.rationals import is_positive_definite, rational, rational_matrix
from enumsol.condensation.data import exactly_at
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.condensation.unloaded import exact_matrices, free_displacements, solved
from enumsol.proof.reading import same
from enumsol.trusted.status_rows import BACKWARD, CONDITIONS, CONTACT, FORBIDDEN, FORWARD, NONNEGATIVE, OPEN
from enumsol.trusted.uniqueness import only_solution

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.model.problem import ContactProblem
    from enumsol.proof.leaves import Closed
    from enumsol.support.array_types import NDArray


Vector = list[Any]


class RationalSystem:
    """S, g and F of a problem at alpha, all rational; S from a solve with the whole of A.

    Of a body that nothing holds, S and g are those of the body on springs, with the r rows of its equilibrium as a
    whole (theory, section 14.2). Points have 2p + r numbers: the contact forces, then -q.

    Parameters
    ----------
    problem : ContactProblem
    alpha : Fraction
    definite : S is proven positive definite already

    Raises
    ------
    NotEnclosedError
        S is not positive definite: the energy bound and all that rests on it need that. Or the problem has more than
        EXACT_DOF_LIMIT degrees of freedom.
    """

    def __init__(self, problem: ContactProblem, alpha: Fraction, *, definite: bool = False) -> None:
        self.p, a, held, modes = problem.p, rational(alpha), problem.on_springs, problem.modes
        A, B = exact_matrices(held)
        self.S = B * solved(A, B.transpose())
        if not definite and not is_positive_definite(self.S):
            raise NotEnclosedError("the condensed compliance S is not positive definite in rational arithmetic")
        self.g: Vector = [x + a * y for x, y in zip(*free_displacements(held), strict=True)]
        self.F: Vector = [rational(F) for F in exactly_at(alpha, *problem.affine_friction)]
        columns = rational_matrix(modes.N)
        load = fmpq_mat([[x] for x in _load(problem, a)])
        #: G, a row for each mode, and h.
        self.G: list[Vector] = (B * columns).transpose().tolist() if modes.r else []
        self.h: Vector = (columns.transpose() * load).entries() if modes.r else []
        self.reach: Vector = [rational(float(x)) for x in modes.reach(problem.rigid_reach)]
        self._S: list[Vector] = self.S.tolist()
        self._inverse: Any = None

    @property
    def size(self) -> int:
        """Numbers of a point."""
        return 2 * self.p + len(self.G)

    def row(self, kind: int, node: int) -> tuple[Vector, Any]:
        """A row of ``trusted.status_rows`` as an affine function of a point: coefficients, and what is added."""
        p, form = self.p, [fmpq(0)] * self.size
        if kind >= 4:  # w = g - S lambda + G'q
            k, sign = (node, -1) if kind == 4 else (p + node, 1 if kind == 5 else -1)
            return [-sign * x for x in (*self._S[k], *(mode[k] for mode in self.G))], sign * self.g[k]
        if kind != 1:
            form[node] = fmpq(1) if kind == 0 else self.F[node]
        if kind != 0:
            form[p + node] = fmpq(-1 if kind == 2 else 1)
        return form, fmpq(0)

    def equations(self, codes: Sequence[int]) -> tuple[Any, Vector]:
        """Matrix and right-hand side of the selection's 2p equations and of G lambda = h."""
        rows = [self.row(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][0]]
        none = [fmpq(0)] * len(self.G)
        table = [*(form for form, _ in rows), *([*mode, *none] for mode in self.G)]
        return fmpq_mat(table), [*(-constant for _, constant in rows), *self.h]

    def conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities at a point, as values that must not be negative, and bounds of q."""
        return [*self.contact_conditions(codes, point), *self.bounds(point)]

    def contact_conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities at a point."""
        rows = [self.row(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][1]]
        moved = (fmpq_mat([form for form, _ in rows]) * fmpq_mat([[x] for x in point])).entries()
        return [x + constant for x, (_, constant) in zip(moved, rows, strict=True)]

    def bounds(self, point: Vector) -> Vector:
        """Distances of the rigid displacement from its bounds."""
        moved = list(zip(point[2 * self.p :], self.reach, strict=True))
        return [*(most - x for x, most in moved), *(most + x for x, most in moved)]

    def rests_on_reach(self, codes: Sequence[int], points: Sequence[Sequence[Fraction]]) -> bool:
        """True if a selection, which holds these points, holds others without the bounds of the rigid displacement.

        True as well if it has too many candidate vertices to find out.
        """
        if points:
            ends = [[rational(x) for x in point[2 * self.p :]] for point in points]
            return any(abs(x) == most for end in ends for x, most in zip(end, self.reach, strict=True))
        try:
            return any(point[-1] > 0 for point in hull_of_selections(_Shares(self), codes).points)
        except HullTooLargeError:
            return True

    def energy_bound_positive(
        self, signs: NDArray[np.int8], rows: Sequence[int], values: Sequence[float], units: Sequence[Fraction]
    ) -> bool:
        """The dual inequality in rationals: 4 (y'b + z'd) + v'S^{-1}v < 0 for the rows as equations a_j'lambda = b_j.

        ``units`` turns the multiplier of a row kind and node into the problem's units, flattened as kind * p + node.
        """
        v, total = list(self.g), fmpq(0)
        for row, value in zip(rows, values, strict=True):
            kind, i = divmod(row, self.p)
            allowed = int(signs[i, kind])
            if allowed == FORBIDDEN or (allowed == NONNEGATIVE and value < 0):
                return False
            u = rational(value) * rational(units[row])
            form, constant = self.row(kind, i)
            v = [x + u * a for x, a in zip(v, form, strict=True)]
            total -= u * constant
        if self._inverse is None:
            self._inverse = self.S.inv()
        column = fmpq_mat([[x] for x in v])
        return bool(4 * total > (column.transpose() * (self._inverse * column))[0, 0])


class RationalBody:
    """The matrices of a problem at alpha in rationals, not condensed: for single points.

    S has as many digits as det A, and 2p columns; the displacements of one point take one solve with A.

    Parameters
    ----------
    problem : ContactProblem
        A body that is held, with the slip offset that it has in floats.
    alpha : Fraction

    Raises
    ------
    NotEnclosedError
        The problem has more than EXACT_DOF_LIMIT degrees of freedom.
    """

    def __init__(self, problem: ContactProblem, alpha: Fraction) -> None:
        self.p, a = problem.p, rational(alpha)
        self._A, B = exact_matrices(problem)
        self._B: list[Vector] = B.tolist()
        self.F: Vector = [rational(F) for F in exactly_at(alpha, *problem.affine_friction)]
        self._f = _load(problem, a)
        self._offset = [rational(x) for x in problem.gap.tolist() + problem.slip_offset.tolist()]
        self._moved: dict[tuple[Any, ...], Vector] = {}

    def point(self, codes: Sequence[int]) -> Vector | None:
        """The only lambda that solves a selection's equations; None where they are singular.

        Of A u + B'lambda = f and of w = B u - offset = 0 in the rows of the selection, with u and those forces as
        unknowns that the statuses leave free.
        """
        p = self.p
        closed = [i for i, code in enumerate(codes) if code]
        held = [p + i for i, code in enumerate(codes) if code == 1]
        turn = [{2: self.F[i], 3: -self.F[i]}.get(codes[i], fmpq(0)) for i in closed]
        columns = [
            [x + f * y for x, y in zip(self._B[i], self._B[p + i], strict=True)]
            for i, f in zip(closed, turn, strict=True)
        ]
        columns += [self._B[k] for k in held]
        rows = closed + held
        table = [[*row, *(c[k] for c in columns)] for k, row in enumerate(self._A.tolist())]
        table += [[*self._B[r], *([fmpq(0)] * len(rows))] for r in rows]
        right = [*self._f, *(self._offset[r] for r in rows)]
        try:
            solved = fmpq_mat(table).solve(fmpq_mat([[x] for x in right])).entries()
        except ZeroDivisionError:
            return None
        u, y = solved[: len(self._f)], solved[len(self._f) :]
        point = [fmpq(0)] * (2 * p)
        for i, f, force in zip(closed, turn, y, strict=False):
            point[i], point[p + i] = force, f * force
        for k, force in zip(held, y[len(closed) :], strict=True):
            point[k] = force
        self._moved[tuple(point)] = self._displaced(u)
        return point

    def moved(self, point: Sequence[Any]) -> Vector:
        """w at a point: where the forces on the contact nodes are these.

        Raises
        ------
        NotEnclosedError
            A is singular.
        """
        if tuple(point) not in self._moved:
            load = list(self._f)
            for force, row in zip(point, self._B, strict=True):
                if force != 0:
                    load = [x - force * b for x, b in zip(load, row, strict=True)]
            self._moved[tuple(point)] = self._displaced(solved(self._A, fmpq_mat([[x] for x in load])).entries())
        return self._moved[tuple(point)]

    def _displaced(self, u: Vector) -> Vector:
        pairs = zip(self._B, self._offset, strict=True)
        return [sum((b * x for b, x in zip(row, u, strict=True) if b != 0), -o) for row, o in pairs]

    def least(self, code: int, node: int, point: Sequence[Any]) -> Any:
        """The smallest of the numbers that a final code wants not to be negative at a node, at a point."""
        p, w = self.p, self.moved(point)
        bound, t = self.F[node] * point[node], point[p + node]
        rows = (point[node], t, bound - t, bound + t, -w[node], w[p + node], -w[p + node])
        return min(rows[kind] for kind in CONDITIONS[code][1])


Point = tuple[Fraction, ...]


def closed_in_rationals(
    system: EnclosedSystem, body: RationalBody, codes: Sequence[int], said: Closed
) -> tuple[str | None, Point | None]:
    """Why a record of a closed subtree proves nothing, or None; and the root that it holds, or None."""
    selection, free = said.selection, said.free
    slides = {i: code for i, code in enumerate(codes) if code in (FORWARD, BACKWARD)}
    named = tuple(slides.get(i, code) for i, code in enumerate(selection))
    point = body.point(selection)
    if point is None:
        return "its selection is singular", None
    w = body.moved(point)
    least = {i: body.least(selection[i], i, point) for i in range(body.p)}
    if any(least[i] < 0 for i in free) or any(w[i] > 0 if selection[i] == OPEN else point[i] < 0 for i in slides):
        return "the point of its selection does not solve the reduced problem", None
    if not only_solution(system, named, free, np.asarray(said.weights), point, w):
        return "its solution is not proven to be the only one", None
    touching = all(w[i] == 0 for i, code in enumerate(codes) if code == CONTACT)
    holds = touching and all(least[i] >= 0 for i in range(body.p) if i not in free)
    if not same(said.at, int(holds)):
        return "it holds another number of roots than it claims", None
    return None, _as_point(point) if holds else None


#: Candidate vertices beyond which a root set is not enumerated: a leaf that needs more is refused.
MAX_CANDIDATES = 200_000


class HullTooLargeError(ValueError):
    """A root set has more than MAX_CANDIDATES candidate vertices."""


@dataclass(frozen=True)
class Hull:
    """The points that solve one selection, or several at once.

    Attributes
    ----------
    points : list of points
        All vertices, without repetition; the root set is their convex hull.
    dimension : int
    """

    points: list[Point]
    dimension: int


def hull_of_selections(system: RationalSystem | _Shares, *selections: Sequence[int]) -> Hull:
    """The root set that the given selections have in common, a polytope.

    It is bounded, and therefore the hull of its vertices, because S is positive definite (theory, section 5.1), and
    where nothing holds the body its rigid displacement is (theory, section 14.2). Every
    vertex is the only common zero of some of the conditions on the affine solution set.

    Raises
    ------
    HullTooLargeError
        More than MAX_CANDIDATES sets of conditions would have to be tried.
    """
    affine = _solution_set(system, selections)
    if affine is None:
        return Hull([], 0)
    origin, directions = affine
    values = [x for codes in selections for x in system.conditions(codes, origin)]
    moved = [
        [x for codes in selections for x in system.conditions(codes, _sum(origin, [(1, direction)]))]
        for direction in directions
    ]
    # each condition is affine: value + slopes . t >= 0
    rows = {tuple([m[k] - value for m in moved] + [value]) for k, value in enumerate(values)}
    flat = [row for row in rows if not any(row[:-1])]
    if any(row[-1] < 0 for row in flat):
        return Hull([], 0)
    steep = sorted((row for row in rows if any(row[:-1])), key=str)
    found = {_as_point(_sum(origin, zip(t, directions, strict=True))) for t in _corners(steep, len(directions))}
    return Hull(sorted(found), _dimension(sorted(found)))


def _solution_set(
    system: RationalSystem | _Shares, selections: Sequence[Sequence[int]]
) -> tuple[list[Any], list[Any]] | None:
    """A point that solves all equations and a basis of their kernel, or None if they contradict each other."""
    size = system.size
    table = []
    for codes in selections:
        M, b = system.equations(codes)
        table += [[*row, x] for row, x in zip(M.tolist(), b, strict=True)]
    reduced, rank = fmpq_mat(table).rref()
    rows = reduced.tolist()[:rank]
    pivots = [next(j for j, x in enumerate(row) if x != 0) for row in rows]
    if size in pivots:
        return None
    origin, directions = [fmpq(0)] * size, []
    for row, pivot in zip(rows, pivots, strict=True):
        origin[pivot] = row[size]
    for free in (j for j in range(size) if j not in pivots):
        direction = [fmpq(0)] * size
        direction[free] = fmpq(1)
        for row, pivot in zip(rows, pivots, strict=True):
            direction[pivot] = -row[free]
        directions.append(direction)
    return origin, directions


def _corners(rows: list[tuple[Any, ...]], size: int) -> Iterator[list[Any]]:
    """Parameters t of the vertices of {value + slopes . t >= 0}."""
    if comb(len(rows), size) > MAX_CANDIDATES:
        raise HullTooLargeError(f"its root set has {comb(len(rows), size)} candidate vertices")
    for chosen in combinations(rows, size):
        t: list[Any] = []
        if size:
            matrix = fmpq_mat([list(row[:-1]) for row in chosen])
            if matrix.det() == 0:
                continue
            t = matrix.solve(fmpq_mat([[-row[-1]] for row in chosen])).entries()
        if all(sum((a * x for a, x in zip(row[:-1], t, strict=True)), row[-1]) >= 0 for row in rows):
            yield t


def _sum(origin: list[Any], steps: Any) -> list[Any]:
    total = list(origin)
    for factor, direction in steps:
        total = [x + factor * d for x, d in zip(total, direction, strict=True)]
    return total


def _as_point(vector: list[Any]) -> Point:
    return tuple(Fraction(int(x.p), int(x.q)) for x in vector)


def _dimension(points: list[Point]) -> int:
    if len(points) < 2:
        return 0
    first = points[0]
    rows = [[x - y for x, y in zip(point, first, strict=True)] for point in points[1:]]
    return int(fmpq_mat([[fmpq(x.numerator, x.denominator) for x in row] for row in rows]).rank())


class _Shares:
    """Points (s x, s) with x in a selection without the bounds, 0 <= s <= 1, and s x within the bounds.

    Parameters
    ----------
    system : RationalSystem
    """

    def __init__(self, system: RationalSystem) -> None:
        self._system, self.size = system, system.size + 1

    def equations(self, codes: Sequence[int]) -> tuple[Any, Vector]:
        """Matrix and right-hand side, which is zero."""
        M, b = self._system.equations(codes)
        return fmpq_mat([[*row, -x] for row, x in zip(M.tolist(), b, strict=True)]), [fmpq(0)] * len(b)

    def conditions(self, codes: Sequence[int], point: Vector) -> Vector:
        """The selection's inequalities times s, then the bounds of s x and of s."""
        *x, share = point
        there, constant = (self._system.contact_conditions(codes, at) for at in (x, [fmpq(0)] * len(x)))
        scaled = [value + (share - 1) * more for value, more in zip(there, constant, strict=True)]
        return [*scaled, *self._system.bounds(x), share, 1 - share]


def _load(problem: ContactProblem, alpha: Any) -> Vector:
    """f + alpha load_slope."""
    slope = [0.0] * problem.n if problem.load_slope is None else problem.load_slope.tolist()
    return [rational(x) + alpha * rational(y) for x, y in zip(problem.f.tolist(), slope, strict=True)]
