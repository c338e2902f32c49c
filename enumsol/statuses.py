"""Statuses, sign arrays, test functions and the piecewise smooth residual H with its selections (theory, 1-2)."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from enumsol.problem import Alpha, ContactProblem


class ContactStatus(enum.Enum):
    """What a contact node does: it is open, it sticks, or it slips in the positive or negative direction."""

    OPEN = "open"
    STICK = "stick"
    SLIP_PLUS = "slip+"
    SLIP_MINUS = "slip-"

    def __repr__(self) -> str:
        return f"ContactStatus.{self.name}"

    def __str__(self) -> str:
        return self.value


#: Statuses in the order of their integer codes 0..3; a root at which several hold shows the first.
STATUSES = (ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP_PLUS, ContactStatus.SLIP_MINUS)
OPEN, STICK, SLIP_PLUS, SLIP_MINUS = range(4)
#: Inside the searches a node with F = 0 that is in contact: lambda_t = 0 and u_t free (theory, section 2).
FRICTIONLESS = 4

_SIGNS = {
    ContactStatus.OPEN: (-1, -1, -1),
    ContactStatus.STICK: (1, -1, 1),
    ContactStatus.SLIP_PLUS: (1, 1, 1),
    ContactStatus.SLIP_MINUS: (1, -1, -1),
}


def sign_array(statuses: Sequence[ContactStatus]) -> NDArray[np.int8]:
    """Signs of the test functions that name the selection of ``statuses``, shape (p, 3) (theory, table of section 2).

    At an open node theta2 = theta3 at a root and their sign does not matter; (-, -, -) is returned.
    """
    return np.array([_SIGNS[status] for status in statuses], dtype=np.int8).reshape(-1, 3)


@dataclass(frozen=True)
class PiecewiseSmoothEquation:
    """The equation H(x) = 0 of a contact problem, x = (u, lambda_n, lambda_t) at a parameter alpha (theory, section 1).

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
    """

    problem: ContactProblem
    r: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.r) and self.r > 0):
            raise InvalidArgumentError(f"r is {self.r}; expected a positive finite number")

    @property
    def size(self) -> int:
        """Number of unknowns and equations, n + 2p."""
        return self.problem.n + 2 * self.problem.p

    def split(self, x: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """u (n,), lambda_n (p,) and lambda_t (p,) as parts of x (n + 2p,)."""
        n, p = self.problem.n, self.problem.p
        array = np.asarray(x, dtype=np.float64)
        if array.shape != (n + 2 * p,):
            raise InvalidArgumentError(f"x has shape {array.shape}; expected (n + 2p,) = ({n + 2 * p},)")
        return array[:n], array[n : n + p], array[n + p :]

    def test_functions(self, x: ArrayLike, alpha: Alpha) -> NDArray[np.float64]:
        """theta1 = lambda_n + r u_n and theta2, theta3 = lambda_t + r u_t -+ F lambda_n, shape (p, 3)."""
        u, lambda_n, lambda_t = self.split(x)
        problem = self.problem
        bound = problem.friction_at(alpha) * lambda_n
        trial = lambda_t + self.r * (problem.Bt @ u - problem.slip_offset)
        return np.column_stack([lambda_n + self.r * (problem.Bn @ u - problem.gap), trial - bound, trial + bound])

    def signs(self, x: ArrayLike, alpha: Alpha) -> NDArray[np.int8]:
        """Signs in {-1, 0, 1} of the test functions, shape (p, 3)."""
        return np.sign(self.test_functions(x, alpha)).astype(np.int8)

    def residual(self, x: ArrayLike, alpha: Alpha) -> NDArray[np.float64]:
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

    def selection_residual(self, signs: ArrayLike, x: ArrayLike, alpha: Alpha) -> NDArray[np.float64]:
        """The selection function of H that ``signs`` (p, 3) names, at x; equals H where the test functions agree."""
        u, lambda_n, lambda_t = self.split(x)
        problem, r = self.problem, self.r
        closed, upper, lower = self._pieces(signs)
        bound = problem.friction_at(alpha) * lambda_n
        u_n, u_t = problem.Bn @ u - problem.gap, problem.Bt @ u - problem.slip_offset
        # P = [bound or trial] + [trial or -bound] - trial
        low = np.where(upper, bound, 0.0) + np.where(lower, 0.0, -bound)
        count = np.where(upper, 0, 1) + np.where(lower, 1, 0) - 1
        return np.concatenate(
            [
                self._equilibrium(u, lambda_n, lambda_t, alpha),
                np.where(closed, -r * u_n, lambda_n),
                lambda_t - low - count * (lambda_t + r * u_t),
            ]
        )

    def selection_jacobian(self, signs: ArrayLike, x: ArrayLike, alpha: Alpha) -> sp.csc_array:
        """Jacobian of the named selection with respect to (x, alpha), sparse (n + 2p, n + 2p + 1)."""
        _, lambda_n, _ = self.split(x)
        problem, r = self.problem, self.r
        closed, upper, lower = self._pieces(signs)
        F, slope = problem.friction_at(alpha), problem.friction[1]
        slips = upper.astype(float) - np.where(lower, 0.0, 1.0)
        count = np.where(upper, 0, 1) + np.where(lower, 1, 0) - 1
        load = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
        p, diag = problem.p, sp.diags_array
        column = np.concatenate([-load, np.zeros(p), -slips * slope * lambda_n])
        blocks = [
            [problem.A, problem.Bn.T, problem.Bt.T],
            [diag(np.where(closed, -r, 0.0)) @ problem.Bn, diag(np.where(closed, 0.0, 1.0)), sp.csr_array((p, p))],
            [diag(-r * count.astype(float)) @ problem.Bt, diag(-slips * F), diag(1.0 - count.astype(float))],
        ]
        return sp.csc_array(
            sp.hstack([sp.block_array(blocks, format="csc"), sp.csc_array(column[:, None])], format="csc")
        )

    def _pieces(self, signs: ArrayLike) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
        array = np.asarray(signs)
        if array.shape != (self.problem.p, 3) or not np.all(np.isin(array, (-1, 1))):
            raise InvalidArgumentError(
                f"signs has shape {array.shape}; expected (p, 3) = ({self.problem.p}, 3) with entries -1 or 1"
            )
        return array[:, 0] > 0, array[:, 1] > 0, array[:, 2] > 0

    def _equilibrium(
        self, u: NDArray[np.float64], lambda_n: NDArray[np.float64], lambda_t: NDArray[np.float64], alpha: Alpha
    ) -> NDArray[np.float64]:
        problem = self.problem
        return np.asarray(
            problem.A @ u + problem.Bn.T @ lambda_n + problem.Bt.T @ lambda_t - problem.load_at(alpha), dtype=np.float64
        )


def selection_systems(
    S: NDArray[np.float64], g: NDArray[np.float64], F: NDArray[np.float64], codes: NDArray[np.int8]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Linear systems M lambda = b of condensed selections (theory, section 2, with w = g - S lambda).

    Parameters
    ----------
    S, g, F : condensed compliance (2p, 2p), displacements (2p,) and friction (p,)
    codes : (k, p) integer array of status codes

    Returns
    -------
    M : (k, 2p, 2p) array
    b : (k, 2p) array
        Rows: lambda_n = 0 and lambda_t = 0 (open); w_n = 0 and w_t = 0 (stick); w_n = 0 and lambda_t = +-F lambda_n.
    """
    k, p = codes.shape
    node = np.arange(p)
    closed, stick = codes != OPEN, codes == STICK
    slip = np.where(codes == SLIP_PLUS, 1.0, 0.0) - np.where(codes == SLIP_MINUS, 1.0, 0.0)
    M = np.zeros((k, 2 * p, 2 * p))
    held = np.concatenate([closed, stick], axis=1)
    M += held[:, :, None] * S
    M[:, np.arange(2 * p), np.arange(2 * p)] += ~held
    M[:, p + node, node] -= slip * F
    return M, held * g
