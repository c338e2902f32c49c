"""The table of elements: what the letters of their types say, their nodes, and their faces, which surfaces name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise


@dataclass(frozen=True)
class Shape:
    """A shape of elements: its nodes in the order of both programs.

    Attributes
    ----------
    name : what meshio calls it
    dimension : 0 to 3
    nodes, corners : how many it has
    faces : nodes of each face S1, S2, ...: corners, nodes between them, node inside
    to_vtk : nodes in the order of VTK, where it differs
    """

    name: str
    dimension: int
    nodes: int
    corners: int
    faces: tuple[tuple[int, ...], ...] = ()
    to_vtk: tuple[int, ...] = ()

    @property
    def form(self) -> str:
        """Name of the shape of first order."""
        return self.name.rstrip("0123456789")


#: Faces S1, S2, ... of solids by their corners, by the name of the shape.
_FACES = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
#: Edges of elements by pairs of corners, in the order of the nodes between them, by the name of the shape.
EDGES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "pyramid": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "hexahedron": (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
        *((0, 4), (1, 5), (2, 6), (3, 7)),
    ),
}


def _faces(name: str, *, inside: bool = False) -> tuple[tuple[int, ...], ...]:
    """Faces of second order, from their corners."""
    faces = _FACES[name]
    corners = max(node for face in faces for node in face) + 1
    between = {frozenset(edge): corners + k for k, edge in enumerate(EDGES[name])}
    found = [(*face, *(between[frozenset(edge)] for edge in pairwise((*face, face[0])))) for face in faces]
    return tuple((*face, 21 + k) if inside else face for k, face in enumerate(found))


def _sides(corners: int, *, second: bool) -> tuple[tuple[int, ...], ...]:
    """Sides of a plane element."""
    return tuple((k, (k + 1) % corners, *((corners + k,) if second else ())) for k in range(corners))


_SHAPES = {
    (shape.dimension, shape.nodes): shape
    for shape in (
        Shape("vertex", 0, 1, 1),
        Shape("line", 1, 2, 2),
        Shape("line3", 1, 3, 2, to_vtk=(0, 2, 1)),
        Shape("triangle", 2, 3, 3, _sides(3, second=False)),
        Shape("triangle6", 2, 6, 3, _sides(3, second=True)),
        Shape("quad", 2, 4, 4, _sides(4, second=False)),
        Shape("quad8", 2, 8, 4, _sides(4, second=True)),
        Shape("quad9", 2, 9, 4, _sides(4, second=True)),
        Shape("tetra", 3, 4, 4, _FACES["tetra"]),
        Shape("tetra10", 3, 10, 4, _faces("tetra")),
        Shape("pyramid", 3, 5, 5, _FACES["pyramid"]),
        Shape("pyramid13", 3, 13, 5, _faces("pyramid")),
        Shape("wedge", 3, 6, 6, _FACES["wedge"]),
        Shape("wedge15", 3, 15, 6, _faces("wedge")),
        Shape("hexahedron", 3, 8, 8, _FACES["hexahedron"]),
        Shape("hexahedron20", 3, 20, 8, _faces("hexahedron")),
        Shape(
            "hexahedron27",
            3,
            27,
            8,
            _faces("hexahedron", inside=True),
            (*range(20), 26, 24, 23, 25, 21, 22, 20),
        ),
    )
}


def shape_of(dimension: int, nodes: int) -> Shape | None:
    """Shape with so many nodes, if there is one."""
    return _SHAPES.get((dimension, nodes))


@dataclass(frozen=True)
class ElementType:
    """A type of elements, and what its letters say.

    Attributes
    ----------
    name : str
        In upper case, "C3D8I" for example.
    family : str
        "solid", "plane stress", "plane strain", "axisymmetric", or what else it is in words for messages, "shells".
    shape : Shape
    plain : str
        Type of the same shape and family without what else its letters say, "C3D8" for "C3D8I".
    """

    name: str
    family: str
    shape: Shape
    plain: str

    @property
    def is_body(self) -> bool:
        """True for solid and plane elements, of which bodies consist."""
        return self.family in BODIES


#: Families of elements that are bodies.
BODIES = ("solid", "plane stress", "plane strain", "axisymmetric")
#: Beginnings of types: family and dimension; the number of nodes follows, then letters.
_FAMILIES = {
    "C3D": ("solid", 3), "CPS": ("plane stress", 2), "CPE": ("plane strain", 2), "CAX": ("axisymmetric", 2),
    "S": ("shells", 2), "STRI": ("shells", 2), "M3D": ("membranes", 2), "SFM3D": ("surface elements", 2),
    "R3D": ("rigid surfaces", 2), "R2D": ("rigid lines", 1), "RAX": ("rigid lines", 1), "SAX": ("shells", 1),
    "MAX": ("membranes", 1), "T2D": ("trusses", 1), "T3D": ("trusses", 1),
}  # fmt: skip
#: Types whose names hold no number of nodes: family, dimension, nodes (B33H as meshio writes it).
_OTHERS = {
    "B21": ("beams", 1, 2), "B22": ("beams", 1, 3), "B31": ("beams", 1, 2), "B32": ("beams", 1, 3),
    "B23": ("beams", 1, 2), "B33": ("beams", 1, 2), "B33H": ("beams", 1, 3), "STRI65": ("shells", 2, 6),
    "MASS": ("point masses", 0, 1), "SPRING1": ("springs", 0, 1), "SPRING2": ("springs", 1, 2),
    "SPRINGA": ("springs", 1, 2), "DASHPOT1": ("dashpots", 0, 1), "DASHPOT2": ("dashpots", 1, 2),
    "DASHPOTA": ("dashpots", 1, 2), "GAPUNI": ("gap elements", 1, 2), "DCOUP3D": ("couplings", 0, 1),
    "ROTARYI": ("point masses", 0, 1),
}  # fmt: skip
#: Letters behind the number of nodes change the formulation: reduced integration, incompatible modes, hybrid, modified,
#: with pressure or temperature as unknowns, and others.
_LETTERS = re.compile(r"([A-Z][A-Z0-9]*?D|[A-Z]+)(\d+)(R5|[RIHMSLPTW]*)\Z")


@lru_cache(maxsize=256)
def element_type(name: str) -> ElementType | None:
    """Meaning of a type in upper case; None for one that is not in the table.

    Examples
    --------
    >>> from enumsol.decks.elements import element_type
    >>> kind = element_type("C3D20R")
    >>> kind.family, kind.shape.nodes, kind.plain
    ('solid', 20, 'C3D20')
    """
    if (plain := name if name in _OTHERS else name.rstrip("RHS")) in _OTHERS:
        family, dimension, nodes = _OTHERS[plain]
        return ElementType(name, family, _SHAPES[dimension, nodes], plain)
    found = _LETTERS.match(name)
    if found is None or found.group(1) not in _FAMILIES:
        return None
    family, dimension = _FAMILIES[found.group(1)]
    nodes = int(found.group(2))
    if found.group(1) in ("SAX", "MAX"):
        nodes += 1  # the number is that of the order
    shape = shape_of(dimension, nodes)
    if shape is None:
        return None
    return ElementType(name, family, shape, f"{found.group(1)}{found.group(2)}")
