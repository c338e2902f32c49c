"""Solutions of a complete assignment in 3D, for space_judge: boxes of directions (and alphas) cut until all is known.

For given directions the equations are linear: y = E x, P (g - S E x) = 0 (docs/proof_format.md). What
changes with the directions is split off from the middle of a box (theory, section 12.3), and zeros of
(4.2) are told by Krawczyk's operator, in balls of many digits.
"""

from functools import cached_property

from flint import arb, arb_mat
from space_judge_data import column, corner, following, length_of, sector_of


class Singular(Exception):  # noqa: N818
    """The equations have no regular matrix in the middle of a box, or not in all of it."""


def solve(matrix, right):
    try:
        # elimination would mix balls of the right-hand side
        known = all(value.rad() < arb(2) ** -100 for value in right.entries())
        found = matrix.solve(right) if known else matrix.inv() * right
    except ZeroDivisionError as error:
        raise Singular from error
    if not all(value.is_finite() for value in found.entries()):
        raise Singular
    return found


def between(low, high):
    return low.union(high)


def angles_of(number):
    """All directions of a sector."""
    (x, y), (u, v) = ((arb(a), arb(b)) for a, b in (corner(number), corner(following(number))))
    begin = arb.atan2(y, x)
    return between(begin, begin + arb.atan2(x * v - y * u, x * u + y * v))


class Leaf:
    """The equations of an assignment around the middle of a box of angles and alphas.

    One component of x, a normal force or a coordinate of the rigid displacement, may be left free: it is one more
    unknown behind the angles, and its equation one more beside G (theory, section 12.9).
    """

    def __init__(self, system, codes, angles, alpha, free=None):
        self.system, self.codes, self.free = system, codes, free
        self.angles, self.alpha = [angle.mid() for angle in angles], alpha.mid()
        self.sort()
        self._middle()

    def sort(self):
        """Which nodes do what."""
        system, codes, p = self.system, self.codes, len(self.codes)
        self.turning = [i for i in range(p) if sector_of(codes[i])]
        self.sliding = [i for i in range(p) if sector_of(codes[i]) or codes[i] in (2, 3)]
        self.contact = [i for i in range(p) if codes[i] != 0]
        stuck = [place for i in range(p) if codes[i] == 1 for place in system.tau[i]]
        #: of a body that nothing holds, minus its rigid displacement
        self.rigid = list(range(len(system.node_of), system.m))
        self.picked = [place for place in self.contact + stuck + self.rigid if place != self.free]
        #: of every sliding node the places of its tau, beside each other
        self.places = [place for i in self.sliding for place in system.tau[i]]

    def columns(self, forces):
        """E."""
        E = [[arb(0)] * len(self.picked) for _ in range(self.system.m)]
        for k, place in enumerate(self.picked):
            E[place][k] = arb(1)
        for i, force in zip(self.sliding, forces, strict=True):
            for place, value in zip(self.system.tau[i], force, strict=True) if i != self.free else ():
                E[place][self.picked.index(i)] = value
        return arb_mat(E) if self.picked else arb_mat(self.system.m, 0)

    def _middle(self):
        system, m, q = self.system, self.system.m, len(self.sliding)
        self.forces = self.along(self.angles, self.alpha)
        E = self.columns(self.forces)
        T = arb_mat(m, len(self.places))
        for k, place in enumerate(self.places):
            T[place, k] = 1
        SE, ST, g, slope = system.S * E, system.S * T, column(system.load(self.alpha)), column(system.g1)
        own, push = self._own()
        self.M, last = self._pick(SE), self.angles[-1] if self.free is not None else arb(0)
        right = [g - push * last, slope, ST, -push]
        if self.picked:
            x, xs, B, xf = (solve(self.M, self._pick(part)) for part in right)
        else:
            x, xs, B, xf = (arb_mat(0, part.ncols()) for part in right)
        self.y, self.ys, self.yf = E * x + own * last, E * xs, E * xf + own
        self.w, self.ws, self.wf = g - SE * x - push * last, slope - SE * xs, -(SE * xf) - push
        #: what unit tangential forces at the sliding nodes change y and w by
        self.dy, self.dw = T - E * B, SE * B - ST
        none = [arb(0)] * len(self.places)
        rows = [None if i == self.free else self.picked.index(i) for i in self.sliding]
        self.xc = [last if k is None else x[k, 0] for k in rows]
        self.xcs = [arb(0) if k is None else xs[k, 0] for k in rows]
        self.xcf = [arb(1) if k is None else xf[k, 0] for k in rows]
        self.QB = [none if k is None else [B[k, j] for j in range(len(self.places))] for k in rows]
        self.q = q

    def _own(self):
        """The column of the free component, and what it pushes back by."""
        own = arb_mat(self.system.m, 1)
        if self.free is not None:
            own[self.free, 0] = 1
            for i, force in zip(self.sliding, self.forces, strict=True):
                for place, value in zip(self.system.tau[i], force, strict=True) if i == self.free else ():
                    own[place, 0] = value
        return own, self.system.S * own

    def _pick(self, matrix):
        return arb_mat([[matrix[k, j] for j in range(matrix.ncols())] for k in self.picked]) if self.picked else None

    def along(self, angles, alpha):
        """r d of the sliding nodes, or its derivative by the angle and by alpha."""
        return [
            [self.system.radius(i, alpha) * x for x in d] for i, d in zip(self.sliding, self.units(angles), strict=True)
        ]

    def units(self, angles, turned=False):
        """d of the sliding nodes."""
        angle, found = iter(angles), []
        for i in self.sliding:
            if i in self.turning:
                sine, cosine = next(angle).sin_cos()
                found.append([-sine, cosine] if turned else [cosine, sine])
            else:
                found.append([arb(0)] if turned else [arb(1 if self.codes[i] == 2 else -1)])
        return found

    def index(self, view):
        """[4.7] sign det M sign det dG/dpsi."""
        det = self.M.det() * (-1) ** len(self.rigid) if self.picked else arb(1)
        both = det * (arb_mat(view.slopes).det() if view.angles else arb(1))
        both = both if self.free is None else -both
        if both > 0 or both < 0:
            return 1 if both > 0 else -1
        raise Singular


class View:
    """x, y, w and G of a leaf over a box of angles and alphas, with their derivatives."""

    def __init__(self, leaf, angles, alpha):
        self.leaf, self.angles, self.alpha = leaf, angles, alpha
        self.system, self.codes = leaf.system, leaf.codes
        step = alpha - leaf.alpha
        forces = leaf.along(angles, alpha)
        #: D of (12.4): by how much the tangential forces of a unit normal force differ from those in the middle
        self.D = [[x - y for x, y in zip(a, b, strict=True)] for a, b in zip(forces, leaf.forces, strict=True)]
        self.K = (
            arb_mat(
                [
                    [
                        sum((b * d for b, d in zip(self._part(row, j), self.D[j], strict=True)), arb(int(k == j)))
                        for j in range(leaf.q)
                    ]
                    for k, row in enumerate(leaf.QB)
                ]
            )
            if leaf.q
            else None
        )
        more = angles[-1] - leaf.angles[-1] if leaf.free is not None else arb(0)
        free = [a + step * b + more * c for a, b, c in zip(leaf.xc, leaf.xcs, leaf.xcf, strict=True)]
        self.xc = solve(self.K, column(free)).entries() if leaf.q else []
        moved = column([d * x for part, x in zip(self.D, self.xc, strict=True) for d in part]) if leaf.q else None
        self.y = (leaf.y + leaf.ys * step + leaf.yf * more).entries()
        self.w = (leaf.w + leaf.ws * step + leaf.wf * more).entries()
        if leaf.q:
            self.y = [a + b for a, b in zip(self.y, (leaf.dy * moved).entries(), strict=True)]
            self.w = [a + b for a, b in zip(self.w, (leaf.dw * moved).entries(), strict=True)]
        self.d = leaf.units(angles)
        self.line = self.left = self.across = None

    def _part(self, row, j):
        """Entries of a row that belong to the tau of one sliding node."""
        tau = self.system.tau
        start = sum(len(tau[i]) for i in self.leaf.sliding[:j])
        return row[start : start + len(tau[self.leaf.sliding[j]])]

    def moves(self, change, free):
        """(12.5) Derivatives of y and w where D of the sliding nodes changes so, and x without it by free."""
        leaf = self.leaf
        pushed = [[c * x for c in part] for part, x in zip(change, self.xc, strict=True)]
        flat = [value for part in pushed for value in part]
        right = [
            a - sum((b * f for b, f in zip(row, flat, strict=True)), arb(0))
            for a, row in zip(free, leaf.QB, strict=True)
        ]
        dx = solve(self.K, column(right)).entries()
        total = column(
            [
                a + d * x
                for part, more, x in zip(pushed, self.D, dx, strict=True)
                for a, d in zip(part, more, strict=True)
            ]
        )
        return (leaf.dy * total).entries(), (leaf.dw * total).entries()

    @cached_property
    def by_angle(self):
        leaf, found = self.leaf, []
        turned = leaf.units(self.angles, turned=True)
        for i in leaf.turning:
            change = [
                [self.system.radius(j, self.alpha) * x if j == i else arb(0) for x in d]
                for j, d in zip(leaf.sliding, turned, strict=True)
            ]
            found.append(self.moves(change, [arb(0)] * leaf.q))
        if leaf.free is not None:
            y, w = leaf.yf.entries(), leaf.wf.entries()
            if leaf.q:
                moved = self.moves([[arb(0)] * len(d) for d in self.D], leaf.xcf)
                y, w = ([a + b for a, b in zip(*part, strict=True)] for part in ((y, moved[0]), (w, moved[1])))
            found.append((y, w))
        return found

    @cached_property
    def by_alpha(self):
        leaf = self.leaf
        if not leaf.q:
            return leaf.ys.entries(), leaf.ws.entries()
        change = [[self.system.discs[i][1] * x for x in d] for i, d in zip(leaf.sliding, self.d, strict=True)]
        y, w = self.moves(change, leaf.xcs)
        return (
            [a + b for a, b in zip(leaf.ys.entries(), y, strict=True)],
            [a + b for a, b in zip(leaf.ws.entries(), w, strict=True)],
        )

    def directions(self):
        """Node, v and d of the nodes in sectors."""
        for i, d in zip(self.leaf.sliding, self.d, strict=True):
            if i in self.leaf.turning:
                yield i, [self.w[place] for place in self.system.tau[i]], d

    @cached_property
    def G(self):
        found = [v[0] * d[1] - v[1] * d[0] for _, v, d in self.directions()]
        return found if self.leaf.free is None else [*found, self.w[self.leaf.free]]

    def _of_G(self, dw, node=None):
        """The derivatives of G for derivatives of w; node is the one that turns."""
        found = []
        for i, v, d in self.directions():
            x, y = (dw[place] for place in self.system.tau[i])
            turn = v[0] * d[0] + v[1] * d[1] if i == node else arb(0)
            found.append(x * d[1] - y * d[0] + turn)
        return found if self.leaf.free is None else [*found, dw[self.leaf.free]]

    @cached_property
    def slopes(self):
        """dG/dpsi by rows."""
        columns = [self._of_G(dw, i) for i, (_, dw) in zip([*self.leaf.turning, None], self.by_angle, strict=False)]
        return [list(row) for row in zip(*columns, strict=True)]

    @cached_property
    def by_alpha_of_G(self):
        return self._of_G(self.by_alpha[1])

    def zeta(self, steps):
        """y - steps w over the box, in one, so that it is as narrow as it is."""
        leaf, step = self.leaf, self.alpha - self.leaf.alpha
        flat = [d * x for part, x in zip(self.D, self.xc, strict=True) for d in part]
        found = []
        for k, s in enumerate(steps):
            value = leaf.y[k, 0] - s * leaf.w[k, 0] + step * (leaf.ys[k, 0] - s * leaf.ws[k, 0])
            if leaf.free is not None:
                value += (self.angles[-1] - leaf.angles[-1]) * (leaf.yf[k, 0] - s * leaf.wf[k, 0])
            for j, moved in enumerate(flat):
                value += (leaf.dy[k, j] - s * leaf.dw[k, j]) * moved
            found.append(value)
        return found

    # -- conditions ----------------------------------------------------------------------------------------------------

    def conditions(self):
        """[4.3] What is to be at least zero, node by node."""
        for i, code in enumerate(self.codes):
            places, r = self.system.tau[i], self.system.radius(i, self.alpha)
            if code == 0:
                yield -self.w[i]
                continue
            yield self.y[i]
            if code == 1:
                yield r * self.y[i] - length_of([self.y[place] for place in places])
            elif code in (2, 3):
                yield self.w[places[0]] * (1 if code == 2 else -1)
        for _, v, d in self.directions():
            yield v[0] * d[0] + v[1] * d[1]
        for k, place in enumerate(self.leaf.rigid):
            yield self.system.rigid[2][k] - self.y[place]
            yield self.system.rigid[2][k] + self.y[place]

    def is_violated(self):
        return any(value < 0 for value in self.conditions())

    def is_vague(self):
        """Whether the normal force of a node that turns is hardly known."""
        return any(self.y[i].rad() > abs(self.y[i]).mid() / 4 for i in self.leaf.turning)

    def is_strict(self):
        return all(value > 0 for value in self.conditions())

    def narrowed(self, middle):
        """Bounds of y and w by their values in the middle of the box as well: narrower in narrow boxes."""
        steps = [a - b for a, b in zip(self.angles, middle.angles, strict=True)]
        for name, k in (("y", 0), ("w", 1)):
            values = list(getattr(middle, name))
            for part, step in zip(self.by_angle, steps, strict=True):
                values = [a + b * step for a, b in zip(values, part[k], strict=True)]
            change, by = self.alpha - middle.alpha, self.by_alpha[k]
            values = [a + b * change for a, b in zip(values, by, strict=True)]
            setattr(self, name, [a.intersection(b) for a, b in zip(getattr(self, name), values, strict=True)])


def krawczyk(view, middle):
    """The angles to which Krawczyk's operator leads from a box, with the view of its middle."""
    if not view.angles:
        view.line = [], []
        return []
    try:
        Y = arb_mat([[x.mid() for x in row] for row in middle.slopes]).inv()
    except ZeroDivisionError as error:
        raise Singular from error
    steps = column([a - b for a, b in zip(view.angles, middle.angles, strict=True)])
    unit = arb_mat(len(view.angles), len(view.angles))
    for k in range(len(view.angles)):
        unit[k, k] = 1
    rest = (unit - Y * arb_mat(view.slopes)) * steps - Y * column(middle.G)
    drift, change = (Y * column(view.by_alpha_of_G)).entries(), view.alpha - middle.alpha
    #: all zeros have angles - those of the middle = change of alpha times one of these + another one
    view.line = (
        [-x.mid() for x in drift],
        [a - (b - b.mid()) * change for a, b in zip(rest.entries(), drift, strict=True)],
    )
    return [a + b * change + c for a, b, c in zip(middle.angles, *view.line, strict=True)]
