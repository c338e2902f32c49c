"""Small problems in 3D, and the equations of a solution written out by hand."""

import numpy as np
from parted_solids import on_springs
from scipy.optimize import brentq

from enumsol import ContactProblem, ContactProblem3D, fem


def from_compliance(S, g, friction, **more):
    """A problem whose condensed data are S (3p, 3p) and g (3p,); rows are all normals, then both tangents."""
    A = np.linalg.inv(S)
    rows = np.eye(len(S))
    p = len(S) // 3
    return ContactProblem3D(0.5 * (A + A.T), rows[:p], rows[p : 2 * p], rows[2 * p :], A @ g, friction=friction, **more)


def exactly(lam, w, friction=1.0):
    """A problem of coupled nodes whose solution is lambda and w (p, 3), without any rounding."""
    size, p = np.size(lam), len(lam)
    A = 4.0 * np.eye(size) + np.random.default_rng(1).integers(-2, 3, (size, size)) / 8
    A = 0.5 * (A + A.T)
    rows, load = np.eye(size), A @ np.ravel(w, order="F") + np.ravel(lam, order="F")
    return ContactProblem3D(A, rows[:p], rows[p : 2 * p], rows[2 * p :], load, friction=friction)


#: Integer legs and hypotenuses of triangles with a right angle.
_TRIANGLES = ((3, 4, 5), (4, 3, 5), (5, 12, 13), (1, 0, 1), (0, 1, 1))


def degenerate_integers(seed, kinds=("graze", "limit")):
    """A problem of small integers and a solution of it, without rounding, whose first node is degenerate.

    Returns the problem, lambda and w (p, 3), F (p, 2), and what the nodes do: "graze" touches without load and slides,
    "rest" without load at rest, "limit" just sticks, "open", "stick" and "slip" are strict. ``kinds`` are those that
    the first node may have, and others with them.
    """
    rng = np.random.default_rng([seed, 77])
    p = int(rng.integers(1, 5))
    X = rng.integers(-2, 3, (3 * p, 3 * p))
    A = X @ X.T / float(rng.choice([1, 4])) + np.eye(3 * p) * float(rng.choice([0.125, 0.5, 1, 2]))
    F = np.repeat(rng.integers(1, 4, (p, 1)), 2, axis=1).astype(float)
    if rng.random() < 0.25:
        F[rng.integers(p), rng.integers(2)] = 0
    lam, w, named = np.zeros((p, 3)), np.zeros((p, 3)), []
    for i in range(p):
        a, b, c = _TRIANGLES[rng.integers(len(_TRIANGLES))]
        sign, f = rng.choice([-1, 1], 2), F[i]
        kind = str(rng.choice([*kinds, "open", "stick", "slip"][: len(kinds) if i == 0 else None]))
        named.append(kind)
        if kind == "open":
            w[i] = [-rng.integers(1, 4), *rng.integers(-3, 4, 2)]
        elif kind == "graze":
            w[i, 1:] = a * sign[0], b * sign[1]
        elif kind == "stick":
            lam[i] = [4, *(f * rng.integers(-2, 3, 2))]
        elif kind != "rest":
            # unit vector times c, of one component if there is one
            along = np.array([a * sign[0], b * sign[1]]) if np.all(f > 0) else np.where(f > 0, c * sign[0], 0)
            lam[i] = [c, *(f * along)]
            if kind == "slip":
                w[i, 1:] = np.where(
                    f > 0, along * rng.integers(1, 4) / np.where(f > 0, 4 * f, 1), rng.integers(-2, 3, 2)
                )
    rows = np.eye(3 * p)
    f = A @ np.ravel(w, order="F") + np.ravel(lam, order="F")
    problem = ContactProblem3D(A, rows[:p], rows[p : 2 * p], rows[2 * p :], f, friction=(F[:, 0], F[:, 1]))
    return problem, lam, w, F, named


def random_compliance(rng, p):
    X = rng.normal(size=(3 * p, 3 * p))
    return X @ X.T + 0.5 * np.eye(3 * p)


def violations(S, g, F, lambda_n, lambda_t):
    """Largest violations of contact, cone and maximum dissipation, node by node, by the definitions alone."""
    p = len(lambda_n)
    w = g - S @ np.concatenate([lambda_n, lambda_t[:, 0], lambda_t[:, 1]])
    contact = cone = dissipation = 0.0
    for i in range(p):
        slip = np.array([w[p + i], w[2 * p + i]])
        contact = max(contact, -lambda_n[i], w[i], abs(lambda_n[i] * w[i]))
        tau = [lambda_t[i, k] / F[i, k] if F[i, k] else lambda_t[i, k] * np.inf for k in range(2) if lambda_t[i, k]]
        cone = max(cone, float(np.sqrt(sum(t * t for t in tau))) - lambda_n[i])
        dissipation = max(dissipation, abs(lambda_n[i] * np.hypot(*(F[i] * slip)) - lambda_t[i] @ slip))
    return contact, cone, dissipation


def random_one_node(rng):
    """S, g, F (1, 2) of one node: F from 0.01 to 100, isotropic and orthotropic, some 0 on an axis or both."""
    X = rng.normal(size=(3, 3))
    S = X @ X.T + 10 ** rng.uniform(-3, 0) * np.eye(3)
    F = 10 ** rng.uniform(-2, 2, size=2)
    kind = rng.integers(0, 20)
    if kind < 8:
        F[1] = F[0]
    elif kind < 10:
        F[kind - 8] = 0.0
    elif kind == 10:
        F[:] = 0.0
    return S, rng.normal(size=3) * [rng.choice([0.3, 1.0]), 1.0, 1.0], F[None]


def random_coupled(rng, p):
    """S, g, F (p, 2) of strongly coupled nodes with much friction, a third of them isotropic."""
    X = rng.normal(size=(3 * p, 3 * p))
    S = X @ X.T + 10 ** rng.uniform(-2, 0) * np.eye(3 * p)
    F = 10 ** rng.uniform(-0.5, 1.5, size=(p, 2))
    if rng.random() < 1 / 3:
        F[:, 1] = F[:, 0]
    return S, rng.normal(size=3 * p), F


def soft_or_coupled(seed, p):
    """S, g and F of nodes on a body on weak springs, or of strongly coupled ones."""
    rng = np.random.default_rng([seed, p])
    if seed % 2:
        return random_coupled(rng, p)
    X = rng.normal(size=(3 * p, 3 * p))
    together = np.kron(np.eye(3), np.ones((p, 1)))
    S = X @ X.T / p + 0.1 * np.eye(3 * p) + together @ together.T / 10 ** rng.uniform(-3, 0)
    load = np.array([1.0, *rng.uniform(-0.5, 0.5, 2)])
    return S, S @ together @ load / p + rng.normal(size=3 * p), np.full((p, 2), 10 ** rng.uniform(-0.5, 0.5))


def forces(root):
    return np.concatenate([root.lambda_n, root.lambda_t[:, 0], root.lambda_t[:, 1]])


def scaled(system, lam):
    """Forces in the problem's units, (p, 3) or as those of a root, as a system has them."""
    y, occurs = np.zeros(len(system.g)), system.tau >= 0
    lam = lam if lam.ndim == 2 else lam.reshape(3, -1).T
    y[: system.p] = lam[:, 0] / system.force
    y[system.tau[occurs]] = (lam[:, 1:] / np.where(occurs, system.F * system.force[:, None], 1.0))[occurs]
    return y


def bounds(root):
    """Lower and upper ends of the enclosed forces, (3p,) each."""
    box = np.concatenate([root.enclosure.lambda_n, root.enclosure.lambda_t[:, 0], root.enclosure.lambda_t[:, 1]])
    return box[:, 0], box[:, 1]


def within(values, box):
    """Whether all values lie in their bounds."""
    return bool(np.all((box[..., 0] <= values) & (values <= box[..., 1])))


def unmatched(roots, wanted, rtol=1e-6):
    """Numbers of the wanted solutions (arrays like g) that no root encloses, and of the roots that enclose none.

    Enclosures are widened by ``rtol`` of the largest force: the inverse of S in a problem is rounded.
    """
    near = rtol * max([np.max(np.abs(lam)) for lam in wanted], default=0.0)
    boxes = [bounds(root) for root in roots]
    inside = np.array([[np.all((lam >= low - near) & (lam <= up + near)) for low, up in boxes] for lam in wanted])
    inside = inside.reshape(len(wanted), len(boxes))
    return np.flatnonzero(~inside.any(axis=1)).tolist(), np.flatnonzero(~inside.any(axis=0)).tolist()


def block_on_springs(rng, spring):
    """A block pressed on the ground and pulled, every node on springs."""
    block = fem.box(2, 1, 1)
    loads = np.array([0.2, 0.1, -1.0]) * rng.uniform(0.2, 1.0, (len(block.nodes("top")), 3))
    return on_springs(block, tuple(rng.uniform(0.5, 2.0, 2)), spring, loads, rng.uniform(0.2, 0.7))


#: One node that slips for every alpha > 0 that is not too large, with the friction alpha.
SLIDING = from_compliance(np.diag([1.0, 2.0, 4.0]), np.array([1.0, 3.0, 4.0]), 0.0, friction_slope=1.0)


def sliding_node(alpha, ratio=1.0):
    """lambda of ``SLIDING`` while it slips: (3 - 2 alpha d1, 4 - 4 alpha d2) is along d; the angle by bisection.

    ``ratio``: with so many times the second component, which is no solution but a zero of the natural map whose rho
    have this ratio.
    """
    low, high = 0.0, 0.5 * np.pi
    for _ in range(200):
        phi = 0.5 * (low + high)
        d = np.cos(phi), np.sin(phi)
        turned = (3 - 2 * alpha * d[0]) * d[1] - ratio * (4 - 4 * alpha * d[1]) * d[0]
        low, high = (low, phi) if turned > 0 else (phi, high)
    return np.array([1.0, alpha * np.cos(low), alpha * np.sin(low)])


def random_over_alpha(p, seed):
    """Load, or friction, or both change with alpha; one coefficient a node."""
    rng = np.random.default_rng(1000 * p + seed)
    X = rng.standard_normal((3 * p, 3 * p))
    F = 10 ** rng.uniform(-0.5, 0.7, p)
    slope = rng.uniform(0.2, 1.0) if seed % 3 else 0.0
    g = rng.standard_normal(3 * p)
    problem = from_compliance(X @ X.T + 0.05 * np.eye(3 * p), g, (F, F))
    load = None if seed % 3 == 1 else rng.standard_normal(problem.n)
    return problem.replace(friction=(F, F), friction_slope=(slope * F, slope * F), load_slope=load)


def random_plane_over_alpha(p, seed):
    """A problem in 2D in which friction, load or both change with alpha."""
    rng = np.random.default_rng([seed, p, 29])
    X = rng.standard_normal((2 * p, 2 * p))
    A = np.linalg.inv(X @ X.T + 0.1 * np.eye(2 * p))
    A, rows = 0.5 * (A + A.T), np.eye(2 * p)
    g, F = rng.standard_normal(2 * p), 10 ** rng.uniform(-0.5, 0.6, p)
    slope = A @ rng.standard_normal(2 * p) if seed % 3 else None
    F0, F1 = ((0 * F, F), (F, 0 * F), (F, 0.5 * F))[seed % 3]
    return ContactProblem(A, rows[:p], rows[p:], A @ g, friction=F0, friction_slope=F1, load_slope=slope)


def in_space(problem):
    """A problem in 2D written in 3D: every node has a second tangent with a stiffness of its own, without load."""
    p, n = problem.p, problem.n
    F0, F1 = problem.affine_friction
    slope = problem.load_slope
    A, Bn, Bt = (M.toarray() for M in (problem.A, problem.Bn, problem.Bt))
    return ContactProblem3D(
        np.block([[A, np.zeros((n, p))], [np.zeros((p, n)), np.eye(p)]]),
        *(np.hstack([rows, np.zeros((p, p))]) for rows in (Bn, Bt)),
        np.hstack([np.zeros((p, n)), np.eye(p)]),
        np.append(problem.f, np.zeros(p)),
        friction=(F0, F0),
        friction_slope=(F1, F1),
        load_slope=None if slope is None else np.append(slope, np.zeros(p)),
    )


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


class OneNode:
    """One node with isotropic friction; on its slipping branch alpha is a quotient of functions of the slip angle.

    With d the direction of slip, n = g_n / (S_nn + F S_nt d), and v = g_t - n (S_tn + F S_tt d) has no part across d.
    """

    def __init__(self, seed, load):
        rng = np.random.default_rng([seed, 3])
        X = rng.normal(size=(3, 3))
        self.S, self.load = X @ X.T + 0.05 * np.eye(3), load
        self.g, self.slope = rng.normal(size=(2, 3))
        self.g[0] += 1.0
        self.F = float(rng.uniform(0.5, 4.0))

    @property
    def problem(self):
        if self.load:
            return from_compliance(self.S, self.g, self.F, load_slope=np.linalg.solve(self.S, self.slope))
        return from_compliance(self.S, self.g, 0.0, friction_slope=1.0)

    def _terms(self, phi):
        """Numerator and denominator of alpha, with derivatives."""
        S, d, e = self.S, np.array([np.cos(phi), np.sin(phi)]), np.array([-np.sin(phi), np.cos(phi)])
        Sd, Se = S[1:, 1:] @ d, S[1:, 1:] @ e

        def plain(g):
            """Without friction."""
            return tuple(cross(g[1:], t) * S[0, 0] - g[0] * cross(S[1:, 0], t) for t in (d, e))

        def rubbing(g):
            """What friction multiplies."""
            s, ds = S[0, 1:] @ d, S[0, 1:] @ e
            return (
                cross(g[1:], d) * s - g[0] * cross(Sd, d),
                cross(g[1:], e) * s + cross(g[1:], d) * ds - g[0] * (cross(Se, d) + cross(Sd, e)),
            )

        if not self.load:
            return (*plain(self.g), *rubbing(self.g))
        return tuple(
            one + self.F * more for g in (self.g, self.slope) for one, more in zip(plain(g), rubbing(g), strict=True)
        )

    def alpha(self, phi):
        a, _, b, _ = self._terms(phi)
        return -a / b

    def turning(self, phi):
        a, da, b, db = self._terms(phi)
        return da * b - a * db

    def at(self, phi):
        """alpha and the forces if the node slips in that direction, else None."""
        alpha, d = self.alpha(phi), np.array([np.cos(phi), np.sin(phi)])
        F = self.F if self.load else alpha
        g = self.g + (alpha * self.slope if self.load else 0.0)
        n = g[0] / (self.S[0, 0] + F * self.S[0, 1:] @ d)
        v = g[1:] - n * (self.S[1:, 0] + F * self.S[1:, 1:] @ d)
        return (alpha, n, n * F * d) if n > 0 and v @ d > 0 and F > 0 else None

    def folds(self):
        """Angles at which alpha turns back on the slipping branch."""
        grid = np.linspace(-np.pi, np.pi, 2001)
        values = self.turning(grid)
        found = []
        for k in np.flatnonzero(values[:-1] * values[1:] < 0):
            phi = brentq(self.turning, grid[k], grid[k + 1], xtol=1e-15)
            if abs(self.alpha(phi)) < 50 and self.at(phi) is not None:
                found.append(phi)
        return found
