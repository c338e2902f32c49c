"""Which contact node should a partial assignment be branched on: how far does it pay to look ahead?

The package takes, among the candidates with the largest violation of complementarity, the one whose children close most
of the gap to pruning, where one step of the dual method bounds each child from below. The table compares numbers of
candidates, and two rules that the package does not have (``rules.py``): full lookahead and pseudo-costs. Presolve comes
first in all of them.

Times are process times of the search, the least of some runs, with the condensed problem and its enclosure made before.
Searches are cut at a number of nodes; verified arithmetic is left out where the fast search was cut, and the figure
leaves cut searches out. The two rules that the package does not have choose in Python: their seconds are somewhat too
long, nodes and programs are not.

Read the geometric means in the notes: below 1 a rule is better than taking the largest violation.

What else was tried: nodes over those of the rule that the package had before (16 candidates; only what one dual step
proves; the two least shares of three children, and the root of the third), geometric means, and at worst, over 20
wedges (p = 14 to 32, five choices of load and friction) and 60 blocks (p = 16 to 48; friction 0.3, 1 and 3).
Verified, with forms.

- a part of what the first step leaves to further ones is added: 0.03 wedges 0.94, 0.1 0.91 (1.10), 0.2 0.92, 0.4
  0.97, blocks 0.99 to 1.01; all of it (the step without other multipliers) wedge p = 32 31,166 nodes instead of
  22,550; geometric means of both instead 0.93 to 0.97.
- the second step computed as well: wedges 0.91 (1.23), blocks 0.96 (1.24), for three triangles solved instead of one.
- 24 candidates instead of 16, with the part 0.1: wedges 0.86 (1.10), blocks 0.98 (1.09); 32 no better.
- less weight for nodes with three children, with both and the whole product: 1: 0.82, 0.98; 0.2: 0.77, 0.97; 0.05
  (the package's): 0.76 (1.01), 0.95 (1.14); 0.005: 0.75, 0.93, but blocks with p = 64 up to 1.7 times as many; 0.0001
  and less, contact strictly before slip: 0.79 to 0.82, 1.01 to 1.07 (1.47).
- instead of less weight, the third share to the power of 1, 1.5, 2 and 3: wedges 0.82, 0.78, 0.78, 0.77, blocks 0.98
  to 0.99 (1.52): the same by other means.
- the violation to the power of 0, 0.25, 0.5 or 2; eps of 1e-5, 1e-2 or 0.1; other weights of an undecided node's slip
  and gap: one wedge or other gains up to two fifths, others lose as much. eps = 1e-2, which takes wedge p = 32 from
  22,550 to 19,063, has 1.14 (2.82) over all 20.

The package's rule on larger ones: wedges p = 36 0.71 (0.79), blocks with p = 64 and 100 and friction 1 to 10 0.98
(1.28).

Table ``slow``: trees in which one dual step closes little of the gap at the root, and others, by both rules that the
package has (theory, section 5.5). Read its notes: the rule for slow trees pays where the share is below 0.04. What else
was tried on six clips (p = 17 to 25, friction 2 to 5), geometric means of nodes over those of the rule for slow trees:

- the rule for other trees 4.0.
- nodes with three children beside those with two: the weight 0.4 (which compares log 2 / a with log 3 / c) 1.2, 1 and 2
  1.08, 10 1.03, 100 1.14; the product of three shares in place of its power 2/3, with the weight 1,000, 1.08.
- without the violation 1.25, with its power 0.3 0.93, with itself 1.12; a tenth of what the step leaves to further ones
  1.25; eps of 3e-3 and 1e-2 1.0.
- the children of all candidates solved: 0.55 to 0.73 as many nodes, three to six times as many programs.

Table ``lookahead``: verified searches that look ahead near their root once their tree has proven long
(``enumsol/search/nodes.py``), and the same that never do. Read the nodes, which include the first 500. What
else was tried, nodes + programs of children (each costs about 0.4 nodes), without the nodes before the decision:

- from the beginning: wedge 20 straight 1,098 -> 1,158 + 1,785, wedge 14 straight 578 -> 552 + 814, dovetail 143 -> 154
  + 303: short trees pay more for the programs than they gain.
- every tree after 1,000 nodes: wedge 32 straight 4,378 -> 3,912 + 4,387; half of its tree is done by then.
- the decision after 1,000 nodes, of trees of which less than 0.05 is done: wedge 32 oblique (0.094) goes on with
  14,581 nodes in place of 9,914, brake shoe 16 x 3 takes 4,169 in place of 3,094, clip 12 x 1, F = 3 19,803 in place of
  19,303; after 500 nodes with 0.05, brake shoe 8 x 3 takes 1,222 in place of 839; after 400, the dovetail looks ahead
  (0.038).
- without beginning again, from where the search stands: taper p = 64 80,094 nodes in place of 26,305, wedge 48 straight
  23,911 in place of 14,215.
- nine decisions in place of twelve: taper p = 64 49,253 nodes in place of 25,805; taper p = 32 looks ahead twelve
  decisions deep, too, and takes 3,068 nodes in 1.2 times the time (six: 3,102 nodes in 0.8 times; 4,014 without).
- deeper: clip 8 x 1, F = 3 with 6, 8 and 12 decisions 6,656 + 2,049, 7,929 + 5,349, 16,521 + 32,459 (8,165 without);
  taper p = 48 11,626 + 3,989, 10,070 + 9,173, 7,349 + 30,054 (23,908), wedge 48 straight 15,422 + 5,089, 18,311 +
  9,417, 21,824 + 26,169 (30,401).
- the geometric mean of the shares in place of (5.7), 12 decisions: taper p = 48 7,688 + 29,958, clip 8 x 1, F = 3 6,506
  + 14,608, but wedge 48 straight 69,819 + 116,218.
- times the violation: wedge 32 oblique, 8 decisions, 15,371 in place of 9,279 (14,581 without).
- fewer candidates: of the 24 with the largest violation brake shoe p = 33 5,017 in place of 3,162; the twelve with the
  best first dual steps, 8 decisions, taper p = 48 12,231 + 5,524.

New forms for subtrees do not pay on clip 8 x 1, F = 3. The best form (by a semidefinite program, 0.1 to 0.3 s) excludes
4 of 10 subtrees with 11 undecided nodes, all of fewer than 160 nodes, which take 3 ms; of the gap of the others it
leaves a quarter to nine tenths. With products of rows of two nodes, all pairs, it excludes 6 of 8 subtrees with 8
undecided nodes, in 1 to 6 s each. At the root, products of rows of neighbours raise the bound from -0.25 to -0.002, but
the tree is 1.05 to 1.3 times as large: minima over assignments below the root are no higher beside the curvature.
"""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np

import enumsol
from branching_rule.notes import conclusions, draw, slow_conclusions
from branching_rule.rules import RULES
from enumsol import gallery
from enumsol.model.statuses import UNDECIDED
from enumsol.relaxation.active_set import ActiveSetEngine
from enumsol.relaxation.engine import status_rows
from enumsol.search import nodes as tree_nodes
from shared.clock import least_time
from shared.loads import DRAGGED, PRESSED, Loaded, block, oblique_wedge, straight_wedge
from shared.searches import search

if TYPE_CHECKING:
    from shared.results import Run

MAX_NODES, SMOKE_NODES = 30_000, 500
#: Searches longer than this are not repeated [seconds].
ENOUGH = 0.3
RUNS = 2
#: p, length, traction and friction of the blocks, from easy to hard.
BLOCKS = (
    (32, 1.0, PRESSED, 1.0),
    (32, 2.0, DRAGGED, 10.0),
    (32, 2.0, PRESSED, 0.3),
    (64, 1.0, PRESSED, 1.0),
    (64, 1.0, DRAGGED, 1.0),
    (64, 2.0, DRAGGED, 1.0),
    (64, 2.0, DRAGGED, 10.0),
    (64, 1.0, PRESSED, 0.3),
    (100, 2.0, PRESSED, 10.0),
    (100, 1.0, DRAGGED, 10.0),
    (100, 1.0, PRESSED, 1.0),
    (100, 2.0, DRAGGED, 1.0),
)
SMOKE_BLOCKS = ((8, 1.0, PRESSED, 1.0), (14, 2.0, DRAGGED, 0.3))


#: Cells along the arc and across the strip of clips, and their friction.
CLIPS = ((6, 1, 3.0), (8, 1, 1.0), (8, 1, 2.0), (8, 1, 3.0), (8, 1, 5.0), (8, 2, 3.0), (12, 1, 1.0), (12, 1, 3.0))
SLOW_NODES = 400_000


def problems(smoke):
    """Loaded bodies."""
    for p, length, traction, F in SMOKE_BLOCKS if smoke else BLOCKS:
        yield block(p, traction, F, length)
    for p in (8,) if smoke else (14, 32):
        yield straight_wedge(p)
        yield oblique_wedge(p)


def row(loaded, problem, rule, max_nodes):
    """One search by one rule, in fast and in verified arithmetic."""
    engines = []

    def make(system):
        engines.append(RULES[rule](system))
        return engines[-1]

    def timed(arithmetic):
        action = partial(search, alpha=loaded.alpha, make_engine=make, arithmetic=arithmetic, max_nodes=max_nodes)
        return least_time(lambda: problem, action, runs=RUNS, enough=ENOUGH)

    outcome, fast = timed("fast")
    solved = getattr(engines[-1], "solved", outcome.qps)
    cut, verified = outcome.stopped is not None, "-"
    if not cut:
        proven, verified = timed("verified")
        assert len(proven.solutions) == len(outcome.solutions)
    return {
        "problem": loaded.name,
        "F": loaded.alpha,
        "rule": rule,
        "roots": len(outcome.solutions),
        "nodes": outcome.nodes,
        "QPs": solved,
        "fast s": fast,
        "verified s": verified,
        "cut": "yes" if cut else "",
    }


def slow_problems(smoke):
    """Thin bodies on soft springs, and others."""
    for nx, ny, F in CLIPS[: 1 if smoke else None]:
        yield Loaded(f"clip {nx} x {ny}", 2 * nx + 1, partial(gallery.clip, nx, ny), F)
    if smoke:
        return
    for ny, F in ((8, 0.2), (16, 0.2), (16, 1.0)):
        yield Loaded(f"taper 4 x {ny}", 2 * ny, partial(gallery.taper, 4, ny), F)
    yield Loaded("pressed rings", 16, gallery.pressed_rings, 0.5)
    yield Loaded("dovetail", 14, gallery.dovetail, 0.5)
    for p in (14, 20, 32):
        yield oblique_wedge(p)
        yield straight_wedge(p)
    yield block(32, DRAGGED, 10.0, 2.0)


def slow_row(loaded, max_nodes):
    """One problem by both rules, in verified arithmetic."""
    problem = loaded.build()
    problem.condensed, problem.enclosure  # noqa: B018 (made once, outside the clock)
    line = {"problem": loaded.name, "p": loaded.p, "F": loaded.alpha, "share": share_at_root(problem, loaded.alpha)}
    found = set()
    for name, slow in (("others", False), ("slow", True)):
        make = partial(ActiveSetEngine, slow=slow)
        action = partial(search, alpha=loaded.alpha, make_engine=make, arithmetic="verified", max_nodes=max_nodes)
        outcome, seconds = least_time(lambda: problem, action, runs=1, enough=ENOUGH)
        line |= {f"nodes, {name}": outcome.nodes if outcome.stopped is None else "-", f"s, {name}": seconds}
        found |= {len(outcome.solutions)} if outcome.stopped is None else set()
    assert len(found) <= 1
    return line | {"roots": found.pop() if found else "-"}


def share_at_root(problem, alpha):
    """The share of the gap that one dual step closes at the root of the tree, in the mean over the nodes."""
    system = problem.condensed.at(alpha).scaled
    rows = [
        (kind * system.p + i, mode) for i in range(system.p) for kind, mode in status_rows(UNDECIDED, friction=True)
    ]
    root = ActiveSetEngine(system).root(*(list(part) for part in zip(*rows, strict=True)))
    return float(np.round(root.gap_closed((UNDECIDED,) * system.p), 4))


def lookahead_problems(smoke):
    """Trees of more than some hundred nodes, the clip's also in the smoke size."""
    yield Loaded("clip 8 x 1", 17, partial(gallery.clip, 8, 1), 2.0)
    if smoke:
        return
    yield Loaded("clip 8 x 1", 17, partial(gallery.clip, 8, 1), 3.0)
    for nx, F in ((12, 3.0), (12, 5.0), (16, 3.0)):
        yield Loaded(f"clip {nx} x 1", 2 * nx + 1, partial(gallery.clip, nx, 1), F)
    for nx in (8, 12, 16):
        yield Loaded(f"brake shoe {nx} x 3", 2 * nx + 1, partial(gallery.brake_shoe, nx, 3), 0.4)
    for p in (20, 32, 48, 64):
        yield oblique_wedge(p)
        yield straight_wedge(p)
    for ny in (16, 24, 32):
        yield Loaded(f"taper 4 x {ny}", 2 * ny, partial(gallery.taper, 4, ny), 0.2)
    yield Loaded("dovetail", 14, gallery.dovetail, 0.5)


def lookahead_row(loaded):
    """One verified search as it is, and one that never looks ahead; proofs are checked."""
    problem = loaded.build()
    problem.condensed, problem.enclosure  # noqa: B018 (made once, outside the clock)
    line, found = {"problem": loaded.name, "p": loaded.p, "F": loaded.alpha}, set()
    for name, nodes in (("without", 10**9), ("as it is", tree_nodes.NODES)):
        with mock.patch.object(tree_nodes, "NODES", nodes):
            start = time.process_time()
            roots = enumsol.enumerate_roots(problem, loaded.alpha)
            seconds = time.process_time() - start
        assert roots.complete
        assert enumsol.verify(problem, roots.proof).complete
        line |= {
            f"nodes, {name}": roots.stats.nodes,
            f"s, {name}": seconds,
            f"proof, {name} [kB]": roots.proof.size // 1000,
        }
        found.add(len(roots))
    (line["roots"],) = found
    return line


def main(run: Run) -> None:
    max_nodes = SMOKE_NODES if run.smoke else MAX_NODES
    rows = []
    for loaded in problems(run.smoke):
        problem = loaded.build()
        problem.condensed, problem.enclosure  # noqa: B018 (made once, outside the clock)
        found = [row(loaded, problem, rule, max_nodes) for rule in RULES]
        # all rules that finish must find the same number of roots
        assert len({line["roots"] for line in found if not line["cut"]}) <= 1
        rows += found
    run.table("branching", rows, *conclusions(rows, max_nodes))
    slow = [slow_row(loaded, SLOW_NODES) for loaded in slow_problems(run.smoke)]
    run.table("slow", slow, *slow_conclusions(slow))
    run.table("lookahead", [lookahead_row(loaded) for loaded in lookahead_problems(run.smoke)])
    run.figure("branching", draw(rows))
