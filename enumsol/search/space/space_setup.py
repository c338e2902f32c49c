"""One problem in 3D at one alpha in one arithmetic: what a search needs (theory, section 12)."""

from __future__ import annotations

import copy
from dataclasses import replace
from fractions import Fraction
from functools import cached_property, partial
from typing import TYPE_CHECKING, cast

import numpy as np

from enumsol.condensation.enclosure import NotEnclosedError, enclosure_of
from enumsol.condensation.space_condensed import EnclosedSpace, SpaceSystem
from enumsol.model.statuses import UNDECIDED
from enumsol.proof.records import Limits, Tree
from enumsol.proof.writer import Recorder
from enumsol.relaxation.convex_forms import SlipFormAscent
from enumsol.relaxation.space_relaxation import SpaceEngine
from enumsol.search.certifiers.protocol import Certifier, Unrecorded
from enumsol.search.nodes import Forms, TreeCloser
from enumsol.search.setup import WEAK, SearchSetup, weakly_held
from enumsol.search.space.space_fathoming import SpaceCloser, SpaceClosing, solved
from enumsol.search.space.space_search import SpaceCertifier, SpaceExclusions, SpaceSplitting

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import Alpha, Codes, Floats
    from enumsol.trusted.space.sector_margins import SlipForm

#: A form is used where it leaves no more than this share of the gap to the pruning bound at the root of the tree.
_SHARE = 0.25
#: Nodes examined with the energy before a form that knows where the body slides is tried (theory, section 12.2).
NODES = 256


class SpaceSolvers(SearchSetup):
    """System, balls, engine and certifier for one problem in 3D at one alpha.

    Parameters
    ----------
    problem : ContactProblem3D
    alpha : float or Fraction
    arithmetic : {"fast", "verified"}

    Raises
    ------
    InvalidArgumentError, InvalidProblemError
        Of ``problem.friction_at`` and of the condensation.
    """

    _offered, _kind = '"verified"', {"kind": "space"}

    def __init__(self, problem: ContactProblem3D, alpha: Alpha, arithmetic: str) -> None:
        super().__init__(problem, alpha, arithmetic)
        friction = problem.friction_at(alpha)  # refuses what cannot be enumerated before anything is computed
        condensed = problem.on_springs.condensed
        self.system = self.scaled = SpaceSystem.scaled(condensed.S, condensed.free_displacements(alpha), friction)

    @cached_property
    def _engine(self) -> SpaceEngine:
        """Its rows are numbered in the order in which certifier, splitting and relaxations ask for them."""
        return SpaceEngine(self.relaxed)

    @cached_property
    def _enclosed(self) -> tuple[EnclosedSpace, str | None]:
        floats = EnclosedSpace.of_floats(self.system)
        if self.arithmetic == "fast":
            return floats, None
        try:
            enclosed = self._in_balls(Fraction(self.alpha), self.system.force, self.system.length)
            _ = enclosed.smallest_eigenvalue  # proven positive, or refused
        except NotEnclosedError as error:
            return floats, str(error)
        return enclosed, None

    def _in_balls(self, alpha: Fraction, force: Floats, length: Floats) -> EnclosedSpace:
        """The problem in balls; NotEnclosedError where that cannot be."""
        return EnclosedSpace.of_problem(enclosure_of(self.problem), alpha, force, length)

    @property
    def enclosed(self) -> EnclosedSpace:
        """Balls for the scaled system; in fast arithmetic, or where nothing can be proven, without radii."""
        return self._enclosed[0]

    @property
    def undecidable(self) -> str | None:
        """Why verified arithmetic cannot prove anything about this problem, or None."""
        return self._enclosed[1]

    @cached_property
    def relaxed(self) -> SpaceSystem:
        """System of the relaxations; a body that nothing holds is on weak springs (theory, section 14.5)."""
        return self._on_springs(WEAK)

    def _on_springs(self, stiffness: float) -> SpaceSystem:
        if self.problem.held or self.enclosed.held:
            return self.system
        S, g = weakly_held(self.system.S, self.system.g, self.enclosed.rows, stiffness)
        return replace(self.system, S=S, g=g)

    @cached_property
    def _exclusions(self) -> SpaceExclusions:
        """Proofs that assignments have no solution."""
        return SpaceExclusions(self.enclosed)

    def certifier(self, recorder: Recorder | None) -> SpaceCertifier:
        """The certifier of this arithmetic."""
        if recorder is None or self.arithmetic == "fast":
            recorder = Unrecorded()
        return SpaceCertifier(self._engine, self.enclosed, recorder, self._exclusions)

    def _solved(self, system: SpaceSystem, near: Floats | None) -> tuple[list[Codes], Floats] | None:
        with np.errstate(all="ignore"):
            found = solved(system, near)
        # a body on springs has slightly different directions
        # from sectors of three degrees on
        return None if found is None else ([found[0].leaf(7), found[0].codes], found[1])

    def _splitting(self, certifier: Certifier) -> SpaceSplitting:
        return SpaceSplitting(self._engine)

    def _closer(self, certifier: Certifier) -> TreeCloser | None:
        if not self.problem.held:
            from enumsol.search.space.space_references import space_closer  # for such bodies only

            return None if self.enclosed.held else space_closer(certifier, self._engine, lambda: self.known_root)
        return SpaceCloser(self.system, cast("SpaceClosing", certifier), regular=self.arithmetic == "fast")

    @property
    def _forms(self) -> Forms | None:
        """Forms with which a long search may bound in place of the energy."""
        return Forms(self._better, SpaceEngine.bounding, NODES)

    def _better(self, engine: SpaceEngine, codes: Codes, rows: tuple[list[int], list[int]]) -> SlipForm | None:
        """A form that is clearly tighter than the energy over a partial assignment, or None."""
        plain = engine.root(*rows)
        if plain.stalled or plain.pruned:
            return None
        found = SlipFormAscent(engine, self.enclosed, rows).ascended()
        return None if found is None or not found[1].bound > _SHARE * plain.bound else found[0]

    def remake(self) -> Callable[[], SpaceSolvers]:
        """Makes the same again, also in another process."""
        return partial(type(self), self.problem, self.alpha, self.arithmetic)

    def fresh(self) -> SpaceSolvers:
        """Solvers with an engine of their own: which rows it has already changes what it finds."""
        other = copy.copy(self)
        other.__dict__.pop("_engine", None)
        return other

    @property
    def limits(self) -> Limits:
        """Limits of the records at the root of the tree of a proof."""
        system, tree = self.system, Tree.SPACE if self.problem.held else Tree.FLOATING_SPACE
        codes, modes = (UNDECIDED,) * system.p, self.problem.modes.r
        return Limits(codes, tree, components=len(system.g), modes=modes)
