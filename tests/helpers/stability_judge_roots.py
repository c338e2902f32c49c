"""Roots enclosed anew, from displacements and forces together, with what every node strictly does (stability_judge)."""

from itertools import product

import numpy as np
from flint import arb, arb_mat
from rational_forms import exact


def balls(array):
    return arb_mat([[arb(value) for value in row] for row in np.atleast_2d(array).tolist()])


def starts(records, size):
    """Forces that are named somewhere in the proof of the roots."""
    for record in records:
        for part in record if isinstance(record, list) else ():
            if isinstance(part, list) and len(part) == size and all(type(x) in (int, float) for x in part):
                yield np.array(part, dtype=float)


class Root:
    """Bounds of displacements and forces at a root, and what every node does there, strictly."""

    def __init__(self, forces, kinds, directions, F):
        self.forces, self.kinds, self.directions, self.F = forces, kinds, directions, F


def near(root, other):
    return all(a.overlaps(b) for a, b in zip(root.forces, other.forces, strict=True))


def enclosed(whole, alpha, F, start):
    """The root near given forces, or None: statuses are guessed from these, and then proven."""
    problem, p, n = whole.problem, whole.p, len(whole.A)
    slope = np.zeros(n) if problem.load_slope is None else problem.load_slope
    f = [arb(exact(a) + alpha * exact(b)) for a, b in zip(problem.f.tolist(), slope.tolist(), strict=True)]
    offset = [arb(x) for x in [*problem.gap.tolist(), *np.asarray(problem.slip_offset).T.ravel().tolist()]]
    codes = [guessed([start[i::p][0], *start[i::p][1:]], [float(own[i]) for own in F]) for i in range(p)]
    equations = Equations(balls(whole.A), balls(whole.B), f, offset, F, codes, p)
    x = equations.near([arb(value) for value in start.tolist()])
    return None if x is None else equations.root(x)


def guessed(force, F):
    """What a node does, by its forces in floats."""
    axes = [(own, t) for own, t in zip(F, force[1:], strict=True) if own > 0]
    if force[0] <= 1e-9 * max(abs(x) for x in [*force, 1e-300]):
        return "open"
    if not axes or np.hypot.reduce([t / own for own, t in axes]) < force[0] * (1 - 1e-7):
        return "stuck"
    return "limit"


class Equations:
    """A u + B'lambda = f, and for every row what its node does, as polynomials of degree two at most."""

    def __init__(self, A, B, f, offset, F, codes, p):
        self.A, self.B, self.f, self.offset, self.F, self.codes, self.p = A, B, f, offset, F, codes, p
        self.n, self.m = A.nrows(), B.nrows()

    def moved(self, x):
        u = arb_mat([[value] for value in x[: self.n]])
        return [value - shift for value, shift in zip((self.B * u).entries(), self.offset, strict=True)]

    def near(self, forces):
        """A zero by Newton's method, enclosed by Krawczyk's; None where this fails."""
        # with directions held, the equations are linear
        self.fixed = forces
        x = [arb(0)] * self.n + list(forces)
        try:
            x = self.step(x)
            self.fixed = None
            for _ in range(9):
                x = self.step(x)
            x = [value.mid() for value in x]
            C = self.slopes(x).inv()
            values = arb_mat([[value] for value in self.values(x)])
            box = [value + arb(0, arb(2) ** -150 * (1 + abs(value).upper())) for value in x]
            spread = arb_mat([[b - a] for a, b in zip(x, box, strict=True)])
            unit = arb_mat([[int(i == j) for j in range(len(x))] for i in range(len(x))])
            moved = (unit - C * self.slopes(box)) * spread - C * values
        except ZeroDivisionError:
            return None
        inner = [a + b for a, b in zip(x, moved.entries(), strict=True)]
        return inner if all(b.contains_interior(a) for a, b in zip(inner, box, strict=True)) else None

    def step(self, x):
        x = [value.mid() for value in x]
        values = arb_mat([[value] for value in self.values(x)])
        return [a - b for a, b in zip(x, self.slopes(x).solve(values).entries(), strict=True)]

    def values(self, x):
        u = arb_mat([[value] for value in x[: self.n]])
        lam = arb_mat([[value] for value in x[self.n :]])
        out = (self.A * u + self.B.transpose() * lam).entries()
        out = [a - b for a, b in zip(out, self.f, strict=True)]
        return out + [row[0] for row in self.rows(x)]

    def slopes(self, x):
        J = arb_mat(self.n + self.m, self.n + self.m)
        for i, j in product(range(self.n), repeat=2):
            J[i, j] = self.A[i, j]
        for k, j in product(range(self.m), range(self.n)):
            J[j, self.n + k] = self.B[k, j]
        for at, (_, of_w, of_lambda) in enumerate(self.rows(x)):
            for k, share in of_w.items():
                for j in range(self.n):
                    J[self.n + at, j] += share * self.B[k, j]
            for k, share in of_lambda.items():
                J[self.n + at, self.n + k] += share
        return J

    def rows(self, x):
        """Value and derivatives with respect to w and lambda of every condition."""
        w, lam = self.moved(x), x[self.n :]
        for i, code in enumerate(self.codes):
            rubs = [k for k, F in enumerate(self.F) if F[i] > 0]
            tangents = [(k + 1) * self.p + i for k in range(len(self.F))]
            yield (lam[i], {}, {i: arb(1)}) if code == "open" else (w[i], {i: arb(1)}, {})
            for k, row in enumerate(tangents):
                if code == "open" or k not in rubs:
                    yield lam[row], {}, {row: arb(1)}
                elif code == "stuck":
                    yield w[row], {row: arb(1)}, {}
            if code == "limit":
                yield from self.sliding(i, [tangents[k] for k in rubs], [arb(self.F[k][i]) for k in rubs], w, lam)

    def sliding(self, i, rows, F, w, lam):
        if len(rows) == 1 or self.fixed is not None:
            of = lam if self.fixed is None else self.fixed
            length = sum(((of[k] / own) ** 2 for k, own in zip(rows, F, strict=True)), arb(0)).sqrt()
            for k, own in zip(rows, F, strict=True):
                share = own * (of[k] / own) / length
                share = share if len(rows) > 1 else own * (1 if of[k] > 0 else -1)
                yield lam[k] - share * lam[i], {}, {k: arb(1), i: -share}
            return
        (j, k), (F1, F2) = rows, F
        a, b = lam[j] / F1, lam[k] / F2
        yield a**2 + b**2 - lam[i] ** 2, {}, {j: 2 * a / F1, k: 2 * b / F2, i: -2 * lam[i]}
        yield (
            a * F2 * w[k] - b * F1 * w[j],
            {k: a * F2, j: -b * F1},
            {j: F2 * w[k] / F1, k: -F1 * w[j] / F2},
        )

    def root(self, x):
        """The root, if every node surely does what is said."""
        w, lam, kinds, directions = self.moved(x), x[self.n :], [], []
        for i, code in enumerate(self.codes):
            rows = [(k + 1) * self.p + i for k in range(len(self.F))]
            F = [arb(of[i]) for of in self.F]
            shares = [lam[k] / own if own > 0 else arb(0) for k, own in zip(rows, F, strict=True)]
            length = sum((share**2 for share in shares), arb(0)).sqrt()
            direction = [share / length if code == "limit" else arb(0) for share in shares]
            if code == "open":
                sure = w[i] < 0
            elif code == "stuck":
                sure = lam[i] > 0 and length < lam[i]
            else:
                sure = (
                    lam[i] > 0
                    and sum((d * own * w[k] for d, own, k in zip(direction, F, rows, strict=True)), arb(0)) > 0
                )
            if not sure:
                return None
            kinds.append(code)
            directions.append(direction)
        return Root(lam, kinds, directions, self.F)
