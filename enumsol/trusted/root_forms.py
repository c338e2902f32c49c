"""The form of a root, factorized once, and small matrices that show where it is the only one (theory, section 14.11).

Of a body that nothing holds, in 2D and 3D. What belongs to one dimension, the multipliers and the rows that an
assignment imposes, is in ``trusted.reference`` and ``trusted.space.space_reference``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, dense_eigenvalue_bound, upper_norm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats, Mask

    #: Numbers of two tight rows, and a positive factor.
    Product = tuple[int, int, float]

#: What a small matrix may lack, relative to its size; by so much more it is tried again, so often.
_LACKING, _MORE, _TRIES = 8 * UNIT, 16.0, 4


@dataclass(frozen=True)
class Body:
    """Compliance and rigid rows for the changes d of some components of lambda: G d = 0, w - w* = G'e - S d.

    Attributes
    ----------
    S : Ball (m, m)
    G : Ball (r, m)
    """

    S: Ball
    G: Ball


@dataclass(frozen=True)
class Multipliers:
    """The multipliers of a form at a root, as matrices.

    Attributes
    ----------
    form : Ball (m, m)
        D'S.
    cross : Ball (r, m)
        -G (D - c), with exact zeros.
    lost : (m,) array
        Where theta is not known exactly, for each of its components kappa times how far it may be off, otherwise 0.
    cost : (m,) array
        What the square root of -w_n d_n costs: mu lambda*_n + nu lambda*_t from below, of loaded nodes; 0 elsewhere.
    """

    form: Ball
    cross: Ball
    lost: Floats
    cost: Floats


@dataclass(frozen=True)
class RootForm:
    """The form of a root in (d, e): the changes of lambda and of q to another root.

    Attributes
    ----------
    body : Body
    least, tilt : float
        The form is at least ``least`` |d|^2 + (m - tilt) |e|^2 where the small matrix is at least m.
    table : Ball (m + r, m + r)
        W P^-1 W', W being the rows of S, then those of C.
    idle : (r,) bool array
        Modes of which C has nothing.
    cost : (m,) array
        As of Multipliers.
    """

    body: Body
    least: float
    tilt: float
    table: Ball
    idle: Mask
    cost: Floats

    @classmethod
    def of(cls, body: Body, multipliers: Multipliers, balance: float) -> Self | None:
        """None where the form plus ``balance`` |G d|^2 is not proven definite in d."""
        weighted = body.G * Ball.exact(np.array(np.sqrt(balance)))
        Q = (multipliers.form + weighted.T @ weighted).symmetric
        smallest = _least(Q)
        if not smallest > 0:
            return None
        # m |d|^2 is left out of what is factorized
        m, C = 0.5 * smallest, multipliers.cross
        table = _table(Ball.joined(body.S, C), Q - Ball.exact(m * np.eye(len(Q.mid))), m / SAFE)
        along, turned = (float(upper_norm(multipliers.lost * _sizes(rows))) for rows in (body.S, body.G.T))
        if table is None or not along <= 0.25 * m / SAFE:
            return None
        # products may underflow
        tilted = np.any((multipliers.lost > 0) & (_sizes(body.G.T) > 0))
        tilt = turned * turned / m * SAFE * SAFE + TINY if tilted else 0.0
        return cls(body, 0.5 * m / SAFE, tilt, table, ~_used(C), multipliers.cost)

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
            moved = ~_zero(Ball.joined(equations, tight)) @ ~_zero(self.body.G).T
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
            T = Ball.beside(crossed - rows @ self.body.G.T, Ball.exact(np.eye(len(rows.mid))[:, k:]))
            # any Y is a choice; with what is not finite M proves nothing
            inverse = np.linalg.pinv(np.where(np.isfinite(K.mid), K.mid, 0.0), hermitian=True, rcond=_LACKING)
            Y = Ball.exact(inverse @ T.mid)
            once = Y.T @ T
            M = M + once + once.T - Y.T @ (K @ Y)
        return M.symmetric

    def _costs(self, equations: Ball, lacking: float, reach: Floats) -> bool:
        """True if gaps of loaded nodes cost more than the form lacks (theory, (14.17))."""
        loaded = np.flatnonzero(self.cost > 0)
        rows = Ball.joined(Ball.exact(np.diag(self.cost)[loaded]), equations)
        moved = rows @ self.body.G.T
        square = _least((moved.T @ moved).symmetric)
        if not square > 0:
            return False
        if lacking == 0:
            return True
        steep = float(np.sqrt(square)) / SAFE
        pushed = float(upper_norm(_sizes(rows @ self.body.S)))
        most = float(upper_norm(2.0 * reach * SAFE))
        within = 2.0 * lacking * most * SAFE < steep
        return bool(within and lacking * (2.0 * pushed / steep) ** 2 * SAFE * SAFE < self.least)


def times(G: Ball, factors: Ball) -> Ball:
    """Columns times numbers; zeros are exact."""
    found, zero = G * factors, _zero(G) | _zero(factors)
    return Ball(np.where(zero, 0.0, found.mid), np.where(zero, 0.0, found.rad))


def plus(one: Ball, other: Ball) -> Ball:
    """The sum; zeros are exact."""
    found, zero = one + other, _zero(one) & _zero(other)
    return Ball(found.mid, np.where(zero, 0.0, found.rad))


def less(one: float, other: Floats) -> Ball:
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


def _least(M: Ball) -> float:
    """Lower bound of the smallest eigenvalue of symmetric matrices; at most 0 where none positive is proven."""
    return (dense_eigenvalue_bound(M.mid) - float(upper_norm(M.rad))) / SAFE if M.finite else 0.0


def _lacks(M: Ball) -> float:
    """A number t, negative if possible, with M + t at least 0; infinite where none was found."""
    if not len(M.mid):
        return 0.0
    least = _least(M)
    if least > 0:
        return -least
    lacking = 2.0 * float(upper_norm(M.rad)) + _LACKING * float(np.max(np.abs(M.mid))) + TINY
    for _ in range(_TRIES if np.isfinite(lacking) else 0):
        if _least(M + Ball.exact(lacking * np.eye(len(M.mid)))) > 0:
            return lacking
        lacking *= _MORE
    return np.inf
