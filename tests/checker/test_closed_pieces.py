"""Pieces of graph proofs closed by their arcs (docs/proof_format.md, under Tests of a piece), in both checkers."""

import functools
from contextlib import nullcontext
from fractions import Fraction
from itertools import combinations, pairwise, takewhile

import numpy as np
import pytest
from arc_oracle import assignments, counted
from branches.test_lower_bounds import case, padded
from complete import accepted_report, complete_report, whole_graph
from effort import some
from flint import fmpq
from generators import through_the_unloaded_state
from graph_proofs import GRAPHS, accepted, forms_of_arcs, parts_of, refused, without_arcs
from proof_tools import bytes_of, copied, of_kind, proof_of, put, records_of, replaced
from rational_arcs import Selection
from rational_checker import check
from rational_forms import Data
from rational_pieces import ClosedPiece, _Along
from trees import by_the_tree

from enumsol import ContactProblem, branch_graph, verify
from enumsol.proof.proof_file import ProofFormatError

SIZE = 25


@pytest.fixture(autouse=True, scope="module")
def patient():
    """Small bodies are tried as often as large ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("enumsol.branches.enclosed.single_branches._VAIN_TRIES", 100)
        yield


def vanishing():
    """g vanishes inside, and there is one solution on both sides."""
    body, interval = through_the_unloaded_state()
    return ContactProblem(body.A, body.Bn, body.Bt, [0.0, 0.0], load_slope=[1.5, -4.0], friction=0.5), interval


BODIES = {name: GRAPHS[name] for name in ("friction", "load", "unloaded", "everything")} | {"vanishing": vanishing}
SEVERAL = ("friction", "load", "unloaded")
EVENTFUL = ("load", "everything")


@functools.cache
def proven(name, *, tree=False):
    """A problem and the records of its graph's proof."""
    problem, interval = BODIES[name]()
    body = padded(problem, SIZE)
    with by_the_tree() if tree else nullcontext():
        records = records_of(whole_graph(body, interval).proof)
    assert bool(of_kind(records, "o")) != tree
    return body, records


def heads(records):
    """Places of the records that begin pieces."""
    return [k for k, record in enumerate(records) if "piece" in record]


def closed_heads(records):
    """Places of the records that begin closed pieces."""
    return [max(head for head in heads(records) if head < k) for k in forms_of_arcs(records)]


def numbers_of(record):
    """mu, kappa and nu of a form of arcs."""
    return np.reshape(record[2], (3, -1)).tolist()


def with_numbers(record, *lists):
    return ["q", record[1], [x for numbers in lists for x in numbers], []]


def handed(records, head):
    """Selections of the form of arcs of a closed piece."""
    (form,) = [k for k in forms_of_arcs(records) if head < k < end_of(records, head)]
    return records[form][1]


def end_of(records, head):
    """The place after a piece's last record."""
    return next(k for k in range(head + 1, len(records)) if not isinstance(records[k], list))


@pytest.mark.parametrize("name", BODIES)
def test_both_checkers_take_them(name):
    body, records = proven(name)
    report = complete_report(body, proof_of(records))
    assert report.closed == len(of_kind(records, "o"))
    assert accepted(body, records)
    assert counted(records) == records


@pytest.mark.slow
def test_both_checkers_agree_on_random_graphs():
    """Integer data, mirror symmetry and several conditions that vanish together among them."""
    closed = 0
    for seed in [302, 304, 309, 311, 317, 328, 330, 339, *range(600, 615)][: some(4, of=23)]:
        problem, interval = case(seed)
        body = padded(problem, SIZE)
        graph = branch_graph(body, interval)
        if graph.proof is None:
            continue
        report = accepted_report(body, graph.proof)
        if "arcs" in records_of(graph.proof)[-1]:
            assert check(body, bytes_of(graph.proof)) == report.selections, seed
            closed += report.closed > 0
    assert closed > some(2, of=11)


# -- forgeries: the record ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BODIES)
def test_forged_numbers(name):
    body, records = proven(name)
    p = body.p
    for k in forms_of_arcs(records)[:1]:
        _, selections, numbers, _ = records[k]
        mu, kappa, nu = numbers_of(records[k])
        F = np.maximum(*body.affine_friction) if name == "everything" else np.ones(p)
        wrong = [
            ["q"], ["q", selections], ["q", selections, numbers], ["q", selections, numbers, None],
            ["q", selections, numbers, [0.0]], ["q", selections, numbers, [], []], ["q", selections, numbers[1:], []],
            ["q", selections, [*numbers, 1.0], []], ["q", selections, None, []], ["q", selections, "1" * 3 * p, []],
            ["q", selections, [mu, kappa, nu], []], ["Q", selections, numbers, []], ["q", [], numbers, []],
            ["q", None, numbers, []], ["q", selections[0], numbers, []], ["q", [selections], numbers, []],
        ]  # fmt: skip
        for bad in (0.0, -0.0, -1.0, True, None, "1"):
            wrong += [with_numbers(records[k], [*mu[:-1], bad], kappa, nu)]
            wrong += [with_numbers(records[k], mu, [bad, *kappa[1:]], nu)]
        wrong += [with_numbers(records[k], mu, kappa, [bad, *nu[1:]]) for bad in (True, None, "0")]
        # |nu| F > mu, where the friction of a node is not zero
        rubbing = int(np.argmax(F))
        steep = ([1e9 * s * (i == rubbing) for i in range(p)] for s in (1, -1))
        wrong += [with_numbers(records[k], mu, kappa, nu) for nu in steep]
        for record in wrong:
            assert refused(body, replaced(records, k, record)), record
        for bad in (float("inf"), float("nan"), 10**400):
            forged = replaced(records, k, with_numbers(records[k], mu, kappa, [bad, *nu[1:]]))
            assert not accepted(body, forged)
            with pytest.raises(ProofFormatError):
                verify(body, proof_of(forged))


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", BODIES)
def test_other_numbers(name):
    """What the checker in floats accepts the one in rationals does; what makes Q indefinite both refuse."""
    body, records = proven(name)
    rng, yes, no = np.random.default_rng(7), 0, 0
    for k in forms_of_arcs(records)[:1]:
        own = np.array(numbers_of(records[k]))
        for spread in (1e-9, 0.1, 1.0, 3.0, 8.0):
            mu, kappa = own[:2] * np.exp(spread * rng.normal(size=(2, body.p)))
            forged = replaced(records, k, with_numbers(records[k], mu.tolist(), kappa.tolist(), own[2].tolist()))
            if verify(body, proof_of(forged)).ok:
                assert accepted(body, forged)
                yes += 1
            else:
                no += 1
    assert yes
    assert no or name == "vanishing"


@pytest.mark.parametrize("name", BODIES)
def test_nu_at_the_bound_of_friction(name):
    """|nu| F = mu, and a bit more."""
    body, records = proven(name)
    for k in forms_of_arcs(records)[-1:]:
        head = max(head for head in heads(records) if head < k)
        F = np.max([body.friction_at(Fraction(end)) for end in records[head]["piece"]], axis=0)
        for share in (1.0 + 2.0**-30, 1.0 + 2.0**-45):
            nu = np.where(F > 0, share / np.where(F > 0, F, 1.0), 0.0).tolist()
            record = with_numbers(records[k], [1.0] * body.p, [1.0] * body.p, nu)
            assert refused(body, replaced(records, k, record))


# -- forgeries: the piece ----------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", BODIES)
def test_what_stands_in_place_of_the_leaf_or_beside_it(name):
    body, records = proven(name)
    p, k = body.p, of_kind(records, "o")[0]
    nothing, empty = [0.0] * p, ["x", "", ""]
    others = [
        ["o", 0, [], []],
        ["o", 2, [], []],
        ["o", 1.0, [], []],
        ["o", True, [], []],
        ["o", 1, [], [], []],
        ["o", 1],
    ]
    others += [
        ["o", 1, [4 * p], []],
        ["o", 1, [], [[4 * p, 4 * p, 1.0]]],
        ["o", 1, [], [], [0.0] * 2 * p, [0.0] * 2 * p, 1],
    ]
    others += [
        empty,
        [*empty, 1],
        ["s"],
        ["n"],
        ["c"],
        ["p", "1/1024"],
        ["i", []],
        ["m", [1.0] * p, [1.0] * p, nothing],
        ["u", "?"],
        ["p", "1"],
    ]
    for record in others:
        forged = replaced(records, k, record)
        assert refused(body, forged), record
        assert refused(body, counted(forged)), record
    middle = str(sum(map(Fraction, records[k - 2]["piece"])) / 2)
    for record in (records[k], empty, ["s"], ["p", middle]):
        for place in (k - 1, k, k + 1):
            forged = [*records[:place], record, *records[place:]]
            assert refused(body, forged), record
            assert refused(body, counted(forged)), record
    # the form of an assignment is none of arcs, and that of arcs none of an assignment
    form = ["q", [6] * p, [0.0] * 4 * p, []]
    assert refused(body, replaced(records, k, form, records[k]))
    assert refused(body, replaced(records, k, form, [*empty, 1]))
    # a form to which no leaf refers, and one that is declared twice, change nothing but the counts
    for others in ([form, ["o", 2, [], []]], [records[k - 1], records[k]]):
        again = counted(replaced(records, k, *others))
        assert verify(body, proof_of(again)).ok
        assert accepted(body, again)


@pytest.mark.parametrize("name", BODIES)
def test_statuses_that_a_node_cannot_have(name):
    body, records = proven(name)
    for k in forms_of_arcs(records):
        _, selections, *form = records[k]
        codes = selections[0]
        for i in range(body.p):
            changed = [*codes[:i], 1 if codes[i] == 4 else 4, *codes[i + 1 :]]
            for bad in (changed, [*codes[:i], 6, *codes[i + 1 :]], [*codes[:i], True, *codes[i + 1 :]]):
                assert refused(body, replaced(records, k, ["q", [bad, *selections[1:]], *form]))
            both = replaced(records, k, ["q", [changed, *selections], *form])
            traces = of_kind(both, "t")
            own = next(j for j in traces if both[j][1] == codes)
            end = next((j for j in traces if j > own), len(both) - 1)
            empty = [["t", changed, *both[own][2:]], ["w", *both[own][2:4], 0, [["u", both[own][3]]]]]
            assert refused(body, counted([*both[:end], *empty, *both[end:]]))


@pytest.mark.parametrize("name", BODIES)
def test_a_piece_in_halves_and_in_parts(name):
    """The same form once for both halves of the piece, and the same leaf once for every part of a split."""
    body, records = proven(name)
    head = closed_heads(records)[0]
    a, b = map(Fraction, records[head]["piece"])
    form, leaf = records[head + 1 : end_of(records, head)]
    frictionless = body.friction[0] == body.friction_slope[0] == 0
    split = ["b", 0, [4, 0] if frictionless else [5, 0]]
    rest = records[end_of(records, head) :]
    halves = [records[head], ["p", str((a + b) / 2)]]
    for ends in ((a, (a + b) / 2), ((a + b) / 2, b)):
        halves += [{**records[head], "piece": list(map(str, ends))}, form, leaf]
    for changed in (halves, [records[head], form, split, leaf, leaf]):
        forged = counted([*records[:head], *changed, *rest])
        assert verify(body, proof_of(forged)).ok
        assert accepted(body, forged)
    for below in ([split, leaf], [leaf, leaf], [split, leaf, leaf, leaf], [["b", 0, split[2][:1]], leaf]):
        assert refused(body, counted([*records[:head], records[head], form, *below, *rest]))


@pytest.mark.parametrize("name", BODIES)
def test_proofs_without_arcs(name):
    body, records = proven(name)
    assert refused(body, without_arcs(records))
    for forged in (records, without_arcs(records)):
        assert refused(body, replaced(forged, 0, {**records[0], "data": "condensed"}))
    first = next(k for k, record in enumerate(records) if "traces" in record)
    assert refused(body, [*records[: first + 1], records[-1]])
    assert refused(body, counted([*records[: first + 1], records[-1]]))


# -- forgeries: the arcs -----------------------------------------------------------------------------------------------


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", BODIES)
def test_parts_left_open(name):
    """Without any part over a piece that shows a solution no arcs lead through it."""
    body, records = proven(name)
    pieces = [tuple(map(Fraction, records[k]["piece"])) for k in closed_heads(records)]
    opened = 0
    for k, i, begin, part in parts_of(records, "h", "e"):
        low, high = Fraction(begin), Fraction(part[1])
        met = any(low < b and a < high for a, b in pieces)
        if met and not elsewhere(records, k, (low, high)):
            assert refused(body, counted(put(records, (k, 4, i), ["u", part[1]]))), part
            opened += 1
    assert opened


def elsewhere(records, k, ends):
    """Whether a part of a box lies in no closed piece with its selection."""
    codes = records[max(j for j in of_kind(records, "t") if j < k)][1]
    for head in closed_heads(records):
        a, b = map(Fraction, records[head]["piece"])
        if codes in handed(records, head) and ends[0] < b and a < ends[1]:
            return False
    return True


@pytest.mark.parametrize("name", BODIES)
def test_a_selection_removed(name):
    """With its trace or without it; where other pieces hand it on, its trace begins or ends at the closed one."""
    body, records = proven(name)
    for head in closed_heads(records):
        a, b = map(Fraction, records[head]["piece"])
        (form,) = [k for k in forms_of_arcs(records) if head < k < end_of(records, head)]
        for codes in records[form][1]:
            others = [other for other in records[form][1] if other != codes]
            removed = replaced(records, form, ["q", others, *records[form][2:]])
            assert refused(body, removed)
            assert refused(body, counted(removed))
            assert refused(body, counted(without_trace(removed, codes, a, b)))


def without_trace(records, codes, a, b):
    """The traces of a selection less what lies in [a, b], which is at one end of it or all of it."""
    changed, skip = [], False
    for record in records:
        if isinstance(record, list) and record[0] == "t":
            skip = False
            low, high = Fraction(record[2]), Fraction(record[3])
            if record[1] == codes and low <= a < b <= high:
                low, high, skip = (float(b), float(high), True) if b < high else (float(low), float(a), True)
                if low < high:
                    changed += [["t", codes, low, high, record[4]], ["w", low, high, 0, [["h", high, 1]]]]
                continue
        skip = skip and isinstance(record, list) and record[0] == "w"
        if not skip:
            changed.append(record)
    return changed


@pytest.mark.slow
@pytest.mark.parametrize("name", EVENTFUL)
def test_events_without_partners(name):
    """One of two partners given up: arcs end at the other, which alone shows nothing beyond its zero."""
    body, records = proven(name)
    given = 0
    for k, i, _, part in parts_of(records, "e"):
        changed = counted(put(records, (k, 4, i), ["u", part[1]]))
        ok = verify(body, proof_of(changed)).ok
        assert ok <= accepted(body, changed)
        given += not ok
    assert given


def widened(records):
    """The same with parts of events that take in what holds beside them."""
    changed = copied(records)
    for k in of_kind(changed, "w"):
        parts = []
        for part in changed[k][4]:
            before = parts[-1] if parts else None
            if before and part[0] == "h" and before[0] == "e" and before[4] == 1:
                parts[-1] = ["e", part[1], *before[2:]]
            elif before and part[0] == "e" and part[4] == 0 and before[0] == "h":
                parts[-1] = part
            else:
                parts.append(part)
        changed[k][4] = parts
    return changed


@pytest.mark.long
def test_the_form_is_asked_of_every_arc():
    """Numbers that serve one of two arcs over a piece, and not the other."""
    body, records = proven("everything")
    wide = widened(records)
    for either in (records, wide):
        assert verify(body, proof_of(either)).ok
        assert accepted(body, either)
    data, rng, k = Data(body), np.random.default_rng(4), forms_of_arcs(records)[0]
    held = sorted((middle_of(records, codes), tuple(codes)) for codes in records[k][1])
    where, codes = zip(*held, strict=True)
    selections = [Selection(data, each, 0) for each in codes]
    own, wrong = np.array(numbers_of(records[k])), {"first": False, "last": False}
    for _ in range(400):
        mu, kappa = own[:2] * np.exp(rng.normal(size=(2, body.p)))
        numbers = mu.tolist(), kappa.tolist(), [0.0] * body.p
        piece = ClosedPiece(data, fmpq(0), fmpq(3), *numbers)
        serves = [piece._alone(_Along(piece, each), at, at, 0) for each, at in zip(selections, where, strict=True)]
        found = {"first": serves[-1] and not serves[0], "last": serves[0] and not serves[-1]}
        for which in [which for which, seen in wrong.items() if found[which] and not seen]:
            for either in (records, wide):
                assert refused(body, replaced(either, k, with_numbers(records[k], *numbers))), serves
            wrong[which] = True
        if all(wrong.values()):
            return
    raise AssertionError(wrong)


def middle_of(records, codes):
    """An alpha at which a selection has a solution."""
    first = next(k for k in of_kind(records, "t") if records[k][1] == codes)
    begin = records[first][2]
    for part in (part for box in takewhile(lambda record: record[0] == "w", records[first + 1 :]) for part in box[4]):
        low, high = Fraction(begin), Fraction(part[1])
        if part[0] == "e":
            low, high = (Fraction(part[6]), high) if part[4] == 1 else (low, Fraction(part[5]))
        if part[0] in "he":
            return fmpq(*((low + high) / 2).as_integer_ratio())
        begin = part[1]
    raise AssertionError(codes)


# -- forgeries: several solutions --------------------------------------------------------------------------------------


def only(records, chosen, numbers):
    """A tree's proof with every first piece closed by the arcs of some of its selections."""
    interval = [Fraction(end) for end in records[0]["interval"]]
    ends = sorted({Fraction(end) for k in heads(records) for end in records[k]["piece"]} & {0, *interval})
    cut = ends if records[of_kind(records, "t")[0]][4] else interval
    changed = [records[0]]
    for a, b in pairwise(cut):
        side = 0 if len(cut) == 2 else 1 if b > 0 else -1
        here = sorted({tuple(records[k][1]) for k in of_kind(records, "t") if records[k][4] == side} & set(chosen))
        piece = {**records[heads(records)[0]], "piece": [str(a), str(b)]}
        changed += [piece, with_numbers(["q", [*map(list, here)]], *numbers), ["o", 1, [], []]]
    changed.append(next(record for record in records if "traces" in record))
    kept = False
    for record in records:
        if isinstance(record, list) and record[0] == "t":
            kept = tuple(record[1]) in chosen
        if isinstance(record, list) and record[0] in "tw" and kept:
            changed.append(record)
    return counted([*changed, records[-1]])


def surviving(records):
    """Selections of leaves."""
    return {codes for k, codes in assignments(records).items() if records[k] == ["s"]}


@functools.cache
def whole(name):
    """The proof by trees, of pieces that are not cut: every selection has a trace over all of them."""
    body, records = proven(name, tree=True)
    if len(heads(records)) > 1 and name != "unloaded":
        pytest.skip("the interval is cut")
    return body, records


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("believing", [False, True])
@pytest.mark.parametrize("name", SEVERAL)
def test_several_solutions(name, believing, monkeypatch):
    """Selections of one branch or of several, with all kinds of numbers; also if no other selections are tried."""
    if believing:
        monkeypatch.setattr(ClosedPiece, "_tried", lambda *_: None)
    body, records = whole(name)
    codes, p = sorted(surviving(records)), body.p
    rng, forms = np.random.default_rng(3), [[[1.0] * p, [1.0] * p, [0.0] * p]]
    for _ in range(2):
        mu, kappa = np.exp(rng.normal(size=(2, p)) * 2).tolist()
        forms.append([mu, kappa, (0.1 * rng.normal(size=p)).tolist()])
    several = [chosen for size in (1, 2, len(codes)) for chosen in combinations(codes, size)]
    for chosen in several:
        for numbers in forms if len(chosen) == 1 else forms[:1]:
            assert refused(body, only(records, chosen, numbers)), (chosen, numbers)


def test_the_same_with_one_solution_is_no_forgery():
    body, records = proven("vanishing", tree=True)
    codes = surviving(records)
    forged = only(records, codes, [[1.0], [1.0], [0.0]])
    assert verify(body, proof_of(forged)).complete
    assert accepted(body, forged)
