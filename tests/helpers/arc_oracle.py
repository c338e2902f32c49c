"""What a proof says of arcs, judged by exact algebra: polynomials over alpha and their isolated roots."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

from exact_arcs import Truth, places
from flint import fmpq
from proof_tools import copied

from enumsol.arithmetic.algebraic import real_roots
from enumsol.arithmetic.rationals import rational
from enumsol.condensation.exact import ExactCondensed


class ArcOracle:
    """The truth about selections of one problem."""

    def __init__(self, problem):
        exact = ExactCondensed.from_problem(problem)

        @cache
        def truth(codes, side):
            if not side:
                return Truth(exact, codes)
            g0 = tuple(side * v for v in exact.g1)
            return Truth(replace(exact, g0=g0, g1=(fmpq(0),) * len(g0), zero=None), codes)

        self.truth = truth

    def is_true(self, codes, side, part, low):
        """Whether what a part says that begins at ``low`` is true."""
        truth, high = self.truth(codes, side), number(part[1])
        rows = truth.conditions
        if part[0] == "u":
            return True
        if part[0] == "n":
            return not any(truth.holds(alpha) for alpha in places([truth.det, *rows], low, high))
        index = part[2]
        if truth.signs(truth.det, low, high) != {index}:
            return False
        strict = [k for k in range(len(rows)) if part[0] == "h" or k != part[3]]
        if any(truth.signs(rows[k], low, high) != {index} for k in strict):
            return False
        if part[0] == "h":
            return True
        row, slope = rows[part[3]], 1 if part[4] else -1
        low, high, first, last = (rational(end) for end in (low, high, *map(number, part[5:7])))
        zeros = [] if row.is_zero() else real_roots(row, low, high)
        signs = [_sign(row(end)) * index for end in (low, high)]
        return (
            len(zeros) == 1
            and signs == [-slope, slope]
            and low <= first <= last <= high
            and _sign(row(first)) * index in (-slope, 0)
            and _sign(row(last)) * index in (slope, 0)
        )


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
            codes, side, end = tuple(record[1]), record[4], record[2]
        elif isinstance(record, list) and record[0] == "w":
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
        if isinstance(record, list) and record and record[0] == "w":
            for part in record[4]:
                if part[0] in ("h", "e"):
                    rising = part[0] == "e" and part[4] == 1
                    count += int(rising or not holds)
                    holds = part[0] == "h" or rising
                else:
                    holds = False
    return count


def assignments(records):
    """Codes of the leaves over pieces by their places, as far as the records of a graph in 2D make sense."""
    found, due, waiting, cut = {}, [], [], []
    try:
        whole = (6,) * records[0]["p"]
        for k, record in enumerate(records[1:], start=1):
            if isinstance(record, dict):
                if "piece" not in record:
                    break
                due += [cut, cut] if cut else []
                waiting, cut = (due.pop() if due else [whole])[::-1], []
            elif record[0] == "b":
                codes, (_, node, children) = waiting.pop(), record
                waiting += [(*codes[:node], code, *codes[node + 1 :]) for code in reversed(children)]
            elif record[0] != "q":
                found[k] = waiting.pop()
                cut += [found[k]] if record[0] == "p" else []
    except (KeyError, TypeError, ValueError, IndexError):
        pass
    return found


def survivors(records):
    """Selections that survive, of leaves and of forms of arcs."""
    found = {codes for k, codes in assignments(records).items() if records[k][0] == "s"}
    declared = [record for record in records if isinstance(record, list) and record[:1] == ["q"] and len(record) > 1]
    for _, codes, *_ in declared:
        found |= {tuple(each) for each in codes if isinstance(each, list)} if isinstance(codes, list) else set()
    return found


def recount(records):
    """Make the counts of a graph's proof fit, as somebody would who wants to be believed."""
    lists = [record for record in records if isinstance(record, list) and record]
    heads = [record for record in records[:-1] if isinstance(record, dict) and "traces" in record]
    traces = sum(record[0] == "t" for record in lists)
    for head in heads[:1]:
        head["traces"] = traces
    if records and isinstance(records[-1], dict) and "pieces" in records[-1]:
        arcs = {"traces": traces, "arcs": arc_count(records)} if heads or "arcs" in records[-1] else {}
        records[-1] = arcs | {
            "pieces": sum(isinstance(record, dict) and "piece" in record for record in records),
            "leaves": sum(record[0] in ("x", "i", *"o" * ("max_rigid_displacement" in records[0])) for record in lists),
            "selections": len(survivors(records)),
        }


def counted(records):
    """The records with counts that fit."""
    changed = copied(records)
    recount(changed)
    return changed
