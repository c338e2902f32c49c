"""Exclusions of proofs in 3D decided in rationals, from what docs/proof_format.md says of space proofs alone."""

import hashlib
import struct
from fractions import Fraction
from math import ceil, floor

import numpy as np
import pytest
import scipy.sparse as sp
from exact_balls import holds
from problems3d import from_compliance, random_coupled
from proof_tools import by_forms, copied, in_file, leaves_of, of_kind, proof_of, records_of
from space_proofs import arc_of_sector, case, values_of, with_values
from trees import by_the_tree, forms_at_once

from enumsol import ContactProblem3D, enumerate_roots, verify
from enumsol.checker.space_checker import SpaceChecker
from enumsol.checker.walk import TreeCell


def solved(A, B):
    """A^-1 B by elimination in Fractions."""
    n = len(A)
    rows = [[*a, *b] for a, b in zip(A, B, strict=True)]
    for k in range(n):
        pivot = next(i for i in range(k, n) if rows[i][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(n):
            if i != k and rows[i][k]:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[n:] for row in rows]


def fractions(array):
    return [[Fraction(x) for x in row] for row in np.atleast_2d(array).tolist()]


class Space:
    """The problem in 3D of that document, at alpha = a."""

    def __init__(self, problem, a=0):
        p = problem.p
        B = fractions(np.vstack([M.toarray() for M in (problem.Bn, problem.Bt1, problem.Bt2)]))
        slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        f = [Fraction(x) + a * Fraction(y) for x, y in zip(problem.f.tolist(), slope.tolist(), strict=True)]
        offset = [Fraction(x) for x in [*problem.gap.tolist(), *problem.slip_offset.T.ravel().tolist()]]
        right = [[*column, x] for column, x in zip(zip(*B, strict=True), f, strict=True)]
        columns = [*zip(*solved(fractions(problem.A.toarray()), right), strict=True)]
        product = [[sum(b * x for b, x in zip(row, column, strict=True)) for column in columns] for row in B]
        self.F = [
            [Fraction(x) + a * Fraction(y) for x, y in zip(F.tolist(), slope.tolist(), strict=True)]
            for F, slope in zip(problem.friction, problem.friction_slope, strict=True)
        ]
        # places in (lambda_n, lambda_t1, lambda_t2) and factors D of the components of y
        rubbing = [(i, k) for i in range(p) for k in range(2) if self.F[k][i] > 0]
        self.tau = {place: p + j for j, place in enumerate(rubbing)}
        self.y = [(i, Fraction(1)) for i in range(p)] + [((1 + k) * p + i, self.F[k][i]) for i, k in rubbing]
        self.S = [[product[i][j] * c * d for j, d in self.y] for i, c in self.y]
        self.g = [c * (product[i][-1] - offset[i]) for i, c in self.y]

    def row(self, kind, node, number):
        """Coefficients on y and on w, as the document gives them for space proofs."""
        t = [self.tau.get((node, k)) for k in range(2)]
        if kind == 0:
            return {}, {node: -1}
        if kind == 1:
            return {node: 1}, {}
        if kind in (2, 3):
            return ({t[number]: 1}, {}) if kind == 2 else ({}, {t[number]: 1})
        if kind in (4, 5):
            (only,) = (k for k in t if k is not None)
            return ({node: 1, only: -number}, {}) if kind == 4 else ({}, {only: number})
        d, e = direction(number), direction(following(number))
        if kind == 6:
            return {node: 1, t[0]: -d[0], t[1]: -d[1]}, {}
        if kind == 7:
            return {t[0]: d[0] + e[0], t[1]: d[1] + e[1], node: -(1 + d[0] * e[0] + d[1] * e[1])}, {}
        return {}, ({t[1]: d[0], t[0]: -d[1]} if kind == 8 else {t[0]: e[1], t[1]: -e[0]})

    def allowed(self, code, kind, number):
        """The table for space proofs."""
        table = {0: "+EE.+.+", 1: "E+.E+.+", 4: "E+.....", 5: "E+..+.+", 6: "++..+.+"}
        if code in (2, 3):
            along = number == (1 if code == 2 else -1)
            return {0: "E", 1: "+", 4: "E" if along else "+", 5: "+" if along else "."}.get(kind, ".")
        if kind > 6:
            if code < 9:
                return "."
            (a, b), (c, d) = arc_of_sector(number), arc_of_sector(code - 8)
            return "+" if a <= c and d <= b else "."
        return (table[code] if code < 8 else "E+....+")[kind]

    def form(self, numbers):
        """H and h of the form of these numbers; None where a c is too long or H is not positive definite."""
        p, size = len(self.F[0]), len(self.g)
        numbers = [Fraction(x) for x in numbers]
        mu, kappa, share = numbers[:p], numbers[p : 2 * p], numbers[2 * p :]
        rows, h = copied(self.S), list(self.g)
        for i in range(p):
            own = [t for k in range(2) if (t := self.tau.get((i, k))) is not None]
            if kappa[i] <= 0 or sum(share[t - p] ** 2 for t in own) >= kappa[i] ** 2:
                return None
            for t, factor in ((i, mu[i]), *((t, kappa[i]) for t in own)):
                rows[t] = [factor * x for x in self.S[t]]
                h[t] = factor * self.g[t]
            for t in own:
                rows[i] = [x - share[t - p] * y for x, y in zip(rows[i], self.S[t], strict=True)]
                h[i] -= share[t - p] * self.g[t]
        H = [[(rows[i][j] + rows[j][i]) / 2 for j in range(size)] for i in range(size)]
        left = copied(H)
        for k in range(size):  # pivots
            if left[k][k] <= 0:
                return None
            for i in range(k + 1, size):
                factor = left[i][k] / left[k][k]
                left[i] = [x - factor * y for x, y in zip(left[i], left[k], strict=True)]
        return H, h

    def bound(self, codes, rows, values, force, length, form=None):
        """The bound under Exclusion in the document, or None where a multiplier is not allowed."""
        size = len(self.g)
        H, h = form or (self.S, self.g)
        v, constant = list(h), Fraction(0)
        for (kind, node, number), value in zip(rows, values, strict=True):
            sign = self.allowed(codes[node], kind, number)
            if sign == "." or (sign == "+" and value < 0):
                return None
            forces, displacements = self.row(kind, node, number)
            u = Fraction(value) * Fraction(2) ** (length[node] if forces else force[node])
            for i, c in forces.items():
                v[i] += u * c
            for i, c in displacements.items():
                constant += u * c * self.g[i]
                for j in range(size):
                    v[j] -= u * c * self.S[i][j]
        z = solved(H, [[x] for x in v])
        return -constant - sum(x * y[0] for x, y in zip(v, z, strict=True)) / 4


def direction(number):
    """Where a sector begins."""
    q, s = divmod(arc_of_sector(number)[0] % 1 * 4, 1)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    for _ in range(q):
        x, y = -y, x
    return (63 * x - 16 * y) / 65, (16 * x + 63 * y) / 65


def following(number):
    """The sector of the same level that begins where this one ends."""
    length, first = divmod(number, 2**31)
    count = 2 ** (len(f"{first:b}") - 1)
    return count + (first - count + length + 1) % count


def covers(problem, records):
    """Whether every split is one of the document's; gives the number of those that do not halve a sector."""
    tangents, unequal = (np.transpose(problem.friction) > 0).sum(axis=1), 0
    ways = {(6, 0): [0, 4], (6, 1): [0, 5], (6, 2): [0, 5], (5, 1): [1, 2, 3], (5, 2): [1, 12, 13, 14, 15]}
    stack = [[6] * problem.p]
    for record in records[1:-1]:
        codes = stack.pop()
        if record[0] != "b":
            continue
        _, node, children = record
        if codes[node] <= 8:
            assert sorted(children) == ways[codes[node], tangents[node]]
        else:
            parts = sorted(arc_of_sector(code - 8) for code in children)
            begin, end = arc_of_sector(codes[node] - 8)
            assert len(parts) > 1
            assert [begin, *(b for _, b in parts)] == [*(a for a, _ in parts), end]
            assert all(floor(4 * a) == ceil(4 * b) - 1 for a, b in parts)
            unequal += {b - a for a, b in parts} != {(end - begin) / 2}
        stack += [[*codes[:node], code, *codes[node + 1 :]] for code in reversed(children)]
    assert not stack
    return unequal


def excluded(problem, records, alpha=0):
    """Whether all exclusions of a proof hold in rationals."""
    space, codes, units = Space(problem, alpha), dict(leaves_of(records)), (records[0]["force"], records[0]["length"])
    bounds = [space.bound(codes[k], records[k][1], values_of(records[k]), *units) for k in of_kind(records, "x")]
    return all(bound is not None and bound > 0 for bound in bounds)


def begun(problem, records):
    """A checker that has read the header, and its units."""
    checker = SpaceChecker(problem, None)
    checker._read_header(records[0])
    return checker, [records[0][key] for key in ("force", "length")]


@pytest.mark.parametrize("name", [(1, 22), (1, 0), (2, 0), "end", "one tangent", "small friction"], ids=str)
def test_exclusions_hold_in_rationals(name):
    problem, _, records, _ = case(name)
    assert of_kind(records, "x")
    assert excluded(problem, records)
    covers(problem, records)


def test_exclusions_by_a_form_hold_in_rationals_and_no_others_are_accepted():
    rng = np.random.default_rng(3)
    S, g, F = random_coupled(np.random.default_rng(6), 2)
    problem = from_compliance(S, g, (F[:, 0], F[:, 1]))
    with by_the_tree(), forms_at_once():
        records = records_of(enumerate_roots(problem, 0).proof)
    (declared, *_), places = of_kind(records, "q"), by_forms(records)
    space, codes, (checker, units), counts = Space(problem), dict(leaves_of(records)), begun(problem, records), [0, 0]
    for factor in (1.0, 0.8, 1.05, 0.0):
        numbers = [x if k < 2 * problem.p else factor * x for k, x in enumerate(records[declared][2])]
        form = space.form(numbers)
        checker._declare(["q", [6] * problem.p, numbers, []])
        for k in places:
            rows = records[k][1]
            if factor == 1.0:
                assert space.bound(codes[k], rows, values_of(records[k]), *units, form) > 0
            for _ in range(6):
                values = values_of(records[k])
                values[int(rng.integers(len(values)))] *= float(rng.choice((0.0, 0.5, 1.01, 2.0, -1.0)))
                accepted = checker._leaf(TreeCell(codes[k]), in_file([*with_values(records[k], values)[:3], 1])) is None
                bound = form and space.bound(codes[k], rows, values, *units, form)
                assert accepted == (bound is not None and bound > 0)
                counts[accepted] += 1
    assert min(counts) > 5


def test_sectors_are_cut_otherwise_than_in_halves():
    assert sum(covers(case(name)[0], case(name)[2]) for name in ((2, 0), (2, 5), (2, 20))) > 5


@pytest.mark.slow
def test_what_is_accepted_of_changed_multipliers_holds_in_rationals():
    rng = np.random.default_rng(8)
    counts = [0, 0]
    for name in ((1, 22), (2, 0), "one tangent"):
        problem, _, records, _ = case(name)
        space, codes, (checker, units) = Space(problem), dict(leaves_of(records)), begun(problem, records)
        for k in of_kind(records, "x"):
            for _ in range(15):
                rows, values = copied(records[k][1]), values_of(records[k])
                j = int(rng.integers(len(rows)))
                values[j] *= float(rng.choice((0.0, 0.5, 1.01, 1.2, 2.0, -1.0)))
                if rng.random() < 0.3 and rows[j][0] > 5:
                    run = int(rng.integers(3)) << 31 if rows[j][0] > 6 else 0
                    number = int(rng.integers(4, 40)) + run
                    a, b = arc_of_sector(number)
                    rows[j][2] = number if floor(4 * a) == ceil(4 * b) - 1 else rows[j][2]
                accepted = checker._leaf(TreeCell(codes[k]), in_file(with_values(["x", rows, ""], values))) is None
                bound = space.bound(codes[k], rows, values, *units)
                assert accepted == (bound is not None and bound > 0)
                counts[accepted] += 1
    assert min(counts) > 20


def test_the_fingerprint_is_that_of_the_document():
    rng = np.random.default_rng(2)
    A = sp.csc_array(np.diag([2.0, 3.0, 4.0]))
    eye = np.eye(3)
    problem = ContactProblem3D(
        A, eye[:1], eye[1:2], eye[2:], rng.normal(size=3), 0.25, (0.5, 0.75), (1.0, 2.0), rng.normal(size=3),
        [[0.1, 0.2]],
    )  # fmt: skip
    digest = hashlib.sha256(b"enumsol problem in 3D, 1")
    columns = A, *(sp.csc_array(eye[k : k + 1]) for k in range(3))
    matrices = [part for M in columns for part in (M.indptr, M.indices, M.data)]
    vectors = (problem.f, [0.25], [0.5], [0.75], [1.0], [2.0], problem.load_slope, [0.1, 0.2])
    for part in ([3, 1], *matrices, *vectors):
        kind = "q" if np.asarray(part).dtype.kind == "i" else "d"
        digest.update(struct.pack(f"<{len(part)}{kind}", *part) + b"|")
    assert digest.hexdigest() == problem.fingerprint


def test_balls_hold_the_exact_system():
    """Load, friction, gap and slip offset at an alpha that is no float."""
    S = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, -1.0], [0.5, -1.0, 2.0]])
    more = {"gap": 0.1, "slip_offset": [[0.3, -0.7]], "load_slope": np.array([0.1, 0.7, -0.3])}
    problem = from_compliance(S, np.array([1.0, 2.0, 0.5]), (0.3, 0.7), friction_slope=(0.1, 0.9), **more)
    header = case((1, 0))[2][0] | {"problem": problem.fingerprint, "alpha": "1/3"}
    checker, _ = begun(problem, [header])
    found, exact = checker.system, Space(problem, Fraction(1, 3))
    force, length = (Fraction(2) ** header[key][0] for key in ("force", "length"))
    assert holds(found.g, found.g_rad, [x / length for x in exact.g])
    assert holds(found.S, found.S_rad, [[x * force / length for x in row] for row in exact.S])
    assert np.all(found.S_rad < 1e-14 * np.max(found.S))
    assert verify(problem, proof_of([header, ["u", ""], {"roots": 0, "undecided": 1, "leaves": 1}])).ok
