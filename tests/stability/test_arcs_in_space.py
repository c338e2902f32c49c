"""Verdicts along arcs in 3D, where directions of slip turn: closed forms of one node, and the judge's at alphas."""

from collections import Counter

import numpy as np
import pytest
from growing_motions import of_a_root

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.branches.space.slip_directions import SlipDirections
from enumsol.trusted.motions_of_body import BodyMotions, reciprocal
from enumsol.trusted.status_rows import OPEN as NO_FORCE, STICK

QUIET, AWAY, OPEN = "does not run away", "runs away", "undecided"
#: Stiffness and mass of a node: along both tangents, and of either tangent with the normal.
STIFF, COUPLED, MASS, MASSES = 2.0, np.array([0.4, 0.0]), 1.0, np.array([0.9, 0.0])


def one_node(load, slope, F, F_slope=0.0):
    """A node that slides along its load, since its stiffness is the same in all tangential directions."""
    A, M = np.diag([5.0, STIFF, STIFF]), np.diag([4.0, MASS, MASS])
    A[0, 1:] = A[1:, 0] = COUPLED
    M[0, 1:] = M[1:, 0] = MASSES
    rows = np.eye(3)
    return enumsol.ContactProblem3D(
        A, *np.split(rows, 3), load, load_slope=slope, friction=F, friction_slope=F_slope, mass=M
    )


def square_of_rate(d, F):
    """mu of the only motion that may grow, if it is positive: L(mu) = T'(A + mu M) R is affine in mu."""
    return -(STIFF - F * COUPLED @ d) / (MASS - F * MASSES @ d)


def sliding_arc(problem, interval):
    graph = enumsol.branch_graph(problem, interval)
    assert graph.complete
    arc = max((arc for arc in graph.arcs if {str(of) for of in arc.statuses} == {"slip"}), key=lambda arc: arc.length)
    return graph, arc, graph.stability()[arc.number]


@pytest.fixture(scope="module")
def turning():
    """The load turns from (1, -1/2) to (1, 2), and the node with it."""
    return sliding_arc(one_node([0.4, 1, 0], [0, 0, 1], 1.5), (-0.5, 2))


def test_the_alpha_at_which_a_turning_node_no_longer_runs_away_is_enclosed(turning):
    _, _, spans = turning
    # m = F m_c'd
    change = np.sqrt((1.5 * MASSES[0] / MASS) ** 2 - 1)
    assert [span.verdict for span in spans] == [AWAY, OPEN, QUIET]
    assert (spans[0].low, spans[-1].high) == (-0.5, 2)
    assert spans[1].low < change < spans[1].high < spans[1].low + 2.5 * 2.0**-9


def test_growth_rates_along_it_are_those_of_the_closed_form(turning):
    _, _, spans = turning
    for alpha in np.linspace(spans[0].low, spans[0].high, 9):
        d = np.array([1, alpha]) / np.hypot(1, alpha)
        low, high = spans[0].growth
        assert low <= np.sqrt(square_of_rate(d, 1.5)) <= high


def holds_direction(found, d):
    """True if some positive multiple of d lies in the ball of the only node."""
    low, high = found.mid[0] - found.rad[0], found.mid[0] + found.rad[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort([low / d, high / d], axis=0)
    kept = np.where(d != 0, ends, [[-np.inf], [np.inf]])
    inside = np.all((d != 0) | ((low <= 1e-15) & (high >= -1e-15)))
    return bool(inside and max(kept[0].max(), 0) <= kept[1].min() * (1 + 1e-14))


def test_directions_are_enclosed_over_any_range(turning):
    graph, arc, _ = turning
    directions = SlipDirections(arc, graph.arcs)
    rng = np.random.default_rng(1)
    for width in (2.5, 0.5, 0.1, 1e-2, 1e-5, 1e-9):
        low = rng.uniform(-0.5, 2 - width)
        found = directions.over(low, low + width)
        assert all(holds_direction(found, np.array([1, alpha])) for alpha in np.linspace(low, low + width, 7))
        assert not holds_direction(found, np.array([1, low - width - 0.1]))
        if width <= 0.1:
            assert np.max(found.rad) <= 2 * width + 1e-9
    assert directions.over(3.5, 4) is None


def test_a_node_whose_friction_grows_with_alpha():
    """It slides one way, and runs away from the alpha on at which F m_c'd = m."""
    _, _, spans = sliding_arc(one_node([0.4, 1, 0], [0, 0, 0], 0.5, 0.25), (0, 5))
    change = (MASS / MASSES[0] - 0.5) / 0.25
    assert [span.verdict for span in spans] == [QUIET, OPEN, AWAY]
    assert spans[1].low < change < spans[1].high < spans[1].low + 5 * 2.0**-9
    for alpha in np.linspace(spans[2].low, spans[2].high, 5):
        low, high = spans[2].growth
        assert low <= np.sqrt(square_of_rate(np.array([1, 0]), 0.5 + 0.25 * alpha)) <= high


def test_a_wedge_from_a_fold_to_the_end_of_the_interval(tmp_path):
    """Two patches slide; at the fold both stick at once."""
    graph = enumsol.branch_graph(enumsol.gallery.get("wedge3d-2-3").build(), (0.84, 0.9))
    assert [vertex.kind for vertex in graph.folds] == ["fold"]
    found = {tuple(map(str, arc.statuses)): spans for arc, spans in zip(graph.arcs, graph.stability(), strict=True)}
    assert {kind[0]: [span.verdict for span in spans] for kind, spans in found.items()} == {
        "slip": [AWAY],
        "stick": [QUIET],
        "open": [QUIET],
    }
    assert graph.to_frame().stability.tolist() == [span.verdict for spans in graph.stability() for span in spans]
    assert f"stability: {QUIET} (1 arc); {AWAY} (1 arc)" in repr(graph)
    words = [text.get_text() for legend in graph.plot(zoom=False).legends for text in legend.get_texts()]
    assert words[:2] == [QUIET, AWAY]
    # a loaded graph has the points of its arcs, and verdicts are proven from them again
    graph.save(tmp_path / "wedge.json")
    loaded = enumsol.BranchGraph.load(tmp_path / "wedge.json")
    assert loaded.verdicts_read
    assert [[(span.verdict, span.high) for span in spans] for spans in loaded.stability()] == [
        [(span.verdict, span.high) for span in spans] for spans in graph.stability()
    ]
    assert not loaded.verdicts_read


@pytest.mark.parametrize("rad", [0.0, 1e-12, 0.2, 0.4949, 0.495])
def test_a_reciprocal_of_friction_is_enclosed_however_wide_its_ball_is(rad):
    found = reciprocal(Ball(np.array(0.505), np.array(rad)))
    for F in (0.505 - rad, 0.505, 0.505 + rad):
        assert found.mid - found.rad <= 1 / F <= found.mid + found.rad
    for low in (0.0, -0.1):
        assert not reciprocal(Ball(np.array(0.5), np.array(0.5 - low))).finite


def test_a_node_that_touches_has_the_least_friction_of_both_axes():
    """Also where the axis whose middle is larger may have the smaller coefficient."""
    body = BodyMotions(one_node([0, 0, 0], [0, 0, 0], 0.5), at_rest=True)
    F = [Ball(np.array([mid]), np.array([rad])) for mid, rad in ((0.5, 0.01), (0.51, 0.4))]
    for axes in (F, F[::-1]):
        (setting,) = body.settings([{NO_FORCE, STICK}], axes, every=True)
        assert setting.motions.touching[0].F.low <= 0.11 + 1e-12


def random_body(rng):
    """One or two nodes that slide under a load that turns, with orthotropic friction that may change with alpha."""
    p = int(rng.integers(1, 3))
    n = 3 * p + int(rng.integers(0, 2))
    X, Y = rng.normal(size=(2, n, n))
    A, M = X @ X.T + 0.5 * np.eye(n), Y @ Y.T + 0.1 * np.eye(n)
    F = rng.choice([0.3, 0.8, 1.5, 3.0], size=p)
    ratio = rng.choice([1.0, 0.5, 2.0])
    change = rng.choice([0.0, 0.2]) * F
    w, lam = np.zeros((p, 3)), np.zeros((p, 3))
    for i in range(p):
        d = rng.normal(size=2)
        d /= np.linalg.norm(d)
        lam[i] = [1, *(F[i] * np.array([1, ratio]) * d)]
        w[i, 1:] = rng.uniform(0.1, 1) * d / [1, ratio]
    u = np.concatenate([np.ravel(w, order="F"), rng.normal(size=n - 3 * p)])
    rows = np.eye(n)
    f = A @ u + rows[: 3 * p].T @ np.ravel(lam, order="F")
    return enumsol.ContactProblem3D(
        A,
        rows[:p],
        rows[p : 2 * p],
        rows[2 * p : 3 * p],
        f,
        load_slope=rng.normal(size=n),
        friction=(F, ratio * F),
        friction_slope=(change, ratio * change),
        mass=M,
    )


def compared(seeds):
    """Verdicts along arcs against the judge's on roots of these arcs; lengths of what is decided and is not."""
    counts = Counter()
    for seed in seeds:
        rng = np.random.default_rng(seed)
        problem = random_body(rng)
        graph = enumsol.branch_graph(problem, (0, 0.3), max_nodes=1000)
        mass = problem.mass.toarray()
        for arc, spans in zip(graph.arcs, graph.stability(), strict=True):
            assert (spans[0].low, spans[-1].high) == (arc.lo, arc.hi)
            for span in spans:
                counts[span.verdict] += span.high - span.low
                for alpha in rng.uniform(span.low, span.high, 2) if span.high - span.low > 1e-6 else ():
                    near = arc.values(alpha)[0]
                    (root,) = [r for r in graph.roots_at(alpha) if np.allclose(r.lambda_n, near, rtol=1e-6)]
                    judged = of_a_root(problem, root, mass)
                    counts["compared"] += 1
                    if span.verdict != OPEN:
                        assert (span.verdict == AWAY) == bool(judged), (seed, alpha)
                    if span.growth is not None:
                        low, high = span.growth
                        assert any(low * (1 - 1e-6) <= np.sqrt(mu) <= high * (1 + 1e-6) for mu, *_ in judged)
    return counts


def test_random_bodies():
    counts = compared([(2, k) for k in (8, 21, 29)])
    assert counts[OPEN] <= 0.02 * (counts[AWAY] + counts[QUIET]) + 1e-3, counts
    assert counts["compared"] >= 4, counts


@pytest.mark.long
def test_many_random_bodies():
    counts = compared([(2, k) for k in range(60)])
    # about 2 % of all arcs, where ranges of alpha would have to be shorter than are tried
    assert counts[OPEN] <= 0.04 * (counts[AWAY] + counts[QUIET]), counts
    assert min(counts[AWAY], counts[QUIET]) > 0, counts
