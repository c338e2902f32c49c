"""Does another convex form than the energy prune better, for small friction and many slipping nodes?

At a solution lambda_n w_n = 0 and lambda_t w_t >= 0 node by node, and F^2 lambda_n^2 - lambda_t^2 >= 0. So for any
weights theta_i in [0, 1] and tau_i >= 0

    sum_i lambda_n (S lambda - g)_n + theta lambda_t (S lambda - g)_t + tau (lambda_t^2 - F^2 lambda_n^2)

is at most zero there. The energy is theta = 1, tau = 0. With theta = 0 slip work does not slacken the bound, but the
form need not be convex: the study goes from the energy towards theta = 0, tau = kappa (S_tt)_ii as far as it stays so.

Read the nodes of the tree with the energy beside those for each kappa; ``share`` tells how far from the energy the form
could go (1: all the way). A cut search has a dash.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from enumsol import gallery
from enumsol.relaxation.active_set import ActiveSetEngine
from shared.loads import DRAGGED, PRESSED, STRAIGHT
from shared.searches import search

if TYPE_CHECKING:
    from shared.results import Run

#: Cells along the bottom and upwards, and length of the blocks.
BLOCKS, SMOKE_BLOCKS = ((16, 8, 1.0), (32, 8, 2.0), (64, 16, 2.0)), ((8, 4, 1.0),)
FRICTION, SMOKE_FRICTION = (0.1, 0.3, 0.5, 1.0), (0.3,)
KAPPA = (0.02, 0.1, 0.5)
MAX_NODES = 20_000
#: The form must keep this share of the energy, so that the QP stays well conditioned.
FLOOR = 0.02


def weighted_form(system, kappa):
    """The form nearest to theta = 0 that is convex, as (H, h), and how far it got (1: all the way)."""
    p, S = system.p, system.S
    weight = np.concatenate([np.ones(p), np.zeros(p)])
    target = weight[:, None] * S
    tau = kappa * np.diagonal(S)[p:]
    target = 0.5 * (target + target.T) + np.diag(np.concatenate([-(system.F**2) * tau, tau]))
    inverse = np.linalg.inv(system.cholesky)
    lowest = float(np.linalg.eigvalsh(inverse @ (target - S) @ inverse.T)[0])
    share = 1.0 if 1.0 + lowest >= FLOOR else (1.0 - FLOOR) / -lowest
    return (S + share * (target - S), system.g * (1.0 + share * (weight - 1.0))), share


def nodes(problem, F, form=None):
    """Nodes of the tree with the energy, or with another form; a dash when the search was cut."""
    outcome = search(problem, F, partial(ActiveSetEngine, form=form), max_nodes=MAX_NODES)
    return outcome.nodes if outcome.stopped is None else "-"


def row(problem, F):
    """One problem: nodes with the energy and with every kappa."""
    found = {"F": F, "energy": nodes(problem, F)}
    for kappa in KAPPA:
        form, share = weighted_form(problem.condensed.at(F).scaled, kappa)
        found |= {f"kappa {kappa}": nodes(problem, F, form), f"share {kappa}": round(share, 2)}
    return found


def table(blocks, friction):
    """One row per block, traction and friction coefficient."""
    for p, ny, length in blocks:
        for traction in (PRESSED, DRAGGED, STRAIGHT):
            problem = gallery.clamped_block(p, ny, length=length, traction=traction)
            for F in friction:
                yield {"p": p, "length": length, "traction": traction, **row(problem, F)}


def main(run: Run) -> None:
    rows = list(table(SMOKE_BLOCKS, SMOKE_FRICTION) if run.smoke else table(BLOCKS, FRICTION))
    count = {kappa: sum(fewer(line[f"kappa {kappa}"], line["energy"]) for line in rows) for kappa in KAPPA}
    run.table(
        "energy_forms",
        rows,
        *(
            f"kappa = {kappa} needs fewer nodes than the energy in {n} of {len(rows)} cases"
            for kappa, n in count.items()
        ),
    )


def fewer(one, other):
    """Whether one number of nodes is less than another; a dash is more than all."""
    return one != "-" and (other == "-" or one < other)
