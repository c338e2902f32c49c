"""Every branch of bodies that nothing holds followed, and paths of such bodies compared with their graphs."""

import dataclasses

import numpy as np
import pytest
from effort import some
from helpers.floating_bodies import pushed_block
from helpers.floating_oracle import random_body
from refusals import bad_argument

import enumsol
from enumsol.auditing import follow_arc, read_points

PROBLEM = pushed_block(1, max_rigid_displacement=4.0)
GRAPH = enumsol.branch_graph(PROBLEM, (-1.5, 1.5))
PATH = enumsol.follow(PROBLEM, enumsol.newton(PROBLEM, 0), interval=(-1.5, 1.5))


def test_a_block_is_followed_until_it_slides_away_on_both_sides(tmp_path):
    result = enumsol.follow_all(PROBLEM, (-1.5, 1.5), graph=GRAPH)
    assert result.complete
    assert {path.status for path in result.paths} == {"rigid bound"}
    assert not result.failures
    assert not result.report.missed_families
    for path in result.paths:
        path.to_frame().to_csv(tmp_path / "points.csv", index=False)
        report = enumsol.audit(tmp_path / "points.csv", GRAPH)
        assert report.ok
        assert report.visited == enumsol.audit(path, GRAPH).visited


def test_two_points_with_the_same_forces_are_told_apart_by_the_rigid_displacement():
    frame = PATH.to_frame()
    sliding = PATH.rigid_coordinates[-1] - PATH.rigid_coordinates[-2]
    assert np.allclose(PATH.lambda_t[-1], PATH.lambda_t[-2])
    assert abs(sliding[0]) > 1
    # on the family at the limit of sliding, in between
    frame.loc[len(frame) - 1, "rigid_0"] -= 0.5 * sliding[0]
    assert enumsol.audit(frame, GRAPH).ok
    # away from it
    frame.loc[0, "rigid_0"] += 0.125
    report = enumsol.audit(frame, GRAPH)
    assert [report.points[k].row for k in report.off] == [0]
    # beyond what the graph was asked for
    frame = PATH.to_frame()
    frame.loc[len(frame) - 1, "rigid_0"] += 1.0
    report = enumsol.audit(frame, GRAPH)
    (point,) = (report.points[k] for k in report.not_compared)
    assert "beyond the bound of the rigid displacement" in point.reason


def test_points_without_their_rigid_displacement_are_refused():
    frame = PATH.to_frame()
    message = "no column 'rigid_1'; expected one for every coordinate"
    bad_argument(message, enumsol.audit, frame.drop(columns="rigid_1"), GRAPH)
    frame.insert(0, "rigid_1", 0.0, allow_duplicates=True)
    bad_argument("2 columns 'rigid_1'", enumsol.audit, frame, GRAPH)
    held = enumsol.gallery.two_node_square()
    other = enumsol.follow(held, enumsol.newton(held, 0), interval=(0, 1))
    runs = [dataclasses.replace(run, rigid=run.rigid[:, :2]) for run in read_points(PATH, PROBLEM)]
    for points, found in ((other, 0), (runs, 2)):
        bad_argument(f"rigid displacement of {found} coordinates; expected the gra", enumsol.audit, points, GRAPH)


def test_arcs_are_followed_from_their_vertices():
    for arc in GRAPH.arcs:
        for vertex in (arc.tail, arc.head):
            path = follow_arc(PROBLEM, GRAPH, vertex, arc.number)
            assert arc.number in enumsol.audit(path, GRAPH).visited


def followed(seed):
    """All paths of a random body and their audit; None of what has no arcs but sheets, or too many free modes."""
    problem = random_body(seed)
    problem = problem.replace(load_slope=np.random.default_rng(seed + 10**6).integers(-1, 2, problem.n).astype(float))
    graph = enumsol.branch_graph(problem, (0, 2)) if problem.modes.r < 5 else None
    if graph is None or all(arc.dimension for arc in graph.arcs):
        return None
    try:
        return enumsol.follow_all(problem, (0, 2), graph=graph)
    except enumsol.NotHeldError:  # some mode moves no contact node
        return None


@pytest.mark.slow
def test_all_paths_of_random_bodies_are_on_their_graphs():
    seeds = [*range(some(10, of=20)), *range(100, some(100, of=300))]
    found = {seed: result for seed in seeds if (result := followed(seed)) is not None}
    assert len(found) > some(0, of=36)
    for seed, result in found.items():
        report = result.report
        assert report.ok, (seed, result)
        assert all(missed.sheet for missed in report.missed), (seed, result)
        assert not result.failures, (seed, result)
