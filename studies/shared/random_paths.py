"""Random problems on friction paths and loading paths, generic and degenerate."""

from __future__ import annotations

import numpy as np

from enumsol import ContactProblem

FRICTION_INTERVAL, LOADING_INTERVAL = (0.0, 20.0), (-5.0, 5.0)


def random_path(seed: int, p: int, *, loading: bool) -> tuple[ContactProblem, tuple[float, float]]:
    """A stable body with p contact nodes; friction grows with alpha, or the load does at fixed friction."""
    rng = np.random.default_rng([seed, p, loading])
    n = 2 * p + int(rng.integers(0, 3))
    M = rng.normal(size=(n, n))
    B = np.linalg.qr(rng.normal(size=(n, n)))[0][: 2 * p]
    data = {"friction": 0.0, "friction_slope": rng.uniform(0.3, 1.5, p)}
    if loading:
        data = {"friction": rng.uniform(0.3, 6.0, p), "friction_slope": 0.0, "load_slope": rng.normal(size=n)}
    problem = ContactProblem(M @ M.T + 0.3 * np.eye(n), B[:p], B[p:], 3.0 * rng.normal(size=n), **data)
    return problem, LOADING_INTERVAL if loading else FRICTION_INTERVAL


def integer_path(seed: int, p: int) -> tuple[ContactProblem, tuple[float, float]]:
    """Small integer data: grazing, loads in proportion, nodes without load or friction."""
    rng = np.random.default_rng([seed, p])
    A = np.zeros((2 * p, 2 * p))
    while np.linalg.det(A) < 0.5:
        G = rng.integers(-2, 3, size=(2 * p, 2 * p))
        A = (G @ G.T + np.eye(2 * p) * int(rng.integers(0, 2))).astype(float)
    kind = seed % 3
    data = {name: rng.integers(0, 2, size=p).astype(float) for name in ("friction", "friction_slope")}
    if kind:
        data["load_slope"] = rng.integers(-1, 2, size=2 * p)
    if kind == 2:
        data |= {"friction": rng.integers(0, 3, size=p).astype(float), "friction_slope": np.zeros(p)}
    B = np.eye(2 * p)
    f, gap = rng.integers(-2, 3, size=2 * p), rng.integers(0, 2, size=p) * int(rng.integers(0, 2))
    return ContactProblem(A, B[:p], B[p:], f, gap=gap, **data), (0.0, 5.0)
