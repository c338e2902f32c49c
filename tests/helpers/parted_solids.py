"""Boxes with named sides, of every kind of cell in 3D; second order is made without the package."""

import numpy as np

from enumsol import fem

TETRA_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
HEXA_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
HEXA_SIDES = ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))


#: Outward normals of the sides of a box.
NORMALS = {"left": (-1, 0, 0), "right": (1, 0, 0), "front": (0, -1, 0), "back": (0, 1, 0)}
NORMALS |= {"bottom": (0, 0, -1), "top": (0, 0, 1)}


def rotation(seed=0):
    """A random rotation of space."""
    Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def solid(counts, kind, size=(1.0, 1.0, 1.0), shake=0.0, seed=0):
    """A box of tetrahedra (4, 10) or hexahedra (8, 20, 27), its corners inside moved, edges between them straight."""
    mesh = fem.box(*counts, size, "tetrahedra" if kind in (4, 10) else "hexahedra")
    points = mesh.points.copy()
    inside = np.all((points > 1e-9) & (points < np.array(size) - 1e-9), axis=1)
    points[inside] += np.random.default_rng(seed).uniform(-shake, shake, (inside.sum(), 3))
    if kind in (4, 8):
        return fem.SolidMesh(points, mesh.cells, mesh.facets)
    points, new = list(points), {}

    def middle(nodes):
        key = tuple(sorted(nodes))
        if key not in new:
            new[key] = len(points)
            points.append(np.mean([points[node] for node in nodes], axis=0))
        return new[key]

    def around(facet):
        between = [middle((facet[k], facet[(k + 1) % len(facet)])) for k in range(len(facet))]
        return [*facet, *between, *([middle(facet)] if kind == 27 else [])]

    cells = []
    for cell in mesh.cells.tolist():
        row = cell + [middle((cell[a], cell[b])) for a, b in (TETRA_EDGES if kind == 10 else HEXA_EDGES)]
        if kind == 27:
            row += [middle([cell[k] for k in side]) for side in HEXA_SIDES] + [middle(cell)]
        cells.append(row)
    facets = {name: np.array([around(facet) for facet in part.tolist()]) for name, part in mesh.facets.items()}
    return fem.SolidMesh(np.array(points), np.array(cells), facets)


def moved(mesh, change):
    """The mesh with its points changed."""
    return fem.SolidMesh(change(mesh.points), mesh.cells, mesh.facets, mesh.node_sets)


def on_bottom(mesh, lame=(1, 1), **options):
    """A body in contact at its side "bottom", held at its left one where no springs hold it."""
    held = {} if "springs" in options else {"held": mesh.nodes("left")}
    given = {"contact": mesh.facets["bottom"], **held, **options}
    return fem.solid_contact_problem(mesh.points, mesh.cells, lame, **given)


def held_in_part(mesh):
    """Its left side is held, and its front along y alone."""
    held = np.zeros((len(mesh.points), 3), dtype=bool)
    held[mesh.nodes("left")] = True
    held[mesh.nodes("front"), 1] = True
    return held


def on_springs(mesh, lame, spring, loads, friction):
    """A body in contact at its side "bottom" with springs at every node, and loads (k, 3) on the k nodes at its top."""
    forces = np.zeros_like(mesh.points)
    forces[mesh.points[:, 2] > np.max(mesh.points[:, 2]) - 1e-9] = loads
    return on_bottom(mesh, lame, springs=(spring, spring, spring), forces=forces, friction=friction)
