import pytest
from path_problems import stable_problem

import enumsol


@pytest.fixture
def random_problems():
    return stable_problem


@pytest.fixture
def closed_problem():
    """One node, F = 4 - alpha, f = (1, -3.5) + alpha (1, -3): a closed branch of stick and slip-, alpha^2 < 1/2."""
    A = [[2.0, -1.0], [-1.0, 2.0]]
    f, slope = [1.0, -3.5], [1.0, -3.0]
    return enumsol.ContactProblem(A, [[1.0, 0.0]], [[0.0, 1.0]], f, friction=(4.0, -1.0), load_slope=slope)
