"""What do other methods find of the solutions of one problem, at what cost, and what do they prove?

Every method gets the same problem, in the form that it takes:

- *enumsol*: `enumerate_roots`, verified, with its proof; the other rows are compared with it.
- *4^p selections*: ``method="exhaustive"`` of `enumerate_roots`, in floats: solves all selections in blocks; it
  refuses p > 11.
- *SCIP*: counts the assignments of one binary per status and node that admit a solution (big-M model and energy bounds
  as in the study against_scip). Where it ends, the points are taken by solving again with each assignment cut off,
  outside the clock. Needs pyscipopt.
- *Siconos*: its enumerative solver for linear complementarity problems (``SICONOS_LCP_ENUM``) tries all 8^p bases of
  the problem with three complementary pairs per node. Its numbering of the bases has 31 bits: p <= 10. Needs Siconos
  (Debian: python3-siconos).
- *deflated Newton*: semismooth Newton with the roots found divided out, from zero and from random points of the
  ellipsoid that holds all roots, until many starts in a row lead to none. ``last`` is when it had its last root.
- *GetFEM*: its continuation for piecewise smooth problems follows branches while friction grows from 0 to twice its
  value or falls back, from three starts, and takes the points at which they pass the value. Needs GetFEM (Debian:
  python3-getfem).

Read ``roots`` beside ``known``, the number of roots that is proven; a family counts as one. ``points`` is what the
method reported, ``false`` how many of these are at no root to a relative distance of 1e-6 (one root may be reported
more than once, where several selections hold at it). ``claim`` is what the method says of roots that it did not find:
``proven``, ``all`` (within its tolerance, if it ended) or ``none``. ``ratio`` is its time over that of enumsol, both
in CPU seconds; all but GetFEM start from the condensed problem. The limit is one of CPU seconds, for 4^p selections of
the clock. Newton's residual is 1e-10 where forces are of size one; SCIP and Siconos have 1e-9 (by default 1e-6).

What peers do better: up to four nodes trying all selections takes a fifth to a half of the time of the tree. Newton's
method, started at zero, has the root of a block in a tenth of it. Siconos is as fast up to two nodes. SCIP takes any
other constraint beside these, and GetFEM's continuation gives branches. Siconos's false points come from bases that are
singular but for rounding: it asks its factorization only.
"""

from __future__ import annotations

import math
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import enumsol
from peers.deflation import deflated_newton
from peers.problems import complementarity, forces, problems
from shared.clock import least_time, timed
from shared.interpreters import call, interpreter

if TYPE_CHECKING:
    import argparse

    from enumsol import ContactProblem, RootSet
    from shared.loads import Loaded
    from shared.results import Run

HERE = Path(__file__).parent
#: A method that takes longer is stopped [seconds].
LIMIT, SMOKE_LIMIT = 30.0, 10.0
#: Newton's method ends after so many starts in a row that lead to no new root, and after so many in all.
IN_VAIN, STARTS, SMOKE_STARTS = 100, 1000, 20
#: Points are at a root if they are as near, relative to the largest force at any root.
CLOSE = 1e-6
#: Tolerance of SCIP and Siconos.
TOLERANCE = 1e-9
#: Siconos numbers 2^(3p) bases by integers of 32 bits.
LARGEST_LCP = 10
#: `enumerate_roots` refuses to try the selections of more nodes one by one.
LARGEST_EXHAUSTIVE = 11
INSTALLED = find_spec("pyscipopt") is not None
ABSENT = "{} is not installed: it is left out"


class Found(NamedTuple):
    """What a method reports: points (k, 2p) or only their number, CPU seconds, and how it ended."""

    points: np.ndarray | int | str
    seconds: float
    ended: str
    claim: str
    #: CPU seconds until the last root, where that is known.
    last: float = np.nan


TOO_LARGE = Found("-", np.nan, "too large", "none")


def exhaustive(problem: ContactProblem, alpha: float, limit: float) -> Found:
    if problem.p > LARGEST_EXHAUSTIVE:
        return TOO_LARGE
    roots, seconds = timed(
        lambda: enumsol.enumerate_roots(problem, alpha, "fast", method="exhaustive", time_limit=limit)
    )
    return Found(points_of(roots, problem.p), seconds, "yes" if roots.stopped is None else "limit", "all")


def scip(problem: ContactProblem, alpha: float, limit: float) -> Found:
    from peers.scip import count_and_points

    return Found(*count_and_points(problem.condensed.at(alpha).scaled, limit, TOLERANCE), "all")


def newton(problem: ContactProblem, alpha: float, starts: int) -> Found:
    (points, last), seconds = timed(deflated_newton, problem.condensed.at(alpha).scaled, starts, IN_VAIN)
    return Found(np.reshape(points, (-1, 2 * problem.p)), seconds, "yes", "none", last)


def by_script(python: str, script: str, seconds: float, **given: object) -> tuple[np.ndarray, float, str]:
    """Points of a script in another Python, its seconds, and whether it ended."""
    with tempfile.TemporaryDirectory() as folder:
        problem, answer = Path(folder, "problem.npz"), Path(folder, "points.npz")
        np.savez(problem, **given)
        done = call(python, str(HERE / script), str(problem), str(answer), seconds=math.ceil(seconds), folder=folder)
        killed = done.returncode < 0
        if not killed and not answer.exists():
            raise RuntimeError(f"{script} failed: {done.stderr}")
        if not answer.exists():
            return np.zeros((0, 0)), seconds, "limit"
        with np.load(answer) as found:
            ended = not killed and bool(found["ended"])
            return found["points"], seconds if killed else float(found["seconds"]), "yes" if ended else "limit"


def siconos(python: str, problem: ContactProblem, alpha: float, limit: float) -> Found:
    if problem.p > LARGEST_LCP:
        return TOO_LARGE
    system = problem.condensed.at(alpha).scaled
    M, q = complementarity(system)
    z, *rest = by_script(python, "by_siconos.py", limit, M=M, q=q, tolerance=TOLERANCE)
    return Found(forces(system, z.reshape(-1, 3 * problem.p)), *rest, "all")


def getfem(python: str, problem: ContactProblem, alpha: float, limit: float) -> Found:
    A, Bn, Bt = (part.toarray() for part in (problem.A, problem.Bn, problem.Bt))
    f, F = problem.load_at(alpha), problem.friction_at(alpha)
    found = by_script(python, "by_getfem.py", limit, A=A, Bn=Bn, Bt=Bt, f=f, gap=problem.gap, F=F, limit=limit)
    return Found(found[0].reshape(-1, 2 * problem.p), *found[1:], "none")


def points_of(roots: RootSet, p: int) -> np.ndarray:
    return np.reshape([[*root.lambda_n, *root.lambda_t] for root in roots], (-1, 2 * p))


def row(loaded: Loaded, method: str, found: Found, known: np.ndarray, seconds: float) -> dict[str, object]:
    """One line of the table."""
    line = {"problem": loaded.name, "p": loaded.p, "known": len(known), "method": method}
    if not isinstance(found.points, np.ndarray):
        line |= {"points": found.points, "roots": "-", "false": "-"}
    else:
        assert found.points.shape[1] == known.shape[1]
        scale = np.max(np.abs(known))
        far = np.max(np.abs(found.points[:, None] - known[None]), axis=2) / scale
        near = far <= CLOSE
        line |= {"points": len(found.points), "roots": int(near.any(0).sum()), "false": int((~near.any(1)).sum())}
    ended = found.ended
    claim = found.claim if ended == "yes" else "none"
    times = (found.seconds, found.seconds / seconds) if ended != "too large" else ("-", "-")
    last = "-" if math.isnan(found.last) else found.last
    return line | {"ended": ended, "claim": claim, "seconds": times[0], "ratio": times[1], "last": last}


def rows_of(loaded: Loaded, pythons: dict[str, str | None], limit: float, starts: int) -> list[dict[str, object]]:
    """All methods on one problem."""

    def make() -> ContactProblem:
        problem = loaded.build()
        problem.condensed  # noqa: B018 (outside the clock)
        return problem

    alpha = loaded.alpha
    roots, seconds = least_time(make, lambda problem: enumsol.enumerate_roots(problem, alpha), runs=3, enough=1.0)
    problem = make()
    assert roots.complete
    assert not roots.families
    assert enumsol.verify(problem, roots.proof).complete
    known = points_of(roots, problem.p)
    found = {"enumsol": Found(known, seconds, "yes", "proven"), "4^p selections": exhaustive(problem, alpha, limit)}
    if INSTALLED:
        found["SCIP"] = scip(problem, alpha, limit)
    if pythons["siconos"] is not None:
        found["Siconos"] = siconos(pythons["siconos"], problem, alpha, limit)
    found["deflated Newton"] = newton(problem, alpha, starts)
    if pythons["getfem"] is not None:
        found["GetFEM"] = getfem(pythons["getfem"], problem, alpha, limit)
    return [row(loaded, method, each, known, seconds) for method, each in found.items()]


def conclusions(rows: list[dict[str, object]]) -> list[str]:
    """A line a method."""
    texts = []
    for method in dict.fromkeys(line["method"] for line in rows):
        own = [line for line in rows if line["method"] == method]
        ended = [line for line in own if line["ended"] == "yes"]
        seen = [line for line in own if line["roots"] != "-"]
        whole = sum(line["roots"] == line["known"] for line in seen)
        false = sum(line["false"] for line in seen)
        ratios = [line["ratio"] for line in ended]
        times = f", {min(ratios):.2g} to {max(ratios):.2g} times the time of enumsol" if ended else ""
        faster = sum(line["ratio"] < 1 and line["roots"] == line["known"] for line in ended)
        texts.append(
            f"{method}: ended on {len(ended)} of {len(own)}{times}, faster and with all roots on {faster}; "
            f"all roots on {whole} of {len(seen)}; {false} false points"
        )
    return texts


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--python", metavar="PYTHON", help="another interpreter to look for Siconos and GetFEM in")
    parser.add_argument("--limit", type=float, default=LIMIT, help="a method that takes longer is stopped [seconds]")


def main(run: Run) -> None:
    more = getattr(run.options, "python", None)
    pythons = {library: interpreter(library, more) for library in ("siconos", "getfem")}
    absent = [] if INSTALLED else [ABSENT.format("pyscipopt")]
    absent += [ABSENT.format(library) for library, python in pythons.items() if python is None]
    limit, starts = (SMOKE_LIMIT, SMOKE_STARTS) if run.smoke else (run.options.limit, STARTS)
    rows = []
    for loaded in problems(smoke=run.smoke):
        rows += rows_of(loaded, pythons, limit, starts)
    run.table(
        "peers",
        rows,
        *conclusions(rows),
        f"limit {limit:g} s; starts of Newton's method: at most {starts}, {IN_VAIN} in vain",
        *absent,
    )
