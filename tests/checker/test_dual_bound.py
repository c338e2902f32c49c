"""The dual bound in rationals exists twice, in the search and in the checker: they agree on all multipliers."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from generators import integer_problem

from enumsol.checker.rational import RationalSystem
from enumsol.condensation.exact import ExactCondensed, ExactSystem
from enumsol.relaxation.active_set import IntervalSystem
from enumsol.relaxation.engine import INEQUALITY, imposed_rows, status_rows
from enumsol.relaxation.interior_point import InteriorPointEngine
from enumsol.search.certifiers.interval_certifiers import ExactIntervalCertifier
from enumsol.search.certifiers.rational_certifier import ExactCertifier
from enumsol.selections.rational_selections import ExactSelections
from enumsol.trusted.status_rows import row_signs

ALPHA = Fraction(3, 2)


def random_multipliers(rng, scaled):
    """A partial assignment, and multipliers that prove it empty or that are spoilt."""
    F, p = scaled.F, scaled.p
    codes = tuple(int(rng.choice((0, 1, 2, 3, 5, 6) if f > 0 else (0, 4, 6))) for f in F)
    pairs = [(int(k) * p + i, mode) for i in range(p) for k, mode in status_rows(codes[i], friction=F[i] > 0)]
    relaxation = InteriorPointEngine(scaled).root(*map(list, zip(*pairs, strict=True)))
    rows, values = relaxation.multipliers()
    spoilt = rng.choice((1.0, 1.0, 0.25, 4.0, -1.0)) * np.where(rng.random(len(rows)) < 0.1, 0.5, 1.0)
    modes = [imposed_rows(codes[row % p], friction=F[row % p] > 0)[row // p] for row in rows.tolist()]
    values = np.where(np.array(modes, dtype=int) == INEQUALITY, np.abs(values * spoilt), values * spoilt)
    return codes, rows, values


@pytest.mark.parametrize("seed", range(6))
def test_search_and_checker_agree(seed):
    rng = np.random.default_rng(seed)
    seen = []
    while len(seen) < 60:
        problem = integer_problem(rng, int(rng.integers(1, 4)))
        system = problem.condensed.at(ALPHA)
        if not np.any(system.g):
            continue
        scaled, checker = system.scaled, RationalSystem(problem, ALPHA)
        certifier = ExactCertifier(ExactSelections(ExactSystem.from_problem(problem, ALPHA)), scaled)
        p = problem.p
        units = [Fraction(scaled.length[r % p] if r // p < 4 else scaled.force[r % p]) for r in range(7 * p)]
        for _ in range(10):
            codes, rows, values = random_multipliers(rng, scaled)
            signs = row_signs(np.array(codes), system.F)
            told = checker.energy_bound_positive(signs, rows.tolist(), values.tolist(), units)
            assert certifier.excluded(codes, SimpleNamespace(multipliers=lambda r=rows, v=values: (r, v))) == told
            seen.append(told)
    assert {True, False} == set(seen)


@pytest.mark.parametrize("seed", range(4))
def test_a_piece_with_constant_data_is_judged_as_one_alpha(seed):
    rng = np.random.default_rng(100 + seed)
    seen = set()
    while len(seen) < 2:
        problem = integer_problem(rng, 2)
        path = ExactCondensed.from_problem(problem)
        if not any(path.g0):
            continue
        piece = SimpleNamespace(a=Fraction(1), b=Fraction(2))
        system = IntervalSystem.from_problem(problem.condensed, piece.a, piece.b, None)
        point = ExactCertifier(ExactSelections(ExactSystem.from_problem(problem, ALPHA)), system.scaled)
        for _ in range(10):
            codes, rows, values = random_multipliers(rng, system.scaled)
            leaf = SimpleNamespace(codes=codes, rows=rows, values=values)
            told = point.excluded(codes, SimpleNamespace(multipliers=lambda r=rows, v=values: (r, v)))
            assert ExactIntervalCertifier(path).excluded(piece, system, leaf) == told
            seen.add(told)
