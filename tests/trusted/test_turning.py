"""What a leaf in 3D encloses over a box of directions, against rationals at directions in the box."""

from fractions import Fraction

import numpy as np
import pytest
from exact_balls import holds
from flint import fmpq, fmpq_mat

from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.sectors import SECTORS
from enumsol.trusted.space.leaf_equations import Leaf
from enumsol.trusted.space.sector_rows import OPEN, STICK
from enumsol.trusted.space.turning import sums_of_both


def exact(value):
    return fmpq(*float(value).as_integer_ratio())


def rational_system(rng, spread):
    """S with eigenvalues over ``spread`` powers of ten, coefficients over six."""
    p = int(rng.integers(1, 4))
    G = rng.normal(size=(3 * p, 3 * p))
    S = G @ G.T / (3 * p) + 0.1 * np.eye(3 * p)
    motion = rng.normal(size=3 * p)
    S += 10.0**spread * np.outer(motion, motion)
    F = 10.0 ** rng.integers(-3, 4, size=(p, 2)) * rng.uniform(0.3, 2.0, size=(p, 2))
    return SpaceSystem.scaled(S, 10.0 ** rng.integers(0, 3) * rng.normal(size=3 * p), F)


class Exactly:
    """y, w, G and dG/dpsi in rationals, at directions with rational coordinates."""

    def __init__(self, leaf, system, angles):
        self.leaf, self.m, self.k = leaf, len(system.g), len(leaf.rows)
        self.angles = angles
        S = fmpq_mat(self.m, self.m, [exact(value) for value in system.S.ravel()])
        g = fmpq_mat(self.m, 1, [exact(value) for value in system.g])
        self.unit = [[exact(system.unit[t]) for t in pair] for pair in leaf.t]
        self.scale = [[exact(value) for value in pair] for pair in leaf.slip_scale]
        self.d = [self.direction(k, angle) for k, angle in enumerate(angles)]
        E = fmpq_mat(self.m, self.k)
        for j, row in enumerate(leaf.rows):
            E[row, j] = fmpq(1)
        for k, column in enumerate(leaf.column):
            for t, d, unit in zip(leaf.t[k], self.d[k], self.unit[k], strict=True):
                E[int(t), column] = d / unit
        SE = S * E
        M, load = self.picked(SE), self.picked(g)
        x = M.solve(load) if self.k else fmpq_mat(0, 1)
        self.y = E * x if self.k else fmpq_mat(self.m, 1)
        self.w = g - S * self.y
        self.dw = []
        for k, column in enumerate(leaf.column):
            push, turned = fmpq_mat(self.m, 1), (-self.d[k][1], self.d[k][0])
            for t, d, unit in zip(leaf.t[k], turned, self.unit[k], strict=True):
                push[int(t), 0] = d / unit * x[column, 0]
            pushed = S * push
            self.dw.append(SE * M.solve(self.picked(pushed)) - pushed)

    def direction(self, k, angle):
        """The rational point of the circle nearest, within rounding, to an angle from a sector's centre."""
        c = self.leaf.centre[k]
        t = Fraction(np.tan(0.5 * (np.arctan2(c[1], c[0]) + angle)))
        x, y = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
        return fmpq(x.numerator, x.denominator), fmpq(y.numerator, y.denominator)

    def picked(self, column):
        return fmpq_mat([[column[row, j] for j in range(column.ncols())] for row in self.leaf.rows] or [[]])

    def slips(self, w, k):
        return [w[int(t), 0] * scale for t, scale in zip(self.leaf.t[k], self.scale[k], strict=True)]

    def G(self):
        pairs = ((self.slips(self.w, k), d) for k, d in enumerate(self.d))
        return [v[0] * d[1] - v[1] * d[0] for v, d in pairs]

    def slopes(self):
        """dG_i / dpsi_j, by rows."""
        found = []
        for i, d in enumerate(self.d):
            for j, dw in enumerate(self.dw):
                dv, v = self.slips(dw, i), self.slips(self.w, i)
                own = v[0] * d[0] + v[1] * d[1] if i == j else fmpq(0)
                found.append(dv[0] * d[1] - dv[1] * d[0] + own)
        return found


def bends_hold(Y, beside, middle, there):
    """Y times the slopes at a point of a box differ by no more from those in its middle."""
    slopes = np.array([[float(value) for value in point.slopes()] for point in (middle, there)])
    change, size = Y @ (slopes[1] - slopes[0]).reshape(beside.shape), np.max(np.abs(slopes), initial=0.0)
    return bool(np.all(np.abs(change) <= beside + 1e-14 * (size + np.max(beside, initial=0.0))))


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(6))
def test_values_and_slopes_lie_in_their_balls(seed):
    rng, regular, turning = np.random.default_rng([51, seed]), 0, 0
    for k in range(50):
        system = rational_system(rng, spread=k % 7)
        sectors = [SECTORS + n for n in (4, 7, int(rng.integers(16, 32)), int(rng.integers(1024, 2048)))]
        codes = tuple(int(rng.choice([OPEN, STICK, *sectors])) for _ in range(system.p))
        leaf = Leaf(EnclosedSpace.of_floats(system), codes)
        size = len(leaf.turning)
        radius = leaf.half * 10.0 ** -rng.uniform(0, 6, size=size)
        angle = leaf.half * rng.uniform(-0.5, 0.5, size=size)
        state = leaf.over(angle, radius)
        if state is None:
            continue
        # as they are, or with much that cancels
        point = leaf.over(angle, 0.0 * radius)
        Y = np.linalg.inv(point.J.mid) if seed % 2 and abs(np.linalg.det(point.J.mid)) > 0 else np.eye(size)
        middle = Exactly(leaf, system, angle)
        beside = leaf.bends(Y, (state, point), angle, radius)[1]
        for _ in range(3):
            there = Exactly(leaf, system, angle + 0.999 * radius * rng.choice([-1, 1, rng.uniform(-1, 1)], size=size))
            w = [fmpq(0) if row in leaf.rows else there.w[row, 0] for row in range(len(system.g))]
            assert all(there.w[row, 0] == 0 for row in leaf.rows)
            exactly = [there.y[row, 0] for row in range(len(system.g))], w, there.G(), there.slopes()
            assert all(holds(ball.mid, ball.rad, x) for ball, x in zip(state[:4], exactly, strict=True))
            assert bends_hold(Y, beside, middle, there)
        regular += 1
        turning += size
    assert regular > 20
    assert turning > 20


def test_weak_springs_widen_nothing():
    """A motion of the whole body that hardly anything resists: balls over a box are as wide as without it."""
    wide = []
    for spread in (0, 2, 4, 6):
        rng = np.random.default_rng(52)
        G = rng.normal(size=(9, 9))
        motion = rng.normal(size=9)
        S = G @ G.T / 9 + 0.1 * np.eye(9) + 10.0**spread * np.outer(motion, motion)
        # the load that the springs do not feel
        g = S @ np.array([1.0, 2.0, 1.5, 0.1, 0.2, 0.1, 0.0, 0.1, 0.2])
        system = SpaceSystem.scaled(S, g, np.full((3, 2), 0.25))
        leaf = Leaf(EnclosedSpace.of_floats(system), (STICK, SECTORS + 64, SECTORS + 70))
        state = leaf.over(np.zeros(2), leaf.half)
        wide.append([np.max(ball.rad) / np.max(np.abs(ball.mid)) for ball in state[:4]])
    assert np.allclose(wide, wide[0], rtol=0.02)


@pytest.mark.parametrize("decades", [3, 300])
def test_sums_over_all_other_angles_are_bounded(decades):
    """Also where products of two numbers underflow and those of three do not."""
    rng = np.random.default_rng(decades)
    for _ in range(100):
        k, q = (int(number) for number in rng.integers(1, 5, size=2))
        left, right, radius = (10.0 ** rng.uniform(-decades, decades, size) for size in ((k, q), (q, q), q))
        with np.errstate(over="ignore", invalid="ignore"):
            bounds = sums_of_both(left, right, radius)
        L, R, r = (np.vectorize(Fraction, otypes=[object])(part) for part in (left, right, radius))
        for i, j in np.argwhere(np.isfinite(bounds)):
            others = [n for n in range(q) if n != j]
            true = sum(((L[i, n] * R[n, j] + L[i, j] * R[j, n]) * r[n] for n in others), Fraction(0))
            assert true <= Fraction(bounds[i, j])
            assert decades > 3 or bounds[i, j] <= float(true) * (1 + 1e-9) + 1e-250
