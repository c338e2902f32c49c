"""Sectors of slip directions: a binary tree over the circle whose ends are rational points (theory, section 12.2).

The circle is cut into four quarters, each of which is parametrised by s in [0, 1] as ((1 - s^2) / (1 + s^2), 2 s /
(1 + s^2)) and turned by quarters and by the angle whose cosine is 63/65 and whose sine is 16/65: no direction that
symmetry singles out is the end of a sector. Sector i >= 4 is numbered as in a binary heap: with l = 2, 3, ... the
sectors of level l are i = 2^l .. 2^(l+1) - 1; each has 2^(2-l) of the length of s, and its halves are 2 i and 2 i + 1.
What a slice leaves of a sector is a sector, too: count sectors of level l in a row, the first of which is i, within one
quarter; its number is i + (count - 1) RUN.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from enumsol.support.array_types import Floats

#: The status code of sector i is SECTORS + i; that of the whole circle, sector 1, is SLIP of ``model.statuses``.
SECTORS = 8
#: Deepest level of a sector; s has that many binary digits, and all integers below are exact in float64.
DEEPEST = 28
#: Factor of the length of a run of sectors in its number; larger than all numbers of single ones, those in rows too.
RUN = 1 << (DEEPEST + 3)


def start_number(number: int) -> int:
    """The single sector of the same level that begins where this one does."""
    return number & (RUN - 1)


def level_of(number: int) -> int:
    """The level of a sector; of a run that of its parts."""
    return start_number(number).bit_length() - 1


def count_of(number: int) -> int:
    """Number of sectors of its level of which a sector consists."""
    return 1 + number // RUN


def run_of(first: int, count: int) -> int:
    """The number of so many sectors in a row: with the largest parts of which there are whole ones."""
    while not (first | count) & 1:
        first, count = first >> 1, count >> 1
    return first + (count - 1) * RUN


def width_level(number: int) -> int:
    """The level of the narrowest single sectors that are at least as wide as a sector."""
    return level_of(number) - (count_of(number) - 1).bit_length()


@lru_cache(maxsize=1 << 16)
def span(number: int) -> tuple[int, int]:
    """Begin and end of a sector, in sectors of level DEEPEST + 2 from the beginning of the circle."""
    level = level_of(number)
    begin = start_number(number) - (1 << level)
    return begin << (DEEPEST + 2 - level), (begin + count_of(number)) << (DEEPEST + 2 - level)


@lru_cache(maxsize=1 << 16)
def start_of(number: int) -> tuple[Fraction, Fraction]:
    """Begin of a sector, a rational point of the circle: its cosine and sine, exactly."""
    number = start_number(number)
    place = Fraction(4 * (number - (1 << level_of(number))), 1 << level_of(number))
    quarter, s = int(place), place - int(place)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    for _ in range(quarter):
        x, y = -y, x
    return (63 * x - 16 * y) / 65, (16 * x + 63 * y) / 65


@lru_cache(maxsize=1 << 16)
def direction(number: int) -> tuple[float, float]:
    """Begin of a sector in floats, each off by at most half a unit in the last place."""
    x, y = start_of(number)
    return float(x), float(y)


def is_sector(number: int) -> bool:
    """True if there is a sector of this number, which lies within one quarter."""
    if number < 0 or start_number(number) < 4:
        return False
    up, first = level_of(number) - 2, start_number(number)
    return first >> up == (first + count_of(number) - 1) >> up


def cut(number: int, end: int, halvings: int) -> tuple[int, int]:
    """A slice of a sector at its beginning (end 0) or its end (1), and what is left of it.

    The slice has 2^-halvings of its parts, rounded down; if there are fewer parts than that, they are halved first.
    """
    first, count = start_number(number), count_of(number)
    while not count >> halvings:
        first, count = 2 * first, 2 * count
    part = count >> halvings
    if end:
        return run_of(first + count - part, part), run_of(first, count - part)
    return run_of(first, part), run_of(first + part, count - part)


def width_of(number: int) -> float:
    """The share of the circle's length in s that a sector has."""
    return math.ldexp(count_of(number), -level_of(number))


def end_number(number: int) -> int:
    """The single sector of the same level that begins where this one ends."""
    first = 1 << level_of(number)
    return first + (start_number(number) - first + count_of(number)) % first


@lru_cache(maxsize=1 << 16)
def chord_of(number: int) -> tuple[float, float, float]:
    """d_a + d_b and 1 + d_a . d_b of the ends of a sector in floats, each off by at most half a unit.

    A sum of rounded ends would lose digits where an axis is near the middle of a long run.
    """
    (x, y), (p, q) = start_of(number), start_of(end_number(number))
    return float(x + p), float(y + q), float(1 + x * p + y * q)


def middle_number(number: int) -> int:
    """The single sector of one level more that begins in the middle of this one."""
    return 2 * start_number(number) + count_of(number)


def around(numbers: Sequence[int]) -> int:
    """The narrowest single sector that holds all of these and is wider than the first one."""
    spans = [span(number) for number in numbers]
    begin, end = min(a for a, _ in spans), max(b for _, b in spans)
    a, b = spans[0]
    up = max((begin ^ (end - 1)).bit_length(), (b - a).bit_length())
    return ((1 << (DEEPEST + 2)) + begin) >> up


def contains(number: int, other: int) -> bool:
    """True if a sector is another one or holds it."""
    (a, b), (c, d) = span(number), span(other)
    return a <= c and d <= b


def nearest(x: float, y: float, level: int) -> int:
    """The sector of a level that begins nearest to the direction of (x, y)."""
    # turned back by the angle of (63, 16)
    x, y = 63.0 * x + 16.0 * y, 63.0 * y - 16.0 * x
    size = math.hypot(x, y)
    quarter = 0
    while not (x > 0 and y >= 0) and quarter < 4:
        x, y = y, -x
        quarter += 1
    s = y / (size + x) if size > 0 else 0.0
    count = 1 << level
    return count + round((quarter % 4 + s) * (count >> 2)) % count


def places(vectors: Floats) -> Floats:
    """Places of the directions of vectors, (..., 2), along the circle, in sectors of level DEEPEST + 2."""
    x, y = 63.0 * vectors[..., 0] + 16.0 * vectors[..., 1], 63.0 * vectors[..., 1] - 16.0 * vectors[..., 0]
    quarter = np.floor(np.arctan2(y, x) / (0.5 * np.pi)) % 4
    for k in (1, 2, 3):
        turned = quarter >= k
        x, y = np.where(turned, y, x), np.where(turned, -x, y)
    size = np.hypot(x, y)
    s = np.clip(y / np.where(size > 0, size + x, 1.0), 0.0, 1.0)
    return np.asarray(np.ldexp(quarter + s, DEEPEST))


def holding(vector: Sequence[float] | Floats, level: int) -> int:
    """The sector of a level that holds the direction of a vector."""
    first = 1 << level
    return first + (int(places(np.asarray(vector, dtype=np.float64))) >> (DEEPEST + 2 - level)) % first


def parts_around(number: int, low: float, high: float, level: int) -> tuple[int, ...]:
    """A sector in at most three parts, whose middle one holds what is between two places, by sectors of a level."""
    up = max(DEEPEST + 2 - max(level, level_of(number)), 0)
    begin, end = (place >> up for place in span(number))
    first, last = max(math.floor(low) >> up, begin), min((math.floor(high) >> up) + 1, end)
    all_of = 1 << (DEEPEST + 2 - up)
    inner = [(first, last), (begin, first), (last, end)]
    return tuple(run_of(all_of + a, b - a) for a, b in inner if a < b)
