"""What do samples of alpha miss that a branch graph shows, and what do both cost?

Four parts, each with a table of its own:

missed (``accuracy_sampling``)
    39 paths against 10 to 1,000 samples: transitions, arcs and branches without a sample, links between wrong roots,
    and times. Read the shares missed beside ``time ratio``, where the proven graph is 1.
thin (``branch_thin``)
    Closed branches of any length in alpha: which of them no sample sees.
wedge (``branch_wedge``)
    Whole graphs of wedges with up to 16 contact nodes: seconds beside those of 1,000 samples.
agreement (``branch_agreement``)
    At random alphas the graph must hold the roots that an enumeration finds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from samples_vs_graph import agreement, missed, thin, wedge

if TYPE_CHECKING:
    from argparse import ArgumentParser

    from shared.results import Run

PARTS = {"missed": missed, "thin": thin, "wedge": wedge, "agreement": agreement}


def options(parser: ArgumentParser) -> None:
    parser.add_argument("--part", action="append", choices=PARTS, help="a part to run; default: all")


def main(run: Run) -> None:
    for name in run.options.part or PARTS:
        PARTS[name].main(run)
