"""Decks of CalculiX and Abaqus as scenes: what their steps, contacts and materials say, as options of `mesh_problem`.

Whatever acts on nodes, faces or elements becomes a named part of the mesh and an option of this name, so that decks,
TOML files and calls of `mesh_problem` share one builder. The steps become the loads of a history.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.decks.reading import described
from enumsol.decks.states import states_of
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem.deck_joints import DeckJoints
from enumsol.fem.deck_meshes import refuse_carriers
from enumsol.fem.deck_options import acting, contacts, is_plane, shared
from enumsol.fem.deck_parts import DeckParts
from enumsol.fem.deck_stiffness import CODES, with_calculix
from enumsol.fem.mesh_problems import mesh_scene
from enumsol.fem.scene_steps import refuse_other
from enumsol.loading.steps import LoadStep
from enumsol.support.arguments import file_path, one_of, positive_integer
from enumsol.support.messages import counted

if TYPE_CHECKING:
    import os

    from enumsol.decks.model import Deck
    from enumsol.decks.states import DeckState
    from enumsol.fem.meshes import PartedMesh
    from enumsol.fem.scenes import Scene
    from enumsol.model.problem3d import AnyProblem


def read_deck(path: str | os.PathLike[str], *, ignore: Collection[str] = (), assemble: str | None = None) -> DeckModel:
    """Model that a deck of CalculiX or Abaqus describes: a contact problem for every step, and a history of them.

    ``print(read_deck("model.inp"))`` says what became of every card. Nothing of a deck is dropped without a word: a
    card that is not used is named with its line, and one that would change the answer is refused, unless ``ignore``
    names it.

    Parameters
    ----------
    path : str or path-like
        The deck (.inp). Files that it includes have to be in its folder or below.
    ignore : collection of str
        Cards, and types of elements, that are left out though they may change the answer, such as ``["PLASTIC"]``;
        "NLGEOM" takes the displacements of all steps to be small.
    assemble : "ccx" or None
        Take the stiffness of the elements from an installed CalculiX, which knows types that are otherwise taken as
        others (C3D8R, C3D20R): it assembles the elements alone, without contact, supports, joints and loads.

    Returns
    -------
    DeckModel

    Raises
    ------
    InvalidProblemError
        The deck cannot be read, or describes what cannot be solved here. The message has the file and the line.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.read_deck("model.inp")
    Traceback (most recent call last):
        ...
    enumsol.errors.InvalidProblemError: model.inp: there is no such file; expected a deck of CalculiX or Abaqus

    A deck that is read is shown with `DeckModel`.
    """
    place = file_path(path, "path")
    if assemble is not None:
        one_of(assemble, "assemble", CODES)
    try:
        return DeckModel(described(place, ignore=ignore), tuple(ignore), assemble)
    except InvalidArgumentError as error:
        raise InvalidProblemError(str(error)) from error


@dataclass(eq=False)
class DeckModel:
    """Model that a deck describes, see `read_deck`; ``print(model)`` says what became of its cards.

    Attributes
    ----------
    deck : Deck
        The plain description.
    ignored : tuple of str
        What was left out though it may change the answer.
    assemble : str or None
        The code that assembles the stiffness.

    Examples
    --------
    >>> import enumsol, pathlib
    >>> _ = pathlib.Path("press.inp").write_text('''*NODE
    ... 1, 0, 0
    ... 2, 1, 0
    ... 3, 1, 1
    ... 4, 0, 1
    ... 5, 0, 1
    ... 6, 1, 1
    ... 7, 1, 2
    ... 8, 0, 2
    ... *ELEMENT, TYPE=CPE4, ELSET=BOTH
    ... 1, 1, 2, 3, 4
    ... 2, 5, 6, 7, 8
    ... *SURFACE, NAME=UNDER
    ... 2, S1
    ... *SURFACE, NAME=ON
    ... 1, S3
    ... *MATERIAL, NAME=RUBBER
    ... *ELASTIC
    ... 10, 0.3
    ... *SOLID SECTION, ELSET=BOTH, MATERIAL=RUBBER
    ... *SURFACE INTERACTION, NAME=DRY
    ... *FRICTION
    ... 0.3
    ... *CONTACT PAIR, INTERACTION=DRY
    ... UNDER, ON
    ... *BOUNDARY
    ... 1, 1, 2
    ... 2, 1, 2
    ... *STEP
    ... *STATIC
    ... *BOUNDARY
    ... 7, 1, 2, -0.01
    ... 8, 1, 2, -0.01
    ... *END STEP
    ... ''')
    >>> model = enumsol.read_deck("press.inp")
    >>> print(model)
    press.inp line 1          *NODE                 8 nodes
    ...
    press.inp line 22         *FRICTION             friction 0.3
    ...
    >>> roots = enumsol.enumerate_roots(model.problem(), 0)
    >>> [str(status) for status in roots[0].statuses], roots.complete
    (['stick', 'stick'], True)
    """

    deck: Deck
    ignored: tuple[str, ...] = ()
    assemble: str | None = None
    _parts: DeckParts = field(init=False, repr=False)
    _options: list[dict[str, Any]] = field(init=False, repr=False)
    _scenes: dict[int, Scene] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        states = self._states()
        self._parts = DeckParts(self.deck)
        common = shared(self.deck, self._parts)
        joints = DeckJoints(self.deck, self._parts, 2 if is_plane(self.deck) else 3)
        common |= joints.options
        self._options = [{**common, **acting(self.deck, self._parts, state, joints)} for state in states]

    def _states(self) -> list[DeckState]:
        steps = self.deck.analysis.steps
        if not steps:
            raise InvalidArgumentError(
                f"{self.deck.path} has no *STEP; expected a deck with a step, or a bare mesh for enumsol solve, or "
                "mesh_problem, with what acts on it as options"
            )
        if not steps[-1].ended:
            raise InvalidArgumentError(f"{steps[-1].place}: *STEP has no *END STEP; expected it")
        refuse_carriers(self.deck)
        return states_of(self.deck)

    @property
    def step_count(self) -> int:
        """Number of its steps."""
        return len(self.deck.analysis.steps)

    @property
    def times(self) -> list[float]:
        """The times at which its steps end, counted from the beginning of the first."""
        return [*itertools.accumulate(step.period for step in self.deck.analysis.steps)]

    @cached_property
    def mesh(self) -> PartedMesh:
        """Mesh with the parts that the deck names, and those on which something acts; adjusted to its contacts."""
        mesh = self._parts.mesh()
        if all(pair.adjust is None for pair in self.deck.analysis.pairs):
            return mesh
        options = {**self._at_nodes(mesh, self._options[0]), **contacts(self.deck, 0)}
        return self._parts.adjusted(mesh_scene(mesh, **options))

    def scene(self, step: int | None = None) -> Scene:
        """Scene at the end of a step (from 1), reached from no load at once; of a deck with one step, that one.

        Raises
        ------
        InvalidArgumentError
            There are several steps, and none is named, or no such step.
        InvalidProblemError
            The deck describes no scene.
        """
        number = self._number(step)
        if number not in self._scenes:
            try:
                self._scenes[number] = self._made({**self._options[number - 1], **contacts(self.deck, number)})
            except InvalidArgumentError as error:
                raise InvalidProblemError(f"{self.deck.path}: {error}") from error
        return self._scenes[number]

    def _made(self, options: dict[str, Any]) -> Scene:
        options = self._at_nodes(self.mesh, options)
        scene = mesh_scene(self.mesh, **options)
        if any(piece.free_motions(scene.mesh.points, scene.hold) for piece in scene.moving):
            scene = mesh_scene(self.mesh, **options, max_rigid_displacement="auto")
        return scene if self.assemble is None else with_calculix(scene, self.deck, self._parts.used)

    def _at_nodes(self, mesh: PartedMesh, options: dict[str, Any]) -> dict[str, Any]:
        """Options with the temperatures of the nodes of the mesh, for those of the deck."""
        if "temperature" not in options:
            return options
        return {**options, "temperature": self._parts.at_nodes(mesh, np.array(options["temperature"]))}

    def problem(self, step: int | None = None) -> AnyProblem:
        """Contact problem at the end of a step (from 1), reached from no load at once.

        Raises
        ------
        InvalidArgumentError, InvalidProblemError
            As `scene`, or the data of the problem are not admissible.
        """
        scene = self.scene(step)
        try:
            return scene.problem()
        except (InvalidArgumentError, InvalidProblemError) as error:
            raise InvalidProblemError(f"{self.deck.path}: {error}") from error

    def steps(self) -> list[LoadStep]:
        """Steps for `histories`, on the problem of any step.

        Raises
        ------
        InvalidProblemError
            A step changes more than loads, displacements of nodes without contact, and friction.
        """
        first = self.problem(1)
        found = []
        for number, step in enumerate(self.deck.analysis.steps, 1):
            other = self.problem(number)
            alone = f" (enumsol roots with --step {number} takes the step alone)"
            refuse_other(first, other, f"{step.place}: step {number}", alone)
            found.append(LoadStep(load=other.f, friction=other.friction))
        return found

    def _number(self, step: int | None) -> int:
        count = self.step_count
        if step is None:
            if count > 1:
                raise InvalidArgumentError(
                    f"{self.deck.path} has {count} steps; expected a history of them (enumsol history), or step, the "
                    "number of the one whose load acts alone"
                )
            return 1
        number = positive_integer(step, "step")
        if number > count:
            raise InvalidArgumentError(f"step is {number}; expected one of 1 to {count}, those of {self.deck.path}")
        return number

    def __str__(self) -> str:
        return account_of(self.deck)

    def __repr__(self) -> str:
        return f"DeckModel of {self.deck.path} with {counted(self.step_count, 'step')}"


def account_of(deck: Deck) -> str:
    """Table of what became of the cards of a deck: of cards of one kind that became the same, with all lines."""
    rows: dict[tuple[str, str, str], list[int]] = {}
    for entry in deck.account:
        rows.setdefault((entry.place.file, entry.card, entry.became), []).append(entry.place.line)
    table = [(f"{file} {_lines(lines)}", f"*{card}", became) for (file, card, became), lines in rows.items()]
    widths = [max((len(row[k]) for row in table), default=0) for k in (0, 1)]
    return "\n".join(f"{place:{widths[0]}}  {card:{widths[1]}}  {became}" for place, card, became in table)


def _lines(lines: list[int]) -> str:
    some = ", ".join(map(str, lines[:3]))
    return f"line{'s' if len(lines) > 1 else ''} {some}" + (f" and {len(lines) - 3} more" if len(lines) > 3 else "")
