"""Complete selections at one alpha in balls of many digits (theory, section 6.3), where others leave them open.

What they prove has the form of ``trusted.at_alpha``, in the units of the proof.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import arb

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.arithmetic.rationals import as_objects
from enumsol.trusted.arcs.many_digits import affordable, ball_of, column, matrix, precision, sign_of, upper
from enumsol.trusted.arcs.precise import PreciseSystem
from enumsol.trusted.at_alpha import VerifiedSelection
from enumsol.trusted.selection import Selection, row_values
from enumsol.trusted.status_rows import CONDITIONS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Floats, NDArray

#: Radii in double arithmetic, relative to the numbers: beyond their rounding, since another factorization of A leads to
#: other last bits.
_RADIUS = 8 * UNIT


@dataclass(frozen=True, eq=False)
class PreciseAtAlpha:
    """The condensed problem at one alpha in balls of many digits, in scaled units: w = g - S lambda.

    Attributes
    ----------
    S : object array (2p, 2p) of arb
    g, F : object arrays of 2p and p arb
    """

    S: NDArray[Any]
    g: NDArray[Any]
    F: NDArray[Any]

    @classmethod
    def of(cls, problem: ContactProblem, alpha: Fraction, force: Floats, length: Floats) -> PreciseAtAlpha | None:
        """Condensed from the problem's own data, in units of every row given by powers of two.

        None where A is not proven positive definite or has too many entries, or where the slip offset is not the floats
        that the problem has.

        Raises
        ------
        TimeOverError
            The deadline that holds here has passed.
        """
        if problem.offset_radius is not None or not affordable(problem):
            return None
        system = PreciseSystem.of(problem)
        if system is None:
            return None
        with precision():
            a = ball_of(alpha)
            forces, lengths = (as_objects([arb(float(x)) for x in unit]) for unit in (force, length))
            S = system.rows * forces[:, None] / lengths[None, :]
            g = (as_objects(system.g0) + a * as_objects(system.g1)) / lengths
            return cls(S, g, as_objects(system.F0) + a * as_objects(system.F1))

    def solve(self, codes: Sequence[int]) -> VerifiedSelection | None:
        """The verified solution of a complete selection, or None when its matrix is not proven regular."""
        selection, rows = Selection(codes), None
        with precision():
            columns = selection.columns(self.S, self.F)
            rows = selection.unknown
            y, sign, w = np.empty(0, dtype=object), 1, self.g.copy()
            if len(rows):
                M = matrix(columns[rows].tolist())
                sign = sign_of(M.det())
                try:
                    y = as_objects(M.solve(column(self.g[rows].tolist())).entries())
                except ZeroDivisionError:
                    return None
                w = self.g - columns @ y
                w[rows] = arb(0)
            if not sign:
                return None
            force = selection.forces(y, self.F, arb(0))
            kinds, nodes = np.array([(kind, i) for i, code in enumerate(codes) for kind in CONDITIONS[code][1]]).T
            slack = row_values(force, w, self.F)[kinds, nodes]
            return VerifiedSelection(_in_floats(force), _in_floats(w), _in_floats(slack), sign)


def _in_floats(values: NDArray[Any]) -> Ball:
    """Balls in double arithmetic that hold balls of many digits; exact zeros stay so."""
    mid = np.array([float(x.mid()) for x in values])
    known = np.array([x == 0 for x in values], dtype=bool)
    away = np.array([upper(x - arb(m)) for x, m in zip(values, mid.tolist(), strict=True)])
    with np.errstate(over="ignore", invalid="ignore"):
        return Ball(mid, np.where(known, 0.0, np.maximum(away * SAFE, _RADIUS * np.abs(mid)) + TINY))
