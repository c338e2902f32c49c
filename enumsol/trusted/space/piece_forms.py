"""The trusted test in 3D that over a piece of alpha a known curve has all solutions with some statuses.

At every alpha of the piece the curve has a solution with these statuses, and a matrix that is positive definite shows
that it is the only one (theory, sections 12.6 and 12.9).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, upper_norm
from enumsol.trusted.space.sector_rows import UNDECIDED
from enumsol.trusted.space.space_uniqueness import (
    EQUATION_WEIGHTS,
    equations,
    least_eigenvalue,
    moderate_units,
    slip_sizes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from numpy.typing import NDArray

    from enumsol.condensation.space_condensed import PieceSpace
    from enumsol.trusted.space.curve_runs import CurveParts

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class PieceWeights:
    """The numbers of the form over a piece, node by node.

    Where there is no tau, components are 0.

    Attributes
    ----------
    mu, kappa : (p,) arrays
        Positive, with |nu| <= mu over the radius of every disc.
    nu : (p, 2) array
    thetas : pair of (p, 2) arrays
        At both ends of the piece; times the radii of the discs there they are psi, which is affine between.
    """

    mu: Array
    kappa: Array
    nu: Array
    thetas: tuple[Array, Array]

    @classmethod
    def of(cls, system: PieceSpace, numbers: Array) -> PieceWeights | None:
        """From one array: mu and kappa of all nodes, then nu and both thetas of all tau, in the order of y; or None."""
        p, m = len(system.tau), len(system.g)
        if numbers.shape != (2 * p + 3 * (m - p),) or not np.all(np.isfinite(numbers)):
            return None
        (mu, kappa), vectors = numbers[: 2 * p].reshape(2, p), numbers[2 * p :].reshape(3, m - p)
        place = np.where(system.tau >= 0, system.tau - p, m - p)
        nu, low, high = (np.append(vector, 0.0)[place] for vector in vectors)
        with np.errstate(over="ignore", invalid="ignore"):
            right = (mu > 0) & (kappa > 0) & (upper_norm(nu, axis=1) * system.largest_discs * SAFE <= mu)
        return cls(mu, kappa, nu, (low, high)) if np.all(right) else None


def only_on_curve(
    system: PieceSpace,
    piece: tuple[Fraction, Fraction],
    codes: Sequence[int],
    numbers: Array,
    parts: CurveParts,
    errors: float = 1.0,
) -> bool:
    """True if all solutions over a piece with the statuses of an assignment are those of a curve.

    Parameters
    ----------
    system : PieceSpace
        Over the piece.
    piece : its ends
    codes : (partial) status codes; a sector counts as contact
    numbers : see ``PieceWeights.of``
    parts : of a curve that has a solution at every alpha of the piece
    errors : what is not known of theta counts as often: 1 proves, a writer of proofs takes more
    """
    weights = PieceWeights.of(system, numbers)
    if weights is None or not len(parts.alpha.mid) or not parts.allowed(codes):
        return False
    if not float(piece[1] - piece[0]) > TINY:
        return False
    if not moderate_units(system.unit):
        return False
    with np.errstate(all="ignore"):
        unit = np.where(system.tau >= 0, system.unit[system.tau], 1.0)
        # psi at both ends of the piece
        psi = [_times(theta, discs) for theta, discs in zip(weights.thetas, system.end_discs, strict=True)]
        off = how_far_off(system, piece, weights, psi, parts) * (errors * SAFE)
        lost = np.where(off > 0, weights.kappa * off * slip_sizes(system) + TINY, 0.0)
        if not np.all(np.isfinite(lost)):
            return False
        turns = [Ball(end.mid / unit, end.rad / unit * SAFE + TINY * (system.tau >= 0)) for end in psi]
        factors, push, rest = (weights.mu, weights.kappa), weights.nu * unit, (off, lost)
        assigned = any(code != UNDECIDED for code in codes)
        held = [equations(system, codes, weight) for weight in EQUATION_WEIGHTS] if assigned else [None]
        # between the ends the form is between those of both
        return any(
            all(least_eigenvalue(system, factors, turn, push, rest, rows) > 0 for turn in turns) for rows in held
        )


def _times(theta: Array, discs: Ball) -> Ball:
    return Ball.exact(theta) * Ball(discs.mid[:, None], discs.rad[:, None])


def _shares(piece: tuple[Fraction, Fraction], alpha: Ball) -> Ball:
    """Places of alphas in a piece, from -1 to 1."""
    middle, half = (piece[0] + piece[1]) / 2, (piece[1] - piece[0]) / 2
    near, inverse = float(middle), 1.0 / float(half)
    # rounded to nearest
    factor = Ball(np.array(inverse), np.array(4 * UNIT * inverse))
    share = (alpha - Ball(np.array(near), np.array(UNIT * abs(near) + TINY))) * factor
    low, high = np.maximum(share.mid - share.rad * SAFE, -1.0), np.minimum(share.mid + share.rad * SAFE, 1.0)
    return Ball(0.5 * (low + high), (0.5 * np.maximum(high - low, 0.0) + 4 * UNIT) * SAFE)


def how_far_off(
    system: PieceSpace, piece: tuple[Fraction, Fraction], weights: PieceWeights, psi: Sequence[Ball], parts: CurveParts
) -> Array:
    """Bound of the distance of psi from r theta with a theta that serves the curve's solution, (p,), at all alphas.

    Where nothing better is known |theta| <= 1.
    """
    rubs, shares = np.any(system.tau >= 0, axis=1), _shares(piece, parts.alpha)
    half = Ball.exact(np.array(0.5))
    middle, change = (psi[0] + psi[1]) * half, (psi[1] - psi[0]) * half
    at = Ball(middle.mid[None], middle.rad[None]) + shares[:, None, None] * change
    reference = system.references
    inverse = 1.0 / reference
    r = parts.F * Ball(inverse, np.where(rubs, 2 * UNIT * inverse, 0.0))
    theta, far = parts.thetas
    apart = upper_norm((Ball.exact(theta) * r[:, :, None] - at).size, axis=2) + r.size * far
    unknown = upper_norm(at.size, axis=2) + r.size
    off = np.minimum(np.where(np.isfinite(apart), apart, np.inf), unknown) * SAFE * SAFE
    off = np.where(_gap_serves(weights, reference, at, r, parts), 0.0, off)
    return np.where(rubs, np.max(off, axis=0), 0.0)


def _gap_serves(weights: PieceWeights, reference: Array, psi: Ball, r: Ball, parts: CurveParts) -> Flags:
    """Mask of nodes whose gap lets psi itself serve, (N, p): (mu - r |nu|) |w_n| >= kappa (r |v| - psi . v)."""
    inside = np.all([upper_norm(theta, axis=1) <= 1.0 for theta in weights.thetas], axis=0)
    normal, slip = parts.slips
    gap = np.where(parts.open, -(normal.mid + normal.rad * SAFE), 0.0) / SAFE
    length = upper_norm(slip.size, axis=2)
    along = psi * slip
    ahead = along[:, :, 0] + along[:, :, 1]
    needed = r.size * length * SAFE - (ahead.mid - ahead.rad * SAFE) + 16 * UNIT * (r.size * length + ahead.size)
    room = weights.mu - upper_norm(weights.nu, axis=1) * r.size * SAFE - 4 * UNIT * weights.mu
    needed = weights.kappa * reference * needed * SAFE * SAFE + TINY
    return np.asarray(inside & (gap > 0) & (room > 0) & (room * gap / SAFE >= needed))
