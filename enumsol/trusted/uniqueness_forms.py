"""The trusted form of theory, (6.9), by which a solution is the only one, in 2D and 3D.

At one alpha, over a piece, and of a body that nothing holds it differs in the system and the rows that are handed in
only: ``UniqueForm`` is definite for all changes of the forces, ``RootForm`` (theory, section 14.11) for those that are
in balance, factorized once for small matrices that show where a root is alone.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Self, TypeVar

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, least_eigenvalue, upper_norm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.support.array_types import Codes, Floats, Indices, Mask

    #: Numbers of two tight rows, and a positive factor.
    Product = tuple[int, int, float]

#: A row on displacements, by its number, or in 3D by kind, node and number.
Row = TypeVar("Row", int, tuple[int, int, int])
#: What a small matrix may lack, relative to its size; by so much more it is tried again, so often.
_LACKING, _MORE, _TRIES = 8 * UNIT, 16.0, 4


@dataclass(frozen=True)
class Multipliers:
    """D, which maps d to mu d_n + push . d_t for lambda_n and to kappa (d_t - turn d_n) for lambda_t, node by node.

    Attributes
    ----------
    places : (p, k) array
        Of every lambda_t among the components of d, all lambda_n first; -1 where there is none.
    mu, kappa : (p,) arrays
    turn, push : Ball of shape (p, k)
        theta over the units of lambda_t, and nu times these.
    unit : (p, k) array
    """

    places: Indices
    mu: Floats
    kappa: Floats
    turn: Ball
    push: Ball
    unit: Floats

    def form(self, S: Ball) -> Ball:
        """D'S, (m, m), of which Q is the symmetric part."""
        form, p = S.copy(), len(self.mu)
        form[:p] = S[:p] * Ball.exact(self.mu[:, None])
        for k, has, t in self._tangents():
            kappa = Ball.exact(self.kappa[has])
            turned = form[has] - S[t] * (self.turn[has, k] * kappa)[:, None]
            form[t] = S[t] * kappa[:, None] + S[has] * self.push[has, k][:, None]
            form[has] = turned
        return form

    def taken(self, S: Ball, off: Floats, lost: Floats) -> Ball:
        """The most that a theta which is off takes from the form (theory, section 6.11 and (7.18)).

        ``lost``: any positive numbers where ``off`` is positive; elsewhere both are 0.
        """
        taken, n = Ball.exact(np.zeros_like(S.mid)), np.flatnonzero(lost > 0)
        for k, has, t in self._tangents():
            used = np.flatnonzero(lost[has] > 0)
            i = has[used]
            # weights at least kappa off / sqrt(lost), for any rounding
            weight = self.kappa[i] * off[i] / np.sqrt(lost[i]) / self.unit[i, k]
            rows = S[t[used]] * Ball.exact((weight * SAFE + TINY)[:, None])
            square = rows.T @ rows
            taken = taken + Ball(0.5 * square.mid, 0.5 * square.rad)
        taken.mid[n, n] += 0.5 * lost[n]
        taken.rad[n, n] += 2 * UNIT * taken.mid[n, n]
        return taken

    def slip_sizes(self, S: Ball) -> Floats:
        """Upper bounds of the norms of the rows of S that give the slip, node by node, (p,)."""
        found = np.zeros(self.places.shape)
        for k, has, t in self._tangents():
            found[has, k] = upper_norm(S[t].size, axis=1) / self.unit[has, k] * SAFE
        return np.asarray(upper_norm(found, axis=1))

    def moved(self, change: Floats) -> float:
        """Upper bound of ||D'delta||, |delta| <= change."""
        moved, p = np.zeros_like(change), len(self.mu)
        moved[:p] = self.mu * change[:p]
        for k, has, t in self._tangents():
            moved[has] += self.kappa[has] * self.turn.size[has, k] * change[t]
            moved[t] = self.push.size[has, k] * change[has] + self.kappa[has] * change[t]
        return float(upper_norm(moved * SAFE + TINY) * SAFE)

    def price(self, y: Ball) -> Ball:
        """mu lambda_n + push . lambda_t, (p,)."""
        price = Ball.exact(self.mu) * y[: len(self.mu)]
        for k, has, t in self._tangents():
            price[has] = price[has] + self.push[has, k] * y[t]
        return price

    def turned(self, y: Ball) -> Ball:
        """kappa (lambda_t - turn lambda_n) at the places of lambda_t, (m,); 0 at lambda_n."""
        turned = Ball.exact(np.zeros(len(y.mid)))
        for k, has, t in self._tangents():
            turned[t] = (y[t] - self.turn[has, k] * y[has]) * Ball.exact(self.kappa[has])
        return turned

    def cross(self, G: Ball, share: float) -> Ball:
        """C = -G (D - c), (r, m), without radius where nothing is left of it."""
        C, p = Ball.exact(np.zeros(G.shape)), len(self.mu)
        C[:, :p] = _times(G[:, :p], _less(share, self.mu))
        for k, has, t in self._tangents():
            kappa = self.kappa[has]
            C[:, has] = _plus(C[:, has], _times(_times(G[:, t], self.turn[has, k]), Ball.exact(kappa)))
            C[:, t] = _plus(_times(G[:, has], -self.push[has, k]), _times(G[:, t], _less(share, kappa)))
        return C

    def _tangents(self) -> list[tuple[int, Indices, Indices]]:
        """Number of every axis, the nodes that have a lambda_t there, and its places."""
        nodes = [np.flatnonzero(places >= 0) for places in self.places.T]
        return [(k, has, self.places[has, k]) for k, has in enumerate(nodes)]


@dataclass(frozen=True)
class UniqueForm:
    """Q, proven definite, less what is lost where the form serves any theta: two solutions would make it negative.

    Attributes
    ----------
    S : Ball (m, m)
    numbers : Multipliers
    off, lost : (p,) arrays
        Both positive where the form serves any theta: the largest |theta|, and what is given for it.
    held : Ball or None
        Rows that vanish for the difference of two solutions; or whose squares count.
    least : float
        Positive lower bound of the eigenvalues of Q.
    """

    S: Ball
    numbers: Multipliers
    off: Floats
    lost: Floats
    held: Ball | None
    least: float

    @classmethod
    def of(cls, S: Ball, numbers: Multipliers, off: Floats, lost: Floats, held: Ball | None = None) -> Self | None:
        """None where Q is not proven definite."""
        least = _smallest(S, numbers, off, lost, held)
        return cls(S, numbers, off, lost, held, least) if least > 0 else None

    def serves(self, off: Floats, errors: float = 1.0) -> bool:
        """True if Q is definite for every theta that is no farther than ``off`` from that of the numbers, (p,).

        ``errors``: so often ``off`` counts.
        """
        lost = self.numbers.kappa * off * self.numbers.slip_sizes(self.S)
        if not np.all(np.isfinite(lost)):
            return False
        if self.least > errors * upper_norm(lost * SAFE + TINY) * SAFE:
            return True
        # node by node
        wide, apart = self.lost > 0, off > 0
        off = np.where(wide, self.off, np.where(apart, errors * off * SAFE, 0.0))
        lost = np.where(wide, self.lost, np.where(apart, lost + TINY, 0.0))
        return _smallest(self.S, self.numbers, off, lost, self.held) > 0


def _smallest(S: Ball, numbers: Multipliers, off: Floats, lost: Floats, held: Ball | None) -> float:
    """Lower bound of the eigenvalues of Q less what is lost, plus held'held; at most 0 if none positive is proven."""
    if not len(S.mid):
        return 1.0
    Q = numbers.form(S) - numbers.taken(S, off, lost)
    return least_eigenvalue((Q if held is None else Q + held.T @ held).symmetric)


@dataclass(frozen=True)
class RootForm:
    """The form of a root in (d, e): the changes of lambda and of q to another root.

    Attributes
    ----------
    S : Ball (m, m)
    G : Ball (r, m)
        Compliance and rigid rows: G d = 0, w - w* = G'e - S d.
    least, tilt : float
        The form is at least ``least`` |d|^2 + (m - tilt) |e|^2 where the small matrix is at least m.
    table : Ball (m + r, m + r)
        W P^-1 W', W being the rows of S, then those of C.
    idle : (r,) bool array
        Modes of which C has nothing.
    cost : (m,) array
        What the square root of -w_n d_n costs: mu lambda*_n + nu lambda*_t from below, of loaded nodes; 0 elsewhere.
    """

    S: Ball
    G: Ball
    least: float
    tilt: float
    table: Ball
    idle: Mask
    cost: Floats

    @classmethod
    def of(
        cls,
        S: Ball,
        G: Ball,
        numbers: Multipliers,
        off: Floats,
        loaded: tuple[Ball, Mask],
        balance: float,
        share: float,
    ) -> Self | None:
        """None where the form plus ``balance`` |G d|^2 is not proven definite in d.

        Parameters
        ----------
        S, G : Balls of shapes (m, m) and (r, m)
        numbers : Multipliers
        off : (p,) array
            Distance of theta from one that serves the root.
        loaded : forces of the root, (m,), and the nodes that are not open
        balance : not negative
        share : c of theory, (14.14)
        """
        force, closed = loaded
        lost, cost = np.zeros(len(S.mid)), np.zeros(len(S.mid))
        for k, places in enumerate(numbers.places.T):
            has = np.flatnonzero((places >= 0) & (off > 0))
            lost[places[has]] = numbers.kappa[has] * off[has] / numbers.unit[has, k] * SAFE + TINY
        if not np.all(np.isfinite(lost)):
            return None
        cost[: len(off)] = np.where(closed, np.maximum(numbers.price(force).low / SAFE, 0.0), 0.0)
        return cls.factored((S, G), numbers.form(S), numbers.cross(G, share), lost, cost, balance)

    @classmethod
    def factored(
        cls, body: tuple[Ball, Ball], form: Ball, C: Ball, lost: Floats, cost: Floats, balance: float
    ) -> Self | None:
        """By D'S and C = -G (D - c) as matrices.

        Parameters
        ----------
        body : S and G
        form, C : Balls of shapes (m, m) and (r, m), with exact zeros
        lost : (m,) array
            Where theta is not known exactly, for each of its components kappa times how far it may be off, otherwise 0.
        cost : (m,) array
        balance : not negative
        """
        S, G = body
        weighted = G * Ball.exact(np.array(np.sqrt(balance)))
        Q = (form + weighted.T @ weighted).symmetric
        smallest = least_eigenvalue(Q)
        if not smallest > 0:
            return None
        # m |d|^2 is left out of what is factorized
        m = 0.5 * smallest
        table = _table(Ball.joined(S, C), Q - Ball.exact(m * np.eye(len(Q.mid))), m / SAFE)
        along, turned = (float(upper_norm(lost * _sizes(rows))) for rows in (S, G.T))
        if table is None or not along <= 0.25 * m / SAFE:
            return None
        # products may underflow
        tilted = np.any((lost > 0) & (_sizes(G.T) > 0))
        tilt = turned * turned / m * SAFE * SAFE + TINY if tilted else 0.0
        return cls(S, G, 0.5 * m / SAFE, tilt, table, ~_used(C), cost)

    def is_only_root(self, equations: Ball, tight: Ball, products: Sequence[Product], reach: Floats) -> bool:
        """True if no other root has its changes of w in these rows, and |q| within reach.

        Parameters
        ----------
        equations : Ball (k, m)
            Rows a with a (w - w*) = 0 for all roots in question.
        tight : Ball (l, m)
            Rows a with a (w - w*) >= 0.
        products : of tight rows
        reach : (r,) array, bounds of q, may be infinite
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            r, M = len(self.idle), self.small_matrix(equations, tight, products)
            moved = ~_zero(Ball.joined(equations, tight)) @ ~_zero(self.G).T
            idle = self.idle & ~np.any(moved, axis=0)
            used = np.flatnonzero(np.append(~idle, np.ones(len(M.mid) - r, dtype=bool)))
            lacking = _lacks(M[np.ix_(used, used)])
            if lacking + self.tilt < 0 and not np.any(idle):
                return True
            # changes of tight rows are not bounded
            bounded = lacking < 0 or not len(tight.mid)
            return bounded and self._costs(equations, max(lacking, 0.0) + self.tilt, reach)

    def small_matrix(self, equations: Ball, tight: Ball, products: Sequence[Product]) -> Ball:
        """The matrix M of theory, (14.15), in e and the changes of the tight rows."""
        r, k = len(self.idle), len(equations.mid)
        rows = Ball.joined(equations, tight)
        least = np.zeros((r + len(tight.mid),) * 2)
        for one, other, factor in products:
            least[r + one, r + other] -= 0.5 * factor
            least[r + other, r + one] -= 0.5 * factor
        M = Ball.exact(least)
        m = len(self.cost)
        M[:r, :r] = self.table[m:, m:] * Ball.exact(np.array(-0.25))
        if len(rows.mid):
            K = rows @ self.table[:m, :m] @ rows.T
            # u = -rows S
            crossed = rows @ self.table[:m, m:] * Ball.exact(np.array(-0.5))
            T = Ball.beside(crossed - rows @ self.G.T, Ball.exact(np.eye(len(rows.mid))[:, k:]))
            # any Y is a choice; with what is not finite M proves nothing
            inverse = np.linalg.pinv(np.where(np.isfinite(K.mid), K.mid, 0.0), hermitian=True, rcond=_LACKING)
            Y = Ball.exact(inverse @ T.mid)
            once = Y.T @ T
            M = M + once + once.T - Y.T @ (K @ Y)
        return M.symmetric

    def _costs(self, equations: Ball, lacking: float, reach: Floats) -> bool:
        """True if gaps of loaded nodes cost more than the form lacks (theory, (14.17))."""
        loaded = np.flatnonzero(self.cost > 0)
        steep, pushed = self._slopes(Ball.joined(Ball.exact(np.diag(self.cost)[loaded]), equations))
        if not steep > 0:
            return False
        if lacking == 0:
            return True
        most = float(upper_norm(2.0 * reach * SAFE))
        within = 2.0 * lacking * most * SAFE < steep
        return bool(within and lacking * (2.0 * pushed / steep) ** 2 * SAFE * SAFE < self.least)

    def _slopes(self, rows: Ball) -> tuple[float, float]:
        """gamma, or 0, and Gamma (theory, section 14.11): rows (w - w*) are at least gamma |e| - Gamma |d|."""
        moved = rows @ self.G.T
        square = least_eigenvalue((moved.T @ moved).symmetric)
        return float(np.sqrt(max(square, 0.0))) / SAFE, float(upper_norm(_sizes(rows @ self.S)))

    def is_sole(self, cost: Floats, least: float, left: float, farthest: float) -> bool:
        """True if no other root has |d| within ``farthest``, where changes of w cost so much (theory, (14.23)).

        Parameters
        ----------
        cost : (m,) array, not negative
        least, left : as of a ForceBound (theory, section 14.15)
        farthest : float
        """
        steep, pushed = self._slopes(Ball.exact(np.diag(cost)[cost > 0]))
        near = left * 2.0 * pushed * SAFE * SAFE < steep * least
        return bool(steep > 0 and near and 2.0 * left * farthest * SAFE * SAFE < steep)


@dataclass(frozen=True)
class RootReference(ABC, Generic[Row]):
    """A strict root of a body that nothing holds, and its form (theory, section 14.11).

    Attributes
    ----------
    system : EnclosedSystem, in 3D EnclosedSpace
    selection : final codes, in 3D of a leaf
    form : RootForm
    """

    system: EnclosedSystem
    selection: Codes
    form: RootForm

    def is_only_root(
        self, codes: Sequence[int], rows: Sequence[Row], products: Sequence[tuple[Row, Row, float]], reach: Floats
    ) -> bool:
        """True if every root below an assignment, with |q| within reach, is this one.

        Parameters
        ----------
        codes : status codes
        rows : rows on displacements that are equations below the assignment and at the root
        products : pairs of rows that are nonnegative below the assignment and not positive at the root, and a factor
        reach : (r,) array, bounds of q, may be infinite

        Raises
        ------
        ValueError
            In 3D, a node has no such row.
        """
        rows, tight = sorted(set(rows)), sorted({row for one, other, _ in products for row in (one, other)})
        if not self.allow(codes, rows, tight) or not all(0 < factor < np.inf for *_, factor in products):
            return False
        numbered = [(tight.index(one), tight.index(other), factor) for one, other, factor in products]
        return self.form.is_only_root(self.rows(rows), self.rows(tight), numbered, reach)

    @abstractmethod
    def allow(self, codes: Sequence[int], rows: Sequence[Row], tight: Sequence[Row]) -> bool:
        """True if the first rows are equations, and the others nonnegative but not positive at the root."""

    @abstractmethod
    def rows(self, rows: Sequence[Row]) -> Ball:
        """Rows as coefficients of the components of w that d has."""


def _times(G: Ball, factors: Ball) -> Ball:
    """Columns times numbers; zeros are exact."""
    found, zero = G * factors, _zero(G) | _zero(factors)
    return Ball(np.where(zero, 0.0, found.mid), np.where(zero, 0.0, found.rad))


def _plus(one: Ball, other: Ball) -> Ball:
    """The sum; zeros are exact."""
    found, zero = one + other, _zero(one) & _zero(other)
    return Ball(found.mid, np.where(zero, 0.0, found.rad))


def _less(one: float, other: Floats) -> Ball:
    """A number less others; what is zero is exact."""
    return Ball(one - other, 2 * UNIT * np.abs(one - other))


def _zero(values: Ball) -> Mask:
    return np.asarray((values.mid == 0) & (values.rad == 0))


def _used(rows: Ball) -> Mask:
    """Rows that are not zero."""
    return np.asarray(np.any(~_zero(rows), axis=1))


def _table(W: Ball, P: Ball, least: float) -> Ball | None:
    """W P^-1 W' where P is at least so large (theory, (14.16))."""
    try:
        N = Ball.exact(W.mid @ np.linalg.inv(P.mid))
    except np.linalg.LinAlgError:
        return None
    rest = W - N @ P
    size = _sizes(rest)
    found = (W @ N.T + N @ rest.T).symmetric
    found = Ball(found.mid, (found.rad + np.outer(size, size) / least * SAFE + TINY) * SAFE)
    return found if found.finite else None


def _sizes(rows: Ball) -> Floats:
    """Upper bounds of the norms of rows; 0 where a row is."""
    return np.where(_used(rows), upper_norm(rows.size, axis=1), 0.0) if len(rows.mid) else np.zeros(0)


def _lacks(M: Ball) -> float:
    """A number t, negative if possible, with M + t at least 0; infinite where none was found."""
    if not len(M.mid):
        return 0.0
    least = least_eigenvalue(M)
    if least > 0:
        return -least
    lacking = 2.0 * float(upper_norm(M.rad)) + _LACKING * float(np.max(np.abs(M.mid))) + TINY
    for _ in range(_TRIES if np.isfinite(lacking) else 0):
        if least_eigenvalue(M + Ball.exact(lacking * np.eye(len(M.mid)))) > 0:
            return lacking
        lacking *= _MORE
    return np.inf
