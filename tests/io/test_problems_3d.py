"""Problems in 3D in files: round trips bit by bit, names, parts that are missing or damaged, what no file can hold."""

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from enumsol import (
    BodyMesh,
    ContactProblem,
    ContactProblem3D,
    FrictionTable,
    InvalidArgumentError,
    InvalidProblemError,
    SlipMean,
    fem,
    gallery,
    read_problem,
    write_problem,
)

MESH_PARTS = ("points", "cells", "dofs", "facets", "rows")
PLACES = ["problem.npz", "directory"]
TANGENTS = {"Bt1": np.eye(6)[[1, 4]], "Bt2": np.eye(6)[[2, 5]]}
DENSE = {"A": 2 * np.eye(6), "Bn": np.eye(6)[[0, 3]], **TANGENTS, "f": np.array([1.0, -2.0, 0.5, 1.0, 3.0, -1.0])}


def awkward_problem(friction, p=5):
    """Floats of all sizes without a short decimal form, and every optional array."""
    rng = np.random.default_rng(0)
    n, q = 24, 7
    X = sp.random_array((n, n), density=0.2, rng=rng).toarray() + np.eye(n)
    A = X @ X.T
    weights = rng.random((p, q)) * (rng.random((p, q)) < 0.5) + 0.01 * np.eye(p, q)
    return ContactProblem3D(
        sp.csc_array(0.5 * (A + A.T)),
        *(rng.normal(size=(p, n)) for _ in range(3)),
        rng.normal(size=n) * 10.0 ** rng.integers(-300, 300, size=n),
        gap=rng.normal(size=p) / 3,
        friction=friction,
        friction_slope=(rng.random(p), rng.random(p) * 1e-17),
        load_slope=rng.normal(size=n),
        slip_offset=rng.normal(size=(p, 2)),
        node_ids=[f"node {k}" for k in range(p)],
        coordinates=rng.normal(size=(p, 3)),
        areas=rng.random(p) + 0.1,
        mesh=BodyMesh.of_dofs(
            rng.normal(size=(9, 3)),
            np.array([[0, 1, 2, 3], [5, 6, 7, 8]]),
            np.arange(27)[3:],
            facets=np.array([[5, 6, 7]]),
            rows=np.array([-1]),
        ),
        slip_mean=SlipMean(
            sp.csr_array(rng.normal(size=(q, n)) * (rng.random((q, n)) < 0.3)),
            sp.csr_array(rng.normal(size=(q, n)) * (rng.random((q, n)) < 0.3)),
            rng.normal(size=(q, 2)),
            sp.csr_array(weights / weights.sum(axis=1)[:, None]),
        ),
    )


def same_matrix(one, two):
    first, second = (sp.csr_array(matrix) for matrix in (one, two))
    first.sort_indices()
    second.sort_indices()
    parts = ("indptr", "indices", "data")
    return first.shape == second.shape and all(np.array_equal(getattr(first, k), getattr(second, k)) for k in parts)


def same_array(one, two):
    if one is None or two is None:
        return one is two
    return one.dtype == two.dtype and one.shape == two.shape and one.tobytes() == two.tobytes()


def assert_same(one, two):
    """Every number the same, bit by bit."""
    assert isinstance(one, ContactProblem3D)
    for name in ("A", "Bn", "Bt1", "Bt2"):
        assert same_matrix(getattr(one, name), getattr(two, name))
    for name in ("f", "gap", "slip_offset", "load_slope", "coordinates", "areas"):
        assert same_array(getattr(one, name), getattr(two, name)), name
    assert all(map(same_array, one.friction_slope, two.friction_slope))
    if isinstance(two.law, FrictionTable):
        assert all(same_array(getattr(one.law, name), getattr(two.law, name)) for name in ("slip", "F1", "F2"))
    else:
        assert all(map(same_array, one.friction, two.friction))
        assert one.fingerprint == two.fingerprint
    assert one.node_ids == two.node_ids
    assert (one.mesh is None) == (two.mesh is None)
    if one.mesh is not None:
        assert all(same_array(getattr(one.mesh, name), getattr(two.mesh, name)) for name in MESH_PARTS)
    assert (one.slip_mean is None) == (two.slip_mean is None)
    if one.slip_mean is not None:
        assert all(
            same_matrix(getattr(one.slip_mean, name), getattr(two.slip_mean, name)) for name in ("T1", "T2", "weights")
        )
        assert same_array(one.slip_mean.offset, two.slip_mean.offset)


FRICTIONS = {
    "constants": (np.linspace(0.1, 0.7, 5) / 3, np.full(5, 1 / 7)),
    "table": FrictionTable([0.0, 1 / 3, 2.0], [0.5, 1 / 3, 0.2]),
    "a table a node": FrictionTable([0.0, 1.0], np.random.default_rng(1).random((5, 2)), [0.1, 0.3]),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("friction", FRICTIONS)
def test_round_trip_is_exact(tmp_path, place, friction):
    problem = awkward_problem(FRICTIONS[friction])
    write_problem(problem, tmp_path / place)
    assert_same(read_problem(tmp_path / place), problem)


@pytest.mark.parametrize("place", PLACES)
def test_one_node_round_trips(tmp_path, place):
    """p = 1: tables of one row or column keep their shapes."""
    problem = awkward_problem(FrictionTable([0.0, 1.0], [[0.5, 0.25]]), p=1)
    write_problem(problem, tmp_path / place)
    assert_same(read_problem(tmp_path / place), problem)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    "build",
    [
        gallery.one_node_3d,
        lambda: gallery.block3d(3, 2, 2, cells="tetrahedra"),
        lambda: gallery.block3d(4, 4, 2, multipliers="elements", ratio=2, friction=FrictionTable([0, 1], [0.5, 0.3])),
    ],
    ids=["node", "tetrahedra", "patches"],
)
def test_problems_of_the_gallery_round_trip(tmp_path, place, build):
    problem = build()
    write_problem(problem, tmp_path / place)
    copy = read_problem(tmp_path / place)
    assert_same(copy, problem)
    if problem.mesh is not None:
        assert np.array_equal(fem.h1_norms(copy).dual, fem.h1_norms(problem).dual)


def test_a_directory_changes_hands(tmp_path):
    """2D and 3D, with mesh and without: files of the problem before are gone."""
    plain = ContactProblem3D(**DENSE)
    for problem in (awkward_problem(0.5), plain, gallery.one_node_triangle(), awkward_problem(0.25), plain):
        write_problem(problem, tmp_path)
        copy = read_problem(tmp_path)
        assert copy.fingerprint == problem.fingerprint
        assert getattr(copy, "areas", None) is None or copy.p == 5


def test_dense_arrays_and_numbers_for_all_nodes(tmp_path):
    np.savez(tmp_path / "p.npz", **DENSE)
    assert_same(read_problem(tmp_path / "p.npz"), ContactProblem3D(**DENSE))
    more = {"gap": 0.125, "friction_1": 0.5, "friction_2": [0.25, 0.125], "friction_slope_2": 0.5}
    np.savez(tmp_path / "p.npz", **DENSE, **more, _note="mine")
    meant = ContactProblem3D(**DENSE, gap=0.125, friction=(0.5, [0.25, 0.125]), friction_slope=(0.0, 0.5))
    assert_same(read_problem(tmp_path / "p.npz"), meant)
    for name, array in (DENSE | more).items():
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", np.atleast_2d(np.asarray(array, dtype=float).T).T)
    assert_same(read_problem(tmp_path), meant)
    np.savez(tmp_path / "p.npz", **DENSE, friction=0.3)
    assert_same(read_problem(tmp_path / "p.npz"), ContactProblem3D(**DENSE, friction=0.3))


MESH = {"mesh_points": np.zeros((2, 3)), "mesh_cells": np.array([[0, 1, 0, 1]]), "mesh_dofs": np.arange(6)}
MEAN = {"slip_mean_T1": np.eye(6), "slip_mean_T2": np.eye(6), "slip_mean_offset": np.zeros((6, 2))}
MEAN |= {"slip_mean_weights": np.full((2, 6), 1 / 6)}
TABLE = {"friction_table_slip": [0.0, 1.0], "friction_table_1": [0.5, 0.3], "friction_table_2": [0.5, 0.3]}


def without(arrays, *names):
    return {name: array for name, array in arrays.items() if name not in names}


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (without(DENSE, "Bt2"), r"Bt2 is missing .*expected A, Bn, Bt1, Bt2 and f"),
        (without(DENSE, "Bt2") | {"T2": DENSE["Bt2"]}, r"is T2 meant as Bt2\?"),
        (without(DENSE, "Bt1", "Bt2") | {"t1": DENSE["Bt1"], "t2": DENSE["Bt2"]}, r"is t1 meant as Bt1\?"),
        (DENSE | {"Bt": DENSE["Bt1"]}, r"Bt is not known"),
        (DENSE | {"frction_1": 0.1}, r"frction_1 is not known \(is friction_1 meant\?\)"),
        (DENSE | {"mu2": 0.1}, r"mu2 is not known \(is friction_2 meant\?\)"),
        (DENSE | {"friction0": 0.1}, "friction0 is not known"),
        (DENSE | {"friction": 0.1, "friction_2": 0.1}, "friction is given together with friction_1 or friction_2"),
        (DENSE | {"friction_1": 0.1} | TABLE, "friction_1 is given together with friction_table_slip or"),
        (DENSE | {"friction_1": 0.1}, "friction_1 stands alone; expected friction_1 and friction_2, or friction"),
        (DENSE | {"friction": [0.1, 0.2]}, "friction is an array of shape .*, which is ambiguous"),
        (DENSE | without(TABLE, "friction_table_2"), "friction_table_2 is missing; expected .* all or none"),
        (DENSE | without(MESH, "mesh_dofs"), "mesh_motion is missing .*; expected .* all or none"),
        (DENSE | without(MEAN, "slip_mean_T1", "slip_mean_weights"), "slip_mean_T1, slip_mean_weights is missing"),
        (DENSE | MESH | {"mesh_points": np.zeros((2, 4))}, r"mesh_points has shape \(2, 4\); expected \(N, 2\) or"),
        (DENSE | MESH | {"mesh_points": np.zeros((3, 2)), "mesh_cells": [[0, 1, 2]]}, r"expected \(N, 3\)"),
        (DENSE | MESH | {"mesh_motion": np.eye(6)}, "mesh_dofs is given together with mesh_motion"),
        (DENSE | MESH | {"mesh_cells": [[0, 1, 2, 3]]}, r"mesh_cells holds other numbers than 0 \.\. 1"),
        (DENSE | MESH | {"mesh_cells": [[0, 1, 0, 0.5]]}, "mesh_cells holds other numbers than"),
        (
            DENSE | MESH | {"mesh_cells": [[0, 1]]},
            r"mesh_cells has shape \(1, 2\); expected \(k, m\) with m among 4, 8",
        ),
        (DENSE | MESH | {"mesh_dofs": [0, 1, 2, 3, 4, 4]}, "repeats a number"),
        (DENSE | {"mesh_rows": [0, 1]}, "mesh_points, mesh_cells, mesh_motion is missing .found mesh_rows"),
        (DENSE | MESH | {"mesh_facets": [[0, 1]]}, r"mesh_facets has shape \(1, 2\); expected \(k, m\) with m"),
        (
            DENSE | MESH | {"mesh_facets": [[0, 1, 0]], "mesh_rows": [2]},
            r"mesh_rows holds other numbers than -1 \.\. 1",
        ),
        (DENSE | MESH | {"mesh_facets": [[0, 1, 0]], "mesh_rows": [0, 1]}, r"mesh_rows has shape \(2,\); expected"),
        (DENSE | MESH | {"mesh_rows": [0]}, r"mesh_rows has shape \(1,\); expected \(k,\), one for each"),
        (DENSE | MESH | {"mesh_dofs": [0, 1]}, "mesh moves by 2 degrees of freedom; expected n = 6"),
        (DENSE | MEAN | {"slip_mean_weights": -np.eye(2, 6)}, "slip_mean has a negative weight"),
        (DENSE | MEAN | {"slip_mean_T1": np.eye(5)}, "slip_mean has T1, T2, offset, weights of shapes"),
        (DENSE | MEAN | {"slip_mean_T1": np.full((6, 6), np.nan)}, "slip_mean_T1 has the value nan"),
        (DENSE | {"slip_offset": [1.0, 2.0]}, r"slip_offset has shape \(2,\); expected \(p, 2\) = \(2, 2\)"),
        (DENSE | {"areas": [1.0, 0.0]}, "areas has the value 0; expected areas > 0"),
    ],
)
def test_files_that_cannot_be_read(tmp_path, arrays, message):
    np.savez(tmp_path / "p.npz", **arrays)
    with pytest.raises(InvalidProblemError, match=message) as caught:
        read_problem(tmp_path / "p.npz")
    assert str(caught.value).startswith(str(tmp_path / "p.npz"))


@pytest.mark.parametrize("place", PLACES)
def test_a_callable_cannot_be_written(tmp_path, place):
    def friction(node, slip):
        return 0.5 / (1.0 + slip)

    problem = ContactProblem3D(**DENSE, friction=friction)
    with pytest.raises(InvalidProblemError, match=r"friction is friction\(node, \|u_t\|\), which no file can hold"):
        write_problem(problem, tmp_path / place)
    assert not (tmp_path / place).exists()


def test_only_problems_are_written(tmp_path):
    with pytest.raises(InvalidArgumentError, match="problem is a dict; expected a ContactProblem"):
        write_problem(DENSE, tmp_path / "p.npz")
    assert isinstance(gallery.one_node_triangle(), ContactProblem)
