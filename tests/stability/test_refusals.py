"""What is said of masses that are none, and of roots whose stability is not known."""

import numpy as np
import pytest
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import gallery

one = gallery.get("one-node-6.1").build()
roots = enumsol.enumerate_roots(one, 5.0)

MASSES = [
    (np.eye(3), r"mass has shape \(3, 3\); expected \(n, n\) = \(2, 2\)"),
    (np.zeros((2, 2)), "mass is zero; expected a body with a mass"),
    ([[1, 0.5], [0.25, 1]], r"mass is not symmetric: max\|M - M'\| = 0.25 where max\|M\| = 1"),
    ([[1, 0], [0, -1]], "mass is not positive semidefinite: its diagonal entry 1 is -1"),
    ([[1, 2], [2, 1]], "mass is not positive semidefinite; expected a mass matrix"),
    ([[1, 1], [1, 0]], "mass is not positive semidefinite; expected a mass matrix"),
    ([[1, np.nan], [np.nan, 1]], "mass"),
]


@pytest.mark.parametrize(("mass", "message"), MASSES, ids=[message[:30] for _, message in MASSES])
def test_masses_that_are_none(mass, message):
    bad_problem(message, one.replace, mass=mass)
    bad_problem(message, enumsol.stability, one, roots[0], mass=mass)
    bad_problem(message, roots.stability, mass=mass)


def test_a_rigid_mode_without_mass():
    problem = gallery.get("block-on-table-5").build()
    mass = np.zeros((problem.n, problem.n))
    mass[0, 0] = 1.0
    bad_problem("mass is zero for some of rigid_modes; expected A", problem.replace, mass=mass)


def test_neither_mass_nor_mesh():
    bare = enumsol.ContactProblem(one.A, one.Bn, one.Bt, one.f, friction=0.5)
    found = enumsol.enumerate_roots(bare, 0.0)
    bad_argument("the problem has no mass and no mesh; expected mass", enumsol.stability, bare, found[0])
    bad_argument("the problem has no mass and no mesh; expected mass", found.stability)


def test_roots_of_something_else():
    other = gallery.get("one-node-6.2").build().replace(mass=np.eye(2))
    bad_argument("root solves another problem; expected one of enumerate_roots", enumsol.stability, other, roots[0])
    [family] = enumsol.enumerate_roots(gallery.get("one-node-6.3").build(), 2.0).families
    message = "root is a family of solutions; expected an isolated root of enumerate_roots"
    bad_argument(message, enumsol.stability, one, family, mass=np.eye(2))
    bad_argument(message, enumsol.rates, one, family, one.f)
    bad_argument("root is 3; expected an isolated root of enumerate_roots", enumsol.stability, one, 3)


def test_friction_that_depends_on_the_solution():
    problem = gallery.get("one-node-3d").build()
    root = enumsol.enumerate_roots(problem, 0.0)[0]
    table = enumsol.FrictionTable(slip=[0, 1], F1=[0.5, 0.4])
    law = problem.replace(friction=table)
    from enumsol.roots.stability import Stabilities

    bad_argument("friction depends on the solution; expected constant", Stabilities, law, np.eye(problem.n))
    assert root.enclosure is not None


def test_roots_in_floats_are_undecided():
    found = enumsol.enumerate_roots(one, 5.0, arithmetic="fast").stability(mass=np.eye(2))
    assert {item.verdict for item in found} == {"undecided"}
    assert "found in floats" in found[0].reason


def test_rounding_of_an_assembly_is_forgiven():
    mass = np.array([[1, 0.5], [0.5 * (1 + 1e-15), 1]])
    assert enumsol.stability(one, roots[1], mass=mass).verdict != "undecided"
    singular = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert one.replace(mass=singular).mass.shape == (2, 2)


def test_families_are_not_examined_and_that_is_said():
    problem = gallery.get("one-node-6.3").build()
    found = enumsol.enumerate_roots(problem, 2.0)
    line = "families of solutions are not examined for stability"
    assert line not in repr(found)
    assert found.stability(mass=np.eye(problem.n)) == ()
    assert line in repr(found)
    assert line in found._repr_html_()
    bad_argument("there is no isolated root; expected one", found.stability_proof, mass=np.eye(problem.n))


def test_no_roots_have_no_verdicts():
    empty = enumsol.enumerate_roots(one, 5.0, max_nodes=1)
    assert len(empty) or empty.stability() == ()
