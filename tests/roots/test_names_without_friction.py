"""Names, `active` and `signs` follow from enclosures or rationals, never from a float tolerance."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from complete import whole_graph
from oracles import NAMES

from enumsol import ContactProblem, ContactStatus, enumerate_roots
from enumsol.roots import local_branch

SLIPS = {0: {"stick", "slip+", "slip-"}, 1: {"slip+"}, -1: {"slip-"}}


def diagonal_problem(stiffness, load, **options):
    """Two nodes that do not feel each other: u = f / A, node i moves by (u_2i, u_2i+1)."""
    rows = np.eye(4)
    return ContactProblem(np.diag(stiffness), rows[[0, 2]], rows[[1, 3]], load, friction=0.0, **options)


@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
def test_a_node_whose_slip_is_enclosed_is_named_by_it(arithmetic):
    (root,) = enumerate_roots(diagonal_problem([1e-20, 1e-20, 1.0, 1.0], [-1.0, 0.0, 1.0, 0.5]), 0.0, arithmetic)
    assert root.statuses == (ContactStatus.OPEN, ContactStatus.SLIP_PLUS)
    assert root.active == (frozenset({ContactStatus.OPEN}), frozenset({ContactStatus.SLIP_PLUS}))
    assert (root.u_t[1], root.signs.tolist()) == (0.5, [[-1, 0, 0], [1, 1, 1]])


@pytest.mark.slow
@pytest.mark.parametrize("arithmetic", ["verified", "exact"])
def test_badly_scaled_nodes_without_friction_are_named_as_the_closed_form_says(arithmetic):
    sizes = (1e-20, 1e-6, 1.0, 1e12)
    for (a, b), load in itertools.product(itertools.product(sizes, sizes), ([-1, 0, 1, 0.5], [1, -1e-9, 2, 0])):
        (root,) = enumerate_roots(diagonal_problem([a, a, b, b], load), 0.0, arithmetic)
        for node, scale in enumerate((a, b)):
            u_n, u_t = (Fraction(v) / Fraction(scale) for v in load[2 * node : 2 * node + 2])
            sign = (u_t > 0) - (u_t < 0)
            expected = {"open"} if u_n < 0 else SLIPS[sign]
            assert {status.value for status in root.active[node]} == expected
            assert root.statuses[node].value in expected
            if u_n < 0:
                assert root.signs[node].tolist() == [-1, sign, sign]


@pytest.mark.parametrize("seed", range(30))
def test_names_on_coupled_badly_scaled_bodies_agree_with_rationals(seed):
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, 4))
    G = rng.integers(-2, 3, size=(2 * p, 2 * p))
    scale = 2.0 ** rng.integers(-30, 31, size=2 * p)
    A = scale[:, None] * (G @ G.T + np.eye(2 * p)) * scale
    f = scale * rng.integers(-2, 3, size=2 * p)
    rows = np.eye(2 * p)
    problem = ContactProblem(A, rows[:p], rows[p:], f, friction=0.0)
    verified, exact = (enumerate_roots(problem, 0.0, arithmetic) for arithmetic in ("verified", "exact"))
    assert verified.complete
    one, other = ([(r.statuses, r.active, r.signs.tolist()) for r in roots] for roots in (verified, exact))
    assert one == other
    for root in exact:
        for holds, (low, high) in zip(root.active, root.enclosure.u_t, strict=True):
            if ContactStatus.OPEN not in holds:
                assert {s.value for s in holds} == SLIPS[int(low > 0) - int(high < 0)]


def test_a_slip_that_underflows_still_has_its_sign():
    # u_t = -1e-300 / 1e100 is far below the smallest float
    problem = diagonal_problem([1.0, 1e100, 1.0, 1.0], [1.0, -1e-300, 1.0, 0.5])
    (root,) = enumerate_roots(problem, 0.0, "exact")
    assert ([status.value for status in root.statuses], root.u_t[0]) == (["slip-", "slip+"], 0.0)
    low, high = root.enclosure.u_t[0]
    assert low < 0 <= high or low < 0 < high


def test_a_sign_that_nothing_decides_leaves_all_three_names(monkeypatch):
    # of a body too large for rationals, with an enclosure of u_t that holds zero
    monkeypatch.setattr("enumsol.roots.local_branch.EXACT_DOF_LIMIT", 3)
    problem = diagonal_problem([1.0, 3.0, 1.0, 3.0], [1.0, 0.0, 1.0, 0.5])
    signs = local_branch.SlipSigns(problem, 0.0, (4, 4), (None, 1))
    assert signs.sign(0) is None
    for node in (0, 1):
        assert {status.value for status in local_branch.slip_names(signs.sign(node))} == SLIPS[node]


def test_branch_graphs_name_such_nodes_exactly():
    # u_t of node 1 is alpha - 1/2 at stiffness one, beside a node of stiffness 1e-20
    problem = diagonal_problem([1e-20, 1e-20, 1.0, 1.0], [-1.0, 0.0, 1.0, -0.5], load_slope=[0.0, 0.0, 0.0, 1.0])
    graph = whole_graph(problem, (0.0, 1.0))
    for v in graph.vertices:
        assert {status.value for status in v.active[1]} == SLIPS[int(np.sign(v.alpha - 0.5))]
    for alpha, expected in ((0.25, -1), (0.5, 0), (0.75, 1)):
        (root,) = graph.roots_at(alpha)
        assert {status.value for status in root.active[1]} == SLIPS[expected]


def test_a_vertex_at_an_irrational_alpha_names_its_frictionless_node_exactly():
    # node 0 starts to slip where 4 - alpha = alpha (3/2 + alpha); node 1 has F = 0 and u_t = alpha - 3/2
    A = np.array([[2.0, -1, 0, 0], [-1, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    rows = np.eye(4)
    problem = ContactProblem(
        A, rows[[0, 2]], rows[[1, 3]], [1.5, -4.0, 1.0, -1.5], friction=np.zeros(2),
        friction_slope=np.array([1.0, 0.0]),
        load_slope=[1.0, 1.0, 0.0, 1.0],
    )  # fmt: skip
    graph = whole_graph(problem, (0.0, 4.0), "exact")
    assert any(not v.exact.is_rational for v in graph.vertices)
    for v in graph.vertices:
        low, high = (end - Fraction(3, 2) for end in v.enclosure)
        assert {status.value for status in v.active[1]} == SLIPS[int(low > 0) - int(high < 0)]
    assert set(NAMES) >= {"open", "stick"}
