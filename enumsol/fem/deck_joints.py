"""Ties, couplings, rigid bodies, equations, springs and axes of nodes of a deck as options of `mesh_problem`.

Nodes of no body become reference points where something depends on them: those of couplings and rigid bodies, which
turn, and those in equations, which do not.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.decks.cards import is_number
from enumsol.decks.faces import face_nodes
from enumsol.decks.model import by_block
from enumsol.fem.meshes import ROUNDING

if TYPE_CHECKING:
    from enumsol.decks.cards import DeckPlace
    from enumsol.decks.model import Coupling, Deck, ElementBlock, NodalEquation, Orientation, Spring
    from enumsol.decks.states import DeckState
    from enumsol.fem.deck_parts import DeckParts
    from enumsol.support.array_types import Integers


@dataclass(eq=False)
class DeckJoints:
    """Options of a deck's constraints, and its reference points.

    Attributes
    ----------
    dimension : int
    options : dict
        Of `mesh_problem`.
    points : dict of rows of nodes to str
        Names of reference points.
    turns : dict of rows of nodes to str
        Nodes whose displacements are the rotation of a reference point (ROT NODE), and its name.
    rigid : set of str
        Reference points that turn.
    grounds : list of (row, component, DeckPlace)
        Nodes of no body at which springs end.
    """

    deck: Deck
    parts: DeckParts
    dimension: int
    options: dict[str, Any] = field(default_factory=dict)
    points: dict[int, str] = field(default_factory=dict)
    turns: dict[int, str] = field(default_factory=dict)
    rigid: set[str] = field(default_factory=set)
    grounds: list[tuple[int, int, DeckPlace]] = field(default_factory=list)

    def __post_init__(self) -> None:
        deck = self.deck
        for transform in deck.transforms:
            self._transform(transform)
        tied = [pair for pair in deck.pairs if pair.tied or deck.interactions[pair.interaction].tied]
        for pair in tied:
            if isinstance(pair.adjust, str):
                raise pair.place.refused(
                    f"*CONTACT PAIR of tied surfaces has ADJUST={pair.adjust}; expected a distance"
                )
        for tie in deck.ties:
            for name in (tie.slave, tie.master):
                self.parts.check_surface(name, tie.place, "TIE", faced=name == tie.master)
        for pair in (*tied, *deck.ties):
            self._add("tie", [pair.slave, pair.master, *([] if pair.adjust is None else [pair.adjust])])
        for coupling in deck.couplings:
            self._couple(coupling)
        for equation in deck.equations:
            self._equation(equation)
        for spring in deck.springs:
            self._springs(spring)

    def slot(self, node: int, component: int) -> tuple[str, int] | None:
        """Reference point and entry of its displacement, rotations last, that a component of a node is; None: none."""
        if node in self.turns:
            return self.turns[node], self._turn(component + 3)
        if node not in self.points:
            return None
        return self.points[node], component - 1 if component <= self.dimension else self._turn(component)

    def _turn(self, component: int) -> int:
        """Entry of a rotation, component 4 to 6; of a plane body there is one, 6."""
        return self.dimension + (component - 4 if self.dimension == 3 else 0 if component == 6 else -99)

    def _add(self, name: str, entry: Any) -> None:
        self.options.setdefault(name, []).append(entry)

    def _transform(self, given: Orientation) -> None:
        rows = self.parts.in_bodies(self.deck.nodes_of(given.nodes, given.place))
        numbers, rectangular = given.points.ravel().tolist(), given.system == "RECTANGULAR"
        if self.dimension == 2:
            along = np.array([0, 0, numbers[2]]) if rectangular else given.points[1] - given.points[0]
            if np.any(along[:2]) or (rectangular and numbers[2]):
                raise given.place.refused(
                    "*TRANSFORM turns out of the plane of plane elements; expected axes within it"
                )
            numbers = numbers[:2]
        if len(rows):
            name = self.parts.nodes(rows, given.nodes)
            self.options.setdefault("transform", {})[name] = {given.system.lower(): numbers}

    def point(self, row: int) -> str:
        """Name of a reference point at a node."""
        name = f"node {self.deck.node_name(row)}"
        self.options.setdefault("reference", {})[name] = self.deck.points[row, : self.dimension].tolist()
        self.points.setdefault(row, name)
        return name

    def _couple(self, given: Coupling) -> None:
        needed = {1, 2, 3} if self.dimension == 3 else {1, 2}
        if given.kind == "kinematic" and not needed <= set(given.components):
            raise given.place.refused(
                f"*{given.card} couples the components {', '.join(map(str, given.components))}; expected all "
                f"displacements, {min(needed)} to {max(needed)}"
            )
        row = int(self.deck.nodes_of(given.reference, given.place)[0])
        nodes, wanted = self._coupled(given)
        if len(self.parts.in_bodies(np.array([row]))):
            if given.kind == "distributing":
                raise given.place.refused(
                    f"*{given.card} has a node of a body as its reference; expected a node of no body"
                )
            nodes, wanted = np.union1d(nodes, [row]), f"{wanted} with node {self.deck.node_name(row)}"
        name = self.point(row)
        self.rigid.add(name)
        if given.rotation is not None:
            self.turns[int(self.deck.nodes_of(given.rotation, given.place)[0])] = name
        option = "rigid" if given.kind == "kinematic" else "coupling"
        self.options.setdefault(option, {}).setdefault(name, []).append(self.parts.nodes(nodes, wanted))

    def _coupled(self, given: Coupling) -> tuple[Integers, str]:
        """Nodes of bodies that a coupling names, and a name for them."""
        deck, name = self.deck, given.target
        if given.card == "COUPLING":
            own = given.place.entry(deck.surfaces, name, f"*COUPLING names {name}", "a surface, one of")
            rows = own.nodes
            if rows is None:
                rows = np.unique(np.concatenate([nodes.ravel() for _, nodes in face_nodes(deck, own.faces)]))
        elif name in deck.node_sets or is_number(name.rpartition(".")[2]):
            rows = deck.nodes_of(name, given.place)
        else:
            elements = deck.elements_of(name, given.place)
            found = [block.nodes[own].ravel() for _, block, own in by_block(deck.blocks, elements)]
            rows = np.unique(np.concatenate(found))
        rows = self.parts.in_bodies(rows)
        if not len(rows):
            raise given.place.refused(f"*{given.card} couples no node of a body; expected some")
        return rows, name

    def _node(self, row: int) -> str:
        """Name of one node: a set of one, or a reference point that does not turn."""
        if row in self.points or not len(self.parts.in_bodies(np.array([row]))):
            return self.point(row)
        return self.parts.nodes(np.array([row]), f"node {self.deck.node_name(row)}")

    def _equation(self, given: NodalEquation) -> None:
        deck = self.deck
        if given.card == "MPC" and given.terms[0][1] > self.dimension:
            return
        found = []
        for target, component, coefficient in given.terms:
            rows = deck.nodes_of(target, given.place)
            found.append((rows[np.argsort(deck.node_labels[rows], kind="stable")], component, coefficient))
        count = max(len(rows) for rows, _, _ in found)
        if any(len(rows) not in (1, count) for rows, _, _ in found):
            raise given.place.refused(
                f"*{given.card} has sets of different sizes; expected sets of one size, or single nodes"
            )
        for k in range(count):
            terms = []
            for rows, component, coefficient in found:
                row = int(rows[k % len(rows)])
                slot = self.slot(row, component)
                if component > self.dimension and (slot is None or slot[1] < 0):
                    raise given.place.refused(
                        f"*{given.card} has component {component} of node {deck.node_name(row)}; expected 1 to "
                        f"{self.dimension}"
                    )
                entry = component - 1 if slot is None else slot[1]
                turns = ("rz",) if self.dimension == 2 else ("rx", "ry", "rz")
                letter = [*"xyz"[: self.dimension], *turns][entry]
                terms.append([self._node(row) if slot is None else slot[0], letter, coefficient])
            self._add("equations", {"terms": terms})

    def _springs(self, given: Spring) -> None:
        elements = self.deck.elements_of(given.elements, given.place)
        for _, block, own in by_block(self.deck.blocks, elements):
            self._springs_of(given, block, own)

    def _springs_of(self, given: Spring, block: ElementBlock, own: Integers) -> None:
        """Springs of one type: SPRING1 to the ground and SPRING2 by components, SPRINGA along the line."""
        kind = block.type.name
        wanted = {"SPRING1": 1, "SPRING2": 2, "SPRINGA": 0}.get(kind)
        if wanted is None:
            raise given.place.refused(
                f"*SPRING is given for elements of type {kind}; expected SPRING1, SPRING2 or SPRINGA"
            )
        components = set(given.components)
        if (
            (wanted and len(given.components) != wanted)
            or len(components) > 1
            or max(components, default=1) > self.dimension
        ):
            raise given.place.refused(
                f"*SPRING of type {kind} has the components {', '.join(map(str, given.components)) or 'none'}; "
                f"expected one component of {wanted or 'no'} nodes, from 1 to {self.dimension}"
            )
        for nodes in block.nodes[own].tolist():
            value: Any = given.stiffness
            if wanted:
                value = [given.stiffness if k + 1 in components else 0.0 for k in range(self.dimension)]
            inside = [row for row in nodes if len(self.parts.in_bodies(np.array([row])))]
            if 0 < len(inside) < len(nodes):
                value = self._to_ground(given, inside[0], next(row for row in nodes if row not in inside), value)
            elif not inside:
                raise given.place.refused("*SPRING holds no node of a body; expected one")
            self._spring(given, ":".join(self._node(row) for row in inside), value)

    def _to_ground(self, given: Spring, row: int, end: int, value: Any) -> list[float]:
        """Stiffnesses of a spring to a node of no body, which has to be held: along an axis."""
        if not isinstance(value, list):
            along = np.abs(self.deck.points[end] - self.deck.points[row])
            if np.sum(along > ROUNDING * np.max(along)) != 1 or np.argmax(along) >= self.dimension:
                raise given.place.refused(
                    f"*SPRING joins node {self.deck.node_name(row)} to node {self.deck.node_name(end)}, which belongs "
                    "to no body, in a direction between the axes; expected one along an axis"
                )
            value = [value if k == np.argmax(along) else 0.0 for k in range(self.dimension)]
        self.grounds += [(end, k + 1, given.place) for k, own in enumerate(value) if own]
        return list(value)

    def check_grounds(self, state: DeckState) -> None:
        """Refuse springs to nodes of no body that are not held.

        Raises
        ------
        InvalidArgumentError
            One is free or moves.
        """
        for row, component, place in self.grounds:
            if state.values.get(("BOUNDARY", row, component)) != 0.0:
                raise place.refused(
                    f"*SPRING ends at node {self.deck.node_name(row)}, which belongs to no body and is not held in "
                    f"component {component}; expected it held at 0"
                )

    def _spring(self, given: Spring, name: str, value: Any) -> None:
        springs = self.options.setdefault("node_spring", {})
        if name in springs and isinstance(springs[name], list) == isinstance(value, list):
            value = (np.array(springs[name]) + value).tolist()
        elif name in springs:
            raise given.place.refused("*SPRING puts springs of two kinds between the same nodes; expected one kind")
        springs[name] = value
