"""``enumsol roots``: all solutions at one alpha."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NoReturn

from enumsol.cli import common, options, output
from enumsol.cli.decks import deck_named, is_deck, step_chosen
from enumsol.cli.output import plain, taken
from enumsol.cli.progress import search_display
from enumsol.errors import InvalidArgumentError
from enumsol.support.messages import counted, listed, visible

if TYPE_CHECKING:
    from collections.abc import Iterator

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
        if self.start_file is not None and not is_deck(name):
            raise InvalidArgumentError(f"--start is given, but {name} is no deck; expected an .inp PROBLEM")
        output.check_scripts(self.report_file, problem)
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
        if self.stability and self.proof_file is not None and found.proof is not None and len(found):
            # in the place of the proof of the roots, which it holds
            found.stability_proof().save(self.proof_file)
        elif self.stability:
            found.stability()
        return found


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
    from enumsol.io.deck_starts import write_start  # numpy: not for --help

    model = deck_named(name)
    place = Path(path)
    for k, root in enumerate(found):
        write_start(model, root, place.with_stem(f"{place.stem}-{k}"), step=step_chosen())


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
        **taken(found, "arithmetic", "method", "complete"),
        "certified_data": found.certified_data if found.complete else None,
        "completeness": found.closing_line,
        **taken(found, "unique", "by_one_certificate", "stopped", "notes", "index_sum"),
        **({} if bound is None else {"max_rigid_displacement": bound.largest, "bound_needed": bound.needed}),
        "node_ids": found.node_ids,
        "roots": [_root(root) | _stability(found, k) for k, root in enumerate(found)],
        "families": [_family(family) for family in found.families],
        "undecided": [_undecided(item) for item in found.undecided],
        "stats": taken(found.stats, *_STATS),
    }
    return "{\n" + ",\n".join(f"{json.dumps(key)}: {_lines(value)}" for key, value in plain(content).items()) + "\n}"


def _lines(value: object) -> str:
    """JSON with one line per entry of a list of objects."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(json.dumps(item) for item in value) + "\n]"
    return json.dumps(value, default=str)


def _root(root: Root) -> dict[str, Any]:
    if root.lambda_t.ndim == 2:
        more = {"slip_angle": _angles(root.slip_angle)}
        more |= {} if root.rigid_coordinates is not None else taken(root, "dlambda_dalpha")
    elif root.rigid_coordinates is not None:
        more = taken(root, "rigid_coordinates", "rigid_displacement")
    else:
        more = taken(root, "condition", "dlambda_dalpha")
    return {
        **taken(root, "statuses", "active", *_VALUES),
        "enclosure": None if root.enclosure is None else taken(root.enclosure, *_VALUES),
        **taken(root, "index", "regular", "margin"),
        **more,
    }


def _stability(found: RootSet, k: int) -> dict[str, Any]:
    if found.verdicts is None:
        return {}
    return {"stability": taken(found.verdicts[k], "verdict", "growth_rates", "bounds", "reason")}


def _undecided(item: Undecided) -> dict[str, Any]:
    content = taken(item, "statuses", "reason", "hint")
    if item.slip_angle is None:
        return content
    bounds = None if item.bounds is None else taken(item.bounds, *_VALUES)
    return {**content, "leaves": item.leaves, "slip_angle": _angles(item.slip_angle), "bounds": bounds}


def _angles(angles: Floats | None) -> list[list[float] | None]:
    return [] if angles is None else [None if math.isnan(low) else [low, high] for low, high in angles.tolist()]


def _family(family: RootFamily) -> dict[str, Any]:
    parts = [
        taken(part, "statuses", "dimension", "vertices")
        | ({} if part.rigid_coordinates is None else taken(part, "rigid_coordinates"))
        for part in family.polytopes
    ]
    return {**taken(family, "index", "dimension", "vertices_proven"), "polytopes": parts}
