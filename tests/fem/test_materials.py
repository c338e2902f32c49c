"""Materials, thickness, friction and gaps by named parts: closed forms, and the same by arrays."""

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import only_root
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument
from two_bodies import shifted, together

import enumsol
from enumsol import fem

STEEL = {"young": 2.0, "poisson": 0.3}
KINDS = (3, 8, 9, (3, 4))


def halves(mesh, axis=1):
    """The mesh with its cells below and above the middle as bodies named pad and disc."""
    centres = mesh.points[mesh.cells].mean(axis=1)[:, axis]
    low = centres < np.mean(mesh.points[:, axis])
    bodies = {"pad": np.flatnonzero(low), "disc": np.flatnonzero(~low)}
    return type(mesh)(mesh.points, mesh.cells, mesh.facets, mesh.node_sets, bodies)


def in_series(young, poisson, plane="strain"):
    """Modulus of two layers of equal height that cannot widen."""
    moduli = [np.dot(fem.lame(young[part], poisson[part], plane), (1, 2)) for part in young]
    return 2 / sum(1 / modulus for modulus in moduli)


PAD_AND_DISC = {"young": {"pad": 5e3, "disc": 2e5}, "poisson": {"pad": 0.45, "disc": 0.3}}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_two_materials_one_above_the_other(kind, plane):
    """Between walls, pressed by a displacement: uniaxial strain in each, one stress in both."""
    mesh = halves(grid(2, 2, kind, 2.0, 1.0))
    problem = fem.mesh_problem(
        mesh, **PAD_AND_DISC, plane=plane, contact="bottom", symmetry=["left", "right"],
        displacement={"top": ("free", -1e-4)}, friction=0,
    )  # fmt: skip
    root = only_root(problem)
    stress = fem.cell_stresses(problem, root.u)[:, 1, 1]
    assert np.allclose(stress, -1e-4 * in_series(**PAD_AND_DISC, plane=plane), rtol=1e-9)
    assert np.isclose(root.lambda_n.sum(), -2.0 * stress[0])


@pytest.mark.parametrize("kind", [4, 8, 10])
def test_two_materials_in_3d(kind):
    mesh = halves(solid((1, 1, 2), kind), axis=2)
    problem = fem.mesh_problem(
        mesh, **PAD_AND_DISC, contact="bottom", symmetry=["left", "right", "front", "back"],
        displacement={"top": ("free", "free", -1e-4)}, friction=0,
    )  # fmt: skip
    found = enumsol.successive_approximations(problem, 0)
    stress = fem.cell_stresses(problem, found.u)[:, 2, 2]
    assert np.allclose(stress, -1e-4 * in_series(**PAD_AND_DISC), rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_material_in_all_parts_is_one_material(kind):
    mesh = halves(grid(2, 2, kind, shake=0.05))
    more = {"contact": "bottom", "clamp": "left", "load": {"top": (0.1, -0.3)}, "friction": 0.4}
    whole = fem.mesh_problem(mesh, **STEEL, **more)
    parts = {name: {"pad": value, "disc": value} for name, value in STEEL.items()}
    both = fem.mesh_problem(mesh, **parts, plane={"disc": "strain", "pad": "strain"}, thickness=1, **more)
    assert_close(both, whole, "A", rtol=0, atol=1e-14)
    assert_same(both, whole, "f")
    wrong = {"young": parts["young"], "poisson": {"pad": 0.3}}
    bad_argument("poisson is not given for", fem.mesh_problem, mesh, **wrong, **more)


@pytest.mark.parametrize("kind", KINDS)
def test_thickness_multiplies_stiffness_and_forces(kind):
    mesh = halves(grid(2, 2, kind))
    more = {
        "contact": "bottom", "spring": {"left": (2.0, 1.0)}, "load": {"top": (0.1, -0.3)}, "pressure": {"right": 0.2},
        "body_force": (0.0, -0.1), "load_slope": {"top": (0.0, 1.0)}, "friction": 0.4,
    }  # fmt: skip
    thin, thick = (fem.mesh_problem(mesh, **STEEL, **more, thickness=t) for t in (1.0, 2.5))
    assert np.allclose(thick.A.toarray(), 2.5 * thin.A.toarray(), rtol=0, atol=1e-13)
    assert np.allclose(thick.f, 2.5 * thin.f, rtol=1e-13)
    assert np.allclose(thick.load_slope, 2.5 * thin.load_slope, rtol=1e-13)
    assert_close(thick, thin, "contact_rows")
    assert np.allclose(only_root(thick).lambda_n, 2.5 * only_root(thin).lambda_n)


@pytest.mark.parametrize("kind", [3, 9, (3, 4)])
def test_a_step_in_thickness_is_a_step_in_stress(kind):
    """A plate of thickness 2 on one of thickness 5, without Poisson's effect: both carry the same force."""
    mesh = halves(grid(2, 2, kind, 2.0, 1.0))
    problem = fem.mesh_problem(
        mesh, young=10.0, poisson=0.0, thickness={"pad": 5.0, "disc": 2.0}, contact="bottom",
        symmetry=["left", "right"], pressure={"top": 0.3}, spring={"top": (1e-7, 0)}, friction=0,
    )  # fmt: skip
    root = only_root(problem)
    assert np.isclose(root.lambda_n.sum(), 0.3 * 2.0 * 2.0, rtol=1e-6)
    stress = fem.cell_stresses(problem, root.u)[:, 1, 1]
    assert np.allclose(stress[mesh.bodies["disc"]], -0.3, rtol=1e-6)
    assert np.allclose(stress[mesh.bodies["pad"]], -0.3 * 2 / 5, rtol=1e-6)


def test_plane_strain_beside_plane_stress():
    mesh = halves(grid(2, 2, 4), axis=0)
    problem = fem.mesh_problem(
        mesh, **STEEL, plane={"pad": "stress", "disc": "strain"}, contact="bottom", clamp="top", friction=0
    )
    expected = {part: fem.lame(*STEEL.values(), plane) for part, plane in (("pad", "stress"), ("disc", "strain"))}
    for part, rows in mesh.bodies.items():
        assert np.array_equal(problem.mesh.lame[rows], np.tile(expected[part], (len(rows), 1)))


def test_forces_on_a_part_of_the_body():
    mesh = halves(grid(2, 2, 4, 2.0, 1.0))
    more = {**STEEL, "contact": "bottom", "spring": {"left": (1, 1)}}
    one = fem.mesh_problem(mesh, **more, body_force={"disc": (0.0, -3.0)})
    assert np.allclose(one.f.reshape(-1, 2).sum(axis=0), [0, -3.0])
    low = mesh.points[:, 1] < 0.4
    assert np.all(one.f.reshape(-1, 2)[low] == 0)
    both = fem.mesh_problem(mesh, **more, body_force={"disc": (0.0, -3.0), "pad": (1.0, 0.0)})
    assert np.allclose(both.f.reshape(-1, 2).sum(axis=0), [1.0, -3.0])


def test_friction_and_gap_by_contact_part():
    mesh = grid(2, 2, 4)
    given = {**STEEL, "contact": ["left", "bottom"], "clamp": "right"}
    problem = fem.mesh_problem(
        mesh, **given, friction={"left": 0.2, "bottom": 0.1}, friction_slope={"bottom": 0.5}, gap={"bottom": -0.01}
    )
    on_left = problem.coordinates[:, 0] == 0  # with the corner, since left is named first
    assert np.array_equal(problem.friction, np.where(on_left, 0.2, 0.1))
    assert np.array_equal(problem.friction_slope, np.where(on_left, 0.0, 0.5))
    assert np.array_equal(problem.gap, np.where(on_left, 0.0, -0.01))
    given |= {"contact": ["bottom", "left"], "friction": {"left": 0.2, "bottom": 0.1}}
    turned = fem.mesh_problem(mesh, **given)
    assert np.array_equal(turned.friction, np.where(turned.coordinates[:, 1] == 0, 0.1, 0.2))


def test_friction_by_contact_part_in_3d():
    problem = fem.mesh_problem(
        fem.box(2, 2, 1), **STEEL, contact=["bottom", "top"], clamp="left",
        friction={"bottom": 0.5, "top": 0.1}, friction_slope={"top": 1.0}, friction2={"bottom": 0.25, "top": 0.3},
    )  # fmt: skip
    low = problem.coordinates[:, 2] == 0
    assert np.array_equal(np.stack(problem.friction), [np.where(low, 0.5, 0.1), np.where(low, 0.25, 0.3)])
    assert np.array_equal(problem.friction_slope[0], np.where(low, 0.0, 1.0))


def test_friction_of_a_pair_goes_by_its_first_part():
    both = together(("low", grid(2, 1, 4)), ("high", shifted(grid(2, 1, 4), (0, 1))))
    bodies = {"low": np.arange(2), "high": np.arange(2, 4)}
    mesh = fem.PartedMesh(both.points, both.cells, both.facets, {}, bodies)
    problem = fem.mesh_problem(
        mesh, young={"low": 1.0, "high": 3.0}, poisson=0.3, contact="low.bottom", pairs=[("high.bottom", "low.top")],
        clamp=["low.left", "high.top"], friction={"low.bottom": 0.1, "high.bottom": 0.7}, gap={"high.bottom": 0.2},
    )  # fmt: skip
    assert np.array_equal(problem.friction, [0.1, 0.1, 0.7, 0.7, 0.7])
    assert np.array_equal(problem.gap, [0, 0, 0.2, 0.2, 0.2])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"young": {"pad": 1, "disk": 2}}, r"the mesh has no cells named 'disk'; expected one of pad, disc, all \(did"),
        ({"young": {"pad": 1}}, "young is not given for 2 of 4 cells, those of disc; expected it for all"),
        ({"young": {}}, "young is not given for 4 of 4 cells, those of pad; expected it for all"),
        ({"young": {"pad": 1, "disc": 2, "all": 1}}, "young is given for disc and for all, which share cells"),
        ({"young": {"pad": 1, "disc": -2}}, "young of disc is -2; expected a finite number > 0"),
        ({"poisson": {"pad": 0.3, "disc": 0.5}}, "poisson is 0.5; expected Poisson's ratio"),
        ({"plane": {"pad": "strain", "disc": "flat"}}, "plane of disc is 'flat'; expected one of 'strain', 'stress'"),
        ({"thickness": 0}, "thickness is 0; expected a finite number > 0"),
        ({"thickness": {"pad": 1, "disc": "x"}}, "thickness of disc is 'x'; expected a finite number > 0"),
        ({"body_force": {"pad": (1,)}}, r"body_force of pad is \(1,\); expected two finite numbers"),
        ({"body_force": {"top": (1, 0)}}, "the mesh has no cells named 'top'; expected one of pad, disc"),
        ({"friction": {"left": 1}}, "friction is given for left, which has no contact nodes; expected some of bottom"),
        ({"friction": {}}, "friction is not given for bottom; expected it for all contact parts"),
        ({"friction": {"bottom": "x"}}, "friction of bottom is 'x'; expected a finite number"),
        ({"gap": {"left": 0.1}}, "gap is given for left, which has no contact nodes"),
        ({"gap": {"bottom": None}}, "gap of bottom is None; expected a finite number"),
    ],
)
def test_values_by_part_that_do_not_fit(changes, message):
    flat = halves(grid(2, 2, 4))
    mesh = fem.PartedMesh(flat.points, flat.cells, flat.facets, {}, {**flat.bodies, "all": np.arange(4)})
    bad_argument(message, fem.mesh_problem, mesh, **(STEEL | {"contact": "bottom", "clamp": "top"} | changes))


def test_a_mesh_without_names_of_bodies_says_what_is_missing():
    held = {"contact": "bottom", "clamp": "top"}
    message = r"expected one of none \(in gmsh, physical groups of surfaces"
    bad_argument(message, fem.mesh_problem, grid(2, 2, 4), young={"pad": 1}, poisson=0, **held)
    message = "thickness is given for a body in 3D"
    bad_argument(message, fem.mesh_problem, fem.box(1, 1, 1), **STEEL, **held, thickness=2)
