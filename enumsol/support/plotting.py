"""New figures for plots; matplotlib is imported when the first one is made."""

from __future__ import annotations

import re
from functools import cache
from io import BytesIO
from typing import TYPE_CHECKING, Any, TypeVar

from enumsol.errors import InvalidArgumentError, MissingDependencyError
from enumsol.support.arguments import file_path, shown
from enumsol.support.files import write_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase
    from matplotlib.figure import Figure

    FigureT = TypeVar("FigureT", bound=Figure)


def new_figure(**options: Any) -> Any:
    """A figure that pyplot does not keep, with the options of matplotlib.figure.Figure; notebooks show it.

    Raises
    ------
    MissingDependencyError
        matplotlib is not installed.
    """
    try:
        figure = _figure_class()(layout="constrained", **options)
    except ImportError as error:
        raise MissingDependencyError(
            'plots need matplotlib, which is not installed; install it with: pip install "enumsol[plots]"'
        ) from error
    return figure


#: How matplotlib writes the powers of ten along an axis.
_LOGARITHMIC = "mathdefault"


@cache
def _figure_class() -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    class NotebookFigure(Figure):
        def __init__(self, **options: Any) -> None:
            super().__init__(**options)
            FigureCanvasAgg(self)

        def draw(self, renderer: RendererBase) -> None:
            # a dollar sign in a title or a name begins no formula; logarithmic axes have formulas of their own
            for text in self.findobj(Text):
                if _LOGARITHMIC not in (said := text.get_text()) and "$" in said:
                    text.set_text(re.sub(r"(?<!\\)\$", r"\\$", said))
            super().draw(renderer)

        def _repr_png_(self) -> bytes:
            drawn = BytesIO()
            self.savefig(drawn, format="png", dpi=110)
            return drawn.getvalue()

    return NotebookFigure


def checked_units(units: object, name: str = "units") -> tuple[str, str] | None:
    """Units of forces and lengths, of a pair or a text such as "N,mm"; None for None.

    Raises
    ------
    InvalidArgumentError
        It is something else.
    """
    if units is None:
        return None
    pair = units.split(",") if isinstance(units, str) else units
    if not isinstance(pair, (tuple, list)) or len(pair) != 2 or not all(isinstance(x, str) and x.strip() for x in pair):
        raise InvalidArgumentError(f"{name} is {shown(units)}; expected units of force and length, such as N,mm")
    return pair[0].strip(), pair[1].strip()


def in_units(name: str, dimension: str | None, units: tuple[str, str] | None) -> str:
    """A heading or the label of an axis, with the unit of "force", "length" or "work" if units are given."""
    if units is None or dimension is None:
        return name
    force, length = units
    return f"{name} [{ {'force': force, 'length': length, 'work': f'{force} {length}'}[dimension] }]"


def axes_of(ax: object, figsize: tuple[float, float]) -> Any:
    """The axes that a picture is drawn into: those given, or those of a new figure [inches].

    Raises
    ------
    InvalidArgumentError, MissingDependencyError
        As `axes_or_none` and `new_figure`.
    """
    return new_figure(figsize=figsize).add_subplot() if axes_or_none(ax) is None else ax


def plain_axes(axis: Axes) -> None:
    """A light grid behind what is drawn, and lines on the left and below only."""
    axis.grid(visible=True, color="#e4e4e4", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def line_entry(label: str, **look: Any) -> Any:
    """An entry of a legend: a line that looks like that, or with ``marker`` and linestyle "" a mark."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **look)


def area_entry(label: str, **look: Any) -> Any:
    """An entry of a legend: an area that looks like that."""
    from matplotlib.patches import Patch

    return Patch(label=label, **look)


def figure_of(ax: Axes) -> Any:
    """The whole figure that axes belong to, through subfigures."""
    return ax.figure.canvas.figure


def kept(figure: FigureT, file: object) -> FigureT:
    """The figure, written to a file as well if one is given.

    Raises
    ------
    InvalidArgumentError, OutputError
        ``file`` is no name, or cannot be written.
    """
    if file is not None:
        place = file_path(file, "file")
        place = place if place.suffix else place.with_name(f"{place.name}.png")  # as matplotlib does
        kind = place.suffix.removeprefix(".").lower()
        drawn = BytesIO()  # not all of matplotlib's formats survive a file that cannot be written
        try:
            figure.savefig(drawn, dpi=150, format=kind)
        except ValueError as error:
            if kind in figure.canvas.get_supported_filetypes():
                raise
            raise InvalidArgumentError(f"file is {place}; expected a name that ends in .png, .pdf or .svg") from error
        write_file(place, drawn.getvalue(), "file")
    return figure


def axes_or_none(ax: object) -> Any:
    """The axes that a picture is drawn into; None for those of a new figure.

    Raises
    ------
    InvalidArgumentError
        It is something else.
    """
    if ax is not None and not hasattr(ax, "get_xlim"):
        raise InvalidArgumentError(f"ax is a {type(ax).__name__}; expected the Axes of a figure, or None")
    return ax
