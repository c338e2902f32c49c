"""Small problems in 3D whose search is long beside their size: p = 3, of small integers, or with much friction.

They were picked from some hundred random ones by their number of nodes, and are named by their generator and seed.
"""

from __future__ import annotations

from time import process_time

import numpy as np

import enumsol

MAX_NODES, SMOKE_NODES = 1_000, 60


def sparse_integers(seed):
    """A stiffness with few integers beside its diagonal, an integer load, F of 1 to 3 at the nodes."""
    rng = np.random.default_rng([seed, 10])
    A = np.diag(rng.integers(2, 5, 9)).astype(float)
    beside = np.triu(rng.integers(-1, 2, (9, 9)), 1) * (rng.random((9, 9)) < 0.3)
    A += beside + beside.T
    A += np.eye(9) * max(0.0, np.ceil(0.01 - np.linalg.eigvalsh(A)[0]))
    return _problem(A, rng.integers(-2, 3, 9), rng.integers(1, 4, 3))


def grazing_integers(seed):
    """An integer stiffness, and a load that is in balance with tangential forces alone."""
    rng = np.random.default_rng([seed, 10])
    X = rng.integers(-2, 3, (9, 9))
    A = (X @ X.T + np.eye(9)).astype(float)
    rng.integers(0, 2, 3)
    return _problem(A, A @ np.concatenate([np.zeros(3), rng.integers(-1, 2, 6)]), rng.integers(1, 3, 3))


def much_friction(seed):
    """Strongly coupled random nodes with one F between 1,000 and 10,000."""
    rng = np.random.default_rng([seed, 10])
    X = rng.normal(size=(9, 9))
    S, g = X @ X.T + 10.0 ** rng.uniform(-2, 0) * np.eye(9), rng.normal(size=9)
    A = np.linalg.inv(S)
    return _problem(0.5 * (A + A.T), A @ g, np.full(3, 10.0 ** rng.uniform(3, 4)))


#: Legs and hypotenuses of triangles with a right angle.
TRIANGLES = ((3, 4, 5), (4, 3, 5), (5, 12, 13), (1, 0, 1), (0, 1, 1))
#: What the first node does at a known solution: it just sticks, touches without load and slides, or does so at rest.
KINDS = "limit", "graze", "rest"


def known_solution(kind, p, seed):
    """Strongly coupled nodes with integers, so that a solution is exact whose first node is degenerate."""
    rng = np.random.default_rng([seed, p])
    X = rng.integers(-2, 3, (3 * p, 3 * p))
    A = X @ X.T / 4 + np.eye(3 * p) * float(rng.choice([0.125, 0.5, 1, 2]))
    F = rng.integers(1, 4, p).astype(float)
    lam, w = np.zeros((p, 3)), np.zeros((p, 3))
    for i in range(p):
        a, b, c = TRIANGLES[rng.integers(len(TRIANGLES))]
        e = np.array([a, b]) * rng.choice([-1, 1], 2)
        does = kind if i == 0 else rng.choice(["open", "stick", "slip", "graze", "limit"])
        if does in ("limit", "slip"):
            lam[i] = c, *(F[i] * e)
        if does == "stick":
            lam[i] = 4, *(F[i] * rng.integers(-2, 3, 2))
        if does == "open":
            w[i] = -rng.integers(1, 4), *rng.integers(-3, 4, 2)
        if does in ("slip", "graze"):
            w[i, 1:] = e / 4
    rows = np.eye(3 * p)
    f = A @ w.ravel(order="F") + lam.ravel(order="F")
    return enumsol.ContactProblem3D(A, rows[:p], rows[p : 2 * p], rows[2 * p :], f, friction=(F, F))


def known_row(kind, p, count, max_nodes):
    """How many of so many problems with a known degenerate solution are decided."""
    found = [enumsol.enumerate_roots(known_solution(kind, p, seed), 0, max_nodes=max_nodes) for seed in range(count)]
    return {
        "first node": kind,
        "p": p,
        "problems": count,
        "complete": sum(roots.complete for roots in found),
        "by one certificate": sum(roots.stats.closed > 0 for roots in found),
        "with several roots": sum(len(roots) > 1 for roots in found),
        "ended": sum(roots.stats.nodes < max_nodes for roots in found),
        "median nodes": float(np.median([roots.stats.nodes for roots in found])),
    }


def _problem(A, f, F):
    rows = np.eye(9)
    return enumsol.ContactProblem3D(A, rows[:3], rows[3:6], rows[6:], f, friction=(F, F))


CASES = (
    (sparse_integers, 297),
    (sparse_integers, 388),
    (sparse_integers, 722),
    (grazing_integers, 8),
    (grazing_integers, 9),
    (much_friction, 535),
)


def row(generator, seed, max_nodes):
    """One search of a case, cut at a number of nodes."""
    started = process_time()
    roots = enumsol.enumerate_roots(generator(seed), 0, max_nodes=max_nodes)
    regions = [part.leaves for part in roots.undecided if part.bounds is not None]
    return {
        "case": f"{generator.__name__} {seed}",
        "roots": len(roots),
        "complete": roots.complete,
        "ended": roots.stats.nodes < max_nodes,
        "nodes": roots.stats.nodes,
        "leaves": roots.stats.selections,
        "regions": len(regions),
        "largest region": max(regions, default=0),
        "search s": process_time() - started,
    }
