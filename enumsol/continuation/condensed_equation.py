"""The condensed equation H = 0 on which the continuation works (theory, sections 1.2, 8.1 and 8.12).

H is the residual of a contact problem; with it come its test functions and selections (theory, section 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import scipy.sparse as sp

from enumsol.continuation.scaled_equation import ScaledEquation
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.model.statuses import (
    ACROSS,
    CONDITIONS,
    FRICTIONLESS,
    OPEN,
    SIGNS,
    SLIP,
    SLIP_MINUS,
    SLIP_PLUS,
    STATUS_TOLERANCE,
    STICK,
    RowKind,
    active_within,
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
        """H(x, alpha), shape (n + 2p,)."""
        # P by its pieces: the sum min + max - trial would lose the bound's digits where r u_t is much larger
        return self._selected(self.test_functions(x, alpha) > 0, x, alpha)

    def selection_residual(self, signs: ArrayLike, x: ArrayLike, alpha: AlphaLike) -> Floats:
        """The selection function of H that ``signs`` (p, 3) names, at x; equals H where the test functions agree."""
        return self._selected(self._rows(signs), x, alpha)

    def _selected(self, rows: Mask, x: ArrayLike, alpha: AlphaLike) -> Floats:
        u, lambda_n, lambda_t = self.split(x)
        problem, r = self.problem, self.r
        closed, slips, count = pieces(rows)
        bound = problem.friction_at(alpha) * lambda_n
        u_n, u_t = problem.Bn @ u - problem.gap, problem.Bt @ u - problem.slip_offset
        return np.concatenate(
            [
                problem.A @ u + problem.Bn.T @ lambda_n + problem.Bt.T @ lambda_t - problem.load_at(alpha),
                np.where(closed, -r * u_n, lambda_n),
                (1 - count) * lambda_t - slips * bound - count * r * u_t,
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

    def active(self, x: Floats, tolerance: float = STATUS_TOLERANCE) -> tuple[frozenset[int], ...]:
        """Per node the status codes whose equations and conditions hold within the tolerance."""
        return active_within(self._row_values(x), ~self.frictionless, tolerance)

    def _codes(self, x: Floats) -> Codes:
        normal, upper, lower = self._test_functions(x, np.ones(2 * self.p)).T
        slips = np.where(upper + lower > 0, SLIP_PLUS, SLIP_MINUS)
        rubs = np.where((upper < 0) & (lower > 0), STICK, slips)
        return tuple(np.where(normal <= 0, OPEN, np.where(self.frictionless, FRICTIONLESS, rubs)).tolist())


@dataclass(frozen=True)
class _Cone:
    """Friction at one alpha: F = c q, c (p,) the mean coefficient of a node and q (p, 2), and derivatives."""

    c: Floats
    q: Floats
    dc: Floats
    dq: Floats


@dataclass(frozen=True)
class _Trial:
    """zeta, its length and its direction, (p, 2), (p,) and (p, 2), and lambda_t / q."""

    length: Floats
    direction: Floats
    force: Floats


class DiscEquation(ScaledEquation):
    """H in 3D: selections are named by rows (p, 2), whether a node is in contact and whether it slips.

    Parameters are those of ScaledEquation.
    """

    single_valued = False
    neighbours = MappingProxyType(
        {OPEN: ((SLIP, FRICTIONLESS),), STICK: ((SLIP,),), SLIP: ((OPEN,), (STICK,)), FRICTIONLESS: ((OPEN,),)}
    )

    # -- friction ----------------------------------------------------------------------------------------------------

    def _cone(self, x: Floats) -> _Cone:
        values, rubs = self.at(x), ~self.without
        count = np.maximum(np.sum(rubs, axis=1), 1)
        F, dF = np.where(rubs, values.F, 0.0), np.where(rubs, values.dF, 0.0)
        c, dc = np.sum(F, axis=1) / count, np.sum(dF, axis=1) / count
        # where c = 0 the coefficients vanish together, and keep their ratios
        some, part = np.where(c != 0, c, dc), np.where((c != 0)[:, None], F, dF)
        ratio = part / np.where(some != 0, some, 1.0)[:, None]
        q = np.where(rubs & (some != 0)[:, None], ratio, 1.0)
        dq = np.where(rubs & (c != 0)[:, None], (dF - q * dc[:, None]) / np.where(c != 0, c, 1.0)[:, None], 0.0)
        return _Cone(c, q, dc, dq)

    def _inverse(self, cone: _Cone) -> Floats:
        """1 / q of the components with friction, 0 of the others."""
        return np.where(self.without | (cone.q == 0), 0.0, 1.0 / np.where(cone.q != 0, cone.q, 1.0))

    def _trial(self, x: Floats, r: Floats, cone: _Cone) -> _Trial:
        slip, force = self.split(self.w(x))[1], self.split(x[:-1])[1] * self._inverse(cone)
        zeta = force + self.split(r)[1] * np.where(self.without, 0.0, cone.q * slip)
        length = np.linalg.norm(zeta, axis=1)
        return _Trial(length, zeta / np.where(length > 0, length, 1.0)[:, None], force)

    # -- H and its selections ----------------------------------------------------------------------------------------

    def _projected(self, x: Floats, r: Floats) -> Floats:
        """lambda - P(lambda + r w), P into lambda_n >= 0 and the disc of that lambda_n, in units of q."""
        cone = self._cone(x)
        trial, (normal, tangential), (w_n, w_t) = self._trial(x, r, cone), self.split(x[:-1]), self.split(self.w(x))
        (r_n, r_t), rubs = self.split(r), self._inverse(cone) != 0
        most = np.maximum(normal + r_n * w_n, 0.0)
        radius = cone.c * most
        inside = trial.length <= radius
        left = np.where(inside[:, None], -r_t * cone.q * w_t, trial.force - radius[:, None] * trial.direction)
        found = _flat(np.where(most > 0, -r_n * w_n, normal), np.where(rubs, cone.q * left, tangential))
        return np.append(found, -self.left(x))

    def selection_at(self, x: Floats) -> Mask:
        """Rows of the selection that is active at x, shape (p, 2)."""
        cone = self._cone(x)
        normal = self.split(x[: self.m] + self.r * self.w(x))[0]
        slips = self._trial(x, self.r, cone).length > cone.c * np.maximum(normal, 0.0)
        return np.column_stack([normal > 0, slips & ~self.frictionless])

    def selection(self, codes: Codes) -> Mask:
        """Rows of the selection in which the nodes have these statuses, shape (p, 2)."""
        named = np.array(codes)
        return np.column_stack([named != OPEN, named == SLIP])

    def selection_residual(self, rows: Mask, x: Floats) -> Floats:
        """The named selection function of H, shape (3p + r,)."""
        (normal, tangential), (w_n, w_t) = self.split(x[:-1]), self.split(self.w(x))
        closed, slips = rows[:, 0], (rows[:, 0] & rows[:, 1])[:, None]
        direction = self._trial(x, self.r, self._cone(x)).direction
        held = np.where(slips, tangential - normal[:, None] * self.at(x).F * direction, -w_t)
        free = ~closed[:, None] | self.without
        return np.append(_flat(np.where(closed, -w_n, normal), np.where(free, tangential, held)), -self.left(x))

    def jacobian(self, rows: Mask, x: Floats) -> Floats:
        """Gradient of the named selection function (see selection_residual), shape (3p + r, 3p + r + 1)."""
        p, values, cone = self.p, self.at(x), self._cone(x)
        closed, slips = rows[:, 0], (rows[:, 0] & rows[:, 1])[:, None, None]
        dw_n, dw_t = _parted(self._slopes(x))
        (dn, dt), node = _parted(np.eye(3 * p, len(x))), np.arange(p)
        direction, turned = self._turning(x, cone, dw_t, dt)
        slip = dt - (x[:p, None] * values.F)[:, :, None] * turned
        slip[node, :, node] -= values.F * direction
        slip[:, :, -1] -= x[:p, None] * values.dF * direction
        held = np.where(slips, slip, -dw_t)
        free = ~closed[:, None] | self.without
        tangential = np.where(free[:, :, None], dt, held)
        rest = np.column_stack([self.bordered[self.m :], -values.dg[self.m :]])
        return np.concatenate([np.where(closed[:, None], -dw_n, dn), tangential[:, 0], tangential[:, 1], rest])

    def _turning(self, x: Floats, cone: _Cone, dw_t: Floats, dt: Floats) -> tuple[Floats, Floats]:
        """Directions of slip, (p, 2), and their gradients, (p, 2, 3p + r + 1)."""
        trial, r, inverse = self._trial(x, self.r, cone), self.split(self.r)[1], self._inverse(cone)
        slip = self.split(self.w(x))[1]
        moved = inverse[:, :, None] * dt + np.where(self.without, 0.0, r * cone.q)[:, :, None] * dw_t
        moved[:, :, -1] += np.where(self.without, 0.0, r * slip * cone.dq) - trial.force * inverse * cone.dq
        d = trial.direction
        across = moved - d[:, :, None] * np.einsum("ik,ikj->ij", d, moved)[:, None]
        with np.errstate(divide="ignore"):
            return d, across * np.where(trial.length > 0, 1.0 / trial.length, 0.0)[:, None, None]

    # -- statuses and their conditions -------------------------------------------------------------------------------

    def _room(self, x: Floats, cone: _Cone) -> tuple[Floats, Floats]:
        """c lambda_n - |lambda_t / q| over 1 + c, (p,), and the direction of lambda_t / q."""
        force = self.split(x[:-1])[1] * self._inverse(cone)
        size = np.linalg.norm(force, axis=1)
        return (cone.c * x[: self.p] - size) / (1.0 + cone.c), force / np.where(size > 0, size, 1.0)[:, None]

    def slacks(self, codes: Codes, x: Floats) -> Floats:
        """Values that are >= 0 where the statuses hold, shape (p, 2); infinite where there is one condition."""
        named, cone, (w_n, w_t) = np.array(codes), self._cone(x), self.split(self.w(x))
        along = np.sum(self._trial(x, self.r, cone).direction * cone.q * w_t, axis=1)
        first = np.select([named == OPEN, named == STICK], [-w_n, self._room(x, cone)[0]], x[: self.p])
        return np.column_stack([first, np.where(named == SLIP, along, np.inf)])

    def slack_gradients(self, codes: Codes, x: Floats) -> Floats:
        """Gradients of all slacks, shape (p, 2, 3p + r + 1), 0 where there is one condition."""
        p, named, cone = self.p, np.array(codes), self._cone(x)
        dw_n, dw_t = _parted(self._slopes(x))
        (dn, dt), node = _parted(np.eye(3 * p, len(x))), np.arange(p)
        found = np.zeros((p, 2, len(x)))
        found[:, 0] = np.where((named == OPEN)[:, None], -dw_n, dn)
        room, towards = self._room(x, cone)
        inverse, tangential = self._inverse(cone), self.split(x[:-1])[1]
        stick = -np.einsum("ik,ikj->ij", towards * inverse, dt)
        stick[node, node] += cone.c
        stick[:, -1] += cone.dc * (x[:p] - room) + np.sum(towards * tangential * inverse**2 * cone.dq, axis=1)
        found[:, 0] = np.where((named == STICK)[:, None], stick / (1.0 + cone.c)[:, None], found[:, 0])
        direction, turned = self._turning(x, cone, dw_t, dt)
        slip = self.split(self.w(x))[1]
        along = np.einsum("ik,ikj->ij", direction * cone.q, dw_t) + np.einsum("ik,ikj->ij", cone.q * slip, turned)
        along[:, -1] += np.sum(direction * cone.dq * slip, axis=1)
        found[:, 1] = np.where((named == SLIP)[:, None], along, 0.0)
        return found

    def active(self, x: Floats, tolerance: float = STATUS_TOLERANCE) -> tuple[frozenset[int], ...]:
        """Per node the status codes whose equations and conditions hold within the tolerance."""
        found: list[set[int]] = [set() for _ in range(self.p)]
        for code in (OPEN, STICK, SLIP, FRICTIONLESS):
            codes = (code,) * self.p
            broken = np.abs(self.selection_residual(self.selection(codes), x)[: self.m]).reshape(3, -1)
            broken[1:] /= 1.0 + np.max(np.abs(self.at(x).F), axis=1)
            least = np.min(self.slacks(codes, x), axis=1)
            least = least if code == OPEN else np.minimum(least, x[: self.p])
            fits = self.frictionless if code == FRICTIONLESS else ~self.frictionless if code != OPEN else True
            holds = fits & np.all(broken <= tolerance, axis=0) & (least >= -tolerance)
            for i in np.flatnonzero(holds):
                found[i].add(code)
        return tuple(map(frozenset, found))

    def _codes(self, x: Floats) -> Codes:
        ones, cone = np.ones(3 * self.p), self._cone(x)
        normal = x[: self.p] + self.w(x)[: self.p]
        slips = self._trial(x, ones, cone).length >= cone.c * np.maximum(normal, 0.0)
        touching = np.where(self.frictionless, FRICTIONLESS, np.where(slips, SLIP, STICK))
        return tuple(np.where(normal > 0, touching, OPEN).tolist())


def _flat(normal: Floats, tangential: Floats) -> Floats:
    """Normal and tangential parts, (p,) and (p, 2), as one array (3p,), all normals first."""
    return np.concatenate([normal, tangential[:, 0], tangential[:, 1]])


def _parted(rows: Floats) -> tuple[Floats, Floats]:
    """Rows (3p, k) as those of normals, (p, k), and of both tangents, (p, 2, k)."""
    normal, first, second = rows.reshape(3, -1, rows.shape[1])
    return normal, np.stack([first, second], axis=1)
