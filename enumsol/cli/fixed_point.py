"""``enumsol fixed-point``: a solution with Coulomb friction by successive approximations, in 2D and 3D."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from enumsol.cli import output
from enumsol.cli.common import ExitStatus, alpha_of, finish, in_units, load_problem, so_far, units_of
from enumsol.cli.options import Count, Number, OutputFile, Problem, Quiet, Units
from enumsol.cli.progress import Display

if TYPE_CHECKING:
    from enumsol.fixed_points import FixedPoint, FixedPointProgress
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha


#: What a body that nothing holds has beside forces and displacements of its contact nodes.
_RIGID = ("rigid_coordinates", "rigid_displacement", "free_motion")


def fixed_point(
    problem: Problem,
    alpha: Number | None = None,
    start: Annotated[float | None, typer.Option(metavar="FORCE")] = None,
    tolerance: float = 1e-10,
    max_iterations: Count = 1000,
    anderson: Annotated[int, typer.Option(min=0, metavar="N")] = 0,
    json_file: OutputFile | None = None,
    csv_file: OutputFile | None = None,
    npz_file: OutputFile | None = None,
    vtu_file: OutputFile | None = None,
    units: Units | None = None,
    quiet: Quiet = False,
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
    body, names = load_problem(problem), units_of(problem, units)
    value = alpha_of(alpha, problem, body)
    options: dict[str, Any] = {"tolerance": tolerance, "max_iterations": max_iterations, "anderson": anderson}
    output.check_places(vtu_file, body, problem)
    found, ended = so_far(lambda: _approximate(body, value, start, options))

    def show(path: str) -> None:
        from enumsol.io.vtu import write_vtu  # numpy: not for --help

        write_vtu(body, found, path)

    output.deliver(
        (npz_file, found.save),
        (vtu_file, show),
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: in_units(repr(found), names),
        content=lambda: _content(found, problem),
        frame=found.to_frame,
    )
    finish(ended, ExitStatus.DONE if found.converged else ExitStatus.INCOMPLETE)


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
