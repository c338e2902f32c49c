"""Sectors of slip directions: where they are, and how they are cut."""

import numpy as np
from hypothesis import given, strategies as st

from enumsol.model.sectors import DEEPEST, SECTORS, direction, is_sector, nearest, parts_around, places, span
from enumsol.model.statuses import SLIP
from enumsol.trusted.space.sector_rows import is_sector_covering


@given(st.integers(2, 20), st.integers(0, 2**20 - 1))
def test_directions_of_sectors_are_where_they_begin(level, number):
    sector = (1 << level) + number % (1 << level)
    begin, _ = span(sector)
    away = (float(places(np.array(direction(sector)))) - begin) % (1 << (DEEPEST + 2))
    assert min(away, (1 << (DEEPEST + 2)) - away) < 16
    assert nearest(*direction(sector), level) == sector


def test_slip_in_any_direction_is_the_code_of_the_whole_circle():
    assert SECTORS + 1 == SLIP


@given(st.floats(0, 2 * np.pi), st.floats(1e-300, 1e300))
def test_places_are_in_the_order_of_angles(angle, size):
    turned = angle + np.arctan2(16.0, 63.0)
    place = places(size * np.array([np.cos(turned), np.sin(turned)]))
    quarter = place / (1 << DEEPEST)
    assert abs((angle / (0.5 * np.pi) - quarter + 2) % 4 - 2) < 0.1


@given(st.integers(2, 12), st.integers(0, 2**12 - 1), st.floats(0, 1), st.floats(0, 1), st.integers(2, 20))
def test_parts_around_directions_are_the_sector(level, number, one, other, fine):
    sector = (1 << level) + number % (1 << level)
    begin, end = span(sector)
    low, high = (begin + share * (end - 1 - begin) for share in sorted((one, other)))
    parts = parts_around(sector, low, high, fine)
    assert all(map(is_sector, parts))
    spans = [span(part) for part in parts]
    assert spans[0][0] <= low
    assert high <= spans[0][1]
    assert sum(b - a for a, b in spans) == end - begin
    assert parts == (sector,) or is_sector_covering(SECTORS + sector, [SECTORS + part for part in parts], 2)
