"""Random histories of bodies that nothing holds, step by step in rationals, and whether a verified history agrees."""

from fractions import Fraction

import numpy as np
from complete import accepted_report
from floating_oracle import Oracle, block_on_table, random_body, rational

import enumsol


def random_steps(problem, rng, count):
    """Loads that some contact forces balance, at the limit of friction or below, with a random elastic deformation.

    Now and then one is held, is no such load, or comes with another coefficient of friction.
    """
    steps, p = [], problem.p
    for _ in range(count):
        friction = float(rng.choice([0.25, 0.5, 1.0])) if rng.random() < 0.2 else None
        F = problem.friction_at(0) if friction is None else friction
        pressed = rng.integers(0, 9, p) / 2
        share = rng.choice([-1, -0.75, -0.5, 0, 0.25, 0.75, 1], p)
        load = problem.Bn.T @ pressed + problem.Bt.T @ (F * pressed * share)
        load += problem.A @ (rng.integers(-4, 5, problem.n) / 8)
        chance = rng.random()
        if steps and chance < 0.1:
            load = steps[-1].load
        elif chance < 0.15:
            load = problem.f
        steps.append(enumsol.LoadStep(0, load=load, friction=friction))
    return steps


def case(seed, count=3):
    """A random truss, or for every second seed a block on a table that is pressed and pushed, and steps."""
    rng = np.random.default_rng([seed, 1])
    if seed % 2 == 0:
        problem = random_body(seed)
        return problem, random_steps(problem, rng, count)
    problem, steps = block_on_table(int(rng.integers(1, 3)), friction=float(rng.choice([0.25, 0.5]))), []
    low, upper = (np.any(part.toarray(), axis=0) for part in (problem.Bt, problem.Bn))
    upper = np.roll(upper, problem.n // 2)
    for _ in range(count):
        load = np.zeros(problem.n)
        load[upper] = -rng.integers(1, 9, upper.sum()) / 8
        most = -problem.friction[0] * load.sum()
        load[low] = most * rng.integers(-8, 9) / 8 * rng.multinomial(8, np.ones(low.sum()) / low.sum()) / 8
        if steps and rng.random() < 0.1:
            load = steps[-1].load
        steps.append(enumsol.LoadStep(0, load=load))
    return problem, steps


def oracles(problem, steps):
    """Per step an Oracle for each start, which carries positions in rationals; (forces, q, end) of its points."""
    Bt = [[rational(x) for x in row] for row in problem.Bt.toarray().tolist()]
    starts, found = {tuple(Fraction(x) for x in problem.slip_offset.tolist())}, []
    for step in steps:
        friction = {} if step.friction is None else {"friction": step.friction, "friction_slope": 0.0}
        body = problem.replace(f=step.load, load_slope=None, **friction)
        here = {start: Oracle(body, 0, [rational(x) for x in start]) for start in starts}
        found.append(here)
        starts = {end(Bt, point) for oracle in here.values() for point in oracle.points}
    return found, Bt


def end(Bt, point):
    """Where a point leaves the contact nodes."""
    moved = (sum((a * x for a, x in zip(row, point, strict=False)), rational(0)) for row in Bt)
    return tuple(Fraction(int(x.p), int(x.q)) for x in moved)


def inside(values, low, high):
    pairs = zip(np.ravel(low).tolist(), values, np.ravel(high).tolist(), strict=True)
    return all(Fraction(a) <= value <= Fraction(b) for a, value, b in pairs)


def holds(root, oracle, point):
    """Whether the enclosure of a root holds a point of an oracle: forces and rigid displacement."""
    n, p, modes = oracle.n, oracle.p, oracle.problem.modes
    numbers = [Fraction(int(x.p), int(x.q)) for x in point]
    bounds = root.enclosure
    forces = np.concatenate([bounds.lambda_n, bounds.lambda_t])
    if not inside(numbers[n:], forces[:, 0], forces[:, 1]):
        return False
    # N_J q = u_J
    low, high = bounds.rigid_coordinates.T
    N = [[Fraction(x) for x in row] for row in modes.N[modes.held].tolist()]
    for row, j in zip(N, modes.held.tolist(), strict=True):
        ends = [sorted((a * Fraction(x), a * Fraction(y))) for a, x, y in zip(row, low, high, strict=True)]
        if not sum(a for a, _ in ends) <= numbers[j] <= sum(b for _, b in ends):
            return False
    return len(numbers) == n + 2 * p


def agreed(problem, steps, **options):
    """The verified history, after every search was compared with rationals and its proof was accepted."""
    expected, _ = oracles(problem, steps)
    history = enumsol.histories(problem, steps, **options)
    for number, here in enumerate(expected, 1):
        seen = set()
        for stage in history.stages(number):
            ball = stage.start.ball
            within = [s for s in here if inside(s, ball.mid - 1.0000001 * ball.rad, ball.mid + 1.0000001 * ball.rad)]
            assert within, (number, stage.start)
            seen.update(within)
            for start in within:
                oracle = here[start]
                for root in stage.roots:
                    assert sum(holds(root, oracle, point) for point in oracle.points) == 1, (number, root)
                if not stage.reasons:
                    assert not oracle.families
                    assert len(stage.roots) == len(oracle.points), number
        if history.complete:
            assert seen == set(here), number
    report = accepted_report(problem, history.proof)
    assert (report.complete, report.unique_until) == (history.complete, history.unique_until), history
    assert (report.within is not None) <= ("within rigid displacements" in history.closing_line), history
    assert history.complete or history.reasons
    return history
