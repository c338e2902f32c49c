"""Pages of reports read back: the numbers in them, their elements and their text."""

import json
import re
from html.parser import HTMLParser


def data_of(page):
    """The numbers that the page's script draws."""
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
