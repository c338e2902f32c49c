"""Which QP solver is best for the relaxations of the tree?

The tree is searched once with the package's own dual active-set method. The relaxations, in the order in which they are
met, are then given to the others, so that all see the same sequence: the own method starts from the parent's optimum,
daqp both from scratch and warm (one workspace, only bounds and the active set change), clarabel from scratch.

Read the mean times beside the last columns: a node without solutions is "proven" when the multipliers that come back
give a positive lower bound on the energy, and only then the search may prune it. Needs daqp; without it the table has
the own method and clarabel.
"""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from enumsol.relaxation.engine import PRUNE_MARGIN
from qp_engines.solvers import INSTALLED, SOLVERS, Recording
from shared.loads import DRAGGED, PRESSED, block, oblique_wedge, straight_wedge
from shared.searches import search

if TYPE_CHECKING:
    from shared.results import Run

SIZES, SMOKE_SIZES = (8, 14, 16, 32, 64), (8,)
#: Relaxations of a problem times p: clarabel is slow on large ones.
EFFORT, SMOKE_EFFORT = 4800, 160
FRICTION = (0.3, 1.0, 10.0)
OWN = "own"
ABSENT = "daqp is not installed: it is left out"


def problems(p):
    """Loaded bodies with p contact nodes."""
    for traction in (PRESSED, DRAGGED):
        for F in FRICTION:
            yield block(p, traction, F)
    yield straight_wedge(p)
    yield oblique_wedge(p)


class Tally:
    """Times and verdicts of one solver."""

    def __init__(self):
        self.seconds = []
        self.stalls = self.wrong = self.infeasible = self.proven = 0

    def count(self, answer, *, empty):
        """Add an answer; ``empty``: the own method proved that the node holds no solution."""
        self.seconds.append(answer.seconds)
        self.stalls += not answer.solved and not answer.infeasible
        self.wrong += answer.infeasible and not empty
        self.infeasible += answer.infeasible and empty
        self.proven += empty and answer.proven


def rows_for(p, effort):
    """One row per solver."""
    tallies = defaultdict(Tally)
    empty = 0
    for loaded in problems(p):
        engines = []

        def make(system, engines=engines):
            engines.append(Recording(system))
            return engines[-1]

        problem = loaded.build()
        outcome = search(problem, loaded.alpha, make, max_nodes=effort // p)
        own = tallies[OWN]
        own.stalls += outcome.fallback_qps
        solvers = {name: solver(problem.condensed.at(loaded.alpha).scaled) for name, solver in SOLVERS.items()}
        for met in engines[-1].met:
            empty += met.pruned
            own.seconds.append(met.seconds)
            own.proven += met.pruned and met.bound > PRUNE_MARGIN
            for name, solver in solvers.items():
                tallies[name].count(solver.solve(met.on), empty=met.pruned)
    own_mean = np.mean(tallies[OWN].seconds)
    return [
        {
            "p": p,
            "engine": name,
            "relaxations": len(tally.seconds),
            "mean us": 1e6 * float(np.mean(tally.seconds)),
            "median us": 1e6 * float(np.median(tally.seconds)),
            "against own": float(np.mean(tally.seconds) / own_mean),
            "no answer": tally.stalls,
            "false infeasible": tally.wrong,
            "empty nodes": empty,
            "of them infeasible": tallies["clarabel"].infeasible,
            "proven by multipliers": tally.proven,
        }
        for name, tally in tallies.items()
    ]


def conclusions(rows):
    """All solvers at the largest p."""
    if not INSTALLED:
        yield ABSENT
    p = max(row["p"] for row in rows)
    yield f"Conclusion: at p = {p}, of {rows[-1]['empty nodes']} nodes without solutions: " + "; ".join(
        f"{row['engine']} {row['mean us']:.0f} us a relaxation, {row['no answer']} without an answer, "
        f"{row['proven by multipliers']} proven"
        for row in rows
        if row["p"] == p
    )


def main(run: Run) -> None:
    effort = SMOKE_EFFORT if run.smoke else EFFORT
    rows = [row for p in (SMOKE_SIZES if run.smoke else SIZES) for row in rows_for(p, effort)]
    run.table("qp_engines", rows, *conclusions(rows))
