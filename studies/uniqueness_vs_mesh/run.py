"""How do the contraction estimate and the bound on friction depend on the mesh?

Clamped blocks, pressed and sheared, on regular meshes refined together: in plane strain (multipliers on nodes), and in
3D with multipliers on nodes, H = h, and piecewise constant on patches of 2 x 2 and 4 x 4 facets. Measured are C1 / F
with the bound on F that it gives, C2 / L for a coefficient that depends on the slip, the constants they are made of
(theory, section 11.5), and the contraction that successive approximations show at F = 0.5. Slopes are least squares in
log-log over all meshes, and between the two finest. Predicted in 3D (paper, Section 3) are C1 ~ H^(-1/2), the bound ~
H^(1/2) and C2 ~ (H h)^(-1/2), which is H^(-1) at fixed H / h. One more series keeps H = 1/4 and refines h alone.

The other table compares, mesh by mesh, the norms of H^1 (paper, (3.9), (3.10)) with the energy norms in which the
estimate is made: constants of equivalence between |v|_A and ||v||_1, and between the norms of normal forces that each
gives, and both norms of the load's displacement and of the solution.

Read ``slope`` beside ``paper``, and ``C1`` beside the contraction seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shared.figures import BLUE, GREEN, GREY, ORANGE, RED, panels
from uniqueness_vs_mesh.meshes import F, plane, solid

if TYPE_CHECKING:
    from shared.results import Run

PLANE, SMOKE_PLANE = (8, 16, 32, 64, 128), (4, 8, 16)
#: H / h (0: multipliers on nodes) and the cells along the bottom.
SOLID = ((0, (4, 6, 8, 12, 16, 24)), (2, (4, 8, 12, 16, 24)), (4, (8, 12, 16, 24)))
SMOKE_SOLID = ((0, (4, 6)), (2, (4, 8)))
#: The same at H = 1/4; the first, patches of one facet each, is left out of the slopes.
FIXED, SMOKE_FIXED = ((1, 4), (2, 8), (3, 12), (4, 16), (6, 24)), ((1, 4), (2, 8), (3, 12))
#: Powers of H at fixed H / h. c_inf in plane strain: bounded up to a logarithm, as H^(1/2) almost embeds in L^inf.
PAPER = {"C1 / F": -0.5, "bound on F": 0.5, "C2 / L": -1.0, "c_n": -0.5, "c_t": 0.0, "c_inf": -0.5, "c_phi": 0.0}
PLANE_PAPER = {**PAPER, "C2 / L": "-0.5, log", "c_inf": "0, log"}
SEEN = ("contraction seen", "largest ratio seen")


def slopes(rows, quantities, by="H"):
    """Slopes of quantities against H or h in log-log, for one body."""
    for name, paper in quantities.items():
        x, y = (np.log([row[key] for row in rows]) for key in (by, name))
        yield {
            "body": rows[0]["body"],
            "quantity": name,
            "against": by,
            "meshes": len(rows),
            "from": rows[0][by],
            "to": rows[-1][by],
            "slope": float(np.polyfit(x, y, 1)[0]),
            "between the finest": float((y[-1] - y[-2]) / (x[-1] - x[-2])),
            "paper": paper,
        }


def fitted(groups, fixed):
    """All slopes."""
    for name, rows in groups.items():
        paper = PLANE_PAPER if name.startswith("2D") else PAPER
        yield from slopes(rows, paper | dict.fromkeys(SEEN, "-"))
    yield from slopes(fixed[1:], {"C1 / F": 0.0, "C2 / L": -0.5, "c_inf": -0.5, "c_phi": 0.0}, "h")


def conclusions(groups, fixed, fits):
    """Slopes beside the paper's, and what the iterations did."""
    for quantity in ("C1 / F", "bound on F", "C2 / L"):
        found = [row for row in fits if row["quantity"] == quantity]
        yield f"{quantity}: " + "; ".join(
            f"{row['body']} {row['against']}^{row['slope']:.2f}, {row['between the finest']:.2f} between the finest "
            f"(paper {row['paper']})"
            for row in found
        )
    for name, rows in groups.items():
        seen = [row["contraction seen"] for row in rows]
        most = max(row["largest ratio seen"] for row in rows)
        bounds = [row["C1 / F"] * F for row in rows]
        yield (
            f"{name}: C1 at F = {F:g} from {bounds[0]:.2g} to {bounds[-1]:.2g}, iterations contract by {min(seen):.2g} "
            f"to {max(seen):.2g} in the end (finest mesh {seen[-1]:.2g}) and by {most:.2g} at worst; "
            f"{min(row['iterations'] for row in rows)} to {max(row['iterations'] for row in rows)} iterations"
        )
    coarse, finest = fixed[0], fixed[-1]
    yield (
        f"at H = 1/4 C1 / F falls with h, from {coarse['C1 / F']:.3g} at H / h = 1 to {finest['C1 / F']:.3g} at "
        f"H / h = {finest['H'] / finest['h']:.0f}: c_n, the larger the less displacements see of a multiplier (paper, "
        f"(3.1)), falls from {coarse['c_n']:.3g} to {finest['c_n']:.3g}; c_inf goes from {coarse['c_inf']:.3g} to "
        f"{finest['c_inf']:.3g}, as friction acts on the mean slip of a patch"
    )
    for name, rows in groups.items():
        gains = [row["gain of other weights"] for row in rows]
        if max(gains) > 1.001:
            raw = [np.log(row["c_n"] * row["c_t"]) for row in rows[-2:]]
            slope = float(np.diff(raw)[0] / np.log(rows[-1]["H"] / rows[-2]["H"]))
            yield (
                f"{name}: c_n c_t with theta = m^(-1/2) goes like H^{slope:.2f} between the finest meshes; the better "
                f"weights, which lower C1 by {gains[0]:.2f} on the coarsest and {gains[-1]:.2f} on the finest, make "
                f"the rest of the slope of C1"
            )


def norm_conclusions(rows):
    """Whether the constants of equivalence are bounded."""
    for name in dict.fromkeys(row["body"] for row in rows):
        of_body = [row for row in rows if row["body"] == name]
        parts = []
        for column in [key for key in of_body[0] if key.endswith(("least", "most"))]:
            values = [row[column] for row in of_body]
            change = values[-1] / values[-2] - 1
            parts.append(f"{column} {values[0]:.3f} to {values[-1]:.3f} ({change:+.1%} between the finest)")
        yield f"{name}, h = {of_body[0]['h']:.3g} to {of_body[-1]['h']:.3g}: " + "; ".join(parts)


def draw(groups, fixed):
    """Estimates and contraction against H, with the paper's powers."""
    figure, axes = panels(1, 3, (13, 4.2))
    styles = dict(zip(groups, (("o", GREY), ("s", BLUE), ("^", ORANGE), ("v", RED)), strict=False))
    for axis, column, power in zip(axes, ("C1 / F", "bound on F", "C2 / L"), (-0.5, 0.5, -1.0), strict=True):
        for name, rows in groups.items():
            marker, color = styles[name]
            axis.loglog([r["H"] for r in rows], [r[column] for r in rows], marker + "-", color=color, label=name)
        reference = groups["3D, nodes"]
        H = np.array([row["H"] for row in reference])
        line = reference[0][column] * (H / H[0]) ** power
        axis.loglog(H, 1.25 * line, "k:", label=f"H^({power:g})")
        axis.set(xlabel="H", ylabel=column)
    for name, rows in groups.items():
        marker, color = styles[name]
        seen = [r["contraction seen"] / F for r in rows]
        axes[0].loglog([r["H"] for r in rows], seen, marker + "--", color=color, markerfacecolor="none")
    axes[0].loglog([], [], "k--", label=f"contraction seen / F at F = {F:g}")
    axes[2].loglog([r["H"] for r in fixed], [r["C2 / L"] for r in fixed], "d", color=GREEN, label="H = 1/4, h refined")
    finest = min(row["H"] for rows in groups.values() for row in rows)
    ticks = [2**k for k in range(1, 12) if 2**-k >= 0.99 * finest]
    for axis in axes:
        axis.set_xticks([1 / tick for tick in ticks], [f"1/{tick}" for tick in ticks])
        axis.set_xticks([], minor=True)
        axis.legend(frameon=False, fontsize=7)
    return figure


def main(run: Run) -> None:
    groups = {"2D, nodes": [plane(n) for n in (SMOKE_PLANE if run.smoke else PLANE)]}
    norms = []
    for ratio, sizes in SMOKE_SOLID if run.smoke else SOLID:
        found = [solid(n, ratio) for n in sizes]
        groups[found[0][0]["body"]] = [estimate for estimate, _ in found]
        norms += [row for _, row in found]
        print(f"H / h = {ratio or 1} done", flush=True)
    fixed = [
        solid(n, ratio)[0] | {"body": "3D, elements H = 1/4"} for ratio, n in (SMOKE_FIXED if run.smoke else FIXED)
    ]
    rows = [row for rows in groups.values() for row in rows] + fixed
    fits = list(fitted(groups, fixed))
    run.table("uniqueness_vs_mesh", rows)
    run.table("slopes", fits, *conclusions(groups, fixed, fits))
    run.table("norms_vs_mesh", norms, *norm_conclusions(norms))
    run.figure("uniqueness_vs_mesh", draw(groups, fixed))
