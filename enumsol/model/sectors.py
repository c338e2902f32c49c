"""Sectors of slip directions: a binary tree over the circle whose ends are rational points (theory, section 12.2).

The circle is cut into four quarters, each of which is parametrised by s in [0, 1] as ((1 - s^2) / (1 + s^2), 2 s /
(1 + s^2)) and turned by quarters and by the angle whose cosine is 63/65 and whose sine is 16/65: no direction that
symmetry singles out is the end of a sector. Sector i >= 4 is numbered as in a binary heap: with l = 2, 3, ... the
sectors of level l are i = 2^l .. 2^(l+1) - 1; each has 2^(2-l) of the length of s, and its halves are 2 i and 2 i + 1.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache

#: The status code of sector i is SECTORS + i.
SECTORS = 8
#: Deepest level of a sector; s has that many binary digits, and all integers below are exact in float64.
DEEPEST = 28


def level_of(number: int) -> int:
    """The level of a sector."""
    return number.bit_length() - 1


@lru_cache(maxsize=1 << 16)
def start_of(number: int) -> tuple[Fraction, Fraction]:
    """Where a sector begins, a rational point of the circle: its cosine and sine, exactly."""
    place = Fraction(4 * (number - (1 << level_of(number))), 1 << level_of(number))
    quarter, s = int(place), place - int(place)
    x, y = (1 - s * s) / (1 + s * s), 2 * s / (1 + s * s)
    for _ in range(quarter):
        x, y = -y, x
    return (63 * x - 16 * y) / 65, (16 * x + 63 * y) / 65


@lru_cache(maxsize=1 << 16)
def direction(number: int) -> tuple[float, float]:
    """Where a sector begins in floats, each off by at most half a unit in the last place."""
    x, y = start_of(number)
    return float(x), float(y)


def end_number(number: int) -> int:
    """The sector of the same level that begins where this one ends."""
    first = 1 << level_of(number)
    return first + (number - first + 1) % first


def contains(number: int, other: int) -> bool:
    """Whether a sector is another one or holds it."""
    up = level_of(other) - level_of(number)
    return up >= 0 and other >> up == number


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
