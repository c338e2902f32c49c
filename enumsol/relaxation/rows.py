"""The relaxation of a partial assignment: a convex QP in lambda, its rows and its engines (theory, section 5)."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, Protocol

import numpy as np

from enumsol.statuses import CONTACT, FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.relaxation._active_set import QPState
    from enumsol.selections.solution import Codes

#: Largest violation of a row (rows of unit length in the norm of S^{-1}) that the QP takes for none.
FEASIBILITY_TOLERANCE = 1e-11
#: A leaf is pruned when its energy bound exceeds this; g' S^{-1} g lies in [1, 4), so it is relative to the data.
PRUNE_MARGIN = 1e-9
#: Nodes whose children are bounded before one of them is branched on (measured in studies/branching.py).
BRANCHING_CANDIDATES = 16


class RowKind(enum.IntEnum):
    """Rows ``row >= 0`` (or ``= 0``, as an equality) of a contact node; row number = kind * p + node."""

    NORMAL_FORCE = 0  # lambda_n
    TANGENTIAL_FORCE = 1  # lambda_t
    CONE_PLUS = 2  # F lambda_n - lambda_t
    CONE_MINUS = 3  # F lambda_n + lambda_t
    PENETRATION = 4  # -w_n
    SLIP_FORWARD = 5  # w_t
    SLIP_BACKWARD = 6  # -w_t


_R = RowKind
INEQUALITY, EQUALITY = 1, 2

#: Rows of every status (rows of a child extend its parent's).
STATUS_ROWS: dict[int, tuple[tuple[RowKind, int], ...]] = {
    UNDECIDED: ((_R.PENETRATION, 1), (_R.CONE_PLUS, 1), (_R.CONE_MINUS, 1)),
    OPEN: ((_R.PENETRATION, 1), (_R.NORMAL_FORCE, 2), (_R.TANGENTIAL_FORCE, 2)),
    CONTACT: ((_R.PENETRATION, 2), (_R.CONE_PLUS, 1), (_R.CONE_MINUS, 1)),
    STICK: ((_R.PENETRATION, 2), (_R.CONE_PLUS, 1), (_R.CONE_MINUS, 1), (_R.SLIP_FORWARD, 2)),
    SLIP_PLUS: ((_R.PENETRATION, 2), (_R.CONE_PLUS, 2), (_R.CONE_MINUS, 1), (_R.SLIP_FORWARD, 1)),
    SLIP_MINUS: ((_R.PENETRATION, 2), (_R.CONE_MINUS, 2), (_R.CONE_PLUS, 1), (_R.SLIP_BACKWARD, 1)),
    FRICTIONLESS: ((_R.PENETRATION, 2), (_R.NORMAL_FORCE, 1), (_R.TANGENTIAL_FORCE, 2)),
}
_UNDECIDED_FRICTIONLESS = ((_R.PENETRATION, 1), (_R.NORMAL_FORCE, 1), (_R.TANGENTIAL_FORCE, 2))


def status_rows(code: int, *, friction: bool) -> tuple[tuple[RowKind, int], ...]:
    """(kind, mode) of the rows that a node of this code imposes."""
    if code == UNDECIDED and not friction:
        return _UNDECIDED_FRICTIONLESS
    return STATUS_ROWS[code]


def row_terms(p: int, F: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """All rows as sparse combinations of y = (lambda, w), w of shape (2p,): start, index and value arrays."""
    start, index, value = [0], [], []
    for kind in RowKind:
        for i in range(p):
            terms = {
                _R.NORMAL_FORCE: ((i, 1.0),),
                _R.TANGENTIAL_FORCE: ((p + i, 1.0),),
                _R.CONE_PLUS: ((i, F[i]), (p + i, -1.0)),
                _R.CONE_MINUS: ((i, F[i]), (p + i, 1.0)),
                _R.PENETRATION: ((2 * p + i, -1.0),),
                _R.SLIP_FORWARD: ((3 * p + i, 1.0),),
                _R.SLIP_BACKWARD: ((3 * p + i, -1.0),),
            }[kind]
            for j, v in terms:
                index.append(j)
                value.append(v)
            start.append(len(index))
    return np.array(start, dtype=np.intp), np.array(index, dtype=np.intp), np.array(value, dtype=np.float64)


def imposed_rows(code: int, *, friction: bool) -> dict[RowKind, int]:
    """Mode of every row that holds in a (partial) status, those implied by others included.

    A multiplier of an INEQUALITY must be nonnegative, one of an EQUALITY is free; any other row proves nothing.
    """
    rows = dict.fromkeys((_R.NORMAL_FORCE, _R.CONE_PLUS, _R.CONE_MINUS, _R.PENETRATION), INEQUALITY)
    rows |= dict(status_rows(code, friction=friction))
    if code == OPEN:
        rows |= dict.fromkeys((_R.CONE_PLUS, _R.CONE_MINUS), EQUALITY)
    return rows


class Relaxation(Protocol):
    """The solved relaxation of one partial assignment."""

    pruned: bool  # the energy bound is above PRUNE_MARGIN: no solution
    stalled: bool  # the engine gave no answer: nothing may be concluded
    bound: float

    @property
    def forces(self) -> NDArray[np.float64]:
        """lambda at the minimiser, shape (2p,), scaled."""

    @property
    def displacements(self) -> NDArray[np.float64]:
        """w at the minimiser, shape (2p,), scaled."""

    def multipliers(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Rows and their multipliers, which prove ``bound``."""

    def choose(self, codes: Codes) -> int:
        """The contact node that the partial assignment is to be branched on, -1 when all are decided."""

    def forced(self, codes: Codes) -> tuple[int, ...]:
        """Undecided contact nodes of which one child at most is not excluded by a bound that is at hand."""

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> Relaxation:
        """The relaxation with further rows switched on; ``last``: this object is not used again."""


def largest_violation(codes: Codes, F: NDArray[np.float64], forces: NDArray[np.float64], w: NDArray[np.float64]) -> int:
    """The undecided node at which complementarity is violated most, -1 when all are decided."""
    array, p = np.array(codes), len(F)
    open_nodes = np.flatnonzero(array >= CONTACT)
    if not len(open_nodes):
        return -1
    slip = F * forces[:p] * np.abs(w[p:]) - forces[p:] * w[p:]
    # an undecided node's slip counts double: deciding it now saves the slack that it leaves in the energy
    score = np.where(array == UNDECIDED, slip - forces[:p] * w[:p], 0.0) + slip
    return int(open_nodes[np.argmax(score[open_nodes])])


class Engine(Protocol):
    """Makes the relaxation at the root of the tree."""

    name: str

    def root(self, rows: list[int], modes: list[int]) -> Relaxation:
        """The relaxation with the given rows on."""


class ActiveSetEngine:
    """Own dual active-set method, warm-started from the parent (compiled; see ``_active_set.pyx``)."""

    name = "active-set"

    def __init__(self, system: ScaledSystem) -> None:
        from enumsol.relaxation import _active_set  # compiled; its absence is handled by make_engine

        p = system.p
        start, index, value = row_terms(p, system.F)
        rhs = np.zeros(len(start) - 1)
        self._data = _active_set.QPData(system.S, system.g, -system.S, system.g, start, index, value, rhs)
        self._module = _active_set
        cones = np.array([RowKind.CONE_PLUS, RowKind.CONE_MINUS])[:, None] * p + np.arange(p)
        self.rule = _active_set.BranchingRule(
            system.F, cones, np.full((2, p), EQUALITY, dtype=np.int8), BRANCHING_CANDIDATES
        )
        self.limit = 200 + 20 * p

    def root(self, rows: list[int], modes: list[int]) -> Relaxation:
        """The relaxation with the given rows on."""
        return _ActiveSetRelaxation(self, self._module.QPState(self._data), rows, modes)


class _ActiveSetRelaxation:
    __slots__ = ("_engine", "_state", "bound", "pruned", "stalled")

    def __init__(self, engine: ActiveSetEngine, state: QPState, rows: list[int], modes: list[int]) -> None:
        self._engine = engine
        self._state = state
        state.switch(rows, modes)
        status = state.solve(PRUNE_MARGIN, FEASIBILITY_TOLERANCE, engine.limit)
        self.bound: float = state.bound
        self.pruned = status == 1
        self.stalled = status == 2

    @property
    def forces(self) -> NDArray[np.float64]:
        return self._state.x_array

    @property
    def displacements(self) -> NDArray[np.float64]:
        return self._state.w_array

    def multipliers(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        return self._state.multipliers()

    def choose(self, codes: Codes) -> int:
        return self._state.choose(np.array(codes, dtype=np.int8), self._engine.rule, PRUNE_MARGIN)

    def forced(self, codes: Codes) -> tuple[int, ...]:
        return self._state.forced(np.array(codes, dtype=np.int8), self._engine.rule, PRUNE_MARGIN)

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> Relaxation:
        state = self._state if last else self._state.copy()
        return _ActiveSetRelaxation(self._engine, state, rows, modes)
