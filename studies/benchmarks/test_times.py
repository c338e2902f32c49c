"""Times that are no questions: to see whether a change made something slower.

pip install -e ".[studies]"
OMP_NUM_THREADS=1 pytest studies/benchmarks -n 0 --benchmark-autosave
... the change ...
OMP_NUM_THREADS=1 pytest studies/benchmarks -n 0 --benchmark-compare
"""

import subprocess
import sys

import pytest

import enumsol
from enumsol import gallery

SEARCHES = {
    "wedge-14-5": (lambda: gallery.get("wedge-14-5").build(), 2.2, 5),
    "block-32": (lambda: gallery.clamped_block(32, 16), 3.0, 1),
    "block-64-dragged": (lambda: gallery.clamped_block(64, 32, traction=(1.0, -0.3)), 1.0, 1),
}
GRAPHS = {"two-node-6.4": ((0.0, 10.0), 5), "wedge-8-5": ((0.0, 5.0), 16)}


def condensed(build):
    """The problem with what is made once: S, g and their enclosure."""
    problem = build()
    problem.condensed, problem.enclosure  # noqa: B018 (cached)
    return problem


@pytest.mark.parametrize("arithmetic", ["fast", "verified"])
@pytest.mark.parametrize("name", SEARCHES)
def test_search(benchmark, name, arithmetic):
    build, alpha, expected = SEARCHES[name]
    roots = benchmark(enumsol.enumerate_roots, condensed(build), alpha, arithmetic)
    assert len(roots) == expected


@pytest.mark.parametrize("name", GRAPHS)
def test_graph(benchmark, name):
    interval, expected = GRAPHS[name]
    graph = benchmark(enumsol.branch_graph, gallery.get(name).build(), interval)
    assert graph.complete
    assert len(graph.arcs) == expected


def test_condensation(benchmark):
    def fresh():
        return (gallery.clamped_block(80, 80, contact=40),), {}

    condensed = benchmark.pedantic(lambda problem: problem.condensed, setup=fresh, rounds=5)
    assert condensed.S.shape == (80, 80)


def test_enclosure(benchmark):
    def fresh():
        problem = gallery.clamped_block(64, 32)
        problem.condensed  # noqa: B018 (cached)
        return (problem,), {}

    enclosure = benchmark.pedantic(lambda problem: problem.enclosure, setup=fresh, rounds=5)
    assert enclosure.S.shape == (128, 128)


def test_checker(benchmark):
    build, alpha, _ = SEARCHES["wedge-14-5"]
    problem = build()
    proof = enumsol.enumerate_roots(problem, alpha).proof
    report = benchmark(enumsol.verify, problem, proof)
    assert report.complete


def test_import(benchmark):
    """In a new process, with the start of the interpreter."""
    done = benchmark(subprocess.run, [sys.executable, "-c", "import enumsol"], check=True)
    assert done.returncode == 0
