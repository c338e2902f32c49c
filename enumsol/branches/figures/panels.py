"""Parts of the figures of branch graphs: steps, continua, sheets, and the numbers of branches."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from enumsol.branches.figures.curves import Curve, CurvePlace, Quantity, columns, state_columns
from enumsol.branches.figures.marks import GREY, OPEN_RANGE, Label, colour_of, dense, place_labels
from enumsol.support.plotting import plain_axes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from enumsol.branches.claims import Claims, MultiplicitySteps
    from enumsol.branches.elements import Arc, Vertex
    from enumsol.model.problem import ContactProblem
    from enumsol.roots.root import RootFamily
    from enumsol.roots.root_set import RootSet
    from enumsol.support.array_types import Floats


class Panel(NamedTuple):
    """Axes with curves of arcs, by their numbers: their places side by side, branches, and the column drawn."""

    axis: Any
    drawn: dict[int, Curve]
    places: dict[int, CurvePlace]
    branch_of: Mapping[int, int]
    column: int


#: Points of a sheet, and branches that a label names one by one.
_SHEET, _NAMED = 9, 4


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
    alphas, ranges = arc.sampled(_SHEET), []
    for alpha in alphas[1:-1]:
        points = np.concatenate([family.vertices for family in roots_at(float(alpha)).families])
        forces = points.transpose(0, 2, 1).reshape(len(points), -1)
        values = columns(quantity, forces, forces, problem.p)[:, column]
        ranges.append((float(values.min()), float(values.max())))
    first, last = (family_range(problem, v, quantity, column) for v in ends)
    low, high = np.array([first, *ranges, last]).T
    return alphas, low, high


def draw_steps(axis: Any, steps: MultiplicitySteps, window: tuple[float, float]) -> bool:
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
    axis.yaxis.get_major_locator().set_params(integer=True, nbins=5)
    plain_axes(axis)
    axis.set_xlim(*window)
    return bool(special)


def draw_open_ranges(axis: Any, claims: Claims, window: tuple[float, float]) -> bool:
    """Shade where solutions may be missing, if that is not everywhere; returns whether some of it is seen."""
    seen = [(float(low), float(high)) for low, high in claims.open_ranges if low <= window[1] and window[0] <= high]
    if not claims.partly:
        return False
    for low, high in seen:
        axis.axvspan(max(low, window[0]), min(high, window[1]), zorder=0.4, **OPEN_RANGE)
    return bool(seen)


def draw_numbers(figure: Any, panels: Sequence[Panel], alone: Any) -> None:
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
            for text in [text for text in panel.axis.texts if text.get_gid() == "branch number"]:
                text.remove()
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


def _pixels(axis: Any, polygon: Floats) -> float:
    """Length of the part that can be seen."""
    window = axis.get_window_extent()
    points = dense(axis.transData.transform(polygon), 3.0)
    inside = np.all((points >= window.min - 1) & (points <= window.max + 1), axis=1)
    return 3.0 * float(np.count_nonzero(inside) - 1) if np.any(inside) else 0.0


def _names(numbers: list[int]) -> str:
    if len(numbers) <= _NAMED:
        return ", ".join(map(str, numbers))
    return f"{numbers[0]}, {numbers[1]}, .. {numbers[-1]} ({len(numbers)})"


def ranges(numbers: Iterable[int]) -> str:
    """Numbers in order as text, runs of them in short: ``1, 4-7``."""
    runs = [[n for _, n in group] for _, group in groupby(enumerate(numbers), lambda item: item[1] - item[0])]
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs)
