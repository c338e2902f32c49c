"""Looks of branches, arcs and vertices in figures: colours, line styles, markers, and places for numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from enumsol.branches.elements import VertexKind
from enumsol.model.statuses import ContactStatus
from enumsol.support.plotting import area_entry, line_entry

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from enumsol.branches.claims import MultiplicitySteps
    from enumsol.support.array_types import Floats


#: Blue, orange, green, violet, red, brown, teal, olive: distinct in print and to most readers.
COLOURS = ("#1f5fa8", "#d9730d", "#2a8a4a", "#7a4fa3", "#c23b4b", "#7d5a3c", "#2a9aa0", "#8a8a2a")
GREY = "#333333"
#: Solid where the node is open, dashed where it sticks, dash-dotted and dotted where it slips.
STATUS_STYLES: dict[ContactStatus, Any] = {
    ContactStatus.OPEN: "-",
    ContactStatus.STICK: (0, (5, 2.5)),
    ContactStatus.SLIP_PLUS: (0, (6, 1.6, 1.2, 1.6)),
    ContactStatus.SLIP_MINUS: (0, (1.2, 1.6)),
    ContactStatus.SLIP: (0, (6, 1.6, 1.2, 1.6)),
}
#: Of overviews, by the index of the arc.
INDEX_STYLES: dict[int | None, Any] = {1: "-", -1: (0, (5, 2.5)), None: (0, (1.2, 1.6))}
#: Ranges of alpha in which solutions may be missing, narrow ones as a line.
OPEN_RANGE: dict[str, Any] = {"facecolor": "#f3d3d6", "edgecolor": "#c23b4b", "linewidth": 0.6}
MARKERS = {
    VertexKind.TRANSITION: ("o", "white", "transition"),
    VertexKind.FOLD: ("s", "white", "fold"),
    VertexKind.BIFURCATION: ("D", "white", "bifurcation"),
    VertexKind.TOUCH: ("v", "white", "status met and left again"),
    VertexKind.POINT: ("x", GREY, "single point"),
    VertexKind.TERMINAL: ("P", "white", "begins or ends alone"),
    VertexKind.BOUND: ("|", GREY, "at the bound of rigid displacements"),
    VertexKind.BROKEN: ("X", GREY, "degrees differ, something is missing"),
    VertexKind.UNSETTLED: ("4", GREY, "not followed further"),
}


def colour_of(branch: int) -> str:
    """The colour of a branch."""
    return COLOURS[branch % len(COLOURS)]


def index_style(index: int | None) -> Any:
    """The line style of an arc in an overview."""
    return INDEX_STYLES.get(index, INDEX_STYLES[None])


#: Entries of a legend for what is no line of a branch and no vertex, by names.
OTHERS: dict[str, tuple[Callable[..., Any], str, dict[str, Any]]] = {
    "continuum": (line_entry, "continuum", {"color": GREY, "linewidth": 2.4}),
    "sheet": (area_entry, "sheet", {"color": GREY, "alpha": 0.25, "linewidth": 0}),
    "open": (area_entry, "solutions may be missing", OPEN_RANGE),
    "dots": (line_entry, "number at that alpha alone", {"linestyle": "", "marker": ".", "color": GREY}),
}


def handles(
    kinds: Iterable[VertexKind], statuses: Iterable[ContactStatus], indices: Iterable[int | None], others: set[str]
) -> list[Any]:
    """Entries of a legend for what a figure shows; ``others`` are names in `OTHERS`."""
    known = {index if index in INDEX_STYLES else None for index in indices}
    styles = {status.value: STATUS_STYLES[status] for status in STATUS_STYLES if status in set(statuses)}
    styles |= {
        "other index" if index is None else f"index {index:+d}": style
        for index, style in INDEX_STYLES.items()
        if index in known
    }
    marked = [MARKERS[kind] for kind in MARKERS if kind in set(kinds)]
    return [
        *(line_entry(label, color="#666666", linestyle=style) for label, style in styles.items()),
        *(
            line_entry(label, linestyle="", marker=marker, color=GREY, markerfacecolor=face, markersize=4.5)
            for marker, face, label in marked
        ),
        *(entry(label, **look) for name, (entry, label, look) in OTHERS.items() if name in others),
    ]


#: Where along a curve a label may stand, the best place first, and on which sides of it.
_ALONG = (0.5, 0.65, 0.35, 0.8, 0.2, 0.9, 0.1, 0.97, 0.03)
_SIDES = ((0.0, 1.0), (0.0, -1.0), (0.7, 0.7), (-0.7, 0.7), (0.7, -0.7), (-0.7, -0.7), (1.0, 0.0), (-1.0, 0.0))
#: Distances from the curve [points], and pixels between labels.
_AWAY, _APART = (5.0, 9.0), 2.0


class Label(NamedTuple):
    """A text and the curve it belongs to, in data coordinates (k, 2)."""

    text: str
    colour: str
    curve: Floats


def place_labels(axis: Any, labels: Sequence[Label], obstacles: Iterable[Floats]) -> list[Label]:
    """Write labels beside their curves; returns those for which there was no room.

    Parameters
    ----------
    axis : Axes
        Of a figure whose layout is settled.
    labels : sequence of Label
        In the order of their importance.
    obstacles : iterable of (k, 2) arrays
        Curves and marks that labels should not stand on, in data coordinates.
    """
    window = axis.get_window_extent()
    frame = np.array([[window.x0, window.y0], [window.x1, window.y1]])
    pixel = axis.figure.dpi / 72.0
    lines = [dense(axis.transData.transform(points), 3.0) for points in obstacles if len(points)]
    points = np.concatenate(lines) if lines else np.zeros((0, 2))
    points = points[np.all((points > frame[0] - 20) & (points < frame[1] + 20), axis=1)]
    boxes: list[Floats] = []
    left = []
    for label in labels:
        text = axis.text(
            0, 0, label.text, color=label.colour, fontsize=8, ha="center", va="center", transform=None, clip_on=True
        )
        text.set_in_layout(False)
        drawn = text.get_window_extent()
        size = np.array([drawn.width, drawn.height])
        found = _place(axis.transData.transform(label.curve), size, frame, boxes, points, pixel)
        if found is None:
            text.remove()
            left.append(label)
            continue
        boxes.append(np.array([found - size / 2, found + size / 2]))
        # kept in data coordinates: it stays with its curve when the figure is scaled
        text.set_transform(axis.transData)
        text.set_position(axis.transData.inverted().transform(found))
        text.set_gid("branch number")
    return left


def _place(
    curve: Floats, size: Floats, frame: Floats, boxes: Sequence[Floats], points: Floats, pixel: float
) -> Floats | None:
    line = dense(curve, 3.0)
    line = line[np.all((line >= frame[0] - 1) & (line <= frame[1] + 1), axis=1)]
    if not len(line):
        return None
    for away in _AWAY:
        for share in _ALONG:
            foot = line[min(int(share * len(line)), len(line) - 1)]
            for side in _SIDES:
                middle = foot + np.array(side) * (away * pixel + size / 2)
                low, high = middle - size / 2 - _APART, middle + size / 2 + _APART
                if np.any(low < frame[0]) or np.any(high > frame[1]):
                    continue
                if any(np.all(low < box[1]) and np.all(high > box[0]) for box in boxes):
                    continue
                if not np.any(np.all((points > low) & (points < high), axis=1)):
                    return np.asarray(middle)
    return None


def dense(line: Floats, step: float) -> Floats:
    """A polygon with points at most ``step`` apart."""
    if len(line) < 2:
        return line
    gaps = np.hypot(*np.diff(line, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(gaps)])
    at = np.linspace(0.0, along[-1], min(int(along[-1] / step) + 2, 4000))
    return np.stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])], axis=1)


#: Narrower than this part of the interval, a change cannot be seen; at most so many are shown, and none that is
#: narrower than this relative to alpha: the numbers beside it would hardly differ.
_NARROW, _MOST, _NARROWEST = 0.02, 2, 1e-10
#: What is shown on both sides, by the width of the narrow part.
_MARGIN = 0.75


def narrow_changes(steps: MultiplicitySteps, interval: tuple[float, float]) -> list[tuple[float, float]]:
    """Windows of alpha around steps too narrow to be seen, in the order of alpha.

    Of many those with the largest changes, of these the narrowest. Neighbours share a window in which both are seen.
    """
    a, b = interval
    alphas, least = [float(alpha) for alpha in steps.alphas], _NARROW * (b - a)
    # plateaus of equal counts: count, first and last alpha
    plateaus: list[tuple[int, float, float]] = []
    for count, lo, hi in zip(steps.between, alphas, alphas[1:], strict=False):
        if plateaus and plateaus[-1][0] == count:
            plateaus[-1] = (count, plateaus[-1][1], hi)
        else:
            plateaus.append((count, lo, hi))
    # change, first and last alpha, width of the narrowest step
    found: list[tuple[int, float, float, float]] = []
    for k, (count, lo, hi) in enumerate(plateaus):
        if len(plateaus) == 1 or not _NARROWEST * max(abs(lo), abs(hi)) < hi - lo < least:
            continue
        change = max(abs(count - plateaus[j][0]) for j in (k - 1, k + 1) if 0 <= j < len(plateaus))
        largest, first, last, width = found[-1] if found else (0, lo, float("-inf"), 0.0)
        width = min(width, hi - lo)
        if lo <= last and hi - first < least and width >= _NARROW * (hi - first):
            found[-1] = (max(change, largest), first, hi, width)
        else:
            found.append((change, lo, hi, hi - lo))
    found.sort(key=lambda item: (-item[0], item[2] - item[1]))
    margins = [(lo, hi, _MARGIN * (hi - lo)) for _, lo, hi, _ in found[:_MOST]]
    return sorted((max(a, lo - margin), min(b, hi + margin)) for lo, hi, margin in margins)
