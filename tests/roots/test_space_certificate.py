"""One certificate before the tree in 3D: against the tree, closed forms and Newton's method (theory, section 12.6)."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import oracles3d
import pytest
from complete import all_roots, complete_report, limit_of, proven_roots
from effort import some
from generators import named
from problems3d import (
    bounds,
    exactly,
    forces,
    from_compliance,
    random_compliance,
    random_coupled,
    random_one_node,
    unmatched,
    within,
)
from space_proofs import RANDOM, random_problem
from trees import by_the_tree

from enumsol import ContactStatus, enumerate_roots, gallery, verify
from enumsol.model.statuses import UNDECIDED
from enumsol.search.space.space_fathoming import SpaceCloser
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.space_uniqueness import is_complete, lone_root, only_solution_in_space


def closed(problem, alpha=0):
    """The only root, by one leaf that the checker accepts."""
    roots = all_roots(problem, alpha, max_nodes=1)
    assert (roots.stats.closed, len(roots), roots[0].index) == (1, 1, 1)
    report = complete_report(problem, roots.proof)
    assert (report.roots, report.leaves) == (1, 1)
    return roots[0]


# -- blocks ------------------------------------------------------------------------------------------------------------


def closed_block(cells, p, F):
    problem = gallery.block3d(*cells, friction=F)
    root = closed(problem)
    assert (problem.p, root.regular) == (p, True)
    return problem, root


@pytest.mark.parametrize(("cells", "p"), [((3, 3, 2), 12), ((5, 5, 2), 30)])
@pytest.mark.parametrize("F", [0.1, 0.3, 0.5])
def test_blocks_take_one_leaf(cells, p, F):
    problem, root = closed_block(cells, p, F)
    # as narrow as a leaf's
    assert np.max(np.ptp(root.enclosure.lambda_n, axis=1)) < 1e-10 * np.max(root.lambda_n)
    limit = limit_of(problem, 0, tolerance=1e-12)
    assert np.max(np.abs(forces(limit) - forces(root))) < 1e-9 * np.max(root.lambda_n)


@pytest.mark.few(0, 2)
@pytest.mark.parametrize(("cells", "p"), [((6, 6, 2), 42), ((8, 8, 2), 72)])
@pytest.mark.parametrize("F", [0.1, 0.3, 0.5, 1])
def test_larger_blocks_take_one_leaf(cells, p, F):
    closed_block(cells, p, F)


def test_better_numbers_where_plain_ones_will_not_do():
    problem = gallery.block3d(5, 5, 2, friction=2)
    assert closed(problem).regular
    assert enumerate_roots(problem, 0, max_nodes=1, arithmetic="fast").stats.closed == 0


@pytest.mark.parametrize(("cells", "F"), [((3, 2, 2), 8), ((5, 5, 2), 3)])
def test_open_nodes_may_have_more_weight_along_the_normal(cells, F):
    """With mu = kappa there no form is found that is definite."""
    problem = gallery.block3d(*cells, friction=F)
    root = closed(problem)
    assert any(status is ContactStatus.OPEN for status in root.statuses)
    with by_the_tree():
        (other,) = all_roots(problem, 0)
    assert np.max(np.abs(forces(other) - forces(root))) < 1e-9 * np.max(root.lambda_n)


def test_fast_arithmetic_takes_the_same_where_it_is_clear():
    roots = enumerate_roots(gallery.block3d(3, 3, 2, friction=0.3), 0, arithmetic="fast")
    assert (roots.stats.nodes, roots.stats.closed, len(roots)) == (1, 1, 1)
    assert roots[0].enclosure is None
    # two slips, one a hundred thousandth of a millionth beyond stick
    near = from_compliance(np.eye(3), np.array([5, 4, 3 + 1e-11]), 1.0)
    assert enumerate_roots(near, 0, arithmetic="fast").stats.closed == 0
    assert closed(near).statuses[0].value == "slip"


# -- against the tree and oracles --------------------------------------------------------------------------------------


def strongly_varying(rng):
    """S, g, F (p, 2) with coefficients of all sizes, some of them zero."""
    p = int(rng.integers(1, 4))
    S, g = random_compliance(rng, p), rng.normal(size=3 * p)
    if rng.random() < 0.3:
        S, g, _ = random_coupled(rng, p)
    F = 10.0 ** rng.uniform(-2, 0.7, (p, 2))
    kind = rng.random()
    if kind < 0.3:
        F[:, 1] = F[:, 0]
    elif kind < 0.5:
        F[rng.integers(p), rng.integers(2)] = 0.0
    elif kind < 0.6:
        F[rng.integers(p)] = 0.0
    elif kind < 0.7:
        F[rng.integers(p), rng.integers(2)] *= 1e-7
    return S, g, F


def compared(seed):
    """Whether one certificate did; the tree and Newton's method agree."""
    rng = np.random.default_rng([2026, seed])
    S, g, F = strongly_varying(rng)
    problem = from_compliance(S, g, tuple(F.T))
    roots = enumerate_roots(problem, 0, max_nodes=3000)
    with by_the_tree():
        expected = enumerate_roots(problem, 0, max_nodes=3000)
    assert (roots.complete, roots.index_sum) == (expected.complete, expected.index_sum)
    for one, other in zip(roots, expected, strict=True):
        (low, high), (other_low, other_high) = bounds(one), bounds(other)
        assert np.all((low <= other_high) & (other_low <= high))
        assert (one.statuses, one.index, one.regular) == (other.statuses, other.index, other.regular)
    if not roots.stats.closed:
        return False
    assert roots.complete
    assert verify(problem, roots.proof).complete
    # below an assignment there may be one solution, and others elsewhere
    assert unmatched(list(roots), oracles3d.newton_set(S, g, F, 10, rng))[0] == []
    return roots.stats.nodes == 1


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("part", range(3))
def test_the_same_as_the_tree(part):
    did = [compared(seed) for seed in range(40 * part, 40 * part + some(15, of=40))]
    assert sum(did) > some(4, of=15)
    assert not all(did)


@pytest.mark.long
def test_one_node_against_the_closed_form():
    rng, count, several = np.random.default_rng(31), 0, 0
    for _ in range(150):
        S, g, F = random_one_node(rng)
        found, near = oracles3d.one_node(S, g, F)
        wanted = [lam for group in found.values() for lam in group]
        if near < 1e-9:
            continue
        roots = enumerate_roots(from_compliance(S, g, tuple(F.T)), 0, max_nodes=1)
        several += len(wanted) > 1
        if roots.stats.closed:
            count += 1
            assert len(wanted) == 1
            assert np.allclose(forces(roots[0]), wanted[0], rtol=1e-7, atol=1e-9)
    assert count > 50
    assert several > 5


@pytest.mark.parametrize("name", ["one-node-3d-3", "wedge3d-2-3", "wedge3d-4-3", "wedge3d-4-9", "wedge3d-8-5"])
def test_problems_with_several_roots_are_searched(name):
    stats = enumerate_roots(*named(name), max_nodes=2).stats
    assert (stats.closed, stats.nodes) == (0, 2)


# -- the theorem -------------------------------------------------------------------------------------------------------


def terms(y, w, other_y, other_w, numbers):
    """(mu d_n + nu . d_tau) (w_n - w*_n) + kappa (d_tau - theta d_n) . (v - v*) of a node, other minus the first."""
    mu, kappa, nu, theta = numbers
    d, dw = other_y - y, other_w - w
    return (mu * d[0] + nu @ d[1:]) * dw[0] + kappa * (d[1:] - theta * d[0]) @ dw[1:]


def theta_of(y, w, rng):
    """A theta that serves a solution at a node."""
    if y[0] > 1e-12:
        return y[1:] / y[0]
    size = np.linalg.norm(w[1:])
    if size > 1e-12:
        return w[1:] / size
    direction = rng.normal(size=2)
    return direction / max(np.linalg.norm(direction), 1.0)


def random_numbers(rng, theta):
    mu, kappa = 10 ** rng.uniform(-2, 2, 2)
    nu = rng.normal(size=2)
    return mu, kappa, rng.uniform(0, mu) * nu / np.linalg.norm(nu), theta


@pytest.mark.long
def test_the_sum_over_two_solutions_is_not_negative():
    rng, pairs = np.random.default_rng(17), 0
    for _ in range(500):
        S, g, F = random_one_node(rng) if rng.random() < 0.6 else random_coupled(rng, 2)
        if np.any(F == 0):
            continue
        p = len(F)
        solutions = oracles3d.newton_set(S, g, F, 12, rng)
        scale = np.column_stack([np.ones(p), F])
        states = [(lam.reshape(3, p).T / scale, (g - S @ lam).reshape(3, p).T * scale) for lam in solutions]
        for k, (y, w) in enumerate(states):
            for other_y, other_w in states[:k] + states[k + 1 :]:
                pairs += 1
                for i in range(p):
                    for _ in range(5):
                        numbers = random_numbers(rng, theta_of(y[i], w[i], rng))
                        size = np.abs(numbers[0]) + numbers[1]
                        size *= (1 + np.abs(y).max() + np.abs(other_y).max()) * (1 + np.abs(w).max())
                        assert terms(y[i], w[i], other_y[i], other_w[i], numbers) >= -1e-8 * size
    assert pairs > 100


@pytest.mark.slow
def test_any_theta_that_the_gap_allows_serves():
    """An open node, against all states that a node can have (theory, (6.8))."""
    rng, tight = np.random.default_rng(3), 0
    for _ in range(some(800, of=3000)):
        v, gap = rng.normal(size=2) * 10 ** rng.uniform(-2, 1), 10 ** rng.uniform(-2, 1)
        y, w = np.zeros(3), np.array([-gap, *v])
        theta = rng.normal(size=2)
        mu, kappa, nu, theta = random_numbers(rng, theta / max(1.0, np.linalg.norm(theta)))
        if (mu - np.linalg.norm(nu)) * gap < kappa * (np.linalg.norm(v) - theta @ v):
            continue
        tight += 1
        for _ in range(10):
            n, phi, slip = rng.exponential(), rng.uniform(0, 2 * np.pi), rng.exponential()
            d = np.array([np.cos(phi), np.sin(phi)])
            none, touching = np.zeros(3), np.array([0, *(slip * d)])
            others = ([n, *(n * d)], touching), ([n, *(n * rng.random() * d)], none), (none, touching - [n, 0, 0])
            for other_y, other_w in others:
                assert terms(y, w, np.array(other_y), other_w, (mu, kappa, nu, theta)) >= -1e-9
    assert tight > some(50, of=200)


def served(root, F):
    """A theta for every node that serves a root."""
    loaded = root.lambda_n[:, None] > 0
    tau = root.lambda_t / np.where(F > 0, F, 1.0) / np.where(loaded, root.lambda_n[:, None], 1.0)
    slip = F * root.u_t
    length = np.linalg.norm(slip, axis=1, keepdims=True)
    theta = np.where(loaded, np.where(F > 0, tau, 0.0), slip / np.where(length > 0, length, 1.0))
    length = np.linalg.norm(theta, axis=1, keepdims=True)
    return np.where(length > 1 - 1e-9, theta / np.maximum(length, 0.1), theta)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", [name for name, roots in RANDOM.items() if roots > 1], ids=str)
def test_no_numbers_close_a_problem_with_several_roots(name):
    """Whatever is proposed for any of its roots, the right theta among it."""
    rng, problem = np.random.default_rng(5), random_problem(*name)
    with by_the_tree():
        roots = enumerate_roots(problem, 0)
    assert len(roots) == RANDOM[name]
    solvers, F = SpaceSolvers(problem, 0.0, "verified"), problem.friction_at(0)
    system, places = solvers.system, solvers.system.tau >= 0
    leaves = leaf_codes(solvers)
    for root in roots:
        for _ in range(some(10, of=30)):
            mu, kappa = 10 ** rng.uniform(-2, 2, (2, system.p))
            nu = rng.uniform(-0.7, 0.7, (system.p, 2)) * mu[:, None] * rng.integers(0, 2)
            theta = served(root, F) * rng.choice([1.0, 1.0, 0.5, 0.0], (system.p, 1))
            numbers = np.concatenate([mu, kappa, np.zeros(system.p), nu[places], theta[places]])
            assert only_solution_in_space(solvers.enclosed, numbers, root.lambda_n / system.force) is None
            whole = (UNDECIDED,) * system.p
            assert all(lone_root(solvers.enclosed, whole, numbers, codes) is None for codes in leaves)


def leaf_codes(solvers):
    """Codes of the leaves that hold the roots."""
    certifier = solvers.certifier(None)
    with by_the_tree():
        solvers.search(certifier).run()
    return list(certifier.certified.verified)


# -- degenerate solutions ----------------------------------------------------------------------------------------------


#: lambda and w node by node with F = (1, 1), and the statuses that hold
DEGENERATE = {
    "grazing and sliding": ([[0, 0, 0], [2, 1, 0]], [[0, 0.375, -0.5], [0, 0, 0]], ("open slip", "stick")),
    "at rest without load": ([[0, 0, 0], [2, 1, 0.5]], [[0, 0, 0], [0, 0, 0]], ("open slip stick", "stick")),
    "just sticking": ([[5, 4, 3], [0, 0, 0]], [[0, 0, 0], [-1, 0.5, 0]], ("slip stick", "open")),
    "just sticking along an axis": ([[2, -2, 0]], [[0, 0, 0]], ("slip stick",)),
    "all without load": ([[0, 0, 0]] * 3, [[0, 1, 0], [0, 0, 1], [-1, 0, 0]], ("open slip", "open slip", "open")),
    "all of them": (
        [[0, 0, 0], [0, 0, 0], [5, 3, 4], [2, 2, 0]],
        [[0, 1, 1], [0, 0, 0], [0, 0, 0], [0, 3, 0]],
        ("open slip", "open slip stick", "slip stick", "slip"),
    ),
}


def names(root):
    return tuple(" ".join(sorted(status.value for status in held)) for held in root.active)


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_solutions_are_roots(name):
    lam, w, statuses = DEGENERATE[name]
    root = closed(exactly(lam, w))
    assert (names(root), root.regular, root.margin) == (statuses, False, 0)
    assert all(status in held for status, held in zip(root.statuses, root.active, strict=True))
    box = np.transpose(bounds(root))
    assert within(np.ravel(lam, order="F"), box)
    assert np.max(np.ptp(box, axis=1)) < 1e-9
    assert within(root.u_n, root.enclosure.u_n)
    assert within(root.u_t, root.enclosure.u_t)
    for i, (one, slip) in enumerate(zip(root.slip_angle, np.array(w)[:, 1:], strict=True)):
        assert np.isnan(one[0]) == ("slip" not in statuses[i])
        if np.any(slip) and "slip" in statuses[i]:
            turn = np.remainder(np.arctan2(slip[1], slip[0]) - one[0] + 1e-9, 2 * np.pi)
            assert turn <= one[1] - one[0] + 2e-9
            assert one[1] - one[0] < 1e-6
    assert "not regular" in repr(root)


def test_nodes_with_one_tau_and_without_friction_that_graze():
    g = np.array([0, 0, 2.0, 0.3, 0.7, 0.2, 0, 0.1, 0])
    root = closed(from_compliance(np.eye(9), g, (np.array([0.5, 0, 1]), np.array([0, 0, 1]))))
    assert names(root) == ("open slip", "open slip", "stick")
    assert np.max(np.abs(root.lambda_n[:2])) < 1e-12
    # one tau, at the end of its segment
    root = closed(from_compliance(np.eye(3), np.array([2.0, 1, 0.3]), (np.array([0.5]), np.array([0.0]))))
    assert names(root) == ("slip stick",)


def test_repeated_nodes():
    """Nodes that are alike have solutions that are alike."""
    p = 6
    S, g = np.kron(np.eye(3), 0.05 * np.ones((p, p)) + np.eye(p)), np.repeat([1.0, 2.0, -0.5], p)
    root = closed(from_compliance(S, g, 0.4))
    assert np.ptp(root.lambda_n) < 1e-12
    assert names(root) == ("slip",) * p


def test_a_continuum_is_left_to_the_tree():
    ray = np.array([[1.0, -1, 0], [-1, 2, 0], [0, 0, 1]])
    roots = enumerate_roots(from_compliance(ray, np.array([0.0, 1, 0]), 1.0), 0)
    assert (roots.stats.closed, roots.complete) == (0, False)


def test_coefficients_beyond_what_is_tried_are_left_to_the_tree():
    assert all_roots(from_compliance(np.eye(3), np.array([1.0, 1, 1]), 1e-60), 0).stats.closed == 0


# -- the interface -----------------------------------------------------------------------------------------------------


def test_what_is_tried_again():
    problem = gallery.block3d(2, 1, 2)
    solvers = SpaceSolvers(problem, 0.5, "verified")
    certifier = solvers.certifier(None)
    closer = SpaceCloser(solvers.system, certifier)
    assert not closer.begins_again(7)
    # the solution has no open nodes
    assert closer.again((0, *(UNDECIDED,) * (problem.p - 1)), None) is None
    assert closer.sliding == {}
    (one,), (other,) = closer.whole(), closer.again((UNDECIDED,) * problem.p, None)
    assert np.array_equal(one.y.mid, other.y.mid)


def test_codes_of_a_leaf_are_checked():
    system = SpaceSolvers(from_compliance(np.eye(6), np.ones(6), (np.array([0.5, 0]), np.array([0, 0]))), 0.0, "fast")
    all_codes = (1, 4), (2, 0), (5, 4), (1, 1), (1,), (20, 4)
    assert [is_complete(system.enclosed, codes) for codes in all_codes] == [True, True, *[False] * 4]


def test_a_proof_is_resumed_by_its_leaf(tmp_path):
    problem, path = gallery.block3d(3, 3, 2, friction=0.3), tmp_path / "one.proof"
    first = enumerate_roots(problem, 0, proof_path=path)
    again = proven_roots(problem, 0, proof_path=path, resume=True)
    assert (again.stats.closed, again.stats.resumed, again.stats.nodes) == (1, 1, 0)
    assert np.array_equal(first[0].lambda_n, again[0].lambda_n)


def test_executors_take_the_same_leaf():
    problem = gallery.block3d(3, 3, 2, friction=0.3)
    with ThreadPoolExecutor(1) as pool:
        roots = enumerate_roots(problem, 0, executor=pool)
    assert (roots.stats.closed, len(roots)) == (1, 1)
    assert enumerate_roots(problem, 0, stop_after=1).complete
