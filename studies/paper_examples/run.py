"""Do the paper's examples come out? Examples 6.1-6.3 against their closed forms, 6.4-6.7 on a geometry of our own.

Three tables. The first compares the exact branch graphs of the one-node examples with every printed fact, and 6.3' (a
perturbed 6.3) with its closed form; a fact that fails stops the script. The second applies the loads of 6.4-6.7 to
`gallery.two_node_square`: the paper's coordinates were never published, so that its printed numbers are not to be
expected here; they stand beside ours. The third follows every branch of every graph by Algorithm 5.1 with the paper's
settings, from each of its ends: every transition must be passed in both directions, and the audit must miss nothing.

Figures: results/paper_6.1.png .. paper_6.7-plus.png, with the adaptive steps as dots.

Run: python studies/paper_examples.py
"""

from __future__ import annotations

import math

import numpy as np
from _output import RESULTS, report

from enumsol import ContactStatus, ContinuationOptions, branch_graph, follow, gallery
from enumsol.continuation import follow_all, follow_arc, start_tangents

OPEN, STICK, MINUS, PLUS = (ContactStatus(name) for name in ("open", "stick", "slip-", "slip+"))
ONE_NODE = {
    "6.1": ("one-node-6.1", (1.5, -4.0)),
    "6.2": ("one-node-6.2", (1.5, 7.0)),
    "6.3": ("one-node-6.3", (1.0, -2.0)),
    "6.3'": ("one-node-6.3-perturbed", (0.98, -2.0)),
}
TWO_NODES = {
    "6.4": ("two-node-6.4", (0.0, 10.0)),
    "6.5": ("two-node-6.5", (0.0, 10.0)),
    "6.6": ("two-node-6.6", (0.0, 10.0)),
    "6.7, slopes -1.1, -0.8": ("two-node-6.7-minus", (-3.0, 3.0)),
    "6.7, slopes +1.1, +0.8": ("two-node-6.7-plus", (-3.0, 3.0)),
}
PRINTED = {
    "6.4": "three branches; at alpha = 5 at least five roots (1 + 2 + 2)",
    "6.5": "three branches; on one of them lambda_n1 stays while alpha goes back and forth",
    "6.6": "node 1 grazing, node 2 open for all alpha; vertical segment at alpha = 1.3333",
    "6.7": "piecewise linear branch; at most five roots, five values of lambda_n2 at a = 1.6",
}
INTERVAL = (0.0, 20.0)
#: The paper's range of h_max; its other settings are the defaults, and its alpha is not scaled.
LONGEST = (0.1, 1.0, 5.0)
SAMPLES = 201
#: Alphas of folds are the nearest floats of exact numbers, and so are the closed forms.
EXACT = 1e-14


def paper_options(h_max):
    return ContinuationOptions(h_max=h_max, alpha_scale=1.0)


# -- Examples 6.1-6.3: printed facts -----------------------------------------------------------------------------------


class Facts:
    """Rows of the table; a fact that does not hold stops the study."""

    def __init__(self):
        self.rows = []

    def number(self, example, fact, expected, found, tolerance=EXACT):
        """A number against its closed form."""
        error = abs(found - expected) / max(abs(expected), 1.0)
        assert error <= tolerance, (example, fact, expected, found)
        self._add(example, fact, f"{expected:.15g}", f"{found:.15g}", error)

    def curve(self, example, fact, function, arc, interval):
        """lambda_n along an arc against a function of alpha."""
        assert abs(arc.lo - interval[0]) <= EXACT * max(abs(arc.lo), 1.0), (example, fact, arc.lo)
        assert abs(arc.hi - interval[1]) <= EXACT * max(abs(arc.hi), 1.0), (example, fact, arc.hi)
        alphas = np.linspace(arc.lo, arc.hi, SAMPLES)[1:-1]
        expected = np.array([function(alpha) for alpha in alphas])
        error = np.max(np.abs([arc.values(alpha)[0][0] for alpha in alphas] - expected) / np.maximum(expected, 1.0))
        assert error <= 1e-13, (example, fact, error)
        self._add(example, fact, f"[{arc.lo:.6g}, {arc.hi:.6g}]", f"{len(alphas)} alphas agree", float(error))

    def truth(self, example, fact, expected, found):
        """Counts and the like."""
        assert expected == found, (example, fact, expected, found)
        self._add(example, fact, str(expected), str(found), 0.0)

    def _add(self, example, fact, expected, found, error):
        row = {"example": example, "fact": fact, "closed form": expected, "found": found, "difference": error}
        self.rows.append(row)


def arc_of(graph, status, at):
    (arc,) = [arc for arc in graph.arcs_at(at) if arc.statuses == (status,)]
    return arc


def example_1(facts, name, graph, f):
    """Type (jj), 6.1 and 6.3': an open branch, and stick and slip- that meet in a fold."""
    f_n, f_t = f
    fold = -f_t / f_n
    facts.truth(name, "number of branches", 2, len(graph.branches))
    facts.curve(name, "open, lambda_n = 0, for every alpha", lambda a: 0.0, arc_of(graph, OPEN, 1.0), INTERVAL)
    facts.truth(name, "number of folds", 1, len(graph.folds))
    facts.number(name, "fold at alpha = -f_t / f_n", fold, graph.folds[0].alpha)
    span = (fold, INTERVAL[1])
    facts.curve(name, f"stick, lambda_n = {f_n:g}, from the fold on", lambda a: f_n, arc_of(graph, STICK, 5.0), span)
    slip = arc_of(graph, MINUS, 5.0)
    text = "1 / (alpha - 2)" if name == "6.1" else "0.04 / (alpha - 2)"
    facts.curve(name, f"slip-, lambda_n = {text}", lambda a: -(2 * f_n + f_t) / (a - 2), slip, span)
    facts.truth(name, "index of slip-", -1, slip.index)
    facts.truth(name, "roots below and above the fold", (1, 3), tuple(graph.steps[2]))


def example_2(facts, name, graph, f):
    """Type (j): one branch."""
    f_n, f_t = f
    change = f_t / f_n
    facts.truth(name, "number of branches", 1, len(graph.branches))
    facts.truth(name, "folds and bifurcations", (0, 0), (len(graph.folds), len(graph.bifurcations)))
    facts.truth(name, "roots everywhere", (1, 1), tuple(graph.steps[2]))
    facts.number(name, "slip+ becomes stick at alpha = f_t / f_n", change, graph.transitions[0].alpha)
    slip, stick = arc_of(graph, PLUS, 1.0), arc_of(graph, STICK, 10.0)
    facts.curve(name, "slip+, lambda_n = 10 / (alpha + 2)", lambda a: 10 / (a + 2), slip, (0.0, change))
    facts.curve(name, "stick, lambda_n = 1.5", lambda a: f_n, stick, (change, INTERVAL[1]))


def example_3(facts, name, graph, f):
    """Type (jjj): two branches that meet in a vertical segment at alpha = (l + 3m) / (l + m)."""
    (point,) = graph.bifurcations
    ends = point.family.vertices[:, 0, :]
    facts.truth(name, "connected", 1, len(graph.components))
    facts.number(name, "bifurcation at alpha = (l+3m)/(l+m)", 2.0, point.alpha)
    facts.truth(name, "vertical segment of solutions", 1, point.family.dimension)
    facts.number(name, "lambda_n on it from", 0.0, float(ends[0, 0]))
    facts.number(name, "lambda_n on it to", f[0], float(ends[1, 0]))
    facts.truth(name, "arcs that meet it", 3, sum(point.number in (arc.tail, arc.head) for arc in graph.arcs))
    for at, span in ((1.0, (0.0, 2.0)), (5.0, (2.0, 20.0))):
        arc = arc_of(graph, OPEN, at)
        grazing = max(abs(arc.displacements(alpha)[0][0]) for alpha in arc.sampled())
        facts.curve(name, "branch 1, lambda_n = 0", lambda a: 0.0, arc, span)
        facts.number(name, "branch 1, u_n = 0 (grazing)", 0.0, grazing)
    facts.curve(name, "branch 2, stick, lambda_n = 1", lambda a: 1.0, arc_of(graph, STICK, 5.0), (2.0, 20.0))


# -- Examples 6.4-6.7: own geometry ------------------------------------------------------------------------------------


def own_row(example, graph):
    printed = PRINTED[example[:3]]
    most = max(graph.steps[2])
    return {
        "loads of": example,
        "printed, for the paper's geometry": printed,
        "ours: branches": len(graph.branches),
        "most roots": most,
        "folds": " ".join(f"{v.alpha:.6g}" for v in graph.folds) or "-",
        "transitions": " ".join(f"{v.alpha:.6g}" for v in graph.transitions) or "-",
        "roots over alpha": roots_over(graph),
        "complete": "proven" if graph.complete else "no",
    }


def roots_over(graph):
    """Multiplicity as text: 1 (alpha < 3), 5 (3, 3.83), .."""
    alphas, _, between = graph.steps
    merged = []
    for k, count in enumerate(between):
        if not merged or merged[-1][1] != count:
            merged.append((float(alphas[k]), count))
    ends = [start for start, _ in merged[1:]] + [graph.interval[1]]
    return ", ".join(f"{count} on {start:.4g}..{end:.4g}" for (start, count), end in zip(merged, ends, strict=True))


# -- continuation ------------------------------------------------------------------------------------------------------


def walks(problem, graph, options):
    """Paths from every end of a branch on the interval's border into the interval."""
    return [
        follow_arc(problem, graph, v.number, arc.number, options=options)
        for v in graph.vertices
        if v.border
        for arc in graph.arcs
        if v.number in (arc.tail, arc.head)
    ]


def vertical_walk(problem, graph, options):
    """Up the vertical segment of 6.3, from the bifurcation on the grazing branch."""
    (point,) = graph.bifurcations
    tangents = start_tangents(problem, point, graph.interval, options)
    up = min(range(len(tangents)), key=lambda k: abs(tangents[k].dalpha))
    return follow(problem, point, 1, graph.interval, options, tangent=up)


def check_passages(graph, paths):
    """Every transition and fold was passed, in both directions; their number."""
    passed = [(item.alpha, item.before, item.after) for path in paths for item in path.transitions]
    turning = [*graph.transitions, *graph.folds]
    for v in turning:
        here = [(before, after) for alpha, before, after in passed if math.isclose(alpha, v.alpha, rel_tol=1e-9)]
        ways = {
            (arc.statuses, other.statuses)
            for arc in graph.arcs
            for other in graph.arcs
            if arc is not other and v.number in (arc.tail, arc.head) and v.number in (other.tail, other.head)
        }
        assert len(ways) == 2, (v, ways)
        assert ways <= set(here), (v, ways, here)
    return len(turning)


def continuation_row(example, problem, graph, h_max):
    options = paper_options(h_max)
    paths = walks(problem, graph, options)
    assert all(path.status == "interval left" for path in paths)
    count = check_passages(graph, paths)
    if graph.families:
        up = vertical_walk(problem, graph, options)
        down = next(path for path in paths if path.transitions)
        names = [path.selections for path in (up, down)]
        assert names == [((MINUS,), (STICK,)), ((STICK,), (MINUS,), (OPEN,))], names
        paths.append(up)
        count += 2
    result = follow_all(problem, graph.interval, options, graph=graph)
    assert result.complete, result
    assert not result.failures, result
    stats = result.stats
    return {
        "example": example,
        "h_max": h_max,
        "transitions": count,
        "passed both ways": "all",
        "points": sum(len(path) for path in result.paths),
        "rejected": stats.rejected,
        "corrections": stats.corrections,
        "arcs": len(graph.arcs),
        "missed": len(result.report.missed) + len(result.report.missed_families),
        "jumps": len(result.report.jumps),
        "distance": result.report.max_distance,
    }


# -- figures -----------------------------------------------------------------------------------------------------------


def draw(file, title, problem, graph):
    """The graph with the accepted steps of one walk along every branch as dots."""
    figure = graph.plot(samples=129, figsize=(7.5, 2.2 + 2.5 * problem.p))
    paths = []
    for path in walks(problem, graph, paper_options(1.0)):
        if not any(same_ends(path, other) for other in paths):
            paths.append(path)
    for node in range(problem.p):
        axis = figure.axes[node]
        for path in paths:
            dots = [k for k, kind in enumerate(path.kinds) if kind != "transition"]
            axis.plot(path.alpha[dots], path.lambda_n[dots, node], ".", color="black", markersize=4, zorder=3.5)
    figure.axes[0].set_title(f"{title}; dots: accepted steps, h_max = 1", fontsize=9, loc="left")
    figure.savefig(RESULTS / file, dpi=150)


def same_ends(path, other):
    """Whether one path is the other walked back."""
    ends = [np.concatenate([[item.alpha[k]], item.lambda_n[k]]) for item, k in ((path, 0), (other, -1))]
    backs = [np.concatenate([[item.alpha[k]], item.lambda_n[k]]) for item, k in ((path, -1), (other, 0))]
    return np.allclose(*ends, atol=1e-6) and np.allclose(*backs, atol=1e-6)


def main():
    RESULTS.mkdir(exist_ok=True)
    facts, own, continuation = Facts(), [], []
    checks = {"6.1": example_1, "6.2": example_2, "6.3": example_3, "6.3'": example_1}
    for example, (name, f) in ONE_NODE.items():
        problem = gallery.get(name).build()
        graph = branch_graph(problem, INTERVAL, "exact")
        assert graph.complete
        checks[example](facts, example, graph, f)
        continuation += [continuation_row(example, problem, graph, h_max) for h_max in LONGEST]
        file = f"paper_{example.replace(chr(39), '-perturbed')}.png"
        draw(file, f"Example {example}, f = ({f[0]:g}, {f[1]:g})", problem, graph)
    for example, (name, interval) in TWO_NODES.items():
        problem = gallery.get(name).build()
        graph = branch_graph(problem, interval, "exact")
        assert graph.complete
        short = name.removeprefix("two-node-")
        own.append(own_row(example, graph))
        continuation += [continuation_row(f"{short} (own)", problem, graph, h_max) for h_max in LONGEST]
        title = f"Own geometry, loads of Example {example}"
        draw(f"paper_{short}.png", title, problem, graph)
    print("Examples 6.1-6.3 and 6.3' (one node): the printed facts")
    report("paper_examples", facts.rows, f"all {len(facts.rows)} facts hold")
    print("\nLoads of Examples 6.4-6.7 on our own geometry (gallery.two_node_square), not the paper's")
    report("paper_examples_own", own, "own geometry: the paper's coordinates are not known, its numbers not expected")
    print("\nAlgorithm 5.1 with the paper's settings, every branch from both of its ends")
    report(
        "paper_examples_continuation",
        continuation,
        "every transition and fold was passed in both directions; no arc or continuum missed, no jump",
    )


if __name__ == "__main__":
    main()
