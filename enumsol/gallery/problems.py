"""Small closed forms, blocks, wedges and chains: every function returns a `ContactProblem`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy.sparse as sp

from enumsol import fem
from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import lame_coefficients
from enumsol.model.contact_body import ContactBody
from enumsol.model.mesh import BodyMesh
from enumsol.model.problem import ContactProblem
from enumsol.support.arguments import finite_number, nonnegative_number, positive_integer, positive_number, shown
from enumsol.support.array_arguments import short_vector

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.support.array_types import ArrayLike, Floats, Integers

Pair = tuple[float, float]
Problem = TypeVar("Problem", bound=ContactBody)


def one_node_triangle(f: Pair = (1.5, -4.0), lame: Pair = (1.0, 1.0)) -> ContactProblem:
    """Triangle with one contact node: the smallest problem with three roots, and all of it in closed form.

    A P1 triangle with legs of equal length; the corner (0, 0) at the right angle touches the floor, the corners (1, 0)
    and (0, 1) are fixed, friction is F(alpha) = alpha (the paper's Examples 6.1-6.3). In (normal, tangential)
    coordinates A = 1/2 [[l + 3m, -(l + m)], [-(l + m), l + 3m]]. With f = (f_n, f_t) and
    s = (l + 3m) f_n + (l + m) f_t it shows

    - one branch when s > 0, or when f_n <= 0 and s <= 0;
    - two separate branches when s < 0 and f_n > 0: for f = (1.5, -4), l = m = 1, the node is open for every alpha, and
      from alpha = 8/3 on it may also stick (lambda_n = 1.5) or slip (lambda_n = 1 / (alpha - 2));
    - two branches that meet in a continuum of roots at alpha = (l + 3m) / (l + m) when s = 0 and f_n > 0.

    Parameters
    ----------
    f : (float, float)
        Load of the contact node in normal (into the floor) and tangential direction [force].
    lame : (float, float)
        Lame coefficients l, m [force / length^2].

    Raises
    ------
    InvalidArgumentError
        An argument is not two admissible numbers.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.one_node_triangle(f=(1.5, -4))
    >>> [len(enumsol.enumerate_roots(problem, alpha)) for alpha in (1, 5)]
    [1, 3]
    """
    load = short_vector(f, "f", 2)
    return ContactProblem(
        _one_node_stiffness(lame), [[1.0, 0.0]], [[0.0, 1.0]], load, coordinates=[[0.0, 0.0]], mesh=_triangles(1)
    )


def two_node_square(
    f1: Pair = (1.0, -3.0),
    f2: Pair = (1.0, -1.0),
    lame: Pair = (1.0, 1.0),
    friction: ArrayLike | None = None,
    friction_slope: ArrayLike | None = None,
    load_slope: tuple[Pair, Pair] | None = None,
) -> ContactProblem:
    """Two contact nodes on one square: up to five roots, several branches, and loading paths (n = 4, p = 2).

    The geometry is not that of the paper's Examples 6.4-6.7, whose coordinates were never published; their loads can
    be applied to it, but their printed figures do not follow. The unit square is clamped along its top
    and stands in a corner: node 0 at (0, 0) touches the floor (normal (0, -1), tangent (1, 0)), node 1 at (1, 0) the
    wall on the right (normal (1, 0), tangent (0, 1)). Two P1 triangles share the diagonal from (1, 0) to (0, 1). The
    degrees of freedom are (u_n, u_t) of node 0, then of node 1; for l = m = 1 the entries of A are exact in binary.

    With l = m = 1 it shows

    - f1 = (1, -3), f2 = (1, -1) (paper, Example 6.4): 1 root for alpha < 3, 5 for 3 < alpha < 3.828, then 3;
    - f1 = (1, -4), f2 = (1.5, -3.5): 5 well separated roots at alpha = 5;
    - f1 = (0.4, 0.2), f2 = (1.8, -0.1), friction = 4, load_slope = ((0.1, -1.1), (0.2, -0.8)), the loading path of
      paper, Example 6.7: 3 roots for alpha between 1.2 and 2.6, else one. The other reading of its signs,
      load_slope = ((0.1, 1.1), (0.2, 0.8)), has 3 roots between -1.2 and -0.75.

    Parameters
    ----------
    f1, f2 : (float, float)
        Loads of node 0 and node 1 in their own (normal, tangential) directions at alpha = 0 [force].
    lame : (float, float)
        Lame coefficients l, m [force / length^2].
    friction, friction_slope : float or (p,) array_like, or None
        As in `ContactProblem`; without both F(alpha) = alpha.
    load_slope : ((float, float), (float, float)) or None
        Derivatives of f1 and f2 with respect to alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> len(enumsol.enumerate_roots(enumsol.gallery.two_node_square((1, -4), (1.5, -3.5)), alpha=5))
    5
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    K = np.zeros((8, 8))
    for triangle in ((0, 1, 2), (1, 3, 2)):
        dofs = [2 * node + component for node in triangle for component in range(2)]
        K[np.ix_(dofs, dofs)] += fem.triangle_stiffness(corners[list(triangle)], lame)
    # rows: u_n = -u_y and u_t = u_x at node 0, u_n = u_x and u_t = u_y at node 1 (nodes 2 and 3 are clamped)
    turn = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    slope = None
    if load_slope is not None:
        if not isinstance(load_slope, (tuple, list)) or len(load_slope) != 2:
            raise InvalidArgumentError(
                f"load_slope is {shown(load_slope)}; expected two pairs, the slopes of f1 and f2"
            )
        slope = np.concatenate([short_vector(pair, f"load_slope[{k}]", 2) for k, pair in enumerate(load_slope)])
    return ContactProblem(
        turn @ K[:4, :4] @ turn.T,
        np.eye(4)[[0, 2]],
        np.eye(4)[[1, 3]],
        np.concatenate([short_vector(f1, "f1", 2), short_vector(f2, "f2", 2)]),
        friction=friction,
        friction_slope=friction_slope,
        load_slope=slope,
        coordinates=corners[:2],
        mesh=BodyMesh(corners, [[0, 1, 2], [1, 3, 2]], np.vstack([turn.T, np.zeros((4, 4))])),
    )


def clamped_block(
    nx: int,
    ny: int,
    length: float = 1.0,
    height: float = 1.0,
    lame: Pair = (1.0, 1.0),
    *,
    traction: Pair = (0.3, -1.0),
    friction: ArrayLike | None = None,
    friction_slope: ArrayLike | None = None,
    gap: float = 0.0,
    contact: int | None = None,
) -> ContactProblem:
    """Elastic block clamped at its left side and pressed onto the floor: one root, and the benchmark of the search.

    The rectangle (0, length) x (0, height) is meshed by nx by ny cells of two P1 triangles. All nodes along the bottom
    touch the floor (normal (0, -1), tangent (1, 0)) except the clamped corner: p = nx, in the order of x. The top
    carries a uniform traction. With tractions (0.3, -1), (1, -0.3) or (0, -1) and length 1 or 2 it has one root for
    friction from 1 to 10; tractions that drag it towards the clamp, such as (-0.3, -1), make the search longer.

    Parameters
    ----------
    nx, ny : int
        Cells along x and y, at least 1.
    length, height : float
        Sides of the rectangle [length].
    lame : (float, float)
        Lame coefficients l, m [force / length^2].
    traction : (float, float)
        Force per length of the top in x and y [force / length].
    friction, friction_slope : float or (p,) array_like, or None
        As in `ContactProblem`; without both F(alpha) = alpha.
    gap : float
        Initial gap below all contact nodes [length]; negative is a press fit.
    contact : int or None
        Number of contact nodes, a divisor of nx: only every (nx / contact)-th node of the bottom then meets the floor,
        as on a row of ridges, and p stays small on a fine mesh. Default nx.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.clamped_block(8, 4)
    >>> problem.p, len(enumsol.enumerate_roots(problem, alpha=3))
    (8, 1)
    """
    mesh = fem.rectangle(nx, ny, length, height)
    cells = len(mesh.bottom) - 1
    count = cells if contact is None else positive_integer(contact, "contact")
    if cells % count:
        raise InvalidArgumentError(f"contact is {shown(count)}; expected a divisor of nx = {cells}")
    return fem.contact_problem(
        mesh.points,
        mesh.triangles,
        lame,
        contact=mesh.bottom[cells // count :: cells // count],
        normals=(0.0, -1.0),
        held=mesh.left,
        forces=fem.edge_forces(mesh.points, fem.edges_along(mesh.top), short_vector(traction, "traction", 2)),
        gap=finite_number(gap, "gap"),
        friction=friction,
        friction_slope=friction_slope,
    )


def block_on_table(
    nx: int = 4,
    ny: int = 2,
    lame: Pair = (1.0, 1.0),
    *,
    pressure: float = 1.0,
    push: float = 0.5,
    friction: float = 0.3,
    max_rigid_displacement: float | None = None,
) -> ContactProblem:
    """A block that lies on a table, pressed down and pushed: nothing but contact holds it.

    The rectangle (0, 2) x (0, 1) is meshed as that of `clamped_block`. All nodes along the bottom touch the table:
    p = nx + 1. The top is pressed down; forces on the bottom push the block to the right. Below ``push`` = 1 it has one
    solution, at 1 it may slide any distance, and above it has none.

    Parameters
    ----------
    nx, ny : int
        Cells along x and y, at least 1.
    lame : (float, float)
        Lame coefficients l, m [force / length^2].
    pressure : float
        Force per length of the top [force / length].
    push : float
        Sum of the pushing forces, as a fraction of what friction can hold [-].
    friction : float
        Constant coefficient.
    max_rigid_displacement : float or None
        As in `ContactProblem`.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> [len(enumsol.enumerate_roots(enumsol.gallery.block_on_table(push=push), 0)) for push in (0, 0.5, 1.1)]
    [1, 1, 0]
    """
    mesh = fem.rectangle(nx, ny, 2.0, 1.0)
    load = positive_number(pressure, "pressure")
    mu, share = nonnegative_number(friction, "friction"), finite_number(push, "push")
    f = fem.edge_forces(mesh.points, fem.edges_along(mesh.top), (0.0, -load)).ravel()
    nodes = mesh.bottom
    f[2 * nodes] += share * mu * -np.sum(f[1::2]) / len(nodes)
    A = fem.stiffness(mesh.points, mesh.triangles, lame)
    body = (mesh.points, mesh.triangles, nodes)
    return on_table(ContactProblem, A, *body, f, friction=mu, max_rigid_displacement=max_rigid_displacement)


def on_table(
    kind: Callable[..., Problem],
    A: sp.csc_array,
    points: Floats,
    cells: Integers,
    nodes: Integers,
    f: Floats,
    **more: Any,
) -> Problem:
    """Problem of a body that lies with these nodes on a table and that nothing else holds; ``kind`` is 2D or 3D.

    The tangents are x and, in 3D, -y; the normal is downward.
    """
    from enumsol.fem.bodies import rigid_motions  # what it needs is not for the list of problems

    d, ones = points.shape[1], np.ones(len(nodes))
    *tangents, normal = (
        sp.csr_array((-ones if axis else ones, (np.arange(len(nodes)), d * nodes + axis)), shape=(len(nodes), len(f)))
        for axis in range(d)
    )
    mesh = BodyMesh.of_dofs(points, cells, np.arange(len(f)))
    rigid = rigid_motions(points)
    return kind(A, normal, *tangents, f, coordinates=points[nodes], mesh=mesh, rigid_modes=rigid, **more)


def wedge(
    nx: int,
    ny: int,
    pull: Pair = (0.0, 5e-4),
    press: float = 5e-4,
    springs: Pair = (0.04, 0.02),
    *,
    width: float = 1.0,
    height: float = 1.0,
    half_angle: float = 20.0,
    lame: Pair = (1.0, 1.0),
    friction: ArrayLike | None = None,
    friction_slope: ArrayLike | None = None,
) -> ContactProblem:
    """Elastic wedge pressed into a rigid notch and pulled out of it: it may stay jammed or come out (3 or 5 roots).

    The trapezoid of bottom width ``width`` and height ``height`` widens upward by ``half_angle`` on both sides, and so
    does the notch. It is meshed by nx by ny cells of two P1 triangles. All nodes of the two inclined sides below the
    mouth of the notch are contact nodes, first the left side and then the right, each from the bottom up: p = 2 ny. The
    normals point into the walls, both tangents out of the notch, so slip+ is sliding out. The wedge is larger than the
    notch by ``press`` (gap = -press at every contact node), weak springs hold its top, and ``pull`` drags at it.

    A wedge that was pressed in can be in equilibrium jammed (its own compression gives friction the grip to hold
    against the pull) or popped out (free, held by the springs alone). Between them is a third root, sliding out on both
    sides, of index -1. An oblique pull adds one that hangs tilted, stuck to a wall near the mouth with the tip sliding
    on the other wall, and one more of index -1. Scaling pull and press together scales the roots and nothing else. With
    nx = 4 and the other defaults there are

    - pull = (0, 5e-4), alpha = 1: 3 roots at p = 8, 14, 20 and 32;
    - pull = (4e-4, 1e-3), alpha = 2, 2.1, .. 3: 5 roots at p = 8, 14 and 20.

    Parameters
    ----------
    nx, ny : int
        Cells across and along the height, at least 1; for even nx the mesh is symmetric about the axis.
    pull : (float, float)
        Force per length of the top in x and y; positive y is out of the notch [force / length].
    press : float
        Interference with both walls, along the normals [length].
    springs : (float, float)
        Total stiffness of the springs between the top and the ground in x and y, > 0 [force / length].
    width, height : float
        Width of the bottom and height of the wedge [length].
    half_angle : float
        Inclination of the sides to the axis, between 0 and 80 [degrees].
    lame : (float, float)
        Lame coefficients l, m [force / length^2].
    friction, friction_slope : float or (p,) array_like, or None
        As in `ContactProblem`; without both F(alpha) = alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> problem = enumsol.gallery.wedge(4, 4)
    >>> problem.p, len(enumsol.enumerate_roots(problem, alpha=1))
    (8, 3)
    """
    angle = inclination(half_angle)
    width, height = positive_number(width, "width"), positive_number(height, "height")
    mesh = fem.trapezoid(nx, ny, width, width + 2.0 * height * math.tan(angle), height)
    # the top row stands in the mouth of the notch, out of contact, and carries springs and pull
    left, right = mesh.left[:-1], mesh.right[:-1]
    c, s = math.cos(angle), math.sin(angle)
    return fem.contact_problem(
        mesh.points,
        mesh.triangles,
        lame,
        contact=np.concatenate([left, right]),
        normals=np.repeat([[-c, -s], [c, -s]], len(left), axis=0),
        tangents=np.repeat([[-s, c], [s, c]], len(left), axis=0),
        springs=_top_springs(mesh, springs),
        forces=fem.edge_forces(mesh.points, fem.edges_along(mesh.top), short_vector(pull, "pull", 2)),
        gap=-finite_number(press, "press"),
        friction=friction,
        friction_slope=friction_slope,
    )


def taper(
    nx: int,
    ny: int,
    pull: Pair = (0.0, 50.0),
    *,
    friction: ArrayLike | None = None,
    friction_slope: ArrayLike | None = None,
) -> ContactProblem:
    """Self-holding taper of steel in N and mm, pressed into its socket and pulled: it holds, slides out or is free.

    A `wedge` of 60 mm, 20 mm wide at its tip, whose sides are inclined by 3 degrees; plane strain, E = 210 GPa and
    nu = 0.3. It is pressed in by 0.01 mm on both sides. Springs of 100 N/mm along the axis and 200 N/mm across, per mm
    of depth, hold its top: a drawbar that was released. A pull of 50 N per mm of width and depth is about 1.3 kN per mm
    of depth; with it there is one solution up to F = 0.12, and there are three from there on, five only near F = 0.15
    (nx = 4, ny = 4 to 10).

    Parameters
    ----------
    nx, ny : int
        Cells across and along the height, at least 1; p = 2 ny.
    pull : (float, float)
        Force per area of the top in x and y; positive y is out of the socket [N / mm^2].
    friction, friction_slope : float or (p,) array_like, or None
        As in `ContactProblem`; without both F(alpha) = alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> len(enumsol.enumerate_roots(enumsol.gallery.taper(4, 4), alpha=0.2))
    3
    """
    return wedge(
        nx,
        ny,
        pull,
        0.01,
        (200.0, 100.0),
        width=20.0,
        height=60.0,
        half_angle=3.0,
        lame=fem.lame(210e3, 0.3),
        friction=friction,
        friction_slope=friction_slope,
    )


def chain(p: int, coupling: float = 0.0, f: Pair = (1.5, -4.0), lame: Pair = (1.0, 1.0)) -> ContactProblem:
    """Row of one-node triangles, weakly coupled: 3^p roots, to measure what an enumeration costs per root.

    Each of the p triangles is `one_node_triangle`; springs of stiffness ``coupling`` join the free nodes of neighbours
    in both directions. Friction is F(alpha) = alpha. Without coupling the nodes choose independently, and with the
    default load every node has three roots for alpha > 8/3: 3^p together. At alpha = 5 this is still so with
    coupling = 0.05 (counted up to p = 8; for p up to 5 also with couplings up to 0.2).

    Parameters
    ----------
    p : int
        Number of triangles, 1 to a million.
    coupling : float
        Stiffness of each connecting spring, at least 0 [force / length].
    f : (float, float)
        Load of every contact node in normal and tangential direction [force].
    lame : (float, float)
        Lame coefficients l, m [force / length^2].

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> len(enumsol.enumerate_roots(enumsol.gallery.chain(3), alpha=5)) == 3**3
    True
    """
    count = positive_integer(p, "p", most=1_000_000)
    spring = nonnegative_number(coupling, "coupling")
    # the graph Laplacian of the row: a spring pulls on both of its ends
    link = np.arange(count - 1)
    sign = np.ones(count - 1)
    ends = sp.csr_array(
        (np.concatenate([sign, -sign]), (np.tile(link, 2), np.concatenate([link, link + 1]))), shape=(count - 1, count)
    )
    join = sp.kron(ends.T @ ends, sp.eye_array(2))
    A = sp.kron(sp.eye_array(count), _one_node_stiffness(lame)) + spring * join
    dofs = sp.csr_array(sp.eye_array(2 * count))
    mesh = _triangles(count)
    load = np.tile(short_vector(f, "f", 2), count)
    return ContactProblem(sp.csc_array(A), dofs[0::2], dofs[1::2], load, coordinates=mesh.points[::3], mesh=mesh)


def _triangles(count: int) -> BodyMesh:
    """Triangles with legs of length one, half a leg apart; only their corners at the right angle move."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    first = np.stack([1.5 * np.arange(count), np.zeros(count)], axis=1)
    # u_n = -u_y, u_t = u_x
    turn = sp.csr_array(np.vstack([[[0.0, 1.0], [-1.0, 0.0]], np.zeros((4, 2))]))
    points = (first[:, None, :] + corners).reshape(-1, 2)
    return BodyMesh(points, np.arange(3 * count).reshape(-1, 3), sp.kron(sp.eye_array(count), turn))


def _one_node_stiffness(lame: Pair) -> Floats:
    lam, mu = lame_coefficients(lame, 2)
    return 0.5 * np.array([[lam + 3 * mu, -(lam + mu)], [-(lam + mu), lam + 3 * mu]])


def _top_springs(mesh: fem.Mesh, springs: Pair) -> Floats:
    share = np.full(len(mesh.top), 1.0 / (len(mesh.top) - 1))
    share[[0, -1]] *= 0.5
    values = np.zeros_like(mesh.points)
    values[mesh.top] = share[:, None] * holding(springs, 2)
    return values


def inclination(degrees: float) -> float:
    """Inclination of the sides of a wedge, in radians.

    Raises
    ------
    InvalidArgumentError
        It is not between 0 and 80 degrees.
    """
    angle = math.radians(positive_number(degrees, "half_angle"))
    if angle > math.radians(80.0):
        raise InvalidArgumentError(f"half_angle is {shown(degrees)}; expected degrees between 0 and 80")
    return angle


def holding(springs: ArrayLike, dimension: int) -> Floats:
    """Stiffnesses of springs that hold a wedge.

    Raises
    ------
    InvalidArgumentError
        They are not positive, one in each direction.
    """
    total = short_vector(springs, "springs", dimension)
    if np.min(total) <= 0:
        number = {2: "two", 3: "three"}[dimension]
        raise InvalidArgumentError(
            f"springs is {shown(springs)}; expected {number} stiffnesses > 0, otherwise nothing holds the wedge"
        )
    return total
