"""Which of several roots successive approximations reach, start by start, and the picture of it."""

from __future__ import annotations

from math import floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

import enumsol

if TYPE_CHECKING:
    from enumsol import ContactProblem, RootSet

#: A limit is a root if no contact force differs by more, relative to the largest force of all roots.
DISTANCE = 1e-6
#: Up to as many iterations the axis of iterations is linear.
LINEAR = 20
MARKERS = "osD^v<>P*h"


def basin_table(problem: ContactProblem, roots: RootSet, starts: int, *, anderson: int, seed: int = 0) -> pd.DataFrame:
    """A row for every start; ``attrs["never"]`` are the numbers of the roots that none of them reached.

    Starts are slip bounds, independent at the nodes, with sizes log-uniform between 1e-3 and 10 times the largest
    normal force of all roots; the first one is 0.
    """
    rng = np.random.default_rng(seed)
    size = max(float(np.max(root.lambda_n)) for root in roots)
    bounds = size * 10.0 ** rng.uniform(-3.0, 1.0, (starts, 1)) * rng.uniform(0.0, 1.0, (starts, problem.p))
    bounds[0] = 0.0
    known = np.array([_forces(root) for root in roots])
    rows = []
    for bound in bounds:
        found = enumsol.successive_approximations(problem, roots.alpha, bound, anderson=anderson)
        away = np.max(np.abs(known - _forces(found)), axis=1)
        reached = found.converged and np.min(away) <= DISTANCE * np.max(np.abs(known))
        rows.append(
            {
                "size": float(np.mean(bound)),
                "outcome": found.outcome.value,
                "iterations": found.iterations,
                "root": int(np.argmin(away)) if reached else pd.NA,
            }
        )
    table = pd.DataFrame(rows).astype({"root": "Int64"})
    table.attrs["never"] = sorted(set(range(len(roots))) - set(table["root"].dropna().astype(int)))
    return table


def _forces(found: Any) -> Any:
    return np.concatenate([found.lambda_n, found.lambda_t])


def plot_basins(table: pd.DataFrame, ax: Any) -> None:
    """Draw every start of a table: iterations against the mean slip bound, marked by the root that is reached."""
    from matplotlib.ticker import MaxNLocator

    for root, rows in table.groupby("root"):
        style = {"marker": MARKERS[root % len(MARKERS)], "color": f"C{root}"}  # the same in every picture
        ax.plot(rows["size"], rows["iterations"], ls="", alpha=0.7, label=f"root {root}: {len(rows)} starts", **style)
    for outcome, rows in table[table["root"].isna()].groupby("outcome"):
        ax.plot(rows["size"], rows["iterations"], "x", color="black", label=f"no root ({outcome}): {len(rows)} starts")
    # a power of ten, so that no tick comes to lie between 0 and the first one
    ax.set_xscale("symlog", linthresh=10.0 ** floor(log10(table["size"][table["size"] > 0].min())))
    if table["iterations"].max() > LINEAR:
        ax.set_yscale("log")
    else:
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("mean slip bound of the start [force]")
    ax.set_ylabel("iterations")
    names = ", ".join(map(str, table.attrs["never"])) or "none"
    ax.set_title(f"never reached: {names}")
    ax.legend()
