"""What does a form with four multipliers per node save in long searches, when should it be tried, and at what cost?

Verified searches of clamped blocks and wedges with the energy alone, with a form from the beginning (after 100 nodes),
and as they are (after 1,000): nodes, seconds, size of the proof, and seconds of its check. Then some of the blocks with
other numbers of steps of the ascent. Then blocks with 256 contact nodes: what every part of the work takes. Then long
searches of wedges with the energy, and how many of their bounds balls did not prove (theory, section 6.2). All
seconds are those of the processor, here of a machine shared with other work. Those of one problem are taken one after
the other; read their ratios. Tables ``neighbours`` and ``neighbours_trees`` are about forms with products of rows of
neighbouring nodes, which the package does not have: README.md concludes.

Read "nodes" against "nodes, energy": the gain grows with p, and there is none on wedges, where the trial says so and
costs what "seconds" has more than "seconds, energy". With a good form a block takes five nodes of the tree for every
contact node, the fewest that there can be if every one of them is branched on.

What else was tried, on prototypes of the same search (nodes with the energy, then with the variant; blocks at F = 0.3):

- steps of the ascent in the multipliers themselves, not in the logs of those that have a sign: block p = 100 838 nodes
  with 24 steps and 7,447 with 54, now 525 with six; block p = 256 of length 4 with F = 2 3,575 with 40, not finished at
  5,000 with 20, now 1,281 with six. Such steps end near the border of the cone, with forms that are good at the root
  only.
- other weights of the bound: 16 times as heavy, the ascent takes more than 16 steps at p = 256 and F = 2; a quarter to
  half of the weight is about as good.
- one-sided slip work in closed form, as far as the form stays convex, at every fourth decided node: blocks p = 16, 32
  and 64: 208, 735, 4,735 -> 131, 380, 9,628; wedge p = 20: 4,488 -> 4,270. No ascent, but it does not grow with p.
- the best form of four multipliers per node and all products of rows of a node and its two nearest neighbours, found by
  an interior-point program and handed down: oblique wedge p = 20 4,272 -> 2,392 nodes with one program at the root of
  the tree, 1,551 with 118 at every eighth level, 1,094 with 199 at every fourth; p = 32 23,108 -> 14,230 with one. A
  program took 0.4 s to 1 s at p = 20 and 8 s at p = 32, the whole search with the energy 0.14 s and 1.3 s. To be worth
  it at every eighth level, a program at p = 20 must not take longer than 0.7 ms.
- such products with the ascent (14 multipliers per node, steps not in logs): wedge p =
  14: 894 -> 418 with 75 programs of 18 ms, 60 times as long as the search with the energy; wedge p = 32: 22,606 ->
  17,045 with 1,087.
- a form at the root of wedges whatever the trial says, found with a bound 32 times as heavy (8 or 12 steps, the better
  one): p = 20, 26 and 32 pulled obliquely 4,272, 10,690 and 23,108 -> 2,598, 7,046 and 14,855 in 0.6 of the time, but
  pulled straight 1,179, 2,225 and 4,374 -> 1,256, 2,253 and 4,751 in up to 1.3 of it. With the weight in the code p =
  32 takes 21,510.
- new forms for the subtrees of wedges, four steps each after a quarter or half of the contact nodes is decided, with
  three weights of the bound: p = 14: 894 -> 877 to 1,031, p = 20: 4,272 -> 4,008 to 4,202. Four multipliers per node do
  not tell that the slip of one node rests on the others.
- with the energy alone p = 256, F = 0.3 and length 4 did not end: from 1,200 nodes on, 70 ms each, bounds of its first
  path were not proven by balls and every node below them was solved from its beginning. Forms are tried before that
  since they are tried after 1,000 nodes, and not after ten for every contact node; and such bounds are now proven.
- where a bound was not proven, the program solved again with the error of (6.2) in it, |z|^2 / (4 kappa) for breaking
  rows of displacements by z, and its children from there: wedges p = 56 and 64 229,331 and 579,651 nodes in 42 and 126
  s, where they had not ended; with (6.1) evaluated as it stands 228,670 and 576,628, and hardly a bound is left for it.
  Only with balls a million times as wide (1e-7 of S, p = 20) it still saves nodes. Taken out again.
- the form of the root for the subtrees that were left when it was made, without beginning again: block p = 100 was not
  finished at 200,000 nodes (5,062 with beginning again, 4,000 of them before; steps not in logs).
"""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import enumsol
from enumsol.search import nodes as policy
from forms import neighbours_tree
from shared.loads import DRAGGED, PRESSED, block, oblique_wedge, straight_wedge

if TYPE_CHECKING:
    from shared.results import Run

PROBLEMS = (
    *(block(p, PRESSED, 0.3) for p in (16, 32, 64, 100)),
    block(64, PRESSED, 1.0),
    block(64, DRAGGED, 0.3),
    block(100, DRAGGED, 0.3),
    block(100, PRESSED, 0.3, 2.0),
    block(100, PRESSED, 1.0),
    straight_wedge(14),
    oblique_wedge(20),
    oblique_wedge(32),
)
SMOKE_PROBLEMS = (block(16, PRESSED, 0.3), straight_wedge(8))
STEPS, SMOKE_STEPS = (0, 1, 2, 4, 8, 16), (0, 4)
#: Blocks of length 4 with so many contact nodes, and their coefficients of friction.
WIDE, SMOKE_WIDE, WIDE_FRICTION = 256, 16, (0.3, 1.0, 2.0)
#: Wedges pulled obliquely.
WEDGES, SMOKE_WEDGES = (14, 32, 48, 56, 64), (8,)
NEVER, EARLY = 10**9, 100
MAX_NODES = 41_000


@contextmanager
def changed(values):
    """The search with other constants."""
    before = {name: getattr(policy, name) for name in values}
    for name, value in values.items():
        setattr(policy, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(policy, name, value)


def searched(problem, loaded, **constants):
    """Nodes, seconds, size of the proof, seconds of its check; a dash for nodes where the search was cut."""
    with changed(constants):
        start = time.process_time()
        roots = enumsol.enumerate_roots(problem, loaded.alpha, max_nodes=MAX_NODES)
        seconds = time.process_time() - start
    start = time.process_time()
    report = enumsol.verify(problem, roots.proof)
    check = time.process_time() - start
    assert report.ok
    assert report.complete == roots.complete
    nodes = roots.stats.nodes if roots.complete else "-"
    return nodes, round(seconds, 3), round(roots.proof.size / 1e3), round(check, 3), len(roots)


def row(loaded):
    """One problem, three ways."""
    problem = loaded.build()
    problem.enclosure  # noqa: B018 (made once, outside the clock)
    enumsol.enumerate_roots(problem, loaded.alpha, max_nodes=10)
    line = {"problem": loaded.name, "F": loaded.alpha}
    ways = {", energy": {"FORM_AFTER": NEVER}, ", from the beginning": {"FORM_AFTER": EARLY}, "": {}}
    for way, constants in ways.items():
        nodes, seconds, size, check, line["roots"] = searched(problem, loaded, **constants)
        line |= {f"nodes{way}": nodes, f"seconds{way}": seconds, f"proof{way} [kB]": size, f"check{way} [s]": check}
    return line


def by_steps(loaded, choices):
    """One block with some numbers of steps."""
    problem = loaded.build()
    problem.enclosure  # noqa: B018
    for steps in choices:
        nodes, seconds, *_ = searched(problem, loaded, FORM_AFTER=EARLY, STEPS=steps)
        yield {"problem": loaded.name, "F": loaded.alpha, "steps": steps, "nodes": nodes, "seconds": seconds}


def wide(p):
    """Blocks with many contact nodes, and what every part of the work takes."""
    for F in WIDE_FRICTION:
        problem, clock = block(p, PRESSED, F, 4.0).build(), [time.process_time()]
        problem.condensed  # noqa: B018
        clock.append(time.process_time())
        problem.enclosure  # noqa: B018
        clock.append(time.process_time())
        roots = enumsol.enumerate_roots(problem, F)
        clock.append(time.process_time())
        report = enumsol.verify(problem, roots.proof)
        clock.append(time.process_time())
        names = ("condensation", "enclosure", "search", "check")
        seconds = {f"{name} [s]": b - a for name, a, b in zip(names, clock[:-1], clock[1:], strict=True)}
        yield {
            "p": p,
            "F": F,
            "n": problem.n,
            "roots": len(roots),
            "complete": "yes" if roots.complete and report.complete else "no",
            "nodes": roots.stats.nodes,
            "fallback": roots.stats.fallback_qps,
            **seconds,
        }


def wedge(loaded):
    """A long search with the energy, and how many of its bounds balls did not prove."""
    problem = loaded.build()
    problem.enclosure  # noqa: B018
    enumsol.enumerate_roots(problem, loaded.alpha, max_nodes=10)
    start = time.process_time()
    roots = enumsol.enumerate_roots(problem, loaded.alpha)
    seconds = time.process_time() - start
    start = time.process_time()
    report = enumsol.verify(problem, roots.proof)
    stats = roots.stats
    return {
        "problem": loaded.name,
        "roots": len(roots),
        "complete": "yes" if roots.complete and report.complete else "no",
        "nodes": stats.nodes,
        "not proven": stats.escalations.refined,
        "stalled": stats.fallback_qps,
        "seconds": seconds,
        "us a node": 1e6 * seconds / stats.nodes,
        "proof [kB]": round(roots.proof.size / 1e3),
        "check [s]": time.process_time() - start,
    }


def main(run: Run) -> None:
    problems = SMOKE_PROBLEMS if run.smoke else PROBLEMS
    lines = [row(loaded) for loaded in problems]
    known = [line for line in lines if "-" not in (line["nodes"], line["nodes, energy"])]
    run.table(
        "forms",
        lines,
        "seconds of a search as it is, by those with the energy: "
        + ", ".join(f"{line['problem']} {line['seconds'] / line['seconds, energy']:.2f}" for line in known),
    )
    blocks = problems[:1] if run.smoke else (problems[1], problems[3], problems[7], problems[8])
    choices = SMOKE_STEPS if run.smoke else STEPS
    run.table("steps", [line for loaded in blocks for line in by_steps(loaded, choices)])
    run.table("wide", list(wide(SMOKE_WIDE if run.smoke else WIDE)))
    run.table("wedges", [wedge(oblique_wedge(p)) for p in (SMOKE_WEDGES if run.smoke else WEDGES)])
    neighbours_tree.tables(run)
