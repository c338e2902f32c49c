"""Relaxations in 3D: which node is branched on, and children that were solved for that."""

from fractions import Fraction

import numpy as np
from problems3d import random_coupled

from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.relaxation.space_relaxation import SpaceEngine
from enumsol.trusted.space.sector_rows import sector_margin


def all_rows(engine, codes):
    parts = [engine.imposed(node, code) for node, code in enumerate(codes)]
    return [row for rows, _ in parts for row in rows], [mode for _, modes in parts for mode in modes]


def fresh(engine, codes):
    return engine.root(*all_rows(engine, codes))


def children_left(engine, codes, node):
    children = [with_code(codes, node, code) for code in engine.children(node, codes[node])]
    return [child for child in children if not fresh(engine, child).pruned]


def with_code(codes, node, code):
    return (*codes[:node], code, *codes[node + 1 :])


def test_branching_takes_a_node_of_which_all_children_but_one_are_excluded():
    forced = free = given = 0
    for seed in range(8):
        S, g, F = random_coupled(np.random.default_rng(seed), 3)
        engine = SpaceEngine(SpaceSystem.scaled(S, g, F))
        balls = EnclosedSpace.of_floats(engine.system)
        stack = [(UNDECIDED,) * 3]
        for _ in range(20):
            if not stack:
                break
            codes = stack.pop()
            relaxation = fresh(engine, codes)
            node = relaxation.choose(codes)
            if node < 0:
                assert not {CONTACT, UNDECIDED} & set(codes)
                continue
            left = [children_left(engine, codes, other) for other in range(3)]
            if len(left[node]) > 1:
                free += 1
                assert all(len(left[other]) > 1 for other in range(3) if codes[other] in (CONTACT, UNDECIDED))
            forced += len(left[node]) <= 1
            # what was solved for the choice is handed out, with multipliers that prove what is excluded
            for code in engine.children(node, codes[node]):
                child = relaxation.child(*engine.imposed(node, code), last=False)
                assert child.bound >= relaxation.bound - 1e-9
                if child.pruned:
                    numbers, values = child.multipliers()
                    rows = [engine.rows[number] for number in numbers.tolist()]
                    assert sector_margin(balls, with_code(codes, node, code), rows, values) > 0
                    assert len(child.forces) == len(child.displacements) == len(g)
                    given += 1
            stack += left[node]
    assert forced > 20
    assert free > 5
    assert given > 20


def leaves_of_trees(seeds):
    """Engine, codes, relaxation and node to branch on of all nodes of some trees in which every status is final."""
    for seed in seeds:
        S, g, F = random_coupled(np.random.default_rng(seed), 3)
        engine = SpaceEngine(SpaceSystem.scaled(S, g, F))
        stack = [(UNDECIDED,) * 3]
        while stack:
            codes = stack.pop()
            relaxation = fresh(engine, codes)
            node = relaxation.choose(codes)
            if not {CONTACT, UNDECIDED} & set(codes):
                yield engine, codes, relaxation, node
            if relaxation.cut is not None:
                stack.append(with_code(codes, node, relaxation.cut[1][-1]))
            elif node >= 0:
                stack += children_left(engine, codes, node)


def test_slices_that_are_cut_off_sectors_are_excluded_and_leave_the_rest():
    ends, runs, leaves = set(), 0, 0
    for engine, codes, relaxation, node in leaves_of_trees(range(10)):
        if relaxation.cut is None:
            leaves += node < 0
            continue
        at, (*slices, rest) = relaxation.cut
        assert at == node
        assert all(fresh(engine, with_code(codes, node, part)).pruned for part in slices)
        whole, *parts = (as_arc(code) for code in (codes[node], *slices, rest))
        parts.sort()
        assert [a for a, _ in parts] + [whole[1]] == [whole[0]] + [b for _, b in parts]
        ends |= {parts.index(as_arc(part)) == 0 for part in slices}
        runs += rest > 2**31
    assert ends == {True, False}
    assert runs > 3
    assert leaves > 2


def as_arc(code):
    """Where a sector begins and ends, as shares of the circle (docs/proof_format.md, under space proofs)."""
    length, first = divmod(code - 8, 2**31)
    level = 2 ** (len(f"{first:b}") - 1)
    return Fraction(first - level, level), Fraction(first - level + length + 1, level)
