"""Orthotropic materials: closed forms, turned axes, isotropic ones, and wrong constants."""

import numpy as np
import pytest
from parted_meshes import grid
from parted_solids import solid
from refusals import bad_argument

from enumsol import fem
from enumsol.fem.bodies import orthotropic_moduli

#: E1, E2, E3, nu12, nu13, nu23, G12, G13, G23.
WOOD = (10.0, 2.0, 1.0, 0.3, 0.35, 0.4, 1.5, 1.2, 0.4)
E, NU = 2.0, 0.3
PLAIN = (E, E, E, NU, NU, NU, *3 * (E / (2 * (1 + NU)),))
AT_REST = {"contact": "right", "gap": 9.0, "friction": 0.2}


def moved_of(mesh, **options):
    problem = fem.mesh_problem(mesh, **{**AT_REST, **options})
    u = problem.factorization.solve(problem.f)
    return problem.mesh.displacements(u), fem.cell_stresses(problem, u)


@pytest.mark.parametrize("pulled", ["top", "back", "right"])
def test_a_pulled_block(pulled):
    """Strains are those of the compliance, along every axis."""
    axis = {"right": 0, "back": 1, "top": 2}[pulled]
    mesh, normal = solid((2, 2, 2), 8, shake=0.05), np.eye(3)[axis]
    load = {pulled: tuple(0.1 * normal)}
    moved, stress = moved_of(mesh, orthotropic=WOOD, load=load, symmetry=["left", "front", "bottom"])
    E1, E2, E3, n12, n13, n23 = WOOD[:6]
    rows = [[1 / E1, -n12 / E1, -n13 / E1], [-n12 / E1, 1 / E2, -n23 / E2], [-n13 / E1, -n23 / E2, 1 / E3]]
    strains = np.array(rows)
    assert np.allclose(moved, mesh.points * (0.1 * strains[axis]), rtol=0, atol=1e-13)
    assert np.allclose(stress, 0.1 * np.outer(normal, normal), rtol=0, atol=1e-13)


def test_turned_axes_are_a_turned_body():
    """Axis 1 along z and axis 2 along x, and the shears with them."""
    moduli = orthotropic_moduli(WOOD, (0, 0, 2, 3, 0, 1))
    plain = orthotropic_moduli(WOOD)
    # of z, x, y and of the shears zx, zy, xy as 12, 13, 23
    order = [2, 0, 1, 4, 5, 3]
    assert np.allclose(moduli[np.ix_(order, order)], plain, rtol=1e-13)
    angle = 0.7
    turned = orthotropic_moduli(WOOD, (np.cos(angle), np.sin(angle), 0, -np.sin(angle), np.cos(angle), 0))
    c, s = np.cos(angle), np.sin(angle)
    compliance = np.linalg.inv(turned)
    E1, E2, n12, G12 = WOOD[0], WOOD[1], WOOD[3], WOOD[6]
    assert np.isclose(compliance[0, 0], c**4 / E1 + s**4 / E2 + (1 / G12 - 2 * n12 / E1) * c**2 * s**2)  # by books


@pytest.mark.parametrize("plane", ["strain", "stress", "axisymmetric"])
def test_isotropic_constants_give_the_isotropic_body(plane):
    mesh = grid(3, 2, 4)
    options = {"plane": plane, "clamp": "left" if plane != "axisymmetric" else "bottom", "load": {"top": (0.1, 0.2)}}
    warm = {"expansion": 1e-3, "temperature": 10.0}
    one = moved_of(mesh, orthotropic=PLAIN, orientation=(1, 2, 0, -2, 1, 0), **options, **warm)
    two = moved_of(mesh, young=E, poisson=NU, **options, **warm)
    for own, other in zip(one, two, strict=True):
        assert np.allclose(own, other, rtol=1e-10, atol=1e-13)


def test_parts_of_both_kinds():
    mesh = grid(2, 2, 4)
    parted = fem.PartedMesh(
        mesh.points, mesh.cells, mesh.facets, bodies={"wood": np.arange(2), "steel": np.arange(2, 4)}
    )
    given = {"young": {"steel": E}, "poisson": {"steel": NU}, "clamp": "left", "load": {"top": (0, 0.1)}}
    moved, _ = moved_of(parted, orthotropic={"wood": PLAIN}, **given)
    same, _ = moved_of(mesh, **{**given, "young": E, "poisson": NU})
    assert np.allclose(moved, same, rtol=1e-12)
    scene = fem.mesh_scene(parted, **AT_REST, orthotropic={"wood": WOOD}, **given)
    assert "orthotropic (10, 2, 1, 0.3, 0.35, 0.4, 1.5, 1.2, 0.4) (wood)" in str(scene)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"orthotropic": WOOD[:8]}, "orthotropic is .*; expected nine finite numbers"),
        ({"orthotropic": (-1, *WOOD[1:])}, "expected E1, E2, E3, nu12, nu13, nu23, G12, G13, G23, moduli > 0"),
        ({"orthotropic": (*WOOD[:3], 3.0, *WOOD[4:])}, "expected constants with a positive energy"),
        ({"orthotropic": WOOD, "orientation": (1, 0, 0, 2, 0, 0)}, "expected two directions that are not parallel"),
        ({"orthotropic": WOOD, "orientation": (1, 0, 1, 0, 1, 0)}, "cause shear out of it; expected a plane body"),
        ({"orthotropic": WOOD, "young": 1.0}, "young and orthotropic are given for the same cells"),
        ({"young": 1.0, "poisson": 0.3, "orientation": (1, 0, 0, 0, 1, 0)}, "orientation is given without orthotropic"),
        ({}, "young is None; expected"),
    ],
)
def test_wrong_constants(changes, message):
    bad_argument(message, fem.mesh_problem, grid(2, 1, 4), **AT_REST, clamp="left", **changes)
