"""Pages of reports read back: the numbers in them, their elements and their text."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

from enumsol import write_report


def page_of(solutions, folder, **options):
    """The text of a page that is written into a folder."""
    write_report(solutions, folder / "page.html", **options)
    return (folder / "page.html").read_text(encoding="utf-8")


def text_of(page):
    """What is read on a page, or in the file of one, outside of scripts and styles."""
    return Reader(page.read_text(encoding="utf-8") if isinstance(page, Path) else page).text


def data_of(page):
    """The numbers that the script of a page, or of the file of one, draws."""
    page = page.read_text(encoding="utf-8") if isinstance(page, Path) else page
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


class Reader(HTMLParser):
    """Counts elements and keeps the text outside of scripts and styles."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.words, self._silent = [], [], False
        self.feed(page)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._silent = tag in ("script", "style")

    def handle_endtag(self, tag):
        self._silent = False

    def handle_data(self, data):
        if not self._silent:
            self.words.append(data)
