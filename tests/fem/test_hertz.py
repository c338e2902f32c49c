"""Two discs pressed together, against Hertz's solution, and a pair that sticks, against one mesh of both."""

import numpy as np
import pytest
from complete import all_roots
from parted_meshes import grid, moved
from two_bodies import blocks, stacked, together

import enumsol
from enumsol import fem

E, NU, RADIUS = 1.0, 0.3, 1.0


def half_disc(count, kind, sign):
    """The part 0 < x < 0.9 R of a disc that touches y = 0 at x = 0, with finer cells there; by symmetry half of it."""

    def graded(s):
        return 0.12 * s + 0.88 * s**3

    def onto(points):
        x = 0.9 * RADIUS * graded(points[:, 0])
        arc = np.sqrt(RADIUS**2 - x**2)
        return np.c_[x, sign * (RADIUS - arc + arc * graded(points[:, 1]))]

    return moved(grid(count, count // 2, kind), onto)


def pressed_discs(upper, lower, friction=0.0):
    """Places of the contact nodes, their forces, and Hertz's half width and load."""
    mesh = together(("upper", half_disc(upper, 4, 1)), ("lower", half_disc(lower, 4, -1)))
    problem = fem.mesh_problem(
        mesh, young=E, poisson=NU, pairs=[("upper.bottom", "lower.bottom")], clamp="lower.top",
        symmetry=["upper.left", "lower.left"], displacement={"upper.top": ("free", -0.02)}, friction=friction,
    )  # fmt: skip
    (root,) = all_roots(problem, 0)
    order = np.argsort(problem.coordinates[:, 0])
    x, forces = problem.coordinates[order, 0], root.lambda_n[order]
    load = 2 * forces.sum()
    width = np.sqrt(4 * load * (RADIUS / 2) / (np.pi * E / (2 * (1 - NU**2))))
    assert np.max(np.abs(root.lambda_t)) < 0.03 * load  # mirror images of each other do not slip
    return x, forces, width, load


def off_hertz(x, forces, width, load):
    """Errors of the pressure within 0.8 b, relative to its peak, and of the force on (0, x), relative to all of it."""
    gaps = np.diff(x)
    pressure = forces / (np.append(gaps, 0) + np.append(0, gaps)) * 2
    peak, z = 2 * load / (np.pi * width), np.minimum(x / width, 1)
    carried = (np.arcsin(z) + z * np.sqrt(1 - z**2)) * load / np.pi
    summed = np.cumsum(forces) - forces / 2
    inside = x < 0.8 * width
    local = np.max(np.abs(pressure - peak * np.sqrt(1 - z**2))[inside]) / peak
    return local, np.max(np.abs(summed - carried)[x < width]) / (load / 2), pressure[0] / peak


@pytest.mark.slow
def test_two_discs_whose_meshes_match_converge_to_hertz():
    errors = []
    for count in (8, 16, 24):
        x, forces, width, load = pressed_discs(count, count)
        errors.append(off_hertz(x, forces, width, load)[:2])
        last = np.max(x[forces > 0])
        beyond = np.min(x[x > last])
        assert last < 1.1 * width < 1.2 * beyond  # the half width is known within a cell
    assert np.all(np.diff(errors, axis=0) < 0)
    assert np.all(np.array(errors[-1]) < 0.02)


@pytest.mark.slow
def test_two_discs_whose_meshes_do_not_match_carry_the_load_as_hertz_has_it():
    """Forces converge; from node to node they alternate about Hertz's pressure, as node to segment makes them."""
    local, summed, peak = off_hertz(*pressed_discs(24, 16, friction=0.3))
    assert summed < 0.02
    assert local < 0.1
    assert peak == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("kind", [3, 4, 9])
def test_a_pair_that_sticks_is_one_body(kind):
    """Pressed and pushed, with so much friction that nothing slips: displacements of the same mesh without a cut."""
    two, whole = blocks(kind, 2, 2), grid(2, 4, kind, 2.0, 2.0)
    load, spring, more = (0.05, -0.4), (1e-3, 1e-3), {"young": E, "poisson": NU, "friction": 50.0}
    pair = stacked(two, **more, clamp="lower.bottom", load={"upper.top": load}, spring={"upper.top": spring})
    (root,) = enumsol.enumerate_roots(pair, 0)
    assert {str(status) for status in root.statuses} == {"stick"}
    held = {"contact": "left", "clamp": "bottom", "gap": 100.0}
    body = fem.mesh_problem(whole, **more, **held, load={"top": load}, spring={"top": spring})
    free = body.mesh.displacements(body.factorization.solve(body.f))
    found = pair.mesh.displacements(root.u)
    for k, place in enumerate(two.points):
        node = int(np.argmin(np.linalg.norm(whole.points - place, axis=1)))
        assert np.allclose(whole.points[node], place)
        assert np.allclose(found[k], free[node], atol=1e-9)
