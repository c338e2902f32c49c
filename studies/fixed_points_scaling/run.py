"""How far do successive approximations go in 3D?

A flat block, clamped at one side, pressed and sheared, F1 = 0.5, F2 = 0.3, on finer and finer meshes of hexahedra, with
16 to 1,024 contact nodes. Each size runs in a new process on one thread; seconds are process times, the peak is that of
the process until the iterations have ended, read from /proc: this study needs Linux.

The Tresca problem of the limit is solved from scratch by three solvers: Newton's method on the condensed problem, with
Clarabel where it fails; Clarabel on the condensed problem, polished by Newton; CVXPY on the problem in u, made
canonical anew, up to 256 nodes. "warm s" is what one iteration takes, in which Newton starts from the last iterate.

Two tables beside it: iterations against friction, plain and with Anderson's mixing, on one block; and the seconds of a
condensation against the number of right-hand sides that are solved at once.

Read ``condense s`` beside ``iterate s``: what dominates; and ``clarabel / newton``.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import enumsol
from fixed_points_scaling.case import DEPTH, block, clocked
from shared.figures import BLUE, GREEN, GREY, ORANGE, RED, panels
from shared.results import yes
from shared.versions import new_process

if TYPE_CHECKING:
    from shared.results import Run

#: Contact nodes along one side.
SIDES, SMOKE_SIDES = (4, 8, 12, 16, 24, 32), (4, 6)
ALPHA = 0.5
FRICTION, SMOKE_FRICTION = (0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0), (0.5, 4.0)
FRICTION_SIDE, SMOKE_FRICTION_SIDE = 12, 4
WIDTHS = (4, 16, 64, 256)
WIDTH_SIDE, SMOKE_WIDTH_SIDE = 24, 4


def row(side, solvers):
    """One size."""
    child = str(Path(__file__).with_name("case.py").resolve())
    seen = json.loads(new_process(sys.executable, child, str(side), str(ALPHA), ",".join(solvers))[1])
    print(f"p = {side**2} done", flush=True)
    newton = seen["newton s"]
    statuses = Counter(seen["statuses"])
    return {
        "p": side**2,
        "n": seen["n"],
        "open": statuses["open"],
        "stick": statuses["stick"],
        "slip": statuses["slip"],
        "build s": seen["build s"],
        "condense s": seen["condense s"],
        "iterations": seen["iterations"],
        "converged": yes(seen["converged"]),
        "contraction": seen["contraction"],
        "iterate s": seen["iterate s"],
        "warm s": seen["iterate s"] / seen["iterations"],
        "Anderson iterations": seen["anderson iterations"],
        "Anderson s": seen["anderson s"],
        "residual": seen["residual"],
        "peak MB": seen["peak MB"],
        "newton s": newton,
        "clarabel s": seen["clarabel s"],
        "cvxpy s": seen.get("cvxpy s", "-"),
        "clarabel / newton": seen["clarabel s"] / newton,
        "cvxpy / newton": seen["cvxpy s"] / newton if "cvxpy s" in seen else "-",
        "clarabel off": seen["clarabel off"],
        "cvxpy off": seen.get("cvxpy off", "-"),
        "newton alone": yes(seen["newton alone"]),
    }


def friction_row(problem, alpha):
    """Plain and mixed iterations of one block under friction alpha."""
    estimate = enumsol.lipschitz_estimate(problem, alpha)
    plain, seconds = clocked(lambda: enumsol.successive_approximations(problem, alpha))
    mixed, mixed_seconds = clocked(lambda: enumsol.successive_approximations(problem, alpha, anderson=DEPTH))
    statuses = Counter(map(str, plain.statuses))
    apart = float(abs(mixed.forces - plain.forces).max() / abs(plain.forces).max())
    return {
        "F1": alpha,
        "C1": estimate.C1,
        "open": statuses["open"],
        "stick": statuses["stick"],
        "slip": statuses["slip"],
        "outcome": str(plain.outcome),
        "iterations": plain.iterations,
        "contraction": plain.contraction_factor,
        "seconds": seconds,
        "Anderson outcome": str(mixed.outcome),
        "Anderson iterations": mixed.iterations,
        "Anderson seconds": mixed_seconds,
        "apart": apart if plain.converged and mixed.converged else "-",
    }


def width_row(problem, width):
    """Seconds for B A^-1 B' with that many right-hand sides at once, with and without iterative refinement."""
    B, factorization = problem.contact_rows, problem.factorization

    def solve(refined):
        for start in range(0, B.shape[0], width):
            B @ factorization.solve(B[start : start + width].T.toarray(), refined=refined)

    refined, plain = (clocked(lambda kind=kind: solve(kind))[1] for kind in (True, False))
    return {"right-hand sides": width, "refined s": refined, "not refined s": plain, "share": plain / refined}


def conclusions(rows):
    """What dominates, and by how much the slower solvers lose."""
    last = rows[-1]
    yield (
        f"p = {last['p']}, n = {last['n']}: {last['condense s']:.3g} s to condense, {last['iterate s']:.2g} s for "
        f"{last['iterations']} iterations ({last['warm s']:.2g} s each), {last['peak MB']:.0f} MB: condensation takes "
        f"{last['condense s'] / (last['build s'] + last['condense s'] + last['iterate s']):.0%} of the time"
    )
    first = next((row for row in rows if row["p"] >= 100), rows[0])
    yield (
        f"iterations {min(row['iterations'] for row in rows)} to {max(row['iterations'] for row in rows)}, with "
        f"Anderson's mixing {min(row['Anderson iterations'] for row in rows)} to "
        f"{max(row['Anderson iterations'] for row in rows)}, all converged: "
        f"{yes(all(row['converged'] == 'yes' for row in rows))}; largest residual "
        f"{max(row['residual'] for row in rows):.1e}"
    )
    losses = [row["clarabel / newton"] for row in rows]
    yield (
        f"a Tresca problem from scratch: Clarabel first takes {min(losses):.1f} to {max(losses):.1f} times the time of "
        f"Newton first ({first['clarabel / newton']:.1f} at p = {first['p']}, {losses[-1]:.1f} at p = {last['p']}); "
        f"Newton needed no help: {yes(all(row['newton alone'] == 'yes' for row in rows))}"
    )
    if tried := [row for row in rows if row["cvxpy s"] != "-"]:
        yield (
            "CVXPY takes "
            + ", ".join(f"{row['cvxpy / newton']:.0f} times at p = {row['p']}" for row in tried)
            + f", and agrees to {max(row['cvxpy off'] for row in tried):.0e}"
        )


def friction_conclusions(rows):
    """Where iterations converge beyond the estimate, and what mixing saves."""
    known = [row["F1"] for row in rows if row["C1"] < 1]
    converged = [row for row in rows if row["outcome"] == "converged"]
    yield (
        f"C1 < 1, which proves contraction, up to F1 = {max(known, default=0):g}; plain iterations converge at "
        f"{len(converged)} of {len(rows)} values up to F1 = {max(row['F1'] for row in converged):g}, where C1 = "
        f"{converged[-1]['C1']:.0f}, with contraction {converged[-1]['contraction']:.2f}"
    )
    saved = [row["iterations"] / row["Anderson iterations"] for row in rows]
    yield f"Anderson's mixing takes {1 / max(saved):.0%} to {1 / min(saved):.0%} of the iterations"


def draw(rows, friction):
    """Seconds against p; iterations against friction."""
    figure, (seconds, iterations) = panels(1, 2, (10, 4))
    sizes = [row["p"] for row in rows]
    curves = (
        ("condense s", "condense", RED, "o-"),
        ("iterate s", "all iterations", BLUE, "s-"),
        ("newton s", "Tresca from scratch, Newton first", GREEN, "^--"),
        ("clarabel s", "Tresca from scratch, Clarabel first", ORANGE, "v--"),
        ("cvxpy s", "Tresca from scratch, CVXPY", GREY, "D--"),
    )
    for name, label, color, style in curves:
        if points := [(p, row[name]) for p, row in zip(sizes, rows, strict=True) if row[name] != "-"]:
            seconds.loglog(*zip(*points, strict=True), style, color=color, label=label)
    seconds.set(xlabel="contact nodes p", ylabel="seconds")
    seconds.legend(frameon=False, fontsize=8)
    values = [row["F1"] for row in friction]
    for kind, column, color in (("plain", "outcome", BLUE), (f"Anderson, depth {DEPTH}", "Anderson outcome", ORANGE)):
        counts = [row["iterations" if kind == "plain" else "Anderson iterations"] for row in friction]
        iterations.loglog(values, counts, "o-", color=color, label=kind)
        lost = [(F, k) for F, k, row in zip(values, counts, friction, strict=True) if row[column] != "converged"]
        for k, point in enumerate(lost):
            iterations.plot(*point, "x", color="black", markersize=9, label=None if k else f"{kind}: not converged")
    iterations.set(xlabel="F1 (F2 = 0.6 F1)", ylabel="iterations")
    iterations.legend(frameon=False, fontsize=8)
    return figure


def main(run: Run) -> None:
    solvers = ["newton", "clarabel", "cvxpy"]
    if find_spec("cvxpy") is None:
        print("cvxpy is not installed: it is left out")
        solvers.remove("cvxpy")
    rows = [row(side, solvers) for side in (SMOKE_SIDES if run.smoke else SIDES)]
    run.table("fixed_points_scaling", rows, *conclusions(rows))
    problem = block(SMOKE_FRICTION_SIDE if run.smoke else FRICTION_SIDE)
    friction = [friction_row(problem, alpha) for alpha in (SMOKE_FRICTION if run.smoke else FRICTION)]
    run.table("fixed_points_friction", friction, *friction_conclusions(friction))
    run.figure("fixed_points_scaling", draw(rows, friction))
    problem = block(SMOKE_WIDTH_SIDE if run.smoke else WIDTH_SIDE)
    widths = [width_row(problem, width) for width in WIDTHS]
    best = min(widths, key=lambda row: row["refined s"])
    run.table(
        "condensation_widths",
        widths,
        f"p = {problem.p}, n = {problem.n}: fastest with {best['right-hand sides']} right-hand sides at once; solving "
        f"without refinement takes {best['share']:.0%} of the time",
    )
