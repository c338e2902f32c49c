"""Meshes of bodies in 3D from files of mesh generators, read by meshio."""

from __future__ import annotations

import contextlib
import io
import struct
import zlib
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.checks import file_path, shown
from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.fem.solid_geometry import solid_mesh
from enumsol.fem.solid_meshes import SolidMesh

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    Integers = NDArray[np.int64]

#: The facets of each kind of cell, by meshio's names.
_FACET_OF = {"tetra": "triangle", "hexahedron": "quad"}
_IGNORED = ("vertex", "line")
_PHYSICAL = "gmsh:physical"
#: The name of all facets where nothing names groups of them.
_ALL = "boundary"
#: What meshio raises on damaged files or files of another kind; it may also exit.
_DAMAGE = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    SyntaxError,
    SystemExit,
    TypeError,
    ValueError,
    struct.error,
    zlib.error,
)


def read_solid(source: str | os.PathLike[str] | Any, groups: str | None = None) -> SolidMesh:
    """Mesh of tetrahedra or hexahedra with its named facets, from a file that meshio reads or from a meshio.Mesh.

    Facets are the triangles or quadrilaterals that the file holds, by the names of their cell sets or physical groups
    (a group without a name gets its number); without any groups all of them are named "boundary". Lines and single
    points are ignored, and nodes that belong to no cell are left out.

    Parameters
    ----------
    source : str, path-like or meshio.Mesh
        A gmsh (.msh) or .vtu file, or any other that meshio knows by its suffix.
    groups : str or None
        Name of cell data (integers) by which facets are grouped instead, for formats without named groups.

    Raises
    ------
    InvalidArgumentError
        The file cannot be read; it holds no tetrahedra or hexahedra, both, or other cells; it has no facets, or facets
        that belong to no cell; the cells are not admissible (see `solid_stiffness`). The message begins with the path.
    MissingDependencyError
        meshio is not installed.

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
    try:
        import meshio  # an extra
    except ImportError as error:
        raise MissingDependencyError.of("Meshes in files", "meshio", "solids") from error
    if isinstance(source, meshio.Mesh):
        return _solid(source, groups)
    place = file_path(source, "source", "the name of a file or a meshio.Mesh")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            mesh = meshio.read(place)
    except (*_DAMAGE, meshio.ReadError) as error:
        reason = "" if isinstance(error, SystemExit) else str(error)
        if isinstance(error, LookupError):  # its text is the key alone
            reason = f"{type(error).__name__}: {reason}"
        reason = (reason or said.getvalue()).strip().split("\n")[0].rstrip(" .") or type(error).__name__
        raise InvalidArgumentError(
            f"{place}: meshio cannot read it ({reason}); expected a complete file of a format that it knows"
        ) from error
    try:
        return _solid(mesh, groups)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{place}: {error}") from error


def _solid(mesh: Any, groups: str | None) -> SolidMesh:
    kinds = list(dict.fromkeys(block.type for block in mesh.cells if not block.type.startswith(_IGNORED)))
    bodies = [kind for kind in kinds if kind in _FACET_OF]
    strange = [kind for kind in kinds if kind not in _FACET_OF and kind not in _FACET_OF.values()]
    if strange or len(bodies) > 1:
        raise InvalidArgumentError(
            f"the mesh has cells of type {' and '.join(strange or bodies)}; expected either tetra with triangle or "
            "hexahedron with quad (of first order)"
        )
    if not bodies:
        raise InvalidArgumentError("the mesh has no tetrahedra or hexahedra; expected a body in 3D")
    facet = _FACET_OF[bodies[0]]
    if facet not in kinds:
        raise InvalidArgumentError(
            f"the mesh has no contact facets: no {facet} cells on its boundary; "
            f"expected {facet} cells, best in groups with names"
        )
    if len(kinds) > 2:
        other = next(kind for kind in kinds if kind not in (bodies[0], facet))
        raise InvalidArgumentError(f"the mesh has {other} cells beside {bodies[0]}; expected facets of type {facet}")
    cells = np.concatenate([block.data for block in mesh.cells if block.type == bodies[0]]).astype(np.int64)
    used = np.unique(cells)
    if len(used) and not 0 <= used[0] <= used[-1] < len(mesh.points):
        raise InvalidArgumentError(
            f"the cells name nodes from {used[0]} to {used[-1]}; expected them in 0 .. {len(mesh.points) - 1}"
        )
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    nodes, inside = solid_mesh(np.asarray(mesh.points)[used], number[cells])
    facets = {name: number[rows] for name, rows in _named(mesh, facet, groups).items()}
    lost = [name for name, rows in facets.items() if np.any(rows < 0)]
    if lost:
        raise InvalidArgumentError(f"facets of {lost[0]} have nodes of no cell; expected facets on the boundary")
    return SolidMesh(nodes, inside, MappingProxyType(facets))


def _named(mesh: Any, facet: str, groups: str | None) -> dict[str, Integers]:
    """Facets by the name of their group, in the numbers of the file."""
    blocks = [k for k, block in enumerate(mesh.cells) if block.type == facet]
    rows = {k: np.asarray(mesh.cells[k].data).astype(np.int64) for k in blocks}
    named: dict[str, list[Integers]] = {}
    if groups is None:
        for name, sets in mesh.cell_sets.items():
            for k in blocks:
                if not name.startswith("gmsh:") and sets[k] is not None and len(sets[k]):
                    named.setdefault(name, []).append(rows[k][np.asarray(sets[k], dtype=np.int64)])
    data = _PHYSICAL if groups is None else groups
    if groups is not None and groups not in mesh.cell_data:
        known = ", ".join(mesh.cell_data) or "none"
        raise InvalidArgumentError(f"groups is {shown(groups)}; expected the name of cell data (found {known})")
    if not named and data in mesh.cell_data:
        names = {int(entry[0]): name for name, entry in mesh.field_data.items() if len(entry) > 1 and entry[1] == 2}
        for k in blocks:
            tags = np.asarray(mesh.cell_data[data][k])
            for tag in np.unique(tags):
                name = names.get(int(tag), f"{tag:g}") if groups is None else f"{tag:g}"
                named.setdefault(name, []).append(rows[k][tags == tag])
    if not named:
        return {_ALL: np.concatenate(list(rows.values()))}
    return {name: np.concatenate(parts) for name, parts in named.items()}
