"""The one-node problem in closed form: the paper's Examples 6.1-6.3 and its criterion (j), (jj), (jjj)."""

from fractions import Fraction

import numpy as np
import pytest
from compare import METHODS
from effort import some

import enumsol
from enumsol import ContactProblem, gallery


def closed_form(lame, f, alpha):
    """{status: (lambda_n, lambda_t, index)} of the regular roots, worked out by hand."""
    lam, mu = lame
    a, b = 0.5 * (lam + 3 * mu), 0.5 * (lam + mu)
    fn, ft = f
    roots = {}
    if a * fn + b * ft < 0:
        roots["open"] = (0.0, 0.0, 1)
    if fn > 0 and abs(ft) < alpha * fn:
        roots["stick"] = (fn, ft, 1)
    for name, sign in (("slip+", 1), ("slip-", -1)):
        # u_n = 0: -b u_t + lambda_n = f_n and a u_t + sign alpha lambda_n = f_t
        det = a + sign * alpha * b
        u_t, n = (ft - sign * alpha * fn) / det, (a * fn + b * ft) / det
        if n > 0 and sign * u_t > 0:
            roots[name] = (n, sign * alpha * n, int(np.sign(det)))
    return roots


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
@pytest.mark.parametrize("alpha", [0.5, 2.0, 2.5, 2.666, 2.667, 3.0, 5.0, 100.0])
def test_example_6_1(arithmetic, method, alpha):
    roots = enumsol.enumerate_roots(gallery.one_node_triangle((1.5, -4.0)), alpha, arithmetic, method)
    expected = [("open", 1), ("slip-", -1), ("stick", 1)][: 3 if alpha > 8 / 3 else 1]
    assert [(root.statuses[0].value, root.index) for root in roots] == expected
    assert roots[0].lambda_n[0] == 0.0
    if alpha > 8 / 3:
        np.testing.assert_allclose(roots[1].lambda_n, 1 / (alpha - 2), rtol=1e-12, atol=0)
        np.testing.assert_allclose(roots[2].lambda_n, 1.5, rtol=1e-12, atol=0)
        np.testing.assert_allclose(roots[2].lambda_t, -4.0, rtol=1e-12, atol=0)


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_the_fold_of_example_6_1_is_one_root(method):
    problem = gallery.one_node_triangle((1.5, -4.0))
    _, fold = enumsol.enumerate_roots(problem, Fraction(8, 3), "exact", method)
    assert {s.value for s in fold.active[0]} == {"stick", "slip-"}
    assert (fold.regular, fold.index) == (False, 0)
    np.testing.assert_array_equal(fold.lambda_n, [1.5])
    # one float to either side
    for alpha, count in ((np.nextafter(8 / 3, 0), 1), (np.nextafter(8 / 3, 3), 3)):
        assert len(enumsol.enumerate_roots(problem, alpha, "exact", method)) == count


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(4))
def test_random_data_against_the_closed_form(seed):
    rng = np.random.default_rng(seed)
    counts = set()
    for _ in range(some(25, of=60)):
        lame, f = tuple(rng.uniform(0.1, 3.0, size=2)), (rng.uniform(-0.5, 1.5), rng.normal(scale=3.0))
        alpha = float(np.exp(rng.uniform(np.log(0.05), np.log(50))))
        want = closed_form(lame, f, alpha)
        roots = enumsol.enumerate_roots(gallery.one_node_triangle(f, lame), alpha, "fast")
        assert {root.statuses[0].value: root.index for root in roots} == {k: v[2] for k, v in want.items()}
        for root in roots:
            n, t, _ = want[root.statuses[0].value]
            np.testing.assert_allclose([root.lambda_n[0], root.lambda_t[0]], [n, t], rtol=1e-12, atol=0)
        counts.add(len(roots))
    assert counts == {1, 3}


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", range(3))
def test_criterion_for_the_number_of_branches(seed):
    # (j) one root for every alpha; (jj) one below |f_t| / f_n and three above
    rng = np.random.default_rng(seed)
    seen = {"j": 0, "jj": 0}
    for _ in range(some(20, of=40)):
        lam, mu = rng.uniform(0.1, 3.0, size=2)
        f = np.array([rng.uniform(-0.5, 1.5), rng.normal(scale=3.0)])
        problem = gallery.one_node_triangle(tuple(f), (lam, mu))
        s = (lam + 3 * mu) * f[0] + (lam + mu) * f[1]
        case = "jj" if s < 0 and f[0] > 0 else "j"
        seen[case] += 1
        critical = abs(f[1] / f[0])
        for alpha in (0.3 * critical, 0.99 * critical, 1.01 * critical, 3 * critical):
            count = len(enumsol.enumerate_roots(problem, alpha, "fast"))
            assert count == (3 if case == "jj" and alpha > critical else 1)
    assert min(seen.values()) >= 3


@pytest.mark.parametrize(("lame", "scale"), [((1, 1), 1), ((3, 1), 2), ((1, 3), 1), ((5, 2), 0.25)])
@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_case_jjj_has_a_family_at_the_bifurcation(lame, scale, method):
    lam, mu = lame
    f = (scale * (lam + mu), -scale * (lam + 3 * mu))
    problem = gallery.one_node_triangle(f, lame)
    critical = Fraction(lam + 3 * mu, lam + mu)
    roots = enumsol.enumerate_roots(problem, critical, "exact", method)
    (family,) = roots.families
    assert (len(roots), roots.complete) == (0, True)
    assert (family.dimension, family.index, family.vertices_proven) == (1, 1, True)
    # from grazing to stick at the slip bound
    np.testing.assert_array_equal(family.vertices, [[[0.0, 0.0]], [f]])
    # two branches elsewhere: grazing, and above the bifurcation the sticking root too
    assert len(enumsol.enumerate_roots(problem, critical - Fraction(1, 100), "exact", method)) == 1
    above = enumsol.enumerate_roots(problem, critical + Fraction(1, 100), "exact", method)
    assert sorted(root.index for root in above) == [0, 1]


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_example_6_3(arithmetic, method):
    roots = enumsol.enumerate_roots(gallery.one_node_triangle((1.0, -2.0)), 2.0, arithmetic, method)
    (family,), exact = roots.families, arithmetic == "exact"
    np.testing.assert_allclose(family.vertices, [[[0.0, 0.0]], [[1.0, -2.0]]], atol=0 if exact else 1e-14)
    assert [part.statuses[0].value for part in family.polytopes] == ["slip-"]
    assert (len(roots), roots.index_sum, roots.complete, family.vertices_proven) == (0, 1, exact, exact)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_example_6_3_perturbed_has_no_family(arithmetic, method):
    problem = gallery.one_node_triangle((0.98, -2.0))
    for alpha, count in ((2.0, 1), (2.05, 3)):
        roots = enumsol.enumerate_roots(problem, alpha, arithmetic, method)
        assert (len(roots), roots.families) == (count, ())


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_sheet_of_families_on_a_loading_path(method):
    # theory, section 7.5: F = 2, f = alpha (1, -2): a family at every alpha > 0
    problem = ContactProblem([[2, -1], [-1, 2]], [[1, 0]], [[0, 1]], [0.0, 0.0], friction=2.0, load_slope=[1.0, -2.0])
    for alpha in (Fraction(1, 3), 1, 7.5):
        (family,) = enumsol.enumerate_roots(problem, alpha, "exact", method).families
        np.testing.assert_allclose(family.vertices[1], [[float(alpha), -2 * float(alpha)]], rtol=1e-16)
    (root,) = enumsol.enumerate_roots(problem, 0, "exact", method)
    assert root.index == 1
