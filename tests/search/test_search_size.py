"""How many nodes the tree needs: the count is deterministic and part of the promise (issue 2)."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from complete import all_roots, complete_report, proven_roots
from generators import named
from refusals import refusal

import enumsol
from enumsol import gallery


@pytest.mark.few(4, 4)
@pytest.mark.parametrize("length", [1.0, 2.0])
@pytest.mark.parametrize("traction", [(0.3, -1.0), (0.0, -1.0)])
@pytest.mark.parametrize("p", [8, 14, 20, 32])
def test_at_most_eight_nodes_per_contact_node(p, traction, length):
    problem = gallery.clamped_block(p, p // 2, length, traction=traction)
    for F in (1.0, 1.5, 2.0, 3.0, 5.0, 10.0):
        roots = enumsol.enumerate_roots(problem, F, "fast")
        assert (len(roots), roots.index_sum, roots.families) == (1, 1, ())
        assert roots.stats.nodes <= 8 * p, (F, roots.stats)
        assert roots.stats.fallback_qps == 0


@pytest.mark.parametrize("p", [8, 14, 20, 32])
def test_loads_that_lift_part_of_the_block(p):
    for length in (1.0, 2.0):
        problem = gallery.clamped_block(p, p // 2, length, traction=(1.0, -0.3))
        for F in (1.0, 3.0, 10.0):
            roots = enumsol.enumerate_roots(problem, F, "fast")
            assert roots.index_sum == 1
            assert roots.stats.nodes <= 8 * p * len(roots)


@pytest.mark.long
def test_a_hundred_nodes_with_high_friction():
    # branching by the largest violation alone takes 140,000 nodes here
    roots = all_roots(gallery.clamped_block(100, 50, 2.0, traction=(1.0, -0.3)), 10.0)
    assert (len(roots), roots.index_sum) == (1, 1)
    assert roots.stats.nodes < 8_000


def test_a_soft_body_is_excluded_by_its_bounds():
    # where balls of S were 1e5 ulps wide two bounds in five proved nothing, and the tree was unfinished at 20,000 nodes
    roots = all_roots(gallery.clip(12, 1), 1.0)
    assert (len(roots), roots.index_sum) == (3, 1)
    assert roots.stats.nodes < 2_000
    assert roots.stats.escalations.refined < 10


@pytest.mark.parametrize(("nx", "most"), [(6, 5_000), pytest.param(12, 30_000, marks=pytest.mark.long)])
def test_slip_is_decided_soon_where_a_step_closes_little(nx, most):
    # 5,567 and 309,035 nodes where it is mostly decided which nodes touch before it is decided how they slip
    roots = proven_roots(gallery.clip(nx, 1), 3.0)
    assert (len(roots), roots.index_sum) == (5, 1)
    assert roots.stats.nodes < most


@pytest.mark.few(2, 1)
@pytest.mark.parametrize("p", [8, 14, 20, 32])
def test_wedges(p):
    for name in (f"wedge-{p}-3", f"wedge-{p}-5"):
        entry = gallery.get(name)
        roots = enumsol.enumerate_roots(entry.build(), entry.alpha, "fast")
        assert (len(roots), roots.index_sum) == (entry.roots, 1)
        assert all(root.regular for root in roots)


def test_contact_is_decided_before_slip():
    # 10,647 nodes where both weigh the same and only what one dual step proves counts
    roots = all_roots(gallery.wedge(4, 13, (4e-4, 1e-3)), 2.2)
    assert (len(roots), roots.index_sum) == (5, 1)
    assert roots.stats.nodes < 9_000


def test_what_is_too_large_is_refused_with_an_estimate():
    large, small = gallery.clamped_block(32, 8), gallery.clamped_block(8, 2)
    for message, problem, arguments in (
        (r"1\.8.*e\+19 selections .*hours.*method=\"tree\"", large, ("fast", "exhaustive")),
        ("selections", small, ("exact", "exhaustive")),
        ("n = ", large, ("exact",)),
    ):
        refusal(enumsol.TooLargeError, message, enumsol.enumerate_roots, problem, 1.0, *arguments)


def test_statistics_add_up(tree_only):
    roots = enumsol.enumerate_roots(gallery.clamped_block(14, 4), 2.0, "fast")
    stats = roots.stats
    assert stats.qps == stats.nodes
    assert 0 < stats.pruned < stats.nodes
    assert len(roots) <= stats.selections <= stats.nodes - stats.pruned
    assert stats.seconds > 0


@pytest.mark.parametrize("arithmetic", ["fast", "verified"])
def test_presolve_proves_nodes_open(arithmetic):
    # a load to the right lifts the left part of the block off
    problem = gallery.clamped_block(32, 16, 2.0, traction=(1.0, -0.3))
    roots = enumsol.enumerate_roots(problem, 10.0, arithmetic)
    (root,) = roots
    assert 10 <= roots.stats.presolved <= sum(status.value == "open" for status in root.statuses)
    if arithmetic == "verified":
        complete_report(problem, roots.proof)
    with ThreadPoolExecutor(2) as executor:
        spread = enumsol.enumerate_roots(problem, 10.0, arithmetic, executor=executor)
    assert (spread.stats.presolved, spread.complete) == (roots.stats.presolved, roots.complete)
    assert [root.statuses for root in spread] == [root.statuses]


def test_presolve_leaves_the_search_alone_where_nothing_is_forced():
    for options in ({}, {"engine": "clarabel", "max_nodes": 5}):
        assert enumsol.enumerate_roots(*named("wedge-14-5"), "fast", **options).stats.presolved == 0
