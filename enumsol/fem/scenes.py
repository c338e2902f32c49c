"""Scene: what a mesh and its options describe, as arrays by nodes, as a problem, in words and as a picture."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem import bodies, conditions
from enumsol.fem.bases import NodalBasis
from enumsol.fem.bodies import BodyPiece
from enumsol.fem.conditions import FRICTION, Options
from enumsol.fem.contacts import Contacts, Group
from enumsol.fem.joints import Joints, resized
from enumsol.fem.meshes import PartedMesh, unit_vectors
from enumsol.fem.restrained import Body, Supports, axes_of, problem_of
from enumsol.model.cells import KINDS, boundary_facets, by_kind, edges_of, facet_outlines, facet_rows, lines_along
from enumsol.model.mesh import BodyMesh, consistent_mass
from enumsol.model.problem import given_friction
from enumsol.model.restart import afresh
from enumsol.model.shapes import acting_nodes, arrow_scale, signs
from enumsol.support.arguments import finite_number, positive_number, shown
from enumsol.support.array_arguments import short_vector
from enumsol.support.array_types import Floats, Integers
from enumsol.support.messages import counted
from enumsol.support.plotting import checked_units, in_units, kept, new_figure

if TYPE_CHECKING:
    import os

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from enumsol.fem.bodies import BodyMaterial
    from enumsol.fem.conditions import Coefficients
    from enumsol.fem.restrained import ContactRows
    from enumsol.model.problem3d import AnyProblem


#: Options that say what a part of the boundary is for.
_USES = (
    *("contact", "clamp", "symmetry", "displacement", "displacement_slope", "transform", "spring", "node_spring"),
    *("load", "load_slope", "pressure", "pressure_slope", "force", "force_slope"),
)


@dataclass(frozen=True)
class Scene:
    """Scene that a mesh and the options of `mesh_problem` describe; ``print(scene)`` says it in words.

    Attributes
    ----------
    mesh : PartedMesh
    options : Options
    body : NodalBasis
    held : Supports
    joints : Joints
    contacts : Contacts
    forces, slope : (N, d) arrays
        On all nodes, and their derivatives with respect to alpha [force].
    springs : (m, m) csc_array
        Of all displacements, those of reference points after those of nodes.
    material : BodyMaterial
    pieces : list of BodyPiece
        The connected bodies.
    masses : (M,) array or None
        Mass per volume, in 2D per area, of the cells; None where it is uniform and not given.
    stress : (M, s) array or None
        Mean stresses of the cells with no displacement, of a change of temperature [force / length^2].
    stress_slope : (M, s) array or None
        Their derivatives with respect to alpha.
    stiffness : (k, k) csc_array or None
        What another code assembled in place of the body's own: by all displacements, and behind them those that only
        its elements have [force / length].
    notes : list of str
        What may not have been intended, each in a sentence.
    """

    mesh: PartedMesh
    options: Options
    body: NodalBasis
    held: Supports
    joints: Joints
    contacts: Contacts
    forces: Floats
    slope: Floats
    springs: sp.csc_array
    material: BodyMaterial
    pieces: list[BodyPiece]
    masses: Floats | None = None
    stress: Floats | None = None
    stress_slope: Floats | None = None
    stiffness: sp.csc_array | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return int(self.mesh.points.shape[1])

    @cached_property
    def gaps(self) -> Floats:
        """Gaps of the contact nodes, (p,) [length]."""
        return self.contacts.gaps + of_rows(self.options.gap, "gap", self.contacts.parts, finite_number, 0.0)

    @cached_property
    def coefficients(self) -> dict[str, Any]:
        """Coefficients of friction and their slopes, as arguments of the problem."""
        options = self.options
        F, slope = self._along("friction", options.friction, options.friction_slope)
        second = [name for name in FRICTION[2:] if getattr(options, name) is not None]
        if self.dimension == 2:
            if second:
                raise InvalidArgumentError(
                    f"{second[0]} is given for a plane body, which has one tangent; expected it in 3D"
                )
            return {"friction": F, "friction_slope": slope}
        F2, slope2 = (F, slope)
        if second:
            F2, slope2 = self._along("friction2", options.friction2, options.friction2_slope)
        return {"friction": (F, F2), "friction_slope": (slope, slope2)}

    def _along(self, name: str, friction: Coefficients, friction_slope: Coefficients) -> tuple[Floats, Floats]:
        """Coefficients along one axis, and their slopes, of all contact nodes."""
        F, slope = given_friction(friction, friction_slope)
        other = None if friction is None else 0.0
        parts = self.contacts.parts
        return of_rows(F, name, parts, finite_number), of_rows(slope, f"{name}_slope", parts, finite_number, other)

    @cached_property
    def tangents(self) -> tuple[Floats, ...]:
        """Tangents of the contact nodes, one in 2D and two in 3D, each (p, d)."""
        return _axes(self.contacts.rows, self.options.axis, self.dimension)

    @property
    def gaps_of_groups(self) -> list[tuple[Group, Floats]]:
        """The groups of contact nodes, each with the gaps of its own."""
        return [(group, self.gaps[own]) for group, own in self.contacts.by_group]

    @cached_property
    def hold(self) -> sp.csc_array:
        """A stiffness of supports, equations and springs, (m, m)."""
        return bodies.holding(self.held, self.springs, self.joints.rows)

    @cached_property
    def moving(self) -> list[BodyPiece]:
        """The bodies, those that equations or springs join as one."""
        links = sp.csr_array(sp.vstack([self.joints.rows, self.joints.springs]))
        return bodies.joined(self.pieces, self.mesh, links) if links.nnz else self.pieces

    def uses(self, part: str) -> list[str]:
        """Uses of a part of the boundary, as the options name it."""
        found = [name for name in _USES if part in _names(getattr(self.options, name))]
        found += [
            f"{what} of {name}"
            for what in ("rigid", "coupling")
            for name, parts in (getattr(self.options, what) or {}).items()
            if part in _names(parts)
        ]
        found += [f"tie {own[0]}:{own[1]}" for own in self.options.tie if part in own[:2]]
        pairs = [group.pair for group in self.contacts.groups if group.pair is not None]
        found += [f"contact nodes of the pair {pair}" for pair in pairs if part == pair.slave]
        return found + [f"facets of the pair {pair}" for pair in pairs if part == pair.master]

    @property
    def sections(self) -> dict[str, list[str]]:
        """Lines that are printed of the scene, by their titles."""
        return {
            "mesh": _mesh(self),
            "bodies": _bodies(self),
            "material": _material(self),
            "parts": _parts(self),
            "joints": self.joints.said,
            "loads": _loads(self),
            "contact": _contact(self),
            "note": self.notes,
        }

    def __str__(self) -> str:
        return "\n".join(
            f"{title if k == 0 or title == 'note' else '':10}{line}"
            for title, lines in self.sections.items()
            for k, line in enumerate(lines)
        )

    def problem(self) -> AnyProblem:
        """Contact problem of the scene; see `mesh_problem`.

        Raises
        ------
        InvalidArgumentError, InvalidProblemError
            As `mesh_problem`.
        """
        mesh, contacts, supports = self.mesh, self.contacts, self.held
        nodes = contacts.rows
        more = {"areas": contacts.areas} if self.dimension == 3 and np.all(contacts.areas > 0) else {}
        surface = self._surface()
        gaps, coefficients = self.gaps, self.coefficients
        modes, bound = self._rigid_modes()
        mass = self._mass()
        elastic = self.stiffness
        if elastic is None:
            elastic = self.joints.padded(self.body.stiffness(self.material.elasticity))
        count = elastic.shape[0]
        forces, slope = (
            np.concatenate([own.ravel(), other, np.zeros(count - self.joints.count)])
            for own, other in ((self.forces, self.joints.forces), (self.slope, self.joints.slope))
        )
        named = self.joints.named
        problem = problem_of(
            Body(
                sp.csc_array(elastic + resized(self.springs, count)),
                forces,
                slope if np.any(slope) else None,
                supports,
                equations=self.joints.equations,
                named=named,
                warmed=self.stress_slope is not None,
            ),
            nodes,
            self.tangents,
            modes=None if modes is None else np.pad(modes, ((0, count - len(modes)), (0, 0))),
            mass=None if mass is None else resized(mass, count),
            mesh=lambda motion, moved: BodyMesh(mesh.points, mesh.cells, motion, moved, surface, **self._kept()),
            gap=gaps,
            node_ids=mesh.node_names(nodes.nodes),
            coordinates=mesh.points[nodes.nodes],
            max_rigid_displacement=bound,
            **coefficients,
            **more,
        )
        return afresh(problem, notes=tuple(self.notes))

    def _surface(self) -> Integers | None:
        """Facets of the contact surface, in 3D as seen from outside, and those around nodes without facets."""
        contacts, cells, d = self.contacts, self.mesh.cells, self.dimension
        alone = contacts.rows.nodes[contacts.areas == 0]
        if len(alone):
            outer = boundary_facets(d, cells)
            around = np.flatnonzero(np.any(np.isin(outer, alone), axis=1))
            rows = {*facet_rows(d, contacts.facets, outer), *around.tolist()}
            return outer[np.array(sorted(rows), dtype=np.int64)]
        if d == 3:
            from enumsol.fem.solid_problems import outward  # not for plane bodies

            return outward(contacts.facets, cells)
        return contacts.facets if any(group.pair is not None for group in contacts.groups) else None

    def _kept(self) -> dict[str, Floats | None]:
        """Material that the problem keeps of its mesh."""
        lame = self.material.lame
        return {
            "lame": lame,
            "elasticity": self.material.elasticity if lame is None else None,
            "initial_stress": self.stress,
            "stress_slope": self.stress_slope,
        }

    def _mass(self) -> sp.csc_array | None:
        """Consistent mass before supports, (m, m), if it is not uniform or was given."""
        if self.masses is None:
            return None
        of_nodes = consistent_mass(self.mesh.points, self.mesh.cells, self.masses, axisymmetric=self.body.axisymmetric)
        return self.joints.padded(sp.csc_array(sp.kron(of_nodes, sp.eye_array(self.dimension))))

    def _rigid_modes(self) -> tuple[Floats | None, float | None]:
        """Rigid motions that nothing holds, if a bound for them is given, and the bound; None: the default."""
        bound, about = self.options.max_rigid_displacement, (self.moving, self.mesh.points, self.hold)
        if bound is None:
            bodies.check_held(*about)
            return None, None
        largest = None if bound == "auto" else positive_number(bound, "max_rigid_displacement")
        modes = bodies.rigid_modes_of(*about)
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
        return kept(_drawn(self, checked_units(units)), file)


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


def _names(value: str | Iterable[str] | None) -> Sequence[str]:
    """The parts that an option names."""
    return [value] if isinstance(value, str) else () if value is None else list(value)


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


#: Components of a resultant below this part of all nodal forces are rounding.
_ROUNDING = 1e-12


def _mesh(scene: Scene) -> list[str]:
    mesh, d = scene.mesh, scene.dimension
    cells = [f"{len(rows)} {KINDS[d, nodes.shape[1]].name}" for rows, nodes in by_kind(d, mesh.cells)]
    extent = f"from {_vector(mesh.points.min(axis=0))} to {_vector(mesh.points.max(axis=0))}"
    return [f"{len(mesh.points)} nodes, {', '.join(cells)}, {extent}"]


def _bodies(scene: Scene) -> list[str]:
    mesh, sizes = scene.mesh, scene.body.sizes

    def size(rows: Integers) -> str:
        what = "volume" if scene.dimension == 3 or scene.body.axisymmetric else "area"
        return f"{counted(len(rows), 'cell')}, {what} {np.sum(sizes[rows]):.6g}"

    lines, said = [], set()
    for piece in (piece for piece in scene.moving if np.any(piece.nodes)):
        free = piece.free_motions(mesh.points, scene.hold)
        modes = f"{counted(free, 'rigid mode')} that nothing but contact holds" if free else "held"
        lines.append(f"{piece.name}: {size(np.flatnonzero(np.all(piece.nodes[mesh.cells], axis=1)))}, {modes}")
        said.add(piece.name)
    return [*lines, *(f"part {name}: {size(rows)}" for name, rows in mesh.bodies.items() if name not in said)]


def _material(scene: Scene) -> list[str]:
    given = [name for name in ("density", "expansion") if getattr(scene.options, name) is not None]
    laws = [name for name in ("young", "poisson", "orthotropic", "orientation") if _given(scene, name)]
    names = (*laws, *(("plane", "thickness") if scene.dimension == 2 else ()), *given)
    told = []
    for name in ("temperature", "temperature_slope"):
        if (warm := getattr(scene.options, name)) is not None:
            alone = isinstance(warm, (Mapping, int, float))
            told.append(f"{name} {_said(warm) if alone else 'by nodes'}")
    return [f"{name} {_said(getattr(scene.options, name))}" for name in names] + told


def _parts(scene: Scene) -> list[str]:
    plain = replace(scene.body, thickness=None)
    what = "area" if scene.dimension == 3 or plain.axisymmetric else "length"
    lines = []
    for name, facets in scene.mesh.facets.items():
        try:
            size = f"{what} {np.sum(plain.on_part(facets, name, lambda _: 1.0)[:, 0]):.6g}"
        except InvalidArgumentError:
            size = "not on the boundary"
        lines.append(f"{name}: {counted(len(facets), 'facet')}, {size}; {', '.join(scene.uses(name)) or 'not used'}")
    lines += [
        f"{name}: {counted(len(nodes), 'node')}; {', '.join(scene.uses(name)) or 'not used'}"
        for name, nodes in scene.mesh.node_sets.items()
        if name not in scene.mesh.facets
    ]
    return lines


def _loads(scene: Scene) -> list[str]:
    known = scene.joints
    every = [
        np.concatenate([own, more.reshape(-1, known.each)[:, : scene.dimension]])
        for own, more in ((scene.forces, scene.joints.forces), (scene.slope, scene.joints.slope))
    ]
    lines = [f"resultant {_resultant(every[0])}"]
    if np.any(every[1]):
        lines.append(f"times alpha: resultant {_resultant(every[1])}")
    return lines


def _resultant(forces: Floats) -> str:
    """The sum of nodal forces, without what rounding leaves of those that cancel."""
    total = forces.sum(axis=0)
    return _vector(np.where(np.abs(total) <= _ROUNDING * np.sum(np.abs(forces)), 0.0, total))


def _contact(scene: Scene) -> list[str]:
    lines = []
    for group, gaps in scene.gaps_of_groups:
        gap = f"gap {gaps[0]:.6g}" if np.ptp(gaps) == 0 else f"gaps from {gaps.min():.6g} to {gaps.max():.6g}"
        lines.append(f"{counted(group.count, 'contact node')} of {group}, {gap}")
    coefficients = {name: getattr(scene.options, name) for name in FRICTION}
    return [*lines, *(f"{name} {_said(value)}" for name, value in coefficients.items() if value is not None)]


def _given(scene: Scene, name: str) -> bool:
    return getattr(scene.options, name) is not None


def _said(value: float | str | Mapping[str, Any] | Sequence[float]) -> str:
    """A number, a word, several numbers, or one of these for each of several parts."""
    if isinstance(value, Mapping):
        return ", ".join(f"{_said(own)} ({part})" for part, own in value.items())
    if not isinstance(value, (str, float, int)):
        return _vector(np.asarray(value, dtype=np.float64))
    return value if isinstance(value, str) else f"{float(value):.6g}"


def _vector(values: Floats) -> str:
    return f"({', '.join(f'{float(value) + 0.0:.6g}' for value in values)})"


_BODY, _EDGE, _LOAD, _SLOPE, _CONTACT = "#dfe6ee", "#aab6c3", "#b3202c", "#d9730d", "#1f5fa8"


def _drawn(scene: Scene, units: tuple[str, str] | None = None) -> Figure:
    """A figure of a `Scene`."""
    from matplotlib.collections import LineCollection, PolyCollection  # with the first figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    mesh, d = scene.mesh, scene.dimension
    figure: Figure = new_figure(figsize=(8.0, 5.6))
    ax: Any = figure.add_subplot(**({"projection": "3d"} if d == 3 else {}))
    if d == 2:
        outlines = mesh.points[facet_outlines(mesh.cells)]
        ax.add_collection(PolyCollection(list(outlines), facecolor=_BODY, edgecolor=_EDGE, linewidth=0.5))
    else:
        faces = mesh.points[facet_outlines(boundary_facets(3, mesh.cells))]
        ax.add_collection3d(Poly3DCollection(list(faces), facecolor=_BODY, edgecolor=_EDGE, linewidth=0.3, alpha=0.25))
    for k, (name, facets) in enumerate(mesh.facets.items()):
        label = f"{name}: {', '.join(scene.uses(name)) or 'not used'}"
        if d == 2:
            along = mesh.points[lines_along(facets)]
            ax.add_collection(LineCollection(list(along), color=f"C{k}", linewidth=3, label=label))
        else:
            sides = list(mesh.points[facet_outlines(facets)])
            ax.add_collection3d(Poly3DCollection(sides, facecolor=f"C{k}", alpha=0.35, label=label))
    places = mesh.points[scene.contacts.rows.nodes]
    extent = float(np.max(np.ptp(mesh.points, axis=0)))
    ax.plot(*places.T, "o", color=_CONTACT, markersize=4, label="contact nodes and their normals", zorder=5)
    _arrows(ax, places, 0.06 * extent * scene.contacts.rows.normals, _CONTACT)
    for forces, colour, label in ((scene.forces, _LOAD, "loads"), (scene.slope, _SLOPE, "loads times alpha")):
        shown = signs(mesh.points, acting_nodes(forces), _edges(d, mesh.cells))
        if shown:
            sums = np.array([forces[group].sum(axis=0) for _, group in shown])
            long = arrow_scale(np.max(np.linalg.norm(sums, axis=1)), extent) * sums
            some = ", summed over nodes side by side" if any(len(group) > 1 for _, group in shown) else ""
            _arrows(ax, mesh.points[[node for node, _ in shown]] - long, long, colour, label + some)
    if d == 2:
        ax.autoscale_view()
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.1)
    else:
        ax.auto_scale_xyz(*mesh.points.T)
        ax.set_aspect("equal")
    for direction in "xyz"[: d if units is not None else 0]:
        getattr(ax, f"set_{direction}label")(in_units(direction, "length", units))
    figure.legend(loc="outside right upper", fontsize=7)
    return figure


def _edges(dimension: int, cells: Integers) -> Integers:
    """Edges of the boundary between neighbouring nodes, (k, 2)."""
    facets = boundary_facets(dimension, cells)
    if dimension == 3:
        return edges_of(facet_outlines(facets))
    along = lines_along(facets)
    return np.concatenate([along[:, k : k + 2] for k in range(along.shape[1] - 1)])


def _arrows(ax: Axes, places: Floats, vectors: Floats, colour: str, label: str | None = None) -> None:
    if places.shape[1] == 2:
        ax.quiver(
            *(*places.T, *vectors.T), color=colour, label=label, angles="xy", scale_units="xy", scale=1.0, width=0.004,
            zorder=4,
        )  # fmt: skip
        ax.update_datalim(np.concatenate([places, places + vectors]))
    else:
        ax.quiver(*places.T, *vectors.T, color=colour, label=label, arrow_length_ratio=0.25)
