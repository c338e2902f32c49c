"""How large is the search for all solutions in 3D, and what does its proof cost?

Verified searches of blocks with orthotropic friction F1 = F, F2 = 0.6 F, pressed and sheared, with the proof and its
check; one process, one problem after the other. A search is cut at a number of nodes (column "complete" is False then).

Read ``nodes`` against ``slip``, the slipping nodes of the solution: every one of them has a direction to be found. The
column ``leaves`` counts the leaves that were tested by Krawczyk's operator, ``check s`` is the checker's time.

``wedges`` are held by weak springs, which all their contact nodes together hardly feel: they have several solutions,
and S has eigenvalues far apart. ``feet`` are meshes of gmsh on weak springs (``feet.py``), with one solution each;
``spring`` is the stiffness of all springs by E h, with the body's height h.

``degenerate`` are problems with three nodes whose search is long all the same: with small integers conditions hold with
equality, and one region (``largest region``) may take hundreds of leaves; with much friction many selections come near
to holding. They are kept to see what a change does to them. ``known_solutions`` are small problems with a known
solution whose first node just sticks ("limit"), touches without load and slides ("graze"), or is at rest without load
("rest").
"""

from __future__ import annotations

from itertools import product
from time import process_time
from typing import TYPE_CHECKING

import enumsol
from search_in_3d.degenerate import (
    CASES,
    KINDS,
    MAX_NODES as MOST_DEGENERATE,
    SMOKE_NODES,
    known_row,
    row as degenerate_row,
)
from search_in_3d.feet import FRICTION as FEET_FRICTION, NAMES as FEET, SPRINGS, foot

if TYPE_CHECKING:
    from shared.results import Run

#: Cells of the blocks, which have 4, 9, 12, 16 and 25 contact nodes.
BLOCKS, SMOKE_BLOCKS = ((2, 1, 2), (3, 2, 2), (4, 2, 2), (4, 3, 2), (5, 4, 2)), ((2, 1, 2),)
FRICTION = (0.3, 0.5, 1.0, 3.0, 5.0)
MAX_NODES, MOST_WEDGES, MOST_FEET, MOST_KNOWN = 20_000, 100_000, 10_000, 200
#: Cells of the wedges, which have 8 and 12 contact nodes with multipliers at the nodes.
WEDGES = (1, 1, 2), (2, 1, 2), (2, 2, 2)
WEDGE_FRICTION = (1.0, 2.0, 3.0)


def row(problem, F, **limits):
    """One search and the check of its proof."""
    started = process_time()
    problem.enclosure  # noqa: B018 (made once, and timed apart)
    enclosed = process_time()
    roots = enumsol.enumerate_roots(problem, F, **limits)
    searched = process_time()
    report = enumsol.verify(problem, roots.proof)
    checked = process_time()
    return {
        "p": problem.p,
        "F": F,
        "roots": len(roots),
        "complete": roots.complete,
        "index sum": roots.index_sum,
        "accepted": report.ok,
        "slip": sum(status is enumsol.ContactStatus.SLIP for root in roots for status in root.statuses),
        "nodes": roots.stats.nodes,
        "leaves": roots.stats.selections,
        "enclosure s": enclosed - started,
        "search s": searched - enclosed,
        "check s": checked - searched,
        "proof kB": roots.proof.size / 1000,
    }


def main(run: Run) -> None:
    blocks = [enumsol.gallery.block3d(*cells) for cells in (SMOKE_BLOCKS if run.smoke else BLOCKS)]
    rows = [row(block, F, max_nodes=MAX_NODES) for block in blocks for F in FRICTION]
    cut = [f"p = {r['p']}, F = {r['F']}" for r in rows if not r["complete"]]
    hardest = max((r for r in rows if r["complete"]), key=lambda r: r["nodes"])
    run.table(
        "search_in_3d",
        rows,
        f"cut at {MAX_NODES} nodes: {', '.join(cut) or 'none'}",
        f"most nodes of those that ended: {hardest['nodes']} at p = {hardest['p']}, F = {hardest['F']}, "
        f"{hardest['search s']:.1f} s, its proof checked in {hardest['check s']:.1f} s",
        f"every proof accepted: {all(r['accepted'] for r in rows)}",
    )
    wedges(run)
    feet(run)
    degenerate(run)


def wedges(run: Run) -> None:
    """The table of wedges on weak springs."""
    rows, most = [], SMOKE_NODES if run.smoke else MOST_WEDGES
    for cells in WEDGES:
        for F in WEDGE_FRICTION:
            problem = enumsol.gallery.wedge3d(*cells, friction=F, multipliers="nodes")
            rows.append({"wedge": "x".join(map(str, cells)), **row(problem, 0, max_nodes=most), "F": F})
    run.table("wedges", rows, f"every proof accepted: {all(r['accepted'] for r in rows)}")


def feet(run: Run) -> None:
    """The table of bodies on weak springs."""
    most = SMOKE_NODES if run.smoke else MOST_FEET
    cases = product(FEET[:1] if run.smoke else FEET, SPRINGS, FEET_FRICTION)
    rows = [
        {"body": name, "spring": spring, **row(foot(name, spring, F), 0, max_nodes=most), "F": F}
        for name, spring, F in cases
    ]
    cut = [f"{r['body']}, {r['spring']:g} E h, F = {r['F']:g}" for r in rows if not r["complete"]]
    run.table(
        "feet",
        rows,
        f"cut at {most} nodes: {'; '.join(cut) or 'none'}",
        f"every proof accepted: {all(r['accepted'] for r in rows)}",
    )


def degenerate(run: Run) -> None:
    """The table of degenerate problems."""
    most = SMOKE_NODES if run.smoke else MOST_DEGENERATE
    rows = [degenerate_row(*case, most) for case in CASES]
    cut = [r["case"] for r in rows if not r["ended"]]
    run.table("degenerate", rows, f"cut at {most} nodes: {', '.join(cut) or 'none'}")
    sizes, count = ((1,), 2) if run.smoke else ((1, 2, 3), 12)
    rows = [known_row(kind, p, count, SMOKE_NODES if run.smoke else MOST_KNOWN) for kind in KINDS for p in sizes]
    told = [f"{sum(r['complete'] for r in rows if r['first node'] == kind)} of {count * len(sizes)}" for kind in KINDS]
    run.table(
        "known_solutions",
        rows,
        *(f"complete where the first node is in the state {kind!r}: {n}" for kind, n in zip(KINDS, told, strict=True)),
    )
