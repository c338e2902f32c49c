"""Where the names are at home."""

from .assembly import (
    basis_contact_problem as basis_contact_problem,
    body_forces as body_forces,
    contact_problem as contact_problem,
    edge_forces as edge_forces,
    stiffness as stiffness,
    triangle_stiffness as triangle_stiffness,
)
from .bases import MeshNorms as MeshNorms, cell_stresses as cell_stresses, h1_norms as h1_norms
from .mesh_files import read_mesh as read_mesh, read_solid as read_solid
from .mesh_problems import (
    mesh_problem as mesh_problem,
    mesh_scene as mesh_scene,
    read_mesh_problem as read_mesh_problem,
    read_mesh_scene as read_mesh_scene,
    scene_steps as scene_steps,
)
from .meshes import (
    Mesh as Mesh,
    PartedMesh as PartedMesh,
    SolidMesh as SolidMesh,
    blocks as blocks,
    box as box,
    edges_along as edges_along,
    lame as lame,
    rectangle as rectangle,
    trapezoid as trapezoid,
)
from .scenes import Scene as Scene
from .solid_problems import (
    facet_forces as facet_forces,
    solid_body_forces as solid_body_forces,
    solid_contact_problem as solid_contact_problem,
    solid_stiffness as solid_stiffness,
)
