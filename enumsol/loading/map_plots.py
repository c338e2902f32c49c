"""Pictures of maps: numbers of solutions over alpha and a second parameter."""

from __future__ import annotations

from itertools import pairwise
from textwrap import fill
from typing import TYPE_CHECKING, Any

from enumsol.support.plotting import axes_or_none, figure_of, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.loading.strips import MapRow, MapStrip

#: Colours of one solution, two, and so on; the last one is for more.
_COLOURS = ("#ffffff", "#c9b7dd", "#f2b56b", "#d97b5a", "#c04d6b", "#8a3b82", "#5b3b96", "#333a80", "#1c2c58")
_UNIQUE, _PROVEN, _PALE, _FOLD = "#2a8a4a", "#b5dcc0", 0.45, "#222222"


def draw_map(
    name: str, rows: Sequence[MapRow], strips: Sequence[MapStrip], curves: Sequence[Any], title: str, ax: Any
) -> Any:
    """A figure; see MultiplicityMap.plot."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch, Rectangle

    axes_or_none(ax)
    if ax is None:
        ax = new_figure(figsize=(7.0, 4.8)).add_subplot()
    order = sorted(range(len(rows)), key=lambda k: rows[k].value)
    edges = _edges([rows[k].value for k in order])
    seen: dict[int, bool] = {}
    for k, (low, high) in zip(order, edges, strict=True):
        row = rows[k]
        for number, (first, last) in enumerate(pairwise(row.alphas)):
            count, a, b = row.between[number], float(first), float(last)
            colour = _COLOURS[min(max(count, 1), len(_COLOURS)) - 1]
            seen[count] = seen.get(count, True) and row.exact
            ax.add_patch(Rectangle((a, low), b - a, high - low, facecolor=colour, alpha=_PALE, linewidth=0, zorder=1))
            line = _UNIQUE if count == 1 and row.exact else colour if count > 1 else "#999999"
            ax.plot([a, b], [row.value] * 2, color=line, linewidth=2.2, solid_capstyle="butt", zorder=3)
    for (a, b), (low, high) in (box for strip in strips for box in strip.boxes):
        ax.add_patch(Rectangle((a, low), b - a, high - low, facecolor=_PROVEN, linewidth=0, zorder=2))
    for curve in curves:
        places = [(alpha, rows[k].value) for k, alpha in curve]
        ax.plot(*zip(*places, strict=True), "--", color=_FOLD, linewidth=0.9, marker=".", markersize=5, zorder=4)
    ax.autoscale_view()
    ax.set_xlabel("alpha")
    ax.set_ylabel(name)
    ax.set_title(fill(title, 80), fontsize=9)
    handles: list[Any] = []
    for count, exact in sorted(seen.items()):
        words = f"{'' if exact else 'at least '}{count} solution{'' if count == 1 else 's'}"
        if count == 1 and exact:
            handles.append(Line2D([], [], color=_UNIQUE, linewidth=2.2, label="one solution, proven at these values"))
        else:
            handles.append(Patch(facecolor=_COLOURS[min(max(count, 1), len(_COLOURS)) - 1], label=words))
    if any(strip.boxes for strip in strips):
        handles.append(Patch(facecolor=_PROVEN, label="one solution, proven for all values between"))
    if curves:
        handles.append(Line2D([], [], linestyle="--", color=_FOLD, marker=".", label="folds, linked by statuses"))
    handles.append(Patch(facecolor="none", label="elsewhere between the values: not proven"))
    ax.legend(handles=handles, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, frameon=False)
    return figure_of(ax)


def _edges(values: Sequence[float]) -> list[tuple[float, float]]:
    """For every value from where to where the space around it is filled: half way to its neighbours."""
    if len(values) == 1:
        return [(values[0] - 0.5, values[0] + 0.5)]
    middles = [0.5 * (a + b) for a, b in pairwise(values)]
    first, last = values[0] - (middles[0] - values[0]), values[-1] + (values[-1] - middles[-1])
    bounds = [first, *middles, last]
    return list(pairwise(bounds))
