"""The paper's Examples 6.1 to 6.3 and 6.3' (a perturbed 6.3), one node: the branch graph against every printed fact."""

from __future__ import annotations

import numpy as np

from enumsol import ContactStatus

OPEN, STICK, MINUS, PLUS = (ContactStatus(name) for name in ("open", "stick", "slip-", "slip+"))
INTERVAL = (0.0, 20.0)
SAMPLES = 201
#: Alphas of folds are the nearest floats of exact numbers, and so are the closed forms.
EXACT = 1e-14


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


#: Example -> gallery name, load, and the check of its printed facts.
ONE_NODE = {
    "6.1": ("one-node-6.1", (1.5, -4.0), example_1),
    "6.2": ("one-node-6.2", (1.5, 7.0), example_2),
    "6.3": ("one-node-6.3", (1.0, -2.0), example_3),
    "6.3'": ("one-node-6.3-perturbed", (0.98, -2.0), example_1),
}
