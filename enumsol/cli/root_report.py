"""A RootSet as text for the terminal and as JSON."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from enumsol.cli.output import plain, taken
from enumsol.support.messages import visible

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.roots.root import Root, RootFamily
    from enumsol.roots.root_set import RootSet, Undecided
    from enumsol.support.array_types import Floats

_STATS = ("nodes", "pruned", "selections", "qps", "fallback_qps", "closed", "seconds", "resumed", "held", "held_open")
_VALUES = ("lambda_n", "lambda_t", "u_n", "u_t")


def roots_as_text(found: RootSet) -> str:
    """The printed RootSet, and before its closing lines nothing else; small ones with a table over contact nodes."""
    rows = (len(found) + sum(len(family.vertices) for family in found.families)) * len(found.node_ids)
    if not 0 < rows <= 24:
        return repr(found)
    from enumsol.roots.root import node_heading  # numpy: not for --help

    width = max(4, *(len(visible(label)) for label in found.node_ids))
    tangents = 2 if len(found) and found[0].lambda_t.ndim == 2 else 1
    # a continuum has forces only
    places = found[0].problem.coordinates if len(found) else None
    lines = [f"{'':>8} {node_heading(width, tangents, places)}"]
    for k, root in enumerate(found):
        lines += _root_rows(f"root {k}", root, found.node_ids, width, places)
    for k, family in enumerate(found.families):
        lines += _family_rows(k, family, found.node_ids, width)
    return "\n".join([*lines, "", repr(found)])


def _root_rows(title: str, root: Root, node_ids: tuple[Any, ...], width: int, places: Floats | None) -> Iterator[str]:
    from enumsol.roots.root import node_line  # as above

    for i, label in enumerate(node_ids):
        yield f"{title if i == 0 else '':>8} {node_line(root, i, label, width, places)}"


def _family_rows(k: int, family: RootFamily, node_ids: tuple[Any, ...], width: int) -> Iterator[str]:
    yield f"family {k}, vertices"
    for j, vertex in enumerate(family.vertices):
        for i, (label, (normal, tangential)) in enumerate(zip(node_ids, vertex, strict=True)):
            numbers = f"{normal + 0.0:>12.6g} {tangential + 0.0:>12.6g}"
            yield f"{j if i == 0 else '':>8} {visible(label):>{width}} {'':<7} {numbers}"


def uniqueness(found: RootSet) -> str:
    """Line that says whether there is one solution."""
    if found.unique is None:
        why = "fast arithmetic proves nothing" if found.arithmetic == "fast" else found.closing_line
        return f"unique: not known ({why})"
    if found.unique:
        bound = found.rigid_bound
        within = f", {bound.words()}" if bound is not None and bound.needed else ""
        return (
            f"unique: yes ({'proven by one certificate' if found.by_one_certificate else 'proven by a search'}{within})"
        )
    what = "a continuum of solutions" if found.families else "two solutions"
    return f"unique: no ({what}, proven; --unique looks for no more)"


def roots_as_json(found: RootSet, problem: str) -> str:
    """The whole result; numbers read back as the same float64, what is not finite is null."""
    bound = found.rigid_bound
    content = {
        "problem": problem,
        "alpha": float(found.alpha),
        "alpha_text": str(found.alpha),
        **taken(found, "arithmetic", "method", "complete"),
        "certified_data": found.certified_data if found.complete else None,
        "completeness": found.closing_line,
        **taken(found, "unique", "by_one_certificate", "stopped", "notes", "index_sum"),
        **({} if bound is None else {"max_rigid_displacement": bound.largest, "bound_needed": bound.needed}),
        "node_ids": found.node_ids,
        "roots": [_root(root) for root in found],
        "families": [_family(family) for family in found.families],
        "undecided": [_undecided(item) for item in found.undecided],
        "stats": taken(found.stats, *_STATS),
    }
    return "{\n" + ",\n".join(f"{json.dumps(key)}: {_lines(value)}" for key, value in plain(content).items()) + "\n}"


def _lines(value: object) -> str:
    """JSON with one line per entry of a list of objects."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(json.dumps(item) for item in value) + "\n]"
    return json.dumps(value, default=str)


def _root(root: Root) -> dict[str, Any]:
    if root.lambda_t.ndim == 2:
        more = {"slip_angle": _angles(root.slip_angle)}
        more |= {} if root.rigid_coordinates is not None else taken(root, "dlambda_dalpha")
    elif root.rigid_coordinates is not None:
        more = taken(root, "rigid_coordinates", "rigid_displacement")
    else:
        more = taken(root, "condition", "dlambda_dalpha")
    return {
        **taken(root, "statuses", "active", *_VALUES),
        "enclosure": None if root.enclosure is None else taken(root.enclosure, *_VALUES),
        **taken(root, "index", "regular", "margin"),
        **more,
    }


def _undecided(item: Undecided) -> dict[str, Any]:
    content = taken(item, "statuses", "reason", "hint")
    if item.slip_angle is None:
        return content
    bounds = None if item.bounds is None else taken(item.bounds, *_VALUES)
    return {**content, "leaves": item.leaves, "slip_angle": _angles(item.slip_angle), "bounds": bounds}


def _angles(angles: Floats | None) -> list[list[float] | None]:
    return [] if angles is None else [None if math.isnan(low) else [low, high] for low, high in angles.tolist()]


def _family(family: RootFamily) -> dict[str, Any]:
    parts = [
        taken(part, "statuses", "dimension", "vertices")
        | ({} if part.rigid_coordinates is None else taken(part, "rigid_coordinates"))
        for part in family.polytopes
    ]
    return {**taken(family, "index", "dimension", "vertices_proven"), "polytopes": parts}
