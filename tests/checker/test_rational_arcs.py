"""Arcs of graph proofs (docs/proof_format.md, under Arcs): both checkers refuse forgeries, and agree at random."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from complete import accepted_report
from effort import some
from flint import fmpq, fmpq_poly
from generators import integer_problem, random_problem, singular_problem
from graph_proofs import GRAPHS, accepted, graph, parts_of, refused
from proof_tools import bytes_of, of_kind, proof_of, put, records_of, replaced
from rational_arcs import Selection, alpha_of
from rational_checker import check, data_of
from rational_forms import Data, Forms, Refused
from rational_zeros import cells, count, zeros

from enumsol import ContactProblem, branch_graph, verify

#: The long proofs of "friction" and "everything", checked twice for every forgery, take most of the time.
EVENTFUL = ["load", "both", *(pytest.param(name, marks=pytest.mark.slow) for name in ("friction", "everything"))]


def spread(found, most=7):
    """Some of them from all over the proof."""
    found = list(found)
    return found[:: max(1, len(found) // most)]


# -- forgeries ---------------------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", GRAPHS)
def test_forged_parts_that_hold(name):
    problem, records, _ = graph(name)
    for k, i, _, (_, end, index) in spread(parts_of(records, "h")):
        for other in (["h", end, -index], ["n", end], ["h", end, 0], ["h", end], ["h", end, index, 1], ["x", end]):
            assert refused(problem, put(records, (k, 4, i), other)), other


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", EVENTFUL)
def test_forged_parts_that_hold_nothing(name):
    problem, records, _ = graph(name)
    for k, i, begin, (_, end) in spread(parts_of(records, "n")):
        event = [0, 1, *np.linspace(float(Fraction(begin)), float(Fraction(end)), 4)[1:3].tolist()]
        others = [["h", end, index] for index in (1, -1)] + [["e", end, index, *event] for index in (1, -1)]
        for other in (*others, ["n", end, 1]):
            assert refused(problem, put(records, (k, 4, i), other)), other


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", EVENTFUL)
def test_forged_events(name):
    problem, records, _ = graph(name)
    found = spread(parts_of(records, "e"), some(3, of=10))
    assert found
    for k, i, begin, part in found:
        _, end, index, condition, rising, first, last = part
        changes = [{3: other} for other in range(-1, 3 * problem.p) if other != condition]
        changes += [{2: -index}, {2: 0}, {4: 1 - rising}, {4: 2}, {6: float(Fraction(end)) + 1.0}]
        changes += [{5: last, 6: end}, {5: begin, 6: first}, {5: last, 6: first}, {5: float(Fraction(begin)) - 1.0}]
        others = [[change.get(place, value) for place, value in enumerate(part)] for change in changes]
        for other in (*others, ["h", end, index], ["h", end, -index], ["n", end]):
            assert refused(problem, put(records, (k, 4, i), other)), other


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", GRAPHS)
def test_parts_by_themselves(name):
    """Nothing but what a part says stands, whatever comes before and after it."""
    problem, records, _ = graph(name)
    data, seen = data_of(problem), set()
    for k, _, begin, part in parts_of(records, "h", "n", "e"):
        _, codes, *_, side = records[max(j for j in of_kind(records, "t") if j < k)]
        selection, x, y = Selection(data, tuple(map(int, codes)), side), alpha_of(begin), alpha_of(part[1])
        bounds = list(map(alpha_of, part[5:])) or [(2 * x + y) / 3, (x + 2 * y) / 3]
        claim, index = (part[0], *part[3:5]), [*part, 1][2]
        assert standing(selection, x, y, index, bounds) == [claim]
        assert standing(selection, x, y, -index, bounds) == [claim] * (part[0] == "n")
        seen.add(part[0])
    assert seen >= {"h"}


def standing(selection, x, y, index, bounds):
    """All claims about a part that the checker in rationals accepts."""
    events = [("e", *named) for named in product(range(len(selection.conditions)), (0, 1))]
    found = []
    for claim in (("h",), ("n",), *events):
        try:
            if claim == ("h",):
                selection.holds(x, y, index)
            elif claim == ("n",):
                selection.empty(x, y)
            else:
                selection.event(x, y, index, *claim[1:], *bounds)
        except Refused:
            continue
        found.append(claim)
    return found


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", EVENTFUL)
def test_shifted_ends(name):
    """The end of a part beside an event is moved to the other side of it."""
    problem, records, _ = graph(name)
    moved = 0
    for k, i, begin, part in parts_of(records, "e"):
        parts, first, last = records[k][4], Fraction(part[5]), Fraction(part[6])
        if i:
            far = (last + Fraction(part[1])) / 2
            assert refused(problem, put(records, (k, 4, i - 1, 1), str(far)))
        if i + 1 < len(parts):
            near = (first + Fraction(begin)) / 2
            assert refused(problem, put(records, (k, 4, i, 1), str(near)))
            moved += 1
    assert moved


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", EVENTFUL)
def test_a_removed_event_makes_arcs_begin_and_end_for_no_reason(name):
    """Beside an event whose part is given up to "u" the counts change; with right counts its partner stands alone."""
    problem, records, _ = graph(name)
    for k, i, _, part in parts_of(records, "e"):
        parts = records[k][4]
        for other in parts[max(i - 1, 0) : i] + parts[i + 1 : i + 2]:
            assert refused(problem, put(records, (k, 4, i), [other[0], part[1], *other[2:]]))
        assert i + 1 == len(parts) or refused(problem, put(records, (k, 4), parts[:i] + parts[i + 1 :]))


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", GRAPHS)
def test_parts_left_open(name):
    """What a proof says less it may say; arcs that end there count."""
    problem, records, made = graph(name)
    for k, i, _, part in spread(parts_of(records, "h", "n"), 6):
        changed = put(records, (k, 4, i), ["u", part[1]])
        counts = [{**records[-1], "arcs": records[-1]["arcs"] + more} for more in (-1, 0, 1)]
        judged = [accepted(problem, [*changed[:-1], footer]) for footer in counts]
        assert judged == [verify(problem, proof_of([*changed[:-1], footer])).ok for footer in counts]
        assert sum(judged) == 1
    assert made.complete


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", GRAPHS)
def test_forged_traces_and_boxes(name):
    problem, records, _ = graph(name)
    traces = of_kind(records, "t")
    for k in spread(traces, some(2, of=4)):
        _, codes, low, high, side = records[k]
        end = next((j for j in traces if j > k), len(records) - 1)
        inside = (float(Fraction(low)) + float(Fraction(high))) / 2
        assert refused(problem, records[:k] + records[end:])
        assert refused(problem, records[:end] + records[k:end] + records[end:])
        _, low, _, _, parts = records[k + 1]
        for place, entry, value in (
            *((k, 1, [*codes, 0]), (k, 1, [*codes[:-1], int(codes[-1] != 1)]), (k, 1, "".join(map(str, codes)))),
            *((k, 2, inside), (k, 3, inside), (k, 4, side + 1)),
            *((k + 1, 1, inside), (k + 1, 2, low), (k + 1, 3, 2)),
            *((k + 1, 4, parts[:-1]), (k + 1, 4, [*parts, parts[-1]])),
        ):
            assert refused(problem, put(records, (place, entry), value)), (place - k, entry, value)
        empty = put(records[k + 1], (4,), [])
        for place, others in ((k, [records[k][:4]]), (k + 1, []), (k + 1, [empty, records[k + 1]])):
            assert refused(problem, replaced(records, place, *others)), (place - k, others)


@pytest.mark.parametrize("name", GRAPHS)
def test_forged_heads_and_counts_of_arcs(name):
    problem, records, _ = graph(name)
    head = next(k for k, record in enumerate(records) if "traces" in record)
    for change in ({"traces": records[head]["traces"] + 1}, {"force": []}, {"length": [901] * (2 * problem.p)}):
        assert refused(problem, replaced(records, head, {**records[head], **change}))
    footer = {key: value for key, value in records[-1].items() if key not in ("traces", "arcs")}
    assert refused(problem, [*records[:-1], footer])
    assert refused(problem, [*records[:head], records[-1]])
    assert refused(problem, [*records[:-1], records[head], records[-1]])


# -- random graphs -----------------------------------------------------------------------------------------------------


def random_graph(make, seed, p):
    """A problem on a path along which load, friction, or both vary, one that g vanishes on among them; its interval."""
    rng = np.random.default_rng([seed, p, 77])
    problem = make(rng, p)
    F, kind = problem.friction, seed % 4
    slope = rng.integers(-2, 3, size=problem.n).astype(float)
    if make is random_problem:
        slope = rng.normal(size=problem.n) * np.max(np.abs(problem.f))
    if kind == 3:
        slope = -problem.f
    F1 = rng.integers(0, 3, size=p) + 0.25 * rng.integers(0, 2, size=p) if kind in (1, 2) else 0.0
    load = {"load_slope": slope} if kind != 1 else {}
    return ContactProblem(problem.A, problem.Bn, problem.Bt, problem.f, friction=F, friction_slope=F1, **load), (
        0.0,
        2.0,
    )


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("make", "p"), [(random_problem, 1), (random_problem, 2), (integer_problem, 2), (singular_problem, 2)]
)
def test_both_checkers_agree_on_random_graphs(make, p, seed):
    problem, interval = random_graph(make, seed, p)
    made = branch_graph(problem, interval)
    records = records_of(made.proof)
    assert "arcs" in records[-1]
    found = accepted_report(problem, made.proof)
    assert check(problem, bytes_of(made.proof)) == found.selections
    for k, i, _, part in spread(parts_of(records, "h", "e"), 2):
        assert refused(problem, put(records, (k, 4, i, 2), -part[2]))


@pytest.mark.long
def test_boxes_left_open_may_have_fractions_for_ends():
    """As right of an alpha at which g vanishes in a family."""
    problem, interval = random_graph(integer_problem, 3, 2)
    records = records_of(branch_graph(problem, interval).proof)
    left = [k for k in of_kind(records, "w") if all(part[0] == "u" for part in records[k][4])]
    assert left
    for k in left[:3]:
        kind, low, high, _, parts = records[k]
        box = [kind, str(Fraction(low)), str(Fraction(high)), 0, parts]
        assert accepted(problem, replaced(records, k, box))
        assert verify(problem, proof_of(replaced(records, k, box))).ok
    for k, _, _, part in list(parts_of(records, "h", "n"))[:3]:
        kind, low, high, *_ = records[k]
        assert refused(problem, replaced(records, k, [kind, str(Fraction(low)), str(Fraction(high)), 0, [part]]))


# -- the rational checker's own means ----------------------------------------------------------------------------------


def test_zeros_of_polynomials():
    rng = np.random.default_rng(3)
    for _ in range(60):
        chosen = [fmpq(int(a), int(b)) for a, b in zip(rng.integers(-6, 7, 5), rng.integers(1, 4, 5), strict=True)]
        f = fmpq_poly([int(rng.integers(1, 4)), 0, 1])
        for zero in chosen:
            f *= fmpq_poly([-zero, 1]) ** int(rng.integers(1, 3))
        x, y = sorted(fmpq(int(k), 2) for k in rng.integers(-8, 9, 2))
        inside = sorted({(int(z.p), int(z.q)) for z in chosen if x <= z <= y}, key=lambda z: Fraction(*z))
        assert count(f, x, y) == len(inside)
        found = zeros(f, x, y)
        assert len(found) == len(inside)
        for zero, (p, q) in zip(found, inside, strict=True):
            assert zero.sign_of(f) == 0
            assert zero.sign_of(fmpq_poly([-p, q])) == 0
            assert (zero.sign_of(fmpq_poly([-p * 1000 - 1, q * 1000])), zero.sign_of(fmpq_poly([0]))) == (-1, 0)
        signs = [point.sign_of(f) for point in cells([f], x, y)]
        assert signs.count(0) >= len(inside)


def test_the_sign_at_an_irrational_zero():
    square = fmpq_poly([-2, 0, 1])
    (zero,) = zeros(square * fmpq_poly([5, 1]), fmpq(0), fmpq(3))
    assert zero.sign_of(square**3) == 0
    assert [zero.sign_of(fmpq_poly([-fmpq(k, 100), 1])) for k in (141, 142)] == [1, -1]


@pytest.mark.few(2, 2)
@pytest.mark.parametrize("seed", range(6))
def test_empty_selections_at_single_alphas_and_between(seed):
    """Against vertices at samples, singular selections among them."""
    rng = np.random.default_rng([seed, 5])
    problem = singular_problem(rng, 2)
    F1 = rng.integers(0, 2, size=2).astype(float)
    load = rng.integers(-1, 2, size=4).astype(float)
    data = Data(problem.replace(friction=problem.friction, friction_slope=F1, load_slope=load))
    samples, seen = [fmpq(k, 2) for k in range(-1, 3)], set()
    for codes in product(range(4), repeat=2):
        selection = Selection(data, codes, 0)
        holding = [bool(Forms(data.S, data.load(x), data.friction(x)).hull(codes)) for x in samples]
        for x, holds in zip(samples, holding, strict=True):
            assert said_empty(selection, x, x) != holds
            seen.add((holds, Selection(data, codes, 0).own.determinant(x) == 0))
        if any(holding):
            assert not said_empty(selection, samples[0], samples[-1])
    assert {holds for holds, _ in seen} == {True, False}
    assert any(singular for _, singular in seen)


def said_empty(selection, x, y):
    return ("n",) in standing(selection, x, y, 1, (x, y))
