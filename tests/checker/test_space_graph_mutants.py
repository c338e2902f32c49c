"""Mutants of graphs' proofs in 3D are refused, or what they say of curves and leaves is true."""

import functools
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from complete import complete_report
from effort import some
from helpers.floating_bodies import pushed_block
from helpers.floating_space import floating_in_space, over_alpha
from problems3d import OneNode, in_space, random_over_alpha, random_plane_over_alpha
from proof_tools import copied, proof_of, put, records_of
from space_graph_proofs import Parts, closed_branch, mutant
from space_judge_mutants import checked, judged

from enumsol.branches.space.space_graph import ByCurves
from enumsol.support.deadlines import Deadline


def orthotropic(p, seed):
    problem = random_over_alpha(p, seed)
    (F, _), (slope, _) = problem.friction, problem.friction_slope
    return problem.replace(friction=(F, 0.5 * F), friction_slope=(slope, 0.5 * slope))


CASES = {
    "friction": (lambda: random_over_alpha(2, 115), "0", "1"),
    "three curves": (lambda: random_over_alpha(2, 100), "0", "1/64"),
    "plane": (lambda: in_space(random_plane_over_alpha(1, 5)), "0", "1"),
    "orthotropic": (lambda: orthotropic(1, 514), "0", "1"),
    "load": (lambda: OneNode(5, load=True).problem, "-1", "1"),
    "singular": (lambda: OneNode(7, load=True).problem, "0.7", "1"),
    "fold": (lambda: random_over_alpha(2, 119), "0", "1/8"),
    "curves": (lambda: random_over_alpha(1, 513), "0", "1"),
    "closed": (closed_branch, "1.3", "1.6"),
    "held by contact": (lambda: over_alpha(1), "0", "0.3"),
    "block held by contact": (
        lambda: floating_in_space(pushed_block(1, max_rigid_displacement=4.0)),
        "0",
        "0.5",
    ),
}


@functools.cache
def proven(name):
    """Problem, proof and records of a graph that leaves nothing open."""
    build, low, high = CASES[name]
    cover = ByCurves(build(), (Fraction(low), Fraction(high)))
    cover.run(700, Deadline(), None, None)
    proof = cover.proof()
    return cover.problem, proof, records_of(proof)


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", CASES)
def test_mutants_are_refused_or_say_what_is_true(name):
    problem, proof, records = proven(name)
    rng, told = np.random.default_rng(40), Counter()
    complete_report(problem, proof)
    assert judged(problem, proof)[0]
    for k in range(some(20, of=100)):
        found, how = mutant(rng, records)
        report, _ = checked(problem, found)
        told[bool(report)] += 1
        if report:
            counts, reason = judged(problem, found)
            assert counts, (k, how, reason)
            assert counts["curves"] == report.curves
    assert told[False] > told[True] > 0


@pytest.mark.few(1, 1)
@pytest.mark.parametrize("name", ["orthotropic", "friction", "fold", "load"])
def test_one_step_of_both_tangents_is_changed(name):
    """In the header, and in a point and a box of every curve."""
    problem, _, records = proven(name)
    starts = [k + 1 for k, record in enumerate(records) if isinstance(record, dict) and "curve" in record]
    paths = [(0, "steps"), *((k + step, 5) for k in starts for step in (0, 1))]
    for path in paths:
        for place in range(problem.p, 3 * problem.p):
            changed = proof_of(put(records, (*path, place), lambda step: 8.0 * step))
            assert checked(problem, changed)[0] is None, (path, place)
            assert judged(problem, changed)[0] is None, (path, place)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["three curves", "closed"])
def test_the_judge_of_mutants_sees_wrong_claims(name):
    problem, _, records = proven(name)

    def refused(change):
        parts = Parts.of(copied(records))
        change(parts)
        parts.count()
        return judged(problem, proof_of(parts.records()))[0] is None

    def no_solutions(parts):
        parts.tree = [["n"] if record[0] in ("k", "r", "m") else record for record in parts.tree]

    def other_curve(parts):
        starts = parts.first_boxes()
        parts.renumber(lambda box: starts[1] if box < starts[1] else 0)

    def a_curve_twice(parts):
        parts.curves.append(parts.curves[0])

    def too_short(parts):
        del parts.curves[0][1 : len(parts.curves[0]) // 4 * 2 + 1]

    def moved(parts):
        for record in parts.curves[-1]:
            record[1] = [x * 1.01 for x in record[1]]

    assert not refused(lambda parts: None)
    for change in (no_solutions, other_curve, a_curve_twice, too_short, moved):
        assert refused(change), change.__name__
