"""``enumsol graph``: all solutions over an interval of alpha."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from enumsol.cli.common import (
    LIMITS,
    OUTPUT,
    PLOT,
    Arithmetic,
    ExitStatus,
    FromOption,
    JsonOption,
    PlotOption,
    ProblemArgument,
    QuantityOption,
    ToOption,
    finish,
    load_problem,
    node_row,
    note,
    parse_interval,
)
from enumsol.cli.output import (
    as_json,
    check_outputs,
    check_plot,
    check_writable,
    deliver,
    write_figure,
    write_text,
    writing,
)
from enumsol.cli.progress import Display
from enumsol.errors import Interrupted, InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.branches import BranchGraph
    from enumsol.checks import Alpha
    from enumsol.problem import ContactProblem


def graph(
    problem: ProblemArgument,
    first: FromOption,
    last: ToOption,
    arithmetic: Annotated[
        Arithmetic,
        typer.Option(
            help="verified: rigorous error bounds, proven. fast: the search believes floats, never proven. "
            "exact: rationals throughout, proven, slow beyond ten contact nodes."
        ),
    ] = "verified",
    max_nodes: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Stop after N nodes of the tree.", rich_help_panel=LIMITS)
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Stop the search after so long.", rich_help_panel=LIMITS)
    ] = None,
    save_file: Annotated[
        str | None,
        typer.Option(
            "--save", metavar="FILE", help="Write the graph, for enumsol audit and follow.", rich_help_panel=OUTPUT
        ),
    ] = None,
    json_file: JsonOption = None,
    csv_file: Annotated[
        str | None,
        typer.Option("--csv", metavar="FILE", help="Write one row an arc; - is stdout.", rich_help_panel=OUTPUT),
    ] = None,
    proof_file: Annotated[
        str | None,
        typer.Option(
            "--proof", metavar="FILE", help="Write the proof (verified), for enumsol verify.", rich_help_panel=OUTPUT
        ),
    ] = None,
    graphml_file: Annotated[
        str | None,
        typer.Option("--graphml", metavar="FILE", help="Write GraphML for other programs.", rich_help_panel=OUTPUT),
    ] = None,
    plot_file: PlotOption = None,
    quantity: QuantityOption = "lambda_n",
    nodes: Annotated[
        str | None,
        typer.Option(
            metavar="LABELS",
            help="Contact nodes to draw, such as 0,3; default: up to three.",
            rich_help_panel=PLOT,
            show_default=False,
        ),
    ] = None,
) -> None:
    """Find all solutions of PROBLEM for every alpha of an interval, as branches of exact arcs.

    Prints branches, folds, bifurcations and continua, and whether the graph is complete.

    Exit status: 0 when complete (in fast arithmetic, which proves nothing: when the degrees balance at every vertex);
    3 when the graph is known to be incomplete; 2 on bad input; 130 on Ctrl-C, after printing the graph so far; 74 when
    a result could not be written, 141 when nobody read it any more.
    """
    check_outputs(json=json_file, csv=csv_file)
    for option, path in (("--save", save_file), ("--graphml", graphml_file), ("--proof", proof_file)):
        if path == "-":
            raise InvalidArgumentError(f"{option} is -; expected the name of a file")
        check_writable(path, option)
    check_plot(plot_file)
    interval, body = parse_interval(first, last), load_problem(problem)
    chosen = None if nodes is None else [body.node_ids[node_row(body, label.strip())] for label in nodes.split(",")]
    ended: Interrupted | None = None
    found: Any
    try:
        found = build(body, interval, arithmetic, max_nodes=max_nodes, time_limit=time_limit)
    except Interrupted as interruption:
        ended, found = interruption, interruption.partial
    deliver(
        None if "-" in (json_file, csv_file) else lambda: typer.echo(as_text(found)),
        None if json_file is None else lambda: write_text(json_file, as_json({"problem": problem, **_content(found)})),
        None if csv_file is None else lambda: write_text(csv_file, found.to_frame().to_csv(index=False)),
        None if proof_file is None else lambda: _write_proof(found, proof_file),
        None if save_file is None else lambda: _write(found.save, save_file),
        None if graphml_file is None else lambda: _write(found.write_graphml, graphml_file),
        None if plot_file is None else lambda: write_figure(plot_file, found.plot(quantity, chosen)),
    )
    finish(ended, ExitStatus.INCOMPLETE if found.reasons else ExitStatus.DONE)


def _write_proof(found: BranchGraph, file: str) -> None:
    if found.proof is None:
        why = "only verified arithmetic gives one" if found.arithmetic != "verified" else "this search gave none"
        note(f"no proof was written, {why}")
        return
    _write(found.proof.save, file)


def _write(save: Callable[[str], object], file: str) -> None:
    with writing(file):
        save(file)


def build(
    problem: ContactProblem,
    interval: tuple[Alpha, Alpha],
    arithmetic: Arithmetic = "verified",
    **limits: Any,
) -> BranchGraph:
    """The graph, with progress on stderr."""
    from enumsol.branches import branch_graph

    with Display("branch graph") as display:

        def progress(stage: str, share: float) -> None:
            display.show(share, stage)

        return branch_graph(problem, interval, arithmetic, progress=progress, **limits)


def read_graph(file: str, problem: ContactProblem) -> BranchGraph:
    """The graph in a file, which must be one of this problem.

    Raises
    ------
    InvalidArgumentError
        The file is not a saved graph, or one of another problem.
    """
    from enumsol.branches import BranchGraph

    found = BranchGraph.load(file)
    if not _same_problem(found.problem, problem):
        raise InvalidArgumentError(f"--graph is {file}, a graph of another problem; expected one of PROBLEM")
    return found


def _same_problem(a: ContactProblem, b: ContactProblem) -> bool:
    if (a.n, a.p) != (b.n, b.p) or any((getattr(a, name) != getattr(b, name)).nnz for name in ("A", "Bn", "Bt")):
        return False
    import numpy as np  # not for --help

    pairs = [(getattr(a, name), getattr(b, name)) for name in ("f", "gap", "slip_offset")]
    slopes = [np.zeros(a.n) if item.load_slope is None else item.load_slope for item in (a, b)]
    return all(np.array_equal(x, y) for x, y in [*pairs, *zip(a.friction, b.friction, strict=True), tuple(slopes)])


def as_text(found: BranchGraph) -> str:
    """The printed graph, and before its closing line the answers that users ask for."""
    *lines, closing = repr(found).splitlines()
    lines += found.claims.sentences(found.uniqueness_bound)
    if found.bifurcations:
        lines.append("bifurcations at alpha = " + ", ".join(f"{v.alpha:.8g}" for v in found.bifurcations[:8]))
    if found.jumps:
        lines.append("jumps with increasing alpha at " + ", ".join(f"{v.alpha:.8g}" for v in found.jumps[:8]))
    return "\n".join([*lines, closing])


def _content(found: BranchGraph) -> dict[str, Any]:
    branches = [
        {
            "branch": branch.number,
            "component": branch.component,
            "closed": branch.closed,
            "sheet": branch.sheet,
            "arcs": [arc.number for arc in branch.arcs],
            "vertices": [v.number for v in branch.vertices],
        }
        for branch in found.branches
    ]
    arcs, vertices = found.to_frame(), found.vertices_frame()
    return {
        **found.summary(),
        "completeness": found.completeness(),
        "branch_list": branches,
        "arc_list": arcs.to_dict("records"),
        "vertex_list": vertices.to_dict("records"),
    }
