"""From a mesh with named parts to its contact problem, by a call or by a TOML file."""

from __future__ import annotations

import difflib
import inspect
import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem.bases import nodal_basis
from enumsol.fem.conditions import Held, by_part, check_held, names_of, part_forces, part_springs
from enumsol.fem.construction import axes_of, problem_of
from enumsol.fem.contacts import contacts_of
from enumsol.fem.materials import body_force_of, lame_of, of_rows, thickness_of
from enumsol.fem.mesh_checks import unit_vectors
from enumsol.fem.mesh_files import read_mesh
from enumsol.fem.named_parts import PartedMesh
from enumsol.fem.pairs import Pair
from enumsol.fem.restrained import plain_dofs
from enumsol.model.mesh import BodyMesh
from enumsol.support.arguments import exact_number, file_path, finite_number, shown
from enumsol.support.array_arguments import short_vector
from enumsol.support.files import unreadable
from enumsol.support.messages import shortened

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from enumsol.fem.restrained import ContactNodes
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import ArrayLike, Floats

    Names = str | Sequence[str]
    Vectors = Mapping[str, ArrayLike] | None
    Plane = Literal["strain", "stress"]
    Coefficient = float | Sequence[float]

#: Largest TOML file that is read; one that describes a problem has a thousandth of that [bytes].
LARGEST_FILE = 1_000_000
#: What ``pairs`` may be called in TOML files.
_PAIRS = "contact_pair"


def mesh_problem(
    mesh: PartedMesh | str | os.PathLike[str] | Any,
    *,
    young: float | Mapping[str, float],
    poisson: float | Mapping[str, float],
    contact: Names = (),
    pairs: Sequence[Sequence[Any]] = (),
    plane: Plane | Mapping[str, Plane] = "strain",
    thickness: float | Mapping[str, float] = 1.0,
    friction: Coefficient | Mapping[str, Coefficient] = (0.0, 1.0),
    friction2: Coefficient | Mapping[str, Coefficient] | None = None,
    axis: ArrayLike | None = None,
    clamp: Names = (),
    symmetry: Names = (),
    displacement: Mapping[str, Sequence[Any]] | None = None,
    spring: Vectors = None,
    load: Vectors = None,
    load_slope: Vectors = None,
    pressure: Mapping[str, float] | None = None,
    pressure_slope: Mapping[str, float] | None = None,
    body_force: ArrayLike | Mapping[str, ArrayLike] | None = None,
    gap: float | Mapping[str, float] = 0.0,
    obstacle: Mapping[str, Sequence[float]] | None = None,
    groups: str | None = None,
) -> ContactProblem | ContactProblem3D:
    """Contact problem of a body whose mesh has named parts.

    Contact is by nodes: every node of the contact parts that is not held has a row, in second order the nodes between
    corners as well; of triangles with six nodes, which in 3D tetrahedra of second order have, these only, since a
    uniform pressure on them has no part at corners. Rows are displacements of nodes, not weighted, and lambda are the
    nodal forces that do the work on them. In 2D rows are in the order of the nodes along the boundary.

    Normals are those of the boundary, averaged around each node with its shape function as weight, or those of the
    obstacle. At nodes on a plane of symmetry they are projected on it; the component across it stays in the problem,
    uncoupled and at rest.

    Parameters
    ----------
    mesh : PartedMesh, path, or meshio.Mesh
        What `read_mesh` returns or takes. Parts are called by their names.
    young, poisson : float, or mapping of names to float
        Young's modulus [force / length^2] and Poisson's ratio [-], of the whole body or of every part of it
        (``mesh.bodies``).
    contact : name or names
        The contact boundary, in contact with a rigid foundation.
    pairs : sequence of (slave, master) or (slave, master, gap)
        Parts of two bodies that may touch each other. The nodes of the first part are the contact nodes; each is in
        contact with the point of a facet of the second part on the line along its normal (theory, section 11.8). Nodes
        that face no facet have no contact. The gap is the distance along the normal, or the one that is given [length].
    plane : {"strain", "stress"}, or mapping of names to them
        In 2D, of the whole body or of every part of it.
    thickness : float, or mapping of names to float
        In 2D, of the whole body or of every part of it; all forces and stiffnesses are multiplied by it. By default
        they are per unit thickness [length].
    friction : float or (F0, F1), or mapping of names to them
        Coefficient F0 + alpha F1 [-], of all contact nodes or of every contact part and of the first part of every
        pair. A node of two parts has the coefficient of the one that `contact` names first.
    friction2 : as friction, optional
        In 3D, coefficient along the second axis; default as the first.
    axis : (3,) array_like, optional
        In 3D, direction whose projection on the tangent plane is the first axis; default as `solid_contact_problem`.
    clamp : name or names
        Parts that are held in all components.
    symmetry : name or names
        Parts in planes perpendicular to an axis, held in the direction of that axis: planes of symmetry, rollers.
    displacement : mapping of names to components
        Given displacements in x, y (and z), each a number [length], or ``"free"`` or None where it is not given.
    spring : mapping of names to (kn, kt)
        Springs to the ground along the normal and across it, per area (in 2D per length) [force / length^3].
    load, load_slope : mapping of names to vectors
        Force per area (in 2D per length) in x, y (and z), and its derivative with respect to alpha [force / length^2].
    pressure, pressure_slope : mapping of names to float
        Force per area along the inward normal, and its derivative with respect to alpha [force / length^2].
    body_force : vector, or mapping of names to vectors, optional
        Force per volume, such as the weight, on the whole body or on parts of it [force / length^3].
    gap : float, or mapping of names to float
        Of all contact nodes or, as friction, by parts, 0 for those that are not named. Initial gap along the normals,
        in addition to the distance to the obstacle or within a pair; negative is a press fit [length].
    obstacle : mapping of one kind to numbers, optional
        The rigid foundation of the contact parts, where it does not have the shape of the body: ``{"plane": (x, y, nx,
        ny)}`` by a point and the direction from it to the body, ``{"circle": (x, y, r)}``, or ``{"hole": (x, y, r)}``,
        a circle that the body is inside of; in 3D ``plane`` with six numbers, ``sphere`` and ``hole`` with four.
    groups : str, optional
        As in `read_mesh`.

    Returns
    -------
    ContactProblem or ContactProblem3D
        With ``coordinates``, ``mesh`` and, as ``node_ids``, the numbers of the nodes in the mesh; in 3D also with
        ``areas``.

    Raises
    ------
    InvalidArgumentError
        The mesh cannot be used, a part does not exist (those that do are listed), or an argument is not of its form.
    InvalidProblemError
        Nothing but contact holds the body or a part of it, or the data of the problem are not admissible.

    Examples
    --------
    >>> from enumsol import fem
    >>> mesh = fem.rectangle(4, 2).parted()
    >>> problem = fem.mesh_problem(
    ...     mesh, young=2.5, poisson=0.25, clamp="left", contact="bottom", load={"top": (0.3, -1)}, friction=0.5
    ... )
    >>> problem.n, problem.p
    (24, 4)
    """
    parted = mesh if isinstance(mesh, PartedMesh) else read_mesh(mesh, groups)
    dimension = parted.points.shape[1]
    coefficients = lame_of(parted, young, poisson, plane)
    body = replace(nodal_basis(parted.points, parted.cells), thickness=thickness_of(parted, thickness))
    held = _held(parted, clamp, symmetry, displacement)
    contacts = contacts_of(body, parted, names_of(contact, "contact"), Pair.all_of(pairs), held, obstacle)
    nodes = contacts.rows
    forces = part_forces(body, parted, load, pressure)
    if body_force is not None:
        forces = forces + body.volume_forces(body_force_of(parted, body_force))
    slope = part_forces(body, parted, load_slope, pressure_slope, "_slope")
    more: dict[str, Any] = {
        "gap": contacts.gaps + of_rows(gap, "gap", contacts.parts, finite_number, 0.0),
        "node_ids": nodes.nodes.tolist(),
        "coordinates": parted.points[nodes.nodes],
        **_coefficients(dimension, contacts.parts, friction, friction2),
    }
    surface = contacts.facets if pairs else None
    if dimension == 3:
        from enumsol.fem.solid_geometry import outward  # not for plane bodies

        surface, more["areas"] = outward(contacts.facets, parted.cells), contacts.areas
    offset = held.supports.values
    springs = part_springs(body, parted, spring)
    check_held(parted, held.supports, springs)
    A = sp.csc_array(body.stiffness(*coefficients.T) + springs)
    axes = _axes(nodes, axis, dimension)
    more |= _moved(nodes, axes, offset, more["gap"])
    slopes = slope.ravel() if np.any(slope) else None
    return problem_of(
        *(A, forces.ravel(), slopes, plain_dofs(parted.points.shape), nodes, axes, held.supports),
        mesh=lambda left: BodyMesh.of_dofs(parted.points, parted.cells, left, offset, surface, lame=coefficients),
        **more,
    )


def read_mesh_problem(path: str | os.PathLike[str]) -> ContactProblem | ContactProblem3D:
    r"""Contact problem that a TOML file describes: the options of `mesh_problem`, with ``mesh`` a path from its folder.

    ``pairs`` are called ``contact_pair`` there, too.

    The file may also have the ``steps`` of a history, which the command ``enumsol history`` reads.

    Parameters
    ----------
    path : str or path-like

    Raises
    ------
    InvalidProblemError
        The file cannot be read, is no TOML, lacks a key or has one that is not known, or describes no problem. The
        message begins with the path.
    MissingDependencyError
        meshio is not installed.

    Examples
    --------
    >>> import meshio, pathlib
    >>> from enumsol import fem
    >>> cells = [("quad", [[0, 1, 2, 3]]), ("line", [[0, 1], [2, 3]])]
    >>> meshio.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], cells, cell_data={"part": [[0], [1, 2]]}).write("square.vtu")
    >>> text = "mesh = 'square.vtu'\ngroups = 'part'\nyoung = 2.5\npoisson = 0.25\nclamp = '2'\ncontact = '1'"
    >>> _ = pathlib.Path("square.toml").write_text(text)
    >>> fem.read_mesh_problem("square.toml").p
    2
    """
    place = file_path(path, "path")
    try:
        options = _toml(place)
        name = file_path(options.pop("mesh", None), "mesh", "the name of a mesh file in quotes")
        options.pop("steps", None)  # of enumsol history
        check_keys(options)
        return mesh_problem(place.parent / name, **options)
    except (InvalidArgumentError, InvalidProblemError) as error:
        raise InvalidProblemError(f"{place}: {error}") from error


def _toml(place: Path) -> dict[str, Any]:
    if (found := unreadable(place)) is not None:
        raise InvalidArgumentError(f"{found}; expected a TOML file of options")
    with place.open("rb") as file:
        content = file.read(LARGEST_FILE + 1)
    if len(content) > LARGEST_FILE:
        raise InvalidArgumentError(f"it has more than {LARGEST_FILE} bytes; expected a TOML file of options")
    try:
        options = tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # UnicodeDecodeError and TOMLDecodeError, too
        reason = shortened(str(error))
        raise InvalidArgumentError(
            f"it is no TOML file ({reason}); expected lines such as contact = 'floor'"
        ) from error
    if {_PAIRS, "pairs"} <= options.keys():
        raise InvalidArgumentError(f"{_PAIRS} and pairs are given; expected one of both")
    return {"pairs" if name == _PAIRS else name: value for name, value in options.items()}


def check_keys(options: Mapping[str, Any], spelled: Callable[[str], str] = str) -> None:
    """Refuse options that `mesh_problem` does not have, and the lack of those that it must have.

    ``spelled`` gives the name of an option as its user writes it.

    Raises
    ------
    InvalidArgumentError
        The closest name is given, or what is missing.
    """
    known = {name: p.default for name, p in inspect.signature(mesh_problem).parameters.items() if name != "mesh"}
    for name in options:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {close[0]}?" if close else f"expected some of mesh, {', '.join(known)}"
            raise InvalidArgumentError(f"there is no option {shown(name)}; {hint}")
    missing = [name for name, default in known.items() if default is inspect.Parameter.empty and name not in options]
    if not {"contact", "pairs"} & options.keys():
        missing.append("contact")
    if missing:
        names = ", ".join(map(spelled, missing))
        raise InvalidArgumentError(f"{names} {'is' if len(missing) == 1 else 'are'} missing")


def _held(mesh: PartedMesh, clamp: Any, symmetry: Any, displacement: Any) -> Held:
    held = Held(mesh)
    for part in names_of(clamp, "clamp"):
        held.clamp(part)
    for part in names_of(symmetry, "symmetry"):
        held.mirror(part)
    for part, value in by_part(displacement, "displacement").items():
        held.displace(part, value)
    return held


def _moved(nodes: ContactNodes, axes: tuple[Floats, ...], values: Floats, gaps: Floats) -> dict[str, Any]:
    """Gaps and slip offsets less what given displacements of the nodes of pairs make of them."""
    relative = np.asarray(nodes.means @ values)
    if not np.any(relative):
        return {}
    normal, *slips = (-np.sum(relative * axis, axis=1) for axis in (nodes.normals, *axes))
    return {"gap": gaps + normal, "slip_offset": slips[0] if len(slips) == 1 else np.stack(slips, axis=1)}


def _coefficients(dimension: int, parts: Sequence[str], friction: Any, second: Any) -> dict[str, Any]:
    """F0 + alpha F1 as the arguments of the problem."""
    F0, F1 = of_rows(friction, "friction", parts, _line).T
    if dimension == 2:
        if second is not None:
            raise InvalidArgumentError("friction2 is given for a plane body, which has one tangent; expected it in 3D")
        return {"friction": (F0, F1)}
    G0, G1 = (F0, F1) if second is None else of_rows(second, "friction2", parts, _line).T
    return {"friction": (F0, G0), "friction_slope": (F1, G1)}


def _line(value: Any, name: str) -> tuple[float, float]:
    if exact_number(value) is not None:
        return finite_number(value, name), 0.0
    try:
        F0, F1 = short_vector(value, name, 2)
    except InvalidArgumentError:
        raise InvalidArgumentError(
            f"{name} is {shown(value)}; expected a number, or two: F0 and F1 of F0 + alpha F1"
        ) from None
    return float(F0), float(F1)


def _axes(nodes: ContactNodes, axis: Any, dimension: int) -> tuple[Floats, ...]:
    if axis is None:
        return axes_of(None, nodes.normals)
    if dimension == 2:
        raise InvalidArgumentError("axis is given for a plane body, which has one tangent; expected it in 3D")
    direction = short_vector(axis, "axis", 3)
    first = direction - (nodes.normals @ direction)[:, None] * nodes.normals
    if np.min(np.linalg.norm(first, axis=1)) <= 1e-6 * np.linalg.norm(direction):
        raise InvalidArgumentError(f"axis is {shown(axis)}, a normal of the contact boundary; expected a tangent")
    first = unit_vectors(first, "axis")
    return first, np.cross(nodes.normals, first)
