"""The page of a RootSet: words and tables in HTML around the bodies that the script draws."""

from __future__ import annotations

from collections import Counter
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from enumsol.report.given import given_section, with_unit
from enumsol.report.parts import (
    DRAWING,
    fact_list,
    filled_page,
    packed_plotly,
    proof_facts,
    span_words,
    table_text,
    warning_list,
)
from enumsol.report.roots_content import roots_content
from enumsol.roots.root import summary
from enumsol.support.messages import counted, found_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from enumsol.fem import Scene
    from enumsol.roots.root_set import RootSet, Undecided

#: Rows of the tables of roots, continua and undecided parts.
_MOST_ROWS = 500


def roots_page(
    found: RootSet, title: str, units: tuple[str, str] | None, commands: Sequence[str], scene: Scene | None
) -> str:
    """The text of the page."""
    content = roots_content(found, scene) | {"units": units, "alpha": float(found.alpha)}
    turned = content["body"] is not None and "triangles" in content["body"]
    words = {
        "title": escape(title),
        "plotly": packed_plotly() if turned else "",
        "badge": "yes" if found.complete else "no",
        "completeness": escape(found.closing_line),
        "reasons": _open_parts(found),
        "facts": _root_facts(found, units),
        "given": given_section(scene, units),
        "answers": "".join(f"<li>{escape(line)}</li>" for line in _answers(found)),
        "alpha": escape(f"{float(found.alpha):.10g}"),
        "roots": _root_table(found),
        "families": _family_table(found),
        "undecided": _undecided_table(found),
        "certified": _what_is_certified(found, commands),
    }
    return filled_page("roots", (*DRAWING, "page.roots.js"), content, words)


def _open_parts(found: RootSet) -> str:
    if found.whole:
        return ""
    alike = Counter((item.reason, item.hint) for item in found.undecided)
    reasons = [] if found.stopped is None else [f"the search ended early: {found.stopped}"]
    reasons += [f"{counted(count, 'undecided part')}: {why} ({hint})" for (why, hint), count in alike.most_common()]
    return warning_list(
        "This result is not complete. Every root shown is a solution, but there may be more. Why:", reasons
    )


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
    if found.mirror_images is not None:
        lines += [f"{line[0].upper()}{line[1:]}." for line in found.mirror_images.notes(complete=found.complete)]
    return lines + [f"Note: {line}." for line in found.notes]


def _root_facts(found: RootSet, units: tuple[str, str] | None) -> str:
    alpha = f"{float(found.alpha):.10g}"
    if not isinstance(found.alpha, float):
        alpha += f", which is {found.alpha} exactly"
    facts = [("alpha", alpha), ("contact nodes", str(len(found.node_ids)))]
    if len(found):
        problem = found[0].problem
        F = problem.friction_at(found.alpha)
        friction = span_words(F) if F.ndim == 1 else f"{span_words(F[:, 0])} along t1, {span_words(F[:, 1])} along t2"
        facts += [
            ("degrees of freedom", f"{problem.n:,}"),
            ("friction", friction),
            ("load", with_unit(f"max |f| = {np.max(np.abs(problem.load_at(found.alpha))):.4g}", units, 1, 0)),
            ("gap", with_unit(span_words(problem.gap), units, 0, 1)),
        ]
    facts += [("arithmetic", found.arithmetic), ("searched", counted(found.stats.nodes, "node") + " of the tree")]
    return fact_list(facts)


def _root_table(found: RootSet) -> str:
    if not len(found):
        return "<p>No isolated solution was found.</p>"
    mirrored = found.mirror_images
    heads = ["root", "index", "regular", "margin", "max lambda_n", "statuses, node by node"]
    rows = []
    for k, root in enumerate(found[:_MOST_ROWS]):
        cells = [str(k), _signed(root.index), "yes" if root.regular else "no", f"{root.margin:.2e}"]
        cells += [f"{np.max(root.lambda_n):.6g}"] + ([] if mirrored is None else [mirrored.words(k)])
        rows.append((f' data-root="{k}" tabindex="0"', [*cells, summary(root.statuses)]))
    if mirrored is not None:
        heads.insert(5, "mirror image")
    return table_text("All roots", heads, rows) + _more(len(found), "roots")


def _family_table(found: RootSet) -> str:
    if not found.families:
        return ""
    rows = [
        ("", [
            str(k), str(family.dimension), _signed(family.index), str(len(family.polytopes)), str(len(family.vertices)),
            f"{np.min(family.vertices[..., 0]):.6g} to {np.max(family.vertices[..., 0]):.6g}",
            "; ".join(summary(part.statuses) for part in family.polytopes[:6]),
        ])
        for k, family in enumerate(found.families[:_MOST_ROWS])
    ]  # fmt: skip
    heads = ("continuum", "dimension", "index", "polytopes", "vertices", "lambda_n", "statuses, node by node")
    words = "<p>Connected sets of infinitely many solutions. They are not drawn.</p>"
    table = table_text("Continua", heads, rows) + _more(len(found.families), "continua")
    return f"<section><h2>Continua</h2>{words}{table}</section>"


def _undecided_table(found: RootSet) -> str:
    if not found.undecided:
        return ""
    rows = [("", _undecided_cells(k, item)) for k, item in enumerate(found.undecided[:_MOST_ROWS])]
    heads = (
        "part",
        "what is known of the nodes",
        "leaves",
        "max lambda_n of a root in it",
        "why it is open",
        "what may help",
    )
    words = "<p>Parts of the search without an answer: each may hold solutions or none.</p>"
    more = _more(len(found.undecided), "parts")
    table = table_text("Undecided parts", heads, rows)
    return f'<section id="undecided"><h2>Undecided</h2>{words}{table}{more}</section>'


def _undecided_cells(k: int, item: Undecided) -> list[str]:
    bounds = "not known"
    if item.bounds is not None:
        low, high = np.max(item.bounds.lambda_n, axis=0)
        bounds = f"{low:.5g} to {high:.5g}"
    return [str(k), summary(item.statuses), str(item.leaves), bounds, item.reason, item.hint]


def _more(count: int, what: str) -> str:
    return f"<p>and {count - _MOST_ROWS} more {what}</p>" if count > _MOST_ROWS else ""


def _signed(index: int | None) -> str:
    return "unknown" if index is None else f"{index:+d}"


def _what_is_certified(found: RootSet, commands: Sequence[str]) -> str:
    about = {
        "problem": "the matrices A, the contact rows and f as they were given",
        "condensed": "the condensed problem, S and g as computed",
    }[found.certified_data]
    lines = [f"<p>{escape(found.closing_line)}.</p>"]
    if found.complete:
        lines.append(
            f"<p>It is proven that the problem has the listed solutions at this alpha, and no others. This is about "
            f"{about}.</p>"
        )
    elif found.arithmetic == "fast":
        lines.append("<p>Nothing is proven: the result rests on floating-point arithmetic.</p>")
    else:
        known = "The listed roots are proven. " if len(found) else ""
        lines.append(f"<p>{known}Nothing is claimed about solutions that are not listed.</p>")
    lines.append("<p>This page is a picture of the result and no proof; numbers are rounded.</p>")
    lines.append(
        proof_facts(
            found[0].problem.fingerprint if len(found) else None,
            commands,
            ""
            if found.arithmetic == "fast"
            else "<code>enumsol roots PROBLEM --alpha A --proof FILE</code>, then "
            "<code>enumsol verify PROBLEM FILE</code>; the proof's first record holds the same fingerprint.",
        )
    )
    return "".join(lines)
