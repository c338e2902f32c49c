"""The condensed problem as a mixed-integer model for SCIP, and SCIP's count of its solutions."""

from __future__ import annotations

import time

import numpy as np
from pyscipopt import SCIP_PARAMEMPHASIS, Model, quicksum

TIME_LIMIT = 300.0


def bounds(system):
    """Intervals of lambda and w over the ellipsoid e(lambda) <= 0 of theory, (5.3)."""
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
            indicators(model, status, n[i], t[i], wn[i], wt[i], F[i])
        else:
            free, _, plus, minus = status
            model.addCons(n[i] <= max(high[i], 0.0) * (1 - free))
            model.addCons(-wn[i] <= max(-w_low[i], 0.0) * free)
            model.addCons(wt[i] <= max(w_high[p + i], 0.0) * (free + plus))
            model.addCons(-wt[i] <= max(-w_low[p + i], 0.0) * (free + minus))
            model.addCons(F[i] * n[i] - t[i] <= 2 * F[i] * max(high[i], 0.0) * (1 - plus))
            model.addCons(F[i] * n[i] + t[i] <= 2 * F[i] * max(high[i], 0.0) * (1 - minus))
    return model


def indicators(model, status, n, t, wn, wt, F):
    """The conditions of every status of one contact node as indicator constraints."""
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
    """Solutions, nodes and wall seconds of SCIP's counting."""
    model = model_of(system, formulation)
    model.setEmphasis(SCIP_PARAMEMPHASIS.COUNTER)
    model.setParam("limits/time", TIME_LIMIT)
    start = time.perf_counter()
    model.count()
    seconds = time.perf_counter() - start
    return int(model.getNCountedSols()), int(model.getNTotalNodes()), seconds
