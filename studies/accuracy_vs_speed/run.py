"""What does accuracy cost, and what does speed lose? Three parts, each against exact answers.

1. Enumeration: fast, verified and exact arithmetic, the tolerance of fast arithmetic, and condensation in float32, on
   problems at every distance from a degeneracy (_trade_problems, _trade_matching, _trade_enumeration).
2. Sampled against exact branch graphs (_trade_sampling).
3. Continuation: step length and tolerance (_trade_continuation).

Times are process times, given as ratios. Tables and figures are results/accuracy_enumeration, accuracy_sampling and
accuracy_continuation; results/accuracy_vs_speed has a summary by setting and all conclusions. It takes about seven
minutes.

Run: python studies/accuracy_vs_speed.py [enumeration | sampling | continuation]
"""

from __future__ import annotations

import sys

import _trade_continuation
import _trade_enumeration
import _trade_sampling
from _output import report
from _trade_enumeration_report import conclusions, draw, overview


def enumeration():
    cases = list(_trade_enumeration.cases())
    measured = _trade_enumeration.measure(cases)
    rows = _trade_enumeration.table(measured)
    notes = list(conclusions(rows, measured, _trade_enumeration.checks(cases)))
    report("accuracy_enumeration", rows, *notes)
    draw(rows, measured)
    return overview(measured), notes


def sampling():
    problems = _trade_sampling.sampled_paths()
    rows = _trade_sampling.table(problems)
    notes = list(_trade_sampling.conclusions(rows, problems))
    report("accuracy_sampling", rows, *notes)
    _trade_sampling.draw(rows)
    return notes


def continuation():
    rows = _trade_continuation.table()
    notes = list(_trade_continuation.conclusions(rows))
    report("accuracy_continuation", rows, *notes)
    _trade_continuation.draw(rows)
    return notes


def main():
    part = sys.argv[1] if len(sys.argv) > 1 else "all"
    if part == "sampling":
        sampling()
    elif part == "continuation":
        continuation()
    elif part in {"all", "enumeration"}:
        rows, notes = enumeration()
        if part == "all":
            report("accuracy_vs_speed", rows, *notes, *sampling(), *continuation())
    else:
        sys.exit(f"part is {part!r}; expected enumeration, sampling or continuation, or nothing for all of them")


if __name__ == "__main__":
    main()
