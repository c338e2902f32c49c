"""Results of a history, as plain data and as text: its stages, their graph, and what is proven of it.

A stage holds the roots of one step from one start, and where each of them leaves the contact nodes. The proof of a
history is one file: the proofs of its searches, with their starts and what follows them.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np

from enumsol.arithmetic.balls import SAFE, TINY, UNIT, Ball
from enumsol.condensation.enclosure import NotEnclosedError
from enumsol.model.restart import SlipStart
from enumsol.model.statuses import FRICTIONLESS, ContactStatus
from enumsol.proof.proof_file import PROOF_VERSION
from enumsol.proof.reading import rational_text
from enumsol.proof.writer import ProofWriter
from enumsol.roots.root import Root, summary
from enumsol.support.immutable import Listed
from enumsol.support.messages import counted, html_lines, html_table
from enumsol.support.plotting import in_units
from enumsol.trusted.positions import certain_statuses, tangential_positions

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Mapping, Sequence

    from enumsol.loading.steps import LoadStep
    from enumsol.model.problem3d import AnyProblem
    from enumsol.proof.proof_file import Proof
    from enumsol.roots.root_set import RootSet
    from enumsol.roots.stability import Stability, Verdict
    from enumsol.support.array_types import Floats


@dataclass(frozen=True, eq=False)
class Stage:
    """The roots of one step from one start.

    Attributes
    ----------
    number : int
        In the order in which the stages of a history were searched.
    step : int
        From 1.
    start : SlipStart
    roots : RootSet
    problem : ContactProblem or ContactProblem3D
        The step's own: its load, its friction and the start as slip offset.
    reasons : tuple of str
        Why it is not proven that nothing else solves this step, each one sentence.
    """

    number: int
    step: int
    start: SlipStart
    roots: RootSet
    problem: Any
    reasons: tuple[str, ...]

    @property
    def largest_radius(self) -> float:
        """Largest distance of the start from its midpoint [length]."""
        return 0.0 if self.start.radius is None else float(np.max(self.start.radius))


@dataclass
class Rounding:
    """What rounding alone has left of the positions: the largest radius among those of the first step [length]."""

    first: float = 0.0

    def widened(self, found: Ball, before: SlipStart) -> SlipStart:
        """A ball as a start; what was carried over unchanged stays as it was.

        It is stated with a larger radius than was found, so that a checker on another processor, whose rounding is
        different, finds its own ball inside: by a share, and by twice what rounding has left in the first step.
        """
        kept = (found.mid == before.ball.mid) & (found.rad == before.ball.rad)
        if before.radius is None:
            self.first = max(self.first, float(np.max(found.rad, initial=0.0)))
        more = 2.0**-5 * found.rad + 2.0 * np.minimum(self.first, found.rad)
        more += 8 * UNIT * np.abs(found.mid)
        radius = np.where(kept, found.rad, (found.rad + more) * SAFE)
        offset, radius = (values.reshape(before.offset.shape, order="F") for values in (found.mid, radius))
        return SlipStart(offset, radius if np.any(radius) else None)


def start_after(stage: Stage, root: Root, rounding: Rounding) -> SlipStart | None:
    """The start of the next step after a root; None where it cannot be enclosed (theory, section 13.2)."""
    arithmetic = stage.roots.arithmetic
    if arithmetic == "fast":
        return SlipStart(stage.start.offset + root.u_t)
    if arithmetic == "exact":
        if root.exact_slips is None:
            return None
        pairs = zip(stage.start.rationals, root.exact_slips, strict=True)
        return SlipStart.of_rationals(tuple(before + slip for before, slip in pairs))
    found = _enclosed_positions(stage, root)
    return None if found is None else rounding.widened(found, stage.start)


def case_of(stage: Stage, root: Root) -> Hashable | None:
    """Equal for regular roots of one step whose ends are the same functions of the same balls; None: not known.

    In 2D what a regular root of a selection is depends on the offsets of its sticking nodes only.
    """
    if stage.roots.arithmetic != "verified" or not root.regular or root.u_t.ndim > 1:
        return None
    ball = stage.start.ball
    sticking = [k for k, status in enumerate(root.statuses) if status is ContactStatus.STICK]
    return stage.step, root.statuses, tuple(ball.mid[sticking].tolist()), tuple(ball.rad[sticking].tolist())


def _enclosed_positions(stage: Stage, root: Root) -> Ball | None:
    if root.enclosure is None or stage.roots.certified_data != "problem":
        return None
    low, high = root.enclosure.u_t[..., 0].ravel(order="F"), root.enclosure.u_t[..., 1].ravel(order="F")
    still = (low == 0) & (high == 0)
    before = stage.start.ball
    if np.all(still):
        return before
    try:
        forces, moves = _forces(root), root.enclosure.rigid_coordinates
        rigid = None if moves is None else _middle(*moves.T)
        plane = root.u_t.ndim == 1
        codes = (
            certain_statuses(forces, _middle(low, high))
            if plane
            else _certain(root, stage.problem.friction_at(root.alpha))
        )
        alpha = Fraction(root.alpha)
        shared = plane and not root.regular and root.exact_slips is None
        among = _among(root, stage.problem.friction_at(root.alpha)) if shared else None
        moved = tangential_positions(stage.problem, alpha, forces, still, before, codes, rigid=rigid, among=among)
    except NotEnclosedError:
        return None
    return moved if np.all(np.isfinite(moved.rad)) else None


def _among(root: Root, friction: Floats) -> list[frozenset[int]]:
    """The codes that the nodes may have at a root in 2D that several selections share."""
    rubs = (friction > 0).tolist()
    pairs = zip(root.active, rubs, strict=True)
    return [
        frozenset(_PLANE.index(s) if F or s is ContactStatus.OPEN else FRICTIONLESS for s in held) for held, F in pairs
    ]


def _certain(root: Root, friction: Floats) -> tuple[int, ...] | None:
    """Open, stick or slip for every node in 3D; None where a status is not certain."""
    codes = []
    for active, rubs in zip(root.active, np.any(friction > 0, axis=1).tolist(), strict=True):
        known = (
            active if rubs else {status if status is ContactStatus.OPEN else ContactStatus.SLIP for status in active}
        )
        if len(known) > 1:
            return None
        codes.append(_CODES.index(*known))
    return tuple(codes)


def _forces(root: Root) -> Ball:
    """lambda as a ball: all normal components, then the tangential ones, direction by direction."""
    assert root.enclosure is not None
    bounds = [root.enclosure.lambda_n, root.enclosure.lambda_t]
    low, high = (np.concatenate([b[..., k].ravel(order="F") for b in bounds]) for k in (0, 1))
    return _middle(low, high)


def _middle(low: Floats, high: Floats) -> Ball:
    """Balls that hold what lies between bounds, with the checker's room for underflow."""
    mid = 0.5 * low + 0.5 * high
    zero = (low == 0) & (high == 0)
    return Ball(mid, np.where(zero, 0.0, np.maximum(high - mid, mid - low) * SAFE + TINY))


def dissipated(root: Root) -> float:
    """The work of friction in a step, the sum of lambda_t . u_t over the nodes [force times length]."""
    return float(np.sum(root.lambda_t * root.u_t))


def contact_displacements(problem: AnyProblem, root: Root) -> Floats:
    """Bn u and Bt u in one column, by which roots of one step are near each other [length]."""
    return np.concatenate([root.u_n + problem.gap, (root.u_t + problem.slip_offset).ravel()])


_CODES = ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP
_PLANE = ContactStatus.OPEN, ContactStatus.STICK, ContactStatus.SLIP_PLUS, ContactStatus.SLIP_MINUS
#: The number of a step, and of a root in it.
Node = tuple[int, int]
#: Before the first step.
START: Node = (0, 0)


@dataclass(frozen=True)
class Refinement:
    """Result of halving the increments.

    Attributes
    ----------
    halvings : int
        How often the increments were halved.
    settled : bool
        The last halving changed nothing: the statuses along all histories, seen at the given steps, are the same.
    changed_at : tuple of int
        For every halving the first of the given steps up to which the statuses changed; 0 where none did.
    reason : str or None
        Why they were not halved further, if the reason is neither that nothing changed nor the limit.
    """

    halvings: int
    settled: bool
    changed_at: tuple[int, ...]
    reason: str | None = None

    def __str__(self) -> str:
        times = counted(self.halvings, "halving")
        if self.reason is not None:
            return f"not known whether they matter, {times} done: {self.reason}"
        if self.settled:
            first = [step for step in self.changed_at if step]
            earlier = f", which changed until then, from step {min(first)} on" if first else ""
            return f"the last of {times} left the statuses along all histories unchanged{earlier}"
        return f"after {times} the statuses still depend on the increments, from step {self.changed_at[-1]} on"


@dataclass(frozen=True, eq=False, repr=False)
class HistoryData:
    """The searches of a history, and what follows from them; see History.

    Attributes
    ----------
    problem : ContactProblem or ContactProblem3D
    steps : tuple of LoadStep
    arithmetic : str
    all_stages : tuple of Stage
        The roots of one step from one start each, step by step.
    parents : tuple of tuples of nodes
        Of every stage the nodes at whose ends it starts; none in the first step.
    followed : frozenset of nodes
        Whose ends start a stage, or were to start one.
    reasons : tuple of str
    seconds : float
    refinement : Refinement or None
    """

    problem: Any
    steps: tuple[LoadStep, ...]
    arithmetic: str
    all_stages: tuple[Stage, ...]
    parents: tuple[tuple[Node, ...], ...]
    followed: frozenset[Node]
    reasons: tuple[str, ...]
    seconds: float
    refinement: Refinement | None = None

    @cached_property
    def graph(self) -> nx.DiGraph:
        """Roots by their nodes, and which may follow which; see History."""
        graph = nx.DiGraph()
        graph.add_node(START, root=None)
        numbers: dict[int, int] = {}
        for stage, parents in zip(self.all_stages, self.parents, strict=True):
            for root in stage.roots:
                number = numbers.setdefault(stage.step, 0)
                numbers[stage.step] = number + 1
                node = (stage.step, number)
                values = {"stage": stage.number, "statuses": root.statuses, "alpha": float(root.alpha)}
                graph.add_node(node, root=root, dissipated=dissipated(root), **values)
                graph.add_edges_from((parent, node) for parent in parents or (START,))
        return nx.freeze(graph)

    @property
    def verdicts(self) -> Mapping[Node, Stability] | None:
        """Verdicts on all nodes that `stability` found last, or None where those of some are not known."""
        nodes = iter(node for node in self.graph if node != START)
        found: dict[Node, Stability] = {}
        for stage in self.all_stages:
            verdicts = stage.roots.verdicts if len(stage.roots) else ()
            if verdicts is None:
                return None
            found.update((node, verdict) for verdict, node in zip(verdicts, nodes, strict=False))
        return MappingProxyType(found)

    def stages(self, step: int) -> tuple[Stage, ...]:
        """The searches of one step, from 1, one for each start."""
        return Listed((stage for stage in self.all_stages if stage.step == step), "stage")

    def nodes_of(self, step: int) -> tuple[Node, ...]:
        """The nodes of one step."""
        return tuple(node for node in self.graph if node[0] == step and node != START)

    def paths(self) -> Iterator[tuple[Node, ...]]:
        """The histories one by one: the nodes from the first step to an end."""
        pending: list[tuple[Node, ...]] = [(node,) for node in reversed(list(self.graph.successors(START)))]
        while pending:
            path = pending.pop()
            following = list(self.graph.successors(path[-1]))
            if not following:
                yield path
            pending += [(*path, node) for node in reversed(following)]

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """The number of different histories up to every step, from step 1."""
        ways = {START: 1}
        for node in self.graph:
            if node != START:
                ways[node] = sum(ways[before] for before in self.graph.predecessors(node))
        return tuple(sum(ways[node] for node in self.nodes_of(k + 1)) for k in range(len(self.steps)))

    @cached_property
    def dissipated(self) -> Mapping[Node, tuple[float, float]]:
        """The work of friction from the start to every node, least and most over the histories that lead there."""
        work = {START: (0.0, 0.0)}
        for node, given in self.graph.nodes(data=True):
            if node != START:
                before = [work[parent] for parent in self.graph.predecessors(node)]
                own = given["dissipated"]
                work[node] = min(low for low, _ in before) + own, max(high for _, high in before) + own
        return MappingProxyType(work)

    @cached_property
    def unique_until(self) -> int:
        """The last step up to which it is proven that there is one history only; 0 where there is no such step."""
        number = 0
        while number < len(self.steps):
            stages = self.stages(number + 1)
            if len(stages) != 1 or stages[0].reasons or stages[0].roots.unique is not True:
                break
            number += 1
        return number

    @property
    def closing_line(self) -> str:
        """The closing line of the printed history."""
        if self.arithmetic == "fast":
            return "complete: no" if self.reasons else "complete: not proven (fast arithmetic)"
        first = self.stages(1)
        if self.unique_until:
            until = f"unique until step {self.unique_until}"
        elif first and first[0].roots.unique is False and len(first[0].roots):
            until = "not unique in step 1"
        else:
            until = "nothing is known to be unique"
        if not self.reasons and (last := self.all_stages[-1].step) and not self.nodes_of(last):
            until += f"; nothing solves step {last}"
        return f"complete: {'no' if self.reasons else 'yes (proven)'}, {until}{self._within()}"

    def _within(self) -> str:
        """Words on the bound of rigid displacements, of a body that nothing holds."""
        bounds = [stage.roots.rigid_bound for stage in self.all_stages if stage.roots.rigid_bound is not None]
        if not bounds:
            return ""
        # all histories within the least of those that are needed
        return f", {min(bounds, key=lambda bound: (not bound.needed, bound.largest)).words()}"


def history_proof(data: HistoryData) -> Proof | None:
    """Proof of the whole for ``enumsol.verify``: all searches, their starts, and which follows which.

    None where a search has none, as in fast and exact arithmetic and after an interruption, and without any search.
    """
    if not data.all_stages or any(stage.roots.proof is None for stage in data.all_stages):
        return None
    following = _following(data)
    writer = ProofWriter()
    writer.write(
        {
            "format": "enumsol-proof",
            "version": PROOF_VERSION,
            "kind": "history",
            "problem": data.problem.fingerprint,
            "p": data.problem.p,
            "steps": [_step_record(step) for step in data.steps],
            "stages": len(data.all_stages),
        }
    )
    for stage in data.all_stages:
        start, proof = stage.start, stage.roots.proof
        radius = None if start.radius is None else start.radius.ravel().tolist()
        writer.write(["s", stage.step, start.offset.ravel().tolist(), radius, following[stage.number]])
        assert proof is not None
        for record in proof.records():
            writer.write(record)
    writer.write({"stages": len(data.all_stages)})
    return writer.close()


def _step_record(step: LoadStep) -> list[Any]:
    load, friction = (None if part is None else part.ravel().tolist() for part in (step.load, step.friction))
    return [rational_text(step.exact_alpha, "alpha"), load, friction]


def _following(data: HistoryData) -> list[list[int]]:
    """For every stage the numbers of the stages that begin where a root of it ends."""
    stage_of: dict[Node, int] = {node: given["stage"] for node, given in data.graph.nodes(data=True) if node[0]}
    found: list[set[int]] = [set() for _ in data.all_stages]
    for stage, parents in zip(data.all_stages, data.parents, strict=True):
        for parent in parents:
            found[stage_of[parent]].add(stage.number)
    return [sorted(numbers) for numbers in found]


#: Lines of the tree and steps of the table that are printed at most, and reasons.
_LINES, _REASONS = 40, 8
#: How the line of a node below a branching begins, and the lines below it; of the last one otherwise.
_BRANCH = {True: ("└─ ", "   "), False: ("├─ ", "│  ")}
#: What is said of a node by its verdict.
_TOLD = {"does not run away": "", "runs away": " (runs away)", "undecided": " (running away undecided)"}
_HEADS = ("step", "alpha", "roots", "from", "histories", "dissipated")


def history_text(history: HistoryData, units: tuple[str, str] | None = None) -> str:
    """Text that print shows, with units of forces and lengths if they are given."""
    heads, body = steps_table(history, units)
    rows = [heads, *body]
    widths = (4, 10, 6, 5, 10, max(11, len(heads[5])), max(len(row[-1]) for row in rows))
    table = [" ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=False)) for row in rows]
    left = len(history.steps) - _LINES
    more = [f"   ... {counted(left, 'more step')}"] if left > 0 else []
    return "\n".join([_heading(history), *table, *more, "tree", *tree_lines(history), *_notes(history)])


def history_html(history: HistoryData) -> str:
    """HTML that a notebook shows."""
    tree = html_lines(["tree", *tree_lines(history)])
    return html_lines([_heading(history)]) + html_table(*steps_table(history)) + tree + html_lines(_notes(history))


def steps_table(
    history: HistoryData, units: tuple[str, str] | None = None
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heads and rows of the table of the steps."""
    heads = (*_HEADS[:-1], in_units(_HEADS[-1], "work", units))
    if (verdicts := history.verdicts) is None:
        return heads, _rows(history)
    away = [_away([verdicts[node].verdict for node in history.nodes_of(k + 1)]) for k in range(len(history.steps))]
    return (*heads, "run away"), [(*row, words) for row, words in zip(_rows(history), away, strict=False)]


def _away(verdicts: Sequence[Verdict]) -> str:
    """Numbers of roots of a step that run away, and that are undecided."""
    open_ones = verdicts.count("undecided")
    return f"{verdicts.count('runs away')}" + (f", {open_ones} undecided" if open_ones else "")


def tree_lines(history: HistoryData, most: int = _LINES) -> Iterator[str]:
    """The tree, a line per node: only below a branching it is indented.

    What follows a node that several lead to stands below the first of them.
    """
    graph, last, seen, verdicts = history.graph, len(history.steps), set(), history.verdicts or {}
    pending = [(node, "", "") for node in reversed(list(graph.successors((0, 0))))]
    if len(pending) > 1:
        pending = [(node, *_BRANCH[k == 0]) for k, (node, _, _) in enumerate(pending)]
    written = 0
    while pending:
        node, first, rest = pending.pop()
        written += 1
        if written > most:
            continue
        left = "" if node[0] == last or node in history.followed else " (not followed)"
        again = " (see above)" if node in seen else ""
        told = _TOLD[verdicts[node].verdict] if node in verdicts else ""
        yield f"{first}{node[0]}.{node[1]} {summary(graph.nodes[node]['statuses'])}{told}{left}{again}"
        if node in seen:
            continue
        seen.add(node)
        following = list(reversed(list(graph.successors(node))))
        for k, child in enumerate(following):
            begin, go_on = _BRANCH[k == 0] if len(following) > 1 else ("", "")
            pending.append((child, rest + begin, rest + go_on))
    if written > most:
        yield f"... {counted(written - most, 'more line')} at least"


def _heading(history: HistoryData) -> str:
    total = history.counts[-1]
    found = counted(total, "history", "histories") if total else "none reaches the last step"
    return f"History of {counted(len(history.steps), 'step')}: {found} ({history.arithmetic})"


def _rows(history: HistoryData) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for number in range(1, min(len(history.steps), _LINES) + 1):
        nodes = history.nodes_of(number)
        work = [history.dissipated[node] for node in nodes]
        span = "" if not work else _span(min(low for low, _ in work), max(high for _, high in work))
        alpha = history.steps[number - 1].alpha
        rows.append(
            (
                str(number),
                "" if alpha is None else f"{float(alpha):.6g}",
                str(len(nodes)),
                str(len(history.stages(number))),
                str(history.counts[number - 1]),
                span,
            )
        )
    return rows


def _span(low: float, high: float) -> str:
    a, b = (f"{value + 0.0:.4g}" for value in (low, high))
    return a if a == b else f"{a} to {b}"


def _notes(history: HistoryData) -> list[str]:
    lines = [f"open: {reason}" for reason in history.reasons[:_REASONS]]
    if len(history.reasons) > _REASONS:
        lines.append(f"   ... {len(history.reasons) - _REASONS} more reasons")
    if history.refinement is not None:
        lines.append(f"increments: {history.refinement}")
    return [*lines, history.closing_line]
