"""Pieces of graphs of bodies that nothing holds, closed by their arcs (theory, section 14.16), in both checkers."""

import functools
from fractions import Fraction

import numpy as np
import pytest
from branches.test_floating_graphs import varying
from complete import accepted_report, whole_graph
from effort import some
from floating_bodies import pushed_block
from floating_oracle import Oracle
from proof_tools import copied, of_kind, proof_of, records_of, replaced
from rational_checker import check_records
from rational_forms import Refused

import enumsol
from enumsol import fem
from enumsol.branches import ways


@pytest.fixture(autouse=True, scope="module")
def in_balls():
    """Graphs of small bodies are made in balls, as those of large ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ways, "FAST_EXACT_DOF", 0)
        yield


@functools.cache
def proven(cells=1, ends=(0.25, 0.75)):
    problem = pushed_block(cells)
    graph = whole_graph(problem, ends)
    return problem, graph, records_of(graph.proof)


def test_one_branch_needs_no_tree_and_no_bound():
    problem, graph, records = proven()
    assert graph.stats.nodes == 0
    assert (graph.stats.closed, graph.stats.bounded) == (1, 0)
    assert {len(of_kind(records, kind)) > 0 for kind in "qoi"} == {True}
    assert not of_kind(records, "x")
    assert graph.closing_line == "complete: yes (proven)"
    report = accepted_report(problem, graph.proof)
    assert (report.complete, report.within, report.closed) == (True, None, 1)
    assert check_records(problem, records) == report.selections
    for alpha in (0.25, 0.375, 0.625, 0.75):
        oracle = Oracle(problem, Fraction(alpha))
        assert len(oracle.points) == graph.multiplicity_at(alpha) == 1


def test_what_a_graph_rests_on_is_kept(tmp_path):
    _, graph, _ = proven()
    graph.save(tmp_path / "graph.json")
    assert enumsol.BranchGraph.load(tmp_path / "graph.json").closing_line == graph.closing_line


@pytest.mark.slow
@pytest.mark.parametrize("ends", [(0.25, 0.75), (0.5, 0.875)])
def test_a_piece_may_be_closed_beside_others(ends):
    problem, graph, records = proven(2, ends)
    report = accepted_report(problem, graph.proof)
    assert (report.within is None) == (graph.stats.bounded == 0)
    assert report.closed > 0
    assert check_records(problem, records) == report.selections


def test_both_checkers_agree_about_random_bodies():
    closed = 0
    for seed in [23, 27, 8, 25, *range(30, 130)][: some(3, of=60)]:
        problem = varying(seed)
        graph = enumsol.branch_graph(problem, (0, 2))
        if graph.proof is None or not graph.complete:
            continue
        records = records_of(graph.proof)
        report = accepted_report(problem, graph.proof)
        assert check_records(problem, records) == report.selections, seed
        assert (report.within is None) == (graph.stats.bounded == 0), seed
        closed += bool(of_kind(records, "o"))
    assert closed > some(2, of=6)


def refused(records, *, by_both=True):
    problem = proven()[0]
    report = enumsol.verify(problem, proof_of(records))
    assert not report.ok
    if by_both:
        with pytest.raises(Refused):
            check_records(problem, records)
    return " ".join(report.failures)


def test_forged_forms():
    records = proven()[2]
    (place,) = of_kind(records, "q")
    _, selections, numbers, more = records[place]
    p, (balance, share, degree) = records[0]["p"], more
    wrong = [
        *([], [balance, share], [-1.0, share, degree], [balance, share, 0], [balance, share, 33]),
        *([balance, share, 1.5], [balance, None, degree]),
    ]
    for others in wrong:
        refused(replaced(records, place, ["q", selections, numbers, others]))
    for others in ([-numbers[0], *numbers[1:]], [*numbers[:-p], *[1e9] * p], numbers[1:], [*numbers, 0.0]):
        refused(replaced(records, place, ["q", selections, others, more]))
    for others in ([], selections[0], [[*selections[0], 0]], [[9, *selections[0][1:]]], [None]):
        refused(replaced(records, place, ["q", others, numbers, more]))
    refused(replaced(records, place, records[place][:3]))
    steep = [*numbers[:p], *[1e6] * p, *numbers[2 * p :]]
    for record in (["q", selections, numbers, [balance, 100.0, degree]], ["q", selections, steep, more]):
        # the other checker asks nothing of what G d = 0 makes vanish
        assert "not proven" in refused(replaced(records, place, record), by_both=False)


def test_forged_leaves():
    records = proven()[2]
    p = records[0]["p"]
    for place in of_kind(records, "o"):
        _, back, rows, products = records[place]
        refused(fewer(records, place))
        refused(replaced(records, place, ["o", 2, rows, products]))
        refused(replaced(records, place, ["o", 0, rows, products]))
        refused(replaced(records, place, ["o", back, rows]))
        refused(replaced(records, place, ["o", back, rows, products, [0.0], [0.0], 1]))
        if products:
            refused(replaced(records, place, ["o", back, rows, []]))
            refused(replaced(records, place, ["o", back, rows, [[*products[0][:2], -1.0]]]))
            refused(replaced(records, place, ["o", back, rows, [[*products[0][:2], 1e9]]]))
        else:
            refused(replaced(records, place, ["o", back, [], []]))
        # rows that the root does not have as equations, as its nodes slip or the assignment leaves them free
        refused(replaced(records, place, ["o", back, [*range(4 * p, 6 * p)], products]))
    for place in of_kind(records, "i"):
        _, z = records[place]
        refused(fewer(records, place))
        for direction in ([-x for x in z], [0.0 * x for x in z], z[1:]):
            refused(replaced(records, place, ["i", direction]))
    # at the root of the tree
    (form,) = of_kind(records, "q")
    end = next(k for k, record in enumerate(records) if "traces" in record)
    for place in of_kind(records, "o", "i"):
        counts = {**records[-1], "leaves": 1}
        refused([*records[: form + 1], records[place], *records[end:-1], counts])


def fewer(records, place):
    """Records without a leaf, which is not counted either."""
    found = copied(records)
    del found[place]
    found[-1]["leaves"] -= 1
    return found


def test_leaves_before_the_form():
    """Of leaves x beside arcs it is told whether they need the bound of the rigid displacement."""
    problem = varying(54)
    graph = enumsol.branch_graph(problem, (0, 2))
    records = records_of(graph.proof)
    assert accepted_report(problem, graph.proof).within == problem.rigid_reach
    (form,) = of_kind(records, "q")
    assert min(of_kind(records, "x")) > form
    place = of_kind(records, "o", "i")[0]
    moved = [*records[:form], *records[form + 1 : place + 1], records[form], *records[place + 1 :]]
    assert "no" in " ".join(enumsol.verify(problem, proof_of(moved)).failures)
    with pytest.raises(Refused, match="not declared"):
        check_records(problem, moved)


def test_a_branch_on_which_a_node_that_sticks_loses_its_force():
    problem = varying(56)
    graph = whole_graph(problem, (0, 2))
    assert check_records(problem, records_of(graph.proof)) == accepted_report(problem, graph.proof).selections


def test_leaves_without_the_form():
    records = copied(proven()[2])
    (place,) = of_kind(records, "q")
    del records[place]
    assert "not declared" in refused(records)


def block_on_slab(push=0.2, slope=1.0):
    """Half a thousand degrees of freedom, 11 contact nodes, three rigid modes."""
    slab, block = fem.rectangle(40, 4, length=4.0, height=1.0).parted(), fem.rectangle(10, 4).parted()
    count = len(slab.points)
    parts = {"floor": slab.part("bottom"), "slab": slab.part("top")}
    parts |= {name: block.part(side) + count for name, side in SIDES.items()}
    points, cells = [slab.points, block.points + 1.0], [slab.cells, block.cells + count]
    both = fem.PartedMesh(np.concatenate(points), np.concatenate(cells), parts)
    return fem.mesh_problem(
        both, young=210.0, poisson=0.3, pairs=[("block", "slab")], clamp="floor", pressure={"roof": 1.0},
        load={"side": (push, 0.0)}, load_slope={"side": (slope, 0.0)}, friction=0.3, max_rigid_displacement="auto",
    )  # fmt: skip


SIDES = {"block": "bottom", "roof": "top", "side": "left"}


def test_a_block_on_a_slab_of_more_degrees_of_freedom_than_exact_algebra_takes():
    problem = block_on_slab()
    assert problem.n > 250
    graph = whole_graph(problem, (0, 0.02))
    assert (graph.stats.nodes, graph.stats.bounded, len(graph.arcs)) == (0, 0, 1)
    assert accepted_report(problem, graph.proof).within is None
    (arc,) = graph.arcs_at(0.015)
    (root,) = enumsol.enumerate_roots(problem, 0.015)
    assert np.allclose(arc.values(0.015), (root.lambda_n, root.lambda_t), rtol=1e-9, atol=1e-12)
