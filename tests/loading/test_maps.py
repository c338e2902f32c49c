"""Maps over alpha and a second parameter against branch graphs and enumerations at single values."""

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from helpers.floating_bodies import pushed_block
from helpers.floating_oracle import Oracle
from interruptions import CtrlC, interrupted
from refusals import bad_argument, refusal

import enumsol
from enumsol import MultiplicityMap, enumerate_roots, multiplicity_map
from enumsol.loading.maps import _replaced

SQUARE = enumsol.gallery.two_node_square()


@pytest.fixture(scope="module")
def over_gap():
    return multiplicity_map(SQUARE, (0, 5), {"gap": [0.0, 0.05, 0.1]})


@pytest.mark.slow
def test_every_value_is_what_enumerate_roots_counts(over_gap):
    assert over_gap.complete
    for value in over_gap.values:
        problem = SQUARE.replace(gap=value)
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


def test_problems_of_a_map_share_their_factors_and_their_data_are_those_replaced():
    block = enumsol.gallery.get("clamped-block-8").build()
    block = enumsol.ContactProblem(
        block.A, block.Bn, block.Bt, block.f, friction=0.1, friction_slope=1.0, load_slope=-block.f
    )
    for name, value in (("friction", 0.5), ("gap", 1e-3), ("load", 0.25)):
        made = _replaced(block, name, np.arange(block.n, dtype=float), value)
        data = {"f": block.f + value * np.arange(block.n)} if name == "load" else {name: value}
        data |= {"friction_slope": 0.0} if name == "friction" else {}
        again = enumsol.ContactProblem(
            block.A,
            block.Bn,
            block.Bt,
            **{"f": block.f, "friction": 0.1, "friction_slope": 1.0, "load_slope": -block.f, **data},
        )
        assert made.fingerprint == again.fingerprint
        assert made.factorization is block.factorization
        ones = np.ones((2, 2 * block.p))
        balls = [problem.enclosure.at(0.5, *ones).balls for problem in (made, again)]
        for mine, other in zip(*balls, strict=True):
            assert np.all(np.abs(mine.mid - other.mid) <= mine.rad + other.rad)


def test_folds_are_linked_between_neighbours(over_gap):
    assert over_gap.curves
    for curve in over_gap.curves:
        rows = [k for k, _ in curve]
        assert rows == list(range(rows[0], rows[0] + len(rows)))
        for k, alpha in curve:
            assert alpha in [fold.alpha for fold in over_gap.rows[k].folds]
    linked = sorted(place for curve in over_gap.curves for place in curve)
    assert linked == sorted((k, fold.alpha) for k, row in enumerate(over_gap.rows) for fold in row.folds)


@pytest.mark.slow
def test_other_parameters_and_an_executor():
    node = enumsol.gallery.one_node_triangle(f=(1.5, -4.0))
    path = node.replace(f=0 * node.f, friction=5.0, friction_slope=0, load_slope=node.f)
    by_friction = multiplicity_map(path, (0.1, 1), {"friction": [1, 5]})
    assert [row.between for row in by_friction.rows] == [(1,), (3,)]
    by_load = multiplicity_map(node, (1, 5), {"load": (node.f, [0, 1.0])})
    with ThreadPoolExecutor(2) as pool:
        spread = multiplicity_map(node, (1, 5), {"load": (node.f, [0, 1.0])}, executor=pool)
    assert [row.between for row in spread.rows] == [row.between for row in by_load.rows] == [(1, 3), (1, 3)]
    made = multiplicity_map(None, (1, 5), (lambda x: enumsol.gallery.one_node_triangle(f=(x, -4.0)), [1.5, 3.0]))
    assert made.rows[0].between == (1, 3)


def test_what_is_not_done_is_said(over_gap):
    call = (SQUARE, (0, 5), {"gap": [0.0, 0.1]})
    short = multiplicity_map(*call, max_nodes=1)
    assert (short.complete, short.rows[0].exact) == (False, False)
    assert "not proven at 2 of 2 values" in repr(short)
    assert not multiplicity_map(*call, time_limit=1e-9).complete
    partial = interrupted("after 1 of 2 values", multiplicity_map, *call, progress=CtrlC())
    assert isinstance(partial, MultiplicityMap)
    assert (partial.values, partial.complete) == ((0.0,), False)


def test_what_cannot_be_asked():
    node = enumsol.gallery.one_node_triangle()
    found = multiplicity_map(node, (0, 1), {"gap": [0.0]})
    assert found.multiplicity_at(0.0, 1) == 1
    bad_argument("value is 0.5; expected one of the values of the map", found.multiplicity_at, 0.5, 1)
    bad_argument(r"alpha is 2; expected it in the interval", found.multiplicity_at, 0.0, 2)
    bad_argument("are not options here", multiplicity_map, node, (0, 1), {"gap": [0.0]}, interval=(0, 2))


def test_the_picture_has_a_line_for_every_range(over_gap, tmp_path):
    figure = over_gap.plot(file=tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 5_000
    (ax,) = figure.axes
    flat = [line for line in ax.lines if line.get_linestyle() == "-"]
    assert len(flat) == len(over_gap.to_frame())
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "one solution, proven at these values" in labels
    assert "between the values: not proven" in labels
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
    kinds = (enumsol.InvalidArgumentError, enumsol.InvalidProblemError)
    refusal(kinds, message, multiplicity_map, enumsol.gallery.one_node_triangle(), (1, 5), over)


def test_a_map_of_a_body_that_nothing_holds_against_rationals():
    problem = pushed_block(1, max_rigid_displacement=4.0)
    found = enumsol.multiplicity_map(problem, (0, 3), {"friction": [0.125, 0.5]})
    assert found.complete
    for value in found.values:
        for alpha in (0, Fraction(1, 2), 1, 2, 3):
            oracle = Oracle(problem.replace(friction=value), alpha)
            assert found.multiplicity_at(value, alpha) == len(oracle.points) + oracle.families
    assert [row.within for row in found.rows] == [4.0] * 2
    assert "within rigid displacements of 4; says nothing about those between" in repr(found)
    reaches = [problem, problem.replace(max_rigid_displacement=8.0)]
    several = enumsol.multiplicity_map(None, (0, 0.5), (lambda value: reaches[int(value)], [0, 1]))
    assert "within rigid displacements of 4 to 8" in several.closing_line
