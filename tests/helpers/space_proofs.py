"""Problems in 3D, their proofs, and mutants of these that have to be refused or still say what is true."""

import base64
import functools
import struct
from fractions import Fraction

import numpy as np
import proof_fuzz
from complete import all_roots
from problems3d import from_compliance
from proof_fuzz import _pick
from proof_tools import bytes_of, copied, of_kind, proof_of, records_of
from trees import by_the_tree

from enumsol import enumerate_roots, gallery

#: Random problems by nodes and seed, with the number of their roots.
RANDOM = {(1, 22): 3, (1, 0): 1, (2, 0): 3, (2, 5): 3, (2, 20): 5, (3, 4): 3, (3, 1): 1}


def random_problem(p, seed):
    """Strongly coupled, with orthotropic friction."""
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((3 * p, 3 * p))
    S, g = X @ X.T + 0.05 * np.eye(3 * p), rng.standard_normal(3 * p)
    F = 10 ** rng.uniform(0, 1.5, (p, 2))
    return from_compliance(S, g, (F[:, 0], F[:, 1]))


def on_the_end_of_a_sector():
    """One node that slips in the direction in which two sectors meet."""
    return from_compliance(np.eye(3), np.array([1.0, 126 / 65, 32 / 65]), (0.5, 0.5))


def with_one_tangent():
    """Two nodes: one without friction along t2, one without friction."""
    X = np.random.default_rng(5).standard_normal((6, 6))
    friction = (np.array([2.0, 0.0]), np.array([0.0, 0.0]))
    return from_compliance(X @ X.T + 0.5 * np.eye(6), np.array([1.0, 1.0, 0.5, -2.0, 1.0, 1.0]), friction)


def with_small_friction():
    """The same with coefficients far below one along one or both axes."""
    return with_one_tangent().replace(friction=(np.array([2.0, 1e-9]), np.array([1e-12, 1e-9])))


@functools.cache
def case(name):
    """Problem, alpha, records and bytes of the proof of a set of roots, by the tree."""
    alpha = 0.0
    if name == "end":
        problem = on_the_end_of_a_sector()
    elif name == "one tangent":
        problem = with_one_tangent()
    elif name == "small friction":
        problem = with_small_friction()
    elif name[0] == "block":
        problem, alpha = gallery.block3d(*name[1]), name[2]
    else:
        problem = random_problem(*name)
    with by_the_tree():
        roots = enumerate_roots(problem, alpha)
    return problem, alpha, records_of(roots.proof), bytes_of(roots.proof)


def values_of(record, at=2):
    """Multipliers of an exclusion, at one of its entries."""
    data = base64.b64decode(record[at])
    return list(struct.unpack(f"<{len(data) // 8}d", data))


def with_values(record, values, at=2):
    """The exclusion with other multipliers."""
    return [*record[:at], base64.b64encode(struct.pack(f"<{len(values)}d", *values)).decode(), *record[at + 1 :]]


def arc_of_sector(number):
    """Where a sector begins and ends, as shares of the circle (docs/proof_format.md, under Sectors)."""
    length, first = divmod(number, 2**31)
    count = 2 ** (len(f"{first:b}") - 1)
    return Fraction(first - count, count), Fraction(first - count + length + 1, count)


# -- mutants -----------------------------------------------------------------------------------------------------------


def _row(rng, records):
    places = [k for k in of_kind(records, "x") if records[k][1]]
    if places:
        row = _pick(rng, records[_pick(rng, places)][1])
        j = int(rng.integers(3))
        n = row[j]
        row[j] = int(_pick(rng, (n + 1, n - 1, 2 * n, n // 2, 0, 1, 2**24, 2**31, n + 2**31, 2**40, -1)))


def _value(rng, records):
    places = [k for k in of_kind(records, "x") if records[k][1]]
    if places:
        k = _pick(rng, places)
        at = int(_pick(rng, range(2, len(records[k]))))
        values = values_of(records[k], at)
        j = int(rng.integers(len(values)))
        values[j] = float(_pick(rng, (-values[j], 2 * values[j], values[j] * (1 + 1e-9), 0.0, 1e300, -1e-9)))
        records[k] = with_values(records[k], values, at)


def _sector(rng, records):
    k = _pick(rng, of_kind(records, "b"))
    codes = records[k][2]
    j = int(rng.integers(len(codes)))
    how = int(rng.integers(5))
    if how == 0:
        del codes[j]
    elif how == 4:
        # a sector longer, shorter, or cut elsewhere
        codes[j] = int(codes[j] + _pick(rng, (1, -1)) * 2**31 + _pick(rng, (0, 0, 1, -1)))
    elif how == 1:
        codes[j] = int(codes[j] + _pick(rng, (-1, 1, 4, codes[j])))
    elif how == 2:
        codes[j] = codes[int(rng.integers(len(codes)))]
    else:
        codes.reverse()


def _ball(rng, records):
    places = of_kind(records, "r")
    if places:
        record = records[_pick(rng, places)]
        how, j = int(rng.integers(4)), int(rng.integers(len(record[1])))
        if how == 0:
            record[1][j] += float(rng.normal()) * 10.0 ** int(rng.integers(-12, 1))
        elif how == 1:
            record[2][j] *= float(_pick(rng, (0.0, 0.1, 1e-3, -1.0, 10.0)))
        elif how == 2:
            record[3] = int(_pick(rng, (-record[3], 0, 2)))
        else:
            record[1], record[2] = record[1][::-1], record[2][::-1]


def _claim(rng, records):
    donors = of_kind(records, "x", "n", "r", "u", "z")
    k = _pick(rng, donors)
    records[k] = _pick(rng, (["n"], ["u", ""], ["z"], ["x", [], ""], copied(records[_pick(rng, donors)])))


def _counts(rng, records):
    key = _pick(rng, ("roots", "undecided", "leaves"))
    records[-1][key] += int(_pick(rng, (-1, 1, 2)))


def _header(rng, records):
    key = _pick(rng, ("alpha", "force", "length", "kind", "p", "data"))
    value = records[0][key]
    if isinstance(value, list):
        j, step = int(rng.integers(len(value))), int(_pick(rng, (-1, 1, 5)))
        value[j] += step
        if rng.random() < 0.5:
            records[0]["length" if key == "force" else "force"][j] -= step
    else:
        records[0][key] = _pick(rng, ("1/3", "2", "graph", "space", "condensed", 1, 4, None))


_OWN = {f.__name__: f for f in (_row, _value, _sector, _ball, _claim, _counts, _header)}
_GENERAL = ("file", "stream", "characters", "order", "field", "bomb")


def mutant(rng, records, data, general=0.3):
    """One mutant of a proof and the name of the mutation."""
    if rng.random() < general:
        how = str(rng.choice(_GENERAL))
        return proof_fuzz._MUTATIONS[how](rng, records, data), how
    changed = copied(records)
    names = [str(rng.choice(list(_OWN))) for _ in range(int(rng.integers(1, 3)))]
    for name in names:
        _OWN[name](rng, changed)
    return proof_of(changed), " ".join(names)


# -- what an accepted one says -----------------------------------------------------------------------------------------


class Truth:
    """The roots of a problem at every alpha that a mutant may name."""

    def __init__(self, problem):
        self.problem, self._known = problem, {}

    def roots(self, alpha):
        if alpha not in self._known:
            roots = all_roots(self.problem, alpha)
            self._known[alpha] = [(np.column_stack([root.lambda_n, root.lambda_t]), root.index) for root in roots]
        return self._known[alpha]

    def agrees(self, report, proof):
        """Whether everything that an accepted mutant claims is true."""
        records = records_of(proof)
        header, footer = records[0], records[-1]
        alpha = Fraction(header["alpha"])
        roots = self.roots(alpha)
        claims = [record for record in records[1:-1] if record[0] == "r"]
        number = len(roots)
        right = report.roots == number if report.complete else report.roots <= number
        right &= footer["roots"] == report.roots and footer["undecided"] == len(of_kind(records, "u"))
        return right and all(self._holds(claim, roots, header, alpha) for claim in claims)

    def _holds(self, claim, roots, header, alpha):
        """Some root of this index lies in the ball, within the accuracy of floats."""
        F, p = self.problem.friction_at(alpha), self.problem.p
        node, axis = np.nonzero(F > 0)
        force = np.ldexp(1.0, np.array(header["force"]))
        _, mid, rad, index = claim
        for forces, known in roots:
            y = np.concatenate([forces[:, 0] / force, forces[node, 1 + axis] / F[node, axis] / force[node]])
            assert len(y) == p + len(node)
            slack = 1e-9 * (1 + np.max(np.abs(y)))
            if index == known and np.all(np.abs(y - np.array(mid)) <= np.array(rad) + slack):
                return True
        return False
