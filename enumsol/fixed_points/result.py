"""Result of successive approximations, and its file."""

from __future__ import annotations

import enum
import textwrap
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fixed_points.system import checked_problem, driven
from enumsol.fixed_points.tresca import TrescaState
from enumsol.model.rigid_modes import modes_of
from enumsol.support.arguments import alpha_value, file_path, optional_count, positive_integer, positive_number
from enumsol.support.array_arguments import real_array
from enumsol.support.files import read_arrays, reading, write_arrays
from enumsol.support.messages import counted

if TYPE_CHECKING:
    import os

    from enumsol.fixed_points.system import Problem
    from enumsol.support.array_types import Floats


_FORMAT = 1
_ARRAYS = ("slip_bound", "coefficients", "lambda_n", "lambda_t", "u_n", "u_t", "slip", "increments")
#: What a body that nothing holds has beside them; the second is empty where it is None.
_RIGID_ARRAYS = ("rigid_coordinates", "free_motion")
#: Nodes that a printed result shows.
_PRINTED = 32


def _names(body: Problem) -> tuple[str, ...]:
    return _ARRAYS if body.held else _ARRAYS + _RIGID_ARRAYS


def _check_shapes(arrays: dict[str, Floats], body: Problem, path: str) -> None:
    p, modes = body.p, body.modes.r
    tangential = body.slip_offset.shape  # (p,) in 2D, (p, 2) in 3D
    shapes = {"coefficients": (p, len(tangential)), "lambda_t": tangential, "u_t": tangential}
    shapes["increments"] = (len(arrays["increments"]), 2) if arrays["increments"].ndim else (0, 2)
    shapes |= dict.fromkeys(_RIGID_ARRAYS, (modes,))
    for name, array in arrays.items():
        expected = shapes.get(name, (p,))
        if array.shape != expected and not (name == "free_motion" and array.size == 0):
            raise InvalidArgumentError(
                f"{path} has {name} of shape {array.shape}; expected {expected}, as the problem has it"
            )


class Outcome(enum.Enum):
    """Outcomes of successive approximations."""

    CONVERGED = "converged"
    ROUNDING = "rounding"
    CYCLE = "cycle"
    ITERATION_LIMIT = "iteration limit"
    NOT_HELD = "not held"
    NOT_FEASIBLE = "not feasible"
    NOT_SOLVED = "Tresca problem not solved"
    INTERRUPTED = "interrupted"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class FixedPoint(TrescaState):
    """The last iterate of successive approximations: a solution of Coulomb's problem if ``converged``.

    Forces and displacements are those of the last Tresca problem (see TrescaState), ``slip_bound`` and
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
        See `successive_approximations`.
    rounding : float
        Largest change of a contact force that was seen to come from rounding, relative to the largest force (theory,
        section 11.7); nan where none was looked for. Where it is above the tolerance the error may be larger still.
    period : int or None
        Of a cycle.
    free_motion : (r,) array or None
        Of a body that nothing holds, coordinates of a rigid displacement. Where the outcome is "not feasible" the load
        drives the body along it, and no forces within ``slip_bound`` are in balance (the forces kept are those of the
        iterate before); where it is "not held", no contact forces at all are (those kept are zero). Otherwise the body
        may move by it and be in equilibrium with the same forces: its rigid displacement is not unique. None if there
        is no such displacement.

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
    slip: Floats
    increments: Floats
    tolerance: float
    rounding: float = field(default=float("nan"))
    period: int | None = field(default=None)
    free_motion: Floats | None = field(default=None)

    @property
    def converged(self) -> bool:
        """True if the estimated distance from the limit is within the tolerance."""
        return self.outcome is Outcome.CONVERGED

    @property
    def beyond_bound(self) -> bool:
        """True if a body that nothing holds has moved as a whole beyond the bound of its rigid displacement.

        `enumerate_roots` lists solutions within this bound, and so not this one (theory, section 14.2).
        """
        q, body = self.rigid_coordinates, self.problem
        if q is None or body.held:
            return False
        return bool(np.any(np.abs(q) > body.modes.reach(body.rigid_reach)))

    @property
    def contraction(self) -> Floats:
        """Ratios of successive increments of the sum of both norms, relative to the load, shape (iterations - 1,) [-].

        Below 1 where Psi contracted. Near a limit at rounding level they say nothing.
        """
        sizes = np.sum(self.increments / self._scales(), axis=1)
        before, after = sizes[:-1], sizes[1:]
        return np.asarray(np.divide(after, before, out=np.zeros_like(before), where=before > 0))

    @property
    def contraction_factor(self) -> float:
        """Geometric mean of the last ratios above rounding, at most five; nan where there are none [-].

        What follows an increment within the tolerance comes from a correction for rounding, and does not count.
        """
        sizes = np.sum(self.increments / self._scales(), axis=1)
        seen = (sizes[:-1] > self.tolerance) & (sizes[1:] > 1e-12) & (self.contraction > 0)
        ratios = self.contraction[seen][-5:]
        return float(np.exp(np.mean(np.log(ratios)))) if len(ratios) else float("nan")

    def _scales(self) -> Floats:
        largest = np.max(self.increments, axis=0, initial=0.0)
        return np.asarray(np.where(largest > 0, largest, 1.0))

    @property
    def why(self) -> str:
        """Sentence on how the iteration ended."""
        slips, forces = self.increments[-1] if len(self.increments) else (np.nan, np.nan)
        depends = getattr(self.problem, "depends_on_solution", False)
        last = f"last increment {forces:.2e} in forces" + (f", {slips:.2e} in slips" if depends else "")
        solved = counted(self.iterations, "iteration")
        body: Any = self.problem
        motion: Any = self.free_motion  # of a body that is not held
        match self.outcome:
            case Outcome.CONVERGED:
                text = f"converged after {solved} ({last})"
                if motion is not None:
                    modes = modes_of(body.rigid_modes, motion)
                    text += f"; the body may move on along {modes} with the same forces: "
                    text += "its rigid displacement is not unique"
                if self.beyond_bound:
                    text += f"; it is beyond the bound {body.rigid_reach:g} of rigid displacements, where no roots are "
                    text += "listed"
                return text
            case Outcome.NOT_HELD if depends:
                return (
                    "no contact forces hold the body with the coefficients of friction at zero slip, along "
                    f"{modes_of(body.rigid_modes, motion)}; there may be a solution all the same, to which another "
                    "start may lead"
                )
            case Outcome.NOT_HELD:
                return (
                    "there is no solution with forces of less than a million times the load: no contact forces hold "
                    f"the body, however large friction is, along {modes_of(body.rigid_modes, motion)}"
                )
            case Outcome.NOT_FEASIBLE:
                words = driven(body, self.alpha, self.slip_bound, self.coefficients, np.asarray(motion))
                return (
                    f"stopped after {solved}: no forces within the slip bounds that it came to hold the body "
                    f"({words}); there may be a solution all the same, to which another start may lead"
                )
            case Outcome.ROUNDING:
                return (
                    f"not converged to the tolerance: after {solved} rounding still changes contact forces by "
                    f"{self.rounding:.1e} of the largest ({last}; is the body almost free to move?)"
                )
            case Outcome.CYCLE:
                return (
                    f"not converged: from iteration {self.iterations} on it repeats {self.period} iterates ({last}); "
                    "another start or anderson=5 may reach a solution, and enumerate_roots reaches all of them"
                )
            case Outcome.ITERATION_LIMIT:
                return f"not converged within {solved} ({last})"
            case Outcome.NOT_SOLVED:
                return f"stopped after {solved}: a Tresca problem was not solved ({last})"
            case _:
                return f"interrupted after {solved} ({last})"

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
            "rounding": repr(self.rounding),
            "period": self.period,
            "node_ids": [str(label) for label in self.problem.node_ids],
            "statuses": self.statuses,
        }
        arrays = {name: getattr(self, name) for name in (*_names(self.problem), "u")}
        arrays = {name: np.zeros(0) if array is None else array for name, array in arrays.items()}
        write_arrays(file_path(path, "path"), _FORMAT, report, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str], problem: Problem) -> FixedPoint:
        """Read what `save` wrote, of the same problem.

        Raises
        ------
        InvalidArgumentError
            The file cannot be read, or is about another problem (another number of contact nodes, other labels).
        """
        body = checked_problem(problem)
        place = file_path(path, "path")
        with reading(place, "a fixed point", "FixedPoint.save"):
            found, kept = read_arrays(place, _FORMAT, _names(body))
            arrays = {
                name: real_array(value, f"{name} in {path}", error=InvalidArgumentError) for name, value in kept.items()
            }
            report: dict[str, Any] = {
                "iterations": positive_integer(found["iterations"], f"iterations in {path}", least=0),
                "tolerance": positive_number(found["tolerance"], f"tolerance in {path}"),
                "rounding": float(found.get("rounding", "nan")),
                "period": optional_count(found["period"], f"period in {path}"),
            }
            alpha, outcome, labels = alpha_value(found["alpha"]), Outcome(found["outcome"]), found["node_ids"]
        if labels != [str(label) for label in body.node_ids]:
            raise InvalidArgumentError(f"{path} is about other contact nodes; expected those of the problem")
        _check_shapes(arrays, body, str(path))
        motion = arrays.pop("free_motion", np.zeros(0))
        more = report | arrays | {"free_motion": motion if motion.size else None}
        return cls(problem=body, alpha=alpha, outcome=outcome, **more)

    def __repr__(self) -> str:
        factor = self.contraction_factor
        seen = f"; contraction factor seen {factor:.3g}" if np.isfinite(factor) else ""
        found = ", ".join(f"{name} {value:.1e}" for name, value in self.residuals.items())
        texts = [f"FixedPoint at alpha = {float(self.alpha):g}: {self.why}{seen}", f"residuals {found}"]
        if self.rigid_coordinates is not None:
            moved = ", ".join(f"{value:.5g}" for value in self.rigid_coordinates)
            texts.append(f"rigid displacement, its coordinates: {moved}")
        lines = [line for k, text in enumerate(texts) for line in _wrapped(text, "  " * k)]
        return "\n".join([*lines, *self._table()])

    def _table(self) -> list[str]:
        """Lines of the first nodes: with coefficients where they differ, and with bounds that are not lambda_n."""
        frame = self.to_frame()
        names = [str(name) for name in frame]
        coefficients = [name for name in names if name in ("F", "F1", "F2")]
        varying = [name for name in coefficients if frame[name].nunique() > 1]
        constant = ", ".join(f"{name} {frame[name][0]:g}" for name in coefficients if name not in varying)
        shown = ["node", "status", *varying]
        size = float(np.max(self.lambda_n, initial=0.0))
        if not np.allclose(self.slip_bound, self.lambda_n, rtol=1e-6, atol=1e-6 * size):
            shown.append("slip_bound")
        for prefix in ("lambda", "u_"):  # rounding beside what is there is printed as the zero that it stands for
            group = [name for name in names if name.startswith(prefix)]
            noise = 1e-12 * float(np.max(np.abs(frame[group].to_numpy()), initial=0.0))
            frame[group] = frame[group].where(frame[group].abs() > noise, 0.0)
            shown += group
        text = frame[shown].head(_PRINTED).to_string(index=False, float_format=lambda value: f"{value:.5g}")
        lines = ["  " + line for line in text.splitlines()]
        if len(frame) > _PRINTED:
            lines.append(f"  ... {counted(len(frame) - _PRINTED, 'more node')}; to_frame(), --csv and --json have all")
        return [f"  {constant} at all nodes", *lines] if constant else lines


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, 80, initial_indent=indent, subsequent_indent="    ", break_long_words=False)
