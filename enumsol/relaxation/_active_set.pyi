from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

OPTIMAL: int
BOUND_EXCEEDED: int
STALLED: int

class QPData:
    n: int
    k: int
    m: int
    def __init__(
        self,
        S: NDArray[np.float64],
        c: NDArray[np.float64],
        W: NDArray[np.float64],
        w0: NDArray[np.float64],
        row_start: NDArray[np.intp],
        row_index: NDArray[np.intp],
        row_value: NDArray[np.float64],
        row_rhs: NDArray[np.float64],
    ) -> None: ...
    def put_row(self, r: int, index: Sequence[int], value: Sequence[float]) -> None: ...

class BranchingRule:
    p: int
    candidates: int
    slow: bool
    def __init__(
        self,
        F: NDArray[np.float64],
        slip_rows: NDArray[np.intp],
        slip_modes: NDArray[np.int8],
        candidates: int,
        slow: bool = False,
    ) -> None: ...

class QPState:
    iterations: int
    bound: float
    def __init__(self, data: QPData) -> None: ...
    def copy(self) -> QPState: ...
    def child(
        self, rows: list[int], modes: list[int], last: bool, target: float, tolerance: float, limit: int
    ) -> tuple[QPState, int]: ...
    def switch(self, rows: list[int], modes: list[int]) -> None: ...
    def mode_of(self, row: int) -> int: ...
    @property
    def x_array(self) -> NDArray[np.float64]: ...
    @property
    def w_array(self) -> NDArray[np.float64]: ...
    def multipliers(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]: ...
    def gain(self, row: int, mode: int) -> float: ...
    def at(self, i: int) -> tuple[float, float]: ...
    def choose(self, codes: Sequence[int], rule: BranchingRule, target: float) -> int: ...
    def forced(self, codes: Sequence[int], rule: BranchingRule, target: float) -> tuple[int, ...]: ...
    def solve(self, target: float, tolerance: float, limit: int) -> int: ...
