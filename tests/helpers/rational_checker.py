"""A checker of proofs that follows docs/proof_format.md and nothing else, in rational arithmetic, for small problems.

It imports nothing of enumsol; of a ContactProblem it reads the arrays. Numbers in brackets are its sections.
"""

import hashlib
import json
import zlib
from functools import lru_cache
from itertools import pairwise, product
from math import isfinite

from flint import fmpq, fmpq_mat
from rational_arcs import Arcs
from rational_closings import Closings
from rational_floating import FloatingData, FloatingForms
from rational_forms import (
    Data,
    Forms,
    Refused,
    _value,
    as_point,
    column_of,
    decimal_fraction,
    dimension_of,
    exact,
    fingerprint,
    hexadecimal_fraction,
    integer,
    multipliers,
    need,
)
from rational_pieces import ClosedPiece, FloatingPiece
from rational_references import References

MAGIC = b"enumsol-proof 2\n"
DIGEST = 32
LARGEST_TEXT = 1 << 24
#: [4.4] What a multiplier may be, by code and kind of row: E any number, + nonnegative, . none.
ALLOWED = {
    0: "EEEE+..",
    1: "+.++EEE",
    2: "+.E+E+.",
    3: "+.+EE.+",
    4: "+EEEE..",
    5: "+.++E..",
    6: "+.+++..",
    7: "+.E++..",
    8: "+.+E+..",
    "undecided, F = 0": "+E+++..",
    # [7.2] slip where friction is not constant over a piece
    "slip+": "+.++E+.+.",
    "slip-": "+.++E.+.+",
}


@lru_cache(maxsize=16)
def data_of(problem):
    """Of a problem; made once where many proofs of it are checked."""
    return Data(problem) if problem.rigid_modes is None else FloatingData(problem)


def check(problem, file):
    """Check the bytes of a proof file.

    Returns the footer of a point proof, or the set of selections of a graph proof. Raises Refused.
    """
    return check_records(problem, records_of(file))


def check_records(problem, records):
    need(len(records) > 1 and isinstance(records[0], dict), "no header")
    try:
        header = records[0]
        kinds = (Point, Graph) if problem.rigid_modes is None else (FloatingPoint, FloatingGraph)
        kind = kinds[header.get("kind") == "graph"]
        return kind(problem, header).run(records[1:])
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
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
        return [record_of(line) for line in text.decode("ascii").split("\n")[:-1]]
    except (zlib.error, ValueError, RecursionError) as error:
        raise Refused(f"the stream cannot be read: {error}") from error


def record_of(line):
    need(line == line.strip() and "\r" not in line, "a line holds more than its record")
    return json.loads(line, parse_constant=_no_number, parse_float=_finite, object_pairs_hook=_each_once)


def _no_number(name):
    raise ValueError(name)


def _finite(text):
    need(isfinite(float(text)), "a number is not finite")
    return float(text)


def _each_once(pairs):
    need(len(dict(pairs)) == len(pairs), "an object gives a name twice")
    return dict(pairs)


def are(found, expected):
    """Whether the records are these, integers as integers."""
    return json.dumps(found, sort_keys=True) == json.dumps(expected, sort_keys=True)


# -- [5] and [7]: what both kinds share --------------------------------------------------------------------------------


class Proof:
    """Header, units and rules of multipliers."""

    def __init__(self, problem, header):
        need(header["format"] == "enumsol-proof" and integer(header["version"]) == 2, "another format or version")
        need(header["problem"] == fingerprint(problem) and integer(header["p"]) == problem.p, "another problem")
        need(header["data"] == "problem", "S and g as computed are not at hand")
        self.data, self.p = data_of(problem), problem.p

    def same_bound(self, header):
        """[5.1]"""
        bound = header["max_rigid_displacement"]
        need(type(bound) is float and bound == self.data.bound, "another bound of the rigid displacement")

    def units(self, record):
        """[4.6] Factors of multipliers: on rows of forces, and of displacements."""
        force, length = ([integer(value) for value in record[key]] for key in ("force", "length"))
        p = self.p
        need(len(force) == len(length) == 2 * p and force[:p] == force[p:], "units are no lists of 2p integers")
        need(all(-900 <= value <= 900 for value in force + length), "units are out of range")
        need(len({a + b for a, b in zip(force, length, strict=True)}) == 1, "units do not fit together")
        return [[fmpq(2) ** value for value in values[:p]] for values in (length, force)]

    def split(self, codes, record):
        """[5.2]"""
        _, node, children = record
        need(0 <= integer(node) < self.p, "no such node")
        ways = {5: ["123"], 6: ["05", "137", "128"] if self.friction[node] else ["04"], 7: ["02"], 8: ["03"]}
        found = "".join(map(str, sorted(map(integer, children))))
        need(found in ways.get(codes[node], ()), "a split does not cover")
        return [(*codes[:node], code, *codes[node + 1 :]) for code in children]

    def terms(self, codes, packed, units, friction, varying=()):
        """[4.4], [4.6] Rows and multipliers in the problem's units, if they are allowed."""
        found = []
        for number, value in multipliers(*packed):
            kind, i = divmod(number, self.p)
            key = codes[i]
            if key == 6 and not friction[i]:
                key = "undecided, F = 0"
            elif i in varying and key in (2, 3):
                key = "slip+" if key == 2 else "slip-"
            elif i in varying and key in (7, 8):
                key = 6
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
    if code in (7, 8):
        return (0, code - 5) if friction else ()
    return (code,) if code in ((0, 1, 2, 3) if friction else (0, 4)) else ()


class Point(Proof):
    """[5]"""

    def __init__(self, problem, header):
        super().__init__(problem, header)
        need("kind" not in header, "an unknown kind of proof")
        alpha = decimal_fraction(header["alpha"])
        F = self.data.friction(alpha)
        need(min(F) >= 0, "friction is negative")
        self.friction = [value > 0 for value in F]
        self.forms = self.data.forms(alpha)
        self.scale = self.units(header)
        self.regular = self.undecided = self.leaves = 0
        self.polytopes, self.roots, self.closings = [], [], Closings(self.forms, self.friction, self.scale)
        self.declared = []

    def run(self, records):
        due, position = [(6,) * self.p], 0
        while due:
            codes, record = due.pop(), records[position]
            position += 1
            need(isinstance(record, list) and record, "the tree breaks off")
            if record[0] == "b":
                due += reversed(self.split(codes, record))
            elif record[0] == "q":
                self.declare(*record[1:])
                due.append(codes)
            else:
                self.leaves += 1
                self.leaf(codes, *record)
        isolated, families = self.joined()
        isolated += self.closings.apart(self.roots + [codes for codes, _ in self.polytopes])
        counts = {"roots": self.regular + isolated, "families": families}
        counts |= {"undecided": self.undecided, "leaves": self.leaves}
        need(are(records[position:], [counts]), f"the footer is not {counts}")
        return counts

    def leaf(self, codes, kind, *rest):
        """[5.3], [6]"""
        if kind == "x" and (len(rest) == 2 or rest[2] == "rational"):
            terms = self.terms(codes, rest[:2], self.scale, self.friction)
            need(len(rest) < 4 and self.forms.excludes(terms), "multipliers do not exclude a leaf")
        elif kind == "x":
            *packed, back = rest
            self.excluded_by(codes, back, *packed)
        elif kind == "u":
            need(len(rest) == 1 and isinstance(rest[0], str), "no reason")
            self.undecided += 1
        elif kind == "z":
            need(set(codes) == {6} and not rest and not any(self.forms.g), "the body is loaded")
            self.polytopes.append(((0,) * self.p, 0))
        else:
            need(kind in ("n", "r", "D", "a", "m"), "an unknown leaf")
            if kind == "m" and type(rest[3]) is not int:
                self.closings.leaf(codes, *rest)
                return
            if kind == "a":
                selection, numbers, *claim, strengths, rows, values = rest
                terms = self.terms(codes, [rows, values], self.scale, self.friction)
                self.closings.alone(codes, selection, numbers, strengths, terms)
                self.root(selection, *claim)
                return
            if kind == "m":
                self.polytopes += self.closings.exact_leaf(codes, *rest)
                return
            need(max(codes) < 5, "a selection is not complete")
            {"n": self.empty, "r": self.root, "D": self.polytope}[kind](codes, *rest)

    def declare(self, codes, numbers, more):
        """[6.2]"""
        need(len(codes) == self.p and all(0 <= integer(code) <= 6 for code in codes), "codes of a form are none")
        need(len(numbers) == 4 * self.p, "a form has other multipliers")
        numbers, (weight,) = [exact(value) for value in numbers], more
        multipliers = [numbers[k * self.p : (k + 1) * self.p] for k in range(4)]
        need(min(multipliers[2] + multipliers[3]) >= 0 and exact(weight) >= 0, "a form is not allowed")
        self.declared.append((codes, multipliers))

    def excluded_by(self, codes, back, *packed):
        """[6.2]"""
        need(1 <= integer(back) <= len(self.declared), "a form was not declared")
        base, multipliers = self.declared[-back]
        for mine, code in zip(base, codes, strict=True):
            need(mine in (code, 6) or (mine == 5 and code in (1, 2, 3)), "a form is of another assignment")
        equations = []
        for i, code in enumerate(base):
            kinds = {0: (0, 1), 1: (4, 5), 2: (4, 2), 3: (4, 3), 4: (4, 1), 5: (4,)}.get(code, ())
            kinds = (1,) if code == 6 and not self.friction[i] else kinds
            equations += [self.forms.row(kind, i) for kind in kinds]
        terms = self.terms(codes, packed, self.scale, self.friction)
        form = self.forms.own_form(multipliers)
        need(self.forms.excludes_by(form, equations, terms), "a form does not exclude a leaf")

    def empty(self, codes, *rational):
        need(rational in ((), ("rational",)), "an unknown way to test a leaf")
        need(not self.forms.hull(codes), "a selection has a solution")

    def root(self, codes, mid, rad, index):
        equations = self.forms.equations(codes)
        N = fmpq_mat([form[:-1] for form in equations])
        need(N.det() != 0, "a selection is singular")
        point = N.solve(column_of([-form[-1] for form in equations])).entries()
        need(all(_value(form, point) > 0 for form in self.forms.conditions(codes)), "a condition is not strict")
        need(len(mid) == len(rad) == 2 * self.p, "an enclosure has another size")
        for x, m, r in zip(point[: 2 * self.p], map(exact, mid), map(exact, rad), strict=True):
            need(abs(x - m) <= r, "an enclosure misses the root")
        # the columns of -q in place of those of q
        sign = (1 if N.det() > 0 else -1) * (-1) ** (len(point) - 2 * self.p)
        need(integer(index) == sign, "an index is wrong")
        self.regular += 1
        self.roots.append(tuple(codes))

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


class FloatingPoint(Point):
    """[3.2]"""

    def __init__(self, problem, header):
        super().__init__(problem, header)
        self.same_bound(header)
        self.forms.lengths = self.scale[0]
        self.references = References(self.forms, self.friction, self.scale)

    def leaf(self, codes, kind, *rest):
        need(kind in ("x", "n", "r", "D", "u", "i", "o", "g"), "an unknown leaf")
        if kind == "o":
            back, rows, pairs, *claim = rest
            selection = self.references.leaf(codes, back, rows, pairs, claimed=bool(claim))
            if selection is not None:
                self.root(selection, *claim)
        elif kind == "x":
            need(len(rest) == 2, "an exclusion that rests on a definite stiffness")
            super().leaf(codes, kind, *rest)
        elif kind == "g":
            self.shared(codes, *rest)
        elif kind == "i":
            (z,) = rest
            need(self.forms.unbalanced(codes, z, self.scale[0]), "forces of a leaf may be in balance with the load")
        else:
            super().leaf(codes, kind, *rest)

    def shared(self, codes, slips, mid, rad, index):
        """[6.4] A root that selections share: all of them are tried."""
        nodes = [integer(node) for node, _ in slips]
        need(0 < len(nodes) <= 8 and nodes == sorted(set(nodes)), "no nodes, or too many, or not ascending")
        for node, code in slips:
            need(0 <= node < self.p and self.friction[node], "a node that cannot slip")
            need(integer(code) in (2, 3) and codes[node] in (1, code), "a node that slips otherwise")
        points, signs, holding = set(), set(), []
        for chosen in product(*((1, code) for _, code in slips)):
            between = dict(zip(nodes, chosen, strict=True))
            selection = tuple(between.get(i, code) for i, code in enumerate(codes))
            equations = self.forms.equations(selection)
            N = fmpq_mat([form[:-1] for form in equations])
            need(N.det() != 0, "a selection is singular")
            solution = N.solve(column_of([-form[-1] for form in equations])).entries()
            need(len(mid) == len(rad) == 2 * self.p, "an enclosure has another size")
            for x, m, r in zip(solution[: 2 * self.p], map(exact, mid), map(exact, rad), strict=True):
                need(abs(x - m) <= r, "an enclosure misses a solution")
            signs.add((1 if N.det() > 0 else -1) * (-1) ** (len(solution) - 2 * self.p))
            found = self.forms.hull(selection)
            points.update(tuple(point) for point in found)
            holding += [selection] if found else []
        need(len(points) == 1, "the selections do not share one root")
        need(signs == {integer(index)}, "an index is wrong")
        self.polytopes.append((holding[0], 0))

    def declare(self, selection, weights, more):
        self.references.declare(selection, weights, *more)


class Piece:
    """[7.1] A piece, its units, forms at both ends, what was declared over it, and what it leaves to its halves."""

    def __init__(self, ends, units, forms):
        self.ends, self.units, self.forms = ends, units, forms
        self.declared, self.cut = [], []


class Graph(Proof):
    """[7]"""

    def __init__(self, problem, header):
        super().__init__(problem, header)
        self.a, self.b = (decimal_fraction(end) for end in header["interval"])
        need(self.a < self.b, "the interval is empty")
        F = self.data.friction(self.a), self.data.friction(self.b)
        need(min(F[0] + F[1]) >= 0, "friction is negative")
        self.friction = [max(pair) > 0 for pair in zip(*F, strict=True)]
        self.origin = self.starts()
        self.pieces = self.leaves = 0
        #: Codes of the surviving selections, with the pieces in which they survive, each once.
        self.handed_on, self.closed = {}, []

    def run(self, records):
        """[7.1]"""
        ends = [self.a, self.b]
        if self.origin is not None and self.a < self.origin < self.b:
            ends.insert(1, self.origin)
        due, position = [(x, y, [(6,) * self.p]) for x, y in pairwise(ends)], 0
        while due:
            x, y, roots = due.pop(0)
            piece = records[position]
            need(set(piece) == {"piece", "force", "length"}, "a piece has other names")
            need([decimal_fraction(end) for end in piece["piece"]] == [x, y], "another piece is due")
            over, position = self.over(x, y, self.units(piece)), position + 1
            for root in roots:
                position = self.tree(over, root, records, position)
            self.pieces += 1
            self.closed += [arcs for arcs in over.declared if isinstance(arcs, ClosedPiece) and arcs.leaves]
            if over.cut:
                middle = (x + y) / 2
                due[:0] = [(x, middle, over.cut), (middle, y, over.cut)]
        counts = {"pieces": self.pieces, "leaves": self.leaves, "selections": len(self.handed_on)}
        if "pieces" not in records[position]:
            need(set(records[position]) == {"traces", "force", "length"}, "arcs begin with other names")
            scale = self.units(records[position])
            for piece in self.closed:
                piece.scale = scale
            arcs = Arcs(self.data, (self.a, self.b), self.origin, self.handed_on, self.closed)
            counts |= arcs.run(records[position], records[position + 1 : -1])
            position = len(records) - 1
        else:
            need(not self.closed, "pieces are closed by arcs that are missing")
        need(are(records[position:], [counts]), f"the footer is not {counts}")
        return set(self.handed_on)

    def over(self, x, y, units):
        """[7.2] What the tests of a piece are about."""
        ends = list(zip(self.data.friction(x), self.data.friction(y), strict=True))
        loads = [self.data.load(x), self.data.load(y)]
        if self.origin in (x, y):
            loads = [[value if x == self.origin else -value for value in self.data.g1]]
        forms = self.forms_of((x, y), loads, [max(pair) for pair in ends], [min(pair) for pair in ends])
        return Piece((x, y), units, forms)

    def tree(self, over, root, records, position):
        """[5.2] Check the tree of a root; the place after it."""
        due = [root]
        while due:
            codes, record = due.pop(), records[position]
            position += 1
            need(isinstance(record, list) and record, "the tree breaks off")
            if record[0] == "b":
                due += reversed(self.split(codes, record))
            elif record[0] == "q":
                self.declare(over, *record[1:])
                due.append(codes)
            else:
                self.leaf(over, codes, *record)
        return position

    #: Leaves of floating bodies, beside those of all.
    own_leaves = ()

    def declare(self, over, codes, numbers, more):
        """[7.2]"""
        if codes and isinstance(codes[0], list):
            for selection in codes:
                chosen = tuple(map(integer, selection))
                pairs = zip(chosen, self.friction, strict=True)
                need(all(refinements(code, rubs) == (code,) for code, rubs in pairs), "a selection is not complete")
                self.handed_on.setdefault(chosen, {})[over.ends] = None
            need(len(numbers) == 3 * self.p, "a form of arcs has other numbers")
            lists = [numbers[k * self.p : (k + 1) * self.p] for k in range(3)]
            over.declared.append(self.arcs_of(over, lists, more))
            return
        need(not self.own_leaves, "a form that rests on a definite stiffness")
        need(are(codes, [6] * self.p) and len(numbers) == 4 * self.p and more == [], "a form has another size")
        numbers = list(map(exact, numbers))
        need(min(numbers[2 * self.p :]) >= 0, "a multiplier of a form is negative")
        over.declared.append([numbers[k * self.p : (k + 1) * self.p] for k in range(4)])

    def arcs_of(self, over, lists, more):
        need(more == [], "a form has another size")
        return ClosedPiece(self.data, *over.ends, *lists)

    def leaf(self, over, codes, kind, *rest):
        """[7.2]"""
        need(kind in ("x", "s", "p", "o", *self.own_leaves), "an unknown leaf")
        if kind == "x":
            self.leaves += 1
            varying = {i for i, slope in enumerate(self.data.F1) if slope != 0}
            terms = self.terms(codes, rest[:2], over.units, self.friction, varying)
            if len(rest) == 2:
                need(self.excluded(over.forms, terms), "multipliers do not exclude a leaf")
                return
            form = self.declared_before(over, *rest[2:], list)
            excluded = (one.excludes_by(one.own_form(form), [], terms) for one in over.forms)
            need(all(excluded), "a form does not exclude a leaf")
        elif kind == "p":
            (alpha,) = rest
            need(2 * decimal_fraction(alpha) == sum(over.ends), "a piece is not cut in its middle")
            over.cut.append(codes)
        elif kind == "s":
            need(not rest, "a leaf says more")
            need(max(codes) < 5, "a surviving selection is not complete")
            self.handed_on.setdefault(codes, {})[over.ends] = None
        else:
            self.beside_arcs(over, codes, kind, *rest)

    def beside_arcs(self, over, codes, kind, back, rows, pairs):
        """[7.2, o]"""
        need(rows == pairs == [], "a leaf has rows")
        self.declared_before(over, back, ClosedPiece).leaves.append((kind, codes))

    @staticmethod
    def declared_before(over, back, kind):
        need(1 <= integer(back) <= len(over.declared), "a form was not declared")
        need(isinstance(over.declared[-back], kind), "a form is of another kind")
        return over.declared[-back]

    def starts(self):
        """[7.1] alpha_0."""
        return self.data.origin()

    def forms_of(self, ends, loads, F_hi, F_lo):
        return [Forms(self.data.S, g, F_hi, F_lo) for g in loads]

    @staticmethod
    def excluded(forms, terms):
        return all(form.excludes(terms) for form in forms)


class FloatingGraph(Graph):
    """[7], [3.2]"""

    def __init__(self, problem, header):
        super().__init__(problem, header)
        self.same_bound(header)

    own_leaves = ("i",)

    def arcs_of(self, over, lists, more):
        return FloatingPiece(self.data, *over.ends, *lists, more)

    def beside_arcs(self, over, codes, kind, *rest):
        """[7.2, o and i]"""
        self.leaves += 1
        back = rest[0] if kind == "o" else 1
        self.declared_before(over, back, ClosedPiece).leaves.append((kind, codes, *rest))

    def starts(self):
        return None

    def forms_of(self, ends, loads, F_hi, F_lo):
        data = self.data
        h = [[a + alpha * b for a, b in zip(data.h0, data.h1, strict=True)] for alpha in ends]
        return [
            FloatingForms(data.S, g, F_hi, data.G, load, data.reach, F_lo) for g, load in zip(loads, h, strict=True)
        ]

    @staticmethod
    def excluded(forms, terms):
        return forms[0].beside(forms[1], terms)
