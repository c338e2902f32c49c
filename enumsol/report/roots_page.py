"""The pages of a RootSet and of a history: words and tables in HTML around bodies and figures."""

from __future__ import annotations

import base64
from collections import Counter
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.loading.history_data import steps_table, tree_lines
from enumsol.model.shapes import body_moves, contact_forces
from enumsol.report import parts
from enumsol.report.parts import MOST_NUMBERS
from enumsol.roots.root import summary
from enumsol.roots.root_set import ABOUT_STABILITY
from enumsol.support.messages import counted, found_of, html_table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

    from enumsol.fem import Scene
    from enumsol.loading.history import History
    from enumsol.roots.root import Root
    from enumsol.roots.root_set import RootSet
    from enumsol.support.array_types import Floats

    #: Columns of a table by their headings: the cells, of the number of an item and the item.
    _Columns = dict[str, Callable[[int, Any], str]]

#: Rows of the tables of roots, continua and undecided parts.
_MOST_ROWS = 500


def roots_page(found: RootSet, heading: parts.Heading) -> str:
    """The text of the page."""
    content = roots_content(found, heading.scene) | {"units": heading.units, "alpha": float(found.alpha)}
    turned = content["body"] is not None and "triangles" in content["body"]
    more = "; the proof's first record holds the same fingerprint."
    incomplete = "This result is not complete. Every root shown is a solution, but there may be more. Why:"
    said = parts.Statement(
        "" if found.whole else incomplete,
        _reasons(found),
        _root_facts(found, heading.units),
        _answers(found),
        _what_is_certified(found),
        found[0].problem.fingerprint if len(found) else None,
        "" if found.arithmetic == "fast" else parts.proof_commands("roots", "--alpha A", more),
    )
    words = {
        "plotly": parts.packed_plotly() if turned else "",
        "alpha": escape(f"{float(found.alpha):.10g}"),
        "roots": _root_table(found),
        "families": _family_table(found),
        "undecided": _undecided_table(found),
    }
    return parts.filled_page("roots", found, heading, said, (*parts.DRAWING, "page.roots.js"), content, words)


def _reasons(found: RootSet) -> list[str]:
    alike = Counter((item.reason, item.hint) for item in found.undecided)
    reasons = [] if found.stopped is None else [f"the search ended early: {found.stopped}"]
    reasons += [f"{counted(count, 'undecided part')}: {why} ({hint})" for (why, hint), count in alike.most_common()]
    return reasons


def _answers(found: RootSet) -> list[str]:
    number = counted(len(found), "isolated solution")
    if found.families:
        number += f" and {counted(len(found.families), 'continuum', 'continua')} of solutions"
    if found.complete:
        lines = [f"The problem has {number} at this alpha, and no other."]
    elif found.whole:
        lines = [f"{number} found in floating-point arithmetic; nothing is proven."]
    else:
        lines = [f"{found_of(number, found.at_least)}."]
    total = found.index_sum
    note = "" if found.adds_up else " (not +1: something is missing or wrong)"
    lines.append(f"Sum of the indices: {'unknown' if total is None else f'{total:+d}'}{note}.")
    if found.verdicts is not None:
        lines.append(f"{ABOUT_STABILITY[0].upper()}{ABOUT_STABILITY[1:]}.")
    return lines + [f"Note: {line}." for line in found.notes]


def _root_facts(found: RootSet, units: tuple[str, str] | None) -> list[tuple[str, str]]:
    alpha = f"{float(found.alpha):.10g}"
    if not isinstance(found.alpha, float):
        alpha += f", which is {found.alpha} exactly"
    facts = [("alpha", alpha), ("contact nodes", str(len(found.node_ids)))]
    if len(found):
        problem = found[0].problem
        F = problem.friction_at(found.alpha)
        friction = (
            parts.span_words(F)
            if F.ndim == 1
            else f"{parts.span_words(F[:, 0])} along t1, {parts.span_words(F[:, 1])} along t2"
        )
        facts += [
            ("degrees of freedom", f"{problem.n:,}"),
            ("friction", friction),
            ("load", parts.with_unit(f"max |f| = {np.max(np.abs(problem.load_at(found.alpha))):.4g}", units, 1, 0)),
            ("gap", parts.with_unit(parts.span_words(problem.gap), units, 0, 1)),
        ]
    return [*facts, ("arithmetic", found.arithmetic), ("searched", counted(found.stats.nodes, "node") + " of the tree")]


def _root_table(found: RootSet) -> str:
    if not len(found):
        return "<p>No isolated solution was found.</p>"
    verdicts = found.verdicts
    stability: _Columns = {} if verdicts is None else {"stability": lambda k, _: verdicts[k].verdict}
    columns: _Columns = {
        "root": lambda k, _: str(k),
        "index": lambda _, root: _signed(root.index),
        **stability,
        "regular": lambda _, root: "yes" if root.regular else "no",
        "margin": lambda _, root: f"{root.margin:.2e}",
        "max lambda_n": lambda _, root: f"{np.max(root.lambda_n):.6g}",
        "statuses, node by node": lambda _, root: summary(root.statuses),
    }
    return _table("All roots", "roots", found, columns, ' data-root="{}" tabindex="0"')


def _family_table(found: RootSet) -> str:
    if not found.families:
        return ""
    columns: _Columns = {
        "continuum": lambda k, _: str(k),
        "dimension": lambda _, family: str(family.dimension),
        "index": lambda _, family: _signed(family.index),
        "polytopes": lambda _, family: str(len(family.polytopes)),
        "vertices": lambda _, family: str(len(family.vertices)),
        "lambda_n": lambda _, family: _span(family.vertices[..., 0], 6),
        "statuses, node by node": lambda _, family: "; ".join(summary(part.statuses) for part in family.polytopes[:6]),
    }
    words = "<p>Connected sets of infinitely many solutions. They are not drawn.</p>"
    table = _table("Continua", "continua", found.families, columns)
    return f"<section><h2>Continua</h2>{words}{table}</section>"


def _undecided_table(found: RootSet) -> str:
    if not found.undecided:
        return ""
    columns: _Columns = {
        "part": lambda k, _: str(k),
        "what is known of the nodes": lambda _, item: summary(item.statuses),
        "leaves": lambda _, item: str(item.leaves),
        "max lambda_n of a root in it": lambda _, item: (
            "not known" if item.bounds is None else _span(np.max(item.bounds.lambda_n, axis=0), 5)
        ),
        "why it is open": lambda _, item: item.reason,
        "what may help": lambda _, item: item.hint,
    }
    words = "<p>Parts of the search without an answer: each may hold solutions or none.</p>"
    table = _table("Undecided parts", "parts", found.undecided, columns)
    return f'<section id="undecided"><h2>Undecided</h2>{words}{table}</section>'


def _table(caption: str, what: str, items: Sequence[Any], columns: _Columns, kept: str = "") -> str:
    """A table of items, of many the first, with the attributes ``kept`` of their rows."""
    rows = [(kept.format(k), [of(k, item) for of in columns.values()]) for k, item in enumerate(items[:_MOST_ROWS])]
    more = f"<p>and {len(items) - _MOST_ROWS} more {what}</p>" if len(items) > _MOST_ROWS else ""
    return parts.table_text(caption, columns, rows) + more


def _span(values: Floats, digits: int) -> str:
    return f"{np.min(values):.{digits}g} to {np.max(values):.{digits}g}"


def _signed(index: int | None) -> str:
    return "unknown" if index is None else f"{index:+d}"


def _what_is_certified(found: RootSet) -> list[str]:
    if found.complete:
        known = (
            "It is proven that the problem has the listed solutions at this alpha, and no others. This is about "
            f"{parts.CERTIFIED_DATA[found.certified_data]}."
        )
    elif found.arithmetic == "fast":
        known = "Nothing is proven: the result rests on floating-point arithmetic."
    else:
        known = ("The listed roots are proven. " if len(found) else "") + (
            "Nothing is claimed about solutions that are not listed."
        )
    return [known, "This page is a picture of the result and no proof; numbers are rounded."]


# -- what the script draws ---------------------------------------------------------------------------------------------


def roots_content(found: RootSet, scene: Scene | None = None) -> dict[str, Any]:
    """Everything that the script needs: nodes, roots with their values, and the bodies that are drawn.

    Statuses are texts of one digit per node, places in ``statuses``. ``f`` and ``w`` are forces and displacements of
    the contact nodes: all normal ones, then those along each tangent.
    """
    p = len(found.node_ids)
    listed = found[: max(1, MOST_NUMBERS // (8 * p))]
    pictures, bodies = _pictures(listed, scene) if listed else (_picture(None, ""), [])
    bodies += [{}] * (len(listed) - len(bodies))
    verdicts = [{"stability": one.verdict} for one in found.verdicts or ()] or [{}] * len(listed)
    return {
        "nodes": [str(label) for label in found.node_ids],
        "statuses": parts.STATUS_NAMES,
        "tangents": listed[0].lambda_t[:1].size if listed else 1,
        "all": len(found),
        "roots": [_record(root) | verdicts[k] | bodies[k] for k, root in enumerate(listed)],
        **pictures,
    }


def _record(root: Root) -> dict[str, Any]:
    return {
        "index": root.index,
        "regular": root.regular,
        "margin": float(f"{root.margin:.3g}"),
        "statuses": parts.status_codes(root.statuses),
        "several": [i for i, holds in enumerate(root.active) if len(holds) > 1],
        "f": parts.short_list(np.concatenate([root.lambda_n, root.lambda_t.ravel(order="F")])),
        "w": parts.short_list(np.concatenate([root.u_n, root.u_t.ravel(order="F")])),
        "angles": None
        if root.slip_angle is None
        else [None if np.isnan(pair[0]) else parts.short_list(pair) for pair in root.slip_angle],
    }


def _pictures(roots: Sequence[Root], scene: Scene | None) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The body, or why there is none, and what moves it and acts on it by root; of many roots the first."""
    problem = roots[0].problem
    if problem.mesh is None:
        body, why = parts.bare_nodes(problem)
        still = [] if body is None else [{"u": [0] * (3 * problem.p), "forces": []}] * len(roots)
        return _picture(body, why), still
    body, nodes = parts.drawn_body(problem, len(roots) + 1, scene)
    count = parts.most_fields(*problem.mesh.points[nodes].shape) - 1
    if count < 1:
        return _picture(None, f"The mesh is too large to draw: its boundary alone has {len(nodes):,} nodes"), []
    stresses = parts.surface_stresses(problem, min(count, len(roots)))
    bodies = [
        {
            "u": parts.short_list(body_moves(root.problem, root.u, root.alpha)[nodes].ravel()),
            "forces": parts.vectors(contact_forces(problem, root.lambda_n, root.lambda_t), nodes),
            **({} if stresses is None else {"s": parts.short_list(stresses(root.u))}),
        }
        for root in roots[:count]
    ]
    some = f"The bodies of the first {count} roots are drawn: the page holds no more"
    return _picture(body, some if count < len(roots) else ""), bodies


def _picture(body: dict[str, Any] | None, why: str) -> dict[str, Any]:
    return {"body": body, "no_body": why}


# -- history page ------------------------------------------------------------------------------------------------------
# The page about a history: its steps, tree, figures, the bodies of every step, and what is certified.


def history_page(history: History, heading: parts.Heading) -> str:
    """The text of the page."""
    units = heading.units
    incomplete = (
        "This history is not complete. Every root shown is a solution of its step, but roots and histories may be "
        "missing. Why:"
    )
    said = parts.Statement(
        incomplete if history.reasons else "",
        history.reasons,
        _facts(history),
        (),
        _certified(history),
        history.problem.fingerprint,
        parts.proof_commands("history", "--steps STEPS", "."),
    )
    words = {
        "steps": parts.scrolling("Steps", html_table(*steps_table(history, units))),
        "tree": escape("\n".join(tree_lines(history, 1000))),
        "figures": _figures(history, units),
        "bodies": _bodies(history, units),
    }
    return parts.filled_page("history", history, heading, said, ("page.theme.js", "page.history.js"), {}, words)


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
