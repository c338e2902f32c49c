"""Forms of products, for space_judge: all solutions of an assignment in an ellipsoid.

Numbers in brackets are sections of docs/proof_format.md; the mathematics is in theory, section 12.11.
"""

from flint import arb, arb_mat, fmpq
from rational_forms import need
from space_judge_data import column, corner, following, holds, is_definite, length_of, sector_of

_HEAVY = arb(2) ** 80


class ProductForm:
    """[6.2] u' K u - 2 h' u + k, y = point + u, which is not positive at any solution in an assignment."""

    def __init__(self, system, codes, point, multipliers, force, length):
        self.system, self.codes, self.point = system, codes, point
        self.moves = (column(system.g0) - system.S * column(point)).entries()
        #: products are those of numbers in the units of the file
        self.force, self.length = force, length
        m = system.m
        self.K, self.h, self.k = arb_mat(m, m), [arb(0)] * m, arb(0)
        left = list(multipliers)
        for i, code in enumerate(codes):
            if len(system.tau[i]) == 2:
                for product, many in self.products(i, code):
                    values, left = left[:many], left[many:]
                    need(len(values) == many, "too few multipliers")
                    self.add(product(values))
        need(not left, "too many multipliers")
        weight = _HEAVY * max(*(abs(x).upper() for x in self.K.entries()), arb(2) ** (-200))
        for form in self.equations():
            size = length_of(form[0])
            self.add([(weight / size**2, form, form)])
        need(is_definite(self.K), "a form of products is not definite")
        self.inverse = self.K.inv()
        self.centre = (self.inverse * column(self.h)).entries()
        self.least = self.k - sum((a * b for a, b in zip(self.centre, self.h, strict=True)), arb(0))

    # -- linear forms: rows and constants ------------------------------------------------------------------------------

    def y(self, place):
        unit = 1 / self.force[self.system.node_of[place]]
        return [unit if k == place else arb(0) for k in range(self.system.m)], self.point[place] * unit

    def w(self, place):
        unit = 1 / self.length[self.system.node_of[place]]
        return [-self.system.S[place, k] * unit for k in range(self.system.m)], self.moves[place] * unit

    def add(self, terms):
        """Weights times products of two linear forms."""
        for weight, (a, a0), (b, b0) in terms:
            outer = column(a) * arb_mat([b])
            self.K += (outer + outer.transpose()) * (weight / 2)
            for j in range(self.system.m):
                self.h[j] -= weight * (a0 * b[j] + b0 * a[j]) / 2
            self.k += weight * a0 * b0

    def equations(self):
        for i, code in enumerate(self.codes):
            places = self.system.tau[i]
            if code == 0:
                yield from (self.y(place) for place in (i, *places))
                continue
            yield self.w(i)
            if code == 1:
                yield from (self.w(place) for place in places)
            elif code in (2, 3):
                yield _sum((1, self.y(places[0])), (-1 if code == 2 else 1, self.y(i)))

    def products(self, i, code):
        """What is not negative at solutions, and how many multipliers it takes; with the terms of minus the sum."""
        if code == 0:
            return
        n, (x, y) = self.y(i), (self.y(place) for place in self.system.tau[i])
        v, u = (self.w(place) for place in self.system.tau[i])
        number = sector_of(code)

        def disc(values):
            need(number or values[0] >= 0, "a multiplier has the wrong sign")
            return [(-values[0], n, n), (values[0], x, x), (values[0], y, y)]

        yield disc, 1
        if code == 1:
            return
        yield (lambda values: [(-values[0], x, u), (values[0], y, v)]), 1
        if code == 5:

            def cone(values):
                kappa, *c = values
                need(kappa >= length_of(c), "a multiplier is less than the length of two")
                return [(-kappa, x, v), (-kappa, y, u), (c[0], n, v), (c[1], n, u)]

            yield cone, 3
            return
        (a, b), (c, d) = ([arb(z) for z in ends] for ends in (corner(number), corner(following(number))))

        def sides(values):
            need(values[0] >= 0, "a multiplier has the wrong sign")
            return [(-values[0], _sum((a, u), (-b, v)), _sum((d, v), (-c, u)))]

        yield sides, 1
        for k in range(5):
            s = arb(fmpq(k, 4))
            p, q = (1 - s) * a + s * c, (1 - s) * b + s * d
            size = length_of([p, q])

            def along(values, p=p / size, q=q / size):
                need(values[0] >= 0, "a multiplier has the wrong sign")
                return [(-values[0], x, v), (-values[0], y, u), (values[0], n, _sum((p, v), (q, u)))]

            yield along, 1

    # -- what follows --------------------------------------------------------------------------------------------------

    @property
    def is_empty(self):
        return self.least > 0

    def about(self, row, constant):
        """A linear form in y as one in u."""
        return row, constant + sum((a * b for a, b in zip(row, self.point, strict=True)), arb(0))

    def bounds(self, form):
        """Of a linear form at all solutions."""
        a, a0 = form
        at = a0 + sum((x * y for x, y in zip(a, self.centre, strict=True)), arb(0))
        square = (arb_mat([a]) * self.inverse * column(a))[0, 0] * -self.least
        return at + arb(0, abs(square).upper().sqrt().upper())

    def serves(self, codes):
        """Whether it is about all that an assignment allows."""
        for mine, code in zip(self.codes, codes, strict=True):
            inner, outer = sector_of(code), sector_of(mine)
            contact = mine == 5 and code not in (0, 6)
            if not (mine == code or contact or (inner and outer and holds(outer, inner))):
                return False
        return True

    def excludes(self, codes):
        """[6.2] No solution of an assignment lies in the ellipsoid."""
        if self.is_empty:
            return True
        for i, (mine, code) in enumerate(zip(self.codes, codes, strict=True)):
            if mine == code:
                continue
            if code == 1 and any(not self.bounds(self.w(place)).contains(0) for place in self.system.tau[i]):
                return True
            number = sector_of(code)
            if number:
                (a, b), (c, d) = ([arb(z) for z in ends] for ends in (corner(number), corner(following(number))))
                for part in (self.y, self.w):
                    x, y = (part(place) for place in self.system.tau[i])
                    sides = _sum((a, y), (-b, x)), _sum((d, x), (-c, y))
                    if any(self.bounds(side) < 0 for side in sides):
                        return True
        return False


def _sum(*parts):
    """A sum of linear forms with weights."""
    row = [
        sum((w * x for (w, _), x in zip(parts, column_, strict=True)), arb(0))
        for column_ in zip(*(form[0] for _, form in parts), strict=True)
    ]
    return row, sum((w * form[1] for w, form in parts), arb(0))
