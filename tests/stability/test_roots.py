"""Verdicts on roots of problems, as a user asks for them, against all sets of sliding nodes."""

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp
from growing_motions import of_a_root
from helpers.floating_bodies import pushed_block
from problems3d import degenerate_integers

import enumsol
from enumsol import ContactProblem, ContactProblem3D, gallery


def random_mass(rng, n):
    Y = rng.normal(size=(n, n))
    return [np.eye(n), np.diag(10.0 ** rng.uniform(-1, 1, n)), Y @ Y.T + 0.1 * np.eye(n)][rng.integers(3)]


def check(problem, roots, mass, counts):
    """Every verdict on the roots is that of the judge; motions and rates solve the equations of motion."""
    for root, found in zip(roots, roots.stability(mass=mass), strict=True):
        judged = of_a_root(problem, root, mass)
        counts[found.verdict] += 1
        if found.verdict != "undecided":
            assert (found.verdict == "runs away") == bool(judged)
        assert len(found.growth_rates) == len(found.motions) == len(found.bounds)
        for rate, (low, high) in zip(found.growth_rates, found.bounds, strict=True):
            assert low <= rate <= high
            assert any(low * (1 - 1e-6) <= np.sqrt(mu) <= high * (1 + 1e-6) for mu, *_ in judged)


def planted_problem(rng, kinds=("open", "stick", "slip", "slip", "limit", "touching")):
    """Integers, so that a root that has these statuses has them exactly; all nodes coupled."""
    p = int(rng.integers(1, 4))
    n = 2 * p + int(rng.integers(0, 3))
    # of low rank, so that normals and tangents are strongly coupled
    X = rng.integers(-2, 3, size=(n, max(1, n - 2)))
    A = X @ X.T / 4.0 + np.eye(n) * float(rng.choice([0.125, 0.25]))
    F = rng.choice([0.0, 0.5, 1.0, 2.0, 4.0], size=p, p=[0.05, 0.1, 0.25, 0.3, 0.3])
    w, lam = np.zeros(2 * p), np.zeros(2 * p)
    for i in range(p):
        kind, s = str(rng.choice(kinds)), float(rng.choice([-1, 1]))
        lam[i] = 0.0 if kind in ("open", "touching") else float(rng.integers(1, 4))
        if kind == "open":
            w[i], w[p + i] = -1.0, s
        elif kind == "touching":
            w[p + i] = s * float(rng.integers(2))
        elif kind == "stick":
            lam[p + i] = s * 0.5 * F[i] * lam[i]
        else:
            lam[p + i] = s * F[i] * lam[i]
            w[p + i] = s if kind == "slip" else 0.0
    gap, offset = rng.integers(0, 2, p).astype(float), rng.integers(-1, 2, p).astype(float)
    u = np.concatenate([w + np.concatenate([gap, offset]), rng.integers(-1, 2, n - 2 * p)])
    rows = np.eye(n)
    f = A @ u + rows[: 2 * p].T @ lam
    return ContactProblem(A, rows[:p], rows[p : 2 * p], f, gap=gap, slip_offset=offset, friction=F)


def compared(seeds, **options):
    counts = Counter()
    for seed in seeds:
        rng = np.random.default_rng(seed)
        problem = planted_problem(rng, **options)
        check(problem, enumsol.enumerate_roots(problem, 0.0), random_mass(rng, problem.n), counts)
    return counts


def test_planted_roots():
    counts = compared([(1, k) for k in range(10)])
    assert counts["undecided"] <= 1, counts
    assert counts["does not run away"], counts


@pytest.mark.long
@pytest.mark.parametrize("part", range(3))
def test_three_hundred_planted_roots_with_degenerate_statuses(part):
    counts = compared([(2, part, k) for k in range(100)], kinds=("slip", "limit", "limit", "touching", "stick"))
    assert counts["undecided"] <= 0.02 * counts.total() + 1, counts


def space_problem(rng):
    """One or two nodes in 3D that slide, stick or are open, with orthotropic friction."""
    p = int(rng.integers(1, 3))
    n = 3 * p + int(rng.integers(0, 2))
    X = rng.normal(size=(n, n))
    A = X @ X.T + 10.0 ** rng.uniform(-1.5, 0) * np.eye(n)
    F = rng.choice([0.3, 0.8, 1.5, 3.0], size=(p, 2))
    w, lam = np.zeros((p, 3)), np.zeros((p, 3))
    for i in range(p):
        angle = rng.uniform(-np.pi, np.pi)
        d = np.array([np.cos(angle), np.sin(angle)])
        if rng.random() < 0.8:
            lam[i] = [1, *(F[i] * d)]
            w[i, 1:] = rng.uniform(0.1, 1) * d / F[i]
        else:
            lam[i] = [1, *(0.5 * F[i] * d)]
    u = np.concatenate([np.ravel(w, order="F"), rng.normal(size=n - 3 * p)])
    rows = np.eye(n)
    f = A @ u + rows[: 3 * p].T @ np.ravel(lam, order="F")
    return ContactProblem3D(A, rows[:p], rows[p : 2 * p], rows[2 * p : 3 * p], f, friction=(F[:, 0], F[:, 1]))


def compared_in_space(seeds):
    counts = Counter()
    for seed in seeds:
        rng = np.random.default_rng(seed)
        problem = space_problem(rng)
        roots = enumsol.enumerate_roots(problem, 0.0, max_nodes=3000)
        check(problem, roots, random_mass(rng, problem.n), counts)
    return counts


def test_roots_in_space():
    counts = compared_in_space([(3, k) for k in range(5)])
    assert counts["undecided"] <= 1, counts


@pytest.mark.long
@pytest.mark.parametrize("part", range(2))
def test_many_roots_in_space(part):
    counts = compared_in_space([(4, part, k) for k in range(100)])
    assert counts["undecided"] <= 0.02 * counts.total() + 1, counts


@pytest.mark.slow
def test_degenerate_roots_in_space_with_and_without_friction_along_an_axis():
    counts = Counter()
    for seed in range(40):
        problem, *_, named = degenerate_integers(seed, kinds=("limit",))
        if "graze" in named or problem.p > 2:
            continue
        roots = enumsol.enumerate_roots(problem, 0, max_nodes=3000)
        kept = [root for root in roots if not any(len(a) > 1 and "OPEN" in str(a) for a in root.active)]
        for root in kept:
            found = enumsol.stability(problem, root, mass=np.eye(problem.n))
            counts[found.verdict] += 1
            if found.verdict != "undecided":
                assert (found.verdict == "runs away") == bool(of_a_root(problem, root, np.eye(problem.n)))
    assert counts.total() >= 5, counts


def test_bodies_that_nothing_holds():
    """A block that slides on a table."""
    problem = pushed_block(1)
    counts, rng = Counter(), np.random.default_rng(1)
    for alpha in (0.5, 1.0, -1.0):
        roots = enumsol.enumerate_roots(problem, alpha)
        check(problem, roots, np.eye(problem.n), counts)
        check(problem, roots, random_mass(rng, problem.n), counts)
    assert counts["does not run away"], counts


@pytest.mark.slow
def test_bodies_that_nothing_connects():
    one, mass = gallery.get("one-node-6.1").build(), np.eye(2)
    single = enumsol.enumerate_roots(one, 5.0).stability(mass=mass)
    problem = gallery.chain(2)
    whole = np.eye(problem.n)
    roots = enumsol.enumerate_roots(problem, 5.0)
    check(problem, roots, whole, Counter())
    assert {found.verdict for found in single} == {"runs away", "does not run away"}
    # it runs away where one of its bodies does, in as many ways
    away = sum(found.verdict == "runs away" for found in roots.stability())
    assert (len(roots), away) == (9, 9 - 4)
    assert max(len(found.growth_rates) for found in roots.stability(mass=whole)) == 2


def test_an_axis_without_friction():
    """Along it the node moves freely; that says nothing of the other axis."""
    A, rows = np.array([[2, 0.9, 0.1], [0.9, 1, 0], [0.1, 0, 1]]), np.eye(3)
    seen = {}
    for force in (1.5, 0.5):
        w = np.array([0, 0.25 if force == 1.5 else 0, 0.5])
        f = A @ w + [1, force, 0]
        problem = ContactProblem3D(A, rows[:1], rows[1:2], rows[2:], f, friction=(1.5, 0.0))
        for root in enumsol.enumerate_roots(problem, 0.0):
            [active] = root.active
            seen[str(*active)] = enumsol.stability(problem, root, mass=np.eye(3))
    assert {name: found.verdict for name, found in seen.items()} == {
        "open": "does not run away",
        "stick": "does not run away",
        "slip": "runs away",
    }
    assert seen["slip"].growth_rates[0] == pytest.approx(np.sqrt(0.35))


def test_a_body_without_mass_beside_one():
    """Nothing is said of a part without any mass."""
    problem = gallery.chain(2)
    roots = enumsol.enumerate_roots(problem, 5.0)
    found = dict(
        zip(
            ("".join(str(s)[1] for s in root.statuses) for root in roots),
            roots.stability(mass=np.diag([1, 1, 0, 0])),
            strict=True,
        )
    )
    verdicts = {name: item.verdict for name, item in found.items()}
    assert (verdicts["pp"], verdicts["tt"], verdicts["lp"]) == ("does not run away", "does not run away", "runs away")
    assert verdicts["pl"] == "undecided"


@pytest.mark.slow
def test_a_uniform_density_changes_no_verdict():
    problem = gallery.taper(3, 3)
    roots = enumsol.enumerate_roots(problem, 0.2)
    own = roots.stability()
    dense = roots.stability(mass=9 * problem.inertia)
    assert [one.verdict for one in own] == [other.verdict for other in dense]
    for one, other in zip(own, dense, strict=True):
        np.testing.assert_allclose(np.array(other.growth_rates) * 3, one.growth_rates, rtol=1e-6)
    # and what was asked for last is not what the problem's own mass is
    assert roots.stability() is own
    assert roots.verdicts is own


@pytest.mark.slow
def test_exact_alpha_of_a_mesh():
    roots = enumsol.enumerate_roots(gallery.taper(3, 3), Fraction(1, 5))
    assert [found.verdict for found in roots.stability()] == ["does not run away", "runs away", "does not run away"]


def test_mass_of_few_degrees_of_freedom():
    """Mass at the contact alone, or beside it: statements are still made, and they are right."""
    problem = planted_problem(np.random.default_rng([1, 5]), kinds=("slip",))
    counts = Counter()
    roots = enumsol.enumerate_roots(problem, 0.0)
    tall = np.diag(np.r_[np.ones(2 * problem.p), np.zeros(problem.n - 2 * problem.p)])
    check(problem, roots, tall, counts)
    assert not counts["undecided"]
    assert sp.issparse(problem.replace(mass=tall).mass)


def test_mass_of_low_rank():
    """Semidefinite on all degrees of freedom: no statement is wrong, and the search ends."""
    counts = Counter()
    for seed in range(4):
        rng = np.random.default_rng([6, seed])
        problem = planted_problem(rng, kinds=("slip",))
        Y = rng.integers(-2, 3, (problem.n, 1)).astype(float)
        mass = Y @ Y.T
        for root, found in zip(roots := enumsol.enumerate_roots(problem, 0.0), roots.stability(mass=mass), strict=True):
            counts[found.verdict] += 1
            if found.verdict != "undecided":
                assert (found.verdict == "runs away") == bool(of_a_root(problem, root, mass))
    assert counts.total() >= 4


def test_the_sliding_brake_shoe_runs_away_where_its_stiffness_is_known_but_roughly():
    entry = gallery.get("brake-shoe-9")
    found = enumsol.enumerate_roots(entry.build(), entry.alpha).stability()
    assert [own.verdict for own in found] == ["does not run away", "runs away", "does not run away"]
