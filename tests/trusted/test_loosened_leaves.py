"""Leaves in 3D where the equations of the statuses are singular, against the closed form of one node."""

import functools
from fractions import Fraction

import numpy as np
import pytest
from problems3d import OneNode

from enumsol import enumerate_roots
from enumsol.condensation.space_condensed import AlphaSpace
from enumsol.model.sectors import DEEPEST, SECTORS, direction, end_number, places
from enumsol.search.space.space_search import SpaceSolvers
from enumsol.trusted.space import leaf_equations
from enumsol.trusted.space.leaf_equations import Leaf
from enumsol.trusted.space.leaves import Open, SpaceRoot, contents
from enumsol.trusted.space.pieces import AlphaPiece

#: Seeds of nodes whose normal force a direction of slip does not determine at some solution, and whether load changes.
SINGULAR = [(7, True), (22, True), (26, True), (19, False)]


def resistance(node, phi):
    """w_n by a normal force that slips in a direction, at the solution there."""
    F = node.F if node.load else node.alpha(phi)
    return node.S[0, 0] + F * node.S[0, 1:] @ np.array([np.cos(phi), np.sin(phi)])


def singular(node):
    """The solutions, by their directions, near which that vanishes, or is as small as it becomes."""
    phi = np.linspace(-np.pi, np.pi, 4001)
    phi = phi[[node.at(x) is not None for x in phi]]
    return phi[np.argsort([abs(resistance(node, x)) for x in phi])[:1]]


def sectors_near(phi, level):
    """The sector of a level that has a direction, and its neighbours."""
    here = int(places(np.array([np.cos(phi), np.sin(phi)]))) >> (DEEPEST + 2 - level)
    return [(1 << level) + (here + k) % (1 << level) for k in (-1, 0, 1)]


def points_in(node, piece, number):
    """Solutions over a piece that slip in a sector, from the closed form: angles, then alpha and forces."""
    level = number.bit_length() - 1
    begin, width = (number - (1 << level)) << (DEEPEST + 2 - level), 1 << (DEEPEST + 2 - level)
    a, b = (np.array(direction(n)) for n in (number, end_number(number)))
    phi = np.arctan2(*(a + b)[::-1]) + np.linspace(-8, 8, 801) / (1 << level)
    found = []
    for x in phi:
        place = float(places(np.array([np.cos(x), np.sin(x)])))
        if begin <= place < begin + width and piece.low <= node.alpha(x) <= piece.high:
            found.append((x, node.at(x)))
    return [(x, at) for x, at in found if at is not None]


@functools.cache
def cases(seed, load, sizes=((6, 0.05), (9, 0.02), (11, 0.02), (12, 0.004))):
    """Leaves around where the equations are singular, over pieces of several lengths, and their solutions."""
    node, found = OneNode(seed, load), []
    problem = node.problem
    for phi in singular(node):
        for level, length in sizes:
            alpha = Fraction(float(node.alpha(phi)))
            low, high = alpha - Fraction(length) / 3, alpha + Fraction(length)
            system = SpaceSolvers(problem, alpha, "verified").system
            piece = AlphaPiece(AlphaSpace(problem.enclosure, alpha, (system.force, system.length)), low, high)
            found += [
                (node, problem, piece, (SECTORS + number,), points_in(node, piece, number))
                for number in sectors_near(phi, level)
            ]
    return found


@pytest.mark.parametrize(("seed", "load"), SINGULAR)
def test_no_solution_is_missed_where_the_equations_are_singular(seed, load):
    settled = open_before = seen = 0
    for _, problem, piece, codes, points in cases(seed, load):
        narrowed, found = piece.narrowed(codes)
        before = contents(Leaf(piece.whole, codes))
        open_before += isinstance(before, Open) and before.y is None
        settled += not isinstance(found, Open) or found.y is not None
        seen += len(points)
        for _, (alpha, n, tangential) in points:
            assert found is not None
            assert narrowed.low <= alpha <= narrowed.high
            if found.y is not None:
                forces, near = piece.forces(found.y), np.array([n, *tangential])
                assert np.all(np.abs(forces.mid - near) <= forces.rad + 1e-9 * np.max(np.abs(near)))
                w = narrowed.displacements(found.y, found.w, narrowed.alphas)
                moved = problem.condensed.free_displacements(float(alpha)) - problem.condensed.S @ near
                assert np.all(np.abs(w.mid - moved) <= w.rad + 1e-9 * (1.0 + np.max(np.abs(moved))))
    assert seen
    assert open_before
    assert settled > open_before


@pytest.mark.parametrize(("seed", "load"), [case for case in SINGULAR if case[0] != 22])
def test_a_root_there_is_one_with_its_index(seed, load, monkeypatch):
    """A leaf that has exactly one root over its piece has it at every alpha, with the index of an enumeration."""
    compared = 0
    # narrow sectors, too
    monkeypatch.setattr(leaf_equations, "_COUPLED", 0.0)
    for _, problem, piece, codes, _ in cases(seed, load, ((9, 1e-4), (11, 1e-5))):
        leaf = Leaf(piece.whole, codes).loosened()
        with np.errstate(all="ignore"):
            found = None if leaf is None else contents(leaf)
        if not isinstance(found, SpaceRoot):
            continue
        compared += 1
        forces = piece.forces(found.y)
        for alpha in (piece.low, piece.high):
            roots = [(root.index, np.append(root.lambda_n, root.lambda_t)) for root in enumerate_roots(problem, alpha)]
            near = [index for index, force in roots if np.all(np.abs(forces.mid - force) <= forces.rad)]
            assert near == [found.index]
    assert compared


@pytest.mark.parametrize(("seed", "load"), SINGULAR)
def test_an_arc_there_is_connected(seed, load):
    """All solutions with directions in the box of an arc follow each other without a gap."""
    arcs = 0
    for node, _, piece, codes, _ in cases(seed, load):
        arc = piece.arc(codes)
        if arc is None:
            continue
        middle = np.arctan2(*arc.centre[0][::-1]) + arc.angle[0]
        phi = middle + np.linspace(-1, 1, 801) * arc.radius[0]
        on_it = [piece.low <= node.alpha(x) <= piece.high and node.at(x) is not None for x in phi]
        assert np.sum(np.diff(np.array([False, *on_it, False]).astype(int)) > 0) <= 1
        arcs += any(on_it)
    assert arcs
