"""Named contact problems for documentation, tests and benchmarks: small closed forms, blocks, wedges and chains.

Every function returns a `ContactProblem`, those whose names end with 3d a `ContactProblem3D`. `GALLERY` lists
ready-made ones with a parameter value at which each is worth a look and, where it is known, the number of its roots
there; `get` finds one by name.
"""

from enumsol.gallery.catalogue import GALLERY, GalleryEntry, close_names, get
from enumsol.gallery.problems import (
    block_on_table,
    chain,
    clamped_block,
    one_node_triangle,
    taper,
    two_node_square,
    wedge,
)
from enumsol.gallery.solid_gallery import block3d, one_node_3d, wedge3d

__all__ = [
    "GALLERY",
    "GalleryEntry",
    "block3d",
    "block_on_table",
    "chain",
    "clamped_block",
    "close_names",
    "get",
    "one_node_3d",
    "one_node_triangle",
    "taper",
    "two_node_square",
    "wedge",
    "wedge3d",
]
