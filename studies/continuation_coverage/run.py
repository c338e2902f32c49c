"""Does continuation, started from the branch graph, visit every arc?

100 random problems on friction paths and loading paths, p = 1 .. 6. Beyond these, two sets that are not generic: small
integer data, and symmetric chains of coupled triangles, where branches meet in bifurcations and continua. Each graph is
computed in verified arithmetic and proven complete; where that does not come about it is counted. ``follow_all``
follows every branch from its starting points, starts arcs anew that these missed, and audits all paths against the
graph.

Read ``settled``: problems of which every arc was visited and no path stalled. What was not visited, and every path that
stalled, is listed with its cause below the table.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from enumsol import branch_graph, follow_all, gallery
from shared.clock import timed
from shared.random_paths import integer_path, random_path

if TYPE_CHECKING:
    from shared.results import Run

COUNT, SMOKE_COUNT = 100, 8
LARGEST = 6
INTEGER_COUNT, SMOKE_INTEGER_COUNT, INTEGER_LARGEST = 60, 4, 3
CHAINS = tuple(
    (p, coupling, f)
    for p in (2, 3)
    for coupling in (0.0, 0.25, 0.5, 1.0)
    for f in ((1.5, -4.0), (1.0, -2.0), (0.5, -3.0), (1.0, -3.0))
    # without coupling each node has a continuum of its own
    if coupling or f != (1.0, -2.0)
)
SMOKE_CHAINS = ((2, 0.25, (1.0, -2.0)),)
#: Arcs shorter than this are hardly visible to any step control; failures on them are told apart.
SHORT = 1e-6
SETS = {"friction": "random", "loading": "random", "integer": "integer", "chain": "symmetric chains"}
#: A path that ends within this of a vertex ended there.
NEAR = 1e-4
COLUMNS = (
    *("problems", "settled", "proven", "branches", "arcs", "visited", "folds", "bifurcations", "families"),
    *("paths", "reseeded", "corrections", "seconds", "distance"),
)


def cases(smoke):
    """Kind of path, p, problem and interval of each."""
    count, integers, chains = (
        (SMOKE_COUNT, SMOKE_INTEGER_COUNT, SMOKE_CHAINS) if smoke else (COUNT, INTEGER_COUNT, CHAINS)
    )
    for number in range(count):
        p, loading = 1 + number % LARGEST, number // LARGEST % 2 == 1
        yield "loading" if loading else "friction", p, *random_path(number, p, loading=loading)
    for number in range(integers):
        p = 1 + number // 3 % INTEGER_LARGEST
        yield "integer", p, *integer_path(number, p)
    for p, coupling, f in chains:
        yield "chain", p, gallery.chain(p, coupling, f), (0.0, 8.0)


def causes(result):
    """Why a problem is not settled, one text a cause."""
    found = [f"path stalled at {place(result.graph, alpha)}" for alpha, _ in result.failures]
    found += ["jump"] * len(result.report.jumps) + ["point off the graph"] * len(result.report.off)
    # a graph with a hole does not tell whether these are right
    found += ["point not compared"] * len(result.report.not_compared)
    found += ["pair not joined"] * len(result.report.unjoined)
    for item in result.report.missed:
        length = item.interval[1] - item.interval[0]
        found.append(
            "sheet" if item.sheet else (f"arc shorter than {SHORT:g} missed" if length < SHORT else "arc missed")
        )
    return found + ["continuum missed"] * len(result.report.missed_families)


def place(graph, alpha):
    """What is at an alpha at which a path stalled."""
    near = [v for v in graph.vertices if abs(v.alpha - alpha) < NEAR]
    if any(v.family is not None for v in near):
        return "a continuum"
    for vertices, name in (
        (graph.bifurcations, "a bifurcation"),
        (graph.folds, "a fold"),
        (graph.transitions, "a transition"),
    ):
        if {v.number for v in near} & {v.number for v in vertices}:
            return name
    return "a regular point"


def counts(problem, interval, graph):
    """What following everything gave on one problem, and the causes of failure."""
    result, seconds = timed(lambda: follow_all(problem, interval, graph=graph))
    found = causes(result)
    return found, {
        "problems": 1,
        "settled": int(not found),
        "proven": int(graph.complete),
        "branches": len(graph.branches),
        "arcs": len(graph.arcs),
        "visited": len(result.report.visited),
        "folds": len(graph.folds),
        "bifurcations": len(graph.bifurcations),
        "families": len(graph.families),
        "paths": len(result.paths),
        "reseeded": result.reseeded,
        "corrections": result.stats.corrections,
        "seconds": seconds,
        "distance": result.report.max_distance,
    }


def notes(rows, failures):
    """Sums by set, then every failure with its problem."""
    for kind in dict.fromkeys(SETS[row["path"]] for row in rows):
        part = [row for row in rows if SETS[row["path"]] == kind]
        total = {name: sum(row[name] for row in part) for name in COLUMNS}
        here = Counter(cause for _, _, path, cause in failures if SETS[path] == kind)
        yield (
            f"{kind}: {total['settled']} of {total['problems']} problems settled, {total['visited']} of "
            f"{total['arcs']} arcs visited, {total['reseeded']} paths started anew, points within "
            f"{max(row['distance'] for row in part):.1g} of the graph; failures: "
            + (", ".join(f"{n} x {cause}" for cause, n in here.items()) or "none")
        )
    unproven = sum(row["problems"] - row["proven"] for row in rows)
    if unproven:
        yield f"{unproven} graphs are not proven complete themselves"
    for (number, p, path, cause), n in Counter(failures).items():
        yield f"  problem {number} (p = {p}, {path}): {n} x {cause}"


def main(run: Run) -> None:
    tallies, failures = {}, []
    for number, (path, p, problem, interval) in enumerate(cases(run.smoke)):
        found, one = counts(problem, interval, branch_graph(problem, interval))
        failures += [(number, p, path, cause) for cause in found]
        tally = tallies.setdefault((path, p), dict.fromkeys(COLUMNS, 0))
        for name, value in one.items():
            tally[name] = max(tally[name], value) if name == "distance" else tally[name] + value
    order = list(SETS)
    rows = [{"path": path, "p": p, **tally} for (path, p), tally in tallies.items()]
    rows.sort(key=lambda row: (order.index(row["path"]), row["p"]))
    run.table("follow_all_random", rows, *notes(rows, failures))
