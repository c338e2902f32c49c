"""What docs/from_a_mesh.md shows runs as it stands, and what it says comes out; gmsh's own mesh where gmsh is."""

import re
import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import enumsol
from enumsol import fem
from enumsol.cli import main

TEXT = (Path(__file__).parent.parent / "docs" / "from_a_mesh.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
(GMSH,) = re.findall(r"```text\n(.*?)```", TEXT, re.DOTALL)
(TOML,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
LINES = re.findall(r"^    (enumsol (?:.*\\\n)*.*)$", TEXT, re.MULTILINE)
COMMANDS = [shlex.split(line.replace("\\\n", " "))[1:] for line in LINES]


@pytest.fixture(scope="module")
def seen():
    names = {}
    for block in BLOCKS:
        exec(block, names)
    return names


def test_a_block(seen):
    assert seen["roots"].complete
    assert seen["block"].node_ids == (1, 2, 3, 4, 5, 6)
    assert seen["everything"].complete


def test_an_obstacle(seen):
    assert seen["disc"].gap.min() == pytest.approx(0.1)
    assert seen["disc"].gap.argmin() == 3


def test_a_body_that_nothing_holds(seen):
    assert seen["said"].startswith("the body is free to move as a rigid body; expected clamp")
    errors = [abs(total - 0.2) for total in seen["pressed"]]
    assert errors[1] < 0.2 * errors[0]
    assert errors[0] < 1e-3


def test_two_bodies_on_each_other(seen):
    """Pressed at their right by forces on one of them alone; a rigid foundation would yield less."""
    (root,) = enumsol.enumerate_roots(seen["two_bodies"], 0)
    assert root.lambda_n.max() > 0
    problem = seen["two_bodies"]
    # action and reaction: contact forces on all degrees of freedom of both bodies add up to nothing
    forces = problem.Bn.T @ root.lambda_n + problem.Bt.T @ root.lambda_t
    assert np.allclose(forces.reshape(-1, 2).sum(axis=0), 0, atol=1e-12)
    assert root.u.reshape(-1, 2)[:, 1].min() < -0.001


def test_a_mirrored_pair_is_half_of_it_on_a_rigid_foundation(seen):
    """Loads that are mirror images press both alike: each as on a rigid foundation without friction."""
    mesh = fem.rectangle(4, 2)
    K = fem.stiffness(mesh.points, mesh.triangles, (1, 1)).toarray()
    free = np.setdiff1d(np.arange(30), [*(2 * mesh.top), *(2 * mesh.top + 1)])
    f = fem.edge_forces(mesh.points, fem.edges_along(mesh.right), (0.1, -0.4)).ravel()
    flip = np.tile([1.0, -1.0], 15)
    Bn, Bt = np.zeros((2, 5, 30))
    Bn[range(5), 2 * mesh.bottom + 1], Bt[range(5), 2 * mesh.bottom] = -1, 1
    one = enumsol.ContactProblem(K[np.ix_(free, free)], Bn[:, free], Bt[:, free], f[free], gap=0.01, friction=0)
    Kf = (flip[:, None] * K * flip)[np.ix_(free, free)]
    pair = enumsol.ContactProblem(
        np.block([[K[np.ix_(free, free)], np.zeros_like(Kf)], [np.zeros_like(Kf), Kf]]),
        np.hstack([Bn[:, free], (Bn * flip)[:, free]]), np.hstack([Bt[:, free], -(Bt * flip)[:, free]]),
        np.concatenate([f[free], (f * flip)[free]]), gap=0.02, friction=0.3,
    )  # fmt: skip
    (single,), (both,) = enumsol.enumerate_roots(one, 0), enumsol.enumerate_roots(pair, 0)
    assert single.lambda_n.max() > 0
    assert np.allclose(both.lambda_n, single.lambda_n, rtol=1e-9)
    assert np.allclose(both.lambda_t, 0, atol=1e-12)


@pytest.mark.skipif(find_spec("gmsh") is None, reason="gmsh is not installed")
def test_from_gmsh_to_the_roots(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("punch.py").write_text(GMSH)
    subprocess.run([sys.executable, "punch.py"], check=True, capture_output=True)
    _commands(capsys)


def test_the_commands_on_a_mesh_of_another_program(tmp_path, monkeypatch, capsys):
    """The same body as gmsh makes it, structured."""
    meshio = pytest.importorskip("meshio")
    monkeypatch.chdir(tmp_path)
    mesh = fem.trapezoid(3, 3, bottom=1.0, top=1.8, height=1.0)
    lines = [fem.edges_along(part) for part in (mesh.bottom, mesh.right, mesh.top, mesh.left)]
    blocks = [("triangle", mesh.triangles), *(("line", edges) for edges in lines)]
    tags = [np.full(len(block[1]), k) for k, block in enumerate(blocks)]
    body = meshio.Mesh(
        np.c_[mesh.points, np.zeros(16)],
        blocks,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array([k + 1, 1]) for k, name in enumerate(SIDES)},
    )
    body.write("punch.msh", file_format="gmsh22", binary=False)
    _commands(capsys)


SIDES = ("tip", "right", "top", "left")


def _commands(capsys):
    Path("punch.toml").write_text(TOML)
    assert len(COMMANDS) == 2
    for command in COMMANDS:
        assert main(command) == 0, capsys.readouterr()
        assert "complete: yes (proven)" in capsys.readouterr().out
    assert enumsol.read_problem("punch.npz").fingerprint == fem.read_mesh_problem("punch.toml").fingerprint
