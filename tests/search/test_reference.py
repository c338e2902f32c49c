"""Roots of bodies that nothing holds that are alone below an assignment; rationals that try all selections judge."""

import functools
from itertools import product

import numpy as np
import pytest
from complete import proven_roots
from floating_oracle import Oracle, random_body
from proof_tools import kinds_of

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.search.reference_closer import proposed, rows_of
from enumsol.search.solvers import Solvers
from enumsol.trusted.reference import PlaneReference
from enumsol.trusted.status_rows import FORBIDDEN, refines, row_signs
from enumsol.trusted.uniqueness_forms import RootForm

#: Bodies with several solutions, some of which have a definite form, and some with one.
SEVERAL = (69, 635, 832, 897, 1053, 1164, 1321, 1799, 1903, 2550, 2777, 3086)
ONE = (8, 40, 49, 54)


@functools.cache
def of(seed):
    """A body's certificates, and the selections that hold solutions."""
    problem = random_body(seed)
    exclusions = Solvers(problem, 0, "verified", 1e-9).exclusions
    rubs = exclusions.system.F > 0
    return exclusions, {
        tuple(code if code == 0 or some else 4 for code, some in zip(codes, rubs, strict=True))
        for codes, _ in Oracle(problem).parts
    }


def coarser(rng, codes, F):
    """An assignment above a selection."""
    above = {0: (0, 6, 7, 8), 1: (1, 5, 6), 2: (2, 5, 6, 7), 3: (3, 5, 6, 8), 4: (4, 6)}
    share = rng.choice([0.0, 0.3, 0.7])
    found = [int(rng.choice(above[code])) if rng.random() < share else code for code in codes]
    return tuple(6 if code > 4 and F == 0 else code for code, F in zip(found, F, strict=True))


def products_of(rng, reference, codes):
    """Some products of rows that are tight."""
    forward, backward = rows_of([reference], codes)[1:]
    signs, own = (row_signs(np.array(given), reference.system.F) for given in (codes, reference.selection))
    closing = np.flatnonzero((signs[:, 4] > FORBIDDEN) & (own[:, 4] > 1))
    rows = [*forward, *backward, *(4 * len(codes) + closing).tolist()]
    count = int(rng.integers(1, 4)) if rows else 0
    return [(*rng.choice(rows, 2).tolist(), float(np.exp(2 * rng.normal()))) for _ in range(count)]


@pytest.mark.few(3)
@pytest.mark.parametrize("seed", [*SEVERAL, *ONE])
def test_what_leaves_no_other_root_has_none(seed):
    """Whatever the rows and the products are, and wherever: above another root, nothing is accepted."""
    exclusions, held = of(seed)
    rng, F = np.random.default_rng(seed), exclusions.system.F
    accepted = above = 0
    final = list(product(*((0, 1, 2, 3) if friction else (0, 4) for friction in F > 0)))
    references = [found for found in map(exclusions.reference, sorted(held)) if found is not None]
    assert references
    for reference in references:
        others = sorted(held - {reference.selection})
        for k in range(24):
            codes = others[k % len(others)] if others and k % 2 else final[rng.integers(len(final))]
            codes = coarser(rng, codes, F)
            shared = any(all(map(refines, other, codes)) for other in others)
            rows, best = rows_of([reference], codes)[0], proposed([reference], codes)
            tried = [(rows, []), (rows[1:], []), (rows, products_of(rng, reference, codes)), (best.rows, best.products)]
            found = [reference.is_only_root(codes, *given, exclusions.system.reach) for given in tried]
            assert not (shared and any(found))
            accepted, above = accepted + sum(found), above + shared
    assert accepted > 5 or seed in SEVERAL
    assert above > 5 or seed in ONE


@pytest.mark.parametrize("seed", ONE[:2])
def test_rows_that_are_none_of_an_assignment(seed):
    """Where a certificate holds, it does not with equations or tight rows added that are none."""
    exclusions, held = of(seed)
    (reference,) = filter(None, map(exclusions.reference, held))
    p, reach = len(reference.selection), exclusions.system.reach
    assert np.all(exclusions.system.F > 0)
    allowed, refused = np.zeros((2, 2), dtype=int)
    for codes in product((1, 2, 3, 5), (2, 3, 5, 6, 7), *[(6, 8)] * (p - 2)):
        rows, best = rows_of([reference], codes)[0], proposed([reference], codes).products
        if not reference.is_only_root(codes, rows, best, reach):
            continue
        for row in range(-1, 7 * p + 1):
            kind, i = divmod(row, p)
            here, there = (row_signs(np.array(given), exclusions.system.F) for given in (codes, reference.selection))
            moves = kind in (4, 5, 6)
            equation = moves and here[i, kind] == there[i, kind] == 2
            tight = moves and here[i, kind] > 0 and (there[i, kind] == 2 or (kind > 4 and there[i, 11 - kind] == 1))
            given = ([*rows, row], best), (rows, [*best, (row, row, 1e-9)])
            for k, fits in enumerate((equation, tight)):
                allowed[k] += fits
                refused[k] += not fits
                assert fits or not reference.is_only_root(codes, *given[k], reach)
    assert np.all(allowed > 0)
    assert np.all(refused > 10)


@pytest.mark.parametrize("seed", range(6))
def test_the_small_matrix_is_the_minimum(seed):
    """Of the form less the products and m |d|^2, over all d with these changes of the rows."""
    rng = np.random.default_rng(seed)
    m, r = 5, 2
    X, G, C = rng.normal(size=(m, m + 2)), rng.normal(size=(r, m)), rng.normal(size=(r, m))
    S = X @ X.T
    D = np.eye(m) + 0.05 * rng.normal(size=(m, m))
    body = Ball.exact(S), Ball.exact(G)
    form = RootForm.factored(body, Ball.exact(D.T @ S), Ball.exact(C), np.zeros(m), np.zeros(m), 3.0)
    equations, tight = rng.normal(size=(1, m)), rng.normal(size=(2, m))
    M = form.small_matrix(Ball.exact(equations), Ball.exact(tight), [(0, 1, 0.7), (1, 1, 0.2)])
    least = 2 * form.least
    assert 0 < least < np.linalg.eigvalsh((D.T @ S + S @ D) / 2 + 3.0 * G.T @ G)[0]
    P = (D.T @ S + S @ D) / 2 + 3.0 * G.T @ G - least * np.eye(m)
    rows = np.vstack([equations, tight])
    for _ in range(5):
        e, s = rng.normal(size=r), rng.normal(size=2)
        # rows (G'e - S d) = (0, s)
        fixed = rows @ G.T @ e - np.concatenate([[0.0], s])
        system = np.block([[2 * P, (rows @ S).T], [rows @ S, np.zeros((3, 3))]])
        d = np.linalg.solve(system, np.concatenate([-C.T @ e, fixed]))[:m]
        value = d @ P @ d + e @ C @ d - 0.7 * s[0] * s[1] - 0.2 * s[1] ** 2
        y = np.concatenate([e, s])
        assert np.isclose(y @ M.mid @ y, value, rtol=1e-7, atol=1e-7)
        assert np.max(M.rad) < 1e-6


# -- in closed form ----------------------------------------------------------------------------------------------------


def bar_on_floor(pushes, press=1.0, friction=0.5, stiffness=4.0):
    """Points on a floor in a row, joined by bars along it: each has its own load, and what it presses with."""
    p = len(pushes)
    A, N, Bn, Bt = np.zeros((2 * p,) * 2), np.zeros((2 * p, p + 1)), np.zeros((p, 2 * p)), np.zeros((p, 2 * p))
    for i in range(p - 1):
        A[2 * i : 2 * i + 3 : 2, 2 * i : 2 * i + 3 : 2] += stiffness * np.array([[1, -1], [-1, 1]])
    N[::2, 0] = 1
    for i in range(p):
        N[2 * i + 1, 1 + i], Bn[i, 2 * i + 1], Bt[i, 2 * i] = 1, -1, 1
    f = np.ravel([(push, -press) for push in pushes])
    return enumsol.ContactProblem(A, Bn, Bt, f, friction=friction, rigid_modes=N, max_rigid_displacement=64.0)


@pytest.mark.parametrize(
    ("pushes", "held"),
    [
        ((0.25, 0.125), (0.25, 0.125)),
        ((0.75, 0.0), (0.5, 0.25)),
        ((0.75, 0.125, 0.0), (0.5, 0.375, 0.0)),
        ((-0.125, 0.0, 0.875), (-0.125, 0.375, 0.5)),
    ],
)
def test_points_on_a_floor_have_one_root(pushes, held):
    """Where a point is pushed by more than friction holds, its neighbour holds the rest; what presses is known."""
    problem = bar_on_floor(pushes)
    found = proven_roots(problem, 0)
    (root,) = found
    assert np.allclose(root.lambda_n, 1.0, rtol=1e-12)
    assert np.allclose(root.lambda_t, held, atol=1e-12)
    spare = [0.5 - force for force in np.abs(root.lambda_t)]
    assert [abs(slip) > 1e-12 for slip in root.u_t] == [room < 1e-12 for room in spare]
    kinds = kinds_of(found.proof)
    assert "o" in kinds
    assert len(Oracle(problem).points) == 1


def test_a_mode_that_nothing_holds_is_not_forgotten():
    """Of points that only press, the form has no mode, nor do gaps cost where they slide: one of them has to stick."""
    system = Solvers(bar_on_floor((0.0, 0.0)), 0, "verified", 1e-9).exclusions.system
    reference = PlaneReference.of(system, (1, 1), np.array([1.0] * 4 + [0.0] * 4), 16.0, 1.0)
    assert np.all(reference.form.idle)
    for codes, rows in (((6, 6), []), ((5, 5), [8, 9]), ((6, 5), [9]), ((6, 1), [9])):
        assert not reference.is_only_root(codes, rows, [], system.reach)
    for codes, rows in (((6, 1), [9, 11]), ((6, 1), [11]), ((1, 1), [8, 9, 10])):
        assert reference.is_only_root(codes, rows, [], system.reach)


# -- at the edge of float64 --------------------------------------------------------------------------------------------


def tiny_form(lost, mode=1.0):
    """A form in one component of lambda and one mode, with what theta may be off."""
    one, none = Ball.exact(np.eye(1)), Ball.exact(np.zeros((1, 1)))
    return RootForm.factored((one, Ball.exact(np.full((1, 1), mode))), one, none, np.array([lost]), np.zeros(1), 1.0)


def test_what_theta_may_be_off_is_not_lost_where_it_is_tiny():
    assert tiny_form(0.0).tilt == 0
    for lost in (1e-3, 1e-100, 1e-200, 5e-324):
        assert tiny_form(lost).tilt > 0
    assert tiny_form(1e-200, 1e-150).tilt > 0


def test_rows_that_overflow_prove_nothing():
    form = tiny_form(0.0)
    form.table.mid[:] = 1e308
    rows = Ball.exact(np.full((3, 1), 4.0))
    none = Ball.exact(np.zeros((0, 1)))
    assert not form.is_only_root(rows, none, [], np.ones(1))
    assert not form.is_only_root(none, rows, [(0, 1, 1.0)], np.ones(1))
