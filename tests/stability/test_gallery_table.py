"""The table of the gallery in docs/stability.md is what its script prints."""

from pathlib import Path

import pytest
from gallery_stability import NAMES, rows

PAGE = (Path(__file__).parents[2] / "docs" / "stability.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "name", ["one-node-6.1", "two-node-6.4", "wedge-8-3", pytest.param("wedge3d-4-9", marks=pytest.mark.slow)]
)
def test_rows_of_the_table(name):
    start = PAGE.index(f"| {name} | 0 |")
    for printed, row in zip(PAGE[start:].splitlines(), rows(name), strict=False):
        cells = [cell.strip() for cell in printed.strip("|").split("|")]
        assert cells[:-1] == list(row)[:-1]
        numbers = [[float(x) for x in text.split(", ") if x] for text in (cells[-1], row[-1])]
        assert numbers[0] == pytest.approx(numbers[1], rel=1e-3)


def test_every_problem_of_the_table_is_there():
    assert all(f"\n| {name} | 0 |" in PAGE for name in NAMES)
