"""Summary by setting, and conclusions.

Well below the tolerance of fast arithmetic the share of wrong answers is that of folds and continua on one of their
sides or both: beside a transition there is one root, and to misjudge its status is not counted as wrong.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from accuracy_vs_speed.settings import EXACT, FAST, LARGE, SETTINGS, SINGLE, SINGLE_WIDE, SWEEP, VERIFIED, median_time

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from typing import Any

    from accuracy_vs_speed.settings import Measurement, Setting

#: Where roots are well separated: errors of forces are compared from this distance on.
SEPARATED = 1e-3


def overview(measured: Sequence[Measurement]) -> list[dict[str, Any]]:
    """One row per setting: from which distance on it is right and leaves nothing open, and what it costs."""
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
                "right from": good_from(near, lambda item: item.wrong),
                "decided from": good_from(near, lambda item: item.open),
                "near: wrong %": share(near, lambda item: item.wrong),
                "near: open %": share(near, lambda item: item.open),
                "on: wrong %": share(on, lambda item: item.wrong),
                "on: open %": share(on, lambda item: item.open),
                "two nodes: wrong %": share(nodes, lambda item: item.wrong),
                "two nodes: open %": share(nodes, lambda item: item.open),
                "force error": max(item.comparison.error for item in apart),
                "time ratio": median_time(items),
            }
        )
    return rows


def good_from(items: Sequence[Measurement], bad: Callable[[Measurement], bool]) -> float | str:
    """The least distance from which on nothing is bad."""
    worst = max((item.case.distance for item in items if bad(item)), default=None)
    good = [item.case.distance for item in items if worst is None or item.case.distance > worst]
    return float(min(good)) if good else "never"


def text_of(distance: float | str) -> str:
    return distance if isinstance(distance, str) else f"{distance:.0e}"


def share(items: Sequence[Measurement], bad: Callable[[Measurement], bool]) -> float:
    return 100.0 * sum(map(bad, items)) / len(items)


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
            f"{sum(item.comparison.outside for item in items)} roots outside their bounds; open {opened(items)}; "
            f"time {times_by_distance(items)}"
        )
    yield f"{LARGE.name}: leaves nothing open from a distance of " + ", ".join(open_by_kind(measured))
    exact = [item for item in measured if item.setting is EXACT]
    yield f"exact: time {times_by_distance(exact)}; by number of contact nodes {times_by_nodes(exact)}"
    yield "fast is right from a distance of: " + ", ".join(
        f"{text_of(lines[s.name]['right from'])} with tolerance {s.tolerance:.0e}" for s in SWEEP
    )
    yield f"fast exactly on a degeneracy, wrong of {on}: " + ", ".join(
        f"{wrong_on(rows, s)} with {s.tolerance:.0e}" for s in SWEEP
    )
    yield from what_fast_does(fast)
    for setting in (SINGLE, SINGLE_WIDE):
        line = lines[setting.name]
        yield (
            f"{setting.name}: right from a distance of {text_of(line['right from'])}, {line['on: wrong %']:.0f} % "
            f"wrong exactly on it; forces within {line['force error']:.0e} from {SEPARATED:g} on (float64: "
            f"{lines[FAST.name]['force error']:.0e}); two close nodes {line['two nodes: open %']:.0f} % refused; "
            f"time {line['time ratio']:.2f}"
        )


def opened(items: Sequence[Measurement]) -> str:
    parts = []
    for name, chosen in (
        ("beside a degeneracy", [i for i in items if i.case.degeneracy == "alpha" and i.case.distance]),
        ("on it", [i for i in items if i.case.degeneracy == "alpha" and not i.case.distance]),
        ("two close nodes", [i for i in items if i.case.degeneracy == "two nodes"]),
    ):
        parts.append(f"{sum(item.open for item in chosen)} of {len(chosen)} {name}")
    return ", ".join(parts)


def open_by_kind(measured: Sequence[Measurement]) -> Iterator[str]:
    items = [item for item in measured if item.setting is LARGE and item.case.degeneracy == "alpha"]
    for kind in sorted({item.case.kind for item in items}):
        beside = [item for item in items if item.case.kind == kind and item.case.distance]
        if beside:
            yield f"{text_of(good_from(beside, lambda item: item.open))} ({kind})"


def times_by_distance(items: Sequence[Measurement]) -> str:
    """Median time well beside a degeneracy, very near it and on it."""
    alpha = [item for item in items if item.case.degeneracy == "alpha"]
    far = median_time([item for item in alpha if item.case.distance >= SEPARATED])
    near = median_time([item for item in alpha if 0 < item.case.distance < 1e-13])
    on = median_time([item for item in alpha if not item.case.distance])
    return f"{far:.1f} from {SEPARATED:g} on, {near:.1f} below 1e-13, {on:.1f} on it"


def times_by_nodes(items: Sequence[Measurement]) -> str:
    sizes = sorted({item.case.scene.problem.p for item in items})
    return ", ".join(f"p = {p}: {median_time([i for i in items if i.case.scene.problem.p == p]):.1f}" for p in sizes)


def wrong_on(rows: Sequence[dict[str, Any]], setting: Setting) -> int:
    return next(
        row["wrong"]
        for row in rows
        if row["setting"] == setting.name and row["degeneracy"] == "alpha" and row["distance"] == 0
    )


def what_fast_does(fast: Sequence[Measurement]) -> Iterator[str]:
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
