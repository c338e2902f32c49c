"""How much faster than a general solver that counts solutions? The tree against SCIP on wedges with p = 14.

SCIP gets the condensed, scaled problem with one binary for every status of every node, the status's conditions as
indicator constraints (or, second, as big-M rows) and, to its advantage, the bounds on forces and displacements that the
energy implies. It counts the assignments of the binaries that admit a solution; at regular roots these are the roots.

Run: python studies/against_scip.py [gallery names]
"""

from __future__ import annotations

import sys
import time

import numpy as np
from _output import report
from pyscipopt import SCIP_PARAMEMPHASIS, Model, quicksum

import enumsol
from enumsol import gallery

NAMES = ("wedge-14-3", "wedge-14-5")
REPEATS = 5


def bounds(system):
    """Intervals of lambda and w over the ellipsoid e(lambda) <= 0 of theory, section 5."""
    centre = 0.5 * np.linalg.solve(system.S, system.g)
    radius = np.sqrt(system.g @ centre * 0.5)
    reach = radius * np.sqrt(np.diagonal(np.linalg.inv(system.S)))
    middle, size = 0.5 * system.g, radius * np.sqrt(np.diagonal(system.S))
    return (centre - reach, centre + reach), (middle - size, middle + size)


def model_of(system, formulation):
    """The SCIP model; "indicator" constraints, or "big-M" rows with the energy's bounds as their constants."""
    p, S, g, F = system.p, system.S, system.g, system.F
    (low, high), (w_low, w_high) = bounds(system)
    model = Model()
    model.hideOutput()
    n = [model.addVar(f"n{i}", lb=0.0, ub=max(high[i], 0.0)) for i in range(p)]
    t = [model.addVar(f"t{i}", lb=low[p + i], ub=high[p + i]) for i in range(p)]
    wn = [model.addVar(f"wn{i}", lb=min(w_low[i], 0.0), ub=0.0) for i in range(p)]
    wt = [model.addVar(f"wt{i}", lb=w_low[p + i], ub=w_high[p + i]) for i in range(p)]
    forces, moves = n + t, wn + wt
    for r in range(2 * p):
        model.addCons(moves[r] + quicksum(S[r, j] * forces[j] for j in range(2 * p)) == g[r])
    for i in range(p):
        model.addCons(t[i] <= F[i] * n[i])
        model.addCons(-t[i] <= F[i] * n[i])
        status = [model.addVar(f"{name}{i}", vtype="B") for name in ("open", "stick", "plus", "minus")]
        model.addCons(quicksum(status) == 1)
        # each condition once: the cone and the signs above imply the rest
        if formulation == "indicator":
            _indicators(model, status, n[i], t[i], wn[i], wt[i], F[i])
        else:
            free, _, plus, minus = status
            model.addCons(n[i] <= max(high[i], 0.0) * (1 - free))
            model.addCons(-wn[i] <= max(-w_low[i], 0.0) * free)
            model.addCons(wt[i] <= max(w_high[p + i], 0.0) * (free + plus))
            model.addCons(-wt[i] <= max(-w_low[p + i], 0.0) * (free + minus))
            model.addCons(F[i] * n[i] - t[i] <= 2 * F[i] * max(high[i], 0.0) * (1 - plus))
            model.addCons(F[i] * n[i] + t[i] <= 2 * F[i] * max(high[i], 0.0) * (1 - minus))
    return model


def _indicators(model, status, n, t, wn, wt, F):
    free, stick, plus, minus = status
    model.addConsIndicator(n <= 0, binvar=free)
    model.addConsIndicator(-wn <= 0, binvar=free, activeone=False)
    for binary, conditions in (
        (stick, (wt <= 0, -wt <= 0)),
        (plus, (F * n - t <= 0, -wt <= 0)),
        (minus, (F * n + t <= 0, wt <= 0)),
    ):
        for condition in conditions:
            model.addConsIndicator(condition, binvar=binary)


def count(system, formulation):
    """(number of solutions, nodes, seconds) of SCIP's counting."""
    model = model_of(system, formulation)
    model.setEmphasis(SCIP_PARAMEMPHASIS.COUNTER)
    model.setParam("limits/time", 300.0)
    start = time.perf_counter()
    model.count()
    seconds = time.perf_counter() - start
    return int(model.getNCountedSols()), int(model.getNTotalNodes()), seconds


def run(name):
    entry = gallery.get(name)
    problem = entry.build()
    problem.condensed  # noqa: B018 (both sides start from the condensed problem)
    results = [enumsol.enumerate_roots(problem, entry.alpha, "fast") for _ in range(REPEATS)]
    roots, seconds = results[0], float(np.median([r.stats.seconds for r in results]))
    for formulation in ("indicator", "big-M"):
        found, nodes, scip = count(problem.condensed.at(entry.alpha).scaled, formulation)
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
            "ratio": scip / seconds,
        }


def main(*names: str) -> None:
    rows = [row for name in names or NAMES for row in run(name)]
    agree = all(row["roots"] == row["SCIP counts"] for row in rows)
    ratios = {kind: [row["ratio"] for row in rows if row["SCIP with"] == kind] for kind in ("indicator", "big-M")}
    report(
        "against_scip",
        rows,
        f"Conclusion: counts {'agree' if agree else 'DIFFER'}; SCIP with indicator constraints takes "
        f"{min(ratios['indicator']):.0f} to {max(ratios['indicator']):.0f} times as long, with big-M rows made of the "
        f"energy's bounds {min(ratios['big-M']):.0f} to {max(ratios['big-M']):.0f} times.",
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
