"""Files made to mislead their readers: sizes that are not there, data of other files, texts that take long to parse."""

import io
import json
import struct
import tracemalloc
import zipfile
from contextlib import contextmanager

import numpy as np
import pytest
from refusals import bad_argument, bad_problem

import enumsol
from enumsol import BranchGraph, History, fem, gallery
from enumsol.support.saved import MOST_COLUMNS, Array, Maybe, check_kind, is_fraction, json_from

TRIANGLE = gallery.one_node_triangle()
HEAD = "%%MatrixMarket matrix array real general\n"
SMALL = {"A": np.array([[2.0, -1], [-1, 2]]), "Bn": np.eye(2)[:1], "Bt": np.eye(2)[1:], "f": np.array([1.5, -4.0])}


@contextmanager
def little_memory(most=20_000_000):
    """What is read takes no more memory than this [bytes]."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()


def write_archive(place, members, shape="(10000000000,)", name="f"):
    """An archive whose member ``name`` declares a shape and has no numbers."""
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    with zipfile.ZipFile(place, "w") as archive:
        for key, value in members.items():
            stream = io.BytesIO()
            np.save(stream, value)
            archive.writestr(f"{key}.npy", stream.getvalue())
        archive.writestr(f"{name}.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head)


def write_directory(place, **matrices):
    place.mkdir()
    arrays = {name: "\n".join(map(repr, part.T.ravel().tolist())) for name, part in SMALL.items()}
    shapes = {"A": "2 2", "Bn": "1 2", "Bt": "1 2", "f": "2 1"}
    for name, numbers in arrays.items():
        (place / f"{name}.mtx").write_text(matrices.get(name, f"{HEAD}{shapes[name]}\n{numbers}\n"))
    return place


# -- sizes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["f", "zzz", "gap"])
def test_arrays_that_are_larger_than_their_archive(name, tmp_path):
    place = tmp_path / "x.npz"
    write_archive(place, {key: value for key, value in SMALL.items() if key != name}, name=name)
    with little_memory():
        bad_problem(r"declares the shape \(10000000000,\), and has \d+ bytes", enumsol.read_problem, place)
    submission = place.rename(tmp_path / "triangle-3.npz")
    with little_memory():
        bad_argument("declares the shape", enumsol.collection.check, str(submission))


def test_saved_arrays_that_are_larger_than_their_archive(tmp_path):
    place = tmp_path / "x.npz"
    write_archive(place, {"meta": np.array("{}")}, name="lambda_n")
    with little_memory():
        bad_argument("declares the shape", enumsol.Path.load, place)


def test_an_archive_that_expands(tmp_path):
    place = tmp_path / "x.npz"
    with zipfile.ZipFile(place, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("f.npy", b"\0" * 10_000_000)
    with little_memory():
        bad_problem("is compressed as numpy does not", enumsol.read_problem, place)


@pytest.mark.parametrize("kind", ["csc", "csr"])
def test_sparse_parts_of_a_matrix_without_end(kind, tmp_path):
    place, huge = tmp_path / "x.npz", 10**12
    shape = (huge, 2) if kind == "csc" else (1, huge)
    pointers = np.zeros(3 if kind == "csc" else 2, dtype=np.int64)
    part = {"data": np.zeros(0), "indices": np.zeros(0, np.int64), "indptr": pointers, "shape": shape, "format": kind}
    given = {name: array for name, array in SMALL.items() if name != "Bn"}
    np.savez(place, **given, **{f"Bn_{name}": value for name, value in part.items()})
    with little_memory():
        bad_problem("too few numbers in the file", enumsol.read_problem, place)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("A", "%%MatrixMarket matrix coordinate real general\n1000000000000 1000000000000 1\n1 1 1\n"),
        ("Bn", "%%MatrixMarket matrix coordinate real general\n1 1000000000000 1\n1 1 1\n"),
        ("f", "%%MatrixMarket matrix coordinate real general\n40000000 1 1\n1 1 1\n"),
    ],
)
def test_matrices_of_more_rows_than_entries(name, text, tmp_path):
    place = write_directory(tmp_path / "mm")
    assert enumsol.read_problem(place).n == 2
    (place / f"{name}.mtx").write_text(text)
    with little_memory():
        bad_problem(f"{name}.mtx is not a readable MatrixMarket file", enumsol.read_problem, place)


def test_a_saved_graph_with_a_matrix_without_end(tmp_path):
    place = tmp_path / "g.json"
    enumsol.branch_graph(TRIANGLE, (0, 1)).save(place)
    record = json.loads(place.read_text())
    record["problem"]["Bn"] = {"shape": [1, 10**12], "row": [], "col": [], "value": []}
    place.write_text(json.dumps(record))
    with little_memory():
        bad_argument("too few numbers in the file", BranchGraph.load, place)


# -- fclib -------------------------------------------------------------------------------------------------------------


@pytest.fixture
def local(tmp_path):
    """What writes an fclib file whose matrix is stored in some way, and reads it."""
    h5py = pytest.importorskip("h5py")
    secret = tmp_path / "outside.bin"
    secret.write_bytes(np.array([2.0, -1, -1, 2]).tobytes())
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = [2.0, -1, -1, 2]
        other.create_group("W")["x"] = [2.0, -1, -1, 2]

    def store(matrix, kind):
        layout = h5py.VirtualLayout(shape=(4,), dtype="<f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", shape=(4,))
        if kind == "file":
            matrix["x"] = [2.0, -1, -1, 2]
        elif kind == "external storage":
            matrix.create_dataset("x", shape=(4,), dtype="<f8", external=[(str(secret), 0, 32)])
        elif kind == "external link":
            matrix["x"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "/x")
        elif kind == "soft link":
            matrix["away"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "/")
            matrix["x"] = h5py.SoftLink("away/x")
        elif kind == "virtual":
            matrix.create_virtual_dataset("x", layout)
        elif kind == "texts":
            matrix["x"] = ["a", "b"]
        elif kind == "group":
            matrix.create_group("x")
        else:
            matrix.create_dataset("x", shape=(10**11,), dtype="<f8", chunks=(10**6,))

    def write(kind):
        place = tmp_path / "x.h5"
        with h5py.File(place, "w") as file:
            group = file.create_group("fclib_local")
            group["spacedim"] = np.array([2], np.int32)
            matrix = group.create_group("W")
            for name, value in {"m": 2, "n": 2, "nz": -1}.items():
                matrix[name] = np.array([value], np.int32)
            matrix["p"], matrix["i"] = np.array([0, 2, 4], np.int32), np.array([0, 1, 0, 1], np.int32)
            store(matrix, kind)
            vectors = group.create_group("vectors")
            vectors["q"], vectors["mu"] = np.array([1.0, 2]), np.array([0.5])
        return place

    return write


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("external storage", "has its numbers in another file, which is never read"),
        ("virtual", "has its numbers in another file, which is never read"),
        ("external link", r"is a link \(ExternalLink\), which is never followed"),
        ("soft link", r"is a link \(SoftLink\), which is never followed"),
        ("texts", "holds no numbers"),
        ("group", "holds no numbers"),
        ("no storage", r"stands for 800000000000 bytes, of which 0 are stored"),
    ],
)
def test_what_an_fclib_file_does_not_hold_itself(kind, message, local):
    assert enumsol.read_problem(local("file")).A.toarray().tolist() == [[2, -1], [-1, 2]]
    with little_memory():
        bad_problem(message, enumsol.read_problem, local(kind))


def test_a_whole_problem_in_another_fclib_file(local, tmp_path):
    h5py = pytest.importorskip("h5py")
    target = local("file").rename(tmp_path / "real.h5")
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["fclib_local"] = h5py.ExternalLink(str(target), "/fclib_local")
    bad_problem("fclib_local is a link", enumsol.read_problem, tmp_path / "x.h5")
    with h5py.File(tmp_path / "triangle-3.h5", "w") as file:
        file["solution"] = h5py.ExternalLink(str(target), "/fclib_local/vectors")
    bad_argument("solution is a link", enumsol.collection.check, str(tmp_path / "triangle-3.h5"))


# -- texts -------------------------------------------------------------------------------------------------------------

LONG = '{"format": "enumsol-history", "x": ' + "1" * 1_000_000 + "}"
TEXTS = [
    ("[" * 200_000, "nested too deeply"),
    ('{"x": ' * 200_000, "nested too deeply"),
    ("[" * 900 + "]" * 900, "does not hold|has another format"),
    (LONG, "a whole number in it has 1000000 digits"),
    ('{"format": 1, "format": 2}', "an object gives a name twice"),
    (b"\xff\xfe[]", "it is not JSON"),
    ("", "it is not JSON"),
]


@pytest.mark.parametrize(("text", "message"), TEXTS)
def test_texts_that_are_no_json(text, message, tmp_path):
    place = tmp_path / "x.json"
    place.write_bytes(text if isinstance(text, bytes) else text.encode())
    bad_argument(message, BranchGraph.load, place)
    bad_argument(message, History.load, place, TRIANGLE)
    submission = place.rename(tmp_path / "triangle-3.json")
    bad_argument("triangle-3.json", enumsol.collection.check, str(submission))
    labels = write_directory(tmp_path / "mm")
    (labels / "node_ids.json").write_bytes(submission.read_bytes())
    bad_problem("node_ids.json", enumsol.read_problem, labels)


@pytest.mark.parametrize(
    "line",
    [
        "a" + ".a" * 50_000 + " = 1",
        "[" + "a." * 50_000 + "a]",
        '"a"' + " . 'b'" * 50_000 + " = 1",
        "x = {" + "a." * 50_000 + "a = 1}",
        "x = " + "[" * 50_000,
        "x = " + "1" * 900_000,
    ],
)
def test_toml_that_takes_long_to_parse(line, tmp_path):
    place = tmp_path / "x.toml"
    place.write_text(f'mesh = "no.msh"\n{line}\n')
    bad_problem("it is not a TOML file", fem.read_mesh_problem, place)


@pytest.mark.parametrize("rows", [1, 2])
def test_tables_of_very_many_columns(rows, tmp_path):
    place = tmp_path / "triangle-3.csv"
    place.write_text("alpha,lambda_n_0,lambda_t_0\n" * (rows - 1) + "a," * 1_000_000 + "a\n")
    message = f"it has 1000001 columns, more than {MOST_COLUMNS}"
    bad_argument(message, enumsol.collection.check, str(place))
    bad_argument(message, enumsol.audit, str(place), enumsol.branch_graph(TRIANGLE, (0, 1)))
    from enumsol.loading.steps import read_steps

    bad_argument(message, read_steps, place)


def test_a_table_is_a_file_and_nothing_else(tmp_path):
    graph = enumsol.branch_graph(TRIANGLE, (0, 1))
    bad_argument("cannot be read", enumsol.audit, "http://localhost:9/points.csv", graph)


# -- kinds -------------------------------------------------------------------------------------------------------------


def test_kinds():
    good = {"a": 1.5, "b": [["x", 2]], "c": None, "d": [[1, 2.5]], "e": "-8/3"}
    kind = {
        "a": float,
        "b": [({"x", "y"}, range(3))],
        "c": Maybe(int),
        "d": Array(None, 2),
        "e": is_fraction,
        "f?": str,
    }
    check_kind(good, kind, "it")
    for name, value in [
        *[("a", other) for other in (True, "1", None, float("nan"), float("inf"), [1])],
        *[("b", other) for other in ({}, [["x"]], [["z", 1]], [["x", 3]], [["x", True]], [["x", 1.0]], [[[], 1]])],
        *[("c", other) for other in (1.0, True, "1")],
        *[("d", other) for other in ([1, 2], [[1, 2, 3]], [["1", "2"]], [[None, 1]], "12", 1, [[10**200, 1]])],
        *[("e", other) for other in ("1/0", "1e9", 3, "", "9" * 5000)],
        ("f", 1),
    ]:
        with pytest.raises(ValueError, match=rf"it\.{name}|inhomogeneous"):
            check_kind(good | {name: value}, kind, "it")
    with pytest.raises(ValueError, match="it lacks a"):
        check_kind({}, kind, "it")


def test_json_keeps_what_is_not_finite():
    assert np.isnan(json_from("[NaN]")[0])
