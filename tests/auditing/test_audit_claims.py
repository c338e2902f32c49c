"""An audit claims nothing about points that it did not compare, nor against a graph that has holes."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from command_line import assert_refused, printed, run
from complete import read_back, whole_graph
from path_problems import sheet_of_one_node
from refusals import bad_argument

from enumsol import audit, branch_graph, follow, follow_all, gallery, link_samples, newton

AUDIT = ("audit", "gallery:one-node-6.1")
#: What the report says of a graph that is complete, and of no other.
COMPLETE = re.compile(r": (not )?ok, (complete|every arc was visited)")


@pytest.fixture(scope="module")
def problem(graph):
    return graph.problem


@pytest.fixture(scope="module")
def cut(problem):
    """One arc of three: stopped by max_nodes."""
    graph = branch_graph(problem, (0.0, 20.0), max_nodes=5)
    assert graph.reasons
    assert len(graph.arcs) == 1
    return graph


@pytest.fixture(scope="module")
def everything(problem, graph):
    """All arcs followed, one row per point."""
    paths = follow_all(problem, (0.0, 20.0), graph=graph).paths
    return pd.concat([path.to_frame().assign(path=k) for k, path in enumerate(paths)], ignore_index=True)


# -- points that were not compared -------------------------------------------------------------------------------------


def test_points_outside_the_interval_are_counted_listed_and_not_ok(problem, everything):
    report = audit(everything, branch_graph(problem, (0.0, 10.0)))
    outside = everything.index[everything["alpha"].gt(10 + 1e-4)]
    points = [report.points[k] for k in report.not_compared]
    assert len(outside)
    assert not report.ok
    assert [point.row for point in points] == outside.tolist()
    assert {point.reason for point in points} == {"outside the graph's interval [0, 10]"}
    assert all(np.isnan(report.distances[k]) for k in report.not_compared)
    assert f"not compared      {len(outside)} points" in repr(report)
    first = points[0]
    assert f"path {first.path}, rows {first.row} to " in repr(report)
    assert "ok, complete" not in repr(report)
    frame = report.to_frame()
    assert (~frame["compared"]).sum() == len(outside)
    assert set(frame.loc[~frame["compared"], "row"]) == set(outside)


def test_a_single_point_outside_is_listed_with_row_and_alpha(everything, graph):
    frame = everything.copy()
    frame.loc[5, "alpha"] = -3.0
    report = audit(frame, graph)
    (k,) = report.not_compared
    assert (report.points[k].path, report.points[k].row, report.points[k].alpha) == (frame.loc[5, "path"], 5, -3.0)
    assert "row 5, alpha = -3: outside the graph's interval [0, 20]" in repr(report)


def test_only_points_outside_say_nothing_about_distances(everything, graph):
    frame = everything.assign(alpha=everything["alpha"] + 100)
    report = audit(frame, graph)
    assert len(report.not_compared) == len(frame)
    assert np.isnan(report.max_distance)
    assert "largest distance  none" in repr(report)
    assert not report.ok


def test_points_not_compared_have_an_exit_status_of_their_own(capsys, tmp_path, everything):
    points, result, rows = (tmp_path / name for name in ("p.csv", "r.json", "r.csv"))
    everything.to_csv(points, index=False)
    out = printed(capsys, *AUDIT, points, "--to", 10, "--json", result, "--csv", rows, status=4)
    assert "not compared" in out
    assert "ok, complete" not in out
    content = json.loads(result.read_text())
    outside = everything.index[everything["alpha"].gt(10 + 1e-4)].tolist()
    assert [point["row"] for point in content["not_compared"]] == outside
    assert {point["reason"] for point in content["not_compared"]} == {"outside the graph's interval [0, 10]"}
    assert content["ok"] is False
    assert (~pd.read_csv(rows)["compared"]).sum() == len(outside)
    # whatever else was found
    everything.assign(lambda_n_0=everything["lambda_n_0"] + 1).to_csv(points, index=False)
    assert run(capsys, *AUDIT, points, "--to", 10)[0] == 4
    assert run(capsys, *AUDIT, points)[0] == 3


def test_the_help_names_every_exit_status(capsys):
    out = " ".join(run(capsys, "audit", "--help")[1].split())
    for text in ("Exit status: 0 if", "; 3 if not", "; 4 if points were not compared", "; 2 on bad input", "; 130 on"):
        assert text in out


# -- graphs that are not complete --------------------------------------------------------------------------------------


def both_ways(problem, cut):
    """Paths along the only arc of a graph that was cut short."""
    (start, *_), low = cut.starting_points(), cut.arcs[0].lo + 0.1
    return [follow(problem, start, direction, (low, 20.0)) for direction in (1, -1)]


def assert_not_proven(report):
    """All points lie on the graph and visit its arcs, which are not proven to be all."""
    assert report.ok
    assert report.all_visited
    assert not report.complete
    assert not COMPLETE.search(repr(report))


def test_complete_is_not_said_against_an_incomplete_graph(problem, cut, tmp_path):
    """Every arc that it holds is visited and every point is on it."""
    paths = both_ways(problem, cut)
    for report in (audit(paths, cut), audit(paths[0], read_back(cut, tmp_path / "cut.json"))):
        assert_not_proven(report)
        assert report.graph_reasons == cut.reasons
        assert not report.graph_complete
        assert f"but the graph is not complete: {cut.reasons[0]}" in repr(report)
        assert report.summary()["complete"] is False
        assert report.summary()["graph_reasons"] == list(cut.reasons)


def test_a_hole_of_the_graph_is_no_point_off_and_no_jump(problem, cut, everything):
    """All points are solutions; two arcs are missing from the graph."""
    report = audit(everything, cut)
    assert not report.off
    assert not report.jumps
    assert not report.ok
    assert len(report.not_compared) > 50
    assert "on no arc that the graph holds" in repr(report)
    assert report.max_distance < 1e-5


def holed(graph, *missing):
    """A graph without some of its arcs, which says so."""
    arcs = tuple(arc for arc in graph.arcs if arc.number not in missing)
    branches = [SimpleNamespace(number=b.number, arcs=tuple(a for a in b.arcs if a in arcs)) for b in graph.branches]
    known = {"problem": graph.problem, "interval": graph.interval, "vertices": graph.vertices}
    return SimpleNamespace(**known, arcs=arcs, branches=branches, complete=False, reasons=("an arc was taken out",))


def test_two_points_that_a_graph_with_a_hole_does_not_join_are_no_jump():
    """The path goes on through the arc that is missing, with steps that leave no point on it."""
    problem = gallery.two_node_square()
    graph = branch_graph(problem, (0.0, 8.0))
    branch = next(branch for branch in graph.branches if len(branch.arcs) == 4)
    before, between, after = branch.arcs[:3]
    path = follow(problem, newton(problem, 6.0, graph.starting_point(branch)), -1, (0.0, 8.0))
    report = audit(path, graph)
    assert report.ok
    ends = [("arc", arc.number) for arc in (before, after)]
    some = path.to_frame().iloc[[k for k, place in enumerate(report.places) if (place.kind, place.number) in ends]]
    assert audit(some, graph).visited >= {between.number}
    report = audit(some, holed(graph, between.number))
    assert report.jumps == ()
    (pair,) = report.unjoined
    assert set(pair.arcs) == {before.number, after.number}
    assert not report.ok
    assert "not joined        1 pair of points" in repr(report)
    assert report.to_frame()["unjoined"].sum() == 1
    assert [item["rows"] for item in report.summary()["unjoined"]] == [pair.rows]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["one-node-6.1", "two-node-6.4", "chain-2-coupled"])
def test_what_is_said_against_a_cut_graph_is_true_of_the_complete_one(name):
    problem = gallery.get(name).build()
    whole = branch_graph(problem, (0.0, 8.0))
    paths = follow_all(problem, (0.0, 8.0), graph=whole).paths
    on = cut_short = 0
    for limit in (1, 2, 3, 5, 8, 13, 21, 39):
        graph = branch_graph(problem, (0.0, 8.0), max_nodes=limit)
        report = audit(paths, graph)
        assert report.complete == graph.complete
        if graph.complete:
            break
        cut_short += 1
        on += len(report.points) - len(report.not_compared)
        # all points are solutions, and no path jumps
        assert not report.off
        assert not report.jumps
        assert not COMPLETE.search(repr(report))
    assert graph.complete
    assert cut_short
    assert on


def test_a_fast_graph_is_not_proven(capsys, tmp_path, problem, everything):
    graph = branch_graph(problem, (0.0, 20.0), "fast")
    assert not graph.reasons
    report = audit(everything, graph)
    assert_not_proven(report)
    assert "every arc that the graph holds was visited, but the graph is not proven complete" in repr(report)
    everything.to_csv(tmp_path / "p.csv", index=False)
    arguments = (*AUDIT, tmp_path / "p.csv", "--arithmetic", "fast")
    # as enumsol graph: nothing is known to be missing
    assert not COMPLETE.search(printed(capsys, *arguments))
    assert json.loads(run(capsys, *arguments, "--json", "-")[1])["complete"] is False


def test_the_command_line_never_says_complete_of_an_incomplete_graph(capsys, tmp_path, cut, problem):
    frames = [path.to_frame().assign(path=k) for k, path in enumerate(both_ways(problem, cut))]
    pd.concat(frames).to_csv(tmp_path / "p.csv", index=False)
    cut.save(tmp_path / "cut.json")
    arguments = (*AUDIT, tmp_path / "p.csv", "--graph", tmp_path / "cut.json")
    out = printed(capsys, *arguments, status=3)
    assert out.startswith("Audit of ")
    assert "ok, every arc that the graph holds was visited, but the graph is not complete: " in out.splitlines()[0]
    assert not COMPLETE.search(out)
    content = json.loads(run(capsys, *arguments, "--json", "-")[1])
    assert content["complete"] is content["graph_complete"] is False
    assert content["graph_reasons"] == list(cut.reasons)


def test_follow_all_is_not_complete_against_an_incomplete_graph(problem, cut):
    assert not follow_all(problem, (0.0, 20.0), graph=cut).complete
    empty = branch_graph(problem, (0.0, 20.0), max_nodes=1)
    assert not empty.arcs
    result = follow_all(problem, (0.0, 20.0), graph=empty)
    assert (result.complete, result.report.ok) == (False, False)
    assert not COMPLETE.search(repr(result))
    assert not follow_all(problem, (0.0, 20.0), graph=branch_graph(problem, (0.0, 20.0), "fast")).complete


def test_sampled_graphs_are_refused(problem, everything):
    linked = link_samples(problem, [3.0, 4.0, 5.0])
    for call in (lambda: audit(everything, linked), lambda: follow_all(problem, (3.0, 5.0), graph=linked)):
        bad_argument(r"graph is a SampledGraph, .* expected a BranchGraph", call)


# -- rows that are not there -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("empty", [np.nan, None, "", "  ", pd.NA])
def test_a_row_without_a_path_is_refused_by_its_number(graph, everything, empty):
    frame = everything.astype({"path": object})
    frame.loc[[3, 4], "path"] = empty
    bad_argument("path is empty in row 3 and 1 more", audit, frame, graph)
    bad_argument("path is empty in row 0 and", audit, everything.assign(path=np.nan), graph)


def test_the_file_and_row_without_a_path_are_named(capsys, tmp_path, everything):
    frame = everything.astype({"path": object})
    frame.loc[7, "path"] = np.nan
    file = tmp_path / "holes.csv"
    frame.to_csv(file, index=False)
    assert_refused(*run(capsys, *AUDIT, file), f"{file}: path is empty in row 7;")


@pytest.mark.parametrize("name", [float, str, lambda k: f"run {k}", lambda k: k - 0.5, "category"])
def test_no_row_is_dropped_whatever_paths_are_called(graph, everything, name):
    path = everything["path"]
    frame = everything.assign(path=path.astype(name) if name == "category" else path.map(name))
    mixed = frame.sample(frac=1, random_state=1).sort_values("arclength", kind="stable")
    for given in (frame, mixed):
        report = audit(given, graph)
        assert sorted(point.row for point in report.points) == list(range(len(frame)))
        assert len({point.path for point in report.points}) == everything["path"].nunique()
        assert report.ok


def test_an_audit_of_no_points_is_not_ok(graph, everything):
    for nothing in (everything.iloc[:0], everything.drop(columns="path").iloc[:0], []):
        report = audit(nothing, graph)
        assert (report.ok, report.complete) == (False, False)
        assert "Audit of 0 points of 0 paths: not ok (there is no point to compare)" in repr(report)
        assert report.to_frame().empty


# -- tolerances that decide nothing ------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [np.nan, np.inf, 0.0, -1e-5, 1.0])
def test_a_tolerance_that_no_point_can_miss_is_refused(graph, everything, tolerance, capsys, tmp_path):
    wrong = everything.assign(lambda_n_0=everything["lambda_n_0"] + 0.5)
    bad_argument(r"tolerance is .*; expected a number above 0 and below 1", audit, wrong, graph, tolerance=tolerance)
    wrong.to_csv(tmp_path / "p.csv", index=False)
    assert_refused(*run(capsys, *AUDIT, tmp_path / "p.csv", f"--tolerance={tolerance}"), "tolerance is ")


@pytest.mark.parametrize("detour", [np.nan, np.inf, 0.5])
def test_a_detour_that_no_jump_exceeds_is_refused(graph, everything, detour):
    bad_argument("detour is", audit, everything, graph, detour=detour)


# -- sheets and families -----------------------------------------------------------------------------------------------


def test_points_on_a_sheet_are_on_the_graph():
    graph = whole_graph(sheet_of_one_node(), (0.25, 1.0))
    assert [arc.dimension for arc in graph.arcs] == [1]
    alpha = np.linspace(0.25, 1.0, 20)
    share = np.linspace(0.1, 0.9, 20) * graph.roots_at(1.0).families[0].vertices.max(axis=0)[0, 0]
    frame = pd.DataFrame({"alpha": alpha, "lambda_n_0": share * alpha, "lambda_t_0": -2 * share * alpha})
    report = audit(frame, graph)
    assert (report.ok, report.complete) == (True, True)
    assert report.max_distance < 1e-8
    frame.loc[4, "lambda_t_0"] += 1e-3
    report = audit(frame, graph)
    assert [report.points[k].row for k in report.off] == [4]
