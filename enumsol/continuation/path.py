"""follow: one branch by piecewise smooth continuation (theory, section 8); Path, with its figures and files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, Self, overload

import numpy as np

from enumsol.continuation.follower import Follower
from enumsol.continuation.newton import Start
from enumsol.continuation.path_data import (
    ARRAYS,
    RIGID,
    ContinuationOptions,
    PathPoint,
    PathStats,
    PathStatus,
    PointKind,
    Tangent,
    Transition,
)
from enumsol.continuation.transitions import ACTIVE_TOLERANCE, TangentPoint, admissible_tangents, curve_tangent
from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import ContactStatus
from enumsol.roots.local_branch import LocalBranchTest
from enumsol.roots.root import summary
from enumsol.support.arguments import direction_value, file_path, one_of, row_number, shown
from enumsol.support.files import read_arrays, reading, write_arrays
from enumsol.support.immutable import Listed, Sealed, no_such_item
from enumsol.support.messages import counted
from enumsol.support.plotting import axes_or_none, checked_units, figure_of, in_units, kept, new_figure
from enumsol.support.saved import Array, Maybe, check_kind, is_label, is_number

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator

    import pandas as pd

    from enumsol.continuation.recorder import Landmark
    from enumsol.continuation.scaled_equation import ScaledEquation, SmoothPath
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import AlphaLike, Floats, Integers, NDArray


#: Version of the files of paths.
_FORMAT = 1
#: Transitions that a printed path shows.
_PRINTED_TRANSITIONS = 12


def save_path(followed: Path, path: str | os.PathLike[str]) -> None:
    """Write the path to a .npz file; the problem and the callables of a smooth path are not in it."""
    report = {
        "kinds": followed.kinds,
        "transitions": [_pack(item) for item in followed.transitions],
        "status": followed.status,
        "message": followed.message,
        "orientation": followed.orientation,
        "interval": followed.interval,
        "options": followed.options.to_dict(),
        "next_step": followed.next_step,
        "stats": followed.stats.__dict__,
        "node_ids": followed.node_ids,
        "names": followed._names,
    }
    if followed.rigid_coordinates is not None:
        report[RIGID] = followed.rigid_coordinates
    write_arrays(file_path(path, "path"), _FORMAT, report, {name: getattr(followed, name) for name in ARRAYS})


def _check(report: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Refuse a report and arrays of other kinds than those of a path."""
    m, p = arrays["lambda_n"].shape
    statuses = ({status.value for status in ContactStatus},) * p
    test = {"exists": bool, "premise": bool, "signs": [(statuses, int)]}
    transition = {
        **{"point": range(m), "alpha": float, "before": statuses, "after": statuses, "nodes": [range(p)]},
        **{"dalpha": (is_number, is_number), "local_test": Maybe(test)},
    }
    named = {
        **{"kinds": ({kind.value for kind in PointKind},) * m, "names": (statuses,) * m, "transitions": [transition]},
        **{"status": {status.value for status in PathStatus}, "message": str, "orientation": range(-1, 2)},
        **{"interval": (is_number, is_number), "next_step": float, "node_ids": (is_label,) * p, "options": {}},
        "stats": dict.fromkeys((f"{item.name}?" for item in fields(PathStats)), is_number),
        f"{RIGID}?": Array(m, None),
    }
    check_kind(report, named, "report")
    pair = Array(m, p, 2) if arrays["lambda_t"].ndim == 3 else Array(m, p)
    shapes = {"lambda_n": Array(m, p), "u_n": Array(m, p), "codes": Array(m, p), "lambda_t": pair, "u_t": pair}
    for name in ARRAYS:
        check_kind(arrays[name], shapes.get(name, Array(m)), name)


def _unpacked(report: dict[str, Any], arrays: dict[str, Any]) -> Path:
    _check(report, arrays)
    low, high = report["interval"]
    return Path(
        **arrays,
        kinds=tuple(PointKind(kind) for kind in report["kinds"]),
        transitions=tuple(_unpack(item) for item in report["transitions"]),
        status=PathStatus(report["status"]),
        message=report["message"],
        orientation=report["orientation"],
        interval=(float(low), float(high)),
        options=ContinuationOptions.from_dict(report["options"]),
        next_step=report["next_step"],
        stats=PathStats(**report["stats"]),
        node_ids=tuple(report["node_ids"]),
        _names=tuple(tuple(ContactStatus(value) for value in names) for names in report["names"]),
        rigid_coordinates=np.array(report[RIGID]) if RIGID in report else None,
    )


def _pack(item: Transition) -> dict[str, Any]:
    test = item.local_test
    packed = None if test is None else {"exists": test.exists, "premise": test.premise, "signs": test.signs}
    return {
        "point": item.point,
        "alpha": item.alpha,
        "before": item.before,
        "after": item.after,
        "nodes": item.nodes,
        "dalpha": [item.dalpha_before, item.dalpha_after],
        "local_test": packed,
    }


def _unpack(data: dict[str, Any]) -> Transition:
    test, packed = None, data["local_test"]
    if packed is not None:
        signs = tuple((tuple(ContactStatus(s) for s in statuses), sign) for statuses, sign in packed["signs"])
        test = LocalBranchTest.from_signs(signs, premise=packed["premise"])
    left, right = data["dalpha"]
    before, after = (tuple(ContactStatus(s) for s in data[name]) for name in ("before", "after"))
    return Transition(
        data["point"], data["alpha"], before, after, tuple(data["nodes"]), float(left), float(right), test
    )


class Drawn(Protocol):
    """A branch graph, of which paths ask only for its figure."""

    @property
    def plot(self) -> Callable[..., Any]:
        """Makes a figure of the branches."""


def draw_path(
    path: Path,
    graph: Drawn | None = None,
    *,
    node: int = 0,
    quantity: str = "lambda_n",
    units: tuple[str, str] | None = None,
    ax: object = None,
    file: str | os.PathLike[str] | None = None,
    **of_graph: Any,
) -> Any:
    """A figure of the accepted steps as dots, transition points as circles, folds as squares, the start as a star.

    The spacing of the dots is the step control. With a graph its branches are drawn underneath.

    Parameters
    ----------
    graph : BranchGraph or None
        Drawn by its own ``plot`` in a new figure, whose options may be given too.
    node : int
        Contact node (row number).
    quantity : {"lambda_n", "lambda_t", "u_n", "u_t"}
        In 3D the tangential ones are drawn as their lengths.
    units : (str, str), optional
        Of forces and of lengths, for the axis.
    ax : matplotlib Axes or None
        Draw there, for example in ``figure.axes[0]`` of an earlier plot to add a path to it.
    file : path, optional
        Save the figure there.

    Returns
    -------
    matplotlib.figure.Figure
        Notebooks show it.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    InvalidArgumentError
        An argument is not one of those above.
    """
    one_of(quantity, "quantity", ("lambda_n", "lambda_t", "u_n", "u_t"))
    node, named_units = row_number(node, "node", path.lambda_n.shape[1]), checked_units(units)
    if graph is not None and ax is not None:
        raise InvalidArgumentError("graph and ax are both given; draw further paths with path.plot(ax=...) alone")
    if graph is not None:
        # the graph draws a figure of its own; its first panel is this node's, and no zoom shows the path
        axes = graph.plot(quantity, [path.node_ids[node]], **{"zoom": False, "units": units, **of_graph}).axes[0]
    else:
        axes = axes_or_none(ax) or new_figure().subplots()
    values = getattr(path, quantity)[:, node]
    name = quantity
    if values.ndim == 2:
        values, name = np.linalg.norm(values, axis=1), f"|{quantity}|"
    dots = [k for k, kind in enumerate(path.kinds) if kind in (PointKind.STEP, PointKind.END)]
    axes.plot(path.alpha[dots], values[dots], ".", color="black", markersize=3, label="steps", zorder=3)
    folds = {item.point for item in path.folds}
    for marker, label, chosen in (
        ("o", "transitions", [item.point for item in path.transitions if item.point not in folds]),
        ("s", "folds", sorted(folds)),
    ):
        if chosen:
            axes.plot(
                path.alpha[chosen], values[chosen], marker, color="black", markerfacecolor="none", label=label, zorder=4
            )
    axes.plot(path.alpha[:1], values[:1], "*", color="tab:red", markersize=10, label="start", zorder=5)
    if not axes.get_ylabel():
        axes.set_xlabel("alpha")
        dimension = "force" if quantity.startswith("lambda") else "length"
        axes.set_ylabel(in_units(f"{name} of node {path.node_ids[node]}", dimension, named_units))
        axes.set_title(
            f"path for alpha in [{path.alpha.min():g}, {path.alpha.max():g}]: {path.status.value}", fontsize=9
        )
    named = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))  # of several paths once
    axes.legend(handles=list(named.values()), labels=list(named), fontsize=7, frameon=False)
    return kept(figure_of(axes), file)


@dataclass(frozen=True, eq=False, repr=False)
class Path(Sequence[PathPoint], Sealed):
    """A followed branch of solutions: a sequence of its points.

    Attributes
    ----------
    alpha : (m,) array
    lambda_n, lambda_t, u_n, u_t : (m, p) arrays; in 3D lambda_t and u_t are (m, p, 2)
    codes : (m, p) array of status codes
        On which the path leaves each point.
    kinds : tuple of m PointKind
        "start", "step", "transition" or "end".
    steps : (m,) array
        Step length that led to the point; 0 where it was located.
    corrections : (m,) array
        Corrections that it took.
    arclength : (m,) array
        Without units, see ContinuationOptions.
    transitions : tuple of Transition
    status : PathStatus
        Why the path ended: "interval left", "closed", "visited", "step limit", "friction", "rigid bound", "dead end",
        "stalled" or "interrupted".
    message : str
        The same as a sentence, with advice.
    orientation : int
        +1 when it was followed in the positive orientation of theory, (8.2), else -1.
    interval : (float, float)
    options : ContinuationOptions
        With the ``alpha_scale`` that was used.
    next_step : float
        Step length with which to go on.
    stats : PathStats
    node_ids : tuple
    rigid_coordinates : (m, r) array or None
        Of a body that nothing holds: q of the rigid displacement N q.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> path = enumsol.follow(problem, enumsol.newton(problem, 1), interval=(0, 10))
    >>> path.status, float(path.alpha[0]), float(path.alpha[-1])
    ('interval left', 1.0, 10.0)
    """

    alpha: Floats
    lambda_n: Floats
    lambda_t: Floats
    u_n: Floats
    u_t: Floats
    codes: NDArray[np.int8]
    kinds: tuple[PointKind, ...]
    steps: Floats
    corrections: Integers
    arclength: Floats
    transitions: tuple[Transition, ...]
    status: PathStatus
    message: str
    orientation: int
    interval: tuple[float, float]
    options: ContinuationOptions
    next_step: float
    stats: PathStats
    node_ids: tuple[Any, ...]
    _names: tuple[tuple[ContactStatus, ...], ...] = field(repr=False)
    rigid_coordinates: Floats | None = None
    _problem: AnyProblem | None = field(default=None, repr=False, compare=False)
    _smooth_path: SmoothPath | None = field(default=None, repr=False, compare=False)

    plot = draw_path
    save = save_path

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Path:
        """Read a path that `save` wrote.

        Raises
        ------
        InvalidArgumentError
            The file does not hold a path.
        """
        place = file_path(path, "path")
        with reading(place, "a path", "Path.save"):
            return _unpacked(*read_arrays(place, _FORMAT, ARRAYS))

    def resume(
        self,
        problem: AnyProblem | None = None,
        *,
        interval: tuple[AlphaLike, AlphaLike] | None = None,
        options: ContinuationOptions | None = None,
        smooth_path: SmoothPath | None = None,
    ) -> Path:
        """The path continued from its end: all its points and the new ones.

        Parameters
        ----------
        problem : ContactProblem, ContactProblem3D or None
            Needed for a path that was loaded from a file.
        interval, options : as in follow
            None: as before. The step length is the one with which the path ended.
        smooth_path : SmoothPath or None
            Needed for a loaded path that was followed along one.

        Raises
        ------
        InvalidArgumentError
            The problem is missing, or the path ended in a way from which it cannot go on.
        """
        body = self._problem if problem is None else problem
        if body is None:
            raise InvalidArgumentError("problem is missing; a path loaded from a file needs it: path.resume(problem)")
        if self.status in (PathStatus.CLOSED, PathStatus.DEAD_END):
            raise InvalidArgumentError(f"the path cannot go on: {self.message}")
        span = self.interval if interval is None else interval
        smooth = self._smooth_path if smooth_path is None else smooth_path
        start = Start(body, self[-1], span, self.options if options is None else options, smooth)
        codes = tuple(int(code) for code in self.codes[-1])
        vector = curve_tangent(start.equation, codes, start.x, self.orientation)
        if vector is None:
            raise InvalidArgumentError(
                "the path ends where its tangent is not unique; start anew with follow(tangent=...)"
            )
        follower = Follower(Path, start, TangentPoint(start.x, codes, vector), self.orientation)
        follower.h = min(max(self.next_step, start.options.h_min), start.options.h_max)
        return self.joined(follower.run())

    # -- a sequence of points ----------------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.alpha)

    @overload
    def __getitem__(self, item: int) -> PathPoint: ...
    @overload
    def __getitem__(self, item: slice) -> tuple[PathPoint, ...]: ...
    def __getitem__(self, item: int | slice) -> PathPoint | tuple[PathPoint, ...]:
        if isinstance(item, slice):
            return tuple(self[k] for k in range(*item.indices(len(self))))
        try:
            k = range(len(self))[item]
        except IndexError:
            raise no_such_item(item, len(self), "point") from None
        return PathPoint(
            alpha=float(self.alpha[k]),
            lambda_n=self.lambda_n[k],
            lambda_t=self.lambda_t[k],
            u_n=self.u_n[k],
            u_t=self.u_t[k],
            statuses=self._names[k],
            kind=self.kinds[k],
            rigid_coordinates=None if self.rigid_coordinates is None else self.rigid_coordinates[k],
        )

    @property
    def points(self) -> tuple[PathPoint, ...]:
        """All points."""
        return Listed(self[:], "point")

    @property
    def selections(self) -> tuple[tuple[ContactStatus, ...], ...]:
        """The statuses along the path, one entry per piece between transitions."""
        return tuple(name for k, name in enumerate(self._names) if k == 0 or name != self._names[k - 1])

    @cached_property
    def folds(self) -> tuple[Transition, ...]:
        """The transitions at which alpha turns back (after a vertical piece: its end), folds within a selection too."""
        found, direction = [], 0
        for transition in self.transitions:
            if not transition.nodes:  # alpha turns back within a selection
                found.append(transition)
                direction = -direction
                continue
            for value in (transition.dalpha_before, transition.dalpha_after):
                # a vertical piece: at a regular point it is well above this rounding
                sign = 0 if abs(value) <= 1e-9 * self._alpha_scale else int(np.sign(value))
                if sign and direction and sign != direction:
                    found.append(transition)
                direction = sign or direction
        return tuple(found)

    @property
    def _alpha_scale(self) -> float:
        return self.options.alpha_scale or 1.0

    @property
    def closed(self) -> bool:
        """The path returned to its start."""
        return self.status is PathStatus.CLOSED

    # -- output ------------------------------------------------------------------------------------------------------

    def to_frame(self) -> pd.DataFrame:
        """Table of points: alpha, kind, step, corrections, arclength; of every node X lambda_n_X, .., status_X.

        Of a body that nothing holds rigid_0, rigid_1, .. are the coordinates of its rigid displacement.

        In 3D lambda_t1_X and lambda_t2_X take the place of lambda_t_X, and so for u_t.
        X is the node's label, or its row number where two labels are the same text.
        """
        import pandas as pd

        labels = [str(node) for node in self.node_ids]
        nodes = labels if len(set(labels)) == len(labels) else range(len(labels))
        columns: dict[str, Any] = {
            "alpha": self.alpha,
            "kind": [kind.value for kind in self.kinds],
            "step": self.steps,
            "corrections": self.corrections,
            "arclength": self.arclength,
        }
        for quantity in ("lambda_n", "lambda_t", "u_n", "u_t"):
            values = getattr(self, quantity)
            axes = [("", values)] if values.ndim == 2 else [("1", values[..., 0]), ("2", values[..., 1])]
            for axis, part in axes:
                columns |= {f"{quantity}{axis}_{node}": column for node, column in zip(nodes, part.T, strict=True)}
        if self.rigid_coordinates is not None:
            columns |= {f"rigid_{mode}": column for mode, column in enumerate(self.rigid_coordinates.T)}
        columns |= {f"status_{node}": [names[i].value for names in self._names] for i, node in enumerate(nodes)}
        return pd.DataFrame(columns)

    def joined(self, more: Self) -> Self:
        """The path followed by one that starts at its end."""
        shift = len(self) - 1
        arrays: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(more, name)[1:]])
            for name in (*ARRAYS, *([] if self.rigid_coordinates is None else [RIGID]))
            if name != "arclength"
        }
        arclength = np.concatenate([self.arclength, self.arclength[-1] + more.arclength[1:]])
        transitions = tuple(replace(item, point=item.point + shift) for item in more.transitions)
        return replace(
            more,
            **arrays,
            arclength=arclength,
            kinds=self.kinds + more.kinds[1:],
            transitions=self.transitions + transitions,
            stats=self.stats + more.stats,
            _names=self._names[:-1] + more._names,
        )

    def __repr__(self) -> str:
        stats = self.stats
        low, high = float(np.min(self.alpha)), float(np.max(self.alpha))
        lines = [
            f"Path with {counted(len(self), 'point')}, alpha from {low:.6g} to {high:.6g}",
            f"  steps        {stats.accepted} accepted, {stats.rejected} rejected "
            f"({stats.not_converged} not converged, {stats.refused} refused), "
            f"{counted(stats.corrections, 'correction')}",
            f"  transitions  {len(self.transitions)}, of them {counted(len(self.folds), 'fold')}",
        ]
        for item in self.transitions[:_PRINTED_TRANSITIONS]:
            test = "" if item.local_test is None or item.local_test.exists else ", no local branch"
            fold = ", fold" if item in self.folds else ""
            lines.append(f"    alpha = {item.alpha:<12.8g} {summary(item.before)} -> {summary(item.after)}{fold}{test}")
        if len(self.transitions) > _PRINTED_TRANSITIONS:
            lines.append(f"    ... {len(self.transitions) - _PRINTED_TRANSITIONS} more")
        lines.append(f"  ended        {self.message}")
        return "\n".join(lines)


class AmbiguousStart(InvalidArgumentError):  # noqa: N818 (reads as a state of the start)
    """The direction does not single out one tangent at the start; ``tangents`` lists all that are admissible.

    Attributes
    ----------
    tangents : tuple of Tangent
        Pass the index of one of them as ``tangent=`` to `follow`.
    """

    def __init__(self, message: str, tangents: Sequence[Tangent]) -> None:
        super().__init__(message)
        self.tangents = tuple(tangents)


def follow(
    problem: AnyProblem,
    start: object,
    direction: int = +1,
    interval: tuple[AlphaLike, AlphaLike] | None = None,
    options: ContinuationOptions | None = None,
    smooth_path: SmoothPath | None = None,
    *,
    tangent: int | None = None,
    visited: Sequence[Path] = (),
) -> Path:
    """The branch of solutions through a start, in one direction, by the paper's Algorithm 5.1.

    Predictions along the tangent are corrected by the piecewise smooth Moore-Penrose method. When corrections fail even
    for the shortest step, the selection is changed at the test function that vanishes next (Step 8). Transition points
    are located by the sign changes of the test functions. With ``options.check_steps`` every step is accepted only as
    the proven-in-floats continuation of the one before, so that long steps cannot jump to another branch unnoticed.

    Works on the problem condensed to its contact nodes: A is factorised once for 2p + a few right-hand sides, a
    correction costs one dense solve of size 2p + 1 (3p in place of 2p in 3D). The arclength is defined in
    ContinuationOptions. In 3D a slipping node keeps its status whatever the direction, and a path may turn back while
    all statuses stay the same: such folds are located and are among ``path.transitions`` (theory, section 8.12).

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
    start : Root, PathPoint, or tuple (alpha, lambda_n, lambda_t)
        A root, for example of enumerate_roots, newton or ``graph.starting_points()``. Of a body that nothing holds the
        tuple is (alpha, lambda_n, lambda_t, rigid_coordinates); its path ends where ``max_rigid_displacement`` does.
    direction : {+1, -1}
        +1 is the positively oriented tangent (theory, (8.2)); alpha then increases where the root's index is +1.
    interval : pair of alphas or None
        Range of alpha; infinite ends are allowed. None: all alpha with F >= 0.
    options : ContinuationOptions or None
    smooth_path : SmoothPath or None
        Friction and load that are not affine in alpha.
    tangent : int or None
        Index into `start_tangents` of the direction to take, at a start where several are admissible.
    visited : sequence of Path
        The path ends where it arrives at one of them.

    Returns
    -------
    Path
        Its ``status`` and ``message`` say why it ended.

    Raises
    ------
    AmbiguousStart
        Several tangents, or none, have the asked orientation at a degenerate start; the error lists them.
    InvalidArgumentError
        The start is not a root or an argument is out of range.
    NotHeldError
        Some rigid displacement of a body that nothing holds moves no contact node.
    Interrupted, OutOfMemoryError
        On Ctrl-C, or where the memory does not suffice; ``partial`` holds the path so far.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle()
    >>> stick = enumsol.enumerate_roots(problem, alpha=5)[2]
    >>> path = enumsol.follow(problem, stick, direction=-1, interval=(0, 10))
    >>> [(item.before[0].value, item.after[0].value, round(item.alpha, 6)) for item in path.folds]
    [('stick', 'slip-', 2.666667)]
    """
    direction = direction_value(direction)
    if not isinstance(visited, (list, tuple)) or not all(isinstance(path, Path) for path in visited):
        raise InvalidArgumentError(f"visited is {shown(visited)}; expected a list of Path")
    first = Start(problem, start, interval, options, smooth_path)
    chosen = _choose(first, direction, tangent)
    point = TangentPoint(first.x, chosen.codes, chosen.vector)
    sign = chosen.orientation or direction
    return Follower(Path, first, point, sign, list(_points_of(first.equation, visited))).run()


def _points_of(equation: ScaledEquation, visited: Sequence[Path]) -> Iterator[Landmark]:
    """Starts, transition points and ends of other paths, with the statuses on both sides."""
    for path in visited:
        for k, kind in enumerate(path.kinds):
            if kind is PointKind.STEP:
                continue
            forces = np.concatenate([path.lambda_n[k], path.lambda_t[k].ravel(order="F")])
            rigid = None if path.rigid_coordinates is None else path.rigid_coordinates[k]
            x = equation.point(float(path.alpha[k]), forces, rigid)
            if not math.isfinite(float(np.sum(x))):
                continue
            for codes in {tuple(map(int, path.codes[at])) for at in (k, max(k - 1, 0))}:
                yield x, codes, True


def start_tangents(
    problem: AnyProblem,
    start: object,
    interval: tuple[AlphaLike, AlphaLike] | None = None,
    options: ContinuationOptions | None = None,
    smooth_path: SmoothPath | None = None,
) -> tuple[Tangent, ...]:
    """All tangents along which solutions leave a root, in the order of their selections (paper, Remark 5.1).

    Two at a regular root and at an ordinary transition point; more at a bifurcation point. ``tangent=k`` of `follow`
    takes the k-th. Parameters are those of `follow`.
    """
    first = Start(problem, start, interval, options, smooth_path)
    return admissible_tangents(first.equation, first.x, ACTIVE_TOLERANCE)


def _choose(first: Start, direction: int, index: int | None) -> Tangent:
    tangents = admissible_tangents(first.equation, first.x, ACTIVE_TOLERANCE)
    if index is not None:
        count = len(tangents)
        return tangents[row_number(index, "tangent", count, f"an index below {count} of start_tangents")]
    fitting = [t for t in tangents if t.orientation == direction]
    if len(fitting) != 1:
        listing = "; ".join(f"{k}: {t!r}" for k, t in enumerate(tangents)) or "none"
        raise AmbiguousStart(
            f"at the start {len(fitting)} of {len(tangents)} admissible tangents have orientation {direction:+d}; "
            f"expected one; choose with tangent=k among {listing}",
            tangents,
        )
    return fitting[0]
