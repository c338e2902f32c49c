"""Meshes and matrices, assembled by scikit-fem: bodies in 2D and in 3D as contact problems.

From a mesh with named parts, of a file or in memory: `read_mesh`, `mesh_problem`, `read_mesh_problem`, `lame`. From a
basis of scikit-fem: `basis_contact_problem`. From arrays, in the plane: `rectangle`, `trapezoid`, `stiffness`,
`edge_forces`, `body_forces`, `contact_problem`; in 3D: `box`, `solid_stiffness`, `facet_forces`, `solid_body_forces`,
`solid_contact_problem` (with multipliers on patches, too), `h1_norms`. What a plane body does not need is loaded when
first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from enumsol.fem.assembly import body_forces, contact_problem, edge_forces, stiffness, triangle_stiffness
from enumsol.fem.mesh_checks import lame
from enumsol.fem.meshes import Mesh, edges_along, rectangle, trapezoid
from enumsol.fem.named_parts import PartedMesh

if TYPE_CHECKING:
    from enumsol.fem.basis_problems import basis_contact_problem
    from enumsol.fem.mesh_files import read_mesh, read_solid
    from enumsol.fem.mesh_problems import mesh_problem, read_mesh_problem
    from enumsol.fem.norms import MeshNorms, h1_norms
    from enumsol.fem.solid_meshes import SolidMesh, blocks, box
    from enumsol.fem.solid_problems import solid_contact_problem
    from enumsol.fem.solids import facet_forces, solid_body_forces, solid_stiffness

__all__ = [
    "Mesh",
    "MeshNorms",
    "PartedMesh",
    "SolidMesh",
    "basis_contact_problem",
    "blocks",
    "body_forces",
    "box",
    "contact_problem",
    "edge_forces",
    "edges_along",
    "facet_forces",
    "h1_norms",
    "lame",
    "mesh_problem",
    "read_mesh",
    "read_mesh_problem",
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
    "basis_problems": ("basis_contact_problem",),
    "mesh_problems": ("mesh_problem", "read_mesh_problem"),
    "mesh_files": ("read_mesh", "read_solid"),
    "norms": ("MeshNorms", "h1_norms"),
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
