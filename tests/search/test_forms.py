"""Searches that bound with forms of their own in place of the energy: the same roots, proofs that hold, no forgery."""

from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numpy as np
import pytest
from complete import accepted_report, all_roots, proven_roots
from effort import some
from exact_balls import holds
from flint import fmpq, fmpq_mat
from generators import fe_compliance, from_condensed, integer_problem, named, random_problem
from graph_proofs import refused
from proof_tools import by_forms, copied, of_kind, proof_of, put, records_of
from rational_checker import check_records
from rational_forms import Data, Forms, _value, exact

from enumsol import enumerate_roots, gallery, verify
from enumsol.condensation.enclosure import CondensedEnclosure, EnclosedSystem
from enumsol.search import nodes as policy
from enumsol.search.solvers import Solvers
from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.quadratic_forms import EnclosedForm, equations_of
from enumsol.trusted.status_rows import row_signs

pytestmark = pytest.mark.usefixtures("tree_only")


@pytest.fixture
def eager(monkeypatch):
    """A form from the first node on, whether it pays or not."""
    monkeypatch.setattr(policy, "FORM_AFTER", 0)
    monkeypatch.setattr(policy, "MORE", -2.0)


def slipping(seed, p=3):
    """A body most of whose nodes slip."""
    rng = np.random.default_rng(seed)
    S, F = fe_compliance(rng, p), rng.uniform(0.1, 0.6, size=p)
    load = np.concatenate([rng.uniform(0.2, 1.0, size=p), rng.normal(size=p)])
    return from_condensed(S, S @ load, F)


@pytest.mark.slow
def test_the_roots_are_the_same(eager, monkeypatch):
    used, count = 0, some(12, of=60)
    for seed in range(count):
        rng = np.random.default_rng(seed)
        make = (random_problem, integer_problem, lambda _, p, seed=seed: slipping(seed, p))[seed % 3]
        problem = make(rng, int(rng.integers(2, 5)))
        found = enumerate_roots(problem, 1.0)
        used += len(by_forms(records_of(found.proof)))
        with monkeypatch.context() as patch:
            patch.setattr(policy, "FORM_AFTER", 10**9)
            plain = enumerate_roots(problem, 1.0)
        assert [root.statuses for root in found] == [root.statuses for root in plain], seed
        assert found.complete == plain.complete
        assert verify(problem, found.proof).ok
        assert check_records(problem, records_of(found.proof))["roots"] == len(found)
        assert len(enumerate_roots(problem, 1.0, arithmetic="fast")) == len(plain), seed
    assert used > count


def test_a_long_search_is_shorter_with_forms(monkeypatch):
    problem = gallery.clamped_block(32, 16)
    plain = enumerate_roots(problem, 0.3)
    monkeypatch.setattr(policy, "FORM_AFTER", 100)
    found = proven_roots(problem, 0.3)
    assert len(by_forms(records_of(found.proof))) > 20
    assert found.stats.nodes < 0.7 * plain.stats.nodes
    assert [root.statuses for root in found] == [root.statuses for root in plain]


def test_a_good_form_leaves_little_more_than_one_path(monkeypatch):
    # open or in contact, then stick or slip: five nodes of the tree a contact node, if every one is branched on once
    monkeypatch.setattr(policy, "FORM_AFTER", 0)
    assert all_roots(gallery.clamped_block(32, 16), 0.3).stats.nodes <= 6 * 32


def test_wedges_go_on_with_the_energy(monkeypatch):
    plain = enumerate_roots(*named("wedge-8-5"))
    monkeypatch.setattr(policy, "FORM_AFTER", 100)
    found = enumerate_roots(*named("wedge-8-5"))
    assert records_of(found.proof) == records_of(plain.proof)


@pytest.mark.few(10, 0)
@pytest.mark.parametrize("seed", range(30))
def test_forms_are_at_most_zero_at_every_solution(seed):
    rng = np.random.default_rng(seed)
    problem = (integer_problem if seed % 2 else random_problem)(rng, int(rng.integers(1, 4)))
    data, p = Data(problem), problem.p
    forms = Forms(data.S, data.load(fmpq(1)), data.friction(fmpq(1)))
    multipliers = rng.normal(size=(4, p)) * 10.0 ** rng.uniform(-3, 3, size=(4, p))
    multipliers[2:] = np.abs(multipliers[2:])
    H, h = forms.own_form([[exact(x) for x in row] for row in multipliers.tolist()])
    selections = product(*((0, 1, 2, 3) if F > 0 else (0, 4) for F in forms.F))
    points = [point for codes in selections for point in forms.hull(codes)]
    assert points
    for at in ([fmpq(x.numerator, x.denominator) for x in point] for point in points):
        turned = H * fmpq_mat([[x] for x in at])
        assert _value([*turned.entries(), 0], at) <= _value([*h, 0], at)


@pytest.mark.few(12, 0)
@pytest.mark.parametrize("seed", range(40))
def test_enclosed_forms_hold_the_exact_ones(seed):
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, 4))
    problem = random_problem(rng, p) if seed % 2 else gallery.clamped_block(p, 2)
    alpha = float(rng.uniform(0.1, 2.0))
    scaled = problem.condensed.at(alpha).scaled
    system = CondensedEnclosure.from_problem(problem).at(alpha, scaled.force, scaled.length)
    data = Data(problem)
    pair = [[_exact(force / length) for length in scaled.length] for force in scaled.force]
    S = [[x * pair[j][i] for j, x in enumerate(row)] for i, row in enumerate(data.S.tolist())]
    g = [x / _exact(unit) for x, unit in zip(data.load(exact(alpha)), scaled.length, strict=True)]
    forms = Forms(type(data.S)(S), g, data.friction(exact(alpha)))
    codes = tuple(int(c) for c in rng.choice((0, 1, 2, 3, 5, 6), size=p))
    multipliers = rng.normal(size=(4, p))
    multipliers[2:] = np.abs(multipliers[2:])
    form = EnclosedForm.of(system, codes, multipliers, 0.0)
    H, h = forms.own_form([[exact(x) for x in row] for row in multipliers.tolist()])
    assert holds(form.H, form.H_rad, H.tolist())
    assert holds(form.h, form.h_rad, h)
    # with equations: the same wherever they hold, more elsewhere
    weight = float(rng.uniform(0.1, 10.0))
    heavy = EnclosedForm.of(system, codes, multipliers, weight)
    a, b = equations_of(system, codes)
    factor = weight / np.maximum(np.einsum("ij,ij->i", a.mid, a.mid), 1e-300)
    kinds = {0: (0, 1), 1: (4, 5), 2: (4, 2), 3: (4, 3), 5: (4,), 6: ()}
    given = [forms.row(kind, i) for i, code in enumerate(codes) for kind in kinds[code]]
    assert len(given) == len(b.mid)
    order = _matching(given, a.mid, b.mid)

    def weighted(i, j):
        return sum((_exact(factor[k]) * given[m][i] * given[m][j] for m, k in order), fmpq(0))

    square = [[x + weighted(i, j) for j, x in enumerate(row)] for i, row in enumerate(H.tolist())]
    assert holds(heavy.H, heavy.H_rad, square)
    assert holds(heavy.h, heavy.h_rad, [x - 2 * weighted(i, -1) for i, x in enumerate(h)])
    assert holds(heavy.k, heavy.k_rad, [weighted(-1, -1)])


def _exact(value):
    return fmpq(*float(value).as_integer_ratio())


def _matching(given, rows, loads):
    """Which exact equation each of the enclosed ones is, up to sign."""
    found = []
    for k, (a, b) in enumerate(zip(rows, loads, strict=True)):
        ours = np.append(a, -b)
        for m, form in enumerate(given):
            theirs = np.array([float(int(x.p)) / float(int(x.q)) for x in form])
            if any(np.allclose(ours, sign * theirs, rtol=1e-9, atol=1e-9 * np.max(np.abs(ours))) for sign in (-1, 1)):
                found.append((m, k))
                break
    assert sorted(m for m, _ in found) == list(range(len(given)))
    return found


# -- forgeries ---------------------------------------------------------------------------------------------------------


def proven(seed):
    problem = slipping(seed)
    return problem, records_of(enumerate_roots(problem, 1.0).proof)


def agrees(problem, records):
    """Accepted by the checker only if it proves what it says, in rationals."""
    accepted = verify(problem, proof_of(records)).ok
    if accepted:
        check_records(problem, records)
    return accepted


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(8))
def test_changed_forms_prove_nothing_false(eager, seed):
    problem, records = proven(seed)
    assert agrees(problem, records)
    rng = np.random.default_rng(seed)
    places = of_kind(records, "q")
    assert places
    for _ in range(60):
        changed = copied(records)
        k = int(rng.choice(places))
        number, node = int(rng.integers(4 * problem.p)), int(rng.integers(problem.p))
        how = int(rng.integers(6))
        if how == 0:
            changed[k][2][number] *= float(rng.choice((-1.0, 0.0, 0.5, 2.0, 1e3)))
        elif how == 1:
            changed[k][2][number] += float(rng.normal())
        elif how == 2:
            changed[k][3][0] *= float(rng.choice((0.0, 1e-3, 1e3, -1.0)))
        elif how == 3:
            changed[k][1][node] = int(rng.integers(7))
        elif how == 4:
            del changed[k]
        else:
            changed.insert(int(rng.integers(1, len(changed) - 1)), copied(changed[k]))
        agrees(problem, changed)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(4))
def test_leaves_refer_to_forms_that_serve_them(eager, seed):
    problem, records = proven(seed)
    for k in by_forms(records):
        for back in (0, -1, 10**6, 1.0, "1", None):
            assert not agrees(problem, put(records, (k, 3), back))
        agrees(problem, put(records, (k, 3), records[k][3] + 1))
        assert not agrees(problem, put(records, (k,), lambda record: record[:2] + record[3:]))
    for k in of_kind(records, "q"):
        spoilt = (
            (1, "66"),
            (1, [6, 6]),
            (1, [7] * problem.p),
            (2, [1.0]),
            (2, None),
            (2, [-1.0] * 4 * problem.p),
            (3, "1"),
            (3, [-1.0]),
        )
        for part, value in spoilt:
            assert refused(problem, put(records, (k, part), value))


def test_forms_are_no_records_in_space():
    problem = gallery.one_node_3d()
    records = records_of(enumerate_roots(problem, 0).proof)
    form = ["q", [6], [1.0, 0.0, 0.5, 0.5], [0.0]]
    assert verify(problem, proof_of(records)).ok
    assert not verify(problem, proof_of([records[0], form, *records[1:]])).ok


def test_an_indefinite_form_excludes_nothing():
    problem = slipping(1)
    enclosed = Solvers(problem, 1.0, "verified", 1e-9).enclosed
    form = EnclosedForm.of(enclosed, (6, 6, 6), np.ones(3) * [[-1], [0], [1], [1]], 0.0)
    assert exclusion_margin(form, (6, 6, 6), np.array([0]), np.array([1e6])) == -np.inf


@pytest.mark.few(4, 0)
@pytest.mark.parametrize("seed", range(12))
def test_compiled_bounds_are_below_the_exact_one_and_that_of_the_checker(seed):
    margins = pytest.importorskip("enumsol.search.certifiers._margin").FormMargins
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, 4))
    scaled = slipping(seed, p).condensed.at(1.0).scaled
    system = EnclosedSystem.as_computed(scaled.S, scaled.g, scaled.F)
    S, g = fmpq_mat([[_exact(x) for x in row] for row in system.S]), [_exact(x) for x in system.g]
    codes = tuple(int(c) for c in rng.choice((0, 1, 2, 3, 5, 6), size=p))
    signs = row_signs(np.array(codes), system.F)
    energy = np.array([[1.0], [0.0], [0.5], [0.5]])
    compared = 0
    for _ in range(20):
        multipliers = energy * rng.uniform(0.8, 1.2, size=(4, p))
        form = EnclosedForm.of(system, codes, multipliers, 0.0)
        if not form.smallest_eigenvalue > 0:
            continue
        H, h = _exact_form(S, g, system.F, multipliers)
        once, often = margins(form, 1.0), margins(form, 4.0)
        rows = np.array([r for r in range(7 * p) if signs[r % p, r // p] and rng.random() < 0.7], dtype=np.intp)
        values = 10.0 ** rng.uniform(-3, 1) * np.abs(rng.normal(size=len(rows)))
        v, constant = h, fmpq(0)
        for row, value in zip(rows.tolist(), values, strict=True):
            normal, offset = _row(*divmod(row, p), S, g, system.F)
            v = [a + _exact(value) * b for a, b in zip(v, normal, strict=True)]
            constant += _exact(value) * offset
        column = fmpq_mat([[x] for x in v])
        bound = constant - (column.transpose() * H.solve(column))[0, 0] / 4
        least, kernel = once.margin(codes, rows, values), exclusion_margin(form, codes, rows, values)
        assert often.margin(codes, rows, values) <= kernel
        assert max(_exact(least), _exact(kernel)) <= bound
        assert float(int(bound.p) / int(bound.q)) - least < 1e-9 * (1 + np.sum(values**2))
        compared += 1
    assert compared


def _exact_form(S, g, F, multipliers):
    """H and h of the form for S, g and F as they are, in rationals."""
    p = len(F)
    D = fmpq_mat(2 * p, 2 * p)
    for i in range(p):
        mu, nu, alpha, beta = (_exact(x) for x in multipliers[:, i])
        D[i, i], D[i, p + i] = mu, nu
        D[p + i, i], D[p + i, p + i] = _exact(F[i]) * (beta - alpha), alpha + beta
    H = D.transpose() * S
    h = D.transpose() * fmpq_mat([[x] for x in g])
    return (H + H.transpose()) / 2, [h[i, 0] for i in range(2 * p)]


def _row(kind, i, S, g, F):
    """n and b of the row n'lambda - b."""
    p = len(F)
    normal, place = [fmpq(0)] * (2 * p), i if kind == 4 else p + i
    if kind >= 4:
        sign = -1 if kind == 5 else 1
        return [sign * S[place, j] for j in range(2 * p)], sign * g[place]
    normal[i] = {0: fmpq(1), 1: fmpq(0)}.get(kind, _exact(F[i]))
    normal[p + i] = fmpq({0: 0, 1: 1, 2: -1, 3: 1}[kind])
    return normal, fmpq(0)


# -- limits, workers, robustness ---------------------------------------------------------------------------------------


def test_a_search_that_is_stopped_after_it_began_again_claims_what_it_has(monkeypatch):
    problem = gallery.clamped_block(32, 16)
    monkeypatch.setattr(policy, "FORM_AFTER", 100)
    cut = enumerate_roots(problem, 0.3, max_nodes=100)
    assert (cut.complete, accepted_report(problem, cut.proof).complete) == (False, False)


def test_workers_make_the_same_proof(monkeypatch):
    problem = gallery.clamped_block(32, 16)
    monkeypatch.setattr(policy, "FORM_AFTER", 100)
    monkeypatch.setattr(policy, "MORE", -2.0)
    with ThreadPoolExecutor(1) as alone, ThreadPoolExecutor(2) as two:
        one, other = (enumerate_roots(problem, 0.3, executor=executor) for executor in (alone, two))
    assert records_of(one.proof) == records_of(other.proof)
    assert by_forms(records_of(one.proof))
    assert verify(problem, one.proof).complete
