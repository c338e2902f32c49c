"""What is concluded of leaves in 3D over pieces of alpha: where their roots are, and whether these are one arc."""

import functools
from fractions import Fraction

import numpy as np
import pytest
from problems3d import random_over_alpha

import enumsol
from enumsol.branches.space.chains import chain_through
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.model.sectors import DEEPEST, SECTORS, places
from enumsol.search.space.curve_proposals import placed
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space.leaves import SpaceRoot
from enumsol.trusted.space.pieces import AlphaPiece
from enumsol.trusted.space.solution_curve import AlphaProblem

CODES = {"open": 0, "stick": 1}
#: Random problems over [0, 1], with folds and changes of statuses.
NEAR = [(1, 3), (1, 7), (2, 1), (2, 3), (2, 6)]


def piece_of(problem, low, high):
    system = SpaceSolvers(problem, (low + high) / 2, "verified").system
    return AlphaPiece(AlphaSpace(problem.enclosure, (low + high) / 2, (system.force, system.length)), low, high)


def place_of(root, problem, i):
    """How far the direction of a force of friction is along the circle."""
    return float(places(root.lambda_t[i] / problem.friction_at(root.alpha)[i]))


def leaf_of(root, problem, level, rng):
    """Codes of a leaf at or beside a root, with sectors of a level."""
    codes = []
    for i, status in enumerate(root.statuses):
        up = DEEPEST + 2 - level
        number = (int(place_of(root, problem, i)) >> up) + int(rng.integers(-1, 2) * (rng.random() < 0.3))
        codes.append(CODES.get(status.value, SECTORS + (1 << level) + number % (1 << level)))
    return tuple(codes)


def has(codes, root, problem):
    """Whether a root has the statuses and directions of a leaf."""
    for i, (code, status) in enumerate(zip(codes, root.statuses, strict=True)):
        if code < SECTORS:
            if CODES.get(status.value) != code:
                return False
            continue
        level = (code - SECTORS).bit_length() - 1
        if status.value in CODES or int(place_of(root, problem, i)) >> (DEEPEST + 2 - level) != code - SECTORS - (
            1 << level
        ):
            return False
    return True


@functools.cache
def vertices_of(p, seed):
    """A problem, and the alphas of the vertices of its graph inside the interval."""
    problem = random_over_alpha(p, seed)
    graph = enumsol.branch_graph(problem, (0, 1), max_nodes=400)
    return problem, [v.alpha for v in graph.vertices if 0.01 < float(v.alpha) < 0.99]


def cases(p, seed, count):
    """Pieces near to vertices of a graph, and leaves with roots there or beside them."""
    rng = np.random.default_rng([p, seed])
    problem, inner = vertices_of(p, seed)
    for _ in range(count):
        about = (
            Fraction(float(rng.choice(inner)))
            if inner and rng.random() < 0.8
            else Fraction(int(rng.integers(1, 64)), 64)
        )
        length = Fraction(1, 2 ** int(rng.integers(3, 9)))
        low = max(Fraction(0), about - length * int(rng.integers(0, 8)) / 8)
        high = min(Fraction(1), low + length)
        at = low + (high - low) * int(rng.integers(0, 17)) / 16
        roots = list(enumsol.enumerate_roots(problem, at))
        if roots:
            root = roots[int(rng.integers(len(roots)))]
            yield problem, piece_of(problem, low, high), leaf_of(root, problem, int(rng.integers(3, 12)), rng)


@pytest.mark.few(3, 0)
@pytest.mark.parametrize(("p", "seed"), NEAR)
def test_a_piece_is_narrowed_to_all_alpha_of_a_leafs_roots(p, seed):
    """Roots at single alphas of the piece are in the part that is left."""
    narrower = 0
    for problem, piece, codes in cases(p, seed, 8):
        narrowed, found = piece.narrowed(codes)
        narrower += found is None or narrowed.high - narrowed.low < piece.high - piece.low
        for k in range(9):
            alpha = piece.low + (piece.high - piece.low) * k / 8
            if any(has(codes, root, problem) for root in enumsol.enumerate_roots(problem, alpha)):
                assert found is not None
                assert narrowed.low <= alpha <= narrowed.high
    assert narrower


def is_on(chain, given, root):
    """Whether a root lies in a box of a curve, or as near to it as solutions of the box are."""
    x = placed(given, np.concatenate([root.lambda_n, *root.lambda_t.T, [float(root.alpha)]]))
    for curve in (link.curve for link in chain.links):
        t = float(curve.box.border @ (x - curve.box.centre))
        beside = np.abs(x - curve.box.centre - t * curve.box.direction)
        if abs(t) <= curve.box.half and np.all(beside <= np.maximum(curve.spread, curve.box.radius)):
            return True
    return False


@pytest.mark.few(3, 0)
@pytest.mark.parametrize(("p", "seed"), NEAR)
def test_roots_on_an_arc_are_on_one_curve(p, seed):
    """A curve through one root of an arc, which is proven in another way, goes through all others."""
    arcs, chains = 0, []
    for problem, piece, codes in cases(p, seed, 8):
        arc = piece.arc(codes)
        if arc is None:
            continue
        on_it = []
        for k in range(9):
            alpha = piece.low + (piece.high - piece.low) * k / 8
            for root in enumsol.enumerate_roots(problem, alpha):
                narrow = leaf_of(root, problem, 14, NoTurn())
                there = piece.over(alpha, alpha).held(narrow)
                if isinstance(there, SpaceRoot) and arc.has(there, narrow):
                    on_it.append(root)
        if len(on_it) < 2:
            continue
        arcs += 1
        given, first = AlphaProblem.of(problem.enclosure), on_it[len(on_it) // 2]
        chain = next((known for known in chains if is_on(known, given, first)), None)
        if chain is None:
            x = np.concatenate([first.lambda_n, *first.lambda_t.T, [float(first.alpha)]])
            chain = chain_through(given, problem, x, (Fraction(0), Fraction(1)))
            chains.append(chain)
        assert all(is_on(chain, given, root) for root in on_it), codes
    assert arcs


class NoTurn:
    """In place of random numbers: no other sector."""

    @staticmethod
    def random():
        return 1.0

    @staticmethod
    def integers(*_):
        return 0
