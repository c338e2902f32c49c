"""Meshes and matrices, assembled by scikit-fem: bodies in plane strain and in 3D as contact problems.

Plane strain (P1 triangles): `rectangle`, `trapezoid`, `stiffness`, `edge_forces`, `body_forces`, `contact_problem`. In
3D (P1 tetrahedra, Q1 hexahedra): `box`, `read_solid`, `solid_stiffness`, `facet_forces`, `solid_body_forces`,
`solid_contact_problem`, `h1_norms`; these are loaded when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from enumsol.fem.assembly import body_forces, contact_problem, edge_forces, stiffness, triangle_stiffness
from enumsol.fem.meshes import Mesh, edges_along, rectangle, trapezoid

if TYPE_CHECKING:
    from enumsol.fem.norms import MeshNorms, h1_norms
    from enumsol.fem.solid_files import read_solid
    from enumsol.fem.solid_meshes import SolidMesh, blocks, box
    from enumsol.fem.solid_problems import solid_contact_problem
    from enumsol.fem.solids import facet_forces, solid_body_forces, solid_stiffness

__all__ = [
    "Mesh",
    "MeshNorms",
    "SolidMesh",
    "blocks",
    "body_forces",
    "box",
    "contact_problem",
    "edge_forces",
    "edges_along",
    "facet_forces",
    "h1_norms",
    "read_solid",
    "rectangle",
    "solid_body_forces",
    "solid_contact_problem",
    "solid_stiffness",
    "stiffness",
    "trapezoid",
    "triangle_stiffness",
]

_HOMES = {
    "norms": ("MeshNorms", "h1_norms"),
    "solid_files": ("read_solid",),
    "solid_meshes": ("SolidMesh", "blocks", "box"),
    "solid_problems": ("solid_contact_problem",),
    "solids": ("facet_forces", "solid_body_forces", "solid_stiffness"),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

if not TYPE_CHECKING:  # with it a type checker would accept any name

    def __getattr__(name: str) -> object:
        if name not in _HOME_OF:
            raise AttributeError(f"module 'enumsol.fem' has no attribute {name!r}")
        value = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
        globals()[name] = value
        return value
