"""What the pages of reports share: filled templates, tables, Plotly's script, short texts of numbers."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from enumsol._version import find_version
from enumsol.errors import MissingDependencyError
from enumsol.model.statuses import ContactStatus

#: Scripts of pages with bodies, before those of one kind.
DRAWING = ("page.theme.js", "page.common.js", "page.body.js", "page.solid.js", "page.cards.js")
#: Of statuses, which pages keep as their places in this list.
STATUS_NAMES = [status.value for status in ContactStatus]


def filled_page(kind: str, scripts: Sequence[str], content: Mapping[str, Any], words: Mapping[str, str]) -> str:
    """The text of a page: the frame of all pages around what one kind has, with words, scripts and what these draw."""
    parts = files("enumsol.report")
    main = Template((parts / f"page.{kind}.html").read_text(encoding="utf-8")).substitute(words)
    own = {
        "main": main,
        "style": (parts / "page.css").read_text(encoding="utf-8"),
        "script": "\n".join((parts / name).read_text(encoding="utf-8") for name in scripts),
        # no "<" of a name may end the element
        "data": json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "version": escape(find_version()),
    }
    return Template((parts / "page.frame.html").read_text(encoding="utf-8")).substitute({**own, **words})


def status_codes(statuses: Iterable[ContactStatus]) -> str:
    """One digit per node."""
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


def span_words(values: Any) -> str:
    """The range of numbers as text."""
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def fact_list(facts: Iterable[tuple[str, str]]) -> str:
    """Names and values, which are escaped here."""
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts)


def proof_facts(fingerprint: str | None, commands: Sequence[str], otherwise: str) -> str:
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


def warning_list(sentence: str, items: Sequence[str]) -> str:
    """A warning with its reasons, of many the first."""
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
