"""Wedges in 3D that jam: all roots, against Newton's method and successive approximations from many starts."""

import numpy as np
import oracles3d
import pytest
from complete import all_roots, complete_report, proven_roots
from effort import some
from generators import named
from problems3d import forces, unmatched

import enumsol

JAMMED, SLIDING, FREE = ("stick",), ("slip",), ("open",)
#: Kinds of roots by entry: statuses that occur in each, from the largest normal forces to the least.
KINDS = {
    "wedge3d-2-3": [JAMMED, SLIDING, FREE],
    "wedge3d-4-3": [JAMMED, SLIDING, FREE],
    "wedge3d-4-9": [JAMMED, *[("slip", "stick")] * 2, *[("open", "stick")] * 2, *[("open", "slip")] * 2, SLIDING, FREE],
    "wedge3d-8-5": [*[("open", "slip", "stick")] * 3, ("open", "slip"), FREE],
}
#: Numbers of the roots that successive approximations reach from starts all over.
REACHED = {"wedge3d-2-3": {0, 2}, "wedge3d-4-3": {0, 2}, "wedge3d-4-9": {0, 8}, "wedge3d-8-5": {4}}


def solve_as_newton_does(problem, alpha, roots, starts, rng):
    """Roots solve the problem, and are all that Newton's method finds; the numbers of those that it does not reach."""
    condensed = problem.condensed
    data = condensed.S, condensed.free_displacements(alpha), problem.friction_at(alpha)
    for root in roots:
        assert oracles3d.violation(*data, forces(root)) < 1e-9
        assert oracles3d.index(*data, forces(root)) == root.index
    missed, unreached = unmatched(roots, oracles3d.newton_set(*data, starts, rng))
    assert not missed
    return unreached


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "wedge3d-8-5" else []) for name in KINDS]
)
def test_all_roots_of_a_wedge_that_jams(name):
    problem, alpha = named(name)
    roots = proven_roots(problem, alpha)
    assert roots.index_sum == 1
    kinds = [tuple(sorted({str(status) for status in root.statuses})) for root in roots]
    assert (kinds[0], kinds[-1], sorted(kinds)) == (KINDS[name][0], FREE, sorted(KINDS[name]))
    assert min(root.margin for root in roots) > 5e-3

    rng = np.random.default_rng(1)
    unreached = solve_as_newton_does(problem, alpha, roots, some(300, of=600), rng)
    assert all(enumsol.is_fixed_point(problem, root) for root in roots)
    assert len(unreached) <= 2

    size = max(np.max(root.lambda_n) for root in roots)
    starts = [0.0, *(size * rng.exponential(size=(12, problem.p)))]
    limits = [enumsol.successive_approximations(problem, alpha, start, max_iterations=100) for start in starts]
    missed, unreached = unmatched(roots, [forces(limit) for limit in limits if limit.converged])
    assert not missed
    # the others are limits of none: those of index -1, and of +1 too
    assert set(range(len(roots))) - set(unreached) == REACHED[name]


def test_a_wedge_pulled_straight_is_its_own_mirror_image():
    roots = enumsol.enumerate_roots(enumsol.gallery.wedge3d(2, 1, 3), 1)
    for root in roots:
        np.testing.assert_allclose(root.lambda_n[:2], root.lambda_n[2:], rtol=1e-9, atol=1e-18)
    out = roots[1]
    # it slides out of the notch on both walls, pressed together: along the first axis
    assert np.all(out.u_t[:, 0] > 0)
    assert np.all(np.abs(out.slip_angle) < 0.05)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("size", "friction", "count"), [((2, 1, 2), 1, 3), ((1, 1, 2), 2, 5)], ids=str)
def test_eight_nodes_on_weak_springs(size, friction, count):
    """The wall hardly resists a motion of all nodes together: S has eigenvalues far apart."""
    problem = enumsol.gallery.wedge3d(*size, friction=friction, multipliers="nodes")
    roots = all_roots(problem, 0)
    assert (len(roots), roots.index_sum) == (count, 1)
    solve_as_newton_does(problem, 0, roots, some(200, of=1000), np.random.default_rng(1))
    assert complete_report(problem, roots.proof).roots == count
