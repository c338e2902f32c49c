"""Cells as files hold them, in blocks of one type each, as the one table of cells that a mesh has.

Quadrilaterals and hexahedra that name nodes twice become the triangles, wedges and tetrahedra that they are, and solids
of second order without nodes on their quadrilateral facets get them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enumsol.decks.elements import shape_of
from enumsol.decks.faces import uncollapsed
from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import cell_name
from enumsol.model.cells import KINDS, by_kind, facet_rows, node_counts, padded
from enumsol.support.array_types import Floats, Integers

#: Numbers of nodes of solids that are completed, and those that they have then.
COMPLETED = {20: 27, 15: 18}
#: Numbers of nodes of pyramids.
_PYRAMIDS = (5, 13)


def joined(points: Floats, blocks: Sequence[Integers], labels: Integers | None = None) -> tuple[Floats, Integers]:
    """Points and cells (M, k) of blocks of cells, each (m, n) in the order of VTK, as `PartedMesh` has them.

    Solids may have 15 or 20 nodes, too. The new nodes have the last numbers; nodes of no cell are kept. ``labels`` (M,)
    are the numbers by which messages name cells; by default their rows.

    Raises
    ------
    InvalidArgumentError
        A cell names its last node twice and is no triangle, wedge or tetrahedron.
    """
    dimension = points.shape[1]
    rows, parts, first = [], [], 0
    for block in blocks:
        shape = shape_of(dimension, block.shape[1])
        kinds = [(np.arange(len(block)), block)] if shape is None else [k[1:] for k in uncollapsed(shape, block)]
        for own, nodes in kinds:
            twice = (node_counts(nodes) < nodes.shape[1]) | (nodes.shape[1] in _PYRAMIDS)
            if np.any(twice):
                name = cell_name(int(first + own[np.argmax(twice)]), labels)
                how = " as a pyramid does, of which there is no kind" if nodes.shape[1] in _PYRAMIDS else ""
                raise InvalidArgumentError(f"{name} names a node twice{how}; expected distinct nodes")
            rows.append(first + own)
            parts.append(nodes)
        first += len(block)
    if dimension == 3:
        points, parts = completed(points, parts)
    cells = padded(parts)
    return points, np.asarray(cells[np.argsort(np.concatenate(rows), kind="stable")])


def completed(points: Floats, parts: Sequence[Integers]) -> tuple[Floats, list[Integers]]:
    """Hexahedra with 20 nodes as such with 27, and wedges with 15 as such with 18, of the same shape.

    The new nodes have the last numbers. On facets with eight nodes a uniform pressure pulls at the corners; on those
    with nine it presses on every node.
    """
    known: dict[tuple[int, ...], int] = {}
    places: list[Floats] = []
    found = []
    for cells in parts:
        count = COMPLETED.get(cells.shape[1])
        if count is None:
            found.append(cells)
            continue
        kind = KINDS[3, count]
        added = []
        for side in kind.sides:
            if len(side) == 9:
                keys = np.sort(cells[:, side[:4]], axis=1).tolist()
                at = 0.5 * points[cells[:, side[4:8]]].sum(axis=1) - 0.25 * points[cells[:, side[:4]]].sum(axis=1)
                added.append(_numbers(keys, at, known, places, len(points)))
        if kind.form == "hexahedron":
            inside = 0.25 * (points[cells[:, 8:20]].sum(axis=1) - points[cells[:, :8]].sum(axis=1))
            added.append(_numbers(cells.tolist(), inside, known, places, len(points)))
        found.append(np.concatenate([cells, np.stack(added, axis=1)], axis=1))
    return np.concatenate([points, *(place[None] for place in places)]), found


def completing(dimension: int, cells: Integers, count: int) -> list[tuple[Integers, Floats]]:
    """Nodes from ``count`` on, which complete cells as in `completed`, by those that their cells have without them.

    Returns
    -------
    list of (k, 1 + s) int array and (s,) array
        Each row a node and others, and the values of their shape functions there.
    """
    found = []
    for _, nodes in by_kind(dimension, cells):
        kind = KINDS[dimension, nodes.shape[1]]
        around = [(side[8], side[:8], np.repeat([-0.25, 0.5], 4)) for side in kind.sides if len(side) == 9]
        if nodes.shape[1] == 27:
            around.append((26, np.arange(20), np.repeat([-0.25, 0.25], [8, 12])))
        for own, others, shares in around:
            new = nodes[nodes[:, own] >= count]
            found.append((np.column_stack([new[:, own], new[:, others]]), shares))
    return found


def _numbers(
    keys: list[list[int]], places: Floats, known: dict[tuple[int, ...], int], new: list[Floats], first: int
) -> Integers:
    """Numbers of nodes of these keys; those that are not known are new, at their places."""
    found = []
    for key, place in zip(keys, places, strict=True):
        number = known.setdefault(tuple(key), first + len(new))
        if number == first + len(new):
            new.append(place)
        found.append(number)
    return np.array(found, dtype=np.int64)


def as_cells_have(facets: Integers, cells: Integers, name: str) -> Integers:
    """Facets of solids with the nodes that completed cells have there.

    Raises
    ------
    InvalidArgumentError
        One is no facet of a cell.
    """
    kinds = by_kind(3, cells)
    every = padded([nodes[:, side] for _, nodes in kinds for side in KINDS[3, nodes.shape[1]].sides])
    rows = facet_rows(3, facets, every)
    if -1 in rows:
        raise InvalidArgumentError(f"{name} has facets that belong to no cell; expected facets of the body")
    return np.asarray(every[rows])
