"""dataclasses.replace makes a problem with other data; what is not named stays to the last bit."""

import dataclasses
import pprint

import numpy as np
import pytest
import scipy.sparse as sp
from problems3d import from_compliance, random_compliance

import enumsol
from enumsol import ContactProblem, ContactProblem3D, FrictionTable, InvalidProblemError, gallery


def plane():
    """A problem in 2D with every argument given, asymmetric by rounding and with numbers of all sizes."""
    rng = np.random.default_rng(1)
    X = rng.normal(size=(6, 6))
    A = X @ X.T + np.eye(6)
    A[0, 1] *= 1 + 1e-15
    return ContactProblem(
        A,
        sp.coo_array(np.eye(6)[:2]),
        np.eye(6)[[3, 2]],
        rng.normal(size=6) * 1e-7,
        gap=[-1e-9, 0.5],
        friction=([0.1, 0.0], [1.0, 1 / 3]),
        load_slope=rng.normal(size=6),
        slip_offset=[0.0, -0.25],
        node_ids=["left", 7],
        coordinates=rng.normal(size=(2, 2)),
    )


def space(friction=((0.5, 0.25), (0.125, 2.0))):
    """The same in 3D."""
    rng = np.random.default_rng(2)
    return from_compliance(
        random_compliance(rng, 2),
        rng.normal(size=6),
        friction,
        friction_slope=(0.5, (0.0, 1.0)),
        gap=[0.0, 0.1],
        load_slope=rng.normal(size=6),
        slip_offset=rng.normal(size=(2, 2)),
        node_ids=("a", "b"),
        coordinates=rng.normal(size=(2, 3)),
        areas=[1.0, 2.0],
    )


PROBLEMS = {"plane": plane, "space": space, "block": lambda: gallery.clamped_block(2, 1)} | {
    "block in 3D": lambda: gallery.block3d(2, 1, 1)
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_nothing_named_is_the_same_problem(name):
    problem = PROBLEMS[name]()
    same = dataclasses.replace(problem)
    assert type(same) is type(problem)
    assert same is not problem
    assert same.fingerprint == problem.fingerprint
    for argument in dataclasses.fields(problem):
        kept, given = getattr(same, argument.name), getattr(problem, argument.name)
        if argument.name in ("mesh", "slip_mean", "node_ids"):
            assert kept == given
        elif sp.issparse(given):
            assert (kept != given).nnz == 0
        else:
            assert np.array_equal(kept, given)
    assert repr(same) == repr(problem)
    assert pprint.pformat(problem) == repr(problem)


@pytest.mark.parametrize("name", PROBLEMS)
def test_what_is_named_changes_and_nothing_is_carried_over(name):
    problem = PROBLEMS[name]()
    _ = problem.condensed, problem.enclosure, problem.fingerprint
    other = dataclasses.replace(problem, f=2 * problem.f, gap=1.0)
    assert np.array_equal(other.f, 2 * problem.f)
    assert np.array_equal(other.gap, np.ones(problem.p))
    assert other.mesh is problem.mesh
    assert other.node_ids == problem.node_ids
    assert other.fingerprint != problem.fingerprint
    assert not np.array_equal(other.condensed.g0, problem.condensed.g0)
    assert np.array_equal(other.friction, problem.friction)


def test_roots_of_a_problem_with_another_load():
    problem = gallery.one_node_triangle()
    doubled = dataclasses.replace(problem, f=2 * problem.f)
    pairs = zip(enumsol.enumerate_roots(problem, 5), enumsol.enumerate_roots(doubled, 5), strict=True)
    assert all(np.allclose(2 * one.lambda_n, other.lambda_n) for one, other in pairs)


def test_friction_that_depends_on_the_slip_is_kept():
    table = FrictionTable([0.0, 1.0], [0.5, 0.25])
    for friction in (table, lambda node, slip: 0.3 / (1.0 + slip)):
        problem = dataclasses.replace(space(), friction=friction, friction_slope=0.0)
        other = dataclasses.replace(problem, gap=1.0)
        assert other.friction is friction
        assert other.depends_on_solution
        slips = np.array([0.2, 3.0])
        assert np.array_equal(other.coefficients(0, slips), problem.coefficients(0, slips))


def test_data_that_do_not_fit_and_names_that_do_not_exist():
    problem = plane()
    with pytest.raises(InvalidProblemError, match=r"f has shape \(5,\); expected \(6,\)"):
        dataclasses.replace(problem, f=np.ones(5))
    with pytest.raises(TypeError, match="unexpected keyword argument 'load'"):
        dataclasses.replace(problem, load=problem.f)
    with pytest.raises(AttributeError, match=r"build a new problem, or one with other data by dataclasses\.replace"):
        problem.f = np.ones(6)
    assert isinstance(space(), ContactProblem3D)
