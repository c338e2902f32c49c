"""Random histories against exhaustive enumeration in rationals, step by step: all paths are equal."""

from fractions import Fraction

import numpy as np
import pytest
from generators import dense_compliance, random_problem
from history_oracle import exact_history

from enumsol import ContactProblem, histories


def integer_history(rng, p):
    """Small whole numbers: grazing contact, stick at the bound, and continua are frequent."""
    while True:
        X = rng.integers(-2, 3, size=(2 * p, 2 * p))
        A = X @ X.T + np.diag(rng.integers(0, 2, size=2 * p))
        if np.linalg.det(A) > 0.5:
            break
    rows, load, slope = np.eye(2 * p), rng.integers(-3, 4, size=2 * p), rng.integers(-2, 3, size=2 * p)
    F = (rng.integers(0, 4, size=p) / 2, rng.integers(0, 2, size=p) * float(rng.random() < 0.3))
    problem = ContactProblem(A, rows[:p], rows[p:], load, rng.integers(-1, 2, size=p), *F, slope)
    return problem, [float(alpha) for alpha in rng.integers(0, 5, size=4)]


def short(values, digits):
    return np.round(np.asarray(values) * digits) / digits


def pressed_history(rng, p):
    A = short(dense_compliance(rng, p), 256) + np.eye(2 * p) / 4
    load, rows = short(rng.normal(size=2 * p), 64), np.eye(2 * p)
    load[:p] += short(rng.uniform(0, 2), 64)
    F = short(np.exp(rng.uniform(np.log(0.1), np.log(8), size=p)), 64)
    problem = ContactProblem(A, rows[:p], rows[p:], load, 0.0, F, 0.0, short(rng.normal(size=2 * p), 64))
    return problem, short(1.5 * rng.normal(size=4), 64).tolist()


def branching_history(rng, p):
    """It begins where, if possible, a root of index -1 was planted: several roots, each with its own future."""
    planted = random_problem(rng, p, planted=1.0)
    A = planted.A.toarray()
    D = np.exp2(-np.round(0.5 * np.log2(np.diag(A))))
    A = short(A * D[:, None] * D, 4096)
    if np.linalg.eigvalsh(A)[0] < 1e-2:
        return pressed_history(rng, p)
    rows = np.eye(2 * p) / D[:, None]
    load = planted.f * D / np.max(np.abs(planted.f * D))
    F = short(planted.friction, 64)
    rows /= np.max(rows)
    problem = ContactProblem(
        A, rows[:p], rows[p:], short(load, 1024), 0.0, F, 0.0, short(rng.normal(size=2 * p) / 4, 1024)
    )
    return problem, [0.0, *short(rng.normal(size=3), 16).tolist()]


def case(seed, most=2):
    rng = np.random.default_rng(seed)
    p = int(rng.integers(1, most + 1))
    return (branching_history, integer_history, branching_history, pressed_history)[seed % 4](rng, p)


def inside(values, low, high):
    pairs = zip(low.tolist(), values, high.tolist(), strict=True)
    return all(Fraction(a) <= value <= Fraction(b) for a, value, b in pairs)


def paths(steps):
    """How many histories lead to every root of the last step."""
    ends, before = {None: 1}, {}
    for number, (nodes, _) in enumerate(steps):
        before = {node: ends[None if number == 0 else node.start] for node in nodes}
        ends = {}
        for node, count in before.items():
            ends[node.end] = ends.get(node.end, 0) + count
    return before


def compare(problem, alphas, arithmetic):
    """Whether the history is complete, after all its roots were compared."""
    expected = exact_history(problem, alphas)
    history = histories(problem, alphas, arithmetic=arithmetic)
    continuum = any(found for _, found in expected)
    for step, (nodes, _) in enumerate(expected, 1):
        found = [(stage, root) for stage in history.stages(step) for root in stage.roots]
        left = set(nodes)
        for stage, root in found:
            bounds = [root.enclosure.lambda_n, root.enclosure.lambda_t]
            forces = [np.concatenate([b[:, k] for b in bounds]) for k in (0, 1)]
            ball = stage.start.ball
            starts = (ball.mid - 1.0000001 * ball.rad, ball.mid + 1.0000001 * ball.rad)

            def fits(node, stage=stage, starts=starts, forces=forces):
                own = stage.start.rationals == node.start if arithmetic == "exact" else inside(node.start, *starts)
                return own and inside(node.forces, *forces)

            same = [node for node in nodes if fits(node)]
            assert same, (step, root)
            left -= set(same)
        if history.complete:
            # one root for one from every start, and none is missing
            assert not left
            assert history.counts[step - 1] == sum(paths(expected[:step]).values())
            # equal ends that balls do not show to be equal start their own searches
            assert len(found) == len(nodes) or (arithmetic != "exact" and len(found) > len(nodes))
    if arithmetic == "exact":
        assert history.complete == (not continuum), history.reasons
    else:
        assert not (history.complete and continuum)
        assert history.complete or history.reasons
    return history


@pytest.mark.few(4, 3)
@pytest.mark.parametrize("seed", range(60))
def test_all_paths_of_small_problems(seed):
    problem, alphas = case(seed)
    compare(problem, alphas, "exact")
    compare(problem, alphas, "verified")


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("seed", [*range(1000, 1011), 11568])
def test_all_paths_with_up_to_three_nodes(seed):
    problem, alphas = case(seed, most=3)
    compare(problem, alphas, "exact")
    compare(problem, alphas, "verified")


@pytest.mark.slow
def test_the_cases_branch_and_are_degenerate():
    found = [histories(*case(seed), arithmetic="exact") for seed in range(0, 60, 4)]
    assert sum(len(history.branchings) > 0 for history in found) > 4
    whole = [histories(*case(seed), arithmetic="exact") for seed in range(1, 60, 4)]
    assert sum(not root.regular for history in whole for step in (1, 2, 3, 4) for root in history.roots(step)) > 3
