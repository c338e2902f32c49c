"""Condensed problems: against dense algebra, in any units, and selections with and without them."""

import tracemalloc
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp
from refusals import bad_argument, bad_problem

from enumsol import ContactProblem, enumerate_roots, gallery
from enumsol.condensation.exact import ExactSystem, UncondensedSystem
from enumsol.condensation.factorization import RHS_BLOCK, Factorization
from enumsol.selections.rational_selections import ExactSelections


def random_problem(seed, n=30, p=4, **options):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, n))
    A = X @ X.T + n * np.eye(n)
    Bn, Bt = rng.normal(size=(p, n)), rng.normal(size=(p, n))
    return ContactProblem(A, Bn, Bt, rng.normal(size=n), **options)


# 2p right-hand sides: less, as many, and more than a block
@pytest.mark.parametrize("p", [1, RHS_BLOCK // 2, RHS_BLOCK])
@pytest.mark.parametrize("seed", range(5))
def test_compliance_and_load_agree_with_dense_algebra(seed, p):
    rng = np.random.default_rng(100 + seed)
    n = 3 * p + 10
    gap, offset, slope = rng.normal(size=p), rng.normal(size=p), rng.normal(size=n)
    problem = random_problem(
        seed, n, p, gap=gap, slip_offset=offset, load_slope=slope, friction=0.2, friction_slope=0.1
    )
    B = np.vstack([problem.Bn.toarray(), problem.Bt.toarray()])
    A = problem.A.toarray()
    condensed = problem.condensed
    S = B @ np.linalg.solve(A, B.T)
    assert np.allclose(condensed.S, S, rtol=1e-12, atol=1e-14 * np.max(np.abs(S)))
    assert np.array_equal(condensed.S, condensed.S.T)
    g0 = B @ np.linalg.solve(A, problem.f) - np.concatenate([gap, offset])
    assert np.allclose(condensed.g0, g0, rtol=1e-12, atol=1e-13)
    assert np.allclose(condensed.g1, B @ np.linalg.solve(A, slope), rtol=1e-12, atol=1e-13)
    system = condensed.at(3.0)
    assert np.allclose(system.g, g0 + 3.0 * condensed.g1, rtol=1e-12, atol=1e-12)
    assert np.allclose(system.F, 0.5)
    assert system.p == p


def test_without_load_slope_the_load_is_constant():
    problem = random_problem(0)
    assert not np.any(problem.condensed.g1)
    assert np.array_equal(problem.condensed.at(7.0).g, problem.condensed.g0)


def test_displacement_solves_the_equilibrium():
    rng = np.random.default_rng(3)
    problem = random_problem(3, gap=0.1, load_slope=rng.normal(size=30))
    forces = rng.normal(size=8)
    u = problem.condensed.displacement(0.5, forces)
    residual = problem.A @ u + problem.Bn.T @ forces[:4] + problem.Bt.T @ forces[4:] - problem.load_at(0.5)
    assert np.max(np.abs(residual)) < 1e-13 * np.max(np.abs(problem.A.toarray()))
    # and u_n, u_t of the condensed problem are those of u
    w = problem.condensed.at(0.5).g - problem.condensed.S @ forces
    assert np.allclose(w, np.concatenate([problem.Bn @ u - problem.gap, problem.Bt @ u]), atol=1e-13)


def test_gap_and_slip_offset_shift_the_roots():
    # one spring: u_n = f_n / k - lambda_n / k - gap, the node touches once f_n > k gap
    parts = 4.0 * np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [3.0, 0.5]
    (root,) = enumerate_roots(ContactProblem(*parts, gap=0.5, friction=1.0, slip_offset=0.25), 0.0)
    # to stick at u_t = slip_offset takes lambda_t = 0.5 - 4 * 0.25, within the bound
    assert root.statuses[0].value == "stick"
    assert (root.lambda_n[0], root.lambda_t[0], *root.u) == pytest.approx((1.0, -0.5, 0.5, 0.25))
    assert (root.u_n[0], root.u_t[0]) == pytest.approx((0.0, 0.0), abs=1e-15)
    (root,) = enumerate_roots(ContactProblem(*parts, gap=1.0, friction=1.0), 0.0)
    assert root.statuses[0].value == "open"
    assert (root.u_n[0], root.u_t[0]) == pytest.approx((-0.25, 0.125))


def test_a_solve_is_refined():
    # a badly scaled and conditioned matrix: one step of refinement brings the residual down to rounding of its terms
    rng = np.random.default_rng(5)
    n = 60
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    scale = np.exp2(rng.integers(-20, 20, size=n))
    A = scale[:, None] * (Q @ np.diag(np.logspace(0, 9, n)) @ Q.T) * scale
    A = sp.csc_array(0.5 * (A + A.T))
    factorization = Factorization(A)
    for rhs in (rng.normal(size=n), rng.normal(size=(n, 3))):
        x = factorization.solve(rhs)
        terms = abs(A) @ np.abs(x) + np.abs(rhs)
        assert x.shape == rhs.shape
        assert np.max(np.abs(A @ x - rhs) / terms) < 8 * np.finfo(float).eps


@pytest.mark.parametrize("exponent", [-40, -13, 7, 60])
def test_scaling_by_powers_of_two_is_exact(exponent):
    block = gallery.clamped_block(6, 3)
    factor = 2.0**exponent
    # stiffness and load together: the same displacements, forces scaled, not a bit of difference
    scaled = ContactProblem(block.A * factor, block.Bn, block.Bt, block.f * factor)
    assert np.array_equal(scaled.condensed.S * factor, block.condensed.S)
    assert np.array_equal(scaled.condensed.g0, block.condensed.g0)
    system, reference = scaled.condensed.at(2.0).scaled, block.condensed.at(2.0).scaled
    assert np.array_equal(np.frexp(system.force)[0], np.frexp(reference.force)[0])


@pytest.mark.parametrize("seed", range(4))
def test_the_scaled_system_has_no_units(seed):
    rng = np.random.default_rng(seed)
    problem = random_problem(seed, gap=rng.normal(size=4), friction=0.7)
    system = problem.condensed.at(1.0)
    scaled = system.scaled
    for factors in (scaled.force, scaled.length):
        assert np.array_equal(np.frexp(factors)[0], np.full(8, 0.5))  # powers of two
        assert np.array_equal(factors[:4], factors[4:])  # one a node: friction coefficients are unchanged
    assert np.array_equal(scaled.F, system.F)
    assert np.allclose(scaled.length[:, None] * scaled.S / scaled.force, system.S, rtol=1e-15)
    assert np.array_equal(scaled.length * scaled.g, system.g)
    assert np.all((np.diag(scaled.S) > 0.1) & (np.diag(scaled.S) < 10))
    assert 1.0 <= scaled.g @ np.linalg.solve(scaled.S, scaled.g) < 4.0


def test_a_load_beyond_float64_is_refused():
    problem = random_problem(0, load_slope=1e5 * np.ones(30))
    condensed = problem.replace(A=problem.A * 1e-3).condensed
    bad_argument(r"alpha = 1.7e\+308 makes the load overflow", condensed.at, 1.7e308)
    # a compliance without float64 value
    huge = ContactProblem(1e-300 * np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1e300, 0.0])
    message = "the condensed problem overflows float64; expected data in smaller units"
    bad_problem(message, getattr, huge, "condensed")


def test_nothing_of_size_n_by_n_becomes_dense():
    # a 2D lattice of springs, n = 20,000: dense rows alone would take 3.2 GB
    side = 100
    line = sp.diags_array([-np.ones(side - 1), 2.0 * np.ones(side), -np.ones(side - 1)], offsets=(-1, 0, 1))
    lattice = sp.kronsum(line, line, format="csc")
    A = sp.csc_array(sp.kron(lattice, np.array([[1.0, 0.2], [0.2, 1.0]])))
    n, p = A.shape[0], 20
    rows = np.arange(p)
    Bn, Bt = (sp.csr_array((np.ones(p), (rows, 8 * rows + k)), shape=(p, n)) for k in (0, 1))
    f = np.tile([1e-3, 2e-4], n // 2)
    tracemalloc.start()
    problem = ContactProblem(A, Bn, Bt, f)
    S = problem.condensed.S
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert n == 20_000
    # vectors of length n in flight: a few blocks of right-hand sides and copies of A and its factor
    assert peak < 30 * RHS_BLOCK * 8 * n
    assert peak < 0.04 * 8 * n * n
    column = problem.factorization.solve(Bn[[0]].toarray().ravel())
    assert S[0, 0] == pytest.approx(column[0], rel=1e-12)


# -- the matrices of the problem in place of the condensed ones --------------------------------------------------------


def test_selections_are_solved_alike_with_and_without_condensing(rng):
    singular = 0
    for _ in range(5):
        p = int(rng.integers(1, 4))
        n = 2 * p + int(rng.integers(0, 4))
        X = rng.integers(-1, 2, size=(n, n))
        A = (X @ X.T + np.eye(n)) * 0.1
        B = np.linalg.qr(rng.normal(size=(n, n)))[0][: 2 * p] if rng.random() < 0.5 else np.eye(n)[: 2 * p]
        F, gap = rng.integers(0, 4, size=p) / 2, rng.integers(0, 2, size=p).astype(float)
        f = rng.integers(-2, 3, size=n).astype(float)
        problem = ContactProblem(A, B[:p], B[p:], f, gap=gap, load_slope=f / 3, friction=F, friction_slope=0.25)
        alpha = Fraction(int(rng.integers(0, 3)), 3)
        ours = ExactSelections(UncondensedSystem(problem, alpha))
        condensed = ExactSelections(ExactSystem.from_problem(problem, alpha))
        for codes in product(range(4), repeat=p):
            found, expected = ours.solve_equations(codes), condensed.solve_equations(codes)
            assert found == expected
            singular += expected is None
            if expected is not None:
                assert ours.moved(expected[0]) == condensed.moved(expected[0])
            assert ours.solve(codes) == condensed.solve(codes)
        assert "_condensed" not in vars(ours.system) or singular
