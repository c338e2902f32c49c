"""The relaxation of a partial assignment for all alpha in an interval: one convex QP (theory, section 7.8).

The cone of a status is the union of its cones over the interval: |lambda_t| <= F_hi lambda_n, and for a slipping node
lambda_t between F_lo lambda_n and F_hi lambda_n. On a loading path alpha = middle + tau half is a further unknown,
and the concave part of the energy is replaced by its secant: with q = g1' S^-1 g1 half^2 the form

    e(lambda, tau) + (1 + RIDGE) q / 4 (tau^2 - 1)

is convex, is a lower bound on [-1, 1] and equals e at both ends. Multipliers that prove it positive therefore prove the
leaf empty on the whole interval by the dual bounds at its two ends, which is all that a checker needs.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np

from enumsol.arithmetic.balls import factor_above
from enumsol.condensation.condensed import CondensedProblem, CondensedSystem, ScaledSystem
from enumsol.errors import InvalidProblemError, MissingDependencyError
from enumsol.model.statuses import CONDITIONS, SLIP_MINUS, SLIP_PLUS, RowKind
from enumsol.relaxation.active_set import CompiledEngine
from enumsol.relaxation.engine import BRANCHING_CANDIDATES, not_compiled
from enumsol.relaxation.imposed_rows import EQUALITY, INEQUALITY, row_terms, status_rows
from enumsol.support.array_types import Alpha, NDArray

#: Part of the secant's slope that makes the form in (lambda, tau) definite: what it costs vanishes with the interval.
RIDGE = 1e-2
#: Least curvature of a form by its mean curvature.
_CURVATURE = 1e-9


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

    S: NDArray[np.float64]
    g: NDArray[np.float64]
    half: NDArray[np.float64]
    F_lo: NDArray[np.float64]
    F: NDArray[np.float64]
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

    H: NDArray[np.float64]
    h: NDArray[np.float64]
    half: NDArray[np.float64]

    @classmethod
    def of(cls, system: IntervalSystem, multipliers: NDArray[np.float64]) -> PieceForm | None:
        """The form of four multipliers per node, (4, p), with F_lo in place of F; None where it is hardly convex."""
        p = system.p
        mu, nu, alpha, beta = multipliers
        left, right = np.concatenate([mu, nu]), np.concatenate([system.F_lo * (beta - alpha), alpha + beta])

        def combined(rows: NDArray[np.float64]) -> NDArray[np.float64]:
            """D' applied to rows."""
            normal, tangential = np.concatenate([rows[:p]] * 2), np.concatenate([rows[p:]] * 2)
            return np.asarray((left * normal.T + right * tangential.T).T)

        turned = combined(system.S)
        H = 0.5 * (turned + turned.T)
        if factor_above(H, _CURVATURE * float(np.mean(np.diagonal(H)))) is None:
            return None
        return cls(H, combined(system.g), combined(system.half))

    def convex(self) -> NDArray[np.float64]:
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


class IntervalEngine(CompiledEngine):
    """Relaxations over an interval, with the energy or another form.

    Raises
    ------
    MissingDependencyError
        The compiled solver is not available.
    """

    def __init__(self, system: IntervalSystem, form: PieceForm | None = None) -> None:
        try:
            from enumsol.relaxation import _active_set
        except ImportError as error:
            raise MissingDependencyError(f"branch_graph needs it, but {not_compiled(error)}") from error
        p = system.p
        rule = _active_set.BranchingRule(system.F, *_slip_rows(system), BRANCHING_CANDIDATES)
        start, index, value = _all_rows(system)
        rows = len(start) - 1
        form = PieceForm(system.S, system.g, system.half) if form is None else form
        if not system.loaded:
            data = _active_set.QPData(form.H, form.h, -system.S, system.g, start, index, value, np.zeros(rows))
            super().__init__(data, lambda: rule, 2 * p)
            return
        # the last unknown is tau, between -1 and 1; w follows the 2p + 1 unknowns
        index = np.append(np.where(index >= 2 * p, index + 1, index), [2 * p, 2 * p])
        start = np.append(start, start[-1] + np.array([1, 2], dtype=np.intp))
        value = np.append(value, [1.0, -1.0])
        rhs = np.append(np.zeros(rows), [-1.0, -1.0])
        W = np.column_stack([-system.S, system.half])
        try:
            convex = form.convex()
            data = _active_set.QPData(convex, np.append(form.h, 0.0), W, system.g, start, index, value, rhs)
        except np.linalg.LinAlgError as error:
            raise InvalidProblemError(
                "the energy over an interval of alpha is not convex to working precision; expected contact rows "
                "[Bn; Bt] that are independent beyond rounding (are two contact nodes almost the same point?)"
            ) from error
        super().__init__(data, lambda: rule, 2 * p, offset=float(convex[-1, -1]), always=(rows, rows + 1))


def _all_rows(system: IntervalSystem) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Rows of RowKind with F_hi, then those of IntervalRowKind with F_lo."""
    p = system.p
    start, index, value = row_terms(p, system.F)
    nodes = np.arange(p)
    extra = np.stack([nodes, p + nodes], axis=1).ravel()
    plus = np.stack([-system.F_lo, np.ones(p)], axis=1).ravel()
    minus = np.stack([-system.F_lo, -np.ones(p)], axis=1).ravel()
    start = np.concatenate([start, start[-1] + 2 * np.arange(1, 2 * p + 1)])
    return start, np.concatenate([index, extra, extra]), np.concatenate([value, plus, minus])


def _slip_rows(system: IntervalSystem) -> tuple[NDArray[np.intp], NDArray[np.int8]]:
    """Row and mode, (2, p) each, that put lambda_t on the slip bound in slip+ and slip-."""
    constant = system.F_lo == system.F
    p = system.p
    equal = np.array([_R.CONE_PLUS, _R.CONE_MINUS])[:, None]
    least = np.array([_I.SLIP_AT_LEAST_PLUS, _I.SLIP_AT_LEAST_MINUS])[:, None]
    rows = np.where(constant, equal, least) * p + np.arange(p)
    modes = np.broadcast_to(np.where(constant, EQUALITY, INEQUALITY), (2, p))
    return rows, modes.astype(np.int8)
