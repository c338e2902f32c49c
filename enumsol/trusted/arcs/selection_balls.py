"""Selections over alpha in balls: their equations and conditions as affine forms (theory, section 7.14)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic

import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, Ball, hull, solution
from enumsol.condensation.enclosure import LEAST_PAIR, CondensedEnclosure, EnclosedSystem, NotEnclosedError, RigidRows
from enumsol.trusted.floating_bounds import is_unbalanced, motion_against
from enumsol.trusted.selection import Numbers, Selection, joined, signed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Floats


@dataclass(frozen=True, eq=False)
class ArcSystem(Generic[Numbers]):
    """The condensed problem over alpha in balls: w = g0 + alpha g1 - S lambda.

    Balls are those of double arithmetic, in units given by powers of two, or arrays of arb with many digits, in the
    problem's units. Of a body that nothing holds, S is bordered by the rows G and the columns -G', and g by h, so that
    q follow the forces in lambda (theory, section 14.8).

    Attributes
    ----------
    S : Ball or object array (2p + r, 2p + r)
    g0, g1 : Ball or object array (2p + r,)
    F0, F1 : (p,) arrays of floats, F = F0 + alpha F1
    reach : (r,) array of floats
        Bounds of q; none of a body that is held.
    """

    S: Numbers
    g0: Numbers
    g1: Numbers
    F0: Floats
    F1: Floats
    reach: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(
        cls, problem: ContactProblem, enclosure: CondensedEnclosure, force: Floats, length: Floats
    ) -> ArcSystem[Ball]:
        """A problem, and what encloses it, or the body on springs if nothing holds it, in double arithmetic."""
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows proves nothing
            pair = force[:, None] / length[None, :]
            if not np.all(pair >= LEAST_PAIR):
                raise NotEnclosedError("the units of the arcs underflow float64; expected data in other units")
            F0, F1 = (np.asarray(part, dtype=np.float64) for part in enclosure.problem.affine_friction)
            g0 = Ball(enclosure.g0 / length, enclosure.g0_rad / length + TINY)
            g1 = Ball(enclosure.g1 / length, enclosure.g1_rad / length + TINY)
            if enclosure.problem.load_slope is None:
                g1 = Ball.exact(np.zeros_like(g1.mid))
            held = ArcSystem(Ball(enclosure.S * pair, enclosure.S_rad * pair + TINY), g0, g1, F0, F1)
            if problem.held:
                return held
            rows = RigidRows.along(problem, force, length)
            return held.bordered(rows.G, rows.h, rows.slope, rows.reach)

    def bordered(self, G: Numbers, h: Numbers, slope: Numbers, reach: Floats) -> ArcSystem[Numbers]:
        """System with the rows of the body as a whole, G lambda = h + alpha slope."""
        corner = self.exact(np.zeros((len(reach),) * 2))
        S = joined(joined(self.S.T, signed(G, -1)).T, joined(G.T, corner).T)
        return replace(self, S=S, g0=joined(self.g0, h), g1=joined(self.g1, slope), reach=reach)

    def beside_zero(self, side: float) -> ArcSystem[Numbers]:
        """System for the constant load +-g1, for a side of 1 or -1 (see trusted.over_interval), or for 0 itself."""
        none = self.exact(np.zeros(self.g1.shape))
        return replace(self, g0=signed(self.g1, side), g1=none) if side else self

    def exact(self, values: Floats) -> Any:
        """Floats as numbers of this arithmetic."""
        if isinstance(self.S, Ball):
            return Ball.exact(values)
        return np.frompyfunc(type(self.S[0, 0]), 1, 1)(values)

    def equations(self, rows: Selection) -> list[tuple[Numbers, Numbers, Numbers, Numbers]]:
        """M and g_R, C and c of a selection (see Selection.inequalities): at alpha = 0, and by how much they grow."""
        found, reach = [], self.exact(self.reach)
        zero: Any = 0.0 if isinstance(self.S, Ball) else type(self.S[0, 0])(0)
        for g, friction, unit in ((self.g0, self.F0, 1), (self.g1, self.F1, 0)):
            F = self.exact(friction)
            W = rows.columns(self.S, F, unit)
            C, c = rows.inequalities(W, g, F, zero, unit, reach)
            found.append((W[rows.unknown], g[rows.unknown], C, c))
        return found

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F0)

    @property
    def contact(self: ArcSystem[Ball]) -> Ball:
        """Compliance of the contact nodes, without the rows of the body as a whole, (2p, 2p)."""
        inner = slice(2 * self.p)
        return self.S[inner, inner]

    @property
    def rigid(self: ArcSystem[Ball]) -> Ball:
        """Rows of the body as a whole, (r, 2p)."""
        return self.S[2 * self.p :, : 2 * self.p]

    def at(self: ArcSystem[Ball], *alphas: float) -> EnclosedSystem:
        """The system at one alpha, or in balls that hold all between two, of a body that nothing holds."""
        F = hull([_affine(Ball.exact(self.F0), Ball.exact(self.F1), alpha) for alpha in alphas])
        g, S = hull([_affine(self.g0, self.g1, alpha) for alpha in alphas]), self.contact
        zero, one, contact = np.zeros(len(self.reach)), np.ones(len(self.reach)), slice(2 * self.p)
        rows = RigidRows(self.rigid, g[2 * self.p :], Ball.exact(zero), one, self.reach)
        return EnclosedSystem(S.mid, S.rad, g.mid[contact], g.rad[contact], F.mid, F.rad, rows=rows)

    def unbalanced(
        self: ArcSystem[Ball], codes: Sequence[int], low: float, high: float, z: Floats | None = None
    ) -> bool:
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
        In double arithmetic.
    codes : p status codes, complete

    Attributes
    ----------
    system : ArcSystem
    rows : Selection
    affine : bool
        M is constant.
    """

    def __init__(self, system: ArcSystem[Ball], codes: Sequence[int]) -> None:
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
        constant, slope = (
            Ball.joined(Ball.beside(M, -b[:, None]), Ball.beside(C, c[:, None]))
            for M, b, C, c in self.system.equations(self.rows)
        )
        return constant.mid, slope.mid, constant.rad, slope.rad

    def forget(self) -> None:
        """Let go of the forms, which are made again where they are asked for."""
        self.__dict__.pop("forms", None)


def _affine(constant: Ball, slope: Ball, alpha: float) -> Ball:
    return constant + Ball.exact(np.full(1, alpha)) * slope
