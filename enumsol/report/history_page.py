"""The page about a history: its steps, tree, figures, the bodies of every step, and what is certified."""

from __future__ import annotations

import base64
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.loading.history_data import steps_table, tree_lines
from enumsol.report.given import given_section
from enumsol.report.parts import fact_list, filled_page, proof_facts, scrolling, warning_list
from enumsol.support.messages import counted, html_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.fem import Scene
    from enumsol.loading.history import History

#: Lines of the tree, and steps whose bodies are drawn, at most; of more steps the last ones.
_TREE, _BODIES = 1000, 24
_DPI = 96


def history_page(
    history: History, title: str, units: tuple[str, str] | None, commands: Sequence[str], scene: Scene | None
) -> str:
    """The text of the page."""
    words = {
        "title": escape(title),
        "plotly": "",
        "badge": "yes" if history.complete else "no",
        "completeness": escape(history.closing_line),
        "reasons": _reasons(history),
        "answers": "",
        "facts": _facts(history),
        "given": given_section(scene, units),
        "steps": scrolling("Steps", html_table(*steps_table(history.data, units))),
        "tree": escape("\n".join(tree_lines(history.data, _TREE))),
        "figures": _figures(history, units),
        "bodies": _bodies(history, units),
        "certified": _certified(history, commands),
    }
    return filled_page("history", ("page.theme.js", "page.history.js"), {}, words)


def _reasons(history: History) -> str:
    if not history.reasons:
        return ""
    return warning_list(
        "This history is not complete. Every root shown is a solution of its step, but roots and histories may be "
        "missing. Why:",
        history.reasons,
    )


def _facts(history: History) -> str:
    problem = history.problem
    total = history.counts[-1]
    facts = (
        ("contact nodes", str(problem.p)),
        ("degrees of freedom", f"{problem.n:,}"),
        ("steps", str(len(history.steps))),
        ("histories", f"{total:,}{'' if history.complete else ' found'}" if total else "none reaches the last step"),
        ("branchings", str(len(history.branchings))),
        ("arithmetic", history.arithmetic),
        ("increments", "not halved" if history.refinement is None else str(history.refinement)),
    )
    return fact_list(facts)


def _figures(history: History, units: tuple[str, str] | None) -> str:
    pairs = (("displacement", "alpha"), ("step", "dissipated"), ("step", "lambda_n"), ("displacement", "lambda_t"))
    moves = any(step.alpha is not None for step in history.steps)
    return "".join(
        _image(history.plot(x, y, units=units), f"{y} against {x}") for x, y in pairs if moves or y != "alpha"
    )


def _bodies(history: History, units: tuple[str, str] | None) -> str:
    from enumsol.roots.body_plots import draw_bodies  # matplotlib comes with the first picture

    shown = [number for number in range(1, len(history.steps) + 1) if history.nodes_of(number)][-_BODIES:]
    pictures = {}
    for number in shown:
        try:
            drawn = draw_bodies(history.roots(number), units=units)
            pictures[number] = _image(drawn, f"deformed bodies of step {number}")
        except InvalidArgumentError as error:
            return f"<p>They are not drawn: {escape(str(error))}.</p>"
    if not pictures:
        return "<p>There are none.</p>"
    choices = "".join(f'<option value="{number}"{_last(number, shown)}>{number}</option>' for number in shown)
    parts = "".join(f'<div data-step="{number}">{picture}</div>' for number, picture in pictures.items())
    return (
        f'<div class="controls"><label>step <select id="step">{choices}</select></label></div>'
        f'<p class="hint">All roots of the step; displacements are counted from the unloaded body and '
        f"enlarged as every picture says.</p>{parts}"
    )


def _last(number: int, shown: list[int]) -> str:
    return " selected" if number == shown[-1] else ""


def _image(figure: Any, words: str) -> str:
    drawn = BytesIO()
    figure.savefig(drawn, format="png", dpi=_DPI)
    text = base64.b64encode(drawn.getvalue()).decode()
    return f'<figure><img src="data:image/png;base64,{text}" alt="{escape(words)}"></figure>'


def _certified(history: History, commands: Sequence[str]) -> str:
    lines = [f"<p>{escape(history.closing_line)}.</p>"]
    if history.complete:
        lines.append(
            "<p>It is proven that these are all histories of the steps as they are given: every step has no other "
            "roots, from wherever it starts. What happens between the ends of the steps is not part of it.</p>"
        )
    elif history.arithmetic == "fast":
        lines.append("<p>Nothing is proven: the result rests on floating-point arithmetic.</p>")
    else:
        lines.append(f"<p>The history is proven to be unique until step {history.unique_until}.</p>")
    widest = max((stage.largest_radius for stage in history.data.stages), default=0.0)
    size = max((float(np.max(np.abs(stage.start.offset), initial=0.0)) for stage in history.data.stages), default=0.0)
    searches = counted(len(history.data.stages), "search", "searches")
    lines.append(
        f"<p>{searches}; where slip is counted from is known within {widest:.1e}, for offsets up to {size:.3g}.</p>"
    )
    how = (
        "<code>enumsol history PROBLEM --steps STEPS --proof FILE</code>, then "
        "<code>enumsol verify PROBLEM FILE</code>."
    )
    lines.append(proof_facts(history.problem.fingerprint, commands, how))
    return "".join(lines)
