"""The pictures of docs/gallery.md, by running its scripts: python tools/draw_gallery.py."""

import contextlib
import re
from pathlib import Path

import matplotlib as mpl

DOCS = Path(__file__).parent.parent / "docs"


def main() -> None:
    """Write them to docs/pictures/."""
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    mpl.rcParams["savefig.dpi"] = 80
    with contextlib.chdir(DOCS / "pictures"):
        for script in re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
            exec(script, names)


if __name__ == "__main__":
    main()
