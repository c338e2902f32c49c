"""Histories say at every step which of their ends run away, and can leave those out."""

import numpy as np
import pytest

import enumsol
from enumsol.branches.stability import Span

QUIET, AWAY = "does not run away", "runs away"


@pytest.fixture(scope="module")
def triangle():
    return enumsol.gallery.one_node_triangle()


def test_every_step_says_how_many_run_away(triangle, tmp_path):
    history = enumsol.histories(triangle, [5, 4])
    assert history.verdicts is None
    assert "run away" not in repr(history)
    assert "stability" not in history.to_frame()
    verdicts = history.stability()
    assert history.verdicts == verdicts
    assert list(verdicts) == [node for node in history.graph if node != (0, 0)]
    for node, found in verdicts.items():
        assert found.verdict == enumsol.stability(history.root(node).problem, history.root(node)).verdict
    away = [sum(verdicts[node].verdict == AWAY for node in history.nodes_of(step)) for step in (1, 2)]
    assert away[0] == 1
    lines = repr(history).splitlines()
    assert lines[1].endswith(" run away")
    assert [line.split()[-1] for line in lines[2:4]] == [str(count) for count in away]
    assert sum(line.endswith("(runs away)") for line in lines) == sum(away)
    assert "run away</th>" in history._repr_html_()
    assert history.to_frame().stability.tolist() == [found.verdict for found in verdicts.values()]
    pytest.importorskip("plotly")
    enumsol.write_report(history, tmp_path / "page.html")
    assert ">run away<" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_those_that_run_away_are_not_followed(triangle):
    history = enumsol.histories(triangle, [5, 4], follow="not running away")
    away = [node for node, found in history.verdicts.items() if found.verdict == AWAY]
    first = [node for node in away if node[0] == 1]
    assert [node in history.followed for node in history.nodes_of(1)] == [
        node not in first for node in history.nodes_of(1)
    ]
    assert history.reasons == tuple(f"step 1: root {a}.{b} is not followed, it runs away" for a, b in first)
    assert first
    assert not history.complete
    assert all(not list(history.graph.successors(node)) for node in first)


def test_undecided_ends_are_kept_and_told(triangle):
    history = enumsol.histories(triangle, [5, 4], arithmetic="fast", follow="not running away")
    assert set(history.nodes_of(1)) == history.followed
    text = repr(history)
    assert "0, 3 undecided" in text
    assert "1.0 open (running away undecided)" in text


def test_it_needs_a_mass(triangle):
    bare = enumsol.ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [1, 0], friction=0.5, load_slope=[0, 1])
    with pytest.raises(enumsol.InvalidArgumentError, match="no mass and no mesh"):
        enumsol.histories(bare, [1], follow="not running away")
    with pytest.raises(enumsol.InvalidArgumentError, match="follow is 'resting'"):
        enumsol.histories(triangle, [1], follow="resting")
    heavy = enumsol.ContactProblem(
        np.eye(2), [[1, 0]], [[0, 1]], [1, 0], friction=0.5, load_slope=[0, 1], mass=np.eye(2)
    )
    assert {found.verdict for found in enumsol.histories(heavy, [0.25, 1]).stability().values()} == {QUIET}


def test_maps_with_undecided_verdicts_are_not_complete(triangle, monkeypatch):
    def undecided(graph):
        return tuple((Span(arc.lo, arc.hi, "undecided"),) for arc in graph.arcs)

    monkeypatch.setattr(enumsol.BranchGraph, "stability", undecided)
    found = enumsol.multiplicity_map(triangle, (0, 3), {"gap": [0.0]}, without="running away")
    (row,) = found.rows
    assert (row.between, row.undecided, row.exact, row.complete) == ((1, 3), (1, 3), False, False)
    assert not found.complete
    assert "0-1 0-3" in repr(found)
    assert found.closing_line == "complete: no (at 1 of 1 value it is not decided whether some solutions run away)"
    assert not found.to_frame()["exact"].any()


def test_maps_can_leave_out_what_runs_away(triangle):
    over = {"gap": [0.0]}
    (whole,) = enumsol.multiplicity_map(triangle, (0, 3), over).rows
    found = enumsol.multiplicity_map(triangle, (0, 3), over, without="running away")
    (row,) = found.rows
    assert whole.between == (1, 3)
    assert (row.between, row.left_out, row.undecided) == ((1, 2), (0, 1), (0, 0))
    assert row.alphas == whole.alphas
    assert found.multiplicity_at(0.0, 2.9) == 2
    assert "\nsolutions that run away are left out\n" in repr(found)
    assert found.to_frame()[["solutions", "left_out", "stability_undecided"]].to_numpy().tolist() == [
        [1, 0, 0],
        [2, 1, 0],
    ]
    assert "left_out" not in enumsol.multiplicity_map(triangle, (0, 1), over).to_frame()
    with pytest.raises(enumsol.InvalidArgumentError, match="without is 'sliding'"):
        enumsol.multiplicity_map(triangle, (0, 3), over, without="sliding")
