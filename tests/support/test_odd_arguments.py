"""Any object as any argument is accepted, or refused by an error of ours in one sentence."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from odd_objects import CALLABLE, ODD
from skfem import Basis, ElementTriP1, ElementVector, MeshTri
from skfem.models.elasticity import linear_elasticity

import enumsol
from enumsol import EnumsolError, collection, fem, fixed_points, gallery
from enumsol.auditing import follow_arc
from enumsol.continuation import start_tangents

POINTS, TRIANGLES = [[0, 0], [1, 0], [0, 1]], [[0, 1, 2]]
PROBLEM = gallery.one_node_triangle()
ROOTS = enumsol.enumerate_roots(PROBLEM, 5.0)
GRAPH = enumsol.branch_graph(PROBLEM, (0, 10))
PATH = enumsol.follow(PROBLEM, ROOTS[0], interval=(0, 10))
SHORT = enumsol.ContinuationOptions(max_steps=20)
SMOOTH = enumsol.SmoothPath(F=lambda alpha: alpha, dF=lambda alpha: 1.0)
EQUATION = enumsol.PiecewiseSmoothEquation(PROBLEM)
ARC = GRAPH.arcs[0]
BASIS = Basis(MeshTri().with_defaults(), ElementVector(ElementTriP1()))
TOP = BASIS.get_dofs("top").flatten()


def graph_from(alpha):
    return enumsol.branch_graph(PROBLEM, (alpha, 9), "fast")


def graph_to(alpha):
    return enumsol.branch_graph(PROBLEM, (0, alpha), "fast")


def follow_from(alpha=5.0, lambda_n=(0.0,), lambda_t=(0.0,)):
    return enumsol.follow(PROBLEM, (alpha, lambda_n, lambda_t), 1, (0, 10))


def smooth_friction(value):
    """A path whose friction is whatever the user's function gives."""
    smooth = enumsol.SmoothPath(F=lambda alpha: value, dF=lambda alpha: 0.0)
    return enumsol.follow(PROBLEM, ROOTS[0], 1, (0, 10), SHORT, smooth)


def smooth_load(value):
    smooth = enumsol.SmoothPath(f=lambda alpha: value, df=lambda alpha: [0.0, 0.0])
    return enumsol.follow(PROBLEM, ROOTS[0], 1, (0, 10), SHORT, smooth)


ROWS = np.eye(3)
DATA = {"A": np.diag([2.0, 1.0, 1.0]), "Bn": ROWS[:1], "Bt1": ROWS[1:2], "Bt2": ROWS[2:], "f": [1.0, 3.0, 4.0]}
SOLID = gallery.one_node_3d()
LIMIT = enumsol.successive_approximations(SOLID, 0)
BLOCK = gallery.block3d(2, 2, 1, multipliers="elements", ratio=2)
BOX = fem.box(2, 2, 1, cells="tetrahedra")  # assembled four times as fast as hexahedra
BODY, BOTTOM = {"points": BOX.points, "cells": BOX.cells, "lame": (1, 1)}, {"contact": "bottom", "clamp": "top"}


def by_function(value):
    problem = enumsol.ContactProblem3D(**DATA, friction=lambda node, slip: value)
    return enumsol.successive_approximations(problem, 0)


def by_axes(value):
    return fem.solid_contact_problem(
        BOX.points, BOX.cells, (1, 1), contact=BOX.facets["bottom"], held=BOX.nodes("left"), axes=lambda place: value
    )


def loaded(path="limit.npz", problem=SOLID):
    LIMIT.save("limit.npz")
    return enumsol.FixedPoint.load(path, problem)


def answered(solutions="triangle-3.npz", tolerance=1e-4):
    np.savez("triangle-3.npz", r=[0.0, 0.0])
    return collection.check(solutions, tolerance)


#: Functions with arguments that they accept, and the names of those that are replaced.
CALLS = [
    (
        enumsol.ContactProblem,
        {"A": np.eye(2), "Bn": [[1.0, 0.0]], "Bt": [[0.0, 1.0]], "f": [1.0, 2.0]},
        "A Bn Bt f gap friction friction_slope load_slope slip_offset node_ids coordinates",
    ),
    (PROBLEM.friction_at, {}, "alpha"),
    (PROBLEM.load_at, {}, "alpha"),
    (PROBLEM.is_unloaded, {}, "alpha"),
    (PROBLEM.condensed.at, {}, "alpha"),
    (
        enumsol.enumerate_roots,
        {"problem": PROBLEM, "alpha": 5.0, "arithmetic": "fast"},
        "problem alpha arithmetic method executor progress stop_after max_nodes time_limit tolerance engine",
    ),
    (enumsol.enumerate_roots, {"problem": PROBLEM, "alpha": 5.0}, "alpha proof_path"),
    (enumsol.enumerate_roots, {"problem": PROBLEM, "alpha": 5.0, "arithmetic": "exact"}, "alpha"),
    (
        enumsol.multiplicity_table,
        {"problem": PROBLEM, "alphas": [5.0], "arithmetic": "fast"},
        "problem alphas arithmetic executor progress max_nodes time_limit",
    ),
    (enumsol.link_samples, {"problem": PROBLEM, "alphas": [5.0, 6.0]}, "problem alphas arithmetic progress"),
    (enumsol.link_samples, {"problem": SOLID, "alphas": [0.0, 1.0]}, "alphas arithmetic progress"),
    (
        enumsol.branch_graph,
        {"problem": PROBLEM, "interval": (0, 1)},
        "problem interval arithmetic progress max_nodes time_limit",
    ),
    (graph_from, {}, "alpha"),
    (graph_to, {}, "alpha"),
    (GRAPH.roots_at, {}, "alpha"),
    (GRAPH.multiplicity_at, {}, "alpha"),
    (GRAPH.arcs_at, {}, "alpha"),
    (ARC.values, {}, "alpha"),
    (ARC.displacements, {}, "alpha"),
    (GRAPH.plot, {}, "quantity nodes tolerance"),
    (GRAPH.save, {}, "file"),
    (enumsol.BranchGraph.load, {}, "file"),
    (GRAPH.write_graphml, {}, "file"),
    (enumsol.newton, {"problem": PROBLEM, "alpha": 5.0}, "problem alpha start r smooth_path max_iterations"),
    (
        enumsol.follow,
        {"problem": PROBLEM, "start": ROOTS[0], "interval": (0, 10), "options": SHORT},
        "problem start direction interval options smooth_path tangent visited",
    ),
    (follow_from, {}, "alpha lambda_n lambda_t"),
    (smooth_friction, {}, "value"),
    (smooth_load, {}, "value"),
    (start_tangents, {"problem": PROBLEM, "start": ROOTS[0]}, "problem start interval options smooth_path"),
    (PATH.resume, {}, "problem interval options smooth_path"),
    (PATH.save, {}, "path"),
    (enumsol.Path.load, {}, "path"),
    (PATH.plot, {}, "node quantity"),
    (
        enumsol.follow_all,
        {"problem": PROBLEM, "interval": (0, 10), "graph": GRAPH},
        "problem interval options graph progress",
    ),
    (
        follow_arc,
        {"problem": PROBLEM, "graph": GRAPH, "vertex": 0, "arc": 0},
        "problem graph vertex arc interval options",
    ),
    (enumsol.audit, {"path": PATH, "graph": GRAPH}, "path graph tolerance detour"),
    (
        enumsol.ContinuationOptions,
        {},
        "eps eps_prime h_min h_max h_init h_inc h_dec k_max k_thr r max_steps alpha_scale transition_tolerance "
        "check_steps overshoot choose",
    ),
    (enumsol.SmoothPath, {"F": abs, "dF": abs}, "F dF f df"),
    (SMOOTH.problem_at, {"problem": PROBLEM, "alpha": 5.0}, "problem alpha"),
    (enumsol.local_branch_test, {"problem": PROBLEM, "root": ROOTS[0]}, "problem root"),
    (enumsol.local_branch_test, {"problem": SOLID, "root": enumsol.enumerate_roots(SOLID, 0)[0]}, "problem root"),
    (enumsol.PiecewiseSmoothEquation, {"problem": PROBLEM}, "problem r"),
    (EQUATION.residual, {"x": np.zeros(4), "alpha": 5.0}, "x alpha"),
    (EQUATION.selection_jacobian, {"signs": [[1, 1, 1]], "x": np.zeros(4), "alpha": 5.0}, "signs x alpha"),
    (enumsol.sign_array, {}, "statuses"),
    (enumsol.verify, {"problem": PROBLEM, "proof": ROOTS.proof}, "problem proof progress"),
    (enumsol.Proof.load, {}, "path"),
    (ROOTS.proof.save, {}, "path"),
    (enumsol.read_problem, {}, "path"),
    (enumsol.write_problem, {"problem": PROBLEM, "path": "problem.npz"}, "problem path"),
    (gallery.get, {}, "name"),
    (collection.get, {}, "name"),
    (collection.export, {"folder": "collection", "names": ["triangle-3"]}, "folder names"),
    (answered, {}, "solutions tolerance"),
    (gallery.one_node_triangle, {}, "f lame"),
    (gallery.two_node_square, {}, "f1 f2 lame friction friction_slope load_slope"),
    (
        gallery.clamped_block,
        {"nx": 1, "ny": 1},
        "nx ny length height lame traction friction friction_slope gap contact",
    ),
    (
        gallery.wedge,
        {"nx": 1, "ny": 1},
        "nx ny pull press springs width height half_angle lame friction friction_slope",
    ),
    (gallery.chain, {"p": 1}, "p coupling f lame"),
    (gallery.dovetail, {"nx": 1, "ny": 1}, "nx ny pull press flank_angle friction friction_slope"),
    (gallery.brake_shoe, {"nx": 1, "ny": 1}, "nx ny pull turn friction friction_slope"),
    (gallery.clip, {"nx": 2, "ny": 1}, "nx ny pull press friction friction_slope"),
    (gallery.pressed_rings, {"nx": 4, "ny": 1}, "nx ny torque press friction friction_slope"),
    (gallery.lap_joint, {"nx": 1, "ny": 1}, "nx ny stretch clamping friction friction_slope"),
    (fem.lame, {"young": 2.5, "poisson": 0.25}, "young poisson plane"),
    (
        fem.mesh_problem,
        {"mesh": fem.rectangle(2, 1).parted(), "young": 2.5, "poisson": 0.25, **BOTTOM, "pressure": {"left": 1}},
        "mesh young poisson contact plane friction friction_slope friction2 friction2_slope axis clamp symmetry "
        "displacement displacement_slope transform tie reference rigid coupling equations node_spring moment "
        "moment_slope spring load load_slope pressure pressure_slope body_force "
        "body_force_slope force force_slope gap obstacle",
    ),
    (fem.read_mesh_problem, {}, "path"),
    (
        fem.basis_contact_problem,
        {"basis": BASIS, "stiffness": linear_elasticity(1, 1).assemble(BASIS), "contact": "bottom", "held": TOP},
        "basis stiffness contact held displacements normals tangents forces forces_slope gap friction friction_slope",
    ),
    (fem.stiffness, {"points": POINTS, "cells": TRIANGLES, "lame": (1, 1)}, "points cells lame"),
    (fem.triangle_stiffness, {"corners": POINTS, "lame": (1, 1)}, "corners lame"),
    (fem.edge_forces, {"points": POINTS, "edges": [[0, 1]], "traction": (1, 1)}, "points edges traction"),
    (fem.body_forces, {"points": POINTS, "cells": TRIANGLES, "density": (1, 1)}, "points cells density"),
    (
        fem.contact_problem,
        {"points": POINTS, "cells": TRIANGLES, "lame": (1, 1), "contact": [0], "normals": (0, -1), "held": [1, 2]},
        "points cells lame contact normals tangents held springs forces forces_slope gap friction friction_slope "
        "slip_offset node_ids",
    ),
    (fem.rectangle, {"nx": 1, "ny": 1}, "nx ny length height"),
    (fem.trapezoid, {"nx": 1, "ny": 1, "bottom": 1, "top": 1, "height": 1}, "nx ny bottom top height"),
    (fem.edges_along, {}, "nodes"),
    (
        enumsol.ContactProblem3D,
        DATA,
        "A Bn Bt1 Bt2 f gap friction friction_slope load_slope slip_offset node_ids coordinates areas mesh slip_mean",
    ),
    (SOLID.friction_at, {}, "alpha"),
    (SOLID.load_at, {}, "alpha"),
    (SOLID.is_unloaded, {}, "alpha"),
    (SOLID.coefficients, {"alpha": 0, "slip": np.zeros(1)}, "alpha slip"),
    (enumsol.FrictionTable, {"slip": [0, 1], "F1": [0.5, 0.3]}, "slip F1 F2"),
    (by_function, {"value": 0.5}, "value"),
    (by_axes, {"value": (1, 0, 0)}, "value"),
    (
        enumsol.BodyMesh,
        {name: getattr(BLOCK.mesh, name) for name in ("points", "cells", "motion", "offset", "facets", "rows")},
        "points cells motion offset facets rows",
    ),
    (
        enumsol.BodyMesh.of_dofs,
        {name: getattr(BLOCK.mesh, name) for name in ("points", "cells", "dofs", "facets", "rows")},
        "points cells dofs facets rows",
    ),
    (
        enumsol.SlipMean,
        {name: getattr(BLOCK.slip_mean, name) for name in ("T1", "T2", "offset", "weights")},
        "T1 T2 offset weights",
    ),
    (BLOCK.mesh.displacements, {"u": np.zeros(BLOCK.n)}, "u"),
    (BLOCK.slip_mean.__call__, {"u": np.zeros(BLOCK.n)}, "u"),
    (
        enumsol.solve_tresca,
        {"problem": SOLID, "slip_bound": 1.0, "alpha": 0},
        "problem slip_bound alpha slip start solver",
    ),
    (
        enumsol.successive_approximations,
        {"problem": SOLID, "alpha": 0, "max_iterations": 50},
        "problem alpha start tolerance max_iterations anderson progress",
    ),
    (enumsol.successive_approximations, {"problem": PROBLEM, "alpha": 0}, "start anderson"),
    (enumsol.lipschitz_estimate, {"problem": SOLID, "alpha": 0}, "problem alpha areas lipschitz"),
    (enumsol.is_fixed_point, {"problem": PROBLEM, "root": ROOTS[0]}, "problem root tolerance"),
    (fixed_points.TrescaReference, {"problem": SOLID}, "problem"),
    (
        enumsol.write_vtu,
        {"problem": BLOCK, "state": enumsol.successive_approximations(BLOCK, 0), "path": "a.vtu"},
        "problem state path",
    ),
    (LIMIT.save, {"path": "b.npz"}, "path"),
    (loaded, {}, "path problem"),
    (fem.box, {"nx": 1, "ny": 1, "nz": 1}, "nx ny nz size cells"),
    (fem.blocks, {"points": BOX.points, "facets": BOX.facets["bottom"], "ratio": 2}, "points facets ratio"),
    (fem.read_mesh, {"source": "a.vtu"}, "source groups"),
    (fem.read_solid, {"source": "a.vtu"}, "source groups"),
    (fem.solid_stiffness, BODY, "points cells lame"),
    (fem.solid_body_forces, {"points": BOX.points, "cells": BOX.cells, "density": (0, 0, 1)}, "points cells density"),
    (
        fem.facet_forces,
        {"points": BOX.points, "facets": BOX.facets["top"], "traction": (0, 0, 1)},
        "points facets traction",
    ),
    (fem.h1_norms, {"problem": BLOCK}, "problem"),
    (
        fem.solid_contact_problem,
        {**BODY, "contact": BOX.facets["bottom"], "held": BOX.nodes("left"), "multipliers": "elements", "ratio": 2},
        "points cells lame contact normals axes held springs forces forces_slope gap friction friction_slope "
        "slip_offset node_ids multipliers ratio patches",
    ),
    (
        gallery.block3d,
        {"nx": 1, "ny": 1, "nz": 1},
        "nx ny nz pull friction lame size cells gap multipliers ratio friction_slope",
    ),
    (gallery.one_node_3d, {}, "W q friction"),
]
CASES = [(function, good, name) for function, good, names in CALLS for name in names.split()]


def named(function):
    return getattr(function, "__qualname__", type(function).__name__)


@pytest.mark.few(8, 60)
@pytest.mark.parametrize(
    ("function", "good", "name"), CASES, ids=[f"{named(function)}-{name}" for function, _, name in CASES]
)
def test_any_object_as_any_argument(tmp_path, monkeypatch, function, good, name):
    monkeypatch.chdir(tmp_path)  # some of them are names of files
    accepted = 0
    for kind, make in ODD.items():
        if kind in CALLABLE and name in ("progress", "choose", "normals", "gap", "axes"):
            continue  # what a user's function raises is the user's
        try:
            function(**(good | {name: make()}))
        except EnumsolError as error:
            message = str(error)
        else:
            accepted += 1
            continue
        assert "\n" not in message, kind
        assert not message.endswith("."), kind
        assert len(message) < 700, kind
    plt.close("all")
    assert accepted < len(ODD)


@pytest.mark.slow
def test_the_arguments_that_are_replaced_are_accepted_as_given(tmp_path, monkeypatch):
    """So that nothing above is refused for another reason."""
    monkeypatch.chdir(tmp_path)
    for function, good, _ in CALLS:
        if good and function not in (fem.read_mesh, fem.read_solid):
            function(**good)
