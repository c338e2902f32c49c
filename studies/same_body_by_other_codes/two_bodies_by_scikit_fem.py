"""Two bodies assembled by scikit-fem: ``python two_bodies_by_scikit_fem.py MESH.npz PROBLEM.npz``, without enumsol.

MESH.npz is what run.py writes: points, triangles, nodes of the upper body on the lower one and of the lower one below
it, held nodes, loaded edges, material, traction, gap.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.sparse import csr_matrix
from skfem import Basis, ElementTriP1, ElementVector, LinearForm, MeshTri
from skfem.helpers import dot
from skfem.models.elasticity import linear_elasticity

given = np.load(sys.argv[1])
points, (lam, mu) = given["points"], given["lame"]
mesh = MeshTri(points.T.copy(), np.sort(given["triangles"], axis=1).T.copy())
basis = Basis(mesh, ElementVector(ElementTriP1()))
loaded = set(map(tuple, np.sort(given["loaded"], axis=1).tolist()))
facets = [k for k, ends in enumerate(np.sort(mesh.facets.T, axis=1).tolist()) if tuple(ends) in loaded]
traction = given["traction"][:, None, None]
A = csr_matrix(linear_elasticity(lam, mu).assemble(basis))
f = LinearForm(lambda v, _: dot(traction, v)).assemble(basis.boundary(np.array(facets)))

# the displacement of a node less that of the straight line below it, out of the upper body and to the right
slave, master = given["slave"], given["master"][np.argsort(points[given["master"], 0])]
shares = [np.interp(points[slave, 0], points[master, 0], one) for one in np.eye(len(master))]
across, along = np.zeros((2, len(slave), len(f)))
for row, node in enumerate(slave):
    across[row, basis.nodal_dofs[1, node]], along[row, basis.nodal_dofs[0, node]] = -1, 1
for node, share in zip(master, shares, strict=True):
    across[:, basis.nodal_dofs[1, node]], along[:, basis.nodal_dofs[0, node]] = share, -share
free = np.setdiff1d(np.arange(len(f)), basis.nodal_dofs[:, given["held"]].ravel())
A = csr_matrix(A[free][:, free])
parts = {f"A_{part}": getattr(A, part) for part in ("data", "indices", "indptr", "shape", "format")}
np.savez(sys.argv[2], Bn=across[:, free], Bt=along[:, free], f=f[free], gap=given["gap"], **parts)
