"""``enumsol graph`` says which arcs run away: if asked, if it is cheap, or not at all."""

import csv
import io
import json

import numpy as np
import pytest
from command_line import assert_refused, printed, run

import enumsol
from enumsol import gallery
from enumsol.cli import common, graph as command

GRAPH = ("graph", "gallery:one-node-6.1", "--from", 0, "--to", 3)
QUIET, AWAY = "does not run away", "runs away"


def test_it_is_said_if_it_is_asked_for(capsys, tmp_path):
    text = printed(capsys, *GRAPH, "--stability")
    assert f"stability: {QUIET} (1 arc); {AWAY} (1 arc)" in text
    rows = list(csv.DictReader(io.StringIO(printed(capsys, *GRAPH, "--stability", "--csv", "-"))))
    assert [row["stability"] for row in rows] == [QUIET, QUIET, AWAY]
    content = json.loads(printed(capsys, *GRAPH, "--stability", "--json", "-"))
    assert [spans[0]["verdict"] for spans in content["stability"]] == [QUIET, QUIET, AWAY]
    assert [arc["stability"] for arc in content["arc_list"]] == [QUIET, QUIET, AWAY]


def test_it_is_left_out_if_that_is_asked_for(capsys):
    assert "stability" not in printed(capsys, *GRAPH, "--no-stability")


@pytest.mark.parametrize(("share", "shown"), [(1e9, True), (0.0, False)])
def test_without_being_asked_only_where_it_is_cheap(capsys, monkeypatch, share, shown):
    monkeypatch.setattr(command, "_SHARE", share)
    note = None if shown else "more than a tenth of the work on the graph; --stability finds it"
    assert ("stability" in printed(capsys, *GRAPH, note=note)) is shown
    if not shown:
        assert run(capsys, *GRAPH, "--quiet")[2] == ""


def test_work_is_counted(tmp_path):
    """Arcs on which a node slides, where friction is constant once each, on any machine."""
    varying, constant = (
        gallery.one_node_triangle(),
        gallery.one_node_triangle().replace(friction=1.0, friction_slope=0.0),
    )
    constant = constant.replace(load_slope=[0.5, 0.1])
    for problem, each in ((varying, 5000), (constant, 300)):
        found = enumsol.branch_graph(problem, (0, 3))
        sliding = [arc.statuses for arc in found.arcs if "slip" in str(arc.statuses[0].value)]
        assert command._work(problem, found) == each * len(set(sliding))
        assert sliding


def test_without_a_mass_nothing_is_said_or_it_is_refused(capsys, tmp_path):
    problem = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 2], friction=0.5)
    enumsol.write_problem(problem, tmp_path / "bare.npz")
    bare = ("graph", tmp_path / "bare.npz", "--from", 0, "--to", 1)
    assert "stability" not in printed(capsys, *bare)
    assert_refused(*run(capsys, *bare, "--stability"), "no mass and no mesh")
    space = ("graph", "gallery:one-node-3d-3", "--from", 0, "--to", 1, "--stability")
    assert_refused(*run(capsys, *space), "no mass and no mesh")


@pytest.mark.parametrize("verb", [("roots", "--alpha", 1), ("history", "--steps", "1,2")])
def test_without_a_mass_it_is_refused_before_the_search(capsys, tmp_path, monkeypatch, verb):
    problem = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 2], friction=0.5)
    enumsol.write_problem(problem, tmp_path / "bare.npz")
    monkeypatch.setattr(common, "so_far", lambda _: pytest.fail("there was a search"))
    call = (verb[0], tmp_path / "bare.npz", *verb[1:], "--stability", "--proof", tmp_path / "bare.proof")
    assert_refused(*run(capsys, *call), "no mass and no mesh")
    assert not (tmp_path / "bare.proof").exists()


def test_tables_can_leave_out_what_runs_away(capsys):
    table = ("table", "gallery:one-node-6.1", "--alphas", "1,5", "--without", "running away")
    text = printed(capsys, *table)
    assert "left out: how many roots run away" in text
    assert "complete: yes (proven at all 2 alphas" in text
    rows = json.loads(printed(capsys, *table, "--json", "-"))["rows"]
    assert [(row["roots"], row["left_out"], row["stability_undecided"]) for row in rows] == [(1, 0, 0), (2, 1, 0)]
    # floats prove no verdict
    fast = printed(capsys, *table, "--arithmetic", "fast", status=3)
    assert "complete: no (at 2 of 2 alphas: 1, 5)" in fast
    assert_refused(*run(capsys, *table[:-1], "sliding"), "--without is 'sliding'; expected one of 'running away'")


def test_ctrl_c_keeps_what_was_found(capsys, monkeypatch):
    def interrupted(self):
        raise KeyboardInterrupt

    for kind in (enumsol.BranchGraph, enumsol.RootSet, enumsol.History):
        monkeypatch.setattr(kind, "stability", interrupted)
    for call in (GRAPH, ("roots", GRAPH[1], "--alpha", 1), ("history", GRAPH[1], "--steps", "1,2")):
        assert "complete: yes (proven" in printed(capsys, *call, "--stability", status=130)


def test_roots_are_said_where_the_proof_of_their_verdicts_cannot_be_written(capsys, monkeypatch, tmp_path):
    def full(*_):
        raise enumsol.OutputError("proof cannot be written (No space left on device)")

    monkeypatch.setattr(enumsol.RootSet, "stability_proof", full)
    call = ("roots", GRAPH[1], "--alpha", 1, "--stability", "--proof", tmp_path / "node.proof")
    status, out, err = run(capsys, *call)
    assert (status, "complete: yes (proven" in out) == (74, True)
    assert "No space left" in err
