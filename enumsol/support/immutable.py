"""Data that cannot change: read-only arrays, and objects whose attributes cannot be set.

A proof, a fingerprint and every cached result belong to the data they were computed from. So what a problem or a result
holds is copied when it is made, and made immutable: writing to it raises, and it cannot be made writable again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self, SupportsIndex, TypeVar, overload

import numpy as np
import scipy.sparse as sp

from enumsol.errors import NoSuchItemError
from enumsol.support.array_types import Floats, NDArray
from enumsol.support.messages import counted

Item = TypeVar("Item")


def sealed(array: NDArray[Any]) -> NDArray[Any]:
    """A copy of the array that stays read-only; an array that is immutable already is returned as it is.

    The copy is held in a bytes object, so that ``setflags(write=True)`` is refused.
    """
    if _is_sealed(array):
        return array
    order: Literal["C", "F"] = "F" if array.flags.f_contiguous and not array.flags.c_contiguous else "C"
    return np.ndarray(array.shape, array.dtype, buffer=array.tobytes(order), order=order)


def _is_sealed(array: NDArray[Any]) -> bool:
    base: Any = array
    while isinstance(base, np.ndarray):
        if base.flags.writeable:  # as large arrays out of a pickle are, although they are held in a bytes object
            return False
        base = base.base
    return isinstance(base, bytes)


def _sealed_within(value: object) -> Any:
    """An array, or the arrays in a tuple, made immutable; anything else as it is."""
    if isinstance(value, np.ndarray):
        return value if value.dtype.hasobject else sealed(value)
    if type(value) is tuple and any(isinstance(item, np.ndarray) for item in value):
        return tuple(_sealed_within(item) for item in value)
    return value


class Sealed:
    """Base of frozen dataclasses: their arrays are immutable, also in copies and after unpickling."""

    def __post_init__(self) -> None:
        self.__setstate__(vars(self))

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        for name, value in state.items():  # arrays come out of a pickle writable
            object.__setattr__(self, name, _sealed_within(value))


class Listed(tuple[Item, ...]):
    """A tuple of results, which says what there is when it is asked for an item beyond its end.

    Parameters
    ----------
    items : iterable
    name, plural : str
        What an item is called in the message.
    """

    _called: tuple[str, str | None]

    def __new__(cls, items: Iterable[Item] = (), name: str = "item", plural: str | None = None) -> Self:
        """The tuple of these items."""
        made = super().__new__(cls, items)
        made._called = name, plural
        return made

    @overload
    def __getitem__(self, item: SupportsIndex) -> Item: ...
    @overload
    def __getitem__(self, item: slice) -> tuple[Item, ...]: ...
    def __getitem__(self, item: SupportsIndex | slice) -> Any:
        try:
            return super().__getitem__(item)
        except IndexError:
            raise no_such_item(item, len(self), *self._called) from None


def no_such_item(item: object, count: int, name: str, plural: str | None = None) -> NoSuchItemError:
    """The error that a list of results has no item of a number."""
    there = "is" if count == 1 else "are"
    numbers = "0" if count == 1 else f"a number from 0 to {count - 1}, or from -{count} to -1"
    expected = f"; expected {numbers}" if count else ""
    return NoSuchItemError(f"there is no {name} {item}: there {there} {counted(count, name, plural)}{expected}")


class Immutable(Sealed):
    """Base of classes whose attributes are set in ``__init__``, which ends with ``self._freeze()``."""

    #: What to do instead of setting an attribute, for the message.
    _instead: ClassVar[str] = "make a new one"

    def _freeze(self) -> None:
        object.__setattr__(self, "_frozen", True)

    def __setattr__(self, name: str, value: object) -> None:
        self._refuse(name, "set")
        super().__setattr__(name, value)

    def __delattr__(self, name: str) -> None:
        self._refuse(name, "deleted")
        super().__delattr__(name)

    def _refuse(self, name: str, done: str) -> None:
        if "_frozen" in vars(self):
            raise AttributeError(f"{type(self).__name__} is immutable: {name} cannot be {done}; {self._instead}")


@dataclass(frozen=True, eq=False)
class SealedMatrix(Sealed):
    """A sparse matrix whose parts are immutable.

    The parts of scipy's matrices can be replaced (``matrix.data = other``). So this keeps the parts, and every call of
    ``matrix()`` makes a new object on them without copying: a change to one object does not reach the others.

    Attributes
    ----------
    layout : {"csc", "csr"}
    data, indices, indptr : arrays
        Of scipy.sparse; indices sorted, without duplicates.
    shape : (int, int)
    """

    layout: str
    data: Floats
    indices: NDArray[np.int_]
    indptr: NDArray[np.int_]
    shape: tuple[int, int]

    @classmethod
    def of(cls, matrix: sp.csc_array | sp.csr_array) -> SealedMatrix:
        """A copy of a matrix; a matrix that came from ``matrix()`` shares its parts."""
        if not matrix.has_canonical_format:
            matrix = matrix.copy()
            matrix.sum_duplicates()
        # in the index type that scipy chooses, or every access would convert the indices again
        again = type(matrix)((matrix.data, matrix.indices, matrix.indptr), shape=matrix.shape, copy=False)
        return cls(again.format, again.data, again.indices, again.indptr, again.shape)

    def holds(self, matrix: sp.sparray) -> bool:
        """True if a matrix has the same entries."""
        return bool(matrix.shape == self.shape and (self.matrix() != matrix).nnz == 0)

    def matrix(self) -> Any:
        """A csc_array or csr_array of the immutable parts."""
        kind = sp.csc_array if self.layout == "csc" else sp.csr_array
        matrix = kind((self.data, self.indices, self.indptr), shape=self.shape, copy=False)
        # known here, so that no new object checks it again
        matrix.has_canonical_format = True
        return matrix
