"""The trusted test of pieces with one solution: along an arc its root is the only one (theory, section 7.15).

At one alpha a solution is the only one if the form (6.9) is definite for numbers theta that serve it. Along an arc
theta follows the solution, which is known as polynomials in tau with bounds of their errors (theory, section 7.14). Of
a body that nothing holds the forms say below which assignments it is the only one (theory, section 14.16).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, gamma, upper_sum
from enumsol.trusted.arcs.over_parts import Expansion, bernstein_values, expansions
from enumsol.trusted.over_interval import PieceNumbers, definite
from enumsol.trusted.reference import PlaneReference
from enumsol.trusted.selection import Unknowns, signed
from enumsol.trusted.status_rows import OPEN
from enumsol.trusted.uniqueness_forms import Multipliers, RootForm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats, Indices
    from enumsol.trusted.arcs.selection_balls import ArcSelection

    Span = tuple[ArcSelection, float, float]

#: How often an interval of alpha is halved, and how many parts are expanded together.
_HALVINGS, _TOGETHER = 8, 8


def only_roots(asked: Sequence[Span], numbers: PieceNumbers, errors: float = 1.0, margin: float = 0.0) -> list[bool]:
    """List of whether, for every selection, there is no other solution at any alpha at which it has a root.

    Parameters
    ----------
    asked : sequence of (selection, low, high)
        Each over its own interval of alpha; beyond it nothing is said.
    numbers : PieceNumbers
        In the units of the selections.
    errors : bounds of the errors of the arcs are multiplied by this
    margin : the smallest eigenvalue must be larger than this, relative to the largest entry
        A search asks for more than its checker, which may round otherwise.
    """
    found, waiting = [True] * len(asked), [(k, span, _HALVINGS) for k, span in enumerate(asked)]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        while waiting:
            # the shortest first: where no shorter one will do, that is seen without all the others
            waiting.sort(key=lambda part: -part[2])
            taken, waiting = waiting[-_TOGETHER:], waiting[:-_TOGETHER]
            known = expansions([span for _, span, _ in taken], errors)
            for expansion, (k, span, halvings) in zip(known, taken, strict=True):
                along = _Along(expansion, numbers) if isinstance(expansion, Expansion) else None
                if not found[k] or (along is not None and along.alone(margin)):
                    continue
                selection, low, high = span
                middle = 0.5 * (low + high)
                if not halvings or not low < middle < high or (along is not None and along.hopeless):
                    found[k] = False
                    continue
                waiting += [(k, (selection, *part), halvings - 1) for part in ((low, middle), (middle, high))]
            waiting = [part for part in waiting if found[part[0]]]
    return found


def branch_references(asked: Sequence[Span], numbers: PieceNumbers, errors: float = 1.0) -> list[PlaneReference]:
    """References along arcs of a body that nothing holds; none where some are not proven.

    Where all of them say that there is no other root below an assignment, there is none at any alpha at which one of
    the selections has a root. ``asked`` and ``errors`` as for ``only_roots``.
    """
    found = list[PlaneReference]()
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for first in range(0, len(asked), _TOGETHER):
            for expansion in expansions(asked[first : first + _TOGETHER], errors):
                references = _Along(expansion, numbers).references() if isinstance(expansion, Expansion) else []
                if not references:
                    return []
                found += references
    return found


class _Along:
    """A selection's solution over an interval, t > 0 times its forces and displacements, as polynomials in tau.

    A polynomial is a ball of coefficients, a row each; the bound of its error is a radius of the constant one.
    """

    def __init__(self, expansion: Expansion, numbers: PieceNumbers) -> None:
        self._rows, self._system = expansion.selection.rows, expansion.selection.system
        self._series, self._numbers = expansion, numbers
        self._ends = expansion.tau(expansion.low, expansion.high)
        system, series = self._system, self._series
        self._rubbing = (system.F0 != 0) | (system.F1 != 0)
        coefficients, radii = series.coefficients.copy(), np.zeros_like(series.coefficients)
        radii[:, 0] = series.error
        low, high = _between(Ball(coefficients[-1:], radii[-1:]), self._ends)
        self.sign = int(low[0] > 0) - int(high[0] < 0)
        z = Ball(self.sign * coefficients, radii)
        moving, closed, stick = len(self._rows.moving), len(self._rows.closed), len(self._rows.stick)
        self._t, self._apart = z[-1:], z[: moving - len(self._rows.slip)]
        self._normal = z[moving : moving + closed]
        first, half = moving + closed, Ball.exact(np.full((1, 1), 0.5))
        self._stuck = (z[first + stick : first + 2 * stick] - z[first : first + stick]) * half
        # of a body that nothing holds both bounds of its coordinates q follow
        first, modes = first + 2 * stick, len(self._rows.modes)
        self._rigid = (z[first + modes : -1] - z[first : first + modes]) * half
        #: No shorter interval will do.
        self.hopeless = False

    def alone(self, margin: float) -> bool:
        """True if the form is definite at every alpha, with theta that serves the solution there."""
        served, S = self._served(), self._system.S
        if served is None:
            return False
        given, off, _ = served
        kept = self._kept.places
        here = np.ix_(kept, kept)
        lost = np.where(off > 0, self._numbers.kappa * off * given[0].slip_sizes(S) * SAFE + TINY, 0.0)
        forms, taken = [one.form(S)[here] for one in given], given[0].taken(S, off, lost)[here]
        self.hopeless = not all(definite(form, margin) for form in forms)
        return not self.hopeless and all(definite(form - taken, margin) for form in forms)

    def references(self) -> list[PlaneReference]:
        """The forms of theory, (14.14), of the Bernstein coefficients of theta; none where one is not definite."""
        served, system, numbers, kept = self._served(), self._system, self._numbers, self._kept
        if served is None:
            return []
        given, off, size = served
        here, lost = np.ix_(kept.places, kept.places), np.zeros(len(kept.places))
        body = system.contact[here], system.rigid[:, kept.places]
        lost[kept.tangential[kept.normal]] = np.where(off > 0, numbers.kappa * off * SAFE + TINY, 0.0)[kept.normal]
        cost, closed = np.zeros(len(lost)), self._rows.closed
        # mu lambda_n + nu lambda_t from below
        room = (numbers.mu - np.abs(numbers.nu) * size * SAFE) / SAFE
        loaded = _between(self._normal, self._ends)[0] / _between(self._t, self._ends)[1] / SAFE
        cost[closed] = np.maximum(np.where(self._rubbing, room, numbers.mu)[closed] * loaded / SAFE, 0.0)
        found = []
        for one in given:
            form, cross = one.form(system.contact)[here], one.cross(system.rigid, numbers.share)[:, kept.places]
            made = RootForm.factored(body, form, cross, lost, cost, numbers.balance)
            if made is None:
                return []
            found.append(PlaneReference(system.at(self._series.middle), self._rows.codes, made, kept))
        return found

    @property
    def _kept(self) -> Unknowns:
        """lambda_n of all nodes, lambda_t of those with friction."""
        p = self._system.p
        return Unknowns(p, np.arange(p), self._rubbing, np.zeros(p, dtype=np.intp))

    def _served(self) -> tuple[list[Multipliers], Floats, Floats] | None:
        """D of every Bernstein coefficient of theta, how far theta may be off, and the largest friction coefficients.

        None where theta does not serve.
        """
        if not self.sign:
            return None
        friction = [self._affine(self._system.F0, self._system.F1, tau) for tau in self._ends]
        size = np.maximum(friction[0].size, friction[1].size)
        theta = self._theta(size) if self._numbers.serve(size) else None
        if theta is None:
            return None
        values, error = _bernstein(theta[0], self._ends)
        return [self._numbers.multipliers(Ball(value, error)) for value in values.T], theta[1], size

    def _affine(self, constant: Floats, slope: Floats, tau: float) -> Ball:
        """constant + alpha slope at the alpha of a tau."""
        middle, turn = self._linear(constant, slope)
        return middle + turn * Ball.exact(np.full(1, tau))

    def _theta(self, size: Floats) -> tuple[Ball, Floats] | None:
        """theta of all nodes as polynomials in tau, (p, degree + 1), and by how much they may be off.

        None where no theta is known that serves the solution.
        """
        rows, p, degree = self._rows, self._system.p, self._numbers.degree
        theta, off = Ball.exact(np.zeros((p, degree + 1))), np.zeros(p)
        constant, slope = self._linear(self._system.F0, self._system.F1)
        F = Ball(np.column_stack([constant.mid, slope.mid]), np.column_stack([constant.rad, slope.rad]))
        theta[rows.slip, :2] = signed(F[rows.slip], rows.slip_signs[:, None])
        if len(rows.stick):
            loaded = self._normal[rows.normal]
            middle, half = 0.5 * (self._ends[1] + self._ends[0]), 0.5 * (self._ends[1] - self._ends[0])
            places = middle - half * np.cos(np.pi * np.arange(degree + 1) / degree)
            shares = _values(self._stuck, places) / _values(loaded, places)
            given = np.asarray(np.linalg.solve(np.vander(places, increasing=True), shares.T).T, dtype=np.float64)
            theta[rows.stick] = Ball.exact(given)
            # |lambda_t / lambda_n - theta| = |lambda_t - theta lambda_n| / lambda_n
            low, high = _between(_longer(self._stuck, degree) - _multiplied(given, loaded), self._ends)
            least = _between(loaded, self._ends)[0]
            if not np.all(least > 0):
                return None
            off[rows.stick] = np.maximum(-low, high) / least * SAFE + TINY
        opened = np.flatnonzero((np.array(rows.codes) == OPEN) & self._rubbing)
        if len(opened):
            sides = self._sides(opened, size)
            if sides is None:
                return None
            theta[opened, :2] = signed(Ball(F.mid[opened], F.rad[opened] * np.abs(sides)[:, None]), sides[:, None])
        return (theta, off) if theta.finite and np.all(np.isfinite(off)) else None

    def _sides(self, opened: Indices, size: Floats) -> Floats | None:
        """theta / F of open nodes, 0 where the gap allows that, else the sign of w_t; None where neither is proven."""
        numbers = self._numbers
        low, high = _between(self._slips(opened), self._ends)
        place = {i: k for k, i in enumerate(i for i, code in enumerate(self._rows.codes) if code == OPEN)}
        gap = _between(self._apart, self._ends)[0][[place[int(i)] for i in opened]]
        room = (numbers.mu[opened] - np.abs(numbers.nu[opened]) * size[opened] * SAFE) / SAFE
        slip = np.maximum(np.abs(low), np.abs(high)) * numbers.kappa[opened] * size[opened] * SAFE + TINY
        still = (gap > 0) & (room > 0) & (room * gap / SAFE - TINY > slip)
        sides = np.where(low > 0, 1.0, np.where(high < 0, -1.0, np.nan))
        sides = np.where(still, 0.0, sides)
        return sides if np.all(np.isfinite(sides)) else None

    def _slips(self, nodes: Indices) -> Ball:
        """t w_t of some nodes: t g - S (t lambda)."""
        system, rows, p, series = self._system, self._rows, self._system.p, self._series
        shape = len(system.S.mid), self._t.mid.shape[1] + 1
        force = Ball(np.zeros(shape), np.zeros(shape))
        slipping = self._normal[rows.side]
        bound = _turned(*self._linear(system.F0[rows.slip], system.F1[rows.slip]), slipping)
        for places, part, signs in (
            (rows.closed, _longer(self._normal), 1.0),
            (p + rows.stick, _longer(self._stuck), 1.0),
            (p + rows.slip, bound, rows.slip_signs[:, None]),
            (2 * p + rows.modes, _longer(self._rigid), 1.0),
        ):
            force[places] = signed(part, signs)
        g0, g1 = system.g0[p + nodes], system.g1[p + nodes]
        middle, radius = (Ball.exact(np.full(1, value)) for value in (series.middle, series.radius))
        t = Ball(np.repeat(self._t.mid, len(nodes), axis=0), np.repeat(self._t.rad, len(nodes), axis=0))
        return _turned(g0 + g1 * middle, g1 * radius, t) - system.S[p + nodes] @ force

    def _linear(self, constant: Floats, slope: Floats) -> tuple[Ball, Ball]:
        """constant + alpha slope by powers of tau."""
        middle, radius = (Ball.exact(np.full(1, value)) for value in (self._series.middle, self._series.radius))
        return Ball.exact(constant) + Ball.exact(slope) * middle, Ball.exact(slope) * radius


def _bernstein(polynomials: Ball, ends: tuple[float, float]) -> tuple[Floats, Floats]:
    """Bernstein coefficients of polynomials over a part of [-1, 1], and bounds of their errors."""
    low, high = (np.array([end]) for end in ends)
    values = bernstein_values(polynomials.mid[None], low, high)[0]
    k = gamma(8 * values.shape[1])
    return values, np.asarray(upper_sum(polynomials.rad + k * np.abs(polynomials.mid), axis=1))


def _between(polynomials: Ball, ends: tuple[float, float]) -> tuple[Floats, Floats]:
    """Bounds of polynomials over a part of [-1, 1]."""
    values, error = _bernstein(polynomials, ends)
    least, largest = np.min(values, axis=1), np.max(values, axis=1)
    return least - error - 2 * UNIT * (np.abs(least) + error), largest + error + 2 * UNIT * (np.abs(largest) + error)


def _values(polynomials: Ball, places: Floats) -> Floats:
    """About the values of polynomials at some tau; how far theta is off is bounded."""
    return np.asarray(polynomials.mid @ np.vander(places, polynomials.mid.shape[1], increasing=True).T)


def _longer(polynomials: Ball, by: int = 1) -> Ball:
    """Polynomials with more coefficients."""
    return Ball.beside(polynomials, Ball.exact(np.zeros((len(polynomials.mid), by))))


def _multiplied(factors: Floats, polynomials: Ball) -> Ball:
    """Products of polynomials, row by row; the factors are exact."""
    degree, count = factors.shape[1] - 1, polynomials.mid.shape[1]
    found = Ball.exact(np.zeros((len(factors), count + degree)))
    for k in range(degree + 1):
        found[:, k : k + count] = found[:, k : k + count] + polynomials * Ball.exact(factors[:, k : k + 1])
    return found


def _turned(constant: Ball, slope: Ball, polynomials: Ball) -> Ball:
    """Polynomials times constant + tau slope, one factor each."""
    longer = _longer(polynomials)
    shifted = Ball(np.roll(longer.mid, 1, axis=1), np.roll(longer.rad, 1, axis=1))
    return longer * constant[:, None] + shifted * slope[:, None]
