"""The trusted core of directional stability: no growing motion for a range of mu, or one (theory, section 15).

A motion u* + exp(rho t) v, mu = rho^2, moves the rows of the contact nodes by w = R x, with a component x_i of x for
every node at its limit (how far it slides, at least zero) and for every direction of a node that touches without
force; all other rows stand still. K(mu) (`condensation.dynamic`) gives the change of forces, y = -K(mu) w. At a node at
its limit r_i = F y_n - s y_t = T_i'K(mu) R x is at least zero, too, and x_i r_i = 0.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import (
    SAFE,
    TINY,
    Ball,
    determinant_sign,
    gamma,
    least_eigenvalue,
    nearest,
    solution,
)
from enumsol.trusted.status_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.condensation.dynamic import DynamicStiffness
    from enumsol.support.array_types import Floats, Mask

    #: K or a slope of it, and a bound of how far K lies above a chord.
    _End = tuple[Ball, Ball | None]

#: Ways in which nodes slide or stay that are looked at for one range of mu: a file could ask for any number of them.
MOST_WAYS = 20_000
#: Rows up to which products are those of dense matrices, which takes less time there.
_SMALL = 64


class Stiffness(Protocol):
    """K(mu), in balls or, for what is only tried, in floats."""

    @property
    def increases(self) -> bool:
        """True if K(mu) increases with mu."""

    def at(self, mu: float) -> Ball | None:
        """K(mu), (m, m); None where it is not known."""


@dataclass(frozen=True, eq=False)
class Touching:
    """A node that touches without force: components of x in which it leaves the obstacle and slides, and F.

    Attributes
    ----------
    leaves : int
        Its rows move by -w_n.
    slides : tuple of int
    F : Ball of shape ()
        Its coefficient, the smaller one of two.
    """

    leaves: int
    slides: tuple[int, ...]
    F: Ball


@dataclass(frozen=True, eq=False)
class Motions:
    """Directions in which contact rows may begin to move at an equilibrium, k of them (theory, (15.4)).

    Attributes
    ----------
    moves : Ball (m, k)
        R: how every component of x moves the rows. First come the nodes at their limit.
    slopes : Ball (m, l)
        T_i of every node at its limit: a slip and a rise with w_n = -F |w_t|.
    signed : (k,) bool array
        Components that are at least zero.
    touching : tuple of Touching
        Nodes that touch without force.
    unsure : tuple of int
        Nodes that may be at their limit or stick: where x_i = 0, r_i may have either sign.
    """

    moves: Ball
    slopes: Ball
    signed: Mask
    touching: tuple[Touching, ...] = ()
    unsure: tuple[int, ...] = ()

    @cached_property
    def leaning(self) -> Ball:
        """T_i of nodes at their limit, and moves of those that touch, (m, k)."""
        return Ball.beside(self.slopes, self.moves[:, self.limits :])

    @property
    def limits(self) -> int:
        """Number of nodes at their limit, l."""
        return self.slopes.shape[1]


@dataclass(frozen=True, eq=False)
class NoMotion:
    """Numbers by which nothing grows for mu in a range, with some nodes decided (theory, section 15.3).

    Attributes
    ----------
    low, high : float
        Ends of the range; ``high`` may be infinite.
    beside : float or None
        Another mu, below ``low`` or above ``high``: K is concave, and its slope from there bounds it from above. None:
        that it increases does.
    slides, stays : tuples of signed components
        Those with r_i = 0, and with x_i = 0; r is y_n of a node that touches.
    weights : (k, k) array
        kappa. Entries beside (i, i) in rows of signed components are at most zero in columns of signed components, and
        zero in others; a node that touches may lean by at most F. Rows of components that slide are free.
    products : pair of (k, k) arrays
        N at both ends, of entries >= 0 that belong to signed components and of zeros.
    """

    low: float
    high: float
    beside: float | None
    slides: tuple[int, ...]
    stays: tuple[int, ...]
    weights: Floats
    products: tuple[Floats, Floats]

    # what overflows is not finite, and proves nothing
    @np.errstate(all="ignore")
    def holds(self, stiffness: DynamicStiffness, motions: Motions) -> bool:
        """True if it is proven that nothing grows in the range."""
        if not 0 <= self.low < self.high or not self._admitted(motions):
            return False
        kept = np.setdiff1d(np.arange(len(motions.signed)), self.stays)
        if not len(kept):
            return True
        plain = np.array_equal(self.weights, np.eye(len(motions.signed)))
        left = motions.leaning[:, kept] if plain else motions.leaning @ Ball.exact(self.weights[:, kept])
        right = motions.moves[:, kept]
        acts = (motions.leaning.size != 0).astype(float) @ (self.weights[:, kept] != 0) + right.size != 0
        if not np.all(np.any(acts, axis=0)):
            return False
        # zero minus zero has no radius: large matrices stay sparse
        apart = left - right
        forms = left, right, Ball(apart.mid, np.where(acts, apart.rad, 0.0))
        return any(
            all(_definite(forms, acts, end, N[np.ix_(kept, kept)]) for end, N in zip(ends, self.products, strict=True))
            for ends in self._ends(stiffness)
        )

    def _admitted(self, motions: Motions) -> bool:
        """True if the numbers have the signs that the theorem asks for."""
        k, signed = len(motions.signed), motions.signed
        decided = {*self.slides, *self.stays}
        if len(decided) != len(self.slides) + len(self.stays) or not all(0 <= i < k and signed[i] for i in decided):
            return False
        if self.weights.shape != (k, k) or any(N.shape != (k, k) for N in self.products):
            return False
        if not all(np.all(np.isfinite(a)) for a in (self.weights, *self.products)):
            return False
        beside = self.weights.copy()
        beside[list(self.slides)] = 0.0
        # a component that is zero may be multiplied by anything
        beside[:, list(self.stays)] = 0.0
        beside[signed, signed] = 0.0
        for node in motions.touching:
            own = list(node.slides)
            if node.leaves in self.slides:
                beside[own] = 0.0
                continue
            share = self.weights[own, own]
            lean = float(np.linalg.norm(beside[node.leaves, own])) * SAFE
            if np.any(share != share[:1]) or np.any(share < 0):
                return False
            if own and not lean <= share[0] * max(0.0, float(node.F.low)) / SAFE:
                return False
            beside[node.leaves, own] = beside[own, own] = 0.0
        pairs = np.outer(signed, signed)
        if np.any(beside[list(motions.unsure)]):
            return False
        return (
            bool(np.all(beside[:, signed] <= 0))
            and not np.any(beside[~signed])
            and not np.any(beside[:, ~signed])
            and all(bool(np.all(N[pairs] >= 0)) and not np.any(N[~pairs]) for N in self.products)
        )

    def _ends(self, stiffness: DynamicStiffness) -> Iterator[tuple[_End, _End]]:
        """At either end K or, for an infinite one, its slope, with a bound of how far K lies above the chord there."""
        low, high, beside = self.low, self.high, self.beside
        K, other = stiffness.at(low), None if beside is None else stiffness.at(beside)
        if K is None or (beside is not None and (other is None or not (beside < low or high < beside < np.inf))):
            return
        if np.isinf(high):
            slope = None
            if other is not None and beside is not None:
                slope = (K - other) * nearest([1 / (Fraction(low) - Fraction(beside))])[0]
            yield from self._without_end(stiffness, K, slope)
            return
        end = stiffness.at(high)
        if end is None:
            return
        if other is None or beside is None:
            if stiffness.increases:
                yield (K, end - K), (end, None)
            return
        first, length = Fraction(low), Fraction(high) - Fraction(low)
        if beside < low:
            yield (K, None), (end, K + (K - other) * nearest([length / (first - Fraction(beside))])[0] - end)
        else:
            yield (K, end - (other - end) * nearest([length / (Fraction(beside) - first - length)])[0] - K), (end, None)

    @staticmethod
    def _without_end(stiffness: DynamicStiffness, K: Ball, slope: Ball | None) -> Iterator[tuple[_End, _End]]:
        """The ends of a range without end: rows that yield have a largest K, the others a smallest slope."""
        yields, limit = stiffness.yields, stiffness.stiffest
        if limit is None or not stiffness.increases:
            return
        # the square of a sum of two is at most twice the sum of their squares
        share = Ball.exact(np.array(1.0 if len({*yields.tolist()}) == 1 else 2.0))
        first = K, _among((limit - K) * share, yields)
        if np.all(yields):
            yield first, (Ball.exact(np.zeros_like(K.mid)), None)
        elif slope is not None and (least := stiffness.steepest) is not None:
            yield first, (least, _among((slope - least) * share, ~yields))


@dataclass(frozen=True)
class Behaviour:
    """Statuses of the nodes at their limit, as those that slide, and of those that touch, in one part of the body.

    Attributes
    ----------
    slides : tuple of indices of the nodes at their limit that slide
    touching : tuple of status codes
        Of the nodes that touch without force.
    """

    slides: tuple[int, ...]
    touching: tuple[int, ...] = ()

    def equations(self, motions: Motions) -> tuple[Ball, list[int]] | None:
        """Rows whose work vanishes, as columns, and the components that are not zero."""
        rows, own = [motions.slopes[:, list(self.slides)]], list(self.slides)
        for node, code in zip(motions.touching, self.touching, strict=True):
            if code == OPEN:
                columns = [node.leaves, *node.slides]
                rows.append(motions.moves[:, columns])
            elif code in (SLIP_PLUS, SLIP_MINUS) and len(node.slides) == 1:
                columns = list(node.slides)
                rows.append(_slope(motions, node, code))
            elif code == STICK:
                continue
            else:
                return None
            own += columns
        return Ball.beside(*rows), own

    def signs(self, motions: Motions, x: Ball, forces: Ball, more: Ball | None = None) -> Ball:
        """Numbers that are positive if every node strictly does what it is said to do; ``forces`` are -y, (m, 1).

        ``more`` is what the rates of friction add to r of the nodes at their limit.
        """
        r = (motions.slopes.T @ forces)[:, 0]
        r = r if more is None else r + more
        signs = [x[i : i + 1] if i in self.slides else r[i : i + 1] for i in range(motions.limits)]
        for node, code in zip(motions.touching, self.touching, strict=True):
            if code == OPEN:
                signs.append(x[node.leaves : node.leaves + 1])
                continue
            signs.append((motions.moves[:, [node.leaves]].T @ forces)[:, 0])
            if code != STICK:
                slip = x[list(node.slides)]
                signs.append(slip if code == SLIP_PLUS else -slip)
            elif len(node.slides) > 1:
                signs.append(_room(motions, node, forces))
            elif node.slides:
                signs += [(_slope(motions, node, way).T @ forces)[:, 0] for way in (SLIP_PLUS, SLIP_MINUS)]
        return Ball.joined(*signs) if signs else Ball.exact(np.zeros(0))


def rates_in(
    K: Ball, motions: Motions, held: Ball, way: Behaviour, more: Ball | None = None
) -> tuple[bool | None, Ball]:
    """Test how nodes go on under a rate of load if they do what is said of them (theory, section 15.5).

    Parameters
    ----------
    K : Ball (m, m)
        K(0).
    motions : Motions
        In 3D none that touch.
    held : Ball (m,)
        Rates of the forces y with w = 0.
    way : Behaviour
    more : Ball (l,), optional
        F' lambda_n of the nodes at their limit, if friction changes.

    Returns
    -------
    (answer, y)
        Whether they do, strictly; False: no solution has them do so. None: neither is proven. y (m,) are the rates of
        the forces.
    """
    rows = way.equations(motions)
    if rows is None:
        return None, held
    left, own = rows
    x = Ball.exact(np.zeros(len(motions.signed)))
    if own:
        # left'(held - K R x) = more
        goal = left.T @ held[:, None]
        slid = list(way.slides)
        if more is not None and slid:
            goal[: len(slid)] = goal[: len(slid)] - more[slid][:, None]
        moved = solution(_across(left, K, motions.moves[:, own]), goal)
        if moved is None:
            return None, held
        x[own] = moved[:, 0]
    y = held - (K @ (motions.moves @ x[:, None]))[:, 0]
    signs = way.signs(motions, x, -y[:, None], more)
    if np.any(signs.mid + signs.rad < 0):
        return False, y
    return (True if np.all(signs.mid - signs.rad > 0) else None), y


@dataclass(frozen=True, eq=False)
class Growing:
    """A range of mu in which a motion grows, and what every node does in it (theory, section 15.4).

    Attributes
    ----------
    low, high : float
        Bounds of the square of its growth rate.
    way : Behaviour
    """

    low: float
    high: float
    way: Behaviour

    @np.errstate(all="ignore")
    def found(self, stiffness: Stiffness, motions: Motions) -> Ball | None:
        """The motion x, (k,), if it is proven to be there."""
        k = len(motions.signed)
        slides, touching = self.way.slides, self.way.touching
        if motions.unsure or not 0 < self.low < self.high < np.inf or len(touching) != len(motions.touching):
            return None
        if list(slides) != sorted({*slides}) or not all(0 <= i < motions.limits for i in slides):
            return None
        first, last, rows = stiffness.at(self.low), stiffness.at(self.high), self.way.equations(motions)
        if first is None or last is None or rows is None or not rows[1] or not stiffness.increases:
            return None
        left, own = rows
        right = motions.moves[:, own]
        if determinant_sign(_across(left, first, right)) * determinant_sign(_across(left, last, right)) >= 0:
            return None
        # K(low) <= K(mu) <= K(high)
        spread = np.sqrt(np.maximum((last - first).high.diagonal(), 0.0)) * SAFE + TINY
        K = Ball(first.mid, (first.rad + np.outer(spread, spread)) * SAFE)
        vector = _null_vector(_across(left, K, right))
        if vector is None:
            return None
        x = Ball.exact(np.zeros(k))
        x[own] = vector[:, 0]
        signs = self.way.signs(motions, x, K @ (right @ vector))
        return x if np.all(signs.mid - signs.rad > 0) else None


@dataclass(frozen=True, eq=False)
class Crossing:
    """A range of mu in which some motion grows, whatever it is (theory, section 15.4).

    Attributes
    ----------
    low, high : float
        Some motion grows for a mu between them.
    push : (k,) array, >= 0, or None
        Rows r with these weights are negative at one end for all x >= 0 but zero; at the other the form is definite.
    load : (k,) array or None
        In place of ``push``: the ways in which the nodes go on under r = load at that end do not add up to one.
    """

    low: float
    high: float
    push: Floats | None = None
    load: Floats | None = None

    def holds(self, stiffness: Stiffness, motions: Motions) -> bool:
        """True if it is proven; only where no node touches and all are at their limit for certain."""
        if motions.touching or motions.unsure or not 0 <= self.low < self.high < np.inf or not motions.limits:
            return False
        numbers = self.load if self.push is None else self.push
        if numbers is None or numbers.shape != (motions.limits,) or not np.all(np.isfinite(numbers)):
            return False
        first, last = stiffness.at(self.low), stiffness.at(self.high)
        if first is None or last is None:
            return False
        ends = (self.low, first), (self.high, last)
        with np.errstate(all="ignore"):
            return any(
                positive(_across(motions.slopes, other, motions.moves).symmetric) and self._differs(motions, mu, K)
                for (mu, K), (_, other) in (ends, ends[::-1])
            )

    def _differs(self, motions: Motions, mu: float, K: Ball) -> bool:
        """True if the degree of x -> min(x, L x) is proven not to be one, or L x >= 0 is complementary to some x."""
        if self.push is not None:
            pushed = Ball.exact(self.push[None]) @ _across(motions.slopes, K, motions.moves)
            return bool(np.all(self.push >= 0) and np.all(pushed.mid + pushed.rad < 0))
        # at rest a complementary x would be no motion that grows
        return self.load is not None and mu > 0 and _degree(K, motions, self.load) not in (1, None)


def _degree(K: Ball, motions: Motions, load: Floats) -> int | None:
    """The sum of the signs of det L over all nodes that slide in 0 <= x, r = load + L x >= 0; None if not proven."""
    k, total, none = motions.limits, 0, Ball.exact(np.zeros(len(K.mid)))
    if 2**k > MOST_WAYS:
        return None
    for slides in itertools.chain.from_iterable(itertools.combinations(range(k), size) for size in range(k + 1)):
        own = list(slides)
        answer, _ = rates_in(K, motions, none, Behaviour(slides), Ball.exact(load))
        sign = determinant_sign(_across(motions.slopes[:, own], K, motions.moves[:, own])) if answer and own else 1
        if answer is None or not sign:
            return None
        total += sign if answer else 0
    return total


def _definite(forms: tuple[Ball, Ball, Ball], acts: Mask, end: _End, N: Floats) -> bool:
    """True if left'K right - apart'E apart / 4 - N has a positive symmetric part, but for what K and N leave at zero.

    Parameters
    ----------
    forms : left, right, apart, Balls (m, q)
    acts : (m, q) bool array
        Where left or right is not zero.
    end : (K, E)
        E is zero in rows in which K is.
    N : (q, q) array
    """
    (left, right, apart), (K, bend) = forms, end
    own = np.any(acts[np.any(K.size != 0, axis=1)], axis=0)
    if np.any(N[~own]) or np.any(N[:, ~own]):
        return False
    if not np.any(own):
        return True
    Q = _across(left[:, own], K, right[:, own]).symmetric - Ball.exact(N[np.ix_(own, own)]).symmetric
    if bend is not None and np.any(bend.size):
        Q = Q - Ball.exact(np.array(0.25)) * _across(apart[:, own], bend, apart[:, own]).symmetric
    return positive(Q)


def _among(K: Ball, rows: Mask) -> Ball:
    """K between some rows, zero elsewhere."""
    own = np.outer(rows, rows)
    return Ball(np.where(own, K.mid, 0.0), np.where(own, K.rad, 0.0))


def _slope(motions: Motions, node: Touching, code: int) -> Ball:
    """T of a node that touches and begins to slip."""
    along, leaves = motions.moves[:, list(node.slides)], motions.moves[:, [node.leaves]]
    return leaves * Ball(node.F.mid.reshape(1, 1), node.F.rad.reshape(1, 1)) + (along if code == SLIP_PLUS else -along)


def _room(motions: Motions, node: Touching, forces: Ball) -> Ball:
    """A lower bound of F y_n - |y_t|, of a node in 3D that touches and sticks."""
    pressure, along = (motions.moves[:, list(own)].T @ forces for own in ([node.leaves], node.slides))
    size = float(np.linalg.norm(np.abs(along.mid) + along.rad)) * SAFE
    friction = Ball(node.F.mid.reshape(1, 1), node.F.rad.reshape(1, 1))
    return (friction * pressure)[:, 0] - Ball.exact(np.array([size]))


def _null_vector(M: Ball) -> Ball | None:
    """All x with M x = 0 and c'x = 1 for a suitable c, of every singular matrix in a ball, (q, 1)."""
    q = len(M.mid)
    if q == 1:
        return Ball.exact(np.ones((1, 1)))
    if not M.finite:
        return None
    U, _, V = np.linalg.svd(M.mid)
    dropped = int(np.argmax(np.abs(U[:, -1])))
    kept = np.delete(np.arange(q), dropped)
    bordered = Ball.joined(M[kept], Ball.exact(V[-1:] * (np.sign(np.sum(V[-1])) or 1.0)))
    return solution(bordered, Ball.exact(np.eye(q)[:, -1:]))


def _across(left: Ball, K: Ball, right: Ball) -> Ball:
    """left' K right; most entries of ``left`` and ``right`` are zero."""
    return _times(_times(K, right).T, left).T


def _times(K: Ball, right: Ball) -> Ball:
    """K times a matrix; a large one is sparse, with at most as many terms in a sum as K has columns."""
    if K.mid.shape[-1] <= _SMALL:
        return K @ right
    middle, spread = sp.csc_array(right.mid), sp.csc_array(right.rad)
    k = gamma(K.mid.shape[-1] + 4)
    size, both = np.abs(K.mid), abs(middle) + spread
    rad = K.rad @ both + size @ spread + k * (size @ abs(middle))
    return Ball(np.asarray(K.mid @ middle), np.asarray(rad * (1.0 + k) * SAFE + TINY))


def positive(Q: Ball) -> bool:
    """True if all symmetric matrices in a ball are positive definite."""
    if not Q.finite or np.any(Q.mid.diagonal() <= 0):
        return False
    unit = np.ldexp(1.0, -np.round(0.5 * np.log2(Q.mid.diagonal())).astype(int))
    scale = unit[:, None] * unit
    return least_eigenvalue(Ball(Q.mid * scale, Q.rad * scale * SAFE + TINY)) > 0


def left_open(leaves: Sequence[NoMotion]) -> tuple[float, float] | None:
    """The first range of mu in which leaves, which hold, are not about every way; None if there is none."""
    ends = sorted({0.0, np.inf, *(leaf.low for leaf in leaves), *(leaf.high for leaf in leaves)})
    for low, high in itertools.pairwise(ends):
        if not covers([leaf for leaf in leaves if leaf.low <= low and high <= leaf.high]):
            return low, high
    return None


def covers(leaves: Sequence[NoMotion], most: int = MOST_WAYS) -> bool:
    """True if every way in which nodes slide or stay is one that some leaf is about; at most so many are looked at."""
    left = most

    def decided(among: Sequence[NoMotion], slides: frozenset[int], stays: frozenset[int]) -> bool:
        nonlocal left
        left -= 1
        if left < 0:
            return False
        fitting = [leaf for leaf in among if not stays & {*leaf.slides} and not slides & {*leaf.stays}]
        if any(slides >= {*leaf.slides} and stays >= {*leaf.stays} for leaf in fitting):
            return True
        # the leaves ask for something of a node that is not decided
        asked = [i for leaf in fitting for i in (*leaf.slides, *leaf.stays) if i not in slides and i not in stays]
        if not asked:
            return False
        more = frozenset(asked[:1])
        return decided(fitting, slides | more, stays) and decided(fitting, slides, stays | more)

    return decided(leaves, frozenset(), frozenset())
