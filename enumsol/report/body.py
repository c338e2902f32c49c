"""The body of a problem for the page: displacements of its nodes as a linear function of alpha and contact forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.model.cells import KINDS
from enumsol.model.shapes import BodyShape, body_shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from enumsol.fem import Scene
    from enumsol.model.problem import ContactProblem

    Floats = NDArray[np.float64]

#: Most numbers of displacements; a mesh with more is drawn by its boundary, or not at all.
_MOST_NUMBERS = 150_000
#: Of more loaded nodes than this the resultant is drawn.
_MOST_LOADED = 150
_DIGITS = 7
#: Squares of directions below this are rounding.
_ROUNDING = 1e-9


def body_record(problem: ContactProblem, scene: Scene | None = None) -> dict[str, Any] | str:
    """Nodes, cells or boundary edges, what moves them and what is around; or why the body cannot be drawn.

    Displacements of the nodes, x and y in turn, are ``u0 + alpha u1 - sum_k f_k c[k]`` over the 2p contact forces; a
    unit of force k acts on nodes as ``acts[k]``, triples (node, x, y); contact row i stands at the mean of nodes
    ``rows[i]``, pairs (node, weight).
    """
    if problem.mesh is None:
        return "The problem has no mesh"
    if problem.modes is not None:
        return "Nothing holds the body, and arcs do not say how far it moves as a whole; graph.roots_at(alpha) does"
    shape = body_shape(problem)
    columns = 2 * problem.p + 2
    cells = shape.cells[:, KINDS[2, shape.cells.shape[1]].outline]
    lines = None
    nodes = np.arange(len(shape.points))
    if shape.points.size * columns > _MOST_NUMBERS:
        lines = boundary_edges(cells)
        nodes = np.unique(lines)
    if 2 * len(nodes) * columns > _MOST_NUMBERS:
        return (
            f"The mesh is too large to draw: the displacements of {len(nodes):,} nodes on its boundary by "
            f"{2 * problem.p:,} contact forces and the load are {2 * len(nodes) * columns:,} numbers, and a page holds "
            f"at most {_MOST_NUMBERS:,}"
        )
    new = np.full(len(shape.points), -1)
    new[nodes] = np.arange(len(nodes))
    rows = sp.csr_array(shape.weights)
    acts = _forces(problem, shape)
    if np.any(new[rows.indices] < 0) or any(new[node] < 0 for row in acts for node, _, _ in row):
        return "The mesh is drawn by its boundary, as large as it is, and some contact nodes are not on it"
    dofs = np.stack([2 * nodes, 2 * nodes + 1], axis=1).ravel()
    motion = sp.csr_array(shape.motion[dofs])
    moved = [motion @ problem.factorization.solve(np.asarray(column)) for column in _loads(problem)]
    moved[0] = moved[0] + shape.offset[nodes].ravel()
    return {
        **surroundings(problem, shape, new, scene),
        "points": _short(shape.points[nodes]),
        "cells": None if lines is not None else new[cells].tolist(),
        "lines": None if lines is None else new[lines].tolist(),
        "rim": new[boundary_edges(cells) if lines is None else lines].tolist(),
        "u0": _short(moved[0]),
        "u1": _short(moved[1]),
        "c": [_short(column) for column in moved[2:]],
        "acts": [[[int(new[node]), x, y] for node, x, y in row] for row in acts],
        "rows": [
            [[int(new[node]), float(f"{weight:.6g}")] for node, weight in zip(*_row(rows, i), strict=True)]
            for i in range(problem.p)
        ],
        "size": shape.size,
    }


def surroundings(
    problem: ContactProblem, shape: BodyShape, new: NDArray[np.int64], scene: Scene | None = None
) -> dict[str, Any]:
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
        [int(new[k]), *_short([np.sqrt(max(1 - xx[k], 0)), -np.sign(xy[k] or 1) * np.sqrt(max(1 - yy[k], 0))])]
        for k in np.flatnonzero(guided)
    ]
    normals = np.asarray(problem.Bn @ motion.T @ np.tile(np.eye(2), (len(shape.points), 1)))
    walls = [
        [k, *_short([*normal, problem.gap[k]])]
        for k, normal in enumerate(normals)
        if abs(normal @ normal - 1.0) < _ROUNDING  # rows of two bodies add up to nothing
    ]
    springs: Any = [] if scene is None else np.flatnonzero(scene.springs.diagonal().reshape(-1, 2).any(axis=1))
    lame = None if problem.mesh is None else problem.mesh.lame
    if lame is not None and np.all(lame == lame[0]):
        lame = lame[:1]
    return {
        "load": _short(load),
        "held": held,
        "springs": [int(new[node]) for node in springs if drawn[node]],
        "walls": walls,
        "lame": None if lame is None else _short(lame),
    }


def _loads(problem: ContactProblem) -> list[Floats]:
    slope = np.zeros(problem.n) if problem.load_slope is None else problem.load_slope
    return [problem.f, slope, *problem.contact_rows.toarray()]


def _forces(problem: ContactProblem, shape: BodyShape) -> list[list[tuple[int, float, float]]]:
    """What a unit of every contact force does to the nodes of the body."""
    forces = -sp.csr_array(problem.contact_rows @ shape.motion.T).toarray().reshape(2 * problem.p, -1, 2)
    return [
        [(int(node), float(f"{row[node, 0]:.9g}"), float(f"{row[node, 1]:.9g}")) for node in np.flatnonzero(row.any(1))]
        for row in forces
    ]


def _row(matrix: sp.csr_array, i: int) -> tuple[Any, Any]:
    part = slice(matrix.indptr[i], matrix.indptr[i + 1])
    return matrix.indices[part], matrix.data[part]


def boundary_edges(outlines: NDArray[np.int64]) -> NDArray[np.int64]:
    """Edges that belong to one cell only, (k, 2)."""
    edges = np.concatenate([outlines[:, [k, (k + 1) % outlines.shape[1]]] for k in range(outlines.shape[1])])
    edges = edges[edges[:, 0] != edges[:, 1]]  # triangles among quadrilaterals name a corner twice
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(edges[first[count == 1]])


def _short(values: Any) -> Any:
    return (
        [[float(f"{x:.{_DIGITS}g}") for x in row] for row in values]
        if np.ndim(values) == 2
        else [float(f"{x:.{_DIGITS}g}") for x in values]
    )
