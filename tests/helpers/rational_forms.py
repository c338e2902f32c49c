"""Numbers, condensed data and rows of docs/proof_format.md in rational arithmetic, for rational_checker.

Nothing of enumsol is imported; of a ContactProblem the arrays are read. Numbers in brackets are the document's
sections.
"""

import base64
import hashlib
import re
import struct
from fractions import Fraction
from functools import lru_cache
from itertools import combinations
from math import comb, gcd, isfinite

import numpy as np
from flint import fmpq, fmpq_mat

LARGEST_FRACTION = 1 << 12
LARGEST_HULL = 50_000


class Refused(Exception):  # noqa: N818
    """The proof does not show what it claims."""


def need(holds, reason):
    if not holds:
        raise Refused(reason)


# -- [2] numbers -------------------------------------------------------------------------------------------------------


def integer(value):
    need(type(value) is int, f"{value!r} is no integer")
    return value


def exact(value):
    """A float as an fmpq."""
    need(type(value) in (int, float) and isfinite(value), f"{value!r} is no float")
    return fmpq(*float(value).as_integer_ratio())


def decimal_fraction(text):
    need(len(text) <= LARGEST_FRACTION, "a fraction has too many digits")
    need(re.fullmatch(r"-?[0-9]+(/[0-9]*[1-9][0-9]*)?", text, re.ASCII), "no fraction")
    return fmpq(*Fraction(text).as_integer_ratio())


def hexadecimal_fraction(text):
    need(len(text) <= LARGEST_FRACTION, "a fraction has too many digits")
    need(re.fullmatch(r"(0|-?[1-9a-f][0-9a-f]*)/[1-9a-f][0-9a-f]*", text, re.ASCII), "no hexadecimal fraction")
    above, below = (int(part, 16) for part in text.split("/"))
    need(gcd(above, below) == 1, "a hexadecimal fraction is not in lowest terms")
    return fmpq(above, below)


def octets(text):
    found = base64.b64decode(text, validate=True)
    need(base64.b64encode(found).decode() == text, "a text in base64 has bits that stand for nothing")
    return found


def multipliers(rows, values):
    rows, values = (octets(text) for text in (rows, values))
    need(2 * len(rows) == len(values), "not as many multipliers as rows")
    count = len(rows) // 4
    numbers = struct.unpack(f"<{count}d", values)
    return list(zip(struct.unpack(f"<{count}I", rows), map(exact, numbers), strict=True))


# -- [3] the problem ---------------------------------------------------------------------------------------------------


@lru_cache(maxsize=16)
def fingerprint(problem):
    """[3.4]"""
    free, ball = problem.rigid_modes is not None, problem.offset_radius is not None
    digest = hashlib.sha256(
        b"enumsol problem 1" + (b", from a ball" if ball else b"") + (b", held by nothing" if free else b"")
    )

    def add(values, kind):
        digest.update((np.asarray(values).astype(kind) + 0).tobytes() + b"|")

    add([problem.n, problem.p], "<i8")
    for matrix in (problem.A, problem.Bn, problem.Bt):
        dense = matrix.toarray()
        column, row = np.nonzero(dense.T)
        add(np.searchsorted(column, np.arange(problem.n + 1)), "<i8")
        add(row, "<i8")
        add(dense[row, column], "<f8")
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    for vector in (problem.f, problem.gap, *problem.affine_friction, slope, problem.slip_offset):
        add(vector, "<f8")
    if ball:
        add(problem.offset_radius, "<f8")
    if free:
        add(problem.rigid_modes.ravel(), "<f8")
        add([problem.rigid_reach], "<f8")
    return digest.hexdigest()


def matrix_of(array):
    return fmpq_mat([[exact(value) for value in row] for row in array.tolist()])


def column_of(values):
    return fmpq_mat([[value] for value in values])


class Data:
    """[3.1] S, g0, g1, F0 and F1 in rationals."""

    #: [3.2] Bounds of q, of a body that nothing holds.
    reach = ()

    def __init__(self, problem):
        self.p = p = problem.p
        A = self.stiffness(problem)
        B = matrix_of(np.vstack([problem.Bn.toarray(), problem.Bt.toarray()]))
        self.S = B * A.solve(B.transpose())
        for size in range(1, 2 * p + 1):
            corner = fmpq_mat([row[:size] for row in self.S.tolist()[:size]])
            need(corner.det() > 0, "S is not positive definite")
        slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        offset = [*problem.gap.tolist(), *problem.slip_offset.tolist()]
        free = (B * A.solve(matrix_of(problem.f[:, None]))).entries()
        self.g0 = [value - exact(shift) for value, shift in zip(free, offset, strict=True)]
        self.g1 = (B * A.solve(matrix_of(slope[:, None]))).entries()
        self.F0, self.F1 = ([exact(value) for value in part.tolist()] for part in problem.affine_friction)

    def stiffness(self, problem):
        """A."""
        return matrix_of(problem.A.toarray())

    def forms(self, alpha):
        """Rows of the problem at one alpha."""
        return Forms(self.S, self.load(alpha), self.friction(alpha))

    def load(self, alpha):
        return [a + alpha * b for a, b in zip(self.g0, self.g1, strict=True)]

    def friction(self, alpha):
        return [a + alpha * b for a, b in zip(self.F0, self.F1, strict=True)]

    def origin(self):
        """[7.1] The one alpha at which g vanishes, or None."""
        moving = [k for k, slope in enumerate(self.g1) if slope != 0]
        if not moving:
            return None
        alpha = -self.g0[moving[0]] / self.g1[moving[0]]
        return alpha if all(value == 0 for value in self.load(alpha)) else None


# -- [4] statuses and rows ---------------------------------------------------------------------------------------------


class Forms:
    """Forms a'lambda + a0 as lists of 2p + 1 numbers, for one S, one g and one F (with F_lo for kinds 7 and 8)."""

    def __init__(self, S, g, F, F_lo=None):
        self.S, self.g, self.F, self.F_lo = S, g, F, F if F_lo is None else F_lo
        self.rows, self.p = S.tolist(), len(F)

    def force(self, normal, tangential, i):
        form = [fmpq(0)] * (len(self.rows) + 1)
        form[i], form[self.p + i] = fmpq(normal), fmpq(tangential)
        return form

    def move(self, sign, k):
        """sign * w_k"""
        return [-sign * value for value in self.rows[k]] + [sign * self.g[k]]

    def row(self, kind, i):
        """[4.4], [7.2]"""
        p, F, F_lo = self.p, self.F[i], self.F_lo[i]
        return [
            lambda: self.force(1, 0, i),
            lambda: self.force(0, 1, i),
            lambda: self.force(F, -1, i),
            lambda: self.force(F, 1, i),
            lambda: self.move(-1, i),
            lambda: self.move(1, p + i),
            lambda: self.move(-1, p + i),
            lambda: self.force(-F_lo, 1, i),
            lambda: self.force(-F_lo, -1, i),
        ][kind]()

    def equations(self, codes):
        """[4.1], [4.7] The rows N lambda - c, those of w with the sign of S lambda - g."""
        normal, tangential = [], []
        for i, code in enumerate(codes):
            normal.append(self.force(1, 0, i) if code == 0 else self.move(-1, i))
            slip = {2: -self.F[i], 3: self.F[i]}.get(code, fmpq(0))
            tangential.append(self.move(-1, self.p + i) if code == 1 else self.force(slip, 1, i))
        return normal + tangential

    @staticmethod
    def bounds():
        """None of a body that is held."""
        return []

    def conditions(self, codes):
        kinds = {0: (4,), 1: (0, 2, 3), 2: (0, 5), 3: (0, 6), 4: (0,)}
        return [self.row(kind, i) for i, code in enumerate(codes) for kind in kinds[code]]

    def excludes(self, terms):
        """[6.1] for (number of a row, multiplier in the problem's units)."""
        v, constant = list(self.g), fmpq(0)
        for number, u in terms:
            *a, a0 = self.row(*divmod(number, self.p))
            v = [x + u * y for x, y in zip(v, a, strict=True)]
            constant += u * a0
        column = column_of(v)
        return -constant - (column.transpose() * self.S.solve(column))[0, 0] / 4 > 0

    def own_form(self, multipliers):
        """[6.2], [7.2] lambda'H lambda - h'lambda of multipliers mu, nu, alpha, beta."""
        p, mixed = self.p, []
        for i, (mu, nu, alpha, beta) in enumerate(zip(*multipliers, strict=True)):
            mixed.append((i, mu, self.F_lo[i] * (beta - alpha)))
            mixed.append((p + i, nu, alpha + beta))
        table, h = [[fmpq(0)] * (2 * p) for _ in range(2 * p)], [fmpq(0)] * (2 * p)
        for k, normal, tangential in mixed:
            i = k % p
            row = [normal * a + tangential * b for a, b in zip(self.rows[i], self.rows[p + i], strict=True)]
            h[k] = normal * self.g[i] + tangential * self.g[p + i]
            for j, value in enumerate(row):
                table[k][j] += value / 2
                table[j][k] += value / 2
        return fmpq_mat(table), h

    def excludes_by(self, form, equations, terms):
        """[6.2] Whether a form less multiples of rows is positive wherever some equations hold."""
        H, h = form
        affine = _affine(equations) if equations else ([fmpq(0)] * (2 * self.p), fmpq_mat(_unit(2 * self.p)).tolist())
        if affine is None:
            return True
        origin, kernel = affine
        slope, constant = [-x for x in h], fmpq(0)
        for number, u in terms:
            *a, a0 = self.row(*divmod(number, self.p))
            slope = [x - u * y for x, y in zip(slope, a, strict=True)]
            constant -= u * a0
        moved = (H * column_of(origin)).entries()
        constant += _value([*moved, 0], origin) + _value([*slope, 0], origin)
        if not kernel:
            return constant > 0
        N = fmpq_mat(kernel).transpose()
        bent = N.transpose() * H * N
        for size in range(1, len(kernel) + 1):
            if fmpq_mat([row[:size] for row in bent.tolist()[:size]]).det() <= 0:
                return False
        left = N.transpose() * column_of([2 * x + y for x, y in zip(moved, slope, strict=True)])
        return constant - (left.transpose() * bent.solve(left))[0, 0] / 4 > 0

    def hull(self, *selections):
        """[5.3, D] Vertices of the common solutions of some selections."""
        equations = [form for codes in selections for form in self.equations(codes)]
        return self.vertices(equations, [form for codes in selections for form in self.conditions(codes)])

    @staticmethod
    def vertices(equations, given):
        """Vertices of a bounded set {equations = 0, given >= 0}."""
        affine = _affine(equations)
        if affine is None:
            return []
        origin, kernel = affine
        slopes = [[_value(form, k, 0) for k in kernel] for form in given]
        values = [_value(form, origin) for form in given]
        need(comb(len(given), len(kernel)) <= LARGEST_HULL, "too many candidate vertices")
        found = set()
        for chosen in combinations(range(len(given)), len(kernel)):
            t, point = [], origin
            if chosen:
                square = fmpq_mat([slopes[k] for k in chosen])
                if square.det() == 0:
                    continue
                t = square.solve(column_of([-values[k] for k in chosen])).entries()
            steps = [sum((a * b for a, b in zip(slope, t, strict=True)), fmpq(0)) for slope in slopes]
            if all(value + step >= 0 for value, step in zip(values, steps, strict=True)):
                for a, vector in zip(t, kernel, strict=True):
                    point = [x + a * y for x, y in zip(point, vector, strict=True)]
                found.add(as_point(point))
        return sorted(found)


def _unit(size):
    return [[fmpq(int(i == j)) for j in range(size)] for i in range(size)]


def _value(form, point, constant=1):
    return sum((a * x for a, x in zip(form, point, strict=False)), constant * form[-1])


def _affine(equations):
    """A solution of forms = 0 and a basis of the differences of solutions, or None when there is none."""
    size = len(equations[0]) - 1
    table, rank = fmpq_mat([[*form[:-1], -form[-1]] for form in equations]).rref()
    rows = table.tolist()[:rank]
    pivots = [next(j for j, x in enumerate(row) if x != 0) for row in rows]
    if size in pivots:
        return None
    origin, kernel = [fmpq(0)] * size, []
    for row, pivot in zip(rows, pivots, strict=True):
        origin[pivot] = row[size]
    for free in sorted(set(range(size)) - set(pivots)):
        vector = [fmpq(0)] * size
        vector[free] = fmpq(1)
        for row, pivot in zip(rows, pivots, strict=True):
            vector[pivot] = -row[free]
        kernel.append(vector)
    return origin, kernel


def as_point(values):
    """As Fractions, which can be sorted."""
    return tuple(Fraction(int(value.p), int(value.q)) for value in values)


def dimension_of(points):
    rows = [[fmpq(*(x - y).as_integer_ratio()) for x, y in zip(point, points[0], strict=True)] for point in points[1:]]
    return fmpq_mat(rows).rank() if rows else 0
