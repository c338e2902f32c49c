"""The cases on Newton's method, continuation and branch graphs: the parameter r of H, extreme scales."""

from __future__ import annotations

import time
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol import (
    ContactProblem,
    ContinuationOptions,
    InvalidArgumentError,
    NotConverged,
    PiecewiseSmoothEquation,
    audit,
    branch_graph,
    enumerate_roots,
    follow,
    gallery,
    newton,
    verify,
)
from extremes.judge import Finding, count, guarded, row
from extremes.transformed import rescaled

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

R_PROBLEMS = (
    ("one-node-6.1", (0.0, 20.0)),
    ("two-node-6.4", (0.0, 10.0)),
    ("wedge-8-3", (0.2, 3.0)),
    ("clamped-block-8", (0.0, 5.0)),
)
#: Values of Newton's solution and of the verified root may differ by this part of the largest force.
_SAME = 1e-8
#: Seconds after which the search of a graph is stopped.
_GRAPH_LIMIT = 20.0


@dataclass(frozen=True)
class PathCase:
    """A case with its own judgement.

    Attributes
    ----------
    group, name, oracle : str
    work : callable that returns a Finding
    """

    group: str
    name: str
    oracle: str
    work: Callable[[], Finding]


def judge_path(case: PathCase) -> dict[str, Any]:
    """One row of the study's table."""
    started = time.process_time()
    finding = guarded(case.work)
    return row(case.group, case.name, case.oracle, finding, time.process_time() - started)


# -- the parameter r ---------------------------------------------------------------------------------------------------


def parameters() -> Iterator[PathCase]:
    """R from 1e-12 to 1e12: roots, signs, Newton's solutions and paths must be the same ones."""
    for name, interval in R_PROBLEMS:
        for exponent in range(-12, 13, 3):
            r = 10.0**exponent
            yield PathCase("r", f"{name}, H and Newton, r = {r:g}", "verified roots", partial(_newton, name, r))
            yield PathCase("r", f"{name}, path, r = {r:g}", "branch graph", partial(_path, name, interval, r))


def _newton(name: str, r: float) -> Finding:
    entry = gallery.get(name)
    problem, alpha = entry.build(), entry.alpha
    roots = enumerate_roots(problem, alpha)
    finding = Finding(p=problem.p, n=problem.n, roots=count(roots))
    _check_equation(PiecewiseSmoothEquation(problem, r), roots, finding)
    for root in roots:
        # a start at the root itself must stay there for every r
        if not _is(newton(problem, alpha, root, r=r), root):
            finding.wrong("Newton leaves a root")
    largest = max(float(np.max(root.lambda_n)) for root in roots) or 1.0
    for start in (None, np.full(2 * problem.p, 0.3 * largest), np.full(2 * problem.p, 1e-9 * largest)):
        try:
            found = newton(problem, alpha, start, r=r)
        except NotConverged:
            finding.reasons.append("Newton does not converge from another start")
            continue
        if not any(_is(found, root) for root in roots):
            finding.wrong("Newton returns what is no root")
    return finding


def _is(found: Any, root: Any) -> bool:
    size = _SAME * max(float(np.max(np.abs([root.lambda_n, root.lambda_t]))), 1e-300)
    near = np.all(np.abs(found.lambda_n - root.lambda_n) <= size) and np.all(
        np.abs(found.lambda_t - root.lambda_t) <= size
    )
    return bool(near) and found.statuses == root.statuses


def _check_equation(equation: PiecewiseSmoothEquation, roots: Any, finding: Finding) -> None:
    """H vanishes at every root, and its test functions have the signs of the root's statuses."""
    problem, alpha, r = equation.problem, roots.alpha, equation.r
    for root in roots:
        x = np.concatenate([root.u, root.lambda_n, root.lambda_t])
        forces = np.max(np.abs([root.lambda_n, root.lambda_t]))
        # the rounding of u is that of the load's displacements, also at nodes that do not move
        lengths = np.max(np.abs(root.u)) + np.max(np.abs(problem.condensed.at(alpha).g))
        residual = np.max(np.abs(equation.residual(x, alpha)[problem.n :]))
        if not residual <= 1e-12 * (forces + r * lengths):
            finding.wrong("H does not vanish at a root")
        # what is smaller than the rounding of lambda + r w has no sign in floats
        theta = equation.test_functions(x, alpha)
        clear = np.abs(theta) > 1e-13 * (forces + r * lengths)
        if np.any(clear & (np.sign(theta) != root.signs)):
            finding.wrong("signs of the test functions are not the root's")


def _path(name: str, interval: tuple[float, float], r: float) -> Finding:
    problem = gallery.get(name).build()
    graph = branch_graph(problem, interval)
    finding = Finding(p=problem.p, n=problem.n, roots=len(graph.arcs))
    for start in graph.starting_points():
        for direction in (1, -1):
            usual = follow(problem, start, direction, interval)
            path = follow(problem, start, direction, interval, ContinuationOptions(r=r))
            check_path(path, graph, finding)
            ways = [[item.alpha for item in one.transitions] for one in (usual, path)]
            if path.status == usual.status and not (
                len(ways[0]) == len(ways[1]) and np.allclose(*ways, rtol=1e-7, atol=1e-9)
            ):
                finding.wrong("the path has other transitions than for the default r")
    return finding


def check_path(path: Any, graph: Any, finding: Finding) -> None:
    """A path lies on the graph, or says that it got stuck or passed a point with no local branch."""
    report = audit(path, graph)
    if path.status in ("stalled", "dead end", "step limit"):
        finding.undecided(f"a path {path.status}")
    if report.ok:
        return
    if not report.off and not report.jumps:
        finding.undecided("a path is where the graph has a hole, or outside its interval")
    elif any(item.local_test is None or not item.local_test.exists for item in path.transitions):
        finding.undecided("behind a bifurcation within rounding a path is off, as the audit tells")
    else:
        finding.wrong(f"a path is off the graph: {len(report.off)} points, {len(report.jumps)} jumps")


# -- branch graphs -----------------------------------------------------------------------------------------------------


def graphs() -> Iterator[PathCase]:
    """Branch graphs and paths at extreme scales of load, stiffness, friction, gaps and of the interval itself."""
    nodes = {1: [1e12], 2: [1e-12, 1e12], 8: np.geomspace(1e-6, 1e6, 8)}
    for name, interval in (*R_PROBLEMS[:3], ("two-node-6.7-minus", (-3.0, 3.0))):
        base = gallery.get(name).build()
        for stiffness, load in ((1e-12, 1e12), (1e12, 1e-12), (1e-12, 1e-12), (1e150, 1e150), (1.0, 1e-200)):
            build = partial(rescaled, base, stiffness, load)
            yield _graph(f"{name}, stiffness {stiffness:g}, load {load:g}", build, interval)
        yield _graph(f"{name}, contact rows scaled", partial(rescaled, base, nodes=nodes[base.p]), interval)
    for exponent in (-14, -8, 8, 14):
        size = 10.0**exponent
        build = partial(_scaled_friction, gallery.get("two-node-6.4").build(), size)
        yield _graph(f"two-node-6.4, alpha in units of {size:g}", build, (0.0, 10.0 / size))
    for high in (1e4, 1e8, 1e14):
        yield _graph(f"two-node-6.4, alpha up to {high:g}", gallery.get("two-node-6.4").build, (0.0, high))
    for width in (1e-4, 1e-9, 1e-14):
        at = (3.0 - width, 3.0 + width)
        yield _graph(f"two-node-6.4, within {width:g} of a fold", gallery.get("two-node-6.4").build, at)
    for exponent in (4, 6, 7, 8, 9):
        for seed in range(3):
            build = partial(_near_rows, seed, exponent)
            yield _graph(f"contact rows within 1e-{exponent}, {seed}", build, (0.0, 3.0))
    for seed in range(40):
        yield _graph(f"random {seed}", partial(_random, seed), (-3.0, 3.0) if seed % 4 == 1 else (0.0, 10.0))


def _graph(name: str, build: Callable[[], ContactProblem], interval: tuple[float, float]) -> PathCase:
    return PathCase("graph", name, "exact at 8 alphas", partial(_judge_graph, build, interval))


def _judge_graph(build: Callable[[], ContactProblem], interval: tuple[float, float]) -> Finding:
    problem = build()
    graph = branch_graph(problem, interval, time_limit=_GRAPH_LIMIT)
    finding = Finding(p=problem.p, n=problem.n, roots=len(graph.arcs))
    for reason in graph.reasons:
        finding.undecided(reason)
    if graph.proof is not None:
        report = verify(problem, graph.proof)
        if not report.ok:
            finding.wrong(f"the checker refuses the graph's proof: {report.failures[0]}")
    elif graph.complete and not problem.is_unloaded(sum(interval) / 2):
        finding.reasons.append("no proof: rationals decided")
    low, high = Fraction(interval[0]), Fraction(interval[1])
    alphas = [low, high, (low + high) / 2, low + (high - low) / 7]
    if graph.certified_data == "problem":
        # otherwise the vertices of the problem as given are some roundings off
        alphas += [Fraction(v.alpha) for v in graph.vertices if not v.border][:4]
    for alpha in alphas:
        if low <= alpha <= high:
            truth = enumerate_roots(problem, alpha, "exact")
            if graph.complete and graph.multiplicity_at(alpha) != count(truth):
                finding.wrong(f"{graph.multiplicity_at(alpha)} solutions at {float(alpha):g}, exact: {count(truth)}")
    if not graph.complete:
        return finding
    for start in graph.starting_points()[:4]:
        for direction in (1, -1):
            try:
                path = follow(problem, start, direction, interval)
            except InvalidArgumentError as error:
                finding.undecided(f"follow refuses: {error}")
                continue
            check_path(path, graph, finding)
    return finding


def _scaled_friction(base: ContactProblem, size: float) -> ContactProblem:
    F0, F1 = base.affine_friction
    return ContactProblem(base.A, base.Bn, base.Bt, base.f, friction=F0, friction_slope=size * F1)


def _near_rows(seed: int, exponent: int) -> ContactProblem:
    """Two contact nodes whose rows are almost the same, on a loading path."""
    rng = np.random.default_rng([6, seed])
    rows, X = rng.normal(size=(4, 6)), rng.normal(size=(6, 8))
    rows[[1, 3]] = rows[[0, 2]] + 10.0**-exponent * rows[[1, 3]]
    f, slope = rng.normal(size=(2, 6))
    return ContactProblem(X @ X.T, rows[:2], rows[2:], f, friction=1.0, load_slope=slope)


def _random(seed: int) -> ContactProblem:
    """Random data with p up to 3 on a friction path or a loading path, integer or not, scaled at random."""
    rng = np.random.default_rng([5, seed])
    p = int(rng.integers(1, 4))
    X = rng.integers(-1, 2, size=(2 * p, 2 * p)) if seed % 2 else rng.normal(size=(2 * p, 2 * p + 2))
    A = X @ X.T + np.eye(2 * p) * int(rng.integers(1, 3))
    f = rng.integers(-2, 3, size=2 * p).astype(float) if seed % 2 else rng.normal(size=2 * p)
    f[:p] += 1.0
    data: dict[str, Any] = {"friction": 0.0, "friction_slope": rng.uniform(0.2, 3.0, p)}
    if seed % 4 == 1:
        data = {"friction": rng.uniform(0.2, 3.0, p), "friction_slope": 0.0, "load_slope": rng.normal(size=2 * p)}
    elif seed % 4 == 2:
        data = {"friction": 0.0, "friction_slope": 10.0 ** rng.uniform(-6, 6, p)}
    elif seed % 4 == 3:
        data["gap"] = 10.0 ** rng.uniform(-14, 4, p) * rng.choice([-1.0, 0.0, 1.0], p)
    base = ContactProblem(A, np.eye(2 * p)[:p], np.eye(2 * p)[p:], f, **data)
    return rescaled(base, *(10.0 ** rng.uniform(-12, 12, 2)), nodes=np.ldexp(1.0, rng.integers(-40, 41, p)))


PATH_GROUPS = (parameters, graphs)
