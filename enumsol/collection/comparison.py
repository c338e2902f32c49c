"""check: a solver's answers against the certified solutions."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from enumsol.collection.entries import COLLECTION, CertifiedSolutions, CollectionEntry
from enumsol.collection.reports import CollectionReport, JudgedSolution, ProblemReport
from enumsol.collection.submissions import Submission, read_submissions
from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.tresca import TrescaState
from enumsol.support.arguments import file_path, positive_number

if TYPE_CHECKING:
    import os

    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import Floats

    Problem = ContactProblem | ContactProblem3D

#: Of answers, in parts of the size of forces or displacements: above what solvers leave, and a tenth of the least
#: distance that two solutions of the collection may have.
TOLERANCE = 1e-4


def check(solutions: str | os.PathLike[str], tolerance: float = TOLERANCE) -> CollectionReport:
    """Compare a solver's answers with the certified solutions of the collection.

    An answer is one of the solutions if no contact force differs from it by more than the tolerance times the largest
    contact force of all solutions of its problem, or, of an answer that gives displacements, no displacement by more
    than the tolerance times the largest displacement of that solution. A continuum is found by any answer that is as
    close to one of its points. As all solutions are listed, which is proven, an answer that is close to none of them is
    not a solution.

    Parameters
    ----------
    solutions : str or path-like
        A file NAME.npz, .json, .csv or .h5 (fclib), where NAME is a problem of the collection, or a folder of such
        files; docs/collection.md describes them. Problems without a file are not tried.
    tolerance : float
        As above [-]; less than half the distance of any two solutions.

    Raises
    ------
    InvalidArgumentError
        The files cannot be read or do not fit their problems, or the tolerance is too large to tell solutions apart.
    MissingDependencyError
        There is an fclib file, and h5py is not installed.

    Examples
    --------
    A solver that found two of the three solutions of one problem, and something else:

    >>> import enumsol, numpy, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     forces = {"lambda_n": [[0], [1.5], [0.5]], "lambda_t": [[0], [-4], [-1]]}
    ...     numpy.savez(f"{folder}/triangle-3.npz", **forces)
    ...     report = enumsol.collection.check(folder)
    >>> report.problems[0].found_roots, report.problems[0].missed_roots, report.ok
    ((0, 2), (1,), False)
    """
    place = file_path(solutions, "solutions", "a file or a folder of solutions")
    limit = positive_number(tolerance, "tolerance")
    given: dict[str, list[Submission]] = {}
    for submission in read_submissions(place):
        given.setdefault(submission.entry.name, []).append(submission)
    reports = [_compared(COLLECTION[name], given[name], limit) for name in COLLECTION if name in given]
    return CollectionReport(tuple(reports), tuple(name for name in COLLECTION if name not in given), limit)


def _compared(entry: CollectionEntry, submissions: list[Submission], tolerance: float) -> ProblemReport:
    problem, certified = entry.problem(), entry.certified()
    judged: list[JudgedSolution] = []
    for submission in submissions:
        known = KnownSolutions(problem, certified, displacements=submission.displacements)
        known.check_apart(tolerance, entry.name)
        for row, values in enumerate(submission.values):
            nearest, distance = known.nearest(values)
            close = distance <= tolerance
            reason = "" if close else _reason(problem, submission, values)
            judged.append(JudgedSolution(submission.file, row, nearest, distance, close, reason))
    return ProblemReport(entry, certified, tuple(judged))


class KnownSolutions:
    """The certified solutions of a problem as forces or as displacements.

    Forces are measured by the largest one of all solutions, as that of an open one is zero; displacements by those of
    the solution itself, as a body that is free may move many times as far as one that is held.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    certified : CertifiedSolutions
    displacements : bool
        They are compared by their displacements.
    """

    def __init__(self, problem: Problem, certified: CertifiedSolutions, *, displacements: bool) -> None:
        self._problem, self._displacements = problem, displacements
        roots = {("root", k): [self._values(root[None])] for k, root in enumerate(certified.roots)}
        families = {("family", k): list(map(self._values, parts)) for k, parts in enumerate(certified.families)}
        known = roots | families
        sizes = {name: max(float(np.max(np.abs(part))) for part in parts) for name, parts in known.items()}
        largest = max(sizes.values()) or 1.0
        self._known = known
        self._sizes = {name: (size or largest) if displacements else largest for name, size in sizes.items()}

    def _values(self, forces: Floats) -> Floats:
        """Points of shape (k, m) of forces (k, p, d)."""
        if not self._displacements:
            return forces.reshape(len(forces), -1)
        # the rows of the problem: all normal forces, then the tangential ones by their axes
        return np.array([self._problem.condensed.displacement(0, point.T.ravel()) for point in forces])

    def nearest(self, values: Floats) -> tuple[tuple[str, int] | None, float]:
        """The nearest solution, as ("root", k) or ("family", k), and its distance; None for values that are not finite.

        Parameters
        ----------
        values : (m,) array
        """
        if not np.all(np.isfinite(values)):
            return None, np.inf
        distances = {name: self._distance(name, [values[None]], self._sizes[name]) for name in self._known}
        name = min(distances, key=distances.__getitem__)
        return name, distances[name]

    def check_apart(self, tolerance: float, name: str) -> None:
        """Refuse a tolerance at which one answer could be two solutions.

        Raises
        ------
        InvalidArgumentError
            It is not below half of the least distance between two solutions.
        """
        for one, other in combinations(self._known, 2):
            least = self._distance(one, self._known[other], max(self._sizes[one], self._sizes[other]))
            if not tolerance < least / 2:
                raise InvalidArgumentError(
                    f"tolerance is {tolerance:g}, but {' '.join(map(str, one))} and {' '.join(map(str, other))} of "
                    f"{name} are only {least:.2g} apart; expected less than half of that"
                )

    def _distance(self, name: tuple[str, int], others: list[Floats], size: float) -> float:
        """Least distance of a solution from the convex hulls of others, in parts of a size."""
        return min(hull_distance(part / size, other / size) for part in self._known[name] for other in others)


def hull_distance(first: Floats, second: Floats) -> float:
    """Least distance, in the largest component, of the convex hulls of points, (k, m) and (l, m)."""
    if len(first) == len(second) == 1:
        return float(np.max(np.abs(first - second)))
    from scipy.optimize import linprog  # for continua only

    # weights of both hulls and the distance t: |first' v - second' w| <= t, and t is least
    difference = np.hstack([first.T, -second.T])
    bound = -np.ones((len(difference), 1))
    sums = np.zeros((2, len(first) + len(second) + 1))
    sums[0, : len(first)] = sums[1, len(first) : -1] = 1.0
    rows = np.vstack([np.hstack([difference, bound]), np.hstack([-difference, bound])])
    cost = np.append(np.zeros(len(first) + len(second)), 1.0)
    return float(linprog(cost, rows, np.zeros(len(rows)), sums, np.ones(2)).fun)


def _reason(problem: Problem, submission: Submission, values: Floats) -> str:
    """The condition that an answer violates most, in words."""
    if not np.all(np.isfinite(values)):
        return "not all of its values are finite"
    if submission.displacements:
        return ""
    residuals = _residuals(problem, values.reshape(problem.p, -1))
    name = max(residuals, key=residuals.__getitem__)
    return f"its largest residual is {residuals[name]:.1e} ({name})"


def _residuals(problem: Problem, forces: Floats) -> dict[str, float]:
    """Residuals of forces (p, d) by their names, as of a Tresca problem with the bounds lambda_n."""
    w = problem.condensed.free_displacements(0) - problem.condensed.S @ forces.T.ravel()
    u = w.reshape(forces.shape[::-1]).T
    tangential = [part[:, 1] if problem.p * 2 == len(w) else part[:, 1:] for part in (forces, u)]
    state = TrescaState(
        problem=problem,
        alpha=0.0,
        slip_bound=np.maximum(forces[:, 0], 0.0),
        coefficients=problem.friction_at(0).reshape(problem.p, -1),
        lambda_n=forces[:, 0],
        lambda_t=tangential[0],
        u_n=u[:, 0],
        u_t=tangential[1],
    )
    return dict(state.residuals)
