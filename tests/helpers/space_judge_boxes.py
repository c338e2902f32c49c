"""Boxes that hold one solution in 3D, or one curve of them over alpha, for space_judge, in balls of many digits.

The solutions are the zeros of y - P(y + rho w) (theory, (12.10)); P takes lambda_n to max(lambda_n,
0) and tau to the disc. Two zeros in a set differ by a vector in the kernel of some mean derivative there: where all of
these are regular there is one at most. A zero is shown to exist in a narrow set around the one that Newton's method
finds. Boxes are those of zeta = y - steps w (docs/proof_format.md).
"""

from copy import copy
from functools import cached_property

from flint import arb, arb_mat
from rational_forms import need
from space_judge_data import Undecided, column, length_of
from space_judge_leaves import Singular, solve

_NEWTON = 60
_POWERS = 40


def product(rows, x):
    return (arb_mat(rows) * column(x)).entries() if rows else []


def size_of(values):
    """Absolute values, upwards."""
    return [abs(value).upper() for value in values]


def reach(rows, radii):
    """Bounds of the products of a matrix with all vectors within radii."""
    return [sum((abs(a).upper() * r for a, r in zip(row, radii, strict=True)), arb(0)).upper() for row in rows]


class Around:
    """Balls of (z, alpha) in the set of all centre + t d + b, |t| <= half, |b| <= spread; or z as it is."""

    def __init__(self, middle, Z=None, moved=(), spread=()):
        self.z, self.middle = middle, middle
        self.Z, self.moved, self.spread = Z, moved, spread
        if Z:
            self.radii = [abs(a) + b for a, b in zip(moved, reach(Z, spread), strict=True)]
            self.z = [a + arb(0, b.upper()) for a, b in zip(middle, self.radii, strict=True)]

    def value(self, at, row):
        """Bounds of a function that is at in the middle; row has balls of its derivatives by place."""
        if not self.Z:
            return at
        mid = {k: x.mid() for k, x in row.items()}
        along = abs(sum((x * self.moved[k] for k, x in mid.items()), arb(0))).upper()
        for j, r in enumerate(self.spread):
            along += abs(sum((x * self.Z[k][j] for k, x in mid.items()), arb(0))).upper() * r
        more = sum((x.rad() * self.radii[k] for k, x in row.items()), arb(0))
        return at + arb(0, (along + more).upper())


class NaturalMap:
    """y - P(z), z = y + k steps w, and its derivatives; x = (zeta, alpha), or zeta where alpha is fixed.

    nodes are (place of lambda_n, places of tau) and discs the two numbers of their radii, which are affine in alpha.
    """

    def __init__(self, S, g0, g1, nodes, discs, steps, alpha=None, free=()):
        self.S, self.g0, self.g1, self.nodes, self.discs, self.steps = S, g0, g1, nodes, discs, steps
        #: [8] places of q, which P leaves as they are
        self.free = free
        self.m, self.alpha, self.size = len(g0), alpha, len(g0) + (alpha is None)
        self.check_steps(steps)
        m, table = self.m, S.tolist()
        scaled = arb_mat([[steps[i] * table[i][j] + int(i == j) for j in range(m)] for i in range(m)])
        self.T = scaled.inv()
        self.drift = (self.T * column([a * b for a, b in zip(steps, g1, strict=True)])).entries()
        self.Y = [[*row, self.drift[i]][: self.size] for i, row in enumerate(self.T.tolist())]
        self.k = [arb(1)] * m
        self.G = []

    def check_steps(self, steps):
        """Zeros of a map with two numbers for the components of one tau are no solutions."""
        need(all(step > 0 for step in steps), "a step is not positive")
        for _, places in self.nodes:
            need(all(steps[t] == steps[places[0]] for t in places), "both components of a tau need the same step")

    def with_steps(self, k):
        """The same with k times the steps in z."""
        self.check_steps(k)
        found = copy(self)
        found.__dict__.pop("Z", None)
        found.k = k
        return found

    def alpha_of(self, x):
        return x[-1] if self.alpha is None else self.alpha

    def place_of(self, y, alpha):
        """zeta."""
        w = self.moves(y, alpha)
        return [a - s * b for a, s, b in zip(y, self.steps, w, strict=True)]

    def moves(self, y, alpha):
        g = [a + alpha * b for a, b in zip(self.g0, self.g1, strict=True)]
        return (column(g) - self.S * column(y)).entries()

    def forces(self, x):
        alpha = self.alpha_of(x)
        load = [z + s * (a + alpha * b) for z, s, a, b in zip(x, self.steps, self.g0, self.g1, strict=False)]
        return (self.T * column(load)).entries()

    def argument(self, y, zeta):
        """z."""
        return [(1 + k) * a - k * b for k, a, b in zip(self.k, y, zeta, strict=False)]

    @cached_property
    def Z(self):
        """Derivatives of (z, alpha) by x."""
        rows = [[(1 + k) * a for a in row] for k, row in zip(self.k, self.Y, strict=True)]
        for i, k in enumerate(self.k):
            rows[i][i] -= k
        last = [arb(0)] * self.size
        if self.alpha is None:
            last[-1] = arb(1)
        return [*rows, last]

    def projected(self, z, alpha):
        found = [arb(0)] * self.m
        for k in self.free:
            found[k] = z[k]
        for (n, places), (F0, F1) in zip(self.nodes, self.discs, strict=True):
            normal, F, length = z[n].max(arb(0)), F0 + alpha * F1, length_of([z[t] for t in places])
            found[n] = normal
            limit = F * normal
            for t in places:
                found[t] = z[t] if length <= limit else limit * z[t] / length if length > 0 else arb(0)
        return found

    def statuses(self, z, alpha):
        """Of every node open, stick or slip where this is certain in balls, else None."""
        found = []
        for (n, places), (F0, F1) in zip(self.nodes, self.discs, strict=True):
            F, length = F0 + alpha * F1, length_of([z[t] for t in places])
            if z[n] < 0:
                found.append("open")
            elif z[n] > 0 and (not places or length < F * z[n]):
                found.append("stick")
            elif z[n] > 0 and length > F * z[n]:
                found.append("slip")
            else:
                found.append(None)
        return found

    def derivative(self, around, statuses=None):
        """Derivatives of P by (z, alpha): rows, columns u and rows v of terms t u v', t in [0, 1], and terms s D.

        A term s D is a bound of |s| and D, a number for every place of a row and a column.
        """
        P, U, V, terms = [[arb(0)] * (self.m + 1) for _ in range(self.m)], [], [], []
        z, alpha = around.z[:-1], around.z[-1]
        for k in self.free:
            P[k][k] = arb(1)
        for (n, t), (F0, F1), status in zip(self.nodes, self.discs, statuses or [None] * len(self.nodes), strict=True):
            F, zn, zt = F0 + alpha * F1, z[n], [z[k] for k in t]
            if zn < 0 or status == "open":
                continue
            if status:
                self._given(P, n, t, zt, F, zn, F1, status)
                continue
            above = zn if zn > 0 else arb(0).union(zn.upper())
            length = length_of(zt)
            e = [x / length for x in zt] if t and length > 0 else None
            P[n][n] = arb(1) if zn > 0 else arb(0).union(arb(1))
            if not t:
                continue
            beyond, beta = length - F * above, None
            if e and zn > 0:
                beyond, beta = self._along_the_set(around, n, t, F0, F1, F, e, length)
            if zn > 0 and beyond < 0:
                for k in t:
                    P[k][k] = arb(1)
            elif zn > 0 and beyond > 0 and e:
                middle = [x.mid() for x in e]
                if sum((x * y for x, y in zip(middle, zt, strict=True)), arb(0)) > 0:
                    terms += self._turning(P, n, t, middle, zt, F, beta, F1, zn, length)
                else:
                    self._slip(P, n, t, e, F, beta, F1 * zn)
            elif beyond > 0 and e:
                middle = [(F * x).mid() for x in e]
                self._slip(P, n, t, e, arb(0), arb(0).union((F * above / length).upper()), arb(0).union(F1 * above))
                for k, x, y in zip(t, e, middle, strict=True):
                    P[k][n] = arb(0).union(F * x - y)
                P[n][n] = arb(0)
                U.append({n: arb(1), **dict(zip(t, middle, strict=True))})
                V.append({n: arb(1)})
            elif zn > 0 and e:
                self._limit(P, U, V, n, t, e, F, zn, F1, beta)
            else:
                self._anything(P, n, t, F, above, F1)
        return P, U, V, terms

    def _along_the_set(self, around, n, t, F0, F1, F, e, length):
        """|z_t| - F z_n and F z_n / |z_t|, by their derivatives as well (theory, section 12.8)."""
        zn, alpha = around.z[n], around.middle[-1]
        at = length_of([around.middle[k] for k in t])
        limit = (F0 + alpha * F1) * around.middle[n]
        row = {n: -F, self.m: -F1 * zn, **dict(zip(t, e, strict=True))}
        beyond = (length - F * zn).intersection(around.value(at - limit, row))
        beta = F * zn / length
        beta = beta.intersection(1 - beyond / length)
        row = {n: F / length, self.m: F1 * zn / length, **{k: -beta * x / length for k, x in zip(t, e, strict=True)}}
        return beyond, beta.intersection(around.value(limit / at, row))

    def _slip(self, P, n, t, e, F, beta, turn):
        for a, k in enumerate(t):
            P[k][n], P[k][self.m] = F * e[a], turn * e[a]
            for b, j in enumerate(t):
                P[k][j] = beta * (int(a == b) - e[a] * e[b]) if len(t) > 1 else arb(0)

    def _given(self, P, n, t, zt, F, zn, F1, status):
        """A node in contact whose status is given."""
        P[n][n] = arb(1)
        if status == "stick":
            for k in t:
                P[k][k] = arb(1)
            return
        length = length_of(zt)
        if not length > 0:
            raise Singular
        self._slip(P, n, t, [x / length for x in zt], F, F * zn / length, F1 * zn)

    def _turning(self, P, n, t, e, zt, F, beta, F1, zn, length):
        """A node that only slips (theory, section 12.8)."""
        size, (Fm, bm, nm) = length_of(e), (x.mid() for x in (F, beta, zn))
        e = [x / size for x in e]
        if len(t) == 1:
            P[t[0]][n], P[t[0]][self.m] = F * e[0], F1 * zn * e[0]
            return []
        c = [-e[1], e[0]]
        q = abs((c[0] * zt[0] + c[1] * zt[1]) / length).upper()
        dF, dn, db = (abs(x - y).upper() for x, y in ((F, Fm), (zn, nm), (beta, bm)))
        cross = [[e[a] * c[b] + c[a] * e[b] for b in (0, 1)] for a in (0, 1)]
        D = [{}, {}, {}, {}]
        for a, k in enumerate(t):
            rest = abs(F) * q * q * abs(e[a]) + dF * q * abs(c[a])
            P[k][n] = Fm * e[a] + arb(0, rest.upper())
            rest = abs(F1) * (abs(zn) * q * q * abs(e[a]) + dn * q * abs(c[a]))
            P[k][self.m] = F1 * nm * e[a] + arb(0, rest.upper())
            D[0][k, n], D[0][k, self.m], D[2][k, n], D[3][k, self.m] = Fm * c[a], F1 * nm * c[a], e[a], F1 * e[a]
            for b, j in enumerate(t):
                rest = abs(beta) * q * q * (abs(e[a] * e[b]) + abs(c[a] * c[b]) + q * abs(cross[a][b]))
                P[k][j] = bm * c[a] * c[b] + arb(0, (rest + db * q * abs(cross[a][b])).upper())
                D[0][k, j], D[1][k, j] = -bm * cross[a][b], c[a] * c[b]
        return list(zip((q, db, dF, dn), D, strict=True))

    def _limit(self, P, U, V, n, t, e, F, zn, F1, beta):
        """Between stick and slip."""
        beta = beta.min(arb(1))
        row = {n: F, self.m: F1 * zn, **{k: -x for k, x in zip(t, e, strict=True)}}
        U.append({k: x.mid() for k, x in zip(t, e, strict=True)})
        V.append({k: x.mid() for k, x in row.items()})
        less = arb(0).union((beta - 1).lower())
        for a, k in enumerate(t):
            for place, x in row.items():
                P[k][place] += arb(0).union(e[a] * x - e[a].mid() * x.mid())
            for b, j in enumerate(t):
                P[k][j] += int(a == b)
                if len(t) > 1:
                    P[k][j] += less * (int(a == b) - e[a] * e[b])

    def _anything(self, P, n, t, F, above, F1):
        for k in t:
            P[k][n] = arb(0, abs(F).upper())
            P[k][self.m] = arb(0, (abs(F1) * above).upper())
            for j in t:
                P[k][j] = arb(0).union(arb(1)) if j == k else arb(0, arb(0.5))

    def equations(self, around, e, statuses=None):
        """The bordered derivatives B: balls, columns u and rows v Z, and terms s D."""
        P, U, V, terms = self.derivative(around, statuses)
        Z = arb_mat(self.Z)
        rows = [
            [a - b for a, b in zip(one, two, strict=True)]
            for one, two in zip(self.Y, (arb_mat(P) * Z).tolist(), strict=True)
        ]
        if self.alpha is None:
            rows.append(list(e))
        columns = [[u.get(k, arb(0)) for k in range(self.size)] for u in U]
        V = [(arb_mat([[v.get(k, arb(0)) for k in range(self.m + 1)]]) * Z).entries() for v in V]
        return rows, columns, V, terms

    def _product(self, D):
        found, Z = arb_mat(self.size, self.size), self.Z
        for (k, place), value in D.items():
            for j in range(self.size):
                found[k, j] += value * Z[place][j]
        return found

    def zero_near(self, x, e=None, digits=-150):
        """A point near the zero to which Newton's method leads, with e'x as it is."""
        x = [value.mid() for value in x]
        for _ in range(_NEWTON):
            y, alpha = [v.mid() for v in self.forces(x)], self.alpha_of(x)
            z = [v.mid() for v in self.argument(y, x)]
            rows, *_ = self.equations(Around([*z, alpha]), e)
            N = [a - b for a, b in zip(y, self.projected(z, alpha), strict=True)]
            N += [arb(0)] * (self.size - self.m)
            B = arb_mat([[v.mid() for v in row] for row in rows])
            step = [v.mid() for v in solve(B, column(N)).entries()]
            x = [(a - b).mid() for a, b in zip(x, step, strict=True)]
            if max(size_of(step)) <= arb(2) ** digits * (1 + max(size_of(x))):
                return x
        raise Undecided("Newton's method does not converge")

    # -- tests ---------------------------------------------------------------------------------------------------------

    def argument_at(self, centre, d, half, spread):
        """(z, alpha) for centre + t d + b, |t| <= half, |b| <= spread."""
        z = [*self.argument(self.forces(centre), centre), self.alpha_of(centre)]
        moved = [half * a for a in product(self.Z, d)] if d else [arb(0)] * len(z)
        return Around(z, self.Z, moved, spread)

    def bordered(self, around, e, statuses=None):
        """Over balls of (z, alpha): Y near an inverse of B, E, G and V of (12.14), B and terms Y D Z."""
        rows, U, V, terms = self.equations(around, e, statuses)
        middle = arb_mat(rows)
        for u, v in zip(U, V, strict=True):
            middle -= column(u) * arb_mat([v]) / arb(2)
        unit = arb_mat([[int(i == j) for j in range(self.size)] for i in range(self.size)])
        Y = solve(arb_mat([[x.mid() for x in row] for row in middle.tolist()]), unit)
        Y = arb_mat([[x.mid() for x in row] for row in Y.tolist()])
        G, E = [(Y * column(u)).entries() for u in U], (unit - Y * middle).tolist()
        terms = [(s, (Y * self._product(D)).tolist()) for s, D in terms if s > 0]
        for s, D in terms:
            E = [
                [a + arb(0, (s * abs(b)).upper()) for a, b in zip(*rows, strict=True)]
                for rows in zip(E, D, strict=True)
            ]
        return Y, E, [list(row) for row in zip(*G, strict=True)], V, middle, terms

    def at_most_one(self, centre, radii, e=None, d=None, half=None):
        """Whether e'(x - centre - t d) = 0 holds at no two zeros within radii of centre + t d, for every |t| <= half.

        Returns the sign of det Y; Singular where this is not shown.
        """
        half = arb(0) if half is None else half
        Y, E, G, V, *_ = self.bordered(self.argument_at(centre, d, half, radii), e)
        VG = self._crossed(V, G)
        r, s = [max(x, arb(2) ** -200) for x in radii], [arb(0)] * len(V)
        for _ in range(_POWERS):
            for _ in range(8):
                s = [((a + b) * arb(0.505)).upper() for a, b in zip(reach(VG, s), reach(V, r), strict=True)]
            found = [((a + b) / 2).upper() for a, b in zip(reach(VG, s), reach(V, r), strict=True)]
            wide = reach(E, [a + b for a, b in zip(self._along(G, s), r, strict=True)])
            if all(a < b for a, b in zip([*wide, *found], [*r, *s], strict=True)):
                return self.sign(Y)
            if max(wide) > 1e3 * max(r):
                break
            r = [(a + b / 16).upper() for a, b in zip(wide, r, strict=True)]
        raise Singular

    def _crossed(self, V, G):
        return [[sum((v[k] * G[k][j] for k in range(self.size)), arb(0)) for j in range(len(V))] for v in V]

    def _along(self, G, s):
        return reach(G, s) if s else [arb(0)] * self.size

    def sign(self, Y):
        det = Y.det()
        if det > 0 or det < 0:
            return 1 if det > 0 else -1
        raise Singular

    def zeros_around(self, centre, e=None, d=None, half=None, first=None):
        """Radii within which, for every |t| <= half, there is exactly one zero; centre is near that of t = 0.

        Returns the radii, bounds of (z, alpha) and of x - centre - t d at the zeros, and the sign of det Y.
        """
        half = arb(0) if half is None else half
        d = [arb(0)] * self.size if d is None else d
        alpha, y = self.alpha_of(centre), self.forces(centre)
        z = self.argument(y, centre)
        N = [a - b for a, b in zip(y, self.projected(z, alpha), strict=True)]
        N += [arb(0)] * (self.size - self.m)
        scale = max(size_of(centre)) + 1
        r, s = [(first or arb(2) ** -120) * scale] * self.size, []
        for _ in range(14):
            spread = [a + b for a, b in zip(self._along(self.G, s) if s else [arb(0)] * self.size, r, strict=True)]
            Y, E, G, V, middle, terms = self.bordered(self.argument_at(centre, d, half, spread), e)
            if len(s) != len(V):
                s = [x.upper() for x in reach(V, r)]
            self.G = G
            a0 = (Y * column(N)).entries()
            drift = (middle * column(d)).entries()
            if self.alpha is None:
                drift[-1] -= 1
            a1 = (Y * column(drift)).entries() if half > 0 else [arb(0)] * self.size
            for s_, D in terms:
                a1 = [a + arb(0, (s_ * abs(b)).upper()) for a, b in zip(a1, product(D, d), strict=True)]
            # what is off in the middle is left in b as a whole
            VG = self._crossed(V, G)
            Vd = [abs(x).upper() for x in product(V, d)] if V else []
            wide_s = [((a + b + half * c) / 2).upper() for a, b, c in zip(reach(VG, s), reach(V, r), Vd, strict=True)]
            along = [a + b for a, b in zip(self._along(G, s), r, strict=True)]
            wide = [(abs(a) + half * abs(b) + c).upper() for a, b, c in zip(a0, a1, reach(E, along), strict=True)]
            if all(a < b for a, b in zip(wide_s, s, strict=True)) and all(a < b for a, b in zip(wide, r, strict=True)):
                around = [(a + b).upper() for a, b in zip(self._along(G, wide_s), wide, strict=True)]
                return spread, self.argument_at(centre, d, half, around).z, around, self.sign(Y)
            r = [(a * 1.5 + b / 8 + scale * arb(2) ** -180).upper() for a, b in zip(wide, r, strict=True)]
            s = [(a * 1.2 + b / 8 + arb(2) ** -200).upper() for a, b in zip(wide_s, s, strict=True)]
            if max(r) > 1e3 * scale:
                break
        raise Singular
