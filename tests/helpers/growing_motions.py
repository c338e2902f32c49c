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
