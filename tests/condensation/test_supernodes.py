"""Factors of large matrices in dense blocks, against SuperLU's own solves and the same problem without them."""

import numpy as np
import pytest

import enumsol
from enumsol import fem
from enumsol.condensation import factorization
from enumsol.condensation.factorization import Factorization


@pytest.fixture
def large(monkeypatch):
    """Every matrix is large."""
    monkeypatch.setattr(factorization, "LARGE", 0)


def block():
    mesh = fem.box(4, 4, 3)
    loads = fem.facet_forces(mesh.points, mesh.facets["top"], (0.3, 0.1, -1.0))
    return fem.solid_contact_problem(
        mesh.points, mesh.cells, (1, 1), contact=mesh.facets["bottom"], held=mesh.nodes("left"), forces=loads,
        friction=(0.5, 0.3),
    )  # fmt: skip


def test_many_right_sides_are_solved_for_as_one_by_one(large):
    A = block().A
    factors = Factorization(A)
    factors.check_positive_definite()
    assert factors._parts[1] is not None
    rhs = np.random.default_rng(1).normal(size=(A.shape[0], 40))
    rhs[: A.shape[0] // 2, :20] = 0.0  # blocks that are not worked on
    rhs[:, 30:] = 0.0
    rhs[-1, 30] = 1.0
    for refined in (True, False):
        one = np.column_stack([factors.solve(column, refined=refined) for column in rhs.T])
        np.testing.assert_allclose(factors.solve(rhs, refined=refined), one, rtol=0, atol=1e-13 * np.max(np.abs(one)))
    assert np.max(np.abs(A @ factors.solve(rhs) - rhs)) < 1e-12


def test_the_condensed_problem_and_its_balls_are_the_same(monkeypatch):
    usual = block()
    expected = usual.enclosure
    monkeypatch.setattr(factorization, "LARGE", 0)
    other = block()
    found = other.enclosure
    assert usual.factorization.columns == 16
    assert other.factorization.columns == 64
    assert np.all(np.abs(found.S - expected.S) <= found.S_rad + expected.S_rad)
    assert np.max(found.S_rad) < 2 * np.max(expected.S_rad)
    assert enumsol.enumerate_roots(other, 0).complete


def test_columns_stay_few_where_they_are_long(large, monkeypatch):
    factors = Factorization(block().A)
    assert factors.columns == 64
    monkeypatch.setattr(factorization, "LONGEST", 1000)
    assert factors.columns == 16
