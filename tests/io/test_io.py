"""Problems in files: round trips bit by bit, names, parts that are missing or damaged, what no file can hold."""

import functools
import os
import re
import shutil

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from plain_arrays import DENSE, A
from refusals import bad_argument, bad_problem

from enumsol import (
    BodyMesh,
    ContactProblem,
    ContactProblem3D,
    FrictionTable,
    InvalidProblemError,
    SlipMean,
    enumerate_roots,
    fem,
    gallery,
    read_problem,
    write_problem,
)

ROWS_3D = {"Bn": np.eye(6)[[0, 3]], "Bt1": np.eye(6)[[1, 4]], "Bt2": np.eye(6)[[2, 5]]}
DENSE_3D = {"A": 2 * np.eye(6), **ROWS_3D, "f": np.array([1.0, -2.0, 0.5, 1.0, 3.0, -1.0])}
MESH_PARTS = ("points", "cells", "facets", "rows", "offset")
PLACES = ["problem.npz", "directory"]
#: First lines of MatrixMarket files.
ARRAY, SPARSE = (f"%%MatrixMarket matrix {kind} real general\n" for kind in ("array", "coordinate"))


def awkward_problem(node_ids=None):
    """Floats without a short decimal form, of all sizes, and every optional field."""
    rng = np.random.default_rng(0)
    n, p = 24, 5
    scale = np.exp2(rng.integers(-30, 30, size=n))
    X = sp.random_array((n, n), density=0.2, rng=rng).toarray() + np.eye(n)
    A = scale[:, None] * (X @ X.T) * scale
    f = rng.normal(size=n) * 10.0 ** rng.integers(-300, 300, size=n)
    f[:3] = (5e-324, -0.0, np.nextafter(1.0, 2.0))
    return ContactProblem(
        sp.csc_array(0.5 * (A + A.T)), sp.csr_array(sp.random_array((p, n), density=0.5, rng=rng)),
        rng.normal(size=(p, n)), f, gap=rng.normal(size=p) / 3, friction=rng.random(p),
        friction_slope=rng.random(p) * 1e-17,
        load_slope=rng.normal(size=n), slip_offset=rng.normal(size=p), node_ids=node_ids,
        coordinates=rng.normal(size=(p, 2)),
    )  # fmt: skip


def awkward_problem_3d(friction, p=5):
    """Floats of all sizes without a short decimal form, and every optional array."""
    rng = np.random.default_rng(0)
    n, q = 24, 7
    X = sp.random_array((n, n), density=0.2, rng=rng).toarray() + np.eye(n)
    A = X @ X.T
    weights = rng.random((p, q)) * (rng.random((p, q)) < 0.5) + 0.01 * np.eye(p, q)
    cells, facets = np.array([[0, 1, 2, 3], [5, 6, 7, 8]]), {"facets": np.array([[5, 6, 7]]), "rows": np.array([-1])}
    T1, T2 = (sp.csr_array(rng.normal(size=(q, n)) * (rng.random((q, n)) < 0.3)) for _ in range(2))
    mean = SlipMean(T1, T2, rng.normal(size=(q, 2)), sp.csr_array(weights / weights.sum(axis=1)[:, None]))
    return ContactProblem3D(
        sp.csc_array(0.5 * (A + A.T)), *(rng.normal(size=(p, n)) for _ in range(3)),
        rng.normal(size=n) * 10.0 ** rng.integers(-300, 300, size=n), gap=rng.normal(size=p) / 3, friction=friction,
        friction_slope=(rng.random(p), rng.random(p) * 1e-17), load_slope=rng.normal(size=n),
        slip_offset=rng.normal(size=(p, 2)), node_ids=[f"node {k}" for k in range(p)],
        coordinates=rng.normal(size=(p, 3)), areas=rng.random(p) + 0.1, slip_mean=mean,
        mesh=BodyMesh.of_dofs(rng.normal(size=(9, 3)), cells, np.arange(27)[3:], **facets),
    )  # fmt: skip


def assert_same_parts(one, two, *names):
    """Arrays, sparse matrices, tuples of arrays and what is missing are the same, bit by bit."""
    for name in names:
        assert same(getattr(one, name), getattr(two, name)), name


def same(one, two):
    if one is None or two is None:
        return one is two
    if isinstance(one, tuple):
        return all(map(same, one, two))
    if sp.issparse(one):
        one, two = (sp.csr_array(matrix) for matrix in (one, two))
        one.sort_indices()
        two.sort_indices()
        return all(np.array_equal(getattr(one, k), getattr(two, k)) for k in ("shape", "indptr", "indices", "data"))
    return one.dtype == two.dtype and one.shape == two.shape and one.tobytes() == two.tobytes()


def assert_same(one, two):
    """Every number the same, bit by bit."""
    assert type(one) is type(two)
    space = isinstance(one, ContactProblem3D)
    more = ("Bt1", "Bt2", "areas", "friction_slope") if space else ("Bt",)
    assert_same_parts(one, two, "A", "Bn", "f", "gap", "slip_offset", "load_slope", "coordinates", *more)
    if space and isinstance(two.law, FrictionTable):
        assert_same_parts(one.law, two.law, "slip", "F1", "F2")
    else:
        assert_same_parts(one, two, "friction")
        assert one.fingerprint == two.fingerprint
    assert one.node_ids == two.node_ids
    assert [type(label) for label in one.node_ids] == [type(label) for label in two.node_ids]
    parts = {"mesh": ("motion", *MESH_PARTS)} | ({"slip_mean": ("T1", "T2", "weights", "offset")} if space else {})
    for part, names in parts.items():
        ours, theirs = getattr(one, part), getattr(two, part)
        assert (ours is None) == (theirs is None)
        if ours is not None:
            assert_same_parts(ours, theirs, *names)


LABELS = (None, [4, 8, 15, 16, 23], ["a", "b", "ü 1", "1", ""], [0.1, 0.2, 0.3, 1e300, 5e-324])
FRICTIONS = {
    "constants": (np.linspace(0.1, 0.7, 5) / 3, np.full(5, 1 / 7)),
    "table": FrictionTable([0.0, 1 / 3, 2.0], [0.5, 1 / 3, 0.2]),
    "a table a node": FrictionTable([0.0, 1.0], np.random.default_rng(1).random((5, 2)), [0.1, 0.3]),
}
AWKWARD = {
    **{f"labels {k}": functools.partial(awkward_problem, labels) for k, labels in enumerate(LABELS)},
    **{name: functools.partial(awkward_problem_3d, friction) for name, friction in FRICTIONS.items()},
    # tables of one row or column keep their shapes
    "one node": lambda: awkward_problem_3d(FrictionTable([0.0, 1.0], [[0.5, 0.25]]), p=1),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", AWKWARD)
def test_round_trip_is_exact(tmp_path, place, name):
    problem = AWKWARD[name]()
    write_problem(problem, tmp_path / place)
    assert_same(read_problem(tmp_path / place), problem)
    write_problem(problem, tmp_path / place)  # replaces itself
    assert_same(read_problem(str(tmp_path / place)), problem)


PATCHES = {"multipliers": "elements", "ratio": 2, "friction": FrictionTable([0, 1], [0.5, 0.3])}
GALLERY = {
    **{name: gallery.get(name).build for name in ("one-node-6.1", "two-node-6.7-minus", "clamped-block-8", "chain-4")},
    **{"wedge-8-5": gallery.get("wedge-8-5").build, "node": gallery.one_node_3d},
    "tetrahedra": lambda: gallery.block3d(3, 2, 2, cells="tetrahedra"),
    "patches": lambda: gallery.block3d(4, 4, 2, **PATCHES),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", GALLERY)
def test_the_gallery_round_trips(tmp_path, place, name):
    problem = GALLERY[name]()
    write_problem(problem, tmp_path / place)
    copy = read_problem(tmp_path / place)
    assert_same(copy, problem)
    if isinstance(problem, ContactProblem):
        before, after = (enumerate_roots(one, gallery.get(name).alpha) for one in (problem, copy))
        assert [root.statuses for root in before] == [root.statuses for root in after]
    elif problem.mesh is not None:
        assert np.array_equal(fem.h1_norms(copy).dual, fem.h1_norms(problem).dual)


def test_dense_arrays_and_numpy_savez(tmp_path):
    np.savez(tmp_path / "plain.npz", **DENSE)
    assert_same(read_problem(tmp_path / "plain.npz"), ContactProblem(**DENSE))
    options = {"gap": 0.125, "load_slope": np.ones(4), "slip_offset": np.ones(2), "coordinates": [[0, 0], [1, 0]]}
    np.savez(tmp_path / "more.npz", **DENSE, **options, friction0=0.5, friction1=np.array([1.0, 2.0]), _note="mine")
    assert_same(
        read_problem(tmp_path / "more.npz"), ContactProblem(**DENSE, **options, friction=0.5, friction_slope=[1.0, 2.0])
    )


@pytest.mark.parametrize(
    ("stored", "meant"),
    [
        ({"friction": 0.3}, (0.3, 0.0)),
        ({"friction": 2}, (2.0, 0.0)),
        ({"friction0": 0.3}, (0.3, 0.0)),
        ({"friction1": np.array([0.3, 0.4])}, (0.0, [0.3, 0.4])),
        ({}, (0.0, 1.0)),
    ],
)
def test_friction_in_files(tmp_path, stored, meant):
    np.savez(tmp_path / "p.npz", **DENSE, **stored)
    assert_same(read_problem(tmp_path / "p.npz"), ContactProblem(**DENSE, friction=meant[0], friction_slope=meant[1]))
    write_matrix_market(tmp_path, DENSE | stored)
    assert_same(read_problem(tmp_path), ContactProblem(**DENSE, friction=meant[0], friction_slope=meant[1]))


def write_matrix_market(folder, arrays):
    for name, array in arrays.items():
        scipy.io.mmwrite(folder / f"{name}.mtx", np.atleast_2d(np.asarray(array, dtype=float).T).T)


def test_dense_arrays_and_numbers_for_all_nodes_in_3d(tmp_path):
    np.savez(tmp_path / "p.npz", **DENSE_3D)
    assert_same(read_problem(tmp_path / "p.npz"), ContactProblem3D(**DENSE_3D))
    more = {"gap": 0.125, "friction_1": 0.5, "friction_2": [0.25, 0.125], "friction_slope_2": 0.5}
    np.savez(tmp_path / "p.npz", **DENSE_3D, **more, _note="mine")
    meant = ContactProblem3D(**DENSE_3D, gap=0.125, friction=(0.5, [0.25, 0.125]), friction_slope=(0.0, 0.5))
    assert_same(read_problem(tmp_path / "p.npz"), meant)
    write_matrix_market(tmp_path, DENSE_3D | more)
    assert_same(read_problem(tmp_path), meant)
    np.savez(tmp_path / "p.npz", **DENSE_3D, friction=0.3)
    assert_same(read_problem(tmp_path / "p.npz"), ContactProblem3D(**DENSE_3D, friction=0.3))


def test_sparse_parts_by_hand(tmp_path):
    parts = {}
    for name, kind in (("A", sp.csr_array), ("Bn", sp.csc_array), ("Bt", sp.csr_array)):
        matrix = kind(DENSE[name])
        parts |= {f"{name}_{part}": getattr(matrix, part) for part in ("data", "indices", "indptr", "shape", "format")}
    np.savez(tmp_path / "p.npz", f=DENSE["f"], **parts)
    assert_same(read_problem(tmp_path / "p.npz"), ContactProblem(**DENSE))


def test_matrix_market_of_other_programs(tmp_path):
    # symmetric storage, integers, a row vector, a sparse vector, one number for all nodes, comments, other files
    (tmp_path / "A.mtx").write_text(
        "%%MatrixMarket matrix coordinate real symmetric\n% from elsewhere\n"
        "4 4 7\n1 1 2\n2 2 2\n3 3 2\n4 4 2.0\n2 1 -5e-1\n3 2 -0.5\n4 3 -0.5\n"
    )
    (tmp_path / "Bn.mtx").write_text("%%MatrixMarket matrix coordinate integer general\n2 4 2\n1 1 1\n2 3 1\n")
    (tmp_path / "Bt.mtx").write_text("%%MatrixMarket matrix coordinate pattern general\n2 4 2\n1 2\n2 4\n")
    (tmp_path / "f.mtx").write_text(ARRAY + "1 4\n1\n-2\n0.5\n1\n")
    (tmp_path / "gap.mtx").write_text(ARRAY + "1 1\n0.25\n")
    (tmp_path / "slip_offset.mtx").write_text(SPARSE + "2 1 1\n2 1 0.5\n")
    (tmp_path / "_mesh.mtx").write_text("not for enumsol")
    (tmp_path / "README").write_text("nor this")
    assert_same(read_problem(tmp_path), ContactProblem(**DENSE, gap=0.25, slip_offset=[0.0, 0.5]))


def test_a_directory_is_replaced_without_leftovers(tmp_path):
    place = tmp_path / "p"
    write_problem(awkward_problem(), place)
    (place / "_notes.mtx").write_text("kept")
    plain = ContactProblem(**DENSE)
    write_problem(plain, place)
    assert_same(read_problem(place), plain)
    assert (place / "_notes.mtx").exists()
    (place / "damping.mtx").write_text("of somebody else")
    bad_problem(r"damping\.mtx is not known", write_problem, plain, place)
    assert (place / "damping.mtx").exists()


def test_a_directory_changes_hands(tmp_path):
    """2D and 3D, with mesh and without: files of the problem before are gone."""
    plain = ContactProblem3D(**DENSE_3D)
    for problem in (awkward_problem_3d(0.5), plain, gallery.one_node_triangle(), awkward_problem_3d(0.25), plain):
        write_problem(problem, tmp_path)
        copy = read_problem(tmp_path)
        assert copy.fingerprint == problem.fingerprint
        assert getattr(copy, "areas", None) is None or copy.p == 5


# -- what is refused -------------------------------------------------------------------------------------------------


def without(*names, arrays=DENSE):
    return {name: array for name, array in arrays.items() if name not in names}


MESH = {"mesh_points": np.zeros((2, 3)), "mesh_cells": np.array([[0, 1, 0, 1]]), "mesh_dofs": np.arange(6)}
MEAN = {"slip_mean_T1": np.eye(6), "slip_mean_T2": np.eye(6), "slip_mean_offset": np.zeros((6, 2))}
MEAN |= {"slip_mean_weights": np.full((2, 6), 1 / 6)}
TABLE = {"friction_table_slip": [0.0, 1.0], "friction_table_1": [0.5, 0.3], "friction_table_2": [0.5, 0.3]}

BAD_ARRAYS = {
    "missing": (without("Bt"), r"Bt is missing \(found A, Bn and f\); expected A, Bn, Bt and f"),
    "two missing": (without("Bt", "f"), r"Bt and f are missing \(found A and Bn\)"),
    "case": (without("Bn") | {"BN": DENSE["Bn"]}, r"Bn is missing \(found .*; is BN meant as Bn\?\)"),
    "underscore": (without("Bt") | {"B_t": DENSE["Bt"]}, r"is B_t meant as Bt\?"),
    "K for A": (without("A") | {"K": A}, r"A is missing \(found .*; is K meant as A\?\)"),
    "F for f": (without("f") | {"F": DENSE["f"]}, r"is F meant as f\?"),
    "nothing at all": ({}, r"A, Bn, Bt and f are missing \(found nothing\)"),
    "unnamed": ({"arr_0": A}, r"A, Bn, Bt and f are missing \(found arr_0\)"),
    "misspelt option": (DENSE | {"gaps": 0.0}, r"gaps is not known \(is gap meant\?\); expected A, Bn, .* underscore"),
    "misspelt slope": (DENSE | {"loadslope": DENSE["f"]}, r"loadslope is not known \(is load_slope meant\?\)"),
    "mu": (DENSE | {"mu": 0.3}, r"mu is not known \(is friction meant\?\)"),
    "stranger": (DENSE | {"zzz": 0.3}, r"zzz is not known; expected"),
    "friction list": (
        DENSE | {"friction": np.array([0.1, 0.2])},
        r"friction is an array of shape \(2,\), which is ambiguous; expected one number, or friction0 and friction1",
    ),
    "friction twice": (DENSE | {"friction": 0.1, "friction0": 0.2}, "friction is given together with friction0"),
    "NaN": (DENSE | {"f": np.array([1.0, np.nan, 0.0, 0.0])}, r"f has the value nan at index \(1,\)"),
    "text": (DENSE | {"f": np.array(["a", "b", "c", "d"])}, "f is not an array of real numbers"),
    "version": (
        DENSE | {"enumsol_format": 99},
        r"enumsol_format is 99; expected a whole number up to 1 \(is it from a newer",
    ),
    "version text": (DENSE | {"enumsol_format": "one"}, "enumsol_format is one"),
    "labels": (DENSE | {"node_ids": np.eye(2)}, r"node_ids has shape \(2, 2\) and type float64"),
    "both forms": (DENSE | {"A_data": A}, "A is given as a matrix and in sparse parts; expected only one of them"),
    "parts missing": (without("A") | {"A_data": A, "A_shape": (4, 4)}, "A_indices, A_indptr, A_format is missing"),
}
BAD_ARRAYS_3D = [
    (without("Bt2", arrays=DENSE_3D), r"Bt2 is missing .*expected A, Bn, Bt1, Bt2 and f"),
    (without("Bt2", arrays=DENSE_3D) | {"T2": DENSE_3D["Bt2"]}, r"is T2 meant as Bt2\?"),
    (without("Bt1", "Bt2", arrays=DENSE_3D) | {"t1": DENSE_3D["Bt1"], "t2": DENSE_3D["Bt2"]}, r"is t1 meant as Bt1\?"),
    (DENSE_3D | {"Bt": DENSE_3D["Bt1"]}, r"Bt is not known"),
    (DENSE_3D | {"frction_1": 0.1}, r"frction_1 is not known \(is friction_1 meant\?\)"),
    (DENSE_3D | {"mu2": 0.1}, r"mu2 is not known \(is friction_2 meant\?\)"),
    (DENSE_3D | {"friction0": 0.1}, "friction0 is not known"),
    (DENSE_3D | {"friction": 0.1, "friction_2": 0.1}, "friction is given together with friction_1 or friction_2"),
    (DENSE_3D | {"friction_1": 0.1} | TABLE, "friction_1 is given together with friction_table_slip or"),
    (DENSE_3D | {"friction_1": 0.1}, "friction_1 stands alone; expected friction_1 and friction_2, or friction"),
    (DENSE_3D | {"friction": [0.1, 0.2]}, "friction is an array of shape .*, which is ambiguous"),
    (DENSE_3D | without("friction_table_2", arrays=TABLE), "friction_table_2 is missing; expected .* all or none"),
    (DENSE_3D | without("mesh_dofs", arrays=MESH), "mesh_motion is missing .*; expected .* all or none"),
    (
        DENSE_3D | without("slip_mean_T1", "slip_mean_weights", arrays=MEAN),
        "slip_mean_T1, slip_mean_weights is missing",
    ),
    (DENSE_3D | MESH | {"mesh_points": np.zeros((2, 4))}, r"mesh_points has shape \(2, 4\); expected \(N, 2\) or"),
    (DENSE_3D | MESH | {"mesh_points": np.zeros((3, 2)), "mesh_cells": [[0, 1, 2]]}, r"expected \(N, 3\)"),
    (DENSE_3D | MESH | {"mesh_motion": np.eye(6)}, "mesh_dofs is given together with mesh_motion"),
    (DENSE_3D | MESH | {"mesh_cells": [[0, 1, 2, 3]]}, r"mesh_cells holds other numbers than 0 \.\. 1"),
    (DENSE_3D | MESH | {"mesh_cells": [[0, 1, 0, 0.5]]}, "mesh_cells holds other numbers than"),
    (
        DENSE_3D | MESH | {"mesh_cells": [[0, 1]]},
        r"mesh_cells has shape \(1, 2\); expected \(k, m\) with m among 4, 6, 8",
    ),
    (DENSE_3D | MESH | {"mesh_dofs": [0, 1, 2, 3, 4, 4]}, "repeats a number"),
    (DENSE_3D | {"mesh_rows": [0, 1]}, "mesh_points, mesh_cells, mesh_motion is missing .found mesh_rows"),
    (DENSE_3D | MESH | {"mesh_facets": [[0, 1]]}, r"mesh_facets has shape \(1, 2\); expected \(k, m\) with m"),
    (DENSE_3D | MESH | {"mesh_facets": [[0, 1, 0]], "mesh_rows": [2]}, r"mesh_rows holds other numbers than -1 \.\. 1"),
    (DENSE_3D | MESH | {"mesh_facets": [[0, 1, 0]], "mesh_rows": [0, 1]}, r"mesh_rows has shape \(2,\); expected"),
    (DENSE_3D | MESH | {"mesh_rows": [0]}, r"mesh_rows has shape \(1,\); expected \(k,\), one for each"),
    (DENSE_3D | MESH | {"mesh_dofs": [0, 1]}, "mesh moves by 2 degrees of freedom; expected n = 6"),
    (DENSE_3D | MEAN | {"slip_mean_weights": -np.eye(2, 6)}, "slip_mean has a negative weight"),
    (DENSE_3D | MEAN | {"slip_mean_T1": np.eye(5)}, "slip_mean has T1, T2, offset, weights of shapes"),
    (DENSE_3D | MEAN | {"slip_mean_T1": np.full((6, 6), np.nan)}, "slip_mean_T1 has the value nan"),
    (DENSE_3D | {"slip_offset": [1.0, 2.0]}, r"slip_offset has shape \(2,\); expected \(p, 2\) = \(2, 2\)"),
    (DENSE_3D | {"areas": [1.0, 0.0]}, "areas has the value 0; expected areas > 0"),
]


@pytest.mark.parametrize(("arrays", "pattern"), [*BAD_ARRAYS.values(), *BAD_ARRAYS_3D])
def test_bad_arrays_get_one_sentence(tmp_path, arrays, pattern):
    place = tmp_path / "bad.npz"
    np.savez(place, **arrays)
    refused(place, pattern)


def refused(place, pattern):
    """A file or directory is refused, by its name, in one sentence that says what was expected."""
    message = str(bad_problem(pattern, read_problem, place))
    assert message.startswith(f"{place}: ")
    assert "expected" in message


@pytest.mark.parametrize(
    ("part", "value", "pattern"),
    [
        ("format", "coo", r'A_format is \'coo\'; expected "csc" or "csr"'),
        ("shape", (4, 4, 4), r"A_shape is \[4, 4, 4\]; expected two whole numbers"),
        ("shape", (4, 9), r"the sparse parts of A do not fit together \(.*\); expected those of one csc matrix"),
        ("indices", np.array([0.5] * 10), "A_indices is not a list of whole numbers"),
        ("indices", np.full(10, 77), "the sparse parts of A do not fit together"),
        ("indices", np.arange(3), "the sparse parts of A do not fit together"),
        ("indptr", np.array([0, 2, 1, 8, 10]), "the sparse parts of A do not fit together"),
        ("data", np.array(["x"] * 10), "A_data is not a list of real numbers"),
    ],
)
def test_bad_sparse_parts(tmp_path, part, value, pattern):
    matrix = sp.csc_array(A)
    parts = {f"A_{name}": getattr(matrix, name) for name in ("data", "indices", "indptr", "shape", "format")}
    np.savez(tmp_path / "p.npz", **without("A"), **(parts | {f"A_{part}": value}))
    refused(tmp_path / "p.npz", pattern)


def test_pickled_objects_are_never_loaded(tmp_path):
    place = tmp_path / "p.npz"
    np.savez(place, allow_pickle=True, **(DENSE | {"A": np.array(sp.csc_array(A), dtype=object)}))
    bad_problem(r"A is a pickled Python object, which is never loaded; .* A_data, A_ind", read_problem, place)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 but not further", b"\x93NUMPY\x01\x00", bytes(1000)])
@pytest.mark.parametrize("name", ["p.npz", "p.h5"])
def test_a_file_that_is_no_problem_file(tmp_path, name, content):
    place = tmp_path / name
    place.write_bytes(content)
    refused(place, r"it is not a ")


@pytest.mark.slow
def test_truncated_and_damaged_archives(tmp_path):
    # an unreadable file is named as such; where the damage leaves it readable, checksums see to it that it is the same
    good, place = tmp_path / "good.npz", tmp_path / "bad.npz"
    problem = gallery.one_node_triangle()
    write_problem(problem, good)
    raw = good.read_bytes()
    rng, count = np.random.default_rng(0), 0
    for k in range(400):
        damaged = bytearray(raw[: rng.integers(len(raw))] if k % 2 else raw)
        if not k % 2:
            where = int(rng.integers(len(raw)))
            damaged[where : where + 4] = rng.integers(0, 256, size=4, dtype=np.uint8).tobytes()
        place.write_bytes(bytes(damaged[: len(raw)]))
        try:
            assert_same(read_problem(place), problem)
        except InvalidProblemError as error:
            refused(place, re.escape(str(error)))
            count += 1
    assert count > 300


@pytest.mark.parametrize(
    ("name", "pattern"),
    [
        ("nowhere.npz", "there is no such file or directory; expected a .npz file, a directory of MatrixMarket"),
        ("nowhere", "there is no such file or directory"),
        ("p.toml", r"expected a \.npz file, .* \(enumsol\.fem makes problems of meshes and \.toml files\)"),
        ("p.txt", r"its name ends in '\.txt'; expected a .npz file"),
        ("suffixless", "its name has no suffix; expected a .npz file"),
        ("f.mtx", r"one MatrixMarket file is not a problem; expected a directory with A\.mtx"),
        ("empty", r"the directory has no MatrixMarket files; expected A\.mtx, Bn\.mtx, Bt\.mtx and f\.mtx"),
    ],
)
def test_wrong_places(tmp_path, name, pattern):
    for file in ("p.txt", "suffixless", "f.mtx"):
        (tmp_path / file).write_text("x")
    (tmp_path / "empty").mkdir()
    refused(tmp_path / name, pattern)


@pytest.mark.parametrize(
    ("file", "text", "pattern"),
    [
        ("A.mtx", None, r"A\.mtx is missing \(found Bn\.mtx, .*\); expected A\.mtx, Bn\.mtx, Bt\.mtx and f\.mtx"),
        ("A.mtx", "", r"A\.mtx is not a readable MatrixMarket file"),
        ("A.mtx", "hello", r"A\.mtx is not a readable MatrixMarket file"),
        ("A.mtx", SPARSE + "4 4 3\n1 1 2\n", r"A\.mtx is not a readable"),
        ("A.mtx", SPARSE + "4 4 1\n9 9 2\n", r"A\.mtx is not a readable"),
        ("A.mtx", "%%MatrixMarket matrix coordinate complex general\n4 4 1\n1 1 2 3\n", "A has complex entries"),
        ("f.mtx", ARRAY + "2 2\n1\n2\n3\n4\n", r"f\.mtx holds a 2 x 2 matrix; expected a vec"),
        # the first three crash the reader of scipy 1.17
        ("gap.mtx", ARRAY + "%\n2 1\n0.0=000000000000000e+", r"gap\.mtx is not a readable"),
        ("gap.mtx", ARRAY + "%\n2 1\n0.0\n0.x0\n", "a word in it is not a number"),
        ("A.mtx", SPARSE + "4 4 2\n1 1 2.0\n2 2 1.0e", r"A\.mtx is not a readable"),
        ("A.mtx", SPARSE + "4 4 99999999999\n1 1 2\n", "cannot hold 4 x 4 entries"),
        ("f.mtx", ARRAY + "99999999999 1\n1\n", "cannot hold 99999999999 x 1 entries"),
        ("f.mtx", ARRAY + "3 1\n1\n2\n3\n", r"f has shape \(3,\); expected \(4,\)"),
        ("f.mtx", ARRAY + "4 1\n1\nnan\n3\n4\n", "f has the value nan"),
        ("gaps.mtx", "x", r"gaps\.mtx is not known \(is gap\.mtx meant\?\)"),
        ("friction.mtx", ARRAY + "2 1\n1\n2\n", "friction is an array of shape"),
        ("node_ids.json", "[1,", r"node_ids\.json is not JSON"),
        ("node_ids.json", '{"a": 1}', r"node_ids\.json holds something else; expected a list"),
        ("node_ids.json", "[1, 2, 3]", "node_ids has 3 entries"),
    ],
)
def test_bad_matrix_market_directories(tmp_path, file, text, pattern):
    place = tmp_path / "p"
    write_problem(ContactProblem(**DENSE, friction=0.5), place)
    for k in range(2 if file == "friction.mtx" else 0):
        (place / f"friction{k}.mtx").unlink()
    if text is None:
        (place / file).unlink()
    else:
        (place / file).write_text(text)
    refused(place, pattern)


def test_labels_that_a_format_cannot_keep(tmp_path):
    mixed = ContactProblem(**DENSE, node_ids=["a", 1])
    bad_problem(r"node_ids cannot be kept in a \.npz file; expected", write_problem, mixed, tmp_path / "p.npz")
    write_problem(mixed, tmp_path / "p")
    assert read_problem(tmp_path / "p").node_ids == ("a", 1)
    pairs = ContactProblem(**DENSE, node_ids=[(0, 1), (0, 2)])
    bad_problem(r"node_ids cannot be kept in node_ids\.json", write_problem, pairs, tmp_path / "q")
    assert not (tmp_path / "q").exists()


@pytest.mark.parametrize("place", PLACES)
def test_a_callable_cannot_be_written(tmp_path, place):
    def friction(node, slip):
        return 0.5 / (1.0 + slip)

    problem, message = ContactProblem3D(**DENSE_3D, friction=friction), r"friction is friction\(node, \|u_t\|\), which"
    bad_problem(message + " no file can hold", write_problem, problem, tmp_path / place)
    assert not (tmp_path / place).exists()


def test_places_that_cannot_be_written(tmp_path):
    problem = ContactProblem(**DENSE)
    bad_argument(r"its name ends in '\.txt'; expected a \.npz file", write_problem, problem, tmp_path / "p.txt")
    for place in (tmp_path / "no" / "p.npz", tmp_path / "no" / "p"):
        bad_argument(re.escape(f"path {place} cannot be written (No such file"), write_problem, problem, place)
    for what in (3, DENSE):
        message = f"problem is a {type(what).__name__}; expected a ContactProblem"
        bad_argument(message, write_problem, what, tmp_path / "p.npz")
    bad_argument("path is a int; expected the name of a file or directory", read_problem, 3)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_places_that_may_not_be_read(tmp_path):
    place = tmp_path / "p.npz"
    write_problem(ContactProblem(**DENSE), place)
    place.chmod(0)
    bad_problem(r"it cannot be read \(Permission denied\)", read_problem, place)


def test_a_written_archive_is_plain_numpy(tmp_path):
    # the documented names, readable without enumsol
    place = tmp_path / "p.npz"
    problem = awkward_problem(["a", "b", "c", "d", "e"])
    write_problem(problem, place)
    with np.load(place, allow_pickle=False) as archive:
        arrays = dict(archive)
    assert (int(arrays["enumsol_format"]), str(arrays["A_format"]), *arrays["Bn_shape"]) == (1, "csc", 5, 24)
    rebuilt = sp.csc_array((arrays["A_data"], arrays["A_indices"], arrays["A_indptr"]), shape=arrays["A_shape"])
    assert np.array_equal(rebuilt.toarray(), problem.A.toarray())
    assert set(arrays) >= {"f", "gap", "friction0", "friction1", "load_slope", "slip_offset", "node_ids", "coordinates"}
    shutil.copy(place, tmp_path / "copy.npz")
    assert_same(read_problem(tmp_path / "copy.npz"), problem)
