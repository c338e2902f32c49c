"""The page about a history: its steps, tree, figures, the bodies of every step, and what is certified."""

from __future__ import annotations

import base64
from html import escape
from importlib.resources import files
from io import BytesIO
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol._version import find_version
from enumsol.errors import InvalidArgumentError
from enumsol.loading.history import History
from enumsol.loading.history_text import steps_table, tree_lines
from enumsol.support.arguments import file_path, instance_of
from enumsol.support.files import writing
from enumsol.support.messages import counted, html_table

if TYPE_CHECKING:
    import os

#: Lines of the tree, reasons, and steps whose bodies are drawn, at most; of more steps the last ones.
_TREE, _REASONS, _BODIES = 1000, 20, 24
_DPI = 96


def write_history_report(
    history: History, file: str | os.PathLike[str], *, title: str = "Histories of a contact problem"
) -> None:
    """Write a history as one HTML page that needs no network.

    The page has a table of the steps, the tree of the roots, figures of load, displacement and work of friction, the
    deformed bodies of all roots of a step that is chosen (with a mesh), and what is certified.

    Parameters
    ----------
    history : History
    file : str or path-like
        An existing file is replaced.
    title : str

    Raises
    ------
    InvalidArgumentError
        There can be no such file, or an argument is not of that form.
    MissingDependencyError
        matplotlib is not installed.
    OutputError
        There is no room for the file.

    Examples
    --------
    >>> import enumsol, pathlib, tempfile
    >>> from enumsol.report import write_history_report
    >>> history = enumsol.histories(enumsol.gallery.one_node_triangle(), [5, 4])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_history_report(history, f"{folder}/node.html", title="One node")
    ...     "complete: yes (proven)" in pathlib.Path(folder, "node.html").read_text()
    True
    """
    instance_of(history, History, "history")
    place = file_path(file, "file")
    page = _page(history, instance_of(title, str, "title"))
    with writing(place, "file"):
        place.write_text(page, encoding="utf-8")


def _page(history: History, title: str) -> str:
    parts = files("enumsol.report")
    words = {
        "title": escape(title),
        "style": (parts / "page.css").read_text(encoding="utf-8"),
        "badge": "yes" if history.complete else "no",
        "completeness": escape(history.completeness()),
        "reasons": _reasons(history),
        "facts": _facts(history),
        "steps": f'<div class="scroll">{html_table(*steps_table(history.data))}</div>',
        "tree": escape("\n".join(tree_lines(history.data, _TREE))),
        "figures": _figures(history),
        "bodies": _bodies(history),
        "certified": _certified(history),
        "version": escape(find_version()),
    }
    return Template((parts / "history_page.html").read_text(encoding="utf-8")).substitute(words)


def _reasons(history: History) -> str:
    if not history.reasons:
        return ""
    items = "".join(f"<li>{escape(reason)}</li>" for reason in history.reasons[:_REASONS])
    left = len(history.reasons) - _REASONS
    more = f"<li>and {left} more</li>" if left > 0 else ""
    return (
        '<div class="warning"><p>This history is not complete. Every root shown is a solution of its step, but roots '
        f"and histories may be missing. Why:</p><ul>{items}{more}</ul></div>"
    )


def _facts(history: History) -> str:
    problem = history.problem
    total = history.counts[-1]
    facts = (
        ("contact nodes", str(problem.p)),
        ("degrees of freedom", f"{problem.n:,}"),
        ("steps", str(len(history.steps))),
        ("histories", f"{total:,}" if total else "none reaches the last step"),
        ("branchings", str(len(history.branchings))),
        ("arithmetic", history.arithmetic),
        ("increments", "not halved" if history.refinement is None else str(history.refinement)),
    )
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts)


def _figures(history: History) -> str:
    pairs = (("displacement", "alpha"), ("step", "dissipated"), ("step", "lambda_n"), ("displacement", "lambda_t"))
    moves = any(step.alpha is not None for step in history.steps)
    return "".join(_image(history.plot(x, y)) for x, y in pairs if moves or y != "alpha")


def _bodies(history: History) -> str:
    from enumsol.roots.body_plots import draw_bodies  # matplotlib comes with the first picture

    shown = [number for number in range(1, len(history.steps) + 1) if history.nodes_of(number)][-_BODIES:]
    pictures = {}
    for number in shown:
        try:
            pictures[number] = _image(draw_bodies(history.roots(number)))
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


def _image(figure: Any) -> str:
    drawn = BytesIO()
    figure.savefig(drawn, format="png", dpi=_DPI)
    text = base64.b64encode(drawn.getvalue()).decode()
    return f'<figure><img src="data:image/png;base64,{text}" alt=""></figure>'


def _certified(history: History) -> str:
    lines = [f"<p>{escape(history.completeness())}.</p>"]
    if history.complete:
        lines.append(
            "<p>It is proven that these are all histories of the steps as they are given: every step has no other "
            "roots, from wherever it starts. What happens between the ends of the steps is not part of it.</p>"
        )
    elif history.arithmetic == "fast":
        lines.append("<p>Nothing is proven: floating-point numbers were believed.</p>")
    else:
        lines.append(f"<p>The history is proven to be unique until step {history.unique_until}.</p>")
    widest = max((stage.largest_radius for stage in history.data.stages), default=0.0)
    size = max((float(np.max(np.abs(stage.start.offset), initial=0.0)) for stage in history.data.stages), default=0.0)
    searches = counted(len(history.data.stages), "search", "searches")
    lines.append(
        f"<p>{searches}; where slip is counted from is known within {widest:.1e}, for offsets up to {size:.3g}.</p>"
        f"<p>Fingerprint of the problem (SHA-256 of its data): <code>{escape(history.problem.fingerprint)}</code></p>"
        "<p>To check it: <code>enumsol history PROBLEM --steps STEPS --proof FILE</code>, then "
        "<code>enumsol verify PROBLEM FILE</code>.</p>"
    )
    return "".join(lines)
