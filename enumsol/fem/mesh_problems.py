"""From a mesh with named parts to its scene and its contact problem, by a call or by a TOML file, and steps of these.

A body is of one material, or of one for each of its named parts.
"""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError, InvalidProblemError
from enumsol.fem import conditions
from enumsol.fem.bases import AXISYMMETRIC_DEGREE, nodal_basis
from enumsol.fem.bodies import (
    incompatible_of,
    is_axisymmetric,
    masses_of,
    material_of,
    nodes_on_axis,
    pieces_of,
    thermal_forces,
    thickness_of,
)
from enumsol.fem.conditions import FRICTION, Options, is_pair, refuse_old_friction
from enumsol.fem.contacts import contacts_of
from enumsol.fem.joints import joints_of
from enumsol.fem.mesh_files import in_folder, mesh_of
from enumsol.fem.meshes import PartedMesh
from enumsol.fem.scene_checks import refuse_overlaps, refuse_pairs, refuse_walls, scene_notes
from enumsol.fem.scenes import Scene
from enumsol.loading.steps import LoadStep
from enumsol.support.arguments import alpha_value, file_path, shown, text_of
from enumsol.support.files import unreadable
from enumsol.support.messages import about, shortened
from enumsol.support.plotting import checked_units
from enumsol.support.saved import LARGEST_TOML, toml_from

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from enumsol.fem.conditions import Plane
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Alpha, Floats

P = ParamSpec("P")
T = TypeVar("T")


def scene_of(source: PartedMesh | str | os.PathLike[str] | Any, options: Options) -> Scene:
    """Scene of a mesh, or of what `read_mesh` takes.

    Raises
    ------
    InvalidArgumentError
        As `mesh_problem`.
    """
    mesh = mesh_of(source, options.groups)
    options = options.with_friction_along_axes(mesh.points.shape[1])
    if options.plane is None:
        options = replace(options, plane=_plane(mesh))
    axisymmetric, material = is_axisymmetric(mesh, options), material_of(mesh, options)
    thickness = thickness_of(mesh, options.thickness)
    body = nodal_basis(mesh.points, mesh.cells, AXISYMMETRIC_DEGREE if axisymmetric else 0, mesh.labels)
    modes = incompatible_of(mesh, options)
    body = replace(body, thickness=thickness, axisymmetric=axisymmetric, incompatible=modes)
    held = conditions.supports_of(mesh, options, nodes_on_axis(mesh.points) if axisymmetric else None)
    joints = joints_of(body, mesh, options, held)
    masses = masses_of(mesh, options.density, thickness)
    contacts = contacts_of(body, mesh, options, held)
    (forces, stress), (slope, warming) = (
        thermal_forces(body, mesh, options, material, conditions.nodal_forces(body, mesh, options, which), which)
        for which in ("", "_slope")
    )
    springs = joints.padded(conditions.part_springs(body, mesh, options.spring)) + joints.springs
    scene = Scene(
        mesh, options, body, held, joints, contacts, forces, slope, sp.csc_array(springs), material,
        pieces_of(mesh, axisymmetric), masses, stress, warming,
    )  # fmt: skip
    refuse_overlaps(scene)
    refuse_walls(scene)
    refuse_pairs(scene)
    scene.coefficients  # noqa: B018 (refuses those that cannot be used)
    scene.notes.extend(scene_notes(scene))
    return scene


def _plane(mesh: PartedMesh) -> Plane:
    """Plane of a body where no option says it: strain, unless the file has axisymmetric elements or of plane stress."""
    around = [name.startswith("CAX") for name in mesh.types]
    if any(around):
        if not all(around):
            raise InvalidArgumentError(
                f"plane is not given, and the cells are elements of types {', '.join(mesh.types)}; expected "
                "axisymmetric ones only, or none"
            )
        return "axisymmetric"
    stressed = [name for name in mesh.types if name.startswith("CPS")]
    if stressed:
        raise InvalidArgumentError(
            f"plane is not given, and the cells are elements of type {stressed[0]}, which are of plane stress; "
            "expected plane = 'stress', or 'strain' if the type only carries the mesh, as in files of gmsh"
        )
    return "strain"


#: What ``pairs`` may be called in TOML files.
_PAIRS = "contact_pair"


def _taking(options: Callable[P, Options]) -> Callable[[Callable[..., T]], Callable[Concatenate[Any, P], T]]:
    """A decorator: a function of a mesh takes these options, each by its name, in place of ``**options``."""

    def decorated(made: Callable[..., T]) -> Callable[Concatenate[Any, P], T]:
        signed = inspect.signature(made)
        (mesh, _), named = signed.parameters.values(), inspect.signature(options).parameters.values()
        made.__signature__ = signed.replace(parameters=[mesh, *named])  # type: ignore[attr-defined]
        return made

    return decorated


@_taking(Options)
def mesh_problem(mesh: PartedMesh | str | os.PathLike[str] | Any, **options: Any) -> AnyProblem:
    """Contact problem of a body whose mesh has named parts.

    `mesh_scene` describes in words and in a picture what the arguments stand for.

    Contact is by nodes: every node of the contact parts that is not held has a row, including, in second order, the
    nodes between corners. On triangles with six nodes, the facets of tetrahedra of second order, only the nodes between
    corners have rows, since a uniform pressure has no part at the corners. Rows are displacements of nodes, not
    weighted, and lambda are the nodal forces that do the work on them. In 2D rows are in the order of the nodes along
    the boundary.

    Normals are those of the boundary, averaged around each node with its shape function as weight, or those of the
    obstacle. At nodes on a plane of symmetry they are projected on it; the component across it stays in the problem,
    uncoupled and at rest.

    Parameters
    ----------
    mesh : PartedMesh, path, meshio.Mesh, or mapping of names to these
        What `read_mesh` returns or takes. Parts are called by their names. Of several meshes each may be a mapping with
        ``mesh``, ``move`` [length] and ``turn``, an angle about the origin before the move [degrees], in 3D the x, y, z
        of an axis and the angle. The names of their parts then begin with that of the mesh, as in "pad.top", and the
        name of the mesh is a part of the body.
    young, poisson : float, or mapping of names to float
        Young's modulus [force / length^2] and Poisson's ratio [-], of the whole body or of every part of it
        (``mesh.bodies``) that is not orthotropic.
    orthotropic : nine numbers, or mapping of names to them, optional
        E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 of the whole body or of parts of it [force / length^2, -].
    orientation : six numbers, or mapping of names to them, optional
        Direction of axis 1 of the orthotropic material and one in the plane of axes 1 and 2; by default x and y.
    incompatible : bool, name or names, optional
        Parts of the body, or all of it, whose quadrilaterals with 4 and hexahedra with 8 nodes have incompatible modes,
        as C3D8I and CPS4I have: they bend as beams do. By default all if the elements of a deck are all of such types.
    contact : name or names
        The contact boundary, in contact with a rigid foundation.
    pairs : sequence of (slave, master) or (slave, master, gap)
        Parts of two bodies that may touch each other. The nodes of the first part are the contact nodes; each is in
        contact with the point of a facet of the second part on the line along its normal (theory, section 11.8). The
        first part may be a set of nodes (``node_sets`` of the mesh), whose normals are against those of the second at
        its points nearest to them; then there are no ``areas``. Nodes that face no facet have no contact. The gap is
        the distance along the normal, or the one that is given [length].
    plane : {"strain", "stress", "axisymmetric"}, or mapping of names to them, optional
        In 2D, whether strain or stress is plane, for the whole body or for every part of it; by default strain. It has
        to be given for a file whose elements are of plane stress (CPS4 and the like). Of an axisymmetric body x is the
        distance from the axis and y the place along it; nodes on the axis stay there; all forces and stiffnesses are
        those of the whole circumference (theory, section 11.10).
    thickness : float, or mapping of names to float
        In 2D, of the whole body or of every part of it; all forces and stiffnesses are multiplied by it. By default
        they are per unit thickness [length].
    expansion : float, or mapping of names to float, optional
        Coefficient of thermal expansion, of the whole body or of every part of it [1 / temperature].
    temperature, temperature_slope : float, (N,) array_like, or mapping of names to float, optional
        Change of temperature from the one at which the body has no stress: uniform, of every node, of parts of the body
        (``mesh.bodies``), or of parts that are given by nodes or facets; 0 for what is not named. And its derivative
        with respect to alpha; with it the last entry of u is alpha.
    density : float, or mapping of names to float, optional
        Mass per volume, of the whole body or of every part of it, for `stability`; a uniform one changes no verdict and
        need not be given [force time^2 / length^4].
    friction, friction_slope : float, in 3D also (float, float), or mapping of names to these, optional
        Coefficient friction + alpha friction_slope [-], of all contact nodes or of every contact part and of the first
        part of every pair (the slope is 0 for parts that are not named); in 3D a pair is along both axes. A node of two
        parts has the coefficient of the one that `contact` names first. Without both the coefficient is alpha; without
        one of them that one is 0.
    friction2, friction2_slope : float, or mapping of names to float, optional
        In 3D, coefficient along the second axis, in place of pairs; without both as along the first.
    axis : (3,) array_like, optional
        In 3D, direction whose projection on the tangent plane is the first axis; default as `solid_contact_problem`.
    clamp : name or names
        Parts that are held in all components.
    symmetry : name or names
        Parts in planes perpendicular to an axis, held in the direction of that axis: planes of symmetry, rollers.
    displacement, displacement_slope : mapping of names to components
        Given displacements in x, y (and z), and their derivatives with respect to alpha, each a number [length], or
        ``"free"`` or None where it is not given. With a slope the last entry of u is alpha.
    transform : mapping of names to {"rectangular": numbers} or {"cylindrical": numbers}
        Axes of the nodes of a part, in which displacements, forces and ``node_spring`` of any part are given at them.
        Rectangular: the first axis, in 3D followed by a direction in the plane of the first two; cylindrical: the
        centre, in 3D two points of the axis, for radial, tangential (and axial) ones.
    tie : sequence of (slave, master) or (slave, master, largest gap)
        Parts that are joined: each node of the first moves as the point of the second that it faces does, found as for
        pairs.
    reference : mapping of names to positions
        Reference points, which move and turn. ``clamp``, ``displacement`` (in 3D with rotations rx, ry, rz, in 2D with
        rz after the displacements [rad]), ``force``, ``moment`` and ``node_spring`` may name them.
    rigid, coupling : mapping of names of reference points to name or names of parts
        Nodes that move with the reference point as a rigid body; or nodes which the reference point follows in the
        mean, so that its force and moment are distributed over them and nothing is stiffened.
    equations : sequence of {"terms": [[node, component, coefficient], ...], "value": float, "slope": float}
        Linear equations: the sum of coefficients times displacements is value + alpha slope (0 if not given). A node is
        its number, the name of a set of one, or a reference point; components are "x", "y" (and "z"), of reference
        points also "rz", in 3D "rx", "ry", "rz".
    spring : mapping of names to (kn, kt)
        Springs to the ground along the normal and across it, per area (in 2D per length) [force / length^3].
    node_spring : mapping of names to stiffnesses
        Springs to the ground in x, y (and z) at each node of a part; or, named "A:B", between two nodes (sets of one,
        or numbers), and then also one stiffness, along the line between them [force / length].
    load, load_slope : mapping of names to vectors
        Force per area (in 2D per length) in x, y (and z), and its derivative with respect to alpha [force / length^2].
    pressure, pressure_slope : mapping of names to float
        Force per area along the inward normal, and its derivative with respect to alpha [force / length^2].
    body_force, body_force_slope : vector, or mapping of names to vectors, optional
        Force per volume, such as the weight, on the whole body or on parts of it, and its derivative with respect to
        alpha [force / length^3].
    centrifugal, centrifugal_slope : mapping of names of parts of the body to seven numbers, optional
        Of parts that turn at a constant speed: density times speed squared (in radians per time), a point on the axis
        and its direction, and its derivative with respect to alpha. At a distance r from the axis the force per volume
        is the first of them times r [force / length^4]. Points and directions have three components in 2D as well; an
        axisymmetric body turns about y.
    force, force_slope : mapping of names to vectors
        Force on each node of a part or set of nodes in x, y (and z), in 2D of the whole thickness, and its derivative
        with respect to alpha [force].
    moment, moment_slope : mapping of names of reference points to float, in 3D to (3,) array_like
        Moments on reference points, and their derivatives with respect to alpha [force length].
    gap : float, or mapping of names to float
        Initial gap along the normals, for all contact nodes or, like friction, by parts (0 for parts that are not
        named), in addition to the distance to the obstacle or within a pair; a negative gap is a press fit [length].
    obstacle : mapping of one kind to numbers, optional
        The rigid foundation of the contact parts, where it does not have the shape of the body: ``{"plane": (x, y, nx,
        ny)}`` by a point and the direction from it to the body, ``{"circle": (x, y, r)}``, or ``{"hole": (x, y, r)}``,
        a circle that the body is inside of; in 3D ``plane`` with six numbers, ``sphere`` and ``hole`` with four.
    max_rigid_displacement : float, "auto" or None
        Lets bodies that supports and springs leave free move as a whole: their rigid modes are found, and solutions are
        sought within this bound of the rigid displacement, ten times the size of the mesh for "auto" (theory, section
        14) [length]. By default such a body is refused.
    groups : str, optional
        As in `read_mesh`.

    Returns
    -------
    ContactProblem or ContactProblem3D
        With ``coordinates``, ``mesh`` and, as ``node_ids``, the numbers of the nodes in the mesh, or those that they
        have in a deck; in 3D also with ``areas``. Its ``notes``, a tuple of sentences, say what may not
        have been intended: nodes of a pair that face nothing, for example, have no contact.

    Raises
    ------
    InvalidArgumentError
        The mesh cannot be used, a part does not exist (those that do are listed), or an argument is not of the stated
        form.
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
    return scene_of(mesh, Options(**options)).problem()


def mesh_scene(mesh: PartedMesh | str | os.PathLike[str] | Any, **options: Any) -> Scene:
    """Scene that a mesh and options of `mesh_problem` describe: ``print(scene)``, ``scene.plot()``, ``scene.notes``.

    The scene lists the bodies, the parts with their areas, the resultant of the loads, the contact nodes with their
    gaps, which bodies are free to move, and what may not have been intended. ``scene.problem()`` is what `mesh_problem`
    returns.

    Parameters
    ----------
    mesh, **options
        As in `mesh_problem`.

    Returns
    -------
    Scene

    Raises
    ------
    InvalidArgumentError
        As in `mesh_problem`, or there is an option that it does not have.

    Examples
    --------
    >>> from enumsol import fem
    >>> scene = fem.mesh_scene(
    ...     fem.rectangle(4, 2).parted(), young=2.5, poisson=0.25, contact="bottom", clamp="left", friction=0.5
    ... )
    >>> print(scene)
    mesh      15 nodes, 16 triangles, from (0, 0) to (1, 1)
    bodies    the body: 16 cells, area 1, held
    ...
    contact   4 contact nodes of bottom, gap 0
    ...
    """
    check_keys(options)
    return scene_of(mesh, Options(**options))


def read_mesh_problem(path: str | os.PathLike[str]) -> AnyProblem:
    r"""Contact problem that a TOML file describes: the options of `mesh_problem`, with ``mesh`` a path from its folder.

    In the file, ``pairs`` may also be called ``contact_pair``.

    The file may also have a ``title`` and ``units`` of forces and lengths such as "N,mm", for what commands print,
    and the ``steps`` of a history, which the command ``enumsol history`` reads, see `scene_steps`.

    Parameters
    ----------
    path : str or path-like

    Raises
    ------
    InvalidProblemError
        The file cannot be read, is not TOML, lacks a key or has one that is not known, or describes no problem. The
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
    return _of_file(path, lambda scene: scene.problem())


def read_mesh_scene(path: str | os.PathLike[str]) -> Scene:
    """Scene that a TOML file describes, see `mesh_scene`.

    Parameters
    ----------
    path : str or path-like

    Raises
    ------
    InvalidProblemError, MissingDependencyError
        As `read_mesh_problem`, except that what does not make a problem may still be a scene.
    """
    return _of_file(path, lambda scene: scene)


def _of_file(path: object, made: Callable[[Scene], T]) -> T:
    place = file_path(path, "path")
    with about(place, InvalidArgumentError, InvalidProblemError, made=InvalidProblemError):
        options = toml_options(place)
        given = in_folder(options.pop("mesh", None), place.parent)
        options.pop("steps", None)  # of enumsol history
        checked_units(options.pop("units", None))
        text_of(options.pop("title", ""), "title")
        check_keys(options, also=(_PAIRS,))
        written = "{0}.{1} = {2}".format, "{0} = {2}".format
        source = refuse_old_friction(given, options, lambda *said: written[not said[1]](*said))
        return made(mesh_scene(source, **options))


def toml_options(place: Path) -> dict[str, Any]:
    """The keys and values in a TOML file.

    Raises
    ------
    InvalidArgumentError
        It cannot be read.
    """
    if (found := unreadable(place)) is not None:
        raise InvalidArgumentError(f"{found}; expected a TOML file of options")
    with place.open("rb") as file:
        content = file.read(LARGEST_TOML + 1)
    try:
        options = toml_from(content)
    except ValueError as error:
        reason = shortened(str(error))
        raise InvalidArgumentError(
            f"it is not a TOML file ({reason}); expected lines such as contact = 'floor'"
        ) from error
    if {_PAIRS, "pairs"} <= options.keys():
        raise InvalidArgumentError(f"{_PAIRS} and pairs are given; expected only one of them")
    return {"pairs" if name == _PAIRS else name: value for name, value in options.items()}


def check_keys(options: Mapping[str, Any], spelled: Callable[[str], str] = str, also: tuple[str, ...] = ()) -> None:
    """Refuse options that `mesh_problem` does not have, and the lack of those that it must have.

    ``spelled`` gives the name of an option as its user writes it, and ``also`` has names that may be meant as well.

    Raises
    ------
    InvalidArgumentError
        The closest name is given, or what is missing.
    """
    known = [option.name for option in fields(Options)]
    for name in options:
        if name not in known:
            close = difflib.get_close_matches(name, [*known, *also], n=1)
            hint = f"did you mean {close[0]}?" if close else f"expected some of mesh, {', '.join(known)}"
            raise InvalidArgumentError(f"there is no option {shown(name)}; {hint}")
    missing = [name for name in ("young", "poisson") if name not in options and "orthotropic" not in options]
    if not {"contact", "pairs"} & options.keys():
        missing.append("contact")
    if missing:
        names = ", ".join(map(spelled, missing))
        raise InvalidArgumentError(f"{names} {'is' if len(missing) == 1 else 'are'} missing")


# -- scene steps -------------------------------------------------------------------------------------------------------
# Steps of a history of a scene: each gives some of the loads of `mesh_problem` anew.

#: Options that a step may give anew.
_LOADS = (
    "displacement",
    "temperature",
    *(
        name + end
        for name in ("load", "pressure", "body_force", "centrifugal", "force", "moment")
        for end in ("", "_slope")
    ),
)


def scene_steps(scene: Scene, steps: Iterable[Mapping[str, Any]]) -> list[LoadStep]:
    """Steps for `histories` on the problem of a scene, each by what it gives anew, as ``[[steps]]`` in a TOML file.

    A step does not build on the step before: what it does not give is as in the scene. By names of parts, it gives
    values of those that it names.

    Parameters
    ----------
    scene : Scene
    steps : sequence of mappings
        Any of ``alpha``; ``friction``, as in `LoadStep`, in 3D also as a pair along both axes, or by names of all
        contact parts; ``displacement`` of nodes without contact that the scene holds; and, as in `mesh_problem`,
        ``temperature``, ``load``, ``pressure``, ``body_force``, ``centrifugal``, ``force`` and ``moment``, the last six
        also with ``_slope``.

    Returns
    -------
    list of LoadStep
        With loads, if a step gives any.

    Raises
    ------
    InvalidArgumentError
        A step is not of that form, or lacks the alpha on which its load depends; or another code made the stiffness.
    InvalidProblemError
        A step changes more than loads, displacements of nodes without contact, and friction.

    Examples
    --------
    >>> import enumsol
    >>> from enumsol import fem
    >>> scene = fem.mesh_scene(
    ...     fem.rectangle(2, 2).parted(), young=2.5, poisson=0.25, contact="bottom", clamp="left", friction=0.5
    ... )
    >>> steps = fem.scene_steps(scene, [{"pressure": {"top": 1}}, {"pressure": {"top": 1}, "force": {"right": (1, 0)}}])
    >>> enumsol.histories(scene.problem(), steps).counts
    (1, 1)
    """
    tables = list(steps)
    if scene.stiffness is not None:
        raise InvalidArgumentError("the stiffness of the scene is of another code; expected its steps in the deck")
    for number, table in enumerate(tables, 1):
        _check(number, table)
    first, loaded = scene.problem(), any(table.keys() & {*_LOADS} for table in tables)
    return [_step(scene, first, number, table, loaded) for number, table in enumerate(tables, 1)]


def refuse_other(first: AnyProblem, other: AnyProblem, step: str, instead: str = "") -> None:
    """Refuse a step to a problem that differs from the first by more than its load and friction.

    Raises
    ------
    InvalidProblemError
        The sentence begins with ``step`` and says what differs.
    """
    what = _differs(first, other)
    if what is not None:
        raise InvalidProblemError(
            f"{step} changes {what}; expected steps that change loads, friction and displacements of nodes without "
            f"contact{instead}"
        )


def _check(number: int, table: object) -> None:
    known = ("alpha", "friction", *_LOADS)
    if not isinstance(table, Mapping):
        raise InvalidArgumentError(f"step {number} is {shown(table)}; expected some of {', '.join(known)}")
    unknown = [str(name) for name in table if name not in known]
    if unknown:
        raise InvalidArgumentError(f"step {number} has {', '.join(unknown)}; expected some of {', '.join(known)}")


def _step(scene: Scene, first: AnyProblem, number: int, table: Mapping[str, Any], loaded: bool) -> LoadStep:
    options, friction = scene.options, table.get("friction")
    given: dict[str, Any] = {name: _given(getattr(options, name), table[name]) for name in _LOADS if name in table}
    along = isinstance(friction, Mapping) or (scene.dimension == 3 and is_pair(friction))
    if along:
        given |= {**dict.fromkeys(FRICTION), "friction": friction}
    with about(f"step {number}", InvalidArgumentError, InvalidProblemError):
        alpha = alpha_value(table["alpha"]) if "alpha" in table else None
        problem = scene_of(scene.mesh, replace(options, **given)).problem() if given else first
        refuse_other(first, problem, "it")
        return LoadStep(alpha, problem.friction if along else friction, _load(problem, alpha) if loaded else None)


def _load(problem: AnyProblem, alpha: Alpha | None) -> Floats:
    if alpha is None and problem.load_slope is not None:
        raise InvalidArgumentError("it has no alpha, on which its load depends; expected one")
    return problem.load_at(0 if alpha is None else alpha)


def _given(own: object, value: object) -> object:
    """An option of a scene with what a step says of it: of the parts that it names, or as a whole."""
    return {**own, **value} if isinstance(own, Mapping) and isinstance(value, Mapping) else value


def _differs(first: AnyProblem, other: AnyProblem) -> str | None:
    """Data that two problems do not share but for load and friction, in words."""
    if first.p != other.p or (first.n == other.n and (first.Bn != other.Bn).nnz):
        return "which pairs are in contact, or what is held"
    if first.n != other.n or (first.A != other.A).nnz:
        return "what is held"
    if np.any(first.gap != other.gap) or np.any(first.slip_offset != other.slip_offset):
        return "the displacement of nodes that are in contact or faced by such"
    return None
