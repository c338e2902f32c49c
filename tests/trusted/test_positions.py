"""Where contact nodes are at a root: every position that rationals give lies in the ball (theory, section 13.2)."""

from fractions import Fraction

import numpy as np
import pytest
from complete import accepted_report

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.gallery import dovetail
from enumsol.trusted.arcs.precise import PreciseSelection, system_in_many_digits
from enumsol.trusted.positions import certain_statuses
from enumsol.trusted.status_rows import OPEN, SLIP_MINUS, SLIP_PLUS, STICK

CODES = {"open": OPEN, "stick": STICK, "slip+": SLIP_PLUS, "slip-": SLIP_MINUS}
SPRINGS = 2.0**-30


def body(seed):
    """Three nodes on a body that hardly anything holds, of which some stick and some slip."""
    rng = np.random.default_rng([7, seed])
    B = rng.integers(-8, 9, (6, 6)) / 4.0
    A, rows = B.T @ B + SPRINGS * np.eye(6), np.eye(6)
    A[:2, :2] += 2 * np.eye(2)
    return enumsol.ContactProblem(A, rows[:3], rows[3:], rng.integers(-20, 20, 6) / 4.0, friction=0.25)


def mixed():
    """Problems with a regular root at which nodes stick and others do not, and that root."""
    for seed in range(16):
        problem = body(seed)
        for root in enumsol.enumerate_roots(problem, 0, arithmetic="exact"):
            kinds = set(map(str, root.statuses))
            if root.regular and "stick" in kinds and len(kinds) > 1:
                yield problem, root


def positions(problem, root, offset):
    """At the root with the same statuses for another slip offset, in rationals; None where it is none any more."""
    roots = enumsol.enumerate_roots(problem.replace(slip_offset=offset), 0, arithmetic="exact")
    (found,) = [other for other in roots if other.statuses == root.statuses] or [None]
    if found is None:
        return None
    return [Fraction(x) + slip for x, slip in zip(offset.tolist(), found.exact_slips, strict=True)]


def test_every_offset_in_a_ball_leads_into_the_ball_of_positions():
    rng, tried = np.random.default_rng(5), 0
    for problem, root in mixed():
        codes = [CODES[str(status)] for status in root.statuses]
        centre, radius = problem.slip_offset, np.full(3, 2.0**-24)
        found = PreciseSelection(system_in_many_digits(problem), codes).positions(Fraction(0), Ball(centre, radius))
        moving, farthest = [k for k, code in enumerate(codes) if code != STICK], np.zeros(3)
        for _ in range(8):
            exact = positions(problem, root, centre + radius * rng.choice([-1.0, 1.0], 3))
            if exact is None:
                continue
            tried += 1
            for k in moving:
                far = abs(exact[k] - Fraction(float(found.mid[k])))
                assert far <= Fraction(float(found.rad[k]))
                farthest[k] = max(farthest[k], float(far))
        if codes.count(STICK) == 1 and farthest.any():
            # one sticking node: a corner of the ball of offsets is a worst case
            assert np.all(found.rad[moving] <= 1.01 * farthest[moving] + 1e-15 * (1 + np.abs(found.mid[moving])))
    assert tried > 8


@pytest.mark.parametrize(
    ("force", "near", "slip", "far", "code"),
    [
        (0.0, 0.0, -1.0, 2.0, OPEN),
        (1.0, 0.5, 0.0, 0.0, STICK),
        (1.0, 0.5, 2.0, 1.0, SLIP_PLUS),
        (1.0, 0.5, -2.0, 1.0, SLIP_MINUS),
        (1.0, 1.0, -2.0, 1.0, None),  # it may be open
        (0.0, 1e-300, 0.0, 0.0, None),
        (1.0, 0.5, 1.0, 1.0, None),  # it may stick
    ],
)
def test_statuses_that_are_certain(force, near, slip, far, code):
    forces = Ball(np.array([force, 0.3]), np.array([near, 0.1]))
    codes = certain_statuses(forces, Ball(np.array([slip]), np.array([far])))
    assert codes == (None if code is None else (code,))


@pytest.mark.slow
def test_a_history_on_weak_springs_starts_every_step_from_what_is_known_to_many_digits():
    """By balls of double arithmetic the second step's start was known to 1e-5 of 1e-3, and its search did not end."""
    problem = dovetail(friction=0.3)
    history = enumsol.histories(problem, [0.5 * problem.f, problem.f, 0.9 * problem.f], max_nodes=3000)
    assert (history.complete, history.unique_until) == (True, 3)
    assert max(stage.largest_radius for stage in history.all_stages) < 1e-15
    assert accepted_report(problem, history.proof).unique_until == 3
