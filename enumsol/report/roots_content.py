"""What the page of a RootSet shows, as plain values that JSON can hold; the page's script draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from enumsol.model.cells import KINDS, boundary_facets, facet_outlines, outline_edges
from enumsol.model.shapes import SLIP_ARROW, BodyShape, arrow_scale, body_shape, slip_directions
from enumsol.model.statuses import ContactStatus
from enumsol.report.body import boundary_edges, surroundings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from enumsol.fem import Scene
    from enumsol.roots.root import Root
    from enumsol.roots.root_set import RootSet

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

#: Most numbers of displacements of all drawn bodies, and of forces and displacements of contact nodes in tables; about
#: ten characters each.
_MOST_NUMBERS, _MOST_VALUES = 150_000, 150_000
#: Boundary facets of a solid whose edges are all drawn; of more only those at which the surface bends.
_MOST_EDGES = 2_000
_DIGITS = 7
_ORDER = tuple(ContactStatus)


def roots_content(found: RootSet, scene: Scene | None = None) -> dict[str, Any]:
    """Everything that the script needs: nodes, roots with their values, and the bodies that are drawn.

    Statuses are texts of one digit per node, places in ``statuses``. ``f`` and ``w`` are forces and displacements of
    the contact nodes: all normal ones, then those along each tangent.
    """
    p = len(found.node_ids)
    listed = found[: max(1, _MOST_VALUES // (8 * p))]
    pictures, bodies = _pictures(listed, scene) if listed else (_nothing(""), [])
    bodies += [{}] * (len(listed) - len(bodies))
    return {
        "nodes": [str(label) for label in found.node_ids],
        "statuses": [status.value for status in _ORDER],
        "all": len(found),
        "roots": [_record(found, k, root) | bodies[k] for k, root in enumerate(listed)],
        **pictures,
    }


def _record(found: RootSet, k: int, root: Root) -> dict[str, Any]:
    return {
        "index": root.index,
        "regular": root.regular,
        "margin": float(f"{root.margin:.3g}"),
        "mirror": "" if found.mirror_images is None else found.mirror_images.words(k),
        "statuses": "".join(str(_ORDER.index(status)) for status in root.statuses),
        "several": [i for i, holds in enumerate(root.active) if len(holds) > 1],
        "f": _short(np.concatenate([root.lambda_n, root.lambda_t.ravel(order="F")])),
        "w": _short(np.concatenate([root.u_n, root.u_t.ravel(order="F")])),
        "angles": None
        if root.slip_angle is None
        else [None if np.isnan(pair[0]) else _short(pair) for pair in root.slip_angle],
    }


def _nothing(why: str) -> dict[str, Any]:
    return {"body": None, "no_body": why, "arrow": 0.0, "largest": 0.0, "slip": 0.0}


def _pictures(roots: Sequence[Root], scene: Scene | None) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The body, or why there is none, and what moves it and acts on it by root; of many roots the first."""
    problem = roots[0].problem
    if problem.mesh is None:
        return _bare_nodes(roots)
    in_space = roots[0].lambda_t.ndim == 2
    shape = body_shape(problem)
    body, nodes = _solid(shape) if in_space else _plane(shape, len(roots))
    if not in_space:
        new = np.full(len(shape.points), -1)
        new[nodes] = np.arange(len(nodes))
        body |= surroundings(problem, shape, new, scene)
    count = _MOST_NUMBERS // (len(nodes) * shape.points.shape[1]) - 1
    if count < 1:
        return _nothing(f"The mesh is too large to draw: its boundary alone has {len(nodes):,} nodes"), []
    body |= {"points": _short(shape.points[nodes]), "rows": _rows(shape, nodes), "size": shape.size}
    drawn = roots[:count]
    acting = [shape.contact_forces(problem, root.lambda_n, root.lambda_t) for root in drawn]
    moves = [shape.displacements(root.u) for root in drawn]
    bodies = [
        {"u": _short(moved[nodes].ravel()), "forces": _vectors(forces, nodes), "slips": []}
        for forces, moved in zip(acting, moves, strict=True)
    ]
    if in_space:
        for root, each in zip(drawn, bodies, strict=True):
            each["slips"] = [[int(k), *_short(way)] for k, way in zip(*slip_directions(problem, root), strict=True)]
    largest = max(map(_largest, acting))
    return {
        "body": body,
        "no_body": f"The bodies of the first {count} roots are drawn: the page holds no more"
        if count < len(roots)
        else "",
        "arrow": arrow_scale(largest, shape.size),
        "largest": float(f"{largest:.{_DIGITS}g}"),
        "slip": SLIP_ARROW * shape.size,
    }, bodies


def _bare_nodes(roots: Sequence[Root]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """In 3D the contact nodes at their coordinates, where there is no mesh."""
    places = roots[0].problem.coordinates
    if roots[0].lambda_t.ndim == 1:
        return _nothing("The problem has no mesh, so no body is drawn"), []
    if places is None:
        return _nothing("The problem has no mesh and no coordinates, so no body is drawn"), []
    size = float(np.max(np.ptp(places, axis=0)))
    if not size > 0:
        return _nothing("The problem has no mesh, and all its contact nodes are at one place: nothing is drawn"), []
    rows = [[[k, 1]] for k in range(len(places))]
    body = {"points": _short(places), "rows": rows, "size": size, "triangles": None, "edges": [], "outline": []}
    still = {"u": [0] * places.size, "forces": [], "slips": []}
    words = "The problem has no mesh: its contact nodes are drawn at their coordinates, without forces"
    return _nothing(words) | {"body": body}, [still] * len(roots)


def _solid(shape: BodyShape) -> tuple[dict[str, Any], Integers]:
    """Triangles and edges of the surface of a solid, and the nodes that are drawn."""
    faces = facet_outlines(boundary_facets(3, shape.cells))
    outline = outline_edges(shape.points, faces)
    after = np.roll(faces, -1, axis=1)
    edges = np.unique(np.sort(np.stack([faces, after], axis=2).reshape(-1, 2), axis=1), axis=0)
    fan = [faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)]
    nodes, new = _numbered(shape, np.unique(faces))
    return {
        "triangles": new[np.concatenate(fan)].T.tolist(),
        "edges": new[edges if len(faces) <= _MOST_EDGES else outline].tolist(),
        "outline": new[outline].tolist(),
    }, nodes


def _plane(shape: BodyShape, bodies: int) -> tuple[dict[str, Any], Integers]:
    """Cells of a plane body, of a large one the edges of its boundary, and the nodes that are drawn."""
    cells = shape.cells[:, KINDS[2, shape.cells.shape[1]].outline]
    edges = boundary_edges(cells)
    if shape.points.size * (bodies + 1) <= _MOST_NUMBERS:
        return {"cells": cells.tolist(), "lines": None, "rim": edges.tolist()}, np.arange(len(shape.points))
    nodes, new = _numbered(shape, np.unique(edges))
    return {"cells": None, "lines": new[edges].tolist(), "rim": new[edges].tolist()}, nodes


def _numbered(shape: BodyShape, nodes: Integers) -> tuple[Integers, Integers]:
    """Those nodes and the nodes of the contact rows, and the number of each of the body's nodes among them."""
    nodes = np.union1d(nodes, sp.csr_array(shape.weights).indices)
    new = np.full(len(shape.points), -1)
    new[nodes] = np.arange(len(nodes))
    return nodes, new


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


def _vectors(forces: Floats, nodes: Integers) -> list[list[float]]:
    """Forces that are not zero on drawn nodes: node and components."""
    return [[int(k), *_short(forces[nodes[k]])] for k in np.flatnonzero(np.any(forces[nodes] != 0, axis=1))]


def _largest(vectors: Floats) -> float:
    return float(np.max(np.linalg.norm(vectors, axis=1), initial=0.0))


def _short(values: Any) -> Any:
    array = np.asarray(values)
    if array.ndim > 1:
        return [_short(row) for row in array]
    # zeros lose their sign and integers their point
    return [int(x) if x == int(x) and abs(x) < 1e15 else float(f"{x:.{_DIGITS}g}") for x in array.tolist()]
