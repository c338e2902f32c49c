"""Decks of one body on another, in 2D, axisymmetric and in 3D, by the type of their elements and the size of cells."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

#: Places of the nodes of the elements in a cell of 2 steps, corners first, in the order of the decks.
SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
CUBE = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
TETRAHEDRA = [(0, 1, 3, 7), (0, 1, 7, 4), (1, 2, 3, 7), (1, 2, 7, 6), (1, 4, 5, 7), (1, 5, 6, 7)]
WEDGES = [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]


def middle(*places):
    """The place half way between others of a cell."""
    return tuple(int(value) for value in np.mean(places, axis=0))


def elements_of(kind):
    """Elements of a cell, each a list of places of nodes."""
    if kind in ("CPE4", "CPS4", "CAX4"):
        return [SQUARE[:4]]
    if kind in ("CPE8", "CAX8"):
        return [SQUARE]
    if kind == "CPE6":
        corners = [[SQUARE[k] for k in three] for three in ((0, 1, 2), (0, 2, 3))]
        return [[*three, *(middle(three[k], three[(k + 1) % 3]) for k in range(3))] for three in corners]
    if kind == "C3D8":
        return [CUBE]
    if kind == "C3D20":
        return [[*CUBE, *(middle(CUBE[a], CUBE[b]) for a, b in EDGES)]]
    if kind == "C3D6":
        return [[CUBE[k] for k in wedge] for wedge in WEDGES]
    corners = [[CUBE[k] for k in four] for four in TETRAHEDRA]
    if kind == "C3D4":
        return corners
    pairs = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
    return [[*four, *(middle(four[a], four[b]) for a, b in pairs)] for four in corners]


#: Corners of the faces of elements, by the number of their corners and dimension, in the order of the faces' labels.
FACES = {
    (2, 3): [(0, 1), (1, 2), (2, 0)],
    (2, 4): [(0, 1), (1, 2), (2, 3), (3, 0)],
    (3, 4): [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)],
    (3, 6): [(0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    (3, 8): [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
}
CORNERS = {"CPE6": 3, "C3D4": 4, "C3D10": 4, "C3D6": 6, "C3D8": 8, "C3D20": 8}


@dataclass
class Deck:
    """Lines of a deck that grow, and the numbers of nodes and elements that are there."""

    kind: str
    lines: list[str] = field(default_factory=list)
    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: int = 0

    def body(self, name, low, high, cells, taper=0.0):
        """A block from ``low`` to ``high`` of so many cells in each direction; its faces are surfaces ``name_X0`` ...

        With a taper, x is multiplied by 1 + taper y.
        """
        low, high, cells = (np.asarray(value) for value in (low, high, cells))
        d = len(cells)
        numbers: dict[tuple[int, ...], int] = {}

        def number(place):
            if place not in numbers:
                numbers[place] = len(self.nodes) + 1
                at = low + (high - low) * np.array(place) / (2 * cells)
                at[0] *= 1.0 + taper * at[1]
                self.nodes[numbers[place]] = tuple(at)
            return numbers[place]

        surfaces: dict[str, list[str]] = {f"{name}_{axis}{end}": [] for axis in "XYZ"[:d] for end in (0, 1)}
        data = []
        for cell in itertools.product(*map(range, cells)):
            for places in elements_of(self.kind):
                self.elements += 1
                at = [tuple(int(2 * c + v) for c, v in zip(cell, place, strict=True)) for place in places]
                data.append([self.elements, *map(number, at)])
                corners = CORNERS.get(self.kind, 4)
                for label, face in enumerate(FACES[d, corners], start=1):
                    for axis, end in itertools.product(range(d), (0, 1)):
                        if all(at[k][axis] == 2 * cells[axis] * end for k in face):
                            surfaces[f"{name}_{'XYZ'[axis]}{end}"].append(f"{self.elements},S{label}")
        self.lines += ["*NODE, NSET=ALL"]
        self.lines += [f"{n},{','.join(f'{v:.12g}' for v in self.nodes[n])}" for n in sorted(numbers.values())]
        self.lines.append(f"*ELEMENT, TYPE={self.kind}, ELSET={name}")
        for row in data:
            parts = [",".join(map(str, row[k : k + 12])) for k in range(0, len(row), 12)]
            self.lines.append(",\n".join(parts))
        for surface, faces in surfaces.items():
            self.lines += [f"*SURFACE, NAME={surface}", *faces]
        for axis, end in itertools.product(range(d), (0, 1)):
            of = sorted(n for place, n in numbers.items() if place[axis] == 2 * cells[axis] * end)
            self.lines += [f"*NSET, NSET=N{name}_{'XYZ'[axis]}{end}", *(f"{n}," for n in of)]
        self.lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=M", "1."]

    def material(self, young, poisson):
        """The material of all bodies."""
        self.lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{young:g},{poisson:g}"]

    def contact(self, slave, master, friction, stiffness):
        """A pair with friction; CalculiX' stiffness of contact is for its penalty only."""
        self.lines += [
            "*SURFACE INTERACTION, NAME=I", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiffness:g}",
            "*FRICTION", f"{friction:g},{stiffness / 10:g}",
            "*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE", f"{slave},{master}",
        ]  # fmt: skip

    def step(self, base, *lines):
        """A static step with the output that is compared: displacements, and the reaction at the base of a body."""
        self.lines += ["*STEP", "*STATIC", "0.25,1.", *lines, "*NODE PRINT, NSET=ALL", "U"]
        self.lines += [f"*NODE PRINT, NSET={base}, TOTALS=ONLY", "RF", "*END STEP"]

    def text(self):
        """The deck."""
        return "\n".join(self.lines) + "\n"


def block_on_slab(kind, n, friction=0.3):
    """A block that is pressed on a wider slab and pushed along it."""
    deck = Deck(kind)
    d = 3 if kind.startswith("C3D") else 2
    deep = [(0.0, 1.0)] if d == 3 else []
    cells = [n] if d == 3 else []

    def box(x, y):
        low, high = zip(x, *deep, y, strict=True)
        return low, high

    up = "Z" if d == 3 else "Y"
    deck.body("SLAB", *box((-0.5, 1.5), (-1.0, 0.0)), [2 * n, *cells, n])
    deck.body("BLOCK", *box((0.0, 1.0), (0.0, 1.0)), [n, *cells, n])
    deck.material(1000.0, 0.3)
    deck.contact(f"BLOCK_{up}0", f"SLAB_{up}1", friction, 1e6)
    deck.lines += ["*BOUNDARY", f"NSLAB_{up}0,1,{d}"]
    # the block's far side is moved down and along, which holds it without contact
    deck.step(
        f"NSLAB_{up}0",
        "*BOUNDARY",
        f"NBLOCK_{up}1,1,1,4e-4",
        *([f"NBLOCK_{up}1,2,2,0"] if d == 3 else []),
        f"NBLOCK_{up}1,{d},{d},-2e-3",
    )
    return deck.text()


def ring_on_shaft(kind, n, friction=0.2, taper=0.0):
    """A ring with a press fit on a hollow shaft, which may be a cone, pushed along it."""
    deck = Deck(kind)
    press = 1e-3
    deck.body("SHAFT", (0.5, -0.5), (1.0, 1.5), [n, 4 * n], taper)
    deck.body("RING", (1.0 - press, 0.0), (1.5, 1.0), [n, 2 * n], taper)
    deck.material(1000.0, 0.3)
    deck.contact("RING_X0", "SHAFT_X1", friction, 1e6)
    deck.lines += ["*BOUNDARY", "NSHAFT_Y0,2,2"]
    deck.step("NSHAFT_Y0", "*BOUNDARY", "NRING_Y1,2,2,5e-4")
    return deck.text()


def ring_on_cone(kind, n):
    """The ring on a cone, which carries part of the push by its normal forces."""
    return ring_on_shaft(kind, n, taper=0.1)


PLANE, SOLID = ("CPE4", "CPS4", "CPE8", "CPE6"), ("C3D8", "C3D4", "C3D10", "C3D6", "C3D20")
#: Decks by their names, as functions of the number of cells along the block.
CASES = {
    **{f"block {kind}": (block_on_slab, kind) for kind in (*PLANE, *SOLID)},
    **{f"ring {kind}": (ring_on_shaft, kind) for kind in ("CAX4", "CAX8")},
    "cone CAX4": (ring_on_cone, "CAX4"),
}
