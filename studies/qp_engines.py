"""Which QP solver for the relaxations of the tree? Own dual active-set method, daqp and clarabel on the same nodes.

The tree is searched once with the own method. Its partial assignments, in the order in which they are met, are then
given to the others, so that all see the same sequence: the own method starts from the parent's optimum, daqp both from
scratch and warm (one workspace, only bounds and the active set change), clarabel from scratch. An infeasible node is
"proven" when the multipliers that come back give a positive lower bound on the energy (theory, section 6).

Run: python studies/qp_engines.py [largest p]
"""

from __future__ import annotations

import sys
import time

import daqp
import numpy as np
from _output import report

from enumsol import gallery
from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.relaxation.interior_point import InteriorPointEngine
from enumsol.relaxation.rows import EQUALITY, status_rows
from enumsol.search.certifiers.floats import FastCertifier
from enumsol.search.tree import SearchLimits, TreeSearch
from enumsol.selections.floats import FloatSelections

SIZES = (8, 14, 16, 32, 64)
EFFORT = 4800  # relaxations a problem times p (clarabel is slow on large ones)
FRICTION = (0.3, 1.0, 10.0)


class Recorder(TreeSearch):
    """A search that keeps every partial assignment with the time and the verdict of the own method."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.met = []

    def _relax(self, branch):
        start = time.perf_counter()
        relaxation = super()._relax(branch)
        self.met.append((branch.codes, time.perf_counter() - start, relaxation.pruned, relaxation.bound))
        return relaxation


def problems(p):
    for traction in ((0.3, -1.0), (1.0, -0.3)):
        yield gallery.clamped_block(p, p // 2, traction=traction), FRICTION
    yield gallery.wedge(4, p // 2), (1.0,)
    yield gallery.wedge(4, p // 2, (4e-4, 1e-3)), (2.2,)


def search(problem, alpha):
    system = problem.condensed.at(alpha).scaled
    tree = Recorder(system, FastCertifier(FloatSelections(system)), limits=SearchLimits(max_nodes=EFFORT // system.p))
    tree.run()
    return system, tree


def rows_of(codes, F):
    p = len(codes)
    return [(k * p + i, mode) for i in range(p) for k, mode in status_rows(codes[i], friction=F[i] > 0)]


def proves(engine, rows, values):
    """Whether multipliers, or a multiple of them, give a positive lower bound on the energy."""
    if not np.all(np.isfinite(values)) or not np.any(values):
        return False
    if engine.dual_bound(rows, values) > PRUNE_MARGIN:
        return True
    # a ray: the best multiple of it, dual_bound(t) = -c t^2 + b t + a
    a, one, two = (engine.dual_bound(rows, t * values) for t in (0.0, 1.0, 2.0))
    c = -(two - 2 * one + a) / 2
    b = one - a + c
    best = b / (2 * c) if c > 0 else 1e12
    return b > 0 and any(engine.dual_bound(rows, t * values) > PRUNE_MARGIN for t in (best, 1e3, 1e6))


class Daqp:
    """daqp from scratch, on the rows that are on."""

    def __init__(self, system, engine):
        self.system, self.engine = system, engine
        self.H, self.f = np.ascontiguousarray(2.0 * system.S), np.ascontiguousarray(-system.g)
        unit = 1.0 / engine.norms
        self.unit, self.A, self.b = unit, engine.normals * unit[:, None], engine.offsets * unit

    def solve(self, codes):
        """(seconds, flag, rows, multipliers of rows >= offset)."""
        pairs = rows_of(codes, self.system.F)
        rows = np.array([r for r, _ in pairs])
        equal = np.array([mode == EQUALITY for _, mode in pairs])
        start = time.perf_counter()
        upper = np.where(equal, self.b[rows], 1e30)
        sense = np.where(equal, 5, 0).astype(np.int32)
        _, _, flag, info = daqp.solve(self.H, self.f, np.ascontiguousarray(self.A[rows]), upper, self.b[rows], sense)
        seconds = time.perf_counter() - start
        values = -np.array(info["lam"]) * self.unit[rows]
        return seconds, flag, rows, np.where(equal, values, np.maximum(values, 0.0))


class WarmDaqp(Daqp):
    """daqp with all rows in one workspace; rows that are off have infinite bounds, and the active set is kept."""

    def __init__(self, system, engine):
        super().__init__(system, engine)
        self.model = daqp.Model()
        off = np.full(len(self.b), 1e30)
        self.model.setup(self.H, self.f, np.ascontiguousarray(self.A), off, -off, np.zeros(len(off), dtype=np.int32))
        self.active = np.zeros(len(self.b), dtype=bool)

    def solve(self, codes):
        """See Daqp.solve."""
        pairs = rows_of(codes, self.system.F)
        start = time.perf_counter()
        upper, lower = np.full(len(self.b), 1e30), np.full(len(self.b), -1e30)
        sense = np.zeros(len(self.b), dtype=np.int32)
        rows = np.array([r for r, _ in pairs])
        equal = np.array([mode == EQUALITY for _, mode in pairs])
        lower[rows] = self.b[rows]
        upper[rows[equal]] = self.b[rows[equal]]
        # a row active at the lower bound: bits 1 (active) and 2 (lower)
        sense[rows] = np.where(equal, 5, np.where(self.active[rows], 3, 0))
        self.model.update(bupper=upper, blower=lower, sense=sense)
        _, _, flag, info = self.model.solve()
        seconds = time.perf_counter() - start
        lam = np.array(info["lam"])
        self.active = lam < 0 if flag == 1 else np.zeros(len(lam), dtype=bool)
        values = -lam[rows] * self.unit[rows]
        return seconds, flag, rows, np.where(equal, values, np.maximum(values, 0.0))


def run(p):
    totals = {
        name: {"time": [], "stalls": 0, "wrong": 0, "proven": 0} for name in ("own", "daqp", "daqp warm", "clarabel")
    }
    pruned = infeasible = 0
    for problem, alphas in problems(p):
        for alpha in alphas:
            system, tree = search(problem, alpha)
            engine = InteriorPointEngine(system)
            others = {"daqp": Daqp(system, engine), "daqp warm": WarmDaqp(system, engine)}
            totals["own"]["stalls"] += tree.outcome.fallback_qps
            for codes, seconds, excluded, bound in tree.met:
                pruned += excluded
                totals["own"]["time"].append(seconds)
                totals["own"]["proven"] += excluded and bound > PRUNE_MARGIN
                for name, solver in others.items():
                    spent, flag, rows, values = solver.solve(codes)
                    record(totals[name], spent, flag == 1, flag == -1, excluded)
                    totals[name]["proven"] += excluded and proves(engine, rows, values)
                rows, modes = map(list, zip(*rows_of(codes, system.F), strict=True))
                start = time.perf_counter()
                relaxed = engine.root(rows, modes)
                record(totals["clarabel"], time.perf_counter() - start, not relaxed.stalled, False, excluded)
                totals["clarabel"]["proven"] += excluded and relaxed.pruned
                infeasible += excluded and not np.any(relaxed.forces)
    own = np.mean(totals["own"]["time"])
    return [
        {
            "p": p,
            "engine": name,
            "relaxations": len(total["time"]),
            "mean us": 1e6 * float(np.mean(total["time"])),
            "median us": 1e6 * float(np.median(total["time"])),
            "against own": float(np.mean(total["time"]) / own),
            "no answer": total["stalls"],
            "false infeasible": total["wrong"],
            "empty nodes": pruned,
            "of them infeasible": infeasible,
            "proven by multipliers": total["proven"],
        }
        for name, total in totals.items()
    ]


def record(total, seconds, solved, infeasible, excluded):
    total["time"].append(seconds)
    total["stalls"] += not solved and not infeasible
    total["wrong"] += infeasible and not excluded


def main(largest: int = SIZES[-1]) -> None:
    rows = [row for p in SIZES if p <= largest for row in run(p)]
    by = {(row["p"], row["engine"]): row for row in rows}
    p = max(row["p"] for row in rows)
    own, cold, clarabel = by[p, "own"], by[p, "daqp"], by[p, "clarabel"]
    report(
        "qp_engines",
        rows,
        f"Conclusion: at p = {p} the own warm-started method takes {own['mean us']:.0f} us a relaxation, daqp from "
        f"scratch {cold['mean us']:.0f}, clarabel {clarabel['mean us']:.0f}; it gave no answer {own['no answer']} "
        f"times (clarabel {clarabel['no answer']}, daqp {cold['no answer']}), and its multipliers prove "
        f"{own['proven by multipliers']} of {own['empty nodes']} empty nodes (daqp {cold['proven by multipliers']}, "
        f"clarabel {clarabel['proven by multipliers']}).",
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
