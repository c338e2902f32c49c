"""``enumsol table``: the number of solutions at many alphas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from enumsol.cli.common import ExitStatus, finish, load_problem, parse_alpha, parse_interval, so_far, workers
from enumsol.cli.options import Arithmetic, Count, Number, OutputFile, Problem, Quiet, Seconds
from enumsol.cli.output import deliver
from enumsol.cli.progress import Display
from enumsol.errors import EnumsolError, InvalidArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha

#: Names of the columns on the terminal, explained by `_CAPTION` underneath.
_NAMES = {
    "with_open": "open",
    "with_stick": "stick",
    "with_slip_plus": "slip+",
    "with_slip_minus": "slip-",
    "with_slip": "slip",
    "index_sum": "index sum",
    "left_out": "left out",
    "stability_undecided": "may run away",
}
#: Columns that count solutions; a row whose search was cut short shows what it found as a lower bound.
_COUNTS = ("roots", "families", "open", "stick", "slip+", "slip-", "slip")
_CAPTION = "{}: how many of the roots have a node in that status"
_LEFT_OUT = (
    "left out: how many roots run away, and are not counted; may run away: how many that are counted are undecided"
)
_FIRST, _LAST = "first alpha", "last alpha"
_RUNS_CAPTION = "each row stands for all alphas tried from the first to the last, which have equal counts"


def table(
    problem: Problem,
    first: Number | None = None,
    last: Number | None = None,
    samples: Annotated[int, typer.Option(min=2, metavar="N")] = 21,
    alphas: Annotated[str | None, typer.Option(metavar="LIST")] = None,
    arithmetic: Arithmetic = "verified",
    without: Annotated[Literal["running away"] | None, typer.Option()] = None,
    max_nodes: Count | None = None,
    time_limit: Seconds | None = None,
    jobs: Count = 1,
    json_file: OutputFile | None = None,
    csv_file: OutputFile | None = None,
    quiet: Quiet = False,
) -> None:
    """Count the solutions of PROBLEM at many alphas, by kind of contact.

    A table does not show what happens between the alphas; enumsol graph does.

    Exit status: 0 if the result is complete at every alpha (in fast arithmetic, which proves nothing: if every search
    ran to its end with nothing undecided); 3 if something remained undecided, such as whether a root runs away if that
    was asked for, or the indices do not add up to +1 somewhere; 2 on bad input; 130 on Ctrl-C, after printing what was
    done so far; 74 if a result could not be written; 141 if the program that read it has ended.

    Parameters
    ----------
    first : First alpha.
    last : Last alpha.
    samples : Number of evenly spaced alphas, including both ends.
    alphas : A list of alphas instead, such as 1,2.5,8/3.
    arithmetic : Arithmetic of each enumeration, as in enumsol roots.
    without : Leave out roots that are proven to run away; undecided ones stay. PROBLEM has a mesh or a mass.
    max_nodes : Largest number of nodes of the tree at one alpha.
    time_limit : Longest time of the search at one alpha.
    jobs : Number of processes, each of which searches one alpha at a time.
    csv_file : Write a table with one row per alpha; - is stdout.
    """
    values, body = _alphas(first, last, samples, alphas), load_problem(problem)
    limits = {"max_nodes": max_nodes, "time_limit": time_limit, "without": without}
    options = {name: limit for name, limit in limits.items() if limit is not None}
    frame, ended = so_far(lambda: _search(body, values, arithmetic, jobs, options))
    deliver(
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: _as_text(frame, len(values), ended),
        content=lambda: {"problem": problem, "arithmetic": arithmetic, **_content(frame, values, ended)},
        frame=lambda: frame,
    )
    finish(ended, ExitStatus.INCOMPLETE if len(_open(frame)) else ExitStatus.DONE)


def _alphas(first: str | None, last: str | None, samples: int, listed: str | None) -> list[Alpha]:
    if listed is not None:
        if first is not None or last is not None:
            raise InvalidArgumentError("--alphas and --from or --to are both given; expected one or the other")
        return [parse_alpha(text, f"--alphas[{k}]") for k, text in enumerate(listed.split(","))]
    if first is None or last is None:
        raise InvalidArgumentError("expected --from and --to, or --alphas")
    from enumsol.support.arguments import even_alphas  # numpy: not for --help

    return even_alphas(parse_interval(first, last), samples)


def _search(
    problem: AnyProblem, alphas: list[Alpha], arithmetic: Arithmetic, jobs: int, options: dict[str, Any]
) -> pd.DataFrame:
    from enumsol.branches import multiplicity_table

    with workers(jobs) as executor, Display("enumerating") as display:
        return multiplicity_table(
            problem, alphas, arithmetic=arithmetic, executor=executor, progress=display.count("alphas"), **options
        )


def _content(frame: pd.DataFrame, alphas: list[Alpha], ended: EnumsolError | None) -> dict[str, Any]:
    return {
        "alphas": len(alphas),
        "complete": len(frame) == len(alphas) and bool(frame["complete"].all()),
        "completeness": _closing_line(frame, len(alphas), ended),
        "rows": frame.astype(object).where(frame.notna(), None).to_dict("records"),
    }


def _open(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows at which the search was cut short, something is undecided, or the indices show that something is missing."""
    missing = frame["index_sum"].notna() & frame["index_sum"].ne(1) if frame.attrs["held"] else False
    return frame[_gaps(frame) | missing | _may_run_away(frame)]


def _may_run_away(frame: pd.DataFrame) -> pd.Series[bool]:
    """True in rows with roots that are counted and may run away."""
    return frame.get("stability_undecided", 0 * frame["roots"]).gt(0)


def _gaps(frame: pd.DataFrame) -> pd.Series[bool]:
    """True in rows whose counts are lower bounds."""
    return frame["undecided"].gt(0) | frame["stopped"].notna()


def _as_text(frame: pd.DataFrame, asked: int, ended: EnumsolError | None) -> str:
    shown = frame.drop(columns=["stopped", "nodes", "seconds"]).rename(columns=_NAMES)
    if not shown["undecided"].any():
        shown = shown.drop(columns="undecided")
    known = shown["index sum"].notna()
    shown["index sum"] = shown["index sum"].map("{:+d}".format, na_action="ignore").astype(object).where(known, "?")
    if _gaps(frame).any():
        for name in _COUNTS:
            if name not in shown:
                continue
            shown[name] = shown[name].astype(str).where(~_gaps(frame), ">=" + shown[name].astype(str))
    shown["complete"] = ["yes" if value else "no" for value in shown["complete"]]
    captions = [_LEFT_OUT] if "left out" in shown else []
    captions += [_CAPTION.format(", ".join(name for name in _COUNTS[2:] if name in shown))]
    if len(shown) > 40:  # printed as runs of equal counts
        shown = _runs(shown)
        captions.append(_RUNS_CAPTION)
    for name in ("alpha", _FIRST, _LAST):
        if name in shown:
            shown[name] = [f"{value:.8g}" for value in shown[name]]
    lines = [shown.to_string(index=False), *captions] if len(shown) else []
    return "\n".join([*lines, "", _closing_line(frame, asked, ended)])


def _runs(frame: pd.DataFrame) -> pd.DataFrame:
    """Neighbouring rows with equal counts as one."""
    counts = frame.drop(columns="alpha")
    run = counts.ne(counts.shift()).any(axis=1).cumsum()
    first, last = frame.groupby(run).first(), frame["alpha"].groupby(run).last()
    first.insert(1, _LAST, last)
    return first.rename(columns={"alpha": _FIRST})


def _closing_line(frame: pd.DataFrame, asked: int, ended: EnumsolError | None) -> str:
    if len(frame) < asked:
        return f"complete: no (interrupted after {len(frame)} of {asked} alphas)"
    left = _open(frame)
    if len(left):
        some = ", ".join(f"{alpha:g}" for alpha in left["alpha"][:5]) + (", ..." if len(left) > 5 else "")
        return f"complete: no (at {len(left)} of {asked} alphas: {some})"
    if frame["complete"].all():
        return f"complete: yes (proven at all {asked} alphas; says nothing about those in between)"
    return "complete: not proven (0 undecided)"
