"""[7.2, m] Pieces of graph proofs that are closed by their arcs, for rational_checker.

Nothing of enumsol is imported. That a solution is the only one is not believed because a form is definite: at some
alphas of every piece all selections are tried as well. Numbers in brackets are sections of docs/proof_format.md.
"""

from functools import cached_property
from itertools import islice, product

from flint import fmpq, fmpq_mat, fmpq_poly
from rational_forms import Forms, Refused, _value, exact, need
from rational_references import FINAL, Reference
from rational_zeros import cells, interpolated, one_sign

#: Alphas of a piece at which all selections are tried, as shares of its length.
TRIED = [fmpq(0), fmpq(1, 3), fmpq(1, 2), fmpq(13, 17), fmpq(1)]
#: How often an interval is halved for another theta of open nodes; choices of these that are tried on each.
HALVINGS, MOST_CHOICES = 12, 16


def poly(*coefficients):
    return fmpq_poly(list(coefficients))


def nowhere_negative(f, x, y):
    return all(point.sign_of(f) >= 0 for point in cells([f], x, y))


class ClosedPiece:
    """A form of arcs over the piece [x, y], and the leaves that refer to it: kind, codes, and what else they say."""

    def __init__(self, data, x, y, mu, kappa, nu):
        self.data, self.x, self.y, self.p = data, x, y, data.p
        need([len(values) for values in (mu, kappa, nu)] == [data.p] * 3, "a form has another size")
        self.mu, self.kappa, self.nu = (list(map(exact, values)) for values in (mu, kappa, nu))
        need(min(self.mu + self.kappa) > 0, "a number is not positive")
        ends = data.friction(x), data.friction(y)
        for F in ends:
            need(all(abs(n) * f <= m for n, f, m in zip(self.nu, F, self.mu, strict=True)), "nu is too large")
        self.rubbing = [i for i, pair in enumerate(zip(*ends, strict=True)) if max(pair) > 0]
        self.leaves = []

    def check(self, traces, pairs, origin):
        """Whether all its solutions lie on the arcs of some traces; pairs are partners among their events."""
        side = 0 if origin is None else 1 if self.y > origin else -1
        led = self._led([trace for trace in traces if trace.side == side], pairs)
        for selection, x, y in led:
            need(self._alone(_Along(self, selection), x, y, HALVINGS), "a form is not definite")
        self._tried([selection.codes for selection, *_ in led], side)

    def _led(self, traces, pairs):
        """[first item] Selections with intervals on which they have solutions where they are needed."""
        held = []
        for trace in traces:
            for kind, x, y, first, last, rising in trace.present:
                # where the selection has a solution for sure
                low, high = (x, y) if kind == "h" else (last, y) if rising else (x, first)
                held.append((low, high, [(trace.selection, low, high)]))
        for one, other in pairs:
            ends, begins = (other, one) if one[6] else (one, other)
            if begins[6] and not ends[6]:  # up to their common zero the one, then the other
                (a, _, x, _, first, last, *_), (b, _, _, y, first2, last2, *_) = ends, begins
                zero = max(first, first2), min(last, last2)
                held.append((x, y, [(a.selection, x, zero[1]), (b.selection, zero[0], y)]))
        found, reached = [], self.x
        while True:
            going = [entry for entry in held if entry[0] <= reached <= entry[1]]
            need(going, "no arcs lead through a piece")
            _, high, parts = max(going, key=lambda entry: entry[1])
            needed = [(selection, max(start, reached), min(end, self.y)) for selection, start, end in parts]
            found += [part for part in needed if part[1] <= part[2]]
            if high >= self.y:
                return found
            need(high > reached, "no arcs lead through a piece")
            reached = high

    def _alone(self, along, x, y, halvings):
        """[second item] Whether Q is definite at all alphas from x to y."""
        choices = [along.chosen(i, x, y) for i in along.opened]
        for chosen in islice(product(*choices), MOST_CHOICES):
            if along.definite(chosen, x, y):
                return True
        if x == y or not halvings:
            return False
        middle = (x + y) / 2
        return self._alone(along, x, middle, halvings - 1) and self._alone(along, middle, y, halvings - 1)

    def _tried(self, codes, side):
        """[7.4] Whether there is one solution at some alphas, and one of these selections has it."""
        for share in TRIED:
            alpha = self.x + share * (self.y - self.x)
            g = self.data.load(alpha) if not side else [side * value for value in self.data.g1]
            F = self.data.friction(alpha)
            forms = Forms(self.data.S, g, F)
            found = set()
            for selection in product(*((0, 1, 2, 3) if value > 0 else (0, 4) for value in F)):
                found.update(forms.hull(selection))
            need(len(found) == 1, "a piece has several solutions")
            point = [fmpq(*value.as_integer_ratio()) for value in found.pop()]
            need(any(self._solves(forms, each, point) for each in codes), "the solution lies on no arc")

    @staticmethod
    def _solves(forms, codes, point):
        equations = all(_value(form, point) == 0 for form in forms.equations(codes))
        return equations and all(_value(form, point) >= 0 for form in forms.conditions(codes))


class FloatingPiece(ClosedPiece):
    """The same of a body that nothing holds, with leaves o and i.

    The forms of its leaves are tested at some alphas, with the root that the arcs have there.
    """

    def __init__(self, data, x, y, mu, kappa, nu, more):
        super().__init__(data, x, y, mu, kappa, nu)
        need(len(more) == 3 and exact(more[2]) in range(1, 33), "a form has another size, or no degree")
        self.balance, self.share = more[0], more[1]

    def check(self, traces, pairs, origin):
        found = self._led(traces, pairs)
        led = [selection.codes for selection, *_ in found]
        final = [FINAL[i in self.rubbing] for i in range(self.p)]
        for kind, codes, *rest in self.leaves:
            if kind == "i":
                forms = (self.data.forms(alpha) for alpha in (self.x, self.y))
                balanced = [not form.unbalanced(codes, rest[0], self.scale[0]) for form in forms]
                need(not any(balanced), "forces of a leaf may be in balance with the load")
        # every selection that leads through the piece has its turn
        alphas = [self.x + share * (self.y - self.x) for share in TRIED] + [(x + y) / 2 for _, x, y in found]
        for alpha in dict.fromkeys(alphas):
            self._roots_at(alpha, led, list(product(*final)))

    def _roots_at(self, alpha, led, selections):
        forms = self.data.forms(alpha)
        found = {codes: points for codes in selections if (points := forms.hull(codes))}
        need(len({point for points in found.values() for point in points}) == 1, "a piece has several solutions")
        need(set(led) & set(found), "the solution lies on no arc")
        # where several selections hold, it is at an event
        for codes in found if len(found) == 1 else ():
            self._leaves_at(forms, codes)

    def _leaves_at(self, forms, selection):
        rubbing, sides = self.rubbing, {2: (1,), 3: (-1,), 1: (0,), 0: (0, 1, -1)}
        rubs = [i in rubbing for i in range(self.p)]
        for chosen in product(*(sides[selection[i]] for i in rubbing)):
            weights = [*self.mu, *(values[i] for values in (self.kappa, self.nu) for i in rubbing), *map(fmpq, chosen)]
            reference = Reference(forms, rubs, self.scale, selection, weights, exact(self.balance), exact(self.share))
            try:
                _ = reference.numbers
            except Refused:
                continue
            for kind, codes, *rest in self.leaves:
                if kind == "o":
                    reference.check(codes, *rest[1:])
            return
        need(False, "no theta serves a solution")


class _Along:
    """The form of a piece with the solution of a selection, as polynomials in alpha."""

    def __init__(self, piece, selection):
        self.piece, self.codes, self.selection = piece, selection.codes, selection
        self.opened = [i for i in piece.rubbing if self.codes[i] == 0]
        self._forms = {}

    @cached_property
    def _solved(self):
        """det N, and its products with lambda and with w_n and w_t of all nodes."""
        p, data, selection = self.piece.p, self.piece.data, self.selection
        determinant, products = selection.own.determinant, selection.own.products
        g = [poly(a, b) for a, b in zip(data.g0, data.g1, strict=True)]
        if selection.side:
            g = [poly(selection.side * value) for value in data.g1]
        w = []
        for k, row in enumerate(data.S.tolist()):
            w.append(g[k] * determinant - sum((poly(s) * x for s, x in zip(row, products, strict=True)), poly(0)))
        return determinant, products, w[:p], w[p:]

    def _friction(self, i):
        return poly(self.piece.data.F0[i], self.piece.data.F1[i])

    def chosen(self, i, x, y):
        """[second item] What theta / F may be at an open node."""
        piece, (determinant, _, normal, tangential) = self.piece, self._solved
        orientation = one_sign(determinant, x, y)
        gap, slip, F = poly(-orientation) * normal[i], poly(orientation) * tangential[i], self._friction(i)
        room = (poly(piece.mu[i]) - poly(abs(piece.nu[i])) * F) * gap
        moved = poly(piece.kappa[i]) * F * slip
        found = [0] if nowhere_negative(room - moved, x, y) and nowhere_negative(room + moved, x, y) else []
        return found + [side for side in (1, -1) if nowhere_negative(poly(side) * slip, x, y)]

    def definite(self, chosen, x, y):
        """Whether Q is positive definite from x to y with such theta of the open nodes."""
        # lambda_n > 0 where a node sticks
        determinant, products, *_ = self._solved
        orientation = one_sign(determinant, x, y)
        loaded = [products[i] for i in self.piece.rubbing if self.codes[i] == 1]
        if not orientation or any(one_sign(value, x, y) != orientation for value in loaded):
            return False
        if chosen not in self._forms:
            self._forms[chosen] = self._form(chosen)
        form, whole = self._forms[chosen]
        # it stays definite on its way from x as long as its determinant does not vanish
        return one_sign(whole, x, y) > 0 and _definite(form(x))

    def _form(self, chosen):
        """A matrix congruent to Q as a function of alpha, and its determinant."""
        piece, (_, products, *_), p = self.piece, self._solved, self.piece.p
        S, sides = piece.data.S.tolist(), dict(zip(self.opened, chosen, strict=True))
        sides |= {i: {2: 1, 3: -1}[self.codes[i]] for i in piece.rubbing if self.codes[i] in (2, 3)}
        #: rows and columns of sticking nodes' lambda_n are multiplied by det N lambda_n; theta by the same
        scale = [products[i] if i in piece.rubbing and self.codes[i] == 1 else poly(1) for i in range(p)]
        scale += [poly(1)] * p
        theta = [poly(0)] * p
        for i in piece.rubbing:
            theta[i] = products[p + i] if self.codes[i] == 1 else poly(sides[i]) * self._friction(i)
        kept = [*range(p), *(p + i for i in piece.rubbing)]

        def form(alpha):
            rows = []
            for k in kept:
                i = k % p
                mu, kappa, nu = piece.mu[i], piece.kappa[i], piece.nu[i]
                normal, tangential = (mu * scale[i](alpha), -kappa * theta[i](alpha)) if k < p else (nu, kappa)
                rows.append([(normal * S[i][m] + tangential * S[p + i][m]) * scale[m](alpha) for m in kept])
            return fmpq_mat([[(rows[a][b] + rows[b][a]) / 2 for b in range(len(kept))] for a in range(len(kept))])

        degrees = [max(scale[i].degree(), theta[i].degree(), 0) for i in range(p)]
        return form, interpolated([form(fmpq(k)).det() for k in range(2 * sum(degrees) + 1)])


def _definite(Q):
    rows = Q.tolist()
    return all(fmpq_mat([row[:k] for row in rows[:k]]).det() > 0 for k in range(1, len(rows) + 1))
