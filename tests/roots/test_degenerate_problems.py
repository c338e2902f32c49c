"""Integer data against rational arithmetic: zero loads, grazing, F = 0, alpha = 0, families, near coincidences."""

from fractions import Fraction

import numpy as np
import pytest
from compare import METHODS, differences, differences_from_exact
from effort import some
from generators import integer_problem, singular_problem
from oracles import exact_condense, exact_solutions, perturbed_indices

import enumsol
from enumsol import ContactProblem, gallery
from enumsol.model.statuses import OPEN, SLIP_PLUS, STICK
from enumsol.roots.components import connected_components
from enumsol.selections.float_selections import FloatSelections
from enumsol.selections.solution import VertexLimitError


def check(problem, rng, methods=METHODS):
    """Compare all methods with the rational oracle; returns its components."""
    components = exact_solutions(problem, 0.0)
    indices = perturbed_indices(*exact_condense(problem, 0.0), components, rng)
    assert sum(indices) == 1
    for arithmetic, method in methods:
        roots = enumsol.enumerate_roots(problem, 0.0, arithmetic, method)
        assert not differences_from_exact(roots, components, indices), (arithmetic, method)
        assert not roots.undecided
        assert (roots.index_sum, roots.complete) == (1, arithmetic == "exact")
        if not roots.families and all(root.regular for root in roots):
            assert len(roots) % 2 == 1
    return components


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("seed", "sizes", "count"), [(0, (1, 2), some(25, of=50)), (10, (1, 2), 60), (1, (3,), 15)])
def test_integer_data(seed, sizes, count):
    rng = np.random.default_rng(seed)
    merged = 0
    for _ in range(count):
        components = check(integer_problem(rng, int(rng.choice(sizes))), rng)
        merged += any(c.dimension == 0 and len(c.parts) > 1 for c in components)
    # a fair share has a root on the border of several selections
    assert merged >= count / 10


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("seed", "sizes", "count"), [(2, (1, 2), some(10, of=20)), (12, (1, 2), 50), (3, (3,), 8)])
def test_singular_selections(seed, sizes, count):
    rng = np.random.default_rng(seed)
    families = 0
    for _ in range(count):
        components = check(singular_problem(rng, int(rng.choice(sizes))), rng)
        families += any(c.dimension > 0 for c in components)
    assert families >= count / 2


def near(rng, p, low, high):
    """A problem next to one with a family or a degenerate root, at a relative distance of 10^low to 10^high."""
    problem = singular_problem(rng, p)
    step = 10 ** rng.uniform(low, high)
    f = problem.f + step * rng.normal(size=2 * p)
    return problem.replace(f=f, friction=problem.friction * (1 + step * rng.normal(size=p)), friction_slope=0.0)


@pytest.mark.long
def test_near_coincidences_in_exact_arithmetic():
    rng = np.random.default_rng(4)
    for _ in range(60):
        problem = near(rng, int(rng.choice((1, 2))), -14, -6)
        components = exact_solutions(problem, 0.0)
        tree, oracle = (enumsol.enumerate_roots(problem, 0.0, "exact", method) for method in ("tree", "exhaustive"))
        assert not differences(tree, oracle)
        assert (len(tree), tree.families, tree.index_sum) == (len(components), (), 1)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", [5, 6])
def test_tree_equals_exhaustive_next_to_coincidences_in_fast_arithmetic(seed):
    # around the tolerance neither is right, but a root that one method accepts must not be pruned by the other
    rng = np.random.default_rng(seed)
    for k in range(some(40, of=100)):
        problem = near(rng, int(rng.choice((1, 2, 3))), -14, -6)
        tree, oracle = (enumsol.enumerate_roots(problem, 0.0, "fast", method) for method in ("tree", "exhaustive"))
        assert [root.statuses for root in tree] == [root.statuses for root in oracle], k
        assert len(tree.families) == len(oracle.families), k


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
@pytest.mark.parametrize("p", [1, 2, 3])
def test_zero_load(arithmetic, method, p):
    problem = gallery.chain(p, 0.25, f=(0.0, 0.0))
    roots = enumsol.enumerate_roots(problem, 1.0, arithmetic, method)
    assert (len(roots), roots.families, roots.index_sum, roots[0].regular) == (1, (), 1, False)
    assert not np.any(roots[0].lambda_n)
    plane = set(enumsol.ContactStatus) - {enumsol.ContactStatus.SLIP}
    assert all(holds == plane for holds in roots[0].active)


def test_zero_load_on_many_nodes_is_not_searched():
    # 4^12 selections hold at the one root
    roots = enumsol.enumerate_roots(gallery.chain(12, 0.25, f=(0.0, 0.0)), 1.0, "fast")
    assert (len(roots), roots.index_sum) == (1, 1)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_zero_friction_has_one_root(arithmetic, method):
    # alpha = 0 with F(alpha) = alpha: the frictionless problem, uniquely solvable
    rng = np.random.default_rng(6)
    for p in (1, 2, 3):
        problem = gallery.chain(p, 0.5, f=tuple(rng.normal(size=2)))
        (root,) = enumsol.enumerate_roots(problem, 0.0, arithmetic, method)
        assert root.index == 1
        assert not np.any(root.lambda_t)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_grazing_root_lists_all_statuses(arithmetic, method):
    # u_n = lambda_n = 0, u_t = 0.5 > 0: open and slip+ hold, stick does not
    problem = ContactProblem([[2.0, 0.0], [0.0, 2.0]], [[1, 0]], [[0, 1]], [0.0, 1.0])
    (root,) = enumsol.enumerate_roots(problem, 1.0, arithmetic, method)
    assert {s.value for s in root.active[0]} == {"open", "slip+"}
    assert root.statuses[0].value == "open"
    assert (root.index, root.regular, root.margin, root.dlambda_dalpha) == (1, False, 0.0, None)


@pytest.mark.parametrize(("arithmetic", "method"), METHODS)
def test_stick_at_the_slip_bound(arithmetic, method):
    # f = (1.5, 2), alpha = 4/3: theory, section 6.7: one root, not regular
    problem = gallery.one_node_triangle((3.0, 4.0))
    alpha = Fraction(4, 3) if arithmetic == "exact" else 4 / 3
    (root,) = enumsol.enumerate_roots(problem, alpha, arithmetic, method)
    assert ({s.value for s in root.active[0]}, root.index) == ({"stick", "slip+"}, 1)
    np.testing.assert_allclose(root.lambda_n, [3.0], rtol=1e-13)


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_exact_data_decide_and_not_their_roundings(method):
    # g_n = 1/3 - float(1/3) > 0 is 0 in floats
    problem = ContactProblem([[3.0, 0.0], [0.0, 3.0]], [[1, 0]], [[0, 1]], [1.0, 0.0], gap=1 / 3, friction=1.0)
    (root,) = enumsol.enumerate_roots(problem, 0, "exact", method)
    assert (root.statuses[0].value, root.regular) == ("stick", True)
    assert 0 < root.lambda_n[0] < 1e-16


@pytest.mark.parametrize("method", ["tree", "exhaustive"])
def test_friction_that_only_rounds_to_zero(method):
    # F = 3/10 - float(0.3) > 0 is 0 in floats
    problem = ContactProblem([[2, -1], [-1, 2]], [[1, 0]], [[0, 1]], [1.5, 4.0], friction=-0.3, friction_slope=1.0)
    (root,) = enumsol.enumerate_roots(problem, Fraction(3, 10), "exact", method)
    assert root.statuses[0].value == "slip+"
    assert root.lambda_t[0] > 0


def test_a_neighbour_with_too_many_vertices_leaves_the_root_without_an_index():
    # node 0 grazes without load: all four statuses hold there
    problem = ContactProblem(np.eye(4), np.eye(4)[::2], np.eye(4)[1::2], [0.0, 0.0, 1.0, 0.2], friction=1.0)
    system = problem.condensed.at(0.0).scaled

    class Limited(FloatSelections):
        def solve(self, codes):
            if codes == (SLIP_PLUS, STICK):
                raise VertexLimitError("a family of roots has too many candidate vertices")
            return super().solve(codes)

    seed = FloatSelections(system).solve((OPEN, STICK))
    (whole,) = connected_components([seed], FloatSelections(system))
    assert (len(whole.solutions), whole.index, whole.whole) == (4, 1, True)
    (cut,) = connected_components([seed], Limited(system))
    assert (len(cut.solutions), cut.index, cut.whole) == (3, None, False)
