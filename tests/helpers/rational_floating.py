"""[3.2] Bodies that nothing holds: condensed data, rows and exclusions in rational arithmetic, for rational_checker.

Nothing of enumsol is imported. Points are (lambda, -q). Numbers in brackets are sections of docs/proof_format.md.
"""

from fractions import Fraction
from itertools import chain, combinations
from math import inf, log2, nextafter

import numpy as np
from flint import fmpq, fmpq_mat
from rational_forms import Data, Forms, column_of, exact, matrix_of, need


class FloatingData(Data):
    """S and g of the body on springs, and G, h and the bounds of q."""

    def __init__(self, problem):
        modes = [[exact(value) for value in row] for row in problem.rigid_modes.tolist()]
        self.held = _pivots(modes)
        super().__init__(problem)
        B = matrix_of(np.vstack([problem.Bn.toarray(), problem.Bt.toarray()]))
        N = fmpq_mat(modes)
        self.G = (B * N).transpose().tolist()
        slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        self.h0, self.h1 = ((N.transpose() * matrix_of(load[:, None])).entries() for load in (problem.f, slope))
        inverse = fmpq_mat([modes[row] for row in self.held]).inv().tolist()
        self.bound = float(problem.rigid_reach)
        self.reach = [exact(_upward(exact(self.bound) * sum(map(abs, row), fmpq(0)))) for row in inverse]

    def stiffness(self, problem):
        """A + K."""
        A = matrix_of(problem.A.toarray())
        diagonal = [A[i, i] for i in range(problem.n)]
        most = max(map(abs, diagonal))
        for i in self.held:
            A[i, i] += diagonal[i] if diagonal[i] > 0 else most or fmpq(1)
        return A

    def unbalanced(self, codes, ends):
        """[7.3] Whether one z shows that no forces of a selection are in balance with the load between two alphas."""
        sides = {1: (1, -1), 2: (1,), 3: (-1,), 4: (0,)}
        loads, rays = [], []
        for alpha in ends:
            loads.append([a + alpha * b for a, b in zip(self.h0, self.h1, strict=True)])
            F = self.friction(alpha)
            for i, code in enumerate(codes):
                found = sides.get(code, ())
                rays += [[row[i] + side * F[i] * row[self.p + i] for row in self.G] for side in found]
        found = _rests([sum(pair) for pair in zip(*loads, strict=True)], rays)
        return any(all(_dot(z, h) > 0 for h in loads) and all(_dot(z, ray) <= 0 for ray in rays) for z in found)

    def forms(self, alpha):
        h = [a + alpha * b for a, b in zip(self.h0, self.h1, strict=True)]
        return FloatingForms(self.S, self.load(alpha), self.friction(alpha), self.G, h, self.reach)


def _rests(load, rays):
    """What is left of a load without its projections onto few of the rays; one of these rests is that of the cone."""
    for size in range(len(load)):
        for chosen in combinations(rays, size):
            table = [[_dot(a, b) for b in chosen] for a in chosen]
            shares = _solution(fmpq_mat(table), [_dot(ray, load) for ray in chosen]) if chosen else []
            if shares is not None:
                yield [
                    h - sum((x * ray[k] for x, ray in zip(shares, chosen, strict=True)), fmpq(0))
                    for k, h in enumerate(load)
                ]


def _pivots(modes):
    """Degrees of freedom found by elimination with complete pivoting, of the first by rows where several are equal."""
    columns = list(zip(*modes, strict=True))
    rest = [[value / max(map(abs, column)) for value in column] for column in columns]
    held, due = [], list(range(len(rest)))
    while due:
        _, row, k = max((abs(rest[k][i]), -i, -place) for place, k in enumerate(due) for i in range(len(modes)))
        pivot = rest[due.pop(-k)]
        need(pivot[-row] != 0, "the modes are dependent")
        held.append(-row)
        for other in due:
            factor = rest[other][-row] / pivot[-row]
            rest[other] = [x - factor * y for x, y in zip(rest[other], pivot, strict=True)]
    return sorted(held)


def _upward(value):
    nearest = float(Fraction(int(value.p), int(value.q)))
    return nearest if exact(nearest) >= value else nextafter(nearest, inf)


class FloatingForms(Forms):
    """Forms a'(lambda, -q) + a0 as lists of 2p + r + 1 numbers."""

    def __init__(self, S, g, F, G, h, reach, F_lo=None):
        none = [fmpq(0)] * len(h)
        bordered = [[*row, *column] for row, column in zip(S.tolist(), zip(*G, strict=True), strict=True)]
        super().__init__(fmpq_mat(bordered + [[*row, *none] for row in G]), [*g, *h], F, F_lo)
        self.own, self.G, self.h, self.reach = S, G, h, reach
        #: Units of length of the nodes, by which multipliers are changed.
        self.lengths = [fmpq(1)] * len(F)

    def equations(self, codes):
        return super().equations(codes) + [self.move(-1, 2 * self.p + j) for j in range(len(self.h))]

    def conditions(self, codes):
        return super().conditions(codes) + self.bounds()

    def bounds(self):
        """[7.3] rho - q of all modes, then rho + q."""
        found = []
        for side in (1, -1):
            for j, most in enumerate(self.reach, start=2 * self.p):
                found.append([fmpq(0)] * len(self.rows) + [most])
                found[-1][j] = fmpq(side)
        return found

    def excludes(self, terms):
        """(6.1), with the multipliers as they are or changed until G y = h."""
        return self._excludes(terms) or self._excludes(self._balanced(terms))

    def _excludes(self, terms):
        z = self.best(terms)
        return z is None or self.margin(terms, z) > 0

    def _gathered(self, terms):
        """v without G'z, what the multipliers add, and G y - h."""
        size = 2 * self.p
        v, constant = self.g[:size], fmpq(0)
        turn = [-x for x in self.h]
        for number, u in terms:
            *a, a0 = self.row(*divmod(number, self.p))
            v = [x + u * y for x, y in zip(v, a, strict=False)]
            # the coefficients of -q
            turn = [x + u * y for x, y in zip(turn, a[size:], strict=True)]
            constant += u * a0
        return v, constant, turn

    def best(self, terms, bend=0):
        """Where the concave function of z is stationary; None where it is not, and has no upper bound.

        Then some ``bend`` more makes it stationary at a z that is far along.
        """
        G, right = fmpq_mat(self.G), column_of(self._gathered(terms)[0])
        flat = G * self.own.solve(G.transpose())
        for j in range(len(self.h)):
            flat[j, j] += bend
        slope = (G * self.own.solve(right)).entries()
        return _solution(flat, [2 * x - y for x, y in zip(self.h, slope, strict=True)])

    def margin(self, terms, z):
        """By how much (6.1) holds."""
        v, constant, turn = self._gathered(terms)
        right = column_of(v) + fmpq_mat(self.G).transpose() * column_of(z)
        value = -constant - (right.transpose() * self.own.solve(right))[0, 0] / 4 + _dot(z, self.h)
        return value - _dot(self.reach, list(map(abs, turn)))

    def sums(self, terms):
        """y."""
        y = [fmpq(0)] * (2 * self.p)
        for number, u in terms:
            kind, i = divmod(number, self.p)
            if 4 <= kind <= 6:
                y[i if kind == 4 else self.p + i] += -u if kind == 5 else u
        return y

    def _balanced(self, terms):
        """Multipliers of the same signs with G y = h, or none."""
        y = self.sums(terms)
        G = fmpq_mat(self.G)
        bent = [[x / length for x, length in zip(row, 2 * self.lengths, strict=True)] for row in self.G]
        scaled = fmpq_mat([[x * abs(w) for x, w in zip(row, y, strict=True)] for row in bent])
        left = [a - b for a, b in zip(self.h, (G * column_of(y)).entries(), strict=True)]
        s = _solution(scaled * G.transpose(), left)
        if s is None:
            return []
        turned = (fmpq_mat(bent).transpose() * column_of(s)).entries()
        share = [x * (1 if w > 0 else -1) for x, w in zip(turned, y, strict=True)]
        if any(abs(x) >= 1 for x in share):
            return []
        found = []
        for number, u in terms:
            kind, i = divmod(number, self.p)
            place = i if kind == 4 else self.p + i
            found.append((number, u * (1 + share[place]) if 4 <= kind <= 6 else u))
        return found

    def beside(self, other, terms):
        """[7.2] Whether the multipliers exclude a leaf for all alpha between this one and another."""
        little, ends = fmpq(1, 2**40), (self, other)
        z = [form.best(terms) or form.best(terms, little) for form in ends]
        # multipliers far along z may help at one end and do harm at the other: others that are nearer, or farther
        beside = [[form.best(terms, fmpq(1, 2**k)) for form in ends] for k in (12, 60)]
        pairs = [z, *beside]
        tried = [[(x + y) / 2 for x, y in zip(*pair, strict=True)] for pair in pairs] + list(chain(*pairs))
        if any(min(form.margin(terms, one) for form in ends) > 0 for one in tried):
            return True
        turned = [form._balanced(terms) for form in (self, other)]
        if [] in turned:
            return False
        z = [
            form.best(changed) or form.best(changed, little)
            for form, changed in zip((self, other), turned, strict=True)
        ]
        size = 2 * self.p
        y = [self.sums(changed) for changed in turned]
        bend = _dot(_less(*y), _less(self.g[:size], other.g[:size])) + _dot(_less(*z), _less(self.h, other.h))
        margins = [form.margin(*given) for form, *given in zip((self, other), turned, z, strict=True)]
        return min(margins) > abs(bend) / 4

    def units(self, lengths):
        """Units of the rows of G."""
        found = []
        for row in self.G:
            most = max(abs(x) / length for x, length in zip(row, 2 * lengths, strict=True))
            found.append(fmpq(2) ** -round(log2(Fraction(int(most.p), int(most.q)))) if most else fmpq(1))
        return found

    def unbalanced(self, codes, z, lengths):
        """["i", [z]]"""
        need(len(z) == len(self.h), "a direction has another size")
        z = [exact(x) * unit for x, unit in zip(z, self.units(lengths), strict=True)]
        against = [
            sum((a * b for a, b in zip(z, column, strict=True)), fmpq(0)) for column in zip(*self.G, strict=True)
        ]
        if not sum((a * b for a, b in zip(z, self.h, strict=True)), fmpq(0)) > 0:
            return False
        for i, code in enumerate(codes):
            F = self.F[i]
            sides = {0: (), 1: (F, -F), 2: (F,), 3: (-F,), 4: (0,), 5: (F, -F), 6: (F, -F), 7: (F,), 8: (-F,)}[code]
            if any(against[i] + side * against[self.p + i] > 0 for side in sides):
                return False
        return True


def _dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), fmpq(0))


def _less(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def _solution(matrix, right):
    """A solution of a system that may be singular, or None."""
    table, rank = fmpq_mat([[*row, value] for row, value in zip(matrix.tolist(), right, strict=True)]).rref()
    found = [fmpq(0)] * len(right)
    for row in table.tolist()[:rank]:
        pivot = next(j for j, value in enumerate(row) if value != 0)
        if pivot == len(right):
            return None
        found[pivot] = row[-1]
    return found
