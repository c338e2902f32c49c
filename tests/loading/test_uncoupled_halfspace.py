"""An uncoupled contact under constant pressure: the discrete theorem of Ciavarella and Jaeger as the oracle.

Where both directions have the same compliance and do not interact, the tangential forces of a first loading are F times
the difference of the normal forces of two normal contacts, and those of a way back are twice that, the other way.
"""

import numpy as np
import pytest
from scipy.optimize import nnls

from enumsol import ContactProblem, histories, verify

FRICTION = 0.4


@pytest.fixture(scope="module")
def pad():
    x = np.linspace(-1.0, 1.0, 9)
    C = 1.0 / (0.3 + np.abs(x[:, None] - x))
    K, p = np.linalg.inv(C), len(x)
    A, push = np.block([[K, 0 * K], [0 * K, K]]), K @ np.ones(p)
    rows, gap = np.eye(2 * p), 0.5 * x**2
    load, slope = np.r_[0.3 * push, np.zeros(p)], np.r_[np.zeros(p), push]
    return ContactProblem(0.5 * (A + A.T), rows[:p], rows[p:], load, gap, FRICTION, slope), C, gap


def pressed(C, gap, approach):
    """Normal forces under an approach: min n'C n / 2 - n'(approach - gap) over n >= 0."""
    L = np.linalg.cholesky(C)
    return nnls(L.T, np.linalg.solve(L, approach - gap))[0]


def test_loops_are_those_of_the_theorem(pad):
    problem, C, gap = pad
    slips = 0.3 * FRICTION
    shares = [0.35, 0.72, 0.31, -0.21, -0.72, 0.13, 0.72]
    history = histories(problem, [slips * share for share in shares])
    assert history.complete
    assert history.unique_until == len(shares)
    assert verify(problem, history.proof).complete
    full = pressed(C, gap, 0.3)

    def first(share):
        return FRICTION * (full - pressed(C, gap, 0.3 * (1.0 - share)))

    top = first(0.72)
    known = [first(0.35), top, *(top - 2 * first((0.72 - s) / 2) for s in (0.31, -0.21, -0.72))]
    known += [2 * first((0.72 + s) / 2) - top for s in (0.13, 0.72)]
    for step, forces in enumerate(known, 1):
        root = history.root((step, 0))
        assert root.lambda_n == pytest.approx(full, abs=1e-12)
        assert root.lambda_t == pytest.approx(forces, abs=1e-12)
    assert max(stage.largest_radius for stage in history.data.stages) < 1e-11
