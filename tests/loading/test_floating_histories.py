"""Histories of bodies that nothing holds: rationals step by step, held bodies, weak springs, closed forms, Newton."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import accepted_report, complete_report, read_back
from effort import some
from flint import fmpq
from floating_histories import agreed, case
from floating_oracle import Oracle, random_body, rational
from helpers.floating_bodies import held_by_springs, pushed_block
from interruptions import CtrlC, interrupted
from proof_tools import of_kind, proof_of, records_of
from refusals import bad_argument

import enumsol


def compared(problem, alphas):
    """The history, every search of which has the solutions of the oracle, which carries its own positions."""
    history = enumsol.histories(problem, alphas, arithmetic="exact")
    starts = {tuple(Fraction(x) for x in problem.slip_offset.tolist())}
    Bt = [[rational(x) for x in row] for row in problem.Bt.toarray().tolist()]
    for step, alpha in enumerate(alphas, 1):
        stages = history.stages(step)
        assert {stage.start.rationals for stage in stages} == starts
        starts = set()
        for stage in stages:
            oracle = Oracle(problem, alpha, [fmpq(x.numerator, x.denominator) for x in stage.start.rationals])
            assert (len(stage.roots), len(stage.roots.families)) == (len(oracle.points), oracle.families)
            assert bool(stage.reasons) == bool(oracle.families)
            forces = sorted(np.r_[root.lambda_n, root.lambda_t].tolist() for root in stage.roots)
            assert np.allclose(forces, np.reshape(sorted(oracle.forces[0].tolist()), np.shape(forces)), atol=1e-9)
            for point in oracle.points:
                moved = [sum((a * x for a, x in zip(row, point, strict=False)), fmpq(0)) for row in Bt]
                starts.add(tuple(Fraction(int(x.p), int(x.q)) for x in moved))
        if not starts:
            break
    return history


@pytest.mark.few(1, 1)
@pytest.mark.parametrize("seeds", [(5, 8, 14), (16, 17, 21), (23, 25, 27), (30, 31, 42), range(8), range(50, 58)])
def test_random_bodies_against_rationals_step_by_step(seeds):
    found = [compared(random_body(seed), [0.25, 0.5, 0.0]) for seed in seeds]
    assert any(history.counts[-1] for history in found)


def test_a_block_slides_a_little_and_stays_there():
    history = compared(pushed_block(1), [0.5, 0.9, 0.0, 1.5])
    assert (history.counts, history.unique_until) == ((1, 1, 1, 0), 3)
    for said in ("none reaches the last step", "nothing solves step 4", "rigid displacements"):
        assert said in str(history)


def test_sliding_for_good_is_a_family_that_is_not_followed():
    history = compared(pushed_block(1, max_rigid_displacement=4.0), [0.5, 1.0, 0.0])
    assert len(history.stages(3)) == 0
    assert "family of solutions, which are not followed" in history.reasons[0]
    assert "within rigid displacements of 4" in history.closing_line


def test_weak_springs_tend_to_it():
    bodies = pushed_block(1), held_by_springs(pushed_block(1), 1e-7)
    free, weak = (enumsol.histories(body, [0.5, 0.9, -0.5], arithmetic="exact") for body in bodies)
    assert free.counts == weak.counts == (1, 1, 1)
    for step in (1, 2, 3):
        (one,), (two,) = free.roots(step), weak.roots(step)
        assert one.statuses == two.statuses
        assert_close(one, two, "lambda_t", atol=1e-6)
        assert_close(one, two, "u", atol=1e-5)


# -- verified arithmetic -----------------------------------------------------------------------------------------------


@pytest.mark.few(4, 6)
@pytest.mark.parametrize("seed", range(60))
def test_random_bodies_in_balls_against_rationals_step_by_step(seed):
    agreed(*case(seed))


@pytest.mark.slow
def test_such_histories_are_complete_slide_and_have_none_and_several_roots():
    count, first = some(20, of=60), some(82, of=60)
    found = [agreed(*case(seed)) for seed in range(first, first + count)]
    slid = [history for history in found if any(stage.start.radius is not None for stage in history.all_stages)]
    assert sum(history.complete for history in slid) > count // 3
    assert sum(history.counts[-1] == 0 for history in found if history.complete) > count // 30
    assert sum(bool(history.branchings) for history in found) > 0


def proven(problem, steps, **options):
    """The history with its proof, which says the same and no more."""
    history = enumsol.histories(problem, steps, **options)
    report = accepted_report(problem, history.proof)
    assert (report.complete, report.unique_until) == (history.complete, history.unique_until), history
    assert report.within is None or f"within rigid displacements of {report.within:g}" in history.closing_line
    return history


def test_what_has_slid_stays_where_it_is_to_the_last_bit():
    problem = pushed_block(2)
    history = proven(problem, [0.5, 0.9, 0.0, -0.1, 0.8, 0.3])
    assert (history.complete, history.unique_until) == (True, 6)
    starts = [stage.start for stage in history.all_stages]
    # nothing slips in steps 3 to 6
    assert {start.key for start in starts[3:]} == {starts[2].key}
    assert starts[2].radius is not None
    exact = enumsol.histories(problem, [0.5, 0.9, 0.0, -0.1, 0.8, 0.3], arithmetic="exact")
    for one, other in zip(history.all_stages, exact.all_stages, strict=True):
        pairs = zip(other.start.rationals, one.start.ball.low, one.start.ball.high, strict=True)
        assert all(Fraction(low) <= value <= Fraction(high) for value, low, high in pairs)


@pytest.mark.slow
def test_the_ball_of_a_start_does_not_grow_with_the_steps():
    rng = np.random.default_rng(3)
    alphas = np.round(rng.uniform(-0.97, 0.97, 40), 3).tolist()
    history = proven(pushed_block(3), alphas)
    assert (history.complete, history.unique_until) == (True, 40)
    assert len({stage.start.key for stage in history.all_stages}) > 5
    slid = np.max(np.abs(history.all_stages[-1].start.offset))
    # rounding of some numbers near one, by which stiffnesses are multiplied
    assert history.all_stages[-1].largest_radius < 1e-10 * slid


@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
def test_a_history_may_end_before_its_last_step(arithmetic):
    history = enumsol.histories(pushed_block(1), [0.5, 0.9, 1.5, 0.2], arithmetic=arithmetic)
    assert (history.counts, history.complete, history.unique_until) == ((1, 1, 0, 0), True, 2)
    assert "nothing solves step 3" in str(history)
    if arithmetic == "verified":
        assert complete_report(pushed_block(1), history.proof).unique_until == 2


def test_sliding_for_good_from_a_ball_is_not_decided():
    """All of a family's equations are singular, which no ball decides; from a start that is known it is a family."""
    problem = pushed_block(1, max_rigid_displacement=4.0)
    history = proven(problem, [1.0, 0.0])
    assert "family of solutions, which are not followed" in history.reasons[0]
    assert len(history.stages(2)) == 0
    later = proven(problem, [0.5, 1.0, 0.0])
    assert later.unique_until == 1
    assert "at the limit of what contact can hold" in later.reasons[0]


def test_a_body_held_where_the_supports_bear_nothing_does_the_same():
    """Supports at the displacements that the body has anyhow: each step is one of a body that is held."""
    problem = pushed_block(2)
    held = np.array([6, 7, 9])  # of the upper nodes, which touch nothing
    rest = np.setdiff1d(np.arange(problem.n), held)
    history = proven(problem, [0.5, 0.9, -0.4, -0.95, 0.7])
    assert history.complete
    A, Bn, Bt = (part.toarray() for part in (problem.A, problem.Bn, problem.Bt))
    for stage in history.all_stages:
        (root,) = stage.roots
        u = root.u[held]
        f = problem.load_at(root.alpha)[rest] - A[np.ix_(rest, held)] @ u
        other = enumsol.ContactProblem(
            A[np.ix_(rest, rest)], Bn[:, rest], Bt[:, rest], f, problem.gap - Bn[:, held] @ u, problem.friction,
            slip_offset=stage.start.offset - Bt[:, held] @ u,
        )  # fmt: skip
        same = [one for one in enumsol.enumerate_roots(other, 0) if np.max(np.abs(one.u - root.u[rest])) < 1e-9]
        assert len(same) == 1
        assert_close(same[0], root, "lambda_n", "lambda_t", atol=1e-9)
        assert_close(same[0], root, "u_t", atol=1e-9)


def test_options_are_those_of_bodies_that_are_held(tmp_path):
    problem = pushed_block(1)
    refined = enumsol.histories(problem, [0.5, 0.9], refine=True, max_halvings=1)
    assert (refined.complete, refined.refinement.settled) == (True, True)
    joined = enumsol.histories(problem, [0.5, 0.9, 0.2], merge=1e-3, follow="nearest")
    assert joined.complete
    again = read_back(joined, tmp_path / "h.json", problem)
    for one, other in zip(again.all_stages, joined.all_stages, strict=True):
        for a, b in zip(one.roots, other.roots, strict=True):
            assert_same(a, b, "lambda_t", "rigid_coordinates", "u", "enclosure.rigid_coordinates")
    stop = CtrlC(lambda state: state.step == 2)
    partial = interrupted("in step 2; 2 roots so far", enumsol.histories, problem, [0.5, 0.9, 0.2], progress=stop)
    assert partial.counts == (1, 1, 0)
    bad_argument('arithmetic is "fast"', enumsol.histories, problem, [0.5], arithmetic="fast")


def test_the_rigid_displacement_of_a_root_is_enclosed():
    for alpha in (0.5, 0.9):
        (root,) = enumsol.enumerate_roots(pushed_block(2), alpha)
        (exact,) = enumsol.enumerate_roots(pushed_block(2), alpha, arithmetic="exact")
        (low, high), (below, above) = (one.enclosure.rigid_coordinates.T for one in (root, exact))
        assert np.all((low <= below) & (above <= high))
        assert np.all(high - low < 1e-12)
        assert np.all((low <= root.rigid_coordinates) & (root.rigid_coordinates <= high))


def test_the_least_of_the_bounds_that_were_needed_is_named():
    bounds = [enumsol.roots.root_set.RigidBound(*given) for given in ((1.0, False), (4.0, True), (2.0, True))]
    history = enumsol.histories(pushed_block(1), [0.5, 0.9, 0.0])
    stages = [
        SimpleNamespace(**vars(stage) | {"roots": SimpleNamespace(rigid_bound=bound, unique=True, proof=None)})
        for stage, bound in zip(history.all_stages, bounds, strict=True)
    ]
    data = dataclasses.replace(history, all_stages=tuple(stages))
    assert data._within() == ", within rigid displacements of 2"


# -- in a plane or in space, by hand -----------------------------------------------------------------------------------

STIFFNESS, PRESSED, FRICTION = 4.0, 2.0, 0.5


def two_weights(tangents):
    """Two weights on a floor that a spring joins, alike in all directions along it; the first one is pulled."""
    d = 1 + tangents
    A, e = np.zeros((2 * d, 2 * d)), np.eye(2 * d)
    for t in range(1, d):
        A[np.ix_([t, d + t], [t, d + t])] = STIFFNESS * np.array([[1, -1], [-1, 1]])
    rows, N = [e[[j, d + j]] for j in range(d)], np.column_stack([e[0], e[d], *(e[t] + e[d + t] for t in range(1, d))])
    kind = enumsol.ContactProblem if tangents == 1 else enumsol.ContactProblem3D
    given = {"friction": FRICTION, "rigid_modes": N, "max_rigid_displacement": 64.0}
    return kind(A, *rows, PRESSED * (e[0] + e[d]), **given)


def pulls_and_positions(tangents, count, seed):
    """Pulls under which the second weight stays, and where the first one goes: back to a disc around a / k."""
    rng, at, found = np.random.default_rng(seed), np.zeros(tangents), []
    while len(found) < count:
        pull = rng.integers(-15, 16, tangents) / 8
        far = pull / STIFFNESS - at
        most, length = FRICTION * PRESSED / STIFFNESS, np.linalg.norm(far)
        after = at if length <= most else pull / STIFFNESS - most * far / length
        if STIFFNESS * np.linalg.norm(after) < 0.98 * FRICTION * PRESSED and abs(length - most) > 1e-3:
            at = after
            found.append((pull, at))
    return found


@pytest.mark.parametrize(("tangents", "count"), [(1, 10), (2, 4), pytest.param(2, 40, marks=pytest.mark.long)])
def test_two_weights_on_a_spring(tangents, count):
    problem, known = two_weights(tangents), pulls_and_positions(tangents, count, 1)
    loads = []
    for pull, _ in known:
        load = problem.f.copy()
        load[1 : 1 + tangents] = pull
        loads.append(load)
    history = proven(problem, loads)
    assert (history.complete, history.unique_until) == (True, count)
    for step, (_, at) in enumerate(known, 1):
        (root,) = history.roots(step)
        assert np.allclose(root.u[1 : 1 + tangents], at, atol=1e-9)
        assert np.allclose(root.u[2 + tangents :], 0.0, atol=1e-9)
        if step < count:
            start = history.stages(step + 1)[0].start
            radius = np.zeros_like(start.offset) if start.radius is None else start.radius
            assert np.all(np.abs(start.offset.reshape(2, -1)[0] - at) <= radius.reshape(2, -1)[0] + 1e-15)
            assert start.radius is None or np.max(start.radius) < 1e-9
    moved = sum(np.linalg.norm(b - a) for (_, a), (_, b) in pairwise(known))
    moved += np.linalg.norm(known[0][1])
    assert moved > 0.1
    assert np.isclose(history.dissipated[count, 0][0], FRICTION * PRESSED * moved, atol=1e-8)


def narrow(records, start):
    """The checker may be closer than the search by a little; not by so much."""
    records[start][3] = [x / 8 for x in records[start][3]]


def moved(records, start):
    records[start][2] = [x + 1e-9 * (r > 0) for x, r in zip(*records[start][2:4], strict=True)]


def unmoved(records, start):
    """As if the rigid displacement had been left out: from where the load and the forces alone move the nodes."""
    records[start][2:4] = [0.0] * len(records[start][2]), [1e-9] * len(records[start][2])


def bounded(records, start):
    records[start + 1]["max_rigid_displacement"] = 4.0


def without_follower(records, start):
    before = next(record for record in records[1:start] if record[0] == "s" and record[4])
    before[4] = []


@pytest.mark.parametrize("change", [narrow, moved, unmoved, bounded, without_follower])
def test_a_changed_proof_is_not_complete(change):
    problem = two_weights(1)
    loads = [problem.f + pull * np.eye(4)[1] for pull in (1.5, -0.5)]
    history = proven(problem, loads)
    records = records_of(history.proof)
    start = of_kind(records, "s")[1]
    change(records, start)
    report = enumsol.verify(problem, proof_of(records))
    assert not report.complete
    assert report.unique_until < 2


# -- loads that are held or reached again ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "alphas"),
    [
        (2, [0.9, 0.9, 0.9]),
        (1, [0.5, 0.9, 0.0, 0.9]),
        pytest.param(2, [0.5, 0.9, 0, 0.9, 0.95], marks=pytest.mark.slow),
    ],
)
def test_a_load_that_is_held_or_reached_again_is_decided_in_balls(cells, alphas):
    """Several selections share its root, whose index and statuses are those that rationals find."""
    problem = pushed_block(cells)
    history, exact = proven(problem, alphas), enumsol.histories(problem, alphas, arithmetic="exact")
    assert (history.complete, history.unique_until) == (True, len(alphas))
    shared = 0
    for stage, other in zip(history.all_stages, exact.all_stages, strict=True):
        (root,), (known,) = stage.roots, other.roots
        assert (root.index, root.regular, root.active) == (known.index, known.regular, known.active)
        shared += not root.regular
        assert root.enclosure.lambda_t[:, 0] @ root.enclosure.lambda_t[:, 1] > 0
        pairs = zip(other.start.rationals, stage.start.ball.low, stage.start.ball.high, strict=True)
        assert all(Fraction(low) <= value <= Fraction(high) for value, low, high in pairs)
    assert shared
    assert history.all_stages[-1].largest_radius < 1e-13


def test_other_limits_are_counted_in_the_same_way(tmp_path):
    """A search of a start in a ball is resumed and shared among workers; what selections share is one root."""
    problem = pushed_block(2)
    stage = enumsol.histories(problem, [0.9, 0.9]).stages(2)[0]
    whole = stage.roots
    assert (len(whole), whole.complete) == (1, True)
    file = tmp_path / "p.zst"
    enumsol.enumerate_roots(stage.problem, 0.9, proof_path=file, max_nodes=2)
    again = enumsol.enumerate_roots(stage.problem, 0.9, proof_path=file, resume=True)
    with ThreadPoolExecutor(2) as pool:
        shared = enumsol.enumerate_roots(stage.problem, 0.9, executor=pool)
    for other in (again, shared):
        assert (len(other), other.complete, other[0].active) == (1, True, whole[0].active)
        assert complete_report(stage.problem, other.proof).roots == 1


def one_less(record):
    record[1] = record[1][1:]


def other_way(record):
    record[1][0][1] = 5 - record[1][0][1]


def no_slip(record):
    record[1][0][1] = 1


def elsewhere(record):
    record[2][0] += 1.0


def narrower(record):
    record[3] = [0.0] * len(record[3])


def other_index(record):
    record[4] = -record[4]


def twice(record):
    record[1] = [record[1][0], *record[1]]


def excluded(record):
    record[:] = ["n"]


def regular(record):
    record[:] = ["r", *record[2:]]


FORGED = [one_less, other_way, no_slip, elsewhere, narrower, other_index, twice, excluded, regular]


@pytest.mark.parametrize("change", FORGED)
def test_a_changed_record_of_a_root_that_selections_share_is_refused(change):
    problem = pushed_block(2)
    stage = enumsol.histories(problem, [0.9, 0.9]).stages(2)[0]
    records = records_of(stage.roots.proof)
    leaves = of_kind(records, "g")
    assert len(leaves) == 4
    for place in leaves:
        forged = records_of(stage.roots.proof)
        change(forged[place])
        report = enumsol.verify(stage.problem, proof_of(forged))
        assert not report.ok
