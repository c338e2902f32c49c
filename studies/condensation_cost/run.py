"""What does condensation cost for a body with 200,000 degrees of freedom and 40 contact nodes, and each further load?

Time and memory of the sparse factorization of A and of S = B A^-1 B'. tracemalloc sees numpy's arrays; the factors
show in the peak resident size of the process.

Read ``condense / solve``, which should be near the 81 right-hand sides, and the memory beside that of one dense n x n
matrix. For loads, read ``ratio``: the processor time of searches under several loads, with a problem for each that
is built anew, divided by that with problems that problem.replace makes.
"""

from __future__ import annotations

import resource
import time
import tracemalloc
from typing import TYPE_CHECKING

import numpy as np

import enumsol
from enumsol import gallery

if TYPE_CHECKING:
    from shared.results import Run

CELLS, SMOKE_CELLS = ((40, 40), (80, 80), (160, 160), (320, 312)), ((40, 40),)
CONTACT = 40
LOAD_CELLS, SMOKE_LOAD_CELLS, LOADS = ((40, 40), (80, 80), (160, 160)), ((40, 40),), 10
GIGA = 2.0**30


def peak():
    """Peak resident size of this process in GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / GIGA


def clocked(action):
    """What an action returns, and its wall time."""
    start = time.perf_counter()
    answer = action()
    return answer, time.perf_counter() - start


def row(nx, ny):
    """One body."""
    problem, built = clocked(lambda: gallery.clamped_block(nx, ny, contact=CONTACT))
    before = peak()
    tracemalloc.start()
    condensed, seconds = clocked(lambda: problem.condensed)
    arrays = tracemalloc.get_traced_memory()[1] / GIGA
    tracemalloc.stop()
    _, solve = clocked(lambda: problem.factorization.solve(problem.f))
    roots = enumsol.enumerate_roots(problem, 1.0, "fast")
    return {
        "n": problem.n,
        "p": problem.p,
        "nonzeros of A": problem.A.nnz,
        "build and factorize s": built,
        "condense s": seconds,
        "one solve s": solve,
        "condense / solve": seconds / solve,
        "arrays GB": arrays,
        "vectors of length n": arrays * GIGA / (8 * problem.n),
        "process GB": peak(),
        "of it condensing GB": peak() - before,
        "dense n x n GB": 8.0 * problem.n**2 / GIGA,
        "search s": roots.stats.seconds,
        "roots": len(roots),
        "S is finite": bool(np.all(np.isfinite(condensed.S))),
    }


def sweep(problem, replace, loads):
    """Processor time of a verified search for each of several loads, and the number of roots."""
    start = time.process_time()
    found = [len(enumsol.enumerate_roots(replace(problem, f=factor * problem.f), 1.0)) for factor in loads]
    return time.process_time() - start, sum(found)


def loads_row(nx, ny):
    """One body under several loads."""
    problem, loads = gallery.clamped_block(nx, ny, contact=CONTACT), np.linspace(0.5, 1.5, LOADS)
    anew, roots = sweep(problem, lambda body, f: type(body)(**body.arguments | {"f": f}), loads)
    shared, same = sweep(problem, type(problem).replace, loads)
    return {
        "n": problem.n,
        "p": problem.p,
        "loads": LOADS,
        "built anew s": anew,
        "replaced s": shared,
        "ratio": anew / shared,
        "roots": roots,
        "as many": roots == same,
    }


def main(run: Run) -> None:
    rows = [row(*cells) for cells in (SMOKE_CELLS if run.smoke else CELLS)]
    last = rows[-1]
    run.table(
        "condensation",
        rows,
        f"Conclusion: n = {last['n']}, p = {last['p']}: {last['build and factorize s']:.1f} s to build and factorize, "
        f"{last['condense s']:.1f} s to condense ({last['condense / solve']:.0f} single solves for {2 * CONTACT + 1} "
        f"right-hand sides), arrays of {last['arrays GB']:.2f} GB, process {last['process GB']:.2f} GB, "
        f"where one dense n x n matrix has {last['dense n x n GB']:.0f} GB.",
    )
    rows = [loads_row(*cells) for cells in (SMOKE_LOAD_CELLS if run.smoke else LOAD_CELLS)]
    last = rows[-1]
    run.table(
        "loads",
        rows,
        f"Conclusion: n = {last['n']}, p = {last['p']}: {LOADS} loads take {last['ratio']:.1f} times as much processor "
        "time with a problem built anew for each as with problem.replace.",
    )
