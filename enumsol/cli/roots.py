"""``enumsol roots`` and ``enumsol table``: all solutions at one alpha, and their number at many."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer

from enumsol.cli import common, options, output
from enumsol.cli.progress import Display, search_display
from enumsol.errors import EnumsolError, InvalidArgumentError
from enumsol.support.messages import counted, listed, visible

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from enumsol.fem import Scene
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root import Root, RootFamily
    from enumsol.roots.root_set import RootSet, Undecided
    from enumsol.support.array_types import Alpha, Floats


@dataclass(frozen=True)
class Search:
    """A search at one alpha as its options describe it; every field is an option, in the order of the help.

    Parameters
    ----------
    arithmetic : verified: rigorous error bounds, with proof. fast: floats and a tolerance, never proven. exact:
        rationals throughout, with proof, for small problems.
    method : tree: a tree search. exhaustive: all 4^p selections, fast or exact, for small p.
    unique : Only report whether there is one solution; stop at a second one.
    stability : Say which roots run away, in the proof too; PROBLEM has a mesh or a mass.
    stop_after : Stop at N roots; 2 decides whether the solution is unique.
    jobs : Number of processes that search (tree).
    proof_file : Write the proof (verified).
    resume : Resume from the proof in --proof FILE, if there is one.
    csv_file : Write a table with one row per root and contact node; - is stdout.
    start_file : Write a deck for every root, FILE-0.inp, ..., which leads CalculiX from an .inp PROBLEM to it.
    report_file : Write an HTML page about the roots, with their deformed bodies.
    """

    arithmetic: options.Arithmetic = "verified"
    method: Literal["tree", "exhaustive"] = "tree"
    unique: bool = False
    stability: bool = False
    stop_after: options.Count | None = None
    max_nodes: options.Count | None = None
    time_limit: options.Seconds | None = None
    jobs: options.Count = 1
    proof_file: options.OutputFile | None = None
    resume: options.OutputFlag = False
    json_file: options.OutputFile | None = None
    csv_file: options.OutputFile | None = None
    vtu_file: options.OutputFile | None = None
    frd_file: options.OutputFile | None = None
    start_file: options.OutputFile | None = None
    report_file: options.OutputFile | None = None
    units: options.Units | None = None

    def check(self) -> None:
        """Refuse options that contradict each other, and a proof to resume from that is not named.

        Raises
        ------
        InvalidArgumentError
            They do.
        """
        if self.jobs > 1 and self.method != "tree":
            raise InvalidArgumentError(
                f"--jobs is {self.jobs} with the exhaustive method; expected 1 job, or the method tree"
            )
        if self.resume and self.proof_file is None:
            raise InvalidArgumentError(
                "--resume is given without --proof; expected the file of the proof to resume from"
            )
        common.units_of("", self.units)
        if self.unique and self.stop_after is not None:
            raise InvalidArgumentError(
                f"--stop-after is {self.stop_after} with --unique, which stops at the second root"
            )

    def answer(
        self, name: str, problem: AnyProblem, alpha: Alpha, source: str | None, scene: Scene | None = None
    ) -> NoReturn:
        """Search, write what was found, and end the command.

        ``source`` is what other commands take for the problem, None where there is no such file; ``scene`` is what the
        problem was made of, where it was not read from ``source``.
        """
        output.check_places(self.vtu_file, problem, name)
        output.check_mesh(self.frd_file, problem, name)
        if self.start_file is not None and not common.is_deck(name):
            raise InvalidArgumentError(f"--start is given, but {name} is no deck; expected an .inp PROBLEM")
        output.check_scripts(self.report_file, problem)
        if self.stability:
            common.check_motions(problem)
        units = common.units_of(name, self.units)
        found, ended = common.so_far(lambda: self._found(problem, alpha))
        output.deliver(
            (self.vtu_file, lambda path: _write_states(problem, found, path, "--vtu")),
            (self.frd_file, lambda path: _write_states(problem, found, path, "--frd")),
            (self.start_file, lambda path: _write_starts(name, found, path)),
            (self.report_file, lambda path: self._write_page(found, path, name, source, scene)),
            json_file=self.json_file,
            csv_file=self.csv_file,
            text=lambda: uniqueness(found) if self.unique else common.in_units(roots_as_text(found), units),
            content=lambda: roots_as_json(found, name),
            frame=found.to_frame,
        )
        outputs = (("the CSV", self.csv_file), ("--vtu", self.vtu_file), ("--frd", self.frd_file))
        partly = [name for name, path in outputs if path is not None]
        if partly and found.families:
            families = counted(len(found.families), "family", "families")
            holds = "hold" if len(partly) > 1 else "holds"
            common.note(f"{listed(partly)} {holds} the isolated roots only, --json the {families} too")
        common.finish(ended, common.ExitStatus.DONE if self.unique and found.unique is not None else _status(found))

    def _write_page(self, found: RootSet, path: str, name: str, source: str | None, scene: Scene | None) -> None:
        from enumsol.report import write_report  # numpy: not for --help

        # -1 would be read as an option
        place = f"--alpha={shlex.quote(str(found.alpha))}"
        commands = output.checking_commands(found.proof is not None, source, "roots", place, self.proof_file)
        about = common.scene_of(name) if scene is None else scene
        title, units = common.title_of(name), common.units_of(name, self.units)
        write_report(found, path, title=title, units=units, commands=commands, scene=about)

    def _found(self, problem: AnyProblem, alpha: Alpha) -> RootSet:
        from enumsol.roots.enumerate import enumerate_roots  # numpy and scipy: not for --help

        names = ("arithmetic", "method", "max_nodes", "time_limit", "resume")
        asked: dict[str, Any] = {name: getattr(self, name) for name in names}
        asked |= {"stop_after": 2 if self.unique else self.stop_after, "proof_path": self.proof_file}
        with common.workers(self.jobs) as executor, search_display() as display:
            found = enumerate_roots(problem, alpha, executor=executor, progress=display, **asked)
        return common.judged(found, lambda: self._judge(found)) if self.stability else found

    def _judge(self, found: RootSet) -> None:
        if self.proof_file is not None and found.proof is not None and len(found):
            # in the place of the proof of the roots, which it holds
            found.stability_proof().save(self.proof_file)
        else:
            found.stability()


@options.with_options(*options.options_of(Search), after=2)
def roots(
    problem: options.Problem, alpha: options.Number | None = None, *, quiet: options.Quiet = False, **chosen: Any
) -> None:
    """Find all solutions of PROBLEM at one ALPHA.

    Prints a table of the roots and whether it is complete; lambda_n and lambda_t are nodal forces, not pressures. The
    index of a root is the sign of a determinant; the indices of all solutions add up to +1 if the body is held.

    Exit status: 0 if the result is complete (in fast arithmetic, which proves nothing: if the search ran to its end
    with nothing undecided), with --unique if yes or no is proven; 3 if something remained undecided, a limit cut the
    search short, or the indices do not add up to +1; 2 on bad input; 130 on Ctrl-C, after printing what was found so
    far; 74 if a result could not be written; 141 if the program that read it has ended.

    Parameters
    ----------
    alpha : Parameter value: a decimal number, read as float64, or a fraction such as 8/3, taken exactly; required if
        friction or load depend on it.
    """
    search = Search(**chosen)
    search.check()
    if alpha is not None:
        common.parse_alpha(alpha)  # before the problem is read
    body = common.load_problem(problem)
    search.answer(problem, body, common.alpha_of(alpha, problem, body), problem)


def _write_states(problem: AnyProblem, found: RootSet, path: str, option: str) -> None:
    if not len(found):
        common.note(f"{option}: no isolated root was found, so no file is written")
        return
    from enumsol.io import calculix, vtu  # numpy: not for --help

    (vtu.write_vtu if option == "--vtu" else calculix.write_frd)(problem, found, path)


def _write_starts(name: str, found: RootSet, path: str) -> None:
    from enumsol.io.calculix import write_start  # numpy: not for --help

    model = common.deck_named(name)
    place = Path(path)
    for k, root in enumerate(found):
        write_start(model, root, place.with_stem(f"{place.stem}-{k}"), step=common.step_chosen())


def _status(found: RootSet) -> common.ExitStatus:
    if found.stopped is not None or found.undecided or not found.adds_up:
        return common.ExitStatus.INCOMPLETE
    return common.ExitStatus.DONE


# -- a RootSet as text for the terminal and as JSON --------------------------------------------------------------------

_STATS = ("nodes", "pruned", "selections", "qps", "fallback_qps", "closed", "seconds", "resumed", "held", "held_open")
_VALUES = ("lambda_n", "lambda_t", "u_n", "u_t")


def roots_as_text(found: RootSet) -> str:
    """The printed RootSet, and before its closing lines nothing else; small ones with a table over contact nodes."""
    rows = (len(found) + sum(len(family.vertices) for family in found.families)) * len(found.node_ids)
    if not 0 < rows <= 24:
        return repr(found)
    from enumsol.roots.root import node_heading  # numpy: not for --help

    width = max(4, *(len(visible(label)) for label in found.node_ids))
    tangents = 2 if len(found) and found[0].lambda_t.ndim == 2 else 1
    # a continuum has forces only
    places = found[0].problem.coordinates if len(found) else None
    lines = [f"{'':>8} {node_heading(width, tangents, places)}"]
    for k, root in enumerate(found):
        lines += _root_rows(f"root {k}", root, found.node_ids, width, places)
    for k, family in enumerate(found.families):
        lines += _family_rows(k, family, found.node_ids, width)
    return "\n".join([*lines, "", repr(found)])


def _root_rows(title: str, root: Root, node_ids: tuple[Any, ...], width: int, places: Floats | None) -> Iterator[str]:
    from enumsol.roots.root import node_line  # as above

    for i, label in enumerate(node_ids):
        yield f"{title if i == 0 else '':>8} {node_line(root, i, label, width, places)}"


def _family_rows(k: int, family: RootFamily, node_ids: tuple[Any, ...], width: int) -> Iterator[str]:
    yield f"family {k}, vertices"
    for j, vertex in enumerate(family.vertices):
        for i, (label, (normal, tangential)) in enumerate(zip(node_ids, vertex, strict=True)):
            numbers = f"{normal + 0.0:>12.6g} {tangential + 0.0:>12.6g}"
            yield f"{j if i == 0 else '':>8} {visible(label):>{width}} {'':<7} {numbers}"


def uniqueness(found: RootSet) -> str:
    """Line that says whether there is one solution."""
    if found.unique is None:
        why = "fast arithmetic proves nothing" if found.arithmetic == "fast" else found.closing_line
        return f"unique: not known ({why})"
    if found.unique:
        bound = found.rigid_bound
        within = f", {bound.words()}" if bound is not None and bound.needed else ""
        return (
            f"unique: yes ({'proven by one certificate' if found.by_one_certificate else 'proven by a search'}{within})"
        )
    what = "a continuum of solutions" if found.families else "two solutions"
    return f"unique: no ({what}, proven; --unique looks for no more)"


def roots_as_json(found: RootSet, problem: str) -> str:
    """The whole result; numbers read back as the same float64, what is not finite is null."""
    bound = found.rigid_bound
    content = {
        "problem": problem,
        "alpha": float(found.alpha),
        "alpha_text": str(found.alpha),
        **output.taken(found, "arithmetic", "method", "complete"),
        "certified_data": found.certified_data if found.complete else None,
        "completeness": found.closing_line,
        **output.taken(found, "unique", "by_one_certificate", "stopped", "notes", "index_sum"),
        **({} if bound is None else {"max_rigid_displacement": bound.largest, "bound_needed": bound.needed}),
        "node_ids": found.node_ids,
        "roots": [_root(root) | _stability(found, k) for k, root in enumerate(found)],
        "families": [_family(family) for family in found.families],
        "undecided": [_undecided(item) for item in found.undecided],
        "stats": output.taken(found.stats, *_STATS),
    }
    return (
        "{\n"
        + ",\n".join(f"{json.dumps(key)}: {_lines(value)}" for key, value in output.plain(content).items())
        + "\n}"
    )


def _lines(value: object) -> str:
    """JSON with one line per entry of a list of objects."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(json.dumps(item) for item in value) + "\n]"
    return json.dumps(value, default=str)


def _root(root: Root) -> dict[str, Any]:
    if root.lambda_t.ndim == 2:
        more = {"slip_angle": _angles(root.slip_angle)}
        more |= {} if root.rigid_coordinates is not None else output.taken(root, "dlambda_dalpha")
    elif root.rigid_coordinates is not None:
        more = output.taken(root, "rigid_coordinates", "rigid_displacement")
    else:
        more = output.taken(root, "condition", "dlambda_dalpha")
    return {
        **output.taken(root, "statuses", "active", *_VALUES),
        "enclosure": None if root.enclosure is None else output.taken(root.enclosure, *_VALUES),
        **output.taken(root, "index", "regular", "margin"),
        **more,
    }


def _stability(found: RootSet, k: int) -> dict[str, Any]:
    if found.verdicts is None:
        return {}
    return {"stability": output.taken(found.verdicts[k], "verdict", "growth_rates", "bounds", "reason")}


def _undecided(item: Undecided) -> dict[str, Any]:
    content = output.taken(item, "statuses", "reason", "hint")
    if item.slip_angle is None:
        return content
    bounds = None if item.bounds is None else output.taken(item.bounds, *_VALUES)
    return {**content, "leaves": item.leaves, "slip_angle": _angles(item.slip_angle), "bounds": bounds}


def _angles(angles: Floats | None) -> list[list[float] | None]:
    return [] if angles is None else [None if math.isnan(low) else [low, high] for low, high in angles.tolist()]


def _family(family: RootFamily) -> dict[str, Any]:
    parts = [
        output.taken(part, "statuses", "dimension", "vertices")
        | ({} if part.rigid_coordinates is None else output.taken(part, "rigid_coordinates"))
        for part in family.polytopes
    ]
    return {**output.taken(family, "index", "dimension", "vertices_proven"), "polytopes": parts}


# -- table -------------------------------------------------------------------------------------------------------------
# ``enumsol table``: the number of solutions at many alphas.

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
    problem: options.Problem,
    first: options.Number | None = None,
    last: options.Number | None = None,
    samples: Annotated[int, typer.Option(min=2, metavar="N")] = 21,
    alphas: Annotated[str | None, typer.Option(metavar="LIST")] = None,
    arithmetic: options.Arithmetic = "verified",
    without: Annotated[Literal["running away"] | None, typer.Option()] = None,
    max_nodes: options.Count | None = None,
    time_limit: options.Seconds | None = None,
    jobs: options.Count = 1,
    json_file: options.OutputFile | None = None,
    csv_file: options.OutputFile | None = None,
    quiet: options.Quiet = False,
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
    values, body = _alphas(first, last, samples, alphas), common.load_problem(problem)
    limits = {"max_nodes": max_nodes, "time_limit": time_limit, "without": without}
    options = {name: limit for name, limit in limits.items() if limit is not None}
    frame, ended = common.so_far(lambda: _search(body, values, arithmetic, jobs, options))
    output.deliver(
        json_file=json_file,
        csv_file=csv_file,
        text=lambda: _as_text(frame, len(values), ended),
        content=lambda: {"problem": problem, "arithmetic": arithmetic, **_content(frame, values, ended)},
        frame=lambda: frame,
    )
    common.finish(ended, common.ExitStatus.INCOMPLETE if len(_open(frame)) else common.ExitStatus.DONE)


def _alphas(first: str | None, last: str | None, samples: int, listed: str | None) -> list[Alpha]:
    if listed is not None:
        if first is not None or last is not None:
            raise InvalidArgumentError("--alphas and --from or --to are both given; expected one or the other")
        return [common.parse_alpha(text, f"--alphas[{k}]") for k, text in enumerate(listed.split(","))]
    if first is None or last is None:
        raise InvalidArgumentError("expected --from and --to, or --alphas")
    from enumsol.support.arguments import even_alphas  # numpy: not for --help

    return even_alphas(common.parse_interval(first, last), samples)


def _search(
    problem: AnyProblem, alphas: list[Alpha], arithmetic: options.Arithmetic, jobs: int, options: dict[str, Any]
) -> pd.DataFrame:
    from enumsol.branches import multiplicity_table

    with common.workers(jobs) as executor, Display("enumerating") as display:
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
