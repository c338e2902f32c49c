"""How much faster are several workers than one, and what does it cost to share a search?

Searched is a wedge that jams (4 by p / 2, pull (4e-4, 1e-3), alpha 2.2; five roots), verified and with its proof,
without workers and by one, two and more: of a process pool, and of a cluster of Dask on this machine (``dask``; ``dask,
unwatched`` where its workers do not sample their own stacks), all started before the clock. Every size is searched
``--repeat`` times in turn, and the shortest time of each counts. ``cpu`` is the time of all processes in which they
compute, with the start of the workers; more than without workers is what sharing costs.

Read ``efficiency`` (the time without workers, divided by the time and the number of workers). The proofs of all numbers
of workers of a kind must be the same file. Nothing else may run on the machine, and threads of linear algebra must be
off (OMP_NUM_THREADS=1).

``--size 64 --repeat 1`` is a search of two minutes. ``calling`` is the part of ``cpu`` that the
calling process takes, which puts the proof together: what it takes on a machine that has no more processors than there
are workers these have to do without.

A wedge with p = 96 was searched once by two workers of Dask on a busy machine: one of them was killed after 80 s,
the search was stopped after 200 s (537,549 nodes) and resumed from its file. It came to its end with 5 roots, complete,
after 3,145,275 nodes in all; the proof of 1.3 GB was checked and accepted in 199 s of the processor.

``sharing`` says what more workers would take, from the tasks of the same search and what one costs in a pool and on a
cluster of Dask (``sharing.py``): nothing of it is measured but the tasks, one after the other in one process.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import resource
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import dask
import numpy as np
from distributed import Client, LocalCluster

import enumsol
from workers.sharing import rows_of as shared_rows

if TYPE_CHECKING:
    from shared.results import Run

#: Contact nodes of the wedge: a minute or so, and a second.
SIZE, SMOKE_SIZE = 48, 16
KINDS = "pool", "dask", "dask, unwatched"


def options(parser):
    parser.add_argument("--size", type=int, nargs="+", default=None, help=f"contact nodes (default {SIZE})")
    parser.add_argument("--repeat", type=int, default=3, help="searches of each kind (default 3)")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2], help="numbers of workers (default 1 2)")


def cpu():
    """Seconds of this process, and of those that it has waited for."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return np.array([usage.ru_utime + usage.ru_stime for usage in usages])


@contextmanager
def crew(kind, workers):
    """An executor whose workers are there, and have imported what they need; None without workers."""
    if not workers:
        yield None
    elif kind == "pool":
        with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
            list(pool.map(_warm, range(4 * workers)))
            yield pool
    else:
        with (
            dask.config.set({"distributed.worker.profile.enabled": kind == "dask"}),
            LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0") as cluster,
            Client(cluster) as client,
        ):
            client.gather(client.map(_warm, range(4 * workers), pure=False))
            yield client


def search(problem, kind, workers, path):
    """Root set, seconds, and seconds of this process and of workers; no workers: in this process."""
    before = cpu()
    with crew(kind, workers) as executor:
        started = time.perf_counter()
        roots = enumsol.enumerate_roots(problem, 2.2, proof_path=path, executor=executor)
        seconds = time.perf_counter() - started
    return roots, seconds, cpu() - before


def _warm(_):
    import enumsol.search.setup  # noqa: F401 (in the worker)

    time.sleep(0.05)


def row(problem, kind, workers, repeat, folder):
    """The shortest of several searches."""
    path = f"{folder}/{workers}.proof"
    found = [search(problem, kind, workers, path) for _ in range(repeat)]
    roots, seconds, (calling, others) = min(found, key=lambda entry: entry[1])
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()[:12]
    return {
        "p": problem.p,
        "kind": kind if workers else "none",
        "workers": workers or "none",
        "nodes": roots.stats.nodes,
        "roots": len(roots),
        "complete": roots.complete,
        "seconds": seconds,
        "cpu": calling + others,
        "calling": calling,
        "proof": digest,
        "accepted": enumsol.verify(problem, enumsol.Proof.load(path)).complete,
    }


def rows_of(size, counts, repeat):
    """Searches of one wedge without workers, and with each number of them of every kind."""
    problem = enumsol.gallery.wedge(4, size // 2, pull=(4e-4, 1e-3))
    problem.condensed  # noqa: B018 (made once, outside the clock)
    with TemporaryDirectory() as folder:
        rows = [row(problem, "none", 0, repeat, folder)]
        rows += [row(problem, kind, workers, repeat, folder) for kind in KINDS for workers in counts]
    for entry in rows:
        entry["efficiency"] = rows[0]["seconds"] / (
            entry["seconds"] * (entry["workers"] if entry["kind"] != "none" else 1)
        )
    return rows


def main(run: Run) -> None:
    sizes = getattr(run.options, "size", None) or [SMOKE_SIZE if run.smoke else SIZE]
    repeat = 1 if run.smoke else getattr(run.options, "repeat", 3)
    counts = getattr(run.options, "workers", [1, 2])
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    rows = [entry for size in sizes for entry in rows_of(size, counts, repeat)]
    # tasks of a cluster are longer than those of a pool, and proofs follow the tasks
    proofs = {(entry["p"], entry["kind"][:4], entry["proof"]) for entry in rows if entry["workers"] != "none"}
    right = all(entry["complete"] and entry["accepted"] for entry in rows)
    run.table(
        "workers",
        rows,
        f"{os.cpu_count()} processors; the shortest of {repeat}",
        f"load of the machine before, which should be near 0: {load:.1f}",
        f"all complete and checked: {'yes' if right else 'no'}; one proof whatever the number of workers: "
        f"{'yes' if len(proofs) == 2 * len(sizes) else 'no'}",
    )
    shared = [row for size in sizes for row in shared_rows(enumsol.gallery.wedge(4, size // 2, pull=(4e-4, 1e-3)), 2.2)]
    most = [row for row in shared if row["workers"] == max(entry["workers"] for entry in shared)]
    run.table(
        "sharing",
        shared,
        *(
            f"p = {row['p']}, {row['executor']}: {row['workers']} workers would take {row['seconds']:.2f} s, "
            f"{row['efficiency']:.2f} of them busy"
            for row in most
        ),
    )
