"""Parts of machines of the gallery: what mechanics says about them, by geometry and balance alone."""

import math

import numpy as np
import pytest
import scipy.sparse as sp
from complete import all_roots, whole_graph
from refusals import bad_argument
from scipy.sparse.linalg import spsolve
from skfem import Basis, ElementQuad2, ElementVector, MeshQuad
from skfem.models.elasticity import lame_parameters, linear_elasticity

import enumsol
from enumsol import gallery

PARTS = ("dovetail-14", "brake-shoe-9", "clip-17", "pressed-rings-16", "lap-joint-9")


def statuses(root):
    return [str(status) for status in root.statuses]


def on_nodes(problem, values):
    """Forces on degrees of freedom as vectors on the nodes of the mesh."""
    return np.asarray(problem.mesh.motion @ values).reshape(-1, 2)


def satisfies(problem, root, alpha):
    """The conditions as README states them, from the matrices."""
    u, ln, lt, F = root.u, root.lambda_n, root.lambda_t, problem.friction_at(alpha)
    size = np.max(abs(problem.A) @ np.abs(u)) + np.max(ln)
    assert np.allclose(problem.A @ u + problem.Bn.T @ ln + problem.Bt.T @ lt, problem.f, rtol=0, atol=1e-9 * size)
    normal, slip = problem.Bn @ u - problem.gap, problem.Bt @ u - problem.slip_offset
    far = 1e-7 * max(np.max(np.abs(u)), np.max(np.abs(problem.gap)))
    assert np.all(ln >= 0)
    assert np.all(normal <= far)
    assert np.all((ln == 0) | (np.abs(normal) <= far))
    assert np.all(np.abs(lt) <= F * ln + 1e-9 * size)
    assert np.allclose(lt[slip > far], (F * ln)[slip > far], atol=1e-9 * size)
    assert np.allclose(lt[slip < -far], -(F * ln)[slip < -far], atol=1e-9 * size)


@pytest.mark.parametrize("name", PARTS)
def test_roots_are_as_many_as_the_catalogue_says(name):
    entry = gallery.get(name)
    problem = entry.build()
    roots = all_roots(problem, entry.alpha)
    assert len(roots) == entry.roots
    assert problem.p == int(name.rpartition("-")[2])
    assert sum(root.index for root in roots) == 1
    for root in roots:
        satisfies(problem, root, entry.alpha)
    assert enumsol.verify(problem, roots.proof).complete


@pytest.mark.parametrize(("angle", "F"), [(45.0, 0.0), (45.0, 0.1), (45.0, 0.3), (60.0, 0.3), (35.0, 0.2)])
def test_dovetail_hangs_by_both_flanks(angle, F):
    """Root that slips outwards on both flanks: P = N (sin a + F cos a), but for the weak spring below its foot."""
    problem = gallery.dovetail(flank_angle=angle, friction=F)
    (root,) = all_roots(problem, 0)
    a = math.radians(angle)
    pressed = root.lambda_n > 0
    assert {status for status, on in zip(statuses(root), pressed, strict=True) if on} == {"slip+", "slip-"}
    assert root.lambda_n.sum() == pytest.approx(1400.0 / (math.sin(a) + F * math.cos(a)), rel=1e-3)
    left, right = np.split(root.lambda_n, 2)
    assert left.sum() == pytest.approx(right.sum(), rel=1e-9)


def test_dovetail_with_flanks_steeper_than_friction_may_jam():
    """With tan(15 degrees) = 0.27 < F a root that was pressed in holds without a pull, and can be free as well."""
    flank = {"pull": (0.0, -1.0), "press": 0.01, "flank_angle": 15.0}
    assert [len(all_roots(gallery.dovetail(friction=F, **flank), 0)) for F in (0.2, 0.26, 0.3)] == [1, 1, 3]


def arms_of_shoe(problem):
    """Arms of normal forces (lifting) and of friction to the left (drawing on) about the pin, by geometry [mm]."""
    x, y = (problem.coordinates - [-30.0, 420.0]).T
    nx, ny = -problem.coordinates.T / 300.0  # to the centre of the drum
    return -(x * ny - y * nx), x * nx + y * ny


def test_brake_shoe_balances_about_its_pin():
    problem = gallery.brake_shoe()
    assert np.allclose(np.hypot(*problem.coordinates.T), 300.0, rtol=1e-4)
    lifting, drawing = arms_of_shoe(problem)
    roots = all_roots(problem, 0.4)
    assert [root.lambda_n.max() > 0 for root in roots] == [False, True, True]
    for root in roots:
        # the return spring: its force at rest and its stiffness of 50 N / mm act on the nodes of the eye alike
        loaded = on_nodes(problem, problem.f)[:, 1]
        at = problem.mesh.points - np.array([-30.0, 420.0])
        moves = on_nodes(problem, root.u)
        share = loaded / loaded.sum()
        eye = np.sum(share[:, None] * at, axis=0)
        spring = -50.0 * np.sum(share * (at[:, 0] * moves[:, 1] - at[:, 1] * moves[:, 0]))
        moment = 50.0 * eye[0] + spring + root.lambda_n @ lifting - root.lambda_t @ drawing
        assert abs(moment) < 1e-5 * (50.0 * eye[0] + root.lambda_n @ lifting)
    between = [status for status, force in zip(statuses(roots[1]), roots[1].lambda_n, strict=True) if force > 0]
    assert set(between) == {"slip+"}


@pytest.mark.slow
def test_brake_shoe_is_self_locking_from_its_arms_on():
    """A rigid shoe that turns about its pin presses on the lining in proportion to a_n; Simpson's rule."""
    problem = gallery.brake_shoe()
    lifting, drawing = arms_of_shoe(problem)
    weights = np.array([1, 4, 2, 4, 2, 4, 2, 4, 1])
    rigid = (weights * lifting) @ lifting / ((weights * lifting) @ drawing)
    assert 0.3 < rigid < 0.35
    graph = whole_graph(problem, (0.0, 0.45))
    assert rigid < graph.uniqueness_limit < 1.2 * rigid
    assert graph.multiplicity_at(0.45) == 3


def test_brake_shoe_that_is_pressed_on_has_one_solution():
    assert len(all_roots(gallery.brake_shoe(pull=-50.0), 0.3)) == 1


@pytest.mark.slow
def test_clip_holds_by_friction_steeper_than_its_lips():
    """Normal forces on the upper half of the bar push the clip off; friction at most F N along the bar holds it."""
    problem = gallery.clip()
    lips = math.tan(math.radians(10.0))
    graph = whole_graph(problem, (0.0, 0.3))
    assert lips < graph.uniqueness_limit < 1.25 * lips
    roots = all_roots(problem, 0.25)
    up = problem.mesh.motion.T @ np.tile([0.0, 1.0], len(problem.mesh.points))
    stiffness = up @ (problem.A @ up)
    assert stiffness == pytest.approx(10.0, rel=0.02)
    normals = problem.coordinates / np.linalg.norm(problem.coordinates, axis=1, keepdims=True)
    for root in roots:
        assert np.allclose(root.lambda_n, root.lambda_n[::-1], atol=1e-9 * (1 + root.lambda_n.max()))
        # up: pull, normal forces; friction along the tangents, which are inward normals turned
        tangents = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
        forces = normals * root.lambda_n[:, None] - tangents * root.lambda_t[:, None]
        crown = on_nodes(problem, problem.f)[:, 1] / 10.0
        spring = stiffness * (crown @ on_nodes(problem, root.u)[:, 1])
        assert 10.0 + forces[:, 1].sum() == pytest.approx(
            spring, abs=2e-3 * (10.0 + root.lambda_n.sum())
        )  # normals of curved edges
    assert [root.lambda_n.max() > 0 for root in roots] == [False, True, True]
    assert np.all(statuses(roots[0]) == np.full(17, "open"))


def lame_pressure(E=210e3, nu=0.3, bore=10.0, joint=20.0, rim=30.0, press=0.01):
    """Of rings in plane stress, the inner one fixed at its bore: u = A (r - bore^2 / r) there [N / mm^2]."""
    inner = E / (1 - nu**2) * (1 + nu + (1 - nu) * (bore / joint) ** 2) / (joint - bore**2 / joint)
    outer = joint / E * ((rim**2 + joint**2) / (rim**2 - joint**2) + nu)
    return press / (1 / inner + outer)


@pytest.mark.parametrize(("cells", "close"), [((8, 1), 2e-3), ((16, 2), 2e-4)])
def test_rings_press_on_each_other_as_lame_says(cells, close):
    (root,) = all_roots(gallery.pressed_rings(*cells, torque=0.0, friction=0.5), 0)
    assert root.lambda_n.sum() == pytest.approx(lame_pressure() * 2 * math.pi * 20.0 * 10.0, rel=close)
    assert np.allclose(root.lambda_t, 0, atol=1e-9 * root.lambda_n.sum())


@pytest.mark.slow
def test_rings_transmit_a_torque_up_to_that_of_friction():
    most = lame_pressure() * 2 * math.pi * 20.0 * 10.0 * 20.0
    for share in (0.9, 1.1):
        problem = gallery.pressed_rings(torque=share * 0.15 * most)
        x, y = problem.mesh.points.T
        fx, fy = on_nodes(problem, problem.f).T
        assert np.sum(x * fy - y * fx) == pytest.approx(share * 0.15 * most, rel=1e-12)
        (root,) = all_roots(problem, 0.15)
        slips = {status.startswith("slip") for status in statuses(root)}
        assert slips == {share > 1}
        assert abs(root.lambda_t.sum()) * 20.0 == pytest.approx(min(share, 1.0) * 0.15 * most, rel=2e-3)
        # both rings: contact forces add up to nothing
        forces = on_nodes(problem, problem.Bn.T @ root.lambda_n + problem.Bt.T @ root.lambda_t)
        assert np.allclose(forces.sum(axis=0), 0, atol=1e-9 * root.lambda_n.sum())


def one_body(problem):
    """The lap joint with nodes at one place made one, assembled by scikit-fem: places and displacements."""
    points, stretch = problem.mesh.points, problem.mesh.offset[:, 0].max()
    _, first, node = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    cells = node[problem.mesh.cells]
    corners, place = np.unique(cells[:, :4], return_inverse=True)
    mesh = MeshQuad(points[first][corners].T.copy(), place.reshape(-1, 4).T.copy())
    basis = Basis(mesh, ElementVector(ElementQuad2()))
    lam, mu = lame_parameters(210e3, 0.3)
    K = 20.0 * linear_elasticity(2 * lam * mu / (lam + 2 * mu), mu).assemble(basis)  # plane stress, 20 mm wide
    at = basis.doflocs.T
    is_x = np.zeros(basis.N, dtype=bool)
    for dofs in (basis.nodal_dofs[0], basis.facet_dofs[0], basis.interior_dofs[0]):
        is_x[dofs] = True
    # the pressures of the bolts on straight edges: 1/6, 2/3 and 1/6 of that of each cell
    f = np.zeros(basis.N)
    for level, sign in ((0.0, 1.0), (8.0, -1.0)):
        on = np.flatnonzero(~is_x & np.isclose(at[:, 1], level) & (at[:, 0] > 30 - 1e-9) & (at[:, 0] < 60 + 1e-9))
        on = on[np.argsort(at[on, 0])]
        weights = np.zeros(len(on))
        for k in range(0, len(on) - 1, 2):
            weights[k : k + 3] += np.array([1, 4, 1]) / 6
        f[on] += sign * 20e3 * weights / weights.sum()
    held = np.isclose(at[:, 0], 0.0) | np.isclose(at[:, 0], 90.0)
    u = np.where(np.isclose(at[:, 0], 90.0) & is_x, stretch, 0.0)
    u[~held] = spsolve(sp.csc_array(K[~held][:, ~held]), f[~held] - K[~held][:, held] @ u[held])
    return at[is_x], np.stack([u[is_x], u[~is_x]], axis=1)


def test_lap_joint_whose_nodes_all_stick_is_one_body():
    problem = gallery.lap_joint(friction=2.0)
    (root,) = all_roots(problem, 0)
    assert set(statuses(root)) == {"stick"}
    places, tied = one_body(problem)
    moves = on_nodes(problem, root.u) + problem.mesh.offset
    nearest = np.argmin(np.linalg.norm(problem.mesh.points[:, None] - places[None], axis=2), axis=1)
    assert np.allclose(places[nearest], problem.mesh.points, atol=1e-9)
    assert np.allclose(moves, tied[nearest], rtol=0, atol=1e-10 * np.max(np.abs(tied)) + 1e-14)


def test_lap_joint_that_slips_transmits_what_friction_does():
    forces = []
    for F in (0.05, 0.3, 1.0):
        (root,) = all_roots(gallery.lap_joint(), F)
        forces.append(root.lambda_t.sum())
        assert root.lambda_n.sum() == pytest.approx(20e3, rel=1e-2)
        assert forces[-1] <= F * root.lambda_n.sum() * (1 + 1e-12)
        if F <= 0.05:
            assert forces[-1] == pytest.approx(F * root.lambda_n.sum(), rel=1e-12)
    assert np.all(np.diff(forces) > 0)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: gallery.dovetail(0), "nx is 0; expected an integer of at least 1"),
        (lambda: gallery.dovetail(flank_angle=90.0), r"flank_angle is 90\.0; expected degrees between 5 and 85"),
        (lambda: gallery.dovetail(pull=1.0), r"pull is 1\.0; expected two finite numbers"),
        (lambda: gallery.dovetail(press=math.nan), "press is nan; expected a finite number"),
        (lambda: gallery.brake_shoe(ny=0), "ny is 0; expected an integer of at least 1"),
        (lambda: gallery.brake_shoe(turn="far"), "turn is 'far'; expected a finite number"),
        (lambda: gallery.brake_shoe(pull=math.inf), "pull is inf; expected a finite number"),
        (lambda: gallery.clip(1), "nx is 1; expected an integer of at least 2"),
        (lambda: gallery.clip(pull=None), "pull is None; expected a finite number"),
        (lambda: gallery.pressed_rings(6), "nx is 6; expected a multiple of 4, since there are four lugs"),
        (lambda: gallery.pressed_rings(torque=math.nan), "torque is nan; expected a finite number"),
        (lambda: gallery.lap_joint(clamping=0.0), r"clamping is 0\.0; expected a finite number > 0"),
        (lambda: gallery.lap_joint(stretch=math.nan), "stretch is nan; expected a finite number"),
    ],
)
def test_bad_arguments_are_named(build, message):
    bad_argument(message, build)
