"""How far a body that nothing holds can move: no solution lies beyond what is proven, and what is proven is of use."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from alike import anew
from complete import all_roots
from helpers.floating_oracle import Oracle, block_on_table, random_body

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.condensation.enclosure import EnclosedSystem, RigidRows, enclosure_of
from enumsol.trusted.floating_bounds import is_confined, is_unbalanced, motion_against, without_bound
from enumsol.trusted.status_rows import SLIP_MINUS, SLIP_PLUS, STICK


def enclosed(problem):
    system = problem.on_springs.condensed.at(0).scaled
    return enclosure_of(problem).at(0, system.force, system.length)


def final_codes(codes, oracle):
    """Those of the package: nodes without friction have one status in contact."""
    return [0 if c == 0 else (4 if F == 0 else c) for c, F in zip(codes, oracle.F, strict=True)]


def coordinates(problem, parts):
    """q of all vertices, (k, r)."""
    modes = problem.modes
    u = np.array([[float(Fraction(int(x.p), int(x.q))) for x in v[: problem.n]] for _, vs in parts for v in vs])
    return np.linalg.solve(modes.N[modes.held], u.reshape(-1, problem.n)[:, modes.held].T).T


def test_no_solution_lies_beyond_what_is_proven():
    proven = beyond = 0
    for seed in range(15):
        problem = random_body(seed)
        free = without_bound(enclosed(problem))
        if not np.all(np.isfinite(free.reach)):
            continue
        proven += 1
        most = free.reach * free.rows.unit
        far = anew(problem, max_rigid_displacement=1000 * problem.rigid_reach)
        q = coordinates(far, Oracle(far).parts)
        assert np.all(np.abs(q) <= most * (1 + 1e-12))
        beyond += bool(np.any(np.abs(q) > 0))
    assert proven > 3


def test_a_body_whose_forces_are_not_in_balance_has_no_solution():
    found = 0
    for seed in range(15):
        problem = random_body(seed)
        system, oracle = enclosed(problem), Oracle(problem)
        held = {codes for codes, _ in oracle.parts}
        for codes in product(range(4), repeat=problem.p):
            final = final_codes(codes, oracle)
            z = motion_against(system, final)
            if is_unbalanced(system, final, z):
                found += 1
                assert codes not in held
            # no direction whatever excludes a solution
            if codes in held:
                for z in np.random.default_rng(seed).normal(size=(20, problem.modes.r)):
                    assert not is_unbalanced(system, final, z)
                    assert not is_unbalanced(system, [6] * problem.p, z)
    assert found > 50


def test_friction_below_zero_beside_an_interval_widens_what_forces_may_be():
    G, one = Ball(np.array([[-0.01, 0.0]]), np.array([[0.0, 0.1]])), np.ones(1)
    rows = RigidRows(G, Ball.exact(one), Ball.exact(0 * one), one, one)
    eye, zero = np.eye(2), np.zeros(2)
    for F, balanced in ((0.05, False), (-0.05, False), (0.5, True), (-0.5, True)):
        system = EnclosedSystem(eye, 0 * eye, zero, zero, np.array([F]), np.zeros(1), rows=rows)
        for codes in ([SLIP_PLUS], [SLIP_MINUS], [STICK]):
            assert is_unbalanced(system, codes, one) == (not balanced)


@pytest.mark.parametrize(("push", "confined"), [(0.0, True), (0.5, True), (0.99, True), (1.0, False), (1.25, True)])
def test_a_block_moves_far_only_at_the_limit(push, confined):
    problem = block_on_table(cells=3, push=push)
    assert is_confined(enclosed(problem)) == confined
    roots = enumsol.enumerate_roots(problem, 0)
    assert roots.rigid_bound.needed != confined
    assert ("no bound of rigid displacements was needed" in repr(roots)) == confined
    within = enumsol.verify(problem, roots.proof).within
    assert (within is None) == confined


def test_a_narrow_bound_is_said_to_be_needed_only_if_it_is():
    free = block_on_table(push=0.5)
    narrow = anew(free, max_rigid_displacement=1e-3)
    wide, cut = (enumsol.enumerate_roots(problem, 0) for problem in (free, narrow))
    beyond = np.max(np.abs(wide[0].rigid_displacement)) > 1e-3
    assert (len(cut), cut.rigid_bound.needed) == (0 if beyond else 1, beyond)


def test_a_root_beyond_the_bound_is_not_listed():
    problem = block_on_table(push=0.0)
    # tilted until both nodes touch: the body has to come down by 1/2
    lifted = anew(problem, gap=0.5)
    assert len(enumsol.enumerate_roots(lifted, 0)) == 1
    near = anew(lifted, max_rigid_displacement=0.25)
    roots = all_roots(near, 0)
    assert (len(roots), roots.rigid_bound.needed) == (0, True)
    assert "within rigid displacements of 0.25" in roots.closing_line
    assert enumsol.verify(near, roots.proof).within == 0.25
