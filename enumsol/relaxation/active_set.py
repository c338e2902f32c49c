"""Relaxations by a dual active-set method, warm-started from the parent (compiled; see ``_active_set.pyx``)."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.statuses import UNDECIDED, RowKind
from enumsol.relaxation.engine import BRANCHING_CANDIDATES, FEASIBILITY_TOLERANCE, PRUNE_MARGIN, Relaxation
from enumsol.relaxation.imposed_rows import EQUALITY, INEQUALITY, row_terms, status_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation._active_set import BranchingRule, QPData, QPState
    from enumsol.selections.solution import Codes
    from enumsol.trusted.quadratic_forms import EnclosedForm


#: Rows that become equations when a node is open, or in contact.
_APART = (int(RowKind.NORMAL_FORCE), int(RowKind.PENETRATION))


def feasibility_tolerance(data: QPData) -> float:
    """Largest violation that the QP ignores, where its data are larger than those of a body that is held.

    On weak springs the load gives a body an energy that is as large as the springs are weak.
    """
    from enumsol.relaxation._active_set import QPState  # compiled: whoever made the data has it

    return FEASIBILITY_TOLERANCE * max(1.0, math.sqrt(-QPState(data).bound))


class CompiledEngine:
    """A quadratic program whose rows are switched on and off, and the compiled method that solves it.

    Parameters
    ----------
    data : QPData
        The program.
    rule : callable giving the BranchingRule, called once, when a node of the tree is to be branched on
    size : int
        The first unknowns, 2p of them, are lambda.
    offset : float
        What is subtracted from the program's bound to have that on the energy.
    always : rows beyond those of the statuses, inequalities that are always on
    """

    name = "active-set"

    def __init__(
        self,
        data: QPData,
        rule: Callable[[], BranchingRule],
        size: int,
        offset: float = 0.0,
        always: tuple[int, ...] = (),
    ) -> None:
        self.data, self._rule, self.size, self.offset, self.always = data, rule, size, offset, always
        #: Most changes of the active set; a program that needs more has stalled.
        self.limit = 200 + 10 * size
        self.tolerance = feasibility_tolerance(data)

    #: The form that is minimised in place of the energy, if any.
    form: EnclosedForm | None = None

    @cached_property
    def rule(self) -> BranchingRule:
        """Which contact node a partial assignment is branched on."""
        return self._rule()

    def root(self, rows: list[int], modes: list[int]) -> ActiveSetRelaxation:
        """The relaxation with the given rows on."""
        from enumsol.relaxation._active_set import QPState  # compiled: whoever made the data has it

        return ActiveSetRelaxation(
            self, QPState(self.data), [*rows, *self.always], modes + [INEQUALITY] * len(self.always), last=True
        )


class ActiveSetEngine(CompiledEngine):
    """Relaxations at one alpha.

    Parameters
    ----------
    system : ScaledSystem
    candidates : int
        Nodes whose children are bounded before one of them is branched on.
    slow : bool, optional
        Whether little is gained by each branching; by default that is found out at the root of the tree.
    form : (H, h), optional
        Shapes (2p, 2p) and (2p,): minimise lambda' H lambda - h' lambda in place of the energy, H = S and h = g. H must
        be positive definite, and the form at most zero at every solution.

    Raises
    ------
    ImportError
        The compiled solver is not available.
    """

    def __init__(
        self,
        system: ScaledSystem,
        *,
        candidates: int = BRANCHING_CANDIDATES,
        slow: bool | None = None,
        form: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    ) -> None:
        from enumsol.relaxation import _active_set  # compiled; its absence is handled by make_engine

        p = system.p
        start, index, value = row_terms(p, system.F)
        rhs = np.zeros(len(start) - 1)
        H, h = (system.S, system.g) if form is None else form
        #: All rows, as sparse combinations of lambda and w.
        self.rows = start, index, value, rhs
        data = _active_set.QPData(H, h, -system.S, system.g, *self.rows)
        cones = np.array([RowKind.CONE_PLUS, RowKind.CONE_MINUS])[:, None] * p + np.arange(p)
        modes = np.full((2, p), EQUALITY, dtype=np.int8)

        def rule() -> BranchingRule:
            chosen = self._is_slow(system.F) if slow is None else slow
            return _active_set.BranchingRule(system.F, cones, modes, candidates, chosen)

        super().__init__(data, rule, 2 * p)

    def bounding(self, scaled: ScaledSystem, form: EnclosedForm) -> CompiledEngine:
        """An engine with the same rows whose relaxations bound a form, which is convex, in place of the energy."""
        from enumsol.relaxation._active_set import QPData

        data = QPData(form.H, form.h, -scaled.S, scaled.g, *self.rows)
        other = CompiledEngine(data, lambda: self.rule, self.size, -form.k)
        other.form = form
        return other

    def _is_slow(self, F: NDArray[np.float64]) -> bool:
        """True if one dual step closes little of the gap at the root of the tree, in the mean over the nodes."""
        p, rows, modes = len(F), list[int](), list[int]()
        for node, friction in enumerate((F > 0).tolist()):
            for kind, mode in status_rows(UNDECIDED, friction=friction):
                rows.append(kind * p + node)
                modes.append(mode)
        root = self.root(rows, modes)
        return not (root.stalled or root.pruned) and root.gap_closed((UNDECIDED,) * p) < 0.04


class ActiveSetRelaxation:
    """A solved relaxation: that of a state with further rows on, which the last child takes over from its parent."""

    __slots__ = ("_engine", "_state", "bound", "pruned", "stalled")

    def __init__(
        self, engine: CompiledEngine, state: QPState, rows: list[int], modes: list[int], *, last: bool
    ) -> None:
        self._engine, offset = engine, engine.offset
        self._state, status = state.child(rows, modes, last, PRUNE_MARGIN + offset, engine.tolerance, engine.limit)
        self.bound: float = self._state.bound - offset
        self.pruned = status == 1
        self.stalled = status == 2

    @property
    def form(self) -> EnclosedForm | None:
        """The form that ``bound`` is about; None for the energy."""
        return self._engine.form

    @property
    def forces(self) -> NDArray[np.float64]:
        """lambda at the minimiser, shape (2p,), scaled."""
        return self._state.x_array[: self._engine.size]

    @property
    def displacements(self) -> NDArray[np.float64]:
        """w at the minimiser, shape (2p,), scaled."""
        return self._state.w_array

    def at(self, i: int) -> tuple[float, float]:
        """Number i of the forces and of the displacements."""
        return self._state.at(i)

    def multipliers(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Rows of statuses and their multipliers, which prove ``bound``."""
        rows, values = self._state.multipliers()
        if not self._engine.always:
            return rows, values
        keep = rows < self._engine.always[0]
        return rows[keep], values[keep]

    def choose(self, codes: Codes) -> int:
        """The contact node to branch on, -1 when all are decided."""
        engine = self._engine
        return self._state.choose(codes, engine.rule, PRUNE_MARGIN + engine.offset)

    def forced(self, codes: Codes) -> tuple[int, ...]:
        """Undecided contact nodes with at most one child that no known bound excludes."""
        engine = self._engine
        return self._state.forced(codes, engine.rule, PRUNE_MARGIN + engine.offset)

    def gap_closed(self, codes: Codes) -> float:
        """Mean share of the gap to zero that one dual step closes in the better child of an undecided node."""
        p, gap = len(codes), max(-self.bound, 1e-300)
        shares = []
        for node, code in enumerate(codes):
            if code == UNDECIDED:
                gains = [self._state.gain(kind * p + node, EQUALITY) for kind in _APART]
                shares.append(min(1.0, max(gains) / gap))
        return float(np.mean(shares)) if shares else 1.0

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> Relaxation:
        """The relaxation with further rows switched on; ``last``: this object is not used again."""
        return ActiveSetRelaxation(self._engine, self._state, rows, modes, last=last)
