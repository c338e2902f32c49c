"""Arcs of curves in 3D, for space_judge: where statuses change along a curve, and where alpha turns back.

Numbers in brackets are sections of docs/proof_format.md; the mathematics is in theory, section 12.10.
"""

from itertools import pairwise, permutations

from flint import arb
from rational_forms import need
from space_judge_boxes import Around
from space_judge_curves import dot, place_of
from space_judge_data import Undecided, column, length_of
from space_judge_leaves import Singular

#: As many nodes may change their statuses at one place.
_TOGETHER = 3


def sign(value):
    """That of a ball, or None."""
    return 1 if value > 0 else -1 if value < 0 else None


def slope(natural, around, d, e, statuses=None):
    """Bounds of the derivative of x along a curve, over balls of (z, alpha), and Y, E for the second one."""
    Y, E, _, V, middle, terms = natural.bordered(around, e, statuses)
    if V:
        raise Singular
    off = (middle * column(d)).entries()
    off[-1] -= 1
    first = (Y * column(off)).entries()
    for s, D in terms:
        first = [a + arb(0, (s * abs(dot(row, d))).upper()) for a, row in zip(first, D, strict=True)]
    return [a - b for a, b in zip(d, solved(E, first), strict=True)], Y, E


def solved(E, first):
    """All x with x = first + E x for a matrix in balls; E must contract."""
    radii = [abs(a).upper() for a in first]
    for _ in range(30):
        wide = [
            (abs(a).upper() + sum((abs(b).upper() * r for b, r in zip(row, radii, strict=True)), arb(0))).upper()
            for a, row in zip(first, E, strict=True)
        ]
        if all(a <= b for a, b in zip(wide, radii, strict=True)) and _contracts(E, radii):
            return [
                a + arb(0, sum((abs(b).upper() * r for b, r in zip(row, radii, strict=True)), arb(0)).upper())
                for a, row in zip(first, E, strict=True)
            ]
        radii = [(a * arb(1.1) + arb(2) ** -200).upper() for a in wide]
    raise Singular


def _contracts(E, radii):
    return all(
        sum((abs(b).upper() * r for b, r in zip(row, radii, strict=True)), arb(0)) < r
        for row, r in zip(E, radii, strict=True)
    )


def bend(natural, around, d, e):
    """Bounds of the second derivative of alpha along a smooth curve (theory, (12.26))."""
    first, Y, E = slope(natural, around, d, e)
    z, alpha = around.z[:-1], around.z[-1]
    moved = [dot(row, first) for row in natural.Z]
    right = [arb(0)] * natural.size
    for (n, t), (F0, F1), status in zip(natural.nodes, natural.discs, natural.statuses(z, alpha), strict=True):
        if status != "slip":
            continue
        F, length, a, nu = F0 + alpha * F1, length_of([z[k] for k in t]), moved[-1], moved[n]
        unit = [z[k] / length for k in t]
        s = dot(unit, [moved[k] for k in t]) / length
        b = [moved[k] / length - u * s for k, u in zip(t, unit, strict=True)]
        square = dot(b, b)
        for k, u, v in zip(t, unit, b, strict=True):
            right[k] = 2 * F1 * a * nu * u + 2 * (F * nu + F1 * a * z[n]) * v - F * z[n] * (2 * s * v + square * u)
    return solved(E, (Y * column(right)).entries())[-1]


class Walk:
    """The parts of one curve: ways of alpha, vertices and gaps, in turn."""

    def __init__(self, graph, curve, records, position):
        self.problem, self.low, self.high = graph.problem, arb(graph.problem.low), arb(graph.problem.high)
        self.records, self.position = records, position
        #: ("way", alpha, alpha, sign), ("vertex", alphas) or ("gap", alphas)
        self.found = []
        for k, box in enumerate(curve.boxes):
            self.box, before, first = box, len(self.found), self.position
            self.part(curve.points[k], curve.points[k + 1])
            if k in curve.crossing and {part[0] for part in records[first : self.position]} - {"s", "h"}:
                self.found[before:] = [("gap", self.alphas(None))]
        self.closed = curve.closed

    def place(self, record, between):
        """A point of the curve between two others."""
        place = place_of(self.problem, record)
        need(not place.half > 0, "a place with a length")
        need(None not in place.statuses, "the statuses at a place are not strict")
        need(self.box.has(place.point), "a place is not on its curve")
        t = [self.box.t(x.point) for x in (between[0], place, between[1])]
        need(t[0] < t[1] < t[2], "a place is not between the ends of its part")
        return place

    def own(self, record, *places):
        """A box of a part alone."""
        if record is None:
            return
        place = place_of(self.problem, record)
        need(place.half > 0, "a box without a length")
        need(all((a - b).is_zero() for a, b in zip(place.e, self.box.e, strict=True)), "a box with another border")
        place.cut()
        need(all(place.has(x.point) for x in places), "a box does not hold the ends of its part")

    def part(self, start, end, known=True):
        """The next record and those that follow from it; known: another box is known that holds the part."""
        record = self.records[self.position]
        self.position += 1
        need(isinstance(record, list) and record, "the parts break off")
        kind, own, *rest = record
        need(known or own is not None or kind in ("u", "h"), "a part without a box")
        if kind == "h":
            (middle,) = rest
            middle = self.place(middle, (start, end))
            self.part(start, middle, False)
            self.part(middle, end, False)
        elif kind == "u":
            need(not rest, "a gap with more")
            self.found.append(("gap", self.alphas(own)))
        elif kind == "s":
            need(not rest, "a part with more")
            self.own(own, start, end)
            self.way(start, end)
        elif kind == "f":
            before, after = rest
            before = self.place(before, (start, end))
            after = self.place(after, (before, end))
            self.own(own, start, end, before, after)
            self.way(start, before)
            self.fold(before, after)
            self.way(after, end)
        else:
            need(kind == "c", "no such part")
            before, after, near = rest
            before = self.place(before, (start, end))
            after = self.place(after, (before, end))
            self.own(own, start, end, before, after)
            self.own(near, before, after)
            self.part(start, before)
            self.corner(before, after)
            self.part(after, end, after.statuses == end.statuses)

    def alphas(self, own):
        """Those of a box, which need not be shown to hold anything, or of the curve's box."""
        if own is not None:
            place = place_of(self.problem, own)
            return place.c[-1] + arb(0, (place.half * abs(place.d[-1]) + place.radius[-1]).upper())
        found = None
        for alpha in self.box.alphas():
            found = alpha if found is None else found.union(alpha)
        return found

    def going(self, place):
        """The sign of alpha's derivative by t of the box at a place, or None."""
        return sign(place.direction[-1] / dot(place.direction, self.box.e))

    def rate(self, place):
        """The same where alpha does not rest."""
        need(self.going(place) is not None, "alpha rests at a place")
        return self.going(place)

    def way(self, start, end):
        """Statuses stay, and alpha goes one way."""
        natural, e = self.box.natural, self.box.e
        statuses = end.statuses if None in start.statuses else start.statuses
        need(None not in statuses, "the statuses at a place are not strict")
        going = sign(end.point[-1] - start.point[-1])
        need(going is not None, "alpha does not change")

        def holds(x, d, half, around, z):
            if natural.statuses(z[:-1], z[-1]) != statuses:
                return None
            set_ = natural.argument_at(x, d, half, around)
            return True if sign(slope(natural, set_, d, e)[0][-1]) == going else None

        t = [self.box.t(place.point).mid() for place in (start, end)]
        need(self.box.along(*t, holds, deepest=40), "alpha is not shown to go one way")
        self.found.append(("way", start.point[-1], end.point[-1], going))

    def piece(self, before, after):
        """The curve from one place to another in one set."""
        low, high = (self.box.t(place.point).mid() for place in (before, after))
        try:
            return self.box.set_between(low, high, before.point, after.point)
        except Singular as error:
            raise Undecided("a place is not enclosed") from error

    def fold(self, before, after):
        natural, e = self.box.natural, self.box.e
        need(before.statuses == after.statuses, "statuses change at a fold")
        x, d, half, around, z = self.piece(before, after)
        need(natural.statuses(z[:-1], z[-1]) == before.statuses, "statuses may change at a fold")
        need(self.rate(before) == -self.rate(after), "alpha does not turn back")
        try:
            second = bend(natural, natural.argument_at(x, d, half, around), d, e)
        except Singular as error:
            raise Undecided("a fold is not shown") from error
        if sign(second) is None:
            raise Undecided("a fold is not shown")
        need(sign(second) == -self.rate(before), "alpha bends the other way")
        self.found.append(("vertex", z[-1]))

    def corner(self, before, after):
        """Some nodes change their statuses, each once; alpha turns back once or never, in whatever order."""
        natural, e = self.box.natural, self.box.e
        changing = [i for i, (a, b) in enumerate(zip(before.statuses, after.statuses, strict=True)) if a != b]
        need(changing, "no status changes at a corner")
        if self.problem.rho and None in [self.going(place) for place in (before, after)]:
            self.found.append(("gap", self.piece(before, after)[-1][-1]))
            return
        if len(changing) > _TOGETHER:
            raise Undecided("many nodes change at once")
        x, d, half, around, z = self.piece(before, after)
        known = natural.statuses(z[:-1], z[-1])
        need(all(a is not None or i in changing for i, a in enumerate(known)), "another status may change at a corner")
        rates, set_ = {}, natural.argument_at(x, d, half, around)
        for chosen in _subsets(changing):
            statuses = [after.statuses[i] if i in chosen else before.statuses[i] for i in range(len(known))]
            try:
                first, *_ = slope(natural, Around(set_.z), d, e, statuses)
            except Singular as error:
                raise Undecided("a corner is not shown") from error
            rates[chosen] = sign(first[-1])
            moved = [dot(row, first) for row in natural.Z]
            for i in changing:
                need(self.monotone(i, before.statuses[i], after.statuses[i], z, moved), "a condition is not monotone")
        if None in rates.values():
            raise Undecided("alpha may rest at a corner")
        turns = set()
        for order in permutations(changing):
            passed = [rates[frozenset(order[:k])] for k in range(len(order) + 1)]
            turns.add(sum(a != b for a, b in pairwise(passed)))
        need(len(turns) == 1 and max(turns) < 2, "alpha turns back in some orders only")
        self.found.append(("vertex", z[-1]))

    def monotone(self, i, old, new, z, moved):
        """Whether the condition between two statuses changes its sign once."""
        natural = self.box.natural
        (n, t), (F0, F1) = natural.nodes[i], natural.discs[i]
        if "open" in (old, new):
            return sign(moved[n]) == (1 if old == "open" else -1)
        length = length_of([z[k] for k in t])
        if not length > 0:
            return False
        along = dot([z[k] / length for k in t], [moved[k] for k in t])
        F = F0 + z[-1] * F1
        return sign(along - F * moved[n] - F1 * moved[-1] * z[n]) == (1 if new == "slip" else -1)

    # -- counts --------------------------------------------------------------------------------------------------------

    def counts(self):
        """Arcs with alphas in the interval, and gaps."""
        gaps, arcs, current, before = 0, [], None, None
        for kind, *numbers in self.found:
            if kind == "way":
                current = _hull(current, before, *numbers[:2])
                continue
            before = numbers[0]
            if current is not None:
                arcs.append(_hull(current, before))
            current = None
            beyond = before < self.low or before > self.high
            gaps += not beyond and not (kind == "vertex" and before > self.low and before < self.high)
        if current is not None and self.closed and arcs and self.found[0][0] == "way":
            arcs[0] = _hull(arcs[0], current)
        elif current is not None:
            arcs.append(current)
        return sum(not (arc < self.low or arc > self.high) for arc in arcs), gaps


def _hull(*balls):
    """A ball around those of these that are not None."""
    first, *others = [ball for ball in balls if ball is not None]
    for ball in others:
        first = first.union(ball)
    return first


def _subsets(items):
    found = [frozenset()]
    for item in items:
        found += [chosen | {item} for chosen in found]
    return found
