"""Which nodes of a mesh are contact nodes, their normals, and what they face: an obstacle, or another body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.basis_problems import outward_normal, pressed
from enumsol.fem.conditions import Held, Obstacle, names_of
from enumsol.fem.mesh_checks import unit_vectors
from enumsol.fem.pairs import Pair, faced
from enumsol.fem.restrained import ContactNodes, means_of_nodes, movable
from enumsol.model.cells import boundary_facets, contact_nodes, facet_rows

if TYPE_CHECKING:
    from enumsol.fem.bases import NodalBasis
    from enumsol.fem.meshes import PartedMesh
    from enumsol.fem.options import Options
    from enumsol.support.array_types import Floats, Integers

#: Cosine of the angle from which on a normal of the boundary points away from an obstacle, but for rounding.
_BEHIND = -1e-6


@dataclass(frozen=True)
class Group:
    """Contact nodes that face the same thing.

    Attributes
    ----------
    parts : list of str
        Contact parts, or the first part of a pair.
    pair : Pair or None
    normals : (k, d) array
        Of the boundary, out of the body, also where an obstacle gives the normals of the rows.
    count, missed, shared : int
        How many there are, how many nodes of a pair face nothing, and how many already belong to another contact.
    """

    parts: list[str]
    pair: Pair | None
    normals: Floats
    count: int
    missed: int = 0
    shared: int = 0

    def __str__(self) -> str:
        return ", ".join(self.parts) if self.pair is None else f"the pair {self.pair}"


@dataclass(frozen=True)
class Contacts:
    """All contact nodes, those of contact parts before those of pairs.

    Attributes
    ----------
    rows : ContactNodes
        The p of them.
    gaps : (p,) array
        Distances to the obstacle or to the other body, 0 for a foundation of the shape of the body [length].
    parts : list of p str
        The part that each belongs to, the first one of several.
    facets : (k, c) int array
        Of all these parts.
    areas : (p,) array
        Of the contact surface around each, in 2D its length [length^2, in 2D length].
    groups : list of Group
        One for all contact parts, then one for each pair; the nodes come in this order.
    """

    rows: ContactNodes
    gaps: Floats
    parts: list[str]
    facets: Integers
    areas: Floats
    groups: list[Group]


def contacts_of(body: NodalBasis, mesh: PartedMesh, options: Options, held: Held) -> Contacts:
    """Contact nodes on the facets of parts, and of the first part of every pair.

    A node that several of them share belongs to the contact parts, or to the first pair.

    Raises
    ------
    InvalidArgumentError
        There are no parts, one does not exist or is not on the boundary, or there is a node that cannot be one: held in
        some components only, without a normal, or at the centre of an obstacle; or no node of a pair faces anything.
    """
    parts, pairs = names_of(options.contact, "contact"), Pair.all_of(options.pairs)
    if not parts and not pairs:
        raise InvalidArgumentError("contact names no part; expected the contact boundary, or pairs")
    found: list[tuple[ContactNodes, Floats, Group]] = []
    groups: list[tuple[list[str], Pair | None]] = [(parts, None)] if parts else []
    groups += [([pair.slave], pair) for pair in pairs]
    on, areas, taken = [], [], np.zeros(0, dtype=np.int64)
    for names, pair in groups:
        facets = _facets(body, mesh, names)
        rows, gaps, group = _group(
            body, mesh, names, facets, held, options.obstacle if pair is None else None, pair, taken
        )
        found.append((rows, gaps, group))
        on.append(facets)
        areas.append(body.on_part(facets, names[0], lambda v, _: v[0], lumped=True)[rows.nodes, 0])
        taken = np.concatenate([taken, rows.nodes])
    rows = ContactNodes(
        sp.csr_array(sp.vstack([rows.means for rows, _, _ in found])),
        np.concatenate([rows.normals for rows, _, _ in found]),
        np.any([rows.apart for rows, _, _ in found], axis=0),
        taken,
        np.arange(len(taken)),
    )
    names = list(dict.fromkeys([*parts, *(pair.slave for pair in pairs)]))
    gaps, facets = np.concatenate([gaps for _, gaps, _ in found]), _distinct(np.concatenate(on))
    of_groups = [group for _, _, group in found]
    return Contacts(rows, gaps, _parts(mesh, names, taken), facets, np.concatenate(areas), of_groups)


def _parts(mesh: PartedMesh, names: list[str], nodes: Integers) -> list[str]:
    """The first part that each node belongs to."""
    of_node = np.full(len(mesh.points), -1)
    for k in reversed(range(len(names))):
        of_node[mesh.part(names[k])] = k
    return [names[k] for k in of_node[nodes]]


def _facets(body: NodalBasis, mesh: PartedMesh, parts: list[str]) -> Integers:
    """Facets of parts, each once."""
    for part in parts:
        body.facet_numbers(mesh.part(part), part)  # on the boundary?
    return _distinct(np.concatenate([mesh.part(part) for part in parts]))


def _distinct(facets: Integers) -> Integers:
    """Facets, each once."""
    _, first = np.unique(np.sort(facets, axis=1), axis=0, return_index=True)
    return np.asarray(facets[np.sort(first)])


def _group(
    body: NodalBasis,
    mesh: PartedMesh,
    parts: list[str],
    facets: Integers,
    held: Held,
    obstacle: object,
    pair: Pair | None,
    taken: Integers,
) -> tuple[ContactNodes, Floats, Group]:
    """Contact nodes with their normals on some facets, and the distances to what they face."""
    dimension = mesh.points.shape[1]
    touching = along(facets) if dimension == 2 else np.unique(contact_nodes(dimension, facets))
    shared = int(np.sum(np.isin(touching, taken)))
    touching = touching[~np.isin(touching, taken)]
    if pair is None and np.all(held.supports.fixed[touching]):
        raise InvalidArgumentError("contact has no node that clamp or displacement leave free; expected some")
    if not len(touching):
        raise InvalidArgumentError(
            f"all nodes of {parts[0]} belong to another contact already; expected a boundary of its own for the pair "
            f"{pair}"
        )
    integrals = body.on_part(facets, "contact", outward_normal, lumped=True)
    if obstacle is None:
        normals = unit_vectors(pressed(integrals[touching], touching), "normals of the boundary")
        # what averages with the other half of the body would be
        normals = unit_vectors(np.where(held.mirrored[touching], 0.0, normals), "normals at the plane of symmetry")
        own, gaps = normals, np.zeros(len(touching))
    else:
        given = Obstacle.of(obstacle, dimension)
        normals, gaps = given.normals_and_gaps(mesh.points[touching])
        own = np.nan_to_num(integrals[touching] / np.linalg.norm(integrals[touching], axis=1, keepdims=True))
        if np.all(np.sum(own * normals, axis=1) < _BEHIND):
            raise InvalidArgumentError(
                f"obstacle {given.kind} is behind the contact boundary, whose outward normals point away from it; "
                f"expected {given.expected}"
            )
    if pair is None:
        nodes = movable(touching, normals, held.supports)
        return nodes, gaps[nodes.kept], Group(parts, None, own[nodes.kept], len(nodes.nodes))
    rows, gaps, group = _paired(body, mesh, touching, normals, held, pair)
    return rows, gaps, replace(group, shared=shared)


def _paired(
    body: NodalBasis, mesh: PartedMesh, touching: Integers, normals: Floats, held: Held, pair: Pair
) -> tuple[ContactNodes, Floats, Group]:
    """Nodes that face the other part of a pair, relative to it."""
    facets = _facets(body, mesh, [pair.master])
    apart = ~np.isin(touching, facets)  # a node of both, as at the tip of a crack, is in contact with itself
    touching, normals = touching[apart], normals[apart]
    boundary = boundary_facets(mesh.points.shape[1], mesh.cells)
    others = boundary[np.isin(facet_rows(boundary, facets, facets.shape[1]), -1)]
    seen = faced(mesh.points, touching, normals, facets, body.on_part(facets, pair.master, outward_normal), others)
    if not len(seen.gaps):
        raise InvalidArgumentError(
            f"{pair.slave} of the pair {pair} has no node that faces a facet of {pair.master} along its normal; "
            "expected parts of two bodies, which share no nodes, that face each other with opposite normals"
        )
    missed = int(np.sum(~seen.found))
    touching, normals = touching[seen.found], normals[seen.found]
    means = sp.csr_array(means_of_nodes(touching, len(mesh.points)) - seen.weights)
    nodes = movable(touching, normals, held.supports, means)
    gaps = seen.gaps if pair.gap is None else np.full(len(touching), pair.gap)
    return nodes, gaps[nodes.kept], Group([pair.slave], pair, normals[nodes.kept], len(nodes.nodes), missed)


def along(edges: Integers) -> Integers:
    """Nodes of edges (k, 2) or (k, 3), each line of edges from one end to the other; closed lines from any node."""
    pairs = edges if edges.shape[1] == 2 else np.concatenate([edges[:, [0, 2]], edges[:, [2, 1]]])
    beside: dict[int, list[int]] = {}
    for one, two in pairs.tolist():
        beside.setdefault(one, []).append(two)
        beside.setdefault(two, []).append(one)
    ordered: dict[int, None] = {}
    # ends first, then what is left: closed lines
    for start in sorted(beside, key=lambda node: (len(beside[node]) != 1, node)):
        node: int | None = start
        while node is not None and node not in ordered:
            ordered[node] = None
            node = next((after for after in beside[node] if after not in ordered), None)
    return np.array(list(ordered), dtype=np.int64)
