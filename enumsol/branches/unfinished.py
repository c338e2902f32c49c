"""Arcs that are not worked out to their end: what bounds the work, and what decides a place that is left open."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

from enumsol.model.statuses import contact_status
from enumsol.roots.root import summary
from enumsol.search.outcome import StopReason
from enumsol.support.deadlines import Deadline, Limited, TimeOverError, look, within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from enumsol.support.array_types import Codes

    #: Called with the share of the work that is done.
    Tick = Callable[[float], object]

_Item = TypeVar("_Item")

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


@dataclass(frozen=True)
class Effort:
    """Bounds of the work on arcs.

    Attributes
    ----------
    tick : callable, optional
    limits : Limited
        What is not worked out by this deadline is left out.
    ended : StopReason, optional
        Reason for a bound of the work: the call was ended, and only little more of what it found is worked out.
    most : int, optional
        Nothing more is begun after so much.
    """

    tick: Tick | None = None
    limits: Limited = field(default_factory=Deadline)
    ended: StopReason | None = None
    most: int | None = None

    def over(
        self, items: Sequence[_Item], together: int, work: Callable[[Sequence[_Item]], object], done: Callable[[], int]
    ) -> StopReason | None:
        """Reason why not all items were worked out, so many together; None where they were.

        ``done`` gives how much there is, in the unit of ``most``.
        """
        for first in range(0, len(items), together):
            group = items[first : first + together]
            if self.most is not None and done() >= self.most:
                return self.ended
            try:
                with within(self.limits):
                    look()
                    work(group)
            except TimeOverError:
                return self.ended or StopReason.TIME_LIMIT
            if self.tick is not None:
                self.tick((first + len(group)) / len(items))
        return self.ended if self.most == 0 else None
