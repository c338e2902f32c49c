"""Bodies in 3D that weak springs hold: displacements of roots are as good as their forces, and in their enclosures."""

import numpy as np
import pytest
from flint import fmpq_mat
from parted_solids import on_springs
from problems3d import within
from rational_forms import exact

import enumsol
from enumsol import ContactStatus, fem

SOLID = fem.box(2, 1, 1)
UNIT = float(np.finfo(float).eps)


def body(spring, shear):
    """A block with Young's modulus 2.5 on springs at every node, pressed on the ground and pulled sideways."""
    loads = np.tile(0.02 * np.array([shear, 0.5 * shear, -1.0]), (len(SOLID.nodes("top")), 1))
    loads[:, 0] *= np.linspace(0.5, 1.5, len(loads))
    return on_springs(SOLID, (1.0, 1.0), spring, loads, 0.5)


def sticking(problem):
    """u with all contact nodes sticking, in rationals, rounded: every row B u is gap or slip offset."""
    n, rows = problem.n, problem.contact_rows.toarray()
    size = n + len(rows)
    matrix, rhs = np.zeros((size, size)), np.zeros(size)
    matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = problem.A.toarray(), rows.T, rows
    rhs[:n], rhs[n:] = problem.f, np.concatenate([problem.gap, problem.slip_offset.ravel(order="F")])
    rows = [[exact(x) for x in row] for row in matrix.tolist()]
    found = fmpq_mat(rows).solve(fmpq_mat([[exact(x)] for x in rhs.tolist()])).entries()
    return np.array([int(x.p) / int(x.q) for x in found[:n]])


@pytest.mark.parametrize("spring", [1e-2, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8])
def test_displacements_at_loaded_nodes(spring):
    problem = body(spring, 0.1)
    (root,) = enumsol.enumerate_roots(problem, 0, max_nodes=60)
    assert set(root.statuses) == {ContactStatus.STICK}
    # forces that are rounded once push the whole body by their rounding over the springs, and no more
    room = 16 * UNIT * np.sum(root.lambda_n) / spring
    assert np.all(root.lambda_n > 0)
    assert np.max(np.abs(problem.Bn @ root.u - problem.gap - root.u_n)) <= room
    for rows, slip in zip((problem.Bt1, problem.Bt2), root.u_t.T, strict=True):
        assert np.max(np.abs(rows @ root.u - slip)) <= room
    assert np.max(np.abs(root.u - sticking(problem))) <= room


@pytest.mark.parametrize("spring", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9])
def test_displacements_lie_in_their_enclosures(spring):
    problem = body(spring, 1.0)
    (root,) = enumsol.enumerate_roots(problem, 0, max_nodes=60)
    assert {ContactStatus.SLIP, ContactStatus.OPEN} <= set(root.statuses)
    assert within(root.u_n, root.enclosure.u_n)
    assert within(root.u_t, root.enclosure.u_t)
