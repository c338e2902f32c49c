"""Decks of CalculiX and Abaqus as scenes: what their steps, contacts and materials say, as options of `mesh_problem`.

Whatever acts on nodes, faces or elements becomes a named part of the mesh and an option of this name, so that decks,
TOML files and calls of `mesh_problem` share one builder. The steps become the loads of a history.
"""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.decks.assembled import SLICES, read_calculix_stiffness
from enumsol.decks.cards import continued
from enumsol.decks.reading import described
from enumsol.decks.states import states_of
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem.bodies import WITH_MODES
from enumsol.fem.deck_joints import DeckJoints
from enumsol.fem.deck_options import acting, axes_of_section, contacts, elastic_sections, shared
from enumsol.fem.deck_parts import DeckParts, refuse_carriers
from enumsol.fem.mesh_files import mesh_of_deck
from enumsol.fem.mesh_problems import mesh_scene, refuse_other
from enumsol.fem.meshes import completing
from enumsol.fem.restrained import Equation
from enumsol.fem.scene_checks import scene_notes
from enumsol.loading.steps import LoadStep
from enumsol.support.arguments import file_path, one_of, positive_integer
from enumsol.support.messages import about, aligned, counted, shortened

if TYPE_CHECKING:
    from enumsol.decks.assembled import AssembledStiffness
    from enumsol.decks.model import Deck
    from enumsol.decks.states import DeckState
    from enumsol.fem.meshes import PartedMesh
    from enumsol.fem.scenes import Scene
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Floats, Integers


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
        joints = DeckJoints(self.deck, self._parts, self.deck.dimension)
        common |= joints.options
        self._options = [{**common, **acting(self.deck, self._parts, state, joints)} for state in states]

    def _states(self) -> list[DeckState]:
        steps = self.deck.steps
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
        return len(self.deck.steps)

    @property
    def times(self) -> list[float]:
        """The times at which its steps end, counted from the beginning of the first."""
        return [*itertools.accumulate(step.period for step in self.deck.steps)]

    @cached_property
    def mesh(self) -> PartedMesh:
        """Mesh with the parts that the deck names, and those on which something acts; adjusted to its contacts."""
        mesh = self._parts.named_in(mesh_of_deck(self.deck))
        if all(pair.adjust is None for pair in self.deck.pairs):
            return mesh
        options = {**self._at_nodes(mesh, self._options[0]), **contacts(self.deck, 0)}
        return self._adjusted(mesh_scene(mesh, **options))

    def _adjusted(self, scene: Scene) -> PartedMesh:
        """Mesh whose contact nodes are moved onto what they face where the deck says so."""
        points, rows = scene.mesh.points.copy(), scene.contacts.rows
        adjusts = {(pair.slave, pair.master): pair.adjust for pair in self.deck.pairs}
        for group, own in scene.contacts.by_group:
            gaps, normals = scene.gaps[own], rows.normals[own]
            adjust = None if group.pair is None else adjusts.get((group.pair.slave, group.pair.master))
            if isinstance(adjust, str):
                chosen = np.searchsorted(self._parts.used, self._parts.in_bodies(self.deck.node_sets[adjust]))
                near = np.isin(rows.nodes[own], chosen) & (gaps != 0)
            elif adjust is not None:
                near = (gaps <= adjust) & (gaps != 0)
            if adjust is not None:
                points[rows.nodes[own][near]] += gaps[near, None] * normals[near]
        return replace(scene.mesh, points=points)

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
            with about(self.deck.path, InvalidArgumentError, made=InvalidProblemError):
                self._scenes[number] = self._made({**self._options[number - 1], **contacts(self.deck, number)})
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
        with about(self.deck.path, InvalidArgumentError, InvalidProblemError, made=InvalidProblemError):
            return scene.problem()

    def steps(self) -> list[LoadStep]:
        """Steps for `histories`, on the problem of any step.

        Raises
        ------
        InvalidProblemError
            A step changes more than loads, displacements of nodes without contact, and friction.
        """
        first = self.problem(1)
        found = []
        for number, step in enumerate(self.deck.steps, 1):
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
    return "\n".join(aligned(table, left=2, free=True))


def _lines(lines: list[int]) -> str:
    some = ", ".join(map(str, lines[:3]))
    return f"line{'s' if len(lines) > 1 else ''} {some}" + (f" and {len(lines) - 3} more" if len(lines) > 3 else "")


# -- deck stiffness ----------------------------------------------------------------------------------------------------
# Stiffness of the elements of a deck as CalculiX itself assembles it, in place of that of the package.
#
# CalculiX gets the elements, their sections and materials, and nothing that holds, joins or loads them: what acts on
# the
# bodies, what they touch and what joins them is the same with both stiffnesses.

#: Codes that can assemble the stiffness of a deck: the commands that run them.
CODES = ("ccx",)


def with_calculix(scene: Scene, deck: Deck, used: Integers) -> Scene:
    """The scene of a deck with the stiffness that CalculiX assembles.

    Elements of 20 and of 15 nodes stay what they are: the nodes with which the mesh completes them move as the shape
    functions of these elements have it. Of their facets the nodes between corners are in contact, for a uniform
    pressure pulls at the corners.

    Parameters
    ----------
    scene : Scene
    deck : Deck
    used : (k,) int array
        Rows of the nodes in the deck that are the first k of the mesh.

    Raises
    ------
    InvalidProblemError
        CalculiX is not there or fails, or leaves displacements out that nothing holds; or temperatures vary, or act on
        incompatible modes.
    """
    warm = scene.options.temperature
    with_modes = any(name in WITH_MODES for name in scene.mesh.types)
    if warm is not None and (with_modes or np.ptp(np.asarray(warm, dtype=np.float64)) > 0):
        raise InvalidProblemError(
            f"{deck.path}: temperatures act{' on elements with incompatible modes' if with_modes else ' that vary'}, "
            "whose forces CalculiX does not write with the stiffness; expected one temperature of all nodes, without "
            "such elements, or the deck without assemble"
        )
    points = deck.points.copy()
    d = scene.dimension
    points[used, :d] = scene.mesh.points[: len(used)]
    found = run_calculix(_deck_of_elements(deck, points), str(deck.path), d == 2)
    completed = _completed(scene, len(used))
    contacts = scene.contacts.without(_on_completed_facets(scene, len(used)))
    joints = replace(scene.joints, equations=[*completed, *scene.joints.equations])
    other = replace(
        scene, joints=joints, contacts=contacts, stiffness=_by_displacements(scene, deck, used, found), notes=[]
    )
    other.notes.extend(scene_notes(other))
    return other


@lru_cache(maxsize=1)  # the steps of a deck share it
def run_calculix(text: str, name: str, plane: bool) -> AssembledStiffness:
    """Stiffness that CalculiX writes for a deck with ``*FREQUENCY, SOLVER=MATRIXSTORAGE``.

    Parameters
    ----------
    text : str
    name : str
        What messages call the deck.
    plane : bool
        As in `read_calculix_stiffness`.

    Raises
    ------
    InvalidProblemError
        It is not there, or fails; the message has the last lines of its output.
    """
    command = shutil.which(CODES[0])
    if command is None:
        raise InvalidProblemError(
            f"{name}: there is no command {CODES[0]}; expected CalculiX to be installed, or the deck without assemble"
        )
    with TemporaryDirectory() as folder:
        Path(folder, "elements.inp").write_text(text)
        # with one thread sums do not depend on chance, and proofs can be checked on another run
        alone = {**os.environ, "OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            [command, "elements"], cwd=folder, env=alone, capture_output=True, text=True, errors="replace", check=False
        )
        if not Path(folder, "elements.dof").is_file() or not Path(folder, "elements.sti").is_file():
            lines = [line.strip() for line in done.stdout.splitlines() if line.strip()]
            errors = [k for k, line in enumerate(lines) if line.startswith("*ERROR")]
            said = lines[errors[0] :][:4] if errors else lines[-4:]
            raise InvalidProblemError(
                f"{name}: CalculiX writes no stiffness ({shortened(' '.join(said)) or 'it says nothing'}); expected "
                "elements and materials that it knows"
            )
        try:
            return read_calculix_stiffness(Path(folder, "elements"), plane=plane)
        except InvalidArgumentError as error:
            raise InvalidProblemError(f"{name}: what CalculiX writes cannot be read ({error})") from error


def _deck_of_elements(deck: Deck, points: Floats) -> str:
    """A deck of the elements of bodies alone, whose nodes and elements have the numbers of their rows from 1."""
    lines = ["*NODE", *(f"{row},{x!r},{y!r},{z!r}" for row, (x, y, z) in enumerate(points.tolist(), 1))]
    for first, block in zip(deck.firsts, deck.blocks, strict=False):
        if deck.is_body(block):
            lines.append(f"*ELEMENT, TYPE={block.type.name}")
            for number, nodes in enumerate((block.nodes + 1).tolist(), first + 1):
                lines += continued([str(number), *map(str, nodes)], 8)
    for k, (section, rows) in enumerate(elastic_sections(deck)):
        material = deck.materials[section.material]
        law = {"ISO": "", "ORTHO": ", TYPE=ORTHO"}.get(material.elastic, ", TYPE=ENGINEERING CONSTANTS")
        lines += [f"*ELSET, ELSET=E{k}", *(f"{row + 1}," for row in rows.tolist())]
        lines += [f"*MATERIAL, NAME=M{k}", f"*ELASTIC{law}", *continued([*map(repr, material.constants.tolist())], 8)]
        lines += ["*DENSITY", "1."]
        turned = ""
        if material.elastic != "ISO" and section.orientation:
            turned = f", ORIENTATION=O{k}"
            lines += [f"*ORIENTATION, NAME=O{k}", ",".join(map(repr, axes_of_section(deck, section)))]
        lines.append(f"*SOLID SECTION, ELSET=E{k}, MATERIAL=M{k}{turned}")
        if deck.dimension == 2:
            lines.append(repr(section.thickness or 1.0))
    return "\n".join([*lines, "*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP", ""])


def _by_displacements(scene: Scene, deck: Deck, used: Integers, found: AssembledStiffness) -> sp.csc_array:
    """The stiffness by displacements of the scene, behind them those that only elements have.

    These are along the thickness of plane stress, and of incompatible modes.
    """
    d, known = scene.dimension, scene.joints
    nodes, directions = np.array(found.names).T - 1
    own = (nodes >= 0) & (nodes < len(deck.points)) & (directions < d)
    rows = np.searchsorted(used, nodes) * d + directions
    inside = np.flatnonzero(~own)
    rows[inside] = known.count + np.arange(len(inside))
    there = np.zeros(known.count, dtype=bool)
    there[rows[own]] = True
    lost = np.flatnonzero(~there[: len(used) * d] & ~scene.held.fixed.ravel()[: len(used) * d])
    if len(lost):
        node = scene.mesh.node_names(lost[:1] // d)[0]
        raise InvalidProblemError(
            f"{deck.path}: CalculiX has no displacement {lost[0] % d + 1} of node {node}; expected all of nodes that "
            "are not held"
        )
    A = found.A.tocoo()
    factor = SLICES if scene.body.axisymmetric else 1.0
    count = known.count + len(inside)
    return sp.csc_array((factor * A.data, (rows[A.coords[0]], rows[A.coords[1]])), shape=(count, count))


def _completed(scene: Scene, count: int) -> list[Equation]:
    """Equations of the nodes from ``count`` on, which complete elements: they move as those around them let them."""
    found: dict[int, Equation] = {}
    for rows, shares in completing(3, scene.mesh.cells, count) if count < len(scene.mesh.points) else ():
        for nodes, k in itertools.product(rows, range(3)):
            own = Equation(3 * nodes + k, np.append(1.0, -shares), "the shape of an element")
            found.setdefault(int(own.dofs[0]), own)
    return list(found.values())


def _on_completed_facets(scene: Scene, count: int) -> Integers:
    """Nodes of contact facets with eight nodes that are not between corners."""
    facets = scene.contacts.facets
    if facets.shape[1] < 9:
        return np.zeros(0, dtype=np.int64)
    own = facets[facets[:, 8] >= count]
    return np.setdiff1d(own[:, [0, 1, 2, 3, 8]], own[:, 4:8])
