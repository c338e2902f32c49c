"""What a problem in 3D or a fixed point holds cannot be written to."""

import copy
import pickle

import numpy as np
import pytest
from read_only import assert_locked, reachable

import enumsol
from enumsol import gallery


@pytest.fixture
def problem():
    """A problem that has answered, so that everything is in its caches."""
    table = enumsol.FrictionTable([0, 0.1, 1], [0.5, 0.4, 0.3], [0.3, 0.2, 0.2])
    made = gallery.block3d(4, 4, 1, friction=table, multipliers="elements", ratio=2)
    assert enumsol.successive_approximations(made, 0).converged
    assert enumsol.lipschitz_estimate(made, 0).C2 > 0
    return made


def forces(problem):
    return enumsol.successive_approximations(problem, 0).forces.tolist()


def test_no_array_of_a_problem_can_be_written(problem):
    found = dict(reachable(problem, "problem"))
    for name in (".f", ".areas", ".law.F1", ".mesh.points", ".mesh.rows", ".slip_mean.offset", ".condensed.S"):
        assert f"problem{name}" in found
    for part in ("A.data", "rows[Bt1].data"):
        assert f"problem._{part}" in found
    assert "problem.slip_mean._parts[weights].data" in found
    for array in found.values():
        assert_locked(array)


def test_no_attribute_of_a_problem_can_be_set(problem):
    before = forces(problem)
    for owner, name in (
        (problem, "law"),
        (problem, "areas"),
        (problem, "slip_mean"),
        (problem, "mesh"),
        (problem.friction, "F1"),
        (problem.friction, "new"),
        (problem.mesh, "rows"),
        (problem.slip_mean, "weights"),
        (problem.slip_mean, "offset"),
        (problem.condensed, "S"),
    ):
        with pytest.raises(AttributeError):
            setattr(owner, name, None)
        with pytest.raises(AttributeError):
            delattr(owner, name)
    for name in ("T1", "T2", "weights"):
        matrix = getattr(problem.slip_mean, name)
        matrix.data = np.zeros_like(matrix.data)
        assert_locked(getattr(problem.slip_mean, name).data)
    assert forces(problem) == before


def test_the_callers_arrays_are_copied():
    mesh = gallery.block3d(2, 1, 1).mesh
    given = {name: np.array(getattr(mesh, name)) for name in ("points", "cells", "dofs", "facets")}
    weights, rows, offset = np.array([[0.5, 0.5]]), np.eye(4)[:2], np.zeros((2, 2))
    made, mean = enumsol.BodyMesh.of_dofs(**given), enumsol.SlipMean(rows, rows, offset, weights)
    slips = np.array([0.0, 1.0, 2.0])
    table = enumsol.FrictionTable(slips, slips)
    for array in (*given.values(), weights, rows, offset, slips):
        array[...] = 7
    assert np.array_equal(made.points, mesh.points)
    assert np.array_equal(made.cells, mesh.cells)
    assert mean([1.0, 3.0, 0.0, 0.0]) == pytest.approx([2.0 * np.sqrt(2.0)])
    assert table.slip.tolist() == table.F1.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_are_as_locked_and_as_right(problem, again):
    other = again(problem)
    assert forces(other) == forces(problem)
    for array in dict(reachable(other, "copy")).values():
        assert_locked(array)
    for owner, name in ((other, "f"), (other.friction, "F1"), (other.slip_mean, "offset")):
        with pytest.raises(AttributeError, match=f"is immutable: {name} cannot be set"):
            setattr(owner, name, None)


@pytest.mark.parametrize("again", [lambda x: x, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_no_array_or_attribute_of_a_result_can_be_changed(problem, again, tmp_path):
    limit = enumsol.successive_approximations(problem, 0)
    limit.save(tmp_path / "limit.npz")
    solved = enumsol.solve_tresca(problem, 1.0, 0)
    for result in (limit, solved, enumsol.FixedPoint.load(tmp_path / "limit.npz", problem)):
        assert result.u.size
        assert result.statuses
        assert result.residuals
        kept = again(result)
        for array in dict(reachable(kept, "result")).values():
            assert_locked(array)
        for name in ("lambda_n", "u", "statuses", "residuals", "new"):
            with pytest.raises(AttributeError):
                setattr(kept, name, None)
        with pytest.raises(TypeError, match="does not support item assignment"):
            result.residuals["cone"] = 0.0
    with pytest.raises(AttributeError):
        limit.outcome = enumsol.fixed_points.Outcome.CONVERGED
    with pytest.raises(AttributeError):
        enumsol.lipschitz_estimate(problem, 0).sampled = False
