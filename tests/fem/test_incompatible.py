"""Incompatible modes: the patch test on distorted cells, and beams that bend as mechanics has it."""

import numpy as np
import pytest
from parted_meshes import constant_stress, grid
from parted_solids import NORMALS, solid
from refusals import bad_argument

from enumsol import fem

STEEL = {"young": 2.0, "poisson": 0.3, "friction": 0.2}
LAME = fem.lame(2.0, 0.3)


def test_constant_stress_on_distorted_hexahedra():
    mesh = solid((2, 2, 2), 8, shake=0.1)
    gradient = np.array([[0.2, -0.1, 0.3], [-0.1, 0.3, 0.0], [0.3, 0.0, 0.5]])
    loads = {name: constant_stress(gradient, LAME) @ normal for name, normal in NORMALS.items()}
    options = {**STEEL, "contact": "bottom", "load": loads, "spring": {"top": (1, 1)}}
    problem = fem.mesh_problem(mesh, **options, incompatible=True)
    plain = fem.mesh_problem(mesh, **options)
    u = (mesh.points @ gradient.T).ravel()
    assert np.allclose(problem.A @ u, plain.A @ u, rtol=0, atol=1e-13)
    assert abs(problem.A - plain.A).max() > 1e-2
    assert np.min(np.linalg.eigvalsh((plain.A - problem.A).toarray())) > -1e-12


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_cantilever_of_one_layer_bends_as_a_beam(dimension):
    """By beam mechanics F L^3 / (3 E I) + F L / (k G A); without the modes it is far too stiff."""
    mesh = grid(10, 1, 4, length=10.0) if dimension == 2 else fem.box(10, 1, 1, (10.0, 1.0, 1.0))
    down = (0.0, -1e-4) if dimension == 2 else (0.0, 0.0, -1e-4)
    options = {"young": 2.0, "poisson": 0.0, "friction": 0.2, "contact": "bottom", "clamp": "left"}
    options |= {"load": {"right": down}, "gap": 9.0} | ({"plane": "stress"} if dimension == 2 else {})
    tips = []
    for modes in (True, False):
        problem = fem.mesh_problem(mesh, **options, incompatible=modes)
        moved = problem.mesh.displacements(problem.factorization.solve(problem.f))
        tips.append(-moved[mesh.nodes("right"), -1].mean())
    beam = 1e-4 * 1000 / (3 * 2.0 / 12) + 1e-4 * 10 / (5 / 6)
    assert np.isclose(tips[0], beam, rtol=0.01)
    assert tips[1] < 0.8 * beam


def test_parts_that_have_them():
    mesh = grid(4, 1, 4)
    parted = fem.PartedMesh(mesh.points, mesh.cells, mesh.facets, bodies={"a": np.arange(2), "b": np.arange(2, 4)})
    options = {**STEEL, "contact": "bottom", "clamp": "top"}
    every = fem.mesh_problem(parted, **options, incompatible=["a", "b"])
    assert abs(every.A - fem.mesh_problem(parted, **options, incompatible=True).A).max() == 0
    assert abs(every.A - fem.mesh_problem(parted, **options, incompatible="a").A).max() > 1e-3
    bad_argument("no cells named 'c'", fem.mesh_problem, parted, **options, incompatible="c")
    around = {**options, "plane": "axisymmetric", "clamp": "right"}
    bad_argument("incompatible is given for an axisymmetric body", fem.mesh_problem, mesh, **around, incompatible=True)


def test_elements_of_decks_that_have_them(tmp_path):
    """All of such a type: without being told; the note on other formulations is for others."""
    points = "".join(f"{k + 1},{x},{y},{z}\n" for k, (x, y, z) in enumerate(fem.box(1, 1, 1).points))
    text = f"*NODE\n{points}*ELEMENT, TYPE=C3D8I, ELSET=ALL\n1,1,2,4,3,5,6,8,7\n*NSET, NSET=LID\n5,6,7,8\n"
    place = tmp_path / "cube.inp"
    for kind, noted in (("C3D8I", 0), ("C3D8R", 1)):
        place.write_text(text.replace("C3D8I", kind) + "*SURFACE, NAME=FLOOR\n1,S1\n")
        scene = fem.mesh_scene(place, young=1, poisson=0.3, contact="FLOOR", clamp="LID", friction=0.1)
        assert (scene.body.incompatible is None) == bool(noted)
        assert sum("are taken as" in note for note in scene.notes) == noted
