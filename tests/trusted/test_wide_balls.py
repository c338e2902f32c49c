"""Bounds hold for all data in wide balls, and for any approximate solution of the body: nothing rests on tiny radii."""

from dataclasses import replace
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from exact_balls import agrees_with_exact, exact_bound, holds
from generators import dense_compliance
from oracles import exact_condense
from proof_tools import Judge

from enumsol import ContactProblem, gallery
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem
from enumsol.condensation.factorization import Factorization
from enumsol.search.certifiers._margin import Margins
from enumsol.trusted.at_alpha import solve_selection
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.status_rows import row_signs


def moved(mid, rad, sign):
    """Ends of balls."""
    ends = zip(mid.tolist(), rad.tolist(), sign.tolist(), strict=True)
    return [Fraction(x) + side * Fraction(r) for x, r, side in ends]


def wide_system(rng, p, width):
    """A random system with radii of about the given size."""
    S = dense_compliance(rng, p)
    g, F = rng.normal(size=2 * p), rng.uniform(0.3, 2.0, size=p)
    S_rad = width * rng.uniform(size=S.shape) * np.sqrt(np.outer(np.diagonal(S), np.diagonal(S)))
    g_rad, F_rad = width * rng.uniform(size=2 * p), width * rng.uniform(size=p)
    return EnclosedSystem(S, np.maximum(S_rad, S_rad.T), g, g_rad, F, F_rad)


def corner(rng, system):
    """Exact data in a corner of the balls."""
    sign = np.triu(rng.choice([-1, 1], size=system.S.shape))
    sign, m = sign + np.triu(sign, 1).T, 2 * system.p
    g_sign, F_sign = rng.choice([-1, 1], size=m), rng.choice([-1, 1], size=system.p)
    S = [moved(*row) for row in zip(system.S, system.S_rad, sign, strict=True)]
    return S, moved(system.g, system.g_rad, g_sign), moved(system.F, system.F_rad, F_sign)


@pytest.mark.few(2)
@pytest.mark.parametrize("width", [1e-10, 1e-6, 1e-3])
def test_margins_hold_for_every_corner(width):
    rng = np.random.default_rng(1)
    tight = []
    for _ in range(25):
        p = int(rng.integers(1, 3))
        system = wide_system(rng, p, width)
        if np.linalg.eigvalsh(system.S)[0] < 10 * np.linalg.norm(system.S_rad):
            continue
        compiled = Margins((system,), system.F, system.F)
        for _ in range(4):
            codes = tuple(int(c) for c in rng.choice((0, 1, 2, 3, 5, 6), size=p))
            signs = row_signs(np.array(codes), system.F)
            rows = [r for r in range(7 * p) if signs[r % p, r // p] and rng.random() < 0.7]
            values = [rng.normal() if signs[r % p, r // p] == 2 else rng.exponential() for r in rows]
            arrays = np.array(rows, dtype=np.intp), np.array(values)
            margins = [exclusion_margin(system, codes, *arrays), compiled.margin(codes, *arrays)]
            judge = Judge(None)
            judge.force = judge.length = [1] * p
            for _ in range(3):
                judge.S, judge.g, judge.F = corner(rng, system)
                bound = exact_bound(judge, rows, values)
                assert max(margins) <= bound
                tight.append((float(bound) - margins[0]) / (width * (1 + sum(v * v for v in values))))
    # the radii cost what they must, and no more than a moderate multiple of it
    assert len(tight) >= 60
    assert np.median(tight) < 100


@pytest.mark.parametrize("width", [1e-10, 1e-6, 1e-3])
def test_selections_hold_for_every_corner(width):
    rng = np.random.default_rng(2)
    regular = 0
    for _ in range(12):
        p = int(rng.integers(1, 3))
        system = wide_system(rng, p, width)
        for codes in product(range(4), repeat=p):
            ball = solve_selection(system, codes)
            if ball is not None:
                regular += 1
                agrees_with_exact(ball, *corner(rng, system), codes)
    assert regular >= 60


@pytest.mark.parametrize("error", [1e-12, 1e-8, 1e-4])
def test_any_approximate_solution_of_the_body_will_do(error, monkeypatch):
    # the enclosure corrects a wrong X by its residual, and what is left by the eigenvalue bound
    rng = np.random.default_rng(3)
    solve = Factorization.solve

    def wrong(self, rhs, **options):
        x = solve(self, rhs, **options)
        return x + error * np.max(np.abs(x)) * rng.normal(size=x.shape)

    X = rng.normal(size=(6, 9))
    rows = rng.normal(size=(4, 6))
    for problem in (
        gallery.clamped_block(2, 2, gap=1e-3),
        ContactProblem(X @ X.T, rows[:2], rows[2:], rng.normal(size=6), load_slope=rng.normal(size=6)),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(Factorization, "solve", wrong)
            bad = CondensedEnclosure.from_problem(problem)
        S, g, _ = exact_condense(problem, 0)
        assert holds(bad.g0, bad.g0_rad, g)
        assert holds(bad.S, bad.S_rad, S)
        # quadratic in the error
        assert np.max(bad.S_rad) <= 1e3 * (error**2 + 1e-16) / bad.stiffness_bound * np.max(np.abs(bad.S)) ** 2 + 1e-13


def test_friction_balls_count_for_cones():
    # the bound of a cone row rests on F: with an unknown F it must allow for the least one
    system = wide_system(np.random.default_rng(4), 1, 0.0)
    wide = replace(system, F_rad=np.array([0.25]))
    rows, values = np.array([2, 4], dtype=np.intp), np.array([1.0, 0.5])
    assert exclusion_margin(wide, (2,), rows, values) < exclusion_margin(system, (2,), rows, values) - 1e-3
    less, more = (Margins((one,), one.F, one.F).margin((2,), rows, values) for one in (wide, system))
    assert less < more - 1e-3
