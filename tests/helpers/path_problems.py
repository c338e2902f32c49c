"""Problems for the tests of branch graphs and of paths."""

from itertools import pairwise

import numpy as np

from enumsol import ContactProblem


def one_node(f, *, lame=(1.0, 1.0), friction=None, friction_slope=None, load_slope=None):
    """The paper's one-node problem; Lame coefficients with exact halves of their sums keep its data exact."""
    lam, mu = lame
    a, b = 0.5 * (lam + 3 * mu), -0.5 * (lam + mu)
    data = {"friction": friction, "friction_slope": friction_slope, "load_slope": load_slope}
    return ContactProblem([[a, b], [b, a]], [[1.0, 0.0]], [[0.0, 1.0]], f, **data)


def closed_branch():
    """One node, F = 4 - alpha, f = (1, -3.5) + alpha (1, -3): a closed branch of stick and slip-, alpha^2 < 1/2."""
    return one_node((1.0, -3.5), friction=4.0, friction_slope=-1.0, load_slope=[1.0, -3.0])


def sheet_of_one_node():
    """F = 2 makes slip singular: for every alpha > 0 a segment of solutions from no force to (alpha, -2 alpha)."""
    return one_node((0.0, 0.0), friction=2.0, load_slope=[1.0, -2.0])


def uncoupled(*loads, **options):
    """Several one-node problems that do not feel each other."""
    p = len(loads)
    A, rows = np.kron(np.eye(p), [[2.0, -1.0], [-1.0, 2.0]]), np.eye(2 * p)
    return ContactProblem(A, rows[0::2], rows[1::2], np.concatenate(loads), **options)


def generic_problem(rng, p, kind):
    """A random problem on a friction path, a loading path, or both."""
    n = 2 * p + int(rng.integers(0, 3))
    G = rng.normal(size=(n, n))
    B = rng.normal(size=(2 * p, n)) if rng.random() < 0.5 else np.eye(n)[: 2 * p]
    options = {} if kind == "friction" else {"load_slope": 2.0 * rng.normal(size=n)}
    if kind == "load":
        options["friction"] = float(rng.uniform(0.3, 4.0))
    else:
        options |= {"friction": rng.uniform(0.0, 1.0, p), "friction_slope": rng.uniform(0.1, 1.0, p)}
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
        options["friction"] = rng.integers(0, 3, size=p).astype(float)
    else:
        options |= {name: rng.integers(0, 2, size=p).astype(float) for name in ("friction", "friction_slope")}
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
        F0, F1 = (float(v) for v in (rng.integers(0, 4), rng.integers(0, 2)))
        options = {"load_slope": slope, "friction": F0, "friction_slope": F1}
    return ContactProblem(A + mirror @ A @ mirror.T, np.eye(4)[[0, 2]], np.eye(4)[[1, 3]], f, **options)


def balanced(graph):
    """The graph, whose degrees balance at all vertices inside the interval and sum to +1 between critical alphas."""
    assert graph.reasons == ()
    for v in graph.vertices:
        assert v.border or v.index_left == v.index_right
    alphas = sorted({v.exact.enclosure() for v in graph.vertices})
    for (_, left), (right, _) in pairwise(alphas):
        assert sum(arc.index for arc in graph.arcs_at((left + right) / 2)) == 1
    return graph


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


def planted_corner(rng, p, kind, *, at=None):
    """Small integers, and at a dyadic alpha in (0, 4), or at ``at``, a root with one or more conditions that vanish."""
    G = rng.integers(-1, 2, size=(2 * p, 2 * p))
    A = G @ G.T + np.eye(2 * p) * int(rng.integers(1, 3))
    if rng.random() < 0.3:  # nodes that do not feel each other
        A = A * np.kron(np.ones((2, 2)), np.eye(p))
    alpha = at if at is not None else float(rng.integers(1, 16)) / 4
    steps = rng.integers(0, 3, size=p) / 4 if kind != "load" else np.zeros(p)
    F = np.maximum(rng.integers(0, 5, size=p), alpha * steps)
    degenerate = set(rng.permutation(p)[: int(rng.integers(1, p + 1))].tolist())
    lam, w = np.zeros((2, p)), np.zeros((2, p))
    for i in range(p):
        sign, state = int(rng.choice((-1, 1))), rng.integers(3)
        w[1, i] = int(rng.integers(-2, 3))
        if i in degenerate and state == 0:  # it just touches
            continue
        if i in degenerate:  # it is about to slip
            lam[:, i], w[1, i] = (n := int(rng.integers(1, 3)), sign * F[i] * n), 0
        elif state == 0:
            w[0, i] = -int(rng.integers(1, 3))
        elif state == 1:
            lam[:, i], w[1, i] = (n := int(rng.integers(1, 3)), 0.5 * sign * F[i] * n), 0
        else:
            lam[:, i], w[1, i] = (n := int(rng.integers(1, 3)), sign * F[i] * n), sign * int(rng.integers(1, 3))
    slope = np.zeros(2 * p) if kind == "friction" else rng.integers(-2, 3, size=2 * p).astype(float)
    f = A @ w.ravel() + lam.ravel() - alpha * slope
    B = np.eye(2 * p)
    load = {} if kind == "friction" else {"load_slope": slope}
    return ContactProblem(A, B[:p], B[p:], f, friction=F - alpha * steps, friction_slope=steps, **load)


def together(rng, *, push=0.0, nodes=2):
    """Nodes that do not feel each other, with a fold of one and a transition or fold of another at the same alpha.

    ``push`` moves the second event away by about as much.
    """
    S = np.array([[2.0, -1.0], [-1.0, 2.0]])
    first = float(rng.choice((2.5, 3.0, 3.5, 4.0)))
    loads, F0, F1 = [(1.0, -first)], [0.0], [1.0]
    for _ in range(nodes - 1):
        event = float(rng.choice((0.75, 1.0, 1.5, 2.25, 2.5, 3.0)))
        slope = float(rng.choice((0.125, 0.25, 0.5)))
        if event < slope * first:
            slope = 0.125
        scale, sign = 2.0 ** int(rng.integers(-3, 4)), int(rng.choice((-1, 1)))
        loads.append((scale, sign * scale * event * (1.0 + push)))
        F0.append(event - slope * first)
        F1.append(slope)
    B = np.eye(2 * nodes)
    order = rng.permutation(nodes)
    f, F0, F1 = (np.array(part)[order] for part in (loads, F0, F1))
    return ContactProblem(np.kron(np.eye(nodes), S), B[0::2], B[1::2], f.ravel(), friction=F0, friction_slope=F1)


def grazing_problem(rng, p):
    """A node touches at every alpha without a force, while friction varies elsewhere."""
    G = rng.integers(-1, 2, size=(2 * p, 2 * p))
    A = G @ G.T + np.eye(2 * p) * int(rng.integers(1, 3))
    codes = rng.permutation([0, *rng.integers(0, 3, size=p - 1).tolist()])  # touching, open or sticking
    lam, w = np.zeros((2, p)), np.zeros((2, p))
    for i, code in enumerate(codes.tolist()):
        w[1, i] = 0.0 if code == 2 else int(rng.integers(-2, 3))
        w[0, i] = -1.0 if code == 1 else 0.0
        lam[:, i] = (1.0, int(rng.integers(-2, 3)) / 2) if code == 2 else (0.0, 0.0)
    B = np.eye(2 * p)
    return ContactProblem(A, B[:p], B[p:], A @ w.ravel() + lam.ravel(), friction=0.0, friction_slope=1.0)


def without_friction_somewhere(rng, p, kind):
    """A generic problem in which nodes have F = 0 throughout, or at alpha = 0."""
    problem = generic_problem(rng, p, kind)
    F0, F1 = (part.copy() for part in problem.affine_friction)
    F0[rng.random(p) < 0.6] = 0.0
    F1[(F0 == 0.0) & (rng.random(p) < 0.5)] = 0.0
    data = {"gap": problem.gap, "friction": F0, "friction_slope": F1}
    if problem.load_slope is not None:
        data["load_slope"] = problem.load_slope
    return ContactProblem(problem.A, problem.Bn, problem.Bt, problem.f, **data)


def stable_problem(seed, loading=False):
    """A stable body with p <= 6 contact nodes; friction grows with alpha, or the load does at fixed friction."""
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, 7))
    n = 2 * p + int(rng.integers(0, 3))
    M = rng.normal(size=(n, n))
    B = np.linalg.qr(rng.normal(size=(n, n)))[0][: 2 * p]
    f = rng.normal(size=n) * 3
    data = {"friction": 0.0, "friction_slope": rng.uniform(0.3, 1.5, p)}
    if loading:
        data = {"friction": rng.uniform(0.3, 6, p), "friction_slope": 0.0, "load_slope": rng.normal(size=n)}
    return ContactProblem(M @ M.T + 0.3 * np.eye(n), B[:p], B[p:], f, **data)
