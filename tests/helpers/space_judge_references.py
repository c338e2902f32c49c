"""The only roots below assignments, of bodies that nothing holds, for space_judge, in balls of many digits.

Numbers in brackets are sections of docs/proof_format.md; the mathematics is in theory, section 14.11.
"""

from math import log2

from flint import arb, arb_mat
from rational_forms import need
from space_judge_certificates import serving, square
from space_judge_data import Undecided, is_definite, length_of, row_of, sign_of

_HEAVY = arb(2) ** 20
_TINY = arb(2) ** -160
#: Kinds of rows on displacements that may be equations, and that may be tight.
_EQUATIONS, _TIGHT = (0, 3), (0, 5, 8, 9)


class RootForm:
    """[6.7] A root of a leaf, and the form of its numbers."""

    def __init__(self, system, weights, root, leaf, balance, share):
        self.system, self.leaf, self.root = system, leaf, root
        self.G, _, self.rho = system.rigid
        need(all(s.is_zero() for s in weights.s), "a node serves any theta")
        self.r = len(self.rho)
        D = weights.map(serving(weights, root.y, root.w))
        Q = D.transpose() * system.S
        Q = (Q + Q.transpose()) / arb(2)
        rows = self.G.tolist()
        added = [square(row) * factor for row, factor in zip(rows, balance, strict=True)]
        need(is_definite(sum(added, Q)), "the form is not definite")
        # any weight is right where G d = 0
        heavy = _HEAVY * max(abs(x).upper() for x in Q.entries())
        for row, factor in zip(rows, balance, strict=True):
            size = sum((x * x for x in row), arb(0))
            Q += square(row) * (heavy / size if size > 0 else heavy).max(factor)
        # a share of the smallest eigenvalue, for what displacements cost: small, since the rest has to prove all else
        self.least = (1 / (64 * Q.inv().trace())).lower()
        self.inverse = _raised(Q, -self.least).inv()
        off = [[share - x if i == j else -x for j, x in enumerate(row)] for i, row in enumerate(D.tolist())]
        self.C = self.G * arb_mat(off)
        self.idle = [all(x.is_zero() for x in row) for row in self.C.tolist()]
        self.cost = []
        for i, places in enumerate(system.tau):
            if leaf[i] != 0:
                own = sum((a * root.y[k] for a, k in zip(weights.nu[i], places, strict=True)), arb(0))
                self.cost.append((i, (weights.mu[i] * root.y[i] + own).max(arb(0))))

    def row(self, kind, node, number):
        """Coefficients of w."""
        found = [arb(0)] * self.system.m
        for place, factor in row_of(self.system.tau[node], self.system.axes[node], kind, number)[2]:
            found[node if place is None else place] = arb(factor)
        return found

    def equation(self, codes, kind, node, number):
        """A row that is an equation below an assignment and at the root."""
        found = self.row(kind, node, number)
        need(kind in _EQUATIONS, "a row is none of equations")
        both = sign_of(codes[node], kind, number), sign_of(self.leaf[node], kind, number)
        need(both == ("E", "E"), "a row is no equation")
        return found

    def tight(self, codes, kind, node, number):
        """A row that is not negative below an assignment, and not positive at the root."""
        found = self.row(kind, node, number)
        need(kind in _TIGHT and sign_of(codes[node], kind, number) in "E+", "a row is no inequality")
        if self.leaf[node] == 1 or (kind == 0 and self.leaf[node] != 0):
            return found
        value = sum((a * b for a, b in zip(found, self.root.w, strict=False)), arb(0))
        if not value <= 0:
            need(not value > 0, "a row is not tight")
            raise Undecided("it is not known whether a row is tight")
        return found

    def alone(self, equations, tight, factors):
        """No other root; ``factors`` of pairs of tight rows by their places."""
        rows = [*equations, *tight]
        M, moved = self.small(rows, len(equations), factors), self.moved(rows)
        free = [j for j in range(self.r) if self.idle[j] and all(moved[i, j].is_zero() for i in range(len(rows)))]
        used = [j for j in range(self.r + len(tight)) if j not in free]
        M = arb_mat([[M[i, j] for j in used] for i in used])
        if is_definite(M) and not free:
            return
        need(not tight or not used or is_definite(M), "the form and its products are not definite")
        lacking = arb(0)
        if used and not is_definite(M):
            lacking = _TINY * (arb(1) + max(abs(x).upper() for x in M.entries()))
            need(is_definite(_raised(M, lacking)), "the form is not definite on the equations")
        self.costs(equations, lacking)

    def sole(self, turns):
        """No other root at all, by theory, section 14.15."""
        system, y, w, m = self.system, self.root.y, self.root.w, self.system.m
        theta = [[turns[place - len(system.tau)] for place in places] for places in system.tau]
        need(all(length_of(own) <= 1 + _TINY for own in theta), "theta is too long")
        D, a, V = arb_mat(_unit(m)), [arb(0)] * m, [arb(0)] * m
        for i, places in enumerate(system.tau):
            for place, value in zip(places, theta[i], strict=True):
                D[place, i], a[place], V[place] = -value, y[place] - value * y[i], w[place]
        Q = D.transpose() * system.S
        Q = (Q + Q.transpose()) / arb(2)
        heavy = _HEAVY * max(abs(x).upper() for x in Q.entries())
        P = sum((square(row) * (heavy / max(abs(x).upper() for x in row) ** 2) for row in self.G.tolist()), Q)
        need(is_definite(P), "the form is not definite")
        R, G, inverse = self.G * D, self.G, P.inv()
        R = R - R * G.transpose() * (G * G.transpose()).inv() * G
        a, V = arb_mat([[x] for x in a]), arb_mat([[x] for x in V])
        b = system.S * a - D.transpose() * V
        centre = inverse * b * arb(-0.5)
        rest = (a.transpose() * V)[0, 0] - (b.transpose() * centre)[0, 0] / 2
        slope, moved = arb(0), R * centre + G * a
        for j, row in enumerate(R.tolist()):
            across = (arb_mat([row]) * inverse * arb_mat([[x] for x in row]))[0, 0]
            rest += 2 * self.rho[j] * abs(moved[j, 0])
            slope += 2 * self.rho[j] * arb(abs(across).upper()).sqrt()
        radius = (slope + arb((slope * slope + 4 * rest.max(arb(0))).upper()).sqrt()) / 2
        self.costs_at_most(R, radius, (centre, inverse), theta)

    def costs_at_most(self, R, radius, ellipsoid, theta):
        """What theory, (14.22) and (14.23), ask for."""
        (centre, inverse), y, w, rows = ellipsoid, self.root.y, self.root.w, []
        for i, places in enumerate(self.system.tau):
            v = [w[place] for place in places]
            if self.leaf[i] == 0:
                along = sum((x * z for x, z in zip(theta[i], v, strict=True)), arb(0))
                need(not places or abs(w[i]) + along >= length_of(v), "theta does not serve a gap")
                continue
            need(not places or self.leaf[i] == 1, "a node slides")
            costs, away = [(i, y[i])], radius * inverse[i, i].sqrt()
            if places:
                ends = [centre[i, 0] + sign * away for sign in (-1, 1)]
                held = [
                    y[i] + d - length_of([y[place] + z * d for place, z in zip(places, theta[i], strict=True)])
                    for d in ends
                ]
                need(all(c > 0 for c in held), "a node may slide")
                costs += [(place, min(c.lower() for c in held)) for place in places]
            rows += [[arb(c) if k == place else arb(0) for k in range(self.system.m)] for place, c in costs]
        moved = self.moved(rows)
        square_of = moved.transpose() * moved
        need(is_definite(square_of), "some rigid displacement costs nothing")
        gamma, size = (1 / square_of.inv().trace()).sqrt(), length_of(R.entries())
        pushed, m = length_of((arb_mat(rows) * self.system.S).entries()), 1 / inverse.trace()
        need(2 * size * pushed < gamma * m, "rigid displacements cost too little")
        far = length_of(centre.entries()) + radius * inverse.trace().sqrt()
        need(2 * size * far < gamma, "forces may be too different")

    def moved(self, rows):
        return arb_mat(rows) * self.G.transpose() if rows else arb_mat(0, self.r)

    def small(self, rows, count, factors):
        """M of theory, section 14.11; tight rows follow the first ``count`` ones."""
        size = self.r + len(rows) - count
        M = arb_mat(size, size)
        corner = self.C * self.inverse * self.C.transpose() / arb(4)
        for i in range(self.r):
            for j in range(self.r):
                M[i, j] = -corner[i, j]
        for (one, other), factor in factors:
            M[self.r + one, self.r + other] -= factor / 2
            M[self.r + other, self.r + one] -= factor / 2
        if rows:
            A = arb_mat(rows)
            u = -A * self.system.S
            K = u * self.inverse * u.transpose()
            left = u * self.inverse * self.C.transpose() / arb(2) - self.moved(rows)
            T = arb_mat(len(rows), size)
            for i in range(len(rows)):
                for j in range(self.r):
                    T[i, j] = left[i, j]
                if i >= count:
                    T[i, self.r + i - count] = arb(1)
            # any Y is right: rows may say the same twice
            near = _TINY * max(K[i, i].upper() for i in range(len(rows)))
            Y = arb_mat([[x.mid() for x in row] for row in _raised(K, near).solve(T).tolist()])
            once = Y.transpose() * T
            M += once + once.transpose() - Y.transpose() * K * Y
        return (M + M.transpose()) / arb(2)

    def costs(self, equations, lacking):
        """See theory, (14.17)."""
        rows = [*equations]
        for i, cost in self.cost:
            rows.append([cost if k == i else arb(0) for k in range(self.system.m)])
        H = arb_mat(rows)
        moved = self.moved(rows)
        square_of = moved.transpose() * moved
        need(is_definite(square_of), "some rigid displacement costs nothing")
        if lacking.is_zero():
            return
        gamma = (1 / square_of.inv().trace()).sqrt()
        pushed = length_of((H * self.system.S).entries())
        need(lacking * (2 * pushed / gamma) ** 2 < self.least, "rigid displacements cost too little")
        need(4 * lacking * length_of(self.rho) < gamma, "rigid displacements may be too large")


def _unit(size):
    return [[arb(i == j) for j in range(size)] for i in range(size)]


def _raised(M, by):
    """M and a multiple of the unit matrix."""
    return arb_mat([[x + by if i == j else x for j, x in enumerate(row)] for i, row in enumerate(M.tolist())])


def weights_of_balance(data, scale, balance):
    """Factors of the squares of the rows of G, in the problem's units, for one in the units of a proof."""
    length, force = scale
    found = []
    for row in data.G.tolist():
        largest = max(abs(float(x)) / 2.0 ** length[k % data.p] for k, x in enumerate(row))
        unit = arb(2) ** (-round(log2(largest)) if largest else 0)
        found.append(balance * unit * unit / arb(2) ** (length[0] + force[0]))
    return found
