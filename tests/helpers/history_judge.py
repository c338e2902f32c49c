"""[9] A judge of proofs of histories, in 2D and 3D, that follows docs/proof_format.md and nothing else.

It imports nothing of enumsol; of a problem it reads the arrays. Searches from one offset in 2D go to rational_checker,
and searches in 3D to space_judge, which takes offsets as balls. From a ball in 2D the offsets are further unknowns: all
selections are tried in rationals, and claims are compared with what they hold. Numbers in brackets are sections of the
document.
"""

from functools import cached_property
from itertools import product

import numpy as np
import space_judge
from flint import arb, ctx, fmpq, fmpq_mat
from rational_checker import FloatingPoint, Point, are
from rational_forms import Forms, Refused, _value, column_of, decimal_fraction, exact, fingerprint, integer, need
from space_judge_data import Undecided

ARRAYS = "n p A Bn Bt Bt1 Bt2 f gap friction friction_slope affine_friction load_slope rigid_modes rigid_reach"
ARRAYS += " max_rigid_displacement"
FINAL = {True: (0, 1, 2, 3), False: (0, 4)}
#: Codes that stand for others, as far as leaves have them.
STANDS = {5: (1, 2, 3), 6: (0, 1, 2, 3, 4), 7: (0, 2), 8: (0, 3)}


def judge_history(problem, records):
    """Whether a proof shows all histories, and up to which step there is one. Raises Refused, or Undecided."""
    need(len(records) > 1 and isinstance(records[0], dict), "no header")
    before, ctx.prec = ctx.prec, space_judge.DIGITS
    try:
        return History(problem, records[0]).run(records[1:])
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, ZeroDivisionError) as error:
        raise Refused(f"a record cannot be read: {error!r}") from error
    finally:
        ctx.prec = before


class Started:
    """The problem of one step from one start: its arrays."""

    def __init__(self, problem, load, friction, mid, rad):
        for name in ARRAYS.split():
            if hasattr(problem, name):
                setattr(self, name, getattr(problem, name))
        shape = np.shape(problem.slip_offset)
        self.slip_offset = np.reshape(np.array(mid), shape)
        self.offset_radius = None if rad is None else np.reshape(np.array(rad), shape)
        if load is not None:
            self.f, self.load_slope = np.array(load), None
        if friction is not None:
            given = np.reshape(np.array(friction), shape)
            if len(shape) == 1:
                self.affine_friction = given, 0 * given
            else:
                self.friction, self.friction_slope = given.T, 0 * given.T


class History:
    """Searches, and what follows from them."""

    def __init__(self, problem, header):
        names = {"format", "version", "kind", "problem", "p", "steps", "stages"}
        self.free, self.plane = problem.rigid_modes is not None, not hasattr(problem, "Bt1")
        need(set(header) == names, "other names in the header")
        need(header["format"] == "enumsol-proof" and integer(header["version"]) == 2, "another format or version")
        of = fingerprint if self.plane else space_judge.fingerprint
        need(header["kind"] == "history" and header["problem"] == of(problem), "another problem")
        need(integer(header["p"]) == problem.p, "another problem")
        self.problem, self.size = problem, int(np.size(problem.slip_offset))
        self.steps = [self._step(*step) for step in header["steps"]]
        need(self.steps, "no steps")
        self.count, self.searches = integer(header["stages"]), []

    def _step(self, alpha, load, friction):
        need(load is None or len(load) == self.problem.n, "a load has another size")
        need(friction is None or len(friction) == self.size, "coefficients have another size")
        load, friction = (part and [_number(x) for x in part] for part in (load, friction))
        need(friction is None or min(friction) >= 0, "friction is negative")
        return decimal_fraction(alpha), load, friction

    def run(self, records):
        place = 0
        for number in range(self.count):
            kind, step, mid, rad, following = records[place]
            need(kind == "s" and 1 <= integer(step) <= len(self.steps), "no such search")
            need(len(mid) == self.size and (rad is None or len(rad) == self.size), "a start has another size")
            mid, rad = (part and [_number(x) for x in part] for part in (mid, rad))
            need(rad is None or min(rad) >= 0, "a radius is negative")
            need(all(number < integer(k) < self.count for k in following), "what follows is no later search")
            end = next(k for k in range(place + 2, len(records)) if isinstance(records[k], dict))
            search = Search(self, step, mid, rad, following, records[place + 1 : end + 1])
            self.searches.append(search)
            place = end + 1
        need(are(records[place:], [{"stages": self.count}]), "another end")
        return self.conclusions()

    def conclusions(self):
        """[9] Under "Footer"."""
        first = [search for search in self.searches if search.step == 1]
        own = np.ravel(self.problem.slip_offset).tolist()
        need(len(first) == 1 and first[0].mid == own and first[0].rad is None, "another beginning")
        for search in self.searches:
            need(all(self.searches[k].step == search.step + 1 for k in search.following), "another step follows")
        reached, due = [], [first[0]]
        while due:
            search = due.pop()
            if search not in reached:
                reached.append(search)
                due += [self.searches[k] for k in search.following]
        last = len(self.steps)
        whole = all(search.whole and (search.step == last or self.followed(search)) for search in reached)
        unique, search = 0, first[0]
        while search.whole and len(search.ends) == 1:
            unique += 1
            if search.step == last or len(search.following) != 1 or not self.followed(search):
                break
            search = self.searches[search.following[0]]
        return whole, unique

    def followed(self, search):
        """Whether every root of a search leaves the nodes in the ball of one that follows."""
        return all(any(self.searches[k].holds(end) for k in search.following) for end in search.ends)


class Search:
    """One step from one start; ends has for every root the positions, or the corners of these, in which it may end."""

    def __init__(self, history, step, mid, rad, following, records):
        alpha, load, friction = history.steps[step - 1]
        self.step, self.mid, self.rad, self.following = step, mid, rad, following
        problem, header = Started(history.problem, load, friction, mid, rad), records[0]
        if history.free and problem.max_rigid_displacement is None:
            problem.rigid_reach = header["max_rigid_displacement"]
            need(exact(problem.rigid_reach) > 0, "a bound is not positive")
        need(("kind" not in header) if history.plane else header.get("kind") == "space", "no search at one alpha")
        need(decimal_fraction(header["alpha"]) == alpha, "another alpha than the step's")
        if not history.plane:
            data = space_judge.data_of(problem, header)
            point = space_judge.Point(problem, header, data)
            counts = point.run(records[1:])
            self.ends = [[self._positions(problem, data, point, root)] for root in point.roots]
        else:
            point = (PlaneFromBall if rad is not None else FloatingPoint if history.free else Point)(problem, header)
            counts = point.run(records[1:])
            self.ends = point.ends() if rad is not None else self._ends(problem, point)
        self.whole = not counts["undecided"] and not counts.get("families")

    @staticmethod
    def _ends(problem, point):
        """Of roots in rationals."""
        need(not point.closings.points, "a root of a leaf that this judge does not follow")
        selections = [*point.roots, *(codes for codes, _ in point.polytopes)]
        found = {x: codes for codes in selections for x in point.forms.hull(codes)}
        return [[_position(problem, point.forms, codes, x)] for x, codes in found.items()]

    @staticmethod
    def _positions(problem, data, point, root):
        """Of a root in 3D, in balls."""
        if root is None or not hasattr(root, "codes"):
            raise Undecided("a root of a leaf that this judge does not follow")
        p, system = problem.p, point.system
        F = [[fmpq(1)] * p, *data.friction(point.alpha)]
        force = [arb(0)] * (3 * p)
        for i, places in enumerate(system.tau):
            force[i] = root.y[i]
            for k, place in zip(system.axes[i], places, strict=True):
                force[(1 + k) * p + i] = root.y[place] * arb(F[1 + k][i])
        moved = [a + arb(point.alpha) * b for a, b in zip(data.free0, data.g1, strict=True)]
        q = [-x for x in root.y[system.m :]]
        end = []
        for k in range(p, 3 * p):
            if root.codes[k % p] == 1 and k // p - 1 in system.axes[k % p]:
                end.append(data.offset[k])
                continue
            row = sum((a * b for a, b in zip(data.S.tolist()[k], force, strict=True)), arb(0))
            rigid = sum((data.G[j, k] * x for j, x in enumerate(q)), arb(0))
            end.append(moved[k] - row + rigid)
        return [end[k * p + i] for i in range(p) for k in (0, 1)]

    def holds(self, ends):
        """Whether all these positions are among those from which this search starts."""
        rad = self.rad or [0.0] * len(self.mid)
        about = arb if isinstance(ends[0][0], arb) else fmpq
        if about is fmpq:
            mid, rad = ([exact(x) for x in part] for part in (self.mid, rad))
            return all(abs(x - m) <= r for end in ends for x, m, r in zip(end, mid, rad, strict=True))
        off = [abs(x - arb(m)) - arb(r) for end in ends for x, m, r in zip(end, self.mid, rad, strict=True)]
        if not all(value.upper() < arb(2) ** -200 for value in off) and not any(value > 0 for value in off):
            raise Undecided("it is not known whether a root is followed")
        return not any(value > arb(2) ** -200 for value in off)


class PlaneFromBall(Point):
    """[9] A search in 2D from a ball: (lambda, -q, how far the offsets are from the midpoints), in rationals."""

    def __init__(self, problem, header):
        super().__init__(problem, header)
        self.problem, self.rad = problem, [exact(x) for x in problem.offset_radius.tolist()]
        if problem.rigid_modes is not None:
            self.same_bound(header)
        self.found = []

    def lifted(self, name, codes):
        """Forms with the offsets as unknowns."""
        forms, p = getattr(self.forms, name)(codes), self.p
        size, given = len(self.forms.rows), self.forms.g
        moved = []
        for i in range(p):
            # w_t is less by what the offset is more
            self.forms.g = [x - int(k == p + i) for k, x in enumerate(given)]
            moved.append([form[-1] for form in getattr(self.forms, name)(codes)])
        self.forms.g = given
        return [[*form[:size], *(m[k] - form[-1] for m in moved), form[-1]] for k, form in enumerate(forms)]

    @cached_property
    def box(self):
        """Conditions on the offsets."""
        found, size = [], len(self.forms.rows)
        for i, most in enumerate(self.rad):
            for side in (1, -1):
                found.append([fmpq(0)] * (size + self.p) + [most])
                found[-1][size + i] = fmpq(side)
        return found

    @cached_property
    def holding(self):
        """Selections that hold for some offset of the ball, with the corners of all (lambda, -q, offset)."""
        found = {}
        for codes in product(*(FINAL[friction] for friction in self.friction)):
            corners = Forms.vertices(self.lifted("equations", codes), self.lifted("conditions", codes) + self.box)
            if corners:
                found[codes] = corners
        return found

    def below(self, codes):
        """Selections below an assignment that hold somewhere."""
        return [own for own in self.holding if _is_below(own, codes)]

    def declare(self, codes, *_):
        self.declared.append(tuple(codes))

    def leaf(self, codes, kind, *rest):
        """[5.3] Claims are compared with what is true for every offset."""
        if kind in ("x", "n", "i"):
            need("rational" not in rest, "a leaf in rationals from a ball")
            if kind == "x" and len(rest) == 2:
                self.terms(codes, rest, self.scale, self.friction)
            need(kind != "n" or max(codes) < 5, "a selection is not complete")
            need(not self.below(codes), "a selection has a solution")
        elif kind == "u":
            need(len(rest) == 1 and isinstance(rest[0], str), "no reason")
            self.undecided += 1
        elif kind == "r":
            need(max(codes) < 5, "a selection is not complete")
            self.shared(codes, [], *rest)
        elif kind == "o":
            back, _, _, *claim = rest
            need(1 <= integer(back) <= len(self.declared), "a root was not declared")
            root = self.declared[-back]
            need([own for own in self.below(codes) if own != root] == [], "there is another solution")
            below = _is_below(root, codes)
            need(below == bool(claim), "an enclosure is missing, or a root lies elsewhere")
            if claim:
                self.shared(root, [], *claim)
        elif kind == "g":
            self.shared(codes, *rest)
        else:
            raise Undecided("a leaf that this judge does not take")

    def shared(self, codes, slips, mid, rad, index):
        """[6.4] One root, of one selection or shared by several, for every offset."""
        nodes = [integer(node) for node, _ in slips]
        need(len(nodes) <= 8 and nodes == sorted(set(nodes)), "too many nodes, or not ascending")
        for node, code in slips:
            need(0 <= node < self.p and self.friction[node], "a node that cannot slip")
            need(integer(code) in (2, 3) and codes[node] in (1, code), "a node that slips otherwise")
        selections, size = [], len(self.forms.rows)
        for chosen in product(*((1, code) for _, code in slips)):
            between = dict(zip(nodes, chosen, strict=True))
            selections.append(tuple(between.get(i, code) for i, code in enumerate(codes)))
        for selection in selections:
            N = fmpq_mat([form[:-1] for form in self.forms.equations(selection)])
            need(N.det() != 0, "a selection is singular")
            sign = (1 if N.det() > 0 else -1) * (-1) ** (size - 2 * self.p)
            need(integer(index) == sign, "an index is wrong")
            excepted = [(1 if selection[node] == 1 else 0, node, code) for node, code in slips]
            self.corners(selection, N, mid, rad, excepted)
        self.found.append(frozenset(selections))

    def corners(self, selection, N, mid, rad, excepted):
        """At every corner of the ball: conditions are strict but for those excepted, and the enclosure holds it."""
        loose = []
        for stuck, node, code in excepted:
            kind = code if stuck else code + 3
            loose.append(self.forms.row(kind, node))
        need(len(mid) == len(rad) == 2 * self.p, "an enclosure has another size")
        equations, strict = self.lifted("equations", selection), self.lifted("conditions", selection)
        strict = [
            lifted for lifted, plain in zip(strict, self.forms.conditions(selection), strict=True) if plain not in loose
        ]
        size = len(self.forms.rows)
        for sides in product((-1, 1), repeat=self.p):
            offset = [side * value for side, value in zip(sides, self.rad, strict=True)]
            right = [-_value([*form[size:-1], form[-1]], offset) for form in equations]
            point = [*N.solve(column_of(right)).entries(), *offset]
            need(all(_value(form, point) > 0 for form in strict), "a condition is not strict")
            for x, m, r in zip(point, map(exact, mid), map(exact, rad), strict=False):
                need(abs(x - m) <= r, "an enclosure misses the root")

    def joined(self):
        """Different roots, of leaves that name selections."""
        if any(a != b and a & b for a in self.found for b in self.found):
            raise Undecided("roots of selections that overlap")
        return len(set(self.found)), 0

    def ends(self):
        """Corners of the positions of every root."""
        found = []
        for selections in dict.fromkeys(self.found):
            corners = [(own, x) for own in selections for x in self.holding.get(own, ())]
            found.append([_position(self.problem, self.forms, own, x) for own, x in corners])
        return found


def _position(problem, forms, codes, point):
    """Where a solution (lambda, -q, perhaps how far the offsets are off) leaves the nodes."""
    p, size, end = problem.p, len(forms.rows), []
    point = [fmpq(x.numerator, x.denominator) for x in point]
    off = point[size:] or [fmpq(0)] * p
    for i, shift in enumerate(problem.slip_offset.tolist()):
        slip = fmpq(0) if codes[i] == 1 else _value(forms.row(5, i), point[:size]) - off[i]
        end.append(exact(shift) + off[i] + slip)
    return end


def _is_below(selection, codes):
    """[4.1]"""
    return all(own == code or own in STANDS.get(code, ()) for own, code in zip(selection, codes, strict=True))


def _number(value):
    exact(value)
    return float(value)
