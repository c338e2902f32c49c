"""New figures for plots; matplotlib is imported when the first one is made."""

from __future__ import annotations

from typing import Any

from enumsol.errors import MissingDependencyError


def new_figure(**options: Any) -> Any:
    """A figure that pyplot does not keep, with the options of matplotlib.figure.Figure.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            'plots need matplotlib, which is not installed; install it with: pip install "enumsol[plots]"'
        ) from error
    figure = Figure(layout="constrained", **options)
    FigureCanvasAgg(figure)
    return figure
