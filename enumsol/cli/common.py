"""Parts of all commands: the problem, deck and alpha they are given, exit statuses, worker processes."""

from __future__ import annotations

import enum
import os
import shlex
import sys
from collections.abc import Callable
from contextvars import ContextVar
from functools import lru_cache, wraps
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, NoReturn, TypeVar

import typer

from enumsol.cli.progress import Display, is_quiet, say
from enumsol.errors import EnumsolError, Interrupted, InvalidArgumentError, OutOfMemoryError, OutputError
from enumsol.support.messages import visible

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from contextlib import AbstractContextManager

    from enumsol.fem import Scene
    from enumsol.fem.deck_scenes import DeckModel
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha

T = TypeVar("T")

#: Beginnings of the names of problems in the gallery and in the collection.
GALLERY, COLLECTION = "gallery:", "collection:"
#: Ending of files that describe a problem by a mesh and what acts on its parts.
TOML = ".toml"
#: Ending of decks.
DECK = ".inp"
#: Usual endings of files that meshio reads and that are no problems.
MESHES = (".msh", ".vtu", ".vtk", DECK, ".xdmf", ".med", ".bdf", ".mesh", ".e", ".exo")


class ExitStatus(enum.IntEnum):
    """Exit statuses of the command line; 71 and 74 are those of sysexits.h."""

    DONE = 0
    BAD_INPUT = 2
    INCOMPLETE = 3
    NOT_COMPARED = 4
    OUT_OF_MEMORY = 71
    OUTPUT_FAILED = 74
    INTERRUPTED = 130
    BROKEN_PIPE = 141


def described(problem: str) -> dict[str, Any]:
    """Tables of a TOML file, for its steps, units and title; empty if unreadable, which is reported elsewhere."""
    if not problem.endswith(TOML):
        return {}
    from enumsol.support.files import unreadable  # numpy: not for --help
    from enumsol.support.saved import LARGEST_TOML, toml_from

    if unreadable(Path(problem)) is not None or Path(problem).stat().st_size > LARGEST_TOML:
        return {}
    try:
        return toml_from(Path(problem).read_bytes())
    except (OSError, ValueError):
        return {}


def units_of(problem: str, text: str | None) -> tuple[str, str] | None:
    """Units of forces and lengths: those of --units, or those that a TOML file names.

    Raises
    ------
    InvalidArgumentError
        They are not two texts.
    """
    from enumsol.support.plotting import checked_units  # numpy: not for --help

    if text is not None:
        return checked_units(text, "--units")
    return checked_units(described(problem).get("units"))


def in_units(text: str, units: tuple[str, str] | None) -> str:
    """Text about forces and displacements, below a line that names their units if they are known."""
    return text if units is None else f"forces in {units[0]}, displacements in {units[1]}\n\n{text}"


def title_of(problem: str, text: str | None = None) -> str:
    """The heading of a page or a figure: what is asked for, the title in a TOML file, or the name of the problem."""
    from enumsol.support.arguments import text_of  # numpy: not for --help

    found = described(problem).get("title", problem) if text is None else text
    return text_of(found, "title")


def scene_of(name: str, step: int | None = None) -> Scene | None:
    """Scene of a TOML file or a deck: mesh, material, supports and loads; None for others, which are matrices.

    Raises
    ------
    InvalidProblemError, InvalidArgumentError
        It cannot be read.
    """
    if name.startswith((GALLERY, COLLECTION)) or Path(name).is_dir():
        return None
    if is_deck(name):
        return deck_named(name).scene(step or step_chosen())
    if not name.endswith(TOML):
        return None
    from enumsol.fem import read_mesh_scene  # numpy and scikit-fem: not for --help

    return read_mesh_scene(name)


def load_problem(name: str, step: int | None = None) -> AnyProblem:
    """The problem in a file or made of a mesh, or that of ``gallery:NAME`` or ``collection:NAME``; its notes are said.

    Of a deck it is that of a step, by default of the one that --step names.

    Raises
    ------
    InvalidProblemError, InvalidArgumentError
        It cannot be read, or there is none of that name; the message gives names that are close.
    """
    with Display("reading the problem"):
        problem = _any_problem(name, step)
    for text in problem.notes:
        note(text)
    return problem


def _any_problem(name: str, step: int | None) -> AnyProblem:
    if name.startswith(COLLECTION):
        from enumsol import collection  # numpy and scipy: not for --help

        return collection.get(name.removeprefix(COLLECTION)).problem()
    if name.startswith(GALLERY):
        from enumsol import gallery  # as above

        return gallery.get(name.removeprefix(GALLERY)).build()
    refuse_misspelt(name)
    if name.endswith(TOML) and not Path(name).is_dir():
        from enumsol.fem import read_mesh_problem  # as above

        return read_mesh_problem(name)
    if is_deck(name):
        return deck_named(name).problem(step or step_chosen())
    if Path(name).suffix.lower() in MESHES and Path(name).exists() and not Path(name).is_dir():
        raise InvalidArgumentError(
            f"{name} is a mesh; expected a problem, which enumsol solve {name} --output FILE.npz or a {TOML} file makes"
        )
    from enumsol.io import read_problem  # as above

    return read_problem(name)


def refuse_misspelt(name: str, meshes: bool = False) -> None:
    """Refuse the name of a problem, or of a mesh, that does not exist if there are ones that are close.

    Raises
    ------
    InvalidArgumentError
        It names them: files in the same directory and, of a name without the ending of a file, problems of the gallery.
    """
    place = Path(name)
    if not name or os.path.lexists(place):
        return
    import difflib  # for nothing else

    from enumsol import gallery  # as above
    from enumsol.io import SUFFIXES

    endings = MESHES if meshes else (*SUFFIXES, DECK)
    try:
        beside = [
            file.name
            for file in place.parent.iterdir()
            if file.suffix in (*endings, TOML) or (file.is_dir() and not meshes)
        ]
    except OSError:
        beside = []  # no such directory either
    close = [str(place.with_name(file)) for file in difflib.get_close_matches(place.name, beside, cutoff=0.75)]
    if not meshes and place.suffix not in (*SUFFIXES, *MESHES, TOML):
        close += [GALLERY + entry for entry in gallery.close_names(name.rpartition(":")[2])]
    if close:
        what = "file" if meshes else "file or directory"
        raise InvalidArgumentError(f"{name}: there is no such {what}; did you mean {', '.join(close)}?")


def parse_alpha(text: str, option: str = "--alpha") -> Alpha:
    """The alpha that an option names, read as Python's functions read it.

    Raises
    ------
    InvalidArgumentError
        It is no number, or not finite.
    """
    from enumsol.support.arguments import alpha_value  # numpy: not for --help

    return alpha_value(text, option)


def alpha_of(text: str | None, name: str, problem: AnyProblem) -> Alpha:
    """The alpha that was given, or any where the problem does not depend on it.

    Raises
    ------
    InvalidArgumentError
        There is none, and the problem depends on it.
    """
    if text is not None:
        return parse_alpha(text)
    if problem.depends_on_alpha:
        raise InvalidArgumentError(
            f"--alpha is missing, and friction or load of {name} depends on it; expected a number"
        )
    return 0.0


def parse_interval(first: str, last: str) -> tuple[Alpha, Alpha]:
    """Both ends of an interval of alpha, those of --from and --to.

    Raises
    ------
    InvalidArgumentError
        One is not a number, or the first is not below the last.
    """
    low, high = parse_alpha(first, "--from"), parse_alpha(last, "--to")
    if not low < high:
        raise InvalidArgumentError(f"--from is {first} and --to is {last}; expected the first below the second")
    return low, high


def node_row(problem: AnyProblem, label: str | None) -> int:
    """Row number of a contact node that is named by its label; the first one for None.

    Raises
    ------
    InvalidArgumentError
        There is no such node.
    """
    if label is None:
        return 0
    labels = [str(node) for node in problem.node_ids]
    if label not in labels:
        some = ", ".join(map(visible, labels[:8])) + (", ..." if len(labels) > 8 else "")
        raise InvalidArgumentError(f"there is no contact node {label}; expected one of {some}")
    return labels.index(label)


def note(text: str) -> None:
    """Say something on stderr that is no error."""
    if not is_quiet():
        say(f"enumsol: note: {text}", err=True)


def so_far(search: Callable[[], T]) -> tuple[T | Any, EnumsolError | None]:
    """Result of a search, even if it ended early, and the error that ended it, if any."""
    try:
        return search(), None
    except (Interrupted, OutOfMemoryError, OutputError) as error:
        if error.partial is None:
            raise
        return error.partial, error


def check_motions(problem: AnyProblem) -> None:
    """Refuse verdicts on solutions of a problem before these are searched.

    Raises
    ------
    InvalidArgumentError
        It has no mass, or its friction depends on the solution.
    """
    from enumsol.roots.stability import Stabilities  # numpy and scipy: not for --help

    Stabilities(problem)


def judged(found: T, judge: Callable[[], object]) -> T:
    """The result of a search, after its verdicts are found as well.

    Raises
    ------
    Interrupted, OutputError
        By Ctrl-C, or where a proof of the verdicts cannot be written; ``partial`` is what the search found.
    """
    try:
        with Display("stability"):
            judge()
    except KeyboardInterrupt:
        raise Interrupted("the search for verdicts was interrupted", found) from None
    except OutputError as error:
        raise OutputError(str(error), found) from error
    return found


def finish(ended: EnumsolError | None, status: ExitStatus) -> NoReturn:
    """End the command: by what ended its search early, or with a status."""
    if isinstance(ended, Interrupted):
        raise typer.Exit(ExitStatus.INTERRUPTED)
    if ended is not None:
        raise ended
    raise typer.Exit(status)


def processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def capped(jobs: int) -> int:
    """Number of processes, at most as many as there are processors: more of them only take memory."""
    most = processors()
    if sys.platform == "win32":
        most = min(most, 61)  # as many as Windows lets one wait for
    if jobs > most:
        note(f"--jobs is {jobs}; {most} {'are' if most > 1 else 'is'} used, as many as this machine can keep busy")
    return min(jobs, most)


def workers(jobs: int) -> AbstractContextManager[Executor | None]:
    """An executor of that many processes at most, for --jobs; None for one."""
    from enumsol.support.workers import workers_of  # not for --help

    return workers_of(None, jobs if jobs == 1 else capped(jobs), "--jobs")


# -- decks: their options on every command that takes one --------------------------------------------------------------

_IGNORE = "Card of an .inp PROBLEM that is left out though it may change the answer; may be repeated."
_STEP = "Step of an .inp PROBLEM whose load acts, reached from no load at once; required if it has several."
_ASSEMBLE = (
    "Code that assembles the stiffness of an .inp PROBLEM: ccx, an installed CalculiX, which knows all its elements."
)


def _option(name: str, flag: str, kind: Any, **how: Any) -> Parameter:
    """An option of decks, which is None where it is not given."""
    said = Annotated[kind | None, typer.Option(flag, rich_help_panel="Decks", **how)]
    return Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=said)


#: Options of every command with a PROBLEM.
OPTIONS = [
    _option("ignore", "--ignore", list[str], metavar="CARD", help=_IGNORE),
    _option("deck_step", "--step", int, min=1, metavar="N", help=_STEP),
    _option("assemble", "--assemble", str, metavar="CODE", help=_ASSEMBLE),
]


class _Chosen(NamedTuple):
    """Options of a command that are about decks."""

    ignore: tuple[str, ...] = ()
    step: int | None = None
    assemble: str | None = None


_CHOSEN: ContextVar[_Chosen] = ContextVar("enumsol_deck", default=_Chosen())  # noqa: B039 (it is immutable)


def with_decks(
    command: Callable[..., None], parameters: list[Parameter]
) -> tuple[Callable[..., None], list[Parameter]]:
    """A command with a PROBLEM, and its parameters, with the options of decks; others as they are."""
    if not {"problem", "mesh"} & {parameter.name for parameter in parameters}:
        return command, parameters

    @wraps(command)
    def chosen(
        *, ignore: list[str] | None = None, deck_step: int | None = None, assemble: str | None = None, **given: Any
    ) -> None:
        token = _CHOSEN.set(_Chosen(tuple(ignore or ()), deck_step, assemble))
        try:
            command(**given)
        finally:
            _CHOSEN.reset(token)

    return chosen, [*parameters, *OPTIONS]


def is_deck(name: str) -> bool:
    """True if a PROBLEM is a deck."""
    return name.lower().endswith(DECK) and not Path(name).is_dir()


def deck_named(name: str) -> DeckModel:
    """The model of a deck, read once; what its cards became is said before all else.

    Raises
    ------
    InvalidArgumentError
        It cannot be read, or has what cannot be used and no option --ignore names.
    """
    place = Path(name)
    return _read(name, place.stat().st_mtime_ns if place.is_file() else 0, _CHOSEN.get())


def ignored() -> tuple[str, ...]:
    """Names that --ignore gives."""
    return _CHOSEN.get().ignore


def step_chosen() -> int | None:
    """The step that --step names."""
    return _CHOSEN.get().step


def options_said() -> str:
    """The options of decks that were given, as they stand on a command line."""
    chosen = _CHOSEN.get()
    cards = "".join(f" --ignore {shlex.quote(card)}" for card in chosen.ignore)
    cards += "" if chosen.step is None else f" --step {chosen.step}"
    return cards + ("" if chosen.assemble is None else f" --assemble {shlex.quote(chosen.assemble)}")


@lru_cache(maxsize=1)
def _read(path: str, changed: int, chosen: _Chosen) -> DeckModel:
    del changed  # a file that is written anew is read anew
    from enumsol.fem.deck_scenes import read_deck  # numpy and scikit-fem: not for --help

    model = read_deck(path, ignore=chosen.ignore, assemble=chosen.assemble)
    if not is_quiet():
        say(str(model), err=True)
    return model
