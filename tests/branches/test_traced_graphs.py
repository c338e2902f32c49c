"""The graph from balls is that from exact algebra, or says where it is not decided."""

from fractions import Fraction

import numpy as np
import pytest
from arc_oracle import ArcOracle, claims
from branches.test_degenerate import pair
from branches.test_lower_bounds import padded
from complete import accepted_report, proven_graph, whole_graph
from flint import fmpz_mat
from generators import through_the_unloaded_state, vanishing_problem
from parted_meshes import grid, moved
from path_problems import (
    generic_problem,
    grazing_problem,
    integer_problem,
    mirrored_problem,
    planted_corner,
    sheet_of_one_node,
    together,
    uncoupled,
    without_friction_somewhere,
)
from proof_tools import records_of
from two_graphs import differences, steps, two_graphs

from enumsol import ContactProblem, branch_graph, enumerate_roots, fem, gallery, verify
from enumsol.branches import ways
from enumsol.branches.enclosed import tracing
from enumsol.condensation.exact import ExactCondensed
from enumsol.trusted.arcs.taylor import AlphaFunctions

KINDS = ("friction", "load", "both")


def generic(rng, p, kind):
    return generic_problem(rng, p, kind), (0.0, 6.0)


def between_fractions(rng, p, kind):
    return generic_problem(rng, p, kind), (Fraction(1, 3), Fraction(22, 7))


def over_a_short_interval(rng, p, kind):
    start = float(rng.uniform(0.0, 6.0))
    return generic_problem(rng, p, kind), (start, start + 10.0 ** -int(rng.integers(2, 13)))


def over_a_long_interval(rng, p, kind):
    return generic_problem(rng, p, kind), (0.0, 10.0 ** int(rng.integers(2, 9)))


def in_other_units(rng, p, kind):
    problem = generic_problem(rng, p, kind)
    stiff, load = (2.0 ** int(rng.integers(-150, 151)) for _ in range(2))
    data = {"gap": load / stiff * problem.gap, "friction": problem.friction, "friction_slope": problem.friction_slope}
    if problem.load_slope is not None:
        data["load_slope"] = load * problem.load_slope
    A = stiff * problem.A.toarray()
    return ContactProblem(A, problem.Bn, problem.Bt, load * problem.f, **data), (0.0, 6.0)


def partly_without_friction(rng, p, kind):
    return without_friction_somewhere(rng, p, kind), (0.0, 5.0)


def unloaded_somewhere(rng, p, kind):
    """Load and gap vanish together inside the interval or at one of its ends."""
    zero = Fraction(int(rng.integers(-3, 4)), int(rng.choice((1, 2, 3, 5))))
    ends = ((0, 2), (-2, 0), (-2, 2), (-1, Fraction(7, 3)))[int(rng.integers(4))]
    F0, F1 = (float(rng.integers(0, 4)), 0.0) if kind == "load" else (6.0, float(rng.choice((-0.5, 1.0))))
    problem = vanishing_problem(rng, p, zero, inner=int(rng.integers(0, 3)), friction=F0, friction_slope=F1)
    return problem, tuple(zero + end for end in ends)


def small_integers(rng, p, kind):
    return integer_problem(rng, p, kind), (-3, 3) if kind == "load" else (0, 4)


def mirrored(rng, p, kind):
    return mirrored_problem(rng, load=kind != "friction"), (0, 6)


def corner(rng, p, kind):
    return planted_corner(rng, p, kind), (0, 4)


def corner_at_an_end(rng, p, kind):
    end = int(rng.integers(1, 5))
    problem = planted_corner(rng, p, kind, at=float(end))
    return problem, (end, end + 2) if rng.random() < 0.5 else (0, end)


def at_the_same_alpha(rng, p, kind):
    return together(rng, nodes=max(p, 2)), (0, 6)


def nearly_at_the_same_alpha(rng, p, kind):
    push = float(rng.choice((-1, 1))) * 10.0 ** -int(rng.integers(3, 18))
    return together(rng, nodes=max(p, 2), push=push), (0, 6)


def grazing(rng, p, kind):
    return grazing_problem(rng, p), (0, 4)


#: Families of problems, numbers of them, whether all are decided (None: some are), and most boxes of a trace. What
#: stays open stays so for any number of boxes, and takes most of the time.
FAMILIES = {
    generic: (80, True, 200),
    between_fractions: (50, True, 200),
    over_a_short_interval: (60, True, 200),
    over_a_long_interval: (15, None, 20),
    in_other_units: (50, True, 200),
    partly_without_friction: (60, True, 200),
    unloaded_somewhere: (120, None, 20),
    small_integers: (50, None, 12),
    mirrored: (20, None, 12),
    corner: (30, None, 12),
    corner_at_an_end: (20, False, 12),
    at_the_same_alpha: (8, False, 12),
    nearly_at_the_same_alpha: (10, None, 20),
    grazing: (5, False, 6),
}


by_family = pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)


@pytest.mark.few(0, 1)
@by_family
def test_graphs_from_balls_are_those_from_exact_algebra(family, monkeypatch):
    count, decided, _ = FAMILIES[family]
    found = {graphs.doubts == [] for graphs in _compared(family, range(count // 2), monkeypatch)}
    assert found == ({True, False} if decided is None else {decided})


@pytest.mark.long
@by_family
def test_many_graphs(family, monkeypatch):
    count, *_ = FAMILIES[family]
    assert len(list(_compared(family, range(count // 2, count), monkeypatch))) == count - count // 2


def _compared(family, seeds, monkeypatch):
    monkeypatch.setattr(tracing, "_MOST_BOXES", FAMILIES[family][2])
    for seed in seeds:
        rng = np.random.default_rng(seed)
        problem, interval = family(rng, int(rng.integers(1, 4)), KINDS[seed % 3])
        graphs = two_graphs(problem, interval)
        assert differences(graphs) == [], seed
        if not graphs.doubts:
            ours, theirs = steps(graphs)
            assert ours == theirs, seed
            assert [len(part) for part in graphs.exact[:2]] == [len(part) for part in graphs.traced[:2]]
        yield graphs


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("push", [0.0, 1e-16, 1e-12, 1e-6, 1e-3])
def test_a_pitchfork_is_left_open(push):
    graphs = two_graphs(pair(push), (0, 6))
    assert differences(graphs) == []
    # a determinant vanishes there together with a condition, whatever the load
    assert any(low <= 3 <= high for low, high, _ in graphs.open)
    assert 1.0 + push == 1.0 or all(high - low < 1e-6 for low, high, _ in graphs.open)


@pytest.mark.slow
def test_exact_algebra_that_would_take_too_long_is_not_begun(monkeypatch):
    problem = padded(pair(0.0), 28)
    exactly = whole_graph(problem, (0.0, 6.0))
    assert [v.alpha for v in exactly.vertices if v.kind == "bifurcation"] == [3.0]
    monkeypatch.setattr(ways, "LARGEST_EXACT_WORK", 0)
    graph = branch_graph(problem, (0.0, 6.0))
    assert not graph.complete
    told = [reason for reason in graph.reasons if "is not decided: " in reason]
    assert told
    assert all(reason.endswith('; arithmetic="exact" decides it, which may take long') for reason in told)
    left = [v.enclosure for v in graph.vertices if v.kind == "unsettled"]
    assert any(low <= 3 <= high for low, high in left)
    # what is said elsewhere is the same
    alphas = np.linspace(0.125, 5.875, 24).tolist()
    elsewhere = [alpha for alpha in alphas if not any(low <= alpha <= high for low, high in left)]
    assert len(elsewhere) > 12
    assert all(graph.at_least(alpha) == exactly.multiplicity_at(alpha) for alpha in elsewhere)
    assert not verify(problem, graph.proof).complete


def test_families_and_sheets_are_left_open(monkeypatch):
    monkeypatch.setattr(tracing, "_MOST_BOXES", 12)
    for loads in ([1.0, -2.0], [1.0, -2.0]), ([1.0, -2.0], [1.5, -4.0]):
        graphs = two_graphs(uncoupled(*loads), (0.0, 4.0))
        assert differences(graphs) == []
        assert any(low <= 2 <= high for low, high, _ in graphs.open)
    graphs = two_graphs(sheet_of_one_node(), (0.25, 1.0))
    assert differences(graphs) == []
    assert any(low <= 0.25 and high >= 1 for low, high, _ in graphs.open)


def test_the_unloaded_state_joins_both_sides():
    graphs = two_graphs(*through_the_unloaded_state())
    assert differences(graphs) == []
    assert graphs.doubts == []
    assert 0.0 in [v.alpha for v in graphs.traced[0]]


def test_without_any_load_there_is_nothing_to_trace():
    problem = uncoupled([0.0, 0.0], [0.0, 0.0])
    graph = whole_graph(problem, (0.0, 2.0))
    assert len(graph.arcs) == 1
    # a load inside the body alone, which cancels on the way to the contact nodes, gives no proof that is not whole
    assert graph.proof is None or accepted_report(problem, graph.proof)


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", [3, 17, 39])
def test_boxes_far_from_zero_may_be_long(seed):
    rng = np.random.default_rng(seed)
    problem, interval = over_a_long_interval(rng, int(rng.integers(1, 4)), KINDS[seed % 3])
    graphs = two_graphs(problem, interval)
    assert all(high - low < 1e-3 for low, high, _ in graphs.open)
    assert differences(graphs) == []


def test_what_exact_algebra_costs_grows_with_the_digits_of_determinants():
    ratios = []
    for problem, slip in ((gallery.wedge(3, 2), 3), (gallery.dovetail(2, 1), 6), (gallery.dovetail(2, 1), 3)):
        codes = (2,) * slip + (0,) * (problem.p - slip)
        S = ExactCondensed.from_problem(problem).integers.rows
        digits = fmpz_mat([[S[i][j] for j in range(slip)] for i in range(slip)]).det().bit_length()
        ratios.append(ways._exact_work(problem, {codes}) / ((slip + 1) * slip**3 * digits))
    assert max(ratios) < 1.5 * min(ratios)


@pytest.mark.slow
def test_many_digits_decide_long_boxes():
    """Beside a fold of a slender body doubles do not suffice: many digits go on from there, in boxes that grow."""
    problem = gallery.taper(4, 4, (5.0, 50.0))
    graph = proven_graph(problem, (0, 0.4))
    assert graph.arcs_by == "balls"
    for alpha in (0.1, 0.15, 0.18, 0.3, 0.4):
        assert graph.multiplicity_at(alpha) == len(enumerate_roots(problem, alpha))


@pytest.mark.slow
def test_places_that_need_many_digits_are_decided_beyond_250_degrees_of_freedom():
    """Four selections meet within 3e-7 of alpha; before, digits beyond double arithmetic ended at n = 250."""
    problem = gallery.wedge(26, 4, half_angle=10.0)
    graph = proven_graph(problem, (0.0, 3.0))
    assert problem.n == 270
    for alpha in (0.2, 0.3625, 0.3635, 1.5):
        assert graph.multiplicity_at(alpha) == len(enumerate_roots(problem, alpha))


def jamming(cells, kind, angle, spring, seed):
    """A trapezoid on weak springs, pressed in between two flanks; for seed 0 it is symmetric."""
    mesh = grid(*cells, kind, shake=0.04 if seed else 0.0, seed=seed)
    height = 8.0 / np.tan(np.radians(angle))
    mesh = moved(mesh, lambda at: np.stack([(at[:, 0] - 0.5) * (30.0 - 16.0 * at[:, 1]), at[:, 1] * height], axis=1))
    return fem.mesh_problem(
        mesh,
        young=210e3,
        poisson=0.3,
        contact=["left", "right"],
        load={"top": (0.0, -1.0)},
        spring={"bottom": (spring, spring)},
        gap=-0.01,
        friction=0.0,
        friction_slope=1.0,
    )


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_boxes_are_long_where_a_body_is_about_to_jam(seed):
    """Determinants nearly vanish at F = tan(57.5 degrees): boxes were a hundredth as long as far from it."""
    problem = jamming((4, 4), 3, 57.5, 1e-3, seed)
    graph = proven_graph(problem, (1.55, 1.8))
    assert graph.arcs_by == "balls"
    assert [v.kind for v in graph.vertices].count("fold") == 1
    for alpha in (1.5697, 1.65, 1.7, 1.75):
        assert graph.multiplicity_at(alpha) == len(enumerate_roots(problem, alpha))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cells", "interval", "near"),
    [
        ((3, 2), (1.0001, 1.0003), 1.000195),
        pytest.param((4, 3), (0.0, 3.0), 1.0001375, marks=pytest.mark.long),
    ],
)
def test_where_a_symmetric_body_loses_its_symmetry_both_sides_are_told_apart(cells, interval, near):
    """The determinant of one selection vanishes there, and its conditions nearly do: within the matrices' rounding."""
    problem = gallery.dovetail(*cells)
    graph = proven_graph(problem, interval)
    assert graph.arcs_by == "balls"
    first, second = (vertex for vertex in graph.vertices if abs(vertex.alpha - near) < 1e-7)
    assert {first.kind, second.kind} == {"fold", "transition"}
    assert second.alpha - first.alpha < 1e-11
    before, beyond = first.alpha - 1e-8, second.alpha + 1e-8
    assert (graph.multiplicity_at(before), graph.multiplicity_at(beyond)) == (1, 3)
    for alpha in (before, beyond, float(interval[1])):
        assert graph.multiplicity_at(alpha) == len(enumerate_roots(problem, alpha))


@pytest.mark.few(1, 1)
@pytest.mark.parametrize(
    ("cells", "spring", "seed"), [((1, 2), 1e-3, 1), ((1, 3), 1e-3, 1), ((2, 2), 1e-3, 1), ((2, 2), 1e-2, 0)]
)
def test_what_is_said_beside_zeros_of_determinants_is_true(cells, spring, seed, monkeypatch):
    monkeypatch.setattr(ways, "FAST_EXACT_DOF", 0)
    monkeypatch.setattr(ways, "LARGEST_EXACT_WORK", 0)
    found = []
    whole = AlphaFunctions.expansion

    def expanded(self, *ends):
        expansion = whole(self, *ends)
        found.append(expansion if self.g[0].ncols() == 2 else None)
        return expansion

    monkeypatch.setattr(AlphaFunctions, "expansion", expanded)
    problem = jamming(cells, 4, 45.0, spring, seed)
    graph = whole_graph(problem, (0.8, 2.0))
    assert any(found)
    judge = ArcOracle(problem)
    assert [claim for claim in claims(records_of(graph.proof)) if not judge.is_true(*claim)] == []
