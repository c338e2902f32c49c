"""From meshes with named parts to problems: closed forms, the same body turned or halved, matrices by hand."""

import numpy as np
import pytest
from alike import assert_close, assert_same
from complete import all_roots, only_root
from parted_meshes import constant_stress, doubled, grid, moved
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import fem

E, NU = 2.0, 0.3
KINDS = (3, 4, 6, 8, 9, (3, 4), (6, 8), (6, 9))
STEEL = {"young": E, "poisson": NU}
WEAK = {"top": (1e-7, 1e-7)}
#: A wedge in a notch, as ``wedge`` makes it, and what holds and moves it.
JAMMED = {**STEEL, "contact": ["left", "right"], "spring": {"top": (0.02, 0.02)}, "gap": -5e-4}
PUSH = np.array([1e-4, 1e-3])


def wedge(nx, ny, kind):
    return moved(grid(nx, ny, kind), lambda p: np.c_[(p[:, 0] - 0.5) * (1 + 0.8 * p[:, 1]), p[:, 1]])


def nodal_displacements(mesh, problem, root, held):
    """Displacements of all nodes where ``held`` names what is left out: (nodes, component)."""
    free = np.ones(mesh.points.shape, dtype=bool)
    for nodes, component in held:
        free[nodes, component] = False
    u = np.zeros(mesh.points.size)
    u[free.ravel()] = root.u
    return u.reshape(-1, 2)


# -- stiffness and forces --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_patch_test(kind):
    """Constant stress is in equilibrium with its own tractions, on distorted cells with curved edges inside."""
    mesh = grid(3, 2, kind, 2.0, 1.0, shake=0.04)
    lam, mu = fem.lame(E, NU)
    gradient = np.array([[0.2, -0.1], [0.4, 0.3]])
    stress = constant_stress(gradient, (lam, mu))
    A = fem.stiffness(mesh.points, mesh.cells, (lam, mu))
    outward = {"bottom": (0, -1), "top": (0, 1), "left": (-1, 0), "right": (1, 0)}
    tractions = sum(fem.edge_forces(mesh.points, mesh.part(name), stress @ n) for name, n in outward.items())
    assert np.allclose((A @ (mesh.points @ gradient.T).ravel()).reshape(-1, 2), tractions, rtol=0, atol=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motions_alone_have_no_energy(kind):
    mesh = grid(2, 2, kind, shake=0.05)
    values = np.linalg.eigvalsh(fem.stiffness(mesh.points, mesh.cells, (1, 1)).toarray())
    assert np.sum(values < 1e-11) == 3


def quadrilateral_stiffness(corners, lam, mu):
    """By two by two Gauss points."""
    K, C = np.zeros((8, 8)), np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, mu]])
    for x, y in np.array(list(np.ndindex(2, 2))) / np.sqrt(3) + (1 - np.sqrt(1 / 3)) / 2:
        slopes = np.array([[y - 1, 1 - y, y, -y], [x - 1, -x, x, 1 - x]])
        jacobian = slopes @ corners
        dx, dy = np.linalg.solve(jacobian, slopes)
        B = np.zeros((3, 8))
        B[0, ::2], B[1, 1::2], B[2, ::2], B[2, 1::2] = dx, dy, dy, dx
        K += B.T @ C @ B * np.linalg.det(jacobian) / 4
    return K


def test_cells_of_two_kinds_are_assembled_as_by_hand():
    mesh = grid(3, 2, (3, 4), 2.0, 1.0, shake=0.05)
    assert "6 triangles, 3 quadrilaterals" in repr(mesh)
    expected = np.zeros((mesh.points.size,) * 2)
    for cell in mesh.cells.tolist():
        triangle = cell[2] == cell[3]
        nodes = cell[:3] if triangle else cell
        local = fem.triangle_stiffness if triangle else lambda corners, lame: quadrilateral_stiffness(corners, *lame)
        dofs = np.ravel([[2 * node, 2 * node + 1] for node in nodes])
        expected[np.ix_(dofs, dofs)] += local(mesh.points[nodes], (1.3, 0.7))
    assert np.allclose(fem.stiffness(mesh.points, mesh.cells, (1.3, 0.7)).toarray(), expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_weights_of_bodies_and_edges(kind):
    mesh = grid(3, 2, kind, 2.0, 1.5, shake=0.04)
    assert np.allclose(fem.body_forces(mesh.points, mesh.cells, (0.5, -2.0)).sum(axis=0), [1.5, -6.0])
    # a parabola: y = x^2 on (0, 1)
    arc = [[0, 0], [1, 1], [0.5, 0.25]]
    length = (2 * np.sqrt(5) + np.arcsinh(2)) / 4
    assert np.allclose(fem.edge_forces(arc, [[0, 1, 2]], (0, 1)).sum(axis=0), [0, length], rtol=1e-3)
    assert np.allclose(fem.edge_forces([[0, 0], [3, 0], [1.5, 0]], [[0, 1, 2]], (0, 6))[:, 1], [3, 3, 12])


def test_lame_coefficients():
    lam, mu = fem.lame(E, NU)
    assert np.isclose(mu * (3 * lam + 2 * mu) / (lam + mu), E)
    assert np.isclose(lam / (2 * (lam + mu)), NU)
    flat, _ = fem.lame(E, NU, "stress")
    assert np.isclose(flat, 2 * lam * mu / (lam + 2 * mu))


# -- closed forms ----------------------------------------------------------------------------------------------------


@pytest.mark.few(5, 2)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("plane", "modulus"), [("stress", E), ("strain", E / (1 - NU**2))])
def test_a_pressed_block_that_may_widen(kind, plane, modulus):
    """Without friction, on a plane of symmetry: uniform uniaxial stress."""
    mesh = grid(3, 2, kind, 2.0, 1.5)
    problem = fem.mesh_problem(
        mesh, **STEEL, plane=plane, contact="bottom", symmetry="left", pressure={"top": 0.1}, friction=0, spring=WEAK
    )
    root = only_root(problem)
    # the spring holds no more than rounding of the whole: the block stands on its contact
    assert np.isclose(root.lambda_n.sum(), 0.2, rtol=1e-5)
    u = nodal_displacements(mesh, problem, root, [(np.setdiff1d(mesh.nodes("left"), mesh.nodes("bottom")), 0)])
    assert np.allclose(u[mesh.nodes("top"), 1], -0.1 * 1.5 / modulus, rtol=1e-4)
    shares = {2: (0.5, 1, 1, 0.5), 3: (1 / 6, 1 / 3, 1 / 3, 1 / 6)}[mesh.part("bottom").shape[1]]
    corners = [list(problem.node_ids).index(node) for node in range(4)]
    assert np.allclose(root.lambda_n[corners], 0.1 * 2 / 3 * np.array(shares), rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_a_block_pressed_by_a_displacement(kind):
    """Between walls: uniaxial strain. The corners in contact lie on planes of symmetry."""
    mesh = grid(3, 2, kind, 2.0, 1.5)
    problem = fem.mesh_problem(
        mesh, **STEEL, contact="bottom", symmetry=["left", "right"], displacement={"top": ("free", -0.01)}, friction=0.4
    )
    root = only_root(problem)
    lam, mu = fem.lame(E, NU)
    assert np.isclose(root.lambda_n.sum(), (lam + 2 * mu) * 0.01 / 1.5 * 2.0, rtol=1e-10)
    assert np.allclose(root.lambda_t, 0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_springs_carry_what_is_not_in_contact(kind):
    mesh = grid(2, 2, kind, 2.0, 1.0)
    problem = fem.mesh_problem(
        mesh, **STEEL, contact="bottom", spring={"top": (5, 7)}, body_force=(0, -0.1), gap=1, friction=0.5
    )
    root = only_root(problem)
    assert np.all(root.lambda_n == 0)
    top = mesh.nodes("top")
    shares = fem.edge_forces(mesh.points, mesh.part("top"), (0, 1))[:, 1]
    assert np.isclose(5 * shares[top] @ root.u.reshape(-1, 2)[top, 1], -0.2)


def test_pressure_pushes_into_the_body():
    circle = moved(grid(2, 2, 9, 2.0, 2.0), lambda p: np.c_[p[:, 0] - 1, p[:, 1] - 1])
    loads = {"left": 0.3, "right": 0.3, "bottom": 0.3, "top": 0.3}
    bent = moved(circle, lambda p: p + 0.1 * np.c_[p[:, 1] ** 2, p[:, 0] * p[:, 1]])
    problem = fem.mesh_problem(bent, **STEEL, contact="bottom", spring={"top": (1, 1)}, pressure=loads, friction=0)
    assert np.allclose(problem.f.reshape(-1, 2).sum(axis=0), 0, atol=1e-14)
    one = fem.mesh_problem(circle, **STEEL, contact="bottom", clamp="top", pressure={"left": 0.3}, friction=0)
    assert np.allclose(one.f.reshape(-1, 2).sum(axis=0), [0.3 * 2 * 11 / 12, 0])  # but for the clamped corner


# -- the same body in other ways ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_turned_body_has_the_same_roots(kind):
    """A wedge that jams, with normals of its own, turned by an angle."""
    mesh = wedge(2, 3 if kind in (3, 4, (3, 4)) else 2, kind)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s], [s, c]])
    turned = moved(mesh, lambda p: p @ turn.T + np.array([3, -2]))
    before, after = (
        all_roots(fem.mesh_problem(body, **JAMMED, load={"top": tuple(push)}), 2.5, max_nodes=4000)
        for body, push in ((mesh, PUSH), (turned, turn @ PUSH))
    )
    assert len(before) == len(after) == 3
    for one, two in zip(before, after, strict=True):
        assert one.statuses == two.statuses
        assert_close(one, two, "lambda_n", "lambda_t", rtol=1e-7, atol=1e-12)
        assert np.allclose(one.u.reshape(-1, 2) @ turn.T, two.u.reshape(-1, 2), rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_half_of_a_symmetric_body(kind):
    half = grid(2, 2, kind)
    whole = doubled(half)
    data = {**STEEL, "contact": "bottom", "pressure": {"top": 0.2}, "friction": 0.15, "spring": {"top": (0.1, 0.1)}}
    problem = fem.mesh_problem(half, **data, symmetry="left")
    full, part = only_root(fem.mesh_problem(whole, **data)), only_root(problem)
    places = fem.mesh_problem(whole, **data).coordinates
    right = [int(np.argmin(np.abs(places[:, 0] - x))) for x in problem.coordinates[:, 0]]
    factor = np.where(problem.coordinates[:, 0] == 0, 0.5, 1.0)  # the axis carries half on each side
    assert "slip+" in {str(status) for status in part.statuses}
    assert np.allclose(part.lambda_n, factor * full.lambda_n[right], rtol=1e-9)
    assert np.allclose(part.lambda_t, factor * full.lambda_t[right], rtol=1e-9, atol=1e-14)
    axis = int(np.argmin(problem.coordinates[:, 0]))
    assert part.lambda_t[axis] == 0
    assert part.u_t[axis] == 0


@pytest.mark.parametrize("kind", KINDS)
def test_all_kinds_of_cells_agree(kind):
    """A wedge that jams: as many roots with every kind, and the contact forces of each add up to the same."""

    def found(kind, count):
        problem = fem.mesh_problem(wedge(count, count, kind), **JAMMED, load={"top": tuple(PUSH)})
        roots = all_roots(problem, 2.5, max_nodes=20_000)
        forces = [-(problem.contact_rows.T @ np.r_[root.lambda_n, root.lambda_t]) for root in roots]
        return sorted((force.reshape(-1, 2).sum(axis=0) for force in forces), key=lambda force: force[1])

    one, two = found(kind, 4 if kind in (3, 4, (3, 4)) else 2), found(9, 3)
    assert len(one) == len(two) == 3
    assert np.allclose(one, two, rtol=0, atol=0.005 * np.max(np.abs(two)))


def test_normals_on_a_plane_of_symmetry_are_those_of_the_whole_body():
    """A curved contact boundary, cut where its own normal is oblique but for the other half."""

    def bent(p):
        return p + np.c_[0 * p[:, 0], 0.3 * p[:, 0]]

    mesh = moved(grid(2, 2, 6), bent)
    whole = fem.mesh_problem(doubled(mesh), **STEEL, contact="bottom", clamp="top")
    half = fem.mesh_problem(mesh, **STEEL, contact="bottom", clamp="top", symmetry="left")
    row = int(np.argmin(np.abs(whole.coordinates[:, 0])))
    axis = int(np.argmin(half.coordinates[:, 0]))
    assert np.allclose(whole.Bn.toarray()[row].sum(), -1, atol=1e-12)
    assert sorted(half.Bn[[axis]].data[half.Bn[[axis]].data != 0]) == [-1.0]


def test_the_same_as_contact_problem():
    mesh = fem.rectangle(4, 2)
    forces = fem.edge_forces(mesh.points, fem.edges_along(mesh.top), (0.3, -1))
    slope = fem.edge_forces(mesh.points, fem.edges_along(mesh.right), (-0.1, 0))
    one = fem.contact_problem(
        mesh.points, mesh.triangles, fem.lame(**STEEL), contact=mesh.bottom[1:], normals=(0, -1), held=mesh.left,
        forces=forces, forces_slope=slope, gap=0.01, friction=0.1, friction_slope=0.5,
    )  # fmt: skip
    two = fem.mesh_problem(
        mesh.parted(), **STEEL, contact="bottom", clamp="left", load={"top": (0.3, -1)},
        load_slope={"right": (-0.1, 0)}, gap=0.01, friction=0.1, friction_slope=0.5,
    )  # fmt: skip
    assert_same(one, two, "A", "node_ids", "gap")
    assert_close(one, two, "f", "load_slope", rtol=1e-14, atol=1e-17)
    assert_close(one, two, "contact_rows", atol=1e-15)


def test_contact_nodes_come_in_their_order_along_the_boundary():
    mesh = grid(3, 1, 6)
    shuffled = np.random.default_rng(3).permutation(len(mesh.points))
    where = np.argsort(shuffled)
    other = fem.mesh_problem(
        fem.PartedMesh(
            mesh.points[shuffled], where[mesh.cells], {name: where[part] for name, part in mesh.facets.items()}
        ),
        **STEEL, contact="bottom", clamp="top",
    )  # fmt: skip
    steps = np.diff(other.coordinates[:, 0])
    assert len(steps) == 6
    assert np.allclose(np.abs(steps), 1 / 6)
    assert abs(np.sum(steps)) > 0.99


# -- obstacles -------------------------------------------------------------------------------------------------------


def test_a_plane_below_the_block_is_a_gap():
    mesh = grid(3, 2, 6)
    data = {**STEEL, "contact": "bottom", "clamp": "top", "friction": 0.5}
    one = fem.mesh_problem(mesh, **data, gap=0.1)
    two = fem.mesh_problem(mesh, **data, obstacle={"plane": (5, -0.1, 0, 3)})
    assert np.allclose(two.gap, 0.1)
    assert_close(one, two, "contact_rows", atol=1e-12)


def test_inclined_and_round_obstacles():
    mesh = grid(2, 1, 3)
    data = {**STEEL, "contact": "bottom", "clamp": "top", "friction": 0.5}
    inclined = fem.mesh_problem(mesh, **data, obstacle={"plane": (0, -0.5, -3, 4)}, gap=0.01)
    assert np.allclose(inclined.gap, [0.4 + 0.01, 0.4 - 0.3 + 0.01, 0.4 - 0.6 + 0.01])
    assert np.allclose(inclined.Bn.toarray()[0][[0, 1]], [0.6, -0.8])
    round_ = fem.mesh_problem(mesh, **data, obstacle={"circle": (0.5, -2, 1.5)})
    assert np.allclose(round_.gap, [np.hypot(0.5, 2) - 1.5, 0.5, np.hypot(0.5, 2) - 1.5])
    assert np.allclose(round_.Bn.toarray()[1][[2, 3]], [0, -1])
    hole = fem.mesh_problem(mesh, **data, obstacle={"hole": (0.5, 1, 1.5)})
    assert np.allclose(hole.gap, 1.5 - np.hypot([0.5, 0, 0.5], 1))
    assert np.allclose(hole.Bn.toarray()[1][[2, 3]], [0, -1])
    assert hole.Bn.toarray()[0][0] < 0


# -- three dimensions ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_the_same_as_solid_contact_problem(cells):
    mesh = fem.box(2, 2, 1, (1.0, 1.5, 1.0), cells)
    one = fem.solid_contact_problem(
        mesh.points, mesh.cells, fem.lame(**STEEL), contact=mesh.part("bottom"), held=mesh.nodes("left"),
        forces=fem.facet_forces(mesh.points, mesh.part("top"), (0.3, 0.1, -0.6)), friction=(0.5, 0.3), axes=(0, 1, 0),
    )  # fmt: skip
    two = fem.mesh_problem(
        mesh, **STEEL, contact="bottom", clamp="left", load={"top": (0.3, 0.1, -0.6)}, friction=0.5, friction2=0.3,
        axis=(0, 1, 0),
    )  # fmt: skip
    assert abs(one.A - two.A).max() < 1e-15
    assert_close(one, two, "f", rtol=1e-12, atol=1e-15)
    assert_close(one, two, "contact_rows", atol=1e-12)
    assert_close(one, two, "areas")
    assert_same(one, two, "mesh.dofs", "node_ids")


def test_a_quarter_of_a_block_in_3d():
    """Between planes of symmetry and pressed by a displacement: uniaxial strain; forces by the areas of the nodes."""
    mesh = fem.box(2, 2, 1)
    problem = fem.mesh_problem(
        mesh, **STEEL, contact="bottom", symmetry=["left", "right", "front", "back"],
        displacement={"top": ("free", None, -0.01)}, friction=0.3,
    )  # fmt: skip
    moved = problem.mesh.displacements(np.zeros(problem.n))
    assert np.array_equal(moved[mesh.nodes("top"), 2], [-0.01] * 9)
    assert np.count_nonzero(moved) == 9
    lam, mu = fem.lame(**STEEL)
    found = enumsol.successive_approximations(problem, 0)
    assert np.allclose(found.lambda_n, (lam + 2 * mu) * 0.01 * problem.areas, rtol=1e-7)
    assert np.allclose(found.lambda_t, 0, atol=1e-10)


# -- what is refused -------------------------------------------------------------------------------------------------

GOOD = {**STEEL, "contact": "bottom", "clamp": "top"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contact": "botom"}, r"no facets named 'botom'; expected one of bottom, .* \(did you mean bottom\?\)"),
        ({"contact": "bottom, left"}, r"no facets named 'bottom, left'; .* \(give bottom and left one by one\)"),
        ({"clamp": "roof"}, "no facets named 'roof'; expected one of bottom, top, left, right"),
        ({"contact": ()}, "contact names no part"),
        ({"contact": 3}, "contact is 3; expected the name of a part"),
        ({"contact": "top"}, "contact has no node that clamp or displacement leave free"),
        ({"load": {"left": (1, 2, 3)}}, r"load of left is \(1, 2, 3\); expected two finite numbers"),
        ({"load": (1, 2)}, r"load is \(1, 2\); expected names of parts with their values"),
        ({"pressure": {"left": "a"}}, "pressure of left is 'a'; expected a finite number"),
        ({"displacement": {"left": (1,)}}, r"displacement of left is \(1,\); expected 2 components"),
        ({"displacement": {"left": ("fre", 0)}}, "displacement of left is 'fre'; expected a finite number"),
        ({"displacement": {"left": (0.1, 0)}}, "left moves node 6 by 0.1 in x, and another part that shares it by 0;"),
        ({"displacement": {"bottom": (0.1, "free")}}, "contact node 0 is held or displaced in some components only"),
        ({"symmetry": "bottom"}, "normals at the plane of symmetry row 0 is zero|contact node 0 is held"),
        ({"spring": {"left": (-1, 0)}}, r"spring of left is \(-1, 0\); expected stiffnesses >= 0"),
        ({"poisson": 0.5}, r"poisson is 0\.5; expected"),
        ({"young": 0}, "young is 0; expected a finite number > 0"),
        ({"plane": "Strain"}, "plane is 'Strain'; expected one of 'strain', 'stress'"),
        ({"friction": (1, 2, 3)}, r"friction is \(1, 2, 3\); expected a finite number"),
        ({"friction2": 1}, "friction2 is given for a plane body"),
        ({"axis": (1, 0, 0)}, "axis is given for a plane body"),
        ({"obstacle": {"plan": (0, 0, 1, 1)}}, "obstacle is 'plan'; expected one of 'plane', 'circle', 'hole'"),
        ({"obstacle": {"plane": (0, 0, 1)}}, r"obstacle plane is \(0, 0, 1\); expected x, y, nx, ny"),
        ({"obstacle": {"plane": (0, 0, 0, 0)}}, "expected a direction to the body"),
        ({"obstacle": {"circle": (0, 0, -1)}}, "obstacle circle has the radius -1"),
        ({"obstacle": {"hole": (0, 0, 1)}}, "obstacle hole has its centre at a contact node"),
        ({"obstacle": {}}, r"obstacle is .*; expected one of plane = \[x, y, nx, ny\], circle"),
        ({"body_force": (1,)}, "body_force is .*; expected two finite numbers"),
        ({"gap": "0"}, "gap is '0'; expected a finite number"),
    ],
)
def test_bad_arguments_get_one_sentence(changes, message):
    bad_argument(message, fem.mesh_problem, grid(2, 2, 3), **(GOOD | changes))


def test_a_symmetry_that_is_inclined_is_refused():
    mesh = moved(grid(2, 2, 3), lambda p: p + np.c_[0.3 * p[:, 1], 0 * p[:, 1]])
    message = "symmetry left lies in no plane perpendicular to an axis"
    bad_argument(message, fem.mesh_problem, mesh, **GOOD, symmetry="left")


@pytest.mark.parametrize(
    "holds",
    [
        {},
        {"symmetry": "left"},
        {"symmetry": "bottom"},
        {"displacement": {"left": (0, "free")}},
        {"spring": {"left": (1, 0)}},
    ],
)
def test_what_nothing_holds_is_named(holds):
    message = "the body is free to move as a rigid body; expected clamp, symmetry"
    bad_problem(message, fem.mesh_problem, grid(2, 2, 3), **STEEL, contact="right", **holds)


def test_a_part_that_hangs_together_with_no_other():
    one, two = grid(1, 1, 4), grid(1, 1, 4)
    mesh = fem.PartedMesh(
        np.concatenate([one.points, two.points + np.array([5, 0])]),
        np.concatenate([one.cells, two.cells + 4]),
        one.facets,
    )
    bad_problem(r"the part of the body around \[5.0, 0.0\] is free to move", fem.mesh_problem, mesh, **GOOD)


def test_facets_inside_the_body_are_refused():
    mesh = grid(2, 2, 3)
    inside = fem.PartedMesh(mesh.points, mesh.cells, {**mesh.facets, "cut": np.array([[3, 4]])})
    message = r"cut row 0, nodes \[3, 4\], is not a facet on the boundary"
    bad_argument(message, fem.mesh_problem, inside, **GOOD | {"contact": "cut"})


def test_facets_without_their_nodes_between_are_refused():
    mesh = grid(2, 2, 6)
    bare = fem.PartedMesh(mesh.points, mesh.cells, {name: part[:, :2] for name, part in mesh.facets.items()})
    bad_argument("bottom has facets of 2 nodes; expected 3, as the cells have", fem.mesh_problem, bare, **GOOD)


def test_a_folded_boundary_has_no_normal():
    """Both sides of a cut share its end."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]]
    cells = [[0, 1, 4], [1, 2, 4], [2, 3, 4]]
    mesh = fem.PartedMesh(np.array(points), np.array(cells), {"cut": np.array([[3, 4], [4, 0]])})
    problem = fem.mesh_problem(
        mesh, **STEEL, contact="cut", displacement={"cut": ("free", "free")}, spring={"cut": (1, 1)}
    )
    assert problem.p == 3
