"""The relaxations that a search meets, and other solvers for them: daqp from scratch and warm, clarabel.

A solver's ``solve(on)`` takes the rows that are on with their modes, and gives an Answer.
"""

from __future__ import annotations

import time
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import EQUALITY, PRUNE_MARGIN
from enumsol.relaxation.interior_point import InteriorPointEngine

INSTALLED = find_spec("daqp") is not None
#: daqp's marks of a row: equality, active at its lower bound; and what it takes for no bound.
EQUAL, ACTIVE_LOWER, FREE = 5, 3, 1e30
#: Multipliers whose squares overflow are a ray: daqp sets no size where it finds no point.
HUGE = 1e100


class Met(NamedTuple):
    """A relaxation that the search solved: row -> mode, and what the own method made of it."""

    on: dict[int, int]
    seconds: float
    pruned: bool
    bound: float


class Answer(NamedTuple):
    """What a solver made of a relaxation."""

    seconds: float
    solved: bool
    infeasible: bool
    proven: bool


class Recording:
    """The own engine; keeps every relaxation in the order in which the search meets it."""

    name = "recording"

    def __init__(self, system):
        self.inner, self.met = ActiveSetEngine(system), []

    def root(self, rows, modes):
        """The relaxation with the given rows on."""
        return self.recorded(dict(zip(rows, modes, strict=True)), lambda: self.inner.root(rows, modes))

    def recorded(self, on, solve):
        """The relaxation that ``solve`` gives, its time taken."""
        start = time.perf_counter()
        relaxation = solve()
        self.met.append(Met(on, time.perf_counter() - start, relaxation.pruned, relaxation.bound))
        return Recorded(self, on, relaxation)


class Recorded:
    """A relaxation of the own engine whose children are recorded too."""

    def __init__(self, engine, on, inner):
        self._engine, self._on, self._inner = engine, on, inner

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def child(self, rows, modes, *, last):
        """The relaxation with further rows switched on."""
        on = self._on | dict(zip(rows, modes, strict=True))
        return self._engine.recorded(on, lambda: self._inner.child(rows, modes, last=last))


def proves(engine, rows, values):
    """Whether multipliers, or a multiple of them, give a positive lower bound on the energy."""
    if not np.all(np.isfinite(values)) or not np.any(values):
        return False
    largest = np.max(np.abs(values))
    if largest > HUGE:
        values = values / largest
    if engine.dual_bound(rows, values) > PRUNE_MARGIN:
        return True
    # a ray: the best multiple of it, dual_bound(t) = -c t^2 + b t + a
    a, one, two = (engine.dual_bound(rows, t * values) for t in (0.0, 1.0, 2.0))
    c = -(two - 2 * one + a) / 2
    b = one - a + c
    best = b / (2 * c) if c > 0 else 1e12
    return b > 0 and any(engine.dual_bound(rows, t * values) > PRUNE_MARGIN for t in (best, 1e3, 1e6))


class Clarabel:
    """The package's interior-point engine, from scratch."""

    def __init__(self, system):
        self.engine = InteriorPointEngine(system)

    def solve(self, on):
        """Solve from scratch."""
        start = time.perf_counter()
        relaxed = self.engine.root(list(on), list(on.values()))
        seconds = time.perf_counter() - start
        # where no forces satisfy the rows, what comes back is a ray of multipliers
        infeasible = relaxed.pruned and not np.any(relaxed.forces)
        return Answer(seconds, not relaxed.stalled, infeasible, relaxed.pruned)


class Daqp:
    """daqp from scratch, on the rows that are on."""

    def __init__(self, system):
        self.engine = engine = InteriorPointEngine(system)  # its rows and its bound are used
        self.H, self.f = np.ascontiguousarray(2.0 * system.S), np.ascontiguousarray(-system.g)
        self.unit = 1.0 / engine.norms
        self.A, self.b = np.ascontiguousarray(engine.normals * self.unit[:, None]), engine.offsets * self.unit

    def solve(self, on):
        """Solve from scratch."""
        import daqp

        rows, equal = rows_of(on)
        start = time.perf_counter()
        upper = np.where(equal, self.b[rows], FREE)
        sense = np.where(equal, EQUAL, 0).astype(np.int32)
        _, _, flag, info = daqp.solve(self.H, self.f, np.ascontiguousarray(self.A[rows]), upper, self.b[rows], sense)
        seconds = time.perf_counter() - start
        return self.answer(seconds, flag, rows, equal, np.array(info["lam"]))

    def answer(self, seconds, flag, rows, equal, lam):
        """The answer from daqp's flag and its multipliers of the rows that are on."""
        values = -lam * self.unit[rows]
        proven = proves(self.engine, rows, np.where(equal, values, np.maximum(values, 0.0)))
        return Answer(seconds, flag == 1, flag == -1, proven)


class WarmDaqp(Daqp):
    """daqp with all rows in one workspace; rows that are off have infinite bounds, and the active set is kept."""

    def __init__(self, system):
        import daqp

        super().__init__(system)
        self.model = daqp.Model()
        off = np.full(len(self.b), FREE)
        self.model.setup(self.H, self.f, self.A, off, -off, np.zeros(len(off), dtype=np.int32))
        self.active = np.zeros(len(self.b), dtype=bool)

    def solve(self, on):
        """Solve from the active set of the relaxation before."""
        rows, equal = rows_of(on)
        start = time.perf_counter()
        upper, lower = np.full(len(self.b), FREE), np.full(len(self.b), -FREE)
        sense = np.zeros(len(self.b), dtype=np.int32)
        lower[rows] = self.b[rows]
        upper[rows[equal]] = self.b[rows[equal]]
        sense[rows] = np.where(equal, EQUAL, np.where(self.active[rows], ACTIVE_LOWER, 0))
        self.model.update(bupper=upper, blower=lower, sense=sense)
        _, _, flag, info = self.model.solve()
        seconds = time.perf_counter() - start
        lam = np.array(info["lam"])
        self.active = lam < 0 if flag == 1 else np.zeros(len(lam), dtype=bool)
        return self.answer(seconds, flag, rows, equal, lam[rows])


def rows_of(on):
    """Row numbers, and which of them are equalities."""
    return np.array(list(on)), np.array([mode == EQUALITY for mode in on.values()])


#: Name -> solver that the own method is compared with.
SOLVERS = ({"daqp": Daqp, "daqp warm": WarmDaqp} if INSTALLED else {}) | {"clarabel": Clarabel}
