"""Named contact problems for documentation, tests and benchmarks: closed forms, blocks, wedges, parts of machines.

Every function returns a `ContactProblem`, those whose names end with 3d a `ContactProblem3D`. `GALLERY` lists
ready-made ones with a parameter value at which each is worth a look and, where it is known, the number of its roots
there; `get` finds one by name.
"""

from enumsol.gallery.catalogue import GALLERY, GalleryEntry, close_names, get
from enumsol.gallery.machine_parts import brake_shoe, clip, dovetail, lap_joint, pressed_rings
from enumsol.gallery.problems import (
    block3d,
    block_on_table,
    block_on_table3d,
    chain,
    clamped_block,
    one_node_3d,
    one_node_triangle,
    taper,
    two_node_square,
    wedge,
    wedge3d,
)

__all__ = [
    "GALLERY",
    "GalleryEntry",
    "block3d",
    "block_on_table",
    "block_on_table3d",
    "brake_shoe",
    "chain",
    "clamped_block",
    "clip",
    "close_names",
    "dovetail",
    "get",
    "lap_joint",
    "one_node_3d",
    "one_node_triangle",
    "pressed_rings",
    "taper",
    "two_node_square",
    "wedge",
    "wedge3d",
]
