"""One certificate in place of the tree where there is one solution: against all selections, in exact arithmetic."""

from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numpy as np
import pytest
from compare import assert_as_exhaustive, differences
from complete import all_roots, proven_roots
from effort import some
from generators import fe_compliance, random_problem
from proof_tools import kinds_of, proof_of, put, records_of
from rational_checker import check_records
from refusals import bad_argument
from touching import problem_of_any_kind, touching_problem
from trees import above_known_roots, by_the_tree

from enumsol import enumerate_roots, gallery, is_unique, verify
from enumsol.model.statuses import UNDECIDED
from enumsol.search import definite, fathoming as closing, reduction, setup
from enumsol.search.definite import Nodes
from enumsol.search.reduction import KnownRoot, Reduction
from enumsol.support.deadlines import TimeOverError


def whole(problem, alpha):
    system = problem.condensed.at(alpha).scaled
    return Reduction(system, (UNDECIDED,) * system.p, tuple(range(system.p)), {})


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("traction", [(0.3, -1.0), (1.0, -0.3)])
@pytest.mark.parametrize("nx", [48, pytest.param(100, marks=pytest.mark.slow)])
def test_blocks_take_one_node(nx, traction):
    problem = gallery.clamped_block(nx, nx // 6, traction=traction)
    for alpha in (0.1, 1.0, 2.0) if traction[0] > 0.5 else (0.1, 1.0, 2.0, 5.0):
        roots = proven_roots(problem, alpha)
        assert (roots.stats.nodes, roots.stats.closed, len(roots)) == (1, 1, 1)
        assert roots.by_one_certificate
        assert str(roots).endswith("complete: yes (proven: one solution, by one certificate)")
        assert kinds_of(roots.proof) in (["m"], ["a"])
        with by_the_tree():
            assert not differences(roots, enumerate_roots(problem, alpha))


def problems(series, seed, friction):
    rng = np.random.default_rng([series, seed])
    return problem_of_any_kind(rng, int(rng.integers(1, 5)), seed % 4, (0.05, friction), planted=seed % 8 == 3)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("part", range(3))
def test_all_selections_find_the_same(part, monkeypatch):
    # other numbers are sought at once, and small bodies are not spared them
    monkeypatch.setattr(closing, "_FEW", 0)
    certified = several = 0
    for seed in range(32 * part, 32 * part + some(16, of=32)):
        problem = problems(9, seed, 1.2)
        alpha = 1.0 if seed % 4 == 2 else 0
        roots = enumerate_roots(problem, alpha)
        exact = assert_as_exhaustive(problem, alpha, roots)
        assert check_records(problem, records_of(roots.proof)) == records_of(roots.proof)[-1]
        assert is_unique(problem, alpha) is (len(exact) == 1 and not exact.families)
        certified += roots.by_one_certificate
        several += len(exact) > 1
        assert not roots.by_one_certificate or (len(exact), exact.families) == (1, ())
    assert certified > some(2, of=6)
    assert several > some(0, of=1)


def test_long_trees_of_small_bodies_are_cut_short(monkeypatch):
    monkeypatch.setattr(closing, "_LONG", 10)
    problem = gallery.clamped_block(8, 4, traction=(1.0, -0.3))
    with by_the_tree():
        tree = enumerate_roots(problem, 5.0)
    assert tree.stats.nodes > 10
    roots = proven_roots(problem, 5.0)
    assert (roots.by_one_certificate, roots.stats.nodes) == (True, 11)
    assert not differences(roots, tree)
    with ThreadPoolExecutor(2) as executor:
        assert not differences(enumerate_roots(problem, 5.0, executor=executor), tree)


def test_numbers_that_prove_nothing_cost_their_time_only(monkeypatch):
    problem = gallery.wedge(4, 4)
    with by_the_tree():
        tree = enumerate_roots(problem, 1.0)
    monkeypatch.setattr(closing, "_LONG", 20)
    monkeypatch.setattr(closing.Reduction, "weights", lambda self, *_, **__: np.ones(5 * len(self.nodes)))
    roots = proven_roots(problem, 1.0)
    assert not roots.by_one_certificate
    assert not differences(roots, tree)


def test_without_a_solution_the_tree_finds_it(monkeypatch):
    monkeypatch.setattr(reduction, "_MOST_STEPS", 0)
    assert all_roots(gallery.clamped_block(8, 4), 0.3).stats.nodes > 1


@pytest.mark.slow
def test_a_path_in_friction_where_newton_fails():
    failed = 0
    for nx, traction in product((8, 16, 32, 64), ((0.3, -1.0), (1.0, -0.3))):
        sought = whole(gallery.clamped_block(nx, nx // 2, traction=traction), 5.0)
        failed += sought.solution((np.zeros(2 * nx), sought.h)) is None
        x, _ = sought.solution(None)
        assert sought._residual(x, sought.h - sought.R @ x, 1.0) <= 1e-9
    assert failed > 1


def nodes_of(rng, b, chosen):
    share = np.where(chosen, np.nan, rng.uniform(-1, 1, b))
    n, none = np.arange(b), np.zeros(b, dtype=bool)
    gap, slip = (np.where(chosen, rng.uniform(0.1, 2, b), 0.0) for _ in range(2))
    return Nodes(b, n, b + n, rng.uniform(0.1, 2, b), share, none, gap, slip * rng.choice([-1, 1], b))


@pytest.mark.parametrize("squares", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_slopes_of_the_descent(seed, squares):
    rng = np.random.default_rng(seed)
    S = fe_compliance(rng, 4)
    spare = rng.uniform(0.0, 0.5, (2, 4)) if squares else None
    sought = definite.Descent(S / np.mean(np.diag(S)), nodes_of(rng, 4, rng.random(4) < 0.5), spare)
    z, weight = 0.1 * rng.normal(size=12), 30.0
    assert sought._objective(z, weight)[0] < definite._BEYOND
    slopes = [sought._objective(z + h, weight)[0] - sought._objective(z - h, weight)[0] for h in 1e-5 * np.eye(12)]
    assert np.allclose(np.array(slopes) / 2e-5, sought._objective(z, weight)[1], atol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_what_descent_finds_is_definite(seed):
    """Checked with D written out: D d has mu d_n + nu d_t for lambda_n and kappa (d_t - theta d_n) for lambda_t."""
    rng = np.random.default_rng(seed)
    found = 0
    for _ in range(20):
        S = fe_compliance(rng, 4)
        nodes = nodes_of(rng, 4, rng.random(4) < 0.5)
        numbers = definite.Descent(S, nodes).numbers()
        if numbers is None:
            continue
        found += 1
        mu, kappa, nu, share, tau = numbers.reshape(5, 4)
        D = np.block([[np.diag(mu), np.diag(nu)], [-np.diag(kappa * share * nodes.F), np.diag(kappa)]])
        assert np.linalg.eigvalsh(D.T @ S + S @ D)[0] > 0
        assert not tau.any()
        assert np.all(np.abs(nu) * nodes.F <= mu)
        side = np.sign(nodes.slip)
        spare = (mu + side * nu * nodes.F) * nodes.gap - kappa * nodes.F * (1 - side * share) * np.abs(nodes.slip)
        assert np.all(spare[~np.isfinite(nodes.share)] > -1e-12)
    assert found > 5


@pytest.mark.slow
def test_changed_certificates_prove_nothing_false():
    rng = np.random.default_rng(0)
    problem = gallery.clamped_block(4, 2, traction=(1.0, -0.3))
    records = records_of(enumerate_roots(problem, 1.0).proof)
    record = records[1]
    assert record[0] == "m"
    for place in (3, 4, 5):
        for k, old in enumerate(record[place]):
            for new in (-1.0, 0.0, 1e-3 * old, 50.0 * old, -old)[k % 2 :: some(2, of=1)]:
                forged = put(records, (1, place, k), new)
                if verify(problem, proof_of(forged)).ok:
                    # other numbers may do as well; bounds must hold the root
                    centre, radius, numbers = (np.array(forged[1][i]) for i in (4, 5, 3))
                    assert np.all(np.abs(centre - record[4]) <= radius)
                    assert np.all(numbers[:8] > 0)
                    assert np.all(np.abs(numbers[8:12]) <= numbers[:4])
    # a problem with three roots takes no certificate, whatever the numbers
    problem = gallery.one_node_triangle()
    header, *_ = records_of(enumerate_roots(problem, 5.0).proof)
    for _ in range(some(60, of=200)):
        codes = [int(rng.choice([0, 1, 2, 3]))]
        numbers = [*np.exp(rng.normal(size=2)), *rng.uniform(-1, 1, size=2), float(rng.choice([0.0, 1.0]))]
        forged = [header, ["m", codes, [0], numbers, rng.normal(size=2).tolist(), [1e9, 1e9], 1]]
        forged.append({"roots": 1, "families": 0, "undecided": 0, "leaves": 1})
        assert not verify(problem, proof_of(forged)).ok


def test_uniqueness_is_an_answer():
    problem = gallery.two_node_square()
    assert is_unique(problem, 1) is True
    assert is_unique(problem, 3.5) is False
    assert is_unique(problem, 3.5, max_nodes=1) is None
    assert is_unique(problem, 1, arithmetic="fast") is None
    assert is_unique(gallery.get("one-node-6.3").build(), 2.0) is False  # a continuum
    bad_argument("alpha", is_unique, problem, "one")


def test_time_that_ends_while_numbers_are_sought(monkeypatch):
    def late(self):
        raise TimeOverError

    monkeypatch.setattr(definite.Descent, "numbers", late)
    roots = enumerate_roots(gallery.clamped_block(48, 8, traction=(1.0, -0.3)), 5.0, max_nodes=3)
    assert (roots.complete, roots.stats.nodes) == (False, 3)


@pytest.mark.parametrize("arithmetic", ["exact", "fast"])
def test_other_arithmetics(arithmetic):
    assert enumerate_roots(gallery.clamped_block(4, 2), 0.3, arithmetic).by_one_certificate


# -- a root that is alone below an assignment --------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    ("size", "traction", "alpha"),
    [((128, 16, 2), (1.0, -0.3), 2.0), pytest.param((256, 16, 4), (0.3, -1.0), 5.0, marks=pytest.mark.slow)],
)
def test_blocks_that_are_not_definite_take_one_node(size, traction, alpha, monkeypatch):
    monkeypatch.setattr(closing.Reduction, "weights", lambda *_, **__: None)
    problem = gallery.clamped_block(*size, traction=traction)
    roots = proven_roots(problem, alpha, max_nodes=1)
    assert roots.by_one_certificate
    assert kinds_of(roots.proof) == ["a"]
    if size[0] < 200:
        with by_the_tree():
            tree = enumerate_roots(problem, alpha)
        assert tree.stats.nodes > 1000
        assert not differences(roots, tree)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("part", range(3))
def test_all_selections_find_the_same_lone_roots(part):
    lone = several = 0
    for seed in range(40 * part, 40 * part + some(20, of=40)):
        problem = problems(24, seed, 3.0)
        with above_known_roots():
            roots = enumerate_roots(problem, 0)
        exact = assert_as_exhaustive(problem, 0, roots)
        found = kinds_of(roots.proof).count("a")
        if found or seed % 10 == 0:
            assert check_records(problem, records_of(roots.proof)) == records_of(roots.proof)[-1]
        lone += found
        several += found and len(exact) > 1
    assert lone > some(3, of=8)
    assert several > 0


@pytest.mark.long
def test_the_tree_without_them_finds_the_same():
    fewer = 0
    for seed in range(50):
        rng = np.random.default_rng([25, seed])
        p = int(rng.integers(4, 9))
        problem = random_problem(rng, p) if seed % 2 else touching_problem(rng, p)
        with by_the_tree():
            tree = enumerate_roots(problem, 0)
        with above_known_roots():
            roots = enumerate_roots(problem, 0)
        assert not differences(roots, tree)
        assert verify(problem, roots.proof).complete
        assert roots.stats.nodes <= tree.stats.nodes or roots.stats.closed
        fewer += roots.stats.nodes < tree.stats.nodes
    assert fewer > 10


@pytest.mark.slow
def test_workers_know_the_root(monkeypatch):
    monkeypatch.setattr(setup, "FIRST", 8)
    monkeypatch.setattr(setup, "NODES", 16)
    problem = gallery.get("wedge-8-5").build()
    with above_known_roots(), ThreadPoolExecutor(2) as executor:
        alone, together = enumerate_roots(problem, 2.2), enumerate_roots(problem, 2.2, executor=executor)
    assert all("a" in kinds_of(roots.proof) for roots in (alone, together))
    assert not differences(alone, together)
    assert verify(problem, together.proof).complete
    assert check_records(problem, records_of(together.proof)) == records_of(together.proof)[-1]


def test_what_lies_below():
    problem = gallery.wedge(4, 4)
    known = KnownRoot((0,) * problem.p, np.zeros(2 * problem.p), problem.condensed.at(1.0).scaled.g)
    for first, others, lies_below in ((6, 6, True), (5, 6, False), (7, 8, True)):
        assert known.below((first, *(others,) * (problem.p - 1))) == lies_below
