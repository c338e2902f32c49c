"""Every printed number lies in its enclosure, that of the unloaded body among them."""

import json
import re
from fractions import Fraction

import numpy as np
import pytest
from generators import integer_problem, random_problem, singular_problem, through_the_unloaded_state
from path_problems import integer_problem as integer_path

from enumsol import ContactProblem, ContactStatus, branch_graph, enumerate_roots, gallery, write_problem
from enumsol.cli import main

QUANTITIES = ("lambda_n", "lambda_t", "u_n", "u_t")


def outside(roots):
    """Values of roots that are not in their enclosure, and enclosures that a status contradicts."""
    found = []
    for k, root in enumerate(roots):
        for name in QUANTITIES:
            value, bounds = getattr(root, name), getattr(root.enclosure, name)
            wrong = ~((bounds[:, 0] <= value) & (value <= bounds[:, 1]))
            found += [(k, name, int(i), value[i], bounds[i].tolist()) for i in np.flatnonzero(wrong)]
        for i, holds in enumerate(root.active):
            if ContactStatus.OPEN in holds and np.any(root.enclosure.lambda_n[i] * [1, -1] > 0):
                found.append((k, "open with a force", i))
            if holds - {ContactStatus.OPEN} and np.any(root.enclosure.u_n[i] * [1, -1] > 0):
                found.append((k, "in contact with a gap", i))
    return found


def rest(p=1):
    """Every status in 2D at every node."""
    return (frozenset(ContactStatus) - {ContactStatus.SLIP},) * p


def test_the_body_without_load_at_alpha_rests_exactly(capsys, tmp_path):
    problem = ContactProblem(
        [[3, -1, 0], [-1, 3, 2], [0, 2, 4]], [[-1, 0, 0]], [[0, 1, 0]], [0, -3, 0], load_slope=[0, 1, 0],
        friction=0.5, friction_slope=2.0,
    )  # fmt: skip
    for arithmetic in ("verified", "exact"):
        roots = enumerate_roots(problem, 3.0, arithmetic)
        (root,) = roots
        assert (roots.complete, root.active) == (True, rest())
        assert (root.index, root.regular, root.margin) == (1, False, 0.0)
        assert not any(np.any(getattr(one, name)) for one in (root, root.enclosure) for name in QUANTITIES)
        assert root.signs.tolist() == [[0, 0, 0]]
    write_problem(problem, tmp_path / "rest.npz")
    assert main(["roots", str(tmp_path / "rest.npz"), "--alpha", "3", "--json", "-"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["roots"]
    assert row["u_n"] == row["u_t"] == [0.0]
    assert len(row["active"][0]) == 4


@pytest.mark.parametrize("alpha", [3, Fraction(1, 3), Fraction(10, 7)])
@pytest.mark.parametrize("p", [1, 2, 6])
def test_bodies_that_lose_their_load_at_any_alpha_rest_exactly(alpha, p):
    rng = np.random.default_rng(p)
    G = rng.normal(size=(2 * p + 1, 2 * p + 1))
    slope = np.round(rng.normal(size=2 * p + 1) * 2**10) * float(Fraction(alpha).denominator)
    load = -slope * float(Fraction(alpha).numerator) / float(Fraction(alpha).denominator)
    B = np.eye(2 * p + 1)
    problem = ContactProblem(G @ G.T + np.eye(2 * p + 1), B[:p], B[p : 2 * p], load, load_slope=slope, friction=0.4)
    assert problem.is_unloaded(alpha)
    for arithmetic in ("verified", "exact"):
        (root,) = enumerate_roots(problem, alpha, arithmetic)
        assert (root.active, root.index, outside([root])) == (rest(p), 1, [])
        assert not np.any(root.u_t)


def test_the_unloaded_body_without_friction_has_its_names():
    problem = ContactProblem(np.eye(2), [[1, 0]], [[0, 1]], [0, 0], friction=0.0)
    for arithmetic in ("verified", "exact", "fast"):
        (root,) = enumerate_roots(problem, 0.0, arithmetic)
        assert (root.active, root.enclosure is None) == (rest(), arithmetic == "fast")


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
@pytest.mark.parametrize("make", [random_problem, integer_problem, singular_problem])
def test_numbers_of_random_problems_lie_in_their_enclosures(make, arithmetic):
    for seed in range(25):
        rng = np.random.default_rng(seed)
        roots = enumerate_roots(make(rng, int(rng.integers(1, 4))), 0.0, arithmetic)
        assert outside(roots) == []


@pytest.mark.few(7)
@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
@pytest.mark.parametrize("power", [-60, -20, 20, 60])
def test_numbers_of_badly_scaled_problems_lie_in_their_enclosures(power, arithmetic):
    for seed in range(10):
        problem = integer_problem(np.random.default_rng(seed), 2)
        scale = np.array([1.0, 2.0**power, 1.0, 2.0**power])
        scaled = problem.replace(A=scale[:, None] * problem.A.toarray() * scale, f=scale * problem.f)
        assert outside(enumerate_roots(scaled, 0.0, arithmetic)) == []


#: Gallery entries of up to 16 contact nodes; those with thousands of roots take long.
SMALL = [
    pytest.param(entry, id=name, marks=[pytest.mark.slow] if (entry.roots or 0) > 1000 else [])
    for name, entry in gallery.GALLERY.items()
    if entry.dimension == 2 and not re.search(r"-(?:20|32|64|100)\b", name)
]


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("entry", SMALL)
def test_numbers_of_the_gallery_lie_in_their_enclosures(entry):
    assert outside(enumerate_roots(entry.build(), entry.alpha)) == []


def test_roots_of_branch_graphs_lie_in_their_enclosures():
    problem, interval = through_the_unloaded_state()
    graph = branch_graph(problem, interval)
    for alpha in (-1.0, 0.0, Fraction(1, 3), 2.0):
        assert outside(graph.roots_at(alpha)) == []
    assert [root.active for root in graph.roots_at(0.0)] == [rest()]
    for seed in range(12):
        rng = np.random.default_rng(seed)
        graph = branch_graph(integer_path(rng, 2, ("friction", "load", "both")[seed % 3]), (0.0, 2.0))
        for v in graph.vertices:
            assert outside(graph.roots_at(Fraction(v.alpha))) == []


def test_a_rational_that_is_no_float_is_enclosed_between_its_neighbours():
    third = ContactProblem(3.0 * np.eye(2), [[1, 0]], [[0, 1]], [-1.0, 1.0], friction=1.0)
    (root,) = enumerate_roots(third, 0.0, "exact")
    low, high = root.enclosure.u_t[0]
    assert Fraction(low) < Fraction(1, 3) < Fraction(high)
