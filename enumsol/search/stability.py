"""Which motions grow at an equilibrium: proposals, and what is proven of them (theory, section 15).

Ranges of mu are tried from 0 upward with plain numbers first. Where these do not serve, motions that grow are looked
for, then weights and products by semidefinite programs, with nodes at their limit decided one after the other.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.search.growing_motions import (
    STRIDE,
    growing_between,
    largest_eigenvalue,
    serve_at,
    serves,
    smallest_eigenvalue,
)
from enumsol.search.outcome import joined
from enumsol.support.conic import conic_answer
from enumsol.support.deadlines import look
from enumsol.trusted.running_away import Growing, Motions, NoMotion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.arithmetic.balls import Ball
    from enumsol.condensation.dynamic import DynamicStiffness
    from enumsol.support.array_types import Floats, Integers

#: A number sought: what it is (0 a weight, 1 a weight <= 0, 2 a product, 3 a weight >= 0, 4 a lean), row and column.
Place = tuple[int, int, int]
#: Ranges of mu in which nothing more is tried, without weights and with them.
_NARROW, _NARROWEST = 1.5, 1.01
#: Ranges that begin at 0 are not made shorter than this, by the smallest eigenvalue.
_LEAST = 1e-3
#: Above the largest eigenvalue of a body of steel by this factor nothing but the range without end is tried.
_DECADES = 14
#: Nodes up to which all weights are free, and semidefinite programs for one equilibrium.
_FREE_WEIGHTS, _PROGRAMS = 24, 300


@dataclass(frozen=True, eq=False)
class Proven:
    """Proofs about the motions that may grow at an equilibrium.

    Attributes
    ----------
    leaves : tuple of NoMotion
        Certificates by which nothing grows, by range.
    growing : tuple of (certificate, motion x)
        By growth rate, the largest first.
    gaps : tuple of (low, high)
        Ranges of mu of which neither is proven.
    """

    leaves: tuple[NoMotion, ...]
    growing: tuple[tuple[Growing, Ball], ...]
    gaps: tuple[tuple[float, float], ...]


@dataclass
class StabilitySearch:
    """The search for motions that grow, of one equilibrium.

    Attributes
    ----------
    stiffness : DynamicStiffness
    motions : Motions
    most_programs : int
        Semidefinite programs that are solved at most.
    """

    stiffness: DynamicStiffness
    motions: Motions
    most_programs: int = _PROGRAMS
    _leaves: list[NoMotion] = field(default_factory=list)
    programs: int = 0

    def run(self) -> Proven:
        """Search, and all that is proven."""
        if not self.stiffness.increases:
            # neither a motion nor a range without end can be proven
            return Proven((), (), ((0.0, np.inf),))
        gaps = joined(list(self._plain()))
        ranges = () if self.motions.unsure else gaps
        growing = [found for ends in ranges for found in growing_between(self.stiffness, self.motions, *ends)]
        growing.sort(key=lambda item: -item[0].low)
        if not growing and self._limit is not None:
            gaps = [gap for ends in gaps for gap in self._divided(*ends, _NARROWEST, self._by_weights)]
        return Proven(tuple(sorted(self._leaves, key=lambda leaf: leaf.low)), tuple(growing), tuple(joined(gaps)))

    # -- plain numbers

    def _plain(self) -> Iterator[tuple[float, float]]:
        """Ranges, from 0 on, in which plain numbers do not serve."""
        low, high = 0.0, self._first
        last = high * STRIDE**_DECADES
        while low < last:
            if self._try(low, np.inf) or (low and self._far and self._try(low, np.inf, *self._far)):
                return
            serving = (mu for mu in (STRIDE**2 * high, STRIDE * high) if serve_at(self.stiffness, self.motions, mu))
            far = next((mu for mu in serving if self._try(low, mu)), None)
            if far is None:
                yield from self._divided(low, high, _NARROW, self._by_plain)
            low = high if far is None else far
            high = low * STRIDE
            if self._limit is None and low > largest_eigenvalue(self.stiffness):
                break
        yield low, np.inf

    @cached_property
    def _limit(self) -> Floats | None:
        """K for large mu, up to a factor and in floats."""
        slope, most = self.stiffness.steepest, self.stiffness.stiffest
        if slope is None or most is None:
            return None
        return STRIDE**2 * largest_eigenvalue(self.stiffness) * slope.mid + most.mid

    @cached_property
    def _far(self) -> tuple[Floats, Floats] | None:
        """Weights and products that may serve for large mu where plain numbers do not."""
        if self._limit is None or serves(self.motions, self._limit):
            return None
        return self._weights(self._limit, (), ())

    def _divided(
        self, low: float, high: float, narrow: float, proves: Callable[[float, float], bool | None]
    ) -> Iterator[tuple[float, float]]:
        """Parts of a range in which nothing is proven; ``proves`` gives None where shorter ones will not do either."""
        look()
        proven = proves(low, high)
        middle = None if proven is None else self._middle(low, high, narrow)
        if middle is not None and not proven:
            yield from self._divided(low, middle, narrow, proves)
            yield from self._divided(middle, high, narrow, proves)
        elif not proven:
            yield low, high

    def _by_plain(self, low: float, high: float) -> bool | None:
        """True if plain numbers serve in a range; None if they serve at neither end."""
        serving = [serve_at(self.stiffness, self.motions, mu) for mu in (low, high)]
        return (all(serving) and self._try(low, high)) if any(serving) else None

    def _try(self, low: float, high: float, weights: Floats | None = None, products: Floats | None = None) -> bool:
        """True if some numbers serve in a range, which is then noted."""
        tried = self._certificate(low, high, weights, products)
        if tried is None:
            return False
        self._leaves.append(tried)
        return True

    def _certificate(
        self,
        low: float,
        high: float,
        weights: Floats | None = None,
        products: Floats | None = None,
        slides: tuple[int, ...] = (),
        stays: tuple[int, ...] = (),
    ) -> NoMotion | None:
        """The certificate for a range, if it holds."""
        k = len(self.motions.signed)
        weights = np.eye(k) if weights is None else weights
        N = np.zeros((k, k)) if products is None else products
        for beside in self._beside(low, high):
            ends = self._scaled(N, low, high) if np.any(N) else (N, N)
            tried = NoMotion(low, high, beside, slides, stays, weights, ends)
            if tried.holds(self.stiffness, self.motions):
                return tried
        return None

    def _scaled(self, products: Floats, low: float, high: float) -> tuple[Floats, Floats]:
        """Products, found for a K of norm one, at both ends of a range."""
        ends = self.stiffness.at(low), self.stiffness.steepest if np.isinf(high) else self.stiffness.at(high)
        one, other = (0.0 if K is None else float(np.linalg.norm(K.mid)) for K in ends)
        # rows that yield have no slope
        return one * products, other * products * (not (np.isinf(high) and np.any(self.stiffness.yields)))

    def _beside(self, low: float, high: float) -> tuple[float | None, ...]:
        """Other mu from which slopes of K may be taken."""
        known = [mu for mu in self.stiffness.known if 0 <= mu < low]
        if np.isinf(high):
            return (None,) if np.all(self.stiffness.yields) else tuple(known[-1:])
        if not known:
            return (None,)
        return (known[-1],) if known[-1] > 0.05 * low else (known[-1], 0.5 * low)

    @cached_property
    def _first(self) -> float:
        """About the smallest eigenvalue of the pencil (A, M), a power of two."""
        return smallest_eigenvalue(self.stiffness)

    def _middle(self, low: float, high: float, narrow: float) -> float | None:
        """A place to divide a range of mu; None where it is narrow."""
        if np.isinf(high):
            if low == 0:
                return self._first
            return STRIDE * low if low < STRIDE**_DECADES * self._first else None
        if low == 0:
            return high / STRIDE if high > _LEAST * self._first else None
        return None if high < narrow * low else float(np.sqrt(low * high))

    # -- weights and products

    def _by_weights(self, low: float, high: float) -> bool | None:
        """True if weights and decided nodes serve in a range; None if they were not tried."""
        if self.programs >= self.most_programs:
            return None
        at = float(np.sqrt(max(low, 1e-3 * high) * high))
        K = self._limit if np.isinf(high) else None if (own := self.stiffness.at(at)) is None else own.mid
        leaves = None if K is None else self._decided(low, high, K, (), ())
        self._leaves += leaves or []
        return leaves is not None

    def _decided(
        self, low: float, high: float, K: Floats, slides: tuple[int, ...], stays: tuple[int, ...]
    ) -> list[NoMotion] | None:
        """Certificates for a range that decide nodes at their limit as far as it takes."""
        if self.programs >= self.most_programs:
            return None
        found = self._weights(K, slides, stays)
        if found is not None:
            own = self._certificate(low, high, *found, slides, stays)
            # where they serve at one mu the range has to be shorter, not the sets
            return None if own is None else [own]
        free = [i for i in np.flatnonzero(self.motions.signed).tolist() if i not in slides and i not in stays]
        if not free:
            return None
        leaves: list[NoMotion] = []
        for more in ((*slides, free[0]), stays), (slides, (*stays, free[0])):
            part = self._decided(low, high, K, *more)
            if part is None:
                return None
            leaves += part
        return leaves

    def _weights(self, K: Floats, slides: tuple[int, ...], stays: tuple[int, ...]) -> tuple[Floats, Floats] | None:
        """Weights and products with which the form is definite at one K, as far as a program finds."""
        k, signed = len(self.motions.signed), self.motions.signed
        self.programs += 1
        kept = np.setdiff1d(np.arange(k), stays)
        left, right = self.motions.leaning.mid, self.motions.moves.mid
        unit = 1.0 / np.sqrt(np.abs((right.T @ K @ right).diagonal()))
        rows = (left.T @ K @ right) * unit[:, None] * unit
        leans = {node.leaves: node.slides for node in self.motions.touching}
        slid = [j for node in self.motions.touching for j in node.slides]
        places: list[Place] = []
        for i, j in itertools.product(range(k), kept.tolist()):
            if i in slides or any(i in leans[n] for n in leans if n in slides) or (i == j and i not in slid):
                places.append((0, i, j))
            elif i == j and any(own[0] == i for own in leans.values() if own):
                places.append((3, i, j))
            elif k <= _FREE_WEIGHTS and signed[i] and signed[j] and i not in self.motions.unsure:
                places.append((1, i, j))
        if k <= _FREE_WEIGHTS:
            pairs = itertools.combinations([j for j in kept.tolist() if signed[j]], 2)
            places += [(2, i, j) for i, j in pairs]
        leaning = [
            (node.leaves, node.slides[0], float(node.F.low) * (1 - 1e-9))
            for node in self.motions.touching
            if len(node.slides) == 1 and node.leaves not in slides
        ]
        places += [(4, i, j) for i, j, _ in leaning]
        limits = [(i, j, F * unit[j] / unit[i]) for i, j, F in leaning]
        found = _definite(rows, limits, places, kept, list(leans.values()))
        if found is None:
            return None
        weights, products, size = np.zeros((k, k)), np.zeros((k, k)), float(np.linalg.norm(K))
        for (kind, i, j), value in zip(places, found, strict=True):
            if kind == 2:
                products[i, j] = products[j, i] = max(value, 0.0) / (2 * unit[i] * unit[j] * size)
            else:
                # x = unit * scaled x, and so are the rows
                number = min(value, 0.0) if kind == 1 else max(value, 0.0) if kind == 3 else value
                weights[i, j] = number * unit[i] / unit[j]
                for own in leans.values() if kind == 3 else ():
                    if i in own:
                        weights[own, own] = number
        return weights, products


def _definite(
    rows: Floats, leaning: list[tuple[int, int, float]], places: list[Place], kept: Integers, touching: list[Any]
) -> Floats | None:
    """Numbers x with sym(rows' kappa) - N - t I >= 0 for the largest t, if that is above zero; |x| <= 1."""
    import clarabel  # takes a while to import

    q, size = len(kept), len(places)
    low, high = np.tril_indices(q)[::-1]
    root = np.where(low == high, 1.0, np.sqrt(2.0))

    def entries(matrix: Floats) -> Floats:
        return np.asarray((0.5 * (matrix + matrix.T))[low, high] * root)

    position = {int(j): at for at, j in enumerate(kept)}
    columns = np.zeros((len(low), size + 1))
    for at, (kind, i, j) in enumerate(places):
        matrix = np.zeros((q, q))
        if kind == 2:
            matrix[position[i], position[j]] = -1.0
        else:
            # r_i times x_j
            matrix[position[j]] = rows[i][kept]
        for own in touching if kind == 3 else ():
            for k in own if i in own else ():
                matrix[position[k]] = rows[k][kept]
        columns[:, at] = entries(matrix)
    columns[:, size] = entries(-np.eye(q))
    bound = [np.eye(size, size + 1), -np.eye(size, size + 1), np.eye(1, size + 1, size)]
    limit = np.ones(2 * size + 1)
    for at, (kind, _, _) in enumerate(places):
        if kind in (1, 2, 3):
            limit[at if kind == 1 else size + at] = 0.0
    for i, j, F in leaning:
        lean = np.zeros((2, size + 1))
        lean[:, places.index((4, i, j))] = 1.0, -1.0
        lean[:, places.index((3, j, j))] = -F
        bound.append(lean)
    A = sp.csc_matrix(np.vstack([*bound, -columns]))
    b = np.concatenate([limit, np.zeros(2 * len(leaning) + len(low))])
    cones = [clarabel.NonnegativeConeT(len(limit) + 2 * len(leaning)), clarabel.PSDTriangleConeT(q)]
    goal = np.zeros(size + 1)
    goal[size] = -1.0
    answer = conic_answer((sp.csc_matrix((size + 1, size + 1)), goal), (A, b), cones, len(b) * (size + 1))
    x = np.asarray(answer.x)
    return x[:size] if len(x) and np.all(np.isfinite(x)) and x[size] > 1e-9 else None
