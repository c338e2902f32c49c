"""Any object as any argument of what 3D brought is accepted, or refused by an error of ours in one sentence."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from odd_objects import CALLABLE, ODD

import enumsol
from enumsol import EnumsolError, fem, fixed_points, gallery

ROWS = np.eye(3)
DATA = {"A": np.diag([2.0, 1.0, 1.0]), "Bn": ROWS[:1], "Bt1": ROWS[1:2], "Bt2": ROWS[2:], "f": [1.0, 3.0, 4.0]}
PLANE, SOLID = gallery.one_node_triangle(), gallery.one_node_3d()
ROOTS = enumsol.enumerate_roots(PLANE, 5.0)
LIMIT = enumsol.successive_approximations(SOLID, 0)
TABLE = enumsol.basin_table(PLANE, ROOTS, 3)
BLOCK = gallery.block3d(2, 2, 1, multipliers="elements", ratio=2)
BOX = fem.box(2, 2, 1, cells="tetrahedra")  # assembled four times as fast as hexahedra


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


#: Functions with arguments that they accept, and the names of those that are replaced.
CALLS = [
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
    (enumsol.successive_approximations, {"problem": PLANE, "alpha": 0}, "start anderson"),
    (enumsol.lipschitz_estimate, {"problem": SOLID, "alpha": 0}, "problem alpha areas lipschitz"),
    (
        enumsol.basin_table,
        {"problem": PLANE, "roots": ROOTS, "starts": 2, "max_iterations": 20},
        "problem roots starts seed anderson tolerance max_iterations distance",
    ),
    (enumsol.is_fixed_point, {"problem": PLANE, "root": ROOTS[0]}, "problem root tolerance"),
    (fixed_points.plot_basins, {"table": TABLE}, "table ax"),
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
    (fem.solid_stiffness, {"points": BOX.points, "cells": BOX.cells, "lame": (1, 1)}, "points cells lame"),
    (
        fem.solid_body_forces,
        {"points": BOX.points, "cells": BOX.cells, "density": (0, 0, 1)},
        "points cells density",
    ),
    (
        fem.facet_forces,
        {"points": BOX.points, "facets": BOX.facets["top"], "traction": (0, 0, 1)},
        "points facets traction",
    ),
    (fem.h1_norms, {"problem": BLOCK}, "problem"),
    (
        fem.solid_contact_problem,
        {
            "points": BOX.points,
            "cells": BOX.cells,
            "lame": (1, 1),
            "contact": BOX.facets["bottom"],
            "held": BOX.nodes("left"),
            "multipliers": "elements",
            "ratio": 2,
        },
        "points cells lame contact normals axes held springs forces forces_slope gap friction friction_slope "
        "slip_offset node_ids multipliers ratio patches",
    ),
    (
        gallery.block3d,
        {"nx": 1, "ny": 1, "nz": 1},
        "nx ny nz pull friction lame size cells gap multipliers ratio",
    ),
    (gallery.one_node_3d, {}, "W q friction"),
]
CASES = [(function, good, name) for function, good, names in CALLS for name in names.split()]


def named(function):
    return getattr(function, "__qualname__", type(function).__name__)


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("function", "good", "name"), CASES, ids=[f"{named(function)}-{name}" for function, _, name in CASES]
)
def test_any_object_as_any_argument(tmp_path, monkeypatch, function, good, name):
    monkeypatch.chdir(tmp_path)  # some of them are names of files
    accepted = 0
    for kind, make in ODD.items():
        if kind in CALLABLE and name in ("progress", "axes"):
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


def test_the_arguments_that_are_replaced_are_accepted_as_given(tmp_path, monkeypatch):
    """So that nothing above is refused for another reason."""
    monkeypatch.chdir(tmp_path)
    for function, good, _ in CALLS:
        if good and function not in (fem.read_mesh, fem.read_solid):
            function(**good)
