"""Curves of a proof in 3D that are one and the same, or parts of one, are not counted twice (theory, section 12.9)."""

import functools
from fractions import Fraction

import numpy as np
import pytest
from space_graph_proofs import closed_branch

from enumsol import enumerate_roots, verify
from enumsol.branches.space.chains import chain_through
from enumsol.branches.space.space_graph import ByCurves
from enumsol.search.space.piece_tree import OpenLeaf
from enumsol.trusted.space.solution_curve import AlphaProblem


@functools.cache
def problem():
    return closed_branch()


@functools.cache
def part(low, high, alpha):
    """The curve over an interval through the root of index -1 on this branch."""
    (root,) = (root for root in enumerate_roots(problem(), alpha) if root.index == -1)
    x = np.concatenate([root.lambda_n, *root.lambda_t.T, [alpha]])
    chain = chain_through(AlphaProblem.of(problem().enclosure), problem(), x, (Fraction(low), Fraction(high)))
    assert chain.whole
    return chain


def claimed(chains, low, high):
    """What the checker says of these curves over an interval, with a tree that leaves all of it open."""
    ends = Fraction(low), Fraction(high)
    tree = [OpenLeaf(*ends)]
    return verify(problem(), ByCurves(problem(), ends, chains=list(chains), records=tree).proof())


@pytest.mark.slow
def test_a_part_of_a_closed_curve_is_no_second_curve():
    whole, some = part("0.8", "1.6", 1.0625), part("0.8", "1.2", 1.0625)
    assert (whole.closed, some.closed) == (True, False)
    assert (claimed([whole], "0.8", "1.2").curves, claimed([some], "0.8", "1.2").curves) == (1, 1)
    for both in ([whole, some], [some, whole], [whole, whole]):
        report = claimed(both, "0.8", "1.2")
        assert (report.ok, "two curves may be the same" in repr(report)) == (False, True)


def test_a_curve_that_leaves_the_interval_and_returns_is_not_counted_again():
    """The long one comes through the interval twice; along the short one it has no point between two of its boxes."""
    low, high = "1.07", "1.09"
    long, short = part("0.8", "1.2", 1.0625), part(low, high, 1.078125)
    inside = [float(low) < joint.alphas[0] < joint.alphas[1] < float(high) for joint in long.joints]
    assert sum(inside) == 1
    for both in ([short, long], [long, short]):
        assert not claimed(both, low, high).ok


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, -1])
def test_different_curves_over_an_interval_are_both_counted(order):
    (top,) = (root for root in enumerate_roots(problem(), 1.0625) if root.statuses[0].value == "open")
    x = np.concatenate([top.lambda_n, *top.lambda_t.T, [1.0625]])
    ends = Fraction("0.8"), Fraction("1.2")
    other = chain_through(AlphaProblem.of(problem().enclosure), problem(), x, ends)
    for one in (part("0.8", "1.6", 1.0625), part("0.8", "1.2", 1.0625)):
        report = claimed([one, other][::order], *ends)
        assert (report.ok, report.curves, report.complete) == (True, 2, False)
