"""Paths of friction and load over alpha, affine ones and the user's own callables, condensed to the contact nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from enumsol.condensation.condensed import condensation_of
from enumsol.condensation.factorization import RHS_BLOCK
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import check_is_problem
from enumsol.support.arguments import alpha_value, optional_callable
from enumsol.support.array_arguments import real_array

if TYPE_CHECKING:
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem, ContactProblem3D
    from enumsol.support.array_types import AlphaLike, Floats, Mask


PathFunction = Callable[[float], Any]
#: A problem in 2D or 3D.
Body = TypeVar("Body", "ContactProblem", "ContactProblem3D")


@dataclass(frozen=True)
class SmoothPath:
    """Friction and load as callables of alpha, in place of the affine paths of a problem.

    Give friction, load or both, each with its derivative; what is not given is taken from the problem.

    Attributes
    ----------
    F, dF : callable or None
        Friction coefficients and their derivative at alpha: a number or a (p,) array, in 3D also (p, 2) [-].
    f, df : callable or None
        Load and its derivative at alpha, (n,) arrays [force].

    Raises
    ------
    InvalidArgumentError
        A function comes without its derivative, or none is given.

    Examples
    --------
    >>> import enumsol
    >>> smooth = enumsol.SmoothPath(F=lambda alpha: alpha**2, dF=lambda alpha: 2 * alpha)
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> enumsol.newton(problem, 2, start=(1.0, -3.5), smooth_path=smooth).statuses  # F = 4
    (ContactStatus.STICK,)
    """

    F: PathFunction | None = None
    dF: PathFunction | None = None  # noqa: N815 (the name is part of the public interface)
    f: PathFunction | None = None
    df: PathFunction | None = None

    def __post_init__(self) -> None:
        for name in ("F", "dF", "f", "df"):
            optional_callable(getattr(self, name), f"SmoothPath.{name}")
        if (self.F is None) != (self.dF is None) or (self.f is None) != (self.df is None):
            raise InvalidArgumentError(
                "SmoothPath has a function without its derivative; expected F with dF, f with df"
            )
        if self.F is None and self.f is None:
            raise InvalidArgumentError("SmoothPath has neither F nor f; expected at least one of them")

    def problem_at(self, problem: Body, alpha: AlphaLike) -> Body:
        """The problem, in 2D or 3D, with friction and load frozen at alpha, to enumerate roots on the path."""
        check_is_problem(problem)
        exact = alpha_value(alpha)
        value, shape = float(exact), problem.affine_friction[0].shape
        F = problem.friction_at(exact) if self.F is None else _coefficients(self.F, value, "F", shape)
        f = problem.load_at(exact) if self.f is None else _evaluate(self.f, value, "f", (problem.n,))
        friction = F if len(shape) == 1 else (F[:, 0], F[:, 1])
        return problem.replace(f=f, load_slope=None, friction=friction, friction_slope=0.0)


@dataclass(frozen=True)
class PathValues:
    """Condensed load g, friction F and their derivatives at one alpha: arrays (2p,), (p,), (2p,), (p,).

    In 3D the shapes are (3p,), (p, 2), (3p,), (p, 2). Of a body that nothing holds, g ends with the r loads h of its
    equilibrium as a whole, and dg with their derivatives.
    """

    g: Floats
    F: Floats
    dg: Floats
    dF: Floats  # noqa: N815 (as above)


class ParameterPath:
    """Friction and load over alpha, condensed to the contact nodes; a load by callables costs 2 p n products per alpha.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    smooth : SmoothPath or None
        None: the problem's own friction and load, affine in alpha, also where friction would be negative (iterates).
    alpha : float
        The start of the path, at which a smooth one is checked.

    Raises
    ------
    InvalidArgumentError
        A function of the smooth path gives no friction or no load at the start, or another derivative than its own.
    """

    def __init__(self, problem: AnyProblem, smooth: SmoothPath | None, alpha: float) -> None:
        self.problem: Any = problem
        self._smooth, self._start = smooth, alpha
        self.condensed = condensed = condensation_of(problem)
        (g0, g1), (h0, h1) = (condensed.g0, condensed.g1), condensed.h
        self._load = np.append(g0, h0), np.append(g1, h1)
        if smooth is not None:
            self._check_start(alpha)
            self._check_derivatives(smooth, alpha)

    def _check_start(self, alpha: float) -> None:
        """Refuse values that are not admissible friction or load at the start of the path."""
        values = self.at(alpha)
        if not (np.all(np.isfinite(values.F)) and np.all(values.F >= 0)):
            place = int(np.argmin(np.isfinite(values.F) & (values.F >= 0)))
            node = place // (values.F.size // self.problem.p)
            raise InvalidArgumentError(
                f"SmoothPath.F gives {values.F.flat[place]:g} for contact node {self.problem.node_ids[node]} at "
                f"alpha = {alpha:g}; expected F >= 0"
            )
        if not np.all(np.isfinite(values.g)):
            raise InvalidArgumentError(f"SmoothPath.f is not finite at alpha = {alpha:g}; expected a load")

    @cached_property
    def _influence(self) -> Floats:
        """B A^{-1}, shape (2p, n), and N' of a body that nothing holds: dense, but only few rows."""
        problem = self.problem
        B = problem.contact_rows
        rows = np.empty(B.shape)
        for start in range(0, B.shape[0], RHS_BLOCK):
            block = B[start : start + RHS_BLOCK].T.toarray()
            rows[start : start + RHS_BLOCK] = problem.on_springs.factorization.solve(block).T
        return np.vstack([rows, problem.modes.N.T])

    def at(self, alpha: float) -> PathValues:
        """Values at alpha."""
        problem, smooth = self.problem, self._smooth
        (g0, dg), (F0, dF) = self._load, problem.affine_friction
        g, F = g0 + alpha * dg, F0 + alpha * dF
        if smooth is not None and smooth.F is not None and smooth.dF is not None:
            F, dF = _coefficients(smooth.F, alpha, "F", F.shape), _coefficients(smooth.dF, alpha, "dF", F.shape)
        if smooth is not None and smooth.f is not None and smooth.df is not None:
            offset = np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
            g = self._influence @ _evaluate(smooth.f, alpha, "f", (problem.n,))
            g[: len(offset)] -= offset
            dg = self._influence @ _evaluate(smooth.df, alpha, "df", (problem.n,))
        return PathValues(g, F, dg, dF)

    @cached_property
    def frictionless(self) -> Mask:
        """Nodes, in 3D nodes and axes, with F = 0 and dF = 0 at the start, assumed to stay without friction."""
        values = self.at(self._start)
        return np.asarray((values.F == 0) & (values.dF == 0))

    def _check_derivatives(self, smooth: SmoothPath, alpha: float) -> None:
        """Compare the derivatives with central differences at the start: a wrong one stalls the corrections later."""
        # near the cube root of the rounding unit, the best step of a central difference
        step = 1e-5 * max(abs(alpha), 1.0)
        for name, function, derivative, shape, evaluate in (
            ("F", smooth.F, smooth.dF, self.problem.affine_friction[0].shape, _coefficients),
            ("f", smooth.f, smooth.df, (self.problem.n,), _evaluate),
        ):
            if function is None or derivative is None:
                continue
            given = evaluate(derivative, alpha, f"d{name}", shape)
            ahead = evaluate(function, alpha + step, name, shape)
            behind = evaluate(function, alpha - step, name, shape)
            if not np.all(np.isfinite(ahead) & np.isfinite(behind)):
                continue  # the start lies on the border of the functions' domain
            scale = max(np.max(np.abs(given)), np.max(np.abs(ahead)) / max(abs(alpha), 1.0))
            error = np.max(np.abs(given - (ahead - behind) / (2 * step)))
            # wrong formulas differ by more than this share of the size
            if error > 1e-4 * scale:
                raise InvalidArgumentError(
                    f"SmoothPath.d{name} at alpha = {alpha:g} differs by {error:.2g} from a central difference of "
                    f"{name}; expected the derivative of {name} with respect to alpha"
                )


def _evaluate(function: PathFunction, alpha: float, name: str, shape: tuple[int, ...]) -> Floats:
    what = f"the value of SmoothPath.{name} at alpha = {alpha:g}"
    value = real_array(function(alpha), what, error=InvalidArgumentError, finite=False)
    if value.shape != shape:
        raise InvalidArgumentError(
            f"SmoothPath.{name} gives shape {value.shape} at alpha = {alpha:g}; expected {shape}"
        )
    return value


def _coefficients(function: PathFunction, alpha: float, name: str, shape: tuple[int, ...]) -> Floats:
    """Coefficients of all nodes, and in 3D of both axes, also where one number, or one for every node, is given."""

    def spread(given: float) -> Floats:
        what = f"the value of SmoothPath.{name} at alpha = {given:g}"
        value = real_array(function(given), what, error=InvalidArgumentError, finite=False)
        if value.ndim == 0:
            return np.full(shape, float(value))
        return np.column_stack([value, value]) if len(shape) == 2 and value.shape == shape[:1] else value

    return _evaluate(spread, alpha, name, shape)
