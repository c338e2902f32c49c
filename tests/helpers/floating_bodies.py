"""Bodies in the plane that nothing holds, pushed along a table or held by weak springs, and what solves a problem."""

import numpy as np
import scipy.sparse as sp
from helpers.floating_oracle import block_on_table

from enumsol import ContactProblem


def pushed_block(cells=2, press=1.0, **options):
    """A block on a table that is pushed: it slides at alpha = 1 and at -1."""
    rest, push = (block_on_table(cells, press=press, push=value, **options) for value in (0.0, 1.0))
    return rest.replace(load_slope=push.f - rest.f)


def held_by_springs(problem, stiffness):
    """The same body with a spring at every degree of freedom, and without rigid modes."""
    A = sp.csc_array(problem.A + stiffness * sp.eye_array(problem.n))
    data = {"friction": problem.friction, "friction_slope": problem.friction_slope, "load_slope": problem.load_slope}
    return ContactProblem(A, problem.Bn, problem.Bt, problem.f, **data)


def violation(problem, alpha, u, lambda_n, lambda_t, F=None, bound=None):
    """How far displacements and forces are from solving a problem, in 2D or 3D, from A, B and f as they are."""
    p = problem.p
    forces = np.concatenate([lambda_n, np.asarray(lambda_t).ravel(order="F")])
    w = problem.contact_rows @ u
    u_n, u_t = w[:p] - problem.gap, w[p:].reshape(-1, p).T - problem.slip_offset.reshape(p, -1)
    F = problem.friction_at(alpha).reshape(p, -1) if F is None else F
    bound = lambda_n if bound is None else bound
    force = np.asarray(lambda_t).reshape(u_t.shape)
    share = np.linalg.norm(np.divide(force, F, out=np.zeros_like(force), where=F > 0), axis=1)
    # friction force takes as much power as it can
    power = np.sum(force * u_t, axis=1) - np.linalg.norm(F * u_t, axis=1) * bound
    rest = problem.A @ u + problem.contact_rows.T @ forces - problem.load_at(alpha)
    found = rest, np.maximum(u_n, 0), np.minimum(lambda_n, 0), u_n * lambda_n, power, np.where(F > 0, 0, force)
    return max(*(np.max(np.abs(part)) for part in found), np.max(share - bound))
