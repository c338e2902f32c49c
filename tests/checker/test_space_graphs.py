"""Proofs of all solutions in 3D over an interval, against solutions at sampled alphas, and forged ones."""

import functools
from fractions import Fraction

import numpy as np
import pytest
from complete import accepted_report, all_roots, complete_report
from problems3d import random_over_alpha
from proof_tools import of_kind, proof_of, put, records_of, replaced

import enumsol
from enumsol import enumerate_roots, gallery, verify
from enumsol.arithmetic.balls import Ball
from enumsol.branches.space.space_graph import ByCurves
from enumsol.search.space.curve_proposals import placed
from enumsol.support.deadlines import Deadline
from enumsol.trusted.space.solution_curve import AlphaProblem, lies_in

INTERVAL = Fraction(0), Fraction(1)


@functools.cache
def covered(p, seed):
    cover = ByCurves(random_over_alpha(p, seed), INTERVAL)
    cover.run(600, Deadline(), None, None)
    return cover


@pytest.mark.slow
@pytest.mark.parametrize(("p", "seed"), [(2, 2), (2, 7)])
def test_a_proof_says_that_all_solutions_lie_on_its_curves(p, seed):
    cover = covered(p, seed)
    report = accepted_report(cover.problem, cover.proof())
    assert not cover.gaps
    assert report.complete
    assert f"every solution for every alpha in [0, 1] lies on {report.curves} curve" in repr(report)
    assert report.curves == len(cover.chains)
    boxes = [link.curve.box for chain in cover.chains for link in chain.links]
    given = AlphaProblem.of(cover.problem.enclosure)
    for alpha in np.linspace(0.01, 0.99, 7):
        roots = all_roots(cover.problem, alpha)
        crossed = 0
        for chain in cover.chains:
            at = np.array([joint.at(0.0).mid[-1] for joint in chain.joints]) - alpha
            crossed += int(np.sum(at[1:] * at[:-1] < 0))
        assert crossed == len(roots)
        for root in roots:
            x = placed(given, np.concatenate([root.lambda_n, *root.lambda_t.T, [alpha]]))
            assert any(lies_in(box, Ball(x, 1e-12 * np.abs(x) + 1e-13)) for box in boxes)


@functools.cache
def block_by_certificates():
    cover = ByCurves(gallery.block3d(1, 1, 1), (Fraction(1, 2), Fraction(1)))
    cover.run(100, Deadline(), None, None)
    return cover


def test_one_certificate_says_that_a_curve_has_all_solutions_of_a_piece():
    cover = block_by_certificates()
    assert {record.kind for record in cover.records} <= {"p", "k"}
    report = verify(cover.problem, cover.proof())
    assert (report.curves, cover.gaps, report.complete) == (1, [], True)
    assert all(len(enumerate_roots(cover.problem, alpha)) == 1 for alpha in (0.5, 0.75, 1))


@pytest.mark.parametrize("way", ["numbers", "huge", "theta", "run", "backwards", "no box", "piece", "none", "steps"])
def test_forged_certificates_over_a_piece_are_refused(way):
    cover = block_by_certificates()
    records = records_of(cover.proof())
    k = of_kind(records, "k")[0]
    _, first, last, numbers = records[k]
    forged = {
        "numbers": put(records, (k, 3, 0), -numbers[0]),
        # nu, the square of which overflows
        "huge": put(records, (k, 3, 2 * cover.problem.p), 1e200),
        "theta": put(records, (k, 3), numbers[:8] + [number + 30.0 for number in numbers[8:]]),
        "run": put(records, (k, 2), first),
        "backwards": put(records, (k,), ["k", last, first, numbers]),
        "no box": put(records, (k, 2), len(cover.chains[0].links)),
        # the same said of more than the curve passes
        "piece": put(records, (0, "interval"), ["1/1000", "50"]),
        "none": replaced(records, k),
        "steps": put(records, (0, "steps", 0), 1e308),
    }
    assert not verify(cover.problem, proof_of(forged[way])).ok


def test_a_certificate_below_an_assignment_speaks_of_its_statuses_only():
    """A curve without these statuses proves nothing about them."""
    cover = block_by_certificates()
    records = records_of(cover.proof())
    k = of_kind(records, "k")[0]
    roots = [root for alpha in (0.5, 0.75, 1) for root in enumerate_roots(cover.problem, alpha)]
    assert all(root.statuses[0].value != "open" for root in roots)
    below = [["b", 0, [5, 0]], records[k], records[k]]
    assert cover.problem.p == len(cover.problem.friction[0])
    assert not verify(cover.problem, proof_of(replaced(records, k, *below))).ok


@pytest.mark.long
@pytest.mark.parametrize("cells", [(2, 1, 2), (3, 2, 2), (3, 3, 2)])
def test_a_block_has_one_curve_by_a_few_certificates(cells):
    """Statuses change dozens of times; the form holds through all of them."""
    problem = gallery.block3d(*cells)
    cover = ByCurves(problem, (Fraction(0), Fraction(2)))
    cover.run(20, Deadline(), None, None)
    assert (len(cover.chains), cover.gaps, cover.stop) == (1, [], None)
    assert {record.kind for record in cover.records} <= {"p", "k"}
    complete_report(problem, cover.proof())
    assert all(len(enumerate_roots(problem, alpha)) == 1 for alpha in (0.1, 0.3, 0.7, 1.5))


@pytest.mark.slow
def test_a_flat_block_takes_one_node():
    """3, and with 5 x 5 cells 282, where mu and kappa of open nodes are the same."""
    problem = gallery.block3d(4, 2, 1)
    cover = ByCurves(problem, (Fraction(0), Fraction(2)))
    cover.run(1, Deadline(), None, None)
    assert (len(cover.chains), cover.gaps, cover.stop) == (1, [], None)
    complete_report(problem, cover.proof())


def several_changes_at_once(load=(2, -5, -1), friction=(2.0, 1.0), slope=(-1.0, -0.5)):
    """One node whose load is (3, -3, 0) at alpha = 1, where its coefficients may be 1 and 0.5."""
    e, A = np.eye(3), [[5.25, -4, 0], [-4, 5.25, 0], [0, 0, 1.25]]
    more = np.array([3, -3, 0]) - load
    data = {"friction": friction, "friction_slope": slope, "load_slope": more}
    return enumsol.ContactProblem3D(A, e[:1], e[1:2], e[2:], load, **data)


@pytest.mark.slow
def test_the_proof_of_an_incomplete_graph_is_accepted():
    problem = several_changes_at_once()
    graph = enumsol.branch_graph(problem, (0, 1))
    assert not graph.complete
    assert not accepted_report(problem, graph.proof).complete


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("seed", range(40))
def test_proofs_of_random_graphs_are_accepted(seed):
    """In whole numbers, with several changes of statuses at one end."""
    rng = np.random.default_rng(seed)
    F = float(rng.integers(1, 5)) / 2
    ratio, slope = float(rng.choice([0.5, 1, 2])), float(rng.choice([-F, -F / 2, 0, 0.5]))
    data = {"friction": (F, F * ratio), "slope": (slope, slope * ratio)}
    problem = several_changes_at_once(rng.integers(-5, 6, 3), **data)
    graph = enumsol.branch_graph(problem, (0, 1), max_nodes=200)
    if graph.proof is not None:
        assert accepted_report(problem, graph.proof).complete == graph.complete
