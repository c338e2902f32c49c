"""Results of CalculiX: files that it wrote are read, and what is written is read by a reader of its own."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import enumsol
from enumsol import fem
from enumsol.auditing.results import compare_result
from enumsol.io.calculix import NodalResult
from enumsol.model.cells import KINDS
from tests.helpers.parted_solids import solid
from tests.helpers.refusals import bad_argument

HERE = Path(__file__).parent / "calculix"


def columns(file, start):
    """Rows of a data set by the documented columns: key (3), number (10), values (12 each)."""
    rows, inside = {}, False
    for line in file.read_text().splitlines():
        if line.startswith(start):
            inside = True
        elif inside and line.startswith(" -3"):
            return rows
        elif inside and line.startswith(" -1"):
            rows[int(line[3:13])] = [float(line[k : k + 12]) for k in range(13, len(line), 12)]
    return rows


def three_roots():
    entry = enumsol.gallery.get("wedge-8-3")
    problem = entry.build()
    return problem, enumsol.enumerate_roots(problem, entry.alpha)


def test_files_of_calculix_are_read_by_both_readers():
    frd, dat = enumsol.read_results(HERE / "column.frd")[-1], enumsol.read_results(HERE / "column.dat")[-1]
    assert frd.numbers.tolist() == dat.numbers.tolist() == [*range(1, 21)]
    assert frd.time == dat.time == 1.0
    np.testing.assert_allclose(frd.displacements, dat.displacements, atol=2e-6)
    assert frd.displacements[5].tolist() == [5.21656e-02, 9.79736e-03, -2.19499e-02]
    assert frd.points[18].tolist() == [1, 1, 0.5]


def test_nodes_and_displacements_are_written_as_calculix_does(tmp_path):
    problem, found = three_roots()
    file = tmp_path / "roots.frd"
    enumsol.write_frd(problem, found, file)
    mesh = problem.mesh
    points = columns(file, "    2C")
    assert sorted(points) == [*range(1, len(mesh.points) + 1)]
    np.testing.assert_allclose([points[k + 1][:2] for k in range(len(mesh.points))], mesh.points, rtol=1e-5, atol=1e-9)
    back = enumsol.read_results(file)
    assert [result.time for result in back] == [1.0, 2.0, 3.0]
    for root, result in zip(found, back, strict=True):
        np.testing.assert_allclose(
            result.on(mesh), mesh.displacements(root.u), atol=1e-5 * np.max(np.abs(mesh.displacements(root.u)))
        )
    # numbers end in the columns in which those of CalculiX's own file end
    ours, theirs = file.read_text().splitlines(), (HERE / "column.frd").read_text().splitlines()
    for start in ("    2C", "    3C", "  100C", " -4  DISP", " -5  D1", " -5  ALL"):
        one, other = (next(line for line in lines if line.startswith(start)) for lines in (ours, theirs))
        ends = [[match.end() for match in re.finditer(r"\S+", line)] for line in (one, other)]
        assert ends[0] == ends[1], start


def test_quadratic_hexahedra_have_the_order_of_cgx(tmp_path):
    mesh = fem.read_mesh(HERE / "column.inp")
    problem = fem.mesh_problem(mesh, young=1000, poisson=0.3, friction=0.3, contact="LOW", clamp="HIGH")
    enumsol.write_frd(problem, enumsol.enumerate_roots(problem, 0), tmp_path / "column.frd")

    def cells(file):
        text = file.read_text().splitlines()
        first = next(k for k, line in enumerate(text) if line.startswith("    3C"))
        last = next(k for k in range(first, len(text)) if text[k].startswith(" -3"))
        return [line.split() for line in text[first + 1 : last] if line.startswith(" -2")]

    assert cells(tmp_path / "column.frd")[:2] == cells(HERE / "column.frd")[:2]


@pytest.mark.parametrize("which", [0, 1, 2])
def test_a_result_with_the_error_of_a_penalty_is_the_root_that_it_is(which):
    problem, found = three_roots()
    rng = np.random.default_rng(which)
    moved = problem.mesh.displacements(found[which].u)
    noisy = moved + 0.01 * np.max(np.abs(moved)) * rng.uniform(-1, 1, moved.shape)
    noisy[:3] = np.nan
    compared = compare_result(problem, found, noisy)
    assert compared.found == ("root", which)
    assert compared.missed == [("root", k) for k in range(3) if k != which]
    assert f"the result is root {which}: it differs by" in str(compared)
    assert "3 solutions, all that there are" in str(compared)


def test_what_is_no_root_is_none():
    problem, found = three_roots()
    moved = [problem.mesh.displacements(root.u) for root in found]
    assert compare_result(problem, found, 0.4 * moved[0] + 0.6 * moved[1], tolerance=0.9).found is None
    compared = compare_result(problem, found, 3.0 * moved[2])
    assert compared.found is None
    assert "the result is taken for no solution (it is too far away): it differs from root 0 by 99 %" in str(compared)


def test_a_point_of_a_continuum_is_found():
    problem = enumsol.gallery.one_node_triangle(f=(1, -2))
    found = enumsol.enumerate_roots(problem, alpha=2)
    part = found.families[0].polytopes[0]
    middle = part.vertices.mean(axis=0)
    u = problem.condensed.displacement(2, middle.T.ravel())
    compared = compare_result(problem, found, problem.mesh.displacements(u))
    assert compared.found == ("family", 0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("    1C\n", "has no displacements"),
        (f"    2C{2:30d}{2:38d}\n", "binary"),
        (f"    2C{1:30d}{1:38d}\n -1         1 0.00000E+00\n", "ends within a block"),
        (f"    2C{1:30d}{1:38d}\n -1         1 x.00000E+00 0.00000E+00\n -3\n", "does not hold results"),
    ],
)
def test_damaged_files_are_refused(tmp_path, content, message):
    file = tmp_path / "bad.frd"
    file.write_text(content)
    with pytest.raises(enumsol.InvalidArgumentError, match=message):
        enumsol.read_results(file)


def test_wrong_names_and_meshes_are_refused(tmp_path):
    bad_argument("is no result file", enumsol.read_results, tmp_path / "x.txt")
    bad_argument("cannot be read", enumsol.read_results, tmp_path / "x.frd")
    result = enumsol.read_results(HERE / "column.frd")[0]
    elsewhere = replace(result, points=result.points + 5.0)
    bad_argument("are not in the file", elsewhere.on, enumsol.gallery.get("block3d-4").build().mesh)
    dat = enumsol.read_results(HERE / "column.dat")[0]
    mesh = enumsol.gallery.clamped_block(2, 1).mesh
    bad_argument("no positions of nodes", dat.on, mesh)
    bad_argument("has no mesh", enumsol.write_frd, without_mesh(), [], tmp_path / "x.frd")
    bad_argument("ends in .frd", enumsol.write_frd, enumsol.gallery.clamped_block(2, 1), [], tmp_path / "x.vtu")


def without_mesh():
    return enumsol.ContactProblem([[1, 0], [0, 1]], [[1, 0]], [[0, 1]], [1, 1])


def test_nodes_that_share_a_position_are_told_by_their_numbers_only():
    """Two squares one on the other: by positions the nodes between them are not known, by numbers all are."""
    mesh = enumsol.BodyMesh(
        [[0, 0], [1, 0], [1, 1], [0, 1], [0, 1], [1, 1], [1, 2], [0, 2]], [[0, 1, 2, 3], [4, 5, 6, 7]], np.eye(16)
    )
    moves = np.arange(24.0).reshape(8, 3)
    points = np.pad(mesh.points, ((0, 0), (0, 1)))
    result = NodalResult(1.0, np.arange(11, 19), moves, points)
    by_number = result.on(mesh, [*range(11, 19)])
    np.testing.assert_array_equal(by_number, moves[:, :2])
    by_place = result.on(mesh)
    assert np.flatnonzero(np.isnan(by_place[:, 0])).tolist() == [2, 3, 4, 5]
    np.testing.assert_array_equal(by_place[[0, 1, 6, 7]], moves[[0, 1, 6, 7], :2])
    # numbers of another mesh are not believed
    wrong = result.on(mesh, [*range(18, 10, -1)])
    assert np.isnan(wrong[2, 0])
    dat = NodalResult(1.0, np.arange(11, 19), moves, None)
    np.testing.assert_array_equal(dat.on(mesh, [*range(11, 19)]), moves[:, :2])


def test_a_layer_of_solids_is_the_plane_body_and_a_slice_the_axisymmetric_one():
    mesh = enumsol.BodyMesh([[1, 0], [2, 0], [2, 1], [1, 1]], [[0, 1, 2, 3]], np.eye(8))
    plane = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]])
    layer = np.array([[*at, z] for at in mesh.points for z in (-0.5, 0.5)])
    moves = np.array([[*move, z] for move in plane for z in (0.01, -0.01)])
    result = NodalResult(1.0, np.arange(101, 109), moves, layer)
    np.testing.assert_allclose(result.on(mesh, [1, 2, 3, 4]), plane)
    angle = np.radians([-1.0, 1.0])
    turned = np.array([[r * np.cos(a), y, r * np.sin(a)] for r, y in mesh.points for a in angle])
    moved = np.array([[u * np.cos(a), v, u * np.sin(a)] for u, v in plane for a in angle])
    slice_of = NodalResult(1.0, np.arange(101, 109), moved, turned)
    np.testing.assert_allclose(slice_of.on(mesh, axisymmetric=True), plane)


@pytest.mark.parametrize("kind", sorted(nodes for dimension, nodes in KINDS if dimension == 3))
def test_every_kind_of_solid_cell_is_written(tmp_path, kind):
    data = {"young": 1.0, "poisson": 0.3, "contact": "bottom", "clamp": "left", "load": {"top": (0.0, 0.0, -0.1)}}
    problem = fem.mesh_problem(solid((2, 1, 1), kind), friction=0.3, **data)
    free = SimpleNamespace(u=problem.factorization.solve(problem.f), lambda_n=np.zeros(problem.p))
    free.lambda_t, free.u_n, free.u_t = np.zeros((problem.p, 2)), problem.Bn @ free.u, np.zeros((problem.p, 2))
    enumsol.write_frd(problem, free, tmp_path / "free.frd")
    (result,) = enumsol.read_results(tmp_path / "free.frd")
    moved = problem.mesh.displacements(free.u)
    written = result.on(problem.mesh)
    known = np.isfinite(written[:, 0])
    # CGX has no nodes in the middle of facets and cells
    assert len(problem.mesh.points) - np.count_nonzero(known) == {18: 9, 27: 13}.get(kind, 0)
    np.testing.assert_allclose(written[known], moved[known], atol=1e-5 * np.max(np.abs(moved)))


@pytest.mark.parametrize(
    ("kind", "between"),
    [
        (10, "01 12 20 03 13 23"),
        (18, "01 12 20 03 14 25 34 45 53"),
        (27, "01 12 23 30 04 15 26 37 45 56 67 74"),
    ],
)
def test_nodes_between_corners_are_in_the_order_of_cgx(tmp_path, kind, between):
    data = {"young": 1.0, "poisson": 0.3, "contact": "bottom", "clamp": "left"}
    problem = fem.mesh_problem(solid((1, 1, 1), kind), friction=0.3, **data)
    zero = np.zeros((problem.p, 2))
    rest = SimpleNamespace(u=np.zeros(problem.n), lambda_n=zero[:, 0], lambda_t=zero, u_n=zero[:, 0], u_t=zero)
    enumsol.write_frd(problem, rest, tmp_path / "rest.frd")
    lines = (tmp_path / "rest.frd").read_text().splitlines()
    points = columns(tmp_path / "rest.frd", "    2C")
    first = next(k for k, line in enumerate(lines) if line.startswith("    3C")) + 2
    cell = [
        np.array(points[int(node)])
        for line in lines[first : first + 3]
        if line[:3] == " -2"
        for node in line.split()[1:]
    ]
    corners = len(set("".join(between.split())))
    for place, (one, other) in zip(cell[corners:], between.split(), strict=False):
        np.testing.assert_allclose(place, 0.5 * (cell[int(one)] + cell[int(other)]), atol=1e-6)
