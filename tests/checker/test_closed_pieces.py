"""Pieces of graph proofs closed by their arcs (docs/proof_format.md, under Tests of a piece), in both checkers."""

import functools
from contextlib import nullcontext
from fractions import Fraction
from itertools import combinations, pairwise, takewhile

import numpy as np
import pytest
from arc_oracle import counted
from branches.test_lower_bounds import case, padded
from complete import accepted_report, complete_report, whole_graph
from effort import some
from flint import fmpq
from generators import through_the_unloaded_state
from graph_proofs import GRAPHS, accepted, parts_of, refused, without_arcs
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
    assert bool(of_kind(records, "m")) != tree
    return body, records


def heads(records):
    """Places of the records that begin pieces."""
    return [k for k, record in enumerate(records) if "piece" in record]


def closed_heads(records):
    """Places of the records that begin closed pieces."""
    return [max(head for head in heads(records) if head < k) for k in of_kind(records, "m")]


def end_of(records, head):
    """The place after a piece's last record."""
    return next(k for k in range(head + 1, len(records)) if not isinstance(records[k], list))


@pytest.mark.parametrize("name", BODIES)
def test_both_checkers_take_them(name):
    body, records = proven(name)
    report = complete_report(body, proof_of(records))
    assert report.closed == len(of_kind(records, "m"))
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
    for k in of_kind(records, "m")[:1]:
        _, mu, kappa, nu = records[k]
        F = np.maximum(*body.affine_friction) if name == "everything" else np.ones(p)
        wrong = [
            ["m"], ["m", mu, kappa], ["m", mu, kappa, nu, nu], ["m", mu[1:], kappa, nu], ["m", mu, [*kappa, 1.0], nu],
            ["m", mu, kappa, []], ["m", None, kappa, nu], ["m", "1" * p, kappa, nu], ["m", mu, kappa, 0.0],
            ["m", mu, [kappa], nu], ["M", mu, kappa, nu],
        ]  # fmt: skip
        for bad in (0.0, -0.0, -1.0, True, None, "1"):
            wrong += [["m", [*mu[:-1], bad], kappa, nu], ["m", mu, [bad, *kappa[1:]], nu]]
        wrong += [["m", mu, kappa, [bad, *nu[1:]]] for bad in (True, None, "0")]
        # |nu| F > mu, where the friction of a node is not zero
        rubbing = int(np.argmax(F))
        wrong += [["m", mu, kappa, [1e9 * s * (i == rubbing) for i in range(p)]] for s in (1, -1)]
        for record in wrong:
            assert refused(body, replaced(records, k, record)), record
        for bad in (float("inf"), float("nan"), 10**400):
            forged = replaced(records, k, ["m", mu, kappa, [bad, *nu[1:]]])
            assert not accepted(body, forged)
            with pytest.raises(ProofFormatError):
                verify(body, proof_of(forged))


@pytest.mark.few(0, 2)
@pytest.mark.parametrize("name", BODIES)
def test_other_numbers(name):
    """What the checker in floats accepts the one in rationals does; what makes Q indefinite both refuse."""
    body, records = proven(name)
    rng, yes, no = np.random.default_rng(7), 0, 0
    for k in of_kind(records, "m")[:1]:
        own = np.array(records[k][1:])
        for spread in (1e-9, 0.1, 1.0, 3.0, 8.0):
            mu, kappa = own[:2] * np.exp(spread * rng.normal(size=(2, body.p)))
            forged = replaced(records, k, ["m", mu.tolist(), kappa.tolist(), own[2].tolist()])
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
    for k in of_kind(records, "m")[-1:]:
        head = max(head for head in heads(records) if head < k)
        F = np.max([body.friction_at(Fraction(end)) for end in records[head]["piece"]], axis=0)
        for share in (1.0 + 2.0**-30, 1.0 + 2.0**-45):
            nu = np.where(F > 0, share / np.where(F > 0, F, 1.0), 0.0).tolist()
            record = ["m", [1.0] * body.p, [1.0] * body.p, nu]
            assert refused(body, replaced(records, k, record))


# -- forgeries: the piece ----------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", BODIES)
def test_what_stands_beside_the_record(name):
    body, records = proven(name)
    p, k = body.p, of_kind(records, "m")[0]
    nothing = [0.0] * p
    beside = [records[k], ["c", "6" * p], ["c", records[of_kind(records, "s")[0]][1]], ["q", *[nothing] * 4]]
    beside += [["x", "6" * p, "", ""], ["f", "6" * p, "", ""], ["s", "6" * p], ["s", "5" * p], ["s", "9" * p], ["n"]]
    beside += [["s", records[j][1]] for j in of_kind(records, "s")[:1]]
    with by_the_tree():
        graph = branch_graph(body, [Fraction(end) for end in records[max(heads(records[:k]))]["piece"]])
    # a leaf whose claim is true
    whole = records_of(graph.proof)
    true = [whole[j] for j in of_kind(whole, "x")]
    for record in beside + true[:1]:
        for place in (k, k + 1):
            forged = [*records[:place], record, *records[place:]]
            assert refused(body, forged), record
            assert refused(body, counted(forged)), record


@pytest.mark.parametrize("name", BODIES)
def test_statuses_that_a_node_cannot_have(name):
    body, records = proven(name)
    for k in closed_heads(records):
        first = next(j for j in of_kind(records, "s") if j > k)
        codes = records[first][1]
        for i in range(body.p):
            other = "1" if codes[i] == "4" else "4"
            changed = codes[:i] + other + codes[i + 1 :]
            assert refused(body, replaced(records, first, ["s", changed]))
            both = [*records[:first], ["s", changed], *records[first:]]
            traces = of_kind(both, "t")
            own = next(j for j in traces if both[j][1] == codes)
            end = next((j for j in traces if j > own), len(both) - 1)
            empty = [["t", changed, *both[own][2:]], ["b", *both[own][2:4], 0, [["u", both[own][3]]]]]
            assert refused(body, counted([*both[:end], *empty, *both[end:]]))


@pytest.mark.parametrize("name", BODIES)
def test_a_piece_that_is_not_whole(name):
    """The same record once for what is in contact at a node, once for the rest."""
    body, records = proven(name)
    head = closed_heads(records)[0]
    a, b = map(Fraction, records[head]["piece"])
    inside = records[head + 1 : end_of(records, head)]
    code = "4" if body.friction[0] == body.friction_slope[0] == 0 else "5"
    parts = [code + "6" * (body.p - 1), "0" + "6" * (body.p - 1)]
    for roots in (parts, parts[:1], ["6" * body.p]):
        changed = [*records[: head + 1], *(["c", root] for root in roots)]
        for ends in ((a, (a + b) / 2), ((a + b) / 2, b)):
            changed += [{**records[head], "piece": list(map(str, ends)), "roots": roots}, *inside]
        changed += records[end_of(records, head) :]
        if roots == ["6" * body.p]:  # these are whole
            assert accepted(body, counted(changed))
            assert verify(body, proof_of(counted(changed))).ok
        else:
            assert refused(body, counted(changed))


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
        handed = [record[1] for record in records[head + 1 : end_of(records, head)] if record[0] == "s"]
        if codes in handed and ends[0] < b and a < ends[1]:
            return False
    return True


@pytest.mark.parametrize("name", BODIES)
def test_a_selection_removed(name):
    """With its trace or without it; where other pieces hand it on, its trace begins or ends at the closed one."""
    body, records = proven(name)
    for head in closed_heads(records):
        a, b = map(Fraction, records[head]["piece"])
        for k in [k for k in of_kind(records, "s") if head < k < end_of(records, head)]:
            removed = replaced(records, k)
            assert refused(body, removed)
            assert refused(body, counted(removed))
            assert refused(body, counted(without_trace(removed, records[k][1], a, b)))


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
                    changed += [["t", codes, low, high, record[4]], ["b", low, high, 0, [["h", high, 1]]]]
                continue
        skip = skip and isinstance(record, list) and record[0] == "b"
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
    for k in of_kind(changed, "b"):
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
    data, rng, k = Data(body), np.random.default_rng(4), of_kind(records, "m")[0]
    held = sorted((middle_of(records, records[j][1]), tuple(map(int, records[j][1]))) for j in of_kind(records, "s"))
    where, codes = zip(*held, strict=True)
    selections = [Selection(data, each, 0) for each in codes]
    own, wrong = np.array(records[k][1:]), {"first": False, "last": False}
    for _ in range(400):
        mu, kappa = own[:2] * np.exp(rng.normal(size=(2, body.p)))
        numbers = mu.tolist(), kappa.tolist(), [0.0] * body.p
        piece = ClosedPiece(data, fmpq(0), fmpq(3), *numbers)
        serves = [piece._alone(_Along(piece, each), at, at, 0) for each, at in zip(selections, where, strict=True)]
        found = {"first": serves[-1] and not serves[0], "last": serves[0] and not serves[-1]}
        for which in [which for which, seen in wrong.items() if found[which] and not seen]:
            for either in (records, wide):
                assert refused(body, replaced(either, of_kind(either, "m")[0], ["m", *numbers])), serves
            wrong[which] = True
        if all(wrong.values()):
            return
    raise AssertionError(wrong)


def middle_of(records, codes):
    """An alpha at which a selection has a solution."""
    first = next(k for k in of_kind(records, "t") if records[k][1] == codes)
    begin = records[first][2]
    for part in (part for box in takewhile(lambda record: record[0] == "b", records[first + 1 :]) for part in box[4]):
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
    changed, p = [records[0]], records[0]["p"]
    for a, b in pairwise(cut):
        side = 0 if len(cut) == 2 else 1 if b > 0 else -1
        here = sorted({records[k][1] for k in of_kind(records, "t") if records[k][4] == side} & set(chosen))
        piece = {**records[heads(records)[0]], "piece": [str(a), str(b)], "roots": ["6" * p]}
        changed += [piece, ["m", *numbers], *(["s", codes] for codes in here)]
    changed.append(next(record for record in records if "traces" in record))
    kept = False
    for record in records:
        if isinstance(record, list) and record[0] == "t":
            kept = record[1] in chosen
        if isinstance(record, list) and record[0] in "tb" and kept:
            changed.append(record)
    return counted([*changed, records[-1]])


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
    codes, p = sorted({records[k][1] for k in of_kind(records, "s")}), body.p
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
    codes = {records[k][1] for k in of_kind(records, "s")}
    forged = only(records, codes, [[1.0], [1.0], [0.0]])
    assert verify(body, proof_of(forged)).complete
    assert accepted(body, forged)
