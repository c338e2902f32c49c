"""How large is the search over an interval of alpha, and what may a subinterval cost before its halves take over?

The verified search of ``branch_graph`` alone, without arcs, on one core. A partial assignment that is empty at the
middle of a piece and not proven empty over the whole of it is tried for some more nodes ("at once"), then left to the
halves; what was left is tried again at the end of the piece ("at the end"). A tree of the largest size hands the rest
of it to further trees, which workers can share. The first row of a problem has the values in use.

Read ``nodes`` (relaxations over pieces and at their middles) and ``leaves`` (the size of the proof) against ``handed``,
the surviving selections, once for every piece (subinterval): an arc of each is worked out afterwards, and
``selections`` of them differ. Without a second look at the end, the pieces around an event would be cut endlessly.
"""

from __future__ import annotations

from fractions import Fraction
from time import process_time
from typing import TYPE_CHECKING

import enumsol
from enumsol.condensation.exact import ExactCondensed
from enumsol.search import interval_tree, subintervals as interval
from enumsol.search.certifiers.interval_certifiers import VerifiedIntervalCertifier

if TYPE_CHECKING:
    from shared.results import Run

NOW = (interval_tree.TRIED_AT_ONCE, interval_tree.TRIED_AT_THE_END, interval.LARGEST_TREE)
#: Nodes tried at once and at the end, largest tree.
RULES = (NOW, (0, 128, 4096), (8, 128, 4096), (32, 128, 4096), (2, 32, 4096), (2, 1024, 4096), (2, 128, 512))
MAX_NODES = 60_000


def loaded_wedge():
    """A wedge over its load; 128 selections hold at one alpha, where seven nodes lift off."""
    wedge = enumsol.gallery.wedge(4, 7, (4e-4, 1e-3))
    return enumsol.ContactProblem(
        wedge.A, wedge.Bn, wedge.Bt, 0 * wedge.f, gap=wedge.gap, friction=2.2, load_slope=wedge.f
    )


PROBLEMS = {
    "wedge-14-5 over friction": (lambda: enumsol.gallery.get("wedge-14-5").build(), (0, 5)),
    "wedge, p = 14, over load": (loaded_wedge, (0, 1)),
    "wedge-20-5 over friction": (lambda: enumsol.gallery.get("wedge-20-5").build(), (0, 5)),
    "block, p = 16": (lambda: enumsol.gallery.clamped_block(16, 8), (0.1, 3)),
    "block, p = 32": (lambda: enumsol.gallery.clamped_block(32, 16), (0.1, 3)),
}
SMOKE_PROBLEMS = {"wedge-8-5 over friction": (lambda: enumsol.gallery.get("wedge-8-5").build(), (0, 5))}


def row(name, build, ends, rule):
    """One search."""
    interval_tree.TRIED_AT_ONCE, interval_tree.TRIED_AT_THE_END, interval.LARGEST_TREE = rule
    problem = build()
    exact = ExactCondensed.from_condensed(problem)
    search = interval.IntervalSearch(
        problem.condensed,
        (Fraction(ends[0]), Fraction(ends[1])),
        exact.zero,
        VerifiedIntervalCertifier(problem, exact),
        max_nodes=MAX_NODES,
    )
    started = process_time()
    search.run()
    return {
        "problem": name,
        "at once": rule[0],
        "at the end": rule[1],
        "largest": rule[2],
        "nodes": search.nodes,
        "pieces": len(search.pieces),
        "leaves": sum(len(part.empty) for part in search.pieces),
        "selections": len(search.selections),
        "handed": sum(len(part.selections) for part in search.pieces),
        "finished": search.stopped is None,
        "s": process_time() - started,
    }


def main(run: Run) -> None:
    problems = SMOKE_PROBLEMS if run.smoke else PROBLEMS
    try:
        rows = [row(name, *problem, rule) for name, problem in problems.items() for rule in RULES]
    finally:
        interval_tree.TRIED_AT_ONCE, interval_tree.TRIED_AT_THE_END, interval.LARGEST_TREE = NOW
    now = [r for r in rows if (r["at once"], r["at the end"], r["largest"]) == NOW]
    run.table(
        "interval_search",
        rows,
        *(
            f"{r['problem']}: {r['nodes']} nodes, {r['leaves']} leaves, {r['handed']} selections handed on in "
            f"{r['pieces']} pieces, {r['s']:.2f} s"
            for r in now
        ),
    )
