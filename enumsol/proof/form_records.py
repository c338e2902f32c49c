"""Forms as proofs declare them (docs/proof_format.md, under Forms)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.proof.reading import codes_from, numbers_from
from enumsol.trusted.status_rows import refines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_ENTRIES = 7


@dataclass(frozen=True, eq=False)
class DeclaredForm:
    """What a record "q" says, of which nothing is proven.

    Attributes
    ----------
    codes : status codes of the assignment for which it is made
    multipliers : (4, p) array
    weight : float
    """

    codes: tuple[int, ...]
    multipliers: NDArray[np.float64]
    weight: float

    @classmethod
    def read(cls, record: list[Any], p: int) -> DeclaredForm:
        """The form in a record.

        Raises
        ------
        ValueError
            The record makes no sense.
        """
        if len(record) != _ENTRIES:
            raise ValueError(f"a form has {len(record)} entries; expected {_ENTRIES}")
        try:
            codes = tuple(codes_from([record[1]], p)[0].tolist())
            multipliers = np.array([numbers_from(values, p) for values in record[2:6]])
            weight = float(numbers_from([record[6]], 1)[0])
        except ValueError as error:
            raise ValueError(f"a form cannot be read: {error}") from None
        if np.any(multipliers[2:] < 0) or weight < 0:
            raise ValueError("a multiplier of a form is negative and must not be")
        return cls(codes, multipliers, weight)

    def same(self, other: DeclaredForm) -> bool:
        """Whether another record says the same."""
        alike = self.codes == other.codes and self.weight == other.weight
        return alike and np.array_equal(self.multipliers, other.multipliers)

    def holds(self, codes: Sequence[int]) -> bool:
        """Whether a partial assignment is part of the one that this form is made for."""
        return all(refines(code, mine) for code, mine in zip(codes, self.codes, strict=True))
