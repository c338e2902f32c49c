"""In 3D, too, axes, units and numbering do not change which roots there are; problems in 2D keep theirs."""

import functools

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from complete import all_roots
from generators import random_problem
from problems3d import bounds, forces, from_compliance, random_coupled, unmatched, within

from enumsol import ContactProblem3D, enumerate_roots, gallery


def with_second_tangent(problem, rng, ratio):
    """The problem with p more degrees of freedom that carry the second tangent and no load."""
    p, n = problem.p, problem.n
    X = rng.normal(size=(p, p))
    wider = [sp.hstack([rows, sp.csr_array((p, p))]) for rows in (problem.Bn, problem.Bt)]
    last = sp.hstack([sp.csr_array((p, n)), sp.eye_array(p)])
    slope = None if problem.load_slope is None else np.append(problem.load_slope, np.zeros(p))
    F, F_slope = problem.affine_friction
    return ContactProblem3D(
        scipy.linalg.block_diag(problem.A.toarray(), np.eye(p) + X @ X.T / (4 * p)), *wider, last,
        np.append(problem.f, np.zeros(p)), gap=problem.gap, friction=(F, ratio * F),
        friction_slope=(F_slope, ratio * F_slope), load_slope=slope,
        slip_offset=np.stack([problem.slip_offset, np.zeros(p)], axis=1),
    )  # fmt: skip


def planes():
    rng = np.random.default_rng(21)
    for name in ("one-node-6.1", "two-node-5", "wedge-8-3"):
        entry = gallery.get(name)
        yield name, entry.build(), entry.alpha
    for p in (1, 2, 3, 4):
        for k in range(3):
            yield f"random {p}, {k}", random_problem(rng, p, planted=1.0), 0.0


PLANES = list(planes())


@pytest.mark.few(13, 7)
@pytest.mark.parametrize("ratio", [1.0, 0.6])
@pytest.mark.parametrize(("problem", "alpha"), [p[1:] for p in PLANES], ids=[p[0] for p in PLANES])
def test_a_problem_in_2d_keeps_its_roots(problem, alpha, ratio):
    plane = all_roots(problem, alpha)
    space = enumerate_roots(with_second_tangent(problem, np.random.default_rng(problem.p), ratio), alpha)
    wanted = [np.concatenate([root.lambda_n, root.lambda_t, np.zeros(problem.p)]) for root in plane]
    assert unmatched(space, wanted) == ([], [])
    assert (space.complete, len(space)) == (True, len(plane))
    for root in space:
        low, high = bounds(root)
        near = 1e-6 * np.max(np.abs(high))
        box = np.transpose([low - near, high + near])
        (twin,) = [twin for twin, lam in zip(plane, wanted, strict=True) if within(lam, box)]
        assert root.index == twin.index
        assert [s.value.strip("+-") for s in twin.statuses] == [s.value for s in root.statuses]
        for i, status in enumerate(twin.statuses):
            if status.value.startswith("slip"):
                middle = np.mean(root.slip_angle[i]) - (0.0 if status.value == "slip+" else np.pi)
                assert abs(np.sin(0.5 * middle)) < 1e-6


# -- axes, units, numbering ------------------------------------------------------------------------------------------


@functools.cache
def some(count, least):
    """Problems with at least so many roots, and their roots."""
    rng, chosen = np.random.default_rng(31), []
    while len(chosen) < count:
        S, g, F = random_coupled(rng, 2)
        roots = enumerate_roots(from_compliance(S, g, tuple(F.T)), 0)
        if roots.complete and len(roots) >= least:
            chosen.append((S, g, F, roots))
    return chosen


@pytest.fixture(params=range(6))
def case(request):
    """S, g, F and their roots."""
    return some(3, 1 if request.param < 3 else 3)[request.param % 3]


def check(before, S, g, F, image, nodes=(0, 1)):
    """The problem (S, g, F) has exactly the images of the roots, with their indices."""
    after = all_roots(from_compliance(S, g, tuple(F.T)), 0)
    wanted = [image(forces(root)) for root in before]
    assert (len(after), unmatched(after, wanted)) == (len(before), ([], []))
    for root, lam in zip(before, wanted, strict=True):
        (twin,) = [twin for twin in after if unmatched([twin], [lam]) == ([], [])]
        assert (twin.index, twin.statuses) == (root.index, tuple(root.statuses[i] for i in nodes))


@pytest.mark.few(0, 1)
def test_axes_turned_at_every_node(case):
    S, g, F, _ = case
    isotropic = np.repeat(F[:, :1], 2, axis=1)
    start = all_roots(from_compliance(S, g, tuple(isotropic.T)), 0)
    for angles in ([0.3, -1.1], [np.pi / 4, 2.0]):
        c, s = np.diag(np.cos(angles)), np.diag(np.sin(angles))
        Q = scipy.linalg.block_diag(np.eye(2), np.block([[c, s], [-s, c]]))
        check(start, Q @ S @ Q.T, Q @ g, isotropic, lambda lam, Q=Q: Q @ lam)


@pytest.mark.slow
def test_a_quarter_turn_with_the_coefficients_exchanged(case):
    S, g, F, before = case
    turn, sign = [0, 1, 4, 5, 2, 3], np.repeat([1.0, 1.0, -1.0], 2)
    turned = sign[:, None] * S[np.ix_(turn, turn)] * sign, sign * g[turn], F[:, ::-1]
    check(before, *turned, lambda lam: sign * lam[turn])


@pytest.mark.few(0, 9)
@pytest.mark.parametrize(("force", "length"), [(1e6, 1.0), (1e-9, 1e3), (3.7, 1e-9)])
def test_units(case, force, length):
    S, g, F, before = case
    check(before, S * (length / force), g * length, F, lambda lam: force * lam)


@pytest.mark.few(0, 1)
def test_numbering(case):
    S, g, F, before = case
    other = [1, 0, 3, 2, 5, 4]
    check(before, S[np.ix_(other, other)], g[other], F[::-1], lambda lam: lam[other], nodes=(1, 0))
