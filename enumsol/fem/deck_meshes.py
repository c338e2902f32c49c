"""TEMPORARY."""

from types import MappingProxyType
import numpy as np
from enumsol.fem.meshes import PartedMesh, SolidMesh
from enumsol.fem.mesh_files import facets_of_sets


def mesh_of_deck(deck):
    blocks = [b for b in deck.blocks if b.type.is_body]
    d = 3 if any(b.type.family == "solid" for b in blocks) else 2
    used = np.unique(np.concatenate([b.nodes.ravel() for b in blocks]))
    number = np.full(len(deck.points), -1)
    number[used] = np.arange(len(used))
    cells = np.concatenate([number[b.nodes] for b in blocks])
    row = np.full(len(deck.element_labels), -1)
    first = k = 0
    kinds = {}
    for b in deck.blocks:
        if b.type.is_body:
            row[first : first + len(b.labels)] = np.arange(k, k + len(b.labels))
            k += len(b.labels)
        for r in range(first, first + len(b.labels)):
            kinds[r] = (b, r - first)
        first += len(b.labels)
    sets = {n: number[r] for n, r in deck.node_sets.items()}
    sets = {n: r[r >= 0] for n, r in sets.items()}
    found, sets = facets_of_sets(d, cells, {n: r for n, r in sets.items() if len(r)}, len(used))
    facets = dict(found)
    for n, s in deck.surfaces.items():
        if s.nodes is None:
            facets[n] = np.array(
                [
                    number[kinds[e][0].nodes[kinds[e][1]][list(kinds[e][0].type.shape.faces[f])]]
                    for e, f in s.faces.tolist()
                ]
            )
    bodies = {n: row[r][row[r] >= 0] for n, r in deck.element_sets.items()}
    labels = np.concatenate([b.labels for b in blocks])
    made = PartedMesh if d == 2 else SolidMesh
    points = deck.points[used][:, :d]
    if d == 3:
        from enumsol.fem.mesh_files import solid_cells

        points, cells = solid_cells(points, cells, labels)
    return made(
        points,
        cells,
        MappingProxyType(facets),
        MappingProxyType(sets),
        MappingProxyType(bodies),
        labels,
        tuple(dict.fromkeys(b.type.name for b in blocks)),
    )
