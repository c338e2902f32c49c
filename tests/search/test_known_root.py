"""A root that is found before the tree is listed and proven wherever the search is stopped."""

import functools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from generators import dense_compliance, from_condensed, named
from interruptions import CtrlC, interrupted
from problems3d import from_compliance, random_coupled

import enumsol
from enumsol import fem


@functools.cache
def pushed_block(count=10):
    """A block that rests on a floor and is pushed by less than friction can hold: only contact holds it."""
    return fem.mesh_problem(
        fem.rectangle(count, 4).parted(), young=210.0, poisson=0.3, contact="bottom", pressure={"top": 1.0},
        load={"left": (0.2, 0.0)}, friction=0.3, max_rigid_displacement="auto",
    )  # fmt: skip


@functools.cache
def pressed_cube(count=2):
    """A cube on a floor whose roof is guided upright: only contact holds it up."""
    return fem.mesh_problem(
        fem.box(count, count, 2), young=1000.0, poisson=0.3, contact="bottom", pressure={"top": 1.0}, friction=0.2,
        displacement={"top": (0, 0, "free")}, max_rigid_displacement="auto",
    )  # fmt: skip


BODIES = {
    "wedge": lambda: named("wedge-14-5"),
    "wedge in 3D": lambda: named("wedge3d-2-3"),
    "block": lambda: (pushed_block(), 0),
    "cube": lambda: (pressed_cube(), 0),
}


def same(one, other):
    pairs = [(one.lambda_n, other.lambda_n), (one.lambda_t, other.lambda_t)]
    return all(np.allclose(*pair, rtol=1e-6, atol=1e-6 * (1 + np.max(np.abs(other.lambda_n)))) for pair in pairs)


@pytest.mark.parametrize("nodes", [1, 5])
@pytest.mark.parametrize("name", BODIES)
def test_a_search_that_is_stopped_at_once_has_a_root_and_its_proof_too(name, nodes):
    problem, alpha = BODIES[name]()
    found = enumsol.enumerate_roots(problem, alpha, max_nodes=nodes)
    report = enumsol.verify(problem, found.proof)
    if found.complete:  # by one certificate
        assert report.complete
        return
    assert len(found) >= 1
    assert found.at_least >= 1
    assert report.ok
    assert report.roots == len(found)
    assert not report.complete
    assert "0 roots" not in str(found)
    newton = enumsol.newton(problem, alpha, start=found[0])
    assert newton is not None
    assert same(newton, found[0])


@pytest.mark.parametrize("name", ["block", "cube"])
def test_ctrl_c_keeps_the_root(name):
    problem, alpha = BODIES[name]()
    partial = interrupted("1 root so far", enumsol.enumerate_roots, problem, alpha, progress=CtrlC())
    assert len(partial) == 1
    assert not partial.complete


def test_workers_leave_the_root_as_well():
    with ThreadPoolExecutor(2) as executor:
        found = enumsol.enumerate_roots(pushed_block(), 0, max_nodes=40, executor=executor)
    assert len(found) == 1
    report = enumsol.verify(pushed_block(), found.proof)
    assert report.ok
    assert report.roots == 1


def test_a_search_goes_on_from_a_proof_that_has_the_root(tmp_path):
    path = tmp_path / "block.proof"
    problem = pushed_block(4)
    first = enumsol.enumerate_roots(problem, 0, max_nodes=3, proof_path=path)
    assert len(first) == 1
    assert not first.complete
    whole = enumsol.enumerate_roots(problem, 0, proof_path=path, resume=True)
    assert whole.complete
    assert len(whole) == 1
    assert same(whole[0], first[0])
    assert enumsol.verify(problem, whole.proof).complete


@pytest.mark.few(6, 24)
@pytest.mark.parametrize("seed", range(300))
def test_roots_of_a_search_that_was_stopped_are_among_all(seed):
    rng = np.random.default_rng([11, seed])
    p = int(rng.integers(2, 6))
    problem = from_condensed(dense_compliance(rng, p), rng.normal(size=2 * p), rng.uniform(0.1, 3.0, p))
    every = enumsol.enumerate_roots(problem, 0, method="exhaustive", arithmetic="fast")
    for nodes in (1, 2, 4, 9, 17):
        found = enumsol.enumerate_roots(problem, 0, max_nodes=nodes)
        report = enumsol.verify(problem, found.proof)
        assert report.ok
        assert report.roots == len(found)
        # no two of them are one root
        assert all(sum(same(root, other) for other in every) == 1 for root in found)
        assert len({tuple(root.lambda_n.round(8)) + tuple(root.lambda_t.round(8)) for root in found}) == len(found)
        assert len(found) >= 1 or found.undecided


@pytest.mark.parametrize("seed", [0, 22, 49, 128])
def test_a_search_that_leaves_nothing_but_the_known_root_is_complete(seed):
    S, g, F = random_coupled(np.random.default_rng([30, seed]), 1)
    problem = from_compliance(S, g, tuple(F.T))
    for nodes in (1, 2, 3, 4):
        found = enumsol.enumerate_roots(problem, 0, max_nodes=nodes)
        report = enumsol.verify(problem, found.proof)
        assert report.ok
        assert found.complete == report.complete
        assert found.complete or found.undecided
