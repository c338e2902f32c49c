"""Which cells of a mesh file are the body, and which its facets, by meshio's names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.cells import KINDS, TRIANGLES, as_quadrilaterals, boundary_facets, facet_rows, numbers_of_nodes

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats, Integers

#: By dimension: the facets of each kind of cell. Hexahedra with 20 nodes become such with 27.
FACET_OF = {d: {kind.file_name: kind.file_facets for (e, _), kind in KINDS.items() if e == d} for d in (2, 3)}
FACET_OF[3]["hexahedron20"] = "quad8"
#: Nodes of a quadrilateral.
_NODES = {KINDS[2, nodes].file_name: nodes for nodes in TRIANGLES}
#: Kinds that may come together: quadrilaterals with the triangles that they may be.
_TOGETHER = [{KINDS[2, nodes].file_name, KINDS[2, len(own)].file_name} for nodes, own in TRIANGLES.items()]
#: By dimension: other cells that files may hold.
_IGNORED = {2: ("vertex",), 3: ("vertex", "line")}
_EXPECTED = {
    2: "triangle and quad with line, or triangle6 and either quad8 or quad9 with line3",
    3: f"one of {', '.join(FACET_OF[3])} with {', '.join(FACET_OF[3].values())}",
}
_BODIES = {2: "triangles or quadrilaterals", 3: "tetrahedra or hexahedra"}
#: Facets of a hexahedron.
_SIDES = KINDS[3, 27].facets
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
    return solid_mesh(points, cells, numbers_of_nodes(3))


def completed(points: Floats, cells: Integers) -> tuple[Floats, Integers]:
    """Hexahedra with 20 nodes as such with 27 of the same shape; the new nodes have the last numbers.

    On facets with eight nodes a uniform pressure pulls at the corners; on those with nine it presses on every node.
    """
    corners, between = cells[:, :8], cells[:, 8:]
    sides = np.sort(corners[:, _SIDES[:, :4]], axis=2).reshape(-1, 4)
    _, first, number = np.unique(sides, axis=0, return_index=True, return_inverse=True)
    at = points[corners][:, _SIDES[:, :4]].sum(axis=2), points[between][:, _SIDES[:, 4:8] - 8].sum(axis=2)
    centres = (0.5 * at[1] - 0.25 * at[0]).reshape(-1, 3)[first]
    inside = 0.25 * (points[between].sum(axis=1) - points[corners].sum(axis=1))
    of_sides = len(points) + number.reshape(-1, 6)
    of_cells = len(points) + len(centres) + np.arange(len(cells))
    return np.concatenate([points, centres, inside]), np.concatenate([cells, of_sides, of_cells[:, None]], axis=1)


def with_centres(facets: Integers, cells: Integers, name: str) -> Integers:
    """Facets (k, 8) of hexahedra that have been completed, with the nodes (k, 9) that they have now.

    Raises
    ------
    InvalidArgumentError
        One is no facet of a cell.
    """
    every = cells[:, _SIDES].reshape(-1, 9)
    rows = facet_rows(facets, every, 4)
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
