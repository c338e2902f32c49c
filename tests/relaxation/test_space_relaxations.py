"""Relaxations in 3D: which node is branched on, and children that were solved for that."""

from itertools import islice

import numpy as np
import pytest
from problems3d import from_compliance, random_coupled
from space_proofs import arc_of_sector

from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.relaxation.convex_forms import SlipFormAscent
from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.relaxation.space_relaxation import SpaceEngine
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.sector_margins import space_margin


def all_rows(engine, codes):
    parts = [engine.imposed(node, code) for node, code in enumerate(codes)]
    return [row for rows, _ in parts for row in rows], [mode for _, modes in parts for mode in modes]


def fresh(engine, codes):
    return engine.root(*all_rows(engine, codes))


def children_left(engine, codes, node):
    children = [with_code(codes, node, code) for code in engine.children(node, codes[node])]
    return [child for child in children if not fresh(engine, child).pruned]


def promise(engine, codes, relaxation, node):
    """What branching on a node is worth that has several children left (theory, section 12.2)."""
    bounds = np.array([fresh(engine, child).bound for child in children_left(engine, codes, node)])
    gains = np.clip((bounds - relaxation.bound) / (PRUNE_MARGIN - relaxation.bound), 0, 1)
    return relaxation.violations(codes)[node] ** 0.3 / np.sum(np.exp(-4 * gains))


def with_code(codes, node, code):
    return (*codes[:node], code, *codes[node + 1 :])


def walked(engine):
    """Codes, relaxation and node to branch on of the nodes of a tree, and the stack, to which those below are added."""
    stack = [(UNDECIDED,) * 3]
    while stack:
        codes = stack.pop()
        relaxation = fresh(engine, codes)
        yield codes, relaxation, relaxation.choose(codes), stack


def test_branching_takes_a_node_of_which_all_children_but_one_are_excluded_or_the_most_promising_one():
    forced = free = several = given = 0
    for seed in range(8):
        S, g, F = random_coupled(np.random.default_rng(seed), 3)
        engine = SpaceEngine(SpaceSystem.scaled(S, g, F))
        balls = EnclosedSpace.of_floats(engine.system)
        for codes, relaxation, node, stack in islice(walked(engine), 20):
            if node < 0:
                assert not {CONTACT, UNDECIDED} & set(codes)
                continue
            left = [children_left(engine, codes, other) for other in range(3)]
            if len(left[node]) > 1:
                free += 1
                violated = np.flatnonzero(relaxation.violations(codes) > 0)
                worth = {other: promise(engine, codes, relaxation, other) for other in violated.tolist()}
                assert worth[node] > max(worth.values()) * (1 - 1e-6)
                several += len(worth) > 1
                assert all(len(left[other]) > 1 for other in range(3) if codes[other] in (CONTACT, UNDECIDED))
            forced += len(left[node]) <= 1
            # what was solved for the choice is handed out, with multipliers that prove what is excluded
            for code in engine.children(node, codes[node]):
                child = relaxation.child(*engine.imposed(node, code), last=False)
                assert child.bound >= relaxation.bound - 1e-9
                if child.pruned:
                    numbers, values = child.multipliers()
                    rows = [engine.rows[number] for number in numbers.tolist()]
                    assert space_margin(balls, with_code(codes, node, code), rows, values) > 0
                    assert len(child.forces) == len(child.displacements) == len(g)
                    given += 1
            stack.extend(left[node])
    assert forced > 20
    assert free > 5
    assert several > 3
    assert given > 20


def leaves_of_trees(seeds):
    """Engine, codes, relaxation and node to branch on of all nodes of some trees in which every status is final."""
    for seed in seeds:
        S, g, F = random_coupled(np.random.default_rng(seed), 3)
        engine = SpaceEngine(SpaceSystem.scaled(S, g, F))
        for codes, relaxation, node, stack in walked(engine):
            if not {CONTACT, UNDECIDED} & set(codes):
                yield engine, codes, relaxation, node
            if relaxation.cut is not None:
                stack.append(with_code(codes, node, relaxation.cut[1][-1]))
            elif node >= 0:
                stack.extend(children_left(engine, codes, node))


def test_slices_that_are_cut_off_sectors_are_excluded_and_leave_the_rest():
    ends, runs, leaves = set(), 0, 0
    for engine, codes, relaxation, node in leaves_of_trees(range(10)):
        if relaxation.cut is None:
            leaves += node < 0
            continue
        at, (*slices, rest) = relaxation.cut
        assert at == node
        assert all(fresh(engine, with_code(codes, node, part)).pruned for part in slices)
        whole, *parts = (arc_of_sector(code - 8) for code in (codes[node], *slices, rest))
        parts.sort()
        assert [a for a, _ in parts] + [whole[1]] == [whole[0]] + [b for _, b in parts]
        ends |= {parts.index(arc_of_sector(part - 8)) == 0 for part in slices}
        runs += rest > 2**31
    assert ends == {True, False}
    assert runs > 3
    assert leaves > 2


# -- convex forms ------------------------------------------------------------------------------------------------------


def begun(seed, p=2):
    """Solvers, an ascent, and the rows of the root of the tree."""
    rng = np.random.default_rng(seed)
    X, F = rng.normal(size=(3 * p, 3 * p)), rng.uniform(0.3, 1.0, (p, 2))
    S, g = X @ X.T + np.eye(3 * p), np.concatenate([rng.uniform(0.5, 1.0, p), rng.normal(size=2 * p)])
    F[0, 1] = 0.0 if seed % 2 else F[0, 1]
    solvers = SpaceSolvers(from_compliance(S, g, (F[:, 0], F[:, 1])), 0.0, "verified")
    search = solvers.search(solvers.certifier(None))
    rows = search.relaxations.rows.over((UNDECIDED,) * p, range(p))
    return solvers, SlipFormAscent(search.relaxations.engine, solvers.enclosed, rows), rows


@pytest.mark.parametrize("seed", range(2))
def test_derivatives_are_those_of_what_is_maximised(seed):
    solvers, ascent, _ = begun(seed)
    p, size, rng = 2, len(solvers.system.g), np.random.default_rng(seed)
    numbers = np.concatenate([rng.uniform(0.9, 1.1, 2 * p), rng.uniform(-0.1, 0.1, size - p)])
    live, shares, scale = ascent._live, ascent._shares, 3.0

    def value(numbers):
        found = ascent._candidate(numbers)
        return scale * found.relaxation.bound + 2.0 * np.sum(np.log(np.diagonal(found.factor)))

    def derivatives(numbers):
        found = ascent._candidate(numbers)
        one, two = ascent._of_products(found, scale, ascent._normals(found.relaxation))
        return shares @ one, shares @ two @ shares.T

    gradient, hessian = derivatives(numbers)
    for place, step in enumerate(1e-6 * np.eye(size + p)[live]):
        assert gradient[place] == pytest.approx((value(numbers + step) - value(numbers - step)) / 2e-6, abs=1e-5)
        change = (derivatives(numbers + step)[0] - derivatives(numbers - step)[0]) / 2e-6
        assert -hessian[place] == pytest.approx(change, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_the_form_is_convex_tighter_than_the_energy_and_of_its_curvature(seed):
    solvers, ascent, rows = begun(seed)
    form, relaxation = ascent.ascended()
    assert form.smallest_eigenvalue > 0
    curvatures = np.linalg.eigvals(np.linalg.solve(solvers.system.S, form.H)).real
    assert np.mean(curvatures) == pytest.approx(1.0)
    plain = ascent._engine.root(*rows)
    assert relaxation.pruned or relaxation.bound > plain.bound
