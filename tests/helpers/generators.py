"""Random contact problems: dense and finite-element-like compliances, planted roots, degenerate integer data."""

from functools import cache

import numpy as np

from enumsol import ContactProblem, gallery

FRICTION = (0.05, 50.0)


def named(name):
    """A problem of the gallery, and the alpha of interest."""
    entry = gallery.get(name)
    return entry.build(), entry.alpha


def from_condensed(S, g, F):
    """A problem whose condensed data are S, g and F (constant friction)."""
    A = np.linalg.inv(S)
    p = len(F)
    rows = np.eye(2 * p)
    return ContactProblem(0.5 * (A + A.T), rows[:p], rows[p:], A @ g, friction=np.asarray(F, dtype=float))


def dense_compliance(rng, p):
    """A random positive definite S, from well to badly conditioned."""
    X = rng.normal(size=(2 * p, 2 * p + int(rng.integers(1, 6))))
    return X @ X.T


@cache
def _fe_compliances(p):
    pool = []
    for ny, length, lame in ((2, 1.0, (1.0, 1.0)), (3, 2.0, (2.0, 1.0)), (4, 0.5, (0.3, 1.0)), (2, 4.0, (5.0, 1.0))):
        pool.append(gallery.clamped_block(p, ny, length, lame=lame).condensed.S)
    if p % 2 == 0:
        pool += [gallery.wedge(3, p // 2, half_angle=angle).condensed.S for angle in (10.0, 25.0, 40.0)]
    return tuple(pool)


def fe_compliance(rng, p):
    """S of a clamped block or a wedge with p contact nodes, brought to size one."""
    pool = _fe_compliances(p)
    S = pool[int(rng.integers(len(pool)))]
    return S / np.max(np.abs(S))


def friction(rng, p):
    """Coefficients from 0.05 to 50, evenly in the logarithm; one value for all nodes or one a node."""
    size = p if rng.random() < 0.5 else 1
    return np.broadcast_to(np.exp(rng.uniform(*np.log(FRICTION), size=size)), (p,)).copy()


def planted_load(rng, S, F, tries=60):
    """g such that a selection of negative determinant holds a root: the problem then has at least three."""
    p = len(F)
    for _ in range(tries):
        codes = rng.integers(0, 4, size=p)
        closed, stick = np.flatnonzero(codes), np.flatnonzero(codes == 1)
        slip = np.where(codes == 2, 1.0, np.where(codes == 3, -1.0, 0.0))
        E = np.vstack([np.eye(p), np.diag(slip * F)])
        columns = np.hstack([E[:, closed], np.vstack([np.zeros((p, p)), np.eye(p)])[:, stick]])
        rows = np.concatenate([closed, p + stick])
        if len(rows) and np.linalg.det(S[rows] @ columns) < 0:
            n = np.where(codes > 0, rng.uniform(0.2, 1.0, size=p), 0.0)
            t = np.where(codes == 1, rng.uniform(-0.9, 0.9, size=p), slip) * F * n
            wn = np.where(codes == 0, -rng.uniform(0.05, 0.5, size=p), 0.0)
            wt = np.where(codes == 0, rng.normal(size=p), slip * rng.uniform(0.05, 0.5, size=p))
            return np.concatenate([wn, wt]) + S @ np.concatenate([n, t])
    return None


def random_load(rng, p):
    """A load that presses about half of the nodes on the floor."""
    g = rng.normal(size=2 * p)
    g[:p] += rng.uniform(-0.3, 1.0)
    return g


def random_problem(rng, p, *, planted=0.7):
    """A generic problem; with probability ``planted`` one with a planted root of index -1 where that is possible."""
    S = dense_compliance(rng, p) if rng.random() < 0.5 else fe_compliance(rng, p)
    F = friction(rng, p)
    g = planted_load(rng, S, F) if rng.random() < planted else None
    return from_condensed(S, random_load(rng, p) if g is None else g, F)


def integer_problem(rng, p):
    """Small integer data, full of coincidences: zero loads, grazing, F = 0, singular selections, families."""
    X = rng.integers(-1, 2, size=(2 * p, 2 * p))
    A = (X @ X.T + np.eye(2 * p) * int(rng.integers(1, 3))).astype(float)
    if rng.random() < 0.3:  # nodes that do not feel each other
        keep = np.kron(np.ones((2, 2)), np.eye(p))
        A = A * keep
    f = rng.integers(-2, 3, size=2 * p).astype(float)
    F = rng.integers(0, 4, size=p).astype(float)
    rows = np.eye(2 * p)
    return ContactProblem(A, rows[:p], rows[p:], f, friction=F)


def singular_problem(rng, p):
    """Integer data with a root planted in a singular selection where one is found: mostly a family of roots."""
    for _ in range(200):
        problem = _integer_trial(rng, p)
        if problem is not None:
            return problem
    return integer_problem(rng, p)


def _integer_trial(rng, p):
    X = rng.integers(-1, 2, size=(2 * p, 2 * p))
    A = X @ X.T + np.eye(2 * p) * int(rng.integers(1, 3))
    if rng.random() < 0.4:
        A = A * np.kron(np.ones((2, 2)), np.eye(p))
    S = np.linalg.inv(A)
    F = rng.integers(0, 5, size=p).astype(float)
    codes = rng.integers(0, 4, size=p)
    slip = np.where(codes == 2, 1.0, np.where(codes == 3, -1.0, 0.0))
    closed, stick = np.flatnonzero(codes), np.flatnonzero(codes == 1)
    columns = np.hstack([np.vstack([np.eye(p), np.diag(slip * F)])[:, closed], np.eye(2 * p)[:, p + stick]])
    rows = np.concatenate([closed, p + stick])
    if not len(rows) or abs(np.linalg.det(S[rows] @ columns)) > 1e-12:
        return None
    n = np.where(codes > 0, rng.integers(0, 3, size=p), 0)
    t = np.where(codes == 1, rng.integers(-2, 3, size=p), 0)
    t = np.clip(t, -F * n, F * n) + slip * F * n
    w = np.concatenate([np.where(codes == 0, -rng.integers(0, 2, size=p), 0), rng.integers(0, 3, size=p) * slip])
    w[p:] += np.where(codes == 0, rng.integers(-1, 2, size=p), 0)
    eye = np.eye(2 * p)
    return ContactProblem(A, eye[:p], eye[p:], A @ w + np.concatenate([n, t]), friction=F)


def through_the_unloaded_state():
    """One node whose load vanishes inside the interval, with that interval."""
    triangle = gallery.one_node_triangle()
    load = {"load_slope": [1.5, -4.0], "friction": 3.0}
    return ContactProblem(triangle.A, triangle.Bn, triangle.Bt, [0.0, 0.0], **load), (-1.0, 2.0)


def vanishing_problem(rng, p, zero, *, inner=0, friction=0.0, friction_slope=0.0):
    """Small integers for which g vanishes exactly at the rational ``zero``, mostly by load, gap and slip together.

    ``inner`` degrees of freedom are not in contact; loads on them may cancel what others do to the contact nodes.
    """
    n = 2 * p + inner
    G = rng.integers(-1, 2, size=(n, n))
    A = G @ G.T + int(rng.integers(1, 4)) * np.eye(n, dtype=int)
    B = np.eye(n, dtype=int)[rng.permutation(n)[: 2 * p]]
    if inner and rng.random() < 0.3:
        B[0] += np.eye(n, dtype=int)[np.flatnonzero(~B.any(axis=0))[0]]
    rest = rng.integers(-2, 3, size=n)  # the displacement at the zero
    if rng.random() < 0.3:
        rest = np.where(B.any(axis=0), 0, rest)
    slope = rng.integers(-2, 3, size=n)
    slope[np.flatnonzero(B.any(axis=0))[0]] = 1
    f = A @ rest - zero.numerator * slope
    slope = zero.denominator * slope
    data = {"gap": B[:p] @ rest, "slip_offset": B[p:] @ rest, "load_slope": slope}
    return ContactProblem(A, B[:p], B[p:], f, friction=friction, friction_slope=friction_slope, **data)
