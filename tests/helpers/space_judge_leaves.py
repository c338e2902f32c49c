"""Solutions of a complete assignment in 3D, for space_judge: boxes of directions (and alphas) cut until all is known.

For given directions the equations are linear: y = E x, P (g - S E x) = 0 (docs/proof_format.md, section 7.5). What
changes with the directions is split off from the middle of a box (docs/theory.md, (12.3a) and (12.3b)), and zeros of
(7.3) are told by Krawczyk's operator, in balls of many digits.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from flint import arb, arb_mat
from space_judge_data import Undecided, column, corner, following, length_of, sector_of

BOXES = 6000
#: As many times a box of a zero is made narrower.
_ROUNDS = 12


class Singular(Exception):  # noqa: N818
    """The equations have no regular matrix in the middle of a box, or not in all of it."""


def solve(matrix, right):
    try:
        found = matrix.solve(right)
    except ZeroDivisionError as error:
        raise Singular from error
    if not all(value.is_finite() for value in found.entries()):
        raise Singular
    return found


def between(low, high):
    return low.union(high)


def inside(inner, outer):
    return outer.contains_interior(inner)


def angles_of(number):
    """All directions of a sector."""
    (x, y), (u, v) = ((arb(a), arb(b)) for a, b in (corner(number), corner(following(number))))
    begin = arb.atan2(y, x)
    return between(begin, begin + arb.atan2(x * v - y * u, x * u + y * v))


class Leaf:
    """The equations of an assignment around the middle of a box of angles and alphas."""

    def __init__(self, system, codes, angles, alpha):
        self.system, self.codes = system, codes
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
        self.picked = self.contact + stuck + self.rigid
        #: of every sliding node the places of its tau, beside each other
        self.places = [place for i in self.sliding for place in system.tau[i]]

    def columns(self, forces):
        """E."""
        E = [[arb(0)] * len(self.picked) for _ in range(self.system.m)]
        for k, place in enumerate(self.picked):
            E[place][k] = arb(1)
        for i, force in zip(self.sliding, forces, strict=True):
            for place, value in zip(self.system.tau[i], force, strict=True):
                E[place][self.contact.index(i)] = value
        return arb_mat(E) if self.picked else arb_mat(self.system.m, 0)

    def _middle(self):
        system, m, q = self.system, self.system.m, len(self.sliding)
        self.forces = self.along(self.angles, self.alpha)
        E = self.columns(self.forces)
        T = arb_mat(m, len(self.places))
        for k, place in enumerate(self.places):
            T[place, k] = 1
        SE, ST, g, slope = system.S * E, system.S * T, column(system.load(self.alpha)), column(system.g1)
        self.M = self._pick(SE)
        if self.picked:
            right = [self._pick(part) for part in (g, slope, ST)]
            x, xs, B = (solve(self.M, part) for part in right)
        else:
            x, xs, B = arb_mat(0, 1), arb_mat(0, 1), arb_mat(0, len(self.places))
        self.y, self.ys = E * x, E * xs
        self.w, self.ws = g - SE * x, slope - SE * xs
        #: what unit tangential forces at the sliding nodes change y and w by
        self.dy, self.dw = T - E * B, SE * B - ST
        rows = [self.contact.index(i) for i in self.sliding]
        self.xc = [x[k, 0] for k in rows]
        self.xcs = [xs[k, 0] for k in rows]
        self.QB = [[B[k, j] for j in range(len(self.places))] for k in rows]
        self.q = q

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
        """[7.5] sign det M sign det dG/dpsi."""
        det = self.M.det() * (-1) ** len(self.rigid) if self.picked else arb(1)
        both = det * (arb_mat(view.slopes).det() if self.turning else arb(1))
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
        #: D of (12.3a): by how much the tangential forces of a unit normal force differ from those in the middle
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
        free = [a + step * b for a, b in zip(leaf.xc, leaf.xcs, strict=True)]
        self.xc = solve(self.K, column(free)).entries() if leaf.q else []
        moved = column([d * x for part, x in zip(self.D, self.xc, strict=True) for d in part]) if leaf.q else None
        self.y = [a + step * b for a, b in zip(leaf.y.entries(), leaf.ys.entries(), strict=True)]
        self.w = [a + step * b for a, b in zip(leaf.w.entries(), leaf.ws.entries(), strict=True)]
        if leaf.q:
            self.y = [a + b for a, b in zip(self.y, (leaf.dy * moved).entries(), strict=True)]
            self.w = [a + b for a, b in zip(self.w, (leaf.dw * moved).entries(), strict=True)]
        self.d = leaf.units(angles)
        self.line = None

    def _part(self, row, j):
        """Entries of a row that belong to the tau of one sliding node."""
        tau = self.system.tau
        start = sum(len(tau[i]) for i in self.leaf.sliding[:j])
        return row[start : start + len(tau[self.leaf.sliding[j]])]

    def moves(self, change, free):
        """(12.3b) Derivatives of y and w where D of the sliding nodes changes so, and x without it by free."""
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
        return [v[0] * d[1] - v[1] * d[0] for _, v, d in self.directions()]

    def _of_G(self, dw, node=None):
        """The derivatives of G for derivatives of w; node is the one that turns."""
        found = []
        for i, v, d in self.directions():
            x, y = (dw[place] for place in self.system.tau[i])
            turn = v[0] * d[0] + v[1] * d[1] if i == node else arb(0)
            found.append(x * d[1] - y * d[0] + turn)
        return found

    @cached_property
    def slopes(self):
        """dG/dpsi by rows."""
        columns = [self._of_G(dw, i) for i, (_, dw) in zip(self.leaf.turning, self.by_angle, strict=True)]
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
            for j, moved in enumerate(flat):
                value += (leaf.dy[k, j] - s * leaf.dw[k, j]) * moved
            found.append(value)
        return found

    # -- conditions ----------------------------------------------------------------------------------------------------

    def conditions(self):
        """[7.3] What is to be at least zero, node by node."""
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
    view.line = [-x.mid() for x in drift], [a - (b - b.mid()) * change for a, b in zip(rest.entries(), drift, strict=True)]
    return [a + b * change + c for a, b, c in zip(middle.angles, *view.line, strict=True)]


@dataclass
class Root:
    """The only solution of a leaf's equations in a box of angles: its numbers in narrow balls."""

    codes: tuple
    box: list
    angles: list
    y: list
    w: list
    view: View
    index: int


def root_in(system, codes, box, alpha):
    """The only zero in a box of angles, or None where that is not shown."""
    try:
        leaf = Leaf(system, codes, box, alpha)
        middle, view = View(leaf, leaf.angles, leaf.alpha), View(leaf, box, alpha)
        found = krawczyk(view, middle)
        if not all(inside(a, b) for a, b in zip(found, box, strict=True)):
            return None
        for _ in range(_ROUNDS):
            leaf = Leaf(system, codes, found, alpha)
            middle, view = View(leaf, leaf.angles, leaf.alpha), View(leaf, found, alpha)
            found = [a.intersection(b) for a, b in zip(krawczyk(view, middle), found, strict=True)]
        index = leaf.index(view)
    except Singular:
        return None
    view.narrowed(middle)
    return Root(codes, box, found, view.y, view.w, view, index)


def root_near(system, codes, angles, alpha):
    """The zero to which Newton's method leads from some angles, or None."""
    angles = [angle.mid() for angle in angles]
    try:
        for _ in range(40):
            leaf = Leaf(system, codes, angles, alpha)
            view = View(leaf, leaf.angles, leaf.alpha)
            if not angles:
                break
            step = solve(arb_mat(view.slopes), column(view.G)).entries()
            if not all(abs(value) < 3 for value in step):
                return None
            angles = [(a - b).mid() for a, b in zip(angles, step, strict=True)]
            if all(abs(value) < arb(2) ** -100 for value in step):
                break
    except Singular:
        return None
    return root_in(system, codes, [angle + arb(0, arb(2) ** -60) for angle in angles], alpha)


def off_sectors(root):
    """Whether the direction of a root is certainly not in one of its leaf's sectors."""
    for i, _, (x, y) in root.view.directions():
        number = sector_of(root.codes[i])
        (a, b), (c, e) = corner(number), corner(following(number))
        if arb(a) * y - arb(b) * x < 0 or x * arb(e) - y * arb(c) < 0:
            return True
    return False


def contradicts(system, codes, angles, alpha):
    """Whether the equations have no solution within the energy bound (theory, (12.5)), also where M is singular."""
    leaf = Leaf.__new__(Leaf)
    leaf.system, leaf.codes = system, codes
    leaf.sort()
    if leaf.rigid:
        return False
    rows = (system.S * leaf.columns(leaf.along(angles, alpha))).tolist()
    g, c = system.load(alpha), [value / 2 for value in (system.inverse * column(system.load(alpha))).entries()]
    size = sum((a * b for a, b in zip(c, g, strict=True)), arb(0)) / 2
    least = [abs(c[k]) + abs(system.inverse[k, k] * size).sqrt() for k in leaf.picked]
    M = np.array([[float(x.mid()) for x in rows[k]] for k in leaf.picked])
    for vector in np.linalg.svd(M)[0].T[::-1][:2] if M.size else ():
        eta = [arb(float(x)) for x in vector]
        load = sum((a * g[k] for a, k in zip(eta, leaf.picked, strict=True)), arb(0))
        for j, bound in enumerate(least):
            load += abs(sum((a * rows[k][j] for a, k in zip(eta, leaf.picked, strict=True)), arb(0))) * bound * arb(0, 1)
        if load > 0 or load < 0:
            return True
    return False


def halves(box):
    return [between(box.lower(), box.mid()), between(box.mid(), box.upper())]


def explore(system, codes, alpha, settled, piece=None, boxes=BOXES):
    """Cut the sectors of a leaf, and alphas, into boxes that hold no solution or are settled.

    settled is asked of every box (angles, alpha, view or None) that may hold one. A ball of alphas may be wider than
    the piece that it stands for.
    """
    sectors = [angles_of(sector_of(code)) for code in codes if sector_of(code)]
    widths = [float(box.rad()) for box in sectors] + [max(float(alpha.rad()), 1e-300)]
    waiting = [(sectors, alpha)]
    while waiting:
        boxes -= 1
        if boxes < 0:
            raise Undecided("more boxes than the judge takes")
        angles, part = waiting.pop()
        if piece and (part < piece[0] or part > piece[1]):
            continue
        left = angles
        try:
            leaf = Leaf(system, codes, angles, part)
            view, middle = View(leaf, angles, part), View(leaf, leaf.angles, leaf.alpha)
            view.narrowed(middle)
            if view.is_violated() or any(value > 0 or value < 0 for value in view.G):
                continue
            try:
                found = krawczyk(view, middle)
                if not all(a.overlaps(b) for a, b in zip(found, angles, strict=True)):
                    continue
                left = [a.intersection(b) for a, b in zip(angles, found, strict=True)]
            except Singular:
                pass
        except Singular:
            view = None
            if contradicts(system, codes, angles, part):
                continue
        if settled(angles, part, view):
            continue
        shares = [float(box.rad()) / width for box, width in zip([*angles, part], widths, strict=True)]
        wide = [share > 1e-3 * max(shares) for share in shares]
        if any(many and a.rad() < 0.7 * b.rad() for many, a, b in zip(wide, left, angles, strict=False)):
            waiting.append((left, part))
            continue
        shares = [float(box.rad()) / width for box, width in zip([*left, part], widths, strict=True)]
        k = max(range(len(shares)), key=shares.__getitem__)
        if shares[k] < 1e-25:
            raise Undecided("a box that is as narrow as this is not decided")
        for half in reversed(halves([*left, part][k])):
            parts = [*left, part]
            parts[k] = half
            waiting.append((parts[:-1], parts[-1]))


def roots_of(system, codes, alpha):
    """All solutions of a complete assignment at one alpha; solutions at the border of conditions are not decided."""
    known = []

    def settled(angles, _, view):
        if view is None:
            return False
        if any(all(a.contains(b) for a, b in zip(root.box, angles, strict=True)) for root in known):
            return True
        root = root_in(system, codes, [a.mid() + arb(0, float(a.rad()) * 1.5 + 1e-30) for a in angles], alpha)
        if root is not None:
            known.append(root)
        return root is not None

    explore(system, codes, alpha, settled)
    return [root for root in known if not (root.view.is_violated() or off_sectors(root))]
