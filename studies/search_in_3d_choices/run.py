"""What makes the search in 3D fast: which node to branch on, when to halve sectors, test leaves and add tangents?

Searches of blocks and wedges and of random strongly coupled problems with p = 3, in each of which one choice of the
product is replaced by another:

- statuses first: nearly what the product did before; sectors are halved when all statuses are decided, leaves tested
  each time;
- most violated: statuses and sectors alike, where complementarity is violated most, without solving children;
- one dual step: as in 2D, children are bounded by one step of the dual method without carrying it out;
- 4 candidates: children are solved at the four most violated nodes only;
- tangents: rounds of tangents where the minimiser leaves the disc; in the product up to 4.

Read ``nodes`` and ``leaves``, the leaves tested by Krawczyk's operator; they are the same on every machine. A search is
cut at a number of nodes (column "complete" is False then).

``slices`` has wedges, with other slices cut off the ends of sectors than in the product (halves and quarters, once all
statuses are final, below level 8 only where maximum dissipation is violated), or with leaves tested at other times than
there (from level 8, and when nothing else is left to do): no slices at all, halves only, eighths, too; leaves last, or
from level 6; slices at every node of the tree.

The results of ``early`` and ``below`` are of a version that cut no slices. One choice is gone since, "no
contraction": leaves tested without halving sectors that are wider than others and have an excluded half.

``forms`` has wedges whose relaxations bound by another quadratic form than the energy: the one with the largest minimum
at a node of the tree, which a semidefinite program finds among all sums of products of two rows of one contact node.
Its children inherit it. It is made at the root of the tree, and anew wherever six or three decisions (contact or not,
what a node in contact does, two halvings of a sector) were made since the last one. These bounds are in floats.

``around`` has the gap that the best form leaves around a root that no leaf settles, however narrow (angle-14 of
study ``search_in_3d`` on the weakest springs, F = 0.5): below its assignment of statuses,
and in sectors around its directions of slip; with all products and with some kinds only: lambda_n^2 - |tau|^2
("discs"), and in sectors the products of slips, of forces, or of one of each, across both ends.

``bounds`` tells how many of the children that the programs exclude are excluded by less: by the disc around the
minimiser's slip or force in which the energy bound holds all solutions, without regard to other rows, and by one dual
step. ``turned`` is the search with every node's axes turned so that the direction in which the relaxation at the root
of the tree points is the middle of a sector, or on an end of one. There it is in floats.

``early`` has searches, on more bodies, that test by Krawczyk's operator before the product does. ``wasted`` are tests
that leave a leaf open, ``first root`` is the node of the tree at which a root is found first:

- final, level l: as soon as all statuses are final and no sector is wider than level l (4 sectors are level 2); "widest
  halved": after a test that failed not until the widest sector is narrower;
- completions of k: besides, all completions of an assignment with at most k undecided nodes, so as not to branch;
- suggested, k: where at most k nodes are undecided, the one completion that the minimiser points to, for the order and
  for leaves in the box of a root that is known.

Seconds there are of one run on a machine with other work. ``below`` counts the nodes that such tests could save at
most: those below assignments in which at most k nodes are undecided.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from time import process_time
from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np

from enumsol import ContactProblem3D, gallery
from enumsol.model.sectors import DEEPEST, SECTORS, direction, end_number, level_of
from enumsol.model.statuses import CONTACT, UNDECIDED
from enumsol.relaxation import space_relaxation as space
from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.relaxation.space_relaxation import SpaceEngine, SpaceRelaxation
from enumsol.search.certifiers.protocol import Refine, Unrecorded
from enumsol.search.outcome import SearchLimits
from enumsol.search.space.space_search import SpaceCertifier, SpaceSolvers
from enumsol.trusted.space.leaves import distinct_roots
from enumsol.trusted.space.sector_rows import LEFT, RIGHT, SLIP, sector_row_terms
from search_in_3d_choices.early import early
from search_in_3d_choices.products import around, forms
from search_in_3d_choices.slices import slices

if TYPE_CHECKING:
    from shared.results import Run

MAX_NODES, RANDOM = 10_000, 100
MOST_SLICES, SMOKE_SLICES = 30_000, 60
CANDIDATES = 16  # of one dual step
BODIES = {
    **{
        f"block {p}, F = {F}": (lambda cells=cells: gallery.block3d(*cells), F)
        for p, cells in ((9, (3, 2, 2)), (12, (4, 2, 2)), (16, (4, 3, 2)))
        for F in (0.3, 0.5)
    },
    "wedge3d-8-5": (gallery.get("wedge3d-8-5").build, gallery.get("wedge3d-8-5").alpha),
}
#: For the last two tables only: all choices take as long there, as most of the time goes to leaves.
MORE = {"wedge3d-4-9": (gallery.get("wedge3d-4-9").build, gallery.get("wedge3d-4-9").alpha)}
#: And these, for tests of leaves.
EARLY = {
    **{
        f"block {p}, F = 1": (lambda cells=cells: gallery.block3d(*cells), 1.0)
        for p, cells in ((9, (3, 2, 2)), (12, (4, 2, 2)), (16, (4, 3, 2)))
    },
    **{name: (gallery.get(name).build, gallery.get(name).alpha) for name in ("wedge3d-2-3", "wedge3d-4-3")},
}
EARLY_RANDOM = 60
SMOKE_BODIES = {"wedge3d-2-3": (gallery.get("wedge3d-2-3").build, 1.0)}


class StatusesFirst(SpaceRelaxation):
    """Sectors after all statuses; leaves before sectors."""

    __slots__ = ()

    def most_promising(self, codes, score):
        """The node to branch on."""
        undecided = np.isin(codes, (CONTACT, UNDECIDED))
        self._engine.noted = int(np.argmax(score)) if np.max(score) > 0 else -1
        return int(np.argmax(np.where(undecided, score, -np.inf))) if np.any(undecided) else -1


class MostViolated(SpaceRelaxation):
    """Without solving the children."""

    __slots__ = ()

    def most_promising(self, codes, score):
        """The node to branch on."""
        return int(np.argmax(score)) if np.max(score) > 0 else -1


class DualStep(SpaceRelaxation):
    """Children bounded by one dual step."""

    __slots__ = ()

    def most_promising(self, codes, score):
        """The node to branch on."""
        best, most = -1, 0.0
        for node in np.argsort(-score, kind="stable")[:CANDIDATES].tolist():
            if not score[node] > 0:
                break
            gains = [self.gain(node, child) for child in self._engine.children(node, codes[node])]
            closed = np.minimum(np.array(gains) / (PRUNE_MARGIN - self.bound), 1.0)
            if np.sum(closed < 1) <= 1:
                return node
            promise = score[node] ** 0.3 / np.sum(np.exp(-4.0 * closed[closed < 1]))
            if promise > most:
                best, most = node, promise
        return best

    def gain(self, node, code):
        """The most that one row of a status raises the bound."""
        return max((self._state.gain(*pair) for pair in self.added(node, code)), default=0.0)

    def added(self, node, code):
        """Rows and modes that a status adds."""
        pairs = zip(*self._engine.imposed(node, code), strict=True)
        return [(row, mode) for row, mode in pairs if self._state.mode_of(row) < mode]


class FourCandidates(SpaceRelaxation):
    """Children solved at four nodes."""

    __slots__ = ()

    def violations(self, codes):
        """Those of the four nodes only."""
        score = super().violations(codes)
        score[np.argsort(-score, kind="stable")[4:]] = -np.inf
        return score


class Counted(DualStep):
    """The product's choice; counts how the children that were solved are excluded."""

    __slots__ = ()
    most_promising = SpaceRelaxation.most_promising

    def solved_children(self, node, code):
        """The same, counted."""
        gap, count = PRUNE_MARGIN - self.bound, self._engine.count
        bounds = [
            (self.disc(node, child) > gap, self.gain(node, child) > gap) for child in self._engine.children(node, code)
        ]
        found = super().solved_children(node, code)
        for (disc, step), child in zip(bounds, found.values(), strict=True):
            count += [1, child.pruned, child.pruned and disc, child.pruned and step]
        return found

    def disc(self, node, code):
        """By how much the energy rises from the minimiser to where a status's rows hold, no other row being there."""
        rows = [self._engine.rows[row] for row, _ in self.added(node, code)]
        sets = [[row] for row in rows] + [
            [row for row in rows if row[0] in kinds] for kinds in ((LEFT, RIGHT), (SLIP,))
        ]
        return max((self._rise(rows) for rows in sets if rows), default=0.0)

    def _rise(self, rows):
        system, size = self._engine.system, len(self._engine.system.g)
        normals = np.zeros((len(rows), size))
        values = np.zeros(len(rows))
        for k, row in enumerate(rows):
            for i, coefficient in zip(*sector_row_terms(row, system.tau, size), strict=True):
                values[k] += coefficient * (self.forces[i] if i < size else self.displacements[i - size])
                normals[k] += coefficient * (np.eye(size)[i] if i < size else -system.S[i - size])
        values = np.abs(values) if rows[0][0] == SLIP else np.maximum(-values, 0.0)
        gram = normals @ np.linalg.solve(system.S, normals.T)
        u = np.linalg.solve(gram, values)
        return float(values @ u) if np.all(u > 0) else 0.0


class Engine(SpaceEngine):
    """Relaxations of a kind."""

    def __init__(self, system, kind):
        super().__init__(system)
        self.kind, self.noted, self.count = kind, -1, np.zeros(4, dtype=int)

    def root(self, rows, modes):
        """The relaxation with the given rows on."""
        return self.kind(self, self._state(self.data), rows, modes)


class Certifier(SpaceCertifier):
    """Halves the sector that the relaxation noted."""

    def selection(self, codes):
        """What a leaf holds, or the sector to halve."""
        answer, noted = super().selection(codes), self._engine.noted
        wide = noted >= 0 and codes[noted] > SECTORS and level_of(codes[noted] - SECTORS) < DEEPEST
        return Refine(noted) if isinstance(answer, Refine) and wide else answer


class Solvers(SpaceSolvers):
    """A search with one choice replaced."""

    def __init__(self, problem, alpha, kind, place=None):
        super().__init__(problem, alpha, "verified" if place is None else "fast")
        self.kind = kind
        if place is not None:
            self.system = turned(self.system, place)

    @cached_property
    def _engine(self):
        return Engine(self.system, self.kind)

    @property
    def engine(self):
        """The engine of its search."""
        return self._engine

    def _closer(self, certifier):
        """Trees are compared: no certificate of one solution cuts them short."""
        del certifier

    def certifier(self, recorder=None):
        """One that writes no proof."""
        return Certifier(self._engine, self.enclosed, Unrecorded())


def turned(system, place):
    """The system with tau and v of every node turned: what the first relaxation points to comes to a place of a sector.

    ``place``: 0 the end of a sector, 1/2 its middle.
    """
    engine = SpaceEngine(system)
    first = [engine.imposed(node, UNDECIDED) for node in range(system.p)]
    minimiser = engine.root([r for rows, _ in first for r in rows], [m for _, modes in first for m in modes])
    tau, v = (system.tangential(x) for x in (minimiser.forces, minimiser.displacements))
    towards = sum(x / (np.linalg.norm(x, axis=1, keepdims=True) + 1e-300) for x in (tau, v))
    a, b = (np.array(direction(n)) for n in (4, end_number(4)))
    goal = (1 - place) * a + place * b
    angle = np.arctan2(goal[1], goal[0]) - np.arctan2(towards[:, 1], towards[:, 0])
    turn = np.eye(len(system.g))
    for i, (t1, t2) in enumerate(system.tau):
        c, s = np.cos(angle[i]), np.sin(angle[i])
        turn[np.ix_([t1, t2], [t1, t2])] = [[c, -s], [s, c]]
    S = turn @ system.S @ turn.T
    return replace(system, S=0.5 * (S + S.T), g=turn @ system.g)


CHOICES = {
    "as it is": (SpaceRelaxation, {}),
    "statuses first": (StatusesFirst, {}),
    "most violated": (MostViolated, {}),
    "one dual step": (DualStep, {}),
    "4 candidates": (FourCandidates, {}),
    "tangents: 0 rounds": (SpaceRelaxation, {"ROUNDS": 0}),
    "tangents: 1 round": (SpaceRelaxation, {"ROUNDS": 1}),
}


def searched(build, alpha, kind, constants=(), place=None):
    """Nodes, leaves, roots, whether nothing is open, seconds; and the engine."""
    problem = build()
    problem.enclosure  # noqa: B018 (made once, not part of the search)
    with ExitStack() as stack:
        for name, value in dict(constants).items():
            stack.enter_context(patch.object(space, name, value))
        started = process_time()
        solvers = Solvers(problem, alpha, kind, place)
        certifier = solvers.certifier()
        outcome = solvers.search(certifier, SearchLimits(max_nodes=MAX_NODES)).run()
        seconds = process_time() - started
    roots = distinct_roots(certifier.certified.verified.items())[0]
    complete = outcome.stopped is None and not outcome.undecided
    return (outcome.nodes, outcome.selections, len(roots), complete, seconds), solvers.engine


def random_problem(seed):
    """Strongly coupled nodes with much friction."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(9, 9))
    A = np.linalg.inv(X @ X.T + 10 ** rng.uniform(-2, 0) * np.eye(9))
    rows, F = np.eye(9), 10 ** rng.uniform(-0.5, 1.5, size=(2, 3))
    return ContactProblem3D(0.5 * (A + A.T), rows[:3], rows[3:6], rows[6:], A @ rng.normal(size=9), friction=tuple(F))


def summed(name, results):
    """A row of a table."""
    nodes, leaves, roots, complete, seconds = zip(*results, strict=True)
    totals = {"nodes": sum(nodes), "leaves": sum(leaves), "roots": sum(roots), "complete": all(complete)}
    return {"problem": name, **totals, "s": sum(seconds)}


def main(run: Run) -> None:
    bodies = SMOKE_BODIES if run.smoke else BODIES
    seeds = range(1 if run.smoke else RANDOM)
    cases = {name: [(build, alpha)] for name, (build, alpha) in bodies.items()}
    cases[f"{len(seeds)} random, p = 3"] = [((lambda seed=seed: random_problem(seed)), 0.0) for seed in seeds]
    rows = []
    for choice, (kind, constants) in CHOICES.items():
        for name, problems in cases.items():
            results = [searched(*problem, kind, constants)[0] for problem in problems]
            rows.append({"choice": choice, **summed(name, results)})
    report(run, rows)
    slices(run, Solvers, SMOKE_SLICES if run.smoke else MOST_SLICES)
    forms(run, MOST_SLICES)
    around(run)
    others = bodies if run.smoke else bodies | MORE
    bounds(run, others)
    turns(run, others)
    cases = {name: [body] for name, body in (others if run.smoke else others | EARLY).items()}
    some = seeds[:EARLY_RANDOM]
    cases[f"{len(some)} random, p = 3"] = [((lambda seed=seed: random_problem(seed)), 0.0) for seed in some]
    early(run, cases, MAX_NODES)


def report(run: Run, rows) -> None:
    """The table of choices, and what each takes in all."""
    totals = {choice: [0, 0, 0.0] for choice in CHOICES}
    for row in rows:
        for k, column in enumerate(("nodes", "leaves", "s")):
            totals[row["choice"]][k] += row[column]
    first = totals["as it is"]
    run.table(
        "choices",
        rows,
        *(
            f"{choice}: {t[0] / first[0]:.2f} times the nodes, {t[1] / first[1]:.2f} times the leaves, "
            f"{t[2] / first[2]:.2f} times the seconds"
            for choice, t in totals.items()
            if choice != "as it is"
        ),
    )


def bounds(run: Run, bodies) -> None:
    """What excludes the children."""
    rows = []
    for name, body in bodies.items():
        _, engine = searched(*body, Counted)
        solved, excluded, disc, step = engine.count.tolist()
        rows.append({"problem": name, "solved": solved, "excluded": excluded, "by disc": disc, "by one step": step})
    total, disc, step = (sum(row[key] for row in rows) for key in ("excluded", "by disc", "by one step"))
    note = (
        f"of the children that the programs exclude discs exclude {disc / total:.0%}, one dual step {step / total:.0%}"
    )
    run.table("bounds", rows, note)


def turns(run: Run, bodies) -> None:
    """Where the first sectors lie."""
    rows = []
    for name, body in bodies.items():
        kept, *other = (searched(*body, SpaceRelaxation, {}, place)[0] for place in (None, 0.5, 0.0))
        rows.append({"problem": name, "nodes": kept[0], "middle": other[0][0], "end": other[1][0]})
    total, middle, end = (sum(row[key] for row in rows) for key in ("nodes", "middle", "end"))
    note = f"{middle / total:.2f} times the nodes with sectors centred where the first relaxation points"
    run.table("turned", rows, f"{note}; {end / total:.2f} times with an end there")
