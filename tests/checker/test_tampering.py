"""A proof that was tampered with is refused, with a reason and never with a traceback."""

import functools

import numpy as np
import pytest
from generators import integer_problem
from proof_tools import (
    MAGIC,
    Judge,
    bytes_of,
    copied,
    leaves_of,
    multipliers,
    proof_of,
    records_of,
    sealed,
    with_multipliers,
)

import enumsol
from enumsol import Proof, ProofFormatError, enumerate_roots, gallery, verify

NAMES = ("one-node-6.1", "one-node-6.3", "two-node-5", "wedge-8-3", "chain-2-coupled", "degenerate")


@functools.cache
def case(name):
    """Problem, records and bytes of its proof."""
    if name == "degenerate":
        problem, alpha = integer_problem(np.random.default_rng(34), 2), 0.0
    else:
        entry = gallery.get(name)
        problem, alpha = entry.build(), entry.alpha
    roots = enumerate_roots(problem, alpha)
    assert roots.complete
    return problem, records_of(roots.proof), bytes_of(roots.proof)


def refused(name, records):
    """The report on tampered records, which must refuse them."""
    report = verify(case(name)[0], proof_of(records))
    assert not report.ok
    assert not report.complete
    assert report.failures
    assert "REFUSED" in repr(report)
    return report


def of_kind(records, *kinds):
    return [k for k, record in enumerate(records) if isinstance(record, list) and record[0] in kinds]


@pytest.mark.parametrize("name", NAMES)
def test_put_together_again_it_verifies(name):
    problem, records, data = case(name)
    assert verify(problem, Proof(data)).complete
    assert verify(problem, proof_of(records)).complete


@pytest.mark.parametrize("name", NAMES)
def test_a_dropped_leaf(name):
    _, records, _ = case(name)
    for k, _ in leaves_of(records)[:12]:
        refused(name, records[:k] + records[k + 1 :])
    # with the counts at the end made to fit
    k, _ = leaves_of(records)[-1]
    changed = copied(records)
    changed[-1]["leaves"] -= 1
    refused(name, changed[:k] + changed[k + 1 :])


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_status(name):
    _, records, _ = case(name)
    for k in of_kind(records, "b")[:10]:
        _, node, children = records[k]
        others = [children[:-1], [*children[:-1], children[0]], [*children, 0], [1, 2], [], [6]]
        others += [[c + 1 for c in children], [float("1e300")], "01", {"0": 5}]
        for other in others:
            changed = copied(records)
            changed[k] = ["b", node, other]
            refused(name, changed)
        for other in (-1, node + records[0]["p"], 0.5, "0", None, [node]):
            changed = copied(records)
            changed[k] = ["b", other, children]
            refused(name, changed)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "one-node-6.3"])
def test_swapped_children_prove_nothing(name):
    # the order of the children says which subtree is which
    problem, records, _ = case(name)
    judge = Judge(problem)
    for k in of_kind(records, "b")[:6]:
        changed = copied(records)
        changed[k][2] = changed[k][2][::-1]
        if problem.p > 4 or not judge.valid(changed):
            refused(name, changed)


@pytest.mark.few(4)
@pytest.mark.parametrize("name", NAMES)
def test_changed_multipliers(name):
    problem, records, _ = case(name)
    judge = Judge(problem)
    for k in of_kind(records, "x")[:8]:
        rows, values = multipliers(records[k])
        worthless = ([], []), (rows, [0.0] * len(rows)), (rows, [-1e3 * v for v in values])
        absurd = (rows, [float("nan")] * len(rows)), (rows, [1e308] * len(rows)), ([7 * problem.p], [1.0])
        for some in (*worthless, *absurd, ([2**32 - 1], [1.0]), (rows, [1e-9 * v for v in values])):
            changed = copied(records)
            changed[k] = with_multipliers(changed[k], *some)
            if problem.p > 4 or not judge.valid(changed):
                refused(name, changed)


def test_every_multiplier_counts_by_exact_judgement():
    # each multiplier halved, doubled, with its sign changed, or left out: accepted only where it still proves the leaf
    for name in ("one-node-6.1", "two-node-5"):
        problem, records, _ = case(name)
        judge, accepted = Judge(problem), 0
        for k in of_kind(records, "x"):
            rows, values = multipliers(records[k])
            for j in range(len(rows)):
                for factor in (0.5, 2.0, -1.0):
                    changed = copied(records)
                    altered = [v * factor if i == j else v for i, v in enumerate(values)]
                    changed[k] = with_multipliers(changed[k], rows, altered)
                    ok = verify(problem, proof_of(changed)).ok
                    assert not ok or judge.valid(changed)
                    accepted += ok
        assert accepted > 0


@pytest.mark.parametrize("name", ["one-node-6.1", "two-node-5", "wedge-8-3", "chain-2-coupled"])
def test_a_moved_or_shrunk_enclosure(name):
    _, records, _ = case(name)
    for k in of_kind(records, "r")[:5]:
        _, mid, rad, index = records[k]
        component = int(np.argmax(rad))
        moved = [m + (3 * r if i == component else 0.0) for i, (m, r) in enumerate(zip(mid, rad, strict=True))]
        # the enclosure of a root at which all nodes are open is the point zero
        shrunk = [["r", moved, rad, index], ["r", mid, [0.0] * len(rad), index], ["r", mid, [-r for r in rad], index]]
        for other in (
            *(shrunk if any(rad) else []),
            ["r", mid, [0.0] * (len(rad) - 1) + [-1.0], index],
            ["r", mid, rad, 0],
            ["r", [m + 1.0 for m in mid], rad, index],
            ["r", mid, rad, -index],
            ["r", mid, rad, None],
            ["r", mid[:-1], rad[:-1], index],
            ["r", mid, rad],
            ["n"],
        ):
            changed = copied(records)
            changed[k] = other
            refused(name, changed)


@pytest.mark.parametrize("name", ["one-node-6.3", "degenerate"])
def test_changed_rational_roots(name):
    _, records, _ = case(name)
    found = of_kind(records, "D")
    assert found
    for k in found:
        _, points, dimension = records[k]
        one = [["1/1"] * len(points[0]), *points[1:]]
        for other in (
            ["D", one, dimension],
            ["D", [*points, points[0]], dimension],
            ["D", points[1:], dimension],
            ["D", points, dimension + 1],
            ["D", [["1/0"] * len(points[0])], 0],
            ["D", [["1e999999999"] * len(points[0])], 0],
            ["D", [[1.0] * len(points[0])], 0],
            ["D", [], 0],
            ["N"],
            ["n"],
            ["z"],
        ):
            changed = copied(records)
            changed[k] = other
            refused(name, changed)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", ["two-node-5", "wedge-8-3", "chain-2-coupled"])
def test_a_certificate_at_another_leaf(name):
    problem, records, _ = case(name)
    judge = Judge(problem)
    excluded = of_kind(records, "x")
    roots = of_kind(records, "r")
    refusals = 0
    for k in excluded[:6]:
        for other in roots[:3]:
            # where a root is, no multipliers can prove anything
            changed = copied(records)
            changed[other] = changed[k]
            changed[-1]["roots"] -= 1
            refused(name, changed)
        for other in excluded[:12]:
            changed = copied(records)
            changed[k], changed[other] = changed[other], changed[k]
            ok = verify(problem, proof_of(changed)).ok
            refusals += not ok
            if ok and problem.p <= 4:
                assert judge.valid(changed)
    assert refusals > 0


@pytest.mark.parametrize("name", NAMES)
def test_wrong_counts(name):
    _, records, _ = case(name)
    for key in ("roots", "families", "undecided", "leaves"):
        for change in (1, -1, 0.5, None):
            changed = copied(records)
            changed[-1][key] = None if change is None else changed[-1][key] + change
            refused(name, changed)
    for tail in ([], [{}], [records[-1], records[-1]], [records[-1], "null"], [records[-1], ["u", "more"]], [[]]):
        refused(name, records[:-1] + tail)


@pytest.mark.parametrize("name", NAMES)
def test_another_problem(name):
    problem, records, data = case(name)
    for other in NAMES:
        if other != name:
            report = verify(case(other)[0], Proof(data))
            assert not report.ok
            assert "another problem" in report.failures[0]
    # the same but for one bit of the load
    f = problem.f.copy()
    f[np.flatnonzero(f)[0]] = np.nextafter(f[np.flatnonzero(f)[0]], np.inf)
    near = enumsol.ContactProblem(problem.A, problem.Bn, problem.Bt, f, friction=problem.friction, gap=problem.gap)
    assert not verify(near, Proof(data)).ok
    changed = copied(records)
    changed[0]["problem"] = case(NAMES[0 if name != NAMES[0] else 1])[1][0]["problem"]
    assert "another problem" in refused(name, changed).failures[0]


@pytest.mark.parametrize("name", NAMES)
def test_versions(name):
    problem, records, data = case(name)
    for line in (b"enumsol-proof 2\n", b"enumsol-proof 10", b"enumsol-proof\n"):
        with pytest.raises(ProofFormatError, match=r"version|no proof"):
            verify(problem, proof_of(records, magic=line))
    with pytest.raises(ProofFormatError, match="another version"):
        verify(problem, Proof(data.replace(MAGIC, b"enumsol-proof 2\n")))
    for version in (0, 2, "1", None):
        changed = copied(records)
        changed[0]["version"] = version
        assert "version" in refused(name, changed).failures[0]


@pytest.mark.parametrize("name", NAMES[:5])
def test_truncated_files(name, tmp_path):
    problem, records, data = case(name)
    for length in (0, 1, 15, 16, 47, 48, len(data) // 2, len(data) - 32, len(data) - 1):
        path = tmp_path / "short.proof"
        path.write_bytes(data[:length])
        message = r"damaged or truncated|no proof file|another version"
        with pytest.raises(ProofFormatError, match=message):
            Proof.load(path)
        with pytest.raises(ProofFormatError, match=message):
            verify(problem, Proof(data[:length]))
    # cut short inside, under a right checksum
    body = data[len(MAGIC) : -32]
    for length in (0, 1, len(body) // 2, len(body) - 1):
        with pytest.raises(ProofFormatError, match=r"ends in the middle|cannot be decoded"):
            verify(problem, sealed(body[:length]))
    with pytest.raises(ProofFormatError, match="ends in the middle"):
        verify(problem, sealed(body + b"more"))
    for count in (0, 1, len(records) // 2, len(records) - 1):
        refused(name, records[:count])
