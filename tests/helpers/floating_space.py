"""Bodies in 3D that nothing holds, made around a solution: one is known from the start."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

import enumsol
from enumsol import fem
from enumsol.search.space.space_search import SpaceSolvers

#: Solutions farther away are beyond the bound of the rigid displacement.
_FAR = 1e4
OPEN, STICK, SLIP = "open", "stick", "slip"


@dataclass
class KnownBody:
    """A problem and the numbers of one of its solutions."""

    problem: enumsol.ContactProblem3D
    u: np.ndarray
    lambda_n: np.ndarray
    lambda_t: np.ndarray


def known_body(seed, p=None, r=None, frictions=(0.3, 1.0), plane=False):
    """A random body with p contact nodes and r rigid modes, whose gap, slip offset and load fit a random solution.

    ``plane``: friction along the first axis only, so that directions of slip are no unknowns.
    """
    rng = np.random.default_rng(seed)
    p = p or int(rng.integers(1, 4))
    r = r or int(rng.integers(1, 4))
    n = 3 * p + int(rng.integers(0, 3))
    N = np.linalg.qr(rng.normal(size=(n, r)))[0]
    rest = np.linalg.qr(np.hstack([N, rng.normal(size=(n, n - r))]))[0][:, r:]
    A = (rest * rng.uniform(0.5, 2.0, n - r)) @ rest.T
    rows = np.eye(n)[: 3 * p] if rng.random() < 0.5 else np.linalg.qr(rng.normal(size=(n, 3 * p)))[0].T
    Bn, Bt1, Bt2 = rows[:p], rows[p : 2 * p], rows[2 * p :]
    F = rng.choice(frictions, (p, 2))
    if plane:
        F[:, 1] = 0.0
    u = rng.normal(size=n)
    lambda_n, lambda_t, gap, offset = np.zeros(p), np.zeros((p, 2)), np.zeros(p), np.zeros((p, 2))
    for i in range(p):
        slip = np.zeros(2)
        gap[i] = Bn[i] @ u
        kind = rng.choice([OPEN, STICK, STICK, SLIP])
        if kind == OPEN and i:
            gap[i] += rng.uniform(0.2, 1.0)
            slip = rng.normal(size=2)
        else:
            lambda_n[i] = rng.uniform(0.5, 2.0)
            turn = rng.uniform(0, 2 * np.pi)
            tau = lambda_n[i] * np.array([np.cos(turn), np.sin(turn)])
            if plane:
                tau = lambda_n[i] * np.array([rng.choice([-1.0, 1.0]), 0.0])
            if kind in (STICK, OPEN):
                tau *= rng.uniform(0.1, 0.8)
            else:
                size = rng.uniform(0.2, 1.0)
                slip = size * np.divide(tau, F[i], out=np.zeros(2), where=F[i] > 0)
            if plane:
                slip[1] = rng.normal()
            lambda_t[i] = F[i] * tau
        offset[i] = [Bt1[i] @ u, Bt2[i] @ u] - slip
    f = A @ u + Bn.T @ lambda_n + Bt1.T @ lambda_t[:, 0] + Bt2.T @ lambda_t[:, 1]
    data = {"gap": gap, "friction": (F[:, 0], F[:, 1]), "slip_offset": offset, "max_rigid_displacement": 30.0}
    problem = enumsol.ContactProblem3D(0.5 * (A + A.T), Bn, Bt1, Bt2, f, rigid_modes=N, **data)
    return KnownBody(problem, u, lambda_n, lambda_t)


def on_weak_springs(problem, stiffness):
    """The same body held by springs at all degrees of freedom, which act on its rigid displacements alone."""
    N = problem.rigid_modes
    A = problem.A.toarray() + stiffness * N @ N.T
    return problem.replace(A=sp.csc_array(0.5 * (A + A.T)), rigid_modes=None, max_rigid_displacement=None)


def lying_block(cells, guided, friction, push=0.0):
    """A cube of so many cells along its edges, pressed onto a floor; ``guided``: its roof moves upwards only."""
    held = {"displacement": {"top": (0, 0, "free")}} if guided else {}
    load = {"load": {"right": (-push, 0.2 * push, 0.0)}} if push else {}
    return fem.mesh_problem(
        fem.box(cells, cells, 2), young=1000.0, poisson=0.3, contact="bottom", pressure={"top": 1.0},
        friction=friction, max_rigid_displacement="auto", **held, **load,
    )  # fmt: skip


def newton_solutions(problem, starts, seed):
    """Solutions (u, lambda_n, tau) at alpha = 0 that Newton's method finds from random starts; tau is lambda_t / F."""
    rng, A, p, n = np.random.default_rng(seed), problem.A.toarray(), problem.p, problem.n
    B = np.stack([M.toarray() for M in (problem.Bn, problem.Bt1, problem.Bt2)], axis=1)
    F = np.column_stack([np.ones(p), *problem.friction])
    B, offset = B * F[:, :, None], np.column_stack([problem.gap, problem.slip_offset]) * F
    found = []

    def residual(x):
        u, y = x[:n], x[n:].reshape(p, 3)
        w = B @ u - offset
        at, D = y + w, np.zeros((p, 3, 3))
        most = np.maximum(at[:, 0], 0.0)
        projected = np.column_stack([most, at[:, 1:]])
        D[:, 0, 0] = at[:, 0] > 0
        for i, z in enumerate(at[:, 1:]):
            length = np.linalg.norm(z)
            D[i, 1:, 1:] = np.eye(2)
            if length > most[i]:
                d = z / length
                projected[i, 1:] = most[i] * d
                D[i, 1:, 1:] = most[i] / length * (np.eye(2) - np.outer(d, d))
                D[i, 1:, 0] = d * D[i, 0, 0]
        J = np.zeros((n + 3 * p,) * 2)
        J[:n, :n], J[:n, n:] = A, B.reshape(3 * p, n).T
        J[n:, :n] = -np.einsum("iab,ibn->ian", D, B).reshape(3 * p, n)
        J[n:, n:] = np.eye(3 * p)
        for i in range(p):
            J[n + 3 * i : n + 3 * i + 3, n + 3 * i : n + 3 * i + 3] -= D[i]
        return np.append(A @ u + B.reshape(3 * p, n).T @ y.ravel() - problem.f, (y - projected).ravel()), J

    for _ in range(starts):
        x = np.append(3.0 * rng.normal(size=n), rng.normal(size=3 * p))
        for _ in range(25):
            R, J = residual(x)
            size = np.linalg.norm(R)
            if np.linalg.norm(x) > _FAR:  # on its way to infinity, as at the limit of sliding
                break
            if size < 1e-11:
                if not any(np.linalg.norm(x - other) < 1e-6 for other in found):
                    found.append(x)
                break
            step = np.linalg.lstsq(J, -R, rcond=None)[0]
            size = next(
                (s for s in 0.5 ** np.arange(8) if np.linalg.norm(residual(x + s * step)[0]) < np.linalg.norm(R)), 1.0
            )
            x = x + size * step
    return [(x[:n], x[n:].reshape(p, 3)[:, 0], x[n:].reshape(p, 3)[:, 1:], B @ x[:n] - offset) for x in found]


def over_alpha(seed, size=0.3, **options):
    """Such a body whose load varies with alpha; that solution is one at alpha = 0."""
    problem = known_body(seed, **options).problem
    return problem.replace(load_slope=size * np.random.default_rng(seed + 10**6).normal(size=problem.n))


def plane_over_alpha(seed, **options):
    """A body in the plane that nothing holds, over alpha."""
    given = over_alpha(seed, plane=True, **options)
    data = {"gap": given.gap, "slip_offset": given.slip_offset[:, 0], "load_slope": given.load_slope}
    modes = {"rigid_modes": given.rigid_modes, "max_rigid_displacement": given.max_rigid_displacement}
    return enumsol.ContactProblem(
        given.A, given.Bn, given.Bt1, given.f, friction=np.array(given.friction)[0], **data, **modes
    )


def floating_in_space(problem):
    """Such a problem written in 3D: every node has a second tangent with a stiffness of its own, without load."""
    p, n, r = problem.p, problem.n, problem.modes.r
    F, _ = problem.affine_friction
    more, none = sp.csc_array((p, p)), np.zeros(p)
    A = sp.block_diag([problem.A, sp.eye_array(p)])
    rows = [sp.hstack([part, more]) for part in (problem.Bn, problem.Bt)]
    data = {"gap": problem.gap, "slip_offset": np.column_stack([problem.slip_offset, none])}
    return enumsol.ContactProblem3D(
        sp.csc_array(A),
        *(sp.csc_array(part) for part in rows),
        sp.csc_array(sp.hstack([sp.csc_array((p, n)), sp.eye_array(p)])),
        np.append(problem.f, none),
        friction=(F, F),
        load_slope=np.append(problem.load_slope, none),
        rigid_modes=np.vstack([problem.rigid_modes, np.zeros((p, r))]),
        max_rigid_displacement=problem.max_rigid_displacement,
        **data,
    )


def body_with_reference(seed):
    """A random body, its scaled system, and the form of a root of it if there is one."""
    rng = np.random.default_rng([seed, 47])
    p = int(rng.integers(1, 4))
    most = 3 * p if p == 1 else 6
    frictions = ((0.3, 1.0), (1.0, 3.0), (3.0, 8.0))[seed % 3]
    problem = known_body(seed, p, int(rng.integers(1, most + 1)), frictions=frictions).problem
    solvers = SpaceSolvers(problem, 0, "verified")
    leaf = solvers.known_root
    return problem, solvers.system, None if leaf is None else solvers.certifier(None).reference(leaf)


def two_cubes(k, push=(0.1, 0.0), friction=0.3, **more):
    """A cube of k^3 cells, held by nothing, pressed on another one and pushed at its side: six modes."""
    low, high = fem.box(k, k, k), fem.box(k, k, k)
    count = len(low.points)
    facets = {"floor": low.facets["bottom"], "table": low.facets["top"]}
    facets |= {
        name: high.facets[side] + count for name, side in (("foot", "bottom"), ("roof", "top"), ("side", "left"))
    }
    points = np.concatenate([low.points, high.points + np.array([0.0, 0.0, 1.0])])
    mesh = fem.PartedMesh(points, np.concatenate([low.cells, high.cells + count]), facets)
    given = {"pairs": [("foot", "table")], "clamp": "floor", "pressure": {"roof": 1.0}, "load": {"side": (*push, 0.0)}}
    more = {"max_rigid_displacement": "auto"} | more
    return fem.mesh_problem(mesh, young=1000.0, poisson=0.3, friction=friction, **given, **more)
