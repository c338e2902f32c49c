"""``--vtu`` of roots, solve and fixed-point: which files are written, and what is refused before the search."""

import numpy as np
import pytest
from command_line import assert_refused, printed, run
from refusals import bad_argument

import enumsol
from enumsol import gallery

meshio = pytest.importorskip("meshio")


@pytest.mark.parametrize("name", ["wedge-8-3", "wedge3d-2-3"])
def test_every_root_has_a_file(tmp_path, capsys, name):
    out = printed(capsys, "roots", f"gallery:{name}", "--alpha", 1, "--vtu", tmp_path / "wedge.vtu")
    assert out.endswith("complete: yes (proven)\n")
    names = sorted(file.name for file in tmp_path.iterdir())
    assert names == ["wedge-0.vtu", "wedge-1.vtu", "wedge-2.vtu", "wedge.pvd"]
    problem = gallery.get(name).build()
    for k, root in enumerate(enumsol.enumerate_roots(problem, 1)):
        back = meshio.read(tmp_path / f"wedge-{k}.vtu")
        moved = problem.mesh.displacements(root.u)
        np.testing.assert_allclose(back.point_data["displacement"][:, : moved.shape[1]], moved, atol=1e-12)
        assert "stress" in back.cell_data


def test_a_limit_in_2d_has_a_file(capsys, tmp_path):
    file = tmp_path / "limit.vtu"
    printed(capsys, "fixed-point", "gallery:one-node-6.1", "--alpha", 1, "--vtu", file)
    assert "displacement" in meshio.read(file).point_data


def test_a_continuum_has_no_file(tmp_path, capsys):
    status, _, error = run(capsys, "roots", "gallery:one-node-6.3", "--alpha", 2, "--vtu", tmp_path / "p.vtu")
    assert status == 0
    assert "no isolated root was found" in error
    assert "--vtu holds the isolated roots only, --json the 1 family too" in error
    assert list(tmp_path.iterdir()) == []
    problem, message = gallery.get("one-node-6.3").build(), "a RootSet without isolated roots, whose 1 family no file"
    bad_argument(message, enumsol.write_vtu, problem, enumsol.enumerate_roots(problem, 2), tmp_path / "p.vtu")


@pytest.mark.parametrize(
    ("problem", "file", "message"),
    [
        ("gallery:wedge-8-3", "-", "--vtu is -, but it is a binary file"),
        ("gallery:wedge-8-3", "p.png", "--vtu is 'p.png'; expected a name that ends in .vtu"),
        ("gallery:wedge-8-3", "nowhere/p.vtu", "--vtu is nowhere/p.vtu, which cannot be written"),
        ("bare.npz", "p.vtu", "--vtu is given, but bare.npz has neither mesh nor coordinates"),
    ],
)
def test_refused_before_the_search(tmp_path, monkeypatch, capsys, problem, file, message):
    monkeypatch.chdir(tmp_path)
    enumsol.write_problem(enumsol.ContactProblem([[2, 0], [0, 2]], [[1, 0]], [[0, 1]], [1, 0]), "bare.npz")
    for command in ("roots", "fixed-point"):
        assert_refused(*run(capsys, command, problem, "--alpha", 1, "--vtu", file), message)
