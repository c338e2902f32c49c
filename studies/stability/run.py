"""What does it cost to say which equilibria run away, and what does the proof take?

``gallery``: all roots of bodies of the gallery, and then their verdicts: process times of both and their ratio, how
many ranges of growth rates were proven to hold nothing, and how many semidefinite programs were solved. The machine
was shared with other work; read the ratios, and of small problems not even these.

``random``: equilibria of random bodies with up to five contact nodes, most of which slide, with strong coupling of
normals and tangents and a mass that is one, diagonal or full. What the proofs needed, of each equilibrium the most:
``plain`` numbers, ``weights`` (other ones), ``products`` of components, ``decided`` nodes (one after the other), or a
``growing`` motion.

Read ``ratio`` in the first table, where below one the verdicts take less than the roots, and the shares of the second.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING
from unittest.mock import patch

import numpy as np

import enumsol
from enumsol import gallery
from enumsol.search.stability import StabilitySearch
from shared.clock import timed

if TYPE_CHECKING:
    from shared.results import Run

NAMES = (
    *("taper-14", "wedge-14-3", "wedge-14-5", "wedge-32-3", "wedge-32-5", "dovetail-14", "brake-shoe-9", "clip-17"),
    *("lap-joint-9", "pressed-rings-16", "clamped-block-100", "wedge3d-2-3", "wedge3d-4-9"),
)
SMOKE_NAMES = ("brake-shoe-9", "wedge3d-2-3")
COUNT, SMOKE_COUNT = 600, 10
KINDS = ("plain", "weights", "products", "decided", "growing", "undecided")


class Watched:
    """Every search for growing motions that ran, and what it proved."""

    def __init__(self) -> None:
        self.ranges = self.programs = 0
        self.kinds: list[str] = []

    def __enter__(self) -> Watched:
        run = StabilitySearch.run

        def watched(search):
            proven = run(search)
            self.ranges += len({(leaf.low, leaf.high) for leaf in proven.leaves})
            self.programs += search.programs
            self.kinds.append(_kind(proven))
            return proven

        self._patch = patch.object(StabilitySearch, "run", watched)
        self._patch.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._patch.stop()


def _kind(proven):
    if proven.growing:
        return "growing"
    if proven.gaps:
        return "undecided"
    if any(leaf.slides or leaf.stays for leaf in proven.leaves):
        return "decided"
    if any(np.any(N) for leaf in proven.leaves for N in leaf.products):
        return "products"
    return "weights" if any(np.any(leaf.weights != np.eye(len(leaf.weights))) for leaf in proven.leaves) else "plain"


def bodies(run: Run) -> None:
    cases = {name: gallery.get(name) for name in (SMOKE_NAMES if run.smoke else NAMES)}
    problems = {name: (entry.build(), entry.alpha) for name, entry in cases.items()}
    if not run.smoke:
        problems |= {"taper, 64 nodes": (gallery.taper(16, 32), 0.2)}
        problems |= {"block, 256 nodes": (gallery.clamped_block(256, 2, 4.0, friction=0.3), 0.0)}
    rows = []
    # libraries are loaded with the first verdicts
    enumsol.enumerate_roots(gallery.taper(2, 2), 0.2).stability()
    for name, (problem, alpha) in problems.items():
        roots, first = timed(enumsol.enumerate_roots, problem, alpha)
        with Watched() as watched:
            verdicts, second = timed(roots.stability)
        count = Counter(found.verdict for found in verdicts)
        rows.append(
            {
                "body": name,
                "p": problem.p,
                "n": problem.n,
                "roots": len(roots),
                "run away": count["runs away"],
                "undecided": count["undecided"],
                "roots s": first,
                "verdicts s": second,
                "ratio": second / first,
                "ranges": watched.ranges,
                "programs": watched.programs,
            }
        )
    less = sum(row["ratio"] < 1 for row in rows)
    run.table("gallery", rows, f"verdicts take less time than roots for {less} of {len(rows)} bodies")


def planted(rng):
    """A body with unit rows and an equilibrium at which most nodes slide, and a mass."""
    p = int(rng.integers(1, 6))
    n = 2 * p + int(rng.integers(0, 4))
    X = rng.normal(size=(n, n))
    A = X @ X.T + 10.0 ** rng.uniform(-2, 1) * np.eye(n)
    F, s = rng.choice([0.3, 0.7, 1.5, 3.0], size=p), rng.choice([-1.0, 1.0], size=p)
    slides, sticks = rng.random(p) < 0.6, rng.random(p) < 0.6
    loaded = slides | sticks
    w = np.concatenate([np.where(loaded, 0.0, -1.0), np.where(slides, s, 0.0)])
    lam = np.concatenate([loaded, np.where(slides, s * F, 0.0)])
    u = np.concatenate([w, rng.normal(size=n - 2 * p)])
    rows = np.eye(n)
    Y = rng.normal(size=(n, n))
    M = [np.eye(n), np.diag(10.0 ** rng.uniform(-1, 1, n)), Y @ Y.T + 0.1 * np.eye(n)][rng.integers(3)]
    return enumsol.ContactProblem(A, rows[:p], rows[p : 2 * p], A @ u + rows[: 2 * p].T @ lam, friction=F, mass=M)


def random_bodies(run: Run) -> None:
    kinds, programs, equilibria, seconds = Counter(), 0, 0, 0.0
    for seed in range(SMOKE_COUNT if run.smoke else COUNT):
        problem = planted(np.random.default_rng([seed, 3]))
        roots = enumsol.enumerate_roots(problem, 0.0)
        with Watched() as watched:
            _, took = timed(roots.stability)
        kinds.update(watched.kinds)
        equilibria, programs, seconds = equilibria + len(roots), programs + watched.programs, seconds + took
    total = max(kinds.total(), 1)
    rows = [
        {"needed": kind, "parts of equilibria": kinds[kind], "per cent": 100 * kinds[kind] / total} for kind in KINDS
    ]
    run.table(
        "random",
        rows,
        f"{equilibria} equilibria, {kinds.total()} different with nodes at their limit, {programs} programs, "
        f"{1e3 * seconds / total:.0f} ms each; undecided: {kinds['undecided']}",
    )


def main(run: Run) -> None:
    random_bodies(run)
    bodies(run)
