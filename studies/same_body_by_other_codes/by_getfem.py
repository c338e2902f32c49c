"""The body assembled by GetFEM: ``python by_getfem.py MESH.npz PROBLEM.npz``, by itself, without enumsol.

MESH.npz is what run.py writes: points, triangles, loaded edges, contact nodes with normals, material, springs, load.
"""

from __future__ import annotations

import sys

import getfem
import numpy as np

getfem.util_trace_level(0)
given = np.load(sys.argv[1])
points, (lam, mu), k = given["points"], given["lame"], float(given["spring"])
mesh = getfem.Mesh("empty", 2)
for triangle in given["triangles"]:
    mesh.add_convex(getfem.GeoTrans("GT_PK(2,1)"), points[triangle].T)
height = float(points[:, 1].max())
outer = mesh.outer_faces()
normals = mesh.normal_of_faces(outer)
mesh.set_region(1, outer[:, normals[1] > 1 - 1e-9])

space = getfem.MeshFem(mesh, 2)
space.set_fem(getfem.Fem("FEM_PK(2,1)"))
quadrature = getfem.MeshIm(mesh, getfem.Integ("IM_TRIANGLE(6)"))
model = getfem.Model("real")
model.add_fem_variable("u", space)
for name, value in (("lam", lam), ("mu", mu), ("k", k)):
    model.add_initialized_data(name, [float(value)])
model.add_initialized_data("traction", given["traction"])
model.add_linear_term(quadrature, "(lam*Div_u*Id(2) + 2*mu*Sym(Grad_u)):Grad_Test_u")
model.add_linear_term(quadrature, "k*u.Test_u", 1)
model.add_source_term(quadrature, "traction.Test_u", 1)
model.assembly()
A, f = model.tangent_matrix(), model.rhs()
A.to_csc()
indptr, indices = A.csc_ind()

# GetFEM numbers nodes anew: degrees of freedom at one place, x before y
places = space.basic_dof_nodes().T
first = [int(np.flatnonzero(np.all(np.isclose(places, point), axis=1))[0]) for point in points[given["contact"]]]
Bn, Bt = np.zeros((2, len(first), len(f)))
for row, (dof, (nx, ny)) in enumerate(zip(first, given["normals"], strict=True)):
    Bn[row, [dof, dof + 1]] = nx, ny
    Bt[row, [dof, dof + 1]] = -ny, nx
np.savez(
    sys.argv[2], A_data=A.csc_val(), A_indices=indices, A_indptr=indptr, A_shape=[len(f)] * 2, A_format="csc",
    Bn=Bn, Bt=Bt, f=f, gap=given["gap"],
)  # fmt: skip
