"""The settings that are compared, what each makes of every case, and checks of the exact answers.

Exact arithmetic is the reference. Its own counts are therefore zero by construction; ``checks`` compares it with all
4^p selections and with the branch graphs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from accuracy_vs_speed.matching import Comparison, compare
from accuracy_vs_speed.problems import Case, Scene
from enumsol import InvalidProblemError, enumerate_roots
from shared.clock import timed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from fractions import Fraction

DEFAULT = 1e-9
TOLERANCES = tuple(10.0**-k for k in range(4, 16))
#: The exhaustive method in rationals checks the exact answers of problems with at most so many contact nodes.
CHECKED_P = 2


@dataclass(frozen=True)
class Setting:
    """A way to enumerate: the variant of the problem it works on (an attribute of Scene) and its options."""

    name: str
    variant: str
    arithmetic: str
    tolerance: float = DEFAULT

    def run(self, case: Case):
        """All solutions, and the process time."""
        problem = getattr(case.scene, self.variant)
        return timed(lambda: enumerate_roots(problem, case.alpha, self.arithmetic, tolerance=self.tolerance))


FAST = Setting(f"fast {DEFAULT:.0e}", "problem", "fast")
VERIFIED = Setting("verified", "problem", "verified")
LARGE = Setting("verified, n > 250", "padded", "verified")
EXACT = Setting("exact", "problem", "exact")
SINGLE = Setting("float32, fast 1e-09", "single", "fast")
SINGLE_WIDE = Setting("float32, fast 1e-05", "single", "fast", 1e-5)
SWEEP = tuple(FAST if tol == DEFAULT else Setting(f"fast {tol:.0e}", "problem", "fast", tol) for tol in TOLERANCES)
SETTINGS = (*SWEEP, SINGLE, SINGLE_WIDE, VERIFIED, LARGE, EXACT)


@dataclass(frozen=True)
class Measurement:
    """One setting on one case.

    Attributes
    ----------
    undecided : int
        Selections listed as undecided.
    refused : bool
        The problem was refused: no answer.
    claimed : bool
        The answer claims to be complete.
    flagged : bool
        The sum of the indices is not +1, or not known: the answer itself shows that something may be wrong.
    time_ratio : float
        Relative to fast arithmetic's time on the same case.
    """

    setting: Setting
    case: Case
    comparison: Comparison
    undecided: int
    refused: bool
    claimed: bool
    flagged: bool
    time_ratio: float

    @property
    def wrong(self) -> bool:
        """Whether the setting gave a wrong answer; none at all is not wrong."""
        return not self.refused and self.comparison.wrong

    @property
    def open(self) -> bool:
        """Whether the setting said that it could not decide all, or refused the problem."""
        return self.refused or self.undecided > 0


def measure(all_cases: Sequence[Case]) -> list[Measurement]:
    """Every setting on every case."""
    warm: set[tuple[Scene, Setting]] = set()
    return [item for case in all_cases for item in measure_case(case, warm)]


def measure_case(case: Case, warm: set[tuple[Scene, Setting]]) -> Iterator[Measurement]:
    """Every setting on one case; ``warm`` are the scenes that a setting has met before."""
    FAST.run(case)  # the first run at an alpha is slower than the next
    unit = None
    for setting in (FAST, *(s for s in SETTINGS if s is not FAST)):
        try:
            if (case.scene, setting) not in warm:
                # what is made once a problem (condensation, its bounds) is left out of the times
                setting.run(case)
                warm.add((case.scene, setting))
            roots, seconds = setting.run(case)
        except InvalidProblemError:
            # S as condensed is not positive definite: no answer, and the program says so
            nothing = Comparison()
            yield Measurement(setting, case, nothing, 0, refused=True, claimed=False, flagged=True, time_ratio=np.nan)
            continue
        unit = unit or seconds
        yield Measurement(
            setting,
            case,
            compare(roots, case.exact, case.load),
            len(roots.undecided),
            refused=False,
            claimed=roots.complete,
            flagged=roots.index_sum != 1,
            time_ratio=seconds / unit,
        )


def table(measured: Sequence[Measurement]) -> list[dict[str, object]]:
    """One row per kind of degeneracy, setting and distance."""
    groups: dict[tuple[str, Setting, Fraction], list[Measurement]] = {}
    order = {setting: k for k, setting in enumerate(SETTINGS)}
    for item in sorted(measured, key=lambda item: (item.case.degeneracy, order[item.setting], -item.case.distance)):
        groups.setdefault((item.case.degeneracy, item.setting, item.case.distance), []).append(item)
    return [summary(items, *group) for group, items in groups.items()]


def summary(items: Sequence[Measurement], degeneracy: str, setting: Setting, distance: Fraction) -> dict[str, object]:
    """Sums over the cases of one group."""
    counts = {
        name: sum(getattr(item.comparison, name) for item in items)
        for name in ("missed", "invented", "duplicates", "renamed", "outside")
    }
    return {
        "degeneracy": degeneracy,
        "setting": setting.name,
        "distance": float(distance),
        "problems": len(items),
        "wrong": sum(item.wrong for item in items),
        **counts,
        "undecided": sum(item.undecided for item in items),
        "open": sum(item.open for item in items),
        "refused": sum(item.refused for item in items),
        "wrong and flagged": sum(item.wrong and item.flagged for item in items),
        "wrong claims": sum(item.claimed and item.wrong for item in items),
        "force error": max((item.comparison.error for item in items), default=0.0),
        "time ratio": median_time(items),
    }


def median_time(items: Sequence[Measurement]) -> float:
    """Median of the time ratios where there is an answer."""
    ratios = [item.time_ratio for item in items if not item.refused]
    return float(np.median(ratios)) if ratios else np.nan


def checks(all_cases: Sequence[Case]) -> dict[str, tuple[int, int]]:
    """Exact answers examined by other means, and how many of them differ.

    "selections": all 4^p selections solved in rationals. "graph": the number of arcs and vertices of the branch graph
    at that alpha, which comes from a search over the whole interval.
    """
    done = {"selections": [0, 0], "graph": [0, 0]}
    for case in all_cases:
        exact = case.exact
        if case.scene.problem.p <= CHECKED_P:
            other = enumerate_roots(case.scene.problem, case.alpha, "exact", "exhaustive")
            differs = compare(other, exact, case.load)
            done["selections"][0] += 1
            done["selections"][1] += differs.wrong or differs.renamed > 0 or differs.error > 1e-15
        if case.degeneracy == "alpha":
            done["graph"][0] += 1
            done["graph"][1] += case.scene.graph.multiplicity_at(case.alpha) != len(exact) + len(exact.families)
    return {name: (total, wrong) for name, (total, wrong) in done.items()}
