"""Verified counts against exact ones where a condition is next to zero, zero, or just broken."""

from fractions import Fraction

import numpy as np
import pytest
from complete import accepted_report, all_roots, complete_report
from effort import some
from oracles import exact_condense, exact_solutions
from proof_tools import Judge, records_of

from enumsol import ContactProblem, enumerate_roots
from enumsol.search import solvers

OPEN, STICK, SLIP_PLUS, SLIP_MINUS = range(4)


def planted(rng, p):
    """A problem whose parameter alpha is the distance of one condition of a planted root from zero.

    All data are small whole numbers: lambda(alpha) and w(alpha) of the planted root are affine in alpha, and so is its
    load, so that no rounding enters. For alpha < 0 the condition is broken and the planted root is none.
    """
    X = rng.integers(-2, 3, size=(2 * p, 2 * p))
    A = (X @ X.T + np.eye(2 * p, dtype=int) * int(rng.integers(1, 4))).astype(float)
    F = rng.integers(1, 4, size=p).astype(float)
    codes = rng.integers(0, 4, size=p)
    chosen = int(rng.integers(p))
    force, move, force_rate, move_rate = np.zeros((4, 2 * p))
    for i, code in enumerate(codes):
        near = i == chosen
        which = int(rng.integers(2))
        if code == OPEN:
            move[i], move_rate[i] = (0.0, -1.0) if near else (-float(rng.integers(1, 4)), 0.0)
            move[p + i] = float(rng.integers(-2, 3))
            continue
        turn = {STICK: 0.0, SLIP_PLUS: 1.0, SLIP_MINUS: -1.0}[int(code)]
        force[i] = float(rng.integers(1, 4))
        move[p + i] = turn * float(rng.integers(1, 4))
        force[p + i] = turn * F[i] * force[i]
        if code == STICK:
            reach = F[i] * force[i]
            force[p + i] = float(rng.integers(-reach + 1, reach))
            if near:
                side = 1.0 if which else -1.0
                force[p + i], force_rate[p + i] = side * reach, -side
        elif near and which:
            move[p + i], move_rate[p + i] = 0.0, turn
        elif near:
            force[i], force_rate[i] = 0.0, 1.0
            force[p + i], force_rate[p + i] = 0.0, turn * F[i]
    rows, slope = np.eye(2 * p), A @ move_rate + force_rate
    return ContactProblem(A, rows[:p], rows[p:], A @ move + force, friction=F, load_slope=slope)


def distances(rng):
    """alpha from 1e-6 to 1e-18 on both sides of zero, beyond, and zero itself; decimal fractions or floats."""
    size = Fraction(1, 10 ** int(rng.choice([6, 8, 10, 12, 13, 14, 15, 16, 17, 18, 25, 40])))
    alpha = rng.choice([-1, 1, 1, 0]) * size
    return float(alpha) if rng.random() < 0.5 else Fraction(alpha)


def cases(seed, p, count):
    rng = np.random.default_rng([seed, p])
    for _ in range(count):
        problem, alpha = planted(rng, p), distances(rng)
        if rng.random() < 0.3:  # a load that is rounded to floats is as far from degenerate as that gives
            problem, alpha = problem.replace(f=problem.f + float(alpha) * problem.load_slope, load_slope=None), 0.0
        yield problem, alpha


def outline(roots):
    """What a count consists of: statuses and indices of the roots, dimensions and indices of the families."""
    singles = sorted((tuple(s.value for s in root.statuses), root.active, root.index) for root in roots)
    return singles, sorted((family.dimension, family.index, family.vertices.shape) for family in roots.families)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("p", "count"), [(1, some(50, of=130)), (2, 65), (3, 40), (4, 20)])
def test_counts_equal_the_exact_ones(p, count):
    degenerate = balls = rationals = several = 0
    for problem, alpha in cases(1, p, count):
        exact = enumerate_roots(problem, alpha, "exact", "exhaustive")
        roots = all_roots(problem, alpha)
        assert outline(roots) == outline(exact)
        assert roots.index_sum == 1
        report = complete_report(problem, roots.proof)
        assert (report.roots, report.families) == (len(exact), len(exact.families))
        degenerate += any(not root.regular for root in roots) or bool(roots.families)
        several += len(roots) > 1
        balls += not roots.stats.escalations.rationals
        rationals += bool(roots.stats.escalations.rationals)
    # the cases are what they are meant to be
    assert min(degenerate, several, rationals) >= count // 13
    assert balls >= count / 5


def contained(exact, roots):
    """Whether these are the exact roots, with all statuses that hold: balls may leave some possible that do not."""
    left = list(roots)
    for root in exact:
        near = (other for other in left if root.index == other.index)
        same = [one for one in near if all(held <= may for held, may in zip(root.active, one.active, strict=True))]
        if not same:
            return False
        left.remove(min(same, key=lambda other: sum(map(len, other.active))))
    return not left


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("p", "count"), [(1, some(20, of=30)), (2, 30), (3, 15)])
def test_without_rationals_the_count_is_right_or_open(p, count, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(solvers, "EXACT_DOF_LIMIT", 0)
        verified = [(problem, alpha, enumerate_roots(problem, alpha)) for problem, alpha in cases(2, p, count)]
    left_open = 0
    for problem, alpha, roots in verified:
        exact = enumerate_roots(problem, alpha, "exact", "exhaustive")
        assert roots.certified_data == "problem"
        report = accepted_report(problem, roots.proof)
        assert report.complete == roots.complete
        if roots.complete:
            assert contained(exact, roots)
            assert outline(roots)[1] == outline(exact)[1]
        else:
            left_open += 1
            assert "undecided" in roots.closing_line
            for item in roots.undecided:
                assert "singular" in item.reason or "is zero to" in item.reason
                assert "perturb the load" in item.hint
            known = {tuple(s.value for s in root.statuses) for root in exact}
            assert {tuple(s.value for s in root.statuses) for root in roots} <= known
    assert count / 20 <= left_open <= 0.9 * count


def test_planted_roots_are_there():
    # the generator does what it says: at alpha > 0 the planted root is regular, at 0 it is degenerate
    rng = np.random.default_rng(3)
    for _ in range(20):
        problem = planted(rng, int(rng.integers(1, 3)))
        regular = [root.regular for root in enumerate_roots(problem, Fraction(1, 1000), "exact", "exhaustive")]
        at_zero = enumerate_roots(problem, 0, "exact", "exhaustive")
        assert any(regular)
        assert at_zero.families or not all(root.regular for root in at_zero)


@pytest.mark.slow
def test_proofs_stand_up_to_fractions():
    for p, count in ((1, some(10, of=30)), (2, some(10, of=30))):
        for problem, alpha in cases(4, p, count):
            roots = enumerate_roots(problem, alpha)
            assert Judge(problem).valid(records_of(roots.proof))
            components = exact_solutions(problem, alpha)
            isolated = [component.dimension == 0 for component in components]
            assert (len(roots), len(roots.families)) == (isolated.count(True), isolated.count(False))
            S, g, F = exact_condense(problem, alpha)
            for root in roots:
                if root.enclosure is not None:
                    assert_enclosed(root, S, g, F, components)


def assert_enclosed(root, S, g, F, components):
    """The bounds hold lambda and w of one of the exact solutions."""
    p = len(F)
    bounds = np.concatenate([root.enclosure.lambda_n, root.enclosure.lambda_t])
    moves = np.concatenate([root.enclosure.u_n, root.enclosure.u_t])
    for component in components:
        for _, vertices, _ in component.parts:
            for x in vertices:
                w = [g[r] - sum(S[r][k] * x[k] for k in range(2 * p)) for r in range(2 * p)]
                pairs = [*zip(x, bounds, strict=True), *zip(w, moves, strict=True)]
                if all(Fraction(float(low)) <= v <= Fraction(float(high)) for v, (low, high) in pairs):
                    return
    raise AssertionError(f"no exact solution within the bounds of {root}")
