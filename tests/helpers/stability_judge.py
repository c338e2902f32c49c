"""A judge of stability proofs that follows docs/proof_format.md and nothing else, in balls of many digits.

It imports nothing of enumsol; of a problem it reads the arrays. Roots are enclosed anew from displacements and forces
together, which serves bodies that nothing holds, too; their number is that of the proof of the roots, which the judges
of these proofs read. K(mu) is a block of the inverse of a bordered matrix, never of S, and a motion that grows is
looked for where it is claimed. Numbers in brackets are the document's sections.
"""

import hashlib
import json
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from flint import arb, arb_mat, ctx
from rational_checker import are, check_records
from rational_forms import Refused, decimal_fraction, exact, fingerprint as plane_fingerprint, integer, need
from space_judge import judge_records
from space_judge_data import fingerprint as space_fingerprint, is_definite
from stability_judge_roots import balls, enclosed, near, starts

DIGITS = 320
VERDICTS = "runs away", "does not run away", "undecided"
#: Halvings of a range in which a motion grows.
HALVINGS = 70


def judge_stability(problem, mass, records):
    """The verdict on every root, in the order of the records; "undecided" where the root is not known strictly.

    Raises Refused.
    """
    before, ctx.prec = ctx.prec, DIGITS
    try:
        return Stability(problem, np.asarray(mass, dtype=float)).run(records)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, ZeroDivisionError) as error:
        raise Refused(f"a record cannot be read: {error!r}") from error
    finally:
        ctx.prec = before


def fingerprint_of(mass):
    columns, rows = np.nonzero(mass.T)
    digest = hashlib.sha256(b"enumsol mass 1" + np.array(len(mass), "<i8").tobytes())
    for part, kind in ((rows, "<i8"), (columns, "<i8"), (mass[rows, columns], "<f8")):
        digest.update(part.astype(kind).tobytes())
    return digest.hexdigest()


class Stability:
    """A problem with its mass, and what a file says of its roots."""

    #: Counts and roots of proofs of roots that were read before.
    read = {}  # noqa: RUF012

    def __init__(self, problem, mass):
        self.problem, self.mass, self.p = problem, mass, problem.p
        names = ["Bn", "Bt"] if hasattr(problem, "Bt") else ["Bn", "Bt1", "Bt2"]
        self.B = np.vstack([getattr(problem, name).toarray() for name in names])
        self.A, self.size = problem.A.toarray(), len(self.B)
        self.in_space = len(names) == 3
        self._parts = {}

    def run(self, records):
        header = records[0]
        need(set(header) == {"format", "version", "kind", "problem", "p", "mass"}, "other names in the header")
        need(header["format"] == "enumsol-proof" and integer(header["version"]) == 2, "another format or version")
        own = (space_fingerprint if self.in_space else plane_fingerprint)(self.problem)
        need(header["problem"] == own and integer(header["p"]) == self.p, "another problem")
        need(header["mass"] == fingerprint_of(self.mass), "another mass")
        end = next(k for k, record in enumerate(records) if k > 1 and isinstance(record, dict))
        count, roots = self.roots_of(records[1 : end + 1])
        need(isinstance(records[-1], dict), "no footer")
        said = []
        for record in records[end + 1 : -1]:
            if record[0] == "v":
                said.append((self.point(record), []))
            else:
                said[-1][1].append(record)
        verdicts = [verdict for (_, verdict), _ in said]
        counts = {verdict: verdicts.count(verdict) for verdict in VERDICTS}
        need(are([records[-1]], [{"roots": len(said), **counts}]), "the counts are others")
        need(len(said) == count, f"there are {count} roots")
        meant = matched([point for (point, _), _ in said], roots, count)
        return [
            self.verdict(root, verdict, certificates)
            for root, ((_, verdict), certificates) in zip(meant, said, strict=True)
        ]

    def point(self, record):
        _, forces, verdict = record
        need(isinstance(forces, list) and len(forces) == self.size, "not as many forces as rows")
        need(verdict in VERDICTS, "no verdict")
        return [exact(value) for value in forces], verdict

    def roots_of(self, records):
        """[5] The number of isolated roots, and those that are known strictly."""
        key = self.problem, json.dumps(records)
        if key not in self.read:
            counts = (judge_records if self.in_space else check_records)(self.problem, records)
            need(records[0]["data"] == "problem", "other data")
            alpha, found = decimal_fraction(records[0]["alpha"]), []
            F = self.friction(alpha)
            places, scale = list(range(self.size)), np.ones(self.size)
            if self.in_space:
                # [4.6] lambda_t / F node by node, in units of their own
                places[self.p :] = [(k + 1) * self.p + i for i in range(self.p) for k in range(2) if F[k][i] > 0]
                scale = np.tile(2.0 ** np.array(records[0]["force"]), 3)
                scale[self.p :] *= [float(x) for own in F for x in own]
            for named in starts(records, len(places)):
                start = np.zeros(self.size)
                start[places] = named
                root = enclosed(self, alpha, F, scale * start)
                if root is not None and not any(near(root, other) for other in found):
                    found.append(root)
            self.read[key] = counts["roots"], found
        return self.read[key]

    def friction(self, alpha):
        """F, by tangents and nodes."""
        problem = self.problem
        parts = (problem.friction, problem.friction_slope) if self.in_space else [[x] for x in problem.affine_friction]
        return [
            [exact(a) + alpha * exact(b) for a, b in zip(first.tolist(), slope.tolist(), strict=True)]
            for first, slope in zip(*parts, strict=True)
        ]

    # -- [10] certificates ---------------------------------------------------------------------------------------------

    def verdict(self, root, said, certificates):
        if root is None or said == "undecided":
            need(said != "undecided" or not certificates, "certificates of nothing")
            return "undecided"
        parts = self.parts(root)
        for record in certificates:
            need(0 <= integer(record[1]) < len(parts), "no such part")
        if said == "runs away":
            [[name, number, low, high, slides]] = certificates
            need(name == "g", "no motion that grows")
            parts[number].grows(low, high, slides)
            return said
        for number, part in enumerate(parts):
            part.quiet([record for record in certificates if record[1] == number])
        return said

    def parts(self, root):
        """Parts of the body with a node at its limit, by what the nodes do at a root."""
        n, p, linked = len(self.A), self.p, (self.A != 0) | (self.mass != 0)
        for i in range(p):
            own = np.flatnonzero(np.any(self.B[i::p] != 0, axis=0))
            linked[np.ix_(own, own)] = True
        reach = np.linalg.matrix_power(linked.astype(float) + np.eye(n), 1) > 0
        while True:
            further = (reach.astype(float) @ reach.astype(float)) > 0
            if np.array_equal(further, reach):
                break
            reach = further
        found = []
        for first in range(n):
            dofs = np.flatnonzero(reach[first])
            nodes = [i for i in range(p) if np.any(self.B[i::p][:, dofs] != 0)]
            if dofs[0] == first and any(root.kinds[i] == "limit" for i in nodes):
                found.append(self.part(root, dofs, nodes))
        return found

    def part(self, root, dofs, nodes):
        key = id(root), int(dofs[0])
        if key not in self._parts:
            self._parts[key] = root, Part(self, root, dofs, nodes)
        return self._parts[key][1]


class Part:
    """Rows that touch, K(mu) and directions R and T (theory, (15.4)) of one part of the body at a root."""

    def __init__(self, whole, root, dofs, nodes):
        p, touching = whole.p, [i for i in nodes if root.kinds[i] != "open"]
        rows = [*touching, *((k + 1) * p + i for k, F in enumerate(root.F) for i in touching if F[i] > 0)]
        place = {row: at for at, row in enumerate(rows)}
        self.A, self.M = (matrix[np.ix_(dofs, dofs)] for matrix in (whole.A, whole.mass))
        self.B = whole.B[np.ix_(rows, dofs)]
        limits = [i for i in touching if root.kinds[i] == "limit"]
        R, T = (arb_mat(len(rows), len(limits)) for _ in range(2))
        for j, i in enumerate(limits):
            largest = max((F[i] for F in root.F), key=float)
            for k, share in enumerate(root.directions[i]):
                if root.F[k][i] > 0:
                    R[place[(k + 1) * p + i], j] = T[place[(k + 1) * p + i], j] = share * largest / arb(root.F[k][i])
            T[place[i], j] = -arb(largest)
        self.R, self.T, self.count, self._known = R, T, len(limits), {}

    def at(self, mu):
        """K(mu)"""
        if (key := (mu.mid().man_exp(), mu.rad().man_exp())) not in self._known:
            self._known[key] = bordered(balls(self.A) + balls(self.M) * mu, self.B)
        return self._known[key]

    @cached_property
    def massive(self):
        """Degrees of freedom with mass, where M is definite."""
        own = np.flatnonzero(np.diag(self.M) > 0)
        need(len(own) and is_definite(balls(self.M[np.ix_(own, own)])), "the mass is not definite where it is not zero")
        return own

    @cached_property
    def far(self):
        """The least slope of K, zero in rows that yield, and its bound in these, zero in the others."""
        own = self.massive
        rest = np.setdiff1d(np.arange(len(self.A)), own)
        return [
            placed(balls(matrix[np.ix_(dofs, dofs)]), self.B[np.ix_(rows, dofs)], rows, len(self.B))
            for matrix, dofs, rows in ((self.M, own, self.firm), (self.A, rest, self.yields))
        ]

    @cached_property
    def yields(self):
        """Rows that act on a degree of freedom without mass."""
        return np.flatnonzero(np.any(self.B[:, np.setdiff1d(np.arange(len(self.A)), self.massive)], axis=1)).tolist()

    @property
    def firm(self):
        return [row for row in range(len(self.B)) if row not in self.yields]

    def grows(self, low, high, slides):
        """The motion itself, where the determinant vanishes (theory, section 15.4)."""
        low, high = arb(exact(low)), arb(exact(high))
        need(0 < low < high, "no range")
        need(self.massive is not None, "no mass")
        need(len({*slides}) == len(slides) and [*slides] == sorted(slides), "components are not in order")
        need(all(0 <= integer(i) < self.count for i in slides) and slides, "no such components")
        left, right = columns(self.T, slides).transpose(), columns(self.R, slides)

        def sign(mu):
            value = (left * self.at(mu) * right).det()
            return 1 if value > 0 else -1 if value < 0 else 0

        first = sign(low)
        need(first * sign(high) < 0, "the determinants have the same sign")
        for _ in range(HALVINGS):
            middle = ((low + high) / 2).mid()
            here = sign(middle)
            if not here:
                break
            low, high = (middle, high) if here == first else (low, middle)
        K = self.at(low.union(high))
        Q = left * K * right
        x = null_vector(Q)
        r = (self.T.transpose() * K * right * x).entries()
        need(all(value > 0 for value in x.entries()), "a node slides backward")
        need(all(r[i] > 0 for i in range(self.count) if i not in slides), "a node that stays would slide")

    def quiet(self, records):
        """Every record by theory, (15.7), and all of mu and all ways in which nodes slide or stay."""
        leaves = []
        for name, _, low, high, beside, slides, stays, kappa, *N in records:
            need(name == "n", "a motion that grows")
            k, zero = self.count, [[arb(0)] * self.count for _ in range(self.count)]
            for own in (slides, stays):
                need(all(0 <= integer(i) < k for i in own), "no such component")
            need(len({*slides, *stays}) == len(slides) + len(stays), "a component is named twice")
            unit = [[arb(int(i == j)) for j in range(k)] for i in range(k)]
            weights = entries(kappa, k, unit)
            for i, j in product(range(k), repeat=2):
                need(i == j or i in slides or j in stays or weights[i][j] <= 0, "a weight is not allowed")
            products = [entries(of, k, zero) for of in N]
            need(len(products) == 2, "other matrices")
            need(all(value >= 0 for of in products for row in of for value in row), "a product is negative")
            a, b, c = (None if value is None else arb(exact(value)) for value in (low, high, beside))
            need(a >= 0 and (b is None or a < b), "no range")
            self.definite(a, b, c, [j for j in range(k) if j not in stays], weights, products)
            leaves.append((a, b, {*slides}, {*stays}))
        ends = sorted({float(end) for a, b, *_ in leaves for end in (a, b) if end is not None} | {0.0})
        for low, high in pairwise([*ends, None]):
            over = [
                decided
                for a, b, *decided in leaves
                if a <= low and (b is None or (high is not None and arb(high) <= b))
            ]
            asked = sorted({i for decided in over for own in decided for i in own})
            for way in product([True, False], repeat=len(asked)):
                slide = {i for i, moves in zip(asked, way, strict=True) if moves}
                stay = {*asked} - slide
                need(any(own[0] <= slide and own[1] <= stay for own in over), "a way is left out")

    def definite(self, a, b, c, kept, weights, products):
        if not kept:
            return
        L = columns(self.T * arb_mat(weights), kept)
        R = columns(self.R, kept)
        for at, ((K, E), N) in enumerate(zip(self.bounds(a, b, c), products, strict=True)):
            Q = L.transpose() * K * R
            Q = Q - arb_mat([[N[i][j] for j in kept] for i in kept])
            if E is not None:
                Q = Q - (L - R).transpose() * E * (L - R) * arb(0.25)
            Q, own = (Q + Q.transpose()) * arb(0.5), list(range(len(kept)))
            if b is None and at:
                own = [j for j in own if any(L[i, j] != 0 or R[i, j] != 0 for i in self.firm)]
                others = [j for k, j in enumerate(kept) if k not in own]
                need(not any(N[i][j] != 0 or N[j][i] != 0 for i in kept for j in others), "a product without a slope")
            need(not own or is_definite(columns(columns(Q, own).transpose(), own)), "a form is not definite")

    def bounds(self, a, b, c):
        """K, or its slope, and E at both ends (theory, (15.7) and (15.8))."""
        first = self.at(a)
        if c is not None:
            need(c < a or (b is not None and c > b), "a point within the range")
            need(c >= 0 or is_definite(balls(self.A) + balls(self.M) * c), "A + c M is not definite")
            beside = self.at(c)
        if b is None:
            slope, most = self.far
            need(c is not None or not self.firm, "no slope of K")
            share = 2 if self.firm and self.yields else 1
            above = slope if c is None else (first - beside) * (1 / (a - c)) - slope
            return (
                (first, among(most - first, self.yields) * arb(share)),
                (slope, among(above, self.firm) * arb(share)),
            )
        last = self.at(b)
        if c is None:
            need(self.massive is not None, "no mass")
            return (first, last - first), (last, None)
        if c < a:
            return (first, None), (last, first + (first - beside) * ((b - a) / (a - c)) - last)
        return (first, last - (beside - last) * ((b - a) / (c - b)) - first), (last, None)


def bordered(A, B):
    """(B A^-1 B')^-1, from the inverse of [[A, B'], [B, 0]]."""
    n, m = A.nrows(), len(B)
    whole = arb_mat(n + m, n + m)
    for i, j in product(range(n), repeat=2):
        whole[i, j] = A[i, j]
    for k, row in enumerate(B.tolist()):
        for j, value in enumerate(row):
            whole[n + k, j] = whole[j, n + k] = arb(value)
    inverse = whole.inv()
    return arb_mat([[-inverse[n + i, n + j] for j in range(m)] for i in range(m)])


def placed(A, B, rows, size):
    """(B A^-1 B')^-1 between some rows, zero elsewhere."""
    whole = arb_mat(size, size)
    if rows:
        part = bordered(A, B)
        for (i, row), (j, column) in product(enumerate(rows), repeat=2):
            whole[row, column] = part[i, j]
    return whole


def among(K, rows):
    return arb_mat([[K[i, j] if {i, j} <= {*rows} else 0 for j in range(K.ncols())] for i in range(K.nrows())])


def columns(matrix, kept):
    return arb_mat([[row[j] for j in kept] for row in matrix.tolist()])


def null_vector(Q):
    """x with Q x = 0 of a singular matrix in a ball, with one component 1 and of the sign of most."""
    k = Q.nrows()
    if k == 1:
        return arb_mat([[1]])
    U, _, V = np.linalg.svd(np.array([[float(value.mid()) for value in row] for row in Q.tolist()]))
    row, one = int(np.argmax(np.abs(U[:, -1]))), int(np.argmax(np.abs(V[-1])))
    rows = [own for i, own in enumerate(Q.tolist()) if i != row]
    system = arb_mat([*rows, [arb(int(j == one)) for j in range(k)]])
    return system.solve(arb_mat([[0]] * (k - 1) + [[1]]))


def entries(given, k, usual):
    """A matrix of a record."""
    if given is None:
        return usual
    matrix, before = [[arb(0)] * k for _ in range(k)], (-1, -1)
    for i, j, value in given:
        need(0 <= integer(i) < k and 0 <= integer(j) < k and before < (i, j), "entries are not in order")
        matrix[i][j], before = arb(exact(value)), (i, j)
    return matrix


def matched(points, roots, count):
    """The root that every record is about; None where it is not among those known strictly."""

    def away(point, root):
        return max((abs(arb(a) - b) for a, b in zip(point, root.forces, strict=True)), key=lambda x: float(x.mid()))

    found = []
    for point in points:
        far = [away(point, root) for root in roots]
        best = min(range(len(far)), key=lambda k: float(far[k].mid()), default=None)
        if len(roots) == count:
            need(all(2 * far[best] < other for k, other in enumerate(far) if k != best), "no root is meant")
            found.append(best)
        else:
            close = best is not None and far[best] < 1e-6 * (1 + max(abs(x) for x in roots[best].forces))
            found.append(best if close else None)
    named = [k for k in found if k is not None]
    need(len({*named}) == len(named), "two records are about one root")
    return [None if k is None else roots[k] for k in found]
