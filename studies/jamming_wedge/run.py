"""From which coefficient of friction on does a wedge jam or a taper hold, in how many ways, and does the mesh matter?

A wedge of P1 triangles is pressed into a notch by a negative gap, and pulled out of it at its top, a little sideways;
weak springs hold it there. It is that of `docs/tutorial.md`, wide and soft. Branch graphs over F = alpha from 0 to 4
on finer and finer meshes: ``3 from`` is the coefficient from which on there are three solutions, ``5 from`` and
``7 from`` likewise. Pulled free, it is a solution at every alpha; the others are jammed. The picture shows the graph
and the bodies at alpha = 4 on the mesh of the tutorial. The same with the slender steel taper of the gallery, which
jams at the friction that machine tools have: F from 0 to 0.4, and the bodies at 0.2.
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
TAPERS, SMOKE_TAPERS = ((4, 4), (4, 7), (4, 10)), ((4, 4),)
#: The interval of the wedge ends here, and its bodies are drawn here.
LAST = 4.0
#: Where the interval of the taper ends, the mesh that is drawn, and where its bodies are.
LAST_OF_TAPER, DRAWN, AT = 0.4, (4, 7), 0.2


def wedge(nx: int, ny: int) -> enumsol.ContactProblem:
    return fem.mesh_problem(
        fem.trapezoid(nx, ny, bottom=1.0, top=1.8, height=1.0).parted(),
        young=2.5,
        poisson=0.25,
        contact=["left", "right"],
        gap=-5e-4,
        friction=0.0,
        friction_slope=1.0,
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


def picture(graph: enumsol.BranchGraph, alpha: float, title: str) -> Any:
    """The branches, and the bodies of all solutions at one alpha: below, slender ones beside."""
    roots = graph.roots_at(alpha)
    verdicts = roots.stability()
    graph.stability()
    columns = 5
    if len(roots) > 3:
        figure = new_figure(figsize=(10.0, 6.4))
        above, below = figure.subfigures(2, 1, height_ratios=(2.4, 1.0))
    else:
        figure, columns = new_figure(figsize=(11.0, 4.8)), 3
        above, below = figure.subfigures(1, 2, width_ratios=(1.5, 1.0))
    graph.plot(title=title, ax=above.subplots())
    below.suptitle(f"all {len(roots)} solutions at alpha = {alpha:g}, displacements enlarged for each", fontsize=9)
    entries = {}
    for k, (root, ax) in enumerate(zip(roots, below.subplots(1, len(roots)), strict=True)):
        root.plot_body(ax)
        legend = ax.get_legend()
        texts = [text.get_text() for text in legend.get_texts()]
        entries.update(zip(texts, legend.legend_handles, strict=True))
        legend.remove()
        ax.set_title(f"solution {k}\n{verdicts[k].verdict}", fontsize=9)
        ax.set_axis_off()
    below.legend(entries.values(), entries, loc="outside lower center", ncols=columns, fontsize=8, frameon=False)
    return figure


def main(run: Run) -> None:
    rows = []
    for size in SMOKE_MESHES if run.smoke else MESHES:
        problem = wedge(*size)
        graph = enumsol.branch_graph(problem, (0.0, LAST))
        rows.append(row(size, graph, problem.p))
        if size == MESHES[0]:
            run.figure("jamming_wedge", picture(graph, LAST, "A wedge that jams"))
    run.table(
        "jamming_wedge",
        rows,
        f"all complete, proven: {yes(all(row['complete'] == 'yes' for row in rows))}",
        f"jams from F = {series(rows, '3 from')}, from coarse to fine; at most {series(rows, 'most')} solutions",
    )
    rows = []
    for size in SMOKE_TAPERS if run.smoke else TAPERS:
        problem = enumsol.gallery.taper(*size)
        graph = enumsol.branch_graph(problem, (0.0, LAST_OF_TAPER))
        rows.append(row(size, graph, problem.p))
        if size == DRAWN or run.smoke:
            run.figure("taper", picture(graph, AT, "A self-holding taper of steel"))
    run.table(
        "taper",
        rows,
        f"all complete, proven: {yes(all(row['complete'] == 'yes' for row in rows))}",
        f"holds from F = {series(rows, '3 from')}, from coarse to fine; at most {series(rows, 'most')} solutions",
    )
