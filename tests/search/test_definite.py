"""Numbers with which a form is definite: found where there are any, and solutions are unique then."""

from itertools import product

import numpy as np
import pytest
from flint import fmpq, fmpq_mat

from enumsol.search.definite import weights_of


def exact(values):
    return [fmpq(*float(x).as_integer_ratio()) for x in values]


def form_of(R, F, tau, omega):
    """Q of theory, (6.9), in rationals, with all m nodes counted; R holds integers, normal components first."""
    m = len(F)
    rows = [[x * int(r) for r in row] for x, row in zip(omega, R.tolist(), strict=True)]
    Q = [[(rows[a][b] + rows[b][a]) / 2 for b in range(2 * m)] for a in range(2 * m)]
    for i in range(m):
        Q[i][i] -= tau[i] / 2
        r, factor = rows[m + i], F[i] ** 2 / tau[i] / 2
        Q = [[q - factor * r[a] * r[b] for b, q in enumerate(row)] for a, row in enumerate(Q)]
    return Q


def is_definite(Q):
    return all(fmpq_mat([row[:k] for row in Q[:k]]).det() > 0 for k in range(1, len(Q) + 1))


def solutions(R, h, F):
    """All x that solve the reduced problem w = h - R x, of the regular selections; None if one is singular."""
    m, found = len(F), set()
    zero, one = fmpq(0), fmpq(1)
    for codes in product(range(4), repeat=m):
        rows, sides = [], []
        for i, code in enumerate(codes):
            n, t = [[zero + (k == j) for k in range(2 * m)] for j in (i, m + i)]
            moves = [([fmpq(int(r)) for r in R[j]], h[j]) for j in (i, m + i)]
            slip = [b - (F[i] if code == 2 else -F[i]) * a for a, b in zip(n, t, strict=True)]
            pair = {0: [(n, zero), (t, zero)], 1: moves}.get(code, [moves[0], (slip, zero)])
            rows += [row for row, _ in pair]
            sides += [[side * one] for _, side in pair]
        matrix = fmpq_mat(rows)
        if matrix.det() == 0:
            return None
        x = matrix.solve(fmpq_mat(sides)).entries()
        w = [a - sum((int(r) * b for r, b in zip(row, x, strict=True)), zero) for a, row in zip(h, R, strict=True)]
        if all(holds(code, x[i], x[m + i], w[i], w[m + i], F[i]) for i, code in enumerate(codes)):
            found.add(tuple((int(v.p), int(v.q)) for v in x))
    return found


def holds(code, n, t, w_n, w_t, F):
    if code == 0:
        return w_n <= 0
    return n >= 0 and {1: abs(t) <= F * n, 2: w_t >= 0, 3: w_t <= 0}[code]


def random_form(rng, m):
    """A matrix that is not symmetric, of which the rows are badly scaled."""
    X = rng.integers(-3, 4, size=(2 * m, 2 * m))
    R = X @ X.T + rng.integers(-4, 5, size=(2 * m, 2 * m)) + int(rng.integers(1, 8)) * np.eye(2 * m, dtype=int)
    return R * rng.choice([1, 2, 5, 12], size=(2 * m, 1))


def test_solutions_are_unique_where_a_form_is_definite():
    tried = needed = 0
    rng = np.random.default_rng(0)
    for _ in range(160):
        m = int(rng.integers(1, 4))
        R, F = random_form(rng, m), rng.integers(1, 7, size=m) / 8
        weights = weights_of(R * 1.0, F, np.arange(m), m + np.arange(m), np.arange(2 * m))
        if weights is None:
            continue
        numbers = exact(np.concatenate([weights, np.ones(2 * m)])[: 3 * m])
        if not is_definite(form_of(R, exact(F), numbers[:m], numbers[m:])):
            continue
        tried += 1
        needed += len(weights) > m
        for _ in range(3):
            h = [fmpq(int(x)) for x in rng.integers(-9, 10, size=2 * m)]
            found = solutions(R, h, exact(F))
            assert found is None or len(found) == 1
    assert needed > 20
    assert tried > 50


def test_factors_are_needed_and_found():
    # without friction a form is a matrix times numbers; with all of them 1 it is indefinite
    none, still = np.zeros(0), np.zeros(0, dtype=np.intp)
    R = np.array([[1.0, 5.0], [0.0, 1.0]])
    omega = weights_of(R, none, still, still, np.arange(2))
    assert np.linalg.eigvalsh(omega[:, None] * R + (omega[:, None] * R).T)[0] > 0
    assert weights_of(R, none, still, still, np.zeros(2, dtype=np.intp)) is None
    assert len(weights_of(np.eye(3), none, still, still, np.arange(3))) == 0
    # no P-matrix: some problem has several solutions
    for wrong in ([[1.0, 2.0], [2.0, 1.0]], [[1.0, -2.0], [-1.0, 1.0]], [[-1.0]], [[0.0]], [[np.nan]]):
        size = len(wrong)
        assert weights_of(np.array(wrong), none, still, still, np.arange(size)) is None


@pytest.mark.parametrize("seed", range(8))
def test_wide_ranges_of_factors_are_found(seed):
    # D R with R + R' definite is made from its rows multiplied by numbers over four decades
    rng = np.random.default_rng(seed)
    k = int(rng.integers(2, 9))
    X = rng.normal(size=(k, k))
    R = X @ X.T + np.eye(k) + 3.0 * np.triu(rng.normal(size=(k, k)), 1)
    R = R + (0.5 - min(0.0, np.linalg.eigvalsh(R + R.T)[0])) * np.eye(k)
    R *= 10.0 ** rng.uniform(-2, 2, size=(k, 1))
    none, still = np.zeros(0), np.zeros(0, dtype=np.intp)
    omega = weights_of(R, none, still, still, np.arange(k))
    assert omega is not None
    scaled = (omega if len(omega) else np.ones(k))[:, None] * R
    assert np.linalg.eigvalsh(scaled + scaled.T)[0] > 0
