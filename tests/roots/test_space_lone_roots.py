"""A root in 3D that is proven to be the only one with the statuses of an assignment (theory, section 12.6)."""

import numpy as np
import pytest
from compare import assert_same_in_space
from complete import all_roots
from effort import some
from problems3d import from_compliance, random_coupled
from proof_tools import leaves_of, of_kind, proof_of, put, records_of
from space_proofs import RANDOM, random_problem
from trees import by_the_tree, closed_in_the_tree

from enumsol import enumerate_roots, verify
from enumsol.model.sectors import SECTORS
from enumsol.model.statuses import CONTACT, OPEN, STICK, UNDECIDED
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.space_uniqueness import equations, lone_root


def coupled(seed, p):
    S, g, F = random_coupled(np.random.default_rng(seed), p)
    return (S, g, F), from_compliance(S, g, tuple(F.T))


@pytest.mark.slow
def test_the_same_roots_as_by_the_tree_and_by_newton():
    used = several = 0
    for seed in range(some(8, of=24)):
        data, problem = coupled(seed, 2 + seed % 2)
        with by_the_tree():
            plain = enumerate_roots(problem, 0)
        with closed_in_the_tree():
            roots = enumerate_roots(problem, 0)
        assert_same_in_space(problem, roots, plain, data, seed)
        lone = of_kind(records_of(roots.proof), "a")
        used += bool(lone)
        several += bool(lone) and len(roots) > 1
    assert used > some(3, of=12)
    assert several >= some(0, of=1)


@pytest.fixture(scope="module")
def with_lone_root():
    """Problem, roots and records of a search that closes a subtree by a root."""
    _, problem = coupled(7, 2)
    with closed_in_the_tree():
        roots = enumerate_roots(problem, 0)
    records = records_of(roots.proof)
    assert of_kind(records, "a")
    return problem, roots, records


def test_proofs_that_say_something_else_are_refused(with_lone_root):
    problem, _, records = with_lone_root
    (place, *_), p = of_kind(records, "a"), problem.p
    assert verify(problem, proof_of(records)).complete
    assert dict(leaves_of(records))[place] != (UNDECIDED,) * p
    _, leaf, numbers, mid, _, index = records[place]
    theta = 3 * p + (len(numbers) - 3 * p) // 2
    for entry, value in (
        *((2, numbers[:theta] + [0.5 * x for x in numbers[theta:]]), (2, numbers[:-1])),
        *((1, [STICK if code == OPEN else OPEN for code in leaf]), (1, []), (1, leaf[:-1])),
        *((3, [x + 0.1 for x in mid]), (5, -index)),
    ):
        assert not verify(problem, proof_of(put(records, (place, entry), value))).ok, (entry, value)


def test_a_search_goes_on_from_a_lone_root(with_lone_root, tmp_path):
    problem, roots, _ = with_lone_root
    path = tmp_path / "lone.proof"
    with closed_in_the_tree():
        enumerate_roots(problem, 0, proof_path=path)
        again = all_roots(problem, 0, proof_path=path, resume=True)
    assert (len(again), again.stats.nodes) == (len(roots), 0)
    assert verify(problem, again.proof).complete


@pytest.mark.few(1, 1)
@pytest.mark.parametrize("name", [name for name, roots in RANDOM.items() if roots > 1], ids=str)
def test_no_numbers_close_an_assignment_with_two_roots(name):
    """Whatever is proposed for any of its roots, the right theta among it; and equations hold for their difference."""
    rng, problem = np.random.default_rng(5), random_problem(*name)
    solvers = SpaceSolvers(problem, 0.0, "verified")
    certifier, places, p = solvers.certifier(None), solvers.system.tau >= 0, problem.p
    with by_the_tree():
        solvers.search(certifier).run()
    found, tried = list(certifier.certified.verified.items()), 0
    for one, root in found:
        for other, second in found:
            if one == other:
                continue
            # the finest assignment that both have
            codes = [
                STICK if a == b == STICK else OPEN if a == b == OPEN else UNDECIDED if OPEN in (a, b) else CONTACT
                for a, b in zip(one, other, strict=True)
            ]
            rows = equations(solvers.enclosed, codes, 16.0)
            change = rows.mid @ (root.y.mid - second.y.mid)
            assert np.max(np.abs(change), initial=0.0) <= 1e-9 * max(np.max(np.abs(rows.mid), initial=0.0), 1.0)
            n, tau, v = root.y.mid[:p, None], *map(solvers.system.tangential, (root.y.mid, root.w.mid))
            length = np.linalg.norm(v, axis=1, keepdims=True)
            theta = np.where(n > 1e-12, tau / np.where(n > 1e-12, n, 1.0), v / np.where(length > 0, length, 1.0))
            theta = theta / np.maximum(np.linalg.norm(theta, axis=1, keepdims=True), 1.0)
            for _ in range(3):
                mu, kappa = 10 ** rng.uniform(-2, 2, (2, p))
                numbers = np.concatenate([mu, kappa, np.zeros(p), np.zeros(np.sum(places)), theta[places]])
                assert lone_root(solvers.enclosed, codes, numbers, one) is None
                tried += 1
    assert tried >= 6


def test_statuses_that_an_assignment_does_not_allow(with_lone_root):
    problem, _, records = with_lone_root
    (place, *_) = of_kind(records, "a")
    enclosed, leaf, numbers = SpaceSolvers(problem, 0.0, "verified").enclosed, *records[place][1:3]
    codes, numbers = dict(leaves_of(records))[place], np.array(numbers)
    assert lone_root(enclosed, codes, numbers, leaf) is not None
    for i in range(problem.p):
        for code in (OPEN, STICK, CONTACT, SECTORS + 5):
            allowed = code == leaf[i] or (code in (CONTACT, SECTORS + 5) and leaf[i] != OPEN)
            if not allowed:
                assert lone_root(enclosed, (*codes[:i], code, *codes[i + 1 :]), numbers, leaf) is None
