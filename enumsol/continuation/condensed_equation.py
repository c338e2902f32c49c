"""The condensed equation H = 0 in 2D, on which the continuation works (theory, sections 1.2 and 8.1).

H is the residual of a contact problem; with it come its test functions and selections (theory, section 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import scipy.sparse as sp

from enumsol.continuation.scaled_equation import STATUS_TOLERANCE, ScaledEquation
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.model.statuses import (
    ACROSS,
    CONDITIONS,
    FRICTIONLESS,
    OPEN,
    SIGNS,
    SLIP_MINUS,
    SLIP_PLUS,
    STICK,
    ContactStatus,
    RowKind,
    active_within,
    contact_status,
)
from enumsol.support.arguments import instance_of, positive_number
from enumsol.support.array_arguments import plain_array, real_array
from enumsol.support.array_types import AlphaLike, ArrayLike, Codes, Floats, Mask, NDArray
from enumsol.trusted.selection import row_values


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

    def split(self, x: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """u (n,), lambda_n (p,) and lambda_t (p,) as parts of x (n + 2p,)."""
        n, p = self.problem.n, self.problem.p
        array = real_array(x, "x", error=InvalidArgumentError, finite=False)
        if array.shape != (n + 2 * p,):
            raise InvalidArgumentError(f"x has shape {array.shape}; expected (n + 2p,) = ({n + 2 * p},)")
        return array[:n], array[n : n + p], array[n + p :]

    def test_functions(self, x: ArrayLike, alpha: AlphaLike) -> Floats:
        """theta1 = lambda_n + r u_n and theta2, theta3 = lambda_t + r u_t -+ F lambda_n, shape (p, 3)."""
        u, lambda_n, lambda_t = self.split(x)
        problem = self.problem
        bound = problem.friction_at(alpha) * lambda_n
        trial = lambda_t + self.r * (problem.Bt @ u - problem.slip_offset)
        return np.column_stack([lambda_n + self.r * (problem.Bn @ u - problem.gap), trial - bound, trial + bound])

    def signs(self, x: ArrayLike, alpha: AlphaLike) -> NDArray[np.int8]:
        """Signs in {-1, 0, 1} of the test functions, shape (p, 3)."""
        return np.sign(self.test_functions(x, alpha)).astype(np.int8)

    def residual(self, x: ArrayLike, alpha: AlphaLike) -> Floats:
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

    def selection_residual(self, signs: ArrayLike, x: ArrayLike, alpha: AlphaLike) -> Floats:
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
        F, slope = problem.friction_at(alpha), problem.friction_slope
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

    def _rows(self, signs: ArrayLike) -> Mask:
        array = plain_array(signs, "signs", error=InvalidArgumentError)
        if array.shape != (self.problem.p, 3) or not np.all(np.isin(array, (-1, 1))):
            raise InvalidArgumentError(
                f"signs has shape {array.shape}; expected (p, 3) = ({self.problem.p}, 3) with entries -1 or 1"
            )
        return np.asarray(array > 0)

    def _equilibrium(self, u: Floats, lambda_n: Floats, lambda_t: Floats, alpha: AlphaLike) -> Floats:
        problem = self.problem
        return np.asarray(
            problem.A @ u + problem.Bn.T @ lambda_n + problem.Bt.T @ lambda_t - problem.load_at(alpha), dtype=np.float64
        )


def pieces(rows: Mask) -> tuple[Mask, Floats, Floats]:
    """Pieces of P that a selection takes, by the signs of its test functions, shape (p, 3), True where one is positive.

    Contact, the slip sign, and how often lambda_t + r u_t enters P: with P = [bound or trial] + [trial or -bound] -
    trial (1 for stick, 0 for slip, -1 for the fourth piece).
    """
    closed, upper, lower = rows[:, 0], rows[:, 1], rows[:, 2]
    slips = upper.astype(float) - (~lower).astype(float)
    return closed, slips, lower.astype(float) - upper.astype(float)


#: Rows of the inequalities of every status, -1 where there is one only; and those over 1 + F.
_KINDS = np.array([[*CONDITIONS[code].inequalities, -1][:2] for code in SIGNS])
_CONES = [RowKind.CONE_PLUS, RowKind.CONE_MINUS]


class CondensedEquation(ScaledEquation):
    """H in 2D: selections are named by sign rows (p, 3), True where a test function is positive.

    Parameters are those of ScaledEquation.
    """

    single_valued = True
    neighbours = MappingProxyType(
        {code: [[other for other, _ in ACROSS[code, kind]] for kind in CONDITIONS[code].inequalities] for code in SIGNS}
    )

    # -- H and its selections ----------------------------------------------------------------------------------------

    def test_functions(self, x: Floats) -> Floats:
        """theta1, theta2, theta3 as columns, shape (p, 3): their signs depend on the r of H."""
        return self._test_functions(x, self.r)

    def _test_functions(self, x: Floats, r: Floats) -> Floats:
        p = self.p
        trial = x[: self.m] + r * self.w(x)
        bound = self.at(x).F * x[:p]
        return np.column_stack([trial[:p], trial[p:] - bound, trial[p:] + bound])

    def selection_at(self, x: Floats) -> Mask:
        """Sign rows of the selection that is active at x, shape (p, 3)."""
        return np.asarray(self.test_functions(x) > 0)

    def _projected(self, x: Floats, r: Floats) -> Floats:
        """H(x), piece by piece: no digits of w are lost where r is small, nor of lambda where it is large."""
        p, w = self.p, self.w(x)
        closed, slips, count = pieces(self._test_functions(x, r) > 0)
        bound = self.at(x).F * x[:p]
        tangential = (1 - count) * x[p : 2 * p] - slips * bound - count * r[p:] * w[p:]
        return np.concatenate([np.where(closed, -r[:p] * w[:p], x[:p]), tangential, -self.left(x)])

    def selection(self, codes: Codes) -> Mask:
        """Sign rows of the selection in which the nodes have these statuses, shape (p, 3)."""
        return np.array([SIGNS[code] for code in codes]).reshape(-1, 3) > 0

    def selection_residual(self, rows: Mask, x: Floats) -> Floats:
        """The named selection function of H, shape (2p + r,), its rows scaled by positive factors to size one."""
        p = self.p
        closed, slips, count = pieces(rows)
        lengths, forces = self._shares(count)
        w = self.w(x)
        normal = np.where(closed, -w[:p], x[:p])
        bound = self.at(x).F * x[:p]
        return np.concatenate([normal, forces * x[p : 2 * p] - slips * bound - lengths * w[p:], -self.left(x)])

    def _shares(self, count: Floats) -> tuple[Floats, Floats]:
        """Factors of w_t and lambda_t in the tangential rows; only the fourth piece, 2 lambda_t + r w_t, needs r."""
        r = self.r[self.p :]
        fourth = count < 0
        scale = np.where(fourth, 2.0 / (1.0 + r), 1.0)
        return np.where(fourth, -r * scale, count), (1 - count) * scale

    def jacobian(self, rows: Mask, x: Floats) -> Floats:
        """Gradient of the named selection function (see selection_residual), shape (2p + r, 2p + r + 1)."""
        p, values = self.p, self.at(x)
        closed, slips, count = pieces(rows)
        lengths, forces = self._shares(count)
        share = np.concatenate([closed.astype(float), lengths, np.ones(self.modes)])
        J = np.empty((len(share), len(share) + 1))
        J[:, :-1] = share[:, None] * self.bordered
        node = np.arange(p)
        J[node, node] += ~closed
        J[p + node, p + node] += forces
        J[p + node, node] -= slips * values.F
        J[:, -1] = -share * values.dg
        J[p : 2 * p, -1] -= slips * values.dF * x[:p]
        return J

    # -- statuses and their conditions -------------------------------------------------------------------------------

    def _row_values(self, x: Floats) -> Floats:
        """Values of all rows in the order of RowKind, those of the cone over 1 + F, shape (7, p)."""
        F = self.at(x).F
        rows: Floats = row_values(x[: self.m], self.w(x), F)
        rows[_CONES] /= 1.0 + F
        return rows

    def _of_inequalities(self, codes: Codes, rows: Floats, missing: float) -> Floats:
        kinds = _KINDS[np.array(codes, dtype=np.intp)]
        found: Floats = rows[kinds, np.arange(self.p)[:, None]]
        found[kinds < 0] = missing
        return found

    def slacks(self, codes: Codes, x: Floats) -> Floats:
        """Values that are >= 0 where the statuses hold, shape (p, 2); infinite where there is one condition."""
        return self._of_inequalities(codes, self._row_values(x), np.inf)

    def slack_gradients(self, codes: Codes, x: Floats) -> Floats:
        """Gradients of all slacks with respect to x, shape (p, 2, 2p + r + 1); zero where there is one condition."""
        p, values = self.p, self.at(x)
        rows: Floats = row_values(np.eye(self.m, len(x)), self._slopes(x), values.F[:, None])
        rows[_CONES, :, -1] += values.dF * (x[:p] - self._row_values(x)[_CONES])
        rows[_CONES] /= 1.0 + values.F[:, None]
        return self._of_inequalities(codes, rows, 0.0)

    def _touching(self, i: int, x: Floats) -> int:
        return SLIP_PLUS if self.w(x)[self.p + i] > 0 else SLIP_MINUS

    def active(self, x: Floats, tolerance: float = STATUS_TOLERANCE) -> tuple[frozenset[int], ...]:
        """Per node the status codes whose equations and conditions hold within the tolerance."""
        return active_within(self._row_values(x), ~self.frictionless, tolerance)

    def _codes(self, x: Floats) -> Codes:
        normal, upper, lower = self._test_functions(x, np.ones(2 * self.p)).T
        slips = np.where(upper + lower > 0, SLIP_PLUS, SLIP_MINUS)
        rubs = np.where((upper < 0) & (lower > 0), STICK, slips)
        return tuple(np.where(normal <= 0, OPEN, np.where(self.frictionless, FRICTIONLESS, rubs)).tolist())

    def statuses(self, codes: Sequence[int], slip: Floats) -> tuple[ContactStatus, ...]:
        """Names of the statuses; a frictionless node in contact is named by the sign of its u_t."""
        return tuple(contact_status(code, float(u)) for code, u in zip(codes, slip, strict=True))
