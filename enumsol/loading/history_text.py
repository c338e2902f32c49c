"""Histories in text: a table of the steps, the tree, and what is proven."""

from __future__ import annotations

from typing import TYPE_CHECKING

from enumsol.roots.root import summary
from enumsol.support.messages import counted, html_lines, html_table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.loading.history_data import HistoryData

#: Lines of the tree, steps of the table and reasons that are printed at most.
_TREE, _STEPS, _REASONS = 40, 40, 8
#: How the line of a node below a branching begins, and the lines below it; of the last one otherwise.
_BRANCH = {True: ("└─ ", "   "), False: ("├─ ", "│  ")}
_HEADS = ("step", "alpha", "roots", "from", "histories", "dissipated")


def history_text(history: HistoryData) -> str:
    """What print shows."""
    rows = [_HEADS, *_rows(history)]
    widths = (4, 10, 6, 5, 10, 11)
    table = [" ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in rows]
    left = len(history.steps) - _STEPS
    more = [f"   ... {counted(left, 'more step')}"] if left > 0 else []
    return "\n".join([_heading(history), *table, *more, "tree", *tree_lines(history), *_notes(history)])


def history_html(history: HistoryData) -> str:
    """What a notebook shows."""
    tree = html_lines(["tree", *tree_lines(history)])
    return html_lines([_heading(history)]) + html_table(_HEADS, _rows(history)) + tree + html_lines(_notes(history))


def steps_table(history: HistoryData) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heads and rows of the table of the steps."""
    return _HEADS, _rows(history)


def tree_lines(history: HistoryData, most: int = _TREE) -> Iterator[str]:
    """The tree, a line per node: only below a branching it is indented.

    What follows a node that several lead to stands below the first of them.
    """
    graph, last, seen = history.graph, len(history.steps), set()
    pending = [(node, "", "") for node in reversed(list(graph.successors((0, 0))))]
    if len(pending) > 1:
        pending = [(node, *_BRANCH[k == 0]) for k, (node, _, _) in enumerate(pending)]
    written = 0
    while pending:
        node, first, rest = pending.pop()
        written += 1
        if written > most:
            continue
        left = "" if node[0] == last or node in history.followed else " (not followed)"
        again = " (see above)" if node in seen else ""
        yield f"{first}{node[0]}.{node[1]} {summary(graph.nodes[node]['statuses'])}{left}{again}"
        if node in seen:
            continue
        seen.add(node)
        following = list(reversed(list(graph.successors(node))))
        for k, child in enumerate(following):
            begin, go_on = _BRANCH[k == 0] if len(following) > 1 else ("", "")
            pending.append((child, rest + begin, rest + go_on))
    if written > most:
        yield f"... {counted(written - most, 'more line')} at least"


def _heading(history: HistoryData) -> str:
    total = history.counts[-1]
    found = counted(total, "history", "histories") if total else "none reaches the last step"
    return f"History of {counted(len(history.steps), 'step')}: {found} ({history.arithmetic})"


def _rows(history: HistoryData) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for number in range(1, min(len(history.steps), _STEPS) + 1):
        nodes = history.nodes_of(number)
        work = [history.dissipated[node] for node in nodes]
        span = "" if not work else _span(min(low for low, _ in work), max(high for _, high in work))
        alpha = history.steps[number - 1].alpha
        rows.append(
            (
                str(number),
                "" if alpha is None else f"{float(alpha):.6g}",
                str(len(nodes)),
                str(len(history.stages_of(number))),
                str(history.counts[number - 1]),
                span,
            )
        )
    return rows


def _span(low: float, high: float) -> str:
    a, b = (f"{value + 0.0:.4g}" for value in (low, high))
    return a if a == b else f"{a} to {b}"


def _notes(history: HistoryData) -> list[str]:
    lines = [f"open: {reason}" for reason in history.reasons[:_REASONS]]
    if len(history.reasons) > _REASONS:
        lines.append(f"   ... {len(history.reasons) - _REASONS} more reasons")
    if history.refinement is not None:
        lines.append(f"increments: {history.refinement}")
    return [*lines, history.completeness()]
