"""Axisymmetric bodies: constant strains, Lame's cylinders, press fits, discs, masses, and what is refused."""

import meshio
import numpy as np
import pytest
from parted_meshes import grid, moved
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import fem
from enumsol.io import read_problem, write_problem

E, NU = 2.0, 0.3
AROUND = {"young": E, "poisson": NU, "plane": "axisymmetric"}
#: In plane strain, for Lame's formulas.
FLAT, ACROSS = E / (1 - NU**2), NU / (1 - NU)


def ring(nr, ny, kind, inner, outer, height=1.0, shake=0.0):
    """A ring from one radius to another."""
    mesh = grid(nr, ny, kind, outer - inner, height, shake=shake)
    return moved(mesh, lambda points: points + np.array([inner, 0]))


@pytest.mark.parametrize("kind", [3, 4, 6, 8, 9, (3, 4)])
@pytest.mark.parametrize("inner", [0.0, 0.5])
def test_constant_strains(kind, inner):
    """A radial pressure on all sides and a pull along the axis: on distorted cells, too, strains are constant."""
    mesh = ring(3, 2, kind, inner, 2.0, shake=0.02 if kind == 8 else 0.08)
    pull = {"left": (0.4, 0), "right": (-0.4, 0), "top": (0, 0.3)}
    if inner == 0:
        del pull["left"]
    problem = fem.mesh_problem(mesh, **AROUND, load=pull, symmetry="bottom", contact="right", gap=9.0, friction=0.3)
    u = problem.factorization.solve(problem.f)
    radial = ((1 - NU) * -0.4 - NU * 0.3) / E
    along = (0.3 - 2 * NU * -0.4) / E
    expected = mesh.points * [radial, along]
    assert np.allclose(problem.mesh.displacements(u), expected, rtol=0, atol=1e-12)
    assert np.allclose(fem.cell_stresses(problem, u), np.diag([-0.4, 0.3, -0.4]), rtol=0, atol=1e-12)
    assert np.isclose(problem.f[problem.mesh.dofs % 2 == 1].sum(), 0.3 * np.pi * (4 - inner**2))


def lame_of(inner, outer, pressure):
    """Radial displacement at radii, of a thick cylinder in plane strain with a pressure inside."""
    scale = pressure * inner**2 / (FLAT * (outer**2 - inner**2))
    return lambda r: scale * ((1 - ACROSS) * r + (1 + ACROSS) * outer**2 / r)


def test_a_thick_cylinder_converges_to_lame():
    exact, errors = lame_of(1.0, 2.0, 0.1), []
    for count in (2, 4, 8):
        mesh = ring(count, 1, 8, 1.0, 2.0, 0.3)
        problem = fem.mesh_problem(
            mesh, **AROUND, symmetry=["bottom", "top"], pressure={"left": 0.1}, contact="right", gap=9.0, friction=0
        )
        u = problem.mesh.displacements(problem.factorization.solve(problem.f))
        errors.append(np.max(np.abs(u[:, 0] - exact(mesh.points[:, 0]))) / exact(1.0))
        assert np.allclose(u[:, 1], 0, atol=1e-14)
    assert errors[-1] < 2e-5
    assert np.all(np.array(errors[1:]) < np.array(errors[:-1]) / 6)
    hoop = fem.cell_stresses(problem, problem.factorization.solve(problem.f))[:, 2, 2]
    middles = np.array([mesh.points[cell, 0].mean() for cell in mesh.cells])
    assert np.allclose(hoop, 0.1 / 3 * (1 + 4 / middles**2), rtol=5e-3)


def two_rings(kind=9):
    inner, outer = ring(4, 2, kind, 1.0, 1.5, 0.4), ring(4, 2, kind, 1.5, 2.0, 0.4)
    count = len(inner.points)
    facets = {f"inner.{name}": part for name, part in inner.facets.items()}
    facets |= {f"outer.{name}": part + count for name, part in outer.facets.items()}
    return fem.PartedMesh(
        np.concatenate([inner.points, outer.points]), np.concatenate([inner.cells, outer.cells + count]), facets
    )


def test_a_press_fit_has_the_pressure_of_lame():
    sides = [f"{body}.{side}" for body in ("inner", "outer") for side in ("bottom", "top")]
    problem = fem.mesh_problem(
        two_rings(), **AROUND, symmetry=sides, pairs=[("inner.right", "outer.left", -0.01)], friction=0.0
    )
    root = enumsol.enumerate_roots(problem, 0)[0]
    a, b, c = 1.0, 1.5, 2.0
    soft = b / FLAT * ((c**2 + b**2) / (c**2 - b**2) + ACROSS + (b**2 + a**2) / (b**2 - a**2) - ACROSS)
    assert np.isclose(root.lambda_n.sum(), 0.01 / soft * 2 * np.pi * b * 0.4, rtol=1e-4)
    assert np.all(root.lambda_n > 0)


@pytest.mark.parametrize("kind", [4, 9])
def test_a_disc_on_its_foundation(kind, tmp_path):
    """Contact forces are those of the whole circumference, and files keep the body with its mass and stresses."""
    mesh = ring(4, 2, kind, 0.0, 2.0)
    options = {**AROUND, "contact": "bottom", "pressure": {"top": 0.2}, "friction": 0.0, "density": 3.0}
    scene = fem.mesh_scene(mesh, **options, max_rigid_displacement="auto")
    assert "area 12.5664" in str(scene)
    assert "1 rigid mode that nothing but contact holds" in str(scene)
    problem = scene.problem()
    assert problem.rigid_modes.shape[1] == 1
    held = fem.mesh_problem(mesh, **options, spring={"top": (1e-6, 1e-6)})
    root = enumsol.successive_approximations(held, 0)
    assert np.isclose(root.lambda_n.sum(), 0.2 * np.pi * 4, rtol=1e-5)
    assert np.all(root.lambda_n > 0)
    along = problem.mesh.dofs % 2 == 1
    assert np.isclose(along @ problem.mass @ along, 3.0 * np.pi * 4)
    write_problem(held, tmp_path / "disc.npz")
    again = read_problem(tmp_path / "disc.npz")
    assert again.mesh.axisymmetric
    assert np.array_equal(fem.cell_stresses(again, root.u), fem.cell_stresses(held, root.u))
    assert np.isclose(along @ again.mesh.mass() @ along, np.pi * 4)
    enumsol.write_vtu(again, root, tmp_path / "disc.vtu")
    stress = np.concatenate(meshio.read(tmp_path / "disc.vtu").cell_data["stress"])
    assert np.allclose(stress.reshape(-1, 3, 3)[:, 1, 1], -0.2, rtol=1e-4)


def test_what_is_no_axisymmetric_body():
    mesh = ring(2, 1, 4, 0.5, 1.0)
    given = {**AROUND, "contact": "bottom", "symmetry": "top", "friction": 0.2}
    bad_argument("a node at x = -0.5; expected x >= 0", fem.mesh_problem, ring(2, 1, 4, -0.5, 1.0), **given)
    bad_argument("thickness is given for an axisymmetric body", fem.mesh_problem, mesh, **given, thickness=2)
    solid = fem.box(1, 1, 1)
    bad_argument("plane is 'axisymmetric' of a body in 3D", fem.mesh_problem, solid, **given)
    parts = fem.PartedMesh(mesh.points, mesh.cells, mesh.facets, bodies={"a": [0], "b": [1]})
    planes = {"plane": {"a": "axisymmetric", "b": "strain"}}
    bad_argument(
        "expected axisymmetric for all parts of the body or for none", fem.mesh_problem, parts, **given | planes
    )
    disc = ring(2, 1, 4, 0.0, 1.0)
    moves = {"displacement": {"left": (0.1, "free")}}
    bad_argument("the axis of the axisymmetric body moves node", fem.mesh_problem, disc, **given, **moves)
    free = {name: value for name, value in given.items() if name != "symmetry"}
    bad_problem("the body is free to move as a rigid body", fem.mesh_problem, mesh, **free)


def test_axisymmetric_elements_of_decks(tmp_path):
    """They say themselves what they are."""
    text = "*NODE\n1,1,0\n2,2,0\n3,2,1\n4,1,1\n*ELEMENT, TYPE=CAX4, ELSET=ALL\n1,1,2,3,4\n*NSET, NSET=FLOOR\n1,2\n"
    text += "*NSET, NSET=LID\n3,4\n*SURFACE, NAME=BELOW\n1,S1\n"
    (tmp_path / "ring.inp").write_text(text)
    scene = fem.mesh_scene(tmp_path / "ring.inp", young=1, poisson=0.3, contact="BELOW", clamp="LID", friction=0.1)
    assert scene.body.axisymmetric
    assert "plane axisymmetric" in str(scene)


def cone_on_cone(height, taper, ny=6):
    """A hollow cone in another one, whose radii grow by a factor along the axis."""
    inner, outer = ring(3, ny, 9, 1.0, 1.5, height), ring(3, ny, 9, 1.5, 2.0, height)
    count = len(inner.points)
    facets = {f"inner.{name}": part for name, part in inner.facets.items()}
    facets |= {f"outer.{name}": part + count for name, part in outer.facets.items()}
    points = np.concatenate([inner.points, outer.points])
    points[:, 0] *= 1 + taper * (points[:, 1] - height / 2)
    return fem.PartedMesh(points, np.concatenate([inner.cells, outer.cells + count]), facets)


@pytest.mark.parametrize(("friction", "accuracy"), [(0.0, 1e-4), (0.1, 1e-3)])
def test_a_taper_has_the_pressure_of_lame_and_the_push_of_statics(friction, accuracy):
    """A push by d makes an interference of d tan(angle), less what the rings give way in shear."""
    height, taper, push = 4.0, 0.005, 0.05
    problem = fem.mesh_problem(
        cone_on_cone(height, taper), young=E, poisson=0.0, plane="axisymmetric", friction=friction,
        displacement={"inner.left": ("free", 0.0), "outer.right": ("free", push)},
        pairs=[("inner.right", "outer.left")],
    )  # fmt: skip
    roots = enumsol.enumerate_roots(problem, 0)
    assert roots.complete
    (root,) = roots
    a, b, c = 1.0, 1.5, 2.0
    slope = b * taper
    soft = b / E * ((c**2 + b**2) / (c**2 - b**2) + (b**2 + a**2) / (b**2 - a**2))
    sheared = b * np.log(c / a) / (E / 2) * (friction + slope)
    pressure = push * slope / (soft + slope * sheared)
    assert np.isclose(root.lambda_n.sum(), pressure * 2 * np.pi * b * height, rtol=accuracy)
    np.testing.assert_allclose(np.abs(root.lambda_t), friction * root.lambda_n, atol=1e-12)
    # what holds the inner cone at its bore is the push
    u = problem.mesh.displacements(root.u)
    angle = np.arctan(slope)
    push_force = root.lambda_n.sum() * (np.sin(angle) + friction * np.cos(angle))
    forces = (problem.contact_rows.T @ np.concatenate([root.lambda_n, root.lambda_t])) * (problem.mesh.dofs % 2 == 1)
    inner = np.isin(problem.mesh.dofs // 2, np.arange(len(u) // 2))
    assert np.isclose(abs(forces[inner].sum()), push_force, rtol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_valve_on_its_seat_carries_its_load_as_statics_has_it(friction):
    """A plug that is pressed into a rigid conical seat, and slides: N (sin + F cos) is the load."""
    plug = moved(grid(4, 3, 9, 1.0, 0.5), lambda points: points * np.stack([1 + points[:, 1], np.ones(len(points))], 1))
    problem = fem.mesh_problem(
        plug, **AROUND, contact="right", pressure={"top": 0.01}, friction=friction, max_rigid_displacement="auto"
    )
    roots = enumsol.enumerate_roots(problem, 0)
    assert roots.complete
    (root,) = roots
    normals = np.array([problem.Bn.toarray() @ (problem.mesh.dofs % 2 == k) for k in (0, 1)])
    np.testing.assert_allclose(normals[:, 0], np.array([1.0, -1.0]) / np.sqrt(2), atol=1e-12)
    pressed = root.lambda_n > 0
    assert np.all(np.abs(root.lambda_t[pressed]) == pytest.approx(friction * root.lambda_n[pressed]))
    load = 0.01 * np.pi * 1.5**2
    assert root.lambda_n.sum() * (1 + friction) / np.sqrt(2) == pytest.approx(load, rel=1e-10)
