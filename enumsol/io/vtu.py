"""States of problems in 2D and 3D as VTU files for ParaView, written by meshio."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol
from xml.etree import ElementTree

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.model.cells import KINDS, by_kind
from enumsol.model.problem import ContactProblem
from enumsol.model.problem3d import ContactProblem3D
from enumsol.model.shapes import body_mesh, contact_forces, row_frames, row_weights
from enumsol.model.statuses import STATUSES
from enumsol.support.arguments import file_path
from enumsol.support.array_arguments import array_of
from enumsol.support.files import Content, write_files, writing
from enumsol.support.messages import counted

if TYPE_CHECKING:
    import os
    from pathlib import Path
    from types import ModuleType

    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Floats, Integers


#: Numbers of statuses in files, in 2D those of their codes.
_STATUS = {status.value: float(code) for code, status in enumerate(STATUSES)} | {"slip": 2.0}
#: Directions of contact rows are known if they are orthonormal to this.
_ORTHONORMAL = 1e-8


class SolvedState(Protocol):
    """Displacements and contact forces of a problem: a FixedPoint, a TrescaSolution, or one's own."""

    @property
    def u(self) -> Floats:
        """Displacement, shape (n,) [length]."""

    @property
    def lambda_n(self) -> Floats:
        """Normal contact forces, shape (p,) [force]."""

    @property
    def lambda_t(self) -> Floats:
        """Tangential contact forces, shape (p, 2) [force]."""

    @property
    def u_n(self) -> Floats:
        """Normal displacements minus the gap, shape (p,) [length]."""

    @property
    def u_t(self) -> Floats:
        """Slips, shape (p, 2) [length]."""


def write_vtu(problem: AnyProblem, state: SolvedState | Sequence[SolvedState], path: str | os.PathLike[str]) -> None:
    """Write displacements, contact forces and stresses to a VTU file for ParaView, by meshio.

    Of one state the file at ``path`` is written. Of several, such as a RootSet, one file each is written beside it
    (for ``roots.vtu``: ``roots-0.vtu``, ``roots-1.vtu``, ...), and ``roots.pvd``, which ParaView opens to show them one
    after the other; there is no ``roots.vtu`` then, even of one root in a RootSet. The continua in ``roots.families``
    are not written.

    With ``problem.mesh`` the file holds the body, its points with their ``displacement``, and the facets of the contact
    surface as cells of their own (cell data ``contact_surface``: 0 body, 1 surface). What belongs to contact rows is
    data of the points if the rows stand for nodes, and of the facets if they stand for patches: ``lambda_n``,
    ``lambda_t1``, ``lambda_t2``, ``u_n``, ``u_t1``, ``u_t2``; ``pressure`` if the problem has areas; ``status`` (0
    open, 1 stick, 2 slip) if the state has ``statuses``; and in global axes ``contact_force``, which acts on the body,
    its tangential part ``friction_force``, and ``slip``. Elsewhere scalars are NaN and vectors zero. Vectors are left
    out where the rows do not tell their directions (patches that are held in some components).

    Without a mesh the file holds the contact nodes at ``problem.coordinates``, with the same data but no vectors.

    In 2D the points lie in the plane z = 0 and have ``displacement`` and ``contact_force``; ``lambda_n``, ``lambda_t``,
    ``u_n``, ``u_t`` and ``status`` (0 open, 1 stick, 2 slip+, 3 slip-) stand at the node that a contact row belongs to
    most.

    Where the mesh knows its Lame coefficients the cells have their mean ``stress`` (nine components in 3D; in 2D those
    in the plane, the others zero), in 3D also ``von_mises``; facets of the contact surface have NaN.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        With ``mesh`` or ``coordinates``.
    state : Root, RootSet, FixedPoint, TrescaSolution or other, or a sequence of them
        With u (n,), lambda_n (p,), lambda_t (p, 2), u_n (p,) and u_t (p, 2); in 2D lambda_t and u_t are (p,).
    path : str or path-like
        Ends in .vtu; existing files are replaced.

    Raises
    ------
    InvalidArgumentError
        There is no state, for example because all solutions of a RootSet are continua; the problem has neither mesh
        nor coordinates, or has patches and no facets; a state lacks an array or has one of another shape; there can be
        no such file.
    OutputError
        There is no room for it.
    MissingDependencyError
        meshio is not installed.

    Examples
    --------
    >>> import enumsol, pathlib, tempfile
    >>> from types import SimpleNamespace
    >>> problem = enumsol.gallery.block3d(2, 1, 1)
    >>> free = SimpleNamespace(u=problem.factorization.solve(problem.f), lambda_n=[0] * 4, lambda_t=[[0, 0]] * 4)
    >>> free.u_n, free.u_t = problem.Bn @ free.u, [[0, 0]] * 4
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     enumsol.write_vtu(problem, free, f"{folder}/free.vtu")
    ...     pathlib.Path(folder, "free.vtu").stat().st_size > 1000
    True
    """
    place = file_path(path, "path")
    if place.suffix != ".vtu":
        raise InvalidArgumentError(f"path is {str(place)!r}; expected a name that ends in .vtu")
    pictures = pictures_of(problem, state)
    several = isinstance(state, Sequence)
    places = [place.with_stem(f"{place.stem}-{k}") for k in range(len(pictures))] if several else [place]
    files: dict[Path, Content] = {
        file: partial(picture.write, file_format="vtu") for file, picture in zip(places, pictures, strict=True)
    }
    if several:
        files[place.with_suffix(".pvd")] = _collection([file.name for file in places])
    with writing(place, "path"):
        write_files(files)


def pictures_of(problem: AnyProblem, state: SolvedState | Sequence[SolvedState], what: str = "VTU files") -> list[Any]:
    """States as meshes of meshio with their data, for files that ``what`` names; see `write_vtu`.

    Raises
    ------
    InvalidArgumentError, MissingDependencyError
        As `write_vtu`.
    """
    given: object = problem
    if not isinstance(given, (ContactProblem, ContactProblem3D)):
        raise InvalidArgumentError(
            f"problem is a {type(given).__name__}; expected a ContactProblem or ContactProblem3D"
        )
    states = state if isinstance(state, Sequence) else [state]
    if not len(states):
        raise InvalidArgumentError(f"state is {_empty(states)}; expected at least one")
    meshio = MissingDependencyError.imported("meshio", what, "meshes")
    return [_picture(meshio, problem, one) for one in states]


def _empty(states: Sequence[SolvedState]) -> str:
    families = getattr(states, "families", ())
    if not families:
        return "empty"
    return f"a RootSet without isolated roots, whose {counted(len(families), 'family', 'families')} no file shows"


def _picture(meshio: ModuleType, problem: AnyProblem, state: SolvedState) -> Any:
    data = _row_data(problem, state)
    if problem.mesh is None:
        if problem.coordinates is None:
            raise InvalidArgumentError("problem has neither mesh nor coordinates; expected one of them for a picture")
        vertices = np.arange(problem.p)[:, None]
        return meshio.Mesh(_in_space(problem.coordinates), [("vertex", vertices)], point_data=data)
    u = _array(state, "u", (problem.n,))
    if isinstance(problem, ContactProblem):
        return _plane(meshio, problem, u, data)
    return _body(meshio, problem, problem.mesh, u, data | _vectors(problem, data))


def _collection(names: list[str]) -> bytes:
    """Content of the file by which ParaView shows files one after the other."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for k, name in enumerate(names):
        ElementTree.SubElement(collection, "DataSet", timestep=str(k), file=name)
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))


def _stresses(problem: AnyProblem, u: Floats) -> dict[str, Floats]:
    """Cell data of the body: stresses, where the mesh knows its Lame coefficients."""
    if problem.mesh is None or not problem.mesh.has_material:
        return {}
    from enumsol.fem.bases import cell_stresses, von_mises  # scikit-fem comes with the first stresses

    stress = cell_stresses(problem, u)
    if stress.shape[1] == 3:
        return {"stress": stress.reshape(-1, 9), "von_mises": von_mises(stress)}
    return {"stress": np.pad(stress, ((0, 0), (0, 1), (0, 1))).reshape(-1, 9)}


def _plane(meshio: ModuleType, problem: ContactProblem, u: Floats, data: dict[str, Floats]) -> Any:
    mesh = body_mesh(problem)
    nodes, count = np.asarray(row_weights(problem).argmax(axis=1)).ravel(), len(mesh.points)
    moves = mesh.displacements(u)
    forces = contact_forces(problem, data["lambda_n"], data["lambda_t"])
    point_data = {"displacement": _in_space(moves), "contact_force": _in_space(forces)}
    point_data |= {name: _spread(values, nodes, count) for name, values in data.items()}
    cells, rows = _in_blocks(2, mesh.cells)
    cell_data = {name: [values[own] for own in rows] for name, values in _stresses(problem, u).items()}
    return meshio.Mesh(_in_space(mesh.points), cells, point_data=point_data, cell_data=cell_data)


def _in_blocks(dimension: int, cells: Integers) -> tuple[list[tuple[str, Integers]], list[Integers]]:
    """Cells, or facets, of each kind by meshio's name of it, and their rows."""
    kinds = by_kind(dimension, cells)
    return [(KINDS[dimension, nodes.shape[1]].file_name, nodes) for _, nodes in kinds], [rows for rows, _ in kinds]


def _in_space(vectors: Floats) -> Floats:
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def _array(state: SolvedState, name: str, shape: tuple[int, ...]) -> Floats:
    if not hasattr(state, name):
        raise InvalidArgumentError(
            f"state is a {type(state).__name__} without {name}; expected u, lambda_n, lambda_t, u_n and u_t"
        )
    return array_of(getattr(state, name), f"{name} of the state", shape)


def _row_data(problem: AnyProblem, state: SolvedState) -> dict[str, Floats]:
    """Scalars of the contact rows, each (p,)."""
    p = problem.p
    data: dict[str, Floats] = {}
    for kind in ("lambda", "u"):
        data[f"{kind}_n"] = _array(state, f"{kind}_n", (p,))
        if isinstance(problem, ContactProblem):
            data[f"{kind}_t"] = _array(state, f"{kind}_t", (p,))
        else:
            data[f"{kind}_t1"], data[f"{kind}_t2"] = _array(state, f"{kind}_t", (p, 2)).T
    if isinstance(problem, ContactProblem3D) and problem.areas is not None:
        data["pressure"] = data["lambda_n"] / problem.areas
    statuses = getattr(state, "statuses", None)
    if statuses is not None:
        data["status"] = np.array([_STATUS[str(status)] for status in statuses])
    return data


def _vectors(problem: ContactProblem3D, data: dict[str, Floats]) -> dict[str, Floats]:
    """Vectors of the contact rows in global axes, each (p, 3); none where the rows do not tell their directions."""
    frames = row_frames(problem)
    if np.max(np.abs(frames @ frames.transpose(0, 2, 1) - np.eye(3))) > _ORTHONORMAL:
        return {}
    n, t1, t2 = frames.transpose(1, 0, 2)

    def along(first: str, second: str) -> Floats:
        return np.asarray(data[first][:, None] * t1 + data[second][:, None] * t2)

    friction = -along("lambda_t1", "lambda_t2")
    force = friction - data["lambda_n"][:, None] * n
    return {"contact_force": force, "friction_force": friction, "slip": along("u_t1", "u_t2")}


def _body(meshio: ModuleType, problem: ContactProblem3D, mesh: BodyMesh, u: Floats, data: dict[str, Floats]) -> Any:
    cells, rows = _in_blocks(3, mesh.cells)
    surface, on = ([], []) if mesh.facets is None else _in_blocks(2, mesh.facets)
    point_data: dict[str, Any] = {"displacement": mesh.displacements(u)}
    numbers = [np.full(len(part), k) for k, parts in enumerate((rows, on)) for part in parts]
    cell_data: dict[str, Any] = {"contact_surface": numbers}
    for name, values in _stresses(problem, u).items():
        others = [np.full((len(part), *values.shape[1:]), np.nan) for part in on]
        cell_data[name] = [*(values[part] for part in rows), *others]
    if mesh.rows is None:
        nodes = _nodes(problem, mesh)
        point_data |= {name: _spread(values, nodes, len(mesh.points)) for name, values in data.items()}
    else:
        moving = np.flatnonzero(mesh.rows >= 0)
        for name, values in data.items():
            on_facets = _spread(values[mesh.rows[moving]], moving, len(mesh.rows))
            nowhere = [_spread(values[:0], moving[:0], len(part)) for part in rows]
            cell_data[name] = [*nowhere, *(on_facets[part] for part in on)]
    return meshio.Mesh(mesh.points, cells + surface, point_data=point_data, cell_data=cell_data)


def _nodes(problem: ContactProblem3D, mesh: BodyMesh) -> Integers:
    """The node that each contact row stands for: of a pair not those of the other part, which are on no facet."""
    rows = sp.csr_array(problem.contact_rows @ mesh.acting.T)
    if mesh.facets is not None:
        own = np.isin(np.arange(len(mesh.points)), mesh.facets)
        rows = sp.csr_array(rows @ sp.diags_array(np.repeat(own, 3).astype(np.float64)))
        rows.eliminate_zeros()
    nodes = rows.indices // 3
    first = nodes[rows.indptr[:-1]] if np.all(np.diff(rows.indptr)) else np.full(3 * problem.p, -1)
    by_direction = first.reshape(3, problem.p)
    if (
        np.any(first < 0)
        or np.any(nodes != np.repeat(first, np.diff(rows.indptr)))
        or np.any(by_direction != by_direction[0])
    ):
        raise InvalidArgumentError(
            "problem has contact rows of more than one node, and its mesh has no facets and rows; expected both"
        )
    return np.asarray(by_direction[0])


def _spread(values: Floats, places: Integers, count: int) -> Floats:
    """Values at some of ``count`` places; elsewhere NaN for scalars and zero for vectors."""
    full = np.full((count, *values.shape[1:]), np.nan if values.ndim == 1 else 0.0)
    full[places] = values
    return full
