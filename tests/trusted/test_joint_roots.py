"""Selections that share one root: rationals at many starts in a ball find one root among them, in its enclosure."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from floating_oracle import Oracle, block_on_table, rational
from history_oracle import exact_history

import enumsol
from enumsol.condensation.enclosure import enclosure_of
from enumsol.model.restart import SlipStart, restarted
from enumsol.trusted.at_alpha import MOST_BETWEEN, joint_root
from enumsol.trusted.status_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

CODES = {"open": OPEN, "stick": STICK, "slip+": SLIP_PLUS, "slip-": SLIP_MINUS}


def system_of(problem, alpha):
    """Balls of a problem in units of one."""
    ones = np.ones(2 * problem.p)
    return enclosure_of(problem).at(alpha, ones, ones)


def held_again(problem, alpha, offset=None):
    """What slips at the root of a problem, the others' codes, and the offset that it leaves behind."""
    start = problem if offset is None else problem.replace(slip_offset=offset)
    (root,) = enumsol.enumerate_roots(start, alpha)
    codes = [CODES[str(status)] for status in root.statuses]
    slips = {i: code for i, code in enumerate(codes) if code in (SLIP_PLUS, SLIP_MINUS)}
    return slips, tuple(STICK if i in slips else code for i, code in enumerate(codes)), start.slip_offset + root.u_t


@pytest.mark.parametrize(("cells", "push", "k"), [(1, 0.75, 1), (2, 0.5, 1), (2, 0.875, 2)])
def test_every_start_in_a_ball_has_one_root_in_it(cells, push, k):
    problem = block_on_table(cells, push=push, max_rigid_displacement=4.0)
    slips, core, offset = held_again(problem, 0)
    assert len(slips) == k
    radius, rng = 2.0**-30, np.random.default_rng(k)
    ball = restarted(problem, SlipStart(offset, np.full(problem.p, radius)))
    found = joint_root(system_of(ball, 0), core, slips)
    assert (found.core, found.index, found.slips) == (core, 1, tuple(sorted(slips.items())))
    seen = set()
    for way in [*product((-1, 1), repeat=k), *rng.uniform(-1, 1, (4, k))]:
        start = [Fraction(x) for x in (offset + radius * rng.uniform(-1, 1, problem.p)).tolist()]
        for i, side in zip(slips, way, strict=True):
            start[i] = Fraction(float(offset[i] + radius * side))
        oracle = Oracle(problem, 0, [rational(x) for x in start])
        assert (len(oracle.points), oracle.families) == (1, 0)
        numbers = np.array([float(Fraction(int(x.p), int(x.q))) for x in oracle.points[0]])
        assert np.all(np.abs(numbers[oracle.n :] - found.force.mid) <= found.force.rad + 1e-15)
        held = {codes for codes, points in oracle.parts if oracle.points[0] in points}
        assert held <= set(product(*found.possible))
        seen |= held
    # each of the selections is that of some start
    assert seen == set(product(*found.possible))


def test_selections_whose_determinants_differ_in_sign_share_none(pulled_wedge):
    """Beside such a start there are two roots, or none."""
    history = enumsol.histories(pulled_wedge, [-1, 0, 0.5])
    root, start = history.root((3, 1)), history.stages(3)[0].start
    assert root.index == -1
    codes = [CODES[str(status)] for status in root.statuses]
    slips = {i: code for i, code in enumerate(codes) if code in (SLIP_PLUS, SLIP_MINUS)}
    core = tuple(STICK if i in slips else code for i, code in enumerate(codes))
    ends = SlipStart(start.offset + root.u_t, np.full(pulled_wedge.p, 1e-12))
    assert slips
    assert joint_root(system_of(restarted(pulled_wedge, ends), 0.5), core, slips) is None


def test_it_is_as_true_of_bodies_that_are_held():
    A, e = np.array([[4.0, 1.0], [1.0, 3.0]]), np.eye(2)
    problem = enumsol.ContactProblem(A, e[:1], e[1:], [2.0, 1.5], friction=0.5)
    slips, core, offset = held_again(problem, 0)
    ball = restarted(problem, SlipStart(offset, np.full(1, 2.0**-30)))
    found = joint_root(system_of(ball, 0), core, slips)
    for side in (-1.0, 0.5, 1.0):
        ((nodes, continuum),) = exact_history(problem.replace(slip_offset=offset + side * 2.0**-30), [0.0])
        (node,) = nodes
        assert not continuum
        assert np.all(np.abs([float(x) for x in node.forces] - found.force.mid) <= found.force.rad)


def test_conditions_that_do_not_hold_strictly_and_other_statuses_are_no_joint_root():
    problem = block_on_table(2, push=0.875, max_rigid_displacement=4.0)
    slips, core, offset = held_again(problem, 0)
    ball = restarted(problem, SlipStart(offset, np.full(problem.p, 2.0**-30)))
    system = system_of(ball, 0)
    assert joint_root(system, core, slips) is not None
    one, other = sorted(slips)
    assert set(slips.values()) == {SLIP_PLUS}
    # another node's bound is open, too
    assert joint_root(system, core, {one: slips[one]}) is None
    assert joint_root(system, core, {one: SLIP_MINUS, other: slips[other]}) is None
    assert joint_root(system, core, {}) is None
    assert joint_root(system, core, {one: STICK}) is None
    assert joint_root(system, tuple(slips.get(i, code) for i, code in enumerate(core)), slips) is None
    assert joint_root(system, (OPEN, *core[1:]), {0: SLIP_PLUS}) is None
    # the bound of the rigid displacement is a condition
    near = system.reaching(np.full_like(system.reach, 1e-30))
    assert joint_root(near, core, slips) is None
    many = block_on_table(MOST_BETWEEN, push=0.5)
    sticking = (STICK,) * many.p
    assert joint_root(system_of(many, 0), sticking, dict.fromkeys(range(many.p), SLIP_PLUS)) is None
