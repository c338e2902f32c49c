"""One node and blocks in three dimensions: every function returns a `ContactProblem3D`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from enumsol.array_checks import real_array, short_vector
from enumsol.checks import finite_number
from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from enumsol.problem3d import ContactProblem3D

#: A public test of the contact community: one contact, with friction 0.1.
_COMPLIANCE = ((15.0, -1.0, -2.0), (-1.0, 14.0, 1.0), (-2.0, 1.0, 16.0))
_FREE_DISPLACEMENT = (-1.0, 2.0, 3.0)


def one_node_3d(W: ArrayLike = _COMPLIANCE, q: ArrayLike = _FREE_DISPLACEMENT, friction: Any = 0.1) -> ContactProblem3D:
    """One contact node by its compliance: u = W r + q with u_n >= 0, r_n >= 0, u_n r_n = 0, and friction against u_t.

    In (normal, first tangent, second tangent), with the signs of contact solvers: u_n is the distance that opens, r_n
    the force that presses. Ours are lambda = r and w = -u, so that S = W and g = -q. No displacement of a body is
    known: A = [Bn; Bt1; Bt2] = W and f = -q give these numbers without inverting W, and u of the problem means nothing.

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
        W is no symmetric positive definite matrix of this shape, or q is not three numbers.
    InvalidProblemError
        friction cannot be used.

    Examples
    --------
    >>> import enumsol
    >>> enumsol.gallery.one_node_3d(friction=(0.1, 0.2)).condensed.g0.round(12).tolist()
    [1.0, -2.0, -3.0]
    """
    from enumsol.problem3d import ContactProblem3D  # not for problems in 2D

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
    friction: Any = None,
    lame: tuple[float, float] = (1.0, 1.0),
    *,
    size: ArrayLike = (1.0, 1.0, 1.0),
    cells: Literal["hexahedra", "tetrahedra"] = "hexahedra",
    gap: float = 0.0,
    multipliers: Literal["nodes", "elements"] = "nodes",
    ratio: int = 1,
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
    friction
        As in `ContactProblem3D`; default F1 = alpha, F2 = 0.6 alpha.
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
    from enumsol.fem.solid_meshes import box  # as above
    from enumsol.fem.solid_problems import solid_contact_problem
    from enumsol.fem.solids import facet_forces

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
        friction=0.0 if friction is None else friction,
        friction_slope=(1.0, 0.6) if friction is None else 0.0,
        multipliers=multipliers,
        ratio=ratio,
    )
