"""Boxes with named sides, of every kind of cell in 3D; second order is made without the package."""

import numpy as np

from enumsol import fem

TETRA_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
HEXA_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
WEDGE_EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
WEDGE_SIDES = ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
HEXA_SIDES = ((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7))


#: Outward normals of the sides of a box.
NORMALS = {"left": (-1, 0, 0), "right": (1, 0, 0), "front": (0, -1, 0), "back": (0, 1, 0)}
NORMALS |= {"bottom": (0, 0, -1), "top": (0, 0, 1)}


def rotation(seed=0):
    """A random rotation of space."""
    Q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def solid(counts, kind, size=(1.0, 1.0, 1.0), shake=0.0, seed=0):
    """A box of tetrahedra (4, 10), wedges (6, 15, 18) or hexahedra (8, 20, 27), edges between its corners straight.

    Corners inside are moved. Wedges stand on the bottom.
    """
    corners = {4: 4, 10: 4, 6: 6, 15: 6, 18: 6}.get(kind, 8)
    mesh = fem.box(*counts, size, "tetrahedra" if corners == 4 else "hexahedra")
    points = mesh.points.copy()
    inside = np.all((points > 1e-9) & (points < np.array(size) - 1e-9), axis=1)
    points[inside] += np.random.default_rng(seed).uniform(-shake, shake, (inside.sum(), 3))
    cells, facets = mesh.cells, {name: list(part.tolist()) for name, part in mesh.facets.items()}
    if corners == 6:
        cells = np.concatenate([cells[:, [0, 1, 2, 4, 5, 6]], cells[:, [0, 2, 3, 4, 6, 7]]])
        for name in ("bottom", "top"):  # a corner first at which the diagonals of all cells begin
            turned = [facet[facet.index(min(facet)) :] + facet[: facet.index(min(facet))] for facet in facets[name]]
            facets[name] = [[f[0], f[k], f[k + 1]] for f in turned for k in (1, 2)]
    if kind == corners:
        return fem.SolidMesh(points, cells, {name: _table(part) for name, part in facets.items()})
    points, new = list(points), {}

    def middle(nodes):
        key = tuple(sorted(nodes))
        if key not in new:
            new[key] = len(points)
            points.append(np.mean([points[node] for node in nodes], axis=0))
        return new[key]

    def around(facet):
        between = [middle((facet[k], facet[(k + 1) % len(facet)])) for k in range(len(facet))]
        return [*facet, *between, *([middle(facet)] if kind in (18, 27) and len(facet) == 4 else [])]

    edges = {4: TETRA_EDGES, 6: WEDGE_EDGES, 8: HEXA_EDGES}[corners]
    sides = {18: WEDGE_SIDES, 27: HEXA_SIDES}.get(kind, ())
    rows = []
    for cell in cells.tolist():
        row = cell + [middle((cell[a], cell[b])) for a, b in edges]
        row += [middle([cell[k] for k in side]) for side in sides] + ([middle(cell)] if kind == 27 else [])
        rows.append(row)
    made = {name: _table([around(facet) for facet in part]) for name, part in facets.items()}
    return fem.SolidMesh(np.array(points), np.array(rows), made)


def _table(facets):
    """Facets as one array, those of fewer nodes than others repeating their last."""
    width = max(map(len, facets))
    return np.array([facet + facet[-1:] * (width - len(facet)) for facet in facets])


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
