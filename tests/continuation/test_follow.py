from functools import partial

import numpy as np
import pytest
from path_problems import closed_branch, stable_problem
from refusals import bad_argument, refusal

import enumsol
from enumsol import gallery
from enumsol.condensation import factorization
from enumsol.continuation import AmbiguousStart, ContinuationOptions, SmoothPath, follow, newton, start_tangents

enumerate_roots = partial(enumsol.enumerate_roots, arithmetic="fast")

PAPER = [ContinuationOptions(h_max=h) for h in (0.1, 1.0, 5.0)]


def root_in(status, problem, alpha):
    """The first root in which the first node has a status."""
    return next(root for root in enumerate_roots(problem, alpha) if root.statuses[0].value == status)


def names(path):
    return [tuple(s.value for s in statuses) for statuses in path.selections]


def on_solutions(problem, path, smooth=None):
    """Residuals of the definition itself, written out here: equilibrium is eliminated by a dense inverse."""
    B = np.vstack([problem.Bn.toarray(), problem.Bt.toarray()])
    inverse = np.linalg.inv(problem.A.toarray())
    worst = 0.0
    for point in path:
        frozen = problem if smooth is None else smooth.problem_at(problem, point.alpha)
        force = np.concatenate([point.lambda_n, point.lambda_t])
        w = B @ inverse @ (frozen.load_at(point.alpha) - B.T @ force)
        u_n, u_t = np.split(w - np.concatenate([problem.gap, problem.slip_offset]), 2)
        bound = frozen.friction_at(point.alpha) * point.lambda_n
        gaps = [
            np.maximum(u_n, 0),
            np.maximum(-point.lambda_n, 0),
            point.lambda_n * u_n,
            np.maximum(np.abs(point.lambda_t) - bound, 0),
            np.maximum(u_t, 0) * (bound - point.lambda_t),
            np.maximum(-u_t, 0) * (bound + point.lambda_t),
        ]
        worst = max(worst, *(float(np.max(np.abs(gap))) for gap in gaps))
    return worst


@pytest.mark.parametrize("options", PAPER)
@pytest.mark.parametrize(("start", "direction"), [((1.5, -4.0), -1), ((1 / 3, -5 / 3), 1)])
def test_example_6_1_passes_the_fold_both_ways(options, start, direction):
    problem = gallery.one_node_triangle()
    path = follow(problem, newton(problem, 5.0, start), direction, (0, 20), options)
    assert path.status == "interval left"
    (fold,) = path.folds
    assert fold.alpha == pytest.approx(8 / 3, abs=1e-12)
    assert on_solutions(problem, path) < 1e-12
    expected = [("stick",), ("slip-",)]
    assert names(path) == (expected if direction == -1 else expected[::-1])
    for point in path:
        closed = 1.5 if point.statuses[0].value == "stick" else 1 / (point.alpha - 2)
        assert point.lambda_n[0] == pytest.approx(closed, abs=1e-11)
    assert path.alpha[-1] == 20
    assert np.min(path.alpha) == fold.alpha


@pytest.mark.parametrize("direction", [1, -1])
def test_direction_is_definition_5_1(direction):
    problem = gallery.one_node_triangle()
    for root in enumerate_roots(problem, 5.0):
        path = follow(problem, root, direction, (0, 20))
        # det [grad H; tangent'] has the sign of index times d alpha
        assert np.sign(path.alpha[1] - path.alpha[0]) == direction * root.index


def test_example_6_2_is_one_branch():
    problem = gallery.get("one-node-6.2").build()
    path = follow(problem, newton(problem, 20.0), -1, (0, 20))
    (transition,) = path.transitions
    assert transition.alpha == pytest.approx(14 / 3, abs=1e-12)
    assert not path.folds
    assert path.alpha[-1] == 0


def test_example_6_3_goes_down_the_vertical_segment():
    problem = gallery.get("one-node-6.3").build()
    path = follow(problem, newton(problem, 5.0, [1.0, -2.0]), -1, (0, 20))
    assert names(path) == [("stick",), ("slip-",), ("open",)]
    assert [t.alpha for t in path.transitions] == pytest.approx([2, 2], abs=1e-9)
    assert [t.local_test.exists for t in path.transitions] == [False, False]
    vertical = [point for point in path if point.statuses[0].value == "slip-"]
    assert len(vertical) > 5
    assert {round(point.alpha, 9) for point in vertical} == {2.0}


def test_example_6_3_lists_all_tangents_at_the_bifurcation():
    problem = gallery.get("one-node-6.3").build()
    start = (2.0, [0.0], [0.0])
    tangents = start_tangents(problem, start, (0, 20))
    assert sorted(round(t.dalpha, 9) + 0.0 for t in tangents) == [-1, 0, 1]
    assert len(refusal(AmbiguousStart, "tangent=k", follow, problem, start, 1, (0, 20)).tangents) == 3
    up = next(k for k, t in enumerate(tangents) if abs(t.dalpha) < 1e-9)
    path = follow(problem, start, 1, (0, 20), tangent=up)
    assert names(path) == [("slip-",), ("stick",)]
    assert path.alpha[-1] == 20


def test_perturbed_example_6_3_has_its_fold_where_the_closed_form_puts_it():
    problem = gallery.get("one-node-6.3-perturbed").build()
    (fold,) = follow(problem, root_in("stick", problem, 5.0), -1, (0, 20)).folds
    assert fold.alpha == pytest.approx(2 / 0.98, abs=1e-12)


CLOSED = closed_branch()
STICKING = root_in("stick", CLOSED, 0.1)


def test_closed_branch_is_recognised():
    for direction in (1, -1):
        path = follow(CLOSED, STICKING, direction, (-3, 3), ContinuationOptions(alpha_scale=1.0))
        assert path.closed
        assert "closed" in path.message
        assert sorted(t.alpha for t in path.folds) == pytest.approx([-np.sqrt(0.5), np.sqrt(0.5)], abs=1e-12)
        assert path[-1].lambda_n == pytest.approx(path[0].lambda_n, abs=1e-12)
        assert path.alpha[-1] == pytest.approx(0.1, abs=1e-12)
        assert on_solutions(CLOSED, path) < 1e-12


def test_closed_branch_from_its_fold():
    path = follow(CLOSED, STICKING, 1, (-3, 3))
    start = path[path.folds[0].point]
    assert {t.orientation for t in start_tangents(CLOSED, start, (-3, 3))} == {1, -1}
    assert follow(CLOSED, start, 1, (-3, 3)).closed


def test_path_that_leaves_and_returns():
    stopped = follow(CLOSED, STICKING, 1, (-3, 0.5))
    assert (stopped.status, stopped.alpha[-1]) == ("interval left", 0.5)
    assert follow(CLOSED, STICKING, 1, (-3, 0.5), ContinuationOptions(overshoot=0.5)).closed


def test_arrival_at_a_visited_path():
    first = follow(CLOSED, STICKING, 1, (-3, 0.5))
    path = follow(CLOSED, root_in("slip-", CLOSED, 0.1), 1, (-3, 3), visited=[first])
    assert path.status == "visited"
    assert path[-1].lambda_n == pytest.approx(STICKING.lambda_n, abs=1e-10) or path[-1].kind == "transition"


def test_loading_path_is_piecewise_linear():
    problem = gallery.get("two-node-6.7-minus").build()
    path = follow(problem, enumerate_roots(problem, -3.0)[0], 1, (-3, 3))
    assert (path.alpha[-1], len(path.folds)) == (3, 2)
    inside = [k for k in range(1, len(path) - 1) if path.kinds[k] == "step" and path.kinds[k - 1] != "transition"]
    for k in inside:
        a, b, c = (np.append(path.lambda_n[j], path.alpha[j]) for j in (k - 1, k, k + 1))
        share = np.linalg.norm(b - a) / max(np.linalg.norm(c - a), 1e-30)
        assert b == pytest.approx(a + share * (c - a), abs=1e-9)


def test_smooth_path_closed_loop():
    problem = gallery.one_node_triangle(f=(1.0, -3.5))
    load, slope = (lambda a: np.array([1.0, -3.5 - 0.5 * a * a])), (lambda a: np.array([0.0, -a]))
    path_data = SmoothPath(F=lambda a: 4.0, dF=lambda a: 0.0, f=load, df=slope)
    root = newton(problem, 0.0, [1.0, -3.5], smooth_path=path_data)
    path = follow(problem, root, 1, (-3, 3), smooth_path=path_data)
    assert path.closed
    assert sorted(t.alpha for t in path.folds) == pytest.approx([-1, 1], abs=1e-9)
    assert on_solutions(problem, path, path_data) < 1e-11


def test_smooth_friction_agrees_with_the_affine_path():
    problem = gallery.one_node_triangle()
    root = newton(problem, 5.0, [1.5, -4.0])
    smooth = SmoothPath(F=lambda a: 2 + a**3, dF=lambda a: 3 * a * a)
    start = (3 ** (1 / 3), root.lambda_n, root.lambda_t)
    path = follow(problem, start, -1, (-1, 3), smooth_path=smooth)
    assert [t.alpha for t in path.folds] == pytest.approx([(2 / 3) ** (1 / 3)], abs=1e-9)


def test_smooth_friction_that_ends_is_named():
    problem = gallery.one_node_triangle()
    smooth = SmoothPath(F=lambda a: 1 - a, dF=lambda a: -1.0)
    path = follow(problem, (0.0, [0.0], [0.0]), 1, (0, 3), smooth_path=smooth)
    assert (path.status, path.alpha[-1]) == ("friction", pytest.approx(1, abs=1e-4))


def test_without_an_interval_friction_bounds_alpha():
    path = follow(gallery.one_node_triangle(), (5.0, [0.0], [0.0]), -1)
    assert (path.status, path.alpha[-1]) == ("interval left", 0)


def test_smooth_path_that_is_none_is_named():
    problem, start = gallery.one_node_triangle(), (2.0, [0.0], [0.0])
    bad_argument("has neither F nor f", SmoothPath)
    for given in ({"F": abs}, {"df": abs}, {"F": abs, "dF": abs, "f": abs}):
        bad_argument("has a function without its derivative", SmoothPath, **given)
    negative = SmoothPath(F=lambda a: 1 - a, dF=lambda a: -1.0)
    message = r"SmoothPath\.F gives -1 for contact node 0 at alpha = 2; expected F >= 0"
    bad_argument(message, follow, problem, start, 1, (1, 3), smooth_path=negative)


def test_derivatives_are_not_compared_at_the_border_of_the_domain():
    """Friction sqrt(alpha) from 0 on, beyond which there is none."""
    root = lambda a: np.sqrt(a) if a >= 0 else np.nan  # noqa: E731
    smooth = SmoothPath(F=root, dF=lambda a: 0.5 / np.sqrt(max(a, 1e-12)))
    problem = gallery.one_node_triangle()
    path = follow(problem, (0.0, [0.0], [0.0]), 1, (0, 3), smooth_path=smooth)
    assert (path.status, path.alpha[-1]) == ("interval left", 3)


def test_smooth_path_wrong_derivative_is_named():
    problem = gallery.one_node_triangle()
    smooth = SmoothPath(F=lambda a: a * a, dF=lambda a: a)
    bad_argument(r"SmoothPath\.dF at alpha = 2", follow, problem, (2.0, [0.0], [0.0]), 1, (1, 3), smooth_path=smooth)


@pytest.mark.few(4, 2)
@pytest.mark.parametrize("loading", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_points_are_enumerated_roots(seed, loading):
    problem = stable_problem(seed, loading)
    interval = (-4.0, 4.0) if loading else (0.0, 10.0)
    rng = np.random.default_rng(seed)
    for root in enumerate_roots(problem, 1.7, method="exhaustive"):
        for direction in (1, -1):
            path = follow(problem, root, direction, interval)
            assert path.status in ("interval left", "closed")
            assert on_solutions(problem, path) < 1e-8
            for k in rng.choice(len(path), size=2):
                found = enumerate_roots(problem, float(path.alpha[k]))
                assert min(np.max(np.abs(r.lambda_n - path.lambda_n[k])) for r in found) < 1e-5 or found.families


@pytest.mark.parametrize("seed", range(6))
def test_a_path_can_be_walked_back(seed):
    problem = stable_problem(seed, loading=True)
    for root in enumerate_roots(problem, 0.3):
        there = follow(problem, root, 1, (-4, 4))
        back = follow(problem, there[-1], -1, (-4, 4), visited=[there])
        one, two = ([t.alpha for t in path.transitions] for path in (there, back))
        assert two[: len(one)] == pytest.approx(one[::-1][: len(two)], abs=1e-8)


@pytest.mark.parametrize("r", [1e-2, 1e2])
def test_r_does_not_change_the_branch(r):
    problem = stable_problem(5)
    for root in enumerate_roots(problem, 5.0):
        one = follow(problem, root, 1, (0, 20))
        two = follow(problem, root, 1, (0, 20), ContinuationOptions(r=r))
        assert [t.alpha for t in one.transitions] == pytest.approx([t.alpha for t in two.transitions], abs=1e-8)
        assert names(one) == names(two)


def test_units_do_not_change_the_path():
    problem = stable_problem(5, loading=True)
    force, length, time = 3.7e6, 2.9e-4, 1.3e2
    data = {"A": problem.A * force / length, "f": problem.f * force, "load_slope": problem.load_slope * force / time}
    scaled = problem.replace(**data)
    root = enumerate_roots(problem, 1.0)[0]
    one = follow(problem, root, 1, (-5, 5))
    start = (time * 1.0, root.lambda_n * force, root.lambda_t * force)
    two = follow(scaled, start, 1, (-5 * time, 5 * time))
    assert len(one) == len(two)
    assert two.alpha / time == pytest.approx(one.alpha, abs=1e-7)
    assert two.lambda_n / force == pytest.approx(one.lambda_n, abs=1e-6)
    assert two.arclength == pytest.approx(one.arclength, abs=1e-6)


def test_point_where_four_selections_meet():
    problem = gallery.get("chain-2").build()
    root = next(r for r in enumerate_roots(problem, 5.0) if [s.value for s in r.statuses] == ["stick", "stick"])
    path = follow(problem, root, -1, (0, 6))
    assert path.status == "interval left"
    (transition,) = path.transitions
    assert transition.alpha == pytest.approx(8 / 3, abs=1e-10)
    assert len(transition.alternatives) == 2
    assert len(transition.local_test.signs) == 4
    other = follow(problem, root, -1, (0, 6), ContinuationOptions(choose=lambda tangents: len(tangents) - 1))
    assert names(other)[-1] != names(path)[-1] or len(transition.alternatives) == 2


@pytest.mark.slow
def test_large_sparse_problem_is_factorised_once(monkeypatch):
    calls, splu = [], factorization.splu
    monkeypatch.setattr(factorization, "splu", lambda *a, **k: calls.append(1) or splu(*a, **k))
    problem = gallery.clamped_block(200, 50, contact=40, traction=(-0.3, -1.0))
    assert problem.n > 20_000
    path = follow(problem, newton(problem, 0.5), -1, (0.2, 3.0))
    assert path.status == "interval left"
    assert len(path.transitions) > 10
    assert len(calls) == 1


def test_printed_algorithm_passes_the_fold_with_short_steps():
    problem = gallery.one_node_triangle()
    options = ContinuationOptions(check_steps=False, h_max=0.05)
    path = follow(problem, newton(problem, 5.0, [1.5, -4.0]), -1, (0, 20), options)
    assert path.alpha[-1] == 20
    assert len(path.folds) == 1
    assert on_solutions(problem, path) < 1e-5


@pytest.mark.few(1, 0)
@pytest.mark.parametrize("name", ["two-node-6.4", "two-node-6.7-minus"])
def test_printed_algorithm_passes_folds_that_its_corrections_overstepped(name):
    problem = gallery.get(name).build()
    options = ContinuationOptions(check_steps=False, h_max=0.1)
    alpha, interval = (-3.0, (-3, 3)) if "6.7" in name else (10.0, (0, 10))
    root = enumerate_roots(problem, alpha)[-1]
    path = follow(problem, root, 1 if "6.7" in name else -1, interval, options)
    checked = follow(problem, root, path.orientation, interval)
    assert path.status == "interval left"
    assert [t.alpha for t in path.folds] == pytest.approx([t.alpha for t in checked.folds], abs=1e-9)


def test_printed_algorithm_ends_on_a_solution_after_a_jump():
    # a long step beyond the fold converges to the open branch, and its end outside the interval is cut
    problem = gallery.one_node_triangle()
    root = enumerate_roots(problem, 11.333833333333333)[-1]
    path = follow(problem, root, -1, (0, 20), ContinuationOptions(check_steps=False, h_max=0.1))
    assert path.status == "interval left"
    assert on_solutions(problem, path) < 1e-5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"direction": 2}, "direction is 2"),
        ({"interval": (3, 1)}, r"interval is \(3, 1\)"),
        ({"interval": (-1, 9)}, "contact node 0"),
        ({"interval": (6, 9)}, "outside the interval"),
        ({"start": (5.0, [1.0], [0.0])}, "not a root"),
        ({"start": 5.0}, "start is a float"),
        ({"tangent": 7}, "tangent is 7"),
    ],
)
def test_bad_arguments(arguments, message):
    problem = gallery.one_node_triangle()
    given = {"start": (5.0, [0.0], [0.0]), "interval": (0, 20)} | arguments
    bad_argument(message, follow, problem, **given)


@pytest.mark.parametrize(
    "bad", [{"h_min": 0}, {"h_init": 9}, {"k_thr": 20}, {"r": -1}, {"h_dec": 1}, {"transition_tolerance": 1}]
)
def test_bad_options(bad):
    bad_argument(f"options.{next(iter(bad))}", ContinuationOptions, **bad)
