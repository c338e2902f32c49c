"""Branch graphs with and without pieces that need no tree."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import enumsol
from enumsol import ContactProblem, gallery
from shared.clock import timed

#: Cells of the blocks and wedges whose graphs are made, and contact nodes up to which trees alone are asked as well.
BLOCKS, WEDGES, TREE_P = (32, 64, 100), (4, 7), 64


def graphs(*, smoke: bool) -> list[dict[str, Any]]:
    """A row for every graph."""
    small = gallery.clamped_block(8, 4)
    row("", small)  # imports once more
    if smoke:
        return [row("block 8x4", small)]
    blocks = [row(f"block {nx}x16", gallery.clamped_block(nx, 16, nx / 64)) for nx in BLOCKS]
    return blocks + [row(f"wedge 4x{ny}", gallery.wedge(4, ny)) for ny in WEDGES]


def row(name: str, problem: ContactProblem) -> dict[str, Any]:
    """One graph, and where that is affordable by trees alone."""
    problem.condensed, problem.enclosure  # noqa: B018 (made once, outside the clock)
    graph, taken = timed(enumsol.branch_graph, problem, (0.0, 3.0))
    checked, proof_taken = timed(enumsol.verify, problem, graph.proof)
    assert checked.complete
    by_tree: dict[str, Any] = {"tree nodes": "-", "tree s": "-"}
    if problem.p <= TREE_P:
        with patch("enumsol.branches.enclosed.single_branches.ClosedPieces.find", lambda self, traced: None):
            tree, tree_taken = timed(enumsol.branch_graph, problem, (0.0, 3.0))
        assert [arc.statuses for arc in tree.arcs] == [arc.statuses for arc in graph.arcs]
        by_tree = {"tree nodes": tree.stats.nodes, "tree s": tree_taken}
    return {
        "problem": name,
        "p": problem.p,
        "arcs": len(graph.arcs),
        "pieces": graph.stats.pieces,
        "closed": graph.stats.closed,
        "nodes": graph.stats.nodes,
        "seconds": taken,
        "proof s": proof_taken,
        **by_tree,
    }
