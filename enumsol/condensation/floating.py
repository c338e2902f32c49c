"""The condensed problem of a body that nothing holds (theory, section 14): that of the body held by springs, and more.

With q the coordinates of the rigid displacement N q, G = (B N)' and h = N'f(alpha),

    w = g - S lambda + G'q,    G lambda = h

where S and g are those of the body held by springs. With mu = -q the two are one system, S and g bordered by G and h.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, Self

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import SAFE, TINY, Ball, gamma, upper_norm
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem, NotEnclosedError, float_at
from enumsol.support.array_types import Floats


@dataclass(frozen=True)
class RigidRows:
    """The rows of equilibrium of the body as a whole, G lambda = h, in units given by powers of two.

    Attributes
    ----------
    G : Ball (r, 2p)
    h, slope : Ball (r,)
        At one alpha, and by how much h grows with alpha.
    unit : (r,) array
        Units of the coordinates q of the rigid displacement.
    reach : (r,) array
        How large these can be, in these units.
    """

    G: Ball
    h: Ball
    slope: Ball
    unit: Floats
    reach: Floats

    @classmethod
    def of(cls, problem: Any, alpha: Fraction, force: Floats, length: Floats) -> RigidRows:
        """Rows of a problem at one alpha, enclosed; errors as ``along``."""
        rows, slope = cls.along(problem, force, length)
        if slope is None:
            return rows
        value, slack = float_at(alpha)
        with np.errstate(over="ignore", invalid="ignore"):
            h = rows.h + Ball(np.array(value), np.array(slack)) * slope
        if not h.finite:
            raise NotEnclosedError(_OVERFLOW)
        return replace(rows, h=h)

    @classmethod
    def along(cls, problem: Any, force: Floats, length: Floats) -> tuple[RigidRows, Ball | None]:
        """Rows of a problem at alpha = 0, enclosed, and by how much h grows with alpha; None where it does not.

        Raises
        ------
        NotEnclosedError
            Something overflows.
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            G = moved_by_modes(problem).T
            # the rows of G near one
            size = np.max(np.abs(G.mid) / length, axis=1)
            unit = np.exp2(-np.round(np.log2(np.where(size > 0, size, 1.0))))
            pair = unit[:, None] / length
            rows = Ball(G.mid * pair, np.where(G.rad > 0, G.rad * pair + TINY, 0.0))
            work = float(force[0] * length[0])
            given = [part for part in (problem.f, problem.load_slope) if part is not None]
            loads = [_in_units(_product(problem.modes.N.T, part[:, None])[:, 0], unit / work) for part in given]
            most = problem.modes.reach(problem.rigid_reach)
            reach = most / unit
        finite = rows.finite and all(load.finite for load in loads) and np.all(np.isfinite(reach))
        if not (finite and np.all(reach * unit == most)):
            raise NotEnclosedError(_OVERFLOW)
        slope = loads[1] if len(loads) > 1 else Ball.exact(np.zeros(len(unit)))
        return cls(rows, loads[0], slope, unit, reach), loads[1] if len(loads) > 1 else None


def enclosed_over_alpha(problem: Any) -> CondensedEnclosure:
    """Balls of a problem for all alpha: of a body that nothing holds those of the body on springs, with its own data.

    Raises
    ------
    NotEnclosedError
        See CondensedEnclosure.
    """
    enclosure: CondensedEnclosure = problem.on_springs.enclosure
    return replace(enclosure, problem=problem)


def moved_by_modes(problem: Any) -> Ball:
    """B N, by what each rigid mode moves the contact nodes, (2p, r) or (3p, r)."""
    return _product(problem.contact_rows, problem.modes.N)


_OVERFLOW = "the rows of the rigid modes overflow float64; expected data in other units"


def _in_units(value: Ball, unit: Floats) -> Ball:
    """A ball times powers of two; zeros stay exact."""
    return Ball(value.mid * unit, np.where(value.rad > 0, value.rad * unit + TINY, 0.0))


def _product(left: Any, right: Floats) -> Ball:
    """The product of two matrices, the first of which may be sparse, with the error of its sums; zeros are exact."""
    mid = np.asarray(left @ right)
    size = np.asarray(abs(left) @ np.abs(right))
    terms = int(np.max(np.diff(sp.csr_array(left).indptr))) if sp.issparse(left) else left.shape[1]
    k = gamma(terms + 2)
    return Ball(mid, np.where(size > 0, size * k * (1 + 2 * k) * SAFE + TINY, 0.0))


@dataclass(frozen=True)
class FloatingSystem(EnclosedSystem):
    """The problem of a body that nothing holds at one alpha as balls: S and g are those of the body on springs.

    Attributes
    ----------
    rows : RigidRows
    """

    rows: RigidRows = field(kw_only=True)

    @classmethod
    def on(cls, system: EnclosedSystem, rows: RigidRows) -> FloatingSystem:
        """That of a body whose problem on springs is given."""
        return cls(system.S, system.S_rad, system.g, system.g_rad, system.F, system.F_rad, rows=rows)

    @property
    def reach(self) -> Floats:
        """Bounds of the coordinates of a rigid displacement, (r,)."""
        return self.rows.reach

    @property
    def rigid_unit(self) -> Floats:
        """Units of the coordinates of a rigid displacement, (r,)."""
        return self.rows.unit

    @cached_property
    def balls(self) -> tuple[Ball, Ball, Ball]:
        """S and g, bordered by G and h, and F."""
        G, h = self.rows.G, self.rows.h
        none = Ball.exact(np.zeros((len(G.mid),) * 2))
        mid, rad = (
            np.block([[own, border.T], [border, corner]])
            for own, border, corner in ((self.S, G.mid, none.mid), (self.S_rad, G.rad, none.rad))
        )
        return Ball(mid, rad), Ball.joined(Ball(self.g, self.g_rad), h), Ball(self.F, self.F_rad)

    def reaching(self, reach: Floats) -> Self:
        """The same with other bounds of the rigid displacement."""
        return replace(self, rows=replace(self.rows, reach=reach))

    @property
    def largest_work(self) -> float:
        """A bound of h'q within the bounds."""
        h, k = self.rows.h.size, gamma(len(self.reach) + 8)
        # what no load works on may be infinite
        return float(h[h > 0] @ self.reach[h > 0]) * (1 + k) * SAFE

    @cached_property
    def largest_forces(self) -> float:
        """A bound of the norm of lambda at a solution within the bounds (theory, (14.5))."""
        load, k = self.largest_work, gamma(len(self.reach) + 8)
        mu, g = self.smallest_eigenvalue, float(upper_norm(np.abs(self.g) + self.g_rad))
        return float((g + np.sqrt(g * g + 4 * mu * load)) / (2 * mu) * (1 + k) * SAFE)

    @property
    def largest_unknowns(self) -> float:
        """A bound of the norm of (lambda, q) at a solution within the bounds."""
        return float(np.hypot(self.largest_forces, upper_norm(self.reach)) * SAFE)

    @cached_property
    def mode_inverse(self) -> Floats:
        """Approximate inverse of G S^-1 G'; no claim rests on its accuracy."""
        G = self.rows.G.mid
        return np.asarray(np.linalg.pinv(G @ self.inverse @ G.T, hermitian=True))
