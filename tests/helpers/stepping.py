"""Motions beside an equilibrium with unilateral contact and Coulomb's friction in velocities, by time stepping.

The trapezoidal rule for the body, with the law of contact and friction for the velocities at the end of every step and
the mean forces of the step (as Moreau and Jean do). It is solved exactly: of all statuses those that fit. Shares no
code with the package.
"""

import itertools

import numpy as np

#: A node (theory, (15.2)) that slips and sticks in turn, n and t first.
STICK_SLIP_F = 2.8
STICK_SLIP_A = np.array([[5.4, 1.8, 0.1, -5.2], [1.8, 4.3, -2.3, 0.4], [0.1, -2.3, 3.9, -5.9], [-5.2, 0.4, -5.9, 16.6]])


class Stepper:
    """M u'' + A u + B'lambda = f, for the deviations d and e of u and u' from an equilibrium.

    Parameters
    ----------
    gap : (p,) array
        Distances of the nodes to the obstacle at the equilibrium, zero in contact.
    forces : (2p,) array
        Contact forces of the equilibrium.
    """

    def __init__(self, A, M, Bn, Bt, F, gap, forces, step):
        self.A, self.M, self.Bn, self.Bt, self.F, self.gap, self.h = A, M, Bn, Bt, F, gap, step
        self.B, self.p, self.forces = np.vstack([Bn, Bt]), len(Bn), forces
        inverse = np.linalg.inv(M + 0.25 * step**2 * A)
        self.free = inverse @ (M - 0.25 * step**2 * A), -step * inverse @ A, step * inverse @ self.B.T
        self.last = None

    def advance(self, d, e):
        """Deviations a step later, with the statuses."""
        moving, stiff, pushed = self.free
        ahead = moving @ e + stiff @ d + pushed @ self.forces
        touches = self.Bn @ d >= self.gap - 1e-14
        choices = [("stick", "plus", "minus", "open") if touches[i] else ("open",) for i in range(self.p)]
        first = [self.last] if self.last else []
        for statuses in (*first, *itertools.product(*choices)):
            if statuses is None or any(s != "open" and not t for s, t in zip(statuses, touches, strict=True)):
                continue
            velocity = self._fitting(statuses, touches, ahead)
            if velocity is not None:
                self.last = statuses
                return d + 0.5 * self.h * (e + velocity), velocity, statuses
        raise AssertionError("no statuses fit")

    def _fitting(self, statuses, touches, ahead):
        """The velocity at the end of the step with these statuses, if they fit."""
        p, rows, columns = self.p, [], []
        unit = np.eye(2 * p)
        for i, status in enumerate(statuses):
            if status == "open":
                continue
            rows.append(i)
            side = {"plus": self.F[i], "minus": -self.F[i], "stick": 0.0}[status]
            columns.append(unit[i] + side * unit[p + i])
            if status == "stick":
                rows.append(p + i)
                columns.append(unit[p + i])
        forces = np.zeros(2 * p)
        if rows:
            C = np.array(columns).T
            through = self.B[rows] @ self.free[2] @ C
            forces = C @ np.linalg.solve(through, self.B[rows] @ ahead)
        velocity = ahead - self.free[2] @ forces
        w = self.B @ velocity
        slack, crawl = 1e-12 * np.max(np.abs(forces), initial=1.0), 1e-13 * np.max(np.abs(velocity))
        for i, status in enumerate(statuses):
            if status == "open":
                if touches[i] and w[i] > crawl:
                    return None
                continue
            if forces[i] < -slack:
                return None
            if status == "stick":
                if abs(forces[p + i]) > self.F[i] * forces[i] + slack:
                    return None
            elif (w[p + i] if status == "plus" else -w[p + i]) < -crawl:
                return None
        return velocity


def beside_a_root(A, M, Bn, Bt, F, kinds, signs, step):
    """A stepper at an equilibrium of the given statuses: forces of one, and friction at its limit or none."""
    loaded = np.array([kind in ("stuck", "limit") for kind in kinds], dtype=float)
    along = np.array([kind == "limit" for kind in kinds]) * signs * F
    gap = np.array([1.0 if kind == "open" else 0.0 for kind in kinds])
    return Stepper(A, M, Bn, Bt, F, gap, np.concatenate([loaded, along]), step)


def growth(stepper, d, e, steps):
    """Sizes of the deviations over time, and their directions at the end and half way."""
    sizes, way = [np.linalg.norm(d)], []
    for k in range(steps):
        d, e, _ = stepper.advance(d, e)
        sizes.append(np.linalg.norm(d))
        if k in (steps // 2, steps - 1):
            way.append(d / sizes[-1])
    return np.array(sizes), way
