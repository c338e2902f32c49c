"""Singular selections on which LU succeeds: float solves make roots of them that verified arithmetic refuses."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from complete import all_roots, complete_report, proven_roots
from effort import some
from generators import integer_problem
from oracles import exact_condense, exact_solutions
from proof_tools import det_sign

from enumsol import ContactProblem, enumerate_roots
from enumsol.trusted.at_alpha import contradicts, solve_selection

# (seed, load) found by a random search over 6,000 matrices
HUNTED = ((345, 1), (557, 0), (801, 1), (975, 0), (1016, 0), (1016, 2), (1052, 1), (2546, 1))
MU = 2.0
P = 4


def hunted(seed, load):
    """Whole-number SPD stiffness, friction 2, and a root planted in a selection that is singular."""
    rng = np.random.default_rng([seed, 77])
    X = rng.integers(-1, 2, size=(2 * P, 2 * P))
    A = (X @ X.T + np.eye(2 * P) * int(rng.integers(1, 3))).astype(float)
    codes = rng.integers(0, 4, size=P)
    slip = np.where(codes == 2, 1.0, np.where(codes == 3, -1.0, 0.0))
    rng = np.random.default_rng([seed, load])
    n = np.where(codes > 0, rng.integers(0, 3, size=P), 0)
    t = np.where(codes == 1, rng.integers(-2, 3, size=P), 0)
    t = np.clip(t, -MU * n, MU * n) + slip * MU * n
    normal = np.where(codes == 0, -rng.integers(0, 2, size=P), 0)
    w = np.concatenate([normal, rng.integers(0, 3, size=P) * slip])
    w[P:] += np.where(codes == 0, rng.integers(-1, 2, size=P), 0)
    rows = np.eye(2 * P)
    load = A @ w + np.concatenate([n, t])
    return ContactProblem(A, rows[:P], rows[P:], load, friction=MU), tuple(int(c) for c in codes)


def float_roots(S, g, F, tolerance=1e-9):
    """What a solver finds that trusts every LU that does not break down: distinct points that pass all conditions."""
    p, points = len(F), []
    for codes in product(range(4), repeat=p):
        M, b = np.eye(2 * p), np.zeros(2 * p)
        for i, code in enumerate(codes):
            if code:
                M[i], b[i] = S[i], g[i]
            if code == 1:
                M[p + i], b[p + i] = S[p + i], g[p + i]
            if code > 1:
                M[p + i, i] = -F[i] if code == 2 else F[i]
        try:
            x = np.linalg.solve(M, b)
        except np.linalg.LinAlgError:
            continue
        w = g - S @ x
        n, t = x[:p], x[p:]
        least = (-w[:p], np.minimum(n, F * n - np.abs(t)), np.minimum(n, w[p:]), np.minimum(n, -w[p:]))
        holds = all(least[code][i] >= -tolerance for i, code in enumerate(codes))
        if holds and not any(np.allclose(x, y, atol=1e-7) for y in points):
            points.append(x)
    return points


@pytest.mark.few(2, 2)
@pytest.mark.parametrize(("seed", "load"), HUNTED)
def test_false_roots_are_refused(seed, load):
    problem, planted = hunted(seed, load)
    S, g, F = exact_condense(problem, 0)
    assert det_sign(S, F, planted) == 0
    floats = (np.array(part, dtype=float) for part in (S, g, F))
    exact = enumerate_roots(problem, 0.0, "exact", "exhaustive")
    # the trap: LU succeeds where the determinant is zero, and the count comes out wrong
    assert len(float_roots(*floats)) != len(exact) + len(exact.families)
    one = np.ones(2 * P)
    assert solve_selection(problem.enclosure.at(0.0, one, one), planted) is None
    roots = all_roots(problem, 0.0)
    assert (len(roots), len(roots.families), roots.index_sum) == (len(exact), len(exact.families), 1)
    report = complete_report(problem, roots.proof)
    assert (report.roots, report.families) == (len(exact), len(exact.families))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("seed", "load"), HUNTED[1:4])
def test_exact_count_by_an_oracle_in_fractions(seed, load):
    problem, _ = hunted(seed, load)
    isolated = [component.dimension == 0 for component in exact_solutions(problem, Fraction(0))]
    roots = enumerate_roots(problem, 0.0)
    assert (len(roots), len(roots.families)) == (isolated.count(True), isolated.count(False))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(2))
def test_a_selection_that_holds_a_root_is_never_contradicted(seed):
    rng = np.random.default_rng([seed, 88])
    singular = holding = refuted = 0
    for _ in range(some(20, of=60)):
        p = int(rng.integers(1, 4))
        problem = integer_problem(rng, p)
        S, g, F = exact_condense(problem, 0.0)
        if not any(g):
            continue
        system = problem.enclosure.at(0.0, np.ones(2 * p), np.ones(2 * p))
        held = {codes for c in exact_solutions(problem, 0.0) for codes, *_ in c.parts}
        for codes in product(*(range(4) if f > 0 else (0, 4) for f in F)):
            verdict = contradicts(system, codes)
            holding += codes in held
            refuted += verdict
            singular += det_sign(S, F, codes) == 0
            assert not (verdict and codes in held)
    assert min(singular, holding, refuted) >= some(3, of=10)


def beside_a_continuum(more):
    """Slip- is singular; at alpha = 1 it holds a continuum, at a distance d from it its equations miss by d."""
    n = 2 + more
    A = np.eye(n)
    A[:2, :2] = [[2.0, -1.0], [-1.0, 2.0]]
    rows, f, slope = np.eye(n), np.zeros(n), np.zeros(n)
    f[:2], slope[1] = (1.0, -3.0), 1.0
    return ContactProblem(A, rows[:1], rows[1:2], f, friction=2.0, load_slope=slope)


@pytest.mark.parametrize("exponent", [3, 6, 7, 8, 10, 12, 13])
@pytest.mark.parametrize("side", [-1, 1])
def test_equations_that_contradict_each_other_need_no_rationals(exponent, side):
    # 253 degrees of freedom: no rational arithmetic to fall back on
    alpha = 1 + side * Fraction(1, 10**exponent)
    roots = proven_roots(beside_a_continuum(251), alpha)
    exact = enumerate_roots(beside_a_continuum(0), alpha, "exact")
    assert [root.statuses for root in roots] == [root.statuses for root in exact]
    assert roots.stats.escalations.rationals == 0


def test_on_the_continuum_nothing_is_contradicted():
    problem = beside_a_continuum(251)
    system = problem.enclosure.at(1.0, np.ones(2), np.ones(2))
    assert not contradicts(system, (3,))
    roots = enumerate_roots(problem, 1)
    assert not roots.complete
    assert [item.statuses[0].value for item in roots.undecided if item.statuses[0].value == "slip-"]
