"""The body assembled by FEniCSx (dolfinx): ``python by_dolfinx.py MESH.npz PROBLEM.npz``, by itself, without enumsol.

MESH.npz is what run.py writes: points, triangles, loaded edges, contact nodes with normals, material, springs, load.
"""

from __future__ import annotations

import sys

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem.petsc import assemble_matrix
from mpi4py import MPI
from scipy.spatial import cKDTree

given = np.load(sys.argv[1])
points, (lam, mu), k = given["points"], given["lame"], float(given["spring"])
element = ufl.VectorElement("Lagrange", ufl.triangle, 1)
domain = mesh.create_mesh(MPI.COMM_WORLD, given["triangles"], points, ufl.Mesh(element))
V = fem.FunctionSpace(domain, element)

height = float(points[:, 1].max())
top = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[1], height))
tags = mesh.meshtags(domain, 1, np.sort(top), np.full(len(top), 1, dtype=np.int32))
ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
strain = ufl.sym(ufl.grad(u))
stress = lam * ufl.tr(strain) * ufl.Identity(2) + 2 * mu * strain
a = ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx + k * ufl.inner(u, v) * ds(1)
traction = fem.Constant(domain, np.array(given["traction"], dtype=float))
f = fem.assemble_vector(fem.form(ufl.inner(traction, v) * ds(1))).array
assembled = assemble_matrix(fem.form(a))
assembled.assemble()
indptr, indices, data = assembled.getValuesCSR()

# dolfinx numbers nodes anew: two degrees of freedom at every place, x first
places = V.tabulate_dof_coordinates()[:, :2]
node = cKDTree(places).query(points[given["contact"]])[1]
Bn, Bt = np.zeros((2, len(node), len(f)))
for row, (place, (nx, ny)) in enumerate(zip(node, given["normals"], strict=True)):
    Bn[row, [2 * place, 2 * place + 1]] = nx, ny
    Bt[row, [2 * place, 2 * place + 1]] = -ny, nx
np.savez(
    sys.argv[2], A_data=data, A_indices=indices, A_indptr=indptr, A_shape=[len(f)] * 2, A_format="csr",
    Bn=Bn, Bt=Bt, f=f, gap=given["gap"],
)  # fmt: skip
