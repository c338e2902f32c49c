r"""An extension of Sphinx: the formulas of the documents as MathML, which browsers show without a script.

A formula in a line is `$...$`; a formula of its own stands between two lines `$$` and, if it has a number, ends in
`\tag{5.5}`.
"""

from __future__ import annotations

import re
from html import escape
from typing import Any

from references import TAG

_NUMBERED = re.compile(rf"(.*?)\s*{TAG}", re.DOTALL)


def setup(app: Any) -> dict[str, bool]:
    """Offer the renderer "mathml" to Sphinx, for `html_math_renderer`."""
    app.add_html_math_renderer("mathml", inline_renderers=(_visit_math, None), block_renderers=(_visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _visit_math(translator: Any, node: Any) -> None:
    from docutils import nodes

    translator.body.append(_mathml(node.astext(), node, display=False))
    raise nodes.SkipNode


def _visit_block(translator: Any, node: Any) -> None:
    from docutils import nodes

    numbered = _NUMBERED.fullmatch(node.astext().strip())
    formula, number = numbered.groups() if numbered else (node.astext(), "")
    wrapped = node.parent.get("ids") == node["ids"]  # by furo; an anchor is written once
    translator.body.append(translator.starttag({} if wrapped else node, "div", CLASS="math"))
    translator.body.append(_mathml(formula, node, display=True))
    if number:
        translator.body.append(f'<a class="eqno" href="#equation-{number}">({number})</a>')
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def _mathml(formula: str, node: Any, *, display: bool) -> str:
    """MathML of a formula; its LaTeX, with a warning, which ends the build, if that is not understood."""
    from math_core import LatexError, LatexToMathML
    from sphinx.util import logging

    try:
        return LatexToMathML(fancy_error=False).convert_with_local_state(formula, displaystyle=display)
    except LatexError as error:
        logging.getLogger(__name__).warning("formula %r: %s", formula, error, location=node)
        return escape(formula)
