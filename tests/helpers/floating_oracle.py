"""Bodies that nothing holds, and all their solutions in rationals, from A, Bn, Bt and f as they are.

Nothing is condensed and no spring is added: the unknowns are u, lambda_n and lambda_t, A is singular. All selections
are tried, as systems of equations and inequalities; the vertices of what they hold are found by trying all bases.
"""

from fractions import Fraction
from itertools import combinations, product

import numpy as np
from flint import fmpq, fmpq_mat

import enumsol


def block_on_table(cells=2, push=0.0, press=1.0, friction=0.25, **options):
    """A row of square cells of bars on a table, pressed down and pushed to the right at its lower nodes.

    It slides when ``push`` is 1: then the push is what friction can hold. All data are multiples of 1/4.
    """
    at = [(x, y) for y in (0, 1) for x in range(cells + 1)]
    A = np.zeros((2 * len(at),) * 2)
    for x in range(cells + 1):
        _bar(A, at, (x, 0), (x, 1), 16)
        if x < cells:
            for a, b, k in (((x, 0), (x + 1, 0), 16), ((x, 1), (x + 1, 1), 16)):
                _bar(A, at, a, b, k)
            _bar(A, at, (x, 0), (x + 1, 1), 8)
            _bar(A, at, (x + 1, 0), (x, 1), 8)
    n, p = len(A), cells + 1
    N, Bn, Bt, f = np.zeros((n, 3)), np.zeros((p, n)), np.zeros((p, n)), np.zeros(n)
    for i, (x, y) in enumerate(at):
        N[2 * i], N[2 * i + 1] = (1, 0, -y), (0, 1, x)
        if y == 0:
            Bn[x, 2 * i + 1], Bt[x, 2 * i] = -1, 1
            f[2 * i] = push * press * friction
        else:
            f[2 * i + 1] = -press
    return enumsol.ContactProblem(A, Bn, Bt, f, friction=friction, rigid_modes=N, **options)


def _bar(A, at, a, b, stiffness):
    d = np.subtract(b, a)
    block, i, j = np.outer(d, d) * stiffness / (d @ d), 2 * at.index(a), 2 * at.index(b)
    for k, m, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
        A[k : k + 2, m : m + 2] += sign * block


def random_body(seed, bodies=None):
    """A truss of integer stiffness, or two, that nothing holds in one to six ways, with up to three contact nodes."""
    rng = np.random.default_rng(seed)
    blocks, modes, points = [], [], []
    for _ in range(bodies or int(rng.choice([1, 1, 1, 2]))):
        A, N, at = _truss(rng)
        blocks.append(A)
        modes.append(N)
        points += at
    n = sum(len(A) for A in blocks)
    A, N = np.zeros((n, n)), np.zeros((n, sum(M.shape[1] for M in modes)))
    row = column = 0
    for block, M in zip(blocks, modes, strict=True):
        A[row : row + len(block), row : row + len(block)] = block
        N[row : row + len(block), column : column + M.shape[1]] = M
        row, column = row + len(block), column + M.shape[1]
    p = int(rng.integers(1, min(3, len(points)) + 1))
    nodes = rng.permutation(len(points))[:p]
    normals = np.array([(0, -1), (0, -1), (0, -1), (1, 0), (-1, 0), (0, 1), (1, -1), (-1, -1), (2, -1)])
    Bn, Bt = np.zeros((p, n)), np.zeros((p, n))
    flat = rng.random() < 0.5
    for i, node in enumerate(nodes):
        x, y = (0, -1) if flat else normals[rng.integers(len(normals))]
        Bn[i, 2 * node : 2 * node + 2], Bt[i, 2 * node : 2 * node + 2] = (x, y), (-y, x)
        if len(blocks) > 1 and rng.random() < 0.4 and len(points) > p:
            other = rng.permutation(len(points))[p]
            if other not in nodes:
                Bn[i, 2 * other : 2 * other + 2], Bt[i, 2 * other : 2 * other + 2] = (-x, -y), (y, -x)
    f = rng.integers(-3, 4, n).astype(float)
    kind = rng.random()
    if kind < 0.3:
        f = Bn.T @ rng.integers(0, 4, p) + Bt.T @ rng.integers(-2, 3, p) * rng.choice([0.0, 0.25, 0.5, 1.0])
    elif kind < 0.4:
        f = np.zeros(n)
    elif kind < 0.6:
        f[1::2] -= 4
    own, alike = rng.choice([0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0], p), float(rng.choice([0.0, 0.5, 1.0]))
    friction = own if rng.random() < 0.5 else alike
    slope = rng.integers(-1, 2, n).astype(float) if rng.random() < 0.3 else None
    gap = rng.choice([0.0, 0.0, 0.0, 1.0, -1.0], p) * (rng.random() < 0.5)
    offset = rng.choice([0.0, 0.0, 1.0, -1.0], p) * (rng.random() < 0.3)
    return enumsol.ContactProblem(
        A,
        Bn,
        Bt,
        f,
        gap=gap,
        friction=friction,
        friction_slope=rng.choice([0.0, 0.25]),
        load_slope=slope,
        slip_offset=offset,
        rigid_modes=N,
        max_rigid_displacement=float(rng.choice([8.0, 16.0])),
    )


def _truss(rng):
    """Stiffness, modes and positions of a truss."""
    at = [(0, 0), (2, 0), (1, 2), (3, 2)][: int(rng.choice([1, 2, 3, 3, 3, 4]))]
    n = 2 * len(at)
    A = np.zeros((n, n))
    for i, j in combinations(range(len(at)), 2):
        d = np.subtract(at[j], at[i])
        block = np.outer(d, d) * rng.integers(1, 5)
        for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            A[2 * a : 2 * a + 2, 2 * b : 2 * b + 2] += sign * block
    centre, kept = at[0], [0, 1, 2]
    kind = rng.random()
    if kind < 0.25:  # a spring to the ground at the first node, about which the body turns
        way = int(rng.integers(2))
        A[way, way] += rng.integers(1, 9)
        kept = [1 - way, 2]
    elif kind < 0.4 and len(at) > 2:  # two of them
        way, last = int(rng.integers(2)), 2
        A[way, way] += rng.integers(1, 9)
        A[2 * last + way, 2 * last + way] += rng.integers(1, 9)
        kept = [1 - way] if at[last][1 - way] != centre[1 - way] else [1 - way, 2]
    N = np.zeros((n, 3))
    for i, (x, y) in enumerate(at):
        N[2 * i], N[2 * i + 1] = (1, 0, -(y - centre[1])), (0, 1, x - centre[0])
    N = N[:, kept]
    return A, N[:, np.any(N != 0, axis=0)], at


def rational(value):
    exact = value if isinstance(value, Fraction) else Fraction(float(value))
    return fmpq(*exact.as_integer_ratio())


class Oracle:
    """All solutions within the bounds of the rigid displacement.

    Attributes
    ----------
    points : set of isolated solutions, (lambda_n, lambda_t) as fractions with u
    families : number of connected continua
    """

    def __init__(self, problem, alpha=0, offset=None):
        offset = [rational(x) for x in problem.slip_offset] if offset is None else offset
        alpha = rational(alpha)
        self.problem, self.n, self.p = problem, problem.n, problem.p
        A, Bn, Bt = (M.toarray() for M in (problem.A, problem.Bn, problem.Bt))
        F0, F1 = problem.affine_friction
        self.F = [rational(a) + alpha * rational(b) for a, b in zip(F0, F1, strict=True)]
        self.size = n = self.n + 2 * self.p
        f = [rational(x) for x in problem.f]
        if problem.load_slope is not None:
            f = [x + alpha * rational(y) for x, y in zip(f, problem.load_slope, strict=True)]
        self.balance = [([rational(x) for x in (*A[i], *Bn[:, i], *Bt[:, i])], -f[i]) for i in range(self.n)]
        rows = []
        for i in range(self.p):
            empty = [fmpq(0)] * n
            ln, lt = list(empty), list(empty)
            ln[self.n + i] = lt[self.n + self.p + i] = fmpq(1)
            un = [rational(x) for x in Bn[i]] + [fmpq(0)] * (2 * self.p)
            ut = [rational(x) for x in Bt[i]] + [fmpq(0)] * (2 * self.p)
            rows.append(((ln, fmpq(0)), (lt, fmpq(0)), (un, -rational(problem.gap[i])), (ut, -offset[i])))
        self.rows = rows
        self.box = self._box(problem)
        held = [self.polytope([codes]) for codes in product(range(4), repeat=self.p)]
        self.parts = [(codes, v) for codes, v in zip(product(range(4), repeat=self.p), held, strict=True) if v]
        self._join()

    def _box(self, problem):
        """|q| <= reach with N_J q = u_J."""
        modes = problem.modes
        NJ = fmpq_mat([[rational(x) for x in row] for row in modes.N[modes.held]])
        inverse = NJ.inv().tolist()
        rows = []
        for row, most in zip(inverse, modes.reach(problem.rigid_reach), strict=True):
            form = [fmpq(0)] * self.size
            for j, x in zip(modes.held, row, strict=True):
                form[int(j)] = x
            rows += [(form, rational(most)), ([-x for x in form], rational(most))]
        return rows

    def conditions(self, codes):
        """Equations and inequalities of a selection."""
        equal, least = [], []
        for code, F, ((ln, a), (lt, b), un, ut) in zip(codes, self.F, self.rows, strict=True):
            plus = ([F * x - y for x, y in zip(ln, lt, strict=True)], F * a - b)
            minus = ([F * x + y for x, y in zip(ln, lt, strict=True)], F * a + b)
            opposite = ([-x for x in ut[0]], -ut[1])
            if code == 0:
                equal += [(ln, a), (lt, b)]
                least += [([-x for x in un[0]], -un[1])]
            elif code == 1:
                equal += [un, ut]
                least += [(ln, a), plus, minus]
            else:
                equal += [un, plus if code == 2 else minus]
                least += [(ln, a), ut if code == 2 else opposite]
        return equal, least

    def polytope(self, selections):
        """Vertices of the common solutions of selections."""
        equal, least = list(self.balance), list(self.box)
        for codes in selections:
            more, bounds = self.conditions(codes)
            equal += more
            least += bounds
        return vertices(equal, least)

    def _join(self):
        groups = [{k} for k in range(len(self.parts))]
        for a, b in combinations(range(len(self.parts)), 2):
            one, two = (next(g for g in groups if k in g) for k in (a, b))
            if one is not two and self.polytope([self.parts[a][0], self.parts[b][0]]):
                groups.remove(two)
                one |= two
        self.points, self.families = [], 0
        for group in groups:
            found = {v for k in group for v in self.parts[k][1]}
            if len(found) == 1:
                self.points.append(found.pop())
            else:
                self.families += 1

    @property
    def forces(self):
        """Forces of the isolated solutions as floats, (k, 2p), sorted, and u, (k, n)."""
        rows = sorted([float(Fraction(int(x.p), int(x.q))) for x in v] for v in self.points)
        array = np.array(rows).reshape(len(rows), self.size)
        return array[:, self.n :], array[:, : self.n]


def vertices(equal, least):
    """Vertices of {equal = 0, least >= 0}, which is bounded."""
    size = len(equal[0][0])
    reduced, rank = fmpq_mat([[*form, -constant] for form, constant in equal]).rref()
    table = reduced.tolist()[:rank]
    pivots = [next(j for j, x in enumerate(row) if x != 0) for row in table]
    if size in pivots:
        return []
    free = [j for j in range(size) if j not in pivots]
    origin, kernel = [fmpq(0)] * size, []
    for row, j in zip(table, pivots, strict=True):
        origin[j] = row[size]
    for j in free:
        v = [fmpq(0)] * size
        v[j] = fmpq(1)
        for row, k in zip(table, pivots, strict=True):
            v[k] = -row[j]
        kernel.append(v)

    def dot(a, b):
        return sum((x * y for x, y in zip(a, b, strict=True) if x != 0 and y != 0), fmpq(0))

    rows = {(*(dot(form, v) for v in kernel), dot(form, origin) + constant) for form, constant in least}
    if any(row[-1] < 0 for row in rows if not any(row[:-1])):
        return []
    rows = sorted((row for row in rows if any(row[:-1])), key=str)
    found = set()
    for chosen in combinations(rows, len(kernel)):
        t = []
        if kernel:
            matrix = fmpq_mat([list(row[:-1]) for row in chosen])
            if matrix.det() == 0:
                continue
            t = matrix.solve(fmpq_mat([[-row[-1]] for row in chosen])).entries()
        if all(dot(row[:-1], t) + row[-1] >= 0 for row in rows):
            found.add(tuple(o + dot(t, [v[j] for v in kernel]) for j, o in enumerate(origin)))
    return list(found)
