"""multiplicity_table: the roots at many alphas, counted (theory, section 7.12)."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

from enumsol.errors import Interrupted
from enumsol.model.problem import ContactProblem, check_is_problem
from enumsol.model.statuses import STATUSES, ContactStatus
from enumsol.roots.enumerate import enumerate_roots
from enumsol.support.arguments import alpha_list, optional_callable, optional_executor
from enumsol.support.workers import spread

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from concurrent.futures import Executor

    import pandas as pd

    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.roots.root_set import RootSet
    from enumsol.support.arguments import Alpha, AlphaLike


#: Columns with the number of roots at which at least one node has the status.
_KINDS = {status: f"with_{status.name.lower()}" for status in STATUSES}
_KINDS_3D = {
    status: f"with_{status.name.lower()}" for status in (ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP)
}


def multiplicity_table(
    problem: ContactProblem | ContactProblem3D,
    alphas: Iterable[AlphaLike],
    *,
    arithmetic: str = "verified",
    executor: Executor | None = None,
    progress: Callable[[int, int], object] | None = None,
    **options: Any,
) -> pd.DataFrame:
    """Table of the number of solutions at many alphas.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    alphas : iterable of float, Fraction or whatever enumerate_roots accepts as alpha
    arithmetic : str
        Of ``enumerate_roots``.
    executor : concurrent.futures.Executor, optional
        Enumerates at several alphas at a time: a process pool, or a dask Client's ``get_executor()``.
    progress : callable, optional
        Called with the numbers of alphas done and of all.
    **options
        Further keyword arguments of ``enumerate_roots``, such as ``time_limit`` for each alpha.

    Returns
    -------
    pandas.DataFrame
        One row per alpha, in the order given: alpha, roots, families; with_open, with_stick, with_slip_plus and
        with_slip_minus, or in 3D with_slip (isolated roots at which at least one node has the status); index_sum
        (missing where a degree is not known), complete, undecided, stopped (why the search ended early, or missing),
        nodes of the search, and seconds. Where a search was cut short or left something undecided, the counts are
        those of what was found, and so lower bounds. ``attrs["held"]`` says whether supports or springs hold the body:
        if not, the indices may have any sum.

    Raises
    ------
    InvalidArgumentError
        ``alphas`` is one number, an alpha is not a finite number, or makes a friction coefficient negative.
    Interrupted
        On Ctrl-C; ``partial`` is the table of what was done.

    Examples
    --------
    >>> import enumsol
    >>> table = enumsol.multiplicity_table(enumsol.gallery.one_node_triangle(), [1, "8/3", 5])
    >>> table["roots"].tolist(), bool(table["complete"].all())
    ([1, 2, 3], True)
    """
    given: Any = problem
    check_is_problem(given)
    optional_executor(executor)
    optional_callable(progress, "progress")
    chosen = alpha_list(alphas)
    for alpha in chosen:
        problem.friction_at(alpha)
    row = partial(table_row, problem, {"arithmetic": arithmetic, **options})
    done: dict[int, dict[str, Any]] = {}
    try:
        with closing(spread(executor, ((k, row, (alpha,)) for k, alpha in enumerate(chosen)))) as rows:
            for k, found in rows:
                done[k] = found
                if progress is not None:
                    progress(len(done), len(chosen))
    except KeyboardInterrupt as interruption:
        message = f"multiplicity_table was interrupted after {len(done)} of {len(chosen)} alphas"
        raise Interrupted(message, _frame(problem, done)) from interruption
    return _frame(problem, done)


def _frame(problem: ContactProblem | ContactProblem3D, done: dict[int, dict[str, Any]]) -> pd.DataFrame:
    """Rows in the order of their places."""
    import pandas as pd

    counts = ["alpha", "roots", "families", *kinds_of(problem).values(), "index_sum"]
    columns = [*counts, "complete", "undecided", "stopped", "nodes", "seconds"]
    table = pd.DataFrame([done[k] for k in sorted(done)], columns=columns)
    table = table.astype({"index_sum": "Int64"})  # whole numbers, and missing ones
    table.attrs["held"] = problem.modes is None
    return table


def table_row(problem: ContactProblem | ContactProblem3D, options: dict[str, Any], alpha: Alpha) -> dict[str, Any]:
    """One row of the table (a module-level function, so that other processes can import it)."""
    roots = enumerate_roots(problem, alpha, **options)
    counts = kinds(roots)
    return {
        "alpha": float(alpha),
        "roots": len(roots),
        "families": len(roots.families),
        **{name: counts[status] for status, name in kinds_of(problem).items()},
        "index_sum": roots.index_sum,
        "complete": roots.complete,
        "undecided": len(roots.undecided),
        "stopped": roots.stopped,
        "nodes": roots.stats.nodes,
        "seconds": roots.stats.seconds,
    }


def kinds_of(problem: ContactProblem | ContactProblem3D) -> Mapping[ContactStatus, str]:
    """The columns that count roots by the statuses of their nodes."""
    return _KINDS if isinstance(problem, ContactProblem) else _KINDS_3D


def kinds(roots: RootSet) -> Counter[ContactStatus]:
    """For every status the number of isolated roots at which some node has it."""
    return Counter(status for root in roots for status in set(root.statuses))
