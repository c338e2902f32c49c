"""Bodies that are left at an equilibrium with a small disturbance, in time: they leave as it is claimed, or do not."""

import numpy as np
import pytest
from growing_motions import growing_motions
from linear_motions import random_motion, setting
from stepping import STICK_SLIP_A, STICK_SLIP_F, beside_a_root, growth

from enumsol.search.stability import StabilitySearch


def found_by_judge(seeds, away):
    """Random data that run away, or do not, as the judge says."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        data = random_motion(rng)
        if len(data[4]) <= 3 and bool(growing_motions(*data)) == away:
            yield rng, data


def check_leaving(data):
    """Started at 1e-6 of the claimed motion, the body moves along it, with the claimed growth rate within 1 %."""
    A, M, _, Bt, F, kinds, signs = data
    stiffness, motions = setting(*data)
    proven = StabilitySearch(stiffness, motions).run()
    assert proven.growing
    for certificate, motion in proven.growing:
        low, high = certificate.low, certificate.high
        rho = np.sqrt(0.5 * (low + high))
        K = stiffness.at(low).mid
        claimed = np.linalg.solve(A + low * M, stiffness.rows.T @ (K @ (motions.moves.mid @ motion.mid)))
        claimed /= np.linalg.norm(claimed)
        # to the last bits: what flutters beside it may grow much faster
        judged = [(v / np.linalg.norm(v), own) for mu, v, own in growing_motions(*data)]
        pairs = [(side * v, own) for v, own in judged for side in (1, -1)]
        [(v, own)] = [pair for pair in pairs if np.linalg.norm(pair[0] - claimed) < 1e-3]
        stepper = beside_a_root(*data, step=0.02 / rho)
        # friction may leave a choice of accelerations
        slips = {1.0: "plus", -1.0: "minus"}
        moves = [slips[signs[i]] if i in own else "open" if kinds[i] == "open" else "stick" for i in range(len(F))]
        stepper.last = tuple(
            slips[np.sign(Bt[i] @ v)] if kinds[i] != "open" and not F[i] else moves[i] for i in range(len(F))
        )
        # and to where rounding has not grown to what is seen
        fastest = np.sqrt(np.max(np.linalg.eigvals(np.linalg.solve(M, A)).real))
        steps = max(3, int(60 * min(1.0, 5 * rho / fastest)))
        sizes, way = growth(stepper, 1e-6 * v, 1e-6 * rho * v, steps)
        rate = np.log(sizes[-1] / sizes[0]) / (steps * stepper.h)
        assert rate == pytest.approx(rho, rel=0.01), (F, kinds)
        assert way[1] @ v == pytest.approx(1, rel=1e-4)


def check_not_leaving(rng, data):
    """However it is disturbed, the body does not leave along a line at a steady rate."""
    A, M, *_, kinds, _ = data
    n, held = len(A), np.vstack([data[2][[k != "open" for k in kinds]], data[3][[k == "stuck" for k in kinds]]])
    for _ in range(2):
        e = rng.normal(size=n)
        if len(held):
            e -= np.linalg.pinv(held) @ (held @ e)
        fastest = np.sqrt(np.max(np.linalg.eigvals(np.linalg.solve(M, A)).real))
        stepper = beside_a_root(*data, step=0.1 / fastest)
        sizes, way = growth(stepper, np.zeros(n), 1e-7 * e, 600)
        along_a_line = way[0] @ way[1] > 1 - 1e-9 and sizes[-1] > 1.05 * sizes[300]
        assert not along_a_line, kinds


def test_bodies_that_run_away_leave_at_the_claimed_rate():
    cases = found_by_judge(((7, k) for k in range(400)), away=True)
    for _ in range(5):
        check_leaving(next(cases)[1])


@pytest.mark.slow
def test_fifty_bodies_that_run_away():
    count = 0
    for _, data in found_by_judge(((8, k) for k in range(2000)), away=True):
        check_leaving(data)
        count += 1
        if count == 50:
            return
    raise AssertionError(count)


def test_bodies_that_do_not_run_away_leave_along_no_line():
    cases = found_by_judge(((9, k) for k in range(400)), away=False)
    for _ in range(3):
        check_not_leaving(*next(cases))


@pytest.mark.slow
def test_forty_bodies_that_do_not_run_away():
    cases = found_by_judge(((10, k) for k in range(400)), away=False)
    for _ in range(40):
        check_not_leaving(*next(cases))


def test_slip_and_stick_in_turn_may_grow():
    """What does not run away may be unstable all the same (theory, section 15.1)."""
    rows, one = np.eye(4), np.ones(1)
    data = STICK_SLIP_A, np.eye(4), rows[:1], rows[1:2], np.array([STICK_SLIP_F]), ["limit"], one
    assert growing_motions(*data) == []
    stiffness, motions = setting(*data)
    proven = StabilitySearch(stiffness, motions).run()
    assert (proven.growing, proven.gaps) == ((), ())
    stepper = beside_a_root(*data, step=0.02)
    d, e, seen, sizes = np.zeros(4), 1e-9 * np.array([0, 1.0, 0.5, -0.5]), set(), []
    for _ in range(5000):
        d, e, [status] = stepper.advance(d, e)
        seen.add(status)
        sizes.append(np.linalg.norm(e))
    assert seen == {"stick", "plus"}
    assert max(sizes[-300:]) > 1000 * max(sizes[:300])
