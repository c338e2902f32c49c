"""When a search in 3D turns from the energy to a form that knows where the body slides (theory, section 12.2).

Nothing here is trusted: a form is proven convex before anything is concluded from it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.relaxation.space_relaxation import SpaceEngine
from enumsol.support.deadlines import look
from enumsol.trusted.space.slip_forms import SlipForm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
    from enumsol.relaxation.space_relaxation import SpaceRelaxation
    from enumsol.search.splitting import ImposedRows
    from enumsol.selections.solution import Codes

    Array = NDArray[np.float64]

#: Nodes examined with the energy before a form is tried, and the share of the tree that is left then.
NODES, _LEFT = 256, 0.5
#: A form is used where it leaves no more than this share of the gap to the pruning bound at the root of the tree.
_SHARE = 0.25
#: Steps of the ascent, how far they go towards the slip of the minimiser, and what a step has to gain.
_STEPS, _LENGTHS, _GAIN = 8, (1.0, 0.5, 0.25, 0.12, 0.06, 0.03, 0.015), 1e-3
#: Least curvature of a form, relative to the energy.
_LEAST = 0.05
#: Directions are shorter than one by this.
_WITHIN = 1.0 - 1e-6
#: Slip below this, relative to the largest one, has no direction.
_STILL = 1e-9


class SpaceForms:
    """The form of one search.

    Parameters
    ----------
    system : SpaceSystem
    enclosed : EnclosedSpace
        Balls for the same system.
    """

    def __init__(self, system: SpaceSystem, enclosed: EnclosedSpace) -> None:
        self._system, self._enclosed = system, enclosed
        #: Relaxations with the form in use, and that form; None for the energy.
        self.engine: SpaceEngine | None = None
        self.form: SlipForm | None = None

    def due(self, nodes: int, covered: float) -> bool:
        """Whether it is time to try a form."""
        return self.tried(nodes) and covered < 1.0 - _LEFT

    def tried(self, nodes: int) -> bool:
        """Whether a search of so many nodes has tried a form."""
        return nodes >= NODES

    def use(self, engine: SpaceEngine, form: SlipForm | None) -> None:
        """Go on with a form that is known already, or with the energy."""
        if form is not None and form is self.form:
            return
        convex = form is not None and form.smallest_eigenvalue > 0
        self.form = form
        self.engine = engine.bounding(form) if form is not None and convex else None

    def pay(self, engine: SpaceEngine, codes: Codes, rows: ImposedRows) -> bool:
        """Whether a form at the root of the search is clearly tighter than the energy; if so it is in use."""
        form = self._ascended(engine, rows.over(codes, range(len(codes))))
        if form is None or not form.smallest_eigenvalue > 0:
            return False
        self.use(engine, form)
        return True

    def _ascended(self, engine: SpaceEngine, rows: tuple[list[int], list[int]]) -> SlipForm | None:
        """A form that is clearly tighter than the energy; None: there is none.

        The minimum of the relaxation is concave in the directions, and its slopes are lambda_n v at the minimiser. So
        they are turned towards v, by the length that gains most.
        """
        system = self._system
        places = system.tau[system.tau >= 0] - system.p
        plain = best = engine.root(*rows)
        if plain.stalled or plain.pruned:
            return None
        directions, found = np.zeros((system.p, 2)), None
        for _ in range(_STEPS):
            slip = system.slips(best.displacements)
            size = np.linalg.norm(slip, axis=1, keepdims=True)
            ahead = np.where(size > _STILL * np.max(size), slip / np.where(size > 0, size, 1.0) * _WITHIN, directions)
            before = best
            for length in _LENGTHS:
                look()
                trial = directions + length * (ahead - directions)
                values = np.zeros(len(places))
                values[places] = trial[system.tau >= 0]
                tried = self._bounded(engine, values, rows)
                if tried is None:
                    continue
                if tried[1].bound > best.bound:
                    (found, best), reached = tried, trial
                elif best is not before:
                    break
            if best is before or best.bound <= (1.0 - _GAIN) * before.bound:
                break
            directions = reached
        return found if best.bound > _SHARE * plain.bound else None

    def _bounded(
        self, engine: SpaceEngine, values: Array, rows: tuple[list[int], list[int]]
    ) -> tuple[SlipForm, SpaceRelaxation] | None:
        """The form of some directions, and its relaxation; None where it is not clearly convex."""
        form = SlipForm.of(self._enclosed, values)
        if factor_above(form.H - _LEAST * self._system.S) is None:
            return None
        relaxation = engine.bounding(form).root(*rows)
        return None if relaxation.stalled or relaxation.pruned else (form, relaxation)
