"""What does condensation cost? A body with 200,000 degrees of freedom and 40 contact nodes.

Time and memory of the sparse factorization and of S = B A^-1 B'. numpy's arrays are seen by tracemalloc, SuperLU's
factors by the peak resident size of the process. A dense n x n matrix would show at once: it has 320 GB.

Run: python studies/condensation.py
"""

from __future__ import annotations

import resource
import time
import tracemalloc

import numpy as np
from _output import report

import enumsol
from enumsol import gallery

CELLS = ((40, 40), (80, 80), (160, 160), (320, 312))
CONTACT = 40
GIGA = 2.0**30


def peak() -> float:
    """Peak resident size of this process in GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / GIGA


def run(nx, ny):
    start = time.perf_counter()
    problem = gallery.clamped_block(nx, ny, contact=CONTACT)
    built = time.perf_counter() - start
    before = peak()
    tracemalloc.start()
    start = time.perf_counter()
    condensed = problem.condensed
    seconds = time.perf_counter() - start
    arrays = tracemalloc.get_traced_memory()[1] / GIGA
    tracemalloc.stop()
    start = time.perf_counter()
    problem.factorization.solve(problem.f)
    solve = time.perf_counter() - start
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


def main() -> None:
    rows = [run(*cells) for cells in CELLS]
    last = rows[-1]
    report(
        "condensation",
        rows,
        f"Conclusion: n = {last['n']}, p = {last['p']}: {last['build and factorize s']:.1f} s to build and factorize, "
        f"{last['condense s']:.1f} s to condense ({last['condense / solve']:.0f} single solves for {2 * CONTACT + 1} "
        f"right-hand sides), arrays of {last['arrays GB']:.2f} GB, process {last['process GB']:.2f} GB, "
        f"where one dense n x n matrix has {last['dense n x n GB']:.0f} GB.",
    )


if __name__ == "__main__":
    main()
