"""Decks that lead CalculiX to one of the equilibria: the engineer's own, with steps that hold it there and let it go.

A first step holds the slips of the contact nodes at those of the equilibrium, by equations with a node each, and puts
its friction forces on these nodes: what the bodies do otherwise is theirs alone, and normal forces come about by
contact. A second step lets the slips go and takes the forces away, which the friction of the code's law takes over, by
slips that its stiffness of sticking allows. An equilibrium that runs away can be led to, and leaves when it is let go.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.decks.assembled import SLICES
from enumsol.decks.states import states_of
from enumsol.errors import InvalidArgumentError
from enumsol.fem.cell_blocks import completing
from enumsol.support.arguments import file_path
from enumsol.support.files import write_file

if TYPE_CHECKING:
    import os

    from enumsol.decks.model import Deck
    from enumsol.decks.states import DeckState
    from enumsol.fem.deck_scenes import DeckModel
    from enumsol.fem.scenes import Scene
    from enumsol.io.vtu import SolvedState
    from enumsol.support.array_types import Floats, Mask

#: Tangents that move less of the free components of a node are held by supports, and coefficients that are rounding.
_NONE = 1e-9
#: Terms of an equation on a line.
_TERMS = 4


def write_start(model: DeckModel, root: SolvedState, file: str | os.PathLike[str], *, step: int | None = None) -> None:
    """Write a deck that leads CalculiX to an equilibrium of a step, and lets it go there.

    Its first step ends in the equilibrium, held by its slips, and its second one, at time 2, where the body goes when
    it is let go. An equilibrium that runs away is left then.

    Parameters
    ----------
    model : DeckModel
    root : Root or other state
        A solution of the problem of this step, with u (n,) and lambda_t (p,), in 3D (p, 2).
    file : str or path-like
        Written anew; in the folder of the deck if that includes files.
    step : int or None
        From 1; of a deck with one step that one.

    Raises
    ------
    InvalidArgumentError
        There is no such step, the root is of another problem, the deck has instances, which CalculiX does not know, or
        changes its friction, or the file cannot be written.

    Examples
    --------
    >>> import enumsol
    >>> model = enumsol.read_deck("model.inp")  # doctest: +SKIP
    >>> roots = enumsol.enumerate_roots(model.problem(), 0)  # doctest: +SKIP
    >>> enumsol.write_start(model, roots[0], "start.inp")  # doctest: +SKIP
    """
    place = file_path(file, "file", "a deck")
    scene, deck = model.scene(step), model.deck
    problem = scene.problem()
    if np.shape(root.u) != (problem.n,) or problem.mesh is None:
        raise InvalidArgumentError("root is of another problem; expected one of the step of the deck")
    state = states_of(deck)[(step or 1) - 1]
    moves = problem.mesh.displacements(np.asarray(root.u))
    nodes, equations, slips, forces = _slips(deck, scene, moves, np.asarray(root.lambda_t))
    lines = [*_before_steps(deck, place, step or 1), "*NODE", *(f"{node}, 0., 0., 0." for node in nodes), *equations]
    held = [f"{node}, 1, 1, {_number(value)}" for node, value in zip(nodes, slips, strict=True)]
    pushed = [f"{node}, 1, {_number(value)}" for node, value in zip(nodes, forces, strict=True)]
    supports, loads = _supports(deck, state), _loads(deck, state)
    lines += _step(["*BOUNDARY, OP=NEW", *supports, *held, *loads, *(["*CLOAD", *pushed] if pushed else [])])
    gone = [f"{node}, 1, 0." for node in nodes]
    lines += _step(["*BOUNDARY, OP=NEW", *supports, *(["*CLOAD", *gone] if gone else [])])
    write_file(place, "\n".join([*lines, ""]), "file")


def _number(value: float) -> str:
    """At most twenty characters, as many as CalculiX reads."""
    return f"{value:.12e}"


def _step(acts: list[str]) -> list[str]:
    return ["*STEP, INC=1000", "*STATIC", "0.1, 1.", *acts, "*NODE FILE", "U", "*END STEP"]


def _slips(
    deck: Deck, scene: Scene, moves: Floats, friction: Floats
) -> tuple[list[int], list[str], list[float], list[float]]:
    """Nodes whose displacements are slips of contact nodes, their equations, the slips, and forces on them."""
    nodes: list[int] = []
    equations: list[str] = []
    values: list[float] = []
    mesh, rows, d = scene.mesh, scene.contacts.rows, scene.dimension
    labels = [label if isinstance(label, int) else -1 for label in mesh.node_labels or ()]
    own, moved = _without_completing(scene), np.asarray(rows.means @ moves)
    frames = np.stack(scene.tangents, axis=1)
    along = (-1.0 / SLICES if scene.body.axisymmetric else -1.0) * friction.reshape(len(frames), -1)
    forces: list[float] = []
    first = 1 + int(max(deck.node_labels))
    for k, node in enumerate(rows.nodes):
        free = ~scene.held.fixed[node]
        kept = [j for j in range(d - 1) if np.max(np.abs(frames[k, j][free]), initial=0) > _NONE]
        if not kept or labels[node] < 0:
            continue
        axes, others = frames[k, kept], sp.coo_array(rows.means[[k]] @ own)
        pivots = _pivots(axes, free)
        solved = np.linalg.inv(axes[:, pivots])
        new = [first + len(nodes) + j for j in range(len(kept))]
        for j, pivot in enumerate(pivots):
            terms = {(labels[node], pivot): 1.0}
            for (other, weight), c in itertools.product(zip(others.coords[1], others.data, strict=True), range(d)):
                value = float(solved[j] @ axes[:, c]) * weight
                if abs(value) > _NONE and not (other == node and c in pivots):
                    terms[labels[other], c] = value
            terms |= {(new[i], 0): -float(solved[j, i]) for i in range(len(kept)) if abs(solved[j, i]) > _NONE}
            equations += _equation(terms)
        nodes += new
        values += (axes @ moved[k]).tolist()
        forces += along[k, kept].tolist()
    return nodes, equations, values, forces


def _pivots(axes: Floats, free: Mask) -> list[int]:
    """Components in which a node that is not held there can follow along axes."""
    found: list[int] = []
    left = np.where(free, axes, 0.0)
    for row in range(len(axes)):
        pivot = int(np.argmax(np.abs(left[row])))
        found.append(pivot)
        left = left - np.outer(left[:, pivot] / left[row, pivot], left[row])
    return found


def _without_completing(scene: Scene) -> sp.csr_array:
    """Displacements of all nodes by those of the deck: nodes that complete elements follow these."""
    labels = scene.mesh.node_labels or ()
    count = next((k for k, label in enumerate(labels) if "/" in str(label)), len(labels))
    own = sp.lil_array(sp.eye_array(len(labels)))
    for rows, shares in completing(3, scene.mesh.cells, count) if count < len(labels) else ():
        for nodes in rows:
            own[[nodes[0]]] = 0.0
            own[nodes[0], nodes[1:]] = shares
    return sp.csr_array(own)


def _equation(terms: dict[tuple[int, int], float]) -> list[str]:
    said = [f"{node}, {component + 1}, {_number(value)}" for (node, component), value in terms.items()]
    rows = [", ".join(said[k : k + _TERMS]) for k in range(0, len(said), _TERMS)]
    return ["*EQUATION", str(len(said)), *(f"{row}," if row is not rows[-1] else row for row in rows)]


def _before_steps(deck: Deck, place: Path, step: int) -> list[str]:
    """Lines of the deck before its first step."""
    if len(deck.instances) > 1:
        raise InvalidArgumentError(f"{deck.path} has instances, which CalculiX does not know; expected a deck without")
    changed = next((own for own in deck.analysis.steps[:step] if own.friction), None)
    if changed is not None:
        raise InvalidArgumentError(f"{changed.place}: the step changes friction; expected one coefficient in all steps")
    text = deck.path.read_text(encoding="latin-1").splitlines()
    ends = [k for k, line in enumerate(text) if line.upper().replace(" ", "").split(",")[0] == "*STEP"]
    includes = any(line.upper().lstrip().startswith("*INCLUDE") for line in text)
    if not ends or (includes and place.resolve().parent != deck.path.resolve().parent):
        raise InvalidArgumentError(
            f"{deck.path} includes {'its steps' if not ends else 'files, which are found from its folder only'}; "
            f"expected {'steps in the deck itself' if not ends else 'a start in this folder'}"
        )
    return text[: ends[0]]


def _supports(deck: Deck, state: DeckState) -> list[str]:
    return [
        f"{deck.node_labels[int(node)]}, {component}, {component}, {_number(value)}"
        for (node, component), value in state.of("BOUNDARY").items()
    ]


def _loads(deck: Deck, state: DeckState) -> list[str]:
    """Cards of the loads and temperatures at the end of the step."""
    nodes, elements = deck.node_labels, deck.element_labels
    forces, pressures, gravity, warm = map(state.of, ("CLOAD", "DLOAD", "GRAV", "TEMPERATURE"))
    cards = {
        "*CLOAD": [f"{nodes[int(node)]}, {component}, {_number(own)}" for (node, component), own in forces.items()],
        "*DLOAD": [
            *(f"{elements[int(row)]}, {label}, {_number(own)}" for (row, label), own in pressures.items()),
            *(f"{of}, GRAV, {_number(own)}, {str(along).replace(' ', ', ')}" for (of, along), own in gravity.items()),
        ],
        "*TEMPERATURE": [f"{nodes[int(node)]}, {_number(own)}" for (node, _), own in warm.items()],
    }
    return [line for card, data in cards.items() if data for line in (card, *data)]
