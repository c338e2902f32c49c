"""Parts of the figures of branch graphs: steps, continua, sheets, and the numbers of branches."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from enumsol.branches.elements import VertexKind
from enumsol.branches.figures.curves import Curve, CurvePlace, Quantity, columns, state_columns
from enumsol.branches.graph_data import VERDICTS
from enumsol.model.statuses import ContactStatus
from enumsol.support.plotting import area_entry, line_entry, plain_axes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from enumsol.branches.claims import Claims, MultiplicitySteps
    from enumsol.branches.elements import Arc, Vertex
    from enumsol.branches.graph_data import GraphData
    from enumsol.model.problem import ContactProblem
    from enumsol.roots.root import RootFamily
    from enumsol.roots.root_set import RootSet
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
#: Of overviews whose verdicts are known.
VERDICT_STYLES: dict[str, Any] = dict(zip(VERDICTS, INDEX_STYLES.values(), strict=True))
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


def line_styles(graph: GraphData, *, by_node: bool) -> dict[str, Any]:
    """The line styles that a figure of a graph shows, by the words of the legend."""
    arcs = [arc for arc in graph.arcs if not arc.dimension]
    if by_node:
        statuses = {status for arc in arcs for status in arc.statuses}
        return {status.value: style for status, style in STATUS_STYLES.items() if status in statuses}
    if graph.verdicts is not None:
        verdicts = {span.verdict for arc in arcs for span in graph.verdicts[arc.number]}
        return {verdict: style for verdict, style in VERDICT_STYLES.items() if verdict in verdicts}
    known = {arc.index if arc.index in INDEX_STYLES else None for arc in arcs}
    return {
        "other index" if index is None else f"index {index:+d}": style
        for index, style in INDEX_STYLES.items()
        if index in known
    }


#: Entries of a legend for what is no line of a branch and no vertex, by names.
OTHERS: dict[str, tuple[Callable[..., Any], str, dict[str, Any]]] = {
    "continuum": (line_entry, "continuum", {"color": GREY, "linewidth": 2.4}),
    "sheet": (area_entry, "sheet", {"color": GREY, "alpha": 0.25, "linewidth": 0}),
    "open": (area_entry, "solutions may be missing", OPEN_RANGE),
    "dots": (line_entry, "number at that alpha alone", {"linestyle": "", "marker": ".", "color": GREY}),
}


def handles(kinds: Iterable[VertexKind], styles: Mapping[str, Any], others: set[str]) -> list[Any]:
    """Entries of a legend for what a figure shows: ``styles`` of lines; ``others`` are names in `OTHERS`."""
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


class Label(NamedTuple):
    """A text and the curve it belongs to, in data coordinates (k, 2)."""

    text: str
    colour: str
    curve: Floats


def place_labels(axis: Axes, labels: Sequence[Label], obstacles: Iterable[Floats]) -> list[Label]:
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
        text.set_position(tuple(axis.transData.inverted().transform(found).tolist()))
        text.set_gid("branch number")
    return left


def _place(
    curve: Floats, size: Floats, frame: Floats, boxes: Sequence[Floats], points: Floats, pixel: float
) -> Floats | None:
    line = dense(curve, 3.0)
    line = line[np.all((line >= frame[0] - 1) & (line <= frame[1] + 1), axis=1)]
    if not len(line):
        return None
    # distances from the curve [points]
    for away in (5.0, 9.0):
        for share in _ALONG:
            foot = line[min(int(share * len(line)), len(line) - 1)]
            for side in _SIDES:
                middle = foot + np.array(side) * (away * pixel + size / 2)
                # some pixels between labels
                low, high = middle - size / 2 - 2.0, middle + size / 2 + 2.0
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


#: Narrower than this part of the interval, a change cannot be seen.
_NARROW = 0.02


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
        # the numbers beside a narrower one would hardly differ
        if len(plateaus) == 1 or not 1e-10 * max(abs(lo), abs(hi)) < hi - lo < least:
            continue
        change = max(abs(count - plateaus[j][0]) for j in (k - 1, k + 1) if 0 <= j < len(plateaus))
        largest, first, last, width = found[-1] if found else (0, lo, float("-inf"), 0.0)
        width = min(width, hi - lo)
        if lo <= last and hi - first < least and width >= _NARROW * (hi - first):
            found[-1] = (max(change, largest), first, hi, width)
        else:
            found.append((change, lo, hi, hi - lo))
    found.sort(key=lambda item: (-item[0], item[2] - item[1]))
    # at most two are shown, with more than half of their width on both sides
    margins = [(lo, hi, 0.75 * (hi - lo)) for _, lo, hi, _ in found[:2]]
    return sorted((max(a, lo - margin), min(b, hi + margin)) for lo, hi, margin in margins)


class Panel(NamedTuple):
    """Axes with curves of arcs, by their numbers: their places side by side, branches, and the column drawn."""

    axis: Axes
    drawn: dict[int, Curve]
    places: dict[int, CurvePlace]
    branch_of: Mapping[int, int]
    column: int


def drawn_range(vertices: Iterable[Vertex], quantity: Quantity) -> Floats:
    """The range of a quantity over the vertices, by columns."""
    values = np.array([state_columns(quantity, v) for v in vertices])
    return np.asarray(np.ptp(values, axis=0))


def family_states(problem: ContactProblem, alpha: float, family: RootFamily) -> tuple[Floats, Floats]:
    """Forces and displacements at the vertices of a family, (k, 2p) each."""
    points, modes = family.vertices, problem.modes
    if modes.r:
        points = np.concatenate([part.vertices for part in family.polytopes])
    condensed = problem.on_springs.condensed
    forces = points.transpose(0, 2, 1).reshape(len(points), 2 * problem.p)
    moves = condensed.g0 + alpha * condensed.g1 - forces @ condensed.S
    if modes.r:
        rigid = [part.rigid_coordinates for part in family.polytopes if part.rigid_coordinates is not None]
        moves = moves + np.concatenate(rigid) @ (problem.contact_rows @ modes.N).T
    return forces, moves


def family_range(problem: ContactProblem, v: Vertex, quantity: Quantity, column: int) -> tuple[float, float]:
    """Smallest and largest value of the quantity at the vertices of a family, or at a single solution."""
    family = v.family
    if family is None:
        value = float(state_columns(quantity, v)[column])
        return value, value
    values = columns(quantity, *family_states(problem, v.alpha, family), problem.p)[:, column]
    return float(np.min(values)), float(np.max(values))


def sheet_range(
    problem: ContactProblem,
    roots_at: Callable[[float], RootSet],
    arc: Arc,
    ends: tuple[Vertex, Vertex],
    quantity: Quantity,
    column: int,
) -> tuple[Floats, Floats, Floats] | None:
    """Alphas with smallest and largest values on a sheet, of forces; displacements of a sheet are not drawn."""
    if quantity.dimension != "force":
        return None
    alphas, ranges = arc.sampled(9), []
    for alpha in alphas[1:-1]:
        points = np.concatenate([family.vertices for family in roots_at(float(alpha)).families])
        forces = points.transpose(0, 2, 1).reshape(len(points), -1)
        values = columns(quantity, forces, forces, problem.p)[:, column]
        ranges.append((float(values.min()), float(values.max())))
    first, last = (family_range(problem, v, quantity, column) for v in ends)
    low, high = np.array([first, *ranges, last]).T
    return alphas, low, high


def draw_steps(axis: Axes, steps: MultiplicitySteps, window: tuple[float, float]) -> bool:
    """The number of solutions over alpha; returns whether dots show other numbers at single alphas."""
    edges = [float(alpha) for alpha in steps.alphas]
    if steps.between:
        axis.stairs(steps.between, edges, color=GREY, linewidth=1.4, baseline=None)
    special = [
        (x, n)
        for k, (x, n) in enumerate(zip(edges, steps.at, strict=True))
        if n not in steps.between[max(k - 1, 0) : k + 1] and window[0] <= x <= window[1]
    ]
    if special:
        axis.plot([x for x, _ in special], [n for _, n in special], ".", color=GREY, markersize=5)
    axis.set_ylabel("solutions" if steps.exact else "solutions,\nat least")
    axis.set_ylim(0, max([*steps.between, *steps.at], default=1) * 1.1 + 0.4)
    axis.locator_params(axis="y", integer=True, nbins=5)
    plain_axes(axis)
    axis.set_xlim(*window)
    return bool(special)


def draw_open_ranges(axis: Axes, claims: Claims, window: tuple[float, float]) -> bool:
    """Shade where solutions may be missing, if that is not everywhere; returns whether some of it is seen."""
    seen = [(float(low), float(high)) for low, high in claims.open_ranges if low <= window[1] and window[0] <= high]
    if not claims.partly:
        return False
    for low, high in seen:
        axis.axvspan(max(low, window[0]), min(high, window[1]), zorder=0.4, **OPEN_RANGE)
    return bool(seen)


def draw_numbers(figure: Figure, panels: Sequence[Panel], alone: Axes | None) -> None:
    """Numbers of branches beside their curves, and a note of what coincides or has no room.

    The note stands below the figure, or below ``alone``, the only panel in a figure of the user's.
    """
    beside = any(place.among > 1 for panel in panels for place in panel.places.values())
    notes = ["branches that coincide are drawn side by side"] if beside else []
    # the note takes room itself, so that a second pass may find less of it
    for _ in range(2):
        if notes:
            text = "\n".join(notes)
            if alone is None:
                figure.supxlabel(text, fontsize=8)
            else:
                alone.set_xlabel(f"alpha\n{text}")
        figure.draw_without_rendering()
        without: set[int] = set()
        written: set[int] = set()
        for panel in panels:
            for number in [text for text in panel.axis.texts if text.get_gid() == "branch number"]:
                number.remove()
            here, missing = _number(panel)
            written |= here
            without |= missing
        without -= written
        if not without:
            return
        notes = [*notes[: int(beside)], f"no room for the numbers of branches {ranges(sorted(without))}"]


def _number(panel: Panel) -> tuple[set[int], set[int]]:
    """Write the numbers; returns those that are there, and those for which there was no room."""
    axis, drawn, places, branch_of, column = panel
    members: dict[int, set[int]] = {}
    for arc, place in places.items():
        members.setdefault(place.group, set()).add(branch_of[arc])
    polygons = {arc: np.stack([curve.alphas, curve.values[:, column]], axis=1) for arc, curve in drawn.items()}
    lengths = {arc: _pixels(axis, polygon) for arc, polygon in polygons.items()}
    visible = [arc for arc in drawn if lengths[arc] > 0]
    chosen: dict[int, int] = {}
    for branch in sorted({branch_of[arc] for arc in visible}):
        # where it runs alone, if that can be seen
        arcs = sorted(
            (arc for arc in visible if branch_of[arc] == branch),
            key=lambda arc: (places[arc].among > 1 and len(members[places[arc].group]) > 1, -lengths[arc]),
        )
        seen = [arc for arc in arcs if lengths[arc] > 20] or arcs
        chosen.setdefault(places[seen[0]].group, seen[0])
    labels = {
        group: Label(_names(sorted(members[group])), _colour(members[group]), polygons[arc])
        for group, arc in chosen.items()
    }
    marks = [np.stack(line.get_data(), axis=1) for line in axis.lines if line.get_marker() not in ("None", "", None)]
    left = place_labels(axis, list(labels.values()), [*polygons.values(), *marks])
    missing = {branch for group, label in labels.items() if label in left for branch in members[group]}
    return {branch for group in labels for branch in members[group]} - missing, missing


def _colour(branches: set[int]) -> str:
    return colour_of(*branches) if len(branches) == 1 else GREY


def _pixels(axis: Axes, polygon: Floats) -> float:
    """Length of the part that can be seen."""
    window = np.array(axis.get_window_extent())
    points = dense(axis.transData.transform(polygon), 3.0)
    inside = np.all((points >= window[0] - 1) & (points <= window[1] + 1), axis=1)
    return 3.0 * float(np.count_nonzero(inside) - 1) if np.any(inside) else 0.0


def _names(numbers: list[int]) -> str:
    if len(numbers) <= 4:
        return ", ".join(map(str, numbers))
    return f"{numbers[0]}, {numbers[1]}, .. {numbers[-1]} ({len(numbers)})"


def ranges(numbers: Iterable[int]) -> str:
    """Numbers in order as text, runs of them in short: ``1, 4-7``."""
    runs = [[n for _, n in group] for _, group in groupby(enumerate(numbers), lambda item: item[1] - item[0])]
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)
