"""Which motions grow at an equilibrium: proposals, and what is proven of them (theory, section 15).

Ranges of mu are tried from 0 upward with plain numbers first. Where these do not serve, motions that grow are looked
for, then weights and products by semidefinite programs, with nodes at their limit decided one after the other.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.sparse as sp

from enumsol.arithmetic.balls import Ball
from enumsol.errors import InvalidProblemError
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.support.conic import conic_answer
from enumsol.support.deadlines import look
from enumsol.trusted.running_away import Crossing, Growing, Motion, Motions, NoMotion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.condensation.dynamic import DynamicStiffness
    from enumsol.support.array_types import Floats, Integers, Mask

#: A number sought: what it is (0 a weight, 1 a weight <= 0, 2 a product, 3 a weight >= 0, 4 a lean), row and column.
Place = tuple[int, int, int]
#: Ranges of mu: from one end to the other at first, and where no weights are tried any more.
_STRIDE, _NARROW, _NARROWEST = 16.0, 1.5, 1.01
#: Ranges that begin at 0 are not made shorter than this, by the smallest eigenvalue.
_LEAST = 1e-3
#: Above the largest eigenvalue of a body of steel by this factor nothing but the range without end is tried.
_DECADES = 14
#: Nodes at their limit up to which all sets of them are tried, and degrees of freedom up to which a spectrum is known.
_ALL_SETS, _SPECTRUM = 8, 1500
#: mu at which signs of determinants are compared within a range.
_SAMPLES = 48
#: Relative widths in which a motion is looked for, narrow ones first.
_WIDTHS = (1e-8, 1e-6, 1e-4, 1e-3)
#: Nodes up to which all weights are free, and semidefinite programs for one equilibrium.
_FREE_WEIGHTS, _PROGRAMS = 24, 300


@dataclass(frozen=True, eq=False)
class Proven:
    """What is proven of the motions that may grow at an equilibrium.

    Attributes
    ----------
    ranges : tuple of (low, high, leaves)
        In each nothing grows, by the certificates ``leaves``, which decide all nodes at their limit.
    growing : tuple of (certificate, Motion)
        By growth rate, the largest first.
    gaps : tuple of (low, high)
        Ranges of mu of which neither is proven.
    """

    ranges: tuple[tuple[float, float, tuple[NoMotion, ...]], ...]
    growing: tuple[tuple[Growing, Motion], ...]
    gaps: tuple[tuple[float, float], ...]


@dataclass
class StabilitySearch:
    """The search for motions that grow, of one equilibrium.

    Attributes
    ----------
    stiffness : DynamicStiffness
    motions : Motions
    """

    stiffness: DynamicStiffness
    motions: Motions
    _ranges: list[tuple[float, float, tuple[NoMotion, ...]]] = field(default_factory=list)
    _programs: int = 0

    def run(self) -> Proven:
        """What is proven."""
        if not self.stiffness.increases:
            # neither a motion nor a range without end can be proven
            return Proven((), (), ((0.0, np.inf),))
        gaps = _joined(list(self._plain()))
        growing = [] if self.motions.unsure else [found for low, high in gaps for found in self._growing(low, high)]
        growing.sort(key=lambda item: -item[0].low)
        if not growing and (self.stiffness.stiffest or self.stiffness.steepest) is not None:
            gaps = [gap for low, high in gaps for gap in self._by_weights(low, high)]
        return Proven(tuple(sorted(self._ranges, key=lambda item: item[0])), tuple(growing), tuple(_joined(gaps)))

    # -- plain numbers

    def _plain(self) -> Iterator[tuple[float, float]]:
        """Ranges, from 0 on, in which plain numbers do not serve."""
        low, high = 0.0, self._first
        last = high * _STRIDE**_DECADES
        numbers = self._far()
        while low < last:
            if numbers is not None and self._try(low, np.inf, *numbers):
                return
            far = next((mu for mu in (_STRIDE**2 * high, _STRIDE * high) if self._serve_to(low, mu)), None)
            if far is None:
                yield from self._halved(low, high)
            low = high if far is None else far
            high = low * _STRIDE
            if numbers is None and low > self._last:
                break
        yield low, np.inf

    def _serve_to(self, low: float, high: float) -> bool:
        """Whether plain numbers serve in a long range."""
        K = self.stiffness.at(high)
        return K is not None and self._serves(K.mid) and self._try(low, high)

    def _far(self) -> tuple[Floats, Floats] | None:
        """Weights and products that may serve for large mu; plain ones if these do."""
        far = self.stiffness.stiffest or self.stiffness.steepest
        if far is None:
            return None
        k = len(self.motions.signed)
        plain = np.eye(k), np.zeros((k, k))
        return plain if self._serves(far.mid) else self._weights(far.mid, (), ())

    def _serves(self, K: Floats) -> bool:
        """Whether plain numbers make the form definite at one K, in floats."""
        Q = self.motions.leaning.mid.T @ K @ self.motions.moves.mid
        unit = 1.0 / np.sqrt(np.maximum(np.abs(Q.diagonal()), np.finfo(float).tiny))
        Q = Q * unit[:, None] * unit
        return bool(np.all(np.isfinite(Q))) and bool(np.linalg.eigvalsh(Q + Q.T)[0] > 0)

    def _halved(self, low: float, high: float) -> Iterator[tuple[float, float]]:
        """Parts of a range in which plain numbers do not serve."""
        look()
        ends = [self.stiffness.at(mu) for mu in (low, high)]
        serving = [K is not None and self._serves(K.mid) for K in ends]
        if all(serving) and self._try(low, high):
            return
        if not any(serving):
            yield low, high
            return
        middle = self._middle(low, high, _NARROW)
        if middle is None:
            yield low, high
            return
        yield from self._halved(low, middle)
        yield from self._halved(middle, high)

    def _try(self, low: float, high: float, weights: Floats | None = None, products: Floats | None = None) -> bool:
        """Whether some numbers serve in a range, which is then noted."""
        tried = self._certificate(low, high, weights, products)
        if tried is None:
            return False
        self._ranges.append((low, high, (tried,)))
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
        first, last = self.stiffness.at(low), None if np.isinf(high) else self.stiffness.at(high)
        last = last or self.stiffness.stiffest or self.stiffness.steepest
        one, other = (0.0 if K is None else float(np.linalg.norm(K.mid)) for K in (first, last))
        return one * products, other * products

    def _beside(self, low: float, high: float) -> tuple[float | None, ...]:
        """Where slopes of K may be taken from."""
        known = [mu for mu in self.stiffness.known if 0 <= mu < low]
        if np.isinf(high):
            return (None,) if self.stiffness.stiffest is not None else (known[-1],) if known else ()
        if not known:
            return (None,)
        return (known[-1],) if known[-1] > 0.05 * low else (known[-1], 0.5 * low)

    @cached_property
    def _last(self) -> float:
        """About the largest eigenvalue of the pencil (A, M)."""
        A, M = self.stiffness.A.diagonal(), self.stiffness.M.diagonal()
        return float(np.max(A[M > 0] / M[M > 0])) if np.any(M > 0) else self._first

    @cached_property
    def _first(self) -> float:
        """About the smallest eigenvalue of the pencil (A, M), a power of two."""
        A, M = self.stiffness.A, self.stiffness.M
        diagonal, mass = A.diagonal(), M.diagonal()
        if not np.any(mass):
            return 1.0
        typical = float(np.median(diagonal) / max(float(np.mean(mass)), np.finfo(float).tiny))
        x = np.random.default_rng(1).normal(size=A.shape[0])
        try:
            from enumsol.condensation.factorization import Factorization

            base = Factorization(sp.csc_array(A if self.stiffness.held else A + self.stiffness.springs))
            for _ in range(4):
                x = base.solve(M @ (x / np.linalg.norm(x)), refined=False)
            value = float(x @ (M @ (x / np.linalg.norm(x)))) and float(
                np.linalg.norm(x) / np.linalg.norm(base.solve(M @ x))
            )
        except InvalidProblemError:
            value = 1e-4 * typical
        return float(np.exp2(np.round(np.log2(max(value, 1e-12 * typical)))))

    def _middle(self, low: float, high: float, narrow: float) -> float | None:
        """Where to divide a range of mu; None where it is narrow."""
        if np.isinf(high):
            if low == 0:
                return self._first
            return _STRIDE * low if low < _STRIDE**_DECADES * self._first else None
        if low == 0:
            return high / _STRIDE if high > _LEAST * self._first else None
        return None if high < narrow * low else float(np.sqrt(low * high))

    # -- motions that grow

    def _growing(self, low: float, high: float) -> Iterator[tuple[Growing, Motion]]:
        """Motions proven to grow in a range."""
        low = low if low > 0 else 1e-6 * self._first
        high = high if np.isfinite(high) else 1e4 * max(low, self._last)
        count = max(_SAMPLES, int(_SAMPLES * np.log(high / low) / np.log(_STRIDE)))
        samples = np.geomspace(low, high, count)
        floats = Spectrum.of(self.stiffness)
        if floats is None:
            samples = samples[:: max(1, count // 12)]
        model = floats or self.stiffness
        known = [(mu, K.mid) for mu in samples.tolist() if (K := model.at(mu)) is not None]
        values = [K for _, K in known]
        seen, stack = set[float](), np.array(values)
        for slides, touching in self._candidates(values):
            look()
            rows = Growing(0.0, 1.0, slides, touching).equations(self.motions)
            if rows is None or not rows[1]:
                continue
            left, right = rows[0].mid, self.motions.moves.mid[:, rows[1]]
            signed = self.motions.signed[rows[1]]

            def matrices(mu: float, left: Floats = left, right: Floats = right) -> Floats:
                K = model.at(mu)
                return (
                    np.full((1, right.shape[1], right.shape[1]), np.nan)
                    if K is None
                    else (left.T @ K.mid @ right)[None]
                )

            zeros: list[float | None] = []
            for function in (_determinant, partial(_forward, signed=signed)):

                def value(mu: float, function: Callable[[Floats], Floats] = function, of: Any = matrices) -> float:
                    return float(function(of(mu))[0])

                signs = np.sign(function(left.T @ stack @ right))
                changes = np.flatnonzero(signs[:-1] * signs[1:] < 0)
                zeros += [_zero(value, known[i][0], known[i + 1][0]) for i in changes]
            for at in zeros:
                if at is None or any(abs(at - other) <= 1e-6 * at for other in seen):
                    continue
                for width in _WIDTHS:
                    tried = Growing(at * (1 - width), at * (1 + width), slides, touching)
                    if floats is not None and tried.found(floats, self.motions) is None:
                        continue
                    found = tried.found(self.stiffness, self.motions)
                    if found is not None:
                        seen.add(at)
                        yield tried, found
                        break

    def crossing_near(self, known: Growing) -> Crossing | None:
        """A range of mu in which some motion is proven to grow, about one that is known for other coefficients."""
        unit = float(np.exp2(np.round(np.log2(known.low))))
        high = next((unit * _STRIDE**k for k in range(1, 6) if self._definite_at(unit * _STRIDE**k)), None)
        if high is None:
            return None
        for low in (unit / 4, unit / _STRIDE, unit / _STRIDE**2, 0.0):
            K = self.stiffness.at(low)
            push = None if K is None else _push(self.motions.slopes.mid.T @ K.mid @ self.motions.moves.mid)
            if push is None:
                continue
            tried = Crossing(low, high, push)
            if tried.holds(self.stiffness, self.motions):
                return tried
        return None

    def _definite_at(self, mu: float) -> bool:
        """Whether plain numbers serve at one mu, in floats."""
        K = self.stiffness.at(mu)
        return K is not None and self._serves(K.mid)

    def zero_near(self, known: Growing) -> float | None:
        """About the mu at which a motion grows that grew at another one under slightly other coefficients."""
        rows, model = known.equations(self.motions), Spectrum.of(self.stiffness)
        if rows is None or model is None:
            return 0.5 * (known.low + known.high)
        left, right, signed = rows[0].mid, self.motions.moves.mid[:, rows[1]], self.motions.signed[rows[1]]
        samples = 0.5 * (known.low + known.high) * np.geomspace(0.125, 8.0, 24)
        forces = [None if (K := model.at(mu)) is None else left.T @ K.mid @ right for mu in samples.tolist()]
        if any(of is None for of in forces):
            return None
        values = _forward(np.array(forces), signed)
        changes = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
        if not len(changes):
            return None
        i = int(changes[np.argmin(np.abs(changes - 11.5))])
        share = values[i] / (values[i] - values[i + 1])
        return float(samples[i] * (samples[i + 1] / samples[i]) ** share)

    def _candidates(self, values: list[Floats]) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
        """Sets of nodes that may slide, with statuses of those that touch."""
        limits, touching = self.motions.limits, self.motions.touching
        codes = [(STICK, OPEN, SLIP_PLUS, SLIP_MINUS)[: 4 if len(node.slides) == 1 else 2] for node in touching]
        statuses = (
            list(itertools.product(*codes)) if limits + 2 * len(touching) <= _ALL_SETS else [(STICK,) * len(touching)]
        )
        known = set()
        for value in values:
            for slides in self._settled(value):
                if slides not in known:
                    known.add(slides)
                    yield from ((slides, status) for status in statuses)
        if limits <= _ALL_SETS:
            for size in range(1, limits + 1):
                for slides in itertools.combinations(range(limits), size):
                    if slides not in known:
                        yield from ((slides, status) for status in statuses)

    def _settled(self, K: Floats) -> Iterator[tuple[int, ...]]:
        """Sets of nodes that slide in complementary eigenvectors of T'K R, found by changing them until they fit."""
        count = self.motions.limits
        L = self.motions.slopes.mid.T @ K @ self.motions.moves.mid[:, :count]
        if not np.all(np.isfinite(L)):
            return
        L = L / np.max(np.abs(L))
        chosen = np.ones(count, dtype=bool)
        for _ in range(2 * count):
            own = np.flatnonzero(chosen)
            if not len(own):
                return
            values, vectors = np.linalg.eig(L[np.ix_(own, own)])
            real = np.flatnonzero(np.abs(values.imag) <= 1e-9)
            if not len(real):
                return
            best = real[np.argmin(values.real[real])]
            x = np.zeros(count)
            x[own] = vectors[:, best].real * np.sign(np.sum(vectors[:, best].real))
            r = L @ x
            backward = own[x[own] < 0]
            inward = np.flatnonzero(~chosen & (r < 0))
            if not len(backward) and not len(inward):
                yield tuple(own.tolist())
                return
            if len(backward):
                chosen[backward] = False
            else:
                chosen[inward[np.argmin(r[inward])]] = True

    # -- weights and products

    def _by_weights(self, low: float, high: float) -> Iterator[tuple[float, float]]:
        """Parts of a range in which weights and decided nodes do not serve either."""
        look()
        leaves = None
        if self._programs < _PROGRAMS and low < high:
            limit = self.stiffness.stiffest or self.stiffness.steepest
            at = float(np.sqrt(max(low, 1e-3 * high) * high))
            K = limit if np.isinf(high) else self.stiffness.at(at)
            leaves = None if K is None else self._decided(low, high, K.mid, (), ())
        if leaves is not None:
            self._ranges.append((low, high, tuple(leaves)))
            return
        middle = None if self._programs >= _PROGRAMS else self._middle(low, high, _NARROWEST)
        if middle is None:
            yield low, high
            return
        yield from self._by_weights(low, middle)
        yield from self._by_weights(middle, high)

    def _decided(
        self, low: float, high: float, K: Floats, slides: tuple[int, ...], stays: tuple[int, ...]
    ) -> list[NoMotion] | None:
        """Certificates for a range that decide nodes at their limit as far as it takes."""
        if self._programs >= _PROGRAMS:
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
        self._programs += 1
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


class Spectrum:
    """K(mu) in floats, from the eigenvalues of (A, M)."""

    increases = True

    def __init__(self, tau: Floats, rows: Floats, shift: float) -> None:
        self._tau, self._rows, self._shift = tau, rows, shift

    @classmethod
    def of(cls, stiffness: DynamicStiffness) -> Spectrum | None:
        """None of a large body, or where the eigenvalues are not found."""
        if stiffness.A.shape[0] > _SPECTRUM:
            return None
        if stiffness.spectrum is None:
            stiffness.spectrum = cls._found(stiffness)
        return cast("Spectrum", stiffness.spectrum)

    @classmethod
    def _found(cls, stiffness: DynamicStiffness) -> Spectrum | None:
        A, M = stiffness.A.toarray(), stiffness.M.toarray()
        shift = 0.0 if stiffness.held else 1e-3 * float(np.trace(A) / np.trace(M))
        try:
            tau, X = scipy.linalg.eigh(M, A + shift * M)
        except np.linalg.LinAlgError:
            return None
        return cls(tau, stiffness.rows.toarray() @ X, shift)

    def at(self, mu: float) -> Ball | None:
        """K(mu), (m, m)."""
        weights = np.maximum(1.0 + (mu - self._shift) * self._tau, 1e-14)
        try:
            return Ball.exact(np.asarray(np.linalg.inv((self._rows / weights) @ self._rows.T), dtype=np.float64))
        except np.linalg.LinAlgError:
            return None


def _push(L: Floats) -> Floats | None:
    """p >= 0 that adds up to one with p'L < 0, the more the better, if there is one."""
    k = len(L)
    if not k or L.shape != (k, k):
        return None
    unit = 1.0 / np.sqrt(np.maximum(np.abs(L.diagonal()), np.finfo(float).tiny))
    scaled = L * unit[:, None] * unit
    limits = np.hstack([scaled.T, np.ones((k, 1))])
    goal = np.append(np.zeros(k), -1.0)
    whole = np.append(np.ones(k), 0.0)[None]
    bounds = [(0.0, None)] * k + [(None, None)]
    found = scipy.optimize.linprog(goal, limits, np.zeros(k), whole, [1.0], bounds)
    return found.x[:k] * unit if found.status == 0 and found.x[k] > 0 else None


def _determinant(matrices: Floats) -> Floats:
    """Determinants, up to positive factors with which they neither over- nor underflow."""
    size = np.max(np.abs(matrices), axis=-1, keepdims=True)
    return np.asarray(np.linalg.det(matrices / np.where(size > 0, size, 1.0)))


def _forward(matrices: Floats, signed: Mask) -> Floats:
    """Of each matrix the real eigenvalue whose eigenvector is most nearly of one sign where it is signed; or nan."""
    if not np.all(np.isfinite(matrices)):
        return np.full(len(matrices), np.nan)
    values, vectors = np.linalg.eig(matrices)
    real = np.abs(values.imag) <= 1e-10 * np.max(np.abs(values), axis=1, keepdims=True)
    x = vectors.real
    own = x[:, signed] if np.any(signed) else np.abs(x)
    size = np.max(np.abs(x), axis=1) + np.finfo(float).tiny
    least = np.maximum(np.min(own, axis=1), -np.max(own, axis=1)) / size
    best = np.argmax(np.where(real, least, -2.0), axis=1)
    at = np.arange(len(matrices))
    return np.where(real[at, best], values.real[at, best], np.nan)


def _zero(value: Callable[[float], float], low: float, high: float) -> float | None:
    """mu between two at which a function vanishes that has other signs there."""
    try:
        return float(scipy.optimize.brentq(value, low, high, xtol=1e-300, rtol=1e-14, maxiter=200))
    except (ValueError, RuntimeError):
        return None


def _joined(gaps: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Ranges next to each other as one."""
    joined: list[tuple[float, float]] = []
    for low, high in sorted(gaps):
        if joined and joined[-1][1] >= low:
            joined[-1] = joined[-1][0], high
        else:
            joined.append((low, high))
    return joined
