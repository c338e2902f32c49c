"""Which cells of a mesh file are the body, and which its facets, by meshio's names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.cells import completed
from enumsol.model.body2d import as_quadrilaterals
from enumsol.model.facets import CELL_FACETS, boundary_facets

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

#: By dimension: the facets of each kind of cell.
FACET_OF = {
    2: {"triangle": "line", "quad": "line", "triangle6": "line3", "quad8": "line3", "quad9": "line3"},
    3: {
        "tetra": "triangle",
        "hexahedron": "quad",
        "tetra10": "triangle6",
        "hexahedron20": "quad8",
        "hexahedron27": "quad9",
    },
}
#: Kinds that may come together.
_TOGETHER = ({"triangle", "quad"}, {"triangle6", "quad8"}, {"triangle6", "quad9"})
#: Nodes of a quadrilateral.
_NODES = {"quad": 4, "quad8": 8, "quad9": 9}
#: By dimension: other cells that files may hold.
_IGNORED = {2: ("vertex",), 3: ("vertex", "line")}
_EXPECTED = {
    2: "triangle and quad with line, or triangle6 and either quad8 or quad9 with line3",
    3: "one of tetra, tetra10, hexahedron, hexahedron20, hexahedron27 with triangle, triangle6, quad, quad8, quad9",
}
_BODIES = {2: "triangles or quadrilaterals", 3: "tetrahedra or hexahedra"}
#: Why gmsh leaves cells out.
GROUPS_ONLY = "gmsh writes only what is in physical groups, if there are any:"
#: What makes gmsh write other cells.
_HINTS = {
    "pyramid": " (pyramids join tetrahedra to hexahedra: mesh all of the body by one of them)",
    "wedge": " (wedges are extruded triangles: recombine these to quadrilaterals, or do not recombine the layers)",
    "": " (for cells of higher order set Mesh.ElementOrder = 2 in gmsh)",
}
_APART = " (tetrahedra and hexahedra fit together by pyramids only: mesh all of the body by one of them)"


def body_kinds(kinds: list[str], dimension: int) -> tuple[list[str], str]:
    """Kinds of the cells of the body, and of its facets.

    Raises
    ------
    InvalidArgumentError
        There is no body, its cells do not fit together, or there are other cells.
    """
    facet_of = FACET_OF[dimension]
    others = [kind for kind in kinds if not kind.startswith(_IGNORED[dimension])]
    bodies = [kind for kind in others if kind in facet_of]
    strange = [kind for kind in others if kind not in facet_of and kind not in facet_of.values()]
    if strange or (len(bodies) > 1 and set(bodies) not in _TOGETHER):
        hint = next((text for start, text in _HINTS.items() if any(kind.startswith(start) for kind in strange)), "")
        hint = hint or (_APART if dimension == 3 else "")
        raise InvalidArgumentError(
            f"the mesh has cells of type {' and '.join(strange or bodies)}; expected {_EXPECTED[dimension]}{hint}"
        )
    if not bodies:
        raise InvalidArgumentError(
            f"the mesh has no {_BODIES[dimension]}; expected a body in {dimension}D ({GROUPS_ONLY} the body needs one, "
            "too)"
        )
    facet = facet_of[bodies[0]]
    other = [kind for kind in others if kind not in (*bodies, facet)]
    if other:
        raise InvalidArgumentError(
            f"the mesh has {other[0]} cells beside {' and '.join(bodies)}; expected facets of type {facet}"
        )
    return bodies, facet


def body_cells(mesh: Any, bodies: list[str]) -> Integers:
    """The cells (M, k) of these kinds, as `PartedMesh` has them, by the numbers of the file."""
    blocks = [(block.type, np.asarray(block.data).astype(np.int64)) for block in mesh.cells if block.type in bodies]
    nodes = next((_NODES[kind] for kind in bodies if kind in _NODES), None)
    parts = [
        as_quadrilaterals(rows, nodes) if nodes is not None and kind not in _NODES else rows for kind, rows in blocks
    ]
    return np.concatenate(parts)


def solid_cells(points: Floats, cells: Integers) -> tuple[Floats, Integers]:
    """Points and cells of a body in 3D, tetrahedra turned and hexahedra of 20 nodes completed to 27.

    Raises
    ------
    InvalidArgumentError
        As `solid_mesh` does.
    """
    from enumsol.fem.solid_geometry import solid_mesh  # not for plane meshes

    if cells.shape[1] == 20:
        points, cells = completed(points, cells)
    return solid_mesh(points, cells, (4, 8, 10, 27))


def with_centres(facets: Integers, cells: Integers, name: str) -> Integers:
    """Facets (k, 8) of hexahedra that have been completed, with the nodes (k, 9) that they have now.

    Raises
    ------
    InvalidArgumentError
        One is no facet of a cell.
    """
    every = cells[:, CELL_FACETS[3, 27]].reshape(-1, 9)
    known = {tuple(key): row for row, key in enumerate(np.sort(every[:, :4], axis=1).tolist())}
    rows = [known.get(tuple(key), -1) for key in np.sort(facets[:, :4], axis=1).tolist()]
    if -1 in rows:
        raise InvalidArgumentError(f"{name} has facets that belong to no cell; expected facets of the body")
    return np.asarray(every[rows])


def facets_of_sets(
    dimension: int, cells: Integers, sets: dict[str, Integers], count: int
) -> tuple[dict[str, Integers], dict[str, Integers]]:
    """Facets on the boundary all of whose nodes belong to a set, by the set's name; and the sets with their nodes.

    Nodes from ``count`` on are those of completed cells, which no set of the file can name.
    """
    if not sets:
        return {}, sets
    outer = boundary_facets(dimension, cells)
    found = {name: outer[np.all(np.isin(outer, rows) | (outer >= count), axis=1)] for name, rows in sets.items()}
    whole = {name: np.union1d(rows, found[name]) if np.any(cells >= count) else rows for name, rows in sets.items()}
    return {name: rows for name, rows in found.items() if len(rows)}, whole
