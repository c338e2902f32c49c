"""Where a search spends its time, by looking at the stack every millisecond.

A sample belongs to the part of the innermost function of the package that the table names; the process time since the
sample before is counted for it. A function written in C is not seen itself: its time counts for the function that calls
it. Nothing is wrapped or replaced, so that the profiled search is the one that everybody runs.
"""

from __future__ import annotations

import signal
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType
    from typing import Any

REST, COPIES, ENCLOSURE = "rest", "copies", "enclosure"
#: Parts of the time and what they mean.
PARTS = {
    "QPs": "relaxations solved",
    COPIES: "states copied for children",
    "choice": "node branched on, presolve",
    "exclusion": "multipliers and inequality of a pruned leaf",
    "selections": "verified solves of complete selections",
    "proof": "records encoded and compressed",
    "ends": "scaling, constant data of the programs, result",
    REST: "Python of the tree, freeing memory",
    ENCLOSURE: "balls for S and g, once a problem",
}
#: How the names of functions end (class and method, or function) -> part.
FUNCTIONS = {
    "Engine.root": "QPs",
    "Relaxation.child": "QPs",
    "Relaxation.choose": "choice",
    "Relaxation.forced": "choice",
    "Certifier.excluded": "exclusion",
    "Certifier.selection": "selections",
    "packed": "proof",
    "ProofWriter.write": "proof",
    "ProofWriter.close": "proof",
    "ScaledSystem.from_system": "ends",
    "ActiveSetEngine.__init__": "ends",
    "connected_components": "ends",
    "RootBuilder.root": "ends",
    "ContactBody.enclosure": ENCLOSURE,
    "Enclosure.at": ENCLOSURE,
    "EnclosedSystem.smallest_eigenvalue": ENCLOSURE,
}
#: In this function itself, not in what it calls, a state is copied.
COPYING = "Relaxation.child"
#: Seconds between two samples.
EVERY = 1e-3


def ending(frame: FrameType) -> str | None:
    """The table's name of a frame's function; None for a function that is not in the table or not of the package."""
    if not str(frame.f_globals.get("__name__")).startswith("enumsol"):
        return None
    name = frame.f_code.co_qualname
    return next((known for known in FUNCTIONS if name.endswith(known)), None)


def part_of(frame: FrameType | None) -> str:
    """The part that a stack belongs to."""
    innermost = True
    while frame is not None:
        name = ending(frame)
        if name is not None:
            return COPIES if innermost and name == COPYING else FUNCTIONS[name]
        innermost, frame = False, frame.f_back
    return REST


@contextmanager
def sampled(seconds: dict[str, float]) -> Iterator[None]:
    """Add the process time of every part to ``seconds`` while the context is open."""
    last = time.process_time()

    def sample(_: int, frame: FrameType | None) -> None:
        nonlocal last
        now = time.process_time()
        seconds[part_of(frame)] += now - last
        last = now

    usual = signal.signal(signal.SIGALRM, sample)
    signal.setitimer(signal.ITIMER_REAL, EVERY, EVERY)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, usual)
        seconds[REST] += time.process_time() - last


def unknown_functions(action: Callable[[], Any]) -> list[str]:
    """Names of the table that an action calls no function of: after a renaming their time would count for others."""
    called = set()

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            called.add(ending(frame))

    sys.setprofile(note)
    try:
        action()
    finally:
        sys.setprofile(None)
    return [name for name in FUNCTIONS if name not in called]
