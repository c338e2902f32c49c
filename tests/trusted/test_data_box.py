"""Boxes of data with one solution (theory, section 13.5) against all selections in rationals at points of them."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from exact_balls import holds
from generators import integer_problem, random_problem
from oracles import exact_condense, solutions_of

from enumsol import ContactProblem
from enumsol.arithmetic.balls import Ball
from enumsol.search.data_boxes import Box, BoxSearch, _located, throughout
from enumsol.trusted.data_box import DataBox, Expansion, Throughout, only_throughout, slopes, solution_throughout
from enumsol.trusted.over_interval import PieceNumbers

ALPHAS = (0.0, 2.0)


def short(values, digits):
    return np.round(np.asarray(values) * digits) / digits


class Pair:
    """Two problems of one body, of whose line every point can be solved in rationals."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        p = int(rng.integers(1, 3))
        body = integer_problem(rng, p) if seed % 4 == 3 else random_problem(rng, p, planted=0.8)
        load, slope = body.f, short(rng.normal(size=body.n) / 4, 1024) * np.max(np.abs(body.f))
        # half of them with little friction: one solution, and boxes in which statuses change
        little = short(rng.uniform(0.05, 0.8, size=p), 64)
        F = [little if seed % 8 > 3 else body.friction] * 2
        gap = [np.zeros(p), np.zeros(p)]
        loads = [load, load]
        if seed % 3 == 0:
            F[1] = F[0] + short(rng.uniform(0, 1), 64)
        elif seed % 3 == 1:
            # of the size of a displacement, on the other side of contact at some nodes
            gap[1] = short(rng.normal(size=p) / 8, 256) * max(abs(float(x)) for x in exact_condense(body, 0)[1])
        else:
            loads[1] = load + short(rng.normal(size=body.n) / 4, 1024) * np.max(np.abs(load))
        turn = short(rng.uniform(0, 1, size=p), 64) * (seed % 2 or seed % 4 == 2)
        self.problems = tuple(
            # sometimes the friction of one problem only changes with alpha
            ContactProblem(body.A, body.Bn, body.Bt, loads[k], gap[k], F[k], (k or seed % 4 < 2) * turn, slope)
            for k in (0, 1)
        )
        self.p, self.rng, self._known = p, rng, {}

    def data(self, alpha, share):
        """S, g, F on the line between the problems."""
        (S, *first), (_, *second) = (exact_condense(problem, alpha) for problem in self.problems)
        parts = zip(first, second, strict=True)
        return S, *([(1 - share) * a + share * b for a, b in zip(*part, strict=True)] for part in parts)

    def solutions(self, alpha, share):
        """All of them, as connected components."""
        return solutions_of(*self.data(Fraction(alpha), Fraction(share)))

    def point(self, box):
        """Somewhere in a box, often on its border."""
        inside = self.rng.choice([0.0, 1.0, self.rng.random(), self.rng.random()], size=2)
        pairs = zip((box.alphas, box.shares), inside.tolist(), strict=True)
        return tuple(Fraction(low) + Fraction(x) * (Fraction(high) - Fraction(low)) for (low, high), x in pairs)


def largest(boxes, count):
    return sorted(boxes, key=lambda box: np.prod(np.ptp((box.alphas, box.shares), axis=1)))[-count:]


@pytest.mark.few(5, 0)
@pytest.mark.parametrize("seed", range(20))
def test_every_point_of_a_box_has_one_solution(seed):
    pair = Pair(seed)
    search = BoxSearch(pair.problems)
    search.run([ALPHAS], 24)
    for box in largest(search.found, 4):
        for _ in range(2):
            (only,) = pair.solutions(*pair.point(box))
            assert only.dimension == 0


@pytest.mark.slow
def test_the_cases_are_worth_it():
    """Boxes are found, also where nodes change their status, and beside problems with several solutions."""
    found = several = changes = 0
    for seed in (0, 1, 2, 4, 5, 6, 7, 8, 10, 13, 14):
        pair = Pair(seed)
        search = BoxSearch(pair.problems)
        search.run([ALPHAS], 16)
        found += len(search.found)
        several += any(len(pair.solutions(alpha, share)) > 1 for alpha in (0, 2) for share in (0, 1))
        for box in largest(search.found, 2):
            ends = [pair.solutions(alpha, share)[0].active(pair.p) for alpha in box.alphas for share in box.shares]
            changes += ends.count(ends[0]) < len(ends)
    assert found >= 4
    assert several > 1
    assert changes > 1


def located(pair, widths=(0.5, 0.1, 0.02)):
    """Boxes with what is known of their solution throughout, in the units of floats."""
    search = BoxSearch(pair.problems)
    for width in widths:
        for _ in range(4):
            low = float(pair.rng.uniform(0, 2 - width))
            box = Box((low, low + width), (0.5 - width / 4, 0.5 + width / 4))
            data, system = search._data(box)
            proposal = search._proposed(system)
            found = None if proposal is None else _located(data, system, proposal)
            if found is not None:
                yield box, data, system, proposal, found


def solutions_at(pair, point, unit):
    """lambda and w of every isolated solution at a point of a box, in units; F there."""
    S, g, F = pair.data(*point)
    length = [1 / Fraction(float(x)) for x in unit]
    for component in solutions_of(S, g, F):
        if component.dimension == 0:
            force = component.parts[0][1][0]
            w = [b - sum(s * x for s, x in zip(row, force, strict=True)) for b, row in zip(g, S, strict=True)]
            yield [x * y for x, y in zip(force, length, strict=True)], w, F


def held(expansion, exact):
    return holds(expansion.ball.mid, expansion.ball.rad, exact)


@pytest.mark.few(6)
@pytest.mark.parametrize("seed", range(16))
def test_a_solution_is_enclosed_and_served(seed):
    """At points of a box one solution is in its balls, and some theta within reach of the one stated serves it."""
    pair, rng = Pair(seed), np.random.default_rng(seed)
    for box, data, system, _, found in located(pair):
        mu, kappa = np.exp(rng.normal(size=(2, pair.p)))
        nu = rng.uniform(-1, 1, size=pair.p) * mu / np.maximum(data.system.F + data.system.F_rad, 1e-3) * 0.999
        plain = PieceNumbers(np.ones(pair.p), np.ones(pair.p), np.zeros(pair.p))
        for _ in range(2):
            point = pair.point(box)
            inside = []
            for force, w, F in solutions_at(pair, point, system.force):
                scaled = [x / Fraction(float(unit)) for x, unit in zip(w, system.length, strict=True)]
                if held(found.force, force) and held(found.w, scaled):
                    inside.append((force, w, F))
            assert inside
            for numbers in (plain, PieceNumbers(mu, kappa, nu)):
                theta, off = slopes(data, found, numbers)
                assert any(served(theta, off, numbers, *solution, pair.p, system) for solution in inside)


@pytest.mark.parametrize("seed", range(60))
def test_the_form_is_definite_for_every_theta_within_reach(seed):
    """One node beside another, F and g random: in floats at all ends of theta, where the trusted core says so."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(4, 4))
    A, F, load = X @ X.T + np.eye(4), rng.uniform(0.2, 1.5, size=2), rng.normal(size=4) + np.array([1, 1, 0, 0])
    pair = [ContactProblem(A, np.eye(4)[:2], np.eye(4)[2:], load * k, friction=F) for k in (1.0, 1.3)]
    search = BoxSearch(tuple(pair))
    data, system = search._data(Box((0.0, 1.0), (0.0, 1.0)))
    unknown = Expansion(*(Ball.exact(np.zeros(4)) for _ in range(3)), np.ones(4))
    numbers = PieceNumbers(np.ones(2), np.ones(2), np.zeros(2))
    found = Throughout(unknown, unknown, ())
    assert not only_throughout(data, Throughout(unknown, unknown, (0,)), numbers)
    theta, off = slopes(data, found, numbers)
    assert np.all(off >= F)
    S, least = system.S, np.inf
    for ends in theta + np.array(list(product((-1.0, 1.0), repeat=2))) * off:
        D = np.block([[np.eye(2), np.zeros((2, 2))], [np.diag(-ends), np.eye(2)]])
        least = min(least, np.linalg.eigvalsh(D.T @ S + S @ D)[0])
    assert least > 0 or not only_throughout(data, found, numbers)


def served(theta, off, numbers, force, w, F, p, system):
    """Whether at every node some theta within reach serves a solution (theory, section 6.11)."""
    for i in range(p):
        bound, n, t = F[i], force[i], force[p + i]
        u, v = -w[i] / Fraction(float(system.length[i])), w[p + i] / Fraction(float(system.length[p + i]))
        low, high = (Fraction(float(theta[i])) + side * Fraction(float(off[i])) for side in (-1, 1))
        low, high = max(low, -bound), min(high, bound)
        if n > 0:
            low, high = max(low, t / n), min(high, t / n)
        else:
            mu, kappa, nu = (Fraction(float(part[i])) for part in (numbers.mu, numbers.kappa, numbers.nu))
            if v > 0:
                low = max(low, bound - (mu + nu * bound) * u / (kappa * v))
            if v < 0:
                high = min(high, -bound + (mu - nu * bound) * u / (kappa * -v))
        # theta is a float: what serves exactly may be beside it by a rounding
        if bound > 0 and low > high + Fraction(1, 2**46) * (1 + bound):
            return False
    return True


@pytest.mark.few(4)
@pytest.mark.parametrize("seed", range(0, 20, 2))
def test_regular_solutions_are_enclosed_to_first_order(seed):
    """The forces at points of a box, in rationals, are those of the expansion."""
    pair = Pair(seed)
    for box, data, system, proposal, _ in located(pair):
        found = solution_throughout(data, proposal.selection, (), np.zeros(0), proposal.force)
        if found is None or found.broken:
            continue
        for _ in range(2):
            alpha, share = pair.point(box)
            s, t = (
                2 * (x - Fraction(low)) / (Fraction(high) - Fraction(low)) - 1
                for x, (low, high) in ((alpha, box.alphas), (share, box.shares))
            )
            solutions = solutions_at(pair, (alpha, share), system.force)
            assert any(expands_to(found.force, s, t, force) for force, _, _ in solutions)


def expands_to(expansion, s, t, values):
    for k, value in enumerate(values):
        parts = [(expansion.value, 1), (expansion.along, s), (expansion.across, t)]
        middle = sum(Fraction(float(part.mid[k])) * factor for part, factor in parts)
        radius = sum(Fraction(float(part.rad[k])) for part, _ in parts) + Fraction(float(expansion.rest[k]))
        # the box is a little wider than its ends say
        slack = Fraction(1, 2**44) * (abs(middle) + sum(Fraction(abs(float(part.mid[k]))) for part, _ in parts))
        if abs(value - middle) > radius + slack:
            return False
    return True


def test_products_of_expansions():
    rng = np.random.default_rng(3)

    def some():
        return Expansion(*(Ball.exact(rng.normal(size=30)) for _ in range(3)), np.abs(rng.normal(size=30)))

    one, other = some(), some()
    product = one * other
    for s, t, a, b in rng.choice([-1.0, 1.0], size=(16, 4)).tolist():
        x, y = (e.value.mid + s * e.along.mid + t * e.across.mid + c * e.rest for e, c in ((one, a), (other, b)))
        first = product.value.mid + s * product.along.mid + t * product.across.mid
        assert np.all(np.abs(x * y - first) <= product.rest + 1e-12)
        assert np.all(np.abs(x * y - product.ball.mid) <= product.ball.rad + 1e-12)


def test_what_is_not_the_only_solution_is_not_claimed():
    """A jammed node, whose statuses hold strictly throughout, with numbers of every kind: there are two more roots."""
    S = np.array([[1.0, 0.9], [0.9, 1.0]])
    rows, A = np.eye(2), np.linalg.inv(S)
    problems = [ContactProblem(A, rows[:1], rows[1:], A @ [-0.1, load], friction=3.0) for load in (-1.0, -1.1)]
    several = solutions_of(*exact_condense(problems[0], 0))
    assert len(several) > 1
    search, rng = BoxSearch(tuple(problems)), np.random.default_rng(0)
    data, _ = search._data(Box((0.0, 0.0), (0.0, 1.0)))
    for component in several:
        found = solution_throughout(data, component.parts[0][0], (), np.zeros(0), np.zeros(2))
        assert not found.broken
        for _ in range(200):
            mu, kappa = np.exp(rng.normal(size=(2, 1)))
            nu = rng.uniform(-1, 1, size=1) * mu / 3.0
            assert not only_throughout(data, found, PieceNumbers(mu, kappa, nu))
    search.run([(0.0, 1.0)], 50)
    assert not search.found


def test_all_data_of_a_box_are_held_in_any_units():
    pair, none = Pair(1), np.zeros(2)
    matrices = np.eye(4), np.eye(4)[:2], np.eye(4)[2:]
    pair.problems = (
        ContactProblem(*matrices, [1, 2, 3, 4], [0, 1], np.array([1, 2]), np.array([1, 0]), [1, 2, 0, -1]),
        ContactProblem(*matrices, [2, 1, 0, 4], none, np.array([1, 0]), np.array([0, 3]), [-3, 0, 0, 2]),
    )
    enclosures = tuple(problem.enclosure for problem in pair.problems)
    box = (0.25, 0.5), (0.25, 0.5)
    one = DataBox.between(enclosures, *box, np.ones(4), np.ones(4))
    other = DataBox.between(enclosures, *box, np.full(4, 4.0), np.full(4, 0.5))
    assert np.allclose(one.g.ball.mid, other.g.ball.mid * 0.5)
    assert np.allclose(one.system.S * 8.0, other.system.S)
    for alpha in box[0]:
        for share in box[1]:
            _, g, F = pair.data(Fraction(alpha), Fraction(share))
            s, t = (8 * Fraction(x) - 3 for x in (alpha, share))
            for expansion, exact in ((one.g, g), (one.F, F)):
                assert held(expansion, exact)
                assert expands_to(expansion, s, t, exact)


def test_ranges_that_boxes_cover():
    left = [Box((0.0, 1.0), (0.0, 0.5)), Box((0.0, 0.5), (0.5, 1.0))]
    assert throughout(left) == [(0.0, 0.5)]
    assert throughout([*left, Box((0.5, 1.0), (0.5, 1.0))]) == [(0.0, 1.0)]
    assert throughout([*left, Box((0.5, 1.0), (0.75, 1.0))]) == [(0.0, 0.5)]
    assert throughout([]) == []
    assert throughout([Box((0.0, 1.0), (0.0, 1.0)), Box((2.0, 3.0), (0.0, 1.0))]) == [(0.0, 1.0), (2.0, 3.0)]
