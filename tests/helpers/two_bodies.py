"""Meshes of several bodies that share no node."""

import numpy as np
from parted_meshes import grid
from parted_solids import solid

from enumsol import fem


def together(*named):
    """One mesh of several, their parts with names such as upper.top; no node is shared."""
    points, cells, facets, count = [], [], {}, 0
    for name, mesh in named:
        points.append(mesh.points)
        cells.append(mesh.cells + count)
        facets |= {f"{name}.{part}": rows + count for part, rows in mesh.facets.items()}
        count += len(mesh.points)
    made = fem.PartedMesh if points[0].shape[1] == 2 else fem.SolidMesh
    return made(np.concatenate(points), np.concatenate(cells), facets)


def stacked(mesh, **options):
    """A body on another one in one mesh, with friction 0.3 where nothing else is said."""
    given = {"young": 2.0, "poisson": 0.3, "friction": 0.3, "pairs": [("upper.bottom", "lower.top")]}
    return fem.mesh_problem(mesh, **given | options)


def shifted(mesh, by):
    return type(mesh)(mesh.points + np.asarray(by), mesh.cells, mesh.facets)


def blocks(kind, upper=2, lower=2, gap=0.0, shake=0.0):
    """A block on another one, as wide, in 2D or 3D."""
    top = grid(upper, 2, kind, 2.0, 1.0, shake=shake, seed=1)
    bottom = grid(lower, 2, kind, 2.0, 1.0, shake=shake, seed=2)
    return together(("upper", shifted(top, (0, 1 + gap))), ("lower", bottom))


def boxes(kind, upper=2, lower=2, gap=0.0):
    top = solid((upper, upper, 1), kind, (1.0, 1.0, 0.5))
    bottom = solid((lower, lower, 1), kind, (1.0, 1.0, 0.5))
    return together(("upper", shifted(top, (0, 0, 0.5 + gap))), ("lower", bottom))
