"""Conic programs by Clarabel, whose answers are waited for no longer than somebody wants to."""

from __future__ import annotations

from threading import Event
from typing import TYPE_CHECKING, Any

from enumsol.support.deadlines import attended

if TYPE_CHECKING:
    from collections.abc import Sequence

    import scipy.sparse as sp

    from enumsol.support.array_types import Floats


def conic_answer(
    objective: tuple[sp.csc_matrix, Floats],
    limits: tuple[sp.csc_matrix, Floats],
    cones: Sequence[Any],
    size: int,
    **settings: Any,
) -> Any:
    """Clarabel's answer for x that minimises x' P x / 2 + q' x with b - A x in the cones.

    Parameters
    ----------
    objective : (P, q), P upper triangular
    limits : (A, b)
    cones : sequence of clarabel's cones
    size : number of entries of the matrix that it factorizes
    **settings
        Of clarabel.

    Raises
    ------
    TimeOverError
        The deadline that holds here has passed; Clarabel then ends with the iteration that it is at.
    """
    import clarabel  # takes a while to import

    chosen = clarabel.DefaultSettings()
    for name, value in {"verbose": False, **settings}.items():
        setattr(chosen, name, value)
    given_up = Event()

    def work() -> Any:
        solver = clarabel.DefaultSolver(*objective, *limits, list(cones), chosen)
        solver.set_termination_callback(lambda _: given_up.is_set())
        return solver.solve()

    return attended(work, size, "iterations of a conic program", given_up)
