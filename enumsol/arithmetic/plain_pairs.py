"""Replacement of `enumsol.arithmetic._balls` where nothing is compiled: every operation is left to numpy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self, SupportsIndex

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Places = SupportsIndex | slice | list[int] | NDArray[Any]
    Index = Places | tuple[Places | None, ...]


class Pair:
    """Midpoint and radius of a ball; the operations are those of a subclass."""

    __slots__ = ("mid", "rad")

    _added: Callable[[Self], Self]
    _subtracted: Callable[[Self], Self]
    _multiplied: Callable[[Self], Self]
    _matrix_multiplied: Callable[[Self], Self]
    _sized: Callable[[], Array]

    def __init__(self, mid: Array, rad: Array) -> None:
        self.mid, self.rad = mid, rad

    def __add__(self, other: Self) -> Self:
        return self._added(other)

    def __sub__(self, other: Self) -> Self:
        return self._subtracted(other)

    def __mul__(self, other: Self) -> Self:
        return self._multiplied(other)

    def __matmul__(self, other: Self) -> Self:
        return self._matrix_multiplied(other)

    def __getitem__(self, item: Index) -> Self:
        return type(self)(self.mid[item], self.rad[item])

    @property
    def size(self) -> Array:
        """Largest absolute values."""
        return self._sized()

    @property
    def T(self) -> Self:  # noqa: N802 (as of an array)
        """The transpose."""
        return type(self)(self.mid.T, self.rad.T)

    @classmethod
    def exact(cls, mid: Array) -> Self:
        """No radius."""
        values = np.asarray(mid)
        return cls(values, np.zeros_like(values))
