"""Which contact node should a partial assignment be branched on: how far does it pay to look ahead?

The package takes, among the candidates with the largest violation of complementarity, the one whose children close most
of the gap to pruning, where one step of the dual method bounds each child from below. The table compares numbers of
candidates, and two rules that the package does not have (``rules.py``): full lookahead and pseudo-costs. Presolve comes
first in all of them.

Times are process times of the search, the least of some runs, with the condensed problem and its enclosure made before.
Searches are cut at a number of nodes; verified arithmetic is left out where the fast search was cut, and the figure
leaves cut searches out. The two rules that the package does not have choose in Python: their seconds are somewhat too
long, nodes and programs are not.

Read the geometric means in the notes: below 1 a rule is better than taking the largest violation.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from branching_rule.notes import conclusions, draw
from branching_rule.rules import RULES
from shared.clock import least_time
from shared.loads import DRAGGED, PRESSED, block, oblique_wedge, straight_wedge
from shared.searches import search

if TYPE_CHECKING:
    from shared.results import Run

MAX_NODES, SMOKE_NODES = 30_000, 500
#: Searches longer than this are not repeated [seconds].
ENOUGH = 0.3
RUNS = 2
#: p, length, traction and friction of the blocks, from easy to hard.
BLOCKS = (
    (32, 1.0, PRESSED, 1.0),
    (32, 2.0, DRAGGED, 10.0),
    (32, 2.0, PRESSED, 0.3),
    (64, 1.0, PRESSED, 1.0),
    (64, 1.0, DRAGGED, 1.0),
    (64, 2.0, DRAGGED, 1.0),
    (64, 2.0, DRAGGED, 10.0),
    (64, 1.0, PRESSED, 0.3),
    (100, 2.0, PRESSED, 10.0),
    (100, 1.0, DRAGGED, 10.0),
    (100, 1.0, PRESSED, 1.0),
    (100, 2.0, DRAGGED, 1.0),
)
SMOKE_BLOCKS = ((8, 1.0, PRESSED, 1.0), (14, 2.0, DRAGGED, 0.3))


def problems(smoke):
    """Loaded bodies."""
    for p, length, traction, F in SMOKE_BLOCKS if smoke else BLOCKS:
        yield block(p, traction, F, length)
    for p in (8,) if smoke else (14, 32):
        yield straight_wedge(p)
        yield oblique_wedge(p)


def row(loaded, problem, rule, max_nodes):
    """One search by one rule, in fast and in verified arithmetic."""
    engines = []

    def make(system):
        engines.append(RULES[rule](system))
        return engines[-1]

    def timed(arithmetic):
        action = partial(search, alpha=loaded.alpha, make_engine=make, arithmetic=arithmetic, max_nodes=max_nodes)
        return least_time(lambda: problem, action, runs=RUNS, enough=ENOUGH)

    outcome, fast = timed("fast")
    solved = getattr(engines[-1], "solved", outcome.qps)
    cut, verified = outcome.stopped is not None, "-"
    if not cut:
        proven, verified = timed("verified")
        assert len(proven.solutions) == len(outcome.solutions)
    return {
        "problem": loaded.name,
        "F": loaded.alpha,
        "rule": rule,
        "roots": len(outcome.solutions),
        "nodes": outcome.nodes,
        "QPs": solved,
        "fast s": fast,
        "verified s": verified,
        "cut": "yes" if cut else "",
    }


def main(run: Run) -> None:
    max_nodes = SMOKE_NODES if run.smoke else MAX_NODES
    rows = []
    for loaded in problems(run.smoke):
        problem = loaded.build()
        problem.condensed, problem.enclosure  # noqa: B018 (made once, outside the clock)
        found = [row(loaded, problem, rule, max_nodes) for rule in RULES]
        # all rules that finish must find the same number of roots
        assert len({line["roots"] for line in found if not line["cut"]}) <= 1
        rows += found
    run.table("branching", rows, *conclusions(rows, max_nodes))
    run.figure("branching", draw(rows))
