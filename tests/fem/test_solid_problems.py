"""From a mesh in 3D to contact rows: nodes and patches, axes, the condition (3.1), the return operator, bad input."""

import numpy as np
import parted_solids
import pytest
from alike import assert_close, assert_same
from parted_solids import moved, rotation
from refusals import bad_argument, bad_problem

from enumsol import fem
from enumsol.fem.solid_problems import ContactSurface

KINDS = ("hexahedra", "tetrahedra")


def on_bottom(mesh, **options):
    return parted_solids.on_bottom(mesh, **({"friction": (0.5, 0.3)} | options))


def free_part(problem, field):
    """u of a problem for displacements (N, 3) of all nodes."""
    return field.ravel()[problem.mesh.dofs]


@pytest.mark.parametrize("kind", KINDS)
def test_rows_on_nodes(kind):
    mesh = fem.box(3, 2, 2, (2.0, 1.0, 1.5), kind)
    forces = fem.facet_forces(mesh.points, mesh.facets["top"], (0.3, 0.1, -1.0))
    problem = on_bottom(mesh, forces=forces, forces_slope=2 * forces, gap=0.1)
    contact = np.setdiff1d(mesh.nodes("bottom"), mesh.nodes("left"))
    assert problem.node_ids == tuple(contact.tolist())
    assert np.array_equal(problem.coordinates, mesh.points[contact])
    u = np.random.default_rng(0).normal(size=mesh.points.shape)
    w = free_part(problem, u)
    assert np.array_equal(problem.Bn @ w, -u[contact, 2])
    assert np.array_equal(problem.Bt1 @ w, u[contact, 0])
    assert np.array_equal(problem.Bt2 @ w, -u[contact, 1])
    assert np.array_equal(problem.f, forces.ravel()[problem.mesh.dofs])
    assert np.array_equal(problem.load_slope, 2 * problem.f)
    # each node has a quarter of the four cells around, or what is left of them at an edge
    cell = 2.0 / 3 * 0.5
    if kind == "hexahedra":
        assert np.allclose(
            problem.areas, [cell / 2, cell / 2, cell / 4, cell, cell, cell / 2, cell / 2, cell / 2, cell / 4]
        )
    A = fem.solid_stiffness(mesh.points, mesh.cells, (1.0, 1.0)).toarray()
    free = problem.mesh.dofs
    assert np.array_equal(problem.A.toarray(), A[np.ix_(free, free)])
    full = problem.mesh.displacements(problem.f)
    assert np.array_equal(full, np.where(np.isin(np.arange(len(u)), mesh.nodes("left"))[:, None], 0.0, forces))


def test_default_normals_and_axes_on_a_cylinder():
    """Nodes of a turned-up plate: normals from the facets around, axes orthonormal and right-handed."""
    mesh = fem.box(16, 2, 1, (1.0, 1.0, 0.1))
    angle = mesh.points[:, 0] - 0.5
    radius = 2.0 + mesh.points[:, 2]
    points = np.stack([radius * np.sin(angle), mesh.points[:, 1], radius * np.cos(angle)], axis=1)
    problem = fem.solid_contact_problem(
        points, mesh.cells, (1, 1), contact=mesh.facets["bottom"], held=mesh.nodes("top"), friction=0.5
    )
    frame = np.stack(
        [
            (rows @ np.eye(problem.n)[:, [np.searchsorted(problem.mesh.dofs, 3 * node + k) for k in range(3)]])[row]
            for row, node in enumerate(problem.node_ids)
            for rows in (problem.Bt1, problem.Bt2, problem.Bn)
        ]
    ).reshape(-1, 3, 3)
    assert np.allclose(frame @ frame.transpose(0, 2, 1), np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(frame), 1.0)
    inside = (problem.coordinates[:, 0] > -0.9) & (problem.coordinates[:, 0] < 0.9)
    exact = -problem.coordinates * [1, 0, 1] / np.linalg.norm(problem.coordinates[:, [0, 2]], axis=1)[:, None]
    assert np.allclose(frame[inside, 2], exact[inside], atol=1e-3)
    assert np.all(frame[:, 0, 1] == 0)  # t1 is the x axis projected


@pytest.mark.parametrize("multipliers", ["nodes", "elements"])
def test_turning_everything_changes_nothing(multipliers):
    mesh, Q = fem.box(4, 2, 2, cells="tetrahedra"), rotation(2)
    patches = fem.blocks(mesh.points, mesh.facets["bottom"], 2) if multipliers == "elements" else None
    forces = fem.facet_forces(mesh.points, mesh.facets["top"], (0.3, 0.1, -1.0))
    options = {"lame": (1.3, 0.7), "multipliers": multipliers, "patches": patches}
    first, second = (
        on_bottom(moved(mesh, lambda p, R=R: p @ R.T), forces=forces @ R.T, axes=R @ [0.6, 0.8, 0.0], **options)
        for R in (np.eye(3), Q)
    )
    assert_close(first, second, "condensed.S", "condensed.g0", rtol=0, atol=1e-11)
    assert_close(first, second, "areas")
    if multipliers == "elements":
        u = np.random.default_rng(1).normal(size=mesh.points.shape)
        slips = [problem.slip_mean(free_part(problem, u @ R.T)) for problem, R in ((first, np.eye(3)), (second, Q))]
        assert np.allclose(*slips)


def test_axes_as_a_field():
    mesh = fem.box(2, 2, 1)

    def swirl(x):
        angle = 3.0 * x[0] + x[1]
        return np.array([np.cos(angle), np.sin(angle), 0.0])

    by_callable = on_bottom(mesh, axes=swirl)
    t1 = np.array([swirl(x) for x in by_callable.coordinates])
    t2 = np.cross([0, 0, -1], t1)
    for axes in (t1, (t1, t2), (swirl, t2)):
        problem = on_bottom(mesh, axes=axes)
        assert_same(problem, by_callable, "Bt1")
        assert_close(problem, by_callable, "Bt2", rtol=0, atol=1e-15)
    left_handed = on_bottom(mesh, axes=(t1, -t2))
    assert np.allclose(left_handed.Bt2.toarray(), -by_callable.Bt2.toarray(), rtol=0, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ratio", [1, 2, 3])
def test_patches_take_means_of_displacements(kind, ratio):
    mesh = fem.box(6, 4, 2, (3.0, 2.0, 1.0), kind)
    problem = on_bottom(mesh, multipliers="elements", ratio=ratio)
    across = [-(-n // ratio) for n in (6, 4)]
    assert problem.p == across[0] * across[1]
    assert problem.areas.sum() == pytest.approx(6.0)
    # a linear field that vanishes where the body is held has its mean at the centroid
    gradient = np.random.default_rng(0).normal(size=3)
    field = mesh.points[:, :1] * gradient
    expected = problem.coordinates[:, :1] * gradient
    u = free_part(problem, field)
    assert np.allclose(np.stack([problem.Bt1 @ u, -problem.Bt2 @ u, -problem.Bn @ u], axis=1), expected)
    if ratio == 2:
        assert np.allclose(problem.areas, 1.0)
        assert np.allclose(problem.coordinates[:4], [[0.5, 0.5, 0], [1.5, 0.5, 0], [2.5, 0.5, 0], [0.5, 1.5, 0]])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("options", [{}, {"multipliers": "elements", "ratio": 2}, {"multipliers": "elements"}])
def test_a_press_fit_without_lateral_contraction_has_a_uniform_pressure(kind, options):
    """Pressed by delta over the height c, with l = 0: the stress is 2 m delta / c everywhere."""
    mesh = fem.box(4, 3, 2, (2.0, 1.5, 0.8), kind)
    problem = fem.solid_contact_problem(
        mesh.points, mesh.cells, (0.0, 0.7), contact=mesh.facets["bottom"], held=mesh.nodes("top"), gap=-0.01, **options
    )
    forces = np.linalg.solve(problem.condensed.S[: problem.p, : problem.p], problem.condensed.g0[: problem.p])
    assert np.allclose(forces / problem.areas, 2 * 0.7 * 0.01 / 0.8, rtol=1e-10)
    assert problem.areas.sum() == pytest.approx(3.0)


def test_patches_by_labels_and_without_held_ones():
    mesh = fem.box(4, 2, 1)
    facets = mesh.facets["bottom"]
    labels = np.array([7, 7, 3, 3, 7, 7, 9, 9])
    held = np.unique(facets[labels == 9])
    problem = on_bottom(mesh, multipliers="elements", patches=labels, held=held)
    assert problem.node_ids == (3, 7)
    assert np.allclose(problem.areas, [0.25, 0.5])
    # rigid shifts of the free part only: the held nodes of a patch take part in its mean with 0
    up = free_part(problem, np.ones_like(mesh.points))
    mean = (problem.Bn @ up)[0]
    assert -1 < mean < 0


def test_too_many_patches_violate_the_condition():
    mesh, patches = fem.box(4, 4, 1, cells="tetrahedra"), {"multipliers": "elements", "patches": np.arange(32)}
    message = r"{} free contact nodes violate condition \(3\.1\)"
    bad_problem(message.format("32 patches with 20") + ".*a larger ratio", on_bottom, mesh, **patches)
    # fewer patches than nodes, and dependent all the same
    mesh, patches["patches"] = fem.box(3, 3, 1, cells="tetrahedra"), np.minimum(np.arange(18), 14)
    bad_problem(message.format("15 patches with 16"), on_bottom, mesh, held=mesh.nodes("top"), **patches)


@pytest.mark.parametrize("kind", KINDS)
def test_return_operator_keeps_constants_and_signs(kind):
    mesh = fem.box(5, 4, 1, cells=kind)
    surface = ContactSurface(mesh.points, mesh.facets["bottom"])
    r = surface.return_operator()
    assert np.all(r.data >= 0)
    assert np.allclose(r.sum(axis=1), 1.0)
    problem = on_bottom(mesh, multipliers="elements", ratio=2)
    weights = problem.slip_mean.weights
    assert np.all(weights.data >= 0)
    assert np.allclose(weights.sum(axis=1), 1.0)
    # monotone: more slip everywhere is more mean slip everywhere, and a constant slip is its own mean
    rng = np.random.default_rng(0)
    less = rng.random(weights.shape[1])
    assert np.all(weights @ less <= weights @ (less + rng.random(len(less))))
    assert np.allclose(weights @ np.full(weights.shape[1], 2.5), 2.5)


def test_slip_mean_of_a_sheared_block():
    """u_t = (x a, -x b) along the floor and an offset: means by a fine quadrature of r_h by hand."""
    mesh = fem.box(4, 4, 1)
    offset = np.random.default_rng(3).normal(size=(4, 2))
    problem = on_bottom(mesh, multipliers="elements", ratio=2, slip_offset=offset)
    field = mesh.points[:, :1] * np.array([0.6, 0.8, 5.0])
    found = on_bottom(mesh, multipliers="elements", ratio=2).slip_mean(free_part(problem, field))
    # |u_t| = x: r_h at nodes is the mean of x over the facets around, r_h is bilinear, patches take its mean
    at_nodes = np.array([0.125, 0.25, 0.5, 0.75, 0.875])
    left = (at_nodes[0] / 2 + at_nodes[1] + at_nodes[2] / 2) / 2
    right = (at_nodes[2] / 2 + at_nodes[3] + at_nodes[4] / 2) / 2
    assert np.allclose(found, [left, right, left, right])
    # no displacement: slip is the distance from the offset, blurred by r_h over neighbouring patches
    still = problem.slip_mean(np.zeros(problem.n))
    lengths = np.linalg.norm(offset, axis=1)
    assert np.all(still <= lengths.max() + 1e-15)
    assert np.all(still >= lengths.min() - 1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_return_operator_approximates_to_first_order(kind):
    """|phi - r_h phi|_0 <= c h |phi|_1 (paper, (3.4)) on four meshes, for a smooth and for a rough function."""

    def smooth(x):
        return np.sin(3 * x[:, 0]) * np.cos(2 * x[:, 1]) + 1

    def rough(x):  # in H^1, with a kink that no mesh line follows
        return np.abs(x[:, 0] + 0.7 * x[:, 1] - 0.8)

    errors = {smooth: [], rough: []}
    for n in (4, 8, 16, 32):
        mesh = fem.box(n, n, 1, cells=kind)
        surface = ContactSurface(mesh.points, mesh.facets["bottom"])
        at_points = surface.interpolation()
        places, weights = at_points @ mesh.points, surface.quadrature[1].ravel()
        for function, found in errors.items():
            nodal = np.zeros(len(mesh.points))
            nodal[surface.nodes] = surface.return_operator() @ function(places)
            found.append(np.sqrt(weights @ (function(places) - at_points @ nodal) ** 2))
    for found in errors.values():
        h = 1.0 / np.array([4, 8, 16, 32])
        assert np.all(np.array(found) / h < 1.0)  # c |phi|_1 with |phi|_1 of about 2
        assert np.all(np.array(found[:-1]) / found[1:] > 1.8)


def test_a_contact_node_held_in_part_is_refused_unless_a_patch_holds_it():
    mesh = fem.box(2, 2, 1)
    held = parted_solids.held_in_part(mesh)
    bad_argument("contact node 1 is held in some components only", on_bottom, mesh, held=held)
    assert on_bottom(mesh, held=held, multipliers="elements", ratio=1).p == 4


BOX = fem.box(2, 2, 1)
BOTTOM = BOX.facets["bottom"]
INSIDE = BOX.cells[0][[1, 2, 6, 5]]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"contact": []}, "contact has no facets"),
        ({"contact": BOTTOM[:, :3]}, "contact row 0, nodes .*, is not a facet on the boundary"),
        ({"contact": [[0, 1, 4, 99]]}, "contact has node numbers from 0 to 99"),
        ({"contact": [INSIDE]}, r"contact row 0, nodes .* is not a facet on the boundary of the body"),
        ({"contact": [*BOTTOM, BOTTOM[0]]}, "contact names a facet twice"),
        ({"held": BOX.nodes("bottom")}, "contact has held nodes only"),
        ({"normals": (0, 0, 1)}, "normals row 0 does not point out of the body"),
        ({"normals": (0, 0, 0)}, "normals row 0 is zero"),
        ({"axes": (0, 0, 1)}, "axes are not orthonormal at contact row 0: the cosine between t1 and the normal is -1"),
        ({"axes": (2, 0, 0)}, "axes are not orthonormal at contact row 0: t1 has length 2"),
        ({"axes": ((1, 0, 0), (1, 0, 0))}, "the cosine between t2 and t1 is 1"),
        ({"axes": [[1, 0, 0]]}, r"axes has shape \(1, 3\); expected \(3,\) or \(6, 3\)"),
        ({"axes": lambda x: "x"}, "axes is not an array of real numbers"),
        ({"multipliers": "edges"}, "multipliers is 'edges'; expected"),
        ({"ratio": 2}, 'ratio and patches are for multipliers="elements"'),
        ({"multipliers": "elements", "ratio": 0}, "ratio is 0; expected an integer of at least 1"),
        ({"multipliers": "elements", "ratio": 2, "patches": [0, 0, 0, 0]}, "ratio is 2 and patches are given"),
        ({"multipliers": "elements", "patches": [0, 1]}, r"patches has shape \(2,\) .* expected \(4,\) integers"),
        ({"multipliers": "elements", "held": BOX.nodes("bottom")}, "contact has held nodes only"),
        ({"multipliers": "elements", "contact": [*BOTTOM, *BOX.facets["right"]]}, "in one plane perpendicular"),
        ({"multipliers": "elements", "contact": BOTTOM[:3]}, "do not fill a rectangular grid"),
    ],
)
def test_bad_arguments_are_named(options, message):
    bad_argument(message, on_bottom, BOX, **options)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"held": ()}, "free to move as a rigid body"),
        ({"friction": (np.ones(5), 0.3)}, r"friction F1 has shape \(5,\); expected \(6,\)"),
        ({"multipliers": "elements", "slip_offset": np.zeros((3, 2))}, r"slip_offset has shape \(3, 2\); expected"),
        ({"multipliers": "elements", "friction": (np.ones(6), 0.3)}, r"friction F1 has shape \(6,\); expected \(4,\)"),
    ],
)
def test_data_that_make_no_problem_are_named(options, message):
    bad_problem(message, on_bottom, BOX, **options)
