"""In 2D the fixed points of Psi are the enumerated roots; which of them iterations reach."""

import numpy as np
import pandas as pd
import pytest
from effort import some
from generators import FRICTION, dense_compliance, fe_compliance, from_condensed
from interruptions import CtrlC, interrupted
from refusals import bad_argument

import enumsol
from enumsol.fixed_points import basins, fixed_point_residual, plot_basins

MANY_ROOTS = [("one-node-6.1", 5.0, 3), ("two-node-5", 5.0, 5), ("two-node-6.4", 3.5, 5), ("wedge-14-5", 2.2, 5)]


@pytest.mark.parametrize(("name", "alpha", "count"), MANY_ROOTS)
def test_every_root_is_a_fixed_point(name, alpha, count):
    problem = enumsol.gallery.get(name).build()
    roots = enumsol.enumerate_roots(problem, alpha)
    assert len(roots) == count
    for root in roots:
        assert enumsol.is_fixed_point(problem, root)
        assert fixed_point_residual(problem, root) < 1e-8


@pytest.mark.slow
def test_every_root_of_random_problems_is_a_fixed_point(rng):
    several = 0
    for k in range(some(40, of=120)):
        p = int(rng.integers(1, 5))
        S = dense_compliance(rng, p) if k % 2 else fe_compliance(rng, 2 * p)
        p = len(S) // 2
        F = np.exp(rng.uniform(*np.log(FRICTION), p))
        problem = from_condensed(S, rng.normal(size=2 * p), F)
        roots = enumsol.enumerate_roots(problem, 0)
        several += len(roots) > 1
        assert all(enumsol.is_fixed_point(problem, root) for root in roots)
    assert several >= some(1, of=5)


def test_what_is_no_root_is_no_fixed_point():
    problem = enumsol.gallery.get("one-node-6.1").build()
    sticking = enumsol.enumerate_roots(problem, 5.0)[1]
    moved = enumsol.solve_tresca(problem, sticking.lambda_n + 0.1, 5.0)
    assert not enumsol.is_fixed_point(problem, moved)
    other = enumsol.gallery.get("two-node-5").build()
    bad_argument(r"expected \(2,\), as the problem has p = 2", enumsol.is_fixed_point, other, sticking)
    bad_argument("root is a int without alpha", enumsol.is_fixed_point, problem, 3)


@pytest.mark.few(0, 1)
@pytest.mark.parametrize(("name", "alpha", "count"), MANY_ROOTS)
def test_fifty_starts_end_on_a_root_or_say_that_they_did_not(name, alpha, count):
    problem = enumsol.gallery.get(name).build()
    roots = enumsol.enumerate_roots(problem, alpha)
    table = enumsol.basin_table(problem, roots, 50)
    assert len(table) == 50
    assert np.array_equal(table["root"].notna(), table["outcome"] == "converged")
    # roots of negative index repel: no start of the plain iteration ends there
    repelling = {k for k, root in enumerate(roots) if root.index == -1}
    assert repelling <= set(table.attrs["never"])
    assert table["root"].nunique() >= 2
    (axes,) = plot_basins(table).axes
    assert axes.get_title().startswith("never reached: root")
    few = table["iterations"].max() <= 20
    assert axes.get_yscale() == ("linear" if few else "log")
    axes.figure.canvas.draw()
    if few:
        assert all(label.get_text().lstrip("\u2212").isdigit() for label in axes.get_yticklabels())
    # a root has its colour whichever others are reached
    colours = {line.get_label(): line.get_color() for line in axes.lines}
    for root, rows in table.groupby("root"):
        assert colours[f"root {root}: {len(rows)} starts"] == f"C{root}"


def test_below_the_bound_every_start_ends_on_the_one_root():
    problem = enumsol.gallery.get("two-node-5").build()
    alpha = 0.99 * enumsol.lipschitz_estimate(problem, 1.0).factor
    assert enumsol.lipschitz_estimate(problem, alpha).contracts
    table = enumsol.basin_table(problem, enumsol.enumerate_roots(problem, alpha), 50)
    assert list(table["root"].unique()) == [0]
    assert table.attrs["never"] == []


def test_given_starts_and_their_errors():
    problem = enumsol.gallery.get("one-node-6.1").build()
    roots = enumsol.enumerate_roots(problem, 5.0)
    table = enumsol.basin_table(problem, roots, [[0.0], [100.0]])
    assert list(table["root"]) == [0, 2]
    for starts, message in (([1.0], "starts has shape"), (0, "starts is 0"), ([[1.0, 2.0]], r"expected \(k, p\)")):
        bad_argument(message, enumsol.basin_table, problem, roots, starts)
    bad_argument("roots has 0 roots", enumsol.basin_table, problem, [], 5)
    other = enumsol.enumerate_roots(problem, 4.0)[0]
    bad_argument("all at the same alpha", enumsol.basin_table, problem, [roots[0], other])
    bad_argument("roots is 3; expected a RootSet", enumsol.basin_table, problem, 3, 5)
    bad_argument("table lacks", plot_basins, table[["start"]])


def test_starts_that_reach_no_root_are_crosses():
    rows = [("converged", 5, 1.0, 0), ("converged", 30, 0.0, 0), ("cycle", 40, 2.0, pd.NA), ("cycle", 7, 3.0, pd.NA)]
    table = pd.DataFrame(rows, columns=["outcome", "iterations", "size", "root"])
    (ax,) = plot_basins(table).axes
    assert [line.get_label() for line in ax.lines] == ["root 0: 2 starts", "no root (cycle): 2 starts"]
    assert ax.lines[1].get_marker() == "x"
    assert ax.lines[1].get_xydata().tolist() == [[2.0, 40.0], [3.0, 7.0]]
    assert (ax.get_xscale(), ax.get_yscale()) == ("symlog", "log")


def test_interrupted_keeps_the_rows(monkeypatch):
    problem = enumsol.gallery.get("one-node-6.1").build()
    roots, stop = enumsol.enumerate_roots(problem, 5.0), CtrlC(call=4, then=basins.successive_approximations)
    monkeypatch.setattr(basins, "successive_approximations", stop)
    assert len(interrupted("after 3 of 10 starts", enumsol.basin_table, problem, roots, 10)) == 3
