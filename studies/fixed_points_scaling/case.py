"""One block in a process of its own: ``python case.py N ALPHA SOLVERS`` prints what it took, as JSON."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

import enumsol
from enumsol import fixed_points, gallery

#: CVXPY solves the problem in u: tried up to this many contact nodes.
LARGEST_REFERENCE = 256
DEPTH = 5


def block(n):
    """A flat block with p = n^2 contact nodes, n a multiple of 4: the same body on finer and finer meshes."""
    return gallery.block3d(n, n - 1, n // 4, size=(1.0, 1.0, 0.25))


def clocked(action):
    """What an action returns, and its process time."""
    started = time.process_time()
    answer = action()
    return answer, time.process_time() - started


def peak():
    """Peak resident size of this process [MB]."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def tresca(problem, limit, alpha, solvers):
    """Seconds for the Tresca problem at the limit, from scratch by each solver, and how far they are apart."""
    found, seconds = {}, {}
    for solver in solvers:
        if solver == "cvxpy" and problem.p > LARGEST_REFERENCE:
            continue
        enumsol.solve_tresca(gallery.one_node_3d(), 1.0, 0, solver=solver)  # what it imports is outside the clock
        found[solver], seconds[f"{solver} s"] = clocked(
            lambda solver=solver: enumsol.solve_tresca(problem, limit.lambda_n, alpha, slip=limit.slip, solver=solver)
        )
    forces = found["newton"].forces
    size = np.max(np.abs(forces))
    apart = {f"{name} off": float(np.max(np.abs(state.forces - forces)) / size) for name, state in found.items()}
    return {**seconds, **apart, "newton alone": found["newton"].solver == "newton"}


def measure(n, alpha, solvers):
    """Everything about one block."""
    problem, built = clocked(lambda: block(n))
    _, condensed = clocked(lambda: problem.condensed)
    approximate = enumsol.successive_approximations
    limit, plain = clocked(lambda: approximate(problem, alpha))
    mixed, anderson = clocked(lambda: approximate(problem, alpha, anderson=DEPTH))
    memory = peak()
    again, _ = clocked(lambda: fixed_points.fixed_point_residual(problem, limit))
    return {
        "n": problem.n,
        "build s": built,
        "condense s": condensed,
        "iterate s": plain,
        "iterations": limit.iterations,
        "converged": limit.converged,
        "contraction": limit.contraction_factor,
        "anderson s": anderson,
        "anderson iterations": mixed.iterations,
        "peak MB": memory,
        "residual": max(*limit.residuals.values(), again),
        "statuses": Counter(map(str, limit.statuses)),
        **tresca(problem, limit, alpha, solvers),
    }


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]), float(sys.argv[2]), sys.argv[3].split(","))))
