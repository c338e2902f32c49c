"""The body of a problem for the page; of a graph its displacements as a linear function of alpha and contact forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.model.cells import KINDS, boundary_facets, facet_outlines, outline_edges
from enumsol.model.shapes import BodyShape, body_shape, row_tangents

if TYPE_CHECKING:
    from enumsol.fem import Scene
    from enumsol.model.problem3d import AnyProblem
    from enumsol.support.array_types import Floats, Integers

#: Most numbers of displacements, about ten characters each; a mesh with more is drawn by its boundary, or not at all.
_MOST_NUMBERS = 150_000
#: Boundary facets of a solid whose edges are all drawn; of more only those at which the surface bends.
_MOST_EDGES = 2_000
#: Of more loaded nodes than this the resultant is drawn.
_MOST_LOADED = 150
_DIGITS = 7
#: Squares of directions below this are rounding.
_ROUNDING = 1e-9


def body_record(problem: AnyProblem, scene: Scene | None = None) -> tuple[dict[str, Any] | None, str]:
    """What is drawn of a body of d dimensions and what moves it; and why it is not all of it, empty if it is.

    Displacements of the nodes, d components in turn, are ``u0 + alpha u1 - sum_k f_k c[k]`` over the d p contact
    forces; a unit of force k acts on nodes as ``acts[k]``, each the node and d components.
    """
    if problem.mesh is None:
        body, why = bare_nodes(problem)
        if body is None:
            return None, why
        still = [0] * (3 * problem.p)
        return body | {"u0": still, "u1": still, "c": [[]] * len(still), "acts": [[]] * len(still)}, why
    if problem.modes is not None:
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
    moved = [motion @ problem.factorization.solve(np.asarray(column)) for column in _loads(problem)]
    moved[0] = moved[0] + shape.offset[nodes].ravel()
    forces = -sp.csr_array(problem.contact_rows @ shape.motion.T).toarray().reshape(d * problem.p, -1, d)
    return body | {
        "u0": short_list(moved[0]),
        "u1": short_list(moved[1]),
        "c": [short_list(column) for column in moved[2:]],
        "acts": [vectors(force, nodes) for force in forces],
    }, ""


def most_fields(nodes: int, d: int) -> int:
    """How many fields of displacements of d components of so many nodes a page holds."""
    return _MOST_NUMBERS // (d * nodes)


def drawn_body(
    problem: AnyProblem, shape: BodyShape, columns: int, scene: Scene | None = None
) -> tuple[dict[str, Any], Integers]:
    """What is drawn of a body whatever its solution, and which nodes of its mesh the drawn ones are.

    ``points`` are the drawn nodes; contact row i stands at the mean of nodes ``rows[i]``, pairs (node, weight). Of a
    plane body there are cells, or the edges of its boundary if ``columns`` numbers for every component of every node
    are more than the page holds, and what `surroundings` gives; of a solid triangles and edges of its surface, and the
    ``tangents`` of the contact rows, two vectors each.
    """
    cells, d, new = shape.cells, shape.points.shape[1], np.full(len(shape.points), -1)
    touched = np.unique(sp.csr_array(problem.contact_rows @ shape.motion.T).indices // d)
    if d == 3:
        faces = facet_outlines(boundary_facets(3, cells))
        nodes = np.union1d(faces, touched)
    else:
        cells = cells[:, KINDS[2, cells.shape[1]].outline]
        edges, nodes = boundary_edges(cells), np.arange(len(new))
        if columns > most_fields(len(new), d):
            nodes = np.union1d(edges, touched)
    new[nodes] = np.arange(len(nodes))
    body = {"points": short_list(shape.points[nodes]), "rows": _rows(shape, nodes), "size": shape.size}
    if d == 3:
        return body | _surface(shape, faces, new) | {"tangents": short_list(row_tangents(problem))}, nodes
    whole = len(nodes) == len(new)
    return body | {
        "cells": new[cells].tolist() if whole else None,
        "lines": None if whole else new[edges].tolist(),
        "rim": new[edges].tolist(),
        **surroundings(problem, shape, new, scene),
    }, nodes


def _surface(shape: BodyShape, faces: Integers, new: Integers) -> dict[str, Any]:
    """Triangles and edges of the surface of a solid."""
    outline = outline_edges(shape.points, faces)
    after = np.roll(faces, -1, axis=1)
    edges = np.unique(np.sort(np.stack([faces, after], axis=2).reshape(-1, 2), axis=1), axis=0)
    fan = [faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)]
    return {
        "triangles": new[np.concatenate(fan)].T.tolist(),
        "edges": new[edges if len(faces) <= _MOST_EDGES else outline].tolist(),
        "outline": new[outline].tolist(),
    }


def bare_nodes(problem: AnyProblem) -> tuple[dict[str, Any] | None, str]:
    """Of a problem without a mesh: in 3D the contact nodes at their coordinates, and what is not drawn."""
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


def surroundings(problem: AnyProblem, shape: BodyShape, new: Integers, scene: Scene | None = None) -> dict[str, Any]:
    """Load, supports, springs, foundation and material of a plane body, for the page.

    ``new`` is the number of every node among those that are drawn, -1 for others. ``load`` has (x, y) of a place,
    forces in x and y and their derivatives with respect to alpha; ``held`` (node, x, y), a direction in which a node
    cannot move, or 0, 0 for all; ``springs`` nodes; ``walls`` (row, x, y, gap), normals of the rigid foundation;
    ``lame`` the coefficients of the cells, one pair if all are the same.
    """
    motion, drawn = shape.motion, new >= 0
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    forces = np.hstack([(motion @ vector).reshape(-1, 2) for vector in (problem.f, slope)])
    acting = np.flatnonzero(np.any(forces, axis=1))
    load = np.hstack([shape.points[acting], forces[acting]])
    if len(acting) > _MOST_LOADED:
        weights = np.linalg.norm(forces[acting], axis=1)
        load = np.hstack([weights @ shape.points[acting] / weights.sum(), forces.sum(axis=0)])[None, :]
    x, y = motion[0::2], motion[1::2]
    xx, yy, xy = (np.asarray(a.multiply(b).sum(axis=1)).ravel() for a, b in ((x, x), (y, y), (x, y)))
    held = [[int(new[node]), 0, 0] for node in np.flatnonzero((xx + yy < _ROUNDING) & drawn)]
    # of a node that moves along one direction (a, b), the square of what it is held across is 1 - a a, 1 - b b, - a b
    guided = (np.abs(xx * yy - xy**2) < _ROUNDING) & (np.abs(xx + yy - 1.0) < _ROUNDING) & drawn
    held += [
        [int(new[k]), *short_list([np.sqrt(max(1 - xx[k], 0)), -np.sign(xy[k] or 1) * np.sqrt(max(1 - yy[k], 0))])]
        for k in np.flatnonzero(guided)
    ]
    normals = np.asarray(problem.Bn @ motion.T @ np.tile(np.eye(2), (len(shape.points), 1)))
    walls = [
        [k, *short_list([*normal, problem.gap[k]])]
        for k, normal in enumerate(normals)
        if abs(normal @ normal - 1.0) < _ROUNDING  # rows of two bodies add up to nothing
    ]
    springs: Any = [] if scene is None else np.flatnonzero(scene.springs.diagonal().reshape(-1, 2).any(axis=1))
    lame = None if problem.mesh is None else problem.mesh.lame
    if lame is not None and np.all(lame == lame[0]):
        lame = lame[:1]
    return {
        "load": short_list(load),
        "held": held,
        "springs": [int(new[node]) for node in springs if drawn[node]],
        "walls": walls,
        "lame": None if lame is None else short_list(lame),
    }


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
    edges = edges[edges[:, 0] != edges[:, 1]]  # triangles among quadrilaterals name a corner twice
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(edges[first[count == 1]])


def short_list(values: Any) -> Any:
    """Numbers to seven digits, as lists; zeros lose their sign and integers their point."""
    array = np.asarray(values)
    if array.ndim > 1:
        return [short_list(row) for row in array]
    return [int(x) if x == int(x) and abs(x) < 1e15 else float(f"{x:.{_DIGITS}g}") for x in array.tolist()]
