"""Options that describe what a mesh stands for, and what acts on its named parts: supports, loads, springs, obstacles.

Each function checks its argument, names it in messages, and gives plain arrays by nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.mesh_files import mesh_of
from enumsol.fem.meshes import SAME, unit_vectors
from enumsol.fem.restrained import RIGHT_ANGLE, Supports
from enumsol.model.problem import given_friction, old_friction
from enumsol.support.arguments import finite_number, one_of, shown
from enumsol.support.array_arguments import real_array, short_vector

if TYPE_CHECKING:
    from typing import Literal

    from enumsol.fem.bases import NodalBasis
    from enumsol.fem.meshes import PartedMesh
    from enumsol.support.array_types import ArrayLike, Floats, Integers, Mask

    Names = str | Sequence[str]
    Vectors = Mapping[str, ArrayLike] | None
    Plane = Literal["strain", "stress", "axisymmetric"]
    Coefficients = float | Mapping[str, float] | None
    Written = Callable[[str, str, str], str]


#: Options that are coefficients of friction along the first axis and along the second.
FRICTION = "friction", "friction_slope", "friction2", "friction2_slope"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of `mesh_problem`, which says what each stands for."""

    young: float | Mapping[str, float] | None = None
    poisson: float | Mapping[str, float] | None = None
    orthotropic: Sequence[float] | Mapping[str, Sequence[float]] | None = None
    orientation: Sequence[float] | Mapping[str, Sequence[float]] | None = None
    incompatible: bool | Names | None = None
    contact: Names = ()
    pairs: Sequence[Sequence[Any]] = ()
    plane: Plane | Mapping[str, Plane] | None = None
    thickness: float | Mapping[str, float] = 1.0
    expansion: float | Mapping[str, float] | None = None
    temperature: ArrayLike | Mapping[str, float] | None = None
    temperature_slope: ArrayLike | Mapping[str, float] | None = None
    density: float | Mapping[str, float] | None = None
    friction: float | Mapping[str, float] | None = None
    friction_slope: float | Mapping[str, float] | None = None
    friction2: float | Mapping[str, float] | None = None
    friction2_slope: float | Mapping[str, float] | None = None
    axis: ArrayLike | None = None
    clamp: Names = ()
    symmetry: Names = ()
    displacement: Mapping[str, Sequence[Any]] | None = None
    displacement_slope: Mapping[str, Sequence[Any]] | None = None
    transform: Mapping[str, Mapping[str, ArrayLike]] | None = None
    tie: Sequence[Sequence[Any]] = ()
    reference: Vectors = None
    rigid: Mapping[str, Names] | None = None
    coupling: Mapping[str, Names] | None = None
    equations: Sequence[Mapping[str, Any]] = ()
    spring: Vectors = None
    node_spring: Mapping[str, Any] | None = None
    load: Vectors = None
    load_slope: Vectors = None
    pressure: Mapping[str, float] | None = None
    pressure_slope: Mapping[str, float] | None = None
    body_force: ArrayLike | Mapping[str, ArrayLike] | None = None
    body_force_slope: ArrayLike | Mapping[str, ArrayLike] | None = None
    centrifugal: Mapping[str, ArrayLike] | None = None
    centrifugal_slope: Mapping[str, ArrayLike] | None = None
    force: Vectors = None
    force_slope: Vectors = None
    moment: Mapping[str, Any] | None = None
    moment_slope: Mapping[str, Any] | None = None
    gap: float | Mapping[str, float] = 0.0
    obstacle: Mapping[str, Sequence[float]] | None = None
    max_rigid_displacement: float | Literal["auto"] | None = None
    groups: str | None = None

    def with_friction_along_axes(self, dimension: int) -> Options:
        """Options without pairs of coefficients, which are those along two axes in 3D, and with a coefficient.

        Raises
        ------
        InvalidArgumentError
            A pair is given where one coefficient is expected.
        """
        F, slope = self.friction, self.friction_slope
        if F is slope is None:
            F, slope = given_friction(None, None)
        given = dict(zip(FRICTION, (F, slope, self.friction2, self.friction2_slope), strict=True))
        return replace(self, **along_axes(dimension, given, _in_python))


def refuse_old_friction(source: object, options: Mapping[str, Any], written: Written) -> Any:
    """Mesh, read only if an option is a pair; pairs in 2D are refused in the words of a file or a command.

    ``written`` is how a number is given for an option and a part, "" for all parts.

    Raises
    ------
    InvalidArgumentError
        The sentence says what to write.
    """
    if not any(map(is_pair, (own for name in FRICTION for _, own in _by_part(options.get(name))))):
        return source
    mesh = mesh_of(source, options.get("groups"))
    along_axes(mesh.points.shape[1], options, written)
    return mesh


def along_axes(dimension: int, options: Mapping[str, Any], written: Written) -> dict[str, Any]:
    """Options without pairs, which are coefficients along two axes in 3D, and are refused in 2D."""
    found = dict(options)
    for name in FRICTION:
        for part, own in _by_part(options.get(name)):
            if not is_pair(own) or (dimension == 3 and not name.startswith("friction2")):
                continue
            instead = old_friction(own, *(partial(written, option, str(part)) for option in (name, f"{name}_slope")))
            more = "" if dimension == 3 or name.endswith("_slope") else f": {instead}"
            raise InvalidArgumentError(
                f"{name}{part and f' of {part}'} is the pair {shown(own)}; expected one coefficient{more}"
            )
    pairs = [name for name in FRICTION if any(is_pair(own) for _, own in _by_part(options.get(name)))]
    if not pairs:
        return found
    second = [name for name in ("friction2", "friction2_slope") if options.get(name) is not None]
    if second:
        raise InvalidArgumentError(f"{pairs[0]} is a pair, and {second[0]} is given; expected one of the two")
    for name in ("friction", "friction_slope"):
        other, value = name.replace("friction", "friction2"), options.get(name)
        if isinstance(value, Mapping):
            both = {part: own if is_pair(own) else (own, own) for part, own in value.items()}
            found[name], found[other] = ({part: own[k] for part, own in both.items()} for k in (0, 1))
        elif value is not None:
            found[name], found[other] = value if is_pair(value) else (value, value)
    return found


def is_pair(value: object) -> bool:
    """True of two coefficients, along the axes of a body in 3D."""
    return isinstance(value, (tuple, list)) and len(value) == 2


def _by_part(value: object) -> list[tuple[Any, Any]]:
    """Values by part, "" for all parts."""
    return list(value.items()) if isinstance(value, Mapping) else [("", value)]


def _in_python(option: str, part: str, number: str) -> str:
    return f'{option}={{"{part}": {number}}}' if part else f"{option}={number}"


#: What stands for a component that is not given.
FREE = "free"
#: Numbers that an obstacle takes in 2D and 3D: a point and a normal, or a centre and a radius.
_OBSTACLES: dict[str, dict[int, tuple[str, ...]]] = {
    "plane": {2: ("x", "y", "nx", "ny"), 3: ("x", "y", "z", "nx", "ny", "nz")},
    "circle": {2: ("x", "y", "r")},
    "sphere": {3: ("x", "y", "z", "r")},
    "hole": {2: ("x", "y", "r"), 3: ("x", "y", "z", "r")},
}


def names_of(value: object, name: str) -> list[str]:
    """Value as names of parts: a text, or several."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, (list, tuple)) or not all(isinstance(part, str) for part in names):
        raise InvalidArgumentError(f"{name} is {shown(value)}; expected the name of a part, or a list of names")
    return list(names)


def by_part(value: object, name: str) -> dict[str, Any]:
    """Value as a mapping of names of parts."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(part, str) for part in value):
        raise InvalidArgumentError(f"{name} is {shown(value)}; expected names of parts with their values")
    return dict(value)


# -- supports --------------------------------------------------------------------------------------------------------


def supports_of(mesh: PartedMesh, options: Options, axis: Integers | None = None) -> Supports:
    """Displacements that the options clamp, symmetry and displacement give; nodes ``axis`` stay on the axis x = 0.

    Raises
    ------
    InvalidArgumentError
        One names no part or is not of its form, or they contradict each other.
    """
    shape = mesh.points.shape
    found = Supports.none(shape)
    points, frames = by_part(options.reference, "reference"), frames_of(mesh, options.transform)
    for part in names_of(options.clamp, "clamp"):
        if part in points:
            continue
        for component in range(shape[1]):
            fix(found, part, mesh.nodes(part), component)
    for part in names_of(options.symmetry, "symmetry"):
        nodes = mesh.nodes(part)
        flat = _flat(mesh, nodes)
        if len(flat) != 1:
            where = "no plane" if len(flat) == 0 else f"{len(flat)} planes"
            raise InvalidArgumentError(
                f"symmetry {part} lies in {where} perpendicular to an axis; expected a part of the boundary in one "
                "such plane"
            )
        fix(found, part, nodes, flat[0])
        found.mirrored[nodes, flat[0]] = True
    for part, given in displacements_of(options, shape[1], points).items():
        if part in points:
            continue
        nodes = mesh.nodes(part)
        nodes = nodes[~frames.own[nodes]]
        for component, (value, slope) in given.items():
            fix(found, part, nodes, component, value, slope)
        # rollers in a plane are a plane of symmetry, however they are given
        if len(nodes) and len(given) == 1 and (0.0, 0.0) in given.values() and _flat(mesh, nodes) == [*given]:
            found.mirrored[nodes, next(iter(given))] = True
    if axis is not None and len(axis):
        fix(found, "the axis of the axisymmetric body", axis, 0)
        found.mirrored[axis, 0] = True
    return found


def displacements_of(
    options: Options, dimension: int, points: Iterable[str] = ()
) -> dict[str, dict[int, tuple[float, float]]]:
    """Given displacements of parts by components, each at alpha = 0 and its derivative; one not given is 0.

    ``points`` are the names of reference points, of which rotations may be given as well.
    """
    found: dict[str, dict[int, tuple[float, float]]] = {}
    for k, name in enumerate(("displacement", "displacement_slope")):
        for part, value in by_part(getattr(options, name), name).items():
            rotations = dimension * (dimension - 1) // 2 if part in points and _long(value, dimension) else 0
            for component, entry in _components(value, f"{name} of {part}", dimension + rotations).items():
                both = [*found.setdefault(part, {}).get(component, (0.0, 0.0))]
                both[k] = entry
                found[part][component] = (both[0], both[1])
    return found


def _long(value: object, dimension: int) -> bool:
    return isinstance(value, (list, tuple, np.ndarray)) and len(value) > dimension


def _components(value: object, name: str, dimension: int) -> dict[int, float]:
    """The components of a displacement that are given; ``free`` or None leaves one free."""
    if not isinstance(value, (list, tuple, np.ndarray)) or len(value) != dimension:
        raise InvalidArgumentError(
            f"{name} is {shown(value)}; expected {dimension} components, each a number or {FREE!r}"
        )
    return {
        component: finite_number(entry, name)
        for component, entry in enumerate(value)
        if entry is not None and not (isinstance(entry, str) and entry == FREE)
    }


def _flat(mesh: PartedMesh, nodes: Integers) -> list[int]:
    """Axes to which a plane through all of these nodes is perpendicular."""
    extent = float(np.max(np.ptp(mesh.points, axis=0)))
    return np.flatnonzero(np.ptp(mesh.points[nodes], axis=0) <= SAME * extent).tolist()


def fix(supports: Supports, part: str, nodes: Integers, component: int, value: float = 0.0, slope: float = 0.0) -> None:
    """Fix a component of nodes at value + alpha slope.

    Raises
    ------
    InvalidArgumentError
        It is fixed at another one already.
    """
    fixed = supports.fixed
    for array, own, times in ((supports.values, value, ""), (supports.slopes, slope, " alpha")):
        differ = fixed[nodes, component] & (array[nodes, component] != own)
        if np.any(differ):
            node = int(nodes[np.argmax(differ)])
            raise InvalidArgumentError(
                f"{part} moves node {node} by {own:g}{times} in {'xyz'[component]}, and another part that shares it by "
                f"{array[node, component]:g}{times}; expected one displacement"
            )
        array[nodes, component] = own
    fixed[nodes, component] = True


# -- axes of nodes ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frames:
    """Axes of nodes, in which displacements, forces and springs at nodes are given.

    Attributes
    ----------
    axes : (N, d, d) array
        Rows of length one, perpendicular to each other.
    own : (N,) bool array
        Where they are not x, y (and z).
    """

    axes: Floats
    own: Mask


def frames_of(mesh: PartedMesh, transform: object) -> Frames:
    """Axes that the option transform gives to nodes of parts.

    Raises
    ------
    InvalidArgumentError
        It is not of its form, a node is on the axis of a cylinder, or two parts give it different axes.
    """
    count, d = mesh.points.shape
    axes, own = np.tile(np.eye(d), (count, 1, 1)), np.zeros(count, dtype=bool)
    for part, value in by_part(transform, "transform").items():
        given, nodes = by_part(value, f"transform of {part}"), mesh.nodes(part)
        if len(given) != 1 or next(iter(given)) not in ("rectangular", "cylindrical"):
            raise InvalidArgumentError(
                f"transform of {part} is {shown(value)}; expected rectangular or cylindrical with its numbers"
            )
        ((kind, numbers),) = given.items()
        entries = short_vector(numbers, f"{kind} of {part}", 2 if d == 2 else 6)
        found = _along(entries, part) if kind == "rectangular" else _around(mesh.points[nodes], entries, part)
        found = np.broadcast_to(found, (len(nodes), d, d))
        differ = own[nodes] & np.any(np.abs(found - axes[nodes]) > RIGHT_ANGLE, axis=(1, 2))
        if np.any(differ):
            raise InvalidArgumentError(
                f"transform of {part} gives node {nodes[np.argmax(differ)]} other axes than that of another part; "
                "expected one"
            )
        axes[nodes], own[nodes] = found, True
    return Frames(axes, own)


def _along(numbers: Floats, part: str) -> Floats:
    """Axes along directions: x' and, in 3D, one in the plane of x' and y'."""
    first, second = (numbers, np.array([-numbers[1], numbers[0]])) if len(numbers) == 2 else np.split(numbers, 2)
    third = np.cross(first, second) if len(numbers) == 6 else None
    if not np.linalg.norm(first) > 0 or (
        third is not None and np.linalg.norm(third) <= RIGHT_ANGLE * np.linalg.norm(first) * np.linalg.norm(second)
    ):
        raise InvalidArgumentError(
            f"rectangular of {part} is {shown(numbers.tolist())}; expected a direction, in 3D two that are not parallel"
        )
    rows = [first, second] if third is None else [first, np.cross(third, first), third]
    return unit_vectors(np.array(rows), "axes")


def _around(points: Floats, numbers: Floats, part: str) -> Floats:
    """Axes of nodes around a centre or, in 3D, around the line through two points: radial, tangential, axial."""
    centre, ahead = (numbers, np.array([0.0, 0.0, 1.0])) if len(numbers) == 2 else np.split(numbers, 2)
    if len(numbers) == 6:
        ahead = ahead - centre
        ahead = ahead / max(float(np.linalg.norm(ahead)), np.finfo(np.float64).tiny)
    offset = points - centre
    if len(numbers) == 6:
        offset = offset - (offset @ ahead)[:, None] * ahead
    far = np.linalg.norm(offset, axis=1)
    if not np.min(far) > SAME * np.max(far) or not np.any(ahead):
        raise InvalidArgumentError(
            f"cylindrical of {part} is {shown(numbers.tolist())}, and a node is on this axis or it has no direction; "
            "expected a centre, in 3D two points of the axis, away from the nodes"
        )
    radial = offset / far[:, None]
    if len(numbers) == 2:
        return np.stack([radial, np.stack([-radial[:, 1], radial[:, 0]], axis=1)], axis=1)
    return np.stack([radial, np.cross(ahead, radial), np.broadcast_to(ahead, radial.shape)], axis=1)


# -- loads and springs -----------------------------------------------------------------------------------------------


def nodal_forces(body: NodalBasis, mesh: PartedMesh, options: Options, slope: str = "") -> Floats:
    """Forces on all nodes, (N, d), of everything that acts on parts; with ``slope`` "_slope" their derivatives."""
    loads, pressures, volume, forces = (
        getattr(options, name + slope) for name in ("load", "pressure", "body_force", "force")
    )
    total = part_forces(body, mesh, loads, pressures, slope)
    if volume is not None:
        total += body.volume_forces(body_force_of(mesh, volume, f"body_force{slope}"))
    turning = getattr(options, f"centrifugal{slope}")
    if turning is not None:
        density, slopes = centrifugal_of(mesh, turning, f"centrifugal{slope}", axisymmetric=body.axisymmetric)
        total += body.volume_forces(density, slopes)
    points, axes = by_part(options.reference, "reference"), frames_of(mesh, options.transform).axes
    for part, value in by_part(forces, f"force{slope}").items():
        if part not in points:
            nodes = mesh.nodes(part)
            total[nodes] += short_vector(value, f"force{slope} of {part}", mesh.points.shape[1]) @ axes[nodes]
    return total


def body_force_of(mesh: PartedMesh, value: object, name: str) -> Floats:
    """Force per volume of every cell, (M, d); parts of the body without one have none [force / length^3].

    Raises
    ------
    InvalidArgumentError
        It is not that, or a name does not exist.
    """
    dimension = mesh.points.shape[1]
    if not isinstance(value, Mapping):
        return np.tile(short_vector(value, name, dimension), (len(mesh.cells), 1))
    density = np.zeros((len(mesh.cells), dimension))
    for part, force in by_part(value, name).items():
        density[mesh.body(part)] += short_vector(force, f"{name} of {part}", dimension)
    return density


def centrifugal_of(mesh: PartedMesh, value: object, name: str, *, axisymmetric: bool = False) -> tuple[Floats, Floats]:
    """Force per volume c (1 - a a') (x - x0) of parts that turn about an axis, as its value at 0 and its derivative.

    By cells, (M, d) and (M, d, d) [force / length^3, force / length^4]; c is density times speed squared.

    Raises
    ------
    InvalidArgumentError
        A part does not exist or has not seven numbers, the axis has no direction, or the force leaves the plane or is
        not that of an axisymmetric body.
    """
    d = mesh.points.shape[1]
    constant, slopes = np.zeros((len(mesh.cells), d)), np.zeros((len(mesh.cells), d, d))
    for part, given in by_part(value, name).items():
        own = f"{name} of {part}"
        numbers = short_vector(given, own, 7)
        if not np.any(numbers[4:]):
            raise InvalidArgumentError(f"{own} has an axis without a direction; expected one, the last three numbers")
        (axis,) = unit_vectors(numbers[None, 4:], own)
        slope = numbers[0] * (np.eye(3) - np.outer(axis, axis))
        at_origin = -slope @ numbers[1:4]
        across = max(np.max(np.abs(slope[d:, :d]), initial=0.0), np.max(np.abs(at_origin[d:]), initial=0.0))
        if axisymmetric:
            across = max(across, np.max(np.abs(slope[:d, 1])), np.max(np.abs(at_origin)))
        if across > RIGHT_ANGLE * np.max(np.abs(numbers)):
            expected = "the y axis of an axisymmetric body" if axisymmetric else "one across the plane, or within it"
            raise InvalidArgumentError(f"{own} has the axis {shown(numbers[1:].tolist())}; expected {expected}")
        rows = mesh.body(part)
        constant[rows] += at_origin[:d]
        slopes[rows] += slope[:d, :d]
    return constant, slopes


def part_forces(body: NodalBasis, mesh: PartedMesh, loads: object, pressures: object, slope: str = "") -> Floats:
    """Nodal forces (N, d) of tractions and of pressures, which push into the body, on parts."""
    total, dimension = np.zeros(mesh.points.shape), mesh.points.shape[1]
    for part, value in by_part(loads, f"load{slope}").items():
        traction = short_vector(value, f"load{slope} of {part}", dimension)
        total += body.on_part(mesh.part(part), part, partial(_constant, traction[:, None, None]))
    for part, value in by_part(pressures, f"pressure{slope}").items():
        pressure = finite_number(value, f"pressure{slope} of {part}")
        total += body.on_part(mesh.part(part), part, partial(np.multiply, -pressure))
    return total


def _constant(traction: Floats, _: Floats) -> Floats:
    return traction


def part_springs(body: NodalBasis, mesh: PartedMesh, springs: object) -> sp.csc_array:
    """Stiffness (dN, dN) of springs between parts and the ground, lumped at the nodes."""
    count, dimension = mesh.points.shape
    blocks = np.zeros((count, dimension, dimension))
    for part, value in by_part(springs, "spring").items():
        normal, tangential = short_vector(value, f"spring of {part}", 2)
        if min(normal, tangential) < 0:
            raise InvalidArgumentError(
                f"spring of {part} is {shown(value)}; expected stiffnesses >= 0 along the normal and across it"
            )
        for k, axis in enumerate(np.eye(dimension)):
            across = tangential * axis[:, None, None]

            def density(n: Floats, k: int = k, a: Floats = across, b: float = normal - tangential) -> Floats:
                return np.asarray(a + b * n[k] * n)

            blocks[:, :, k] += body.on_part(mesh.part(part), part, density, lumped=True)
    shape = (count * dimension, count * dimension)
    K = sp.csc_array(sp.bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=shape))
    K.eliminate_zeros()
    return K


# -- obstacles -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Obstacle:
    """A rigid obstacle in the way of the body.

    Attributes
    ----------
    kind : "plane", "circle" or "sphere" outside of which, or "hole" inside of which the body is
    place : (d,) array
        A point of the plane, or the centre [length].
    normal : (d,) array or None
        Direction from the plane to the body.
    radius : float
        [length].
    """

    kind: str
    place: Floats
    normal: Floats | None = None
    radius: float = 0.0

    @classmethod
    def of(cls, value: object, dimension: int) -> Obstacle:
        """The obstacle that a mapping of its kind to numbers describes.

        Raises
        ------
        InvalidArgumentError
            It describes none.
        """
        given = by_part(value, "obstacle")
        if len(given) != 1:
            raise InvalidArgumentError(f"obstacle is {shown(value)}; expected one of {_kinds(dimension)}")
        ((kind, numbers),) = given.items()
        one_of(kind, "obstacle", [known for known, form in _OBSTACLES.items() if dimension in form])
        form = _OBSTACLES[kind][dimension]
        entries = real_array(numbers, f"obstacle {kind}", error=InvalidArgumentError)
        if entries.shape != (len(form),):
            raise InvalidArgumentError(f"obstacle {kind} is {shown(numbers)}; expected {', '.join(form)}")
        if kind == "plane":
            length = float(np.linalg.norm(entries[dimension:]))
            if not length > 0:
                raise InvalidArgumentError(f"obstacle plane is {shown(numbers)}; expected a direction to the body")
            return cls(kind, entries[:dimension], entries[dimension:] / length)
        if not entries[-1] > 0:
            raise InvalidArgumentError(f"obstacle {kind} has the radius {entries[-1]:g}; expected a length > 0")
        return cls(kind, entries[:dimension], None, float(entries[-1]))

    @property
    def expected(self) -> str:
        """Words on what a user may have meant by an obstacle behind the boundary."""
        if self.kind == "plane":
            return "the direction from the plane to the body after its point"
        others = "circle or sphere" if self.kind == "hole" else "hole"
        return f"the boundary on the side of the obstacle, or {others} for a body on its other side"

    def normals_and_gaps(self, points: Floats) -> tuple[Floats, Floats]:
        """Directions (p, d) from points to the obstacle, and the distances (p,) to it, negative inside it.

        Raises
        ------
        InvalidArgumentError
            A point is the centre.
        """
        offset = points - self.place
        if self.normal is not None:
            return np.tile(-self.normal, (len(points), 1)), offset @ self.normal
        distances = np.linalg.norm(offset, axis=1)
        if not np.min(distances) > 0:
            raise InvalidArgumentError(f"obstacle {self.kind} has its centre at a contact node; expected it elsewhere")
        outward = offset / distances[:, None]
        return (outward, self.radius - distances) if self.kind == "hole" else (-outward, distances - self.radius)


def _kinds(dimension: int) -> str:
    forms = {kind: form[dimension] for kind, form in _OBSTACLES.items() if dimension in form}
    return ", ".join(f"{kind} = [{', '.join(form)}]" for kind, form in forms.items())
