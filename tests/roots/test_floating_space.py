"""Bodies in 3D that nothing holds: known solutions, the same problems in the plane, weak springs, blocks."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest
from complete import accepted_report
from helpers.floating_space import known_body, on_weak_springs
from problems3d import within
from refusals import bad_argument, bad_problem, refusal

import enumsol
from enumsol.gallery import block_on_table3d


def checked(problem, **options):
    """All roots, whose proof the checker accepts."""
    roots = enumsol.enumerate_roots(problem, 0, **options)
    report = accepted_report(problem, roots.proof)
    assert (report.roots, report.complete) == (len(roots), roots.complete)
    # a checker may see that the bound is not needed where a search, which allows for its errors, does not
    assert report.within is None or roots.rigid_bound.needed
    return roots


def nearest(roots, u):
    return min(roots, key=lambda root: np.max(np.abs(root.u - u)))


def disagreement(seed):
    """What is wrong with the roots of a known body, or None."""
    known = known_body(seed)
    problem = known.problem
    roots = checked(problem)
    if not roots.complete:
        return f"not complete: {roots.closing_line}"
    root = nearest(roots, known.u)
    if np.max(np.abs(root.u - known.u)) > 1e-9 or np.max(np.abs(root.lambda_t - known.lambda_t)) > 1e-9:
        return "the known solution is missing"
    weak = enumsol.enumerate_roots(on_weak_springs(problem, 1e-6), 0)
    held = problem.modes.held
    # springs at all degrees of freedom displace what they hold
    inside = [one for one in weak if np.max(np.abs(one.u[held])) < problem.rigid_reach]
    found = [one for one in roots if np.max(np.abs(one.u[held])) < 0.99 * problem.rigid_reach]
    if weak.complete and not len(found) <= len(inside) <= len(roots):
        return f"{len(roots)} roots, and {len(inside)} with weak springs"
    if weak.complete and any(np.max(np.abs(nearest(inside, one.u).u - one.u)) > 1e-2 for one in found):
        return "a root is not that of weak springs"
    if weak.complete and sorted(nearest(inside, one.u).index for one in found) != sorted(one.index for one in found):
        return "another index"
    return None


def test_a_body_with_two_solutions():
    assert disagreement(113) is None


@pytest.mark.long
def test_more_random_bodies():
    # with 203 the balance alone fixes the force of a slipping node: the body slides as far as one likes
    assert not enumsol.enumerate_roots(known_body(203).problem, 0).complete
    assert not {seed: said for seed in range(204, 218) if (said := disagreement(seed)) is not None}


@pytest.mark.parametrize("seed", [1, 8])
def test_friction_along_one_axis_is_that_of_the_plane(seed):
    problem = known_body(seed, plane=True).problem
    (F, _), offset = problem.friction, problem.slip_offset[:, 0]
    matrices = problem.A, problem.Bn, problem.Bt1, problem.f
    given = {"gap": problem.gap, "friction": F, "slip_offset": offset}
    modes = {"rigid_modes": problem.rigid_modes, "max_rigid_displacement": problem.max_rigid_displacement}
    plane = enumsol.enumerate_roots(enumsol.ContactProblem(*matrices, **given, **modes), 0)
    space = checked(problem)
    assert (plane.complete, space.complete, len(plane)) == (True, True, len(space))
    assert sorted(root.index for root in plane) == sorted(root.index for root in space)
    for root in space:
        assert np.allclose(nearest(plane, root.u).u, root.u, atol=1e-9)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("push", "count"), [(0.5, 1), (1.1, 0)])
def test_a_block_below_and_above_sliding(push, count):
    problem = block_on_table3d(1, push=(0.8 * push, 0.6 * push))
    roots = checked(problem)
    assert (roots.complete, len(roots)) == (True, count)
    for root in roots:
        carried = problem.contact_rows.T @ np.r_[root.lambda_n, root.lambda_t.ravel(order="F")]
        assert np.allclose(problem.rigid_modes.T @ (problem.f - carried), 0, atol=1e-12)
        assert np.max(np.abs(problem.A @ root.u + carried - problem.f)) < 1e-12
        held = problem.modes.held
        assert np.allclose(root.u[held], root.rigid_displacement[held], atol=1e-12)
        assert np.allclose(problem.Bn @ root.u, root.u_n, atol=1e-12)
        assert within(root.u_t, root.enclosure.u_t)


@pytest.mark.slow
def test_as_springs_become_weaker_the_solution_tends_to_that_without_any():
    problem = block_on_table3d(1, push=(0.5, 0.0))
    (free,) = enumsol.enumerate_roots(problem, 0)
    stiff = np.max(np.abs(problem.A.data))
    far = []
    for share in (1e-3, 1e-5, 1e-7):
        (root,) = enumsol.enumerate_roots(on_weak_springs(problem, share * stiff), 0)
        far.append(max(np.max(np.abs(root.u - free.u)), np.max(np.abs(root.lambda_n - free.lambda_n))))
    # the search for springs as weak as 1e-9 takes too long
    weakest = enumsol.successive_approximations(on_weak_springs(problem, 1e-9 * stiff), 0)
    assert np.max(np.abs(weakest.lambda_n - free.lambda_n)) < 1e-5
    assert far[0] < 0.1
    assert all(weaker < 0.02 * stiffer for stiffer, weaker in pairwise(far))


@pytest.mark.long
def test_a_block_of_which_all_nodes_but_one_slip():
    """Its equations leave a turn about that node free, whatever the directions are."""
    problem = block_on_table3d(2, push=(0.9, 0.225))
    (root,) = checked(problem)
    assert sorted(status.value for status in root.statuses) == ["slip"] * 5 + ["stick"]
    (held,) = enumsol.enumerate_roots(on_weak_springs(problem, 1e-6), 0)
    assert np.allclose(held.lambda_n, root.lambda_n, atol=1e-4)
    assert (held.index, root.index) == (1, 1)


def test_a_body_that_is_free_to_slide_names_the_mode():
    roots = checked(block_on_table3d(1, push=(0.0, 0.0), friction=0.0))
    assert not roots.complete
    assert any("free to move as a whole" in part.reason and "rigid mode" in part.reason for part in roots.undecided)
    hints = {part.hint for part in roots.undecided if "free to move as a whole" in part.reason}
    assert hints == {"hold the body by a spring or a fixed point, or give a smaller max_rigid_displacement"}


def test_what_the_text_says():
    within, at_all = (checked(known_body(seed).problem) for seed in (113, 105))
    assert "complete: yes (proven, within rigid displacements of 30)" in repr(within)
    assert "complete: yes (proven, no bound of rigid displacements was needed)" in repr(at_all)
    assert "rigid modes         6, of displacements up to 4" in repr(block_on_table3d(1, max_rigid_displacement=4.0))


@pytest.mark.slow
def test_executors_and_resumed_searches_find_the_same(tmp_path):
    problem = known_body(113).problem
    alone = enumsol.enumerate_roots(problem, 0)
    with ThreadPoolExecutor(2) as executor:
        spread = checked(problem, executor=executor)
    file = tmp_path / "proof.txt"
    enumsol.enumerate_roots(problem, 0, proof_path=file, max_nodes=12)
    again = checked(problem, proof_path=file, resume=True)
    for roots in (spread, again):
        assert [root.lambda_n.tolist() for root in roots] == [root.lambda_n.tolist() for root in alone]
        assert roots.rigid_bound == alone.rigid_bound
    assert again.stats.resumed > 0


def test_files_copies_and_other_loads(tmp_path):
    problem = known_body(1).problem
    enumsol.write_problem(problem, tmp_path / "body.npz")
    for copy in (enumsol.read_problem(tmp_path / "body.npz"), pickle.loads(pickle.dumps(problem))):
        assert (copy.fingerprint, copy.rigid_reach) == (problem.fingerprint, problem.rigid_reach)
    other = problem.replace(gap=problem.gap + 1e-3)
    assert other.on_springs.factorization is problem.on_springs.factorization
    assert other.fingerprint != problem.fingerprint


def test_what_is_refused():
    problem = block_on_table3d(1)
    bad_argument('arithmetic is "fast" for a body that nothing holds', enumsol.enumerate_roots, problem, 0, "fast")
    message = "lipschitz_estimate cannot take a body that nothing holds .* whose slips no energy"
    refusal(enumsol.NotHeldError, message, enumsol.lipschitz_estimate, problem, 0)
    for message, modes in (
        ("rigid_modes: column 0 is not a rigid mode", np.eye(problem.n)),
        ("singular or indefinite on more than the 2 rigid_modes", problem.rigid_modes),
    ):
        bad_problem(message, problem.replace, rigid_modes=modes[:, :2])


@pytest.mark.slow
def test_a_table_of_roots_over_a_push_that_grows():
    still, pushed = (block_on_table3d(1, push=(push, 0.0)) for push in (0.0, 1.0))
    table = enumsol.multiplicity_table(still.replace(load_slope=pushed.f - still.f), [0.25, 0.75, 1.25])
    assert table["roots"].tolist() == [1, 1, 0]
    assert table["complete"].all()


def small_body(seed):
    """One or two bodies of two points each, which move in a plane in which nothing holds them, in whole numbers."""
    rng = np.random.default_rng(seed)
    blocks, p = int(rng.integers(1, 3)), int(rng.integers(1, 3))
    still = 4 * blocks
    n = still + p
    A, N, e = np.eye(n), np.zeros((n, 2 * blocks)), np.eye(n)
    for k in range(0, still, 4):
        B = rng.integers(-1, 2, (2, 2))
        B = B @ B.T + np.eye(2)
        A[k : k + 4, k : k + 4] = np.block([[B, -B], [-B, B]])
        N[[k, k + 2], k // 2] = N[[k + 1, k + 3], k // 2 + 1] = 1
    rows, at = np.zeros((2, p, n)), 2 * rng.permutation(2 * blocks)[:p]
    for i, a in enumerate(at):
        sign, facing = rng.choice([-1, 1]), (a + 4) % still
        rows[:, i] = sign * e[a + 1], e[a]
        if blocks > 1 and facing not in at and rng.random() < 0.7:
            rows[:, i] -= sign * e[facing + 1], e[facing]
    f = np.zeros(n)
    if rng.random() < 0.6:
        f[:still] = rng.integers(-2, 3, still)
    if rng.random() < 0.5:
        # in balance with forces at the contact
        f = rng.integers(0, 3, p) @ rows[0] + rng.integers(-1, 2, p) @ rows[1]
    data = {"gap": rng.choice([0, 0, 0.5, -0.5], p), "friction": (float(rng.choice([0.5, 1])), rng.choice([0, 0, 0.5]))}
    data |= {"rigid_modes": N, "max_rigid_displacement": float(rng.choice([0.5, 1, 2]))}
    return enumsol.ContactProblem3D(A, *rows, e[still:], f, **data)


def in_the_plane(problem):
    """The same in 2D, where there is no friction along the second tangent."""
    data = {name: getattr(problem, name) for name in ("gap", "rigid_modes", "max_rigid_displacement")}
    matrices = problem.A, problem.Bn, problem.Bt1, problem.f
    return enumsol.ContactProblem(*matrices, friction=float(problem.friction[0][0]), **data)


def settled(seed):
    """Whether the roots of a small body are all known; those of one with friction along one tangent are compared."""
    problem = small_body(seed)
    roots = checked(problem, max_nodes=60)
    if not problem.friction[1].any():
        exact = enumsol.enumerate_roots(in_the_plane(problem), 0, arithmetic="exact")
        assert exact.complete
        assert len(roots) <= len(exact)
        assert not roots.complete or (len(exact), len(exact.families)) == (len(roots), 0)
    return roots.complete


@pytest.mark.few(4, 20)
@pytest.mark.parametrize("seed", range(200))
def test_small_bodies_within_tight_bounds(seed):
    settled(seed)


def test_two_free_bodies_with_friction_along_one_tangent_are_left_open():
    a = np.array([[2, 1, -2, -1], [1, 3, -1, -3], [-2, -1, 2, 1], [-1, -3, 1, 3]])
    A, e, N = np.eye(10), np.eye(10), np.zeros((10, 4))
    A[:4, :4] = A[4:8, 4:8] = a
    N[[0, 2], 0] = N[[1, 3], 1] = N[[4, 6], 2] = N[[5, 7], 3] = 1
    rows = [-e[1], e[4] - e[2]], [e[0], e[5] - e[3]], e[8:]
    data = {"gap": [0.5, -0.5], "friction": (1.0, 0.0), "rigid_modes": N, "max_rigid_displacement": 1.0}
    problem = enumsol.ContactProblem3D(A, *rows, np.zeros(10), **data)
    roots = checked(problem)
    assert not roots.complete
    assert any("leave the body free to move as a whole" in part.reason for part in roots.undecided)
