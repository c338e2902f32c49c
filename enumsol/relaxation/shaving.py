"""When slices are cut off the ends of sectors, and when leaves are tested, in 3D (theory, section 12.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from enumsol.model.sectors import SECTORS, width_level, width_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from enumsol.selections.solution import Codes

#: A slice is this power of 1/2 of its sector: at first, and at least.
FIRST, THINNEST = 1, 2
#: An end that kept the thinnest slice is tried again when the product of all widths is less than half of what it was.
_AGAIN = 1.0
#: A leaf whose sectors all have this level or a deeper one is tested before anything is cut off. A sector in which
#: nothing is violated is not cut from this level on: near a degenerate root that would go on for many levels.
NARROW = 8
#: The next test is made when the sectors have become narrower by this power of 1/2 on average.
_NARROWER = 0.5


@dataclass
class Shaving:
    """What is known at a node of the tree about its sectors, from it and from those above it.

    Attributes
    ----------
    tried : by contact node and end (0, 1), what the next slice is and log2 of the product of all widths before it
    tested : log2 of the product of all widths when the leaf was tested last
    """

    tried: dict[tuple[int, int], tuple[int, float]] = field(default_factory=dict)
    tested: float = math.inf

    def copy(self) -> Shaving:
        """What a child begins with."""
        return Shaving(dict(self.tried), self.tested)

    def sectors(self, codes: Codes, violated: Sequence[bool]) -> list[int]:
        """Nodes whose sectors may be cut, the widest first; ``violated``, by node, where maximum dissipation is."""
        there = [i for i, code in enumerate(codes) if code > SECTORS]
        nodes = [i for i in there if violated[i] or width_level(codes[i] - SECTORS) < NARROW]
        return sorted(nodes, key=lambda i: -width_of(codes[i] - SECTORS))

    def shares(self, codes: Codes, node: int, end: int) -> Iterator[int]:
        """The slices to be tried at an end of a sector, as numbers of halvings, one after the other."""
        halvings, before = self.tried.get((node, end), (FIRST, math.inf))
        if halvings > THINNEST:
            if before - _size(codes) < _AGAIN:
                return
            halvings = THINNEST
        yield from range(halvings, THINNEST + 1)

    def note(self, codes: Codes, node: int, end: int, halvings: int, *, excluded: bool) -> None:
        """Take note of what came of a slice: after one that is excluded a wider one is tried, else a thinner one."""
        self.tried[node, end] = (max(halvings - 1, FIRST) if excluded else halvings + 1), _size(codes)

    def leaf_is_due(self, codes: Codes) -> bool:
        """Whether a leaf is to be tested now; if so, that is noted."""
        levels = [width_level(code - SECTORS) for code in codes if code > SECTORS]
        if not levels or min(levels) < NARROW or self.tested - _size(codes) < _NARROWER * len(levels):
            return False
        self.tested = _size(codes)
        return True


def _size(codes: Codes) -> float:
    """Log2 of the product of the widths of all sectors."""
    return math.fsum(math.log2(width_of(code - SECTORS)) for code in codes if code > SECTORS)
