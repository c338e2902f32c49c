import os
import re
import shutil

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from enumsol import (
    ContactProblem,
    InvalidArgumentError,
    InvalidProblemError,
    enumerate_roots,
    gallery,
    read_problem,
    write_problem,
)

A = np.array([[2.0, -0.5, 0.0, 0.0], [-0.5, 2.0, -0.5, 0.0], [0.0, -0.5, 2.0, -0.5], [0.0, 0.0, -0.5, 2.0]])
DENSE = {"A": A, "Bn": np.eye(4)[[0, 2]], "Bt": np.eye(4)[[1, 3]], "f": np.array([1.0, -2.0, 0.5, 1.0])}


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
        sp.csc_array(0.5 * (A + A.T)),
        sp.csr_array(sp.random_array((p, n), density=0.5, rng=rng)),
        rng.normal(size=(p, n)),
        f,
        gap=rng.normal(size=p) / 3,
        friction=(rng.random(p), rng.random(p) * 1e-17),
        load_slope=rng.normal(size=n),
        slip_offset=rng.normal(size=p),
        node_ids=node_ids,
        coordinates=rng.normal(size=(p, 2)),
    )


def assert_same(one, two):
    """Every number the same, bit by bit."""
    for name in ("A", "Bn", "Bt"):
        first, second = sp.csc_array(getattr(one, name)), sp.csc_array(getattr(two, name))
        first.sort_indices()
        second.sort_indices()
        assert first.shape == second.shape
        for part in ("indptr", "indices", "data"):
            assert np.array_equal(getattr(first, part), getattr(second, part))
    for name in ("f", "gap", "slip_offset", "load_slope", "coordinates"):
        first, second = getattr(one, name), getattr(two, name)
        assert (first is None) == (second is None)
        if first is not None:
            assert first.tobytes() == second.tobytes()
    for first, second in zip(one.friction, two.friction, strict=True):
        assert first.tobytes() == second.tobytes()
    assert one.node_ids == two.node_ids
    assert [type(label) for label in one.node_ids] == [type(label) for label in two.node_ids]


@pytest.mark.parametrize("place", ["problem.npz", "directory"])
@pytest.mark.parametrize(
    "labels", [None, [4, 8, 15, 16, 23], ["a", "b", "ü 1", "1", ""], [0.1, 0.2, 0.3, 1e300, 5e-324]]
)
def test_round_trip_is_exact(tmp_path, place, labels):
    problem = awkward_problem(labels)
    write_problem(problem, tmp_path / place)
    assert_same(read_problem(tmp_path / place), problem)
    write_problem(problem, tmp_path / place)  # replaces itself
    assert_same(read_problem(str(tmp_path / place)), problem)


@pytest.mark.parametrize("place", ["problem.npz", "directory"])
@pytest.mark.parametrize("name", ["one-node-6.1", "two-node-6.7-minus", "clamped-block-8", "wedge-8-5", "chain-4"])
def test_the_gallery_round_trips(tmp_path, place, name):
    entry = gallery.get(name)
    problem = entry.build()
    write_problem(problem, tmp_path / place)
    copy = read_problem(tmp_path / place)
    assert_same(copy, problem)
    before, after = enumerate_roots(problem, entry.alpha), enumerate_roots(copy, entry.alpha)
    assert [root.statuses for root in before] == [root.statuses for root in after]


def test_dense_arrays_and_numpy_savez(tmp_path):
    np.savez(tmp_path / "plain.npz", **DENSE)
    assert_same(read_problem(tmp_path / "plain.npz"), ContactProblem(**DENSE))
    options = {"gap": 0.125, "load_slope": np.ones(4), "slip_offset": np.ones(2), "coordinates": [[0, 0], [1, 0]]}
    np.savez(tmp_path / "more.npz", **DENSE, **options, friction0=0.5, friction1=np.array([1.0, 2.0]), _note="mine")
    assert_same(read_problem(tmp_path / "more.npz"), ContactProblem(**DENSE, **options, friction=(0.5, [1.0, 2.0])))


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
    assert_same(read_problem(tmp_path / "p.npz"), ContactProblem(**DENSE, friction=meant))
    for name, array in (DENSE | stored).items():
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", np.atleast_2d(np.asarray(array, dtype=float).T).T)
    assert_same(read_problem(tmp_path), ContactProblem(**DENSE, friction=meant))


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
    (tmp_path / "f.mtx").write_text("%%MatrixMarket matrix array real general\n1 4\n1\n-2\n0.5\n1\n")
    (tmp_path / "gap.mtx").write_text("%%MatrixMarket matrix array real general\n1 1\n0.25\n")
    (tmp_path / "slip_offset.mtx").write_text("%%MatrixMarket matrix coordinate real general\n2 1 1\n2 1 0.5\n")
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
    (place / "mass.mtx").write_text("of somebody else")
    with pytest.raises(InvalidProblemError, match=r"mass\.mtx is not known"):
        write_problem(plain, place)
    assert (place / "mass.mtx").exists()


# -- what is refused -------------------------------------------------------------------------------------------------


def without(*names):
    return {name: array for name, array in DENSE.items() if name not in names}


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


@pytest.mark.parametrize("case", BAD_ARRAYS)
def test_bad_arrays_get_one_sentence(tmp_path, case):
    arrays, pattern = BAD_ARRAYS[case]
    place = tmp_path / "bad.npz"
    np.savez(place, **arrays)
    with pytest.raises(InvalidProblemError, match=pattern) as caught:
        read_problem(place)
    assert_one_sentence(caught.value, place)


def assert_one_sentence(error, place):
    message = str(error)
    assert message.startswith(f"{place}: ")
    assert "\n" not in message
    assert not message.endswith(".")
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
    with pytest.raises(InvalidProblemError, match=pattern) as caught:
        read_problem(tmp_path / "p.npz")
    assert_one_sentence(caught.value, tmp_path / "p.npz")


def test_pickled_objects_are_never_loaded(tmp_path):
    place = tmp_path / "p.npz"
    np.savez(place, allow_pickle=True, **(DENSE | {"A": np.array(sp.csc_array(A), dtype=object)}))
    with pytest.raises(
        InvalidProblemError, match=r"A is a pickled Python object, which is never loaded; .* A_data, A_ind"
    ):
        read_problem(place)


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04 but not further", b"\x93NUMPY\x01\x00", bytes(1000)])
@pytest.mark.parametrize("name", ["p.npz", "p.h5"])
def test_a_file_that_is_no_problem_file(tmp_path, name, content):
    place = tmp_path / name
    place.write_bytes(content)
    with pytest.raises(InvalidProblemError, match=r"it is not a ") as caught:
        read_problem(place)
    assert_one_sentence(caught.value, place)


@pytest.mark.slow
def test_truncated_and_damaged_archives(tmp_path):
    # an unreadable file is named as such; where the damage leaves it readable, checksums see to it that it is the same
    good, place = tmp_path / "good.npz", tmp_path / "bad.npz"
    problem = gallery.one_node_triangle()
    write_problem(problem, good)
    raw = good.read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for k in range(400):
        damaged = bytearray(raw[: rng.integers(len(raw))] if k % 2 else raw)
        if not k % 2:
            where = int(rng.integers(len(raw)))
            damaged[where : where + 4] = rng.integers(0, 256, size=4, dtype=np.uint8).tobytes()
        place.write_bytes(bytes(damaged[: len(raw)]))
        try:
            assert_same(read_problem(place), problem)
        except InvalidProblemError as error:
            assert_one_sentence(error, place)
            refused += 1
    assert refused > 300


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
    with pytest.raises(InvalidProblemError, match=pattern) as caught:
        read_problem(tmp_path / name)
    assert_one_sentence(caught.value, tmp_path / name)


@pytest.mark.parametrize(
    ("file", "text", "pattern"),
    [
        ("A.mtx", None, r"A\.mtx is missing \(found Bn\.mtx, .*\); expected A\.mtx, Bn\.mtx, Bt\.mtx and f\.mtx"),
        ("A.mtx", "", r"A\.mtx is not a readable MatrixMarket file"),
        ("A.mtx", "hello", r"A\.mtx is not a readable MatrixMarket file"),
        ("A.mtx", "%%MatrixMarket matrix coordinate real general\n4 4 3\n1 1 2\n", r"A\.mtx is not a readable"),
        ("A.mtx", "%%MatrixMarket matrix coordinate real general\n4 4 1\n9 9 2\n", r"A\.mtx is not a readable"),
        ("A.mtx", "%%MatrixMarket matrix coordinate complex general\n4 4 1\n1 1 2 3\n", "A has complex entries"),
        (
            "f.mtx",
            "%%MatrixMarket matrix array real general\n2 2\n1\n2\n3\n4\n",
            r"f\.mtx holds a 2 x 2 matrix; expected a vec",
        ),
        # the first three crash the reader of scipy 1.17
        (
            "gap.mtx",
            "%%MatrixMarket matrix array real general\n%\n2 1\n0.0=000000000000000e+",
            r"gap\.mtx is not a readable",
        ),
        ("gap.mtx", "%%MatrixMarket matrix array real general\n%\n2 1\n0.0\n0.x0\n", "a word in it is not a number"),
        (
            "A.mtx",
            "%%MatrixMarket matrix coordinate real general\n4 4 2\n1 1 2.0\n2 2 1.0e",
            r"A\.mtx is not a readable",
        ),
        (
            "A.mtx",
            "%%MatrixMarket matrix coordinate real general\n4 4 99999999999\n1 1 2\n",
            "cannot hold 4 x 4 entries",
        ),
        (
            "f.mtx",
            "%%MatrixMarket matrix array real general\n99999999999 1\n1\n",
            "cannot hold 99999999999 x 1 entries",
        ),
        ("f.mtx", "%%MatrixMarket matrix array real general\n3 1\n1\n2\n3\n", r"f has shape \(3,\); expected \(4,\)"),
        ("f.mtx", "%%MatrixMarket matrix array real general\n4 1\n1\nnan\n3\n4\n", "f has the value nan"),
        ("gaps.mtx", "x", r"gaps\.mtx is not known \(is gap\.mtx meant\?\)"),
        ("friction.mtx", "%%MatrixMarket matrix array real general\n2 1\n1\n2\n", "friction is an array of shape"),
        ("node_ids.json", "[1,", r"node_ids\.json is not JSON"),
        ("node_ids.json", '{"a": 1}', r"node_ids\.json holds something else; expected a list"),
        ("node_ids.json", "[1, 2, 3]", "node_ids has 3 entries"),
    ],
)
def test_bad_matrix_market_directories(tmp_path, file, text, pattern):
    place = tmp_path / "p"
    write_problem(ContactProblem(**DENSE, friction=0.5), place)
    if file == "friction.mtx":
        (place / "friction0.mtx").unlink()
        (place / "friction1.mtx").unlink()
    if text is None:
        (place / file).unlink()
    else:
        (place / file).write_text(text)
    with pytest.raises(InvalidProblemError, match=pattern) as caught:
        read_problem(place)
    assert_one_sentence(caught.value, place)


def test_labels_that_a_format_cannot_keep(tmp_path):
    mixed = ContactProblem(**DENSE, node_ids=["a", 1])
    with pytest.raises(InvalidProblemError, match=r"node_ids cannot be kept in a \.npz file; expected"):
        write_problem(mixed, tmp_path / "p.npz")
    write_problem(mixed, tmp_path / "p")
    assert read_problem(tmp_path / "p").node_ids == ("a", 1)
    with pytest.raises(InvalidProblemError, match=r"node_ids cannot be kept in node_ids\.json"):
        write_problem(ContactProblem(**DENSE, node_ids=[(0, 1), (0, 2)]), tmp_path / "q")
    assert not (tmp_path / "q").exists()


def test_places_that_cannot_be_written(tmp_path):
    problem = ContactProblem(**DENSE)
    with pytest.raises(InvalidArgumentError, match=r"its name ends in '\.txt'; expected a \.npz file"):
        write_problem(problem, tmp_path / "p.txt")
    for place in (tmp_path / "no" / "p.npz", tmp_path / "no" / "p"):
        with pytest.raises(InvalidArgumentError, match=re.escape(f"path {place} cannot be written (No such file")):
            write_problem(problem, place)
    with pytest.raises(InvalidArgumentError, match="problem is a int; expected a ContactProblem"):
        write_problem(3, tmp_path / "p.npz")
    with pytest.raises(InvalidArgumentError, match="path is a int; expected the name of a file or directory"):
        read_problem(3)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_places_that_may_not_be_read(tmp_path):
    place = tmp_path / "p.npz"
    write_problem(ContactProblem(**DENSE), place)
    place.chmod(0)
    with pytest.raises(InvalidProblemError, match=r"it cannot be read \(Permission denied\)"):
        read_problem(place)


def test_a_written_archive_is_plain_numpy(tmp_path):
    # the documented names, readable without enumsol
    place = tmp_path / "p.npz"
    problem = awkward_problem(["a", "b", "c", "d", "e"])
    write_problem(problem, place)
    with np.load(place, allow_pickle=False) as archive:
        arrays = dict(archive)
    assert int(arrays["enumsol_format"]) == 1
    assert str(arrays["A_format"]) == "csc"
    assert tuple(arrays["Bn_shape"]) == (5, 24)
    rebuilt = sp.csc_array((arrays["A_data"], arrays["A_indices"], arrays["A_indptr"]), shape=arrays["A_shape"])
    assert np.array_equal(rebuilt.toarray(), problem.A.toarray())
    assert set(arrays) >= {"f", "gap", "friction0", "friction1", "load_slope", "slip_offset", "node_ids", "coordinates"}
    shutil.copy(place, tmp_path / "copy.npz")
    assert_same(read_problem(tmp_path / "copy.npz"), problem)
