"""Which of several solutions do successive approximations reach?

Problems of the gallery with three and five roots, all of them enumerated with proof. From 200 random starts each (slip
bounds, with sizes from 1e-3 to 10 times the largest normal force of a root), plain and with Anderson's mixing of depth
5, every run ends on a root, in a cycle, or is cut.

At every root the derivative of Psi is taken by differences: its spectral radius tells whether plain iterations can
converge to the root at all (below 1), and det(I - Psi') must have the sign of the root's index, which is computed
otherwise.

Read ``never`` beside ``index`` and ``radius``: an index of -1 says that a root repels, +1 not that it attracts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import enumsol
from enumsol import gallery
from fixed_points_basins.basins import basin_table, plot_basins
from shared.figures import panels
from shared.results import yes

if TYPE_CHECKING:
    from shared.results import Run

NAMES = ("one-node-6.1", "two-node-5", "two-node-6.4", "wedge-8-5", "wedge-14-3", "wedge-14-5", "wedge-20-5")
SMOKE_NAMES = ("one-node-6.1", "two-node-5")
PICTURE, SMOKE_PICTURE = "wedge-14-5", "two-node-5"
STARTS, SMOKE_STARTS = 200, 20
DEPTH = 5
#: Step of the differences, relative to the largest normal force of all roots; in 2D Psi is piecewise linear.
STEP = 1e-6


def derivative(problem, root, step):
    """Derivative of Psi in the slip bounds at a root, (p, p); forward, as bounds are not negative."""

    def psi(bound):
        return enumsol.solve_tresca(problem, bound, root.alpha, start=root).lambda_n

    bound = np.maximum(root.lambda_n, 0.0)
    here = psi(bound)
    return np.stack([(psi(bound + step * unit) - here) / step for unit in np.eye(problem.p)], axis=1)


def root_rows(name, problem, roots, tables):
    """A row a root: where it is, whether it attracts, how often it was reached."""
    step = STEP * max(float(np.max(root.lambda_n)) for root in roots)
    for k, root in enumerate(roots):
        jacobian = derivative(problem, root, step)
        values = np.linalg.eigvals(jacobian)
        sign = int(np.sign(np.linalg.det(np.eye(problem.p) - jacobian)))
        counts = {status: [str(s) for s in root.statuses].count(status) for status in ("open", "stick")}
        yield {
            "problem": name,
            "root": k,
            "index": root.index,
            "sum lambda_n": float(np.sum(root.lambda_n)),
            **counts,
            "slip": problem.p - sum(counts.values()),
            "radius": float(np.max(np.abs(values))),
            "eigenvalues beyond 1": int(np.sum(np.abs(values) > 1)),
            "sign of det(I - Psi')": sign,
            "plain": int(np.sum(tables["plain"]["root"] == k)),
            "Anderson": int(np.sum(tables["Anderson"]["root"] == k)),
        }


def basin_row(name, alpha, kind, table):
    """How the runs from all starts ended."""
    lost = table[table["root"].isna()]
    return {
        "problem": name,
        "alpha": alpha,
        "iteration": kind,
        "starts": len(table),
        "on a root": len(table) - len(lost),
        "cycle": int(np.sum(table["outcome"] == "cycle")),
        "neither": int(np.sum(lost["outcome"] != "cycle")),
        "reached": " ".join(map(str, sorted(table["root"].dropna().unique()))),
        "never": " ".join(map(str, table.attrs["never"])) or "-",
        "median iterations": float(table["iterations"].median()),
        "most iterations": int(table["iterations"].max()),
    }


def conclusions(basins, roots):
    """What plain iterations reach, what Anderson's mixing adds, and whether the indices agree."""
    negative = [row for row in roots if row["index"] == -1]
    repelling = [row for row in roots if row["radius"] > 1]
    yield (
        f"{len(roots)} roots, {len(negative)} of index -1, {len(repelling)} with a spectral radius of Psi' beyond 1; "
        f"det(I - Psi') has the sign of the index at all: {yes(all(r['index'] == _sign(r) for r in roots))}"
    )
    yield (
        f"plain iterations reach {sum(row['plain'] > 0 for row in roots)} roots, of radius at most "
        f"{max(row['radius'] for row in roots if row['plain']):.2g}; none of the repelling ones: "
        f"{yes(not any(row['plain'] for row in repelling))}"
    )
    hidden = [f"{row['problem']} root {row['root']}" for row in repelling if row["index"] == 1]
    yield f"index +1 and yet repelling, so never reached: {', '.join(hidden) or 'none'}"
    gained = [f"{row['problem']} root {row['root']} ({row['Anderson']})" for row in roots if _gained(row)]
    starts = sum(row["starts"] for row in basins if row["iteration"] != "plain")
    yield f"reached with Anderson's mixing only (of {starts} starts): {', '.join(gained) or 'none'}"
    for kind in ("plain", "Anderson"):
        rows = [row for row in basins if row["iteration"] == kind]
        total = sum(row["starts"] for row in rows)
        yield (
            f"{kind}: {sum(row['cycle'] for row in rows) / total:.1%} of {total} runs end in a cycle, "
            f"{sum(row['neither'] for row in rows)} in neither; roots never reached: "
            + ", ".join(f"{row['problem']}: {row['never']}" for row in rows)
        )


def _sign(row):
    return row["sign of det(I - Psi')"]


def _gained(row):
    return row["Anderson"] and not row["plain"]


def main(run: Run) -> None:
    starts = SMOKE_STARTS if run.smoke else STARTS
    picture = SMOKE_PICTURE if run.smoke else PICTURE
    figure, axes = panels(1, 2, (11, 4.4), sharey=True)
    basins, found = [], []
    for name in SMOKE_NAMES if run.smoke else NAMES:
        entry = gallery.get(name)
        problem = entry.build()
        roots = enumsol.enumerate_roots(problem, entry.alpha)
        assert roots.complete
        tables = {
            kind: basin_table(problem, roots, starts, anderson=depth)
            for kind, depth in (("plain", 0), ("Anderson", DEPTH))
        }
        basins += [basin_row(name, entry.alpha, kind, table) for kind, table in tables.items()]
        found += root_rows(name, problem, roots, tables)
        if name == picture:
            for axis, (kind, table) in zip(axes, tables.items(), strict=True):
                plot_basins(table, axis)
                axis.set_title(f"{name}, {kind}: {axis.get_title()}", fontsize=10)
    run.table("fixed_points_basins", basins)
    run.table("fixed_points_roots", found, *conclusions(basins, found))
    run.figure("fixed_points_basins", figure)
