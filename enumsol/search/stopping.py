"""Why a search ended early."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from enumsol.support.messages import counted


class StopReason(enum.Enum):
    """What ended a search before its tree did."""

    NODE_LIMIT = enum.auto()
    ENOUGH_ROOTS = enum.auto()
    TIME_LIMIT = enum.auto()
    INTERRUPTED = enum.auto()
    GRAPH_INCOMPLETE = enum.auto()


@dataclass(frozen=True)
class Stop:
    """Why a search ended early, and how far it came; ``str`` gives the sentence that results show.

    Attributes
    ----------
    reason : StopReason
    count : int or None
        The limit (NODE_LIMIT), or the number done by then (INTERRUPTED).
    unit : str
        What ``count`` counts: "node" or "selection".
    arcs_of : int or None
        Number of selections whose arcs were wanted, if that stage was ended and not the search.
    unexamined : int or None
        Subtrees that are listed as not examined; None where the search keeps no such list.
    """

    reason: StopReason
    count: int | None = None
    unit: str = "node"
    arcs_of: int | None = None
    unexamined: int | None = None

    @property
    def interrupted(self) -> bool:
        """Whether the user pressed Ctrl-C: the rest of the search is unaccounted for."""
        return self.reason is StopReason.INTERRUPTED

    def __str__(self) -> str:
        done = "" if self.count is None else counted(self.count, self.unit)
        if self.arcs_of is not None:
            done = f"the arcs of {self.count} of {self.arcs_of} selections"
        text = {
            StopReason.NODE_LIMIT: f"stopped after max_nodes = {done}",
            StopReason.ENOUGH_ROOTS: "stopped after enough roots",
            StopReason.TIME_LIMIT: "stopped by the time limit" + (f" after {done}" if done else ""),
            StopReason.INTERRUPTED: f"interrupted after {done}",
            StopReason.GRAPH_INCOMPLETE: "the branch graph is not complete",
        }[self.reason]
        return text if self.unexamined is None else f"{text}, {counted(self.unexamined, 'subtree')} not examined"
