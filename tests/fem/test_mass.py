"""Consistent mass of meshes, and densities by parts of the body."""

import numpy as np
import pytest
import scipy.sparse as sp

import enumsol
from enumsol import fem
from enumsol.model.mesh import consistent_mass

MATERIAL = {"young": 2.5, "poisson": 0.25, "friction": 0.5, "load": {"top": (0.3, -1.0)}}
TRIANGLE, TETRAHEDRON = [[0, 0], [1, 0], [0, 1]], [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def middles(corners, edges):
    """Corners and the middles of edges."""
    corners = np.array(corners, dtype=float)
    return np.concatenate([corners, [(corners[i] + corners[j]) / 2 for i, j in edges]])


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
CUBE = [[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
#: One cell of every kind, with its nodes in the order of VTK, and its volume.
CELLS = {
    "triangle": (TRIANGLE, 1 / 2),
    "quadratic triangle": (middles(TRIANGLE, [(0, 1), (1, 2), (2, 0)]), 1 / 2),
    "quadrilateral": (SQUARE, 1.0),
    "8 nodes": (middles(SQUARE, [(0, 1), (1, 2), (2, 3), (3, 0)]), 1.0),
    "9 nodes": (np.vstack([middles(SQUARE, [(0, 1), (1, 2), (2, 3), (3, 0)]), [[0.5, 0.5]]]), 1.0),
    "tetrahedron": (TETRAHEDRON, 1 / 6),
    "quadratic tetrahedron": (middles(TETRAHEDRON, [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]), 1 / 6),
    "hexahedron": (CUBE, 1.0),
}


@pytest.mark.parametrize("name", CELLS)
def test_mass_of_a_cell(name):
    points, volume = CELLS[name]
    points = np.array(points, dtype=float)
    stretch = np.diag([2.0, 3.0, 5.0][: points.shape[1]])
    M = consistent_mass(points @ stretch, np.arange(len(points))[None], np.array([7.0])).toarray()
    whole = 7.0 * volume * np.linalg.det(stretch)
    assert M.sum() == pytest.approx(whole)
    # linear fields are known to every element: int x, int x y
    x, y = (points @ stretch)[:, :2].T
    assert M @ np.ones(len(points)) @ x == pytest.approx(x @ M.sum(axis=1))
    assert np.linalg.eigvalsh(M)[0] > 0
    first = {"triangle": 1 / 3, "tetrahedron": 1 / 4}.get(name.removeprefix("quadratic "), 1 / 2)
    assert np.ones(len(points)) @ M @ x == pytest.approx(whole * first * 2.0)
    second = {"triangle": 1 / 12, "tetrahedron": 1 / 20}.get(name.removeprefix("quadratic "), 1 / 4)
    assert x @ M @ y == pytest.approx(whole * second * 6.0)


def problem(**more):
    return fem.mesh_problem(fem.rectangle(4, 2).parted(), clamp="left", contact="bottom", **MATERIAL | more)


def test_a_problem_of_a_mesh_has_the_mass_of_a_uniform_density():
    made = problem()
    assert made.mass is None
    M = made.inertia
    assert M.shape == (made.n, made.n)
    everywhere = made.mesh.motion.T @ np.tile([1.0, 0.0], len(made.mesh.points))
    free = fem.mesh_problem(fem.rectangle(4, 2).parted(), contact="bottom", max_rigid_displacement="auto", **MATERIAL)
    assert free.inertia.sum() == pytest.approx(2.0)  # area, in both directions
    assert everywhere @ M @ everywhere < 1.0


def test_a_density_is_the_mass_of_the_problem():
    made, plain = problem(density=3.0), problem()
    assert made.fingerprint != plain.fingerprint
    assert abs(made.mass - 3.0 * plain.inertia).max() < 1e-15
    (root,) = enumsol.enumerate_roots(made, 0)
    assert root.problem.inertia.nnz == made.mass.nnz


def test_thickness_by_parts_is_in_the_mass(tmp_path):
    uniform = problem(thickness=2.0)
    assert uniform.mass is None
    meshed = fem.rectangle(4, 2).parted()
    with pytest.raises(enumsol.errors.InvalidArgumentError, match="density is -1; expected"):
        fem.mesh_problem(meshed, clamp="left", contact="bottom", density=-1, **MATERIAL)


def test_what_is_held_by_symmetry_has_no_part_in_a_motion():
    made = fem.mesh_problem(fem.rectangle(4, 2).parted(), symmetry="left", clamp="right", contact="bottom", **MATERIAL)
    alone = np.flatnonzero(np.diff(made.A.indptr) == 1)
    assert len(alone)
    M = sp.csr_array(made.inertia)
    assert np.all(np.diff(M.indptr)[alone] == 1)
    heavy = fem.mesh_problem(
        fem.rectangle(4, 2).parted(), symmetry="left", clamp="right", contact="bottom", density=1.0, **MATERIAL
    )
    assert abs(heavy.mass - M).max() < 1e-15


def test_a_file_with_a_density(tmp_path):
    fem.rectangle(4, 2).parted()
    import meshio

    cells = [("quad", [[0, 1, 2, 3]]), ("line", [[0, 1], [2, 3]])]
    data = {"part": [[0], [1, 2]]}
    meshio.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], cells, cell_data=data).write(tmp_path / "square.vtu")
    lines = ["mesh = 'square.vtu'", "groups = 'part'", "young = 2.5", "poisson = 0.25", "density = 3.0"]
    text = "\n".join([*lines, "clamp = '2'", "contact = '1'"])
    (tmp_path / "square.toml").write_text(text)
    read = fem.read_mesh_problem(tmp_path / "square.toml")
    enumsol.write_problem(read, tmp_path / "square.npz")
    again = enumsol.read_problem(tmp_path / "square.npz")
    assert again.fingerprint == read.fingerprint
    assert (again.mass != read.mass).nnz == 0
