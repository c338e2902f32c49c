"""Types in annotations: of arrays, of codes of statuses, and of alpha."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Alpha", "AlphaLike", "ArrayLike", "Codes", "Floats", "Indices", "Integers", "Mask", "NDArray"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
#: Status codes of the contact nodes: a partial assignment, or a selection.
Codes = tuple[int, ...]
#: What a value of alpha is kept as.
Alpha = float | Fraction
#: What is accepted as alpha.
AlphaLike = float | Fraction | Decimal | str | np.number[Any] | np.ndarray[Any, Any]
