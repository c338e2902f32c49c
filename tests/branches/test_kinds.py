"""What a vertex is: where a single arc begins or ends, and where degrees show that something is missing."""

import re
from collections import Counter
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from complete import whole_graph
from effort import some
from path_problems import balanced, integer_problem

import enumsol
from enumsol import BranchGraph, ContactProblem, branch_graph, enumerate_roots
from enumsol.branches.elements import VertexKind, vertex_kind
from enumsol.branches.figures.panels import MARKERS

#: Kinds that have no mark: curves and areas show them.
UNMARKED = {VertexKind.FAMILY, VertexKind.SHEET, VertexKind.END}


def fold_beside_grazing(c):
    """A node with a fold at alpha = 8/3, whose slip moves another; that touches without load while the first sticks."""
    A = np.kron(np.eye(2), [[2.0, -1.0], [-1.0, 2.0]])
    A[1, 2] = A[2, 1] = c
    rows = np.eye(4)
    return ContactProblem(
        A, rows[0::2], rows[1::2], [1.5, -4.0, 1.0, -2.0], friction=np.array([0.0, 5.0]), friction_slope=[1.0, 0.0]
    )


def beside_grazing(rng):
    """A node with a fold that moves one or two others, of which most touch without load while it sticks."""
    p = int(rng.integers(2, 4))
    A = np.kron(np.eye(p), [[2.0, -1.0], [-1.0, 2.0]])
    f, friction = [1.5, -4.0], [0.0]
    for node in range(1, p):
        place = 2 * node + int(rng.integers(0, 2))
        A[1, place] = A[place, 1] = int(rng.integers(-2, 3)) / 4
        size = int(rng.integers(1, 4))
        f += [size, -2 * size - int(rng.random() < 0.2)]
        friction.append(int(rng.integers(0, 6)))
    rows, slope = np.eye(2 * p), np.zeros(p)
    slope[0] = 1.0
    return ContactProblem(A, rows[0::2], rows[1::2], f, friction=np.array(friction), friction_slope=slope)


@pytest.mark.parametrize("arithmetic", ["verified", "exact", "fast"])
def test_an_arc_of_degree_zero_may_begin_alone(arithmetic):
    graph = balanced(branch_graph(fold_beside_grazing(0.25), (0, 5), arithmetic))
    assert Counter(v.kind for v in graph.vertices) == {"terminal": 1, "fold": 1, "end": 5}
    (vertex,) = (v for v in graph.vertices if v.kind == "terminal")
    assert (vertex.alpha, vertex.index_left, vertex.index_right) == (8 / 3, 0, 0)
    assert [arc.index for arc in graph.arcs if arc.tail == vertex.number] == [0]
    for alpha in (8 / 3, 3.0):
        assert graph.multiplicity_at(alpha) == len(enumerate_roots(fold_beside_grazing(0.25), alpha))
    assert graph.summary()["vertices"]["terminal"] == 1
    assert "1 terminal" in str(graph)


def test_it_may_end_alone_too():
    """The same body with a friction that falls: a load increase has to leave the branch there."""
    graph = whole_graph(
        fold_beside_grazing(0.25).replace(friction=np.array([5.0, 5.0]), friction_slope=[-1.0, 0.0]), (0, 5)
    )
    (vertex,) = (v for v in graph.vertices if v.kind == "terminal")
    assert vertex.alpha == pytest.approx(7 / 3, abs=1e-15)
    assert vertex in graph.jumps


def test_pushed_to_the_other_side_both_statuses_hold():
    graph = whole_graph(fold_beside_grazing(-0.25), (0, 5))
    assert Counter(v.kind for v in graph.vertices if not v.border) == {"bifurcation": 1, "fold": 1}


@pytest.mark.few(0, 1)
@pytest.mark.parametrize("block", range(3))
def test_no_complete_graph_has_a_vertex_that_is_broken(block):
    """Small numbers full of coincidences: folds, corners, sheets and arcs of degree 0."""
    kinds, degrees, compared = Counter(), Counter(), 0
    for seed in range(some(9, of=18)):
        rng = np.random.default_rng([77, block, seed])
        problem = beside_grazing(rng) if seed % 3 else integer_problem(rng, 2, "friction")
        graph = branch_graph(problem, (0, 5))
        assert graph.complete, (block, seed, graph.reasons)
        balanced(graph)
        kinds.update(v.kind for v in graph.vertices)
        degrees.update(arc.index for arc in graph.arcs if arc.grazing)
        alpha = float(rng.uniform(0, 5))
        roots = enumerate_roots(problem, alpha)
        if roots.complete:
            assert graph.multiplicity_at(alpha) == len(roots) + len(roots.families)
            compared += 1
    assert kinds["broken"] == 0
    assert kinds["terminal"] > 0
    assert degrees[0] > 0
    assert compared >= some(6, of=12)


@pytest.mark.parametrize(
    ("left", "right", "kind"),
    [
        ([0], [], "terminal"),
        ([], [0], "terminal"),
        ([1], [], "broken"),
        ([], [-1], "broken"),
        ([1], [-1], "broken"),
        ([1, 1], [], "broken"),
        ([1, -1], [1], "broken"),
        ([1, -1], [], "fold"),
        ([1], [1], "transition"),
        ([1, 1, -1], [1], "bifurcation"),
        ([0, 1], [1], "bifurcation"),
        ([None], [], "terminal"),
    ],
)
def test_degrees_that_do_not_balance_show_that_something_is_missing(left, right, kind):
    numbers = count()
    sides = (
        [SimpleNamespace(index=k, dimension=0, selections=(next(numbers),)) for k in side] for side in (left, right)
    )
    assert vertex_kind(*sides, border=False, dimension=0) == kind


def test_kinds_are_read_back(tmp_path):
    graph = branch_graph(fold_beside_grazing(0.25), (0, 5))
    graph.save(tmp_path / "graph.json")
    again = BranchGraph.load(tmp_path / "graph.json")
    assert again.complete
    assert [v.kind for v in again.vertices] == [v.kind for v in graph.vertices]


def test_every_kind_has_a_mark_in_figures_and_in_reports():
    page = (Path(enumsol.__file__).parent / "report" / "page.js").read_text(encoding="utf-8")
    symbols = re.search(r"const SYMBOLS = \{(.*?)\n\};", page, re.DOTALL)[1]
    named = dict(re.findall(r'(\w+): \["[\w-]+", "([^"]+)"\]', symbols))
    assert set(MARKERS) == set(VertexKind) - UNMARKED
    assert set(named) == set(VertexKind) - {VertexKind.SHEET, VertexKind.END}
    assert all(named[kind] == label for kind, (_, _, label) in MARKERS.items())
