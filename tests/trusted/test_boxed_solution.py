"""Boxes with exactly one solution: against known solutions, Newton's method and the theorem's own terms."""

from dataclasses import replace

import numpy as np
import oracles3d
import pytest
from effort import some
from problems3d import (
    SLIDING,
    degenerate_integers,
    exactly,
    forces,
    from_compliance,
    random_coupled,
    scaled,
    sliding_node,
)
from space_proofs import RANDOM, random_problem

from enumsol import enumerate_roots
from enumsol.arithmetic.balls import Ball
from enumsol.search.space.open_leaves import box_around, proposed_rho
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.boxed_solution import (
    Box,
    BoxedSolution,
    BoxProblem,
    apart_in_boxes,
    is_inside,
    solution_in_box,
)

STATUSES = {"open": (1, 0, 0), "stick": (0, 1, 0), "slip": (0, 0, 1), "graze": (1, 0, 1), "limit": (0, 1, 1)}


def boxed(seed):
    """System, known forces and what is proven of a box around them, or None; what the nodes do, and F."""
    problem, lam, _, F, kinds = degenerate_integers(seed)
    solvers = SpaceSolvers(problem, 0.0, "verified")
    y = scaled(solvers.system, lam)
    box = box_around(solvers.enclosed, y)
    return solvers, y, None if box is None else solution_in_box(solvers.enclosed, box, 2.0), kinds, F


@pytest.mark.slow
def test_known_solutions_lie_in_their_boxes():
    found = 0
    for seed in range(some(15, of=120)):
        solvers, y, one, kinds, F = boxed(seed)
        if one is None:
            continue
        found += 1
        assert np.all(np.abs(y - one.y.mid) <= one.y.rad + 1e-12)
        assert np.max(one.y.rad) < 1e-9
        assert is_inside(one.y, one.w, one.box)
        assert one.index in (1, -1)
        for i, kind in enumerate(kinds):
            rubs, held = bool(np.any(F[i] > 0)), (one.open[i], one.stick[i], one.slip[i])
            if rubs:
                assert held == tuple(map(bool, STATUSES[kind])), (seed, i)
            else:
                assert held[0] == (kind in ("open", "graze"))
        # a checker asks for less
        assert solution_in_box(solvers.enclosed, one.box) is not None
    assert found > some(3, of=30)


def natural(problem, y):
    """N(y), written out."""
    S, g, rho = problem.S.mid, problem.g.mid, problem.rho
    z = y + rho * (g - S @ y)
    out = z.copy()
    for i, places in enumerate(problem.system.tau):
        t = places[places >= 0]
        out[i] = max(z[i], 0.0)
        length = np.linalg.norm(z[t])
        if length > out[i]:
            out[t] *= out[i] / length
    return y - out


@pytest.mark.slow
def test_steps_stay_within_their_bounds():
    """zeta - Y N(y) is what (12.7) and (12.13) say, and contracts, at random points of sets of all sizes."""
    rng, tried = np.random.default_rng(0), 0
    for seed in range(some(12, of=60)):
        solvers, y, _, _, _ = boxed(seed)
        problem = BoxProblem.of(solvers.enclosed, proposed_rho(solvers.enclosed)[seed % 2])
        assert problem.T.mid @ (np.eye(len(y)) + problem.rho[:, None] * problem.S.mid) == pytest.approx(np.eye(len(y)))
        centre = y * problem.system.unit + rng.normal(size=len(y)) * rng.choice([0.0, 1e-3, 0.1])
        reach = np.full(len(y), 10.0 ** rng.uniform(-4, 0))
        near = problem.around(centre)
        step = near.step(near.extent(reach))
        if step is None:
            continue
        tried += 1
        for _ in range(40):
            zeta = reach * rng.uniform(-1, 1, len(y)) * rng.choice([1.0, 0.3])
            moved = zeta - step.Y @ natural(problem, centre + problem.T.mid @ zeta) - step.move.mid
            moved -= step.G.mid @ step.first
            bound = step.E @ np.abs(zeta) + 0.5 * np.abs(step.G.mid) @ np.abs(step.V.mid @ zeta)
            assert np.all(np.abs(moved) <= bound * (1 + 1e-9) + 1e-10 * (1 + np.abs(step.Y).max()))
    assert tried > some(7, of=40)


def offset(system, box, y):
    """How far scaled forces are from the centre of a box, as the box measures it."""
    return np.abs(y - box.centre + box.rho * (system.S @ (y - box.centre)))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("part", range(4))
def test_no_box_holds_two_solutions(part):
    """Newton's method from many points finds no second solution in a box, and no box with two is accepted."""
    rng, several, inside = np.random.default_rng([3, part]), 0, 0
    named = [random_problem(*name) for name, roots in RANDOM.items() if roots > 1][part:]
    for k in range(20):
        if k < len(named):
            S, g, F = named[k].condensed.S, named[k].condensed.free_displacements(0), named[k].friction_at(0)
        else:
            S, g, F = random_coupled(rng, int(rng.integers(1, 4)))
        problem = from_compliance(S, g, tuple(F.T))
        solvers = SpaceSolvers(problem, 0.0, "verified")
        points = [scaled(solvers.system, lam) for lam in oracles3d.newton_set(S, g, F, 25, rng)]
        for y in points:
            box = box_around(solvers.enclosed, y)
            if box is None:
                continue
            inside += 1
            one = solution_in_box(solvers.enclosed, box)
            assert one is not None
            away = [offset(solvers.system, box, other) for other in points]
            assert sum(bool(np.all(size <= box.radius)) for size in away) == 1
            for other, size in zip(points, away, strict=True):
                if other is y or not np.max(size) > 0:
                    continue
                several += 1
                # a box that reaches to the other one
                reach = np.maximum(size * 1.01, box.radius)
                assert solution_in_box(solvers.enclosed, replace(box, radius=reach)) is None
    assert inside > 15
    assert several > 5


def test_indices_are_those_of_regular_roots():
    for name in ((1, 22), (2, 0), (2, 20), (3, 4)):
        problem = random_problem(*name)
        solvers = SpaceSolvers(problem, 0.0, "verified")
        indices = []
        for root in enumerate_roots(problem, 0):
            y = scaled(solvers.system, forces(root))
            one = solution_in_box(solvers.enclosed, box_around(solvers.enclosed, y))
            assert one.index == root.index
            indices.append(one.index)
        assert sum(indices) == 1
        assert -1 in indices


def soft_body(seed):
    """A problem on springs that are 1e4 times as soft as the body, and the forces of a degenerate solution."""
    rng, p = np.random.default_rng(seed), 3
    X, e = rng.normal(size=(3 * p, 3 * p)), rng.choice([-0.6, 0.6], (p, 2)) + np.array([0.0, 0.2])
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    together = np.kron(np.eye(3), np.ones((p, 1)))
    S = X @ X.T / p + 0.1 * np.eye(3 * p) + 1e4 * together @ together.T
    lam, w = np.zeros((p, 3)), np.zeros((p, 3))
    lam[0], lam[1], lam[2] = (2.0, *(2.0 * e[0])), (1.0, *e[1]), (0.0, 0.0, 0.0)  # limit, slip and open
    w[1, 1:], w[2] = e[1] / 4, (-1.0, *e[2])
    g = w.ravel(order="F") + S @ lam.ravel(order="F")
    return from_compliance(S, g, (1.0, 1.0)), lam


@pytest.mark.parametrize("seed", [0, 1, 5, 7])
def test_boxes_of_bodies_on_weak_springs(seed):
    """The data are off by their rounding: the known solution is near to the one in the box."""
    problem, lam = soft_body(seed)
    solvers = SpaceSolvers(problem, 0.0, "verified")
    y = scaled(solvers.system, lam)
    box = box_around(solvers.enclosed, y)
    one = solution_in_box(solvers.enclosed, box, 2.0)
    assert np.max(np.abs(y - one.y.mid) - one.y.rad) < 1e-8
    assert one.y.rad.max() < 1e-6
    assert (list(one.stick), list(one.slip)) == ([True, False, False], [True, True, False])
    # P is too curved over a box of forces, whatever their displacements are
    forces = Box.of(solvers.enclosed, box.centre, box.radius, 1e-9 * box.rho)
    assert solution_in_box(solvers.enclosed, forces) is None


def test_boxes_that_are_none():
    solvers, _, one, _, _ = boxed(1)
    system, box = solvers.enclosed, one.box
    c, r, rho = box.numbers
    centres = [(other, r, rho) for other in (c + 3.0, np.inf * np.ones_like(c))]
    radii = [(c, factor * r, rho) for factor in (0.0, -1.0, np.nan, 1e300)]
    for numbers in (*centres, *radii, *((c, r, factor * rho) for factor in (0.0, -1.0, np.inf))):
        with np.errstate(all="ignore"):
            assert solution_in_box(system, Box.of(system, *numbers)) is None
    assert box_around(system, np.full(len(c), np.nan)) is None


@pytest.mark.parametrize(("alpha", "size"), [(0.5, 1.5), (1.0, 0.1875)])
def test_both_components_of_tau_have_one_rho(alpha, size):
    """With two the natural map has another zero, which is no solution (theory, (12.10))."""
    solvers = SpaceSolvers(SLIDING, alpha, "verified")
    (rho, _), radius = proposed_rho(solvers.enclosed), np.full(3, size)
    y, zero = (scaled(solvers.system, sliding_node(alpha, ratio)) for ratio in (1.0, 8.0))
    one = solution_in_box(solvers.enclosed, Box.of(solvers.enclosed, y, radius, rho))
    assert np.all(np.abs(one.y.mid - y) <= one.y.rad + 1e-12)
    assert np.max(np.abs(zero - y)) > 0.1
    for centre in (y, zero):
        for factors in ([1, 1, 8], [1, 0.125, 1], [1, 1, 1 + 2.0**-52]):
            assert solution_in_box(solvers.enclosed, Box.of(solvers.enclosed, centre, radius, rho * factors)) is None


def test_components_in_other_units_have_one_rho_in_the_problems_own():
    """A small coefficient along one axis, so that the units of both components differ."""
    problem = from_compliance(np.diag([1.0, 2.0, 4.0]), np.array([1.0, 3.0, 4.0]), ([0.5], [2.0**-12]))
    solvers = SpaceSolvers(problem, 0.0, "verified")
    assert len(set(solvers.system.unit)) == 2
    box = box_around(solvers.enclosed, scaled(solvers.system, forces(enumerate_roots(problem, 0)[0])))
    rho = box.rho * solvers.system.unit**2
    assert (rho[1] == rho[2], box.rho[1] == box.rho[2]) == (True, False)
    assert solution_in_box(solvers.enclosed, box) is not None
    same = Box.of(solvers.enclosed, box.centre, box.radius, box.rho[[0, 1, 1]])
    assert solution_in_box(solvers.enclosed, same) is None


def test_which_solutions_are_the_same():
    problem = exactly([[0, 0, 0], [2, 1, 0]], [[0, 0.375, -0.5], [0, 0, 0]])
    solvers = SpaceSolvers(problem, 0.0, "verified")
    y = scaled(solvers.system, np.array([[0, 0, 0], [2.0, 1, 0]]))
    one = solution_in_box(solvers.enclosed, box_around(solvers.enclosed, y))
    half = solution_in_box(solvers.enclosed, replace(one.box, radius=0.5 * one.box.radius))
    elsewhere = Box.of(solvers.enclosed, one.box.centre + 1.0, one.box.radius * 0.1, one.box.rho)
    kept, doubtful, same = apart_in_boxes([], [((1, 1), one), ((0, 1), half)])
    assert ([codes for codes, _ in kept], doubtful) == ([(0, 1)], [])
    assert same == [(((1, 1), one), ((0, 1), half))]
    moved = Ball(one.y.mid + 1.0, one.y.rad)
    other = BoxedSolution(moved, one.w, one.open, one.stick, one.slip, 1, elsewhere)
    assert len(apart_in_boxes([], [((1, 1), one), ((0, 1), other)])[0]) == 2
    wide = Ball(one.y.mid, np.full_like(one.y.rad, 9.0))
    unknown = BoxedSolution(wide, one.w, one.open, one.stick, one.slip, 1, elsewhere)
    # the one is not known to lie in the box of the other, nor the other in that of the one
    assert apart_in_boxes([], [((0, 1), one), ((1, 1), unknown)]).doubtful == [((1, 1), unknown)]
