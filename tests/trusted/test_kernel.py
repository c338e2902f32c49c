"""Exclusion margins are lower bounds, and selections are solved with balls that hold the exact solution."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from effort import some
from exact_balls import agrees_with_exact, exact_bound
from generators import dense_compliance, fe_compliance, from_condensed, integer_problem, named
from oracles import _affine, _conditions, exact_condense
from proof_tools import Judge, det_sign, leaves_of, multipliers, records_of

from enumsol import enumerate_roots, gallery
from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.search.certifiers._margin import Margins
from enumsol.search.solvers import Solvers
from enumsol.trusted import at_alpha as point
from enumsol.trusted.at_alpha import solve_selection
from enumsol.trusted.exclusion import Leaves, exclusion_margin, exclusion_margins
from enumsol.trusted.quadratic_forms import energy_bounds
from enumsol.trusted.status_rows import row_signs

CODES = (0, 1, 2, 3, 5, 6)


def system_of(problem, alpha=0.0):
    one = np.ones(2 * problem.p)
    return problem.enclosure.at(alpha, one, one)


def judge_of(problem, alpha=0.0):
    judge = Judge(problem)
    judge.S, judge.g, judge.F = exact_condense(problem, alpha)
    judge.force = judge.length = [Fraction(1)] * (2 * problem.p)
    return judge


def random_problem(rng, p):
    S = (dense_compliance if rng.random() < 0.5 else fe_compliance)(rng, p)
    return from_condensed(S, rng.normal(size=2 * p), rng.uniform(0.05, 3.0, size=p))


def random_multipliers(rng, codes, F, *, bad):
    """Allowed multipliers of an assignment; with ``bad`` now and then a wrong sign or a row it does not impose."""
    signs, p, rows, values = row_signs(np.array(codes), F), len(codes), [], []
    for kind, i in product(range(7), range(p)):
        if rng.random() < 0.5 and (signs[i, kind] or (bad and rng.random() < 0.2)):
            value = rng.normal() * 10 ** rng.uniform(-2, 1)
            rows.append(kind * p + i)
            values.append(value if signs[i, kind] == 2 or (bad and rng.random() < 0.1) else abs(value))
    return np.array(rows, dtype=np.intp), np.array(values)


def ray(problem, rows, values):
    """The multipliers stretched to where their bound is largest, in floats."""
    system = system_of(problem)
    S, g, p = system.S, system.g, system.p
    d, b = np.zeros(2 * p), 0.0
    for row, value in zip(rows, values, strict=True):
        kind, i = divmod(int(row), p)
        if kind < 4:
            d[i] += value * (kind != 1) * (1.0 if kind == 0 else system.F[i])
            d[p + i] += value * {0: 0.0, 1: 1.0, 2: -1.0, 3: 1.0}[kind]
        else:
            k, sign = (i, 1.0) if kind == 4 else (p + i, -1.0 if kind == 5 else 1.0)
            d += sign * value * S[k]
            b += sign * value * g[k]
    inverse = np.linalg.inv(S)
    slope, curvature = b - 0.5 * d @ inverse @ g, 0.25 * d @ inverse @ d
    return values * (0.5 * slope / curvature) if slope > 0 and curvature > 0 else values


@pytest.mark.slow
def test_margins_agree_with_rationals():
    rng = np.random.default_rng(1)
    positive = refused = 0
    for _ in range(some(6, of=16)):
        p = int(rng.integers(1, 4))
        problem = random_problem(rng, p)
        system, judge = system_of(problem), judge_of(problem)
        compiled = Margins((system,), system.F, system.F)
        for _ in range(30):
            codes = tuple(int(c) for c in rng.choice(CODES, size=p))
            rows, values = random_multipliers(rng, codes, system.F, bad=rng.random() < 0.3)
            if not len(rows):
                continue
            values = ray(problem, rows, values)
            margin = exclusion_margin(system, codes, rows, values)
            signs = [judge._allowed(codes[r % p], r // p, r % p) for r in rows.tolist()]
            allowed = all(s is not None and (s == 0 or v >= 0) for s, v in zip(signs, values.tolist(), strict=True))
            refused += not allowed
            assert (margin == -np.inf) == (not allowed)
            if allowed:
                bound = exact_bound(judge, rows, values)
                assert Fraction(float(margin)) <= bound
                # no more is lost than rounding
                assert float(bound) - margin <= 1e-9 * (1 + abs(float(bound)) + float(np.sum(values**2)))
                positive += margin > 0
                assert judge._excluded(codes, rows.tolist(), values.tolist()) == (bound > 0)
            fast = compiled.margin(codes, rows, values)
            assert fast == margin or abs(fast - margin) <= 1e-11 * (1 + abs(margin) + float(np.sum(values**2)))
    assert positive >= some(1, of=2)
    assert refused >= some(10, of=30)


def test_large_multipliers_of_an_infeasible_assignment():
    # two nodes that hardly move against each other: the first cannot be open while the second is in contact. Along the
    # multipliers that say so the bound grows in proportion, the forms of (6.2) with the square
    little = 2.0**-30
    n = np.array([[1.0, 1.0 - little], [1.0 - little, 1.0]])
    S = np.block([[n, np.zeros((2, 2))], [np.zeros((2, 2)), np.eye(2)]])
    problem = from_condensed(S, np.array([1.0 + 1e-8, 1.0, 0.0, 0.0]), np.zeros(2))
    system, judge = system_of(problem), judge_of(problem)
    compiled = Margins((system,), system.F, system.F)
    codes, rows = (0, 4), np.array([0, 1, 8, 9], dtype=np.intp)
    positive = 0
    for length in 2.0 ** np.arange(10, 34):
        values = length * np.array([-little, little, 1.0, -1.0])
        bound = exact_bound(judge, rows, values)
        for margin in exclusion_margin(system, codes, rows, values), compiled.margin(codes, rows, values):
            assert Fraction(margin) <= bound
            assert margin > 0 or bound < 1e-3
            positive += margin > 0
    assert positive == 18


def test_sign_of_the_margin_where_the_bound_is_next_to_zero():
    # along the ray of a pruned leaf's multipliers the bound is a parabola: look on both sides of its zero
    signs = []
    for name in ("two-node-5", "chain-2", "two-node-6.4"):
        problem, alpha = named(name)
        bench = Solvers(problem, alpha, "verified", 1e-9)
        system, judge = bench.enclosed, judge_of(problem, alpha)
        records = records_of(enumerate_roots(problem, alpha).proof)
        judge.force, judge.length = ([Fraction(float(x)) for x in v] for v in (bench.scaled.force, bench.scaled.length))
        size = judge.force[0] * judge.length[0]
        for k, codes in leaves_of(records):
            if records[k][0] != "x":
                continue
            rows, values = (np.array(part) for part in multipliers(records[k]))
            zero, one, two = (float(exact_bound(judge, rows, t * values) / size) for t in (0.0, 1.0, 2.0))
            bend = 0.5 * (two - 2 * one + zero)
            slope = one - zero - bend
            start = -2 * zero / (slope + np.sqrt(max(slope**2 - 4 * bend * zero, 0.0)))
            for step in (0.0, *(s * 10.0**-d for d in range(2, 17) for s in (1, -1))):
                stretched = start * (1 + step) * values
                bound = exact_bound(judge, rows, stretched)
                fast = Margins((system,), system.F, system.F).margin(codes, rows.astype(np.intp), stretched)
                for margin in (exclusion_margin(system, codes, rows, stretched), fast):
                    assert Fraction(float(margin)) <= bound / size
                    assert margin > 0 or bound / size < 1e-9
                signs.append(np.sign(float(bound)))
    assert min(signs.count(1), signs.count(-1)) >= 100


@pytest.mark.slow
def test_bounds_never_exceed_the_energy_of_a_solution():
    # the sharpest test there is: a leaf that holds a root can have no positive bound, whatever the multipliers
    rng = np.random.default_rng(2)
    for name in ("one-node-6.1", "two-node-5", "two-node-6.4"):
        problem, alpha = named(name)
        system = system_of(problem, alpha)
        for root in enumerate_roots(problem, alpha, "exact"):
            codes = tuple({"open": 0, "stick": 1, "slip+": 2, "slip-": 3}[s.value] for s in root.statuses)
            for _ in range(some(40, of=120)):
                rows, values = random_multipliers(rng, codes, system.F, bad=False)
                assert exclusion_margin(system, codes, rows, values * 10 ** rng.uniform(-3, 6)) <= 0


def both_margins(codes, rows, values):
    """Those of the kernel and of the compiled copy, of a square."""
    system = system_of(gallery.two_node_square(), 2.0)
    given = codes, np.array(rows, dtype=np.intp), np.array(values)
    return exclusion_margin(system, *given), Margins((system,), system.F, system.F).margin(*given)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e200])
def test_absurd_multipliers_prove_nothing(value):
    assert not any(margin > 0 for margin in both_margins((1, 1), [0, 8, 9], [1.0, value, value]))


@pytest.mark.parametrize("row", [-1, 14, 10**9])
def test_rows_that_do_not_exist(row):
    assert both_margins((6, 6), [row], [1.0]) == (-np.inf, -np.inf)


def test_batches_equal_single_leaves():
    rng = np.random.default_rng(7)
    system = system_of(random_problem(rng, 3))
    codes = rng.choice(CODES, size=(20, 3))
    parts = [random_multipliers(rng, c, system.F, bad=False) for c in codes]
    parts[4] = (np.zeros(0, dtype=np.intp), np.zeros(0))
    batch = exclusion_margins(system, Leaves.of(codes, parts))
    for k, (r, v) in enumerate(parts):
        assert exclusion_margin(system, tuple(codes[k]), r, v) == pytest.approx(batch[k], rel=1e-12, abs=1e-12)


def _check_selection(system, S, g, F, codes):
    """Compare one verified selection with the exact solution; its verdict, None for not regular."""
    ball = solve_selection(system, codes)
    return None if ball is None else agrees_with_exact(ball, S, g, F, codes)


@pytest.mark.slow
def test_selections_hold_the_exact_solution():
    rng = np.random.default_rng(8)
    for p, count in ((1, 20), (2, some(5, of=15)), (3, some(1, of=3))):
        for _ in range(count):
            problem = random_problem(rng, p)
            system, exact = system_of(problem), exact_condense(problem, 0.0)
            verdicts = [_check_selection(system, *exact, codes) for codes in product(range(4), repeat=p)]
            assert np.mean([bool(v) for v in verdicts]) > 0.95


def test_nearly_singular_selections():
    rng = np.random.default_rng(9)
    unproven = 0
    for exponent in (4, 8, 12, 13, 14, 15, 16, 17):
        for _ in range(6):
            # one node: the determinant of slip- is S_nn - F S_nt, zero for F = S_nn / S_nt
            S = np.array([[2.0, 1.0], [1.0, 1.5]]) * 2.0 ** rng.integers(-3, 4)
            F = 2.0 * (1 + rng.choice([-1, 1]) * 10.0**-exponent)
            problem = from_condensed(S, rng.normal(size=2), np.array([F]))
            unproven += solve_selection(system_of(problem), (3,)) is None
            _check_selection(system_of(problem), *exact_condense(problem, 0.0), (3,))
    assert 6 <= unproven <= 48 - 20


@pytest.mark.slow
def test_singular_integer_selections_are_never_called_regular():
    rng = np.random.default_rng(10)
    singular = 0
    for _ in range(some(50, of=150)):
        problem = integer_problem(rng, int(rng.integers(1, 4)))
        S, _, F = exact_condense(problem, 0.0)
        system = system_of(problem)
        for codes in product(*(range(4) if f > 0 else (0, 4) for f in F)):
            if rng.random() < 0.3 and det_sign(S, F, codes) == 0:
                singular += 1
                assert solve_selection(system, codes) is None
    assert singular >= some(3, of=10)


@pytest.mark.parametrize("powers", [(0, 0), (500, 0), (500, -60)])
def test_an_uncertain_matrix_counts_where_the_squares_of_multipliers_underflow(powers):
    """At 1.2 S the minimum is negative, in whatever units; that of S is not."""
    (stiff, force), S = powers, np.array([[2.0, 1.0], [1.0, 2.0]])
    y, c, g = np.array([-4.5, -6.75]), np.array([6.5, 3.5]), np.array([-5.0, -5.5])
    least = [y @ g - v @ np.linalg.solve(t * S, v) / 4 for t in (1.0, 1.2) for v in [g + c + t * S @ y]]
    assert least[1] < 0 < least[0]
    bounds = []
    for unsure in (0.0, 0.2):
        S_rad, none = unsure * np.ldexp(S, stiff), np.zeros(2)
        system = EnclosedSystem(np.ldexp(S, stiff), S_rad, np.ldexp(g, force), none, np.zeros(1), np.zeros(1))
        scaled = np.ldexp(y, force - stiff)[None], np.ldexp(c, force)[None], none[None]
        bounds.append(float(np.ldexp(energy_bounds(system, *scaled)[0], stiff - 2 * force)))
    assert np.isclose(bounds[0], least[0])
    assert bounds[1] <= least[1]


def test_scaled_units_change_nothing():
    bench = Solvers(*named("wedge-8-3"), "verified", 1e-9)
    assert bench.data == "problem"
    assert bench.enclosed.smallest_eigenvalue <= np.linalg.eigvalsh(bench.scaled.S)[0]


@pytest.mark.slow
def test_displacements_of_ill_conditioned_selections(monkeypatch):
    """On weak springs forces are known far worse than displacements; radii in which that cancels are true, too."""
    radii = []

    def recorded(*args, closer=point._closer):
        found = closer(*args)
        radii.append(found.rad)
        return found

    monkeypatch.setattr(point, "_closer", recorded)
    for name in ("is_root", "is_excluded"):
        monkeypatch.setattr(point.VerifiedSelection, name, property(lambda _: False))
    rng, times = np.random.default_rng(5), []
    for _ in range(some(12, of=40)):
        S, v = fe_compliance(rng, 2), rng.normal(size=4)
        S = S + 10.0 ** rng.uniform(0, 9) * np.outer(v, v)
        problem = from_condensed(0.5 * (S + S.T), rng.normal(size=4), rng.choice([0.1, 1.0, 30.0], size=2))
        system, exact = system_of(problem), exact_condense(problem, 0.0)
        for codes in product(range(4), repeat=2):
            radii.clear()
            _check_selection(system, *exact, codes)
            if not radii:
                continue
            ball = solve_selection(system, codes)
            point_of, _ = _affine(_conditions(*exact, codes)[0])
            for r in np.flatnonzero(ball.w.rad > 0):
                w = exact[1][r] - sum(exact[0][r][k] * point_of[k] for k in range(4))
                assert abs(w - Fraction(float(ball.w.mid[r]))) <= Fraction(float(radii[0][r]))
                times.append(radii[0][r] / (np.abs(system.S) @ ball.force.rad + system.g_rad)[r])
    assert len(times) > some(80, of=300)
    assert np.quantile(times, 0.2) < 0.2
