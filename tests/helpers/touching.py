"""Problems with grazing and unloaded contact nodes, at whose roots very many selections hold."""

import numpy as np
from generators import fe_compliance, from_condensed, integer_problem, planted_load, random_load, random_problem

from enumsol import ContactProblem


def beside_a_loaded_node(k, *, slides, grazing, friction=0.5):
    """A chain of k + 1 nodes in small integers; one root: the first node sticks or slides, the others touch unloaded.

    grazing : the others are displaced along the foundation, so that open and slip forward hold there; else w = 0, and
        every status holds.
    """
    p = k + 1
    links = np.diag(np.full(p, 4.0)) - np.eye(p, k=1) - np.eye(p, k=-1)
    A = np.kron([[1.0, 0.0], [0.0, 1.0]], links) + np.kron([[0.0, 1.0], [1.0, 0.0]], np.eye(p))
    u, force = np.zeros(2 * p), np.zeros(2 * p)
    force[[0, p]] = 2.0, 2.0 * friction if slides else friction
    u[p] = float(slides)
    u[p + 1 :] = float(grazing)
    eye = np.eye(2 * p)
    return ContactProblem(A, eye[:p], eye[p:], A @ u + force, friction=friction)


def touching_problem(rng, p, *, inner=0):
    """Small quarters with a planted root at which nodes touch without load, stick at their limit or just begin to slip.

    inner : degrees of freedom that are not in contact and feel nothing of it
    """
    X = rng.integers(-1, 2, size=(2 * p, 2 * p))
    A = X @ X.T * 0.25 + np.eye(2 * p) * int(rng.integers(1, 4))
    F = rng.integers(0, 5, size=p) / 4
    n = rng.integers(0, 2, size=p) * rng.integers(0, 3, size=p)
    t = F * n * rng.integers(-2, 3, size=p) / 2
    v = np.where(np.abs(t) == F * n, np.sign(t) * rng.integers(0, 2, size=p), 0)
    v = np.where(n == 0, rng.integers(-1, 2, size=p) * rng.integers(0, 2, size=p), v)
    w_n = np.where(n > 0, 0, -rng.integers(0, 2, size=p) * rng.integers(0, 2, size=p))
    f = A @ np.concatenate([w_n, v]) + np.concatenate([n, t])
    whole = np.eye(2 * p + inner)
    whole[: 2 * p, : 2 * p] = A
    eye = np.eye(2 * p, 2 * p + inner)
    return ContactProblem(whole, eye[:p], eye[p:], np.concatenate([f, np.zeros(inner)]), friction=F)


def row_of_discs(count, *, weights=(2.0,), pull=3.0, friction=0.9, stiffness=64.0):
    """Discs of radius one that touch in a row on a floor, one time step: the first is pulled away, the others rest.

    Contacts are those with the floor, then those between neighbours; each has a spring in both directions, so that S is
    positive definite. Between equal discs that rest w = lambda = 0 exactly; of unequal ones one slides past the other.
    """
    bodies, p = 3 * count, 2 * count - 1
    rows = np.zeros((2 * p, bodies))
    for i in range(count):
        rows[i, 3 * i + 1] = -1.0
        rows[p + i, [3 * i, 3 * i + 2]] = 1.0
    for i in range(count - 1):
        rows[count + i, [3 * i, 3 * i + 3]] = 1.0, -1.0
        rows[p + count + i, [3 * i + 1, 3 * i + 2, 3 * i + 4, 3 * i + 5]] = 1.0, 1.0, -1.0, 1.0
    mass = np.diag(np.tile([1.0, 1.0, 0.5], count))
    springs = stiffness * np.eye(2 * p)
    A = np.block([[mass + stiffness * rows.T @ rows, -stiffness * rows.T], [-stiffness * rows, springs]])
    f = np.zeros(bodies + 2 * p)
    f[1:bodies:3] = -np.resize(weights, count)
    f[0] = -pull
    B = np.hstack([np.zeros((2 * p, bodies)), np.eye(2 * p)])
    return ContactProblem(A, B[:p], B[p:], f, friction=friction)


def problem_of_any_kind(rng, p, kind, friction, *, planted=True):
    """Integers full of coincidences, nodes that touch, generic problems, and bodies; some with a planted root."""
    if kind < 3:
        return (integer_problem, touching_problem, random_problem)[kind](rng, p)
    S, F = fe_compliance(rng, p), rng.uniform(*friction, size=p)
    g = planted_load(rng, S, F) if planted else None
    return from_condensed(S, random_load(rng, p) if g is None else g, F)
