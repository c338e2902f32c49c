"""True if a local Lipschitz branch passes through a root: coherent orientation of the normal map (theory, (3.3))."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from enumsol.condensation.condensed import condensation_of
from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.model.statuses import (
    FRICTIONLESS,
    OPEN,
    SLIP,
    SLIP_MINUS,
    STATUSES,
    STICK,
    ContactStatus,
    contact_status,
    space_status,
)
from enumsol.support.array_types import Alpha, Codes, Floats
from enumsol.support.immutable import Sealed
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.condensation.condensed import CondensedProblem
    from enumsol.model.problem3d import AnyProblem


#: Selections examined at one point (paper, Remark 5.1); six nodes in a corner of three statuses have 729.
MAX_SELECTIONS = 4096
#: A singular value of the normal map's scaled matrix below this counts as zero, as in arithmetic "fast".
SINGULAR_TOLERANCE = 1e-12
#: The same at transition points of a path, whose alpha is located to about 1e-10.
LOCATED_SINGULAR_TOLERANCE = 1e-8
_CODES = {**{status: code for code, status in enumerate(STATUSES)}, ContactStatus.SLIP: SLIP}


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
        codes = {_CODES[status] for status in holds}
        active.append(frozenset(OPEN if code == OPEN else FRICTIONLESS for code in codes) if without else codes)
    F, slips = F0 + alpha * F1, None
    if F.ndim == 2:
        scale = condensed.node_scale[: len(F), None]
        slips = NodeSlips.of(F, root.lambda_t * scale, root.u_t / scale)
    return coherent_orientation(condensed.bordered, F, active, root.u_t, alpha, SINGULAR_TOLERANCE, slips)


def coherent_orientation(
    S: Floats,
    F: Floats,
    active: Sequence[Set[int]],
    slip: Floats,
    alpha: float,
    singular: float = LOCATED_SINGULAR_TOLERANCE,
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
    S: Floats, F: Floats, codes: Codes, singular: float = SINGULAR_TOLERANCE, slips: NodeSlips | None = None
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
