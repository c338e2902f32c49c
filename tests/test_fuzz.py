"""Files and texts with random damage: every reader gives a result or one sentence of ours, in bounded memory."""

import random
import resource
from pathlib import Path

import numpy as np
import pytest

import enumsol
from enumsol import EnumsolError, fem, gallery, read_problem, write_problem

CASES = 60
#: By how much the peak of memory may grow with one file of some kilobytes [kilobytes].
MEMORY = 100_000
SQUARE = (Path(__file__).parent / "fem" / "meshes" / "square.22.msh").read_text()
ABAQUS = (Path(__file__).parent / "fem" / "meshes" / "square.inp").read_text()
OPTIONS = {"young": 2.5, "poisson": 0.25, "contact": "floor", "clamp": "lid"}
TOML = """mesh = "square.msh"
young = 2.5
poisson = 0.25
contact = ["floor"]
clamp = "lid"
friction = [0.1, 0.5]
gap = 1e-3
load.floor = [0.0, -1e-3]
displacement.lid = ["free", 0.0]
obstacle.plane = [0.0, -0.1, 0.0, 1.0]
"""
TOKENS = [b"-1", b"0", b"1e308", b"nan", b"999999999999", b"4294967296", b"\0", b"\xff", b"[", b'"', b"\n\n", b"="]
TOKENS += [b"$End"]


def damaged(content, seed):
    """The bytes with a few of them changed, dropped, doubled, or replaced by something else."""
    rng = random.Random(seed)
    data = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        where = rng.randrange(len(data) + 1)
        kind = rng.randrange(6)
        if kind == 0 and where < len(data):
            data[where] = rng.randrange(256)
        elif kind == 1:
            del data[where : where + rng.randint(1, 12)]
        elif kind == 2:
            data[where:where] = data[where : where + rng.randint(1, 40)]
        elif kind == 3:
            del data[where:]
        elif kind == 4:
            data[where:where] = rng.choice(TOKENS)
        else:  # a whole word
            words = bytes(data).split(b" ")
            words[rng.randrange(len(words))] = rng.choice(TOKENS)
            data = bytearray(b" ".join(words))
        if not data:
            break
    return bytes(data)


def ours(read, *arguments):
    """Whether something was read; what is said otherwise is checked."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        read(*arguments)
    except EnumsolError as error:
        message = str(error)
        assert "\n" not in message, message
        assert len(message) < 1200
        assert not message.endswith(".")
        return False
    else:
        return True
    finally:
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MEMORY


def outcomes(file, count, read, *arguments):
    """Whether something is read of so many damaged versions of a file, of which something is read as it is."""
    content = file.read_bytes()
    assert ours(read, *arguments)
    found = set()
    for seed in range(count):
        file.write_bytes(damaged(content, seed))
        found.add(ours(read, *arguments))
    file.write_bytes(content)
    return found


def mesh_problem(path):
    fem.mesh_problem(path, **OPTIONS, plane="strain")


def _meshes():
    import meshio

    return meshio.Mesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [("quad", [[0, 1, 2, 3]]), ("line", [[0, 1]]), ("line", [[2, 3]])],
        cell_data={"gmsh:physical": [[1], [7], [9]], "gmsh:geometrical": [[1], [7], [9]]},
        field_data={"floor": np.array([7, 1]), "lid": np.array([9, 1])},
    )


@pytest.fixture(params=["square22.msh", "binary.msh", "square.vtu", "square.inp"])
def mesh_file(request, tmp_path):
    place = tmp_path / request.param
    if request.param == "square22.msh":
        place.write_text(SQUARE)
    elif request.param == "square.inp":
        place.write_text(ABAQUS)
    elif request.param == "binary.msh":
        _meshes().write(place, file_format="gmsh22", binary=True)
    else:
        _meshes().write(place)
    return place


def test_meshes(mesh_file):
    read = fem.read_mesh if mesh_file.suffix == ".vtu" else mesh_problem
    assert False in outcomes(mesh_file, CASES, read, mesh_file)


def test_descriptions_of_problems(tmp_path):
    (tmp_path / "square.msh").write_text(SQUARE)
    place = tmp_path / "square.toml"
    place.write_text(TOML)
    assert outcomes(place, 4 * CASES, fem.read_mesh_problem, place) == {True, False}


@pytest.mark.few(1)
@pytest.mark.parametrize("name", ["p.npz", "p.h5", "folder"])
def test_problems(tmp_path, name):
    if name.endswith("h5"):
        pytest.importorskip("h5py")
    place = tmp_path / name
    square = gallery.two_node_square()
    write_problem(enumsol.ContactProblem(square.A, square.Bn, square.Bt, square.f, friction=0.5), place)
    files = sorted(place.iterdir()) if place.is_dir() else [place]
    count = -(-2 * CASES // len(files))
    assert False in {read for file in files for read in outcomes(file, count, read_problem, place)}


def test_points_of_other_continuations(tmp_path):
    problem = gallery.two_node_square()
    graph = enumsol.branch_graph(problem, (0, 4))
    path = enumsol.follow(problem, graph.starting_points()[0], interval=(0, 4))
    place = tmp_path / "points.csv"
    path.to_frame().iloc[:12].to_csv(place, index=False)
    assert outcomes(place, CASES, enumsol.audit, str(place), graph) == {True, False}


def test_the_damage_is_some(tmp_path):
    assert np.mean([damaged(TOML.encode(), seed) != TOML.encode() for seed in range(50)]) > 0.9
