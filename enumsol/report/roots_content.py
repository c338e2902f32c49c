"""What the page of a RootSet shows, as plain values that JSON can hold; the page's script draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.model.shapes import body_shape
from enumsol.report.body import bare_nodes, drawn_body, most_fields, short_list, surface_stresses, vectors
from enumsol.report.parts import STATUS_NAMES, status_codes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.fem import Scene
    from enumsol.roots.root import Root
    from enumsol.roots.root_set import RootSet

#: Most numbers of forces and displacements of contact nodes in tables, about ten characters each.
_MOST_VALUES = 150_000


def roots_content(found: RootSet, scene: Scene | None = None) -> dict[str, Any]:
    """Everything that the script needs: nodes, roots with their values, and the bodies that are drawn.

    Statuses are texts of one digit per node, places in ``statuses``. ``f`` and ``w`` are forces and displacements of
    the contact nodes: all normal ones, then those along each tangent.
    """
    p = len(found.node_ids)
    listed = found[: max(1, _MOST_VALUES // (8 * p))]
    pictures, bodies = _pictures(listed, scene) if listed else (_picture(None, ""), [])
    bodies += [{}] * (len(listed) - len(bodies))
    return {
        "nodes": [str(label) for label in found.node_ids],
        "statuses": STATUS_NAMES,
        "tangents": listed[0].lambda_t[:1].size if listed else 1,
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
        "statuses": status_codes(root.statuses),
        "several": [i for i, holds in enumerate(root.active) if len(holds) > 1],
        "f": short_list(np.concatenate([root.lambda_n, root.lambda_t.ravel(order="F")])),
        "w": short_list(np.concatenate([root.u_n, root.u_t.ravel(order="F")])),
        "angles": None
        if root.slip_angle is None
        else [None if np.isnan(pair[0]) else short_list(pair) for pair in root.slip_angle],
    }


def _pictures(roots: Sequence[Root], scene: Scene | None) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The body, or why there is none, and what moves it and acts on it by root; of many roots the first."""
    problem = roots[0].problem
    if problem.mesh is None:
        body, why = bare_nodes(problem)
        still = [] if body is None else [{"u": [0] * (3 * problem.p), "forces": []}] * len(roots)
        return _picture(body, why), still
    shape = body_shape(problem)
    body, nodes = drawn_body(problem, shape, len(roots) + 1, scene)
    count = most_fields(*shape.points[nodes].shape) - 1
    if count < 1:
        return _picture(None, f"The mesh is too large to draw: its boundary alone has {len(nodes):,} nodes"), []
    stresses = surface_stresses(problem, shape, min(count, len(roots)))
    bodies = [
        {
            "u": short_list(shape.moves(root)[nodes].ravel()),
            "forces": vectors(shape.contact_forces(problem, root.lambda_n, root.lambda_t), nodes),
            **({} if stresses is None else {"s": short_list(stresses(root.u))}),
        }
        for root in roots[:count]
    ]
    some = f"The bodies of the first {count} roots are drawn: the page holds no more"
    return _picture(body, some if count < len(roots) else ""), bodies


def _picture(body: dict[str, Any] | None, why: str) -> dict[str, Any]:
    return {"body": body, "no_body": why}
