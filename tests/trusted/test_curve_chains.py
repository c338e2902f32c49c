"""Whole curves through several boxes (theory, sections 12.8 and 12.9)."""

from fractions import Fraction

import numpy as np
import pytest
from complete import only_root
from problems3d import SLIDING, OneNode, random_over_alpha, sliding_node
from space_graph_proofs import closed_branch

from enumsol import enumerate_roots
from enumsol.arithmetic.balls import Ball
from enumsol.branches.space import chains
from enumsol.branches.space.chains import chain_through
from enumsol.search.space.curve_proposals import curve_around, curve_point
from enumsol.trusted.space.curve_runs import CurveChain, apart, link_between
from enumsol.trusted.space.solution_curve import AlphaProblem, lies_in


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
        assert not apart(CurveChain([], [joint], True, (None, None)), chain)
    assert beside > 2


def part_of(chain, first, last):
    """Some links of a chain."""
    return CurveChain.of(chain.links[first:last], chain.joints[first : last + 1], (Fraction(2, 5), Fraction(3, 5)))


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


def sliding_chain(low, high):
    """The curve of a sliding node over an interval, and that interval."""
    given, interval, alpha = AlphaProblem.of(SLIDING.enclosure), (Fraction(low), Fraction(high)), float(low + high) / 2
    return chain_through(given, SLIDING, np.append(sliding_node(alpha), alpha), interval), interval


def test_an_end_inside_the_interval_is_a_gap_with_all_that_its_box_holds():
    chain, interval = sliding_chain(Fraction(2, 5), Fraction(3, 5))
    assert (chain.whole, chain.ends, chain.gaps) == (True, (None, None), [])
    count = len(chain.links)
    for first, last in ((0, count - 1), (2, count)):
        part = CurveChain.of(chain.links[first:last], chain.joints[first : last + 1], interval)
        assert [end is None for end in part.ends] == [first == 0, last == count]
        assert not part.whole
        for end, link, joint, side in zip(
            part.ends, (part.links[0], part.links[-1]), (part.joints[0], part.joints[-1]), (-1, 1), strict=True
        ):
            if end is None:
                continue
            low, high = end
            # the node slides on one smooth curve, on which alpha is known at every t
            for t in (side * link.curve.box.half, float((link.end if side > 0 else link.start).mid)):
                alpha = link.curve.at(t).mid[-1]
                assert low <= alpha <= high
            assert low <= joint.alphas[0] <= joint.alphas[1] <= high
            assert not part.runs_through(low, high)
            assert not part.runs_through(interval[0], interval[1])
            assert not part.runs_through(high, high)
            assert part.runs_through(high + Fraction(1, 10**9), high + 1) or len(part.gaps) == 2
    assert chain.runs_through(*interval)


def test_a_curve_that_runs_twice_round_is_none():
    problem, interval = closed_branch(), (Fraction(4, 5), Fraction(8, 5))
    (root,) = (root for root in enumerate_roots(problem, 1.0625) if root.index == -1)
    x = np.concatenate([root.lambda_n, *root.lambda_t.T, [1.0625]])
    closed = chain_through(AlphaProblem.of(problem.enclosure), problem, x, interval)
    assert closed.closed
    links, joints = list(closed.links), list(closed.joints)
    assert CurveChain.of(links, joints, interval).closed
    assert CurveChain.of([*links, *links], [*joints, *joints[1:]], interval) is None
    for further in range(1, len(links)):
        assert CurveChain.of([*links, *links[:further]], [*joints, *joints[1 : further + 1]], interval) is None
    part = CurveChain.of(links[:-1], joints[:-1], interval)
    assert [end is None for end in part.ends] == [False, False]


def test_a_box_that_reaches_beyond_a_shorter_last_one_is_part_of_the_gap():
    """Else what the longer box holds behind the short one would be neither on the curve nor in its gap."""
    chain, interval = sliding_chain(Fraction(2, 5), Fraction(3, 5))
    given, k = AlphaProblem.of(SLIDING.enclosure), 2
    link, joint = chain.links[k], chain.joints[k]
    box, (low, high) = link.curve.box, (float(end.mid) for end in (link.start, link.end))
    # the curve ends a tenth of the way along that box
    places = [low + share * (high - low) for share in (0.05, 0.1)]
    points = [curve_point(given, link.curve.at(t).mid, box.border) for t in places]
    joints = [curve_around(given, point.x, point.direction, box.border, 0.0, roomy=False) for point in points]
    between = 0.5 * (points[0].x + points[1].x)
    short = curve_around(given, between, points[0].direction, box.border, 0.03 * (high - low))
    links = [
        *chain.links[:k],
        link_between(link.curve, joint, joints[0]),
        link_between(short, joints[0], joints[1]),
    ]
    part = CurveChain.of(links, [*chain.joints[: k + 1], *joints], interval)
    (end,) = part.gaps
    farthest = link.curve.at(box.half).mid[-1]
    assert short.at(short.box.half).mid[-1] < farthest
    assert end[0] <= joints[1].alphas[0] < farthest <= end[1]
