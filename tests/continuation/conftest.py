import numpy as np
import pytest

import enumsol


def random_problem(seed, loading=False):
    """A stable body with p <= 6 contact nodes; friction grows with alpha, or the load does at fixed friction."""
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, 7))
    n = 2 * p + int(rng.integers(0, 3))
    M = rng.normal(size=(n, n))
    B = np.linalg.qr(rng.normal(size=(n, n)))[0][: 2 * p]
    f = rng.normal(size=n) * 3
    data = {"friction": (0.0, rng.uniform(0.3, 1.5, p))}
    if loading:
        data = {"friction": (rng.uniform(0.3, 6, p), 0.0), "load_slope": rng.normal(size=n)}
    return enumsol.ContactProblem(M @ M.T + 0.3 * np.eye(n), B[:p], B[p:], f, **data)


@pytest.fixture
def random_problems():
    return random_problem


@pytest.fixture
def closed_problem():
    """One node, F = 4 - alpha, f = (1, -3.5) + alpha (1, -3): a closed branch of stick and slip-, alpha^2 < 1/2."""
    A = [[2.0, -1.0], [-1.0, 2.0]]
    f, slope = [1.0, -3.5], [1.0, -3.0]
    return enumsol.ContactProblem(A, [[1.0, 0.0]], [[0.0, 1.0]], f, friction=(4.0, -1.0), load_slope=slope)
