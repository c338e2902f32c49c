"""Figures of the studies: colours that go with each other, and axes without a box."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, RED, GREEN, GREY = "#1f5fa8", "#d9730d", "#c23b4b", "#2c7a4b", "#8a8a8a"


def panels(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """A figure and its axes, as ``Figure.subplots`` gives them; inches, and options of ``subplots``."""
    from matplotlib.figure import Figure  # an older version may be measured where matplotlib is not installed

    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, **options)
    for axis in figure.axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(visible=True, color="#ececec", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure, axes
