"""One proof for a whole history: what the checker accepts, and what it refuses or does not believe."""

import copy
import re

import numpy as np
import pytest
from alike import anew
from complete import accepted_report, complete_report
from proof_tools import of_kind, proof_of, put, records_of

import enumsol
from enumsol import histories, verify


def test_a_branching_history_is_verified(out_again, pulled_wedge):
    report = complete_report(pulled_wedge, out_again.proof)
    assert report.unique_until == out_again.unique_until == 2
    assert (report.roots, report.stages) == ((1, 1, 3, 5), (1, 1, 1, 3))


def test_a_history_in_space_is_verified():
    wedge = enumsol.gallery.get("wedge3d-2-3").build()
    given = {"friction": tuple(wedge.friction_at(1).T), "friction_slope": 0.0, "f": 0 * wedge.f, "load_slope": wedge.f}
    wedge = anew(wedge, **given)
    history = histories(wedge, [-1, 0, 0.5, 1])
    assert history.complete
    assert complete_report(wedge, history.proof).roots == (1, 1, 3, 5)


def test_loads_and_friction_of_steps_are_part_of_the_proof():
    problem = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [2, 0], friction=0.5)
    steps = [enumsol.LoadStep(load=[2, 0.5], friction=0.25), enumsol.LoadStep(load=[2, 3]), [1, -3]]
    history = histories(problem, steps)
    complete_report(problem, history.proof)
    assert not verify(anew(problem, friction=0.25), history.proof).ok
    for step, part, value in ((1, 1, [2.0, 3.5]), (0, 2, [-0.25])):
        records = records_of(history.proof)
        records[0]["steps"][step][part] = value
        assert not verify(problem, proof_of(records)).ok


def test_an_incomplete_history_is_verified_and_not_complete(pulled_wedge):
    history = histories(pulled_wedge, [0, 1, 0, 1])
    report = accepted_report(pulled_wedge, history.proof)
    assert (report.complete, report.unique_until) == (False, 1)
    followed = histories(pulled_wedge, [-1, 0, 0.5, 1], follow="nearest")
    assert not accepted_report(pulled_wedge, followed.proof).complete


def test_only_verified_arithmetic_proves(pulled_wedge):
    for arithmetic in ("fast", "exact"):
        assert histories(pulled_wedge, [-1, 0], arithmetic=arithmetic).proof is None


def no_follower(records, starts):
    records[starts[2]][4] = records[starts[2]][4][:-1]


def narrow_start(records, starts):
    """The start after a root that moved is a thousandth as wide as it has to be."""
    for k in starts:
        if records[k][3] is not None:
            records[k][3] = [1e-3 * radius for radius in records[k][3]]


def other_start(records, starts):
    records[starts[3]][2] = [x + 1e-9 for x in records[starts[3]][2]]


def exact_start(records, starts):
    for k in starts:
        records[k][3] = None


def negative_radius(records, starts):
    k = next(k for k in starts if records[k][3] is not None)
    records[k][3] = [-radius for radius in records[k][3]]


def first_from_elsewhere(records, starts):
    records[starts[0]][2][0] = 1e-12


def skips_a_step(records, starts):
    records[starts[1]][1] = 3


def follows_itself(records, starts):
    records[starts[1]][4] = [1]


def other_alpha(records, starts):
    records[0]["steps"][1][0] = "1/3"


def fewer_steps(records, starts):
    records[0]["steps"] = records[0]["steps"][:-1]


def a_search_left_out(records, starts):
    del records[starts[-1] : -1]
    records[0]["stages"] -= 1
    records[-1]["stages"] -= 1
    for k in starts[:-1]:
        records[k][4] = [n for n in records[k][4] if n < records[0]["stages"]]


def breaks_off(records, starts):
    del records[-4:-1]


def more_behind(records, starts):
    records.append({"stages": 1})


def one_more_name(records, starts):
    records[0]["complete"] = True


def leaf_gone(records, starts):
    records[of_kind(records, "r")[0]] = ["n"]


#: These are sound and prove less.
_LESS = (no_follower, a_search_left_out)


@pytest.mark.parametrize(
    "change",
    [
        *(no_follower, narrow_start, other_start, exact_start, negative_radius, first_from_elsewhere, skips_a_step),
        *(follows_itself, other_alpha, fewer_steps, a_search_left_out, breaks_off, more_behind, one_more_name),
        leaf_gone,
    ],
)
def test_a_changed_proof_is_not_complete(change, out_again, pulled_wedge):
    records = copy.deepcopy(records_of(out_again.proof))
    change(records, of_kind(records, "s"))
    report = verify(pulled_wedge, proof_of(records))
    assert not report.complete
    assert report.ok == (change in _LESS), report
    assert report.unique_until <= 2


def held_at_its_limit():
    """The load of step 3 is held in step 4: two leaves hold its root, whose balls differ."""
    A = np.diag([80.5, 80.5, 4, 4, 4, 4])
    A[2:, :2] = [[-12, 4], [12, 4], [-4, -12], [4, -12]]
    A[:2, 2:] = A[2:, :2].T
    e = np.eye(6)
    problem = enumsol.ContactProblem(A, e[2:4], e[4:6], [1, -3, -2, 2, -1, -2], friction=0.75)
    first, held = [1, -2, -4, 3, -3, -4], [3, -2, 0, 3, -3, -1]
    steps = [enumsol.LoadStep(load=load) for load in (first, first, held, held)]
    return problem, [*steps, enumsol.LoadStep(load=held, friction=0.375)]


def test_a_root_that_two_leaves_hold_is_followed_by_one_of_their_balls():
    problem, steps = held_at_its_limit()
    history = histories(problem, steps)
    assert history.complete
    assert complete_report(problem, history.proof).unique_until == history.unique_until == 5
    records = records_of(history.proof)
    starts = of_kind(records, "s")
    # two leaves of step 4 hold its one root, and only that of one leaf is in the start of step 5
    assert len(of_kind(records[starts[3] : starts[4]], "m")) == 2
    narrow_start(records, starts[4:])
    report = verify(problem, proof_of(records))
    assert not report.complete
    assert report.unique_until <= 4


def degenerate_history(seed, tangents):
    """Loads that are repeated, taken away, halved or at the limit of friction, in whole numbers and their quarters."""
    rng = np.random.default_rng(seed)
    p, d = int(rng.integers(1, 3)), 1 + tangents
    n = d * p + int(rng.integers(0, 2)) * d
    X = rng.integers(-2, 3, (n, n))
    A, e, F = (X @ X.T + np.diag(rng.integers(1, 9, n))) / 4, np.eye(n), float(rng.choice([0.25, 0.5, 0.75, 1, 2]))
    rows, load = [e[k * p : (k + 1) * p] for k in range(d)], rng.integers(-3, 4, n).astype(float)
    gap = rng.choice([0.0, 0.0, 0.0, 0.5, -0.5], p)
    kind = enumsol.ContactProblem if tangents == 1 else enumsol.ContactProblem3D
    problem = kind(A, *rows, load, gap=gap, friction=F)
    steps = []
    for _ in range(int(rng.integers(3, 6))):
        what = rng.choice(["same", "same", "new", "none", "back", "half", "limit"])
        if what == "new":
            load = rng.integers(-3, 4, n).astype(float)
        elif what == "none":
            load = np.zeros(n)
        elif what == "back" and steps:
            load = steps[int(rng.integers(len(steps)))].load
        elif what == "half":
            load = load / 2
        elif what == "limit":
            pressed = rng.integers(0, 4, p)
            load = pressed @ rows[0] + sum(F * pressed * rng.integers(-1, 2, p) @ row for row in rows[1:])
        friction = rng.choice([F, F, F, F / 2, 2 * F, 0.0])
        steps.append(enumsol.LoadStep(load=load, friction=None if rng.random() < 0.3 else float(friction)))
    return problem, steps


def says_what_its_proof_says(problem, steps):
    """The history, after this was compared."""
    history = histories(problem, steps)
    report = accepted_report(problem, history.proof)
    assert (report.complete, report.unique_until) == (history.complete, history.unique_until), history
    return history


def has_degenerate_root(history):
    return any(not root.regular for step in range(1, len(history.steps) + 1) for root in history.roots(step))


@pytest.mark.few(6, 12)
@pytest.mark.parametrize("seed", range(2000, 2150))
def test_a_history_says_what_its_proof_says(seed):
    says_what_its_proof_says(*degenerate_history(seed, 1))


@pytest.mark.parametrize("seed", [2002, 2016])
def test_the_checker_knows_which_forces_are_zero_or_press(seed):
    assert says_what_its_proof_says(*degenerate_history(seed, 2)).complete


@pytest.mark.few(2, 6)
@pytest.mark.parametrize("seed", range(2000, 2060))
def test_a_history_in_space_says_what_its_proof_says(seed):
    says_what_its_proof_says(*degenerate_history(seed, 2))


@pytest.mark.slow
@pytest.mark.parametrize("tangents", [1, 2])
def test_such_histories_are_complete_and_degenerate(tangents):
    found = [says_what_its_proof_says(*degenerate_history(seed, tangents)) for seed in range(2000, 2012)]
    assert sum(history.complete for history in found) > 6
    assert sum(map(has_degenerate_root, found)) > 3


@pytest.fixture(scope="module")
def pressed():
    """A problem of one node and the records of a history of two steps, in each of which it has one root."""
    problem = enumsol.gallery.one_node_triangle()
    return problem, records_of(histories(problem, [1, 5]).proof)


def test_what_is_said_of_a_verified_history_and_of_a_refused_one(pressed):
    problem, records = pressed
    report = complete_report(problem, proof_of(records))
    lines = [
        "proof: verified for a history of 2 steps",
        "  step 1: 1 root from 1 start",
        "  step 2: 1 root from 1 start",
    ]
    assert repr(report).splitlines() == [*lines, "  complete: yes, unique until step 2"]
    assert all(line.strip() in report._repr_html_() for line in lines)
    said = repr(verify(problem, proof_of(records[:-1])))
    assert said.startswith("proof: REFUSED for a history")
    assert "checked until then: 2 searches, which show nothing" in said


@pytest.mark.parametrize(
    ("path", "value", "why"),
    [
        ((0, "steps"), [], "the header has no steps"),
        ((0, "stages"), True, "the header has no steps"),
        ((0, "steps", 0), ["1"], "the header cannot be read"),
        ((0, "steps", 0, 0), "1/0", "the header cannot be read"),
        ((1,), ["s", 1, [0.0]], "search 0 cannot be read"),
        ((1, 2), ["0"], "search 0 cannot be read: .* .expected 1 numbers"),
        ((6, "alpha"), "4", "search 1 .step 2. is about another alpha than its step"),
        ((7, 4), [1.0, 0.0], r"search 1 .step 2.: leaf 1: its only solution is not proven to be a root|search 1"),
    ],
)
def test_it_is_said_what_is_wrong_with_a_history(pressed, path, value, why):
    problem, records = pressed
    report = verify(problem, proof_of(put(records, path, value)))
    assert not report.ok
    assert re.search(why, " ".join(report.failures)), report.failures


def test_a_step_is_followed_by_the_next_one_only():
    problem = enumsol.gallery.one_node_triangle()
    records = records_of(histories(problem, [1, 5, 1]).proof)
    first = of_kind(records, "s")[0]
    assert records[first][4] == [1]
    report = verify(problem, proof_of(put(records, (first, 4), [2])))
    assert report.failures == ("search 0 is followed by one of another step than the next",)


def test_the_check_of_a_history_ends_after_many_failures(pressed):
    problem, records = pressed
    leaves = [["b", 0, [0, 5]], ["x", "", ""], ["b", 0, [1, 2, 3]], *[["x", "", ""]] * 3]
    claim = {"roots": 0, "families": 0, "undecided": 0, "leaves": 4}
    search = [*records[1:3], *leaves, claim]
    following = [put(search, (0, 4), [])] * 9
    report = verify(problem, proof_of([put(records[0], ("stages",), 10), *sum(following, search), {"stages": 10}]))
    assert len(report.failures) == 21
    assert report.failures[-1] == "the check ends after 20 failures"


def test_a_start_that_is_proven_and_too_narrow_is_not_believed(pulled_wedge):
    """The search of the next step is honest, but it is about other starts than the root's end."""
    history = histories(pulled_wedge, [0.5, 1])
    records = records_of(history.proof)
    places = of_kind(records, "s")
    alone = anew(pulled_wedge, slip_offset=records[places[1]][2])
    honest = records_of(enumsol.enumerate_roots(alone, 1.0).proof)
    assert records[places[1]][3] is not None
    records[places[1]][3] = None
    records[places[1] + 1 : places[2]] = honest
    assert not accepted_report(pulled_wedge, proof_of(records)).complete


def test_a_wide_start_may_not_be_decided_in_rationals(pulled_wedge):
    history = histories(pulled_wedge, [0.5, 1])
    records = records_of(history.proof)
    k = next(k for k in of_kind(records, "s") if records[k][3] is not None)
    records[k + 1]["data"] = "condensed"
    report = verify(pulled_wedge, proof_of(records))
    assert not report.ok
    assert any("slip offset is a ball" in failure for failure in report.failures)
