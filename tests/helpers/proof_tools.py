"""Proofs taken apart and put together again, and judged by rational arithmetic that shares no code with enumsol."""

import base64
import contextlib
import copy
import hashlib
import json
import struct
import zlib
from fractions import Fraction

import numpy as np
from oracles import _affine, _at, _conditions, _dimension, _meet, _rref, _vertices, exact_condense
from rational_checker import check_records
from rational_forms import Refused

from enumsol import Proof, ProofFormatError, verify

MAGIC = b"enumsol-proof 2\n"


def records_of(proof):
    """All records of a proof as Python objects."""
    data = proof if isinstance(proof, bytes) else bytes_of(proof)
    return opened(json.loads(line) for line in zlib.decompress(data[len(MAGIC) : -32]).splitlines())


def kinds_of(proof):
    """The kinds of the records between the header and the counts at the end, one by one."""
    return [record[0] for record in records_of(proof)[1:-1]]


def in_rationals(records, *kinds):
    """Places of the records of these kinds, "x", "n" or "m", that are to be tested in rational arithmetic."""
    return [k for k in of_kind(records, *kinds) if records[k][-1] == "rational" or _is_counted(records[k])]


def _is_counted(record):
    return record[0] == "m" and len(record) == 5 and type(record[4]) is int


def by_forms(records):
    """Places of the exclusions that refer to a form."""
    return [k for k in of_kind(records, "x") if type(records[k][-1]) is int]


def bytes_of(proof):
    """The content of a proof file."""
    with proof._open() as file:
        return file.read()


def sealed(body, magic=MAGIC):
    """A proof of this content with a right checksum."""
    data = magic + body
    return Proof(data + hashlib.sha256(data).digest())


def proof_of(records, magic=MAGIC):
    """A proof of these records with a right checksum; strings are taken as lines of text."""
    lines = [record if isinstance(record, str) else json.dumps(record) for record in closed(records)]
    return sealed(zlib.compress("".join(line + "\n" for line in lines).encode(), 1), magic)


def multipliers(record):
    """Rows and multipliers of an exclusion."""
    rows, values = (base64.b64decode(text) for text in record[1:3])
    return list(struct.unpack(f"<{len(rows) // 4}I", rows)), list(struct.unpack(f"<{len(values) // 8}d", values))


def with_multipliers(record, rows, values):
    """The exclusion with other rows and multipliers."""
    packed = struct.pack(f"<{len(rows)}I", *rows), struct.pack(f"<{len(values)}d", *values)
    return [record[0], *(base64.b64encode(data).decode() for data in packed), *record[3:]]


def opened(records):
    """Records with the rows of exclusions in 3D as lists, and over pieces of alpha a text for either end."""
    found, kind = [], None
    for record in records:
        kind = _dimension_of(record, kind)
        found.append(_opened(record, kind) if _is_exclusion(record) and kind else record)
    return found


def closed(records):
    """Such records as they stand in a file; what cannot be written there stays as it is."""
    found, kind = [], None
    for record in records:
        kind = _dimension_of(record, kind)
        found.append(in_file(record, kind) if _is_exclusion(record) and kind else record)
    return found


def in_file(record, kind="space"):
    """An exclusion of a point proof or of a graph in 3D as it stands in a file."""
    with contextlib.suppress(struct.error, TypeError, ValueError):
        rows = base64.b64encode(b"".join(struct.pack("<IIq", *row) for row in record[1])).decode()
        return ["x", rows, *(record[2:] if kind == "space" else [_joined(*record[2:])])]
    return record


def _is_exclusion(record):
    return isinstance(record, list) and record[:1] == ["x"] and len(record) > 2


def _opened(record, kind):
    octets = base64.b64decode(record[1])
    rows = [list(struct.unpack_from("<IIq", octets, k)) for k in range(0, len(octets), 16)]
    return ["x", rows, *([record[2]] if kind == "space" else _halves(record[2])), *record[3:]]


def _dimension_of(record, kind):
    """ "space" or "graph" for what follows a header in 3D, None in 2D."""
    if not isinstance(record, dict) or "format" not in record:
        return kind
    return record.get("kind") if record.get("kind") == "space" or ("steps" in record and "interval" in record) else None


def _halves(text):
    octets = base64.b64decode(text)
    return [base64.b64encode(part).decode() for part in (octets[: len(octets) // 2], octets[len(octets) // 2 :])]


def _joined(low, high):
    return base64.b64encode(base64.b64decode(low, validate=True) + base64.b64decode(high, validate=True)).decode()


def leaves_of(records):
    """Position of every leaf and the assignment it stands for (codes 5 in contact, 6 undecided)."""
    p = records[0]["p"]
    stack, found = [(6,) * p], []
    for k, record in enumerate(records[1:-1], start=1):
        if record[0] == "q":
            continue
        codes = stack.pop()
        if record[0] == "b":
            _, node, children = record
            stack += [(*codes[:node], code, *codes[node + 1 :]) for code in reversed(children)]
        else:
            found.append((k, codes))
    return found


# -- changed records ---------------------------------------------------------------------------------------------------


def copied(records):
    """Records that may be changed."""
    return copy.deepcopy(records)


def of_kind(records, *kinds):
    """Places of the records of these kinds."""
    return [k for k, record in enumerate(records) if isinstance(record, list) and record and record[0] in kinds]


def replaced(records, place, *others):
    """The records with others, or none, in place of one."""
    changed = copied(records)
    changed[place : place + 1 or None] = others
    return changed


def put(record, path, value):
    """The record, or records, with another value at a path; a function makes it of what stands there."""
    if not path:
        return value(record) if callable(value) else value
    changed = copied(record)
    changed[path[0]] = put(changed[path[0]], path[1:], value)
    return changed


def put_in_all(records, places, entry, value):
    """The records with another value, or one made of what stands there, as an entry of several."""
    for k in places:
        records = put(records, (k, entry), value)
    return records


def why_refused(problem, records):
    """The reasons for which the checker refuses records, or cannot read them."""
    try:
        report = verify(problem, proof_of(records))
    except ProofFormatError as error:
        return str(error)
    assert not report.ok
    assert not report.complete
    assert "REFUSED" in repr(report)
    return " ".join(report.failures)


def refused(problem, records):
    """Whether the checker refuses records, or cannot read them."""
    try:
        return not verify(problem, proof_of(records)).ok
    except ProofFormatError:
        return True


# -- the judge ---------------------------------------------------------------------------------------------------------


class Judge:
    """Whether records are a valid proof for a problem, by Fractions alone."""

    def __init__(self, problem):
        self.problem = problem

    def valid(self, records):
        """Every leaf proves what it says, the leaves cover all selections, the counts are right.

        Closed subtrees are judged by the other rational checker, which tries all selections of their free nodes, and so
        are splits by sides.
        """
        lists = [record for record in records if isinstance(record, list)]
        if any(record[0] == "m" or (record[0] == "b" and max(record[2]) > 6) for record in lists):
            return _accepted(self.problem, records)
        header, footer = records[0], records[-1]
        alpha = Fraction(header["alpha"])
        self.S, self.g, self.F = exact_condense(self.problem, alpha)
        self.force, self.length = ([Fraction(2) ** e for e in header[key]] for key in ("force", "length"))
        p = len(self.F)
        stack, regular, polytopes, undecided, leaves = [(6,) * p], 0, [], 0, 0
        for record in records[1:-1]:
            if not stack:
                return False
            codes = stack.pop()
            kind = record[0]
            if kind == "b":
                _, node, children = record
                if sorted(children) != self._cover(codes[node], node):
                    return False
                stack += [(*codes[:node], code, *codes[node + 1 :]) for code in reversed(children)]
                continue
            leaves += 1
            undecided += kind == "u"
            if kind == "x" and not self._excluded(codes, *multipliers(record)):
                return False
            if kind == "n" and (max(codes) > 4 or _vertices(*self._forms(codes))):
                return False
            if kind == "r":
                if max(codes) > 4 or not self._root(codes, *record[1:]):
                    return False
                regular += 1
            if kind == "D":
                vertices = _vertices(*self._forms(codes)) if max(codes) <= 4 else ()
                claimed = sorted(tuple(_fraction(x) for x in point) for point in record[1])
                if not vertices or claimed != list(vertices) or record[2] != _dimension(vertices):
                    return False
                polytopes.append((codes, _dimension(vertices)))
            if kind == "z" and (set(codes) != {6} or any(self.g)):
                return False
        isolated, families = self._count(polytopes)
        isolated += any(record[0] == "z" for record in records[1:-1])
        claim = {"roots": regular + isolated, "families": families, "undecided": undecided, "leaves": leaves}
        return not stack and footer == claim

    def _cover(self, code, node):
        if code == 6:
            return [0, 5] if self.F[node] > 0 else [0, 4]
        return [1, 2, 3] if code == 5 else None

    def _forms(self, codes):
        return _conditions(self.S, self.g, self.F, codes)

    def _row(self, kind, i):
        """The row as coefficients of lambda and a constant."""
        m = 2 * len(self.F)
        out = [Fraction(0)] * (m + 1)
        p = len(self.F)
        if kind == 0:
            out[i] = Fraction(1)
        elif kind == 1:
            out[p + i] = Fraction(1)
        elif kind in (2, 3):
            out[i], out[p + i] = self.F[i], Fraction(-1 if kind == 2 else 1)
        else:
            k, sign = (i, -1) if kind == 4 else (p + i, 1 if kind == 5 else -1)
            out = [-sign * s for s in self.S[k]] + [sign * self.g[k]]
        return out

    def _allowed(self, code, kind, i):
        """The sign that a multiplier may have: None forbidden, +1 nonnegative, 0 any; from the meaning of the codes."""
        equal = {0: (0, 1, 2, 3), 1: (4, 5, 6), 2: (2, 4), 3: (3, 4), 4: (1, 2, 3, 4), 5: (4,), 6: ()}[code]
        if code == 6 and self.F[i] == 0:
            equal = (1, 2, 3)
        above = {2: (5,), 3: (6,)}.get(code, ())
        if kind in equal:
            return 0
        return 1 if kind in (0, 2, 3, 4) or kind in above else None

    def _excluded(self, codes, rows, values):
        p, m = len(self.F), 2 * len(self.F)
        linear, constant = [-x for x in self.g], Fraction(0)
        for row, value in zip(rows, values, strict=True):
            if row >= 7 * p or not np.isfinite(value):
                return False
            kind, i = divmod(row, p)
            sign = self._allowed(codes[i], kind, i)
            if sign is None or (sign == 1 and value < 0):
                return False
            u = Fraction(value) * (self.length[i] if kind < 4 else self.force[i])
            form = self._row(kind, i)
            linear = [a - u * b for a, b in zip(linear, form, strict=False)]
            constant -= u * form[m]
        # the least value of x'S x + linear.x + constant
        solved, _ = _rref([[*row, -v / 2] for row, v in zip(self.S, linear, strict=True)], m)
        return sum(v * row[m] for v, row in zip(linear, solved, strict=True)) / 2 + constant > 0

    def _root(self, codes, mid, rad, index):
        equations, inequalities = self._forms(codes)
        solved = _affine(equations)
        if solved is None or solved[1]:
            return False
        point = solved[0]
        # a node without friction that is open has theta2 = theta3: its slip condition is no condition
        if not all(_at(row, point) > 0 for row in inequalities):
            return False
        inside = all(abs(Fraction(m) - x) <= Fraction(r) for m, r, x in zip(mid, rad, point, strict=True))
        return inside and index == det_sign(self.S, self.F, codes)

    def _count(self, polytopes):
        groups = [[part] for part in polytopes]
        merged = True
        while merged:
            merged = False
            for a in range(len(groups)):
                for b in range(a + 1, len(groups)):
                    if any(_meet(self.S, self.g, self.F, x[0], y[0]) for x in groups[a] for y in groups[b]):
                        groups[a] += groups.pop(b)
                        merged = True
                        break
                if merged:
                    break
        families = sum(any(part[1] > 0 for part in group) for group in groups)
        return len(groups) - families, families


def _accepted(problem, records):
    try:
        return check_records(problem, records) == records[-1]
    except Refused:
        return False


def det_sign(S, F, codes):
    """Sign of the determinant of a selection, by elimination in Fractions."""
    p = len(F)
    closed = [i for i in range(p) if codes[i] != 0]
    stuck = [p + i for i in range(p) if codes[i] == 1]
    turn = {2: 1, 3: -1}
    M = []
    for r in closed + stuck:
        slip = [S[r][i] + turn.get(codes[i], 0) * F[i] * S[r][p + i] for i in closed]
        M.append(slip + [S[r][k] for k in stuck])
    sign = 1
    for k in range(len(M)):
        pivot = next((r for r in range(k, len(M)) if M[r][k] != 0), None)
        if pivot is None:
            return 0
        if pivot != k:
            M[k], M[pivot], sign = M[pivot], M[k], -sign
        sign = sign if M[k][k] > 0 else -sign
        for r in range(k + 1, len(M)):
            factor = M[r][k] / M[k][k]
            M[r] = [a - factor * b for a, b in zip(M[r], M[k], strict=True)]
    return sign


def _fraction(text):
    numerator, _, denominator = text.partition("/")
    return Fraction(int(numerator, 16), int(denominator, 16))
