"""Signs of a wrong scene: refusals and notes, each in one sentence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from enumsol.decks.elements import element_type
from enumsol.errors import InvalidArgumentError
from enumsol.fem.bases import SIMPLICES, corners_of, place_of
from enumsol.fem.bodies import WITH_MODES, holding
from enumsol.fem.contacts import Group, faced
from enumsol.fem.meshes import SAME, PartedMesh, cell_name, unit_vectors
from enumsol.fem.scenes import Scene
from enumsol.model.cells import boundary_facets
from enumsol.support.array_types import Floats, Integers, Mask
from enumsol.support.messages import counted

#: A point is inside a cell where all its coordinates there are larger than this: not where cells only touch, nor where
#: they are taken as plane although they are curved, or bend out of their plane.
_INSIDE = 1e-3
#: Share of the contact nodes of a part that may touch another body before that is refused as a wall between both.
_WALL = 0.5
#: Loads and press fits that strain the body so differently are hardly in the same units.
_UNEVEN = 1e5


def _bodies(scene: Scene) -> Integers:
    """Number of the connected body of each node, (N,)."""
    return np.asarray(np.argmax([piece.nodes for piece in scene.pieces], axis=0))


def refuse_overlaps(scene: Scene) -> None:
    """Refuse meshes in which cells of one connected body overlap, but for parts of bodies that are a pair.

    As cells that share a facet are on different sides of it (`fem.bases.refuse_wrong_sides`), a body can overlap itself
    only where a facet of its boundary is inside of a cell. Faces of a crack may touch. At a pair a body may overlap
    itself or another, as by a press fit.

    Raises
    ------
    InvalidArgumentError
        It names cells.
    """
    mesh, facets = scene.mesh, boundary_facets(scene.dimension, scene.mesh.cells)
    pairs = [_nodes_of(mesh, group) for group in scene.contacts.groups if group.pair is not None]
    paired = np.any([np.zeros(len(mesh.points), dtype=bool), *pairs], axis=0)
    facets = facets[~np.all(paired[facets], axis=1)]
    for own in corners_of(scene.dimension, mesh.cells):
        _refuse_covered(mesh, own, facets, _bodies(scene))


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
        for simplex in SIMPLICES[dimension, corners.shape[1]]:
            ends = mesh.points[corners[row, simplex]]
            inner = np.linalg.solve((ends[1:] - ends[0]).T, (places[apart] - ends[0]).T)
            deep = np.min(np.vstack([inner, 1.0 - inner.sum(axis=0)]), axis=0) > _INSIDE
            if np.any(deep):
                raise InvalidArgumentError(
                    f"{cell_name(int(rows[row]), mesh.labels)} overlaps other cells of its body, whose boundary is "
                    f"inside of it at {place_of(places[apart[int(np.argmax(deep))]])}; expected cells that cover the "
                    "body once"
                )


def refuse_walls(scene: Scene) -> None:
    """Refuse contact parts where another body touches them: the foundation would be a wall between the two.

    Raises
    ------
    InvalidArgumentError
        It suggests a pair.
    """
    mesh, dimension = scene.mesh, scene.dimension
    group = scene.contacts.groups[0]
    if group.pair is not None or scene.options.obstacle is not None:
        return
    nodes = scene.contacts.rows.nodes[: group.count]
    _refuse_cracks(scene, nodes, group.parts)
    if len(scene.pieces) < 2:
        return
    boundary = boundary_facets(dimension, mesh.cells)
    for piece in scene.pieces:
        own = piece.nodes[nodes]
        others = boundary[~piece.nodes[boundary[:, 0]]]
        if not np.any(own):
            continue
        outward = scene.body.on_part(others, "boundary", np.asarray)
        found, weights, gaps = faced(mesh.points, nodes[own], group.normals[own], others, outward, others[:0])
        touching = nodes[own][found][gaps == 0.0]
        for part in group.parts:
            here = np.intersect1d(touching, mesh.nodes(part))
            if len(here) > _WALL * np.sum(np.isin(nodes[own], mesh.nodes(part))):
                beside = np.unique(weights[np.flatnonzero(gaps == 0.0)].indices)
                names = [name for name, rows in mesh.facets.items() if np.all(np.isin(beside, rows))]
                other = names[0] if names else "OTHER"
                touched = f"those of {other}" if names else "the boundary of another body"
                raise InvalidArgumentError(
                    f"contact names {part}, whose facets coincide with {touched}, and would put a rigid wall between "
                    f"both bodies; expected the pair {part}:{other}"
                )


def refuse_pairs(scene: Scene) -> None:
    """Refuse pairs of two sides of one body that face away from each other, through the body.

    Raises
    ------
    InvalidArgumentError
        It names the pair.
    """
    mesh, rows = scene.mesh, scene.contacts.rows
    places = rows.means @ mesh.points
    body = _bodies(scene)
    for group, own in scene.contacts.by_group:
        if group.pair is None:
            continue
        facets = mesh.part(group.pair.master)
        # nodes of faces of a crack may be a little beyond the other face where that is curved: less than half a facet
        length = np.max(np.ptp(mesh.points[facets], axis=1))
        deep = np.sum(places[own] * group.normals, axis=1) > 0.5 * length
        faced = body[facets.ravel()]
        if np.any(deep) and np.all(np.isin(faced, body[rows.nodes[own][deep]])) and len(np.unique(faced)) == 1:
            raise InvalidArgumentError(
                f"{group.pair.slave} of the pair {group.pair} faces {group.pair.master} through the body that both "
                "belong to; expected parts of two bodies, or of one that face each other with a gap between them"
            )


def _refuse_cracks(scene: Scene, nodes: Integers, parts: list[str]) -> None:
    """Refuse parts that are a face of a crack: nodes of the same body are where theirs are."""
    from scipy.spatial import cKDTree  # not needed for paths that read no mesh

    mesh, boundary = scene.mesh, np.unique(boundary_facets(scene.dimension, scene.mesh.cells))
    near = SAME * float(np.max(np.ptp(mesh.points, axis=0)))
    pairs = cKDTree(mesh.points[nodes]).query_ball_tree(cKDTree(mesh.points[boundary]), near)
    body = _bodies(scene)
    twins = [
        [k for k in boundary[found] if k != node and body[k] == body[node]]
        for node, found in zip(nodes, pairs, strict=True)
    ]
    doubled = np.array([bool(found) for found in twins])
    for part in parts:
        own = np.isin(nodes, mesh.nodes(part))
        if np.any(doubled & own) and np.sum(doubled & own) >= _WALL * np.sum(own):
            beside = np.unique([k for found, mine in zip(twins, own, strict=True) if mine for k in found])
            names = [name for name, rows in mesh.facets.items() if np.all(np.isin(beside, rows))]
            other = min(names, key=lambda name: len(mesh.facets[name]), default="OTHER")
            raise InvalidArgumentError(
                f"contact names {part}, a face of a crack whose other face {'is ' + other if names else 'coincides'}, "
                f"and would put a rigid wall into the crack; expected the pair {part}:{other}"
            )


def scene_notes(scene: Scene) -> list[str]:
    """Notes on what may not have been intended."""
    checks = (
        *(_formulations, _unjoined, _unfaced, _shared, _alone, _rest, _loaded_contact),
        *(_turning, _reach, _units, _proportions, _friction, _held),
    )
    with np.errstate(over="ignore"):  # what overflows is out of proportion, and told as such
        return [note for check in checks for note in check(scene)]


def _formulations(scene: Scene) -> list[str]:
    """Notes on elements of the file that others take the place of."""
    own = scene.mesh.types if scene.stiffness is None else ()  # another code has them as they are
    kinds = [kind for kind in map(element_type, own) if kind is not None and kind.is_body]
    return [
        f"elements of type {kind.name} are taken as {kind.plain}, with full integration and without incompatible "
        "modes, hybrid or modified formulations, which can be stiffer in bending than the program of the file has them"
        for kind in kinds
        if kind.name != kind.plain and not (kind.name in WITH_MODES and scene.body.incompatible is not None)
    ]


def _unjoined(scene: Scene) -> list[str]:
    """Notes on nodes of the boundary at one place, but for those of contacts: cracks, and bodies that seem joined."""
    from scipy.spatial import cKDTree  # as above

    mesh, body, names = scene.mesh, _bodies(scene), [piece.name for piece in scene.pieces]
    boundary = np.unique(boundary_facets(scene.dimension, mesh.cells))
    near = SAME * float(np.max(np.ptp(mesh.points, axis=0)))
    twins = boundary[cKDTree(mesh.points[boundary]).query_pairs(near, output_type="ndarray")]
    joined = np.zeros(scene.springs.shape[0], dtype=bool)
    joined[scene.joints.rows.indices] = True
    masks = [_nodes_of(mesh, group) for group in scene.contacts.groups]
    for mask in (*masks, np.any(joined[: mesh.points.size].reshape(mesh.points.shape), axis=1)):
        twins = twins[~np.all(mask[twins], axis=1)]
    notes = []
    for one in range(len(names)):
        for two in range(one, len(names)):
            found = twins[np.all(np.sort(body[twins], axis=1) == (one, two), axis=1)]
            if not len(found):
                continue
            places = mesh.points[np.unique(found[:, 0])]
            of = names[one] if one == two else f"{names[one]} and {names[two]}"
            at = place_of(places[0]) if len(places) == 1 else f"{place_of(places[0])} and elsewhere"
            does = "a crack that nothing closes" if one == two else "bodies that pass through each other there"
            notes.append(
                f"{counted(len(places), 'place')} of {of} {'have' if len(places) > 1 else 'has'} several nodes, at "
                f"{at}, which neither the mesh joins nor a pair: {does}"
            )
    return notes


def _nodes_of(mesh: PartedMesh, group: Group) -> Mask:
    """Nodes of the parts of contacts, (N,)."""
    parts = group.parts if group.pair is None else [group.pair.slave, group.pair.master]
    mask = np.zeros(len(mesh.points), dtype=bool)
    for part in parts:
        mask[mesh.nodes(part)] = True
    return mask


def _turning(scene: Scene) -> list[str]:
    """Notes on pairs of a body that could roll, whose normals turn along the contact more than what they face does."""
    mesh, notes = scene.mesh, []
    hold = holding(scene.held, sp.csc_array(scene.springs.shape), scene.joints.rows)
    loose = np.any([piece.nodes for piece in scene.moving if piece.free_motions(mesh.points, hold)], axis=0)
    for group, own in scene.contacts.by_group:
        rows, pair = scene.contacts.rows.means[own], group.pair
        if pair is None or not np.any(loose & _nodes_of(mesh, group)):
            continue
        outward = scene.body.on_part(mesh.part(pair.master), pair.master, np.asarray)
        facing = unit_vectors(np.asarray(sp.csr_array(-rows).maximum(0) @ outward), "normals of the other side")
        apart = float(np.degrees(np.max(np.arccos(np.clip(-np.sum(facing * group.normals, axis=1), -1.0, 1.0)))))
        if apart > 10.0:  # degrees, of a pocket
            notes.append(
                f"the normals of the pair {pair} turn along the contact, up to {apart:.0f} degrees away from the "
                "normals of what they face: as they stay so, a body that could roll or slide along is caught as in a "
                "pocket"
            )
    return notes


def _unfaced(scene: Scene) -> list[str]:
    """Nodes of pairs without contact."""
    return scene.joints.notes + [
        f"{group.missed} of {group.missed + group.count} nodes of {pair.slave} face nothing of "
        f"{pair.master} and have no contact"
        for group in scene.contacts.groups
        if (pair := group.pair) is not None and group.missed
    ]


def _shared(scene: Scene) -> list[str]:
    """Nodes of pairs that have the contact of another one."""
    return [
        f"{counted(group.shared, 'node')} of {pair.slave} {'belong' if group.shared > 1 else 'belongs'} to "
        f"another contact before, and not to the pair {pair}"
        for group in scene.contacts.groups
        if (pair := group.pair) is not None and group.shared
    ]


def _alone(scene: Scene) -> list[str]:
    """Bodies that nothing connects with the others."""
    if len(scene.moving) < 2:
        return []
    touched = np.zeros(len(scene.mesh.points), dtype=bool)
    touched[np.unique(scene.contacts.rows.means.indices)] = True
    return [
        f"{piece.name} touches nothing: it has no contact part and is in no pair"
        for piece in scene.moving
        if np.any(piece.nodes) and not np.any(touched & piece.nodes)
    ]


def _rest(scene: Scene) -> list[str]:
    """Nothing that acts on the bodies."""
    joints = scene.joints
    acting = (
        any(np.any(own) for own in (scene.forces, scene.slope, joints.forces, joints.slope))
        or np.any(scene.held.values)
        or np.any(scene.held.slopes)
    )
    given = any(own.value or own.slope for own in joints.equations)
    if acting or given or np.any(scene.gaps < 0):
        return []
    return ["nothing acts on the body: it has no load, press fit or given displacement, and rests"]


def _loaded_contact(scene: Scene) -> list[str]:
    """Loads on contact parts."""
    corners = {tuple(sorted(row)) for row in scene.contacts.facets.tolist()}
    notes = []
    for option in ("load", "load_slope", "pressure", "pressure_slope", "spring"):
        for part in getattr(scene.options, option) or ():
            if any(tuple(sorted(row)) in corners for row in scene.mesh.part(part).tolist()):
                what = "stiffens" if option == "spring" else "acts on"
                notes.append(f"{option} of {part} {what} contact nodes, as {part} is in contact")
    touching, points = scene.contacts.rows.nodes, scene.joints.places
    for option in ("force", "force_slope"):
        named = getattr(scene.options, option) or ()
        on = [part for part in named if part not in points and np.any(np.isin(scene.mesh.nodes(part), touching))]
        notes += [f"{option} of {part} acts on contact nodes" for part in on]
    return notes


def _reach(scene: Scene) -> list[str]:
    """Gaps and press fits as large as a body."""
    extent, notes = _extent(scene), []
    for group, gaps in scene.gaps_of_groups:
        if gaps.min() > extent:
            notes.append(
                f"the smallest gap of {group} is {gaps.min():.3g}, more than the extent {extent:.3g} of the body: it "
                "will not be in contact"
            )
        elif gaps.min() < -0.05 * extent:
            notes.append(
                f"the press fit of {group} is {-gaps.min():.3g}, which is not small beside the extent {extent:.3g} of "
                "the body, as displacements have to be"
            )
    return notes


def _strains(scene: Scene) -> dict[str, float]:
    """Approximate strains of the body by the loads and by their slopes."""
    thickness = 1.0 if scene.body.thickness is None else float(np.min(scene.body.thickness))
    power = 2 if scene.dimension == 3 or scene.body.axisymmetric else 1
    force = float(np.min(_stiffness(scene))) * _extent(scene) ** power * thickness
    return {
        name: float(np.sum(np.abs(own))) / force
        for name, own in (("loads", scene.forces), ("load slopes", scene.slope))
    }


def _stiffness(scene: Scene) -> Floats:
    """Largest moduli of the cells: lambda + 2 mu of isotropic ones."""
    return np.atleast_1d(np.max(np.diagonal(scene.material.elasticity, axis1=-2, axis2=-1), axis=-1))


def _proportions(scene: Scene) -> list[str]:
    """Notes on loads and press fits, or gaps that only strain can close, that are out of proportion."""
    strain, extent, notes = max(_strains(scene).values()), _extent(scene), []
    held = not scene.options.spring and not any(p.free_motions(scene.mesh.points, scene.hold) for p in scene.moving)
    for group, gaps in scene.gaps_of_groups:
        length = float(gaps.min())
        ratio = abs(length) / extent / strain if strain > 0 else 1.0
        if (ratio > _UNEVEN and (length < 0 or held)) or 0 < ratio < 1.0 / _UNEVEN:
            notes.append(
                f"the {'press fit' if length < 0 else 'gap'} of {group} is {abs(length):.3g}, while the loads strain "
                f"the body of extent {extent:.3g} by about {strain:.2g}; are young, loads and lengths in units that "
                "fit together?"
            )
    return notes


def _units(scene: Scene) -> list[str]:
    """Loads, displacements and moduli of absurd size."""
    notes, extent, stiffness = [], _extent(scene), _stiffness(scene)
    for name, strain in _strains(scene).items():
        if strain > 1.0:  # by the length of the body
            notes.append(
                f"the {name} would strain the body by about {strain:.2g}, which is far from small; are young and "
                f"the {name} in the same units?"
            )
        elif 0 < strain < 1e-12:
            notes.append(
                f"the {name} would strain the body by about {strain:.2g}, which is next to nothing; are young and the "
                f"{name} in the same units?"
            )
    moved = float(np.max(np.abs(scene.held.values)))
    if moved > 0.25 * extent:
        notes.append(
            f"a displacement of {moved:.3g} is given, which is not small beside the extent {extent:.3g} of the body"
        )
    if np.max(stiffness) > 1e8 * np.min(stiffness):
        notes.append(
            f"the moduli of parts differ by a factor of {np.max(stiffness) / np.min(stiffness):.2g}; are all in the "
            "same unit?"
        )
    return notes


def _extent(scene: Scene) -> float:
    """Extent of the largest body [length]."""
    return max(float(np.max(np.ptp(scene.mesh.points[piece.nodes], axis=0))) for piece in scene.pieces)


def _friction(scene: Scene) -> list[str]:
    """Coefficients that no pair of materials has."""
    notes = []
    for name, value in (("friction", scene.options.friction), ("friction2", scene.options.friction2)):
        each = value.values() if isinstance(value, Mapping) else [value]
        steep = max((float(own) for own in each if own is not None), default=0.0)
        if steep > 5.0:
            notes.append(f"{name} is {steep:g}; coefficients of friction above 1 are rare")
    return notes


def _held(scene: Scene) -> list[str]:
    """A bound of rigid displacements where nothing can move as a whole."""
    if scene.options.max_rigid_displacement is None:
        return []
    if any(piece.free_motions(scene.mesh.points, scene.hold) for piece in scene.moving):
        return []
    return ["max_rigid_displacement has no effect, for supports or springs hold everything"]
