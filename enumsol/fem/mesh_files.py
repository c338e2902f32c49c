"""Meshes of bodies from files of mesh generators, read by meshio, and from decks.

By meshio's names of cells it is decided which of a file's cells are the body, and which are its facets.
"""

from __future__ import annotations

import contextlib
import io
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.fem.deck_meshes import DeckMesh, deck_mesh
from enumsol.fem.file_counts import refuse_partial
from enumsol.fem.meshes import ALL, SAME, PartedMesh, SolidMesh, positions
from enumsol.model.cells import KINDS, TRIANGLES, as_quadrilaterals, boundary_facets, facet_rows, numbers_of_nodes
from enumsol.support.arguments import file_path, shown
from enumsol.support.array_types import Floats, Integers, NDArray
from enumsol.support.files import DAMAGE, unreadable
from enumsol.support.messages import shortened

if TYPE_CHECKING:
    import meshio

    from enumsol.decks.model import Deck

_PHYSICAL = "gmsh:physical"
#: What meshio calls the families of a MED file, of cells and of points; numbers of groups in formats without names.
_FAMILIES = ("cell_tags", "point_tags")
_NUMBERS = ("medit:ref", "su2:tag", "CellEntityIds")
#: Suffix of the names of decks.
_DECK = ".inp"


def read_mesh(source: str | os.PathLike[str] | Any, groups: str | None = None) -> PartedMesh:
    """Mesh of a body in 2D or 3D with its named parts, from a file that meshio reads or from a meshio.Mesh.

    In 2D the cells are triangles and quadrilaterals, of first or of second order (6, 8 or 9 nodes), in 3D tetrahedra or
    hexahedra, of first or of second order (10, 20 or 27 nodes); those of 20 nodes are completed to 27, with the last
    numbers for the new nodes. The third coordinate of a plane mesh is left out; it must be the same everywhere.

    Parts are the lines (in 3D triangles or quadrilaterals) that the file holds, by the names of their cell sets or
    groups (a group without a name gets its number); without any groups all of them are named "boundary". Cells of the
    body that belong to cell sets or groups are bodies of these names, for their materials.
    Named points and point sets are parts given by nodes; where all nodes of a facet on the boundary belong to a point
    set, the facet is a part of this name, too. Nodes that belong to no cell are left out, and the others numbered from
    0 in the order of the file.

    Parameters
    ----------
    source : str, path-like or meshio.Mesh
        A gmsh (.msh) or .vtu file, or any other that meshio knows by its suffix.
    groups : str or None
        Name of cell data (integers) by which facets and cells are grouped instead, for formats without named groups.

    Raises
    ------
    InvalidArgumentError
        The file cannot be read; it holds no cells of these kinds, kinds that do not fit together, or others; it has no
        facets, or facets that belong to no cell; a plane mesh is not in the x-y plane. The message begins with the
        path.
    MissingDependencyError
        meshio is not installed, or another package that it needs for the format.

    Examples
    --------
    >>> import meshio
    >>> from enumsol import fem
    >>> points, cells = [[0, 0], [1, 0], [1, 1], [0, 1]], [("quad", [[0, 1, 2, 3]]), ("line", [[0, 1], [1, 2]])]
    >>> fem.read_mesh(meshio.Mesh(points, cells, cell_sets={"floor": [None, [0]], "wall": [None, [1]]}))
    PartedMesh with 4 nodes
      cells   1 quadrilaterals
      facets  floor (1), wall (1)
    """
    return _read(source, groups, None)


def read_solid(source: str | os.PathLike[str] | Any, groups: str | None = None) -> SolidMesh:
    """Like `read_mesh`, for bodies in 3D only; triangles and quadrilaterals are facets whatever else the file holds.

    Parameters
    ----------
    source, groups
        As in `read_mesh`.

    Raises
    ------
    InvalidArgumentError, MissingDependencyError
        As in `read_mesh`, or the mesh is a plane one, or its cells are not admissible (see `solid_stiffness`).

    Examples
    --------
    >>> import meshio
    >>> from enumsol import fem
    >>> mesh = fem.box(2, 1, 1)
    >>> fem.read_solid(meshio.Mesh(mesh.points, [("hexahedron", mesh.cells), ("quad", mesh.facets["bottom"])]))
    SolidMesh with 12 nodes
      cells   2 hexahedra
      facets  boundary (2)
    """
    return cast("SolidMesh", _read(source, groups, 3))


def _read(source: object, groups: str | None, dimension: int | None) -> PartedMesh:
    if isinstance(source, str | os.PathLike) and Path(source).suffix.lower() == _DECK:
        return _of_deck(file_path(source, "source"), groups, dimension)
    meshio = MissingDependencyError.imported("meshio", "Meshes in files", "meshes")
    if isinstance(source, meshio.Mesh):
        return _checked(source, groups, dimension, None, "")
    place = file_path(source, "source", "the name of a file or a meshio.Mesh")
    if (found := unreadable(place)) is not None:
        raise InvalidArgumentError(f"{place}: {found}; expected a mesh that meshio reads")
    try:
        mesh, said = _by_meshio(meshio, place)
        return _checked(mesh, groups, dimension, place, said)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{place}: {error}") from error


def _by_meshio(meshio: ModuleType, place: Path) -> tuple[meshio.Mesh, str]:
    """Mesh that meshio reads, and the text that it prints meanwhile."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of numpy, about files that end too early
            return meshio.read(place), said.getvalue()
    except ImportError as error:  # netCDF4 for Exodus, h5py for MED and XDMF
        package = error.name or "another package"
        raise MissingDependencyError(
            f"{place}: meshio needs {package} for this format, which is not installed; expected it, or another format"
        ) from error
    except (*DAMAGE, OSError, SystemExit, meshio.ReadError) as error:  # meshio may also exit
        reason = "" if isinstance(error, SystemExit) else str(error)
        if isinstance(error, LookupError):  # its text is the key alone
            reason = f"{type(error).__name__}: {reason}"
        reason = (reason or said.getvalue()).strip().split("\n")[0].rstrip(" .") or type(error).__name__
        raise InvalidArgumentError(
            f"meshio cannot read it ({shortened(reason)}); expected a complete file of a format that it knows"
        ) from error


def _of_deck(place: Path, groups: str | None, dimension: int | None) -> PartedMesh:
    """Mesh of a deck, which has no cell data to group by."""
    from enumsol.decks.reading import described  # not for other files

    try:
        return _parted(deck_mesh(described(place, bare=True), spelled=True), groups, dimension)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{place}: {error}") from error


def mesh_of_deck(deck: Deck) -> PartedMesh:
    """Mesh of a deck with its named parts, by names in upper case.

    Raises
    ------
    InvalidArgumentError
        As `read_mesh`.
    """
    return _parted(deck_mesh(deck), None, None)


def _checked(mesh: object, groups: str | None, dimension: int | None, place: Path | None, said: str) -> PartedMesh:
    try:
        if place is not None:
            refuse_partial(place, mesh, said)
        return _parted(mesh, groups, dimension)
    except InvalidArgumentError:
        raise
    except (IndexError, KeyError, OverflowError, TypeError, ValueError) as error:  # what meshio does not check
        reason = shortened(str(error)).rstrip(".")
        raise InvalidArgumentError(f"the arrays of the mesh do not fit together ({reason})") from error


def _parted(mesh: meshio.Mesh | DeckMesh, groups: str | None, dimension: int | None) -> PartedMesh:
    kinds = list(dict.fromkeys(block.type for block in mesh.cells))
    if dimension is None:
        spatial = any(kind.startswith(("tetra", "hexa", "wedge", "pyramid", "polyhedron")) for kind in kinds)
        dimension = 3 if spatial else 2
    bodies, facet = body_kinds(kinds, dimension)
    types, labels = (tuple(mesh.types), mesh.labels(bodies)) if isinstance(mesh, DeckMesh) else ((), None)
    cells = body_cells(mesh, bodies)
    used = np.unique(cells)
    if len(used) and not 0 <= used[0] <= used[-1] < len(mesh.points):
        raise InvalidArgumentError(
            f"the cells name nodes from {used[0]} to {used[-1]}; expected them in 0 .. {len(mesh.points) - 1}"
        )
    points = np.asarray(mesh.points)[used]
    nodes = positions(points, 3) if dimension == 3 else _plane(points)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    inside = number[cells]
    if dimension == 3:
        nodes, inside = solid_cells(nodes, inside, labels)
    sets = {name: kept for name, rows in _node_sets(mesh).items() if len(kept := _inside(number, rows, name))}
    facets = {name: _inside(number, rows, name) for name, rows in _named(mesh, facet, groups, dimension).items()}
    lost = [name for name, rows in facets.items() if np.any(rows < 0)]
    if lost:
        raise InvalidArgumentError(f"facets of {lost[0]} have nodes of no cell; expected facets on the boundary")
    if facet == "quad8":
        facets = {name: with_centres(rows, inside, name) for name, rows in facets.items()}
    found, sets = facets_of_sets(dimension, inside, sets, len(used))
    facets = {**found, **facets} if isinstance(mesh, DeckMesh) else facets or found
    if not facets:
        raise InvalidArgumentError(
            f"the mesh has no contact facets: no {facet} cells on its boundary; "
            f"expected {facet} cells, best in groups with names ({GROUPS_ONLY} its parts need some, too)"
        )
    sets = {name: rows[rows >= 0] for name, rows in sets.items() if np.any(rows >= 0)}
    made = PartedMesh if dimension == 2 else SolidMesh
    named = _grouped(mesh, bodies, groups, dimension)
    parts, others, bodies_of = (MappingProxyType(each) for each in (facets, sets, named))
    return made(nodes, inside, parts, others, bodies_of, labels, types)


def _plane(points: NDArray[Any]) -> Floats:
    """Points (N, 2) of a plane mesh."""
    if points.ndim == 2 and points.shape[1] == 3:
        nodes = positions(points, 3)
        extents = np.ptp(nodes, axis=0)
        if extents[2] > SAME * np.max(extents):
            raise InvalidArgumentError(
                f"the mesh has plane cells and z from {nodes[:, 2].min():g} to {nodes[:, 2].max():g}; "
                "expected a plane mesh with the same z everywhere, or cells of a body in 3D"
            )
        return np.ascontiguousarray(nodes[:, :2])
    return positions(points, 2)


def _inside(number: Integers, rows: Integers, name: str) -> Integers:
    """Nodes by their new numbers, -1 for those of no cell."""
    if len(rows) and not 0 <= np.min(rows) <= np.max(rows) < len(number):
        raise InvalidArgumentError(
            f"{name} names nodes from {np.min(rows)} to {np.max(rows)}; expected them in 0 .. {len(number) - 1}"
        )
    return np.asarray(number[rows])


def _node_sets(mesh: meshio.Mesh) -> dict[str, Integers]:
    """Nodes by the name of their point set or of the group of their points, in the numbers of the file."""
    sets = {str(name): np.asarray(rows, dtype=np.int64).ravel() for name, rows in mesh.point_sets.items()}
    for tag, names in _families(mesh, _FAMILIES[1]).items():
        of_family = np.flatnonzero(np.asarray(mesh.point_data[_FAMILIES[1]]) == tag)
        sets |= {name: np.union1d(sets.get(name, of_family), of_family) for name in names}
    vertices = _rows(mesh, "vertex")
    points = {name: vertices[rows].ravel() for name, rows in _grouped(mesh, ["vertex"], None, 0).items()}
    return sets | points


def _named(mesh: meshio.Mesh, facet: str, groups: str | None, dimension: int) -> dict[str, Integers]:
    """Facets by the name of their group, in the numbers of the file."""
    if groups is not None and groups not in mesh.cell_data:
        known = ", ".join(mesh.cell_data) or "none"
        raise InvalidArgumentError(f"groups is {shown(groups)}; expected the name of cell data (found {known})")
    every = _rows(mesh, facet)
    named = {name: every[rows] for name, rows in _grouped(mesh, [facet], groups, dimension - 1).items()}
    return named if named or not len(every) or _node_sets(mesh) else {ALL: every}


def _grouped(mesh: meshio.Mesh, kinds: Sequence[str], groups: str | None, dimension: int) -> dict[str, Integers]:
    """Rows of the cells of some kinds, counted through all their blocks, by the name of their cell set or group."""
    rows: dict[int, Integers] = {}
    count = 0
    for k, block in enumerate(mesh.cells):
        if block.type in kinds:
            rows[k] = np.arange(count, count := count + len(block.data))
    named: dict[str, list[Integers]] = {}
    if groups is None:
        for name, sets in mesh.cell_sets.items():
            for k in rows:
                if not name.startswith("gmsh:") and sets[k] is not None and len(sets[k]):
                    named.setdefault(name, []).append(rows[k][np.asarray(sets[k], dtype=np.int64)])
    data, names, numbered = _tags(mesh, list(rows), groups, dimension)
    if not named and data is not None:
        for k, own in rows.items():
            tags = np.asarray(mesh.cell_data[data][k]).reshape(len(own))
            for tag in np.unique(tags):
                for name in names.get(int(tag), [f"{tag:g}"] if numbered else []):
                    named.setdefault(name, []).append(own[tags == tag])
    return {name: np.concatenate(parts) for name, parts in named.items()}


def _rows(mesh: meshio.Mesh, kind: str) -> Integers:
    """Nodes of all cells of a kind, in the numbers of the file."""
    parts = [np.asarray(block.data).astype(np.int64) for block in mesh.cells if block.type == kind]
    return np.concatenate(parts) if parts else np.zeros((0, 1), dtype=np.int64)


def _tags(
    mesh: meshio.Mesh, blocks: list[int], groups: str | None, dimension: int
) -> tuple[str | None, dict[int, list[str]], bool]:
    """Cell data whose numbers group cells, the names of numbers, and whether the others are names themselves."""
    if groups is not None:
        return groups, {}, True
    numbered = dimension > 0  # gmsh keeps points of no group, too
    if _PHYSICAL in mesh.cell_data:
        names = {int(entry[0]): [name] for name, entry in mesh.field_data.items() if list(entry[1:2]) == [dimension]}
        return _PHYSICAL, names, numbered
    if _FAMILIES[0] in mesh.cell_data:
        return _FAMILIES[0], _families(mesh, _FAMILIES[0]), False
    for name in _NUMBERS if blocks else ():
        if name in mesh.cell_data:
            tags = np.concatenate([np.ravel(mesh.cell_data[name][k]) for k in blocks])
            if np.any(tags != tags[:1]):
                return name, {}, numbered
    return None, {}, False


def _families(mesh: object, name: str) -> dict[int, list[str]]:
    """The names of the groups that each family of a MED file belongs to."""
    return {int(tag): [str(group) for group in members] for tag, members in getattr(mesh, name, {}).items()}


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


def body_cells(mesh: meshio.Mesh, bodies: list[str]) -> Integers:
    """The cells (M, k) of these kinds, as `PartedMesh` has them, by the numbers of the file."""
    blocks = [(block.type, np.asarray(block.data).astype(np.int64)) for block in mesh.cells if block.type in bodies]
    nodes = next((_NODES[kind] for kind in bodies if kind in _NODES), None)
    parts = [
        as_quadrilaterals(rows, nodes) if nodes is not None and kind not in _NODES else rows for kind, rows in blocks
    ]
    return np.concatenate(parts)


def solid_cells(points: Floats, cells: Integers, labels: Integers | None = None) -> tuple[Floats, Integers]:
    """Points and cells of a body in 3D, tetrahedra turned and hexahedra of 20 nodes completed to 27.

    Raises
    ------
    InvalidArgumentError
        As `solid_mesh` does.
    """
    from enumsol.fem.solid_problems import solid_mesh  # not for plane meshes

    if cells.shape[1] == 20:
        points, cells = completed(points, cells)
    return solid_mesh(points, cells, numbers_of_nodes(3), labels)


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
