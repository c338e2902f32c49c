"""A new argument of a problem must not be forgotten by its fingerprint, its files, or `at_contact_nodes`."""

import dataclasses

import numpy as np
import pytest
import scipy.sparse as sp

from enumsol import BodyMesh, BranchGraph, branch_graph, gallery, read_problem, write_problem
from enumsol.model.problem3d import SlipMean


def plane_mesh(problem):
    return BodyMesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], sp.eye_array(6, problem.n))


def space_mesh(problem):
    return BodyMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]], sp.eye_array(12, problem.n))


#: Another value of every argument, for a body with one contact node; the last two are of a body that nothing holds.
DATA = {
    "A": lambda problem: 2 * problem.A,
    "Bn": lambda problem: 2 * problem.Bn,
    "f": lambda problem: problem.f + 1,
    "gap": lambda problem: problem.gap + 0.25,
    "friction": lambda problem: 0.25,
    "friction_slope": lambda problem: 0.5,
    "load_slope": lambda problem: np.arange(problem.n) + 1.0,
    "slip_offset": lambda problem: problem.slip_offset + 0.25,
    "rigid_modes": lambda problem: 2 * problem.rigid_modes,
    "max_rigid_displacement": lambda problem: 3.0,
    "mass": lambda problem: sp.eye_array(problem.n),
}
PLANE = DATA | {"Bt": lambda problem: 2 * problem.Bt}
SPACE = DATA | {
    "Bt1": lambda problem: 2 * problem.Bt1,
    "Bt2": lambda problem: 2 * problem.Bt2,
}
#: What no proof is about.
OTHERS = {
    "node_ids": lambda problem: ["a node"],
    "coordinates": lambda problem: np.full((1, 2), 0.5),
    "mesh": plane_mesh,
}
OTHERS_IN_SPACE = {
    "node_ids": lambda problem: ["a node"],
    "coordinates": lambda problem: np.full((1, 3), 0.5),
    "areas": lambda problem: [0.5],
    "mesh": space_mesh,
    "slip_mean": lambda problem: SlipMean(problem.Bt1, problem.Bt2, [[0.0, 0.0]], [[1.0]]),
}
BODIES = {"plane": gallery.one_node_triangle, "space": lambda: gallery.one_node_3d(friction=0.3)}
FREE = {"plane": lambda: gallery.block_on_table(1, 1), "space": gallery.block_on_table3d}
CHANGES = {"plane": PLANE | OTHERS, "space": SPACE | OTHERS_IN_SPACE}
CASES = [(name, argument) for name in BODIES for argument in CHANGES[name]]
HELD_BY_NOTHING = ("rigid_modes", "max_rigid_displacement")
#: What there are no graphs of: friction that depends on the slip, and in 3D bodies that nothing holds.
NOT_IN_GRAPHS = [("space", argument) for argument in ("slip_mean", *HELD_BY_NOTHING)]
#: What is condensed, or refused.
NOT_KEPT = {"A", "Bn", "Bt", "f", "load_slope", "mass", "mesh", *HELD_BY_NOTHING}


def changed(name, argument):
    """A problem, and the same with another value of one argument."""
    problem = (FREE if argument in HELD_BY_NOTHING else BODIES)[name]()
    kept = {"friction_slope": problem.friction_slope}  # without it replace refuses another friction
    return problem, problem.replace(**kept | {argument: CHANGES[name][argument](problem)})


def alike(one, other):
    """Whether two values of an argument are the same."""
    if sp.issparse(one):
        return (one != other).nnz == 0
    if isinstance(one, (BodyMesh, SlipMean)):
        matrix = "motion" if isinstance(one, BodyMesh) else "T1"
        return type(other) is type(one) and alike(getattr(one, matrix), getattr(other, matrix))
    if one is None or other is None:
        return one is other
    return np.array_equal(one, other)


@pytest.mark.parametrize("name", BODIES)
def test_there_is_another_value_of_every_argument(name):
    assert set(BODIES[name]().arguments) == set(CHANGES[name])


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_the_fingerprint_is_that_of_all_data(name, argument):
    problem, other = changed(name, argument)
    assert not alike(getattr(problem, argument), getattr(other, argument))
    assert (other.fingerprint == problem.fingerprint) == (argument in OTHERS | OTHERS_IN_SPACE)


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_files_keep_every_argument(name, argument, tmp_path):
    _, other = changed(name, argument)
    write_problem(other, tmp_path / "problem.npz")
    assert alike(getattr(other, argument), getattr(read_problem(tmp_path / "problem.npz"), argument))


@pytest.fixture(scope="module")
def graphs():
    return {name: branch_graph(body(), (0, 1)) for name, body in BODIES.items()}


@pytest.mark.parametrize(("name", "argument"), [case for case in CASES if case not in NOT_IN_GRAPHS])
def test_the_file_of_a_graph_keeps_every_argument(graphs, name, argument, tmp_path):
    _, other = changed(name, argument)
    dataclasses.replace(graphs[name], problem=other, vertices=(), arcs=()).save(tmp_path / "graph.json")
    found = BranchGraph.load(tmp_path / "graph.json").problem
    assert alike(getattr(other, argument), getattr(found, argument))


@pytest.mark.parametrize("argument", sorted(CHANGES["plane"].keys() - NOT_KEPT))
def test_a_problem_at_its_contact_nodes_keeps_what_is_not_condensed(argument):
    _, other = changed("plane", argument)
    assert alike(getattr(other, argument), getattr(other.at_contact_nodes(), argument))
