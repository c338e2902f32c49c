"""Degenerate roots and continua in 3D that no box settles: undecided regions, which hold what is known to be there."""

import json
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import oracles3d
import pytest
import scipy.linalg
from alike import anew
from complete import accepted_report
from problems3d import from_compliance, random_coupled
from roots.test_space_weak_springs import body

import enumsol
from enumsol import enumerate_roots, gallery
from enumsol.cli import roots as command
from enumsol.model.sectors import SECTORS
from enumsol.roots.space_roots import _hull, regions_of
from enumsol.search.space.open_leaves import Cause
from enumsol.search.space.space_search import SpaceSolvers

pytestmark = pytest.mark.usefixtures("tree_only", "no_boxes")
LOADED = (np.eye(3), [1, 3, 2])
STUCK_AT_ITS_LIMIT = (np.eye(3), [5, 4, 3])
#: It slides with any lambda_n from 0, where it grazes, to 1, where it would stick.
RAY = (np.array([[1, -1, 0], [-1, 2, 0], [0, 0, 1]]), [0, 1, 0])
ROOT_OF_LOADED = np.array([1, *(np.array([3, 2]) / np.hypot(3, 2))])

#: With F = 1: S and g of nodes that do not influence each other, statuses that are known, solutions node by node
CASES = {
    "grazing": ([(np.eye(3), [0, 1, 0.5])], (None,), [[0, 0, 0]]),
    "grazing beside a loaded one": ([(np.eye(3), [0, -2, 1]), LOADED], (None, "slip"), [[0, 0, 0, *ROOT_OF_LOADED]]),
    "stick at its limit": ([STUCK_AT_ITS_LIMIT], ("contact",), [[5, 4, 3]]),
    "twice stick at its limit": ([STUCK_AT_ITS_LIMIT] * 2, ("contact",) * 2, [[5, 4, 3, 5, 4, 3]]),
    "unloaded beside a loaded one": ([(np.eye(3), [0, 0, 0]), LOADED], (None, "slip"), [[0, 0, 0, *ROOT_OF_LOADED]]),
    "a continuum": ([RAY], (None,), [[n, n, 0] for n in np.linspace(0, 1, 5)]),
}


def beside(nodes):
    """S and g of nodes that do not influence each other, all normals first."""
    p = len(nodes)
    S, g = scipy.linalg.block_diag(*(S for S, _ in nodes)), np.concatenate([g for _, g in nodes]).astype(float)
    return S[np.ix_(places(p), places(p))], g[places(p)]


def places(p):
    return [3 * i + k for k in range(3) for i in range(p)]


def outside(box, S, g, lam):
    """How far a solution lies outside of the bounds of a region."""
    p = len(lam) // 3
    w = g - S @ lam
    ends = np.concatenate([box.lambda_n, *np.moveaxis(box.lambda_t, 1, 0), box.u_n, *np.moveaxis(box.u_t, 1, 0)])
    values = np.concatenate([lam, w])
    assert ends.shape == (6 * p, 2)
    return max(0.0, float(np.max(ends[:, 0] - values)), float(np.max(values - ends[:, 1])))


def names(part):
    return tuple(getattr(status, "value", status) for status in part.statuses)


@pytest.mark.few(4)
@pytest.mark.parametrize("name", CASES)
def test_one_region_that_holds_what_is_known(name):
    nodes, statuses, known = CASES[name]
    S, g = beside(nodes)
    problem = from_compliance(S, g, 1.0)
    roots = enumerate_roots(problem, 0, max_nodes=400)
    assert (roots.stopped, len(roots)) == (None, 0)
    (region,) = roots.undecided
    assert region.leaves > 1
    assert names(region) == statuses
    F = np.ones((len(nodes), 2))
    for solution in known:
        lam = np.array(solution, dtype=float)[places(len(nodes))]
        assert oracles3d.violation(S, g, F, lam) < 1e-12
        assert outside(region.bounds, S, g, lam) < 1e-12
        v = (g - S @ lam).reshape(3, -1)[1:].T
        for i, (low, high) in enumerate(region.slip_angle):
            angle = np.arctan2(v[i, 1], v[i, 0])
            if np.hypot(*v[i]) > 1e-9:
                assert low - 1e-12 <= angle + 2 * np.pi * np.ceil((low - 1e-12 - angle) / (2 * np.pi)) <= high + 1e-12
    assert np.all(region.bounds.lambda_n[:, 0] >= 0)
    assert np.all(region.bounds.u_n[:, 1] <= 0)
    # nothing of it is claimed, but that there is a solution, whatever the data
    assert (roots.complete, roots.at_least, roots.index_sum) == (False, 1, None)
    text = repr(roots)
    assert f"undecided region 0: {', '.join(('1 ' if len(nodes) > 1 else '') + (s or 'any') for s in statuses)}" in (
        text.replace("2 contact", "1 contact, 1 contact")
    )
    assert text.endswith("complete: no (1 undecided)")
    found = accepted_report(problem, roots.proof)
    assert (found.complete, found.undecided) == (False, region.leaves)


@pytest.mark.slow
def test_bounds_are_narrow_where_the_root_is_isolated():
    for name in ("grazing", "stick at its limit", "twice stick at its limit", "unloaded beside a loaded one"):
        (region,) = enumerate_roots(from_compliance(*beside(CASES[name][0]), 1.0), 0).undecided
        box = region.bounds
        for bounds in (box.lambda_n, box.lambda_t, box.u_n, box.u_t):
            assert np.max(np.ptp(bounds, axis=-1)) < 1e-11, name


def test_degenerate_roots_far_apart_are_regions_of_their_own():
    one = gallery.get("one-node-3d-3").build()
    three = enumerate_roots(one, 0)
    assert len(three) == 3
    nodes = [(one.condensed.S, one.condensed.free_displacements(0)), STUCK_AT_ITS_LIMIT]
    S, g = beside(nodes)
    F = np.vstack([one.friction_at(0), [[1.0, 1.0]]])
    roots = enumerate_roots(from_compliance(S, g, tuple(F.T)), 0)
    assert roots.stopped is None
    expected = sorted((root.statuses[0].value, "contact") for root in three)
    assert sorted(names(part) for part in roots.undecided) == expected
    for root in three:
        lam = np.array([root.lambda_n[0], 5, root.lambda_t[0, 0], 4, root.lambda_t[0, 1], 3])
        assert sum(outside(part.bounds, S, g, lam) < 1e-9 for part in roots.undecided) == 1
    assert "3 undecided" in repr(roots)
    assert repr(roots).count("undecided region") == 3


def test_regular_roots_beside_a_region_stay_roots():
    one = gallery.get("one-node-3d-3").build()
    S, g = one.condensed.S, one.condensed.free_displacements(0)
    lam = np.linalg.solve(S, g)
    F = float(np.hypot(lam[1], lam[2]) / lam[0])
    roots = enumerate_roots(from_compliance(S, g, F), 0)
    (region,) = roots.undecided
    assert [root.statuses[0].value for root in roots] == ["open"]
    assert outside(region.bounds, S, g, lam) < 1e-9
    assert roots.at_least == 1


@pytest.mark.slow
def test_executors_find_the_same_regions():
    for name in ("twice stick at its limit", "unloaded beside a loaded one"):
        problem = from_compliance(*beside(CASES[name][0]), 1.0)
        alone = enumerate_roots(problem, 0)
        with ProcessPoolExecutor(2) as executor:
            together = enumerate_roots(problem, 0, executor=executor)
        assert [names(part) for part in together.undecided] == [names(part) for part in alone.undecided]
        for one, other in zip(alone.undecided, together.undecided, strict=True):
            np.testing.assert_allclose(one.bounds.lambda_n, other.bounds.lambda_n, rtol=0, atol=1e-10)


def test_fast_arithmetic_proves_no_bounds():
    problem = from_compliance(*beside([STUCK_AT_ITS_LIMIT]), 1.0)
    (region,) = enumerate_roots(problem, 0, "fast").undecided
    assert region.bounds is None
    np.testing.assert_allclose(region.slip_angle, np.arctan2(3, 4), rtol=0, atol=1e-6)


def test_parts_that_were_not_searched_are_listed_one_by_one():
    problem = from_compliance(*beside([STUCK_AT_ITS_LIMIT] * 2), 1.0)
    roots = enumerate_roots(problem, 0, max_nodes=2)
    assert len(roots.undecided) > 1
    assert all(part.bounds is None and part.slip_angle is None and part.leaves == 1 for part in roots.undecided)


def test_a_region_on_the_command_line_and_in_tables():
    problem = from_compliance(*beside([STUCK_AT_ITS_LIMIT]), 1.0)
    roots = enumerate_roots(problem, 0)
    text = "undecided region 0: contact (2 leaves of the tree); a root in it has max lambda_n from 5 to 5"
    assert text in command.roots_as_text(roots)
    (entry,) = json.loads(command.roots_as_json(roots, "here"))["undecided"]
    assert (entry["statuses"], entry["leaves"]) == (["contact"], 2)
    np.testing.assert_allclose(entry["bounds"]["lambda_t"], [[[4, 4], [3, 3]]], atol=1e-10)
    np.testing.assert_allclose(entry["slip_angle"], np.arctan2(3, 4), atol=1e-6)
    assert enumsol.multiplicity_table(problem, [0])["undecided"].tolist() == [1]
    plane = enumerate_roots(gallery.two_node_square(), 3.5, max_nodes=2)
    assert set(json.loads(command.roots_as_json(plane, "here"))["undecided"][0]) == {"statuses", "reason", "hint"}


@pytest.mark.parametrize("seed", range(4))
def test_bounds_hold_for_every_solution_of_a_leaf(seed):
    # leaves of any width, whether or not they would be left open
    rng = np.random.default_rng(seed)
    S, g, F = random_coupled(rng, 2)
    problem = from_compliance(S, g, tuple(F.T))
    solvers = SpaceSolvers(problem, 0, "verified")
    certifier = solvers.certifier(None)
    solvers.search(certifier).run()
    for codes, root in certifier.certified.verified.items():
        for up in (0, 1, 3, 30):
            wider = tuple(SECTORS + parent(code - SECTORS, up) if code > SECTORS else code for code in codes)
            (region,) = regions_of(solvers.enclosed, [wider])
            for ball, inside in ((region.y, root.y), (region.w, root.w)):
                assert np.all(np.abs(ball.mid - inside.mid) <= ball.rad + inside.rad)


def parent(number, up):
    """The sector that holds another one so many levels deeper, at most a quarter."""
    return number >> min(up, number.bit_length() - 3)


@pytest.mark.parametrize(
    ("angles", "radii", "hull"),
    [
        ([1.0], [0.5], (0.5, 1.5)),
        ([1.0, 2.0], [0.5, 0.1], (0.5, 2.1)),
        ([3.0, -3.0], [0.1, 0.1], (2.9, 2 * np.pi - 2.9)),
        ([0.0, np.pi / 2, np.pi, -np.pi / 2], [0.8] * 4, (-np.pi, np.pi)),
        ([-2.0, 0.0, 2.0], [0.1, 0.1, 0.1], (-2.1, 2.1)),
        ([0.5, np.nan], [3.0, np.nan], (-2.5, 3.5)),
        ([0.2, 0.1], [0.01, 2.0], (-1.9, 2.1)),
    ],
)
def test_the_shortest_arc_around_arcs(angles, radii, hull):
    np.testing.assert_allclose(_hull(np.array(angles), np.array(radii)), hull, atol=1e-12)
    assert np.all(np.isnan(_hull(np.full(2, np.nan), np.full(2, np.nan))))


def test_neighbouring_sectors_touch_and_others_do_not():
    # no load: bounds of forces and displacements are 0 in all, so that directions decide
    solvers = SpaceSolvers(from_compliance(np.eye(3), np.zeros(3), 0.5), 0, "verified")
    sectors = [(SECTORS + 16 + k,) for k in range(16)]

    def groups(*chosen):
        return len(regions_of(solvers.enclosed, [sectors[k] for k in chosen]))

    assert groups(3, 4) == groups(15, 0) == groups(4, 2, 3) == groups(*range(16)) == 1
    assert groups(3, 5) == groups(0, 14) == 2
    assert groups(1, 5, 9, 13) == 4


# -- reasons -----------------------------------------------------------------------------------------------------------


def undecided_and_perturbed(problem):
    """Reasons of a problem's regions, and whether the problem with a load that is a little different is complete."""
    roots = enumerate_roots(problem, 0, max_nodes=400)
    assert not roots.complete
    assert "at least 1 exists" in repr(roots)
    change = 1e-4 * np.max(np.abs(problem.f)) * np.random.default_rng(5).normal(size=problem.n)
    near = enumerate_roots(anew(problem, f=problem.f + change), 0, max_nodes=400)
    return {(region.reason, region.hint) for region in roots.undecided}, near.complete


def integers(seed):
    """A small integer stiffness, and a load in balance with tangential forces alone."""
    rng = np.random.default_rng([seed, 10])
    X = rng.integers(-2, 3, (9, 9))
    A, rows = (X @ X.T + np.eye(9)).astype(float), np.eye(9)
    rng.integers(0, 2, 3)
    f, F = A @ np.concatenate([np.zeros(3), rng.integers(-1, 2, 6)]), rng.integers(1, 3, 3)
    return enumsol.ContactProblem3D(A, rows[:3], rows[3:6], rows[6:], f, friction=(F, F))


@pytest.mark.slow
def test_the_reason_is_what_stands_in_the_way_and_the_hint_helps():
    perturb = "perturb the load, by 1e-4 of its largest entry, say"
    wedging, stuck = (from_compliance(*beside([node]), 1.0) for node in (RAY, STUCK_AT_ITS_LIMIT))
    for problem, cause in ((wedging, Cause.EQUATIONS), (stuck, Cause.EQUALITY), (integers(8), Cause.DIRECTIONS)):
        assert undecided_and_perturbed(problem) == ({(cause.value, perturb)}, True)


@pytest.mark.long
def test_a_body_that_is_almost_free_to_move():
    roots = enumerate_roots(body(1e-10, 0.1), 0, max_nodes=2500)
    reasons = {(region.reason, region.hint) for region in roots.undecided}
    assert (Cause.ROUNDING.value, "hold the body by stiffer springs") in reasons
    assert enumerate_roots(body(1e-9, 0.1), 0).complete
