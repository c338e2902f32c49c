"""multiplicity_map: the number of solutions over alpha and a second parameter (theory, section 13.4)."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial
from itertools import pairwise
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.branches.construction import branch_graph
from enumsol.branches.samples import RUNNING_AWAY, check_without
from enumsol.errors import InvalidArgumentError
from enumsol.model.problem import ContactProblem
from enumsol.search.outcome import Stop, StopReason
from enumsol.support import arguments
from enumsol.support.array_arguments import vector_of
from enumsol.support.deadlines import Deadline, keeping
from enumsol.support.immutable import Immutable, Listed
from enumsol.support.messages import counted
from enumsol.support.plotting import area_entry, axes_of, checked_units, figure_of, in_units, kept, line_entry
from enumsol.support.workers import spread, workers_of

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from pathlib import Path

    import pandas as pd

    from enumsol.branches.graph import BranchGraph
    from enumsol.support.array_types import Alpha, AlphaLike, Floats
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
    without: str | None = None,
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
    without : "running away", optional
        Leave out solutions that are proven to run away (see `stability`; the problems need a mass or a mesh). Undecided
        ones are counted, and then the map is not complete; counted are also those at vertices of the graphs, as at the
        ends of the interval.
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
    if without is not None:
        arguments.one_of(without, "without", (RUNNING_AWAY,))
        if problem is not None:
            check_without(without, problem)
        options["without"] = without
    if "interval" in options or "progress" in options:
        raise InvalidArgumentError("interval and progress are not options here; expected those of branch_graph")
    limits = Deadline.after(time.perf_counter(), arguments.optional_seconds(time_limit))
    done: dict[int, MapRow] = {}

    def calls() -> Iterator[Call[int]]:
        """Calls of map_row, while there is time; the options have what is left of it."""
        for place, value in enumerate(values):
            left = limits.remaining()
            if left is not None and left <= 0:
                return
            own = options if left is None else {**options, "time_limit": max(left, 1e-3)}
            yield place, map_row, (make, value, interval, own)

    def result(reason: str | None = None) -> MultiplicityMap:
        left = len(values) - len(done)
        why = reason or ("stopped by the time limit" if left else None)
        missing = None if why is None else f"{why}, {counted(left, 'value')} not done"
        rows, ends = tuple(done[k] for k in sorted(done)), (float(interval[0]), float(interval[1]))
        return MultiplicityMap(name, ends, rows, missing)

    def work() -> MultiplicityMap:
        with workers_of(executor, jobs) as pool, closing(spread(pool, calls())) as found:
            for place, row in found:
                done[place] = row
                if progress is not None:
                    progress(len(done), len(values))
        return result()

    return keeping(
        "multiplicity_map",
        work,
        lambda ending: result(str(Stop(StopReason.of(ending)))),
        lambda _: f" after {len(done)} of {counted(len(values), 'value')}",
    )


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
        Where those that run away are left out, also left_out, how many they are, and stability_undecided.
        """
        import pandas as pd

        told = ["left_out", "stability_undecided"] if any(row.left_out for row in self.rows) else []
        return pd.DataFrame(
            [
                {
                    "value": row.value,
                    "first": float(row.alphas[k]),
                    "last": float(row.alphas[k + 1]),
                    "solutions": count,
                    **({"left_out": row.left_out[k], "stability_undecided": row.undecided[k]} if row.left_out else {}),
                    "exact": row.exact,
                    "complete": row.complete,
                }
                for row in self.rows
                for k, count in enumerate(row.between)
            ],
            columns=["value", "first", "last", "solutions", *told, "exact", "complete"],
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
        if {reason for row in self.rows for reason in row.reasons} == {_NOT_DECIDED}:
            values = f"{number} of {counted(len(self.rows), 'value')}"
            return f"complete: no (at {values} it is not decided whether some solutions run away{self._within()})"
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
        if any(row.left_out for row in self.rows):
            open_ones = (
                "; 1-2 means that one of two may run away" if any(any(row.undecided) for row in self.rows) else ""
            )
            lines.append(f"solutions that run away are left out{open_ones}")
        return "\n".join([*lines, self.closing_line])


def _counts(row: MapRow) -> str:
    """The numbers of solutions between critical alphas, in their order."""
    open_ones = row.undecided or (0,) * len(row.between)
    bounds = [f"{n - m}-{n}" if m else str(n) for n, m in zip(row.between, open_ones, strict=True)]
    text = " ".join(own for k, own in enumerate(bounds) if k == 0 or own != bounds[k - 1])
    return text if row.exact or row.reasons == (_NOT_DECIDED,) else f"at least {text}"


def _limit(row: MapRow) -> str:
    if row.unique:
        return "the end"
    return "not known" if row.limit is None else f"{row.limit:.6g}"


# -- the second parameter ----------------------------------------------------------------------------------------------


def _replaced(problem: ContactProblem, name: str, direction: Floats | None, value: float) -> ContactProblem:
    """The problem with another value of a field (a module-level function, so that other processes can import it)."""
    if name == "load" and direction is not None:
        return problem.replace(f=problem.f + value * direction)
    return problem.replace(friction=value, friction_slope=0.0) if name == "friction" else problem.replace(gap=value)


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
        return name, partial(_replaced, body, name, None), _numbers(given)
    if not isinstance(given, tuple) or len(given) != 2:
        raise InvalidArgumentError(f"over is {arguments.shown(over)}; {_EXPECTED}")
    return name, partial(_replaced, body, name, vector_of(given[0], "direction", body.n)), _numbers(given[1])


def _numbers(values: object) -> list[float]:
    if isinstance(values, (str, bytes)) or arguments.exact_number(values) is not None or not np.iterable(values):
        raise InvalidArgumentError(f"the values of over are {arguments.shown(values)}; expected a sequence of numbers")
    found = [arguments.finite_number(value, "a value of over") for value in values]
    if not found or len(set(found)) < len(found):
        raise InvalidArgumentError("the values of over are none, or one occurs twice; expected different numbers")
    return found


@dataclass(frozen=True)
class MapFold:
    """A fold on one row of a map.

    Attributes
    ----------
    alpha : float
    statuses : tuple of tuples of str
        Of the arcs that meet there, in order: by them folds of neighbouring rows are matched.
    """

    alpha: float
    statuses: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class MapRow:
    """Row of a map, for one value of the second parameter: a branch graph over alpha, in numbers.

    Attributes
    ----------
    value : float
    alphas : tuple of Fraction
        Where the number of solutions changes.
    at_alphas, between : tuples of int
        Numbers of solutions at these alphas, and between them.
    exact : bool
        These are the numbers and not lower bounds, and none that is counted is undecided.
    folds : tuple of MapFold
    complete : bool
    reasons : tuple of str
    limit : float or None
        Up to which alpha the solution is unique, from the first one; None: throughout, or not known.
    unique : bool or None
        Whether there is one solution at every alpha; None: not known.
    seconds : float
    within : float or None
        Of a body that nothing holds: the numbers are those of solutions whose rigid displacement is within this bound
        [length].
    left_out, undecided : tuples of int
        Where solutions that run away are left out of the numbers: how many they are between the alphas, and how many
        of those that are counted are undecided; a row with such is not complete, as ``reasons`` say. ``limit`` and
        ``unique`` are about all solutions.
    """

    value: float
    alphas: tuple[Fraction, ...]
    at_alphas: tuple[int, ...]
    between: tuple[int, ...]
    exact: bool
    folds: tuple[MapFold, ...]
    complete: bool
    reasons: tuple[str, ...]
    limit: float | None
    unique: bool | None
    seconds: float
    within: float | None = None
    left_out: tuple[int, ...] = ()
    undecided: tuple[int, ...] = ()

    def count_at(self, alpha: Alpha) -> int:
        """Number of solutions at an alpha of the interval; a lower bound where the row is not exact."""
        for k, critical in enumerate(self.alphas):
            if alpha == critical:
                return self.at_alphas[k]
            if alpha < critical:
                return self.between[k - 1]
        return self.between[-1]


#: A reason beside those of the graph.
_NOT_DECIDED = "whether some solutions run away is not decided"


def map_row(
    make: Callable[[float], ContactProblem], value: float, interval: tuple[Alpha, Alpha], options: dict[str, Any]
) -> MapRow:
    """Row of a map (a module-level function, so that other processes can import it)."""
    started = time.perf_counter()
    problem = arguments.instance_of(make(value), ContactProblem, "the problem that over makes")
    own = {name: option for name, option in options.items() if name != "without"}
    graph = branch_graph(problem, interval, **own)
    steps, uniqueness = graph.claims.steps(), graph.claims.uniqueness()
    arcs = {vertex.number: [] for vertex in graph.folds}  # type: dict[int, list[tuple[str, ...]]]
    for arc in graph.arcs:
        for end in {arc.tail, arc.head} & arcs.keys():
            arcs[end].append(tuple(status.value for status in arc.statuses))
    folds = tuple(MapFold(fold.alpha, tuple(sorted(arcs[fold.number]))) for fold in graph.folds)
    row = MapRow(
        value=value,
        alphas=steps.alphas,
        at_alphas=steps.at,
        between=steps.between,
        exact=steps.exact,
        folds=folds,
        complete=graph.complete,
        reasons=tuple(graph.reasons),
        limit=uniqueness.limit,
        unique=uniqueness.throughout,
        seconds=time.perf_counter() - started,
        within=None if problem.held else problem.rigid_reach,
    )
    return row if "without" not in options else _resting(row, graph, started)


def _resting(row: MapRow, graph: BranchGraph, started: float) -> MapRow:
    """A row without the solutions that run away; its alphas are also those where a verdict changes."""
    spans = graph.stability()
    changes = {Fraction(span.high) for several in spans for span in several[:-1]}
    alphas = tuple(sorted({*row.alphas, *changes}))
    middles = [(low + high) / 2 for low, high in pairwise(alphas)]
    over = [{arc.number for arc in graph.located(middle)[0]} for middle in middles]

    def verdicts(arcs: set[int], alpha: Fraction) -> Counter[str]:
        return Counter(
            next((span.verdict for span in spans[k] if alpha <= span.high), spans[k][-1].verdict) for k in arcs
        )

    between = [verdicts(arcs, middle) for arcs, middle in zip(over, middles, strict=True)]
    # at a critical alpha, the arcs that go on beyond it
    passing = [a & b for a, b in zip([over[0], *over], [*over, over[-1]], strict=True)]
    at = [verdicts(arcs, alpha) for arcs, alpha in zip(passing, alphas, strict=True)]
    at[0] = at[-1] = Counter()  # at the ends of the interval there are vertices
    away, undecided = "runs away", tuple(found["undecided"] for found in between)
    decided = not any(undecided)
    return replace(
        row,
        exact=row.exact and decided,
        complete=row.complete and decided,
        reasons=row.reasons if decided else (*row.reasons, _NOT_DECIDED),
        alphas=alphas,
        at_alphas=tuple(max(row.count_at(x) - found[away], 0) for x, found in zip(alphas, at, strict=True)),
        between=tuple(max(row.count_at(x) - found[away], 0) for x, found in zip(middles, between, strict=True)),
        left_out=tuple(found[away] for found in between),
        undecided=undecided,
        seconds=time.perf_counter() - started,
    )


# -- figures -----------------------------------------------------------------------------------------------------------

#: Colours of one solution, two, and so on; the last one is for more.
_COLOURS = ("#ffffff", "#c9b7dd", "#f2b56b", "#d97b5a", "#c04d6b", "#8a3b82", "#5b3b96", "#333a80", "#1c2c58")
_UNIQUE, _FOLD = "#2a8a4a", "#222222"


def draw_map(name: str, rows: Sequence[MapRow], curves: Sequence[Any], title: str, place: object) -> Any:
    """A figure; see MultiplicityMap.plot."""
    from matplotlib.patches import Rectangle

    ax = axes_of(place, (7.0, 4.8))
    order = sorted(range(len(rows)), key=lambda k: rows[k].value)
    edges = _edges([rows[k].value for k in order])
    seen: dict[int, bool] = {}
    for k, (low, high) in zip(order, edges, strict=True):
        row = rows[k]
        for number, (first, last) in enumerate(pairwise(row.alphas)):
            count, a, b = row.between[number], float(first), float(last)
            colour = _COLOURS[min(max(count, 1), len(_COLOURS)) - 1]
            seen[count] = seen.get(count, True) and row.exact
            ax.add_patch(Rectangle((a, low), b - a, high - low, facecolor=colour, alpha=0.45, linewidth=0, zorder=1))
            line = _UNIQUE if count == 1 and row.exact else colour if count > 1 else "#999999"
            ax.plot([a, b], [row.value] * 2, color=line, linewidth=2.2, solid_capstyle="butt", zorder=3)
    for curve in curves:
        places = [(alpha, rows[k].value) for k, alpha in curve]
        ax.plot(*zip(*places, strict=True), "--", color=_FOLD, linewidth=0.9, marker=".", markersize=5, zorder=4)
    ax.autoscale_view()
    ax.set_xlabel("alpha")
    ax.set_ylabel(name)
    ax.set_title(fill(title, 80), fontsize=9)
    handles: list[Any] = []
    for count, exact in sorted(seen.items()):
        words = f"{'' if exact else 'at least '}{count} solution{'' if count == 1 else 's'}"
        if count == 1 and exact:
            handles.append(line_entry("one solution, proven at these values", color=_UNIQUE, linewidth=2.2))
        else:
            handles.append(area_entry(words, facecolor=_COLOURS[min(max(count, 1), len(_COLOURS)) - 1]))
    if curves:
        handles.append(line_entry("folds, linked by statuses", linestyle="--", color=_FOLD, marker="."))
    handles.append(area_entry("between the values: not proven", facecolor="none"))
    ax.legend(handles=handles, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, frameon=False)
    return figure_of(ax)


def _edges(values: Sequence[float]) -> list[tuple[float, float]]:
    """Ends of the space that is filled around every value: half way to its neighbours."""
    if len(values) == 1:
        return [(values[0] - 0.5, values[0] + 0.5)]
    middles = [0.5 * (a + b) for a, b in pairwise(values)]
    first, last = values[0] - (middles[0] - values[0]), values[-1] + (values[-1] - middles[-1])
    bounds = [first, *middles, last]
    return list(pairwise(bounds))
