"""Closed subtrees: how many nodes they leave, and the same roots as without (theory, section 6.11)."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from complete import all_roots, proven_roots
from generators import integer_problem, random_problem
from proof_tools import records_of
from rational_checker import check_records
from touching import beside_a_loaded_node, row_of_discs, touching_problem
from trees import every_subtree

from enumsol import enumerate_roots, verify
from enumsol.model.statuses import BACKWARD, FORWARD
from enumsol.search import fathoming as closing, solvers


@pytest.mark.parametrize("slides", [False, True])
@pytest.mark.parametrize("grazing", [False, True])
def test_grazing_nodes_cost_a_number_of_nodes_linear_in_theirs(slides, grazing):
    for k in (4, 8, 16, 32):
        problem = beside_a_loaded_node(k, slides=slides, grazing=grazing)
        roots = proven_roots(problem, 0, max_nodes=6 * k + 20)
        assert len(roots) == roots.index_sum == 1
        assert all(len(held) == (2 if grazing else 4) for held in roots[0].active[1:])


@pytest.mark.parametrize("arithmetic", ["verified", "fast"])
@pytest.mark.parametrize("slides", [False, True])
def test_much_friction(slides, arithmetic):
    # too much for the test of definiteness where all nodes are free
    for k in (4, 8, 16, 32):
        problem = beside_a_loaded_node(k, slides=slides, grazing=True, friction=0.875)
        roots = enumerate_roots(problem, 0, arithmetic, max_nodes=7 * k + 20)
        assert not roots.undecided
        assert len(roots) == 1
        assert all(len(held) == 2 for held in roots[0].active[1:])
        if arithmetic == "verified":
            assert roots.complete
            assert verify(problem, roots.proof).complete


def test_sides_without_rationals(monkeypatch):
    monkeypatch.setattr(solvers, "EXACT_DOF_LIMIT", 0)
    problem = row_of_discs(8, weights=(2.0, 3.0), friction=0.9)
    roots = proven_roots(problem, 0, max_nodes=200)
    assert any(record[0] == "m" and max(record[1]) > 6 for record in records_of(roots.proof)[1:-1])
    assert len(roots) == roots.index_sum == 1


def only_root(problem, most):
    """The one root, with a proof, of a search of at most so many nodes."""
    roots = proven_roots(problem, 0, max_nodes=most)
    assert roots.index_sum == len(roots) == 1
    return roots[0]


@pytest.mark.parametrize("weights", [(2.0, 3.0), (1.0, 2.0, 4.0)])
def test_a_row_of_unequal_discs(weights):
    only_root(row_of_discs(12, weights=weights, friction=0.9, stiffness=4.0), 60)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(2))
def test_a_row_of_stiff_discs_of_any_weights(seed):
    only_root(row_of_discs(20, weights=np.random.default_rng(seed).uniform(1.5, 3.0, 20), friction=0.9), 600)


@pytest.mark.slow
def test_the_index_where_very_many_selections_hold():
    # some neighbours have equal weights: those touch at rest
    only_root(row_of_discs(20, weights=np.random.default_rng(1).integers(12, 25, 20) / 8, friction=0.9), 600)


@pytest.mark.slow
def test_sixty_four_unloaded_nodes():
    problem = beside_a_loaded_node(64, slides=False, grazing=False)
    for arithmetic in ("verified", "exact"):
        roots = all_roots(problem, 0, arithmetic, max_nodes=20)
        assert len(roots) == 1
        assert all(len(held) == 4 for held in roots[0].active[1:])


def test_a_row_of_discs():
    # 18 pairs of discs touch without load
    assert sum(len(held) == 4 for held in only_root(row_of_discs(20), 40).active) == 18


def actives(roots):
    return [root.active for root in roots]


def alike(problem, exact, roots):
    """Whether roots are those found in rationals, within their enclosures, with all statuses that hold."""
    assert (roots.complete, verify(problem, roots.proof).complete) == (True, True)
    assert [len(roots), len(roots.families)] == [len(exact), len(exact.families)]

    def ordered(found):
        return sorted(found, key=lambda root: (root.lambda_n.round(9).tolist(), root.lambda_t.round(9).tolist()))

    for one, other in zip(ordered(exact), ordered(roots), strict=True):
        assert one.index == other.index
        assert all(held <= may for held, may in zip(one.active, other.active, strict=True))
        for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
            (low, high), wide = getattr(other.enclosure, name).T, 1e-14
            assert np.all((low <= getattr(other, name)) & (getattr(other, name) <= high))
            assert np.all((low - wide <= getattr(one, name)) & (getattr(one, name) <= high + wide))
            assert np.max(high - low) < 1e-9


@pytest.fixture
def any_side(monkeypatch):
    """Nodes are told from sticking and slipping in one direction, whether they slide or not."""
    before, rng = closing.Closer.__init__, np.random.default_rng(2)

    def made(self, system, certifier):
        before(self, system, certifier)
        certifier.sliding.update({i: int(rng.choice([FORWARD, BACKWARD])) for i in range(8) if rng.random() < 0.7})

    monkeypatch.setattr(closing.Closer, "__init__", made)


@pytest.mark.few(6, 4)
@pytest.mark.parametrize("seed", range(30))
def test_splits_by_sides_find_the_same(any_side, tree_only, seed):
    rng = np.random.default_rng(seed)
    make = touching_problem if seed % 3 else integer_problem
    problem = make(rng, int(rng.integers(1, 5)))
    exact = enumerate_roots(problem, 0, "exact", "exhaustive")
    roots = enumerate_roots(problem, 0)
    alike(problem, exact, roots)
    assert check_records(problem, records_of(roots.proof)) == records_of(roots.proof)[-1]
    for arithmetic in ("fast", "exact"):
        assert actives(enumerate_roots(problem, 0, arithmetic)) == actives(exact)


@pytest.mark.few(10, 4)
@pytest.mark.parametrize("seed", range(40))
@every_subtree()
def test_the_roots_are_those_of_all_selections(seed):
    rng = np.random.default_rng(seed)
    problem = touching_problem(rng, int(rng.integers(1, 5)))
    exact = enumerate_roots(problem, 0, "exact", "exhaustive")
    roots = enumerate_roots(problem, 0)
    alike(problem, exact, roots)
    assert actives(roots) == actives(enumerate_roots(problem, 0, "exact")) == actives(exact)


@pytest.mark.long
@every_subtree()
def test_the_roots_without_rationals(monkeypatch):
    complete = degenerate = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        problem = touching_problem(rng, int(rng.integers(1, 5)))
        with monkeypatch.context() as patch:
            patch.setattr(solvers, "EXACT_DOF_LIMIT", 0)
            roots = enumerate_roots(problem, 0)
        if roots.complete and roots.certified_data == "problem":
            complete += 1
            degenerate += any(not root.regular for root in roots)
            alike(problem, enumerate_roots(problem, 0, "exact", "exhaustive"), roots)
        else:
            assert verify(problem, roots.proof).ok
    assert complete > 40
    assert degenerate > 20


def test_a_body_too_large_for_rationals():
    problem, small = (touching_problem(np.random.default_rng(3), 3, inner=inner) for inner in (300, 0))
    assert problem.n > 250
    roots = enumerate_roots(problem, 0)
    assert any(not root.regular for root in roots)
    alike(problem, enumerate_roots(small, 0, "exact", "exhaustive"), roots)


def test_searches_without_degenerate_roots_try_nothing(monkeypatch):
    # a try would fail
    monkeypatch.setattr("enumsol.search.certifiers.verified.VerifiedCertifier.closed", None)
    rng = np.random.default_rng(1)
    for p in (2, 4, 6):
        assert enumerate_roots(random_problem(rng, p), 0).complete


@pytest.mark.parametrize("slides", [False, True])
def test_nearly_grazing_nodes(slides):
    # data off by rounding: a regular root whose margin is far below what balls see
    problem, rng = beside_a_loaded_node(4, slides=slides, grazing=True), np.random.default_rng(4)
    A = problem.A.toarray() * (1 + 1e-16 * rng.normal(size=(problem.n, problem.n)))
    f = problem.f + 1e-17 * rng.normal(size=problem.n)
    roots = proven_roots(problem.replace(A=(A + A.T) / 6, f=f / 3), 0, max_nodes=60)
    assert roots.index_sum == len(roots) == 1
    assert roots.stats.closed
    assert roots[0].regular
    assert roots[0].margin < 1e-15


def test_executors_find_the_same():
    problem = beside_a_loaded_node(6, slides=True, grazing=False)
    alone = enumerate_roots(problem, 0)
    with ProcessPoolExecutor(2) as executor:
        together = all_roots(problem, 0, executor=executor)
    assert actives(together) == actives(alone)
    assert verify(problem, together.proof).complete


def test_fast_arithmetic():
    for slides in (False, True):
        problem = beside_a_loaded_node(32, slides=slides, grazing=True)
        roots = enumerate_roots(problem, 0, "fast", max_nodes=200)
        assert roots.whole
        assert roots.index_sum == len(roots) == 1


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("workers", [1, 2])
def test_sides_are_told_to_workers(workers, monkeypatch):
    problem = row_of_discs(12, weights=(2.0, 3.0), friction=0.9)
    alone = enumerate_roots(problem, 0)
    monkeypatch.setattr("enumsol.search.setup.FIRST", 8)
    monkeypatch.setattr("enumsol.search.setup.NODES", 16)
    with ThreadPoolExecutor(workers) as executor:
        together = all_roots(problem, 0, executor=executor, max_nodes=600)
    assert actives(together) == actives(alone)
    assert any(record[0] == "b" and max(record[2]) > 6 for record in records_of(together.proof)[1:-1])
    assert verify(problem, together.proof).complete


@pytest.mark.parametrize("nodes", [30, 50, 70])
def test_a_proof_with_sides_is_resumed(nodes, tmp_path):
    problem = row_of_discs(12, weights=(2.0, 3.0), friction=0.9)
    path = tmp_path / "a.proof"
    assert not enumerate_roots(problem, 0, max_nodes=nodes, proof_path=path).complete
    assert len(proven_roots(problem, 0, max_nodes=3000, proof_path=path, resume=True)) == 1
