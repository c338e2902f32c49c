"""Friction of any size in 3D is decided: tau has units of its own, and S keeps its condition (theory, section 12.1)."""

import re
from fractions import Fraction

import numpy as np
import oracles3d
import pytest
from checker.test_space_exclusions import excluded
from complete import all_roots, complete_report
from problems3d import from_compliance, random_compliance, random_one_node, unmatched, within
from proof_tools import of_kind, records_of
from refusals import bad_problem

from enumsol import ContactProblem3D, Proof, enumerate_roots, verify

SIZES = [1e-3, 1e-5, 1e-7, 5e-8, 1e-9, 1e-12, 1e-30, 1e-100, 1e-160, 1e-270]


def proven(problem, alpha=0):
    """All roots; the checker accepts their proof, and rationals its exclusions."""
    roots = all_roots(problem, alpha, max_nodes=600)
    assert roots.index_sum == 1
    complete_report(problem, roots.proof)
    if problem.p == 1:
        assert excluded(problem, records_of(roots.proof), alpha)
    return roots


def in_enclosures(root):
    return all(within(getattr(root, name), getattr(root.enclosure, name)) for name in ("lambda_n", "lambda_t", "u_t"))


@pytest.mark.few(2, 2)
@pytest.mark.parametrize("F", SIZES)
def test_roots_are_near_those_without_friction(F):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        S, g = random_compliance(rng, 2), rng.normal(size=6)
        (root,), (smooth,) = (proven(from_compliance(S, g, friction)) for friction in (F, 0.0))
        size = np.max(np.abs(smooth.lambda_n)) or 1.0
        assert np.max(np.abs(root.lambda_n - smooth.lambda_n)) <= (20 * F + 1e-13) * size
        assert in_enclosures(root)
        # friction against the slip, as large as the coefficient says
        slipping = root.lambda_n > 0
        along = smooth.u_t / np.linalg.norm(smooth.u_t, axis=1)[:, None]
        expected = np.where(slipping[:, None], along * root.lambda_n[:, None], 0.0)
        assert np.max(np.abs(root.lambda_t / F - expected)) <= (20 * F + 1e-12) * size


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("orthotropic", [False, True])
def test_one_node_against_the_closed_form(orthotropic):
    rng = np.random.default_rng(7)
    for k in range(20):
        S, g, _ = random_one_node(rng)
        F = 10.0 ** rng.uniform(-12, 0, (1, 2)) if orthotropic else np.full((1, 2), 10.0 ** rng.uniform(-12, 0))
        found, near = oracles3d.one_node(S, g, F)
        wanted = [lam for group in found.values() for lam in group]
        assert near > 1e-12
        roots = proven(from_compliance(S, g, tuple(F.T)))
        assert (len(roots), unmatched(roots, wanted)) == (len(wanted), ([], [])), k


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(3))
def test_coefficients_of_all_sizes_together(seed):
    rng = np.random.default_rng(seed)
    several = 0
    for k in range(5):
        p = int(rng.integers(1, 4))
        S, g = random_compliance(rng, p), rng.normal(size=3 * p)
        chance, F = rng.random((p, 2)), 10.0 ** rng.uniform(-270 if k % 2 else -20, 0.5, (p, 2))
        F = np.where(chance < 0.15, 0.0, np.where(chance < 0.3, 1.0, F))
        roots = proven(from_compliance(S, g, tuple(F.T)))
        assert all(in_enclosures(root) for root in roots)
        several += np.ptp(np.log(F[F > 0])) > 20 if np.any(F > 0) else 0
    assert several > 0


def test_a_coefficient_that_is_rounded():
    rng = np.random.default_rng(3)
    S, g = random_compliance(rng, 1), np.array([1.0, 2.0, 1.0])
    for slope in (1e-9, 1e-200):
        proven(from_compliance(S, g, 0.0, friction_slope=slope), Fraction(1, 3))


@pytest.mark.parametrize("F", [1e7, 1e8, 1e9])
def test_large_coefficients(F):
    for seed in (0, 1, 3):
        rng = np.random.default_rng(seed)
        proven(from_compliance(random_compliance(rng, 2), rng.normal(size=6), F))


def test_a_slip_along_one_axis_with_a_tiny_coefficient_on_the_other():
    """The direction of slip is that of F u_t: u_t along t1 hides in the rounding of what is along t2."""
    S, g = np.eye(3), np.array([1.0, 0.5, 0.25])
    for F2 in (1e-6, 1e-9, 1e-80):
        (root,) = proven(from_compliance(S, g, (1.0, F2)))
        assert str(root.statuses[0]) == "slip"
        tau = root.lambda_t[0] / [1.0, F2]
        assert np.allclose(tau, [0.5, np.sqrt(0.75)], atol=1e-5)


@pytest.mark.parametrize(
    ("F", "words"), [(1e-300, "underflows; expected 0, or at least"), (1e101, "overflows; expect")]
)
def test_beyond_float64_the_coefficient_is_named(F, words):
    problem = ContactProblem3D(np.eye(3), *np.eye(3)[:, None], [1, 1, 1], friction=F)
    bad_problem(re.escape(f"a friction coefficient is {F:g}, where float64 {words}"), enumerate_roots, problem, 0)


def test_a_proof_does_not_name_the_units_of_tau(tmp_path):
    """They follow from F: files hold (lambda_n, tau) as docs/proof_format.md says."""
    rng = np.random.default_rng(0)
    problem = from_compliance(random_compliance(rng, 1), np.array([1.0, 2.0, 1.0]), 1e-9)
    roots = enumerate_roots(problem, 0, proof_path=tmp_path / "small.proof")
    records = records_of(roots.proof)
    (record,) = (records[k] for k in of_kind(records, "r"))
    normal, *tau = record[1]
    assert abs(np.hypot(*tau) - normal) < 1e-9 * normal
    assert verify(problem, Proof.load(tmp_path / "small.proof"))
