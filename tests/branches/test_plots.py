"""Figures of branch graphs, in pixels where it matters: labels, lines side by side, zooms, legends, titles."""

from fractions import Fraction
from itertools import combinations, pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.text import Text
from path_problems import sheet_of_one_node
from refusals import bad_argument

from enumsol import branch_graph, gallery
from enumsol.branches.claims import MultiplicitySteps
from enumsol.branches.figures.curves import QUANTITIES, Curve, curves, side_by_side
from enumsol.branches.figures.panels import MARKERS, STATUS_STYLES, _names, narrow_changes, ranges
from enumsol.model.statuses import ContactStatus
from enumsol.support.plotting import new_figure


@pytest.fixture(scope="module")
def graphs():
    return {
        "square": branch_graph(gallery.two_node_square(), (0, 10)),
        "chain": branch_graph(gallery.chain(3), (0, 10)),
        "spike": branch_graph(gallery.wedge(2, 3, (0, 5e-4), half_angle=5.0), (0, 1)),
        "oblique": branch_graph(gallery.get("wedge-8-5").build(), (0, 5)),
    }


def numbers_of(axis):
    return [text for text in axis.texts if text.get_gid() == "branch number"]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    ("name", "quantity"),
    [*((name, q) for name in ("square", "chain", "oblique") for q in (None, "lambda_n", "u_t")), ("spike", None)],
)
def test_numbers_neither_overlap_nor_leave_their_panel(graphs, name, quantity):
    figure = graphs[name].plot(quantity)
    figure.draw_without_rendering()
    labelled = 0
    for axis in figure.axes:
        boxes = [text.get_window_extent() for text in numbers_of(axis)]
        labelled += len(boxes)
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
        frame = axis.get_window_extent()
        assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes)
        assert all(frame.y0 <= box.y0 and box.y1 <= frame.y1 for box in boxes)
    assert labelled > 0


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["square", "chain", "oblique"])
def test_every_branch_is_named_beside_its_curve_or_in_the_note(graphs, name):
    graph = graphs[name]
    figure = graph.plot("lambda_n", zoom=False)
    labels = [text.get_text().split(" (")[0].replace(" ..", "") for axis in figure.axes for text in numbers_of(axis)]
    named = {word for label in labels for word in label.split(", ")}
    note = figure.get_supxlabel()
    for branch in graph.branches:
        # a long label names the first, the second and the last of a group
        assert str(branch.number) in named or "side by side" in note


def test_branches_that_coincide_are_drawn_apart_and_said_to(graphs):
    figure = graphs["square"].plot("lambda_n")
    figure.draw_without_rendering()
    axis = figure.axes[1]
    lines = [line for line in axis.lines if len(line.get_xdata()) > 2 and not np.any(line.get_ydata())]
    assert len(lines) == 2  # open on both branches, lambda_n = 0
    heights = [line.get_transform().transform((5.0, 0.0))[1] for line in lines]
    assert abs(heights[0] - heights[1]) > 2.0
    assert {line.get_color() for line in lines} == {"#1f5fa8", "#d9730d"}
    assert "side by side" in figure.get_supxlabel()
    assert "side by side" not in graphs["square"].plot().get_supxlabel()
    # apart from that a line lies where the values are
    top = next(line for line in axis.lines if len(line.get_xdata()) > 2 and line.get_ydata().min() > 0.99)
    assert top.get_transform() is axis.transData or top.get_transform() == axis.transData


def line(alphas, values):
    a = np.asarray(alphas, dtype=float)
    return Curve(a, a, a, np.asarray(values, dtype=float)[:, None])


def test_places_of_curves_side_by_side():
    drawn = {
        0: line([0, 10], [0, 0]),
        1: line([0, 4], [0, 0]),  # on 0
        2: line([4, 10], [0, 5]),  # leaves it
        3: line([6, 10], [0, 1e-3]),  # near 0 within a line's width
        4: line([0, 10], [-5, 5]),  # crosses
        5: line([5.0, 5.01], [0, 0]),  # too short to be told
    }
    places = side_by_side(drawn, {0: 0, 1: 1, 2: 1, 3: 2, 4: 3, 5: 4}, 0)
    assert [places[k].among for k in range(6)] == [2, 2, 1, 2, 1, 1]
    assert places[0].rank == 0
    assert places[1].rank == places[3].rank == 1  # they never meet each other
    assert places[0].group == places[1].group == places[3].group != places[4].group
    assert side_by_side({}, {}, 0) == {}


def steps(alphas, between):
    return MultiplicitySteps(tuple(Fraction(a) for a in alphas), tuple([0] * len(alphas)), tuple(between), True)


@pytest.mark.parametrize(
    ("alphas", "between", "expected"),
    [
        ([0, 3, 10], [1, 3], []),
        ([0, 3, 3.01, 10], [1, 1, 3], []),  # a transition and a fold close together hide nothing
        ([0, 3, 3.01, 10], [1, 5, 1], [(2.9925, 3.0175)]),
        ([0, 3, 3.01, 3.02, 10], [1, 5, 5, 1], [(2.985, 3.035)]),
        ([0, 3, 3.01, 3.02, 10], [1, 3, 5, 7], [(2.985, 3.035)]),
        ([0, 1, 1.01, 5, 5.01, 8, 8.01, 10], [1, 2, 1, 5, 1, 3, 1], [(4.9925, 5.0175), (7.9925, 8.0175)]),
        ([0, 9.99, 10], [1, 3], [(9.9825, 10)]),
        # a step that would not be seen in the window of its neighbour has its own
        ([0, 3, 3.1, 3.1001, 10], [1, 3, 5, 3], [(2.925, 3.175), (3.099925, 3.100175)]),
        ([0, 3, 3.1, 3.1001, 7, 7.01, 10], [1, 3, 5, 3, 5, 3], [(3.099925, 3.100175), (6.9925, 7.0175)]),
        ([0, 0.001], [5], []),
    ],
)
def test_windows_around_narrow_steps(alphas, between, expected):
    found = narrow_changes(steps(alphas, between), (0.0, 10.0))
    np.testing.assert_allclose(np.reshape(found, (-1, 2)), np.reshape(expected, (-1, 2)), atol=1e-9)


@pytest.mark.slow
def test_a_spike_is_shown_larger(graphs):
    graph = graphs["spike"]
    alphas, _, between = graph.steps
    low, high = next(
        (a, b) for (a, b), n in zip(pairwise(map(float, alphas)), between, strict=True) if n == 5 and b - a > 1e-9
    )
    assert high - low < 1e-3
    main, counts, zoomed, zoomed_counts = graph.plot().axes
    assert main.get_xlim() == (0, 1)
    a, b = zoomed.get_xlim()
    assert 0 <= a < low < high < b <= 1
    assert (low - a) + (b - high) < 2 * (high - low)
    # as high as the arcs that end there: the fold takes more than half of the height
    ends = [np.linalg.norm(np.concatenate([v.lambda_n, v.lambda_t])) for v in graph.vertices if low <= v.alpha <= high]
    bottom, top = zoomed.get_ylim()
    assert bottom < min(ends) < max(ends) < top
    assert max(ends) - min(ends) > 0.5 * (top - bottom)
    assert counts.get_ylim()[1] == zoomed_counts.get_ylim()[1] > 5


def test_a_part_is_shown_larger_where_that_is_asked_for(graphs):
    square = graphs["square"]
    assert len(square.plot().axes) == len(square.plot(zoom=False).axes) == 2
    figure = square.plot("lambda_n", [0], zoom=(2.9, 20), multiplicity=False)
    main, part = figure.axes
    assert part.get_xlim() == (2.9, 10)
    assert part.get_title("left").startswith("A: alpha from 2.9, width 7.1;")
    assert [text.get_text() for text in main.texts if text.get_gid() is None] == ["A"]
    # as high as the arcs that end inside, with as much room above as below
    ending = [arc for arc in square.arcs if 2.9 < arc.lo < 10 or 2.9 < arc.hi < 10]
    assert 0 < len(ending) < len(square.arcs)
    values = [arc.values(alpha)[0][0] for arc in ending for alpha in arc.sampled(200) if alpha >= 2.9]
    room = 0.15 * (max(values) - min(values))
    assert part.get_ylim() == pytest.approx((min(values) - room, max(values) + room), rel=1e-2, abs=1e-2 * room)
    # where none ends, or all keep their value, the height is that of everything
    assert square.plot("lambda_n", [0], zoom=(8, 9), multiplicity=False).axes[1].get_xlim() == (8, 9)


@pytest.mark.parametrize("window", [None, (2.9, 4.0)])
def test_chords_are_near_at_ten_times_finer_points_in_all_quantities_at_once(graphs, window):
    graph, tolerance = graphs["square"], 1e-3
    width = 10.0 if window is None else window[1] - window[0]
    drawn = curves(graph.arcs, tuple(QUANTITIES), width, tolerance, window)
    everything = np.concatenate([curve.values for curve in drawn.values()])
    height = np.ptp(everything, axis=0)
    for arc in graph.arcs:
        curve = drawn[arc.number]
        if window is not None:
            assert window[0] <= curve.alphas[0] < curve.alphas[-1] <= window[1]
        for k in range(len(curve.alphas) - 1):
            low, high = curve.alphas[k : k + 2]
            rise = (curve.values[k + 1] - curve.values[k]) / height
            run = (high - low) / width
            for share in np.linspace(0, 1, 11)[1:-1]:
                alpha = min(max(low + share * (high - low), arc.lo), arc.hi)
                forces, moves = (np.concatenate(pair) for pair in (arc.values(alpha), arc.displacements(alpha)))
                n, t, u, w = np.split(np.concatenate([forces, moves]), 4)
                exact = np.concatenate([[np.linalg.norm(forces)], [n.sum()], [t.sum()], n, t, u, w])
                up, across = (exact - curve.values[k]) / height, (alpha - low) / width
                off = np.abs(run * up - rise * across) / np.maximum(np.hypot(run, rise), 1e-300)
                assert np.max(off) < 1.5 * tolerance


def test_the_legend_names_every_mark(graphs):
    for quantity in (None, "lambda_n"):
        graph = graphs["oblique"]
        figure = graph.plot(quantity)
        entries = {text.get_text() for text in figure.legends[0].get_texts()}
        assert {MARKERS[v.kind][2] for v in graph.vertices if v.kind in MARKERS} <= entries
        if quantity is None:
            assert {f"index {arc.index:+d}" for arc in graph.arcs} <= entries
        else:
            assert {status.value for arc in graph.arcs for status in arc.statuses} <= entries
        assert "number at that alpha alone" in entries


def test_both_slips_have_styles_of_their_own():
    assert STATUS_STYLES[ContactStatus.SLIP_PLUS] != STATUS_STYLES[ContactStatus.SLIP_MINUS]
    assert len({str(style) for style in STATUS_STYLES.values()}) == 4


def test_a_long_title_stays_over_its_panel(graphs):
    figure = graphs["square"].plot(title="a body with a name that says a lot about it, " * 4, zoom=(2.9, 4))
    figure.canvas.draw()
    main, part = figure.axes[0], figure.axes[2]
    assert part.get_title("left").startswith("A: ")
    title = main.get_title("left")
    assert title.count("\n") >= 2
    (drawn,) = (text for text in main.findobj(Text) if text.get_text() == title)
    assert drawn.get_window_extent().x1 < part.get_window_extent().x0


def test_no_part_is_shown_larger_that_is_as_narrow_as_rounding():
    steps = SimpleNamespace(alphas=[0.0, 1.0, 1.0 + 1e-14, 2.0, 2.0 + 1e-7, 4.0], between=[1, 3, 5, 7, 9])
    ((low, high),) = narrow_changes(steps, (0.0, 4.0))
    assert low < 2.0 < 2.0 + 1e-7 < high < 2.0 + 1e-6


def test_title_units_and_other_axes(graphs):
    figure = graphs["square"].plot("u_n", [1], title="square", units=("N", "mm"))
    assert figure.axes[0].get_title("left") == "square, alpha in [0, 10]; complete: yes (proven)"
    assert figure.axes[0].get_ylabel() == "u_n of node 1 [mm]"
    axes = new_figure().subplots(1, 2)
    assert graphs["square"].plot("lambda_n", [0], ax=axes[1]) is axes[1].figure
    assert not axes[0].lines
    above, _ = new_figure().subfigures(2)
    assert graphs["square"].plot(ax=above.subplots()) is above.canvas.figure
    assert "side by side" not in axes[1].get_xlabel()
    assert axes[1].get_legend() is not None
    assert figure._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"quantity": "pressure"}, "quantity is 'pressure'"),
        ({"quantity": "norm", "nodes": [0]}, "nodes are given with the quantity 'norm'"),
        ({"units": "N"}, "units is 'N'"),
        ({"ax": 3}, "ax is a int"),
        ({"nodes": [0, 1], "ax": "axes"}, "expected one label"),
        ({"quantity": "u_n", "nodes": [0, 2]}, r"nodes is \[0, 2\]; expected labels among \[0, 1\]"),
        ({"quantity": "u_n", "nodes": 0}, "nodes is 0; expected labels"),
        ({"zoom": (20, 30)}, r"expected an interval that overlaps \[0, 10\]"),
    ],
)
def test_what_cannot_be_drawn_is_refused(graphs, options, message):
    if options.get("ax") == "axes":
        options = {**options, "ax": new_figure().subplots()}
    bad_argument(message, graphs["square"].plot, **options)


def test_a_sheet_is_shaded_from_end_to_end():
    graph = branch_graph(sheet_of_one_node(), (-1, 1))
    assert ": sheet, 1 arc, alpha in [0, 1]" in repr(graph)
    axis = graph.plot().axes[0]
    (band,) = [part for part in axis.collections if part.get_label() != "A"]
    corners = band.get_paths()[0].vertices
    # the load (1, -2) grows like alpha, and so does the largest force, (1, -2) itself at alpha = 1
    assert (corners[:, 0].min(), corners[:, 0].max()) == (0, 1)
    assert corners[:, 1].max() == pytest.approx(5**0.5)
    low, high = axis.get_ylim()
    assert low < 0 < 5**0.5 < high

    # displacements of a sheet are not drawn
    assert not graph.plot("u_n", [0]).axes[0].collections


def test_it_is_said_where_there_is_no_room_for_numbers(graphs):
    axis = new_figure(figsize=(2.4, 1.8)).subplots()
    graphs["chain"].plot("lambda_n", [0], ax=axis)
    written = {text.get_text() for text in numbers_of(axis)}
    assert len(written) < len(graphs["chain"].branches)
    assert axis.get_xlabel().startswith("alpha\n")
    assert "no room for the numbers of branches " in axis.get_xlabel()


def test_many_numbers_in_short():
    assert ranges([1, 4, 5, 6, 9, 10]) == "1, 4-6, 9, 10"
    assert [_names(list(range(2, last))) for last in (3, 6, 9)] == ["2", "2, 3, 4, 5", "2, 3, .. 8 (7)"]


# -- polygons of arcs --------------------------------------------------------------------------------------------------


GRAPHS = [("one-node-6.1", (0, 10)), ("two-node-6.7-minus", (-3, 3)), ("chain-2", (0, 10)), ("wedge-8-5", (1, 5))]


def arcs_of(name, interval):
    graph = branch_graph(gallery.get(name).build(), interval)
    return graph, [arc for arc in graph.arcs if not arc.dimension]


def quantity_of(arc, alpha, quantity):
    pair = arc.values(alpha) if quantity.startswith("lambda") else arc.displacements(alpha)
    return pair[0 if quantity.endswith("_n") else 1]


@pytest.mark.few(0, 3)
@pytest.mark.parametrize("quantity", ["lambda_n", "lambda_t", "u_n", "u_t"])
@pytest.mark.parametrize(("name", "interval"), GRAPHS)
def test_points_between_are_near_the_polygon(name, interval, quantity):
    _, arcs = arcs_of(name, interval)
    width, tolerance = float(interval[1] - interval[0]), 1e-3
    drawn = curves(arcs, quantity, width, tolerance)
    everything = np.concatenate([values for _, _, _, values in drawn.values()])
    height = np.ptp(everything, axis=0)
    changes = height > 1e-9 * (np.max(np.abs(everything), axis=0) + 1e-300)
    for arc in arcs:
        alphas, _, _, values = drawn[arc.number]
        assert (alphas[0], alphas[-1]) == arc.interval
        assert np.all(np.diff(alphas) >= 0)
        for alpha in arc.sampled(41):
            exact = quantity_of(arc, float(alpha), quantity)
            for node in np.flatnonzero(changes):
                corners = np.stack([alphas / width, values[:, node] / height[node]], axis=1)
                point = np.array([alpha / width, exact[node] / height[node]])
                assert distance(point, corners) < 2 * tolerance


def distance(point, corners):
    """Distance of a point from a polygon, segment by segment."""
    starts, steps = corners[:-1], np.diff(corners, axis=0)
    squares = np.maximum(np.sum(steps**2, axis=1), 1e-300)
    share = np.clip(np.sum((point - starts) * steps, axis=1) / squares, 0.0, 1.0)
    return np.min(np.linalg.norm(starts + share[:, None] * steps - point, axis=1))


def test_straight_arcs_take_few_points_and_curved_ones_more():
    _, arcs = arcs_of("one-node-6.1", (0, 10))
    drawn = curves(arcs, "lambda_n", 10.0, 1e-3)
    sizes = {str(arc.statuses[0]): len(drawn[arc.number].alphas) for arc in arcs}
    assert sizes["open"] == sizes["stick"] < 20
    assert sizes["slip-"] > 20
    finer = curves(arcs, "lambda_n", 10.0, 1e-5)
    assert max(len(curve.alphas) for curve in finer.values()) > 4 * max(sizes.values())


def test_nothing_to_draw():
    assert curves([], "lambda_n", 1.0, 1e-3) == {}


def test_a_plot_takes_a_tolerance():
    graph, _ = arcs_of("one-node-6.1", (0, 10))
    rough, fine = (graph.plot(tolerance=tolerance).axes[0] for tolerance in (0.05, 1e-4))
    assert max(len(line.get_xdata()) for line in fine.lines) > max(len(line.get_xdata()) for line in rough.lines)
    bad_argument("tolerance is 0", graph.plot, tolerance=0)
