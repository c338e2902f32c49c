"""The page about a history: its steps, tree, figures, the bodies of every step, and what is certified."""

from __future__ import annotations

import base64
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.loading.history_data import steps_table, tree_lines
from enumsol.report.parts import Heading, Statement, filled_page, proof_commands, scrolling
from enumsol.support.messages import counted, html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from enumsol.loading.history import History


def history_page(history: History, heading: Heading) -> str:
    """The text of the page."""
    units = heading.units
    incomplete = (
        "This history is not complete. Every root shown is a solution of its step, but roots and histories may be "
        "missing. Why:"
    )
    said = Statement(
        incomplete if history.reasons else "",
        history.reasons,
        _facts(history),
        (),
        _certified(history),
        history.problem.fingerprint,
        proof_commands("history", "--steps STEPS", "."),
    )
    words = {
        "steps": scrolling("Steps", html_table(*steps_table(history, units))),
        "tree": escape("\n".join(tree_lines(history, 1000))),
        "figures": _figures(history, units),
        "bodies": _bodies(history, units),
    }
    return filled_page("history", history, heading, said, ("page.theme.js", "page.history.js"), {}, words)


def _facts(history: History) -> list[tuple[str, str]]:
    problem, total = history.problem, history.counts[-1]
    return [
        ("contact nodes", str(problem.p)),
        ("degrees of freedom", f"{problem.n:,}"),
        ("steps", str(len(history.steps))),
        ("histories", f"{total:,}{'' if history.complete else ' found'}" if total else "none reaches the last step"),
        ("branchings", str(len(history.branchings))),
        ("arithmetic", history.arithmetic),
        ("increments", "not halved" if history.refinement is None else str(history.refinement)),
    ]


def _figures(history: History, units: tuple[str, str] | None) -> str:
    pairs = (("displacement", "alpha"), ("step", "dissipated"), ("step", "lambda_n"), ("displacement", "lambda_t"))
    moves = any(step.alpha is not None for step in history.steps)
    return "".join(
        _image(history.plot(x, y, units=units), f"{y} against {x}") for x, y in pairs if moves or y != "alpha"
    )


def _bodies(history: History, units: tuple[str, str] | None) -> str:
    from enumsol.roots.body_plots import draw_bodies  # matplotlib comes with the first picture

    # of many steps the last ones: a picture takes some ten thousand bytes
    shown = [number for number in range(1, len(history.steps) + 1) if history.nodes_of(number)][-24:]
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


def _image(figure: Figure, words: str) -> str:
    drawn = BytesIO()
    figure.savefig(drawn, format="png", dpi=96)
    text = base64.b64encode(drawn.getvalue()).decode()
    return f'<figure><img src="data:image/png;base64,{text}" alt="{escape(words)}"></figure>'


def _certified(history: History) -> list[str]:
    if history.complete:
        known = (
            "It is proven that these are all histories of the steps as they are given: every step has no other roots, "
            "from wherever it starts. What happens between the ends of the steps is not part of it."
        )
    elif history.arithmetic == "fast":
        known = "Nothing is proven: the result rests on floating-point arithmetic."
    else:
        known = f"The history is proven to be unique until step {history.unique_until}."
    stages = history.all_stages
    widest = max((stage.largest_radius for stage in stages), default=0.0)
    size = max((float(np.max(np.abs(stage.start.offset), initial=0.0)) for stage in stages), default=0.0)
    searches = counted(len(stages), "search", "searches")
    return [
        known,
        f"{searches}; where slip is counted from is known within {widest:.1e}, for offsets up to {size:.3g}.",
    ]
