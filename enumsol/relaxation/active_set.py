"""Relaxations by a dual active-set method, warm-started from the parent (compiled; see ``_active_set.pyx``).

They are those of a partial assignment at one alpha, or for all alpha in an interval: one convex QP (theory, section
7.8). The cone of a status is then the union of its cones over the interval: |lambda_t| <= F_hi lambda_n, and for a
slipping node lambda_t between F_lo lambda_n and F_hi lambda_n. On a loading path alpha = middle + tau half is a further
unknown, and the concave part of the energy is replaced by its secant: with q = g1' S^-1 g1 half^2 the form

    e(lambda, tau) + (1 + RIDGE) q / 4 (tau^2 - 1)

is convex, is a lower bound on [-1, 1] and equals e at both ends. Multipliers that prove it positive therefore prove the
leaf empty on the whole interval by the dual bounds at its two ends, which is all that a checker needs.
"""

from __future__ import annotations

import copy
import enum
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.condensation.condensed import CondensedProblem, CondensedSystem, ScaledSystem
from enumsol.errors import InvalidProblemError, MissingDependencyError
from enumsol.model.statuses import CONDITIONS, SLIP_MINUS, SLIP_PLUS, UNDECIDED, RowKind
from enumsol.relaxation.engine import (
    BRANCHING_CANDIDATES,
    EQUALITY,
    FEASIBILITY_TOLERANCE,
    INEQUALITY,
    PRUNE_MARGIN,
    Relaxation,
    not_compiled,
    row_terms,
    status_rows,
)
from enumsol.support.array_types import Alpha, Codes, Floats, Indices, NDArray
from enumsol.trusted.quadratic_forms import multiplied

if TYPE_CHECKING:
    from enumsol.relaxation._active_set import BranchingRule, QPData, QPState
    from enumsol.trusted.quadratic_forms import EnclosedForm

#: Part of the secant's slope that makes the form in (lambda, tau) definite: what it costs vanishes with the interval.
RIDGE = 1e-2
#: Rows that become equations when a node is open, or in contact.
_APART = (int(RowKind.NORMAL_FORCE), int(RowKind.PENETRATION))


class IntervalRowKind(enum.IntEnum):
    """Rows ``row >= 0`` beyond those of RowKind (whose cones have F_hi); row number = kind * p + node."""

    SLIP_AT_LEAST_PLUS = 7  # lambda_t - F_lo lambda_n
    SLIP_AT_LEAST_MINUS = 8  # -lambda_t - F_lo lambda_n


_R, _I = RowKind, IntervalRowKind
_LEAST = {SLIP_PLUS: _I.SLIP_AT_LEAST_PLUS, SLIP_MINUS: _I.SLIP_AT_LEAST_MINUS}


def interval_rows(code: int, *, friction: bool, constant: bool) -> tuple[tuple[int, int], ...]:
    """(kind, mode) of the rows that a node of this code imposes on an interval.

    Parameters
    ----------
    code : status code, partial ones included
    friction : F_hi > 0
    constant : F_lo = F_hi, so that a slipping node's bound is an equation
    """
    if code in _LEAST and not constant:
        (contact, bound), (force, slip) = CONDITIONS[code]
        return (contact, EQUALITY), *((kind, INEQUALITY) for kind in (force, bound, _LEAST[code], slip))
    return status_rows(code, friction=friction)


@dataclass(frozen=True)
class IntervalSystem:
    """The condensed problem over an interval of alpha, without units (see ScaledSystem).

    Attributes
    ----------
    S : (2p, 2p) array
    g, half : (2p,) arrays
        g(alpha) = g + tau half for alpha = middle + tau (b - a) / 2, tau in [-1, 1].
    F_lo, F : (p,) arrays
        Smallest and largest friction coefficients on the interval.
    scaled : ScaledSystem
        The system at the end with the larger energy, whose scaling this one shares.
    """

    S: Floats
    g: Floats
    half: Floats
    F_lo: Floats
    F: Floats
    scaled: ScaledSystem = field(repr=False)

    @classmethod
    def from_problem(
        cls, condensed: CondensedProblem, a: Alpha, b: Alpha, origin: Alpha | None, *, proposals: bool = False
    ) -> IntervalSystem:
        """The interval [a, b]; ``origin`` is the alpha at which g vanishes, if it does in [a, b] (then a or b).

        ``proposals``: as in ScaledSystem.from_system.

        With such an origin the solutions are alpha's distance from it times those of the load +-g1, so that this load,
        which does not vary, is searched in place of g(alpha).
        """
        F = np.stack([condensed.F0 + float(alpha) * condensed.F1 for alpha in (a, b)])
        F_lo, F_hi = np.maximum(F.min(axis=0), 0.0), np.maximum(F.max(axis=0), 0.0)
        if origin is not None:
            ends = np.stack([condensed.g1 if b > origin else -condensed.g1] * 2)
        else:
            ends = np.stack([condensed.g0 + float(alpha) * condensed.g1 for alpha in (a, b)])
        systems = [CondensedSystem(condensed.S, g, F_hi) for g in ends]
        first = ScaledSystem.from_system(systems[0], proposals=proposals)
        with np.errstate(over="ignore", invalid="ignore"):
            energies = [np.linalg.norm(np.linalg.solve(first.cholesky, g / first.length)) for g in ends]
        larger = int(not energies[1] <= energies[0])
        scaled = first if larger == 0 else ScaledSystem.from_system(systems[1], proposals=proposals)
        ends = ends / scaled.length
        return cls(scaled.S, 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]), F_lo, F_hi, scaled)

    @classmethod
    def at_alpha(cls, system: ScaledSystem) -> IntervalSystem:
        """An interval of one alpha only."""
        return cls(system.S, system.g, np.zeros_like(system.g), system.F, system.F, system)

    @property
    def p(self) -> int:
        """Number of contact nodes."""
        return len(self.F)

    @property
    def loaded(self) -> bool:
        """True if g varies over the interval."""
        return bool(np.any(self.half))


@dataclass(frozen=True)
class PieceForm:
    """lambda'H lambda - (h + tau half)'lambda: the energy over an interval, or another form (theory, section 5.8).

    Attributes
    ----------
    H : (2p, 2p) array
    h, half : (2p,) arrays
    """

    H: Floats
    h: Floats
    half: Floats

    @classmethod
    def of(cls, system: IntervalSystem, multipliers: Floats) -> PieceForm | None:
        """The form of four multipliers per node, (4, p), with F_lo in place of F; None where it is hardly convex."""
        turned = multiplied(system.S, system.F_lo, multipliers)
        H = 0.5 * (turned + turned.T)
        if factor_above(H, 1e-9 * float(np.mean(np.diagonal(H)))) is None:
            return None
        loads = multiplied(np.column_stack([system.g, system.half]), system.F_lo, multipliers)
        return cls(H, loads[:, 0].copy(), loads[:, 1].copy())

    def convex(self) -> Floats:
        """Matrix of the convex form in (lambda, tau), shape (2p + 1, 2p + 1).

        Raises
        ------
        numpy.linalg.LinAlgError
            H is not positive definite.
        """
        q = float(np.linalg.norm(np.linalg.solve(np.linalg.cholesky(self.H), self.half))) ** 2
        # a load that hardly varies: its q may underflow
        curvature = 0.25 * (q + RIDGE * max(q, 1e-12))
        across = -0.5 * self.half[:, None]
        return np.block([[self.H, across], [across.T, np.array([[curvature]])]])


class ActiveSetEngine:
    """A quadratic program whose rows are switched on and off, and the compiled method that solves it.

    Parameters
    ----------
    system : ScaledSystem or IntervalSystem
        At one alpha, or over an interval.
    form : PieceForm, optional
        The form that is minimised, by default the energy: S and g in place of H and h. It must be at most zero at every
        solution.
    candidates : int
        Nodes whose children are bounded before one of them is branched on.
    slow : bool, optional
        Whether little is gained by each branching; by default that is found out at the root of the tree.

    Raises
    ------
    ImportError
        The compiled solver is not available.
    numpy.linalg.LinAlgError
        The load varies over the interval, and the form is not positive definite.
    """

    name = "active-set"
    solves_children = False
    #: The form that is minimised in place of the energy, if it is one at one alpha.
    form: EnclosedForm | None = None
    #: The engine of the energy, whose branching rule serves this one.
    _energy: ActiveSetEngine | None = None
    #: What is subtracted from the program's bound to have that on the form.
    offset = 0.0
    #: Rows beyond those of the statuses, inequalities that are always on.
    always: tuple[int, ...] = ()

    def __init__(
        self,
        system: ScaledSystem | IntervalSystem,
        form: PieceForm | None = None,
        *,
        candidates: int = BRANCHING_CANDIDATES,
        slow: bool | None = None,
    ) -> None:
        from enumsol.relaxation import _active_set  # compiled; its absence is handled by make_engine

        self._compiled = _active_set
        over = system if isinstance(system, IntervalSystem) else IntervalSystem.at_alpha(system)
        self._system, self._candidates, self._slow = over, candidates, slow
        #: The first unknowns, so many of them, are lambda.
        self.size = 2 * over.p
        #: Most changes of the active set; a program that needs more has stalled.
        self.limit = 200 + 10 * self.size
        form = PieceForm(over.S, over.g, over.half) if form is None else form
        start, index, value = self._rows = _all_rows(over)
        rows = len(start) - 1
        if not over.loaded:
            self._minimise(form.H, form.h)
            return
        # the last unknown is tau, between -1 and 1; w follows the 2p + 1 unknowns
        index = np.append(np.where(index >= self.size, index + 1, index), [self.size, self.size])
        start = np.append(start, start[-1] + np.array([1, 2], dtype=np.intp))
        rhs = np.append(np.zeros(rows), [-1.0, -1.0])
        W, convex = np.column_stack([-over.S, over.half]), form.convex()
        terms = start, index, np.append(value, [1.0, -1.0])
        self._take(_active_set.QPData(convex, np.append(form.h, 0.0), W, over.g, *terms, rhs))
        self.offset, self.always = float(convex[-1, -1]), (rows, rows + 1)

    def _minimise(self, H: Floats, h: Floats) -> None:
        """Take the program that minimises lambda' H lambda - h' lambda."""
        system = self._system
        zeros = np.zeros(len(self._rows[0]) - 1)
        self._take(self._compiled.QPData(H, h, -system.S, system.g, *self._rows, zeros))

    def _take(self, data: QPData) -> None:
        self.data = data
        #: Largest violation that the QP ignores. On weak springs the load gives a body an energy that is as large as
        #: the springs are weak, and its data are larger than those of a body that is held.
        self.tolerance = FEASIBILITY_TOLERANCE * max(1.0, math.sqrt(-self._compiled.QPState(data).bound))

    @classmethod
    def over(cls, system: IntervalSystem, form: PieceForm | None = None) -> ActiveSetEngine:
        """An engine over an interval of alpha, whose trees are not taken for slow ones.

        Raises
        ------
        MissingDependencyError
            The compiled solver is not available.
        InvalidProblemError
            The form is not convex to working precision.
        """
        try:
            return cls(system, form, slow=False)
        except ImportError as error:
            raise MissingDependencyError(f"branch_graph needs it, but {not_compiled(error)}") from error
        except np.linalg.LinAlgError as error:
            raise InvalidProblemError(
                "the energy over an interval of alpha is not convex to working precision; expected contact rows "
                "[Bn; Bt] that are independent beyond rounding (are two contact nodes almost the same point?)"
            ) from error

    @cached_property
    def rule(self) -> BranchingRule:
        """Which contact node a partial assignment is branched on."""
        if self._energy is not None:
            return self._energy.rule
        F = self._system.F
        slow = self._is_slow(F) if self._slow is None else self._slow
        return self._compiled.BranchingRule(F, *_slip_rows(self._system), self._candidates, slow)

    def bounding(self, form: EnclosedForm) -> ActiveSetEngine:
        """An engine with the same rows whose relaxations bound a form, which is convex, in place of the energy."""
        other = copy.copy(self)
        other.form, other.offset, other._energy = form, -form.k, self
        other._minimise(form.H, form.h)
        return other

    def root(self, rows: list[int], modes: list[int]) -> ActiveSetRelaxation:
        """The relaxation with the given rows on."""
        rows, modes = [*rows, *self.always], modes + [INEQUALITY] * len(self.always)
        return ActiveSetRelaxation(self, self._compiled.QPState(self.data), rows, modes, last=True)

    def _is_slow(self, F: Floats) -> bool:
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
        self, engine: ActiveSetEngine, state: QPState, rows: list[int], modes: list[int], *, last: bool
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
    def forces(self) -> Floats:
        """lambda at the minimiser, shape (2p,), scaled."""
        return self._state.x_array[: self._engine.size]

    @property
    def displacements(self) -> Floats:
        """w at the minimiser, shape (2p,), scaled."""
        return self._state.w_array

    def at(self, i: int) -> tuple[float, float]:
        """Number i of the forces and of the displacements."""
        return self._state.at(i)

    def multipliers(self) -> tuple[Indices, Floats]:
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


def _all_rows(system: IntervalSystem) -> tuple[Indices, Indices, Floats]:
    """Rows of RowKind with F_hi, then those of IntervalRowKind with F_lo where that differs at some node."""
    p = system.p
    start, index, value = row_terms(p, system.F)
    if np.array_equal(system.F_lo, system.F):
        return start, index, value
    nodes = np.arange(p)
    extra = np.stack([nodes, p + nodes], axis=1).ravel()
    plus = np.stack([-system.F_lo, np.ones(p)], axis=1).ravel()
    minus = np.stack([-system.F_lo, -np.ones(p)], axis=1).ravel()
    start = np.concatenate([start, start[-1] + 2 * np.arange(1, 2 * p + 1)])
    return start, np.concatenate([index, extra, extra]), np.concatenate([value, plus, minus])


def _slip_rows(system: IntervalSystem) -> tuple[Indices, NDArray[np.int8]]:
    """Row and mode, (2, p) each, that put lambda_t on the slip bound in slip+ and slip-."""
    constant = system.F_lo == system.F
    p = system.p
    equal = np.array([_R.CONE_PLUS, _R.CONE_MINUS])[:, None]
    least = np.array([_I.SLIP_AT_LEAST_PLUS, _I.SLIP_AT_LEAST_MINUS])[:, None]
    rows = np.where(constant, equal, least) * p + np.arange(p)
    modes = np.broadcast_to(np.where(constant, EQUALITY, INEQUALITY), (2, p))
    return rows, modes.astype(np.int8)
