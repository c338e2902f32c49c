"""One node, blocks and wedges in three dimensions: every function returns a `ContactProblem3D`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.gallery.problems import holding, inclination, on_table
from enumsol.model.problem import given_friction
from enumsol.support.arguments import finite_number, nonnegative_number, positive_integer, positive_number
from enumsol.support.array_arguments import real_array, short_vector

if TYPE_CHECKING:
    from enumsol.fem.meshes import SolidMesh
    from enumsol.model.problem3d import ContactProblem3D, Friction
    from enumsol.support.array_types import ArrayLike, Floats, Integers

#: A public test of the contact community: one contact, with friction 0.1.
_COMPLIANCE = ((15.0, -1.0, -2.0), (-1.0, 14.0, 1.0), (-2.0, 1.0, 16.0))
_FREE_DISPLACEMENT = (-1.0, 2.0, 3.0)


def one_node_3d(
    W: ArrayLike = _COMPLIANCE, q: ArrayLike = _FREE_DISPLACEMENT, friction: Friction = 0.1
) -> ContactProblem3D:
    """Contact node given by its compliance: u = W r + q with u_n >= 0, r_n >= 0, u_n r_n = 0, and friction against u_t.

    In (normal, first tangent, second tangent), with the signs of contact solvers: u_n is the opening, r_n the pressing
    force. Ours are lambda = r and w = -u, so that S = W and g = -q. No displacement of a body is known: A = [Bn; Bt1;
    Bt2] = W and f = -q give these numbers without inverting W, and u of the problem has no meaning.

    Parameters
    ----------
    W : (3, 3) array_like
        Compliance, symmetric positive definite [length / force].
    q : (3,) array_like
        Displacement without contact force [length].
    friction
        As in `ContactProblem3D`.

    Raises
    ------
    InvalidArgumentError
        W is not a symmetric positive definite matrix of this shape, or q is not three numbers.
    InvalidProblemError
        friction cannot be used.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.gallery.one_node_3d(friction=(0.1, 0.2)).condensed.g0.round(12).tolist()
    [1.0, -2.0, -3.0]
    """
    from enumsol.model.problem3d import ContactProblem3D  # not for problems in 2D

    compliance = real_array(W, "W", error=InvalidArgumentError)
    if compliance.shape != (3, 3):
        raise InvalidArgumentError(f"W has shape {compliance.shape}; expected (3, 3)")
    if not np.array_equal(compliance, compliance.T) or np.linalg.eigvalsh(compliance)[0] <= 0:
        raise InvalidArgumentError("W is not symmetric positive definite; expected a compliance")
    load = -short_vector(q, "q", 3)
    Bn, Bt1, Bt2 = compliance[:, None, :]
    return ContactProblem3D(compliance, Bn, Bt1, Bt2, load, friction=friction, coordinates=[[0.0, 0.0, 0.0]])


def block3d(
    nx: int,
    ny: int,
    nz: int,
    pull: ArrayLike = (0.6, 0.4, -0.6),
    friction: object = None,
    lame: tuple[float, float] = (1.0, 1.0),
    *,
    size: ArrayLike = (1.0, 1.0, 1.0),
    cells: Literal["hexahedra", "tetrahedra"] = "hexahedra",
    gap: float = 0.0,
    multipliers: Literal["nodes", "elements"] = "nodes",
    ratio: int = 1,
    friction_slope: object = None,
) -> ContactProblem3D:
    """Elastic block clamped at its left side (x = 0), pressed onto the floor z = 0 and sheared by a traction on top.

    All nodes of the bottom that are not clamped touch the floor: p = nx (ny + 1). The normal is (0, 0, -1), the
    principal axes are x and -y. With the default pull some nodes open, some stick and some slip from p = 9 on for
    F1 = 0.5, F2 = 0.3; nearly all slip for F1 = 0.3, and hardly any for F1 = 3.

    Parameters
    ----------
    nx, ny, nz : int
        Cells along x, y and z, at least 1.
    pull : (3,) array_like
        Force per area of the top [force / length^2].
    friction, friction_slope
        As in `ContactProblem3D`; without both F1 = alpha, F2 = 0.6 alpha, and without one of them that one is 0.
    lame : (float, float)
        Lame coefficients l, m [force / length^2].
    size : (3,) array_like
        Sides of the block [length].
    cells : {"hexahedra", "tetrahedra"}
        As in `enumsol.fem.box`.
    gap : float
        Initial gap below the bottom [length]; negative is a press fit.
    multipliers, ratio
        As in `enumsol.fem.solid_contact_problem`.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.
    InvalidProblemError
        friction cannot be used, or the multipliers violate (paper, (3.1)).

    Examples
    --------
    >>> import enumsol
    >>> enumsol.gallery.block3d(4, 3, 2).p
    16
    """
    from enumsol.fem.meshes import box  # as above
    from enumsol.fem.solid_problems import facet_forces, solid_contact_problem

    mesh = box(nx, ny, nz, size, cells)
    return solid_contact_problem(
        mesh.points,
        mesh.cells,
        lame,
        contact=mesh.facets["bottom"],
        normals=(0.0, 0.0, -1.0),
        axes=(1.0, 0.0, 0.0),
        held=mesh.nodes("left"),
        forces=facet_forces(mesh.points, mesh.facets["top"], short_vector(pull, "pull", 3)),
        gap=finite_number(gap, "gap"),
        **_friction(friction, friction_slope),
        multipliers=multipliers,
        ratio=ratio,
    )


def block_on_table3d(
    nx: int = 2,
    ny: int = 1,
    nz: int = 1,
    lame: tuple[float, float] = (1.0, 1.0),
    *,
    size: ArrayLike = (2.0, 1.0, 1.0),
    cells: Literal["hexahedra", "tetrahedra"] = "hexahedra",
    pressure: float = 1.0,
    push: ArrayLike = (0.5, 0.0),
    friction: float = 0.3,
    max_rigid_displacement: float | None = None,
) -> ContactProblem3D:
    """A block that lies on a table, pressed down and pushed: `block_on_table` in 3D, with six rigid modes.

    All nodes of the bottom (z = 0) touch the table: p = (nx + 1) (ny + 1). The normal is (0, 0, -1), the tangents are x
    and -y. The top is pressed down; a traction on the bottom pushes the block. While ``push`` is shorter than 1 it has
    one solution, at 1 it may slide any distance, and above it has none.

    Parameters
    ----------
    nx, ny, nz : int
        Cells along x, y and z, at least 1.
    lame : (float, float)
        Lame coefficients l, m [force / length^2].
    size : (3,) array_like
        Sides of the block [length].
    cells : {"hexahedra", "tetrahedra"}
        As in `enumsol.fem.box`.
    pressure : float
        Force per area of the top [force / length^2].
    push : (2,) array_like
        Sum of the pushing forces along x and y, as a fraction of what friction can hold [-].
    friction : float
        Constant coefficient.
    max_rigid_displacement : float or None
        As in `ContactProblem3D`.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> blocks = [enumsol.gallery.block_on_table3d(1, push=(push, 0.0)) for push in (0.5, 1.1)]
    >>> [len(enumsol.enumerate_roots(block, alpha=0)) for block in blocks]
    [1, 0]
    """
    from enumsol.fem.meshes import box  # as above
    from enumsol.fem.solid_problems import facet_forces, solid_stiffness
    from enumsol.model.problem3d import ContactProblem3D

    mesh = box(nx, ny, nz, size, cells)
    points, facets = mesh.points, mesh.facets
    load, mu = positive_number(pressure, "pressure"), nonnegative_number(friction, "friction")
    across = mu * load * np.append(short_vector(push, "push", 2), 0.0)
    forces = facet_forces(points, facets["top"], (0.0, 0.0, -load)) + facet_forces(points, facets["bottom"], across)
    A = solid_stiffness(points, mesh.cells, lame)
    body = (points, mesh.cells, mesh.nodes("bottom"))
    more: dict[str, Any] = {"friction": mu, "max_rigid_displacement": max_rigid_displacement}
    return on_table(ContactProblem3D, A, *body, forces.ravel(), **more)


def wedge3d(
    nx: int,
    ny: int,
    nz: int,
    pull: ArrayLike = (0.0, 0.0, 5e-4),
    press: float = 5e-4,
    springs: ArrayLike = (0.04, 0.04, 0.02),
    friction: object = None,
    lame: tuple[float, float] = (1.0, 1.0),
    *,
    size: ArrayLike = (1.0, 1.0, 1.0),
    half_angle: float = 20.0,
    multipliers: Literal["nodes", "elements"] = "elements",
    ratio: int = 1,
    friction_slope: object = None,
) -> ContactProblem3D:
    """Elastic wedge pressed into a rigid notch and pulled out of it or along it: 3, 5 or 9 roots.

    `wedge` in 3D: the notch runs along y. The body is a box of nx by ny by nz hexahedra that widens upward by
    ``half_angle`` on both sides. Its inclined sides below the topmost layer of cells touch the walls of the notch:
    p = 2 ny (nz - 1) with multipliers on facets (the default; first the left wall, then the right one, each from the
    bottom up) and p = 2 nz (ny + 1) on nodes. The normals point into the walls, the first axes out of the notch, the
    second ones along it: y on the left wall, -y on the right. The wedge is larger than the notch by ``press`` (gap =
    -press), weak springs hold its top, and ``pull`` drags at it.

    It may be jammed, or popped out and held by the springs alone; between them it slides out, with index -1. With two
    patches side by side on each wall (ny = 2) it can turn, too: jammed at one end and sliding or open at the other. The
    numbers of roots, all of them isolated:

    - (nx, ny, nz) = (2, 1, 2) and (2, 1, 3), p = 2 and 4, alpha = 1: 3;
    - (2, 2, 2), p = 4, pull = (0, 5e-5, 5e-4), alpha = 3: 9;
    - (2, 1, 2) with multipliers on nodes, p = 8, pull = (4e-4, 1e-4, 1e-3), alpha = 2: 5, of which 4 hang tilted.

    Parameters
    ----------
    nx, ny, nz : int
        Cells across the notch, along it, and along the height; nz at least 2.
    pull : (3,) array_like
        Force per area of the top in x, y and z; positive z is out of the notch [force / length^2].
    press : float
        Interference with both walls, along the normals [length].
    springs : (3,) array_like
        Total stiffness of the springs between the top and the ground in x, y and z, > 0 [force / length].
    friction, friction_slope
        As in `ContactProblem3D`; without both F1 = alpha, F2 = 0.6 alpha, and without one of them that one is 0.
    lame : (float, float)
        Lame coefficients l, m [force / length^2].
    size : (3,) array_like
        Width of the bottom, length along the notch, and height [length].
    half_angle : float
        Inclination of the sides to the plane between them, between 0 and 80 [degrees].
    multipliers : {"elements", "nodes"}
        As in `enumsol.fem.solid_contact_problem`.
    ratio : int
        For elements: patches of ratio by ratio facets, on each wall by itself.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.
    InvalidProblemError
        friction cannot be used, or the multipliers violate (paper, (3.1)).

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.wedge3d(2, 1, 3)
    >>> problem.p, len(enumsol.enumerate_roots(problem, alpha=1))
    (4, 3)
    """
    from enumsol.fem.meshes import blocks, box  # as above
    from enumsol.fem.solid_problems import facet_forces, solid_contact_problem

    layers = positive_integer(nz, "nz", least=2)
    angle = inclination(half_angle)
    mesh = box(nx, ny, layers, size)
    # the topmost layer stands in the mouth of the notch, out of contact, and carries springs and pull
    walls = [_lower_layers(mesh, side, layers) for side in ("left", "right")]
    points, top = mesh.points.copy(), mesh.facets["top"]
    width = np.max(points[:, 0])
    points[:, 0] = (points[:, 0] / width - 0.5) * (width + 2.0 * points[:, 2] * math.tan(angle))
    rows: dict[str, Any] = {"ratio": ratio}
    if multipliers == "elements":
        labels = [blocks(mesh.points, wall, ratio) for wall in walls]
        rows = {"patches": np.concatenate([labels[0], labels[1] + labels[0].max() + 1])}
    return solid_contact_problem(
        points,
        mesh.cells,
        lame,
        contact=np.concatenate(walls),
        axes=lambda place: (math.copysign(math.sin(angle), place[0]), 0.0, math.cos(angle)),
        springs=_top_springs(points, top, springs),
        forces=facet_forces(points, top, short_vector(pull, "pull", 3)),
        gap=-finite_number(press, "press"),
        **_friction(friction, friction_slope),
        multipliers=multipliers,
        **rows,
    )


def _friction(friction: object, slope: object) -> dict[str, Any]:
    if friction is None and slope is None:
        slope = (1.0, 0.6)
    return dict(zip(("friction", "friction_slope"), given_friction(friction, slope), strict=True))


def _lower_layers(mesh: SolidMesh, side: str, layers: int) -> Integers:
    """Facets of a side of a box but for those of the topmost layer of cells."""
    facets = mesh.facets[side]
    height = mesh.points[:, 2]
    return np.asarray(facets[np.max(height[facets], axis=1) < (layers - 0.5) / layers * np.max(height)])


def _top_springs(points: Floats, top: Integers, springs: ArrayLike) -> Floats:
    from enumsol.fem.solid_problems import facet_forces  # as above

    total = holding(springs, 3)
    shares = facet_forces(points, top, total)
    return np.asarray(shares * (total / shares.sum(axis=0)))
