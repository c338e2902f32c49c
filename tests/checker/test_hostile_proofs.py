"""What stands in a proof file is read within bounds, header first, and refused in words."""

import base64
import functools
import gc
import json
import os
import tracemalloc
import zlib
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from complete import accepted_report
from effort import some
from generators import named
from oracles import exact_solutions
from proof_fuzz import mutant
from proof_tools import Judge, bytes_of, multipliers, of_kind, proof_of, put, records_of, sealed, with_multipliers
from refusals import bad_argument, refusal

import enumsol
from enumsol import ContactProblem, EnumsolError, Proof, ProofFormatError, enumerate_roots, gallery, verify
from enumsol.cli import main
from enumsol.condensation.factorization import Factorization
from enumsol.proof import proof_file as proof_module
from enumsol.proof.writer import Part

BEFORE = {item["name"]: item for item in json.loads(Path(__file__).with_name("proofs_written_before.json").read_text())}
GRAPHS = [name for name in BEFORE if name.startswith("graph")]


@functools.cache
def before(name):
    """A problem and its proof as an earlier version wrote it."""
    data = dict(BEFORE[name]["problem"])
    data["friction"], data["friction_slope"] = (np.array(part, dtype=float) for part in data["friction"])
    return ContactProblem(**data), Proof(base64.b64decode(BEFORE[name]["proof"]))


def changed(name, k, **fields):
    """The problem, and its proof with fields of record k replaced."""
    problem, proof = before(name)
    return problem, proof_of(put(records_of(proof), (k,), lambda record: record | fields))


class Effort:
    """What a reader makes of a file: characters that it expands, and the most memory that it holds."""

    def __init__(self, monkeypatch):
        self.characters = 0
        real = zlib.decompressobj
        effort = self

        class Counting:
            def __init__(self):
                self.inner = real()

            def decompress(self, *arguments):
                part = self.inner.decompress(*arguments)
                effort.characters += len(part)
                return part

            def __getattr__(self, name):
                return getattr(self.inner, name)

        class Module:
            decompressobj = Counting

            def __getattr__(self, name):
                return getattr(zlib, name)

        monkeypatch.setattr(proof_module, "zlib", Module())

    def of(self, problem, proof):
        """The report on a proof, or the error."""
        gc.collect()
        tracemalloc.start()
        try:
            return verify(problem, proof)
        except ProofFormatError as error:
            return error
        finally:
            self.memory = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()


def refused(problem, proof):
    """The report, which refuses and says why."""
    report = verify(problem, proof)
    assert (report.ok, report.complete) == (False, False)
    assert report.failures
    assert "REFUSED" in repr(report)
    return report


def header_of(problem, alpha):
    """The header of a proof in units of one."""
    header = {"format": "enumsol-proof", "version": 2, "problem": problem.fingerprint, "alpha": alpha, "p": problem.p}
    return header | {"data": "problem", "force": [0] * 2 * problem.p, "length": [0] * 2 * problem.p}


def whole_tree(p, leaf):
    """A tree of all selections whose leaves prove nothing."""
    tree, waiting = [], [(6,) * p]
    while waiting:
        codes = waiting.pop()
        node = next((i for i, code in enumerate(codes) if code >= 5), None)
        children = () if node is None else (0, 5) if codes[node] == 6 else (1, 2, 3)
        tree.append(["b", node, list(children)] if children else leaf)
        waiting += [(*codes[:node], child, *codes[node + 1 :]) for child in reversed(children)]
    return tree


def bomb(first, line, megabytes):
    """A small file of these records and then one line again and again."""
    text = "".join(json.dumps(record) + "\n" for record in first).encode()
    packer = zlib.compressobj(9)
    parts = [packer.compress(text)]
    block = (line + "\n").encode() * (1_000_000 // (len(line) + 1))
    parts += [packer.compress(block) for _ in range(megabytes)]
    return sealed(b"".join([*parts, packer.flush()]))


# -- proofs of today ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BEFORE)
def test_proofs_of_the_version_before_are_accepted(name):
    problem, proof = before(name)
    report = accepted_report(problem, proof)
    found = {key: getattr(report, key) for key in BEFORE[name]["claim"]}
    if "selections" in found:
        found["selections"] = len(found["selections"])
    assert found == BEFORE[name]["claim"]
    assert report.data == BEFORE[name]["data"]


def test_those_proofs_hold_records_of_every_kind():
    kinds = {record[0] for name in BEFORE for record in records_of(before(name)[1])[1:-1] if isinstance(record, list)}
    assert kinds == set("bxnrDzusp")


# -- memory and work ---------------------------------------------------------------------------------------------------


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["stopped", "graph in several pieces"])
@pytest.mark.parametrize("line", ["[]", "null", '["u",""]', '["s","000"]', "{}"])
def test_a_small_file_of_very_many_records(name, line, monkeypatch):
    # the report of this defect: 58 KB, 94 s, 2.5 GB
    (problem, proof), effort = before(name), Effort(monkeypatch)
    proof = bomb(records_of(proof)[:2], line, 60)
    assert proof.size < 500_000
    outcome = effort.of(problem, proof)
    assert isinstance(outcome, ProofFormatError) or not outcome.ok
    assert effort.characters < 500_000
    assert effort.memory < 20e6


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["stopped", "graph in several pieces"])
@pytest.mark.parametrize("part", ["[],", '"",', "0,", '["0/1"],', "[" * 1000])
def test_a_small_file_of_one_long_record(name, part, monkeypatch):
    (problem, proof), effort = before(name), Effort(monkeypatch)
    text = json.dumps(records_of(proof)[0]) + "\n[" + part * (60_000_000 // len(part)) + "0]\n"
    proof = sealed(zlib.compress(text.encode(), 9))
    assert isinstance(effort.of(problem, proof), ProofFormatError)
    assert effort.characters < 2 * (proof_module.RECORD_SHARE * proof.size + proof_module.SMALL)
    assert effort.memory < 20e6


@pytest.mark.long
def test_no_file_is_expanded_beyond_its_size(monkeypatch):
    problem = gallery.chain(8)
    text = "".join(json.dumps(record) + "\n" for record in (header_of(problem, "5"), *whole_tree(8, ["u", ""])))
    proof = sealed(zlib.compress(text.encode(), 9))
    effort = Effort(monkeypatch)
    outcome = effort.of(problem, proof)
    assert outcome.failures == (f"the counts at the end are missing; the tree has {4**8} leaves",)
    assert effort.characters <= len(text) + 2**17
    assert effort.memory < 20e6
    # the same file, were it not allowed to stand for as many characters
    monkeypatch.setattr(proof_module, "EXPANSION", len(text) // proof.size // 2)
    monkeypatch.setattr(proof_module, "SMALL", 0)
    effort.characters = 0
    outcome = effort.of(problem, proof)
    assert isinstance(outcome, ProofFormatError)
    assert "expand to more than" in str(outcome)
    assert effort.characters < 0.5 * len(text) + 2**17


def test_what_the_writer_writes_is_far_from_these_bounds():
    # most compressible of all is one character
    for lines in (["0" * 10**7], ['["n"]'] * 10**6, ['["b",0,[0,5]]', '["u","stopped"]'] * 10**6):
        part = Part.of(lines)
        assert part.size / len(part.data) < proof_module.EXPANSION
    for name in BEFORE:
        data = before(name)[1]
        text = zlib.decompress(data._source[16:-32])
        assert len(text) < 0.1 * (proof_module.EXPANSION * data.size + proof_module.SMALL)
        longest = max(map(len, text.splitlines()))
        assert longest < 0.1 * (proof_module.RECORD_SHARE * data.size + proof_module.SMALL)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("name", ["stopped", "graph in several pieces"])
def test_the_header_comes_first(name, monkeypatch):
    other = gallery.clamped_block(8, 4)
    records = records_of(before(name)[1])
    for key, value in (("problem", "0" * 64), ("p", 10**9), ("version", 1), ("data", "both"), ("kind", "sheaf")):
        first = [records[0] | {"problem": other.fingerprint, "p": other.p, key: value}]
        effort = Effort(monkeypatch)
        outcome = effort.of(other, bomb([*first, records[1]], "[]", 5))
        assert not outcome.ok
        assert effort.characters < 200_000
        # nothing was condensed for it
        assert not {"condensed", "enclosure"} & set(vars(other))


def test_a_tree_is_walked_to_its_end_before_anything_is_computed(monkeypatch):
    problem, proof = before("rational leaves")
    records = records_of(proof)
    fresh = ContactProblem(
        problem.A, problem.Bn, problem.Bt, problem.f, friction=problem.friction, friction_slope=problem.friction_slope
    )
    assert fresh.fingerprint == problem.fingerprint
    solves = []
    fresh.factorization  # noqa: B018 (made here, so that only solves with it are counted)
    with monkeypatch.context() as watched:
        watched.setattr(Factorization, "solve", lambda *_, **__: solves.append(1))
        for tampered in (records[:-2], records[:-1], [*records, records[-1]], put(records, (-1, "leaves"), 3)):
            refused(fresh, proof_of(tampered))
            assert not solves
    assert verify(fresh, proof).ok


def test_the_check_ends_after_some_failures():
    problem, proof = before("degenerate")
    alike = [["x", "", ""] if record[0] in "Dn" else record for record in records_of(proof)[1:-1]]
    records = [records_of(proof)[0], *alike, records_of(proof)[-1]]
    assert 1 < len(refused(problem, proof_of(records)).failures) <= 21
    wide, tree = gallery.chain(4), whole_tree(4, ["x", "", ""])
    footer = {"roots": 0, "families": 0, "undecided": 0, "leaves": len(of_kind(tree, "x"))}
    report = refused(wide, proof_of([header_of(wide, "5"), *tree, footer]))
    assert len(report.failures) == 21
    assert "the check ends after 20 failures" in report.failures
    # leaves are checked in batches
    assert report.leaves <= 256 + 20


def test_a_leaf_with_more_multipliers_than_there_are_rows():
    for name in ("stopped", "graph in several pieces"):
        problem, proof = before(name)
        records = records_of(proof)
        k = of_kind(records, "x")[0]
        rows, values = multipliers(["x", *records[k][-2:]])
        records[k][-2:] = with_multipliers(["x", "", ""], rows * 100, [v / 100 for v in values * 100])[1:]
        assert "multipliers, and there are" in refused(problem, proof_of(records)).failures[0]


def test_rational_leaves_of_a_large_problem_are_not_tried(monkeypatch):
    from enumsol.checker import rational

    problem = gallery.clamped_block(10, 20, contact=1)
    assert problem.n > 250
    monkeypatch.setattr(rational, "fmpq_mat", None)
    footer = {"roots": 0, "families": 0, "undecided": 0, "leaves": 4}
    report = refused(problem, proof_of([header_of(problem, "1"), *whole_tree(1, ["n", "rational"]), footer]))
    assert f"n = {problem.n} degrees of freedom; expected at most 250" in report.failures[0]


def test_long_fractions_of_points_are_compared_and_not_computed():
    problem, proof = before("degenerate")
    records = records_of(proof)
    k = of_kind(records, "D")[0]
    point = records[k][1][0]
    digits = np.random.default_rng(1).bytes(200_000).hex()
    for text in (f"{digits}/1{digits}", "0/0", "-0/1", "0/2", "00/1", "1", "1/1/1", "1e9/1", " 0/1", ""):
        other = [text, *point[1:]] if point[0] != text else [*point[:-1], text]
        tampered = proof_of(put(records, (k, 1, 0), other))
        assert "its roots are not those that are claimed" in refused(problem, tampered).failures[0]


# -- numbers -----------------------------------------------------------------------------------------------------------

NO_FRACTIONS = [
    "1e4000000", "1e400", "-1e400", "1" + "0" * 400, "-1" + "0" * 400, "9" * 4001, "1/" + "9" * 4001, "1/0", "0/0",
    "1/-3", "nan", "inf", "-inf", "1.5", " 1", "1_0", "+1", "\u0663", "", "1/", "/2", 0, 1, 0.5, None, True, [], ["1"],
    {},
]  # fmt: skip


@pytest.mark.parametrize("text", NO_FRACTIONS, ids=lambda text: repr(text)[:12])
def test_what_is_no_fraction(text):
    for name in GRAPHS:
        ends = records_of(before(name)[1])[0]["interval"]
        for interval in ([text, ends[1]], [ends[0], text]):
            report = refused(*changed(name, 0, interval=interval))
            assert report.interval is None
            refused(*changed(name, 1, piece=interval))
    for name in ("stopped", "unloaded"):
        assert refused(*changed(name, 0, alpha=text)).alpha is None


@pytest.mark.parametrize("text", ["1" + "0" * 308, "1/3", "9" * 4000 + "/" + "9" * 4000, "-1/" + "1" + "0" * 3999])
def test_a_fraction_at_the_bounds_is_a_number(text):
    for name in ("graph", "stopped"):
        key, value = ("interval", sorted([text, "7"], key=Fraction)) if name == "graph" else ("alpha", text)
        report = verify(*changed(name, 0, **{key: value}))
        assert (report.interval if name == "graph" else report.alpha) is not None
        assert repr(report)


# -- the file ----------------------------------------------------------------------------------------------------------


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", tmp_path / "missing", Path("/dev/null")):
        refusal(ProofFormatError, "cannot be read", Proof.load, path)
    for path in (5, None, b"x", "a\0b"):
        bad_argument("expected", Proof.load, path)
    problem, proof = before("graph")
    for path in (tmp_path, tmp_path / "no" / "such", "/dev/full"):
        refusal(EnumsolError, "cannot be written", proof.save, path)
    bad_argument("a character that no name has", proof.save, "a\0b")
    file = tmp_path / "kept.proof"
    proof.save(str(file))
    loaded = Proof.load(str(file))
    assert verify(problem, loaded).ok
    assert f"{file.stat().st_size} bytes" in repr(loaded)
    file.unlink()
    for use in (lambda: verify(problem, loaded), lambda: loaded.size, lambda: loaded.save(tmp_path / "copy")):
        refusal(ProofFormatError, "cannot be read", use)
    assert "cannot be read" in repr(loaded)
    refusal(EnumsolError, "proof is a list", Proof, [])


@pytest.mark.slow
def test_the_command_line_answers_in_words(tmp_path, capsys):
    hostile = {}
    for name in ("stopped", "graph in several pieces"):
        problem, proof = before(name)
        enumsol.write_problem(problem, tmp_path / f"{name}.npz")
        key = "alpha" if name == "stopped" else "interval"
        hostile[name, "fraction"] = changed(name, 0, **{key: "1e400" if key == "alpha" else ["0", "1e4000000"]})[1]
        hostile[name, "bomb"] = bomb(records_of(proof)[:2], "[]", 5)
        hostile[name, "deep"] = proof_of([records_of(proof)[0], "[" * 100_000])
        hostile[name, "deep enough"] = proof_of([*records_of(proof)[:-1], "[" * 500 + "]" * 500])
        hostile[name, "surrogates"] = proof_of([*records_of(proof)[:-1], ["\ud800", "\x1b[31m"]])
        hostile[name, "junk"] = sealed(proof._source[16:-32] + b"junk")
    for (name, what), proof in hostile.items():
        proof.save(tmp_path / "hostile.proof")
        assert main(["verify", str(tmp_path / f"{name}.npz"), str(tmp_path / "hostile.proof")]) == 2
        out, err = capsys.readouterr()
        text = out + err
        assert text.startswith(("proof: REFUSED", "enumsol: error: ")), what
        assert "Traceback" not in text
        assert "\x1b" not in text
        assert len(text) < 1500


# -- fuzzing -----------------------------------------------------------------------------------------------------------

#: Proofs of today beside those of the version before: more kinds of records, and roots on the border of conditions.
TODAY = ("one-node-6.1", "one-node-6.3", "two-node-5", "two-node-6.4")


@functools.cache
def original(name):
    """Problem and proof."""
    if name in BEFORE:
        return before(name)
    problem, alpha = named(name)
    return problem, sealed(bytes_of(enumerate_roots(problem, alpha).proof)[16:-32])


@functools.cache
def holding(name, alpha):
    """Selections of the proof that hold at an alpha, in rationals."""
    problem, proof = before(name)
    handed = verify(problem, proof).selections
    return {codes for solution in exact_solutions(problem, alpha) for codes, *_ in solution.parts} & handed


def is_true(name, report, records):
    """Whether what a report on changed records claims is true, by rational arithmetic."""
    problem, proof = original(name)
    if records == records_of(proof):
        return True
    if name not in GRAPHS:
        # certified may be S and g as computed, which the exact judge does not know; nothing else may have changed
        return Judge(problem).valid([{**records[0], "data": "problem"}, *records[1:]])
    a, b = report.interval
    return all(holding(name, a + (b - a) * Fraction(k, 4)) <= report.selections for k in range(5))


@pytest.mark.few(0, 1)
@pytest.mark.usefixtures("enclosed_once")
@pytest.mark.parametrize("name", [*TODAY, *BEFORE])
def test_mutants(name, monkeypatch):
    """Every mutant is refused, is named malformed, or claims what is true; nothing else is raised or warned of."""
    problem, proof = original(name)
    records, rng = records_of(proof), np.random.default_rng([7, [*TODAY, *BEFORE].index(name)])
    effort = Effort(monkeypatch)
    outcomes = {"malformed": 0, "refused": 0, "true": 0}
    for k in range(count := some(100, of=250)):
        # in the first two fifths the numbers of the records alone
        candidate, how = mutant(rng, records, proof._source, ("nudge", "numbers") if k < 0.4 * count else None)
        effort.characters = 0
        try:
            report = verify(problem, candidate)
        except ProofFormatError:
            outcomes["malformed"] += 1
        else:
            assert repr(report)
            assert report.ok == (not report.failures)
            assert not report.ok or is_true(name, report, records_of(candidate)), how
            outcomes["true" if report.ok else "refused"] += 1
        # twice: the tree alone, then its leaves
        assert effort.characters <= 2 * (proof_module.EXPANSION * candidate.size + proof_module.SMALL) + 2**17
    assert min(outcomes["malformed"], outcomes["refused"]) > count // 10
    assert outcomes["true"]


@pytest.mark.parametrize("name", TODAY)
def test_some_changes_are_accepted(name):
    """Or else the test above would say nothing: multipliers in another order, and wider balls."""
    problem, proof = original(name)
    records = records_of(proof)
    for k in of_kind(records, "r", "x"):
        if records[k][0] == "r":
            changed = put(records, (k, 2), [2 * r for r in records[k][2]])
        else:
            rows, values = multipliers(records[k])
            changed = put(records, (k,), with_multipliers(records[k], rows[::-1], values[::-1]))
        assert verify(problem, proof_of(changed)).complete
        assert Judge(problem).valid(changed)


@pytest.mark.parametrize("name", ["one-node-6.1", "two-node-5"])
def test_any_flipped_bit_is_refused(name):
    problem, proof = original(name)
    data = proof._source
    for bit in np.random.default_rng(1).choice(8 * len(data), size=some(400, of=1500)).tolist():
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        with pytest.raises(ProofFormatError):
            verify(problem, Proof(bytes(flipped)))


@pytest.mark.parametrize("exponent", [-901, -900, -600, -540, 0, 540, 600, 900, 901])
@pytest.mark.few(9, 0)
@pytest.mark.parametrize("other", [-900, 0, 900])
def test_extreme_units(exponent, other):
    for name in ("one-node-6.1", "one-node-6.3"):
        problem, proof = original(name)
        header, *records = records_of(proof)
        changed = [header | {"force": [exponent] * 2, "length": [other] * 2}, *records]
        assert not verify(problem, proof_of(changed)).ok or Judge(problem).valid(changed)
