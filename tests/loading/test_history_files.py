"""Histories saved and read back, and drawn."""

import json

import numpy as np
import pytest
from refusals import bad_argument

import enumsol
from enumsol import History, InvalidArgumentError, histories


@pytest.mark.parametrize("arithmetic", ["verified", "exact", "fast"])
def test_a_history_is_read_back_to_the_last_bit(arithmetic, tmp_path):
    problem = enumsol.gallery.one_node_triangle(f=(1.5, -4.0))
    history = histories(problem, ["5", "8/3", 3.0], arithmetic=arithmetic, refine=arithmetic == "fast")
    history.save(tmp_path / "h.json")
    again = History.load(tmp_path / "h.json", problem)
    assert repr(again) == repr(history)
    assert again.to_frame().equals(history.to_frame())
    assert again.refinement == history.refinement
    for one, other in zip(again.data.stages, history.data.stages, strict=True):
        assert one.start.key == other.start.key
        assert one.roots.alpha == other.roots.alpha
        for a, b in zip(one.roots, other.roots, strict=True):
            assert np.array_equal(a.lambda_t, b.lambda_t)
            assert a.exact_slips == b.exact_slips
            assert np.array_equal(a.u, b.u)
    with pytest.raises(InvalidArgumentError, match="holds a history of another problem"):
        History.load(tmp_path / "h.json", enumsol.gallery.one_node_triangle(f=(1, -4)))


@pytest.mark.slow
def test_a_history_in_space_with_families_and_open_parts_is_read_back(tmp_path, pulled_wedge):
    for problem, steps in (
        (enumsol.gallery.get("wedge3d-2-3").build(), [1, 1.5]),
        (enumsol.gallery.one_node_triangle(f=(1, -2)), [2]),
        (pulled_wedge, [0, 1, 0, 1]),
    ):
        history = histories(problem, steps)
        history.save(tmp_path / "h.json")
        again = History.load(tmp_path / "h.json", problem)
        assert repr(again) == repr(history)
        assert len(again.stages(1)[0].roots.families) == len(history.stages(1)[0].roots.families)


def test_damaged_files_are_refused(tmp_path, out_again, pulled_wedge):
    place = tmp_path / "h.json"
    out_again.save(place)
    record = json.loads(place.read_text())
    for change in ({"format": "x"}, {"version": 9}, {"stages": [{}]}, {"steps": 1}):
        place.write_text(json.dumps(record | change))
        bad_argument(r"h\.json", History.load, place, pulled_wedge)
    bad_argument("cannot be read", History.load, tmp_path / "none.json", pulled_wedge)


def test_every_history_is_a_line(out_again, tmp_path):
    figure = out_again.plot(file=tmp_path / "h.png")
    assert (tmp_path / "h.png").stat().st_size > 10_000
    (ax,) = figure.axes
    lines = [line for line in ax.lines if len(line.get_xdata()) == 2]
    assert len(lines) == out_again.graph.number_of_edges() - 1  # nothing is drawn from the start, which has no load
    tops = sorted(float(line.get_ydata()[1]) for line in lines)
    assert tops == [0.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0]
    by_step = out_again.plot("step", "dissipated").axes[0]
    drawn = [line for line in by_step.lines if len(line.get_xdata()) == 2]
    assert len(drawn) == out_again.graph.number_of_edges()
    own = out_again.plot("step", lambda root: root.margin).axes[0]
    assert own.get_xlabel() == "step"
    labels = {text.get_text() for text in by_step.texts}
    assert any("4.4" in label for label in labels)
    bad_argument("x is 'force'; expected one of step, alpha", out_again.plot, "force")
