"""Searches in 3D that test leaves earlier than the product: before violations vanish, or before statuses are final."""

from __future__ import annotations

from functools import cached_property
from itertools import product
from math import atan2, prod
from time import process_time
from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np

from enumsol.model.sectors import DEEPEST, SECTORS, around, contains, direction, end_number, nearest, width_level
from enumsol.model.statuses import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.relaxation.space_relaxation import SpaceEngine, SpaceRelaxation
from enumsol.search.nodes import Relaxations
from enumsol.search.outcome import SearchLimits
from enumsol.search.space import space_search as space
from enumsol.search.space.space_search import SpaceSolvers, SpaceSplitting
from enumsol.search.tree import TreeSearch
from enumsol.trusted.space.leaves import Open, SpaceRoot, distinct_roots, settle

if TYPE_CHECKING:
    from shared.results import Run

PARTIAL = (CONTACT, UNDECIDED)
#: Levels of the sectors in which what a minimiser points to is tested; completions tested of an assignment, at most.
WIDTHS, COMPLETIONS = (3, 5), 6**3
CHOICES = {
    "as it is": {},
    **{f"final, level {level}": {"level": level} for level in (2, 3, 4, 5, 6)},
    "final, level 6, widest halved": {"level": 6, "again": 1},
    **{f"completions of {k}": {"level": 2, "undecided": k} for k in (1, 2, 3)},
    **{f"suggested, {k}": {"suggested": k} for k in (1, 2, 3)},
}


class Relaxation(SpaceRelaxation):
    """The product's, whose engine looks at an assignment first."""

    __slots__ = ()

    def choose(self, codes):
        """The node to branch on; -1 if the assignment is settled."""
        return -1 if self._engine.closes(codes, self) else super().choose(codes)


class Engine(SpaceEngine):
    """Tests assignments before they are branched on.

    ``level``: those with final statuses and no wider sector; ``again``: after a test that failed only when the widest
    sector is so many levels narrower; ``undecided``: all completions of those with at most so many undecided nodes,
    until one is left open; ``suggested``: of those the one that the minimiser points to; if it holds a root, no leaf in
    the root's box is tested.
    """

    def __init__(self, system, enclosed, level=None, again=0, undecided=0, suggested=None):
        super().__init__(system)
        self.enclosed, self.level, self.again = enclosed, level, again
        self.undecided, self.suggested = undecided, suggested
        self.answers, self.closed, self.failed, self.roots = {}, {}, {}, []
        self.first_root, self.examined, self.branched = 0, 0, []

    def root(self, rows, modes):
        """The relaxation with the given rows on."""
        return Relaxation(self, self._state(self.data), rows, modes)

    def answer(self, enclosed, codes):
        """What a leaf holds, tested once."""
        if codes in self.closed:
            return self.closed[codes]
        if codes not in self.answers:
            answer = self.answers[codes] = settle(enclosed, codes)
            if isinstance(answer, SpaceRoot):
                self.first_root = self.first_root or self.examined
                self.roots.append((codes, answer))
        return self.answers[codes]

    def left_open(self, codes):
        """Whether a test does not settle a leaf."""
        return isinstance(self.answer(self.enclosed, codes), Open)

    def closes(self, codes, relaxation):
        """Whether an assignment is settled before it is branched on."""
        nodes = [node for node, code in enumerate(codes) if code in PARTIAL]
        if self.suggested is not None and len(nodes) <= self.suggested:
            self.suggest(codes, relaxation)
            known = [root for other, root in self.roots if not nodes and inside(codes, other, root)]
            if known:
                self.closed[codes] = known[0]
            return bool(known)
        widest = min((width_level(code - SECTORS) for code in codes if code > SECTORS), default=DEEPEST)
        if self.level is None or widest < self.level:
            return False
        if nodes:
            return len(nodes) <= self.undecided and self.completed(codes, nodes)
        before = [self.failed[parent] for parent in parents(codes) if parent in self.failed]
        if before and widest < max(before) + self.again:
            self.failed[codes] = max(before)
        elif self.left_open(codes):
            self.failed[codes] = widest
        else:
            return True
        return False

    def completed(self, codes, nodes):
        """Whether tests settle all completions."""
        finals = [self.finals(node, codes[node]) for node in nodes]
        if prod(map(len, finals)) > COMPLETIONS:
            return False
        for choice in product(*finals):
            full = list(codes)
            for node, code in zip(nodes, choice, strict=True):
                full[node] = code
            if self.left_open(tuple(full)):
                return False
        self.closed[codes] = None
        return True

    def finals(self, node, code):
        """Final statuses of a node, sectors not halved."""
        return (
            [f for child in self.children(node, code) for f in self.finals(node, child)] if code in PARTIAL else [code]
        )

    def suggest(self, codes, relaxation):
        """Test the completion that the minimiser points to, in sectors of some widths."""
        for width in WIDTHS:
            full = tuple(self.pointed(node, code, relaxation, width) for node, code in enumerate(codes))
            if any(inside(full, other, root) for other, root in self.roots) or not self.left_open(full):
                break

    def pointed(self, node, code, relaxation, width):
        """The final status of a node that the minimiser points to."""
        force, gap = relaxation.forces[node], -relaxation.displacements[node]
        tau, v = (self.system.tangential(x)[node] for x in (relaxation.forces, relaxation.displacements))
        slips = np.linalg.norm(v) >= force - np.linalg.norm(tau)
        if code == UNDECIDED:
            code = self.children(node, code)[1] if force > gap else OPEN
        if code == CONTACT and not slips:
            return STICK
        if code == CONTACT and self.tangents[node] == 1:
            return SLIP_PLUS if np.sum(tau + v) > 0 else SLIP_MINUS
        if code != CONTACT and code <= SECTORS:
            return code
        x, y = (v / (np.linalg.norm(v) + 1e-300) + tau / (np.linalg.norm(tau) + 1e-300)).tolist()
        number = nearest(x, y, DEEPEST) >> (DEEPEST - width)
        return SECTORS + number if code == CONTACT or contains(code - SECTORS, number) else code


def parents(codes):
    """Assignments with one sector twice as wide."""
    for node, code in enumerate(codes):
        if code - SECTORS >= 8:
            yield (*codes[:node], SECTORS + around([code - SECTORS]), *codes[node + 1 :])


def inside(codes, other, root):
    """Whether a complete assignment lies in the box in which a root is the only one."""
    if [min(code, SECTORS + 1) for code in codes] != [min(code, SECTORS + 1) for code in other]:
        return False
    numbers = [code - SECTORS for code in codes if code > SECTORS]
    for number, (x, y), reach in zip(numbers, root.centre.tolist(), root.reach.tolist(), strict=True):
        for a, b in (direction(number), direction(end_number(number))):
            if abs(atan2(x * b - y * a, x * a + y * b)) > reach - 1e-12:
                return False
    return True


class Search(TreeSearch):
    """Notes how many nodes are undecided in what it branches on."""

    def examine(self, item):
        """Settle one node of the tree, or give its children."""
        self.relaxations.engine.examined += 1
        children = super().examine(item)
        self.relaxations.engine.branched += len(children) * [sum(code in PARTIAL for code in item.codes)]
        return children


class Solvers(SpaceSolvers):
    """A search with such an engine."""

    def __init__(self, problem, alpha, choice):
        super().__init__(problem, alpha, "verified")
        self.choice = choice

    @cached_property
    def _engine(self):
        return Engine(self.system, self.enclosed, **self.choice)

    def search(self, certifier, limits=None, progress=None):
        """A search of the tree."""
        splitting = SpaceSplitting(self._engine)
        relaxations = Relaxations(self._engine, splitting, self.system.p)
        return Search(relaxations, certifier, limits=limits, progress=progress)

    def searched(self, limits):
        """What a search takes, and its engine."""
        engine = self._engine
        started = process_time()
        with patch.object(space, "settle", engine.answer):
            outcome = self.search(self.certifier(None), limits).run()
        seconds = process_time() - started
        wasted = sum(isinstance(answer, Open) for answer in engine.answers.values())
        taken = {
            "nodes": outcome.nodes,
            "tests": len(engine.answers),
            "wasted": wasted,
            "first root": engine.first_root,
        }
        taken |= {"roots": len(distinct_roots(engine.roots)[0])}
        return taken | {"complete": outcome.stopped is None and not outcome.undecided, "s": seconds}, engine


def early(run: Run, cases, max_nodes) -> None:
    """The tables of the tests, and of what they could save."""
    rows, possible = [], []
    for name, problems in cases.items():
        for choice, values in CHOICES.items():
            results, branched = [], []
            for build, alpha in problems:
                problem = build()
                problem.enclosure  # noqa: B018 (made once, not part of the search)
                taken, engine = Solvers(problem, alpha, values).searched(SearchLimits(max_nodes=max_nodes))
                results.append(taken)
                branched += engine.branched
            totals = {key: sum(result[key] for result in results) for key in results[0]}
            totals["complete"] = all(result["complete"] for result in results)
            rows.append({"choice": choice, "problem": name, **totals})
            if not values:
                counts = {f"below {k} undecided": sum(undecided <= k for undecided in branched) for k in range(4)}
                possible.append({"problem": name, "nodes": totals["nodes"], **counts})
    rows.sort(key=lambda row: list(CHOICES).index(row["choice"]))
    run.table("early", rows, *notes(rows))
    total = {key: sum(row[key] for row in possible) for key in possible[0] if key != "problem"}
    shares = ", ".join(f"{total[key] / total['nodes']:.0%} {key}" for key in total if key != "nodes")
    run.table("below", possible, f"of the nodes lie {shares}: no test made there can save more than these")


def notes(rows):
    """What each choice takes, in all and in the worst case, and what that means."""
    first = {row["problem"]: row for row in rows if row["choice"] == "as it is"}
    keys = "nodes", "tests", "wasted", "first root", "s"
    total = {
        choice: {key: sum(row[key] for row in rows if row["choice"] == choice) for key in keys} for choice in CHOICES
    }
    before, worst = total["as it is"], {}
    for choice, taken in total.items():
        if choice == "as it is":
            continue
        mine = [(row, first[row["problem"]]) for row in rows if row["choice"] == choice]
        ratios = [row["nodes"] / other["nodes"] for row, other in mine]
        worst[choice] = max(row["s"] / other["s"] for row, other in mine)
        ratio = {key: taken[key] / before[key] for key in ("nodes", "tests", "s")}
        nodes = f"{ratio['nodes']:.2f} times the nodes ({min(ratios):.2f} to {max(ratios):.2f})"
        tests = f"{ratio['tests']:.2f} times the tests, {taken['wasted'] / taken['tests']:.0%} of them wasted"
        yield f"{choice}: {nodes}, {tests}, {ratio['s']:.2f} times the seconds (at worst {worst[choice]:.2f})"
    yield from verdicts(total, worst)


def verdicts(total, worst):
    """A sentence about each kind of test."""
    before, final = total["as it is"], [choice for choice in worst if choice.startswith("final")]
    best = min(final, key=lambda choice: total[choice]["s"])
    times = total[best]["s"] / before["s"]
    least = {kind: min(total[c]["nodes"] for c in worst if c.startswith(kind)) for kind in ("final", "compl", "sugg")}
    pays = "pay" if times <= 0.9 and worst[best] <= 1.1 else "do not pay"
    yield (
        f"Tests as soon as statuses are final {pays}: they save at most {1 - least['final'] / before['nodes']:.0%} of "
        f"the nodes; the quickest ({best}) takes {times:.2f} times the seconds, {worst[best]:.2f} at worst."
    )
    yield f"Tests of all completions leave {least['compl']} nodes at least, those of final statuses {least['final']}."
    found = [total[choice]["first root"] for choice in ("suggested, 3", "final, level 2", "as it is")]
    yield (
        f"Tests of what minimisers point to leave {least['sugg']}; first roots come after {found[0]} nodes in all, "
        f"after {found[1]} with tests of final statuses and after {found[2]} without either."
    )
