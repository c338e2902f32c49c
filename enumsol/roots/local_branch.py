"""Local branches through roots: coherent orientation of the normal map (theory, (3.3)), derivatives, signs of slip."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import CondensedProblem, condensation_of
from enumsol.condensation.data import EXACT_DOF_LIMIT
from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.model.statuses import (
    FRICTIONLESS,
    OPEN,
    SLIP,
    SLIP_MINUS,
    SLIP_PLUS,
    STATUSES,
    STICK,
    ContactStatus,
    contact_status,
    space_status,
)
from enumsol.selections.solution import RANK_TOLERANCE
from enumsol.support.array_types import Alpha, Codes, Floats
from enumsol.support.immutable import Sealed
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from enumsol.model.problem3d import AnyProblem
    from enumsol.selections.float_selections import FloatSelections
    from enumsol.selections.solution import ActiveSets
    from enumsol.support.array_types import Indices

#: Selections examined at one point (paper, Remark 5.1); six nodes in a corner of three statuses have 729.
MAX_SELECTIONS = 4096
#: In place of ``RANK_TOLERANCE`` at transition points of a path, whose alpha is located to about 1e-10.
LOCATED_TOLERANCE = 1e-8
#: Codes of statuses, in 3D that of slip in any direction.
STATUS_CODES = {status: code for code, status in enumerate(STATUSES)} | {ContactStatus.SLIP: SLIP}


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactState(Sealed):
    """Statuses, forces and displacements of all contact nodes at a solution.

    Attributes
    ----------
    alpha : float or Fraction
    statuses : tuple of p ContactStatus
        Where several hold, the first of OPEN, STICK, SLIP_PLUS, SLIP_MINUS; in 3D of OPEN, STICK, SLIP.
    active : tuple of p frozensets of ContactStatus
        All statuses that hold at the node.
    lambda_n, lambda_t : (p,) arrays; in 3D lambda_t is (p, 2), along the local axes
        Contact forces on the nodes (nodal forces, not pressures) [force].
    u_n, u_t : arrays of the same shapes
        Bn u - gap <= 0 and Bt u - slip_offset [length].
    """

    alpha: Alpha
    statuses: tuple[ContactStatus, ...]
    active: tuple[frozenset[ContactStatus], ...]
    lambda_n: Floats
    lambda_t: Floats
    u_n: Floats
    u_t: Floats


@dataclass(frozen=True)
class LocalBranchTest:
    """Answer of the local branch test at one root.

    The contact forces are a Lipschitz function of the load near the root, at fixed friction, exactly when the
    determinants of the normal map have one and the same sign, not zero, over all statuses that hold there. By
    paper, Theorem 4.1, they then are one of the friction coefficients too, provided that F > 0 at every node. Of a body
    that nothing holds so is its rigid displacement; whether it is within its bound plays no part.

    Attributes
    ----------
    exists : bool
        A local Lipschitz branch in the load exists.
    premise : bool
        F > 0 at every node: the premise of the paper's Theorem 4.1 for a branch in F.
    signs : tuple of (statuses, sign)
        Every selection that holds at the root with the sign of its determinant: +1, -1 or 0.
    differing : tuple of tuples of ContactStatus
        The selections whose sign is zero or differs from that of the first; empty when the branch exists.
    """

    exists: bool
    premise: bool
    signs: tuple[tuple[tuple[ContactStatus, ...], int], ...]
    differing: tuple[tuple[ContactStatus, ...], ...]

    @classmethod
    def from_signs(cls, signs: tuple[tuple[tuple[ContactStatus, ...], int], ...], *, premise: bool) -> LocalBranchTest:
        """The answer that these signs give."""
        first = signs[0][1] if signs else 0
        differing = tuple(statuses for statuses, sign in signs if sign == 0 or sign != first)
        return cls(bool(signs) and not differing, premise, signs, differing)

    def __str__(self) -> str:
        answer = "a local Lipschitz branch exists" if self.exists else "no local Lipschitz branch"
        detail = f"{counted(len(self.signs), 'selection holds', 'selections hold')}"
        if not self.exists:
            detail += f", the sign of {len(self.differing)} of them differs or is zero"
        premise = "" if self.premise else "; F = 0 at some node, so Theorem 4.1 does not carry it over to F"
        return f"{answer} in the load ({detail}){premise}"


def local_branch_test(problem: AnyProblem, root: ContactState) -> LocalBranchTest:
    """Test of the existence of a local Lipschitz branch of solutions through a root (theory, section 3.2).

    The test looks at the normal map G(z) = w + S lambda, which does not depend on the parameter r of H, over the
    statuses that hold at the root (``root.active``).

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    root : Root
        Or a vertex of a branch graph.

    Returns
    -------
    LocalBranchTest

    Raises
    ------
    InvalidArgumentError
        The root does not belong to the problem, or friction depends on the solution.
    TooLargeError
        More than MAX_SELECTIONS selections hold at the root; in 3D, too, where a node touches without load and rests,
        so that every direction of slip does.
    NotHeldError
        Some rigid displacement of a body that nothing holds moves no contact node.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> root = enumsol.newton(problem, 5)
    >>> print(enumsol.local_branch_test(problem, root))
    a local Lipschitz branch exists in the load (1 selection holds)
    """
    check_is_problem(problem)
    active = getattr(root, "active", None)
    if not isinstance(active, tuple) or len(active) != problem.p:
        raise InvalidArgumentError(f"root is {type(root).__name__}; expected a Root with {problem.p} contact nodes")
    dimension = 2 if isinstance(problem, ContactProblem) else 3
    if np.ndim(root.u_t) != dimension - 1:
        raise InvalidArgumentError(f"root is one in {5 - dimension}D; expected one in {dimension}D, as is the problem")
    return branch_test(condensation_of(problem), problem.affine_friction, root)


def branch_test(condensed: CondensedProblem, friction: tuple[Floats, Floats], root: ContactState) -> LocalBranchTest:
    """The test at a root, from F at alpha = 0 and its slope; see local_branch_test."""
    alpha, (F0, F1) = float(root.alpha), friction
    frictionless = (F0 == 0) & (F1 == 0)
    frictionless = frictionless if frictionless.ndim == 1 else np.all(frictionless, axis=1)
    active = []
    for without, holds in zip(frictionless, root.active, strict=True):
        codes = {STATUS_CODES[status] for status in holds}
        active.append(_without_friction(codes) if without else codes)
    F, slips = F0 + alpha * F1, None
    if F.ndim == 2:
        scale = condensed.node_scale[: len(F), None]
        slips = NodeSlips.of(F, root.lambda_t * scale, root.u_t / scale)
    return coherent_orientation(condensed.bordered, F, active, root.u_t, alpha, RANK_TOLERANCE, slips)


def coherent_orientation(
    S: Floats,
    F: Floats,
    active: Sequence[Set[int]],
    slip: Floats,
    alpha: float,
    singular: float = LOCATED_TOLERANCE,
    slips: NodeSlips | None = None,
) -> LocalBranchTest:
    """The test for the statuses that hold at a solution.

    Parameters
    ----------
    S : (m, m) balanced compliance, or (m + r, m + r) the matrix of theory, (14.9), of a body that nothing holds
    F : (p,) friction coefficients at alpha, in 3D (p, 2)
    active : per node the codes that hold
    slip : (p,) u_t, in 3D (p, 2), which names the slip of nodes without friction
    alpha : for messages
    singular : singular values below this count as zero
    slips : in 3D, directions of slip
    """
    if F.ndim == 2:
        active = [_without_friction(codes) if not np.any(f > 0) else codes for codes, f in zip(active, F, strict=True)]
    if F.ndim == 2 and any({OPEN, STICK} <= codes for codes in active):
        raise TooLargeError(
            f"a node touches without load and rests at alpha = {alpha:g}, so that all directions of slip hold there; "
            "the local branch test examines finitely many selections"
        )
    count = prod(len(codes) for codes in active)
    if count > MAX_SELECTIONS:
        raise TooLargeError(
            f"{count} selections hold at alpha = {alpha:g}; the local branch test examines at most {MAX_SELECTIONS}"
        )
    signs = tuple(
        (tuple(map(_status, codes, slip)), normal_map_sign(S, F, codes, singular, slips))
        for codes in product(*(sorted(codes) for codes in active))
    )
    return LocalBranchTest.from_signs(signs, premise=bool(np.all(F > 0)))


def _without_friction(codes: Set[int]) -> Set[int]:
    """Codes that hold at a node where F = 0."""
    return frozenset(OPEN if code == OPEN else FRICTIONLESS for code in codes)


def _status(code: int, slip: Floats) -> ContactStatus:
    return contact_status(code, float(slip)) if np.ndim(slip) == 0 else space_status(code, slip)


def normal_map_sign(
    S: Floats, F: Floats, codes: Codes, singular: float = RANK_TOLERANCE, slips: NodeSlips | None = None
) -> int:
    """Sign of det DG in the cell of these statuses, 0 when it is singular; columns scaled to length one.

    The columns are those of z_n and, in units of q, of the tangential z (theory, section 3.2).
    """
    p = len(codes)
    F = F.reshape(p, -1)
    (c, q), count = ratios(F), F.shape[1]
    DG = np.eye(len(S))
    DG[:, p * (1 + count) :] = S[:, p * (1 + count) :]
    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        DG[:, i] = S[:, i]
        if code == FRICTIONLESS:
            continue
        rubs = np.flatnonzero(F[i] > 0)
        t, ratio, held = p * (1 + rubs) + i, q[i, rubs], np.eye(len(rubs))
        if code != STICK:
            d, share = (np.ones(1), 0.0) if slips is None else (slips.direction[i, rubs], slips.share[i])
            d = -d if code == SLIP_MINUS else d
            DG[:, i] += c[i] * S[:, t] @ (ratio * d)
            DG[t, i] -= c[i] * d / ratio
            held = share * (held - np.outer(d, d))
        DG[:, t] = (S[:, t] * ratio) @ held
        DG[t[:, None], t] += (np.eye(len(rubs)) - held) / ratio[:, None]
    DG /= np.linalg.norm(DG, axis=0)
    if np.linalg.svd(DG, compute_uv=False)[-1] <= singular:
        return 0
    return int(np.linalg.slogdet(DG)[0])


@dataclass(frozen=True)
class NodeSlips(Sealed):
    """Where a node slips in 3D, or would: zeta = tau + v with tau = lambda_t / q and v = q u_t, q = F / c.

    c is the mean of a node's coefficients that are not 0, and q is 1 for the others. Forces and displacements are in
    units in which the compliance of the node is one.

    Attributes
    ----------
    direction : (p, 2) array
        zeta over its length, 0 where that is 0.
    share : (p,) array
        Of the lengths of tau and v together, that of tau.
    """

    direction: Floats
    share: Floats

    @classmethod
    def of(cls, F: Floats, tangential: Floats, slip: Floats) -> NodeSlips:
        """At a solution; all arrays are (p, 2)."""
        rubs, q = F > 0, ratios(F)[1]
        tau, v = np.where(rubs, tangential / q, 0.0), np.where(rubs, slip * q, 0.0)
        force, both = np.linalg.norm(tau, axis=1), np.linalg.norm(tau, axis=1) + np.linalg.norm(v, axis=1)
        length = np.linalg.norm(tau + v, axis=1)
        direction = (tau + v) / np.where(length > 0, length, 1.0)[:, None]
        return cls(direction, force / np.where(both > 0, both, 1.0))


def ratios(F: Floats) -> tuple[Floats, Floats]:
    """c, the mean of a node's coefficients that are not 0, and q = F / c, 1 where F = 0; (p,) and F's shape (p, k)."""
    c = np.sum(F, axis=1) / np.maximum(np.sum(F > 0, axis=1), 1)
    return c, np.where(F > 0, F / np.where(c > 0, c, 1.0)[:, None], 1.0)


@dataclass(frozen=True)
class SelectionTangent(Sealed):
    """The equations of a regular root's statuses, linearised there.

    Of a body that nothing holds they have the coordinates of the rigid displacement among their unknowns, and the
    equilibrium of the body as a whole among them (theory, (14.3)).

    Attributes
    ----------
    condensed : CondensedProblem
    friction : F and its derivative at the root's alpha, (p,), in 3D (p, 2)
    codes : tuple of p status codes
        In 3D a sector, or slip along one axis, stands for slip in the direction that the root has.
    force, w : (m,) arrays
        lambda and w at the root, in the problem's units.
    floats : FloatSelections or None
        In 2D, solver of the system at the root's alpha, of the body on springs where nothing holds it.
    """

    condensed: CondensedProblem
    friction: tuple[Floats, Floats]
    codes: Codes
    force: Floats
    w: Floats
    floats: FloatSelections | None = None

    @classmethod
    def at(
        cls,
        problem: AnyProblem,
        alpha: Alpha,
        codes: Codes,
        force: Floats,
        w: Floats,
        floats: FloatSelections | None = None,
    ) -> SelectionTangent:
        """Tangent of a selection of a problem at an alpha."""
        F0, F1 = problem.affine_friction
        return cls(condensation_of(problem), (F0 + float(alpha) * F1, F1), codes, force, w, floats)

    def condition(self) -> float:
        """In 2D, the condition number of the scaled matrix."""
        if self.floats is None:
            raise ValueError("the condition number is that of a selection in 2D")
        M, _, E = self.floats.matrix(self.codes)
        M = self._bordered(self.floats, M, E)
        return float(np.linalg.cond(M)) if len(M) else 1.0

    def _bordered(self, floats: FloatSelections, matrix: Floats, E: Floats) -> Floats:
        """The matrix of the selection with q and equilibrium as a whole."""
        system, rows = floats.system, floats.reduced(self.codes)[0]
        G = np.asarray(self.condensed.moves * self.condensed.node_scale * np.sqrt(system.force / system.length))
        size = 1.0 / np.sqrt(np.diagonal(system.S))
        return np.block([[matrix, -(G * size)[:, rows].T], [G @ E, np.zeros((len(G), len(G)))]])

    @cached_property
    def rates(self) -> tuple[Floats, Floats] | None:
        """d(lambda_n, lambda_t)/d alpha and d(u_n, u_t)/d alpha with these statuses (theory, (7.8)).

        Both have shape (p, 2), in 3D (p, 3). Where the coefficients of a node are zero but their slope is not, the
        branch is followed to the side on which F >= 0; None where such a node does not slip, since the branch may then
        stick.
        """
        condensed, p, m = self.condensed, len(self.codes), len(self.force)
        scale, matrix = condensed.node_scale, condensed.bordered
        g1, J = condensed.g1 / scale, np.eye(len(matrix))
        right: Floats = np.zeros(len(matrix))
        if len(matrix) > m:
            J[m:], right[m:] = matrix[m:], np.linalg.solve(condensed.mixing, condensed.h[1])
        for i, code in enumerate(self.codes):
            if code == OPEN:
                continue
            J[i], right[i] = matrix[i], g1[i]
            found = self._tangential(i, code, matrix, g1)
            if found is None:
                return None
            rows, J[rows], right[rows] = found[0], *found[1:]
        change = np.linalg.solve(J, right)
        move = (g1 - matrix[:m] @ change) * scale
        return (change[:m] / scale).reshape(-1, p).T, move.reshape(-1, p).T

    def _tangential(self, i: int, code: int, matrix: Floats, g1: Floats) -> tuple[Indices, Floats, Floats] | None:
        """The tangential equations of a node in contact: their rows and right-hand sides; None where it may stick."""
        p, scale = len(self.codes), self.condensed.node_scale
        F, dF = (one.reshape(p, -1)[i] for one in self.friction)
        t, held, n = p * (1 + np.arange(len(F))) + i, F > 0, self.force[i] * scale[i]
        w, J = (self.w / scale)[t], np.eye(len(matrix))[t]
        if code == STICK:
            without = bool(np.any(~held & (dF != 0)))
            return None if without else (t[held], matrix[t[held]], g1[t[held]])
        if not np.any(held):
            # it may stick if it is known to move less than this, by the largest displacement
            still = np.linalg.norm(w[dF != 0]) <= 1e-9 * np.max(np.abs(self.w / scale))
            return None if still and np.any(dF != 0) else (t, J, n * dF * _unit(np.abs(dF) * w))
        if len(F) == 1:
            d, across = np.array([-1.0 if code == SLIP_MINUS else 1.0]), np.zeros((1, 1))
        else:
            d = _unit(F * w)
            across = n * F[:, None] * (np.eye(2) - np.outer(d, d)) / np.linalg.norm(F * w)
        # lambda_t = lambda_n F d with the direction d of F w
        J += across @ (F[:, None] * matrix[t])
        J[:, i] -= F * d
        return t, J, n * dF * d + across @ (F * g1[t] + dF * w)


def _unit(vector: Floats) -> Floats:
    size = float(np.linalg.norm(vector))
    return vector / size if size > 0 else vector


@dataclass(frozen=True)
class SlipSigns:
    """Signs of u_t at a root of one selection.

    Attributes
    ----------
    problem : ContactProblem
    alpha : float or Fraction
    codes : tuple of p status codes
        The root's selection, which is regular where a sign has to be found in rationals.
    known : tuple of p (int or None)
        Signs that the enclosure, rationals or the tolerance of fast arithmetic decide; None where they do not.
    """

    problem: ContactProblem
    alpha: Alpha
    codes: Codes
    known: tuple[int | None, ...]

    def sign(self, node: int) -> int | None:
        """-1, 0 or 1; None where it would take rationals and the problem is too large for them."""
        known = self.known[node]
        return known if known is not None or self._exact is None else self._exact[node]

    @cached_property
    def _exact(self) -> tuple[int, ...] | None:
        """All signs in rationals; None when the problem is too large for them."""
        if self.problem.n > EXACT_DOF_LIMIT or not self.problem.known_exactly:
            return None
        from enumsol.condensation.exact import ExactSystem  # python-flint, not for fast arithmetic
        from enumsol.selections.rational_selections import ExactSelections

        solver = ExactSelections(ExactSystem.from_problem(self.problem, self.alpha))
        solution = solver.solve(self.codes)
        return None if solution is None else solver.slip_signs(solution.vertices[0])


def slip_names(sign: int | None) -> frozenset[ContactStatus]:
    """Statuses of a node in contact without friction by the sign of its u_t: all three where that is 0 or not known."""
    if not sign:
        return frozenset(STATUSES[code] for code in (STICK, SLIP_PLUS, SLIP_MINUS))
    return frozenset((STATUSES[SLIP_PLUS if sign > 0 else SLIP_MINUS],))


def named_statuses(
    active: ActiveSets, slip_sign: Callable[[int], int | None]
) -> tuple[tuple[ContactStatus, ...], tuple[frozenset[ContactStatus], ...]]:
    """First status that holds at every node, and all of them; ``slip_sign`` gives the sign of u_t without friction."""
    names = tuple(
        frozenset(
            name
            for code in codes
            for name in (slip_names(slip_sign(node)) if code == FRICTIONLESS else (STATUSES[code],))
        )
        for node, codes in enumerate(active)
    )
    return tuple(next(status for status in STATUSES if status in held) for held in names), names


def sign_over(signs: Iterable[int]) -> int:
    """The sign of u_t on a polytope whose corners have these signs; 0 where it takes both or none."""
    found = set(signs) - {0}
    return found.pop() if len(found) == 1 else 0
