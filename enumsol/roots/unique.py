"""is_unique: whether a problem has one solution at one alpha."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.roots.enumerate import enumerate_roots

if TYPE_CHECKING:
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.arguments import AlphaLike


def is_unique(problem: ContactProblem | ContactProblem3D, alpha: AlphaLike, **options: Any) -> bool | None:
    """Whether the problem has one solution at one alpha, proven either way; None when that stayed open.

    True if all selections are accounted for and one solution is left: by one certificate where that serves (theory,
    section 6.11), otherwise by the search. False as soon as two solutions are proven, or a continuum. The search then
    stops, so that False often costs little.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alpha : float, Fraction, any other real number, or str
        As for `enumerate_roots`.
    **options
        Of `enumerate_roots`, but for ``stop_after``. ``RootSet.unique`` of its result is this answer, and the result
        tells what stayed open. Arithmetic "fast" proves nothing and gives None.

    Returns
    -------
    bool or None

    Raises
    ------
    InvalidArgumentError, TooLargeError, Interrupted, OutputError
        As `enumerate_roots`.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.two_node_square()
    >>> enumsol.is_unique(problem, 1), enumsol.is_unique(problem, 3.5), enumsol.is_unique(problem, 3.5, max_nodes=1)
    (True, False, None)
    """
    return enumerate_roots(problem, alpha, stop_after=2, **options).unique
