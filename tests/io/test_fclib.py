import sys

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from alike import assert_close, assert_same
from complete import limit_of
from refusals import bad_problem, refusal

import enumsol
from enumsol import ContactProblem3D, enumerate_roots, gallery, read_problem, write_problem


def constant_square(alpha):
    return gallery.two_node_square((1.0, -4.0), (1.5, -3.5), friction=alpha)


def put_matrix(group, name, matrix, kind="csc"):
    """As fclib.h writes it: p and i are pointers and indices, or the triplets' columns and rows (CSparse)."""
    parts = group.create_group(name)
    matrix = {"csc": sp.csc_array, "csr": sp.csr_array, "triplet": sp.coo_array}[kind](matrix)
    if kind == "triplet":
        p, i, nz = matrix.col, matrix.row, matrix.nnz
    else:
        p, i, nz = matrix.indptr, matrix.indices, -1 if kind == "csc" else -2
    for key, value in (("nzmax", matrix.nnz), ("m", matrix.shape[0]), ("n", matrix.shape[1]), ("nz", nz)):
        parts[key] = np.array([value], dtype=np.int32)
    parts["p"], parts["i"], parts["x"] = p.astype(np.int32), i.astype(np.int32), matrix.data


def put(path, name, spacedim, matrices, vectors):
    with h5py.File(path, "w") as file:
        group = file.create_group(name)
        group["spacedim"] = np.array([spacedim], dtype=np.int32)
        for key, (matrix, kind) in matrices.items():
            put_matrix(group, key, matrix, kind)
        group.create_group("vectors")
        for key, vector in vectors.items():
            group["vectors"][key] = vector


def put_local(path, W, q, mu, kind="csc", spacedim=2):
    put(path, "fclib_local", spacedim, {"W": (W, kind)}, {"q": q, "mu": mu})


def put_global(path, M, H, f, w, mu, kind="csc"):
    put(path, "fclib_global", 2, {"M": (M, "csc"), "H": (H, kind)}, {"f": f, "w": w, "mu": mu})


def fclib_residual(W, q, mu, u, r):
    """How far (u, r) is from u = W r + q, 0 <= u_N perp r_N >= 0 and Coulomb's law as fclib states them."""
    gap, press, slide, drag = u[0::2], r[0::2], u[1::2], r[1::2]
    return max(
        np.max(np.abs(W @ r + q - u)),
        np.max(-np.minimum(gap, 0)),
        np.max(-np.minimum(press, 0)),
        np.max(np.abs(gap * press)),
        np.max(np.maximum(np.abs(drag) - mu * press, 0)),
        # maximal dissipation: drag = -mu press sign(slide) where it slides
        np.max(np.abs(slide * drag + mu * press * np.abs(slide))),
    )


@pytest.mark.parametrize("kind", ["csc", "csr", "triplet"])
def test_local_problems(tmp_path, kind):
    # r_N >= 0 and u_N >= 0 in fclib, friction against u_T: every root, put back, solves the file's own equations
    source = constant_square(5.0)
    S, g = source.condensed.S, source.condensed.g0
    order = [0, 2, 1, 3]  # normal and tangential, contact by contact
    W, q, mu = S[np.ix_(order, order)], -g[order], np.full(2, 5.0)
    put_local(tmp_path / "p.hdf5", W, q, mu, kind)
    problem = read_problem(tmp_path / "p.hdf5")
    assert problem.p == 2
    assert np.allclose(problem.condensed.S, S, rtol=1e-14)
    assert np.allclose(problem.condensed.g0, g, rtol=1e-14)
    roots, expected = enumerate_roots(problem, 0.0), enumerate_roots(source, 0.0)
    assert len(roots) == 5
    for root, other in zip(roots, expected, strict=True):
        assert root.statuses == other.statuses
        assert_close(root, other, "lambda_n", rtol=1e-12, atol=1e-14)
        u = -np.column_stack([root.u_n, root.u_t]).ravel()
        r = np.column_stack([root.lambda_n, root.lambda_t]).ravel()
        assert fclib_residual(W, q, mu, u, r) < 1e-13


def test_local_problems_in_3d(tmp_path):
    # the file of a public test: u = W r + q with friction 0.1; put back, the solution solves the file's own equations
    W = np.array([[15.0, -1.0, -2.0], [-1.0, 14.0, 1.0], [-2.0, 1.0, 16.0]])
    W, q = np.kron(np.eye(2), W) + 0.1, np.array([-1.0, 2.0, 3.0, -2.0, 1.0, -1.0])
    put_local(tmp_path / "p.hdf5", W, q, np.full(2, 0.1), spacedim=3)
    problem = read_problem(tmp_path / "p.hdf5")
    assert isinstance(problem, ContactProblem3D)
    found = limit_of(problem, 0)
    u = -np.column_stack([found.u_n, found.u_t])
    r = np.column_stack([found.lambda_n, found.lambda_t])
    assert np.allclose(u.ravel(), W @ r.ravel() + q, atol=1e-12)
    assert np.all(r[:, 0] > 0)
    assert np.allclose(u[:, 0], 0.0, atol=1e-12)
    for slide, drag, press in zip(u[:, 1:], r[:, 1:], r[:, 0], strict=True):
        assert np.allclose(drag, -0.1 * press * slide / np.linalg.norm(slide), atol=1e-9)


def test_global_problems_in_3d_round_trip_exactly(tmp_path):
    rng = np.random.default_rng(1)
    X, mu = rng.normal(size=(9, 9)), rng.random(2)
    arguments = (X @ X.T + np.eye(9), *(rng.normal(size=(2, 9)) for _ in range(3)), rng.normal(size=9))
    problem = ContactProblem3D(*arguments, rng.normal(size=2), (mu, mu), slip_offset=rng.normal(size=(2, 2)))
    write_problem(problem, tmp_path / "p.h5")
    assert read_problem(tmp_path / "p.h5").fingerprint == problem.fingerprint
    table = enumsol.FrictionTable([0, 1], [0.1, 0.2])
    for change, what in (
        ({"friction": (0.1, 0.2)}, "friction is orthotropic"),
        ({"friction": table}, "friction depends on the slip"),
        ({"friction_slope": 1.0}, "friction or load depends on alpha"),
    ):
        other = ContactProblem3D(*arguments, **change)
        bad_problem(f"{what}, which fclib cannot hold", write_problem, other, tmp_path / "q.h5")
        assert not (tmp_path / "q.h5").exists()


def test_global_problems_round_trip_exactly(tmp_path):
    rng = np.random.default_rng(0)
    X = rng.normal(size=(9, 9))
    problem = enumsol.ContactProblem(
        X @ X.T + np.eye(9), rng.normal(size=(3, 9)), sp.random_array((3, 9), density=0.5, rng=rng), rng.normal(size=9),
        gap=rng.normal(size=3), slip_offset=rng.normal(size=3), friction=rng.random(3),
    )  # fmt: skip
    for _ in range(2):  # the file replaces itself
        write_problem(problem, tmp_path / "p.h5")
        parts = ("A", "Bn", "Bt", "f", "gap", "slip_offset", "friction")
        assert_same(read_problem(tmp_path / "p.h5"), problem, *parts)


@pytest.mark.parametrize("kind", ["csc", "csr", "triplet"])
def test_global_problems_of_others(tmp_path, kind):
    # u = H'v + w >= 0 opens: a spring pushed down by 3, 0.5 above the floor
    H = np.zeros((6, 2))
    H[4, 0] = H[5, 1] = 1.0
    put_global(tmp_path / "p.h5", 4.0 * np.eye(6), H, [0, 0, 0, 0, -3.0, 0.5], [0.5, 0.0], [0.1], kind)
    (root,) = enumerate_roots(read_problem(tmp_path / "p.h5"), 0.0)
    assert root.lambda_n[0] == pytest.approx(1.0)
    assert root.u[4] == pytest.approx(-0.5)
    assert root.u[5] == pytest.approx((0.5 - 0.1) / 4)  # it slips towards positive v, friction holds it back


def test_triplets_that_could_be_read_both_ways_are_refused(tmp_path):
    H = np.zeros((6, 2))
    H[0, 0], H[1, 1], H[1, 0] = 1.0, 1.0, 0.5
    put_global(tmp_path / "p.h5", np.eye(6), H, np.ones(6), np.zeros(2), [0.1], "triplet")
    bad_problem("H is stored as triplets whose rows and columns cannot be told apart", read_problem, tmp_path / "p.h5")


def refused(path, pattern):
    message = str(bad_problem(pattern, read_problem, path))
    assert message.startswith(f"{path}: ")
    assert "expected" in message


def test_what_is_refused(tmp_path):
    path = tmp_path / "p.h5"
    W, q, mu = np.eye(4), np.ones(4), np.ones(2)
    put_local(path, np.eye(6), np.ones(6), mu, spacedim=4)
    refused(path, "it is a problem in 4 dimensions; expected spacedim = 2 or 3")
    put_local(path, W, np.ones(3), mu)
    refused(path, r"/fclib_local/vectors/q has shape \(3,\); expected \(4,\)")
    put_local(path, np.eye(5), np.ones(5), mu)
    refused(path, r"W has shape \(5, 5\); expected a square matrix with two rows a contact")
    put_local(path, np.diag([1.0, 1.0, 1.0, 0.0]), q, mu)
    refused(path, "its W, read as A, Bn and Bt, cannot be used: Bt row 1 is zero")
    # redundant contacts, as on a rigid body
    put_local(path, np.ones((4, 4)) + np.diag([1.0, 1.0, 0.0, 0.0]), q, mu)
    refused(path, "its W, read as A, Bn and Bt, cannot be used: .* linearly dependent rows")
    put_local(path, W, q, np.array([1.0, -1.0]))
    refused(path, "friction is -1 at contact node 1")
    put_local(path, W, q, mu)
    with h5py.File(path, "a") as file:
        file["fclib_local"].create_group("V")
    refused(path, r"equality constraints \(V, R, s\)")
    put_global(path, np.eye(4), -np.eye(4), q, q, mu)
    with h5py.File(path, "a") as file:
        file["fclib_global"].create_group("G")
    refused(path, r"equality constraints \(G, b\)")
    put_global(path, np.eye(4), -np.eye(4)[:, :3], q, q, mu)
    refused(path, r"H has shape \(4, 3\); expected 4 rows and two columns a contact")


def test_broken_structures(tmp_path):
    path = tmp_path / "p.h5"

    def change(edit):
        put_local(path, np.eye(4), np.ones(4), np.ones(2))
        with h5py.File(path, "a") as file:
            edit(file["fclib_local"])

    change(lambda group: group.pop("W"))
    refused(path, r"/fclib_local/W is missing \(found .*vectors\)")
    change(lambda group: group["W"].pop("i"))
    refused(path, "/fclib_local/W/i is missing")
    change(lambda group: group["W"]["i"].write_direct(np.full(4, 9, dtype=np.int32)))
    refused(path, "W is not a sparse matrix")
    change(lambda group: group["W"]["nz"].write_direct(np.array([-7], dtype=np.int32)))
    refused(path, "W/nz is -7; expected -1")
    change(lambda group: group["vectors"].pop("mu"))
    refused(path, "/fclib_local/vectors/mu is missing")
    with h5py.File(path, "w") as file:
        file["other"] = 1
    refused(path, "it holds other; expected a group named fclib_global or fclib_local")
    with h5py.File(path, "w"):
        pass
    refused(path, "it holds nothing; expected a group named")


def test_paths_over_alpha_cannot_be_written(tmp_path):
    for problem in (gallery.one_node_triangle(), gallery.get("two-node-6.7-minus").build()):
        message = "friction or load depends on alpha, which fclib cannot hold"
        bad_problem(message, write_problem, problem, tmp_path / "p.h5")
    assert not (tmp_path / "p.h5").exists()


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    path = tmp_path / "p.h5"
    write_problem(constant_square(1.0), path)
    monkeypatch.setitem(sys.modules, "h5py", None)
    message = r'need the package h5py.*pip install "enumsol\[fclib\]"'
    refusal(enumsol.MissingDependencyError, message, read_problem, path)
    refusal(enumsol.MissingDependencyError, "h5py", write_problem, constant_square(1.0), path)
