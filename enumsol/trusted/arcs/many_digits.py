"""Balls of many digits, what is read off them, and S, g0 and g1 in such balls (theory, section 7.14).

S, g0 and g1 come from solutions in floats that exact residuals refine: the factors of A in double arithmetic give some
thirty bits of A^-1 K more with every step, K = [B', f, load_slope]. The residuals are integers: nothing is rounded, and
the matrix A is touched only where it has entries.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from flint import arb, arb_mat, ctx, fmpq, fmpz_mat

from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.condensation.products import scaled
from enumsol.support.deadlines import look, tell

if TYPE_CHECKING:
    from collections.abc import Sequence
    from contextlib import AbstractContextManager

    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Floats, NDArray

    Signs = NDArray[np.int8]


#: Bits of the arithmetic.
PRECISION = 320


def upper(value: arb) -> float:
    """At least the size of all numbers in a ball."""
    return float(np.nextafter(float(abs(value).upper()), np.inf))


def uppers(values: arb_mat) -> Floats:
    """Upper bounds of the sizes of all entries of a matrix."""
    sizes = np.array([[float(abs(x).upper()) for x in row] for row in values.tolist()])
    bounds: Floats = np.nextafter(sizes, np.inf)
    return bounds


def precision() -> AbstractContextManager[object]:
    """The precision of flint's balls, for a while."""
    context: AbstractContextManager[object] = ctx.workprec(PRECISION)
    return context


def matrix(rows: list[list[Any]]) -> Any:
    """A matrix of balls, by its rows."""
    return arb_mat(len(rows), len(rows[0]) if rows else 0, [x for row in rows for x in row])


def column(values: Sequence[Any]) -> Any:
    """A matrix with one column."""
    return arb_mat(len(values), 1, list(values))


def products(left: Floats | sp.sparray, right: Floats) -> NDArray[Any]:
    """The product of two matrices of floats, the first of which may be sparse, in balls."""
    rows, factors = sp.csr_array(left), np.array([[arb(x) for x in row] for row in right.tolist()], dtype=object)
    found = np.full((rows.shape[0], right.shape[1]), arb(0), dtype=object)
    for i, (first, last) in enumerate(pairwise(rows.indptr)):
        for value, j in zip(rows.data[first:last].tolist(), rows.indices[first:last], strict=True):
            found[i] = found[i] + arb(value) * factors[j]
    return found


def ball_of(alpha: Fraction) -> Any:
    """A ball that holds a fraction."""
    return arb(fmpq(alpha.numerator, alpha.denominator))


def sign_of(value: arb) -> int:
    """Sign of all numbers in a ball, 0 where it is not proven."""
    return int(value > 0) - int(value < 0)


def signs_of(values: arb_mat) -> Signs:
    """Signs of the balls in a column."""
    return np.array([sign_of(values[k, 0]) for k in range(values.nrows())], dtype=np.int8)


#: Residuals are refined to this many bits, beside columns of size one; the error of S has twice as many.
_RESIDUAL_BITS = 170
#: Bits behind the point of solutions.
_SOLUTION_BITS = 208
#: Most steps; a step that gains fewer bits is the last.
_STEPS, _LEAST_GAIN = 40, 4
#: Rows of A that are multiplied together.
_ROWS = 128


def affordable(problem: ContactProblem) -> bool:
    """True if a problem is small enough for balls of many digits: by the entries of A and the number of rows."""
    # most products of an entry of A with one of a solution in a step: some ten seconds for all steps
    return bool(problem.A.nnz * (problem.contact_rows.shape[0] + 2) <= 2**24)


def refined_table(problem: ContactProblem) -> list[list[Any]] | None:
    """B A^-1 [B', f, load_slope] in balls, 2p rows of 2p + 2 arb; None where A is not proven positive definite.

    With X an approximation of A^-1 K and E = K - A X, without rounding,

        k_i' A^-1 k_j  =  k_i' x_j + x_i' e_j + e_i' A^-1 e_j,       |e_i' A^-1 e_j|  <=  ||e_i|| ||e_j|| / mu(A).

    Raises
    ------
    TimeOverError
        The deadline that holds here has passed.
    """
    try:
        bound = problem.enclosure.stiffness_bound
    except NotEnclosedError:
        return None
    scale = problem.products.scale
    A, _ = scaled(sp.csr_array(problem.A), scale, scale)
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    K = _columns(np.column_stack([problem.contact_rows.toarray().T, problem.f, slope]), scale)
    entries = _ScaledIntegers.of(*_parts(A.data))
    X, E, bits = _refined(problem, A, entries, K, scale)
    size = problem.contact_rows.shape[0]
    first = fmpz_mat(K.values.T[:size].tolist()) * fmpz_mat(X.tolist())
    second = fmpz_mat(X.T[:size].tolist()) * fmpz_mat(E.tolist())
    lengths = [arb((sum(e * e for e in column), -2 * bits)).sqrt() for column in E.T.tolist()]
    table = []
    for i in range(size):
        row = []
        for j in range(size + 2):
            rest = (lengths[i] * lengths[j] / arb(bound)).upper()
            value = arb((int(first[i, j]), -K.bits - _SOLUTION_BITS)) + arb((int(second[i, j]), -_SOLUTION_BITS - bits))
            row.append((value + arb(0, rest)) * arb((1, K.units[i] + K.units[j])))
        table.append(row)
    return table


class _ScaledIntegers(NamedTuple):
    """Numbers as integers, values * 2^-bits; the columns of a matrix may have units, 2^unit, beside that."""

    values: NDArray[Any]
    bits: int
    units: list[int]

    @classmethod
    def of(cls, whole: NDArray[Any], exponent: NDArray[Any], units: NDArray[Any] | None = None) -> _ScaledIntegers:
        """The numbers whole * 2^exponent."""
        exponent = np.where(whole != 0, exponent if units is None else exponent - units, 0)
        bits = -int(np.min(exponent, initial=0))
        return cls(
            whole.astype(object) << (exponent + bits).astype(object), bits, [] if units is None else units.tolist()
        )


def _columns(floats: Floats, scale: Floats) -> _ScaledIntegers:
    """The columns of K, A's scaling applied, in units in which their largest entries are near one."""
    whole, exponent = _parts(floats)
    # a product by a power of two, without the underflow that floats may have
    exponent = exponent + np.frexp(scale)[1][:, None] - 1
    largest = np.max(np.where(whole != 0, exponent + 53, -(2**30)), axis=0)
    return _ScaledIntegers.of(whole, exponent, np.where(np.any(whole, axis=0), largest, 0))


def _parts(floats: Floats) -> tuple[NDArray[Any], NDArray[Any]]:
    """Integers m and e with floats = m 2^e."""
    mantissa, exponent = np.frexp(floats)
    return np.ldexp(mantissa, 53).astype(np.int64), exponent.astype(np.int64) - 53


def _refined(
    problem: ContactProblem, A: sp.csr_array, entries: _ScaledIntegers, K: _ScaledIntegers, scale: Floats
) -> tuple[NDArray[Any], NDArray[Any], int]:
    """X times 2^_SOLUTION_BITS, the exact residual K - A X times 2^bits, and bits."""
    bits = entries.bits + _SOLUTION_BITS + K.bits
    E = K.values << (bits - K.bits)
    X = np.zeros_like(E)
    before = np.inf
    for _ in range(_STEPS):
        sizes = np.array([max((abs(e).bit_length() for e in column), default=0) for column in E.T.tolist()])
        largest = int(np.max(sizes, initial=0)) - bits
        if largest <= -_RESIDUAL_BITS or largest > before - _LEAST_GAIN:
            break
        before = largest
        tell("bits of A^-1 B'", max(-largest, 0), _RESIDUAL_BITS)
        # bits of a residual that floats are given
        drop = np.maximum(sizes - 60, 0)
        floats = (E >> drop.astype(object)).astype(float)
        step = np.asarray(problem.factorization.solve(floats / scale[:, None], refined=False) / scale[:, None])
        if not np.all(np.isfinite(step)):
            break
        whole, exponent = _parts(step)
        shift = np.where(whole != 0, exponent + drop - (bits - _SOLUTION_BITS), 0)
        dX = whole.astype(object) << np.maximum(shift, 0).astype(object) >> np.maximum(-shift, 0).astype(object)
        X = X + dX
        E = E - (_product(A, entries.values, dX) << K.bits)
    return X, E, bits


def _product(A: sp.csr_array, entries: NDArray[Any], X: NDArray[Any]) -> NDArray[Any]:
    """A X in integers; every row of A has an entry."""
    parts = []
    for start in range(0, A.shape[0], _ROWS):
        look()
        ends = A.indptr[start : start + _ROWS + 1]
        part = slice(ends[0], ends[-1])
        terms = entries[part, None] * X[A.indices[part]]
        parts.append(np.add.reduceat(terms, ends[:-1] - ends[0], axis=0))
    return np.concatenate(parts)
