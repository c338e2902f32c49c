"""References to docs/theory.md and inside the documents: how they are written, and what they refer to.

`tests/test_docs.py` checks that each leads somewhere; the site makes a link of each (an extension of Sphinx).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

NUMBER = r"\d+(?:\.\d+)?"
_SECTIONS = rf"section {NUMBER}|sections {NUMBER}(?:(?:, | and | to |-){NUMBER})+"
_EQUATIONS = r"\(\d+\.\d+\)(?:(?:, | and | to )\(\d+\.\d+\))*"
_ITEM = rf"(?:{_SECTIONS}|{_EQUATIONS})"
THEORY_REFERENCE = re.compile(rf"theory, {_ITEM}(?:(?:, | and |; ){_ITEM})*")
OWN_REFERENCE = re.compile(rf"\b(?:{_SECTIONS})")
_OWN_ITEM = re.compile(rf"\b(?:{_SECTIONS})|{_EQUATIONS}")
_PAGE = re.compile(r"docs/(\w+)\.md")
#: The number of an equation in LaTeX.
TAG = r"\\tag\{(\d+\.\d+)\}"
#: The number of an equation in an indented block ends its line.
_LABEL = re.compile(r"\((\d+\.\d+)\)$", re.MULTILINE)
_HEADING = re.compile(rf"({NUMBER})\.? ")
#: Pages with numbered sections.
_NUMBERED = ("theory", "proof_format")


def headings(text: str) -> list[str]:
    """Numbers of the sections of a document, in order."""
    return re.findall(rf"^#+ ({NUMBER})\.? ", text, re.MULTILINE)


def labels(text: str) -> list[str]:
    """Numbers of the equations of a document, in order."""
    return [tag or label for tag, label in re.findall(rf"{TAG}|^    .*\((\d+\.\d+)\)$", text, re.MULTILINE)]


def places(text: str, page: str) -> Iterator[tuple[int, int, str, str]]:
    """References in a text of a page: begin, end, page and anchor of each number that is referred to."""
    text = re.sub(r"\s", " ", text)
    taken = []
    for reference in THEORY_REFERENCE.finditer(text):
        taken.append(reference.span())
        yield from _numbers(reference, "theory")
    if page in _NUMBERED:
        for reference in _OWN_ITEM.finditer(text):
            if not any(start <= reference.start() < end for start, end in taken):
                yield from _numbers(reference, page)


def _numbers(reference: re.Match[str], page: str) -> Iterator[tuple[int, int, str, str]]:
    for number in re.finditer(rf"\({NUMBER}\)|{NUMBER}", reference[0]):
        kind = "equation" if number[0].startswith("(") else "section"
        start = reference.start()
        yield start + number.start(), start + number.end(), page, f"{kind}-{number[0].strip('()')}"


def setup(app: Any) -> dict[str, bool]:
    """Make numbers of sections and equations anchors, and references to them links."""
    app.connect("doctree-read", _add_anchors)
    app.connect("doctree-resolved", _add_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _add_anchors(app: Any, document: Any) -> None:
    from docutils import nodes

    if app.env.docname not in _NUMBERED:
        return
    for section in document.findall(nodes.section):
        number = _HEADING.match(section.next_node(nodes.title).astext())
        if number:
            section["ids"].append(f"section-{number[1]}")
    for block in document.findall(nodes.literal_block):
        block["ids"] += [f"equation-{number}" for number in _LABEL.findall(block.astext())]
    for block in document.findall(nodes.math_block):
        block["ids"] += [f"equation-{number}" for number in re.findall(TAG, block.astext())]


def _add_links(app: Any, document: Any, page: str) -> None:
    from docutils import nodes

    def link(target: str, anchor: str, *inside: Any) -> Any:
        uri = app.builder.get_relative_uri(page, target) + (f"#{anchor}" if anchor else "")
        return nodes.reference("", "", *inside, internal=True, refuri=uri)

    for literal in list(document.findall(nodes.literal)):
        named = _PAGE.fullmatch(literal.astext())
        if named and named[1] in app.env.found_docs:
            literal.replace_self(link(named[1], "", literal.deepcopy()))
    for block in list(document.findall(lambda node: isinstance(node, nodes.TextElement))):
        if isinstance(block, (nodes.FixedTextElement, nodes.literal, nodes.math, nodes.reference, nodes.title)):
            continue
        _join_texts(block)
        for child in list(block.children):
            if isinstance(child, nodes.Text):
                parts, last = [], 0
                for start, end, target, anchor in places(child.astext(), page):
                    parts += [nodes.Text(child[last:start]), link(target, anchor, nodes.Text(child[start:end]))]
                    last = end
                if parts:
                    block.replace(child, [*parts, nodes.Text(child[last:])])


def _join_texts(block: Any) -> None:
    """Lines of a paragraph come one by one: make them one text, for references that go over a line."""
    from docutils import nodes

    joined: list[Any] = []
    for child in block.children:
        if joined and isinstance(child, nodes.Text) and isinstance(joined[-1], nodes.Text):
            joined[-1] = nodes.Text(joined[-1] + child)
        else:
            joined.append(child)
    block.children = []
    block.extend(joined)
