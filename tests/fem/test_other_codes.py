"""docs/from_other_codes.md, followed with matrices that CalculiX wrote, and with the same in other formats."""

from pathlib import Path
from shutil import copy

import numpy as np
import pytest
import scipy.sparse as sp
from alike import assert_close
from complete import only_root
from documents import ROOT, follow
from parted_solids import on_bottom
from scipy.io import mmwrite
from two_bodies import shifted, together

import enumsol
from enumsol import fem
from enumsol.io import read_abaqus_stiffness, read_ansys_stiffness, read_calculix_stiffness

#: Of CalculiX 2.20: the model, its stiffness matrix with the names of its rows, and nodal forces.
FILES = Path(__file__).parent / "calculix"
LABELS = ("UX", "UY", "UZ")


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    folder = tmp_path_factory.mktemp("other_codes")
    for file in FILES.iterdir():
        copy(file, folder)
    return {**follow(ROOT / "docs" / "from_other_codes.md", folder), "folder": folder}


@pytest.fixture(scope="module")
def own():
    """The block of the model, assembled here."""
    mesh = fem.box(2, 1, 1, (2.0, 1.0, 1.0))
    forces = fem.facet_forces(mesh.points, mesh.facets["top"], (0.3, 0.1, -0.6))
    frame = {"normals": (0.0, 0.0, -1.0), "axes": (1.0, 0.0, 0.0)}
    return on_bottom(mesh, fem.lame(2.5, 0.25), **frame, forces=forces, friction=0.3)


def assert_one_root(roots, expected):
    assert roots.complete
    (root,) = roots
    assert root.statuses == expected.statuses
    for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
        assert_close(root, expected, name, rtol=0, atol=1e-11 * np.max(np.abs(getattr(expected, name))) + 1e-13)


def test_roots_of_the_matrices_of_calculix_are_our_own(seen, own):
    assert_one_root(seen["roots"], only_root(own))
    assert enumsol.read_problem(seen["folder"] / "block.npz").fingerprint == seen["block"].fingerprint


def matrix(found):
    return found.A, found.places


def same(one, two):
    """Whether both name the same degrees of freedom and have the same stiffness between them."""
    (A, first), (B, second) = one, two
    order = [second[name] for name in first]
    return set(first) == set(second) and np.array_equal(A.toarray(), B.toarray()[np.ix_(order, order)])


@pytest.mark.parametrize("both", [False, True])
def test_the_format_of_abaqus(tmp_path, both):
    """One triangle or both, nodes in another order, held ones with a large number on the diagonal."""
    A, places = matrix(read_calculix_stiffness(FILES / "block"))
    lines = [f"{node},{d}, {node},{d},  1.000000000000000e+36" for node in (1, 4, 7, 10) for d in (1, 2, 3)]
    names = list(places)
    for i in reversed(range(len(names))):
        listed = [j for j in range(len(names) if both else i + 1) if A[i, j]]
        lines += ["{},{}, {},{},  {!r}".format(*names[i], *names[j], float(A[i, j])) for j in listed]
    (tmp_path / "block_STIF1.mtx").write_text("\n".join(lines) + "\n")
    found = read_abaqus_stiffness(tmp_path / "block_STIF1.mtx", held=(1, 4, 7, 10))
    assert same(matrix(found), (A, places))


@pytest.mark.parametrize(
    ("part", "symmetry", "heading", "row"),
    [
        (sp.csc_array, "symmetric", ["  Matrix Eqn     Node     DOF"], "{:>12}{:>12}{:>8}"),
        (sp.csc_array, "general", ["  Matrix Eqn     Node     DOF"], "{:>12}{:>12}{:>8}"),
        (sp.triu, "general", [], "{} {} {}"),  # one triangle, and all the same called general
    ],
)
def test_the_format_of_ansys(tmp_path, part, symmetry, heading, row):
    A, places = matrix(read_calculix_stiffness(FILES / "block"))
    mmwrite(tmp_path / "block.mtx", sp.coo_array(part(A)), symmetry=symmetry, precision=17)
    lines = [row.format(k + 1, node, LABELS[d - 1]) for k, (node, d) in enumerate(places)]
    (tmp_path / "block.mapping").write_text("\n".join([*heading, *lines]) + "\n")
    found = read_ansys_stiffness(tmp_path / "block.mtx", tmp_path / "block.mapping")
    assert same(matrix(found), (A, places))


def test_two_bodies_that_calculix_assembled_have_our_own_roots():
    """A small block between the nodes of a larger one; what its nodes face is interpolated by hand."""
    model = read_calculix_stiffness(FILES / "pair")
    A, places = matrix(model)
    points = {int(k): at for k, *at in map(numbers, section(FILES / "pair.inp", "*NODE"))}
    slave = [k for k, at in points.items() if at[2] == 0.5 and k <= 8]
    under = {(round(at[0], 9), round(at[1], 9)): k for k, at in points.items() if at[2] == 0.5 and k > 8}
    rows = np.zeros((3, 4, len(places)))
    for row, k in enumerate(slave):
        x, y, _ = points[k]
        left = 0.5 * (x > 0.5)
        for at, share in ((left, 1 - (x - left) / 0.5), (left + 0.5, (x - left) / 0.5)):
            for depth, part in ((0.0, 1 - y), (1.0, y)):
                for d in range(3):
                    rows[d, row, places[under[at, depth], d + 1]] = -share * part
        for d in range(3):
            rows[d, row, places[k, d + 1]] = 1.0
    f = np.zeros(len(places))
    for node, d, force in np.loadtxt(FILES / "pair.cload", delimiter=","):
        if (node, d) in places:
            f[places[node, d]] = force
    problem = enumsol.ContactProblem3D(A, -rows[2], rows[0], -rows[1], f, friction=0.3, gap=0.001)
    found = enumsol.enumerate_roots(problem, 0)

    upper, lower = fem.box(1, 1, 1, (0.8, 0.8, 0.5)), fem.box(2, 1, 1, (1.0, 1.0, 0.5))
    mesh = together(("upper", shifted(upper, (0.1, 0.1, 0.5))), ("lower", lower))
    own = fem.mesh_problem(
        mesh, young=2.5, poisson=0.25, pairs=[("upper.bottom", "lower.top")], clamp=["upper.top", "lower.bottom"],
        load={"upper.right": (0.3, 0.1, -0.8)}, gap=0.001, friction=0.3, axis=(1.0, 0.0, 0.0),
    )  # fmt: skip
    assert [k - 1 for k in slave] == list(own.node_ids)
    assert_one_root(found, only_root(own))
    assert np.max(found[0].lambda_n) > 0.01


def numbers(line):
    return [float(word) for word in line.split(",") if word]


def section(file, keyword):
    """Lines of data below a keyword."""
    lines = file.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(keyword)) + 1
    last = next(k for k in range(first, len(lines)) if lines[k].startswith("*"))
    return lines[first:last]


@pytest.mark.parametrize(
    ("files", "call", "message"),
    [
        ({}, lambda at: read_calculix_stiffness(at / "none"), "cannot be read"),
        ({"a.sti": "1 1 x\n"}, lambda at: read_calculix_stiffness(at / "a"), "does not hold a stiffness matrix"),
        (
            {"a.sti": "2 2 1.0\n", "a.dof": "1.1\n"},
            lambda at: read_calculix_stiffness(at / "a"),
            "has 2 rows and 1 rows by",
        ),
        ({"a.sti": "2 2 1.0\n", "a.dof": "1.1\n1.1\n"}, lambda at: read_calculix_stiffness(at / "a"), "twice"),
        ({"a.mtx": "1,1,1\n"}, lambda at: read_abaqus_stiffness(at / "a.mtx"), "does not hold a stiffness matrix"),
        ({"a.mtx": "no matrix"}, lambda at: read_ansys_stiffness(at / "a.mtx", at / "a.map"), "does not hold"),
    ],
)
def test_damaged_matrices_are_refused(tmp_path, files, call, message):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(enumsol.InvalidArgumentError, match=message):
        call(tmp_path)


def test_held_nodes_have_no_rows():
    model = read_calculix_stiffness(FILES / "block")
    with pytest.raises(enumsol.InvalidArgumentError, match="node 1 has no free displacement in direction 3"):
        model.displacements([2, 1], (0, 0, 1))
    assert model.displacements([2, 3], [(1, 0, 0), (0, 1, 0)]).nnz == 2
    assert not np.any(model.forces([(1, 3, 5.0)]))
