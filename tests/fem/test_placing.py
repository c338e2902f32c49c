"""Several meshes in one scene, each turned and moved."""

import numpy as np
import pytest
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument, bad_problem
from two_bodies import shifted, together

from enumsol import fem

GIVEN = {"young": {"pad": 2.0, "disc": 4.0}, "poisson": 0.3, "friction": 0.2, "clamp": ["pad.top", "disc.bottom"]}
PAIR = {**GIVEN, "pairs": [("pad.bottom", "disc.top")], "load": {"pad.right": (-0.01, 0.0)}}


def test_two_meshes_are_the_same_as_one_of_both():
    pad, disc = grid(3, 1, 4), grid(2, 1, 4)
    whole = together(("pad", shifted(pad, (0.0, 1.0))), ("disc", disc))
    rows = {"pad": np.arange(3), "disc": np.arange(3, 5)}
    one = fem.mesh_problem(fem.PartedMesh(whole.points, whole.cells, whole.facets, {}, rows), **PAIR)
    placed = {"pad": {"mesh": pad, "move": (0.0, 1.0)}, "disc": disc}
    assert fem.mesh_problem(placed, **PAIR).fingerprint == one.fingerprint


def test_meshes_of_several_kinds_with_sets_of_nodes_and_bodies_are_joined():
    disc = fem.PartedMesh(
        *(getattr(grid(2, 1, 3), name) for name in ("points", "cells", "facets")), {"n": np.array([1])}
    )
    disc = fem.PartedMesh(disc.points, disc.cells, disc.facets, disc.node_sets, {"left": np.array([0, 1])})
    scene = fem.mesh_scene({"disc": disc, "pad": {"mesh": grid(3, 1, 4), "move": (0.0, 1.0)}}, **PAIR)
    mesh = scene.mesh
    assert mesh.node_sets["disc.n"].tolist() == [1]
    assert mesh.bodies["pad"].tolist() == [4, 5, 6]
    assert mesh.bodies["disc.left"].tolist() == [0, 1]
    assert "4 triangles, 3 quadrilaterals" in str(scene)
    assert scene.problem().p == 4


@pytest.mark.parametrize("angle", [90.0, 30.0, -180.0])
def test_a_mesh_is_turned_before_it_is_moved(angle):
    mesh = grid(2, 1, 4)
    scene = fem.mesh_scene(
        {"one": {"mesh": mesh, "turn": angle, "move": (3.0, -1.0)}},
        young=1,
        poisson=0,
        contact="one.bottom",
        friction=1,
    )
    z = (mesh.points @ [1, 1j]) * np.exp(1j * np.radians(angle)) + (3 - 1j)
    assert np.allclose(scene.mesh.points @ [1, 1j], z, rtol=0, atol=1e-14)
    if angle % 90 == 0:  # without rounding
        assert np.array_equal(scene.mesh.points, np.round(scene.mesh.points * 4) / 4)


def test_solids_are_turned_about_an_axis():
    mesh = solid((1, 1, 1), 8)
    placed = {"one": {"mesh": mesh, "turn": (1.0, 2.0, -0.5, 40.0)}}
    turned = fem.mesh_scene(placed, young=1, poisson=0, contact="one.bottom", friction=1).mesh.points
    axis = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    assert np.allclose(turned @ axis, mesh.points @ axis, rtol=0, atol=1e-14)
    Q = np.linalg.lstsq(mesh.points, turned, rcond=None)[0].T
    assert np.allclose(Q @ Q.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.isclose(np.trace(Q), 1 + 2 * np.cos(np.radians(40.0)))
    assert np.isclose(
        np.dot(axis, [Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1]]), 2 * np.sin(np.radians(40))
    )


def test_a_file_places_meshes(tmp_path):
    meshio = pytest.importorskip("meshio")
    for name, nx in (("pad", 3), ("disc", 2)):
        mesh = grid(nx, 1, 4)
        sides = [("line", mesh.facets[side]) for side in ("bottom", "top", "right")]
        data = {"gmsh:physical": [np.full(nx, 9), *(np.full(len(rows), k) for k, (_, rows) in enumerate(sides))]}
        data["gmsh:geometrical"] = data["gmsh:physical"]
        names = {"body": np.array([9, 2])} | {
            side: np.array([k, 1]) for k, side in enumerate(("bottom", "top", "right"))
        }
        points = np.c_[mesh.points, np.zeros(len(mesh.points))]
        made = meshio.Mesh(points, [("quad", mesh.cells), *sides], cell_data=data, field_data=names)
        made.write(tmp_path / f"{name}.msh", "gmsh22", binary=False)
    text = (
        "mesh = {pad = {mesh = 'pad.msh', move = [0, 1]}, disc = 'disc.msh'}\nyoung = {pad = 2.0, disc = 4.0}\n"
        "poisson = 0.3\nfriction = 0.2\nclamp = ['pad.top', 'disc.bottom']\npairs = [['pad.bottom', 'disc.top']]\n"
        "load.'pad.right' = [-0.01, 0.0]\n"
    )
    (tmp_path / "both.toml").write_text(text)
    direct = fem.mesh_problem({"pad": {"mesh": grid(3, 1, 4), "move": (0, 1)}, "disc": grid(2, 1, 4)}, **PAIR)
    assert fem.read_mesh_problem(tmp_path / "both.toml").fingerprint == direct.fingerprint
    (tmp_path / "both.toml").write_text(text.replace("disc = 'disc.msh'", "disc = {move = [0, 1]}"))
    bad_problem("both.toml: mesh is .*expected the name of a mesh file", fem.read_mesh_problem, tmp_path / "both.toml")


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        ({}, "mesh is {}; expected names with their meshes"),
        ({"a": {"move": (0, 1)}}, "mesh a is .*; expected a mesh, and where wanted move and turn"),
        (
            {"a": {"mesh": grid(1, 1, 4), "shift": (0, 1)}},
            "mesh a is .*; expected a mesh, and where wanted move and turn",
        ),
        ({"a": {"mesh": grid(1, 1, 4), "move": 1}}, "move of a is 1; expected two finite numbers"),
        ({"a": {"mesh": grid(1, 1, 4), "turn": (0, 0, 1, 90)}}, "turn of a is .*; expected an angle in degrees"),
        (
            {"a": {"mesh": solid((1, 1, 1), 8), "turn": 90}},
            "turn of a is 90; expected an angle in degrees, in 3D after",
        ),
        ({"a": grid(1, 1, 4), "b": solid((1, 1, 1), 8)}, "mesh has plane meshes and meshes in 3D"),
    ],
)
def test_what_places_no_mesh_is_refused(mesh, message):
    bad_argument(message, fem.mesh_problem, mesh, young=1, poisson=0.3, contact="a.bottom")
