"""Are the answers right at the extremes?

Every case ends as right, undecided with a reason, or wrong. Scales of stiffness and load, alpha, friction, material,
geometry, size, distances from bifurcations, samples exactly at transitions, gaps, thousands of roots (``cases.py``);
the parameter r of H, branch graphs and paths under the same conditions (``paths.py``); bodies with up to 500,000
degrees of freedom (``bodies.py``).

The verified answer is held against rational arithmetic (all selections one by one where p is at most 3), against known
counts, or against an equivalent problem: nodes and unknowns in reverse order, tangents turned, other units. Its proof
goes through the checker, and any warning counts as wrong (``judge.py``).

Read the counts by group in the notes; below them every case that stayed undecided, or is wrong, with its reason.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from itertools import islice
from typing import TYPE_CHECKING, Any

from extremes.bodies import BODIES, SMOKE_BODIES, bodies, body
from extremes.cases import GROUPS
from extremes.judge import RIGHT, UNDECIDED, WRONG, judge
from extremes.paths import PATH_GROUPS, judge_path
from shared.figures import BLUE, GREY, ORANGE, RED, panels

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from shared.results import Run

VERDICTS = (RIGHT, UNDECIDED, WRONG)
#: Group -> its cases and who judges them.
CASES = {group.__name__: (group, judge) for group in GROUPS} | {
    group.__name__: (group, judge_path) for group in PATH_GROUPS
}
#: The bodies, which are judged in processes of their own.
LARGE = "bodies"
#: First and last of the cases that a smoke run tries, where the first of a group would take seconds.
SMOKE_CASES = {"parameters": (8, 9)}


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--group", action="append", choices=(*CASES, LARGE), help="a group of cases; default: all")
    parser.add_argument("--body", type=int, help=argparse.SUPPRESS)  # how the study calls itself for one large body


def table(wanted: list[str], *, smoke: bool) -> list[dict[str, Any]]:
    """Rows of the wanted groups."""
    rows: list[dict[str, Any]] = []
    for name in wanted:
        if name == LARGE:
            rows += bodies(SMOKE_BODIES if smoke else BODIES)
        else:
            group, judged = CASES[name]
            chosen = SMOKE_CASES.get(name, (0, 1)) if smoke else (0, None)
            rows += [judged(case) for case in islice(group(), *chosen)]
    return rows


def conclusions(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Counts by group, what fast arithmetic makes of the cases, and why cases stayed open or were refused."""
    groups = list(dict.fromkeys(r["group"] for r in rows))
    for group in [*groups, "all"]:
        part = [r for r in rows if group in (r["group"], "all")]
        verdicts = Counter(r["verdict"] for r in part)
        fast = Counter(r["fast"].split(":")[0].split(" (")[0] for r in part if r["fast"])
        off = fast["off"]
        shown = ", ".join(f"{verdicts[v]} {v}" for v in VERDICTS)
        yield (
            f"{group}: {len(part)} cases, {shown}"
            + (f"; fast arithmetic off in {off} of {sum(fast.values())}" if fast else "")
            + f"; {sum(r['seconds'] for r in part):.0f} s"
        )
    refused = sum(r["reason"].startswith("refused") for r in rows)
    yield f"of the undecided {refused} were refused with a message before any search"
    for verdict in (UNDECIDED, WRONG):
        # one line per reason: alike cases differ in their figures only
        alike: dict[str, list[str]] = {}
        for r in rows:
            if r["verdict"] == verdict:
                alike.setdefault(r["reason"], []).append(f"{r['group']}: {r['case']}")
        if alike:
            yield f"{verdict}:"
        for reason, names in alike.items():
            yield f"  {' | '.join(names)}: {reason}"
    for r in rows:
        if r["group"] == "body":
            yield f"n = {r['n']}: {r['verdict']}; {r['reason']}"


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Shares of the verdicts by group, and the share of cases in which fast arithmetic is off."""
    groups = list(dict.fromkeys(r["group"] for r in rows))[::-1]
    figure, (left, right) = panels(1, 2, (9.5, 0.42 * len(groups) + 1.6), sharey=True, width_ratios=(2, 1))
    colours = dict(zip(VERDICTS, (BLUE, ORANGE, RED), strict=True))
    for y, group in enumerate(groups):
        part = [r for r in rows if r["group"] == group]
        start = 0.0
        for verdict, colour in colours.items():
            share = 100.0 * sum(r["verdict"] == verdict for r in part) / len(part)
            left.barh(y, share, left=start, color=colour, label=verdict if y == 0 else None)
            start += share
        judged = [r for r in part if r["fast"]]
        if judged:
            off = 100.0 * sum(r["fast"].startswith("off") for r in judged) / len(judged)
            right.barh(y, off, color=ORANGE)
        else:
            right.text(2, y, "not asked", va="center", fontsize=8, color=GREY)
    sizes = Counter(r["group"] for r in rows)
    left.set_yticks(range(len(groups)), [f"{group} ({sizes[group]})" for group in groups])
    left.set_xlabel("verified answers [% of cases]")
    right.set_xlabel("fast arithmetic off [% of cases]")
    for axis in (left, right):
        axis.set_xlim(0, 100)
        axis.set_ylim(-0.6, len(groups) - 0.4)
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=len(VERDICTS), frameon=False)
    return figure


def main(run: Run) -> None:
    if run.options.body is not None:
        print(json.dumps(body(run.options.body)))
        return
    rows = table(run.options.group or [*CASES, LARGE], smoke=run.smoke)
    name = "_".join(["extremes", *(run.options.group or ())])
    run.table(name, rows, *conclusions(rows))
    run.figure(name, draw(rows))
