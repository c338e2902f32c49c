"""Decks of CalculiX and Abaqus as problems: their options on every command that takes one, and what is said of them."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from contextvars import ContextVar
from functools import lru_cache, wraps
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from enumsol.cli.progress import is_quiet, say

if TYPE_CHECKING:
    from enumsol.fem.deck_scenes import DeckModel

#: Ending of decks.
DECK = ".inp"
_PANEL = "Decks"
_IGNORE = "Card of an .inp PROBLEM that is left out though it may change the answer; may be repeated."
_STEP = "Step of an .inp PROBLEM whose load acts, reached from no load at once; required if it has several."
_ASSEMBLE = (
    "Code that assembles the stiffness of an .inp PROBLEM: ccx, an installed CalculiX, which knows all its elements."
)
#: Options of every command with a PROBLEM.
OPTIONS = [
    Parameter(
        "ignore",
        Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[
            list[str] | None, typer.Option("--ignore", metavar="CARD", help=_IGNORE, rich_help_panel=_PANEL)
        ],
    ),
    Parameter(
        "deck_step",
        Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[
            int | None, typer.Option("--step", min=1, metavar="N", help=_STEP, rich_help_panel=_PANEL)
        ],
    ),
    Parameter(
        "assemble",
        Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[
            str | None, typer.Option("--assemble", metavar="CODE", help=_ASSEMBLE, rich_help_panel=_PANEL)
        ],
    ),
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
