"""How often does one certificate decide that a problem has one solution, and where does it end?

Before there is a tree a form is sought that is definite at a solution, which proves that there is no other (theory,
sections 6.11 and 12.6). Asked are blocks, of several meshes, lengths and loads, and wedges, which have several
solutions from some friction F on. Friction in 3D is F and 0.6 F. All answers are verified ones; condensation and
enclosure are made before the clock, seconds are those of the processor, the least of three up to 0.05 s.

``one_certificate``: the searches as they are, cut at a number of nodes. ``certificate`` says which ended by one
certificate; ``tree nodes`` and ``tree s`` are those of the tree without it, for p up to 32 contact nodes ("-": not
asked). ``roots`` counts what was found; where ``whole`` says no, that may be a part. Where the certificate or the tree
has an answer they must agree, or the study fails: all roots of a tree that ended, and those found by one that was cut.
``plain`` and ``any`` say whether one certificate does it with mu = kappa = 1 and nu = 0, and with whatever numbers are
found, both asked before there is a tree, with the solution sought along a path in F, too. The search itself asks less
in 2D: a path from 24 contact nodes on, and below 48 other numbers than plain ones only when the tree has 512 nodes.

``largest``: the last F at which plain and any numbers do, by bisection over F = 0.02 to 20, each 1.155 times the one
before. 20 is tried first, and stands for 20 or more. Bisection takes for granted that there is one such end: every
second F was tried once, for all but the block with 256 contact nodes, and so it was. ``before`` is the F up to which
one solution follows without a search: by theory, (5.9), in 2D, and by that of theory, section 11.5, in 3D. Then, for p
up to 32, the tree at the next F after ``any``, or at 20: its ``roots``, and ``alone`` if it ended with one; after
``any`` the certificate has ended then, and uniqueness has not. ``several from`` is the first F at which a search, cut
likewise, finds several roots, for p up to 14.

``cost``: wedges with several solutions, where the certificate is sought in vain: with it and without in turn, least of
five. Both find the same number of roots.

``graphs``: branch graphs over F from 0 to 3 (theory, section 7.15), with pieces that need no tree and, up to 64 contact
nodes, without. ``closed`` of the ``pieces`` are such, ``proof s`` is what the checker takes. Both graphs have the same
arcs, or the study fails.

In 3D mu and kappa were the same at open nodes before. The largest smallest eigenvalue of Q relative to S (mu and kappa
one in the mean, one alpha) was then -0.18 for ``block3d(5, 5, 1)`` at alpha = 1.94. By a semidefinite program theta as
it is with mu at least kappa gives 0.29, theta = 0 at open nodes with all mu that it needs 0.006, any theta that serves
with mu = kappa -0.03, and any theta with any mu 0.41. The first of these has no theta to be sought. Over alpha from 0
to 2 (282 nodes of the tree then, one now) branching first at the node of the curve whose status makes the form nearly
definite took 399 nodes and two thirds of the time; to stop where a matrix shows that no numbers will do spared less
than half of the evaluations in a fifth of all cases.

Longer blocks are not asked here: ``clamped_block(1024, 16, 4)`` at F = 1 ends by one certificate as well, in 42 s and
1.2 GB (README of ``search_size``).

Read ``certificate`` beside ``roots``, and ``any`` beside ``before`` and ``several from``.
"""

from __future__ import annotations

import math
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple
from unittest.mock import patch

import numpy as np
from scipy.optimize import OptimizeResult

import enumsol
from enumsol import gallery
from enumsol.branches.claims import uniqueness_bound
from enumsol.model.statuses import UNDECIDED
from enumsol.search.fathoming import propose
from enumsol.search.reduction import WeightSource
from enumsol.search.space.space_fathoming import SpaceCloser
from one_certificate.graphs import graphs
from shared.clock import least_time, timed
from shared.figures import BLUE, GREEN, GREY, ORANGE, RED, panels
from shared.loads import DRAGGED, PRESSED
from shared.results import yes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from shared.results import Run

FRICTION, SMOKE_FRICTION = (0.1, 0.3, 1.0, 2.0, 5.0), (0.3, 2.0)
#: Dragged towards the clamp.
TO_CLAMP = -0.3, -1.0
#: F of the bisection.
GRID = np.geomspace(0.02, 20.0, 49)
#: The tree is asked up to so many contact nodes; all searches are cut at so many nodes, in 2D and 3D.
MOST_P, MAX_NODES, MAX_NODES_3D, SMOKE_NODES = 32, 2000, 1000, 300
#: From how many contact nodes on ``several from`` is left out.
SEVERAL_P = 14
#: p of the wedges whose cost is compared, and how many runs.
WEDGES, SMOKE_WEDGES, RUNS, SMOKE_RUNS = (8, 14, 20, 32), (8,), 5, 2
ENOUGH = 0.05


class Case(NamedTuple):
    """A problem to be made, and the series that it belongs to."""

    series: str
    name: str
    build: Callable[[], Any]


def block(nx: int, ny: int, length: int, load: str) -> Case:
    traction = {"pressed": PRESSED, "dragged": DRAGGED, "to the clamp": TO_CLAMP}[load]
    series = f"block {load}" if (ny, length) == (nx // 2, 1) else "other block"
    return Case(
        series, f"{nx}x{ny}, length {length}, {load}", partial(gallery.clamped_block, nx, ny, length, traction=traction)
    )


def wedge(ny: int) -> Case:
    return Case("wedge", f"wedge 4x{ny}", partial(gallery.wedge, 4, ny))


def solid(*cells: int) -> Case:
    return Case("3D block", "3D block " + "x".join(map(str, cells)), partial(gallery.block3d, *cells))


def solid_wedge(*cells: int) -> Case:
    return Case("3D wedge", "3D wedge " + "x".join(map(str, cells)), partial(gallery.wedge3d, *cells))


CASES = (
    *(block(nx, nx // 2, 1, load) for load in ("pressed", "dragged", "to the clamp") for nx in (8, 16, 32, 64)),
    *(block(*size, "pressed") for size in ((64, 16, 1), (64, 16, 2), (128, 16, 2), (256, 16, 4))),
    *map(wedge, (4, 7, 16)),
    *(solid(*cells) for cells in ((4, 2, 2), (5, 5, 2), (6, 6, 2), (8, 8, 2), (10, 10, 3))),
    *(solid_wedge(*cells) for cells in ((2, 1, 2), (2, 2, 2), (2, 2, 3))),
)
SMOKE_CASES = (block(8, 4, 1, "pressed"), wedge(4), solid(2, 1, 2))


def unchanged(_value: object, x: np.ndarray, *_arguments: object, **_options: object) -> OptimizeResult:
    """In place of ``minimize``: where it began, after more evaluations than anyone asks for."""
    return OptimizeResult(x=x, nfev=10**6)


@contextmanager
def whole_by(numbers: WeightSource | None) -> Iterator[None]:
    """In this context a certificate is sought with these numbers before the tree, and with none never."""

    def proposed(system, codes, near, *, exactly, sought):
        if any(code != UNDECIDED for code in codes):
            return propose(system, codes, near, exactly=exactly, sought=sought)
        if numbers is None:
            return None
        found = propose(system, codes, near, exactly=exactly, sought=numbers)
        return found or propose(system, codes, None, exactly=exactly, sought=numbers)

    with ExitStack() as stack:
        stack.enter_context(patch("enumsol.search.fathoming.propose", proposed))
        if numbers is None:
            stack.enter_context(patch.object(SpaceCloser, "whole", lambda self: None))
            # nor below its root, where it would be nearly the same
            stack.enter_context(patch.object(SpaceCloser, "closed", lambda *_: None))
        if numbers is WeightSource.PLAIN:
            # what is sought in 3D are better numbers than those given
            stack.enter_context(patch("scipy.optimize.minimize", unchanged))
        yield


def decided(problem: Any, F: float, numbers: WeightSource) -> bool:
    """Whether one certificate with such numbers decides it."""
    with whole_by(numbers):
        return enumsol.enumerate_roots(problem, F, max_nodes=1).by_one_certificate


def prepared(case: Case) -> Any:
    """The problem, condensed and enclosed."""
    problem = case.build()
    problem.condensed  # noqa: B018 (made once, outside the clock)
    problem.enclosure  # noqa: B018
    return problem


def most_nodes(run: Run, case: Case) -> int:
    return SMOKE_NODES if run.smoke else MAX_NODES_3D if case.series.startswith("3D") else MAX_NODES


def same(roots: enumsol.RootSet, tree: enumsol.RootSet) -> bool:
    """Whether all roots that the tree found are among those of another search, and all are there if it ended."""
    if tree.whole and len(tree) != len(roots):
        return False
    known = [np.concatenate([root.lambda_n, np.ravel(root.lambda_t)]) for root in roots]
    found = [np.concatenate([root.lambda_n, np.ravel(root.lambda_t)]) for root in tree]
    size = max((float(np.max(np.abs(force))) for force in known), default=1.0)
    return all(any(np.allclose(force, other, rtol=0.0, atol=1e-6 * size) for other in known) for force in found)


def row(case: Case, problem: Any, F: float, most: int) -> dict[str, Any]:
    """One problem at one F: as it is, by the tree, and whether the certificate does it with plain and any numbers."""
    search = partial(enumsol.enumerate_roots, alpha=F, max_nodes=most)
    roots, seconds = least_time(lambda: problem, search, runs=3, enough=ENOUGH)
    by_tree: dict[str, Any] = {"tree nodes": "-", "tree s": "-"}
    tree = None
    if problem.p <= MOST_P:
        with whole_by(None):
            tree, taken = least_time(lambda: problem, search, runs=3, enough=ENOUGH)
        by_tree = {"tree nodes": tree.stats.nodes if tree.whole else f"> {most}", "tree s": taken}
        assert not tree.by_one_certificate
        assert not roots.whole or same(roots, tree), f"{case.name}, F = {F}: the tree has other roots"
        assert not tree.whole or same(tree, roots), f"{case.name}, F = {F}: the search has other roots"
    most_roots = max(len(roots), 0 if tree is None else len(tree))
    plain = decided(problem, F, WeightSource.PLAIN)
    every = roots.by_one_certificate or decided(problem, F, WeightSource.DESCENT)
    assert not (plain or every) or most_roots < 2, (
        f"{case.name}, F = {F}: {most_roots} roots, and a certificate for one"
    )
    return {
        "problem": case.name,
        "p": problem.p,
        "F": F,
        "roots": most_roots,
        "whole": yes(roots.whole or (tree is not None and tree.whole)),
        "certificate": yes(roots.by_one_certificate),
        "nodes": roots.stats.nodes if roots.whole else f"> {most}",
        "seconds": seconds,
        **by_tree,
        "plain": yes(plain),
        "any": yes(every),
    }


def last(holds: Callable[[float], bool]) -> int:
    """The last place on the grid at which something holds, by bisection; -1 if it does not at the first."""
    if holds(GRID[-1]):
        return len(GRID) - 1
    low, high = -1, len(GRID) - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(GRID[middle]) else (low, middle)
    return low


def before(case: Case, problem: Any) -> float:
    """The F up to which one solution follows without a search."""
    if case.series.startswith("3D"):
        return float(enumsol.lipschitz_estimate(problem, 1.0).factor)
    bound = uniqueness_bound(problem, (0.0, float(GRID[-1])))
    return math.nan if bound is None else bound


def largest(case: Case, problem: Any, most: int) -> dict[str, Any]:
    """How far the certificate goes, and what is beyond."""
    plain, any_numbers = (
        last(partial(decided, problem, numbers=n)) for n in (WeightSource.PLAIN, WeightSource.DESCENT)
    )
    known, at = before(case, problem), [float(GRID[k]) if k >= 0 else 0.0 for k in (plain, any_numbers)]
    beyond: dict[str, Any] = {"tree at F": "-", "roots": "-", "alone": "-"}
    if problem.p <= MOST_P:
        F = float(GRID[min(any_numbers + 1, len(GRID) - 1)])
        with whole_by(None):
            tree = enumsol.enumerate_roots(problem, F, max_nodes=most)
        alone = "no" if len(tree) > 1 else yes(tree.whole) if tree.whole else "not known"
        assert at[1] < F or alone != "no", f"{case.name}, F = {F}: several roots, and a certificate for one"
        beyond = {"tree at F": F, "roots": len(tree), "alone": alone}
    several = "-"
    if problem.p <= SEVERAL_P:
        first = last(lambda F: len(enumsol.enumerate_roots(problem, F, max_nodes=most)) < 2) + 1
        assert first > any_numbers, f"{case.name}: several roots at an F with a certificate for one"
        several = float(GRID[first]) if first < len(GRID) else "not found"
    return {
        "series": case.series,
        "problem": case.name,
        "p": problem.p,
        "before": known,
        "plain": at[0],
        "any": at[1],
        "plain / before": at[0] / known,
        "any / before": at[1] / known,
        **beyond,
        "several from": several,
    }


def cost(p: int, alpha: float, runs: int) -> dict[str, Any]:
    """With and without the certificate, in turn."""
    problem = prepared(Case("wedge", "", partial(gallery.wedge, 4, p // 2)))
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(runs):
        roots, taken = timed(enumsol.enumerate_roots, problem, alpha)
        times[0].append(taken)
        with whole_by(None):
            tree, taken = timed(enumsol.enumerate_roots, problem, alpha)
        times[1].append(taken)
    assert roots.whole
    assert tree.whole
    assert len(roots) == len(tree)
    with_it, without = map(min, times)
    nodes = {"nodes": roots.stats.nodes, "tree nodes": tree.stats.nodes}
    return {
        "p": p,
        "alpha": alpha,
        "roots": len(roots),
        **nodes,
        "seconds": with_it,
        "tree s": without,
        "ratio": with_it / without,
    }


def conclusions(rows: list[dict[str, Any]]) -> Iterator[str]:
    """How many are decided, by what, and which have one root and are not."""
    for space in ("2D", "3D"):
        own = [r for r in rows if r["problem"].startswith("3D") == (space == "3D")]
        done = [r for r in own if r["certificate"] == "yes"]
        plain, every = (sum(r[column] == "yes" for r in own) for column in ("plain", "any"))
        yield (
            f"{space}: {len(done)} of {len(own)} searches end by one certificate; asked for it before the tree with "
            f"plain numbers {plain}, with any {every}"
        )
        alone = [r for r in own if r["roots"] == 1 and r["whole"] == "yes"]
        several, unknown = sum(r["roots"] > 1 for r in own), sum(r["whole"] == "no" and r["roots"] < 2 for r in own)
        yield f"{space}: one root {len(alone)}, several {several}, not known {unknown}"
        for column, words in (("certificate", "the search needs a tree"), ("any", "there is no certificate")):
            left = [f"{r['problem']} F = {r['F']:g}" for r in alone if r[column] == "no"]
            yield f"{space}: one root, but {words}: {'; '.join(left) or 'none'}"
        asked = [r for r in done if r["tree s"] != "-"]
        ended = [r["tree s"] / r["seconds"] for r in asked if not str(r["tree nodes"]).startswith(">")]
        if ended:
            yield (
                f"{space}: of {len(asked)} trees in place of the certificate {len(ended)} ended, which took "
                f"{span(ended)} times as long, median {np.median(ended):.2g}"
            )


def span(values: list[float]) -> str:
    """From the least to the largest."""
    low, high = (f"{float(f'{value:.3g}'):g}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def notes(rows: list[dict[str, Any]]) -> Iterator[str]:
    """How far, series by series, and what is beyond."""
    for name in dict.fromkeys(r["series"] for r in rows):
        own = [r for r in rows if r["series"] == name]
        known = {
            n: f"F = {span([r[n] for r in own])}, {span([r[f'{n} / before'] for r in own])}" for n in ("plain", "any")
        }
        yield f"{name}: up to {known['any']} times the bound known before; plain numbers up to {known['plain']} times"
    asked = [r for r in rows if r["alone"] != "-" and r["tree at F"] > r["any"]]
    one, more, open_ones = (sum(r["alone"] == word for r in asked) for word in ("yes", "no", "not known"))
    yield f"right after the last F, {len(asked)} asked: one root {one}, several {more}, not known {open_ones}"
    ratios = [r["several from"] / r["any"] for r in rows if isinstance(r["several from"], float) and r["any"]]
    if ratios:
        yield f"several roots are found from {span(ratios)} times the last F on"


def picture(rows: list[dict[str, Any]]) -> Any:
    """The last F that is decided against p."""
    figure, axes = panels(1, 2, (11, 5), sharey=True)
    for axis, space in zip(axes, ("2D", "3D"), strict=True):
        of_space = [r for r in rows if r["series"].startswith("3D") == (space == "3D")]
        names = dict.fromkeys(r["series"] for r in of_space)
        # several series lie on each other
        for name, colour, size in zip(names, (BLUE, ORANGE, GREEN, GREY, RED), (11, 8, 6, 8, 8), strict=False):
            own = [r for r in of_space if r["series"] == name]
            p = [r["p"] for r in own]
            for column, marker, line in (("any", "o", "-"), ("plain", "x", "--"), ("before", ".", ":")):
                style = {"linestyle": "none" if name == "other block" else line, "marker": marker, "markersize": size}
                label = name if column == "any" else None
                axis.loglog(p, [r[column] for r in own], color=colour, label=label, **style)
        axis.set_xlabel("contact nodes p")
        axis.set_title(space)
        axis.legend(fontsize=8, frameon=False, loc="lower right" if space == "3D" else "lower left")
    axes[0].set_ylim(bottom=5e-4)
    axes[0].set_ylabel("last F: any numbers (o), plain numbers (x), known before (.)")
    return figure


def main(run: Run) -> None:
    for case in SMOKE_CASES:  # modules that are imported when needed are not what is measured
        enumsol.enumerate_roots(case.build(), 2.0, max_nodes=SMOKE_NODES)
    rows, ends = [], []
    for case in SMOKE_CASES if run.smoke else CASES:
        problem, most = prepared(case), most_nodes(run, case)
        rows += [row(case, problem, F, most) for F in (SMOKE_FRICTION if run.smoke else FRICTION)]
        ends.append(largest(case, problem, most))
    most_2d, most_3d = (SMOKE_NODES, SMOKE_NODES) if run.smoke else (MAX_NODES, MAX_NODES_3D)
    run.table(
        "one_certificate", rows, *conclusions(rows), f"searches are cut at {most_2d} nodes in 2D and {most_3d} in 3D"
    )
    run.table("largest", ends, *notes(ends))
    run.figure("one_certificate", picture(ends))
    costs = [
        cost(p, alpha, SMOKE_RUNS if run.smoke else RUNS)
        for p in (SMOKE_WEDGES if run.smoke else WEDGES)
        for alpha in (1.0, 2.0)
    ]
    ratios = [r["ratio"] for r in costs]
    run.table("cost", costs, f"with the certificate {span(ratios)} times as long as without")
    run.table("graphs", graphs(smoke=run.smoke))
