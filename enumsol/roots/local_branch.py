"""Whether a local Lipschitz branch passes through a root: coherent orientation of the normal map (Section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice, product
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from enumsol.continuation.condensed_equation import CondensedEquation
from enumsol.continuation.parameter_path import AffinePath
from enumsol.continuation.tangents import MAX_SELECTIONS
from enumsol.errors import InvalidArgumentError, TooLargeError
from enumsol.roots.root_set import Root
from enumsol.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, STICK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.continuation.condensed_equation import Codes, Vector
    from enumsol.problem import ContactProblem
    from enumsol.statuses import ContactStatus

#: A singular value of the normal map's scaled matrix below this counts as zero, as in arithmetic "fast".
SINGULAR_TOLERANCE = 1e-12
#: The same at transition points of a path, whose alpha is located to about 1e-10.
LOCATED_SINGULAR_TOLERANCE = 1e-8


@dataclass(frozen=True)
class LocalBranchTest:
    """Answer of the local branch test at one root.

    The contact forces are a Lipschitz function of the load near the root, at fixed friction, exactly when the
    determinants of the normal map have one and the same sign, not zero, over all statuses that hold there. By
    Theorem 4.1 they then are one of the friction coefficients too, provided that F > 0 at every node.

    Attributes
    ----------
    exists : bool
        A local Lipschitz branch in the load exists.
    premise : bool
        F > 0 at every node: the premise of Theorem 4.1 for a branch in F.
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
        many = len(self.signs)
        answer = "a local Lipschitz branch exists" if self.exists else "no local Lipschitz branch"
        detail = f"{many} selection{'s' if many != 1 else ''} hold{'s' if many == 1 else ''}"
        if not self.exists:
            detail += f", the sign of {len(self.differing)} of them differs or is zero"
        premise = "" if self.premise else "; F = 0 at some node, so Theorem 4.1 does not carry it over to F"
        return f"{answer} in the load ({detail}){premise}"


def local_branch_test(problem: ContactProblem, root: Root) -> LocalBranchTest:
    """Whether a local Lipschitz branch of solutions passes through a root (Section 4, Theorem 4.1).

    The test looks at the normal map G(z) = w + S lambda, which does not depend on the parameter r of H, over the
    statuses that hold at the root (``root.active``).

    Parameters
    ----------
    problem : ContactProblem
    root : Root

    Returns
    -------
    LocalBranchTest

    Raises
    ------
    InvalidArgumentError
        The root does not belong to the problem.
    TooLargeError
        More than MAX_SELECTIONS selections hold at the root.
    """
    if not isinstance(root, Root) or len(root.statuses) != problem.p:
        raise InvalidArgumentError(f"root is {type(root).__name__}; expected a Root with {problem.p} contact nodes")
    alpha = float(root.alpha)
    equation = CondensedEquation(AffinePath(problem), start=alpha)
    x = equation.point(alpha, np.concatenate([root.lambda_n, root.lambda_t]))
    names = {"open": 0, "stick": 1, "slip+": 2, "slip-": 3}
    active = []
    for i, holds in enumerate(root.active):
        codes = {names[status.value] for status in holds}
        if equation.frictionless[i]:
            codes = {OPEN if code == OPEN else FRICTIONLESS for code in codes}
        active.append(frozenset(codes))
    return coherent_orientation(equation, x, tuple(active), SINGULAR_TOLERANCE)


def coherent_orientation(
    equation: CondensedEquation,
    x: Vector,
    active: tuple[frozenset[int], ...] | None = None,
    singular: float = LOCATED_SINGULAR_TOLERANCE,
) -> LocalBranchTest:
    """The test at a point x of the condensed equation; ``active`` as found by the equation when None."""
    holds = equation.active(x) if active is None else active
    count = prod(len(codes) for codes in holds)
    if count > MAX_SELECTIONS:
        raise TooLargeError(
            f"{count} selections hold at alpha = {equation.alpha(x):g}; the local branch test examines at most "
            f"{MAX_SELECTIONS}"
        )
    F = equation.at(x).F
    slip = equation.w(x)[equation.p :]
    signs = tuple(
        (equation.statuses(codes, slip), normal_map_sign(equation.S, F, codes, singular))
        for codes in islice(product(*(sorted(codes) for codes in holds)), MAX_SELECTIONS)
    )
    return LocalBranchTest.from_signs(signs, premise=bool(np.all(F > 0)))


def normal_map_sign(
    S: NDArray[np.float64], F: NDArray[np.float64], codes: Codes, singular: float = SINGULAR_TOLERANCE
) -> int:
    """Sign of det DG in the cell of these statuses, 0 when it is singular; columns scaled to length one."""
    p = len(codes)
    DG = np.eye(2 * p)
    for i, code in enumerate(codes):
        if code == OPEN:
            continue
        DG[:, i] = S[:, i]
        if code == STICK:
            DG[:, p + i] = S[:, p + i]
        elif code != FRICTIONLESS:
            slope = -F[i] if code == SLIP_MINUS else F[i]
            DG[:, i] += slope * S[:, p + i]
            DG[p + i, i] -= slope
    DG /= np.linalg.norm(DG, axis=0)
    if np.linalg.svd(DG, compute_uv=False)[-1] <= singular:
        return 0
    return int(np.linalg.slogdet(DG)[0])
