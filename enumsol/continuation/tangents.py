"""Tangents of solution curves: orientation, and all that are admissible at a point (theory, section 8.3)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import prod, sqrt
from typing import TYPE_CHECKING

import numpy as np

from enumsol.continuation.scaled_equation import STATUS_TOLERANCE, ScaledEquation
from enumsol.errors import TooLargeError
from enumsol.roots.local_branch import MAX_SELECTIONS
from enumsol.support.immutable import Sealed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.model.statuses import ContactStatus
    from enumsol.support.array_types import Codes, Floats, Mask

#: A singular value of a selection's balanced gradient below this fraction of the largest counts as zero.
RANK_TOLERANCE = 1e-10
#: The rate of a vanishing condition along an admissible tangent may be negative by rounding, as much as this.
RATE_TOLERANCE = 1e-8
#: Two tangents closer than this are one.
SAME_TANGENT = 1e-6
#: How far along a tangent its orientation is read where the gradient loses rank; squares of it are above rounding.
ORIENTATION_STEP = 1e-4


@dataclass(frozen=True)
class Tangent(Sealed):
    """A direction in which a solution curve leaves a point.

    Attributes
    ----------
    statuses : tuple of p ContactStatus
        Statuses on the curve.
    dalpha : float
        Derivative of alpha with respect to the arclength; 0 on a vertical segment.
    dlambda : (p, 2) array, in 3D (p, 3)
        Derivatives of (lambda_n, lambda_t) [force].
    orientation : int
        +1 positively oriented (theory, (8.2)), -1 negatively, 0 undecided.
    codes, vector :
        The same in the variables of the continuation.
    """

    statuses: tuple[ContactStatus, ...]
    dalpha: float
    dlambda: Floats
    orientation: int
    codes: Codes
    vector: Floats

    def __repr__(self) -> str:
        names = ", ".join(status.value for status in self.statuses[:8])
        names += ", ..." if len(self.statuses) > 8 else ""
        return f"Tangent(dalpha={self.dalpha:+.3g}, orientation={self.orientation:+d}, [{names}])"


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
