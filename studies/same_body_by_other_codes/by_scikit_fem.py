"""The body assembled by scikit-fem: ``python by_scikit_fem.py MESH.npz PROBLEM.npz``, by itself, without enumsol.

MESH.npz is what run.py writes: points, triangles, loaded edges, contact nodes with normals, material, springs, load.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.sparse import csr_matrix
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, LinearForm, MeshTri
from skfem.helpers import dot
from skfem.models.elasticity import linear_elasticity

given = np.load(sys.argv[1])
points, (lam, mu), k = given["points"], given["lame"], float(given["spring"])
mesh = MeshTri(points.T.copy(), np.sort(given["triangles"], axis=1).T.copy())
basis = Basis(mesh, ElementVector(ElementTriP1()))
top = basis.boundary(mesh.facets_satisfying(lambda x: np.isclose(x[1], points[:, 1].max()), boundaries_only=True))
traction = given["traction"][:, None, None]
A = linear_elasticity(lam, mu).assemble(basis) + BilinearForm(lambda u, v, _: k * dot(u, v)).assemble(top)
f = LinearForm(lambda v, _: dot(traction, v)).assemble(top)

node = basis.nodal_dofs[:, given["contact"]].T
Bn, Bt = np.zeros((2, len(node), len(f)))
for row, (dofs, (nx, ny)) in enumerate(zip(node, given["normals"], strict=True)):
    Bn[row, dofs] = nx, ny
    Bt[row, dofs] = -ny, nx
A = csr_matrix(A)
parts = {f"A_{part}": getattr(A, part) for part in ("data", "indices", "indptr", "shape", "format")}
np.savez(sys.argv[2], Bn=Bn, Bt=Bt, f=f, gap=given["gap"], **parts)
