"""Forces on nodes, and linear constraints between displacements: against closed forms and matrices by hand."""

import numpy as np
import pytest
from alike import assert_close
from parted_meshes import grid
from refusals import bad_argument
from two_bodies import blocks, stacked

import enumsol
from enumsol import fem

STEEL = {"young": 2.0, "poisson": 0.3, "contact": "bottom", "friction": 0.3}


def with_nodes(mesh, **sets):
    return fem.PartedMesh(mesh.points, mesh.cells, mesh.facets, {name: np.array(own) for name, own in sets.items()})


# -- forces on nodes ---------------------------------------------------------------------------------------------------


def test_a_force_acts_on_each_node_of_a_part_or_a_set_and_is_not_multiplied_by_the_thickness():
    mesh = with_nodes(grid(3, 2, 4), corner=[11], two=[9, 11])
    thick = {**STEEL, "clamp": "left", "thickness": 5.0}
    plain = fem.mesh_problem(mesh, **thick)
    forces = {"corner": (0.5, -1.0), "two": (0.0, 2.0), "right": (0.25, 0.0)}
    problem = fem.mesh_problem(mesh, **thick, force=forces, force_slope={"corner": (3.0, 4.0)})
    expected = np.zeros((12, 2))
    expected[[3, 7, 11]] += (0.25, 0.0)
    expected[[9, 11]] += (0.0, 2.0)
    expected[11] += (0.5, -1.0)
    assert np.array_equal((problem.mesh.motion @ problem.f).reshape(-1, 2)[[3, 7, 9, 11]], expected[[3, 7, 9, 11]])
    assert problem.f.sum() == plain.f.sum() + expected.sum()
    slope = (problem.mesh.motion @ problem.load_slope).reshape(-1, 2)
    assert np.array_equal(slope[11], (3.0, 4.0))
    assert np.count_nonzero(slope) == 2


def test_a_body_force_times_alpha_is_a_slope_of_the_load():
    mesh = grid(3, 2, 4)
    weight = fem.mesh_problem(mesh, **STEEL, clamp="left", body_force=(0.1, -1.0))
    growing = fem.mesh_problem(mesh, **STEEL, clamp="left", body_force_slope=(0.1, -1.0))
    assert np.array_equal(growing.load_slope, weight.f)
    assert not np.any(growing.f)


def test_a_force_on_contact_nodes_gets_a_note():
    (note,) = fem.mesh_scene(
        with_nodes(grid(3, 2, 4), foot=[2]), **STEEL, clamp="left", force={"foot": (0.0, -0.01)}
    ).notes
    assert note == "force of foot acts on contact nodes"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"force": {"tip": (1.0,)}}, r"force of tip is \(1.0,\); expected two finite numbers"),
        ({"force": {"top": (1.0, 2.0, 3.0)}}, "force of top is .*; expected two finite numbers"),
        ({"force_slope": {"nowhere": (1.0, 2.0)}}, "no facets or nodes named 'nowhere'"),
        ({"force": (1.0, 2.0)}, r"force is \(1.0, 2.0\); expected names of parts with their values"),
        ({"body_force_slope": (1.0,)}, "body_force_slope is .*; expected two finite numbers"),
    ],
)
def test_wrong_conditions_are_refused(changes, message):
    bad_argument(message, fem.mesh_problem, with_nodes(grid(3, 2, 4), tip=[11]), **STEEL, clamp="left", **changes)


# -- displacements that grow with alpha --------------------------------------------------------------------------------


def displaced(alpha, growing, make, **more):
    """A problem with a displacement at one alpha, or with its slope."""
    name, scale = ("displacement_slope", 1.0) if growing else ("displacement", alpha)
    given = {part: tuple(value if value == "free" else scale * value for value in own) for part, own in more.items()}
    return make({name: given})


def same_root_at(alpha, make, **displacements):
    """The root with a slope is that of the displacement at this alpha, on all nodes, with its stresses."""
    growing, fixed = (displaced(alpha, which, make, **displacements) for which in (True, False))
    (one,) = enumsol.enumerate_roots(growing, alpha)
    (two,) = enumsol.enumerate_roots(fixed, alpha)
    assert growing.depends_on_alpha
    assert np.isclose(one.u[-1], alpha, rtol=1e-14)
    moved = [problem.mesh.displacements(root.u) for problem, root in ((growing, one), (fixed, two))]
    assert np.allclose(*moved, rtol=0, atol=1e-12)
    assert_close(one, two, "lambda_n", "lambda_t", "u_n", "u_t", atol=1e-12)
    assert np.allclose(fem.cell_stresses(growing, one.u), fem.cell_stresses(fixed, two.u), rtol=0, atol=1e-11)
    assert two.lambda_n.sum() > 0
    return growing


def test_a_displacement_times_alpha_presses_a_block_down():
    def block(more):
        return fem.mesh_problem(grid(3, 2, 4), **STEEL, friction_slope=0, **more)

    problem = same_root_at(0.02, block, top=(0.5, -1.0))
    # held components would push the load on the nodes beside them; the last unknown has no part in any motion
    assert problem.inertia[[-1]].count_nonzero() == 1


@pytest.mark.parametrize("name", ["upper.top", "lower.top"])
def test_a_pair_follows_a_side_that_moves_with_alpha(name):
    """Also where the contact rows themselves move: the faced nodes, all of them given."""

    def pair(more):
        ((kind, own),) = more.items()
        held = "lower.bottom" if name == "upper.top" else "upper.top"
        return stacked(blocks(4, 3, 2), young=2.0, poisson=0.3, clamp=[held], friction=0.2, **{kind: own})

    same_root_at(0.05, pair, **{name: (0.3, -1.0) if name == "upper.top" else (0.3, 1.0)})


def test_displacements_and_their_slopes_add_up():
    given = {"displacement": {"top": (0.01, "free")}, "displacement_slope": {"top": ("free", -1.0)}}
    problem = fem.mesh_problem(grid(3, 2, 4), **STEEL, **given)
    moved = [problem.mesh.displacements(np.eye(problem.n)[-1] * alpha)[-4:] for alpha in (0.0, 2.0)]
    assert np.array_equal(moved[0], np.tile((0.01, 0.0), (4, 1)))
    assert np.array_equal(moved[1], np.tile((0.01, -2.0), (4, 1)))
    refused = {"displacement": {"right": ("free", 0.0)}, "displacement_slope": {"top": (0.0, -1.0)}}
    message = "top moves node 11 by -1 alpha in y, and another part that shares it by 0 alpha; expected one"
    bad_argument(message, fem.mesh_problem, grid(3, 2, 4), **STEEL, **refused)


def test_contact_nodes_that_move_with_alpha_where_nothing_follows_are_refused():
    mesh = grid(3, 2, 4)
    bad_argument(
        "contact node 0 is held or displaced in some components only",
        fem.mesh_problem, mesh, **STEEL, spring={"top": (1, 1)}, displacement_slope={"left": (1.0, "free")},
    )  # fmt: skip
