"""Arcs of graph proofs in rational arithmetic (docs/proof_format.md, under Arcs), for rational_checker.

Along a selection det N, its products with lambda, and those with all conditions are polynomials in alpha. They are
found by interpolation; what a part of a trace says about them is decided by Sturm sequences.
"""

from functools import cached_property
from itertools import combinations
from math import comb, inf, nextafter

from flint import fmpq, fmpq_mat
from rational_forms import Forms, decimal_fraction, exact, integer, need
from rational_zeros import cells, count, interpolated, one_sign, sign

MOST_SYSTEMS = 2000
#: Partners at an event: code and kind of row [4.4] of one, of the other.
PARTNERS = [((0, 4), (2, 0)), ((0, 4), (3, 0)), ((0, 4), (4, 0)), ((1, 2), (2, 5)), ((1, 3), (3, 6))]
PARTNERS += [(other, one) for one, other in PARTNERS]
#: Conditions of a body that nothing holds: both bounds of q_j, as those of a node p + j.
BOUNDS = ("rho - q", "rho + q")


def alpha_of(value):
    """[2]"""
    need(isinstance(value, float | str), f"{value!r} is no alpha")
    return decimal_fraction(value) if isinstance(value, str) else exact(value)


class System:
    """The solution of 2p rows = 0 for all alpha: their determinant, its products with lambda and with other forms."""

    def __init__(self, square, forms, degree):
        """``square`` and ``forms`` give lists of forms at an alpha; ``degree`` bounds that of the polynomials."""
        table = [self._at(square(fmpq(k)), forms(fmpq(k))) for k in range(degree + 1)]
        determinant, *rest = (interpolated(values) for values in zip(*table, strict=True))
        self.size = len(square(fmpq(0)))
        self.determinant, self.products, self.values = determinant, rest[: self.size], rest[self.size :]

    @staticmethod
    def _at(rows, forms):
        """By Cramer's rule."""
        size = len(rows)
        determinant = fmpq_mat([row[:-1] for row in rows]).det()
        products = [
            fmpq_mat([[-row[-1] if j == k else row[j] for j in range(size)] for row in rows]).det() for k in range(size)
        ]
        point = [*products, determinant]
        return [
            *point[-1:],
            *products,
            *(sum((a * b for a, b in zip(form, point, strict=True)), fmpq(0)) for form in forms),
        ]


class Selection:
    """A selection along the interval, under the load g(alpha) (side 0) or side times its slope."""

    def __init__(self, data, codes, side):
        self._data, self.codes, self.side, self._p = data, codes, side, len(codes)
        groups = [{0: 4}, {2: 5, 3: 6}, dict.fromkeys((1, 2, 3, 4), 0), {1: 2}, {1: 3}]
        #: [7.3, conditions] Kind of row and node, by number.
        self.conditions = [(group[code], i) for group in groups for i, code in enumerate(codes) if code in group]
        modes = range(self._p, self._p + len(data.reach))
        self.conditions += [(kind, i) for kind in BOUNDS for i in modes]
        self._size = 2 * self._p + len(modes)

    def _forms(self, alpha):
        data = self._data
        if not self.side:
            return data.forms(alpha)
        return Forms(data.S, [self.side * value for value in data.g1], data.friction(alpha))

    def _equations(self, alpha):
        """With the sign of the index: that of the determinant with q in place of -q."""
        first, *rest = self._forms(alpha).equations(self.codes)
        return [[-value for value in first] if len(self._data.reach) % 2 else first, *rest]

    def _given(self, alpha):
        forms = self._forms(alpha)
        return [forms.row(kind, i) for kind, i in self.conditions if kind not in BOUNDS] + forms.bounds()

    def _system(self, left, taken):
        """That of the equations left and the conditions taken; its forms are all equations, then all conditions."""

        def square(alpha):
            equations, given = self._equations(alpha), self._given(alpha)
            return [*(equations[k] for k in left), *(given[k] for k in taken)]

        varying = sum(a[:-1] != b[:-1] for a, b in zip(square(fmpq(0)), square(fmpq(1)), strict=True))
        return System(square, lambda alpha: self._equations(alpha) + self._given(alpha), varying + 2)

    @cached_property
    def own(self):
        return self._system(range(self._size), ())

    @property
    def _values(self):
        return self.own.values[self._size :]

    def _index(self, x, y):
        """The sign of det N in all of [x, y], or 0."""
        return one_sign(self.own.determinant, x, y)

    def holds(self, x, y, index):
        """[7.3] A part "h"."""
        need(self._index(x, y) == index, "the index of a part is another, or its selection is singular")
        for value in self._values:
            need(one_sign(value, x, y) == index, "a condition is not positive")

    def event(self, x, y, index, condition, rising, first, last):
        """[7.3] A part "e"."""
        need(self._index(x, y) == index, "the index of an event is another, or its selection is singular")
        values = list(self._values)
        named = index * values.pop(condition)
        for value in values:
            need(one_sign(value, x, y) == index, "a condition besides that of the event is not positive")
        slope = 1 if rising else -1
        for alpha, expected in ((x, -slope), (first, -slope), (last, slope), (y, slope)):
            need(sign(named(alpha)) == expected, "a condition does not change its sign at an event")
        need(count(named, x, y) == 1, "a condition has another number of zeros at an event")
        need(count(named.gcd(named.derivative()), x, y) == 0, "the zero of an event is multiple")

    def empty(self, x, y):
        """[7.3] A part "n"."""
        if self._data.reach and self._data.unbalanced(self.codes, (x, y)):
            return
        if self._index(x, y) and any(one_sign(value, x, y) == -self._index(x, y) for value in self._values):
            return
        determinant, products = self.own.determinant, self.own.products
        if determinant == 0 and not any(product != 0 for product in products):
            need(not self._has_vertex(None, x, y), "a singular selection has a solution")
            return
        for point in cells([determinant, *self._values] if determinant != 0 else products, x, y):
            orientation = point.sign_of(determinant)
            if orientation:
                solved = all(point.sign_of(value) * orientation >= 0 for value in self._values)
            else:  # det N lambda = 0 has to be the products
                solved = not any(point.sign_of(product) for product in products) and self._has_vertex(point)
            need(not solved, "a selection said to be empty has a solution")

    def _has_vertex(self, point, x=None, y=None):
        """Whether N lambda = c, singular at this point or in all of [x, y], has a solution with all conditions.

        The solutions hold no line: where no condition changes, lambda does not. So if there are any, there is a vertex,
        which is the only solution of some equations and some conditions.
        """
        size, number = self._size, len(self.conditions)
        for extra in range(1, min(size, number) + 1):
            need(comb(size, extra) * comb(number, extra) <= MOST_SYSTEMS, "a singular selection asks for too much")
            regular = False
            for left in combinations(range(size), size - extra):
                for taken in combinations(range(number), extra):
                    found = self._system(left, taken)
                    for at in [point] if point else cells([found.determinant, *found.values], x, y):
                        orientation = at.sign_of(found.determinant)
                        regular |= orientation != 0
                        if orientation and self._solved(found, at, orientation):
                            return True
            if point and regular:  # with the rank of N, whatever has a solution has a vertex among these
                return False
        return False

    def _solved(self, found, at, orientation):
        equations, given = found.values[: self._size], found.values[self._size :]
        if any(at.sign_of(value) for value in equations):
            return False
        return all(at.sign_of(value) * orientation >= 0 for value in given)


class Trace:
    """[7.3, arcs] The arcs of one trace, from left to right."""

    def __init__(self, data, codes, side):
        self.selection, self.codes, self.side = Selection(data, codes, side), codes, side
        self.arcs = self.border = self.left_open = 0
        #: (condition, x, y, first, last, rising, index)
        self.events = []
        #: Parts with a solution: (kind, x, y, first, last, rising)
        self.present = []
        self._index, self._before = 0, None

    def part(self, x, y, kind, *rest, starts):
        """Check one part; ``starts`` says whether an arc may begin with the trace."""
        rising = False
        if kind == "u":
            need(not rest, "an unknown part")
            self.left_open += 1
        elif kind == "n":
            need(not rest, "an unknown part")
            need(not self._index, "an arc ends at no event")
            self.selection.empty(x, y)
        else:
            need(kind in ("h", "e"), "an unknown part")
            index = integer(rest[0])
            need(index in (-1, 1), "no index")
            if kind == "h":
                need(len(rest) == 1, "an unknown part")
                self.selection.holds(x, y, index)
                self.present.append(("h", x, y, x, y, False))
            else:
                rising = self._event(x, y, *rest)
            self._present(index, rising, starts)
        self._index = 0 if kind in "un" or (kind == "e" and not rising) else rest[0]
        self._before = kind

    def _event(self, x, y, index, condition, rising, first, last):
        first, last = alpha_of(first), alpha_of(last)
        need(x <= first < last <= y, "the bounds of an event lie outside its part")
        need(0 <= integer(condition) < len(self.selection.conditions), "an event names no condition")
        need(integer(rising) in (0, 1), "an event neither begins nor ends")
        self.selection.event(x, y, index, condition, rising, first, last)
        self.events.append((self.selection.conditions[condition], x, y, first, last, rising, index))
        self.present.append(("e", x, y, first, last, rising))
        return bool(rising)

    def _present(self, index, rising, starts):
        if rising:
            need(not self._index, "an arc begins where the selection holds")
            self.arcs += 1
        elif self._index:
            need(index == self._index, "an index changes along an arc")
        else:
            begins = self._before is None and starts
            need(begins or self._before == "u", "an arc begins at no event")
            self.arcs += 1
            self.border += index if begins else 0

    def finish(self, ends):
        """``ends`` says whether an arc may end with the trace."""
        need(not self._index or ends, "an arc ends with its trace")


class Arcs:
    """[7.3] All arcs of a proof on [a, b]; alpha_0 or None; by codes where selections survive; closed pieces."""

    def __init__(self, data, interval, origin, handed_on, closed):
        self._data, (self._a, self._b), self._closed = data, interval, closed
        self._origin = origin if origin is not None and self._a <= origin <= self._b else None
        self._due = [(codes, *span) for codes, where in handed_on.items() for span in self._spans(where)]
        self._traces = []

    def _spans(self, pieces):
        """[7.3, traces] Ends and side."""
        joined = []
        for x, y in sorted(pieces):
            if joined and joined[-1][1] == x and x != self._origin:
                joined[-1][1] = y
            else:
                joined.append([x, y])
        return [(x, y, 0 if self._origin is None else 1 if y > self._origin else -1) for x, y in joined]

    def run(self, head, records):
        """Check all traces; what the footer says of them."""
        position = 0
        while position < len(records):
            start = position
            position += 1
            while position < len(records) and records[position][0] == "w":
                position += 1
            self._traces.append(self._trace(records[start], records[start + 1 : position]))
        need(integer(head["traces"]) == len(self._traces), "another number of traces")
        need(not self._due, "a surviving selection has no trace")
        left_open = any(trace.left_open for trace in self._traces)
        alone, pairs = self._paired()
        need(left_open or not alone, "an event has no partner")
        border = sum(trace.border for trace in self._traces if trace.side < 1 or self._origin == self._a)
        need(left_open or self._data.reach or border == 1, "indices at the first alpha do not add up to 1")
        for piece in self._closed:
            piece.check(self._traces, pairs, self._origin)
        return {"traces": len(self._traces), "arcs": sum(trace.arcs for trace in self._traces)}

    def _trace(self, record, boxes):
        kind, codes, low, high, side = record
        need(kind == "t" and integer(side) in (-1, 0, 1), "no trace")
        low, high, codes = alpha_of(low), alpha_of(high), tuple(map(integer, codes))
        belongs = [
            due
            for due in self._due
            if due[0] == codes and _beside(low, due[1]) and _beside(-high, -due[2]) and due[3] == side
        ]
        need(belongs, "a trace is about no surviving selection")
        first = min(belongs, key=lambda due: due[1])
        self._due.remove(first)
        trace = Trace(self._data, first[0], side)
        starts = low <= (self._origin if side == 1 else self._a)
        end = low
        for _, *ends, precise, parts in boxes:
            need(integer(precise) in (0, 1), "a box is neither precise nor not")
            plain = not precise and any(part[0] != "u" for part in parts)
            need(not plain or not any(isinstance(value, str) for value in ends), "the ends of a box are no floats")
            x, y = map(alpha_of, ends)
            need(x == end < y, "a box does not begin where the one before ends")
            need(parts, "a box has no parts")
            for kind, upper, *rest in parts:
                before, end = end, alpha_of(upper)
                need(before < end <= y, "parts are not in order")
                trace.part(before, end, kind, *rest, starts=starts)
        need(end == high, "the parts do not cover a trace")
        trace.finish(high >= (self._origin if side == -1 else self._b))
        return trace

    def _paired(self):
        """[7.3, events] Events without a partner, and pairs."""
        events = [(trace, *event) for trace in self._traces for event in trace.events if event[0][0] not in BOUNDS]
        partners = [[other for other in events if _partners(event, other)] for event in events]
        for event, found in zip(events, partners, strict=True):
            need(len(found) < 2, "an event has two partners")
            for other in found:
                need((event[6] != other[6]) == (event[7] == other[7]), "indices do not balance at an event")
        matched = list(zip(events, partners, strict=True))
        return [event for event, found in matched if not found], [(event, *found) for event, found in matched if found]


def _beside(low, alpha):
    """Whether it is the largest float that is at most alpha."""
    value = int(low.p) / int(low.q)
    return low == exact(value) <= alpha < exact(nextafter(value, inf))


def _partners(event, other):
    trace, (kind, i), x, y, first, last = event[:6]
    against, (kind2, i2), x2, y2, first2, last2 = other[:6]
    one, two = trace.codes, against.codes
    if trace.side != against.side or i != i2 or one[:i] + one[i + 1 :] != two[:i] + two[i + 1 :]:
        return False
    if ((one[i], kind), (two[i], kind2)) not in PARTNERS:
        return False
    return x <= first2 < last2 <= y or x2 <= first < last <= y2
