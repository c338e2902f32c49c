"""From bases of scikit-fem: against matrices put together by hand, and against the mesh's own way."""

import numpy as np
import pytest
import skfem
from alike import assert_close
from complete import only_root
from parted_meshes import grid
from refusals import bad_argument, bad_problem
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

import enumsol
from enumsol import fem
from enumsol.fem.restrained import axes_of

LAME = lame_parameters(2.0, 0.3)


def basis_of(element, mesh=None):
    mesh = (skfem.MeshTri() if mesh is None else mesh).refined(2).with_defaults()
    basis = skfem.Basis(mesh, skfem.ElementVector(element))
    return basis, linear_elasticity(*LAME).assemble(basis)


def test_written_out_by_hand():
    """What a user of scikit-fem does without this package."""
    basis, K = basis_of(skfem.ElementTriP1())
    push = skfem.LinearForm(lambda v, _: -0.1 * v[1] + 0.05 * v[0]).assemble(basis.boundary("top"))
    problem = fem.basis_contact_problem(
        basis, K, contact="bottom", held=basis.get_dofs("left"), forces=push, friction=0.4, gap=0.01
    )
    free = basis.complement_dofs(basis.get_dofs("left"))
    floor = basis.mesh.facets[:, basis.mesh.boundaries["bottom"]]
    nodes = [node for node in np.unique(floor) if basis.mesh.p[0, node] > 0]
    Bn, Bt = np.zeros((2, len(nodes), len(free)))
    for row, node in enumerate(nodes):
        x, y = (int(np.flatnonzero(free == dof)[0]) for dof in basis.nodal_dofs[:, node])
        Bn[row, y], Bt[row, x] = -1, 1
    byhand = enumsol.ContactProblem(K[free][:, free], Bn, Bt, push[free], gap=0.01, friction=0.4)
    one, two = only_root(problem), only_root(byhand)
    assert_close(one, two, "lambda_n", rtol=1e-12)
    assert_close(one, two, "u", rtol=1e-10)
    assert list(problem.node_ids) == nodes


@pytest.mark.parametrize("kind", [3, 4, 6, 8, 9])
def test_the_same_as_mesh_problem(kind):
    """Degrees of freedom come in another order; roots are the same at the same places."""
    mesh = grid(3, 2, kind, 2.0, 1.0)
    elements = {6: skfem.ElementTriP2, 8: skfem.ElementQuadS2, 9: skfem.ElementQuad2}
    element = {3: skfem.ElementTriP1, 4: skfem.ElementQuad1, **elements}[kind]
    # of cells with eight nodes scikit-fem has no mesh; their edges here are straight
    kinds = {3: skfem.MeshTri1, 4: skfem.MeshQuad1, 6: skfem.MeshTri2, 9: skfem.MeshQuad2}
    made = kinds.get(kind, skfem.MeshQuad1)
    corners, rows = np.unique(mesh.cells[:, :4], return_inverse=True)
    points, cells = (mesh.points[corners], rows.reshape(-1, 4)) if kind == 8 else (mesh.points, mesh.cells)
    given = made(points.T.copy(), cells.T.copy()).with_defaults()
    basis = skfem.Basis(given, skfem.ElementVector(element()), intorder=4)
    push = skfem.LinearForm(lambda v, w: dot(np.array([0.05, -0.1])[:, None, None], v)).assemble(basis.boundary("top"))
    one = fem.basis_contact_problem(
        basis, linear_elasticity(*LAME).assemble(basis), contact="bottom", held=basis.get_dofs("left"), forces=push,
        friction=0.4, gap=lambda place: 0.01 * place[0],
    )  # fmt: skip
    two = fem.mesh_problem(
        mesh, young=2.0, poisson=0.3, contact="bottom", clamp="left", load={"top": (0.05, -0.1)}, friction=0.4,
    )  # fmt: skip
    order = np.argsort(one.coordinates[:, 0])
    assert_close(one, two, "coordinates", order=order)
    Bn, Bt = (np.where(np.abs(B.toarray()) > 0.5, sign, 0.0) for B, sign in ((two.Bn, -1.0), (two.Bt, 1.0)))
    two = enumsol.ContactProblem(two.A, Bn, Bt, two.f, friction=0.4, gap=0.01 * two.coordinates[:, 0])
    assert_close(only_root(one), only_root(two), "lambda_n", "lambda_t", order=order, rtol=1e-8, atol=1e-12)


def test_given_displacements():
    """A body that is moved as a whole: no forces but those of the obstacle, which it has not reached."""
    basis, K = basis_of(skfem.ElementTriP2())
    moved = np.zeros(basis.N)
    moved[basis.get_dofs("top").all(["u^2"])] = -0.25
    problem = fem.basis_contact_problem(
        basis, K, contact="bottom", held=basis.get_dofs("top"), displacements=moved, gap=0.3, friction=0.5
    )
    root = only_root(problem)
    assert np.all(root.lambda_n == 0)
    assert np.allclose(root.u_n, -0.05)


def test_three_dimensions():
    mesh = fem.box(2, 2, 1)
    given = skfem.MeshHex.init_tensor(*(np.linspace(0, 1, n) for n in (3, 3, 2))).with_defaults()
    basis = skfem.Basis(given, skfem.ElementVector(skfem.ElementHex1()), intorder=3)
    sides = ((2, 0), (2, 1), (0, 0))
    floor, lid, wall = (given.facets_satisfying(lambda x, k=k, at=at: np.isclose(x[k], at)) for k, at in sides)
    push = skfem.LinearForm(lambda v, _: 0.3 * v[0] + 0.1 * v[1] - 0.6 * v[2]).assemble(basis.boundary(lid))
    one = fem.basis_contact_problem(
        basis, linear_elasticity(*LAME).assemble(basis), contact=floor, held=basis.get_dofs(wall), forces=push,
        friction=(0.5, 0.3), tangents=((1, 0, 0), (0, -1, 0)),
    )  # fmt: skip
    two = fem.mesh_problem(
        mesh, young=2.0, poisson=0.3, contact="bottom", clamp="left", load={"top": (0.3, 0.1, -0.6)}, friction=0.5,
        friction2=0.3,
    )  # fmt: skip
    places = [int(np.argmin(np.linalg.norm(two.coordinates - place, axis=1))) for place in one.coordinates]
    found = [enumsol.successive_approximations(problem, 0) for problem in (two, one)]
    assert_close(*found, "lambda_n", order=places, rtol=1e-7)
    assert_close(*found, "lambda_t", order=places, rtol=1e-6, atol=1e-9)


@pytest.fixture(scope="module")
def good():
    """Arguments that are taken."""
    basis, K = basis_of(skfem.ElementTriP1())
    return {"basis": basis, "stiffness": K, "contact": "bottom", "held": basis.get_dofs("top")}


def test_what_is_refused(good):
    basis = good["basis"]

    def refused(message, **changes):
        bad_argument(message, fem.basis_contact_problem, **(good | changes))

    refused(
        "basis is a CellBasis whose degrees of freedom are not vectors", basis=skfem.Basis(basis.mesh, basis.elem.elem)
    )
    refused("basis is a int", basis=3)
    refused(r"stiffness has shape .*; expected \(50, 50\), as the basis has", stiffness=np.eye(3))
    refused("contact is 'floor'; .* the name of a boundary .found left, bottom, right, top", contact="floor")
    refused("contact has facets inside the body", contact=np.flatnonzero(basis.mesh.f2t[1] >= 0)[:2])
    refused("contact is .*; expected facets", contact=np.array([10_000]))
    refused("held has shape .* below 50, or a mask", held=[99])
    refused("contact has held nodes only", held=np.ones(50, dtype=bool))
    refused("contact node 0 is held or displaced in some components only", held=basis.get_dofs("bottom").all(["u^2"]))
    refused(r"forces has shape \(3,\); expected \(50,\)", forces=[1, 2, 3])
    refused("normals row 0 is zero", normals=(0, 0))


def test_what_else_is_taken(good):
    """A mask of what is held, nothing of it, and normals as a function of places: the same problem."""
    held = np.zeros(50, dtype=bool)
    held[good["held"].flatten()] = True
    one = fem.basis_contact_problem(**good, friction=0.4)
    two = fem.basis_contact_problem(**good | {"held": held}, normals=lambda place: (0.0, place[1] - 2.0), friction=0.4)
    assert_close(one, two, "A", "Bn", "Bt", "f", rtol=1e-12)
    bad_problem("free to move as a rigid body", fem.basis_contact_problem, **good | {"held": []})


def test_axes_that_are_not_at_right_angles_are_refused():
    up = np.array([[0.0, 0.0, 1.0]])
    bad_argument("expected a pair of directions", axes_of, (1, 0, 0), up)
    skew = "tangents are not perpendicular to each other and to the normals"
    for pair in (((1, 0, 0), (1, 1, 0)), ((1, 0, 1), (0, 1, 0))):
        bad_argument(skew, axes_of, pair, up)
    one, two = axes_of(((3, 4, 0), (4, -3, 0)), up)
    np.testing.assert_allclose([one[0], two[0]], [[0.6, 0.8, 0], [0.8, -0.6, 0]], rtol=1e-15)


@pytest.mark.slow
def test_elements_whose_corners_a_pressure_pulls_at_are_refused():
    solid, matrix = basis_of(skfem.ElementHexS2(), skfem.MeshHex())
    bad_argument(
        "a uniform pressure pulls at contact node .*the corners of ElementHexS2", fem.basis_contact_problem, solid,
        matrix, contact="bottom", held=solid.get_dofs("top"),
    )  # fmt: skip
