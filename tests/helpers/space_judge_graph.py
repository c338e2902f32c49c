"""Graphs of all solutions in 3D over an interval of alpha, for space_judge: curves, and the tree that leads to them.

Numbers in brackets are sections of docs/proof_format.md.
"""

from functools import cached_property
from itertools import combinations

from flint import arb, arb_mat
from rational_checker import are
from rational_forms import Refused, decimal_fraction, exact, integer, need
from space_judge_arcs import Walk, sign, slope
from space_judge_certificates import equations, square
from space_judge_curves import GraphProblem, dot, place_of
from space_judge_data import (
    Terms,
    Undecided,
    column,
    in_balance,
    is_code,
    is_complete,
    is_definite,
    is_split,
    length_of,
    most,
)
from space_judge_zeros import explore, roots_of

#: As many times a piece is halved where an exclusion is shown to hold over it.
_HALVINGS = 24
_HEAVY = arb(2) ** 120


def between(low, high):
    return arb(low).union(arb(high))


class Curve:
    """[8.1] Points and boxes in turn, tested as a curve."""

    def __init__(self, problem, records, first):
        self.problem, self.first = problem, first
        places = [place_of(problem, record) for record in records]
        self.points, self.boxes = places[::2], places[1::2]
        need(all(not (place.half > 0) for place in self.points), "a point with a length")
        need(all(place.half > 0 for place in self.boxes), "a box without a length")
        self.closed = are(records[0], records[-1])
        self.ends = [self.points[0].point, self.points[-1].point]
        for box in self.boxes:
            box.cut()
        for box, before, after in zip(self.boxes, self.points, self.points[1:], strict=False):
            need(all(box.has(point.point) for point in (before, after)), "a point is not in the box beside it")
            need(box.t(before.point) < box.t(after.point), "points beside a box in the wrong order")
        joints = list(zip(self.points[1:], self.boxes, self.boxes[1:], strict=False))
        if self.closed:
            joints.append((self.points[0], self.boxes[-1], self.boxes[0]))
        for point, *beside in joints:
            one, two = (dot(point.direction, box.e) for box in beside)
            need(one * two > 0, "a curve turns back at a point")
        need(self.closed or len(self.boxes) > 0, "no boxes")
        self.open = [] if self.closed else [k for k in (0, 1) if not self._leaves(k)]
        self._comes_back()
        #: boxes beside which q comes to its bound
        self.crossing = [k for k in range(len(self.boxes)) if self._crosses(k)]

    def _crosses(self, k):
        """Whether q comes to a bound in a box: there it goes outwards all along (theory, section 14.14)."""
        box, last = self.boxes[k], len(self.boxes) - 1
        t, wide = [x.mid() for x in self.t(k)], []
        for j, rho in zip(self.problem.free, self.problem.rho, strict=True):
            if not box.along(*t, lambda x, d, half, around, z, j=j, rho=rho: abs(z[j]) < rho or None):
                wide.append((j, rho))
        if not wide:
            return False
        inner = [(k, self.points[k])] if k == last else []
        inner += [(k + 1, self.points[k + 1])] if k == 0 else []
        need(not self.closed and inner, "q comes to a bound inside of a curve")
        for place, point in inner:
            within = all(abs(point.point[j]) < rho for j, rho in wide)
            # the end is at the first point if the inner one is the last
            if within and all(self._grows(box, t, j, place > k) for j, _ in wide):
                return True
        raise Undecided("q is not shown to go outwards")

    @staticmethod
    def _grows(box, t, j, first):
        """Whether a coordinate moves one way along a box, away from zero at its first or at its last end."""
        end = box.near(t[0] if first else t[1])[j]
        way = sign(end) * (-1 if first else 1)

        def holds(x, d, half, around, z):
            natural = box.natural
            return sign(slope(natural, natural.argument_at(x, d, half, around), d, box.e)[0][j]) == way or None

        return box.along(*t, holds)

    def t(self, k):
        """From where to where the curve goes in a box."""
        return [self.boxes[k].t(self.points[j].point) for j in (k, k + 1)]

    def _leaves(self, end):
        """Whether all that boxes have beyond an end is beyond the interval."""
        x = self.ends[end]
        low, high = arb(self.problem.low), arb(self.problem.high)
        beyond = [lambda z: z[-1] < low or z[-1] > high]
        beyond += [
            lambda z, j=j, rho=rho: abs(z[j]) > rho for j, rho in zip(self.problem.free, self.problem.rho, strict=True)
        ]
        return any(test(x) and self._is_beyond(x, end, test) for test in beyond)

    def _is_beyond(self, x, end, test):
        for box in self.boxes:
            if box.may_pass(x):
                t = box.t(x)
                part = (t.mid(), box.half) if end else (-box.half, t.mid())
                if part[0] < part[1] and not box.along(*part, lambda x, d, half, around, z: True if test(z) else None):
                    return False
        return True

    def _comes_back(self):
        count = len(self.boxes)
        for k, box in enumerate(self.boxes):
            if 0 < k < count - 1:
                need(not any(box.may_pass(x, *self.t(k)) for x in self.ends), "a curve comes back")

    def gaps(self):
        """The alphas of open ends."""
        for end in self.open:
            x = self.ends[end]
            found = x[-1]
            for box in self.boxes:
                if box.may_pass(x):
                    t = box.t(x)
                    for s in box.slices:
                        if not (s.high < t if end else s.low > t):
                            found = found.union(s.at(s.low.union(s.high))[-1])
            yield found


class Graph:
    """[8]"""

    def __init__(self, problem, header, data, scale):
        self.p, self.scale = problem.p, scale
        low, high = (decimal_fraction(text) for text in header["interval"])
        need(low < high, "an empty interval")
        steps = header["steps"]
        size = 3 * self.p + (0 if data.modes is None else len(data.h0))
        need(isinstance(steps, list) and len(steps) == size, f"steps are no list of {size} floats")
        steps = [arb(exact(value)) for value in steps]
        need(min(steps) > 0, "a step is not positive")
        self.problem = GraphProblem(data, low, high, steps)
        self.system, self.data = self.problem.system, data
        self.full = self.system.bordered
        self.tangents = [len(places) for places in self.system.tau]
        self.curves, self.walks, self.leaves, self.gaps = [], [], 0, 0

    def run(self, records):
        position = 0
        while "curve" in records[position]:
            need(list(records[position]) == ["curve"], "no curve")
            count = integer(records[position]["curve"])
            need(0 < count < len(records), "a curve without boxes")
            first = sum(len(curve.boxes) for curve in self.curves)
            end = position + 2 + 2 * count
            self.curves.append(Curve(self.problem, records[position + 1 : end], first))
            position = end
            walk = None
            if are(records[position], {"parts": True}):
                walk = Walk(self, self.curves[-1], records, position + 1)
                position = walk.position
            self.walks.append(walk)
        self.apart()
        need(are(records[position], {"tree": True}), "no tree")
        position = self.tree(records, position + 1)
        gaps = self.gaps + sum(len(curve.open) for curve in self.curves)
        walked, arcs = [walk.counts() for walk in self.walks if walk], None
        if len(walked) == len(self.walks):
            arcs = sum(found for found, _ in walked)
        gaps += sum(found for _, found in walked)
        counts = {"curves": len(self.curves), "arcs": arcs, "leaves": self.leaves, "gaps": gaps}
        need(are(records[position:], [counts]), f"the counts are {counts}")
        return counts

    def apart(self):
        for one, two in combinations(self.curves, 2):
            for curve, other in ((one, two), (two, one)):
                for box in curve.boxes:
                    need(not any(box.may_pass(x) for x in other.ends), "two curves have a point in common")

    def tree(self, records, position):
        due = [(self.problem.low, self.problem.high, (6,) * self.p)]
        while due:
            low, high, codes = due.pop()
            record = records[position]
            position += 1
            need(isinstance(record, list) and record, "the tree breaks off")
            if record[0] == "p":
                (alpha,) = map(decimal_fraction, record[1:])
                need(low < alpha < high, "a cut beyond its piece")
                due += [(alpha, high, codes), (low, alpha, codes)]
            elif record[0] == "b":
                _, node, children = record
                need(type(node) is int and 0 <= node < self.p, "no such node")
                need(all(type(child) is int for child in children), "no codes")
                need(is_split(codes[node], children, self.tangents[node]), "a branching does not cover its assignment")
                due += [(low, high, (*codes[:node], child, *codes[node + 1 :])) for child in reversed(children)]
            else:
                self.leaves += 1
                test = {
                    "x": self.leaf_x,
                    "n": self.leaf_n,
                    "t": self.leaf_t,
                    "k": self.leaf_k,
                    "u": self.leaf_u,
                    **({"i": self.leaf_i} if self.system.rigid else {}),
                }[record[0]]
                test(low, high, codes, *record[1:])
        return position

    def leaf_u(self, low, high, codes, reason):
        need(isinstance(reason, str), "no reason")
        self.gaps += 1

    # -- exclusions ----------------------------------------------------------------------------------------------------

    def leaf_i(self, low, high, codes, z):
        """[6.3], [8.3] No forces are in balance with the load at either end, and so in between."""
        need(isinstance(z, list) and len(z) == len(self.problem.rho), "a direction has another size")
        z, pull = self.data.pulls(self.system, [arb(exact(value)) for value in z], self.scale[0])
        for alpha in (arb(low), arb(high)):
            need(dot(z, self.data.pushed(alpha)) > 0, "z does not push against the load")
            for i, (code, places) in enumerate(zip(codes, self.system.tau, strict=True)):
                largest = self.system.radius(i, alpha) * most(code, [pull[k] for k in places])
                need(code == 0 or pull[i] + largest <= 0, "forces may be in balance")

    def leaf_x(self, low, high, codes, rows, text):
        """[8.3] (6.1) at every alpha of the piece: a polynomial of degree four."""
        terms = Terms(self.system, self.scale, codes, rows, text, ends=2)
        if not self.system.rigid:
            self.excluded(terms, low, high, None)
            return
        pushed = [self.data.pushed(arb(alpha)) for alpha in (low, high)]
        turned = [in_balance(terms, end, h) for end, h in enumerate(pushed)]
        if None in turned:
            turned = []
        for values in ([[arb(x) for x in part] for part in terms.values], turned):
            try:
                if values:
                    self.excluded(terms, low, high, values, pushed, balanced=values is turned)
                    return
            except Refused as error:
                said = error
        raise said

    def excluded(self, terms, low, high, values, loads_of_q=(), *, balanced=False):
        """Show that multipliers exclude a leaf over a piece."""
        system, m = self.system, self.system.m
        sums = [terms.sums(end, values and values[end]) for end in (0, 1)]
        loads = [system.load(arb(alpha)) for alpha in (low, high)]
        radii = [[system.radius(i, arb(alpha)) if i < self.p else arb(0) for i in range(m)] for alpha in (low, high)]

        def affine(one, two):
            return [[a, b - a] for a, b in zip(one, two, strict=True)]

        plain, radial, moves = (affine(one, two) for one, two in zip(*sums, strict=True))
        load, radius = affine(*loads), affine(*radii)
        pushed = [system.S * column([part[k] for part in moves]) for k in (0, 1)]
        v = [[arb(0)] * m for _ in range(3)]
        for i in range(m):
            for k in (0, 1):
                v[k][i] += load[i][k] + plain[i][k] - pushed[k][i, 0]
            product = _times(radial[i], radius[i])
            for k, value in enumerate(product):
                v[k][i] += value
        left, size = [arb(0)] * 5, arb(0)
        if loads_of_q:
            G, ends = system.rigid[0], []
            for k, h in enumerate(loads_of_q):
                at = [v[0][i] + (v[1][i] + v[2][i] if k else 0) for i in range(m)]
                image = system.inverse * G.transpose()
                right = 2 * column(h) - image.transpose() * column(at)
                ends.append([x.mid() for x in (G * image).solve(right).entries()])
            z, h = affine(*ends), affine(*loads_of_q)
            for j, (a, b) in enumerate(zip(z, h, strict=True)):
                for k, value in enumerate(_times(a, b)):
                    left[k] += value
                for k in (0, 1):
                    for i in range(m):
                        v[k][i] += G[j, i] * a[k]
            # G y - h is affine and rho'|G y - h| convex: not above its chord
            moved = [(G * column(part[2])).entries() for part in sums]
            off = [[-a - b for a, b in zip(*two, strict=True)] for two in zip(moved, loads_of_q, strict=True)]
            ends = [dot(self.problem.rho, [abs(x) for x in part]) for part in off]
            left[0] -= arb(0) if balanced else ends[0]
            left[1] -= arb(0) if balanced else ends[1] - ends[0]
        for a, b in zip(moves, load, strict=True):
            for k, value in enumerate(_times(a, b)):
                left[k] -= value
        images = [(system.inverse * column(part)).entries() for part in v]
        for j in range(3):
            for k in range(3):
                value = dot(v[j], images[k]) / 4
                left[j + k] -= value
                size += abs(value)
        least = _least(left)
        if not least > 0:
            need(not least <= 0, f"the margin is {float((least / (size + arb(2) ** -900)).mid()):.1e} of its terms")
            raise Undecided(f"a margin: {least.str(5)}")

    # -- leaves --------------------------------------------------------------------------------------------------------

    def leaf_n(self, low, high, codes):
        need(is_complete(codes), "the assignment is still open")

        def settled(angles, alpha, view):
            if view is not None and not angles and view.is_strict():
                need(False, "there is a solution")
            return False

        explore(self.full, codes, between(low, high), settled, piece=(arb(low), arb(high)))

    @cached_property
    def lifted(self):
        """zeta = C y - shift - alpha slope in the variables of the tree."""
        problem, natural = self.problem, self.problem.natural
        lift = arb_mat(natural.m, self.full.m)
        for k, (place, factor) in enumerate(problem.tau_rows()):
            if place is not None:
                lift[k, place] = factor
        C = (natural.S * lift).tolist()
        plain = lift.tolist()
        C = arb_mat(
            [[a + s * b for a, b in zip(*rows, strict=True)] for s, *rows in zip(natural.steps, plain, C, strict=True)]
        )
        return C, *([s * a for s, a in zip(natural.steps, g, strict=True)] for g in (natural.g0, natural.g1))

    def spread(self, view, across=False):
        """(zeta, alpha) of all solutions in a view: a point, how it moves with alpha, and what else moves it."""
        leaf, (C, shift, slope) = view.leaf, self.lifted
        x = [a - b - leaf.alpha * c for a, b, c in zip((C * leaf.y).entries(), shift, slope, strict=True)]
        drift = [a - b for a, b in zip((C * column(view.by_alpha[0])).entries(), slope, strict=True)]
        moves = [(C * column(dy)).entries() for dy, _ in view.by_angle]
        if across and view.across:
            # alpha as a function of the one angle
            rate, step, rest = view.across
            return (
                [*x, leaf.alpha],
                [*(a + rate * b for a, b in zip(moves[0], drift, strict=True)), rate],
                [[*drift, arb(1)]],
                step,
                [rest],
            )
        shares, rest = view.line or (
            [arb(0)] * len(moves),
            [a - b for a, b in zip(view.angles, leaf.angles, strict=True)],
        )
        for share, move in zip(shares, moves, strict=True):
            drift = [a + share * b for a, b in zip(drift, move, strict=True)]
        return [*x, leaf.alpha], [*drift, arb(1)], [[*move, arb(0)] for move in moves], view.alpha - leaf.alpha, rest

    def box(self, number):
        """The curve of a box and its place there."""
        integer(number)
        found = [curve for curve in self.curves if curve.first <= number < curve.first + len(curve.boxes)]
        need(found, "there is no such box")
        return found[0], number - found[0].first

    def on(self, low, high, codes, boxes, alphas=None):
        """Show that all solutions of an assignment over a piece lie where some boxes have the only ones."""
        need(is_complete(codes), "the assignment is still open")
        first, last = alphas or (low, high)

        def settled(_, alpha, view):
            if view is None or not (low >= first or alpha >= arb(first)) or not (high <= last or alpha <= arb(last)):
                return False
            spreads = [self.spread(view, across) for across in ((False, True) if view.across else (False,))]
            return any(box.has_all(*spread) for box in boxes for spread in spreads)

        explore(self.full, codes, between(low, high), settled, piece=(arb(low), arb(high)))

    def leaf_k(self, low, high, codes, first, last, numbers=None):
        if numbers is not None:
            need(not self.system.rigid, "a form of a body that nothing holds")
            self.by_form(low, high, codes, numbers, first, last)
            return
        curve, begin = self.box(first)
        other, end = self.box(last)
        need(curve is other and begin <= end, "boxes of no one run")
        self.on(low, high, codes, curve.boxes[begin : end + 1])

    def leaf_t(self, low, high, codes, number, first, last, alpha, leaf):
        curve, k = self.box(number)
        first, last, alpha = map(decimal_fraction, (first, last, alpha))
        need(self.problem.low <= first <= alpha <= last <= self.problem.high, "alphas in the wrong order")
        need(len(leaf) == self.p and all(map(is_code, leaf, self.tangents)), "no such leaf")
        need(all(a == b or min(a, b) >= 12 for a, b in zip(codes, leaf, strict=True)), "a leaf of other statuses")
        for gap in curve.gaps():
            need(not gap.overlaps(between(first, last)), "the curve ends here")
        found = roots_of(self.full, tuple(leaf), arb(alpha))
        need(len(found) == 1, "no root in the leaf")
        spread = self.spread(found[0].view)
        need(curve.boxes[k].has_all(*spread), "the root is not in the box")
        self.on(low, high, codes, curve.boxes, (first, last))

    # -- certificates --------------------------------------------------------------------------------------------------

    def by_form(self, low, high, codes, numbers, first, last):
        curve, begin = self.box(first)
        other, end = self.box(last)
        need(curve is other and (begin <= end or curve.closed), "boxes of no one run")
        count = len(curve.boxes)
        run = [(begin + k) % count for k in range((end - begin) % count + 1)]
        ends = curve.points[begin].point[-1], curve.points[end + 1].point[-1]
        need(
            (ends[0] <= arb(low) and ends[1] >= arb(high)) or (ends[1] <= arb(low) and ends[0] >= arb(high)),
            "boxes do not pass the piece",
        )
        form = PieceForm(self, low, high, codes, numbers)
        for k in run:
            need(
                curve.boxes[k].along(*(t.mid() for t in curve.t(k)), form.holds_along(curve.boxes[k])),
                "the form is not shown to be definite",
            )


def _times(one, two):
    return [one[0] * two[0], one[0] * two[1] + one[1] * two[0], one[1] * two[1]]


def _least(c, depth=0):
    """A number below all values of a polynomial of degree four on [0, 1], zero or less only if one of them is."""
    if not c[0] > 0:
        return c[0]
    end = sum(c, arb(0))
    if not end > 0:
        return end
    b = [c[0], c[0] + c[1] / 4, c[0] + c[1] / 2 + c[2] / 6, c[0] + c[1] * 3 / 4 + c[2] / 2 + c[3] / 4, end]
    least = min(b, key=lambda value: float(value.lower()))
    if least > 0 or depth > _HALVINGS:
        return least if least > 0 else arb(0, 1)
    half = [c[k] / 2**k for k in range(5)]
    # the polynomial at 1/2 + s / 2
    shifted = [sum((c[k] * _BINOMIAL[k][j] / arb(2) ** k for k in range(j, 5)), arb(0)) for j in range(5)]
    one = _least(half, depth + 1)
    return one if not one > 0 else _least(shifted, depth + 1)


_BINOMIAL = [[1, 0, 0, 0, 0], [1, 1, 0, 0, 0], [1, 2, 1, 0, 0], [1, 3, 3, 1, 0], [1, 4, 6, 4, 1]]


class PieceForm:
    """[8.3] The numbers of a certificate over a piece."""

    def __init__(self, graph, low, high, codes, numbers):
        self.graph, self.system, self.codes, p = graph, graph.system, codes, graph.p
        m = self.system.m
        need(isinstance(numbers, list) and len(numbers) == 2 * p + 3 * (m - p), "another number of numbers")
        numbers = [arb(exact(value)) for value in numbers]
        self.mu, self.kappa = numbers[:p], numbers[p : 2 * p]
        parts = [numbers[2 * p + k * (m - p) :] for k in range(3)]
        self.nu, one, two = ([[part[place - p] for place in places] for places in self.system.tau] for part in parts)
        self.low, self.high = arb(low), arb(high)
        need(min(self.mu) > 0 and min(self.kappa) > 0, "mu or kappa is not positive")
        self.ends = []
        for i in range(p):
            r = [self.system.radius(i, alpha) for alpha in (self.low, self.high)]
            need(all(dot(self.nu[i], self.nu[i]) * a * a <= self.mu[i] ** 2 for a in r), "nu is longer than mu")
            self.ends.append([[r[0] * a, r[1] * b] for a, b in zip(one[i], two[i], strict=True)])
        self.squares = [square(row) for row in equations(self.system, codes)]
        self.norms = [[length_of(self.system.S.tolist()[place]) for place in places] for places in self.system.tau]

    def psi(self, i, alpha):
        share = (alpha - self.low) / (self.high - self.low)
        return [a + share * (b - a) for a, b in self.ends[i]]

    def holds_along(self, box):
        natural, low, high = box.natural, self.low, self.high

        def holds(x, d, half, around, z):
            alpha = z[-1]
            if alpha < low or alpha > high:
                return True
            zeta = [a + arb(0, (half * abs(b) + c).upper()) for a, b, c in zip(x, d, around, strict=True)]
            y = [
                a
                + arb(
                    0,
                    (
                        (abs(dot(row, d)) * half).upper()
                        + sum((abs(b).upper() * c for b, c in zip(row, around, strict=True)), arb(0))
                    ).upper(),
                )
                for a, row in zip(natural.forces(x), natural.Y, strict=True)
            ]
            w = [(a - b) / s for a, b, s in zip(y, zeta, natural.steps, strict=False)]
            return self._definite(natural, y, w, z, alpha.intersection(low.union(high))) or None

        return holds

    def _definite(self, natural, y, w, z, alpha):
        system, m = self.system, self.system.m
        D, less = arb_mat(m, m), []
        for i, ((n, t), places) in enumerate(zip(natural.nodes, system.tau, strict=True)):
            F = natural.discs[i][0] + alpha * natural.discs[i][1]
            length = length_of([z[k] for k in t])
            if not self._has_statuses(self.codes[i], z[n], length, F if t else arb(0)):
                return False
            psi, rho = self._serving(i, [z[k] for k in t], w[n], [w[k] for k in t], F, z[n], length, alpha)
            D[i, i] = self.mu[i]
            for place, nu, value in zip(places, self.nu[i], psi, strict=True):
                D[i, place], D[place, place], D[place, i] = nu, self.kappa[i], -self.kappa[i] * value
            if rho is not None:
                s = self.kappa[i] * rho * length_of(self.norms[i])
                less.append((i, s, self.kappa[i] ** 2 * rho**2 / s))
        Q = D.transpose() * system.S
        Q = (Q + Q.transpose()) / arb(2)
        for i, s, factor in less:
            Q[i, i] -= s / 2
            for place in system.tau[i]:
                Q -= square(system.S.tolist()[place]) * (factor / 2)
        weight = _HEAVY * max(abs(value).upper() for value in Q.entries())
        for part in self.squares:
            Q += part * weight
        return is_definite(Q)

    def _has_statuses(self, code, normal, length, F):
        if code == 6:
            return True
        if code == 0:
            return normal <= 0
        return normal >= 0 and (code != 1 or length <= F * normal)

    def _serving(self, i, zt, normal, v, F, zn, length, alpha):
        """A psi that serves the solution, and by how much it may be off if nothing is known of it."""
        if not zt:
            return [], None
        r = self.system.radius(i, alpha)
        psi = self.psi(i, alpha)
        axis = self.graph.problem.axes[i][0]
        scale = arb(self.graph.problem.base[axis][i])
        v = [scale * value for value in v]
        if normal < 0 and length_of(psi) <= r:
            room = (self.mu[i] - r * length_of(self.nu[i])) * -normal
            if room >= self.kappa[i] * (r * length_of(v) - dot(psi, v)):
                return psi, None
        largest = length.max(F * zn)
        if largest > 0:
            return [r * value / largest for value in zt], None
        return psi, length_of(psi) + r
