"""Forces on nodes, and linear constraints between displacements: against closed forms and matrices by hand."""

import numpy as np
import pytest
from parted_meshes import grid
from refusals import bad_argument

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
