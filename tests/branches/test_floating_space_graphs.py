"""Graphs in 3D of bodies that nothing holds (theory, section 14.14)."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from alike import assert_same
from complete import accepted_report, all_roots, complete_report, only_root, proven_graph, read_back, whole_graph
from helpers.floating_bodies import violation
from helpers.floating_space import floating_in_space, known_body, on_weak_springs, over_alpha, plane_over_alpha
from problems3d import cross
from proof_tools import proof_of, put, records_of, replaced, why_refused

import enumsol
from enumsol.condensation.enclosure import enclosure_of
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.model.sectors import SECTORS, direction, nearest
from enumsol.search.space.piece_proposals import AlphaPoint
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.sector_rows import CONTACT, NONNEGATIVE, OPEN, STICK, UNDECIDED, row_sign

INTERVAL = (-0.5, 0.5)


def assert_as_searched(problem, graph, alphas):
    """The roots of a graph are those of a search at one alpha, and solve the problem as it was given."""
    for alpha in alphas:
        found, known = graph.roots_at(alpha), all_roots(problem, alpha)
        assert found.complete
        assert graph.multiplicity_at(alpha) == len(found) == len(known)
        for root, other in zip(found, known, strict=True):
            assert (root.statuses, root.index) == (other.statuses, other.index)
            assert root.u == pytest.approx(other.u, abs=1e-8)
            assert violation(problem, alpha, root.u, root.lambda_n, root.lambda_t) < 1e-8


@pytest.mark.few(0, 3)
@pytest.mark.parametrize("seed", [24, 2, 3, 8, 30])
def test_all_solutions_of_random_bodies(seed):
    problem = over_alpha(seed)
    graph = proven_graph(problem, INTERVAL)
    assert repr(graph).endswith("complete: yes (proven, within rigid displacements of 30)")
    assert_as_searched(problem, graph, (-0.5, -0.17, 0.0, 0.31, 0.5))


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 6, 9, 12, 13, 17, 18, 19, 20, 22])
def test_all_solutions_of_more_random_bodies(seed):
    problem = over_alpha(seed)
    assert_as_searched(problem, proven_graph(problem, INTERVAL), np.linspace(-0.5, 0.5, 9).tolist())


def assert_same_places(graph, plane):
    """Vertices of a graph are those that exact algebra finds in the plane."""
    for one, other in zip(graph.vertices, plane.vertices, strict=True):
        assert (one.kind, one.bounded) == (other.kind, other.bounded)
        assert one.alpha == pytest.approx(other.alpha, abs=1e-7)
        assert one.lambda_n == pytest.approx(other.lambda_n, abs=1e-5)
    assert [arc.index for arc in graph.arcs] == [arc.index for arc in plane.arcs]
    assert graph.steps[1:] == plane.steps[1:]


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("seed", [1, 3, 6])
def test_bodies_of_the_plane_have_the_vertices_that_exact_algebra_finds(seed):
    plane = whole_graph(plane_over_alpha(seed), INTERVAL)
    for problem in (over_alpha(seed, plane=True), floating_in_space(plane.problem)):
        assert_same_places(whole_graph(problem, INTERVAL), plane)


@pytest.mark.slow
def test_a_curve_ends_where_the_body_has_moved_as_far_as_was_asked():
    plane = whole_graph(plane_over_alpha(24).replace(max_rigid_displacement=2.0), (-1, 1))
    assert [v.kind for v in plane.vertices] == ["end", "bound"]
    one_axis = over_alpha(24, plane=True).replace(max_rigid_displacement=2.0)
    for problem in (one_axis, floating_in_space(plane.problem)):
        graph = proven_graph(problem, (-1, 1))
        assert_same_places(graph, plane)
        end = graph.vertices[-1]
        low, high = end.enclosure
        assert high - low < 1e-8
        for alpha, count in ((low - Fraction(1, 10**6), 1), (high + Fraction(1, 10**6), 0), (1, 0)):
            assert graph.multiplicity_at(alpha) == len(all_roots(problem, alpha)) == count
        (root,) = graph.roots_at(low - Fraction(1, 10**6))
        assert np.max(np.abs(root.rigid_coordinates) / problem.modes.reach(2.0)) == pytest.approx(1, abs=1e-5)
        assert graph.claims.uniqueness().none_by == pytest.approx(end.alpha)


@pytest.fixture(scope="module")
def sliding():
    """A body of which one node touches, which slides away as it is pushed, and its graph."""
    problem = over_alpha(23)
    return problem, enumsol.branch_graph(problem, INTERVAL)


@pytest.mark.slow
def test_a_body_slides_at_one_alpha(sliding):
    """There alpha does not change along the curve, and nothing is said; on both sides all is known."""
    problem, graph = sliding
    assert not graph.complete
    ((low, high),) = graph.open_ranges
    assert high - low < 1e-8
    assert_as_searched(problem, graph, (-0.5, 0.0, low - Fraction(1, 10**5), high + Fraction(1, 10**5), 0.5))
    assert (graph.multiplicity_at(0), graph.multiplicity_at(0.5)) == (1, 0)
    report = accepted_report(problem, graph.proof)
    assert not report.complete
    assert report.within == problem.max_rigid_displacement
    farther = problem.replace(max_rigid_displacement=64 * problem.rigid_reach)
    assert [len(all_roots(farther, alpha)) for alpha in (-0.5, 0, 0.5)] == [1, 1, 0]


def pulled_off(seed=1):
    """A body that its load pulls away from all contact nodes."""
    problem = known_body(seed).problem
    away = 50 * (problem.Bn.sum(axis=0) @ problem.rigid_modes) @ problem.rigid_modes.T
    return problem.replace(f=problem.f - away, load_slope=0.1 * away)


def test_a_body_that_is_pulled_off_has_no_solution_at_any_alpha(tmp_path):
    problem = pulled_off()
    graph = proven_graph(problem, INTERVAL)
    assert (graph.vertices, graph.arcs, graph.multiplicity_at(0.25)) == ((), (), 0)
    assert len(enumsol.enumerate_roots(problem, 0.25)) == 0
    assert repr(read_back(graph, tmp_path / "graph.json")) == repr(graph)


def test_a_direction_of_imbalance_is_tested_at_every_alpha_of_a_piece():
    problem = pulled_off()
    graph = whole_graph(problem, INTERVAL)
    records = records_of(graph.proof)
    (place,) = (k for k, record in enumerate(records) if isinstance(record, list) and record[0] == "i")
    z = records[place][1]
    for forged in ([-x for x in z], [0.0] * len(z)):
        assert "may be in balance" in why_refused(problem, replaced(records, place, ["i", forged]))
    assert f"expected {len(z)} numbers" in why_refused(problem, replaced(records, place, ["i", [*z, 1.0]]))
    # at a part of the alphas of this interval forces are in balance
    pushed = problem.replace(load_slope=-40 * problem.load_slope)
    header = {**records[0], "problem": pushed.fingerprint}
    assert "may be in balance" in why_refused(pushed, [header, *records[1:]])


@pytest.fixture(scope="module")
def small():
    """A body with two contact nodes, and its graph."""
    problem = over_alpha(24)
    return problem, whole_graph(problem, INTERVAL)


@pytest.mark.slow
def test_files_frames_figures_and_workers(small, tmp_path):
    problem, graph = small
    complete_report(problem, graph.proof)
    read = read_back(graph, tmp_path / "graph.json")
    assert read.complete
    assert_same(read, graph, "problem.fingerprint", "steps")
    for one, other in zip(graph.arcs, read.arcs, strict=True):
        assert_same(one, other, "statuses")
        assert np.array_equal(np.concatenate(one.state(one.sample)), np.concatenate(other.state(other.sample)))
    assert_same(read.roots_at(0.25)[0], graph.roots_at(0.25)[0], "u", "rigid_coordinates")
    assert graph.roots_at(0.25).rigid_bound.needed
    assert len(graph.starting_points()) == 1
    graph.write_graphml(tmp_path / "graph.graphml")
    graph.plot(file=tmp_path / "graph.png")
    enumsol.write_report(graph, tmp_path / "graph.html")
    assert "within rigid displacements of 30" in (tmp_path / "graph.html").read_text(encoding="utf-8")
    with ThreadPoolExecutor(2) as pool:
        spread = whole_graph(problem, INTERVAL, executor=pool)
    assert_same(spread, graph, "steps")


def test_a_verified_graph_is_about_bounded_rigid_displacements(small):
    problem, graph = small
    report = enumsol.verify(problem, graph.proof)
    assert report.within == problem.rigid_reach == 30.0
    assert "within rigid displacements of 30" in repr(report)


@pytest.mark.slow
def test_bodies_on_weak_springs_tend_to_it(small):
    problem, graph = small
    for alpha in (-0.25, 0.4):
        (root,) = graph.roots_at(alpha)
        away = []
        for stiffness in (1e-3, 1e-4, 1e-5):
            held = only_root(on_weak_springs(problem, stiffness), alpha)
            away.append(np.max(np.abs(held.u - root.u)))
        assert away[0] > 5 * away[1] > 25 * away[2] > 0
        assert away[2] < 1e-3


def forgeries(records):
    """Records of proofs that say what is not so, and what is to be said of them."""
    last = records[-1]
    tree = records.index({"tree": True})
    places = {kind: [k for k in range(tree + 1, len(records) - 1) if records[k][0] == kind] for kind in ("x", "k", "r")}
    yield put(records, (0, "max_rigid_displacement"), 31.0), "bound of the rigid displacement"
    yield put(records, (0, "steps"), records[0]["steps"][:-1]), "numbers"
    yield put(records, (2, 1), records[2][1][:-1]), "numbers"
    # another rigid displacement at a point of the curve, and none there
    yield put(records, (2, 1, -2), records[2][1][-2] + 1.0), "not proven to be one"
    for place in [*places["k"], *places["r"]][:2]:
        yield replaced(records, place, ["n"]), "it is not proven to hold no root"
    for place in places["x"][:3]:
        yield replaced(records, place, ["x", [], "", ""]), "multipliers do not exclude it"
    curve = records[1]["curve"]
    yield [records[0], *records[tree:-1], {**last, "curves": 0, "arcs": 0}], "no box"
    parts = records.index({"parts": True})
    assert parts == 2 * curve + 3
    shorter = [records[0], {"curve": curve - 1}, *records[2 : parts - 2], *records[tree:]]
    yield shorter, "no box"


@pytest.mark.slow
def test_forged_proofs_are_refused(small):
    problem, graph = small
    records, tried = records_of(graph.proof), 0
    for forged, why in forgeries(records):
        assert why in why_refused(problem, forged), why
        tried += 1
    assert tried > 8
    assert enumsol.verify(problem, proof_of(records)).complete
    other = problem.replace(max_rigid_displacement=29.0)
    assert "another problem" in why_refused(other, records)


def _status(known, node, rng):
    """A code of a node, complete or not, that the known solution has with room, or None."""
    force, F = known.lambda_n[node], np.array(known.problem.friction).T[node]
    if rng.random() < 0.4:
        return UNDECIDED
    if force == 0:
        return OPEN
    if rng.random() < 0.4:
        return CONTACT
    tau = known.lambda_t[node] / F / force
    if np.hypot(*tau) < 0.99:
        return STICK
    number = nearest(*tau, 4)
    return next(
        SECTORS + n
        for n in (number, 16 + (number - 17) % 16)
        if cross(direction(n), tau) >= 0 <= cross(tau, direction(16 + (n - 15) % 16))
    )


def test_what_holds_a_solution_somewhere_in_a_piece_is_not_excluded():
    """Whatever the multipliers are, random ones and those of relaxations at other alphas."""
    tried = 0
    for seed in range(8):
        known, rng = known_body(seed), np.random.default_rng(seed)
        problem = known.problem.replace(load_slope=0.3 * rng.normal(size=known.problem.n))
        ones = np.ones(problem.p)
        space = AlphaSpace(enclosure_of(problem), Fraction(1, 8), (ones, ones))
        piece = AlphaPiece(space, Fraction(-1, 8), Fraction(int(rng.integers(0, 3)), 8))
        for _ in range(6):
            codes = tuple(_status(known, node, rng) for node in range(problem.p))
            proposals = []
            for alpha in (piece.low, piece.middle, piece.high):
                point = AlphaPoint(space, alpha)
                proposals.append(point.multipliers(point.root(codes)))
            for rows, values in proposals:
                signs = np.array([row_sign(codes[row[1]], row) for row in rows], dtype=int)
                for scale in (0.0, 0.1, 1.0):
                    pair = [values * (1 + scale * rng.normal(size=len(rows))) for _ in range(2)]
                    pair = [np.where(signs == NONNEGATIVE, np.abs(part), part) for part in pair]
                    assert not piece.margin(codes, rows, (pair[0], pair[1])) > 0
                    tried += 1
            assert not any(piece.is_unbalanced(codes, z) for z in rng.normal(size=(10, problem.modes.r)))
    assert tried > 300
