import json

import numpy as np
import pytest
from alike import assert_same
from complete import read_back
from interruptions import CtrlC, interrupted
from refusals import bad_argument

from enumsol import branch_graph, gallery
from enumsol.continuation import ContinuationOptions, Path, follow, follower, newton


@pytest.fixture
def problem():
    return gallery.one_node_triangle()


@pytest.fixture
def path(problem):
    return follow(problem, newton(problem, 5.0, [1.5, -4.0]), -1, (0, 20))


def test_is_a_sequence_of_points(path):
    assert len(path.points) == len(path) == len(path.alpha)
    assert path[0].kind == "start"
    assert path[-1].alpha == 20
    assert [point.alpha for point in path[:2]] == list(path.alpha[:2])
    assert np.all(np.diff(path.arclength) > 0)
    assert path.kinds.count("step") in (path.stats.accepted, path.stats.accepted - 1)


def test_frame_has_the_columns_that_audits_read(path):
    frame = path.to_frame()
    assert len(frame) == len(path)
    assert {"alpha", "kind", "lambda_n_0", "lambda_t_0", "status_0"} <= set(frame.columns)


def test_save_and_load(path, tmp_path):
    again = read_back(path, tmp_path / "path.npz")
    assert repr(again) == repr(path)
    assert_same(again, path, "lambda_n", "options")
    assert_same(again.transitions[0], path.transitions[0], "local_test")


def test_load_refuses_other_files(tmp_path):
    np.savez(tmp_path / "other.npz", a=1)
    bad_argument("does not hold a path", Path.load, tmp_path / "other.npz")


@pytest.mark.parametrize(("name", "value"), [("status", "tired"), ("kinds", ["start", "hop"])])
def test_kinds_and_status_are_texts_too_and_those_of_a_file_must_exist(path, tmp_path, name, value):
    assert (path.status, repr(path.status)) == ("interval left", "'interval left'")
    assert (path.kinds[0], repr(path[0].kind)) == ("start", "'start'")
    file = tmp_path / "path.npz"
    path.save(file)
    with np.load(file) as data:
        stored = dict(data)
    meta = json.loads(str(stored["meta"]))
    assert meta["status"] == "interval left"
    assert set(meta["kinds"]) == {"start", "step", "transition", "end"}
    np.savez(file, **stored | {"meta": np.array(json.dumps(meta | {name: value}))})
    bad_argument(r"tired|hop", Path.load, file)


def test_resume_after_the_step_limit_is_the_same_path(problem, path, tmp_path):
    options = ContinuationOptions(max_steps=7)
    part = follow(problem, path[0], -1, (0, 20), options)
    assert part.status == "step limit"
    loaded = read_back(part, tmp_path / "part.npz")
    bad_argument("problem is missing", loaded.resume)
    whole = loaded.resume(problem, options=ContinuationOptions())
    assert whole.status == "interval left"
    assert whole.alpha == pytest.approx(path.alpha, abs=1e-9)
    assert_same(whole.transitions[0], path.transitions[0], "point")
    assert_same(whole, path, "stats.accepted")


def test_resume_in_a_wider_interval(problem):
    first = follow(problem, newton(problem, 5.0, [1.5, -4.0]), 1, (0, 6))
    more = first.resume(interval=(0, 9))
    assert more.alpha[-1] == 9
    assert 6 in more.alpha


def test_prints_why_it_ended(path):
    text = repr(path)
    assert "stick -> slip-, fold, no local branch" in text
    assert "alpha left the interval (0, 20) at 20" in text


def test_plot(path):
    figure = path.plot()
    (ax,) = figure.axes
    assert {line.get_label() for line in ax.lines} == {"steps", "folds", "start"}
    assert path.plot(ax=ax) is figure
    assert len(ax.lines) == 6
    bad_argument("ax is a NotebookFigure; expected the Axes", path.plot, ax=figure)
    bad_argument("quantity", path.plot, quantity="stress")
    bad_argument("node", path.plot, node=3)


def test_plot_over_a_graph(problem, path, tmp_path):
    graph = branch_graph(problem, (0.0, 20.0))
    figure = path.plot(graph)
    ax = figure.axes[0]
    figure.savefig(tmp_path / "figure.png")
    assert "steps" in {line.get_label() for line in ax.lines}
    bad_argument("both given", path.plot, graph, ax=ax)


def test_interruption_keeps_the_path(problem, path, monkeypatch):
    monkeypatch.setattr(follower, "moore_penrose", CtrlC(call=6, then=follower.moore_penrose))
    partial = interrupted("resume", follow, problem, path[0], -1, (0, 20))
    assert len(partial) == 6
    monkeypatch.undo()
    assert partial.resume().alpha == pytest.approx(path.alpha, abs=1e-9)
