"""How branches, arcs and vertices look in figures: colours, line styles, markers, and their names in the legend."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from enumsol.branches.elements import VertexKind
from enumsol.model.statuses import ContactStatus

if TYPE_CHECKING:
    from collections.abc import Iterable

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


def handles(
    kinds: Iterable[VertexKind], statuses: Iterable[ContactStatus], indices: Iterable[int | None], others: set[str]
) -> list[Any]:
    """Entries of a legend for what a figure shows; ``others`` are among "continuum", "sheet", "dots"."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    shown_kinds, shown = set(kinds), set(statuses)
    found: list[Any] = [
        Line2D([], [], color="#666666", linestyle=style, label=status.value)
        for status, style in STATUS_STYLES.items()
        if status in shown
    ]
    known = {index if index in INDEX_STYLES else None for index in indices}
    found += [
        Line2D([], [], color="#666666", linestyle=style, label="other index" if k is None else f"index {k:+d}")
        for k, style in INDEX_STYLES.items()
        if k in known
    ]
    found += [
        Line2D([], [], linestyle="", marker=marker, color=GREY, markerfacecolor=face, markersize=4.5, label=label)
        for kind, (marker, face, label) in MARKERS.items()
        if kind in shown_kinds
    ]
    if "continuum" in others:
        found.append(Line2D([], [], color=GREY, linewidth=2.4, label="continuum"))
    if "sheet" in others:
        found.append(Patch(color=GREY, alpha=0.25, linewidth=0, label="sheet"))
    if "dots" in others:
        found.append(Line2D([], [], linestyle="", marker=".", color=GREY, label="number at that alpha alone"))
    return found
