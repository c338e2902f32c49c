"""Files are written beside their place and renamed: what cannot be written whole changes nothing."""

import os
import resource
from contextlib import contextmanager
from pathlib import Path

import pytest
from refusals import bad_argument, refusal

import enumsol
from enumsol import OutputError, gallery
from enumsol.support.files import write_file, write_files

TRIANGLE = gallery.one_node_triangle()


@contextmanager
def little_room(size):
    """No file may have more bytes: what a full disk does."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def content(folder):
    return {str(place.relative_to(folder)): place.read_bytes() for place in folder.rglob("*") if place.is_file()}


@pytest.fixture(scope="module")
def results():
    problem = gallery.two_node_square()
    graph = enumsol.branch_graph(problem, (0, 4))
    body = gallery.get("wedge-8-5").build()
    return {
        "graph.json": graph.save,
        "graph.graphml": graph.write_graphml,
        "graph.html": lambda place: enumsol.write_report(graph, place),
        "graph.png": lambda place: graph.plot(file=place),
        "proof": graph.proof.save,
        "path.npz": enumsol.follow(problem, graph.starting_points()[0], interval=(0, 4)).save,
        "point.npz": enumsol.successive_approximations(problem, 1).save,
        "history.json": enumsol.histories(TRIANGLE, [1, 2]).save,
        "history.svg": lambda place: enumsol.histories(TRIANGLE, [1, 2]).plot(file=place),
        "problem.npz": lambda place: enumsol.write_problem(problem, place),
        "problem.h5": lambda place: enumsol.write_problem(problem.replace(friction=0.3, friction_slope=0), place),
        "body.vtu": lambda place: enumsol.write_vtu(body, enumsol.enumerate_roots(body, 0.1), place),
        "exported": lambda place: enumsol.collection.export(place, ["triangle-3"]),
        "folder": lambda place: enumsol.write_problem(problem, place),
    }


NAMES = [
    *("graph.json", "graph.graphml", "graph.html", "graph.png", "proof", "path.npz", "point.npz", "history.json"),
    *("history.svg", "problem.npz", "problem.h5", "body.vtu", "exported", "folder"),
]


@pytest.mark.few(14)
@pytest.mark.parametrize("name", NAMES)
def test_a_full_disk_loses_nothing(results, name, tmp_path):
    assert set(results) == set(NAMES)
    if name.endswith("h5"):
        pytest.importorskip("h5py")
    write, place = results[name], tmp_path / name
    write(place)
    before = content(tmp_path)
    assert before
    assert all(map(len, before.values()))
    with little_room(40):
        refusal(OutputError, "cannot be written", write, place)
    assert content(tmp_path) == before


def test_a_folder_that_could_not_be_filled_is_not_left(tmp_path):
    with little_room(40):
        refusal(OutputError, "cannot be written", enumsol.write_problem, TRIANGLE, tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("failing", ["write_bytes", "fsync", "replace"])
def test_no_litter_whatever_fails(failing, tmp_path, monkeypatch):
    place = tmp_path / "x"
    place.write_bytes(b"good")

    def fails(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os if failing == "fsync" else Path, failing, fails)
    with pytest.raises(KeyboardInterrupt):
        write_file(place, "new", "file")
    assert content(tmp_path) == {"x": b"good"}


def test_one_of_many_that_fails_keeps_all_as_they_were(tmp_path):
    (tmp_path / "a").write_text("old")
    with pytest.raises(OSError, match="File too large"), little_room(40):
        write_files({tmp_path / "a": "new", tmp_path / "b": "long" * 40})
    assert content(tmp_path) == {"a": b"old"}


def test_modes_are_those_of_a_new_file_or_of_the_one_that_is_replaced(tmp_path):
    old = os.umask(0o027)
    try:
        write_file(tmp_path / "new", "x", "file")
        (tmp_path / "mine").write_text("")
        (tmp_path / "mine").chmod(0o604)
        write_file(tmp_path / "mine", "x", "file")
    finally:
        os.umask(old)
    assert [(tmp_path / name).stat().st_mode & 0o7777 for name in ("new", "mine")] == [0o640, 0o604]


def test_a_link_is_followed(tmp_path):
    (tmp_path / "folder").mkdir()
    target, link = tmp_path / "folder" / "file", tmp_path / "link"
    link.symlink_to(target)
    for text in ("one", "two"):
        write_file(link, text, "file")
        assert link.is_symlink()
        assert target.read_text() == text


def test_what_is_no_regular_file_is_written_where_it_is(tmp_path):
    write_file(Path(os.devnull), "x", "file")
    assert not Path(os.devnull).is_file()
    reading, writing = os.pipe()
    write_file(Path(f"/dev/fd/{writing}"), "through", "file")
    assert os.read(reading, 20) == b"through"
    os.close(reading)
    os.close(writing)
    bad_argument("Is a directory", write_file, tmp_path, "x", "file")


def test_the_file_that_stdout_is_stays_that_file(tmp_path):
    place = tmp_path / "x"
    kept = os.dup(1)
    with place.open("wb") as file:
        os.dup2(file.fileno(), 1)
        try:
            write_file(place, "one", "file")
            assert os.path.samestat(place.stat(), os.fstat(1))
        finally:
            os.dup2(kept, 1)
            os.close(kept)
    assert content(tmp_path) == {"x": b"one"}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_file_that_may_not_be_written(tmp_path):
    (tmp_path / "x").write_text("mine")
    (tmp_path / "x").chmod(0o400)
    bad_argument("Permission denied", write_file, tmp_path / "x", "new", "file")
    assert content(tmp_path) == {"x": b"mine"}


# -- proofs that are streamed ------------------------------------------------------------------------------------------


def test_an_earlier_proof_comes_back_if_the_new_one_has_no_room(tmp_path):
    entry, place = gallery.get("wedge-8-5"), tmp_path / "x.proof"
    enumsol.enumerate_roots(TRIANGLE, 5, proof_path=place)
    before, problem = content(tmp_path), entry.build()
    place.chmod(0o604)
    with little_room(200):
        found = refusal(
            OutputError, "cannot be written", enumsol.enumerate_roots, problem, entry.alpha, proof_path=place
        )
    assert len(found.partial) == entry.roots
    assert content(tmp_path) == before
    enumsol.enumerate_roots(problem, entry.alpha, proof_path=place)
    assert enumsol.verify(problem, enumsol.Proof.load(place)).complete
    assert [path.name for path in tmp_path.iterdir()] == ["x.proof"]
    assert place.stat().st_mode & 0o7777 == 0o604


def test_a_proof_does_not_take_the_place_of_something_else(tmp_path):
    place = tmp_path / "notes.txt"
    place.write_text("My notes on contact.\n")
    message = "notes.txt, a file that is not a proof; expected a new name, or a proof to be replaced"
    bad_argument("proof_path is .*" + message, enumsol.enumerate_roots, TRIANGLE, 5, proof_path=place)
    bad_argument("path is .*" + message, enumsol.enumerate_roots(TRIANGLE, 5).proof.save, place)
    assert content(tmp_path) == {"notes.txt": b"My notes on contact.\n"}
    place.write_text("")
    enumsol.enumerate_roots(TRIANGLE, 5, proof_path=place)
    enumsol.enumerate_roots(TRIANGLE, 5, proof_path=place)
    assert enumsol.verify(TRIANGLE, enumsol.Proof.load(place)).complete
