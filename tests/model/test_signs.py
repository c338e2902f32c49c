"""Signs of loads and supports: about twelve along each side of a body, and where a solid is first seen from."""

import numpy as np
import pytest

from enumsol.model.shapes import SIGNS, first_view, signs


def rectangle(nx, ny):
    """Points around a rectangle of 2 by 1, and the edges between neighbours."""
    x, y = np.linspace(0, 2, nx + 1), np.linspace(0, 1, ny + 1)
    sides = [(x[:-1], 0 * x[1:]), (0 * y[1:] + 2, y[:-1]), (x[:0:-1], 0 * x[1:] + 1), (0 * y[1:], y[:0:-1])]
    points = np.concatenate([np.stack(side, axis=1) for side in sides])
    number = np.arange(len(points))
    return points, np.stack([number, np.roll(number, -1)], axis=1)


def check_groups(shown, nodes):
    """Every node belongs to one sign, which is one of them."""
    assert sorted(np.concatenate([group for _, group in shown]).tolist()) == sorted(nodes.tolist())
    assert all(node in group for node, group in shown)


@pytest.mark.parametrize("nx", [5, 12, 40, 333])
def test_a_side_has_about_twelve_and_both_ends(nx):
    points, edges = rectangle(nx, 30)
    nodes = np.flatnonzero(points[:, 1] == 1)
    shown = signs(points, nodes, edges)
    check_groups(shown, nodes)
    spots = np.sort(points[[node for node, _ in shown], 0])
    assert len(spots) == (nx + 1 if nx < 15 else SIGNS)
    assert spots[[0, -1]].tolist() == [0, 2]
    assert np.diff(spots).max() <= np.diff(spots).min() + 2 * 2 / nx + 1e-12


def test_corners_end_a_side_and_have_one_sign():
    points, edges = rectangle(100, 50)
    nodes = np.flatnonzero((points[:, 1] == 1) | (points[:, 0] == 0))
    shown = signs(points, nodes, edges)
    check_groups(shown, nodes)
    places = points[[node for node, _ in shown]]
    assert len(places) == 2 * SIGNS - 1
    assert {(0, 0), (0, 1), (2, 1)} <= {tuple(place) for place in places.tolist()}


def test_a_ring_has_no_ends_and_nodes_without_neighbours_stand_alone():
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    edges = np.stack([np.arange(60), (np.arange(60) + 1) % 60], axis=1)
    shown = signs(points, np.arange(60), edges)
    assert [len(group) for _, group in shown] == [5] * SIGNS
    few = signs(points, np.arange(0, 60, 7), edges)
    assert [len(group) for _, group in few] == [1] * 9
    assert signs(points, np.array([], dtype=int), edges) == []
    inside = np.random.default_rng(3).uniform(size=(400, 2))
    assert len(signs(inside, np.arange(400), np.empty((0, 2), dtype=int))) == SIGNS


def test_on_a_solid_they_are_far_apart():
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    number = np.arange(400).reshape(20, 20)
    pairs = ((number[:-1], number[1:]), (number[:, :-1], number[:, 1:]))
    edges = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])
    nodes = np.flatnonzero(points[:, 0] != 9)  # two patches
    shown = signs(points, nodes, edges)
    check_groups(shown, nodes)
    assert len(shown) == 2 * SIGNS
    places = points[[node for node, _ in shown]]
    # no node is far from its sign
    assert all(np.linalg.norm(points[group] - points[node], axis=1).max() < 5 for node, group in shown)
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 99 * np.eye(len(places))
    assert apart.min() > 2


@pytest.mark.parametrize("normal", [(0, 0, -1), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
def test_a_solid_is_first_seen_from_the_side_of_its_contact(normal):
    way = first_view(np.tile(normal, (4, 1)))
    assert np.linalg.norm(way) == pytest.approx(1)
    assert 0.3 < way @ normal < 0.95  # and not straight on, where it looks flat


def test_where_normals_are_not_known_the_view_is_the_usual_one():
    np.testing.assert_allclose(first_view(np.zeros((3, 3))), [0.505, -0.778, 0.375], atol=1e-3)
