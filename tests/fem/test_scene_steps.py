"""Steps of a history of a scene against load vectors that are made by hand, and against problems of one step alone."""

from dataclasses import replace

import numpy as np
import pytest
from parted_solids import solid

import enumsol
from enumsol import fem

BLOCK = fem.rectangle(3, 2).parted()
GIVEN = {"young": 2.5, "poisson": 0.25, "clamp": "left", "contact": "bottom", "friction": 0.5}


def scene(**options):
    return fem.mesh_scene(BLOCK, **GIVEN | options)


def loads(made, steps):
    return [step.load for step in fem.scene_steps(made, steps)]


def by_hand(problem, forces):
    """The load of nodal forces (N, 2)."""
    return problem.mesh.motion.T @ np.ravel(forces)


def on(part, force):
    forces = np.zeros(BLOCK.points.shape)
    forces[BLOCK.nodes(part)] = force
    return forces


def test_forces_at_nodes_and_of_volumes_are_those_by_hand():
    problem = scene().problem()
    cells, total = BLOCK.cells, np.zeros(BLOCK.points.shape)
    sides = np.diff(BLOCK.points[cells], axis=1)
    areas = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
    np.add.at(total, cells, np.array([0.0, -3.0]) * areas[:, None, None] / 3)
    found = loads(scene(), [{"force": {"right": (0.1, -0.2)}}, {"body_force": (0.0, -3.0)}, {}])
    np.testing.assert_allclose(found[0], by_hand(problem, on("right", (0.1, -0.2))), atol=1e-14)
    np.testing.assert_allclose(found[1], by_hand(problem, total), atol=1e-14)
    assert not np.any(found[2])


def test_loads_on_facets_are_those_by_hand():
    problem, forces = scene().problem(), np.zeros(BLOCK.points.shape)
    for nodes in BLOCK.facets["top"]:
        forces[nodes] += np.linalg.norm(np.diff(BLOCK.points[nodes], axis=0)) / 2 * np.array([0.3, -2.0])
    found = loads(scene(), [{"load": {"top": (0.3, 0.0)}, "pressure": {"top": 2.0}}])
    np.testing.assert_allclose(found[0], by_hand(problem, forces), atol=1e-14)


def test_a_moment_is_that_of_the_forces_it_is_distributed_to():
    made = scene(reference={"tip": (1.0, 0.5)}, coupling={"tip": "right"})
    problem = made.problem()
    arms, (low, middle, high) = (
        BLOCK.points - (1.0, 0.5),
        sorted(BLOCK.nodes("right"), key=lambda k: BLOCK.points[k, 1]),
    )
    turned = np.stack([-arms[:, 1], arms[:, 0]], axis=1)  # by a rotation about the point
    shares = np.zeros((len(arms), 1))
    shares[[low, middle, high]] = [[0.25], [0.5], [0.25]]  # lengths of the boundary around
    plain, more = loads(made, [{"moment": {"tip": 0.7}}, {"force": {"tip": (0.2, 0.0)}, "moment": {"tip": 0.7}}])
    turning = 0.7 * shares * turned / np.sum(shares * turned**2)
    np.testing.assert_allclose(plain, by_hand(problem, turning), atol=1e-14)
    np.testing.assert_allclose(more, by_hand(problem, turning + shares * (0.2, 0.0)), atol=1e-14)


def test_a_displacement_acts_as_the_stiffness_says():
    made = scene(clamp=(), displacement={"top": (0.0, 0.0)})
    (found,) = loads(made, [{"displacement": {"top": (0.02, -0.01)}}])
    K = fem.stiffness(BLOCK.points, BLOCK.cells, fem.lame(2.5, 0.25))
    np.testing.assert_allclose(found, -by_hand(made.problem(), K @ on("top", (0.02, -0.01)).ravel()), atol=1e-14)


def test_a_temperature_is_what_balances_its_free_expansion():
    made = scene(
        clamp=(), contact="right", symmetry=["left"], spring={"top": (1.0, 0.0)}, expansion=1e-3, plane="stress"
    )
    (found,) = loads(made, [{"temperature": 40.0}])
    K = fem.stiffness(BLOCK.points, BLOCK.cells, fem.lame(2.5, 0.25, "stress"))
    free = 0.04 * BLOCK.points
    np.testing.assert_allclose(found, by_hand(made.problem(), K @ free.ravel()), atol=1e-14)


def test_a_step_adds_to_the_scene_by_names_and_its_alpha_multiplies_slopes():
    made = scene(force={"right": (0.0, -1.0)}, force_slope={"right": (2.0, 0.0)})
    problem = made.problem()
    steps = fem.scene_steps(made, [{"alpha": "1/2"}, {"alpha": 3, "force": {"top": (0.0, -4.0)}}])
    first = by_hand(problem, on("right", (1.0, -1.0)))
    second = by_hand(problem, on("right", (6.0, -1.0)) + on("top", (0.0, -4.0)))
    for step, load in zip(steps, (first, second), strict=True):
        np.testing.assert_allclose(step.load, load, atol=1e-14)
    assert fem.scene_steps(made, [{"alpha": 1}])[0].load is None  # no step gives a load
    with pytest.raises(enumsol.InvalidArgumentError, match="step 1: it has no alpha, on which its load depends"):
        fem.scene_steps(made, [{"force": {"right": (0, 0)}}])


def test_friction_by_parts_and_for_all():
    made = scene(clamp="top", contact=["bottom", "right"])
    steps = fem.scene_steps(made, [{"friction": {"bottom": 0.1, "right": 0.2}}, {"friction": 0.3}])
    assert sorted(set(steps[0].friction.tolist())) == [0.1, 0.2]
    assert steps[1].friction == 0.3
    with pytest.raises(enumsol.InvalidArgumentError, match="step 1: friction is not given for right"):
        fem.scene_steps(made, [{"friction": {"bottom": 0.1}}])


def test_friction_along_two_axes_in_3d():
    given = {**GIVEN, "friction": [0.3, 0.2]}
    made = fem.mesh_scene(solid((1, 1, 1), 8), **given)
    steps = fem.scene_steps(made, [{"friction": [0.1, 0.4]}, {"friction": {"bottom": [0.5, 0.6]}}, {}])
    problem = made.problem()
    for step, pair in zip(steps, ([0.1, 0.4], [0.5, 0.6]), strict=False):
        assert np.array_equal(step.friction, np.tile(pair, (problem.p, 1)))
        assert step.load is None
    assert problem.p == 2  # a pair is not taken as one coefficient for each node
    assert steps[2].friction is None


def test_the_history_ends_in_roots_of_the_last_load_alone():
    """Without friction there is no memory: each step has the roots of its load."""
    made = scene(friction=0.0)
    given = [{"pressure": {"top": 0.5}}, {"force": {"right": (0.0, 0.3)}}]
    history = enumsol.histories(made.problem(), fem.scene_steps(made, given))
    assert history.complete
    for number, step in enumerate(given, 1):
        alone = enumsol.enumerate_roots(scene(friction=0.0, **step).problem(), 0)
        (root,) = [node for node in history.graph if node[0] == number]
        assert np.allclose(history.root(root).u, alone[0].u, atol=1e-12)


WRONG = {
    "not a table": ([3], "step 1 is 3; expected some of alpha, friction, displacement"),
    "an option that is no load": ([{"young": 2.0}], "step 1 has young; expected some of alpha"),
    "what is held by a step": ([{"displacement": {"top": (0.0, 0.0)}}], "step 1: it changes what is held"),
    "a contact node": ([{}, {"displacement": {"edge": (0.0, -0.1)}}], "step 2: it changes which pairs are in contact"),
    "no such part": ([{"force": {"rihgt": (0, 1)}}], "step 1: .*rihgt"),
    "components": ([{"force": {"right": (0, 1, 2)}}], "step 1: force of right"),
    "no expansion": ([{"temperature": 1.0}], "step 1: temperature is given without expansion"),
    "alpha": ([{"alpha": "x"}], "step 1: alpha is 'x'"),
}


@pytest.mark.parametrize(("steps", "words"), WRONG.values(), ids=WRONG)
def test_what_cannot_be_a_step_is_refused(steps, words):
    edge = np.array([BLOCK.nodes("bottom")[1]])
    mesh = fem.PartedMesh(BLOCK.points, BLOCK.cells, BLOCK.facets, node_sets={"edge": edge})
    with pytest.raises((enumsol.InvalidArgumentError, enumsol.InvalidProblemError), match=words):
        fem.scene_steps(fem.mesh_scene(mesh, **GIVEN), steps)


def test_a_stiffness_of_another_code_is_refused():
    made = replace(scene(), stiffness=scene().problem().A)
    with pytest.raises(enumsol.InvalidArgumentError, match="the stiffness of the scene is of another code"):
        fem.scene_steps(made, [{}])
