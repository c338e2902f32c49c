"""Norms of displacements, slips and normal forces on the mesh of a problem in 3D (theory, section 11.4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.bases import nodal_basis
from enumsol.model.problem3d import ContactProblem3D
from enumsol.support.arguments import instance_of
from enumsol.support.array_arguments import vector_of
from enumsol.support.array_types import ArrayLike, Floats

#: Columns that are solved for at a time.
_BLOCK = 64


@dataclass(frozen=True, eq=False)
class MeshNorms:
    """Norms of a problem in 3D whose mesh is known.

    Attributes
    ----------
    G : (n, n) csc_array
        Gram matrix of H^1 on the free degrees of freedom: mass and gradients [length^3, length].
    Bn : (p, n) csr_array
        Normal contact rows of the problem.
    areas : (p,) array
        Area of each contact row [length^2].
    """

    G: sp.csc_array
    Bn: sp.csr_array
    areas: Floats

    @cached_property
    def dual(self) -> Floats:
        """Bn G^-1 Bn', (p, p)."""
        from enumsol.condensation.factorization import Factorization  # scipy's solvers come with the first use

        factorization, p = Factorization(self.G), self.Bn.shape[0]
        columns = [
            self.Bn @ factorization.solve(self.Bn[start : start + _BLOCK].T.toarray()) for start in range(0, p, _BLOCK)
        ]
        matrix = np.hstack(columns)
        return np.asarray(0.5 * (matrix + matrix.T))

    def of_displacement(self, u: ArrayLike) -> float:
        """||u||_1 for u of shape (n,)."""
        v = vector_of(u, "u", self.G.shape[0])
        return float(np.sqrt(v @ (self.G @ v)))

    def of_force(self, mu: ArrayLike) -> float:
        """||mu||_(-1/2,h) for normal forces mu of shape (p,): the supremum of mu' Bn v over ||v||_1 = 1."""
        v = vector_of(mu, "mu", len(self.areas))
        return float(np.sqrt(v @ self.dual @ v))

    def of_slip(self, phi: ArrayLike) -> float:
        """||phi||_0 for slips of shape (p,), the root of sum_i m_i phi_i^2 (theory, (11.4))."""
        v = vector_of(phi, "phi", len(self.areas))
        return float(np.sqrt(self.areas @ v**2))


def h1_norms(problem: ContactProblem3D) -> MeshNorms:
    """Norms on the mesh of a problem, such as `solid_contact_problem` makes.

    Parameters
    ----------
    problem : ContactProblem3D
        With ``mesh`` and ``areas``.

    Raises
    ------
    InvalidArgumentError
        It has no mesh or no areas.

    Examples
    --------
    >>> import enumsol
    >>> norms = enumsol.fem.h1_norms(enumsol.gallery.block3d(2, 2, 2))
    >>> norms.dual.shape
    (6, 6)
    """
    from skfem import BilinearForm  # as in bases
    from skfem.helpers import ddot, dot, grad

    instance_of(problem, ContactProblem3D, "problem")
    if problem.mesh is None or problem.areas is None:
        raise InvalidArgumentError("problem has no mesh or no areas; expected one made of a mesh")

    def product(u: object, v: object, _: object) -> Any:
        return dot(u, v) + ddot(grad(u), grad(v))

    # products of linear functions have degree two: exact on tetrahedra and parallelepipeds
    body = nodal_basis(problem.mesh.points, problem.mesh.cells, degree=2)
    motion = problem.mesh.motion
    G = sp.csc_array(motion.T @ body.matrix(BilinearForm(product)) @ motion)
    return MeshNorms(G, problem.Bn, problem.areas)
