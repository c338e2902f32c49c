"""All motions that grow at an equilibrium, by all sets of nodes that slide, in floats: an independent judge.

Shares no code with the package: for every set of sliding nodes and every way in which nodes that touch without force
move, an eigenvalue problem of the whole body, and then the signs.
"""

import itertools

import numpy as np
import scipy.linalg


def kernel(rows, n):
    """An orthonormal basis of what given rows do not see, (n, k)."""
    if not len(rows):
        return np.eye(n)
    Q, _ = scipy.linalg.qr(rows.T)
    return Q[:, len(rows) :]


def growing_motions(A, M, Bn, Bt, F, kinds, signs):
    """mu, v and who slides, of every motion that grows.

    Parameters
    ----------
    kinds : sequence of "open", "stuck", "limit" or "touching"
    signs : sequence of +-1
        The way of friction at nodes at their limit.
    """
    n, p = len(A), len(Bn)
    held = [i for i in range(p) if kinds[i] in ("stuck", "limit")]
    limits = [i for i in range(p) if kinds[i] == "limit"]
    touch = [i for i in range(p) if kinds[i] == "touching"]
    found = []
    for count in range(len(limits) + 1):
        for sliding in itertools.combinations(limits, count):
            for ways in itertools.product(["open", "stick", "plus", "minus"], repeat=len(touch)):
                way = dict(zip(touch, ways, strict=True))
                slips = {j: signs[j] for j in sliding}
                slips |= {j: 1 if way[j] == "plus" else -1 for j in touch if way[j] in ("plus", "minus")}
                contact = held + [j for j in touch if way[j] != "open"]
                stick = [i for i in contact if i not in slips and F[i] > 0]
                fixed = np.vstack([Bn[contact].reshape(-1, n), Bt[stick].reshape(-1, n)])
                lean = [Bn[i] + (slips[i] * F[i] * Bt[i] if i in slips else 0) for i in contact]
                tests = np.vstack([np.reshape(lean, (-1, n)), Bt[stick].reshape(-1, n)])
                Z, Y = kernel(fixed, n), kernel(tests, n)
                if not Z.shape[1] or (not slips and "open" not in ways):
                    continue
                values, vectors = scipy.linalg.eig(-Y.T @ A @ Z, Y.T @ M @ Z)
                for at in np.flatnonzero(np.isfinite(values)):
                    mu = values[at]
                    if abs(mu.imag) > 1e-9 * abs(mu) or not mu.real > 1e-9:
                        continue
                    v = Z @ vectors[:, at].real
                    if fits(A + mu.real * M, Bn, Bt, F, v / np.max(np.abs(v)), contact, slips, way, limits, signs):
                        found.append((float(mu.real), v, sliding))
    return found


def fits(pencil, Bn, Bt, F, v, contact, slips, way, limits, signs):
    """Whether v or -v keeps all signs, up to rounding."""
    rubbing = [i for i in contact if F[i] > 0]
    rows = np.vstack([Bn[contact].reshape(-1, len(v)), Bt[rubbing].reshape(-1, len(v))])
    forces, *_ = np.linalg.lstsq(rows.T, -pencil @ v, rcond=None)
    normal = dict(zip(contact, forces, strict=False))
    along = dict(zip(rubbing, forces[len(contact) :], strict=True))
    slack = 1e-9 * max(1.0, np.max(np.abs(forces), initial=0.0))

    def forward(side):
        if any(side * slip * (Bt[j] @ v) < -1e-9 for j, slip in slips.items()):
            return False
        if any(side * (F[i] * normal[i] - signs[i] * along[i]) < -slack for i in limits if i not in slips):
            return False
        for i, how in way.items():
            if how == "open":
                if side * (Bn[i] @ v) > 1e-9:
                    return False
            elif side * normal[i] < -slack or F[i] * side * normal[i] - abs(along.get(i, 0.0)) < -slack:
                return False
        return True

    return forward(1) or forward(-1)


def of_a_root(problem, root, mass):
    """All motions that grow at a root of a problem in 2D or 3D, the latter to first order and if no node touches."""
    p, A, M, rows = problem.p, problem.A.toarray(), np.asarray(mass), problem.contact_rows.toarray()
    F = np.array([float(x) for x in np.ravel(problem.friction_at(root.alpha))]).reshape(p, -1)
    kinds, signs = [], []
    for i, active in enumerate(root.active):
        names = {status.name for status in active}
        touches, rubs = "OPEN" in names, np.any(F[i] > 0)
        limit = rubs and names != {"STICK"}
        kinds.append("open" if names == {"OPEN"} else "touching" if touches else "limit" if limit else "stuck")
        signs.append(1.0 if "SLIP_PLUS" in names else -1.0)
    if F.shape[1] == 1:
        return growing_motions(A, M, rows[:p], rows[p:], F[:, 0], kinds, signs)
    along, across = np.zeros((p, problem.n)), []
    for i in range(p):
        assert kinds[i] != "touching"
        W, own = F[i][:, None] * rows[p + i :: p][:2], F[i] > 0
        if kinds[i] == "limit":
            d = np.divide(root.lambda_t[i], F[i], out=np.zeros(2), where=own)
            d /= np.linalg.norm(d)
            along[i] = d @ W
            across += [np.array([-d[1], d[0]]) @ W] if own.all() else []
        elif kinds[i] == "stuck":
            across += list(W[own])
    Z = kernel(np.reshape(across, (-1, problem.n)), problem.n)
    # nodes that stick have no tangential row left, and those at their limit one, along the force
    share = [1.0 if kind == "limit" else 0.0 for kind in kinds]
    found = growing_motions(Z.T @ A @ Z, Z.T @ M @ Z, rows[:p] @ Z, along @ Z, np.array(share), kinds, [1.0] * p)
    return [(mu, Z @ v, sliding) for mu, v, sliding in found]


# -- in 3D, with nodes that touch --------------------------------------------------------------------------------------

#: Directions of slip that are looked at, of a node that touches and begins to slip.
ANGLES = 240


def growing_in_space(A, M, Bn, W, kinds, directions):
    """mu, v and who slides, of every motion that grows in 3D with at most one node that touches without force.

    Parameters
    ----------
    W : (p, 2, n) array
        Tangential rows times F along their axes: forces conjugate to them are lambda_t / F.
    directions : (p, 2) array
        Of lambda_t / F at nodes at their limit, unit vectors.
    """
    limits = [i for i, kind in enumerate(kinds) if kind == "limit"]
    touching = [i for i, kind in enumerate(kinds) if kind == "touching"]
    assert len(touching) <= 1
    found = []
    for count in range(len(limits) + 1):
        for sliding in itertools.combinations(limits, count):
            slips = {i: directions[i] for i in sliding}
            for way in ("open", "stick", "slip") if touching else (None,):
                case = Case(A, M, Bn, W, kinds, directions, slips, way, touching)
                if slips or way in ("open", "slip"):
                    found += [(mu, v, sliding) for mu, v in (case.beginning() if way == "slip" else case.motions())]
    return found


class Case:
    """What every node does in 3D: some slide in given directions, and the one that touches is open, sticks or slips."""

    def __init__(self, A, M, Bn, W, kinds, directions, slips, way, touching):
        self.A, self.M, self.Bn, self.W, self.kinds, self.directions = A, M, Bn, W, kinds, directions
        self.slips, self.way, self.touching = slips, way, touching
        self.contact = [i for i, kind in enumerate(kinds) if kind not in ("open", "touching")]
        self.contact += touching if way in ("stick", "slip") else []

    def eigen(self, slips):
        """mu and v of all motions in which the others stick, whatever their signs, and their forces y_n and y_t / F."""
        n, fixed, tests = len(self.A), [*self.Bn[self.contact]], []
        for i in self.contact:
            if i in slips:
                d = slips[i]
                across = np.array([-d[1], d[0]]) @ self.W[i]
                fixed.append(across)
                tests += [self.Bn[i] + d @ self.W[i], across]
            else:
                fixed += [*self.W[i]]
                tests += [self.Bn[i], *self.W[i]]
        Z, Y = (kernel(np.reshape(rows, (-1, n)), n) for rows in (fixed, tests))
        if not Z.shape[1]:
            return
        rows = np.vstack([self.Bn[self.contact], *(self.W[i] for i in self.contact)]).reshape(-1, n)
        values, vectors = scipy.linalg.eig(-Y.T @ self.A @ Z, Y.T @ self.M @ Z)
        for at in np.flatnonzero(np.isfinite(values)):
            mu = values[at]
            if abs(mu.imag) > 1e-9 * abs(mu) or not mu.real > 1e-9:
                continue
            v = Z @ vectors[:, at].real
            v /= np.max(np.abs(v))
            forces, *_ = np.linalg.lstsq(rows.T, -(self.A + mu.real * self.M) @ v, rcond=None)
            count = len(self.contact)
            normal = dict(zip(self.contact, forces[:count], strict=True))
            yield float(mu.real), v, normal, dict(zip(self.contact, forces[count:].reshape(-1, 2), strict=True))

    def motions(self, slips=None):
        """mu and v of those whose signs fit."""
        slips = self.slips if slips is None else slips
        return [(mu, v) for mu, v, *y in self.eigen(slips) if self.fits(v, slips, *y, 1) or self.fits(v, slips, *y, -1)]

    def fits(self, v, slips, normal, along, side):
        slack = 1e-7 * max(1.0, *map(abs, normal.values())) if normal else 1e-7
        if any(side * (d @ (self.W[i] @ v)) < -1e-9 for i, d in slips.items()):
            return False
        for i, kind in enumerate(self.kinds):
            if kind == "limit" and i not in slips and side * (normal[i] - self.directions[i] @ along[i]) < -slack:
                return False
        for i in self.touching:
            if self.way == "open":
                if side * (self.Bn[i] @ v) > 1e-9:
                    return False
            elif side * normal[i] < -slack or side * normal[i] - np.linalg.norm(along[i]) < -slack:
                return False
        return True

    def beginning(self):
        """The same where the node that touches slips: in a direction across which there is no force."""
        [node] = self.touching

        def values(angle):
            """mu and the force across the direction, for a slip by one."""
            d = np.array([np.cos(angle), np.sin(angle)])
            known = []
            for mu, v, _, along in self.eigen({**self.slips, node: d}):
                moved = d @ (self.W[node] @ v)
                if abs(moved) > 1e-9:
                    known.append((mu, (np.array([-d[1], d[0]]) @ along[node]) / moved))
            return sorted(known)

        angles = np.linspace(0, 2 * np.pi, ANGLES + 1)
        before = values(angles[0])
        for low, high in itertools.pairwise(angles):
            after = values(high)
            for k, (one, other) in enumerate(zip(before, after, strict=False)):
                if len(before) == len(after) and one[1] * other[1] < 0 and abs(one[1] - other[1]) < 1e3:
                    angle = halved(lambda angle, k=k: values(angle)[k][1], low, high)
                    d = np.array([np.cos(angle), np.sin(angle)])
                    yield from self.motions({**self.slips, node: d})
            before = after


def halved(function, low, high):
    """A place at which a function changes its sign."""
    first = function(low)
    for _ in range(50):
        middle = 0.5 * (low + high)
        try:
            low, high = (middle, high) if function(middle) * first > 0 else (low, middle)
        except IndexError:
            break
    return 0.5 * (low + high)
