"""A deck as a plain description: arrays and small records, which know nothing of contact problems.

While it is read, nodes, elements, sets and surfaces belong to a `DeckRegion`: the deck itself, a part, or an instance
of a part. `enumsol.decks.reading` puts them together to what `Deck` holds in the end: one list of nodes and one of
elements for everything, and sets and surfaces by the rows in these.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Literal

import numpy as np

from enumsol.decks.cards import DeckPlace, is_number, key, shown
from enumsol.decks.elements import ElementType
from enumsol.support.array_types import Floats, Integers, Mask
from enumsol.support.messages import listed

# -- what steps, contacts and constraints say: no meaning is given to it here ------------------------------------------

#: Place of what no card has given.
_NOWHERE = DeckPlace("", 0)
#: Loads by the mass of elements, and how many numbers each has: a size, of CENTRIF a point on the axis, a direction.
FIELDS = {"GRAV": 4, "CENTRIF": 7}


@dataclass(frozen=True)
class Act:
    """Values that a data line of a card gives to nodes or elements.

    Attributes
    ----------
    card : str
        BOUNDARY, CLOAD, DLOAD, DSLOAD or TEMPERATURE.
    place : DeckPlace
    target : str
        A number, or the name of a set or of a surface.
    label : str
        Of distributed loads, such as P3 or GRAV.
    components : tuple of int
        Components of the nodes, from 1; 4 to 6 are rotations.
    values : tuple of float
        Reference values: one, or those of a field (`FIELDS`).
    amplitude : str or None
    """

    card: str
    place: DeckPlace
    target: str
    label: str = ""
    components: tuple[int, ...] = ()
    values: tuple[float, ...] = ()
    amplitude: str | None = None


@dataclass(frozen=True)
class Amplitude:
    """Factor over time.

    Attributes
    ----------
    times, factors : (k,) arrays
    total : bool
        Whether times count from the beginning of the first step.
    smooth : bool
        Whether it leaves each of the times and reaches the next one without slope and curvature (SMOOTH STEP).
    """

    times: tuple[float, ...]
    factors: tuple[float, ...]
    total: bool = False
    smooth: bool = False

    def at(self, time: float) -> float:
        """The factor at a time; before the first and after the last one it stays what it is there."""
        if not self.smooth:
            return float(np.interp(time, self.times, self.factors))
        number = float(np.interp(time, self.times, range(len(self.times))))
        part = number % 1.0
        return float(
            np.interp(number - part + part**3 * (10 - 15 * part + 6 * part**2), range(len(self.factors)), self.factors)
        )


@dataclass
class DeckStep:
    """A step, or what stands before the first one.

    Attributes
    ----------
    place : DeckPlace
    period : float
        Of time.
    acts : list of Act
        In their order.
    fresh : set of str
        Cards of whose acts none of before stays (OP=NEW): BOUNDARY, CLOAD, DLOAD, DSLOAD, TEMPERATURE.
    friction : dict of str to float
        Coefficients that change in this step, by the names of interactions.
    contacts : dict of (str, str) to bool
        Pairs that are in contact no more from this step on, or again, by their surfaces.
    analysis : str or None
        The card of its analysis.
    is_softened : bool
        Whether a card says that surfaces behave in another way.
    about_a_state : bool
        Whether it asks for small changes about the state that is reached (PERTURBATION).
    """

    place: DeckPlace = _NOWHERE
    period: float = 1.0
    acts: list[Act] = field(default_factory=list)
    fresh: set[str] = field(default_factory=set)
    friction: dict[str, float] = field(default_factory=dict)
    contacts: dict[tuple[str, str], bool] = field(default_factory=dict)
    analysis: str | None = None
    is_softened: bool = False
    about_a_state: bool = False
    ended: bool = False


@dataclass
class Interaction:
    """Properties of a contact, by *SURFACE INTERACTION and the cards after it.

    Attributes
    ----------
    place : DeckPlace
    friction : float
        Coefficient [-].
    tied : bool
        Whether what touches stays joined.
    """

    place: DeckPlace
    friction: float = 0.0
    tied: bool = False


@dataclass
class ContactPair:
    """Two surfaces that may touch.

    Attributes
    ----------
    place : DeckPlace
    slave, master, interaction : str
    adjust : float, str or None
        Distance up to which nodes are moved onto the other surface before the analysis, or the set of these nodes.
    clearance : float or None
        Replaces the distances of the geometry [length].
    tied : bool
        Whether the two stay joined.
    is_included : bool
        Whether *CONTACT INCLUSIONS names it, and a later card gives its interaction.
    """

    place: DeckPlace
    slave: str
    master: str
    interaction: str
    adjust: float | str | None = None
    clearance: float | None = None
    tied: bool = False
    is_included: bool = False


@dataclass(frozen=True)
class NodalEquation:
    """A homogeneous linear equation between components of nodes.

    Attributes
    ----------
    place : DeckPlace
    terms : tuple of (target, component, coefficient)
        The target is a number or the name of a set.
    card : str
        EQUATION or MPC, of which the equations of components that a plane body lacks do not count.
    """

    place: DeckPlace
    terms: tuple[tuple[str, int, float], ...]
    card: str = "EQUATION"


@dataclass(frozen=True)
class Coupling:
    """Nodes whose motion depends on that of a reference node.

    Attributes
    ----------
    place : DeckPlace
    card : str
        COUPLING, RIGID BODY or MPC.
    target : str
        A surface, a set of nodes or of elements.
    reference : str
        The node whose components 1 to 3 are the displacement.
    rotation : str or None
        The node whose components 1 to 3 are the rotation; None: components 4 to 6 of the reference node.
    kind : {"kinematic", "distributing"}
    components : tuple of int
        That are coupled.
    """

    place: DeckPlace
    card: str
    target: str
    reference: str
    rotation: str | None = None
    kind: Literal["kinematic", "distributing"] = "kinematic"
    components: tuple[int, ...] = (1, 2, 3, 4, 5, 6)


@dataclass(frozen=True)
class Spring:
    """Stiffness of spring elements.

    Attributes
    ----------
    place : DeckPlace
    elements : str
        The set of elements.
    stiffness : float
        [force / length]
    components : tuple of int
        Of its nodes; none where it acts along the line between them.
    """

    place: DeckPlace
    elements: str
    stiffness: float
    components: tuple[int, ...] = ()


# -- nodes, elements, sets and materials -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Account:
    """An entry of the account: a card, and what became of it.

    Attributes
    ----------
    place : DeckPlace
    card : str
        Its name.
    became : str
        In words: "9 nodes", or "not used: the analysis is static".
    used : bool
        Whether it is part of the description.
    """

    place: DeckPlace
    card: str
    became: str
    used: bool = True


@dataclass(frozen=True, eq=False)
class ElementBlock:
    """Elements of one type, as a card *ELEMENT has them.

    Attributes
    ----------
    type : ElementType
    labels : (m,) int array
        Numbers of the elements in the deck.
    nodes : (m, k) int array
        Their nodes in the deck's order: numbers while a region is read, rows of ``Deck.points`` in a deck.
    place : DeckPlace
    """

    type: ElementType
    labels: Integers
    nodes: Integers
    place: DeckPlace


def by_block(blocks: Iterable[ElementBlock], rows: Integers) -> Iterator[tuple[int, ElementBlock, Integers]]:
    """Blocks that rows of elements belong to, or faces (k, 2) do: the first row of each, the block, and rows in it."""
    first = 0
    for block in blocks:
        of = rows if rows.ndim == 1 else rows[:, 0]
        own = rows[(of >= first) & (of < first + len(block.labels))] - (
            first if rows.ndim == 1 else np.array([first, 0])
        )
        if len(own):
            yield first, block, own
        first += len(block.labels)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers in a region, in ascending order, and their rows in the deck."""

    sorted: Integers
    rows: Integers

    @classmethod
    def of(cls, labels: Integers, first: int) -> Numbers:
        """Numbers of a region whose rows begin with ``first``; of those that occur twice the first one is found."""
        order = np.argsort(labels, kind="stable")
        return cls(labels[order], first + order)

    def found(self, labels: Integers) -> tuple[Integers, Mask]:
        """Row of each number, and whether there is one."""
        if not len(self.sorted):
            return np.zeros(len(labels), dtype=np.int64), np.zeros(len(labels), dtype=bool)
        at = np.minimum(np.searchsorted(self.sorted, labels), len(self.sorted) - 1)
        return self.rows[at], self.sorted[at] == labels

    def within(self, numbers: range) -> Integers:
        """Rows of the numbers in a range."""
        own = self.sorted
        return np.asarray(
            self.rows[(own >= numbers.start) & (own < numbers.stop) & ((own - numbers.start) % numbers.step == 0)]
        )


@dataclass(eq=False)
class Members:
    """A set or a surface while a region is read: what it is made of.

    Attributes
    ----------
    place : DeckPlace
        Where it begins.
    spelled : str
        Its name as it is written there.
    parts : list of (kind, what, instance, place)
        ``what`` is an array of numbers, a range of numbers, or the name of another set. ``kind`` is "NSET" or "ELSET",
        in surfaces the label of a face ("S1"; "" for faces that belong to no other element).
    nodal : bool
        Whether it is a surface of nodes.
    """

    place: DeckPlace
    spelled: str
    parts: list[tuple[str, Integers | range | str, str, DeckPlace]] = field(default_factory=list)
    nodal: bool = False


@dataclass(frozen=True)
class Section:
    """A *SOLID SECTION, or another section: which elements are of which material.

    Attributes
    ----------
    kind : str
        Name of the card.
    elements, material : str
        Keys of the set of elements and of the material.
    thickness : float or None
        Of plane elements; None if the deck gives none.
    orientation : str
        Key of the orientation, or "".
    place : DeckPlace
    """

    kind: str
    elements: str
    material: str
    thickness: float | None
    orientation: str
    place: DeckPlace


#: Systems of local directions by their letters; rectangular where a card gives none.
SYSTEMS = {"": "RECTANGULAR", "R": "RECTANGULAR", "C": "CYLINDRICAL"}


@dataclass(frozen=True, eq=False)
class Orientation:
    """Local directions of a material or a section, or those of the components of nodes (*TRANSFORM).

    Attributes
    ----------
    system : str
        "RECTANGULAR" or "CYLINDRICAL".
    points : (2, 3) array
        Points a on the first axis and b in the plane of the first two; of a cylindrical system two points on its axis.
    origin : (3,) array
    rotation : (int, float) or None
        A local axis, 1 to 3, and degrees of an additional rotation about it.
    place : DeckPlace
    nodes : str
        The set of nodes whose components they turn, or "".
    """

    system: str
    points: Floats
    origin: Floats
    rotation: tuple[int, float] | None
    place: DeckPlace
    nodes: str = ""


@dataclass(eq=False)
class Material:
    """A material as the deck gives it; None for what it does not give.

    Attributes
    ----------
    name : str
    place : DeckPlace
    elastic : str
        "ISO", "ORTHO" (nine moduli D1111, D1122, D2222, D1133, D2233, D3333, D1212, D1313, D2323) or
        "ENGINEERING CONSTANTS" (E1, E2, E3, nu12, nu13, nu23, G12, G13, G23); "" if it has none.
    constants : (k,) array
        Of the elastic law: (E, nu) of an isotropic one.
    density : float or None
    expansion : (k,) array or None
        Coefficients of thermal expansion: one, or three along the local directions.
    zero : float
        Temperature from which expansion is measured.
    elastic_place, expansion_place : DeckPlace or None
    """

    name: str
    place: DeckPlace
    elastic: str = ""
    constants: Floats = field(default_factory=lambda: np.zeros(0))
    density: float | None = None
    expansion: Floats | None = None
    zero: float = 0.0
    elastic_place: DeckPlace = _NOWHERE
    expansion_place: DeckPlace = _NOWHERE


@dataclass(frozen=True, eq=False)
class RigidProfile:
    """A rigid surface that is given by lines of the plane, in 3D swept across it; what touches it is to their left.

    Attributes
    ----------
    place : DeckPlace
    corners : (k, 2) array
        Ends of its lines in local coordinates.
    origin : (3,) array
    axes : (3, 3) array
        Directions of the local axes.
    is_swept : bool
    """

    place: DeckPlace
    corners: Floats
    origin: Floats
    axes: Floats
    is_swept: bool

    def at(self, height: float) -> Floats:
        """Positions (k, 3) of the corners at a height across their plane."""
        return np.asarray(self.origin + self.corners @ self.axes[:2] + height * self.axes[2])

    def moved(self, region: DeckRegion) -> RigidProfile:
        """The profile where an instance has it."""
        origin, *ends = region.moved(np.concatenate([self.origin[None], self.origin + self.axes]))
        return replace(self, origin=origin, axes=np.array(ends) - origin)


@dataclass(eq=False)
class DeckRegion:
    """Nodes, elements, sets and surfaces with numbers and names of their own: of the deck itself, or of a part.

    Attributes
    ----------
    place : DeckPlace or None
    spelled : str
        Name of the part or the instance as it is written.
    nodes : list of (DeckPlace, labels, points)
    blocks : list of ElementBlock
    sets : dict of ("NSET", "ELSET" or "SURFACE", key) to Members
    sections : list of Section
    orientations : dict of keys to Orientation
    profiles : dict of keys to RigidProfile
    couplings : list of Coupling
        Rigid bodies, by names and numbers of the region.
    translation : (3,) array
    rotation : (7,) array or None
        Two points on an axis, and degrees about it, for after the translation.
    is_used : bool
        Whether there is an instance of the part.
    """

    place: DeckPlace = _NOWHERE
    spelled: str = ""
    nodes: list[tuple[DeckPlace, Integers, Floats]] = field(default_factory=list)
    blocks: list[ElementBlock] = field(default_factory=list)
    sets: dict[tuple[str, str], Members] = field(default_factory=dict)
    sections: list[Section] = field(default_factory=list)
    orientations: dict[str, Orientation] = field(default_factory=dict)
    profiles: dict[str, RigidProfile] = field(default_factory=dict)
    couplings: list[Coupling] = field(default_factory=list)
    translation: Floats = field(default_factory=lambda: np.zeros(3))
    rotation: Floats | None = None
    is_used: bool = False

    def members(self, kind: str, spelled: str, place: DeckPlace) -> Members:
        """Members of a set or surface, which begins here if its name is new."""
        return self.sets.setdefault((kind, key(spelled)), Members(place, spelled.strip('"')))

    def copied(self, place: DeckPlace, spelled: str) -> DeckRegion:
        """Copy for an instance, which may get more."""
        sets = {name: replace(own, parts=[*own.parts]) for name, own in self.sets.items()}
        return DeckRegion(place, spelled, [*self.nodes], [*self.blocks], sets, [*self.sections],
                          dict(self.orientations), dict(self.profiles), [*self.couplings])  # fmt: skip

    def moved(self, points: Floats) -> Floats:
        """Points (k, 3) of the part where its instance has them."""
        at = points + self.translation
        if self.rotation is None:
            return at
        origin, end, angle = self.rotation[:3], self.rotation[3:6], np.radians(self.rotation[6])
        axis = (end - origin) / np.linalg.norm(end - origin)
        arms = at - origin
        along = np.outer(arms @ axis, axis)
        return np.asarray(
            origin + along + np.cos(angle) * (arms - along) + np.sin(angle) * np.cross(axis, arms)
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface.

    Attributes
    ----------
    place : DeckPlace
    faces : (k, 2) int array
        Rows of elements, and numbers of their faces from 0; -1 for the element itself, of lower dimension than bodies,
        and -2 for its other side.
    nodes : (k,) int array or None
        Rows of its nodes, of a surface of nodes.
    """

    place: DeckPlace
    faces: Integers
    nodes: Integers | None = None


@dataclass(eq=False)
class Deck:
    """A deck: everything that its cards say, by keys in upper case ("SET", or "INSTANCE.SET" of an instance).

    Attributes
    ----------
    path : Path
    heading : str
    points : (N, 3) array
        Positions of all nodes [length].
    node_labels : (N,) int array
        Their numbers in the deck.
    blocks : list of ElementBlock
        Elements; their rows are counted through all blocks.
    node_sets, element_sets : dict of keys to int arrays
        Rows of nodes, and of elements.
    surfaces : dict of keys to Surface
    spelled : dict
        Names of sets and surfaces as they are written, by their keys.
    materials : dict of keys to Material
    sections : list of Section
    orientations : dict of keys to Orientation
    instances : dict of keys ("" for the deck itself) to (first row of nodes, behind the last, first row of elements,
        behind the last)
    initial : DeckStep
        What stands before the first step.
    steps : list of DeckStep
    amplitudes, interactions : dict
        By their names.
    pairs, ties, equations, couplings, springs, transforms : lists
        Contacts and constraints, in the order of the cards; of ties ``adjust`` is the largest distance that is joined.
    account : list of Account
    """

    path: Path
    heading: str = ""
    points: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    node_labels: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    blocks: list[ElementBlock] = field(default_factory=list)
    node_sets: dict[str, Integers] = field(default_factory=dict)
    element_sets: dict[str, Integers] = field(default_factory=dict)
    surfaces: dict[str, Surface] = field(default_factory=dict)
    spelled: dict[str, str] = field(default_factory=dict)
    materials: dict[str, Material] = field(default_factory=dict)
    sections: list[Section] = field(default_factory=list)
    orientations: dict[str, Orientation] = field(default_factory=dict)
    instances: dict[str, tuple[int, int, int, int]] = field(default_factory=dict)
    initial: DeckStep = field(default_factory=DeckStep)
    steps: list[DeckStep] = field(default_factory=list)
    amplitudes: dict[str, Amplitude] = field(default_factory=dict)
    interactions: dict[str, Interaction] = field(default_factory=dict)
    pairs: list[ContactPair] = field(default_factory=list)
    ties: list[ContactPair] = field(default_factory=list)
    equations: list[NodalEquation] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    springs: list[Spring] = field(default_factory=list)
    transforms: list[Orientation] = field(default_factory=list)
    account: list[Account] = field(default_factory=list)

    @cached_property
    def dimension(self) -> int:
        """Dimension of the bodies, 2 or 3; 0 if there are none."""
        bodies = [block.type for block in self.blocks if len(block.labels) and block.type.is_body]
        return max((kind.shape.dimension for kind in bodies), default=0)

    @property
    def firsts(self) -> list[int]:
        """Row of the first element of each block, and the row behind the last element."""
        return [*accumulate((len(block.labels) for block in self.blocks), initial=0)]

    def is_body(self, block: ElementBlock) -> bool:
        """True for elements of bodies: plane ones beside solid ones only carry names, as in meshes of gmsh."""
        return block.type.is_body and block.type.shape.dimension == self.dimension

    @cached_property
    def element_labels(self) -> Integers:
        """Numbers (M,) of all elements in the deck."""
        return np.concatenate([np.zeros(0, dtype=np.int64), *(block.labels for block in self.blocks)])

    def nodes_of(self, name: str, place: DeckPlace) -> Integers:
        """Rows of the nodes that a card names: a number, a set, or either of an instance ("L-1.3", "L-1.FLOOR").

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        return self._rows(name, place, "node", self.node_sets, self.node_labels, 0)

    def elements_of(self, name: str, place: DeckPlace) -> Integers:
        """Rows of the elements that a card names, as `nodes_of` those of nodes.

        Raises
        ------
        InvalidArgumentError
            There are none.
        """
        return self._rows(name, place, "element", self.element_sets, self.element_labels, 2)

    def node_name(self, row: int) -> str:
        """Number of a node in the deck, behind the name of its instance if it has one."""
        return self._name(row, self.node_labels, 0)

    def node_names(self) -> list[int] | list[str]:
        """Names of all nodes, as `node_name` gives them; numbers if there are no instances."""
        if len(self.instances) <= 1:
            return [int(label) for label in self.node_labels]
        return [self.node_name(row) for row in range(len(self.node_labels))]

    def element_name(self, row: int) -> str:
        """Number of an element in the deck, behind the name of its instance if it has one."""
        return self._name(row, self.element_labels, 2)

    def _rows(
        self, name: str, place: DeckPlace, what: str, sets: dict[str, Integers], labels: Integers, column: int
    ) -> Integers:
        instance, _, number = name.strip().rpartition(".")
        if is_number(number) and key(instance) in self.instances:
            first, last = self.instances[key(instance)][column : column + 2]
            rows = first + np.flatnonzero(labels[first:last] == int(number))
        else:
            rows = sets.get(key(name), np.zeros(0, dtype=np.int64))
        if not len(rows):
            known = listed(sets) or "none"
            found = "is empty or not" if key(name) in sets else "is not"
            out = [str(own.place) for own in self.account if own.card == what.upper() and not own.used]
            without = f", whose elements of {' and '.join(out)} are left out" if out else ""
            raise place.refused(
                f"{what} {shown(name)} {found} in the deck{without}; expected a number or a set of {known}"
            )
        return rows

    def _name(self, row: int, labels: Integers, column: int) -> str:
        instance = next((name for name, ends in self.instances.items() if ends[column] <= row < ends[column + 1]), "")
        return f"{instance}.{labels[row]}" if instance else str(labels[row])
