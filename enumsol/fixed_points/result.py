"""What successive approximations ended with, and its file."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from enumsol.checks import alpha_value, file_path
from enumsol.errors import InvalidArgumentError
from enumsol.files import read_arrays, reading, write_arrays
from enumsol.fixed_points.state import ContactState
from enumsol.texts import counted

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from enumsol.fixed_points.system import Problem

    Vector = NDArray[np.float64]

_FORMAT = 1
_ARRAYS = ("slip_bound", "coefficients", "lambda_n", "lambda_t", "u_n", "u_t", "slip", "increments")
#: Nodes and iterations that a printed result shows.
_PRINTED = 12


class Outcome(enum.Enum):
    """How successive approximations ended."""

    CONVERGED = "converged"
    CYCLE = "cycle"
    ITERATION_LIMIT = "iteration limit"
    NOT_SOLVED = "Tresca problem not solved"
    INTERRUPTED = "interrupted"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class FixedPoint(ContactState):
    """The last iterate of successive approximations: a solution of Coulomb's problem if ``converged``.

    Forces and displacements are those of the last Tresca problem (see ContactState), ``slip_bound`` and
    ``coefficients`` what it was solved with.

    Attributes
    ----------
    outcome : Outcome
    iterations : int
        Tresca problems solved.
    slip : (p,) array
        Slips that coefficients depend on, at the last iterate [length].
    increments : (iterations, 2) array
        Distance of every iterate from its image under Psi in the norms of (theory, (11.4)): slips
        [length * sqrt(area)], and normal forces [sqrt(work)].
    tolerance : float
        Increments of at most this fraction of the load's norm count as zero.
    period : int or None
        Of a cycle.

    Examples
    --------
    >>> import enumsol
    >>> limit = enumsol.successive_approximations(enumsol.gallery.one_node_3d(), alpha=0)
    >>> limit.converged, [str(status) for status in limit.statuses]
    (True, ['slip'])
    >>> max(limit.residuals.values()) < 1e-9
    True
    """

    outcome: Outcome
    iterations: int
    slip: Vector
    increments: NDArray[np.float64]
    tolerance: float
    period: int | None = field(default=None)

    @property
    def converged(self) -> bool:
        """Whether the last increment is below the tolerance."""
        return self.outcome is Outcome.CONVERGED

    @property
    def contraction(self) -> Vector:
        """Ratios of successive increments of the sum of both norms, relative to the load, shape (iterations - 1,) [-].

        Below 1 where Psi contracted. Near a limit at rounding level they say nothing.
        """
        sizes = np.sum(self.increments / self._scales(), axis=1)
        before, after = sizes[:-1], sizes[1:]
        return np.asarray(np.divide(after, before, out=np.zeros_like(before), where=before > 0))

    @property
    def contraction_factor(self) -> float:
        """Geometric mean of the last ratios above rounding, at most five; nan where there are none [-]."""
        sizes = np.sum(self.increments / self._scales(), axis=1)
        ratios = self.contraction[(sizes[1:] > 1e-12) & (self.contraction > 0)][-5:]
        return float(np.exp(np.mean(np.log(ratios)))) if len(ratios) else float("nan")

    def _scales(self) -> Vector:
        largest = np.max(self.increments, axis=0, initial=0.0)
        return np.asarray(np.where(largest > 0, largest, 1.0))

    @property
    def why(self) -> str:
        """How the iteration ended, in a sentence."""
        slips, forces = self.increments[-1] if len(self.increments) else (np.nan, np.nan)
        last = f"last increment {forces:.2e} in forces, {slips:.2e} in slips"
        done = counted(self.iterations, "iteration")
        match self.outcome:
            case Outcome.CONVERGED:
                return f"converged after {done} ({last})"
            case Outcome.CYCLE:
                return (
                    f"not converged: from iteration {self.iterations} on it repeats {self.period} iterates ({last}); "
                    "another start or anderson=5 may reach a solution, enumerate_roots reaches all in 2D"
                )
            case Outcome.ITERATION_LIMIT:
                return f"not converged within {done} ({last})"
            case Outcome.NOT_SOLVED:
                return f"stopped after {done}: a Tresca problem was not solved ({last})"
            case _:
                return f"interrupted after {done} ({last})"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all arrays and the report to a .npz file; the problem itself is not in it.

        Raises
        ------
        InvalidArgumentError
            The file cannot be written.
        """
        report = {
            "alpha": str(self.alpha),
            "outcome": self.outcome.value,
            "iterations": self.iterations,
            "tolerance": self.tolerance,
            "period": self.period,
            "node_ids": [str(label) for label in self.problem.node_ids],
            "statuses": [status.value for status in self.statuses],
        }
        arrays = {name: getattr(self, name) for name in (*_ARRAYS, "u")}
        write_arrays(file_path(path, "path"), _FORMAT, report, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str], problem: Problem) -> FixedPoint:
        """Read what `save` wrote, of the same problem.

        Raises
        ------
        InvalidArgumentError
            The file cannot be read, or is about another problem (another number of contact nodes, other labels).
        """
        place = file_path(path, "path")
        with reading(place, "a fixed point", "FixedPoint.save"):
            report, arrays = read_arrays(place, _FORMAT, _ARRAYS)
            numbers = {name: report[name] for name in ("iterations", "tolerance", "period")}
            alpha, outcome, labels = alpha_value(report["alpha"]), Outcome(report["outcome"]), report["node_ids"]
        if labels != [str(label) for label in problem.node_ids]:
            raise InvalidArgumentError(f"{path} is about other contact nodes; expected those of the problem")
        return cls(problem=problem, alpha=alpha, outcome=outcome, **arrays, **numbers)

    def __repr__(self) -> str:
        lines = [f"FixedPoint at alpha = {float(self.alpha):g}: {self.why}"]
        factor = self.contraction_factor
        if np.isfinite(factor):
            lines.append(f"  contraction factor seen {factor:.3g}")
        lines.append("  residuals " + ", ".join(f"{name} {value:.1e}" for name, value in self.residuals.items()))
        lines += ["  " + line for line in self.to_frame().head(_PRINTED).to_string(index=False).splitlines()]
        if len(self.lambda_n) > _PRINTED:
            lines.append(f"  ... {len(self.lambda_n) - _PRINTED} more nodes")
        return "\n".join(lines)
