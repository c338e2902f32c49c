"""A pair as friction, once F(alpha) = F0 + alpha F1 in 2D, is refused wherever it can be given; what replaces it."""

import shlex

import meshio
import numpy as np
import pytest
from plain_arrays import DENSE
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import ContactProblem, fem, gallery
from enumsol.cli import main

MESH = fem.rectangle(2, 1).parted()
SCENE = {"young": 2.5, "poisson": 0.25, "contact": "bottom", "clamp": "top"}
#: What problems said their fingerprints were when friction=(F0, F1) was F0 + alpha F1, as proofs and files still do.
FINGERPRINTS = [
    ({}, "b4e4e7c4d2a3b73dd2c347bfb7c0f70264f64f7e4ee69d4e892865bab0594ad5"),
    ({"friction": 0.25}, "03c249d7894d8c8127aaa0de0aea0d9532847ff0fddfb9b337f0570ec20c6d01"),
    (
        {"friction": 0.25, "friction_slope": 0.5},
        "8af2af730beb16e6da550bb62ffa2e122ccd5b9f3dd798e68997f96c08e25732",
    ),
    (
        {"friction": np.array([0.25, 1.0]), "friction_slope": [0.5, 0.0]},
        "8e47044556c60e42d8dc7f1d498efde91f0056d429b0c4a3935ade9698f15ae7",
    ),
]


@pytest.mark.parametrize(("given", "fingerprint"), FINGERPRINTS)
def test_fingerprints_are_what_they_were(given, fingerprint):
    assert ContactProblem(**DENSE, **given).fingerprint == fingerprint


def test_what_is_not_given_is_zero_and_without_both_friction_is_alpha():
    default, slope, both = (
        ContactProblem(**DENSE, **given) for given in ({}, {"friction_slope": 1}, {"friction": 0.5})
    )
    assert default.fingerprint == slope.fingerprint
    assert [part.tolist() for part in default.affine_friction] == [[0, 0], [1, 1]]
    assert [part.tolist() for part in both.affine_friction] == [[0.5, 0.5], [0, 0]]
    assert default.friction_at(3).tolist() == [3, 3]


@pytest.mark.parametrize("kind", [tuple, list])
def test_a_pair_is_refused_by_what_makes_problems_in_2d(kind):
    pair, write = kind((0, 1)), r"for F\(alpha\) = 0 \+ 1 alpha write friction=0 and friction_slope=1"
    bad_argument(f"expected one coefficient.*: {write}$", gallery.dovetail, friction=pair)
    bad_problem(write, gallery.two_node_square, friction=pair)
    bad_problem(write, gallery.one_node_triangle().replace, friction=pair, friction_slope=0)
    bad_problem(
        write, fem.contact_problem, MESH.points, MESH.cells, (1, 1), contact=MESH.facets["bottom"].ravel()[:1],
        normals=(0, -1), held=np.unique(MESH.facets["top"]), friction=pair,
    )  # fmt: skip


@pytest.mark.parametrize("pair", [(0.5, 1), [0.5, 1.0], ([0.5, 0.5], 1), (np.ones(2), np.zeros(2))])
def test_a_pair_is_refused_where_there_are_two_nodes_which_an_array_is_for(pair):
    message = r"friction_slope=.*, for coefficients of two contact nodes friction=np\.array"
    for given in ({}, {"friction_slope": 0.0}):
        bad_problem(message, ContactProblem, **DENSE, friction=pair, **given)
    assert ContactProblem(**DENSE, friction=np.array([0.5, 1.0])).friction_at(7).tolist() == [0.5, 1.0]


def test_another_coefficient_does_not_take_over_a_slope_unseen():
    for problem in (gallery.one_node_triangle(), gallery.block3d(1, 1, 1)):
        bad_problem("friction is given without friction_slope", problem.replace, friction=0.5)
        assert not problem.replace(friction=0.5, friction_slope=0).depends_on_alpha
    constant = gallery.one_node_triangle().replace(friction=0.25, friction_slope=0).replace(friction=0.5)
    assert [part.tolist() for part in constant.affine_friction] == [[0.5], [0]]
    assert gallery.one_node_triangle().replace(gap=1.0).friction_slope.tolist() == [1]


@pytest.mark.parametrize(
    ("given", "found", "write"),
    [
        ({"friction": (0.5, 1)}, "friction is the pair", "friction=0.5 and friction_slope=1"),
        (
            {"friction": {"bottom": [0.5, 1]}},
            "friction of bottom is the pair",
            'friction={"bottom": 0.5} and friction_slope={"bottom": 1}',
        ),
    ],
)
def test_a_pair_is_refused_in_plane_scenes(given, found, write):
    message = rf"{found}.*; expected one coefficient: for F\(alpha\) = 0.5 \+ 1 alpha write {write}$"
    for make in (fem.mesh_problem, fem.mesh_scene):
        bad_argument(message, make, MESH, **SCENE, **given)


def test_a_pair_is_two_axes_in_space():
    def both(**given):
        problem = fem.mesh_problem(fem.box(1, 1, 1), **SCENE, **given)
        return problem.fingerprint

    assert both(friction=(0.5, 0.25)) == both(friction=0.5, friction2=0.25)
    assert both(friction={"bottom": [0.5, 0.25]}) == both(friction={"bottom": 0.5}, friction2={"bottom": 0.25})
    assert both(friction=(0.5, 0.25), friction_slope=1) == both(
        friction=0.5, friction_slope=1, friction2=0.25, friction2_slope=1
    )
    assert both(friction=0.5, friction_slope=(1, 2)) == both(
        friction=0.5, friction_slope=1, friction2=0.5, friction2_slope=2
    )
    solid = fem.box(1, 1, 1)
    bad_argument(
        "friction is a pair, and friction2 is given", fem.mesh_problem, solid, **SCENE, friction=(1, 2), friction2=1
    )
    bad_argument(
        r"friction2 is the pair \(0.5, 1\); expected one coefficient$",
        fem.mesh_problem,
        solid,
        **SCENE,
        friction2=(0.5, 1),
    )


def test_scenes_take_slopes_by_part_and_along_both_axes():
    def parts(**given):
        problem = fem.mesh_problem(fem.box(1, 1, 1), **SCENE, **given)
        return [[float(axis[0]) for axis in part] for part in (problem.friction, problem.friction_slope)]

    assert parts() == parts(friction_slope=1) == [[0, 0], [1, 1]]
    assert parts(friction=0.5, friction_slope={"bottom": 2}) == [[0.5, 0.5], [2, 2]]
    assert parts(friction=0.5, friction_slope=2, friction2=0.25) == [[0.5, 0.25], [2, 0]]
    assert parts(friction=0.5, friction2=0.25, friction2_slope=3) == [[0.5, 0.25], [0, 3]]
    assert parts(friction={"bottom": 0.5}, friction2_slope={"bottom": 3}) == [[0.5, 0], [0, 3]]
    bad_argument("friction2_slope is given for a plane body", fem.mesh_problem, MESH, **SCENE, friction2_slope=1)
    bad_argument("friction_slope is the pair .*; expected one", fem.mesh_problem, MESH, **SCENE, friction_slope=(0, 1))


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A directory with a mesh of a block."""
    monkeypatch.chdir(tmp_path)
    cells = [("quad", [[0, 1, 2, 3]]), ("line", [[0, 1]]), ("line", [[2, 3]])]
    data = {"part": [[0], [1], [2]]}
    meshio.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], cells, cell_data=data).write("block.vtu")
    return tmp_path


def in_words(capsys, *command):
    assert main([*command]) == 2
    return " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("friction = [0, 1]", "friction = 0\nfriction_slope = 1"),
        ("friction.1 = [0.25, 0.5]", "friction.1 = 0.25\nfriction_slope.1 = 0.5"),
    ],
)
def test_a_pair_in_a_toml_file_is_refused_in_its_words(here, capsys, old, new):
    text = "mesh = 'block.vtu'\ngroups = 'part'\nyoung = 2.5\npoisson = 0.25\nclamp = '2'\ncontact = '1'\n"
    (here / "old.toml").write_text(text + old)
    (here / "new.toml").write_text(text + new)
    write = " and ".join(new.split("\n"))
    for read in (fem.read_mesh_problem, fem.read_mesh_scene):
        assert str(bad_problem("old.toml: friction.* is the pair", read, "old.toml")).endswith(f"alpha write {write}")
    for command in (("solve", "old.toml", "--dry-run"), ("roots", "old.toml", "--alpha", "1")):
        assert write in in_words(capsys, *command)
    assert fem.read_mesh_problem("new.toml").depends_on_alpha


@pytest.mark.parametrize(
    ("old", "new"),
    [("0,1", ("0", "1")), ("1=0.25,0.5", ("1=0.25", "1=0.5"))],
)
def test_a_pair_on_the_command_line_is_refused_in_its_words(here, capsys, old, new):
    command = shlex.split("solve block.vtu --groups part --young 2.5 --poisson 0.25 --clamp 2 --contact 1 -o p.npz")
    write = "--friction {} and --friction-slope {}".format(*new)
    assert f"alpha write {write}" in in_words(capsys, *command, "--friction", old)
    assert main([*command, *write.replace(" and", "").split()]) == 0
    F0, F1 = (float(number.rpartition("=")[2]) for number in new)
    assert enumsol.read_problem("p.npz").friction_at(1).tolist() == [F0 + F1] * 2
