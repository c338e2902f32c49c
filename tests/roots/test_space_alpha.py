"""Data that change with alpha, gaps and slip offsets in 3D: against the closed form and Newton's method."""

from fractions import Fraction

import numpy as np
import oracles3d
import pytest
from complete import all_roots, complete_report
from effort import some
from problems3d import bounds, forces, from_compliance, random_coupled, random_one_node, unmatched
from refusals import bad_argument

from enumsol import ContactProblem3D, enumerate_roots, multiplicity_table

ALPHAS = [0.0, 0.75, -0.5, Fraction(8, 3)]


def moving(rng, S, F):
    """A problem with all data that may move or shift, and S, g, F at an alpha worked out by hand."""
    p = len(F)
    f, slope = rng.normal(size=(2, 3 * p))
    gap, offset = 0.3 * rng.normal(size=p), 0.5 * rng.normal(size=(p, 2))
    # not negative on [-1/2, 3], with another ratio of both axes at every alpha
    F_slope = F * rng.uniform(-0.3, 1.5, size=F.shape)
    friction = {"friction": tuple(F.T), "friction_slope": tuple(F_slope.T)}
    problem = from_compliance(S, S @ f, load_slope=slope, gap=gap, slip_offset=offset, **friction).replace(f=f)

    def at(alpha):
        load = f + float(alpha) * slope
        return S, S @ load - np.concatenate([gap, offset[:, 0], offset[:, 1]]), F + float(alpha) * F_slope

    return problem, at


def check(problem, alpha, roots, S, g, F, wanted):
    """Roots are the wanted ones; their displacements fit their forces; the proof is about this alpha."""
    assert unmatched(roots, wanted) == ([], [])
    assert len(roots) == len(wanted)
    assert sorted(root.index for root in roots) == sorted(oracles3d.index(S, g, F, lam) for lam in wanted)
    p = problem.p
    for root in roots:
        lam = forces(root)
        w = np.concatenate([root.u_n, *root.u_t.T])
        np.testing.assert_allclose(w, g - S @ lam, atol=1e-9 * (1 + np.max(np.abs(g))))
        displaced = np.concatenate([root.u[:p] - problem.gap, root.u[p:] - problem.slip_offset.ravel(order="F")])
        np.testing.assert_allclose(displaced, w, atol=1e-9 * (1 + np.max(np.abs(g))))
        low, high = bounds(root)
        assert np.all(low <= high)
        for i, (first, last) in enumerate(root.slip_angle):
            if np.isfinite(first):
                v = F[i] * root.u_t[i]
                off = np.remainder(np.arctan2(v[1], v[0]) - 0.5 * (first + last) + np.pi, 2 * np.pi) - np.pi
                assert abs(off) < 1e-6
    assert complete_report(problem, roots.proof).roots == len(wanted)


@pytest.mark.slow
def test_one_node_against_the_closed_form():
    rng = np.random.default_rng(0)
    counts, kinds = set(), set()
    for _ in range(some(8, of=20)):
        S, _, F = random_one_node(rng)
        problem, at = moving(rng, S, F)
        for alpha in ALPHAS:
            found, near = oracles3d.one_node(*at(alpha))
            if near < 1e-6:
                continue
            wanted = [lam for group in found.values() for lam in group]
            roots = all_roots(problem, alpha)
            assert roots.alpha == alpha
            check(problem, alpha, roots, *at(alpha), wanted)
            counts.add(len(wanted))
            kinds |= {name for name, group in found.items() if group}
    assert (counts, kinds) == ({1, 3}, {"open", "stick", "slip"})


@pytest.mark.slow
def test_two_nodes_against_newtons_method():
    rng = np.random.default_rng(8)
    counts = []
    for _ in range(some(5, of=12)):
        S, _, F = random_coupled(rng, 2)
        problem, at = moving(rng, S, F)
        for alpha in ALPHAS[1:3]:
            roots = all_roots(problem, alpha)
            assert roots.index_sum == 1
            wanted = oracles3d.newton_set(*at(alpha), 100, rng)
            assert unmatched(roots, wanted)[0] == []
            for root in roots:
                assert oracles3d.violation(*at(alpha), forces(root)) < 1e-9
            counts.append(len(roots))
    assert max(counts) >= 3


def test_a_table_over_alpha():
    rng = np.random.default_rng(3)
    S, _, F = random_one_node(rng)
    problem, at = moving(rng, S, F)
    alphas = np.linspace(-0.5, 3, 15)
    table = multiplicity_table(problem, alphas)
    for alpha, (_, row) in zip(alphas, table.iterrows(), strict=True):
        found, near = oracles3d.one_node(*at(alpha))
        assert near > 1e-6
        assert row["roots"] == sum(len(group) for group in found.values())
        assert (row["with_open"], row["with_stick"], row["with_slip"]) == tuple(len(found[k]) for k in found)


def test_friction_that_becomes_negative_is_refused():
    problem = ContactProblem3D(np.eye(3), *np.eye(3)[:, None], [1, 1, 1], friction=1.0, friction_slope=-0.5)
    assert enumerate_roots(problem, 2).complete  # F = 0
    bad_argument(r"friction F1 at alpha = 2\.5 is -0\.25", enumerate_roots, problem, Fraction(5, 2))
