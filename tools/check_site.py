"""Whether a built site of the documents is whole: python tools/check_site.py SITE.

Its pages load nothing from the network, every formula is MathML, every link inside the site has its anchor, and every
public name is in the reference.
"""

from __future__ import annotations

import inspect
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import enumsol
from enumsol import fem, gallery

#: What of an element a browser loads without being asked.
LOADED = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src", "video": "src"}
#: Styles load this way.
IN_STYLES = re.compile(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')\s]+)")
#: LaTeX in a running text.
LATEX = re.compile(r"\$|\\[A-Za-z]+|\\[(\[]")
#: Elements whose text may look like LaTeX.
NOT_PROSE = {"code", "pre", "script", "style"}


class Page(HTMLParser):
    """What a page loads, its anchors and links, and LaTeX that was left in its texts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.latex: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        given = dict(attrs)
        if given.get("id"):
            self.anchors.add(str(given["id"]))
        value = given.get(LOADED.get(tag, ""))
        if value and not (tag == "link" and given.get("rel") in {"next", "prev", "canonical", "index", "search"}):
            self.loaded.append(value)
        if tag == "a":
            self.links.append(str(given.get("href") or ""))
        self.loaded += IN_STYLES.findall(given.get("style") or "")
        if tag in NOT_PROSE:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Note the end of an element."""
        if tag in self._open:
            self._open.remove(tag)

    def handle_data(self, data: str) -> None:
        """Note a text."""
        if "style" in self._open:
            self.loaded += IN_STYLES.findall(data)
        elif not self._open and LATEX.search(data):
            self.latex.append(" ".join(data.split()))


def public_names() -> list[str]:
    """Full names of what a user may call, but for modules."""
    homes = (enumsol, fem, gallery)
    names = [(home, name) for home in homes for name in home.__all__ if not name.startswith("__")]
    return [f"{home.__name__}.{name}" for home, name in names if not inspect.ismodule(getattr(home, name))]


def broken_links(file: Path, pages: dict[Path, Page]) -> list[str]:
    """Links of a page to anchors that a page of the site does not have."""
    broken = []
    for link in sorted(set(pages[file].links)):
        to, anchor = urldefrag(unquote(link))
        target = pages.get((file.parent / to).resolve() if to else file)
        if anchor and target and anchor not in target.anchors:
            broken.append(link)
    return broken


def complaints(site: Path) -> list[str]:
    """What is wrong with the site, a line each."""
    pages = {file.resolve(): Page(file.read_text(encoding="utf-8")) for file in sorted(site.rglob("*.html"))}
    found, anchors = [], set()
    for file, page in pages.items():
        name = file.relative_to(site.resolve())
        anchors |= page.anchors
        loaded = [item for item in page.loaded if re.match(r"(?:https?:)?//", item)]
        found += [f"{name} loads {item}" for item in loaded]
        found += [f"{name} has a formula that is not rendered: {text}" for text in page.latex]
        found += [f"{name} has a link to {link}, which is not there" for link in broken_links(file, pages)]
    for file in sorted(site.rglob("*.css")):
        loaded = IN_STYLES.findall(file.read_text(encoding="utf-8"))
        found += [f"{file.relative_to(site)} loads {item}" for item in loaded]
    return found + [f"{name} is not in the reference" for name in public_names() if name not in anchors]


def main() -> int:
    site = Path(sys.argv[1])
    found = complaints(site)
    pages = len(list(site.rglob("*.html")))
    print("\n".join(found) or f"{pages} pages, nothing from the network, no formula left in LaTeX")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
