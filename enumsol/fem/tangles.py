"""Meshes that cover a place twice, or whose cells only seem to be joined: cells inside out, overlaps, cracks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.fem.mesh_checks import cell_name
from enumsol.model.cells import KINDS, boundary_facets, by_kind
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.fem.meshes import PartedMesh
    from enumsol.support.array_types import Floats, Integers, Mask

#: A point is inside a cell where all its coordinates there are larger than this: not where cells only touch, nor where
#: they are taken as plane although they are curved, or bend out of their plane.
_INSIDE = 1e-3
#: Nodes nearer to each other than this share of the extent of the mesh are at the same place.
SAME = 1e-9
#: Simplices that a cell of so many corners consists of, by dimension.
_SIMPLICES = {
    (2, 3): [[0, 1, 2]],
    (2, 4): [[0, 1, 2], [0, 2, 3]],
    (3, 4): [[0, 1, 2, 3]],
    (3, 8): [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}


def refuse_tangles(mesh: PartedMesh, body: Integers, paired: Mask) -> None:
    """Refuse meshes in which cells of one connected body overlap.

    As cells that share a facet are on different sides of it (`refuse_wrong_sides`), a body can overlap itself only
    where a facet of its boundary is inside of a cell. Faces of a crack may touch. ``body`` (N,) is the number of the
    connected body of each node, and ``paired`` (N,) says which belong to pairs: there a body may overlap itself or
    another, as by a press fit.

    Raises
    ------
    InvalidArgumentError
        Cells do; it names them.
    """
    facets = boundary_facets(mesh.points.shape[1], mesh.cells)
    facets = facets[~np.all(paired[facets], axis=1)]
    for own in _corners(mesh.points.shape[1], mesh.cells):
        _refuse_covered(mesh, own, facets, body)


def _corners(dimension: int, cells: Integers) -> list[tuple[Integers, Integers]]:
    """The rows of the cells of each kind, and their corners."""
    kinds = by_kind(dimension, cells)
    return [(rows, nodes[:, : KINDS[dimension, nodes.shape[1]].corners]) for rows, nodes in kinds]


def refuse_wrong_sides(points: Floats, cells: Integers, labels: Integers | None) -> None:
    """Refuse cells that are on the same side of a facet that they share: duplicates, folds, cells inside out.

    Raises
    ------
    InvalidArgumentError
        There are such; it names two of them.
    """
    dimension, sides, owners = points.shape[1], [], []
    for rows, corners in _corners(dimension, cells):
        kind = KINDS[dimension, corners.shape[1]]
        facets = corners[:, kind.facets]
        simplex = points[corners[:, _SIMPLICES[dimension, kind.corners][0]]]
        turned = np.linalg.det(simplex[:, 1:] - simplex[:, :1]) < 0
        facets[turned] = facets[turned][:, :, ::-1]
        sides.append(facets.reshape(-1, facets.shape[2]))
        owners.append(np.repeat(rows, facets.shape[1]))
    every, owner = np.concatenate(sides), np.concatenate(owners)
    # two cells on either side of a facet go around it in opposite directions, the least node first; edges have two ends
    first = np.argmin(every, axis=1)[:, None]
    along = np.take_along_axis(every, (first + 1) % every.shape[1], axis=1)[:, 0] if dimension == 3 else every[:, 0]
    order = np.lexsort(np.sort(every, axis=1).T)
    keys, along, owner = np.sort(every, axis=1)[order], along[order], owner[order]
    same = np.flatnonzero(np.all(keys[1:] == keys[:-1], axis=1) & (along[1:] == along[:-1]))
    third = np.flatnonzero(np.all(keys[2:] == keys[:-2], axis=1))
    wrong = np.union1d(same, third)
    if not len(wrong):
        return
    # a cell that is inside out is so with all its neighbours
    beside = np.concatenate([owner[wrong], owner[wrong + 1]])
    cell = int(np.argmax(np.bincount(beside)))
    k = int(wrong[np.flatnonzero((owner[wrong] == cell) | (owner[wrong + 1] == cell))[0]])
    other = int(owner[k] if owner[k] != cell else owner[k + 1])
    raise InvalidArgumentError(
        f"{cell_name(cell, labels)} overlaps {cell_name(other, labels)}, for both are on the same side of "
        f"what they share at {_place(points[keys[k]].mean(axis=0))}, or one of them is inside out; expected cells "
        "that cover the body once"
    )


def _refuse_covered(mesh: PartedMesh, own: tuple[Integers, Integers], facets: Integers, body: Integers) -> None:
    """Refuse cells of one kind that have a corner or the middle of a facet of the boundary inside."""
    from scipy.spatial import cKDTree  # not needed for problems without a mesh

    rows, corners = own
    dimension = mesh.points.shape[1]
    # corners and middles of the facets, each with the nodes that a cell there may have in common with the facet
    spread = [facets[:, k : k + 1] for k in range(dimension)] + [facets[:, :dimension]]
    curved = facets.shape[1] > (2 if dimension == 2 else 4) or (dimension, mesh.cells.shape[1]) in ((3, 10), (2, 6))
    places = np.concatenate([mesh.points[nodes].mean(axis=1) for nodes in spread])
    shared = [nodes for part in spread for nodes in (facets if curved else part).tolist()]
    centres = mesh.points[corners].mean(axis=1)
    reach = np.max(np.linalg.norm(mesh.points[corners] - centres[:, None], axis=2), axis=1)
    tree = cKDTree(places)
    found = np.flatnonzero(tree.query_ball_point(centres, reach, return_length=True))
    for row, near in zip(found, tree.query_ball_point(centres[found], reach[found]), strict=True):
        nodes = set(mesh.cells[rows[row]].tolist())
        apart = [k for k in near if body[shared[k][0]] == body[corners[row, 0]] and nodes.isdisjoint(shared[k])]
        if not apart:
            continue
        for simplex in _SIMPLICES[dimension, corners.shape[1]]:
            ends = mesh.points[corners[row, simplex]]
            inner = np.linalg.solve((ends[1:] - ends[0]).T, (places[apart] - ends[0]).T)
            deep = np.min(np.vstack([inner, 1.0 - inner.sum(axis=0)]), axis=0) > _INSIDE
            if np.any(deep):
                raise InvalidArgumentError(
                    f"{cell_name(int(rows[row]), mesh.labels)} overlaps other cells of its body, whose boundary is "
                    f"inside of it at {_place(places[apart[int(np.argmax(deep))]])}; expected cells that cover the "
                    "body once"
                )


def unjoined(mesh: PartedMesh, body: Integers, names: Sequence[str], joined: Sequence[Mask]) -> list[str]:
    """Notes on nodes of the boundary that are at the same place: cracks, and bodies that only seem to be joined.

    Parameters
    ----------
    mesh : PartedMesh
    body, names : the number of the connected body of each node, (N,), and what messages call each
    joined : sequence of (N,) bool arrays
        Nodes of contacts: where both nodes belong to one of them it is known that they are not joined.
    """
    from scipy.spatial import cKDTree  # as above

    boundary = np.unique(boundary_facets(mesh.points.shape[1], mesh.cells))
    near = SAME * float(np.max(np.ptp(mesh.points, axis=0)))
    twins = boundary[cKDTree(mesh.points[boundary]).query_pairs(near, output_type="ndarray")]
    for mask in joined:
        twins = twins[~np.all(mask[twins], axis=1)]
    notes = []
    for one in range(len(names)):
        for two in range(one, len(names)):
            found = twins[np.all(np.sort(body[twins], axis=1) == (one, two), axis=1)]
            if not len(found):
                continue
            places = mesh.points[np.unique(found[:, 0])]
            of = names[one] if one == two else f"{names[one]} and {names[two]}"
            at = _place(places[0]) if len(places) == 1 else f"{_place(places[0])} and elsewhere"
            does = "a crack that nothing closes" if one == two else "bodies that pass through each other there"
            notes.append(
                f"{counted(len(places), 'place')} of {of} {'have' if len(places) > 1 else 'has'} several nodes, at "
                f"{at}, which neither the mesh joins nor a pair: {does}"
            )
    return notes


def _place(at: Floats) -> str:
    return f"({', '.join(f'{float(value) + 0.0:.6g}' for value in at)})"
