"""Relaxations of bodies that nothing holds: multipliers in balance with the load, and slender bodies."""

import sys
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from floating_oracle import block_on_table
from scipy.optimize import linprog

import enumsol
from enumsol.arithmetic.balls import Ball
from enumsol.model.statuses import SLIP_MINUS, SLIP_PLUS, STICK, UNDECIDED
from enumsol.search.certifiers.exclusions import in_balance
from enumsol.search.reference_closer import Cover
from enumsol.search.solvers import Solvers
from enumsol.trusted.floating_bounds import balanced
from enumsol.trusted.status_rows import FORBIDDEN, NONNEGATIVE, row_signs

sys.path.insert(0, str(Path(__file__).parents[2] / "studies"))
from contact_alone.bodies import pin, stack, telescope


def test_multipliers_are_brought_into_balance_with_signs_that_are_allowed():
    system = Solvers(block_on_table(4, push=0.5), Fraction(0), "verified", 1e-9).exclusions.system
    codes, p = (1, 1, UNDECIDED, 2, UNDECIDED), 5
    given = np.array([4 * p, 4 * p + 2, 5 * p + 1, 4 * p + 4])
    rows, values = in_balance(system, codes, given, np.array([1.0, 1.0, 1.0, 1.0]))
    kind, node = np.divmod(rows, p)
    y = np.zeros(2 * p)
    np.add.at(y, np.where(kind == 4, node, p + node), np.where(kind == 5, -values, values))
    assert np.allclose(system.rows.G.mid @ y, system.rows.h.mid, rtol=0, atol=1e-12)
    signs = row_signs(np.array(codes), system.F)[node, kind]
    assert np.all(signs != FORBIDDEN)
    assert np.all(values[signs == NONNEGATIVE] >= 0)


def test_a_telescope_is_searched_without_the_slower_solver():
    problem = telescope(12)
    roots = enumsol.enumerate_roots(problem, 0, max_nodes=500)
    assert len(roots) == 1
    assert roots.stats.fallback_qps == 0
    assert roots.complete
    assert enumsol.verify(problem, roots.proof).complete


def test_a_pin_that_nothing_but_contact_holds_has_one_solution():
    problem = pin(24, 0.5, half=False)
    roots = enumsol.enumerate_roots(problem, 0, max_nodes=600)
    assert len(roots) == 1
    assert roots.complete


@pytest.mark.parametrize(("load", "entry", "exists"), [(0.0, 0.0, True), (1e-30, 0.0, False), (0.0, 1e-30, False)])
def test_a_mode_that_no_multiplier_moves_is_in_balance_only_without_load(load, entry, exists):
    """In closed form: y = (3, -1) is the one solution of the last two equations, and the first is 0 = load."""
    G, h = Ball.exact(np.array([[entry, 0, 5], [1, 1, 0], [1, -1, 0]])), Ball.exact(np.array([load, 2, 4]))
    y, rad, sure = balanced(G, h, np.array([[3.0 + 2**-40, -1.0, 0.0]]))
    assert sure[0] == exists
    assert np.all(np.abs(y - [3, -1, 0]) <= rad) or not exists
    assert np.all(rad < 1e-12) or not exists


@pytest.mark.parametrize("size", [1.0, 2.0**-30, 2.0**-60])
def test_a_mode_that_only_small_multipliers_move_is_brought_into_balance(size):
    """In closed form: y = (3, -1, size); of a size that is lost in rounding beside the others as well."""
    G, h = Ball.exact(np.array([[0.0, 0, 1], [1, 1, 0], [1, -1, 0]])), Ball.exact(np.array([size, 2, 4]))
    y, rad, sure = balanced(G, h, np.array([[3.0 + 2**-40, -1.0, 1.25 * size]]))
    assert sure[0]
    assert np.all(np.abs(y - [3, -1, size]) <= rad)
    assert np.all(rad < 1e-12)


@pytest.mark.parametrize(
    ("made", "led"),
    [(partial(stack, 1), True), (partial(telescope, 12), False), (partial(pin, 24, 0.5, half=False), False)],
)
def test_a_tree_is_led_only_where_forces_elsewhere_cannot_hold_the_body(made, led):
    """A linear program judges: what sticks at the root, or slips as fewer nodes do, is open or slips as these do."""
    solvers = Solvers(made(), Fraction(0), "verified", 1e-9)
    system, root = solvers.exclusions.system, np.array(solvers.known_root)
    side = 1.0 if np.count_nonzero(root == SLIP_PLUS) < np.count_nonzero(root == SLIP_MINUS) else -1.0
    fewer = SLIP_PLUS if side > 0 else SLIP_MINUS
    G, p = system.rows.G.mid, system.p
    rays = [G[:, i] + side * system.F[i] * G[:, p + i] for i in range(p)]
    rays += [G[:, i] - side * system.F[i] * G[:, p + i] for i in np.flatnonzero((root != STICK) & (root != fewer))]
    forces = linprog(np.zeros(len(rays)), A_eq=np.array(rays).T, b_eq=system.rows.h.mid)
    assert forces.status == (2 if led else 0)
    assert Cover([solvers.exclusions.reference(tuple(root.tolist()))]).is_whole == led
