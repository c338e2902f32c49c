"""The roots at one alpha of a graph in 3D, each proven again at that alpha (theory, section 12.10)."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from enumsol.model.sectors import SECTORS, is_sector, nearest, run_of
from enumsol.model.statuses import FRICTIONLESS, OPEN, SLIP_MINUS, SLIP_PLUS, STICK
from enumsol.roots.root_set import RigidBound, RootSet, SearchStats, Undecided
from enumsol.roots.space_roots import SpaceEnumeration
from enumsol.search.outcome import Stop, StopReason
from enumsol.search.space.space_floating import FloatingSpaceSolvers
from enumsol.search.space.space_setup import SpaceSolvers
from enumsol.trusted.space.leaves import SpaceRoot, distinct_roots, settle

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.graph_data import GraphData
    from enumsol.condensation.space_condensed import EnclosedSpace
    from enumsol.support.array_types import Alpha, Codes, Floats


_NOT_PROVEN = "the root of an arc could not be proven at this alpha"


def roots_on_arcs(
    data: GraphData, alpha: Alpha, arcs: Sequence[Arc], vertices: Sequence[Vertex], near: Sequence[Vertex]
) -> RootSet:
    """The roots of arcs at an alpha; what lies too close to a vertex is undecided.

    Parameters
    ----------
    arcs : those that pass over the alpha
    vertices : at it, on the border of the interval
    near : of which it is not known on which side of the alpha they lie
    """
    numbers = {v.number for v in vertices}
    arcs = [*arcs, *(arc for arc in data.arcs if numbers & {arc.tail, arc.head})]
    made = SpaceSolvers if data.problem.held else FloatingSpaceSolvers
    solvers = made(data.problem, alpha, "verified")
    enumeration = SpaceEnumeration(solvers, None, None)
    leaves: list[tuple[Codes, SpaceRoot]] = []
    undecided: list[Undecided] = []
    for arc in arcs:
        forces = arc.state(alpha)[0]
        found = root_near(solvers.enclosed, arc.selections[0], forces)
        if found is None:
            undecided.append(Undecided(arc.statuses, _NOT_PROVEN, "another alpha, or enumerate_roots there"))
        else:
            leaves.append(found)
    distinct, doubtful, _ = distinct_roots(leaves)
    # every arc has a root of its own
    lost = len(leaves) - len(distinct)
    undecided += [Undecided((None,) * data.problem.p, _NOT_PROVEN, "enumerate_roots there")] * lost
    undecided += [
        Undecided(
            v.statuses, "alpha cannot be told from a vertex of the graph", "another alpha, or enumerate_roots there"
        )
        for v in near
    ]
    roots = [enumeration.root(codes, root) for codes, root in distinct]
    roots.sort(key=lambda root: (-float(np.sum(root.lambda_n)), root.lambda_n.tolist(), root.lambda_t.tolist()))
    known = data.claims.knows(Fraction(alpha))
    whole = not undecided and known
    return RootSet(
        alpha=alpha,
        roots=roots,
        families=(),
        undecided=undecided,
        arithmetic="verified",
        method="graph",
        stopped=None if known else str(Stop(StopReason.GRAPH_INCOMPLETE)),
        stats=SearchStats(selections=len(arcs)),
        node_ids=data.problem.node_ids,
        # others beyond it were not looked for
        rigid_bound=None if data.problem.held else RigidBound(data.problem.rigid_reach, needed=True),
        at_least=None if whole else max(len(roots) - len(doubtful), data.claims.multiplicity(data.inside(alpha)).count),
    )


def root_near(system: EnclosedSpace, codes: Codes, forces: Floats) -> tuple[Codes, SpaceRoot] | None:
    """The regular root with these statuses near given forces (in the problem's units), proven; None where it is not.

    ``codes`` as in a graph: slip in any direction.
    """
    # levels of the sectors in which a root is looked for, the narrow ones first
    for level in (22, 16, 11, 8, 6):
        for leaf in product(*(_leaves(system, i, code, forces, level) for i, code in enumerate(codes))):
            found = settle(system, leaf)
            if isinstance(found, SpaceRoot):
                return leaf, found
    return None


def _leaves(system: EnclosedSpace, i: int, code: int, forces: Floats, level: int) -> Iterable[int]:
    """Codes of a node in a leaf: of a node that slips, the sectors of a level around the direction of its friction."""
    if code == OPEN:
        return (OPEN,)
    axes = np.flatnonzero(system.tau[i] >= 0)
    if not len(axes):
        return (FRICTIONLESS,)
    if code == STICK:
        return (STICK,)
    p = len(system.tau)
    tau = forces[p:].reshape(2, p)[axes, i] / system.F[i, axes]
    if len(axes) == 1:
        return (SLIP_PLUS if tau[0] > 0 else SLIP_MINUS,)
    begin = nearest(float(tau[0]), float(tau[1]), level)
    first = 1 << level
    before = first + (begin - first - 1) % first
    both = run_of(before, 2) if before < begin else before
    if before < begin and is_sector(both):
        return (SECTORS + both,)
    return (SECTORS + begin, SECTORS + before)
