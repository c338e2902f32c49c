"""Are the answers right at the extremes? Every case ends as right, undecided with a reason, or wrong.

Scales of stiffness and load, alpha, friction, material, geometry, size, the parameter r of H, distances from
bifurcations, samples exactly at transitions, gaps, thousands of roots, and branch graphs and paths under the same
conditions. The verified answer is held against rational arithmetic (all selections one by one where p is at most 3),
against known counts, or against an equivalent problem: nodes and unknowns in reverse order, tangents turned, other
units. Its proof goes through the checker, and any warning counts as wrong. Cases: _extremes_cases.py and
_extremes_paths.py, judgement: _extremes_judge.py. Bodies with up to 500,000 degrees of freedom run in processes of
their own, for their own peak memory.

Run: python studies/extremes.py [group ...]
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections import Counter
from functools import partial
from typing import TYPE_CHECKING, Any

from _extremes_cases import GROUPS
from _extremes_judge import RIGHT, UNDECIDED, WRONG, Case, Finding, guarded, judge, row
from _extremes_paths import PATH_GROUPS, judge_path
from _output import RESULTS, report

from enumsol import enumerate_roots, gallery, verify

if TYPE_CHECKING:
    from collections.abc import Iterator

VERDICTS = (RIGHT, UNDECIDED, WRONG)
#: Cells along both sides of the bodies, of which every tenth part of the bottom carries a contact node.
BODIES = (40, 160, 500)
CONTACT = 10


def many_roots() -> Iterator[Case]:
    """Thousands of roots: separate and coupled one-node triangles."""
    for p, coupling in ((6, 0.0), (7, 0.0), (8, 0.0), (6, 0.05), (7, 0.05)):
        name = f"chain of {p}, coupling {coupling:g}"
        yield Case("many roots", name, partial(gallery.chain, p, coupling), 5.0, "closed form", 3**p)


# -- bodies with many degrees of freedom -------------------------------------------------------------------------------


def bodies() -> list[dict[str, Any]]:
    """Rows of the large bodies, each from a process of its own."""
    rows = []
    for cells in BODIES:
        command = [sys.executable, __file__, "--body", str(cells)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            finding = Finding()
            finding.wrong(f"the process failed: {done.stderr.strip().splitlines()[-1:]}")
            rows.append(row("body", f"{cells} x {cells} cells", "closed form", finding, 0.0))
        else:
            rows.append(json.loads(done.stdout))
    return rows


def body(cells: int) -> dict[str, Any]:
    """One large body: seconds of every stage and the peak memory go into the case's name."""
    started, stages = time.process_time(), []

    def lap(name: str) -> None:
        stages.append((name, time.process_time()))

    def work() -> Finding:
        problem = gallery.clamped_block(cells, cells, contact=CONTACT)
        lap("build")
        finding = Finding(p=problem.p, n=problem.n)
        fast = enumerate_roots(problem, 1.0, "fast")
        lap("fast")
        roots = enumerate_roots(problem, 1.0)
        lap("verified")
        checked = verify(problem, roots.proof)
        lap("check")
        finding.roots = len(roots)
        finding.fast = "same" if [r.statuses for r in fast] == [r.statuses for r in roots] else f"off: {len(fast)}"
        for item in roots.undecided:
            finding.undecided(item.reason)
        if not checked.ok or checked.complete != roots.complete:
            finding.wrong("the checker refuses the proof")
        if roots.complete and len(roots) != 1:
            finding.wrong(f"{len(roots)} roots, known: 1")
        finding.reasons.append(f"certified: {roots.certified_data}")
        return finding

    finding = guarded(work)
    before, parts = started, []
    for name, at in stages:
        parts.append(f"{name} {at - before:.1f} s")
        before = at
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2.0**20
    finding.reasons.append(", ".join(parts) + f", peak {peak:.2f} GB")
    return row("body", f"{cells} x {cells} cells", "closed form", finding, time.process_time() - started)


# -- all of it ---------------------------------------------------------------------------------------------------------


def table(wanted: list[str]) -> list[dict[str, Any]]:
    """Rows of the wanted groups, by default of all."""
    rows: list[dict[str, Any]] = []
    for groups, judged in (((*GROUPS, many_roots), judge), (PATH_GROUPS, judge_path)):
        for group in groups:
            if not wanted or group.__name__ in wanted:
                rows += [judged(case) for case in group()]
    if not wanted or "bodies" in wanted:
        rows += bodies()
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
        # one line a reason: alike cases differ in their figures only
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


def draw(rows: list[dict[str, Any]]) -> None:
    """Shares of the verdicts by group, and the share of cases in which fast arithmetic is off."""
    from matplotlib.figure import Figure

    groups = list(dict.fromkeys(r["group"] for r in rows))[::-1]
    figure = Figure(figsize=(9.5, 0.42 * len(groups) + 1.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    colours = dict(zip(VERDICTS, ("#1f5fa8", "#d9a30d", "#c23b4b"), strict=True))
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
            right.barh(y, off, color="#d9730d")
        else:
            right.text(2, y, "not asked", va="center", fontsize=8, color="#8a8a8a")
    sizes = Counter(r["group"] for r in rows)
    left.set_yticks(range(len(groups)), [f"{group} ({sizes[group]})" for group in groups])
    left.set_xlabel("verified answers [% of cases]")
    right.set_xlabel("fast arithmetic off [% of cases]")
    for axis in (left, right):
        axis.set_xlim(0, 100)
        axis.set_ylim(-0.6, len(groups) - 0.4)
        axis.spines[["top", "right"]].set_visible(False)
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=len(VERDICTS), frameon=False)
    figure.savefig(RESULTS / "extremes.png", dpi=150)


def main() -> None:
    if sys.argv[1:2] == ["--body"]:
        print(json.dumps(body(int(sys.argv[2]))))
        return
    wanted = sys.argv[1:]
    rows = table(wanted)
    if wanted:
        print("\n".join(conclusions(rows)))
        return
    report("extremes", rows, *conclusions(rows))
    draw(rows)


if __name__ == "__main__":
    main()
