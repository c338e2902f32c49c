"""One body on one mesh: the estimates and what they are made of, the contraction seen, and norms in H^1."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

import enumsol
from enumsol import FrictionTable, fem, gallery
from enumsol.condensation.factorization import Factorization

#: Friction at which the contraction is measured, and a slope so small that it does not change it.
F, SLOPE = 0.5, 1e-3
#: Sides of the block in 3D: cubes as cells, twice as many across as high.
SIZE = (1.0, 1.0, 0.5)


def largest(matrix):
    """Largest eigenvalue of a symmetric matrix."""
    last = len(matrix) - 1
    return float(eigh(matrix, eigvals_only=True, subset_by_index=(last, last))[0])


def constants(problem, areas):
    """Parts of the estimate for F = 1, theta = m^(-1/2) and nodal slips: (theory, (11.6), (11.7))."""
    p, S = problem.p, problem.condensed.S
    g = problem.condensed.g0
    d = len(S) // p - 1
    inverse = np.linalg.inv(S)
    root, roots = np.sqrt(areas), np.tile(np.sqrt(areas), d)
    weighted = roots[:, None] * S[p:, p:] * roots
    blocks = S[p:, p:].reshape(d, p, d, p)[:, np.arange(p), :, np.arange(p)]
    c_0 = float(np.sqrt(largest(inverse[:p, :p] / root[:, None] / root)))
    c_t = float(np.sqrt(largest(weighted)))
    return {
        "c_n": c_0,  # with theta = m^(-1/2) both are the same
        "c_t": c_t,
        "c_0": c_0,
        "c_inf": float(np.sqrt(np.max(np.linalg.eigvalsh(blocks)))),
        "c_phi": c_t,
        "R": float(np.sqrt(g @ inverse @ g)),
    }


def row(body, problem, areas, H, h):
    """Estimates of a problem with friction F, and the contraction that its iterations show."""
    estimate = enumsol.lipschitz_estimate(problem, 0, areas=areas)
    c = constants(problem, areas)
    C2 = float(c["c_0"] * c["c_inf"] * c["c_phi"] * c["R"])
    if estimate.lipschitz > 0:  # of the package: with r_h where multipliers live on the coarser mesh
        C2 = estimate.C2 / estimate.lipschitz
        c["c_phi"] = C2 / (c["c_0"] * c["c_inf"] * c["R"])
    limit = enumsol.successive_approximations(problem, 0)
    assert limit.converged
    return {
        "body": body,
        "H": H,
        "h": h,
        "p": problem.p,
        "n": problem.n,
        "C1 / F": estimate.C1 / F,
        "bound on F": estimate.factor * F,
        "gain of other weights": float(c["c_n"] * c["c_t"] * F / estimate.C1),
        "C2 / L": C2,
        **c,
        "contraction seen": limit.contraction_factor,
        "largest ratio seen": float(np.max(limit.contraction[: max(limit.iterations - 4, 1)])),
        "iterations": limit.iterations,
    }


def plane(n):
    """The clamped block in plane strain, n cells a side; an area is a length here."""
    problem = gallery.clamped_block(n, n, friction=F)
    areas = np.full(n, 1.0 / n)
    areas[-1] /= 2
    return row("2D, nodes", problem, areas, 1.0 / n, 1.0 / n)


def solid(n, ratio):
    """The block in 3D with n cells along its bottom; ratio is H / h, or 0 for multipliers on nodes."""
    table = FrictionTable([0.0, 1.0], [F, F - SLOPE])
    kind = {"multipliers": "elements", "ratio": ratio} if ratio else {}
    problem = gallery.block3d(n, n, n // 2, size=SIZE, friction=table, **kind)
    name = f"3D, elements H/h = {ratio}" if ratio else "3D, nodes"
    found = row(name, problem, problem.areas, max(ratio, 1) / n, 1.0 / n)
    return found, norms_row(name, problem, max(ratio, 1) / n, 1.0 / n)


def inverse_of(factorization, size):
    """The inverse of a factorized matrix, as eigsh takes it."""
    return LinearOperator((size, size), factorization.solve, dtype=np.float64)


def norms_row(body, problem, H, h):
    """Constants of equivalence between the norms of H^1 and the energy norms, and of the two norms of forces."""
    norms = fem.h1_norms(problem)
    A, G = problem.A, norms.G
    p = problem.p
    D = np.linalg.inv(np.linalg.inv(problem.condensed.S)[:p, :p])
    forces = eigh(norms.dual, 0.5 * (D + D.T), eigvals_only=True)
    common = {"k": 1, "M": G, "v0": np.ones(problem.n), "return_eigenvectors": False, "tol": 1e-5}
    most = eigsh(A, which="LA", Minv=inverse_of(Factorization(G), problem.n), **common)[0]
    least = eigsh(A, sigma=0.0, OPinv=inverse_of(problem.factorization, problem.n), **common)[0]
    u = problem.factorization.solve(problem.f)
    limit = enumsol.successive_approximations(problem, 0)
    energy = float(np.sqrt(limit.lambda_n @ D @ limit.lambda_n))
    return {
        "body": body,
        "H": H,
        "h": h,
        "p": p,
        "|v|_A / ||v||_1 least": float(np.sqrt(least)),
        "|v|_A / ||v||_1 most": float(np.sqrt(most)),
        "of the load": float(np.sqrt(u @ problem.f)) / norms.of_displacement(u),
        "||mu||_-1/2,h / ||mu||_D least": float(np.sqrt(forces[0])),
        "||mu||_-1/2,h / ||mu||_D most": float(np.sqrt(forces[-1])),
        "of the solution": norms.of_force(limit.lambda_n) / energy,
        "||lambda_n||_-1/2,h": norms.of_force(limit.lambda_n),
        "||lambda_n||_D": energy,
    }
