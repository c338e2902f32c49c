"""Are the paper's examples reproduced?

Three tables. The first (``one_node.py``) compares the exact branch graphs of the paper's Examples 6.1 to 6.3, and of
6.3' (a perturbed 6.3), with every printed fact; a fact that fails stops the study. The second (``two_nodes.py``)
applies the loads of 6.4 to 6.7 to ``gallery.two_node_square``: the paper's coordinates were never published, so that
its printed numbers are not to be expected here; they stand beside ours. The third (``walks.py``) follows every branch
of every graph by the paper's Algorithm 5.1 with its settings, from each end of the branch: every transition must be
passed in both directions, and the audit must miss nothing.

Read the figures ``paper_6.*`` as the paper's: dots are the accepted steps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol import branch_graph, gallery
from paper_examples.one_node import INTERVAL, ONE_NODE, Facts
from paper_examples.two_nodes import TWO_NODES, own_row
from paper_examples.walks import continuation_row, draw

if TYPE_CHECKING:
    from shared.results import Run

#: The paper's range of h_max; its other settings are the defaults.
LONGEST, SMOKE_LONGEST = (0.1, 1.0, 5.0), (5.0,)
SMOKE_ONE, SMOKE_TWO = ("6.1", "6.3"), ("6.4",)


def solved(name, interval):
    """A problem of the gallery and its graph."""
    problem = gallery.get(name).build()
    graph = branch_graph(problem, interval, "exact")
    assert graph.complete
    return problem, graph


def main(run: Run) -> None:
    facts, own, continuation = Facts(), [], []
    longest = SMOKE_LONGEST if run.smoke else LONGEST
    for example in SMOKE_ONE if run.smoke else ONE_NODE:
        name, f, check = ONE_NODE[example]
        problem, graph = solved(name, INTERVAL)
        check(facts, example, graph, f)
        continuation += [continuation_row(example, problem, graph, h_max) for h_max in longest]
        title = f"Example {example}, f = ({f[0]:g}, {f[1]:g})"
        run.figure(f"paper_{name.removeprefix('one-node-')}", draw(title, problem, graph))
    for example in SMOKE_TWO if run.smoke else TWO_NODES:
        name, interval = TWO_NODES[example]
        problem, graph = solved(name, interval)
        short = name.removeprefix("two-node-")
        own.append(own_row(example, graph))
        continuation += [continuation_row(f"{short} (own)", problem, graph, h_max) for h_max in longest]
        run.figure(f"paper_{short}", draw(f"Own geometry, loads of Example {example}", problem, graph))
    run.table("paper_examples", facts.rows, f"all {len(facts.rows)} facts hold")
    run.table(
        "paper_examples_own",
        own,
        "own geometry: the paper's coordinates are not known, its numbers not expected",
    )
    run.table(
        "paper_examples_continuation",
        continuation,
        "every transition and fold was passed in both directions; no arc or continuum missed, no jump",
    )
