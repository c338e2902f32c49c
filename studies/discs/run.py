"""What do rows of discs of unequal radii or weights cost?

Discs touch in a row on a floor, one time step with friction 0.9: the first is pulled away, the others rest. Every
contact has a spring in both directions. With equal radii the normals between neighbours are level, and discs that do
not move touch their neighbours without load: with equal weights w = 0 there, with unequal ones they slide past each
other, w_n = lambda_n = 0 and w_t not 0. With unequal radii normals are inclined, and all contacts carry load or are
open.

Read ``nodes`` and ``seconds``; the search is cut at a number of nodes. ``ones`` are the nodes of a search in which mu =
kappa = 1 and nu = 0 in theory, (6.9). ``grazing`` counts the contacts with w_n = lambda_n = 0 at the root, ``sliding``
those of them with w_t not 0. The other contacts being fixed at their statuses,

- ``plain`` says whether the form of theory, (6.9), is definite at the root with mu = kappa = 1 and nu = 0: then closing
  needs no status of the grazing ones; ``numbers`` whether there are numbers for which it is. Where it says no, the tree
  tells some sliding contacts from sticking and from slipping to the other side.
- ``told`` and ``both`` say the same of the form in which every sliding contact is known to be open or to slip in one
  direction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np

import enumsol
from enumsol.model.statuses import BACKWARD, FORWARD, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.search.reduction import NEAR, Reduction, WeightSource, weights_of
from grazing.run import SOFT, STIFF
from shared.results import yes

if TYPE_CHECKING:
    from shared.results import Run

COUNTS, SMOKE_COUNTS = (4, 8, 12, 20), (4, 6)
SEEDS, SMOKE_SEEDS = range(3), range(1)
MAX_NODES, SMOKE_NODES = 3000, 500
FRICTION, PULL = 0.9, 3.0
#: What is asked of the grazing contacts; see above.
FORMS = ("plain", "numbers", "told", "both")


def discs(radii, weights, stiffness):
    """A row of discs; contacts are those with the floor, then those between neighbours."""
    count, p = len(radii), 2 * len(radii) - 1
    x = np.concatenate([[0.0], np.cumsum(2.0 * np.sqrt(radii[1:] * radii[:-1]))])
    rows = np.zeros((2 * p, 3 * count))
    for i, r in enumerate(radii):
        rows[i, 3 * i + 1] = -1.0
        rows[p + i, [3 * i, 3 * i + 2]] = 1.0, r
    for i in range(count - 1):
        k, left, right = count + i, 3 * i, 3 * i + 3
        n = np.array([x[i + 1] - x[i], radii[i + 1] - radii[i]]) / (radii[i] + radii[i + 1])
        t = np.array([-n[1], n[0]])
        rows[k, left : left + 2], rows[k, right : right + 2] = n, -n
        rows[p + k, left : left + 2], rows[p + k, right : right + 2] = t, -t
        rows[p + k, [left + 2, right + 2]] = radii[i], radii[i + 1]
    mass = np.diag(np.ravel([[r**2, r**2, r**4 / 2] for r in radii]))
    pull = stiffness * rows
    A = np.block([[mass + rows.T @ pull, -pull.T], [-pull, stiffness * np.eye(2 * p)]])
    f = np.zeros(len(A))
    f[1 : 3 * count : 3], f[0] = -weights, -PULL
    B = np.hstack([np.zeros((2 * p, 3 * count)), np.eye(2 * p)])
    return enumsol.ContactProblem(A, B[:p], B[p:], f, friction=FRICTION)


def problems(run):
    """Unequal what, contacts' stiffness, number of discs, seed, problem."""
    for kind in ("weights", "radii"):
        for name, stiffness in (("soft", SOFT), ("stiff", STIFF)):
            for count in SMOKE_COUNTS if run.smoke else COUNTS:
                for seed in SMOKE_SEEDS if run.smoke else SEEDS:
                    rng = np.random.default_rng(seed)
                    radii = rng.uniform(0.7, 1.3, count) if kind == "radii" else np.ones(count)
                    weights = 2.0 * radii**2 if kind == "radii" else rng.uniform(1.5, 3.0, count)
                    yield kind, name, count, seed, discs(radii, weights, stiffness)


def with_ones(R, nodes, sought=WeightSource.PLAIN):
    """What is found if mu = kappa = 1 and nu = 0."""
    del sought
    return weights_of(R, nodes, WeightSource.PLAIN)


def forms(system, root):
    """Grazing contacts, those that slide, and which forms are definite; see above."""
    p = system.p
    force = np.concatenate([root.lambda_n, root.lambda_t]) / system.force
    w = system.g - system.S @ force
    n, w_n, w_t = force[:p], w[:p], w[p:]
    grazing = (np.abs(n) < NEAR) & (np.abs(w_n) < NEAR)
    slip = np.where(np.abs(w_t) < NEAR, STICK, np.where(w_t > 0, SLIP_PLUS, SLIP_MINUS))
    codes = tuple(np.where(grazing, UNDECIDED, np.where(n < NEAR, OPEN, slip)).tolist())
    free = np.flatnonzero(grazing).tolist()
    sides = {i: FORWARD if w_t[i] > 0 else BACKWARD for i in free if abs(w_t[i]) >= NEAR}
    if not free:
        return 0, 0, *("-" for _ in FORMS)
    definite = []
    for sliding in ({}, sides):
        undecided = tuple(i for i in free if i not in sliding)
        reduction = Reduction(system, codes, undecided, sliding)
        x, v = force[reduction.places], w[reduction.places]
        found = [
            reduction.weights(x, v, exactly=True, sought=sought)
            for sought in (WeightSource.PLAIN, WeightSource.CENTRES)
        ]
        definite += [yes(numbers is not None) for numbers in found]
    return len(free), len(sides), *definite


def row(kind, name, count, seed, problem, most):
    system = problem.condensed.at(0.0).scaled
    roots = enumsol.enumerate_roots(problem, 0.0, max_nodes=most)
    with patch("enumsol.search.reduction.weights_of", with_ones):
        ones = enumsol.enumerate_roots(problem, 0.0, max_nodes=most)
    grazing, sliding, *definite = forms(system, roots[0]) if len(roots) else ("-",) * (2 + len(FORMS))
    return {
        "unequal": kind,
        "contacts": name,
        "discs": count,
        "seed": seed,
        "p": problem.p,
        "ones": ones.stats.nodes if ones.complete else "-",
        "nodes": roots.stats.nodes,
        "closed": roots.stats.closed,
        "roots": len(roots),
        "complete": yes(roots.complete),
        "seconds": roots.stats.seconds,
        "grazing": grazing,
        "sliding": sliding,
        **dict(zip(FORMS, definite, strict=True)),
    }


def conclusions(rows):
    """How many are finished, of each kind."""
    for kind in ("radii", "weights"):
        for name in ("soft", "stiff"):
            own = [line for line in rows if (line["unequal"], line["contacts"]) == (kind, name)]
            done = [line for line in own if line["complete"] == "yes"]
            largest = max((line["discs"] for line in done), default=0)
            at = [line for line in done if line["discs"] == largest]
            yield (
                f"unequal {kind}, {name}: {len(done)} of {len(own)} complete, up to {largest} discs in "
                f"{min(line['nodes'] for line in at)} to {max(line['nodes'] for line in at)} nodes"
            )
    touching = [line for line in rows if line["plain"] != "-"]
    definite = ", ".join(f"{name} {sum(line[name] == 'yes' for line in touching)}" for name in FORMS)
    yield f"forms that are definite, of {len(touching)} problems with grazing contacts at a root: {definite}"


def main(run: Run) -> None:
    most = SMOKE_NODES if run.smoke else MAX_NODES
    rows = [row(*problem, most) for problem in problems(run)]
    run.table("discs", rows, *conclusions(rows), f"searches are cut at {most} nodes")
