"""Bodies that turn: closed forms of a ring, resultants by hand, decks with CENTRIF."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument
from two_bodies import shifted

import enumsol
from enumsol import fem

E, NU, C, A, B = 2.0, 0.3, 0.05, 1.0, 2.0
STEEL = {"young": E, "poisson": NU}


def outwards(r):
    """Radial displacement of a ring that turns in plane strain, from the closed form in plane stress."""
    e, nu = E / (1 - NU**2), NU / (1 - NU)
    inner = A**2 + B**2 - (1 + nu) / (3 + nu) * r**2 + (1 + nu) / (1 - nu) * (A * B / r) ** 2
    return (3 + nu) * (1 - nu) / (8 * e) * C * r * inner


def with_body(mesh):
    return type(mesh)(mesh.points, mesh.cells, mesh.facets, {}, {"disc": np.arange(len(mesh.cells))})


def ring(count):
    return with_body(shifted(grid(count, 1, 9, B - A, 0.25), (A, 0)))


def test_a_ring_that_turns_grows_as_in_the_closed_form():
    errors = []
    for count in (1, 2, 4):
        problem = fem.mesh_problem(
            ring(count), **STEEL, plane="axisymmetric", symmetry=["bottom", "top"], contact="right", gap=1.0,
            friction=0.3, centrifugal={"disc": (C, 0, 0, 0, 0, 1, 0)},
        )  # fmt: skip
        u = problem.mesh.displacements(spla.spsolve(problem.A, problem.f))  # without contact
        exact = outwards(problem.mesh.points[:, 0])
        errors.append(np.max(np.abs(u[:, 0] - exact)) / np.max(exact))
    assert errors[-1] < 1e-4
    assert all(after < before / 6 for before, after in pairwise(errors))


def test_a_ring_that_turns_in_a_hub_presses_less_on_it():
    """Pressed by its speed against an outer wall that is just where it would be: no force there, and some at 99 %."""
    given = {"plane": "axisymmetric", "symmetry": ["bottom", "top"], "contact": "right", "friction": 0.0}
    turning = {"centrifugal_slope": {"disc": (C, 0, 0, 0, 0, 1, 0)}}
    problem = fem.mesh_problem(ring(4), **STEEL, **given, **turning, gap=float(outwards(B)))
    assert not np.any(enumsol.enumerate_roots(problem, 0.99)[0].lambda_n)
    assert np.all(enumsol.enumerate_roots(problem, 1.01)[0].lambda_n > 0)


@pytest.mark.parametrize("kind", [3, 4, 6, 9])
@pytest.mark.parametrize(("axis", "along"), [((0, 0, 1), (1, 1)), ((0, 2, 0), (1, 0)), ((1, 0, 0), (0, 1))])
def test_forces_of_a_plane_body_do_the_work_of_the_field_on_itself(kind, axis, along):
    mesh = with_body(grid(3, 2, kind, 2.0, 1.0, shake=0.1 * (kind < 6)))
    numbers = (C, 0.5, 0.25, 0, *axis)
    scene = fem.mesh_scene(mesh, **STEEL, clamp="top", contact="bottom", friction=0, centrifugal={"disc": numbers})
    off = (mesh.points - (0.5, 0.25)) * along
    squares = np.array([2 * (1.5**2 + 0.5**2 - 1.5 * 0.5) / 3, 2 * (0.75**2 + 0.25**2 - 0.75 * 0.25) / 3])
    assert np.isclose(np.sum(scene.forces * off), C * squares @ along, rtol=1e-12)
    assert np.allclose(scene.forces.sum(axis=0), C * 2 * np.array([0.5, 0.25]) * along, rtol=1e-12)


@pytest.mark.parametrize("kind", [4, 8, 10])
def test_forces_of_a_solid_about_an_inclined_axis(kind):
    mesh, a = with_body(solid((2, 1, 1), kind, (2.0, 1.0, 1.0))), np.array([2.0, -1.0, 2.0]) / 3
    given = {"centrifugal": {"disc": (C, 1, 2, 3, 2, -1, 2)}}
    scene = fem.mesh_scene(mesh, **STEEL, clamp="top", contact="bottom", friction=0, **given)
    off = np.array([1.0, 0.5, 0.5]) - (1, 2, 3)
    assert np.allclose(scene.forces.sum(axis=0), 2 * C * (off - a * (a @ off)), rtol=1e-12)
    assert np.allclose(scene.forces.sum(axis=0) @ a, 0, atol=1e-14)


@pytest.mark.parametrize(
    ("plane", "numbers", "message"),
    [
        ("strain", (C, 0, 0, 0, 0, 0), "centrifugal of disc is .*; expected seven finite numbers"),
        ("strain", (C, 0, 0, 0, 0, 0, 0), "centrifugal of disc has an axis without a direction"),
        ("strain", (C, 0, 0, 0, 0, 1, 1), "centrifugal of disc has the axis .*; expected one across the plane"),
        ("strain", (C, 0, 0, 1, 0, 1, 0), "centrifugal of disc has the axis .*; expected one across the plane"),
        ("axisymmetric", (C, 0, 0, 0, 0, 0, 1), "has the axis .*; expected the y axis of an axisymmetric body"),
        ("axisymmetric", (C, 1, 0, 0, 0, 1, 0), "has the axis .*; expected the y axis of an axisymmetric body"),
    ],
)  # fmt: skip
def test_axes_that_cannot_be_are_refused(plane, numbers, message):
    given = {"contact": "right", "clamp": "bottom", "friction": 0, "plane": plane}
    bad_argument(message, fem.mesh_problem, ring(1), **STEEL, **given, centrifugal={"disc": numbers})


def test_only_parts_of_the_body_turn():
    given = {"contact": "right", "clamp": "bottom", "friction": 0, "centrifugal": {"left": (C, 0, 0, 0, 0, 0, 1)}}
    bad_argument("no cells named 'left'", fem.mesh_problem, ring(1), **STEEL, **given)
