"""Systems over alpha in rationals, and what is true of their selections."""

from functools import cached_property
from itertools import pairwise

import numpy as np
from flint import arb, fmpq, fmpq_mat

from enumsol.arithmetic.algebraic import CriticalAlpha, merge, rational_between, real_roots
from enumsol.arithmetic.balls import Ball
from enumsol.arithmetic.rationals import rational
from enumsol.branches.enclosed.zeros import zeros_of
from enumsol.condensation.exact import ExactCondensed
from enumsol.model.statuses import RowKind
from enumsol.selections.functions import SelectionFunctions
from enumsol.trusted.arcs.selection_balls import ArcSystem
from enumsol.trusted.arcs.taylor import precision
from enumsol.trusted.selection import Selection
from enumsol.trusted.status_rows import FRICTIONLESS


def random_data(rng, p, *, integers=False, scale=0, ill=0):
    """S, g0, g1, F0, F1 as floats: S has eigenvalues down to 10^-ill, and all but F are multiplied by 2^scale."""
    if integers:
        G = rng.integers(-2, 3, size=(2 * p, 2 * p))
        S = (G @ G.T + np.eye(2 * p)).astype(float)
        g0, g1 = rng.integers(-3, 4, size=(2, 2 * p)).astype(float)
        F0, F1 = rng.integers(0, 3, size=p).astype(float), rng.integers(0, 3, size=p) / 2
    else:
        G = rng.normal(size=(2 * p, 2 * p)) * 10.0 ** (-0.5 * ill * rng.random(2 * p))
        S = G @ G.T
        S = 0.5 * (S + S.T)
        g0, g1 = rng.normal(size=(2, 2 * p)) * 10.0 ** rng.integers(-2, 3, size=(2, 1))
        F0, F1 = rng.uniform(0, 2, size=(2, p)) * 10.0 ** rng.integers(-2, 2, size=(2, 1))
    if rng.random() < 0.3:
        g1 = np.zeros(2 * p)
    elif rng.random() < 0.3:
        F1 = np.zeros(p)
    up = 2.0**scale
    return S * up, g0 * up, g1 * up, F0, F1


def random_cases(seeds, *, integers, scales, ills):
    """Random data, a share of them whole numbers, in units and with condition numbers of these; and a selection."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        p, scale = int(rng.integers(1, 4)), int(rng.choice(scales))
        data = random_data(rng, p, integers=rng.random() < integers, scale=scale, ill=int(rng.choice(ills)))
        codes = rng.integers(0, 4, size=p)
        codes[rng.random(p) < 0.1] = FRICTIONLESS
        yield rng, data, tuple(codes.tolist())


def arc_system(data):
    """In balls of double arithmetic, without radii."""
    S, g0, g1, F0, F1 = data
    return ArcSystem(*(Ball.exact(part) for part in (S, g0, g1)), F0, F1)


def widened(rng, data, width):
    """A system with radii, and data from within them."""
    S, g0, g1, F0, F1 = data
    balls, inside = [], []
    for part in (S, g0, g1):
        rad = width * rng.uniform(size=part.shape) * np.max(np.abs(part))
        rad = np.maximum(rad, rad.T) if part.ndim == 2 else rad
        share = rng.choice((-1.0, 0.0, 0.5, 1.0), size=part.shape)
        share = np.triu(share) + np.triu(share, 1).T if part.ndim == 2 else share
        balls.append(Ball(part, rad))
        inside.append((part, rad * share))
    return ArcSystem(*balls, F0, F1), exact_of([*inside, (F0, 0 * F0), (F1, 0 * F1)])


def precise_system(data):
    """In balls of many digits."""
    S, g0, g1, F0, F1 = data
    with precision():
        return ArcSystem(*(np.frompyfunc(arb, 1, 1)(part) for part in (S, g0, g1)), F0, F1)


def exact_of(parts):
    """The condensed problem in rationals; every part floats, or pairs of floats to be added."""
    rows = [_rational(part) for part in parts]
    S, g0, g1, F0, F1 = rows
    return ExactCondensed(
        tuple(map(tuple, S)), tuple(g0), tuple(g1), tuple(F0), tuple(F1), condensed_exactly=True, zero=None
    )


def _rational(part):
    pair = part if isinstance(part, tuple) else (part, np.zeros_like(part))
    if pair[0].ndim == 2:
        return [_rational((a, b)) for a, b in zip(*pair, strict=True)]
    return [rational(float(a)) + rational(float(b)) for a, b in zip(*pair, strict=True)]


class Truth:
    """Determinant and conditions of a selection, as polynomials and at single alphas."""

    def __init__(self, exact, codes):
        self.exact, self.rows = exact, Selection(codes, len(exact.reach))
        functions = SelectionFunctions(exact, codes)
        # of a body that nothing holds the index is that of the columns of q, where exact algebra has those of -q
        turn = (-1) ** len(exact.reach)
        self.det = functions.det * turn
        if functions.singular:
            self.conditions = []
            return
        own = [functions.row(RowKind(kind), node) for node, kind in self.rows.conditions if node < exact.p]
        bounds = functions.margins()
        self.conditions = [row * turn for row in (*own, *bounds[1::2], *bounds[::2])]

    @cached_property
    def interesting(self):
        """Where the determinant or a condition vanishes, or a condition has a maximum or minimum, as floats."""
        det = self.det
        flat = [row.derivative() * det - row * det.derivative() for row in self.conditions]
        polynomials = [poly for poly in (det, *self.conditions, *flat) if poly.degree() > 0]
        return [float(root) for poly in polynomials for root in real_roots(poly, fmpq(-10), fmpq(10))]

    def signs(self, polynomial, low, high):
        """All signs of a polynomial over [low, high]."""
        return {alpha.sign_of(polynomial) for alpha in places([polynomial], low, high)}

    def is_true(self, known, low, high):
        """Whether OverInterval is."""
        if self.det.is_zero():
            return not known.regular
        if known.regular and 0 in self.signs(self.det, low, high):
            return False
        if known.none and any(self.holds(alpha) for alpha in places([self.det, *self.conditions], low, high)):
            return False
        if not known.regular:
            return True
        (index,) = self.signs(self.det, low, high)
        claimed = known.conditions.tolist()
        return all(
            not sign or self.signs(row, low, high) == {sign * index}
            for sign, row in zip(claimed, self.conditions, strict=True)
        )

    def holds(self, alpha):
        """Whether there is a root where the selection is regular."""
        sign = alpha.sign_of(self.det)
        return sign != 0 and all(alpha.sign_of(row) * sign >= 0 for row in self.conditions)

    def only_zero(self, condition, slope, low, high):
        """Whether a condition has at most one zero, at which it changes its sign as a slope of this sign lets it."""
        row = self.conditions[condition]
        if row.is_zero():
            return False
        zeros = real_roots(row, rational(low), rational(high))
        (index,) = self.signs(self.det, low, high)
        signs = [CriticalAlpha.rational(rational(end)).sign_of(row) * index * slope for end in (low, high)]
        return len(zeros) <= 1 and signs[0] <= signs[1] and (len(zeros) == 0 or signs[0] < signs[1])

    def conditions_at(self, alpha, v):
        """The conditions of z with N z = e, then t, and their slopes, in rationals; None where N is singular."""
        exact, rows, p = self.exact, self.rows, self.exact.p
        unknown, k = rows.unknown.tolist(), len(rows.unknown)
        place = {node: j for j, node in enumerate(rows.closed.tolist())}
        turn = dict(zip(rows.slip.tolist(), (int(s) for s in rows.slip_signs), strict=True))
        W, W1 = ([[fmpq(0)] * k for _ in range(2 * p)] for _ in range(2))
        for r in range(2 * p):
            for j, u in enumerate(unknown):
                W[r][j] = exact.rows[r][u]
                if u in turn:
                    moved = exact.rows[r][p + u] * turn[u]
                    W[r][j] += moved * (exact.F0[u] + alpha * exact.F1[u])
                    W1[r][j] = moved * exact.F1[u]
        g = [a + alpha * b for a, b in zip(exact.g0, exact.g1, strict=True)]
        last = [rational(float(x)) for x in v]
        N = fmpq_mat([[*W[r], -g[r]] for r in unknown] + [last])
        N1 = fmpq_mat([[*W1[r], -exact.g1[r]] for r in unknown] + [[fmpq(0)] * (k + 1)])
        if N.det() == 0:
            return None
        z = N.solve(fmpq_mat(k + 1, 1, [fmpq(0)] * k + [fmpq(1)]))
        dz = N.solve(N1 * z) * fmpq(-1)

        def moves(r, y):
            return g[r] * y[k, 0] - sum((W[r][j] * y[j, 0] for j in range(k)), fmpq(0))

        values, slopes = [], []
        for node, kind in rows.conditions:
            if kind == RowKind.NORMAL_FORCE:
                values.append(z[place[node], 0])
                slopes.append(dz[place[node], 0])
            elif kind in (RowKind.CONE_PLUS, RowKind.CONE_MINUS):
                j, i = place[node], len(place) + rows.stick.tolist().index(node)
                sign = -1 if kind == RowKind.CONE_PLUS else 1
                F = exact.F0[node] + alpha * exact.F1[node]
                values.append(F * z[j, 0] + sign * z[i, 0])
                slopes.append(exact.F1[node] * z[j, 0] + F * dz[j, 0] + sign * dz[i, 0])
            else:
                r = node if kind == RowKind.PENETRATION else p + node
                sign = 1 if kind == RowKind.SLIP_FORWARD else -1
                rise = exact.g1[r] * z[k, 0] - sum((W1[r][j] * z[j, 0] for j in range(k)), fmpq(0))
                values.append(sign * moves(r, z))
                slopes.append(sign * (rise + moves(r, dz)))
        return [*values, z[k, 0]], [*slopes, dz[k, 0]]


def places(polynomials, low, high):
    """Numbers in [low, high]: the ends, all roots, and one between any two of these."""
    low, high = rational(low), rational(high)
    found = [CriticalAlpha.rational(low), CriticalAlpha.rational(high)]
    for polynomial in polynomials:
        if polynomial.degree() > 0:
            found += real_roots(polynomial, low, high)
    roots = [group[0] for group in merge(found)]
    return roots + [CriticalAlpha.rational(rational_between(a, b)) for a, b in pairwise(roots)]


def interval_at(rng, truth, low=-4.0, high=4.0):
    """An interval of any width, often about a place of interest."""
    centre = float(rng.uniform(low, high))
    roots = truth.interesting
    if roots and rng.random() < 0.7:
        centre = roots[int(rng.integers(len(roots)))]
    width = 10.0 ** rng.uniform(-14, 1.5)
    first, last = centre - width * rng.random(), centre + width * rng.random()
    return (first, last) if first < last else (centre, float(np.nextafter(centre, np.inf)))


def beside(rng, truth, low, high):
    """Parts of an interval that end close to places of interest inside."""
    for root in truth.interesting:
        if low < root < high:
            end = root + float(rng.choice((-1, 0, 1))) * (high - low) * 10.0 ** -float(rng.uniform(2, 17))
            if low < end < high:
                yield low, end
                yield end, high


def two_zeros(gap):
    """Data of one node that slips, w_t = (alpha - 1)^2 - gap, with the codes and the condition's number."""
    data = np.eye(2), np.array([2.0, 1.0 - gap]), np.array([-1.0, 0.0]), np.zeros(1), np.ones(1)
    return data, (2,), 0


def check_slopes(truth, expansion, known, a, b, made):
    """Slopes of conditions that are known over a part are true, and so are the zeros that follow; counts them."""
    slopes = known.slopes
    for k in np.flatnonzero(slopes).tolist():
        made["slopes"] += 1
        assert truth.only_zero(k, int(slopes[k]), a, b)
        if a < b and [int(end[k]) for end in known.ends] == [-slopes[k], slopes[k]]:
            made["zeros"] += 1
            first, last = zeros_of(expansion).zero_bounds(k, int(slopes[k]), a, b)
            assert a <= first < last <= b
            assert truth.signs(truth.conditions[k], first, last) == {-1, 0, 1}
