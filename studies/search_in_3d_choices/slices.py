"""Searches in 3D that cut other slices off sectors than the product, or test leaves at other times."""

from __future__ import annotations

from contextlib import ExitStack
from time import process_time
from typing import TYPE_CHECKING
from unittest.mock import patch

from enumsol import gallery
from enumsol.relaxation import space_relaxation
from enumsol.relaxation.space_relaxation import SpaceRelaxation
from enumsol.search.outcome import SearchLimits
from enumsol.trusted.space.leaves import distinct_roots

if TYPE_CHECKING:
    from shared.results import Run

CHOICES = {
    "as it is": {},
    "no slices": {},
    "halves only": {"THINNEST": 1},
    "eighths, too": {"THINNEST": 3},
    "leaves last": {"NARROW": 99},
    "leaves from level 6": {"NARROW": 6},
    "before statuses are final": {},
}


class NoSlices(SpaceRelaxation):
    """Cuts no slices."""

    __slots__ = ()

    def shaved(self, codes, violated):
        """None."""
        del codes, violated
        return -1


class Everywhere(SpaceRelaxation):
    """Cuts slices at every node of the tree."""

    __slots__ = ()

    def choose(self, codes):
        """The node to branch on."""
        self.cut = None
        node = self.shaved(codes, (self.violations(codes) > 0).tolist())
        return node if node >= 0 else super().choose(codes)


#: Relaxations of those choices that are not constants.
KINDS = {"no slices": NoSlices, "before statuses are final": Everywhere}


def wedge(cells, friction):
    """A wedge on weak springs, at alpha = 0."""
    return (lambda: gallery.wedge3d(*cells, friction=friction, multipliers="nodes")), 0.0


def entry(name):
    """An entry of the gallery."""
    found = gallery.get(name)
    return found.build, found.alpha


#: With all choices; with the first ones, which take longer.
WEDGES = {name: entry(name) for name in ("wedge3d-4-9", "wedge3d-8-5")} | {"2x1x2, F = 2": wedge((2, 1, 2), 2)}
LARGER = {"1x1x2, F = 2": wedge((1, 1, 2), 2), "1x1x2, F = 1": wedge((1, 1, 2), 1)}
FIRST = "as it is", "no slices", "leaves last"


def slices(run: Run, solvers, most: int) -> None:
    """The table of slices and times of tests.

    Parameters
    ----------
    solvers : makes the solvers of a problem with relaxations of a kind
    most : nodes of the tree
    """
    rows = []
    for choice, constants in CHOICES.items():
        cases = WEDGES if run.smoke or choice not in FIRST else WEDGES | LARGER
        for name, (build, alpha) in cases.items():
            with ExitStack() as stack:
                for constant, value in constants.items():
                    stack.enter_context(patch.object(space_relaxation, constant, value))
                problem = build()
                problem.enclosure  # noqa: B018 (made once, not part of the search)
                started = process_time()
                one = solvers(problem, alpha, KINDS.get(choice, SpaceRelaxation))
                certifier = one.certifier()
                outcome = one.search(certifier, SearchLimits(max_nodes=most)).run()
                seconds = process_time() - started
            row = {"choice": choice, "problem": name, "nodes": outcome.nodes, "leaves": outcome.selections}
            row["roots"] = len(distinct_roots(certifier.certified.verified.items())[0])
            rows.append({**row, "complete": outcome.stopped is None and not outcome.undecided, "s": seconds})
    product = {row["problem"]: row["nodes"] for row in rows if row["choice"] == "as it is"}
    lines = []
    for choice in list(CHOICES)[1:]:
        own = [row for row in rows if row["choice"] == choice]
        ratios = ", ".join(f"{row['nodes'] / product[row['problem']]:.2f} ({row['problem']})" for row in own)
        lines.append(f"{choice}: {ratios} times the nodes of the product")
    run.table("slices", rows, *lines)
