"""Process times."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


def timed(action: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """What an action returns, and its process time."""
    started = time.process_time()
    answer = action(*arguments)
    return answer, time.process_time() - started


def least_time(make: Callable[[], Any], action: Callable[[Any], Any], *, runs: int, enough: float) -> tuple[Any, float]:
    """The last answer of ``action(make())`` and the least process time of some runs; ``make`` is outside the clock.

    A run that takes longer than ``enough`` seconds is the last one.
    """
    best = math.inf
    for _ in range(runs):
        answer, seconds = timed(action, make())
        best = min(best, seconds)
        if seconds > enough:
            break
    return answer, best
