"""Lower bounds of graphs that are not complete are never above the number of solutions (theory, section 7.13).

The judge is the complete graph in rational arithmetic of the problem without what it was padded with, and at some
alphas the enumeration of its roots in rationals.
"""

import json
import re
from bisect import bisect_left
from contextlib import nullcontext
from fractions import Fraction
from itertools import product
from math import inf, nextafter

import numpy as np
import pytest
from complete import all_roots, read_back, whole_graph
from effort import some
from interruptions import CtrlC
from path_problems import (
    generic_problem,
    grazing_problem,
    integer_problem,
    mirrored_problem,
    planted_corner,
    sheet_of_one_node,
    together,
    without_friction_somewhere,
)
from trees import by_the_tree

from enumsol import ContactProblem, branch_graph, enumerate_roots, gallery
from enumsol.arithmetic.rationals import rational
from enumsol.branches.claims import Claims, Standing
from enumsol.branches.gluing import glue
from enumsol.branches.known_selections import KnownSelections
from enumsol.condensation.exact import ExactCondensed
from enumsol.errors import IncompleteGraphError, Interrupted

KINDS = ("friction", "load", "both")


def padded(problem, n):
    """The problem with unit degrees of freedom that nothing touches, n in all."""
    A, more = np.eye(n), n - problem.n
    A[: problem.n, : problem.n] = problem.A.toarray()
    rows = [np.hstack([matrix.toarray(), np.zeros((problem.p, more))]) for matrix in (problem.Bn, problem.Bt)]
    slope = None if problem.load_slope is None else np.append(problem.load_slope, np.zeros(more))
    data = {
        "gap": problem.gap,
        "slip_offset": problem.slip_offset,
        "friction": problem.friction,
        "friction_slope": problem.friction_slope,
        "load_slope": slope,
    }
    return ContactProblem(A, *rows, np.append(problem.f, np.zeros(more)), **data)


def copies(problem, count):
    """Several bodies that do not feel each other, all alike."""
    several = [np.kron(np.eye(count), matrix.toarray()) for matrix in (problem.A, problem.Bn, problem.Bt)]
    slope = None if problem.load_slope is None else np.tile(problem.load_slope, count)
    data = {"gap": np.tile(problem.gap, count), "slip_offset": np.tile(problem.slip_offset, count)}
    data |= {name: np.tile(getattr(problem, name), count) for name in ("friction", "friction_slope")}
    return ContactProblem(*several, np.tile(problem.f, count), load_slope=slope, **data)


def _repeated(rng, p, kind):
    one = (generic_problem, integer_problem)[int(rng.integers(2))](rng, 1, kind)
    return copies(one, min(p + 1, 3))


#: Random problems, by seed.
FAMILIES = (
    generic_problem,
    integer_problem,
    _repeated,
    planted_corner,
    without_friction_somewhere,
    integer_problem,
    lambda rng, p, kind: grazing_problem(rng, p),
    lambda rng, p, kind: mirrored_problem(rng, load=kind != "friction"),
    lambda rng, p, kind: together(rng, nodes=2, push=float(rng.choice((0.0, 1e-9, 1e-13)))),
    _repeated,
)


def case(seed):
    """A problem and an interval."""
    rng = np.random.default_rng(seed)
    make, p = FAMILIES[seed % len(FAMILIES)], int(rng.integers(1, 4))
    # larger ones with many coincidences take minutes in rationals
    problem = make(rng, min(p, 2) if make in (integer_problem, planted_corner) else p, KINDS[int(rng.integers(3))])
    last = int(rng.integers(2, 6))
    return problem, [(0.0, float(last)), (Fraction(1, 3), Fraction(last))][int(rng.random() < 0.2)]


def cut_short(problem, interval, rng, nodes, way):
    """A graph that is not complete, for one reason or another (or one that is, after all)."""
    if way == "interrupted":
        try:
            return branch_graph(problem, interval, progress=CtrlC(call=int(rng.integers(1, 6))))
        except Interrupted as error:
            return error.partial
    return branch_graph(problem, interval, max_nodes=None if way == "whole" else int(rng.integers(1, max(nodes, 2))))


def alphas_to_test(full, graph, rng, count):
    """Alphas of the interval: random and dyadic ones, critical ones, and what is next to them or bounds them."""
    a, b = full.exact_interval
    found = {a, b, *(Fraction(alpha) for alpha in rng.uniform(float(a), float(b), count // 2))}
    found |= {a + (b - a) * Fraction(int(k), 16) for k in rng.integers(0, 17, size=count // 8)}
    near = [v.alpha for v in full.vertices] + [float(x) for x in graph.claims.steps().alphas]
    near += [float(end) for v in graph.vertices for end in v.enclosure]
    near += [end for arc in graph.arcs for end in arc.interval]
    close = {Fraction(x) for alpha in near for x in (alpha, nextafter(alpha, -inf), nextafter(alpha, inf))}
    close |= {v.enclosure[0] for v in full.vertices}
    close = sorted(x for x in close if a <= x <= b)
    more = max(count - len(found), 0)
    return sorted(found | {close[int(k)] for k in rng.permutation(len(close))[:more]})


def number_by_steps(steps, alpha):
    """What a step function says; None outside."""
    k = bisect_left(steps.alphas, alpha)
    if k < len(steps.alphas) and steps.alphas[k] == alpha:
        return steps.at[k]
    return steps.between[k - 1] if 0 < k < len(steps.alphas) else None


def false_claims(graph, full, alphas):
    """Every claim about numbers of solutions that is above the truth."""
    claims, steps = graph.claims.uniqueness(), graph.claims.steps()
    summary = json.loads(json.dumps(graph.summary()))
    told = summary["multiplicity"]
    assert (told["at"], told["between"]) == (list(steps.at), list(steps.between))
    for alpha in alphas:
        true, least, step = full.multiplicity_at(alpha), graph.at_least(alpha), number_by_steps(steps, alpha)
        if least > true or least < 1:
            yield f"at least {least} at {float(alpha)!r}, where there are {true}"
        # numbers at critical alphas that are no floats belong to these, and not to the floats next to them
        if step is not None and step > true and not steps.exact:
            yield f"{step} by steps at {float(alpha)!r}, where there are {true}"
        try:
            if graph.multiplicity_at(alpha) != true:
                yield f"{graph.multiplicity_at(alpha)} at {float(alpha)!r}, where there are {true}"
        except IncompleteGraphError as error:
            said = int(re.search(r"at least (\d+)", str(error))[1])
            if said > true:
                yield str(error)
    limit = full.claims.uniqueness().limit
    if claims.known:
        # a vertex in balls of double arithmetic is named by the middle of its bounds
        if (claims.limit is None) != (limit is None) or (limit is not None and abs(claims.limit - limit) > 1e-9):
            yield f"the limit of uniqueness is {claims.limit}, and should be {limit}"
    # the limit is rounded to a float
    elif claims.several_by is not None and (limit is None or claims.several_by < nextafter(limit, -inf)):
        yield f"several solutions by {claims.several_by}, and the limit is {limit}"
    assert summary["several_solutions_by"] == claims.several_by


def graphs_of(seed):
    """Graphs of one random problem, and the complete one; the last part of a name is how it was cut short."""
    rng = np.random.default_rng([9, seed])
    problem, interval = case(seed)
    full = branch_graph(problem, interval, "exact")
    assert not full.reasons, (seed, full.reasons)
    larger = {n: padded(problem, n) for n in (25, 256)}
    kinds = [(256, "whole"), (256, "nodes"), (25, "nodes"), (problem.n, "nodes"), (25, "whole")]
    kinds += [((256, 25, problem.n)[int(rng.integers(3))], "interrupted")]
    for n, way in kinds:
        # without a tree hardly anything is cut short
        with nullcontext() if way == "whole" else by_the_tree():
            graph = cut_short(larger.get(n, problem), interval, rng, full.stats.nodes, way)
        yield full, graph, f"{seed}, n = {n}, {way}"


def wedged(n, count=2):
    """Bodies that stick and slide, all at the same alphas, padded to n degrees of freedom."""
    A, B = [[2.0, -1.0], [-1.0, 2.0]], np.eye(2)
    one = ContactProblem(A, B[:1], B[1:], [3.0, -2.0], friction=3.0, friction_slope=-0.75)
    return padded(copies(one, count), n)


def at_rest(n, p=1):
    """Load, gap and slip offset cancel on the way to the contact nodes."""
    f = np.zeros(n)
    f[: 2 * p] = 1.0
    B = np.eye(n)[: 2 * p]
    return ContactProblem(np.eye(n), B[:p], B[p:], f, gap=np.ones(p), slip_offset=np.ones(p), friction=1.0)


def sliding(n):
    """One node that slips below alpha = 1/3 and sticks above."""
    B = np.eye(2)
    return padded(ContactProblem(B, B[:1], B[1:], [1.0, 1.0], friction=0.0, friction_slope=3.0), n)


def check(seeds, count):
    """Numbers of graphs, of those with gaps, of alphas there, and of those at which the bound is the number."""
    graphs = cut = asked = sharp = 0
    for seed in seeds:
        for full, graph, name in graphs_of(seed):
            alphas = alphas_to_test(full, graph, np.random.default_rng(seed), count)
            assert list(false_claims(graph, full, alphas)) == [], name
            graphs += 1
            if graph.reasons:
                cut += 1
                asked += len(alphas)
                sharp += sum(graph.at_least(alpha) == full.multiplicity_at(alpha) for alpha in alphas)
    return graphs, cut, asked, sharp


def test_claims_are_true():
    graphs, cut, asked, sharp = check([100, 107, *range(110, 116), 201][: some(2, of=9)], some(20, of=50))
    assert graphs >= some(12, of=50)
    assert cut > some(6, of=28)
    assert sharp > 0.8 * asked


def test_the_enumeration_of_roots_agrees():
    full, graph, _ = next(graphs_of(2))
    for alpha in alphas_to_test(full, graph, np.random.default_rng(3), 8):
        roots = all_roots(full.problem, alpha, "exact")
        assert graph.at_least(alpha) <= len(roots) + len(roots.families) == full.multiplicity_at(alpha)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("n", "p"), [(24, 1), (25, 1), (25, 12), (80, 5), (251, 1)])
def test_a_body_that_the_load_leaves_at_rest_has_one_solution(n, p):
    graph = branch_graph(at_rest(n, p), (0.0, 1.0))
    assert graph.complete == (n <= 250)
    assert [graph.at_least(alpha) for alpha in (0.0, 0.25, 0.5, 1.0)] == [1] * 4
    assert set(graph.claims.steps().at) == {1}
    assert graph.claims.uniqueness().several_by is None
    if graph.complete:
        # every selection holds, so that no search would end
        assert (graph.stats.nodes, graph.multiplicity_at(0.5), graph.certified_data) == (0, 1, "problem")


def test_gluing_takes_one_selection_for_all_that_a_body_at_rest_has():
    exact = ExactCondensed.from_problem(at_rest(4))
    known = KnownSelections(exact, rational(0), rational(1), cut_short=False)
    vertices, arcs, _ = glue(known, product(range(4)))
    assert (len(vertices), len(arcs), known.reasons) == (2, 1, [])


def test_a_place_left_open_is_no_solution(capsys):
    graph = branch_graph(wedged(256), (0.0, 4.0))
    assert [v.kind for v in graph.vertices].count("unsettled") == 2
    assert branch_graph(wedged(4), (0.0, 4.0)).claims.uniqueness().throughout
    inside = [float(sum(v.enclosure)) / 2 for v in graph.vertices]
    assert {graph.at_least(alpha) for alpha in (*inside, 1.0, 1.25, 4 / 3, 2.0, 28 / 9, 3.5)} == {1}
    steps = graph.claims.steps()
    assert (steps.at, steps.between, steps.exact) == ((1, 1), (1,), False)
    assert graph.summary()["several_solutions_by"] is None
    with pytest.raises(IncompleteGraphError, match="no second solution was found"):
        _ = graph.uniqueness_limit
    assert not any("several" in line for line in graph.claims.sentences(None))


def test_a_fold_is_not_counted_on_its_empty_side():
    square = gallery.two_node_square(f1=(1, -3), f2=(1, -1))
    full, graph = branch_graph(square, (0.0, 10.0)), branch_graph(padded(square, 256), (0.0, 10.0))
    (fold,) = [v for v in graph.vertices if v.kind == "fold" and v.alpha > 3.5]
    low, high = fold.enclosure
    between = [low + (high - low) * Fraction(k, 8) for k in range(9)]
    exact = next(v.exact for v in full.folds if v.alpha > 3.5)
    claims = Claims(graph.vertices, graph.arcs, graph.exact_interval, Standing.INCOMPLETE)
    counts = {claims.multiplicity(alpha).count for alpha in between}
    assert counts == {3}
    assert {full.multiplicity_at(alpha) for alpha in between} >= {3, 5}, exact
    steps = claims.steps()
    assert all(number_by_steps(steps, alpha) <= 3 for alpha in between)
    assert max(steps.between) == 5


def test_where_all_selections_hold_a_search_cut_short_knows_no_kind():
    A, B = [[5.0, -4.0], [-4.0, 5.0]], np.eye(2)
    problem = ContactProblem(A, B[:1], B[1:], [0.0, 0.0], load_slope=[0.0, 1.0], friction=2.0, friction_slope=0.5)
    for interval in ((0.0, 5.0), (-1.0, 1.0)):
        graph = branch_graph(padded(problem, 25), interval, max_nodes=2)
        assert {v.kind.value for v in graph.vertices if v.alpha == 0.0} == {"unsettled"}
        assert graph.at_least(0.0) == 1


@pytest.mark.few(0, 2)
@pytest.mark.parametrize(("n", "beyond"), [(2, 2.0**-59), (25, 2.0**-59), (25, 2.0**-70), (251, 2.0**-59)])
def test_an_event_just_outside_the_interval_is_no_solution(n, beyond):
    third, beyond = Fraction(1, 3), Fraction(beyond)
    for interval in ((third + beyond, 2), (0, third - beyond)):
        graph = whole_graph(sliding(n), interval)
        assert [(graph.at_least(end), graph.multiplicity_at(end)) for end in interval] == [(1, 1)] * 2
        assert [v.kind for v in graph.vertices] == ["end", "end"]
        assert len(graph.arcs) == 1
    inside = whole_graph(sliding(n), (third - beyond, 2))
    assert inside.at_least(third - beyond) == 1
    assert [v.kind for v in inside.vertices] == ["end", "transition", "end"]


def test_solutions_are_several_from_where_a_sheet_begins():
    # a sheet that begins at a point, where g vanishes
    for first in (0.0, -1.0):
        graph = whole_graph(sheet_of_one_node(), (first, 1.0))
        assert graph.sheets
        assert graph.uniqueness_limit == 0.0
    assert enumerate_roots(sheet_of_one_node(), 0.5).families


def test_a_saved_graph_keeps_how_far_arcs_are_known_to_hold(tmp_path):
    graph = branch_graph(wedged(256), (0.0, 4.0))
    read = read_back(graph, tmp_path / "graph.json")
    assert [arc.interval for arc in read.arcs] == [arc.interval for arc in graph.arcs]
    assert [v.alpha for v in read.vertices] != [arc.hi for arc in read.arcs]
    assert read.claims.steps() == graph.claims.steps()
    arc = read.arcs[0]
    assert arc.hi < graph.vertices[arc.head].alpha
    for alpha in (arc.hi, nextafter(arc.hi, inf)):
        assert read.at_least(alpha) == graph.at_least(alpha) == 1
