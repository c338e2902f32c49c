"""Arcs of graph proofs (docs/proof_format.md, under Arcs): both checkers refuse forgeries, and agree at random."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from complete import accepted_report
from effort import some
from flint import fmpq, fmpq_poly
from generators import integer_problem, random_problem, singular_problem
from graph_proofs import GRAPHS, accepted, graph, refused
from proof_tools import bytes_of, copied, of_kind, proof_of, records_of, replaced
from rational_arcs import Selection, alpha_of
from rational_checker import check
from rational_forms import Data, Forms, Refused
from rational_zeros import cells, count, zeros

from enumsol import ContactProblem, branch_graph, verify

#: The long proofs of "friction" and "everything", checked twice for every forgery, take most of the time.
EVENTFUL = ["load", "both", *(pytest.param(name, marks=pytest.mark.slow) for name in ("friction", "everything"))]


def parts_of(records, *kinds):
    """Box, place in it, beginning and part of every part of these kinds."""
    for k in of_kind(records, "b"):
        begin = records[k][1]
        for i, part in enumerate(records[k][4]):
            if part[0] in kinds:
                yield k, i, begin, part
            begin = part[1]


def with_part(records, k, i, *parts):
    """The records with these parts in place of one."""
    changed = copied(records)
    changed[k][4][i : i + 1] = parts
    return changed


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
            assert refused(problem, with_part(records, k, i, other)), other


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", EVENTFUL)
def test_forged_parts_that_hold_nothing(name):
    problem, records, _ = graph(name)
    for k, i, begin, (_, end) in spread(parts_of(records, "n")):
        event = [0, 1, *np.linspace(float(Fraction(begin)), float(Fraction(end)), 4)[1:3].tolist()]
        others = [["h", end, index] for index in (1, -1)] + [["e", end, index, *event] for index in (1, -1)]
        for other in (*others, ["n", end, 1]):
            assert refused(problem, with_part(records, k, i, other)), other


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", EVENTFUL)
def test_forged_events(name):
    problem, records, _ = graph(name)
    found = spread(parts_of(records, "e"), some(3, of=10))
    assert found
    conditions = 3 * problem.p
    for k, i, begin, part in found:
        _, end, index, condition, rising, first, last = part
        others = [["e", end, index, other, rising, first, last] for other in range(conditions) if other != condition]
        others += [["h", end, index], ["h", end, -index], ["n", end]]
        for change in (
            {2: -index},
            {2: 0},
            {3: -1},
            {4: 1 - rising},
            {4: 2},
            {5: last, 6: end},
            {5: begin, 6: first},
            {5: last, 6: first},
            {6: float(Fraction(end)) + 1.0},
            {5: float(Fraction(begin)) - 1.0},
        ):
            others.append([change.get(place, value) for place, value in enumerate(part)])
        for other in others:
            assert refused(problem, with_part(records, k, i, other)), other


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", GRAPHS)
def test_parts_by_themselves(name):
    """Nothing but what a part says stands, whatever comes before and after it."""
    problem, records, _ = graph(name)
    data, seen = Data(problem), set()
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
    for claim in [("h",), ("n",), *events]:
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
            before = [parts[i - 1][0], str(far), *parts[i - 1][2:]]
            assert refused(problem, with_part(records, k, i - 1, before))
        if i + 1 < len(parts):
            near = (first + Fraction(begin)) / 2
            assert refused(problem, with_part(records, k, i, ["e", str(near), *part[2:]]))
            moved += 1
    assert moved


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", EVENTFUL)
def test_a_removed_event_makes_arcs_begin_and_end_for_no_reason(name):
    """Beside an event whose part is given up to "u" the counts change; with right counts its partner stands alone."""
    problem, records, _ = graph(name)
    for k, i, _, part in parts_of(records, "e"):
        neighbours = [records[k][4][j] for j in (i - 1, i + 1) if 0 <= j < len(records[k][4])]
        for other in neighbours:
            assert refused(problem, with_part(records, k, i, [other[0], part[1], *other[2:]]))
        merged = copied(records)
        if i + 1 < len(merged[k][4]):
            del merged[k][4][i]
            assert refused(problem, merged)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", GRAPHS)
def test_parts_left_open(name):
    """What a proof says less it may say; arcs that end there count."""
    problem, records, made = graph(name)
    for k, i, _, part in spread(parts_of(records, "h", "n"), 6):
        changed = with_part(records, k, i, ["u", part[1]])
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
        for other in (
            ["t", codes, inside, high, side],
            ["t", codes, low, inside, side],
            ["t", codes, low, high, side + 1],
            ["t", codes[:-1] + ("1" if codes[-1] != "1" else "0"), low, high, side],
            ["t", codes + "0", low, high, side],
            ["t", codes, low, high],
        ):
            assert refused(problem, replaced(records, k, other)), other
        assert refused(problem, records[: k + 1] + records[k + 2 :])
        assert refused(problem, [*records[: k + 1], [*records[k + 1][:4], []], *records[k + 1 :]])
        _, low, high, precise, parts = records[k + 1]
        for other in (
            ["b", inside, high, precise, parts],
            ["b", low, low, precise, parts],
            ["b", low, high, 2, parts],
            ["b", low, high, precise, parts[:-1]],
            ["b", low, high, precise, [*parts, parts[-1]]],
        ):
            assert refused(problem, replaced(records, k + 1, other)), other


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
    F, kind = problem.friction[0], seed % 4
    slope = rng.integers(-2, 3, size=problem.n).astype(float)
    if make is random_problem:
        slope = rng.normal(size=problem.n) * np.max(np.abs(problem.f))
    if kind == 3:
        slope = -problem.f
    F1 = rng.integers(0, 3, size=p) + 0.25 * rng.integers(0, 2, size=p) if kind in (1, 2) else 0.0
    load = {"load_slope": slope} if kind != 1 else {}
    return ContactProblem(problem.A, problem.Bn, problem.Bt, problem.f, friction=(F, F1), **load), (0.0, 2.0)


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
        assert refused(problem, with_part(records, k, i, [*part[:2], -part[2], *part[3:]]))


@pytest.mark.long
def test_boxes_left_open_may_have_fractions_for_ends():
    """As right of an alpha at which g vanishes in a family."""
    problem, interval = random_graph(integer_problem, 3, 2)
    records = records_of(branch_graph(problem, interval).proof)
    left = [k for k in of_kind(records, "b") if all(part[0] == "u" for part in records[k][4])]
    assert left
    for k in left[:3]:
        kind, low, high, _, parts = records[k]
        box = [kind, str(Fraction(low)), str(Fraction(high)), 0, parts]
        assert accepted(problem, replaced(records, k, box))
        assert verify(problem, proof_of(replaced(records, k, box))).ok
    for k, _, _, part in list(parts_of(records, "h", "n"))[:3]:
        box = [*records[k][:3], 0, [part]]
        assert refused(problem, replaced(records, k, [box[0], *(str(Fraction(end)) for end in box[1:3]), *box[3:]]))


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
    data = Data(
        ContactProblem(
            problem.A, problem.Bn, problem.Bt, problem.f, friction=(problem.friction[0], F1), load_slope=load
        )
    )
    samples = [fmpq(k, 2) for k in range(-1, 3)]
    seen = set()
    for codes in product(range(4), repeat=2):
        selection = Selection(data, codes, 0)
        holding = [bool(Forms(data.S, data.load(x), data.friction(x)).hull(codes)) for x in samples]
        for x, holds in zip(samples, holding, strict=True):
            assert said_empty(selection, x, x) != holds
            seen.add((holds, said_singular(data, codes, x)))
        if any(holding):
            assert not said_empty(selection, samples[0], samples[-1])
    assert {holds for holds, _ in seen} == {True, False}
    assert any(singular for _, singular in seen)


def said_empty(selection, x, y):
    return ("n",) in standing(selection, x, y, 1, (x, y))


def said_singular(data, codes, x):
    return Selection(data, codes, 0).own.determinant(x) == 0
