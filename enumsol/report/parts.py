"""The frame of all pages of reports, with the problem as given and what is certified; tables and short texts."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from enumsol._version import find_version
from enumsol.errors import MissingDependencyError
from enumsol.model.statuses import ContactStatus

if TYPE_CHECKING:
    from enumsol.branches import BranchGraph
    from enumsol.fem import Scene
    from enumsol.loading.history import History
    from enumsol.roots.root_set import RootSet
    from enumsol.support.array_types import Floats

#: Scripts of pages with bodies, before those of one kind.
DRAWING = ("page.theme.js", "page.common.js", "page.body.js", "page.solid.js", "page.cards.js")
#: Of statuses, which pages keep as their places in this list.
STATUS_NAMES = [status.value for status in ContactStatus]


#: What is certified about a problem, by the data that the bounds belong to.
CERTIFIED_DATA = {
    "problem": "the matrices A, the contact rows and f as they were given",
    "condensed": "the condensed problem, S and g as computed",
}


class Heading(NamedTuple):
    """Arguments of `write_report` about any page: title, units, commands that check the proof, and the scene."""

    title: str
    units: tuple[str, str] | None
    commands: Sequence[str]
    scene: Scene | None


class Statement(NamedTuple):
    """Sentences of a page about its solutions: why they are incomplete, facts, answers, and what is certified.

    Attributes
    ----------
    incomplete, reasons : a sentence that the solutions are incomplete, empty where they are not, and why
    facts : names and values
    answers : sentences
    certified : paragraphs in HTML, without the solutions' closing line
    fingerprint : of the problem
    check : how to check the proof without commands of the user's, in HTML
    """

    incomplete: str
    reasons: Sequence[str]
    facts: Iterable[tuple[str, str]]
    answers: Iterable[str]
    certified: Iterable[str]
    fingerprint: str | None
    check: str


def proof_commands(command: str, place: str, more: str) -> str:
    """Commands that write a proof and check it, in HTML."""
    steps = (f"enumsol {command} PROBLEM {place} --proof FILE", "enumsol verify PROBLEM FILE")
    return ", then ".join(f"<code>{step}</code>" for step in steps) + more


def filled_page(
    kind: str,
    solutions: BranchGraph | RootSet | History,
    heading: Heading,
    said: Statement,
    scripts: Sequence[str],
    content: Mapping[str, Any],
    words: Mapping[str, str],
) -> str:
    """The text of a page: the frame of all pages around what one kind has, with words, scripts and what these draw."""
    certified = "".join(f"<p>{line}</p>" for line in (f"{escape(solutions.closing_line)}.", *said.certified))
    frame = {
        "title": escape(heading.title),
        "badge": "yes" if solutions.complete else "no",
        "completeness": escape(solutions.closing_line),
        "reasons": _warning_list(said.incomplete, said.reasons),
        "facts": fact_list(said.facts),
        "answers": "".join(f"<li>{escape(line)}</li>" for line in said.answers),
        "given": given_section(heading.scene, heading.units),
        "certified": certified + _proof_facts(said.fingerprint, heading.commands, said.check),
        "main": Template(_kept(f"page.{kind}.html")).substitute(words),
        "style": _kept("page.css"),
        "script": "\n".join(map(_kept, scripts)),
        # no "<" of a name may end the element
        "data": json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "version": escape(find_version()),
    }
    return Template(_kept("page.frame.html")).substitute({"plotly": "", **words, **frame})


def _kept(name: str) -> str:
    """A file of this package."""
    return (files("enumsol.report") / name).read_text(encoding="utf-8")


def status_codes(statuses: Iterable[ContactStatus]) -> str:
    """Statuses as a text of one digit per node."""
    return "".join(str(STATUS_NAMES.index(status.value)) for status in statuses)


def packed_plotly() -> str:
    """Plotly's script, compressed, in base64.

    Raises
    ------
    MissingDependencyError
        plotly is not installed.
    """
    script = MissingDependencyError.imported("plotly.offline", "reports", "report").get_plotlyjs()
    return base64.b64encode(gzip.compress(script.encode(), 9, mtime=0)).decode()


def span_words(values: Floats) -> str:
    """The range of numbers as text."""
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def fact_list(facts: Iterable[tuple[str, str]]) -> str:
    """Names and values, which are escaped here."""
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts)


def _proof_facts(fingerprint: str | None, commands: Sequence[str], otherwise: str) -> str:
    """The problem's fingerprint, and how to check the proof: by the commands given, or by words in HTML, if any."""
    lines = ""
    if fingerprint is not None:
        lines = f"<p>Fingerprint of the problem (SHA-256 of its data): <code>{escape(fingerprint)}</code></p>"
    if commands:
        shell = escape("\n".join(commands))
        lines += f"<p>To check it, with the problem and the proof at hand:</p><pre>{shell}</pre>"
    elif otherwise:
        lines += f"<p>To check it: {otherwise}</p>"
    return lines


def _warning_list(sentence: str, items: Sequence[str]) -> str:
    """A warning with its reasons, of many the first; empty without a sentence."""
    if not sentence:
        return ""
    lines = "".join(f"<li>{escape(item)}</li>" for item in items[:20])
    more = f"<li>and {len(items) - 20} more</li>" if len(items) > 20 else ""
    return f'<div class="warning" id="incomplete"><p>{escape(sentence)}</p><ul>{lines}{more}</ul></div>'


def table_text(caption: str, heads: Iterable[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """A table with a caption for screen readers; a row is its attributes and its cells, which are escaped here."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    body = "".join(
        f'<tr{kept}><th scope="row">{escape(cells[0])}</th>'
        + "".join(f"<td>{escape(c)}</td>" for c in cells[1:])
        + "</tr>"
        for kept, cells in rows
    )
    return scrolling(
        caption,
        f"<table><caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>",
    )


def scrolling(caption: str, table: str) -> str:
    """A box with a table in it that can be scrolled, by the keyboard too."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}">{table}</div>'


# -- the problem as its user gave it --------------------------------------------------------------------------------

#: Powers of force and of length in the unit of every option of `enumsol.fem.mesh_problem` that has one.
_POWERS = {
    **dict.fromkeys(("young", "load", "load_slope", "pressure", "pressure_slope"), (1, -2)),
    **dict.fromkeys(("spring", "body_force", "body_force_slope"), (1, -3)),
    **dict.fromkeys(("force", "force_slope"), (1, 0)),
    **dict.fromkeys(("moment", "moment_slope"), (1, 1)),
    "node_spring": (1, -1),
    **dict.fromkeys(
        ("thickness", "displacement", "displacement_slope", "reference", "gap", "obstacle", "max_rigid_displacement"),
        (0, 1),
    ),
}
#: Options that mean nothing in 3D.
_PLANE = ("plane", "thickness")
_RAISED = {1: "", 2: "\N{SUPERSCRIPT TWO}", 3: "\N{SUPERSCRIPT THREE}"}


def unit_text(units: tuple[str, str] | None, force: int, length: int) -> str:
    """The unit of a quantity, as in "N/mm²": powers of force, 0 or 1, and of length."""
    if units is None:
        return ""
    if length > 0:
        return f"{units[0]} {units[1]}" if force else units[1] + _RAISED[length]
    return units[0] if length == 0 else f"{units[0]}/{units[1]}{_RAISED[-length]}"


def with_unit(text: str, units: tuple[str, str] | None, force: int, length: int) -> str:
    """A number as text, with its unit if units are known."""
    return f"{text} {unit_text(units, force, length)}".rstrip()


def given_section(scene: Scene | None, units: tuple[str, str] | None) -> str:
    """A section of the page with the options of a scene and what they make; empty without one."""
    if scene is None:
        return ""
    rows = [
        ("", (name, _said(value), unit_text(units, *_POWERS[name]) if name in _POWERS else ""))
        for name, value in vars(scene.options).items()
        if value is not None and not (np.ndim(value) == 1 and len(value) == 0)
        if scene.dimension == 2 or name not in _PLANE
    ]
    about = fact_list((title, "; ".join(lines)) for title, lines in scene.sections.items() if lines)
    words = "" if units is not None else "<p>Numbers are in the user's own consistent units.</p>"
    table = table_text("The options of the problem", ("option", "as given", "unit"), rows)
    return (
        f'<section id="given"><h2>The problem as it was given</h2>{words}{table}'
        f'<h3>What this makes of the mesh</h3><dl class="facts">{about}</dl></section>'
    )


def _said(value: object) -> str:
    """The value of an option, in words."""
    if isinstance(value, Mapping):
        return "; ".join(f"{part}: {_said(own)}" for part, own in value.items())
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(_said(own) for own in value)
    return str(value) if isinstance(value, str) or value is None else f"{float(cast('float', value)):.10g}"
