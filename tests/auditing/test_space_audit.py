"""Audits of paths in 3D against branch graphs."""

import numpy as np
import pytest
from problems3d import SLIDING
from refusals import bad_argument

import enumsol
from enumsol.auditing import follow_arc, read_points


@pytest.fixture(scope="module")
def graph():
    return enumsol.branch_graph(SLIDING, (1.78, 1.82), max_nodes=60)


@pytest.fixture(scope="module")
def path(graph):
    return enumsol.follow(SLIDING, graph.starting_points()[0], 1, graph.interval)


def test_every_branch_is_followed(graph):
    found = enumsol.follow_all(SLIDING, graph.interval, graph=graph)
    assert (found.complete, found.report.ok, found.report.visited) == (True, True, {0, 1})
    assert not found.failures


def test_what_a_path_missed_and_points_off_the_graph(graph, path):
    report = enumsol.audit(path, graph)
    assert report.ok
    assert {arc.arc for arc in report.missed} | set(report.visited) == {0, 1}
    frame = path.to_frame()
    assert enumsol.audit(frame, graph).ok
    frame["lambda_t2_0"] *= 1.01
    assert not enumsol.audit(frame, graph).ok


def test_points_of_another_dimension_are_refused(graph, path):
    plane = enumsol.gallery.one_node_triangle()
    other = enumsol.follow(plane, enumsol.newton(plane, 0), interval=(0, 1))
    bad_argument("path 0 is one in 2D; expected a path in 3D", enumsol.audit, other, graph)
    bad_argument("no column 'lambda_t1_0'", read_points, path.to_frame().drop(columns="lambda_t1_0"), SLIDING)
    bad_argument("another dimension", enumsol.follow_all, plane, graph.interval, graph=graph)
    run = read_points(path, SLIDING)[0]
    assert run.forces.shape == (len(path), 3)
    assert np.array_equal(run.forces[:, 1:], path.lambda_t[:, 0])


@pytest.mark.parametrize("arc", [0, 1])
def test_a_path_leaves_a_vertex_on_the_arc_that_is_asked_for(graph, arc):
    path = follow_arc(SLIDING, graph, 1, arc)
    assert enumsol.audit(path, graph).ok
    end = graph.arcs[arc].lo if arc == 0 else graph.arcs[arc].hi
    assert path.alpha[-1] == pytest.approx(end)
