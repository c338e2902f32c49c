"""Oracles that share no code with enumsol: dense condensation, all 4^p selections in numpy and in Fractions.

Codes of statuses are 0 open, 1 stick, 2 slip+, 3 slip-, the order of ContactStatus. Forces and displacements are
stacked as (normal, tangential).
"""

import itertools
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from scipy.optimize import nnls

NAMES = ("open", "stick", "slip+", "slip-")


def condense(problem, alpha):
    """Dense S, g and F of a problem at alpha."""
    A = problem.A.toarray()
    B = np.vstack([problem.Bn.toarray(), problem.Bt.toarray()])
    f = problem.f + (0.0 if problem.load_slope is None else alpha * problem.load_slope)
    X = np.linalg.solve(A, np.column_stack([B.T, f]))
    g = B @ X[:, -1] - np.concatenate([problem.gap, problem.slip_offset])
    return B @ X[:, :-1], g, problem.friction + alpha * problem.friction_slope


@dataclass(frozen=True)
class Found:
    """A selection whose conditions hold: its codes, forces, sign of determinant and least slack."""

    codes: tuple[int, ...]
    forces: np.ndarray
    sign: int
    slack: float


def brute_force(S, g, F):
    """(selections that hold, least distance of a selection from the border of holding, codes of singular selections).

    Slacks are relative to the largest force and displacement of the selection. A selection counts as singular when its
    matrix, rows scaled, has a condition number above 1e11; it is not solved.
    """
    p = len(F)
    force_unit, length_unit = np.max(np.abs(g)) / np.max(np.abs(S)) or 1.0, np.max(np.abs(g)) or 1.0
    S, g = S * force_unit / length_unit, g / length_unit
    codes = np.array(list(itertools.product(range(4), repeat=p)))
    M = np.tile(np.eye(2 * p), (len(codes), 1, 1))
    b = np.zeros((len(codes), 2 * p))
    for i in range(p):
        closed, stick = codes[:, i] > 0, codes[:, i] == 1
        M[closed, i], b[closed, i] = S[i], g[i]
        M[stick, p + i], b[stick, p + i] = S[p + i], g[p + i]
        M[codes[:, i] == 2, p + i, i] = -F[i]
        M[codes[:, i] == 3, p + i, i] = F[i]
    scale = np.max(np.abs(M), axis=2, keepdims=True)
    singular = np.linalg.cond(M / scale) > 1e11
    M[singular], b[singular] = np.eye(2 * p), 0.0
    forces = np.linalg.solve(M, b[:, :, None])[:, :, 0]
    w = g - forces @ S
    slack = np.full(len(codes), np.inf)
    for i in range(p):
        n, t, wn, wt = forces[:, i], forces[:, p + i], w[:, i], w[:, p + i]
        least = np.array([-wn, np.minimum(n, F[i] * n - np.abs(t)), np.minimum(n, wt), np.minimum(n, -wt)])
        slack = np.minimum(slack, least[codes[:, i], np.arange(len(codes))])
    slack /= np.maximum(np.max(np.abs(w), axis=1), np.max(np.abs(forces), axis=1)) + 1e-300
    signs = np.linalg.slogdet(M)[0]
    found = [
        Found(tuple(int(c) for c in codes[k]), forces[k] * force_unit, int(signs[k]), float(slack[k]))
        for k in np.flatnonzero(~singular & (slack >= 0))
    ]
    border = float(np.min(np.abs(slack[~singular])))
    return found, border, [tuple(int(c) for c in codes[k]) for k in np.flatnonzero(singular)]


# -- rational arithmetic ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Component:
    """A connected set of exact solutions: polytopes as (codes, vertices, dimension)."""

    parts: tuple
    holds: object  # (codes, point) -> whether the selection's conditions hold

    @property
    def dimension(self):
        return max(part[2] for part in self.parts)

    @property
    def vertices(self):
        """Vertices of the maximal polytopes."""
        dropped = [
            a for a in self.parts for b in self.parts if a[2] <= b[2] and self._inside(a, b) and not self._inside(b, a)
        ]
        return {v for part in self.parts if part not in dropped for v in part[1]}

    def _inside(self, a, b):
        return all(self.holds(b[0], v) for v in a[1])

    def active(self, p):
        """Per node the statuses that hold at an isolated root."""
        point = self.parts[0][1][0]
        return tuple(frozenset(NAMES[code] for code in range(4) if self.holds({i: code}, point)) for i in range(p))

    def distance(self, point):
        """Least distance of a float point to one of the polytopes."""
        return min(_hull_distance(np.array(v, dtype=float), point) for _, v, _ in self.parts)


def exact_condense(problem, alpha):
    """S, g, F as Fractions from the data as given."""
    A = [[Fraction(v) for v in row] for row in problem.A.toarray()]
    B = [[Fraction(v) for v in row] for row in np.vstack([problem.Bn.toarray(), problem.Bt.toarray()])]
    slope = np.zeros(len(A)) if problem.load_slope is None else problem.load_slope
    f = [Fraction(a) + Fraction(alpha) * Fraction(b) for a, b in zip(problem.f, slope, strict=True)]
    n, size = len(A), len(B)
    table = [A[i] + [B[r][i] for r in range(size)] + [f[i]] for i in range(n)]
    solved, _ = _rref(table, n)
    X = [row[n:] for row in solved]
    product = [[sum(B[r][i] * X[i][k] for i in range(n)) for k in range(size + 1)] for r in range(size)]
    offset = [Fraction(v) for v in (*problem.gap, *problem.slip_offset)]
    F = [Fraction(a) + Fraction(alpha) * Fraction(b) for a, b in zip(*problem.affine_friction, strict=True)]
    return [row[:-1] for row in product], [row[-1] - o for row, o in zip(product, offset, strict=True)], F


def exact_solutions(problem, alpha):
    """Connected components of all solutions, by rational arithmetic over all 4^p selections."""
    return solutions_of(*exact_condense(problem, alpha))


def solutions_of(S, g, F):
    """The same from S, g and F in Fractions."""
    parts = []
    # a node without friction has one status in contact: its slip is free and its sign no border (code 4)
    for codes in itertools.product(*((0, 1, 2, 3) if c > 0 else (0, 4) for c in F)):
        vertices = _vertices(*_conditions(S, g, F, codes))
        if vertices:
            parts.append((codes, vertices, _dimension(vertices)))
    groups = [[part] for part in parts]
    merged = True
    while merged:
        merged = False
        for a, b in itertools.combinations(range(len(groups)), 2):
            if any(_meet(S, g, F, x[0], y[0]) for x in groups[a] for y in groups[b]):
                groups[a] += groups.pop(b)
                merged = True
                break

    def holds(codes, point):
        equations, inequalities = _conditions(S, g, F, codes)
        return all(_at(row, point) == 0 for row in equations) and all(_at(row, point) >= 0 for row in inequalities)

    return [Component(tuple(group), holds) for group in groups]


def perturbed_indices(S, g, F, components, rng, step=1e-7):
    """Index of every component: sum of sign det over the roots near it after a small perturbation of g."""
    S, g, F = (np.array(v, dtype=float) for v in (S, g, F))
    size = float(np.max(np.abs(g))) or 1.0
    found, _, _ = brute_force(S, g + step * size * rng.normal(size=len(g)), F)
    totals = [0] * len(components)
    for root in found:
        distances = [c.distance(root.forces) for c in components]
        totals[int(np.argmin(distances))] += root.sign
    return totals


def _conditions(S, g, F, codes):
    """Equations and inequalities (>= 0) as rows (coefficients..., constant)."""
    p, m = len(F), 2 * len(F)
    equations, inequalities = [], []

    def row(terms, constant=Fraction(0)):
        out = [Fraction(0)] * (m + 1)
        for j, v in terms:
            out[j] += v
        out[m] = constant
        return out

    def w(r, sign):
        return [-sign * v for v in S[r]] + [sign * g[r]]

    for i, code in codes.items() if isinstance(codes, dict) else enumerate(codes):
        n, t = i, p + i
        if code == 0:
            equations += [row([(n, 1)]), row([(t, 1)])]
            inequalities.append(w(n, -1))
            continue
        equations.append(w(n, 1))
        inequalities.append(row([(n, 1)]))
        if code == 4:
            equations.append(row([(t, 1)]))
        elif code == 1:
            equations.append(w(t, 1))
            inequalities += [row([(n, F[i]), (t, -1)]), row([(n, F[i]), (t, 1)])]
        else:
            sign = 1 if code == 2 else -1
            equations.append(row([(n, F[i]), (t, -sign)]))
            inequalities.append(w(t, sign))
    return equations, inequalities


def _rref(table, columns):
    """Reduced row echelon form over the first columns, and its pivots."""
    table = [list(row) for row in table]
    pivots = []
    for j in range(columns):
        k = next((k for k in range(len(pivots), len(table)) if table[k][j] != 0), None)
        if k is None:
            continue
        r = len(pivots)
        table[r], table[k] = table[k], table[r]
        head = table[r][j]
        table[r] = [v / head for v in table[r]]
        for i, other in enumerate(table):
            if i != r and other[j] != 0:
                factor = other[j]
                table[i] = [a - factor * b for a, b in zip(other, table[r], strict=True)]
        pivots.append(j)
    return table, pivots


def _affine(equations):
    """(point, directions) of {equations = 0}, or None."""
    m = len(equations[0]) - 1
    table, pivots = _rref(equations, m)
    if any(row[m] != 0 for row in table[len(pivots) :]):
        return None
    point = [Fraction(0)] * m
    for row, j in zip(table, pivots, strict=False):
        point[j] = -row[m]
    directions = []
    for free in set(range(m)) - set(pivots):
        direction = [Fraction(0)] * m
        direction[free] = Fraction(1)
        for row, j in zip(table, pivots, strict=False):
            direction[j] = -row[free]
        directions.append(direction)
    return point, directions


def _at(row, point):
    return sum(a * b for a, b in zip(row, point, strict=False) if a) + row[-1]


def _vertices(equations, inequalities):
    """Vertices of a bounded polyhedron: every set of tight inequalities that leaves one point."""
    solved = _affine(equations)
    if solved is None:
        return ()
    point, directions = solved
    found = set()
    for tight in itertools.combinations(inequalities, len(directions)):
        corner = _affine(equations + list(tight)) if directions else (point, [])
        if corner is not None and not corner[1] and all(_at(row, corner[0]) >= 0 for row in inequalities):
            found.add(tuple(corner[0]))
    return tuple(sorted(found))


def _dimension(vertices):
    rows = [[a - b for a, b in zip(v, vertices[0], strict=True)] for v in vertices[1:]]
    return len(_rref(rows, len(vertices[0]))[1]) if rows else 0


def _meet(S, g, F, a, b):
    one, two = _conditions(S, g, F, a), _conditions(S, g, F, b)
    return bool(_vertices(one[0] + two[0], one[1] + two[1]))


def _hull_distance(vertices, point):
    # weights >= 0 with sum one, the latter by a heavy extra row
    heavy = 1e3 * (1.0 + np.max(np.abs(vertices)))
    rows = np.vstack([vertices.T, heavy * np.ones(len(vertices))])
    return float(nnls(rows, np.append(point, heavy))[1])
