"""Arcs that hold all solutions (theory, section 7.15): what the kernel says in floats against rationals.

Also where it barely says so: numbers are moved from those that serve to others by bisection.
"""

from fractions import Fraction
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from branches.test_lower_bounds import KINDS
from effort import some
from flint import fmpq
from path_problems import generic_problem, integer_problem, without_friction_somewhere
from rational_arcs import Selection
from rational_forms import Data, Forms, exact
from rational_pieces import _Along

from enumsol import ContactProblem
from enumsol.branches.enclosed.following import TracedProblem
from enumsol.condensation.unloaded import vanishing_alpha
from enumsol.trusted.arcs.only_branch import only_roots
from enumsol.trusted.over_interval import PieceNumbers

FAMILIES = (generic_problem, integer_problem, generic_problem, without_friction_somewhere)


class Body:
    """A random problem over an interval; g vanishes inside for some seeds."""

    @classmethod
    def random(cls, rng, seed, most):
        make = FAMILIES[seed % len(FAMILIES)]
        p = int(rng.integers(1, (min(most, 2) if make is integer_problem else most) + 1))
        problem = make(rng, p, KINDS[int(rng.integers(3))])
        if seed % 7 == 3:
            data = {"load_slope": problem.f, "friction": problem.friction, "friction_slope": problem.friction_slope}
            problem = ContactProblem(problem.A, problem.Bn, problem.Bt, -0.5 * problem.f, **data)
        return cls(problem, float(rng.integers(2, 9)))

    def __init__(self, problem, end):
        self.problem, self.end = problem, end
        origin = vanishing_alpha(problem, "problem")
        self.origin = origin if origin is not None and 0 <= origin <= end else None
        self.traced = TracedProblem(problem, (Fraction(0), Fraction(end)), self.origin)
        self.data = Data(problem)

    def side(self, alpha):
        return 0 if self.origin is None else 1 if alpha > self.origin else -1

    def forms(self, alpha, side):
        g = [side * value for value in self.data.g1] if side else self.data.load(alpha)
        return Forms(self.data.S, g, self.data.friction(alpha))

    def solved(self, alpha, side):
        """Solutions at an alpha by selection; the codes are those of nodes with friction also where F = 0."""
        forms = self.forms(alpha, side)
        ever = [a != 0 or b != 0 for a, b in zip(self.data.F0, self.data.F1, strict=True)]
        selections = product(*((0, 1, 2, 3) if rubs else (0, 4) for rubs in ever))
        return {codes: points for codes in selections if (points := forms.hull(codes))}

    def form_is_definite(self, codes, side, numbers, alpha):
        """Q at one alpha, with any theta that serves."""
        parts = ([exact(float(value)) for value in part] for part in (numbers.mu, numbers.kappa, numbers.nu))
        piece = SimpleNamespace(data=self.data, p=self.data.p, **dict(zip(("mu", "kappa", "nu"), parts, strict=True)))
        piece.rubbing = [i for i in range(piece.p) if self.data.F0[i] != 0 or self.data.F1[i] != 0]
        F = self.data.friction(alpha)
        if any(abs(n) * f > m for n, f, m in zip(piece.nu, F, piece.mu, strict=True)):
            return False
        along = _Along(piece, Selection(self.data, codes, side))
        choices = product(*(along.chosen(i, alpha, alpha) for i in along.opened))
        return any(along.definite(chosen, alpha, alpha) for chosen in choices)

    def judge(self, codes, side, numbers, alphas):
        """Whether the selection's solution is the only one where it has one; at how many alphas it has."""
        count = 0
        for alpha in alphas:
            found = self.solved(alpha, side)
            if codes in found:
                assert len({point for points in found.values() for point in points}) == 1
                assert self.form_is_definite(codes, side, numbers, alpha)
                count += 1
        return count


def compared(seeds, *, most, bisections):
    """How often the kernel said yes; how often numbers were moved to the border; alphas judged, and with several."""
    counts = np.zeros(4, dtype=int)
    for seed in seeds:
        rng = np.random.default_rng([41, seed])
        body = Body.random(rng, seed, most)
        for k in rng.integers(0, 65, size=4).tolist():
            alpha = Fraction(body.end) * Fraction(k, 64)
            if alpha != body.origin:
                at = fmpq(alpha.numerator, alpha.denominator)
                found = body.solved(at, body.side(alpha))
                counts[3] += len({point for points in found.values() for point in points}) > 1
                for codes in found:
                    counts[:3] += _compared(rng, body, alpha, codes, bisections)
    return counts


def _compared(rng, body, alpha, codes, bisections):
    side = body.side(alpha)
    reach = body.end * 10.0 ** -rng.uniform(0, 6) * rng.integers(0, 2, size=2)
    low, high = max(float(alpha) - reach[0], 0.0), min(float(alpha) + reach[1], body.end)
    if side:
        low, high = (max(low, float(body.origin)), high) if side > 0 else (low, min(high, float(body.origin)))
    if not low < high:
        return 0, 0, 0
    alphas = [fmpq(alpha.numerator, alpha.denominator), *spread(low, high, 8)]
    return at_the_border(rng, body, (codes, side, low, high), alphas, bisections)


def spread(low, high, count):
    low, high = (fmpq(*value.as_integer_ratio()) for value in (low, high))
    return [low + (high - low) * fmpq(k, count) for k in range(count + 1)]


def at_the_border(rng, body, asked, alphas, bisections):
    """Numbers that serve, then others as near as can be to some that do not."""
    codes, side, low, high = asked
    selection, p = body.traced.selection(codes, float(side)), body.problem.p
    F = np.maximum(body.problem.friction_at(low), body.problem.friction_at(high))

    def numbers(mu, kappa, share):
        return PieceNumbers(mu, kappa, share * mu / np.where(F > 0, F, 1.0))

    def alone(made):
        return only_roots([(selection, low, high)], numbers(*made))[0]

    ones = np.ones(p)
    good = (ones, ones, 0.0 * ones)
    if not alone(good):
        good = (*np.exp(rng.normal(size=(2, p))), rng.uniform(-1, 1, size=p))
        if not alone(good):
            return 0, 0, 0
    judged = body.judge(codes, side, numbers(*good), alphas)
    bad = (*np.exp(2.0 * rng.normal(size=(2, p))), rng.uniform(-1, 1, size=p))

    def between(share):
        mu, kappa = (x ** (1.0 - share) * y**share for x, y in zip(good[:2], bad[:2], strict=True))
        return mu, kappa, (1.0 - share) * good[2] + share * bad[2]

    yes, no = 0.0, 1.0
    if alone(bad):
        return 1, 0, judged + body.judge(codes, side, numbers(*bad), alphas)
    for _ in range(bisections):
        middle = 0.5 * (yes + no)
        yes, no = (middle, no) if alone(between(middle)) else (yes, middle)
    return 1, 1, judged + body.judge(codes, side, numbers(*between(yes)), alphas)


@pytest.mark.slow
def test_forms_are_definite_where_the_kernel_says_so():
    yes, bordered, judged, _ = compared(range(14), most=2, bisections=12)
    assert yes > 20
    assert bordered > 10
    assert judged > 60


@pytest.mark.long
def test_many_forms_are_definite_where_the_kernel_says_so():
    yes, bordered, judged, several = compared(range(1015, 1035), most=3, bisections=45)
    assert yes > 16
    assert bordered > 8
    assert judged > 400
    assert several > 0


def planned(rng, p):
    """A problem with a planned selection, whose forces and displacements are affine in alpha; its friction is constant.

    Forces of sticking nodes grow from near zero, or from below it, and displacements of open ones change sides: theta
    is no affine function of alpha, or must change.
    """
    G = rng.normal(size=(2 * p, 2 * p))
    S = G @ G.T / (2 * p) + 0.3 * np.eye(2 * p)
    S = np.ldexp(np.rint(np.ldexp(S, 20)), -20)
    codes = rng.choice([0, 1, 1, 2, 3], size=p)
    F = np.ldexp(np.rint(16 * rng.uniform(0.3, 4.0, size=p)), -4)
    force, w = np.zeros((2, 2 * p)), np.zeros((2, 2 * p))
    for i, code in enumerate(codes.tolist()):
        normal = rng.choice([rng.uniform(0.02, 0.3), rng.uniform(0.5, 2.0), -0.2]), rng.uniform(0.5, 3.0)
        if code:
            force[:, i] = normal
        if code == 1:
            force[:, p + i] = F[i] * rng.uniform(-1, 1, size=2) * np.abs(normal)
        elif code > 1:
            side = 5 - 2 * code
            force[:, p + i], w[:, p + i] = side * F[i] * force[:, i], side * rng.uniform(0, 2, size=2)
        else:
            w[:, i], w[:, p + i] = -rng.uniform(0, 1, size=2), 2.0 * rng.normal(size=2)
    g = w + force @ S
    # with A = S and B = S the condensed compliance is S, and g is the load
    problem = ContactProblem(S, S[:p], S[p:], g[0], load_slope=g[1] - g[0], friction=F)
    return problem, tuple(codes.tolist())


@pytest.mark.slow
def test_theta_follows_many_solutions():
    counts = np.zeros(3, dtype=int)
    for seed in range(100, some(110, of=140)):
        rng = np.random.default_rng([42, seed])
        problem, codes = planned(rng, int(rng.integers(1, 3)))
        asked = codes, 0, 0.0, 1.0
        counts += at_the_border(rng, Body(problem, 1.0), asked, spread(0.0, 1.0, 16), 50)
    yes, bordered, judged = counts
    assert yes > some(2, of=8)
    assert bordered > some(1, of=6)
    assert judged > some(40, of=200)


@pytest.mark.parametrize(("share", "alone"), [(1.25, True), (1.9, False)])
def test_theta_that_bulges_between_its_ends(share, alone):
    """Q is definite for theta_1^2 + theta_2^2 < 4, nearly; theta goes from (share, 0) to (0, share), far around."""
    S = np.eye(4)
    S[2, 3] = S[3, 2] = 0.96875
    force = np.array([[1.0, 0.0625, share, 0.0], [0.0625, 1.0, 0.0, share]])
    g = force @ S
    problem = ContactProblem(S, S[:2], S[2:], g[0], load_slope=g[1] - g[0], friction=2.0)
    body = Body(problem, 1.0)
    numbers = PieceNumbers(np.ones(2), np.ones(2), np.zeros(2))
    assert only_roots([(body.traced.selection((1, 1), 0.0), 0.0, 1.0)], numbers) == [alone]
    definite = [body.form_is_definite((1, 1), 0, numbers, alpha) for alpha in spread(0.0, 1.0, 16)]
    assert (definite[0], definite[-1], all(definite)) == (True, True, alone)
