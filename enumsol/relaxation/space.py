"""Relaxations in 3D: rows for slip directions in sectors, made when they are first needed (theory, section 12.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.kernel.space import ALONG, CHORD, END, FORCE, GAP, LEFT, RIGHT, SLIP, TANGENT, TAU, row_terms
from enumsol.relaxation.engine import FEASIBILITY_TOLERANCE, PRUNE_MARGIN
from enumsol.relaxation.rows import EQUALITY, INEQUALITY
from enumsol.sectors import SECTORS, end_number, nearest
from enumsol.statuses import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from enumsol.condensation.space import SpaceSystem
    from enumsol.kernel.space import Row
    from enumsol.relaxation._active_set import QPState
    from enumsol.selections.solution import Codes

#: Level of the directions on which tangents are put where the minimiser leaves the disc, and of those put anyway.
_FINE, _COARSE = 10, 3
#: Rounds of tangents, and how far outside the disc the minimiser must lie.
_ROUNDS, _OUTSIDE = 4, 1e-3
#: Sectors of this level and below are halved only where nothing else helps.
_DEEP = 12
#: Violations of maximum dissipation below this do not tell which sector to halve.
_DISSIPATION = 1e-7
#: Rows of a program, and entries of a row.
_ROWS, _ENTRIES = 24576, 3


class SpaceEngine:
    """Convex quadratic programs of a tree in 3D.

    Every node has slots for rows; row number ``slot * p + node`` belongs to a node, as elsewhere.

    Parameters
    ----------
    system : SpaceSystem

    Raises
    ------
    ImportError
        The compiled solver is not available.
    """

    name = "active-set"

    def __init__(self, system: SpaceSystem) -> None:
        from enumsol.relaxation import _active_set  # compiled

        self.system = system
        p = system.p
        self.slots = _ROWS // p
        rows = self.slots * p
        start = np.arange(rows + 1, dtype=np.intp) * _ENTRIES
        zeros = np.zeros(rows * _ENTRIES)
        self._state = _active_set.QPState
        self.data = _active_set.QPData(
            system.S,
            system.g,
            -system.S,
            system.g,
            start,
            np.zeros(rows * _ENTRIES, dtype=np.intp),
            zeros,
            zeros[:rows],
        )
        self._known: list[dict[tuple[int, int], int]] = [{} for _ in range(p)]
        #: Row by number, for multipliers.
        self.rows: dict[int, Row] = {}
        self.limit = 400 + 20 * len(system.g)
        self.full = False

    def slot(self, row: Row) -> int | None:
        """The slot of a row among those of its node; None when there is no room for it."""
        kind, node, number = row
        known = self._known[node]
        if (kind, number) not in known:
            if len(known) == self.slots:
                self.full = True
                return None
            slot = known[kind, number] = len(known)
            self.rows[slot * self.system.p + node] = row
            self.data.put_row(slot * self.system.p + node, *row_terms(row, self.system.tau, len(self.system.g)))
        return known[kind, number]

    def root(self, rows: list[int], modes: list[int]) -> SpaceRelaxation:
        """The relaxation with the given rows on."""
        return SpaceRelaxation(self, self._state(self.data), rows, modes)


def imposed(tau: NDArray[np.intp], node: int, code: int) -> list[tuple[Row, int]]:
    """Rows that a (partial) status of a node imposes, and their modes; those of a child extend its parent's."""
    axes = [k for k in range(2) if tau[node, k] >= 0]
    inequalities: list[Row] = [(FORCE, node, 0)]
    equations: list[Row] = []
    (inequalities if code in (OPEN, UNDECIDED) else equations).append((GAP, node, 0))
    if code == OPEN:
        return [
            *_with(inequalities[1:], INEQUALITY),
            *_with([(FORCE, node, 0), *((TAU, node, k) for k in axes)], EQUALITY),
        ]
    if len(axes) == 2:
        inequalities += [(TANGENT, node, (1 << _COARSE) + k) for k in range(1 << _COARSE)]
    elif axes:
        forward = 1 if code == SLIP_PLUS else -1 if code == SLIP_MINUS else 0
        inequalities += [(END, node, sign) for sign in (1, -1) if sign != forward]
        if forward:
            equations.append((END, node, forward))
            inequalities.append((ALONG, node, forward))
    if code == STICK:
        equations += [(SLIP, node, k) for k in axes]
    if code > SECTORS:
        number = code - SECTORS
        inequalities += [(TANGENT, node, n) for n in (number, 2 * number + 1, end_number(number))]
        inequalities += [(kind, node, number) for kind in (CHORD, LEFT, RIGHT)]
    return [*_with(inequalities, INEQUALITY), *_with(equations, EQUALITY)]


def _with(rows: Iterable[Row], mode: int) -> list[tuple[Row, int]]:
    return [(row, mode) for row in rows]


class SpaceRelaxation:
    """A solved relaxation, with tangents put where its minimiser left the disc."""

    __slots__ = ("_engine", "_state", "bound", "pruned", "stalled")

    def __init__(self, engine: SpaceEngine, state: QPState, rows: list[int], modes: list[int]) -> None:
        self._engine, self._state = engine, state
        self._solve(rows, modes)
        for _ in range(_ROUNDS):
            if self.pruned or self.stalled:
                break
            rows = self._cuts()
            if not rows:
                break
            self._solve(rows, [INEQUALITY] * len(rows))

    def _solve(self, rows: list[int], modes: list[int]) -> None:
        state = self._state
        state.switch(rows, modes)
        status = state.solve(PRUNE_MARGIN, FEASIBILITY_TOLERANCE, self._engine.limit)
        self.bound: float = state.bound
        self.pruned, self.stalled = status == 1, status == 2

    def _cuts(self) -> list[int]:
        """Rows of tangents at nodes whose tau is outside the disc of radius lambda_n."""
        system = self._engine.system
        y = self.forces
        tau, p = system.tangential(y), system.p
        size = np.linalg.norm(tau, axis=1)
        outside = np.flatnonzero(np.all(system.tau >= 0, axis=1) & (size > y[:p] * (1.0 + _OUTSIDE) + 1e-9))
        rows = []
        for node in outside:
            slot = self._engine.slot((TANGENT, int(node), nearest(float(tau[node, 0]), float(tau[node, 1]), _FINE)))
            if slot is not None and not self._state.mode_of(slot * p + int(node)):
                rows.append(slot * p + int(node))
        return rows

    @property
    def forces(self) -> NDArray[np.float64]:
        """y at the minimiser, shape (m,), scaled."""
        return self._state.x_array

    @property
    def displacements(self) -> NDArray[np.float64]:
        """w at the minimiser, shape (m,), scaled."""
        return self._state.w_array

    def multipliers(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Rows and their multipliers, which prove ``bound``."""
        return self._state.multipliers()

    def choose(self, codes: Codes) -> int:
        """The undecided node at which complementarity is violated most; -1 when all are open, stick or in a sector."""
        system, y, w = self._engine.system, self.forces, self.displacements
        p = system.p
        tau, v = system.tangential(y), system.tangential(w)
        slip = y[:p] * np.linalg.norm(v, axis=1) - np.sum(tau * v, axis=1)
        array = np.array(codes)
        score = slip + np.where(array == UNDECIDED, slip - y[:p] * w[:p], 0.0)
        score = np.where((array == CONTACT) | (array == UNDECIDED), score, -np.inf)
        best = int(np.argmax(score))
        return best if score[best] > -np.inf else -1

    def sector_to_halve(self, codes: Codes) -> int:
        """The node in a sector at which maximum dissipation is violated most; -1 where it is nowhere."""
        system, y = self._engine.system, self.forces
        tau, v = system.tangential(y), system.tangential(self.displacements)
        slip = y[: system.p] * np.linalg.norm(v, axis=1) - np.sum(tau * v, axis=1)
        array = np.array(codes)
        slip[(array <= SECTORS) | (array >= SECTORS + (1 << _DEEP))] = 0.0
        best = int(np.argmax(slip))
        return best if slip[best] > _DISSIPATION else -1

    def forced(self, codes: Codes) -> tuple[int, ...]:
        """No node is forced here."""
        return ()

    def child(self, rows: list[int], modes: list[int], *, last: bool) -> SpaceRelaxation:
        """The relaxation with further rows switched on; ``last``: this object is not used again."""
        return SpaceRelaxation(self._engine, self._state if last else self._state.copy(), rows, modes)
