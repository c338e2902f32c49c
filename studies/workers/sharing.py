"""Tasks of a search and their sizes, and from these the time that any number of workers would take.

The tasks are the same whatever the number of workers; on a cluster they are longer. They are run here one after the
other, each with its processor time; then so many workers take them in the tree's order, and a task becomes known once
the one that it follows on has ended.
"""

from __future__ import annotations

import heapq
import pickle
import time
from concurrent.futures import Executor, Future
from typing import NamedTuple
from unittest import mock

import enumsol
from enumsol.search.parts import Spread
from enumsol.support.workers import Crew

#: Seconds that a task costs more in its worker, and in the calling process: of a pool of processes, and of Dask.
COSTS = {"pool": (0.0005, 0.0015), "dask": (0.004, 0.005)}
WORKERS = 2, 8, 32, 100


class Task(NamedTuple):
    """Processor time, nodes, bytes of the answer, and the places of the tasks that follow."""

    seconds: float
    nodes: int
    size: int
    further: tuple[tuple[int, ...], ...]


class Here(Executor):
    """Runs every task at once in the calling process; takes more of them than there are."""

    _max_workers = 1 << 20

    def __init__(self):
        self.times = {}

    def submit(self, function, /, *arguments):
        """A future that is done."""
        future, started = Future(), time.process_time()
        answer = function(*arguments)
        self.times[id(answer)] = time.process_time() - started
        future.set_result(answer)
        return future


def tasks_of(problem, alpha, *, near, **limits):
    """Tasks by their place in the tree, and processor time of the calling process; of a pool, or of a cluster."""
    tasks, here, before = {}, Here(), Spread.further

    def further(self, part, answer):
        found = before(self, part, answer)
        size = len(pickle.dumps(answer))
        tasks[part.place] = Task(here.times[id(answer)], answer.nodes, size, tuple(part.place for part in found))
        return found

    with mock.patch.object(Spread, "further", further), mock.patch.object(Crew, "near", near):
        started = time.process_time()
        enumsol.enumerate_roots(problem, alpha, executor=here, **limits)
        calling = time.process_time() - started - sum(here.times.values())
    return tasks, calling


def wall(tasks, workers, in_worker, calling):
    """Seconds until the last answer is taken in, the start of the workers not counted."""
    ready, busy, now, caller = [place for place in tasks if len(place) == 1], [], 0.0, 0.0
    heapq.heapify(ready)
    while ready or busy:
        while ready and len(busy) < workers:
            place = heapq.heappop(ready)
            heapq.heappush(busy, (now + tasks[place].seconds + in_worker, place))
        now, place = heapq.heappop(busy)
        caller = max(caller, now) + calling
        for other in tasks[place].further:
            heapq.heappush(ready, other)
    return max(now, caller)


def rows_of(problem, alpha, **limits):
    """One row for each kind of executor and number of workers."""
    for kind, costs in COSTS.items():
        tasks, calling = tasks_of(problem, alpha, near=kind == "pool", **limits)
        work = sum(task.seconds for task in tasks.values())
        for workers in WORKERS:
            seconds = wall(tasks, workers, *costs)
            yield {
                "p": problem.p,
                "executor": kind,
                "workers": workers,
                "tasks": len(tasks),
                "nodes of a task": sum(task.nodes for task in tasks.values()) / len(tasks),
                "answers MB": sum(task.size for task in tasks.values()) / 1e6,
                "work s": work,
                "calling s": calling,
                "longest task s": max(task.seconds for task in tasks.values()),
                "seconds": seconds,
                "efficiency": work / (workers * seconds),
            }
