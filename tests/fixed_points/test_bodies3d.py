"""Bodies in 3D against equations written out from the matrices, plane strain, quadratic programs and turned axes."""

import numpy as np
import pytest
import scipy.sparse as sp
from alike import assert_close
from complete import limit_of
from parted_solids import on_bottom
from scipy.optimize import nnls

import enumsol
from enumsol import fem, gallery

LAME = (1.0, 1.0)


def load_relative_violations(problem, found, F):
    """Equilibrium, contact, cone and maximum dissipation by A, Bn, Bt1, Bt2 alone, F of shape (p, 2)."""
    A, Bn = problem.A.toarray(), problem.Bn.toarray()
    tangents = [problem.Bt1.toarray(), problem.Bt2.toarray()]
    rhs = problem.f - Bn.T @ found.lambda_n - sum(B.T @ found.lambda_t[:, k] for k, B in enumerate(tangents))
    u = np.linalg.solve(A, rhs)
    w_n = Bn @ u - problem.gap
    w_t = np.stack([B @ u for B in tangents], axis=1) - problem.slip_offset
    tau = found.lambda_t / F
    force, free = np.max(np.abs(problem.f)), np.linalg.solve(A, problem.f)
    length = np.max(np.abs(free))
    work = problem.f @ free
    return {
        "equilibrium": np.linalg.norm(A @ u - rhs) / force,
        "penetration": np.max(w_n) / length,
        "tension": -np.min(found.lambda_n) / force,
        "complementarity": abs(found.lambda_n @ w_n) / work,
        "cone": np.max(np.hypot(*tau.T) - found.lambda_n) / force,
        "dissipation": abs(np.sum(found.lambda_n * np.hypot(*(F * w_t).T)) - np.sum(found.lambda_t * w_t)) / work,
    }, np.hypot(*w_t.T)


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_a_block_pressed_and_sheared_with_orthotropic_friction_that_depends_on_the_slip(cells):
    knots, F1, F2 = [0.0, 0.02, 0.2], [0.6, 0.45, 0.3], [0.35, 0.25, 0.2]
    problem = gallery.block3d(5, 4, 3, friction=enumsol.FrictionTable(knots, F1, F2), cells=cells)
    found = limit_of(problem, 0)
    slip = np.hypot(*found.u_t.T)
    F = np.stack([np.interp(slip, knots, column) for column in (F1, F2)], axis=1)
    violations, by_hand = load_relative_violations(problem, found, F)
    assert max(violations.values()) < 1e-7, violations
    np.testing.assert_allclose(by_hand, slip, atol=1e-10)
    # some nodes open, some stick, some slip, over slips where the coefficients change
    assert {str(status) for status in found.statuses} == {"open", "stick", "slip"}
    sliding = F[[str(status) == "slip" for status in found.statuses]]
    assert np.ptp(sliding[:, 0]) > 0.05
    # the coefficients matter: those of the first iterate give other forces
    rigid = enumsol.successive_approximations(gallery.block3d(5, 4, 3, friction=(0.6, 0.35), cells=cells), 0)
    assert np.max(np.abs(rigid.forces - found.forces)) > 1e-3 * np.max(np.abs(found.forces))


def plane_strain(nx, nz, length, height, traction, F):
    """A clamped rectangle of bilinear elements in plane strain, pressed on the floor, without `enumsol.fem`."""
    from skfem import Basis, ElementQuad1, ElementVector, FacetBasis, LinearForm, MeshQuad
    from skfem.models.elasticity import linear_elasticity

    x, z = np.linspace(0.0, length, nx + 1), np.linspace(0.0, height, nz + 1)
    mesh = MeshQuad.init_tensor(x, z)
    element = ElementVector(ElementQuad1())
    basis = Basis(mesh, element, intorder=3)
    K = linear_elasticity(*LAME).assemble(basis)
    top = FacetBasis(mesh, element, facets=mesh.facets_satisfying(lambda place: place[1] > height - 1e-9), intorder=2)
    load = LinearForm(lambda v, _: traction[0] * v[0] + traction[1] * v[1]).assemble(top)
    held = basis.get_dofs(mesh.facets_satisfying(lambda place: place[0] < 1e-9)).all()
    free = np.setdiff1d(np.arange(K.shape[0]), held)
    nodes = np.flatnonzero((mesh.p[1] < 1e-9) & (mesh.p[0] > 1e-9))
    nodes = nodes[np.argsort(mesh.p[0][nodes])]
    along, across = (sp.eye_array(K.shape[0], format="csr")[basis.nodal_dofs[k][nodes]][:, free] for k in range(2))
    A = sp.csc_array(sp.csc_array(K)[free][:, free])
    return enumsol.ContactProblem(A, -across, along, load[free], friction=F)


@pytest.mark.parametrize("F", [0.2, 0.3])
def test_isotropic_friction_on_a_layer_reproduces_plane_strain(F):
    nx, nz, thickness, traction = 6, 4, 0.5, (0.4, -1.0)
    flat = plane_strain(nx, nz, 1.5, 1.0, traction, F)
    (root,) = enumsol.enumerate_roots(flat, 0)

    # contact nodes must be free to move: springs across the layer hold u_y, up to 1 / stiffness
    mesh = fem.box(nx, 1, nz, (1.5, thickness, 1.0))
    forces = fem.facet_forces(mesh.points, mesh.facets["top"], (traction[0], 0.0, traction[1]))
    held = {"held": mesh.nodes("left"), "springs": (0.0, 1e8, 0.0)}
    solid = on_bottom(mesh, LAME, axes=(1.0, 0.0, 0.0), **held, forces=forces, friction=F)
    found = limit_of(solid, 0)
    size = np.max(np.abs(root.lambda_n))
    # a node of the plane stands for a line of two, whose forces are those of half the layer each
    for line in range(2):
        nodes = slice(line * nx, (line + 1) * nx)
        half = thickness / 2
        np.testing.assert_allclose(found.lambda_n[nodes], half * root.lambda_n, atol=1e-7 * size)
        np.testing.assert_allclose(found.lambda_t[nodes, 0], half * root.lambda_t, atol=1e-7 * size)
        np.testing.assert_allclose(found.u_t[nodes, 0], root.u_t, atol=1e-7)
    # what holds the layer across its plane is shared by the springs and the friction of sticking nodes
    assert np.max(np.abs(found.u_t[:, 1])) < 1e-7
    assert {"stick", "slip"} <= {str(status) for status in found.statuses}


def test_without_friction_it_is_the_quadratic_program_of_contact():
    problem = gallery.block3d(4, 3, 2, friction=0.0)
    found = enumsol.successive_approximations(problem, 0)
    A, Bn = problem.A.toarray(), problem.Bn.toarray()
    # minimise lambda' S lambda / 2 - g' lambda over lambda >= 0, as nonnegative least squares
    L = np.linalg.cholesky(Bn @ np.linalg.solve(A, Bn.T))
    expected, _ = nnls(L.T, np.linalg.solve(L, Bn @ np.linalg.solve(A, problem.f)))
    np.testing.assert_allclose(found.lambda_n, expected, atol=1e-10)
    assert np.all(found.lambda_t == 0)
    assert {str(status) for status in found.statuses} == {"open", "slip"}


def turned_block(friction, angle):
    """A block whose tangents are turned about the normal by an angle."""
    mesh = fem.box(4, 3, 2)
    first = (np.cos(angle), -np.sin(angle), 0.0)
    second = (-np.sin(angle), -np.cos(angle), 0.0)
    forces = fem.facet_forces(mesh.points, mesh.facets["top"], (0.6, 0.4, -0.6))
    return on_bottom(mesh, LAME, axes=(first, second), forces=forces, friction=friction)


def table(F1, F2):
    return enumsol.FrictionTable([0.0, 0.2], [F1, 0.6 * F1], [F2, 0.8 * F2])


@pytest.mark.parametrize(
    ("friction", "turned", "angle"),
    [
        ((0.5, 0.3), (0.3, 0.5), np.pi / 2),
        (table(0.5, 0.3), enumsol.FrictionTable([0.0, 0.2], [0.3, 0.24], [0.5, 0.3]), np.pi / 2),
        (0.4, 0.4, 0.7),
        (lambda node, slip: 0.3 + 0.2 / (1 + slip), lambda node, slip: 0.3 + 0.2 / (1 + slip), -2.1),
    ],
    ids=["orthotropic", "orthotropic table", "isotropic", "isotropic function"],
)
def test_axes_and_coefficients_turned_together_change_nothing(friction, turned, angle):
    one, other = limit_of(turned_block(friction, 0.0), 0), limit_of(turned_block(turned, angle), 0)
    assert_close(other, one, "lambda_n", "u", rtol=1e-7, atol=1e-9)
    # components along the turned axes
    c, s = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(other.lambda_t, one.lambda_t @ np.array([[c, -s], [s, c]]), atol=1e-9)


def test_axes_turned_without_the_coefficients_change_the_forces():
    one = enumsol.successive_approximations(turned_block((0.5, 0.3), 0.0), 0)
    other = enumsol.successive_approximations(turned_block((0.5, 0.3), np.pi / 2), 0)
    assert np.max(np.abs(other.lambda_n - one.lambda_n)) > 1e-3 * np.max(one.lambda_n)
