"""What decides a place that a graph leaves open: the words of all ways to make a graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.model.statuses import contact_status
from enumsol.roots.root import summary

if TYPE_CHECKING:
    from enumsol.support.array_types import Codes

END_ELSEWHERE = "an interval that ends elsewhere decides it"
ANOTHER_INTERVAL = "another interval, or data that differ by a little, may decide it"
SHORT_INTERVAL = "a graph over a short interval around it may decide it"
MORE_TIME, MORE_NODES = "more time may decide it", "more nodes may decide it"
TOLD_APART = "data that differ by a little may tell it apart"
FEWER = "data that differ by a little may leave fewer"
#: Of what contradicts the search.
DEFECT = 'arithmetic="verified" decides it if the search was "fast"; otherwise this is a defect: please report it'


def named(codes: Codes) -> str:
    """A selection as text, with the statuses of its nodes in their order."""
    return f"the selection {summary([contact_status(code, 0.0) for code in codes])}"
