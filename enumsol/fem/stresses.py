"""Stresses of a displaced body, by scikit-fem: means over the cells of a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.bases import nodal_basis

if TYPE_CHECKING:
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D
    from enumsol.support.array_types import ArrayLike, Floats


def cell_stresses(problem: ContactProblem | ContactProblem3D, u: ArrayLike) -> Floats:
    """Mean stress of every cell of the body, (M, d, d), for displacements u of shape (n,) [force / length^2].

    ``sigma = lambda tr(epsilon) I + 2 mu epsilon`` with the Lame coefficients that the problem was made with. In 2D
    these are the components in the plane.

    Parameters
    ----------
    problem : ContactProblem or ContactProblem3D
        With a mesh that knows its Lame coefficients, as `contact_problem`, `solid_contact_problem` and `mesh_problem`
        make it.
    u : (n,) array_like
        For example ``root.u`` [length].

    Raises
    ------
    InvalidArgumentError
        The problem has no such mesh, or u has another shape.

    Examples
    --------
    >>> import enumsol
    >>> from enumsol import fem
    >>> mesh = fem.rectangle(2, 2).parted()
    >>> problem = fem.mesh_problem(
    ...     mesh, young=1, poisson=0, clamp="left", contact="bottom", load={"right": (1, 0)}, friction=0.5
    ... )
    >>> free = problem.factorization.solve(problem.f)
    >>> fem.cell_stresses(problem, free)[:, 0, 0].round(6).tolist()  # pulled to the right by 1
    [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    """
    mesh = problem.mesh
    if mesh is None or mesh.lame is None:
        raise InvalidArgumentError(
            "the problem has no mesh with Lame coefficients; expected one made by fem.contact_problem, "
            "fem.solid_contact_problem or fem.mesh_problem, or BodyMesh(..., lame=...)"
        )
    moved = mesh.displacements(u)
    body = nodal_basis(mesh.points, mesh.cells)
    dimension = moved.shape[1]
    stresses = np.empty((len(mesh.cells), dimension, dimension))
    for block in body.blocks:
        values = np.empty(block.dofs.size)
        values[block.dofs] = moved[block.nodes]
        gradient: Any = block.basis.interpolate(values).grad  # (d, d, cells, points)
        mean = np.sum(gradient * block.basis.dx, axis=-1) / np.sum(block.basis.dx, axis=-1)
        strain = 0.5 * np.moveaxis(mean + np.swapaxes(mean, 0, 1), -1, 0)
        lam, mu = mesh.lame[block.rows].T[:, :, None, None]
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
        stresses[block.rows] = lam * trace * np.eye(dimension) + 2.0 * mu * strain
    return stresses


def von_mises(stresses: Floats) -> Floats:
    """The equivalent stress of von Mises of stresses (M, 3, 3), (M,)."""
    deviator = stresses - np.trace(stresses, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
    return np.asarray(np.sqrt(1.5 * np.sum(deviator**2, axis=(1, 2))))
