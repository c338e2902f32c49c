"""When a tree over a piece of the interval turns from the energy to a tighter form (theory, section 7.8)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.model.statuses import UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.search.form_policy import ascended
from enumsol.search.splitting import ImposedRows, PlaneSplitting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.relaxation.interval_relaxation import IntervalSystem


@dataclass(frozen=True, eq=False)
class PairedTerms:
    """The form (D lambda)'(S lambda - g) with D of (5.11), that does not depend on the piece.

    D maps (lambda_n, lambda_t) of a node to (mu lambda_n + nu lambda_t, delta lambda_n + s lambda_t). The form is at
    most zero at every solution for any friction F with |delta| <= F s.

    Attributes
    ----------
    terms : (4, p) array
        mu, nu, delta and s of every node.
    """

    terms: NDArray[np.float64]

    @classmethod
    def of(cls, multipliers: NDArray[np.float64], F: NDArray[np.float64]) -> PairedTerms:
        """The form of multipliers mu, nu, alpha and beta (theory, section 5.8) with coefficients F."""
        mu, nu, alpha, beta = multipliers
        return cls(np.stack([mu, nu, F * (beta - alpha), alpha + beta]))

    def multipliers(self, F: NDArray[np.float64]) -> NDArray[np.float64]:
        """mu, nu, alpha and beta with other coefficients, which are at least as large."""
        mu, nu, delta, s = self.terms
        return np.stack([mu, nu, np.maximum(0.5 * (s - delta / F), 0.0), np.maximum(0.5 * (s + delta / F), 0.0)])


def better_form(system: IntervalSystem) -> PairedTerms | None:
    """A form that is clearly tighter than the energy over the piece; None: there is none.

    It is sought for the load at the middle and the least friction of the piece, with which it is used. Where that is
    zero at some node none is sought.
    """
    if not np.all(system.F_lo > 0):
        return None
    scaled = replace(system.scaled, g=system.g, F=system.F_lo)
    zero = np.zeros_like
    enclosed = EnclosedSystem(scaled.S, zero(scaled.S), scaled.g, zero(scaled.g), scaled.F, zero(scaled.F))
    codes = (UNDECIDED,) * scaled.p
    rows = ImposedRows(PlaneSplitting(scaled.F), scaled.p).over(codes, range(scaled.p))
    engine = ActiveSetEngine(replace(scaled, F=system.F))
    found = ascended(scaled, enclosed, engine, codes, rows)
    return None if found is None else PairedTerms.of(found.multipliers, system.F_lo)
