"""Curves over a piece of alpha, and forms by which they have all its solutions, against those at sampled alphas."""

import functools
from fractions import Fraction
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from problems3d import random_over_alpha
from scipy.optimize import linprog

from enumsol import enumerate_roots
from enumsol.arithmetic.balls import Ball
from enumsol.branches.space.space_graph import ByCurves
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.search.space.piece_proposals import ExaminedPiece, runs_over
from enumsol.support.deadlines import Deadline
from enumsol.trusted.space import curve_runs
from enumsol.trusted.space.curve_runs import CurveParts, LinkRange
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.sector_rows import CONTACT, OPEN, STICK, UNDECIDED
from enumsol.trusted.space.solution_curve import CurveBox, SolutionCurve
from enumsol.trusted.space.space_uniqueness import PieceWeights, how_far_off

INTERVAL = Fraction(0), Fraction(1)
#: Nodes and seeds: at some of the many a fold, two curves, or changes of status.
PROBLEMS = [(1, 1), pytest.param(2, 10, marks=pytest.mark.slow)]
PROBLEMS += [pytest.param(p, seed, marks=pytest.mark.long) for p, seed in product((1, 2), range(11, 40))]
#: Parts of the interval.
PIECES = [INTERVAL, (Fraction(1, 3), Fraction(2, 5)), (Fraction(5, 8), Fraction(41, 64))]


@functools.cache
def known_curves(p, seed):
    cover = ByCurves(random_over_alpha(p, seed), INTERVAL)
    cover.run(60, Deadline(), None, None)
    return cover, cover.chains


def piece_over(cover, low, high):
    return AlphaPiece(AlphaSpace(cover.problem.enclosure, (low + high) / 2, cover._units()), low, high)


#: Which of their names a node may have by its code.
NAMES = {UNDECIDED: {"open", "stick", "slip"}, OPEN: {"open"}, STICK: {"stick"}, CONTACT: {"stick", "slip"}}


def theta_of(problem, root, alpha):
    """Friction over its bound of loaded nodes, else the direction of slip, (p, 2), nan where a node rests unloaded."""
    F = problem.friction_at(alpha)
    found = np.full((problem.p, 2), np.nan)
    y = np.concatenate([root.lambda_n, *root.lambda_t.T])
    w = problem.condensed.free_displacements(float(alpha)) - problem.condensed.S @ y
    slip = F * w[problem.p :].reshape(2, -1).T
    for i in range(problem.p):
        if root.statuses[i].value != "open" and np.all(F[i] > 0):
            found[i] = root.lambda_t[i] / F[i] / root.lambda_n[i]
        elif np.linalg.norm(slip[i]) > 0:
            found[i] = slip[i] / np.linalg.norm(slip[i])
    return found


@pytest.mark.parametrize(("p", "seed"), PROBLEMS)
def test_parts_of_a_run_hold_a_solution_at_every_alpha(p, seed):
    """At sampled alphas a root lies in a part that has this alpha, with its statuses and its theta."""
    cover, curves = known_curves(p, seed)
    rng, tested = np.random.default_rng(seed), 0
    for known in curves:
        for low, high in PIECES:
            for run in runs_over(known, low, high):
                assert known.passes(run, low, high)
                parts = known.over(run, low, high)
                theta, far = parts.thetas
                for alpha in (low, low + (high - low) * Fraction(int(rng.integers(1, 100)), 100), high):
                    near = np.abs(parts.alpha.mid - float(alpha)) <= parts.alpha.rad * (1 + 1e-9) + 1e-15
                    assert near.any()
                    roots = enumerate_roots(cover.problem, alpha)
                    held = []
                    for root, k in product(roots, np.flatnonzero(near)):
                        true, units = theta_of(cover.problem, root, alpha), known.problem
                        y = np.concatenate([root.lambda_n, *root.lambda_t.T]) / units.force / units.ratio.mid
                        w = units.g0.mid + float(alpha) * units.g1.mid - units.S.mid @ (y * units.ratio.mid)
                        z = y + parts.rho[k] * w
                        held.append(bool(np.all(np.abs(z - parts.z.mid[k]) <= parts.z.rad[k] * (1 + 1e-6) + 1e-9)))
                        if not held[-1]:
                            continue
                        for i, name in enumerate(status.value for status in root.statuses):
                            assert not (parts.open[k, i] and name != "open")
                            assert not (parts.touching[k, i] and name == "open")
                            assert not (parts.sticking[k, i] and name != "stick")
                            known_theta = np.isfinite(far[k, i]) and not np.isnan(true[i, 0])
                            if known_theta:
                                assert np.linalg.norm(true[i] - theta[k, i]) <= far[k, i] + 1e-7
                            tested += known_theta
                    assert any(held)
    assert tested or (p, seed) != (1, 1)


def test_parts_are_as_many_as_the_links_that_come_to_a_piece_ask_for(monkeypatch):
    monkeypatch.setattr(curve_runs, "_OF_LINK", 64)
    _, (known, *_) = known_curves(1, 1)
    low, high = PIECES[1]
    (run,) = runs_over(known, low, high)
    whole = LinkRange(1, len(known.links) - 1)
    assert run.first == run.last < whole.last
    several, one = known.over(whole, low, high), known.over(run, low, high)
    assert 64 <= len(one.links) < 128
    assert np.array_equal(several.links, one.links)
    assert np.array_equal(several.t.mid, one.t.mid)


@pytest.mark.parametrize(("p", "seed"), PROBLEMS)
def test_a_form_leaves_only_the_solutions_of_its_curve(p, seed):
    """Where a form is accepted there is one root with these statuses, and Q is positive with its theta."""
    cover, curves = known_curves(p, seed)
    rng, accepted, all_runs = np.random.default_rng([p, seed]), 0, 0
    for k in range(6):
        low = Fraction(int(rng.integers(0, 48)), 64)
        high = min(low + Fraction(1, 4 ** (1 + k % 3)), Fraction(1))
        piece = piece_over(cover, low, high)
        at = ExaminedPiece(piece)
        for known in curves:
            for run in runs_over(known, low, high):
                parts = known.over(run, low, high)
                for codes in product((UNDECIDED, OPEN, CONTACT, STICK), repeat=p):
                    all_runs += 1
                    numbers = at.numbers(codes, parts) if parts.allowed(codes) else None
                    if numbers is None or not piece.lies_on(known, run, codes, numbers):
                        continue
                    accepted += 1
                    for alpha in (low, (low + high) / 2, high):
                        held = [
                            all(status.value in NAMES[code] for status, code in zip(root.statuses, codes, strict=True))
                            for root in enumerate_roots(cover.problem, alpha)
                        ]
                        assert sum(held) == 1
    assert accepted or ((p, seed) != (1, 1) and all_runs)


def test_numbers_that_make_no_sense_are_refused():
    cover, (known, *_) = known_curves(1, 1)
    low, high = Fraction(0), Fraction(1, 64)
    piece = piece_over(cover, low, high)
    run = next(run for run in runs_over(known, low, high))
    codes = (UNDECIDED,)
    numbers = ExaminedPiece(piece).numbers(codes, known.over(run, low, high))
    assert piece.lies_on(known, run, codes, numbers)
    for place, value in ((0, -1.0), (1, 0.0), (2, 9.0), (4, np.inf), (5, 40.0)):
        changed = numbers.copy()
        changed[place] = value
        assert not piece.lies_on(known, run, codes, changed)
    assert not piece.lies_on(known, run, codes, numbers[:-1])
    # another piece, no links, links in another order
    assert not piece_over(cover, low, Fraction(3, 2)).lies_on(known, run, codes, numbers)
    count = len(known.links)
    for wrong in (LinkRange(-1, run.last), LinkRange(run.first, count), LinkRange(run.last + 1, run.last)):
        assert not piece.lies_on(known, wrong, codes, numbers)


@pytest.mark.parametrize(("p", "seed"), PROBLEMS)
def test_psi_is_off_by_no_less_than_at_any_sample(p, seed):
    """For random numbers: at a root of the curve some psi that serves is as near as is said, or nearer."""
    cover, curves = known_curves(p, seed)
    rng, tested = np.random.default_rng([seed, 5]), 0
    low, high = Fraction(1, 4), Fraction(1, 2)
    piece = piece_over(cover, low, high)
    for known, run in [(one, run) for one in curves for run in runs_over(one, low, high)]:
        parts, system = known.over(run, low, high), piece.whole
        discs = [end.mid for end in system.end_discs]
        for _ in range(5):
            thetas = rng.uniform(-0.8, 0.8, (2, p, 2))
            weights = PieceWeights(np.ones(p), np.ones(p), np.zeros((p, 2)), tuple(thetas))
            psi = [Ball.exact(theta * disc[:, None]) for theta, disc in zip(thetas, discs, strict=True)]
            off = how_far_off(system, (low, high), weights, psi, parts)
            for share in (Fraction(0), Fraction(3, 7), Fraction(1)):
                alpha = low + share * (high - low)
                r = float(1 - share) * discs[0] + float(share) * discs[1]
                at = float(1 - share) * psi[0].mid + float(share) * psi[1].mid
                roots = list(enumerate_roots(cover.problem, alpha))
                if len(roots) > 1:
                    continue
                true = r[:, None] * theta_of(cover.problem, roots[0], alpha)
                for i in range(p):
                    if roots[0].statuses[i].value != "open" and np.all(np.isfinite(true[i])):
                        assert np.linalg.norm(true[i] - at[i]) <= off[i] + 1e-7
                        tested += 1
    assert tested or (p, seed) != (1, 1)


@pytest.mark.parametrize("rho", [np.inf, 1e300, 1e-300, 0.0])
def test_slips_are_not_known_where_steps_over_or_underflow(rho):
    """Of a node that is open with w = z: no theta serves it by its gap then."""
    none = np.zeros(1)
    alpha, F = Ball.exact(none), Ball.exact(np.ones((1, 1)))
    z, rubs = Ball.exact(np.array([[-1.0, 1.5, 0.0]])), np.ones((1, 2), dtype=bool)

    def slip(steps):
        with np.errstate(all="ignore"):
            parts = CurveParts(alpha, F, z, np.array([steps]), rubs, none.astype(int), Ball.exact(none))
            return parts.slips[1][0, 0]

    assert slip([1.0, 1.0, 1.0])[0].size >= 1.5
    far = slip([1.0, rho, rho])[0]
    assert not np.isfinite(far.rad)


def test_a_curve_holds_a_ball_if_all_its_corners_are_held():
    """A point is held if x - c - t d - G s is within the radius for some s: by linear programming."""
    rng, said = np.random.default_rng(2), {True: 0, False: 0}
    size, count = 4, 2
    for _ in range(150):
        c, d, e = rng.standard_normal((3, size))
        d, G = d / (e @ d), rng.standard_normal((size, count))
        radius, shares = 0.2 + rng.exponential(size=size), 2 * rng.exponential(size=count)
        half = 2 * float(rng.exponential())
        near = SimpleNamespace(d=d, border=e[None])
        step = SimpleNamespace(G=Ball.exact(G))
        found = SimpleNamespace(near=near, step=step, radius=radius, shares=shares)
        box, problem = CurveBox(c, d, e, half, radius, np.ones(size - 1)), SimpleNamespace(unit=np.ones(size))
        curve = SolutionCurve(box, 1, problem, found)
        middle = c + rng.uniform(-half, half) * d + G @ (rng.uniform(-0.9, 0.9, count) * shares)
        x = Ball(middle, 0.05 * rng.exponential(size=size))
        held = curve.holds(x)
        said[held] += 1
        if not held:
            continue
        for signs in product((-1, 1), repeat=size):
            off = x.mid + np.array(signs) * x.rad - c
            t = float(e @ off)
            assert abs(t) <= half * (1 + 1e-12)
            rows, most = np.vstack([G, -G]), np.concatenate([off - t * d + radius, t * d - off + radius])
            least = linprog(np.zeros(count), A_ub=rows, b_ub=most + 1e-9, bounds=[(-s, s) for s in shares])
            assert least.status == 0
    assert min(said.values()) > 20
