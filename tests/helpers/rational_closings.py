"""[6.5] Leaves that close a subtree by its only possible solution, for rational_checker, in rationals.

Nothing of enumsol is imported. That a solution is the only one is not believed because a form is definite: all
selections of the free nodes are tried as well. Numbers in brackets are sections of docs/proof_format.md.
"""

from itertools import product

from flint import fmpq, fmpq_mat
from rational_forms import _value, as_point, column_of, exact, integer, need

FINAL = {True: (0, 1, 2, 3), False: (0, 4)}
SIDES = {7: (0, 2), 8: (0, 3)}
KINDS = {0: (4,), 1: (0, 2, 3), 2: (0, 5), 3: (0, 6), 4: (0,)}


class Closings:
    """The closed subtrees of one proof."""

    def __init__(self, forms, friction, units):
        self.forms, self.friction, self.p = forms, friction, forms.p
        self.unit = [length / force for length, force in zip(*units, strict=True)]
        self.points = {}

    def leaf(self, codes, selection, free, numbers, mid, rad=None, index=None):
        self.check(selection, free, codes)
        core = tuple(6 if i in free else code for i, code in enumerate(selection))
        reduced = Reduced(self.forms, core, self.friction)
        numbers = self.numbers(numbers, selection, reduced)
        points = reduced.solutions()
        need(len(points) == 1, "a reduced problem has no solution or several")
        (point,) = points
        self.serves(numbers, reduced, point)
        need(len(mid) == 2 * self.p, "a point has another size")
        values = [value for i in reduced.fixed for value in self.conditions(core[i], i, point)]
        values += [self.slides(core[i], i, point) for i in reduced.sliding]
        if rad is None:
            need(any(value < 0 for value in values), "no condition is broken")
            return
        need(all(value > 0 for value in values), "a condition is not strict")
        need(len(rad) == 2 * self.p, "an enclosure has another size")
        for x, m, r in zip(point, map(exact, mid), map(exact, rad), strict=True):
            need(abs(x - m) <= r, "an enclosure misses the root")
        need(integer(index) == (1 if reduced.determinant > 0 else -1), "an index is wrong")
        self.points[as_point(point)] = point

    def exact_leaf(self, codes, selection, given, numbers, count):
        """The selection as a polytope to be counted, if the leaf holds its solution."""
        need(list(map(integer, given)) == [i for i, code in enumerate(codes) if code in (5, 6)], "other nodes are free")
        free, sliding = ([i for i, code in enumerate(codes) if code in some] for some in ((5, 6), (7, 8)))
        refined = [selection[i] if selection[i] in SIDES.get(code, ()) else code for i, code in enumerate(codes)]
        self.check(selection, free, refined)
        need(max(selection) < 5, "a selection is not complete")
        equations = self.forms.equations(selection)
        N = fmpq_mat([form[:-1] for form in equations])
        need(N.det() != 0, "a selection is singular")
        point = N.solve(column_of([-form[-1] for form in equations])).entries()
        core = tuple(6 if i in free else codes[i] if i in sliding else c for i, c in enumerate(selection))
        reduced = Reduced(self.forms, core, self.friction)
        self.serves(self.numbers(numbers, selection, reduced), reduced, point)
        holds = {i: min(self.conditions(selection[i], i, point)) >= 0 for i in range(self.p)}
        need(all(holds[i] for i in free), "the reduced problem has another solution")
        need([as_point(x) for x in reduced.solutions()] == [as_point(point)], "a reduced problem has several solutions")
        touching = all(self.values(point, i)[2] == 0 for i in free if codes[i] == 5)
        need(integer(count) == int(touching and all(holds.values())), "a leaf holds another number of roots")
        return [(tuple(selection), 0)] if count else []

    def alone(self, codes, selection, numbers, strengths, terms):
        """A root that is the only one below an assignment."""
        need(len(selection) == self.p, "a selection has another size")
        for i, code in enumerate(selection):
            need(integer(code) in self.below(codes[i], i), "a selection is none below its assignment")
        equations = self.forms.equations(selection)
        N = fmpq_mat([form[:-1] for form in equations])
        need(N.det() != 0, "a selection is singular")
        point = N.solve(column_of([-form[-1] for form in equations])).entries()
        need(all(_value(form, point) > 0 for form in self.forms.conditions(selection)), "a condition is not strict")
        lone = Lone(self.forms, codes, self.friction)
        nodes, own = lone.nodes, lone.own
        numbers = [exact(value) for value in numbers]
        need(len(numbers) == len(nodes) + 3 * len(own), "there are not as many numbers as a form has")
        mu, rest = dict(zip(nodes, numbers, strict=False)), numbers[len(nodes) :]
        kappa, nu, share = (dict(zip(own, rest[k * len(own) :], strict=False)) for k in range(3))
        need(all(value > 0 for value in [*mu.values(), *kappa.values()]), "a number is not positive")
        theta = {}
        for i in own:
            F, (n, t, w_n, w_t) = self.forms.F[i], self.values(point, i)
            need(abs(nu[i]) * F <= mu[i] and abs(share[i]) <= 1, "a number is too large")
            need(selection[i] not in (2, 3) or share[i] == 5 - 2 * selection[i], "theta does not serve slip")
            theta[i] = t / n if n > 0 else share[i] * F
            if n == 0:
                need((mu[i] + nu[i] * F) * -w_n >= kappa[i] * (F - theta[i]) * w_t, "theta does not serve slip+")
                need((mu[i] - nu[i] * F) * -w_n >= kappa[i] * (F + theta[i]) * -w_t, "theta does not serve slip-")
        need(len(strengths) == 2 * self.p, "there are not as many strengths as components")
        z = [exact(value) / self.unit[k % self.p] for k, value in enumerate(strengths)]
        need(min(z) >= 0 and all(codes[i] == 1 or z[self.p + i] == 0 for i in range(self.p)), "a strength is wrong")
        for i in range(self.p):
            if z[i] > 0 and codes[i] > 5:
                need(selection[i] != 0, "an open node has no force to lose")
                spare = mu[i] * point[i] + nu.get(i, 0) * point[self.p + i]
                gap, square = lone.gap(terms, i)
                need(spare >= z[i] * gap and (spare - z[i] * gap) ** 2 >= z[i] ** 2 * square, "a strength is too large")
        need(lone.definite(mu, kappa, nu, theta, z), "a form is not definite")
        # which is not believed
        for other in product(*(self.below(code, i) for i, code in enumerate(codes))):
            need(other == tuple(selection) or not self.forms.hull(other), "there is another solution")

    def below(self, code, i):
        return {5: (1, 2, 3), 6: FINAL[bool(self.friction[i])], **SIDES}.get(code, (code,))

    def apart(self, others):
        """[5.4] How many closed roots solve none of these selections."""
        return sum(not any(self.solves(codes, point) for codes in others) for point in self.points.values())

    def solves(self, codes, point):
        equations = all(_value(form, point) == 0 for form in self.forms.equations(codes))
        return equations and all(_value(form, point) >= 0 for form in self.forms.conditions(codes))

    def check(self, selection, free, codes):
        need(len(selection) == self.p, "a selection has another size")
        for i, code in enumerate(selection):
            slides = code in SIDES and i not in free and self.friction[i]
            need(integer(code) in FINAL[bool(self.friction[i])] or slides, "a node cannot have its code")
            need(i in free or codes[i] in (code, *SIDES.get(code, ())), "a fixed node has another code")
        need(list(free) == sorted({integer(i) for i in free if 0 <= i < self.p}), "free nodes are out of order")

    def numbers(self, numbers, selection, reduced):
        """mu, kappa, nu, theta / F and tau by nodes; what is asked of them without a solution."""
        m, rubbing = len(reduced.free), reduced.rubbing
        need(len(numbers) == m + 4 * len(rubbing), "there are not as many numbers as a form has")
        numbers = [exact(value) for value in numbers]
        mu = dict(zip(reduced.free, numbers[:m], strict=True))
        parts = [numbers[m + k * len(rubbing) : m + (k + 1) * len(rubbing)] for k in range(4)]
        kappa, nu, share, tau = (dict(zip(rubbing, part, strict=True)) for part in parts)
        need(all(value > 0 for value in [*mu.values(), *kappa.values()]), "a number is not positive")
        for i in rubbing:
            need(abs(nu[i]) * self.forms.F[i] <= mu[i], "nu is too large")
            need(abs(share[i]) <= 1, "theta is too large")
            need(selection[i] not in (2, 3) or share[i] == 5 - 2 * selection[i], "theta does not serve slip")
            need(tau[i] >= 0 and (tau[i] == 0 or share[i] == 0), "tau is wrong")
        return mu, kappa, nu, share, {i: value * self.unit[i] for i, value in tau.items()}

    def serves(self, numbers, reduced, point):
        """Whether the form is definite with what theta has to be at a solution."""
        mu, kappa, nu, share, tau = numbers
        theta = {}
        for i in reduced.rubbing:
            F, (n, t, w_n, w_t) = self.forms.F[i], self.values(point, i)
            theta[i] = share[i] * F
            if tau[i] > 0:
                continue
            if n > 0:
                theta[i] = t / n
            else:
                need((mu[i] + nu[i] * F) * -w_n >= kappa[i] * (F - theta[i]) * w_t, "theta does not serve slip+")
                need((mu[i] - nu[i] * F) * -w_n >= kappa[i] * (F + theta[i]) * -w_t, "theta does not serve slip-")
        need(reduced.definite(mu, kappa, nu, theta, tau), "a form is not definite")

    def values(self, point, i):
        w = [_value(self.forms.move(1, k), point) for k in (i, self.p + i)]
        return point[i], point[self.p + i], *w

    def slides(self, code, i, point):
        """Positive where the node is open or slips to its side, strictly; negative where it must and does not."""
        n, _, w_n, w_t = self.values(point, i)
        slip = w_t if code == 7 else -w_t
        return -w_n if w_n < 0 else slip if slip > 0 or n > 0 else fmpq(0)

    def conditions(self, code, i, point):
        return [_value(self.forms.row(kind, i), point) for kind in KINDS[code]]


class Lone:
    """Components of lambda that an assignment leaves: d with lambda_t = +-F lambda_n put in, and no open nodes."""

    def __init__(self, forms, codes, friction):
        self.forms, p = forms, forms.p
        self.nodes = [i for i, code in enumerate(codes) if code != 0]
        self.own = [i for i in self.nodes if friction[i] and codes[i] in (1, 5, 6)]
        self.columns = []
        for i in self.nodes:
            side = {2: 1, 7: 1, 3: -1, 8: -1}.get(codes[i], 0)
            self.columns.append({i: fmpq(1), p + i: side * forms.F[i]})
        self.columns += [{p + i: fmpq(1)} for i in self.own]

    def moved(self, k):
        """(S d)_k as a form of the components."""
        return [sum((x * self.forms.rows[k][j] for j, x in column.items()), fmpq(0)) for column in self.columns]

    def gap(self, terms, i):
        """What -w_n of a node is at most, less a root; and what is under the root."""
        v, constant = list(self.forms.g), fmpq(0)
        for number, u in terms:
            *a, a0 = self.forms.row(*divmod(number, self.forms.p))
            v = [x + u * y for x, y in zip(v, a, strict=True)]
            constant += u * a0
        middle = [x / 2 for x in self.forms.S.solve(column_of(v)).entries()]
        least = -constant - sum((x * y for x, y in zip(v, middle, strict=True)), fmpq(0)) / 2
        return -_value(self.forms.move(1, i), middle), max(-least, fmpq(0)) * self.forms.rows[i][i]

    def definite(self, mu, kappa, nu, theta, z):
        size, p = len(self.columns), self.forms.p
        Q = [[fmpq(0)] * size for _ in range(size)]

        def add(left, right):
            for a in range(size):
                for b in range(size):
                    Q[a][b] += (left[a] * right[b] + left[b] * right[a]) / 2

        place = {i: k for k, i in enumerate(self.nodes)} | {p + i: len(self.nodes) + k for k, i in enumerate(self.own)}
        for i in self.nodes:
            n, r = [fmpq(0)] * size, self.moved(i)
            n[place[i]] = mu[i]
            if i in theta:
                n[place[p + i]] = nu[i]
                t = [fmpq(0)] * size
                t[place[i]], t[place[p + i]] = -kappa[i] * theta[i], kappa[i]
                add(t, self.moved(p + i))
            add(n, r)
            for k in (i, p + i):
                add([z[k] * x for x in self.moved(k)], self.moved(k))
        return all(fmpq_mat([row[:k] for row in Q[:k]]).det() > 0 for k in range(1, size + 1))


class Reduced:
    """w = h - R x on the free and the sliding nodes of a core."""

    def __init__(self, forms, core, friction):
        self.forms, self.core, self.friction, p = forms, core, friction, forms.p
        self.sliding = [i for i, code in enumerate(core) if code in SIDES]
        self.fixed = [i for i, code in enumerate(core) if code < 5]
        self.free = [i for i, code in enumerate(core) if code == 6] + self.sliding
        self.rubbing = [i for i in self.free if friction[i] and core[i] == 6]
        self.places = self.free + [p + i for i in self.rubbing]
        # lambda as a function of x: the free components are set, and lambda_t -+ F lambda_n = 0 where a node slides
        rows = forms.equations([0 if code > 5 else code for code in core])
        for i in self.sliding:
            rows[p + i] = forms.force(-forms.F[i] if core[i] == 7 else forms.F[i], 1, i)
        N = fmpq_mat([row[:-1] for row in rows])
        self.determinant = N.det()
        need(self.determinant != 0, "the fixed nodes' equations are singular")
        sides = [[-row[-1] for row in rows]] + [[fmpq(int(k == place)) for k in range(2 * p)] for place in self.places]
        solved = N.solve(fmpq_mat(sides).transpose()).transpose().tolist()
        self.R = [[-_value(forms.move(1, k), x, 0) for x in solved[1:]] for k in self.places]

    def definite(self, mu, kappa, nu, theta, tau):
        size = len(self.places)
        rows = [[mu[i] * value for value in self.R[k]] for k, i in enumerate(self.free)]
        losses = []
        for k, i in enumerate(self.rubbing, start=len(self.free)):
            n = self.free.index(i)
            r = [kappa[i] * value for value in self.R[k]]
            rows[n] = [a - theta[i] * b for a, b in zip(rows[n], r, strict=True)]
            rows.append([nu[i] * a + b for a, b in zip(self.R[n], r, strict=True)])
            if tau[i] > 0:
                losses.append((n, tau[i] / 2, r, self.forms.F[i] ** 2 / tau[i] / 2))
        Q = [[(rows[a][b] + rows[b][a]) / 2 for b in range(size)] for a in range(size)]
        for n, half, r, factor in losses:
            Q[n][n] -= half
            Q = [[q - factor * r[a] * r[b] for b, q in enumerate(row)] for a, row in enumerate(Q)]
        return all(fmpq_mat([row[:k] for row in Q[:k]]).det() > 0 for k in range(1, size + 1))

    def solutions(self):
        """All vertices of the solution sets over the selections of the free nodes."""
        found = set()
        for chosen in product(*(SIDES.get(self.core[i]) or FINAL[bool(self.friction[i])] for i in self.free)):
            codes = list(self.core)
            for i, code in zip(self.free, chosen, strict=True):
                codes[i] = code
            kinds = {i: (4,) if codes[i] == 0 else (0,) for i in self.sliding}
            given = [self.forms.row(kind, i) for i in self.free for kind in kinds.get(i, KINDS[codes[i]])]
            found.update(self.forms.vertices(self.forms.equations(codes), given))
        return [[fmpq(*x.as_integer_ratio()) for x in point] for point in sorted(found)]
