"""Table, conclusions and figure of the profile, from what was measured before and now."""

from __future__ import annotations

from statistics import geometric_mean

from search_profile.sampler import ENCLOSURE, PARTS
from shared.figures import panels

COLOURS = ("#1f5fa8", "#7fb2e5", "#e8a33d", "#c0392b", "#7b241c", "#4f7f3c", "#a9c79a", "#9a9a9a", "#e6dccb")


def merged(now, before):
    """One row per problem: nodes, seconds and the shares of the parts, before and now."""
    for name, new in now["problems"].items():
        old = before["problems"].get(name) if before else None
        row = {"problem": name, "p": new["p"], "roots": new["roots"]}
        for column in ("nodes", "seconds"):
            row |= {f"{column} before": old[column] if old else "-", f"{column} now": new[column]}
        row["time ratio"] = new["seconds"] / old["seconds"] if old else "-"
        row["without enclosure"] = searching(new) / searching(old) if old else "-"
        for when, source in (("before", old), ("now", new)):
            row[f"us/node {when}"] = 1e6 * source["seconds"] / source["nodes"] if source else "-"
        for part in PARTS:
            row |= {f"{part} % before": 100 * share(old, part) if old else "-", f"{part} % now": 100 * share(new, part)}
        yield row


def share(source, part):
    return source["parts"].get(part, 0.0) / source["clocked"]


def searching(source):
    """Seconds without the enclosure, which is made once a problem and serves every alpha."""
    return source["seconds"] - seconds_of(source, ENCLOSURE)


def seconds_of(source, part):
    return share(source, part) * source["seconds"]


def conclusions(now, before):
    """Notes below the table, all from the data."""
    both = [("now", now)]
    if before:
        both.insert(0, (f"before ({before['label']})", before))
    for when, source in both:
        for p in sorted({row["p"] for row in source["problems"].values()}):
            yield f"{when}, p = {p}: {by_part([row for row in source['problems'].values() if row['p'] == p])}"
        if source.get("unknown"):
            yield f"{when}: no function is called {', '.join(source['unknown'])}; its time counts for another part"
    if before:
        names = [name for name in now["problems"] if name in before["problems"]]
        yield from changes(names, [(before["problems"][name], now["problems"][name]) for name in names])
        speed = now["yardstick"] / before["yardstick"]
        verdict = "the times compare" if 0.85 < speed < 1.18 else "the times do not compare"
        yield f"a fixed piece of work took {speed:.2f} times what it took beside the runs before: {verdict}"
        if "unknown" not in before:
            yield "the parts before were measured by clocks around functions, those now by samples of the stack"
    yield f"least of {now['rounds']} rounds"


def by_part(rows):
    """Share of the enclosure, and the largest parts of the rest."""
    seconds = {part: sum(seconds_of(row, part) for row in rows) for part in PARTS}
    total, once = sum(seconds.values()), seconds.pop(ENCLOSURE)
    first = sorted(seconds, key=seconds.get, reverse=True)[:5]
    return f"{ENCLOSURE} {100 * once / total:.0f} % of the time; of the rest " + ", ".join(
        f"{part} {100 * seconds[part] / (total - once):.0f} %" for part in first
    )


def changes(names, pairs):
    """What is faster and what is slower, in whole, without the enclosure and by part."""
    for label, value in (
        ("time", lambda row: row["seconds"]),
        (f"time without the {ENCLOSURE}", searching),
        ("nodes", lambda row: row["nodes"]),
    ):
        ratio = {name: value(new) / value(old) for name, (old, new) in zip(names, pairs, strict=True)}
        low, high = min(ratio, key=ratio.get), max(ratio, key=ratio.get)
        yield (
            f"{label}, now over before: geometric mean {geometric_mean(ratio.values()):.2f}, from {ratio[low]:.2f} "
            f"({low}) to {ratio[high]:.2f} ({high}); more on {sum(r > 1 for r in ratio.values())} of {len(ratio)}"
        )
    rates = {}
    for part in PARTS:
        seen = [(new, old) for old, new in pairs if share(old, part) > 0 and share(new, part) > 0]
        if part not in ("selections", "ends", ENCLOSURE) and seen:
            rates[part] = geometric_mean(a_node(new, part) / a_node(old, part) for new, old in seen)
    yield "time a node, now over before, geometric means: " + ", ".join(f"{k} {v:.2f}" for k, v in rates.items())


def a_node(source, part):
    return seconds_of(source, part) / source["nodes"]


def draw(now, before):
    """Stacked bars for every problem: the parts of the time, relative to the whole before (or now)."""
    names = list(now["problems"])
    figure, axis = panels(1, 1, (11, 1.8 + 0.62 * len(names)))
    longest = 0.0
    for k, name in enumerate(names):
        bars = [("now", now["problems"][name], 0.19)]
        if before and name in before["problems"]:
            bars.insert(0, ("before", before["problems"][name], -0.19))
        for when, source, shift in bars:
            left, whole = 0.0, bars[0][1]["seconds"]
            for part, colour in zip(PARTS, COLOURS, strict=True):
                width = seconds_of(source, part) / whole
                label = f"{part}: {PARTS[part]}" if (k, when) == (0, "now") else None
                axis.barh(k + shift, width, 0.34, left=left, color=colour, label=label, linewidth=0)
                left += width
            longest = max(longest, left)
            text = f" {when}: {source['seconds']:.2g} s, {source['nodes']} nodes"
            axis.text(left, k + shift, text, va="center", fontsize=8, color="#404040")
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.24 * longest)
    axis.set_xlabel("process time of a verified enumeration, relative to before")
    axis.grid(visible=False)
    axis.tick_params(left=False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure
