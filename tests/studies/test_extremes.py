"""Extreme data: a part of the cases of the study `extremes`, whose judge compares them with exact arithmetic or with an
equivalent problem and checks their proofs; and what it once found."""

from collections import Counter
from fractions import Fraction
from itertools import islice

import numpy as np
import pandas as pd
import pytest
from complete import accepted_report, all_roots, whole_graph
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import ContactProblem, audit, branch_graph, enumerate_roots, follow, gallery, verify
from enumsol.arithmetic import balls
from enumsol.condensation import enclosure
from enumsol.continuation import start_tangents
from enumsol.search import solvers
from enumsol.search.solvers import Solvers
from enumsol.trusted.exclusion import exclusion_margin

#: Group of the study -> which of its cases: the first, and steps.
SOME = {"scales": (3, 40), "alphas": (4, 11), "frictions": (1, 6), "materials": (4, 7), "geometries": (1, 5)}
SOME |= {"loads": (0, 9), "distances": (0, 25), "parameters": (8, 8), "graphs": (2, 10)}
#: These take seconds each.
LONG = ("wedge-20", "grading 1e+08", "wedge-8-3, stiffness")


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("group", SOME)
def test_cases_of_the_study_are_right(group):
    from extremes.run import CASES

    cases, judged = CASES[group]
    first, step = SOME[group]
    some = [case for case in islice(cases(), first, None, step) if not any(part in case.name for part in LONG)]
    verdicts = Counter(judged(case)["verdict"] for case in some)
    assert not verdicts["wrong"]
    # what stays open has a reason, or counts as wrong
    assert verdicts["right"] >= 0.8 * len(some) > 1


def is_right(problem, alpha, **known):
    from extremes.judge import Case, judge

    return judge(Case("", "", lambda: problem, alpha, **known))["verdict"] == "right"


def almost_dependent(seed, exponent, **more):
    """Two contact nodes whose rows differ by 10^-exponent; from 8 on S is definite only far within rounding."""
    rng = np.random.default_rng([seed, 2])
    rows, X = rng.normal(size=(4, 6)), rng.normal(size=(6, 8))
    rows[[1, 3]] = rows[[0, 2]] + 10.0**-exponent * rows[[1, 3]]
    return ContactProblem(X @ X.T, rows[:2], rows[2:], rng.normal(size=6), friction=1.0, **more)


@pytest.mark.parametrize("exponent", [4, 6, 8, 9])
def test_rows_that_are_almost_dependent(exponent):
    for seed in range(6):
        # floats only propose: whether they can factorize S depends on the processor, and the answer must not
        assert is_right(almost_dependent(seed, exponent), 0.0)


def test_friction_that_vanishes_at_a_fraction():
    # exactly zero at 1/3, positive to the right, negative to the left; floats near 1/3 are on one side
    problem = gallery.clamped_block(3, 2, friction=-1.0, friction_slope=3.0)
    assert is_right(problem, Fraction(1, 3), expected=1)
    assert is_right(problem, Fraction(1, 3) + Fraction(1, 10**25), expected=1)
    bad_argument("expected F >= 0", enumerate_roots, problem, 1 / 3)


def test_friction_that_underflows_is_refused():
    slight = gallery.one_node_triangle().replace(friction=0.0, friction_slope=1e-300)
    bad_argument("too small for float64", enumerate_roots, slight, Fraction(1, 10**100))


def test_nothing_can_be_proven_about_a_body_on_the_verge(monkeypatch):
    # S definite only within rounding and too large for rationals: one undecided entry, and not 4^p of them
    monkeypatch.setattr(solvers, "EXACT_DOF_LIMIT", 0)
    monkeypatch.setattr(enclosure, "least_eigenvalue", lambda S: 0.0)
    problem = gallery.clamped_block(16, 8)
    found = enumerate_roots(problem, 1.0)
    monkeypatch.undo()
    assert not found.complete
    (part,) = found.undecided
    assert "within rounding" in part.reason
    assert accepted_report(problem, found.proof).undecided == 1


# -- regressions found by studies/extremes -----------------------------------------------------------------------------


def rescaled(problem, stiffness=1.0, load=1.0):
    """The problem in other units of stiffness and load."""
    gap, offset = (load / stiffness * part for part in (problem.gap, problem.slip_offset))
    return problem.replace(A=stiffness * problem.A, f=load * problem.f, gap=gap, slip_offset=offset)


@pytest.mark.parametrize("load", [1e-250, 1e-200])
def test_a_tiny_load_needs_no_rationals(load):
    # the radius of a load slope that is zero must not be that of the load's underflow
    found = all_roots(rescaled(gallery.wedge(2, 3), load=load), 1.0)
    assert len(found) == 3
    assert found.stats.escalations.rationals == 0


@pytest.mark.parametrize("f", [(5e-324, 1.0e-323), (1e-300, 1e-305)])
def test_loads_next_to_underflow_are_refused(f):
    # units beyond 2^-900 were written into a proof that the checker then refused
    bad_problem("other units", enumerate_roots, gallery.one_node_triangle(f), 1.0)


@pytest.mark.parametrize("arithmetic", ["fast", "verified", "exact"])
def test_huge_friction(arithmetic):
    for F in (1e20, 1e99):
        problem = ContactProblem(np.eye(2), [[1.0, 0.0]], [[0.0, 1.0]], [1.0, 0.5], friction=F)
        assert len(enumerate_roots(problem, 0.0, arithmetic)) == 1
    bad_problem("friction coefficient is 1e", enumerate_roots, problem.replace(friction=1e200), 0.0, arithmetic)


@pytest.mark.parametrize("exponent", [8, 9])
def test_a_compliance_that_is_definite_by_accident_is_refused(exponent):
    # of some the Cholesky factorization succeeds, which ones depends on the processor
    for seed in range(20):
        problem = almost_dependent(seed, exponent)
        for call, *more in ((enumerate_roots, "fast"), (enumsol.successive_approximations,)):
            bad_problem("independent beyond rounding", call, problem, 0.0, *more)


def test_the_checker_finds_better_bounds_than_the_search():
    # a body almost free to move: an approximate inverse of S has a small residual on one of its sides only
    problem = gallery.wedge(2, 2, springs=(1e-8, 1e-8))
    margins = pytest.importorskip("enumsol.search.certifiers._margin").Margins
    found = Solvers(problem, 1.0, "verified", 1e-9)
    system, rng = found.enclosed, np.random.default_rng(1)
    search = margins((system,), system.F, system.F)
    p, compared = problem.p, 0
    for _ in range(200):
        # rows -w_n >= 0 of all nodes and cones, with the multipliers of any size that no exclusion would have
        rows = np.concatenate([2 * p + np.arange(p), 3 * p + np.arange(p), 4 * p + np.arange(p)])
        values = 10.0 ** rng.uniform(-3, 3, len(rows))
        bounds = search.margin((6,) * p, rows, values), exclusion_margin(system, (6,) * p, rows, values)
        compared += np.isfinite(bounds[0])
        assert bounds[1] >= bounds[0]
    assert compared
    assert verify(problem, enumerate_roots(problem, 1.0, max_nodes=400).proof).ok


def test_large_bodies_are_certified_as_given():
    # ||L|| ||U|| in the Frobenius norm grows with n; sums of rows and columns of |L| |U| do not
    problem = gallery.clamped_block(60, 60, contact=4)
    assert balls._factor_error(problem.A) < 1e-11
    found = all_roots(problem, 1.0)
    assert found.certified_data == "problem"


@pytest.mark.slow
def test_paths_with_huge_friction_and_tiny_loads():
    problem = gallery.two_node_square()
    for high in (1e6, 1e13):
        graph = branch_graph(problem, (0.0, high))
        for start in graph.starting_points():
            # the gradient of a regular selection is not singular because F is large
            assert len(start_tangents(problem, start, (0.0, high))) == 2
    small = rescaled(problem, load=1e-200)
    graph = branch_graph(small, (0.0, 10.0))
    for start in graph.starting_points():
        for direction in (1, -1):
            assert audit(follow(small, start, direction, (0.0, 10.0)), graph).ok


def test_an_interval_below_the_resolution_is_refused():
    problem, interval = gallery.two_node_square(), (3.0 - 1e-9, 3.0 + 1e-9)
    start = whole_graph(problem, interval).starting_points()[0]
    bad_argument("branch_graph works without rounding", follow, problem, start, 1, interval)


def test_audit_on_arcs_of_a_few_floats():
    # the difference quotient along an arc between neighbouring floats was 0 / 0
    problem = gallery.two_node_square()
    graph = branch_graph(problem, (3.0 - 1e-15, 3.0 + 1e-15))
    arc = graph.arcs[0]
    frame = {"alpha": [arc.lo] * 2}
    for i, (n, t) in enumerate(zip(*arc.values(arc.lo), strict=True)):
        frame |= {f"lambda_n_{i}": [n + 0.1] * 2, f"lambda_t_{i}": [t] * 2}
    assert len(audit(pd.DataFrame(frame), graph).off) == 2
