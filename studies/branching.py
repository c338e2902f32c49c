"""Which contact node is a partial assignment branched on? Trees and times of rules that look ahead by little or much.

The package takes, among the candidates with the largest violation of complementarity, the one whose children close most
of the gap to pruning, where one step of the dual method bounds each child from below. The table compares numbers of
candidates, and two rules that the package does not have, built here as engines on top of its own:

full lookahead
    the children's programs of the 4 or 12 first candidates are solved; the solutions of the chosen one are kept.
pseudo-costs
    the mean gain of earlier branchings of the same node into the same status, once each of its children has been seen 1
    or 4 times; until then as full lookahead with 12 candidates.

The measure by which a candidate is chosen is the same for all, and so is presolve, which comes first. Times are process
times, the least of some runs, with the condensed problem and its enclosure made before. Searches are cut at a number of
nodes; verified arithmetic is left out where the fast search was cut, and the figure leaves cut searches out. The two
rules that the package does not have choose in Python: their seconds are somewhat too long, nodes and programs are not.

Table: results/branching.csv; figure: results/branching.png.

Run: OMP_NUM_THREADS=1 python studies/branching.py
"""

from __future__ import annotations

import math
import statistics
import time
from collections import defaultdict
from functools import partial
from unittest.mock import patch

import numpy as np
from _output import RESULTS, report

import enumsol
from enumsol import gallery
from enumsol.relaxation import active_set
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import BRANCHING_CANDIDATES, PRUNE_MARGIN
from enumsol.relaxation.rows import status_rows
from enumsol.search import tree
from enumsol.statuses import CONTACT, OPEN, SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED

MAX_NODES = 30_000
#: Searches shorter than this are repeated.
SHORT = 0.3
RUNS = 2
#: Part of the gap below which a child's gain makes no difference, as in the package's rule.
LEAST = 1e-3


def problems():
    """(name, builder, alpha), from easy to hard."""
    block = gallery.clamped_block
    for p, length, traction, F in (
        (32, 1.0, (0.3, -1.0), 1.0),
        (32, 2.0, (1.0, -0.3), 10.0),
        (32, 2.0, (0.3, -1.0), 0.3),
        (64, 1.0, (0.3, -1.0), 1.0),
        (64, 1.0, (1.0, -0.3), 1.0),
        (64, 2.0, (1.0, -0.3), 1.0),
        (64, 2.0, (1.0, -0.3), 10.0),
        (64, 1.0, (0.3, -1.0), 0.3),
        (100, 2.0, (0.3, -1.0), 10.0),
        (100, 1.0, (1.0, -0.3), 10.0),
        (100, 1.0, (0.3, -1.0), 1.0),
        (100, 2.0, (1.0, -0.3), 1.0),
    ):
        name = f"block {p} ({traction[0]:g}, {traction[1]:g}) length {length:g}"
        yield name, partial(block, p, p // 2, length, traction=traction), F
    for p in (14, 32):
        yield f"wedge {p} straight", partial(gallery.wedge, 4, p // 2), 1.0
        yield f"wedge {p} oblique", partial(gallery.wedge, 4, p // 2, (4e-4, 1e-3)), 2.2


class Lookahead(ActiveSetEngine):
    """Branches on the candidate whose children's solved programs, or means of earlier ones, close most of the gap.

    Parameters
    ----------
    system : ScaledSystem
    candidates : int
        How many nodes are looked at, those with the largest violation.
    trust : float
        How often each child of a node must have been seen before the means are taken for it.
    """

    def __init__(self, system, candidates, trust=math.inf):
        super().__init__(system)
        self.F, self.candidates, self.trust = system.F, candidates, trust
        self.solved = 0
        self.seen = defaultdict(lambda: [0, 0.0])  # row numbers of a child -> how often, and the sum of its shares

    def root(self, rows, modes):
        """The relaxation with the given rows on."""
        self.solved += 1
        return _Looking(self, super().root(rows, modes))


class _Looking:
    """A relaxation of the package with another choice; children solved for the choice are kept."""

    def __init__(self, engine, inner):
        self._engine, self._inner, self._ready = engine, inner, {}

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def child(self, rows, modes, *, last):
        """The relaxation with further rows switched on."""
        key = (*rows, *modes)
        if key in self._ready:
            return self._ready.pop(key)
        engine, before = self._engine, self.bound
        engine.solved += 1
        answer = _Looking(engine, self._inner.child(rows, modes, last=last))
        seen = engine.seen[key]
        seen[0] += 1
        seen[1] += closed(answer, before)
        return answer

    def choose(self, codes):
        """The contact node to branch on, -1 when all are decided."""
        best, chosen = -1.0, (-1, {})
        for node, violation in self._candidates(np.array(codes)):
            shares, solved = self._shares(node, codes[node])
            if solved and sum(share >= 1.0 for share in shares) >= len(shares) - 1:
                chosen = node, solved
                break
            value = measure(shares) * max(violation, 1e-12)
            if value > best:
                best, chosen = value, (node, solved)
        self._ready = chosen[1]
        return chosen[0]

    def _candidates(self, codes):
        F, force, w, p = self._engine.F, self.forces, self.displacements, len(codes)
        slip = F * force[:p] * np.abs(w[p:]) - force[p:] * w[p:]
        # as engine.largest_violation
        violation = np.where(codes == UNDECIDED, slip - force[:p] * w[:p], 0.0) + slip
        nodes = np.flatnonzero(codes >= CONTACT)
        nodes = nodes[np.argsort(-violation[nodes], kind="stable")][: self._engine.candidates]
        return [(int(i), float(violation[i])) for i in nodes]

    def _shares(self, node, code):
        """What each child closes of the gap, and the children's relaxations as far as they had to be solved."""
        codes = (OPEN, CONTACT) if code == UNDECIDED else (STICK, SLIP_PLUS, SLIP_MINUS)
        keys = [self._key(node, child) for child in codes]
        seen = [self._engine.seen[key] for key in keys]
        if min(count for count, _ in seen) >= self._engine.trust:
            return [total / count for count, total in seen], {}
        half = [len(key) // 2 for key in keys]
        solved = {key: self.child(list(key[:n]), list(key[n:]), last=False) for key, n in zip(keys, half, strict=True)}
        return [closed(answer, self.bound) for answer in solved.values()], solved

    def _key(self, node, code):
        rows = status_rows(code, friction=True)
        return (*(kind * len(self._engine.F) + node for kind, _ in rows), *(mode for _, mode in rows))


def closed(relaxation, before):
    """Part of the gap between the parent's bound and pruning that a child closes."""
    if relaxation.pruned or relaxation.stalled:
        return float(relaxation.pruned)
    return min(1.0, max(0.0, relaxation.bound - before) / max(PRUNE_MARGIN - before, 1e-300))


def measure(shares):
    """The measure of the package's rule: the product of the two least shares, and of the root of a third."""
    ordered = sorted(share + LEAST for share in shares)
    return math.prod(ordered[:2]) * math.prod(math.sqrt(share) for share in ordered[2:])


def one_step(candidates):
    def make(system):
        with patch.object(active_set, "BRANCHING_CANDIDATES", min(candidates, system.p)):
            return ActiveSetEngine(system)

    return make


BASE = "largest violation"
ONE_STEP = {k: f"one step, {k}" for k in (4, 8, 16, 24, 40)} | {10**4: "one step, all"}
#: Rule -> what makes its engine for a system.
RULES = {
    BASE: one_step(1),
    **{name: one_step(k) for k, name in ONE_STEP.items()},
    "full lookahead, 4": partial(Lookahead, candidates=4),
    "full lookahead, 12": partial(Lookahead, candidates=12),
    "pseudo-costs after 1": partial(Lookahead, candidates=12, trust=1),
    "pseudo-costs after 4": partial(Lookahead, candidates=12, trust=4),
}
#: The package's own.
TAKEN = ONE_STEP[BRANCHING_CANDIDATES]


def timed(problem, alpha, arithmetic, rule):
    """Least process time of some runs, the last answer and how many programs it solved."""
    engines, best, runs = [], math.inf, 0

    def make(system):
        engines.append(RULES[rule](system))
        return engines[-1]

    with patch.object(tree, "ActiveSetEngine", make):
        while runs < RUNS:
            start = time.process_time()
            roots = enumsol.enumerate_roots(problem, alpha, arithmetic, max_nodes=MAX_NODES)
            best = min(best, time.process_time() - start)
            runs = RUNS if best > SHORT else runs + 1
    return best, roots, getattr(engines[-1], "solved", roots.stats.qps)


def run(name, problem, alpha):
    """One row a rule; all that finish must find the same number of roots."""
    rows = []
    for rule in RULES:
        fast, roots, qps = timed(problem, alpha, "fast", rule)
        cut = roots.stopped is not None
        verified = None if cut else timed(problem, alpha, "verified", rule)
        row = {
            "problem": name,
            "F": alpha,
            "rule": rule,
            "roots": len(roots),
            "nodes": roots.stats.nodes,
            "QPs": qps,
            "fast s": fast,
            "verified s": "-" if cut else verified[0],
            "cut": "yes" if cut else "",
        }
        if not cut:
            assert len(verified[1]) == len(roots)
        rows.append(row)
    assert len({row["roots"] for row in rows if not row["cut"]}) <= 1
    return rows


MEASURES = ("nodes", "QPs", "fast s", "verified s")


def ratios(rows, rule, column, base=BASE):
    """Problem -> value of the rule over that of another one, where both finished."""
    table = {(row["rule"], row["problem"], row["F"]): row for row in rows if not row["cut"]}
    return {
        f"{problem}, F = {F:g}": row[column] / table[base, problem, F][column]
        for (name, problem, F), row in table.items()
        if name == rule and (base, problem, F) in table
    }


def conclusions(rows):
    """Notes below the table, all from the data."""
    finished = [set(ratios(rows, rule, "nodes")) for rule in RULES]
    number = len({(row["problem"], row["F"]) for row in rows})
    yield f"Ratios to the rule {BASE!r}, geometric means over the problems that both finish:"
    for rule, known in zip(RULES, finished, strict=True):
        if rule == BASE:
            continue
        means = {c: statistics.geometric_mean(ratios(rows, rule, c).values()) for c in MEASURES}
        nodes = ratios(rows, rule, "nodes")
        worst = max(nodes, key=nodes.get)
        yield (
            f"{rule}: "
            + ", ".join(f"{column} {mean:.2f}" for column, mean in means.items())
            + f"; more nodes on {sum(value > 1 for value in nodes.values())} of {len(known)}, at worst "
            f"{nodes[worst]:.2f} times as many ({worst})"
            + (f"; {number - len(known)} cut at {MAX_NODES} nodes" if len(known) < number else "")
        )
    yield from against_taken(rows)
    for column in ("fast s", "verified s"):
        lost = [f"{name} ({value:.2f})" for name, value in ratios(rows, TAKEN, column).items() if value > 1.0]
        yield f"{column}: {TAKEN!r}, the package's, takes longer than {BASE!r} on: {'; '.join(lost) or 'none'}"


def against_taken(rows):
    """How the numbers of candidates compare by time: in the mean, in sum and at worst, where all of them finish."""
    rules = (BASE, *ONE_STEP.values())
    common = set.intersection(*(set(ratios(rows, rule, "nodes")) for rule in rules))
    yield f"By time, on the {len(common)} problems that every number of candidates finishes:"
    for column in ("fast s", "verified s"):
        over = {rule: {k: v for k, v in ratios(rows, rule, column, TAKEN).items() if k in common} for rule in rules}
        sums = dict.fromkeys(rules, 0.0)
        for row in rows:
            if row["rule"] in sums and f"{row['problem']}, F = {row['F']:g}" in common:
                sums[row["rule"]] += row[column]
        yield f"{column}, over {TAKEN!r}: " + "; ".join(
            f"{rule}: mean {statistics.geometric_mean(over[rule].values()):.2f}, sum {sums[rule] / sums[TAKEN]:.2f}, "
            f"from {min(over[rule].values()):.2f} to {max(over[rule].values()):.2f}"
            for rule in rules
            if rule != TAKEN
        )


def draw(rows):
    """Nodes and seconds of every rule relative to the largest violation, a dot a problem, a bar the mean."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    names = [rule for rule in RULES if rule != BASE]
    for axis, column in zip(axes, ("nodes", "verified s"), strict=True):
        for k, rule in enumerate(names):
            values = ratios(rows, rule, column)
            for name, value in values.items():
                colour = "#c0392b" if name.startswith("wedge") else "#1f5fa8"
                axis.plot(k, value, "o", color=colour, alpha=0.55, markersize=5, markeredgewidth=0)
            mean = statistics.geometric_mean(values.values())
            axis.plot([k - 0.3, k + 0.3], [mean, mean], color="black", linewidth=2)
        axis.axhline(1.0, color="#9a9a9a", linewidth=0.8, zorder=0)
        axis.set_yscale("log")
        axis.set_yticks([0.1, 0.2, 0.5, 1, 2, 5, 10], ["0.1", "0.2", "0.5", "1", "2", "5", "10"])
        axis.set_xticks(range(len(names)), names, rotation=35, ha="right")
        axis.set_title({"nodes": "nodes of the tree", "verified s": "process time, verified"}[column], fontsize=10)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel(f"relative to {BASE}")
    for name, colour in (("blocks", "#1f5fa8"), ("wedges", "#c0392b")):
        axes[1].plot([], [], "o", color=colour, label=name, markeredgewidth=0)
    axes[1].plot([], [], color="black", linewidth=2, label="geometric mean")
    axes[1].legend(frameon=False, loc="upper left", fontsize=9)
    figure.savefig(RESULTS / "branching.png", dpi=150)


def main():
    rows = []
    for name, build, alpha in problems():
        problem = build()
        problem.condensed, problem.enclosure  # noqa: B018 (made once, outside the clock)
        rows += run(name, problem, alpha)
    draw(rows)
    report("branching", rows, *conclusions(rows))


if __name__ == "__main__":
    main()
