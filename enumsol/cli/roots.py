"""``enumsol roots``: all solutions at one alpha."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NoReturn

from enumsol.cli import common, options, output, root_report
from enumsol.cli.progress import SearchDisplay
from enumsol.errors import InvalidArgumentError
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.fem import Scene
    from enumsol.model.problem3d import AnyProblem
    from enumsol.roots.root_set import RootSet
    from enumsol.support.array_types import Alpha


@dataclass(frozen=True)
class Search:
    """A search at one alpha as its options describe it; every field is an option, in the order of the help.

    Parameters
    ----------
    arithmetic : verified: rigorous error bounds, with proof. fast: floats and a tolerance, never proven. exact:
        rationals throughout, with proof, for small problems.
    method : tree: a tree search. exhaustive: all 4^p selections, fast or exact, for small p.
    unique : Only report whether there is one solution; stop at a second one.
    stop_after : Stop at N roots; 2 decides whether the solution is unique.
    jobs : Number of processes that search (tree).
    proof_file : Write the proof (verified).
    resume : Resume from the proof in --proof FILE, if there is one.
    csv_file : Write a table with one row per root and contact node; - is stdout.
    report_file : Write an HTML page about the roots, with their deformed bodies.
    """

    arithmetic: options.Arithmetic = "verified"
    method: Literal["tree", "exhaustive"] = "tree"
    unique: bool = False
    stop_after: options.Count | None = None
    max_nodes: options.Count | None = None
    time_limit: options.Seconds | None = None
    jobs: options.Count = 1
    proof_file: options.OutputFile | None = None
    resume: options.OutputFlag = False
    json_file: options.OutputFile | None = None
    csv_file: options.OutputFile | None = None
    vtu_file: options.OutputFile | None = None
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
        output.check_scripts(self.report_file, problem)
        units = common.units_of(name, self.units)
        found, ended = common.so_far(lambda: self._found(problem, alpha))
        output.deliver(
            (self.vtu_file, lambda path: _write_vtu(problem, found, path)),
            (self.report_file, lambda path: self._write_page(found, path, name, source, scene)),
            json_file=self.json_file,
            csv_file=self.csv_file,
            text=lambda: (
                root_report.uniqueness(found)
                if self.unique
                else common.in_units(root_report.roots_as_text(found), units)
            ),
            content=lambda: root_report.roots_as_json(found, name),
            frame=found.to_frame,
        )
        partly = [name for name, path in (("the CSV", self.csv_file), ("--vtu", self.vtu_file)) if path is not None]
        if partly and found.families:
            families = counted(len(found.families), "family", "families")
            holds = "hold" if len(partly) > 1 else "holds"
            common.note(f"{' and '.join(partly)} {holds} the isolated roots only, --json the {families} too")
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
        with common.workers(self.jobs) as executor, SearchDisplay() as display:
            return enumerate_roots(problem, alpha, executor=executor, progress=display, **asked)


@options.with_options(*options.options_of(Search), after=2)
def roots(problem: options.Problem, alpha: options.Number, *, quiet: options.Quiet = False, **chosen: Any) -> None:
    """Find all solutions of PROBLEM at one ALPHA.

    Prints a table of the roots and whether it is complete; lambda_n and lambda_t are nodal forces, not pressures. The
    index of a root is the sign of a determinant; the indices of all solutions add up to +1 if the body is held.

    Exit status: 0 if the result is complete (in fast arithmetic, which proves nothing: if the search ran to its end
    with nothing undecided), with --unique if yes or no is proven; 3 if something remained undecided, a limit cut the
    search short, or the indices do not add up to +1; 2 on bad input; 130 on Ctrl-C, after printing what was found so
    far; 74 if a result could not be written; 141 if the program that read it has ended.

    Parameters
    ----------
    alpha : Parameter value: a decimal number, read as float64, or a fraction such as 8/3, taken exactly.
    """
    search = Search(**chosen)
    search.check()
    value = common.parse_alpha(alpha)
    search.answer(problem, common.load_problem(problem), value, problem)


def _write_vtu(problem: AnyProblem, found: RootSet, path: str) -> None:
    if not len(found):
        common.note("--vtu: no isolated root was found, so no file is written for ParaView")
        return
    from enumsol.io.vtu import write_vtu  # numpy: not for --help

    write_vtu(problem, found, path)


def _status(found: RootSet) -> common.ExitStatus:
    if found.stopped is not None or found.undecided or not found.adds_up:
        return common.ExitStatus.INCOMPLETE
    return common.ExitStatus.DONE
