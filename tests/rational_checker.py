"""A checker of proofs that follows docs/proof_format.md and nothing else, in rational arithmetic, for small problems.

It imports nothing of enumsol; of a ContactProblem it reads the arrays. Numbers in brackets are its sections.
"""

import base64
import hashlib
import json
import re
import struct
import zlib
from fractions import Fraction
from itertools import combinations, pairwise, product
from math import comb, isfinite

import numpy as np
from flint import fmpq, fmpq_mat

MAGIC = b"enumsol-proof 1\n"
DIGEST = 32
LARGEST_TEXT = 1 << 24
LARGEST_FRACTION = 1 << 12
LARGEST_HULL = 50_000
#: [4.3] What a multiplier may be, by code and kind of row: E any number, + nonnegative, . none.
ALLOWED = {
    0: "EEEE+..",
    1: "+.++EEE",
    2: "+.E+E+.",
    3: "+.+EE.+",
    4: "+EEEE..",
    5: "+.++E..",
    6: "+.+++..",
    "undecided, F = 0": "+E+++..",
    # [6.3] slip where friction is not constant
    "slip+": "+.++E+.+.",
    "slip-": "+.++E.+.+",
}


class Refused(Exception):  # noqa: N818
    """The proof does not show what it claims."""


def need(holds, reason):
    if not holds:
        raise Refused(reason)


def check(problem, file):
    """Check the bytes of a proof file.

    Returns the footer of a point proof, or the set of selections of a graph proof. Raises Refused.
    """
    return check_records(problem, records_of(file))


def check_records(problem, records):
    need(len(records) > 1 and isinstance(records[0], dict), "no header")
    try:
        header = records[0]
        return (Graph if header.get("kind") == "graph" else Point)(problem, header).run(records[1:])
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise Refused(f"a record cannot be read: {error!r}") from error


# -- [1] container -----------------------------------------------------------------------------------------------------


def records_of(file):
    need(file[: len(MAGIC)] == MAGIC, "the first line is another")
    need(hashlib.sha256(file[:-DIGEST]).digest() == file[-DIGEST:], "the digest is another")
    stream = zlib.decompressobj()
    try:
        text = stream.decompress(file[len(MAGIC) : -DIGEST], LARGEST_TEXT)
        need(stream.eof and not stream.unused_data, "the stream does not end where the digest begins")
        need(text.endswith(b"\n"), "the last line has no end")
        return [json.loads(line, parse_constant=_no_number) for line in text.decode().split("\n")[:-1]]
    except (zlib.error, ValueError) as error:
        raise Refused(f"the stream cannot be read: {error}") from error


def _no_number(name):
    raise ValueError(name)


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
    need(re.fullmatch(r"-?[0-9a-f]+/[0-9a-f]*[1-9a-f][0-9a-f]*", text, re.ASCII), "no hexadecimal fraction")
    return fmpq(*(int(part, 16) for part in text.split("/")))


def multipliers(rows, values):
    rows, values = (base64.b64decode(text, validate=True) for text in (rows, values))
    need(2 * len(rows) == len(values), "not as many multipliers as rows")
    count = len(rows) // 4
    numbers = struct.unpack(f"<{count}d", values)
    return list(zip(struct.unpack(f"<{count}I", rows), map(exact, numbers), strict=True))


# -- [3] the problem ---------------------------------------------------------------------------------------------------


def fingerprint(problem):
    """[3.3]"""
    digest = hashlib.sha256(b"enumsol problem 1")

    def add(values, kind):
        digest.update(np.asarray(values).astype(kind).tobytes() + b"|")

    add([problem.n, problem.p], "<i8")
    for matrix in (problem.A, problem.Bn, problem.Bt):
        dense = matrix.toarray()
        column, row = np.nonzero(dense.T)
        add(np.searchsorted(column, np.arange(problem.n + 1)), "<i8")
        add(row, "<i8")
        add(dense[row, column], "<f8")
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    for vector in (problem.f, problem.gap, *problem.friction, slope, problem.slip_offset):
        add(vector, "<f8")
    return digest.hexdigest()


def matrix_of(array):
    return fmpq_mat([[exact(value) for value in row] for row in array.tolist()])


def column_of(values):
    return fmpq_mat([[value] for value in values])


class Data:
    """[3.1] S, g0, g1, F0 and F1 in rationals."""

    def __init__(self, problem):
        self.p = p = problem.p
        A = matrix_of(problem.A.toarray())
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
        self.F0, self.F1 = ([exact(value) for value in part.tolist()] for part in problem.friction)

    def load(self, alpha):
        return [a + alpha * b for a, b in zip(self.g0, self.g1, strict=True)]

    def friction(self, alpha):
        return [a + alpha * b for a, b in zip(self.F0, self.F1, strict=True)]

    def origin(self):
        """[6.2] The one alpha at which g vanishes, or None."""
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
        form = [fmpq(0)] * (2 * self.p + 1)
        form[i], form[self.p + i] = fmpq(normal), fmpq(tangential)
        return form

    def move(self, sign, k):
        """sign * w_k"""
        return [-sign * value for value in self.rows[k]] + [sign * self.g[k]]

    def row(self, kind, i):
        """[4.3], [6.3]"""
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
        """[4.1], [4.2] The rows N lambda - c, those of w with the sign of S lambda - g."""
        normal, tangential = [], []
        for i, code in enumerate(codes):
            normal.append(self.force(1, 0, i) if code == 0 else self.move(-1, i))
            slip = {2: -self.F[i], 3: self.F[i]}.get(code, fmpq(0))
            tangential.append(self.move(-1, self.p + i) if code == 1 else self.force(slip, 1, i))
        return normal + tangential

    def conditions(self, codes):
        kinds = {0: (4,), 1: (0, 2, 3), 2: (0, 5), 3: (0, 6), 4: (0,)}
        return [self.row(kind, i) for i, code in enumerate(codes) for kind in kinds[code]]

    def excludes(self, terms):
        """[4.5] for (number of a row, multiplier in the problem's units)."""
        v, constant = list(self.g), fmpq(0)
        for number, u in terms:
            *a, a0 = self.row(*divmod(number, self.p))
            v = [x + u * y for x, y in zip(v, a, strict=True)]
            constant += u * a0
        column = column_of(v)
        return -constant - (column.transpose() * self.S.solve(column))[0, 0] / 4 > 0

    def hull(self, *selections):
        """[5.3, D] Vertices of the common solutions of some selections."""
        affine = _affine([form for codes in selections for form in self.equations(codes)])
        if affine is None:
            return []
        origin, kernel = affine
        given = [form for codes in selections for form in self.conditions(codes)]
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


# -- [5] and [6]: what both kinds share --------------------------------------------------------------------------------


class Proof:
    """Header, units and rules of multipliers."""

    def __init__(self, problem, header):
        need(header["format"] == "enumsol-proof" and header["version"] == 1, "another format or version")
        need(header["problem"] == fingerprint(problem) and header["p"] == problem.p, "another problem")
        need(header["data"] == "problem", "S and g as computed are not at hand")
        self.data, self.p = Data(problem), problem.p

    def units(self, record):
        """[4.4] Factors of multipliers: on rows of forces, and of displacements."""
        force, length = ([integer(value) for value in record[key]] for key in ("force", "length"))
        p = self.p
        need(len(force) == len(length) == 2 * p and force[:p] == force[p:], "units are no lists of 2p integers")
        need(all(-900 <= value <= 900 for value in force + length), "units are out of range")
        need(len({a + b for a, b in zip(force, length, strict=True)}) == 1, "units do not fit together")
        return [[fmpq(2) ** value for value in values[:p]] for values in (length, force)]

    def terms(self, codes, packed, units, friction, varying=()):
        """[4.3], [4.4] Rows and multipliers in the problem's units, if they are allowed."""
        found = []
        for number, value in multipliers(*packed):
            kind, i = divmod(number, self.p)
            key = codes[i]
            if key == 6 and not friction[i]:
                key = "undecided, F = 0"
            elif i in varying and key in (2, 3):
                key = "slip+" if key == 2 else "slip-"
            need(kind < len(ALLOWED[key]), "a row does not exist")
            allowed = ALLOWED[key][kind]
            need(allowed == "E" or (allowed == "+" and value >= 0), "a multiplier is not allowed")
            found.append((number, value * units[0 if kind in (0, 1, 2, 3, 7, 8) else 1][i]))
        return found


def refinements(code, friction):
    """[4.1] The final codes that a code stands for."""
    if code == 6:
        return (0, 1, 2, 3) if friction else (0, 4)
    if code == 5:
        return (1, 2, 3) if friction else ()
    return (code,) if code in ((0, 1, 2, 3) if friction else (0, 4)) else ()


class Point(Proof):
    """[5]"""

    def __init__(self, problem, header):
        super().__init__(problem, header)
        alpha = decimal_fraction(header["alpha"])
        F = self.data.friction(alpha)
        need(min(F) >= 0, "friction is negative")
        self.friction = [value > 0 for value in F]
        self.forms = Forms(self.data.S, self.data.load(alpha), F)
        self.scale = self.units(header)
        self.regular = self.undecided = self.leaves = 0
        self.polytopes = []

    def run(self, records):
        due, position = [(6,) * self.p], 0
        while due:
            codes, record = due.pop(), records[position]
            position += 1
            need(isinstance(record, list) and record, "the tree breaks off")
            if record[0] == "b":
                due += reversed(self.split(codes, record))
            else:
                self.leaves += 1
                self.leaf(codes, *record)
        isolated, families = self.joined()
        counts = {"roots": self.regular + isolated, "families": families}
        counts |= {"undecided": self.undecided, "leaves": self.leaves}
        need(records[position:] == [counts], f"the footer is not {counts}")
        return counts

    def split(self, codes, record):
        _, node, children = record
        need(0 <= integer(node) < self.p, "no such node")
        whole = {6: (0, 5) if self.friction[node] else (0, 4), 5: (1, 2, 3)}.get(codes[node])
        need(whole is not None and sorted(map(integer, children)) == sorted(whole), "a split does not cover")
        return [(*codes[:node], code, *codes[node + 1 :]) for code in children]

    def leaf(self, codes, kind, *rest):
        """[5.3]"""
        if kind in ("x", "X"):
            terms = self.terms(codes, rest, self.scale, self.friction)
            need(self.forms.excludes(terms), "multipliers do not exclude a leaf")
        elif kind == "u":
            self.undecided += 1
        elif kind == "z":
            need(set(codes) == {6} and not any(self.forms.g), "the body is loaded")
            self.polytopes.append(((0,) * self.p, 0))
        else:
            need(kind in ("n", "N", "r", "D"), "an unknown leaf")
            need(max(codes) < 5, "a selection is not complete")
            {"n": self.empty, "N": self.empty, "r": self.root, "D": self.polytope}[kind](codes, *rest)

    def empty(self, codes):
        need(not self.forms.hull(codes), "a selection has a solution")

    def root(self, codes, mid, rad, index):
        equations = self.forms.equations(codes)
        N = fmpq_mat([form[:-1] for form in equations])
        need(N.det() != 0, "a selection is singular")
        point = N.solve(column_of([-form[-1] for form in equations])).entries()
        need(all(_value(form, point) > 0 for form in self.forms.conditions(codes)), "a condition is not strict")
        need(len(mid) == len(rad) == 2 * self.p, "an enclosure has another size")
        for x, m, r in zip(point, map(exact, mid), map(exact, rad), strict=True):
            need(abs(x - m) <= r, "an enclosure misses the root")
        need(integer(index) == (1 if N.det() > 0 else -1), "an index is wrong")
        self.regular += 1

    def polytope(self, codes, points, dimension):
        vertices = self.forms.hull(codes)
        claimed = sorted(as_point(map(hexadecimal_fraction, point)) for point in points)
        need(vertices and claimed == vertices, "the vertices of a selection are others")
        need(integer(dimension) == dimension_of(vertices), "a dimension is wrong")
        self.polytopes.append((codes, dimension))

    def joined(self):
        """[5.4] Isolated roots and families among the polytopes."""
        groups = []
        for polytope in self.polytopes:
            touching = [group for group in groups if any(self.forms.hull(polytope[0], other[0]) for other in group)]
            groups = [group for group in groups if group not in touching]
            groups.append([polytope, *(other for group in touching for other in group)])
        families = sum(any(dimension for _, dimension in group) for group in groups)
        return len(groups) - families, families


class Graph(Proof):
    """[6]"""

    def __init__(self, problem, header):
        super().__init__(problem, header)
        self.a, self.b = (decimal_fraction(end) for end in header["interval"])
        need(self.a < self.b, "the interval is empty")
        need(min(self.data.friction(self.a) + self.data.friction(self.b)) >= 0, "friction is negative")
        self.origin = self.data.origin()
        self.pieces = self.leaves = 0
        self.selections = set()

    def run(self, records):
        """[6.2]"""
        ends = [self.a, self.b]
        if self.origin is not None and self.a < self.origin < self.b:
            ends.insert(1, self.origin)
        due, position = [(x, y, ["6" * self.p]) for x, y in pairwise(ends)], 0
        while due:
            x, y, roots = due.pop(0)
            piece = records[position]
            need([decimal_fraction(end) for end in piece["piece"]] == [x, y], "another piece is due")
            need(sorted(piece["roots"]) == sorted(roots), "other roots are due")
            start = position = position + 1
            while isinstance(records[position], list):
                position += 1
            cut = self.piece(x, y, roots, self.units(piece), records[start:position])
            if cut:
                middle = (x + y) / 2
                due[:0] = [(x, middle, cut), (middle, y, cut)]
        counts = {"pieces": self.pieces, "leaves": self.leaves, "selections": len(self.selections)}
        need(records[position:] == [counts], f"the footer is not {counts}")
        return self.selections

    def piece(self, x, y, roots, units, leaves):
        """[6.3] Check a piece; the codes that are left to its halves."""
        ends = list(zip(self.data.friction(x), self.data.friction(y), strict=True))
        F_lo, F_hi = [min(pair) for pair in ends], [max(pair) for pair in ends]
        friction = [value > 0 for value in F_hi]
        varying = {i for i, slope in enumerate(self.data.F1) if slope != 0}
        loads = [self.data.load(x), self.data.load(y)]
        if self.origin in (x, y):
            loads = [[value if x == self.origin else -value for value in self.data.g1]]
        forms = [Forms(self.data.S, g, F_hi, F_lo) for g in loads]
        covered, cut = set(), []
        for kind, text, *rest in leaves:
            codes = self.codes(text)
            covered.update(self.selections_below(codes, friction))
            if kind == "x":
                self.leaves += 1
                terms = self.terms(codes, rest, units, friction, varying)
                need(all(form.excludes(terms) for form in forms), "multipliers do not exclude a leaf")
                continue
            need(kind in ("s", "c") and not rest, "an unknown leaf")
            if kind == "c":
                cut.append(text)
            else:
                need(max(codes) < 5, "a selection handed on is not complete")
                self.selections.add(codes)
        for root in roots:
            need(covered.issuperset(self.selections_below(self.codes(root), friction)), "a selection is in no leaf")
        self.pieces += 1
        return cut

    @staticmethod
    def selections_below(codes, friction):
        return product(*(refinements(code, positive) for code, positive in zip(codes, friction, strict=True)))

    def codes(self, text):
        need(re.fullmatch(f"[0-6]{{{self.p}}}", text, re.ASCII), "no codes")
        return tuple(map(int, text))
