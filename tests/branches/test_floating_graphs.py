"""Graphs of bodies that nothing holds, against an oracle in rationals that condenses nothing."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from alike import assert_same
from complete import accepted_report, read_back, whole_graph
from helpers.floating_bodies import held_by_springs, pushed_block, violation
from helpers.floating_oracle import Oracle, block_on_table, random_body
from helpers.proof_tools import copied, multipliers, of_kind, proof_of, records_of, replaced, with_multipliers
from rational_checker import check_records
from rational_forms import Refused
from two_graphs import differences, two_graphs

import enumsol
from enumsol import fem
from enumsol.branches import ways


def varying(seed):
    """A random body of which load or friction depend on alpha."""
    problem = random_body(seed)
    if problem.load_slope is None and not np.any(problem.friction_slope):
        slope = np.random.default_rng(seed + 10**6).integers(-1, 2, problem.n)
        problem = problem.replace(load_slope=slope.astype(float))
    return problem


def places(graph):
    """Alphas all over the interval, and those of vertices that are rational numbers of few digits."""
    low, high = graph.exact_interval
    between = {low + (high - low) * Fraction(k, 3) for k in range(4)} | {low + (high - low) / 97}
    exact = {v.enclosure[0] for v in graph.vertices if v.enclosure[0] == v.enclosure[1]}
    return sorted(between | {alpha for alpha in exact if alpha.denominator < 10**9})


def difference_of_families(graph, alpha, roots):
    """What families at vertices are other than those of all solutions at their alpha, or None."""
    here = [v.family for v in graph.vertices if v.family is not None and v.enclosure == (alpha, alpha)]
    parts = ([part for family in group for part in family.polytopes] for group in (here, roots.families))
    kept, whole = ({tuple(row) for part in group for row in np.round(part.coordinates, 9)} for group in parts)
    return None if not here or whole <= kept else ("corners of families", whole - kept)


def difference_from_oracle(problem, interval, arithmetic):
    """What a graph says other than the oracle, or None."""
    graph = enumsol.branch_graph(problem, interval, arithmetic)
    if not graph.complete:
        return graph.reasons
    for alpha in places(graph):
        oracle = Oracle(problem, alpha)
        wanted = len(oracle.points), oracle.families
        roots = graph.roots_at(alpha)
        if graph.multiplicity_at(alpha) != sum(wanted) or (len(roots), len(roots.families)) != wanted:
            return alpha, graph.multiplicity_at(alpha), len(roots), len(roots.families), wanted
        if (said := difference_of_families(graph, alpha, roots)) is not None:
            return alpha, said
        found = [np.concatenate([root.lambda_n, root.lambda_t, root.u]) for root in roots]
        for row in np.hstack(oracle.forces):
            if min(np.max(np.abs(one - row)) for one in found) > 1e-7 * (1 + np.max(np.abs(row))):
                return alpha, "a root is not where it should be"
    if arithmetic == "exact":
        return None if graph.proof is None else "a proof of what rationals decided"
    report = enumsol.verify(problem, graph.proof)
    assert check_records(problem, records_of(graph.proof)) == report.selections
    return None if report.ok and report.within == problem.rigid_reach else report


@pytest.mark.few(2, 6)
@pytest.mark.parametrize("seed", [3, 8, 14, 17, 28, 31, 35, 38])
def test_all_solutions_of_random_bodies(seed):
    assert difference_from_oracle(varying(seed), (0, 2), "exact" if seed == 31 else "verified") is None


@pytest.mark.long
def test_all_solutions_of_many_random_bodies():
    """Without those with so many free modes that a sheet takes minutes."""
    problems = {seed: varying(seed) for seed in range(40, 100)}
    few = {seed: problem for seed, problem in problems.items() if problem.modes.r < 5}
    found = {seed: difference_from_oracle(problem, (0, 2), "verified") for seed, problem in few.items()}
    assert not {seed: said for seed, said in found.items() if said is not None}


def test_a_block_that_is_pushed_until_it_slides(tmp_path):
    problem = pushed_block(max_rigid_displacement=4.0)
    graph = whole_graph(problem, (-2, Fraction(3, 2)))
    assert "complete: yes (proven, within rigid displacements of 4)" in repr(graph)
    alphas, at, between = graph.steps
    assert (alphas[0], alphas[-1]) == (-2, Fraction(3, 2))
    assert (at[0], at[-1], between[0], between[-1]) == (0, 0, 0, 0)
    assert {*at[1:-1], *between[1:-1]} == {1}
    ends = [v for v in graph.vertices if v.family is not None]
    assert [v.exact.enclosure() for v in ends] == [(-1, -1), (1, 1)]
    assert all(v.bounded and v.family.free_modes == (0,) for v in ends)
    assert graph.uniqueness_limit == -2
    assert not graph.jumps
    (said,) = graph.claims.sentences(None)
    assert said == "no solution at or right above the first alpha; several at or right above alpha = -1"
    assert (len(graph.roots_at(1.25)), len(graph.roots_at(0.5))) == (0, 1)
    assert graph.roots_at(0.5).rigid_bound.needed
    again = read_back(graph, tmp_path / "graph.json")
    assert repr(again) == repr(graph)
    assert_same(again, graph, "problem.fingerprint", "steps")
    assert [v.bounded for v in again.vertices] == [v.bounded for v in graph.vertices]
    one, other = (g.families[0].polytopes[0] for g in (graph, again))
    assert_same(one, other, "rigid_coordinates")
    assert_same(again.roots_at(0.5)[0], graph.roots_at(0.5)[0], "u")


def test_arcs_end_where_the_body_has_moved_as_far_as_was_asked():
    """Pushed more and more, the block gives way where it touches the table, before it slides."""
    problem = pushed_block(max_rigid_displacement=1 / 64)
    graph = whole_graph(problem, (-1.5, 0))
    (end,) = (v for v in graph.vertices if v.kind == "bound")
    assert end.bounded
    assert (end.index_left, end.index_right) == (0, 1)
    assert -1.0 < end.alpha < -0.6
    (root,) = graph.roots_at(end.alpha + 1e-9)
    assert np.max(np.abs(root.rigid_coordinates) / problem.modes.reach(1 / 64)) == pytest.approx(1, abs=1e-6)
    assert graph.multiplicity_at(end.alpha - 1e-9) == 0
    assert graph.claims.uniqueness().none_by == -1.5
    wider = enumsol.branch_graph(problem.replace(max_rigid_displacement=1 / 8), (-0.99, 0))
    assert wider.claims.uniqueness().throughout
    assert not [v for v in wider.vertices if v.kind == "bound"]


@pytest.mark.few(2, 2)
@pytest.mark.parametrize("seed", [17, 31, 8, 14, 47])
def test_balls_and_exact_algebra_agree_about_random_bodies(seed):
    graphs = two_graphs(varying(seed), (0, 2))
    assert differences(graphs) == []
    assert graphs.exact[1]


@pytest.mark.few(2)
@pytest.mark.parametrize("cells", [2, 3, 1])
def test_balls_find_where_a_body_has_moved_as_far_as_was_asked(cells):
    graphs = two_graphs(pushed_block(cells, max_rigid_displacement=1 / 64), (-0.98, 0.98))
    assert differences(graphs) == []
    assert graphs.open == []
    assert sum(v.kind == "bound" for v in graphs.traced[0]) == (cells > 1)


def test_balls_alone_make_a_graph_that_loads_again(monkeypatch, tmp_path):
    problem = pushed_block(2, max_rigid_displacement=1 / 64)
    monkeypatch.setattr(ways, "FAST_EXACT_DOF", 0)
    graph = whole_graph(problem, (-0.98, 0.98))
    assert graph.arcs_by == "balls"
    (bound,) = (v for v in graph.vertices if v.kind == "bound")
    assert (bound.bounded, bound.index_left, bound.index_right) == (True, 0, 1)
    report = accepted_report(problem, graph.proof)
    assert report.complete
    assert check_records(problem, records_of(graph.proof)) == report.selections
    for alpha in (-0.97, -0.9, -0.5, 0, 0.75):
        oracle = Oracle(problem, Fraction(alpha))
        assert graph.multiplicity_at(alpha) == len(oracle.points) + oracle.families
        for arc, row in zip(graph.arcs_at(alpha), oracle.forces[0], strict=True):
            assert np.allclose(np.concatenate(arc.values(alpha)), row[: 2 * problem.p], rtol=1e-9, atol=1e-12)
    again = read_back(graph, tmp_path / "graph.json")
    assert_same(again, graph, "problem.fingerprint", "steps")
    assert np.array_equal(again.arcs[0].values(again.arcs[0].lo), graph.arcs[0].values(graph.arcs[0].lo))


def test_at_the_limit_of_sliding_balls_leave_one_place_open(monkeypatch):
    monkeypatch.setattr(ways, "FAST_EXACT_DOF", 0)
    monkeypatch.setattr(ways, "EXACT_DOF_LIMIT", 0)
    graph = enumsol.branch_graph(pushed_block(1, max_rigid_displacement=4.0), (0.0625, 1.25))
    assert graph.arcs_by == "balls"
    assert not graph.complete
    (place,) = (v for v in graph.vertices if v.kind == "unsettled")
    assert place.enclosure[0] <= 1 <= place.enclosure[1]
    assert {graph.at_least(alpha) for alpha in (0.0625, 0.5, 0.9)} == {1}
    assert graph.at_least(1.125) == 0


def test_a_plate_of_more_degrees_of_freedom_than_exact_algebra_takes():
    plate = fem.rectangle(11, 11).parted()
    pressure = {"top": 0.5, "left": 1.5}
    given = {"young": 1000.0, "poisson": 0.2, "contact": "bottom", "symmetry": "right", "pressure": pressure}
    problem = fem.mesh_problem(plate, **given, friction=0.0, max_rigid_displacement="auto").replace(friction_slope=1.0)
    assert problem.n > 250
    graph = whole_graph(problem, (0.2, 0.5))
    assert [v.kind for v in graph.vertices] == ["end", "transition", "end"]
    assert enumsol.verify(problem, graph.proof).arcs == 2
    for alpha in (0.25, 0.45):
        (root,) = graph.roots_at(alpha)
        assert violation(problem, alpha, root.u, root.lambda_n, root.lambda_t) < 1e-9
        (arc,) = graph.arcs_at(alpha)
        assert np.allclose(arc.values(alpha), (root.lambda_n, root.lambda_t), rtol=1e-9, atol=1e-12)


def test_a_body_that_slides_without_friction_is_a_sheet():
    problem = block_on_table(cells=1, friction=0.0, max_rigid_displacement=2.0)
    problem = problem.replace(load_slope=block_on_table(cells=1, press=2.0, friction=0.0).f - problem.f)
    graph = whole_graph(problem, (0, 1))
    assert graph.sheets
    (family,) = graph.roots_at(0.5).families
    assert family.free_modes == (0,)
    assert not graph.claims.uniqueness().throughout


def test_lower_bounds_of_a_graph_with_gaps_do_not_count_what_only_the_sum_of_indices_implies():
    problem = pushed_block()
    graph = enumsol.branch_graph(problem, (-2, 2), max_nodes=1)
    assert not graph.complete
    assert {graph.at_least(alpha) for alpha in (-1.75, 0.5, 1.75)} == {0}
    assert min(graph.claims.steps().at) == 0


@pytest.mark.slow
def test_pictures_and_a_report(tmp_path):
    graph = enumsol.branch_graph(pushed_block(1, max_rigid_displacement=4.0), (0, 1.5))
    graph.plot(file=tmp_path / "graph.png")
    enumsol.write_report(graph, tmp_path / "graph.html")
    assert "within rigid displacements of 4" in (tmp_path / "graph.html").read_text(encoding="utf-8")
    body = enumsol.gallery.block_on_table(2, 1)
    enumsol.write_report(enumsol.branch_graph(body, (0, 1)), tmp_path / "meshed.html")
    assert "Nothing holds the body" in (tmp_path / "meshed.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_with_workers_it_is_the_same():
    problem = pushed_block()
    alone = enumsol.branch_graph(problem, (0, 1.5))
    with ThreadPoolExecutor(2) as executor:
        spread = enumsol.branch_graph(problem, (0, 1.5), executor=executor)
    assert spread.steps == alone.steps
    assert records_of(spread.proof) == records_of(alone.proof)


PROBLEM = pushed_block(1, max_rigid_displacement=4.0)
RECORDS = records_of(enumsol.branch_graph(PROBLEM, (-0.5, 0.5)).proof)


def refusal(records, problem=PROBLEM):
    """Why the checker refuses records, as the one made from the proof format does."""
    report = enumsol.verify(problem, proof_of(records))
    assert not report.ok
    with pytest.raises(Refused):
        check_records(problem, records)
    return " ".join(report.failures)


def test_a_proof_says_within_which_bound():
    report = accepted_report(PROBLEM, proof_of(RECORDS))
    assert report.within == 4.0
    assert "within rigid displacements of 4" in repr(report)
    records = copied(RECORDS)
    for bound in (2.0, 8.0, 4, None):
        records[0]["max_rigid_displacement"] = bound
        assert "bound of the rigid displacement" in refusal(records)
    assert "another problem" in refusal(RECORDS, PROBLEM.on_springs)
    records[0] |= {"max_rigid_displacement": 4.0, "data": "condensed"}
    assert "S and g as computed" in refusal(records)


def test_forged_leaves_are_refused():
    excluded, survivors = (of_kind(RECORDS, kind) for kind in "xs")
    assert excluded
    for place in excluded:
        rows, values = multipliers(RECORDS[place])
        for forged in ([0.0] * len(values), [-v for v in values]):
            changed = with_multipliers(RECORDS[place], rows, forged)
            assert "do not exclude" in refusal(replaced(RECORDS, place, changed))
    for record in (["q", [6] * 2, [1.0] * 8, []], ["q", [[0, 0]], [1.0] * 6, []]):
        records = copied(RECORDS)
        records.insert(excluded[0], record)
        assert "a form cannot be read" in refusal(records)
    refusal(replaced(RECORDS, survivors[0]))


def test_samples_are_linked_where_the_graph_has_a_branch():
    problem = pushed_block(1)
    graph = enumsol.branch_graph(problem, (-1.25, 1.25))
    sampled = enumsol.link_samples(problem, [-1.25, -0.75, 0, 0.75, 1.25])
    assert {roots.arithmetic for roots in sampled.root_sets} == {"verified"}
    assert [len(roots) for roots in sampled.root_sets] == [0, 1, 1, 1, 0]
    assert len(sampled.branches) == 1
    assert not sampled.ambiguous
    missed = sampled.missed(graph)
    assert (missed.branches, missed.families) == ((), 2)


def test_local_branches_at_vertices_are_those_on_weak_springs():
    problem = pushed_block(1)
    free, weak = (enumsol.branch_graph(body, (-0.98, 0.98)) for body in (problem, held_by_springs(problem, 1e-6)))
    for one, two in zip(free.vertices, weak.vertices, strict=True):
        assert one.active == two.active
        tests = [enumsol.local_branch_test(graph.problem, v) for graph, v in ((free, one), (weak, two))]
        assert tests[0] == tests[1]
        assert tests[0].exists == (one.kind in ("transition", "end"))


def test_a_family_at_a_vertex_keeps_parts_that_differ_only_in_how_far_the_body_moved():
    """At the end the body slides, and then flies off without any force: its open part has one point of forces."""
    problem = varying(162)
    graph = enumsol.branch_graph(problem, (0, 2))
    (vertex,) = (v for v in graph.vertices if v.family is not None)
    parts = {part.statuses[0].value: part for part in vertex.family.polytopes}
    assert parts.keys() == {"slip+", "open"}
    assert np.allclose(sorted(parts["open"].rigid_coordinates.ravel()), [1 / 3, 8])
    assert not np.any(parts["open"].vertices)
    assert enumsol.follow_all(problem, (0, 2), graph=graph).complete
