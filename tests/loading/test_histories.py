"""What a history answers, its limits, and what is proven about starts in balls."""

import json
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
from alike import anew, assert_close, assert_same
from complete import all_roots, read_back
from interruptions import CtrlC, interrupted
from refusals import bad_argument

import enumsol
from enumsol import ContactProblem, History, LoadStep, enumerate_roots, histories
from enumsol.loading.history_data import Refinement
from enumsol.model.restart import SlipStart, restarted


def test_the_wedge_ends_jammed_or_free_by_the_branch_alone(out_again):
    history = out_again
    assert (history.complete, history.unique_until, history.counts) == (True, 2, (1, 1, 3, 5))
    assert history.branchings == ((2, 0), (3, 2))
    last = [{status.value for status in history.root(node).statuses} for node in history.ends]
    assert last == [{"open"}, {"open"}, {"open"}, {"slip+"}, {"stick"}]
    assert [node[0] for node in history.ends] == [4] * 5
    assert len(list(history.paths())) == 5
    printed = repr(history)
    assert printed.splitlines()[0] == "History of 4 steps: 5 histories (verified)"
    assert printed.splitlines()[-1] == "complete: yes (proven), unique until step 2"
    assert "   └─ 4.4 4 stick" in printed
    frame = history.to_frame()
    assert frame["step"].tolist() == [1, 2, 3, 3, 3, 4, 4, 4, 4, 4]
    assert frame["dissipated_most"].is_monotonic_increasing is False
    assert (frame["dissipated"] >= 0).all()


def test_every_step_is_what_enumerate_roots_finds(out_again, pulled_wedge):
    """Starts without a radius are ordinary problems: by hand, with problems built anew."""
    for stage in out_again.all_stages:
        alpha = float(stage.roots.alpha)
        by_hand = anew(pulled_wedge, slip_offset=stage.start.offset)
        roots = enumerate_roots(by_hand, alpha)
        assert [root.statuses for root in roots] == [root.statuses for root in stage.roots]
        for one, other in zip(roots, stage.roots, strict=True):
            assert_close(one, other, "lambda_n", rtol=0, atol=1e-12)
        assert (by_hand.fingerprint == stage.problem.fingerprint) == (stage.start.radius is None)


def test_steps_in_space_by_hand():
    given = enumsol.gallery.get("block3d-4").build()
    block = anew(given, friction=tuple(given.friction_at(0.5).T), friction_slope=0.0)
    loads = [block.f, block.f * 1.5, -0.5 * block.f]
    history = histories(block, loads)
    assert history.counts == (1, 1, 1)
    problem = anew(block, f=loads[0])
    for step, load in enumerate(loads, 1):
        problem = anew(problem, f=load)
        (root,) = enumerate_roots(problem, 0)
        assert root.statuses == history.root((step, 0)).statuses
        assert np.allclose(root.lambda_t, history.root((step, 0)).lambda_t, atol=1e-10)
        problem = anew(problem, slip_offset=problem.slip_offset + root.u_t)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_complete_step_is_complete_for_every_start_in_its_ball(dimension, pulled_wedge):
    problem = pulled_wedge if dimension == 2 else enumsol.gallery.get("wedge3d-2-3").build()
    alpha = 0.5 if dimension == 2 else 1
    shape, rng = problem.slip_offset.shape, np.random.default_rng(3)
    radius = np.full(shape, 2e-6 if dimension == 2 else 1e-5)
    wide = restarted(problem, SlipStart(np.zeros(shape), radius))
    roots = all_roots(wide, alpha)
    assert len(roots) == 3
    widest = max(float(np.max(np.ptp(root.enclosure.lambda_n, axis=1))) for root in roots)
    assert widest > 1e-7  # the start's radius, not rounding
    for _ in range(5):
        offset = radius * rng.choice([-1.0, 1.0], size=shape)
        found = enumerate_roots(anew(problem, slip_offset=offset), alpha)
        assert [root.statuses for root in found] == [root.statuses for root in roots]
        for one, ball in zip(found, roots, strict=True):
            for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
                value, bounds = getattr(one, name), getattr(ball.enclosure, name)
                assert np.all(bounds[..., 0] <= value + 1e-15), name
                assert np.all(value - 1e-15 <= bounds[..., 1]), name


def test_the_radius_is_named_where_it_is_the_reason(pulled_wedge):
    history = histories(pulled_wedge, [0, 1, 0, 1])
    (reason,) = history.reasons
    assert reason.startswith("step 4 from root 3.1: ")
    assert "because its start is known within" in reason
    assert (history.complete, history.unique_until) == (False, 1)


def test_a_wide_ball_is_not_decided_in_rationals(pulled_wedge):
    wide = restarted(pulled_wedge, SlipStart(np.zeros(4), np.full(4, 1e-2)))
    roots = enumerate_roots(wide, 0.5, max_nodes=60)
    assert any(part.reason != "the search was stopped before it got here" for part in roots.undecided)
    assert not roots.complete


def test_the_slip_offset_moves_no_more_than_it_has_to():
    """Steps share what depends on the matrices only: the same numbers, and no new factorization."""
    block = enumsol.gallery.clamped_block(8, 2, 2.0)
    other = restarted(block, SlipStart(np.linspace(0, 1e-3, 8)), load=2.0 * block.f)
    again = anew(block, slip_offset=np.linspace(0, 1e-3, 8), f=2.0 * block.f, load_slope=None)
    assert other.factorization is block.factorization
    assert_same(other, again, "fingerprint", "condensed.g0")
    assert_same(other.enclosure, again.enclosure, "S", "g0", "g0_rad")


@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
def test_a_continuum_is_listed_and_not_followed(arithmetic, tmp_path):
    history = histories(enumsol.gallery.one_node_triangle(f=(1, -2)), [2, 3], arithmetic=arithmetic)
    assert history.reasons == ("step 1: 1 family of solutions, which are not followed",)
    assert (history.counts, history.complete, history.unique_until) == ((0, 0), False, 0)
    assert "none reaches the last step" in repr(history)
    again = read_back(history, tmp_path / "h.json", history.problem)
    (one,), (other,) = (h.all_stages[0].roots.families for h in (history, again))
    assert_same(one, other, "alpha", "index", "vertices_proven", "dimension", "vertices")
    assert [part.statuses for part in one.polytopes] == [part.statuses for part in other.polytopes]
    for node in ((1, 5), "1.0", (0, 0)):
        bad_argument("expected a pair .step, root. of this history", history.root, node)


# -- choices and limits ------------------------------------------------------------------------------------------------


def test_the_nearest_root_is_followed(pulled_wedge):
    history = histories(pulled_wedge, [-1, 0, 0.5, 1], follow="nearest")
    assert history.counts == (1, 1, 3, 3)
    assert {status.value for status in history.root(history.ends[-1]).statuses} == {"stick"}
    assert not history.complete
    assert sum("is not followed, by the user's choice" in reason for reason in history.reasons) == 2
    assert "3.0 4 open (not followed)" in repr(history)


def test_a_callable_chooses(pulled_wedge):
    asked = []

    def loose(before, roots):
        asked.append((before, len(roots)))
        return [root for root in roots if not np.any(root.lambda_n)] or 0

    history = histories(pulled_wedge, [-1, 0, 0.5, 1], follow=loose)
    assert history.counts == (1, 1, 3, 1)
    assert [count for _, count in asked] == [1, 1, 3]
    assert asked[0][0] is None
    assert asked[1][0] is history.root((1, 0))
    message = "follow returned 7; expected roots of the RootSet"
    bad_argument(message, histories, pulled_wedge, [-1, 0], follow=lambda before, roots: 7)


def test_limits_keep_what_was_found(pulled_wedge):
    few = histories(pulled_wedge, [-1, 0, 0.5, 1], max_branches=2)
    assert few.reasons == ("step 3: max_branches = 2 of 3 different ends are followed",)
    assert few.counts == (1, 1, 3, 2)
    short = histories(pulled_wedge, [-1, 0, 0.5, 1], max_nodes=3)
    assert (short.complete, short.unique_until < 4) == (False, True)
    assert "stopped after max_nodes = " in short.reasons[-1]
    none = histories(pulled_wedge, [-1, 0, 0.5, 1], time_limit=1e-9)
    assert none.counts[-1] == 0
    assert "time limit" in none.reasons[-1]


def test_an_interruption_keeps_the_steps_before(pulled_wedge):
    said, stop = "histories was interrupted in step 3; 5 roots so far", CtrlC(lambda state: state.step == 3)
    partial = interrupted(said, histories, pulled_wedge, [-1, 0, 0.5, 1], progress=stop)
    assert (partial.counts, partial.unique_until, partial.complete) == ((1, 1, 3, 0), 2, False)


def test_equal_ends_start_one_stage():
    chain = enumsol.gallery.chain(2)
    history = histories(chain, [5, 5.5])
    # open, sticking and slipping nodes: those that slip leave the others' ends where they are
    assert history.complete
    ends = {stage.start.key for stage in history.stages(2)}
    assert len(ends) == len(history.stages(2)) < len(history.roots(1)) + 1
    assert history.counts[0] == 9


def test_a_tolerance_joins_ends_in_one_ball(pulled_wedge):
    apart = histories(pulled_wedge, [1, 0])
    joined = histories(pulled_wedge, [1, 0], merge=1.0, max_nodes=80)
    assert len(apart.stages(2)) == 3
    (stage,) = joined.stages(2)
    for other in apart.stages(2):
        assert stage.start.holds(other.start.ball)
    assert not joined.complete  # so wide a ball is not decided, and that is said
    bad_argument("merge", histories, pulled_wedge, [1, 0], merge=1.0, arithmetic="exact")


def test_a_load_held_after_an_unstable_slip_has_two_roots_beside_it_or_none(pulled_wedge):
    """So no ball of starts can decide it; exact arithmetic finds one root of index 0."""
    history = histories(pulled_wedge, [-1, 0, 0.5])
    root, start = history.root((3, 1)), history.stages(3)[0].start
    assert root.index == -1
    beside = [SlipStart(start.offset + (1 + far) * root.u_t) for far in (1e-3, -1e-3)]
    found = [enumsol.enumerate_roots(restarted(pulled_wedge, end), 0.5) for end in beside]
    assert all(roots.complete for roots in found)
    assert [len(roots) for roots in found] == [1, 3]
    held = histories(pulled_wedge, [-1, 0, 0.5, 0.5])
    assert not held.complete
    assert "because its start is known within" in held.reasons[0]
    exact = histories(pulled_wedge, [-1, 0, 0.5, 0.5], arithmetic="exact")
    assert exact.complete
    assert sorted(root.index for root in exact.roots(4)) == [-1, 0, 1, 1, 1, 1]


def test_increments_are_halved_until_nothing_changes(pulled_wedge):
    history = histories(pulled_wedge, [-1, 0, 0.5], refine=True)
    assert history.refinement.settled
    assert len(history.steps) > 3
    assert "left the statuses along all histories unchanged" in repr(history)
    coarse = ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 0], friction=0.5, load_slope=[0, 1])
    # friction falls as the load reverses: the coarse step slips back, a finer one sees the high load first
    steps = [LoadStep(0.0, friction=1.0), LoadStep(0.0, friction=1.0)]
    assert histories(coarse, steps, refine=True).refinement.settled


def test_the_first_step_is_halved_from_no_load():
    """Contact closes on the way to the first load, and what slips before it differs from what one step says."""
    rng = np.random.default_rng(38)
    X = rng.integers(-2, 3, size=(4, 4))
    A, f, gap = X @ X.T + np.eye(4), rng.integers(-3, 4, size=4), rng.integers(0, 3, size=2) / 4
    rows = np.eye(4)
    problem = ContactProblem(A, rows[:2], rows[2:], np.zeros(4), gap, friction=0.5, load_slope=f)
    found = histories(problem, [1, 0.5], refine=True, max_halvings=2)
    assert found.refinement.changed_at == (1, 0)
    assert "which changed until then, from step 1 on" in str(found.refinement)
    by_hand = histories(problem, [0.25, 0.5, 0.75, 1, 0.875, 0.75, 0.625, 0.5])
    for step in range(1, 9):
        statuses = [[root.statuses for root in history.roots(step)] for history in (found, by_hand)]
        assert statuses[0] == statuses[1]
    coarse = histories(problem, [1, 0.5])
    assert {root.statuses for root in coarse.roots(1)} != {root.statuses for root in found.roots(4)}


def test_increments_that_matter_are_told():
    # one step over a turn of the load misses the slip on the way
    A, options = [[1.0, 0.3], [0.3, 1.0]], {"friction": 0.5, "friction_slope": 0.0, "load_slope": [1.0, 0.0]}
    problem = ContactProblem(A, [[1, 0]], [[0, 1]], [0.0, 0.0], **options)
    steps = [np.array([1.0, 0.0]), np.array([1.0, 0.4]), np.array([4.0, 3.0]), np.array([0.1, 0.0])]
    history = histories(problem, steps, refine=True, max_halvings=2)
    assert history.refinement.halvings >= 1
    assert str(history.refinement) in repr(history)


# -- arguments ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (0.5, r"steps is 0\.5; expected a sequence of alphas"),
        ([], "steps is empty"),
        ([1, "x"], "step 2: alpha is 'x'"),
        ([1, None], "step 2 is None; expected a sequence"),
        ([np.zeros(3)], r"step 1: load has shape \(3,\); expected \(n,\) = \(2,\)"),
        ([-1], "step 1: friction at alpha = -1 is -1 at contact node 0"),
        ([LoadStep(load=[0, 0])], "step 1 has no alpha, on which the problem's friction or load depends"),
        ([1, object()], "step 2 is <object object at"),
        ([[[1, 2], [3]]], "step 1 is "),
        ([LoadStep(1, friction=-1)], "step 1: friction is -1; expected F >= 0"),
        ([LoadStep(1, friction=[1, 2])], "step 1: friction has shape"),
        (pd.DataFrame({"alpha": [1], "frction": [2]}), "steps has the columns alpha, frction; expected"),
        (pd.DataFrame({"alpha": [1, "one"]}), "step 2: alpha is 'one'"),
    ],
)
def test_steps_that_cannot_be_used(steps, message):
    bad_argument(message, histories, enumsol.gallery.one_node_triangle(), steps)


def test_steps_in_words():
    steps = [LoadStep("1/4"), LoadStep(2, friction=[0.5, 0.25]), LoadStep(friction=0.5, load=[3.0, -4.0])]
    words = ["alpha=0.25", "alpha=2, friction in [0.25, 0.5]", "friction=0.5, load up to 4"]
    assert [repr(step) for step in steps] == [f"LoadStep({said})" for said in words]


def test_between_a_step_with_a_load_and_one_without_there_is_none():
    one, other = LoadStep(1, load=[1.0, 2.0]), LoadStep(2)
    bad_argument("of two steps one has a load or a friction and the other has none", one.between, other, Fraction(1, 2))
    middle = one.between(LoadStep(2, load=[3.0, 0.0]), Fraction(1, 2))
    assert (middle.alpha, middle.load.tolist(), middle.friction) == (Fraction(3, 2), [2.0, 1.0], None)


def test_a_pair_of_coefficients_of_a_step_in_space():
    """The first one differs from node to node, the second one does not: slip along the axes stops at F lambda_n."""
    rows = np.eye(6)
    problem = enumsol.ContactProblem3D(np.eye(6), rows[:2], rows[2:4], rows[4:], [1, 1, 3, 0, 0, 3], friction=(9, 9))
    history = histories(problem, [LoadStep(friction=([0.5, 0.25], 2.0)), LoadStep(friction=[0.5, 0.25])])
    first, second = (history.root((k, 0)).lambda_t for k in (1, 2))
    np.testing.assert_allclose(first, [[0.5, 0.0], [0.0, 2.0]], atol=1e-9)
    np.testing.assert_allclose(second, [[0.5, 0.0], [0.0, 0.25]], atol=1e-9)


def test_what_a_notebook_shows_of_a_history():
    shown = histories(enumsol.gallery.one_node_triangle(), [1, 5], refine=True)._repr_html_()
    assert "<td>4</td><td>5</td><td>1</td>" in shown  # both increments were halved once
    assert ">4.0 open</p>" in shown
    assert "increments: the last of " in shown
    assert shown.endswith("complete: yes (proven), unique until step 4</p>")


def test_what_halving_the_increments_has_shown_in_words():
    assert str(Refinement(2, settled=False, changed_at=(3, 2))) == (
        "after 2 halvings the statuses still depend on the increments, from step 2 on"
    )
    assert (
        str(Refinement(1, False, (0,), "too many roots"))
        == "not known whether they matter, 1 halving done: too many roots"
    )
    assert "which changed until then, from step 2 on" in str(Refinement(3, settled=True, changed_at=(4, 2, 0)))


def test_tables_and_arrays_are_steps():
    problem = ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [2, 0], friction=0.5, load_slope=[0, 1])
    table = pd.DataFrame({"alpha": ["1/2", "3"], "friction": [0.25, 0.5]})
    by_table = histories(problem, table)
    assert [root.lambda_t[0] for root in (by_table.root((1, 0)), by_table.root((2, 0)))] == pytest.approx([0.5, 1.0])
    loads = np.array([[2.0, 0.5], [2.0, 3.0]])
    by_array = histories(problem, loads)
    assert by_array.root((2, 0)).lambda_t[0] == pytest.approx(1.0)
    named = histories(problem, pd.DataFrame({"f1": [0.5, 3.0]}))
    assert [named.root((k, 0)).statuses for k in (1, 2)] == [by_array.root((k, 0)).statuses for k in (1, 2)]
    bad_argument("stop_after is an option of enumerate_roots", histories, problem, loads, stop_after=2)


# -- files -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arithmetic", ["verified", "exact", "fast"])
def test_a_history_is_read_back_to_the_last_bit(arithmetic, tmp_path):
    problem = enumsol.gallery.one_node_triangle(f=(1.5, -4.0))
    history = histories(problem, ["5", "8/3", 3.0], arithmetic=arithmetic, refine=arithmetic == "fast")
    again = read_back(history, tmp_path / "h.json", problem)
    assert repr(again) == repr(history)
    assert again.to_frame().equals(history.to_frame())
    assert again.refinement == history.refinement
    for one, other in zip(again.all_stages, history.all_stages, strict=True):
        assert_same(one, other, "start.key", "roots.alpha")
        for a, b in zip(one.roots, other.roots, strict=True):
            assert_same(a, b, "lambda_t", "exact_slips", "u")
    another = enumsol.gallery.one_node_triangle(f=(1, -4))
    bad_argument("holds a history of another problem", History.load, tmp_path / "h.json", another)


@pytest.mark.slow
def test_a_history_in_space_with_families_and_open_parts_is_read_back(tmp_path, pulled_wedge):
    for problem, steps in (
        (enumsol.gallery.get("wedge3d-2-3").build(), [1, 1.5]),
        (enumsol.gallery.one_node_triangle(f=(1, -2)), [2]),
        (pulled_wedge, [0, 1, 0, 1]),
    ):
        history = histories(problem, steps)
        again = read_back(history, tmp_path / "h.json", problem)
        assert repr(again) == repr(history)
        assert len(again.stages(1)[0].roots.families) == len(history.stages(1)[0].roots.families)


def test_damaged_files_are_refused(tmp_path, out_again, pulled_wedge):
    place = tmp_path / "h.json"
    out_again.save(place)
    record = json.loads(place.read_text())
    for change in ({"format": "x"}, {"version": 9}, {"stages": [{}]}, {"steps": 1}):
        place.write_text(json.dumps(record | change))
        bad_argument(r"h\.json", History.load, place, pulled_wedge)
    bad_argument("cannot be read", History.load, tmp_path / "none.json", pulled_wedge)


def test_figures_have_titles_legends_and_names_that_do_not_overlap(out_again, pulled_wedge):
    for x, y in (("displacement", "alpha"), ("step", "dissipated"), ("step", "lambda_n"), ("displacement", "lambda_t")):
        figure = out_again.plot(x, y)
        (ax,) = figure.axes
        title = ax.get_title().lower()
        assert all(label in title.replace("\n", " ") for label in (ax.get_xlabel(), ax.get_ylabel()))
        assert "complete: yes" in title
        words = [text.get_text() for text in ax.get_legend().get_texts()]
        assert words[-1] == "several histories"
        assert "4.4: 4 stick" in words
        figure.draw_without_rendering()
        boxes = [text.get_window_extent() for text in ax.texts]
        assert len(boxes) >= 2
        assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])
        assert all(ax.bbox.x0 <= box.x0 and box.x1 <= ax.bbox.x1 for box in boxes)
        assert ax.get_legend().get_window_extent().x0 > ax.bbox.x1
        assert x != "step" or all(tick == int(tick) for tick in ax.get_xticks())
    left = histories(pulled_wedge, [-1, 0, 0.5, 1], follow="nearest").plot()
    assert "not followed" in [text.get_text() for text in left.axes[0].get_legend().get_texts()]


def test_every_history_is_a_line(out_again, tmp_path):
    figure = out_again.plot(file=tmp_path / "h.png")
    assert (tmp_path / "h.png").stat().st_size > 10_000
    (ax,) = figure.axes
    lines = [line for line in ax.lines if len(line.get_xdata()) == 2]
    assert len(lines) == out_again.graph.number_of_edges() - 1  # nothing is drawn from the start, which has no load
    tops = sorted(float(line.get_ydata()[1]) for line in lines)
    assert tops == [0.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0]
    by_step = out_again.plot("step", "dissipated").axes[0]
    drawn = [line for line in by_step.lines if len(line.get_xdata()) == 2]
    assert len(drawn) == out_again.graph.number_of_edges()
    own = out_again.plot("step", lambda root: root.margin).axes[0]
    assert own.get_xlabel() == "step"
    labels = {text.get_text() for text in by_step.texts}
    assert any("4.4" in label for label in labels)
    bad_argument("x is 'force'; expected one of step, alpha", out_again.plot, "force")
