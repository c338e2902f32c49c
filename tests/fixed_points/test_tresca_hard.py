"""Tresca problems that are hard: ill-conditioned, grazing, with bounds of all sizes; judged by conditions by hand."""

import warnings

import numpy as np
import pytest
from effort import some

import enumsol
from enumsol import ContactProblem3D


def violation(S, g, bound, F, found):
    """The largest violation of (theory, section 11.2), forces relative to the load's and displacements to the free.

    Of every pair of conditions, one of which holds with equality, the better one counts.
    """
    p = len(bound)
    energy = np.sqrt(g @ np.linalg.solve(S, g))
    force = max(np.max(np.abs(found.forces)), np.max(energy / np.sqrt(np.diagonal(S))))
    length = np.max(np.abs(g))
    w = (g.astype(np.longdouble) - S.astype(np.longdouble) @ found.forces.astype(np.longdouble)).astype(float)
    w_n, w_t = w[:p], w[p:].reshape(2, p).T
    worst = max(np.max(w_n) / length, -np.min(found.lambda_n) / force, 0.0)
    worst = max(worst, np.max(np.minimum(np.abs(found.lambda_n) / force, np.abs(w_n) / length)))
    for i in range(p):
        axes = F[i] > 0
        assert not np.any(found.lambda_t[i][~axes])
        if bound[i] == 0 or not np.any(axes):
            assert not np.any(found.lambda_t[i])
            continue
        f, v = F[i][axes], (F[i] * w_t[i])[axes]
        tau, size = found.lambda_t[i][axes] / f, np.linalg.norm(v)
        worst = max(worst, (np.linalg.norm(tau) - bound[i]) * np.max(f) / force)
        slides = np.max(f * np.abs(tau - bound[i] * v / max(size, 1e-300))) / force
        worst = max(worst, min(size / (length * np.max(f)), slides))
    return worst


def hard(rng, coefficients):
    """A problem with S of condition up to 1e9, coefficients of several sizes, and bounds from 0 to 1e12 loads."""
    p = int(rng.choice([1, 2, 3, 5, 8, 15]))
    Q, _ = np.linalg.qr(rng.standard_normal((3 * p, 3 * p)))
    spread = 10.0 ** rng.choice([0, 3, 6, 9])
    values = np.geomspace(1, spread, 3 * p) if rng.random() < 0.5 else np.where(rng.random(3 * p) < 0.5, 1, spread)
    A = (Q * values) @ Q.T
    A = 0.5 * (A + A.T)
    rows, f = np.eye(3 * p), rng.standard_normal(3 * p)
    grazing = np.linalg.solve(A, f)[:p] * (rng.random(p) < 0.7) * (rng.random() < 0.5)
    F = rng.choice(coefficients, size=(p, 2)).astype(float)
    problem = ContactProblem3D(A, rows[:p], rows[p : 2 * p], rows[2 * p :], f, grazing, (F[:, 0], F[:, 1]))
    S, g = problem.condensed.S, problem.condensed.free_displacements(0)
    size = np.sqrt(g @ np.linalg.solve(S, g)) / np.sqrt(np.diagonal(S)[:p])
    return problem, size * rng.choice([0, 1e-300, 1e-12, 1e-3, 1, 1, 1e3, 1e12], size=p), F


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("solver", ["newton", "clarabel"])
def test_hard_problems_are_solved(rng, solver):
    for _ in range(some(50, of=150)):
        problem, bound, F = hard(rng, [0, 1e-3, 0.1, 0.5, 0.5, 1, 3, 30])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = enumsol.solve_tresca(problem, bound, 0, solver=solver)
        S, g = problem.condensed.S, problem.condensed.free_displacements(0)
        assert violation(S, g, bound, F, found) < 1e-3


@pytest.mark.long
def test_extreme_coefficients_are_solved_or_refused(rng):
    unsolved = 0
    for _ in range(60):
        problem, bound, F = hard(rng, [0, 1e-6, 0.5, 1e6])
        try:
            found = enumsol.solve_tresca(problem, bound, 0)
        except enumsol.fixed_points.TrescaNotSolved:
            unsolved += 1
            continue
        S, g = problem.condensed.S, problem.condensed.free_displacements(0)
        assert violation(S, g, bound, F, found) < 1e-3
    assert unsolved <= 3


def test_no_load_gives_no_forces_wherever_the_start_is(rng):
    problem, bound, _ = hard(rng, [0.5])
    rows = [problem.Bn, problem.Bt1, problem.Bt2]
    unloaded = ContactProblem3D(problem.A, *rows, np.zeros(problem.n), friction=0.5)
    near = enumsol.solve_tresca(ContactProblem3D(problem.A, *rows, 1e-17 * problem.f, friction=0.5), bound, 0)
    assert np.any(near.forces)
    assert not np.any(enumsol.solve_tresca(unloaded, bound, 0, start=near).forces)
    assert not np.any(enumsol.solve_tresca(unloaded, bound, 0, solver="clarabel").forces)
