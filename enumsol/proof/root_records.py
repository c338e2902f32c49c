"""Records of roots that are alone below an assignment (docs/proof_format.md, under Leaves)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.proof.reading import multipliers_from, numbers_from
from enumsol.trusted.status_rows import ROW_KINDS, final_codes
from enumsol.trusted.uniqueness_in_contact import numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_ENTRIES = 9


@dataclass(frozen=True)
class LoneRoot:
    """What shows that a root is the only one below an assignment: the arguments of ``lone_root``.

    Attributes
    ----------
    selection : final codes
    weights, strengths, rows, values : arrays
    """

    selection: tuple[int, ...]
    weights: NDArray[np.float64]
    strengths: NDArray[np.float64]
    rows: NDArray[np.intp]
    values: NDArray[np.float64]

    @classmethod
    def read(cls, record: list[Any], codes: Sequence[int], friction: Sequence[bool]) -> LoneRoot:
        """What a record "a" says, of which nothing is proven.

        Raises
        ------
        ValueError
            The record makes no sense.
        """
        p = len(codes)
        if len(record) != _ENTRIES:
            raise ValueError(f"it has {len(record)} entries; expected {_ENTRIES}")
        selection = record[1]
        if not isinstance(selection, list) or len(selection) != p or not all(type(code) is int for code in selection):
            raise ValueError(f"its selection is no list of {p} codes")
        if any(code not in final_codes(positive) for code, positive in zip(selection, friction, strict=True)):
            raise ValueError("a node cannot have the code that its selection gives it")
        nodes, own = numbers_of(codes, friction)
        weights = numbers_from(record[2], len(nodes) + 3 * int(np.count_nonzero(own)))
        strengths = numbers_from(record[3], 2 * p).reshape(2, -1)
        return cls(tuple(selection), weights, strengths, *multipliers_from(record[4:6], ROW_KINDS * p))

    @property
    def arguments(self) -> tuple[Any, ...]:
        """Those of ``trusted.uniqueness_in_contact.lone_root`` after the assignment."""
        return self.selection, self.weights, self.strengths, self.rows, self.values
