"""Words in messages and printed results, and their form in notebooks."""

from __future__ import annotations

import enum
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from html import escape

#: Categories of characters that control a terminal (also the direction of writing), or that have no picture.
_UNSEEN = frozenset(("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"))
#: Roots, branches and contact nodes that a printed result lists one by one; of more the first ones.
PRINTED = 20


class TextEnum(enum.StrEnum):
    """Base of enumerations whose members compare with their texts, and are printed as these: ``kind == "fold"``."""

    def __repr__(self) -> str:
        return repr(self.value)


def visible(text: object, keep: str = "") -> str:
    r"""A text without what a terminal obeys or does not show, as escapes such as ``\x1b``; ``keep`` may stay."""
    said = str(text)
    if said.isprintable():
        return said
    shown = (c if c in keep or unicodedata.category(c) not in _UNSEEN else ascii(c)[1:-1] for c in said)
    return "".join(shown)


def counted(number: int, singular: str, plural: str | None = None) -> str:
    """A number of things, as in "1 root" and "2 roots"."""
    return f"{number} {singular if number == 1 else plural or singular + 's'}"


def found_of(found: str, least: int) -> str:
    """Text on what an incomplete search found and on the number proven to exist: "2 roots found, at least 3 exist"."""
    bound = f", at least {least} {'exists' if least == 1 else 'exist'}" if least else ""  # zero is no bound
    return f"{found} found{bound}"


def listed(names: Iterable[object], suffix: str = "") -> str:
    """Names in a sentence, as in "a, b and c"; of many the first ones."""
    texts = [f"{name}{suffix}" for name in names]
    if len(texts) > 14:
        texts = [*texts[:12], f"{len(texts) - 12} more"]
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def aligned(rows: Sequence[Sequence[str]], left: int = 1, *, free: bool = False) -> list[str]:
    """Lines of a table: columns to the left, then others to the right; the last one is ``free`` if it is any text."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [f"{c:<{w}}" if k < left else f"{c:>{w}}" for k, (c, w) in enumerate(zip(row, widths, strict=True))]
        lines.append("  ".join([*cells[:-1], row[-1]] if free else cells))
    return lines


@contextmanager
def about(what: object, *kinds: type[Exception], made: type[Exception] | None = None) -> Iterator[None]:
    """A block whose errors of some kinds get what they are about before them, and become ``made`` if that is given."""
    try:
        yield
    except kinds as error:
        raise (made or type(error))(f"{what}: {error}") from error


def html_lines(lines: Iterable[str]) -> str:
    """Lines of text as HTML, a paragraph each."""
    return "".join(f"<p style='margin:2px 0'>{escape(line)}</p>" for line in lines)


def html_table(heads: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A table as HTML; what stands in it is escaped."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def shortened(text: str, most: int = 200) -> str:
    """A text of another package in one line, cut off where it is longer: some quote whole files."""
    line = " ".join(text.split())
    return line if len(line) <= most else line[: most - 3] + "..."
