"""Numbers with which a form is definite: found where there are any, and solutions that theta serves are unique then."""

from itertools import product

import numpy as np
import pytest
from effort import some
from flint import fmpq, fmpq_mat

from enumsol.search import definite
from enumsol.search.definite import Descent, Nodes
from enumsol.search.reduction import WeightSource, weights_of


def exact(values):
    return [fmpq(*float(x).as_integer_ratio()) for x in values]


def form_of(R, F, numbers, x=None):
    """Q of theory, (6.9), in rationals, of m nodes with friction; R holds integers, normal components first.

    With theta = lambda_t / lambda_n at the loaded nodes of x.
    """
    m = len(F)
    mu, kappa, nu, share, tau = (exact(part) for part in np.reshape(numbers, (5, m)))
    if x is not None:
        loaded = [x[i] > 0 and tau[i] == 0 for i in range(m)]
        share = [x[m + i] / x[i] / F[i] if loaded[i] else share[i] for i in range(m)]
    R = [[fmpq(int(x)) for x in row] for row in R.tolist()]
    rows = [[mu[i] * a - kappa[i] * share[i] * F[i] * b for a, b in zip(R[i], R[m + i], strict=True)] for i in range(m)]
    rows += [[nu[i] * a + kappa[i] * b for a, b in zip(R[i], R[m + i], strict=True)] for i in range(m)]
    Q = [[(rows[a][b] + rows[b][a]) / 2 for b in range(2 * m)] for a in range(2 * m)]
    for i in range(m):
        if tau[i] > 0:
            r, factor = R[m + i], (kappa[i] * F[i]) ** 2 / tau[i] / 2
            Q[i][i] -= tau[i] / 2
            Q = [[q - factor * r[a] * r[b] for b, q in enumerate(row)] for a, row in enumerate(Q)]
    return Q


def is_definite(Q):
    return all(fmpq_mat([row[:k] for row in Q[:k]]).det() > 0 for k in range(1, len(Q) + 1))


def solutions(R, h, F):
    """All x that solve the reduced problem w = h - R x, of the regular selections, with w; None if one is singular."""
    m, found = len(F), {}
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
            found[tuple((int(v.p), int(v.q)) for v in x)] = x, w
    return list(found.values())


def holds(code, n, t, w_n, w_t, F):
    if code == 0:
        return w_n <= 0
    return n >= 0 and {1: abs(t) <= F * n, 2: w_t >= 0, 3: w_t <= 0}[code]


def random_form(rng, m):
    """A matrix that is not symmetric, of which the rows are badly scaled."""
    X = rng.integers(-3, 4, size=(2 * m, 2 * m))
    R = X @ X.T + rng.integers(-4, 5, size=(2 * m, 2 * m)) + int(rng.integers(1, 8)) * np.eye(2 * m, dtype=int)
    return R * rng.choice([1, 2, 5, 12], size=(2 * m, 1))


def nodes_of(F, share, wide, gap, slip):
    m = len(F)
    arrays = (np.asarray(values, dtype=float) for values in (F, share))
    return Nodes(m, np.arange(m), m + np.arange(m), *arrays, np.asarray(wide), np.asarray(gap), np.asarray(slip))


def serves(numbers, F, x, w):
    """Whether the numbers serve a solution, exactly."""
    m = len(F)
    mu, kappa, nu, share, tau = (exact(part) for part in np.reshape(numbers, (5, m)))
    for i in range(m):
        theta = share[i] * F[i]
        assert min(mu[i], kappa[i]) > 0
        assert abs(nu[i]) * F[i] <= mu[i]
        assert abs(share[i]) <= 1
        if tau[i] > 0:
            assert share[i] == 0
        elif x[i] == 0:
            forward = (mu[i] + nu[i] * F[i]) * -w[i] - kappa[i] * (F[i] - theta) * w[m + i]
            backward = (mu[i] - nu[i] * F[i]) * -w[i] + kappa[i] * (F[i] + theta) * w[m + i]
            if forward < 0 or backward < 0:
                return False
    return True


@pytest.mark.slow
def test_a_solution_that_theta_serves_is_the_only_one():
    tried = needed = several = 0
    rng = np.random.default_rng(0)
    for _ in range(some(130, of=400)):
        m = int(rng.integers(1, 4))
        R, F = random_form(rng, m), rng.integers(1, 9, size=m) / 4
        h = [fmpq(int(x)) for x in rng.integers(-3, 4, size=2 * m)]
        found = solutions(R, h, exact(F))
        if not found:
            continue
        several += len(found) > 1
        x, w = (np.array([float(v) for v in values]) for values in found[0])
        loaded, slip = x[:m] > 0, w[m:]
        share = np.where(loaded, np.clip(x[m:] / np.where(loaded, F * x[:m], 1.0), -1.0, 1.0), np.nan)
        share = np.where(~loaded & (w[:m] == 0) & (slip != 0), np.sign(slip), share)
        wide = ~loaded & (w[:m] == 0) & (slip == 0) & bool(rng.integers(2))
        numbers = weights_of(R * 1.0, nodes_of(F, share, wide, -w[:m], slip))
        if numbers is None or not serves(numbers, exact(F), *found[0]):
            continue
        if is_definite(form_of(R, exact(F), numbers, found[0][0])):
            tried += 1
            needed += not np.all(numbers[: 2 * m] == 1)
            assert len(found) == 1
    assert needed > some(6, of=20)
    assert tried > some(18, of=60)
    assert several > some(0, of=3)


@pytest.mark.slow
def test_a_form_for_any_theta_has_one_solution_for_every_load():
    tried = 0
    rng = np.random.default_rng(1)
    for _ in range(some(30, of=100)):
        m = int(rng.integers(1, 4))
        R, F = random_form(rng, m), rng.integers(1, 7, size=m) / 8
        none = np.zeros(m)
        numbers = weights_of(R * 1.0, nodes_of(F, none + np.nan, none == 0, none, none))
        if numbers is None or not is_definite(form_of(R, exact(F), numbers)):
            continue
        tried += 1
        for _ in range(3):
            found = solutions(R, [fmpq(int(x)) for x in rng.integers(-9, 10, size=2 * m)], exact(F))
            assert found is None or len(found) == 1
    assert tried > some(8, of=30)


def frictionless(R):
    none, still = np.zeros(0), np.zeros(0, dtype=np.intp)
    return Nodes(len(R), still, still, none, none, none > 0, none, none)


def assert_found(R):
    """Numbers of the rows of a matrix that make it definite."""
    mu = weights_of(R, frictionless(R))
    assert np.linalg.eigvalsh(mu[:, None] * R + (mu[:, None] * R).T)[0] > 0


def test_numbers_are_needed_and_found():
    # without friction a form is a matrix times numbers; with all of them 1 it is indefinite
    R = np.array([[1.0, 5.0], [0.0, 1.0]])
    assert_found(R)
    assert weights_of(R, frictionless(R), WeightSource.PLAIN) is None
    assert weights_of(np.eye(3), frictionless(np.eye(3))).tolist() == [1.0, 1.0, 1.0]
    # no P-matrix: some problem has several solutions
    for wrong in ([[1.0, 2.0], [2.0, 1.0]], [[1.0, -2.0], [-1.0, 1.0]], [[-1.0]], [[0.0]], [[np.nan]]):
        assert weights_of(np.array(wrong), frictionless(wrong)) is None


@pytest.mark.parametrize("seed", range(8))
def test_wide_ranges_of_numbers_are_found(seed):
    # D R with R + R' definite is made from its rows multiplied by numbers over four decades
    rng = np.random.default_rng(seed)
    k = int(rng.integers(2, 9))
    X = rng.normal(size=(k, k))
    R = X @ X.T + np.eye(k) + 3.0 * np.triu(rng.normal(size=(k, k)), 1)
    R = R + (0.5 - min(0.0, np.linalg.eigvalsh(R + R.T)[0])) * np.eye(k)
    R *= 10.0 ** rng.uniform(-2, 2, size=(k, 1))
    assert_found(R)


@pytest.mark.parametrize("chosen", [False, True])
def test_descent_has_the_slope_of_its_objective(chosen):
    # squares counted, against central differences; the smallest eigenvalue against that of H^-1 M
    rng = np.random.default_rng(int(chosen))
    m, F = 4, np.array([0.3, 1.0, 2.0])
    X = rng.normal(size=(m + 3, m + 3))
    R = X @ X.T + np.eye(m + 3) + 0.3 * np.triu(rng.normal(size=(m + 3, m + 3)), 1)
    share, slip = np.array([0.5, -0.7, np.nan if chosen else 1.0]), np.array([0.0, 0.0, -0.4])
    gap, wide = np.array([0.0, 0.0, 0.1]), np.zeros(3, dtype=bool)
    normal = np.array([0, 1, 3])
    nodes = Nodes(m, normal, m + np.arange(3), F, share, wide, gap, slip)
    loads = rng.uniform(0.1, 0.5, m)
    tangential = np.zeros(m)
    tangential[normal] = 0.5 * F * loads[normal]
    descent = Descent.of(R, nodes, np.stack([loads, tangential]))
    z = 0.3 * rng.normal(size=m + 6)
    weight, step = 4.0, 1e-5
    slope = descent._objective(z, weight)[1]
    ends = [[descent._objective(z + s * e, weight)[0] for s in (step, -step)] for e in np.eye(m + 6)]
    assert slope == pytest.approx(np.array([(up - down) / (2 * step) for up, down in ends]), abs=1e-6)
    mu, kappa, nu, rho, _ = descent._split(z)
    D = np.zeros_like(R)
    D[:m, :m], D[m:, m:] = np.diag(mu), np.diag(kappa)
    D[m:, normal], D[normal, m:] = np.diag(nu), -np.diag(rho)
    strength = mu * loads
    strength[normal] += nu * tangential[normal]
    M = D @ R + R[:m].T @ np.diag(strength) @ R[:m]
    relative = np.linalg.eigvals(np.linalg.solve(R + R.T, M + M.T))
    assert descent._least(z)[0] == pytest.approx(np.min(relative.real) / np.mean(np.concatenate([mu, kappa])), abs=1e-9)


def sticking(rng, m, F, share):
    """A matrix that is definite, and nodes that stick."""
    X = rng.normal(size=(2 * m, 2 * m))
    R = np.exp(-np.abs(np.subtract.outer(np.arange(2 * m), np.arange(2 * m))) / 2.0) + 0.2 / m * X @ X.T
    none, i = np.zeros(m), np.arange(m)
    return R, Nodes(m, i, m + i, F, share, none > 0, none, none)


def test_some_nodes_descend_as_all_do():
    # numbers are exchanged: the mean stays, by which H is multiplied outside of the basis too
    rng = np.random.default_rng(3)
    R, nodes = sticking(rng, 8, rng.uniform(0.2, 1.0, 8), rng.uniform(-1, 1, 8))
    descent = Descent.of(R, nodes, rng.uniform(0.0, 0.4, (2, 8)) * [[1.0], [0.1]])
    z = 0.2 * rng.normal(size=24)
    least, mode = descent._least(z)
    part, places = descent._some(z, least, mode, 3)
    weight = definite._ABOVE * max(-least, 0.0) + definite._ENOUGH
    moved = z.copy()
    moved[places] = z[places][[1, 2, 0, 4, 3, 5, 8, 6, 7]]
    change = descent._objective(moved, weight)[0] - descent._objective(z, weight)[0]
    assert abs(change) > 1e-3
    assert part._objective(moved[places], weight)[0] - part._objective(z[places], weight)[0] == pytest.approx(change)


def test_few_of_many_nodes_move():
    # with mu = kappa = 1 what lacks is at three nodes
    m, rng = 80, np.random.default_rng(4)
    F, share = np.ones(m), rng.uniform(-0.5, 0.5, m)
    F[[5, 40, 79]], share[[5, 40, 79]] = 4.0, 0.9
    R, nodes = sticking(rng, m, F, share)
    assert weights_of(R, nodes, WeightSource.PLAIN) is None
    numbers = weights_of(R, nodes, WeightSource.DESCENT)
    mu, kappa, nu, theta, _ = numbers.reshape(5, m)
    D = np.block([[np.diag(mu), np.diag(nu)], [-np.diag(kappa * theta * F), np.diag(kappa)]])
    assert np.linalg.eigvalsh(D.T @ R + R @ D)[0] > 0
    assert np.all(np.abs(nu) * F <= mu)
    assert theta == pytest.approx(share)
    assert np.sum(np.isclose(mu, np.median(mu), rtol=1e-9)) >= m - definite._MOVING[-1]
