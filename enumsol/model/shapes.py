"""The deformed body of a solution: nodes, their displacements, contact forces on them, places of contact rows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from enumsol.errors import InvalidArgumentError
from enumsol.model.statuses import ContactStatus
from enumsol.support.array_types import AlphaLike, Floats, Integers

if TYPE_CHECKING:
    from enumsol.model.mesh import BodyMesh
    from enumsol.model.problem3d import AnyProblem

#: Length of an arrow along a slip, whatever the slip, as a part of the body's size.
SLIP_ARROW = 0.12
#: Nodal forces below this part of the largest are rounding.
_LEAST_FORCE = 1e-9
#: Displacements below this part of those without contact forces are what rounding leaves where forces cancel the load;
#: larger, it would hide how a stiff body on very weak springs is deformed.
_LEAST_MOVED = 1e-12
#: Number of signs of loads, springs or supports along one side of a body.
SIGNS = 12
#: Cosine of the angle by which the boundary turns at most within a side.
_SIDE = float(np.cos(np.radians(30.0)))
#: Directions from which a solid may first be seen, as azimuths and elevations; the usual one is preferred a little.
_AZIMUTHS, _ELEVATIONS, _USUAL, _PREFERRED = range(-180, 180, 15), (-35, -20, 20), (-57, 22), 0.2


def body_mesh(problem: AnyProblem) -> BodyMesh:
    """The mesh of a problem in 2D or 3D.

    Raises
    ------
    InvalidArgumentError
        The problem has no mesh.
    """
    if problem.mesh is None:
        raise InvalidArgumentError("the problem has no mesh; expected one made by enumsol.fem, or with mesh=")
    return problem.mesh


def row_weights(problem: AnyProblem) -> sp.csr_array:
    """Weights, sparse (p, N), by which every contact row belongs to every node; rows add up to 1."""
    mesh = body_mesh(problem)
    by_node = sp.csr_array(abs(problem.Bn) @ abs(mesh.acting).T)
    count, dimension = mesh.points.shape
    weights = sp.csr_array(by_node @ sp.kron(sp.eye_array(count), np.ones((dimension, 1))))
    scale = 1.0 / np.asarray(weights.sum(axis=1)).ravel()
    return sp.csr_array(sp.diags_array(scale) @ weights)


def body_moves(problem: AnyProblem, u: Floats, alpha: AlphaLike) -> Floats:
    """Displacements of all nodes at a root, (N, d) [length]: zero for a body at rest, where only rounding is left.

    What rounding is is measured by the displacements without contact forces, or, if nothing holds the body, by its
    size.
    """
    mesh = body_mesh(problem)
    found, free = mesh.displacements(u), mesh.size
    if problem.held:
        none = np.zeros(problem.contact_rows.shape[0])
        free = largest_length(mesh.displacements(problem.condensed.displacement(alpha, none)))
    return found if largest_length(found) > _LEAST_MOVED * free else np.zeros_like(found)


def contact_forces(problem: AnyProblem, lambda_n: Floats, lambda_t: Floats) -> Floats:
    """Contact forces on all nodes of the body in global axes, (N, d) [force]."""
    mesh = body_mesh(problem)
    rows = np.concatenate([lambda_n, lambda_t.ravel(order="F")])
    forces = -np.asarray(mesh.acting @ (problem.contact_rows.T @ rows)).reshape(mesh.points.shape)
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    return np.asarray(np.where(size > _LEAST_FORCE * np.max(size, initial=0.0), forces, 0.0))


def largest_length(vectors: Floats) -> float:
    """The length of the longest of some vectors."""
    return float(np.max(np.linalg.norm(vectors, axis=1), initial=0.0))


def round_scale(largest: float, size: float, share: float = 0.08) -> float:
    """A factor of the form 1, 2 or 5 times a power of ten by which ``largest`` takes about that share of the size."""
    if not largest > 0:
        return 1.0
    wanted = share * size / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted * (1 + 1e-12)))


def own_scales(largest: Sequence[float], size: float) -> tuple[float, ...]:
    """Factors of bodies that are compared: the same for all, or of each its own if they move by very different amounts.

    Bodies that do not move at all have the factor of the others.
    """
    moved = [value for value in largest if value > 0]
    common = round_scale(max(largest), size)
    if not moved or max(moved) <= 8.0 * min(moved):
        return (common,) * len(largest)
    return tuple(round_scale(value, size) if value > 0 else common for value in largest)


def _directions(problem: AnyProblem) -> Floats:
    """The normals and the tangents of the contact rows, summed over the nodes of a row, in global axes, (p, d, d)."""
    rows = body_mesh(problem).directions(problem.contact_rows)
    return rows.reshape(-1, problem.p, rows.shape[1]).swapaxes(0, 1)


def row_frames(problem: AnyProblem) -> Floats:
    """Unit vectors of the contact rows in global axes, (p, d, d): the normals and the tangents; zero if not known."""
    sums = _directions(problem)
    lengths = np.linalg.norm(sums, axis=2, keepdims=True)
    return np.asarray(np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0))


def row_tangents(problem: AnyProblem) -> Floats:
    """Both tangents of the contact rows in 3D, summed over the nodes of a row, in global axes, (p, 2, 3)."""
    return _directions(problem)[:, 1:]


def slip_directions(problem: AnyProblem, u_t: Floats, statuses: Sequence[ContactStatus]) -> tuple[Integers, Floats]:
    """Contact rows in 3D that slip, (k,), and the unit vectors in global axes along which they do, (k, 3)."""
    moves = np.einsum("pk,pkc->pc", u_t, row_tangents(problem))
    size = np.linalg.norm(moves, axis=1)
    slips = np.array([status is ContactStatus.SLIP for status in statuses])
    slides = np.flatnonzero(slips & (size > 0))
    return slides, moves[slides] / size[slides, None]


def acting_nodes(values: Floats) -> Integers:
    """Nodes at which values (N, k) are more than rounding of the largest."""
    size = np.max(np.abs(values), axis=1)
    return np.flatnonzero(size > _LEAST_FORCE * np.max(size, initial=0.0))


def signs(points: Floats, nodes: Integers, edges: Integers) -> list[tuple[int, Integers]]:
    """Some of the nodes, and those that each of them stands for: about `SIGNS` evenly along each side, ends included.

    Parameters
    ----------
    points : (N, d) array
        All nodes [length].
    nodes : (k,) array of int
        Those that have a sign.
    edges : (m, 2) array of int
        Edges of the boundary; the sides of a plane body are lines of these, those of a solid what they join.
    """
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    inside = np.isin(edges, nodes).all(axis=1) & (edges[:, 0] != edges[:, 1])
    links: dict[int, list[int]] = {int(node): [] for node in nodes}
    for a, b in edges[inside].tolist():
        links[a].append(b)
        links[b].append(a)
    alone = [node for node, others in links.items() if not others]
    for node in alone:
        del links[node]
    plane = points.shape[1] == 2
    found, taken = [], set[int]()
    for side in [*(_lines(points, links) if plane else _patches(links)), alone]:
        every = np.array(list(dict.fromkeys(side)), dtype=int)
        own = every[~np.isin(every, list(taken))]
        if not len(own):
            continue
        chosen = every[_along(points[side], points[every]) if plane and side is not alone else _apart(points[every])]
        # a corner has its sign already
        chosen = chosen[np.isin(chosen, own)] if np.any(np.isin(chosen, own)) else own[:1]
        taken.update(own.tolist())
        nearest = np.argmin(np.linalg.norm(points[own][:, None] - points[chosen][None], axis=2), axis=1)
        found += [(int(node), own[nearest == number]) for number, node in enumerate(chosen)]
    return found


def _lines(points: Floats, links: dict[int, list[int]]) -> Iterator[list[int]]:
    """Lines of linked nodes, cut at corners; a closed one begins and ends with the same node."""

    def smooth(node: int) -> bool:
        if len(links[node]) != 2:
            return False
        before, after = (points[other] - points[node] for other in links[node])
        return bool(-before @ after > _SIDE * np.linalg.norm(before) * np.linalg.norm(after))

    used = set[frozenset[int]]()
    for start in sorted(links, key=smooth):
        for after in links[start]:
            line, node = [start], after
            while frozenset((line[-1], node)) not in used:
                used.add(frozenset((line[-1], node)))
                line.append(node)
                if node == start or not smooth(node):
                    break
                node = next(other for other in links[node] if other != line[-2])
            if len(line) > 1:
                yield line


def _patches(links: dict[int, list[int]]) -> Iterator[list[int]]:
    """Sets of linked nodes."""
    left = dict.fromkeys(links)
    while left:
        patch = [left.popitem()[0]]
        for node in patch:
            patch += [other for other in links[node] if other in left]
            for other in links[node]:
                left.pop(other, None)
        yield sorted(patch)


def _along(line: Floats, places: Floats) -> list[int]:
    """Rows of the places on a line that get a sign: the nearest to points at equal distances along it."""
    if len(places) < 1.3 * SIGNS:  # nearly as few
        return list(range(len(places)))
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    closed = bool(np.all(line[0] == line[-1]))
    wanted = np.linspace(0.0, lengths[-1], SIGNS + closed)[:SIGNS]
    even = np.stack([np.interp(wanted, lengths, axis) for axis in line.T], axis=1)
    nearest = np.argmin(np.linalg.norm(places[:, None] - even[None], axis=2), axis=0)
    return list(dict.fromkeys(nearest.tolist()))


def _apart(places: Floats) -> list[int]:
    """Rows of the places that get a sign: first the farthest from their middle, then always the farthest from these."""
    distance = np.linalg.norm(places - places.mean(axis=0), axis=1)
    chosen: list[int] = []
    while len(chosen) < min(SIGNS, len(places)):
        chosen.append(int(np.argmax(distance)))
        away = np.linalg.norm(places - places[chosen[-1]], axis=1)
        distance = away if len(chosen) == 1 else np.minimum(distance, away)
    return chosen


def first_view(normals: Floats) -> Floats:
    """The direction from which most of the contact surface of a solid is seen, a unit vector (3,) out of the body.

    ``normals`` (p, 3) are those of the contact rows out of the body, zero where not known.
    """
    usual = _direction(*_USUAL)
    ways = np.array([usual, *(_direction(a, e) for e in _ELEVATIONS for a in _AZIMUTHS)])
    # from straight above a solid looks flat: below this cosine nothing more of a surface is gained
    seen = np.mean(np.clip(normals @ ways.T, 0.0, 0.6), axis=0)
    return np.asarray(ways[np.argmax(seen + _PREFERRED * (ways @ usual))])


def _direction(azimuth: float, elevation: float) -> Floats:
    a, e = np.radians((azimuth, elevation))
    return np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])


def arrow_scale(largest: float, size: float) -> float:
    """Length of an arrow for a unit of force: the longest takes this part of the body's size."""
    return 0.16 * size / largest if largest > 0 else 0.0
