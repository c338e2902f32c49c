"""Forged leaves "a" of proofs in 3D: refused, or true all the same, by a judge in floats of its own."""

import functools

import numpy as np
import pytest
from complete import complete_report
from effort import some
from problems3d import exactly, from_compliance
from proof_tools import copied, of_kind, proof_of, put, records_of, why_refused
from space_proofs import case, random_problem
from trees import by_the_tree

from enumsol import enumerate_roots, gallery, verify

NAMES = ("block", "degenerate", "few tau")
_LEAF, _NUMBERS, _MID, _RAD, _INDEX = range(1, 6)


@functools.cache
def proven(name):
    """Problem and records of a proof that is one leaf."""
    if name == "block":
        problem = gallery.block3d(2, 2, 1, friction=(0.4, 0.25))
    elif name == "degenerate":
        # a node that grazes and slides, one at rest without load, one that just sticks, and one that slips
        lam = [[0, 0, 0], [0, 0, 0], [5, 3, 4], [2, 2, 0]]
        problem = exactly(lam, [[0, 1, 1], [0, 0, 0], [0, 0, 0], [0, 3, 0]])
    else:
        friction = (np.array([0.5, 0.0, 0.3]), np.array([0.0, 0.0, 0.2]))
        problem = from_compliance(np.eye(9), np.array([1.0, 2, -1, 0.8, 1, 0.5, 0.1, 0.2, 0.3]), friction)
    records = records_of(enumerate_roots(problem, 0, max_nodes=1).proof)
    assert [record[0] for record in records[1:-1]] == ["a"]
    assert (len(records[1][_LEAF]) == 0) == (name == "degenerate")
    return problem, records


class LeafJudge:
    """What a leaf claims, by docs/proof_format.md alone, in floats: refuses what is wrong by more than rounding."""

    def __init__(self, name):
        problem, records = proven(name)
        self.p, force = problem.p, np.ldexp(1.0, np.array(records[0]["force"]))
        F = problem.friction_at(0)
        node, axis = np.nonzero(F > 0)
        self.node, self.m = node, self.p + len(node)
        rows = np.concatenate([np.arange(self.p), (1 + axis) * self.p + node])
        units = np.concatenate([force, force[node]]) * np.concatenate([np.ones(self.p), F[node, axis]])
        length = np.ldexp(1.0, np.array(records[0]["length"]))
        unit = units * (force * length)[0]
        self.S = units[:, None] * problem.condensed.S[np.ix_(rows, rows)] * units / (force * length)[0]
        self.g = units * problem.condensed.free_displacements(0)[rows] / (force * length)[0]
        assert np.all(unit > 0)
        # the known solution, not by this leaf alone: it solves
        self.y = np.array(records[1][_MID])
        self.w = self.g - self.S @ self.y

    def parts(self, i):
        return self.p + np.flatnonzero(self.node == i)

    def solves(self):
        for i in range(self.p):
            t = self.parts(i)
            n, tau, v = self.y[i], self.y[t], self.w[t]
            worst = max(-n, self.w[i], abs(n * self.w[i]), np.linalg.norm(tau) - n)
            assert max(worst, abs(tau @ v - n * np.linalg.norm(v))) < 1e-9

    def right(self, record):
        numbers = np.array(record[_NUMBERS], dtype=float)
        p, m = self.p, self.m
        mu, kappa, s = numbers[: 3 * p].reshape(3, p)
        nu, theta = (np.concatenate([np.zeros(p), part]) for part in numbers[3 * p :].reshape(2, m - p))
        if np.any(mu <= 0) or np.any(kappa <= 0) or np.any(s < 0):
            return False
        D, less = np.zeros((m, m)), np.zeros((m, m))
        for i in range(p):
            t = self.parts(i)
            size = np.linalg.norm(theta[t])
            if np.linalg.norm(nu[t]) > mu[i] * (1 + 1e-12) or size > 1 + 1e-11:
                return False
            if s[i] > 0 and (size > 0 or not len(t)):
                return False
            D[i, i], D[i, t], D[t, t] = mu[i], nu[t], kappa[i]
            if s[i] > 0:
                less[i, i] += s[i]
                less += kappa[i] ** 2 * self.S[t].T @ self.S[t] / s[i]
            else:
                D[t, i] = -kappa[i] * self.served(i, t, mu[i], kappa[i], nu[t], theta[t])
        Q = D.T @ self.S
        definite = np.linalg.eigvalsh(0.5 * (Q + Q.T - less))[0] > -1e-9
        mid, rad = np.array(record[_MID], dtype=float), np.array(record[_RAD], dtype=float)
        inside = np.all(np.abs(mid - self.y) <= rad + 1e-9)
        return bool(definite and inside and np.all(rad >= 0) and record[_INDEX] == 1)

    def served(self, i, t, mu, kappa, nu, theta):
        """The theta that the test is about."""
        n, gap, v = self.y[i], -self.w[i], self.w[t]
        size = np.linalg.norm(v)
        if n < 1e-9 and (mu - np.linalg.norm(nu)) * gap >= kappa * (size - theta @ v) - 1e-9 and gap > 1e-9:
            return theta
        return v / size if size > 1e-9 else self.y[t] / n if n > 1e-9 else theta


@pytest.mark.parametrize("name", NAMES)
def test_the_judge_agrees_with_what_is_true(name):
    judge, (problem, records) = LeafJudge(name), proven(name)
    judge.solves()
    assert judge.right(records[1])
    report = complete_report(problem, proof_of(records))
    assert (report.roots, report.leaves, report.undecided) == (1, 1, 0)


def refused(name, *path, value):
    """The reasons for which a leaf with another value at a path is refused."""
    problem, records = proven(name)
    return why_refused(problem, put(records, (1, *path), value))


@pytest.mark.parametrize("name", NAMES)
def test_signs_and_sizes_of_numbers(name):
    problem, records = proven(name)
    p, count = problem.p, len(records[1][_NUMBERS])
    judge = LeafJudge(name)
    for place in range(2 * p):
        # kappa of a node without tau is not used
        used = place < p or len(judge.parts(place - p))
        for value in (0.0, -1.0, 1e-300, 1e300)[: None if used else 2]:
            refused(name, _NUMBERS, place, value=value)
    tau = (count - 3 * p) // 2
    for place in range(3 * p, count):
        for value in (1.0 + 1e-9, *((-2.0, 1e150) if place < 3 * p + tau else (-1.5, 1e200))):
            refused(name, _NUMBERS, place, value=value)


@pytest.mark.parametrize("name", NAMES)
def test_theta_that_does_not_serve(name):
    """At a loaded node theta is known: another one is accepted only where Q has more to spare than it is off."""
    judge, (problem, records) = LeafJudge(name), proven(name)
    p, m = problem.p, judge.m
    refusals, right = 0, []
    for i in range(p):
        t = judge.parts(i)
        size = np.linalg.norm(judge.w[t]) if len(t) else 0.0
        if not len(t) or (judge.y[i] < 1e-6 and (size < 1e-6 or judge.w[i] < -1e-6)):
            continue
        for sign in (-1.0, 0.0):
            values = list(records[1][_NUMBERS])
            for k in t:
                values[m + 2 * p + k - p] *= sign
            if values == records[1][_NUMBERS]:
                continue
            changed = put(records, (1, _NUMBERS), values)
            right.append(judge.right(changed[1]))
            ok = verify(problem, proof_of(changed)).ok
            assert not ok or right[-1]
            refusals += not ok
    assert right
    assert refusals > 0 or all(right)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", NAMES)
def test_balls_and_indices(name):
    _, records = proven(name)
    for index in (-1, 0, 2, 1.0, True, "1", None):
        assert "index" in refused(name, _INDEX, value=index)
    for place, radius in enumerate(records[1][_RAD]):
        if radius < 1e-200:
            continue
        moved = records[1][_MID][place] + 3 * radius
        assert "its enclosure does not hold" in refused(name, _MID, place, value=moved) or records[1][_LEAF] == []
        refused(name, _MID, place, value=records[1][_MID][place] + 1.0)
        assert "its enclosure does not hold" in refused(name, _RAD, place, value=0.1 * radius)
        refused(name, _RAD, place, value=-radius)
        refused(name, _RAD, place, value=0.0)


def test_other_leaves():
    problem, records = proven("block")
    leaf = records[1][_LEAF]
    # without its leaf it is known by its distance, which is not known so well
    for codes in (*([code] * problem.p for code in (0, 1, 5, 6)), leaf[:-1], [*leaf, 0], "0", []):
        refused("block", _LEAF, value=codes)
    for place, code in enumerate(leaf):
        for other in (-1, 2, 3, 4, 7, 8, 9, 11, 2**70, code + 5 if code > 8 else 12):
            refused("block", _LEAF, place, value=other)


def test_below_the_root_of_the_tree():
    problem, records = proven("block")
    end = {"roots": 1, "undecided": 1, "leaves": 2}
    # node 0 is open, or it is in contact
    ways = [["b", 0, children] for children in ([5, 0], [0, 5])]
    reports = [verify(problem, proof_of([records[0], way, records[1], ["u", ""], end])) for way in ways]
    assert sorted(report.ok for report in reports) == [False, True]
    assert "the only one in it" in str(min(reports, key=lambda report: report.ok))
    without = ["a", [], *records[1][2:]]
    report = verify(problem, proof_of([records[0], ways[0], without, ["u", ""], end]))
    assert "below the root of the tree without a leaf" in " ".join(report.failures)
    # twice, and after the end of the tree
    for before, count in (([["b", 0, [5, 0]]], 2), ([], 1)):
        twice = [records[0], *before, records[1], records[1], {"roots": count, "undecided": 0, "leaves": 2}]
        assert not verify(problem, proof_of(twice)).ok


@pytest.mark.parametrize("name", [(1, 22), (2, 0), (2, 5)], ids=str)
def test_a_root_among_several_is_never_the_only_one(name):
    """With the leaf and the ball of a true root, and any numbers."""
    rng, (problem, _, records, _) = np.random.default_rng(2), case(name)
    p = problem.p
    m = p + int(np.count_nonzero(problem.friction_at(0)))
    assert of_kind(records, "r")
    for record in (records[k] for k in of_kind(records, "r")):
        for _ in range(some(5, of=15)):
            theta = np.array(record[1][p:]).reshape(p, 2)
            theta /= np.maximum(np.linalg.norm(theta, axis=1, keepdims=True), 1e-9)
            numbers = [*np.exp(rng.normal(size=2 * p)), *[0.0] * p, *[0.0] * (m - p), *theta.ravel()]
            forged = ["a", [], [float(x) for x in numbers], *record[1:3], 1]
            report = verify(problem, proof_of([records[0], forged, {"roots": 1, "undecided": 0, "leaves": 1}]))
            assert "not proven to be the only one" in " ".join(report.failures)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", NAMES)
def test_random_mutants_are_refused_or_true(name):
    rng, (problem, records), judge = np.random.default_rng(9), proven(name), LeafJudge(name)
    accepted = 0
    for _ in range(count := some(20, of=50)):
        changed = copied(records)
        for _ in range(int(rng.integers(1, 4))):
            entry = int(rng.choice([_NUMBERS, _NUMBERS, _MID, _RAD]))
            values = changed[1][entry]
            place = int(rng.integers(len(values)))
            factor = float(rng.choice([0.0, -1.0, 0.5, 2.0, 1 + 1e-12, 1.1, 10.0]))
            values[place] = values[place] * factor + float(rng.choice([0.0, 0.0, 1e-13, 1e-3, 0.3]))
        report = verify(problem, proof_of(changed))
        if report.ok:
            accepted += 1
            assert (report.complete, report.roots) == (True, 1)
            assert judge.right(changed[1])
    assert 0 < accepted < 0.8 * count


def test_the_leaf_of_another_problem():
    first, other = random_problem(1, 0), random_problem(1, 22)
    with by_the_tree():
        header = records_of(enumerate_roots(other, 0).proof)[0]
    records = records_of(enumerate_roots(first, 0).proof)
    if records[1][0] == "a":
        assert not verify(other, proof_of([header, *records[1:]])).ok
