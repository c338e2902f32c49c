"""What is concluded of leaves in 3D over pieces of alpha: where their roots are, and whether these are one arc."""

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from problems3d import random_over_alpha

import enumsol
from enumsol.model.sectors import DEEPEST, SECTORS, places
from enumsol.search.space.space_setup import SpaceSolvers
from enumsol.trusted.space.leaves import SpaceRoot
from enumsol.trusted.space.pieces import AlphaPiece

CODES = {"open": 0, "stick": 1}
#: Problems with a fold or a change of statuses in [0, 1], and an alpha near it.
NEAR = [(1, 3), (1, 7), (2, 1), (2, 3), (2, 6)]


def piece_of(problem, low, high):
    system = SpaceSolvers(problem, (low + high) / 2, "verified").system
    return AlphaPiece(problem.enclosure, low, high, (system.force, system.length))


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
        if status.value in CODES or int(place_of(root, problem, i)) >> (DEEPEST + 2 - level) != code - SECTORS - (1 << level):
            return False
    return True


def cases(p, seed, count):
    """Pieces near to vertices of a graph, and leaves with roots there or beside them."""
    rng = np.random.default_rng([p, seed])
    problem = random_over_alpha(p, seed)
    graph = enumsol.branch_graph(problem, (0, 1), max_nodes=400)
    inner = [v.alpha for v in graph.vertices if 0.01 < float(v.alpha) < 0.99]
    for _ in range(count):
        about = Fraction(float(rng.choice(inner))) if inner and rng.random() < 0.8 else Fraction(int(rng.integers(1, 64)), 64)
        length = Fraction(1, 2 ** int(rng.integers(3, 9)))
        low = max(Fraction(0), about - length * int(rng.integers(0, 8)) / 8)
        high = min(Fraction(1), low + length)
        at = low + (high - low) * int(rng.integers(0, 17)) / 16
        roots = list(enumsol.enumerate_roots(problem, at))
        if roots:
            root = roots[int(rng.integers(len(roots)))]
            yield problem, piece_of(problem, low, high), leaf_of(root, problem, int(rng.integers(3, 12)), rng)


@pytest.mark.parametrize(("p", "seed"), NEAR)
def test_a_piece_is_narrowed_to_all_alpha_of_a_leafs_roots(p, seed):
    """Roots at single alphas of the piece are in the part that is left."""
    met = Counter()
    for problem, piece, codes in cases(p, seed, 12):
        narrowed, found = piece.narrowed(codes)
        met["none" if found is None else "less" if narrowed.high - narrowed.low < piece.high - piece.low else "all"] += 1
        for k in range(17):
            alpha = piece.low + (piece.high - piece.low) * k / 16
            if any(has(codes, root, problem) for root in enumsol.enumerate_roots(problem, alpha)):
                assert found is not None
                assert narrowed.low <= alpha <= narrowed.high
    assert met["less"] + met["none"], met


def way_to(path, x):
    """The distance of a point from a polygon."""
    line = np.column_stack([path.lambda_n, path.lambda_t.reshape(len(path.alpha), -1), path.alpha])
    start, edge = line[:-1], np.diff(line, axis=0)
    t = np.clip(np.sum((x - start) * edge, axis=1) / np.maximum(np.sum(edge * edge, axis=1), 1e-300), 0.0, 1.0)
    return float(np.min(np.linalg.norm(start + t[:, None] * edge - x, axis=1)))


@pytest.mark.parametrize(("p", "seed"), NEAR)
def test_roots_on_an_arc_are_on_one_path(p, seed):
    """Continuation from one root of an arc comes to all others that are found at single alphas."""
    arcs = 0
    options = enumsol.ContinuationOptions(h_max=2e-3)
    for problem, piece, codes in cases(p, seed, 12):
        arc = piece.arc(codes)
        if arc is None:
            continue
        on_it = []
        for k in range(9):
            alpha = piece.low + (piece.high - piece.low) * k / 8
            for root in enumsol.enumerate_roots(problem, alpha):
                leaf = tuple(CODES.get(s.value, SECTORS) for s in root.statuses)
                narrow = leaf_of(root, problem, 14, NoTurn())
                there = piece.point_at(alpha).held(narrow) if leaf == arc.statuses else None
                if isinstance(there, SpaceRoot) and arc.has(there, narrow):
                    on_it.append(root)
        if len(on_it) < 2:
            continue
        arcs += 1
        first = on_it[0]
        start = float(first.alpha), first.lambda_n, first.lambda_t
        low, high = float(piece.low), float(piece.high)
        span = max(0.0, low - 1e-3), min(1.0, high + 1e-3)
        paths = [enumsol.follow(problem, start, way, span, options) for way in (1, -1)]
        for root in on_it[1:]:
            x = np.concatenate([root.lambda_n, root.lambda_t.ravel(), [float(root.alpha)]])
            assert min(way_to(path, x) for path in paths) < 1e-3 * (1.0 + np.max(np.abs(x))), (codes, root)
    assert arcs


class NoTurn:
    """In place of random numbers: no other sector."""

    @staticmethod
    def random():
        return 1.0

    @staticmethod
    def integers(*_):
        return 0
