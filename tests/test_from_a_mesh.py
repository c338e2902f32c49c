"""What docs/from_a_mesh.md shows runs as it stands, and what it says comes out; gmsh's own mesh where gmsh is."""

import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from documents import ROOT, blocks, follow, write_wedge

import enumsol
from enumsol import fem

PAGE = ROOT / "docs" / "from_a_mesh.md"
(GMSH,) = [text for kind, text in blocks(PAGE) if kind == "text"]


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """The page, followed with a wedge of another program in place of gmsh's."""
    pytest.importorskip("meshio")
    folder = tmp_path_factory.mktemp("page")
    write_wedge(folder / "punch.msh")
    return {**follow(PAGE, folder), "folder": folder}


@pytest.mark.slow
def test_the_commands(seen):
    assert len(seen["outputs"]) == 3
    for _, text in seen["outputs"]:
        assert "complete: yes (proven" in text
    written, described = seen["folder"] / "punch.npz", seen["folder"] / "punch.toml"
    assert enumsol.read_problem(written).fingerprint == fem.read_mesh_problem(described).fingerprint
    assert seen["body"].p == seen["block"].p


@pytest.mark.slow
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


def test_a_load_at_the_limit(seen):
    (note,) = seen["notes"]
    assert "the load is at the limit of what contact can hold" in note


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
def test_from_gmsh_to_the_roots(tmp_path):
    subprocess.run([sys.executable, "-c", GMSH], check=True, capture_output=True, cwd=tmp_path)
    seen = follow(PAGE, tmp_path)
    assert all("complete: yes (proven" in text for _, text in seen["outputs"])
