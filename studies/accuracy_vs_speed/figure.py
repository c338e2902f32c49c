"""The figure: where which setting is wrong, and what it costs."""

from __future__ import annotations

import numpy as np

from accuracy_vs_speed.settings import EXACT, FAST, LARGE, SINGLE, SINGLE_WIDE, SWEEP, VERIFIED
from shared.figures import BLUE, GREEN, GREY, ORANGE, RED, panels

FORMS = {FAST: "-o", SINGLE: "-s", SINGLE_WIDE: "-^", VERIFIED: "-D", LARGE: "--D"}
COLOURS = {FAST: BLUE, SINGLE: RED, SINGLE_WIDE: ORANGE, VERIFIED: GREEN, LARGE: GREEN}


def draw(rows, lines):
    """Wrong answers against distance, tolerances as a map and settings as lines; and time against errors.

    ``rows`` is the table by distance, ``lines`` the summary by setting.
    """
    figure, (sweep, shown, trade) = panels(1, 3, (13.5, 4.6), width_ratios=(1.15, 1.15, 1.0))
    distances = sorted({row["distance"] for row in rows if row["degeneracy"] == "alpha"})
    shares = {
        (row["setting"], row["distance"]): (
            100.0 * row["wrong"] / row["problems"],
            100.0 * row["open"] / row["problems"],
        )
        for row in rows
        if row["degeneracy"] == "alpha"
    }
    draw_sweep(figure, sweep, distances, shares)
    draw_lines(shown, distances, shares)
    draw_trade(trade, lines)
    labels = ["0" if d == 0 else f"$10^{{{round(np.log10(d))}}}$" for d in distances]
    for axis in (sweep, shown):
        axis.set_xticks(range(0, len(distances), 2), labels[::2])
        axis.set_xlabel("distance to the next degeneracy (0: exactly on it)")
    return figure


def draw_sweep(figure, axis, distances, shares):
    """Wrong answers of fast arithmetic as a map: tolerance against distance."""
    axis.grid(visible=False)
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


def draw_lines(axis, distances, shares):
    """Wrong answers of the other settings against distance."""
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


def draw_trade(axis, lines):
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
