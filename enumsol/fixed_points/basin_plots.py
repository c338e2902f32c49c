"""Pictures of basins: which root successive approximations reach from which start."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from enumsol.errors import InvalidArgumentError
from enumsol.support.messages import counted
from enumsol.support.plotting import axes_or_none, figure_of, new_figure

if TYPE_CHECKING:
    import pandas as pd

_MARKERS = "osD^v<>P*h"
#: Up to as many iterations the axis of iterations is linear.
_LINEAR = 20


def plot_basins(table: pd.DataFrame, ax: Any = None) -> Any:
    """Every start of a `basin_table`: iterations against the mean slip bound, marked by the root that is reached.

    Parameters
    ----------
    table : DataFrame
        Of `basin_table`.
    ax : matplotlib Axes or None
        Draw there; None: in a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        The roots that no start reaches are named in its title. Notebooks show it.

    Raises
    ------
    InvalidArgumentError
        The table was not made by `basin_table`, or ``ax`` is no Axes.
    MissingDependencyError
        matplotlib is not installed.
    """
    missing = {"size", "iterations", "root", "outcome"} - set(getattr(table, "columns", ()))
    if missing:
        raise InvalidArgumentError(f"table lacks {', '.join(sorted(missing))}; expected what basin_table returns")
    if axes_or_none(ax) is None:
        ax = new_figure(figsize=(6.4, 4.2)).subplots()
    from matplotlib.ticker import MaxNLocator  # there, where there are axes

    for root in sorted(table["root"].dropna().astype(int).unique().tolist()):
        rows = table[table["root"] == root]
        style = {"marker": _MARKERS[root % len(_MARKERS)], "color": f"C{root}"}  # the same in every picture
        label = f"root {root}: {counted(len(rows), 'start')}"
        ax.plot(rows["size"], rows["iterations"], ls="", alpha=0.7, label=label, **style)
    lost = table[table["root"].isna()]
    for outcome, rows in lost.groupby("outcome"):
        label = f"no root ({outcome}): {counted(len(rows), 'start')}"
        ax.plot(rows["size"], rows["iterations"], "x", color="black", label=label)
    positive = table["size"][table["size"] > 0]
    # a power of ten, so that no tick comes to lie between 0 and the first one
    ax.set_xscale("symlog", linthresh=10.0 ** math.floor(math.log10(positive.min())) if len(positive) else 1.0)
    if table["iterations"].max() > _LINEAR:
        ax.set_yscale("log")
    else:
        ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("mean slip bound of the start [force]")
    ax.set_ylabel("iterations")
    never = table.attrs.get("never", [])
    names = ", ".join(map(str, never))
    ax.set_title(f"never reached: {'roots' if len(never) > 1 else 'root'} {names}" if names else "never reached: none")
    ax.legend()
    return figure_of(ax)
