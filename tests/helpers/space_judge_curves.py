"""Curves of solutions over alpha in boxes, for space_judge, in balls of many digits.

A box is cut along its t into slices. In each of them there is one zero for every t in a narrow set, and no other one in
the box; neighbouring slices have the same zero where they meet. Numbers in brackets are sections of
docs/proof_format.md.
"""

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from flint import arb, arb_mat, fmpq
from rational_forms import exact, need
from space_judge_boxes import Around, NaturalMap
from space_judge_data import System, Undecided, column
from space_judge_leaves import Singular, solve

#: As many times a box is halved along its t.
_HALVINGS = 9
#: Sets of the only zeros are wider by so much than what is known of them.
_ROOM = arb(1.05)


def dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), arb(0))


class GraphProblem:
    """[8] The problem over an interval: in lambda for curves, and in tau with one F0 for the tree."""

    def __init__(self, data, low, high, steps):
        self.low, self.high, self.p = low, high, data.p
        for alpha in (low, high):
            need(min(map(min, data.friction(alpha))) >= 0, "friction is negative")
        middle = data.friction((low + high) / 2)
        self.axes = [[k for k in (0, 1) if middle[k][i] > 0] for i in range(self.p)]
        self.ratio = [fmpq(1)] * self.p
        base, discs = [[fmpq(0)] * self.p, [fmpq(0)] * self.p], []
        self.F = []
        for i, axes in enumerate(self.axes):
            if not axes:
                discs.append((arb(1), arb(0)))
                self.F.append((arb(0), arb(0)))
                continue
            k = axes[0]
            F, slope = data.F0[k][i], data.F1[k][i]
            if len(axes) == 2:
                need(data.F0[1][i] * slope == F * data.F1[1][i], "coefficients are in no constant ratio")
                self.ratio[i] = middle[1][i] / middle[0][i]
            F0 = exact(float(Fraction(int(middle[k][i].p), int(middle[k][i].q))))
            for axis in axes:
                base[axis][i] = F0 * (self.ratio[i] if axis else 1) if len(axes) == 2 else F0
            discs.append((arb(F / F0), arb(slope / F0)))
            self.F.append((arb(F), arb(slope)))
        self.system = System.scaled(data, base, discs)
        self.base = base
        self.q = [arb(1)] * (2 * self.p) + [arb(x) for x in self.ratio]
        self.steps = steps
        table, q = data.S.tolist(), self.q
        S = arb_mat([[a * q[i] * q[j] for j, a in enumerate(row)] for i, row in enumerate(table)])
        g0, g1 = ([a * b for a, b in zip(q, part, strict=True)] for part in (data.g0, data.g1))
        nodes = [(i, [(1 + k) * self.p + i for k in axes]) for i, axes in enumerate(self.axes)]
        self.rho, size = (), 3 * self.p
        if data.modes is not None:
            self.rho, self.system.rigid, self.system.h1 = data.rho, data.rigid(self.system, base, data.h0), data.h1
            G, more = [[a * b for a, b in zip(row, q, strict=True)] for row in data.G.tolist()], len(data.h0)
            table = [[*row, *(-G[j][i] for j in range(more))] for i, row in enumerate(S.tolist())]
            S, g0, g1 = arb_mat([*table, *([*row, *[arb(0)] * more] for row in G)]), [*g0, *data.h0], [*g1, *data.h1]
        self.free = range(size, size + len(self.rho))
        self.natural = NaturalMap(S, g0, g1, nodes, self.F, steps, free=self.free)

    def tau_rows(self):
        """Of every component of zeta: its place in y, or None, and the factor of lambda / q over y there."""
        found = [(i, arb(1)) for i in range(self.p)]
        for k in (0, 1):
            for i, axes in enumerate(self.axes):
                if k not in axes:
                    found.append((None, arb(0)))
                    continue
                place = self.system.tau[i][axes.index(k)]
                q = self.ratio[i] if k else fmpq(1)
                found.append((place, arb(self.base[k][i] / q)))
        # the bordered system has minus the rigid displacement
        return found + [(self.system.m + j, arb(-1)) for j in range(len(self.free))]


@dataclass
class Slice:
    """A part of a box: all zeros for t from low to high lie within radii of x + (t - middle) d, one alone in wide."""

    low: arb
    high: arb
    x: list
    d: list
    around: list
    wide: list
    z: list
    sign: int

    @property
    def middle(self):
        return (self.low + self.high) / 2

    def at(self, t):
        """x in balls for a ball of t."""
        return [a + (t - self.middle) * b + arb(0, c) for a, b, c in zip(self.x, self.d, self.around, strict=True)]


@dataclass
class Place:
    """A record "w": a box of (zeta, alpha) around c + t d with t = e (x - c)."""

    natural: NaturalMap
    c: list
    d: list
    e: list
    radius: list
    half: arb
    rho: list
    slices: list = field(default_factory=list)

    def t(self, x):
        return dot(self.e, [a - b for a, b in zip(x, self.c, strict=True)])

    def start(self, t, near=None):
        """A point with this t on the line, or near another one."""
        x = near or [a + t * b for a, b in zip(self.c, self.d, strict=True)]
        more = (t - self.t(x)) / dot(self.e, self.d)
        return [(a + more * b).mid() for a, b in zip(x, self.d, strict=True)]

    def near(self, t, near=None):
        """A point near that of the curve, of which nothing is shown."""
        return self.natural.zero_near(self.start(t, near), self.e, digits=-70)

    def zero(self, t, near=None):
        try:
            x = self.natural.zero_near(self.start(t, near), self.e)
            around = self.natural.zeros_around(x, self.e)
        except Singular as error:
            raise Undecided("no zero is shown on a curve") from error
        return [a + arb(0, b) for a, b in zip(x, around[2], strict=True)]

    def off(self, x, t):
        """How far x is from c + t d."""
        return [a - b - t * d for a, b, d in zip(x, self.c, self.d, strict=True)]

    def holds(self, x):
        """Whether a ball lies in the box."""
        t = self.t(x)
        return abs(t) <= self.half and all(abs(a) <= r for a, r in zip(self.off(x, t), self.radius, strict=True))

    # -- points --------------------------------------------------------------------------------------------------------

    @cached_property
    def point(self):
        """The one solution of a point, in narrow balls."""
        try:
            self.natural.at_most_one(self.c, self.radius, self.e)
        except Singular as error:
            raise Undecided("a point is not shown to hold one solution") from error
        x = self.zero(arb(0))
        need(
            all(abs(a) < r for a, r in zip(self.off(x, arb(0)), self.radius, strict=True)), "a point holds no solution"
        )
        return x

    @cached_property
    def z(self):
        return [*self.natural.argument(self.natural.forces(self.point), self.point), self.point[-1]]

    @cached_property
    def statuses(self):
        return self.natural.statuses(self.z[:-1], self.z[-1])

    @cached_property
    def direction(self):
        """The slope of the curve at a point whose statuses are strict."""
        need(None not in self.statuses, "the statuses at a point are not strict")
        rows, U, *_ = self.natural.equations(Around(self.z), self.e)
        need(not U, "the statuses at a point are not strict")
        right = [arb(0)] * (len(rows) - 1) + [arb(1)]
        try:
            return solve(arb_mat(rows), column(right)).entries()
        except Singular as error:
            raise Undecided("a point has no direction") from error

    # -- boxes ---------------------------------------------------------------------------------------------------------

    def cut(self):
        """Show that there is one curve, all along t."""
        self.natural = self.natural.with_steps(self.rho)
        ends = [-self.half, self.half]
        known = [self.zero(t) for t in ends]
        self.slices = list(self._slices(*ends, *known, 0))
        for one, two in pairwise(self.slices):
            need(one.sign == two.sign, "determinants of two signs along a box")

    def _slices(self, low, high, first, last, depth):
        middle, half = ((low + high) / 2).mid(), ((high - low) / 2).mid()
        try:
            x = [a.mid() for a in self.zero(middle, [(a + b) / 2 for a, b in zip(first, last, strict=True)])]
            d = [((b - a) / (2 * half)).mid() for a, b in zip(first, last, strict=True)]
            first_try = max(abs(a - (b + c) / 2).upper() for a, b, c in zip(x, first, last, strict=True))
            set_, z, around, sign = self.natural.zeros_around(x, self.e, d, half, first_try + arb(2) ** -100)
            off = self.off(x, middle)
            drift = [half * abs(a - b) for a, b in zip(d, self.d, strict=True)]
            wide = [
                max(r, (_ROOM * (abs(a) + b + c)).upper())
                for r, a, b, c in zip(self.radius, off, drift, set_, strict=True)
            ]
            line = [a + middle * b for a, b in zip(self.c, self.d, strict=True)]
            # zeros at the ends are those of the slice beside
            held = all(
                abs(a - b - s * half * c) <= r
                for end, s in ((first, -1), (last, 1))
                for a, b, c, r in zip(end, x, d, set_, strict=True)
            )
            if held and self.natural.at_most_one([a.mid() for a in line], wide, self.e, self.d, half) == sign:
                yield Slice(low, high, x, d, around, wide, z, sign)
                return
        except Singular:
            pass
        if depth >= _HALVINGS:
            raise Undecided("a box is not shown to hold one curve")
        between = self.zero(middle)
        yield from self._slices(low, middle, first, between, depth + 1)
        yield from self._slices(middle, high, between, last, depth + 1)

    def has(self, x):
        """Whether everything in a ball of x is where the curve has the only solution."""
        t = self.t(x)
        if not abs(t) <= self.half:
            return False
        met = [s for s in self.slices if not (t < s.low or t > s.high)]
        off = [abs(a) for a in self.off(x, t)]
        return all(all(a <= r for a, r in zip(off, s.wide, strict=True)) for s in met)

    def may_pass(self, x, low=None, high=None):
        """Whether a solution may be on the curve of the box, for t from low to high."""
        t = self.t(x)
        if abs(t) > self.half or (low is not None and t < low) or (high is not None and t > high):
            return False
        return any(
            all(a.overlaps(b) for a, b in zip(s.at(t), x, strict=True))
            for s in self.slices
            if not (t < s.low or t > s.high)
        )

    def alphas(self):
        """A ball of alpha for each part of the curve."""
        return [s.at(s.low.union(s.high))[-1] for s in self.slices]

    def has_all(self, x, slope, moves, step, moved):
        """The same for all x + step slope + moves moved."""

        def bounds(row, shift):
            return (
                dot(row, x)
                - shift
                + step * dot(row, slope)
                + sum((dot(row, move) * m for move, m in zip(moves, moved, strict=True)), arb(0))
            )

        t = bounds(self.e, dot(self.e, self.c))
        if not abs(t) <= self.half:
            return False
        met = [s for s in self.slices if not (t < s.low or t > s.high)]
        least = [min((s.wide[k] for s in met), key=float) for k in range(len(self.c))]
        for k, r in enumerate(least):
            row = [-self.d[k] * value for value in self.e]
            row[k] += 1
            if not abs(bounds(row, dot(row, self.c))) <= r:
                return False
        return True

    def along(self, low, high, holds, depth=0, deepest=_HALVINGS):
        """Whether something holds for all of the curve for t from low to high, in parts as short as it takes."""
        for s in self.slices if depth == 0 else ():
            begin, end = low.max(s.low), high.min(s.high)
            if begin < end and not self.along(begin, end, holds, 1, deepest):
                return False
        if depth == 0:
            return True
        middle = ((low + high) / 2).mid()
        try:
            found = holds(*self.set_between(low.mid(), high.mid()))
        except Singular:
            found = None
        if found:
            return True
        if found is False or depth > deepest:
            return False
        return all(self.along(*part, holds, depth + 1, deepest) for part in ((low, middle), (middle, high)))

    def set_between(self, low, high, *ends):
        """x, d, half, radii and (z, alpha) of a set with all of the curve for t from low to high."""
        middle, half = ((low + high) / 2).mid(), ((high - low) / 2).upper()
        ends = ends or [self.near(t) for t in (low, high)]
        x = self.near(middle, [((a + b) / 2).mid() for a, b in zip(*ends, strict=True)])
        d = [((b - a) / (2 * half)).mid() for a, b in zip(*ends, strict=True)]
        first = max(abs(a - (b + c) / 2).upper() for a, b, c in zip(x, *ends, strict=True))
        _, z, around, _ = self.natural.zeros_around(x, self.e, d, half, first + arb(2) ** -100)
        return x, d, half, around, z


def place_of(problem, record):
    """[8.1] A record "w"."""
    need(isinstance(record, list) and record[0] == "w" and len(record) == 7, "no box")
    size = 3 * problem.p + len(problem.free) + 1

    def numbers(values, count):
        need(isinstance(values, list) and len(values) == count, f"expected {count} numbers")
        return [arb(exact(value)) for value in values]

    c, d, e, radius = (numbers(part, size) for part in record[1:5])
    rho = numbers(record[5], size - 1)
    problem.natural.check_steps(rho)
    need(min(radius) >= 0, "a radius is negative")
    (half,) = numbers([record[6]], 1)
    need(half >= 0, "half is negative")
    return Place(problem.natural, c, d, e, radius, half, rho)
