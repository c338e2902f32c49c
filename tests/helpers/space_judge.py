"""A judge of proofs in 3D that follows docs/proof_format.md and nothing else, in balls of many digits.

It imports nothing of enumsol; of a ContactProblem3D it reads the arrays. Numbers in brackets are sections of the
document. What a leaf claims is decided in its own way: exclusions as they stand, leaves by cutting their directions
into boxes, so that no claim is refused because the checker's way does not lead to it.
"""

from flint import arb, arb_mat, ctx, fmpq
from rational_checker import are, record_of, records_of  # noqa: F401
from rational_forms import Refused, decimal_fraction, exact, integer, need
from space_judge_certificates import Weights, boxed_solution, only_solution, serving
from space_judge_data import (
    SpaceData,
    Terms,
    Undecided,
    column,
    fingerprint,
    floating_margin,
    is_code,
    is_complete,
    is_definite,
    is_split,
    length_of,
    margin,
    most,
    positive,
    sector_of,
)
from space_judge_graph import Graph
from space_judge_leaves import angles_of
from space_judge_references import RootForm, weights_of_balance
from space_judge_zeros import explore, root_near, roots_of

DIGITS = 320


def judge(problem, file):
    """The counts of a proof file that holds. Raises Refused, or Undecided where the judge cannot tell."""
    return judge_records(problem, records_of(file))


def judge_records(problem, records):
    need(len(records) > 1 and isinstance(records[0], dict), "no header")
    before, ctx.prec = ctx.prec, DIGITS
    try:
        header, kind = records[0], records[0].get("kind")
        need(kind in ("space", "graph"), "an unknown kind of proof")
        data = data_of(problem, header)
        if kind == "graph":
            return Graph(problem, header, data, units(header, problem.p)[0]).run(records[1:])
        return Point(problem, header, data).run(records[1:])
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, ZeroDivisionError) as error:
        raise Refused(f"a record cannot be read: {error!r}") from error
    finally:
        ctx.prec = before


def data_of(problem, header):
    """[3] The data of the problem of which a header is."""
    need(header["format"] == "enumsol-proof" and integer(header["version"]) == 2, "another format or version")
    need(header["problem"] == fingerprint(problem) and integer(header["p"]) == problem.p, "another problem")
    need(header["data"] == "problem", "other data")
    data = SpaceData(problem)
    if data.modes is not None:
        bound = header["max_rigid_displacement"]
        need(type(bound) is float and bound == problem.rigid_reach, "another bound of the rigid displacement")
    return data


def floats(values, count):
    need(isinstance(values, list) and len(values) == count, f"expected {count} numbers")
    return [arb(exact(value)) for value in values]


def units(record, p):
    """[4.6] Factors of multipliers on rows of forces and of displacements, and the units of forces."""
    force, length = ([integer(value) for value in record[key]] for key in ("force", "length"))
    need(len(force) == len(length) == p, "units are no lists of p integers")
    need(all(-900 <= value <= 900 for value in force + length), "units are out of range")
    need(len({a + b for a, b in zip(force, length, strict=True)}) == 1, "units do not fit together")
    return [length, force], [arb(fmpq(2) ** value) for value in force]


class Point:
    """[5] A set of roots at one alpha."""

    def __init__(self, problem, header, data):
        self.data, self.p = data, problem.p
        self.alpha = decimal_fraction(header["alpha"])
        self.scale, force = units(header, self.p)
        self.system = self.data.at(self.alpha)
        self.full = self.system.bordered
        self.unit = [force[i] for i in self.system.node_of]
        self.tangents = [len(places) for places in self.system.tau]
        self.declared = []
        self.roots, self.undecided, self.leaves = [], 0, 0

    def run(self, records):
        due, position = [(6,) * self.p], 0
        while due:
            record, codes = records[position], due.pop()
            position += 1
            need(isinstance(record, list) and record, "the tree breaks off")
            if record[0] == "b":
                due += reversed(self.split(codes, *record[1:]))
            elif record[0] == "q":
                self.declare(*record[1:])
                due.append(codes)
            else:
                self.leaves += 1
                need(record[0] in ("xinrou" if self.system.rigid else "xnrlazu"), "no such leaf")
                getattr(self, f"leaf_{record[0]}")(codes, *record[1:])
        counts = {"roots": len(self.roots), "undecided": self.undecided, "leaves": self.leaves}
        need(are(records[position:], [counts]), f"the counts are {counts}")
        return counts

    def split(self, codes, node, children):
        """[5.2]"""
        need(type(node) is int and 0 <= node < self.p and all(type(child) is int for child in children), "no branching")
        need(is_split(codes[node], children, self.tangents[node]), "a branching does not cover its assignment")
        return [(*codes[:node], child, *codes[node + 1 :]) for child in children]

    # -- exclusions ----------------------------------------------------------------------------------------------------

    def terms(self, codes, rows, text):
        return Terms(self.system, self.scale, codes, rows, text)

    def leaf_x(self, codes, rows, text, back=None):
        """[6.1], [6.2] By the energy, or by a form."""
        terms = self.terms(codes, rows, text)
        if back is not None:
            self.excluded(*margin(terms, *self.form_at(back)))
            return
        self.excluded(*(floating_margin(terms) if self.system.rigid else margin(terms)))

    def leaf_i(self, codes, z):
        """[6.3] No forces that the assignment allows are in balance with the load."""
        need(self.system.rigid, "a body that is held")
        _, h, _ = self.system.rigid
        z, pull = self.data.pulls(self.system, floats(z, len(h)), self.scale[0])
        need(sum((a * b for a, b in zip(z, h, strict=True)), arb(0)) > 0, "z does not push against the load")
        for i, (code, places) in enumerate(zip(codes, self.system.tau, strict=True)):
            if code != 0:
                need(pull[i] + most(code, [pull[k] for k in places]) <= 0, "forces may be in balance")

    def excluded(self, value, size):
        need(
            positive(value, "a margin"),
            f"the margin is {float((value / (size + arb(2) ** -900)).mid()):.1e} of its terms",
        )

    def declare(self, codes, numbers, more, *claim):
        """[6.2] Forms; [6.7] roots."""
        if self.system.rigid:
            self.declared.append(self.declared_root(codes, numbers, more, *claim))
            return
        need(not claim, "an enclosure of no root")
        need(codes == [6] * self.p, "a form about an assignment")
        need(more == [], "a form has more numbers")
        self.declared.append(self.plain_form(floats(numbers, self.system.m + self.p)))

    def form_at(self, back):
        """[6.2] The form declared so many before."""
        need(not self.system.rigid and 1 <= integer(back) <= len(self.declared), "no form is declared")
        return self.declared[-back]

    def declared_root(self, leaf, numbers, more, mid, rad, index):
        """[6.7] The root of a leaf, which counts, and its form."""
        numbers = floats(numbers, self.p + 2 * self.system.m)
        balance, share = floats(more, 2)
        need(balance >= 0, "a factor of a square is negative")
        need(isinstance(leaf, list) and len(leaf) == self.p and all(map(is_code, leaf, self.tangents)), "no such leaf")
        need(is_complete(leaf), "the leaf is still open")
        root = self.root_at(tuple(leaf), mid, rad, index)
        self.count(root)
        balance = weights_of_balance(self.data, self.scale, balance)
        return RootForm(self.system, Weights(self.system, numbers), root, leaf, balance, share)

    def leaf_o(self, codes, back, rows, products, turns=None):
        """[6.7] No other root than the one that was declared so many before."""
        need(1 <= integer(back) <= len(self.declared), "no root is declared")
        form, (length, force) = self.declared[-back], self.scale
        if turns is not None:
            need(rows == products == [], "there are rows beside theta")
            form.sole(floats(turns, self.system.m - self.p))
            return
        need(isinstance(rows, list) and isinstance(products, list), "no lists of rows and products")
        places, factors = [], []
        for *pair, z in products:
            pair_of = [self.place(row) for row in pair]
            (_, one, _), (_, other, _) = pair_of
            factor = floats([z], 1)[0] * arb(2) ** (length[0] + force[0] - length[one] - length[other])
            need(factor > 0, "a factor is not positive")
            places += [place for place in pair_of if place not in places]
            factors.append(([places.index(place) for place in pair_of], factor))
        tight = [form.tight(codes, *place) for place in places]
        form.alone([form.equation(codes, *self.place(row)) for row in rows], tight, factors)

    def place(self, row):
        """Kind, node and number of a row."""
        kind, node, number = map(integer, row)
        need(0 <= kind <= 9 and 0 <= node < self.p, "there is no such row")
        return kind, node, number

    def plain_form(self, numbers):
        """H and b of [6.2]."""
        system, p, m = self.system, self.p, self.system.m
        mu, kappa, c = numbers[:p], numbers[p : 2 * p], numbers[2 * p :]
        W = arb_mat(m, m)
        for i, places in enumerate(system.tau):
            W[i, i] = mu[i]
            mine = [c[place - p] for place in places]
            positive(kappa[i] - length_of(mine), "kappa - abs(c)") or need(False, "c is not shorter than kappa")
            for place, value in zip(places, mine, strict=True):
                W[place, place], W[i, place] = kappa[i], -value
        H = W * system.S
        H = (H + H.transpose()) / arb(2)
        need(is_definite(H), "a form is not positive definite")
        return H, (W * column(system.g0)).entries()

    # -- complete assignments ------------------------------------------------------------------------------------------

    def leaf_n(self, codes):
        need(is_complete(codes), "the assignment is still open")
        need(not roots_of(self.full, codes, arb(self.alpha)), "there is a solution")

    def leaf_r(self, codes, mid, rad, index):
        need(is_complete(codes), "the assignment is still open")
        root = self.root_at(codes, mid, rad, index)
        for other in roots_of(self.full, codes, arb(self.alpha)):
            need(same(root, other), "the assignment holds another solution")
        self.count(root)

    def root_at(self, codes, mid, rad, index):
        """The regular root of these statuses in a ball; directions may be outside of the sectors."""
        mid, rad = self.ball(mid, rad)
        angles = []
        for i, code in enumerate(codes):
            if sector_of(code):
                x, y = (mid[place] for place in self.system.tau[i])
                angles.append(arb.atan2(y, x) if length_of([x, y]) > 0 else angles_of(sector_of(code)))
        root = root_near(self.full, codes, angles, arb(self.alpha))
        if root is None and self.system.rigid:
            near = [a + arb(0, b.upper()) for a, b in zip(mid, rad, strict=True)]
            for other in roots_of(self.full, codes, arb(self.alpha)):
                if all(a.overlaps(b) for a, b in zip(other.y, near, strict=False)):
                    root = other
        if root is None:
            raise Undecided("no root is found")
        need(root.view.is_strict(), "a condition does not hold strictly")
        need(integer(index) == root.index, "the index is another")
        self.within(root.y[: self.system.m], mid, rad)
        return root

    def ball(self, mid, rad):
        """Midpoints and radii in the problem's units."""
        m = self.system.m
        mid, rad = floats(mid, m), floats(rad, m)
        need(min(rad, default=0) >= 0, "a radius is negative")
        return [[a * b for a, b in zip(part, self.unit, strict=True)] for part in (mid, rad)]

    def within(self, y, mid, rad):
        for value, a, b in zip(y, mid, rad, strict=True):
            # a number that is known exactly may be at the border
            near = abs(value - a)
            if not near <= b:
                need(not near > b, "the root is not in its ball")
                if not near.upper() <= b + arb(2) ** -200:
                    raise Undecided("the root may not be in its ball")

    def count(self, root):
        """[5.4]"""
        if not any(same(root, other) for other in self.roots):
            self.roots.append(root)

    # -- certificates and boxes ----------------------------------------------------------------------------------------

    def leaf_a(self, codes, leaf, numbers, mid, rad, index):
        """[6.5] One solution by one certificate."""
        numbers = floats(numbers, self.p + 2 * self.system.m)
        for i, (force, length) in enumerate(zip(*reversed(self.scale), strict=True), 2 * self.p):
            numbers[i] *= arb(2) ** (length - force)
        weights = Weights(self.system, numbers)
        whole = set(codes) == {6}
        need(isinstance(leaf, list) and (leaf or whole), "no leaf is named")
        if leaf:
            need(len(leaf) == self.p and all(map(is_code, leaf, self.tangents)) and is_complete(leaf), "no such leaf")
            for code, other in zip(codes, leaf, strict=True):
                need(code == other if code in (0, 1, 2, 3, 4) else code == 6 or other != 0, "a leaf elsewhere")
            root = self.root_at(tuple(leaf), mid, rad, index)
            y, w = root.y, root.w
        else:
            y, w = only_solution(weights, self.ball(mid, rad)[0])
            self.within(y, *self.ball(mid, rad))
        need(not whole or (integer(index) == 1 and self.leaves == 1), "the index is another")
        need(is_definite(weights.form(serving(weights, y, w), None if whole else codes)), "the form is not definite")
        if leaf:
            self.count(root)
        else:
            self.roots.append(None)

    def leaf_l(self, codes, centre, radius, rho, mid, rad, index):
        """[6.6] All solutions of a complete assignment in a box that holds one."""
        box = Boxed(self, centre, radius, rho, mid, rad, index)
        need(is_complete(codes), "the assignment is still open")

        def settled(angles, _, view):
            return view is not None and box.holds(view.zeta(box.steps))

        explore(self.system, codes, arb(self.alpha), settled)
        self.count(box)

    def leaf_z(self, codes):
        need(set(codes) == {6} and not self.roots and self.leaves == 1, "only a whole tree is unloaded")
        need(all(value.is_zero() for value in self.system.g0), "the body is not unloaded")
        self.roots.append(None)

    def leaf_u(self, codes, reason):
        need(isinstance(reason, str), "no reason")
        self.undecided += 1


class Boxed:
    """The only solution of the problem in a box of zeta."""

    def __init__(self, point, centre, radius, rho, mid, rad, index):
        m = point.system.m
        centre, self.radius = (point.ball(part, [0.0] * m)[0] for part in (centre, radius))
        force, length = ([arb(2) ** part[i] for i in point.system.node_of] for part in (point.scale[1], point.scale[0]))
        self.steps = [a * b / c for a, b, c in zip(floats(rho, m), force, length, strict=True)]
        need(min(self.radius) > 0 and min(self.steps) > 0, "a radius or a step is not positive")
        self.natural, self.middle, self.y, sign = boxed_solution(point.system, centre, self.radius, self.steps)
        need(integer(index) == sign, "the index is another")
        point.within(self.y, *point.ball(mid, rad))

    def holds(self, zeta):
        return all(abs(a - b) <= c for a, b, c in zip(zeta, self.middle, self.radius, strict=True))


def same(root, other):
    """Whether two solutions are one: by the set in which one is the only one, or by their forces."""
    if root is None or other is None:
        raise Undecided("solutions beside the only one")
    if not all(a.overlaps(b) for a, b in zip(root.y, other.y, strict=True)):
        return False
    for one, two in ((root, other), (other, root)):
        if isinstance(one, Boxed):
            if one.holds(one.natural.place_of(two.y, arb(0))):
                return True
        elif not isinstance(two, Boxed):
            if [min(code, 8) for code in one.codes] != [min(code, 8) for code in two.codes]:
                return False
            if all(near(a, b) for a, b in zip(one.box, two.angles, strict=True)):
                return True
    raise Undecided("it is not known whether two solutions are one")


def near(box, angle):
    """Whether an angle lies in a box, up to whole turns."""
    turns = round(float(((box - angle) / (2 * arb.pi())).mid()))
    return box.contains(angle + turns * 2 * arb.pi())
