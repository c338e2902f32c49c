"""Blocks and wedges of the gallery under the loads that the studies of the search have in common."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from enumsol import gallery

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol import ContactProblem

#: Tractions on a block's top: pressed, pressed straight down, and dragged more than pressed.
PRESSED, STRAIGHT, DRAGGED = (0.3, -1.0), (0.0, -1.0), (1.0, -0.3)
#: A pull on the wedge along its axis leaves three roots, an oblique one five.
OBLIQUE = (4e-4, 1e-3)


class Loaded(NamedTuple):
    """A problem to be made, and the alpha at which it is solved."""

    name: str
    p: int
    build: Callable[[], ContactProblem]
    alpha: float


def block(p: int, traction: tuple[float, float], F: float, length: float = 1.0) -> Loaded:
    """A clamped block with p contact nodes, half as many cells high."""
    name = f"block {p} ({traction[0]:g}, {traction[1]:g}), length {length:g}"
    return Loaded(name, p, partial(gallery.clamped_block, p, p // 2, length, traction=traction), F)


def straight_wedge(p: int) -> Loaded:
    """A wedge with p contact nodes, pulled along its axis."""
    return Loaded(f"wedge {p} straight", p, partial(gallery.wedge, 4, p // 2), 1.0)


def oblique_wedge(p: int) -> Loaded:
    """The same, pulled obliquely."""
    return Loaded(f"wedge {p} oblique", p, partial(gallery.wedge, 4, p // 2, OBLIQUE), 2.2)
