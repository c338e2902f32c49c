"""Stiffness of the elements of a deck as CalculiX itself assembles it, in place of that of the package.

CalculiX gets the elements, their sections and materials, and nothing that holds, joins or loads them: what acts on the
bodies, what they touch and what joins them is the same with both stiffnesses.
"""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.decks.assembled import SLICES, read_calculix_stiffness
from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem.cell_blocks import completing
from enumsol.fem.constraints import Equation
from enumsol.fem.deck_options import axes_of_section, elastic_sections
from enumsol.fem.materials import WITH_MODES
from enumsol.fem.scene_checks import scene_notes
from enumsol.support.messages import shortened

if TYPE_CHECKING:
    from enumsol.decks.assembled import AssembledStiffness
    from enumsol.decks.model import Deck
    from enumsol.fem.scenes import Scene
    from enumsol.support.array_types import Floats, Integers

#: Codes that can assemble the stiffness of a deck: the commands that run them.
CODES = ("ccx",)
#: Numbers on a line of a deck at most.
_ON_A_LINE = 8
#: Lines of the output of a run that failed that are told.
_LAST = 4


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
            said = lines[errors[0] : errors[0] + _LAST] if errors else lines[-_LAST:]
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
    first = 1
    for block in deck.blocks:
        if deck.is_body(block):
            lines.append(f"*ELEMENT, TYPE={block.type.name}")
            for number, nodes in enumerate((block.nodes + 1).tolist(), first):
                lines += _numbered([number, *nodes])
        first += len(block.labels)
    for k, (section, rows) in enumerate(elastic_sections(deck)):
        material = deck.materials[section.material]
        law = {"ISO": "", "ORTHO": ", TYPE=ORTHO"}.get(material.elastic, ", TYPE=ENGINEERING CONSTANTS")
        lines += [f"*ELSET, ELSET=E{k}", *(f"{row + 1}," for row in rows.tolist())]
        lines += [f"*MATERIAL, NAME=M{k}", f"*ELASTIC{law}", *_numbered(material.constants.tolist())]
        lines += ["*DENSITY", "1."]
        turned = ""
        if material.elastic != "ISO" and section.orientation:
            turned = f", ORIENTATION=O{k}"
            lines += [f"*ORIENTATION, NAME=O{k}", ",".join(map(repr, axes_of_section(deck, section)))]
        lines.append(f"*SOLID SECTION, ELSET=E{k}, MATERIAL=M{k}{turned}")
        if deck.dimension == 2:
            lines.append(repr(section.thickness or 1.0))
    return "\n".join([*lines, "*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP", ""])


def _numbered(values: list[float]) -> list[str]:
    """Lines of a card with these values, all but the last continued."""
    rows = [values[k : k + _ON_A_LINE] for k in range(0, len(values), _ON_A_LINE)]
    return [",".join(map(repr, row)) + ("," if row is not rows[-1] else "") for row in rows]


def _by_displacements(scene: Scene, deck: Deck, used: Integers, found: AssembledStiffness) -> sp.csc_array:
    """The stiffness by displacements of the scene, behind them those that only elements have.

    These are along the thickness of plane stress, and of incompatible modes.
    """
    d, known = scene.dimension, scene.joints.references
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
