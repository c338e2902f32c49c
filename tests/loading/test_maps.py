"""Maps over alpha and a second parameter against branch graphs and enumerations at single values."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import enumsol
from enumsol import Interrupted, InvalidArgumentError, MultiplicityMap, enumerate_roots, multiplicity_map


@pytest.fixture(scope="module")
def over_gap():
    return multiplicity_map(enumsol.gallery.two_node_square(), (0, 5), {"gap": [0.0, 0.05, 0.1]})


def test_every_value_is_what_enumerate_roots_counts(over_gap):
    import dataclasses

    square = enumsol.gallery.two_node_square()
    assert over_gap.complete
    for value in over_gap.values:
        problem = dataclasses.replace(square, gap=value)
        for alpha in (0.5, 2.9, 3.3, 3.7, 4.5, 5):
            roots = enumerate_roots(problem, alpha)
            assert over_gap.multiplicity_at(value, alpha) == len(roots) + len(roots.families)
    limits = [row.limit for row in over_gap.rows]
    assert limits[0] == 3.0
    assert limits == sorted(limits)
    frame = over_gap.to_frame()
    assert set(frame["value"]) == {0.0, 0.05, 0.1}
    assert frame["exact"].all()
    assert "says nothing about those between" in repr(over_gap)


def test_folds_are_linked_between_neighbours(over_gap):
    assert over_gap.curves
    for curve in over_gap.curves:
        rows = [k for k, _ in curve]
        assert rows == list(range(rows[0], rows[0] + len(rows)))
        for k, alpha in curve:
            assert alpha in [fold.alpha for fold in over_gap.rows[k].folds]
    linked = sorted(place for curve in over_gap.curves for place in curve)
    assert linked == sorted((k, fold.alpha) for k, row in enumerate(over_gap.rows) for fold in row.folds)


def test_other_parameters_and_an_executor():
    node = enumsol.gallery.one_node_triangle(f=(1.5, -4.0))
    path = enumsol.ContactProblem(node.A, node.Bn, node.Bt, 0 * node.f, friction=5.0, load_slope=node.f)
    by_friction = multiplicity_map(path, (0.1, 1), {"friction": [1, 5]})
    assert [row.between for row in by_friction.rows] == [(1,), (3,)]
    by_load = multiplicity_map(node, (1, 5), {"load": (node.f, [0, 1.0])})
    with ThreadPoolExecutor(2) as pool:
        spread = multiplicity_map(node, (1, 5), {"load": (node.f, [0, 1.0])}, executor=pool)
    assert [row.between for row in spread.rows] == [row.between for row in by_load.rows] == [(1, 3), (1, 3)]
    made = multiplicity_map(None, (1, 5), (lambda x: enumsol.gallery.one_node_triangle(f=(x, -4.0)), [1.5, 3.0]))
    assert made.rows[0].between == (1, 3)


def test_what_is_not_done_is_said(over_gap):
    square = enumsol.gallery.two_node_square()
    short = multiplicity_map(square, (0, 5), {"gap": [0.0, 0.1]}, max_nodes=1)
    assert not short.complete
    assert not short.rows[0].exact
    assert "not proven at 2 of 2 values" in repr(short)
    none = multiplicity_map(square, (0, 5), {"gap": [0.0, 0.1]}, time_limit=1e-9)
    assert not none.complete

    def press_ctrl_c(done, of):
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="after 1 of 2 values") as caught:
        multiplicity_map(square, (0, 5), {"gap": [0.0, 0.1]}, progress=press_ctrl_c)
    partial = caught.value.partial
    assert isinstance(partial, MultiplicityMap)
    assert partial.values == (0.0,)
    assert not partial.complete


def test_the_picture_has_a_line_for_every_range(over_gap, tmp_path):
    figure = over_gap.plot(file=tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 5_000
    (ax,) = figure.axes
    flat = [line for line in ax.lines if line.get_linestyle() == "-"]
    assert len(flat) == len(over_gap.to_frame())
    assert {float(line.get_ydata()[0]) for line in flat} == set(over_gap.values)
    assert len([line for line in ax.lines if line.get_linestyle() == "--"]) == len(over_gap.curves)


@pytest.mark.parametrize(
    ("over", "message"),
    [
        ({"stiffness": [1]}, "over is"),
        ([1, 2], "over is"),
        ({"gap": 1}, "the values of over are 1; expected a sequence"),
        ({"gap": [1, 1]}, "one occurs twice"),
        ({"load": [1, 2]}, "over is"),
        ({"load": (np.zeros(3), [1])}, "direction"),
    ],
)
def test_parameters_that_cannot_be_used(over, message):
    with pytest.raises((InvalidArgumentError, enumsol.InvalidProblemError), match=message):
        multiplicity_map(enumsol.gallery.one_node_triangle(), (1, 5), over)
