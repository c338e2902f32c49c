"""Forces on nodes, and linear constraints between displacements: against closed forms and matrices by hand."""

import numpy as np
import pytest
from alike import assert_close
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument, bad_problem
from two_bodies import blocks, stacked

import enumsol
from enumsol import fem

STEEL = {"young": 2.0, "poisson": 0.3, "contact": "bottom", "friction": 0.3}


def with_nodes(mesh, **sets):
    return fem.PartedMesh(mesh.points, mesh.cells, mesh.facets, {name: np.array(own) for name, own in sets.items()})


# -- forces on nodes ---------------------------------------------------------------------------------------------------


def test_a_force_acts_on_each_node_of_a_part_or_a_set_and_is_not_multiplied_by_the_thickness():
    mesh = with_nodes(grid(3, 2, 4), corner=[11], two=[9, 11])
    thick = {**STEEL, "clamp": "left", "thickness": 5.0}
    plain = fem.mesh_problem(mesh, **thick)
    forces = {"corner": (0.5, -1.0), "two": (0.0, 2.0), "right": (0.25, 0.0)}
    problem = fem.mesh_problem(mesh, **thick, force=forces, force_slope={"corner": (3.0, 4.0)})
    expected = np.zeros((12, 2))
    expected[[3, 7, 11]] += (0.25, 0.0)
    expected[[9, 11]] += (0.0, 2.0)
    expected[11] += (0.5, -1.0)
    assert np.array_equal((problem.mesh.motion @ problem.f).reshape(-1, 2)[[3, 7, 9, 11]], expected[[3, 7, 9, 11]])
    assert problem.f.sum() == plain.f.sum() + expected.sum()
    slope = (problem.mesh.motion @ problem.load_slope).reshape(-1, 2)
    assert np.array_equal(slope[11], (3.0, 4.0))
    assert np.count_nonzero(slope) == 2


def test_a_body_force_times_alpha_is_a_slope_of_the_load():
    mesh = grid(3, 2, 4)
    weight = fem.mesh_problem(mesh, **STEEL, clamp="left", body_force=(0.1, -1.0))
    growing = fem.mesh_problem(mesh, **STEEL, clamp="left", body_force_slope=(0.1, -1.0))
    assert np.array_equal(growing.load_slope, weight.f)
    assert not np.any(growing.f)


def test_a_force_on_contact_nodes_gets_a_note():
    (note,) = fem.mesh_scene(
        with_nodes(grid(3, 2, 4), foot=[2]), **STEEL, clamp="left", force={"foot": (0.0, -0.01)}
    ).notes
    assert note == "force of foot acts on contact nodes"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"force": {"tip": (1.0,)}}, r"force of tip is \(1.0,\); expected two finite numbers"),
        ({"force": {"top": (1.0, 2.0, 3.0)}}, "force of top is .*; expected two finite numbers"),
        ({"force_slope": {"nowhere": (1.0, 2.0)}}, "no facets or nodes named 'nowhere'"),
        ({"force": (1.0, 2.0)}, r"force is \(1.0, 2.0\); expected names of parts with their values"),
        ({"body_force_slope": (1.0,)}, "body_force_slope is .*; expected two finite numbers"),
    ],
)
def test_wrong_conditions_are_refused(changes, message):
    bad_argument(message, fem.mesh_problem, with_nodes(grid(3, 2, 4), tip=[11]), **STEEL, clamp="left", **changes)


# -- displacements that grow with alpha --------------------------------------------------------------------------------


def displaced(alpha, growing, make, **more):
    """A problem with a displacement at one alpha, or with its slope."""
    name, scale = ("displacement_slope", 1.0) if growing else ("displacement", alpha)
    given = {part: tuple(value if value == "free" else scale * value for value in own) for part, own in more.items()}
    return make({name: given})


def same_root_at(alpha, make, **displacements):
    """The root with a slope is that of the displacement at this alpha, on all nodes, with its stresses."""
    growing, fixed = (displaced(alpha, which, make, **displacements) for which in (True, False))
    (one,) = enumsol.enumerate_roots(growing, alpha)
    (two,) = enumsol.enumerate_roots(fixed, alpha)
    assert growing.depends_on_alpha
    assert np.isclose(one.u[-1], alpha, rtol=1e-14)
    moved = [problem.mesh.displacements(root.u) for problem, root in ((growing, one), (fixed, two))]
    assert np.allclose(*moved, rtol=0, atol=1e-12)
    assert_close(one, two, "lambda_n", "lambda_t", "u_n", "u_t", atol=1e-12)
    assert np.allclose(fem.cell_stresses(growing, one.u), fem.cell_stresses(fixed, two.u), rtol=0, atol=1e-11)
    assert two.lambda_n.sum() > 0
    return growing


def test_a_displacement_times_alpha_presses_a_block_down():
    def block(more):
        return fem.mesh_problem(grid(3, 2, 4), **STEEL, friction_slope=0, **more)

    problem = same_root_at(0.02, block, top=(0.5, -1.0))
    # held components would push the load on the nodes beside them; the last unknown has no part in any motion
    assert problem.inertia[[-1]].count_nonzero() == 1


@pytest.mark.parametrize("name", ["upper.top", "lower.top"])
def test_a_pair_follows_a_side_that_moves_with_alpha(name):
    """Also where the contact rows themselves move: the faced nodes, all of them given."""

    def pair(more):
        ((kind, own),) = more.items()
        held = "lower.bottom" if name == "upper.top" else "upper.top"
        return stacked(blocks(4, 3, 2), young=2.0, poisson=0.3, clamp=[held], friction=0.2, **{kind: own})

    same_root_at(0.05, pair, **{name: (0.3, -1.0) if name == "upper.top" else (0.3, 1.0)})


def test_displacements_and_their_slopes_add_up():
    given = {"displacement": {"top": (0.01, "free")}, "displacement_slope": {"top": ("free", -1.0)}}
    problem = fem.mesh_problem(grid(3, 2, 4), **STEEL, **given)
    moved = [problem.mesh.displacements(np.eye(problem.n)[-1] * alpha)[-4:] for alpha in (0.0, 2.0)]
    assert np.array_equal(moved[0], np.tile((0.01, 0.0), (4, 1)))
    assert np.array_equal(moved[1], np.tile((0.01, -2.0), (4, 1)))
    refused = {"displacement": {"right": ("free", 0.0)}, "displacement_slope": {"top": (0.0, -1.0)}}
    message = "top moves node 11 by -1 alpha in y, and another part that shares it by 0 alpha; expected one"
    bad_argument(message, fem.mesh_problem, grid(3, 2, 4), **STEEL, **refused)


def test_contact_nodes_that_move_with_alpha_where_nothing_follows_are_refused():
    mesh = grid(3, 2, 4)
    bad_argument(
        "contact node 0 is held or displaced in some components only",
        fem.mesh_problem, mesh, **STEEL, spring={"top": (1, 1)}, displacement_slope={"left": (1.0, "free")},
    )  # fmt: skip


# -- equations, against Lagrange multipliers ---------------------------------------------------------------------------

#: Nothing is in contact: the body alone is looked at.
ALONE = {**STEEL, "gap": 50.0}


def displacement(problem):
    """Displacements of all nodes without contact."""
    return problem.mesh.displacements(problem.factorization.solve(problem.f))


def with_multipliers(problem, C, c):
    """Displacements of all nodes of a problem in which only springs hold the body, under C x = c, by a dense matrix."""
    A, f = problem.A.toarray(), problem.f
    K = np.block([[A, C.T], [C, np.zeros((len(C), len(C)))]])
    return np.linalg.solve(K, np.concatenate([f, c]))[: len(f)].reshape(-1, 2)


def row(count, **terms):
    found = np.zeros(2 * count)
    for name, value in terms.items():
        found[2 * int(name[1:]) + "xy".index(name[0])] = value
    return found


def test_equations_give_what_lagrange_multipliers_give():
    mesh = with_nodes(grid(3, 3, 4), tip=[11])
    loose = {**ALONE, "spring": {"left": (1.0, 0.5)}, "force": {"tip": (0.3, -0.1)}}
    equations = [
        {"terms": [["tip", "x", 2.0], [7, "y", -1.0], [6, "x", 0.5]]},
        {"terms": [[6, "x", 1.0], [9, "x", -3.0]], "value": 0.01},
        {"terms": [[7, "y", 1.0], [11, "y", 1.0], [9, "x", 1.0]], "value": -0.02},
        {"terms": [[4, "y", 2.0]], "value": 0.01},
        {"terms": [[8, "x", 1.0], [4, "y", 1.0]]},
    ]
    C = [
        row(16, x11=2, y7=-1, x6=0.5), row(16, x6=1, x9=-3), row(16, y7=1, y11=1, x9=1), row(16, y4=2),
        row(16, x8=1, y4=1),
    ]  # fmt: skip
    expected = with_multipliers(fem.mesh_problem(mesh, **loose), np.array(C), np.array([0, 0.01, -0.02, 0.01, 0]))
    for order in ([0, 1, 2, 3, 4], [4, 2, 0, 1, 3], [3, 1, 2, 4, 0]):
        problem = fem.mesh_problem(mesh, **loose, equations=[equations[k] for k in order])
        assert problem.n == 32 - 5
        assert np.allclose(displacement(problem), expected, rtol=0, atol=1e-12)


def test_equations_that_repeat_others_change_nothing_and_others_are_refused():
    mesh, clamped = grid(3, 2, 4), {**ALONE, "clamp": "left"}
    both = [{"terms": [[3, "x", 1.0], [7, "x", -1.0]]}, {"terms": [[7, "x", 1.0], [11, "x", -1.0]], "value": 0.01}]
    third = {"terms": [[3, "x", 3.0], [11, "x", -3.0]], "value": 0.03}
    problems = [fem.mesh_problem(mesh, **clamped, equations=own) for own in (both, [*both, third])]
    assert problems[0].fingerprint == problems[1].fingerprint
    for wrong, message in (
        (third | {"value": 0.04}, "equations row 2 contradicts .* for node 3 in x, node 11 in x; expected equations"),
        (third | {"slope": 1.0}, "equations row 2 contradicts what supports and other equations give"),
        (
            {"terms": [[4, "x", 1.0], [8, "y", 1.0]], "value": 1.0},
            "equations row 2 contradicts .* node 4 in x, node 8 in y",
        ),
        ({"terms": [[4, "x", 1.0]], "value": 1.0}, "equations row 2 moves node 4 by 1 in x, and another part .* by 0"),
    ):
        bad_argument(message, lambda w=wrong: fem.mesh_problem(mesh, **clamped, equations=[*both, w]))


def test_an_equation_that_grows_with_alpha_follows_it():
    def block(alpha, slope):
        equation = {"terms": [[3, "y", 1.0], [11, "y", 1.0]], "value": alpha, "slope": slope}
        return fem.mesh_problem(grid(3, 2, 4), **STEEL, friction_slope=0, clamp="left", equations=[equation])

    growing, fixed = block(0.0, -0.5), block(-0.05, 0.0)
    (one,), (two,) = enumsol.enumerate_roots(growing, 0.1), enumsol.enumerate_roots(fixed, 0.1)
    assert np.allclose(growing.mesh.displacements(one.u), fixed.mesh.displacements(two.u), rtol=0, atol=1e-12)
    assert two.lambda_n.sum() > 0


# -- ties --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [3, 4, 6, 9])
def test_a_tie_passes_the_patch_test_where_one_mesh_refines_the_other(kind):
    """The shape functions of the coarse side are then sums of those of the fine one."""
    mesh = blocks(kind, 4, 2, shake=0.05)
    given = {
        "young": 2.0, "poisson": 0.3, "friction": 0, "contact": "lower.bottom", "pressure": {"upper.top": 0.1},
        "symmetry": ["lower.left", "upper.left"],
    }  # fmt: skip
    problem = fem.mesh_problem(mesh, **given, tie=[("upper.bottom", "lower.top")], max_rigid_displacement="auto")
    assert problem.rigid_modes.shape[1] == 1
    (root,) = enumsol.enumerate_roots(problem, 0)
    assert np.allclose(fem.cell_stresses(problem, root.u), np.diag([0.0, -0.1]), rtol=0, atol=1e-9)
    assert not [note for note in problem.notes if "several nodes" in note]
    bad_problem("free to move as a rigid body", fem.mesh_problem, mesh, **given)


def test_a_tie_joins_solids_at_all_nodes_of_second_order_too():
    upper, lower = (solid((1, 1, 1), 10, (1.0, 1.0, 0.5)) for _ in range(2))
    count = len(lower.points)
    facets = {f"lower.{name}": rows for name, rows in lower.facets.items()}
    facets |= {f"upper.{name}": rows + count for name, rows in upper.facets.items()}
    points = np.concatenate([lower.points, upper.points + np.array([0, 0, 0.5])])
    mesh = fem.SolidMesh(points, np.concatenate([lower.cells, upper.cells + count]), facets)
    given = {
        "young": 2.0,
        "poisson": 0.3,
        "friction": 0.1,
        "contact": "lower.right",
        "gap": 9.0,
        "clamp": "lower.bottom",
    }
    tied = fem.mesh_problem(mesh, **given, tie=[("upper.bottom", "lower.top")], load={"upper.top": (0.1, 0.0, -0.2)})
    moved = displacement(tied)
    for node in mesh.nodes("upper.bottom"):
        (twin,) = np.flatnonzero(np.all(np.abs(lower.points - points[node]) < 1e-12, axis=1))
        assert np.allclose(moved[node], moved[twin], rtol=0, atol=1e-14)
    whole = solid((1, 1, 2), 10, (1.0, 1.0, 1.0))  # the same tetrahedra in one piece
    given |= {"contact": "right", "clamp": "bottom", "load": {"top": (0.1, 0.0, -0.2)}}
    of_one = displacement(fem.mesh_problem(whole, **given))
    order = [int(np.argmin(np.linalg.norm(whole.points - point, axis=1))) for point in points]
    assert np.allclose(moved, of_one[order], rtol=0, atol=1e-10)


def test_a_tie_takes_nodes_within_a_distance_only():
    mesh, given = (
        blocks(4, gap=0.1),
        {**STEEL, "contact": "lower.right", "clamp": "lower.bottom", "spring": {"upper.top": (1, 1)}},
    )
    fem.mesh_problem(mesh, **given, tie=[("upper.bottom", "lower.top", 0.11)])
    message = "upper.bottom of the tie .* has no node that faces a facet of lower.top within 0.09; expected parts that"
    bad_argument(message, fem.mesh_problem, mesh, **given, tie=[("upper.bottom", "lower.top", 0.09)])
    bad_argument("tie has the entry", fem.mesh_problem, mesh, **given, tie=["upper.bottom"])


# -- rigid parts and couplings -----------------------------------------------------------------------------------------


def beam(kind=9, **more):
    """A cantilever of length 4 and height 1 from x = 0, on rollers there, held up at one node."""
    mesh = grid(4, 2, kind, 4.0, 1.0)
    held = np.flatnonzero(np.all(np.abs(mesh.points - [0.0, 0.5]) < 1e-12, axis=1))
    given = {"young": 3.0, "poisson": 0.0, "plane": "stress", "thickness": 0.5, "friction": 0.3, "contact": "bottom"}
    given |= {"gap": 90.0, "symmetry": "left", "displacement": {"pin": ("free", 0.0)}, "reference": {"END": (5.0, 0.5)}}
    return fem.mesh_problem(with_nodes(mesh, pin=held), **given | more)


@pytest.mark.parametrize("what", ["rigid", "coupling"])
def test_a_moment_on_a_reference_point_bends_a_beam_as_the_closed_form_says(what):
    E, L, M = 3.0, 4.0, 0.002
    problem = beam(**{what: {"END": "right"}}, moment={"END": M})
    x, y = problem.mesh.points.T
    kappa = M / (E * 0.5 / 12.0)
    exact = np.stack([-kappa * x * (y - 0.5), kappa * x**2 / 2], axis=1)
    moved = displacement(problem)
    assert np.allclose(moved, exact, rtol=0, atol=1e-12)
    assert np.max(np.abs(exact)) > 1e-2
    # with a slope alpha times as much
    growing = beam(**{what: {"END": "right"}}, moment_slope={"END": M})
    assert np.allclose(growing.load_slope, problem.f, rtol=0, atol=1e-16)
    assert np.isclose(L * kappa, np.ptp(moved[x == L][:, 0]))


def test_a_coupling_stiffens_nothing_whatever_the_poisson_ratio():
    M, E, nu = 0.002, 3.0, 0.3
    problem = beam(coupling={"END": ["right"]}, moment={"END": M}, poisson=nu)
    x, y = problem.mesh.points.T
    kappa = M / (E * 0.5 / 12.0)
    exact = np.stack([-kappa * x * (y - 0.5), kappa * (x**2 + nu * (y - 0.5) ** 2) / 2], axis=1)
    assert np.allclose(displacement(problem), exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("what", ["rigid", "coupling"])
def test_a_force_on_a_reference_point_has_its_moment(what):
    """A force at a point beyond the end is the force on the end with its moment."""
    far = beam(**{what: {"END": "right"}}, force={"END": (0.1, -0.02)})
    near = beam(
        **{what: {"END": "right"}}, reference={"END": (4.0, 0.5)}, force={"END": (0.1, -0.02)}, moment={"END": -0.02}
    )
    assert np.allclose(displacement(far), displacement(near), rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("what", ["rigid", "coupling"])
def test_given_motions_of_reference_points(what):
    """Also in steps with alpha, and with a rotation; the force that they need is that which gives them."""
    turned = beam(**{what: {"END": "right"}}, displacement={"END": (0.0, 0.03, 0.004), "pin": ("free", 0.0)})
    moved = displacement(turned)
    x, y = turned.mesh.points.T
    end = np.abs(x - 4.0) < 1e-12
    weights = np.array([1, 4, 2, 4, 1])[np.argsort(np.argsort(y[end]))] / 12.0
    mean, arm = weights @ moved[end], y[end] - 0.5
    turn = -(weights * arm) @ moved[end][:, 0] / ((weights * arm) @ arm)
    assert np.allclose([*mean, turn], [0.0, 0.03 - 0.004, 0.004], rtol=0, atol=1e-13)
    if what == "rigid":
        assert np.allclose(moved[end], np.stack([-0.004 * arm, np.full(5, 0.026)], axis=1), rtol=0, atol=1e-13)
    growing = beam(
        **{what: {"END": "right"}}, displacement={"pin": ("free", 0.0)}, displacement_slope={"END": (0.0, 0.03, 0.004)}
    )
    u = growing.factorization.solve(growing.f + 0.5 * growing.load_slope)
    assert np.allclose(growing.mesh.displacements(u), 0.5 * moved, rtol=0, atol=1e-12)


@pytest.mark.parametrize("what", ["rigid", "coupling"])
def test_a_reference_point_in_3d_carries_force_and_moment(what):
    """Force and moment are those of the nodal forces, and a rigid part does not strain."""
    mesh = solid((2, 2, 2), 8)
    low = np.array([facet for facet in mesh.facets["left"] if np.max(mesh.points[facet, 2]) < 0.6])
    mesh = fem.SolidMesh(mesh.points, mesh.cells, {**mesh.facets, "low": low})
    force, moment, at = np.array([0.1, -0.2, 0.3]), np.array([-0.05, 0.02, 0.04]), np.array([0.3, 0.2, 2.0])
    given = {**STEEL, "gap": 50.0, "clamp": "bottom", "contact": "low", "reference": {"TOP": at}, what: {"TOP": "top"}}
    problem = fem.mesh_problem(mesh, **given, force={"TOP": force}, moment={"TOP": moment})
    moved = displacement(problem)
    reaction = fem.solid_stiffness(mesh.points, mesh.cells, fem.lame(2.0, 0.3)) @ moved.ravel()
    on_nodes = reaction.reshape(-1, 3)
    top = mesh.nodes("top")
    assert np.allclose(on_nodes[top].sum(axis=0), force, rtol=0, atol=1e-12)
    arms = mesh.points[top] - at
    assert np.allclose(np.cross(arms, on_nodes[top]).sum(axis=0), moment, rtol=0, atol=1e-12)
    gradient = np.linalg.lstsq(np.c_[arms[:, :2], np.ones(len(top))], moved[top], rcond=None)[0]
    strain = np.max(np.abs(moved[top] - np.c_[arms[:, :2], np.ones(len(top))] @ gradient))
    assert (strain < 1e-14) == (what == "rigid")


@pytest.mark.parametrize("what", ["rigid", "coupling"])
def test_a_reference_point_of_an_axisymmetric_body_moves_along_the_axis(what):
    """A rod that a force F pulls is longer by F L / (E pi R^2)."""
    mesh, F = grid(2, 3, 4, 0.5, 2.0), 0.3
    mesh = fem.PartedMesh(mesh.points, mesh.cells, {**mesh.facets, "low": mesh.facets["right"][:2]})
    given = {"young": 2.0, "poisson": 0.0, "plane": "axisymmetric", "contact": "low", "gap": 9.0, "friction": 0.3}
    given |= {"symmetry": ["bottom", "left"], "reference": {"P": (0.0, 7.0)}, what: {"P": "top"}}
    moved = displacement(fem.mesh_problem(mesh, **given, force={"P": (0.0, F)}))
    exact = np.outer(mesh.points[:, 1], [0.0, F / (2.0 * np.pi * 0.25)])
    assert np.allclose(moved, exact, rtol=0, atol=1e-12)
    message = "a force or moment acts on P in rz, which moves nothing; expected one that does"
    bad_argument(message, fem.mesh_problem, mesh, **given, moment={"P": 1.0})


@pytest.mark.parametrize("pair", [("lower.top", "upper.bottom"), ("upper.bottom", "lower.top")])
def test_a_rigid_tool_that_a_force_presses_is_in_balance_with_contact(pair):
    mesh = blocks(4, 3, 4)
    sides = ["upper.bottom", "upper.top", "upper.left", "upper.right"]
    tool = {"reference": {"TOOL": (1.0, 2.0)}, "rigid": {"TOOL": sides}, "force": {"TOOL": (0.0, -0.2)}}
    given = {"young": 2.0, "poisson": 0.3, "clamp": "lower.bottom", "friction": 0.3, "pairs": [pair]}
    more = {"displacement": {"TOOL": (0.0, "free", 0.0)}, "max_rigid_displacement": "auto"}
    problem = fem.mesh_problem(mesh, **tool, **given, **more)
    assert problem.rigid_modes.shape[1] == 1
    (root,) = enumsol.enumerate_roots(problem, 0)
    assert np.isclose(root.lambda_n.sum(), 0.2)
    moved = problem.mesh.displacements(root.u)
    assert np.ptp(moved[mesh.nodes("upper.bottom"), 1]) < 1e-12
    assert np.max(moved[mesh.nodes("lower.top"), 1]) < -1e-3
    # of a rigid body on a rigid foundation contact forces are not determined
    message = "contact node .* has rows that depend on each other .* expected contact nodes that move on their own"
    given |= {"pairs": (), "contact": "upper.right", "gap": 1}
    more |= {"displacement": {"TOOL": ("free", "free", 0.0)}}
    bad_argument(message, fem.mesh_problem, mesh, **tool, **given, **more)


def test_equations_alone_may_join_a_reference_point_to_nodes():
    """As a coupling of some components does: a force on the point is shared by the nodes that move with it."""
    mesh = grid(3, 2, 4)
    terms = [{"terms": [[int(node), "x", 1.0], ["P", "x", -1.0]]} for node in mesh.nodes("right")]
    given = {**ALONE, "clamp": "left", "reference": {"P": (9.0, 9.0)}, "equations": terms, "force": {"P": (0.3, 0.0)}}
    moved = displacement(fem.mesh_problem(mesh, **given))
    C = np.array([row(12, x7=1, x3=-1), row(12, x11=1, x3=-1)])
    plain = fem.mesh_problem(
        mesh, **ALONE, spring={"left": (1e-9, 1e-9)}, displacement={"left": (0.0, 0.0)}, force={"right": (0.1, 0)}
    )
    left = plain.mesh.dofs
    K = np.block([[plain.A.toarray(), C[:, left].T], [C[:, left], np.zeros((2, 2))]])
    expected = plain.mesh.displacements(np.linalg.solve(K, np.append(plain.f, [0, 0]))[: plain.n])
    assert np.allclose(moved, expected, rtol=0, atol=1e-12)


# -- springs, local axes -----------------------------------------------------------------------------------------------


def test_springs_at_nodes_and_between_them():
    mesh = with_nodes(grid(3, 2, 4), tip=[11], low=[3])
    loose = {**ALONE, "clamp": "left", "force": {"tip": (0.3, -0.1)}}
    plain = fem.mesh_problem(mesh, **loose)
    sprung = fem.mesh_problem(mesh, **loose, node_spring={"right": (0.5, 2.0), "tip:low": (0.0, 3.0), "2:7": 4.0})
    expected = np.zeros((24, 24))
    for node in (3, 7, 11):
        expected[2 * node : 2 * node + 2, 2 * node : 2 * node + 2] += np.diag([0.5, 2.0])
    between = row(12, y11=1, y3=-1)
    along = (mesh.points[7] - mesh.points[2]) / np.linalg.norm(mesh.points[7] - mesh.points[2])
    axial = row(12, x7=along[0], y7=along[1], x2=-along[0], y2=-along[1])
    expected += 3.0 * np.outer(between, between) + 4.0 * np.outer(axial, axial)
    left = plain.mesh.dofs
    assert np.allclose((sprung.A - plain.A).toarray(), expected[np.ix_(left, left)], rtol=0, atol=1e-13)


def test_springs_hold_reference_points_and_join_bodies():
    mesh = grid(2, 1, 4)
    sides = {"reference": {"P": (0.3, 0.2)}, "rigid": {"P": ["top", "left", "right", "bottom"]}, "gap": 50.0}
    given = {"young": 2.0, "poisson": 0.3, "contact": "bottom", "friction": 0.3, **sides}
    bad_problem("free to move as a rigid body", fem.mesh_problem, mesh, **given)
    message = "contact node .* has rows that depend"
    bad_argument(message, fem.mesh_problem, mesh, **given, node_spring={"P": (2.0, 4.0, 8.0)})
    taller = grid(2, 2, 4)
    given["rigid"] = {"P": "top"}
    problem = fem.mesh_problem(
        taller, **given, node_spring={"P": (2.0, 4.0, 8.0)}, force={"P": (0.2, 0.8)}, moment={"P": 0.04}
    )
    top, turn = np.array([0.1, 0.2]), 0.005
    offset = taller.points - [0.3, 0.2]
    exact = top + turn * np.stack([-offset[:, 1], offset[:, 0]], axis=1)
    assert np.allclose(displacement(problem), exact, rtol=0, atol=1e-12)
    two = blocks(4, gap=0.2)
    given = {**STEEL, "contact": "lower.right", "clamp": "lower.bottom"}
    bad_problem("free to move", fem.mesh_problem, two, **given)
    up, low = two.nodes("upper.bottom"), two.nodes("lower.top")
    springs = {f"{a}:{b}": (1.0, 1.0) for a, b in ((up[0], low[0]), (up[-1], low[-1]))}
    assert fem.mesh_problem(two, **given, node_spring=springs).p == 2
    bad_problem("free to move", fem.mesh_problem, two, **given, node_spring={f"{up[0]}:{low[0]}": (1.0, 1.0)})


def turned(mesh, angle):
    c, s = np.cos(angle), np.sin(angle)
    Q = np.array([[c, -s], [s, c]])
    return fem.PartedMesh(mesh.points @ Q.T, mesh.cells, mesh.facets), Q


def test_displacements_forces_and_springs_along_turned_axes_are_those_of_the_turned_problem():
    mesh = grid(3, 2, 4)
    given = {**STEEL, "spring": {"left": (0.2, 0.1)}}
    along = {
        "displacement": {"top": ("free", -0.01)},
        "force": {"right": (0.05, -0.02)},
        "node_spring": {"right": (0.3, 2)},
    }
    straight = fem.mesh_problem(mesh, **given, **along)
    other, Q = turned(mesh, 0.4)
    frames = {"rectangular": Q[:, 0]}
    oblique = fem.mesh_problem(other, **given, **along, transform={"top": frames, "right": frames})
    assert oblique.n == straight.n
    (one,), (two,) = (enumsol.enumerate_roots(problem, 0.3) for problem in (straight, oblique))
    moved = straight.mesh.displacements(one.u)
    assert np.allclose(oblique.mesh.displacements(two.u), moved @ Q.T, rtol=0, atol=1e-12)
    assert_close(one, two, "lambda_n", "lambda_t", atol=1e-12)
    assert two.lambda_n.sum() > 0


def test_cylindrical_axes_are_radial_and_tangential():
    flat = grid(4, 2, 4)
    radius, angle = 1.0 + flat.points[:, 1], -0.5 * np.pi * flat.points[:, 0] + np.pi
    ring = fem.PartedMesh(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), flat.cells, flat.facets)
    problem = fem.mesh_problem(
        ring, **{**ALONE, "contact": "top"}, symmetry=["left", "right"],
        transform={"bottom": {"cylindrical": (0.0, 0.0)}}, displacement={"bottom": (0.01, "free")},
    )  # fmt: skip
    nodes = ring.nodes("bottom")
    moved, radial = displacement(problem)[nodes], ring.points[nodes]
    assert np.allclose(np.sum(moved * radial, axis=1), 0.01, rtol=0, atol=1e-13)
    assert np.ptp(displacement(problem)[ring.nodes("left"), 0]) != 0


def test_axes_in_3d_and_all_components_along_them():
    mesh = solid((1, 1, 2), 8)
    directions = (1.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    problem = fem.mesh_problem(
        mesh, **{**ALONE, "contact": "left"}, clamp="bottom", transform={"top": {"rectangular": directions}},
        displacement={"top": (0.1, 0.02, 0.03)},
    )  # fmt: skip
    half = np.sqrt(0.5)
    expected = 0.1 * np.array([half, half, 0]) + 0.02 * np.array([0, 0, 1]) + 0.03 * np.array([half, -half, 0])
    assert np.allclose(displacement(problem)[mesh.nodes("top")], expected, rtol=0, atol=1e-15)
    around = fem.mesh_problem(
        mesh, **{**ALONE, "contact": "left"}, clamp="bottom",
        transform={"top": {"cylindrical": (0.5, 0.5, 0.0, 0.5, 0.5, 7.0)}}, force={"top": (0.0, 1.0, 0.5)},
    )  # fmt: skip
    acting = (around.mesh.motion @ around.f).reshape(-1, 3)[mesh.nodes("top")]
    arms = mesh.points[mesh.nodes("top")] - [0.5, 0.5, 1.0]
    assert np.allclose(np.cross(arms, acting).sum(axis=0), [0.0, 0.0, 4 * np.sqrt(0.5)], rtol=0, atol=1e-14)
    assert np.allclose(acting.sum(axis=0), [0, 0, 2.0], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"reference": {"top": (0.0, 1.0)}}, "reference top is called as a part of the mesh is"),
        (
            {"reference": {"P": (0.0, 1.0)}},
            "reference P is joined to no part; expected rigid or coupling for it, or eq",
        ),
        ({"rigid": {"P": "top"}}, "there is no reference point named 'P'; expected one of none"),
        ({"reference": {"P": (0, 1)}, "coupling": {"P": "tip"}}, "coupling of P has nodes at one point or on one line"),
        ({"equations": [{"terms": []}]}, "equations row 0 is .*; expected terms"),
        ({"equations": [{"terms": [[0, "z", 1.0]]}]}, "equations row 0 has the component 'z'; expected one of x, y"),
        ({"equations": [{"terms": [[12, "x", 1.0]]}]}, "equations row 0 has the node 12; expected .* in 0 .. 11"),
        ({"equations": [{"terms": [["top", "x", 1.0]]}]}, "equations row 0 names top, which has 4 nodes; expected one"),
        ({"equations": [{"terms": [[3, "x", 0.0]]}]}, "equations row 0 has the coefficient 0"),
        ({"node_spring": {"top": (1.0, -1.0)}}, "node_spring of top is .*; expected stiffnesses >= 0"),
        ({"transform": {"top": {"polar": (0, 1)}}}, "transform of top is .*; expected rectangular or cylindrical"),
        ({"transform": {"top": {"cylindrical": (0, 1)}}}, "cylindrical of top is .*, and a node is on this axis"),
        ({"transform": {"top": {"rectangular": (0, 0)}}}, "rectangular of top is .*; expected a direction"),
        (
            {"transform": {"top": {"rectangular": (1, 1)}, "tip": {"rectangular": (1, 2)}}},
            "transform of tip gives node 11 other axes than that of another part",
        ),
        ({"moment": {"top": 1.0}}, "there is no reference point named 'top'"),
        (
            {
                "reference": {"P": (0, 1)},
                "moment": {"P": 1.0},
                "equations": [{"terms": [["tip", "x", 1.0], ["P", "x", -1.0]]}],
            },
            "a force or moment acts on P in rz, which moves nothing",
        ),
    ],
)
def test_wrong_joints_are_refused(changes, message):
    bad_argument(message, fem.mesh_problem, with_nodes(grid(3, 2, 4), tip=[11]), **STEEL, clamp="left", **changes)
