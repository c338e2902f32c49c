"""How large are the problems whose branch graphs are proven for the matrices as given, and what does it cost?

Verified graphs with their proofs, which hold the arcs, and the check of these proofs; every case in a process of its
own, and the shortest times of some rounds. Columns ``search s``, ``arcs s``, ``proof s`` and ``check s`` are the search
over the interval, the arcs in ball arithmetic with the vertices, writing the proof, and the checker; ``exact arcs s``
is what arcs took as exact functions of alpha, of S and g as computed, in the same process: the way of graphs of more
than 24 degrees of freedom before there were balls (left out where it takes minutes). With ``--against`` an older
version takes turns with this one; its times are in columns that end with ``before``.

Seconds are those of one processor. Read ``whole``: the checker found that every solution for every alpha of the
interval lies on the arcs, for the problem's own matrices. ``width`` is the largest of the bounds of critical alphas,
relative to alpha.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

from proven_graphs.cases import cases
from shared.versions import before, interpreters, new_process, version_options

if TYPE_CHECKING:
    from shared.results import Run

#: What is measured in all rounds, and what the older version is compared by.
SECONDS = ("search s", "arcs s", "proof s", "check s", "exact arcs s")
COMPARED = ("search s", "arcs s", "check s")
CHILD = str(Path(__file__).with_name("cases.py"))


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--large", action="store_true", help="also p = 32 and 64, and n = 8704 (ten minutes a round)")
    version_options(parser, rounds=3)


def measure(rounds, pythons, names):
    """By interpreter and case what it did, with the shortest times."""
    seen = [{name: [] for name in names} for _ in pythons]
    for k in range(rounds):
        for name in names:
            for j, python in enumerate(pythons):
                exactly = ["exactly"] if j == k == 0 else []
                seen[j][name].append(json.loads(new_process(python, CHILD, name, *exactly)[1]))
    return [{name: shortest(runs) for name, runs in cases.items()} for cases in seen]


def shortest(runs):
    """The first run with the shortest times of all."""
    least = {key: min((run[key] for run in runs if not math.isnan(run[key])), default=math.nan) for key in SECONDS}
    return {**runs[0], **least}


def main(run: Run) -> None:
    given = run.options
    names = [name for name, *_ in cases(smoke=run.smoke, large=given.large)]
    now, *old = measure(given.rounds, interpreters(given), names)
    measured = {"cases": old[0]} if old else None
    earlier = before(run.path("proven_graphs.before.json"), given.label, measured) or {"label": "", "cases": {}}
    rows = [
        {"case": name}
        | now[name]
        | {f"{key} before": earlier["cases"].get(name, {}).get(key, math.nan) for key in COMPARED}
        for name in names
    ]
    compared = [r for r in rows if not math.isnan(r["arcs s before"])]
    run.table(
        "proven_graphs",
        rows,
        f"complete: {sum(r['complete'] for r in rows)} of {len(rows)}; whole: {sum(r['whole'] for r in rows)}",
        "check / make: " + ratios(rows, "check s", "search s", "arcs s", "proof s"),
        "arcs as exact functions / in balls: " + ratios(rows, "exact arcs s", "arcs s"),
        *([f"before: {earlier['label']}"] if compared else []),
        *(f"{key} before / now: {ratios(compared, f'{key} before', key)}" for key in COMPARED if compared),
    )


def ratios(rows, above, *below):
    """Quotients of columns, where they are known."""
    found = [r[above] / sum(r[key] for key in below) for r in rows]
    return ", ".join(f"{x:.2f}" for x in found if not math.isnan(x))
