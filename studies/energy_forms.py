"""Another convex form than the energy, for small friction and many slipping nodes: does it prune better?.

At a solution lambda_n w_n = 0 and lambda_t w_t >= 0 node by node, and F^2 lambda_n^2 - lambda_t^2 >= 0. So for any
weights theta_i in [0, 1] and tau_i >= 0

    sum_i lambda_n (S lambda - g)_n + theta lambda_t (S lambda - g)_t + tau (lambda_t^2 - F^2 lambda_n^2)

is at most zero there. The energy is theta = 1, tau = 0. With theta = 0 slip work does not slacken the bound, but the
form need not be convex: the study goes from the energy towards theta = 0, tau = kappa (S_tt)_ii as far as it stays so.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from enumsol import gallery
from enumsol.relaxation import _active_set
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.rows import row_terms
from enumsol.search.certifiers.floats import FastCertifier
from enumsol.search.tree import SearchLimits, TreeSearch
from enumsol.selections.floats import FloatSelections

RESULTS = Path(__file__).parent / "results"
TRACTIONS = ((0.3, -1.0), (1.0, -0.3), (0.0, -1.0))
FRICTION = (0.1, 0.3, 0.5, 1.0)
KAPPA = (0.02, 0.1, 0.5)
MAX_NODES = 20_000
#: The form must keep this share of the energy, so that the QP stays well conditioned.
FLOOR = 0.02


def weighted_form(system, kappa):
    """Hessian and linear term of the form nearest to theta = 0 that is convex, and how far it got (1: all the way)."""
    p, S = system.p, system.S
    weight = np.concatenate([np.ones(p), np.zeros(p)])
    target = weight[:, None] * S
    tau = kappa * np.diagonal(S)[p:]
    target = 0.5 * (target + target.T) + np.diag(np.concatenate([-(system.F**2) * tau, tau]))
    inverse = np.linalg.inv(system.cholesky)
    lowest = float(np.linalg.eigvalsh(inverse @ (target - S) @ inverse.T)[0])
    share = 1.0 if 1.0 + lowest >= FLOOR else (1.0 - FLOOR) / -lowest
    return S + share * (target - S), system.g * (1.0 + share * (weight - 1.0)), share


def nodes(system, form=None):
    """Nodes of the tree with the energy, or with another form."""
    search = TreeSearch(system, FastCertifier(FloatSelections(system)), limits=SearchLimits(max_nodes=MAX_NODES))
    if form is not None:
        engine = ActiveSetEngine(system)
        start, index, value = row_terms(system.p, system.F)
        rhs = np.zeros(len(start) - 1)
        engine._data = _active_set.QPData(*form, -system.S, system.g, start, index, value, rhs)
        search.engine = engine
    outcome = search.run()
    return outcome.nodes if outcome.stopped is None else None


def main():
    rows = []
    for p, ny, length in ((16, 8, 1.0), (32, 8, 2.0), (64, 16, 2.0)):
        for traction in TRACTIONS:
            problem = gallery.clamped_block(p, ny, length=length, traction=traction)
            for F in FRICTION:
                system = problem.condensed.at(F).scaled
                row = {"p": p, "length": length, "traction": str(traction), "F": F, "energy": nodes(system)}
                for kappa in KAPPA:
                    H, h, share = weighted_form(system, kappa)
                    row[f"kappa {kappa}"] = nodes(system, (H, h))
                    row[f"share {kappa}"] = round(share, 2)
                rows.append(row)
                print("  ".join(f"{k} {'>' + str(MAX_NODES) if v is None else v}" for k, v in row.items()), flush=True)
    RESULTS.mkdir(exist_ok=True)
    with (RESULTS / "energy_forms.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    better = sum((r["kappa 0.1"] or MAX_NODES) < (r["energy"] or MAX_NODES) for r in rows)
    print(f"kappa = 0.1 needs fewer nodes than the energy in {better} of {len(rows)} cases; the energy stays")


if __name__ == "__main__":
    main()
