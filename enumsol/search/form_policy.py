"""When a search turns from the energy to a tighter form, at one alpha and over an interval (theory, sections 5.8, 7.8).

A form costs as much as hundreds of nodes of the tree, and does not pay everywhere. So a search begins with the energy;
one that is still far from its end after many nodes tries a form at its root, and begins again with it if that is worth
it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.model.statuses import UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.search.splitting import ImposedRows, PlaneSplitting

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation.active_set import IntervalSystem
    from enumsol.relaxation.engine import Engine
    from enumsol.support.array_types import Codes, Floats
    from enumsol.trusted.quadratic_forms import EnclosedForm, QuadraticForm

    Rows = tuple[list[int], list[int]]

#: Nodes examined with the energy before a form is tried: more than what that costs.
NODES = 1000
#: Steps of the ascent on trial, and those that follow once it pays.
TRIAL, STEPS = 4, 2
#: A form pays when it closes so much more of the gap at the root, or so many times as much.
MORE, TIMES = 0.1, 3.0


class Forms:
    """The form of one search, in 2D and 3D.

    Parameters
    ----------
    better : callable
        Gives a form that is clearly tighter than the energy over a partial assignment, or None; from an engine with the
        energy, the status codes, and numbers and modes of the rows of the assignment.
    bounding : callable
        Gives an engine with a form in place of the energy, or None; from an engine and a form that is proven convex.
    nodes : int
        Nodes examined with the energy before a form is tried.
    """

    def __init__(
        self, better: Callable[[Any, Codes, Rows], Any], bounding: Callable[[Any, Any], Engine | None], nodes: int
    ) -> None:
        self._better, self._bounding, self._nodes = better, bounding, nodes
        #: Relaxations with the form in use, and that form, an EnclosedForm or SlipForm; None for the energy.
        self.engine: Engine | None = None
        self.form: QuadraticForm | None = None

    def due(self, nodes: int, covered: float) -> bool:
        """True if it is time to try a form."""
        # a form is tried where at least half of the tree is left
        return self.tried(nodes) and covered < 0.5

    def tried(self, nodes: int) -> bool:
        """True if a search of so many nodes has tried a form."""
        return nodes >= self._nodes

    def use(self, engine: Engine, form: QuadraticForm | None) -> None:
        """Go on with a form that is known already, or with the energy."""
        if form is not None and form is self.form:
            return
        convex = form is not None and form.smallest_eigenvalue > 0
        self.form, self.engine = form, self._bounding(engine, form) if convex else None

    def pay(self, engine: Engine, codes: Codes, rows: ImposedRows) -> bool:
        """True if a form at the root of the search is clearly tighter than the energy; it is then in use."""
        form = self._better(engine, codes, rows.over(codes, range(len(codes))))
        if form is None or not form.smallest_eigenvalue > 0:
            return False
        self.use(engine, form)
        return True


def plane_forms(scaled: ScaledSystem, enclosed: EnclosedSystem) -> Forms:
    """Forms for a system in 2D and balls for it."""

    def better(engine: Engine, codes: Codes, rows: Rows) -> EnclosedForm | None:
        return ascended(scaled, enclosed, engine, codes, rows) if isinstance(engine, ActiveSetEngine) else None

    def bounding(engine: Engine, form: EnclosedForm) -> Engine | None:
        return engine.bounding(form) if isinstance(engine, ActiveSetEngine) else None

    return Forms(better, bounding, NODES)


def ascended(
    scaled: ScaledSystem, enclosed: EnclosedSystem, engine: ActiveSetEngine, codes: Codes, rows: Rows
) -> EnclosedForm | None:
    """A form that is clearly tighter than the energy over a partial assignment; None: there is none.

    Parameters
    ----------
    scaled : ScaledSystem
    enclosed : EnclosedSystem
        Balls for the same system.
    engine : ActiveSetEngine
        Relaxations with the energy.
    codes : status codes
    rows : numbers and modes of the rows of the assignment
    """
    from enumsol.relaxation.convex_forms import PlaneFormAscent

    ascent = PlaneFormAscent(scaled, enclosed, engine, codes, rows)
    plain = engine.root(*rows)
    found = ascent.improve(ascent.energy, TRIAL)
    if found is None or plain.stalled or plain.pruned:
        return None
    if not found[1].pruned:
        before, after = plain.gap_closed(codes), found[1].gap_closed(codes)
        if after < min(before + MORE, TIMES * before):
            return None
        found = ascent.improve(found[0].multipliers, STEPS) or found
    return found[0]


@dataclass(frozen=True, eq=False)
class PairedTerms:
    """The form (D lambda)'(S lambda - g) with D of (5.12), that does not depend on the piece.

    D maps (lambda_n, lambda_t) of a node to (mu lambda_n + nu lambda_t, delta lambda_n + s lambda_t). The form is at
    most zero at every solution for any friction F with |delta| <= F s.

    Attributes
    ----------
    terms : (4, p) array
        mu, nu, delta and s of every node.
    """

    terms: Floats

    @classmethod
    def of(cls, multipliers: Floats, F: Floats) -> PairedTerms:
        """The form of multipliers mu, nu, alpha and beta (theory, section 5.8) with coefficients F."""
        mu, nu, alpha, beta = multipliers
        return cls(np.stack([mu, nu, F * (beta - alpha), alpha + beta]))

    def multipliers(self, F: Floats) -> Floats:
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
    enclosed = EnclosedSystem.as_computed(scaled.S, scaled.g, scaled.F, exactly=True)
    codes = (UNDECIDED,) * scaled.p
    rows = ImposedRows(PlaneSplitting(scaled.F), scaled.p).over(codes, range(scaled.p))
    engine = ActiveSetEngine(replace(scaled, F=system.F))
    found = ascended(scaled, enclosed, engine, codes, rows)
    return None if found is None else PairedTerms.of(found.multipliers, system.F_lo)
