"""Solvers of relaxations against each other, and the bounds that their multipliers prove."""

import numpy as np
import pytest
from effort import some
from generators import dense_compliance, fe_compliance, friction, planted_load, random_load
from oracles import brute_force

from enumsol import gallery
from enumsol.condensation.condensed import CondensedSystem
from enumsol.model.statuses import CONTACT, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import (
    EQUALITY,
    FEASIBILITY_TOLERANCE,
    INEQUALITY,
    PRUNE_MARGIN,
    imposed_rows,
    row_normals,
    status_rows,
)
from enumsol.relaxation.interior_point import InteriorPointEngine, SoftenedEngine


def random_system(rng, p):
    S = dense_compliance(rng, p) if rng.random() < 0.5 else fe_compliance(rng, p)
    F = friction(rng, p)
    g = planted_load(rng, S, F) if rng.random() < 0.5 else None
    F[rng.random(p) < 0.15] = 0.0
    return CondensedSystem(S, random_load(rng, p) if g is None else g, F).scaled


def rows_of(codes, F, nodes=None):
    p = len(codes)
    nodes = range(p) if nodes is None else nodes
    pairs = [(k * p + i, mode) for i in nodes for k, mode in status_rows(codes[i], friction=F[i] > 0)]
    return [r for r, _ in pairs], [m for _, m in pairs]


def dense_rows(system):
    """Rows n'lambda - b >= 0 written out from their meaning (theory, section 5.2), in the order of RowKind."""
    p, S, g, F = system.p, system.S, system.g, system.F
    (n, t), wn, wt = np.split(np.eye(2 * p), 2), -S[:p], -S[p:]
    cone = F[:, None] * n
    normals = np.vstack([n, t, cone - t, cone + t, -wn, wt, -wt])
    return normals, np.concatenate([np.zeros(4 * p), g[:p], -g[p:], g[p:]])


def reference(system, codes):
    """Optimal value by clarabel through cvxpy, inf when infeasible."""
    import cvxpy as cp  # takes a second, of every process that only collects tests

    normals, offsets = dense_rows(system)
    x = cp.Variable(2 * system.p)
    constraints = []
    for row, mode in zip(*rows_of(codes, system.F), strict=True):
        value = normals[row] @ x - offsets[row]
        constraints.append(value >= 0 if mode == INEQUALITY else value == 0)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(system.cholesky.T @ x) - system.g @ x), constraints)
    problem.solve(solver="CLARABEL")
    return float(problem.value)


def proven(system, codes, relaxation):
    """Lower bound that the multipliers prove, by theory, (6.1), after checking that they may be used."""
    normals, offsets = dense_rows(system)
    rows, values = relaxation.multipliers()
    p = system.p
    for row, value in zip(rows, values, strict=True):
        mode = imposed_rows(codes[row % p], friction=system.F[row % p] > 0).get(row // p)
        assert mode is not None, "a multiplier of a row that the assignment does not impose"
        assert mode == EQUALITY or value >= 0, "a negative multiplier of an inequality"
    # min e >= -1/4 v' S^-1 v + z'b with v = g + N'z for rows N lambda >= b
    v = system.g + normals[rows].T @ values
    return float(values @ offsets[rows] - 0.25 * v @ np.linalg.solve(system.S, v))


def descend(rng, system, engine):
    """Relaxations along a random path down the tree, each with its codes; ends where nothing is left to decide."""
    F, p = system.F, system.p
    codes = [UNDECIDED] * p
    node = engine.root(*rows_of(codes, F))
    while True:
        yield tuple(codes), node
        undecided = [i for i in range(p) if codes[i] >= CONTACT]
        if node.pruned or node.stalled or not undecided:
            return
        i = int(rng.choice(undecided))
        if codes[i] == UNDECIDED:
            codes[i] = int(rng.choice([OPEN, CONTACT if F[i] > 0 else FRICTIONLESS]))
        else:
            codes[i] = int(rng.choice([STICK, SLIP_PLUS, SLIP_MINUS]))
        node = node.child(*rows_of(codes, F, [i]), last=bool(rng.random() < 0.5))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(4))
def test_values_agree_with_an_interior_point_solver(seed):
    rng = np.random.default_rng(seed)
    seen = [0, 0]
    for _ in range(some(6, of=12)):
        system = random_system(rng, int(rng.integers(1, 6)))
        for codes, node in descend(rng, system, ActiveSetEngine(system)):
            value = reference(system, codes)
            assert not node.stalled
            assert value > -1e-7 if node.pruned else node.bound == pytest.approx(value, abs=1e-6)
            seen[bool(node.pruned)] += 1
    assert min(seen) > some(3, of=7)


@pytest.mark.few(2, 2)
@pytest.mark.parametrize("engine", [ActiveSetEngine, InteriorPointEngine])
@pytest.mark.parametrize("seed", range(4))
def test_multipliers_prove_the_bound(engine, seed):
    rng = np.random.default_rng(seed + 10)
    pruned = 0
    for _ in range(some(20, of=40)):
        system = random_system(rng, int(rng.integers(1, 9)))
        for codes, node in descend(rng, system, engine(system)):
            assert not node.stalled
            bound = proven(system, codes, node)
            assert bound == pytest.approx(node.bound, rel=1e-6, abs=1e-8)
            if node.pruned:
                assert bound > 0.5 * PRUNE_MARGIN
                pruned += 1
    assert pruned > some(10, of=20)


@pytest.mark.parametrize("seed", range(4))
def test_softened_rows_prove_a_bound_that_is_less_by_what_large_multipliers_lose(seed):
    rng, loss = np.random.default_rng(seed + 60), 1e-6
    pruned = 0
    for _ in range(20):
        system = random_system(rng, int(rng.integers(1, 9)))
        for codes, _ in descend(rng, system, ActiveSetEngine(system)):
            # a child has its parent's rows besides
            node, softened = (
                engine.root(*rows_of(codes, system.F))
                for engine in (ActiveSetEngine(system), SoftenedEngine(system, loss))
            )
            (_, values), (_, others) = softened.multipliers(), node.multipliers()
            bound = proven(system, codes, softened) - loss * values @ values
            assert bound == pytest.approx(softened.bound, rel=1e-6, abs=1e-8)
            # no other multipliers prove more after their loss
            other = proven(system, codes, node) - loss * others @ others
            assert bound > other - 1e-6 * abs(other) - 1e-8
            pruned += softened.pruned
            _, smaller = SoftenedEngine(system, 100 * loss).root(*rows_of(codes, system.F)).multipliers()
            assert np.linalg.norm(smaller) < np.linalg.norm(values) + 1e-9
            # the minimiser without rows but with their multipliers
            normals, _ = dense_rows(system)
            rows, values = softened.multipliers()
            at_least = np.linalg.solve(system.S, system.g + normals[rows].T @ values) / 2
            np.testing.assert_allclose(softened.forces, at_least, atol=1e-7 * (1 + np.abs(at_least).max()))
    assert pruned > 5


@pytest.mark.parametrize("seed", range(4))
def test_minimiser_is_feasible_and_attains_the_bound(seed):
    rng = np.random.default_rng(seed + 20)
    for _ in range(40):
        system = random_system(rng, int(rng.integers(1, 9)))
        normals, offsets = dense_rows(system)
        unit = np.sqrt(np.einsum("ij,ij->i", normals, np.linalg.solve(system.S, normals.T).T)) + 1e-300
        for codes, node in descend(rng, system, ActiveSetEngine(system)):
            if node.pruned:
                continue
            x = node.forces
            np.testing.assert_allclose(node.displacements, system.g - system.S @ x, atol=1e-12)
            rows, modes = rows_of(codes, system.F)
            value = (normals[rows] @ x - offsets[rows]) / unit[rows]
            value = np.where(np.array(modes) == EQUALITY, -np.abs(value), value)
            # rounding of this check itself comes on top
            assert np.min(value) > -10 * FEASIBILITY_TOLERANCE
            assert x @ system.S @ x - system.g @ x == pytest.approx(node.bound, abs=1e-8)


def numbers_of(node):
    return [node.bound, *(v.tolist() for v in (node.forces, node.displacements, *node.multipliers()))]


def test_bounds_grow_along_a_path_and_a_copy_leaves_its_parent_alone():
    rng = np.random.default_rng(30)
    system = random_system(rng, 6)
    engine = ActiveSetEngine(system)
    for _ in range(30):
        codes = [UNDECIDED] * 6
        node = engine.root(*rows_of(codes, system.F))
        for i in rng.permutation(6):
            codes[i] = OPEN if rng.random() < 0.5 else (CONTACT if system.F[i] > 0 else FRICTIONLESS)
            before = numbers_of(node)
            child = node.child(*rows_of(codes, system.F, [i]), last=False)
            assert numbers_of(node) == before
            assert child.bound >= node.bound - 1e-9
            if child.pruned:
                break
            node = child


def test_every_program_of_a_path_has_its_own_limit():
    rng = np.random.default_rng(31)
    S, F = dense_compliance(rng, 6), np.full(6, 0.5)
    # sticks everywhere, and no contact node is so without its equations
    system = CondensedSystem(S, S @ np.concatenate([np.ones(6), 0.4 * (-1.0) ** np.arange(6)]), F).scaled
    engine = ActiveSetEngine(system)

    def path():
        codes = [UNDECIDED] * 6
        node = engine.root(*rows_of(codes, F))
        counts = [node._state.iterations]
        for i in range(6):
            codes[i] = STICK
            node = node.child(*rows_of(codes, F, [i]), last=True)
            assert not node.stalled
            assert not node.pruned
            counts.append(node._state.iterations)
        return counts

    counts = path()
    engine.limit = int(np.max(np.diff([0, *counts])))
    assert engine.limit < counts[-1]
    assert path() == counts


@pytest.mark.slow
def test_infeasible_assignment_comes_with_a_proof():
    # pressed together by a gap of -1 at a node without load: open is impossible
    S, F = np.eye(2), np.array([1.0])
    system = CondensedSystem(S, np.array([1.0, 0.0]), F).scaled
    for engine in (ActiveSetEngine(system), InteriorPointEngine(system)):
        node = engine.root(*rows_of((OPEN,), F))
        assert node.pruned
        assert reference(system, (OPEN,)) == np.inf
        assert proven(system, (OPEN,), node) > PRUNE_MARGIN


def test_no_partial_assignment_above_a_root_is_pruned():
    rng = np.random.default_rng(40)
    several = 0
    for _ in range(60):
        p = int(rng.integers(1, 5))
        S, F = dense_compliance(rng, p), friction(rng, p)
        g = planted_load(rng, S, F)
        system = CondensedSystem(S, random_load(rng, p) if g is None else g, F).scaled
        found, _, _ = brute_force(system.S, system.g, system.F)
        several += len(found) > 1
        engine = ActiveSetEngine(system)
        for root in found:
            codes = [UNDECIDED] * p
            node = engine.root(*rows_of(codes, F))
            for i in rng.permutation(p):
                for code in (CONTACT, root.codes[i]) if root.codes[i] != OPEN else (OPEN,):
                    codes[i] = code
                    node = node.child(*rows_of(codes, F, [i]), last=True)
                    assert not node.pruned
                    assert not node.stalled
                    assert node.bound < 1e-10
            np.testing.assert_allclose(node.forces, root.forces, rtol=1e-6, atol=1e-9)
    assert several > 10


@pytest.mark.parametrize("seed", range(4))
def test_one_dual_step_bounds_the_child(seed):
    rng = np.random.default_rng(seed + 50)
    compared = raised = 0
    for _ in range(30):
        p = int(rng.integers(1, 9))
        system = random_system(rng, p)
        for codes, node in descend(rng, system, ActiveSetEngine(system)):
            if node.pruned:
                continue
            for i in range(p):
                if codes[i] not in (UNDECIDED, CONTACT):
                    continue
                for code in (OPEN, STICK, SLIP_PLUS, SLIP_MINUS) if system.F[i] > 0 else (OPEN, FRICTIONLESS):
                    if codes[i] == CONTACT and code == OPEN:
                        continue
                    rows, modes = rows_of((*codes[:i], code, *codes[i + 1 :]), system.F, [i])
                    gain = max(node._state.gain(row, mode) for row, mode in zip(rows, modes, strict=True))
                    child = node.child(rows, modes, last=False)
                    compared += 1
                    raised += gain > 1e-6
                    # a search that prunes stops as soon as its bound suffices
                    assert child.pruned or child.bound >= node.bound + gain - 1e-8
                    assert child.pruned or gain < np.inf
    assert compared > 100
    assert raised > 30


def test_branching_takes_an_undecided_node_and_prefers_one_that_is_forced():
    # three blocks apart from each other: node 1 is pressed down hard, nodes 0 and 2 are balanced
    S, F = np.eye(6), np.array([0.5, 0.5, 0.5])
    system = CondensedSystem(S, np.array([0.2, 5.0, 0.2, 0.6, 0.0, 0.6]), F).scaled
    codes = (UNDECIDED,) * 3
    node = ActiveSetEngine(system).root(*rows_of(codes, F))
    assert not node.pruned
    assert node.child(*rows_of((UNDECIDED, OPEN, UNDECIDED), F, [1]), last=False).pruned
    assert node.choose(codes) == 1
    for decided in range(3):
        codes = tuple(UNDECIDED if i == decided else STICK for i in range(3))
        assert ActiveSetEngine(system).root(*rows_of(codes, F)).choose(codes) == decided
    assert node.choose((STICK, OPEN, SLIP_PLUS)) == -1


def whole_gain(node, system, kind, i):
    """By how much one dual step on an equation raises the bound if no other multiplier vanishes before."""
    p, force, w = system.p, node.forces, node.displacements
    bound = system.F[i] * force[i]
    value = (force[i], force[p + i], bound - force[p + i], bound + force[p + i], -w[i], w[p + i])[kind]
    active, _ = node.multipliers()
    *N, n = row_normals(p, system.F, system.S, np.array([*active, kind * p + i]))
    images = np.linalg.solve(2 * system.S, np.array([*N, n]).T)
    products = np.array([*N, n]) @ images
    rest = products[-1, -1] - products[-1, :-1] @ np.linalg.solve(products[:-1, :-1], products[:-1, -1])
    return 0.5 * value**2 / max(rest, 1e-20 * products[-1, -1])


def worth(node, system, i, code, *, slow):
    """What branching on a contact node with friction is worth, from the gains of its children (theory, section 5.5).

    It is inf where all children but one are excluded.
    """
    p, gap = system.p, PRUNE_MARGIN - node.bound
    force, w = node.forces, node.displacements
    violation = system.F[i] * force[i] * abs(w[p + i]) - force[p + i] * w[p + i]

    def share(*rows):
        return max(share_of(kind) for kind in rows)

    def share_of(kind):
        gain = node._state.gain(kind * p + i, EQUALITY)
        known = min(1.0, gain / gap)
        if slow or gain == 0.0:
            return known
        return known + 0.1 * (min(1.0, whole_gain(node, system, kind, i) / gap) - known)

    if code == UNDECIDED:
        violation = 2 * violation - force[i] * w[i]
        shares = [share(0, 1), share(4)]
    else:
        shares = [share(5), share(2), share(3)]
        against = 1 if w[p + i] < 0 else 2
        shares[against] = max(shares[against], shares[0])
    if sum(x >= 1.0 for x in shares) >= len(shares) - 1:
        return np.inf
    product, violation = np.prod([x + 1e-3 for x in shares]), max(violation, 1e-12)
    if slow:
        return (product / 4 if len(shares) == 2 else np.cbrt(product) ** 2) * np.sqrt(violation)
    return (product if len(shares) == 2 else product / 20) * violation


def branched(seed, *, slow):
    """Relaxations down some trees of nodes with friction, of which several can be branched on, with the one chosen."""
    rng = np.random.default_rng(seed)
    for _ in range(30):
        system = random_system(rng, int(rng.integers(2, 9)))
        if not np.all(system.F > 0):
            continue
        for codes, node in descend(rng, system, ActiveSetEngine(system, slow=slow)):
            undecided = [i for i, code in enumerate(codes) if code in (UNDECIDED, CONTACT)]
            if not node.pruned and len(undecided) > 1:
                yield system, codes, node, undecided, node.choose(codes)


@pytest.mark.parametrize("slow", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_trees_are_branched_on_by_products_and_slow_ones_by_geometric_means(seed, slow):
    compared, kinds = 0, set()
    for system, codes, node, undecided, taken in branched(seed + 90, slow=slow):
        found = [worth(node, system, i, codes[i], slow=slow) for i in undecided]
        # a node that is all but decided may be passed over, since its violation is small
        best = max((value for value in found if value < np.inf), default=0.0)
        assert found[undecided.index(taken)] >= best * (1 - 1e-6)
        compared += 1
        kinds.add((codes[taken], UNDECIDED in codes, CONTACT in codes))
    assert compared > 20
    assert {(UNDECIDED, True, True), *([(CONTACT, True, True)] if slow else [])} <= kinds


def test_a_tree_is_slow_where_one_step_closes_little():
    for problem, alpha, slow in (
        (gallery.clip(6, 1), 3.0, True),
        (gallery.wedge(4, 7), 1.0, False),
        (gallery.clamped_block(8, 4), 3.0, False),
    ):
        system = problem.condensed.at(alpha).scaled
        assert ActiveSetEngine(system).rule.slow == slow
        assert ActiveSetEngine(system, slow=not slow).rule.slow != slow


def test_memory_of_dropped_states_is_used_again():
    rng = np.random.default_rng(60)
    system = random_system(rng, 7)
    root = ActiveSetEngine(system).root(*rows_of((UNDECIDED,) * 7, system.F))
    kept = [root.child([], [], last=False) for _ in range(100)]
    x = kept[50].forces
    del kept[:50], kept[1:]
    others = [root.child(*rows_of((CONTACT,) * 7, system.F), last=False) for _ in range(100)]
    assert np.array_equal(kept[0].forces, x)
    assert all(np.array_equal(other.forces, others[0].forces) for other in others)


@pytest.mark.parametrize("seed", range(3))
def test_the_order_in_which_rows_are_switched_on_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    system = random_system(rng, 6)
    rows, modes = rows_of([UNDECIDED, CONTACT, STICK, UNDECIDED, OPEN, SLIP_PLUS], np.ones(6))
    engine = ActiveSetEngine(system)
    order = rng.permutation(len(rows))
    other = engine.root([rows[k] for k in order], [modes[k] for k in order])
    assert numbers_of(engine.root(rows, modes)) == numbers_of(other)
