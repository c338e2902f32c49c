"""Description of what a deck's steps, contacts and constraints say, in plain data: no meaning is given to it here."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from enumsol.decks.cards import DeckPlace

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
    name : str
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

    place: DeckPlace | None = None
    name: str = ""
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
class Tie:
    """Two surfaces that are joined.

    Attributes
    ----------
    place : DeckPlace
    name, slave, master : str
    tolerance : float or None
        Distance up to which nodes of the slave surface are joined [length].
    adjust : bool
        Whether the nodes are moved onto the other surface before the analysis.
    """

    place: DeckPlace
    name: str
    slave: str
    master: str
    tolerance: float | None = None
    adjust: bool = True


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


@dataclass(frozen=True)
class Transform:
    """Directions of the components of nodes.

    Attributes
    ----------
    place : DeckPlace
    nodes : str
        The set of nodes.
    kind : {"R", "C"}
        Rectangular or cylindrical.
    numbers : tuple of six float
        Two points: on the first axis and in the plane of the first two, or on the axis of the cylinder.
    """

    place: DeckPlace
    nodes: str
    kind: str
    numbers: tuple[float, ...]


@dataclass
class Analysis:
    """Steps, contacts and constraints of a deck as its cards say them, in their order.

    Attributes
    ----------
    initial : DeckStep
        What stands before the first step.
    steps : list of DeckStep
    amplitudes, interactions : dict
        By their names.
    pairs, ties, equations, couplings, springs, transforms : lists
    changing : str or None
        The interaction that cards which follow it belong to.
    coupling : Coupling or None
        One of which the next card says the kind.
    """

    initial: DeckStep = field(default_factory=DeckStep)
    steps: list[DeckStep] = field(default_factory=list)
    amplitudes: dict[str, Amplitude] = field(default_factory=dict)
    interactions: dict[str, Interaction] = field(default_factory=dict)
    pairs: list[ContactPair] = field(default_factory=list)
    ties: list[Tie] = field(default_factory=list)
    equations: list[NodalEquation] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    springs: list[Spring] = field(default_factory=list)
    transforms: list[Transform] = field(default_factory=list)
    changing: str | None = None
    coupling: Coupling | None = None
