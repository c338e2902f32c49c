"""Faces of elements, by which surfaces name them, and elements that are collapsed to ones of fewer corners."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from enumsol.decks.cards import DeckPlace
from enumsol.decks.elements import EDGES, Shape, shape_of
from enumsol.decks.model import Deck, by_block
from enumsol.support.array_types import Integers

_NO_FACES = np.zeros((0, 2), dtype=np.int64)


def named_faces(deck: Deck, elements: Integers, label: str, place: DeckPlace) -> Integers:
    """Faces (k, 2) of elements: their rows and the numbers of their faces from 0, or as in `Surface`.

    Parameters
    ----------
    deck : Deck
    elements : (m,) int array
        Rows of the elements.
    label : str
        "S1" and so on, "SPOS" or "SNEG"; "" for the faces that belong to no other element.
    place : DeckPlace
        Where it is named, for messages.

    Raises
    ------
    InvalidArgumentError
        The elements have no such face.
    """
    found = [_NO_FACES]
    for first, block, own in by_block(deck.blocks, elements):
        faces = block.type.shape.faces if deck.is_body(block) else ()
        if not label and faces:
            free = free_faces(deck)
            found.append(free[np.isin(free[:, 0], first + own)])
            continue
        if not faces and block.type.shape.dimension and label in ("", "SPOS", "SNEG", "S1", "S2"):
            number = -2 if label == "SNEG" else -1
        elif label[:1] == "S" and label[1:].isdecimal() and 1 <= int(label[1:]) <= len(faces):
            number = int(label[1:]) - 1
        else:
            expected = f"S1 to S{len(faces)}" if faces else "SPOS or SNEG"
            raise place.refused(
                f"*SURFACE names the face {label or 'of no name'} of elements of type {block.type.name}; expected "
                f"{expected}"
            )
        found.append(np.column_stack([first + own, np.full(len(own), number)]))
    return np.concatenate(found)


def face_nodes(deck: Deck, faces: Integers) -> list[tuple[Shape, Integers]]:
    """Nodes (k, m) of faces, as rows of ``deck.points``, by their shapes: corners, then nodes between and inside.

    Faces of collapsed elements are triangles, or none if only a line or a point is left of them.
    """
    found: dict[str, tuple[Shape, list[Integers]]] = {}
    for _, block, own in by_block(deck.blocks, faces):
        shape = block.type.shape
        for number in np.unique(own[:, 1]).tolist():
            rows = own[own[:, 1] == number, 0]
            nodes = block.nodes[rows] if number < 0 else block.nodes[rows][:, shape.faces[number]]
            face = shape if number < 0 else shape_of(shape.dimension - 1, nodes.shape[1])
            if face is not None:
                for each, _, part in uncollapsed(face, nodes[:, face.to_vtk] if face.to_vtk and number < 0 else nodes):
                    if each.dimension == 1 or np.all(corners_of(part[:, : each.corners])[:, 1] >= 0):
                        found.setdefault(each.name, (each, []))[1].append(part)
    return [(shape, np.concatenate(parts)) for shape, parts in found.values()]


def corners_of(faces: Integers) -> Integers:
    """Corners (k, 4) of faces in ascending order, each once, behind -1 where there are fewer: the same for one face."""
    ordered = np.sort(faces, axis=1)
    ordered[:, 1:][ordered[:, 1:] == ordered[:, :-1]] = -1
    wide = np.full((len(faces), 4), -1, dtype=np.int64)
    wide[:, 4 - faces.shape[1] :] = ordered
    return np.sort(wide, axis=1)


def free_faces(deck: Deck) -> Integers:
    """Faces (k, 2) of bodies that belong to one element only, as in `Surface`."""
    keys, faces = [np.zeros((0, 4), dtype=np.int64)], [_NO_FACES]
    for first, block in zip(deck.firsts, deck.blocks, strict=False):
        shape = block.type.shape
        for number, nodes in enumerate(shape.faces if deck.is_body(block) else ()):
            corners = [node for node in nodes if node < shape.corners]
            keys.append(corners_of(block.nodes[:, corners]))
            faces.append(np.column_stack([first + np.arange(len(block.labels)), np.full(len(block.labels), number)]))
    every, of = np.concatenate(keys), np.concatenate(faces)
    # a side of a collapsed element may be a line or a point
    whole = np.sum(every >= 0, axis=1) >= max(deck.dimension, 2)
    _, rows, count = np.unique(every[whole], axis=0, return_index=True, return_counts=True)
    return np.asarray(of[whole][np.sort(rows[count == 1])])


def faces_of_nodes(deck: Deck, nodes: Integers) -> Integers:
    """Faces (k, 2) of bodies that belong to one element only and all of whose corners are among some nodes."""
    free, given = free_faces(deck), np.zeros(len(deck.points), dtype=bool)
    given[nodes] = True
    found = [_NO_FACES]
    for first, block, own in by_block(deck.blocks, free):
        for number in np.unique(own[:, 1]).tolist():
            faces = own[own[:, 1] == number]
            corners = [node for node in block.type.shape.faces[number] if node < block.type.shape.corners]
            whole = np.all(given[block.nodes[faces[:, 0]][:, corners]], axis=1)
            found.append(faces[whole] + np.array([first, 0]))
    return np.concatenate(found)


def _turns(form: str) -> list[list[int]]:
    """Corners in all orders that leave the shape of a quadrilateral or a hexahedron as it is, and do not mirror it."""
    if form == "quad":
        return [[(k + turn) % 4 for k in range(4)] for turn in range(4)]
    places = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    edges = {frozenset(edge) for edge in EDGES[form]}
    found = []
    for first, *ends in permutations(range(8), 4):
        axes = places[ends] - places[first]
        if all(frozenset((first, end)) in edges for end in ends) and np.linalg.det(axes) > 0:
            at = places[first] + places @ axes
            found.append([int(np.flatnonzero(np.all(places == place, axis=1))[0]) for place in at])
    return found


#: Corners of one element that are the same node, and the corners and edges of the one that is left.
_COLLAPSES = {
    "quad": (("triangle", ((2, 3),), (0, 1, 2), ((0, 1), (1, 2), (3, 0))),),
    "hexahedron": (
        ("tetra", ((2, 3), (4, 5), (5, 6), (6, 7)), (0, 1, 2, 4), ((0, 1), (1, 2), (3, 0), (0, 4), (1, 5), (2, 6))),
        ("wedge", ((2, 3), (6, 7)), (0, 1, 2, 4, 5, 6),
         ((0, 1), (1, 2), (3, 0), (4, 5), (5, 6), (7, 4), (0, 4), (1, 5), (2, 6))),
        ("pyramid", ((4, 5), (5, 6), (6, 7)), (0, 1, 2, 3, 4),
         ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7))),
    ),
}  # fmt: skip


def uncollapsed(shape: Shape, nodes: Integers) -> list[tuple[Shape, Integers, Integers]]:
    """Elements (k, m) by the shapes that they have: those whose corners name a node twice have fewer corners.

    Quadrilaterals may be triangles, hexahedra wedges, tetrahedra or pyramids. What fits none of these stays as it is.

    Returns
    -------
    list of (Shape, (m,) rows of the given elements, their nodes)
    """
    ordered = np.sort(nodes, axis=1)
    distinct = 1 + np.sum(ordered[:, 1:] != ordered[:, :-1], axis=1)
    whole = distinct == shape.nodes
    left = np.flatnonzero(~whole)
    kinds = _COLLAPSES.get(shape.form, ()) if len(left) else ()
    between = {frozenset(edge): shape.corners + k for k, edge in enumerate(EDGES.get(shape.form, ()))}
    found = []
    for _, same, corners, edges in kinds:
        second = shape.nodes > shape.corners
        target = shape_of(shape.dimension, len(corners) + (len(edges) if second else 0))
        for turn in _turns(shape.form):
            middles = [between[frozenset((turn[a], turn[b]))] for a, b in edges] if second else []
            own = nodes[left][:, [*(turn[k] for k in corners), *middles]]
            fits = np.all([nodes[left, turn[a]] == nodes[left, turn[b]] for a, b in same], axis=0)
            fits &= np.all(np.diff(np.sort(own, axis=1), axis=1) > 0, axis=1) & (distinct[left] == own.shape[1])
            if target is not None and np.any(fits):
                found.append((target, left[fits], own[fits]))
                left = left[~fits]
    whole[left] = True
    rows = np.flatnonzero(whole)
    return [*([(shape, rows, nodes[rows])] if len(rows) else []), *found]
