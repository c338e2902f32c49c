"""Selections in rationals, solved from the matrices of the problem, are those of the condensed problem."""

from fractions import Fraction
from itertools import product

import numpy as np

from enumsol import ContactProblem
from enumsol.condensation.exact import ExactSystem, UncondensedSystem
from enumsol.selections.rational_selections import ExactSelections


def test_selections_are_solved_alike_with_and_without_condensing(rng):
    singular = 0
    for _ in range(5):
        p = int(rng.integers(1, 4))
        n = 2 * p + int(rng.integers(0, 4))
        X = rng.integers(-1, 2, size=(n, n))
        A = (X @ X.T + np.eye(n)) * 0.1
        B = np.linalg.qr(rng.normal(size=(n, n)))[0][: 2 * p] if rng.random() < 0.5 else np.eye(n)[: 2 * p]
        F, gap = rng.integers(0, 4, size=p) / 2, rng.integers(0, 2, size=p).astype(float)
        f = rng.integers(-2, 3, size=n).astype(float)
        problem = ContactProblem(A, B[:p], B[p:], f, gap=gap, load_slope=f / 3, friction=(F, 0.25))
        alpha = Fraction(int(rng.integers(0, 3)), 3)
        ours = ExactSelections(UncondensedSystem(problem, alpha))
        condensed = ExactSelections(ExactSystem.from_problem(problem, alpha))
        for codes in product(range(4), repeat=p):
            found, expected = ours.solve_equations(codes), condensed.solve_equations(codes)
            assert found == expected
            singular += expected is None
            if expected is not None:
                assert ours.moved(expected[0]) == condensed.moved(expected[0])
            solutions = ours.solve(codes), condensed.solve(codes)
            assert solutions[0] == solutions[1]
        assert "_condensed" not in vars(ours.system) or singular
