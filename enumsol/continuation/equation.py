"""The residual H of a contact problem with its test functions and selections (theory, sections 1 and 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.support.arguments import instance_of, positive_number
from enumsol.support.array_arguments import plain_array, real_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from enumsol.support.arguments import AlphaLike


@dataclass(frozen=True)
class PiecewiseSmoothEquation:
    """The equation H(x) = 0 of a contact problem, x = (u, lambda_n, lambda_t) at a parameter alpha (theory, (1.5)).

    The third block uses P(x) = min(b, x) + max(a, x) - x with a = -F lambda_n and b = F lambda_n, which stays piecewise
    linear and continuous where lambda_n < 0 and the interval turns around.

    Parameters
    ----------
    problem : ContactProblem
    r : float
        The positive parameter of the projections [force / length]; roots do not depend on it.

    Raises
    ------
    InvalidArgumentError
        r is not a positive finite number.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> equation = enumsol.PiecewiseSmoothEquation(problem)
    >>> root = enumsol.newton(problem, 5)
    >>> x = [*root.u, *root.lambda_n, *root.lambda_t]
    >>> bool(abs(equation.residual(x, 5)).max() < 1e-12)
    True
    >>> equation.signs(x, 5).tolist()  # open
    [[-1, -1, -1]]
    """

    problem: ContactProblem
    r: float = 1.0

    def __post_init__(self) -> None:
        instance_of(self.problem, ContactProblem, "problem")
        object.__setattr__(self, "r", positive_number(self.r, "r"))

    @property
    def size(self) -> int:
        """Number of unknowns and equations, n + 2p."""
        return self.problem.n + 2 * self.problem.p

    def split(self, x: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """u (n,), lambda_n (p,) and lambda_t (p,) as parts of x (n + 2p,)."""
        n, p = self.problem.n, self.problem.p
        array = real_array(x, "x", error=InvalidArgumentError, finite=False)
        if array.shape != (n + 2 * p,):
            raise InvalidArgumentError(f"x has shape {array.shape}; expected (n + 2p,) = ({n + 2 * p},)")
        return array[:n], array[n : n + p], array[n + p :]

    def test_functions(self, x: ArrayLike, alpha: AlphaLike) -> NDArray[np.float64]:
        """theta1 = lambda_n + r u_n and theta2, theta3 = lambda_t + r u_t -+ F lambda_n, shape (p, 3)."""
        u, lambda_n, lambda_t = self.split(x)
        problem = self.problem
        bound = problem.friction_at(alpha) * lambda_n
        trial = lambda_t + self.r * (problem.Bt @ u - problem.slip_offset)
        return np.column_stack([lambda_n + self.r * (problem.Bn @ u - problem.gap), trial - bound, trial + bound])

    def signs(self, x: ArrayLike, alpha: AlphaLike) -> NDArray[np.int8]:
        """Signs in {-1, 0, 1} of the test functions, shape (p, 3)."""
        return np.sign(self.test_functions(x, alpha)).astype(np.int8)

    def residual(self, x: ArrayLike, alpha: AlphaLike) -> NDArray[np.float64]:
        """H(x, alpha), shape (n + 2p,), evaluated from the projections themselves."""
        u, lambda_n, lambda_t = self.split(x)
        problem, r = self.problem, self.r
        bound = problem.friction_at(alpha) * lambda_n
        trial = lambda_t + r * (problem.Bt @ u - problem.slip_offset)
        # P by its pieces: the sum min + max - trial would lose the bound's digits where r u_t is much larger
        inside = np.clip(trial, -np.abs(bound), np.abs(bound))
        projected = np.where(bound >= 0, inside, -inside)
        return np.concatenate(
            [
                self._equilibrium(u, lambda_n, lambda_t, alpha),
                lambda_n - np.maximum(0.0, lambda_n + r * (problem.Bn @ u - problem.gap)),
                lambda_t - projected,
            ]
        )

    def selection_residual(self, signs: ArrayLike, x: ArrayLike, alpha: AlphaLike) -> NDArray[np.float64]:
        """The selection function of H that ``signs`` (p, 3) names, at x; equals H where the test functions agree."""
        u, lambda_n, lambda_t = self.split(x)
        problem, r = self.problem, self.r
        closed, slips, count = pieces(self._rows(signs))
        bound = problem.friction_at(alpha) * lambda_n
        u_n, u_t = problem.Bn @ u - problem.gap, problem.Bt @ u - problem.slip_offset
        return np.concatenate(
            [
                self._equilibrium(u, lambda_n, lambda_t, alpha),
                np.where(closed, -r * u_n, lambda_n),
                lambda_t - slips * bound - count * (lambda_t + r * u_t),
            ]
        )

    def selection_jacobian(self, signs: ArrayLike, x: ArrayLike, alpha: AlphaLike) -> sp.csc_array:
        """Jacobian of the named selection with respect to (x, alpha), sparse (n + 2p, n + 2p + 1)."""
        _, lambda_n, _ = self.split(x)
        problem, r = self.problem, self.r
        closed, slips, count = pieces(self._rows(signs))
        F, slope = problem.friction_at(alpha), problem.friction[1]
        load = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        p, diag = problem.p, sp.diags_array
        column = np.concatenate([-load, np.zeros(p), -slips * slope * lambda_n])
        blocks = [
            [problem.A, problem.Bn.T, problem.Bt.T],
            [diag(np.where(closed, -r, 0.0)) @ problem.Bn, diag(np.where(closed, 0.0, 1.0)), sp.csr_array((p, p))],
            [diag(-r * count) @ problem.Bt, diag(-slips * F), diag(1.0 - count)],
        ]
        return sp.csc_array(
            sp.hstack([sp.block_array(blocks, format="csc"), sp.csc_array(column[:, None])], format="csc")
        )

    def _rows(self, signs: ArrayLike) -> NDArray[np.bool_]:
        array = plain_array(signs, "signs", error=InvalidArgumentError)
        if array.shape != (self.problem.p, 3) or not np.all(np.isin(array, (-1, 1))):
            raise InvalidArgumentError(
                f"signs has shape {array.shape}; expected (p, 3) = ({self.problem.p}, 3) with entries -1 or 1"
            )
        return np.asarray(array > 0)

    def _equilibrium(
        self, u: NDArray[np.float64], lambda_n: NDArray[np.float64], lambda_t: NDArray[np.float64], alpha: AlphaLike
    ) -> NDArray[np.float64]:
        problem = self.problem
        return np.asarray(
            problem.A @ u + problem.Bn.T @ lambda_n + problem.Bt.T @ lambda_t - problem.load_at(alpha), dtype=np.float64
        )


def pieces(rows: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """What a selection takes, by the signs of its test functions, shape (p, 3), True where one is positive.

    Contact, the slip sign, and how often lambda_t + r u_t enters P: with P = [bound or trial] + [trial or -bound] -
    trial (1 for stick, 0 for slip, -1 for the fourth piece).
    """
    closed, upper, lower = rows[:, 0], rows[:, 1], rows[:, 2]
    slips = upper.astype(float) - (~lower).astype(float)
    return closed, slips, lower.astype(float) - upper.astype(float)
