"""Claims of a result that was cut short, held against the complete result of the same problem."""

import json
import re
from fractions import Fraction
from functools import lru_cache

import numpy as np
import pytest

from enumsol.cli.graph import graph_as_text
from enumsol.errors import IncompleteGraphError

#: Kinds of vertices that say how arcs meet there.
SPECIAL = ("transitions", "folds", "bifurcations", "jumps")
_NUMBER = r"(-?\d[\d.e+-]*)"


def samples(graph, count=7):
    """Alphas inside the interval: even ones, and every critical one that is a float."""
    a, b = graph.exact_interval
    even = [a + (b - a) * Fraction(k, count) for k in range(count + 1)]
    return sorted({*even, *(Fraction(v.alpha) for v in graph.vertices if a <= Fraction(v.alpha) <= b)})


@lru_cache(maxsize=256)
def _all_roots(full, alpha):
    """Those of a complete graph, which is held against many that were cut short."""
    return full.roots_at(alpha)


def false_claims_of_graph(graph, full):
    """What a graph that was cut short prints or returns and the complete one does not confirm."""
    return [
        *_special_points(graph, full),
        *_numbers(graph, full),
        *_uniqueness(graph, full),
        *_texts(graph, full),
        *(found for alpha in samples(full, 3) for found in false_claims_of_roots(graph.roots_at(alpha), full, alpha)),
    ]


def _special_points(graph, full):
    for name in SPECIAL:
        true = [v.alpha for v in getattr(full, name)]
        for v in getattr(graph, name):
            if v.alpha not in true:
                yield f"{name}: {v.alpha}, complete: {true}"
            true = [alpha for alpha in true if alpha != v.alpha] + [v.alpha] * (true.count(v.alpha) - 1)
    known = [(v.alpha, v.kind, v.active, v.index_left, v.index_right) for v in full.vertices]
    for v in graph.vertices:
        if v.kind != "unsettled" and (v.alpha, v.kind, v.active, v.index_left, v.index_right) not in known:
            yield f"vertex at {v.alpha}: {v.kind}, {v.index_left}, {v.index_right}"
    arcs = {(arc.selections, arc.lo, arc.hi, arc.index, arc.dimension) for arc in full.arcs}
    for arc in graph.arcs:
        if (arc.selections, arc.lo, arc.hi, arc.index, arc.dimension) not in arcs:
            yield f"arc {arc.selections} on [{arc.lo}, {arc.hi}]"
    loops = [sorted(arc.selections for arc in b.arcs) for b in full.branches if b.closed]
    for branch in graph.branches:
        if branch.closed and sorted(arc.selections for arc in branch.arcs) not in loops:
            yield f"closed branch {branch.number}"


def _numbers(graph, full):
    if graph.reasons:
        with pytest.raises(IncompleteGraphError):
            _ = graph.steps
    for alpha in samples(full):
        true = full.multiplicity_at(alpha)
        if graph.at_least(alpha) > true:
            yield f"at least {graph.at_least(alpha)} at {float(alpha)}, where there are {true}"
        if graph.reasons:
            with pytest.raises(IncompleteGraphError):
                graph.multiplicity_at(alpha)
        elif graph.multiplicity_at(alpha) != true:
            yield f"{graph.multiplicity_at(alpha)} at {float(alpha)}, where there are {true}"
    steps = graph.claims.steps()
    if steps.exact != (not graph.reasons):
        yield "steps that call themselves exact"
    for alpha, number in zip(steps.alphas, steps.at, strict=True):
        exact = [v for v in full.vertices if v.alpha == float(alpha)]
        # critical alphas that round to one float are told apart by neither graph's samples
        if len({v.exact.enclosure() for v in exact}) == 1 and exact[0].exact.is_rational:
            true = full.multiplicity_at(Fraction(*map(int, (exact[0].exact.lo.p, exact[0].exact.lo.q))))
            if number > true:
                yield f"steps: {number} at {float(alpha)}, where there are {true}"
    for left, right, number in zip(steps.alphas, steps.alphas[1:], steps.between, strict=False):
        middle = (left + right) / 2
        if left < middle < right and number > full.multiplicity_at(middle):
            yield f"steps: {number} at {float(middle)}, where there are {full.multiplicity_at(middle)}"


def _uniqueness(graph, full):
    claim, true = graph.claims.uniqueness(), full.claims.uniqueness()
    if graph.reasons:
        if claim.known or claim.limit is not None or claim.throughout is not None:
            yield f"uniqueness of an incomplete graph: {claim}"
        with pytest.raises(IncompleteGraphError):
            _ = graph.uniqueness_limit
    elif (claim.limit, claim.throughout) != (true.limit, true.throughout):
        yield f"uniqueness: {claim}, complete: {true}"
    if claim.several_by is not None and (true.limit is None or claim.several_by < true.limit):
        yield f"several solutions by {claim.several_by}, complete: {true}"


def _texts(graph, full):
    text = graph_as_text(graph)
    summary = json.loads(json.dumps(graph.summary()))
    if graph.reasons:
        if re.search(r"one solution (throughout|below)|^several solutions from", text, re.MULTILINE):
            yield text
        if "complete: no" not in text or summary["complete"] or summary["standing"] != "incomplete":
            yield "an incomplete graph that does not say so"
        if summary["uniqueness_limit"] is not None or summary["unique_throughout"] is not None:
            yield "uniqueness in JSON"
        if summary["multiplicity"]["exact"]:
            yield "multiplicity in JSON"
    for line in re.findall(r"^(?:bifurcations|jumps).*$", text, re.MULTILINE):
        true = [f"{v.alpha:.8g}" for name in ("bifurcations", "jumps") for v in getattr(full, name)]
        for number in re.findall(_NUMBER, line):
            if number not in true:
                yield line
    for line in re.findall(r"folds at (.*)$", text, re.MULTILINE):
        true = [f"{v.alpha:.6g}" for v in full.folds]
        for number in line.split(", "):
            if number not in true:
                yield line


def false_claims_of_roots(roots, graph_or_roots, alpha=None):
    """What a root set that was cut short prints or returns and the complete one does not confirm."""
    full = graph_or_roots if alpha is None else _all_roots(graph_or_roots, alpha)
    if not full.whole:
        raise AssertionError("the reference must be whole")
    total = len(full) + len(full.families)
    if roots.at_least > total or len(roots) > len(full):
        yield f"at least {roots.at_least} roots ({len(roots)} isolated), where there are {total}"
    if roots.index_sum not in (None, full.index_sum):
        yield f"index sum {roots.index_sum}, complete: {full.index_sum}"
    if roots.complete and roots.stopped is not None:
        yield "complete although it was stopped"
    known = [(root.statuses, root.active, root.index, root.regular, *_values(root)) for root in full]
    for root in roots:
        if not any(_same(root, other, loose=roots.arithmetic == "fast") for other in known):
            yield f"a root {root.statuses} that the complete search does not have"
    text = repr(roots)
    if not roots.whole:
        bound = f"found, at least {roots.at_least} exist" if roots.at_least else "found ("
        if "index sum: unknown" not in text or bound not in text.splitlines()[0] or "complete: no" not in text:
            yield text
    elif f"{total}" not in text and total:
        yield text


def _values(root):
    return root.lambda_n, root.lambda_t


def _same(root, other, *, loose):
    """The same root; statuses within the tolerance of fast arithmetic are not compared."""
    *names, n, t = other
    return (loose or [root.statuses, root.active, root.index, root.regular] == names) and (
        np.allclose(root.lambda_n, n, rtol=1e-9, atol=1e-12) and np.allclose(root.lambda_t, t, rtol=1e-9, atol=1e-12)
    )
