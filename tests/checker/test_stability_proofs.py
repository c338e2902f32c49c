"""Proofs of which roots run away: honest ones are verified, and none that was changed states what is not so."""

import copy
import functools
import json

import numpy as np
import pytest
from generators import integer_problem, singular_problem
from helpers.command_line import run
from helpers.floating_space import known_body, plane_over_alpha
from proof_tools import bytes_of, proof_of, records_of
from rational_checker import records_of as read_records
from rational_forms import Refused
from stability_judge import judge_stability

import enumsol
from enumsol import ContactProblem, InvalidArgumentError, InvalidProblemError, gallery, verify
from enumsol.checker import stability_checker
from enumsol.search import stability as search
from enumsol.trusted.running_away import NoMotion, covers


def gallery_problem(name, alpha):
    return gallery.get(name).build(), alpha, None


def strongly_coupled(seed, p=3):
    """Nodes that slide or stick, all coupled, with friction so large that plain numbers often do not serve."""
    rng = np.random.default_rng(seed)
    n = 2 * p
    X = rng.normal(size=(n, n))
    A = X @ X.T + 0.2 * np.eye(n)
    F = rng.choice([0.5, 1.0, 2.0], size=p)
    slides, s = rng.random(p) < 0.8, rng.choice([-1.0, 1.0], size=p)
    lam = np.concatenate([np.ones(p), np.where(slides, s, 0.4 * s) * F])
    w = np.concatenate([np.zeros(p), np.where(slides, s * rng.uniform(0.2, 1, p), 0.0)])
    rows = np.eye(n)
    return ContactProblem(A, rows[:p], rows[p:], A @ w + lam, friction=F), 0.0, np.diag(rng.uniform(0.5, 2, n))


def in_space(seed):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(7, 7))
    A, F, angle = X @ X.T + 0.1 * np.eye(7), np.array([[3.0, 1.5], [1.5, 3.0]]), rng.uniform(-3, 3, 2)
    d = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lam = np.concatenate([np.ones(2), *(F * d).T])
    w = np.concatenate([np.zeros(2), *(0.5 * d / F).T])
    rows = np.eye(7)
    f = A @ np.append(w, 0.3) + rows[:6].T @ lam
    friction = F[:, 0], F[:, 1]
    return enumsol.ContactProblem3D(A, rows[:2], rows[2:4], rows[4:6], f, friction=friction), 0.0, np.eye(7)


def floating(seed):
    problem = known_body(seed).problem
    return problem, 1.0, np.eye(problem.n)


def floating_in_the_plane(seed):
    problem = plane_over_alpha(seed)
    return problem, 0.0, np.eye(problem.n)


def with_unit_mass(name, alpha):
    problem = gallery.get(name).build()
    return problem, alpha, np.eye(problem.n)


def partly_massless(seed, without):
    """Contact nodes of which some have mass and others do not, or have it along their tangents only."""
    problem, alpha, mass = strongly_coupled(seed)
    mass[np.ix_(without, without)] = 0.0
    return problem, alpha, mass


PROBLEMS = {
    "taper-8": lambda: gallery_problem("taper-8", 0.2),
    "wedge-8-5": lambda: gallery_problem("wedge-8-5", 3.0),
    "one-node-6.1": lambda: with_unit_mass("one-node-6.1", 5.0),
    "two bodies": lambda: (gallery.chain(2), 5.0, np.eye(gallery.chain(2).n)),
    **{f"floating {seed}": functools.partial(floating_in_the_plane, seed) for seed in (1, 3, 5)},
    **{f"coupled {seed}": functools.partial(strongly_coupled, seed) for seed in range(4)},
    "a node without mass": functools.partial(partly_massless, 1, [0, 3]),
    "mass along a tangent": functools.partial(partly_massless, 2, [0, 1, 2]),
    "no node with mass along its normal, one without any": functools.partial(partly_massless, 3, [0, 1, 2, 4]),
    **{f"in space {seed}": functools.partial(in_space, seed) for seed in (0, 2)},
    "floating in space": functools.partial(floating, 105),
}


@functools.cache
def known(name):
    """A problem, its mass, its roots, and the records of the proof."""
    problem, alpha, mass = PROBLEMS[name]()
    roots = enumsol.enumerate_roots(problem, alpha)
    return problem, mass, roots, records_of(roots.stability_proof(mass=mass))


def checked(name, records):
    problem, mass, *_ = known(name)
    return verify(problem, proof_of(copy.deepcopy(records)), mass=mass)


def judged(name, records):
    """Verdicts by the judge that shares no code with enumsol, or None where it refuses the file."""
    problem, mass, *_ = known(name)
    try:
        return judge_stability(problem, problem.inertia.toarray() if mass is None else mass, filed(records))
    except Refused:
        return None


def filed(records):
    """Records as they are in a file."""
    return read_records(bytes_of(proof_of(records)))


def certificates(records):
    """Places of the records after the proof of the roots."""
    end = next(k for k, record in enumerate(records) if k and isinstance(record, dict) and "leaves" in record)
    return range(end + 1, len(records) - 1)


@pytest.mark.parametrize("name", PROBLEMS)
def test_honest_proofs(name):
    _, _, roots, records = known(name)
    report = checked(name, records)
    assert report.ok, report.failures
    assert report.verdicts == tuple(found.verdict for found in roots.verdicts)
    for found, bounds in zip(roots.verdicts, report.bounds, strict=True):
        assert (bounds is None) == (found.verdict != "runs away")
        assert bounds is None or bounds[0] <= found.growth_rates[0] <= bounds[1]
    assert report.complete == (roots.complete and "undecided" not in report.verdicts)
    assert repr(report).startswith("proof: verified for the stability of")


@pytest.mark.parametrize(
    "name", [*(name for name in PROBLEMS if "-8" not in name), pytest.param("taper-8", marks=pytest.mark.slow)]
)
def test_honest_proofs_by_the_judge(name):
    verdicts = judged(name, known(name)[3])
    assert verdicts == [found.verdict for found in known(name)[2].verdicts]


def test_a_proof_takes_what_verdicts_found(monkeypatch):
    roots = enumsol.enumerate_roots(gallery.get("taper-8").build(), 0.2)
    found = roots.stability()
    monkeypatch.setattr(search.StabilitySearch, "run", None)
    assert verify(roots[0].problem, roots.stability_proof()).verdicts == tuple(own.verdict for own in found)


def test_what_is_verified_is_not_little():
    """Of these problems some roots run away, some do not, and some need more than plain numbers."""
    verdicts = [verdict for name in PROBLEMS for verdict in checked(name, known(name)[3]).verdicts]
    assert min(map(verdicts.count, ("runs away", "does not run away"))) >= 6
    assert verdicts.count("undecided") <= 2


@pytest.mark.parametrize("seed", [32, 35, 58])
def test_degenerate_roots_stay_undecided(seed):
    problem = integer_problem(np.random.default_rng(seed), 2)
    roots = enumsol.enumerate_roots(problem, 0.0)
    mass = np.eye(problem.n)
    found, report = roots.stability(mass=mass), verify(problem, roots.stability_proof(mass=mass), mass=mass)
    assert report.ok, report.failures
    assert {own.verdict for own in found} == {"does not run away"}
    assert set(report.verdicts) == {"undecided"}
    assert not report.complete
    # and whatever is said of them, without any certificate
    records = records_of(roots.stability_proof(mass=mass))
    for verdict in ("runs away", "does not run away"):
        forged = [
            [*record[:2], verdict] if isinstance(record, list) and record[0] == "v" else record
            for record in records[:-1]
        ]
        counts = {"runs away": 0, "does not run away": 0, "undecided": 0, verdict: len(roots)}
        said = verify(problem, proof_of([*forged, {"roots": len(roots), **counts}]), mass=mass)
        assert said.ok
        assert set(said.verdicts) == {"undecided"}
    assert set(judge_stability(problem, mass, filed(records))) == {"undecided"}


@pytest.mark.parametrize("seed", [12, 59])
def test_a_root_beside_a_family(seed):
    problem = singular_problem(np.random.default_rng(seed), 3)
    roots, mass = enumsol.enumerate_roots(problem, 0.0), np.eye(problem.n)
    report = verify(problem, roots.stability_proof(mass=mass), mass=mass)
    assert report.ok, report.failures
    assert report.verdicts == ("does not run away",)
    assert judge_stability(problem, mass, filed(records_of(roots.stability_proof(mass=mass)))) == list(report.verdicts)
    assert not report.complete
    assert "1 family left out" in repr(report)


# -- forgeries ---------------------------------------------------------------------------------------------------------


def changed(rng, value):
    """A number, text or list of a record, changed."""
    if isinstance(value, bool) or value is None:
        return [0.5, 1e300, "x", []][rng.integers(4)]
    if isinstance(value, str):
        return ["runs away", "does not run away", "undecided", "n", "g", "v", ""][rng.integers(7)]
    if isinstance(value, (int, float)):
        choices = [-value, value + 1, value * float(np.exp(rng.normal())), 0, 1e300, None, value * (1 + 1e-9), "1"]
        return choices[rng.integers(len(choices))]
    if isinstance(value, list) and value and rng.random() < 0.8:
        at = int(rng.integers(len(value)))
        return [*value[:at], changed(rng, value[at]), *value[at + 1 :]]
    return [[], [0], [*value, *value], value[:-1]][rng.integers(4)] if isinstance(value, list) else value


def mutant(rng, records):
    """The records with one of the certificates changed, left out, doubled, or put elsewhere."""
    records = copy.deepcopy(records)
    places = certificates(records)
    k, m = (int(places[rng.integers(len(places))]) for _ in range(2))
    way = rng.random()
    if way < 0.7:
        at = int(rng.integers(len(records[k])))
        records[k][at] = changed(rng, records[k][at])
    elif way < 0.8:
        del records[k]
    elif way < 0.9:
        records[k], records[m] = records[m], records[k]
    else:
        records.insert(m, records[k])
    if rng.random() < 0.7:
        said = [
            records[k][2] for k in certificates(records) if records[k] and records[k][0] == "v" and len(records[k]) > 2
        ]
        counts = {verdict: said.count(verdict) for verdict in ("runs away", "does not run away", "undecided")}
        records[-1] = {"roots": len(said), **counts}
    return records


def states_nothing_false(name, count, seed):
    """Mutants of one proof; how many of them were refused, and how many of these by the judge, too."""
    rng = np.random.default_rng(seed)
    _, _, roots, records = known(name)
    forces = np.array([np.concatenate([root.lambda_n, np.asarray(root.lambda_t).T.ravel()]) for root in roots])
    refused = also = 0
    for _ in range(count):
        forged = mutant(rng, records)
        report = checked(name, forged)
        by_judge = judged(name, forged)
        refused += not report.ok
        if not report.ok:
            also += by_judge is None
            assert not report.verdicts
            assert "REFUSED" in repr(report)
            continue
        points = [np.array(forged[k][1]) for k in certificates(forged) if forged[k][0] == "v"]
        assert len(points) == len(report.verdicts) == len(roots)
        for point, verdict in zip(points, report.verdicts, strict=True):
            truth = roots.verdicts[int(np.argmin(np.max(np.abs(forces - point), axis=1)))].verdict
            assert verdict in (truth, "undecided")
        assert by_judge is not None
        for verdict, other in zip(report.verdicts, by_judge, strict=True):
            assert verdict in (other, "undecided")
    return refused, also


MUTATED = ["one-node-6.1", "coupled 1", "coupled 3", "in space 0", "floating 5"]


@pytest.mark.parametrize("name", MUTATED)
def test_forty_mutants(name):
    refused, also = states_nothing_false(name, 8, 1)
    assert refused >= 4
    assert also >= 0.7 * refused


@pytest.mark.long
@pytest.mark.parametrize("name", MUTATED)
def test_two_thousand_mutants(name):
    refused, also = states_nothing_false(name, 400, 2)
    assert refused >= 200
    assert also >= 0.7 * refused


def of_root(records, number):
    """Places of the records about one root, its own first."""
    places = certificates(records)
    first = [k for k in places if records[k][0] == "v"]
    return range(first[number], [*first, places[-1] + 1][number + 1])


def number_of(name, verdict):
    return known(name)[2].verdicts.index(next(v for v in known(name)[2].verdicts if v.verdict == verdict))


def refusal(name, records):
    report = checked(name, records)
    assert not report.ok
    assert not report.complete
    return "; ".join(report.failures)


def test_swapped_verdicts():
    records = copy.deepcopy(known("taper-8")[3])
    for k in certificates(records):
        if records[k][0] == "v":
            records[k][2] = "runs away" if records[k][2] == "does not run away" else "does not run away"
    counts = records[-1]
    counts["runs away"], counts["does not run away"] = counts["does not run away"], counts["runs away"]
    assert "run away without one motion" in refusal("taper-8", records)


@pytest.mark.parametrize("name", ["taper-8", "wedge-8-5"])
def test_certificates_of_another_root(name):
    """The point of a root with the verdict and certificates of another one."""
    records = copy.deepcopy(known(name)[3])
    away, not_away = (of_root(records, number_of(name, v)) for v in ("runs away", "does not run away"))
    first, other = records[away[0]], records[not_away[0]]
    first[1], other[1] = other[1], first[1]
    assert "root" in refusal(name, records)


def test_ranges_with_gaps_and_without_an_end():
    name = "taper-8"
    records = known(name)[3]
    of_roots = (of_root(records, number) for number in range(3))
    places = next(own for own in ([k for k in of if records[k][0] == "n"] for of in of_roots) if len(own) > 1)
    for k in places:
        assert "are not excluded" in refusal(name, [*records[:k], *records[k + 1 :]])
    last = next(k for k in places if records[k][3] is None)
    for end in (1e9, 0.0, records[last][2]):
        ended = copy.deepcopy(records)
        ended[last][3] = end
        assert "exclude" in refusal(name, ended)
    first = next(k for k in places if records[k][2] == 0.0)
    late = copy.deepcopy(records)
    late[first][2] = 1e-12
    assert "exclude" in refusal(name, late)
    without = [record for k, record in enumerate(records) if k not in places]
    assert "are not excluded" in refusal(name, without)


def test_another_mass_and_another_problem():
    problem, mass, roots, records = known("one-node-6.1")
    proof = proof_of(records)
    assert "another mass" in verify(problem, proof, mass=2 * mass).failures[0]
    assert not verify(problem, proof).ok
    other = problem.replace(f=np.asarray(problem.f) + 1)
    assert "another problem" in verify(other, proof, mass=mass).failures[0]
    # a fingerprint that was changed with it proves nothing
    forged = [records[0] | {"problem": other.fingerprint}, *records[1:]]
    assert "roots: " in verify(other, proof_of(forged), mass=mass).failures[0]
    with pytest.raises(InvalidProblemError, match="mass"):
        verify(problem, proof, mass=-mass)
    with pytest.raises(InvalidArgumentError, match="nothing of stability"):
        verify(problem, roots.proof, mass=mass)


def test_too_many_or_too_few_roots_and_footers():
    name = "one-node-6.1"
    records = known(name)[3]
    own = of_root(records, 0)
    twice = [*records[: own[-1] + 1], *records[own[0] : own[-1] + 1], *records[own[-1] + 1 :]]
    assert "more is said" in refusal(name, twice)
    assert "counts" in refusal(name, [*records[: own[0]], *records[own[-1] + 1 :]])
    less = [*records[: own[0]], *records[own[-1] + 1 :]]
    counts = [less[k][2] for k in certificates(less) if less[k][0] == "v"]
    less[-1] = {"roots": 2, **{v: counts.count(v) for v in ("runs away", "does not run away", "undecided")}}
    assert "something is said of 2" in refusal(name, less)
    assert "missing" in refusal(name, records[:-1])
    between = copy.deepcopy(records)
    for forces in (
        [1e300, 1e300],
        [float(x) for x in np.mean([records[of_root(records, k)[0]][1] for k in (0, 1)], axis=0)],
    ):
        between[own[0]][1] = forces
        assert "do not tell" in refusal(name, between)
    between[own[0]][1] = records[of_root(records, 1)[0]][1]
    assert "about the same root" in refusal(name, between)
    assert "follow" in refusal(name, [*records, records[-1]])
    assert "header" in refusal(name, [records[0] | {"more": 1}, *records[1:]])


def test_a_file_of_too_many_certificates(monkeypatch):
    records = known("coupled 3")[3]
    monkeypatch.setattr(stability_checker, "_MOST_CERTIFICATES", 1)
    assert "more than 1 certificates" in refusal("coupled 3", records)


def test_a_file_that_asks_for_too_many_ways():
    """All ways of five nodes, one by one; where they are too many, nothing is concluded from them."""
    zero = np.zeros((5, 5))
    ways = [[k for k in range(5) if number >> k & 1] for number in range(32)]
    decided = [(tuple(own), tuple(k for k in range(5) if k not in own)) for own in ways]
    leaves = [NoMotion(0.0, 1.0, None, *own, zero, (zero, zero)) for own in decided]
    assert covers(leaves)
    assert not covers(leaves[:-1])
    assert not covers(leaves, most=62)
    assert covers(leaves, most=63)


# -- who writes them ---------------------------------------------------------------------------------------------------


def test_roots_without_a_proof(monkeypatch, tmp_path):
    problem, mass, roots, _ = known("one-node-6.1")
    fast = enumsol.enumerate_roots(problem, 5.0, arithmetic="fast")
    with pytest.raises(InvalidArgumentError, match="fast arithmetic"):
        fast.stability_proof(mass=mass)
    place = tmp_path / "stability.proof"
    proof = roots.stability_proof(place, mass=mass)
    assert verify(problem, enumsol.Proof.load(place), mass=mass).complete
    assert proof.content() == place.read_bytes()
    monkeypatch.setattr(search.StabilitySearch, "run", lambda self: search.Proven((), (), ((0.0, np.inf),)))
    unknown = verify(problem, roots.stability_proof(mass=mass), mass=mass)
    assert unknown.ok
    assert not unknown.complete
    assert set(unknown.verdicts) == {"undecided", "does not run away"} or set(unknown.verdicts) == {"undecided"}


def test_command_line(capsys, tmp_path):
    """The proof of the roots and of their verdicts takes the place of that of the roots alone."""
    problem, place = tmp_path / "taper.npz", tmp_path / "taper.proof"
    enumsol.write_problem(known("taper-8")[0], problem)
    status, out, _ = run(capsys, "roots", problem, "--alpha", "0.2", "--stability", "--proof", place, "--quiet")
    assert status == 0, out
    status, out, _ = run(capsys, "verify", problem, place)
    assert status == 0
    assert "root 1: runs away" in out
    status, _, err = run(
        capsys, "roots", problem, "--alpha", "0.2", "--stability", "--proof", place, "--resume", "--quiet"
    )
    assert status == 2
    assert "is a proof of another kind, 'stability'" in err
    other = tmp_path / "other.npz"
    enumsol.write_problem(known("one-node-6.1")[0], other)
    status, out, _ = run(capsys, "verify", other, place)
    assert status == 2
    assert "another problem" in out
    status, out, _ = run(capsys, "verify", problem, place, "--json", "-")
    assert json.loads(out)["verdicts"] == ["does not run away", "runs away", "does not run away"]
