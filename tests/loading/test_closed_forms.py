"""Histories whose answer is known in closed form."""

import numpy as np
import pytest
from scipy.optimize import nnls

import enumsol
from enumsol import ContactProblem, histories, verify

FRICTION, PRESS = 0.5, 2.0


def pressed_node(stiffness=1.0):
    """One node with its own two springs, pressed on the floor; alpha pulls it along the floor."""
    return ContactProblem(stiffness * np.eye(2), [[1, 0]], [[0, 1]], [PRESS, 0], friction=FRICTION, load_slope=[0, 1])


def play_operator(loads, stiffness, bound):
    """Position and friction force of a node that slips when the spring's force reaches the bound: (s, lambda_t)."""
    position, found = 0.0, []
    for load in loads:
        force = load - stiffness * position
        if abs(force) > bound:
            position = (load - np.sign(force) * bound) / stiffness
        found.append((position, load - stiffness * position))
    return found


@pytest.mark.parametrize("arithmetic", ["verified", "exact", "fast"])
def test_one_node_under_a_cyclic_load_is_the_play_operator(arithmetic):
    rng = np.random.default_rng(27)
    loads = [0.5, 1.75, 3.0, 1.5, 0.0, -1.25, -3.0, -1.0, 2.0, 3.0, *rng.normal(scale=2.0, size=20)]
    history = histories(pressed_node(4.0), loads, arithmetic=arithmetic)
    assert history.complete == (arithmetic != "fast")
    assert history.counts == (1,) * len(loads)
    work = previous = 0.0
    for step, (position, force) in enumerate(play_operator(loads, 4.0, FRICTION * PRESS), 1):
        root = history.root((step, 0))
        stage = history.stages(step)[0]
        work += force * (position - previous)
        previous = position
        assert root.lambda_t[0] == pytest.approx(force, abs=1e-12)
        assert stage.start.offset[0] + root.u_t[0] == pytest.approx(position, abs=1e-12)
        assert history.dissipated[step, 0] == pytest.approx((work, work), abs=1e-12)
    if arithmetic != "fast":
        assert history.unique_until == len(loads)


def test_the_loop_closes_and_dissipates_its_area():
    # slip by (3 - 1) / 4 forward and back: the force is 1 on the way there and -1 on the way back
    history = histories(pressed_node(4.0), [3, -3, 3, -3, 3])
    work = [history.dissipated[step, 0][0] for step in range(1, 6)]
    assert work == pytest.approx([0.5, 1.5, 2.5, 3.5, 4.5], abs=1e-12)


def test_below_the_bound_the_node_shakes_down():
    history = histories(pressed_node(4.0), [1.5, 0.0, 1.25, 0.0, 1.25])
    assert [history.root((step, 0)).statuses[0].value for step in range(1, 6)] == ["slip+", *["stick"] * 4]
    radii = [stage.largest_radius for stage in history.all_stages]
    assert len(set(radii[1:])) == 1  # carried over, never computed again


def test_a_held_load_changes_nothing():
    # the second step begins at the limit of friction: degenerate, and decided all the same
    for arithmetic in ("verified", "exact"):
        history = histories(pressed_node(4.0), [3.0, 3.0, 3.0], arithmetic=arithmetic)
        assert history.complete, history
        assert history.unique_until == 3
        assert history.dissipated[3, 0][0] == pytest.approx(0.5)


def test_one_node_in_space_follows_the_load_around():
    rows = np.eye(3)
    problem = enumsol.ContactProblem3D(np.eye(3), rows[:1], rows[1:2], rows[2:], [PRESS, 0, 0], friction=FRICTION)
    angles = np.linspace(0.0, 2.0 * np.pi, 9)
    loads = np.column_stack([np.full(9, PRESS), 3.0 * np.cos(angles), 3.0 * np.sin(angles)])
    history = histories(problem, loads)
    assert history.complete, history
    position = np.zeros(2)
    for step, load in enumerate(loads[:, 1:], 1):
        # the node moves towards the load until it is one bound of friction away from it
        away = load - position
        far = float(np.linalg.norm(away))
        position = position if far <= 1.0 else load - away / far
        root, stage = history.root((step, 0)), history.stages(step)[0]
        assert stage.start.offset[0] + root.u_t[0] == pytest.approx(position, abs=1e-10)
        assert stage.largest_radius < 1e-10


# -- an uncoupled contact under constant pressure ----------------------------------------------------------------------


SLIDING_FRICTION = 0.4


@pytest.fixture(scope="module")
def pad():
    x = np.linspace(-1.0, 1.0, 9)
    C = 1.0 / (0.3 + np.abs(x[:, None] - x))
    K, p = np.linalg.inv(C), len(x)
    A, push = np.block([[K, 0 * K], [0 * K, K]]), K @ np.ones(p)
    rows, gap = np.eye(2 * p), 0.5 * x**2
    load, slope = np.r_[0.3 * push, np.zeros(p)], np.r_[np.zeros(p), push]
    return ContactProblem(0.5 * (A + A.T), rows[:p], rows[p:], load, gap, SLIDING_FRICTION, 0.0, slope), C, gap


def pressed(C, gap, approach):
    """Normal forces under an approach: min n'C n / 2 - n'(approach - gap) over n >= 0."""
    L = np.linalg.cholesky(C)
    return nnls(L.T, np.linalg.solve(L, approach - gap))[0]


def test_loops_are_those_of_the_theorem(pad):
    problem, C, gap = pad
    slips = 0.3 * SLIDING_FRICTION
    shares = [0.35, 0.72, 0.31, -0.21, -0.72, 0.13, 0.72]
    history = histories(problem, [slips * share for share in shares])
    assert history.complete
    assert history.unique_until == len(shares)
    assert verify(problem, history.proof).complete
    full = pressed(C, gap, 0.3)

    def first(share):
        return SLIDING_FRICTION * (full - pressed(C, gap, 0.3 * (1.0 - share)))

    top = first(0.72)
    known = [first(0.35), top, *(top - 2 * first((0.72 - s) / 2) for s in (0.31, -0.21, -0.72))]
    known += [2 * first((0.72 + s) / 2) - top for s in (0.13, 0.72)]
    for step, forces in enumerate(known, 1):
        root = history.root((step, 0))
        assert root.lambda_n == pytest.approx(full, abs=1e-12)
        assert root.lambda_t == pytest.approx(forces, abs=1e-12)
    assert max(stage.largest_radius for stage in history.all_stages) < 1e-11
