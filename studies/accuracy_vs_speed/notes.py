"""Summary, conclusions and figure of part 1 of accuracy_vs_speed.

Well below the tolerance of fast arithmetic the share of wrong answers is that of folds and continua on one of their
sides or both: beside a transition there is one root, and to misjudge its status is not counted as wrong.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from _output import RESULTS
from _trade_enumeration import EXACT, FAST, LARGE, SETTINGS, SINGLE, SINGLE_WIDE, SWEEP, VERIFIED
from _trade_paths import BLUE, GREEN, GREY, ORANGE, RED
from _trade_problems import DISTANCES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from typing import Any

    from _trade_enumeration import Measurement, Setting

#: Where roots are well separated: errors of forces are compared from this distance on.
SEPARATED = 1e-3
FORMS = {FAST: "-o", SINGLE: "-s", SINGLE_WIDE: "-^", VERIFIED: "-D", LARGE: "--D"}
COLOURS = {FAST: BLUE, SINGLE: RED, SINGLE_WIDE: ORANGE, VERIFIED: GREEN, LARGE: GREEN}


def overview(measured: Sequence[Measurement]) -> list[dict[str, Any]]:
    """One row a setting: from which distance on it is right and leaves nothing open, and what it costs."""
    rows = []
    for setting in SETTINGS:
        items = [item for item in measured if item.setting is setting]
        near = [item for item in items if item.case.degeneracy == "alpha" and item.case.distance]
        on = [item for item in items if item.case.degeneracy == "alpha" and not item.case.distance]
        nodes = [item for item in items if item.case.degeneracy == "two nodes"]
        apart = [item for item in near if item.case.distance >= SEPARATED]
        rows.append(
            {
                "setting": setting.name,
                "right from": _from(near, lambda item: item.wrong),
                "decided from": _from(near, lambda item: item.open),
                "near: wrong %": _share(near, lambda item: item.wrong),
                "near: open %": _share(near, lambda item: item.open),
                "on: wrong %": _share(on, lambda item: item.wrong),
                "on: open %": _share(on, lambda item: item.open),
                "two nodes: wrong %": _share(nodes, lambda item: item.wrong),
                "two nodes: open %": _share(nodes, lambda item: item.open),
                "force error": max(item.comparison.error for item in apart),
                "time ratio": _time(items),
            }
        )
    return rows


def _from(items: Sequence[Measurement], bad: Callable[[Measurement], bool]) -> float | str:
    """The least distance from which on nothing is bad."""
    worst = max((item.case.distance for item in items if bad(item)), default=None)
    good = [item.case.distance for item in items if worst is None or item.case.distance > worst]
    return float(min(good)) if good else "never"


def _text(distance: float | str) -> str:
    return distance if isinstance(distance, str) else f"{distance:.0e}"


def _share(items: Sequence[Measurement], bad: Callable[[Measurement], bool]) -> float:
    return 100.0 * sum(map(bad, items)) / len(items)


def _time(items: Sequence[Measurement]) -> float:
    return float(np.nanmedian([item.time_ratio for item in items]))


# -- conclusions ---------------------------------------------------------------------------------------------------


def conclusions(
    rows: Sequence[dict[str, Any]], measured: Sequence[Measurement], checks: dict[str, tuple[int, int]]
) -> Iterator[str]:
    fast = [item for item in measured if item.setting is FAST]
    beside = sum(item.case.degeneracy == "alpha" and item.case.distance > 0 for item in fast)
    on = sum(item.case.degeneracy == "alpha" and item.case.distance == 0 for item in fast)
    scenes = {item.case.scene.name for item in fast if item.case.degeneracy == "alpha"}
    yield (
        f"enumeration: {len(fast)} problems ({beside} beside a degeneracy and {on} exactly on one, on {len(scenes)} "
        f"paths; {len(fast) - beside - on} with two close nodes); time 1: {FAST.name}"
    )
    yield "; ".join(
        f"exact answers compared with {what}: {total}, {differ} differ"
        for what, (total, differ) in zip(("all 4^p selections", "branch graphs"), checks.values(), strict=True)
    )
    lines = {row["setting"]: row for row in overview(measured)}
    for setting in (VERIFIED, LARGE):
        items = [item for item in measured if item.setting is setting]
        yield (
            f"{setting.name}: {sum(item.wrong for item in items)} wrong answers, "
            f"{sum(item.claimed and item.wrong for item in items)} wrong claims to be complete, "
            f"{sum(item.comparison.outside for item in items)} roots outside their bounds; open {_opened(items)}; "
            f"time {_spread(items)}"
        )
    yield f"{LARGE.name}: leaves nothing open from a distance of " + ", ".join(_open_by_kind(measured))
    exact = [item for item in measured if item.setting is EXACT]
    yield f"exact: time {_spread(exact)}; by number of contact nodes {_by_nodes(exact)}"
    yield "fast is right from a distance of: " + ", ".join(
        f"{_text(lines[s.name]['right from'])} with tolerance {s.tolerance:.0e}" for s in SWEEP
    )
    yield f"fast exactly on a degeneracy, wrong of {on}: " + ", ".join(
        f"{_wrong_on(rows, s)} with {s.tolerance:.0e}" for s in SWEEP
    )
    yield from _what_fast_does(fast)
    for setting in (SINGLE, SINGLE_WIDE):
        line = lines[setting.name]
        yield (
            f"{setting.name}: right from a distance of {_text(line['right from'])}, {line['on: wrong %']:.0f} % wrong "
            f"exactly on it; forces within {line['force error']:.0e} from {SEPARATED:g} on (float64: "
            f"{lines[FAST.name]['force error']:.0e}); two close nodes {line['two nodes: open %']:.0f} % refused; "
            f"time {line['time ratio']:.2f}"
        )


def _opened(items: Sequence[Measurement]) -> str:
    parts = []
    for name, chosen in (
        ("beside a degeneracy", [i for i in items if i.case.degeneracy == "alpha" and i.case.distance]),
        ("on it", [i for i in items if i.case.degeneracy == "alpha" and not i.case.distance]),
        ("two close nodes", [i for i in items if i.case.degeneracy == "two nodes"]),
    ):
        parts.append(f"{sum(item.open for item in chosen)} of {len(chosen)} {name}")
    return ", ".join(parts)


def _open_by_kind(measured: Sequence[Measurement]) -> Iterator[str]:
    items = [item for item in measured if item.setting is LARGE and item.case.degeneracy == "alpha"]
    for kind in sorted({item.case.kind for item in items}):
        beside = [item for item in items if item.case.kind == kind and item.case.distance]
        if beside:
            yield f"{_text(_from(beside, lambda item: item.open))} ({kind})"


def _spread(items: Sequence[Measurement]) -> str:
    """Median time well beside a degeneracy, very near it and on it."""
    alpha = [item for item in items if item.case.degeneracy == "alpha"]
    far = _time([item for item in alpha if item.case.distance >= SEPARATED])
    near = _time([item for item in alpha if 0 < item.case.distance < 1e-13])
    on = _time([item for item in alpha if not item.case.distance])
    return f"{far:.1f} from {SEPARATED:g} on, {near:.1f} below 1e-13, {on:.1f} on it"


def _by_nodes(items: Sequence[Measurement]) -> str:
    sizes = sorted({item.case.scene.problem.p for item in items})
    return ", ".join(f"p = {p}: {_time([i for i in items if i.case.scene.problem.p == p]):.1f}" for p in sizes)


def _wrong_on(rows: Sequence[dict[str, Any]], setting: Setting) -> int:
    return next(
        row["wrong"]
        for row in rows
        if row["setting"] == setting.name and row["degeneracy"] == "alpha" and row["distance"] == 0
    )


def _what_fast_does(fast: Sequence[Measurement]) -> Iterator[str]:
    """How fast arithmetic with its default tolerance goes wrong, where, and whether it shows."""
    bad = [item for item in fast if item.wrong]
    kinds = sorted({item.case.kind for item in fast})
    yield f"{FAST.name}, wrong answers by kind of degeneracy: " + ", ".join(
        f"{kind} {sum(i.case.kind == kind for i in bad)} of {sum(i.case.kind == kind for i in fast)}" for kind in kinds
    )
    names = ("missed", "invented", "duplicates")
    counts = ", ".join(f"{sum(getattr(i.comparison, name) for i in bad)} {name}" for name in names)
    good = [item for item in fast if not item.wrong]
    yield (
        f"{FAST.name}: {counts} in {len(bad)} wrong answers; the sum of the indices shows "
        f"{sum(i.flagged for i in bad)} of them (and is not +1 for {sum(i.flagged for i in good)} of {len(good)} "
        "right ones)"
    )


# -- figure --------------------------------------------------------------------------------------------------------


def draw(rows: Sequence[dict[str, Any]], measured: Sequence[Measurement]) -> None:
    """Shares of wrong answers against distance: tolerances as a map, settings as lines; and time against errors."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.5, 4.6), layout="constrained")
    sweep, lines, trade = figure.subplots(1, 3, width_ratios=(1.15, 1.15, 1.0))
    distances = sorted(map(float, DISTANCES))
    shares = {
        (row["setting"], row["distance"]): (
            100.0 * row["wrong"] / row["problems"],
            100.0 * row["open"] / row["problems"],
        )
        for row in rows
        if row["degeneracy"] == "alpha"
    }
    _draw_sweep(figure, sweep, distances, shares)
    _draw_lines(lines, distances, shares)
    _draw_trade(trade, overview(measured))
    labels = ["0" if d == 0 else f"$10^{{{round(np.log10(d))}}}$" for d in distances]
    for axis in (sweep, lines):
        axis.set_xticks(range(0, len(distances), 2), labels[::2])
        axis.set_xlabel("distance to the next degeneracy (0: exactly on it)")
    figure.savefig(RESULTS / "accuracy_enumeration.png", dpi=150)


def _draw_sweep(figure, axis, distances, shares) -> None:
    table = [[shares[setting.name, d][0] for d in distances] for setting in SWEEP]
    image = axis.imshow(table, aspect="auto", cmap="YlOrRd", vmin=0.0)
    axis.set_yticks(range(len(SWEEP)), [f"$10^{{{round(np.log10(s.tolerance))}}}$" for s in SWEEP])
    axis.set_ylabel("tolerance of fast arithmetic")
    for row, values in enumerate(table):
        for column, value in enumerate(values):
            if value > 0:
                text = f"{value:.0f}" if value >= 1 else "<1"
                axis.text(
                    column, row, text, ha="center", va="center", fontsize=6.5, color="black" if value < 25 else "white"
                )
    axis.set_title("wrong answers [%], blank: none", fontsize=10)
    figure.colorbar(image, ax=axis, shrink=0.9)


def _draw_lines(axis, distances, shares) -> None:
    places = range(len(distances))
    for setting, form in FORMS.items():
        wrong = [shares[setting.name, d][0] for d in distances]
        if setting is LARGE:
            axis.plot(
                places,
                [shares[setting.name, d][1] for d in distances],
                form,
                color=GREEN,
                markersize=4,
                markerfacecolor="white",
                label=f"{setting.name}: left open, none wrong" if not any(wrong) else None,
            )
        else:
            axis.plot(places, wrong, form, color=COLOURS[setting], markersize=4, label=setting.name)
    axis.set_title("wrong answers (dashed: selections left open) [%]", fontsize=10)
    axis.set_ylim(-3, 103)
    axis.legend(fontsize=8, frameon=False)
    axis.grid(visible=True, color="#e4e4e4", linewidth=0.6)


def _draw_trade(axis, lines) -> None:
    """Every setting as a point: time, and the share of all alphas beside a degeneracy that it got wrong."""
    by_name = {line["setting"]: line for line in lines}
    sweep = [by_name[setting.name] for setting in SWEEP]
    times, wrong = ([line[name] for line in sweep] for name in ("time ratio", "near: wrong %"))
    axis.plot(times, wrong, "-o", color=BLUE, markersize=4, label="fast, tolerance 1e-04 (top) to 1e-15")
    for setting, marker, colour in (
        (SINGLE, "s", RED),
        (SINGLE_WIDE, "^", ORANGE),
        (VERIFIED, "D", GREEN),
        (LARGE, "d", GREEN),
        (EXACT, "*", "black"),
    ):
        line = by_name[setting.name]
        face = "white" if setting is LARGE else colour
        axis.plot(
            line["time ratio"],
            line["near: wrong %"],
            marker,
            color=colour,
            markerfacecolor=face,
            markersize=7,
            label=setting.name,
        )
    line = by_name[LARGE.name]
    axis.annotate(
        f"leaves {line['near: open %']:.0f} % open",
        (line["time ratio"], line["near: wrong %"]),
        xytext=(0, 12),
        textcoords="offset points",
        ha="center",
        fontsize=8,
        color=GREY,
    )
    axis.set_xlabel(f"time ({FAST.name}: 1), median")
    axis.set_ylabel("wrong answers beside a degeneracy [%]")
    axis.set_title("the trade", fontsize=10)
    axis.set_xlim(0.5, 1.15 * max(line["time ratio"] for line in lines))
    axis.set_ylim(bottom=-2)
    axis.legend(fontsize=8, frameon=False)
    axis.grid(visible=True, color="#e4e4e4", linewidth=0.6)
