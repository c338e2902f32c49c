"""All solutions of a complete assignment in 3D, for space_judge: its directions, and alphas, cut until all is known."""

from dataclasses import dataclass

import numpy as np
from flint import arb, arb_mat
from space_judge_data import Undecided, column, corner, following, sector_of
from space_judge_leaves import Leaf, Singular, View, angles_of, between, krawczyk, solve

BOXES = 6000
#: As many times a box of a zero is made narrower.
_ROUNDS = 12


def inside(inner, outer):
    return outer.contains_interior(inner)


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


def root_in(system, codes, box, alpha, free=None):
    """The only zero in a box of angles, or None where that is not shown."""
    try:
        leaf = Leaf(system, codes, box, alpha, free)
        middle, view = View(leaf, leaf.angles, leaf.alpha), View(leaf, box, alpha)
        found = krawczyk(view, middle)
        if not all(inside(a, b) for a, b in zip(found, box, strict=True)):
            return None
        for _ in range(_ROUNDS):
            leaf = Leaf(system, codes, found, alpha, free)
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


def narrow(system, codes, angles, alpha, free=None):
    """A view of a box of angles, and what Krawczyk's operator leaves of it: None if it holds no solution."""
    leaf = Leaf(system, codes, angles, alpha, free)
    view, middle = View(leaf, angles, alpha), View(leaf, leaf.angles, leaf.alpha)
    view.narrowed(middle)
    if view.is_violated() or any(value > 0 or value < 0 for value in view.G):
        return view, None
    view.left = across(view, middle)
    if view.left is None:
        return view, None
    try:
        found = krawczyk(view, middle)
    except Singular:
        return view, angles
    if not all(a.overlaps(b) for a, b in zip(found, angles, strict=True)):
        return view, None
    return view, [a.intersection(b) for a, b in zip(angles, found, strict=True)]


def across(view, middle):
    """What the zeros of G leave of the alphas of a box, which they may pass near a fold; None if it holds none."""
    left = view.alpha
    if not left.rad() > 0:
        return left
    steps = [a - b for a, b in zip(view.angles, middle.angles, strict=True)]
    for at, row, by in zip(middle.G, view.slopes, view.by_alpha_of_G, strict=True):
        if by > 0 or by < 0:
            rates = [-(a / by) for a in row]
            rest = [(a - a.mid()) * b for a, b in zip(rates, steps, strict=True)]
            rest = sum(rest, -at / by)
            found = middle.alpha + sum((a.mid() * b for a, b in zip(rates, steps, strict=True)), rest)
            if not found.overlaps(left):
                return None
            left = left.intersection(found)
            if len(steps) == 1:
                view.across = rates[0].mid(), steps[0], rest
    return left


def with_one_free(system, codes, angles, alpha):
    """The same where M is singular in the box, with one component of x left free."""
    rigid = list(range(len(system.node_of), system.m))
    for free in rigid or [i for i, code in enumerate(codes) if sector_of(code)]:
        try:
            box = [*angles, free_bounds(system, free, alpha)]
            # the equations are affine in the free component
            leaf = Leaf(system, codes, [*angles, arb(0)], alpha, free)
            plain = View(leaf, [*angles, arb(0)], alpha)
            for at, row in zip(plain.G, plain.slopes, strict=True):
                if row[-1] > 0 or row[-1] < 0:
                    found = -at / row[-1]
                    if not found.overlaps(box[-1]):
                        return plain, None
                    box[-1] = box[-1].intersection(found)
            view, left = narrow(system, codes, box, alpha, free)
            for _ in range(6):
                if left is None:
                    return view, None
                if not left[-1].rad() < 0.9 * box[-1].rad():
                    break
                box = [*angles, left[-1]]
                view, left = narrow(system, codes, box, alpha, free)
        except Singular:
            continue
        return view, None if left is None else left[:-1]
    return None, angles


def free_bounds(system, free, alpha):
    """Of a component of x: by the energy bound (theory, (12.9)), or of the rigid displacement."""
    if free >= len(system.node_of):
        rho = system.rigid[2][free - len(system.node_of)]
        return arb(0, rho.upper())
    g = system.load(alpha)
    c = [value / 2 for value in (system.inverse * column(g)).entries()]
    size = sum((a * b for a, b in zip(c, g, strict=True)), arb(0)) / 2
    return arb(0, (abs(c[free]) + abs(system.inverse[free, free] * size).sqrt()).upper())


def contradicts(system, codes, angles, alpha):
    """Whether the equations have no solution within the energy bound (theory, (12.9)), also where M is singular."""
    leaf = Leaf.__new__(Leaf)
    leaf.system, leaf.codes, leaf.free = system, codes, None
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
            load += (
                abs(sum((a * rows[k][j] for a, k in zip(eta, leaf.picked, strict=True)), arb(0))) * bound * arb(0, 1)
            )
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
        try:
            view, left = narrow(system, codes, angles, part)
        except Singular:
            view, left = None, angles
            if contradicts(system, codes, angles, part):
                continue
            view, left = with_one_free(system, codes, angles, part)
        if left is None:
            continue
        if settled(angles, part, view):
            continue
        if part.rad() > 0 and view is not None and view.leaf.free is None and view.is_vague():
            # the equations are nearly singular: the same with one component of x left free
            other, found = with_one_free(system, codes, angles, part)
            if found is None or settled(angles, part, other):
                continue
            left = [a.intersection(b) for a, b in zip(left, found, strict=True)]
        if view is not None and view.left is not None:
            part = view.left
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
        # behind the angles there may be a component of x that is left free
        if any(all(a.contains(b) for a, b in zip(root.box, view.angles, strict=False)) for root in known):
            return True
        wide = [a.mid() + arb(0, float(a.rad()) * 1.5 + 1e-30) for a in view.angles]
        root = root_in(system, codes, wide, alpha, view.leaf.free)
        if root is not None:
            known.append(root)
        return root is not None

    explore(system, codes, alpha, settled)
    return [root for root in known if not (root.view.is_violated() or off_sectors(root))]
