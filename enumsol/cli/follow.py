"""``enumsol follow`` (paper, Algorithm 5.1) and ``enumsol fixed-point``: solutions by iteration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import typer

from enumsol.cli import common, options, output
from enumsol.cli.graph import read_graph
from enumsol.cli.progress import Display, search_display
from enumsol.errors import Interrupted, InvalidArgumentError, OutOfMemoryError
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from enumsol.branches import BranchGraph
    from enumsol.continuation import ContinuationOptions, Path
    from enumsol.fixed_points import FixedPoint, FixedPointProgress
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root
    from enumsol.support.array_types import Alpha

#: Options of the steps of a continuation.
Step = Annotated[float, typer.Option(metavar="LENGTH", rich_help_panel=options.STEPS)]
#: Ends of a path at which nothing is left to follow.
_ARRIVED = ("interval left", "closed")


def follow(
    problem: options.Problem,
    first: options.Number,
    last: options.Number,
    start: options.Number,
    root: Annotated[int | None, typer.Option(min=0, metavar="K")] = None,
    direction: Annotated[str, typer.Option(metavar="+1|-1|both")] = "both",
    tangent: Annotated[int | None, typer.Option(min=0, metavar="K")] = None,
    arithmetic: options.Arithmetic = "verified",
    h_max: Step = 1.0,
    h_min: Step = 1e-5,
    h_init: Step | None = None,
    eps: Annotated[float, typer.Option(metavar="NORM", rich_help_panel=options.STEPS)] = 1e-6,
    max_steps: Annotated[int, typer.Option(min=1, metavar="N", rich_help_panel=options.STEPS)] = 5000,
    check_steps: Annotated[bool, typer.Option("--check-steps/--no-check-steps", rich_help_panel=options.STEPS)] = True,
    json_file: options.OutputFile | None = None,
    csv_file: options.OutputFile | None = None,
    plot_file: options.PlotFile | None = None,
    graph_file: Annotated[str | None, typer.Option(metavar="GRAPH", rich_help_panel=options.PLOT)] = None,
    quantity: options.Quantity = "lambda_n",
    node: Annotated[str | None, typer.Option(metavar="LABEL", rich_help_panel=options.PLOT)] = None,
    units: options.Units | None = None,
    quiet: options.Quiet = False,
) -> None:
    """Follow branches of solutions of PROBLEM, in 2D or 3D, from its roots at one alpha.

    A root on a branch that has already been followed is not followed again. Branches that have no root at that alpha
    are not found: compare the result with enumsol graph, or use enumsol audit.

    Exit status: 0 if every path left the interval or closed; 3 if a path ended otherwise or could not start; 2 on bad
    input; 130 on Ctrl-C, after printing the paths so far; 74 if a result could not be written; 141 if the program that
    read it has ended.

    Parameters
    ----------
    start : Alpha at which the starts are enumerated.
    root : Start from root K of enumsol roots; default: from all roots.
    direction : +1: positive orientation, in which alpha grows where the index is +1.
    tangent : Start along the K-th of several tangents at a degenerate root.
    arithmetic : Arithmetic of the enumeration of the starts.
    h_max : Longest step.
    h_min : Shortest step.
    h_init : First step; default: 0.05, or h-max.
    eps : Convergence tolerance of the corrections.
    max_steps : Stop a path after N steps.
    check_steps : Refuse steps that may have left the branch. Otherwise the algorithm runs as printed in the paper.
    csv_file : Write a table with one row per point, for enumsol audit; - is stdout.
    graph_file : Draw the paths over this graph, written by enumsol graph --save.
    quantity : Quantity drawn against alpha.
    node : Contact node to draw; default: the first.
    """
    from enumsol.continuation import ContinuationOptions  # numpy: not for --help

    if graph_file is not None and plot_file is None:
        raise InvalidArgumentError("--graph is given without --plot; expected both")
    if tangent is not None and (root is None or direction == "both"):
        raise InvalidArgumentError("--tangent is given without --root or --direction; expected one root and direction")
    steps = ContinuationOptions(
        eps=eps,
        eps_prime=eps,
        h_min=h_min,
        h_max=h_max,
        h_init=min(0.05, h_max) if h_init is None else h_init,
        max_steps=max_steps,
        check_steps=check_steps,
    )
    interval, alpha, signs = (
        common.parse_interval(first, last),
        common.parse_alpha(start, "--start"),
        _directions(direction),
    )
    names, body = common.units_of(problem, units), common.load_problem(problem)
    row = common.node_row(body, node)
    over = None if graph_file is None else read_graph(graph_file, body)
    followed = _Followed(body, (float(interval[0]), float(interval[1])), steps, tangent)
    ended: Interrupted | OutOfMemoryError | None = None
    try:
        followed.run(_starts(body, interval, alpha, arithmetic, root), signs, alone=root is not None)
    except KeyboardInterrupt:
        # wherever it came: the paths so far are kept
        ended = Interrupted("interrupted", followed)
    except MemoryError:
        ended = OutOfMemoryError("out of memory", followed)
    about = {"problem": problem, "start": alpha, "interval": interval}
    output.deliver(
        (
            plot_file if followed.paths else None,
            lambda path: output.write_figure(path, followed.draw(over, row, quantity, names)),
        ),
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: followed.as_text() + (f" ({ended})" if ended else ""),
        content=lambda: {**about, **followed.content()},
        frame=followed.frame,
    )
    common.finish(ended, common.ExitStatus.DONE if followed.arrived else common.ExitStatus.INCOMPLETE)


def _directions(text: str) -> tuple[int, ...]:
    known = {"+1": (1,), "1": (1,), "-1": (-1,), "both": (1, -1)}
    if text not in known:
        raise InvalidArgumentError(f"--direction is {text}; expected +1, -1 or both")
    return known[text]


def _starts(
    problem: AnyProblem, interval: tuple[Alpha, Alpha], alpha: Alpha, arithmetic: options.Arithmetic, root: int | None
) -> list[tuple[int, Root]]:
    if not interval[0] <= alpha <= interval[1]:
        low, high = (float(end) for end in interval)
        raise InvalidArgumentError(f"--start is {float(alpha):g}; expected an alpha between {low:g} and {high:g}")
    from enumsol.roots.enumerate import enumerate_roots  # numpy and scipy: not for --help

    with search_display() as display:
        found = enumerate_roots(problem, alpha, arithmetic, progress=display)
    count = len(found)
    if not count:
        raise InvalidArgumentError(
            f"there is no isolated root at alpha = {float(alpha):g} ({found.closing_line}); expected another --start"
        )
    if root is None:
        return list(enumerate(found))
    if root >= count:
        raise InvalidArgumentError(
            f"--root is {root}; expected a number below {count}, the number of roots at alpha = {float(alpha):g}"
        )
    return [(root, found[root])]


@dataclass
class _Followed:
    """Paths from one root after the other."""

    problem: AnyProblem
    interval: tuple[float, float]
    steps: ContinuationOptions
    tangent: int | None
    found: list[tuple[int, int, Path]] = field(default_factory=list)  # number of the root, direction, path
    failures: list[tuple[int, int, str]] = field(default_factory=list)
    passed: dict[int, int] = field(default_factory=dict)

    @property
    def paths(self) -> list[Path]:
        """The paths alone."""
        return [path for _, _, path in self.found]

    def run(self, starts: Sequence[tuple[int, Root]], signs: tuple[int, ...], *, alone: bool) -> None:
        """Follow each start; Interrupted leaves what there is."""
        with Display("following") as display:
            for done, (number, root) in enumerate(starts):
                earlier = next((k for k, path in enumerate(self.paths) if _passes(path, root, self.problem)), None)
                if earlier is not None:
                    self.passed[number] = earlier
                    continue
                for sign in signs:
                    if self._follow(number, root, sign, alone=alone):
                        break
                points = sum(len(path) for path in self.paths)
                display.show((done + 1) / len(starts), f"{counted(len(self.paths), 'path')}, {points:,} points")

    def _follow(self, number: int, root: Root, sign: int, *, alone: bool) -> bool:
        """Follow one path; returns whether it closed."""
        from enumsol.continuation import AmbiguousStart, follow as follow_path

        try:
            path = follow_path(self.problem, root, sign, self.interval, self.steps, tangent=self.tangent)
        except AmbiguousStart as error:
            # the one root that was asked for: bad input; one among many: noted
            if alone:
                raise
            self.failures.append((number, sign, str(error)))
            return False
        except (Interrupted, OutOfMemoryError) as interruption:
            self.found.append((number, sign, interruption.partial))
            raise
        self.found.append((number, sign, path))
        return path.closed

    @property
    def arrived(self) -> bool:
        """True if every path left the interval or closed."""
        return not self.failures and all(path.status in _ARRIVED for path in self.paths)

    def as_text(self) -> str:
        """The printed paths."""
        lines = []
        for k, (root, sign, path) in enumerate(self.found):
            lines += [f"path {k}, from root {root} in direction {sign:+d}: {path!r}", ""]
        lines += [f"root {number} lies on path {k}" for number, k in self.passed.items()]
        lines += [f"root {number} in direction {sign:+d}: {reason}" for number, sign, reason in self.failures]
        ended = sum(path.status in _ARRIVED for path in self.paths)
        lines.append(f"{counted(len(self.paths), 'path')}, {ended} of them left the interval or closed")
        return "\n".join(lines)

    def frame(self) -> pd.DataFrame:
        """Points of all paths, with the columns path, root and direction."""
        import pandas as pd

        frames = [
            pd.DataFrame({"path": k, "root": root, "direction": sign, **path.to_frame()})
            for k, (root, sign, path) in enumerate(self.found)
        ]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=["path", "alpha"])

    def content(self) -> dict[str, Any]:
        """Everything, for JSON."""
        return {
            "paths": [{"root": number, "direction": sign, **_path_content(path)} for number, sign, path in self.found],
            "passed": [{"root": number, "path": k} for number, k in self.passed.items()],
            "failures": [{"root": number, "direction": sign, "reason": why} for number, sign, why in self.failures],
        }

    def draw(self, over: BranchGraph | None, node: int, quantity: str, units: tuple[str, str] | None) -> Any:
        """A figure of all paths."""
        figure = self.paths[0].plot(over, node=node, quantity=quantity, units=units)
        for path in self.paths[1:]:
            path.plot(ax=figure.axes[0], node=node, quantity=quantity)
        return figure


def _passes(path: Path, root: Root, problem: AnyProblem) -> bool:
    """True if the path runs through a regular root, which in 2D is the only one of its selection at that alpha."""
    if not root.regular:
        return False
    alpha = float(root.alpha)
    names = [point.statuses for point in path]
    return any(
        names[k] == root.statuses
        and (path.alpha[k] - alpha) * (path.alpha[k + 1] - alpha) <= 0
        and (root.lambda_t.ndim == 1 or _leads_to(path, k, root, problem))
        for k in range(len(path) - 1)
    )


def _leads_to(path: Path, k: int, root: Root, problem: AnyProblem) -> bool:
    """True if Newton's method from between two points of a path finds a root."""
    import numpy as np  # not for --help

    from enumsol.continuation import NotConverged, newton

    first, last = path.alpha[k], path.alpha[k + 1]
    share = 0.5 if first == last else (float(root.alpha) - first) / (last - first)
    forces = [np.column_stack([path.lambda_n[j], path.lambda_t[j]]) for j in (k, k + 1)]
    try:
        found = newton(problem, root.alpha, (1 - share) * forces[0] + share * forces[1])
    except NotConverged:
        return False
    # forces that are as near to each other belong to one root
    near = 1e-7 * max(float(np.max(np.abs(forces))), float(np.max(np.abs(root.lambda_n))))
    return all(
        np.max(np.abs(one - other)) <= near
        for one, other in ((found.lambda_n, root.lambda_n), (found.lambda_t, root.lambda_t))
    )


def _path_content(path: Path) -> dict[str, Any]:
    return {
        **output.taken(path, "status", "message", "closed"),
        "stats": vars(path.stats),
        "folds": [item.alpha for item in path.folds],
        "transitions": [
            {
                **output.taken(item, "alpha", "point", "before", "after"),
                "fold": item in path.folds,
                "local_branch": None if item.local_test is None else item.local_test.exists,
            }
            for item in path.transitions
        ],
        "points": path.to_frame().to_dict("list"),
    }


# -- fixed point -------------------------------------------------------------------------------------------------------
# ``enumsol fixed-point``: a solution with Coulomb friction by successive approximations, in 2D and 3D.

#: What a body that nothing holds has beside forces and displacements of its contact nodes.
_RIGID = ("rigid_coordinates", "rigid_displacement", "free_motion")


def fixed_point(
    problem: options.Problem,
    alpha: options.Number | None = None,
    start: Annotated[float | None, typer.Option(metavar="FORCE")] = None,
    tolerance: float = 1e-10,
    max_iterations: options.Count = 1000,
    anderson: Annotated[int, typer.Option(min=0, metavar="N")] = 0,
    json_file: options.OutputFile | None = None,
    csv_file: options.OutputFile | None = None,
    npz_file: options.OutputFile | None = None,
    vtu_file: options.OutputFile | None = None,
    units: options.Units | None = None,
    quiet: options.Quiet = False,
) -> None:
    """Find one solution of PROBLEM at one ALPHA, as the limit of contact problems with given slip bounds.

    The iteration converges for small friction. If it converges, its limit is a solution; there may be others: enumsol
    roots finds all of them, if the coefficients of friction do not depend on the slip. For a body that nothing holds it
    may come to slip bounds within which no forces hold the body, and then ends without one.

    Exit status: 0 if the iteration converged; 3 if not; 2 on bad input; 130 on
    Ctrl-C, after printing the last iterate; 74 if a result could not be written; 141 if the program that read it has
    ended.

    Parameters
    ----------
    alpha : Parameter value: a number or a fraction; may be omitted if nothing depends on it.
    start : Initial slip bound of every node, by default 0; of a body that nothing holds all nodes stick then.
    tolerance : Size of a step, relative to the load, at which the iteration has converged.
    max_iterations : Largest number of Tresca problems that are solved.
    anderson : Mix the last N steps (Anderson).
    csv_file : Write a table with one row per contact node; - is stdout.
    npz_file : Write all arrays, for FixedPoint.load.
    """
    body, names = common.load_problem(problem), common.units_of(problem, units)
    value = common.alpha_of(alpha, problem, body)
    options: dict[str, Any] = {"tolerance": tolerance, "max_iterations": max_iterations, "anderson": anderson}
    output.check_places(vtu_file, body, problem)
    found, ended = common.so_far(lambda: _approximate(body, value, start, options))

    def show(path: str) -> None:
        from enumsol.io.vtu import write_vtu  # numpy: not for --help

        write_vtu(body, found, path)

    output.deliver(
        (npz_file, found.save),
        (vtu_file, show),
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: common.in_units(repr(found), names),
        content=lambda: _content(found, problem),
        frame=found.to_frame,
    )
    common.finish(ended, common.ExitStatus.DONE if found.converged else common.ExitStatus.INCOMPLETE)


def _approximate(body: AnyProblem, alpha: Alpha, start: float | None, options: dict[str, Any]) -> FixedPoint:
    from enumsol.fixed_points import successive_approximations  # numpy and scipy: not for --help

    def told(state: FixedPointProgress) -> tuple[float, str]:
        return min(1.0, 1.0 / max(state.increment, 1e-300)), f"iteration {state.iteration}"

    with Display("iterating", told=told) as display:
        return successive_approximations(body, alpha, start, progress=display, **options)


def _content(found: FixedPoint, name: str) -> dict[str, Any]:
    return {
        "problem": name,
        "alpha": float(found.alpha),
        "alpha_text": str(found.alpha),
        **output.taken(found, "converged", "outcome", "why", "iterations", "contraction_factor", "residuals"),
        "node_ids": found.problem.node_ids,
        **output.taken(found, "statuses", "coefficients", "lambda_n", "lambda_t", "u_n", "u_t"),
        **({} if found.rigid_coordinates is None else output.taken(found, *_RIGID)),
        "increments": found.increments,
    }
