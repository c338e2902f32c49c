"""The body assembled by FEniCSx (dolfinx): ``python by_dolfinx.py MESH.npz PROBLEM.npz``, by itself, without enumsol.

MESH.npz is what run.py writes: points, triangles, loaded edges, contact nodes with normals, material, springs, load.
It takes the interface of dolfinx up to 0.6 (Debian 12 has 0.5) and that of later versions, in which elements come from
basix, ``functionspace`` takes the place of the class, and an argument of ``create_mesh`` has another name and place.
"""

from __future__ import annotations

import inspect
import sys

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

given = np.load(sys.argv[1])
points, (lam, mu), k = given["points"], given["lame"], float(given["spring"])
old = hasattr(ufl, "VectorElement")  # up to dolfinx 0.6
if old:
    element = ufl.VectorElement("Lagrange", ufl.triangle, 1)
else:
    import basix.ufl

    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
about_mesh = "e" if "e" in inspect.signature(mesh.create_mesh).parameters else "domain"
triangles = np.array(given["triangles"], dtype=np.int64)
domain = mesh.create_mesh(MPI.COMM_WORLD, triangles, x=points, **{about_mesh: ufl.Mesh(element)})
V = fem.FunctionSpace(domain, element) if old else fem.functionspace(domain, element)

height = float(points[:, 1].max())
top = mesh.locate_entities_boundary(domain, 1, lambda x: np.isclose(x[1], height))
tags = mesh.meshtags(domain, 1, np.sort(top), np.full(len(top), 1, dtype=np.int32))
ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
strain = ufl.sym(ufl.grad(u))
stress = lam * ufl.tr(strain) * ufl.Identity(2) + 2 * mu * strain
a = fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx + k * ufl.inner(u, v) * ds(1))
traction = fem.Constant(domain, np.array(given["traction"], dtype=float))
f = fem.assemble_vector(fem.form(ufl.inner(traction, v) * ds(1))).array
if old:  # its own matrices have no blocks, and displacements do
    from dolfinx.fem.petsc import assemble_matrix

    assembled = assemble_matrix(a)
    assembled.assemble()
    A = csr_matrix(assembled.getValuesCSR()[::-1], shape=(len(f), len(f)))
else:
    A = csr_matrix(fem.assemble_matrix(a).to_scipy())

# dolfinx numbers nodes anew: two degrees of freedom at every place, x first
places = V.tabulate_dof_coordinates()[:, :2]
node = cKDTree(places).query(points[given["contact"]])[1]
Bn, Bt = np.zeros((2, len(node), len(f)))
for row, (place, (nx, ny)) in enumerate(zip(node, given["normals"], strict=True)):
    Bn[row, [2 * place, 2 * place + 1]] = nx, ny
    Bt[row, [2 * place, 2 * place + 1]] = -ny, nx
parts = {f"A_{part}": getattr(A, part) for part in ("data", "indices", "indptr", "shape", "format")}
np.savez(sys.argv[2], Bn=Bn, Bt=Bt, f=f, gap=given["gap"], **parts)
