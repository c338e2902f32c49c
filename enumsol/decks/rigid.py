"""Rigid surfaces of elements (R3D4, R2D2 and the like) or of lines that are swept: layers of cells that move as one.

A rigid surface has no thickness in a deck. Here it gets one on the side that nothing touches, a share of its elements:
what moves as a rigid body may have any elastic law.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enumsol.decks.elements import element_type
from enumsol.decks.model import Account, Deck, ElementBlock, RigidProfile, Section, Surface
from enumsol.errors import InvalidArgumentError
from enumsol.support.array_types import Floats, Integers
from enumsol.support.messages import counted

#: Families of rigid elements.
_FAMILIES = ("rigid surfaces", "rigid lines")
#: Thickness of a layer, by the shortest of its edges: not so much that it folds where the surface bends.
_THIN = 0.1
#: Types of cells of layers by the number of their nodes in 3D, and in the plane by its family.
_SOLID = {6: "C3D6", 8: "C3D8"}
_PLANE = {"plane strain": "CPE4", "plane stress": "CPS4", "axisymmetric": "CAX4"}
#: Name of the material of layers.
_RIGID = "RIGID"


def add_profiles(deck: Deck, profiles: dict[str, RigidProfile]) -> None:
    """Add the elements of rigid surfaces that are given by lines: in 3D as long as the deck is, to both sides.

    Raises
    ------
    InvalidArgumentError
        A profile belongs to no rigid body, or one of the plane is given in 3D, or the other way round.
    """
    spatial = deck.dimension == 3
    far = float(np.linalg.norm(np.ptp(deck.points, axis=0))) if len(deck.points) else 1.0
    bodies = {coupling.target for coupling in deck.analysis.couplings if coupling.card == "RIGID BODY"}
    for name, profile in profiles.items():
        if name not in bodies:
            raise InvalidArgumentError(
                f"{profile.place}: *SURFACE {name} is of no *RIGID BODY; expected one with ANALYTICAL SURFACE={name}"
            )
        if profile.is_swept != spatial:
            expected = "TYPE=CYLINDER" if spatial else "TYPE=SEGMENTS"
            raise InvalidArgumentError(
                f"{profile.place}: *SURFACE {name} is not of the dimension of the bodies; expected {expected}"
            )
        lines = profile.at(0.0) if not spatial else np.concatenate([profile.at(far), profile.at(-far)])
        first, count = len(deck.points), len(profile.corners)
        ends = first + np.column_stack([np.arange(count - 1), np.arange(1, count)])
        nodes = np.column_stack([ends, ends[:, ::-1] + count]) if spatial else ends
        last = max(deck.element_labels.tolist(), default=0)
        kind = element_type("R3D4" if spatial else "R2D2")
        assert kind is not None
        rows = len(deck.element_labels) + np.arange(len(nodes))
        deck.blocks.append(ElementBlock(kind, last + 1 + np.arange(len(nodes)), nodes, profile.place))
        deck.points = np.concatenate([deck.points, lines])
        deck.node_labels = np.concatenate([deck.node_labels, np.zeros(len(lines), dtype=np.int64)])
        deck.element_sets[name] = rows
        deck.surfaces[name] = Surface(profile.place, np.column_stack([rows, np.full(len(rows), -1)]))
        del deck.__dict__["element_labels"]


def add_layers(deck: Deck) -> None:
    """Make layers of cells of the elements of rigid bodies.

    Raises
    ------
    InvalidArgumentError
        Surfaces are on both sides of a rigid one.
    """
    rigid = np.zeros(len(deck.element_labels), dtype=bool)
    for coupling in deck.analysis.couplings:
        if coupling.card == "RIGID BODY" and coupling.target in deck.element_sets:
            rigid[deck.element_sets[coupling.target]] = True
    firsts = np.cumsum([0, *(len(block.labels) for block in deck.blocks)])
    chosen = [
        k for k, block in enumerate(deck.blocks)
        if block.type.family in _FAMILIES and len(block.labels) and np.all(rigid[firsts[k] : firsts[k + 1]])
    ]  # fmt: skip
    bodies = [block for block in deck.blocks if block.type.is_body]
    if not chosen or not bodies:
        return
    faces = [(k, _outward(deck, k, int(firsts[k]))) for k in chosen]
    behind = _behind(deck, [nodes for _, nodes in faces], bodies[0].type.family == "axisymmetric")
    rows = np.concatenate([np.arange(firsts[k], firsts[k + 1]) for k in chosen])
    for k, nodes in faces:
        back = behind[nodes]
        cells = np.column_stack([nodes[:, ::-1], back if deck.dimension == 2 else back[:, ::-1]])
        name = _PLANE[bodies[0].type.family] if deck.dimension == 2 else _SOLID[cells.shape[1]]
        kind = element_type(name)
        assert kind is not None
        said = f"{counted(len(nodes), 'rigid element')} of type {deck.blocks[k].type.name} with a layer behind them"
        deck.account.append(Account(deck.blocks[k].place, "ELEMENT", said))
        deck.blocks[k] = replace(deck.blocks[k], type=kind, nodes=cells)
    for name, surface in deck.surfaces.items():
        own = surface.faces.copy()
        own[np.isin(own[:, 0], rows), 1] = 0
        deck.surfaces[name] = replace(surface, faces=own)
    _give_material(deck, rows)


def _outward(deck: Deck, k: int, first: int) -> Integers:
    """Nodes of the elements of a block, turned so that their normals point to the side that surfaces are on."""
    block, turned = deck.blocks[k], np.zeros(len(deck.blocks[k].labels), dtype=bool)
    sides = np.concatenate([np.zeros((0, 2), dtype=np.int64), *(own.faces for own in deck.surfaces.values())])
    own = sides[(sides[:, 0] >= first) & (sides[:, 0] < first + len(turned))] - [first, 0]
    turned[own[own[:, 1] == -2, 0]] = True
    both = own[(own[:, 1] == -1) & turned[own[:, 0]], 0]
    if len(both):
        raise InvalidArgumentError(
            f"{block.place}: element {block.labels[both[0]]} of type {block.type.name} has a surface on both of its "
            "sides; expected SPOS or SNEG"
        )
    return np.where(turned[:, None], block.nodes[:, ::-1], block.nodes)


def _behind(deck: Deck, faces: list[Integers], axisymmetric: bool) -> Integers:
    """Rows of new nodes behind those of faces, by the rows of these."""
    normals, shortest = np.zeros(deck.points.shape), np.inf
    for nodes in faces:
        places = deck.points[nodes]
        edges = np.roll(places, -1, axis=1) - places
        shortest = min(shortest, float(np.min(np.linalg.norm(edges, axis=2))))
        own = np.cross([0.0, 0.0, 1.0], edges[:, 0]) if deck.dimension == 2 else np.cross(edges[:, 0], edges[:, 1])
        own /= np.linalg.norm(own, axis=1)[:, None]
        np.add.at(normals, nodes.ravel(), np.repeat(own, nodes.shape[1], axis=0))
    used = np.unique(np.concatenate([nodes.ravel() for nodes in faces]))
    places = deck.points[used] - _THIN * shortest * _of_length_one(normals[used])
    if axisymmetric:  # the axis stays where it is
        places[:, 0] = np.where(deck.points[used, 0] == 0, 0.0, places[:, 0])
    behind = np.zeros(len(deck.points), dtype=np.int64)
    behind[used] = len(deck.points) + np.arange(len(used))
    deck.points = np.concatenate([deck.points, places])
    deck.node_labels = np.concatenate([deck.node_labels, np.zeros(len(used), dtype=np.int64)])
    return behind


def _of_length_one(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def _give_material(deck: Deck, rows: Integers) -> None:
    """Give layers the material and the thickness of a body."""
    laws = {name: own for name, own in deck.materials.items() if own.elastic}
    sections = [own for own in deck.sections if own.kind == "SOLID SECTION" and own.material in laws]
    if not sections:
        return  # what has no material is refused for all
    solid = min(sections, key=lambda own: float(laws[own.material].constants[0]))
    deck.materials[_RIGID] = replace(laws[solid.material], name=_RIGID)
    deck.element_sets[_RIGID] = rows
    deck.sections.append(Section("SOLID SECTION", _RIGID, _RIGID, solid.thickness, "", solid.place))
