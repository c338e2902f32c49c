"""Random data of the linearized motion at an equilibrium, and what the package asks of them."""

import numpy as np
import scipy.sparse as sp

from enumsol.arithmetic.balls import Ball
from enumsol.condensation.dynamic import DynamicStiffness
from enumsol.trusted.running_away import Motions, Touching


def random_motion(rng, touching=False, massless=False):
    """A, M, Bn, Bt, F, kinds and signs, with at most five contact nodes; M is one, diagonal or full."""
    p = int(rng.integers(1, 6))
    n = 2 * p + int(rng.integers(1 if massless else 0, 4))
    X = rng.normal(size=(n, n))
    A = X @ X.T + 10.0 ** rng.uniform(-2, 1) * np.eye(n)
    rows = rng.normal(size=(2 * p, n)) if rng.random() < 0.5 and not massless else np.eye(n)[: 2 * p]
    Y = rng.normal(size=(n, n))
    M = [np.eye(n), np.diag(10.0 ** rng.uniform(-1, 1, n)), Y @ Y.T + 0.1 * np.eye(n)][rng.integers(3)]
    if massless:
        # the contact rows alone have mass, none of them, some nodes, or others along their tangents only
        some, nodes = rng.random(p) < 0.5, np.arange(p)
        still = [np.arange(2 * p, n), np.arange(2 * p), np.append(nodes[some], p + nodes[some]), nodes[some]][
            rng.integers(4)
        ]
        M[still] = M[:, still] = 0.0
    F = rng.choice([0.0, 0.3, 0.7, 1.5, 3.0], size=p, p=[0.05, 0.25, 0.25, 0.25, 0.2])
    names = ["open", "stuck", "limit", "limit", *(["touching"] if touching else [])]
    kinds = [str(rng.choice(names)) for _ in range(p)]
    kinds = ["stuck" if kind == "limit" and f == 0 else kind for kind, f in zip(kinds, F, strict=True)]
    if "limit" not in kinds:
        kinds[0], F[0] = "limit", 0.7
    return A, M, rows[:p], rows[p:], F, kinds, rng.choice([-1.0, 1.0], size=p)


def setting(A, M, Bn, Bt, F, kinds, signs, unsure=()):
    """The dynamic stiffness and the motions made of them (theory, section 15.2)."""
    p, rows, place = len(Bn), [], {}
    for name, B in (("n", Bn), ("t", Bt)):
        for i in range(p):
            if kinds[i] != "open" and (name == "n" or F[i] > 0):
                place[name, i] = len(rows)
                rows.append(B[i])
    columns, slopes, signed, touching = [], [], [], []
    limits = [i for i in range(p) if kinds[i] == "limit"]

    def column(*entries):
        of = np.zeros(len(rows))
        for at, value in entries:
            of[place[at]] = value
        return of

    for i in limits:
        columns.append(column((("t", i), signs[i])))
        slopes.append(column((("t", i), signs[i]), (("n", i), -F[i])))
    for i in range(p):
        if kinds[i] == "touching":
            start = len(columns)
            columns.append(column((("n", i), -1.0)))
            if F[i] > 0:
                columns.append(column((("t", i), 1.0)))
            touching.append(Touching(start, tuple(range(start + 1, len(columns))), Ball.exact(np.array(F[i]))))
    leaves = {node.leaves for node in touching}
    signed = np.array([k < len(limits) or k in leaves for k in range(len(columns))], dtype=bool)
    moves, leans = (Ball.exact(np.array(of).reshape(-1, len(rows)).T.copy()) for of in (columns, slopes))
    motions = Motions(moves, leans, signed, tuple(touching), unsure)
    sparse = sp.csc_array(A), sp.csc_array(M), sp.csr_array(np.array(rows))
    return DynamicStiffness(*sparse), motions


def random_motion_in_space(rng):
    """A, M, Bn, W, kinds and directions as `growing_in_space` takes them, with one node that touches, and F (p, 2)."""
    p = int(rng.integers(1, 4))
    n = 3 * p + int(rng.integers(0, 3))
    X = rng.normal(size=(n, n))
    A = X @ X.T + 10.0 ** rng.uniform(-2, 1) * np.eye(n)
    rows = rng.normal(size=(3 * p, n)) if rng.random() < 0.5 else np.eye(n)[: 3 * p]
    Y = rng.normal(size=(n, n))
    M = [np.eye(n), np.diag(10.0 ** rng.uniform(-1, 1, n)), Y @ Y.T + 0.1 * np.eye(n)][rng.integers(3)]
    F = rng.choice([0.3, 0.7, 1.5, 3.0], size=(p, 2))
    kinds = ["touching", *(str(rng.choice(["open", "stuck", "limit", "limit"])) for _ in range(p - 1))]
    angle = rng.uniform(-np.pi, np.pi, p)
    W = np.stack([rows[p : 2 * p], rows[2 * p :]], axis=1) * F[:, :, None]
    return A, M, rows[:p], W, kinds, np.stack([np.cos(angle), np.sin(angle)], axis=1), F


def setting_in_space(A, M, Bn, W, kinds, directions, F):
    """The dynamic stiffness and the motions made of them; tangential rows are those without F."""
    touch = [i for i, kind in enumerate(kinds) if kind != "open"]
    rows = [*Bn[touch], *(W[i] / F[i][:, None] for i in touch)]
    place = {i: at for at, i in enumerate(touch)}
    size, columns, slopes, touching = 3 * len(touch), [], [], []
    for i in (i for i in touch if kinds[i] == "limit"):
        of = np.zeros(size)
        of[len(touch) + 2 * place[i] :][:2] = directions[i] / F[i]
        columns.append(of)
        slopes.append(of - np.eye(size)[place[i]])
    for i in (i for i in touch if kinds[i] == "touching"):
        start, own = len(columns), len(touch) + 2 * place[i]
        columns += [-np.eye(size)[place[i]], *np.eye(size)[own : own + 2]]
        touching.append(Touching(start, (start + 1, start + 2), Ball.exact(np.array(min(F[i])))))
    signed = np.ones(len(columns), dtype=bool)
    for node in touching:
        signed[list(node.slides)] = False
    moves, leans = (Ball.exact(np.array(of).reshape(-1, size).T.copy()) for of in (columns, slopes))
    sparse = sp.csc_array(A), sp.csc_array(M), sp.csr_array(np.vstack(rows))
    return DynamicStiffness(*sparse), Motions(moves, leans, signed, tuple(touching))
