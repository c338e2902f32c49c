"""Bodies that nothing holds, in 2D: all solutions against an oracle in rationals, which condenses nothing."""

import itertools
import pickle
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp
from alike import anew
from complete import all_roots, proven_roots
from helpers.floating_oracle import Oracle, block_on_table, random_body
from refusals import bad_argument, bad_problem, refusal

import enumsol
from enumsol.errors import NotHeldError


def difference_from_oracle(problem, alpha, arithmetic, oracle=None):
    """What enumerate_roots says other than the oracle, or None."""
    oracle = Oracle(problem, alpha) if oracle is None else oracle
    roots = enumsol.enumerate_roots(problem, alpha, arithmetic=arithmetic)
    if not roots.complete:
        return f"not complete: {roots.closing_line}"
    if (len(roots), len(roots.families)) != (len(oracle.points), oracle.families):
        return f"{len(roots)} roots and {len(roots.families)} families, not {len(oracle.points)} and {oracle.families}"
    forces, u = oracle.forces
    for wanted in np.hstack([forces, u]):
        found = [np.concatenate([root.lambda_n, root.lambda_t, root.u]) for root in roots]
        if min(np.max(np.abs(row - wanted)) for row in found) > 1e-7 * (1 + np.max(np.abs(wanted))):
            return "a root is not where it should be"
    for root in roots:
        if root.enclosure is not None and not np.all(root.enclosure.lambda_n[:, 0] <= root.enclosure.lambda_n[:, 1]):
            return "an enclosure is empty"
    if arithmetic == "verified":
        report = enumsol.verify(problem, roots.proof)
        counts = report.roots, report.families, report.within is not None
        if not report.complete or counts != (len(roots), len(roots.families), roots.rigid_bound.needed):
            return f"the checker says {report}"
    return None


def failures(seeds, alpha):
    found = {}
    for seed in seeds:
        problem = random_body(seed)
        for arithmetic in ("verified", "exact"):
            if (said := difference_from_oracle(problem, alpha, arithmetic)) is not None:
                found[seed, arithmetic] = said
    return found


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("first", "alpha"), [(0, 0), (10, 0.5)])
def test_all_solutions_of_random_bodies(first, alpha):
    assert not failures(range(first, first + 8), alpha)


@pytest.mark.long
def test_all_solutions_of_many_random_bodies():
    assert not failures(range(100, 180), 0.25)


@pytest.mark.few(2, 5)
@pytest.mark.parametrize("seed", [1, 3, 5, 7, 21, 33, 39, 40, 21366])
def test_a_bound_is_needed_if_it_cuts_something_off(seed):
    problem = random_body(seed)
    # all numbers are small: nothing begins as far away as this
    others = problem, problem.replace(max_rigid_displacement=2.0**20)
    near, far = ({v for _, part in Oracle(other, 0).parts for v in part} for other in others)
    for arithmetic in ("verified", "exact"):
        roots = all_roots(problem, 0, arithmetic=arithmetic)
        assert roots.rigid_bound.needed == (near != far)


@pytest.mark.parametrize(("push", "statuses"), [(0.0, {"stick"}), (0.25, {"stick"}), (0.9, {"stick", "slip+"})])
def test_a_block_below_sliding_has_one_solution(push, statuses):
    problem = block_on_table(cells=3, push=push)
    roots = proven_roots(problem, 0)
    assert roots.unique
    root = roots[0]
    assert {status.value for status in root.statuses} <= statuses
    # nothing holds it: contact carries the whole load
    carried = problem.contact_rows.T @ np.r_[root.lambda_n, root.lambda_t]
    assert np.allclose(problem.rigid_modes.T @ (problem.f - carried), 0)
    assert np.max(np.abs(problem.A @ root.u + carried - problem.f)) < 1e-12
    held = problem.modes.held
    assert np.allclose(root.u[held], root.rigid_displacement[held], atol=1e-14)


def test_a_block_at_the_limit_slides_as_far_as_is_asked():
    problem = block_on_table(cells=2, push=1.0, max_rigid_displacement=5.0)
    roots = all_roots(problem, 0)
    assert roots.rigid_bound.needed
    assert not roots.unique
    (family,) = roots.families
    assert (len(roots), family.dimension, family.free_modes) == (0, 1, (0,))
    assert "free to move along mode 0" in repr(roots)
    assert "within rigid displacements of 5" in repr(roots)
    assert max(np.max(part.rigid_coordinates[:, 0]) for part in family.polytopes) == 5.0


def test_a_block_above_sliding_has_no_solution():
    problem = block_on_table(cells=3, push=1.25)
    roots = proven_roots(problem, 0)
    assert (len(roots), roots.families, roots.at_least) == (0, (), 0)
    assert not enumsol.is_unique(problem, 0)


def test_a_block_pulled_off_the_table_has_no_solution():
    roots = all_roots(block_on_table(press=-1.0), 0)
    assert (len(roots), roots.families) == (0, ())


@pytest.mark.parametrize("push", [0.0, 0.5, 0.9])
def test_weak_springs_tend_to_the_body_that_nothing_holds(push):
    problem = block_on_table(cells=2, push=push)
    (free,) = enumsol.enumerate_roots(problem, 0)
    errors = []
    for weak in (1e-3, 1e-5, 1e-7, 1e-9):
        A = sp.csc_array(problem.A + weak * sp.eye_array(problem.n))
        held = enumsol.ContactProblem(
            A, problem.Bn, problem.Bt, problem.f, friction=problem.friction, friction_slope=problem.friction_slope
        )
        (root,) = enumsol.enumerate_roots(held, 0)
        assert (root.statuses, root.index) == (free.statuses, free.index)
        errors.append(max(np.max(np.abs(root.lambda_n - free.lambda_n)), np.max(np.abs(root.u - free.u))))
    assert errors[-1] < 1e-7
    assert all(b < 0.1 * a + 1e-7 for a, b in itertools.pairwise(errors))


def test_solutions_do_not_depend_on_the_basis_of_the_modes():
    problem = block_on_table(push=0.5)
    N = problem.rigid_modes @ np.array([[1, 2, 0], [0, 1, -1], [1, 0, 4]])
    (one,), (two,) = (enumsol.enumerate_roots(p, 0) for p in (problem, anew(problem, rigid_modes=N)))
    assert np.allclose(one.u, two.u, atol=1e-12)
    assert np.allclose(one.lambda_n, two.lambda_n, atol=1e-12)


@pytest.mark.slow
def test_workers_limits_and_resumption(tmp_path):
    problem, path = block_on_table(cells=4, push=0.5), tmp_path / "block.proof"
    whole = enumsol.enumerate_roots(problem, 0)
    cut = enumsol.enumerate_roots(problem, 0, max_nodes=10, proof_path=path)
    assert cut.undecided
    # a root that is found without the tree
    assert (cut.complete, cut.at_least, len(cut)) == (False, 1, 1)
    resumed = all_roots(problem, 0, proof_path=path, resume=True)
    assert resumed.stats.resumed
    assert resumed.rigid_bound == whole.rigid_bound
    with ThreadPoolExecutor(2) as executor:
        spread = enumsol.enumerate_roots(problem, 0, executor=executor)
    for other in (resumed, spread):
        assert np.array_equal(other[0].lambda_n, whole[0].lambda_n)
        assert enumsol.verify(problem, other.proof).complete


def test_what_is_kept_of_a_body_that_nothing_holds(tmp_path):
    problem = block_on_table(max_rigid_displacement=7.0)
    for place in ("block.npz", "block"):
        enumsol.write_problem(problem, tmp_path / place)
        again = enumsol.read_problem(tmp_path / place)
        assert (again.fingerprint, again.max_rigid_displacement) == (problem.fingerprint, 7.0)
    assert pickle.loads(pickle.dumps(problem)).fingerprint == problem.fingerprint
    assert anew(problem, f=2 * problem.f).rigid_reach == 7.0
    changes = {"max_rigid_displacement": 8.0}, {"rigid_modes": 2 * problem.rigid_modes}
    others = problem, problem.on_springs, *(anew(problem, **change) for change in changes)
    assert len({other.fingerprint for other in others}) == 4
    with pytest.raises(enumsol.EnumsolError, match="fclib has no place for rigid_modes"):
        enumsol.write_problem(problem, tmp_path / "block.h5")


@pytest.mark.slow
def test_a_sweep_over_loads_factorizes_once():
    problem = block_on_table()
    for push in (0.25, 0.9):
        other = problem.replace(f=block_on_table(push=push).f)
        assert other.on_springs.factorization is problem.on_springs.factorization
        afresh = block_on_table(push=push, max_rigid_displacement=other.rigid_reach)
        (one,), (two,) = (enumsol.enumerate_roots(p, 0) for p in (other, afresh))
        assert np.allclose(one.u, two.u, atol=1e-12)
    bad_problem(r"rigid|positive definite", problem.replace, rigid_modes=None)
    moved = problem.replace(rigid_modes=2 * problem.rigid_modes)
    assert np.allclose(enumsol.enumerate_roots(moved, 0)[0].u, enumsol.enumerate_roots(problem, 0)[0].u, atol=1e-12)
    assert problem.replace(Bn=-problem.Bn).modes.r == 3


def test_the_default_bound():
    data = block_on_table()
    parts = data.A, data.Bn, data.Bt, data.f
    at = [(0, 0), (1, 0), (2, 0)]
    assert enumsol.ContactProblem(*parts, rigid_modes=data.rigid_modes, coordinates=at).rigid_reach == 20.0
    unloaded = enumsol.ContactProblem(*parts[:3], 0 * data.f, rigid_modes=data.rigid_modes)
    assert unloaded.rigid_reach == 1.0
    # a power of two
    assert np.frexp(data.rigid_reach)[0] == 0.5
    assert data.rigid_reach > 100


N = block_on_table().rigid_modes


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rigid_modes": N[:3]}, r"rigid_modes has shape \(3, 3\); expected \(n, r\) = \(12, r\), r >= 1"),
        ({"rigid_modes": N + np.eye(12)[:, :3]}, "column 0 is not a rigid mode"),
        ({"rigid_modes": N[:, [0, 1, 1]]}, "linearly dependent columns"),
        ({"rigid_modes": N * [1, 0, 1]}, "column 1 is zero"),
        ({"rigid_modes": N[:, :2]}, "A is singular or indefinite on more than the 2 rigid_modes"),
        ({"rigid_modes": N * np.nan}, "rigid_modes"),
        ({"max_rigid_displacement": 0.0}, "max_rigid_displacement is 0"),
        ({"max_rigid_displacement": np.inf}, "max_rigid_displacement is inf"),
        ({"rigid_modes": None, "max_rigid_displacement": 3.0}, "max_rigid_displacement is given without rigid_modes"),
    ],
)
def test_modes_that_cannot_be_used(change, words):
    bad_problem(words, anew, block_on_table(), **change)


@pytest.mark.parametrize(
    "call",
    [
        lambda problem: enumsol.lipschitz_estimate(problem, 0),
        lambda problem: problem.condensed,
        lambda problem: problem.enclosure,
        lambda problem: problem.factorization,
    ],
)
def test_what_cannot_take_such_a_body_says_so(call):
    refusal(NotHeldError, "cannot take a body that nothing holds", call, block_on_table())


def test_fast_arithmetic_is_refused():
    for call, place in ((enumsol.enumerate_roots, 0), (enumsol.branch_graph, (0, 1))):
        bad_argument('arithmetic is "fast" for a body that nothing holds', call, block_on_table(), place, "fast")


def test_a_table_of_roots_over_alpha():
    table = enumsol.multiplicity_table(block_on_table(push=0.5), [0, 1])
    assert table["roots"].tolist() == [1, 1]
    assert table["complete"].all()


def near(root, rows):
    """The solution next to a root, or None where there are two."""
    here = np.concatenate([root.lambda_n, root.lambda_t, root.u])
    close = [row for row in rows if np.max(np.abs(row - here)) < 1e-3 * (1 + np.max(np.abs(here)))]
    return close[0] if len(close) == 1 else None


def branches_of(seed):
    """How many regular roots of a random body were compared with the solutions on both sides of their alpha."""
    problem, step, compared = random_body(seed), Fraction(1, 2**24), 0
    problem = problem.replace(load_slope=np.random.default_rng(seed).integers(-1, 2, problem.n).astype(float))
    roots = enumsol.enumerate_roots(problem, 0.5)
    # all isolated solutions of the oracle, (forces, u), as floats
    sides = [np.hstack(Oracle(problem, Fraction(1, 2) + way * step).forces) for way in (1, -1)] if len(roots) else []
    for root in roots:
        test = root.local_branch_test()
        if root.regular:
            assert test.exists
            assert [sign for _, sign in test.signs] == [root.index]
            assert 1 <= root.condition < np.inf
        after, before = (near(root, rows) for rows in sides)
        if not root.regular or root.margin < 1e-5 or after is None or before is None:
            continue
        rate, p = (after - before) / float(2 * step), problem.p
        moved = np.concatenate([problem.Bn @ rate[2 * p :], problem.Bt @ rate[2 * p :]])
        assert np.allclose(root.dlambda_dalpha.T.ravel(), rate[: 2 * p], rtol=1e-6, atol=1e-6)
        assert np.allclose(root.du_dalpha.T.ravel(), moved, rtol=1e-6, atol=1e-6)
        compared += 1
    return compared


SLOW, LONG = pytest.param(range(14, 30), marks=pytest.mark.slow), pytest.param(range(30, 400), marks=pytest.mark.long)


@pytest.mark.parametrize("seeds", [range(8, 14), SLOW, LONG])
def test_derivatives_and_local_branches_of_regular_roots(seeds):
    assert sum(branches_of(seed) for seed in seeds) > len(seeds) // 10


def padded(problem, n=264):
    """The same body with further degrees of freedom that nothing moves, too many for rationals."""
    more = n - problem.n
    A, *rows = (sp.csc_array(M) for M in (problem.A, problem.Bn, problem.Bt))
    wide = [sp.hstack([M, sp.csc_array((problem.p, more))]) for M in rows]
    data = {name: getattr(problem, name) for name in ("gap", "friction", "slip_offset", "max_rigid_displacement")}
    modes, load = np.vstack([problem.rigid_modes, np.zeros((more, problem.modes.r))]), np.r_[problem.f, np.zeros(more)]
    return enumsol.ContactProblem(sp.block_diag([A, sp.eye_array(more)]), *wide, load, rigid_modes=modes, **data)


def large_body(seed):
    """What is found of a padded random body within a tight bound, after it was compared with all of the small one."""
    small = random_body(seed).replace(load_slope=None, max_rigid_displacement=(0.5, 1.0, 2.0, 4.0)[seed % 4])
    oracle, problem = Oracle(small, 0), padded(small)
    roots = enumsol.enumerate_roots(problem, 0)
    report = enumsol.verify(problem, roots.proof)
    assert report.ok, report
    assert (report.roots, report.complete) == (len(roots), roots.complete)
    assert len(roots) <= len(oracle.points)
    if roots.complete:
        assert (len(roots), len(roots.families)) == (len(oracle.points), oracle.families)
    return roots


@pytest.mark.few(5, 30)
@pytest.mark.parametrize("seed", range(300))
def test_large_bodies_within_tight_bounds(seed):
    large_body(seed)


def test_a_bound_that_is_reached_is_named():
    A = np.array([[16.5, 3.5, -12.5, -25.5], [3.5, 12.5, -19.5, -10.5], [-12.5, -19.5, 48.5, 41.5], [0, 0, 0, 56.5]])
    A[3, :3], e = A[:3, 3], np.eye(4)
    data = {"gap": -1.0, "slip_offset": 2.0, "friction": 1.0, "rigid_modes": np.array([[-1.0], [1], [1], [-1]])}
    rows = [e[1], -e[3]], [-e[0], e[2]]
    small = enumsol.ContactProblem(A, *rows, [-87, -69, 186, 198], max_rigid_displacement=2.0, **data)
    roots = enumsol.enumerate_roots(padded(small), 0)
    said = [(part.reason, part.hint) for part in roots.undecided]
    assert any("left of max_rigid_displacement along mode 0 is zero" in reason for reason, _ in said)
    assert "take another max_rigid_displacement" in {hint for _, hint in said}
    assert not roots.complete
