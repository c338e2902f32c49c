"""What do certificates around a known root save for bodies in the plane that nothing but contact holds?

Half of a plate on a floor, blocks on a slab and on each other, a pin in the hole of a strip (half of both with rollers,
and whole), a bar between two plates (a telescope in section), and wedges, a brake shoe and a clip without the springs
that hold them in the gallery. ``certificates`` is the search as it is: where the form of a known root leaves no other
one below an assignment the tree ends, and it may be led to such assignments (theory, section 14.11). ``tree`` is the
same search without these. Both are cut at a number of nodes, and the proofs of both are checked. Seconds are those of
the processor, for the search alone; ``verify s`` is what the checker takes for the proof of the first.

Before multipliers were brought into balance (theory, section 14.5), and rows wanted relative to the data, searches
without certificates were much longer: the half of a plate was cut after 4,191 nodes, the block with 21 contact nodes
after 2,116, both whole pins after 1,248 and 2,409, and the telescope with 42 after 3,821.

Read ``nodes`` and ``complete`` of both, and of bodies with several ``roots`` how little the two differ. Where both are
complete they find the same number of roots, or the study fails.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import enumsol
from contact_alone.bodies import brake_shoe, clip, half_plate, pin, stack, telescope, wedge
from enumsol.search.nodes import TreeCloser
from shared.clock import timed
from shared.results import yes

if TYPE_CHECKING:
    from collections.abc import Callable

    from shared.results import Run

MAX_NODES, SMOKE_NODES = 4000, 100
#: In and out of the notch: force per length of the top, and interference.
PRESSED, PULLED = ((0.0, -5e-4), 0.0), ((0.0, 5e-4), 5e-4)
CASES: dict[str, Callable[[], Any]] = {
    "half plate, 17 nodes": partial(half_plate, 16),
    "half plate, 33 nodes": partial(half_plate, 32),
    "half plate, 65 nodes": partial(half_plate, 64),
    "block on slab, 11 nodes": partial(stack, 1),
    "block on slab, 21 nodes": partial(stack, 2),
    "block on slab, 41 nodes": partial(stack, 4),
    "two blocks on slab": partial(stack, 1, 2),
    "half pin, F = 0.1": partial(pin, 48, 0.1),
    "half pin, F = 0.5": partial(pin, 48, 0.5),
    "whole pin, F = 0.1": partial(pin, 48, 0.1, half=False),
    "whole pin, F = 0.5": partial(pin, 48, 0.5, half=False),
    "telescope, 42 nodes": partial(telescope, 20),
    "telescope, 82 nodes": partial(telescope, 40),
    "telescope, 162 nodes": partial(telescope, 80),
    "wedge pressed, F = 0.5": partial(wedge, 8, 0.5, *PRESSED),
    "wedge pulled, F = 1, p = 10": partial(wedge, 4, 1.0, *PULLED),
    "wedge pulled, F = 1, p = 18": partial(wedge, 8, 1.0, *PULLED),
    "wedge pulled, F = 1.5, p = 10": partial(wedge, 4, 1.5, *PULLED),
    "brake shoe, pushed, F = 0.25": partial(brake_shoe, 8, 0.25, -0.05),
    "brake shoe, pushed, F = 0.4": partial(brake_shoe, 8, 0.4, -0.05),
    "brake shoe, pushed, F = 0.6": partial(brake_shoe, 8, 0.6, -0.05),
    "brake shoe, pulled, F = 0.6": partial(brake_shoe, 8, 0.6, 0.05),
    "brake shoe, pulled, F = 1": partial(brake_shoe, 8, 1.0, 0.05),
    "clip, pulled, F = 0.4": partial(clip, 8, 0.4, 0.1),
    "clip, pulled, F = 0.6": partial(clip, 8, 0.6, 0.1),
    "clip, pulled, F = 0.8": partial(clip, 8, 0.8, 0.1),
    "clip, pushed, F = 0.4": partial(clip, 8, 0.4, -1.0),
}
SMOKE_CASES = ("half plate, 17 nodes", "half pin, F = 0.1", "wedge pressed, F = 0.5", "clip, pulled, F = 0.4")


def row(name: str, most: int) -> dict[str, Any]:
    problem = CASES[name]()
    _ = problem.on_springs.condensed
    search = partial(enumsol.enumerate_roots, problem, 0, max_nodes=most)
    roots, seconds = timed(search)
    checked, verified = timed(enumsol.verify, problem, roots.proof)
    with patch("enumsol.search.solvers.ReferenceCloser", lambda *_, **__: TreeCloser()):
        alone, without = timed(search)
    assert checked
    assert enumsol.verify(problem, alone.proof)
    assert not (roots.complete and alone.complete) or len(roots) == len(alone)
    return {
        "body": name,
        "p": problem.p,
        "modes": problem.rigid_modes.shape[1],
        "roots": len(roots),
        "complete": yes(roots.complete),
        "nodes": roots.stats.nodes,
        "closed": roots.stats.closed,
        "seconds": seconds,
        "verify s": verified,
        "tree complete": yes(alone.complete),
        "tree nodes": alone.stats.nodes,
        "tree s": without,
    }


def main(run: Run) -> None:
    most = SMOKE_NODES if run.smoke else MAX_NODES
    enumsol.enumerate_roots(half_plate(2), 0)  # what is imported is outside the clock
    rows = [row(name, most) for name in (SMOKE_CASES if run.smoke else CASES)]
    done = [[line for line in rows if line[kind] == "yes"] for kind in ("complete", "tree complete")]
    both = [line for line in rows if line["complete"] == line["tree complete"] == "yes"]
    several = [line for line in both if line["roots"] > 1]
    run.table(
        "contact_alone",
        rows,
        f"complete of {len(rows)}: {len(done[0])} with certificates, {len(done[1])} without",
        f"nodes of the {len(both)} that both complete: {sum(line['nodes'] for line in both)} with certificates, "
        f"{sum(line['tree nodes'] for line in both)} without",
        f"of these the {len(several)} with several solutions: {sum(line['nodes'] for line in several)} and "
        f"{sum(line['tree nodes'] for line in several)}",
        f"searches are cut at {most} nodes",
    )
