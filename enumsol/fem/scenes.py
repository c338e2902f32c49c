"""Scene of a mesh and its options: the materials of its cells, its problem, its text and its picture.

A body is of one material, or of one for each of its named parts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem import conditions
from enumsol.fem.bases import nodal_basis
from enumsol.fem.contacts import contacts_of
from enumsol.fem.mesh_checks import lame, unit_vectors
from enumsol.fem.mesh_files import read_mesh
from enumsol.fem.meshes import PartedMesh
from enumsol.fem.restrained import Body, axes_of, problem_of
from enumsol.fem.scene_checks import refuse_overlaps, refuse_pairs, refuse_walls, scene_notes
from enumsol.fem.scene_data import SceneData
from enumsol.fem.scene_text import described, draw_scene, sections_of
from enumsol.model.mesh import BodyMesh
from enumsol.model.restart import afresh
from enumsol.support.arguments import finite_number, one_of, positive_number, shown
from enumsol.support.array_arguments import short_vector
from enumsol.support.plotting import checked_units, kept

if TYPE_CHECKING:
    import os

    from enumsol.fem.options import Options, Plane
    from enumsol.fem.restrained import ContactRows
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Floats


@dataclass(frozen=True)
class Scene(SceneData):
    """Scene that a mesh and the options of `mesh_problem` describe; ``print(scene)`` says it in words."""

    @classmethod
    def of(cls, source: PartedMesh | str | os.PathLike[str] | Any, options: Options) -> Scene:
        """Scene of a mesh, or of what `read_mesh` takes.

        Raises
        ------
        InvalidArgumentError
            As `mesh_problem`.
        """
        mesh = source if isinstance(source, PartedMesh) else read_mesh(source, options.groups)
        options = options.with_friction_along_axes(mesh.points.shape[1])
        if options.plane is None:
            options = replace(options, plane=_plane(mesh))
        coefficients = lame_of(mesh, options)
        thickness = thickness_of(mesh, options.thickness)
        body = replace(nodal_basis(mesh.points, mesh.cells, labels=mesh.labels), thickness=thickness)
        held = conditions.Held.of(mesh, options)
        contacts = contacts_of(body, mesh, options, held)
        forces = conditions.part_forces(body, mesh, options.load, options.pressure)
        if options.body_force is not None:
            forces = forces + body.volume_forces(body_force_of(mesh, options.body_force))
        slope = conditions.part_forces(body, mesh, options.load_slope, options.pressure_slope, "_slope")
        springs, pieces = conditions.part_springs(body, mesh, options.spring), conditions.pieces_of(mesh)
        scene = cls(mesh, options, body, held, contacts, forces, slope, springs, coefficients, pieces)
        refuse_overlaps(scene)
        refuse_walls(scene)
        refuse_pairs(scene)
        scene.coefficients  # noqa: B018 (refuses those that cannot be used)
        return scene

    @cached_property
    def notes(self) -> list[str]:
        """Notes on what may not have been intended, each in a sentence."""
        return scene_notes(self)

    @property
    def sections(self) -> dict[str, list[str]]:
        """Lines that are printed of the scene, by their titles."""
        return sections_of(self, self.notes)

    def problem(self) -> AnyProblem:
        """Contact problem of the scene; see `mesh_problem`.

        Raises
        ------
        InvalidArgumentError, InvalidProblemError
            As `mesh_problem`.
        """
        mesh, contacts, supports = self.mesh, self.contacts, self.held.supports
        nodes = contacts.rows
        surface = contacts.facets if any(group.pair is not None for group in contacts.groups) else None
        more: dict[str, Any] = {}
        if self.dimension == 3:
            from enumsol.fem.solid_problems import outward  # not for plane bodies

            surface, more = outward(contacts.facets, mesh.cells), {"areas": contacts.areas}
        gaps, coefficients = self.gaps, self.coefficients
        modes, bound = self._rigid_modes()
        stiffness = sp.csc_array(self.body.stiffness(*self.lame.T) + self.springs)
        axes = _axes(nodes, self.options.axis, self.dimension)
        # less what given displacements of the nodes of pairs make of gaps and slips
        moved = np.asarray(nodes.means @ supports.values)
        normal, *slips = (-np.sum(moved * axis, axis=1) for axis in (nodes.normals, *axes))
        slip_offset = slips[0] if len(slips) == 1 else np.stack(slips, axis=1)
        problem = problem_of(
            Body(stiffness, self.forces.ravel(), self.slope.ravel() if np.any(self.slope) else None, supports),
            nodes,
            axes,
            modes=modes,
            mesh=lambda left: BodyMesh.of_dofs(mesh.points, mesh.cells, left, supports.values, surface, lame=self.lame),
            gap=gaps + normal,
            slip_offset=slip_offset,
            node_ids=nodes.nodes.tolist(),
            coordinates=mesh.points[nodes.nodes],
            max_rigid_displacement=bound,
            **coefficients,
            **more,
        )
        return afresh(problem, notes=tuple(self.notes))

    def _rigid_modes(self) -> tuple[Floats | None, float | None]:
        """Rigid motions that nothing holds, if a bound for them is given, and the bound; None: the default."""
        bound, about = self.options.max_rigid_displacement, (self.pieces, self.mesh.points, self.hold)
        if bound is None:
            conditions.check_held(*about)
            return None, None
        largest = None if bound == "auto" else positive_number(bound, "max_rigid_displacement")
        modes = conditions.rigid_modes_of(*about)
        return modes, None if modes is None else largest

    def plot(self, *, units: tuple[str, str] | None = None, file: str | os.PathLike[str] | None = None) -> Any:
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

    def __str__(self) -> str:
        return described(self, self.notes)


def _plane(mesh: PartedMesh) -> Plane:
    """Plane of a body where no option says it: strain, unless the file has elements of plane stress."""
    stressed = [name for name in mesh.types if name.startswith("CPS")]
    if stressed:
        raise InvalidArgumentError(
            f"plane is not given, and the cells are elements of type {stressed[0]}, which are of plane stress; "
            "expected plane = 'stress', or 'strain' if the type only carries the mesh, as in files of gmsh"
        )
    return "strain"


def _axes(nodes: ContactRows, axis: object, dimension: int) -> tuple[Floats, ...]:
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


def lame_of(mesh: PartedMesh, options: Options) -> Floats:
    """Lame coefficients of all cells, (2,), or of each where they differ, (M, 2).

    Raises
    ------
    InvalidArgumentError
        A constant is not admissible, a name does not exist, or a cell has no value or several.
    """
    plane = options.plane
    if mesh.points.shape[1] == 3 and plane != "strain":
        raise InvalidArgumentError(f"plane is {plane!r} of a body in 3D; expected it for plane meshes only")
    values: list[Any] = [
        _of_cells(mesh, options.young, "young", positive_number),
        _of_cells(mesh, options.poisson, "poisson", finite_number),
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
