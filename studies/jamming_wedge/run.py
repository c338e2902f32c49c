"""From which coefficient of friction on does a wedge jam, in how many ways, and does the mesh matter?

A wedge of P1 triangles is pressed into a notch by a negative gap, and pulled out of it at its top, a little sideways;
weak springs hold it there. It is that of `docs/tutorial.md`. Branch graphs over F = alpha from 0 to 4 on finer and
finer meshes: ``3 from`` is the coefficient from which on there are three solutions, ``5 from`` and ``7 from`` likewise.
Pulled free, it is a solution at every alpha; the others are jammed. The picture shows the graph and the bodies at
alpha = 4 on the mesh of the tutorial.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import enumsol
from enumsol import fem
from enumsol.support.plotting import new_figure
from shared.results import series, yes

if TYPE_CHECKING:
    from shared.results import Run

#: Cells across the wedge and along its height; the first is the mesh of the tutorial.
MESHES, SMOKE_MESHES = ((6, 4), (8, 6), (12, 8), (16, 11)), ((6, 4),)
#: The interval ends here, and the bodies are drawn here.
LAST = 4.0


def wedge(nx: int, ny: int) -> enumsol.ContactProblem:
    return fem.mesh_problem(
        fem.trapezoid(nx, ny, bottom=1.0, top=1.8, height=1.0).parted(),
        young=2.5,
        poisson=0.25,
        contact=["left", "right"],
        gap=-5e-4,
        friction=(0.0, 1.0),
        spring={"top": (0.02, 0.02)},
        load={"top": (1e-4, 1e-3)},
    )


def since(graph: enumsol.BranchGraph, count: int) -> float:
    """The first alpha after which there are at least so many solutions; nan if there is none."""
    alphas, _, between = graph.steps
    return next((float(alpha) for alpha, number in zip(alphas, between, strict=False) if number >= count), float("nan"))


def row(size: tuple[int, int], graph: enumsol.BranchGraph, p: int) -> dict[str, Any]:
    counts = graph.steps[2]
    return {
        "cells": f"{size[0]}x{size[1]}",
        "p": p,
        **{f"{count} from": since(graph, count) for count in (3, 5, 7)},
        "most": max(counts),
        "changes": sum(one != two for one, two in itertools.pairwise(counts)),
        "folds": len(graph.folds),
        "transitions": len(graph.transitions),
        "complete": yes(graph.complete),
    }


def picture(graph: enumsol.BranchGraph) -> Any:
    """The branches above, the bodies of all solutions at the last alpha below."""
    figure = new_figure(figsize=(10.0, 6.4))
    roots = graph.roots_at(LAST)
    above, below = figure.subfigures(2, 1, height_ratios=(2.4, 1.0))
    graph.plot(title="A wedge that jams", ax=above.subplots())
    below.suptitle(f"all {len(roots)} solutions at alpha = {LAST:g}, displacements enlarged for each", fontsize=9)
    entries = {}
    for k, (root, ax) in enumerate(zip(roots, below.subplots(1, len(roots)), strict=True)):
        root.plot_body(ax)
        legend = ax.get_legend()
        texts = [text.get_text() for text in legend.get_texts()]
        entries.update(zip(texts, legend.legend_handles, strict=True))
        legend.remove()
        ax.set_title(f"solution {k}, index {root.index:+d}", fontsize=9)
        ax.set_axis_off()
    below.legend(entries.values(), entries, loc="outside lower center", ncols=len(entries), fontsize=8, frameon=False)
    return figure


def main(run: Run) -> None:
    rows = []
    for size in SMOKE_MESHES if run.smoke else MESHES:
        problem = wedge(*size)
        graph = enumsol.branch_graph(problem, (0.0, LAST))
        rows.append(row(size, graph, problem.p))
        if size == MESHES[0]:
            run.figure("jamming_wedge", picture(graph))
    run.table(
        "jamming_wedge",
        rows,
        f"all complete, proven: {yes(all(row['complete'] == 'yes' for row in rows))}",
        f"jams from F = {series(rows, '3 from')}, from coarse to fine; at most {series(rows, 'most')} solutions",
    )
