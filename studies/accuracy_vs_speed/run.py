"""What does accuracy cost, and what does speed lose: which arithmetic and tolerance for which problem?

Fast, verified and exact arithmetic, tolerances of fast arithmetic from 1e-4 to 1e-15, and condensation in float32, on
problems at every distance from a degeneracy down to 1e-16, and exactly on one (``problems.py``). Each answer is
compared with that of exact arithmetic (``matching.py``), which is itself compared with all 4^p selections and with
branch graphs.

Read ``accuracy_vs_speed``, one row per setting: ``right from`` is the least distance from which on no answer is wrong,
``time ratio`` the process time relative to fast arithmetic on the same problem. ``accuracy_enumeration`` has one row
per setting and distance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from accuracy_vs_speed.figure import draw
from accuracy_vs_speed.notes import conclusions, overview
from accuracy_vs_speed.problems import cases
from accuracy_vs_speed.settings import checks, measure, table

if TYPE_CHECKING:
    from shared.results import Run


def main(run: Run) -> None:
    tried = list(cases(smoke=run.smoke))
    measured = measure(tried)
    rows, lines = table(measured), overview(measured)
    run.table("accuracy_enumeration", rows)
    run.table("accuracy_vs_speed", lines, *conclusions(rows, measured, checks(tried)))
    run.figure("accuracy_enumeration", draw(rows, lines))
