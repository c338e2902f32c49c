"""Motions that grow at an equilibrium, sought in floats and proven where they are found (theory, section 15.4)."""

from __future__ import annotations

import itertools
from functools import partial
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.linalg
import scipy.optimize
import scipy.sparse as sp

from enumsol.arithmetic.balls import Ball
from enumsol.errors import InvalidProblemError
from enumsol.model.statuses import OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.support.deadlines import look
from enumsol.trusted.running_away import Behaviour, Crossing, Growing, Motions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from enumsol.condensation.dynamic import DynamicStiffness
    from enumsol.support.array_types import Floats, Mask

#: From one end of a range of mu to the other.
STRIDE = 16.0
#: Nodes at their limit up to which all sets of them are tried or counted, and degrees of freedom up to which a
#: spectrum is known.
_ALL_SETS, _SPECTRUM = 8, 1500
#: Loads that are tried for one certificate.
_LOADS = 12
#: mu at which signs of determinants are compared within a range.
_SAMPLES = 48
#: Relative widths in which a motion is looked for, narrow ones first.
_WIDTHS = (1e-8, 1e-6, 1e-4, 1e-3)


def growing_between(
    stiffness: DynamicStiffness, motions: Motions, low: float, high: float
) -> Iterator[tuple[Growing, Ball]]:
    """Motions proven to grow in a range."""
    low = low if low > 0 else 1e-6 * smallest_eigenvalue(stiffness)
    high = high if np.isfinite(high) else 1e4 * max(low, largest_eigenvalue(stiffness))
    count = max(_SAMPLES, int(_SAMPLES * np.log(high / low) / np.log(STRIDE)))
    samples = np.geomspace(low, high, count)
    floats = Spectrum.of(stiffness)
    if floats is None:
        samples = samples[:: max(1, count // 12)]
    model = floats or stiffness
    known = [(mu, K.mid) for mu in samples.tolist() if (K := model.at(mu)) is not None]
    values = [K for _, K in known]
    seen, stack = set[float](), np.array(values)
    for slides, touching in _candidates(motions, values):
        look()
        way = Behaviour(slides, touching)
        rows = way.equations(motions)
        if rows is None or not rows[1]:
            continue
        left, right = rows[0].mid, motions.moves.mid[:, rows[1]]
        signed = motions.signed[rows[1]]

        def matrices(mu: float, left: Floats = left, right: Floats = right) -> Floats:
            K = model.at(mu)
            return np.full((1, right.shape[1], right.shape[1]), np.nan) if K is None else (left.T @ K.mid @ right)[None]

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
                tried = Growing(at * (1 - width), at * (1 + width), way)
                if floats is not None and tried.found(floats, motions) is None:
                    continue
                found = tried.found(stiffness, motions)
                if found is not None:
                    seen.add(at)
                    yield tried, found
                    break


def crossing_near(stiffness: DynamicStiffness, motions: Motions, known: Growing) -> Crossing | None:
    """A range of mu in which some motion is proven to grow, about one that is known for other coefficients."""
    unit = float(np.exp2(np.round(np.log2(known.low))))
    below, above = (unit / 4, unit / STRIDE, unit / STRIDE**2, 0.0), [unit * STRIDE**k for k in range(1, 6)]
    for pushed, definite in ((below, above), (above, below)):
        end = next((mu for mu in definite if serve_at(stiffness, motions, mu)), None)
        if end is None:
            continue
        for mu in pushed:
            K = stiffness.at(mu)
            L = None if K is None else motions.slopes.mid.T @ K.mid @ motions.moves.mid
            push = None if L is None else _push(L)
            load = None if L is None or push is not None or not mu else _load(L)
            tried = Crossing(min(mu, end), max(mu, end), push, load)
            if tried.holds(stiffness, motions):
                return tried
    return None


def zero_near(stiffness: DynamicStiffness, motions: Motions, known: Growing) -> float | None:
    """About the mu at which a motion grows that grew at another one under slightly other coefficients."""
    rows, model = known.way.equations(motions), Spectrum.of(stiffness)
    if rows is None or model is None:
        return 0.5 * (known.low + known.high)
    left, right, signed = rows[0].mid, motions.moves.mid[:, rows[1]], motions.signed[rows[1]]
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


def _candidates(motions: Motions, values: list[Floats]) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Sets of nodes that may slide, with statuses of those that touch."""
    limits, touching = motions.limits, motions.touching
    codes = [(STICK, OPEN, SLIP_PLUS, SLIP_MINUS)[: 4 if len(node.slides) == 1 else 2] for node in touching]
    statuses = (
        list(itertools.product(*codes)) if limits + 2 * len(touching) <= _ALL_SETS else [(STICK,) * len(touching)]
    )
    known = set()
    for value in values:
        for slides in _settled(motions, value):
            if slides not in known:
                known.add(slides)
                yield from ((slides, status) for status in statuses)
    if limits <= _ALL_SETS:
        for size in range(1, limits + 1):
            for slides in itertools.combinations(range(limits), size):
                if slides not in known:
                    yield from ((slides, status) for status in statuses)


def _settled(motions: Motions, K: Floats) -> Iterator[tuple[int, ...]]:
    """Sets of nodes that slide in complementary eigenvectors of T'K R, found by changing them until they fit."""
    count = motions.limits
    L = motions.slopes.mid.T @ K @ motions.moves.mid[:, :count]
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


def serve_at(stiffness: DynamicStiffness, motions: Motions, mu: float) -> bool:
    """True if plain numbers make the form definite at one mu, in floats."""
    K = stiffness.at(mu)
    return K is not None and serves(motions, K.mid)


def serves(motions: Motions, K: Floats) -> bool:
    """True if plain numbers make the form definite at one K, in floats."""
    Q = motions.leaning.mid.T @ K @ motions.moves.mid
    unit = 1.0 / np.sqrt(np.maximum(np.abs(Q.diagonal()), np.finfo(float).tiny))
    Q = Q * unit[:, None] * unit
    return bool(np.all(np.isfinite(Q))) and bool(np.linalg.eigvalsh(Q + Q.T)[0] > 0)


def largest_eigenvalue(stiffness: DynamicStiffness) -> float:
    """About the largest eigenvalue of the pencil (A, M)."""
    A, M = stiffness.A.diagonal(), stiffness.M.diagonal()
    return float(np.max(A[M > 0] / M[M > 0])) if np.any(M > 0) else smallest_eigenvalue(stiffness)


def smallest_eigenvalue(stiffness: DynamicStiffness) -> float:
    """About the smallest eigenvalue of the pencil (A, M), a power of two."""
    A, M = stiffness.A, stiffness.M
    diagonal, mass = A.diagonal(), M.diagonal()
    if not np.any(mass):
        return 1.0
    typical = float(np.median(diagonal) / max(float(np.mean(mass)), np.finfo(float).tiny))
    x = np.random.default_rng(1).normal(size=A.shape[0])
    try:
        from enumsol.condensation.factorization import Factorization

        base = Factorization(sp.csc_array(A if stiffness.held else A + stiffness.springs))
        for _ in range(4):
            x = base.solve(M @ (x / np.linalg.norm(x)), refined=False)
        value = float(x @ (M @ (x / np.linalg.norm(x)))) and float(
            np.linalg.norm(x) / np.linalg.norm(base.solve(M @ x))
        )
    except InvalidProblemError:
        value = 1e-4 * typical
    return float(np.exp2(np.round(np.log2(max(value, 1e-12 * typical)))))


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
        if stiffness not in _SPECTRA:
            _SPECTRA[stiffness] = cls._found(stiffness)
        return _SPECTRA[stiffness]

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


#: One for each stiffness, as long as there is that.
_SPECTRA: WeakKeyDictionary[DynamicStiffness, Spectrum | None] = WeakKeyDictionary()


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


def _load(L: Floats) -> Floats | None:
    """q for which the signs of all solutions of 0 <= x, q + L x >= 0 are known best, if they do not add up to 1."""
    k = len(L)
    if not 0 < k <= _ALL_SETS or L.shape != (k, k):
        return None
    unit = 1.0 / np.sqrt(np.maximum(np.abs(L.diagonal()), np.finfo(float).tiny))
    scaled = L * unit[:, None] * unit
    loads = np.random.default_rng(k).normal(size=(k, _LOADS))
    margins, degrees = np.full(_LOADS, np.inf), np.zeros(_LOADS)
    for chosen in itertools.product((False, True), repeat=k):
        own, x = np.array(chosen), np.zeros((k, _LOADS))
        part = scaled[np.ix_(own, own)]
        try:
            x[own] = -np.linalg.solve(part, loads[own])
        except np.linalg.LinAlgError:
            return None
        least = np.min(np.where(own[:, None], x, loads + scaled @ x), axis=0)
        margins = np.minimum(margins, np.abs(least))
        degrees += np.where(least > 0, np.sign(np.linalg.det(part)), 0.0)
    best = int(np.argmax(np.where(degrees != 1, margins, -1.0)))
    return loads[:, best] / unit if degrees[best] != 1 else None


def _determinant(matrices: Floats) -> Floats:
    """Determinants, up to positive factors with which they neither over- nor underflow."""
    size = np.max(np.abs(matrices), axis=-1, keepdims=True)
    return np.asarray(np.linalg.det(matrices / np.where(size > 0, size, 1.0)))


def _forward(matrices: Floats, signed: Mask) -> Floats:
    """Real eigenvalue of each matrix whose eigenvector is most nearly of one sign where it is signed; or nan."""
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
