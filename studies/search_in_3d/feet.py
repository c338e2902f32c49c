"""Bodies of tetrahedra that stand on the ground and hang on weak springs: the meshes in ``meshes``.

``NAME.geo`` describes a body; gmsh 4.15 made NAME-p.msh of it, a mesh with p contact nodes, by a size of elements.
"""

from __future__ import annotations

from pathlib import Path

from enumsol import fem

MESHES = Path(__file__).parent / "meshes"
#: Height of a body and area of its top.
BODIES = {"box": (0.5, 0.8), "foot": (0.6, 0.152), "angle": (0.9, 0.15)}
NAMES = "box-11", "angle-14", "foot-16"
#: Stiffness of all springs together by that of a bar of the body's height h and section h^2, which is E h.
SPRINGS = 1e-3, 1e-1
FRICTION = 0.2, 0.5, 1.0
#: Traction on the top by Young's modulus.
LOAD = 3e-4, 1e-4, -1e-3


def foot(name, spring, friction):
    """A body that is pressed on the ground and pulled, with springs at its top."""
    height, area = BODIES[name.partition("-")[0]]
    stiffness = height * spring / area
    return fem.mesh_problem(
        fem.read_mesh(MESHES / f"{name}.msh"),
        young=1.0,
        poisson=0.3,
        contact="bottom",
        spring={"top": (stiffness, stiffness)},
        load={"top": LOAD},
        friction=friction,
    )
