"""What do histories of loading show: fretting loops, jamming and pulling out, maps; and what does a step cost?

Fretting: a sphere on an elastic halfspace, pressed and then moved to and fro, alike in both directions and uncoupled
(two equal halfspaces with Poisson's ratio 0). Where the force is known in closed form (Cattaneo, Mindlin), its error is
given in per cent of the largest force, on finer and finer grids of contact nodes. Displacements are prescribed: alpha
is the tangential displacement over that at which everything slips. All histories are enumerated and proven.

Jamming: the wedge of the gallery with friction 1 is pushed in, let go, and pulled in four steps. Maps: the gallery's
wedge over friction (alpha) and the pull; a clamped block with 64 contact nodes over friction and 20 loads.

Cost: the steps of a block that is sheared to and fro, as one history, and by problems built anew from the midpoints of
the same starts; seconds of one core, measured pair by pair.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

import enumsol
from enumsol.support.plotting import new_figure
from shared.results import yes

if TYPE_CHECKING:
    from shared.results import Run

#: Nodes across the grid; fractions of the displacement at which everything slips, to and fro and back.
CELLS, SMOKE_CELLS = (6, 8, 10, 12), (4,)
CYCLE = (0.0, 0.3, 0.6, 0.9, 0.45, 0.0, -0.45, -0.9, -0.45, 0.0, 0.45, 0.9)
FRICTION = 0.3
PULLS = (-1.0, 0.0, 0.25, 0.5, 0.75, 1.0)


def sphere(cells: int) -> enumsol.ContactProblem:
    """Radius, contact radius and effective modulus 1; square cells of uniform pressure (Love 1929)."""
    half, size = 1.15, 2.3 / cells
    line = (np.arange(cells) + 0.5) * size - half
    places = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    places = places[np.sum(places**2, axis=1) < half**2]
    a, b = np.moveaxis(places[:, None] - places[None], -1, 0)
    e = size / 2

    def corner(x: Any, y: Any) -> Any:
        r = np.hypot(x, y)
        return x * np.log(y + r) + y * np.log(x + r)

    C = corner(a + e, b + e) + corner(a - e, b - e) - corner(a + e, b - e) - corner(a - e, b + e)
    K = np.linalg.inv(0.5 * (C + C.T) / (np.pi * size**2))
    p, none = len(K), np.zeros_like(K)
    A, push = np.block([[K, none], [none, K]]), K @ np.ones(p)
    load, slope = np.r_[push, np.zeros(p)], np.r_[np.zeros(p), FRICTION * push]
    rows, gap = np.eye(2 * p), 0.5 * np.sum(places**2, axis=1)
    return enumsol.ContactProblem(0.5 * (A + A.T), rows[:p], rows[p:], load, gap, FRICTION, load_slope=slope)


def mindlin(shares: Any) -> Any:
    """The tangential force over that at which everything slips, along CYCLE's three ways."""

    def first(share: Any) -> Any:
        return 1.0 - (1.0 - share) ** 1.5

    top = max(shares)
    turn, back = int(np.argmax(shares)), int(np.argmin(shares))
    ways = [
        first(x)
        if k <= turn
        else first(top) - 2 * first((top - x) / 2)
        if k <= back
        else 2 * first((top + x) / 2) - first(top)
        for k, x in enumerate(shares)
    ]
    return np.array(ways)


def forces(history: enumsol.History) -> Any:
    roots = [history.root((step, 0)) for step in range(1, len(history.steps) + 1)]
    return np.array([float(np.sum(r.lambda_t)) / (FRICTION * float(np.sum(r.lambda_n))) for r in roots])


def fretting(run: Run) -> None:
    figure = new_figure(figsize=(7.0, 4.8))
    ax, rows = figure.add_subplot(), []
    fine = np.r_[np.linspace(0, 0.9, 60), np.linspace(0.9, -0.9, 120), np.linspace(-0.9, 0.9, 120)]
    ax.plot(fine, mindlin(fine), "-", color="#999999", linewidth=1.0, label="Cattaneo and Mindlin")
    for cells in SMOKE_CELLS if run.smoke else CELLS:
        problem, started = sphere(cells), time.perf_counter()
        history = enumsol.histories(problem, CYCLE)
        seconds = time.perf_counter() - started
        found, known = forces(history), mindlin(np.array(CYCLE))
        ax.plot(CYCLE, found, "o", markersize=4, markerfacecolor="none", label=f"{problem.p} contact nodes")
        work = [history.dissipated[step, 0][0] for step in (4, 8, 12)]
        rows.append(
            {
                "p": problem.p,
                "largest error %": 100 * float(np.max(np.abs(found - known))),
                "work of 2nd half / 1st": (work[2] - work[1]) / (work[1] - work[0]),
                "unique until": history.unique_until,
                "complete": yes(history.complete),
                "widest start": max(stage.largest_radius for stage in history.all_stages),
                "seconds": seconds,
            }
        )
    ax.set_xlabel("displacement over that at which everything slips")
    ax.set_ylabel("tangential force over F times the normal force")
    ax.legend(fontsize=8, frameon=False)
    run.figure("fretting", figure)
    errors = " ".join(f"{row['largest error %']:.2g}" for row in rows)
    run.table(
        "fretting",
        rows,
        f"largest error of the force in per cent, from coarse to fine: {errors}",
        f"all complete and unique, proven: {yes(all(row['unique until'] == len(CYCLE) for row in rows))}",
    )


def pulled(ny: int) -> enumsol.ContactProblem:
    wedge = enumsol.gallery.wedge(2, ny, friction=1.0)
    return wedge.replace(f=0 * wedge.f, load_slope=wedge.f)


def jamming(run: Run) -> None:
    history = enumsol.histories(pulled(2 if run.smoke else 4), PULLS)
    figure = new_figure(figsize=(13.0, 4.2))
    one, two = figure.subplots(1, 2)
    history.plot("displacement", "alpha", ax=one)
    one.set_ylabel("pull")
    history.plot("step", "lambda_n", ax=two)
    run.figure("jamming", figure)
    run.path("tree.txt").write_text(f"{history}\n", encoding="utf-8")
    rows = [
        {"step": k, "pull": pull, "roots": len(history.roots(k)), "histories": history.counts[k - 1]}
        for k, pull in enumerate(PULLS, 1)
    ]
    last = {status.value for node in history.ends for status in history.root(node).statuses}
    run.table(
        "jamming",
        rows,
        f"unique until step {history.unique_until}, complete: {yes(history.complete)}",
        f"at the end there are nodes that are {', '.join(sorted(last))}",
    )


def maps(run: Run) -> None:
    wedge = enumsol.gallery.get("wedge-8-5").build()
    calm = wedge.replace(f=0 * wedge.f)
    values = np.linspace(0.2, 1.6, 2 if run.smoke else 15)
    started = time.process_time()
    found = enumsol.multiplicity_map(calm, (0, 3), {"load": (wedge.f, values)})
    first = time.process_time() - started
    run.figure("map", found.plot())
    started, p = time.process_time(), 8 if run.smoke else 64
    block = enumsol.gallery.get(f"clamped-block-{p}").build()
    shear = np.where(np.arange(block.n) % 2 == 0, block.f, 0.0)
    loads = np.linspace(0.9, 1.0, 2) if run.smoke else np.linspace(-0.5, 1.5, 20)
    other = enumsol.multiplicity_map(block, (0, 3), {"load": (shear, loads)})
    second = time.process_time() - started
    rows = [
        {
            "map": name,
            "p": size,
            "values": len(result.rows),
            "complete": yes(result.complete),
            "CPU seconds": seconds,
        }
        for name, size, result, seconds in (
            ("wedge", wedge.p, found, first),
            ("block", p, other, second),
        )
    ]
    several = sum(not row.unique for row in found.rows)
    run.table("maps", rows, f"the wedge has several solutions at {several} of {len(found.rows)} pulls")


def cost(run: Run) -> None:
    p = 8 if run.smoke else 64
    block = enumsol.gallery.clamped_block(p, 2 if run.smoke else 4, 4.0, friction=0.5)
    loads = [factor * block.f for factor in (1.0, 1.5, 2.0, 1.0, 0.5, -0.5, -1.0, 0.5)]
    started = time.perf_counter()
    history = enumsol.histories(block, loads)
    together = time.perf_counter() - started
    started = time.perf_counter()
    for stage, load in zip(history.all_stages, loads, strict=True):
        given = block.arguments | {"f": load, "slip_offset": stage.start.offset}
        enumsol.enumerate_roots(enumsol.ContactProblem(**given), 0)
    apart = time.perf_counter() - started
    row = {"p": p, "steps": len(loads), "history": together, "built anew": apart, "ratio": apart / together}
    run.table("cost", [row], f"building every step anew takes {row['ratio']:.2g} times as long")


def main(run: Run) -> None:
    fretting(run)
    jamming(run)
    cost(run)
    maps(run)
