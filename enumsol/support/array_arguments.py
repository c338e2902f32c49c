"""Arrays and sparse matrices of the user, read as float64 without changing a value.

What float64 cannot hold exactly (an integer above 2^53, digits of a longdouble, the Fraction 1/3) is refused and not
rounded: a proof is about the numbers that were given. Complex numbers are refused even where their imaginary part is
zero, texts even where they spell a number, masked arrays where something is masked. Arrays of bool count as 0 and 1; a
single bool is no number.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import EnumsolError, InvalidArgumentError, InvalidProblemError
from enumsol.support.arguments import exact_number, shown
from enumsol.support.array_types import Floats, Mask, NDArray

#: Integers up to this size are floats.
_EXACT_INTEGERS = 2**53
#: What numpy and scipy raise on things that are no arrays or matrices.
_UNREADABLE = (TypeError, ValueError, OverflowError, RuntimeError, AttributeError, LookupError)
_KINDS = {"c": "complex numbers", "U": "text", "T": "text", "S": "bytes", "M": "dates", "m": "time spans"}
_RAGGED = "rows of different lengths or depths"


# -- dense arrays --------------------------------------------------------------------------------------------------


def real_array(
    value: object, name: str, *, error: type[EnumsolError] = InvalidProblemError, finite: bool = True
) -> Floats:
    """A new float64 array with exactly the numbers that were given.

    Parameters
    ----------
    value : array_like
        Array, masked array without masked values, Series or DataFrame, nested lists, a number.
    name : str
        What the argument is called in messages.
    error : type of EnumsolError
        Raised on anything else.
    finite : bool
        Refuse nan and infinities.

    Raises
    ------
    InvalidProblemError or ``error``
        It is no array of real numbers, float64 cannot hold one of them, or one is not finite.
    """
    raw = plain_array(value, name, error=error)
    # the float64 keeps NumPy from casting the integer to float16
    if not hasattr(value, "dtype") and raw.dtype.kind == "f" and np.any(np.abs(raw) >= np.float64(_EXACT_INTEGERS)):
        # numpy has rounded the integers of lists and frames that hold floats as well
        raw = np.asarray(value.astype(object) if hasattr(value, "astype") else value, dtype=object)
    if raw.dtype.kind not in "fiubO":
        raise _no_numbers(name, _KINDS.get(raw.dtype.kind, f"type {raw.dtype}"), error)
    if raw.dtype.kind == "b" and raw.ndim == 0:
        raise error(f"{name} is {raw}; expected a number")
    array = _from_objects(raw, name, error) if raw.dtype.kind == "O" else _as_floats(raw)
    lost = np.zeros(raw.shape, dtype=bool) if raw.dtype.kind == "O" else _rounded(raw, array)
    if np.any(lost):
        where = _index(lost)
        raise _inexact(name, raw[where], where, error)
    if finite and not np.all(np.isfinite(array)):
        where = _index(~np.isfinite(array))
        at = f" at index {where}" if where else ""
        raise error(f"{name} has the value {array[where]}{at}; expected finite numbers only")
    return array


def plain_array(value: object, name: str, *, error: type[EnumsolError]) -> NDArray[Any]:
    """The value as an array of its own type.

    Raises
    ------
    ``error``
        It is not an array, or sparse, with masked values, or of rows that differ in length.
    """
    try:
        if sp.issparse(value):
            raise _no_numbers(name, f"a sparse {type(value).__name__}", error)
        if isinstance(value, (bytes, bytearray)):  # text, whose bytes numpy would take for numbers
            raise _no_numbers(name, type(value).__name__, error)
        if _has_masked(value):
            raise _no_numbers(name, "masked values", error)
        raw = np.asarray(value)
    except _UNREADABLE as reason:
        if isinstance(reason, error):
            raise
        nested = isinstance(value, (list, tuple)) and any(isinstance(row, (list, tuple, np.ndarray)) for row in value)
        raise _no_numbers(name, _RAGGED if nested else type(value).__name__, error) from None
    if raw.dtype.kind == "O" and raw.ndim == 0 and exact_number(raw) is None:
        raise _no_numbers(name, type(value).__name__, error)
    return raw


def _has_masked(value: object) -> bool:
    """True if something is masked in an array or in the arrays of a list, whose masks numpy would drop."""
    if isinstance(value, (list, tuple)):
        return any(_has_masked(row) for row in value if isinstance(row, (list, tuple, np.ma.MaskedArray)))
    return isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))


def _no_numbers(name: str, found: str, error: type[EnumsolError]) -> EnumsolError:
    return error(f"{name} is not an array of real numbers (found {found}); expected float64 values")


def _index(wrong: Mask) -> tuple[int, ...]:
    """Index of the first True."""
    return tuple(int(k) for k in np.argwhere(wrong)[0])


def _as_floats(raw: NDArray[Any]) -> Floats:
    with np.errstate(over="ignore"):
        return np.array(raw, dtype=np.float64)


def _rounded(raw: NDArray[Any], array: Floats) -> Mask:
    """Mask of entries that conversion to float64 has changed."""
    lost = np.zeros(raw.shape, dtype=bool)
    if raw.dtype.kind in "iu":
        # compared as Python's: the largest of NumPy's integers round to a float beyond them
        large = np.abs(array) >= _EXACT_INTEGERS
        lost[large] = [int(x) != int(y) for x, y in zip(raw[large], array[large], strict=True)]
    elif raw.dtype.itemsize > 8:
        lost = (array != raw) & ~np.isnan(raw)
    return lost


def _inexact(name: str, value: object, where: tuple[int, ...], error: type[EnumsolError]) -> EnumsolError:
    at = f" at index {where}" if where else ""
    return error(f"{name} has the value {shown(value)}{at}, which float64 would round; expected float64 values")


def _from_objects(raw: NDArray[Any], name: str, error: type[EnumsolError]) -> Floats:
    """Python numbers (integers of any size, fractions, decimals) as float64, refused where that would round."""
    array = np.empty(raw.shape)
    for where in np.ndindex(raw.shape):
        item: Any = raw[where]
        number = float(item) if isinstance(item, (bool, np.bool_)) else exact_number(item)
        if number is None:
            found = _RAGGED if isinstance(item, (list, tuple, np.ndarray)) else f"{shown(item)} at index {where}"
            raise _no_numbers(name, found, error)
        try:
            array[where] = number
        except OverflowError:
            raise _inexact(name, item, where, error) from None
        if isinstance(number, Fraction) and Fraction(float(array[where])) != number:
            raise _inexact(name, item, where, error)
    return array


# -- sparse matrices -----------------------------------------------------------------------------------------------


def real_matrix(value: object, name: str, *, error: type[EnumsolError] = InvalidProblemError) -> sp.csc_array:
    """A new sparse matrix with exactly the numbers that were given: sorted, without duplicates or stored zeros.

    Parameters
    ----------
    value : array_like or scipy.sparse matrix or array of any format
        Entries at one place add up.
    name, error
        As for real_array.

    Raises
    ------
    InvalidProblemError or ``error``
        As for real_array, or it has no two dimensions, or the parts of a sparse matrix do not fit together.
    """
    if sp.issparse(value):
        matrix = _from_sparse(value, name, error)
    else:
        array = real_array(value, name, error=error)
        if array.ndim != 2:
            raise error(f"{name} has {array.ndim} dimension(s), shape {array.shape}; expected a matrix")
        matrix = sp.csc_array(array)
    matrix.eliminate_zeros()
    return matrix


def _from_sparse(value: sp.sparray | sp.spmatrix, name: str, error: type[EnumsolError]) -> sp.csc_array:
    if value.ndim != 2:
        raise error(f"{name} has {value.ndim} dimension(s), shape {value.shape}; expected a matrix")
    if value.dtype.kind == "c":
        raise error(f"{name} has complex entries; expected real numbers")
    if value.dtype.kind not in "fiub":
        raise error(f"{name} has entries of type {value.dtype}; expected real numbers")
    row, column, raw = _triplets(value, name, error)
    entries = _as_floats(raw)
    lost = _rounded(raw, entries)
    if np.any(lost):
        k = int(np.argmax(lost))
        raise _inexact(name, raw[k], (int(row[k]), int(column[k])), error)
    # True and True at one place are True, as scipy reads them
    summed = raw if raw.dtype.kind == "b" else entries
    matrix = sp.csc_array((summed, (row, column)), shape=value.shape).astype(np.float64)
    matrix.sum_duplicates()
    if not np.all(np.isfinite(matrix.data)):
        k = int(np.argmax(~np.isfinite(matrix.data)))
        raise error(f"{name} has the value {matrix.data[k]} at index {_place(matrix, k)}; expected finite numbers only")
    if raw.dtype.kind in "iu" and matrix.nnz < len(raw):
        _check_sums(entries, row, column, name, error)
    return matrix


def _triplets(
    value: sp.sparray | sp.spmatrix, name: str, error: type[EnumsolError]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Rows, columns and entries of a sparse matrix, checked to fit together: scipy reads any address it is given."""
    try:
        if value.format in ("csr", "csc", "bsr"):
            value.check_format(full_check=True)
        triplets = value.tocoo(copy=True)
        (row, column), entries = triplets.coords, np.asarray(triplets.data)
        fits = len(row) == len(column) == len(entries) and entries.dtype == value.dtype
        for place, size in zip((row, column), value.shape, strict=True):
            fits = fits and (not len(place) or (int(np.min(place)) >= 0 and int(np.max(place)) < size))
    except _UNREADABLE as reason:
        text = " ".join(str(reason).split())
        raise error(f"{name} is a damaged sparse {type(value).__name__} ({text}); expected a valid one") from None
    if not fits:
        raise error(f"{name} is a damaged sparse {type(value).__name__}; expected indices within {value.shape}")
    return row, column, entries


def _check_sums(entries: Floats, row: NDArray[Any], column: NDArray[Any], name: str, error: type[EnumsolError]) -> None:
    """Refuse integers at one place whose sum float64 may have rounded."""
    sizes, counts = (sp.csc_array((part, (row, column))) for part in (np.abs(entries), np.ones(len(row))))
    large = (sizes.data >= _EXACT_INTEGERS) & (counts.data > 1)
    if np.any(large):
        where = _place(sizes, int(np.argmax(large)))
        raise error(f"{name} has integers at index {where} that add up to 2^53 or more; expected float64 values")


def short_vector(value: object, name: str, size: int) -> Floats:
    """Value as a finite array of shape (1,), (2,), (3,), (6,), (7,) or (9,).

    Raises
    ------
    InvalidArgumentError
        The value is not as many finite real numbers.
    """
    try:
        array = real_array(value, name, error=InvalidArgumentError)
    except InvalidArgumentError:
        array = np.empty(0)
    if array.shape != (size,):
        expected = {1: "one", 2: "two", 3: "three", 6: "six", 7: "seven", 9: "nine"}[size]
        numbers = "number" if size == 1 else "numbers"
        raise InvalidArgumentError(f"{name} is {shown(value)}; expected {expected} finite {numbers}")
    return array


def vector_of(value: object, name: str, size: int) -> Floats:
    """Value as a finite array of shape (size,).

    Raises
    ------
    InvalidArgumentError
        It is not that.
    """
    return array_of(value, name, (size,))


def array_of(
    value: object,
    name: str,
    shape: tuple[int, ...],
    expected: str = "",
    error: type[EnumsolError] = InvalidArgumentError,
) -> Floats:
    """Value as a finite array of a shape, in words what is ``expected``.

    Raises
    ------
    EnumsolError
        It is not that: an error of this type.
    """
    array = real_array(value, name, error=error)
    if array.shape != shape:
        raise error(f"{name} has shape {array.shape}; expected {expected or shape}")
    return array


def _place(matrix: sp.csc_array, k: int) -> tuple[int, int]:
    """Row and column of the k-th stored entry."""
    return int(matrix.indices[k]), int(np.searchsorted(matrix.indptr, k, side="right")) - 1
