from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from enumsol.condensation.enclosure import EnclosedSystem
from enumsol.trusted.quadratic_forms import EnclosedForm

class Margins:
    def __init__(self, ends: Sequence[EnclosedSystem], low: NDArray[np.float64], high: NDArray[np.float64]) -> None: ...
    def margin(self, codes: Sequence[int], rows: NDArray[np.intp], values: NDArray[np.float64]) -> float: ...

class FormMargins:
    def __init__(self, form: EnclosedForm, errors: float) -> None: ...
    def margin(self, codes: Sequence[int], rows: NDArray[np.intp], values: NDArray[np.float64]) -> float: ...
