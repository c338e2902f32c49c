"""Small problems in 3D, and the equations of a solution written out by hand."""

import numpy as np

from enumsol import ContactProblem3D


def from_compliance(S, g, friction, **more):
    """A problem whose condensed data are S (3p, 3p) and g (3p,); rows are all normals, then both tangents."""
    A = np.linalg.inv(S)
    rows = np.eye(len(S))
    p = len(S) // 3
    return ContactProblem3D(0.5 * (A + A.T), rows[:p], rows[p : 2 * p], rows[2 * p :], A @ g, friction=friction, **more)


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
