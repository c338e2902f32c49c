"""[6.7] Roots that are declared, and leaves that leave no other root, for rational_checker, in rationals.

Nothing of enumsol is imported. That a root is the only one is not believed because a form is definite: of small
problems all selections are tried as well. Numbers in brackets are sections of docs/proof_format.md.
"""

from functools import cached_property
from itertools import product

import numpy as np
from flint import fmpq, fmpq_mat
from rational_forms import _affine, _value, column_of, exact, integer, need

FINAL = {True: (0, 1, 2, 3), False: (0, 4)}
#: [4.4] By codes, what rows of the kinds 4, 5 and 6 are.
MOVES = {0: "+..", 1: "EEE", 2: "E+.", 3: "E.+", 4: "E..", 5: "E..", 6: "+..", 7: "+..", 8: "+.."}
OPPOSITE = {5: 6, 6: 5}
SPLITS = {5: (1, 2, 3), 6: (0, 1, 2, 3, 4), 7: (0, 2), 8: (0, 3)}
#: So many selections are tried.
MOST_SELECTIONS = 64


class References:
    """The roots that one proof declares."""

    def __init__(self, forms, friction, scale):
        self.forms, self.friction, self.scale = forms, friction, scale
        self.declared = []

    def declare(self, selection, weights, balance, share):
        need(len(selection) == len(self.friction), "a selection has another size")
        for code, friction in zip(selection, self.friction, strict=True):
            need(integer(code) in FINAL[friction], "a node cannot have its code")
        weights, balance, share = [exact(value) for value in weights], exact(balance), exact(share)
        need(len(weights) == len(selection) + 3 * sum(self.friction), "there are not as many weights as a form has")
        self.declared.append(Reference(self.forms, self.friction, self.scale, selection, weights, balance, share))

    def leaf(self, codes, back, rows, pairs, claimed):
        """Check a leaf; the selection of the root if it lies below the assignment, else None."""
        need(1 <= integer(back) <= len(self.declared), "a root was not declared")
        reference = self.declared[-back]
        below = all(own == code or own in SPLITS.get(code, ()) for own, code in zip(reference.own, codes, strict=True))
        need(below == claimed, "an enclosure is missing" if below else "a root lies elsewhere")
        reference.check(codes, rows, pairs)
        for selection in self.held:
            beneath = (own == code or own in SPLITS.get(code, ()) for own, code in zip(selection, codes, strict=True))
            need(selection == reference.own or not all(beneath), "there is another solution")
        return reference.own if below else None

    @cached_property
    def held(self):
        """Selections that hold solutions, of small problems: what they say is believed rather than forms."""
        final = [FINAL[friction] for friction in self.friction]
        if len(FINAL[True]) ** len(final) > MOST_SELECTIONS:
            return []
        return [selection for selection in product(*final) if self.forms.hull(selection)]


class Reference:
    """A root and its form, in the units of the header; tested where a leaf refers to it."""

    def __init__(self, forms, friction, scale, selection, weights, balance, share):
        self.forms, self.friction, self.p = forms, friction, forms.p
        self.own, self.weights, self.balance, self.share = tuple(selection), weights, balance, share
        self.length, self.force = scale
        rubbing = [i for i in range(self.p) if friction[i]]
        self.rubbing, self.places = rubbing, [*range(self.p), *(self.p + i for i in rubbing)]
        self.at = {place: k for k, place in enumerate(self.places)}
        unit = forms.units(self.length)
        S, p = forms.own.tolist(), self.p
        self.S = fmpq_mat(
            [[S[a][b] * self.force[b % p] / self.length[a % p] for b in self.places] for a in self.places]
        )
        self.G = fmpq_mat(
            [[u * row[b] / self.length[b % p] for b in self.places] for u, row in zip(unit, forms.G, strict=True)]
        )
        self.reach = [most / u for most, u in zip(forms.reach, unit, strict=True)]

    @cached_property
    def point(self):
        """lambda and w at the root, in the problem's units."""
        equations = self.forms.equations(self.own)
        N = fmpq_mat([form[:-1] for form in equations])
        need(N.det() != 0, "the selection of a declared root is singular")
        point = N.solve(column_of([-form[-1] for form in equations])).entries()
        need(all(_value(form, point) > 0 for form in self.forms.conditions(self.own)), "a condition is not strict")
        return point[: 2 * self.p], [_value(self.forms.move(1, k), point) for k in range(2 * self.p)]

    @cached_property
    def numbers(self):
        """mu of all nodes, kappa, nu and theta of those with friction, if they are allowed and serve the root."""
        p, rubbing = self.p, self.rubbing
        mu, rest = self.weights[:p], self.weights[p:]
        kappa, nu, share = (
            dict(zip(rubbing, rest[k * len(rubbing) : (k + 1) * len(rubbing)], strict=True)) for k in range(3)
        )
        need(all(value > 0 for value in [*mu, *kappa.values()]) and self.balance >= 0, "a weight is not positive")
        (force, w), theta = self.point, {}
        for i in rubbing:
            F, n, t, w_n, w_t = self.forms.F[i], force[i], force[p + i], w[i], w[p + i]
            need(abs(nu[i]) * F <= mu[i] and abs(share[i]) <= 1, "a weight is too large")
            need(self.own[i] not in (2, 3) or share[i] == 5 - 2 * self.own[i], "theta does not serve slip")
            theta[i] = t / n if n > 0 else share[i] * F
            if n == 0:
                need((mu[i] + nu[i] * F) * -w_n >= kappa[i] * (F - theta[i]) * w_t, "theta does not serve slip+")
                need((mu[i] - nu[i] * F) * -w_n >= kappa[i] * (F + theta[i]) * -w_t, "theta does not serve slip-")
        return mu, kappa, nu, theta

    @cached_property
    def form(self):
        """(6.5) as a matrix in (d, e), if it is definite where e = 0."""
        mu, kappa, nu, theta = self.numbers
        size, r = len(self.places), len(self.reach)
        D = fmpq_mat(size, size)
        for i in range(self.p):
            D[i, i] = mu[i]
            if i in theta:
                t = self.at[self.p + i]
                D[i, t], D[t, t], D[t, i] = nu[i], kappa[i], -kappa[i] * theta[i]
        form = D.transpose() * self.S
        square = self.G.transpose() * self.G
        Q = [[(form[a, b] + form[b, a]) / 2 + self.balance * square[a, b] for b in range(size)] for a in range(size)]
        need(definite(Q), "a form is not definite")
        C = (self.G * D).tolist()
        C = [[-(C[j][b] - self.share * self.G[j, b]) / 2 for b in range(size)] for j in range(r)]
        columns = [[C[j][b] for j in range(r)] for b in range(size)]
        return [[*a, *b] for a, b in zip(Q, columns, strict=True)] + [[*row, *[fmpq(0)] * r] for row in C]

    def kind(self, codes, number):
        """The kind of a row on displacements, its node, and what it is below the assignment and at the root."""
        kind, i = divmod(integer(number), self.p)
        need(kind in (4, 5, 6), "a row is none on displacements")
        need(kind == 4 or self.friction[i], "a row of a node without friction")
        return kind, i, MOVES[codes[i]][kind - 4], MOVES[self.own[i]][kind - 4]

    def change(self, kind, i):
        """How a row changes, by the components of (d, e)."""
        k = self.at[i if kind == 4 else self.p + i]
        sign = -1 if kind == 5 else 1
        return [sign * x for x in self.S.tolist()[k]] + [-sign * row[k] for row in self.G.tolist()]

    def check(self, codes, rows, pairs):
        equal, products = [], []
        for number in rows:
            kind, i, here, there = self.kind(codes, number)
            need(here == there == "E", "a row is no equation")
            equal.append(self.change(kind, i))
        for *two, factor in pairs:
            need(len(two) == 2 and exact(factor) > 0, "a factor is not positive")
            for number in two:
                kind, i, here, there = self.kind(codes, number)
                opposite = kind in OPPOSITE and MOVES[self.own[i]][OPPOSITE[kind] - 4] == "+"
                need(here in "E+" and (there == "E" or opposite), "a row is not tight")
            products.append((*(self.change(*divmod(number, self.p)) for number in two), exact(factor)))
        none = [fmpq(0)] * len(self.reach)
        given = [[*row, *none] for row in self.G.tolist()] + equal
        _, kernel = _affine([[*row, fmpq(0)] for row in given])
        form = [list(row) for row in self.form]
        for one, other, factor in products:
            for a, b in product(range(len(form)), repeat=2):
                form[a][b] -= factor * (one[a] * other[b] + other[a] * one[b]) / 2
        if not kernel:
            return
        N = fmpq_mat(kernel)
        if definite((N * fmpq_mat(form) * N.transpose()).tolist()):
            return
        need(self.costs(form, N, equal), "another root may lie below an assignment")

    def costs(self, form, N, equal):
        """Whether the form is nearly semidefinite, and what opens costs more than it lacks."""
        (force, _), (mu, _, nu, _), size = self.point, self.numbers, len(self.places)
        H = list(equal)
        for i in range(self.p):
            if force[i] > 0:
                price = (mu[i] * force[i] + nu.get(i, 0) * force[self.p + i]) / self.force[i]
                H.append([price * x for x in self.change(4, i)])
        if not H:
            return False
        moved, pushed = fmpq_mat([row[size:] for row in H]), [x for row in H for x in row[:size]]
        gamma2 = least_eigenvalue((moved.transpose() * moved).tolist())
        Gamma2 = sum((x * x for x in pushed), fmpq(0))
        if not gamma2 > 0:
            return False
        rho2 = sum((x * x for x in self.reach), fmpq(0))
        m = least_eigenvalue([row[:size] for row in self.form[:size]])
        for _ in range(24):
            # a little less than the largest t that is allowed: with a larger t more forms are semidefinite
            t = min(exact(float(m * gamma2 / (4 * Gamma2))) if Gamma2 else m, exact(float(gamma2 / (16 * rho2)) ** 0.5))
            t *= fmpq(1023, 1024)
            if t * 4 * Gamma2 < m * gamma2 and 16 * t * t * rho2 < gamma2:
                shifted = [list(row) for row in form]
                for a in range(len(form)):
                    shifted[a][a] += -m if a < size else t
                if definite((N * fmpq_mat(shifted) * N.transpose()).tolist(), semi=True):
                    return True
            m /= 2
        return False


def definite(M, *, semi=False):
    """Whether a symmetric matrix is positive definite, or semidefinite, by elimination."""
    M = [list(row) for row in M]
    for k in range(len(M)):
        pivot = M[k][k]
        if pivot < 0 or (pivot == 0 and (not semi or any(x != 0 for x in M[k][k:]))):
            return False
        for a in range(k + 1, len(M) if pivot > 0 else 0):
            if M[a][k] != 0:
                factor = M[a][k] / pivot
                M[a][k:] = [x - factor * y for x, y in zip(M[a][k:], M[k][k:], strict=True)]
    return True


def least_eigenvalue(M):
    """A positive lower bound of the smallest eigenvalue, near it if floats know it; 0 where it is not positive."""
    if not definite(M):
        return fmpq(0)
    found = float(np.linalg.eigvalsh([[float(x) for x in row] for row in M])[0])
    most = max(M[k][k] for k in range(len(M)))
    bound = exact(found) * fmpq(1023, 1024) if found > 0 else most / 2**40
    while not definite([[x - bound * (a == b) for b, x in enumerate(row)] for a, row in enumerate(M)]):
        bound /= 2
    return bound
