"""Whole curves through several boxes (theory, sections 12.8 and 12.9)."""

from fractions import Fraction

import numpy as np
import pytest
from complete import only_root
from problems3d import SLIDING, OneNode, random_over_alpha, sliding_node

from enumsol.arithmetic.balls import Ball
from enumsol.branches.space import chains
from enumsol.branches.space.chains import chain_through
from enumsol.trusted.space.curve_chains import CurveChain, apart
from enumsol.trusted.space.solution_curve import AlphaProblem, curve_around, curve_point, lies_in


def test_one_curve_followed_twice_is_not_two(monkeypatch):
    # the second chain ends farther from the interval, in none of the first one's boxes
    given, interval, found = AlphaProblem.of(SLIDING.enclosure), (Fraction(2, 5), Fraction(3, 5)), []
    for alpha, beyond in ((0.5, 0.05), (0.55, 2.0)):
        monkeypatch.setattr(chains, "_BEYOND", beyond)
        found.append(chain_through(given, SLIDING, np.append(sliding_node(alpha), alpha), interval))
    one, other = found
    assert (one.whole, other.whole) == (True, True)
    assert float(other.joints[-1].alphas[0]) > float(one.joints[-1].alphas[1]) + 0.004
    assert not apart(other, one)
    assert not apart(one, other)


@pytest.mark.parametrize("alpha", [0.41, 0.59])
def test_a_chain_reaches_beyond_both_ends(alpha):
    interval = Fraction(2, 5), Fraction(3, 5)
    chain = chain_through(AlphaProblem.of(SLIDING.enclosure), SLIDING, np.append(sliding_node(alpha), alpha), interval)
    ends = sorted(joint.alphas for joint in (chain.joints[0], chain.joints[-1]))
    assert ends[0][1] < interval[0]
    assert ends[1][0] > interval[1]
    assert all(link.curve.index == 1 for link in chain.links)


def test_a_point_where_a_curve_bends_beyond_its_box_is_on_it():
    problem, alpha = random_over_alpha(2, 126), 0.5
    given, root = AlphaProblem.of(problem.enclosure), only_root(problem, alpha)
    x = np.concatenate([root.lambda_n, *root.lambda_t.T, [alpha]])
    chain = chain_through(given, problem, x, (Fraction(0), Fraction(1)))
    (corner,) = (link for link in chain.links if None in link.curve.statuses)
    box = corner.curve.box
    beside = 0
    for t in np.linspace(float(corner.start.mid), float(corner.end.mid), 9)[1:-1]:
        point = curve_point(given, corner.curve.at(t).mid, box.border)
        if None in point.statuses or any(lies_in(link.curve.box, Ball.exact(point.x)) for link in chain.links):
            continue
        joint = curve_around(given, point.x, point.direction, box.border, 0.0)
        beside += 1
        assert not apart(CurveChain([], [joint], True), chain)
    assert beside > 2


def part_of(chain, first, last):
    """Some links of a chain."""
    return CurveChain(chain.links[first:last], chain.joints[first : last + 1], False)


def test_parts_of_one_curve_share_what_they_share():
    # the second one has boxes of its own, and other points
    given, interval = AlphaProblem.of(SLIDING.enclosure), (Fraction(2, 5), Fraction(3, 5))
    one, other = (
        chain_through(given, SLIDING, np.append(sliding_node(alpha), alpha), interval) for alpha in (0.5, 0.55)
    )
    assert len(one.links) >= 3
    begin, end = part_of(one, 0, 1), part_of(one, len(one.links) - 1, len(one.links))
    assert apart(begin, end)
    assert not apart(part_of(one, 0, 2), part_of(one, 1, 3))
    for part in (begin, end, one):
        assert not apart(part, other)
        assert not apart(other, part)


def test_curves_of_different_solutions_apart():
    node = OneNode(1, load=True)
    given, phi = AlphaProblem.of(node.problem.enclosure), node.folds()[0]
    found = []
    for away in (0.02, -0.02):
        alpha, n, t = node.at(phi + away)
        reach = Fraction(abs(alpha - node.alpha(phi)) / 4)
        interval = Fraction(alpha) - reach, Fraction(alpha) + reach
        found.append(chain_through(given, node.problem, np.array([n, *t, alpha]), interval))
    assert apart(*found)
    assert not apart(found[0], found[0])
