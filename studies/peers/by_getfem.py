"""Solutions on branches that GetFEM's continuation follows: ``python by_getfem.py PROBLEM.npz POINTS.npz``.

PROBLEM.npz has A, Bn, Bt, f, gap, the friction coefficients F at which solutions are sought, and a limit in seconds.
GetFEM's contact brick takes these matrices as they are. Its continuation for piecewise smooth problems (by Ligursky and
Renard, with branching at singular points) follows the solutions while the coefficients grow from 0 to 2 F or fall
back. It starts at Newton's solution for 0 and for 2 F, begun at rest, and for 2 F, begun where all nodes stick. Where a
branch passes F, Newton's method is started from the point between. All of this is done twice, with two limits for the
corrections. What was found so far is in POINTS.npz all the while. Imports nothing of enumsol.
"""

from __future__ import annotations

import os
import sys
import time

import getfem
import numpy as np

STEPS = {"h_init": 1e-3, "h_max": 2e-2, "h_min": 1e-7, "max_res": 1e-9, "max_diff": 1e-7}
#: Iterations of a correction: at most, and before a step counts as slow. Few make fewer jumps, many stop less often.
CORRECTIONS = ((4, 3), (20, 8))
#: Of Newton's method; the load is scaled to one.
RESIDUAL, ITERATIONS = 1e-11, 100
MOST_STEPS, MOST_BRANCHES = 5000, 20

getfem.util_trace_level(0)
getfem.util_warning_level(0)
given = np.load(sys.argv[1])
A, Bn, Bt, F = (given[name] for name in ("A", "Bn", "Bt", "F"))
p, n = Bn.shape
unit = np.abs(given["f"]).max()
f, gap = given["f"] / unit, given["gap"] / unit
points: list[np.ndarray] = []
started = time.process_time()


def sparse(matrix):
    found = getfem.Spmat("empty", *matrix.shape)
    found.assign(range(matrix.shape[0]), range(matrix.shape[1]), matrix)
    return found


def model_of():
    model = getfem.Model("real")
    for name, size in (("u", n), ("v_n", p), ("v_t", p)):  # GetFEM stacks variables in the order of their names
        model.add_variable(name, size)
    model.add_explicit_matrix("u", "u", sparse(A))
    model.add_explicit_rhs("u", f)
    data = {"r": [np.mean(np.diag(A))], "gap": gap, "start": 0 * F, "end": 2 * F, "F": 0 * F, "gamma": [0.0]}
    for name, value in data.items():
        model.add_initialized_data(name, value)
    model.add_basic_contact_brick("u", "v_n", "v_t", "r", sparse(Bn), sparse(Bt), "F", "gap", "", 1)
    return model


def newton(model, gamma, x):
    """A solution for the coefficients 2 gamma F, or None."""
    model.set_variable("gamma", [gamma])
    model.set_variable("F", 2 * gamma * F)
    model.to_variables(x)
    model.solve("max_res", RESIDUAL, "max_iter", ITERATIONS)
    x = model.from_variables()
    model.assembly()
    return x if np.linalg.norm(model.rhs()) <= RESIDUAL else None


def walk(model, path, branch, waiting):
    """Follow a branch as far as it goes; singular points add branches to those that wait."""
    x, gamma, tx, tgamma, step = branch
    for _ in range(MOST_STEPS):
        x0, gamma0 = x, gamma
        try:
            x, gamma, tx, tgamma, step, _, kind = path.Moore_Penrose_continuation(x, gamma, tx, tgamma, step)
        except RuntimeError:  # a tangent that is not finite
            return
        if step == 0 or time.process_time() - started > given["limit"]:
            return
        if (gamma0 - 0.5) * (gamma - 0.5) <= 0 and gamma0 != gamma:
            share = (0.5 - gamma0) / (gamma - gamma0)
            keep(newton(model, 0.5, x0 + share * (x - x0)))
        if "bifurcation" in kind:
            at, there, tangents, slopes = path.sing_data()
            for k in range(np.shape(tangents)[1] if np.isfinite(there) else 0):
                waiting.append((at, there, tangents[:, k], float(np.ravel(slopes)[k]), path.init_step_size()))
        if not 0 <= gamma <= 1:
            return


def keep(x):
    if x is not None:
        points.append(-unit * np.concatenate([x[n : n + p], x[n + p :]]))  # GetFEM's multipliers have the other sign


def sticking():
    """All nodes held at the foundation."""
    B = np.vstack([Bn, Bt])
    system = np.block([[A, -B.T], [B, np.zeros((2 * p, 2 * p))]])
    return np.linalg.solve(system, np.concatenate([f, gap, np.zeros(p)]))


def follow(iterations):
    """All branches that are reached from the three starts."""
    model, waiting = model_of(), []
    most, slow = iterations
    steps = [part for option in (STEPS | {"max_iter": most, "thr_iter": slow}).items() for part in option]
    names = ("gamma", "start", "end", "F")
    path = getfem.ContStruct(model, *names, 1.0 / (n + 2 * p), *steps, "singularities", 2, "non-smooth")
    for gamma, x in ((0.0, np.zeros(n + 2 * p)), (1.0, np.zeros(n + 2 * p)), (1.0, sticking())):
        found = newton(model, gamma, x)
        if found is not None:
            tangent = path.init_Moore_Penrose_continuation(found, gamma, 1.0 if gamma == 0 else -1.0)
            waiting.append((found, gamma, *tangent))
    for _ in range(MOST_BRANCHES):
        if waiting:
            walk(model, path, waiting.pop(0), waiting)
            save(ended=False)


def save(*, ended):
    seconds = time.process_time() - started
    ended = ended and seconds < given["limit"]
    np.savez("part.npz", points=np.reshape(points, (-1, 2 * p)), seconds=seconds, ended=ended)
    os.replace("part.npz", sys.argv[2])  # whole whenever this process is killed


for iterations in CORRECTIONS:
    follow(iterations)
save(ended=True)
