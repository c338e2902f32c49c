"""multiplicity_map: the number of solutions over alpha and a second parameter (theory, section 13.4)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.loading.map_rows import MapRow, map_row
from enumsol.model.problem import ContactProblem
from enumsol.search.outcome import Stop, StopReason
from enumsol.support import arguments
from enumsol.support.array_arguments import vector_of
from enumsol.support.immutable import Immutable, Listed
from enumsol.support.keeping import keeping
from enumsol.support.messages import counted
from enumsol.support.plotting import checked_units, in_units, kept
from enumsol.support.workers import spread, workers_of

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from pathlib import Path

    import pandas as pd

    from enumsol.support.array_types import Alpha, AlphaLike
    from enumsol.support.workers import Call

_EXPECTED = (
    'expected {"friction": values}, {"gap": values}, {"load": (direction, values)}, or a pair of a function of a value '
    "that returns a problem and the values"
)


def multiplicity_map(
    problem: ContactProblem | None,
    alphas: tuple[AlphaLike, AlphaLike],
    over: object,
    *,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    time_limit: float | None = None,
    **options: Any,
) -> MultiplicityMap:
    """The number of solutions over alpha and a second parameter: a branch graph at every value of the latter.

    The graphs are proven, each at its value. Between two values nothing is known: anything may happen there.

    Parameters
    ----------
    problem : ContactProblem or None
        None where ``over`` makes the problems.
    alphas : (a, b)
        The interval of alpha of every graph.
    over : mapping or pair
        The second parameter and its values: ``{"friction": values}`` (a constant coefficient at all nodes),
        ``{"gap": values}`` (at all nodes) [length], ``{"load": (direction, values)}`` with a direction of shape (n,)
        that is added to f, times the value; or ``(make, values)`` with a function of a value that returns a problem,
        for example with another mesh.
    executor : concurrent.futures.Executor, optional
        Makes several graphs at a time. A function ``make`` must be one that other processes can import.
    jobs : int, optional
        Number of processes that work, instead of an ``executor``; a script then needs ``if __name__ == "__main__":``.
    progress : callable, optional
        Called with the numbers of values done and of all.
    time_limit : float, optional
        Stop after this many seconds; what was done by then is kept.
    **options
        Of `branch_graph`: ``arithmetic``, ``max_nodes``.

    Returns
    -------
    MultiplicityMap

    Raises
    ------
    InvalidArgumentError
        An argument cannot be used.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` is the map of the values done.

    Examples
    --------
    >>> import enumsol
    >>> square = enumsol.gallery.two_node_square()
    >>> found = enumsol.multiplicity_map(square, (0, 5), {"gap": [0, 0.1]})
    >>> print(found)
    MultiplicityMap over gap, 2 values, alpha in [0, 5]
         gap  solutions  unique until
           0  1 5 3                 3
         0.1  1 3 5            3.6087
    complete: yes (proven at these values; says nothing about those between)
    """
    interval = arguments.alpha_interval(alphas, "alphas")
    name, make, values = _parameter(problem, over)
    arguments.optional_executor(executor, jobs)
    arguments.optional_callable(progress, "progress")
    if "interval" in options or "progress" in options:
        raise InvalidArgumentError("interval and progress are not options here; expected those of branch_graph")
    rows = _Rows(name, interval, values, make, options, arguments.optional_seconds(time_limit))
    with workers_of(executor, jobs) as pool:
        return keeping(
            "multiplicity_map",
            partial(rows.run, pool, progress),
            lambda ending: rows.result(str(Stop(StopReason.of(ending)))),
            lambda found: f" after {len(found.rows)} of {counted(len(values), 'value')}",
        )


@dataclass
class _Rows:
    """The rows of a map while they are made."""

    name: str
    interval: tuple[Alpha, Alpha]
    values: list[float]
    make: Callable[[float], ContactProblem]
    options: dict[str, Any]
    seconds: float | None
    started: float = field(default_factory=time.perf_counter)
    done: dict[int, MapRow] = field(default_factory=dict)

    def run(self, executor: Executor | None, progress: Callable[[int, int], object] | None) -> MultiplicityMap:
        """The map of all rows, while there is time."""
        with closing(spread(executor, self._row_calls())) as found:
            for place, row in found:
                self.done[place] = row
                if progress is not None:
                    progress(len(self.done), len(self.values))
        return self.result()

    def _row_calls(self) -> Iterator[Call[int]]:
        """Calls of map_row, while there is time; the options have what is left of it."""
        for place, value in enumerate(self.values):
            if (left := self._left()) == 0:
                return
            options = self.options if left is None else {**self.options, "time_limit": max(left, 1e-3)}
            yield place, map_row, (self.make, value, self.interval, options)

    def _left(self) -> float | None:
        """Seconds, 0 where the time is over; None without a limit."""
        return None if self.seconds is None else max(self.seconds - (time.perf_counter() - self.started), 0.0)

    def result(self, reason: str | None = None) -> MultiplicityMap:
        """The map of what was done."""
        left = [value for k, value in enumerate(self.values) if k not in self.done]
        why = reason or ("stopped by the time limit" if left else None)
        missing = f"{why}, {counted(len(left), 'value')} not done" if why is not None else None
        rows = tuple(self.done[k] for k in sorted(self.done))
        ends = float(self.interval[0]), float(self.interval[1])
        return MultiplicityMap(self.name, ends, rows, missing)


class MultiplicityMap(Immutable):
    """The number of solutions over alpha and a second parameter (made by ``multiplicity_map``).

    What is said of the rows is proven at the values of the second parameter; between them nothing is known.

    Attributes
    ----------
    name : str
        Of the second parameter.
    interval : (float, float)
        Of alpha.
    rows : tuple of MapRow
        One for every value, in the order given.
    complete : bool
        Every row is proven to be complete, and none is missing.

    Examples
    --------
    >>> import enumsol
    >>> found = enumsol.multiplicity_map(enumsol.gallery.two_node_square(), (0, 5), {"gap": [0, 0.1]})
    >>> found.multiplicity_at(0, 3.5), found.multiplicity_at(0.1, 3.5), len(found.curves)
    (5, 1, 3)
    """

    def __init__(self, name: str, interval: tuple[float, float], rows: tuple[MapRow, ...], missing: str | None) -> None:
        self.name, self.interval, self.missing = name, interval, missing
        self.rows = Listed(rows, "row")
        self._freeze()

    @property
    def values(self) -> tuple[float, ...]:
        """The values of the second parameter that were done."""
        return tuple(row.value for row in self.rows)

    @property
    def complete(self) -> bool:
        """True if every row is proven to be complete, and none is missing."""
        return self.missing is None and bool(self.rows) and all(row.complete for row in self.rows)

    def multiplicity_at(self, value: float, alpha: AlphaLike) -> int:
        """Number of solutions at one of the values and an alpha; a lower bound where the row is not exact.

        Raises
        ------
        InvalidArgumentError
            The map has no such value, or alpha is outside the interval.
        """
        row = next((row for row in self.rows if row.value == value), None)
        if row is None:
            raise InvalidArgumentError(f"value is {arguments.shown(value)}; expected one of the values of the map")
        exact = arguments.alpha_value(alpha)
        if not self.interval[0] <= exact <= self.interval[1]:
            raise InvalidArgumentError(f"alpha is {float(exact):g}; expected it in the interval {list(self.interval)}")
        return row.count_at(exact)

    @cached_property
    def curves(self) -> tuple[tuple[tuple[int, float], ...], ...]:
        """Folds of neighbouring rows linked to curves: pairs of the row's number and alpha.

        Folds are linked that have the same arcs, by their statuses; several of these in one row keep their order.
        This is a guess and no proof: between two values anything may happen.
        """
        open_curves: dict[tuple[Any, int], list[tuple[int, float]]] = {}
        found: list[list[tuple[int, float]]] = []
        order = sorted(range(len(self.rows)), key=lambda k: self.rows[k].value)
        for k in order:
            going: dict[tuple[Any, int], list[tuple[int, float]]] = {}
            counts: dict[Any, int] = {}
            for fold in self.rows[k].folds:
                place = (fold.statuses, counts.get(fold.statuses, 0))
                counts[fold.statuses] = place[1] + 1
                curve = open_curves.get(place)
                if curve is None:
                    curve = []
                    found.append(curve)
                curve.append((k, fold.alpha))
                going[place] = curve
            open_curves = going
        return tuple(tuple(curve) for curve in found)

    def to_frame(self) -> pd.DataFrame:
        """Table with a row per value and range of alpha with one number of solutions.

        Columns: value; first and last of the range; solutions, exact (or a lower bound); complete (the value's graph).
        """
        import pandas as pd

        return pd.DataFrame(
            [
                {
                    "value": row.value,
                    "first": float(row.alphas[k]),
                    "last": float(row.alphas[k + 1]),
                    "solutions": count,
                    "exact": row.exact,
                    "complete": row.complete,
                }
                for row in self.rows
                for k, count in enumerate(row.between)
            ],
            columns=["value", "first", "last", "solutions", "exact", "complete"],
        )

    def plot(self, *, units: tuple[str, str] | None = None, ax: object = None, file: str | Path | None = None) -> Any:
        """A figure: alpha across, the second parameter upwards, numbers of solutions by colour, folds as curves.

        What is proven are the lines in full colour, at the values. The pale colour between them only fills the space,
        and dashed curves link folds: that is not proven.

        Parameters
        ----------
        units : (str, str), optional
            Of forces and of lengths, for the axis of a gap.
        ax : matplotlib Axes or None
        file : path, optional

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        InvalidArgumentError
            The file cannot be written.
        MissingDependencyError
            matplotlib is not installed.
        """
        from enumsol.loading.figures import draw_map  # matplotlib comes with the first picture

        name = in_units(self.name, "length" if self.name == "gap" else None, checked_units(units))
        return kept(draw_map(name, self.rows, self.curves, self.closing_line, ax), file)

    @property
    def closing_line(self) -> str:
        """The closing line of the printed map."""
        if self.missing is not None:
            return f"complete: no ({self.missing})"
        if self.complete:
            return f"complete: yes (proven at these values{self._within()}; says nothing about those between)"
        number = sum(not row.complete for row in self.rows)
        return f"complete: no (not proven at {number} of {counted(len(self.rows), 'value')}{self._within()})"

    def _within(self) -> str:
        """Words on the bound of rigid displacements within which the map of such bodies counts solutions."""
        bounds = [row.within for row in self.rows if row.within is not None]
        if not bounds:
            return ""
        low, high = min(bounds), max(bounds)
        return f", within rigid displacements of {low:g}" + (f" to {high:g}" if high > low else "")

    def __repr__(self) -> str:
        low, high = self.interval
        lines = [
            f"MultiplicityMap over {self.name}, {counted(len(self.rows), 'value')}, alpha in [{low:g}, {high:g}]",
        ]
        width = max([9, *(len(_counts(row)) for row in self.rows)])
        lines.append(f"{self.name:>8}  {'solutions':<{width}}  {'unique until':>12}")
        lines += [f"{row.value:>8.5g}  {_counts(row):<{width}}  {_limit(row):>12}" for row in self.rows]
        return "\n".join([*lines, self.closing_line])


def _counts(row: MapRow) -> str:
    """The numbers of solutions between critical alphas, in their order."""
    text = " ".join(str(count) for k, count in enumerate(row.between) if k == 0 or count != row.between[k - 1])
    return text if row.exact else f"at least {text}"


def _limit(row: MapRow) -> str:
    if row.unique:
        return "the end"
    return "not known" if row.limit is None else f"{row.limit:.6g}"


# -- the second parameter ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Replaced:
    """Makes a problem with another value of a field; other processes can import it."""

    problem: ContactProblem
    name: str
    direction: Any = None

    def __call__(self, value: float) -> ContactProblem:
        """The problem at this value."""
        if self.name == "load":
            return self.problem.replace(f=self.problem.f + value * self.direction)
        if self.name == "friction":
            return self.problem.replace(friction=value, friction_slope=0.0)
        return self.problem.replace(gap=value)


def _parameter(problem: object, over: object) -> tuple[str, Callable[[float], ContactProblem], list[float]]:
    """The name of the second parameter, what makes a problem of a value, and the values.

    Raises
    ------
    InvalidArgumentError
        They are none.
    """
    if isinstance(over, tuple) and len(over) == 2 and callable(over[0]):
        return getattr(over[0], "__name__", "value"), over[0], _numbers(over[1])
    if not isinstance(over, Mapping) or len(over) != 1:
        raise InvalidArgumentError(f"over is {arguments.shown(over)}; {_EXPECTED}")
    ((name, given),) = over.items()
    if name not in ("friction", "gap", "load"):
        raise InvalidArgumentError(f"over is {arguments.shown(over)}; {_EXPECTED}")
    body = arguments.instance_of(problem, ContactProblem, "problem")
    if name != "load":
        return name, _Replaced(body, name), _numbers(given)
    if not isinstance(given, tuple) or len(given) != 2:
        raise InvalidArgumentError(f"over is {arguments.shown(over)}; {_EXPECTED}")
    return name, _Replaced(body, name, vector_of(given[0], "direction", body.n)), _numbers(given[1])


def _numbers(values: object) -> list[float]:
    if isinstance(values, (str, bytes)) or arguments.exact_number(values) is not None or not np.iterable(values):
        raise InvalidArgumentError(f"the values of over are {arguments.shown(values)}; expected a sequence of numbers")
    found = [arguments.finite_number(value, "a value of over") for value in values]
    if not found or len(set(found)) < len(found):
        raise InvalidArgumentError("the values of over are none, or one occurs twice; expected different numbers")
    return found
