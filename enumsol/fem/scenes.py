"""What a mesh and its options describe: bodies, supports, loads and contacts; its problem, its text and its picture.

A body is of one material, or of one for each of its named parts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem import conditions
from enumsol.fem.bases import NodalBasis, nodal_basis
from enumsol.fem.contacts import Contacts, Group, contacts_of
from enumsol.fem.mesh_checks import lame, unit_vectors
from enumsol.fem.mesh_files import read_mesh
from enumsol.fem.meshes import PartedMesh
from enumsol.fem.pairs import Pair
from enumsol.fem.restrained import ContactNodes, axes_of, plain_dofs, problem_of
from enumsol.fem.scene_checks import refuse_overlaps, refuse_pairs, refuse_walls, scene_notes
from enumsol.fem.scene_text import described, draw_scene, sections_of
from enumsol.model.mesh import BodyMesh
from enumsol.model.problem import given_friction, old_friction
from enumsol.model.restart import afresh
from enumsol.support.arguments import finite_number, one_of, positive_number, shown
from enumsol.support.array_arguments import short_vector
from enumsol.support.plotting import checked_units, kept

if TYPE_CHECKING:
    from pathlib import Path

    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Floats

#: Options that say what a part of the boundary is for.
_USES = ("contact", "clamp", "symmetry", "displacement", "spring", "load", "load_slope", "pressure", "pressure_slope")


@dataclass(frozen=True)
class Scene:
    """What a mesh and the options of `mesh_problem` describe; ``print(scene)`` says it in words.

    Attributes
    ----------
    mesh : PartedMesh
    options : mapping
        Of `mesh_problem`, by their names.
    body : NodalBasis
    held : Held
    contacts : Contacts
    forces, slope : (N, d) arrays
        On all nodes, and their derivatives with respect to alpha [force].
    springs : (d N, d N) csc_array
    lame : (2,) or (M, 2) array
    pieces : list of BodyPiece
        The connected bodies.
    """

    mesh: PartedMesh
    options: Mapping[str, Any]
    body: NodalBasis
    held: conditions.Held
    contacts: Contacts
    forces: Floats
    slope: Floats
    springs: sp.csc_array
    lame: Floats
    pieces: list[conditions.BodyPiece]

    @classmethod
    def of(cls, source: object, options: Mapping[str, Any]) -> Scene:
        """Scene of a mesh, or of what `read_mesh` takes, with all options of `mesh_problem`.

        Raises
        ------
        InvalidArgumentError
            As `mesh_problem`.
        """
        if options["friction"] is options["friction_slope"] is None:
            options = {**options, **dict(zip(("friction", "friction_slope"), given_friction(None, None), strict=True))}
        mesh = source if isinstance(source, PartedMesh) else read_mesh(source, options["groups"])
        options = along_axes(mesh.points.shape[1], options, _in_python)
        options = {**options, "plane": _plane(mesh) if options["plane"] is None else options["plane"]}
        coefficients = lame_of(mesh, options["young"], options["poisson"], options["plane"])
        thickness = thickness_of(mesh, options["thickness"])
        body = replace(nodal_basis(mesh.points, mesh.cells, labels=mesh.labels), thickness=thickness)
        held = _held(mesh, options["clamp"], options["symmetry"], options["displacement"])
        parts, pairs = conditions.names_of(options["contact"], "contact"), Pair.all_of(options["pairs"])
        contacts = contacts_of(body, mesh, parts, pairs, held, options["obstacle"])
        forces = conditions.part_forces(body, mesh, options["load"], options["pressure"])
        if options["body_force"] is not None:
            forces = forces + body.volume_forces(body_force_of(mesh, options["body_force"]))
        slope = conditions.part_forces(body, mesh, options["load_slope"], options["pressure_slope"], "_slope")
        springs, pieces = conditions.part_springs(body, mesh, options["spring"]), conditions.pieces_of(mesh)
        scene = cls(mesh, options, body, held, contacts, forces, slope, springs, coefficients, pieces)
        refuse_overlaps(scene)
        refuse_walls(scene)
        refuse_pairs(scene)
        scene.coefficients  # noqa: B018 (refuses those that cannot be used)
        return scene

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.mesh.points.shape[1])

    @cached_property
    def gaps(self) -> Floats:
        """Gaps of the contact nodes, (p,) [length]."""
        return self.contacts.gaps + of_rows(self.options["gap"], "gap", self.contacts.parts, finite_number, 0.0)

    @cached_property
    def coefficients(self) -> dict[str, Any]:
        """The coefficients of friction and their slopes, as arguments of the problem."""
        return _coefficients(self.dimension, self.contacts.parts, self.options)

    @property
    def gaps_of_groups(self) -> list[tuple[Group, Floats]]:
        """The groups of contact nodes, each with the gaps of its own."""
        groups = self.contacts.groups
        return list(zip(groups, np.split(self.gaps, np.cumsum([group.count for group in groups])[:-1]), strict=True))

    @cached_property
    def hold(self) -> sp.csc_array:
        """A stiffness of supports and springs, (d N, d N)."""
        return conditions.holding(self.held.supports, self.springs)

    @cached_property
    def notes(self) -> list[str]:
        """Sentences on what may not have been intended."""
        return scene_notes(self)

    @property
    def sections(self) -> dict[str, list[str]]:
        """Lines that are printed of the scene, by their titles."""
        return sections_of(self)

    def problem(self) -> AnyProblem:
        """The contact problem; see `mesh_problem`.

        Raises
        ------
        InvalidArgumentError, InvalidProblemError
            As `mesh_problem`.
        """
        mesh, contacts, supports, options = self.mesh, self.contacts, self.held.supports, self.options
        nodes, offset = contacts.rows, supports.values
        more: dict[str, Any] = {
            "gap": self.gaps,
            "node_ids": nodes.nodes.tolist(),
            "coordinates": mesh.points[nodes.nodes],
            **self.coefficients,
        }
        surface = contacts.facets if any(group.pair is not None for group in contacts.groups) else None
        if self.dimension == 3:
            from enumsol.fem.solid_geometry import outward  # not for plane bodies

            surface, more["areas"] = outward(contacts.facets, mesh.cells), contacts.areas
        modes = self._modes(more)
        A = sp.csc_array(self.body.stiffness(*self.lame.T) + self.springs)
        axes = _axes(nodes, options["axis"], self.dimension)
        more |= _moved(nodes, axes, offset, more["gap"])
        slopes = self.slope.ravel() if np.any(self.slope) else None
        problem = problem_of(
            *(A, self.forces.ravel(), slopes, plain_dofs(mesh.points.shape), nodes, axes, supports),
            modes=modes,
            mesh=lambda left: BodyMesh.of_dofs(mesh.points, mesh.cells, left, offset, surface, lame=self.lame),
            **more,
        )
        return afresh(problem, notes=tuple(self.notes))

    def _modes(self, more: dict[str, Any]) -> Floats | None:
        """Rigid motions that nothing holds, if a bound for them is given; the bound joins the other arguments."""
        largest, about = self.options["max_rigid_displacement"], (self.pieces, self.mesh.points, self.hold)
        if largest is None:
            conditions.check_held(*about)
            return None
        if largest != "auto":
            more["max_rigid_displacement"] = positive_number(largest, "max_rigid_displacement")
        modes = conditions.rigid_modes_of(*about)
        if modes is None:
            more.pop("max_rigid_displacement", None)
        return modes

    def plot(self, *, units: tuple[str, str] | None = None, file: str | Path | None = None) -> Any:
        """A figure of the bodies, the parts of their boundaries, forces and contact nodes with their normals.

        Parameters
        ----------
        units : (str, str), optional
            Of forces and of lengths, for the axes.
        file : path, optional
            Save the figure there.

        Raises
        ------
        InvalidArgumentError
            The file cannot be written, or ``units`` are none.
        MissingDependencyError
            matplotlib is not installed.
        """
        return kept(draw_scene(self, checked_units(units)), file)

    def uses(self, part: str) -> list[str]:
        """Words of the options on a part of the boundary."""
        found = [name for name in _USES if part in _names(self.options[name])]
        pairs = [group.pair for group in self.contacts.groups if group.pair is not None]
        found += [f"contact nodes of the pair {pair}" for pair in pairs if part == pair.slave]
        return found + [f"facets of the pair {pair}" for pair in pairs if part == pair.master]

    def __str__(self) -> str:
        return described(self)


def _plane(mesh: PartedMesh) -> str:
    """Assumption where no option gives one: plane strain, unless the file has elements of plane stress."""
    stressed = [name for name in mesh.types if name.startswith("CPS")]
    if stressed:
        raise InvalidArgumentError(
            f"plane is not given, and the cells are elements of type {stressed[0]}, which are of plane stress; "
            "expected plane = 'stress', or 'strain' if the type only carries the mesh, as in files of gmsh"
        )
    return "strain"


def _names(value: Any) -> Sequence[str]:
    """The parts that an option names."""
    return [value] if isinstance(value, str) else () if value is None else list(value)


def _held(mesh: PartedMesh, clamp: object, symmetry: object, displacement: object) -> conditions.Held:
    held = conditions.Held(mesh)
    for part in conditions.names_of(clamp, "clamp"):
        held.clamp(part)
    for part in conditions.names_of(symmetry, "symmetry"):
        held.mirror(part)
    for part, value in conditions.by_part(displacement, "displacement").items():
        held.displace(part, value)
    return held


def _moved(nodes: ContactNodes, axes: tuple[Floats, ...], values: Floats, gaps: Floats) -> dict[str, Any]:
    """Gaps and slip offsets less what given displacements of the nodes of pairs make of them."""
    relative = np.asarray(nodes.means @ values)
    if not np.any(relative):
        return {}
    normal, *slips = (-np.sum(relative * axis, axis=1) for axis in (nodes.normals, *axes))
    return {"gap": gaps + normal, "slip_offset": slips[0] if len(slips) == 1 else np.stack(slips, axis=1)}


def _coefficients(dimension: int, parts: Sequence[str], options: Mapping[str, Any]) -> dict[str, Any]:
    """Coefficients and their slopes as the arguments of the problem."""

    def along(name: str) -> tuple[Floats, Floats]:
        F, slope = given_friction(options[name], options[f"{name}_slope"])
        other = None if options[name] is None else 0.0
        return (
            of_rows(F, name, parts, finite_number),
            of_rows(slope, f"{name}_slope", parts, finite_number, other),
        )

    F, slope = along("friction")
    second = [name for name in ("friction2", "friction2_slope") if options[name] is not None]
    if dimension == 2:
        if second:
            raise InvalidArgumentError(
                f"{second[0]} is given for a plane body, which has one tangent; expected it in 3D"
            )
        return {"friction": F, "friction_slope": slope}
    F2, slope2 = along("friction2") if second else (F, slope)
    return {"friction": (F, F2), "friction_slope": (slope, slope2)}


def refuse_old_friction(source: object, options: Mapping[str, Any], written: Callable[[str, str, str], str]) -> Any:
    """Refuse pairs in 2D in the words of a file or a command; the mesh, which is read if there are any.

    ``written`` is how a number is given for an option and a part, "" for all parts.

    Raises
    ------
    InvalidArgumentError
        The sentence says what to write.
    """
    if not any(map(_is_pair, (own for name in _FRICTION for _, own in _by_part(options.get(name))))):
        return source
    mesh = read_mesh(source, options.get("groups"))
    along_axes(mesh.points.shape[1], options, written)
    return mesh


def along_axes(dimension: int, options: Mapping[str, Any], written: Callable[[str, str, str], str]) -> dict[str, Any]:
    """Options without pairs, which are coefficients along two axes in 3D, and are refused in 2D: see above."""
    found = dict(options)
    for name in _FRICTION:
        for part, own in _by_part(options.get(name)):
            if not _is_pair(own) or (dimension == 3 and not name.startswith("friction2")):
                continue
            instead = old_friction(own, *(partial(written, option, str(part)) for option in (name, f"{name}_slope")))
            more = "" if dimension == 3 or name.endswith("_slope") else f": {instead}"
            raise InvalidArgumentError(
                f"{name}{part and f' of {part}'} is the pair {shown(own)}; expected one coefficient{more}"
            )
    pairs = [name for name in _FRICTION if any(_is_pair(own) for _, own in _by_part(options.get(name)))]
    if not pairs:
        return found
    second = [name for name in ("friction2", "friction2_slope") if options.get(name) is not None]
    if second:
        raise InvalidArgumentError(f"{pairs[0]} is a pair, and {second[0]} is given; expected one of the two")
    for name in ("friction", "friction_slope"):
        other, value = name.replace("friction", "friction2"), options.get(name)
        if isinstance(value, Mapping):
            both = {part: own if _is_pair(own) else (own, own) for part, own in value.items()}
            found[name], found[other] = ({part: own[k] for part, own in both.items()} for k in (0, 1))
        elif value is not None:
            found[name], found[other] = value if _is_pair(value) else (value, value)
    return found


_FRICTION = "friction", "friction_slope", "friction2", "friction2_slope"


def _is_pair(value: object) -> bool:
    return isinstance(value, (tuple, list)) and len(value) == 2


def _by_part(value: object) -> list[tuple[Any, Any]]:
    """Values by part, "" for all parts."""
    return list(value.items()) if isinstance(value, Mapping) else [("", value)]


def _in_python(option: str, part: str, number: str) -> str:
    return f'{option}={{"{part}": {number}}}' if part else f"{option}={number}"


def _axes(nodes: ContactNodes, axis: object, dimension: int) -> tuple[Floats, ...]:
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


T = TypeVar("T")


def lame_of(mesh: PartedMesh, young: object, poisson: object, plane: object) -> Floats:
    """Lame coefficients of all cells, (2,), or of each where they differ, (M, 2).

    Raises
    ------
    InvalidArgumentError
        A constant is not admissible, a name does not exist, or a cell has no value or several.
    """
    if mesh.points.shape[1] == 3 and plane != "strain":
        raise InvalidArgumentError(f"plane is {plane!r} of a body in 3D; expected it for plane meshes only")
    values: list[Any] = [
        _of_cells(mesh, young, "young", positive_number),
        _of_cells(mesh, poisson, "poisson", finite_number),
        _of_cells(mesh, plane, "plane", lambda value, name: one_of(value, name, ("strain", "stress"))),
    ]
    if not any(isinstance(value, list) for value in values):
        return np.asarray(lame(*values))
    count = len(mesh.cells)
    each = list(zip(*(value if isinstance(value, list) else [value] * count for value in values), strict=True))
    known = {constants: lame(*constants) for constants in dict.fromkeys(each)}
    return np.array([known[constants] for constants in each])


def thickness_of(mesh: PartedMesh, value: object) -> Floats | None:
    """Thickness of every cell of a plane body, (M,); None for one [length].

    Raises
    ------
    InvalidArgumentError
        As `lame_of`, or the body is not plane.
    """
    given = _of_cells(mesh, value, "thickness", positive_number)
    if given == 1:
        return None
    if mesh.points.shape[1] == 3:
        raise InvalidArgumentError("thickness is given for a body in 3D; expected it for plane meshes only")
    return np.broadcast_to(np.array(given, dtype=np.float64), len(mesh.cells))


def body_force_of(mesh: PartedMesh, value: object) -> Floats:
    """Force per volume of every cell, (M, d); parts of the body without one have none [force / length^3].

    Raises
    ------
    InvalidArgumentError
        It is not that, or a name does not exist.
    """
    dimension = mesh.points.shape[1]
    if not isinstance(value, Mapping):
        return np.tile(short_vector(value, "body_force", dimension), (len(mesh.cells), 1))
    density = np.zeros((len(mesh.cells), dimension))
    for part, force in conditions.by_part(value, "body_force").items():
        density[mesh.body(part)] += short_vector(force, f"body_force of {part}", dimension)
    return density


def _of_cells(mesh: PartedMesh, value: object, name: str, read: Callable[[Any, str], T]) -> T | list[T]:
    """A value of all cells, or a list of one for each if it is given by names of parts of the body."""
    if not isinstance(value, Mapping):
        return read(value, name)
    found: list[T | None] = [None] * len(mesh.cells)
    of_part: dict[int, str] = {}
    for part, given in conditions.by_part(value, name).items():
        own = read(given, f"{name} of {part}")
        for row in mesh.body(part).tolist():
            if found[row] is not None and found[row] != own:
                raise InvalidArgumentError(
                    f"{name} is given for {of_part[row]} and for {part}, which share cells; expected one value"
                )
            found[row], of_part[row] = own, part
    each = [own for own in found if own is not None]
    if len(each) < len(found):
        first = found.index(None)
        others = [part for part, rows in mesh.bodies.items() if first in rows]
        raise InvalidArgumentError(
            f"{name} is not given for {len(found) - len(each)} of {len(found)} cells"
            f"{f', those of {others[0]}' if others else ', which belong to no named part'}; expected it for all"
        )
    return each


def of_rows(
    value: object, name: str, parts: Sequence[str], read: Callable[[Any, str], Any], other: object = None
) -> Floats:
    """A value of all contact nodes, or (p, ...) by the names of the parts of the boundary that they belong to.

    ``other`` is that of parts that are not named; None: all have to be.

    Raises
    ------
    InvalidArgumentError
        It is not that, or a name is none of the parts.
    """
    if not isinstance(value, Mapping):
        return np.array(read(value, name))
    given = {part: read(own, f"{name} of {part}") for part, own in conditions.by_part(value, name).items()}
    present = list(dict.fromkeys(parts))
    for part in given:
        if part not in present:
            raise InvalidArgumentError(
                f"{name} is given for {part}, which has no contact nodes; expected some of {', '.join(present)}"
            )
    missing = [part for part in present if part not in given]
    if missing and other is None:
        raise InvalidArgumentError(f"{name} is not given for {', '.join(missing)}; expected it for all contact parts")
    return np.array([given.get(part, other) for part in parts])
