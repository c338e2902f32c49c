"""Meshes of bodies from files of mesh generators, read by meshio, and from decks; several of them in one scene.

By meshio's names of cells it is decided which of a file's cells are the body, and which are its facets.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import warnings
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.fem.deck_parts import OF_GMSH, deck_mesh
from enumsol.fem.meshes import ALL, SAME, FileMesh, PartedMesh, SolidMesh, as_cells_have, joined, positions
from enumsol.model.cells import KINDS, boundary_facets, by_kind, numbers_of_nodes, padded
from enumsol.support.arguments import file_path, shown
from enumsol.support.array_arguments import real_array, short_vector
from enumsol.support.array_types import Floats, Integers, NDArray
from enumsol.support.files import DAMAGE, unreadable
from enumsol.support.messages import about, shortened

if TYPE_CHECKING:
    import meshio

    from enumsol.decks.model import Deck

_PHYSICAL = "gmsh:physical"
#: What meshio calls the families of a MED file, of cells and of points; numbers of groups in formats without names.
_FAMILIES = ("cell_tags", "point_tags")
_NUMBERS = ("medit:ref", "su2:tag", "CellEntityIds")
#: Suffix of the names of decks.
_DECK = ".inp"


def read_mesh(
    source: str | os.PathLike[str] | Any, groups: str | None = None, *, ignore: Collection[str] = ()
) -> PartedMesh:
    """Mesh of a body in 2D or 3D with its named parts, from a file that meshio reads or from a meshio.Mesh.

    In 2D the cells are triangles and quadrilaterals, of first or of second order (6, 8 or 9 nodes), in 3D tetrahedra,
    wedges and hexahedra, of first or of second order (10; 15 or 18; 20 or 27 nodes), all of them in one mesh where they
    share whole facets. Wedges of 15 nodes are completed to 18 and hexahedra of 20 to 27, with the last numbers for the
    new nodes. Quadrilaterals and hexahedra (not of 27 nodes) that name nodes twice become the triangles, wedges or
    tetrahedra that they are. The third coordinate of a plane mesh is left out; it must be the same everywhere.

    Parts are the lines (in 3D triangles or quadrilaterals) that the file holds, by the names of their cell sets or
    groups (a group without a name gets its number); without any groups all of them are named "boundary". Cells of the
    body that belong to cell sets or groups are bodies of these names, for their materials.
    Named points and point sets are parts given by nodes; where all nodes of a facet on the boundary belong to a point
    set, the facet is a part of this name, too. Nodes that belong to no cell are left out, and the others numbered from
    0 in the order of the file.

    Parameters
    ----------
    source : str, path-like or meshio.Mesh
        A gmsh (.msh) or .vtu file, or any other that meshio knows by its suffix; or a deck of CalculiX or Abaqus
        (.inp), which is read without meshio. Its surfaces, and sets of elements that only lie on a body, are facets.
    groups : str or None
        Name of cell data (integers) by which facets and cells are grouped instead, for formats without named groups.
    ignore : collection of str
        Cards and types of elements of a deck that are left out, such as ``["S4"]``.

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
    return _read(source, groups, None, ignore)


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


def _read(source: object, groups: str | None, dimension: int | None, ignore: Collection[str] = ()) -> PartedMesh:
    if isinstance(source, str | os.PathLike) and Path(source).suffix.lower() == _DECK:
        return _of_deck(file_path(source, "source"), groups, dimension, ignore)
    if ignore:
        raise InvalidArgumentError(f"ignore is {shown(ignore)} for a mesh that is no deck; expected an .inp file")
    meshio = MissingDependencyError.imported("meshio", "Meshes in files", "meshes")
    if isinstance(source, meshio.Mesh):
        return _checked(source, groups, dimension, None, "")
    place = file_path(source, "source", "the name of a file or a meshio.Mesh")
    if (found := unreadable(place)) is not None:
        raise InvalidArgumentError(f"{place}: {found}; expected a mesh that meshio reads")
    with about(place, InvalidArgumentError):
        mesh, said = _by_meshio(meshio, place)
        return _checked(mesh, groups, dimension, place, said)


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


def _of_deck(place: Path, groups: str | None, dimension: int | None, ignore: Collection[str]) -> PartedMesh:
    """Mesh of a deck, which has no cell data to group by."""
    from enumsol.decks.reading import described  # not for other files

    with about(place, InvalidArgumentError):
        if groups is not None:
            raise _no_groups(groups, ())
        return _parted(deck_mesh(described(place, ignore=ignore, bare=True), spelled=True), dimension)


def mesh_of_deck(deck: Deck) -> PartedMesh:
    """Mesh of a deck with its named parts, by names in upper case.

    Raises
    ------
    InvalidArgumentError
        As `read_mesh`.
    """
    return _parted(deck_mesh(deck), None)


def _checked(mesh: object, groups: str | None, dimension: int | None, place: Path | None, said: str) -> PartedMesh:
    try:
        if place is not None:
            refuse_partial(place, mesh, said)
        return _parted(_of_meshio(mesh, groups, dimension), dimension)
    except InvalidArgumentError:
        raise
    except (IndexError, KeyError, OverflowError, TypeError, ValueError) as error:  # what meshio does not check
        reason = shortened(str(error)).rstrip(".")
        raise InvalidArgumentError(f"the arrays of the mesh do not fit together ({reason})") from error


def _of_meshio(mesh: meshio.Mesh, groups: str | None, dimension: int | None) -> FileMesh:
    """Contents of a meshio.Mesh, of a body of this dimension; None: by its cells."""
    kinds = list(dict.fromkeys(block.type for block in mesh.cells))
    dimension = dimension or _dimension(kinds)
    bodies, sides = body_kinds(kinds, dimension)
    blocks = [np.asarray(block.data).astype(np.int64) for block in mesh.cells if block.type in bodies]
    facets, named = _named(mesh, sides, groups, dimension), _grouped(mesh, bodies, groups, dimension)
    return FileMesh(np.asarray(mesh.points), kinds, blocks, facets, _node_sets(mesh), named)


def _dimension(kinds: list[str]) -> int:
    spatial = any(kind.startswith(("tetra", "hexa", "wedge", "pyramid", "polyhedron")) for kind in kinds)
    return 3 if spatial else 2


def _parted(file: FileMesh, dimension: int | None) -> PartedMesh:
    dimension = dimension or _dimension(file.kinds)
    (_, sides), blocks, labels = body_kinds(file.kinds, dimension), file.blocks, file.labels
    used = np.unique(np.concatenate([block.ravel() for block in blocks]))
    if len(used) and not 0 <= used[0] <= used[-1] < len(file.points):
        raise InvalidArgumentError(
            f"the cells name nodes from {used[0]} to {used[-1]}; expected them in 0 .. {len(file.points) - 1}"
        )
    points = file.points[used]
    nodes = positions(points, 3) if dimension == 3 else _plane(points)
    nodes, cells = joined(nodes, [np.searchsorted(used, block) for block in blocks], labels)
    # a collapsed cell may name nodes between corners that it has no more
    used, kept = np.concatenate([used, np.full(len(nodes) - len(used), -1)]), np.unique(cells)
    nodes, inside, of_file = nodes[kept], np.searchsorted(kept, cells), used[kept]
    number = np.full(len(file.points), -1)
    number[of_file[of_file >= 0]] = np.flatnonzero(of_file >= 0)
    if dimension == 3:
        from enumsol.fem.solid_problems import solid_mesh  # not for plane meshes

        nodes, inside = solid_mesh(nodes, inside, numbers_of_nodes(3), labels)
    sets = {name: kept for name, rows in file.node_sets.items() if len(kept := _inside(number, rows, name))}
    facets = {name: _inside(number, rows, name) for name, rows in file.facets.items()}
    lost = [name for name, rows in facets.items() if np.any(rows < 0)]
    if lost:
        raise InvalidArgumentError(f"facets of {lost[0]} have nodes of no cell; expected facets on the boundary")
    if "quad8" in sides and dimension == 3:
        facets = {name: as_cells_have(rows, inside, name) for name, rows in facets.items()}
    found, sets = facets_of_sets(dimension, inside, sets, int(np.sum(of_file >= 0)))
    of_deck = file.node_labels is not None
    facets = {**found, **facets} if of_deck else facets or found
    if not facets and of_deck:
        raise InvalidArgumentError(
            "the deck names no part of its boundary; expected *SURFACE, or *NSET with all nodes of a facet"
        )
    if not facets:
        raise InvalidArgumentError(
            f"the mesh has no contact facets: no {' or '.join(sides)} cells on its boundary; "
            f"expected {' or '.join(sides)} cells, best in groups with names ({GROUPS_ONLY} its parts need some, too)"
        )
    sets = {name: rows[rows >= 0] for name, rows in sets.items() if np.any(rows >= 0)}
    made = PartedMesh if dimension == 2 else SolidMesh
    parts, others, bodies = (MappingProxyType(each) for each in (facets, sets, dict(file.bodies)))
    names = None if file.node_labels is None else _node_labels(file.node_labels, of_file, inside)
    return made(nodes, inside, parts, others, bodies, labels, file.types, names)


def _node_labels(labels: Sequence[int | str], of_file: Integers, cells: Integers) -> tuple[int | str, ...]:
    """Names of nodes in a deck; those of completed cells, rows -1 of the file, by the nodes at the corners around."""
    names: list[int | str] = [labels[row] if row >= 0 else "" for row in of_file.tolist()]
    for _, nodes in by_kind(3, cells) if np.any(of_file < 0) else ():
        kind = KINDS[3, nodes.shape[1]]
        around_nodes = [(int(side[8]), side[:4]) for side in kind.sides if len(side) == 9]
        if kind.form == "hexahedron":
            around_nodes.append((-1, np.arange(kind.corners)))
        for inner, around in around_nodes:
            for row in np.flatnonzero(of_file[nodes[:, inner]] < 0):
                names[nodes[row, inner]] = "/".join(str(names[node]) for node in nodes[row, around])
    return tuple(names)


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
    vertices = _rows(mesh, ["vertex"])
    points = {name: vertices[rows].ravel() for name, rows in _grouped(mesh, ["vertex"], None, 0).items()}
    return sets | points


def _named(mesh: meshio.Mesh, sides: list[str], groups: str | None, dimension: int) -> dict[str, Integers]:
    """Facets by the name of their group, in the numbers of the file."""
    if groups is not None and groups not in mesh.cell_data:
        raise _no_groups(groups, mesh.cell_data)
    every = _rows(mesh, sides)
    named = {name: every[rows] for name, rows in _grouped(mesh, sides, groups, dimension - 1).items()}
    return named if named or not len(every) or _node_sets(mesh) else {ALL: every}


def _no_groups(groups: str, known: Collection[str]) -> InvalidArgumentError:
    found = ", ".join(known) or "none"
    return InvalidArgumentError(f"groups is {shown(groups)}; expected the name of cell data (found {found})")


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
                if not name.startswith(OF_GMSH) and sets[k] is not None and len(sets[k]):
                    named.setdefault(name, []).append(rows[k][np.asarray(sets[k], dtype=np.int64)])
    data, names, numbered = _tags(mesh, list(rows), groups, dimension)
    if not named and data is not None:
        for k, own in rows.items():
            tags = np.asarray(mesh.cell_data[data][k]).reshape(len(own))
            for tag in np.unique(tags):
                for name in names.get(int(tag), [f"{tag:g}"] if numbered else []):
                    named.setdefault(name, []).append(own[tags == tag])
    return {name: np.concatenate(parts) for name, parts in named.items()}


def _rows(mesh: meshio.Mesh, kinds: Sequence[str]) -> Integers:
    """Nodes of all cells of some kinds, in the numbers of the file; those of fewer repeat their last."""
    parts = [np.asarray(block.data).astype(np.int64) for block in mesh.cells if block.type in kinds]
    return padded(parts) if parts else np.zeros((0, 1), dtype=np.int64)


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


#: By dimension: the facets of each kind of cell. Hexahedra with 20 nodes become such with 27, wedges with 15 with 18.
FACET_OF = {
    d: {
        kind.file_name: list(dict.fromkeys(KINDS[d - 1, len(side)].file_name for side in kind.sides))
        for (e, _), kind in KINDS.items()
        if e == d
    }
    for d in (2, 3)
}
# collapsed ones have triangles, too
FACET_OF[3] |= {"hexahedron": ["quad", "triangle"], "hexahedron20": ["quad8", "triangle6"]}
FACET_OF[3]["wedge15"] = ["triangle6", "quad8"]
#: By dimension: other cells that files may hold.
_IGNORED = {2: ("vertex",), 3: ("vertex", "line")}
_EXPECTED = {d: ", ".join(cells) for d, cells in FACET_OF.items()}
_BODIES = {2: "triangles or quadrilaterals", 3: "tetrahedra, wedges or hexahedra"}
#: Why gmsh leaves cells out.
GROUPS_ONLY = "gmsh writes only what is in physical groups, if there are any:"
#: What makes gmsh write other cells.
_HINTS = {
    "pyramid": " (pyramids join tetrahedra to hexahedra: mesh all of a body by one of them)",
    "": " (for cells of higher order set Mesh.ElementOrder = 2 in gmsh)",
}


def body_kinds(kinds: list[str], dimension: int) -> tuple[list[str], list[str]]:
    """Kinds of the cells of the body, and those that its facets may be of.

    Raises
    ------
    InvalidArgumentError
        There is no body, or there are other cells.
    """
    facets_of = FACET_OF[dimension]
    others = [kind for kind in kinds if not kind.startswith(_IGNORED[dimension])]
    bodies = [kind for kind in others if kind in facets_of]
    every = {kind for sides in facets_of.values() for kind in sides}
    strange = [kind for kind in others if kind not in facets_of and kind not in every]
    if strange:
        hint = next(text for start, text in _HINTS.items() if any(kind.startswith(start) for kind in strange))
        raise InvalidArgumentError(
            f"the mesh has cells of type {' and '.join(strange)}; expected some of {_EXPECTED[dimension]}{hint}"
        )
    if not bodies:
        raise InvalidArgumentError(
            f"the mesh has no {_BODIES[dimension]}; expected a body in {dimension}D ({GROUPS_ONLY} the body needs one, "
            "too)"
        )
    sides = list(dict.fromkeys(kind for body in bodies for kind in facets_of[body]))
    other = [kind for kind in others if kind not in (*bodies, *sides)]
    if other:
        raise InvalidArgumentError(
            f"the mesh has {other[0]} cells beside {' and '.join(bodies)}; expected facets of type {' or '.join(sides)}"
        )
    return bodies, sides


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


# -- placing -----------------------------------------------------------------------------------------------------------
# Several meshes in one scene, each placed where it belongs.

#: What may be said of a mesh that is placed.
_PLACING = {"mesh", "move", "turn"}


def mesh_of(source: object, groups: str | None = None) -> PartedMesh:
    """Mesh of what `mesh_problem` takes: a mesh, a file, or several by names, which begin the names of their parts.

    Raises
    ------
    InvalidArgumentError
        As `read_mesh`; or a mesh is not placed by ``move`` and ``turn``, or is plane beside one in 3D.
    """
    if isinstance(source, PartedMesh):
        return source
    if not isinstance(source, Mapping):
        return read_mesh(source, groups)
    if not len(source) or not all(isinstance(name, str) and name for name in source):
        raise InvalidArgumentError(f"mesh is {shown(source)}; expected names with their meshes")
    return _together({name: _placed(value, name, groups) for name, value in source.items()})


def in_folder(source: object, folder: Path) -> Any:
    """Description of a mesh by a file in this folder, with paths from the folder.

    Raises
    ------
    InvalidArgumentError
        It names no file.
    """
    if isinstance(source, Mapping):
        return {
            name: {**value, "mesh": in_folder(value.get("mesh"), folder)}
            if isinstance(value, Mapping)
            else in_folder(value, folder)
            for name, value in source.items()
        }
    if source is None:
        raise InvalidArgumentError("mesh is missing; expected the name of a mesh file in quotes")
    return folder / file_path(source, "mesh", "the name of a mesh file in quotes")


def _placed(value: Any, name: str, groups: str | None) -> PartedMesh:
    """A mesh that is turned about the origin, then moved."""
    given = dict(value) if isinstance(value, Mapping) else {"mesh": value}
    if "mesh" not in given or given.keys() - _PLACING:
        raise InvalidArgumentError(f"mesh {name} is {shown(value)}; expected a mesh, and where wanted move and turn")
    mesh = mesh_of(given["mesh"], groups)
    d = mesh.points.shape[1]
    move = short_vector(given["move"], f"move of {name}", d) if "move" in given else np.zeros(d)
    points = mesh.points @ _rotation(given["turn"], name, d).T if "turn" in given else mesh.points
    return type(mesh)(points + move, mesh.cells, mesh.facets, mesh.node_sets, mesh.bodies, None, mesh.types)


def _rotation(value: object, name: str, dimension: int) -> Floats:
    """The rotation by an angle in degrees, in 3D about an axis through the origin: [x, y, z, degrees]."""
    numbers = np.atleast_1d(real_array(value, f"turn of {name}", error=InvalidArgumentError))
    if numbers.shape != (1 if dimension == 2 else 4,) or (dimension == 3 and not np.any(numbers[:3])):
        raise InvalidArgumentError(
            f"turn of {name} is {shown(value)}; expected an angle in degrees, in 3D after the x, y, z of an axis"
        )
    quarters = numbers[-1] / 90.0
    whole = quarters == np.round(quarters)  # exact where it can be
    c, s = (np.round(f(np.pi / 2 * quarters)) if whole else f(np.radians(numbers[-1])) for f in (np.cos, np.sin))
    if dimension == 2:
        return np.array([[c, -s], [s, c]])
    x, y, z = axis = numbers[:3] / np.linalg.norm(numbers[:3])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(c * np.eye(3) + s * cross + (1 - c) * np.outer(axis, axis))


def _together(meshes: Mapping[str, PartedMesh]) -> PartedMesh:
    """Several meshes as one: names of parts begin with those of the meshes, which are parts of the body as well."""
    dimensions = {mesh.points.shape[1] for mesh in meshes.values()}
    if len(dimensions) > 1:
        raise InvalidArgumentError("mesh has plane meshes and meshes in 3D; expected one or the other")
    nodes = np.cumsum([0, *(len(mesh.points) for mesh in meshes.values())])
    cells = np.cumsum([0, *(len(mesh.cells) for mesh in meshes.values())])

    def named(which: str, starts: Integers) -> dict[str, Integers]:
        return {
            f"{name}.{part}": rows + first
            for (name, mesh), first in zip(meshes.items(), starts[:-1], strict=True)
            for part, rows in getattr(mesh, which).items()
        }

    whole = {name: np.arange(*cells[k : k + 2]) for k, name in enumerate(meshes)}
    return (PartedMesh if dimensions == {2} else SolidMesh)(
        np.concatenate([mesh.points for mesh in meshes.values()]),
        padded([mesh.cells + first for mesh, first in zip(meshes.values(), nodes[:-1], strict=True)]),
        named("facets", nodes),
        named("node_sets", nodes),
        {**whole, **named("bodies", cells)},
        types=tuple(dict.fromkeys(kind for mesh in meshes.values() for kind in mesh.types)),
    )


# -- file counts -------------------------------------------------------------------------------------------------------
# Contents of mesh files, counted without meshio and compared with what it read of them.
#
# Formats of lines of text are counted here, in which meshio passes over what it does not know.

#: Cards of Nastran that are cells of bodies and facets; CTRIAX and the like are written with a longer name.
_CARDS = ("CTRI", "CTRAX", "CQUAD", "CTETRA", "CHEXA", "CPENTA", "CPYRA", "CPLST", "CSHEAR")
#: Messages of meshio about cells that it leaves out.
_LEFT_OUT = re.compile(
    r"meshio doesn't know (?:Gmf)?(?:Edges|Tri|Quad|Tetra|Hexa|Prism|Pyramid)\w*|could not parse line"
    r"|\$(?:Nodes|Elements) not closed|End-of-file reached before"
)


def refuse_partial(place: Path, mesh: meshio.Mesh, said: str) -> None:
    """Refuse an incomplete mesh that meshio read.

    Parameters
    ----------
    place : Path
    mesh : meshio.Mesh
        Mesh that meshio read.
    said : str
        Text that meshio printed meanwhile.

    Raises
    ------
    InvalidArgumentError
        It left cells or nodes out.
    """
    if left := _LEFT_OUT.search(said):
        raise InvalidArgumentError(
            f"meshio left out a part of it ({left.group()}); expected a format that it reads whole, .msh or .vtu for "
            "example"
        )
    counted = {".bdf": _nastran, ".fem": _nastran, ".nas": _nastran, ".msh": _gmsh}.get(place.suffix.lower())
    found = counted(place) if counted is not None else {}
    cells = sum(len(block.data) for block in mesh.cells if block.type not in ("vertex", "line"))
    every = sum(len(block.data) for block in mesh.cells)
    for what, read in (("nodes", len(mesh.points)), ("cells", every), ("cells of two or three dimensions", cells)):
        if what in found and found[what] != read:
            raise InvalidArgumentError(
                f"meshio reads {read} of {found[what]} {what}; expected a file that it reads whole, .msh in version "
                "4.1 or .vtu for example"
            )


def _nastran(place: Path) -> dict[str, int]:
    """Cards of nodes and of cells."""
    nodes = cells = 0
    with place.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            word = re.split(r"[,*\s]", line[:8].upper(), maxsplit=1)[0]
            nodes += word == "GRID"
            cells += word.startswith(_CARDS)
    return {"nodes": nodes, "cells of two or three dimensions": cells}


def _gmsh(place: Path) -> dict[str, int]:
    """Numbers of nodes and cells that the sections of a text file announce; empty for a binary file."""
    found: dict[str, int] = {}
    with place.open("rb") as file:
        if file.readline().strip() != b"$MeshFormat" or file.readline().split()[1:2] != [b"0"]:
            return {}
        for line in file:
            section = {b"$Nodes": "nodes", b"$Elements": "cells"}.get(line.strip())
            if section is not None:
                numbers = next(file, b"0").split()  # in version 4 behind the number of blocks
                found[section] = found.get(section, 0) + int(numbers[min(1, len(numbers) - 1)])
    return found
