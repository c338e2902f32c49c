"""Piecewise smooth Newton method for H at fixed alpha, and starts of Newton's method and of paths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.condensation.condensed import condensation_of, solved
from enumsol.continuation.condensed_equation import CondensedEquation, DiscEquation
from enumsol.continuation.path_data import ContinuationOptions
from enumsol.continuation.scaled_equation import ParameterPath, SmoothPath
from enumsol.errors import EnumsolError, InvalidArgumentError
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.model.statuses import OPEN, SLIP, STICK
from enumsol.roots.local_branch import SelectionTangent
from enumsol.roots.root import Root
from enumsol.selections.solution import RANK_TOLERANCE
from enumsol.support.arguments import alpha_value, instance_of, positive_integer, positive_number, unbounded_interval
from enumsol.support.array_arguments import real_array
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.continuation.scaled_equation import ScaledEquation
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha, AlphaLike, ArrayLike, Codes, Floats


def check_problem(problem: object, smooth_path: SmoothPath | None) -> None:
    """Refuse what continuation does not take.

    Raises
    ------
    InvalidArgumentError
        The problem is none, or the smooth path is none.
    """
    check_is_problem(problem)
    if smooth_path is not None:
        instance_of(smooth_path, SmoothPath, "smooth_path")


def equation_on(
    problem: AnyProblem,
    smooth_path: SmoothPath | None,
    start: float,
    interval: tuple[float, float] = (-math.inf, math.inf),
    r: float | None = None,
    alpha_scale: float = 1.0,
) -> ScaledEquation:
    """The equation of a problem, on its own affine path or a smooth one; for the arguments see ScaledEquation."""
    kind = CondensedEquation if isinstance(problem, ContactProblem) else DiscEquation
    return kind(ParameterPath(problem, smooth_path, start), interval, start, r, alpha_scale)


#: The default alpha scale is this fraction of the interval.
ALPHA_FRACTION = 0.05
#: A change of the problem over the whole interval that is too small to follow: conditions within STATUS_TOLERANCE of
#: zero count as met with equality, and must not all be within it.
RESOLUTION = 1e-6
#: Norm of H above which a start is not a root.
START_TOLERANCE = 1e-6
#: What a start is made of, and of a body that nothing holds this as well.
_NAMES, _RIGID = ("alpha", "lambda_n", "lambda_t"), "rigid_coordinates"


class Start:
    """Validated arguments: the equation, the start as a point of it, interval, options and smooth path."""

    def __init__(
        self,
        problem: AnyProblem,
        start: object,
        interval: tuple[AlphaLike, AlphaLike] | None,
        options: ContinuationOptions | None,
        smooth_path: SmoothPath | None,
    ) -> None:
        check_problem(problem, smooth_path)
        chosen = ContinuationOptions() if options is None else options
        self.options = instance_of(chosen, ContinuationOptions, "options")
        self.smooth_path = smooth_path
        plane = isinstance(problem, ContactProblem)
        modes = problem.modes.r
        alpha, forces, rigid = _start_values(start, (problem.p,) if plane else (problem.p, 2), modes)
        self.interval = _interval(problem, interval, alpha, smooth_path)
        low, high = self.interval
        scale = self.options.alpha_scale
        if scale is None:
            scale = ALPHA_FRACTION * (high - low) if math.isfinite(high - low) else 1.0
        self.equation = equation_on(problem, smooth_path, alpha, self.interval, self.options.r, scale)
        if smooth_path is None and math.isfinite(high - low):
            self._check_resolution(alpha, (high - low) / scale)
        self.x = self._on_solution(alpha, forces, rigid)

    def _check_resolution(self, alpha: float, width: float) -> None:
        """Refuse an interval over which the problem hardly changes."""
        equation = self.equation
        values = equation.at(equation.point(alpha, np.zeros(equation.m)))
        change = max(np.max(np.abs(values.dg)), np.max(np.abs(values.dF) / (1.0 + values.F))) * width
        if 0 < change < RESOLUTION:
            raise InvalidArgumentError(
                f"interval is ({self.interval[0]:.17g}, {self.interval[1]:.17g}), over which friction and load change "
                f"by {change:.1e} of their size; expected at least {RESOLUTION:g} (branch_graph works without rounding)"
            )

    def _on_solution(self, alpha: float, forces: Floats, rigid: Floats) -> Floats:
        equation = self.equation
        x = equation.point(alpha, forces, rigid)
        if np.any(np.abs(rigid) > equation.reach):
            mode = int(np.argmax(np.abs(rigid) / equation.reach))
            raise InvalidArgumentError(
                f"start has {rigid[mode]:g} as coordinate of rigid mode {mode}; expected at most "
                f"{equation.reach[mode]:g} (see max_rigid_displacement)"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            residual = float(np.linalg.norm(equation.residual(x)))
        if not residual <= START_TOLERANCE:
            raise InvalidArgumentError(
                f"start is not a root at alpha = {alpha:g}: the residual of H is {residual:.2e} relative to the load; "
                f"expected at most {START_TOLERANCE:g} (newton(problem, alpha, start) finds the root nearby)"
            )
        return x


def _start_values(start: object, tangential: tuple[int, ...], modes: int) -> tuple[float, Floats, Floats]:
    """alpha, the forces (m,) and rigid coordinates (modes,) of a start whose lambda_t has that shape."""
    values = (*_NAMES, *((_RIGID,) if modes else ()))
    # a Path has these as well, of all its points
    one = isinstance(start, tuple) or not isinstance(start, Sequence)
    if isinstance(start, tuple) and len(start) == len(values):
        alpha, *given = start
    elif one and all(getattr(start, name, None) is not None for name in values):
        alpha, *given = (getattr(start, name) for name in values)
    else:
        found = f"a tuple of {len(start)}" if isinstance(start, tuple) else f"a {type(start).__name__}"
        raise InvalidArgumentError(f"start is {found}; expected a Root, a PathPoint or ({', '.join(values)})")
    parts = []
    for name, part, shape in zip(values[1:], given, (tangential[:1], tangential, (modes,)), strict=False):
        parts.append(np.atleast_1d(real_array(part, f"{name} of start", error=InvalidArgumentError)))
        if parts[-1].shape != shape:
            raise InvalidArgumentError(f"{name} of start has shape {parts[-1].shape}; expected {shape}")
    forces = np.concatenate([part.ravel(order="F") for part in parts[:2]])
    return float(alpha_value(alpha, "alpha of start")), forces, parts[2] if modes else np.zeros(0)


def _interval(
    problem: AnyProblem, interval: tuple[AlphaLike, AlphaLike] | None, start: float, smooth_path: SmoothPath | None
) -> tuple[float, float]:
    affine = smooth_path is None or smooth_path.F is None
    if interval is None:
        return friction_domain(problem) if affine else (-math.inf, math.inf)
    low, high = unbounded_interval(interval)
    if not low <= start <= high:
        raise InvalidArgumentError(f"start has alpha = {start:g}, outside the interval ({low:g}, {high:g})")
    if affine:
        for end in (low, high):
            if math.isfinite(end):
                problem.friction_at(end)
        domain = friction_domain(problem)
        low, high = max(low, domain[0]), min(high, domain[1])
    return low, high


def friction_domain(problem: AnyProblem) -> tuple[float, float]:
    """The range of alpha in which no coefficient F0 + alpha F1 is negative."""
    F0, F1 = problem.affine_friction
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = -F0 / F1
    low = np.max(zero[F1 > 0], initial=-math.inf)
    high = np.min(zero[F1 < 0], initial=math.inf)
    return float(low), float(high)


#: Shortest fraction of a Newton step that the line search tries.
MIN_FRACTION = 2.0**-12


@dataclass(frozen=True)
class NewtonIteration:
    """Iteration of the piecewise smooth Newton method.

    Attributes
    ----------
    residual : float
        Norm of H before the step, in forces relative to the load [-].
    step : float
        Fraction of the Newton step that was taken.
    changes : int
        Contact nodes whose selection differs from that of the iteration before.
    """

    residual: float
    step: float
    changes: int


class NotConverged(EnumsolError, ArithmeticError):  # noqa: N818 (the name is part of the public interface)
    """Newton's method found no root from this start; the message says why and what may help.

    Attributes
    ----------
    alpha : float
    history : tuple of NewtonIteration
    reason : str

    Examples
    --------
    >>> import enumsol
    >>> try:
    ...     enumsol.newton(enumsol.gallery.one_node_triangle(), 5, start=(-8.0, 3.0), max_iterations=1)
    ... except enumsol.NotConverged as error:
    ...     error.alpha, len(error.history)
    (5.0, 1)
    """

    def __init__(self, alpha: float, history: Sequence[NewtonIteration], reason: str) -> None:
        self.alpha = alpha
        self.history = tuple(history)
        self.reason = reason
        last = f"residual {self.history[-1].residual:.2e}" if self.history else "no iteration"
        super().__init__(
            f"Newton's method did not converge at alpha = {alpha:g} "
            f"({reason}; {counted(len(self.history), 'iteration')}, {last}); "
            "try another start, for example a root at a nearby alpha, or enumerate_roots, which needs no start"
        )


def newton(
    problem: AnyProblem,
    alpha: AlphaLike,
    start: Root | ArrayLike | None = None,
    *,
    r: float | None = None,
    smooth_path: SmoothPath | None = None,
    max_iterations: int = 100,
) -> Root:
    """Root at alpha, by the piecewise smooth Newton method from any start.

    Every iteration solves the selection of H that is active at the iterate. Full steps are taken until a selection
    recurs; from then on a line search lowers the norm of H. Which root is found depends on the start; a start near a
    regular root leads to it in one step, in 3D in a few. Each iteration costs one dense solve of size 2p, or 3p.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float, Fraction or whatever enumerate_roots accepts as alpha
    start : Root, (2p,) or (p, 2) array_like, in 3D (3p,) or (p, 3), or None
        Contact forces: those of a root, lambda_n followed by lambda_t (in 3D all along the first axis, then all along
        the second), or a row (lambda_n, lambda_t) per node [force]. None: zero. Of a body that nothing holds, all
        forces may be followed by the coordinates of its rigid displacement, which are zero otherwise.
    r : float or None
        Parameter of H [force / length]; None for each node's own stiffness.
    smooth_path : SmoothPath or None
        Friction and load at alpha come from here.
    max_iterations : int

    Returns
    -------
    Root
        Not regular when the point found belongs to a continuum of solutions (index None then).

    Raises
    ------
    NotConverged
        With the history of the iterations, and advice. A body that nothing holds may have no root.
    NotHeldError
        Some rigid displacement of a body that nothing holds moves no contact node.
    InvalidArgumentError
        An argument cannot be used as given.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> [enumsol.newton(problem, 5, start=start).statuses for start in (None, (1.0, -1.5))]
    [(ContactStatus.OPEN,), (ContactStatus.STICK,)]
    """
    check_problem(problem, smooth_path)
    exact = alpha_value(alpha)
    value = float(exact)
    r = None if r is None else positive_number(r, "r")
    max_iterations = positive_integer(max_iterations, "max_iterations")
    frozen: Any = problem
    if smooth_path is not None:
        frozen = smooth_path.problem_at(frozen, value)
    frozen.friction_at(exact)
    equation = equation_on(problem, smooth_path, value, r=r)
    forces, rigid = _unknowns_of(start, problem.p, equation.m // problem.p, equation.modes)
    x = equation.point(value, forces, rigid)
    x = _iterate(equation, x, value, max_iterations)
    if equation.modes or isinstance(equation, DiscEquation):
        return _root_of_floats(frozen, exact, equation, x)
    assert isinstance(equation, CondensedEquation)
    return build_root(frozen, exact if smooth_path is None else value, equation, x)


def _unknowns_of(start: Root | ArrayLike | None, p: int, d: int, modes: int) -> tuple[Floats, Floats]:
    """Forces in d components at every node, (d p,), and the coordinates of the rigid displacement, (modes,)."""
    none = np.zeros(modes)
    if start is None:
        return np.zeros(d * p), none
    if isinstance(start, Root):
        values = np.concatenate([start.lambda_n, start.lambda_t.ravel(order="F")])
        if modes and start.rigid_coordinates is not None:
            values = np.append(values, start.rigid_coordinates)
    else:
        values = real_array(start, "start", error=InvalidArgumentError)
        if values.shape == (p, d):
            values = values.T.ravel()
    if values.shape == (d * p,):
        return values, none
    if values.shape != (d * p + modes,):
        rigid = f", or with {counted(modes, 'rigid coordinate')} ({d * p + modes},)" if modes else ""
        raise InvalidArgumentError(
            f"start has shape {values.shape}; expected a Root or finite contact forces of shape ({d * p},) or ({p}, "
            f"{d}){rigid}"
        )
    return values[: d * p], values[d * p :]


def _iterate(equation: ScaledEquation, x: Floats, alpha: float, max_iterations: int) -> Floats:
    history: list[NewtonIteration] = []
    seen: set[bytes] = set()
    rows = equation.selection_at(x)
    damped = False
    for _ in range(max_iterations):
        residual = float(np.linalg.norm(equation.residual(x)))
        now = equation.selection_at(x)
        changes = int(np.sum(np.any(now != rows, axis=1)))
        rows = now
        # relative to the load, and well above rounding for any conditioning seen
        if residual <= 1e-10:
            return x
        damped = damped or rows.tobytes() in seen
        seen.add(rows.tobytes())
        # the shortest least-squares one where the selection is singular
        step = solved(equation.jacobian(rows, x)[:, :-1], equation.selection_residual(rows, x))
        fraction = _fraction(equation, x, step) if damped else 1.0
        history.append(NewtonIteration(residual, fraction, changes))
        if fraction < MIN_FRACTION:
            raise NotConverged(alpha, history, "no step along Newton's direction lowers the residual")
        x = x.copy()
        x[:-1] -= fraction * step
    raise NotConverged(alpha, history, f"the limit of {counted(max_iterations, 'iteration')} was reached")


def _fraction(equation: ScaledEquation, x: Floats, step: Floats) -> float:
    """Largest 2^-k that lowers the residual sufficiently."""
    fraction, residual = 1.0, equation.merit(x)
    while fraction >= MIN_FRACTION:
        trial = x.copy()
        trial[:-1] -= fraction * step
        # Armijo's condition
        if equation.merit(trial) <= (1 - 1e-4 * fraction) * residual:
            return fraction
        fraction *= 0.5
    return 0.0


def build_root(problem: ContactProblem, alpha: Alpha, equation: CondensedEquation, x: Floats) -> Root:
    """The Root at a point x of the condensed equation, with its index, margin and derivative."""
    # the enumeration is not needed to follow paths, and slow to import
    from enumsol.roots.components import RootBuilder, connected_components
    from enumsol.selections.float_selections import FloatSelections

    floats = FloatSelections(problem.condensed.at(alpha).scaled)
    solution = floats.solve(equation.codes(x))
    if solution is not None and solution.dimension == 0:
        component = connected_components([solution], floats)[0]
        if component.dimension == 0:
            return RootBuilder(problem, alpha, floats, floats, {}).root(component)
    return _root_of_floats(problem, alpha, equation, x, isolated=False)


def _root_of_floats(
    problem: AnyProblem, alpha: Alpha, equation: ScaledEquation, x: Floats, *, isolated: bool = True
) -> Root:
    """The Root at a point x of the condensed equation; not regular where a condition holds with equality.

    ``isolated``: it is not known to belong to a continuum.
    """
    codes, active = equation.codes(x), equation.active(x)
    index = equation.index(codes, x, RANK_TOLERANCE) if isolated else 0
    regular = bool(index) and all(len(held) == 1 for held in active)
    (lambda_n, lambda_t), (u_n, u_t) = equation.split(equation.forces(x)), equation.split(equation.displacements(x))
    closed = np.array([code != OPEN for code in codes])
    at_rest = np.array([code == STICK for code in codes])
    tangential = (len(codes), *(1,) * (lambda_t.ndim - 1))
    rubs, rests = closed.reshape(tangential) & ~equation.without, at_rest.reshape(tangential) & ~equation.without
    lambda_n, lambda_t = np.where(closed, lambda_n, 0.0), np.where(rubs, lambda_t, 0.0)
    u_n, u_t = np.where(closed, 0.0, u_n), np.where(rests, 0.0, u_t)
    tangent = None
    if regular and lambda_t.ndim == 2:
        parts = (lambda_n, lambda_t), (u_n, u_t)
        forces, moved = (np.append(normal, along.ravel(order="F")) for normal, along in parts)
        tangent = SelectionTangent.at(problem, alpha, codes, forces, moved)
    return Root(
        alpha=alpha,
        statuses=equation.statuses(codes, u_t.ravel(order="F")),
        active=tuple(
            frozenset(equation.statuses((code,), np.atleast_1d(u_t[i]))[0] for code in codes_of)
            for i, codes_of in enumerate(active)
        ),
        lambda_n=lambda_n,
        lambda_t=lambda_t,
        u_n=u_n,
        u_t=u_t,
        slip_angle=None if lambda_t.ndim == 1 else _slip_angles(codes, problem.friction_at(alpha) * u_t),
        index=index if regular else None,
        regular=regular,
        margin=float(np.min(equation.slacks(codes, x))) if regular else 0.0,
        enclosure=None,
        _condensed=condensation_of(problem),
        _tangent=tangent,
        _rigid=equation.rigid(x) if equation.modes else None,
    )


def _slip_angles(codes: Codes, driven: Floats) -> Floats:
    """Angles of F u_t (p, 2) of the nodes that slip in 3D, each as two equal bounds; nan of the others."""
    slips = np.array([code == SLIP for code in codes]) & np.any(driven != 0, axis=1)
    angle = np.arctan2(driven[:, 1], driven[:, 0])[:, None]
    return np.where(slips[:, None], np.tile(angle, 2), np.nan)
