"""No other solution lies where a root of a body in 3D that nothing holds is said to be the only one.

The other solutions are found by Newton's method from many starts, which shares no code with the package.
"""

from collections import Counter

import numpy as np
import pytest
from effort import some
from floating_space import body_with_reference, newton_solutions

from enumsol.model.sectors import SECTORS, direction, end_number
from enumsol.model.statuses import CONTACT, OPEN, STICK, UNDECIDED
from enumsol.search.space.space_references import proposed
from enumsol.trusted.space.sector_rows import GAP, LEFT, RIGHT


def assignments(rng, solution, count):
    """Partial assignments that a solution belongs to, at random, and the one of the whole problem."""
    _, force, _, w = solution
    yield (UNDECIDED,) * len(force)
    for _ in range(count):
        codes = []
        for normal, (_, *v) in zip(force, w, strict=True):
            if normal < 1e-9:
                codes.append(int(rng.choice([OPEN, UNDECIDED])))
                continue
            slides = np.linalg.norm(v) > 1e-9
            narrow = STICK if not slides else next(c for c in range(SECTORS + 4, SECTORS + 8) if is_in(c - SECTORS, v))
            codes.append(int(rng.choice([UNDECIDED, CONTACT, narrow, narrow])))
        yield tuple(codes)


def is_in(sector, v):
    """Whether a direction lies in a sector, well within."""
    (a, b), (c, d) = direction(sector), direction(end_number(sector))
    return a * v[1] - b * v[0] > 1e-9 and v[0] * d - v[1] * c > 1e-9


def told(seed):
    """What was tried of one body, and that nothing was said that is wrong."""
    problem, system, reference = body_with_reference(seed)
    if reference is None:
        return Counter(without=1)
    root = reference.root.y.mid[: problem.p] * system.force
    solutions = newton_solutions(problem, 15, seed)
    others = [s for s in solutions if np.max(np.abs(s[1] - root)) > 1e-6 * (1 + np.max(root))]
    rng, counts = np.random.default_rng(seed), Counter(bodies=1, several=bool(others))
    for solution in others:
        for codes in assignments(rng, solution, 12):
            counts["refused"] += 1
            assert not said(reference, codes, rng), (seed, codes)
    for solution in solutions:
        for codes in assignments(rng, solution, 4):
            proven = said(reference, codes, rng)
            counts["alone"] += bool(proven)
            counts["by products"] += bool(proven) and "rows" not in proven
    return counts


def said(reference, codes, rng):
    """By which of several attempts the root is said to be the only one below an assignment."""
    found = proposed(reference, codes)
    rows, products = found.rows, found.products
    tight = [(GAP, i, 0) for i in range(len(codes))]
    tight += [(kind, i, code - SECTORS) for i, code in enumerate(codes) if code > SECTORS for kind in (LEFT, RIGHT)]
    tight = [row for row in tight if reference.is_tight(codes, row)]
    pairs = [(one, other) for k, one in enumerate(tight) for other in tight[:k]]
    drawn = [(*pair, float(10.0 ** rng.uniform(-3, 2))) for pair in pairs if rng.random() < 0.5]
    ways = {"rows": (rows, []), "products": (rows, products), "drawn": (rows, drawn), "fewer": (rows[:2], drawn)}
    return [name for name, way in ways.items() if reference.is_only_root(codes, *way, reference.system.reach)]


@pytest.mark.slow
def test_no_other_solution_where_a_root_is_said_to_be_alone():
    counts = sum((told(seed) for seed in range(some(25, of=1000))), Counter())
    assert counts["bodies"] > some(15, of=700)
    assert counts["several"] > some(1, of=50)
    assert counts["refused"] > some(10, of=800)
    assert counts["alone"] > some(20, of=800)
    assert counts["by products"] >= some(0, of=5)
