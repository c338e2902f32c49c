"""Relaxations at single alphas and the parts of a piece that their multipliers exclude, by the trusted bound."""

from fractions import Fraction

import numpy as np
import pytest
from problems3d import forces, random_over_alpha

from enumsol import enumerate_roots
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.model.sectors import SECTORS
from enumsol.relaxation.engine import PRUNE_MARGIN
from enumsol.search.space.piece_proposals import AlphaPoint, PieceBounds
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.sector_rows import CONTACT, OPEN, STICK


def space_of(problem):
    system = SpaceSolvers(problem, Fraction(1, 2), "verified").system
    return AlphaSpace(problem.enclosure, Fraction(1, 2), (system.force, system.length))


def exclusions(problem, alpha, rng, count):
    """Some assignments that the relaxation at an alpha excludes, with that point and its multipliers."""
    point, statuses = AlphaPoint(space_of(problem), alpha), [OPEN, STICK, CONTACT]
    for _ in range(count):
        codes = tuple(int(rng.choice([*statuses, SECTORS + int(rng.integers(4, 64))])) for _ in range(problem.p))
        relaxation = point.root(codes)
        if relaxation.pruned and relaxation.bound > PRUNE_MARGIN:
            yield codes, point, relaxation.bound, point.multipliers(relaxation)


@pytest.mark.parametrize("seed", range(4))
def test_multipliers_of_one_alpha_prove_its_bound_in_the_variables_of_the_interval(seed):
    problem, rng, seen = random_over_alpha(2, seed), np.random.default_rng(seed), 0
    for alpha in (Fraction(1, 8), Fraction(7, 8)):
        for codes, _, bound, (rows, values) in exclusions(problem, alpha, rng, 20):
            seen += 1
            piece = AlphaPiece(space_of(problem), alpha, alpha)
            proven = piece.margin(codes, rows, (values, values))
            assert proven > 0
            assert np.isclose(proven, bound, rtol=1e-6, atol=1e-12)
    assert seen > 5


@pytest.mark.parametrize("seed", range(4))
def test_bounds_of_a_piece_are_the_proven_ones(seed):
    """And multipliers that are found for a piece prove its exclusion, where those of one alpha mostly do not."""
    problem, rng, served, proven = random_over_alpha(2, seed), np.random.default_rng(seed), 0, 0
    low, high, alpha = Fraction(1, 8), Fraction(1), Fraction(3, 8)
    for codes, point, _, (rows, values) in exclusions(problem, alpha, rng, 60):
        piece = AlphaPiece(space_of(problem), low, high)
        served += piece.margin(codes, rows, (values, values)) > 0
        bounds = PieceBounds(piece, codes, rows := list(dict.fromkeys([*rows, *point.imposed(codes)])))
        m = bounds.positive()
        if m is not None:
            bound, least = piece.margin(codes, rows, tuple(np.split(m, 2))), min(bounds.of(m))
            proven += bound > 0
            assert bound <= (1 + 1e-6) * least + 1e-12
            # where rows contradict each other multipliers are large, and rounding takes some of the bound
            assert bound >= (1 - 1e-6) * least - 1e-9 or np.max(np.abs(m)) > 1e3
    assert proven > served


def test_newtons_method_at_an_alpha_gives_forces_in_the_units_of_the_problem():
    for seed in range(3):
        problem = random_over_alpha(2, seed)
        found = AlphaPoint(space_of(problem), Fraction(1, 4)).solution()
        roots = enumerate_roots(problem, 0.25)
        assert found is not None
        assert min(np.max(np.abs(found - forces(root))) for root in roots) < 1e-8 * (1 + np.max(np.abs(found)))
