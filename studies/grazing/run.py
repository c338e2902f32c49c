"""What do contact nodes that touch without load cost, if subtrees are fathomed by uniqueness?

Where several statuses of k nodes hold at a root, up to 4^k selections do. Searched are chains of nodes in small
integers of which the first one sticks or slides and k others touch it unloaded (every status holds) or displaced along
the foundation (open and slip hold), with friction 0.5 and, for those displaced, 0.875; and rows of discs on a floor,
friction 0.9, of which the first is pulled away: of equal discs that rest, neighbours touch unloaded; of unequal ones,
one is displaced past the other. ``before`` is the search in fast arithmetic without the closing of subtrees (theory,
section 6.11), cut at a number of nodes.

Nodes that slide without load are split into open or slipping to that side, stick, and slipping to the other. Before
they were, and F = 0.9: k = 8 nodes displaced beside a sliding one took 1,316 nodes and k = 16 did not end at 4,000;
beside a sticking one k = 8 took 118 and k = 32 did not end at 4,000. Rows of 12 unequal discs (weights 2 and 3) took
3,989 nodes where the contacts are soft and did not end where they are stiff.

Read ``nodes`` beside k. ``soft`` and ``stiff`` discs differ in the stiffness of their contacts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import enumsol
from enumsol.relaxation.active_set import ActiveSetEngine
from shared.searches import search

if TYPE_CHECKING:
    from shared.results import Run

SIZES, SMOKE_SIZES = (4, 8, 16, 32, 64), (4, 8)
DISCS, SMOKE_DISCS = (4, 6, 8, 20), (4, 6)
#: Without closing, and with it where that does not help, the search is cut here.
MAX_NODES, SMOKE_NODES = 5000, 500
SOFT, STIFF = 0.25, 64.0


def chain(k, *, slides, displaced, friction=0.5):
    """k nodes that touch unloaded beside a loaded one."""
    p = k + 1
    links = np.diag(np.full(p, 4.0)) - np.eye(p, k=1) - np.eye(p, k=-1)
    A = np.block([[links, np.eye(p)], [np.eye(p), links]])
    u, force = np.zeros(2 * p), np.zeros(2 * p)
    force[[0, p]] = 2.0, 2.0 * friction if slides else friction
    u[p], u[p + 1 :] = float(slides), float(displaced)
    eye = np.eye(2 * p)
    return enumsol.ContactProblem(A, eye[:p], eye[p:], A @ u + force, friction=friction)


def discs(count, weights, stiffness):
    """A row of discs of radius one on a floor, one time step: the first is pulled away, the others rest."""
    bodies, p = 3 * count, 2 * count - 1
    rows = np.zeros((2 * p, bodies))
    for i in range(count):
        rows[i, 3 * i + 1] = -1.0
        rows[p + i, [3 * i, 3 * i + 2]] = 1.0
    for i in range(count - 1):
        rows[count + i, [3 * i, 3 * i + 3]] = 1.0, -1.0
        rows[p + count + i, [3 * i + 1, 3 * i + 2, 3 * i + 4, 3 * i + 5]] = 1.0, 1.0, -1.0, 1.0
    mass = np.diag(np.tile([1.0, 1.0, 0.5], count))
    A = np.block(
        [[mass + stiffness * rows.T @ rows, -stiffness * rows.T], [-stiffness * rows, stiffness * np.eye(2 * p)]]
    )
    f = np.zeros(bodies + 2 * p)
    f[1:bodies:3], f[0] = -np.resize(weights, count), -3.0
    B = np.hstack([np.zeros((2 * p, bodies)), np.eye(2 * p)])
    return enumsol.ContactProblem(A, B[:p], B[p:], f, friction=0.9)


def problems(run):
    """Name, number of nodes that touch without load, and problem."""
    for slides in (False, True):
        for displaced in (False, True):
            for k in SMOKE_SIZES if run.smoke else SIZES:
                name = f"{'slides' if slides else 'sticks'}, others {'displaced' if displaced else 'unloaded'}"
                yield name, k, chain(k, slides=slides, displaced=displaced)
    for slides in (False, True):
        for k in SMOKE_SIZES if run.smoke else SIZES:
            name = f"{'slides' if slides else 'sticks'}, others displaced, F = 0.875"
            yield name, k, chain(k, slides=slides, displaced=True, friction=0.875)
    for kind, weights in (("equal", (2.0,)), ("unequal", (2.0, 3.0))):
        for name, stiffness in (("soft", SOFT), ("stiff", STIFF)):
            for count in SMOKE_DISCS if run.smoke else DISCS:
                yield f"{count} {kind} discs, {name}", count - 2, discs(count, weights, stiffness)


def row(name, k, problem, most):
    """One problem, with and without closing."""
    problem.condensed  # noqa: B018 (made once, outside the clock)
    before = search(problem, 0.0, ActiveSetEngine, max_nodes=most)
    roots = enumsol.enumerate_roots(problem, 0.0, max_nodes=most)
    report = enumsol.verify(problem, roots.proof)
    fast = enumsol.enumerate_roots(problem, 0.0, "fast", max_nodes=most)
    return {
        "problem": name,
        "k": k,
        "p": problem.p,
        "before": before.nodes if before.stopped is None else "-",
        "nodes": roots.stats.nodes if roots.stopped is None else "-",
        "closed": roots.stats.closed,
        "fast": fast.stats.nodes if fast.stopped is None else "-",
        "roots": len(roots),
        "seconds": roots.stats.seconds,
        "complete": "yes" if roots.complete else "",
        "checked": "yes" if report.complete else "",
    }


def conclusions(rows):
    """How many nodes a grazing node costs, and what was not closed."""
    chains = [line for line in rows if "discs" not in line["problem"]]
    finished = all(line["complete"] and line["checked"] for line in chains)
    most = max(line["nodes"] / line["k"] for line in chains if line["nodes"] != "-")
    yield f"chains: all complete and checked: {'yes' if finished else 'no'}; at most {most:.1f} k nodes"
    equal = [line for line in rows if " equal" in line["problem"]]
    largest = max(equal, key=lambda line: line["p"])
    yield (
        f"rows of equal discs: {sum(line['complete'] == 'yes' for line in equal)} of {len(equal)} complete, "
        f"{largest['p']} contacts in {largest['nodes']} nodes"
    )
    unequal = [line for line in rows if "unequal" in line["problem"]]
    open_ones = [line["problem"] for line in unequal if not line["complete"]]
    yield f"rows of unequal discs not complete: {'; '.join(open_ones) or 'none'}"


def main(run: Run) -> None:
    most = SMOKE_NODES if run.smoke else MAX_NODES
    rows = [row(name, k, problem, most) for name, k, problem in problems(run)]
    run.table("grazing", rows, *conclusions(rows))
