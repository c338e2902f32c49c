"""Tangents, corrections, and transition points, which signs of test functions find (theory, sections 8.3, 8.7 and 8.8).

Within one selection a solution curve is smooth, and the conditions of its statuses are smooth functions along it. The
point at which the first of them vanishes is found by Newton's method, and checked: nothing else may have vanished
before. Tangents are oriented, and all that are admissible at a point are known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from math import prod, sqrt
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import solved
from enumsol.continuation.path_data import Tangent
from enumsol.continuation.scaled_equation import ScaledEquation
from enumsol.errors import TooLargeError
from enumsol.model.statuses import STATUS_TOLERANCE
from enumsol.roots.local_branch import MAX_SELECTIONS
from enumsol.support.array_types import Codes, Floats

if TYPE_CHECKING:
    from enumsol.continuation.path_data import ContinuationOptions
    from enumsol.support.array_types import Mask


#: A singular value of a selection's balanced gradient below this fraction of the largest counts as zero.
RANK_TOLERANCE = 1e-10
#: The rate of a vanishing condition along an admissible tangent may be negative by rounding, as much as this.
RATE_TOLERANCE = 1e-8
#: Two tangents closer than this are one.
SAME_TANGENT = 1e-6
#: How far along a tangent its orientation is read where the gradient loses rank; squares of it are above rounding.
ORIENTATION_STEP = 1e-4


def orientation(equation: ScaledEquation, codes: Codes, x: Floats, tangent: Floats) -> int:
    """Sign of det [grad H; tangent'] in a selection: +1, -1, or 0 where the matrix is singular."""
    J = equation.jacobian(equation.selection(codes), x)
    bordered = np.vstack([J, equation.metric @ tangent])
    return int(np.linalg.slogdet(bordered)[0])


def curve_tangent(equation: ScaledEquation, codes: Codes, x: Floats, sign: int) -> Floats | None:
    """Unit tangent of a selection's solution curve with the given orientation; None where it is not unique."""
    J = equation.jacobian(equation.selection(codes), x)
    if not np.all(np.isfinite(J)):
        return None
    balanced, scale = _balanced(J)
    Q, R = np.linalg.qr(balanced.T, mode="complete")
    pivots = np.abs(np.diagonal(R))
    if np.min(pivots) <= RANK_TOLERANCE * np.max(pivots):
        return None
    kernel = scale * Q[:, -1]
    vector = kernel / equation.norm(kernel)
    bordered = np.vstack([J, equation.metric @ vector])
    return np.asarray(vector if np.linalg.slogdet(bordered)[0] == sign else -vector)


def admissible_tangents(
    equation: ScaledEquation, x: Floats, tolerance: float = STATUS_TOLERANCE
) -> tuple[Tangent, ...]:
    """All directions in which a solution curve leaves x, in the order of their selections.

    At a regular root these are two. Directions are judged by first derivatives. A direction that several selections
    share (a grazing curve) is listed once, with the first of them.

    Raises
    ------
    TooLargeError
        More than MAX_SELECTIONS selections hold at x.
    """
    active = equation.active(x, tolerance)
    count = prod(len(holds) for holds in active)
    if count > MAX_SELECTIONS:
        raise TooLargeError(
            f"{count} selections hold at alpha = {equation.alpha(x):g}; tangents are listed for at most "
            f"{MAX_SELECTIONS}"
        )
    found: list[Tangent] = []
    for codes in product(*(sorted(holds) for holds in active)):
        for vector in _directions(equation, codes, x):
            for candidate in (vector, -vector):
                if _leaves_into(equation, codes, x, candidate, tolerance) and not any(
                    equation.norm(candidate - other.vector) <= SAME_TANGENT for other in found
                ):
                    found.append(describe(equation, codes, x, candidate))
    return tuple(found)


def describe(equation: ScaledEquation, codes: Codes, x: Floats, vector: Floats) -> Tangent:
    """The tangent in the user's units, with its orientation."""
    p = equation.p
    sign = orientation(equation, codes, x, vector)
    J = equation.jacobian(equation.selection(codes), x)
    if _kernel(J).shape[1] > 1:
        # a bifurcation point of the selection itself: read the orientation a little ahead
        sign = orientation(equation, codes, x + ORIENTATION_STEP * vector, vector)
    change = equation.forces(vector)
    slip = equation.w(x + ORIENTATION_STEP * vector)[p:]
    return Tangent(
        equation.statuses(codes, slip),
        float(vector[-1] * equation.alpha_scale),
        change.reshape(-1, p).T,
        sign,
        codes,
        vector,
    )


def _leaves_into(equation: ScaledEquation, codes: Codes, x: Floats, vector: Floats, tolerance: float) -> bool:
    """True if no condition of the selection that vanishes at x becomes negative along the vector."""
    at_zero = equation.slacks(codes, x) <= tolerance
    rates = equation.slack_rates(codes, x, vector)
    return bool(np.all(rates[at_zero] >= -RATE_TOLERANCE))


def _balanced(J: Floats) -> tuple[Floats, Floats]:
    """Rows and columns of size one at most, and the columns' factors: ranks do not depend on how large F is.

    Kernel vectors of J are the factors times those of the balanced matrix. Columns are not scaled up: one of nearly
    zeros (alpha where nothing depends on it) is a zero column.
    """
    scaled, columns = J.copy(), np.ones(J.shape[1])
    # each sweep takes the root of what is left of the sizes
    for _ in range(6):
        for axis in (1, 0):
            size = np.max(np.abs(scaled), axis=axis, keepdims=True)
            factor = np.exp2(-np.round(0.5 * np.log2(np.where(size > 0, size, 1.0))))
            if axis == 0:
                factor = np.minimum(factor, 1.0)
                columns *= factor[0]
            scaled *= factor
    return scaled, columns


def _kernel(J: Floats) -> Floats:
    """Orthonormal basis of the kernel."""
    balanced, scale = _balanced(J)
    _, sigma, Vt = np.linalg.svd(balanced)
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma[0]))
    basis = scale[:, None] * Vt[rank:].T
    return np.asarray(np.linalg.qr(basis)[0])


def _directions(equation: ScaledEquation, codes: Codes, x: Floats) -> Iterator[Floats]:
    """Unit vectors, up to sign, along which the selection's solution set leaves x (none when it is a surface)."""
    rows = equation.selection(codes)
    J = equation.jacobian(rows, x)
    kernel = _kernel(J)
    if kernel.shape[1] == 1:
        yield kernel[:, 0] / equation.norm(kernel[:, 0])
    elif kernel.shape[1] == 2:
        left = np.linalg.svd(J)[0][:, -1]
        form = _second_derivative(equation, rows, x, left, kernel)
        for weights in _isotropic_lines(form):
            vector = kernel @ weights
            yield vector / equation.norm(vector)


def _second_derivative(equation: ScaledEquation, rows: Mask, x: Floats, left: Floats, kernel: Floats) -> Floats:
    """The bifurcation form left' D2H(x)[a, b] on a two-dimensional kernel, by central differences of the gradient."""
    form = np.empty((2, 2))
    for k in range(2):
        step = ORIENTATION_STEP * kernel[:, k]
        change = equation.jacobian(rows, x + step) - equation.jacobian(rows, x - step)
        form[k] = left @ change @ kernel / (2 * ORIENTATION_STEP)
    return np.asarray(0.5 * (form + form.T))


def _isotropic_lines(form: Floats) -> Iterator[Floats]:
    """Unit vectors t with t' form t = 0, up to sign; none for a definite form or a zero one."""
    values, vectors = np.linalg.eigh(form)
    if np.max(np.abs(values)) <= RATE_TOLERANCE or values[0] * values[1] > 0:
        return
    weights = np.sqrt(np.abs(values[::-1])) / sqrt(float(np.sum(np.abs(values))))
    yield np.asarray(vectors @ weights)
    if np.min(np.abs(weights)) > SAME_TANGENT:
        yield np.asarray(vectors @ (weights * np.array([1.0, -1.0])))


#: Corrections longer than this diverge: solutions have forces of size one at most, and steps are not much longer.
MAX_CORRECTION = 1e6


@dataclass(frozen=True)
class Correction:
    """Result of the corrections of one step.

    Attributes
    ----------
    x : (m + 1,) array
    count : int
        Number of corrections.
    converged : bool
    residual : float
        Norm of H at x.
    tangent : (m + 1,) array
        Unit tangent of the last selection, turned from the prediction's by less than a right angle a correction.
    """

    x: Floats
    count: int
    converged: bool
    residual: float
    tangent: Floats


def moore_penrose(equation: ScaledEquation, x: Floats, tangent: Floats, options: ContinuationOptions) -> Correction:
    """Steps 3-6 of the paper's Algorithm 5.1 from x: Newton's method across selections with a rotating tangent."""
    size = len(x) - 1
    T: Floats = tangent
    residual = np.inf
    for count in range(1, options.k_max + 2):
        rows = equation.selection_at(x)
        J = equation.jacobian(rows, x)
        bordered = np.vstack([J, equation.metric @ T])
        right = np.zeros((size + 1, 2))
        right[:size, 0] = J @ T
        right[:size, 1] = equation.selection_residual(rows, x)
        if not (np.all(np.isfinite(bordered)) and np.all(np.isfinite(right))):
            break
        try:
            steps: Floats = np.asarray(np.linalg.solve(bordered, right), dtype=np.float64)
        except np.linalg.LinAlgError:
            break  # a selection whose gradient does not fit the tangent: a shorter step is tried
        if not np.max(np.abs(steps)) <= MAX_CORRECTION:
            break
        turned: Floats = np.asarray(T - steps[:, 0], dtype=np.float64)
        length = equation.norm(turned)
        x = x - steps[:, 1]
        if length == 0:
            break
        T = turned / length
        residual = float(np.linalg.norm(equation.residual(x)))
        if residual < options.eps and equation.norm(steps[:, 1]) < options.eps_prime:
            return Correction(x, count, True, residual, T)
    return Correction(x, count, False, residual, T)


def smooth_newton(
    equation: ScaledEquation, codes: Codes, x: Floats, row: Floats | tuple[int, int], value: float, tolerance: float
) -> Floats | None:
    """Point of a selection's solution curve at which one more condition holds, by Newton's method from x.

    Parameters
    ----------
    codes : statuses that name the selection
    row : (m + 1,) array, or (node, k)
        The condition: ``row @ x = value``, or a slack of `ScaledEquation.slacks` that shall be ``value``.
    tolerance : float
        Length of the last correction.

    Returns
    -------
    (m + 1,) array, or None when it does not converge
    """
    rows = equation.selection(codes)
    last = np.inf
    # quadratic convergence needs about five
    for _ in range(20):
        if isinstance(row, tuple):
            gradient = equation.slack_gradients(codes, x)[row]
            defect = equation.slacks(codes, x)[row] - value
        else:
            gradient, defect = row, row @ x - value
        matrix = np.vstack([equation.jacobian(rows, x), gradient])
        right = np.append(equation.selection_residual(rows, x), defect)
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right))):
            return None
        # of least length where a vertical segment ends in a bifurcation point
        step = solved(matrix, right)
        if not np.max(np.abs(step)) <= MAX_CORRECTION:
            return None
        x = x - step
        length = equation.norm(step)
        # corrections this short that no longer get shorter have reached rounding
        if length <= tolerance or 0.5 * last < length <= 1e-8:
            return x
        last = length
    return None


#: Conditions within this of zero hold with equality at a located transition point.
ACTIVE_TOLERANCE = 1e-8
#: Lengths along the path that should be positive may be negative by this much: a condition accepted at -ROUNDING lies
#: behind its zero by that over its rate, which may be small.
FORWARD_TOLERANCE = 1e-7


@dataclass(frozen=True)
class TangentPoint:
    """A point of a selection's solution curve with the curve's tangent in the direction of travel."""

    x: Floats
    codes: Codes
    tangent: Floats


@dataclass(frozen=True)
class Kink:
    """A transition point: where a curve ends, and the curve on which the path goes on.

    Attributes
    ----------
    before, after : TangentPoint
        The same point on the two curves.
    alternatives : tuple of Tangent
        All other directions, apart from the one of arrival, in which solutions leave the point.
    """

    before: TangentPoint
    after: TangentPoint
    alternatives: tuple[Tangent, ...] = ()


def same_curve(equation: ScaledEquation, start: TangentPoint, end: TangentPoint, *, sharp: bool = False) -> bool:
    """True if ``end`` lies ahead of ``start`` on one smooth piece of a selection's curve, all of it admissible.

    The piece is judged by both tangents and by the cubic Hermite interpolants of all conditions: one that dips below
    zero in between shows that the curve was left and entered again. ``sharp`` allows turns up to a right angle.
    """
    chord = end.x - start.x
    length = equation.norm(chord)
    if equation.dot(chord, start.tangent) < -FORWARD_TOLERANCE or equation.dot(chord, end.tangent) < -FORWARD_TOLERANCE:
        return False
    if length <= FORWARD_TOLERANCE:
        return True
    # 60 degrees
    if equation.dot(start.tangent, end.tangent) < (0.0 if sharp else 0.5):
        return False
    s0, s1 = equation.slacks(start.codes, start.x), equation.slacks(start.codes, end.x)
    finite = np.isfinite(s0)
    d0 = length * equation.slack_rates(start.codes, start.x, start.tangent)
    d1 = length * equation.slack_rates(start.codes, end.x, end.tangent)
    least = _hermite_minimum(s0[finite], s1[finite], d0[finite], d1[finite])
    if np.min(least, initial=0.0) < -ACTIVE_TOLERANCE:
        return False
    return equation.single_valued or _joined(equation, start, end, length)


def _joined(equation: ScaledEquation, start: TangentPoint, end: TangentPoint, length: float) -> bool:
    """True if the curve runs near the cubic Hermite interpolant between two of its points, in its middle."""
    chord = end.x - start.x
    middle = start.x + 0.5 * chord + length / 8 * (start.tangent - end.tangent)
    row = equation.metric @ chord / length
    x = smooth_newton(equation, start.codes, middle, row, float(row @ middle), FORWARD_TOLERANCE)
    # an end on another curve of the selection shows as a detour
    return x is not None and equation.norm(x - middle) <= 1e-2 * length + FORWARD_TOLERANCE


def turning_point(
    equation: ScaledEquation, start: TangentPoint, end: TangentPoint, tolerance: float
) -> TangentPoint | None:
    """The fold between two points of a smooth piece, at which alpha turns back; None where there is none.

    Only a selection that has several solutions at one alpha turns within itself (theory, section 8.12).
    """
    if equation.single_valued or start.tangent[-1] * end.tangent[-1] >= 0 or start.codes != end.codes:
        return None
    from scipy.optimize import brentq  # seldom needed

    chord = end.x - start.x
    row, far = equation.metric @ chord, equation.dot(chord, chord)
    sign = orientation(equation, start.codes, start.x, start.tangent)
    found: dict[float, TangentPoint] = {}

    def slope(share: float) -> float:
        x = smooth_newton(
            equation, start.codes, start.x + share * chord, row, float(row @ start.x) + share * far, tolerance
        )
        tangent = None if x is None else curve_tangent(equation, start.codes, x, sign)
        if x is None or tangent is None:
            raise ValueError("no point of the curve")
        found[share] = TangentPoint(x, start.codes, tangent)
        return float(tangent[-1])

    try:
        share = float(brentq(slope, 0.0, 1.0, xtol=tolerance))
    except ValueError:
        return None
    return found.get(share)


def _hermite_minimum(s0: Floats, s1: Floats, d0: Floats, d1: Floats) -> Floats:
    """Minima over [0, 1] of the cubics with these end values and derivatives."""
    a, b = 2 * (s0 - s1) + d0 + d1, 3 * (s1 - s0) - 2 * d0 - d1
    least = np.minimum(s0, s1)
    # zeros of 3 a t^2 + 2 b t + d0, in the form that does not cancel
    root = np.sqrt(np.maximum(b * b - 3 * a * d0, 0.0))
    q = -(b + np.copysign(root, b))
    with np.errstate(divide="ignore", invalid="ignore"):
        candidates = (q / (3 * a), d0 / q)
    for t in candidates:
        inside = np.where(np.isfinite(t), np.clip(t, 0.0, 1.0), 0.0)
        least = np.minimum(least, ((a * inside + b) * inside + d0) * inside + s0)
    return least


def locate(
    equation: ScaledEquation, start: TangentPoint, which: tuple[int, int], sign: int, tolerance: float
) -> TangentPoint | None:
    """The point ahead on the curve of ``start`` at which this slack vanishes and every other condition still holds."""
    x = smooth_newton(equation, start.codes, start.x, which, 0.0, tolerance)
    if x is None or np.min(equation.slacks(start.codes, x)) < -ACTIVE_TOLERANCE:
        return None
    tangent = curve_tangent(equation, start.codes, x, sign)
    if tangent is None:
        # a vertical segment may end where its own tangent is not unique: it is straight
        chord = x - start.x
        length = equation.norm(chord)
        tangent = start.tangent if length <= FORWARD_TOLERANCE else chord / length
    point = TangentPoint(x, start.codes, tangent)
    return point if same_curve(equation, start, point) else None


def single_flip(equation: ScaledEquation, before: Codes, after: Codes) -> tuple[int, int] | None:
    """The slack of ``before`` that vanishes when one node changes to a neighbouring status; None for other changes."""
    changed = [i for i in range(len(before)) if before[i] != after[i]]
    if len(changed) != 1:
        return None
    i = changed[0]
    return next(((i, k) for k in range(2) if after[i] in equation.across(before[i], k)), None)


def confirm(
    equation: ScaledEquation, start: TangentPoint, end: TangentPoint, sign: int, tolerance: float
) -> Kink | None:
    """The one transition point between two points whose selections differ in one status; None if it is not between."""
    which = single_flip(equation, start.codes, end.codes)
    if which is None:
        return None
    before = locate(equation, start, which, sign, tolerance)
    if before is None or equation.flip(start.codes, before.x, which) != end.codes:
        return None
    tangent = curve_tangent(equation, end.codes, before.x, sign)
    if tangent is None or np.min(equation.slacks(end.codes, before.x)) < -ACTIVE_TOLERANCE:
        return None
    after = TangentPoint(before.x, end.codes, tangent)
    return Kink(before, after) if same_curve(equation, after, end) else None


def _vanishing(
    equation: ScaledEquation, point: TangentPoint, size: Callable[[Floats], Floats]
) -> Iterator[tuple[int, int]]:
    """Slacks that fall along the tangent, in the order of the distances ``size`` of the slack by its rate."""
    slacks = equation.slacks(point.codes, point.x)
    rates = equation.slack_rates(point.codes, point.x, point.tangent)
    distances = np.full(slacks.shape, np.inf)
    falling = rates < -RATE_TOLERANCE
    distances[falling] = size(slacks[falling]) / -rates[falling]
    for flat in np.argsort(distances, axis=None, kind="stable")[: int(np.sum(falling))]:
        i, k = np.unravel_index(flat, slacks.shape)
        yield int(i), int(k)


def next_kink(equation: ScaledEquation, start: TangentPoint, sign: int, tolerance: float) -> TangentPoint | None:
    """The nearest point ahead at which the curve of ``start`` stops being admissible; near zeros are tried first."""
    for which in _vanishing(equation, start, lambda slacks: np.maximum(slacks, 0.0)):
        point = locate(equation, start, which, sign, tolerance)
        if point is not None:
            return point
    return None


def passed_kink(
    equation: ScaledEquation, start: TangentPoint, sign: int, tolerance: float, reach: float
) -> TangentPoint | None:
    """The nearest transition point of the curve of ``start`` within ``reach``, be it ahead or just behind.

    Corrections that stop at eps may end a little beyond a fold, where H is small and no solution is.
    """
    for which in _vanishing(equation, start, np.abs):
        x = smooth_newton(equation, start.codes, start.x, which, 0.0, tolerance)
        if x is None or equation.norm(x - start.x) > reach:
            continue
        if np.min(equation.slacks(start.codes, x)) >= -ACTIVE_TOLERANCE:
            tangent = curve_tangent(equation, start.codes, x, sign)
            return TangentPoint(x, start.codes, start.tangent if tangent is None else tangent)
    return None


def continuations(equation: ScaledEquation, arrival: TangentPoint, sign: int) -> tuple[list[Tangent], list[Tangent]]:
    """Directions that leave a transition point: those that keep the orientation, and all others but the arrival's.

    The balance of degrees at a vertex (theory, (7.3)) leaves at least one of the first kind where all solutions
    near the point are curves.
    """
    tangents = admissible_tangents(equation, arrival.x, ACTIVE_TOLERANCE)
    back = -arrival.tangent
    others = [t for t in tangents if equation.norm(t.vector - back) > SAME_TANGENT]
    keep = [t for t in others if t.orientation == sign]
    keep.sort(key=lambda t: -equation.dot(t.vector, arrival.tangent))
    return keep, [t for t in others if t.orientation != sign]


def selection_distance(equation: ScaledEquation, codes: Codes, x: Floats) -> float:
    """Distance of x from the solutions of one selection at the alpha of x; infinite when it has none there.

    The solutions are x + y for all y that solve the selection's equations and keep its conditions, both affine in y.
    In the coordinates of the metric y is the least solution of the equations and a part in their kernel, at right
    angles to it; the shortest such part is a least-distance problem (Lawson and Hanson, Solving Least Squares Problems,
    chapter 23).
    """
    rows = equation.selection(codes)
    to_metric = np.linalg.inv(np.linalg.cholesky(equation.metric[:-1, :-1]).T)
    left, sizes, right = np.linalg.svd(equation.jacobian(rows, x)[:, :-1] @ to_metric)
    rank = int(np.sum(sizes > RANK_TOLERANCE * sizes[0]))
    residual = left.T @ equation.selection_residual(rows, x)
    if np.linalg.norm(residual[rank:]) > STATUS_TOLERANCE:
        return math.inf
    step = -right[:rank].T @ (residual[:rank] / sizes[:rank])
    kernel = to_metric @ right[rank:].T
    base = x + np.append(to_metric @ step, 0.0)
    slacks = equation.slacks(codes, base)
    there = np.isfinite(slacks)
    rates = equation.slack_gradients(codes, base)[there][:, :-1] @ kernel
    needed = -slacks[there] - STATUS_TOLERANCE
    return math.hypot(float(np.linalg.norm(step)), _least_norm(rates, needed))


def _least_norm(matrix: Floats, bounds: Floats) -> float:
    """Norm of the shortest z with matrix @ z >= bounds; infinite when there is none."""
    if not matrix.shape[1] or np.all(bounds <= 0):
        return 0.0 if np.all(bounds <= 0) else math.inf
    from scipy.optimize import nnls  # only sheets need it

    target = np.zeros(matrix.shape[1] + 1)
    target[-1] = 1.0
    system = np.vstack([matrix.T, bounds])
    weights, length = nnls(system, target)
    if length <= STATUS_TOLERANCE:
        return math.inf
    rest = system @ weights - target
    return float(np.linalg.norm(rest[:-1]) / -rest[-1])
