"""Bodies in 2D that nothing but contact holds, from meshes with named parts: their rigid modes, and their solutions."""

import numpy as np
import pytest
from complete import proven_roots
from parted_meshes import grid
from refusals import bad_argument, bad_problem
from two_bodies import blocks

import enumsol
from enumsol import fem

STEEL = {"young": 2.5, "poisson": 0.25}
BLOCK = STEEL | {"contact": "bottom", "pressure": {"top": 0.1}, "friction": 0.5}


def solved(mesh, **options):
    """The problem with bodies that may move, and its roots, whose proof is checked."""
    problem = fem.mesh_problem(mesh, **options)
    roots = proven_roots(problem, 0)
    return problem, roots


def strains(problem):
    """How much the body resists its modes, relative to its stiffness."""
    return np.max(np.abs(problem.A @ problem.rigid_modes)) / np.max(np.abs(problem.A.data))


@pytest.mark.parametrize("kind", [3, 4, 6])
def test_a_block_on_a_table(kind):
    problem, roots = solved(grid(3, 2, kind), **BLOCK, max_rigid_displacement="auto")
    assert (problem.modes.r, problem.rigid_reach) == (3, 10.0)
    assert strains(problem) < 1e-14
    (root,) = roots
    assert root.lambda_n.sum() == pytest.approx(0.1, abs=1e-12)
    assert not roots.rigid_bound.needed


def test_as_springs_become_weaker_the_solution_tends_to_that_without_any():
    mesh = fem.rectangle(4, 2).parted()
    _, (free,) = solved(mesh, **BLOCK, load={"left": (0.03, 0.0)}, max_rigid_displacement="auto")
    far = []
    for k in (1e-3, 1e-5, 1e-7):
        held = fem.mesh_problem(mesh, **BLOCK, load={"left": (0.03, 0.0)}, spring={"top": (k, k)})
        (root,) = enumsol.enumerate_roots(held, 0)
        far.append(max(np.max(np.abs(root.lambda_n - free.lambda_n)), np.max(np.abs(root.u - free.u))))
    assert far[2] < 1e-6
    assert far[1] < 0.1 * far[0]


@pytest.mark.parametrize(("push", "count"), [(0.03, 1), (0.06, 0)])
def test_pushed_below_and_above_sliding(push, count):
    load = {"left": (push, 0.0)}
    _, roots = solved(fem.rectangle(4, 2).parted(), **BLOCK, load=load, max_rigid_displacement=7.0)
    assert len(roots) == count
    assert roots.rigid_bound.largest == 7.0


@pytest.mark.parametrize(
    ("supports", "count"),
    [
        ({"symmetry": "left"}, 1),
        ({"spring": {"left": (1.0, 0.0)}}, 1),
        ({"spring": {"left": (1.0, 1.0)}}, 0),
        ({"clamp": "left"}, 0),
    ],
)
def test_what_supports_leave_free(supports, count):
    """If anything, the vertical displacement."""
    problem, _ = solved(fem.rectangle(4, 2).parted(), **BLOCK, **supports, max_rigid_displacement="auto")
    assert (problem.modes.r) == count
    if count:
        moved = problem.mesh.displacements(problem.rigid_modes[:, 0])
        free = np.any(moved != 0, axis=1)
        assert np.all(moved[free] == moved[free][0] * [0, 1])
        assert strains(problem) < 1e-14


def test_a_body_held_at_one_node_turns_about_it():
    mesh = fem.rectangle(2, 2).parted()
    corner = fem.PartedMesh(mesh.points, mesh.cells, mesh.facets, {"corner": np.array([0])})
    problem = fem.mesh_problem(corner, **BLOCK, clamp="corner", max_rigid_displacement="auto")
    assert problem.modes.r == 1
    moved = problem.mesh.displacements(problem.rigid_modes[:, 0])
    turn = moved[-1, 1] / mesh.points[-1, 0]
    assert np.allclose(moved, turn * mesh.points[:, ::-1] * [-1, 1], atol=1e-14)


@pytest.mark.parametrize(("rollers", "count"), [(["upper.left"], 1), ([], 3)])
def test_a_body_on_another_one(rollers, count):
    """A constant pressure passes exactly; nothing but the other body holds the upper one."""
    given = {"pairs": [("upper.bottom", "lower.top")], "friction": 0.5, "pressure": {"upper.top": 0.1}}
    held = {"symmetry": ["lower.bottom", "lower.left", *rollers]}
    options = STEEL | {"poisson": 0.0} | given | held
    problem, roots = solved(blocks(3), **options, max_rigid_displacement="auto")
    assert problem.modes.r == count
    (root,) = roots
    assert root.lambda_n.sum() == pytest.approx(0.2, abs=1e-12)
    assert np.allclose(root.lambda_t, 0, atol=1e-12)
    assert root.u.min() == pytest.approx(-0.1 * 2 / 2.5, abs=1e-12)


@pytest.mark.parametrize(("supports", "count"), [([], 6), (["left"], 3), (["left", "front"], 1)])
def test_a_cube_on_a_table(supports, count):
    """Planes of symmetry leave three rigid motions of six, and the vertical one."""
    options = BLOCK | ({"symmetry": supports} if supports else {})
    problem = fem.mesh_problem(fem.box(1, 1, 1), **options, max_rigid_displacement="auto")
    assert problem.modes.r == count
    assert strains(problem) < 1e-14
    if count == 1:
        (root,) = enumsol.enumerate_roots(problem, 0)
        assert root.lambda_n.sum() == pytest.approx(0.1, abs=1e-12)


def test_what_is_refused():
    mesh = fem.rectangle(2, 2).parted()
    bad_problem("or max_rigid_displacement, if contact alone is to hold it", fem.mesh_problem, mesh, **BLOCK)
    for wrong in (0.0, -1, "much", float("nan")):
        bad_argument("max_rigid_displacement is", fem.mesh_problem, mesh, **BLOCK, max_rigid_displacement=wrong)
