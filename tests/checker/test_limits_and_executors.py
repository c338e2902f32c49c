"""Proofs of searches that were cut short, run in parallel, streamed, saved or interrupted."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from compare import differences
from complete import accepted_report, all_roots, complete_report, proven_roots
from effort import some
from generators import integer_problem, named
from interruptions import CtrlC, interrupted
from proof_tools import bytes_of, records_of
from refusals import bad_argument

import enumsol
from enumsol import ContactProblem, Proof, enumerate_roots, gallery, verify
from enumsol.condensation.exact import ExactSystem
from enumsol.proof.proof_file import fraction_text


@pytest.fixture(scope="module", params=["processes", "threads"])
def executor(request):
    pool = ProcessPoolExecutor(2) if request.param == "processes" else ThreadPoolExecutor(2)
    with pool:
        yield pool


def degenerate():
    """A problem with a root on the border of several selections, and two with a family."""
    for seed in (20, 34):
        yield integer_problem(np.random.default_rng(seed), 2), 0.0
    yield gallery.get("one-node-6.3").build(), 2.0


def test_executors_give_the_same_roots_and_a_proof(executor, wedge, tmp_path):
    for k, (problem, alpha) in enumerate([wedge, *degenerate()]):
        alone = enumerate_roots(problem, alpha)
        path = tmp_path / f"{k}.proof"
        together = all_roots(problem, alpha, executor=executor, proof_path=path)
        assert not differences(together, alone, rtol=1e-12)
        assert together.index_sum == 1
        for one, two in zip(together, alone, strict=True):
            assert (one.enclosure is None) == (two.enclosure is None)
            if one.enclosure is not None:
                assert np.all(one.enclosure.lambda_n == two.enclosure.lambda_n)
        for proof in (together.proof, Proof.load(path)):
            report = complete_report(problem, proof)
            assert (report.roots, report.families) == (len(alone), len(alone.families))


def check_cut_short(problem, roots):
    """Not complete; the proof is good for what it covers and counts what it does not."""
    assert not roots.complete
    assert roots.stopped
    assert roots.undecided
    report = accepted_report(problem, roots.proof)
    assert (report.complete, report.undecided, report.roots) == (False, len(roots.undecided), len(roots))


@pytest.mark.parametrize(
    "limits", [{"stop_after": 1}, {"stop_after": 2}, {"max_nodes": 1}, {"max_nodes": 40}, {"time_limit": 1e-9}]
)
def test_limits(limits, wedge):
    problem, alpha = wedge
    roots = enumerate_roots(problem, alpha, **limits)
    check_cut_short(problem, roots)
    if "stop_after" in limits:
        assert len(roots) == limits["stop_after"]


def test_a_limit_that_was_not_reached(wedge):
    problem, alpha = wedge
    proven_roots(problem, alpha, max_nodes=100_000, time_limit=1e6, stop_after=100)


def test_streamed_saved_and_loaded(wedge, tmp_path):
    problem, alpha = wedge
    in_memory = enumerate_roots(problem, alpha)
    path = tmp_path / "streamed.proof"
    streamed = enumerate_roots(problem, alpha, proof_path=path)
    assert bytes_of(streamed.proof) == path.read_bytes() == bytes_of(in_memory.proof)
    assert streamed.proof.size == path.stat().st_size
    saved = tmp_path / "saved.proof"
    in_memory.proof.save(saved)
    assert saved.read_bytes() == path.read_bytes()
    assert verify(problem, Proof.load(saved)).complete
    assert str(path) in repr(streamed.proof)
    assert "in memory" in repr(in_memory.proof)


def test_proof_is_written_while_the_search_runs(wedge, tmp_path):
    problem, alpha = wedge
    path = tmp_path / "growing.proof"
    sizes = []
    enumerate_roots(problem, alpha, proof_path=path, progress=lambda _: sizes.append(path.stat().st_size))
    assert len(sizes) >= 3
    assert path.stat().st_size > sizes[0]


def test_interruption_keeps_the_roots_and_no_proof(wedge, tmp_path):
    problem, alpha = wedge
    path, stop = tmp_path / "interrupted.proof", CtrlC(lambda progress: progress.nodes >= 192)
    partial = interrupted("interrupted", enumerate_roots, problem, alpha, progress=stop, proof_path=path)
    assert (partial.complete, partial.proof) == (False, None)
    assert "interrupted" in partial.stopped
    # what is left on disk is no proof of anything
    report = verify(problem, Proof.load(path))
    assert not report.ok
    assert "breaks off" in report.failures[0]


def test_progress_of_the_checker():
    problem, alpha = named("wedge-14-5")
    proof = enumerate_roots(problem, alpha).proof
    seen = []
    report = verify(problem, proof, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] <= report.leaves
    assert len(seen) == report.leaves // 256


def test_a_proof_that_cannot_be_written(tmp_path, wedge):
    with pytest.raises(enumsol.InvalidArgumentError, match=r"proof_path .* cannot be written"):
        enumerate_roots(*wedge, proof_path=tmp_path / "nowhere" / "x.proof")


def test_arguments_of_verify(wedge):
    problem, alpha = wedge
    roots = enumerate_roots(problem, alpha)
    bad_argument("proof is a RootSet", verify, problem, roots)
    bad_argument("problem is a Proof", verify, roots.proof, roots.proof)


def test_a_report_prints_its_counts(wedge):
    problem, alpha = wedge
    report = verify(problem, enumerate_roots(problem, alpha).proof)
    assert report.alpha == Fraction(alpha)
    text = repr(report)
    said = "at alpha = 3.0\n", "proof: verified", "5 isolated roots", "0 families", "0 of them undecided", "as given"
    assert all(part in text for part in (*said, "complete: yes")), text


def test_rational_leaves_may_be_long(monkeypatch):
    monkeypatch.setattr("enumsol.search.fathoming.Closer.closed", lambda *_: None)
    # many digits would decide it
    monkeypatch.setattr("enumsol.search.solvers.Solvers._solved_precisely", lambda *_: None)
    # a gap that is closed to within rounding, in a body whose entries are full floats: fractions of many digits
    rng, n = np.random.default_rng(3), 60
    X = rng.normal(size=(n, n + 5))
    rows, A = np.eye(n), X @ X.T
    free = ContactProblem(0.5 * (A + A.T), rows[:1], rows[1:2], rng.normal(size=n), friction=0.5)
    exact = ExactSystem.from_problem(free, 0).g[0]
    nearest = int(exact.p) / int(exact.q)
    longest = rationals = 0
    for gap in (nearest, np.nextafter(nearest, -np.inf)):
        roots = proven_roots(free.replace(gap=float(gap)), 0.0)
        rationals += roots.stats.escalations.rationals
        points = [p for record in records_of(roots.proof)[1:-1] if record[0] == "D" for p in record[1]]
        longest = max([longest, *(len(part) for point in points for x in point for part in x.split("/"))])
    assert rationals
    assert longest > 700
    # Python by default refuses to convert numbers of more than 4300 decimal digits, which n = 250 brings about
    long = Fraction(-(3**20000), 7**9000)
    numerator, denominator = fraction_text(*long.as_integer_ratio()).split("/")
    assert Fraction(int(numerator, 16), int(denominator, 16)) == long


@pytest.mark.slow
def test_leaves_checked_together_are_judged_as_one_by_one():
    p = some(6, of=7)
    problem = gallery.chain(p, 0.05)
    roots = all_roots(problem, 5.0)
    assert len(roots) == 3**p
    report = complete_report(problem, roots.proof)
    assert report.roots == 3**p
