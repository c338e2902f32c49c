"""What a proof says of arcs, judged by exact algebra: polynomials over alpha and their isolated roots."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

from flint import fmpq

from enumsol.arithmetic.algebraic import CriticalAlpha, merge, rational_between, real_roots
from enumsol.arithmetic.rationals import rational
from enumsol.condensation.exact import ExactCondensed
from enumsol.model.statuses import RowKind
from enumsol.selections.functions import SelectionFunctions
from enumsol.trusted.selection import Selection


class ArcOracle:
    """The truth about selections of one problem."""

    def __init__(self, problem):
        self.exact = ExactCondensed.from_problem(problem)
        self._known = {}

    def functions(self, codes, side):
        """det M and the conditions times det M, as polynomials that share their signs, and the conditions' names."""
        if (codes, side) not in self._known:
            exact = self.exact
            if side:
                exact = replace(exact, g0=tuple(side * v for v in exact.g1), g1=(fmpq(0),) * len(exact.g1), zero=None)
            found = SelectionFunctions(exact, codes)
            conditions = Selection(codes).conditions
            self._known[codes, side] = found.det, [found.row(RowKind(kind), node) for node, kind in conditions]
        return self._known[codes, side]

    def is_true(self, codes, side, part, low):
        """Whether what a part says that begins at ``low`` is true."""
        det, rows = self.functions(codes, side)
        low, high = rational(low), rational(number(part[1]))
        if part[0] == "u":
            return True
        if part[0] == "n":
            return not any(self._holds(det, rows, alpha) for alpha in _places([det, *rows], low, high))
        index = part[2]
        if any(alpha.sign_of(det) != index for alpha in _places([det], low, high)):
            return False
        strict = [k for k in range(len(rows)) if part[0] == "h" or k != part[3]]
        if any(alpha.sign_of(rows[k]) != index for k in strict for alpha in _places([rows[k]], low, high)):
            return False
        if part[0] == "h":
            return True
        row, slope = rows[part[3]], 1 if part[4] else -1
        zeros = [] if row.is_zero() else real_roots(row, low, high)
        first, last = (rational(number(bound)) for bound in part[5:7])
        signs = [_sign(row(end)) * index for end in (low, high)]
        return (
            len(zeros) == 1
            and signs == [-slope, slope]
            and low <= first <= last <= high
            and _sign(row(first)) * index in (-slope, 0)
            and _sign(row(last)) * index in (slope, 0)
        )

    @staticmethod
    def _holds(det, rows, alpha):
        sign = alpha.sign_of(det)
        return sign != 0 and all(alpha.sign_of(row) * sign >= 0 for row in rows)


def _places(polynomials, low, high):
    """Numbers in [low, high] among which are all roots, and one between any two of them."""
    found = [CriticalAlpha.rational(low), CriticalAlpha.rational(high)]
    for polynomial in polynomials:
        if polynomial.degree() > 0:
            found += real_roots(polynomial, low, high)
    roots = [group[0] for group in merge(found)]
    between = [CriticalAlpha.rational(rational_between(a, b)) for a, b in pairwise(roots)]
    return roots + between


def _sign(value):
    return (value > 0) - (value < 0)


def number(value):
    """An alpha of a proof."""
    return Fraction(value)


def claims(records):
    """Codes, side, part and its lower end, of all that a proof's traces say."""
    codes = side = end = None
    for record in records:
        if isinstance(record, list) and record[0] == "t":
            codes, side, end = tuple(map(int, record[1])), record[4], record[2]
        elif isinstance(record, list) and record[0] == "b":
            end = record[1]
            for part in record[4]:
                yield codes, side, part, number(end)
                end = part[1]


def arc_count(records):
    """Arcs as the checker counts them."""
    count, holds = 0, False
    for record in records:
        if isinstance(record, list) and record and record[0] == "t":
            holds = False
        if isinstance(record, list) and record and record[0] == "b":
            for part in record[4]:
                if part[0] in ("h", "e"):
                    rising = part[0] == "e" and part[4] == 1
                    count += int(rising or not holds)
                    holds = part[0] == "h" or rising
                else:
                    holds = False
    return count
