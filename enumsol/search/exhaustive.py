"""All 4^p selections, block by block: the oracle for small p."""

from __future__ import annotations

from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import TooLargeError
from enumsol.model.statuses import FINAL, INEQUALITIES, OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.support.deadlines import look

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.condensation.condensed import ScaledSystem
    from enumsol.selections.solution import SelectionSolution, SelectionSolver
    from enumsol.support.array_types import Codes, Floats, Mask, NDArray

#: Selections solved together in floats, and between two reports of progress.
BLOCK = 2048
#: Selections whose float solution breaks a condition by more than this are dropped without a second look.
_SCREEN = 1e-6


def all_codes(F_positive: tuple[bool, ...]) -> Iterator[Codes]:
    """Every selection: four statuses per node, two (open, in contact) where F = 0."""
    return product(*(FINAL[positive] for positive in F_positive))


def refuse_if_too_large(F_positive: tuple[bool, ...], limit: int, per_second: float) -> int:
    """Number of selections.

    Raises
    ------
    TooLargeError
        There are more than ``limit``; the message estimates the cost.
    """
    count = prod(len(FINAL[positive]) for positive in F_positive)
    if count > limit:
        hours = count / per_second / 3600
        raise TooLargeError(
            f'method="exhaustive" would solve {count:.3g} selections (about {hours:.3g} hours); the limit is {limit} '
            'selections: use method="tree"'
        )
    return count


def exhaustive_float(system: ScaledSystem, solver: SelectionSolver) -> Iterator[tuple[int, SelectionSolution | None]]:
    """Selections examined so far with a solution found, or with None after every block; in floats.

    A vectorised solve screens every block; what it cannot refuse clearly (all conditions nearly hold, or the matrix is
    nearly singular) is decided by ``solver``.
    """
    total = refuse_if_too_large(solver.F_positive, 4**11, 20_000.0)
    codes = all_codes(solver.F_positive)
    done = 0
    while done < total:
        block = np.array([next(codes) for _ in range(min(BLOCK, total - done))], dtype=np.int8)
        for row in block[_candidates(system, block)]:
            look()
            solution = solver.solve(tuple(int(c) for c in row))
            if solution is not None:
                yield done, solution
        done += len(block)
        yield done, None


def _candidates(system: ScaledSystem, block: NDArray[np.int8]) -> Mask:
    """Mask of the selections of a block that may hold a root."""
    p, F, S, g = system.p, system.F, system.S, system.g
    M, b = selection_systems(S, g, F, block)
    # rows and columns of comparable size, so that the reciprocal condition means something
    scale = np.max(np.abs(M), axis=2)
    M /= scale[:, :, None]
    singular = np.linalg.svd(M, compute_uv=False)
    # with a smaller reciprocal condition the screen does not trust a float solution
    doubtful = singular[:, -1] <= 1e-9 * singular[:, 0]
    M[doubtful] = np.eye(2 * p)
    force = np.linalg.solve(M, (b / scale)[:, :, None])[:, :, 0]
    w = g - force @ S
    size = _SCREEN * (1.0 + np.max(np.abs(force), axis=1, keepdims=True))
    n, t, wn, wt = force[:, :p], force[:, p:], w[:, :p], w[:, p:]
    reach = F * n * (1 + _SCREEN) + size
    rows = [n + size, t, reach - t, reach + t, size - wn, wt + size, size - wt]  # in the order of RowKind
    broken = INEQUALITIES[block] & (np.stack(rows, axis=-1) < 0)
    return np.asarray(doubtful | ~np.any(broken, axis=(1, 2)))


def exhaustive_exact(solver: SelectionSolver) -> Iterator[tuple[int, SelectionSolution | None]]:
    """Selections examined so far with the last one's solution, or None; in rationals, one linear solve each."""
    refuse_if_too_large(solver.F_positive, 4**7, 1_000.0)
    for done, codes in enumerate(all_codes(solver.F_positive), start=1):
        yield done, solver.solve(codes)


def selection_systems(S: Floats, g: Floats, F: Floats, codes: NDArray[np.int8]) -> tuple[Floats, Floats]:
    """Linear systems M lambda = b of condensed selections (theory, section 2.3).

    Parameters
    ----------
    S, g, F : condensed compliance (2p, 2p), displacements (2p,) and friction (p,)
    codes : (k, p) integer array of status codes

    Returns
    -------
    M : (k, 2p, 2p) array
    b : (k, 2p) array
        Rows: lambda_n = 0 and lambda_t = 0 (open); w_n = 0 and w_t = 0 (stick); w_n = 0 and lambda_t = +-F lambda_n.
    """
    k, p = codes.shape
    node = np.arange(p)
    closed, stick = codes != OPEN, codes == STICK
    slip = np.where(codes == SLIP_PLUS, 1.0, 0.0) - np.where(codes == SLIP_MINUS, 1.0, 0.0)
    M = np.zeros((k, 2 * p, 2 * p))
    held = np.concatenate([closed, stick], axis=1)
    M += held[:, :, None] * S
    M[:, np.arange(2 * p), np.arange(2 * p)] += ~held
    M[:, p + node, node] -= slip * F
    return M, held * g
