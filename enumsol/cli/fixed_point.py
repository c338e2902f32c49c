"""``enumsol fixed-point``: a solution with Coulomb friction by successive approximations, in 2D and 3D."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from enumsol.cli import output
from enumsol.cli.common import ExitStatus, finish, in_units, load_problem, parse_alpha, so_far, units_of
from enumsol.cli.options import JsonFile, PlotFile, ProblemArgument, Quiet, Units, VtuFile, count, csv, file, number
from enumsol.cli.progress import Display
from enumsol.errors import InvalidArgumentError
from enumsol.support.messages import counted

if TYPE_CHECKING:
    import pandas as pd

    from enumsol.fixed_points import FixedPoint, FixedPointProgress
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha


#: What a body that nothing holds has beside forces and displacements of its contact nodes.
_RIGID = ("rigid_coordinates", "rigid_displacement", "free_motion")


def fixed_point(
    problem: ProblemArgument,
    alpha: Annotated[
        str | None,
        number("--alpha", "Parameter value: a number or a fraction; may be omitted if nothing depends on it."),
    ] = None,
    start: Annotated[
        float | None,
        typer.Option(
            metavar="FORCE",
            help="Initial slip bound of every node, by default 0; of a body that nothing holds all nodes stick then.",
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Size of a step, relative to the load, at which the iteration has converged.")
    ] = 1e-10,
    max_iterations: Annotated[int, count("Largest number of Tresca problems that are solved.")] = 1000,
    anderson: Annotated[int, typer.Option(min=0, metavar="N", help="Mix the last N steps (Anderson).")] = 0,
    starts: Annotated[
        int | None, count("In 2D: try N random starts, and report which of all solutions they reach.", panel="Starts")
    ] = None,
    json_file: JsonFile = None,
    csv_file: Annotated[str | None, csv("contact node, or with --starts per start")] = None,
    npz_file: Annotated[str | None, file("--npz", "Write all arrays, for FixedPoint.load.")] = None,
    vtu_file: VtuFile = None,
    plot_file: PlotFile = None,
    units: Units = None,
    quiet: Quiet = False,
) -> None:
    """Find one solution of PROBLEM at one ALPHA, as the limit of contact problems with given slip bounds.

    The iteration converges for small friction. If it converges, its limit is a solution; there may be others: enumsol
    roots finds all of them, if the coefficients of friction do not depend on the slip. For a body that nothing holds it
    may come to slip bounds within which no forces hold the body, and then ends without one.

    Exit status: 0 if the iteration converged (with --starts: from every start); 3 if not; 2 on bad input; 130 on
    Ctrl-C, after printing the last iterate; 74 if a result could not be written; 141 if the program that read it has
    ended.
    """
    output.check_outputs(json=json_file, csv=csv_file, npz=npz_file)
    output.check_vtu(vtu_file)
    output.check_plot(plot_file)
    _check_combination(starts, npz_file, vtu_file, plot_file)
    body, names = load_problem(problem), units_of(problem, units)
    value = _alpha(alpha, problem, body)
    options: dict[str, Any] = {"tolerance": tolerance, "max_iterations": max_iterations, "anderson": anderson}
    files = {"json_file": json_file, "csv_file": csv_file}
    if starts is not None:
        _basins(_in_2d(body, problem), problem, value, starts, options, files, plot_file, names)
    output.check_places(vtu_file, body, problem)
    found, ended = so_far(lambda: _approximate(body, value, start, options))

    def show(path: str) -> None:
        from enumsol.io.vtu import write_vtu  # numpy: not for --help

        write_vtu(body, found, path)

    output.deliver(
        (npz_file, found.save),
        (vtu_file, show),
        **files,
        text=lambda: in_units(repr(found), names),
        content=lambda: _content(found, problem),
        frame=found.to_frame,
    )
    finish(ended, ExitStatus.DONE if found.converged else ExitStatus.INCOMPLETE)


def _check_combination(starts: int | None, npz_file: str | None, vtu_file: str | None, plot_file: str | None) -> None:
    if starts is None and plot_file is not None:
        raise InvalidArgumentError("--plot is given without --starts; expected both, for a picture of what is reached")
    output.check_named_files(", but it is a binary file", npz=npz_file)
    for option, path in (("--npz", npz_file), ("--vtu", vtu_file)):
        if starts is not None and path is not None:
            raise InvalidArgumentError(f"{option} and --starts are both given; expected one of them")


def _alpha(text: str | None, name: str, body: AnyProblem) -> Alpha:
    """The alpha that was given, or any where the problem does not depend on it."""
    if text is not None:
        return parse_alpha(text)
    if body.depends_on_alpha:
        raise InvalidArgumentError(
            f"--alpha is missing, and friction or load of {name} depends on it; expected a number"
        )
    return 0.0


def _in_2d(body: AnyProblem, name: str) -> ContactProblem:
    from enumsol.model.problem import ContactProblem  # as below

    if not isinstance(body, ContactProblem):
        raise InvalidArgumentError(f"--starts is given, but {name} is a problem in 3D; expected one in 2D")
    return body


def _approximate(body: AnyProblem, alpha: Alpha, start: float | None, options: dict[str, Any]) -> FixedPoint:
    from enumsol.fixed_points import successive_approximations  # numpy and scipy: not for --help

    with Display("iterating") as display:

        def show(state: FixedPointProgress) -> None:
            display.show(min(1.0, 1.0 / max(state.increment, 1e-300)), f"iteration {state.iteration}")

        return successive_approximations(body, alpha, start, progress=show, **options)


def _content(found: FixedPoint, name: str) -> dict[str, Any]:
    return {
        "problem": name,
        "alpha": float(found.alpha),
        "alpha_text": str(found.alpha),
        "converged": found.converged,
        "outcome": found.outcome.value,
        "why": found.why,
        "iterations": found.iterations,
        "contraction_factor": found.contraction_factor,
        "residuals": dict(found.residuals),
        "node_ids": list(found.problem.node_ids),
        "statuses": [status.value for status in found.statuses],
        **{name: getattr(found, name) for name in ("coefficients", "lambda_n", "lambda_t", "u_n", "u_t")},
        **({} if found.rigid_coordinates is None else {name: getattr(found, name) for name in _RIGID}),
        "increments": found.increments,
    }


def _basins(
    body: ContactProblem,
    name: str,
    alpha: Alpha,
    starts: int,
    options: dict[str, Any],
    files: dict[str, str | None],
    plot_file: str | None,
    units: tuple[str, str] | None,
) -> None:
    from enumsol.fixed_points import basin_table, plot_basins  # as above
    from enumsol.roots.enumerate import enumerate_roots

    roots = enumerate_roots(body, alpha)
    if not len(roots):
        raise InvalidArgumentError(
            f"--starts is given, but {name} has no isolated solution at alpha = {float(alpha):g}, which a start could "
            "reach; expected one"
        )
    table, ended = so_far(lambda: basin_table(body, roots, starts, **options))
    output.deliver(
        (plot_file, lambda path: output.write_figure(path, plot_basins(table, units=units))),
        **files,
        text=lambda: _basin_text(table, len(roots), roots.closing_line),
        content=lambda: {"problem": name, "alpha": float(alpha), **_basin_content(table, len(roots))},
        frame=lambda: table,
    )
    finish(ended, ExitStatus.DONE if table["root"].notna().all() else ExitStatus.INCOMPLETE)


def _basin_content(table: pd.DataFrame, roots: int) -> dict[str, Any]:
    rows = table.astype(object).where(table.notna(), None).to_dict("records")
    return {"roots": roots, "never": table.attrs["never"], "starts": rows}


def _basin_text(table: pd.DataFrame, roots: int, completeness: str) -> str:
    lines = []
    for root in range(roots):
        rows = table[table["root"] == root]
        most = f", up to {counted(rows['iterations'].max(), 'iteration')}" if len(rows) else ""
        lines.append(f"root {root}: reached from {len(rows)} of {counted(len(table), 'start')}{most}")
    lost = table[table["root"].isna()]
    lines += [f"no root ({outcome}): {counted(len(rows), 'start')}" for outcome, rows in lost.groupby("outcome")]
    return "\n".join([*lines, f"the list of roots is {completeness}"])
