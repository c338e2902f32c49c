"""Calls that Ctrl-C or a lack of memory may end anywhere, and that keep what was found by then."""

from __future__ import annotations

import time
from contextvars import copy_context
from typing import TYPE_CHECKING, TypeVar

from enumsol.errors import Interrupted, OutOfMemoryError
from enumsol.support.deadlines import Deadline, within

if TYPE_CHECKING:
    from collections.abc import Callable

    #: Types of the errors that end a call from outside.
    Ending = type[Interrupted] | type[OutOfMemoryError]

_Result = TypeVar("_Result")


def keeping(
    name: str, work: Callable[[], _Result], rest: Callable[[Ending], _Result], said: Callable[[_Result], str]
) -> _Result:
    """The result of a call, or an error that holds what was found before Ctrl-C, or until there was no memory.

    Python raises KeyboardInterrupt between any two instructions, also where a result is put together. So ``rest`` puts
    it together anew, from what ``work`` left; it begins again if it is itself interrupted.

    Parameters
    ----------
    name : str
        Of the call, for the message.
    work : callable
        The call. What it sets in its context, such as deadlines, is forgotten even if it does not come to its end.
    rest : callable
        Gives the result of what was found so far, in a moment. It may be called several times.
    said : callable
        Gives the rest of the message, from the partial result.

    Raises
    ------
    Interrupted, OutOfMemoryError
        ``partial`` is what ``rest`` gives.
    """
    ending: Ending
    try:
        return copy_context().run(work)
    except KeyboardInterrupt:
        ending = Interrupted
    except MemoryError:
        ending = OutOfMemoryError
    # here the error is gone, and with it what the frames of the work held
    # somebody waits for the result: what takes longer to be put together is left out
    end = Deadline(time.perf_counter() + 1.0)
    # it begins again if Ctrl-C comes meanwhile: somebody may press it twice, and `timeout` sends it twice
    for _ in range(8):
        try:
            partial = copy_context().run(_within, end, rest, ending)
            message = f"{name} {ending.happened}{said(partial)}"
            break
        except KeyboardInterrupt:
            continue
        except MemoryError:
            raise OutOfMemoryError(f"{name} {OutOfMemoryError.happened}, and nothing could be kept", None) from None
    else:
        raise KeyboardInterrupt
    raise ending(message, partial)


def _within(end: Deadline, rest: Callable[[Ending], _Result], ending: Ending) -> _Result:
    with within(end):
        return rest(ending)
