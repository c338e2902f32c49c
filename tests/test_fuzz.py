"""Files and texts with random damage: every reader gives a result or one sentence of ours, in bounded memory."""

import io
import json
import random
import resource
from pathlib import Path

import numpy as np
import pytest

import enumsol
from enumsol import EnumsolError, fem, gallery, read_problem, write_problem
from enumsol.loading.steps import read_steps, steps_of

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
friction = 0.1
friction_slope = 0.5
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


# -- what was saved ----------------------------------------------------------------------------------------------------

#: What a value of JSON may become, of a type that is or is not its own.
OTHERS = [None, True, 0, -1, 7, 10**18, 1e308, float("nan"), "", "x", "1/0", "slip+", [], [[]], [0, "x"], {}, {"x": 1}]
OTHERS += [[[0.5] * 3] * 3, "1e999999", "9" * 5000, 10**18 * 1.5]


def places(record):
    """All containers of a record, each with a name or a number of what is in it."""
    pending, found = [record], []
    while pending:
        part = pending.pop()
        keys = list(part) if isinstance(part, dict) else range(len(part))
        found += [(part, key) for key in keys]
        pending += [part[key] for key in keys if isinstance(part[key], (dict, list)) and part[key]]
    return found


def changed(text, seed):
    """A JSON text in which a few values are replaced, removed, doubled or swapped with others."""
    rng, record = random.Random(seed), json.loads(text)
    for _ in range(rng.randint(1, 3)):
        (part, key), (other, name) = (rng.choice(places(record) or [([0], 0)]) for _ in range(2))
        kind = rng.randrange(6)
        if kind == 0:
            part[key], other[name] = json.loads(json.dumps([other[name], part[key]]))
        elif kind == 1:
            del part[key]
        elif kind == 2 and isinstance(part, list):
            part.insert(key, json.loads(json.dumps(part[key])))
        elif type(part[key]) in (int, float) and kind == 3:
            part[key] += rng.choice([1, -1, 0.5, 1e9])
        else:
            part[key] = json.loads(json.dumps(rng.choice(OTHERS)))
    return json.dumps(record)


def changed_archive(content, seed):
    """A .npz file with another report, or with other arrays."""
    rng = random.Random(seed)
    with np.load(io.BytesIO(content)) as archive:
        arrays = dict(archive)
    if "meta" in arrays and rng.random() < 0.5:
        arrays["meta"] = np.array(changed(str(arrays["meta"]), seed))
    else:
        name = rng.choice(sorted(arrays))
        array = arrays[name]
        kinds = [array[..., None], array.ravel(), array.ravel()[:0], array.astype(str), array.T]
        kinds += [np.full(array.shape, np.nan), np.array(rng.choice(["{}", "[]", "", "nan"]))]
        arrays[name] = rng.choice(kinds)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def saved(kind):
    """What saves a result of a kind, and what reads and prints it."""
    square, triangle = gallery.two_node_square(), gallery.one_node_triangle()
    if kind in ("graph", "graph in balls", "graph in 3D", "graph with a family"):
        problem = {
            "graph": square,
            "graph in balls": gallery.get("wedge-8-3").build(),
            "graph in 3D": gallery.one_node_3d(),
            "graph with a family": gallery.one_node_triangle(f=(1, -2)),
        }[kind]
        graph = enumsol.branch_graph(problem, (0, 0.5 if kind == "graph in balls" else 3))
        assert graph.arcs_by == ("exact" if "family" in kind or kind == "graph" else "balls")
        return graph.save, lambda place: shows_graph(enumsol.BranchGraph.load(place))
    if kind == "history":
        return enumsol.histories(triangle, [1, 5, 4]).save, lambda place: shows(enumsol.History.load(place, triangle))
    if kind == "path":
        graph = enumsol.branch_graph(square, (0, 4))
        path = enumsol.follow(square, graph.starting_points()[0], interval=(0, 4))
        return path.save, lambda place: shows(type(path).load(place))
    if kind == "fixed point":
        point = enumsol.successive_approximations(square, 1)
        return point.save, lambda place: shows(type(point).load(place, square))
    proof = enumsol.enumerate_roots(square, 3.5).proof
    return proof.save, lambda place: shows(enumsol.verify(square, enumsol.Proof.load(place)))


def shows(result):
    """What is read can be looked at, too."""
    repr(result)
    if hasattr(result, "to_frame"):
        result.to_frame()
    if hasattr(result, "counts"):
        assert result.ends is not None
        assert len(list(result.paths())) >= 0
        assert result.dissipated is not None


def shows_graph(graph):
    shows(graph)
    graph.summary()
    graph.vertices_frame()
    assert graph.claims.sentences(graph.uniqueness_bound) is not None


KINDS = ["graph", "history", "path", "fixed point", "proof", "graph in 3D", "graph in balls", "graph with a family"]


@pytest.mark.few(3)
@pytest.mark.parametrize("kind", KINDS)
def test_what_was_saved(tmp_path, kind):
    save, read = saved(kind)
    place = tmp_path / "saved"
    save(place)
    assert False in outcomes(place, CASES, read, place)
    if kind == "proof":
        return  # its records have a checksum; tests/checker has their mutants
    content = place.read_bytes()
    change = changed_archive if content.startswith(b"PK") else changed
    found = set()
    for seed in range(2 * CASES):
        altered = change(content, seed)
        place.write_bytes(altered.encode() if isinstance(altered, str) else altered)
        found.add(ours(read, place))
    assert False in found


def test_tables_of_steps(tmp_path):
    place = tmp_path / "steps.csv"
    place.write_text("alpha,friction\n1,0.5\n2,0.25\n")
    triangle = gallery.one_node_triangle()
    assert outcomes(place, CASES, lambda file: steps_of(triangle, read_steps(file)), place) == {True, False}


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", ["json", "npz", "csv"])
def test_solutions_of_others(tmp_path, kind):
    place, forces = tmp_path / f"triangle-3.{kind}", {"lambda_n": [[0.0], [0.5]], "lambda_t": [[0.0], [-1.0]]}
    if kind == "json":
        place.write_text(json.dumps(forces))
    elif kind == "npz":
        np.savez(place, **forces)
    else:
        place.write_text("solution,node,lambda_n,lambda_t\n0,0,0,0\n1,0,0.5,-1\n")
    content = place.read_bytes()
    assert outcomes(place, CASES, enumsol.collection.check, str(place)) >= {False}
    change = {"json": changed, "npz": changed_archive, "csv": damaged}[kind]
    for seed in range(CASES):
        altered = change(content, seed)
        place.write_bytes(altered.encode() if isinstance(altered, str) else altered)
        ours(lambda: repr(enumsol.collection.check(str(place))))


def test_the_damage_is_some(tmp_path):
    assert np.mean([damaged(TOML.encode(), seed) != TOML.encode() for seed in range(50)]) > 0.9
