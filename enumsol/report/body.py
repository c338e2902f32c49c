"""The body of a problem for the page; of a graph its displacements as a linear function of alpha and contact forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.model.cells import boundary, boundary_facets, facet_outlines, outline_edges
from enumsol.model.shapes import SIGNS, BodyShape, acting_nodes, body_shape, first_view, row_frames, row_tangents, signs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.fem import Scene
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import ArrayLike, Floats, Integers

#: Most numbers of displacements, about ten characters each; a mesh with more is drawn by its boundary, or not at all.
_MOST_NUMBERS = 150_000
#: Squares of directions below this are rounding, and directions.
_ROUNDING = 1e-9


def body_record(problem: AnyProblem, scene: Scene | None = None) -> tuple[dict[str, Any] | None, str]:
    """Drawing of a body of d dimensions and its motion; and the reason why a part is missing, else empty.

    Displacements of the nodes, d components in turn, are ``u0 + alpha u1 - sum_k f_k c[k]`` over the d p contact
    forces; a unit of force k acts on nodes as ``acts[k]``, each the node and d components. Of solids there are stresses
    ``s0 + alpha s1 - sum_k f_k s[k]`` of the cells at the facets of the surface, six each, if the page holds them.
    """
    if problem.mesh is None:
        body, why = bare_nodes(problem)
        if body is None:
            return None, why
        still = [0] * (3 * problem.p)
        return body | {"u0": still, "u1": still, "c": [[]] * len(still), "acts": [[]] * len(still)}, why
    if not problem.held:
        return None, "Nothing holds the body, and arcs do not say how far it moves as a whole; roots_at(alpha) does"
    shape = body_shape(problem)
    d = shape.points.shape[1]
    columns = d * problem.p + 2
    body, nodes = drawn_body(problem, shape, columns, scene)
    if columns > most_fields(len(nodes), d):
        return None, (
            f"The mesh is too large to draw: the displacements of {len(nodes):,} nodes on its boundary by "
            f"{d * problem.p:,} contact forces and the load are {d * len(nodes) * columns:,} numbers, and a page holds "
            f"at most {_MOST_NUMBERS:,}"
        )
    motion = sp.csr_array(shape.motion[(d * nodes[:, None] + np.arange(d)).ravel()])
    solved = [problem.factorization.solve(np.asarray(column)) for column in _loads(problem)]
    moved = [motion @ column for column in solved]
    moved[0] = moved[0] + shape.offset[nodes].ravel()
    forces = -sp.csr_array(problem.contact_rows @ shape.acting.T).toarray().reshape(d * problem.p, -1, d)
    return body | _stress_columns(problem, shape, solved) | {
        "u0": short_list(moved[0]),
        "u1": short_list(moved[1]),
        "c": [short_list(column) for column in moved[2:]],
        "acts": [vectors(force, nodes) for force in forces],
    }, ""


def _stress_columns(problem: AnyProblem, shape: BodyShape, solved: Sequence[Floats]) -> dict[str, Any]:
    """Stresses on the surface of a solid by columns, as displacements are given, if the page holds them."""
    of = surface_stresses(problem, shape, len(solved))
    if of is None:
        return {}
    still = of(np.zeros(problem.n))
    first, *others = [short_list(of(column) - still * (k > 0)) for k, column in enumerate(solved)]
    return {"s0": first, "s1": others[0], "s": others[1:]}


def surface_stresses(problem: AnyProblem, shape: BodyShape, columns: int) -> Callable[[Floats], Floats] | None:
    """The function from u to stresses of the cells at the facets of a solid's surface, xx, yy, zz, yz, zx, xy in turn.

    None for a plane body, for one of which no material is known, and where a page does not hold so many columns.
    """
    if shape.points.shape[1] != 3 or problem.mesh is None or not problem.mesh.has_material:
        return None
    _, cells = boundary(3, shape.cells)
    if 6 * len(cells) * columns > _MOST_NUMBERS:
        return None
    from enumsol.fem import cell_stresses  # scikit-fem takes a while

    return lambda u: np.asarray(cell_stresses(problem, u)[cells][:, [0, 1, 2, 1, 2, 0], [0, 1, 2, 2, 0, 1]]).ravel()


def most_fields(nodes: int, d: int) -> int:
    """Number of fields of displacements, of d components at so many nodes, that a page holds."""
    return _MOST_NUMBERS // (d * nodes)


def drawn_body(
    problem: AnyProblem, shape: BodyShape, columns: int, scene: Scene | None = None
) -> tuple[dict[str, Any], Integers]:
    """Drawing of a body apart from any solution, and the numbers of the drawn nodes in its mesh.

    ``points`` are the drawn nodes; contact row i stands at the mean of nodes ``rows[i]``, pairs (node, weight). Of a
    plane body there are cells, or the edges of its boundary if ``columns`` numbers for every component of every node
    are more than the page holds, and what `surroundings` gives; of a solid triangles and edges of its surface, and the
    ``tangents`` of the contact rows, two vectors each, and a ``view``, the direction out of the body from which its
    contact surface is seen best. What `surroundings` gives is about a solid, too.
    """
    cells, d, new = shape.cells, shape.points.shape[1], np.full(len(shape.points), -1)
    touched = np.unique(sp.csr_array(problem.contact_rows @ shape.acting.T).indices // d)
    if d == 3:
        faces = facet_outlines(boundary_facets(3, cells))
        nodes = np.union1d(faces, touched)
    else:
        cells = facet_outlines(cells)
        edges, nodes = boundary_edges(cells), np.arange(len(new))
        if columns > most_fields(len(new), d):
            nodes = np.union1d(edges, touched)
    new[nodes] = np.arange(len(nodes))
    body = {"points": short_list(shape.points[nodes]), "rows": _rows(shape, nodes), "size": shape.size}
    if d == 3:
        more = surroundings(problem, shape, new, _edges(faces), scene) | {
            "tangents": short_list(row_tangents(problem)),
            "view": short_list(first_view(row_frames(problem)[:, 0])),
        }
        if problem.mesh is not None and problem.mesh.lame is not None:
            more["mu"] = float(np.max(problem.mesh.lame[:, 1]))
        return body | _surface(shape, faces, new) | more, nodes
    whole = len(nodes) == len(new)
    return body | {
        "cells": new[cells].tolist() if whole else None,
        "lines": None if whole else new[edges].tolist(),
        "rim": new[edges].tolist(),
        **surroundings(problem, shape, new, edges, scene),
        **_foundation(problem, shape),
    }, nodes


def _surface(shape: BodyShape, faces: Integers, new: Integers) -> dict[str, Any]:
    """Triangles and edges of the surface of a solid."""
    outline = outline_edges(shape.points, faces)
    fan = np.concatenate([faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)])
    fan = fan[fan[:, 1] != fan[:, 2]]  # outlines of fewer nodes than others repeat their last
    return {
        "triangles": new[fan].T.tolist(),
        # of many facets only the edges at which the surface bends
        "edges": new[_edges(faces) if len(faces) <= 2_000 else outline].tolist(),
        "outline": new[outline].tolist(),
    }


def _edges(faces: Integers) -> Integers:
    """Edges of the outlines of facets, (k, 2)."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    return np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)


def bare_nodes(problem: AnyProblem) -> tuple[dict[str, Any] | None, str]:
    """Drawing of a problem without a mesh: in 3D contact nodes at their coordinates; and what is not drawn."""
    places = problem.coordinates
    if not hasattr(problem, "Bt2"):
        return None, "The problem has no mesh, so no body is drawn"
    if places is None:
        return None, "The problem has no mesh and no coordinates, so no body is drawn"
    size = float(np.max(np.ptp(places, axis=0)))
    if not size > 0:
        return None, "The problem has no mesh, and all its contact nodes are at one place: no body is drawn"
    rows = [[[k, 1]] for k in range(len(places))]
    body = {"points": short_list(places), "rows": rows, "size": size, "triangles": None, "edges": [], "outline": []}
    return body, "The problem has no mesh: its contact nodes are drawn at their coordinates, without forces"


def surroundings(
    problem: AnyProblem, shape: BodyShape, new: Integers, edges: Integers, scene: Scene | None = None
) -> dict[str, Any]:
    """Load, supports and springs of a body, for the page: of many nodes side by side some stand for all.

    ``new`` is the number of every node among those that are drawn, -1 for others; ``edges`` are those of the boundary.
    ``load`` has a place, forces and their derivatives with respect to alpha, d numbers each, ``summed`` whether some
    of it is the sum over several nodes; ``held`` a node and a direction in which it cannot move, or zeros for several;
    ``springs`` nodes.
    """
    motion, (count, d) = shape.motion, shape.points.shape
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    # what nothing is coupled with is held, or moved as alpha says
    coupled = np.diff(problem.A.indptr) > 1
    forces = np.hstack([(shape.acting @ np.where(coupled, own, 0.0)).reshape(-1, d) for own in (problem.f, slope)])
    acting = acting_nodes(forces)
    if len(np.setdiff1d(acting, edges)) > SIGNS:  # a weight: its resultant
        weights = np.linalg.norm(forces[acting], axis=1)
        load = np.hstack([weights @ shape.points[acting] / weights.sum(), forces.sum(axis=0)])[None, :]
        summed = True
    else:
        shown = signs(shape.points, acting, edges)
        load = np.array([[*shape.points[node], *forces[group].sum(axis=0)] for node, group in shown])
        summed = len(shown) < len(acting)
    axes = [motion[k::d] for k in range(d)]
    free = np.array([[np.asarray(a.multiply(b).sum(axis=1)).ravel() for a in axes] for b in axes])
    sizes, ways = np.linalg.eigh(free.transpose(2, 0, 1))
    fixed = np.sum(sizes < _ROUNDING, axis=1)
    across = np.where((fixed == 1)[:, None], ways[:, :, 0], 0.0) + 0.0
    across[np.abs(across) < _ROUNDING] = 0.0
    across *= np.where(across[np.arange(count), np.argmax(np.abs(across), axis=1)] < 0, -1.0, 1.0)[:, None]
    drawn = new >= 0
    held: list[Any] = []
    for kind in np.unique(across[(fixed > 0) & drawn].round(6), axis=0):
        alike = np.flatnonzero((fixed > 0) & drawn & np.all(across.round(6) == kind, axis=1))
        held += [[int(new[k]), *short_list(across[k])] for k, _ in signs(shape.points, alike, edges)]
    sprung: Any = [] if scene is None else acting_nodes(scene.springs.diagonal()[: count * d].reshape(count, d))
    sprung = np.array([node for node in sprung if drawn[node]], dtype=int)
    springs = [int(new[node]) for node, _ in signs(shape.points, sprung, edges)]
    return {"load": short_list(load), "summed": summed, "held": held, "springs": springs}


def _foundation(problem: AnyProblem, shape: BodyShape) -> dict[str, Any]:
    """Foundation and material of a plane body.

    ``walls`` has (row, x, y, gap), normals of the rigid foundation; ``lame`` the coefficients of the cells, one pair if
    all are the same.
    """
    normals = np.asarray(problem.Bn @ shape.acting.T @ np.tile(np.eye(2), (len(shape.points), 1)))
    walls = [
        [k, *short_list([*normal, problem.gap[k]])]
        for k, normal in enumerate(normals)
        if abs(normal @ normal - 1.0) < _ROUNDING  # rows of two bodies add up to nothing
    ]
    lame = None if problem.mesh is None else problem.mesh.lame
    if lame is not None and np.all(lame == lame[0]):
        lame = lame[:1]
    return {"walls": walls, "lame": None if lame is None else short_list(lame)}


def _loads(problem: AnyProblem) -> list[Floats]:
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    return [problem.f, slope, *problem.contact_rows.toarray()]


def _rows(shape: BodyShape, nodes: Integers) -> list[list[list[float]]]:
    """At which mean of drawn nodes every contact row stands: pairs (node, weight)."""
    weights = sp.csr_array(shape.weights[:, nodes])
    parts = zip(weights.indptr[:-1], weights.indptr[1:], strict=True)
    return [
        [
            [int(node), float(f"{weight:.6g}")]
            for node, weight in zip(weights.indices[a:b], weights.data[a:b], strict=True)
        ]
        for a, b in parts
    ]


def vectors(forces: Floats, nodes: Integers) -> list[list[float]]:
    """Forces that are not zero on drawn nodes: node and components."""
    return [[int(k), *short_list(forces[nodes[k]])] for k in np.flatnonzero(np.any(forces[nodes] != 0, axis=1))]


def boundary_edges(outlines: Integers) -> Integers:
    """Edges that belong to one cell only, (k, 2)."""
    edges = np.concatenate([outlines[:, [k, (k + 1) % outlines.shape[1]]] for k in range(outlines.shape[1])])
    edges = edges[edges[:, 0] != edges[:, 1]]  # outlines of fewer nodes than others repeat their last
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(edges[first[count == 1]])


def short_list(values: ArrayLike) -> Any:
    """Numbers to seven digits, as lists; zeros lose their sign and integers their point."""
    array = np.asarray(values)
    if array.ndim > 1:
        return [short_list(row) for row in array]
    return [int(x) if x == int(x) and abs(x) < 1e15 else float(f"{x:.7g}") for x in array.tolist()]
