"""How much faster is the tree than a general solver that counts solutions?

Wedges with p = 14 against SCIP. It gets the condensed, scaled problem with one binary for every status of every node,
the conditions of the status as indicator constraints (or, second, as big-M rows) and, to its advantage, the bounds on
forces and displacements that the energy implies. It counts the assignments of the binaries that admit a solution; at
regular roots these are the roots.

Read ``ratio``: SCIP's wall time over the tree's. ``roots`` and ``SCIP counts`` must agree. Needs pyscipopt; without it
SCIP's columns are empty.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

import enumsol
from enumsol import gallery

if TYPE_CHECKING:
    from shared.results import Run

NAMES, SMOKE_NAMES = ("wedge-14-3", "wedge-14-5"), ("wedge-8-3",)
FORMULATIONS = ("indicator", "big-M")
REPEATS = 5
INSTALLED = find_spec("pyscipopt") is not None
ABSENT = "pyscipopt is not installed: SCIP is left out"


def run_problem(name):
    """One row per formulation."""
    entry = gallery.get(name)
    problem = entry.build()
    system = problem.condensed.at(entry.alpha).scaled  # both sides start from the condensed problem
    results = [enumsol.enumerate_roots(problem, entry.alpha, "fast") for _ in range(REPEATS)]
    roots, seconds = results[0], float(np.median([result.stats.seconds for result in results]))
    for formulation in FORMULATIONS:
        found, nodes, scip = counted(system, formulation)
        yield {
            "problem": name,
            "alpha": entry.alpha,
            "SCIP with": formulation,
            "roots": len(roots),
            "SCIP counts": found,
            "nodes": roots.stats.nodes,
            "SCIP nodes": nodes,
            "seconds": seconds,
            "SCIP seconds": scip,
            "ratio": scip / seconds if INSTALLED else "-",
        }


def counted(system, formulation):
    """SCIP's count, nodes and seconds; dashes without SCIP."""
    if not INSTALLED:
        return "-", "-", "-"
    from against_scip.model import count

    return count(system, formulation)


def conclusion(rows):
    """Whether the counts agree, and the range of the ratios."""
    if not INSTALLED:
        return ABSENT
    agree = all(row["roots"] == row["SCIP counts"] for row in rows)
    ratios = {kind: [row["ratio"] for row in rows if row["SCIP with"] == kind] for kind in FORMULATIONS}
    return (
        f"Conclusion: counts {'agree' if agree else 'DIFFER'}; SCIP with indicator constraints takes "
        f"{min(ratios['indicator']):.0f} to {max(ratios['indicator']):.0f} times as long, with big-M rows made of the "
        f"energy's bounds {min(ratios['big-M']):.0f} to {max(ratios['big-M']):.0f} times."
    )


def main(run: Run) -> None:
    rows = [row for name in (SMOKE_NAMES if run.smoke else NAMES) for row in run_problem(name)]
    run.table("against_scip", rows, conclusion(rows))
