"""Table, conclusions and figure, from what the cases took before and now."""

from __future__ import annotations

import statistics

from requirements.cases import LIBRARIES
from shared.figures import BLUE, GREY, panels


def merged(now, before):
    """One row per case; before is a dash where there was nothing measured."""
    for name, case in now["cases"].items():
        old = before["cases"].get(name, {}) if before else {}
        dropped = [library for library in old.get("libraries", ()) if library not in case["libraries"]]
        yield {
            "case": name,
            **{key: case.get(key, "-") for key in ("n", "p", "all selections")},
            **both(("nodes", "QPs", "selections solved"), old, case),
            **{key: case.get(key, "-") for key in ("by balls", "by rationals", "complete")},
            **both(("modules", "import s", "run s", "wall s", "peak MB"), old, case),
            "libraries": " ".join(case["libraries"]),
            "no longer loaded": " ".join(dropped) or "-",
        }


def both(keys, old, new):
    """Columns before and now."""
    pairs = ((" before", old), ("", new))
    return {f"{key}{when}": source.get(key, "-") for key in keys for when, source in pairs}


#: What is drawn, the label of its axis, and the ticks.
PANELS = (
    ("run s", "process time of the whole run [s]", (0.03, 0.1, 0.3, 1, 3)),
    ("peak MB", "peak memory [MB]", (10, 30, 100, 300, 1000)),
)


def draw(rows):
    """Process time and peak memory of every case, before (grey) and now (blue)."""
    figure, axes = panels(1, 2, (10.5, 6.2), sharey=True)
    places = range(len(rows))[::-1]
    for axis, (key, label, ticks) in zip(axes, PANELS, strict=True):
        for place, row in zip(places, rows, strict=True):
            old, new = row[f"{key} before"], row[key]
            if old != "-":
                axis.plot([old, new], [place, place], color="#d0d0d0", linewidth=2, zorder=1)
                axis.plot(old, place, "o", color=GREY, markersize=8, label="before" if place == 0 else None)
            axis.plot(new, place, "o", color=BLUE, markersize=4.5, label="now" if place == 0 else None)
        axis.set_xscale("log")
        axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_xticks([], minor=True)
        axis.set_xlabel(label)
        axis.tick_params(length=0)
        axis.spines[["left"]].set_visible(False)
    axes[0].set_yticks(list(places), [row["case"] for row in rows])
    axes[1].legend(frameon=False, loc="lower right")
    return figure


def conclusions(rows, now, before):
    """Notes below the table, all from the data."""
    case = {row["case"]: row for row in rows}
    start, large, small = case["import enumsol"], case["body, verified"], case["one node"]
    spread = statistics.median(source["spread"] for source in now["cases"].values())
    yield (
        f"{now['rounds']} rounds; the process times of one case differ by {100 * spread:.0f} % (median over the "
        "cases): smaller differences between before and now mean nothing"
    )
    yield (
        f"import enumsol: {start['import s']:.2g} s, {start['peak MB']:.0f} MB, {start['modules']} modules, "
        f"libraries: {start['libraries'] or 'none'}"
    )
    if before:
        change = small["run s"] / small["run s before"] - 1
        yield (
            f"  before ({before['label']}): {start['import s before']:.2g} s, {start['peak MB before']:.0f} MB, "
            f"{start['modules before']} modules. numpy and scipy are loaded when a problem is made: the whole run of "
            f"one node takes {small['run s']:.2f} s, before {small['run s before']:.2f} s ({100 * change:+.0f} %)"
        )
    dense = 8.0 * large["n"] ** 2 / 2**20
    for name in ("body, fast", "body, verified"):
        yield (
            f"{name}, n = {large['n']}, p = {large['p']}: peak {case[name]['peak MB']:.0f} MB"
            + (f", before {case[name]['peak MB before']:.0f} MB" if before else "")
            + f"; one node has {small['peak MB']:.0f} MB, a dense A alone {dense:.0f} MB"
        )
    rational = [row["case"] for row in rows if row["by rationals"] not in ("-", 0)]
    flint = [row["case"] for row in rows if "flint" in row["libraries"].split()]
    yield f"cases with selections decided in rationals: {', '.join(rational) or 'none'}"
    yield f"cases that load rational arithmetic: {', '.join(flint) or 'none'}"
    unused = [name for name in LIBRARIES if not any(name in row["libraries"].split() for row in rows)]
    yield f"loaded by no case: {', '.join(unused)}"
    if before:
        pair = (now["numpy s"], before["numpy s"])
        verdict = "times compare" if max(pair) < 1.25 * min(pair) else "times before and now do not compare"
        if not before.get("alone"):
            yield "before, the study had some 30 modules of Python's own loaded, which are missing in its counts"
        yield f"import numpy: {pair[0]:.3f} s, in the process that measured before {pair[1]:.3f} s: {verdict}"
