"""Meshes and matrices: from a plane-strain body of P1 triangles to a ContactProblem (assembled by scikit-fem)."""

from enumsol.fem.assembly import body_forces, contact_problem, edge_forces, stiffness, triangle_stiffness
from enumsol.fem.meshes import Mesh, edges_along, rectangle, trapezoid

__all__ = [
    "Mesh",
    "body_forces",
    "contact_problem",
    "edge_forces",
    "edges_along",
    "rectangle",
    "stiffness",
    "trapezoid",
    "triangle_stiffness",
]
