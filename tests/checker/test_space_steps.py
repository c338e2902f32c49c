"""Forged proofs in 3D whose steps have two numbers for the components of one tangential force.

Zeros of such a natural map are no solutions (theory, (12.10)): the proofs say that they are all there are.
"""

from fractions import Fraction

import numpy as np
import pytest
from complete import all_roots
from problems3d import SLIDING, sliding_node
from proof_tools import of_kind, proof_of, put, records_of, replaced, why_refused
from space_judge_mutants import checked, judged
from trees import by_the_tree

from enumsol import branch_graph

LOW, HIGH = Fraction(49, 100), Fraction(51, 100)
WHY = "both components of a tau need the same step"


def boxed_root(ratio):
    """A proof that the only solution at 1/2 is that of a box, which is so if both rho are the same."""
    with by_the_tree():
        records = records_of(all_roots(SLIDING, 0.5).proof)
    (k,) = of_kind(records, "r")
    root = [0.5, *sliding_node(0.5, ratio)[1:].tolist()]
    return replaced(records, k, ["l", root, [1.5] * 3, [1.0, 1.0, ratio], root, [1e-6] * 3, 1])


def curve(ratio, rho, steps):
    """A proof that all solutions over an interval lie on a curve with coordinates of such steps, in one box."""
    header = records_of(branch_graph(SLIDING, (LOW, HIGH)).proof)[0]
    assert header["steps"] == [1.0, 0.25, 0.25]

    def point(alpha):
        y = sliding_node(alpha, ratio)
        w = np.array([1.0, 3.0, 4.0]) - np.array([1.0, 2.0, 4.0]) * y
        return np.append(y - steps * w, alpha)

    def box(alpha, half, size):
        direction = (point(alpha + 0.01) - point(alpha - 0.01)) / 0.02
        return ["w", point(alpha).tolist(), direction.tolist(), [0.0, 0.0, 0.0, 1.0], [size] * 4, rho, half]

    thetas = [x / float(alpha) for alpha in (LOW, HIGH) for x in sliding_node(float(alpha), ratio)[1:].tolist()]
    return [
        {**header, "steps": steps},
        {"curve": 1},
        box(0.488, 0.0, 0.01),
        box(0.5, 0.02, 0.05),
        box(0.512, 0.0, 0.01),
        {"tree": True},
        ["k", 0, 0, [1.0, 1.0, 0.0, 0.0, *thetas]],
        {"curves": 1, "arcs": None, "leaves": 1, "gaps": 0},
    ]


def test_a_zero_that_is_no_solution_in_a_box():
    report, _ = checked(SLIDING, proof_of(boxed_root(1.0)))
    assert (report.complete, report.roots) == (True, 1)
    assert judged(SLIDING, proof_of(boxed_root(1.0)))[0]["roots"] == 1
    assert "its box is not proven to hold one solution" in why_refused(SLIDING, boxed_root(8.0))
    assert judged(SLIDING, proof_of(boxed_root(8.0))) == (None, WHY)


@pytest.mark.parametrize(
    ("rho", "steps", "why"),
    [
        ([1.0, 1.0, 8.0], [1.0, 0.25, 0.25], "curve 1 is not proven to be one from end to end"),
        ([1.0, 1.0, 1.0], [1.0, 0.25, 2.0], "the same for both tangential directions of a node"),
        # the product has one number for both
        ([1.0, 8.0, 1.0], [1.0, 0.25, 2.0], "the same for both tangential directions of a node"),
    ],
)
def test_a_curve_of_zeros_that_are_no_solutions(rho, steps, why):
    true = curve(1.0, [1.0, 1.0, 1.0], [1.0, 0.25, 0.25])
    report, _ = checked(SLIDING, proof_of(true))
    assert (report.complete, report.curves) == (True, 1)
    assert judged(SLIDING, proof_of(true))[0]["curves"] == 1
    forged = curve(8.0, rho, steps)
    assert why in why_refused(SLIDING, forged)
    assert judged(SLIDING, proof_of(forged)) == (None, WHY)


@pytest.mark.parametrize("k", [2, 3, 4])
def test_steps_of_one_box_of_a_curve(k):
    true = curve(1.0, [1.0, 1.0, 1.0], [1.0, 0.25, 0.25])
    for values in ([1.0, 1.0, 8.0], [1.0, 1.0, 1 + 2.0**-52], [1.0, 0.0, 0.0], [1.0, -1.0, -1.0]):
        changed = put(true, (k, 5), values)
        assert why_refused(SLIDING, changed)
        assert judged(SLIDING, proof_of(changed))[0] is None
