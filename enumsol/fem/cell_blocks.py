"""Cells as files hold them, in blocks of one type each, as the one table of cells that a mesh has.

Quadrilaterals and hexahedra that name nodes twice become the triangles, wedges and tetrahedra that they are, and solids
of second order without nodes on their quadrilateral facets get them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import cell_name
from enumsol.model.cells import EDGES, KINDS, by_kind, facet_rows, node_counts, padded
from enumsol.support.array_types import Floats, Integers

#: Numbers of nodes of solids that are completed, and those that they have then.
COMPLETED = {20: 27, 15: 18}
#: Numbers of nodes of quadrilaterals and hexahedra in files, by dimension; their corners.
_COLLAPSING = {2: {4: 4, 8: 4, 9: 4}, 3: {8: 8, 20: 8}}


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
        for own, nodes in _uncollapsed(dimension, block):
            twice = node_counts(nodes) < nodes.shape[1]
            if np.any(twice):
                name = cell_name(int(first + own[np.argmax(twice)]), labels)
                raise InvalidArgumentError(f"{name} names a node twice; expected distinct nodes")
            rows.append(first + own)
            parts.append(nodes)
        first += len(block)
    if dimension == 3:
        points, parts = completed(points, parts)
    cells = padded(parts)
    return points, np.asarray(cells[np.argsort(np.concatenate(rows), kind="stable")])


def _uncollapsed(dimension: int, cells: Integers) -> list[tuple[Integers, Integers]]:
    """Rows and nodes of cells, those that name corners twice as what they are; others that do so stay as they are."""
    corners = _COLLAPSING[dimension].get(cells.shape[1])
    if corners is None or not len(cells):
        return [(np.arange(len(cells)), cells)]
    same = np.argmax(cells[:, :corners, None] == cells[:, None, :corners], axis=2)
    patterns, which = np.unique(same, axis=0, return_inverse=True)
    found = []
    for k, pattern in enumerate(patterns.tolist()):
        rows = np.flatnonzero(which.reshape(-1) == k)
        found.append((rows, cells[rows][:, _nodes_of(dimension, pattern, cells.shape[1])]))
    return found


def _nodes_of(dimension: int, pattern: list[int], count: int) -> list[int]:
    """Which of the nodes of a cell those of its shape are; ``pattern`` has the first equal corner of every corner."""
    every, whole = list(range(count)), list(range(len(pattern)))
    if pattern == whole:
        return every
    if dimension == 2:
        corners = _around([pattern[k] for k in whole])
        return every if len(corners) != 3 else _with_edges(corners, "triangle", "quadrilateral", pattern, count)
    sides = [_around([pattern[k] for k in side]) for side in KINDS[3, 8].facets.tolist()]
    sides = [side for side in sides if len(side) > 2]
    triangles = [side for side in sides if len(side) == 3]
    distinct = len(set(pattern))
    if distinct == len(triangles) == len(sides) == 4:
        (apex,) = set(pattern) - set(triangles[0])
        a, c, b = triangles[0]
        return _with_edges([a, b, c, apex], "tetrahedron", "hexahedron", pattern, count)
    if distinct == 6 and len(sides) == 5 and len(triangles) == 2 and not set(triangles[0]) & set(triangles[1]):
        a, c, b = triangles[0]
        edges = {frozenset(pair) for side in sides for pair in zip(side, [*side[1:], side[0]], strict=True)}
        above = [next((y for y in triangles[1] if {x, y} in edges), x) for x in (a, b, c)]
        if len({a, b, c, *above}) == 6:
            return _with_edges([a, b, c, *above], "wedge", "hexahedron", pattern, count)
    return every


def _around(side: list[int]) -> list[int]:
    """Corners around a side without those that follow themselves; none if one comes back later."""
    kept = [node for node, before in zip(side, [side[-1], *side[:-1]], strict=True) if node != before]
    return kept if len(set(kept)) == len(kept) else []


def _with_edges(corners: list[int], form: str, old: str, pattern: list[int], count: int) -> list[int]:
    """Corners, and in second order the nodes between them."""
    if count == len(pattern):
        return corners
    ends = [{pattern[a], pattern[b]} for a, b in EDGES[old]]
    return corners + [len(pattern) + ends.index({corners[a], corners[b]}) for a, b in EDGES[form]]


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
