"""What does a proof cost, and what does checking it?

Verified against fast and exact arithmetic, and the checker against the search, on blocks and wedges of the gallery.
Every figure is the least of some runs on a fresh problem, by process time: making the condensed problem, its enclosure
and the proof is inside the clock, factorizing A is not. Exact arithmetic is tried where the body has few enough degrees
of freedom, and given up after a minute. The wedge at p = 64 is left out: its tree takes tens of minutes.

Read ``verified / fast``: what certainty costs; and ``check / verified``: what it costs to check the proof.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import enumsol
from shared.clock import least_time, timed
from shared.loads import PRESSED, block, oblique_wedge, straight_wedge
from shared.results import yes

if TYPE_CHECKING:
    from shared.results import Run

EXACT_SECONDS = 60.0
#: Searches longer than this are not repeated.
ENOUGH = 2.0
RUNS = 5
#: A safeguard; no search here comes that far.
MAX_NODES = 30_000
#: Drags the block towards its clamp, which makes the search longer.
TOWARDS_CLAMP = (-0.3, -1.0)


def problems(smoke):
    """Loaded bodies."""
    for p in (8,) if smoke else (14, 32, 64):
        yield block(p, PRESSED, 3.0)
        yield block(p, TOWARDS_CLAMP, 3.0)
        if p < 64:
            yield straight_wedge(p)
            yield oblique_wedge(p)


def exact_seconds(problem, alpha, expected):
    """Process time of exact arithmetic, None where it is refused or too slow."""
    try:
        roots, seconds = timed(partial(enumsol.enumerate_roots, problem, alpha, "exact", time_limit=EXACT_SECONDS))
    except enumsol.TooLargeError:
        return None
    if not roots.complete:
        return None
    assert len(roots) == expected
    return seconds


def row(loaded, runs):
    """One problem."""
    build, alpha = loaded.build, loaded.alpha
    least = partial(least_time, build, runs=runs, enough=ENOUGH)
    found, fast = least(lambda problem: enumsol.enumerate_roots(problem, alpha, "fast", max_nodes=MAX_NODES))
    roots, verified = least(lambda problem: enumsol.enumerate_roots(problem, alpha, max_nodes=MAX_NODES))
    verdict, check = least(lambda problem: enumsol.verify(problem, roots.proof))
    assert verdict.ok
    assert len(found) == len(roots)
    problem = build()
    exact = exact_seconds(problem, alpha, len(roots))
    counts = roots.stats.escalations
    return {
        "problem": loaded.name,
        "p": problem.p,
        "n": problem.n,
        "roots": len(roots),
        "nodes": roots.stats.nodes,
        "complete": yes(roots.complete and verdict.complete),
        "fast s": fast,
        "verified s": verified,
        "exact s": "-" if exact is None else exact,
        "verified / fast": verified / fast,
        "check s": check,
        "check / verified": check / verified,
        "proof kB": roots.proof.size / 1000,
        "by balls": counts.balls,
        "by rationals": counts.rationals,
        "refined": counts.refined,
        "undecided": counts.undecided,
    }


def main(run: Run) -> None:
    rows = [row(loaded, 1 if run.smoke else RUNS) for loaded in problems(run.smoke)]
    worst = max(row["verified / fast"] for row in rows if row["p"] <= 32)
    slowest = max(row["check / verified"] for row in rows)
    run.table(
        "certification_cost",
        rows,
        f"verified over fast for p <= 32: at most {worst:.2f}",
        f"check over search: at most {slowest:.2f}",
    )
