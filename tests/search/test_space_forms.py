"""Searches in 3D that bound another form than the energy (theory, section 12.2): bodies on weak springs."""

from fractions import Fraction

import numpy as np
import pytest
from compare import assert_same_in_space
from complete import proven_roots
from exact_balls import holds
from problems3d import forces, from_compliance, random_coupled
from proof_tools import (
    by_forms,
    bytes_of,
    in_file,
    leaves_of,
    of_kind,
    proof_of,
    put,
    records_of,
    replaced,
    why_refused,
)
from space_proofs import values_of, with_values
from trees import by_the_tree, forms_at_once

from enumsol import enumerate_roots, fem, verify
from enumsol.arithmetic.balls import SAFE
from enumsol.checker.space_checker import SpaceChecker
from enumsol.checker.walk import TreeCell
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.sector_margins import SlipForm


def on_springs(seed, p=3, spring=1e-3):
    """S, g, F of nodes on a common body on weak springs, which is pressed and pulled."""
    rng = np.random.default_rng([seed, 3])
    X = rng.normal(size=(3 * p, 3 * p))
    together = np.kron(np.eye(3), np.ones((p, 1)))
    S = X @ X.T / p + 0.2 * np.eye(3 * p) + together @ together.T / spring
    load = np.array([1.0, *rng.uniform(-0.4, 0.4, 2)])
    return S, together @ load / spring + 0.3 * rng.normal(size=3 * p), np.full((p, 2), rng.uniform(0.3, 1.5))


def problem_of(data):
    S, g, F = data
    return from_compliance(S, g, (F[:, 0], F[:, 1]))


@pytest.fixture(scope="module")
def with_form():
    """Problem, roots and records of a search whose proof has a form."""
    problem = problem_of(on_springs(0))
    with by_the_tree(), forms_at_once():
        roots = enumerate_roots(problem, 0)
    records = records_of(roots.proof)
    assert len(roots)
    assert of_kind(records, "q")
    assert len(by_forms(records)) > 3
    return problem, roots, records


@pytest.mark.slow
def test_the_same_roots_as_by_the_energy_and_by_newton():
    used = 0
    for seed in range(8):
        data = on_springs(seed, 2) if seed % 2 else random_coupled(np.random.default_rng(seed), 2)
        problem = problem_of(data)
        with by_the_tree():
            plain = enumerate_roots(problem, 0)
            with forms_at_once():
                roots = enumerate_roots(problem, 0)
        assert_same_in_space(problem, roots, plain, data, seed)
        used += bool(by_forms(records_of(roots.proof)))
    assert used >= 4


def numbers_of(c, enclosed, mu=1.0, kappa=1.0):
    """The numbers of a form, given a vector for every node."""
    both = np.concatenate([np.broadcast_to(mu, len(c)), np.broadcast_to(kappa, len(c))])
    return np.concatenate([both, c[enclosed.tau >= 0]])


def test_a_form_is_at_most_zero_at_solutions_and_what_the_theory_says():
    rng = np.random.default_rng(1)
    for seed in range(6):
        S, g, F = random_coupled(np.random.default_rng(seed), 2)
        F[0, seed % 2] = 0.0 if seed > 3 else F[0, seed % 2]
        problem = from_compliance(S, g, (F[:, 0], F[:, 1]))
        solvers, p = SpaceSolvers(problem, 0.0, "verified"), 2
        enclosed, system = solvers.enclosed, solvers.system
        angle = rng.uniform(0, 2 * np.pi, p)
        mu, kappa = rng.normal(size=p), rng.uniform(0.2, 2.0, p)
        c = 0.999 * kappa[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        form = SlipForm.of(enclosed, numbers_of(c, enclosed, mu, kappa))
        for root in enumerate_roots(problem, 0):
            lam, v = forces(root), np.where(F > 0, F * root.u_t, 0.0)
            tau = lam[p:].reshape(2, p).T / np.where(F > 0, F, 1.0)
            y = np.concatenate([lam[:p] / system.force, (tau / system.force[:, None])[F > 0] / enclosed.unit[p:]])
            slip = np.sum(np.where(F > 0, c, 0.0) * v, axis=1) - kappa * np.linalg.norm(v, axis=1)
            wanted = np.sum(lam[:p] * slip)
            q = (y @ form.H @ y - form.h @ y) * system.force[0] * system.length[0]
            assert q == pytest.approx(wanted, abs=1e-9 * max(1.0, np.max(np.abs(S)) * np.max(lam) ** 2))
            assert wanted <= 1e-12


def test_balls_of_a_form_hold_the_exact_one():
    problem = problem_of(on_springs(3, 2))
    enclosed, p = SpaceSolvers(problem, 0.0, "verified").enclosed, 2
    c, mu, kappa = np.array([0.3, -0.6, 0.123, 0.9]), [0.7, -0.1], [1.3, 0.95]
    form = SlipForm.of(enclosed, np.array([*mu, *kappa, *c]))
    S, g = [[Fraction(x) for x in row] for row in enclosed.S.tolist()], [Fraction(x) for x in enclosed.g.tolist()]
    share = [Fraction(x) / Fraction(u) for x, u in zip(c.tolist(), enclosed.unit[p:].tolist(), strict=True)]
    weight = [Fraction(mu[i]) for i in range(p)] + [Fraction(0)] * (2 * p)
    for i in range(p):
        for t in enclosed.tau[i].tolist():
            weight[t] = Fraction(kappa[i])
    rows = [[x * y for y in row] for x, row in zip(weight, S, strict=True)]
    load = [x * y for x, y in zip(weight, g, strict=True)]
    for i in range(p):
        for t in enclosed.tau[i].tolist():
            rows[i] = [x - share[t - p] * y for x, y in zip(rows[i], S[t], strict=True)]
            load[i] -= share[t - p] * g[t]
    assert holds(form.h, form.h_rad, load)
    assert holds(form.H, form.H_rad, [(rows[i][j] + rows[j][i]) / 2 for i in range(3 * p) for j in range(3 * p)])
    # no more than some roundings wider than the balls of S and g
    assert np.max(form.H_rad) < 8 * np.max(enclosed.S_rad) + 1e-14 * np.max(np.abs(enclosed.S))


@pytest.mark.parametrize(
    "numbers",
    [
        [1.0, 1.0, 0.5, 1.0, 0.5, 1e-6, 0.0, 0.0],
        [1.0, 1.0, 1.0, 2.0, 0.0, 0.0, -2.0 * SAFE, 0.0],
        [1.0, 1.0, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 1.0, 1e-200, 1.0, 1e-170, 0.0, 0.0, 0.0],
        [1.0, 1.0, np.nan, 1.0, 0.0, 0.0, 0.0, 0.0],
        [1.0] * 4 + [0.0] * 3,
    ],
)
def test_no_vector_is_longer_than_its_kappa(numbers):
    enclosed = SpaceSolvers(problem_of(on_springs(3, 2)), 0.0, "verified").enclosed
    with pytest.raises(ValueError, match=r"longer than its kappa|7 numbers; expected 8"):
        SlipForm.of(enclosed, np.array(numbers))


def test_proofs_that_say_something_else_of_a_form_are_refused(with_form):
    problem, _, records = with_form
    assert verify(problem, proof_of(records)).complete
    ((declared, *_), (first, *_)), p = (of_kind(records, "q"), by_forms(records)), problem.p
    numbers, without = records[declared][2], replaced(records, declared)
    longer = put(records, (declared, 2, 2 * p), numbers[p])
    assert "longer than its kappa" in why_refused(problem, longer)
    for changed in (
        put(records, (declared, 2), numbers[:-1]),
        put(records, (declared, 2), numbers[: 2 * p] + [-x for x in numbers[2 * p :]]),
        put(records, (declared, 2, 0), 3.0 * numbers[0]),
        without,
        # too late, by the energy, with multipliers that prove nothing
        [*without[:first], records[declared], *without[first:]],
        [record[:3] if k in by_forms(records) else record for k, record in enumerate(records)],
        replaced(records, first, with_values(records[first], [0.0 for _ in values_of(records[first])])),
    ):
        assert why_refused(problem, changed)


def test_a_form_that_is_not_convex_proves_nothing(with_form):
    problem, _, records = with_form
    checker = SpaceChecker(problem, None)
    checker._read_header(records[0])
    (place, *_), codes = by_forms(records), dict(leaves_of(records))
    checker._declare(records[of_kind(records, "q")[0]])
    assert checker._leaf(TreeCell(codes[place]), in_file(records[place])) is None
    form = checker._form(1)
    object.__setattr__(form, "H", form.H - 10.0 * np.eye(len(form.h)))
    del form.__dict__["smallest_eigenvalue"]
    assert "do not exclude" in checker._leaf(TreeCell(codes[place]), in_file(records[place]))


@pytest.mark.slow
def test_a_search_goes_on_with_the_form_of_an_earlier_one(with_form, tmp_path):
    problem, roots, records = with_form
    with by_the_tree(), forms_at_once():
        for most in (3, len(records) // 4):
            path = tmp_path / f"{most}.proof"
            assert not enumerate_roots(problem, 0, max_nodes=most, proof_path=path).complete
            assert len(proven_roots(problem, 0, proof_path=path, resume=True)) == len(roots)


def test_forms_are_deterministic_and_fast_arithmetic_finds_the_same(with_form):
    problem, roots, _ = with_form
    with by_the_tree(), forms_at_once():
        assert bytes_of(enumerate_roots(problem, 0).proof) == bytes_of(roots.proof)
        assert len(enumerate_roots(problem, 0, "fast")) == len(roots)


@pytest.mark.slow
def test_a_body_on_weak_springs_takes_few_nodes():
    """A box of tetrahedra with 9 contact nodes."""
    problem = fem.mesh_problem(
        fem.box(2, 2, 1, (1.0, 1.0, 0.5), "tetrahedra"), young=1.0, poisson=0.3, contact="bottom",
        spring={"top": (5e-4, 5e-4)}, load={"top": (3e-4, 1e-4, -1e-3)}, friction=1.0,
    )  # fmt: skip
    with by_the_tree():
        roots = proven_roots(problem, 0)
    assert by_forms(records_of(roots.proof))
    assert roots.stats.nodes <= 600
