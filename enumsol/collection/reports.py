"""Reports of `check`: for every problem which solutions were found and missed, and which answers are spurious."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.roots.root import summary
from enumsol.support.messages import counted, html_lines

if TYPE_CHECKING:
    import pandas as pd

    from enumsol.collection.entries import CertifiedSolutions, CollectionEntry

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
        rows = [_HEADS, *(report.row() for report in self.problems)]
        widths = [max(len(row[k]) for row in rows) for k in range(len(_HEADS))]
        table = [
            f"{row[0]:<{widths[0]}}  " + "  ".join(f"{c:>{w}}" for c, w in zip(row[1:], widths[1:], strict=True))
            for row in rows
        ]
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
