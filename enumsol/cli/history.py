"""``enumsol history``: every history of solutions that steps of load may leave behind."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from enumsol.cli import common, output
from enumsol.cli.common import deck_named, is_deck, step_chosen
from enumsol.cli.options import PLOT, Arithmetic, Count, OutputFile, PlotFile, Problem, Quiet, Seconds, Title, Units
from enumsol.cli.progress import Display
from enumsol.errors import InvalidArgumentError
from enumsol.support.messages import about, counted

if TYPE_CHECKING:
    from enumsol.loading.growing import HistoryProgress
    from enumsol.loading.history import History
    from enumsol.loading.steps import LoadStep
    from enumsol.model.problem3d import AnyProblem

Drawn = Annotated[
    Literal["step", "alpha", "displacement", "lambda_n", "lambda_t", "dissipated"], typer.Option(rich_help_panel=PLOT)
]


def history(
    problem: Problem,
    steps: Annotated[str | None, typer.Option(metavar="STEPS", show_default=False)] = None,
    arithmetic: Arithmetic = "verified",
    follow: Literal["all", "nearest", "not running away"] = "all",
    stability: bool = False,
    merge: Annotated[float | None, typer.Option(metavar="LENGTH", show_default=False)] = None,
    refine: bool = False,
    max_branches: Count | None = None,
    max_nodes: Count | None = None,
    time_limit: Seconds | None = None,
    jobs: Count = 1,
    proof_file: OutputFile | None = None,
    save_file: OutputFile | None = None,
    report_file: OutputFile | None = None,
    json_file: OutputFile | None = None,
    csv_file: OutputFile | None = None,
    plot_file: PlotFile | None = None,
    x: Drawn = "displacement",
    y: Drawn = "alpha",
    units: Units | None = None,
    title: Title | None = None,
    quiet: Quiet = False,
) -> None:
    """Find all histories of solutions of PROBLEM over a sequence of loads.

    Every root of a step starts the next one: slip is counted from where it leaves the contact nodes. Prints the number
    of roots and histories after every step, the tree of the roots, and up to which step the history is unique.

    Exit status: 0 if the history is complete (in fast arithmetic, which proves nothing: if nothing is known to be
    missing); 3 if something remained undecided, a limit ended it or roots were not followed; 2 on bad input; 130 on
    Ctrl-C, after printing what was found so far; 74 if a result could not be written; 141 if the program that read it
    has ended.

    Parameters
    ----------
    steps : A CSV file with the columns alpha, friction or f0, f1, ...; a list of alphas such as 0,1/2,1,0; or a .toml
        file with the key steps, such as tables [[steps]] of loads. Default: those of a .toml PROBLEM or of a deck.
    arithmetic : verified: rigorous error bounds, with proof. fast: floats and a tolerance, never proven. exact:
        rationals throughout, for small problems in 2D.
    follow : Which roots of a step start the next one: all, the nearest, or all but those that run away.
    stability : Say at every step how many roots run away; PROBLEM has a mesh or a mass.
    merge : Join ends whose contact nodes are at most this far apart.
    refine : Halve the increments until the statuses no longer change.
    max_branches : Follow at most N different ends of a step.
    proof_file : Write one proof of the whole history (verified).
    save_file : Write the history for History.load.
    report_file : Write an HTML page with the tree, the figures and the bodies.
    csv_file : Write a table with one row per root; - is stdout.
    x : Quantity on the horizontal axis.
    y : Quantity on the vertical axis.
    """
    if proof_file is not None and arithmetic != "verified":
        raise InvalidArgumentError(f"--proof is given with {arithmetic} arithmetic; expected verified")
    if steps is None and is_deck(problem):
        if step_chosen() is not None:
            raise InvalidArgumentError(
                "--step is given with a history of a deck, which takes all of its steps; expected none"
            )
        body, given = common.load_problem(problem, 1), deck_named(problem).steps()
    else:
        given, body = _steps(problem, steps), common.load_problem(problem)
    names = common.units_of(problem, units)
    limits = {"max_branches": max_branches, "max_nodes": max_nodes, "time_limit": time_limit}
    options = {"arithmetic": arithmetic, "follow": follow, "merge": merge, "refine": refine, **limits}
    if stability:
        common.check_motions(body)
    found, ended = common.so_far(lambda: _search(body, given, jobs, options))
    if stability and ended is None:
        found, ended = common.so_far(lambda: common.judged(found, found.stability))

    def write_page(path: str) -> None:
        from enumsol.report import write_report  # numpy: not for --help

        write_report(found, path, title=common.title_of(problem, title), units=names, scene=common.scene_of(problem, 1))

    output.deliver(
        (proof_file, lambda path: _write_proof(found, path)),
        (save_file, found.save),
        (report_file, write_page),
        (plot_file, lambda path: output.write_figure(path, found.plot(x, y, units=names))),
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: found.text(names),
        content=lambda: {"problem": problem, **_content(found)},
        frame=found.to_frame,
    )
    common.finish(ended, common.ExitStatus.INCOMPLETE if found.reasons else common.ExitStatus.DONE)


def _search(problem: AnyProblem, steps: object, jobs: int, options: dict[str, Any]) -> History:
    from enumsol.loading.growing import histories  # numpy and scipy: not for --help

    with common.workers(jobs) as executor, Display("stepping", told=_told) as display:
        return histories(problem, steps, executor=executor, progress=display, **options)


def _told(state: HistoryProgress) -> tuple[float, str]:
    """Share of the history that is done, and where it is."""
    of_step = state.stages / (state.stages + state.waiting)
    share = (state.step - 1 + of_step) / state.steps
    left, roots = counted(state.waiting, "start"), counted(state.roots, "root")
    return share, f"step {state.step} of {state.steps}, {left} left, {roots}"


def _steps(problem: str, steps: str | None) -> Any:
    """The steps of the option, which may name a TOML file, or of the problem's TOML file.

    Raises
    ------
    InvalidArgumentError
        There are none, or they cannot be read.
    """
    from enumsol.loading.steps import read_steps  # numpy: not for --help

    if steps is not None and not steps.endswith(common.TOML):
        if Path(steps).suffix.lower() == ".csv" or Path(steps).is_file():
            return read_steps(steps)
        return [part.strip() for part in steps.split(",")]
    file = problem if steps is None else steps
    said = _tables(file).get("steps")
    if said is None:
        what = "is missing" if steps is None else f"{steps} has no steps"
        raise InvalidArgumentError(
            f"--steps {what}; expected a CSV file, a list of alphas, or steps in a {common.TOML} file"
        )
    if isinstance(said, str):
        return read_steps(Path(file).parent / said)
    if isinstance(said, list) and said and all(isinstance(item, dict) for item in said):
        return _of_scene(problem, said)
    return said


def _tables(file: str) -> dict[str, Any]:
    """Keys and values of a TOML file; a problem in another file has none."""
    if not file.endswith(common.TOML):
        return {}
    from enumsol.fem.mesh_problems import toml_options  # as above

    with about(file, InvalidArgumentError):
        return toml_options(Path(file))


def _of_scene(problem: str, tables: list[dict[str, Any]]) -> list[LoadStep]:
    from enumsol.fem import scene_steps  # as above

    scene = common.scene_of(problem)
    if scene is None:
        raise InvalidArgumentError(
            f"--steps has tables [[steps]], and {problem} has no mesh; expected a {common.TOML} file or a deck"
        )
    return scene_steps(scene, tables)


def _write_proof(found: History, path: str) -> None:
    if found.proof is None:
        raise InvalidArgumentError("no proof can be written: nothing was searched")
    found.proof.save(path)


def _content(found: History) -> dict[str, Any]:
    """The history, for JSON."""
    return {
        "arithmetic": found.arithmetic,
        "steps": [repr(step) for step in found.steps],
        **output.taken(found, "complete", "unique_until"),
        "histories": found.counts,
        **output.taken(found, "branchings", "ends", "reasons"),
        "increments": None if found.refinement is None else str(found.refinement),
        "roots": found.to_frame().to_dict(orient="records"),
    }
