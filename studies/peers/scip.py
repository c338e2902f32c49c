"""SCIP's count of solutions, and the points that it counted."""

from __future__ import annotations

import time

import numpy as np
from pyscipopt import SCIP_PARAMEMPHASIS, quicksum

from against_scip.model import model_of

STATUSES = ("open", "stick", "plus", "minus")
#: More points are not asked for.
MOST_POINTS = 200
CPU_CLOCK = 1


def prepared(system, tolerance, limit):
    model = model_of(system, "big-M")
    model.setParam("numerics/feastol", tolerance)
    model.setParam("timing/clocktype", CPU_CLOCK)
    model.setParam("limits/time", limit)
    return model


def count_and_points(system, limit, tolerance):
    """Forces with units (k, 2p), or only their number where counting was cut off or counted too many; seconds; end."""
    model = prepared(system, tolerance, limit)
    model.setEmphasis(SCIP_PARAMEMPHASIS.COUNTER)
    started = time.process_time()
    model.count()
    seconds = time.process_time() - started
    counted, ended = int(model.getNCountedSols()), model.getStatus() != "timelimit"
    points = points_of(system, tolerance, limit) if ended and counted <= MOST_POINTS else counted
    return points, seconds, "yes" if ended else "limit"


def points_of(system, tolerance, limit):
    """One point for every assignment that admits one, each found with those before it cut off."""
    p, points, seen = system.p, [], []
    while len(points) <= MOST_POINTS:
        model = prepared(system, tolerance, limit)
        variables = {variable.name: variable for variable in model.getVars()}
        for chosen in seen:
            model.addCons(quicksum(variables[name] for name in chosen) <= p - 1)
        model.optimize()
        if model.getNSols() == 0:
            break
        best = model.getBestSol()
        seen.append([f"{s}{i}" for i in range(p) for s in STATUSES if best[variables[f"{s}{i}"]] > 0.5])
        points.append([best[variables[f"{kind}{i}"]] for kind in "nt" for i in range(p)])
    return np.reshape(points, (-1, 2 * p)) * system.force
