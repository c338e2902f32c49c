"""Exclusion and leaves over a piece of alpha in 3D against solutions and minima at sampled alphas."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from problems3d import SLIDING, sliding_node
from space_proofs import random_problem

from enumsol import enumerate_roots
from enumsol.arithmetic.balls import Ball
from enumsol.branches.space.chains import chain_through
from enumsol.condensation.space_condensed import AlphaSpace, EnclosedSpace, PieceTurn
from enumsol.model.sectors import SECTORS, nearest, start_of
from enumsol.search.space.curve_proposals import placed
from enumsol.search.space.piece_proposals import PieceBounds
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.leaf_equations import Leaf, slopes_by_second
from enumsol.trusted.space.leaves import Open, SpaceRoot
from enumsol.trusted.space.pieces import AlphaPiece, lie_along
from enumsol.trusted.space.sector_margins import space_margin
from enumsol.trusted.space.sector_rows import CONTACT, OPEN, STICK, UNDECIDED, row_sign, sector_row_terms
from enumsol.trusted.space.solution_curve import AlphaProblem

LOW, HIGH = Fraction(1, 4), Fraction(1, 2)


def changing_problem(p, seed, isotropic=False):
    """Load and friction change with alpha, the coefficients of every node by one factor."""
    rng = np.random.default_rng(seed)
    problem = random_problem(p, seed)
    F1 = 2.0 ** rng.integers(-1, 3, p) if isotropic else rng.uniform(0.5, 3.0, p)
    F2 = F1 if isotropic else 2.0 * F1
    slope = rng.choice([-1.0, 0.5, 1.0])
    friction = {"friction": (F1, F2), "friction_slope": (slope * F1, slope * F2)}
    return problem.replace(**friction, load_slope=rng.standard_normal(problem.n))


def piece_of(problem, low=LOW, high=HIGH):
    system = SpaceSolvers(problem, (low + high) / 2, "verified").system
    return AlphaPiece(AlphaSpace(problem.enclosure, (2 * low + high) / 3, (system.force, system.length)), low, high)


def sector_at(tau, level):
    """The sector of a level that holds a direction."""
    number = nearest(*(tau / np.hypot(*tau)), level)
    x, y = (float(z) for z in start_of(number))
    first = 1 << level
    return number if x * tau[1] - y * tau[0] >= 0 else first + (number - first - 1) % first


def codes_at(root, F, level):
    """Those of the leaf of a level that holds a root."""
    sectors = [SECTORS + sector_at(tau, level) if np.any(tau) else None for tau in root.lambda_t / F]
    codes = [{"open": OPEN, "stick": STICK}.get(status.value) for status in root.statuses]
    return [sector if code is None else code for code, sector in zip(codes, sectors, strict=True)]


def rows_of(codes, rng):
    """Some rows that the codes allow, with multipliers of allowed signs."""
    rows = []
    for i, code in enumerate(codes):
        number = code - SECTORS
        kinds = [(0, 0), (1, 0), (6, int(rng.integers(8, 16)))]
        kinds += [(2, k) for k in (0, 1)] if code == OPEN else [(4 - 1, k) for k in (0, 1)] if code == STICK else []
        kinds += [(kind, number) for kind in (7, 8, 9)] if code > SECTORS else []
        rows += [(kind, i, n) for kind, n in kinds]
    values = rng.exponential(size=len(rows))
    free = [row_sign(codes[row[1]], row) == 2 for row in rows]
    return rows, np.where(free, values * rng.choice([-1, 1], len(rows)), values)


def least_at(problem, piece, alpha, rows, values):
    """The minimum over all forces of the energy less the rows, in floats, from S, g and F of the problem."""
    p, (force, length) = problem.p, piece.space.units
    middle, at = problem.friction_at(piece.space.reference), problem.friction_at(alpha)
    disc = at[:, 0] / middle[:, 0]
    size = np.concatenate([force, middle[:, 0] * force, middle[:, 1] * force])
    work = float(force[0] * length[0])
    S = size[:, None] * problem.condensed.S * size / work
    g = size * problem.condensed.free_displacements(alpha) / work
    a, b = np.zeros(3 * p), np.zeros(3 * p)
    places = np.array([[p + i, 2 * p + i] for i in range(p)])
    for row, value in zip(rows, values, strict=True):
        for k, factor in zip(*sector_row_terms(row, places, 3 * p), strict=True):
            x = factor * (disc[k] if k < p and row[0] in (6, 7) else 1.0)
            if k < 3 * p:
                a[k] += value * x
            else:
                b[k - 3 * p] += value * x
    h = g + a - S @ b
    y = np.linalg.solve(S, h) / 2
    return float(y @ S @ y - h @ y - b @ g)


@pytest.mark.parametrize("seed", range(3))
def test_the_same_multipliers_at_both_ends_prove_the_least_minimum_over_a_piece(seed):
    """The bound is that of an end, and no minimum between is less."""
    rng = np.random.default_rng(seed)
    problem = changing_problem(2, seed)
    piece = piece_of(problem)
    for codes in [(UNDECIDED, CONTACT), (OPEN, STICK), (SECTORS + 9, SECTORS + 70), (STICK, SECTORS + 5)]:
        rows, values = rows_of(codes, rng)
        ends = [least_at(problem, piece, alpha, rows, values) for alpha in (LOW, HIGH)]
        inside = [least_at(problem, piece, LOW + (HIGH - LOW) * Fraction(k, 7), rows, values) for k in range(1, 7)]
        size = 1.0 + abs(min(ends))
        assert min(inside) >= min(ends) - 1e-9 * size
        for end, bound in zip(piece.ends, ends, strict=True):
            assert bound - 1e-6 * size <= space_margin(end, codes, rows, values) <= bound + 1e-9 * size
        assert (piece.margin(codes, rows, (values, values)) > 0) == (min(ends) > 0)


@pytest.mark.parametrize("seed", range(4))
def test_multipliers_between_those_of_the_ends_prove_no_more_than_the_least_minimum_over_a_piece(seed):
    """Those of the ends may prove much there and nothing between; where all between is positive it mostly is proven."""
    rng = np.random.default_rng([seed, 2])
    problem = changing_problem(2, seed)
    proven, between, possible = 0, 0, 0
    assignments = [(OPEN, STICK), (STICK, STICK), (SECTORS + 9, SECTORS + 70), (STICK, SECTORS + 5), (OPEN, OPEN)]
    for codes in 24 * assignments:
        # friction changes up to thirtyfold
        low, high = Fraction(int(rng.integers(-15, 4)), 16), Fraction(int(rng.integers(5, 16)), 16)
        piece = piece_of(problem, low, high)
        rows, values = rows_of(codes, rng)
        # near multipliers that prove much at each end
        best = [_best_at(end, codes, rows) for end in piece.ends]
        pair = tuple(b * rng.uniform(0.8, 1.2, len(b)) + 0.02 * values for b in best)
        shares = [Fraction(k, 16) for k in range(17)]
        least = [
            least_at(problem, piece, low + (high - low) * t, rows, float(1 - t) * pair[0] + float(t) * pair[1])
            for t in shares
        ]
        bound = piece.margin(codes, rows, pair)
        assert bound <= min(least) + 1e-9 * (1.0 + max(map(abs, least))) or min(least[0], least[-1]) <= 0
        assert not bound > 0 or min(least) > 0
        proven += bound > 0
        possible += min(least) > 0
        between += min(least[0], least[-1]) > 0 and min(least) <= 0
    assert proven > 0.1 * possible > 0
    assert between > 0
    # a wrong sign at one end
    rows, values = rows_of((OPEN, OPEN), rng)
    wrong = np.where([row[0] == 6 for row in rows], -values, values)
    assert piece.margin((OPEN, OPEN), rows, (values, wrong)) == -np.inf
    assert piece.margin((OPEN, OPEN), rows, (wrong, values)) == -np.inf


def _best_at(end, codes, rows):
    """Multipliers of rows by which the bound at one alpha is about as large as it can be, by projected gradients."""
    size, units = len(end.g), end.row_unit
    A, B = np.zeros((size, len(rows))), np.zeros((size, len(rows)))
    for k, row in enumerate(rows):
        for i, factor in zip(*sector_row_terms(row, end.tau, size), strict=True):
            value = factor * units[i] * (end.discs.mid[i] if i == row[1] and row[0] in (4, 6, 7) else 1.0)
            (A[i] if i < size else B[i - size])[k] += value
    H, q = A - end.S @ B, -end.g @ B
    free = np.array([row_sign(codes[row[1]], row) == 2 for row in rows])
    bend, slope = H.T @ np.linalg.solve(end.S, H), q - 0.5 * H.T @ np.linalg.solve(end.S, end.g)
    m, step = np.zeros(len(rows)), 2.0 / np.linalg.norm(bend, 2)
    for _ in range(400):
        m = m + step * (slope - 0.5 * bend @ m)
        m = np.where(free, m, np.maximum(m, 0))
    return m


@pytest.mark.parametrize("seed", range(3))
def test_multipliers_for_both_ends_serve_wherever_others_do(seed):
    """Where some multipliers of rows prove a bound at both ends, those that are sought for them do so, too."""
    rng = np.random.default_rng([seed, 1])
    problem = changing_problem(2, seed)
    piece = piece_of(problem, LOW, LOW + (HIGH - LOW) / 64)
    served = 0
    for codes in [(OPEN, STICK), (STICK, STICK), (SECTORS + 9, SECTORS + 70), (STICK, SECTORS + 5), (OPEN, OPEN)]:
        for _ in range(20):
            rows, values = rows_of(codes, rng)
            found = PieceBounds(piece, codes, rows).positive()
            if found is None:
                best = [_best_at(end, codes, rows) for end in piece.ends]
                others = [best, *((scale * values, scale * values) for scale in (0.3, 1.0, 3.0))]
                assert max(piece.margin(codes, rows, tuple(pair)) for pair in others) <= 1e-4
                continue
            assert piece.margin(codes, rows, tuple(np.split(found, 2))) > 0
            served += 1
    assert served


def lies_between(low, high, x):
    """Whether x is within (1 - t) low + t high for one t from 0 to 1, by the inequalities for t of every number."""
    slack = 1e-9 * (1.0 + np.abs(x))
    rate = high.mid - low.mid, high.rad - low.rad
    a = np.concatenate([rate[0] - rate[1], -rate[0] - rate[1], [1.0, -1.0]])
    b = np.concatenate([x - low.mid + low.rad + slack, low.mid - x + low.rad + slack, [1.0, 0.0]])
    most = np.min(np.where(a > 0, b / np.where(a > 0, a, 1.0), np.inf))
    least = np.max(np.where(a < 0, b / np.where(a < 0, a, 1.0), -np.inf))
    return bool(np.all(b[a == 0] >= 0) and least <= most)


@pytest.mark.parametrize("loose", [[], [0]])
@pytest.mark.parametrize(("p", "seed"), [(1, 1), (2, 1), pytest.param(3, 1, marks=pytest.mark.slow)])
def test_second_derivatives_over_a_piece_hold_differences(p, seed, loose):
    """Quotients of differences of G are means of its second derivatives with respect to (psi, s).

    And to normal forces between both that are left free.
    """
    problem, rng = changing_problem(p, seed), np.random.default_rng(seed)
    piece = piece_of(problem, Fraction(3, 8), Fraction(3, 8) + Fraction(1, 64))
    for _ in range(6):
        codes = [SECTORS + int(rng.integers(256, 512)) for _ in range(p)]
        leaf, n = Leaf(piece.whole, codes, loose), p + len(loose)
        angle, radius = (
            np.append(np.zeros(p), 0.5 * np.ones(len(loose))),
            np.append(leaf.half, 0.3 * np.ones(len(loose))),
        )
        state = leaf.over(angle, radius)
        if state is None:
            continue
        point = leaf.over(angle, 0.0 * radius, still=True)
        Y = rng.standard_normal((n, n))
        moved, swept = leaf.second(Y, (state, point), angle, radius)
        half = (piece.high - piece.low) / 2

        def at(z, codes=codes, half=half, Y=Y, angle=angle):
            alpha, there = piece.middle + Fraction(float(z[-1])) * half, angle + z[:-1]
            return Y @ Leaf(piece.space.at(alpha), codes, loose).over(there, 0.0 * there, still=True).G.mid

        steps = np.diag(np.append(0.4 * radius, 0.4))
        z = np.append(rng.uniform(-0.2, 0.2, n) * radius, rng.uniform(-0.2, 0.2))
        for j, one in enumerate(steps):
            means, lost = np.zeros((n, n + 1)), np.zeros(n + 1)
            for k, other in enumerate(steps):
                difference = at(z + one + other) - at(z + one) - at(z + other) + at(z)
                means[:, k] = np.abs(difference / (one[j] * other[k]))
                lost[k] = 1e-13 * np.max(np.abs(at(z))) / (one[j] * other[k])
            assert np.all(means[:, :n] @ radius <= moved[:, j] + lost[:n] @ radius)
            assert np.all(means[:, n] <= swept[:, j] + lost[n])


@pytest.mark.parametrize("seed", range(4))
def test_values_and_slopes_over_a_piece_hold_those_at_its_alphas(seed):
    problem, rng, seen = changing_problem(2, seed), np.random.default_rng([7, seed]), 0
    for length in (Fraction(1, 4), Fraction(1, 16), Fraction(1, 256)):
        piece = piece_of(problem, LOW, LOW + length)
        for _ in range(8):
            leaf = Leaf(piece.whole, [SECTORS + int(rng.integers(64, 512)) for _ in range(2)])
            angle, radius = rng.uniform(-0.5, 0.5, 2) * leaf.half, leaf.half * 10.0 ** -rng.uniform(0, 4)
            state = leaf.over(angle, radius)
            if state is None:
                continue
            seen += 1

            def at(psi, s, leaf=leaf, piece=piece):
                alpha = piece.middle + Fraction(float(s)) * (piece.high - piece.low) / 2
                return Leaf(piece.space.at(alpha), leaf.codes).over(psi, np.zeros(2))

            for s in (-1.0, rng.uniform(-1, 1), 1.0):
                psi = angle + 0.999 * radius * rng.choice([-1.0, 1.0, rng.uniform(-1, 1)], 2)
                there = at(psi, s)
                for over, point in zip(state[:4], there[:4], strict=True):
                    assert np.all(np.abs(over.mid - point.mid) <= over.rad + 1e-12 * (1.0 + np.abs(point.mid)))
                ends = max(s - 0.02, -1.0), min(s + 0.02, 1.0)
                rate = (at(psi, ends[1]).G.mid - at(psi, ends[0]).G.mid) / (ends[1] - ends[0])
                lost = 1e-12 * (1.0 + np.max(np.abs(there.G.mid)))
                assert np.all(np.abs(state.G_turn.mid - rate) <= state.G_turn.rad + lost)
    assert seen > 8


def test_what_lies_in_several_boxes_lies_along_their_curve():
    """Between two points of a curve are the boxes between them, and no fewer."""
    given, interval = AlphaProblem.of(SLIDING.enclosure), (Fraction(2, 5), Fraction(3, 5))
    chain = chain_through(given, SLIDING, np.append(sliding_node(0.5), 0.5), interval)
    curves = [link.curve for link in chain.links]
    assert len(curves) > 2
    for k in range(len(curves) - 1):
        ends = [curve.at(share * curve.box.half) for curve, share in ((curves[k], 0.0), (curves[k + 1], 0.0))]
        for low, high in (ends, ends[::-1]):
            assert lie_along((low, high), curves[k : k + 2])
            assert not lie_along((low, high), curves[k : k + 1])
            assert not lie_along((low, high), [])
        if k + 2 < len(curves):
            ends = [curves[i].at(0.0) for i in (k, k + 2)]
            assert lie_along(ends, curves[k : k + 3])
            assert not lie_along(ends, [curves[k], curves[k + 2]])


#: Nodes and seeds.
LARGER = [
    pytest.param(2, 0, marks=pytest.mark.slow),
    *(pytest.param(*n, marks=pytest.mark.long) for n in [(2, 5), (3, 4)]),
]


@pytest.mark.parametrize(("p", "seed"), [(1, 0), (1, 22), *LARGER])
def test_no_root_over_a_piece_is_missed(p, seed):
    """Leaves that hold a root at some alpha of a piece are not empty, and bounds of their forces hold it."""
    problem = changing_problem(p, seed, isotropic=bool(seed % 2))
    settled = drifts = 0
    given = AlphaProblem.of(problem.enclosure)
    for alpha in (LOW, Fraction(13, 32), HIGH):
        F = problem.friction_at(alpha)
        for root in enumerate_roots(problem, alpha):
            for level, width in ((4, Fraction(1, 16)), (9, Fraction(1, 256)), (12, Fraction(1, 4096))):
                piece = piece_of(problem, max(alpha - width, LOW), min(alpha + width, HIGH))
                codes = codes_at(root, F, level)
                found = piece.held(codes)
                assert found is not None
                if found.y is not None:
                    forces = piece.forces(found.y)
                    near = np.concatenate([root.lambda_n, *root.lambda_t.T])
                    assert np.all(np.abs(forces.mid - near) <= forces.rad + 1e-9 * np.max(np.abs(near)))
                    w = piece.displacements(found.y, found.w, piece.alphas)
                    moved = problem.condensed.free_displacements(float(alpha)) - problem.condensed.S @ near
                    assert np.all(np.abs(w.mid - moved) <= w.rad + 1e-9 * np.max(np.abs(moved)) + 1e-13)
                for low, high in (ends for ends in piece.places(found, given) if len(ends) == 2):
                    assert lies_between(low, high, placed(given, np.append(near, float(alpha))))
                    drifts += 1
                settled += isinstance(found, SpaceRoot)
    assert settled
    assert drifts


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_a_root_over_a_piece_is_one_at_every_alpha(seed):
    """What is said to be the roots' enclosure over the piece holds that of every point of it, and no more is known."""
    problem = changing_problem(2, seed, isotropic=True)
    alpha = Fraction(3, 8)
    for root in enumerate_roots(problem, alpha):
        codes = codes_at(root, problem.friction_at(alpha), 8)
        width = Fraction(1, 64)
        while not isinstance(piece_of(problem, alpha - width, alpha + width).held(codes), SpaceRoot):
            width /= 2
            assert width > Fraction(1, 2**20)
        piece = piece_of(problem, alpha - width, alpha + width)
        whole = piece.forces(piece.held(codes).y)
        for k in range(5):
            at = alpha + width * Fraction(k - 2, 2)
            point = AlphaPiece(piece.space, at, at)
            there = point.held(codes)
            assert isinstance(there, SpaceRoot)
            forces = point.forces(there.y)
            assert np.all(np.abs(forces.mid - whole.mid) <= whole.rad + forces.rad)
            assert there.index == piece.held(codes).index


def test_displacements_of_nodes_without_friction_follow_from_the_forces():
    problem = changing_problem(2, 1)
    F, slope = (tuple(np.array(pair) * [0.0, 1.0]) for pair in (problem.friction, problem.friction_slope))
    problem = problem.replace(friction=F, friction_slope=slope)
    piece = piece_of(problem, Fraction(3, 8), Fraction(3, 8) + Fraction(1, 1024))
    rng = np.random.default_rng(3)
    y = rng.standard_normal(4)
    forces = piece.forces(Ball.exact(y)).mid
    assert np.all(forces.reshape(3, 2)[1:, 0] == 0)
    for alpha in (piece.low, piece.middle, piece.high):
        scaled = piece.space.at(alpha)
        w = piece.displacements(Ball.exact(y), Ball.exact(scaled.g - scaled.S @ y), piece.alphas)
        moved = problem.condensed.free_displacements(float(alpha)) - problem.condensed.S @ forces
        assert np.all(np.abs(w.mid - moved) <= w.rad + 1e-12 * np.max(np.abs(moved)))


def test_what_is_not_proven_over_a_piece_is_left_open():
    """A wide piece of a problem whose solution changes its status holds no regular root in any leaf of it."""
    piece = piece_of(changing_problem(1, 22), Fraction(0), Fraction(64))
    assert isinstance(piece.held((SECTORS + 4,)), Open | None)


class Along:
    """y, w and G of a leaf of sectors over a piece, and their derivatives by (psi, s), in floats by formulas of (12.1).

    M x = P g, y = E x, w = g - S y with E(psi, s) and g(s): no more is used than their derivatives. Normal forces that
    are left free are unknowns between psi and s, with y = E x + E_free free, and their w_n are zeros after G.
    """

    def __init__(self, leaf, psi, free, s):
        turn, rows, q = leaf.system.turn, [*leaf.rows, *leaf.loose], len(psi)
        S, t, unit = leaf.system.S, leaf.t, leaf.system.unit
        column, solved = [rows.index(i) for i in leaf.turning], len(leaf.rows)
        g, rate = turn.g.mid + s * turn.g_turn.mid, turn.g_turn.mid
        disc, grows = (part.mid[leaf.turning] for part in (turn.disc, turn.disc_turn))
        across = np.column_stack([-leaf.centre[:, 1], leaf.centre[:, 0]])
        d = np.cos(psi)[:, None] * leaf.centre + np.sin(psi)[:, None] * across
        turned = np.column_stack([-d[:, 1], d[:, 0]])
        E = np.zeros((len(S), len(rows)))
        E[rows, np.arange(len(rows))] = 1.0
        first = np.zeros((q + 1, *E.shape))
        for k in range(q):
            E[t[k], column[k]] = (disc[k] + s * grows[k]) * d[k] / unit[t[k]]
            first[k, t[k], column[k]] = (disc[k] + s * grows[k]) * turned[k] / unit[t[k]]
            first[q, t[k], column[k]] = grows[k] * d[k] / unit[t[k]]
        rows = rows[:solved]
        M = (S @ E[:, :solved])[rows]

        def held(load, given):
            """y of forces that are given, with those that the equations need."""
            return given + E[:, :solved] @ np.linalg.solve(M, (load - S @ given)[rows])

        self.y = held(g, E[:, solved:] @ free)
        x, none = np.append(np.linalg.solve(M, (g - S @ E[:, solved:] @ free)[rows]), free), np.zeros(len(g))
        self.w = g - S @ self.y
        moved = [held(none, first[k] @ x) for k in range(q)] + [held(none, column) for column in E[:, solved:].T]
        self.dy = np.column_stack([*moved, held(rate, first[q] @ x)])
        self.dw = np.column_stack([*np.zeros((q + len(free), len(g))), rate]) - S @ self.dy
        v, dv = (self._slips(leaf, part) for part in (self.w[:, None], self.dw))
        self.G = v[0, :, 0] * d[:, 1] - v[1, :, 0] * d[:, 0]
        self.dG = dv[0] * d[:, 1:] - dv[1] * d[:, :1]
        self.dG[np.arange(q), np.arange(q)] += v[0, :, 0] * d[:, 0] + v[1, :, 0] * d[:, 1]
        self.G, self.dG = np.append(self.G, self.w[leaf.loose]), np.vstack([self.dG, self.dw[leaf.loose]])
        for part in (self.w, self.dw):
            part[rows] = 0.0
        self.w[leaf.loose] = 0.0

    @staticmethod
    def _slips(leaf, w):
        return np.array([w[leaf.t[:, k]] * leaf.slip_scale[:, k, None] for k in (0, 1)])


def steep_piece(p, seed, share, level, loose):
    """A leaf over a piece of a random system whose coefficients change by up to a share, in sectors of a level.

    ``loose`` normal forces are left free.
    """
    rng = np.random.default_rng([seed, p, 5])
    m, none = 3 * p, Ball.exact(np.zeros(3 * p))
    A = rng.normal(size=(m, m))
    S, g, rate = A @ A.T / m + 0.1 * np.eye(m), rng.normal(size=m), share * rng.normal(size=m)
    disc = rng.uniform(0.3, 2.0, p)
    grows = share * disc * rng.uniform(-1, 1, p)
    tau = np.array([[p + 2 * i, p + 2 * i + 1] for i in range(p)])
    F, zero, unit = np.ones((p, 2)), np.zeros((m, m)), np.append(np.ones(p), 2.0 ** rng.choice([0, -2, 3], 2 * p))
    held = EnclosedSpace(S, zero, g, none.mid, F, 0.0 * F, tau, unit)
    along = PieceTurn(*map(Ball.exact, (g, rate, disc, grows)))
    wide = (np.abs(part) * (1.0 + 1e-12) for part in (rate, grows))
    whole = replace(held, g_rad=next(wide), discs=Ball(disc, next(wide)), turn=along, fixed=held)
    codes = [SECTORS + int(rng.integers(1 << level, 2 << level)) for _ in range(p)]
    return Leaf(whole, codes, rng.permutation(p)[:loose])


@pytest.mark.parametrize("share", [1e-3, 0.1, 0.9])
@pytest.mark.parametrize(("p", "loose"), [(1, 0), (2, 0), (3, 0), (1, 1), (2, 1), (3, 1), (3, 2)])
def test_what_changes_along_a_piece_lies_in_its_balls(p, loose, share):
    """Values and first derivatives at points of a box and a piece, and Y times those of G by second ones."""
    rng, known = np.random.default_rng([p, 7]), 0
    for seed in range(10):
        leaf = steep_piece(p, seed, share, int(rng.integers(3, 9)), loose)
        radius = np.append(leaf.half * 10.0 ** -rng.uniform(0, 3, p), 10.0 ** -rng.uniform(0, 3, loose))
        angle = np.append(np.zeros(p), rng.uniform(-1, 2, loose))
        with np.errstate(all="ignore"):
            state, point = leaf.over(angle, radius), leaf.over(angle, 0.0 * radius, still=True)
        if state is None or point is None:
            continue
        known += 1
        Y = np.linalg.inv(point.J.mid) if seed % 2 else rng.normal(size=(p + loose, p + loose))
        beside = sum(leaf.second(Y, (state, point), angle, radius))
        slope = slopes_by_second(Ball.exact(Y), point.whole_J, state.whole_J, beside)
        held = Ball.beside(state.box.slope, state.box.lone)
        for _ in range(20):
            z = np.append(radius, 1.0) * rng.choice([-1, 1, rng.uniform(-1, 1)], p + loose + 1)
            there = Along(leaf, z[:p], angle[p:] + z[p:-1], z[-1])
            size = 1e-9 * (1.0 + np.max(np.abs(there.dy)) + np.max(np.abs(there.dw)))
            pairs = [(state.y, there.y), (state.w, there.w), (state.G, there.G), (state.whole_J, there.dG)]
            pairs += [(held, np.vstack([there.dy, there.dw])), (slope, Y @ there.dG)]
            for ball, exact in pairs:
                assert np.all(np.abs(exact - ball.mid) <= ball.rad + size * (1.0 + np.max(np.abs(Y))))
    assert known >= 3
