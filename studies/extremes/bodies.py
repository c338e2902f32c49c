"""Bodies with up to 500,000 degrees of freedom, each judged in a process of its own, for its own peak memory."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

from enumsol import enumerate_roots, gallery, verify
from extremes.judge import Finding, guarded, row

#: Cells along both sides; every tenth part of the bottom carries a contact node.
BODIES, SMOKE_BODIES = (40, 160, 500), (20,)
CONTACT = 10
STUDIES = Path(__file__).parents[1]


def bodies(sizes: tuple[int, ...]) -> list[dict[str, Any]]:
    """Rows of the large bodies."""
    rows = []
    for cells in sizes:
        command = [sys.executable, str(STUDIES), "extremes", "--body", str(cells)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            finding = Finding()
            finding.wrong(f"the process failed: {done.stderr.strip().splitlines()[-1:]}")
            rows.append(row("body", name_of(cells), "closed form", finding, 0.0))
        else:
            rows.append(json.loads(done.stdout))
    return rows


def name_of(cells: int) -> str:
    return f"{cells} x {cells} cells"


def body(cells: int) -> dict[str, Any]:
    """One large body; the reason holds the seconds of every stage and the peak memory."""
    stages = [("", time.process_time())]
    finding = guarded(lambda: judged(cells, lambda name: stages.append((name, time.process_time()))))
    parts = [f"{name} {at - before:.1f} s" for (_, before), (name, at) in pairwise(stages)]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2.0**20
    finding.reasons.append(", ".join(parts) + f", peak {peak:.2f} GB")
    return row("body", name_of(cells), "closed form", finding, time.process_time() - stages[0][1])


def judged(cells: int, lap: Any) -> Finding:
    """What came of the body; ``lap`` is told when a stage is over."""
    problem = gallery.clamped_block(cells, cells, contact=CONTACT)
    lap("build")
    finding = Finding(p=problem.p, n=problem.n)
    fast = enumerate_roots(problem, 1.0, "fast")
    lap("fast")
    roots = enumerate_roots(problem, 1.0)
    lap("verified")
    checked = verify(problem, roots.proof)
    lap("check")
    finding.roots = len(roots)
    finding.fast = "same" if [r.statuses for r in fast] == [r.statuses for r in roots] else f"off: {len(fast)}"
    for item in roots.undecided:
        finding.undecided(item.reason)
    if not checked.ok or checked.complete != roots.complete:
        finding.wrong("the checker refuses the proof")
    if roots.complete and len(roots) != 1:
        finding.wrong(f"{len(roots)} roots, known: 1")
    finding.reasons.append(f"certified: {roots.certified_data}")
    return finding
