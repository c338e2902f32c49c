"""Polygons of arcs for plots: they lie on the arcs, and near them in between."""

import numpy as np
import pytest
from refusals import bad_argument

from enumsol import branch_graph, gallery
from enumsol.branches.figures.curves import curves

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
