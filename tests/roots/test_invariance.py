"""Units, numbering, orientation and basis do not change which roots there are."""

import numpy as np
import pytest
import scipy.sparse as sp
from compare import statuses
from generators import random_problem

import enumsol
from enumsol import ContactProblem, gallery

FLIPPED = {"open": "open", "stick": "stick", "slip+": "slip-", "slip-": "slip+"}


def rebuild(problem, **changes):
    names = "A", "Bn", "Bt", "f", "gap", "friction", "friction_slope", "load_slope", "slip_offset"
    return ContactProblem(**({name: getattr(problem, name) for name in names} | changes))


def problems():
    rng = np.random.default_rng(11)
    yield "one node", gallery.one_node_triangle(), 5.0
    yield "two nodes", gallery.get("two-node-5").build(), 5.0
    yield "wedge, 3", gallery.get("wedge-8-3").build(), 1.0
    yield "wedge, 5", gallery.get("wedge-8-5").build(), 3.0
    yield "block", gallery.clamped_block(12, 3), 1.0
    yield "press fit", gallery.clamped_block(6, 3, gap=-0.1), 2.0
    for p in (3, 4, 5):
        yield f"random {p}", random_problem(rng, p, planted=1.0), 0.0


PROBLEMS = list(problems())
each = pytest.mark.parametrize(("problem", "alpha"), [p[1:] for p in PROBLEMS], ids=[p[0] for p in PROBLEMS])


def in_other_units(test):
    """For every problem and units smaller and larger; a third of these in every run."""
    return pytest.mark.few(14, 8)(each(pytest.mark.parametrize("factor", [1e-9, 1e-3, 3.7, 1e6, 1e9])(test)))


def found(problem, alpha):
    roots = enumsol.enumerate_roots(problem, alpha, "fast")
    assert (roots.index_sum, roots.families, len(statuses(roots))) == (1, (), len(roots))
    return roots


@in_other_units
def test_stiffness_and_load_together(problem, alpha, factor):
    # forces in other units
    before = found(problem, alpha)
    after = found(rebuild(problem, A=problem.A * factor, f=problem.f * factor), alpha)
    assert statuses(after) == statuses(before)
    for a, b in zip(after, before, strict=True):
        np.testing.assert_allclose(a.lambda_n, factor * b.lambda_n, rtol=1e-8, atol=1e-10 * factor * np.max(b.lambda_n))


@in_other_units
def test_load_with_gap(problem, alpha, factor):
    # load alone where the gap is zero; with the gap and the slip offset otherwise
    scaled = rebuild(problem, f=problem.f * factor, gap=problem.gap * factor, slip_offset=problem.slip_offset * factor)
    assert statuses(found(scaled, alpha)) == statuses(found(problem, alpha))


@in_other_units
def test_length_unit(problem, alpha, factor):
    # displacements in other units: stiffness down, gap up, forces the same
    scaled = rebuild(problem, A=problem.A / factor, gap=problem.gap * factor, slip_offset=problem.slip_offset * factor)
    before, after = found(problem, alpha), found(scaled, alpha)
    assert statuses(after) == statuses(before)
    for a, b in zip(after, before, strict=True):
        np.testing.assert_allclose(a.u_t, factor * b.u_t, rtol=1e-8, atol=1e-10 * factor * np.max(np.abs(b.u_t)))


@each
def test_numbering_of_contact_nodes(problem, alpha):
    order = np.random.default_rng(1).permutation(problem.p)
    F0, F1 = problem.affine_friction
    permuted = rebuild(
        problem, Bn=sp.csr_array(problem.Bn)[order], Bt=sp.csr_array(problem.Bt)[order], gap=problem.gap[order],
        slip_offset=problem.slip_offset[order], friction=F0[order], friction_slope=F1[order],
    )  # fmt: skip
    assert statuses(found(permuted, alpha)) == {tuple(s[i] for i in order) for s in statuses(found(problem, alpha))}


@each
def test_orientation_of_tangents(problem, alpha):
    flip = np.random.default_rng(2).random(problem.p) < 0.5
    flip[0] = True
    sign = np.where(flip, -1.0, 1.0)
    turned = rebuild(problem, Bt=sp.diags_array(sign) @ problem.Bt, slip_offset=sign * problem.slip_offset)
    before = statuses(found(problem, alpha))
    flipped = {tuple(FLIPPED[s] if f else s for s, f in zip(names, flip, strict=True)) for names in before}
    assert statuses(found(turned, alpha)) == flipped


@each
def test_basis_of_the_degrees_of_freedom(problem, alpha):
    Q = np.linalg.qr(np.random.default_rng(3).normal(size=(problem.n, problem.n)))[0]
    A = Q.T @ problem.A.toarray() @ Q
    turned = rebuild(problem, A=0.5 * (A + A.T), Bn=problem.Bn @ Q, Bt=problem.Bt @ Q, f=Q.T @ problem.f)
    before, after = found(problem, alpha), found(turned, alpha)
    assert statuses(after) == statuses(before)
    size = max(float(np.max(np.abs(root.u))) for root in before)
    for a, b in zip(after, before, strict=True):
        np.testing.assert_allclose(Q @ a.u, b.u, rtol=1e-6, atol=1e-8 * size)
        assert a.margin == pytest.approx(b.margin, rel=1e-5)


def test_offsets_shift_the_load():
    # gap and slip offset are displacements that B A^-1 f would have to make up for
    problem = random_problem(np.random.default_rng(5), 3, planted=1.0)
    B = np.vstack([problem.Bn.toarray(), problem.Bt.toarray()])
    shift = np.random.default_rng(6).normal(size=6)
    moved = rebuild(problem, f=problem.f + problem.A @ (B.T @ shift), gap=shift[:3], slip_offset=shift[3:])
    assert statuses(found(moved, 0.0)) == statuses(found(problem, 0.0))


def test_alpha_paths_add_up():
    problem = random_problem(np.random.default_rng(7), 3, planted=1.0)
    F = problem.friction
    split = rebuild(
        problem, f=0.25 * problem.f, load_slope=0.375 * problem.f, friction=0.5 * F, friction_slope=0.25 * F
    )
    assert statuses(found(split, 2.0)) == statuses(found(problem, 0.0))
