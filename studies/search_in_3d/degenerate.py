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
