"""Data, sectors, rows and exclusions of proofs in 3D (docs/proof_format.md), in balls of many digits, for space_judge.

Nothing of enumsol is imported; of a ContactProblem3D the arrays are read. Numbers in brackets are the document's
sections.
"""

import hashlib
import struct
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import log2

import numpy as np
from flint import arb, arb_mat, fmpq
from rational_forms import Refused, exact, need, octets

DEEPEST = 29
BEYOND = 1 << 31


class Undecided(Refused):
    """The judge cannot tell: not with these digits, or not with so much work."""


def positive(value, reason):
    """Whether a ball is above zero; one with zero in it is not decided."""
    if value > 0:
        return True
    if value <= 0:
        return False
    raise Undecided(f"{reason}: {value.str(5)}")


def column(values):
    return arb_mat([[value] for value in values])


def is_definite(matrix):
    """Whether a symmetric matrix of balls is positive definite, by elimination."""
    rows = matrix.tolist()
    for k, row in enumerate(rows):
        if not row[k] > 0:
            return False
        for below in rows[k + 1 :]:
            share = below[k] / row[k]
            for j in range(k + 1, len(rows)):
                below[j] -= share * row[j]
    return True


def length_of(values):
    square = sum((value * value for value in values), arb(0))
    return square.sqrt() if square > 0 else arb(0).union(square.upper().sqrt())


# -- [3.1] the problem -------------------------------------------------------------------------------------------------


def fingerprint(problem):
    """[3.4]"""
    free, ball = problem.rigid_modes is not None, problem.offset_radius is not None
    digest = hashlib.sha256(
        b"enumsol problem in 3D, 1" + (b", from a ball" if ball else b"") + (b", held by nothing" if free else b"")
    )

    def add(values, kind):
        digest.update((np.asarray(values).astype(kind) + 0).tobytes() + b"|")

    add([problem.n, problem.p], "<i8")
    for matrix in (problem.A, problem.Bn, problem.Bt1, problem.Bt2):
        dense = matrix.toarray()
        place, row = np.nonzero(dense.T)
        add(np.searchsorted(place, np.arange(problem.n + 1)), "<i8")
        add(row, "<i8")
        add(dense[row, place], "<f8")
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    for vector in (problem.f, problem.gap, *problem.friction, *problem.friction_slope, slope):
        add(np.asarray(vector) + 0.0, "<f8")
    add(np.ravel(problem.slip_offset) + 0.0, "<f8")
    if ball:
        add(np.ravel(problem.offset_radius) + 0.0, "<f8")
    if free:
        add(np.ravel(problem.rigid_modes), "<f8")
        add([problem.rigid_reach], "<f8")
    return digest.hexdigest()


def balls(array):
    return arb_mat([[arb(value) for value in row] for row in np.atleast_2d(array).tolist()])


class SpaceData:
    """[3.1] S, g0, g1 in the order of all normals, all of the first tangent, all of the second; F exactly."""

    def __init__(self, problem):
        self.p = problem.p
        A, B = problem.A.toarray(), np.vstack([M.toarray() for M in (problem.Bn, problem.Bt1, problem.Bt2)])
        slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        loads = [problem.f, slope]
        self.modes = None
        if problem.rigid_modes is not None:
            self.modes = balls(problem.rigid_modes)
            held = _independent(problem.rigid_modes)
            stiffness = max(1.0, float(np.max(np.abs(A))))
            A = A + np.diag(np.where(np.isin(np.arange(problem.n), held), stiffness, 0.0))
            self.bounds_of(problem, held)
        X = balls(A).solve(balls(B).transpose())
        self.S = balls(B) * X
        self.offset = [arb(x) for x in [*problem.gap.tolist(), *np.asarray(problem.slip_offset).T.ravel().tolist()]]
        if problem.offset_radius is not None:
            # [9] from a ball
            radii = [0.0] * self.p + np.asarray(problem.offset_radius).T.ravel().tolist()
            self.offset = [a + arb(0, b) for a, b in zip(self.offset, radii, strict=True)]
        self.free0, self.g1 = ((X.transpose() * balls(load).transpose()).entries() for load in loads)
        self.g0 = [value - shift for value, shift in zip(self.free0, self.offset, strict=True)]
        if self.modes is not None:
            self.G = self.modes.transpose() * balls(B).transpose()
            self.h0, self.h1 = ((self.modes.transpose() * balls(load).transpose()).entries() for load in loads)
        self.F0, self.F1 = (
            [[exact(x) for x in np.asarray(part).tolist()] for part in parts]
            for parts in (problem.friction, problem.friction_slope)
        )

    def bounds_of(self, problem, held):
        """[3.2] rho."""
        inverse = balls(problem.rigid_modes[held]).inv().tolist()
        self.rho = [arb(problem.rigid_reach) * sum((abs(x) for x in row), arb(0)) for row in inverse]

    def friction(self, alpha):
        """F of both tangents, exactly."""
        return [
            [a + alpha * b for a, b in zip(F, slope, strict=True)] for F, slope in zip(self.F0, self.F1, strict=True)
        ]

    def at(self, alpha):
        """[3.1] The problem at one alpha."""
        F = self.friction(alpha)
        need(min(map(min, F)) >= 0, "friction is negative")
        system = System.scaled(self, F, [(arb(1), arb(0))] * self.p)
        fixed = [a + arb(alpha) * b for a, b in zip(system.g0, system.g1, strict=True)]
        rigid = self.rigid(system, F, self.pushed(arb(alpha))) if self.modes is not None else ()
        return System(system.S, fixed, [arb(0)] * system.m, system.discs, system.tau, system.axes, rigid)

    def pushed(self, alpha):
        """[3.2] h."""
        return [a + alpha * b for a, b in zip(self.h0, self.h1, strict=True)]

    def rigid(self, system, F, h):
        """[3.2] G~, h and rho."""
        F = [fmpq(1)] * self.p, *F
        G = [[value * arb(F[k // self.p][k % self.p]) for k, value in enumerate(row)] for row in self.G.tolist()]
        places = [*range(self.p), *((1 + k) * self.p + i for i in range(self.p) for k in system.axes[i])]
        return arb_mat([[row[k] for k in places] for row in G]), h, self.rho

    def pulls(self, system, z, scale):
        """[3.2] z of a record in the problem's units, and z'G~."""
        for j, row in enumerate(self.G.tolist()):
            largest = max(abs(float(x)) / 2.0 ** scale[k % self.p] for k, x in enumerate(row))
            z[j] *= arb(2) ** (-round(log2(largest)) if largest else 0)
        return z, (arb_mat([z]) * system.rigid[0]).entries()


def _independent(N):
    """[3.2] Rows of N where they are independent: elimination with complete pivoting."""
    left, rows = N / np.max(np.abs(N), axis=0), []
    for _ in range(N.shape[1]):
        i, j = np.unravel_index(np.argmax(np.abs(left)), left.shape)
        rows.append(int(i))
        left = left - np.outer(left[:, j], left[i]) / left[i, j]
    return rows


@dataclass
class System:
    """w = g0 + alpha g1 - S y with discs abs(tau) <= (r0 + alpha r1) lambda_n; places and axes of the tau of nodes."""

    S: arb_mat
    g0: list
    g1: list
    discs: list
    tau: list
    axes: list
    #: [3.2] G~, h and rho of a body that nothing holds, and how h changes with alpha
    rigid: tuple = ()
    h1: tuple = ()

    @classmethod
    def scaled(cls, data, F, discs):
        """With lambda_t = F tau, of the tangents where F > 0."""
        p, rows, weights, tau = data.p, list(range(data.p)), [fmpq(1)] * data.p, []
        axes = [[k for k in (0, 1) if F[k][i] > 0] for i in range(p)]
        for i, mine in enumerate(axes):
            tau.append(list(range(len(rows), len(rows) + len(mine))))
            rows += [(1 + k) * p + i for k in mine]
            weights += [F[k][i] for k in mine]
        D, table = [arb(value) for value in weights], data.S.tolist()
        S = arb_mat([[D[a] * table[i][j] * D[b] for b, j in enumerate(rows)] for a, i in enumerate(rows)])
        S = (S + S.transpose()) / arb(2)
        need(is_definite(S), "S is not positive definite")
        return cls(S, *([D[a] * g[i] for a, i in enumerate(rows)] for g in (data.g0, data.g1)), discs, tau, axes)

    @cached_property
    def bordered(self):
        """With minus the rigid displacement among the unknowns and the equilibrium among the equations."""
        if not self.rigid:
            return self
        G, h, _ = self.rigid
        m, r = self.m, len(h)
        S = arb_mat(m + r, m + r)
        for i in range(m):
            for j in range(m):
                S[i, j] = self.S[i, j]
            for j in range(r):
                S[i, m + j] = S[m + j, i] = G[j, i]
        more = self.h1 or [arb(0)] * r
        return System(S, [*self.g0, *h], [*self.g1, *more], self.discs, self.tau, self.axes, self.rigid, self.h1)

    @property
    def m(self):
        return len(self.g0)

    @cached_property
    def inverse(self):
        return self.S.inv()

    @cached_property
    def node_of(self):
        """The node of every component of y."""
        found = list(range(len(self.tau)))
        for i, places in enumerate(self.tau):
            found += [i] * len(places)
        return found

    def load(self, alpha):
        return [a + alpha * b for a, b in zip(self.g0, self.g1, strict=True)]

    def radius(self, i, alpha):
        return self.discs[i][0] + alpha * self.discs[i][1]


# -- [4.2] sectors -----------------------------------------------------------------------------------------------------


def is_sector(number):
    first, more = number % BEYOND, number // BEYOND
    if number < 4 or first < 4:
        return False
    quarter = first.bit_length() - 3
    return (first + more) >> quarter == first >> quarter


def level(number):
    return (number % BEYOND).bit_length() - 1


def arc_of(number):
    """Where a sector begins and ends, as shares of the circle."""
    first, more = number % BEYOND, number // BEYOND
    count = 1 << level(number)
    return fmpq(first - count, count), fmpq(first - count + more + 1, count)


def corner(number):
    """d(number), a rational point of the circle."""
    first = number % BEYOND
    quarter = 1 << (level(number) - 2)
    turns, rest = divmod(first - 4 * quarter, quarter)
    s = fmpq(rest, quarter)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    for _ in range(turns):
        x, y = -y, x
    return (63 * x - 16 * y) / 65, (16 * x + 63 * y) / 65


def following(number):
    """number+: the sector that begins where this one ends."""
    first, more, count = number % BEYOND, number // BEYOND, 1 << level(number)
    after = first + more + 1
    return count if after == 2 * count else after


def holds(outer, inner):
    (a, b), (c, d) = arc_of(outer), arc_of(inner)
    return a <= c and d <= b


# -- [4.3] codes -------------------------------------------------------------------------------------------------------


def sector_of(code):
    return code - 8 if code >= 12 else None


def is_split(code, children, tangents):
    """[5.2] Whether the codes are those into which one may be split at a node with so many tau."""
    if code == 6:
        return sorted(children) == ([0, 5] if tangents else [0, 4])
    if code == 5:
        return sorted(children) == ([1, 2, 3] if tangents == 1 else [1, 12, 13, 14, 15])
    if code < 12 or len(children) < 2 or min(children) < 12:
        return False
    parts = [child - 8 for child in children]
    if not all(part < 1 << 60 and is_sector(part) and level(part) <= DEEPEST for part in parts):
        return False
    arcs = sorted((arc_of(part) for part in parts), key=lambda arc: arc[0])
    begin, end = arc_of(code - 8)
    return arcs[0][0] == begin and arcs[-1][1] == end and all(a[1] == b[0] for a, b in pairwise(arcs))


def is_complete(codes):
    return not {5, 6} & set(codes)


def is_code(code, tangents):
    """Whether a node with so many tau can have a code."""
    if type(code) is not int:
        return False
    if code in (0, 6):
        return True
    if code == 4:
        return tangents == 0
    if code in (1, 5):
        return tangents > 0
    if code in (2, 3):
        return tangents == 1
    return tangents == 2 and 12 <= code < 8 + (1 << 60) and is_sector(code - 8) and level(code - 8) <= DEEPEST


# -- [4.5] rows --------------------------------------------------------------------------------------------------------

#: Kinds 0 to 3 by code: E any multiplier, + a nonnegative one, . none.
ALLOWED = {0: "+EE.", 1: "E+.E", 2: "E+..", 3: "E+..", 4: "E+..", 5: "E+..", 6: "++..", 8: "E+.."}
FORCES = (1, 2, 4, 6, 7)


def most(code, pull):
    """[6.3] The largest value of pull . tau for the tau of a node with lambda_n = 1."""
    if not pull or code == 4:
        return arb(0)
    if code in (2, 3):
        return pull[0] if code == 2 else -pull[0]
    number = sector_of(code)
    if number:
        ends = [[arb(x) for x in d] for d in (corner(number), corner(following(number)))]
        (a, b), (c, d) = ends
        x, y = pull
        if not (a * y - b * x > 0 and x * d - y * c > 0):
            found = [x * u + y * v for u, v in ends]
            beside = a * y - b * x < 0 or x * d - y * c < 0
            return found[0].max(found[1]) if beside else found[0].max(found[1]).max(length_of(pull))
    return length_of(pull)


def sign_of(code, kind, number):
    """What multiplier a row may have where a node has a code."""
    slip = sector_of(code)
    if kind < 4:
        return ALLOWED[8 if slip else code][kind]
    if kind == 4:
        return "E" if (code, number) in ((2, 1), (3, -1)) else "+"
    if kind == 5:
        return "+" if (code, number) in ((2, 1), (3, -1)) else "."
    if kind == 6:
        return "+"
    return "+" if slip and holds(number, slip) else "."


def row_of(tau, axes, kind, number):
    """Places and coefficients of a row: of y, of y where it is multiplied by the disc's radius, and of w.

    tau are the places of the node's tau, axes their axes; the place of lambda_n and w_n is given as None.
    """
    if kind in (0, 1):
        need(number == 0, "a row has no such number")
        return ([], [], [(None, -1)]) if kind == 0 else ([(None, 1)], [], [])
    if kind in (2, 3):
        need(number in axes, "a node has no such tau")
        place = [(tau[axes.index(number)], 1)]
        return (place, [], []) if kind == 2 else ([], [], place)
    if kind in (4, 5):
        need(len(tau) == 1 and number in (1, -1), "a row has no such number")
        return ([(tau[0], -number)], [(None, 1)], []) if kind == 4 else ([], [], [(tau[0], number)])
    need(kind in (6, 7, 8, 9) and len(tau) == 2, "there is no such row")
    need(number < BEYOND if kind == 6 else number < 1 << 60, "a row has no such number")
    need(is_sector(number) and level(number) <= 30, "a row has no such number")
    (dx, dy), (ex, ey) = corner(number), corner(following(number))
    x, y = tau
    if kind == 6:
        return [(x, -dx), (y, -dy)], [(None, 1)], []
    if kind == 7:
        return [(x, dx + ex), (y, dy + ey)], [(None, -(1 + dx * ex + dy * ey))], []
    return [], [], [(x, -dy), (y, dx)] if kind == 8 else [(x, ey), (y, -ex)]


def numbers_of(text, count):
    data = octets(text)
    need(len(data) == 8 * count, "not as many multipliers as rows")
    return [exact(value) for value in struct.unpack(f"<{count}d", data)]


def rows_of(text):
    """[2] Rows in 3D: kind, node and number."""
    data = octets(text)
    need(len(data) % 16 == 0, "no rows")
    return list(struct.iter_unpack("<IIq", data))


class Terms:
    """The rows of an exclusion and its multipliers, tested and in the problem's units."""

    def __init__(self, system, scale, codes, rows, text, ends=1):
        self.system, self.rows = system, []
        self.values = [[] for _ in range(ends)]
        rows = rows_of(rows)
        numbers = numbers_of(text, ends * len(rows))
        lists = [numbers[k * len(rows) : (k + 1) * len(rows)] for k in range(ends)]
        for row, *values in zip(rows, *lists, strict=True):
            kind, node, number = row
            need(0 <= kind <= 9 and 0 <= node < len(codes), "there is no such row")
            found = row_of(system.tau[node], system.axes[node], kind, number)
            sign = sign_of(codes[node], kind, number)
            need(sign == "E" or (sign == "+" and min(values) >= 0), "a multiplier is not allowed")
            self.rows.append((node, *found))
            for kept, value in zip(self.values, values, strict=True):
                kept.append(value * fmpq(2) ** scale[kind not in FORCES][node])

    def sums(self, end=0, values=None):
        """Of the multiplied rows: coefficients of y, those times the radius of the discs, and of w."""
        found = [[arb(0) if values else fmpq(0)] * self.system.m for _ in range(3)]
        for (node, *parts), u in zip(self.rows, values or self.values[end], strict=True):
            for total, part in zip(found, parts, strict=True):
                for place, factor in part:
                    total[node if place is None else place] += u * factor
        return [[arb(value) for value in total] for total in found]


def margin(terms, H=None, h=None):
    """[6.1], [6.2] The left-hand side of (6.1), perhaps by a form, at one alpha, and a number of its size."""
    system = terms.system
    inverse, load = (system.inverse, system.g0) if H is None else (H.inv(), h)
    plain, radial, moves = terms.sums()
    w = column(moves)
    v = column(load) + column(plain) + column(radial) - system.S * w
    linear = (column(system.g0).transpose() * w)[0, 0]
    square = (v.transpose() * inverse * v)[0, 0] / 4
    return -linear - square, abs(linear) + square


def floating_margin(terms):
    """[6.1] What (6.1) has on the left less what it has on the right, and a number of its size."""
    system = terms.system
    G, h, rho = system.rigid
    best = None
    for values in (terms.values[0], in_balance(terms, 0, h)):
        if values is None:
            continue
        plain, radial, moves = terms.sums(values=values)
        w = column(moves)
        v = column(system.g0) + column(plain) + column(radial) - system.S * w
        image = system.inverse * G.transpose()
        right = 2 * column(h) - image.transpose() * v
        z = column([value.mid() for value in (G * image).solve(right).entries()])
        v += G.transpose() * z
        linear = (column(h).transpose() * z - column(system.g0).transpose() * w)[0, 0]
        square = (v.transpose() * system.inverse * v)[0, 0] / 4
        off = [a + b for a, b in zip((G * w).entries(), h, strict=True)]
        off = (
            arb(0)
            if values is not terms.values[0]
            else sum((a * abs(b) for a, b in zip(rho, off, strict=True)), arb(0))
        )
        found = linear - square - off, abs(linear) + square + off
        if best is None or not best[0] > 0:
            best = found
    return best


def in_balance(terms, end, h):
    """Multipliers of the same signs near those of an exclusion, for which G y = h, or None."""
    system = terms.system
    G = system.rigid[0]
    values = [arb(value) for value in terms.values[end]]
    columns = []
    for node, *_, moves in terms.rows:
        y = [arb(0)] * system.m
        for place, factor in moves:
            y[node if place is None else place] -= factor
        columns.append((G * column(y)).entries())
    W, left = arb_mat(len(h), len(h)), list(h)
    for u, part in zip(values, columns, strict=True):
        W += column(part) * arb_mat([part]) * abs(u)
        left = [a - u * b for a, b in zip(left, part, strict=True)]
    try:
        s = W.solve(column(left)).entries()
    except ZeroDivisionError:
        return None
    shares = [sum((a * b for a, b in zip(s, part, strict=True)), arb(0)) for part in columns]
    if not all(abs(share) < 1 for share in shares):
        return None
    return [u + abs(u) * share for u, share in zip(values, shares, strict=True)]
