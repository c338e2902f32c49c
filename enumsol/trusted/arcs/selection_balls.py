"""Selections over alpha in balls: their equations and conditions as affine forms (theory, section 7.14)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball, hull, solution
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem, NotEnclosedError, RigidRows
from enumsol.trusted.floating_bounds import is_unbalanced, motion_against
from enumsol.trusted.selection import Selection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Floats


@dataclass(frozen=True)
class ArcSystem:
    """The condensed problem over alpha as balls, in units given by powers of two: w = g0 + alpha g1 - S lambda.

    Of a body that nothing holds, S is bordered by the rows G and the columns -G', and g by h, so that q follow the
    forces in lambda (theory, section 14.8).

    Attributes
    ----------
    S : Ball of shape (2p + r, 2p + r)
    g0, g1 : Ball of shape (2p + r,)
    F0, F1 : (p,) arrays, F = F0 + alpha F1
    reach : (r,) array
        Bounds of q; none of a body that is held.
    """

    S: Ball
    g0: Ball
    g1: Ball
    F0: Floats
    F1: Floats
    reach: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(
        cls, problem: ContactProblem, enclosure: CondensedEnclosure, force: Floats, length: Floats, side: float = 0.0
    ) -> ArcSystem:
        """A problem, and what encloses it, or the body on springs if nothing holds it.

        With ``side`` 1 or -1 for the constant load +-g1 (see trusted.over_interval).
        """
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows proves nothing
            return cls._of(enclosure, force, length, side)._bordered(RigidRows.along(problem, force, length))

    def _bordered(self, rows: RigidRows) -> ArcSystem:
        """System with the rows of the body as a whole."""
        G = rows.G
        corner = Ball.exact(np.zeros((len(G.mid),) * 2))
        border = Ball(-G.mid.T, G.rad.T)
        S = Ball.joined(Ball.beside(self.S, border), Ball.beside(G, corner))
        g0, g1 = Ball.joined(self.g0, rows.h), Ball.joined(self.g1, rows.slope)
        return ArcSystem(S, g0, g1, self.F0, self.F1, rows.reach)

    @classmethod
    def _of(cls, enclosure: CondensedEnclosure, force: Floats, length: Floats, side: float) -> ArcSystem:
        pair = force[:, None] / length[None, :]
        # smallest quotient of units, far above underflow
        if not np.all(pair >= 2.0**-1000):
            raise NotEnclosedError("the units of the arcs underflow float64; expected data in other units")
        F0, F1 = (np.asarray(part, dtype=np.float64) for part in enclosure.problem.affine_friction)

        def in_units(value: Floats, radius: Floats) -> Ball:
            return Ball(value / length, radius / length + TINY)

        g0, g1 = in_units(enclosure.g0, enclosure.g0_rad), in_units(enclosure.g1, enclosure.g1_rad)
        if side:
            g0, g1 = Ball(side * g1.mid, g1.rad), Ball.exact(np.zeros_like(g1.mid))
        elif enclosure.problem.load_slope is None:
            g1 = Ball.exact(np.zeros_like(g1.mid))
        return cls(Ball(enclosure.S * pair, enclosure.S_rad * pair + TINY), g0, g1, F0, F1)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F0)

    @property
    def contact(self) -> Ball:
        """Compliance of the contact nodes, without the rows of the body as a whole, (2p, 2p)."""
        inner = slice(2 * self.p)
        return self.S[inner, inner]

    @property
    def rigid(self) -> Ball:
        """Rows of the body as a whole, (r, 2p)."""
        return self.S[2 * self.p :, : 2 * self.p]

    def at(self, *alphas: float) -> EnclosedSystem:
        """The system at one alpha, or in balls that hold all between two, of a body that nothing holds."""
        F = hull([_affine(Ball.exact(self.F0), Ball.exact(self.F1), alpha) for alpha in alphas])
        g, S = hull([_affine(self.g0, self.g1, alpha) for alpha in alphas]), self.contact
        zero, one, contact = np.zeros(len(self.reach)), np.ones(len(self.reach)), slice(2 * self.p)
        rows = RigidRows(self.rigid, g[2 * self.p :], Ball.exact(zero), one, self.reach)
        return EnclosedSystem(S.mid, S.rad, g.mid[contact], g.rad[contact], F.mid, F.rad, rows=rows)

    def unbalanced(self, codes: Sequence[int], low: float, high: float, z: Floats | None = None) -> bool:
        """True if no forces below an assignment are in balance with the load anywhere between two alphas.

        By one motion z for all of them (theory, (14.7)), of a body that nothing holds; by default one is sought.
        """
        if not len(self.reach):
            return False
        ends = [self.at(alpha) for alpha in (low, high)]
        z = motion_against(ends[0], codes, ends[1]) if z is None else z
        return all(is_unbalanced(end, codes, z) for end in ends)


class ArcSelection:
    """A selection as a function of alpha, in balls of double arithmetic.

    Parameters
    ----------
    system : ArcSystem
    codes : p status codes, complete

    Attributes
    ----------
    system : ArcSystem
    rows : Selection
    affine : bool
        M is constant.
    """

    def __init__(self, system: ArcSystem, codes: Sequence[int]) -> None:
        self.system = system
        self.rows = Selection(codes, len(system.reach))
        self.affine = not np.any(system.F1[self.rows.slip])

    def at(self, alpha: float) -> tuple[Ball, Ball, Ball] | None:
        """lambda, w and the conditions at one alpha, scaled; None where the selection is not proven regular."""
        rows = self.rows.unknown
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            F = _affine(Ball.exact(self.system.F0), Ball.exact(self.system.F1), alpha)
            g = _affine(self.system.g0, self.system.g1, alpha)
            W = self.rows.columns(self.system.S, F)
            y = solution(W[rows], g[rows, None])
            if y is None:
                return None
            w = g - (W @ y)[:, 0]
            w[rows] = 0.0
            y, contact = y[:, 0], slice(2 * self.system.p)
            slacks = self.rows.slacks(y, w, F, Ball.exact(self.system.reach) if len(self.system.reach) else None)
            return self.rows.forces(y, F)[contact], w[contact], slacks

    def sign_at(self, alpha: float, condition: int) -> int:
        """Sign of a condition at an alpha at which the selection is regular; 0 where it is not proven."""
        found = self.at(alpha)
        if found is None:
            return 0
        value, radius = float(found[2].mid[condition]), SAFE * float(found[2].rad[condition])
        return int(value > radius) - int(value < -radius)

    @cached_property
    def forms(self) -> tuple[Floats, Floats, Floats, Floats]:
        """H0, H1 and their radii: H0 + alpha H1 are rows of coefficients for (y, t), [M, -g_R] and the conditions."""
        system, rows, parts = self.system, self.rows, []
        for g, F, unit in ((system.g0, system.F0, 1), (system.g1, system.F1, 0)):
            W = rows.columns(system.S, Ball.exact(F), unit)
            C, c = rows.inequalities(W, g, F, unit=unit, reach=Ball.exact(system.reach))
            M, b = W[rows.unknown], g[rows.unknown]
            parts.append(
                (
                    np.block([[M.mid, -b.mid[:, None]], [C.mid, c.mid[:, None]]]),
                    np.block([[M.rad, b.rad[:, None]], [C.rad, c.rad[:, None]]]),
                )
            )
        (constant, constant_rad), (slope, slope_rad) = parts
        return constant, slope, constant_rad, slope_rad

    def forget(self) -> None:
        """Let go of the forms, which are made again where they are asked for."""
        self.__dict__.pop("forms", None)


def _affine(constant: Ball, slope: Ball, alpha: float) -> Ball:
    return constant + Ball.exact(np.full(1, alpha)) * slope
