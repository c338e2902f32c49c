"""Small closed forms, blocks, wedges and chains in 2D and 3D: `ContactProblem` and `ContactProblem3D`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
import scipy.sparse as sp

from enumsol import fem
from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import lame_coefficients
from enumsol.model.contact_body import ContactBody
from enumsol.model.mesh import BodyMesh
from enumsol.model.problem import ContactProblem, given_friction
from enumsol.support.arguments import finite_number, nonnegative_number, positive_integer, positive_number, shown
from enumsol.support.array_arguments import real_array, short_vector

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.fem.meshes import SolidMesh
    from enumsol.model.problem3d import ContactProblem3D, Friction
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


def one_node_3d(
    W: ArrayLike = ((15.0, -1.0, -2.0), (-1.0, 14.0, 1.0), (-2.0, 1.0, 16.0)),
    q: ArrayLike = (-1.0, 2.0, 3.0),
    friction: Friction = 0.1,
) -> ContactProblem3D:
    """Contact node given by its compliance: u = W r + q with u_n >= 0, r_n >= 0, u_n r_n = 0, and friction against u_t.

    In (normal, first tangent, second tangent), with the signs of contact solvers: u_n is the opening, r_n the pressing
    force. Ours are lambda = r and w = -u, so that S = W and g = -q. No displacement of a body is known: A = [Bn; Bt1;
    Bt2] = W and f = -q give these numbers without inverting W, and u of the problem has no meaning. The defaults are a
    public test of the contact community.

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
        springs=_solid_top_springs(points, top, springs),
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


def _solid_top_springs(points: Floats, top: Integers, springs: ArrayLike) -> Floats:
    from enumsol.fem.solid_problems import facet_forces  # as above

    total = holding(springs, 3)
    shares = facet_forces(points, top, total)
    return np.asarray(shares * (total / shares.sum(axis=0)))
