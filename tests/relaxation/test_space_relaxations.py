"""Relaxations in 3D: which node is branched on, and children that were solved for that."""

import numpy as np
from problems3d import random_coupled

from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.sectors import SECTORS, level_of
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


def test_sectors_wider_than_others_are_halved_where_one_half_is_excluded():
    contracted = leaves = 0
    for seed in range(10):
        S, g, F = random_coupled(np.random.default_rng(seed), 3)
        engine = SpaceEngine(SpaceSystem.scaled(S, g, F))
        stack = [(UNDECIDED,) * 3]
        while stack:
            codes = stack.pop()
            relaxation = fresh(engine, codes)
            node = relaxation.choose(codes)
            leaves += node < 0
            if node < 0:
                continue
            left = children_left(engine, codes, node)
            stack += left
            if {CONTACT, UNDECIDED} & set(codes):
                continue
            tau, v = (engine.system.tangential(x) for x in (relaxation.forces, relaxation.displacements))
            if relaxation.forces[node] * np.linalg.norm(v[node]) - tau[node] @ v[node] < 1e-8:
                # dissipation is the largest there: halved only as far as that excludes something
                levels = [level_of(code - SECTORS) for code in codes if code > SECTORS]
                assert level_of(codes[node] - SECTORS) < max(levels)
                assert len(left) <= 1
                contracted += 1
    assert contracted > 3
    assert leaves > 2
