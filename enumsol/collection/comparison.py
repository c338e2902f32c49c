"""check: a solver's answers against the certified solutions, the files that hold them, and the report.

A file has contact forces or displacements of the problem that its name begins with, up to the first dot.
docs/collection.md describes the formats.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.auditing.results import KnownSolutions
from enumsol.collection.entries import COLLECTION, INDEX, CertifiedSolutions, CollectionEntry, get
from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.fixed_points.tresca import TrescaState
from enumsol.io.array_files import child, numbers
from enumsol.roots.root import summary
from enumsol.support.arguments import file_path, positive_number
from enumsol.support.array_arguments import real_array
from enumsol.support.array_types import Floats
from enumsol.support.files import reading, unreadable
from enumsol.support.messages import aligned, counted, html_lines, shortened
from enumsol.support.saved import archive_arrays, json_from, table_text

if TYPE_CHECKING:
    import os

    import pandas as pd

    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D

    Problem = ContactProblem | ContactProblem3D

#: Lines about missed solutions, and about spurious answers, that are printed for every problem.
_PRINTED = 5


@dataclass(frozen=True)
class JudgedSolution:
    """An answer of a solver.

    Attributes
    ----------
    file : str
        Name of its file.
    row : int
        Its place in that file, from 0.
    nearest : ("root" or "family", int) or None
        The nearest certified solution, by its kind and number; None of values that are not finite.
    distance : float
        Largest difference from it, in parts of the size of forces or displacements, as of `check` [-].
    found : bool
        It is that solution; otherwise it is spurious, that is, no solution at all.
    reason : str
        For a spurious answer that was given by its forces: what it violates most.

    Examples
    --------
    >>> import enumsol, numpy, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     numpy.savez(f"{folder}/triangle-3.npz", lambda_n=[1.0], lambda_t=[-4.0])
    ...     (answer,) = enumsol.collection.check(folder).problems[0].answers
    >>> answer.found, answer.nearest, answer.distance, answer.reason
    (False, ('root', 2), 0.125, 'its largest residual is 1.8e-01 (dissipation)')
    """

    file: str
    row: int
    nearest: tuple[str, int] | None
    distance: float
    found: bool
    reason: str = ""

    @property
    def nearest_in_words(self) -> str:
        """The nearest certified solution, as in "root 2"."""
        return "" if self.nearest is None else f"{self.nearest[0]} {self.nearest[1]}"

    def record(self) -> dict[str, Any]:
        """A row of a table, and an entry in JSON."""
        given = {"file": self.file, "answer": self.row, "found": self.found}
        return given | {"nearest": self.nearest_in_words, "distance": self.distance, "reason": self.reason}

    def __str__(self) -> str:
        if self.found:
            return f"answer {self.row} of {self.file} is {self.nearest_in_words}"
        near = "" if self.nearest is None else f"the nearest is {self.nearest_in_words}, at a distance of"
        parts = [f"{near} {self.distance:.1e}" if near else "", self.reason]
        return f"answer {self.row} of {self.file} is not a solution: {'; '.join(filter(None, parts))}"


@dataclass(frozen=True)
class ProblemReport:
    """The answers to one problem.

    Attributes
    ----------
    entry : CollectionEntry
    certified : CertifiedSolutions
    answers : tuple of JudgedSolution

    Examples
    --------
    >>> import enumsol, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     problem, file = enumsol.collection.get("square-5").problem(), f"{folder}/square-5.csv"
    ...     enumsol.enumerate_roots(problem, 0).to_frame().to_csv(file)
    ...     (report,) = enumsol.collection.check(folder).problems
    >>> report.found_roots, report.spurious, report.ok
    ((0, 1, 2, 3, 4), (), True)
    """

    entry: CollectionEntry
    certified: CertifiedSolutions
    answers: tuple[JudgedSolution, ...]

    @cached_property
    def _found(self) -> Counter[tuple[str, int] | None]:
        return Counter(answer.nearest for answer in self.answers if answer.found)

    @property
    def found_roots(self) -> tuple[int, ...]:
        """Numbers of the isolated solutions that were found."""
        return tuple(k for k in range(self.entry.roots) if self._found["root", k])

    @property
    def missed_roots(self) -> tuple[int, ...]:
        """Numbers of the isolated solutions that were missed."""
        return tuple(k for k in range(self.entry.roots) if not self._found["root", k])

    @property
    def found_families(self) -> tuple[int, ...]:
        """Numbers of the continua of which some solution was found."""
        return tuple(k for k in range(self.entry.families) if self._found["family", k])

    @property
    def missed_families(self) -> tuple[int, ...]:
        """Numbers of the continua of which no solution was found."""
        return tuple(k for k in range(self.entry.families) if not self._found["family", k])

    @property
    def spurious(self) -> tuple[JudgedSolution, ...]:
        """Answers that are not solutions, which is proven because all solutions are known."""
        return tuple(answer for answer in self.answers if not answer.found)

    @property
    def repeated(self) -> int:
        """Number of answers that repeat an isolated solution of an earlier answer."""
        return sum(count - 1 for name, count in self._found.items() if name is not None and name[0] == "root")

    @property
    def ok(self) -> bool:
        """Every solution was found, and every answer is one."""
        return not (self.missed_roots or self.missed_families or self.spurious)

    def record(self) -> dict[str, Any]:
        """Everything as numbers, texts and lists, for JSON."""
        return {
            "name": self.entry.name,
            "found_roots": self.found_roots,
            "missed_roots": self.missed_roots,
            "found_families": self.found_families,
            "missed_families": self.missed_families,
            "spurious": len(self.spurious),
            "repeated": self.repeated,
            "answers": [answer.record() for answer in self.answers],
        }

    def row(self) -> tuple[str, ...]:
        """A row of the printed table."""
        counts = (
            self.entry.roots + self.entry.families,
            len(self.answers),
            len(self.found_roots) + len(self.found_families),
            len(self.missed_roots) + len(self.missed_families),
            len(self.spurious),
            self.repeated,
        )
        return (self.entry.name, *map(str, counts))

    def lines(self) -> list[str]:
        """Lines about missed solutions and spurious answers, one each."""
        missed = [f"missed root {k} ({self._about(k)})" for k in self.missed_roots]
        missed += [f"missed family {k}, a continuum" for k in self.missed_families]
        lines = []
        for part in (missed, list(map(str, self.spurious))):
            more = len(part) - _PRINTED
            lines += [*part[:_PRINTED], *([f"... {more} more"] if more > 0 else [])]
        return [f"{self.entry.name}: {line}" for line in lines]

    def _about(self, k: int) -> str:
        """A root in words."""
        largest = np.max(self.certified.roots[k][:, 0])
        return f"{summary(self.certified.statuses[k])}; largest lambda_n {largest:.3g}"


_HEADS = ("problem", "solutions", "answers", "found", "missed", "spurious", "repeated")


@dataclass(frozen=True)
class CollectionReport:
    """A solver's answers against the certified solutions.

    Attributes
    ----------
    problems : tuple of ProblemReport
        Of the problems for which there were answers.
    not_tried : tuple of str
        Names of the others.
    tolerance : float
        The distance up to which an answer is a solution [-].

    Examples
    --------
    >>> import enumsol, numpy, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     numpy.savez(f"{folder}/triangle-3.npz", lambda_n=[[0], [0.5]], lambda_t=[[0], [-1]])
    ...     enumsol.collection.check(f"{folder}/triangle-3.npz")
    problem     solutions  answers  found  missed  spurious  repeated
    triangle-3          3        2      1       2         1         0
    triangle-3: missed root 1 (slip-; largest lambda_n 0.333)
    triangle-3: missed root 2 (stick; largest lambda_n 1.5)
    triangle-3: answer 1 of triangle-3.npz is not a solution: the nearest is root 1, at a distance of 1.7e-01; its \
largest residual is 3.1e-01 (dissipation)
    1 problem tried, 0 of them with all solutions and no other answer; tolerance 0.0001
    """

    problems: tuple[ProblemReport, ...]
    not_tried: tuple[str, ...]
    tolerance: float

    @property
    def ok(self) -> bool:
        """True if all solutions of every problem that was tried were found, and every answer is one of them."""
        return all(report.ok for report in self.problems)

    def to_frame(self) -> pd.DataFrame:
        """A table with one row per answer: problem, file, answer, found, nearest, distance, reason."""
        import pandas as pd  # for frames only

        columns = ["problem", "file", "answer", "found", "nearest", "distance", "reason"]
        rows = [{"problem": report.entry.name} | a.record() for report in self.problems for a in report.answers]
        return pd.DataFrame(rows, columns=columns)

    def summary(self) -> dict[str, Any]:
        """Everything as numbers, texts and lists, for JSON."""
        about = {"tolerance": self.tolerance, "ok": self.ok}
        return about | {"problems": [report.record() for report in self.problems], "not_tried": self.not_tried}

    def __repr__(self) -> str:
        table = aligned([_HEADS, *(report.row() for report in self.problems)])
        good, tried = sum(report.ok for report in self.problems), counted(len(self.problems), "problem")
        return "\n".join(
            [
                *table,
                *(line for report in self.problems for line in report.lines()),
                f"{tried} tried, {good} of them with all solutions and no other answer; tolerance {self.tolerance:g}",
            ]
        )

    def _repr_html_(self) -> str:
        return html_lines(repr(self).splitlines())


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
        known = _known(problem, certified, displacements=submission.displacements)
        known.check_apart(tolerance, entry.name)
        for row, values in enumerate(submission.values):
            nearest, distance = known.nearest(values)
            close = distance <= tolerance
            reason = "" if close else _reason(problem, submission, values)
            judged.append(JudgedSolution(submission.file, row, nearest, distance, close, reason))
    return ProblemReport(entry, certified, tuple(judged))


def _known(problem: Problem, certified: CertifiedSolutions, *, displacements: bool) -> KnownSolutions:
    """Certified solutions as forces, or as displacements."""

    def values(forces: Floats) -> Floats:
        """Points of shape (k, m) of forces (k, p, d)."""
        if not displacements:
            return forces.reshape(len(forces), -1)
        # the rows of the problem: all normal forces, then the tangential ones by their axes
        return np.array([problem.condensed.displacement(0, point.T.ravel()) for point in forces])

    roots = [values(root[None]) for root in certified.roots]
    families = [list(map(values, parts)) for parts in certified.families]
    return KnownSolutions(roots, families, each_by_itself=displacements)


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


#: Arrays that give solutions, the first ones that are there count: forces, those in the order of fclib, displacements.
_GIVEN = (("lambda_n", "lambda_t"), ("r",), ("u",))
_EXPECTED = "lambda_n and lambda_t, or r, or u"
#: Beginnings of the names of arrays by which a file of a problem is told from one of solutions.
_PROBLEM = ("A", "A_data", "fclib_global", "fclib_local")


@dataclass(frozen=True)
class Submission:
    """Solutions of one problem that a solver claims to have found.

    Attributes
    ----------
    entry : CollectionEntry
    file : str
        Name of the file.
    displacements : bool
        ``values`` are displacements u (k, n), else contact forces (k, p d), node by node and the normal one first.
    values : array
    """

    entry: CollectionEntry
    file: str
    displacements: bool
    values: Floats


def read_submissions(place: Path) -> list[Submission]:
    """Solutions in a file, or in a folder of files; files that hold problems or are of other kinds are passed over.

    Raises
    ------
    InvalidArgumentError
        There is no such place or no solution in it, a file belongs to no problem of the collection, or it does not hold
        what its problem needs.
    MissingDependencyError
        There is an fclib file, and h5py is not installed.
    """
    if place.is_dir():
        files = [file for file in sorted(place.iterdir()) if file.suffix in _READERS and file.is_file()]
        files = [file for file in files if file.name != INDEX]
    else:
        reason = unreadable(place)
        if reason is not None:
            raise InvalidArgumentError(f"solutions {place}: {reason}; expected a file or folder of solutions")
        if place.suffix not in _READERS:
            raise InvalidArgumentError(
                f"solutions {place}: its name ends in {place.suffix!r}; expected a folder, or one of {_ENDINGS}"
            )
        files = [place]
    found = [submission for file in files if (submission := _read(file)) is not None]
    if not found:
        raise InvalidArgumentError(
            f"solutions {place}: there are none in it; expected files NAME{_ENDINGS.replace(', ', ', NAME')}, where "
            "NAME is one of enumsol collection list"
        )
    return found


def _read(file: Path) -> Submission | None:
    """The solutions in a file, or None if it holds a problem."""
    name = file.name.partition(".")[0]
    try:
        with reading(file, "solutions", "solutions as in docs/collection.md"):
            given = _READERS[file.suffix](file)
        if any(name in given for name in _PROBLEM):
            return None
        return _submission(get(name), file.name, given)
    except InvalidArgumentError as error:
        if str(error).startswith(str(file)):
            raise
        raise InvalidArgumentError(f"{file}: {error}") from error


def _submission(entry: CollectionEntry, file: str, content: Mapping[str, Any]) -> Submission:
    """Forces or displacements among the arrays of a file, in one row for every solution."""
    names = next((names for names in _GIVEN if all(name in content for name in names)), None)
    if names is None:
        raise InvalidArgumentError(f"it holds {', '.join(content) or 'nothing'}; expected {_EXPECTED}")
    given = {name: content[name] for name in names}
    p, d = entry.p, entry.dimension
    about = f"as {entry.name} has p = {p} contact nodes and n = {entry.n} degrees of freedom"
    shapes = {"lambda_n": (p,), "lambda_t": (p,) if d == 2 else (p, 2), "r": (d * p,), "u": (entry.n,)}
    rows = {}
    for name, value in given.items():
        array, shape = real_array(value, name, error=InvalidArgumentError, finite=False), shapes[name]
        if array.shape == shape:
            array = array[None]
        elif array.shape[:1] == (0,):
            array = np.zeros((0, *shape))
        if array.shape[1:] != shape:
            sizes = ", ".join(map(str, shape))
            comma = "," if len(shape) == 1 else ""
            raise InvalidArgumentError(
                f"{name} has shape {array.shape}; expected (k, {sizes}) for k solutions, or ({sizes}{comma}) for one, "
                f"{about}"
            )
        rows[name] = array
    if "lambda_n" not in rows:
        ((name, values),) = rows.items()
        return Submission(entry, file, name == "u", values)
    normal, tangential = rows["lambda_n"], rows["lambda_t"]
    if len(normal) != len(tangential):
        raise InvalidArgumentError(
            f"lambda_n holds {len(normal)} solutions and lambda_t {len(tangential)}; expected the same number"
        )
    forces = np.concatenate([normal[:, :, None], tangential.reshape(len(normal), p, d - 1)], axis=2)
    return Submission(entry, file, False, forces.reshape(len(normal), p * d))


# -- formats -----------------------------------------------------------------------------------------------------------


def _npz(file: Path) -> dict[str, Any]:
    with file.open("rb") as stream:
        return archive_arrays(stream)


def _json(file: Path) -> dict[str, Any]:
    """An object with arrays, a list of objects, or what ``enumsol roots --json`` writes."""
    content = json_from(file.read_bytes())
    if isinstance(content, dict) and isinstance(content.get("roots"), list):
        content = [*content["roots"], *_vertices(content.get("families", []))]
    if isinstance(content, dict):
        return content
    if not isinstance(content, list) or not all(isinstance(item, dict) for item in content):
        raise InvalidArgumentError(f"{file}: it holds no object and no list of objects; expected {_EXPECTED}")
    names = [name for name in sum(_GIVEN, ()) if not content or all(name in item for item in content)]
    return {name: [item[name] for item in content] for name in names}


def _vertices(families: list[Any]) -> Iterator[dict[str, Any]]:
    """The vertices of continua in what ``enumsol roots --json`` writes."""
    for family in families:
        for part in family["polytopes"]:
            for vertex in part["vertices"]:
                yield dict(zip(_GIVEN[0], zip(*vertex, strict=True), strict=True))


def _csv(file: Path) -> dict[str, Any]:
    """Rows with a solution, a node and its forces; ``enumsol roots --csv`` writes such a file."""
    import pandas as pd  # for tables only

    frame = pd.read_csv(table_text(file)).rename(columns={"root": "solution"})
    normal, tangential = "lambda_n", [name for name in frame.columns if name.startswith("lambda_t")]
    missing = [name for name in ("node", normal) if name not in frame] + ([] if tangential else ["lambda_t"])
    if missing:
        found = shortened(", ".join(map(str, frame.columns)))
        raise InvalidArgumentError(
            f"{file}: the column {missing[0]} is missing (found {found}); expected solution, node, lambda_n and "
            "lambda_t, in 3D lambda_t1 and lambda_t2"
        )
    if "solution" not in frame:
        frame["solution"] = 0
    forces = [
        part.sort_values("node")[[normal, *tangential]].to_numpy(dtype=float)
        for _, part in frame.groupby("solution", sort=False)
        if _has_all_nodes(part["node"], file)
    ]
    return {
        normal: [part[:, 0] for part in forces],
        "lambda_t": [part[:, 1] if len(tangential) == 1 else part[:, 1:] for part in forces],
    }


def _has_all_nodes(nodes: pd.Series, file: Path) -> bool:
    if sorted(nodes) != list(range(len(nodes))):
        raise InvalidArgumentError(
            f"{file}: a solution has the nodes {sorted(nodes)}; expected the rows of Bn from 0, each of them once"
        )
    return True


def _h5(file: Path) -> dict[str, Any]:
    """The group ``solution`` that fclib_write_solution adds to a problem."""
    h5py = MissingDependencyError.imported("h5py", "fclib files", "fclib")
    with h5py.File(file, "r") as content:
        if "solution" not in content:
            return dict.fromkeys(content)
        group = child(content, "solution")
        return {"r": numbers(group, "r")} if "r" in group else dict.fromkeys(group)


_READERS = {".npz": _npz, ".json": _json, ".csv": _csv, ".h5": _h5, ".hdf5": _h5}
_ENDINGS = ", ".join(_READERS)
