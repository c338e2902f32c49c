"""Forms of products in 3D, and ellipsoids where they are not positive: against Newton's method and definitions."""

import time
from pathlib import Path

import numpy as np
import oracles3d
import pytest
from complete import accepted_report, proven_roots
from problems3d import from_compliance, scaled, soft_or_coupled, unmatched
from proof_tools import records_of
from trees import products_at_once

from enumsol import enumerate_roots, verify
from enumsol.model.sectors import SECTORS, direction, end_number, nearest
from enumsol.model.statuses import CONTACT, OPEN, STICK, UNDECIDED
from enumsol.search.space import product_search
from enumsol.search.space.product_search import Branched, Enclosed, Missed, ProductSearch
from enumsol.search.space.space_setup import SpaceSolvers
from enumsol.support.deadlines import Deadline, within
from enumsol.trusted.space.boxed_solution import is_inside
from enumsol.trusted.space.product_forms import CONE, FREE, Ellipsoid, Frame, node_products, refines


def known(seed, p):
    """Solvers, and the solutions that Newton's method finds, in the units of their system."""
    S, g, F = soft_or_coupled(seed, p)
    solvers = SpaceSolvers(from_compliance(S, g, (F[:, 0], F[:, 1])), 0.0, "verified")
    found = oracles3d.newton_set(S, g, F, 30, np.random.default_rng(seed))
    return solvers, [scaled(solvers.system, lam) for lam in found if oracles3d.slack(S, g, F, lam) > 1e-6]


def codes_of(solvers, y, level):
    """The statuses of a solution, by the definitions, with the sectors of a level that hold its slips."""
    system = solvers.system
    w, codes = system.g - system.S @ y, []
    for i, t in enumerate(system.tau):
        if -w[i] > y[i]:
            codes.append(OPEN)
            continue
        v, tau = w[t] / system.unit[t], y[t] * system.unit[t]
        if np.linalg.norm(v) < y[i] - np.linalg.norm(tau):
            codes.append(STICK)
        else:
            number = nearest(*(tau / np.linalg.norm(tau)).tolist(), level)
            a = np.arctan2(tau[1], tau[0])
            beginnings = [number, number - 1 if number > 1 << level else (2 << level) - 1]
            codes.append(SECTORS + next(n for n in beginnings if holds(n, a)))
    return tuple(codes)


def holds(number, angle):
    a, b = (np.arctan2(y, x) for x, y in (direction(number), direction(end_number(number))))
    return (angle - a) % (2 * np.pi) <= (b - a) % (2 * np.pi)


def parts(solvers, y):
    """lambda_n, tau and v of every node."""
    system = solvers.system
    w, t = system.g - system.S @ y, system.tau
    return np.column_stack([y[: system.p], y[t] * system.unit[t], w[t] / system.unit[t]])


@pytest.mark.few(2, 4)
@pytest.mark.parametrize("seed", range(20))
def test_products_are_not_negative_at_solutions(seed):
    rng = np.random.default_rng(seed)
    solvers, solutions = known(seed, 1 + seed % 3)
    for y in solutions:
        for level in (2, 4, 9):
            codes = codes_of(solvers, y, level)
            for code, x in zip(codes, parts(solvers, y), strict=True):
                for over in {code, CONTACT} - {OPEN}:
                    found, kinds = node_products(over)
                    values = np.array([x @ matrix.mid @ x for matrix in found])
                    signs = np.array(kinds)
                    small = 1e-9 * (1 + x @ x)
                    assert np.all(values[(signs != FREE) & (signs != CONE)] >= -small)
                    assert np.all(np.abs(values[signs == FREE]) <= small)
                    if over == CONTACT:
                        c = rng.normal(size=2)
                        assert values[2] + (c / np.linalg.norm(c)) @ values[3:] >= -small


def sound(ellipsoid, solvers, y):
    """Whether a solution lies in an ellipsoid."""
    if ellipsoid.empty:
        return False
    away = np.linalg.norm(np.linalg.solve(ellipsoid.T, y - ellipsoid.frame.centre))
    return away <= ellipsoid.reach * (1 + 1e-6) + 1e-9


@pytest.mark.few(2, 6)
@pytest.mark.parametrize("seed", range(30))
def test_ellipsoids_hold_all_solutions_of_their_assignments(seed):
    """Forms that a program finds, and forms of random multipliers besides."""
    solvers, solutions = known(seed, 1 + seed % 3)
    search, rng, made = ProductSearch(solvers.enclosed), np.random.default_rng(seed), 0
    for y in solutions:
        for level in (0, 2, 4, 8):
            fine = codes_of(solvers, y, max(level, 2))
            codes = fine if level else tuple(CONTACT if code > SECTORS else code for code in fine)
            found = search.best(codes, 1.0)
            if found is None:
                continue
            one = found[0]
            assert sound(one, solvers, y)
            assert not one.misses(codes_of(solvers, y, 20))
            made += 1
            for _ in range(5):
                numbers = one.numbers * rng.uniform(0.5, 1.5, len(one.numbers))
                centre = one.frame.centre + 0.01 * rng.normal(size=len(y))
                other = Ellipsoid.of(solvers.enclosed, codes, centre, numbers)
                assert other is None or sound(other, solvers, y)
            # what it claims to miss has no solution
            for i, code in enumerate(codes):
                if code > SECTORS or code == CONTACT:
                    assert not one.node_misses(i, codes_of(solvers, y, 12)[i])
    assert made or not any(code > SECTORS for y in solutions for code in codes_of(solvers, y, 2))


def leaves_of(codes, tree):
    """Assignments of a tree's leaves, and the leaves."""
    stack, found = [codes], []
    for node in tree:
        codes = stack.pop()
        if isinstance(node, Branched):
            after = codes[node.node + 1 :]
            stack += [(*codes[: node.node], child, *after) for child in reversed(node.children)]
        else:
            found.append((codes, node))
    assert not stack
    return found


@pytest.mark.few(1, 4)
@pytest.mark.parametrize("seed", range(24))
def test_trees_below_assignments_hold_what_newton_finds(seed):
    solvers, solutions = known(seed, 1 + seed % 2)
    search = ProductSearch(solvers.enclosed)
    for y in solutions:
        codes = codes_of(solvers, y, 2)
        tree = search.closed(codes, 40)
        if tree is not None and any(code > SECTORS for code in codes):
            check_tree(codes, tree, solvers, solutions)


def check_tree(codes, tree, solvers, solutions):
    """What is missed and enclosed in a tree below an assignment, against all solutions of the problem."""
    leaves = leaves_of(codes, tree)
    for below, leaf in leaves:
        assert refines(below, leaf.ellipsoid.codes)
        assert isinstance(leaf, Missed) == leaf.ellipsoid.misses(below) or isinstance(leaf, Enclosed)
    boxes = [leaf.found for _, leaf in leaves if isinstance(leaf, Enclosed)]
    for other in solutions:
        inside = [one for one in boxes if np.all(np.abs(one.y.mid - other) <= one.y.rad + 1e-7)]
        assert inside or not refines(codes_of(solvers, other, 12), codes)
    for one in boxes:
        assert is_inside(one.y, one.w, one.box)
        assert any(np.all(np.abs(one.y.mid - other) <= one.y.rad + 1e-6) for other in solutions)


@pytest.mark.parametrize(("seed", "p"), [(29, 3), (38, 3), (40, 3), (5, 2)])
def test_sectors_are_split_where_an_ellipsoid_cuts_off_no_more(seed, p):
    solvers, solutions = known(seed, p)
    search, split = ProductSearch(solvers.enclosed), 0
    for y in solutions:
        for level in (0, 2):
            fine = codes_of(solvers, y, 2)
            codes = fine if level else tuple(CONTACT if code > SECTORS else code for code in fine)
            tree = search.closed(codes, 40)
            if tree is None or not any(code > SECTORS or code == CONTACT for code in codes):
                continue
            check_tree(codes, tree, solvers, solutions)
            # beside what is cut off, which is missed, there is one part; here each of both is examined further
            after = zip(tree, tree[1:], tree[2:], strict=False)
            split += sum(isinstance(one, Branched) and not isinstance(two, Missed) for one, two, _ in after)
    assert split


@pytest.mark.parametrize("seed", [7, 47])
def test_a_tree_that_takes_too_many_programs_is_given_up(seed):
    solvers, solutions = known(seed, 3)
    for most in (1, 5, 40):
        search = ProductSearch(solvers.enclosed)
        trees = [search.closed(tuple(min(code, CONTACT) for code in codes_of(solvers, y, 2)), most) for y in solutions]
        assert search.programs <= most * len(solutions)
        assert None in trees


@pytest.mark.few(1, 4)
@pytest.mark.parametrize("seed", range(40))
def test_searches_find_the_same_roots(seed):
    S, g, F = soft_or_coupled(seed, 1 + seed % 3)
    problem = from_compliance(S, g, (F[:, 0], F[:, 1]))
    with products_at_once():
        roots = enumerate_roots(problem, 0, max_nodes=3000)
    kinds = {record[0] for record in records_of(roots.proof)[1:-1]}
    report = accepted_report(problem, roots.proof)
    assert report.complete == roots.complete
    if roots.complete:
        assert report.roots == len(roots)
        assert roots.index_sum in (1, None)
        missed, _ = unmatched(list(roots), oracles3d.newton_set(S, g, F, 30, np.random.default_rng(seed)))
        assert not missed
    if seed in (0, 2, 4):
        assert {"q", "l"} <= kinds


def test_a_search_resumes_from_such_a_proof(tmp_path):
    S, g, F = soft_or_coupled(8, 2)
    problem, path = from_compliance(S, g, tuple(F.T)), tmp_path / "a.proof"
    with products_at_once():
        roots = enumerate_roots(problem, 0, proof_path=path)
        records = records_of(roots.proof)
        again = enumerate_roots(problem, 0, proof_path=path, resume=True)
    leaves = [
        record for record in records if type(record) is list and type(record[-1]) is int and record[0] in ("x", "l")
    ]
    assert {record[0] for record in leaves} == {"x", "l"}
    assert (again.complete, len(again)) == (True, len(roots))
    # all leaves of ellipsoids are taken over, none is searched
    assert again.stats.resumed >= len(leaves)
    assert verify(problem, again.proof).complete
    # without products, too
    late = proven_roots(problem, 0, proof_path=path, resume=True)
    assert len(late) == len(roots)


@pytest.mark.long
@pytest.mark.parametrize("friction", [0.5, 0.7])
def test_the_angle_plate_on_weak_springs_is_complete(friction, monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "studies")
    from search_in_3d.feet import SPRINGS, foot

    problem = foot("angle-14", SPRINGS[0], friction)
    roots = proven_roots(problem, 0, max_nodes=10_000)
    assert (len(roots), roots.index_sum) == (1, 1)


def test_what_is_no_assignment_of_statuses_is_refused():
    solvers, _ = known(0, 2)
    m = len(solvers.enclosed.g)
    with pytest.raises(ValueError, match="undecided"):
        Frame.of(solvers.enclosed, (UNDECIDED, OPEN), np.zeros(m))
    for numbers in (np.ones(3), np.array([-1.0, 0, 1, 0, 0]), np.array([1.0, 0, 1, 2, 0]), np.full(5, np.nan)):
        assert Ellipsoid.of(solvers.enclosed, (CONTACT, OPEN), np.zeros(m), numbers) is None
    assert Ellipsoid.of(solvers.enclosed, (CONTACT, OPEN), np.full(m, np.inf), np.ones(5)) is None
    assert not refines((OPEN, STICK), (CONTACT, STICK))
    assert not refines((SECTORS + 4, STICK), (SECTORS + 8, STICK))
    assert refines((SECTORS + 8, STICK), (SECTORS + 4, CONTACT))


def test_a_program_that_cannot_be_bounded_is_not_begun(monkeypatch):
    """Nothing interrupts its preparation, and it may take all the time that is left: its rank tells how long."""
    solvers, solutions = known(29, 3)
    codes, begun = codes_of(solvers, solutions[0], 2), []

    def program(matrices, kinds, size):
        begun.append(matrices.shape[1] - 1)
        return solved(matrices, kinds, size)

    solved = product_search._solved
    monkeypatch.setattr(product_search, "_solved", program)

    def best(left=None):
        begun.clear()
        with within(Deadline.after(time.perf_counter(), left)):
            return ProductSearch(solvers.enclosed).best(codes, 1.0)

    assert best() is not None
    (rank,) = set(begun)
    assert best(1e6) is not None
    monkeypatch.setattr(product_search, "_SECONDS", 1e7)
    assert (best(1e6), begun) == (None, [])
    assert best() is not None
    monkeypatch.setattr(product_search, "_HIGHEST", rank)
    assert best() is not None
    monkeypatch.setattr(product_search, "_HIGHEST", rank - 1)
    assert (best(), begun) == (None, [])
