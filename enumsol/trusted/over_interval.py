"""Data and forms of exclusions over an interval of alpha (theory, section 7.9).

With fixed multipliers the dual bound is concave in alpha: constraint normals are constant (friction enters by its
extreme values) and right-hand sides affine. Positive at both ends, it is positive in between, and a partial assignment
holds no solution anywhere in the interval.

Rows 7 and 8 of node i, beyond those of ``enumsol.trusted.status_rows``: lambda_t - F_lo lambda_n and
-lambda_t - F_lo lambda_n; rows 2 and 3 have F_hi in place of F.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball, factor_above, gamma, hull, upper_norm
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem
from enumsol.trusted.floating_bounds import without_bound
from enumsol.trusted.quadratic_forms import EnclosedForm
from enumsol.trusted.status_rows import BACKWARD, FORWARD, ROW_KINDS, STILL, UNDECIDED, row_table
from enumsol.trusted.uniqueness_forms import Multipliers

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats, Indices, NDArray


KINDS = ROW_KINDS + 2
#: Of theta along an arc.
_MOST_DEGREE = 32
#: Table of rows.row_table with kinds 7 and 8; then slip+ and slip- at a node whose friction varies.
_CONSTANT = np.hstack([row_table(), np.zeros((len(row_table()), 2), dtype=np.int8)])
_VARYING = _CONSTANT.copy()
_VARYING[2] = [1, 0, 1, 1, 2, 1, 0, 1, 0]
_VARYING[3] = [1, 0, 1, 1, 2, 0, 1, 0, 1]
# no tree over an interval has these codes
_VARYING[[FORWARD, BACKWARD]] = _VARYING[UNDECIDED]


@dataclass(frozen=True)
class EnclosedPiece:
    """The condensed problem at both ends of a piece of the interval, in common units.

    Attributes
    ----------
    ends : tuple of EnclosedSystem
        At both ends; one where g does not vary.
    low, high : (p,) arrays
        Bounds of the friction coefficients over the piece; equal exactly where friction is constant.
    forms : tuple of EnclosedForm
        What bounds at the ends are about; empty for the energy.
    """

    ends: tuple[EnclosedSystem, ...]
    low: Floats
    high: Floats
    forms: tuple[EnclosedForm, ...] = ()

    @classmethod
    def from_enclosure(
        cls,
        enclosure: CondensedEnclosure,
        a: Fraction,
        b: Fraction,
        force: Floats,
        length: Floats,
        origin: Fraction | None,
    ) -> EnclosedPiece:
        """A piece [a, b]; with ``origin`` (the alpha at one of its ends where g vanishes) for the load +-g1.

        Solutions at alpha are then alpha's distance from the origin times those of that constant load.
        """
        systems = [enclosure.at(alpha, force, length) for alpha in (a, b)]
        constant = np.array(enclosure.problem.friction_slope) == 0
        # a coefficient near the largest float has no upper bound, nor has any product with it
        with np.errstate(over="ignore"):
            low = np.min([s.F - s.F_rad * SAFE for s in systems], axis=0)
            high = np.max([s.F + s.F_rad * SAFE for s in systems], axis=0)
            low = np.where(constant, systems[0].F, np.maximum(np.nextafter(low, -np.inf), 0.0))
            high = np.where(constant, systems[0].F, np.nextafter(high, np.inf))
        if origin is not None:
            systems = [enclosure.constant_load(1.0 if b > origin else -1.0).at(a, force, length)]
        elif enclosure.problem.load_slope is None:
            systems = systems[:1]
        return cls(tuple(systems), low, high)

    def with_form(self, multipliers: Floats) -> EnclosedPiece:
        """Piece with a form for all of its alpha: with F_lo in place of F (theory, section 7.9).

        Parameters
        ----------
        multipliers : (4, p) array
            mu, nu, alpha and beta (see EnclosedForm); the last two are at least zero.
        """
        everything = (UNDECIDED,) * len(self.low)
        # exact coefficients, below those of the piece, where friction varies
        uncertain = [np.where(self.low == self.high, end.F_rad, 0.0) for end in self.ends]
        systems = [replace(end, F=self.low, F_rad=rad) for end, rad in zip(self.ends, uncertain, strict=True)]
        with np.errstate(over="ignore", invalid="ignore"):
            forms = tuple(EnclosedForm.of(system, everything, multipliers, 0.0) for system in systems)
        return replace(self, forms=forms)

    @cached_property
    def unbounded(self) -> EnclosedPiece:
        """Piece of a body that nothing holds, with a bound beyond which there is no solution in the piece."""
        first = self.ends[0]
        g, h = hull([Ball(end.g, end.g_rad) for end in self.ends]), hull([end.rows.h for end in self.ends])
        F = hull([Ball.exact(self.low), Ball.exact(self.high)])
        whole = replace(first, g=g.mid, g_rad=g.rad, F=F.mid, F_rad=F.rad, rows=replace(first.rows, h=h))
        reach = without_bound(whole).reach
        return replace(self, ends=tuple(end.reaching(reach) for end in self.ends))

    def row_signs(self, codes: Indices) -> NDArray[np.int8]:
        """Signs that multipliers may have, (m, p, 9), for (partial) status codes (m, p)."""
        code = np.where((codes == UNDECIDED) & (self.high == 0), STILL, codes)
        return np.where((self.low == self.high)[:, None], _CONSTANT[code], _VARYING[code])


def interval_row_tables() -> NDArray[np.int8]:
    """Signs that multipliers may have, shape (2, 10, 9), by code as in rows.row_table; second: friction varies."""
    return np.stack([_CONSTANT, _VARYING])


@dataclass(frozen=True, eq=False)
class PieceNumbers:
    """The numbers of the form of theory, (6.9), for all data of a piece.

    Attributes
    ----------
    mu, kappa, nu : (p,) arrays
        mu and kappa positive; kappa and nu are read at nodes with friction only.
    balance, share : float
        Of a body that nothing holds, the factor of |G d|^2, and c of theory, (14.14).
    degree : int
        Of theta along an arc, as a polynomial.
    """

    mu: Floats
    kappa: Floats
    nu: Floats
    balance: float = 0.0
    share: float = 0.0
    degree: int = 1

    @classmethod
    def of(cls, numbers: Floats, more: Floats) -> PieceNumbers:
        """Numbers from those of a record: mu, kappa and nu one after the other, then none, or balance, share, degree.

        Raises
        ------
        ValueError
            One is not allowed.
        """
        (mu, kappa, nu), (balance, share, degree) = numbers.reshape(3, -1), more.tolist() or (0.0, 0.0, 1.0)
        found = cls(mu, kappa, nu, balance, share, int(degree))
        if degree not in range(1, _MOST_DEGREE + 1):
            raise ValueError(f"the degree of theta is not among 1 to {_MOST_DEGREE}")
        finite = np.all(np.isfinite(numbers)) and np.all(np.isfinite(more))
        if not (finite and np.all(found.mu > 0) and np.all(found.kappa > 0) and balance >= 0):
            raise ValueError("a number mu or kappa is not positive, or the factor of the balance negative")
        return found

    def serve(self, largest: Floats) -> bool:
        """True if ``|nu| F <= mu`` for all coefficients up to these."""
        return not np.any(np.abs(self.nu) * largest * SAFE + TINY > self.mu)

    def multipliers(self, theta: Ball) -> Multipliers:
        """D of (6.9) for a theta of every node."""
        p = len(self.mu)
        places, unit = p + np.arange(p)[:, None], np.ones((p, 1))
        return Multipliers(places, self.mu, self.kappa, theta[:, None], Ball.exact(self.nu[:, None]), unit)


def definite(form: Ball, margin: float) -> bool:
    """True if the symmetric parts of all matrices in a ball are positive definite.

    ``margin``: their smallest eigenvalue has to be larger than this, relative to the largest entry of the diagonal.
    """
    form = form.symmetric
    if not form.finite:
        return False
    mid = form.mid
    k, largest = gamma(len(mid) + 2), float(np.max(np.abs(np.diagonal(mid)), initial=0.0))
    # a Cholesky factorization that runs to its end proves M >= -gamma trace (Rump 2006)
    slack = k / (1 - k) * float(np.trace(np.abs(mid))) + float(upper_norm(form.rad)) + margin * largest
    shift = (slack + 8 * UNIT * largest) * (1.0 + 8 * UNIT) * SAFE + TINY
    return factor_above(mid, shift) is not None
