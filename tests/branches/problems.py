"""Problems for the tests of branch graphs."""

from itertools import pairwise

import numpy as np

from enumsol import ContactProblem


def one_node(f, *, lame=(1.0, 1.0), friction=(0.0, 1.0), load_slope=None):
    """The paper's one-node problem; Lame coefficients with exact halves of their sums keep its data exact."""
    lam, mu = lame
    a, b = 0.5 * (lam + 3 * mu), -0.5 * (lam + mu)
    return ContactProblem([[a, b], [b, a]], [[1.0, 0.0]], [[0.0, 1.0]], f, friction=friction, load_slope=load_slope)


def generic_problem(rng, p, kind):
    """A random problem on a friction path, a loading path, or both."""
    n = 2 * p + int(rng.integers(0, 3))
    G = rng.normal(size=(n, n))
    B = rng.normal(size=(2 * p, n)) if rng.random() < 0.5 else np.eye(n)[: 2 * p]
    options = {} if kind == "friction" else {"load_slope": 2.0 * rng.normal(size=n)}
    if kind == "load":
        options["friction"] = float(rng.uniform(0.3, 4.0))
    else:
        options["friction"] = (rng.uniform(0.0, 1.0, p), rng.uniform(0.1, 1.0, p))
    gap = 0.3 * rng.normal(size=p)
    return ContactProblem(G @ G.T / n + 0.1 * np.eye(n), B[:p], B[p:], 2.0 * rng.normal(size=n), gap=gap, **options)


def integer_problem(rng, p, kind):
    """Small integer data, full of coincidences."""
    while True:
        G = rng.integers(-2, 3, size=(2 * p, 2 * p))
        A = G @ G.T + np.eye(2 * p) * int(rng.integers(0, 2))
        if np.linalg.det(A) > 0.5:
            break
    options = {} if kind == "friction" else {"load_slope": rng.integers(-1, 2, size=2 * p)}
    if kind == "load":
        options["friction"] = (rng.integers(0, 3, size=p).astype(float), 0.0)
    else:
        options["friction"] = tuple(rng.integers(0, 2, size=p).astype(float) for _ in range(2))
    f = rng.integers(-2, 3, size=2 * p)
    gap = rng.integers(0, 2, size=p) * int(rng.integers(0, 2))
    offset = rng.integers(-1, 2, size=p) * int(rng.integers(0, 2))
    B = np.eye(2 * p)
    return ContactProblem(A, B[:p], B[p:], f, gap=gap, slip_offset=offset, **options)


def mirrored_problem(rng, *, load):
    """Two nodes that a reflection exchanges, in small integers: pitchforks, corners and families."""
    mirror = np.array([[0, 0, 1, 0], [0, 0, 0, -1], [1, 0, 0, 0], [0, -1, 0, 0]])
    G = rng.integers(-2, 3, size=(4, 4))
    A = G @ G.T + np.eye(4)
    f, slope = (np.array([a, b, a, -b]) for a, b in rng.integers(-4, 5, size=(2, 2)).tolist())
    options = {}
    if load:
        options = {"load_slope": slope, "friction": tuple(float(v) for v in (rng.integers(0, 4), rng.integers(0, 2)))}
    return ContactProblem(A + mirror @ A @ mirror.T, np.eye(4)[[0, 2]], np.eye(4)[[1, 3]], f, **options)


def assert_balanced(graph):
    """Degrees balance at every vertex inside the interval and sum to +1 between neighbouring critical alphas."""
    assert graph.reasons == ()
    for v in graph.vertices:
        assert v.border or v.index_left == v.index_right
    alphas = sorted({v.exact.enclosure() for v in graph.vertices})
    for (_, left), (right, _) in pairwise(alphas):
        assert sum(arc.index for arc in graph.arcs_at((left + right) / 2)) == 1


def assert_same_roots(ours, theirs):
    """Two RootSets hold the same roots and families."""
    assert len(ours) == len(theirs)
    for a, b in zip(ours, theirs, strict=True):
        assert a.statuses == b.statuses
        assert a.index == b.index
        np.testing.assert_allclose(a.lambda_n, b.lambda_n, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(a.lambda_t, b.lambda_t, rtol=1e-7, atol=1e-9)
    assert [(f.dimension, f.index) for f in ours.families] == [(f.dimension, f.index) for f in theirs.families]
    for a, b in zip(ours.families, theirs.families, strict=True):
        np.testing.assert_allclose(a.vertices, b.vertices, atol=1e-9)
