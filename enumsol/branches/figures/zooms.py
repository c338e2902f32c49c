"""Narrow parts of an interval in which the number of solutions changes, which a plot of the whole would hide."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from enumsol.branches.claims import MultiplicitySteps

#: Narrower than this part of the interval, a change cannot be seen; at most so many are shown.
_NARROW, _MOST = 0.02, 2
#: What is shown on both sides, by the width of the narrow part.
_MARGIN = 0.75


def narrow_changes(steps: MultiplicitySteps, interval: tuple[float, float]) -> list[tuple[float, float]]:
    """Windows of alpha around steps too narrow to be seen, in the order of alpha.

    Of many those with the largest changes, of these the narrowest. Neighbours share a window in which both are seen.
    """
    a, b = interval
    alphas, least = [float(alpha) for alpha in steps.alphas], _NARROW * (b - a)
    # plateaus of equal counts: count, first and last alpha
    plateaus: list[tuple[int, float, float]] = []
    for count, lo, hi in zip(steps.between, alphas, alphas[1:], strict=False):
        if plateaus and plateaus[-1][0] == count:
            plateaus[-1] = (count, plateaus[-1][1], hi)
        else:
            plateaus.append((count, lo, hi))
    # change, first and last alpha, width of the narrowest step
    found: list[tuple[int, float, float, float]] = []
    for k, (count, lo, hi) in enumerate(plateaus):
        if len(plateaus) == 1 or not 0 < hi - lo < least:
            continue
        change = max(abs(count - plateaus[j][0]) for j in (k - 1, k + 1) if 0 <= j < len(plateaus))
        largest, first, last, width = found[-1] if found else (0, lo, float("-inf"), 0.0)
        width = min(width, hi - lo)
        if lo <= last and hi - first < least and width >= _NARROW * (hi - first):
            found[-1] = (max(change, largest), first, hi, width)
        else:
            found.append((change, lo, hi, hi - lo))
    found.sort(key=lambda item: (-item[0], item[2] - item[1]))
    margins = [(lo, hi, _MARGIN * (hi - lo)) for _, lo, hi, _ in found[:_MOST]]
    return sorted((max(a, lo - margin), min(b, hi + margin)) for lo, hi, margin in margins)
