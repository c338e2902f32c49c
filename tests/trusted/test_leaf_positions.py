"""Where contact nodes are at a root in 3D: what many digits give lies in the ball (theory, section 13.2)."""

from fractions import Fraction

import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from problems3d import from_compliance

import enumsol
from enumsol import fem
from enumsol.arithmetic.balls import Ball
from enumsol.model.restart import SlipStart, restarted
from enumsol.model.sectors import SECTORS
from enumsol.trusted.positions import tangential_positions
from enumsol.trusted.space.leaf_positions import leaf_positions
from enumsol.trusted.space.sector_rows import OPEN, STICK

DIGITS, STEPS = 400, 24


def cube(spring, move=0.0, **friction):
    """A cube of one cell on the floor, held sideways at its roof and vertically by springs."""
    return fem.mesh_problem(
        fem.box(1, 1, 1), young=2.1e5, poisson=0.3, contact="bottom", pressure={"top": 100.0},
        displacement={"top": (0.0, move, "free")}, spring={"top": (spring, 0.0)}, **{"friction": 0.2} | friction,
    )  # fmt: skip


def column(values):
    return arb_mat([[arb(float(x))] for x in np.ravel(values)])


def digits(matrix):
    return [matrix[i, 0] for i in range(matrix.nrows())]


class ManyDigits:
    """A problem condensed with many digits, and the root near another one, by Newton's method with a fixed Jacobian."""

    def __init__(self, problem):
        ctx.prec = DIGITS
        self.p, self.problem = problem.p, problem
        A = arb_mat([[arb(x) for x in row] for row in problem.A.toarray().tolist()])
        rows = np.vstack([part.toarray() for part in (problem.Bn, problem.Bt1, problem.Bt2)])
        B = arb_mat([[arb(x) for x in row] for row in rows.tolist()])
        self.S, self.free = B * A.solve(B.transpose()), B * A.solve(column(problem.f))

    def root(self, near, offset):
        """lambda and Bt u (2p,) near a root, all of whose nodes stick or slip; ``offset`` is (p, 2)."""
        p, F = self.p, self.problem.friction_at(0)
        gap = column(np.concatenate([self.problem.gap, offset.T.ravel()]))
        slips = [str(status) == "slip" for status in near.statuses]
        unknowns = [arb(float(x)) for x in near.lambda_n]
        for i in range(p):
            value = near.lambda_t[i] / F[i]
            unknowns += [arb(float(np.arctan2(value[1], value[0])))] if slips[i] else map(arb, value.tolist())

        def forces(x):
            found, k = [[*x[:p]], [], []], p
            for i in range(p):
                if slips[i]:
                    pair = x[i] * x[k].cos(), x[i] * x[k].sin()
                    k += 1
                else:
                    pair = x[k], x[k + 1]
                    k += 2
                for axis in (0, 1):
                    found[1 + axis].append(arb(float(F[i, axis])) * pair[axis])
            return arb_mat([[value] for part in found for value in part])

        def residual(x):
            w, k = digits(self.free - gap - self.S * forces(x)), p
            found = w[:p]
            for i in range(p):
                v = [arb(float(F[i, axis])) * w[(1 + axis) * p + i] for axis in (0, 1)]
                if slips[i]:
                    found.append(v[0] * x[k].sin() - v[1] * x[k].cos())
                    k += 1
                else:
                    found += v
                    k += 2
            return found

        size, h = len(unknowns), arb(2) ** -150
        start = residual(unknowns)
        columns = []
        for j in range(size):
            moved = residual([x + h if i == j else x for i, x in enumerate(unknowns)])
            columns.append([(a - b) / h for a, b in zip(moved, start, strict=True)])
        J = arb_mat([[columns[j][i] for j in range(size)] for i in range(size)])
        for _ in range(STEPS):
            step = digits(J.solve(arb_mat([[x] for x in residual(unknowns)])))
            unknowns = [(x - dx).mid() for x, dx in zip(unknowns, step, strict=True)]
        assert all(abs(x) < arb(2) ** -200 for x in residual(unknowns))
        lam = forces(unknowns)
        return digits(lam), digits(self.free - self.S * lam)[p:]


def inside(values, ball):
    return all(
        abs(value - arb(float(mid))) <= arb(float(rad))
        for value, mid, rad in zip(values, ball.mid.ravel(), ball.rad.ravel(), strict=True)
    )


def as_ball(bounds):
    """Bounds (..., 2) of all components, those of one direction after the other."""
    low, high = bounds[..., 0].ravel(order="F"), bounds[..., 1].ravel(order="F")
    return Ball(0.5 * (low + high), (0.5 * (high - low)) * (1 + 1e-12) + 1e-300)


def as_known(forces):
    return Ball(forces, 1e-9 * np.abs(forces))


def certain(root):
    return [{"open": OPEN, "stick": STICK, "slip": SECTORS + 1}[str(status)] for status in root.statuses]


@pytest.mark.parametrize("spring", [1e4, 1.0])
def test_displacements_of_a_root_are_enclosed_as_closely_as_rounding_allows(spring):
    problem = cube(spring, 1e-3)
    (root,) = enumsol.enumerate_roots(problem, 0)
    lam, moved = ManyDigits(problem).root(root, problem.slip_offset)
    found = as_ball(root.enclosure.u_t)
    assert inside(moved, found)
    assert inside(lam[: problem.p], as_ball(root.enclosure.lambda_n))
    # S is known to some 1e-15 of an entry of about one over the stiffness of the springs, and the load is 100
    assert np.max(found.rad) < 1e-12 * 100.0 / spring


@pytest.mark.parametrize(("spring", "friction"), [(1.0, {}), (30.0, {"friction2": 0.15, "friction2_slope": 0.0})])
def test_every_offset_in_a_ball_leads_into_the_ball_of_positions(spring, friction):
    rng = np.random.default_rng(3)
    driven, radius = cube(spring, 4e-5, **friction), 1e-10
    offset = np.round(rng.uniform(-4e-5, 4e-5, (4, 2)), 7)
    start = SlipStart(offset, np.full((4, 2), radius))
    problem = restarted(driven, start)
    (root,) = enumsol.enumerate_roots(driven.replace(slip_offset=offset), 0)
    lam, _ = ManyDigits(driven).root(root, offset)
    forces = Ball(np.array([float(x.mid()) for x in lam]), np.full(12, 5e-5))
    found = leaf_positions(problem, Fraction(0), forces, certain(root))
    by_forces = tangential_positions(problem, Fraction(0), forces, np.zeros(8, dtype=bool), start.ball)
    slipping = np.tile([str(status) == "slip" for status in root.statuses], 2)
    assert slipping.any()
    assert np.all(np.isinf(found.rad[~slipping]))
    assert np.all(found.rad[slipping] < np.minimum(10 * radius, 0.1 * by_forces.rad[slipping]))
    for _ in range(4):
        other = offset + radius * rng.choice([-0.999, 0.999], (4, 2))
        lam, moved = ManyDigits(driven).root(root, other)
        assert inside(lam, forces)
        pick = np.flatnonzero(slipping)
        assert inside([moved[k] for k in pick], Ball(found.mid[pick], found.rad[pick]))


def test_no_leaf_says_where_nodes_are_whose_directions_it_may_not_hold():
    problem = cube(1.0, 1e-3)
    (root,) = enumsol.enumerate_roots(problem, 0)
    forces = np.concatenate([root.lambda_n, root.lambda_t.T.ravel()])
    assert leaf_positions(problem, Fraction(0), Ball(forces, np.zeros(12)), certain(root)) is not None
    turned = np.concatenate([root.lambda_n, -root.lambda_t.T.ravel()])
    assert leaf_positions(problem, Fraction(0), Ball(turned, np.zeros(12)), certain(root)) is None
    wide = Ball(forces, np.abs(forces))  # any direction
    assert leaf_positions(problem, Fraction(0), wide, certain(root)) is None
    sticking = leaf_positions(problem, Fraction(0), Ball(forces, np.zeros(12)), [STICK] * 4)
    assert sticking is None


def test_a_force_of_open_sign_does_not_choose_between_slips_along_one_axis():
    # two roots that slip at both nodes, the second one to opposite sides
    S, F = np.eye(6), np.array([7.0, 4.0])
    S[:4, :4] = [[12.25, 0, -2, 8], [0, 0.25, 0, 0], [-2, 0, 10.25, -2], [8, 0, -2, 12.25]]
    problem = from_compliance(S, np.array([-16.875, 0.125, 1307.0, -88.0, 0, 0]), (F, 0 * F))
    slipping = [root for root in enumsol.enumerate_roots(problem, 0) if certain(root) == [SECTORS + 1] * 2]
    one, other = (np.concatenate([root.lambda_n, root.lambda_t.T.ravel()]) for root in slipping)
    assert one[3] * other[3] < 0
    middle = 0.25 * one + 0.75 * other  # the sign is that of the other one
    both = Ball(middle, np.abs(middle - one) * (1 + 1e-9))
    found = [leaf_positions(problem, Fraction(0), ball, certain(slipping[0])) for ball in (both, as_known(one))]
    assert found[0] is None
    assert np.all(np.abs(found[1].mid - slipping[0].u_t.T.ravel())[:2] < 1e-6)


@pytest.mark.parametrize("spring", [1e2, 1.0])
def test_a_body_on_weak_springs_is_driven_to_and_fro(spring):
    rest = cube(0.0 + spring)
    driven = rest.replace(load_slope=cube(spring, 1e-3).f - rest.f)
    found = enumsol.histories(driven, [0, 1, -1, 0.5, 0])
    assert found.complete
    report = enumsol.verify(driven, found.proof)
    assert report.complete
    assert report.unique_until == 5
    # what is not known does not grow from step to step
    widest = [max(stage.largest_radius for stage in found.stages(k)) for k in range(2, 6)]
    assert max(widest) < 10 * widest[0]
