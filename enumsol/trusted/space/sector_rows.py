"""The trusted core in 3D: branchings and rows (theory, section 12.2)."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from enumsol.model import sectors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.support.array_types import Floats, Indices


OPEN, STICK, SLIP_PLUS, SLIP_MINUS, FRICTIONLESS, CONTACT, UNDECIDED = range(7)
#: Kinds of rows (theory, section 12.2); a row is (kind, node, number), the number that of a direction or sector.
GAP, FORCE, TAU, SLIP, END, ALONG, TANGENT, CHORD, LEFT, RIGHT = range(10)
#: Rows in which lambda_n has the radius of the disc as a factor.
OF_DISCS = END, TANGENT, CHORD
FORBIDDEN, NONNEGATIVE, FREE = range(3)
Row = tuple[int, int, int]
#: Rows whose terms and signs are kept: the same ones occur in many exclusions.
_KEPT = 1 << 16


def sector_children(code: int, tangents: int) -> tuple[int, ...]:
    """Codes that together cover a partial status of a node with so many components of tau; empty for a final one."""
    if code == UNDECIDED:
        return (OPEN, CONTACT) if tangents else (OPEN, FRICTIONLESS)
    if code == CONTACT:
        if tangents == 1:
            return STICK, SLIP_PLUS, SLIP_MINUS
        return STICK, *(sectors.SECTORS + i for i in range(4, 8))
    if code > sectors.SECTORS:
        one, other = sectors.cut(code - sectors.SECTORS, 0, 1)
        return sectors.SECTORS + one, sectors.SECTORS + other
    return ()


def is_sector_covering(code: int, children: Sequence[int], tangents: int) -> bool:
    """True if statuses, in any order, cover a partial one: those of ``sector_children``, or any parts of a sector."""
    if code <= sectors.SECTORS:
        return bool(children) and sorted(children) == sorted(sector_children(code, tangents))
    numbers = [child - sectors.SECTORS for child in children]
    if len(numbers) < 2 or not all(
        sectors.is_sector(number) and sectors.level_of(number) <= sectors.DEEPEST + 1 for number in numbers
    ):
        return False
    spans = sorted(map(sectors.span, numbers))
    begin, end = sectors.span(code - sectors.SECTORS)
    return [a for a, _ in spans] + [end] == [begin] + [b for _, b in spans]


def is_within(code: int, over: int) -> bool:
    """True if a status is allowed by another one, which is neither undecided nor narrower."""
    if code == over:
        return True
    if over == CONTACT:
        return code not in (OPEN, UNDECIDED)
    both = over > sectors.SECTORS and code > sectors.SECTORS
    return both and sectors.contains(over - sectors.SECTORS, code - sectors.SECTORS)


def leaf_code(code: int, tau: Sequence[int], towards: Sequence[float] | Floats, level: int) -> int:
    """The code of a node in a leaf, by its status: open, stick, and any other one for contact with slip.

    Parameters
    ----------
    tau : places of both components, -1 where there is none
    towards : (2,), of friction over its coefficients, or of the slip
    level : of the sector
    """
    occurs = [k for k in range(2) if tau[k] >= 0]
    if code == OPEN or not occurs:
        return OPEN if code == OPEN else FRICTIONLESS
    if code == STICK:
        return STICK
    if len(occurs) == 1:
        return SLIP_PLUS if towards[occurs[0]] > 0 else SLIP_MINUS
    return sectors.SECTORS + sectors.holding(towards, level)


@lru_cache(maxsize=_KEPT)
def row_sign(code: int, row: Row) -> int:
    """Sign that the multiplier of a row may have at a node of this code."""
    kind, _, number = row
    if kind == GAP:
        return NONNEGATIVE if code in (OPEN, UNDECIDED) else FREE
    if kind == FORCE:
        return FREE if code == OPEN else NONNEGATIVE
    if kind == TAU:
        return FREE if code == OPEN else FORBIDDEN
    if kind == SLIP:
        return FREE if code == STICK else FORBIDDEN
    if kind == END:
        return FREE if code == (SLIP_PLUS if number > 0 else SLIP_MINUS) else NONNEGATIVE
    if kind == ALONG:
        return NONNEGATIVE if code == (SLIP_PLUS if number > 0 else SLIP_MINUS) else FORBIDDEN
    if kind == TANGENT:
        return NONNEGATIVE
    return NONNEGATIVE if code > sectors.SECTORS and sectors.contains(number, code - sectors.SECTORS) else FORBIDDEN


def sector_row_terms(row: Row, tau: Indices, size: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """A row as a sum over y and, from ``size`` on, over w: indices and coefficients, off by half a unit at most.

    Raises
    ------
    ValueError
        The node has no such row.
    """
    t1, t2 = tau[row[1]]
    return row_terms(row, int(t1), int(t2), size)


@lru_cache(maxsize=_KEPT)
def row_terms(row: Row, t1: int, t2: int, size: int) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Terms of ``sector_row_terms`` for the places of the node's tau."""
    kind, node, number = row
    if kind == GAP:
        return (size + node,), (-1.0,)
    if kind == FORCE:
        return (node,), (1.0,)
    if kind in (TAU, SLIP):
        t = (t1, t2)[number] if number in (0, 1) else -1
        _exists(t >= 0)
        return (t if kind == TAU else size + t,), (1.0,)
    if kind in (END, ALONG):
        _exists((t1 < 0) != (t2 < 0) and number in (1, -1))
        t = max(t1, t2)
        return ((node, t), (1.0, -float(number))) if kind == END else ((size + t,), (float(number),))
    _exists(t1 >= 0 and t2 >= 0 and number >= 4)
    x, y = sectors.direction(number)
    if kind == TANGENT:
        _exists(number < sectors.RUN)
        return (node, t1, t2), (1.0, -x, -y)
    _exists(sectors.is_sector(number))
    if kind == CHORD:
        along, across, most = sectors.chord_of(number)
        return (t1, t2, node), (along, across, -most)
    p, q = sectors.direction(sectors.end_number(number))
    return ((size + t1, size + t2), (-y, x)) if kind == LEFT else ((size + t1, size + t2), (q, -p))


def _exists(condition: bool) -> None:
    if not condition:
        raise ValueError("a node has no such row")
