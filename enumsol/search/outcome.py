"""The limits of a search, its progress reports, what it found, and why it ended early."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar

from enumsol.support.deadlines import Deadline
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from enumsol.search.certifiers.protocol import UndecidedPart
    from enumsol.selections.solution import SelectionSolution


#: Advice if nothing holds a body and its searches do not come to an end.
HOLD = "hold the body by a spring or a fixed point, or give a smaller max_rigid_displacement"
#: Advice if its load is at the limit of what contact can hold.
AWAY = "change the load or the friction coefficients a little, or hold the body by a spring or a fixed point"


@dataclass(frozen=True)
class SearchProgress:
    """State of a running search, as handed to the ``progress`` callback.

    Attributes
    ----------
    nodes : int
        Partial assignments examined so far.
    covered : float
        Share of all selections accounted for, between 0 and 1.
    solutions : int
        Selections found so far that hold a root.
    seconds : float
        Wall time so far.
    resumed : int
        Nodes taken from the proof of an earlier search, which are not among ``nodes``.

    Examples
    --------
    >>> import enumsol
    >>> seen = []
    >>> roots = enumsol.enumerate_roots(enumsol.gallery.chain(4), alpha=5, progress=seen.append)
    >>> 0 < seen[-1].covered <= 1
    True
    """

    nodes: int
    covered: float
    solutions: int
    seconds: float
    resumed: int = 0


@dataclass
class SearchLimits(Deadline):
    """When to stop early."""

    enough: Callable[[list[SelectionSolution]], bool] | None = None
    max_nodes: int | None = None


@dataclass
class SearchOutcome:
    """Results of a search; filled while it runs, so that an interruption loses nothing."""

    solutions: list[SelectionSolution] = field(default_factory=list)
    undecided: list[UndecidedPart] = field(default_factory=list)
    stopped: Stop | None = None
    #: The time was over before it was known which roots the solutions form.
    late: bool = False
    nodes: int = 0
    pruned: int = 0
    selections: int = 0
    qps: int = 0
    fallback_qps: int = 0
    presolved: int = 0
    closed: int = 0
    #: Nodes taken from the proof of an earlier search.
    resumed: int = 0
    #: Nodes that its file held, and those of them that were undecided there.
    held: int = 0
    held_open: int = 0
    #: Tasks whose worker died, which were done again.
    redone: int = 0

    def forget(self) -> None:
        """Forget what was found, as the search begins again; the work that it took still counts."""
        self.solutions.clear()
        self.undecided.clear()

    def add(self, part: SearchOutcome) -> None:
        """Add what the search of a subtree found."""
        self.solutions += part.solutions
        self.undecided += part.undecided
        self.stopped = self.stopped or part.stopped
        for count in ("nodes", "pruned", "selections", "qps", "fallback_qps", "presolved", "closed", "resumed"):
            setattr(self, count, getattr(self, count) + getattr(part, count))

    def count_unexamined(self) -> None:
        """Have the reason of an early end say how many subtrees all parts of the search left; none if that is none."""
        if self.stopped is not None and self.stopped.unexamined is not None:
            left = sum(not part.examined for part in self.undecided)
            # the known root may have been all that waited
            self.stopped = replace(self.stopped, unexamined=left) if left else None


class StopReason(enum.Enum):
    """An event that ended a search before its tree did: the sentence that tells it, and advice how to go on."""

    NODE_LIMIT = "stopped after max_nodes = {done}", "raise the limit of {unit}s"
    ENOUGH_ROOTS = "stopped after enough roots", "search without stop_after"
    TIME_LIMIT = "stopped by the time limit{after}", "raise the time limit"
    INTERRUPTED = "interrupted{after}", "let it run to its end"
    OUT_OF_MEMORY = "out of memory{after}", "use more memory or a smaller problem"
    GRAPH_INCOMPLETE = "the branch graph is not complete", "use enumerate_roots"
    AT_LIMIT = "stopped{after} at the limit of what contact can hold, where rounding decides", AWAY

    def __init__(self, sentence: str, remedy: str) -> None:
        self.sentence, self.remedy = sentence, remedy

    @classmethod
    def of(cls, ending: type[BaseException]) -> StopReason:
        """Reason for the stop where an error ends a call anywhere, by Ctrl-C or a lack of memory."""
        return cls.OUT_OF_MEMORY if issubclass(ending, MemoryError) else cls.INTERRUPTED


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
        """True if it ended anywhere, by Ctrl-C or a lack of memory: the rest of the search is unaccounted for."""
        return self.reason in (StopReason.INTERRUPTED, StopReason.OUT_OF_MEMORY)

    @property
    def limited(self) -> bool:
        """True if a limit of nodes or time ended it."""
        return self.reason in (StopReason.NODE_LIMIT, StopReason.TIME_LIMIT)

    @property
    def remedy(self) -> str:
        """Advice on how a search gets to what this one left."""
        return self.reason.remedy.format(unit=self.unit)

    def __str__(self) -> str:
        done = "" if self.count is None else counted(self.count, self.unit)
        if self.arcs_of is not None:
            done = f"the arcs of {self.count} of {self.arcs_of} selections"
        text = self.reason.sentence.format(done=done, after=f" after {done}" if done else "")
        return text if self.unexamined is None else f"{text}, {counted(self.unexamined, 'subtree')} not examined"


#: Bounds of alpha, or of mu.
_Bound = TypeVar("_Bound", float, Fraction)


def joined(ranges: Iterable[tuple[_Bound, _Bound]]) -> list[tuple[_Bound, _Bound]]:
    """Ranges in their order, those that touch as one."""
    found: list[tuple[_Bound, _Bound]] = []
    for low, high in sorted(ranges):
        if found and low <= found[-1][1]:
            found[-1] = found[-1][0], max(high, found[-1][1])
        else:
            found.append((low, high))
    return found
