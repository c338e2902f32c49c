"""Thermal strain against closed forms: free bodies, and bodies between walls, in the plane, around an axis, in 3D."""

import numpy as np
import pytest
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument

import enumsol
from enumsol import fem
from enumsol.io import read_problem, write_problem

E, NU, EXPANSION, WARM = 2.0, 0.3, 1e-3, 40.0
STEEL = {"young": E, "poisson": NU, "expansion": EXPANSION, "friction": 0.0}
FREE = EXPANSION * WARM
SOLID, FLAT = (2, 2, 2), (3, 2)


def at_rest(mesh, **options):
    """The displacements of all nodes and the stresses of the cells, far from contact."""
    problem = fem.mesh_problem(mesh, **{**STEEL, "contact": "right", "gap": 9.0, **options})
    u = problem.factorization.solve(problem.f)
    return problem.mesh.displacements(u), fem.cell_stresses(problem, u)


@pytest.mark.parametrize("kind", [4, 6, 8, 27])
def test_a_free_solid_has_no_stress(kind):
    mesh = solid(SOLID, kind, shake=0.05)
    moved, stress = at_rest(mesh, temperature=WARM, symmetry=["left", "front", "bottom"])
    assert np.allclose(moved, FREE * mesh.points, rtol=0, atol=1e-13)
    assert np.allclose(stress, 0, atol=1e-13)


@pytest.mark.parametrize(("plane", "factor"), [("strain", 1 + NU), ("stress", 1.0), ("axisymmetric", 1.0)])
@pytest.mark.parametrize("kind", [3, 8])
def test_a_free_plate_has_no_stress(plane, factor, kind):
    """In plane strain none in the plane."""
    mesh = grid(*FLAT, kind, shake=0.05)
    moved, stress = at_rest(mesh, plane=plane, temperature=WARM, symmetry=["left", "bottom"])
    assert np.allclose(moved, factor * FREE * mesh.points, rtol=0, atol=1e-13)
    assert np.allclose(stress, 0, atol=1e-13)


def test_a_bar_between_walls():
    """It closes its gap, and presses with what is left of its expansion; what is held on all sides has no strain."""
    mesh = grid(4, 1, 4, length=2.0)
    options = {**STEEL, "plane": "stress", "symmetry": ["left", "bottom"], "temperature": WARM, "thickness": 0.5}
    problem = fem.mesh_problem(mesh, **options, contact="right", gap=0.03)
    root = enumsol.enumerate_roots(problem, 0)[0]
    assert np.isclose(root.lambda_n.sum(), 0.5 * E * (FREE - 0.03 / 2.0), rtol=1e-10)
    assert np.allclose(fem.cell_stresses(problem, root.u)[:, 0, 0], -E * (FREE - 0.03 / 2.0))
    box = solid((2, 2, 2), 10)
    sides = ["left", "right", "front", "back", "bottom"]
    problem = fem.mesh_problem(box, **STEEL, temperature=WARM, symmetry=sides, contact="top")
    root = enumsol.successive_approximations(problem, 0)
    assert np.allclose(fem.cell_stresses(problem, root.u), -E * FREE / (1 - 2 * NU) * np.eye(3), rtol=1e-8)
    assert np.isclose(root.lambda_n.sum(), E * FREE / (1 - 2 * NU), rtol=1e-8)


def test_a_temperature_that_grows_with_alpha(tmp_path):
    """The bar between walls, from a file, too: the last entry of u is alpha."""
    mesh = grid(4, 1, 4, length=2.0)
    options = {**STEEL, "plane": "stress", "symmetry": ["left", "bottom"], "contact": "right", "gap": 0.03}
    problem = fem.mesh_problem(mesh, **options, temperature=WARM / 4, temperature_slope=WARM)
    write_problem(problem, tmp_path / "bar.npz")
    for body, alpha in ((problem, 0.5), (problem, 2.0), (read_problem(tmp_path / "bar.npz"), 1.0)):
        root = enumsol.enumerate_roots(body, alpha)[0]
        pressed = E * max((0.25 + alpha) * FREE - 0.03 / 2.0, 0.0)
        assert np.isclose(root.lambda_n.sum(), pressed, rtol=1e-10)
        assert np.isclose(root.u[-1], alpha)
        assert np.allclose(fem.cell_stresses(body, root.u)[:, 0, 0], -pressed)
    assert "temperature_slope 40" in str(fem.mesh_scene(mesh, **options, temperature_slope=WARM))
    graph = enumsol.branch_graph(problem, (0, 2))
    graph.save(tmp_path / "graph.json")
    assert np.array_equal(
        enumsol.BranchGraph.load(tmp_path / "graph.json").problem.mesh.stress_slope, problem.mesh.stress_slope
    )


def test_a_history_of_warming_is_that_of_its_alphas():
    """Steps by the temperature and steps by its slope have the same loads but for alpha itself, and the same roots."""
    mesh = grid(4, 1, 4, length=2.0)
    options = {**STEEL, "plane": "stress", "symmetry": ["left", "bottom"], "contact": "right", "gap": 0.03}
    cold = fem.mesh_scene(mesh, **options)
    warm = fem.mesh_problem(mesh, **options, temperature_slope=WARM)
    by_steps = fem.scene_steps(cold, [{"temperature": WARM / 2}, {"temperature": WARM}])
    by_alpha = enumsol.histories(warm, ["1/2", 1])
    for step, alpha in zip(by_steps, (0.5, 1.0), strict=True):
        assert np.allclose(step.load, warm.load_at(alpha)[:-1], atol=1e-15)
    found = enumsol.histories(cold.problem(), by_steps)
    assert found.complete
    assert by_alpha.complete
    for node in [(1, 0), (2, 0)]:
        assert np.allclose(found.root(node).u, by_alpha.root(node).u[:-1])


def test_a_linear_temperature_bends_a_free_body_without_stress():
    mesh = solid((2, 2, 2), 27)
    x, y, z = mesh.points.T
    moved, stress = at_rest(mesh, temperature=WARM * z, symmetry=["left", "front"], spring={"bottom": (1e-9, 0)})
    assert np.allclose(stress, 0, atol=1e-8)
    assert np.allclose(moved[:, 0], FREE * x * z, atol=1e-6)
    assert np.ptp(moved[:, 2] - FREE * (z**2 - x**2 - y**2) / 2) < 1e-6


def test_temperatures_by_parts(tmp_path):
    """Of the body and of its nodes; a warm part in a cold one is a press fit."""
    mesh = grid(4, 2, 4, length=2.0)
    half = {"warm": np.array([0, 1, 4, 5]), "cold": np.array([2, 3, 6, 7])}
    nodes = {"end": np.flatnonzero(mesh.points[:, 0] < 1.01)}
    parted = fem.PartedMesh(mesh.points, mesh.cells, mesh.facets, nodes, half)
    given = {"plane": "stress", "symmetry": ["left", "bottom"]}
    moved, stress = at_rest(parted, temperature={"warm": WARM}, **given)
    other, _ = at_rest(parted, temperature={"warm": WARM, "cold": 0.0}, **given)
    assert np.array_equal(moved, other)
    right = np.isclose(mesh.points[:, 0], 2)
    assert np.isclose(moved[right, 0].mean(), FREE, rtol=0.1)
    assert np.max(np.abs(stress)) > 0.1 * E * FREE
    uniform, _ = at_rest(parted, temperature=np.full(len(mesh.points), WARM), **given)
    assert np.allclose(uniform, FREE * mesh.points, atol=1e-13)
    by_nodes, _ = at_rest(parted, temperature={"end": WARM}, **given)
    assert FREE < by_nodes[right, 0].mean() < 1.5 * FREE  # it falls to none within one cell
    several = {**STEEL, "expansion": {"warm": EXPANSION, "cold": 2 * EXPANSION}, "contact": "right", **given}
    scene = fem.mesh_scene(parted, **several, temperature=WARM)
    assert "expansion 0.001 (warm), 0.002 (cold)" in str(scene)
    assert "temperature 40" in str(scene)
    problem = scene.problem()
    write_problem(problem, tmp_path / "bar.npz")
    u = problem.factorization.solve(problem.f)
    again = read_problem(tmp_path / "bar.npz")
    assert np.array_equal(fem.cell_stresses(again, u), fem.cell_stresses(problem, u))


def test_bad_temperatures():
    mesh = grid(*FLAT, 4)
    mesh = fem.PartedMesh(mesh.points, mesh.cells, mesh.facets, bodies={"all": np.arange(6)})
    given = {**STEEL, "contact": "right", "clamp": "left"}
    message = r"temperature has shape \(3,\); expected a number, \(12,\) for all nodes"
    bad_argument(message, fem.mesh_problem, mesh, **given, temperature=[1, 2, 3])
    mixed = {"all": 1.0, "top": 2.0}
    bad_argument("given for all, a part of the body, and for top", fem.mesh_problem, mesh, **given, temperature=mixed)
    bad_argument("no facets named 'lid'", fem.mesh_problem, mesh, **given, temperature={"lid": 1.0})
    cold = {**given, "expansion": None}
    bad_argument("temperature is given without expansion", fem.mesh_problem, mesh, **cold, temperature=1.0)
