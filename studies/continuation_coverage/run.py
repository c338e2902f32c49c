"""Does continuation, seeded by the branch graph, visit every arc? Random problems with p <= 6, and degenerate ones.

100 random problems on friction paths and loading paths, p = 1 .. 6. Beyond these, two sets that are not generic: small
integer data, and symmetric chains of coupled triangles, where branches meet in bifurcations and continua. Each graph is
computed in verified arithmetic and proven complete; where that does not come about it is counted. ``follow_all``
follows every branch from its starting points, starts arcs anew that these missed, and audits all paths against the
graph. Anything that is not visited, and every path that stalled, is listed with its cause.

Table: results/follow_all_random.csv, one row a kind of path and p; failures one by one below it.

Run: python studies/follow_all_random.py [number of problems]
"""

from __future__ import annotations

import sys
import time
from collections import Counter

from _output import report
from _random_paths import integer_path, random_path

from enumsol import branch_graph, follow_all, gallery

COUNT = 100
LARGEST = 6
INTEGER_COUNT, INTEGER_LARGEST = 60, 3
CHAINS = tuple(
    (p, coupling, f)
    for p in (2, 3)
    for coupling in (0.0, 0.25, 0.5, 1.0)
    for f in ((1.5, -4.0), (1.0, -2.0), (0.5, -3.0), (1.0, -3.0))
    # without coupling each node has a continuum of its own
    if coupling or f != (1.0, -2.0)
)
#: Arcs shorter than this are hardly visible to any step control; failures on them are told apart.
SHORT = 1e-6
SETS = {"friction": "random", "loading": "random", "integer": "integer", "chain": "symmetric chains"}
#: A path that ends within this of a vertex ended there.
NEAR = 1e-4


def causes(result):
    """Why a problem is not settled, one text a cause."""
    found = [f"path stalled at {place(result.graph, alpha)}" for alpha, _ in result.failures]
    found += ["jump"] * len(result.report.jumps) + ["point off the graph"] * len(result.report.off)
    for item in result.report.missed:
        length = item.interval[1] - item.interval[0]
        found.append("sheet" if item.sheet else ("arc shorter than 1e-6 missed" if length < SHORT else "arc missed"))
    return found + ["continuum missed"] * len(result.report.missed_families)


def place(graph, alpha):
    """What is at an alpha at which a path stalled."""
    kinds = {v.kind for v in graph.vertices if abs(v.alpha - alpha) < NEAR}
    names = {"family": "a continuum", "bifurcation": "a bifurcation", "fold": "a fold", "transition": "a transition"}
    return next((name for kind, name in names.items() if kind in kinds), "a regular point")


def cases(count):
    """Name, p, problem and interval of each."""
    for number in range(count):
        p, loading = 1 + number % LARGEST, number // LARGEST % 2 == 1
        yield "loading" if loading else "friction", p, *random_path(number, p, loading=loading)
    for number in range(INTEGER_COUNT):
        p = 1 + number // 3 % INTEGER_LARGEST
        yield "integer", p, *integer_path(number, p)
    for p, coupling, f in CHAINS:
        yield "chain", p, gallery.chain(p, coupling, f), (0.0, 8.0)


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    tallies, failures, unproven = {}, [], 0
    for number, (path, p, problem, interval) in enumerate(cases(count)):
        graph = branch_graph(problem, interval, "verified")
        unproven += not graph.complete
        started = time.process_time()
        result = follow_all(problem, interval, graph=graph)
        seconds = time.process_time() - started
        found = causes(result)
        failures += [(number, p, path, cause) for cause in found]
        tally = tallies.setdefault((path, p), Counter())
        tally.update(
            problems=1,
            settled=int(not found),
            proven=int(graph.complete),
            branches=len(graph.branches),
            arcs=len(graph.arcs),
            visited=len(result.report.visited),
            folds=len(graph.folds),
            bifurcations=len(graph.bifurcations),
            families=len(graph.families),
            paths=len(result.paths),
            reseeded=result.reseeded,
            corrections=result.stats.corrections,
            seconds=seconds,
        )
        tally["distance"] = max(tally["distance"], result.report.max_distance)
    columns = (
        *("problems", "settled", "proven", "branches", "arcs", "visited", "folds", "bifurcations", "families"),
        *("paths", "reseeded", "corrections", "seconds", "distance"),
    )
    rows = [{"path": path, "p": p, **{name: tally[name] for name in columns}} for (path, p), tally in tallies.items()]
    rows.sort(key=lambda row: (list(SETS).index(row["path"]), row["p"]))
    report("follow_all_random", rows, *notes(rows, failures, unproven))


def notes(rows, failures, unproven):
    for kind in dict.fromkeys(SETS.values()):
        part = [row for row in rows if SETS[row["path"]] == kind]
        total = {
            name: sum(row[name] for row in part) for name in ("problems", "settled", "arcs", "visited", "reseeded")
        }
        causes_here = Counter(cause for _, _, path, cause in failures if SETS[path] == kind)
        yield (
            f"{kind}: {total['settled']} of {total['problems']} problems settled, {total['visited']} of "
            f"{total['arcs']} arcs visited, {total['reseeded']} paths started anew, points within "
            f"{max(row['distance'] for row in part):.1g} of the graph; failures: "
            + (", ".join(f"{n} x {cause}" for cause, n in causes_here.items()) or "none")
        )
    if unproven:
        yield f"{unproven} graphs are not proven complete themselves"
    for (number, p, path, cause), n in Counter(failures).items():
        yield f"  problem {number} (p = {p}, {path}): {n} x {cause}"


if __name__ == "__main__":
    main()
