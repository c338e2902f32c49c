"""Meshes and matrices, assembled by scikit-fem: bodies in 2D and in 3D as contact problems.

From a mesh with named parts, of a file or in memory: `read_mesh`, `mesh_problem`, `read_mesh_problem`, `scene_steps`,
`lame`. From a basis of scikit-fem: `basis_contact_problem`. From arrays, in the plane: `rectangle`, `trapezoid`,
`stiffness`, `edge_forces`, `body_forces`, `contact_problem`; in 3D: `box`, `solid_stiffness`, `facet_forces`,
`solid_body_forces`, `solid_contact_problem` (with multipliers on patches, too), `h1_norms`. What a plane body does not
need is loaded when first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
