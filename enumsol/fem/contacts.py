"""Which nodes of a mesh are contact nodes, their normals, and what they face: an obstacle, or another body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.fem.assembly import pressed
from enumsol.fem.conditions import Obstacle, names_of
from enumsol.fem.meshes import ROUNDING, SAME, unit_vectors
from enumsol.fem.restrained import ContactRows, Supports, means_of_nodes, movable
from enumsol.model.cells import KINDS, boundary_facets, by_kind, contact_nodes, facet_rows, lines_along, padded
from enumsol.support.arguments import finite_number, shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from enumsol.fem.bases import NodalBasis
    from enumsol.fem.conditions import Options
    from enumsol.fem.meshes import PartedMesh
    from enumsol.model.cells import CellKind
    from enumsol.support.array_types import Floats, Integers, Mask

#: Shape functions below this are rounding at a node.
_AT_NODE = 1e-10
#: Newton's steps at most to a point of a facet; of plane triangles and straight edges the first is the last.
_STEPS = 30
#: A share of a uniform pressure below this part of the largest is rounding of none.
_NO_SHARE = 1e-9
#: Steps in places of the reference below this have converged.
_CONVERGED = 1e-13


@dataclass(frozen=True)
class PairOfParts:
    """Two parts of the boundary that may touch.

    Attributes
    ----------
    slave : name of the part whose nodes are contact nodes: of facets, or of nodes alone
    master : name of the part whose facets these nodes face
    gap : float or None
        Replaces the gap of the geometry [length].
    """

    slave: str
    master: str
    gap: float | None = None

    @classmethod
    def of(cls, value: Sequence[Any], option: str = "pairs") -> PairOfParts:
        """The pair given by two names, or by two names and a gap (of a tie the largest one).

        Raises
        ------
        InvalidArgumentError
            The value is neither.
        """
        names = value[:2] if isinstance(value, (list, tuple)) and len(value) in (2, 3) else ()
        if not names or not all(isinstance(name, str) for name in names):
            raise InvalidArgumentError(
                f"{option} has the entry {shown(value)}; expected two names of parts, and a gap if it is not that of "
                "the mesh"
            )
        if names[0] == names[1]:
            raise InvalidArgumentError(f"{option} has {names[0]} with itself; expected two different parts")
        gap = finite_number(value[2], f"gap of the pair {names[0]}:{names[1]}") if len(value) > 2 else None
        return cls(names[0], names[1], gap)

    @classmethod
    def all_of(cls, value: object) -> list[PairOfParts]:
        """Every pair of a list.

        Raises
        ------
        InvalidArgumentError
            The value is not a list of pairs, or one is given twice.
        """
        if not isinstance(value, (list, tuple)) or (value and all(isinstance(entry, str) for entry in value)):
            raise InvalidArgumentError(
                f"pairs is {shown(value)}; expected a list of pairs such as [['upper', 'lower']]"
            )
        pairs = [cls.of(entry) for entry in value]
        seen: set[frozenset[str]] = set()
        for pair in pairs:
            if (names := frozenset((pair.slave, pair.master))) in seen:
                raise InvalidArgumentError(f"pairs has {pair} twice; expected each pair of parts once")
            seen.add(names)
        return pairs

    def __str__(self) -> str:
        return f"{self.slave}:{self.master}"


@dataclass(frozen=True)
class Group:
    """Contact nodes that face the same thing.

    Attributes
    ----------
    parts : list of str
        Contact parts, or the first part of a pair.
    pair : PairOfParts or None
    normals : (k, d) array
        Of the boundary, out of the body, also where an obstacle gives the normals of the rows.
    count, missed, shared : int
        How many there are, how many nodes of a pair face nothing, and how many already belong to another contact.
    """

    parts: list[str]
    pair: PairOfParts | None
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
    rows : ContactRows
        The p of them.
    gaps : (p,) array
        Distances to the obstacle or to the other body, 0 for a foundation of the shape of the body [length].
    parts : list of p str
        The part that each belongs to, the first one of several.
    facets : (k, c) int array
        Of all these parts, none of those that are given by nodes.
    areas : (p,) array
        Of the contact surface around each, in 2D its length; 0 of nodes without facets [length^2, in 2D length].
    groups : list of Group
        One for all contact parts, then one for each pair; the nodes come in this order.
    """

    rows: ContactRows
    gaps: Floats
    parts: list[str]
    facets: Integers
    areas: Floats
    groups: list[Group]

    @property
    def by_group(self) -> list[tuple[Group, slice]]:
        """Groups, each with the rows of its nodes."""
        ends = np.cumsum([group.count for group in self.groups]).tolist()
        return [(group, slice(end - group.count, end)) for group, end in zip(self.groups, ends, strict=True)]

    def without(self, nodes: Integers) -> Contacts:
        """Contacts without some nodes, whose areas go to the others of their group.

        Raises
        ------
        InvalidArgumentError
            No others are left to a group.
        """
        kept, areas, groups = ~np.isin(self.rows.nodes, nodes), self.areas.copy(), []
        for group, own in self.by_group:
            if not np.any(kept[own]):
                raise InvalidArgumentError(f"contact of {group} has no node that can be in contact; expected some")
            if np.any(areas[own]):
                areas[own] *= np.sum(areas[own]) / np.sum(areas[own][kept[own]])
            groups.append(replace(group, normals=group.normals[kept[own]], count=int(np.sum(kept[own]))))
        old = self.rows
        rows = replace(
            old, means=sp.csr_array(old.means[kept]), normals=old.normals[kept], nodes=old.nodes[kept],
            kept=np.arange(np.sum(kept)),
        )  # fmt: skip
        parts = [part for part, is_kept in zip(self.parts, kept, strict=True) if is_kept]
        return Contacts(rows, self.gaps[kept], parts, self.facets, areas[kept], groups)


def contacts_of(body: NodalBasis, mesh: PartedMesh, options: Options, held: Supports) -> Contacts:
    """Contact nodes on the facets of parts, and of the first part of every pair, which may be nodes without facets.

    A node that several of them share belongs to the contact parts, or to the first pair.

    Raises
    ------
    InvalidArgumentError
        There are no parts, one does not exist or is not on the boundary, or there is a node that cannot be one: held in
        some components only, without a normal, or at the centre of an obstacle; or no node of a pair faces anything.
    """
    parts, pairs = names_of(options.contact, "contact"), PairOfParts.all_of(options.pairs)
    if not parts and not pairs:
        raise InvalidArgumentError("contact names no part; expected the contact boundary, or pairs")
    found: list[tuple[ContactRows, Floats, Group]] = []
    groups: list[tuple[list[str], PairOfParts | None]] = [(parts, None)] if parts else []
    groups += [([pair.slave], pair) for pair in pairs]
    on: dict[str, Integers] = {}
    areas, taken = [], np.zeros(0, dtype=np.int64)
    for names, pair in groups:
        facets = np.zeros((0, mesh.points.shape[1]), dtype=np.int64)
        if pair is None or not is_of_nodes(mesh, pair.slave):
            facets = on[names[0]] = _facets(body, {name: mesh.part(name) for name in names})
        rows, gaps, group = _group(
            body, mesh, names, facets, held, options.obstacle if pair is None else None, pair, taken
        )
        found.append((rows, gaps, group))
        areas.append(body.on_part(facets, names[0], lambda _: 1.0, lumped=True)[rows.nodes, 0])
        taken = np.concatenate([taken, rows.nodes])
    rows = ContactRows(
        sp.csr_array(sp.vstack([rows.means for rows, _, _ in found])),
        np.concatenate([rows.normals for rows, _, _ in found]),
        np.any([rows.apart for rows, _, _ in found], axis=0),
        taken,
        np.arange(len(taken)),
    )
    names = list(dict.fromkeys([*parts, *(pair.slave for pair in pairs)]))
    gaps, facets = np.concatenate([gaps for _, gaps, _ in found]), _facets(body, on) if on else facets
    of_groups = [group for _, _, group in found]
    return Contacts(rows, gaps, _parts(mesh, names, taken), facets, np.concatenate(areas), of_groups)


def is_of_nodes(mesh: PartedMesh, part: str) -> bool:
    """True for a part that is given by nodes and not by facets."""
    return part in mesh.node_sets and part not in mesh.facets


def _parts(mesh: PartedMesh, names: list[str], nodes: Integers) -> list[str]:
    """The first part that each node belongs to."""
    of_node = np.full(len(mesh.points), -1)
    for k in reversed(range(len(names))):
        of_node[mesh.nodes(names[k]) if is_of_nodes(mesh, names[k]) else mesh.part(names[k])] = k
    return [names[k] for k in of_node[nodes]]


def _facets(body: NodalBasis, parts: Mapping[str, Integers]) -> Integers:
    """Facets of parts, each once."""
    numbers = [body.facet_numbers(facets, part) for part, facets in parts.items()]
    _, first = np.unique(np.concatenate(numbers), return_index=True)
    return np.asarray(padded([*parts.values()])[np.sort(first)])


def _group(
    body: NodalBasis,
    mesh: PartedMesh,
    parts: list[str],
    facets: Integers,
    held: Supports,
    obstacle: object,
    pair: PairOfParts | None,
    taken: Integers,
) -> tuple[ContactRows, Floats, Group]:
    """Contact nodes with their normals on some facets, and the distances to what they face."""
    touching = _touching(body, parts[0], facets) if len(facets) else mesh.nodes(parts[0])
    shared = int(np.sum(np.isin(touching, taken)))
    touching = touching[~np.isin(touching, taken)]
    if pair is None and np.all(held.fixed[touching]):
        raise InvalidArgumentError("contact has no node that clamp or displacement leave free; expected some")
    if not len(touching):
        raise InvalidArgumentError(
            f"all nodes of {parts[0]} belong to another contact already; expected a boundary of its own for the pair "
            f"{pair}"
        )
    # the circumference is none on the axis, which has a normal all the same
    integrals = replace(body, axisymmetric=False).on_part(facets, "contact", np.asarray, lumped=True)
    if obstacle is not None:
        given = Obstacle.of(obstacle, mesh.points.shape[1])
        normals, gaps = given.normals_and_gaps(mesh.points[touching])
        own = np.nan_to_num(integrals[touching] / np.linalg.norm(integrals[touching], axis=1, keepdims=True))
        if np.all(np.sum(own * normals, axis=1) < -ROUNDING):
            raise InvalidArgumentError(
                f"obstacle {given.kind} is behind the contact boundary, whose outward normals point away from it; "
                f"expected {given.expected}"
            )
    else:
        if pair is not None and not len(facets):
            normals = normals_against(body, mesh, touching, pair.master)
        else:
            normals = unit_vectors(pressed(integrals[touching], touching), "normals of the boundary")
        # what averages with the other half of the body would be
        normals = unit_vectors(np.where(held.mirrored[touching], 0.0, normals), "normals at the plane of symmetry")
        own, gaps = normals, np.zeros(len(touching))
    if pair is not None:
        rows, gaps, group = _paired(body, mesh, touching, normals, held, pair)
        return rows, gaps, replace(group, shared=shared)
    nodes = movable(touching, normals, held)
    return nodes, gaps[nodes.kept], Group(parts, None, own[nodes.kept], len(nodes.nodes))


def _touching(body: NodalBasis, part: str, facets: Integers) -> Integers:
    """Nodes of facets that have contact rows, in 2D in the order along them."""
    dimension = body.shape[1]
    touching = along(facets) if dimension == 2 else contact_nodes(dimension, facets)
    if body.axisymmetric:  # a uniform pressure has no part at the node of an edge of second order on the axis
        shares = body.on_part(facets, part, lambda _: 1.0)[touching, 0]
        touching = touching[shares > _NO_SHARE * np.max(shares)]
    return touching


def _paired(
    body: NodalBasis, mesh: PartedMesh, touching: Integers, normals: Floats, held: Supports, pair: PairOfParts
) -> tuple[ContactRows, Floats, Group]:
    """Nodes that face the other part of a pair, relative to it."""
    apart = ~np.isin(touching, mesh.part(pair.master))  # of both, as at the tip of a crack: in contact with itself
    touching, normals = touching[apart], normals[apart]
    found, weights, distances = facing(body, mesh, touching, normals, pair.master)
    if not len(distances):
        raise InvalidArgumentError(
            f"{pair.slave} of the pair {pair} has no node that faces a facet of {pair.master} along its normal; "
            "expected parts of two bodies, which share no nodes, that face each other with opposite normals"
        )
    missed = int(np.sum(~found))
    touching, normals = touching[found], normals[found]
    means = sp.csr_array(means_of_nodes(touching, len(mesh.points)) - weights)
    nodes = movable(touching, normals, held, means)
    gaps = distances if pair.gap is None else np.full(len(touching), pair.gap)
    return nodes, gaps[nodes.kept], Group([pair.slave], pair, normals[nodes.kept], len(nodes.nodes), missed)


def facing(
    body: NodalBasis, mesh: PartedMesh, nodes: Integers, normals: Floats, master: str
) -> tuple[Mask, sp.csr_array, Floats]:
    """The points of a part that nodes face along their normals, as in `faced`."""
    facets = _facets(body, {master: mesh.part(master)})
    boundary = boundary_facets(mesh.points.shape[1], mesh.cells)
    others = boundary[np.isin(facet_rows(mesh.points.shape[1], boundary, facets), -1)]
    outward = body.on_part(facets, master, np.asarray)
    return faced(mesh.points, nodes, normals, facets, outward, others)


def facing_normals(body: NodalBasis, mesh: PartedMesh, pair: PairOfParts) -> tuple[Integers, Floats]:
    """All nodes of the first part, and the means of the normals of the facets around them, which corners have as well.

    Of nodes without facets they are those of `normals_against`.
    """
    part = pair.slave
    if is_of_nodes(mesh, part):
        nodes = mesh.nodes(part)
        return nodes, normals_against(body, mesh, nodes, pair.master)
    facets = _facets(body, {part: mesh.part(part)})
    of_facets = unit_vectors(body.on_part(facets, part, np.asarray)[facets].sum(axis=1), f"normals of {part}")
    sums = np.zeros(mesh.points.shape)
    np.add.at(sums, facets.ravel(), np.repeat(of_facets, facets.shape[1], axis=0))
    nodes = np.unique(facets)
    return nodes, unit_vectors(sums[nodes], f"normals of {part}")


def along(edges: Integers) -> Integers:
    """Nodes of edges (k, 2) or (k, 3), each line of edges from one end to the other; closed lines from any node."""
    lines = [lines_along(nodes) for _, nodes in by_kind(1, edges)]
    pairs = np.concatenate([part[:, k : k + 2] for part in lines for k in range(part.shape[1] - 1)])
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


# -- what the nodes of one part of a pair face on the other (theory, section 11.8) -------------------------------------


def normals_against(body: NodalBasis, mesh: PartedMesh, nodes: Integers, master: str) -> Floats:
    """Normals (k, d) of nodes without facets: opposite to the normal of a part at its point nearest to each.

    Where facets meet at this point, it is the mean of their normals.

    Raises
    ------
    InvalidArgumentError
        The normals there cancel each other.
    """
    facets = _facets(body, {master: mesh.part(master)})
    away = body.on_part(facets, master, np.asarray)[facets].sum(axis=1)
    targets = _Facets.all_of(mesh.points, facets)
    tolerance = SAME * float(np.max(np.ptp(mesh.points, axis=0)))
    sums = np.zeros((len(nodes), mesh.points.shape[1]))
    for k, point in enumerate(mesh.points[nodes]):
        rows, distances, normals = map(np.concatenate, zip(*(own.nearest(point) for own in targets), strict=True))
        near = distances <= np.min(distances) + tolerance
        sides = np.sign(np.sum(normals * away[rows], axis=1))
        sums[k] = -np.sum((sides[:, None] * normals)[near], axis=0)
    return unit_vectors(sums, f"normals of {master}")


def faced(
    points: Floats, nodes: Integers, normals: Floats, facets: Integers, outward: Floats, others: Integers
) -> tuple[Mask, sp.csr_array, Floats]:
    """The nearest points of facets on the lines along the normals of nodes.

    Returns
    -------
    found : (k,) bool array
        Which of the nodes face a facet at all; the p of them are the rows of what follows.
    weights : (p, N) csr_array
        Shape functions of the facet at the point that is faced.
    gaps : (p,) array
        Signed distances along the normals, negative where a node is inside the other body [length].

    Parameters
    ----------
    points : (N, d) array
    nodes : (k,) int array
    normals : (k, d) array
        Of length one, out of their body.
    facets : (m, c) int array
        Of the other body.
    outward : (N, d) array
        Vectors out of the other body at the nodes of its facets, of any length.
    others : (l, c) int array
        All other facets on the boundary of bodies: a node is inside the other body where none of them is between.
    """
    tolerance = SAME * float(np.max(np.ptp(points, axis=0)))
    targets, between = (_Facets.all_of(points, rows) for rows in (facets, others))
    away = outward[facets].sum(axis=1)
    found = np.zeros(len(nodes), dtype=bool)
    gaps: list[float] = []
    rows, columns, data = [], [], []
    for k, (node, normal) in enumerate(zip(nodes, normals, strict=True)):
        met = [hit for own in targets for hit in own.on_line(points[node], normal, tolerance)]
        for gap, row, values in sorted(met, key=lambda hit: abs(hit[0])):
            if away[row] @ normal >= 0:
                continue
            if gap < -tolerance:
                crossed = np.array([hit[0] for own in between for hit in own.on_line(points[node], normal, tolerance)])
                if np.any((crossed < -tolerance) & (crossed > gap + tolerance)):
                    continue
            values[np.abs(values) < _AT_NODE] = 0.0
            kept = np.flatnonzero(values)
            rows.append(np.full(len(kept), len(gaps)))
            columns.append(facets[row, kept])
            data.append(values[kept] / values.sum())
            gaps.append(0.0 if abs(gap) <= tolerance else gap)
            found[k] = True
            break
    if not gaps:
        return found, sp.csr_array((0, len(points))), np.zeros(0)
    entries = (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns)))
    return found, sp.csr_array(entries, shape=(len(gaps), len(points))), np.array(gaps)


@dataclass(frozen=True)
class _Facets:
    """Facets of one kind to be met by lines.

    Attributes
    ----------
    kind : CellKind
    rows : (m,) int array
        Which of the facets they are.
    places : (m, c, d) array
        Of the nodes.
    """

    kind: CellKind
    rows: Integers
    places: Floats

    @classmethod
    def all_of(cls, points: Floats, facets: Integers) -> list[_Facets]:
        """Facets of these nodes, edges or facets of solids, by kinds."""
        d = points.shape[1] - 1
        kinds = by_kind(d, facets) if len(facets) else []
        return [cls(KINDS[d, nodes.shape[1]], rows, points[nodes]) for rows, nodes in kinds]

    @cached_property
    def centre(self) -> Floats:
        """Middle of the reference, (d - 1,)."""
        return np.asarray(self.kind.places[: self.kind.corners].mean(axis=0))

    def inside(self, places: Floats) -> Mask:
        """Which places of the reference belong to the facet, but for rounding."""
        sums = places.sum(axis=1) if self.kind.form == "triangle" else np.max(places, axis=1)
        return np.asarray(np.all(places >= -ROUNDING, axis=1) & (sums <= 1 + ROUNDING))

    @cached_property
    def centres(self) -> Floats:
        """Centres of the facets, (m, d)."""
        return np.asarray(np.einsum("m,fmd->fd", self.kind.values(self.centre[None])[:, 0], self.places))

    @cached_property
    def reach(self) -> Floats:
        """No point of a facet is farther from its centre, (m,); a curved one reaches beyond its farthest node."""
        far = np.max(np.linalg.norm(self.places - self.centres[:, None], axis=2), axis=1, initial=0.0)
        return np.asarray(1.5 * far)

    def on_line(self, point: Floats, normal: Floats, tolerance: float) -> list[tuple[float, int, Floats]]:
        """Distances along a line at which it meets facets, by Newton's method, which facets, and shape functions."""
        offset = self.centres - point
        ahead = offset @ normal
        across = np.linalg.norm(offset - ahead[:, None] * normal, axis=1)
        near = np.flatnonzero(across <= self.reach)
        at, gap, facets = np.tile(self.centre, (len(near), 1)), ahead[near], self.places[near]
        direction = np.broadcast_to(-normal[:, None], (len(near), len(normal), 1))

        def left() -> Floats:
            reached = np.einsum("mq,qmd->qd", self.kind.values(at), facets)
            return np.asarray(reached - point - gap[:, None] * normal)

        with np.errstate(all="ignore"):  # what diverges is not taken
            for _ in range(_STEPS if len(near) else 0):
                J, off = np.concatenate([self._tangents(facets, at), direction], axis=2), left()
                # where the line is parallel to the facet, or nearly, it goes astray
                flat = ~(np.abs(np.linalg.det(J)) > _AT_NODE * np.prod(np.linalg.norm(J, axis=1), axis=1))
                J[flat], off[flat] = np.eye(len(normal)), 1.0
                step = np.linalg.solve(J, -off[:, :, None])[:, :, 0]
                at, gap = np.clip(at + step[:, :-1], -2.0, 3.0), gap + step[:, -1]
                if np.max(np.abs(step[:, :-1])) < _CONVERGED:
                    break
            met = np.flatnonzero(self.inside(at) & (np.linalg.norm(left(), axis=1) <= tolerance))
        rows = self.rows[near[met]].tolist()
        return list(zip(gap[met].tolist(), rows, self.kind.values(at[met]).T, strict=True))

    def nearest(self, point: Floats) -> tuple[Integers, Floats, Floats]:
        """Facets that may be nearest to a point, their distances, and unit normals where they are nearest."""
        off = np.linalg.norm(self.centres - point, axis=1)
        near = np.flatnonzero(off - self.reach <= np.min(off + self.reach))
        facets, corners = self.places[near], self.kind.places[: self.kind.corners]
        ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        found = [self._foot(facets, point, one, (two - one)[None]) for one, two in ends]
        if len(corners) > 2:
            found.append(self._foot(facets, point, self.centre, np.eye(2)))
        every = np.array([self._distances(facets, point, at) for at in found])
        best = np.argmin(every, axis=0), np.arange(len(near))
        tangents = self._tangents(facets, np.array(found)[best])
        across = tangents[:, ::-1, 0] * [1.0, -1.0] if len(corners) == 2 else np.cross(*np.moveaxis(tangents, 2, 0))
        return self.rows[near], every[best], unit_vectors(across, "normals of facets")

    def _tangents(self, facets: Floats, at: Floats) -> Floats:
        """Derivatives (q, d, d - 1) of the positions at places (q, d - 1) of the reference."""
        return np.asarray(np.einsum("mkq,qmd->qdk", self.kind.slopes(at), facets))

    def _distances(self, facets: Floats, point: Floats, at: Floats) -> Floats:
        """Distances (q,) of places of the reference from a point; infinite outside of the facets."""
        off = np.einsum("mq,qmd->qd", self.kind.values(at), facets) - point
        return np.where(self.inside(at), np.linalg.norm(off, axis=1), np.inf)

    def _foot(self, facets: Floats, point: Floats, start: Floats, along: Floats) -> Floats:
        """Places (q, d - 1) nearest to a point, by Gauss and Newton: from ``start`` along one edge, or everywhere."""
        is_edge = len(along) < len(start) or self.kind.form == "line"
        least, most = (0.0, 1.0) if is_edge else (-2.0, 3.0)
        steps = np.zeros((len(facets), len(along)))
        for _ in range(_STEPS):
            at = start + steps @ along
            off = point - np.einsum("mq,qmd->qd", self.kind.values(at), facets)
            ahead = np.linalg.pinv(self._tangents(facets, at) @ along.T) @ off[:, :, None]
            before, steps = steps, np.clip(steps + ahead[:, :, 0], least, most)
            if np.max(np.abs(steps - before)) < _CONVERGED:
                break
        return np.asarray(start + steps @ along)
