"""Linear equations between displacements, solved for some of them, which are thereby eliminated (theory, section 11.9).

Supports are such equations, with one displacement each; so are ties, rigid parts and rollers in oblique planes.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.support.array_types import Floats, Integers, Mask

#: Coefficients and right sides below this share of what they are the difference of are rounding. Larger, equations that
#: differ would count as one; smaller, repeated ones as a contradiction.
_ROUNDED = 1e-10
#: An equation is solved for its first displacement unless its coefficient is below this share of the largest.
_SMALL = 0.1


@dataclass(frozen=True)
class Equation:
    """The equation: the sum of coefficients times displacements is value + alpha slope.

    Attributes
    ----------
    dofs : (k,) int array
        Degrees of freedom; it is solved for the first if its coefficient is not small.
    coefficients : (k,) array
    name : str
        What messages call it.
    value, slope : float
        [length].
    """

    dofs: Integers
    coefficients: Floats
    name: str
    value: float = 0.0
    slope: float = 0.0


@dataclass(frozen=True)
class Elimination:
    """Displacements x = T q + offset + alpha slope, where q are those that are left, in their order.

    Attributes
    ----------
    left : (n,) int array
    T : (m, n) csr_array
        Its rows ``left`` are those of the identity.
    offset, slope : (m,) arrays
        [length].
    redundant : tuple of str
        Names of equations that follow from those before them.
    """

    left: Integers
    T: sp.csr_array
    offset: Floats
    slope: Floats
    redundant: tuple[str, ...] = ()


@dataclass
class _Row:
    """A displacement in terms of others: ``value + alpha slope`` plus ``terms``; of sums, what they are made of.

    ``size`` is the largest of what value and slope are sums of.
    """

    terms: dict[int, float]
    value: float
    slope: float
    size: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        self.size = max(self.size[0], abs(self.value)), max(self.size[1], abs(self.slope))

    def put_in(self, dof: int, other: _Row) -> None:
        """Put another row in for a displacement."""
        factor = self.terms.pop(dof)
        for own, coefficient in other.terms.items():
            total = self.terms.get(own, 0.0) + factor * coefficient
            if abs(total) <= _ROUNDED * abs(factor * coefficient):
                self.terms.pop(own, None)
            else:
                self.terms[own] = total
        self.value += factor * other.value
        self.slope += factor * other.slope
        self.size = max(self.size[0], abs(factor) * other.size[0]), max(self.size[1], abs(factor) * other.size[1])


def eliminated(
    fixed: Mask,
    values: Floats,
    slopes: Floats,
    equations: Sequence[Equation] = (),
    apart: Mask | None = None,
    named: Callable[[int], str] = "displacement {}".format,
) -> Elimination:
    """Elimination of what is fixed, and of one displacement for each of the equations.

    Parameters
    ----------
    fixed : (m,) bool array
        Displacements that are given: values + alpha slopes.
    values, slopes : (m,) arrays
        0 where nothing is fixed [length].
    equations : sequence of Equation
    apart : (m,) bool array or None
        Fixed displacements that are left nevertheless, alone.
    named : callable
        The name of a displacement in messages.

    Raises
    ------
    InvalidArgumentError
        An equation contradicts others; it names both.
    """
    count = len(fixed)
    rows, redundant = _solved(fixed, values, slopes, equations, named)
    gone = fixed if apart is None else fixed & ~apart
    solved = np.fromiter(rows, dtype=np.int64, count=len(rows))
    left = np.flatnonzero(~gone)
    offset, slope = np.where(fixed, values, 0.0), np.where(fixed, slopes, 0.0)
    if len(solved):
        left = np.setdiff1d(left, solved, assume_unique=True)
        offset[solved] = [row.value for row in rows.values()]
        slope[solved] = [row.slope for row in rows.values()]
    column = np.full(count, -1)
    column[left] = np.arange(len(left))
    lengths = [len(row.terms) for row in rows.values()]
    others = np.array([dof for row in rows.values() for dof in row.terms], dtype=np.int64)
    data = np.array([value for row in rows.values() for value in row.terms.values()])
    places = (np.concatenate([left, np.repeat(solved, lengths)]), column[np.concatenate([left, others])])
    T = sp.csr_array((np.concatenate([np.ones(len(left)), data]), places), shape=(count, len(left)))
    return Elimination(left, T, offset, slope, tuple(redundant))


def _solved(
    fixed: Mask, values: Floats, slopes: Floats, equations: Sequence[Equation], named: Callable[[int], str]
) -> tuple[dict[int, _Row], list[str]]:
    """A row for each displacement that an equation is solved for, in those that are left, and redundant equations."""
    rows: dict[int, _Row] = {}
    users: defaultdict[int, set[int]] = defaultdict(set)
    redundant = []
    for equation in equations:
        own = _Row({}, -equation.value, -equation.slope)
        largest = float(np.max(np.abs(equation.coefficients)))
        for dof, coefficient in zip(equation.dofs.tolist(), equation.coefficients.tolist(), strict=True):
            known = _Row({}, values[dof], slopes[dof]) if fixed[dof] else rows.get(dof, _Row({dof: 1.0}, 0.0, 0.0))
            own.terms[-1] = coefficient  # no displacement has this number
            own.put_in(-1, known)
        terms = {dof: value for dof, value in own.terms.items() if abs(value) > _ROUNDED * largest}
        if not terms:
            if abs(own.value) > _ROUNDED * own.size[0] or abs(own.slope) > _ROUNDED * own.size[1]:
                of = ", ".join(dict.fromkeys(named(dof) for dof in equation.dofs.tolist()[:4]))
                raise InvalidArgumentError(
                    f"{equation.name} contradicts what supports and other equations give for {of}; expected equations "
                    "that hold together"
                )
            redundant.append(equation.name)
            continue
        most = _SMALL * max(map(abs, terms.values()))
        pivot = next(dof for dof, value in terms.items() if abs(value) >= most)
        factor = -terms.pop(pivot)
        size = own.size[0] / abs(factor), own.size[1] / abs(factor)
        row = _Row({dof: value / factor for dof, value in terms.items()}, own.value / factor, own.slope / factor, size)
        for user in users.pop(pivot, ()):
            if pivot in rows[user].terms:
                rows[user].put_in(pivot, row)
                for dof in row.terms:
                    users[dof].add(user)
        rows[pivot] = row
        for dof in terms:
            users[dof].add(pivot)
    return rows, redundant


def followed(T: sp.csr_array, slope: Floats, rows: sp.csr_array) -> Floats:
    """Displacement that contains ``slope`` and does not move contact rows: slope - T d with rows (slope - T d) = 0.

    Raises
    ------
    InvalidArgumentError
        Contact rows move that nothing free can follow.
    """
    moved = np.asarray(rows @ slope)
    if not np.any(moved):
        return slope
    own = sp.csr_array(rows @ T)
    free = np.asarray(abs(own).sum(axis=1)).ravel() > 0
    if np.any(moved[~free]):
        raise InvalidArgumentError(
            "displacement_slope moves contact nodes in a direction in which nothing can follow them; expected nodes "
            "that contact does not need"
        )
    own = sp.csr_array(own[np.flatnonzero(free)])
    from scipy.sparse.linalg import spsolve  # scipy's solvers come with it

    force: Any = spsolve(sp.csc_array(own @ own.T), moved[free])
    return np.asarray(slope - T @ (own.T @ np.atleast_1d(force)))
