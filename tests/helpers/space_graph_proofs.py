"""Mutants of graphs' proofs in 3D, of their curves and of their trees; space_judge says whether they are true."""

import itertools
from dataclasses import dataclass, field
from fractions import Fraction

import proof_fuzz
import space_proofs
from problems3d import in_space
from proof_fuzz import _pick
from proof_tools import bytes_of, copied, proof_of

from enumsol import gallery

_CENTRE, _DIRECTION, _BORDER, _RADIUS, _RHO, _HALF = range(1, 7)


def closed_branch():
    """A problem of two nodes with a branch that is closed, for alpha from 0.953 to 1.441."""
    options = {"friction": 0.5, "friction_slope": 1.7, "load_slope": ((-1.1, -0.2), (-0.8, 0.3))}
    return in_space(gallery.two_node_square((3.7, -5.3), (1.1, 0.9), **options))


@dataclass
class Parts:
    """A proof: header, curves (each its points and boxes in turn), the tree's records, and the counts."""

    header: dict
    curves: list = field(default_factory=list)
    tree: list = field(default_factory=list)
    counts: dict = field(default_factory=dict)

    @classmethod
    def of(cls, records):
        """The records apart; those of a proof that the checker accepts."""
        found, k = cls(records[0], counts=records[-1]), 1
        while "curve" in records[k]:
            count = 2 * records[k]["curve"] + 1
            found.curves.append(records[k + 1 : k + 1 + count])
            k += 1 + count
        found.tree = records[k + 1 : -1]
        return found

    def records(self):
        """The records of a proof."""
        curves = [record for curve in self.curves for record in ({"curve": len(curve) // 2}, *curve)]
        return [self.header, *curves, {"tree": True}, *self.tree, self.counts]

    def count(self):
        """Make the counts at the end those of the records."""
        leaves = [record for record in self.tree if record[0] not in "pb"]
        gaps = sum(record[0] == "u" for record in leaves)
        self.counts = {"curves": len(self.curves), "arcs": None, "leaves": len(leaves), "gaps": gaps}

    def first_boxes(self):
        """The number of the first box of every curve, and that of all boxes."""
        return list(itertools.accumulate((len(curve) // 2 for curve in self.curves), initial=0))

    def places(self, *kinds):
        """Where the tree has records of these kinds."""
        return [k for k, record in enumerate(self.tree) if record[0] in kinds]

    def end(self, k):
        """Where the subtree ends that begins at a record."""
        waiting = 1
        while waiting and k < len(self.tree):
            record = self.tree[k]
            waiting += 1 if record[0] == "p" else len(record[2]) - 1 if record[0] == "b" else -1
            k += 1
        return k

    def renumber(self, number):
        """Other numbers for all boxes in leaves, by a function that gives None where there is none any more."""
        for k in self.places("k", "t"):
            record = self.tree[k]
            boxes = [number(box) for box in _boxes_of(record)]
            self.tree[k] = ["n"] if None in boxes else copied(record)
            if None not in boxes:
                self.tree[k][_BOXES[record[0]]] = boxes


#: Where records have the numbers of boxes.
_BOXES = {"k": slice(1, 3), "t": slice(1, 2)}


def _boxes_of(record):
    return record[_BOXES[record[0]]]


# -- mutants of the tree -----------------------------------------------------------------------------------------------


def _leaf(rng, parts, near=None):
    """A leaf that claims much, of numbers that occur somewhere."""
    count = parts.first_boxes()[-1]
    kind = str(rng.choice(["n", "x", "k", "t", "u"], p=[0.2, 0.2, 0.45, 0.1, 0.05]))
    donors = [parts.tree[k] for k in (near or range(len(parts.tree))) if parts.tree[k][0] == kind]
    donors = donors or [parts.tree[k] for k in parts.places(kind)]
    if kind == "k" and rng.random() < 0.6:
        first = int(rng.integers(count))
        return ["k", first, min(first + int(rng.integers(4)), count - 1)]
    if kind == "t" and rng.random() < 0.6:
        return _arc(rng, parts, int(rng.integers(count)))
    return copied(_pick(rng, donors)) if donors and kind not in "nu" else ["n"] if kind != "u" else ["u", ""]


def _arc(rng, parts, box):
    """A leaf whose roots are said to be an arc through a box, with the numbers of another one."""
    known = parts.places("t")
    if known:
        return ["t", box, *copied(parts.tree[_pick(rng, known)][2:])]
    low, high = parts.header["interval"]
    return ["t", box, low, high, low, [1] * parts.header["p"]]


def _arc_numbers(rng, parts):
    """Another piece, alpha, or leaf of an arc."""
    places = parts.places("t")
    if places:
        record = parts.tree[_pick(rng, places)]
        low, high, alpha = (Fraction(number) for number in record[2:5])
        way = int(rng.integers(4))
        if way == 0:
            ends = (Fraction(end) for end in parts.header["interval"])
            low, high = (max(low, min(ends)), high) if rng.random() < 0.5 else (low - (high - low), high + (high - low))
        elif way == 1:
            low, high = sorted((alpha, low + (high - low) * int(rng.integers(0, 9)) / 8))
        elif way == 2:
            alpha = low + (high - low) * int(rng.integers(0, 9)) / 8
        else:
            k = int(rng.integers(len(record[5])))
            record[5][k] = int(_pick(rng, (record[5][k] + int(rng.integers(-2, 3)), *range(4), 6)))
        record[2:5] = [str(number) for number in (low, high, alpha)]


def _prune(rng, parts):
    """One leaf in place of a subtree."""
    inner = parts.places("p", "b")
    if inner:
        k = _pick(rng, inner)
        end = parts.end(k)
        parts.tree[k:end] = [_leaf(rng, parts, range(k, end))]


def _graft(rng, parts):
    """A copy of one subtree in place of another."""
    k, other = (int(i) for i in rng.integers(len(parts.tree), size=2))
    parts.tree[k : parts.end(k)] = copied(parts.tree[other : parts.end(other)])


def _other_leaf(rng, parts):
    k = _pick(rng, parts.places("x", "n", "k", "t", "u"))
    parts.tree[k] = _leaf(rng, parts)


def _same_leaf(rng, parts):
    """Another kind of leaf about the same boxes, or none."""
    places = parts.places("k", "t")
    if places:
        k = _pick(rng, places)
        boxes = _boxes_of(parts.tree[k])
        first, last = boxes[0], boxes[-1]
        parts.tree[k] = _pick(
            rng, (["k", first, last], ["k", last, last], _arc(rng, parts, first), ["n"], ["x", [], "", ""])
        )


def _no_child(rng, parts):
    """A branching without one of its children, or a cut without one of its halves."""
    inner = parts.places("p", "b")
    if not inner:
        return
    k = _pick(rng, inner)
    children, at = [], k + 1
    for _ in range(2 if parts.tree[k][0] == "p" else len(parts.tree[k][2])):
        children.append((at, parts.end(at)))
        at = parts.end(at)
    lost = int(rng.integers(len(children)))
    del parts.tree[slice(*children[lost])]
    if parts.tree[k][0] == "p":
        del parts.tree[k]
    else:
        del parts.tree[k][2][lost]


def _codes(rng, parts):
    places = parts.places("b")
    if places:
        record = parts.tree[_pick(rng, places)]
        codes = record[2]
        j = int(rng.integers(len(codes)))
        how = int(rng.integers(4))
        if how == 0:
            codes[j] += int(_pick(rng, (1, -1, 2**31, -(2**31), 2**31 - 1, 1 - 2**31)))
        elif how == 1:
            codes[j] = codes[int(rng.integers(len(codes)))]
        elif how == 2 and len(codes) > 2 and max(codes) > 5:
            # the next sector is taken to be within this one
            codes[j], record[2] = codes[j] + 2**31, codes
        else:
            record[1] = int(rng.integers(parts.header["p"]))


def _cut(rng, parts):
    places = parts.places("p")
    if places:
        record = parts.tree[_pick(rng, places)]
        low, high = map(Fraction, parts.header["interval"])
        alpha, share = Fraction(record[1]), Fraction(int(rng.integers(1, 64)), 64)
        step = (high - low) * _pick(rng, (1, -1)) / 2 ** int(rng.integers(2, 30))
        other = Fraction(parts.tree[_pick(rng, places)][1])
        record[1] = str(_pick(rng, (low + share * (high - low), alpha + step, alpha + step, other)))


def _multipliers(rng, parts):
    if parts.places("x"):
        for _ in range(int(rng.integers(1, 3))):
            _pick(rng, (space_proofs._row, space_proofs._value, _other_end))(rng, parts.tree)


def _other_end(rng, tree):
    """An exclusion by multipliers of one end at both, or by those of either end at the other one."""
    record = tree[_pick(rng, [k for k, record in enumerate(tree) if record[0] == "x"])]
    record[2:] = _pick(rng, (record[:1:-1], record[2:3] * 2, record[3:] * 2))


def _fewer_rows(rng, parts):
    """An exclusion by some of its rows, or by those of two."""
    places = [k for k in parts.places("x") if parts.tree[k][1]]
    if places:
        k, other = _pick(rng, places), _pick(rng, places)
        (rows, *lists), (more, *longer) = (
            [parts.tree[place][1], *(space_proofs.values_of(parts.tree[place], at) for at in (2, 3))]
            for place in (k, other)
        )
        if rng.random() < 0.5:
            rows, *lists = (one + two for one, two in zip([rows, *lists], [more, *longer], strict=True))
        else:
            j = int(rng.integers(len(rows)))
            rows, *lists = (part[:j] + part[j + 1 :] for part in (rows, *lists))
        parts.tree[k] = ["x", rows, "", ""]
        for at, values in enumerate(lists, 2):
            parts.tree[k] = space_proofs.with_values(parts.tree[k], values, at)


def _box_numbers(rng, parts):
    places = parts.places("k", "t")
    if places:
        record = parts.tree[_pick(rng, places)]
        j = int(_pick(rng, range(len(record))[_BOXES[record[0]]]))
        record[j] = int(_pick(rng, (record[j] + int(rng.integers(-3, 4)), rng.integers(parts.first_boxes()[-1]))))


def _form(rng, parts):
    places = [k for k in parts.places("k") if len(parts.tree[k]) > 3]
    if places:
        numbers = parts.tree[_pick(rng, places)][3]
        j = int(rng.integers(len(numbers)))
        numbers[j] = float(numbers[j] * 10 ** rng.uniform(-2, 2) * _pick(rng, (-1, 1)) + _pick(rng, (0, 0.1, 1e-3)))


# -- mutants of the curves ---------------------------------------------------------------------------------------------


def _no_curve(rng, parts):
    """One curve less; what was said to lie on it lies nowhere, or on another one."""
    k, starts = int(rng.integers(len(parts.curves))), parts.first_boxes()
    count, lost = len(parts.curves[k]) // 2, bool(rng.random() < 0.5)
    left = starts[-1] - count
    del parts.curves[k]

    def number(box):
        if starts[k] <= box < starts[k + 1]:
            return None if lost or not left else box % left
        return box - count * (box >= starts[k + 1])

    parts.renumber(number)


def _turned(curve):
    """The same curve the other way round."""
    found = copied(curve[::-1])
    for record in found[1::2]:
        record[_DIRECTION] = [-x for x in record[_DIRECTION]]
        record[_BORDER] = [-x for x in record[_BORDER]]
    for record in found[::2]:
        record[_DIRECTION] = [-x for x in record[_DIRECTION]]
        record[_BORDER] = [-x for x in record[_BORDER]]
    return found


def _again(rng, parts):
    """A curve once more: as it is, the other way round, or only a part of it."""
    curve = copied(_pick(rng, parts.curves))
    if rng.random() < 0.4:
        curve = _turned(curve)
    if rng.random() < 0.3:
        first = 2 * int(rng.integers(len(curve) // 2))
        curve = curve[first : first + 1 + 2 * int(rng.integers(1, 5))]
    if rng.random() < 0.3:
        for record in curve:
            record[_RADIUS] = [x * float(rng.uniform(0.5, 2)) for x in record[_RADIUS]]
    parts.curves.append(curve)


def _round(rng, parts):
    """A curve the other way round, its boxes in leaves, too: what it says is the same; or one that begins elsewhere."""
    k, starts = int(rng.integers(len(parts.curves))), parts.first_boxes()
    curve, here = parts.curves[k], range(starts[k], starts[k + 1])
    if curve[0] == curve[-1] and rng.random() < 0.6:
        step = int(rng.integers(1, len(here)))
        parts.curves[k] = [*curve[2 * step :], *curve[1 : 2 * step + 1]]
        parts.renumber(lambda box: (box - starts[k] - step) % len(here) + starts[k] if box in here else box)
        return
    parts.curves[k] = _turned(curve)
    parts.renumber(lambda box: starts[k] + starts[k + 1] - 1 - box if box in here else box)
    for j in parts.places("k"):
        if parts.tree[j][2] in here:
            parts.tree[j][1:3] = parts.tree[j][2:0:-1]


def _shorter(rng, parts):
    """A curve without its first or last box, or without one between them."""
    k, starts = int(rng.integers(len(parts.curves))), parts.first_boxes()
    curve = parts.curves[k]
    count = len(curve) // 2
    if count > 1:
        lost = int(_pick(rng, (0, count - 1, rng.integers(count))))
        del curve[2 * lost + (1 if lost else 0) : 2 * lost + (3 if lost else 2)]
        gone = starts[k] + lost
        parts.renumber(lambda box: min(box - (box > gone), starts[-1] - 2))


def _spliced(rng, parts):
    """One curve up to some box, and then another one."""
    k, other = (int(i) for i in rng.integers(len(parts.curves), size=2))
    one, two = parts.curves[k], parts.curves[other]
    i, j = 2 * int(rng.integers(len(one) // 2)), 2 * int(rng.integers(len(two) // 2))
    parts.curves[k] = copied(one[:i] + two[j:])


def _closed(rng, parts):
    """A curve that ends at its first point, or in the middle of it."""
    curve = _pick(rng, parts.curves)
    if rng.random() < 0.5:
        curve[-1] = copied(curve[0])
    else:
        curve[-1] = copied(curve[2 * int(rng.integers(len(curve) // 2))])


def _box(rng, parts):
    """A box or a point that is longer, wider, elsewhere, otherwise directed."""
    curve = _pick(rng, parts.curves)
    record = curve[int(rng.integers(len(curve)))]
    how, size = int(rng.integers(7)), float(10 ** rng.uniform(-3, 3))
    if how == 0:
        record[_HALF] *= size
    elif how == 1:
        record[_RADIUS] = [x * size for x in record[_RADIUS]]
    elif how == 2:
        j = int(rng.integers(len(record[_RADIUS])))
        record[_RADIUS][j] *= size
    elif how == 3:
        step = float(rng.normal()) * 10.0 ** int(rng.integers(-9, 0))
        record[_CENTRE] = [c + step * d for c, d in zip(record[_CENTRE], record[_DIRECTION], strict=True)]
    elif how == 4:
        part = record[int(rng.integers(1, 6))]
        j = int(rng.integers(len(part)))
        part[j] += float(rng.normal()) * 10.0 ** int(rng.integers(-12, 1))
    elif how == 5:
        part = record[int(rng.integers(2, 6))]
        part[:] = [float(x * _pick(rng, (-1.0, 2.0, 0.5))) for x in part]
    else:
        other = _pick(rng, _pick(rng, parts.curves))
        record[:_HALF] = copied(other[:_HALF])


def _header(rng, parts):
    header = parts.header
    how = int(rng.integers(5))
    if how == 0:
        header["interval"][int(rng.integers(2))] = str(Fraction(int(rng.integers(-4, 9)), 4))
    elif how == 1:
        # a part of the interval, or a little more than it
        low, high = map(Fraction, header["interval"])
        share = Fraction(_pick(rng, (1, -1)), 2 ** int(rng.integers(1, 12))) * (high - low)
        ends = low, high
        j = int(rng.integers(2))
        header["interval"][j] = str(ends[j] + share)
    elif how == 2:
        header["steps"][int(rng.integers(len(header["steps"])))] *= float(10 ** rng.uniform(-2, 2))
    else:
        key, step = _pick(rng, ("force", "length")), int(_pick(rng, (-1, 1, 3)))
        if how == 3:
            header[key][int(rng.integers(len(header[key])))] += step
        else:
            header[key] = [x + step for x in header[key]]


def _counts(rng, parts):
    key = _pick(rng, ("curves", "leaves", "gaps"))
    parts.counts[key] += int(_pick(rng, (-1, 1)))


_TREE = (
    _prune,
    _graft,
    _other_leaf,
    _same_leaf,
    _no_child,
    _codes,
    _cut,
    _multipliers,
    _fewer_rows,
    _box_numbers,
    _arc_numbers,
    _form,
)
_CURVES = (_no_curve, _again, _round, _shorter, _spliced, _closed, _box)
_GENERAL = ("file", "stream", "characters", "order", "field", "nudge", "bomb")


def mutant(rng, records, general=0.1):
    """One mutant of a proof and the names of the mutations."""
    if rng.random() < general:
        return proof_fuzz.mutant(rng, records, bytes_of(proof_of(records)), _GENERAL)
    parts, names = Parts.of(copied(records)), []
    for _ in range(int(_pick(rng, (1, 1, 1, 2, 3)))):
        own = _pick(rng, (_TREE, _TREE, _TREE, _TREE, _TREE, _CURVES, _CURVES, (_header,)))
        change = _pick(rng, own)
        change(rng, parts)
        names.append(change.__name__)
        if not parts.curves or not parts.tree:
            break
    parts.count()
    if rng.random() < 0.05:
        _counts(rng, parts)
    return proof_of(parts.records()), " ".join(names)
